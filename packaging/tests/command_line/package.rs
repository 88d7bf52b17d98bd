//! `tiprub package`.

use std::{fs, process::Command};

use nalgebra::DMatrix;
use tiprub_core::scene::rom::Spin;

use crate::project::{Project, SCENE};

#[test]
fn a_package_is_complete_reproducible_and_inspectable() {
    let project = Project::new();
    project.succeed(&["package", "scene.toml", "-o", "a", "--library", "library.so", "--quiet"]);
    project.succeed(&["package", "scene.toml", "-o", "b", "--library", "library.so", "--quiet"]);
    for (version, own) in [
        (2, ["model.png", "binaries/linux64/tiprub.so"]),
        (3, ["terminalsAndIcons/icon.png", "binaries/x86_64-linux/tiprub.so"]),
    ] {
        let name = format!("small_fmi{version}.fmu");
        let bytes = fs::read(project.path("a").join(&name)).unwrap();
        assert_eq!(bytes, fs::read(project.path("b").join(&name)).unwrap(), "same inputs, same bytes");
        let entries = raw_entries(&bytes);
        assert_eq!(entries[0], "modelDescription.xml");
        let common = [
            "resources/scene.toml",
            "resources/rotor.rom.safetensors",
            "documentation/index.html",
            "documentation/tiprub_ref.csv",
            "documentation/licenses/license.txt",
            "documentation/licenses/LICENSE-MIT.txt",
            "documentation/licenses/LICENSE-APACHE.txt",
            "documentation/licenses/third-party.txt",
        ];
        for wanted in common.iter().chain(&own) {
            assert!(entries.iter().any(|entry| entry == wanted), "{wanted} in {entries:?}");
        }
        let json = project.succeed(&["inspect", &format!("a/{name}"), "--json"]);
        let inspected: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(inspected["fmi_version"], format!("{version}.0"));
        assert_eq!(inspected["scene"]["settings"]["name"], "small");
    }
    assert_eq!(project.files(), ["a", "b", "library.so", "scene.toml", "small.rom.safetensors"]);
}

#[test]
fn package_omits_unused_rom_data() {
    let project = Project::new();
    let package = |directory: &str| {
        project.succeed(&[
            "package",
            "scene.toml",
            "--fmi",
            "3",
            "-o",
            directory,
            "--library",
            "library.so",
            "--quiet",
        ]);
        fs::read(project.path(directory).join("small_fmi3.fmu")).unwrap()
    };
    let plain = package("plain");
    let path = project.path("small.rom.safetensors");
    let mut rom = tiprub_format::read_rom(&fs::read(&path).unwrap(), "small").unwrap();
    rom.extras.spin = Some(Spin {
        stiffness_speed2: DMatrix::identity(3, 3) * -0.1,
        stiffness_speed4: DMatrix::zeros(3, 3),
        coriolis: DMatrix::zeros(3, 3),
        centrifugal_load: vec![0.01, 0.0, 0.0],
        centrifugal_load_speed4: vec![0.0; 3],
        largest_speed: 200.0,
    });
    fs::write(&path, tiprub_format::write_rom(&rom)).unwrap();
    assert!(package("able") == plain, "the FMU differs");
    fs::write(project.path("scene.toml"), SCENE.replace("speed = 100.0", "speed = 100.0\nspin = { growth = true }"))
        .unwrap();
    let used = package("used");
    let json = project.succeed(&["inspect", "used/small_fmi3.fmu", "--json"]);
    let inspected: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(inspected["scene"]["roms"][0]["spin"]["largest_speed"], 200.0);
    assert_eq!(inspected["scene"]["features"][0], "spin effects of `rotor`: growth");
    assert!(used.len() > plain.len());
}

#[test]
fn package_options_control_scalars_and_date() {
    let project = Project::new();
    let describe = |arguments: &[&str], date: Option<&str>| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        command.current_dir(project.root.path()).env_remove("SOURCE_DATE_EPOCH");
        command.args(["package", "scene.toml", "--fmi", "3", "-o", "x.fmu", "--library", "library.so"]).args(arguments);
        command.envs(date.map(|seconds| ("SOURCE_DATE_EPOCH", seconds)));
        assert!(command.output().unwrap().status.success());
        let mut archive = zip::ZipArchive::new(fs::File::open(project.path("x.fmu")).unwrap()).unwrap();
        std::io::read_to_string(archive.by_index(0).unwrap()).unwrap()
    };
    let arrays = describe(&["--arrays"], None);
    assert!(arrays.contains("<Dimension") && !arrays.contains("generationDateAndTime"));
    assert_eq!(describe(&["--scalars"], None), describe(&[], None), "few variables: scalars");
    assert!(!describe(&[], None).contains("<Dimension"));
    assert!(describe(&[], Some("951827696")).contains("generationDateAndTime=\"2000-02-29T12:34:56Z\""));
}

