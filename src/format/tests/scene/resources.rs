//! The resources directory of an FMU, and scenes with their ROM files.

use std::fs;
use std::path::Path;

use nalgebra::DMatrix;
use tiprub_core::scene::rom::{ContactGrid, ContactNode, DisplacementFrame, RomExtras, Spin, Thermal};
use tiprub_core::scene::settings::{BodyMotion, LoadSettings, SpinSettings, StructureSettings};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_cosim::ThermalPatch;
use tiprub_format::{
    CHECKS_FILE, instantiation_token, load_resources, load_scene, packed_scene, read_rom, resource_files, write_checks,
    write_rom, write_scene,
};
use tiprub_test_models::{node, structure};

use crate::common;

fn rom() -> Rom {
    let stiffness = DMatrix::from_row_slice(2, 2, &[3e6, -1e6, -1e6, 4e6]);
    let map = DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let nodes = vec![node("leading_edge", [0.25, 0.0, 0.01], -0.1)];
    let rom = structure("blade", DMatrix::identity(2, 2), stiffness, map, nodes);
    Rom { sectors: 2, frame: DisplacementFrame::Cylindrical, damping_ratio: 0.001, ..rom }
}

fn scene() -> Scene {
    Scene { settings: common::complete_scene(), roms: vec![rom()] }
}

fn write(directory: &Path, files: &[(String, Vec<u8>)]) {
    for (name, content) in files {
        fs::write(directory.join(name), content).unwrap();
    }
}

#[test]
fn resources_round_trip_with_their_token() {
    let directory = tempfile::tempdir().unwrap();
    let mut scene = scene();
    scene.settings.structures[0].rom = "../elsewhere/some file.safetensors".into();
    for arrays in [true, false] {
        let files = resource_files(&scene, arrays);
        let names: Vec<_> = files.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["scene.toml", "rotor.rom.safetensors", "package.toml"]);
        write(directory.path(), &files);
        let read = load_resources(directory.path()).unwrap();
        assert_eq!(read.token, instantiation_token(&files));
        assert_eq!(read.fmi3_arrays, arrays);
        assert_eq!(read.scene.roms, scene.roms);
        let mut expected = scene.settings.clone();
        expected.structures[0].rom = "rotor.rom.safetensors".into();
        assert_eq!(read.scene.settings, expected);
        assert_eq!(resource_files(&read.scene, arrays), files, "the files are a fixed point");
    }
}

#[test]
fn token_is_a_guid_and_changes_with_every_edit() {
    let files = resource_files(&scene(), true);
    let token = instantiation_token(&files);
    let groups: Vec<_> = token.trim_matches(['{', '}']).split('-').map(str::len).collect();
    assert_eq!((token.len(), groups), (38, vec![8, 4, 4, 4, 12]));
    assert!(token.chars().all(|c| "{}-0123456789abcdef".contains(c)));
    assert_eq!(token, instantiation_token(&resource_files(&scene(), true)));
    assert_ne!(token, instantiation_token(&resource_files(&scene(), false)));
    let mut moved = files.clone();
    let byte = moved[0].1.remove(0);
    moved[0].0.push(char::from(byte));
    assert_ne!(token, instantiation_token(&moved), "names and contents are kept apart");
}

#[test]
fn structure_names_become_distinct_plain_file_names() {
    let mut scene = scene();
    scene.settings.structures.push(scene.settings.structures[0].clone());
    scene.roms.push(rom());
    scene.settings.structures[0].name = "../a/b".into();
    scene.settings.structures[1].name = "...A.b".into();
    let files = resource_files(&scene, true);
    assert_eq!(files[1].0, "___a_b.1.rom.safetensors");
    assert_eq!(files[2].0, "___A_b.2.rom.safetensors");
}

