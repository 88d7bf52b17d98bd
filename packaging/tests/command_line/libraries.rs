//! Compares the list of libraries inside the FMU with cargo's dependency tree.

use std::{collections::BTreeSet, process::Command};

/// Returns (crate, licence) of all crates that `package` links, including itself, without procedural macros (they run in the compiler).
fn linked(package: &str) -> BTreeSet<(String, String)> {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--offline",
            "--edges",
            "normal,no-proc-macro",
            "--prefix",
            "none",
            "--format",
            "{p}|{l}",
            "--package",
            package,
        ])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines()
        .map(|line| {
            let (package, license) = line.split_once('|').unwrap();
            let name = package.split_whitespace().next().unwrap();
            (name.to_string(), license.trim_end_matches(" (*)").to_string())
        })
        .collect()
}

#[test]
fn the_list_of_contained_libraries_is_complete() {
    let listed = include_str!("../../assets/third-party.txt");
    let own = |(name, _): &(String, String)| !name.starts_with("tiprub-");
    // Both libraries have the same dependencies.
    let contained = |package: &str| linked(package).into_iter().filter(own).collect::<Vec<_>>();
    let linked = contained("tiprub-fmi");
    assert_eq!(contained("tiprub-fmi-thermal"), linked);
    let lines: String = linked.into_iter().map(|(name, license)| format!("{name:<20} {license}\n")).collect();
    let (head, body) = listed.split_once("\n\n").unwrap();
    assert!(head.contains("licenses"));
    assert_eq!(
        body, lines,
        "packaging/assets/third-party.txt: replace the list after the blank line by the right side"
    );
}
