//! Wrong command lines and files: exit codes, messages, and errors as JSON.

use std::fs;

use crate::project::{Project, SCENE, json};

#[test]
fn invalid_command_lines_exit_with_two_and_a_remedy() {
    let project = Project::new();
    let unknown = project.fail(&["run", "scene.toml", "--set", "sped=1"], 2);
    assert!(unknown.contains("no such variable") && unknown.contains("`speed`"), "{unknown}");
    let fixed = project.fail(&["run", "builtin:rotor37-one-row", "--set", "tolerance=1e-2"], 2);
    assert!(fixed.contains("only scenes with adaptive steps") && fixed.contains("galerkin"), "{fixed}");
    let wrong = project.fail(&["run", "scene.toml", "--set", "speed=fast"], 2);
    assert!(wrong.contains("not a number"), "{wrong}");
    let infinite = project.fail(&["run", "scene.toml", "--set", "speed=inf"], 2);
    assert!(infinite.contains("--set speed=inf"), "{infinite}");
    let stop = project.fail(&["run", "scene.toml", "--stop", "-1"], 2);
    assert!(stop.contains("--stop"), "{stop}");
    let two = project.fail(&["package", "scene.toml", "-o", "x.fmu"], 2);
    assert!(two.contains("two FMUs"), "{two}");
    project.fail(&["package", "scene.toml", "--fmi", "4"], 2);
    project.fail(&["frobnicate"], 2);
}

