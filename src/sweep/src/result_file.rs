//! The Parquet file of a part: one row per run.

use std::path::Path;

use tiprub_gallery::rom_cache::content_digest;
use tiprub_shell::{Failure, Result};
use tiprub_table::{Cell, Column, ColumnType, Table, parquet_file};

use crate::{
    plan::Plan,
    row::{DIGEST, FIRST_COLUMNS, LAST_COLUMNS, RESERVED_NAMES, RUN, Row, STATUS},
};

/// Key of the digest of all rows in the files of a sweep.
pub(crate) const ROWS_FACT: &str = "tiprub.rows";

/// Key of the digest of all values in the files of results.
const VALUES_FACT: &str = "tiprub.values";

/// Writes a table of results with its metadata and a digest of its values.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, table: &Table, facts: &[(&str, String)]) -> Result<()> {
    parquet_file::write(path, table, &[facts, &[(VALUES_FACT, values_digest(table))]].concat())
}

/// Returns whether a file with this metadata contains the results of a sweep. Outputs over time do not count as results.
pub(crate) fn is_result(facts: &[(String, String)]) -> bool {
    facts.iter().any(|(key, _)| key == VALUES_FACT)
}

/// Returns the digest of the names and the values of all columns. It does not depend on the order of columns, on columns without values, or on
/// the type of numbers, because these may change if the parts of a plan get the same columns.
fn values_digest(Table { columns }: &Table) -> String {
    let text = |cell: &Option<Cell>| match cell {
        Some(Cell::Integer(value)) => value.to_string(),
        Some(Cell::Real(value)) => value.to_string(),
        Some(Cell::Boolean(value)) => value.to_string(),
        Some(Cell::Text(value)) => format!("{value:?}"),
        None => String::new(),
    };
    let has_values = |column: &&Column| column.cells.iter().any(Option::is_some);
    let mut columns: Vec<&Column> = columns.iter().filter(has_values).collect();
    columns.sort_by(|a, b| a.name.cmp(&b.name));
    let lines = columns
        .iter()
        .map(|column| format!("{:?} {}\n", column.name, column.cells.iter().map(text).collect::<Vec<_>>().join(" ")));
    content_digest(lines.collect::<String>().as_bytes())
}

/// Returns the table of runs (numbered from 1) and their rows. It has columns for all `results`, even if no run has finished.
///
/// # Errors
/// A variable has the name of a result, which may exist in the scenes of some runs only. Its column would replace that of the result.
pub fn table(plan: &Plan, rows: &[(usize, &Row)], results: &[String]) -> Result<Table> {
    let number = |run: usize| Some(Cell::Integer(i64::try_from(run).unwrap_or(i64::MAX)));
    let runs = rows.iter().map(|(run, _)| number(*run)).collect();
    let mut columns = vec![Column { name: RUN.to_owned(), kind: ColumnType::Integer, cells: runs }];
    for (index, variable) in plan.variables.iter().enumerate() {
        let cells = rows
            .iter()
            .map(|(run, _)| plan.design.value(run - 1, index).clone().converted(plan.design.kind(index)).ok())
            .collect();
        columns.push(Column { name: variable.name.clone(), kind: plan.design.kind(index), cells });
    }
    let mut others: Vec<&str> = Vec::new();
    for name in results.iter().chain(rows.iter().flat_map(|(_, row)| row.cells.iter().map(|(name, _)| name))) {
        check_variable_names(plan, [name])?;
        if !RESERVED_NAMES.contains(&name.as_str()) && !others.contains(&name.as_str()) {
            others.push(name);
        }
    }
    let others = others.into_iter().map(|name| {
        let mut cells = rows.iter().filter_map(|(_, row)| row.cell(name)).peekable();
        let is_known = cells.peek().is_some();
        (name, if is_known { ColumnType::common(cells) } else { ColumnType::Real })
    });
    let all = FIRST_COLUMNS.into_iter().chain(others).chain(LAST_COLUMNS);
    columns.extend(all.map(|(name, kind)| {
        let cell = |row: &Row| match name {
            DIGEST => Some(Cell::Text(row.digest.clone())),
            _ => row.cell(name).cloned().and_then(|cell| cell.converted(kind).ok()),
        };
        Column { name: name.to_owned(), kind, cells: rows.iter().map(|(_, row)| cell(row)).collect() }
    }));
    Ok(Table { columns })
}

