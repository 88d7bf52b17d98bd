//! The command line itself: what can be asked for, with defaults, units and examples.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use tiprub_model::cube::{MassMatrix, Side};
use tiprub_shell::Failure;
use tiprub_study::arguments::{CacheArguments, ErrorArguments, MapArguments, StabilityArguments, assignment, positive};

use crate::{casing_arguments::CasingArguments, file_arguments::FileArguments};

/// A command line that is not understood, for programs: where `--json` is among the `arguments`, and it asks for no help.
pub fn usage_failure(error: &clap::Error, mut arguments: impl Iterator<Item = std::ffi::OsString>) -> Option<Failure> {
    let asked = arguments.by_ref().take_while(|argument| argument != "--").any(|argument| argument == "--json");
    // Of help the exit code is 0.
    if !asked || error.exit_code() == 0 {
        return None;
    }
    let text = error.render().to_string();
    let problem = text.split("\n\nUsage:").next().unwrap_or(&text).trim().trim_start_matches("error: ").to_owned();
    Some(Failure::usage("command line", problem, "See `tiprub --help`, or `--help` of the command"))
}

/// Blade-tip/casing contact (rub) as an FMU.
#[derive(Debug, Parser)]
#[command(
    name = "tiprub",
    version,
    about = "Blade-tip/casing contact (rub) as an FMU: reduce, package, run, inspect, study, demo",
    long_about = "Marches the contact of a bladed disk (a reduced-order model) with its casing in time, rigid or \
                  flexible, and ships that as an FMU for any FMI 2.0 or FMI 3.0 importer.\n\nSI units everywhere (m, kg, s, N, rad).",
    after_help = "Examples:\n  tiprub demo\n  tiprub run builtin:rotor37 --csv rub.csv\n  \
                  tiprub package scene.toml -o out/\n\n\
                  Scenes that ship:\n  builtin:rotor37           rotor 37 in a rigid casing with two bumps\n  \
                  builtin:flexible-casing   in an elastic casing with heat, friction power per patch\n  \
                  builtin:abradable         wearing the coating of a rigid casing\n  \
                  builtin:stage             56 coupled blades in an oval elastic casing\n  \
                  builtin:cube-between-rings  a cube that flies through two clamped rings\n\n\
                  Exit codes: 0 done, 1 the work failed, 2 the command line is wrong."
)]
pub struct Cli {
    /// Print one JSON object with the result on stdout (errors too); progress stays on stderr.
    #[arg(long, global = true)]
    pub json: bool,
    /// No progress on stderr; results, warnings and errors are still printed.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// The whole road on a real blade: reduce rotor 37, package both FMUs, import and run them, write a report.
    #[command(after_help = "Examples:\n  tiprub demo\n  tiprub demo --out /tmp/rub --revolutions 4\n\n\
                            DIR then holds report.html (opens offline), the two .fmu files, the ROM, the scene and \
                            the results as CSV.")]
    Demo(DemoArguments),
    /// From a blade, a casing or a finite-element model of your own to a reduced-order model (ROM), with its checks.
    #[command(after_help = "Examples:\n  tiprub reduce rotor37\n  \
                            tiprub reduce rotor37 --modes 30 --contact-nodes 5 --mesh 10x2x16 -o fine.rom.safetensors\n  \
                            tiprub reduce casing\n  \
                            tiprub reduce casing --material titanium --thickness 0.003 --high-flange none\n  \
                            tiprub reduce casing --contour=-0.02:0.256,0.04:0.245 --contact-axial 0.0026:0.038\n\n\
                            tiprub reduce blade.inp --contact-set TIP --clamp-set ROOT --sectors 36 --units mm-t-s\n  \
                            tiprub reduce blade.msh --contact-set TIP --clamp-set ROOT --material titanium --contact-nodes 5\n  \
                            tiprub reduce job.inp --stiffness job.sti --mass job.mas --contact-set TIP --clamp-set ROOT\n  \
                            tiprub reduce sector.inp --contact-set TIP --clamp-set BORE --sectors 56 --cyclic-low LOW --cyclic-high HIGH\n  \
                            tiprub reduce stage --coarse --inp sector.inp --vtk sector.vtu\n\n\
                            docs/models.md describes models of your own; docs/rom-file.md writes a ROM from Python.")]
    Reduce(Box<ReduceArguments>),
    /// From a scene to .fmu files. Compiles nothing: the library is generic, scene and ROM are data.
    #[command(
        after_help = "Examples:\n  tiprub package scene.toml                 both FMUs beside each other here\n  \
                            tiprub package scene.toml --fmi 3 -o rub.fmu\n  \
                            tiprub package scene.toml --scalars       no arrays in the FMI 3 variables\n\n\
                            Same inputs, same bytes. The optional generation date is left out, unless \
                            SOURCE_DATE_EPOCH (seconds since 1970) is set."
    )]
    Package(PackageArguments),
    /// Run a scene natively, without FMI; one row per communication point.
    #[command(after_help = "Examples:\n  tiprub run scene.toml --csv rub.csv\n  \
                            tiprub run builtin:rotor37 --stop 0.002 --set speed=1700 --csv - | head\n\n\
                            Column names are the FMI 2.0 variable names; numbers read back to the same bits.")]
    Run(RunArguments),
    /// What is in an .fmu, a ROM or a scene file, and whether it is sound.
    #[command(
        after_help = "Examples:\n  tiprub inspect rotor37_fmi2.fmu\n  tiprub inspect rotor37.rom.safetensors\n  \
                            tiprub inspect scene.toml --json\n  tiprub inspect builtin:flexible-casing"
    )]
    Inspect(InspectArguments),
    /// Studies of a scene: pictures, numbers, and whether they show what they should.
    #[command(after_help = "Examples:\n  tiprub study error scene.toml\n  tiprub study stability scene.toml\n  \
                            tiprub study map scene.toml --speeds 1200:1500:61\n  tiprub study error --help\n\n\
                            DIR then holds index.html (opens offline), an SVG and a CSV per figure, and results.json.")]
    Study(StudyArguments),
    /// What moved to the laboratory of the sources.
    #[command(hide = true, trailing_var_arg = true)]
    Stability {
        /// Anything.
        #[arg(allow_hyphen_values = true)]
        rest: Vec<String>,
    },
}

