//! Scene files: round trips, and the message for every kind of mistake.

use proptest::prelude::*;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::*;
use tiprub_format::{load_settings, parse_scene, write_scene};

use crate::common;

const GOOD: &str = r#"name = "demo"
[[structure]]
name = "rotor"
rom = "rotor.safetensors"
[[surface]]
name = "casing"
shape = { kind = "lobes", amplitude = 1e-4, order = 2 }
[[contact]]
master = "rotor"
slave = "casing"
gap = 1e-3
[time]
step = 1e-6
[experiment]
stop = 1.0
communication_step = 1e-3
"#;

#[track_caller]
fn refused(from: &str, to: &str, place: &str, parts: &[&str]) {
    assert_eq!(GOOD.matches(from).count(), 1, "{from:?}");
    let error = parse_scene(&GOOD.replace(from, to), "demo.toml").unwrap_err();
    assert_eq!(error.place.as_deref(), Some(&*format!("demo.toml{place}")));
    let message = error.to_string();
    let start = format!("demo.toml{place}: ");
    assert!(message.starts_with(&start), "{start:?} does not start {message:?}");
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
}

#[test]
fn defaults_are_as_documented() {
    let scene = parse_scene(GOOD, "demo.toml").unwrap();
    assert_eq!(scene.structures[0].motion, BodyMotion::Rotating);
    assert_eq!(scene.structures[0].damping_ratio, None);
    assert_eq!(scene.contacts[0].solver, Solver::Lcp);
    assert_eq!(scene.contacts[0].meridian, Meridian::Contour);
    assert_eq!(scene.time.scheme, Scheme::Galerkin);
    assert_eq!(scene.outputs, OutputSettings::default());
    assert_eq!(scene.surfaces[0].shape, Shape::Lobes { amplitude: 1e-4, order: 2, phase: 0.0 });
}

/// Scene files that are too large are rejected. A parser needs far more memory for short tables than their text has
/// bytes; a measured casing is long and is still accepted.
#[test]
fn rejects_oversized_scene_files() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("scene.toml");
    std::fs::write(&path, "[[structure]]\n".repeat(80_000)).unwrap();
    let error = load_settings(&path).unwrap_err().to_string();
    assert!(error.contains("exceeds the limit of 1048576 bytes") && error.contains("scene.toml"), "{error}");
    let table = format!("kind = \"table\", radius_change = [{}]", "1.2345678901234e-5, ".repeat(50_000));
    let measured = GOOD.replace("kind = \"lobes\", amplitude = 1e-4, order = 2", &table);
    std::fs::write(&path, &measured).unwrap();
    assert_eq!(load_settings(&path).unwrap(), parse_scene(&measured, "scene.toml").unwrap());
}

#[test]
fn paper_preset_sets_scheme_and_solver_and_rejects_others() {
    let preset = GOOD.replace("name = \"demo\"", "name = \"demo\"\npreset = \"paper\"");
    let scene = parse_scene(&preset, "demo.toml").unwrap();
    assert_eq!((scene.time.scheme, scene.contacts[0].solver), (Scheme::CentralDifference, Solver::Film));
    let explicit = preset.replace("step = 1e-6", "step = 1e-6\nscheme = \"central-difference\"");
    assert_eq!(parse_scene(&explicit, "demo.toml").unwrap(), scene);
    assert_eq!(parse_scene(&write_scene(&scene), "again").unwrap(), scene);
    for (key, line) in [("time.scheme", "step = 1e-6\nscheme = \"modal-exact\""), ("contact[1].solver", "step = 1e-6")]
    {
        let mut text = preset.replace("step = 1e-6", line);
        if key.starts_with("contact") {
            text = text.replace("gap = 1e-3", "gap = 1e-3\nsolver = \"lcp\"");
        }
        let reported = parse_scene(&text, "demo.toml").unwrap_err().to_string();
        assert!(reported.contains(key) && reported.contains("the scheme and the solver of the paper"), "{reported}");
    }
}

