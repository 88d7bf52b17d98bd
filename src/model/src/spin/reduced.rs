//! Effects of spin in reduced coordinates: shapes added to the basis, the fit over the speed, and its checks.

use faer::Mat;
use nalgebra::{DMatrix, DVector};
use tiprub_core::rom::Spin;

use super::{Rotating, SpinningState, static_growth, stiffness_at, turned_about_axis};
use crate::craig_bampton::{CraigBampton, dense_modes};
use crate::progress::{Listener, Stage, report, silent};
use crate::reduce::full_modes;
use crate::sparse::SparseMatrix;
use crate::{Error, Result};

/// A shape of which the basis leaves less than this share is in it already.
const DEPENDENT: f64 = 1e-9;

/// How well the reduced model holds at one speed.
#[derive(Debug, Clone, PartialEq)]
pub struct SpinCheck {
    /// Speed Ω (rad/s).
    pub speed: f64,
    /// Natural frequencies of the full model about its equilibrium at Ω (Hz), without Coriolis force.
    pub full_frequencies: Vec<f64>,
    /// The same of the reduced model with K₀ + Ω²K₁ + Ω⁴K₂ (Hz).
    pub reduced_frequencies: Vec<f64>,
    /// Static growth of the contact degrees of freedom in the full model (m), in the ROM's frame.
    pub full_growth: Vec<f64>,
    /// The same of the reduced model: K(Ω)⁻¹Ω²c (m).
    pub reduced_growth: Vec<f64>,
}

impl SpinCheck {
    /// Deviation of the reduced frequencies per mode (%).
    pub fn frequency_deviation(&self) -> Vec<f64> {
        self.full_frequencies.iter().zip(&self.reduced_frequencies).map(|(f, r)| (r - f) / f * 100.0).collect()
    }

    /// Largest difference of the growth of a contact degree of freedom over the largest growth of any (%).
    pub fn growth_deviation(&self) -> f64 {
        let largest = self.full_growth.iter().fold(0.0_f64, |worst, growth| worst.max(growth.abs()));
        let differences = self.full_growth.iter().zip(&self.reduced_growth).map(|(f, r)| (f - r).abs());
        differences.fold(0.0, f64::max) / largest * 100.0
    }
}

/// Spin arrays of a ROM and how well they hold.
#[derive(Debug, Clone, PartialEq)]
pub struct ReducedSpin {
    /// The arrays.
    pub spin: Spin,
    /// At the largest speed, where the fit is exact, and at half of it, where it is not.
    pub checks: Vec<SpinCheck>,
}

/// The equilibria that the spin arrays are made and checked with.
#[derive(Debug)]
pub struct SpinningStates {
    /// At Ω/2: checked.
    pub half: SpinningState,
    /// At Ω/√2: fitted.
    pub middle: SpinningState,
    /// At Ω: fitted and checked.
    pub largest: SpinningState,
}

impl SpinningStates {
    /// Find the three equilibria up to `largest_speed` (rad/s), each from the one before, scaled by the force.
    ///
    /// # Errors
    /// Those of [`Rotating::equilibrium`].
    pub fn find(body: &Rotating<'_>, order: usize, largest_speed: f64, listener: Listener<'_>) -> Result<Self> {
        report(listener, Stage::Spin, 0, 3);
        let half = body.equilibrium(0.5 * largest_speed, Mat::zeros(order, 1))?;
        report(listener, Stage::Spin, 1, 3);
        let middle_speed = largest_speed * core::f64::consts::FRAC_1_SQRT_2;
        let middle = body.equilibrium(middle_speed, faer::Scale(2.0) * &half.displacement)?;
        report(listener, Stage::Spin, 2, 3);
        let largest = body.equilibrium(largest_speed, faer::Scale(2.0) * &middle.displacement)?;
        report(listener, Stage::Spin, 3, 3);
        Ok(Self { half, middle, largest })
    }

    /// Displacements of the equilibria that the arrays are made of (free dofs).
    pub fn fitted_shapes(&self) -> [&Mat<f64>; 2] {
        [&self.middle.displacement, &self.largest.displacement]
    }
}

/// A reduced model about a spinning state in the coordinates and with the mass matrix of the resting one.
///
/// T = \[Ψ Φ\] of the spinning state becomes TR, R = \[I 0; A B\]: contact displacements stay what they are; B is the
/// rotation that brings the fixed-interface modes closest to the resting ones (polar factor of ΦᵀMΦ₀), and
/// A = B M̂₀_mb - M̂_mb couples them to the interface as at rest. Then (TR)ᵀM(TR) = M̂₀ but for the part of the interface
/// mass that the fixed-interface modes do not carry, M̂_bb - M̂_bm M̂_mb, whose change with speed is neglected.
struct Aligned {
    /// RᵀK̂R.
    stiffness: DMatrix<f64>,
    /// TR.
    basis: Mat<f64>,
}

