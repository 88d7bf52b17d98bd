//! The step limit of massless-boundary: explicit, but without the inertia of the contact nodes.
//!
//! Closed contact makes the residual flexibility G of the quasi-static modes a spring on the modes with inertia:
//! K_c = Φ_nᵀ G_nn⁻¹ Φ_n. Their step q⁺ − 2q + q⁻ = −C(Λ + K_c)q, C = diag(c), is stable while the largest eigenvalue of
//! C(Λ + K_c) is below 4. A flexible slave adds the largest eigenvalue of G_nn⁻¹ Ψ_n C_s Ψ_nᵀ per blade in contact.

use nalgebra::DMatrix;

use crate::contact::gap::dot;
use crate::dynamics::modal::ModalModel;
use crate::settings::Scheme;
use crate::{Error, Result};

/// Margin under the limit.
const MARGIN: f64 = 1e-6;

/// What the limit depends on.
#[derive(Debug, Clone)]
pub struct MasslessCheck<'a> {
    /// Modes of the master.
    pub model: &'a ModalModel,
    /// Unit normal of every contact node.
    pub normals: Vec<[f64; 3]>,
    /// Slave's modes along those normals, nodes × modes, and the slave.
    pub slave: Option<(DMatrix<f64>, &'a ModalModel)>,
}

impl MasslessCheck<'_> {
    /// Largest eigenvalue of the closed contact's step at h (s): (master, slave per blade); stable while the sum is
    /// below 4. `None` where the residual flexibility is singular.
    pub fn eigenvalues(&self, step: f64) -> Option<(f64, f64)> {
        let coefficients = self.model.coefficients(Scheme::MasslessBoundary, step);
        let dynamic = self.model.dynamic_modes(Scheme::MasslessBoundary);
        let nodes = self.normals.len();
        let seen = DMatrix::from_fn(nodes, self.model.len(), |node, mode| {
            dot(self.normals[node], std::array::from_fn(|i| self.model.contact_modes[(3 * node + i, mode)]))
        });
        let residual = DMatrix::from_fn(nodes, nodes, |a, b| {
            (dynamic..self.model.len())
                .map(|mode| seen[(a, mode)] * coefficients[mode].compliance * seen[(b, mode)])
                .sum()
        });
        let lower = residual.cholesky()?.l();
        let scaled = |count: usize, entry: &dyn Fn(usize, usize) -> f64| {
            lower.solve_lower_triangular(&DMatrix::from_fn(nodes, count, entry))
        };
        // C½(Λ + K_c)C½ with K_c = (L⁻¹Φ)ᵀ(L⁻¹Φ).
        let root = |mode: usize| coefficients[mode].delayed.sqrt();
        let half = scaled(dynamic, &|node, mode| seen[(node, mode)] * root(mode))?;
        let mut matrix = half.transpose() * &half;
        for mode in 0..dynamic {
            matrix[(mode, mode)] += coefficients[mode].kappa;
        }
        let master = if dynamic == 0 { 0.0 } else { matrix.symmetric_eigenvalues().max() };
        let slave = match &self.slave {
            None => 0.0,
            Some((seen, model)) => {
                let coefficients = model.coefficients(Scheme::MasslessBoundary, step);
                let half = scaled(model.len(), &|node, mode| seen[(node, mode)] * coefficients[mode].delayed.sqrt())?;
                (&half * half.transpose()).symmetric_eigenvalues().max()
            }
        };
        Some((master, slave))
    }

    /// Smallest step (s) at which closed contact is unstable, sought up to `largest`; infinite if none is found.
    ///
    /// # Errors
    /// A residual flexibility that is singular along the normals.
    pub fn limit(&self, largest: f64) -> Result<f64> {
        let unstable = |step: f64| {
            let found = self.eigenvalues(step).map(|(master, slave)| master + slave >= 4.0 * (1.0 - MARGIN));
            found.ok_or_else(|| {
                Error::invalid(
                    "scheme massless-boundary",
                    "the quasi-static modes have no flexibility along the normal of a contact node",
                    "Use modal-exact, or a ROM with the contact nodes as interface of the reduction",
                )
            })
        };
        let first = 1e-3 / self.model.largest_frequency();
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

/// Refusal of a step at or beyond the limit (s).
pub fn refusal(step: f64, limit: f64) -> Error {
    Error::Unstable {
        problem: format!(
            "massless-boundary with internal step {step:.6e} s: closed contact on the residual flexibility of the contact nodes \
             is stable below {limit:.6e} s only"
        ),
        remedy: format!("Set the internal step below {limit:.6e} s, or use the scheme modal-exact"),
    }
}
