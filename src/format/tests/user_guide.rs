//! The chapters on scene file and ROM file list exactly the keys, arrays and entries that the code defines, and their
//! examples are accepted.

mod common;
mod features;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use nalgebra::{Complex, DMatrix};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame};
use tiprub_core::scene::settings::{CuttingSettings, Preset, SceneSettings, Shape, TimeSettings, rules};
use tiprub_format::{ARRAYS, FIELDS, METADATA, SceneField, parse_scene, read_rom, write_scene};

fn chapter(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(name)
}

/// Compares the generated part `what` of a chapter; `UPDATE_SNAPSHOTS=1 cargo test` rewrites it.
#[track_caller]
fn compare(name: &str, what: &str, expected: &str) {
    let text = fs::read_to_string(chapter(name)).unwrap();
    let begin = format!("<!-- generated: {what} -->\n");
    let (before, rest) = text.split_once(&begin).expect("start mark");
    let (found, after) = rest.split_once("<!-- end of generated part -->").expect("end mark");
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        fs::write(chapter(name), format!("{before}{begin}{expected}<!-- end of generated part -->{after}")).unwrap();
    } else {
        let difference = expected.lines().zip(found.lines()).find(|(expected, found)| expected != found);
        assert_eq!(difference, None, "run with UPDATE_SNAPSHOTS=1 to write the chapter anew");
        assert_eq!(expected, found);
    }
}

/// Returns the paths of all keys in a scene, without indices.
fn keys(scene: &SceneSettings) -> BTreeSet<String> {
    fn collect(value: &toml::Value, path: &str, keys: &mut BTreeSet<String>) {
        match value {
            toml::Value::Table(table) => {
                for (key, value) in table {
                    let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                    keys.insert(path.clone());
                    collect(value, &path, keys);
                }
            }
            toml::Value::Array(array) => array.iter().for_each(|value| collect(value, path, keys)),
            _ => {}
        }
    }
    let mut keys = BTreeSet::new();
    collect(&toml::from_str(&write_scene(scene)).unwrap(), "", &mut keys);
    keys
}

#[test]
fn documented_keys_match_the_settings() {
    let mut scene = common::complete_scene();
    let mut found = keys(&scene);
    for shape in [
        Shape::Circular {},
        Shape::TwoLobe { depth: 1.0, width: 0.15, phase: 0.0 },
        Shape::Table { radius_change: vec![0.0; 4] },
    ] {
        scene.surfaces[0].shape = shape;
        found.extend(keys(&scene));
    }
    let silence = vec!["flutter".to_owned()];
    found.extend(keys(&SceneSettings { preset: Preset::Paper, accept_implausible: true, silence, ..scene.clone() }));
    let time = TimeSettings { scheme_reason: Some("because".into()), ..scene.time.clone() };
    found.extend(keys(&SceneSettings { time, ..scene.clone() }));
    found.extend(keys(&features::scene_with_every_feature()));
    found.extend(keys(&features::scene_with_a_free_master()));
    let mut cut = features::scene_with_every_feature();
    let coating = cut.contacts[0].coating.as_mut().unwrap();
    (coating.modulus, coating.yield_stress, coating.hardening) = (0.0, 0.0, 0.0);
    coating.cutting = Some(CuttingSettings { specific_energy: 1e8, normal_ratio: 1.0 });
    found.extend(keys(&cut));
    // Tables are not keys with values, except those inside other tables.
    for table in ["structure", "surface", "contact", "time", "outputs", "experiment"] {
        assert!(found.remove(table), "{table}");
    }
    let listed: BTreeSet<String> = FIELDS.iter().map(|field| field.path.to_owned()).collect();
    assert_eq!(listed, found);
}

#[test]
fn documented_choices_contain_every_scheme_and_solver() {
    let schemes = Scheme::ALL.map(|scheme| ("time.scheme", scheme.name()));
    for (path, name) in schemes.into_iter().chain(Solver::ALL.map(|solver| ("contact.solver", solver.name()))) {
        let field = FIELDS.iter().find(|field| field.path == path).unwrap();
        assert!(field.range().contains(&format!("`{name}`")), "{path} = {name}: {}", field.range());
    }
}

/// The guide contains every identifier of a warning.
#[test]
fn documented_warnings_match_the_core() {
    let mut text = String::from("\n| identifier | meaning | what to do |\n|---|---|---|\n");
    for topic in tiprub_cosim::warning::Topic::ALL {
        let _ = writeln!(text, "| `{}` | {} | {} |", topic.id(), topic.meaning(), topic.remedy());
    }
    compare("warnings.md", "warnings", &format!("{text}\n"));
}

