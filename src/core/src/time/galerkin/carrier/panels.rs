//! Products of mode shapes with few vectors at a time.

use crate::math::octet::{Eight, Octet, OctetKernel};
use crate::math::simd::InstructionSet;

/// Number of rows in a panel of a [`PanelMatrix`].
pub(super) const PANEL: usize = 32;

/// A matrix in panels of [`PANEL`] rows, `[panel][column]`, the last of which is padded with zeros.
#[derive(Debug, Clone)]
pub(super) struct PanelMatrix {
    panels: Vec<[Eight; PANEL / 8]>,
    columns: usize,
}

impl PanelMatrix {
    /// Creates a matrix from its entries at (row, column).
    pub fn new(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let mut panels = vec![[Eight::ZERO; PANEL / 8]; rows.div_ceil(PANEL) * columns];
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            panels[row / PANEL * columns + column][row % PANEL / 8].0[row % 8] = entry(row, column);
        }
        Self { panels, columns }
    }

    /// Multiplies the matrix by vectors of which only the entries in `columns`, in ascending order, differ from 0. Products are padded to whole
    /// panels.
    pub fn multiply<const N: usize>(
        &self,
        instructions: InstructionSet,
        columns: &[usize],
        vectors: [&[f64]; N],
        products: [&mut [f64]; N],
    ) {
        instructions.run_octets(Multiply { matrix: self, columns, vectors, products });
    }
}

/// See [`PanelMatrix::multiply`].
struct Multiply<'a, const N: usize> {
    matrix: &'a PanelMatrix,
    columns: &'a [usize],
    vectors: [&'a [f64]; N],
    products: [&'a mut [f64]; N],
}

impl<const N: usize> OctetKernel for Multiply<'_, N> {
    type Output = ();

    #[inline(always)]
    #[expect(clippy::needless_range_loop, reason = "iterators over these arrays do not stay in registers")]
    fn run<L: Octet>(self) {
        let Self { matrix, columns, vectors, products } = self;
        for (panel, table) in matrix.panels.chunks_exact(matrix.columns).enumerate() {
            let mut sums = [[L::zero(); PANEL / 8]; N];
            for column in columns {
                let entries = &table[*column];
                let entries = [L::load(&entries[0]), L::load(&entries[1]), L::load(&entries[2]), L::load(&entries[3])];
                for set in 0..N {
                    let factor = L::splat(vectors[set][*column]);
                    for block in 0..PANEL / 8 {
                        sums[set][block] = sums[set][block] + entries[block] * factor;
                    }
                }
            }
            for set in 0..N {
                let products = products[set][panel * PANEL..][..PANEL].as_chunks_mut::<8>().0;
                for block in 0..PANEL / 8 {
                    sums[set][block].write(&mut products[block]);
                }
            }
        }
    }
}