#[test]
fn rejects_damaged_resources_with_their_path() {
    let refused = |change: &dyn Fn(&Path), parts: &[&str]| {
        let directory = tempfile::tempdir().unwrap();
        write(directory.path(), &resource_files(&scene(), true));
        change(directory.path());
        let message = load_resources(directory.path()).unwrap_err().to_string();
        for part in parts {
            assert!(message.contains(part), "{part:?} is not in {message:?}");
        }
    };
    for name in ["scene.toml", "rotor.rom.safetensors", "package.toml"] {
        refused(&|path| fs::remove_file(path.join(name)).unwrap(), &[name, "cannot be read", "tiprub package"]);
        refused(&|path| fs::write(path.join(name), b"\xff\xfe\x00").unwrap(), &[name]);
    }
    // Files larger than their kind can be are rejected by their size, before a byte is read.
    for (name, size) in [("scene.toml", 9 << 20), ("rotor.rom.safetensors", 1 << 30), ("package.toml", 1 << 13)] {
        let grow = |path: &Path| fs::File::create(path.join(name)).and_then(|file| file.set_len(size)).unwrap();
        refused(&grow, &[name, "it exceeds the limit of"]);
    }
    refused(&|path| fs::remove_dir_all(path).unwrap(), &["directory not found"]);
    let package = |text: &'static str| move |path: &Path| fs::write(path.join("package.toml"), text).unwrap();
    refused(
        &package("format_version = 2\nfmi3_arrays = true"),
        &["package.toml", "found format_version 2, expected 1"],
    );
    refused(&package("fmi3_arrays = true"), &["found format_version none"]);
    refused(&package("format_version = 1\nfmi3_arrays = 3"), &["package.toml"]);
    refused(&package("format_version = 1\nfmi3_arrays = true\nx = 1"), &["package.toml", "x"]);
    for outside in ["/etc/passwd", "../x", "..", "a/b", "", "a\\b"] {
        let change = |path: &Path| {
            let mut settings = common::complete_scene();
            settings.structures[0].rom = outside.into();
            fs::write(path.join("scene.toml"), write_scene(&settings)).unwrap();
        };
        refused(&change, &["structure[1].rom"]);
    }
}

/// An instance that reads the resources finds the stored checks. If the file is missing or damaged, it finds none and
/// reports no error.
#[test]
fn stored_checks_are_read_unless_they_are_missing_or_damaged() {
    let directory = tempfile::tempdir().unwrap();
    let scene = tiprub_test_models::rub(2);
    let files = resource_files(&scene, false);
    write(directory.path(), &files);
    let mut packed = Simulation::new(packed_scene(&scene)).unwrap();
    packed.initialise(0.0).unwrap();
    let file = directory.path().join(CHECKS_FILE);
    fs::write(&file, write_checks(&packed.checks())).unwrap();
    let read = load_resources(directory.path()).unwrap();
    assert_eq!((&read.checks, &read.token), (&packed.checks(), &instantiation_token(&files)));
    // The scene that is read has the same keys.
    let (mut first, mut altered) = (Simulation::new(read.scene).unwrap(), packed.checks());
    first.initialise(0.0).unwrap();
    assert_eq!(first.checks(), packed.checks());
    altered.reverse();
    for content in [b"tiprub library of another release\n".to_vec(), Vec::new(), packed.checks()] {
        fs::write(&file, content).unwrap();
        assert!(load_resources(directory.path()).unwrap().checks.is_empty());
    }
    fs::write(&file, write_checks(&altered)).unwrap();
    let damaged = load_resources(directory.path()).unwrap();
    let mut again = Simulation::new(damaged.scene).unwrap();
    again.use_checks(&damaged.checks);
    again.initialise(0.0).unwrap();
    assert_eq!((again.checks(), again.warnings()), (first.checks(), first.warnings()));
    fs::File::create(&file).and_then(|file| file.set_len(1 << 30)).unwrap();
    assert!(load_resources(directory.path()).unwrap().checks.is_empty());
    fs::remove_file(&file).unwrap();
    assert!(load_resources(directory.path()).unwrap().checks.is_empty());
}

#[test]
fn scene_loads_roms_from_its_directory_or_built_in() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("my scene.toml");
    let mut settings = common::complete_scene();
    settings.structures[0].rom = "roms/blade.safetensors".into();
    fs::write(&path, write_scene(&settings)).unwrap();
    let none = |_: &str| None;
    let message = load_scene(&path, &none).unwrap_err().to_string();
    assert!(message.contains("blade.safetensors: cannot be read"), "{message}");
    assert!(message.contains("structure[1].rom in "), "{message}");

    fs::create_dir(directory.path().join("roms")).unwrap();
    fs::write(directory.path().join("roms/blade.safetensors"), write_rom(&rom())).unwrap();
    let scene = load_scene(&path, &none).unwrap();
    assert_eq!((&scene.settings, &scene.roms), (&settings, &vec![rom()]));

    settings.structures[0].rom = "builtin:blade".into();
    fs::write(&path, write_scene(&settings)).unwrap();
    let message = load_scene(&path, &none).unwrap_err().to_string();
    assert!(message.contains("there is no built-in model `blade`"), "{message}");
    let failing = |_: &str| Some(Err("out of memory".to_owned()));
    assert!(load_scene(&path, &failing).unwrap_err().to_string().contains("out of memory"));
    let known = |name: &str| (name == "blade").then(|| Ok(rom()));
    assert_eq!(load_scene(&path, &known).unwrap().roms, [rom()]);

    fs::write(&path, b"name = \"a\"\nx = \"\xff\"").unwrap();
    let message = load_scene(&path, &none).unwrap_err().to_string();
    assert!(message.contains("invalid UTF-8 in line 2"), "{message}");
    let message = load_scene(&directory.path().join("absent.toml"), &none).unwrap_err().to_string();
    assert!(message.contains("absent.toml: cannot be read"), "{message}");
    assert!(read_rom(&fs::read(&path).unwrap(), "scene").is_err());
}