/// Rejects a variable of a plan with the name of one of these outputs or results.
pub(crate) fn check_variable_names<'a>(plan: &Plan, results: impl IntoIterator<Item = &'a String>) -> Result<()> {
    let is_variable = |name: &&String| plan.variables.iter().any(|variable| variable.name == **name);
    let Some(name) = results.into_iter().find(is_variable) else { return Ok(()) };
    let (what, remedy) = (format!("variable `{name}`"), "Give the variable another name");
    let failure = Failure::new(what, "has the name of an output or a result", remedy);
    Err(Failure { usage: true, ..failure }.at(plan.path.display()))
}

/// Reads the rows of a file that a sweep wrote before, and the names of its means and totals.
///
/// # Errors
/// The file cannot be read, is not the result of a sweep, or is damaged.
pub fn read(path: &Path) -> Result<(Vec<Row>, Vec<String>)> {
    let other = || {
        let remedy = "Give another file with --output, or remove this one";
        Failure::new(path.display(), "exists and is not the result of a sweep", remedy)
    };
    let facts = parquet_file::facts(path).map_err(|_| other())?;
    if !facts.iter().any(|(key, _)| key == ROWS_FACT) || !is_result(&facts) {
        return Err(other());
    }
    let damaged = || {
        let remedy = "Restore it, or remove it to repeat its runs";
        Failure::new(path.display(), "is damaged: its values are not those that a sweep wrote", remedy)
    };
    let table = parquet_file::read(path).map_err(|_| damaged())?;
    if !facts.iter().any(|(key, value)| key == VALUES_FACT && *value == values_digest(&table)) {
        return Err(damaged());
    }
    let Table { columns } = table;
    let position = |name: &str| columns.iter().position(|column| column.name == name);
    let (Some(first), Some(digest)) = (position(STATUS), position(DIGEST)) else { return Err(other()) };
    let rows = columns[digest].cells.iter().enumerate().filter_map(|(row, cell)| {
        let Some(Cell::Text(digest)) = cell else { return None };
        let results = columns[first..].iter().filter(|column| column.name != DIGEST);
        let cells = results.filter_map(|column| Some((column.name.clone(), column.cells[row].clone()?)));
        Some(Row { digest: digest.clone(), cells: cells.collect() })
    });
    let is_common = |name: &str| FIRST_COLUMNS.iter().chain(&LAST_COLUMNS).any(|(common, _)| *common == name);
    let names = columns[first..].iter().map(|column| column.name.clone()).filter(|name| !is_common(name));
    Ok((rows.collect(), names.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `tiprub.sweep` gives the files of all parts the same columns and types. The digest must accept this, but no other value.
    #[test]
    fn digest_accepts_common_columns_but_no_other_values() {
        let column = |name: &str, cells: &[Option<Cell>]| Column::new(name, cells.to_vec());
        let steps = column("steps", &[Some(Cell::Integer(7)), None]);
        let force = column("force", &[Some(Cell::Real(0.1)), Some(Cell::Real(-2e-300))]);
        let digest =
            |columns: &[&Column]| values_digest(&Table { columns: columns.iter().copied().cloned().collect() });
        let written = digest(&[&steps, &force]);
        let reals = column("steps", &[Some(Cell::Real(7.0)), None]);
        assert_eq!(digest(&[&force, &reals, &column("torque", &[None, None])]), written);
        for other in [
            column("steps", &[Some(Cell::Integer(8)), None]),
            column("steps", &[None, Some(Cell::Integer(7))]),
            column("step", &[Some(Cell::Integer(7)), None]),
            column("steps", &[Some(Cell::Text("7".into())), None]),
        ] {
            assert_ne!(digest(&[&other, &force]), written, "{other:?}");
        }
        assert_ne!(digest(&[&force]), written);
    }
}
