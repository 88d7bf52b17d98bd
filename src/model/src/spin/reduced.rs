//! Effects of spin in reduced coordinates: states aligned with the resting one, the fit over the speed, and its
//! checks.

use faer::{Mat, MatRef};
use nalgebra::DMatrix;
use tiprub_core::scene::rom::Spin;

use super::{Rotating, SpinningState, static_growth, stiffness_at, turned_about_axis};
use crate::craig_bampton::{CraigBampton, dense_modes};
use crate::progress::silent;
use crate::reduce::full_modes;
use crate::sparse::SparseMatrix;
use crate::{Error, Result};

/// Intermediate speed of the fit as a fraction of the largest speed, besides 0 and 1. Interpolation in Ω² from here
/// to the largest speed causes about the same error above and, down to half of the largest speed, below it.
pub(crate) const MIDDLE: f64 = 0.6;
/// Speed of the check of the fit as a fraction of the largest speed, about where the fit is worst.
pub(crate) const CHECKED: f64 = 0.8;
/// Number of additional fixed-interface modes that are computed for a spinning state, since the order of frequencies
/// changes with the speed.
pub(crate) const SPARE_MODES: usize = 10;
/// Smallest fraction of every resting fixed-interface mode that the spinning ones must contain.
const OVERLAP: f64 = 0.5;

/// Accuracy of the reduced model at one speed.
#[derive(Debug, Clone, PartialEq)]
pub struct SpinCheck {
    /// Speed Ω (rad/s).
    pub speed: f64,
    /// Natural frequencies of the full model about its equilibrium at Ω (Hz), without Coriolis force.
    pub full_frequencies: Vec<f64>,
    /// Natural frequencies of the reduced model with K₀ + Ω²K₁ + Ω⁴K₂ (Hz).
    pub reduced_frequencies: Vec<f64>,
    /// Static growth of the contact degrees of freedom in the full model (m), in the ROM's frame.
    pub full_growth: Vec<f64>,
    /// Static growth in the reduced model: K(Ω)⁻¹(Ω²c + Ω⁴c₂) (m).
    pub reduced_growth: Vec<f64>,
}

impl SpinCheck {
    /// Returns the deviation of the reduced frequencies per mode (%).
    pub fn frequency_deviation(&self) -> Vec<f64> {
        self.full_frequencies.iter().zip(&self.reduced_frequencies).map(|(f, r)| (r - f) / f * 100.0).collect()
    }

    /// Returns the largest difference of the growth of a contact degree of freedom over the largest growth of any
    /// (%).
    pub fn growth_deviation(&self) -> f64 {
        let largest = self.full_growth.iter().fold(0.0_f64, |worst, growth| worst.max(growth.abs()));
        let differences = self.full_growth.iter().zip(&self.reduced_growth).map(|(f, r)| (f - r).abs());
        differences.fold(0.0, f64::max) / largest * 100.0
    }
}

/// Spin arrays of a ROM with their accuracy.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ReducedSpin {
    /// Spin arrays.
    pub spin: Spin,
    /// Checks at [`CHECKED`] of the largest speed, where the fit is not exact, and at the largest, where it is.
    pub checks: Vec<SpinCheck>,
}

/// Equilibria from which the spin arrays are computed and checked.
#[derive(Debug)]
pub(crate) struct SpinningStates {
    /// State at [`MIDDLE`] Ω, which is fitted.
    pub middle: SpinningState,
    /// State at [`CHECKED`] Ω, which is checked.
    pub checked: SpinningState,
    /// State at Ω, which is fitted and checked.
    pub largest: SpinningState,
}

impl SpinningStates {
    /// Finds the three equilibria up to `largest_speed` (rad/s), each starting from the previous one, scaled by the
    /// force; calls `found` with the number found so far.
    ///
    /// # Errors
    /// The errors of [`Rotating::equilibrium`].
    pub(crate) fn find(body: &Rotating<'_>, largest_speed: f64, found: &dyn Fn(usize)) -> Result<Self> {
        let scaled = |state: &SpinningState, share: f64| {
            let ratio = share * largest_speed / state.speed;
            faer::Scale(ratio * ratio) * &state.displacement
        };
        found(0);
        let middle = body.equilibrium(MIDDLE * largest_speed, body.at_rest())?;
        found(1);
        let checked = body.equilibrium(CHECKED * largest_speed, scaled(&middle, CHECKED))?;
        found(2);
        let largest = body.equilibrium(largest_speed, scaled(&checked, 1.0))?;
        found(3);
        Ok(Self { middle, checked, largest })
    }
}

