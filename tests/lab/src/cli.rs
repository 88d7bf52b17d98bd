//! Commands of the laboratory.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use tiprub_gallery::builtin::DiskModel;
use tiprub_shell::{
    Result,
    console::{CommandOutcome, Console},
    output_file,
};
use tiprub_study as study;
use tiprub_study::arguments::{Speeds, StudyCommon, positive, speeds};

use crate::{
    bases, bench, beside, conjugacy, convergence, coupling, cube, error, estimates, inputs, modes, penetration, random,
    refinement, scaling, scatter, stability, stage, wear, witness,
};

/// Evidence for tiprub: studies of the built-in models and of standard problems.
#[derive(Debug, Parser)]
#[command(
    name = "lab",
    version,
    after_help = "Examples:\n  lab stage --quick\n  lab error --scene carpenter\n  lab stability --case friction/\n\n\
                  In the sources: cargo run --release -p tiprub-lab -- stage --quick"
)]
pub struct LabCli {
    /// Print one JSON object with the result on stdout (errors too); progress stays on stderr.
    #[arg(long, global = true)]
    pub json: bool,
    /// No progress on stderr; results, warnings and errors are still printed.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// The study.
    #[command(subcommand)]
    pub command: LabCommand,
}

/// Studies by name.
#[derive(Debug, Subcommand)]
pub enum LabCommand {
    /// Error against run time of every method on built-in scenes and standard problems, compared with independent
    /// methods.
    Error(LabErrorArguments),
    /// Stiff and extreme cases: each must end with a correct result or with an error that gives the reason.
    #[command(
        after_help = "Every case runs in a separate process with a time limit. DIR receives index.html, stability.csv, \
                      stability.md and results.json."
    )]
    Stability(LabStabilityArguments),
    /// Small extreme random scenes: checks of energy, losses, penetration, saved states, and bitwise agreement with the
    /// FMU.
    #[command(after_help = "The seed determines the scene. Run a single scene with `lab random --only SEED`.")]
    Random(RandomArguments),
    /// Frequency deviation and residual criterion of the reduced disk against the number of component modes.
    Convergence(StudyCommon),
    /// Natural frequencies against nodal diameter with engine orders, and mode shapes.
    Modes(ModesArguments),
    /// Blades against an oval casing, rigid and flexible, over a range of speeds.
    Stage(LabStageArguments),
    /// The cube between two rings: tiprub compared with independent methods on the full model.
    Cube(LabCubeArguments),
    /// Balance of forces and moments in contacts, of torque and shaft work, and of energy, for all features.
    Conjugacy(StudyCommon),
    /// Effect of the communication step on whirl and other moving inputs: ramped, with derivatives, and held.
    Inputs(StudyCommon),
    /// Co-simulation of a rub and a shaft in bearings: one exchange per step, fixed-point iteration, or Newton's
    /// method.
    Coupling(StudyCommon),
    /// Estimated errors of steps, modes, patches and mesh, compared with refined runs.
    Estimates(EstimatesArguments),
    /// Convergence of rubs of rotor 37 and the stage with patches, mesh, modes and steps; errors of the built-in
    /// models.
    Refinement(RefinementArguments),
    /// Fixed-interface or free-interface modes, contact nodes or patches: error, largest steps and cost against the
    /// number of modes.
    Bases(StudyCommon),
    /// Any scene with uncoupled blades in a rigid casing, compared with an independent solver that shares only the
    /// matrices.
    Beside(BesideArguments),
    /// Errors of adaptive steps in random rubs, energy over very many contact changes, random contact problems.
    Scatter(StudyCommon),
    /// Reduced blades compared with a full finite-element model that has independent time integration and contact.
    Witness(StudyCommon),
    /// Recovered stress of reduced blades in a rub, compared with the full finite-element model, for several numbers of
    /// modes.
    Stress(StudyCommon),
    /// Penetration of contact nodes between the points of adaptive steps, from sampled displacements.
    Penetration(StudyCommon),
    /// Processor time and error of rubs by tolerance and communication step, beside methods with fixed steps.
    Bench(BenchArguments),
    /// Growth of the stepping time with the numbers of sectors, modes, patches and touching blades: fitted exponents.
    Scaling(StudyCommon),
    /// One blade in a coated casing whose radius decreases: wear lobes compared with blade vibrations per revolution.
    Wear(StudyCommon),
}

