//! Reduces the built-in blades and casings, with a progress display.

use tiprub_model::{
    CasingOptions, Reduction, Rotor37Options,
    cube::{CubeOptions, RingOptions, reduce_cube, reduce_cube_ring},
    cyclic::CyclicReduction,
    progress::{Listener, ReductionProgress, ReductionStage},
    reduce_ring, reduce_rotor37,
    stage::{
        StageOptions,
        casing::{StageCasingOptions, reduce_stage_casing},
        reduce_stage,
    },
};
use tiprub_shell::{Failure, Result, console::Console};

use crate::known;

const STAGES: [ReductionStage; 7] = [
    ReductionStage::Mesh,
    ReductionStage::Assembly,
    ReductionStage::FullModes,
    ReductionStage::FixedInterfaceModes,
    ReductionStage::ConstraintModes,
    ReductionStage::Checks,
    ReductionStage::Spin,
];

/// Reduces rotor 37 and shows the stage of the work and the finished fraction.
///
/// # Errors
/// The mesh does not permit these counts, or the reduction fails.
pub fn rotor37(options: &Rotor37Options, console: &Console) -> Result<Reduction> {
    let reduction = with_progress("Reducing rotor 37", console, &|listener| reduce_rotor37(options, listener))?;
    Ok(Reduction { rom: known::with_known_errors(options, reduction.rom), ..reduction })
}

/// Reduces a casing and shows the stage of the work and the finished fraction.
///
/// # Errors
/// Lengths, counts and contact rings are inconsistent, or the reduction fails.
pub fn casing(options: &CasingOptions, console: &Console) -> Result<Reduction> {
    with_progress("Reducing the casing", console, &|listener| reduce_ring(options, listener))
}

/// Reduces the bladed disk of the stage and shows the stage of the work and the finished fraction.
///
/// # Errors
/// The counts are inconsistent, or the reduction fails.
pub fn stage(options: &StageOptions, console: &Console) -> Result<CyclicReduction> {
    with_progress("Reducing the stage", console, &|listener| reduce_stage(options, listener))
}

/// Reduces the casing of the stage and shows the stage of the work and the finished fraction.
///
/// # Errors
/// The counts are inconsistent, or the reduction fails.
pub fn stage_casing(options: &StageCasingOptions, console: &Console) -> Result<Reduction> {
    with_progress("Reducing the casing of the stage", console, &|listener| reduce_stage_casing(options, listener))
}

/// Reduces the cube between two rings and shows the stage of the work and the finished fraction.
///
/// # Errors
/// There are more modes than degrees of freedom.
pub fn cube(options: &CubeOptions, console: &Console) -> Result<Reduction> {
    with_progress("Reducing the cube", console, &|listener| reduce_cube(options, listener))
}

/// Reduces one of these rings and shows the stage of the work and the finished fraction.
///
/// # Errors
/// There are more modes than degrees of freedom, or more static responses than contact forces.
pub fn cube_ring(options: &RingOptions, console: &Console) -> Result<Reduction> {
    let title = format!("Reducing {}", options.name.replace('_', "-"));
    with_progress(&title, console, &|listener| reduce_cube_ring(options, listener))
}

/// Runs work that reports its progress, and shows it as a task; `title` describes the work.
///
/// # Errors
/// The errors of the work.
pub fn with_progress<T>(
    title: &str,
    console: &Console,
    work: &dyn Fn(Listener<'_>) -> tiprub_model::Result<T>,
) -> Result<T> {
    let task = console.task(title, Some(100 * STAGES.len() as u64));
    let listener = |progress: ReductionProgress| {
        let stage = STAGES.iter().position(|stage| *stage == progress.stage).unwrap_or(0);
        task.now(&format!("{title}: {}", progress.stage));
        task.at(percent(stage as f64 + progress.fraction));
    };
    work(&listener).map_err(|error| failure(title, error))
}

/// Converts an error of the model crate during the work called `title`.
pub fn failure(title: &str, error: tiprub_model::Error) -> Failure {
    match error {
        tiprub_model::Error::Invalid(diagnostic) | tiprub_model::Error::Read(diagnostic) => diagnostic.into(),
        tiprub_model::Error::Core(error) => Failure::from_core(title, error),
        tiprub_model::Error::File { path, source } => Failure::file(&path, "cannot be read", &source),
        other => Failure::from_below(title, other),
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=100 per stage")]
fn percent(stages: f64) -> u64 {
    (100.0 * stages.clamp(0.0, STAGES.len() as f64)) as u64
}
