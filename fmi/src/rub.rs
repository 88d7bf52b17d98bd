//! The contact simulation as a unit.

use std::any::Any;
use std::path::Path;

use tiprub_core::simulation::{Courses, Progress};
use tiprub_core::{Result, Simulation, VariableTable};
use tiprub_fmi_facade::{Loaded, Unit};

/// A compiled scene.
#[derive(Debug)]
struct Rub(Simulation);

/// The scene of the resources, compiled.
pub(crate) fn load(resources: &Path) -> Result<Loaded, String> {
    let loaded = tiprub_format::load_resources(resources).map_err(|error| error.to_string())?;
    let scene = loaded.scene;
    let unit = move || -> Result<Box<dyn Unit>> { Ok(Box::new(Rub(Simulation::new(&scene)?))) };
    Ok(Loaded { unit: Box::new(unit), token: loaded.token, fmi3_arrays: loaded.fmi3_arrays })
}

impl Unit for Rub {
    fn table(&self) -> &VariableTable {
        self.0.table()
    }

    fn real(&self, reference: u32) -> Result<f64> {
        self.0.real(reference)
    }

    fn integer(&self, reference: u32) -> Result<i32> {
        self.0.integer(reference)
    }

    fn boolean(&self, reference: u32) -> Result<bool> {
        self.0.boolean(reference)
    }

    fn string(&self, reference: u32) -> Result<&str> {
        self.0.string(reference)
    }

    fn set_real(&mut self, reference: u32, value: f64) -> Result<()> {
        self.0.set_real(reference, value)
    }

    fn set_integer(&mut self, reference: u32, value: i32) -> Result<()> {
        self.0.set_integer(reference, value)
    }

    fn set_boolean(&mut self, reference: u32, value: bool) -> Result<()> {
        self.0.set_boolean(reference, value)
    }

    fn set_string(&mut self, reference: u32, value: &str) -> Result<()> {
        self.0.set_string(reference, value)
    }

    fn set_input_derivative(&mut self, reference: u32, order: i32, value: f64) -> Result<()> {
        self.0.set_input_derivative(reference, order, value)
    }

    fn output_derivative(&self, reference: u32, order: i32) -> Result<f64> {
        self.0.output_derivative(reference, order)
    }

    fn courses(&self) -> Box<dyn Any> {
        Box::new(self.0.courses())
    }

    fn restore_courses(&mut self, courses: Box<dyn Any>) {
        if let Ok(courses) = courses.downcast::<Courses>() {
            self.0.restore_courses(*courses);
        }
    }

    fn initialise(&mut self, start_time: f64) -> Result<()> {
        self.0.initialise(start_time)
    }

    fn reset(&mut self) {
        self.0.reset();
    }

    fn time(&self) -> f64 {
        self.0.time()
    }

    fn warnings(&self) -> &[String] {
        self.0.warnings()
    }

    fn take_notes(&mut self) -> Vec<String> {
        self.0.take_notes()
    }

    fn begin_step(&mut self, current_time: f64, step_size: f64, partial: bool) -> Result<()> {
        if partial {
            self.0.begin_partial_step(current_time, step_size)
        } else {
            self.0.begin_step(current_time, step_size)
        }
    }

    fn fly_ahead(&mut self) {
        self.0.fly_ahead();
    }

    fn advance(&mut self) -> Result<Progress> {
        self.0.advance()
    }

    fn is_stepping(&self) -> bool {
        self.0.is_stepping()
    }

    fn end_step_early(&mut self) -> Result<()> {
        self.0.end_step_early()
    }

    fn update_outputs(&mut self, time: f64) -> Result<()> {
        self.0.update_outputs();
        self.0.check_outputs(time)
    }

    fn state_size(&self) -> usize {
        self.0.state_size()
    }

    fn save_state(&self, buffer: &mut [u8]) -> Result<()> {
        self.0.save_state(buffer)
    }

    fn restore_state(&mut self, buffer: &[u8]) -> Result<()> {
        self.0.restore_state(buffer)
    }

    fn no_derivatives(&self) -> Option<&'static str> {
        if self.0.is_differentiated() {
            return None;
        }
        Some(if self.0.table().find("step_derivatives").is_some() {
            "this FMU has no derivatives at an instant: outputs do not depend on inputs of the same instant. For those of outputs at the \
             end of the last step by inputs over it, set the parameter step_derivatives to on (2) before initialisation"
        } else {
            "this FMU has no inputs that move or load something, and no derivatives. Ask for such inputs in the scene (whirl, moving, thermal), or do without"
        })
    }

    fn step_derivative(
        &mut self,
        outputs: &[u32],
        inputs: &[u32],
        seed: &[f64],
        sensitivity: &mut [f64],
    ) -> Result<()> {
        self.0.step_derivative(outputs, inputs, seed, sensitivity)
    }
}
