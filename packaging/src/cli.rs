//! Command line: commands and options with defaults, units and examples.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use tiprub_study::arguments::{
    CacheArguments, MapArguments, SceneOptions, StabilityArguments, positive, positive_count,
};
use tiprub_sweep::part::Part;

use crate::{
    library::PlatformChoice,
    mesh_arguments::{ConvergenceCommand, ErrorCommand},
    reduce_arguments::ReduceArguments,
    run_arguments::RunArguments,
    thermal_arguments::ThermalArguments,
};

/// Blade-tip/casing contact (rub) as an FMU.
#[derive(Debug, Parser)]
#[command(
    name = "tiprub",
    version,
    about = "Blade-tip/casing contact (rub) as an FMU: reduce, package, run, sweep, inspect, study, demo",
    long_about = "Simulates the contact of a bladed disk (a reduced-order model) with a rigid or flexible casing, \
                  and packages it as an FMU for any FMI 2.0 or FMI 3.0 importer.\n\n\
                  All quantities are in SI units (m, kg, s, N, rad).",
    after_help = "Examples:\n  tiprub demo\n  tiprub run builtin:rotor37 --csv rub.csv\n  \
                  tiprub package scene.toml -o out/\n\n\
                  Built-in scenes:\n  \
                  builtin:rotor37           rotor 37 in a rigid casing with two bumps (recommended)\n  \
                  builtin:rotor37-one-row   rotor37 with one row of patches, which averages over the tip thickness\n  \
                  builtin:rotor37-paper     rotor37 with the model and the method of the paper\n  \
                  builtin:flexible-casing   rotor 37 in an elastic casing with heat and friction power per patch\n  \
                  builtin:abradable         rotor 37 wearing the coating of a rigid casing\n  \
                  builtin:stage             56 coupled blades in an oval elastic casing\n  \
                  builtin:stage-nodes       stage with contact at three nodes per blade and more friction\n  \
                  builtin:cube-between-rings  a free cube between two clamped rings\n\n\
                  Exit codes: 0 success, 1 failure, 2 invalid command line, 141 stdout was closed early by its reader."
)]
pub struct Cli {
    /// Print the result, or the error, as one JSON object on stdout; progress stays on stderr.
    #[arg(long, global = true, display_order = 900)]
    pub json: bool,
    /// Print no progress on stderr; results, warnings and errors are still printed.
    #[arg(long, short, global = true, display_order = 901)]
    pub quiet: bool,
    /// The command.
    #[command(subcommand)]
    pub command: Command,
}

