//! Products of a matrix with a few vectors at a time.

use crate::math::octet::{Eight, Octet, OctetKernel};
use crate::math::simd::InstructionSet;

/// Number of rows in a panel of a [`PanelMatrix`], four registers of eight numbers.
pub(super) const PANEL: usize = 32;

/// A matrix in panels of [`PANEL`] rows, `[panel][column]`. The last panel is padded with zeros.
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

    /// Multiplies the matrix by `vectors`. Only their entries in `columns`, in ascending order, are used; all others must be 0. Each of the
    /// `products` is padded to whole panels.
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

/// Kernel of [`PanelMatrix::multiply`].
struct Multiply<'a, const N: usize> {
    matrix: &'a PanelMatrix,
    columns: &'a [usize],
    vectors: [&'a [f64]; N],
    products: [&'a mut [f64]; N],
}

impl<const N: usize> OctetKernel for Multiply<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<L: Octet>(self) {
        let Self { matrix, columns, vectors, products } = self;
        for (panel, table) in matrix.panels.chunks_exact(matrix.columns.max(1)).enumerate() {
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

#[cfg(test)]
mod tests {
    use super::*;
    use tiprub_test_models::SeededRandom;

    /// Products have the bits of sums over the columns in ascending order, with every instruction set.
    #[test]
    fn products_equal_sums_over_the_columns() {
        let mut random = SeededRandom(3);
        for case in 0..60 {
            let (rows, columns) = (1 + random.below(100), 1 + random.below(20));
            let entries = random.matrix(rows, columns);
            let matrix = PanelMatrix::new(rows, columns, |row, column| entries[(row, column)]);
            let used: Vec<usize> = (0..columns).filter(|_| case % 3 == 0 || random.below(2) == 0).collect();
            let mut vectors = [vec![0.0; columns], vec![0.0; columns], vec![0.0; columns]];
            vectors.iter_mut().for_each(|vector| used.iter().for_each(|column| vector[*column] = random.signed()));
            for instructions in [InstructionSet::Baseline, InstructionSet::detect()] {
                let mut products = [0; 3].map(|_| vec![f64::NAN; rows.next_multiple_of(PANEL)]);
                let [a, b, c] = &mut products;
                matrix.multiply(instructions, &used, vectors.each_ref().map(|vector| &vector[..]), [a, b, c]);
                for (product, vector) in products.iter().zip(&vectors) {
                    for (row, found) in product.iter().enumerate() {
                        let entry = |column: usize| if row < rows { entries[(row, column)] } else { 0.0 };
                        let sum = used.iter().fold(0.0, |sum, column| sum + entry(*column) * vector[*column]);
                        assert_eq!(found.to_bits(), sum.to_bits(), "case {case}, row {row}");
                    }
                }
            }
        }
    }
}