#[test]
fn fixed_internal_step_is_declared_only_if_it_is_constant() {
    let project = Project::new();
    let reported = |step: &str, communication_step: &str| {
        let scene: Vec<String> = SCENE
            .lines()
            .map(|line| match line.split('=').next().unwrap().trim() {
                "step" => format!("step = {step}"),
                "communication_step" => format!("communication_step = {communication_step}"),
                _ => line.to_owned(),
            })
            .collect();
        fs::write(project.path("scene.toml"), scene.join("\n")).unwrap();
        project.succeed(&["package", "scene.toml", "--fmi", "3", "-o", "x.fmu", "--library", "library.so", "-q"]);
        let mut archive = zip::ZipArchive::new(fs::File::open(project.path("x.fmu")).unwrap()).unwrap();
        let xml = std::io::read_to_string(archive.by_index(0).unwrap()).unwrap();
        xml.split("fixedInternalStepSize=\"").nth(1).map(|rest| rest.split('"').next().unwrap().to_owned())
    };
    assert_eq!(reported("1e-6", "1e-5").as_deref(), Some("1e-6"));
    assert_eq!(reported("1e-6", "1e-6").as_deref(), Some("1e-6"));
    for (step, communication_step) in [("3e-7", "1e-5"), ("1e-6", "2.5e-6"), ("2e-6", "1e-6")] {
        assert_eq!(reported(step, communication_step), None, "{step} in {communication_step}");
    }
}

#[cfg(unix)]
#[test]
fn package_does_not_overwrite_libraries() {
    let project = Project::new();
    fs::create_dir(project.path("libraries")).unwrap();
    fs::rename(project.path("library.so"), project.path("libraries/x.fmu")).unwrap();
    std::os::unix::fs::symlink("x.fmu", project.path("libraries/x.so")).unwrap();
    let error =
        project.fail(&["package", "scene.toml", "--fmi", "3", "--library", "libraries", "-o", "libraries/x.fmu"], 2);
    assert!(error.contains("x.fmu"), "{error}");
}

#[test]
fn failed_package_leaves_no_files() {
    let project = Project::new();
    let before = project.files();
    let missing = project.fail(&["package", "scene.toml", "--library", "none.so"], 1);
    assert!(missing.contains("none.so"), "{missing}");
    let text = project.fail(&["package", "scene.toml", "--library", "scene.toml"], 1);
    assert!(text.contains("not a complete 64-bit shared library"), "{text}");
    fs::write(project.path("scene.toml"), SCENE.replace("gap = 1e-3", "gap = -1e-3")).unwrap();
    let gap = project.fail(&["package", "scene.toml", "--library", "library.so"], 1);
    assert!(gap.contains("gap"), "{gap}");
    assert_eq!(project.files(), before);
}

/// Returns the names of the local headers of a zip, found in its bytes; also checks details that importers fail on.
fn raw_entries(bytes: &[u8]) -> Vec<String> {
    let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
    let u32_at = |at: usize| usize::from(u16_at(at)) + (usize::from(u16_at(at + 2)) << 16);
    let (mut at, mut names) = (0, Vec::new());
    while &bytes[at..at + 4] == b"PK\x03\x04" {
        let (length, extra) = (usize::from(u16_at(at + 26)), usize::from(u16_at(at + 28)));
        let name = String::from_utf8(bytes[at + 30..at + 30 + length].to_vec()).unwrap();
        assert!(u16_at(at + 4) <= 20, "{name} needs zip {}", u16_at(at + 4));
        assert_eq!(u16_at(at + 6), 0, "flags of {name}: no data descriptor");
        assert!(matches!(u16_at(at + 8), 0 | 8), "{name} is stored or deflated");
        assert_eq!((u16_at(at + 10), u16_at(at + 12), extra), (0, 0x21, 0), "time and extra field of {name}");
        assert!(!name.starts_with("./") && !name.contains('\\') && !name.ends_with('/'), "{name}");
        at += 30 + length + u32_at(at + 18);
        names.push(name);
    }
    assert_eq!(&bytes[at..at + 4], b"PK\x01\x02", "the central directory follows the last file");
    names
}
