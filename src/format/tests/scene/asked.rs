//! Keys of flexible casings, coatings, spin and heat: written only if used, rejected where they do not fit.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::*;
use tiprub_format::{FIELDS, parse_scene, write_scene};

use crate::common;
use crate::features;

#[test]
fn scene_with_every_feature_round_trips() {
    let scene = features::scene_with_every_feature();
    let text = write_scene(&scene);
    let again = parse_scene(&text, "written").unwrap();
    assert_eq!(again, scene);
    assert_eq!(write_scene(&again), text);
    // Compared bit by bit, which covers a negative zero.
    assert_eq!(again.structures[1].load.unwrap().phase.to_bits(), (-0.0_f64).to_bits());
}

#[test]
fn scene_with_free_master_round_trips() {
    let scene = features::scene_with_a_free_master();
    let text = write_scene(&scene);
    assert_eq!(parse_scene(&text, "written").unwrap(), scene);
    assert!(text.contains("motion = \"free\"") && text.contains("velocity = [0.0, -100.0, 0.5]"), "{text}");
    assert!(text.contains("nodes = \"left_\"") && !text.contains("gap ="), "{text}");
    assert_eq!(text.matches("rigid = true").count(), 1, "{text}");
    assert_eq!(text.matches("velocity").count(), 1, "{text}");
}

/// The message contains line and column of the problem, and the remedy.
#[test]
fn free_master_errors_report_their_location() {
    let text = write_scene(&features::scene_with_a_free_master());
    let reported = |from: &str, to: &str, parts: &[&str]| {
        assert!(text.contains(from), "{from:?} in:\n{text}");
        let changed = text.replacen(from, to, 1);
        let message = parse_scene(&changed, "free.toml").unwrap_err().to_string();
        assert!(message.starts_with("free.toml:"), "{message}");
        for part in parts {
            assert!(message.contains(part), "{part:?} is not in {message:?}");
        }
    };
    reported("motion = \"free\"", "motion = \"fre\"", &["structure[1].motion", "Did you mean `free`?"]);
    reported("[0.0, -100.0, 0.5]", "-100.0", &["structure[1].velocity: ", "list of 3 numbers, m/s"]);
    reported("[0.0, -100.0, 0.5]", "[0.0, -100.0]", &["structure[1].velocity: ", "list of 3 numbers, m/s"]);
    reported("[0.0, -100.0, 0.5]", "[0.0, -100.0, 0.5, 7.0]", &["structure[1].velocity: ", "list of 3 numbers, m/s"]);
    reported("[0.0, -100.0, 0.5]", "[0.0, nan, 0.5]", &["structure[1].velocity"]);
    reported("motion = \"free\"", "motion = \"rotating\"", &["structure[1].velocity: requires `motion = \"free\"`"]);
    reported("nodes = \"left_\"", "nodes = 3", &["contact[1].nodes: found integer `3`"]);
    reported(
        "nodes = \"left_\"\n",
        "",
        &[
            "contact[1].master: a structure with several contacts requires `contact.nodes`",
            "Set `nodes` in every contact",
        ],
    );
    reported(
        "nodes = \"left_\"",
        "nodes = \"left_\"\ngap = 1e-3",
        &["contact[1].gap: cannot be combined with a free master"],
    );
    reported("rigid = true", "rigid = 1", &["surface[2].rigid: found integer `1`, expected true or false"]);
    reported("rigid = true", "rigit = true", &["surface[2].rigit: unknown key", "Did you mean `rigid`?"]);
    reported("solver = \"lcp\"", "solver = \"film\"", &["Give all contacts the same solver"]);
    let parts = [
        "time.input_interpolation: cannot be combined with a scene with free masters only: such a scene has no inputs",
    ];
    reported("[time]", "[time]\ninput_interpolation = \"hold\"", &parts);
}

