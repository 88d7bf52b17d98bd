//! Step limit of massless-boundary, which is explicit but without the inertia of the contact nodes.
//!
//! Closed contact makes the residual flexibility G of the quasi-static modes a spring on the modes with inertia: K_c = Φ_nᵀ G_nn⁻¹ Φ_n.
//! Their step q⁺ − (1 + β)q + βq⁻ = −C(Λ + K_c)q, C = diag(c), is that of the masses ½(1 + β) with dashpots, and is stable while the
//! largest eigenvalue µ of D + X½ K_c X½ is below 4, with X = 2(1 + β)⁻¹C and D = XΛ.
//!
//! A flexible carrier has its own D_s < 4 and X_s; several carriers under one blade have those of all their modes. With the modes of both, and
//! U = L⁻¹[Φ_n X½, Ψ_n X_s½], G_nn = L Lᵀ, all eigenvalues are below 4 while those of the sum over modes U(4 − D)⁻¹Uᵀ are below 1. The part
//! of the master has no eigenvalue above µ/4, so that the carrier adds the largest eigenvalue of G_nn⁻¹ Ψ_n X_s(1 − D_s/4)⁻¹ Ψ_nᵀ to µ. If
//! all blades are in contact, G_nn and Ψ_n contain the nodes of all blades. Contact at fewer nodes adds no more, because G_nn⁻¹ of a subset
//! of the nodes is at most that of all nodes. The number of blades times the eigenvalue of one blade is a simple upper bound.
//!
//! Steps may have any length up to the limit, and a mode comes closest to D = 4 at ω_d h = π: each mode counts with its worst case at steps
//! up to h. By itself this does not reach 4, since contact does not excite modes in which it does not participate.

use nalgebra::DMatrix;

use super::finding::{ErrorKind, WarningKind};
use crate::math::vector::{Vector3, vector3_at};
use crate::modes::modal::ModalModel;
use crate::modes::schemes::{ModeCoefficients, damped_frequency};
use crate::scene::method::Scheme;

/// Margin below the limit.
const MARGIN: f64 = 1e-6;
/// Fraction of the limit up to which steps are accepted. Closed contact is stable up to the limit, but a node that opens and closes
/// switches between two springs, which pumps energy in bands of step sizes. Twelve blades pressed on a round casing for 0.1 s with 1e-3 of
/// damping gain no energy at 0.8 of the limit, and hundreds of times their energy at 0.85.
pub(crate) const USABLE: f64 = 0.8;
/// Fraction of the limit if closed contact is much stiffer than the modes with inertia, whose damping then has too little effect on
/// bouncing nodes: nodes a hundred times as stiff as their base settle there with a damping ratio of 0.02, but not from 0.5 on.
pub(crate) const USABLE_STIFF: f64 = 0.25;
/// Ratio of the squares of the highest frequency with and without closed contact above which contact counts as stiff: at 10 a damping ratio
/// of 0.02 brings the same nodes to rest up to 0.8 of the limit.
const STIFF: f64 = 10.0;
/// Ratio above which every step is rejected: at 1000 the same nodes keep bouncing at 0.2 of the limit, with meaningless forces.
const TOO_STIFF: f64 = 300.0;
/// Fraction of the limit up to which the same blades gain no energy without damping: at 0.5 they gain a fifth of their energy.
pub const QUIET: f64 = 0.4;
/// Sum of eigenvalues below which closed contact is stable.
pub(crate) const STABLE: f64 = 4.0;

/// Step limits of the scheme (s).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MasslessLimit {
    /// Closed contact is stable below this step.
    pub closed: f64,
    /// Contact that opens and closes gains hardly any energy below this step.
    pub usable: f64,
}

impl MasslessLimit {
    /// No limit.
    pub const NONE: Self = Self { closed: f64::INFINITY, usable: f64::INFINITY };

    /// Returns the smaller value of each limit.
    pub(crate) fn tightest(self, other: Self) -> Self {
        Self { closed: self.closed.min(other.closed), usable: self.usable.min(other.usable) }
    }
}

