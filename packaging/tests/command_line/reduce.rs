//! `tiprub reduce`.

use std::fs;

use crate::project::Project;

#[test]
fn reduction_replaces_a_rom_only_by_force() {
    let project = Project::new();
    let coarse = ["reduce", "rotor37", "--mesh", "4x1x6", "-o", "blade.rom.safetensors", "--quiet"];
    project.succeed(&coarse);
    let before = fs::read(project.path("blade.rom.safetensors")).unwrap();
    let poor = [&coarse[..], &["--modes", "0"]].concat();
    let error = project.fail(&poor, 1);
    assert!(error.contains("blade.rom.safetensors") && error.contains("--force"), "{error}");
    // Reported before the work, which would reject this mesh; for the default output file and for other files.
    fs::write(project.path("rotor37.rom.safetensors"), "kept").unwrap();
    for line in [
        "reduce rotor37 --mesh 1x1x1 -o blade.rom.safetensors",
        "reduce rotor37 --mesh 1x1x1",
        "reduce rotor37 --mesh 1x1x1 -o new.rom.safetensors --inp scene.toml",
        "reduce rotor37 --mesh 1x1x1 -o new.rom.safetensors --vtk scene.toml",
    ] {
        let error = project.fail(&line.split(' ').collect::<Vec<_>>(), 1);
        assert!(error.contains("already exists") && error.contains("--force"), "{line}: {error}");
    }
    fs::remove_file(project.path("rotor37.rom.safetensors")).unwrap();
    assert_eq!(fs::read(project.path("blade.rom.safetensors")).unwrap(), before);
    let forced = project.run(&[&poor[..], &["--force", "--json"]].concat());
    let stderr = String::from_utf8(forced.stderr).unwrap();
    assert!(forced.status.success() && stderr.contains("warning: ROM") && stderr.contains("eq. 13"), "{stderr}");
    let json: serde_json::Value = serde_json::from_slice(&forced.stdout).unwrap();
    assert_eq!(json["warnings"].as_array().unwrap().len(), stderr.matches("warning: ").count());
    assert_ne!(fs::read(project.path("blade.rom.safetensors")).unwrap(), before);
}

#[test]
fn reduces_a_casing_and_rejects_options_of_other_models() {
    let project = Project::new();
    let coarse = ["reduce", "casing", "--mesh", "24x1x8", "--fixed-interface-modes", "48", "--modes", "36"];
    let ring = ["--contact-grid", "8x3", "--patches", "4x2", "--material", "titanium", "--high-flange", "none"];
    let files = ["--inp", "ring.inp", "--json", "--quiet"];
    let text = project.succeed(&[&coarse[..], &ring[..], &files[..]].concat());
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["rom"]["name"], "casing");
    assert_eq!(json["rom"]["contact_nodes"].as_array().unwrap().len(), 24);
    let order = json["rom"]["order"].as_u64().unwrap();
    assert!((36 + 72..=36 + 72 + 8).contains(&order), "{order}");
    assert!(json["rom"]["origin"].as_str().unwrap().contains("titanium"), "{text}");
    assert!(project.path("casing.rom.safetensors").is_file());
    let input = fs::read_to_string(project.path("ring.inp")).unwrap();
    assert!(input.contains("C3D20") && input.contains("CLAMPED, 1, 3"));
    let error = project.fail(&["reduce", "rotor37", "--thickness", "0.003"], 2);
    assert!(error.contains("unexpected argument '--thickness'"), "{error}");
    let error = project.fail(&["reduce", "casing", "--contact-nodes", "3"], 2);
    assert!(error.contains("unexpected argument '--contact-nodes'"), "{error}");
    let error = project.fail(&["reduce", "casing", "--mesh", "30x1x8", "--force"], 1);
    assert!(error.contains("not a multiple of the 24 contact nodes"), "{error}");
}
