//! Warnings and their output.

use std::fs;

use nalgebra::{DMatrix, DVector};

use crate::project::{Project, SCENE, json};

#[test]
fn warnings_are_on_stderr_even_when_quiet_and_in_json() {
    let project = Project::new();
    // Slightly longer than 2/omega_max = 2 ms of the springs; much longer steps end the run because of energy that was not supplied.
    let coarse = SCENE
        .replace("step = 1e-4", "step = 2.05e-3")
        .replace("communication_step = 1e-3", "communication_step = 4.1e-3");
    fs::write(project.path("scene.toml"), coarse).unwrap();
    for arguments in [
        &["run", "scene.toml", "--json", "--quiet"][..],
        &["package", "scene.toml", "-o", "x", "--library", "library.so", "--json", "--quiet"],
        &["inspect", "scene.toml", "--json", "--quiet"],
        &["inspect", "x/small_fmi2.fmu", "--json", "--quiet"],
    ] {
        let output = project.run(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        // Unresolved modes, and the effect of contact on them: two lines each.
        let shown = warnings(&stderr);
        assert!(output.status.success() && shown.len() == 2, "{arguments:?}: {stderr}");
        assert_eq!(stderr.lines().count(), 4, "{stderr}");
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let json = if arguments[0] == "inspect" { &json["scene"] } else { &json };
        let details = json["warning_details"].as_array().unwrap();
        let reported: Vec<String> = details
            .iter()
            .map(|one| {
                let text = |key: &str| one[key].as_str().unwrap();
                format!("{} [{}] {}\n    {}", text("level"), text("id"), text("problem"), text("remedy"))
            })
            .collect();
        assert_eq!(reported, shown, "{arguments:?}");
        assert_eq!(json["warnings"].as_array().unwrap().len(), 2, "{arguments:?}");
    }
}

/// Returns every warning with its remedy from stderr.
fn warnings(stderr: &str) -> Vec<String> {
    let lines: Vec<&str> = stderr.lines().collect();
    let first = |line: &&[&str]| line[0].starts_with("warning [") || line[0].starts_with("note [");
    lines.windows(2).filter(first).map(|two| two.join("\n")).collect()
}

/// A warning has an identifier that silences it: on the command line, in a scene, and in an FMU.
#[test]
fn a_warning_is_silenced_by_its_identifier() {
    let project = Project::new();
    let coarse = SCENE
        .replace("step = 1e-4", "step = 2.05e-3")
        .replace("communication_step = 1e-3", "communication_step = 4.1e-3");
    fs::write(project.path("scene.toml"), &coarse).unwrap();
    let ids = |words: &[&str]| -> Vec<String> {
        let output = project.run(words);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{words:?}: {stderr}");
        warnings(&stderr).iter().map(|text| text.split(['[', ']']).nth(1).unwrap().to_owned()).collect()
    };
    let all = ids(&["run", "scene.toml", "--quiet"]);
    assert_eq!(all.len(), 2, "{all:?}");
    assert_eq!(ids(&["run", "scene.toml", "--quiet", "--silence", &all[0]]), all[1..]);
    let package = ["package", "scene.toml", "-o", "x", "--library", "library.so", "--quiet", "--silence", &all[1]];
    assert_eq!(ids(&package), all[..1]);
    assert_eq!(ids(&["inspect", "x/small_fmi3.fmu", "--quiet"]), all[..1]);
    fs::write(project.path("scene.toml"), format!("silence = [\"{}\", \"{}\"]\n{coarse}", all[0], all[1])).unwrap();
    assert!(ids(&["run", "scene.toml", "--quiet"]).is_empty());
    let unknown = project.fail(&["run", "scene.toml", "--silence", "fluter"], 2);
    assert!(
        unknown.contains("no warning has the identifier \"fluter\"") && unknown.contains("Did you mean `flutter`?"),
        "{unknown}"
    );
}

/// Slips end with an error, unless the scene or the command line accepts them; an FMU then contains that setting, too.
#[test]
fn every_command_rejects_suspect_input_unless_accepted() {
    let project = Project::new();
    fs::write(
        project.path("scene.toml"),
        SCENE
            .replace("speed = 100.0", "speed = 17188.0")
            .replace("step = 1e-4", "step = 1e-5")
            .replace("amplitude = 2e-3", "amplitude = 2e-6"),
    )
    .unwrap();
    for line in [
        "run scene.toml --stop 1e-4 --step 1e-5",
        "inspect scene.toml",
        "package scene.toml -o x --library library.so",
        "inspect x/small_fmi3.fmu",
    ] {
        let words: Vec<&str> = line.split(' ').collect();
        if !line.contains("fmu") {
            let refused = project.fail(&words, 1);
            assert!(refused.contains("rpm") && refused.contains("4297 m/s"), "{line}: {refused}");
            assert!(refused.contains("--accept-implausible"), "{line}: {refused}");
        }
        // The scene inside the FMU contains the key.
        let meant = if line.contains("fmu") { words } else { [&words[..], &["--accept-implausible"]].concat() };
        let output = project.run(&meant);
        let stderr = String::from_utf8(output.stderr).unwrap();
        let reported: Vec<_> = stderr.lines().filter(|text| text.contains("[implausible]")).collect();
        assert!(output.status.success() && reported.len() == 1 && reported[0].contains("4297 m/s"), "{line}: {stderr}");
    }
    // A manually written ROM in millimetres.
    let path = project.path("small.rom.safetensors");
    let mut rom = tiprub_format::read_rom(&fs::read(&path).unwrap(), "small").unwrap();
    rom.contact_nodes[0].position[0] = 250.0;
    fs::write(&path, tiprub_format::write_rom(&rom)).unwrap();
    let output = project.run(&["inspect", "small.rom.safetensors"]);
    assert!(output.status.success() && String::from_utf8(output.stderr).unwrap().contains("millimetres"));
    assert!(project.fail(&["inspect", "scene.toml"], 1).contains("millimetres"));
}

#[test]
fn control_characters_are_never_printed() {
    let project = Project::new();
    let mut rom = tiprub_format::read_rom(&fs::read(project.path("small.rom.safetensors")).unwrap(), "").unwrap();
    rom.origin = "mass\u{1b}]0;owned\u{7}\u{9b}31m\u{202e}".into();
    fs::write(project.path("odd.safetensors"), tiprub_format::write_rom(&rom)).unwrap();
    let described = SCENE.replace("name = \"small\"", "name = \"small\"\ndescription = \"red \\u001b[31m\"");
    fs::write(project.path("odd.toml"), described).unwrap();
    for words in [
        &["inspect", "odd.safetensors"][..],
        &["inspect", "odd.safetensors", "--json"],
        &["inspect", "odd.toml"],
        &["inspect", "odd.toml", "--json"],
        &["inspect", "no\u{1b}[31m\nerror: forged.toml"],
        &["run", "no\u{1b}[31m\nerror: forged.toml", "--json"],
    ] {
        let output = project.run(words);
        let text = String::from_utf8([output.stdout.clone(), output.stderr.clone()].concat()).unwrap();
        let obeyed = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(
            !text.contains(obeyed) && !text.lines().any(|line| line.starts_with("error: forged")),
            "{words:?}: {text:?}"
        );
        if words.contains(&"--json") {
            json(&output);
        }
    }
}

/// A warning of the run is reported beside the warnings of its start, and only once.
#[test]
fn run_time_warnings_appear_once() {
    let project = Project::new();
    let path = project.path("small.rom.safetensors");
    let mut rom = tiprub_format::read_rom(&fs::read(&path).unwrap(), "small").unwrap();
    // A light contact node on the mass: galerkin neglects the mass of contact nodes.
    let stiff = |i: usize, j: usize| match (i == j, i / 3 + j / 3) {
        (true, 0) => 2.4e8,
        (true, _) => 2e8,
        (false, _) if i % 3 == j % 3 => -2e8,
        _ => 0.0,
    };
    rom.mass = DMatrix::from_diagonal(&DVector::from_fn(6, |i, _| [0.1, 1e-3][i / 3]));
    rom.stiffness = DMatrix::from_fn(6, 6, stiff);
    rom.contact_map = DMatrix::from_fn(3, 6, |i, j| f64::from(u8::from(3 + i == j)));
    fs::write(&path, tiprub_format::write_rom(&rom)).unwrap();
    let scene = SCENE
        .replace("step = 1e-4", "scheme = \"galerkin\"\ntolerance = 1e-9\nstep = 8e-4")
        .replace("amplitude = 2e-3", "amplitude = 1.1e-3");
    fs::write(project.path("scene.toml"), scene).unwrap();
    let output = project.run(&["run", "scene.toml", "--json", "--quiet"]);
    let stderr = String::from_utf8(output.stderr.clone()).unwrap();
    let reported: Vec<&str> = stderr.lines().filter(|line| line.contains("have missed the tolerance")).collect();
    assert!(output.status.success() && reported.len() == 1, "{stderr}");
    assert_eq!(json(&output)["warnings"].as_array().unwrap().len(), warnings(&stderr).len(), "{stderr}");
}
