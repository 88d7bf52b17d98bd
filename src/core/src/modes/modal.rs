//! Modal form of a reduced-order model: M q̈ + D q̇ + K q = f becomes q̈ + 2ξω q̇ + ω² q = φᵀf per mode.
//!
//! For modal damping the two forms are algebraically identical; prediction then costs O(number of modes).

use nalgebra::{ComplexField, DMatrix, Scalar, SymmetricEigen};
use tiprub_cosim::shown;

use crate::math::{argsort, real};
use crate::modes::schemes::{ModeCoefficients, Velocity};
use crate::scene::method::Scheme;
use crate::scene::rom::cholesky;
use crate::{Error, Result, Rom};

/// Eigenvalues below this fraction of the largest are not resolved by the eigenproblem; their Rayleigh quotient is used.
const RIGID_FRACTION: f64 = 1e-13;

/// Modes of the reduced pencil (K, M), mass-normalised; complex (`T`) for nodal diameters of coupled sectors.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModalModel<T: Scalar = f64> {
    /// Undamped angular frequencies ω (rad/s), ascending; exactly 0 for rigid-body modes.
    pub frequencies: Vec<f64>,
    /// Damping ratios ξ (-), one per mode.
    pub damping_ratios: Vec<f64>,
    /// Displacement of the contact rows per unit modal coordinate, rows × modes.
    pub contact_modes: DMatrix<T>,
    /// Mass-normalised mode shapes in reduced coordinates, n × modes: reduced = shapes · modal.
    pub shapes: DMatrix<T>,
    /// Number of the highest modes that massless-boundary treats as quasi-static.
    pub quasi_static: usize,
}

/// One mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Oscillator {
    /// Angular frequency ω (rad/s).
    pub frequency: f64,
    /// Damping ratio ξ.
    pub damping_ratio: f64,
    /// True if it has inertia even where the highest modes are quasi-static.
    is_inertial: bool,
}

impl Oscillator {
    /// Returns whether the mode has inertia under a scheme.
    pub fn is_dynamic(&self, scheme: Scheme) -> bool {
        self.is_inertial || !scheme.properties().quasi_static
    }

    /// Coefficients at the step size `step` (s).
    pub fn coefficients(&self, scheme: Scheme, step: f64) -> ModeCoefficients {
        ModeCoefficients::of_mode(scheme, self.is_dynamic(scheme), self.frequency, self.damping_ratio, step)
    }

    /// Velocity coefficients at the step size `step` (s); a quasi-static mode has none.
    pub fn velocity(&self, scheme: Scheme, step: f64) -> Velocity {
        if self.is_dynamic(scheme) {
            scheme.velocity(self.frequency, self.damping_ratio, step)
        } else {
            Velocity::default()
        }
    }
}

/// Effects of spin in modal coordinates (see [`crate::scene::rom::Spin`]).
#[derive(Debug, Clone, PartialEq)]
pub struct ModalSpin {
    /// Speed of the stiffness that defines the modes (rad/s).
    pub reference_speed: f64,
    /// Temperature of the stiffness that defines the modes (K).
    pub reference_temperature: f64,
    /// Change of the stiffness per kelvin, −s φᵀKφ, modes²; `None` without softening.
    pub softening: Option<DMatrix<f64>>,
    /// φᵀK₁φ, modes².
    pub stiffness_speed2: DMatrix<f64>,
    /// φᵀK₂φ, modes².
    pub stiffness_speed4: DMatrix<f64>,
    /// φᵀGφ, modes², skew-symmetric.
    pub coriolis: DMatrix<f64>,
}

impl ModalSpin {
    /// Projects the spin matrices of a ROM; `reference_speed` is the speed for which `model` was computed.
    pub fn new(spin: &crate::scene::rom::Spin, model: &ModalModel, reference_speed: f64) -> Self {
        let shapes = &model.shapes;
        let project = |matrix: &DMatrix<f64>| shapes.transpose() * matrix * shapes;
        let symmetric = |matrix: &DMatrix<f64>| {
            let projected = project(matrix);
            (&projected + projected.transpose()) * 0.5
        };
        let coriolis = project(&spin.coriolis);
        Self {
            reference_speed,
            reference_temperature: 0.0,
            softening: None,
            stiffness_speed2: symmetric(&spin.stiffness_speed2),
            stiffness_speed4: symmetric(&spin.stiffness_speed4),
            coriolis: (&coriolis - coriolis.transpose()) * 0.5,
        }
    }