#[test]
fn fmu_contains_no_data_of_disabled_features() {
    let mut scene = scene();
    let node = |index: u32| {
        let (along, i) = (index / 4, index % 4);
        let position = [0.25, f64::from(i) * std::f64::consts::FRAC_PI_2, 0.01 * f64::from(along)];
        ContactNode { name: format!("n{index}"), position, meridional_slope: 0.0, ..ContactNode::default() }
    };
    let plain = rom();
    let mut full = Rom {
        sectors: 1,
        contact_map: DMatrix::from_element(24, 2, 0.5),
        contact_nodes: (0..8).map(node).collect(),
        ..plain.clone()
    };
    let bare = full.clone();
    full.extras = RomExtras {
        spin: Some(Spin {
            stiffness_speed2: DMatrix::identity(2, 2),
            stiffness_speed4: DMatrix::zeros(2, 2),
            coriolis: DMatrix::zeros(2, 2),
            centrifugal_load: vec![1.0, 2.0],
            centrifugal_load_speed4: vec![0.1, 0.2],
            largest_speed: 2000.0,
        }),
        thermal: Some(Thermal {
            loads: DMatrix::from_element(2, 1, 3.0),
            patches: vec![ThermalPatch { angle: [0.0, 1.0], axial: [0.0, 0.01] }],
        }),
        grid: Some(ContactGrid { around: 4, along: 2, closed: true }),
        ..RomExtras::default()
    };
    full.validate().unwrap();
    let still = StructureSettings { name: "ring".into(), motion: BodyMotion::Still, ..StructureSettings::default() };
    scene.settings.structures.push(still);
    scene.roms = vec![full.clone(), full.clone()];
    let read = |scene: &Scene| -> Vec<Rom> {
        let files = resource_files(scene, true);
        (1..3).map(|index| read_rom(&files[index].1, "rom").unwrap()).collect()
    };
    let extras = |scene: &Scene| read(scene).into_iter().map(|rom| rom.extras).collect::<Vec<_>>();
    assert_eq!(read(&scene), [bare.clone(), bare.clone()]);
    assert_eq!(resource_files(&scene, true)[1].1, write_rom(&bare), "as if the extras had never been there");

    let only = |spin: bool, thermal: bool, grid: bool| {
        let RomExtras { spin: s, thermal: t, grid: g, .. } = full.extras.clone();
        let (spin, thermal, grid) = (s.filter(|_| spin), t.filter(|_| thermal), g.filter(|_| grid));
        RomExtras { spin, thermal, grid, ..RomExtras::default() }
    };
    for spin in [
        SpinSettings { stiffening: true, ..SpinSettings::default() },
        SpinSettings { growth: true, ..SpinSettings::default() },
        SpinSettings { coriolis: true, ..SpinSettings::default() },
    ] {
        let mut scene = scene.clone();
        scene.settings.structures[0].spin = spin;
        assert_eq!(extras(&scene), [only(true, false, false), only(false, false, false)]);
    }
    scene.settings.structures[1].thermal = true;
    assert_eq!(extras(&scene), [only(false, false, false), only(false, true, false)]);
    scene.settings.surfaces[0].structure = Some("ring".into());
    assert_eq!(extras(&scene), [only(false, false, false), only(false, true, true)]);
    scene.settings.surfaces[0].structure = None;
    scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 0.0, phase: 0.0 });
    assert_eq!(extras(&scene), [only(false, false, false), only(false, true, true)], "a load lies on the grid");
}