/// Arguments of `tiprub demo`.
#[derive(Debug, Args)]
pub struct DemoArguments {
    /// Directory for everything the demo writes; made if missing.
    #[arg(long, value_name = "DIR", default_value = "demo")]
    pub out: PathBuf,
    /// FMU library to package, instead of the one found or built.
    #[arg(long, value_name = "FILE")]
    pub library: Option<PathBuf>,
    /// Revolutions of the rotor to simulate (the scene's own stop time when absent).
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    pub revolutions: Option<f64>,
}

/// Arguments of `tiprub reduce`.
#[derive(Debug, Args)]
pub struct ReduceArguments {
    /// What to reduce: `rotor37`, the NASA rotor 37 blade that ships with tiprub; `casing`, a ring around it; `stage`, a
    /// disk with 56 blades; `stage-casing`, the casing around that; `cube`, `ring-left`, `ring-right`, the bodies of the cube between two rings; or a
    /// mesh file of your own: CalculiX/Abaqus (.inp) or Gmsh 4.1 (.msh).
    #[arg(value_name = "MODEL", value_parser = model, required_unless_present = "stiffness")]
    pub model: Option<Model>,
    /// Number of modes kept: fixed-interface modes of a blade [default: 20 of rotor37, 25 of a file and of the stage, there per nodal diameter] and of the
    /// cube [default: all], modes of the casing below the cut-off [default: 60], of the cube's rings [default: 100].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Number of contact nodes: along the tip chord of `rotor37`, leading edge to trailing edge (≥ 2); of a file, chosen
    /// evenly along the chord out of the contact set.
    #[arg(long, value_name = "N")]
    pub contact_nodes: Option<usize>,
    /// Elements: of the blade along the chord, through the thickness and along the span [default: 16x2x20]; of the
    /// casing around, through the thickness and along the axis [default: 72x1x12].
    #[arg(long, value_name = "NxNxN")]
    pub mesh: Option<MeshSize>,
    /// Of the blade, also compute the effects of spin (stiffening, growth, Coriolis force) up to this speed (rad/s).
    #[arg(long, value_name = "SPEED", value_parser = positive, allow_negative_numbers = true)]
    pub spin: Option<f64>,
    /// ROM file to write [default: NAME.rom.safetensors with the name of the model; casing37 is called casing where
    /// options change it].
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace files that are there already.
    #[arg(long)]
    pub force: bool,
    /// Also write the mesh as a CalculiX/Abaqus input file that computes its frequencies.
    #[arg(long, value_name = "FILE")]
    pub inp: Option<PathBuf>,
    /// Also write mesh, sets and mode shapes for ParaView (.vtu).
    #[arg(long, value_name = "FILE")]
    pub vtk: Option<PathBuf>,
    /// Of the rings of `cube`: static responses to contact forces kept beside the modes [default: 0].
    #[arg(long, value_name = "N")]
    pub static_responses: Option<usize>,
    /// Of `cube` and its rings: mass matrix of the finite elements [default: lumped].
    #[arg(long, value_enum)]
    pub mass_matrix: Option<MassChoice>,
    /// Of `stage` and `stage-casing`, a coarse mesh (and few modes of the disk), for trials.
    #[arg(long)]
    pub coarse: bool,
    /// What describes a casing.
    #[command(flatten)]
    pub casing: CasingArguments,
    /// What describes a model of one's own.
    #[command(flatten)]
    pub file: FileArguments,
}