/// All commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run all steps on a real blade: reduce rotor 37, package both FMUs, import and run them, and write a report.
    #[command(after_help = "Examples:\n  tiprub demo\n  tiprub demo --out /tmp/rub --revolutions 4\n\n\
                            DIR then contains report.html (opens offline), the two .fmu files, the ROM, the scene and \
                            the results as CSV.")]
    Demo(DemoArguments),
    /// Reduce your own or a built-in finite-element model to a reduced-order model (ROM), and check it.
    #[command(after_help = "Examples:\n  tiprub reduce rotor37\n  tiprub reduce casing --material titanium\n  \
                            tiprub reduce blade blade.inp --clamp-set ROOT --sectors 36 --units mm-t-s\n  \
                            tiprub reduce blade --help\n\n\
                            docs/models.md explains how to use your own models; docs/rom-file.md explains how to write \
                            a ROM from Python.")]
    Reduce(ReduceArguments),
    /// Package a scene as .fmu files. The scene and its ROMs are data for a common FMU library, which is built once if it is missing.
    #[command(after_help = "Examples:\n  tiprub package scene.toml                 both FMUs in this directory\n  \
                            tiprub package scene.toml --fmi 3 -o rub.fmu\n  \
                            tiprub package scene.toml --arrays        FMI 3 variables as arrays\n  \
                            tiprub package scene.toml --platform x86_64-windows\n\n\
                            The same inputs give identical files. The optional generation date is omitted unless \
                            SOURCE_DATE_EPOCH (seconds since 1970) is set.")]
    Package(PackageArguments),
    /// Package the heat conduction of a casing as .fmu files, to be coupled to a scene whose casing heats up.
    #[command(
        after_help = "Examples:\n  tiprub thermal -o out/\n  tiprub thermal --patches 24x1 --gas-film 800 --fmi 3\n  \
                            tiprub thermal --material titanium --modes 60 --name fan_case\n\n\
                            Connect casing_friction_power of the scene's FMU to casing_heat of this FMU, and \
                            casing_temperature of this FMU to that of the scene's FMU."
    )]
    Thermal(Box<ThermalArguments>),
    /// Run a scene natively, without FMI; the results have one row per communication point.
    #[command(after_help = "Examples:\n  tiprub run scene.toml --csv rub.csv\n  \
                            tiprub run builtin:rotor37 --report rub.html\n  \
                            tiprub run builtin:rotor37 --stop 0.002 --set speed=1700 --csv - | head\n\n\
                            Column names are the FMI 2.0 variable names; numbers are written with all significant \
                            digits.")]
    Run(RunArguments),
    /// Run a plan: many runs of a scene with other start values, scene fields or ROMs, one row of results per run.
    #[command(after_help = "Examples:\n  tiprub sweep plan.toml\n  tiprub sweep plan.toml --check\n  \
                            tiprub sweep plan.toml --part 17/1000 -o results/part-0017.parquet\n\n\
                            The guide page docs/sweeps.md explains plans and results. If a sweep is interrupted or \
                            killed, run the same command again: finished runs are not repeated.")]
    Sweep(SweepArguments),
    /// Inspect and validate an FMU, ROM or scene file.
    #[command(
        after_help = "Examples:\n  tiprub inspect rotor37_fmi2.fmu\n  tiprub inspect rotor37.rom.safetensors\n  \
                            tiprub inspect scene.toml --json\n  tiprub inspect builtin:flexible-casing"
    )]
    Inspect(InspectArguments),
    /// Study a scene: figures, numbers and checks of expected results.
    #[command(after_help = "Examples:\n  tiprub study error scene.toml\n  tiprub study stability scene.toml\n  \
                            tiprub study map scene.toml --speeds 1200:1500:61\n  tiprub study error --help\n\n\
                            DIR then contains index.html (opens offline), an SVG and a CSV per figure, and \
                            results.json.")]
    Study(StudyArguments),
}

/// Libraries that go into an FMU.
#[derive(Debug, Clone, Default, Args)]
pub struct LibraryArguments {
    /// Library for one platform, or a directory of libraries, instead of those found next to tiprub (or built
    /// from its sources); may be repeated. The platform is detected from the content of each file.
    #[arg(long, value_name = "FILE|DIR")]
    pub library: Vec<PathBuf>,
    /// Include only this platform; may be repeated [default: all platforms with a library].
    #[arg(long, value_enum, value_name = "PLATFORM")]
    pub platform: Vec<PlatformChoice>,
}

/// Arguments of `tiprub demo`.
#[derive(Debug, Args)]
pub struct DemoArguments {
    /// Directory for everything the demo writes; created if missing.
    #[arg(long, value_name = "DIR", default_value = "demo")]
    pub out: PathBuf,
    /// Libraries that go into the FMU.
    #[command(flatten)]
    pub libraries: LibraryArguments,
    /// Revolutions of the rotor to simulate [default: up to the stop time of the scene].
    #[arg(long, value_name = "N", value_parser = positive, allow_negative_numbers = true)]
    pub revolutions: Option<f64>,
}

/// Arguments of `tiprub package`.
#[derive(Debug, Args)]
pub struct PackageArguments {
    /// Scene file (TOML), or a built-in scene such as `builtin:rotor37`.
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// FMI version of the FMU.
    #[arg(long, value_enum, default_value_t = FmiChoice::Both)]
    pub fmi: FmiChoice,
    /// The .fmu file, or a directory for it (always a directory with `--fmi both`).
    #[arg(long, short, value_name = "FILE|DIR", default_value = ".")]
    pub output: PathBuf,
    /// FMI 3: write arrays. Without --arrays or --scalars, an FMU has arrays if it would otherwise have more than 300
    /// scalars.
    #[arg(long, conflicts_with = "scalars")]
    pub arrays: bool,
    /// FMI 3: write scalars instead of arrays, however many there are, with the names of FMI 2.
    #[arg(long)]
    pub scalars: bool,
    /// Libraries that go into the FMU.
    #[command(flatten)]
    pub libraries: LibraryArguments,
    /// Changes to the scene.
    #[command(flatten)]
    pub options: SceneOptions,
    /// Where built-in models are kept.
    #[command(flatten)]
    pub cache: CacheArguments,
}