/// Data that the limit depends on.
#[derive(Debug, Clone)]
pub struct MasslessCheck<'a> {
    /// Modes of the master.
    pub model: &'a ModalModel,
    /// Unit normal of every contact node.
    pub normals: Vec<Vector3>,
    /// Carriers of the surfaces that the nodes touch.
    pub carriers: Vec<CarrierUnderNodes<'a>>,
}

/// A surface carrier under the contact nodes of a master.
#[derive(Debug, Clone)]
pub struct CarrierUnderNodes<'a> {
    /// Modes of the carrier along the normals of the nodes, nodes × modes.
    pub normals: DMatrix<f64>,
    /// Modes of the carrier.
    pub model: &'a ModalModel,
}

impl CarrierUnderNodes<'_> {
    /// Returns Ψ_n (X_s(1 − D_s/4)⁻¹)½, an upper bound for all steps up to `step` (s), nodes × modes.
    pub(crate) fn scaled_normals(&self, step: f64) -> DMatrix<f64> {
        let mut scaled = self.normals.clone();
        for (mode, mut column) in scaled.column_iter_mut().enumerate() {
            let [d, x] = worst(self.model, mode, step);
            column *= (x / (1.0 - 0.25 * d)).sqrt();
        }
        scaled
    }
}

impl MasslessCheck<'_> {
    /// Bound on the eigenvalues of the step of closed contact at all h up to `step` (s): (master, carrier per blade); stable while the sum is
    /// below 4. `None` if the residual flexibility is singular.
    pub fn eigenvalues(&self, step: f64) -> Option<(f64, f64)> {
        let dynamic = self.model.dynamic_modes(Scheme::MasslessBoundary);
        let along_normals = self.modes_along_normals();
        let lower = self.flexibility_factor(step)?;
        // D + X½ K_c X½ with K_c = (L⁻¹Φ)ᵀ(L⁻¹Φ).
        let own: Vec<[f64; 2]> = (0..dynamic).map(|mode| worst(self.model, mode, step)).collect();
        let half = DMatrix::from_fn(self.normals.len(), dynamic, |node, mode| {
            along_normals[(node, mode)] * own[mode][1].sqrt()
        });
        let half = lower.solve_lower_triangular(&half)?;
        let mut matrix = half.transpose() * &half;
        for (mode, [kept, _]) in own.iter().enumerate() {
            matrix[(mode, mode)] += kept;
        }
        let master = if dynamic == 0 { 0.0 } else { matrix.symmetric_eigenvalues().max() };
        let mut added = DMatrix::zeros(self.normals.len(), self.normals.len());
        for carrier in &self.carriers {
            let half = lower.solve_lower_triangular(&carrier.scaled_normals(step))?;
            added += &half * half.transpose();
        }
        let carrier = if self.carriers.is_empty() { 0.0 } else { added.symmetric_eigenvalues().max() };
        Some((master, carrier))
    }

    /// Returns the modes along the normals of the nodes, nodes × modes.
    fn modes_along_normals(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.normals.len(), self.model.len(), |node, mode| {
            self.normals[node].dot(&vector3_at(self.model.contact_modes.column(mode).as_slice(), node))
        })
    }

    /// Returns the Cholesky factor L of the residual flexibility G_nn = L Lᵀ (m/N) along the normals for a step (s), nodes × nodes; `None`
    /// if the flexibility is singular.
    pub(crate) fn flexibility_factor(&self, step: f64) -> Option<DMatrix<f64>> {
        let coefficients = self.model.coefficients(Scheme::MasslessBoundary, step);
        let dynamic = self.model.dynamic_modes(Scheme::MasslessBoundary);
        let (along_normals, nodes) = (self.modes_along_normals(), self.normals.len());
        let residual = DMatrix::from_fn(nodes, nodes, |a, b| {
            (dynamic..self.model.len())
                .map(|mode| along_normals[(a, mode)] * coefficients[mode].compliance * along_normals[(b, mode)])
                .sum()
        });
        Some(residual.cholesky()?.l())
    }

    /// Returns the steps (s) at which closed contact becomes unstable and up to which the scheme is used, searched up to `largest`;
    /// infinite if closed contact is stable up to there.
    ///
    /// # Errors
    /// Residual flexibility that is singular along the normals, or much stiffer than the modes with inertia.
    pub fn limit(&self, largest: f64) -> Result<MasslessLimit, ErrorKind> {
        let small = small_step(self.model);
        let stiffening = self.eigenvalues(small).map_or(1.0, |(own, carrier)| self.stiffening(small, own + carrier));
        if stiffening > TOO_STIFF {
            return Err(ErrorKind::StiffContact { factor: stiffening });
        }
        let closed = self.closed(largest)?;
        if closed.is_infinite() {
            return Ok(MasslessLimit::NONE);
        }
        Ok(MasslessLimit { closed, usable: usable_fraction(stiffening) * closed })
    }

    /// Returns the factor by which closed contact raises the square of the highest frequency of the modes with inertia. `eigenvalue` is
    /// that of closed contact at a small step (s).
    pub(crate) fn stiffening(&self, step: f64, eigenvalue: f64) -> f64 {
        let coefficients = self.model.coefficients(Scheme::MasslessBoundary, step);
        let dynamic = self.model.dynamic_modes(Scheme::MasslessBoundary);
        let open = coefficients[..dynamic].iter().fold(0.0, |most: f64, mode| most.max(per_mass(mode, mode.kappa)));
        eigenvalue / open
    }

    fn closed(&self, largest: f64) -> Result<f64, ErrorKind> {
        let unstable = |step: f64| {
            let found = self.eigenvalues(step).map(|(master, carrier)| master + carrier >= STABLE * (1.0 - MARGIN));
            found.ok_or(ErrorKind::RigidNormal)
        };
        let first = small_step(self.model);
        let mut high = first.min(largest);
        while !unstable(high)? {
            if high >= largest {
                return Ok(f64::INFINITY);
            }
            high = (1.25 * high).min(largest);
        }
        let mut low = high / 1.25;
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            *(if unstable(middle)? { &mut high } else { &mut low }) = middle;
        }
        Ok(high)
    }
}