#[test]
fn failures_exit_with_one_and_are_available_as_json() {
    let project = Project::new();
    let output = project.run(&["run", "missing.toml", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["error"]["what"].as_str().unwrap().contains("missing.toml"), "{json}");
    fs::write(project.path("bad.toml"), SCENE.replace("friction = 0.1", "frictoin = 0.1")).unwrap();
    let bad = project.fail(&["run", "bad.toml"], 1);
    assert!(bad.contains("bad.toml:") && bad.contains("frictoin") && bad.contains("`friction`"), "{bad}");
    let rom = fs::read(project.path("small.rom.safetensors")).unwrap();
    fs::write(project.path("small.rom.safetensors"), &rom[..rom.len() / 2]).unwrap();
    let truncated = project.fail(&["run", "scene.toml"], 1);
    assert!(truncated.contains("small.rom.safetensors"), "{truncated}");
}

/// Only a relative path depends on the location of the scene file. The Python module passes absolute paths for scenes without a file.
#[test]
fn remedy_for_a_missing_rom_explains_relative_paths() {
    let project = Project::new();
    for (rom, is_relative) in [("none.safetensors".into(), true), (project.path("none.safetensors"), false)] {
        let scene = SCENE.replace("\"small.rom.safetensors\"", &format!("{:?}", rom.display().to_string()));
        fs::write(project.path("missing.toml"), scene).unwrap();
        let error = project.fail(&["run", "missing.toml"], 1);
        assert!(error.contains("Correct structure[1].rom in missing.toml"), "{error}");
        assert_eq!(error.contains("relative to the scene file"), is_relative, "{error}");
    }
}

/// Errors of every command, from the parser, the check of names, or the work.
#[test]
fn every_error_is_available_as_one_json_object() {
    let project = Project::new();
    fs::write(project.path("plan.toml"), "scene = \"scene.toml\"\n").unwrap();
    for (line, code, what, words) in [
        ("run --json", 2, "<SCENE>", "required"),
        ("frobnicate --json", 2, "frobnicate", "unrecognized subcommand"),
        ("--json run scene.toml --stop", 2, "--stop", "value is required"),
        ("--json run scene.toml --setp a=1", 2, "--setp", "--set"),
        ("package scene.toml --fmi 4 --json", 2, "--fmi", "both"),
        ("--json", 2, "tiprub", "a command is missing. Choose one of demo"),
        ("--json reduce", 2, "command line", "a command is missing"),
        ("study --json", 2, "tiprub study", "a command is missing. Choose one of map"),
        ("study tip --json", 2, "study tip", "`stability`"),
        ("study stage --json", 2, "study stage", "`map`"),
        ("stability --json", 2, "stability", "unrecognized subcommand"),
        ("reduce bar.inp --contact-set A --clamp-set B --json", 2, "reduce bar.inp", "tiprub reduce blade bar.inp"),
        ("reduce rotor38 --json", 2, "reduce rotor38", "rotor37"),
        ("reduce rotor37 --thickness 0.003 --json", 2, "--thickness", "unexpected argument"),
        ("reduce blade none.inp --contact-set A --clamp-set B --json", 1, "none.inp", "cannot be read"),
        ("inspect none.fmu --json", 1, "none.fmu", "cannot be read"),
        ("package scene.toml --library none.so --json", 1, "none.so", "cannot be read"),
        ("study stability none.toml --json", 1, "none.toml", "cannot be read"),
        ("run scene.toml --report - --json", 2, "--report -", "cannot be printed on stdout"),
        ("sweep none.toml --output - --json", 2, "--output -", "cannot be printed on stdout"),
        ("run scene.toml --parquet - --json", 2, "--parquet -", "cannot be printed on stdout"),
        ("study error scene.toml --set gap_offset=0 --set gap_offset=1e-5 --json", 2, "--set gap_offset", "set twice"),
        ("study map scene.toml --set gap_offset=0 --set gap_offset=1e-5 --json", 2, "--set gap_offset", "set twice"),
        ("study error scene.toml --set scheme=1 --json", 2, "--set scheme", "varies this setting itself"),
        ("sweep plan.toml --threads 0 --json", 2, "--threads", "give a whole number of 1 or more"),
        ("run scene.toml --vtk x --vtk-every 0 --json", 2, "--vtk-every", "give a whole number of 1 or more"),
        ("study map scene.toml --revolutions 0 --json", 2, "--revolutions", "give a whole number of 1 or more"),
        ("study stability scene.toml --threads 0 --json", 2, "--threads", "give a whole number of 1 or more"),
        ("run none.toml --json", 1, "none.toml", "Give the path of a scene file (TOML), or one of builtin:rotor37,"),
        ("run rotor37 --json", 1, "rotor37", "Did you mean `builtin:rotor37`?"),
        ("run bultin:rotor37 --json", 1, "bultin:rotor37", "Did you mean `builtin:rotor37`?"),
        ("run builtin:casing37 --json", 2, "builtin:casing37", "Use it as `rom` in a scene file"),
        ("package abradabel.toml --json", 1, "abradabel.toml", "Did you mean `builtin:abradable`?"),
        ("run plan.toml --json", 1, "plan.toml:1:1: scene", "use `tiprub sweep`"),
        ("sweep none.toml --json", 1, "none.toml", "Give the path of a plan (TOML)"),
        ("sweep scene.toml --json", 2, "scene.toml", "use `tiprub run`"),
        ("demo --out scene.toml --json", 1, "scene.toml", "directory"),
    ] {
        let output = project.run(&line.split(' ').collect::<Vec<_>>());
        let error = &json(&output)["error"];
        assert_eq!((output.status.code(), error["exit_code"].as_i64()), (Some(code), Some(i64::from(code))), "{line}");
        let [name, problem, remedy] = ["what", "problem", "remedy"].map(|key| error[key].as_str().unwrap());
        assert!(name.contains(what), "{line}: {error}");
        assert!(format!("{problem}. {remedy}").contains(words), "{line}: {error}");
        assert!(!problem.is_empty() && !problem.contains('\n') && !problem.contains("Usage:"), "{line}: {error}");
        assert!(!output.stderr.is_empty(), "{line}");
        assert!(!remedy.contains("..") && !remedy.contains("For more information"), "{line}: {error}");
    }
    // Help is no failure, and a file may be named --json.
    assert!(String::from_utf8(project.run(&["--json", "--help"]).stdout).unwrap().contains("Usage"));
    assert!(project.run(&["run", "--nothing", "--", "--json"]).stdout.is_empty());
}

#[test]
fn every_command_has_help() {
    let project = Project::new();
    for command in ["demo", "reduce", "package", "run", "inspect", "study"] {
        let help = project.succeed(&[command, "--help"]);
        assert!(help.contains("Examples:") && help.contains("--json"), "{help}");
    }
}

/// For any input, an error has one or two lines and no number with three hundred digits.
#[test]
fn numbers_in_errors_are_short() {
    let project = Project::new();
    for (from, to, number) in [
        ("friction = 0.1", "friction = 1e300", "1e300"),
        ("gap = 1e-3", "gap = -1e300", "-1e300"),
        ("stop = 0.05", "stop = -1e300", "-1e300"),
        ("step = 1e-4", "step = 1e-300", "1e-300"),
        ("ramp_time = 0.02", "ramp_time = 1e300", "1e300"),
    ] {
        fs::write(project.path("wrong.toml"), SCENE.replacen(from, to, 1)).unwrap();
        let reported = project.fail(&["run", "wrong.toml"], 1);
        assert!(reported.contains(number) && reported.len() < 300, "{reported}");
    }
    for (arguments, number) in [
        (["--set", "damping_ratio=1e300"], "1e300"),
        (["--set", "damping_ratio=-1e300"], "-1e300"),
        (["--set", "friction_coefficient=1e300"], "1e300"),
        (["--stop", "-1e300"], "-1e300"),
        (["--step", "-1e300"], "-1e300"),
    ] {
        let reported = project.fail(&[&["run", "scene.toml"], &arguments[..]].concat(), 2);
        assert!(reported.contains(number) && reported.len() < 300, "{reported}");
    }
}

#[test]
fn a_changed_scene_stops_the_demo_before_any_work() {
    let project = Project::new();
    fs::create_dir(project.path("demo")).unwrap();
    for (changed, kept) in [("rotor37.toml", SCENE), ("rotor37.toml", "")] {
        fs::write(project.path("demo").join(changed), kept).unwrap();
        let error = project.fail(&["demo", "--library", "none.so"], 1);
        assert!(error.contains("rotor37.toml") && error.contains("--out"), "{error}");
        assert_eq!(fs::read_to_string(project.path("demo").join(changed)).unwrap(), kept);
    }
    assert_eq!(fs::read_dir(project.path("demo")).unwrap().count(), 1);
}
