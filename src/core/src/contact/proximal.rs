//! Iterative solution of contact without friction for positive semidefinite W. A solution exists if some motion opens all contacts
//! simultaneously.
//!
//! With more contacts than modes W is singular, and no rule that exchanges contacts is certain to end. The solution is therefore
//! approximated: every contact yields slightly around its last force λ⁻, by ε of its own flexibility D,
//!
//! ```text
//! 0 ≤ λ ⟂ g + Wλ + εD(λ − λ⁻) ≥ 0.
//! ```
//!
//! Each of these problems is regular, so that exchanging ends. The remainder εD(λ − λ⁻) goes to zero if a solution exists, and λ converges
//! to a solution (R. T. Rockafellar, SIAM J. Control Optim. 14, 1976). If none exists λ grows without limit along forces that cause no
//! motion, Wv = 0, v ≥ 0, on gaps that are not open together, gᵀv < 0.

use nalgebra::DMatrix;

/// ε of the first problem: the part of two dependent contacts that exceeds rounding.
const FIRST: f64 = 1e-6;
/// ε of the last problems.
const LAST: f64 = 1e-10;
/// Factor by which ε falls from one problem to the next.
const FALL: f64 = 0.1;
/// Factor by which ε rises if a problem is not solved.
const RISE: f64 = 30.0;
/// Largest number of problems.
pub(crate) const ROUNDS: usize = 60;
/// Allowed remainder as a fraction of the largest gap.
const LEFT: f64 = 1e-10;
/// Fraction of its flexibility by which a contact is softened once if redundant contacts require different gaps: the deepest of them then
/// carries the force, and its remaining gap is this fraction of the predicted penetration.
const SOFTENING: f64 = 1e-10;
/// Softened contacts whose remainder exceeds this fraction of the largest gap are not closed.
const PINCHED: f64 = 1e-6;
/// Golden ratio: the fractional parts of its multiples are evenly distributed.
pub(super) const GOLDEN: f64 = 1.618_033_988_749_895;

/// Regularisation of contacts; allocates only when created.
#[derive(Debug, Clone)]
pub(crate) struct Yielding {
    /// Predicted gaps (m).
    predicted: Vec<f64>,
    /// D: flexibilities of the contacts (m/N).
    own: Vec<f64>,
    /// λ⁻ (N).
    centre: Vec<f64>,
    /// ε.
    share: f64,
    /// True if the diagonal of the matrix differs from D.
    pub(super) softened: bool,
}

impl Yielding {
    /// Allocates for this number of contacts.
    pub fn new(contacts: usize) -> Self {
        let zeros = || vec![0.0; contacts];
        Self { predicted: zeros(), own: zeros(), centre: zeros(), share: 0.0, softened: false }
    }

    /// Makes each of the first `size` contacts yield slightly by itself.
    pub fn soften(&mut self, matrix: &mut DMatrix<f64>, size: usize) {
        self.softened = true;
        for contact in 0..size {
            self.own[contact] = matrix[(contact, contact)];
            matrix[(contact, contact)] *= 1.0 + SOFTENING;
        }
    }

    /// Returns whether forces are no solution: contacts that no motion opens simultaneously, held apart only by their softness.
    pub(crate) fn is_pinched(&self, size: usize, scale: f64, force: impl Fn(usize) -> f64) -> bool {
        self.softened && (0..size).any(|contact| SOFTENING * self.own[contact] * force(contact) > PINCHED * scale)
    }

    /// Stores the problem to be solved; the first forces are different for every contact, so that no two contacts reach their limits
    /// simultaneously.
    pub fn keep(&mut self, matrix: &DMatrix<f64>, gaps: &[f64], scale: f64) {
        let mut spread = 0.0;
        for (contact, gap) in gaps.iter().enumerate() {
            if !self.softened {
                self.own[contact] = matrix[(contact, contact)];
            }
            self.predicted[contact] = *gap;
            spread += GOLDEN;
            let force = (1.0 + f64::fract(spread)) * scale / self.own[contact];
            self.centre[contact] = if force.is_finite() { force } else { 0.0 };
        }
        (self.softened, self.share) = (false, FIRST);
    }

    /// Fills in matrix and gaps of the next problem.
    pub(crate) fn pose(&self, matrix: &mut DMatrix<f64>, gaps: &mut [f64]) {
        for (contact, gap) in gaps.iter_mut().enumerate() {
            matrix[(contact, contact)] = self.own[contact] * (1.0 + self.share);
            *gap = self.predicted[contact] + self.yielded(contact, 0.0);
        }
    }

    /// Continues from the forces of the last problem if it is solved; returns whether they solve the original problem.
    pub fn advance(&mut self, solved: bool, scale: f64, size: usize, force: impl Fn(usize) -> f64) -> bool {
        if !solved {
            self.share *= RISE;
            return false;
        }
        if (0..size).all(|contact| self.yielded(contact, force(contact)).abs() <= LEFT * scale) {
            return true;
        }
        (0..size).for_each(|contact| self.centre[contact] = force(contact));
        self.share = (FALL * self.share).max(LAST);
        false
    }

    /// Displacement (m) of a contact by its own softness.
    pub fn yielded(&self, contact: usize, force: f64) -> f64 {
        self.share * self.own[contact] * (force - self.centre[contact])
    }
}
