//! Courses of inputs over time: waves that close the clearance within a few periods.

use tiprub_core::{CoSimulation, Simulation};
use tiprub_cosim::variables::{Causality, DataType};

use super::scenes::{RandomScene, numbers};

/// An input element: its reference, and its value and slope at any time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RandomInput {
    /// Value reference.
    pub reference: u32,
    start: f64,
    amplitude: f64,
    /// Angular frequency (rad/s) and phase (rad).
    rate: f64,
    phase: f64,
    /// Growth per time (1/s).
    slope: f64,
    /// True for a wave from `start` and back, instead of around it.
    one_sided: bool,
}

impl RandomInput {
    /// Returns value and slope at a time (s).
    pub(crate) fn at(&self, time: f64) -> (f64, f64) {
        let (sine, cosine) = (self.rate * time + self.phase).sin_cos();
        let line = self.start + self.slope * time;
        if self.one_sided {
            return (
                line + 0.5 * self.amplitude * (self.phase.cos() - cosine),
                self.slope + 0.5 * self.amplitude * self.rate * sine,
            );
        }
        (line + self.amplitude * (sine - self.phase.sin()), self.slope + self.amplitude * self.rate * cosine)
    }
}

/// Returns the courses of all inputs of a scene, which begin at the start values.
pub(crate) fn courses(trial: &RandomScene, simulation: &Simulation) -> Vec<RandomInput> {
    let total: f64 = trial.lengths.iter().sum();
    let rows = simulation.table().variables().iter();
    let inputs = rows.filter(|row| row.causality == Causality::Input && row.kind == DataType::Real);
    inputs
        .flat_map(|row| (row.reference..).take(row.len()).map(|reference| (row.name.as_str(), reference)))
        .map(|(name, reference)| {
            let start = simulation.real(reference).unwrap_or(0.0);
            course(trial, total, (name, reference), start)
        })
        .collect()
}

fn course(trial: &RandomScene, total: f64, (name, reference): (&str, u32), start: f64) -> RandomInput {
    let mut random = numbers(trial.seed, 1000 + u64::from(reference));
    let rate = std::f64::consts::TAU * random.within(0.6, 3.0) / total;
    let phase = random.within(-3.0, 3.0);
    let still = RandomInput { reference, start, amplitude: 0.0, rate, phase, slope: 0.0, one_sided: false };
    let wave = |amplitude: f64| RandomInput { amplitude, ..still };
    // Several structures or pairs use the courses of a single one.
    match name.rsplit('.').next().unwrap_or(name) {
        "speed" => RandomInput { slope: 0.1 * random.signed() * start / total, ..wave(0.0) },
        "whirl_x" | "whirl_y" => wave(0.4 * trial.gap * random.signed()),
        "axial_shift" => wave(0.3 * trial.gap * random.signed()),
        "casing_radius_change" => {
            let depth = trial.gap * random.within(0.6, 2.0);
            RandomInput { amplitude: -depth, phase: 0.0, one_sided: true, ..still }
        }
        "casing_shape_factor" => wave(0.3 * random.signed()),
        "casing_shape_rotation" => RandomInput { slope: 20.0 * random.signed(), ..still },
        "casing_temperature" | "rotor_temperature" => {
            RandomInput { amplitude: 250.0 * random.within(-0.4, 1.0), phase: 0.0, one_sided: true, ..still }
        }
        "casing_load_amplitude" | "excitation_amplitude" => wave(0.5 * start),
        "casing_load_phase" | "excitation_phase" => RandomInput { slope: random.within(-100.0, 100.0), ..still },
        _ => still,
    }
}
