//! Positions of the entries of a sparse matrix.

use faer::sparse::SymbolicSparseColMatRef;

/// Positions of the entries of a symmetric matrix: compressed columns, rows ascending, both triangles.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern {
    /// Start of each column in `rows`, and the end of the last one.
    pub starts: Vec<usize>,
    /// Row index of each entry.
    pub rows: Vec<usize>,
}

impl Pattern {
    /// Returns the number of rows and columns.
    pub fn order(&self) -> usize {
        self.starts.len() - 1
    }

    pub(crate) fn as_faer(&self) -> SymbolicSparseColMatRef<'_, usize> {
        SymbolicSparseColMatRef::new_checked(self.order(), self.order(), &self.starts, None, &self.rows)
    }

    /// Returns the pattern of the rows and columns `keep` (ascending), and the index here of each of its entries.
    pub(crate) fn principal(&self, keep: &[usize]) -> (Self, Vec<usize>) {
        let mut position = vec![usize::MAX; self.order()];
        for (new, &old) in keep.iter().enumerate() {
            position[old] = new;
        }
        let mut starts = Vec::with_capacity(keep.len() + 1);
        let (mut rows, mut entries) = (Vec::new(), Vec::new());
        starts.push(0);
        for &column in keep {
            for entry in self.starts[column]..self.starts[column + 1] {
                let row = position[self.rows[entry]];
                if row != usize::MAX {
                    rows.push(row);
                    entries.push(entry);
                }
            }
            starts.push(rows.len());
        }
        (Self { starts, rows }, entries)
    }
}
