//! What the report is made from.

use tiprub_core::{Scene, VariableTable};
use tiprub_model::Reduction;
use tiprub_shell::{native::NativeRun, recording::RecordingDifference, schedule::Schedule};
use tiprub_study::estimate::Estimate;

use crate::rom_facts::RomFacts;

/// Results of an imported run for the report.
#[derive(Debug, Clone)]
pub struct ImportedSummary {
    /// For example `FMI 2.0`.
    pub label: String,
    /// Time spent in doStep (s).
    pub stepping: f64,
    /// Comparison with the native run.
    pub agreement: RecordingDifference,
}

/// A file beside the report.
#[derive(Debug, Clone)]
pub struct ReportFile {
    /// File name, relative to the report.
    pub name: String,
    /// Meaning of the value.
    pub meaning: String,
    /// Size in bytes.
    pub bytes: u64,
}

/// Everything the report shows.
pub struct ReportInput<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Variables of the run.
    pub table: &'a VariableTable,
    /// Full model and modes, where they are at hand.
    pub reduction: Option<&'a Reduction>,
    /// Facts of the ROMs.
    pub facts: &'a [RomFacts],
    /// Communication points.
    pub schedule: &'a Schedule,
    /// The native run.
    pub native: &'a NativeRun,
    /// The runs through the C ABIs.
    pub imported: &'a [ImportedSummary],
    /// Estimated errors of steps, modes, patches and mesh; empty if not requested.
    pub estimates: &'a [Estimate],
    /// The same run with the paper's model and method, and its variables.
    pub paper: Option<(&'a VariableTable, &'a NativeRun)>,
    /// Files beside the report.
    pub files: &'a [ReportFile],
    /// Wall times of the parts of the work (what, s).
    pub durations: &'a [(String, f64)],
}
