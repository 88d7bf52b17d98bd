//! Contact without friction always has a solution when some motion opens all contacts: W is positive semidefinite then.
//!
//! With more contacts than modes W is singular, and no rule that exchanges contacts need end. So the solution is approached:
//! every contact yields a little around its last force λ⁻, by ε of its own flexibility D,
//!
//! ```text
//! 0 ≤ λ ⟂ g + Wλ + εD(λ − λ⁻) ≥ 0.
//! ```
//!
//! Each of these problems is regular, so that exchanging ends. What is left, εD(λ − λ⁻), goes to zero where a solution exists,
//! and λ to one of them (R. T. Rockafellar, SIAM J. Control Optim. 14, 1976). Where none exists λ grows for ever along
//! forces that move nothing, Wv = 0, v ≥ 0, on gaps that are not open together, gᵀv < 0.

use nalgebra::DMatrix;

/// ε of the first problem: of two contacts that depend on each other, how much is beyond rounding.
const FIRST: f64 = 1e-6;
/// ε of the last ones.
const LAST: f64 = 1e-10;
/// By how much it falls from one problem to the next.
const FALL: f64 = 0.1;
/// By how much it rises where a problem is not solved.
const RISE: f64 = 30.0;
/// Problems at most.
pub const ROUNDS: usize = 60;
/// Share of the largest gap that may be left.
const LEFT: f64 = 1e-10;
/// Share of its flexibility by which a contact is softened once where redundant contacts ask for different gaps: the deepest of
/// them then carries the force, and the gap it is left with is this share of the predicted penetration.
const SOFTENING: f64 = 1e-10;
/// Share of the largest gap from which on softened contacts that are left with it are not closed.
const PINCHED: f64 = 1e-6;
/// Golden ratio: multiples of it, without their whole part, are spread evenly.
const GOLDEN: f64 = 1.618_033_988_749_895;

/// Regularisation of contacts; allocates only when made.
#[derive(Debug, Clone)]
pub struct Yielding {
    /// Predicted gaps (m).
    predicted: Vec<f64>,
    /// D: own flexibilities of the contacts (m/N).
    own: Vec<f64>,
    /// λ⁻ (N).
    centre: Vec<f64>,
    /// ε.
    share: f64,
    /// The matrix has another diagonal than D.
    softened: bool,
}

impl Yielding {
    /// Room for so many contacts.
    pub fn new(contacts: usize) -> Self {
        let zeros = || vec![0.0; contacts];
        Self { predicted: zeros(), own: zeros(), centre: zeros(), share: 0.0, softened: false }
    }

    /// A problem with a new matrix follows.
    pub fn begin(&mut self) {
        self.softened = false;
    }

    /// Whether contacts have been softened.
    pub fn is_softened(&self) -> bool {
        self.softened
    }

    /// Every one of the first `size` contacts yields a little by itself.
    pub fn soften(&mut self, matrix: &mut DMatrix<f64>, size: usize) {
        self.softened = true;
        for contact in 0..size {
            self.own[contact] = matrix[(contact, contact)];
            matrix[(contact, contact)] *= 1.0 + SOFTENING;
        }
    }

    /// Forces only look like a solution: contacts that no motion opens at once, held apart by their softness alone.
    pub fn is_pinched(&self, size: usize, scale: f64, force: impl Fn(usize) -> f64) -> bool {
        self.softened && (0..size).any(|contact| SOFTENING * self.own[contact] * force(contact) > PINCHED * scale)
    }

    /// The problem to be approached; the first forces to yield around are different for every contact, lest two reach their ends
    /// at once.
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

    /// Matrix and gaps of the next problem.
    pub fn pose(&self, matrix: &mut DMatrix<f64>, gaps: &mut [f64]) {
        for (contact, gap) in gaps.iter_mut().enumerate() {
            matrix[(contact, contact)] = self.own[contact] * (1.0 + self.share);
            *gap = self.predicted[contact] + self.yielded(contact, 0.0);
        }
    }

    /// Go on from the forces of the last problem if it is solved; true when they solve the problem itself.
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

    /// Displacement (m) of a contact by its own yielding.
    pub fn yielded(&self, contact: usize, force: f64) -> f64 {
        self.share * self.own[contact] * (force - self.centre[contact])
    }
}
