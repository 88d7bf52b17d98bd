//! Progress reports of long computations; the caller decides what to show.

use std::fmt;

/// Stages of a reduction, in the order of execution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ReductionStage {
    /// Building the mesh from the geometry.
    Mesh,
    /// Assembly of the element matrices.
    Assembly,
    /// Modes of the full model.
    FullModes,
    /// Fixed-interface modes.
    FixedInterfaceModes,
    /// Constraint modes.
    ConstraintModes,
    /// Frequency deviation and residual criterion.
    Checks,
    /// Effects of spin, only if requested.
    Spin,
}

impl fmt::Display for ReductionStage {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Mesh => "mesh",
            Self::Assembly => "assembly",
            Self::FullModes => "modes of the full model",
            Self::FixedInterfaceModes => "fixed-interface modes",
            Self::ConstraintModes => "constraint modes",
            Self::Checks => "checks",
            Self::Spin => "effects of spin",
        })
    }
}

/// Report of how much of a stage is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReductionProgress {
    /// Current stage.
    pub stage: ReductionStage,
    /// Fraction of the stage that is done, 0 to 1.
    pub fraction: f64,
}

/// Receiver of progress reports. Called from the calling thread only.
pub type Listener<'a> = &'a dyn Fn(ReductionProgress);

/// Ignores all progress reports.
pub fn silent(_: ReductionProgress) {}

pub(crate) fn report(listener: Listener<'_>, stage: ReductionStage, done: usize, total: usize) {
    let fraction = if total == 0 { 1.0 } else { done.min(total) as f64 / total as f64 };
    listener(ReductionProgress { stage, fraction });
}