/// Arguments of `tiprub package`.
#[derive(Debug, Args)]
pub struct PackageArguments {
    /// Scene file (TOML), or one that ships, such as `builtin:rotor37`.
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// FMI version of the FMU.
    #[arg(long, value_enum, default_value_t = FmiChoice::Both)]
    pub fmi: FmiChoice,
    /// The .fmu file, or a directory for it (always a directory with `--fmi both`).
    #[arg(long, short, value_name = "FILE|DIR", default_value = ".")]
    pub output: PathBuf,
    /// Write FMI 3 variables as scalars, for importers that read no arrays.
    #[arg(long)]
    pub scalars: bool,
    /// FMU library to package, instead of the one found beside tiprub.
    #[arg(long, value_name = "FILE")]
    pub library: Option<PathBuf>,
    /// Where built-in models are kept.
    #[command(flatten)]
    pub cache: CacheArguments,
}

/// Arguments of `tiprub run`.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// Scene file (TOML), or one that ships, such as `builtin:rotor37`.
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// Write all outputs as CSV; `-` is stdout.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Stop time (s), instead of the scene's.
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub stop: Option<f64>,
    /// Communication step H (s), instead of the scene's.
    #[arg(long, value_name = "H", allow_negative_numbers = true)]
    pub step: Option<f64>,
    /// Start value of an input or parameter; may be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment, allow_hyphen_values = true)]
    pub set: Vec<(String, String)>,
    /// Where built-in models are kept.
    #[command(flatten)]
    pub cache: CacheArguments,
}

/// Arguments of `tiprub inspect`.
#[derive(Debug, Args)]
pub struct InspectArguments {
    /// An .fmu, a ROM (.safetensors), a scene (.toml) or one that ships (`builtin:abradable`).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Where built-in models are kept.
    #[command(flatten)]
    pub cache: CacheArguments,
}

