//! Static flexibility and forced response at the contact nodes, compared with the full model, since frequency
//! deviations do not measure the accuracy of contact.
//!
//! With the lowest modes Φ of the full model, (K − ω²M)⁻¹B = Φ(Λ − ω²)⁻¹ΦᵀB + Y, and Y, without these modes, is the
//! series Σ ω²ʲ (K⁻¹M)ʲ K⁻¹(B − MΦΦᵀB), which converges below the next frequency. With its terms V_j, BᵀV_(i+j+1) =
//! V_iᵀMV_j: twice as many terms as solutions with K.

use faer::Mat;
use nalgebra::DMatrix;
use tiprub_core::scene::rom::{DisplacementFrame, RomChecks};

use super::FullModes;
use crate::sparse::{SparseMatrix, add_tall, tall_product};

/// Number of solutions with K.
const TERMS: usize = 12;
/// Largest ω², as a fraction of that of the last known mode: the series converges at least like powers of this
/// fraction.
const REACH: f64 = 0.5;

/// Reduced model in terms of the contact nodes.
pub(super) struct ContactResponse<'a> {
    /// ω² of all modes.
    pub squares: &'a [f64],
    /// Modes at the contact coordinates, 3·nodes × modes.
    pub shapes: DMatrix<f64>,
}

/// Adds the deviations to the checks of a supported structure; along the radii if the frame has radial directions.
pub(super) fn with_responses(
    checks: RomChecks,
    full: &FullModes,
    mass: &SparseMatrix,
    loads: &Mat<f64>,
    seen: &ContactResponse<'_>,
    frame: DisplacementFrame,
) -> RomChecks {
    if full.shift != 0.0 {
        return checks;
    }
    let rows: Vec<usize> =
        (0..loads.ncols()).filter(|row| frame == DisplacementFrame::Cartesian || row % 3 == 0).collect();
    let loads = Mat::from_fn(loads.nrows(), rows.len(), |i, k| loads[(i, rows[k])]);
    let moments = Moments::of(full, mass, &loads);
    let reduced = |square: f64| response(&seen.shapes.select_rows(&rows), seen.squares, square);
    let at_rest = (moments.response(0.0), reduced(0.0));
    let per_node = rows.len() * 3 / seen.shapes.nrows();
    let flexibility = |node: usize| {
        let worst = (node * per_node..(node + 1) * per_node).map(|row| {
            let [full, own] = [&at_rest.0, &at_rest.1].map(|matrix| matrix[(row, row)]);
            (own / full - 1.0).abs()
        });
        100.0 * worst.fold(0.0, f64::max)
    };
    let frequencies = between(&full.modes.eigenvalues);
    let deviation = |square: &f64| {
        let full = moments.response(*square);
        100.0 * (&full - reduced(*square)).norm() / full.norm()
    };
    RomChecks {
        flexibility_deviation: (0..rows.len() / per_node).map(flexibility).collect(),
        response_deviation: frequencies.iter().map(deviation).collect(),
        response_frequencies: frequencies.iter().map(|square| square.sqrt() / std::f64::consts::TAU).collect(),
        ..checks
    }
}

/// Returns ω² halfway between neighbouring frequencies, as far as the series converges.
fn between(squares: &[f64]) -> Vec<f64> {
    let most = REACH * squares.last().copied().unwrap_or(0.0);
    let middles = squares.windows(2).map(|pair| (0.5 * (pair[0].sqrt() + pair[1].sqrt())).powi(2));
    middles.filter(|square| *square <= most).collect()
}

/// Returns the displacement at the contact coordinates per unit force, from modes at these coordinates.
fn response(shapes: &DMatrix<f64>, squares: &[f64], square: f64) -> DMatrix<f64> {
    let weighted = DMatrix::from_fn(shapes.nrows(), shapes.ncols(), |i, k| shapes[(i, k)] / (squares[k] - square));
    shapes * weighted.transpose()
}

/// Full model in terms of the contact coordinates.
struct Moments<'a> {
    squares: &'a [f64],
    /// Lowest modes at the contact coordinates.
    shapes: DMatrix<f64>,
    /// Coefficients of the powers ω²ʲ.
    moments: Vec<DMatrix<f64>>,
}

impl<'a> Moments<'a> {
    fn of(full: &'a FullModes, mass: &SparseMatrix, loads: &Mat<f64>) -> Self {
        let modes = &full.modes.shapes;
        let carried = mass.times(modes.as_ref());
        // X − ΦΦᵀMX.
        let without = |mut columns: Mat<f64>| {
            let share = tall_product(carried.as_ref(), columns.as_ref());
            add_tall(columns.as_mut(), -1.0, modes.as_ref(), share.as_ref());
            columns
        };
        let mut term = without(full.responses(loads.clone()));
        let mut terms = vec![tall_product(loads.as_ref(), term.as_ref())];
        for _ in 1..TERMS {
            let carried = mass.times(term.as_ref());
            terms.push(tall_product(term.as_ref(), carried.as_ref()));
            let next = without(full.responses(carried.clone()));
            terms.push(tall_product(next.as_ref(), carried.as_ref()));
            term = next;
        }
        let dense = |matrix: &Mat<f64>| DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)]);
        let shapes = dense(&tall_product(loads.as_ref(), modes.as_ref()));
        Self { squares: &full.modes.eigenvalues, shapes, moments: terms.iter().map(dense).collect() }
    }

    fn response(&self, square: f64) -> DMatrix<f64> {
        let known = response(&self.shapes, self.squares, square);
        self.moments
            .iter()
            .rev()
            .fold(DMatrix::zeros(known.nrows(), known.ncols()), |sum, moment| sum * square + moment)
            + known
    }
}
