//! Time stepping of J. J. Moreau and M. Jean: velocities and impulses are complementary, impacts are inelastic.
//!
//! M. Jean, Comput. Methods Appl. Mech. Engrg 177 (1999) 235-257, θ = ½: with q at the middle of the step v⁺ − v = h
//! (f − 2ξω (v + v⁺)/2 − ω² (q + q⁺)/2) + Σ p F, q⁺ = q + h (v + v⁺)/2. A contact is active if its gap is closed at q +
//! h v/2 and t + h/2; then 0 ≤ p ⟂ N v⁺ + rate ≥ 0. Contacts are constrained by velocities, so that they penetrate by
//! their motion in half a step before they closed.

use nalgebra::{DMatrix, DVector};

use super::complementarity;
use super::{NodeContact, ReducedMethod, ReducedScene, ReducedStep, energy, finite};

/// State of a run.
pub struct Moreau<'a, S: ReducedScene> {
    scene: &'a S,
    step: f64,
    steps: u64,
    position: Vec<f64>,
    velocity: Vec<f64>,
    /// 1/(1 + hξω + h²ω²/4) and 1 − hξω − h²ω²/4.
    inertia: Vec<f64>,
    carried: Vec<f64>,
    middle: Vec<f64>,
}

impl<'a, S: ReducedScene> Moreau<'a, S> {
    /// Creates a run from the start of the scene with steps of `step` (s).
    pub fn new(scene: &'a S, step: f64) -> Self {
        let modes = scene.modes();
        let (position, velocity) = scene.start();
        let implicit = |(frequency, damping): (&f64, &f64)| {
            let angle = step * frequency;
            damping * angle + 0.25 * angle * angle
        };
        let shares: Vec<f64> = modes.frequencies.iter().zip(&modes.damping).map(implicit).collect();
        Self {
            scene,
            step,
            steps: 0,
            middle: position.clone(),
            position,
            velocity,
            inertia: shares.iter().map(|share| 1.0 / (1.0 + share)).collect(),
            carried: shares.iter().map(|share| 1.0 - share).collect(),
        }
    }

    /// Computes the impulses of the closed contacts from the velocities without impulses.
    fn impulses(&self, contacts: &[NodeContact], free: &[f64]) -> Result<Vec<f64>, String> {
        let mut impulses = Vec::with_capacity(contacts.len());
        for group in contacts.chunk_by(|a, b| a.group == b.group) {
            let count = group.len();
            let matrix =
                DMatrix::from_fn(count, count, |i, j| group[i].normal.weighted(&self.inertia, &group[j].force));
            let right = DVector::from_fn(count, |i, _| group[i].normal.dot(free) + group[i].rate);
            let found = complementarity::solve(&matrix, &right)
                .ok_or_else(|| format!("the contact problem of step {} has no solution", self.steps))?;
            impulses.extend(found.iter());
        }
        Ok(impulses)
    }
}

impl<S: ReducedScene> ReducedMethod for Moreau<'_, S> {
    #[expect(clippy::cast_precision_loss, reason = "step counts are below 2^52")]
    fn step(&mut self) -> Result<ReducedStep, String> {
        let (h, modes, load) = (self.step, self.scene.modes(), self.scene.load());
        let mut free = Vec::with_capacity(modes.len());
        for mode in 0..modes.len() {
            self.middle[mode] = self.position[mode] + 0.5 * h * self.velocity[mode];
            let square = modes.frequencies[mode] * modes.frequencies[mode];
            let right = self.carried[mode] * self.velocity[mode] + h * (load[mode] - square * self.position[mode]);
            free.push(self.inertia[mode] * right);
        }
        let contacts = self.scene.contacts((self.steps as f64 + 0.5) * h, &self.middle, 0.0);
        let impulses = self.impulses(&contacts, &free)?;
        if !contacts.is_empty() {
            let mut pushed = vec![0.0; free.len()];
            for (contact, impulse) in contacts.iter().zip(&impulses) {
                contact.force.add_to(*impulse, &mut pushed);
            }
            for mode in 0..free.len() {
                free[mode] += self.inertia[mode] * pushed[mode];
            }
        }
        for mode in 0..free.len() {
            self.position[mode] += 0.5 * h * (self.velocity[mode] + free[mode]);
        }
        self.velocity = free;
        self.steps += 1;
        finite(&self.position, self.steps)?;
        Ok(ReducedStep {
            forces: contacts.iter().zip(&impulses).map(|(contact, impulse)| (contact.node, impulse / h)).collect(),
            least_gap: contacts.iter().fold(f64::INFINITY, |least, contact| least.min(contact.gap)),
        })
    }

    fn state(&self) -> (&[f64], &[f64]) {
        (&self.position, &self.velocity)
    }
    fn energy(&self) -> f64 {
        energy(self.scene.modes(), &self.position, &self.velocity)
    }
}
