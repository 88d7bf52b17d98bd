//! Answers of the core to a scene with another friction, speed, internal step, scheme or solver: its rejection or its warnings.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::Quantity;
use tiprub_shell::{Failure, Result, native};

use crate::error::scene::SceneRun;

/// Scheme and solver.
pub type Method = (Scheme, Solver);

/// Friction coefficient and speed; `None` keeps the value of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OperatingPoint {
    /// Friction coefficient µ.
    pub friction: Option<f64>,
    /// Speed (rad/s).
    pub speed: Option<f64>,
}

/// Warnings, or the reason of a rejection.
pub type ScreeningResult = Result<Vec<String>, String>;

/// Start values of a scene after replacements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneStart {
    /// Friction coefficient µ, if the scene has it.
    pub friction: Option<f64>,
    /// Speed (rad/s), if the master rotates.
    pub speed: Option<f64>,
    /// Damping ratio of the master, if the scene has it.
    pub damping_ratio: Option<f64>,
    /// Internal step (s) that divides the communication step.
    pub step: f64,
    /// Scheme and solver.
    pub method: Method,
}

/// Scene that is tried with other values.
#[derive(Debug, Clone, Copy)]
pub struct StabilityScene<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Start values that replace its own, as text.
    pub settings: &'a [(String, String)],
}

fn value(simulation: &Simulation, quantity: Quantity) -> Option<f64> {
    let reference = simulation.table().with_quantity(quantity)?.reference;
    simulation.real(reference).ok()
}

fn set(simulation: &mut Simulation, quantity: Quantity, value: Option<f64>) -> tiprub_core::Result<()> {
    let reference = simulation.table().with_quantity(quantity).map(|variable| variable.reference);
    reference.zip(value).map_or(Ok(()), |(reference, value)| simulation.set_real(reference, value))
}

/// Returns the step (s) that divides a communication step of this length; exactly `largest` if that divides it.
pub fn divided(length: f64, largest: f64) -> f64 {
    let step = length / (length / largest * (1.0 - 1e-9)).ceil().max(1.0);
    if (step / largest - 1.0).abs() < 1e-9 { largest } else { step }
}

impl StabilityScene<'_> {
    /// Returns the start values of the scene.
    ///
    /// # Errors
    /// The scene is rejected for all values, or start values are wrong.
    pub fn start_values(&self) -> Result<SceneStart> {
        let settings = &self.scene.settings;
        let in_scene = |error| Failure::from_core(format!("scene `{}`", settings.name), error);
        let mut simulation = Simulation::new(self.scene).map_err(in_scene)?;
        for (name, value) in self.settings {
            native::set(&mut simulation, name, value)?;
        }
        let largest = value(&simulation, Quantity::StepMax).unwrap_or(settings.time.step);
        let length = settings.experiment.communication_step;
        Ok(SceneStart {
            friction: value(&simulation, Quantity::Friction),
            speed: value(&simulation, Quantity::Speed),
            damping_ratio: value(&simulation, Quantity::DampingRatio),
            step: divided(length, largest),
            method: (settings.time.scheme, settings.contacts[0].solver),
        })
    }

    /// Returns the answers at one internal step (s), point by point. The communication step equals the internal step, so that exactly the requested
    /// step is used.
    pub fn at(&self, method: Method, step: f64, places: &[OperatingPoint]) -> Vec<ScreeningResult> {
        let mut scene = SceneRun::changed(self.scene, method, step, 0.0);
        scene.settings.experiment.communication_step = step;
        let mut simulation = match Simulation::new(&scene) {
            Ok(simulation) => simulation,
            Err(error) => return vec![Err(error.to_string()); places.len()],
        };
        places.iter().map(|place| self.answer(&mut simulation, *place)).collect()
    }

    fn answer(&self, simulation: &mut Simulation, place: OperatingPoint) -> ScreeningResult {
        simulation.reset();
        for (name, value) in self.settings {
            native::set(simulation, name, value).map_err(|failure| failure.to_string())?;
        }
        set(simulation, Quantity::Friction, place.friction)
            .and_then(|()| set(simulation, Quantity::Speed, place.speed))
            .and_then(|()| simulation.initialise(self.scene.settings.experiment.start))
            .map_err(|error| error.to_string())?;
        Ok(tiprub_cosim::warning::texts(simulation.warnings()))
    }
}

#[cfg(test)]
mod tests {
    use super::divided;

    #[test]
    fn step_is_the_largest_divisor_within_the_limit() {
        assert_eq!(divided(1e-5, 1e-6).to_bits(), 1e-6_f64.to_bits());
        assert!((divided(1e-5, 3e-6) - 2.5e-6).abs() < 1e-18 && (divided(1e-6, 3e-6) - 1e-6).abs() < 1e-18);
    }
}
