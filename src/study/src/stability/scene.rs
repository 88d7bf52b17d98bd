//! What the core answers to a scene with another friction, speed, internal step, scheme or solver: its refusal or its warnings.

use tiprub_core::{
    Scene, Simulation,
    settings::{Scheme, Solver},
    variables::Quantity,
};
use tiprub_shell::{Failure, Result, native};

use crate::error::scene::SceneRun;

/// Scheme and solver.
pub type Method = (Scheme, Solver);

/// Friction coefficient and speed; `None` leaves what the scene has, or has not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OperatingPoint {
    /// µ.
    pub friction: Option<f64>,
    /// rad/s.
    pub speed: Option<f64>,
}

/// Warnings, or the refusal.
pub type ScreeningResult = Result<Vec<String>, String>;

/// Values with which a scene starts, after those that were set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneStart {
    /// µ, where the scene has it.
    pub friction: Option<f64>,
    /// Speed (rad/s), where the master turns.
    pub speed: Option<f64>,
    /// Damping ratio of the master, where the scene has it.
    pub damping_ratio: Option<f64>,
    /// Internal step (s): what the communication step is divided into.
    pub step: f64,
    /// Scheme and solver.
    pub method: Method,
}

/// A scene that can be asked.
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

/// The step (s) that a communication step of this length is divided into; the largest allowed where that divides it.
pub fn divided(length: f64, largest: f64) -> f64 {
    let step = length / (length / largest * (1.0 - 1e-9)).ceil().max(1.0);
    if (step / largest - 1.0).abs() < 1e-9 { largest } else { step }
}

impl StabilityScene<'_> {
    /// With what it starts.
    ///
    /// # Errors
    /// A scene that is refused whatever is asked, and start values that are none.
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

    /// The answers at one internal step (s), place by place. The communication step is the internal one, so that the step asked
    /// for is the step taken.
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
        Ok(tiprub_core::warning::texts(simulation.warnings()))
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