/// Arguments of `tiprub study`.
#[derive(Debug, Args)]
pub struct StudyArguments {
    /// What to study.
    #[command(subcommand)]
    pub study: StudyCommand,
}

/// Studies of a scene.
#[derive(Debug, Subcommand)]
pub enum StudyCommand {
    /// Amplitudes of rubbing blades over angular velocity and frequency, with engine orders and natural frequencies.
    #[command(after_help = "Examples:\n  tiprub study map\n  tiprub study map scene.toml --speeds 1200:1500:61\n  \
                            tiprub study map --set friction_coefficient=0 --set gap_offset=6e-5")]
    Map(MapArguments),
    /// Error against run time of every scheme and solver on a scene, and the cheapest for an error of 1e-2, 1e-3 and 1e-4.
    #[command(
        after_help = "Examples:\n  tiprub study error scene.toml\n  tiprub study error builtin:flexible-casing --quick\n  \
                            tiprub study error scene.toml --window 2e-3 --set speed=1700\n\n\
                            The errors are those of the steps, against two fine runs by different schemes that must meet."
    )]
    Error(ErrorArguments),
    /// Over friction, speed and internal step: what is right, warned of or refused and why, growth rates of sliding contact, and the
    /// largest usable step of every scheme and solver.
    #[command(
        after_help = "Examples:\n  tiprub study stability scene.toml\n  tiprub study stability builtin:rotor37 --quick\n  \
                            tiprub study stability scene.toml --friction 0:0.6:13 --speeds -1700:1700:2 --steps 1e-7:2e-5:12\n\n\
                            The answers are those of `tiprub run`, without the run. Of coupled sectors each takes long: by default few are asked."
    )]
    Stability(StabilityArguments),
    /// What was a study of the models that ship.
    #[command(external_subcommand)]
    Other(Vec<String>),
}

/// What can be reduced.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Model {
    /// One blade of NASA rotor 37 (36 blades), hub clamped.
    Rotor37,
    /// A flexible casing ring, by default the one around rotor 37.
    Casing,
    /// The bladed disk of the 56-sector stage.
    Stage,
    /// The casing of the 56-sector stage.
    StageCasing,
    /// The cube that flies between two rings.
    Cube,
    /// One of these rings.
    Ring(Side),
    /// A mesh file.
    File(PathBuf),
}

/// Which FMUs to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FmiChoice {
    /// FMI 2.0.
    #[value(name = "2")]
    Two,
    /// FMI 3.0.
    #[value(name = "3")]
    Three,
    /// Both, as two files.
    Both,
}

/// Mass matrix of finite elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MassChoice {
    /// On the nodes.
    Lumped,
    /// As the elements' shape functions share it out.
    Consistent,
}

impl From<MassChoice> for MassMatrix {
    fn from(choice: MassChoice) -> Self {
        match choice {
            MassChoice::Lumped => Self::Lumped,
            MassChoice::Consistent => Self::Consistent,
        }
    }
}

/// Three element counts: chord, thickness and span of a blade; around, through and along of a casing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshSize(pub [usize; 3]);

impl std::str::FromStr for MeshSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let counts: Result<Vec<usize>, _> = text.split(['x', 'X']).map(str::parse).collect();
        match counts.as_deref() {
            Ok([a, b, c]) if [a, b, c].iter().all(|count| (1..=200).contains(*count)) => Ok(Self([*a, *b, *c])),
            _ => {
                Err("give three element counts from 1 to 200: CHORDxTHICKNESSxSPAN of the blade, for example 10x1x14, \
                      AROUNDxTHROUGHxALONG of the casing, for example 72x1x12"
                    .into())
            }
        }
    }
}

