//! Independent time steppers over a reduced model: modes, contact rows and a gap function, nothing else.
//!
//! A [`ReducedScene`] says where its contact nodes stand when the modes have given amplitudes; the methods march
//! q̈ + 2ξω q̇ + ω² q = f + Σ λ F with gap g(q, t), normal row N = ∂g/∂q and force row F = N − µT of every contact:
//!
//! * [`moreau`]: the θ-method with θ = ½ and velocities that are complementary to impulses (exact complementarity);
//! * [`augmented`]: Newmark's average acceleration with an augmented Lagrangian, as commercial codes do it;
//! * [`penalty`]: central differences with springs where nodes penetrate.
//!
//! The modes are solved for here from mass and stiffness ([`modes`]), so that nothing but the matrices is shared with
//! what is judged.

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

/// A sparse row over the modes: pieces that begin at the first mode of a body. Two rows meet where pieces begin alike.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SparseRow(pub Vec<(usize, Vec<f64>)>);

impl SparseRow {
    /// Σ row·values.
    pub(crate) fn dot(&self, values: &[f64]) -> f64 {
        let piece =
            |(start, row): &(usize, Vec<f64>)| -> f64 { row.iter().zip(&values[*start..]).map(|(a, b)| a * b).sum() };
        self.0.iter().map(piece).sum()
    }

    /// Σ row·weights·other.
    pub(crate) fn weighted(&self, weights: &[f64], other: &Self) -> f64 {
        let mut sum = 0.0;
        for (start, row) in &self.0 {
            for (_, other) in other.0.iter().filter(|piece| piece.0 == *start) {
                sum += row.iter().zip(other).zip(&weights[*start..]).map(|((a, b), w)| a * b * w).sum::<f64>();
            }
        }
        sum
    }

    /// values += factor·row.
    pub(crate) fn add_to(&self, factor: f64, values: &mut [f64]) {
        for (start, row) in &self.0 {
            values[*start..].iter_mut().zip(row).for_each(|(value, row)| *value += factor * row);
        }
    }
}

/// One contact node near the obstacle.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeContact {
    /// Which node, over the whole scene.
    pub node: usize,
    /// Contacts of different groups do not know of each other.
    pub group: usize,
    /// Gap (m).
    pub gap: f64,
    /// Rate of the gap by prescribed motion (m/s).
    pub rate: f64,
    /// ∂g/∂q.
    pub normal: SparseRow,
    /// Modal force per unit multiplier, friction included.
    pub force: SparseRow,
}

/// A reduced model with its obstacle.
pub trait ReducedScene {
    /// The modes.
    fn modes(&self) -> &DampedModes;

    /// The contacts with a gap of at most `within` (m) at a time (s) and modal amplitudes, groups one after the other.
    fn contacts(&self, time: f64, position: &[f64], within: f64) -> Vec<NodeContact>;

    /// Modal forces beside contact.
    fn load(&self) -> &[f64];

    /// Modal amplitudes and velocities at time 0.
    fn start(&self) -> (Vec<f64>, Vec<f64>);

    /// Displacements that are compared (m), in an order of the scene's own.
    fn observed(&self, position: &[f64]) -> Vec<f64>;
}

/// Results of a step of any method.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReducedStep {
    /// Multipliers of the step: node and normal force (N).
    pub forces: Vec<(usize, f64)>,
    /// Smallest gap that was seen in the step (m).
    pub least_gap: f64,
}

/// A method that marches a scene.
pub trait ReducedMethod {
    /// One step.
    ///
    /// # Errors
    /// The contact problem is not solved, or the state is not finite.
    fn step(&mut self) -> Result<ReducedStep, String>;

    /// Modal amplitudes and velocities at the time reached.
    fn state(&self) -> (&[f64], &[f64]);

    /// Kinetic and strain energy (J).
    fn energy(&self) -> f64;
}

/// Kinetic and strain energy of modal amplitudes and velocities of one instant (J).
fn energy(modes: &DampedModes, position: &[f64], velocity: &[f64]) -> f64 {
    let each = position.iter().zip(velocity).zip(&modes.frequencies);
    each.map(|((q, v), w)| 0.5 * (v * v + w * w * q * q)).sum()
}

fn finite(values: &[f64], step: u64) -> Result<(), String> {
    // An amplitude beyond all bounds is a divergence before it is infinite.
    match values.iter().all(|value| value.abs() < 1e12) {
        true => Ok(()),
        false => Err(format!("the motion diverged in step {step}")),
    }
}
