//! Modal condensation with the same static response: modes above a cut-off are replaced by their static responses.
//!
//! For modes with ω² = Λ and modal loads F, the static response of the modes above the cut-off is Λ⁻¹F. An
//! orthonormal basis Q of these responses, expressed in the modes of QᵀΛQ, replaces them: the static response to
//! every combination of the loads stays exact, the modes below the cut-off stay unchanged, and above it there are no
//! more coordinates than loads.

use nalgebra::DMatrix;

use super::modal_form::ModalForm;

/// A response whose remainder after orthogonalisation is below this fraction of its size is round-off.
const DEPENDENT: f64 = 1e-10;
/// Relative difference of ω² below which two modes form a double mode.
const DOUBLE: f64 = 1e-6;

/// Keeps the lowest `count` modes (one fewer if a double mode would be split; rigid-body modes count) and the static
/// response of the others to `loads` (reduced coordinates × loads).
pub fn condense(modes: &ModalForm, count: usize, loads: &DMatrix<f64>) -> ModalForm {
    let squares = &modes.squares;
    if count >= squares.len() {
        return modes.clone();
    }
    let halved = count > 0 && squares[count] - squares[count - 1] < DOUBLE * squares[count];
    // A rigid-body mode has no static response that could replace it.
    let rigid = squares.iter().filter(|square| **square <= 0.0).count();
    let kept = if halved { count - 1 } else { count }.max(rigid);
    let high = modes.shapes.columns(kept, squares.len() - kept);
    let mut answers = high.transpose() * loads;
    for (mut row, square) in answers.row_iter_mut().zip(&squares[kept..]) {
        row /= *square;
    }
    let basis = orthonormal(answers);
    if basis.ncols() == 0 {
        let shapes = modes.shapes.columns(0, kept).into_owned();
        return ModalForm { squares: squares[..kept].to_vec(), shapes, condensed_from: Some(kept) };
    }
    let mut stiff = basis.clone();
    for (mut row, square) in stiff.row_iter_mut().zip(&squares[kept..]) {
        row *= *square;
    }
    let projected = basis.transpose() * stiff;
    let eigen = (0.5 * (&projected + projected.transpose())).symmetric_eigen();
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let vectors = DMatrix::from_fn(order.len(), order.len(), |i, k| eigen.eigenvectors[(i, order[k])]);
    let high = high * (basis * vectors);
    let mut shapes = DMatrix::zeros(modes.shapes.nrows(), kept + high.ncols());
    shapes.columns_mut(0, kept).copy_from(&modes.shapes.columns(0, kept));
    shapes.columns_mut(kept, high.ncols()).copy_from(&high);
    let squares = squares[..kept].iter().copied().chain(order.iter().map(|&k| eigen.eigenvalues[k])).collect();
    ModalForm { squares, shapes, condensed_from: Some(kept) }
}

/// Orthonormalises vectors by Gram-Schmidt, repeated until a pass changes nothing; omits dependent columns.
fn orthonormal(mut vectors: DMatrix<f64>) -> DMatrix<f64> {
    let mut size = 0;
    for k in 0..vectors.ncols() {
        let mut column = vectors.column(k).into_owned();
        let first = column.norm();
        let mut before = first;
        for _pass in 0..6 {
            let part = vectors.columns(0, size).tr_mul(&column);
            column -= vectors.columns(0, size) * part;
            let after = column.norm();
            if after <= DEPENDENT * first {
                break;
            }
            if after > 0.5 * before {
                vectors.set_column(size, &(column / after));
                size += 1;
                break;
            }
            before = after;
        }
    }
    vectors.columns(0, size).into_owned()
}