/// Returns a scene with every key that has no default.
fn least() -> String {
    let mut scene: toml::Table = toml::from_str(&write_scene(&common::complete_scene())).unwrap();
    for field in FIELDS.iter().filter(|field| field.default.is_some()) {
        match field.table() {
            "" => drop(scene.remove(field.key())),
            table => match scene.get_mut(table) {
                Some(toml::Value::Array(array)) => drop(array[0].as_table_mut().unwrap().remove(field.key())),
                Some(toml::Value::Table(table)) => drop(table.remove(field.key())),
                _ => {}
            },
        }
    }
    toml::to_string(&scene).unwrap()
}

#[test]
fn only_keys_with_a_default_are_optional() {
    let text = least();
    parse_scene(&text, "least").unwrap();
    let outer = |field: &&SceneField| !field.table().contains('.');
    for field in FIELDS.iter().filter(outer).filter(|field| field.default.is_none()) {
        let lines: Vec<&str> = text.lines().collect();
        let header = match field.table() {
            "" => None,
            table => lines.iter().position(|line| line.trim_matches(['[', ']']) == table),
        };
        let start = header.unwrap_or(0);
        let key = |line: &&str| line.split(" = ").next() == Some(field.key());
        let line = start + lines[start..].iter().position(key).unwrap();
        let without = [&lines[..line], &lines[line + 1..]].concat().join("\n");
        let message = parse_scene(&without, "least").unwrap_err().to_string();
        assert!(message.contains(&format!("{}: missing", field.key())), "{}: {message}", field.path);
    }
}

#[test]
fn the_chapter_on_scenes_lists_every_key() {
    let mut text = String::from("| key | value | default | range | meaning |\n|---|---|---|---|---|\n");
    for field in FIELDS {
        let default = field.default.unwrap_or("*needed*");
        let _ = writeln!(
            text,
            "| `{}` | {} | {default} | {} | {} |",
            field.path,
            field.value,
            field.range(),
            field.description
        );
    }
    compare("scene-file.md", "keys", &text);
}

#[test]
fn scene_chapter_lists_all_dependencies_and_conflicts() {
    let mut text = String::from("| what | relation | because | remedy |\n|---|---|---|---|\n");
    for rule in rules::all() {
        let _ = writeln!(text, "| {} |", rule.columns().join(" | "));
    }
    compare("scene-file.md", "rules", &text);
}

#[test]
fn example_in_scene_chapter_is_a_valid_scene() {
    let chapter = fs::read_to_string(chapter("scene-file.md")).unwrap();
    let example = chapter.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let scene = parse_scene(example, "example").unwrap();
    assert_eq!(scene.structures[0].rom, "builtin:rotor37");
}

/// Replaces lines of the scene by those of a fragment; tables of a list are distinguished by their names.
fn overlay(scene: &mut toml::Table, fragment: toml::Table) {
    for (key, value) in fragment {
        match (scene.get_mut(&key), value) {
            (Some(toml::Value::Table(known)), toml::Value::Table(more)) => overlay(known, more),
            (Some(toml::Value::Array(known)), toml::Value::Array(more)) if more.iter().all(toml::Value::is_table) => {
                for entry in more {
                    let toml::Value::Table(entry) = entry else { unreachable!("all are tables") };
                    let same =
                        |other: &toml::Value| !entry.contains_key("name") || other.get("name") == entry.get("name");
                    match known.iter_mut().find(|other| same(other)) {
                        Some(toml::Value::Table(other)) => other.extend(entry),
                        _ => known.push(entry.into()),
                    }
                }
            }
            (_, value) => drop(scene.insert(key, value)),
        }
    }
}

/// Returns the TOML examples of a page.
fn examples(page: &str) -> Vec<String> {
    let blocks = page.split("```toml\n").skip(1).map(|text| text.split("```").next().unwrap());
    blocks.map(String::from).collect()
}

/// Returns name and TOML of the examples in the README and the chapters.
fn all_examples() -> Vec<(String, String)> {
    let chapters = fs::read_dir(chapter("")).unwrap().map(|entry| entry.unwrap().path());
    let mut pages: Vec<_> = chapters.filter(|path| path.extension().is_some_and(|kind| kind == "md")).collect();
    pages.push(chapter("../README.md"));
    let of_page = |path: PathBuf| {
        let found = examples(&fs::read_to_string(&path).unwrap());
        found.into_iter().map(move |example| (path.file_name().unwrap().to_string_lossy().into_owned(), example))
    };
    pages.into_iter().flat_map(of_page).collect()
}

