//! Tests that every file that a command reads is protected from every file that it writes. The arguments come from clap's definition: a new one
//! fails here until it is listed, and a listed one until it is protected.

use std::{any::TypeId, collections::BTreeSet, fs, path::PathBuf};

use clap::{CommandFactory, Parser};
use tiprub_gallery::scene_source::ROTOR37_SCENE;

use super::{STUDY_FILES, check};
use crate::{cli::Cli, commands::demo};

/// Returns command, argument for an input file, and a command line in which `{}` is that file.
fn read() -> Vec<(&'static str, &'static str, String)> {
    let sets = "--contact-set TIP --clamp-set ROOT";
    let sector = format!("{sets} --sectors 36 --cyclic-low LOW --cyclic-high HIGH");
    let grid = "--contact-set INNER --clamp-set FLANGE --contact-grid 24x3";
    let mut all: Vec<(&str, &str, String)> = vec![
        ("demo", "library", "demo --library {}".into()),
        ("package", "scene", "package {} --fmi 2".into()),
        ("package", "library", "package SCENE --fmi 2 --library {}".into()),
        ("thermal", "file", "thermal {} --name written --fmi 2".into()),
        ("thermal", "library", "thermal --name written --fmi 2 --library {}".into()),
        ("run", "scene", "run {}".into()),
        ("run", "inputs", "run builtin:rotor37 --inputs {}".into()),
        ("sweep", "plan", "sweep {}".into()),
        ("inspect", "file", "inspect {}".into()),
        ("study map", "scene", "study map {}".into()),
        ("study stability", "scene", "study stability {}".into()),
        ("reduce casing-mesh", "file", format!("reduce casing-mesh {{}} {grid}")),
    ];
    for (command, line) in
        [("reduce blade", format!("reduce blade {sets}")), ("reduce sector", format!("reduce sector {sector}"))]
    {
        all.push((command, "file", format!("{line} {{}}")));
        all.extend(matrices().map(|(argument, words)| (command, argument, format!("{line} {words}"))));
    }
    for command in ["study error", "study convergence"] {
        let line = format!("{command} builtin:rotor37 {sets}");
        all.push((command, "scene", format!("{command} {{}}")));
        all.push((command, "file", format!("{line} --mesh {{}}")));
        all.push((command, "others", format!("{line} --mesh a.inp --other-mesh b.inp --other-mesh {{}}")));
        all.extend(matrices().map(|(argument, words)| (command, argument, format!("{line} {words}"))));
    }
    all
}

fn matrices() -> [(&'static str, &'static str); 4] {
    [
        ("stiffness", "--stiffness {} --mass job.mas"),
        ("mass", "--stiffness job.sti --mass {}"),
        ("nodes", "--stiffness job.sti --mass job.mas --nodes {}"),
        ("dofs", "--stiffness job.sti --mass job.mas --dofs {}"),
    ]
}

/// Returns command, argument for an output file, words in which `{}` is the file or its directory, and the name of the file in that directory;
/// `None` if the argument names the file itself.
fn written() -> Vec<(String, &'static str, &'static str, Option<String>)> {
    let fmu = Some("written_fmi2.fmu".to_owned());
    let mut all = vec![
        ("run".into(), "csv", "--csv {}", None),
        ("run".into(), "parquet", "--parquet {}", None),
        ("run".into(), "report", "--report {}", None),
        ("run".into(), "vtk", "--vtk {} --force", Some("x.vtu".into())),
        ("sweep".into(), "output", "--output {}", None),
        ("study convergence".into(), "into", "--into {}", None),
    ];
    for command in ["package", "thermal"] {
        all.extend([None, fmu.clone()].map(|name| (command.into(), "output", "--output {}", name)));
    }
    all.extend(demo::FILES.map(|name| ("demo".into(), "out", "--out {}", Some(name.to_owned()))));
    for command in ["study map", "study stability", "study error", "study convergence"] {
        all.extend(STUDY_FILES.map(|kind| (command.into(), "out", "--out {}", Some(format!("x.{kind}")))));
    }
    for model in Cli::command().find_subcommand("reduce").expect("reduce").get_subcommands() {
        let files = [("output", "--output {}"), ("inp", "--inp {}"), ("vtk", "--vtk {}")];
        all.extend(files.map(|(argument, words)| (format!("reduce {}", model.get_name()), argument, words, None)));
    }
    all
}

