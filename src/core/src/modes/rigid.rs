//! Rigid-body translations of an unconstrained structure.
//!
//! The unit translations t_x, t_y, t_z are null vectors of K that move every contact node by one metre along their axis.
//! Numerically, the rigid-body modes of a pencil are any basis of its null space. Here they are rotated so that the first three
//! are the translations, orthonormal in the mass: motion along a line is then the motion of these modes alone, which give the
//! momentum along an axis exactly.

use nalgebra::DMatrix;

use super::modal::ModalModel;
use crate::math::argsort;
use crate::{Error, Result, Rom};

/// Modes below this fraction of the highest frequency are treated as possibly rigid.
const RIGID_SHARE: f64 = 1e-6;
/// Tolerance for the displacement of contact nodes in a translation (m per m).
const SAME_TRANSLATION: f64 = 1e-6;

/// The translations in terms of the first three modes: t_i = Σ_j φ_j R_ji, R upper triangular.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Translations {
    factor: [[f64; 3]; 3],
}

impl Translations {
    /// Returns the velocities of the first three modes when the whole body moves with `velocity` (m/s).
    pub fn modal(&self, velocity: [f64; 3]) -> [f64; 3] {
        self.factor.map(|row| (0..3).map(|i| row[i] * velocity[i]).sum())
    }

    /// Centre-of-mass value along an axis, t_iᵀM x/t_iᵀM t_i, of a motion with the given first three modal values.
    pub fn centre(&self, axis: usize, modal: [f64; 3]) -> f64 {
        let along = |j: usize| self.factor[j][axis];
        (0..3).map(|j| along(j) * modal[j]).sum::<f64>() / self.mass(axis)
    }

    /// Mass that moves in a translation along an axis, t_iᵀM t_i (kg).
    pub fn mass(&self, axis: usize) -> f64 {
        (0..3).map(|j| self.factor[j][axis] * self.factor[j][axis]).sum()
    }
}

/// Computes the modes of a free structure, the translations first.
///
/// # Errors
/// The errors of [`ModalModel::from_rom`], and a structure that is constrained.
pub(crate) fn free_modes(rom: &Rom, damping_ratio: f64) -> Result<(ModalModel, Translations)> {
    let mut model = ModalModel::from_rom(rom, damping_ratio)?;
    let largest = model.largest_frequency();
    let rigid = model.frequencies.iter().take_while(|frequency| **frequency <= RIGID_SHARE * largest).count();
    let seen = model.contact_modes.columns(0, rigid).into_owned();
    let units = DMatrix::from_fn(seen.nrows(), 3, |row, axis| f64::from(u8::from(row % 3 == axis)));
    let Some(combination) = translations(&seen, &units) else { return Err(held(rom, &model)) };
    let (basis, factor) = orthonormal(&combination);
    let rest = complement(&basis);
    let (rest, frequencies) = uncoupled(&rest, &model.frequencies[..rigid]);

    let turn = |matrix: &mut DMatrix<f64>, first: DMatrix<f64>| {
        let others = matrix.columns(0, rigid) * &rest;
        matrix.columns_mut(0, 3).copy_from(&first);
        matrix.columns_mut(3, rigid - 3).copy_from(&others);
    };
    let shapes = model.shapes.columns(0, rigid) * &basis;
    turn(&mut model.shapes, shapes);
    // Every contact node has exactly the same motion.
    let inverse = inverse_of(&factor);
    let contact = DMatrix::from_fn(units.nrows(), 3, |row, mode| inverse[row % 3][mode]);
    turn(&mut model.contact_modes, contact);
    model.frequencies[..3].fill(0.0);
    model.frequencies[3..rigid].copy_from_slice(&frequencies);
    Ok((model, Translations { factor }))
}

/// Finds the combinations of rigid-body modes that are unit translations of all contact nodes, rigid × 3.
fn translations(seen: &DMatrix<f64>, units: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    if seen.ncols() < 3 {
        return None;
    }
    let decomposed = seen.clone().svd(true, true);
    let combination = decomposed.solve(units, 1e-9 * decomposed.singular_values.max()).ok()?;
    let off = (seen * &combination - units).amax();
    (off <= SAME_TRANSLATION).then_some(combination)
}

fn held(rom: &Rom, model: &ModalModel) -> Error {
    let hertz = model.frequencies[0] / std::f64::consts::TAU;
    Error::invalid(
        format!("ROM `{}`", rom.name),
        format!(
            "the structure is constrained: it does not have three translational rigid-body modes (lowest frequency \
             {hertz:.3e} Hz)"
        ),
        "Reduce the structure without supports and keep its rigid-body modes, or set another `motion` for it",
    )
}

/// Gram-Schmidt orthogonalisation: orthonormal columns and the upper triangular factor.
fn orthonormal(columns: &DMatrix<f64>) -> (DMatrix<f64>, [[f64; 3]; 3]) {
    let (mut basis, mut factor) = (columns.clone(), [[0.0; 3]; 3]);
    for column in 0..3 {
        // Two passes are enough for orthogonality to rounding.
        for _ in 0..2 {
            for before in 0..column {
                let share = basis.column(before).dot(&basis.column(column));
                factor[before][column] += share;
                let taken = basis.column(before) * share;
                basis.column_mut(column).zip_apply(&taken, |value, taken| *value -= taken);
            }
        }
        let length = basis.column(column).norm();
        factor[column][column] = length;
        basis.column_mut(column).unscale_mut(length);
    }
    (basis, factor)
}

fn inverse_of(factor: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let [[a, b, c], [_, d, e], [_, _, f]] = *factor;
    [[1.0 / a, -b / (a * d), (b * e / d - c) / (a * f)], [0.0, 1.0 / d, -e / (d * f)], [0.0, 0.0, 1.0 / f]]
}

/// Returns an orthonormal basis of the orthogonal complement of three orthonormal columns.
fn complement(basis: &DMatrix<f64>) -> DMatrix<f64> {
    let rows = basis.nrows();
    let eigen = (DMatrix::identity(rows, rows) - basis * basis.transpose()).symmetric_eigen();
    let kept: Vec<usize> = (0..rows).filter(|index| eigen.eigenvalues[*index] > 0.5).collect();
    eigen.eigenvectors.select_columns(&kept)
}

/// Returns the other rigid-body modes and their frequencies: exactly 0, or those of very soft modes.
fn uncoupled(rest: &DMatrix<f64>, frequencies: &[f64]) -> (DMatrix<f64>, Vec<f64>) {
    if frequencies.iter().all(|frequency| *frequency == 0.0) {
        return (rest.clone(), vec![0.0; rest.ncols()]);
    }
    let weighted = DMatrix::from_fn(rest.nrows(), rest.ncols(), |i, j| frequencies[i] * frequencies[i] * rest[(i, j)]);
    let eigen = (rest.transpose() * weighted).symmetric_eigen();
    let order = argsort(eigen.eigenvalues.as_slice());
    let values = order.iter().map(|index| eigen.eigenvalues[*index].max(0.0).sqrt()).collect();
    (rest * eigen.eigenvectors.select_columns(&order), values)
}