#[test]
fn unknown_keys_get_a_suggestion() {
    refused("gap =", "gpa =", ":11:1", &["contact[1].gpa: unknown key", "Did you mean `gap`?", "`sector_gaps`"]);
    refused("order = 2", "ordr = 2", ":7:45", &["surface[1].shape.ordr: unknown key", "Did you mean `order`?"]);
    refused("[[contact]]", "[[contacts]]", ":8:3", &["contacts: unknown key", "Did you mean `contact`?"]);
    refused("step = 1e-6", "step = 1e-6\nfriction = 0.1", ":14:1", &["time.friction", "belongs to [[contact]]"]);
    refused(
        "kind = \"lobes\", ",
        "kind = \"circular\", ",
        ":7:30",
        &[
            "surface[1].shape.amplitude: unknown key",
            "belongs to another `kind` of `shape`",
            "No further keys are accepted",
        ],
    );
}

#[test]
fn invalid_keywords_get_a_suggestion() {
    let list = ["surface[1].shape.kind", "\"lobs\" is not an accepted value", "Did you mean `lobes`?", "`two-lobe`"];
    refused("\"lobes\"", "\"lobs\"", ":7:18", &list);
    refused("step = 1e-6", "scheme = \"modal_exact\"\nstep = 1", ":13:10", &["time.scheme", "`modal-exact`?"]);
    let list = ["time.input_interpolation", "Did you mean `hold`?", "`ramp`"];
    refused("step = 1e-6", "input_interpolation = \"held\"\nstep = 1", ":13:23", &list);
}

#[test]
fn missing_keys_are_named_with_their_unit_and_range() {
    refused(
        "gap = 1e-3\n",
        "",
        ":8:1",
        &[
            "contact[1].gap: missing",
            "to [[contact]]",
            "radial tip clearance (m) to [[contact]], above 0 and at most a tenth",
        ],
    );
    refused("name = \"demo\"\n", "", "", &["name: missing", "before the first [table]"]);
    let experiment = "[experiment]\nstop = 1.0\ncommunication_step = 1e-3\n";
    refused(experiment, "", "", &["experiment: missing", "Add a table [experiment]"]);
    refused("amplitude = 1e-4, ", "", ":7:9", &["surface[1].shape.amplitude: missing", "`shape` of [[surface]]"]);
    refused("kind = \"lobes\", ", "", ":7:9", &["surface[1].shape.kind: missing", "`two-lobe`"]);
}

#[test]
fn wrong_types_report_found_and_expected_type() {
    refused("gap = 1e-3", "gap = \"1 mm\"", ":11:7", &["contact[1].gap: found string \"1 mm\", expected a number"]);
    let both = ["surface[1].shape.order: found integer `-2`, expected a non-negative whole number", "number of lobes"];
    refused("order = 2", "order = -2", ":7:53", &both);
    refused("order = 2", "order = 2.5", ":7:53", &["surface[1].shape.order: found floating point `2.5`"]);
    refused("order = 2", "order = 2, phase = \"a\"", ":7:64", &["surface[1].shape.phase: found string \"a\""]);
    refused("[time]", "[outputs]\nwatched_sectors = [1, -2]\n[time]", ":13:23", &["outputs.watched_sectors[2]"]);
    refused("[[contact]]", "[contact]", ":8:2", &["contact: found table, expected a list", "Write [[contact]]"]);
    refused("[time]", "[[time]]", ":12:3", &["time: found array, expected a single table", "Write [time]"]);
    for (list, problem) in [
        ("experiment = [0.0, 1.0, 1e-3]", "experiment: found array, expected a single table"),
        ("structure = [[\"rotor\", \"rotor.safetensors\"]]", "structure: found array, expected a list of tables"),
    ] {
        let error = parse_scene(&format!("name = \"demo\"\n{list}\n"), "demo.toml").unwrap_err().to_string();
        assert!(error.starts_with(&format!("demo.toml:2:1: {problem}")), "{error}");
    }
}

#[test]
fn syntax_errors_report_their_location() {
    refused("step = 1e-6", "step = ", ":13:8", &["TOML syntax"]);
    refused("step = 1e-6", "step = 1e-6\nstep = 1e-7", ":14:1", &["TOML syntax: duplicate key"]);
    let error = parse_scene("name = \"ü\" x", "u.toml").unwrap_err().to_string();
    assert!(error.starts_with("u.toml:1:12: "), "columns count characters: {error}");
}

#[test]
fn rejects_shapes_that_are_not_tables() {
    let shape = "{ kind = \"lobes\", amplitude = 1e-4, order = 2 }";
    refused(shape, "[\"lobes\", 1e-4, 2, 0.0]", ":7:1", &["surface[1].shape: found array, expected a table"]);
    refused(shape, "\"circular\"", ":7:1", &["surface[1].shape: found string", "{ kind = \"circular\" }"]);
}