/// Reduced model at rest, which defines the coordinates of the spin arrays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Resting<'a> {
    /// Reduced model; its first coordinates are the contact displacements.
    pub model: &'a CraigBampton,
    /// Mass matrix of the free dofs.
    pub mass: &'a SparseMatrix,
    /// Free dofs (3·node + component), ascending.
    pub free: &'a [usize],
    /// Unit forces on the contact coordinates, free dofs × coordinates.
    pub contact: MatRef<'a, f64>,
}

/// Arrays at one speed, in the coordinates and with the mass matrix of the resting model.
///
/// T = \[Ψ Φ\] of the spinning state becomes TR, R = \[I 0; BA B\]: contact displacements stay unchanged; BᵀB = I
/// selects and rotates the fixed-interface modes to be as close as possible to the resting ones (polar factor of
/// ΦᵀMΦ₀), and A = M̂₀_mb - BᵀM̂_mb couples them to the interface as at rest. Then (TR)ᵀM(TR) = M̂₀ except for the
/// part of the interface mass that these modes do not carry, M̂_bb - M̂_bm BBᵀM̂_mb, whose change with speed is
/// neglected.
struct AtSpeed {
    /// Ω² (rad²/s²).
    square: f64,
    /// TR.
    basis: Mat<f64>,
    /// (RᵀK̂R - K̂₀)/Ω².
    stiffness: DMatrix<f64>,
    /// (TR)ᵀ K(Ω) u(Ω)/Ω², one column. The static response of the model to it has the contact displacements of u(Ω),
    /// since constraint modes are K-orthogonal to the remainder.
    load: DMatrix<f64>,
}

impl AtSpeed {
    fn new(state: &SpinningState, spinning: &CraigBampton, resting: Resting<'_>) -> Result<Self> {
        let (boundary, order, wide) = (resting.contact.ncols(), resting.model.mass.nrows(), spinning.mass.nrows());
        let (inner, wide_inner) = (order - boundary, wide - boundary);
        let resting_modes = resting.model.transformation.get(.., boundary..);
        let overlap = spinning.transformation.get(.., boundary..).transpose() * resting.mass.times(resting_modes);
        let turn = closest_modes(DMatrix::from_fn(wide_inner, inner, |i, j| overlap[(i, j)]))?;
        let coupling = |model: &CraigBampton, modes| model.mass.view((boundary, 0), (modes, boundary)).into_owned();
        let shift = coupling(resting.model, inner) - turn.transpose() * coupling(spinning, wide_inner);
        let mut change = DMatrix::identity(wide, order);
        change.view_mut((boundary, 0), (wide_inner, boundary)).copy_from(&(&turn * shift));
        change.view_mut((boundary, boundary), (wide_inner, inner)).copy_from(&turn);
        let stiffness = change.transpose() * &spinning.stiffness * &change;
        let basis = &spinning.transformation * Mat::from_fn(wide, order, |i, j| change[(i, j)]);
        let load = basis.transpose() * state.stiffness.times(state.displacement.as_ref());
        let square = state.speed * state.speed;
        Ok(Self {
            square,
            basis,
            stiffness: (0.5 * (&stiffness + stiffness.transpose()) - &resting.model.stiffness) / square,
            load: DMatrix::from_fn(order, 1, |i, j| load[(i, j)] / square),
        })
    }
}