/// Collects every argument of every command that names a file or a directory.
fn defined(command: &clap::Command, path: &str, found: &mut BTreeSet<(String, String)>) {
    for below in command.get_subcommands().filter(|below| below.get_name() != "help") {
        let path = format!("{path} {}", below.get_name()).trim().to_owned();
        for argument in below.get_arguments() {
            let names = argument.get_value_names().unwrap_or_default();
            let named = names.iter().any(|name| ["FILE", "DIR", "FILE|DIR", "SCENE"].contains(&name.as_str()));
            if named || argument.get_value_parser().type_id() == TypeId::of::<PathBuf>() {
                found.insert((path.clone(), argument.get_id().to_string()));
            }
        }
        defined(below, &path, found);
    }
}

#[test]
fn every_file_argument_is_classified_as_input_or_output() {
    let mut cli = Cli::command();
    cli.build();
    let (mut found, mut known) = (BTreeSet::new(), BTreeSet::new());
    defined(&cli, "", &mut found);
    known.extend(read().into_iter().map(|(command, argument, _)| (command.to_owned(), argument.to_owned())));
    known.extend(written().into_iter().map(|(command, argument, ..)| (command, argument.to_owned())));
    assert_eq!(found, known);
}

/// Returns the result of `check` for a command line.
fn answer(line: &str) -> Result<(), tiprub_shell::Failure> {
    let words = std::iter::once("tiprub").chain(line.split_whitespace());
    check(&Cli::try_parse_from(words).unwrap_or_else(|error| panic!("{line}: {error}")).command)
}

/// Returns a scene whose FMUs have the names in [`written`].
fn named_written() -> String {
    let name = tiprub_format::parse_scene(ROTOR37_SCENE, "built-in").unwrap().name;
    ROTOR37_SCENE.replacen(&format!("{name:?}"), "\"written\"", 1)
}

/// The output file exists, and the input is a link to it.
#[test]
#[cfg(unix)]
fn no_command_overwrites_its_inputs() {
    let mut pairs = 0;
    for (command, _, words, name) in written() {
        for (.., line) in read().into_iter().filter(|(reading, ..)| *reading == command) {
            let root = tempfile::tempdir().unwrap();
            let [directory, link, scene] = ["out", "link.toml", "scene.toml"].map(|name| root.path().join(name));
            let file = directory.join(name.as_deref().unwrap_or("x.fmu"));
            fs::create_dir(&directory).unwrap();
            for path in [&file, &scene] {
                fs::write(path, named_written()).unwrap();
            }
            std::os::unix::fs::symlink(&file, &link).unwrap();
            let target = if name.is_some() { &directory } else { &file };
            let line = line.replace("{}", &link.display().to_string()).replace("SCENE", &scene.display().to_string());
            let line = format!("{line} {}", words.replace("{}", &target.display().to_string()));
            let failure = answer(&line).expect_err(&line);
            let is_named = ["is the same file as", "this command may overwrite"];
            assert!(failure.usage && is_named.iter().any(|words| failure.problem.contains(words)), "{line}: {failure}");
            pairs += 1;
        }
    }
    assert!(pairs > 60, "{pairs}");
}

#[test]
fn implicit_dof_list_is_protected_as_an_input() {
    let failure = answer("reduce blade --stiffness job.sti --mass job.mas --contact-set A --clamp-set B --inp job.dof");
    assert!(failure.unwrap_err().problem.contains("is the same file as --dofs"));
}

#[test]
fn included_mesh_files_are_protected_as_inputs() {
    let root = tempfile::tempdir().unwrap();
    let [mesh, part, nodes] = ["mesh.inp", "part.inp", "nodes.csv"].map(|name| root.path().join(name));
    fs::write(&mesh, "** INPUT=none.inp\n*Include, input = part.inp\n").unwrap();
    fs::write(&part, "*NODE,\nINPUT=\"nodes.csv\"\n").unwrap();
    fs::write(&nodes, "1,0,0,0\n").unwrap();
    for (name, protected) in [(&part, true), (&nodes, true), (&root.path().join("none.inp"), false)] {
        let line = format!("reduce blade {} --contact-set A --clamp-set B --vtk {}", mesh.display(), name.display());
        assert_eq!(
            answer(&line).is_err_and(|failure| failure.problem.contains("a file that the mesh includes")),
            protected,
            "{line}"
        );
    }
}
