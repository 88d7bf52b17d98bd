//! Content of the .fmu of a thermal model: data, and a separate library.

use std::{env, path::Path};

use tiprub_cosim::CoSimulation;
use tiprub_fmi_host::archive;
use tiprub_model_description::{DefaultExperiment, Description};
use tiprub_shell::{Failure, Result};
use tiprub_thermal::{ConductionModel, ThermalSimulation};

use crate::{
    fmu::{FmiVersion, contents, generation_date},
    library::Library,
};

/// File name of the library inside the FMU, without extension, and `modelIdentifier` of both versions.
pub const MODEL_IDENTIFIER: &str = "tiprub_thermal";

const MODEL: (&str, &str, &str, &str) = (
    "resources/casing.thermal.safetensors",
    "application/octet-stream",
    "model",
    "The reduced-order model of heat conduction",
);

const ABOUT: &str = "This FMU computes heat conduction through a casing with a reduced finite-element model, with gas \
    inside and air outside. The importer sets the heat into each patch and the temperatures of gas and air, and reads \
    temperatures and heat flows. To couple it with a contact FMU, connect casing_friction_power there to casing_heat \
    here, and casing_temperature here to casing_temperature there. Each communication step is solved exactly, \
    however long it is.";
const STEPS: &str = "Heat inputs are constant over a step, so that the transferred heat is the value times the \
    length of the step. Heat flows from gas and air are averages over the last communication step.";

/// Thermal model that is ready for packaging.
#[derive(Debug)]
pub struct ThermalPackage<'a> {
    simulation: ThermalSimulation,
    libraries: &'a [Library],
    generated: String,
}

impl<'a> ThermalPackage<'a> {
    /// Creates an instance of the model, as an FMU would.
    ///
    /// # Errors
    /// The model is rejected, or SOURCE_DATE_EPOCH is invalid.
    pub fn new(model: &ConductionModel, libraries: &'a [Library]) -> Result<Self> {
        let simulation = ThermalSimulation::new(model.clone());
        let simulation = simulation.map_err(|error| Failure::from_core(format!("model `{}`", model.name), error))?;
        Ok(Self { simulation, libraries, generated: generation_date(env::var("SOURCE_DATE_EPOCH").ok().as_deref())? })
    }

    /// Writes the .fmu, completely or not at all; `arrays` applies to FMI 3.0 only.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, target: &Path, version: FmiVersion, arrays: bool) -> Result<()> {
        let resources = tiprub_format::thermal_resource_files(self.simulation.model(), arrays);
        let token = tiprub_format::instantiation_token(&resources);
        let description = self.description(&token, arrays);
        archive::write(target, &contents(version, &description, self.libraries, resources, None, MODEL))
    }

    fn description<'b>(&'b self, token: &'b str, fmi3_arrays: bool) -> Description<'b> {
        let model = self.simulation.model();
        Description {
            model_name: &model.name,
            identifier: MODEL_IDENTIFIER,
            token,
            description: "Heat conduction of a casing with friction heat, gas and air.",
            about: ABOUT,
            steps: STEPS,
            generated: &self.generated,
            generation_tool: concat!("tiprub ", env!("CARGO_PKG_VERSION")),
            version: env!("CARGO_PKG_VERSION"),
            author: "The tiprub developers",
            copyright: "Copyright (c) 2026 The tiprub developers",
            license: env!("CARGO_PKG_LICENSE"),
            experiment: DefaultExperiment { start: 0.0, stop: 100.0, step: 0.1 },
            fixed_internal_step: None,
            patches_of_roms: true,
            table: self.simulation.table(),
            fmi3_arrays,
            structures: Vec::new(),
            features: vec![model.origin.clone()],
            limits: vec![
                "Conductivity, heat capacity and film coefficients do not depend on temperature; there is no radiation."
                    .into(),
                "The end faces are adiabatic.".into(),
                "Heat enters evenly over the heated surface of a patch: flash temperatures of individual contacts are not resolved."
                    .into(),
            ],
            warnings: Vec::new(),
        }
    }
}
