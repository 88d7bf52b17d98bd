//! CSV files as input.

use std::path::Path;

use tiprub_shell::{Failure, Result};

use crate::{Cell, Column, Table};

/// Maximum size of a file (bytes).
const LARGEST: u64 = 512 << 20;

/// Reads a CSV file with a line of names. Every column has the narrowest type that fits all its values: whole numbers, real numbers, `true` and
/// `false`, or text.
///
/// # Errors
/// The file cannot be read, a line has another number of values, or a name is missing or occurs twice.
pub fn read(path: &Path) -> Result<Table> {
    let bytes =
        tiprub_format::read_file(path, LARGEST).map_err(|error| Failure::file(path, "cannot be read", &error))?;
    let wrong = |problem: String, remedy: &str| Failure::new(path.display(), problem, remedy);
    // Spreadsheets begin UTF-8 files with a mark.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
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
    let mut columns: Vec<Vec<Option<Cell>>> = vec![Vec::new(); names.len()];
    for record in reader.records() {
        let record = record.map_err(|error| wrong(error.to_string(), "Give one value per column in every line"))?;
        for (column, text) in columns.iter_mut().zip(&record) {
            column.push((!text.is_empty()).then(|| value(text)));
        }
    }
    let columns = names.iter().zip(columns).map(|(name, cells)| Column::new(name, cells)).collect();
    Ok(Table { columns })
}

/// Returns the value with the narrowest type.
fn value(text: &str) -> Cell {
    let whole = || text.parse().ok().map(Cell::Integer);
    let real = || text.parse().ok().map(Cell::Real);
    let truth = || text.parse().ok().map(Cell::Boolean);
    whole().or_else(real).or_else(truth).unwrap_or_else(|| Cell::Text(text.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ColumnType;

    #[test]
    fn columns_get_types_and_errors_name_the_file() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.csv");
        std::fs::write(&path, "\u{feff}speed, modes ,scheme,on\n# remark\n1e3,20,galerkin,true\n2,40,,false\n")
            .unwrap();
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
}