    /// Creates zero matrices for modes that are not coupled by spin.
    pub(crate) fn without_spin(model: &ModalModel) -> Self {
        let none = || DMatrix::zeros(model.len(), model.len());
        let (reference_speed, reference_temperature, softening) = (0.0, 0.0, None);
        let (stiffness_speed2, stiffness_speed4, coriolis) = (none(), none(), none());
        Self { reference_speed, reference_temperature, softening, stiffness_speed2, stiffness_speed4, coriolis }
    }

    /// Adds softening: the structure loses the fraction `share` of the elastic `stiffness` of its ROM per kelvin above
    /// `temperature`, for which the modes `model` were computed.
    #[must_use]
    pub fn softened(self, stiffness: &DMatrix<f64>, model: &ModalModel, share: f64, temperature: f64) -> Self {
        let projected = model.shapes.transpose() * stiffness * &model.shapes;
        let symmetric = (&projected + projected.transpose()) * (-0.5 * share);
        Self { reference_temperature: temperature, softening: Some(symmetric), ..self }
    }
}

/// Sets one ratio for all modes; the first modes have their `own`. Each value is repeated `copies` times in `ratios`.
/// Returns whether a ratio has changed.
pub(crate) fn fill_ratios(ratios: &mut [f64], ratio: f64, own: &[f64], copies: usize) -> bool {
    let mut has_changed = false;
    for (mode, target) in ratios.iter_mut().enumerate() {
        let ratio = own.get(mode / copies).copied().unwrap_or(ratio);
        has_changed |= target.to_bits() != ratio.to_bits();
        *target = ratio;
    }
    has_changed
}

impl<T: Scalar> ModalModel<T> {
    /// Creates modes with one damping ratio; the highest, one per contact row, are those that can be quasi-static.
    pub(super) fn new(eigenvalues: &[f64], damping_ratio: f64, contact_modes: DMatrix<T>, shapes: DMatrix<T>) -> Self {
        Self {
            damping_ratios: vec![damping_ratio; eigenvalues.len()],
            frequencies: eigenvalues.iter().map(|value| value.sqrt()).collect(),
            quasi_static: contact_modes.nrows(),
            contact_modes,
            shapes,
        }
    }

    /// Number of modes.
    pub fn len(&self) -> usize {
        self.frequencies.len()
    }

    /// Returns whether there are no modes.
    pub fn is_empty(&self) -> bool {
        self.frequencies.is_empty()
    }

    /// Number of modes that have inertia if the highest are quasi-static.
    pub(crate) fn inertial_modes(&self) -> usize {
        self.len().saturating_sub(self.quasi_static)
    }

    /// Number of modes with inertia under a scheme; the others are the highest.
    pub fn dynamic_modes(&self, scheme: Scheme) -> usize {
        if scheme.properties().quasi_static { self.inertial_modes() } else { self.len() }
    }

    /// Returns a mode if there is one, with its frequency multiplied by `factor` (mistuning; 1 if tuned).
    pub(super) fn oscillator(&self, mode: usize, factor: f64) -> Option<Oscillator> {
        let is_inertial = mode < self.inertial_modes();
        let (frequency, damping_ratio) = (self.frequencies.get(mode)? * factor, *self.damping_ratios.get(mode)?);
        Some(Oscillator { frequency, damping_ratio, is_inertial })
    }

    /// Coefficients of one mode at the step size `step` (s), with its frequency multiplied by `factor` (mistuning; 1 if tuned).
    pub fn coefficient(&self, mode: usize, factor: f64, scheme: Scheme, step: f64) -> ModeCoefficients {
        self.oscillator(mode, factor).map_or_else(ModeCoefficients::default, |of| of.coefficients(scheme, step))
    }

    /// Largest undamped angular frequency (rad/s).
    pub fn largest_frequency(&self) -> f64 {
        self.frequencies.iter().fold(0.0, |largest, value| f64::max(largest, *value))
    }
}

impl ModalModel {
    /// Solves the symmetric eigenproblem of the ROM's matrices and assigns one damping ratio to all modes.
    ///
    /// # Errors
    /// The ROM is invalid, or a stiffness is not positive semidefinite.
    pub fn from_rom(rom: &Rom, damping_ratio: f64) -> Result<Self> {
        rom.validate()?;
        Self::at_rest(rom, damping_ratio)
    }

