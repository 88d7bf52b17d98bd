//! CSV files as input.

use std::path::Path;

use tiprub_shell::{Failure, Result};

use crate::{Cell, Column, ColumnType, Table};

/// Maximum size of a file (bytes).
const LARGEST: u64 = 512 << 20;

/// Reads a CSV file with a line of names. Every column has the narrowest type that fits all its values: whole numbers, real numbers, `true` and
/// `false`, or text. Columns of text keep their characters. Numbers with leading zeros or a plus sign, and numbers beyond the range of 64 bits, are text.
///
/// # Errors
/// The file cannot be read, a line has another number of values, or a name is missing or occurs twice.
pub fn read(path: &Path) -> Result<Table> {
    let bytes =
        tiprub_format::read_file(path, LARGEST).map_err(|error| Failure::file(path, "cannot be read", &error))?;
    let wrong = |problem: String, remedy: &str| Failure::new(path.display(), problem, remedy);
    // Spreadsheets begin UTF-8 files with a mark.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let names = reader.headers().map_err(|error| wrong(error.to_string(), "Save the file as UTF-8"))?.clone();
    if names.is_empty() {
        return Err(wrong("is empty".to_owned(), "Give the names of the columns in the first line"));
    }
    for (index, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(wrong(format!("column {} has no name", index + 1), "Give the names in the first line"));
        }
        if names.iter().take(index).any(|other| other == name) {
            return Err(wrong(format!("two columns have the name `{name}`"), "Give each column its own name"));
        }
    }
    let mut columns: Vec<Vec<Option<String>>> = vec![Vec::new(); names.len()];
    for record in reader.records() {
        let record = record.map_err(|error| wrong(error.to_string(), "Give one value per column in every line"))?;
        for (column, text) in columns.iter_mut().zip(&record) {
            column.push((!text.is_empty()).then(|| text.to_owned()));
        }
    }
    let columns = names.iter().zip(columns).map(|(name, texts)| column(name, texts)).collect();
    Ok(Table { columns })
}

/// Returns a column of the narrowest type.
fn column(name: &str, texts: Vec<Option<String>>) -> Column {
    let typed = Column::new(name, texts.iter().map(|text| text.as_deref().map(value)).collect());
    if typed.kind != ColumnType::Text {
        return typed;
    }
    Column { cells: texts.into_iter().map(|text| text.map(Cell::Text)).collect(), ..typed }
}

/// Returns the value with the narrowest type.
fn value(text: &str) -> Cell {
    let digits = text.strip_prefix('-').unwrap_or(text);
    let has_leading_zero =
        digits.strip_prefix('0').is_some_and(|rest| rest.starts_with(|next: char| next.is_ascii_digit()));
    let is_plain = !(digits.starts_with('+') || has_leading_zero);
    let is_whole = digits.bytes().all(|byte| byte.is_ascii_digit());
    let whole = || text.parse().ok().filter(|_| is_plain).map(Cell::Integer);
    let real = || text.parse().ok().filter(|value: &f64| is_plain && !is_whole && value.is_finite()).map(Cell::Real);
    let truth = || text.parse().ok().map(Cell::Boolean);
    whole().or_else(real).or_else(truth).unwrap_or_else(|| Cell::Text(text.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_get_types_and_errors_name_the_file() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.csv");
        std::fs::write(&path, "\u{feff}speed, modes ,scheme,on\n1e3,20,galerkin,true\n2,40,,false\n").unwrap();
        let table = read(&path).unwrap();
        let kinds: Vec<_> = table.columns.iter().map(|column| (column.name.as_str(), column.kind)).collect();
        let expected = [ColumnType::Real, ColumnType::Integer, ColumnType::Text, ColumnType::Boolean];
        assert_eq!(kinds, ["speed", "modes", "scheme", "on"].into_iter().zip(expected).collect::<Vec<_>>());
        assert_eq!(table.column("scheme").unwrap().cells[1], None);
        for (text, problem) in
            [("", "is empty"), ("a,a\n1,2\n", "two columns"), ("a,\n1,2\n", "has no name"), ("a,b\n1\n", "fields")]
        {
            std::fs::write(&path, text).unwrap();
            let failure = read(&path).unwrap_err();
            assert!(failure.problem.contains(problem) && failure.what.contains("a.csv"), "{failure}");
        }
    }

    /// Different labels stay different, and no line is left out.
    #[test]
    fn texts_keep_their_characters() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.csv");
        let texts = ["#1", "12e456", "1e3", "nan", "007", "+5", "9223372036854775808", "0.5"];
        std::fs::write(&path, format!("id\n{}\n", texts.join("\n"))).unwrap();
        let cells: Vec<String> = read(&path).unwrap().columns[0].cells.iter().flatten().map(Cell::to_string).collect();
        assert_eq!(cells, texts);
        for (text, kind) in [
            ("1e3\n-0.5\n0\n0e0", ColumnType::Real),
            ("-3\n0\n40", ColumnType::Integer),
            ("1\n007", ColumnType::Text),
            ("9223372036854775808", ColumnType::Text),
        ] {
            std::fs::write(&path, format!("id\n{text}\n")).unwrap();
            assert_eq!(read(&path).unwrap().columns[0].kind, kind, "{text}");
        }
    }
}