/// Returns the orthonormal columns closest to those of a matrix: its polar factor.
fn closest_modes(overlap: DMatrix<f64>) -> Result<DMatrix<f64>> {
    if overlap.is_empty() {
        return Ok(overlap);
    }
    let parts = overlap.svd(true, true);
    let smallest = parts.singular_values.iter().copied().fold(1.0, f64::min);
    match (parts.u, parts.v_t) {
        (Some(left), Some(right)) if smallest >= OVERLAP => Ok(left * right),
        _ => Err(Error::invalid(
            "fixed-interface modes under spin",
            format!("the overlap of one of them with the modes at rest is only {smallest:.2}"),
            "Request another number of modes or reduce the largest speed",
        )),
    }
}

/// Returns a and b of a + b s through the values at two s.
fn line(first: (f64, &DMatrix<f64>), second: (f64, &DMatrix<f64>)) -> (DMatrix<f64>, DMatrix<f64>) {
    let slope = (second.1 - first.1) / (second.0 - first.0);
    (first.1 - &slope * first.0, slope)
}

/// Computes the spin arrays in the coordinates of `resting` from the reduced models about the two fitted equilibria.
///
/// These models have the contact displacements of `resting` and at least as many modes, preferably [`SPARE_MODES`]
/// more. `modes` frequencies are checked. (K(Ω) - K₀)/Ω² = K₁ + Ω²K₂ and the load over Ω², c + Ω²c₂, are straight
/// lines in Ω² through the two speeds; G is that of the largest speed.
///
/// # Errors
/// The errors of [`full_modes`]; [`Error::NotPositiveDefinite`] for an unstable reduced model; [`Error::Invalid`] if
/// the modes change too much to be identified.
pub(crate) fn reduced_spin(
    states: &SpinningStates,
    resting: Resting<'_>,
    middle: &CraigBampton,
    largest: &CraigBampton,
    modes: usize,
) -> Result<ReducedSpin> {
    let middle = AtSpeed::new(&states.middle, middle, resting)?;
    let largest = AtSpeed::new(&states.largest, largest, resting)?;
    let (stiffness_speed2, stiffness_speed4) =
        line((middle.square, &middle.stiffness), (largest.square, &largest.stiffness));
    let (load, load_speed4) = line((middle.square, &middle.load), (largest.square, &largest.load));
    let turned = turned_about_axis(resting.free, &largest.basis);
    let product = largest.basis.transpose() * resting.mass.times(turned.as_ref());
    let order = resting.model.mass.nrows();
    let spin = Spin {
        stiffness_speed2,
        stiffness_speed4,
        coriolis: DMatrix::from_fn(order, order, |i, j| 0.5 * (product[(i, j)] - product[(j, i)])),
        centrifugal_load: load.iter().copied().collect(),
        centrifugal_load_speed4: load_speed4.iter().copied().collect(),
        largest_speed: states.largest.speed,
    };
    let checks = [&states.checked, &states.largest].map(|state| check(state, resting, &spin, modes));
    Ok(ReducedSpin { checks: checks.into_iter().collect::<Result<_>>()?, spin })
}

/// Returns the contact coordinates of a state, in the frame of the ROM.
fn contact_growth(state: &SpinningState, resting: Resting<'_>) -> Vec<f64> {
    let growth = resting.contact.transpose() * &state.displacement;
    (0..resting.contact.ncols()).map(|j| growth[(j, 0)]).collect()
}

fn check(state: &SpinningState, resting: Resting<'_>, spin: &Spin, modes: usize) -> Result<SpinCheck> {
    let (model, mass) = (resting.model, resting.mass);
    let full_frequencies = full_modes(&state.stiffness, mass, false, modes, &silent)?.modes.frequencies();
    let (squares, _) = dense_modes(&stiffness_at(&model.stiffness, spin, state.speed), &model.mass)?;
    let to_hertz = |square: &f64| square.max(0.0).sqrt() / core::f64::consts::TAU;
    let growth = static_growth(&model.stiffness, spin, state.speed)?;
    Ok(SpinCheck {
        speed: state.speed,
        reduced_frequencies: squares.iter().take(full_frequencies.len()).map(to_hertz).collect(),
        full_frequencies,
        full_growth: contact_growth(state, resting),
        reduced_growth: growth.iter().take(resting.contact.ncols()).copied().collect(),
    })
}
