//! `tiprub inspect`.

use std::fs;

use crate::project::{Project, SCENE};

#[test]
fn inspect_names_fmus_truncated_at_any_length() {
    let project = Project::new();
    project.succeed(&["package", "scene.toml", "--fmi", "2", "-o", "x.fmu", "--library", "library.so"]);
    let bytes = fs::read(project.path("x.fmu")).unwrap();
    for share in 0..10 {
        fs::write(project.path("x.fmu"), &bytes[..bytes.len() * share / 10]).unwrap();
        let error = project.fail(&["inspect", "x.fmu"], 1);
        assert!(error.contains("x.fmu") && error.contains("truncated"), "{error}");
    }
    // One flipped byte inside the compressed library fails its checksum.
    let mut damaged = bytes.clone();
    let at = bytes.windows(3).position(|window| window == b".so").unwrap() + 5;
    damaged[at] ^= 0x10;
    fs::write(project.path("x.fmu"), damaged).unwrap();
    let error = project.fail(&["inspect", "x.fmu"], 1);
    assert!(error.contains("tiprub.so") && error.contains("damaged"), "{error}");
}

#[test]
fn inspect_shows_contact_nodes_and_settings() {
    let project = Project::new();
    let rom = project.succeed(&["inspect", "small.rom.safetensors"]);
    assert!(rom.contains("r 0.250000 m, θ 0.000000 rad, z 0.000000 m, slope 0.0000"), "{rom}");
    let scene = project.succeed(&["inspect", "scene.toml"]);
    for shown in ["100 rad/s (954.9 rpm)", "damping ratio from the ROM", "\"watched_sectors\":[1]"] {
        assert!(scene.contains(shown), "{shown}: {scene}");
    }
    let named = SCENE.replace("gap = 1e-3", "gap = 1e-3\nnodes = \"ti\"");
    fs::write(project.path("scene.toml"), named).unwrap();
    let scene = project.succeed(&["inspect", "scene.toml"]);
    assert!(scene.contains("rotor against casing: nodes ti..., gap 0.001 m"), "{scene}");
    assert!(scene.contains("\nstructure rotor, ROM small: One mass"), "{scene}");
}

#[test]
fn inspect_prints_costs_of_absent_effects_only_on_request() {
    let project = Project::new();
    project.succeed(&["package", "scene.toml", "--fmi", "3", "-o", "x.fmu", "--library", "library.so"]);
    for file in ["scene.toml", "x.fmu"] {
        let [short, all, measured] =
            [&["inspect", file][..], &["inspect", file, "--all"], &["inspect", file, "--measure"]]
                .map(|arguments| project.succeed(arguments));
        assert!(short.contains("effects left out here") && !short.contains(" costs +"), "{short}");
        assert!(short.ends_with("features that are off: --all\n"), "{short}");
        for long in [&all, &measured] {
            assert!(long.contains("\nfeatures that are off  ") && long.contains(" costs +"), "{long}");
            assert!(!long.contains("--all"), "{long}");
        }
        assert!(measured.contains("times the time per step") && !all.contains("times the time per step"));
    }
}

/// A scheme that is chosen when the scene is read goes with its reason into the FMU, whose scene names it.
#[test]
fn run_inspect_and_the_fmu_report_the_scheme_and_its_reason() {
    let project = Project::new();
    let reason = "modal-exact, the default with fixed steps, because";
    let run = project.succeed(&["run", "scene.toml", "--stop", "2e-3"]);
    assert!(run.contains(&format!("\nscheme: {reason}")), "{run}");
    let set = project.succeed(&["run", "scene.toml", "--stop", "2e-3", "--set", "scheme=central-difference"]);
    assert!(set.contains("\nscheme: set on the command line"), "{set}");
    project.succeed(&["package", "scene.toml", "--fmi", "3", "-o", "x.fmu", "--library", "library.so"]);
    for file in ["scene.toml", "x.fmu"] {
        let text = project.succeed(&["inspect", file]);
        assert!(text.contains(&format!("  scheme        {reason}")), "{file}: {text}");
    }
    let described = project.succeed(&["inspect", "x.fmu"]);
    assert!(described.contains("Time-stepping scheme; the start value is the default with fixed steps"), "{described}");
    fs::write(project.path("scene.toml"), SCENE.replace("[time]", "[time]\nscheme = \"modal-exact\"")).unwrap();
    assert!(project.succeed(&["inspect", "scene.toml"]).contains("  scheme        modal-exact, set in the scene"));
}

#[test]
fn reported_step_limits_match_rejection() {
    let project = Project::new();
    let limits = |friction: &str| {
        let scene = SCENE.replace("friction = 0.1", friction);
        fs::write(project.path("scene.toml"), scene).unwrap();
        let json: serde_json::Value =
            serde_json::from_str(&project.succeed(&["inspect", "scene.toml", "--json", "--quiet"])).unwrap();
        json["scene"]["roms"][0]["largest_stable_step"].clone()
    };
    let found = limits("friction = 0.1");
    assert!((found["central-difference"].as_f64().unwrap() / 2e-3 - 1.0).abs() < 1e-3, "{found}");
    assert_eq!(found["friction"], 0.1);
    for (factor, accepted) in [(0.99, true), (1.01, false)] {
        let step = factor * found["central-difference"].as_f64().unwrap();
        let scene = SCENE
            .replace("step = 1e-4", &format!("scheme = \"central-difference\"\nstep = {step:e}"))
            .replace("communication_step = 1e-3", &format!("communication_step = {step:e}"))
            .replace("amplitude = 2e-3", "amplitude = 2e-6");
        fs::write(project.path("scene.toml"), scene).unwrap();
        assert_eq!(project.run(&["run", "scene.toml", "--quiet"]).status.success(), accepted, "{step:e}");
    }
}
