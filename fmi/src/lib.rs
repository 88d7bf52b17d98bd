//! The library inside the FMU of a scene: [`tiprub_core::Simulation`] behind the C ABIs of `tiprub-fmi-facade`.
#![warn(unreachable_pub)]

use std::path::Path;

use tiprub_core::Simulation;
use tiprub_cosim::{CoSimulation, Diagnostic, Result};
use tiprub_fmi_facade::Loaded;

/// Reads the scene in the resources; the unit compiles it.
fn load(resources: &Path) -> Result<Loaded, Diagnostic> {
    let loaded = tiprub_format::load_resources(resources)?;
    let (scene, checks) = (loaded.scene, loaded.checks);
    let unit = move || -> Result<Box<dyn CoSimulation>> {
        let mut simulation = Simulation::new(scene)?;
        simulation.use_checks(&checks);
        simulation.skip_unneeded_states();
        Ok(Box::new(simulation))
    };
    Ok(Loaded {
        unit: Box::new(unit),
        token: loaded.token,
        fmi3_arrays: loaded.fmi3_arrays,
        release: tiprub_format::LIBRARY_RELEASE,
    })
}

tiprub_fmi_facade::library!(load);
