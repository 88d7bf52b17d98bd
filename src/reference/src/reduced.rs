//! Independent time steppers for a reduced model that consists only of modes, contact rows and a gap function.
//!
//! A [`ReducedScene`] returns the positions of its contact nodes for given modal amplitudes; the methods integrate q̈ +
//! 2ξω q̇ + ω² q = f + Σ λ F with gap g(q, t), normal row N = ∂g/∂q and force row F = N − µT of every contact:
//!
//! * [`moreau`]: the θ-method with θ = ½ and velocities that are complementary to impulses (exact complementarity);
//! * [`augmented`]: Newmark's average acceleration with an augmented Lagrangian, as in commercial codes;
//! * [`penalty`]: central differences with springs at penetrating nodes.
//!
//! The modes are computed here from mass and stiffness ([`modes`]), so that only the matrices are shared with the
//! tested code.

pub mod augmented;
pub mod bars;
pub mod complementarity;
pub mod disk;
pub mod modes;
pub mod moreau;
pub mod penalty;
pub mod ring;
pub mod rub;

use modes::DampedModes;

/// Sparse row over the modes: blocks that begin at the first mode of a body. Two rows interact where blocks have the
/// same start.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SparseRow(pub Vec<(usize, Vec<f64>)>);

impl SparseRow {
    /// Returns Σ row·values.
    pub(crate) fn dot(&self, values: &[f64]) -> f64 {
        let piece =
            |(start, row): &(usize, Vec<f64>)| -> f64 { row.iter().zip(&values[*start..]).map(|(a, b)| a * b).sum() };
        self.0.iter().map(piece).sum()
    }

    /// Returns Σ row·weights·other.
    pub(crate) fn weighted(&self, weights: &[f64], other: &Self) -> f64 {
        let mut sum = 0.0;
        for (start, row) in &self.0 {
            for (_, other) in other.0.iter().filter(|piece| piece.0 == *start) {
                sum += row.iter().zip(other).zip(&weights[*start..]).map(|((a, b), w)| a * b * w).sum::<f64>();
            }
        }
        sum
    }

    /// Computes values += factor·row.
    pub(crate) fn add_to(&self, factor: f64, values: &mut [f64]) {
        for (start, row) in &self.0 {
            values[*start..].iter_mut().zip(row).for_each(|(value, row)| *value += factor * row);
        }
    }
}

/// Contact node near the obstacle.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeContact {
    /// Index of the node in the whole scene.
    pub node: usize,
    /// Group of the contact; contacts of different groups are uncoupled.
    pub group: usize,
    /// Gap (m).
    pub gap: f64,
    /// Rate of the gap due to prescribed motion (m/s).
    pub rate: f64,
    /// ∂g/∂q.
    pub normal: SparseRow,
    /// Modal force per unit multiplier, friction included.
    pub force: SparseRow,
}

/// Reduced model with its obstacle.
pub trait ReducedScene {
    /// Returns the modes.
    fn modes(&self) -> &DampedModes;

    /// Returns the contacts with a gap of at most `within` (m) at a time (s) and modal amplitudes, group after group.
    fn contacts(&self, time: f64, position: &[f64], within: f64) -> Vec<NodeContact>;

    /// Returns the modal forces other than contact.
    fn load(&self) -> &[f64];

    /// Returns the modal amplitudes and velocities at time 0.
    fn start(&self) -> (Vec<f64>, Vec<f64>);

    /// Returns the displacements that are compared (m), in an order that the scene defines.
    fn observed(&self, position: &[f64]) -> Vec<f64>;
}

/// Results of a step of any method.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReducedStep {
    /// Multipliers of the step: node and normal force (N).
    pub forces: Vec<(usize, f64)>,
    /// Smallest gap in the step (m).
    pub least_gap: f64,
}

/// Method that integrates a scene.
pub trait ReducedMethod {
    /// Performs one step.
    ///
    /// # Errors
    /// A contact problem that is not solved, or a state that is not finite.
    fn step(&mut self) -> Result<ReducedStep, String>;

    /// Returns the modal amplitudes and velocities at the current time.
    fn state(&self) -> (&[f64], &[f64]);

    /// Returns the kinetic and strain energy (J).
    fn energy(&self) -> f64;
}

/// Returns the kinetic and strain energy of modal amplitudes and velocities at the same time (J).
fn energy(modes: &DampedModes, position: &[f64], velocity: &[f64]) -> f64 {
    let each = position.iter().zip(velocity).zip(&modes.frequencies);
    each.map(|((q, v), w)| 0.5 * (v * v + w * w * q * q)).sum()
}

fn finite(values: &[f64], step: u64) -> Result<(), String> {
    // A very large amplitude counts as divergence before it is infinite.
    match values.iter().all(|value| value.abs() < 1e12) {
        true => Ok(()),
        false => Err(format!("the motion diverged in step {step}")),
    }
}
