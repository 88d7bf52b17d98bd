//! `lab stability --quick`: every case is correct, rejected or ended as expected; and the judge detects the ones that
//! are not.

use std::{path::Path, process::Command};

use serde_json::Value;

/// Returns the output of a run that ends with `code`.
fn stability(root: &Path, arguments: &[&str], code: i32) -> Value {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lab"));
    command.current_dir(root).args(["--json", "--quiet", "stability", "--out", "out"]).args(arguments);
    // A library built elsewhere is tested if it is named; otherwise the program builds one.
    if let Some(library) = std::env::var_os("TIPRUB_LIBRARY") {
        command.arg("--library").arg(library);
    }
    let output = command.env("TIPRUB_CACHE", env!("CARGO_TARGET_TMPDIR")).output().unwrap();
    assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn every_quick_case_is_correct_or_rejected() {
    let root = tempfile::tempdir().unwrap();
    let json = stability(root.path(), &["--quick"], 0);
    for row in json["rows"].as_array().unwrap() {
        assert!(["right", "refused", "ended"].contains(&row["verdict"].as_str().unwrap()), "{row:#}");
    }
    let count = |verdict: &str| json["counts"][verdict].as_u64().unwrap();
    let total = json["cases"].as_u64().unwrap();
    assert_eq!((count("wrong"), count("crashed"), count("hung")), (0, 0, 0));
    assert_eq!(count("right") + count("refused") + count("ended"), total);
    assert!(total > 800 && count("right") > 420 && count("refused") > 320, "{}", json["counts"]);
    every_family_meets_galerkin(json["methods"].as_array().unwrap());
    for name in ["index.html", "stability.csv", "stability.md", "results.json"] {
        assert!(root.path().join("out").join(name).metadata().unwrap().len() > 10_000, "{name}");
    }
}

/// Families about one scheme, or about files and settings, which need no other scheme.
const OF_ONE_SCHEME: [&str; 5] = ["massless", "rom", "settings", "rotor37", "stage"];

fn every_family_meets_galerkin(methods: &[Value]) {
    let text = |row: &Value, key: &str| row[key].as_str().unwrap_or_default().to_owned();
    let families: std::collections::BTreeSet<String> = methods.iter().map(|row| text(row, "family")).collect();
    assert!(families.len() > 30, "{families:?}");
    let meets = |family: &String| {
        let own = |row: &&Value| text(row, "family") == *family && text(row, "method").starts_with("galerkin");
        methods.iter().filter(own).map(|row| row["cases"].as_u64().unwrap()).sum::<u64>() > 0
    };
    let others = families.iter().filter(|family| !OF_ONE_SCHEME.contains(&family.as_str()));
    for family in others {
        assert!(meets(family), "{family} has no case with galerkin");
    }
}

#[test]
fn judge_detects_every_kind_of_failure() {
    let root = tempfile::tempdir().unwrap();
    // An unsound case is a failure of the command, but the table is written.
    let failure = stability(root.path(), &["--case", "judge/"], 1);
    let reported = failure.to_string();
    assert!(
        reported.contains("21 of 21 cases are neither correct nor rejected") && reported.contains("WRONG judge/wrong"),
        "{reported}"
    );
    let written = std::fs::read_to_string(root.path().join("out").join("results.json")).unwrap();
    let json: Value = serde_json::from_str(&written).unwrap();
    let verdict = |name: &str| {
        let rows = json["rows"].as_array().unwrap();
        let row = rows.iter().find(|row| row["case"] == format!("judge/{name}")).unwrap();
        row["verdict"].as_str().unwrap().to_owned()
    };
    for (name, expected) in [
        ("wrong", "WRONG"),
        ("refused", "WRONG"),
        ("not-refused", "WRONG"),
        ("unnamed", "WRONG"),
        ("panic", "CRASHED"),
        ("abort", "CRASHED"),
        ("overflow", "CRASHED"),
        ("exit", "CRASHED"),
        ("hang", "HUNG"),
    ] {
        assert_eq!(verdict(name), expected, "{name}");
    }
    // Small faults of mechanics are detected by the corresponding check, and are not errors.
    let happened = |name: &str| {
        let rows = json["rows"].as_array().unwrap();
        let row = rows.iter().find(|row| row["case"] == format!("judge/{name}")).unwrap();
        row["happened"].as_str().unwrap().to_owned()
    };
    for (name, check) in [
        ("damping-of-blades-10%", "displacement from the modal decay"),
        ("damping-of-blades-0.1%", "displacement from the modal decay"),
        ("damping-of-a-ring-10%", "amplitude from the modal decay"),
        ("speed-1%", "λ from the dynamic stiffness of the blade"),
        ("rotor-a-step-early", "λ from the exact response of the blade"),
        ("load-a-step-early", "wave from that of the oscillator"),
        ("slope-of-a-lobe-1%", "tangential force from λ n_t"),
        ("coupling-of-sectors-1%", "blade positions from the static ones"),
        ("disk-not-mirrored", "displacements from the mirrored ones"),
        ("heat-1%", "friction loss from ∫ µ λ |v| dt"),
        ("impact-loses-momentum-1%", "impulse from m v and µ m v"),
        ("momentum-1e-9", "change of momentum from the impulse"),
    ] {
        assert_eq!(verdict(name), "WRONG", "{name}");
        let reported = happened(name);
        assert!(
            reported.contains(check) && !reported.contains("rejected") && !reported.contains("not fulfilled"),
            "{name}: {reported}"
        );
    }
}

/// Problems that would occur after an hour of cases are reported before the first one, and no files remain.
#[test]
fn rejects_invalid_result_paths_before_the_first_case() {
    let root = tempfile::tempdir().unwrap();
    let path = |name: &str| root.path().join(name);
    std::fs::write(path("file"), "").unwrap();
    let refuse = |arguments: &[&str], code: i32| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lab"));
        let output = command.current_dir(root.path()).arg("stability").args(arguments).output().unwrap();
        let reported = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{reported}");
        assert!(!path("out").exists() && !reported.contains("Stability"), "{reported}");
        reported
    };
    let reported = refuse(&["--case", "judge/hang", "--out", "file/out"], 1);
    assert!(reported.contains("file/out: cannot create the directory"), "{reported}");
    // Inputs are never overwritten.
    std::fs::create_dir(path("results")).unwrap();
    std::fs::write(path("results/index.html"), "").unwrap();
    let reported = refuse(&["--out", "results", "--library", "results/index.html"], 2);
    assert!(reported.contains("is the same file as"), "{reported}");
}