impl Aligned {
    fn new(spinning: &CraigBampton, resting: &CraigBampton, mass: &SparseMatrix, boundary: usize) -> Result<Self> {
        let order = resting.mass.nrows();
        let inner = order - boundary;
        let modes = spinning.transformation.get(.., boundary..);
        let overlap = modes.transpose() * mass.times(resting.transformation.get(.., boundary..));
        let overlap = DMatrix::from_fn(inner, inner, |i, j| overlap[(i, j)]);
        let turn = rotation_of(overlap)?;
        let coupling = |model: &CraigBampton| model.mass.view((boundary, 0), (inner, boundary)).into_owned();
        let shift = &turn * coupling(resting) - coupling(spinning);
        let mut change = DMatrix::identity(order, order);
        change.view_mut((boundary, 0), (inner, boundary)).copy_from(&shift);
        change.view_mut((boundary, boundary), (inner, inner)).copy_from(&turn);
        let stiffness = change.transpose() * &spinning.stiffness * &change;
        Ok(Self {
            stiffness: 0.5 * (&stiffness + stiffness.transpose()),
            basis: &spinning.transformation * Mat::from_fn(order, order, |i, j| change[(i, j)]),
        })
    }
}

/// The orthogonal factor of a matrix' polar decomposition.
fn rotation_of(matrix: DMatrix<f64>) -> Result<DMatrix<f64>> {
    let parts = matrix.svd(true, true);
    match (parts.u, parts.v_t) {
        (Some(left), Some(right)) => Ok(left * right),
        _ => Err(Error::invalid("fixed-interface modes under spin", "they cannot be aligned", "Ask for fewer modes")),
    }
}

/// Spin arrays in the coordinates of `resting`, from the reduced models about the fitted equilibria.
///
/// `mass` is that of the `free` dofs; the models' first `boundary` coordinates are the contact displacements. `modes`
/// frequencies are checked.
///
/// K₁ and K₂ follow from ΔK = K(Ω) - K₀ at s/2 and s = Ω²:
/// K₁ = (4ΔK(s/2) - ΔK(s))/s, K₂ = (2ΔK(s) - 4ΔK(s/2))/s².
///
/// # Errors
/// Those of [`full_modes`]; [`Error::NotPositiveDefinite`] for an unstable reduced model.
pub fn reduced_spin(
    states: &SpinningStates,
    resting: &CraigBampton,
    [middle, largest]: [&CraigBampton; 2],
    mass: &SparseMatrix,
    free: &[usize],
    interface: &[usize],
    modes: usize,
) -> Result<ReducedSpin> {
    let boundary = interface.len();
    let middle = Aligned::new(middle, resting, mass, boundary)?;
    let largest = Aligned::new(largest, resting, mass, boundary)?;
    let square = states.largest.speed * states.largest.speed;
    let (half_change, change) = (&middle.stiffness - &resting.stiffness, &largest.stiffness - &resting.stiffness);
    let product = largest.basis.transpose() * mass.times(turned_about_axis(free, &largest.basis).as_ref());
    let order = resting.mass.nrows();
    let mut spin = Spin {
        stiffness_speed2: (&half_change * 4.0 - &change) / square,
        stiffness_speed4: (&change * 2.0 - &half_change * 4.0) / (square * square),
        coriolis: DMatrix::from_fn(order, order, |i, j| 0.5 * (product[(i, j)] - product[(j, i)])),
        centrifugal_load: Vec::new(),
        largest_speed: states.largest.speed,
    };
    let growth = |state: &SpinningState, basis: &Mat<f64>| -> DVector<f64> {
        // Contact displacements as they are; the modes take the mass-nearest share of the rest.
        let projected = basis.transpose() * mass.times(state.displacement.as_ref());
        let contact = contact_growth(resting, state, interface);
        let coupling = resting.mass.view((boundary, 0), (order - boundary, boundary));
        let shares = DVector::from_fn(order - boundary, |i, _| projected[(boundary + i, 0)]) - coupling * &contact;
        DVector::from_iterator(order, contact.iter().chain(shares.iter()).copied())
    };
    let load = &largest.stiffness * growth(&states.largest, &largest.basis) / square;
    spin.centrifugal_load = load.iter().copied().collect();
    let load_m = &middle.stiffness * growth(&states.middle, &middle.basis) / square * 2.0;
    println!("c  {:.5?}\ncm {:.5?}", load.as_slice(), load_m.as_slice());
    let mut checks = Vec::new();
    for state in [&states.half, &states.middle, &states.largest] {
        let full_frequencies = full_modes(&state.stiffness, mass, false, modes, &silent)?.modes.frequencies();
        let (squares, _) = dense_modes(&stiffness_at(&resting.stiffness, &spin, state.speed), &resting.mass)?;
        let to_hertz = |square: &f64| square.max(0.0).sqrt() / core::f64::consts::TAU;
        checks.push(SpinCheck {
            speed: state.speed,
            reduced_frequencies: squares.iter().take(full_frequencies.len()).map(to_hertz).collect(),
            full_frequencies,
            full_growth: contact_growth(resting, state, interface).iter().copied().collect(),
            reduced_growth: static_growth(&resting.stiffness, &spin, state.speed)?.iter().take(boundary).copied().collect(),
        });
    }
    Ok(ReducedSpin { spin, checks })
}

/// A state's displacements at the contact in the ROM's frame. There the transformation is the rotation into that frame.
fn contact_growth(resting: &CraigBampton, state: &SpinningState, interface: &[usize]) -> DVector<f64> {
    let rotation = &resting.transformation;
    let component = |j: usize| interface.iter().map(|&row| rotation[(row, j)] * state.displacement[(row, 0)]).sum();
    DVector::from_fn(interface.len(), |j, _| component(j))
}
