//! How long work tells its caller where it stands; what is shown, and where, is the caller's business.

use std::fmt;

/// The stages of a reduction, in the order in which they run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ReductionStage {
    /// Building the mesh from the geometry.
    Mesh,
    /// Element matrices and their sum.
    Assembly,
    /// Modes of the full model.
    FullModes,
    /// Fixed-interface modes.
    FixedInterfaceModes,
    /// Constraint modes.
    ConstraintModes,
    /// Frequency deviation and residual criterion.
    Checks,
    /// Effects of spin, only when asked for.
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

/// One report: how much of a stage is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReductionProgress {
    /// The stage that runs.
    pub stage: ReductionStage,
    /// Share of the stage that is done, 0 to 1.
    pub fraction: f64,
}

/// Who listens. Called from the calling thread only.
pub type Listener<'a> = &'a dyn Fn(ReductionProgress);

/// A listener that ignores everything.
pub fn silent(_: ReductionProgress) {}

pub(crate) fn report(listener: Listener<'_>, stage: ReductionStage, done: usize, total: usize) {
    let fraction = if total == 0 { 1.0 } else { done.min(total) as f64 / total as f64 };
    listener(ReductionProgress { stage, fraction });
}
