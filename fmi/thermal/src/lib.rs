//! The library inside the thermal FMU: [`tiprub_thermal::ThermalSimulation`] behind the C ABIs of `tiprub-fmi-facade`.
#![warn(unreachable_pub)]

use std::path::Path;

use tiprub_cosim::{CoSimulation, Diagnostic, Result};
use tiprub_fmi_facade::Loaded;
use tiprub_thermal::ThermalSimulation;

/// Reads the model in the resources.
fn load(resources: &Path) -> Result<Loaded, Diagnostic> {
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

tiprub_fmi_facade::library!(load);
