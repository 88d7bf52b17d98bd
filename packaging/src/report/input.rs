//! Data for the report.

use tiprub_core::scene::settings::{BodyMotion, StructureSettings};
use tiprub_core::{Scene, VariableTable};
use tiprub_field::animation::{Capture, HitBlade};
use tiprub_figure::escape;
use tiprub_shell::{history::InputHistory, native::NativeRun, recording::RecordingDifference, schedule::Schedule};
use tiprub_study::estimate::Estimate;

use crate::{answer::AnswerLine, rom_facts::RomFacts};

/// Results of an imported run for the report.
#[derive(Debug, Clone)]
pub struct ImportedSummary {
    /// Label, for example `FMI 2.0`.
    pub label: String,
    /// Time spent in doStep (s).
    pub stepping: f64,
    /// Comparison with the native run.
    pub agreement: RecordingDifference,
}

/// File beside the report.
#[derive(Debug, Clone)]
pub struct ReportFile {
    /// File name, relative to the report.
    pub name: String,
    /// Contents of the file, in words.
    pub meaning: String,
    /// Size in bytes.
    pub bytes: u64,
}

/// All data that the report shows.
pub struct ReportInput<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Variables of the run.
    pub table: &'a VariableTable,
    /// Replaced start values (name, value as text).
    pub settings: &'a [(String, String)],
    /// Inputs over time from a file.
    pub history: Option<&'a InputHistory>,
    /// Communication points.
    pub schedule: &'a Schedule,
    /// The native run.
    pub native: &'a NativeRun,
    /// Motion and contacts of the run.
    pub capture: &'a Capture,
    /// Main results of the run.
    pub answer: &'a [AnswerLine],
    /// Facts about the ROMs; may be empty.
    pub facts: &'a [RomFacts],
    /// Runs through the C interfaces of FMI.
    pub imported: &'a [ImportedSummary],
    /// Estimated errors of steps, modes, patches and mesh; empty if not requested.
    pub estimates: &'a [Estimate],
    /// Files beside the report.
    pub files: &'a [ReportFile],
    /// Wall times of the parts of the work (name, s).
    pub durations: &'a [(String, f64)],
}

impl ReportInput<'_> {
    /// Returns the rotors of the scene.
    pub(super) fn rotors(&self) -> impl Iterator<Item = &StructureSettings> {
        self.scene.settings.structures.iter().filter(|own| own.motion == BodyMotion::Rotating)
    }

    /// Returns the name of a blade as HTML, with its rotor if there are several: "blade 4 of front". A structure with one sector keeps its own name.
    pub(super) fn blade_name(&self, blade: &HitBlade) -> String {
        let name = escape(&blade.name);
        match (blade.sectors, self.rotors().count()) {
            (..=1, _) => name,
            (_, ..=1) => format!("blade {}", blade.sector + 1),
            _ => format!("blade {} of {name}", blade.sector + 1),
        }
    }
}