/// Arguments of `tiprub sweep`.
#[derive(Debug, Args)]
pub struct SweepArguments {
    /// Plan of the sweep (TOML).
    #[arg(value_name = "PLAN")]
    pub plan: PathBuf,
    /// Run only this part of the plan, so that several machines can share it. Every run is in exactly one part.
    #[arg(long, value_name = "NUMBER/COUNT")]
    pub part: Option<Part>,
    /// Parquet file for the results [default: the name of the plan, with the part if there are several, in the current
    /// directory].
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Number of runs at the same time; each run uses one thread [default: one per processor].
    #[arg(long, value_name = "N", value_parser = positive_count)]
    pub threads: Option<std::num::NonZero<usize>>,
    /// Check the plan up to its first run, and print the number of runs; run nothing.
    #[arg(long)]
    pub check: bool,
    /// Run nothing unless the program, the plan, and all files that it names have this digest. `--check` prints the digest, so that
    /// the machines that share a sweep can compare it.
    #[arg(long, value_name = "SHA256", conflicts_with = "check")]
    pub digest: Option<String>,
    /// Where built-in models are kept.
    #[command(flatten)]
    pub cache: CacheArguments,
}

impl SweepArguments {
    /// Returns the part to run.
    pub fn part(&self) -> Part {
        self.part.unwrap_or(Part::WHOLE)
    }

    /// Returns the file for the results.
    pub fn output(&self) -> PathBuf {
        let stem = self.plan.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let named = || PathBuf::from(format!("{stem}{}.parquet", self.part().file_suffix()));
        self.output.clone().unwrap_or_else(named)
    }
}

/// Arguments of `tiprub inspect`.
#[derive(Debug, Args)]
pub struct InspectArguments {
    /// An .fmu, a ROM (.safetensors), a scene (.toml) or a built-in scene (`builtin:abradable`).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Also print the cost of each effect that the scene omits, and the features that are off.
    #[arg(long)]
    pub all: bool,
    /// Also measure the computing time of each effect that the scene omits, over its first 100 communication steps; implies
    /// --all.
    #[arg(long)]
    pub measure: bool,
    /// Changes to the scene.
    #[command(flatten)]
    pub options: SceneOptions,
    /// Where built-in models are kept.
    #[command(flatten)]
    pub cache: CacheArguments,
}

/// Arguments of `tiprub study`.
#[derive(Debug, Args)]
pub struct StudyArguments {
    /// The study.
    #[command(subcommand)]
    pub study: StudyCommand,
}

