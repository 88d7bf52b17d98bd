//! Content of an .fmu for both FMI versions: nothing is compiled, all parts except the libraries are data.

use std::{env, path::Path};

use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::Quantity;
use tiprub_cosim::warning::{self, Warning};
use tiprub_fmi_host::archive::{self, ArchiveEntry};
use tiprub_model_description::{
    DefaultExperiment, Description, fmi2_xml, fmi3_terminals, fmi3_xml, html, references_manifest,
};
use tiprub_shell::{
    Failure, Result,
    native::{self, RunInputs},
    schedule::Schedule,
};

use crate::{library::Library, scene_features};

/// File name of the library inside the FMU, without extension, and `modelIdentifier` of both versions.
pub const MODEL_IDENTIFIER: &str = "tiprub";

/// Number of communication steps of the reference result in the documentation, and largest number of values in it.
const REFERENCE_STEPS: usize = 100;
const REFERENCE_VALUES: usize = 20_000_000;

/// Largest number of variables of an FMI 3.0 unit that are scalars by default. Several importers do not read arrays, or use only their first
/// element; longer lists are not readable for people.
pub const MOST_SCALARS: usize = 300;

/// Largest number of variables of an FMU without arrays: each needs half a kilobyte in the model description, which importers hold in memory.
pub const MOST_VARIABLES: usize = 100_000;

/// Entry of FMI-LS-REF for a file of an FMU: path, MIME type, role, description.
pub type Related<'a> = (&'a str, &'a str, &'a str, &'a str);

/// Scene inside the FMU.
const SCENE: Related =
    ("resources/scene.toml", "application/toml", "model", "The scene that this FMU was generated from");

/// Text above all variables on the page inside the FMU.
const ABOUT: &str = "This FMU integrates reduced-order models of flexible structures in time, together with their \
    unilateral contact with a rigid or flexible surface. The importer sets inputs, advances the FMU step by step, and \
    reads clearances, forces, torques and energies. Within each communication step, the FMU takes as many internal \
    steps as needed and ends exactly at the communication point.";
/// Text about the steps of the FMU.
const STEPS: &str = "A communication step is usually much longer than an impact. Forces and torques are therefore \
    averages over the last communication step, and the extremes within the step are separate outputs.";

const ICON: &[u8] = include_bytes!("../assets/icon.png");
const THIRD_PARTY: &str = include_str!("../assets/third-party.txt");
const LICENSE_MIT: &str = include_str!("../../LICENSE-MIT");
const LICENSE_APACHE: &str = include_str!("../../LICENSE-APACHE");
const LICENSE: &str = "This FMU and the library in it are licensed under either of\n\
    - the MIT license (LICENSE-MIT.txt), or\n- the Apache License, Version 2.0 (LICENSE-APACHE.txt)\n\
    at your option. third-party.txt lists the libraries it contains and their licenses.\n\
    The scene and the reduced-order models in resources/ belong to their authors.\n";

/// FMI version of a package.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FmiVersion {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

impl FmiVersion {
    /// Digit for file names and messages.
    pub fn digit(self) -> char {
        match self {
            Self::Two => '2',
            Self::Three => '3',
        }
    }
}

/// Scene that is ready for packaging.
#[derive(Debug)]
pub struct FmuPackage<'a> {
    scene: &'a Scene,
    /// Scene as the FMU contains it.
    packed: Scene,
    simulation: Simulation,
    libraries: &'a [Library],
    reference_csv: String,
    reference_steps: usize,
    warnings: Vec<Warning>,
    generated: String,
}

impl<'a> FmuPackage<'a> {
    /// Compiles and initialises the scene (with the same checks as an FMU instance), and runs the reference.
    ///
    /// # Errors
    /// The scene is rejected, or SOURCE_DATE_EPOCH is invalid.
    pub fn new(scene: &'a Scene, libraries: &'a [Library]) -> Result<Self> {
        let in_scene = |error| Failure::from_core(format!("scene `{}`", scene.settings.name), error);
        let mut schedule = Schedule::new(&scene.settings.experiment, None, None)?;
        let packed = tiprub_format::packed_scene(scene);
        let mut simulation = Simulation::new(&packed).map_err(in_scene)?;
        simulation.initialise(schedule.start).map_err(in_scene)?;
        let mut warnings = [simulation.warnings(), &schedule.warnings()].concat();
        warnings.retain(|warning| !scene.settings.is_silenced(warning.topic()));
        let reference_steps = REFERENCE_STEPS.min(REFERENCE_VALUES / simulation.table().references());
        if schedule.count > reference_steps {
            schedule.count = reference_steps;
            schedule.stop = schedule.start + reference_steps as f64 * schedule.step;
        }
        let checks = simulation.checks();
        let given = RunInputs { checks: &checks, ..RunInputs::default() };
        let reference_csv = native::run(&packed, &schedule, given, &|_| {})?.recording.to_csv();
        let generated = generation_date(env::var("SOURCE_DATE_EPOCH").ok().as_deref())?;
        Ok(Self { scene, packed, simulation, libraries, reference_csv, reference_steps, warnings, generated })
    }

