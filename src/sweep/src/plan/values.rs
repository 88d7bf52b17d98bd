//! Values in a plan: lists, ranges and start values.

use serde::Deserialize;
use tiprub_shell::{Failure, Result};
use tiprub_table::Cell;
use toml::Value;

use crate::design::MOST_RUNS;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RangeEntry {
    from: f64,
    to: f64,
    count: usize,
    #[serde(default)]
    spacing: Spacing,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Spacing {
    #[default]
    Linear,
    Logarithmic,
}

/// Returns the value of a key of the scene file.
pub(crate) fn field_value(cell: &Cell) -> Value {
    match cell {
        Cell::Integer(value) => Value::Integer(*value),
        Cell::Real(value) => Value::Float(*value),
        Cell::Boolean(value) => Value::Boolean(*value),
        // A list in a table of values is a text.
        Cell::Text(text) if text.starts_with(['[', '{']) => {
            let parsed = toml::from_str::<toml::Table>(&format!("value = {text}"));
            parsed
                .ok()
                .filter(|table| table.len() == 1)
                .and_then(|mut table| table.remove("value"))
                .unwrap_or_else(|| Value::String(text.clone()))
        }
        Cell::Text(text) => Value::String(text.clone()),
    }
}

/// Returns the values of a list or a range.
pub(super) fn cells(values: &Value) -> Result<Vec<Cell>> {
    match values {
        Value::Array(list) => list.iter().map(cell).collect(),
        Value::Table(_) => {
            let range: RangeEntry = values.clone().try_into().map_err(|error: toml::de::Error| {
                Failure::new("values", error.message(), "Give { from = ..., to = ..., count = ... }")
            })?;
            range.cells()
        }
        _ => Err(Failure::new("values", "are neither a list nor a range", "Give a list, or { from, to, count }")),
    }
}

impl RangeEntry {
    fn cells(&self) -> Result<Vec<Cell>> {
        let Self { from, to, count, spacing } = *self;
        let wrong = |problem: &str, remedy: &str| Err(Failure::new("values", problem, remedy));
        if !(from.is_finite() && to.is_finite() && (2..=MOST_RUNS).contains(&count)) {
            return wrong("the range is not usable", "Give finite ends and a count of 2 or more");
        }
        if spacing == Spacing::Logarithmic && !(from > 0.0 && to > 0.0) {
            return wrong("the ends of a logarithmic range are not positive", "Give positive ends, or linear spacing");
        }
        let value = |index: usize| match index {
            0 => from,
            _ if index + 1 == count => to,
            _ => {
                let fraction = index as f64 / (count - 1) as f64;
                match spacing {
                    Spacing::Linear => from + (to - from) * fraction,
                    Spacing::Logarithmic => from * (to / from).powf(fraction),
                }
            }
        };
        Ok((0..count).map(|index| Cell::Real(value(index))).collect())
    }
}

fn cell(value: &Value) -> Result<Cell> {
    Ok(match value {
        Value::Integer(value) => Cell::Integer(*value),
        Value::Float(value) => Cell::Real(*value),
        Value::Boolean(value) => Cell::Boolean(*value),
        Value::String(value) => Cell::Text(value.clone()),
        Value::Array(_) => Cell::Text(text(value)?),
        Value::Table(_) | Value::Datetime(_) => {
            return Err(Failure::new(
                "values",
                "contain a table or a date",
                "Give numbers, true, false, text or lists",
            ));
        }
    })
}

/// Returns a value as the text of a start value.
fn text(value: &Value) -> Result<String> {
    match value {
        Value::Array(list) => Ok(format!("[{}]", list.iter().map(text).collect::<Result<Vec<_>>>()?.join(", "))),
        other => Ok(cell(other)?.to_string()),
    }
}

/// Appends start values. Keys that contain dots may be nested tables.
pub(super) fn flatten(table: &toml::Table, prefix: &str, found: &mut Vec<(String, String)>) -> Result<()> {
    for (key, value) in table {
        let name = format!("{prefix}{key}");
        match value {
            Value::Table(below) => flatten(below, &format!("{name}."), found)?,
            value => found.push((name.clone(), text(value).map_err(|failure| failure.at(format!("set.{name}")))?)),
        }
    }
    Ok(())
}
