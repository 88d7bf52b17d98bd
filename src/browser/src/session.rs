//! Run of one scene, step by step, with selected outputs as numbers.

use tiprub_core::scene::settings::ExperimentSettings;
use tiprub_core::{CoSimulation, Simulation};
use tiprub_cosim::variables::{DataType, Value};
use tiprub_cosim::{Diagnostic, Error};

/// Result whose error is a text for the user.
pub(crate) type Result<T> = core::result::Result<T, String>;

/// Simulation of a scene, and the number of its finished communication steps.
pub(crate) struct Session {
    simulation: Simulation,
    experiment: ExperimentSettings,
    /// Types and value references of the selected outputs.
    outputs: Vec<(DataType, u32)>,
    /// Number of finished communication steps.
    steps: u32,
}

impl Session {
    /// Reads a scene whose structures all use the same ROM. `names` selects outputs by name, one per line.
    ///
    /// # Errors
    /// The scene, the ROM or a name is rejected.
    pub(crate) fn new(scene: &str, rom: &[u8], names: &str) -> Result<Self> {
        let read = |_: usize, _: &_| tiprub_format::read_rom(rom, "ROM");
        let scene = tiprub_format::read_scene(scene, "scene", read).map_err(|error: Diagnostic| error.to_string())?;
        let experiment = scene.settings.experiment.clone();
        let simulation = Simulation::new(scene).map_err(message)?;
        let outputs = names.lines().map(|name| locate(&simulation, name)).collect::<Result<_>>()?;
        Ok(Self { simulation, experiment, outputs, steps: 0 })
    }

    /// Resets the simulation to the start values of the scene.
    pub(crate) fn reset(&mut self) {
        self.simulation.reset();
        self.steps = 0;
    }

    /// Sets an input or a parameter (SI units).
    ///
    /// # Errors
    /// The name is unknown, or the value is rejected.
    pub(crate) fn set(&mut self, name: &str, value: f64) -> Result<()> {
        let (_, reference) = locate(&self.simulation, name)?;
        self.simulation.set(reference, Value::Real(value)).map_err(message)
    }

    /// Initialises the run at the start time of the scene.
    ///
    /// # Errors
    /// A start value is rejected.
    pub(crate) fn initialise(&mut self) -> Result<()> {
        self.simulation.initialise(self.experiment.start).map_err(message)
    }

    /// Performs one communication step of the scene.
    ///
    /// # Errors
    /// The step fails.
    pub(crate) fn step(&mut self) -> Result<()> {
        let [time, next] = [self.steps, self.steps + 1].map(|index| self.time(index));
        self.simulation.do_step(time, next - time).map_err(message)?;
        self.steps += 1;
        Ok(())
    }

    /// Returns the number of communication steps of the scene.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a cast saturates, and the count is positive"
    )]
    pub(crate) fn step_count(&self) -> u32 {
        ((self.experiment.stop - self.experiment.start) / self.experiment.communication_step).round() as u32
    }

    /// Returns the time (s) of a communication point, with the same bits as in `tiprub run`.
    fn time(&self, index: u32) -> f64 {
        self.experiment.start + f64::from(index) * self.experiment.communication_step
    }

    /// Returns the time (s) and the selected outputs (SI units).
    ///
    /// # Errors
    /// An output is not numeric.
    pub(crate) fn row(&self) -> Result<Vec<f64>> {
        let mut row = vec![self.time(self.steps)];
        for (kind, reference) in &self.outputs {
            let value = match kind {
                DataType::Real => self.simulation.real(*reference),
                DataType::Boolean => self.simulation.boolean(*reference).map(|value| f64::from(u8::from(value))),
                _ => self.simulation.integer(*reference).map(f64::from),
            };
            row.push(value.map_err(message)?);
        }
        Ok(row)
    }

    /// Returns the warnings since the last call, one per line.
    pub(crate) fn warnings(&mut self) -> String {
        let mut all = if self.steps == 0 { self.simulation.warnings().to_vec() } else { Vec::new() };
        all.extend(self.simulation.take_notes());
        all.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    }
}

/// Returns the type and the value reference of the variable or array element with this name.
fn locate(simulation: &Simulation, name: &str) -> Result<(DataType, u32)> {
    for variable in simulation.table().variables() {
        let references = (variable.reference..).take(variable.len());
        if let Some((_, reference)) = (0..).zip(references).find(|(index, _)| variable.element_name(*index) == name) {
            return Ok((variable.kind, reference));
        }
    }
    Err(format!("variable `{name}`: the scene has no such variable. Correct the name."))
}

fn message(error: Error) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session(names: &str) -> Result<Session> {
        let scene = tiprub_test_models::rub(4);
        let rom = tiprub_format::write_rom(&scene.roms[0]);
        Session::new(&tiprub_format::write_scene(&scene.settings), &rom, names)
    }

    #[test]
    fn row_has_time_and_selected_outputs() {
        let mut session = session("clearance_minimum\nin_contact\ncontact_count").unwrap();
        session.initialise().unwrap();
        session.step().unwrap();
        let row = session.row().unwrap();
        assert_eq!(row.len(), 1 + 3);
        assert_eq!(row[0].to_bits(), session.experiment.communication_step.to_bits());
        let touches = row[3] > 0.0;
        assert!(row[1].abs() < 1.0 && (row[2] > 0.0) == touches, "{row:?}");
    }

    #[test]
    fn reset_repeats_the_run_with_the_same_bits() {
        let mut session = session("torque\nclearance_minimum").unwrap();
        let mut run = |gap_offset: f64| {
            session.reset();
            session.set("gap_offset", gap_offset).unwrap();
            session.initialise().unwrap();
            let rows = (0..session.step_count()).map(|_| session.step().and_then(|()| session.row()).unwrap());
            rows.flatten().map(f64::to_bits).collect::<Vec<_>>()
        };
        let first = run(0.0);
        assert_ne!(first, run(-1e-5));
        assert_eq!(first, run(0.0));
    }

    #[test]
    fn wrong_names_and_values_are_reported() {
        assert!(session("torqe").is_err_and(|text| text.contains("`torqe`")));
        let mut session = session("torque").unwrap();
        assert!(session.set("speed", f64::NAN).is_err_and(|text| text.contains("speed")));
        assert!(session.set("spee", 1.0).is_err_and(|text| text.contains("`spee`")));
        assert!(Session::new("name = 1", &[], "").is_err_and(|text| text.contains("scene")));
    }
}