#[test]
fn disabled_features_are_not_written() {
    let text = write_scene(&common::complete_scene());
    let off = "velocity rigid nodes spin whirl axial_shift frequency_factors thermal load structure spline patches coating slave_heat_fraction wear \
               slave_displacement input_interpolation modal_amplitudes tip_displacements casing_forces support_reaction \
               wear_profile cutting";
    for key in off.split(' ') {
        assert!(!text.lines().any(|line| line.starts_with(&format!("{key} ="))), "{key} in:\n{text}");
        assert!(!text.contains(&format!(".{key}]")), "{key} in:\n{text}");
    }
    let mut scene = common::complete_scene();
    scene.structures[0].spin.growth = true;
    scene.surfaces[0].spline = Some(SplineSettings::default());
    scene.surfaces[0].patches = Some(PatchSettings { around: 8, along: 1 });
    let text = write_scene(&scene);
    for key in ["stiffening", "coriolis", "along", "closure", "interpolation"] {
        assert!(!text.contains(&format!("{key} =")), "{key} in:\n{text}");
    }
    assert_eq!(text.matches("around =").count(), 1, "that of the patches alone:\n{text}");
    assert_eq!(parse_scene(&text, "written").unwrap(), scene);
}

#[test]
fn defaults_of_the_inner_tables_are_as_documented() {
    let text = write_scene(&common::complete_scene());
    let with = |from: &str, to: &str| {
        assert_eq!(text.matches(from).count(), 1, "{from:?} in:\n{text}");
        parse_scene(&text.replace(from, to), "scene").unwrap()
    };
    let scene = with("moving = true", "moving = true\nspline = {}\npatches = { around = 3 }");
    assert_eq!(scene.surfaces[0].spline, Some(SplineSettings::default()));
    let documented = |path: &str| FIELDS.iter().find(|field| field.path == path).unwrap().default.unwrap();
    let spline = SplineSettings::default();
    assert_eq!(documented("surface.spline.around"), spline.around.to_string());
    assert_eq!(documented("surface.spline.along"), spline.along.to_string());
    assert_eq!((spline.closure, spline.interpolation), (Closure::Smooth, Interpolation::Spline));
    assert_eq!(scene.surfaces[0].patches, Some(PatchSettings { around: 3, along: 1 }));
    let scene = with("motion = \"rotating\"\nspeed = 1800.0", "motion = \"still\"\nload = { order = 0 }");
    assert_eq!(scene.structures[0].load, Some(LoadSettings { order: 0, amplitude: 0.0, phase: 0.0 }));
    let scene = with("motion = \"rotating\"", "spin = { growth = true }");
    assert_eq!(scene.structures[0].spin, SpinSettings { growth: true, ..SpinSettings::default() });
}

/// Checks that the error names the field and its line.
#[track_caller]
fn refused(change: impl FnOnce(&mut SceneSettings), parts: &[&str]) {
    let mut scene = features::scene_with_every_feature();
    change(&mut scene);
    let text = write_scene(&scene);
    let message = parse_scene(&text, "scene.toml").unwrap_err().to_string();
    let mut numbers = message.split(':').skip(1).map_while(|part| part.parse::<usize>().ok());
    let line = text.lines().nth(numbers.next().expect("a line number") - 1).unwrap();
    let path = message.split(": ").nth(1).unwrap();
    let key = path.rsplit('.').next().unwrap().split('[').next().unwrap();
    assert!(line.contains(key), "{message} points to {line:?}");
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
}

#[test]
fn rejects_rotor_settings_on_a_stationary_structure() {
    let rotor = |change: fn(&mut StructureSettings)| {
        move |scene: &mut SceneSettings| {
            let structure = &mut scene.structures[0];
            let name = structure.name.clone();
            *structure = StructureSettings { name, rom: "a".into(), motion: BodyMotion::Still, ..Default::default() };
            change(structure);
        }
    };
    let remedy = "set motion = \"rotating\"";
    refused(
        rotor(|s| s.spin.stiffening = true),
        &["structure[1].spin.stiffening: requires `motion = \"rotating\"`", remedy],
    );
    refused(rotor(|s| s.spin.growth = true), &["structure[1].spin.growth: requires `motion = \"rotating\"`", remedy]);
    refused(
        rotor(|s| s.spin.coriolis = true),
        &["structure[1].spin.coriolis: requires `motion = \"rotating\"`", remedy],
    );
    refused(rotor(|s| s.whirl = true), &["structure[1].whirl: requires `motion = \"rotating\"`", remedy]);
    refused(rotor(|s| s.axial_shift = true), &["structure[1].axial_shift: requires `motion = \"rotating\"`", remedy]);
}

