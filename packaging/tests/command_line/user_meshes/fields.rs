//! Fields over time of user models: surface from the shape file, contact nodes without it.

use std::fs;

use serde_json::Value;

use super::{ModelProject, command, scene};

/// Returns the names of the parts at the first time.
fn parts(project: &ModelProject, directory: &str) -> Vec<String> {
    let entries = fs::read_dir(project.root.path().join(directory)).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut parts: Vec<String> = names.filter_map(|name| Some(name.strip_suffix("_000000.vtu")?.to_owned())).collect();
    parts.sort();
    parts
}

#[test]
fn surface_is_shown_if_its_shape_file_is_beside_the_rom() {
    let project = ModelProject::new(&["blade_hex20.inp"]);
    let reported = project.succeed(&command());
    assert_eq!(reported["files"]["shapes"], "blade.shapes.safetensors");
    project.write("blade.toml", scene());
    let run = "run blade.toml --stop 0.0005";
    project.succeed(&format!("{run} --csv alone.csv"));
    let fields = project.succeed(&format!("{run} --csv fields.csv --vtk all"));
    let read = |name: &str| fs::read(project.root.path().join(name)).unwrap();
    assert_eq!(read("alone.csv"), read("fields.csv"), "fields do not change the results");
    assert_eq!(fields["vtk"]["without_surface"], Value::Array(Vec::new()));
    assert_eq!(fields["vtk"]["files"].as_u64().unwrap(), 3 * (1 + fields["communication_steps"].as_u64().unwrap()));
    assert_eq!(parts(&project, "all"), ["casing_surface", "rotor", "rotor_contact"]);
    // A renamed file is found, a directory that is not empty is kept.
    let place = |name: &str| project.root.path().join(name);
    fs::rename(place("blade.shapes.safetensors"), place("other.shapes.safetensors")).unwrap();
    let error = project.fail(&format!("{run} --vtk all"), 2);
    assert!(error.contains("--vtk all: the directory is not empty") && error.contains("--force"), "{error}");
    project.succeed(&format!("{run} --vtk all --force --vtk-sectors 2,36 --vtk-every 20"));
    // Without it, the contact nodes are shown, and a warning says so.
    fs::remove_file(place("other.shapes.safetensors")).unwrap();
    let output = project.run(&format!("--json {run} --vtk tips --vtk-every 50"));
    let warnings = String::from_utf8_lossy(&output.stderr);
    assert!(warnings.contains("rotor is shown by its contact nodes only"), "{warnings}");
    let tips: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(tips["vtk"]["without_surface"], serde_json::json!(["rotor"]));
    assert_eq!(parts(&project, "tips"), ["casing_surface", "rotor_contact"]);
}

#[test]
fn rejects_wrong_options_of_fields() {
    let project = ModelProject::new(&["blade_hex20.inp"]);
    let reported = project.succeed(&format!("{} --no-shapes", command()));
    assert_eq!(reported["files"]["shapes"], Value::Null);
    assert!(!project.root.path().join("blade.shapes.safetensors").exists());
    project.write("blade.toml", scene());
    for (options, problem) in [
        ("--vtk fields --vtk-sectors 37", "--vtk-sectors: there is no sector 37. Give sectors from 1 to 36"),
        ("--vtk fields --vtk-sectors 1,1", "--vtk-sectors: sector 1 is given twice"),
        ("--vtk blade.toml", "--vtk blade.toml: is a file, not a directory"),
        ("--vtk fields --vtk-every 0", "--vtk-every"),
        ("--vtk-sectors 1", "--vtk"),
        ("--force", "--vtk"),
    ] {
        let error = project.fail(&format!("run blade.toml {options}"), 2);
        assert!(error.contains(problem), "{options}: {error}");
    }
    assert!(!project.root.path().join("fields").exists(), "nothing remains");
}
