//! `tiprub study convergence` on built-in models and meshes.

use std::{fs, path::Path, process::Command};

use serde_json::{Value, json};

use crate::studies::{check_errors_of_a_file, scene_with_blade, tiprub, write_user_scene};

/// Arguments for the mesh from which the ROM of `own.toml` was reduced.
const MESH: [&str; 6] = ["--mesh", "blade.inp", "--contact-set", "TIP", "--clamp-set", "HUB"];

fn convergence(root: &Path, more: &[&str]) -> Value {
    let own = ["study", "convergence", "own.toml", "--quick", "--json", "--quiet", "--out", "out"];
    serde_json::from_str(&tiprub(root, "", &[&own[..], more].concat()).0).unwrap()
}

/// The study shortens the steps of any scene and removes modes of any ROM. More modes and other contact nodes need the mesh of the ROM.
#[test]
fn convergence_study_reports_what_it_cannot_refine() {
    let root = tempfile::tempdir().unwrap();
    write_user_scene(root.path());
    let study = |more: &[&str]| convergence(root.path(), more);
    let values = |direction: &Value| -> Vec<f64> {
        direction["levels"].as_array().unwrap().iter().map(|level| level["value"].as_f64().unwrap()).collect()
    };
    let scope = study(&[])["results"].clone();
    let without_mesh = &scope["directions"];
    assert_eq!([values(&without_mesh[0]), values(&without_mesh[1])], [vec![2e-6, 1e-6, 5e-7], vec![2.0, 4.0]]);
    assert!(values(&without_mesh[2]).is_empty());
    for direction in [1, 2, 3] {
        assert!(without_mesh[direction]["not_refined"].as_str().unwrap().contains("--mesh FILE"), "{without_mesh:#}");
    }
    assert_eq!(scope["refined"], json!(["internal step"]));
    assert_eq!(scope["coarser_only"], json!(["modes of rotor"]));
    assert_eq!(scope["not_refined"], json!(["contact nodes of rotor", "mesh of rotor"]));
    let page = fs::read_to_string(root.path().join("out/index.html")).unwrap();
    let reported = "finer levels: internal step; coarser levels only: modes of rotor; not refined: contact nodes of rotor, mesh of rotor";
    assert!(page.contains(reported) && !page.to_lowercase().contains("total"), "{reported}");
    // If no error was found, a warning reports that the ROM is unchanged. The directory of the file is created, as for all outputs.
    let (text, _) = tiprub(
        root.path(),
        "",
        &["study", "convergence", "own.toml", "--quick", "--quiet", "--out", "out", "--into", "new/at.rom"],
    );
    let none = text.contains(
        "warning: new/at.rom contains the ROM unchanged: no error due to its modes, patches or mesh could be determined",
    );
    let kept = fs::read(root.path().join("new/at.rom")).unwrap()
        == fs::read(root.path().join("coarse.rom.safetensors")).unwrap();
    assert!(none && kept && !text.contains("unknown"), "{text}");
    let with_mesh = study(&[&MESH[..], &["--sectors", "36"]].concat());
    let found = &with_mesh["results"]["directions"];
    assert_eq!([values(&found[1]), values(&found[2])], [vec![2.0, 4.0, 6.0], vec![2.0, 3.0]]);
    let all = found.as_array().unwrap();
    assert!(all[..3].iter().all(|direction| direction["not_refined"].is_null()), "{found:#}");
    assert!(all[3]["not_refined"].as_str().unwrap().contains("--other-mesh FILE"), "{found:#}");
    // The unchanged scene gives the same run in every direction, and without a mesh.
    let unchanged_runs = |directions: &Value| -> Vec<Value> {
        let levels = directions.as_array().unwrap().iter().flat_map(|one| one["levels"].as_array().unwrap());
        let own = levels.filter(|level| level["own"] == true);
        own.map(|level| {
            ["impulse", "friction_work", "peak_force", "strain_energy"].map(|name| level[name].clone()).to_vec().into()
        })
        .collect()
    };
    let all = unchanged_runs(found);
    assert!(
        all.len() == 3 && all.iter().all(|one| *one == all[0]) && all[0] == unchanged_runs(without_mesh)[0],
        "{all:?}"
    );
    // Changes are differences from the next run. Refining the step changes the results least.
    let change = |direction: &Value, level: usize, name: &str| {
        direction["levels"][level]["changes_to_next"][name].as_f64().unwrap()
    };
    let steps = [0, 1].map(|level| change(&found[0], level, "displacements"));
    assert!(steps.iter().all(|step| (1e-6..0.01).contains(step)), "{steps:?}");
    assert!(steps[1] < 0.1 * change(&found[1], 1, "displacements"), "{found:#}");
    let impulse = |level: usize| found[1]["levels"][level]["impulse"].as_f64().unwrap();
    let expected = (impulse(1) - impulse(2)).abs() / impulse(1).max(impulse(2));
    assert!((change(&found[1], 1, "impulse") / expected - 1.0).abs() < 1e-9);
    assert!(fs::read_to_string(root.path().join("out/levels.csv")).unwrap().lines().count() == 1 + 3 + 3 + 2);
}