#[test]
fn rejects_load_or_surface_on_a_rotating_structure() {
    let rotate = |scene: &mut SceneSettings| {
        scene.surfaces[0].structure = None;
        scene.structures[1].motion = BodyMotion::Rotating;
    };
    let remedy = "set motion = \"still\"";
    refused(rotate, &["structure[2].load: requires `motion = \"still\"`", remedy]);
    let parts = ["surface[1].structure: requires a structure with `motion = \"still\"`", "Name a stationary structure"];
    refused(|scene| scene.surfaces[0].structure = Some("rotor".into()), &parts);
    let parts = ["surface[1].structure: `rign` is not defined", "Use one of: ring"];
    refused(|scene| scene.surfaces[0].structure = Some("rign".into()), &parts);
    refused(
        |scene| drop(scene.structures.pop()),
        &["surface[1].structure: `ring` is not defined", "Add a [[structure]] with motion = \"still\""],
    );
    let parts = ["surface[1].structure: cannot be combined with a structure that is the master of a contact"];
    refused(|scene| scene.contacts[0].master = "ring".into(), &parts);
}

#[test]
fn checks_ranges_of_structure_and_surface_values() {
    for factor in [0.49, 2.01, f64::NAN] {
        let parts = ["structure[1].frequency_factors[2]", "between 0.5 and 2"];
        refused(|scene| scene.structures[0].frequency_factors = vec![1.0, factor], &parts);
    }
    let load = |amplitude, phase| Some(LoadSettings { order: 0, amplitude, phase });
    let parts = ["structure[2].load.amplitude: inf"];
    refused(|scene| scene.structures[1].load = load(f64::INFINITY, 0.0), &parts);
    refused(|scene| scene.structures[1].load = load(0.0, f64::NAN), &["structure[2].load.phase: NaN"]);
    for (around, along, parts) in [
        (3, 5, ["surface[1].spline.around: 3", "from 4 to 2000"]),
        (2001, 5, ["surface[1].spline.around: 2001", "from 4 to 2000"]),
        (90, 1, ["surface[1].spline.along: 1", "from 2 to 200"]),
        (90, 201, ["surface[1].spline.along: 201", "from 2 to 200"]),
    ] {
        let spline = Some(SplineSettings { around, along, ..SplineSettings::default() });
        refused(|scene| scene.surfaces[0].spline = spline, &parts);
    }
    let patches = |around, along| {
        move |scene: &mut SceneSettings| {
            scene.surfaces[0].patches = Some(PatchSettings { around, along });
        }
    };
    refused(patches(0, 2), &["surface[1].patches.around: 0", "from 1 to 10000"]);
    refused(patches(2, 0), &["surface[1].patches.along: 0", "from 1 to 10000"]);
    refused(patches(101, 100), &["surface[1].patches: 101 around x 100 along exceed the limit of 10000 patches"]);
}