    /// Returns the warnings of the initialisation (which an FMU instance would log) and of the default experiment.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Writes the .fmu, completely or not at all. `arrays` applies to FMI 3.0 only: it keeps arrays whole, by default if there would be more than
    /// [`MOST_SCALARS`] variables. FMI 2.0 always has scalars.
    ///
    /// # Errors
    /// There are more than [`MOST_VARIABLES`] variables without arrays, or the file cannot be written.
    pub fn write(&self, target: &Path, version: FmiVersion, arrays: Option<bool>) -> Result<()> {
        let values = self.simulation.table().references();
        let arrays = arrays.unwrap_or(values > MOST_SCALARS);
        if values > MOST_VARIABLES && !(arrays && version == FmiVersion::Three) {
            return Err(self.too_many(values, version));
        }
        archive::write(target, &self.entries(version, arrays))
    }

    fn too_many(&self, values: usize, version: FmiVersion) -> Failure {
        let without = if version == FmiVersion::Two { "FMI 2.0 has no arrays" } else { "--scalars writes no arrays" };
        let rows = self.simulation.table().variables().iter();
        let largest = rows.max_by_key(|row| row.len()).map(|row| format!("; `{}` alone has {}", row.name, row.len()));
        Failure::new(
            format!("scene `{}`", self.scene.settings.name),
            format!(
                "{without}, and {values} variables exceed the limit of {MOST_VARIABLES} for such an FMU{}",
                largest.unwrap_or_default()
            ),
            "Request fewer outputs in the scene, or write only FMI 3.0 with arrays: --fmi 3 --arrays",
        )
    }

    /// Returns the files of the .fmu in their order.
    fn entries(&self, version: FmiVersion, arrays: bool) -> Vec<ArchiveEntry> {
        let mut resources = tiprub_format::resource_files(self.scene, arrays);
        let token = tiprub_format::instantiation_token(&resources);
        let checks = self.simulation.checks();
        if !checks.is_empty() {
            resources.push((tiprub_format::CHECKS_FILE.to_owned(), tiprub_format::write_checks(&checks)));
        }
        let description = self.description(&token, arrays);
        let reference = Some((self.reference_csv.as_str(), self.reference_steps));
        contents(version, &description, self.libraries, resources, reference, SCENE)
    }

    /// Returns the internal step (s) that applies to every communication step that is a multiple of it: the largest permitted step, if the default
    /// communication step is a multiple of that. Adaptive steps have no fixed length.
    fn fixed_internal_step(&self) -> Option<f64> {
        let variable = self.simulation.table().with_quantity(Quantity::StepMax)?;
        let most = self.simulation.real(variable.reference).ok()?;
        let whole = self.scene.settings.experiment.communication_step / most;
        let varies = self.scene.settings.time.scheme.properties().adaptive;
        let fixed = !varies && whole.round() >= 1.0 && (whole - whole.round()).abs() <= 1e-9 * whole;
        fixed.then_some(most)
    }

    fn description<'b>(&'b self, token: &'b str, arrays: bool) -> Description<'b> {
        let settings = &self.scene.settings;
        let structures = settings.structures.iter().map(|structure| structure.name.as_str());
        Description {
            model_name: &settings.name,
            identifier: MODEL_IDENTIFIER,
            about: ABOUT,
            steps: STEPS,
            token,
            description: &settings.description,
            generated: &self.generated,
            generation_tool: concat!("tiprub ", env!("CARGO_PKG_VERSION")),
            version: env!("CARGO_PKG_VERSION"),
            author: "The tiprub developers",
            copyright: "Copyright (c) 2026 The tiprub developers",
            license: env!("CARGO_PKG_LICENSE"),
            experiment: DefaultExperiment {
                start: settings.experiment.start,
                stop: settings.experiment.stop,
                step: settings.experiment.communication_step,
            },
            fixed_internal_step: self.fixed_internal_step(),
            patches_of_roms: settings.surfaces.iter().all(|surface| surface.patches.is_none()),
            table: self.simulation.table(),
            fmi3_arrays: arrays,
            structures: structures.zip(&self.packed.roms).collect(),
            features: scene_features::features(self.scene),
            limits: scene_features::limits(self.scene),
            warnings: warning::texts(self.simulation.warnings()),
        }
    }
}