    /// Computes the modes of a valid ROM at rest.
    ///
    /// # Errors
    /// A damping ratio out of range, or a stiffness that is not positive semidefinite.
    pub(crate) fn at_rest(rom: &Rom, damping_ratio: f64) -> Result<Self> {
        Self::at_stiffness(rom, &rom.stiffness, damping_ratio)
    }

    /// Computes the modes of a valid ROM at a steady speed Ω (rad/s): those of K + Ω²K₁ + Ω⁴K₂ if the ROM has spin matrices.
    ///
    /// # Errors
    /// A damping ratio out of range, and a speed at which the stiffness is not positive semidefinite.
    pub fn at_speed(rom: &Rom, damping_ratio: f64, speed: f64) -> Result<Self> {
        let Some(spin) = &rom.extras.spin else { return Self::at_rest(rom, damping_ratio) };
        let square = speed * speed;
        let stiffness = &rom.stiffness + &spin.stiffness_speed2 * square + &spin.stiffness_speed4 * (square * square);
        Self::at_stiffness(rom, &stiffness, damping_ratio)
    }

    /// Computes the modes of a valid ROM whose elastic stiffness is reduced by heat to the fraction `share`; `speed` is `None`
    /// without stiffening.
    ///
    /// # Errors
    /// The errors of [`ModalModel::at_speed`].
    pub fn softened(rom: &Rom, damping_ratio: f64, speed: Option<f64>, share: f64) -> Result<Self> {
        let mut stiffness = &rom.stiffness * share;
        if let (Some(spin), Some(speed)) = (&rom.extras.spin, speed) {
            let square = speed * speed;
            stiffness += &spin.stiffness_speed2 * square + &spin.stiffness_speed4 * (square * square);
        }
        Self::at_stiffness(rom, &stiffness, damping_ratio)
    }

    fn at_stiffness(rom: &Rom, stiffness: &DMatrix<f64>, damping_ratio: f64) -> Result<Self> {
        if !(0.0..1.0).contains(&damping_ratio) {
            return Err(Error::invalid(
                "damping_ratio",
                format!("{} is outside 0 ≤ ξ < 1", shown(damping_ratio)),
                "Give the modal damping ratio as a fraction of critical damping, for example 0.005",
            ));
        }
        let (eigenvalues, shapes) = eigenmodes(&rom.mass, stiffness, "")?;
        Ok(Self::new(&eigenvalues, damping_ratio, &rom.contact_map * &shapes, shapes))
    }

    /// Returns φᵀf of a load on the reduced coordinates.
    pub fn modal_load(&self, load: &[f64]) -> Vec<f64> {
        self.shapes.column_iter().map(|shape| shape.iter().zip(load).map(|(a, b)| a * b).sum()).collect()
    }

    /// Coefficients of all modes at the step size `step` (s).
    pub fn coefficients(&self, scheme: Scheme, step: f64) -> Vec<ModeCoefficients> {
        (0..self.len()).map(|mode| self.coefficient(mode, 1.0, scheme, step)).collect()
    }

    /// Returns the modes with the contact rows of both models, one after the other.
    pub(crate) fn seen_at_both(self, other: Self) -> Self {
        let rows = (self.contact_modes.nrows(), other.contact_modes.nrows());
        let mut contact_modes = DMatrix::zeros(rows.0 + rows.1, self.contact_modes.ncols());
        contact_modes.rows_mut(0, rows.0).copy_from(&self.contact_modes);
        contact_modes.rows_mut(rows.0, rows.1).copy_from(&other.contact_modes);
        Self { contact_modes, ..self }
    }

    /// Returns the modes with some of the contact nodes only.
    pub fn with_nodes(&self, nodes: &[usize]) -> Self {
        let rows: Vec<usize> = nodes.iter().flat_map(|node| 3 * node..3 * node + 3).collect();
        Self { contact_modes: self.contact_modes.select_rows(&rows), ..self.clone() }
    }
}

/// Number type of a pencil: real, or complex and Hermitian.
pub(super) trait ModeNumber: ComplexField<RealField = f64> {
    /// Bound on the rounding error of a Rayleigh quotient as a multiple of ε, the order and the sum of the absolute terms.
    const ROUNDING: f64;

    /// Chooses the arbitrary signs or phases of eigenvectors, so that saved numbers are comparable.
    fn fix_phases(shapes: &mut DMatrix<Self>);
}

impl ModeNumber for f64 {
    const ROUNDING: f64 = 16.0;