/// Arguments of `lab estimates`.
#[derive(Debug, Args)]
pub struct EstimatesArguments {
    /// Compute only the mesh error (minutes instead of an hour).
    #[arg(long)]
    pub mesh_only: bool,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Arguments of `lab cube`.
#[derive(Debug, Args)]
pub struct LabCubeArguments {
    /// Run only the cube with contact patches: takes a minute.
    #[arg(long)]
    pub patches_only: bool,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Arguments of `lab bench`.
#[derive(Debug, Args)]
pub struct BenchArguments {
    /// Also time the FMU library of another release, in the same run as the library of these sources: a library, or an
    /// FMU that contains one; may be repeated. Both run the scenes of this study.
    #[arg(long, value_name = "FILE")]
    pub library: Vec<PathBuf>,
    /// Python interpreter with NumPy, which runs the paper's method for comparison.
    #[arg(long, value_name = "FILE", default_value = "python3")]
    pub python: PathBuf,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Arguments of `lab beside`.
#[derive(Debug, Args)]
pub struct BesideArguments {
    /// Scene file (TOML), or a built-in scene.
    #[arg(value_name = "SCENE", default_value = "builtin:rotor37-paper")]
    pub scene: String,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Arguments of `lab refinement`.
#[derive(Debug, Args)]
pub struct RefinementArguments {
    /// Run only this scene, such as rotor37-light or stage-smooth; may be given several times.
    #[arg(long = "scene", value_name = "SCENE")]
    pub scenes: Vec<String>,
    /// Refine only in this direction; may be given several times.
    #[arg(long = "direction", value_name = "DIRECTION", value_parser = ["step", "modes", "modes-2", "nodes", "rows", "mesh"])]
    pub directions: Vec<String>,
    /// Number of parallel runs [default: one per processor].
    #[arg(long, value_name = "N")]
    pub threads: Option<std::num::NonZero<usize>>,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Arguments of `lab error`.
#[derive(Debug, Args)]
pub struct LabErrorArguments {
    /// Run only this scene; may be given several times.
    #[arg(long = "scene", value_name = "SCENE", value_enum)]
    pub scenes: Vec<ErrorScene>,
    /// Also write tables and figures into this directory of the guide (docs in the sources). With `--scene`, only the
    /// rows of these scenes are updated.
    #[arg(long, value_name = "DIR")]
    pub guide: Option<PathBuf>,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Scenes of the study of errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ErrorScene {
    /// Carpenter's two bars.
    Carpenter,
    /// The bouncing bar.
    BouncingBar,
    /// A block that sticks and slides on a belt.
    Belt,
    /// The cube between two rings.
    Cube,
    /// Rotor 37 with the default model, light rub.
    #[value(name = "rotor37-light")]
    Rotor37Light,
    /// Rotor 37 with the default model, heavy rub: interference equal to the gap.
    #[value(name = "rotor37-heavy")]
    Rotor37Heavy,
    /// Rotor 37 in an elastic casing.
    FlexibleCasing,
    /// The stage: coupled blades in an elastic casing.
    Stage,
    /// The paper's model of rotor 37, light rub.
    #[value(name = "rotor37-paper-light")]
    Rotor37PaperLight,
    /// The paper's model of rotor 37, heavy rub: interference equal to the gap.
    #[value(name = "rotor37-paper-heavy")]
    Rotor37PaperHeavy,
    /// The stage on a coarse mesh, compared with an independent solver.
    StageCoarse,
}

impl ErrorScene {
    /// All scenes.
    pub const ALL: [Self; 11] = [
        Self::Rotor37Light,
        Self::Rotor37Heavy,
        Self::Rotor37PaperLight,
        Self::Rotor37PaperHeavy,
        Self::FlexibleCasing,
        Self::Stage,
        Self::StageCoarse,
        Self::Cube,
        Self::Carpenter,
        Self::BouncingBar,
        Self::Belt,
    ];
}

/// Arguments of `lab modes`.
#[derive(Debug, Args)]
pub struct ModesArguments {
    /// Speed for the engine orders (rad/s) [default: the critical speed of an oval casing, for the first mode of nodal
    /// diameter 2].
    #[arg(long, value_name = "SPEED", value_parser = positive, allow_negative_numbers = true)]
    pub speed: Option<f64>,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Arguments of `lab stage`.
#[derive(Debug, Args)]
pub struct LabStageArguments {
    /// Angular velocities (rad/s): first, last and number [default: 0.5 to 1.5 times the critical speed of an oval
    /// casing, for the first mode of nodal diameter 2].
    #[arg(long, value_name = "FROM:TO:COUNT", value_parser = speeds)]
    pub speeds: Option<Speeds>,
    /// Number of parallel runs [default: one per processor].
    #[arg(long, value_name = "N")]
    pub threads: Option<std::num::NonZero<usize>>,
    /// Options of all studies.
    #[command(flatten)]
    pub common: StudyCommon,
}

/// Arguments of `lab stability`.
#[derive(Debug, Args)]
pub struct LabStabilityArguments {
    /// Directory for the table; created if missing.
    #[arg(long, value_name = "DIR", default_value = "stability")]
    pub out: PathBuf,
    /// Fewer and shorter cases: takes a minute.
    #[arg(long)]
    pub quick: bool,
    /// Run only cases whose name begins with NAME.
    #[arg(long, value_name = "NAME")]
    pub case: Option<String>,
    /// Number of parallel cases [default: one per processor].
    #[arg(long, value_name = "N")]
    pub threads: Option<std::num::NonZero<usize>>,
    /// FMU library for the cases that import FMUs [default: the library that is found or built].
    #[arg(long, value_name = "FILE")]
    pub library: Option<PathBuf>,
    /// Run one case in this process and print its result.
    #[arg(long, value_name = "NAME", hide = true)]
    pub child: Option<String>,
}

/// Arguments of `lab random`.
#[derive(Debug, Args)]
pub struct RandomArguments {
    /// Number of scenes.
    #[arg(long, value_name = "N", default_value_t = 300)]
    pub scenes: usize,
    /// Seed of the run, which determines the seeds of its scenes.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Run only the scene with this seed, and print its full result.
    #[arg(long, value_name = "SEED", conflicts_with_all = ["scenes", "seed"])]
    pub only: Option<u64>,
    /// Compare every N-th scene with the FMU library (FMI 2.0 and 3.0); 0 compares none.
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub fmu: usize,
    /// Directory for failed scenes (scene and ROM files) and for the table (JSON).
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Number of parallel scenes [default: one per processor].
    #[arg(long, value_name = "N")]
    pub threads: Option<std::num::NonZero<usize>>,
    /// FMU library [default: the library that is found or built].
    #[arg(long, value_name = "FILE")]
    pub library: Option<PathBuf>,
}

impl LabCli {
    /// Runs the selected study.
    ///
    /// # Errors
    /// A study that fails, or files that cannot be written.
    pub fn run(&self, console: &Console) -> Result<CommandOutcome> {
        let (name, common) = match &self.command {
            LabCommand::Stability(arguments) => return stability::command::run(arguments, console),
            LabCommand::Random(arguments) => return random::command::run(arguments, console),
            LabCommand::Error(arguments) => ("error", &arguments.common),
            LabCommand::Convergence(common) => ("convergence", common),
            LabCommand::Modes(arguments) => ("modes", &arguments.common),
            LabCommand::Stage(arguments) => ("stage", &arguments.common),
            LabCommand::Cube(arguments) => ("cube", &arguments.common),
            LabCommand::Conjugacy(common) => ("conjugacy", common),
            LabCommand::Inputs(common) => ("inputs", common),
            LabCommand::Coupling(common) => ("coupling", common),
            LabCommand::Estimates(arguments) => ("estimates", &arguments.common),
            LabCommand::Refinement(arguments) => ("refinement", &arguments.common),
            LabCommand::Bases(common) => ("bases", common),
            LabCommand::Beside(arguments) => ("beside", &arguments.common),
            LabCommand::Scatter(common) => ("scatter", common),
            LabCommand::Witness(common) => ("witness", common),
            LabCommand::Stress(common) => ("stress", common),
            LabCommand::Penetration(common) => ("penetration", common),
            LabCommand::Bench(arguments) => ("bench", &arguments.common),
            LabCommand::Scaling(common) => ("scaling", common),
            LabCommand::Wear(common) => ("wear", common),
        };
        let directory = common.directory(name);
        output_file::try_directory(&directory)?;
        study::output::write(&self.study(console)?, &directory)
    }