#[test]
fn checks_ranges_of_coating_values() {
    let coating = |change: fn(&mut CoatingSettings)| {
        move |scene: &mut SceneSettings| change(scene.contacts[0].coating.as_mut().unwrap())
    };
    refused(coating(|c| c.thickness = 0.0), &["contact[1].coating.thickness: 0", "between 1e-9 and 0.1"]);
    refused(coating(|c| c.thickness = 0.11), &["contact[1].coating.thickness: 0.11", "between 1e-9 and 0.1"]);
    refused(coating(|c| c.modulus = -1.0), &["contact[1].coating.modulus: -1"]);
    refused(coating(|c| c.modulus = f64::INFINITY), &["contact[1].coating.modulus: inf"]);
    refused(coating(|c| c.modulus = 2e13), &["contact[1].coating.modulus", "above 0 and at most 1e13"]);
    refused(coating(|c| c.yield_stress = -1.0), &["contact[1].coating.yield_stress: -1"]);
    refused(coating(|c| c.yield_stress = f64::NAN), &["contact[1].coating.yield_stress: NaN"]);
    refused(coating(|c| c.hardening = -1.0), &["contact[1].coating.hardening: -1"]);
    refused(coating(|c| c.hardening = 1e14), &["contact[1].coating.hardening"]);
    refused(coating(|c| c.cells_around = 1), &["contact[1].coating.cells_around: 1", "from 2 to 10000000"]);
    refused(coating(|c| c.cells_along = 0), &["contact[1].coating.cells_along: 0"]);
    let parts = ["contact[1].coating: 1000 around x 10001 along exceed the limit of 10000000 cells"];
    refused(coating(|c| c.cells_along = 10_001), &parts);
    refused(coating(|c| (c.cells_around, c.cells_along) = (10_000_000, 10_000_000)), &["exceed the limit"]);
    for share in [-0.1, 1.1, f64::NAN] {
        let parts = ["contact[1].slave_heat_fraction", "between 0 and 1"];
        refused(|scene| scene.contacts[0].slave_heat_fraction = Some(share), &parts);
    }
}

#[test]
fn rejects_mutually_exclusive_features() {
    let parts = ["contact[1].solver: a solver other than `lcp` cannot be combined with a coating", "solver = \"lcp\""];
    for solver in Solver::ALL.into_iter().filter(|solver| *solver != Solver::Lcp) {
        refused(|scene| scene.contacts[0].solver = solver, &parts);
    }
    let parts =
        ["time.scheme: `massless-boundary` cannot be combined with `structure.spin.coriolis`", "\"modal-exact\""];
    refused(|scene| scene.time.scheme = Scheme::MasslessBoundary, &parts);
    // Coriolis force only.
    let mut scene = features::scene_with_every_feature();
    scene.time.scheme = Scheme::MasslessBoundary;
    scene.structures[0].spin.coriolis = false;
    parse_scene(&write_scene(&scene), "scene").unwrap();
    (scene.contacts[0].coating, scene.outputs.wear, scene.outputs.wear_profile) = (None, false, false);
    scene.contacts[0].solver = Solver::Coulomb;
    parse_scene(&write_scene(&scene), "scene").unwrap();
}

/// The coating is unchanged by a round trip without the properties of yielding, which it does not require.
#[test]
fn cutting_coating_is_written_without_plasticity_values() {
    let mut scene = features::scene_with_every_feature();
    let coating = scene.contacts[0].coating.as_mut().unwrap();
    (coating.modulus, coating.yield_stress, coating.hardening) = (0.0, 0.0, 0.0);
    coating.contact_width = None;
    coating.cutting = Some(CuttingSettings { specific_energy: 3e8, normal_ratio: 0.7 });
    let text = write_scene(&scene);
    assert!(["modulus", "yield_stress", "hardening"].iter().all(|key| !text.contains(key)), "{text}");
    assert!(text.contains("specific_energy = 3") && text.contains("normal_ratio = 0.7"), "{text}");
    assert_eq!(parse_scene(&text, "scene").unwrap(), scene);
}

#[test]
fn rejects_outputs_of_missing_features() {
    let parts = ["outputs.wear: requires `contact.coating`", "Add a `coating` to the contact"];
    refused(|scene| scene.contacts[0].coating = None, &parts);
    let parts =
        ["outputs.slave_displacement: requires `surface.structure`", "Give the surface around a rotor a `structure`"];
    let rigid = |scene: &mut SceneSettings| {
        scene.surfaces[0].structure = None;
        scene.structures.truncate(1);
    };
    refused(rigid, &parts);
    let parts = ["structure[2].name: `", "is not part of any contact", "or remove it"];
    refused(|scene| scene.surfaces[0].structure = None, &parts);
}