    /// Makes the largest entry of each eigenvector positive.
    fn fix_phases(shapes: &mut DMatrix<Self>) {
        for mut column in shapes.column_iter_mut() {
            let largest = column.iter().copied().fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
            if largest < 0.0 {
                column.neg_mut();
            }
        }
    }
}

/// Eigenvalues ω² (ascending, exactly 0 for rigid-body modes) and mass-normalised modes of K φ = ω² M φ; errors name the arrays
/// `mass` and `stiffness` with `suffix`.
pub(super) fn eigenmodes<T: ModeNumber>(
    mass: &DMatrix<T>,
    stiffness: &DMatrix<T>,
    suffix: &str,
) -> Result<(Vec<f64>, DMatrix<T>)> {
    if let Some(modes) = modal_already(mass, stiffness) {
        return Ok(modes);
    }
    let Some(lower) = cholesky(mass) else {
        let what = format!("ROM array `mass{suffix}`");
        return Err(Error::invalid(what, "not positive definite", "Regenerate the ROM"));
    };
    let half = lower.solve_lower_triangular(stiffness).unwrap_or_else(|| stiffness.clone());
    let full = lower.solve_lower_triangular(&half.adjoint()).unwrap_or(half);
    let eigen = SymmetricEigen::new((&full + full.adjoint()) * T::from_real(0.5));
    let order = argsort(eigen.eigenvalues.as_slice());
    let largest = eigen.eigenvalues.amax();
    check_semidefinite(eigen.eigenvalues[order[0]], largest, suffix)?;
    let vectors = eigen.eigenvectors.select_columns(&order);
    let mut shapes = lower.adjoint().solve_upper_triangular(&vectors).unwrap_or(vectors);
    T::fix_phases(&mut shapes);
    let values = order.iter().enumerate().map(|(mode, index)| {
        let value = eigen.eigenvalues[*index];
        if value < RIGID_FRACTION * largest { unresolved_eigenvalue(stiffness, &shapes, mode) } else { value }
    });
    let values = values.collect();
    Ok((values, shapes))
}

/// Returns modes without solving the eigenproblem if the matrices are in modal coordinates (M = I, K diagonal and ascending).
fn modal_already<T: ModeNumber>(mass: &DMatrix<T>, stiffness: &DMatrix<T>) -> Option<(Vec<f64>, DMatrix<T>)> {
    let order = mass.nrows();
    let diagonal: Vec<f64> = (0..order).map(|mode| stiffness[(mode, mode)].clone().real()).collect();
    let ascending = diagonal.windows(2).all(|pair| pair[0] <= pair[1]) && diagonal.iter().all(|value| *value >= 0.0);
    let is_diagonal = |matrix: &DMatrix<T>| {
        matrix.iter().enumerate().all(|(index, value)| {
            if index % order == index / order { value.clone().imaginary().to_bits() == 0 } else { *value == T::zero() }
        })
    };
    let is_unit = (0..order).all(|mode| mass[(mode, mode)].clone().real().to_bits() == 1.0_f64.to_bits());
    (ascending && is_unit && is_diagonal(mass) && is_diagonal(stiffness))
        .then(|| (diagonal, DMatrix::identity(order, order)))
}

/// Rejects a lowest eigenvalue of K φ = ω² M φ that is below zero by more than rounding.
fn check_semidefinite(smallest: f64, largest: f64, suffix: &str) -> Result<()> {
    if smallest >= -1e-9 * largest {
        return Ok(());
    }
    if !(smallest.is_finite() && largest.is_finite()) {
        return Err(Error::invalid(
            format!("ROM arrays `mass{suffix}` and `stiffness{suffix}`"),
            "the natural frequencies are not finite: the entries are too large or differ by too many orders of \
             magnitude",
            "Check the units and regenerate the ROM",
        ));
    }
    Err(Error::invalid(
        format!("ROM array `stiffness{suffix}`"),
        format!(
            "not positive semidefinite: the lowest eigenvalue is {smallest:.3e} rad²/s², the largest {largest:.3e} \
             rad²/s²"
        ),
        "Regenerate the ROM",
    ))
}