    fn study(&self, console: &Console) -> Result<study::Study> {
        match &self.command {
            LabCommand::Error(arguments) => error::study(arguments, console),
            LabCommand::Convergence(common) => {
                let start = std::time::Instant::now();
                let (reduction, _) = DiskModel::with_nodes(common.quick).reduce(console)?;
                convergence::study(&reduction, start.elapsed().as_secs_f64(), common.quick)
            }
            LabCommand::Modes(arguments) => {
                let (reduction, mesh) = DiskModel::with_nodes(arguments.common.quick).reduce(console)?;
                modes::study(&reduction, &mesh, arguments.speed, arguments.common.quick)
            }
            LabCommand::Stage(arguments) => stage::study(arguments, console),
            LabCommand::Cube(arguments) => cube::study(arguments, console),
            LabCommand::Conjugacy(common) => conjugacy::study(common.quick),
            LabCommand::Inputs(common) => inputs::study(common, console),
            LabCommand::Coupling(common) => coupling::study(common, console),
            LabCommand::Estimates(arguments) => estimates::study(arguments, console),
            LabCommand::Refinement(arguments) => refinement::study(arguments, console),
            LabCommand::Bases(common) => bases::study(common, console),
            LabCommand::Beside(arguments) => beside::study(arguments, console),
            LabCommand::Scatter(common) => scatter::study(common, console),
            LabCommand::Witness(common) => witness::study(common, console),
            LabCommand::Stress(common) => witness::stress(common, console),
            LabCommand::Penetration(common) => penetration::study(common, console),
            LabCommand::Bench(arguments) => bench::study(arguments, console),
            LabCommand::Scaling(common) => scaling::study(common, console),
            LabCommand::Wear(common) => wear::study(common, console),
            LabCommand::Stability(_) | LabCommand::Random(_) => unreachable!("`run` has answered it"),
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        LabCli::command().debug_assert();
    }

    #[test]
    fn rejects_options_of_another_study() {
        for (line, right) in [
            ("modes --speed 900", true),
            ("stage --speeds 400:900:3 --threads 1", true),
            ("modes --speeds 400:900:3", false),
            ("stage --speed 900", false),
            ("error --scene carpenter --scene rotor37-light", true),
            ("modes --scene carpenter", false),
            ("convergence --threads 2", false),
            ("stage scene.toml", false),
            ("beside scene.toml --quick", true),
            ("bench --library old.so --library old.fmu --python python3", true),
            ("scaling --library old.so", false),
        ] {
            assert_eq!(LabCli::try_parse_from(["lab"].into_iter().chain(line.split(' '))).is_ok(), right, "{line}");
        }
    }
}