#[test]
fn out_of_range_values_report_their_location() {
    refused("gap = 1e-3", "gap = -1e-3", ":11:1", &["contact[1].gap: -0.001", "> 0"]);
    refused("gap = 1e-3", "gap = nan", ":11:1", &["contact[1].gap: NaN"]);
    refused("gap = 1e-3", "gap = 1\nsector_gaps = [1, inf]", ":12:1", &["contact[1].sector_gaps: inf"]);
    refused("step = 1e-6", "step = 0", ":13:1", &["time.step: 0", "between 1e-12 and 1"]);
    refused("order = 2", "order = 0", ":7:45", &["surface[1].shape.order: 0 lobes"]);
    refused("stop = 1.0", "start = 2.0\nstop = 1.0", ":16:1", &["experiment.stop: 1 s is not after"]);
    refused("master = \"rotor\"", "master = \"disk\"", ":9:1", &["contact[1].master: `disk`", "rotor"]);
    refused("name = \"casing\"", "name = \"rotor\"", ":6:1", &["surface[1].name: `rotor` is used by two"]);
    refused("\"demo\"", "\"rotor 37\"", ":1:1", &["name: `rotor 37`", "letters, digits"]);
}

#[test]
fn arbitrary_text_never_panics() {
    for text in
        ["", "\n", "[", "[[structure]]", "structure = 3", "time = []", "shape", "\u{feff}", "name = nan", "a.b.c = 1"]
    {
        assert!(parse_scene(text, "t").is_err(), "{text:?}");
    }
    // Every line removed, and every line cut in half.
    for line in GOOD.lines() {
        let _ = parse_scene(&GOOD.replace(line, ""), "t");
        let half = line.char_indices().nth(line.len() / 2).map_or(0, |(index, _)| index);
        let _ = parse_scene(&GOOD.replace(line, &line[..half]), "t");
    }
}

proptest! {
    #[test]
    fn random_edits_of_a_scene_never_panic(at in any::<prop::sample::Index>(), length in 0..12usize, text in "[\\PC\n\"\\[\\]{}=.]{0,6}") {
        let start = at.index(GOOD.len());
        let end = (start + length).min(GOOD.len());
        let changed = format!("{}{text}{}", &GOOD[..start], &GOOD[end..]);
        if let Err(error) = parse_scene(&changed, "demo.toml") {
            prop_assert!(error.to_string().starts_with("demo.toml:"), "{}", error);
        }
    }

    #[test]
    fn scene_round_trips(
        name in "[a-z][a-z0-9_]{0,8}",
        description in any::<String>(),
        numbers in prop::array::uniform8(1e-12..1e3f64),
        order in 1..50u32,
        kind in 0..4usize,
        choices in prop::array::uniform6(any::<bool>()),
        watched in prop::collection::hash_set(1..36usize, 0..4),
    ) {
        let mut scene = common::complete_scene();
        scene.name = name;
        scene.description = description;
        scene.structures[0].damping_ratio = choices[0].then_some(numbers[0] / 1e4);
        scene.structures[0].speed = numbers[1];
        scene.surfaces[0].shape = match kind {
            0 => Shape::Circular {},
            1 => Shape::Lobes { amplitude: numbers[2], order, phase: -numbers[3] },
            2 => Shape::TwoLobe { depth: numbers[2], width: 1e-3 + numbers[3] / 1e4, phase: -0.0 },
            _ => Shape::Table { radius_change: numbers.to_vec() },
        };
        scene.contacts[0].gap = numbers[4];
        scene.contacts[0].sector_gaps.clear();
        scene.contacts[0].solver = if choices[1] { Solver::Film } else { Solver::Lcp };
        scene.time.scheme = if choices[2] { Scheme::CentralDifference } else { Scheme::ModalExact };
        scene.time.step = numbers[5].min(1.0);
        scene.outputs.watched_sectors = watched.into_iter().collect();
        scene.outputs.nodal_diameters = choices[3].then_some(4);
        scene.experiment.start = -numbers[7];
        scene.experiment.stop = numbers[6];
        scene.experiment.communication_step = numbers[7];
        let text = write_scene(&scene);
        let again = parse_scene(&text, "written").unwrap();
        prop_assert_eq!(&again, &scene);
        prop_assert_eq!(write_scene(&again), text);
    }
}
