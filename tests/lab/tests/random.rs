//! `lab random`: 300 random scenes, with oracles that are independent of the scene; and single scenes run by their
//! seed.

use std::process::Command;

use serde_json::Value;

/// Returns the output of a run that ends with `code`.
fn random(arguments: &[&str], code: i32) -> Value {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lab"));
    command.args(["--json", "--quiet", "random"]).args(arguments);
    // A library built elsewhere is tested if it is named; otherwise the program builds one.
    if let Some(library) = std::env::var_os("TIPRUB_LIBRARY") {
        command.arg("--library").arg(library);
    }
    let output = command.output().unwrap();
    let reported = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{reported}\n{}", String::from_utf8_lossy(&output.stdout));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn all_invariants_hold_in_300_random_scenes() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    random(&["--scenes", "300", "--seed", "1", "--fmu", "5", "--out", out.to_str().unwrap()], 0);
    let text = std::fs::read_to_string(out.join("results.json")).unwrap();
    let json: Value = serde_json::from_str(&text).unwrap();
    let wrong = json["wrong"].as_array().unwrap();
    assert!(wrong.is_empty(), "{wrong:?}");
    assert_eq!(json["compared"], 60);
    // The generator has sufficient coverage: most scenes are not rejected, and each feature occurs in some that run.
    assert!(json["counts"]["rejected"].as_u64().unwrap() < 100, "{}", json["counts"]);
    for cell in json["cells"].as_array().unwrap() {
        let feature = &cell["feature"];
        let same = json["cells"].as_array().unwrap().iter().filter(|other| other["feature"] == *feature);
        let ran: u64 = same.map(|cell| cell["counts"]["ran"].as_u64().unwrap()).sum();
        assert!(ran > 0, "no scene with {feature} ran");
    }
}

#[test]
fn a_scene_follows_from_its_seed_alone() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let one = || random(&["--only", "12345", "--fmu", "0", "--out", out.to_str().unwrap()], 0);
    let (first, second) = (one(), one());
    for key in ["scheme", "solver", "features", "outcome", "message"] {
        assert_eq!(first[key], second[key], "{key}");
    }
    // The scene is written as an FMU contains it.
    assert!(out.join("12345/scene.toml").is_file());
}

/// Massless nodes of a free body that vibrate between the points of the shortest steps: such steps miss the tolerance,
/// and are counted.
#[test]
fn gaps_within_shortest_steps_respect_the_tolerance() {
    random(&["--only", "3119184997545909494", "--fmu", "0"], 0);
}

/// For blades that turn slowly in their cut, the cutting force would supply energy.
#[test]
fn cutting_that_adds_energy_ends_the_run_with_reason() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("out");
    let found = random(&["--only", "12103802028229366479", "--fmu", "0", "--out", out.to_str().unwrap()], 0);
    let message = found["message"].as_str().unwrap_or_default();
    assert!(message.contains("cutting forces have added") && message.contains("move backwards"), "{found}");
}
