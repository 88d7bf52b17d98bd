//! Solution of 0 ≤ x ⟂ b + A x ≥ 0 by exchanging the whole active set, or by projected relaxation if that cycles.

use nalgebra::{DMatrix, DVector};

/// Largest number of exchanges before relaxation.
const EXCHANGES: usize = 50;
/// Largest number of sweeps of relaxation; below, the relative change at which they end.
const SWEEPS: usize = 100_000;
const SETTLED: f64 = 1e-13;

/// Solves the problem; `None` if neither method converges.
pub(crate) fn solve(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let count = right.len();
    let mut closed: Vec<usize> = (0..count).filter(|i| right[*i] < 0.0).collect();
    for _ in 0..EXCHANGES {
        let mut found = DVector::zeros(count);
        if !closed.is_empty() {
            let part = matrix.select_rows(&closed).select_columns(&closed);
            let Some(values) = part.lu().solve(&-right.select_rows(&closed)) else { break };
            closed.iter().zip(values.iter()).for_each(|(i, value)| found[*i] = *value);
        }
        let slack = right + matrix * &found;
        let scale = right.amax();
        let next: Vec<usize> =
            (0..count).filter(|i| found[*i] > 0.0 || (found[*i] == 0.0 && slack[*i] < -1e-13 * scale)).collect();
        if next == closed {
            return Some(found);
        }
        closed = next;
    }
    relax(matrix, right)
}

fn relax(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    let count = right.len();
    let mut found: DVector<f64> = DVector::zeros(count);
    for _ in 0..SWEEPS {
        let mut change = 0.0_f64;
        for i in 0..count {
            let slack = right[i] + matrix.row(i).transpose().dot(&found);
            let next = (found[i] - slack / matrix[(i, i)]).max(0.0);
            change = change.max((next - found[i]).abs());
            found[i] = next;
        }
        if change <= SETTLED * found.amax() {
            return Some(found);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both methods satisfy all conditions, for matrices that are symmetric positive definite plus a skew part.
    #[test]
    fn solutions_are_complementary() {
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from(u32::try_from(seed >> 40).unwrap()) / f64::from(1_u32 << 23) - 1.0
        };
        for count in [1, 3, 8, 20] {
            for _ in 0..50 {
                let (a, b) =
                    (DMatrix::from_fn(count, count, |_, _| random()), DVector::from_fn(count, |_, _| random()));
                let matrix = &a * a.transpose() + DMatrix::identity(count, count) * 0.3 + (&a - a.transpose()) * 0.1;
                for found in [solve(&matrix, &b).unwrap(), relax(&matrix, &b).unwrap()] {
                    let slack = &b + &matrix * &found;
                    for i in 0..count {
                        assert!(found[i] >= 0.0 && slack[i] >= -1e-9 && (found[i] * slack[i]).abs() < 1e-9);
                    }
                }
            }
        }
    }
}