/// Returns the files of an .fmu in their order: the model description, the libraries, and the resources; a reference result is given with its
/// largest number of communication steps.
pub fn contents(
    version: FmiVersion,
    description: &Description,
    libraries: &[Library],
    resources: Vec<(String, Vec<u8>)>,
    reference: Option<(&str, usize)>,
    model: Related,
) -> Vec<ArchiveEntry> {
    let identifier = description.identifier;
    let name = format!("documentation/{identifier}_ref.csv");
    let reference_csv = reference.map(|(_, steps)| {
        format!("All outputs of the default experiment, for at most its first {steps} communication steps")
    });
    let result = reference_csv.as_deref().map(|reference_csv| (name.as_str(), "text/csv", "result", reference_csv));
    let page = (
        "documentation/index.html",
        "text/html",
        "document",
        "The model, its variables, its limits and its reduced-order models",
    );
    let related: Vec<Related> = result.into_iter().chain([page, model]).collect();
    let (xml, number, icon) = match version {
        FmiVersion::Two => (fmi2_xml(description), "2.0", "model.png"),
        FmiVersion::Three => (fmi3_xml(description), "3.0", "terminalsAndIcons/icon.png"),
    };
    let mut entries = vec![ArchiveEntry::new("modelDescription.xml", xml), ArchiveEntry::new(icon, ICON)];
    let library =
        |library: &Library| ArchiveEntry::new(library.platform.place(number, identifier), library.bytes.as_slice());
    entries.extend(libraries.iter().map(library));
    if let Some(terminals) = fmi3_terminals(description).filter(|_| version == FmiVersion::Three) {
        entries.push(ArchiveEntry::new("terminalsAndIcons/terminalsAndIcons.xml", terminals));
    }
    entries.extend(resources.into_iter().map(|(name, bytes)| ArchiveEntry::new(format!("resources/{name}"), bytes)));
    entries.push(ArchiveEntry::new("documentation/index.html", html(description)));
    entries.extend(reference.map(|(csv, _)| ArchiveEntry::new(name.as_str(), csv)));
    entries.extend([
        ArchiveEntry::new("extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml", references_manifest(&related)),
        ArchiveEntry::new("documentation/licenses/license.txt", LICENSE),
        ArchiveEntry::new("documentation/licenses/LICENSE-MIT.txt", LICENSE_MIT),
        ArchiveEntry::new("documentation/licenses/LICENSE-APACHE.txt", LICENSE_APACHE),
        ArchiveEntry::new("documentation/licenses/third-party.txt", THIRD_PARTY),
    ]);
    entries
}

/// Returns the optional generation date: empty (equal inputs, equal bytes) unless SOURCE_DATE_EPOCH defines one.
pub(crate) fn generation_date(source_date_epoch: Option<&str>) -> Result<String> {
    let Some(text) = source_date_epoch else { return Ok(String::new()) };
    // Only years with four digits: xs:dateTime permits more, importers do not.
    match text.trim().parse::<i64>() {
        Ok(seconds) if (0..253_402_300_800).contains(&seconds) => Ok(date_time(seconds)),
        _ => Err(Failure::usage(
            "SOURCE_DATE_EPOCH",
            format!("{text:?} is not a number of seconds since 1970-01-01"),
            "Unset it, or set it to the output of `git log -1 --format=%ct`",
        )),
    }
}

/// Formats seconds since 1970 (UTC) as xs:dateTime, after H. Hinnant's `civil_from_days`.
fn date_time(seconds: i64) -> String {
    let (days, rest) = (seconds.div_euclid(86_400), seconds.rem_euclid(86_400));
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 { march_month + 3 } else { march_month - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z", rest / 3600, rest / 60 % 60, rest % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_match_the_calendar() {
        // `date -u -d @SECONDS +%FT%TZ`
        assert_eq!(date_time(0), "1970-01-01T00:00:00Z");
        assert_eq!(date_time(951_827_696), "2000-02-29T12:34:56Z");
        assert_eq!(date_time(1_767_225_599), "2025-12-31T23:59:59Z");
        assert_eq!(date_time(4_107_542_400), "2100-03-01T00:00:00Z");
        assert_eq!(date_time(253_402_300_799), "9999-12-31T23:59:59Z");
    }

    #[test]
    fn date_is_omitted_unless_given() {
        assert_eq!(generation_date(None).unwrap(), "");
        assert_eq!(generation_date(Some("0\n")).unwrap(), "1970-01-01T00:00:00Z");
        for wrong in ["yesterday", "-1", "", "999999999999999"] {
            assert_eq!(generation_date(Some(wrong)).unwrap_err().what, "SOURCE_DATE_EPOCH");
        }
    }
}
