//! Heat conduction of a casing as a co-simulation unit.

use std::path::Path;

use tiprub_core::{Result, Warning};
use tiprub_fmi_facade::{CoSimulationUnit, Loaded};
use tiprub_thermal::{ThermalInputs, ThermalSimulation};

/// Reduced model and its state.
struct ConductionUnit(ThermalSimulation);

/// Reads the model in the resources.
pub(crate) fn load(resources: &Path) -> Result<Loaded, String> {
    let loaded = tiprub_format::load_thermal_resources(resources).map_err(|error| error.to_string())?;
    let model = loaded.model;
    let unit =
        move || -> Result<Box<dyn CoSimulationUnit>> { Ok(Box::new(ConductionUnit(ThermalSimulation::new(model)?))) };
    Ok(Loaded {
        unit: Box::new(unit),
        token: loaded.token,
        fmi3_arrays: loaded.fmi3_arrays,
        release: tiprub_format::LIBRARY_RELEASE,
    })
}

impl CoSimulationUnit for ConductionUnit {
    tiprub_fmi_facade::delegate!(ThermalInputs);

    fn warnings(&self) -> &[Warning] {
        &[]
    }

    fn take_notes(&mut self) -> Vec<Warning> {
        self.0.take_notes()
    }

    fn begin_step(&mut self, current_time: f64, step_size: f64, _partial: bool) -> Result<()> {
        self.0.begin_step(current_time, step_size)
    }

    /// A communication step is one internal step, so there is no time in between at which it could end.
    fn end_step_early(&mut self) -> Result<()> {
        Ok(())
    }

    /// Outputs belong to the last communication point as soon as it is reached.
    fn update_outputs(&mut self, _time: f64) -> Result<()> {
        Ok(())
    }

    fn no_derivatives(&self) -> Option<&'static str> {
        None
    }
}
