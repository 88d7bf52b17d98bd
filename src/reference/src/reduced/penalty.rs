//! Central differences with a penalty: a node that penetrates by δ is pushed back with ε δ.

use super::{ReducedMethod, ReducedScene, ReducedStep, finite};

/// State of a run: amplitudes at t, velocities half a step earlier.
pub struct Penalty<'a, S: ReducedScene> {
    scene: &'a S,
    stiffness: f64,
    step: f64,
    steps: u64,
    position: Vec<f64>,
    velocity: Vec<f64>,
}

impl<'a, S: ReducedScene> Penalty<'a, S> {
    /// Creates a run from the start of the scene with steps of `step` (s) and contact stiffness `stiffness` (N/m) per
    /// node.
    ///
    /// # Errors
    /// A step at or beyond 2/ω_max.
    pub fn new(scene: &'a S, step: f64, stiffness: f64) -> Result<Self, String> {
        let modes = scene.modes();
        let limit = 2.0 / modes.largest_frequency();
        if step >= limit {
            return Err(format!("the step {step:.6e} s is not below 2/ω_max = {limit:.6e} s"));
        }
        let (position, velocity) = scene.start();
        // v(−h/2) = v(0) − h/2 a(0), without contact.
        let earlier = (0..modes.len()).map(|mode| {
            let frequency = modes.frequencies[mode];
            let drag = 2.0 * modes.damping[mode] * frequency * velocity[mode];
            velocity[mode] - 0.5 * step * (scene.load()[mode] - frequency * frequency * position[mode] - drag)
        });
        let velocity = earlier.collect();
        Ok(Self { scene, stiffness, step, steps: 0, position, velocity })
    }
}

impl<S: ReducedScene> ReducedMethod for Penalty<'_, S> {
    #[expect(clippy::cast_precision_loss, reason = "step counts are below 2^52")]
    fn step(&mut self) -> Result<ReducedStep, String> {
        let (h, modes) = (self.step, self.scene.modes());
        let contacts = self.scene.contacts(self.steps as f64 * h, &self.position, 0.0);
        let mut push = self.scene.load().to_vec();
        for contact in &contacts {
            contact.force.add_to(-self.stiffness * contact.gap, &mut push);
        }
        for mode in 0..push.len() {
            let frequency = modes.frequencies[mode];
            let decay = modes.damping[mode] * frequency * h;
            let force = push[mode] - frequency * frequency * self.position[mode];
            let next = ((1.0 - decay) * self.velocity[mode] + h * force) / (1.0 + decay);
            self.velocity[mode] = next;
            self.position[mode] += h * next;
        }
        self.steps += 1;
        finite(&self.position, self.steps)?;
        Ok(ReducedStep {
            forces: contacts.iter().map(|contact| (contact.node, -self.stiffness * contact.gap)).collect(),
            least_gap: contacts.iter().fold(f64::INFINITY, |least, contact| least.min(contact.gap)),
        })
    }

    /// Returns amplitudes, and velocities half a step earlier.
    fn state(&self) -> (&[f64], &[f64]) {
        (&self.position, &self.velocity)
    }

    /// Returns the energy that central differences conserve: ½ v² at half a step, ½ ω² q of this and the last step.
    fn energy(&self) -> f64 {
        let each = self.position.iter().zip(&self.velocity).zip(&self.scene.modes().frequencies);
        each.map(|((q, v), w)| 0.5 * (v * v + w * w * q * (q - self.step * v))).sum()
    }
}