/// An example with a name must be a complete scene. Any other one is an addition to a scene: to the first one of the
/// chapter on scenes.
#[test]
fn every_example_in_the_guide_is_a_valid_scene() {
    let base = examples(&fs::read_to_string(chapter("scene-file.md")).unwrap()).remove(0);
    let settings = parse_scene(&base, "base").unwrap();
    let base: toml::Table = toml::from_str(&base).unwrap();
    let (mut additions, mut whole) = (0, 0);
    for (page, example) in all_examples() {
        let fragment: toml::Table =
            toml::from_str(&example).unwrap_or_else(|error| panic!("{page}: {error}\n{example}"));
        if fragment.contains_key("variable") {
            // A plan of a sweep, which is tested with the command.
            continue;
        }
        if fragment.contains_key("name") {
            parse_scene(&example, &page).unwrap_or_else(|error| panic!("{error}\n{example}"));
            whole += 1;
            continue;
        }
        let mut scene = base.clone();
        overlay(&mut scene, fragment);
        let text = toml::to_string(&scene).unwrap();
        let changed = parse_scene(&text, &page).unwrap_or_else(|error| panic!("{error}\n{example}"));
        assert_ne!(changed, settings, "{page}: {example}");
        additions += 1;
    }
    assert_eq!((additions, whole), (15, 18));
}

#[test]
fn the_chapter_on_roms_lists_arrays_and_metadata() {
    let mut text = String::from("| array | shape | unit | needed | meaning |\n|---|---|---|---|---|\n");
    for array in ARRAYS {
        let needed = if array.required { "yes" } else { "no" };
        let _ = writeln!(
            text,
            "| `{}` | {} | {} | {needed} | {} |",
            array.name, array.shape, array.unit, array.description
        );
    }
    compare("rom-file.md", "arrays", &text);
    let mut text = String::from("| entry | default | meaning |\n|---|---|---|\n");
    for entry in METADATA {
        let default = match entry.default {
            None => "*needed*".to_owned(),
            Some("") => "empty".to_owned(),
            Some(value) => format!("`{value}`"),
        };
        let _ = writeln!(text, "| `{}` | {default} | {} |", entry.name, entry.description);
    }
    compare("rom-file.md", "metadata", &text);
}

/// The file was written by running the first Python example of the chapter (safetensors 0.8.0, NumPy 2.4.6).
#[test]
fn python_example_writes_a_valid_rom() {
    let bytes = include_bytes!("data/written_by_python.rom.safetensors");
    let rom = read_rom(bytes, "written_by_python").unwrap();
    assert_eq!((rom.name.as_str(), rom.sectors, rom.frame), ("blade", 12, DisplacementFrame::Cylindrical));
    assert_eq!(rom.mass, DMatrix::from_diagonal_element(3, 3, 1e-3));
    let stiffness = [9e5, 1e5, 0.0, 1e5, 4e4, 0.0, 0.0, 0.0, 2e5];
    assert_eq!(rom.stiffness, DMatrix::from_row_slice(3, 3, &stiffness));
    assert_eq!(rom.contact_map, DMatrix::identity(3, 3));
    let node = ContactNode {
        name: "mid_chord".into(),
        position: [0.25, 0.0, 0.02],
        meridional_slope: 0.0,
        ..ContactNode::default()
    };
    assert_eq!(rom.contact_nodes, [node]);
    assert_eq!(rom.damping_ratio.to_bits(), 0.002f64.to_bits());
}

/// Written by the second Python example of the chapter (safetensors 0.8.0, NumPy 2.4.6).
#[test]
fn python_example_writes_a_disk_of_coupled_sectors() {
    let rom = read_rom(include_bytes!("data/disk_by_python.rom.safetensors"), "disk_by_python").unwrap();
    assert_eq!((rom.sectors, rom.extras.harmonics.len(), rom.total_order()), (24, 12, 72));
    let (spring, half) = (2e4, std::f64::consts::PI / 24.0);
    for (harmonic, n) in rom.extras.harmonics.iter().zip(1..) {
        // The spring between neighbours: elongation per unit of the radial and tangential coordinate.
        let (sin, cos) = (2.0 * half * f64::from(n)).sin_cos();
        let phase = Complex::new(cos, sin);
        let d = [(phase + 1.0) * half.sin(), (phase - 1.0) * half.cos(), Complex::default()];
        let blade = [[9e5, 1e5, 0.0], [1e5, 4e4, 0.0], [0.0, 0.0, 2e5]];
        for (i, j) in (0..9).map(|entry| (entry / 3, entry % 3)) {
            let expected = d[i].conj() * d[j] * spring + blade[i][j];
            assert!((harmonic.stiffness[(i, j)] - expected).norm_sqr().sqrt() < 1e-9, "n = {n}, ({i}, {j})");
        }
        assert_eq!(harmonic.contact_map, DMatrix::identity(3, 3));
    }
}