/// Studies of a scene.
#[derive(Debug, Subcommand)]
pub enum StudyCommand {
    /// Map the amplitudes of rubbing blades over angular velocity and frequency, with engine orders and natural
    /// frequencies.
    #[command(after_help = "Examples:\n  tiprub study map\n  tiprub study map scene.toml --speeds 1200:1500:61\n  \
                            tiprub study map --set friction_coefficient=0 --set gap_offset=6e-5")]
    Map(MapArguments),
    /// Compare error and run time of every scheme and solver on a scene, for the time steps alone and in total, with
    /// other numbers of patches and modes, and find the cheapest setting for a given error.
    #[command(
        after_help = "Examples:\n  tiprub study error scene.toml\n  tiprub study error builtin:flexible-casing --quick\n  \
                            tiprub study error scene.toml --window 2e-3 --set speed=1700\n\n\
                            The reference for time-step errors is a run with fine steps, checked with another scheme. \
                            The reference for total errors is a finer model, which requires the mesh of the ROM: use a \
                            built-in model, or give --mesh with the options of `tiprub reduce blade`."
    )]
    Error(Box<ErrorCommand>),
    /// Map which combinations of friction, speed and internal step are accepted, give a warning or are rejected, and
    /// why; also show the growth rates of sliding contact and the largest accepted step of every scheme and solver.
    #[command(
        after_help = "Examples:\n  tiprub study stability scene.toml\n  tiprub study stability builtin:rotor37 --quick\n  \
                            tiprub study stability scene.toml --friction 0:0.6:13 --speeds -1700:1700:2 --steps 1e-7:2e-5:12\n\n\
                            The checks are those at the start of `tiprub run`. They are slow for coupled sectors, so \
                            the default map is smaller there."
    )]
    Stability(StabilityArguments),
    /// Refine internal step, modes, contact nodes and mesh, and show the changes in displacements, impulse, friction
    /// work, peak force and strain energy, the estimated limit, and the error of the scene.
    #[command(
        after_help = "Examples:\n  tiprub study convergence scene.toml\n  tiprub study convergence builtin:rotor37 --quick\n  \
                            tiprub study convergence scene.toml --mesh blade.inp --contact-set TIP --clamp-set ROOT --sectors 36 --units mm-t-s\n\n\
                            Modes can be removed from any ROM. More modes and other contact nodes require its mesh: \
                            use a built-in model, or give --mesh with the options of `tiprub reduce blade`. Give other \
                            meshes with --other-mesh."
    )]
    Convergence(Box<ConvergenceCommand>),
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
    /// Both versions, as two files.
    Both,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::{reduce_arguments::ModelToReduce, shared_arguments::MeshSize};

    fn parse(line: &str) -> Result<Cli, clap::Error> {
        Cli::try_parse_from(std::iter::once("tiprub").chain(line.split_whitespace()))
    }

    #[test]
    fn the_definition_is_consistent() {
        Cli::command().debug_assert();
    }

    /// Checks the help of a command and all of its subcommands.
    fn explained(command: &clap::Command, name: &str) {
        for command in command.get_subcommands().filter(|command| command.get_name() != "help") {
            let name = format!("{name} {}", command.get_name());
            assert!(command.get_about().is_some(), "{name}");
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains(&name), "{name}: {help}");
            for line in help.lines().filter_map(|line| line.trim().strip_prefix("tiprub ")) {
                // Remarks follow after several spaces.
                let line = line.split("   ").next().unwrap_or(line).split(" | ").next().unwrap_or(line);
                let parsed = parse(line);
                let fine = parsed.as_ref().err().is_none_or(|error| error.exit_code() == 0);
                assert!(fine, "{line}: {}", parsed.unwrap_err());
            }
            explained(command, &name);
        }
    }

    #[test]
    fn every_command_has_examples_that_parse() {
        let mut cli = Cli::command();
        cli.build();
        explained(&cli, "tiprub");
    }

    /// A command rejects options that it does not list.
    #[test]
    fn rejects_options_of_another_model() {
        let own = "blade.inp --contact-set TIP --clamp-set ROOT";
        for (line, right) in [
            (format!("reduce blade {own} --sectors 36 --spin 900 --contact-nodes 3"), true),
            (format!("reduce blade {own} --cyclic-low A --cyclic-high B"), false),
            (format!("reduce blade {own} --contact-grid 24x3"), false),
            (format!("reduce blade {own} --coarse"), false),
            (format!("reduce blade {own} --mesh 3x3x3"), false),
            (format!("reduce blade {own} --expansion 1e-5"), false),
            (format!("reduce blade {own} --spin 900 --stiffness K --mass M"), false),
            (format!("reduce blade {own} --material steel --stiffness K --mass M"), false),
            (format!("reduce blade {own} --nodes n.csv --stiffness K --mass M"), false),
            (format!("reduce sector {own} --sectors 9 --cyclic-low A --cyclic-high B"), true),
            (format!("reduce sector {own} --sectors 9 --cyclic-low A --cyclic-high B --spin 900"), false),
            (format!("reduce sector {own} --cyclic-low A --cyclic-high B"), false),
            (
                format!(
                    "reduce sector {own} --sectors 9 --cyclic-low A --cyclic-high B --contact-patches 5 --kind free-interface"
                ),
                true,
            ),
            (format!("reduce casing-mesh {own} --contact-grid 24x3 --patches 4x1 --expansion 1e-5"), true),
            (format!("reduce casing-mesh {own}"), false),
            (format!("reduce casing-mesh {own} --contact-grid 24x3 --sectors 9"), false),
            (format!("reduce casing-mesh {own} --contact-grid 24x3 --stiffness K --mass M"), false),
            ("reduce casing --thickness 0.003".into(), true),
            ("reduce casing --contact-nodes 3".into(), false),
            ("reduce casing --spin 900".into(), false),
            ("reduce rotor37 --thickness 0.003".into(), false),
            ("reduce rotor37 --contact-set TIP".into(), false),
            ("reduce rotor37 --coarse".into(), false),
            ("reduce stage --coarse --modes 9".into(), true),
            ("reduce stage --mesh 3x3x3".into(), false),
            ("reduce cube --contact-patches 3x2 --kind free-interface --modes 40".into(), true),
            ("reduce cube --kind free-interface".into(), false),
            ("reduce stage --coarse --contact-patches 5 --kind craig-bampton".into(), true),
            ("reduce stage --contact-patches 5 --contact-nodes 3".into(), false),
            ("reduce stage --contact-patches 5 --contact-rows 2".into(), true),
            ("reduce stage --contact-rows 2".into(), true),
            ("reduce stage --contact-rows 2 --contact-nodes 3".into(), false),
            ("reduce rotor37 --contact-rows 2".into(), true),
            (format!("reduce blade {own} --contact-rows 2"), true),
            (format!("reduce blade {own} --contact-nodes 3 --contact-rows 2"), false),
            ("reduce stage-casing --coarse --contact-grid 14x3".into(), true),
            ("reduce stage-casing --thickness 0.003".into(), false),
            ("reduce cube --static-responses 3".into(), false),
            ("reduce ring-left --static-responses 3 --mass-matrix consistent".into(), true),
            ("reduce ring-right --coarse".into(), false),
        ] {
            assert_eq!(parse(&line).is_ok(), right, "{line}");
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
    fn parses_run_and_reduce_options() {
        let Command::Run(run) = parse("run a.toml --set speed=-2 --set name=a=b --stop 1e-3 --json").unwrap().command
        else {
            panic!("run")
        };
        assert_eq!(run.set, [("speed".into(), "-2".into()), ("name".into(), "a=b".into())]);
        assert_eq!(run.stop, Some(1e-3));
        let Command::Reduce(reduce) = parse("reduce rotor37 --mesh 10x2x14").unwrap().command else { panic!("reduce") };
        let ModelToReduce::Rotor37(rotor) = reduce.model else { panic!("rotor37") };
        assert_eq!(rotor.mesh, Some(MeshSize([10, 2, 14])));
    }

    #[test]
    fn invalid_options_exit_with_two_and_explain_usage() {
        for (line, hint) in [
            ("run a.toml --set speed", "NAME=VALUE"),
            ("reduce rotor37 --mesh 10x2", "CHORDxTHICKNESSxSPAN"),
            ("reduce rotor37 --mesh 0x2x3", "CHORDxTHICKNESSxSPAN"),
            ("demo --revolutions -1", "positive"),
            ("package a.toml --fmi 4", "possible values: 2, 3, both"),
            ("reduce", "rotor37"),
            ("reduce blade", "<FILE>"),
            ("reduce blade blade.inp --units inch", "possible values: mm-t-s, m"),
            ("reduce blade blade.inp --poisson 0.5", "below 0.5"),
            ("study stability a.toml --friction -0.1:1:3", "(0 or more)"),
            ("study stability a.toml --steps 0:1:3", "positive steps"),
            ("study stability a.toml --speeds 5:1:3", "FROM:TO:COUNT"),
            ("reduce casing --contour 0.1", "z:r"),
            ("reduce casing --contour=0.1:0.2,0.1:0.2", "is not greater"),
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
