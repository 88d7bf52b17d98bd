//! Symmetric sparse matrices from entries in any order.

use std::sync::Arc;

use crate::sparse::{Pattern, SparseMatrix};

/// Entries (row, column, value), indices from 0; repeated entries add up.
#[derive(Debug, Default, Clone)]
pub(super) struct Entries {
    pub items: Vec<(usize, usize, f64)>,
}

impl Entries {
    /// Adds all entries of a matrix with renumbered rows and columns.
    pub(crate) fn add_matrix(&mut self, matrix: &SparseMatrix, name: impl Fn(usize) -> usize) {
        let pattern = &matrix.pattern;
        for column in 0..matrix.order() {
            for entry in pattern.starts[column]..pattern.starts[column + 1] {
                self.items.push((name(pattern.rows[entry]), name(column), matrix.values[entry]));
            }
        }
    }
}

/// Returns K and M with a common pattern. Both triangles must be given, with equal values.
pub(super) fn symmetric_pair(order: usize, stiffness: Entries, mass: Entries) -> (SparseMatrix, SparseMatrix) {
    let (stiffness, mass) = (by_column(order, stiffness), by_column(order, mass));
    let mut pattern = Pattern { starts: vec![0], rows: Vec::new() };
    let (mut stiffness_values, mut mass_values) = (Vec::new(), Vec::new());
    for column in 0..order {
        let (k, m) = (&stiffness[column], &mass[column]);
        let (mut i, mut j) = (0, 0);
        while i < k.len() || j < m.len() {
            let row = k.get(i).map_or(usize::MAX, |entry| entry.0).min(m.get(j).map_or(usize::MAX, |entry| entry.0));
            pattern.rows.push(row);
            stiffness_values.push(sum_at(k, &mut i, row));
            mass_values.push(sum_at(m, &mut j, row));
        }
        pattern.starts.push(pattern.rows.len());
    }
    let pattern = Arc::new(pattern);
    (
        SparseMatrix { pattern: Arc::clone(&pattern), values: stiffness_values },
        SparseMatrix { pattern, values: mass_values },
    )
}

/// Returns the sum of the entries of one row from `next` on, and advances `next` behind them.
fn sum_at(column: &[(usize, f64)], next: &mut usize, row: usize) -> f64 {
    let mut sum = 0.0;
    while let Some((_, value)) = column.get(*next).filter(|entry| entry.0 == row) {
        sum += value;
        *next += 1;
    }
    sum
}

/// Returns rows and values of each column, rows ascending; repeated entries keep their order.
fn by_column(order: usize, entries: Entries) -> Vec<Vec<(usize, f64)>> {
    let mut columns = vec![Vec::new(); order];
    for (row, column, value) in entries.items {
        columns[column].push((row, value));
    }
    columns.iter_mut().for_each(|column| column.sort_by_key(|entry| entry.0));
    columns
}
