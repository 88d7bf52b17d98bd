//! Data for the report.

use tiprub_core::{Scene, VariableTable};
use tiprub_field::animation::Capture;
use tiprub_shell::{native::NativeRun, recording::RecordingDifference, schedule::Schedule};
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
