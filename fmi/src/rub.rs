//! The contact simulation as a co-simulation unit.

use std::path::Path;

use tiprub_core::simulation::InputCourses;
use tiprub_core::{Result, Simulation, Warning};
use tiprub_fmi_facade::{CoSimulationUnit, Loaded};

/// Compiled scene.
struct RubUnit(Simulation);

/// Reads and compiles the scene in the resources.
pub(crate) fn load(resources: &Path) -> Result<Loaded, String> {
    let loaded = tiprub_format::load_resources(resources).map_err(|error| error.to_string())?;
    let scene = loaded.scene;
    let unit = move || -> Result<Box<dyn CoSimulationUnit>> { Ok(Box::new(RubUnit(Simulation::new(&scene)?))) };
    Ok(Loaded {
        unit: Box::new(unit),
        token: loaded.token,
        fmi3_arrays: loaded.fmi3_arrays,
        release: tiprub_format::LIBRARY_RELEASE,
    })
}

impl CoSimulationUnit for RubUnit {
    tiprub_fmi_facade::delegate!(InputCourses);

    fn warnings(&self) -> &[Warning] {
        self.0.warnings()
    }

    fn take_notes(&mut self) -> Vec<Warning> {
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

    fn end_step_early(&mut self) -> Result<()> {
        self.0.end_step_early()
    }

    fn update_outputs(&mut self, time: f64) -> Result<()> {
        self.0.update_outputs();
        self.0.check_outputs(time)
    }

    fn no_derivatives(&self) -> Option<&'static str> {
        if self.0.is_differentiated() {
            return None;
        }
        Some(if self.0.table().find("step_derivatives").is_some() {
            "this FMU has no instantaneous derivatives: outputs do not depend on inputs at the same instant. For \
             derivatives of outputs at the end of the last step with respect to inputs over that step, set the \
             parameter step_derivatives to on (2) before initialisation"
        } else {
            "this FMU has no derivatives because it has no inputs that move or load a structure. Add such inputs to \
             the scene (whirl, moving, thermal), or do not request derivatives"
        })
    }
}
