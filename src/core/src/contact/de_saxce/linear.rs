//! Dense linear algebra of the Newton steps: column-major storage, operations on whole columns.
//!
//! The loops are compiled per instruction set and contain neither fused multiply-add nor horizontal sums.

use crate::math::simd::Kernel;

/// Columns factorised together: their multipliers stay in the first-level cache while the rest is updated.
pub(super) const PANEL: usize = 8;

/// Adds `columns · factors` to `target` for three neighbouring columns; with `MAGNITUDES` it adds the absolute values
/// of the products.
pub(super) struct AddColumns<'a, const MAGNITUDES: bool> {
    pub(super) columns: &'a [f64],
    pub(super) factors: [f64; 3],
    pub(super) target: &'a mut [f64],
}

impl<const MAGNITUDES: bool> Kernel for AddColumns<'_, MAGNITUDES> {
    #[inline(always)]
    fn run(self) {
        let rows = self.target.len();
        let (first, rest) = self.columns.split_at(rows);
        let (second, third) = rest.split_at(rows);
        let third = &third[..rows];
        let [a, b, c] = self.factors;
        let term = |value: f64| if MAGNITUDES { value.abs() } else { value };
        for row in 0..rows {
            self.target[row] += term(first[row] * a) + term(second[row] * b) + term(third[row] * c);
        }
    }
}

/// Solution of `matrix · x = right` in place by elimination with row exchanges; `right` returns x, `matrix` is destroyed. The matrix is
/// `order` × `order` by columns. The result is false if a pivot vanishes or is not finite.
pub(crate) struct Eliminate<'a> {
    pub(crate) order: usize,
    pub(crate) matrix: &'a mut [f64],
    pub(crate) right: &'a mut [f64],
    pub(crate) regular: &'a mut bool,
}

impl Kernel for Eliminate<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { order, matrix, right, regular } = self;
        *regular = false;
        for start in (0..order).step_by(PANEL) {
            let width = PANEL.min(order - start);
            let mut exchanges = [0; PANEL];
            if !factorise_panel(order, matrix, start, width, &mut exchanges) {
                return;
            }
            let (left, trailing) = matrix.split_at_mut((start + width) * order);
            let panel = &left[start * order..];
            for column in trailing.chunks_exact_mut(order) {
                update_column(order, panel, start, width, &exchanges, column);
            }
            update_column(order, panel, start, width, &exchanges, right);
        }
        for row in (0..order).rev() {
            let (head, tail) = right.split_at_mut(row);
            let column = &matrix[row * order..row * order + order];
            tail[0] /= column[row];
            let value = tail[0];
            for (entry, upper) in head.iter_mut().zip(column) {
                *entry -= upper * value;
            }
        }
        *regular = right.iter().all(|value| value.is_finite());
    }
}

/// Eliminates below the diagonal within the panel; row exchanges are recorded relative to `start`.
#[inline(always)]
fn factorise_panel(order: usize, matrix: &mut [f64], start: usize, width: usize, exchanges: &mut [usize]) -> bool {
    for local in 0..width {
        let row = start + local;
        let panel = &mut matrix[start * order..(start + width) * order];
        let column = &panel[local * order..(local + 1) * order];
        let pivot = (row..order).fold(row, |best, r| if column[r].abs() > column[best].abs() { r } else { best });
        exchanges[local] = pivot;
        let value = column[pivot];
        if value == 0.0 || !value.is_finite() {
            return false;
        }
        for column in panel.chunks_exact_mut(order) {
            column.swap(row, pivot);
        }
        let (done, rest) = panel.split_at_mut((local + 1) * order);
        let column = &mut done[local * order..];
        for entry in &mut column[row + 1..] {
            *entry /= value;
        }
        for other in rest.chunks_exact_mut(order) {
            let factor = other[row];
            for (entry, multiplier) in other[row + 1..].iter_mut().zip(&column[row + 1..]) {
                *entry -= multiplier * factor;
            }
        }
    }
    true
}

/// Applies the panel's exchanges and elimination to one column outside it.
#[inline(always)]
fn update_column(
    order: usize,
    panel: &[f64],
    start: usize,
    width: usize,
    exchanges: &[usize; PANEL],
    column: &mut [f64],
) {
    for local in 0..width {
        column.swap(start + local, exchanges[local]);
    }
    for local in 0..width {
        let factor = column[start + local];
        for below in local + 1..width {
            column[start + below] -= panel[local * order + start + below] * factor;
        }
    }
    let (head, tail) = column.split_at_mut(start + width);
    if width < PANEL {
        return;
    }
    let factors: [f64; PANEL] = std::array::from_fn(|local| head[start + local]);
    let multipliers: [&[f64]; PANEL] =
        std::array::from_fn(|local| &panel[local * order + start + width..(local + 1) * order][..tail.len()]);
    for row in 0..tail.len() {
        let mut value = tail[row];
        for local in 0..PANEL {
            value -= multipliers[local][row] * factors[local];
        }
        tail[row] = value;
    }
}