/// Returns φᴴKφ of a mode far below the largest. Its error is of second order in the error of the mode shape, so that it
/// distinguishes a soft mode from a rigid-body mode (exactly 0) wherever the stiffness matrix itself does.
fn unresolved_eigenvalue<T: ModeNumber>(stiffness: &DMatrix<T>, shapes: &DMatrix<T>, mode: usize) -> f64 {
    let (mut quotient, mut magnitude) = (0.0, 0.0);
    for column in 0..stiffness.ncols() {
        for row in 0..stiffness.nrows() {
            let entry = |matrix: &DMatrix<T>, at: (usize, usize)| matrix[at].clone();
            let term = entry(shapes, (row, mode)).conjugate()
                * entry(stiffness, (row, column))
                * entry(shapes, (column, mode));
            quotient += term.clone().real();
            magnitude += libm::hypot(term.clone().real(), term.imaginary());
        }
    }
    let rounding = T::ROUNDING * f64::EPSILON * real(stiffness.nrows()) * magnitude;
    if quotient > rounding { quotient } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::rom::{ContactNode, DisplacementFrame, RomChecks};

    /// Random symmetric positive definite pencil.
    fn rom(order: usize, seed: u64) -> Rom {
        let mut state = seed;
        let mut number = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from(u32::try_from(state >> 33).unwrap()) / f64::from(1_u32 << 30) - 1.0
        };
        let a = DMatrix::from_fn(order, order, |_, _| number());
        let b = DMatrix::from_fn(order, order, |_, _| number());
        Rom {
            name: "random".into(),
            origin: String::new(),
            sectors: 1,
            frame: DisplacementFrame::Cartesian,
            mass: &a * a.transpose() * 0.1 + DMatrix::identity(order, order),
            stiffness: &b * b.transpose() * 1e6,
            damping_ratio: 0.0,
            contact_map: DMatrix::identity(3, order),
            contact_nodes: vec![ContactNode {
                name: "n".into(),
                position: [0.0; 3],
                meridional_slope: 0.0,
                ..ContactNode::default()
            }],
            checks: RomChecks::default(),
            extras: crate::scene::rom::RomExtras::default(),
        }
    }

    #[test]
    fn soft_mode_among_very_stiff_modes_is_not_rigid() {
        let mut rom = rom(3, 5);
        rom.mass = DMatrix::identity(3, 3);
        for ratio in [1e6, 1e7, 1e8, 1e9] {
            let squares = [1.0, 4.0, ratio * ratio];
            rom.stiffness = DMatrix::from_diagonal(&nalgebra::DVector::from_row_slice(&squares));
            let model = ModalModel::from_rom(&rom, 0.0).unwrap();
            for (found, expected) in model.frequencies.iter().zip([1.0, 2.0, ratio]) {
                assert!((found / expected - 1.0).abs() < 1e-12, "ratio {ratio:e}: {:?}", model.frequencies);
            }
        }
    }

    #[test]
    fn rigid_modes_are_exactly_zero() {
        // A free chain of three masses has one rigid-body mode; without stiffness all modes are rigid.
        let mut rom = rom(3, 6);
        rom.mass = DMatrix::from_diagonal(&nalgebra::DVector::from_row_slice(&[1.0, 0.3, 7.0]));
        rom.stiffness = DMatrix::from_row_slice(3, 3, &[1e9, -1e9, 0.0, -1e9, 1e9 + 3e3, -3e3, 0.0, -3e3, 3e3]);
        let model = ModalModel::from_rom(&rom, 0.0).unwrap();
        assert!(model.frequencies[0] == 0.0 && model.frequencies[1] > 10.0, "{:?}", model.frequencies);
        rom.stiffness.fill(0.0);
        assert_eq!(ModalModel::from_rom(&rom, 0.0).unwrap().frequencies, [0.0; 3]);
    }

    #[test]
    fn modes_are_orthonormal_and_diagonalise_the_pencil_to_rounding() {
        for (order, seed) in [(3, 1), (14, 2), (29, 3), (60, 4)] {
            let rom = rom(order, seed);
            let model = ModalModel::from_rom(&rom, 0.0).unwrap();
            let identity = model.shapes.transpose() * &rom.mass * &model.shapes;
            let error = (identity - DMatrix::identity(order, order)).amax();
            let squares = model.shapes.transpose() * &rom.stiffness * &model.shapes;
            let diagonal = nalgebra::DVector::from_iterator(order, model.frequencies.iter().map(|w| w * w));
            let off = (squares - DMatrix::from_diagonal(&diagonal)).amax() / diagonal.amax();
            println!("n = {order}: orthonormality {error:.1e}, diagonality {off:.1e}");
            assert!(error < 1e-13 && off < 1e-13, "n = {order}: {error:e}, {off:e}");
        }
    }
}