/// Returns a step (s) that is much shorter than the period of every mode.
pub(crate) fn small_step(model: &ModalModel) -> f64 {
    1e-3 / model.largest_frequency()
}

/// Returns the fraction of the limit up to which steps are accepted if closed contact stiffens by this factor.
pub(crate) fn usable_fraction(stiffening: f64) -> f64 {
    if stiffening > STIFF { USABLE_STIFF } else { USABLE }
}

/// D and X of a mode with inertia in the worst case at steps up to `step` (s): at ω_d h = π if the step exceeds it.
fn worst(model: &ModalModel, mode: usize, step: f64) -> [f64; 2] {
    let damped = damped_frequency(model.frequencies[mode], model.damping_ratios[mode]);
    let at = model.coefficient(mode, 1.0, Scheme::MasslessBoundary, step.min(std::f64::consts::PI / damped));
    [per_mass(&at, at.kappa).min(4.0 * (1.0 - 2.0 * MARGIN)), per_mass(&at, at.delayed)]
}

/// A coefficient of the recurrence divided by its mass ½(1 + β), which damping makes smaller than 1.
fn per_mass(mode: &ModeCoefficients, coefficient: f64) -> f64 {
    2.0 * coefficient / (1.0 + mode.beta)
}

/// Rejects a step (s) at or beyond the usable one.
///
/// # Errors
/// [`ErrorKind::MasslessStep`] with numbers.
pub fn check(step: f64, limit: MasslessLimit) -> Result<(), ErrorKind> {
    if step < limit.usable { Ok(()) } else { Err(ErrorKind::MasslessStep { step, limit }) }
}

/// Returns a warning if contact that opens and closes may gain energy at a step (s).
pub fn warning(step: f64, limit: MasslessLimit) -> Option<WarningKind> {
    (step >= QUIET * limit.closed).then_some(WarningKind::MasslessEnergy { step, limit })
}
