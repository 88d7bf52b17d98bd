//! Loading of heat conduction.

use std::path::Path;

use tiprub_cosim::{CoSimulation, Diagnostic, Result};
use tiprub_fmi_facade::Loaded;
use tiprub_thermal::ThermalSimulation;

/// Reads the model in the resources.
pub(crate) fn load(resources: &Path) -> Result<Loaded, Diagnostic> {
    let loaded = tiprub_format::load_thermal_resources(resources)?;
    let model = loaded.model;
    let unit = move || -> Result<Box<dyn CoSimulation>> { Ok(Box::new(ThermalSimulation::new(model)?)) };
    Ok(Loaded {
        unit: Box::new(unit),
        token: loaded.token,
        fmi3_arrays: loaded.fmi3_arrays,
        release: tiprub_format::LIBRARY_RELEASE,
    })
}
