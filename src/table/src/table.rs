//! Columns and values.

use std::fmt;

/// Value of one row in one column.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Whole number.
    Integer(i64),
    /// Real number.
    Real(f64),
    /// Truth value.
    Boolean(bool),
    /// Text.
    Text(String),
}

/// Type of the values of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnType {
    /// Whole numbers of 64 bits.
    Integer,
    /// Real numbers of 64 bits.
    Real,
    /// Truth values.
    Boolean,
    /// UTF-8 text.
    Text,
}

/// Column with missing values.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name.
    pub name: String,
    /// Type of all values.
    pub kind: ColumnType,
    /// One value per row; `None` if it is missing.
    pub cells: Vec<Option<Cell>>,
}

/// Columns of equal length.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// The columns.
    pub columns: Vec<Column>,
}

impl Cell {
    /// Returns the type of the value.
    pub fn kind(&self) -> ColumnType {
        match self {
            Self::Integer(_) => ColumnType::Integer,
            Self::Real(_) => ColumnType::Real,
            Self::Boolean(_) => ColumnType::Boolean,
            Self::Text(_) => ColumnType::Text,
        }
    }

    /// Returns the value converted to a type: whole numbers to real ones, and everything to text.
    ///
    /// # Errors
    /// The value itself, if it cannot be converted.
    pub fn converted(self, kind: ColumnType) -> Result<Self, Self> {
        match (self, kind) {
            (cell, kind) if cell.kind() == kind => Ok(cell),
            #[expect(clippy::cast_precision_loss, reason = "a column with real numbers has rounded values anyway")]
            (Self::Integer(value), ColumnType::Real) => Ok(Self::Real(value as f64)),
            (cell, ColumnType::Text) => Ok(Self::Text(cell.to_string())),
            (cell, _) => Err(cell),
        }
    }

    /// Returns whether both values have the same type and the same bits.
    pub fn is_identical(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Real(one), Self::Real(two)) => one.to_bits() == two.to_bits(),
            _ => self == other,
        }
    }
}

impl fmt::Display for Cell {
    /// Writes the value so that it reads back to the same bits.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Integer(value) => write!(out, "{value}"),
            Self::Real(value) => out.write_str(&tiprub_shell::recording::shortest(*value)),
            Self::Boolean(value) => write!(out, "{value}"),
            Self::Text(value) => out.write_str(value),
        }
    }
}

impl ColumnType {
    /// Returns the narrowest type to which all values can be converted; text if there are none.
    pub fn common<'a>(cells: impl IntoIterator<Item = &'a Cell>) -> Self {
        let wider = |one: Self, two: Self| match (one, two) {
            (one, two) if one == two => one,
            (Self::Integer, Self::Real) | (Self::Real, Self::Integer) => Self::Real,
            _ => Self::Text,
        };
        cells.into_iter().map(Cell::kind).reduce(wider).unwrap_or(Self::Text)
    }
}

impl Column {
    /// Creates a column of the narrowest type that fits all values.
    pub fn new(name: impl Into<String>, cells: Vec<Option<Cell>>) -> Self {
        let kind = ColumnType::common(cells.iter().flatten());
        // Every value can be converted to the common type.
        let convert = |cell: Cell| cell.converted(kind).unwrap_or_else(|cell| cell);
        Self { name: name.into(), kind, cells: cells.into_iter().map(|cell| cell.map(convert)).collect() }
    }
}

impl Table {
    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.cells.len())
    }

    /// Returns a column by its name.
    pub fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn column_has_the_narrowest_common_type() {
        let column = |cells: &[Cell]| Column::new("a", cells.iter().cloned().map(Some).collect());
        let (whole, real) = (Cell::Integer(2), Cell::Real(0.5));
        assert_eq!(column(std::slice::from_ref(&whole)).kind, ColumnType::Integer);
        assert_eq!(column(&[whole.clone(), real.clone()]).cells, [Some(Cell::Real(2.0)), Some(real)]);
        let mixed = column(&[whole, Cell::Boolean(true)]);
        assert_eq!(mixed.cells, [Some(Cell::Text("2".into())), Some(Cell::Text("true".into()))]);
        assert_eq!(Column::new("b", vec![None]).kind, ColumnType::Text);
    }
}