#[test]
fn largest_and_smallest_values_are_accepted() {
    let mut scene = features::scene_with_every_feature();
    scene.structures[0].frequency_factors = vec![0.5, 2.0];
    scene.structures[1].load = Some(LoadSettings { order: u32::MAX, amplitude: -1e12, phase: 1e6 });
    scene.surfaces[0].spline = Some(SplineSettings { around: 2000, along: 200, ..SplineSettings::default() });
    scene.surfaces[0].patches = Some(PatchSettings { around: 100, along: 100 });
    scene.contacts[0].slave_heat_fraction = Some(1.0);
    let coating = scene.contacts[0].coating.as_mut().unwrap();
    (coating.yield_stress, coating.hardening, coating.thickness, coating.modulus) = (0.0, 0.0, 0.1, 1e13);
    (coating.cells_around, coating.cells_along) = (10_000_000, 1);
    parse_scene(&write_scene(&scene), "scene").unwrap();
    scene.surfaces[0].spline = Some(SplineSettings { around: 4, along: 2, ..SplineSettings::default() });
    scene.contacts[0].slave_heat_fraction = Some(0.0);
    parse_scene(&write_scene(&scene), "scene").unwrap();
}

#[test]
fn rejects_malformed_or_incomplete_inner_tables() {
    let text = write_scene(&common::complete_scene());
    let reported = |from: &str, to: &str, parts: &[&str]| {
        assert_eq!(text.matches(from).count(), 1, "{from:?} in:\n{text}");
        let message = parse_scene(&text.replace(from, to), "scene.toml").unwrap_err().to_string();
        assert!(message.starts_with("scene.toml:"), "{message}");
        for part in parts {
            assert!(message.contains(part), "{part:?} is not in {message:?}");
        }
    };
    let motion = "motion = \"rotating\"";
    reported(motion, "spin = true", &["structure[1].spin: found boolean, expected a table", "{ stiffening = true }"]);
    reported(motion, "load = [2, 1.0]", &["structure[1].load: found array, expected a table", "{ order = 2"]);
    reported(motion, "load = {}", &["structure[1].load.order: missing", "to `load` of [[structure]]: whole number"]);
    reported(motion, "spin = { growt = true }", &["structure[1].spin.growt: unknown key", "Did you mean `growth`?"]);
    reported(motion, "spin = { growth = 1 }", &["structure[1].spin.growth: found integer `1`, expected true or false"]);
    reported(motion, "thermal = 1.5", &["structure[1].thermal", "expected true or false"]);
    reported(motion, "order = 3", &["structure[1].order: unknown key", "belongs to `load` of [[structure]]"]);
    let moving = "moving = true";
    reported(
        moving,
        "spline = 72",
        &["surface[1].spline: found integer, expected a table", "{ around = 72, along = 5 }"],
    );
    reported(moving, "spline = { around = -1 }", &["surface[1].spline.around: found integer `-1`, expected a"]);
    reported(moving, "spline = { closure = \"smoth\" }", &["surface[1].spline.closure", "Did you mean `smooth`?"]);
    reported(moving, "patches = {}", &["surface[1].patches.around: missing", "to `patches` of [[surface]]"]);
    reported(moving, "structure = 3", &["surface[1].structure: found integer `3`"]);
    let meridian = "meridian = \"contour\"";
    reported(meridian, "coating = \"thick\"", &["contact[1].coating: found string, expected a table"]);
    for key in ["thickness", "modulus", "yield_stress", "hardening", "cells_around", "cells_along"] {
        let all =
            "thickness = 5e-3, modulus = 1e9, yield_stress = 1e7, hardening = 1e8, cells_around = 100, cells_along = 9";
        let rest: Vec<&str> = all.split(", ").filter(|item| !item.starts_with(key)).collect();
        let coating = format!("coating = {{ {} }}", rest.join(", "));
        let missing = format!("contact[1].coating.{key}: missing");
        reported(meridian, &coating, &[&missing, &format!("Add `{key} = ...` to `coating` of [[contact]]")]);
    }
}
