//! `tiprub study stability` on small scenes.

use std::{fs, path::Path, process::Command};

use serde_json::Value;

use crate::studies::{assert_only_no, columns, tiprub, write_user_scene};

/// Returns the result of the stability study of a scene at two frictions, speeds and steps.
fn stability(root: &Path, scene: &str) -> Value {
    let arguments = ["study", "stability", scene, "--friction", "0.15:0.9:2", "--speeds=-1800:1800:2"];
    let more = ["--steps", "1e-6:1.6e-5:2", "--json", "--quiet", "--out", "out"];
    serde_json::from_str(&tiprub(root, "", &[&arguments[..], &more].concat()).0).unwrap()
}

/// Runs three steps of the scene with a friction coefficient, a speed, a step and `scheme + solver`.
fn three_steps(root: &Path, [friction, speed, step]: [f64; 3], method: &str) -> Value {
    let (scheme, solver) = method.split_once(" + ").unwrap();
    let values = [
        format!("--set=friction_coefficient={friction:?}"),
        format!("--set=speed={speed:?}"),
        format!("--set=internal_step_max={step:?}"),
        format!("--set=scheme={scheme}"),
        format!("--set=solver={solver}"),
        format!("--step={step:?}"),
        format!("--stop={:?}", 3.0 * step),
    ];
    let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
    let output = command.current_dir(root).args(["run", "own.toml", "--json", "--quiet"]).args(values).output();
    serde_json::from_slice(&output.unwrap().stdout).unwrap()
}

/// Every answer of the study agrees with a run with the same start values and step, and the largest accepted steps separate accepted from rejected
/// ones.
#[test]
fn stability_study_agrees_with_runs() {
    let root = tempfile::tempdir().unwrap();
    write_user_scene(root.path());
    let json = stability(root.path(), "own.toml");
    assert_only_no(&json, &[]);
    let number = |value: &Value, name: &str| value[name].as_f64().unwrap();
    let points = json["results"]["points"].as_array().unwrap();
    assert_eq!(points.len(), 8);
    for point in points {
        let [friction, speed, step] = ["friction", "speed", "internal_step"].map(|name| number(point, name));
        let reported = three_steps(root.path(), [friction, speed, step], "modal-exact + lcp");
        match point["refusal"].as_str() {
            // Place and problem are separate in JSON.
            Some(text) => {
                let reported = reported["error"]["problem"].as_str().unwrap();
                assert!(text.starts_with(reported), "{text} {reported}");
            }
            None => assert_eq!(reported["warnings"], point["warnings"], "{point:#}"),
        }
    }
    let answers: Vec<&str> = points.iter().map(|point| point["answer"].as_str().unwrap()).collect();
    assert!(["right", "warned", "flutter", "refused"].iter().all(|kind| answers.contains(kind)), "{answers:?}");
    let limits = json["results"]["largest_steps"].as_array().unwrap();
    assert_eq!(limits.len(), 9);
    for limit in limits.iter().filter(|limit| !limit["method"].as_str().unwrap().ends_with("coulomb")) {
        if limit["method"] == "massless-boundary + film" {
            let rule = limit["refusal_beyond"].as_str().unwrap();
            assert!(limit["step"].is_null() && rule.contains("cannot be combined with"), "{limit:#}");
            continue;
        }
        for (factor, accepted) in [(0.999, true), (1.02, false)] {
            let step = factor * number(limit, "step");
            let reported = three_steps(root.path(), [0.15, 1800.0, step], limit["method"].as_str().unwrap());
            assert_eq!(reported["error"].is_null(), accepted, "{limit:#} {reported:#}");
        }
    }
    for row in columns(&root.path().join("out/answers.csv")).1 {
        assert_eq!(row[6].is_finite(), row[4] > 0.0, "only flutter has a frequency: {row:?}");
    }
    let page = fs::read_to_string(root.path().join("out/index.html")).unwrap();
    assert!(page.contains("Largest internal step that passes the checks") && page.contains("Read a column"));
}

#[test]
fn stability_study_works_without_friction_in_the_scene() {
    let root = tempfile::tempdir().unwrap();
    write_user_scene(root.path());
    let scene = fs::read_to_string(root.path().join("own.toml")).unwrap();
    fs::write(root.path().join("dry.toml"), scene.replace("friction = 0.15", "friction = 0.0")).unwrap();
    let (own, dry) = (stability(root.path(), "own.toml"), stability(root.path(), "dry.toml"));
    assert_eq!(dry["results"]["own"]["friction"], 0.0);
    let rubbing = |point: &&Value| point["friction"] != 0.0;
    let (with, without) = dry["results"]["points"].as_array().unwrap().iter().partition::<Vec<_>, _>(rubbing);
    assert!(
        with.iter().zip(own["results"]["points"].as_array().unwrap()).all(|(a, b)| *a == b) && without.len() == 4,
        "{with:#?}"
    );
    assert!(
        without.iter().all(|point| point["refusal"].is_null() && point["growth_of_steps"].is_null()),
        "{without:#?}"
    );
}

#[test]
fn stability_study_shows_usable_steps_below_a_long_one() {
    let root = tempfile::tempdir().unwrap();
    write_user_scene(root.path());
    let scene = fs::read_to_string(root.path().join("own.toml")).unwrap();
    let text = scene
        .replace("step = 1.0e-6 ", "step = 1.0e-4 ")
        .replace("communication_step = 1.0e-5", "communication_step = 1.0e-4");
    fs::write(root.path().join("long.toml"), text).unwrap();
    let arguments = ["study", "stability", "long.toml", "--quick", "--json", "--quiet", "--out", "long"];
    let long: Value = serde_json::from_str(&tiprub(root.path(), "", &arguments).0).unwrap();
    assert_only_no(&long, &["The scene as it stands is accepted", "Its internal step does not exceed"]);
    let accepted = ["right", "warned"].map(|kind| long["results"]["counts"][kind].as_u64().unwrap());
    assert!(accepted[0] + accepted[1] > 0, "{}", long["results"]["counts"]);
}