/// Just below the limit of central differences, models with more modes or nodes are rejected.
#[test]
fn rejected_refinements_are_repeated_with_half_the_step() {
    let root = tempfile::tempdir().unwrap();
    write_user_scene(root.path());
    let scene = fs::read_to_string(root.path().join("own.toml")).unwrap();
    let replaced = |line: &str| match line.split(' ').next() {
        Some("scheme") => "scheme = \"central-difference\"".to_owned(),
        Some("step") => "step = 4.4e-6".to_owned(),
        Some("communication_step") => "communication_step = 8.8e-6".to_owned(),
        _ => line.to_owned(),
    };
    fs::write(root.path().join("own.toml"), scene.lines().map(replaced).collect::<Vec<_>>().join("\n")).unwrap();
    let limited = convergence(root.path(), &[&MESH[..], &["--sectors", "36"]].concat());
    let found = limited["results"]["directions"].as_array().unwrap();
    let divided: Vec<u64> = found.iter().map(|one| one["step_divided_by"].as_u64().unwrap()).collect();
    assert_eq!(divided, [1, 2, 2, 1]);
    let refused =
        |one: &Value| one["levels"].as_array().unwrap().iter().filter(|level| level["refused"].is_string()).count();
    assert_eq!(found.iter().map(refused).collect::<Vec<_>>(), [1, 0, 0, 0], "{limited:#}");
}

/// Two other meshes of the blade give a sequence whose limit is extrapolated. The written ROM contains the error, which later runs report.
#[test]
fn mesh_error_is_estimated_and_stored_in_the_rom() {
    let root = tempfile::tempdir().unwrap();
    write_user_scene(root.path());
    for mesh in ["4x1x6", "8x1x12"] {
        let reduce = ["reduce", "rotor37", "--mesh", mesh, "--modes", "4", "--contact-nodes", "2", "--quiet"];
        let written = ["-o", &format!("{mesh}.rom.safetensors"), "--inp", &format!("{mesh}.inp")];
        tiprub(root.path(), "", &[&reduce[..], &written].concat());
    }
    let into = ["--sectors", "36", "--into", "known.rom.safetensors"];
    let others = ["--other-mesh", "8x1x12.inp", "--other-mesh", "4x1x6.inp"];
    let json = convergence(root.path(), &[&MESH[..], &others, &into].concat());
    let mesh = &json["results"]["directions"][3];
    let levels = mesh["levels"].as_array().unwrap();
    let values: Vec<f64> = levels.iter().map(|level| level["value"].as_f64().unwrap()).collect();
    assert!(levels.len() == 3 && levels[1]["own"] == true && values.is_sorted(), "{mesh:#}");
    // The contact nodes are the edges of the tip on every mesh, so that displacements are compared.
    let changes = [0, 1].map(|level| levels[level]["changes_to_next"]["displacements"].as_f64().unwrap());
    assert!(changes.iter().all(|change| (1e-4..0.5).contains(change)), "{mesh:#}");
    let limits = fs::read_to_string(root.path().join("out/limits.csv")).unwrap();
    assert!(limits.lines().filter(|line| line.starts_with("mesh of rotor,")).count() == 5, "{limits}");
    let found = mesh["error"]["displacements"].as_f64();
    // A sequence with decreasing changes has a limit, and the scene is farther from it than from the finest mesh.
    assert_eq!(found.is_some(), changes[0] > 1.2 * changes[1], "{mesh:#}");
    assert!(found.is_none_or(|found| found > changes[1]), "{mesh:#}");
    let reported = |command: &[&str]| tiprub(root.path(), "", command).0;
    let inspected: Value = serde_json::from_str(&reported(&["inspect", "known.rom.safetensors", "--json"])).unwrap();
    let errors = &inspected["rom"]["rub_errors"];
    assert_eq!(errors["mesh"].as_f64(), found, "{errors}");
    assert!(errors["found_on"].as_str().unwrap().starts_with("rotor37_rub_one_row, "), "{errors}");
    fs::write(root.path().join("known.toml"), scene_with_blade("known.rom.safetensors")).unwrap();
    let run = reported(&["run", "known.toml", "--stop", "1e-4", "--quiet"]);
    let last = run.lines().rfind(|line| line.starts_with("estimated error")).unwrap();
    let mesh = found.map_or("mesh unknown".to_owned(), |found| format!("mesh {:.2} %", 100.0 * found));
    assert!(last.contains("steps unknown") && last.contains(&mesh), "{run}");
    // A run of a ROM without a study prints no estimated error.
    assert!(!reported(&["run", "own.toml", "--stop", "1e-4", "--quiet"]).contains("estimated error"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
    check_errors_of_a_file(
        root.path(),
        &reported(&["study", "error", "known.toml", "--quick", "--json", "--quiet", "--window", "2e-3"]),
    );
    let again = ["study", "convergence", "own.toml", "--quick", "--into", "known.rom.safetensors"];
    let output = command.current_dir(root.path()).args(again).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8(output.stderr).unwrap().contains("known.rom.safetensors: already exists"));
}

#[test]
fn convergence_study_rejects_a_different_mesh() {
    let root = tempfile::tempdir().unwrap();
    write_user_scene(root.path());
    let refuse = |more: &[&str], code: i32| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        let output = command.current_dir(root.path()).args(["study", "convergence", "own.toml", "--quick"]).args(more);
        let output = output.output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{more:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let other = refuse(&[&MESH[..], &["--sectors", "36", "--material", "steel"]].concat(), 1);
    assert!(other.contains("the mesh does not reproduce the ROM `rotor37` of the scene: first frequency"), "{other}");
    assert!(refuse(&MESH, 1).contains("1 sectors instead of"), "sectors");
    assert!(refuse(&MESH[2..], 2).contains("--mesh: an option describes a mesh, but no mesh is given"));
    assert!(refuse(&[&MESH[..], &["--modes", "9"]].concat(), 2).contains("unexpected argument '--modes'"));
}