fn model(text: &str) -> Result<Model, String> {
    match text {
        "rotor37" => Ok(Model::Rotor37),
        "casing" => Ok(Model::Casing),
        "stage" => Ok(Model::Stage),
        "stage-casing" => Ok(Model::StageCasing),
        "cube" => Ok(Model::Cube),
        "ring-left" => Ok(Model::Ring(Side::Left)),
        "ring-right" => Ok(Model::Ring(Side::Right)),
        // Names of files have an extension or a directory; anything else is a slip in the name of a model.
        _ if text.contains(['.', '/', '\\']) => Ok(Model::File(text.into())),
        _ => Err(
            "`rotor37`, `casing`, `stage`, `stage-casing`, `cube`, `ring-left` and `ring-right` ship with tiprub; a \
                 model of your own is a file: .inp or .msh"
                .into(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    fn parse(line: &str) -> Result<Cli, clap::Error> {
        Cli::try_parse_from(std::iter::once("tiprub").chain(line.split_whitespace()))
    }

    #[test]
    fn the_definition_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_command_explains_itself_with_an_example() {
        let mut cli = Cli::command();
        cli.build();
        for command in cli.get_subcommands().filter(|command| command.get_name() != "help" && !command.is_hide_set()) {
            assert!(command.get_about().is_some(), "{}", command.get_name());
            let example = format!("tiprub {}", command.get_name());
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains(&example), "{help}");
        }
    }

    #[test]
    fn every_embedded_scene_is_named_in_the_help() {
        let help = Cli::command().render_help().to_string();
        for (name, _) in tiprub_gallery::scene_source::BUILTIN_SCENES {
            assert!(help.contains(&format!("builtin:{name}")), "{name} is not in:\n{help}");
        }
    }

    #[test]
    fn options_are_read() {
        let Command::Run(run) = parse("run a.toml --set speed=-2 --set name=a=b --stop 1e-3 --json").unwrap().command
        else {
            panic!("run")
        };
        assert_eq!(run.set, [("speed".into(), "-2".into()), ("name".into(), "a=b".into())]);
        assert_eq!(run.stop, Some(1e-3));
        let Command::Reduce(reduce) = parse("reduce rotor37 --mesh 10x2x14").unwrap().command else { panic!("reduce") };
        assert_eq!(reduce.mesh, Some(MeshSize([10, 2, 14])));
    }

    #[test]
    fn wrong_options_exit_with_two_and_say_what_is_wanted() {
        for (line, hint) in [
            ("run a.toml --set speed", "NAME=VALUE"),
            ("reduce rotor37 --mesh 10x2", "CHORDxTHICKNESSxSPAN"),
            ("reduce rotor37 --mesh 0x2x3", "CHORDxTHICKNESSxSPAN"),
            ("demo --revolutions -1", "positive"),
            ("package a.toml --fmi 4", "possible values: 2, 3, both"),
            ("reduce rotor38", "rotor37"),
            ("reduce", "MODEL"),
            ("reduce blade.inp --units inch", "possible values: mm-t-s, m"),
            ("reduce blade.inp --poisson 0.5", "below 0.5"),
            ("reduce casing --contour 0.1", "z:r"),
            ("reduce casing --contour=0.1:0.2,0.1:0.2", "does not lie beyond"),
            ("reduce casing --thickness 0", "positive length"),
            ("reduce casing --low-flange 5", "TxH"),
            ("reduce casing --contact-grid 24", "AROUNDxALONG"),
            ("reduce casing --contact-axial 0.1:0.1", "FROM:TO"),
            ("study map --speeds 100:50:4", "FROM:TO:COUNT"),
            ("study map --speeds 100:500", "FROM:TO:COUNT"),
            ("study error", "<SCENE>"),
            ("study error a.toml --window 0", "positive number"),
            ("study error a.toml --speeds 1:2:3", "unexpected argument"),
            ("reduce casing --support left", "possible values: low, high, both, free"),
        ] {
            let error = parse(line).unwrap_err();
            assert_eq!(error.exit_code(), 2, "{line}");
            assert!(error.to_string().contains(hint), "{line}: {error}");
        }
    }
}
