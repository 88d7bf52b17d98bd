//! Built-in scenes, run natively through the program: each runs in seconds and shows the effect that it demonstrates.

use std::{fs, process::Command};

use tempfile::TempDir;

#[track_caller]
fn succeed(directory: &TempDir, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_tiprub"))
        .env("TIPRUB_CACHE", env!("CARGO_TARGET_TMPDIR"))
        .current_dir(directory)
        .args(arguments)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn columns(csv: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut lines = csv.lines();
    let names = lines.next().unwrap().split(',').map(String::from).collect();
    (names, lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect())
}

/// Returns the JSON object of a run of a built-in scene, which must succeed with contact.
#[track_caller]
fn run_builtin(project: &TempDir, name: &str) -> (serde_json::Value, Vec<String>, Vec<Vec<f64>>) {
    let json = succeed(project, &["run", name, "--csv", "out.csv", "--report", "out.html", "--json", "--quiet"]);
    let report = fs::read_to_string(project.path().join("out.html")).unwrap();
    assert!(report.len() < 1_250_000 && report.contains("is hit hardest"), "{name}: {} bytes", report.len());
    let summary: serde_json::Value = serde_json::from_str(&json).unwrap();
    // Closed contact flutters, which is reported once; there are no other warnings.
    let warnings = summary["warnings"].as_array().unwrap();
    assert!(warnings.len() <= 1, "{name}: {warnings:#?}");
    assert!(warnings.iter().all(|warning| warning.as_str().unwrap().contains("(flutter)")), "{name}: {warnings:#?}");
    let (names, rows) = columns(&fs::read_to_string(project.path().join("out.csv")).unwrap());
    let impulse = names.iter().position(|name| name == "normal_impulse").unwrap();
    let touching = rows.iter().filter(|row| row[impulse] > 0.0).count();
    assert!(touching > rows.len() / 2, "{name}: contact at {touching} of {} points", rows.len());
    let residual = summary["last"]["energy_residual_relative"].as_f64().unwrap();
    assert!(residual.abs() < 1e-9, "{name}: {residual:e}");
    (summary["last"].clone(), names, rows)
}

#[test]
fn built_in_flexible_casing_runs_and_heats_its_patches() {
    let project = tempfile::tempdir().unwrap();
    let (last, names, rows) = run_builtin(&project, "builtin:flexible-casing");
    let column = |name: &str| names.iter().position(|other| other == name).unwrap_or_else(|| panic!("{name}"));
    let (total, blades) = (column("friction_power"), column("blade_friction_power"));
    let patches: Vec<usize> = (1..=12).map(|patch| column(&format!("casing_friction_power[{patch}]"))).collect();
    for row in &rows {
        let casing: f64 = patches.iter().map(|patch| row[*patch]).sum();
        assert!((casing - 0.5 * row[total]).abs() <= 1e-9 * row[total], "{casing} of {}", row[total]);
        assert!((casing + row[blades] - row[total]).abs() <= 1e-9 * row[total]);
    }
    assert!(last["load_work"].as_f64().unwrap() == 0.0, "nothing is warm");
    // A casing that is uniformly 20 K warmer is wider, and less coating is worn.
    let warm =
        succeed(&project, &["run", "builtin:flexible-casing", "--set", "casing_temperature=20", "--json", "--quiet"]);
    let warm: serde_json::Value = serde_json::from_str(&warm).unwrap();
    let loss = |last: &serde_json::Value| last["friction_loss"].as_f64().unwrap();
    assert!(loss(&warm["last"]) < loss(&last), "{} J warm, {} J cold", loss(&warm["last"]), loss(&last));
}

#[test]
fn built_in_abradable_casing_wears_irreversibly() {
    let project = tempfile::tempdir().unwrap();
    let (last, names, rows) = run_builtin(&project, "builtin:abradable");
    let cells: Vec<usize> =
        names.iter().enumerate().filter(|(_, name)| name.starts_with("wear_depth[")).map(|(index, _)| index).collect();
    assert_eq!(cells.len(), 720 * 5);
    for pair in rows.windows(2) {
        assert!(cells.iter().all(|cell| pair[1][*cell] >= pair[0][*cell]));
    }
    let deepest = cells.iter().map(|cell| rows.last().unwrap()[*cell]).fold(0.0, f64::max);
    assert_eq!(last["wear_depth_maximum"].as_f64().unwrap().to_bits(), deepest.to_bits());
    // The bumps extend 0.2 of the gap beyond the blade tips; the vibration of the blades cuts only slightly deeper.
    assert!((2e-5..1.5e-4).contains(&deepest), "{deepest} m");
}

#[test]
fn report_of_a_free_body_shows_no_rotor() {
    let project = tempfile::tempdir().unwrap();
    succeed(&project, &["run", "builtin:cube-between-rings", "--report", "out.html", "--quiet"]);
    let report = fs::read_to_string(project.path().join("out.html")).unwrap();
    assert!(report.contains("The bodies touch") && report.contains("External work, and friction heat"));
    for word in ["Torque of the contacts", "torque", "rotor", "drive and the casing"] {
        assert!(!report.split("<section>").skip(1).any(|section| section.contains(word)), "{word}");
    }
}

#[test]
fn inspect_lists_the_features_of_a_built_in_scene() {
    let project = tempfile::tempdir().unwrap();
    let text = succeed(&project, &["inspect", "builtin:flexible-casing", "--quiet"]);
    for part in [
        "ring from builtin:casing37, stationary",
        "surface `casing` is flexible: carried by `ring` with ",
        "`ring` heats up: temperatures of 12 patches are inputs",
        "friction heat is shared: a fraction of 0.5 goes into `casing`",
        "24 around x 3 along",
        "heated patches            12",
    ] {
        assert!(text.contains(part), "{part} is not in:\n{text}");
    }
}
