//! The `tiprub` program as a user meets it: a small scene, real files, exit codes, and nothing half-written.

use std::{
    fs,
    path::PathBuf,
    process::{Command, Output},
};

use nalgebra::DMatrix;
use tempfile::TempDir;
use tiprub_core::{
    Rom,
    rom::{ContactNode, Frame, RomChecks, Spin},
};

const SCENE: &str = r#"
name = "small"
[[structure]]
name = "rotor"
rom = "small.rom.safetensors"
speed = 100.0
[[surface]]
name = "casing"
shape = { kind = "lobes", amplitude = 2e-3, order = 2 }
ramp_time = 0.02
[[contact]]
master = "rotor"
slave = "casing"
gap = 1e-3
friction = 0.1
[time]
step = 1e-4
[experiment]
stop = 0.05
communication_step = 1e-3
"#;

/// A directory with a scene of four one-node blades.
struct Project {
    root: TempDir,
}

impl Project {
    fn new() -> Self {
        let root = tempfile::tempdir().unwrap();
        let rom = Rom {
            name: "small".into(),
            origin: "One mass on three springs".into(),
            sectors: 4,
            frame: Frame::Cylindrical,
            mass: DMatrix::identity(3, 3) * 0.1,
            stiffness: DMatrix::identity(3, 3) * 1e5,
            damping_ratio: 0.01,
            contact_map: DMatrix::identity(3, 3),
            contact_nodes: vec![ContactNode { name: "tip".into(), position: [0.25, 0.0, 0.0], meridional_slope: 0.0 }],
            checks: RomChecks::default(),
            extras: tiprub_core::rom::RomExtras::default(),
        };
        fs::write(root.path().join("small.rom.safetensors"), tiprub_format::write_rom(&rom)).unwrap();
        fs::write(root.path().join("scene.toml"), SCENE).unwrap();
        // The header of a shared library for Linux on x86-64, which is all that packaging looks at.
        let mut library = vec![0_u8; 4096];
        library[..20].copy_from_slice(b"\x7fELF\x02\x01\x01\0\0\0\0\0\0\0\0\0\x03\0\x3e\0");
        fs::write(root.path().join("library.so"), library).unwrap();
        Self { root }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.root.path().join(name)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        command.current_dir(self.root.path()).env_remove("SOURCE_DATE_EPOCH").args(arguments);
        command.output().unwrap()
    }

    #[track_caller]
    fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {stderr}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// The error line of a run that must fail with this code.
    #[track_caller]
    fn fail(&self, arguments: &[&str], code: i32) -> String {
        let output = self.run(arguments);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
        stderr.lines().find(|line| line.starts_with("error: ")).unwrap_or_else(|| panic!("{stderr}")).to_string()
    }

    fn files(&self) -> Vec<String> {
        let names = fs::read_dir(self.root.path()).unwrap();
        let mut names: Vec<_> = names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

fn columns(csv: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut lines = csv.lines();
    let names = lines.next().unwrap().split(',').map(String::from).collect();
    (names, lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect())
}

#[test]
fn a_native_run_writes_one_row_per_communication_point() {
    let project = Project::new();
    let json = project.succeed(&["run", "scene.toml", "--csv", "new/out.csv", "--json", "--quiet"]);
    let summary: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(summary["communication_steps"], 50);
    assert_eq!(summary["internal_steps"], 500);
    let (names, rows) = columns(&fs::read_to_string(project.path("new/out.csv")).unwrap());
    assert_eq!((names[0].as_str(), rows.len()), ("time", 51));
    let clearance = names.iter().position(|name| name == "clearance_minimum").expect("a column for the clearance");
    assert!((rows[0][clearance] - rows[50][clearance]).abs() > 1e-6, "the casing's lobes meet the blades");
    assert!(rows.iter().all(|row| row.len() == names.len()));
    assert_eq!(rows[50][0].to_bits(), 0.05_f64.to_bits());
    let again = project.succeed(&["run", "scene.toml", "--csv", "-", "--quiet"]);
    assert_eq!(columns(&again).1, rows, "the same run gives the same bits");
}

/// What the CSV says, without looking for it: the lobes of the scene reach through the gap.
#[test]
fn the_summary_of_a_run_tells_its_extremes() {
    let project = Project::new();
    let text = project.succeed(&["run", "scene.toml", "--csv", "out.csv", "--quiet"]);
    let json = project.succeed(&["run", "scene.toml", "--json", "--quiet"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let (names, rows) = columns(&fs::read_to_string(project.path("out.csv")).unwrap());
    let column = |name: &str| {
        let index = names.iter().position(|other| other == name).unwrap();
        rows.iter().map(|row| (row[0], row[index])).collect::<Vec<_>>()
    };
    // Communication steps of 1 ms.
    let total: Vec<_> = column("normal_impulse").into_iter().map(|(time, impulse)| (time, impulse / 1e-3)).collect();
    let largest = |column: Vec<(f64, f64)>| column.into_iter().map(|row| row.1).fold(f64::MIN, f64::max);
    let least = column("clearance_minimum").into_iter().map(|row| row.1).fold(f64::MAX, f64::min);
    for (name, value) in [
        ("largest_total_normal_force", largest(total.clone())),
        ("largest_node_normal_force", largest(column("normal_force_peak"))),
        ("smallest_clearance", least),
        ("most_contacts", largest(column("contact_count"))),
    ] {
        let found = &json["extremes"][name];
        assert!((found["value"].as_f64().unwrap() - value).abs() <= 1e-9 * value.abs(), "{name}: {found}, {value}");
    }
    let force = &json["extremes"]["largest_total_normal_force"];
    assert!(force["value"].as_f64().unwrap() > 1.0, "{force}");
    let at = force["time"].as_f64().unwrap();
    let there = total.iter().find(|row| row.0.to_bits() == at.to_bits()).unwrap();
    assert!((there.1 - largest(total.clone())).abs() <= 1e-9 * there.1, "{there:?}");
    let told = text.split("over the run:").nth(1).unwrap();
    assert!(told.contains(&format!(" N at t = {at} s")) && told.contains("smallest clearance: "), "{text}");
    assert!(told.contains("most contact nodes touching at a communication point: "), "{text}");
}

/// Whatever is given, an error is a line or two: no number is written out with three hundred digits.
#[test]
fn numbers_in_errors_are_short() {
    let project = Project::new();
    for (from, to, number) in [
        ("friction = 0.1", "friction = 1e300", "1e300"),
        ("gap = 1e-3", "gap = -1e300", "-1e300"),
        ("stop = 0.05", "stop = -1e300", "-1e300"),
        ("step = 1e-4", "step = 1e-300", "1e-300"),
        ("ramp_time = 0.02", "ramp_time = 1e300", "1e300"),
    ] {
        fs::write(project.path("wrong.toml"), SCENE.replacen(from, to, 1)).unwrap();
        let told = project.fail(&["run", "wrong.toml"], 1);
        assert!(told.contains(number) && told.len() < 300, "{told}");
    }
    for (arguments, number) in [
        (["--set", "damping_ratio=1e300"], "1e300"),
        (["--set", "damping_ratio=-1e300"], "-1e300"),
        (["--set", "friction_coefficient=1e300"], "1e300"),
        (["--stop", "-1e300"], "-1e300"),
        (["--step", "-1e300"], "-1e300"),
    ] {
        let told = project.fail(&[&["run", "scene.toml"], &arguments[..]].concat(), 2);
        assert!(told.contains(number) && told.len() < 300, "{told}");
    }
}

#[test]
fn settings_and_times_can_be_replaced() {
    let project = Project::new();
    let csv = |arguments: &[&str]| {
        let all = [&["run", "scene.toml", "--csv", "-", "--quiet"], arguments].concat();
        columns(&project.succeed(&all)).1
    };
    assert_eq!(csv(&["--stop", "0.01", "--step", "0.003"]).len(), 5);
    assert_ne!(csv(&["--set", "speed=50"]), csv(&[]));
    assert_eq!(csv(&["--set", "speed=100"]), csv(&[]));
}

#[test]
fn wrong_command_lines_exit_with_two_and_say_what_to_do() {
    let project = Project::new();
    let unknown = project.fail(&["run", "scene.toml", "--set", "sped=1"], 2);
    assert!(unknown.contains("no such variable") && unknown.contains("`speed`"), "{unknown}");
    let wrong = project.fail(&["run", "scene.toml", "--set", "speed=fast"], 2);
    assert!(wrong.contains("not a number"), "{wrong}");
    let infinite = project.fail(&["run", "scene.toml", "--set", "speed=inf"], 2);
    assert!(infinite.contains("--set speed=inf"), "{infinite}");
    let stop = project.fail(&["run", "scene.toml", "--stop", "-1"], 2);
    assert!(stop.contains("--stop"), "{stop}");
    let two = project.fail(&["package", "scene.toml", "-o", "x.fmu"], 2);
    assert!(two.contains("two FMUs"), "{two}");
    project.fail(&["package", "scene.toml", "--fmi", "4"], 2);
    project.fail(&["frobnicate"], 2);
}

#[test]
fn failures_exit_with_one_and_are_json_too() {
    let project = Project::new();
    let output = project.run(&["run", "missing.toml", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["error"]["what"].as_str().unwrap().contains("missing.toml"), "{json}");
    fs::write(project.path("bad.toml"), SCENE.replace("friction = 0.1", "frictoin = 0.1")).unwrap();
    let bad = project.fail(&["run", "bad.toml"], 1);
    assert!(bad.contains("bad.toml:") && bad.contains("frictoin") && bad.contains("`friction`"), "{bad}");
    let rom = fs::read(project.path("small.rom.safetensors")).unwrap();
    fs::write(project.path("small.rom.safetensors"), &rom[..rom.len() / 2]).unwrap();
    let truncated = project.fail(&["run", "scene.toml"], 1);
    assert!(truncated.contains("small.rom.safetensors"), "{truncated}");
}

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
fn what_a_scene_does_not_use_of_a_rom_stays_out_of_the_package() {
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
    assert_eq!(inspected["scene"]["features"][0], "spin of `rotor`: growth");
    assert!(used.len() > plain.len());
}

#[test]
fn scalars_and_dates_are_packed_as_asked() {
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
    let arrays = describe(&[], None);
    assert!(arrays.contains("<Dimension") && !arrays.contains("generationDateAndTime"));
    assert!(!describe(&["--scalars"], None).contains("<Dimension"));
    assert!(describe(&[], Some("951827696")).contains("generationDateAndTime=\"2000-02-29T12:34:56Z\""));
}

#[test]
fn failed_packages_leave_nothing() {
    let project = Project::new();
    let before = project.files();
    let missing = project.fail(&["package", "scene.toml", "--library", "none.so"], 1);
    assert!(missing.contains("none.so"), "{missing}");
    let text = project.fail(&["package", "scene.toml", "--library", "scene.toml"], 1);
    assert!(text.contains("not a shared library"), "{text}");
    fs::write(project.path("scene.toml"), SCENE.replace("gap = 1e-3", "gap = -1e-3")).unwrap();
    let gap = project.fail(&["package", "scene.toml", "--library", "library.so"], 1);
    assert!(gap.contains("gap"), "{gap}");
    assert_eq!(project.files(), before);
}

#[test]
fn damaged_fmus_are_named_by_inspect_at_every_length() {
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

/// Names of the local headers of a zip, found by walking its bytes; checks what importers trip over on the way.
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

#[test]
fn warnings_are_on_stderr_even_when_quiet_and_in_json() {
    let project = Project::new();
    // Just longer than 2/omega_max = 2 ms of the springs; much longer ones end the run, for energy that was not supplied.
    let coarse = SCENE
        .replace("step = 1e-4", "step = 2.05e-3")
        .replace("communication_step = 1e-3", "communication_step = 4.1e-3");
    fs::write(project.path("scene.toml"), coarse).unwrap();
    for arguments in [
        &["run", "scene.toml", "--json", "--quiet"][..],
        &["package", "scene.toml", "-o", "x", "--library", "library.so", "--json", "--quiet"],
        &["inspect", "scene.toml", "--json", "--quiet"],
        &["inspect", "x/small_fmi2.fmu", "--json", "--quiet"],
    ] {
        let output = project.run(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        let shown: Vec<&str> = stderr.lines().filter_map(|line| line.strip_prefix("warning: ")).collect();
        assert!(output.status.success() && shown.len() == 1, "{arguments:?}: {stderr}");
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let warnings = if arguments[0] == "inspect" { &json["scene"]["warnings"] } else { &json["warnings"] };
        assert_eq!(warnings, &serde_json::json!(shown), "{arguments:?}");
    }
}

#[test]
fn a_communication_step_longer_than_the_run_is_warned_of() {
    let project = Project::new();
    fs::write(project.path("scene.toml"), SCENE.replace("communication_step = 1e-3", "communication_step = 0.1"))
        .unwrap();
    for arguments in
        [&["run", "scene.toml", "-q"][..], &["package", "scene.toml", "-o", "x", "--library", "library.so", "-q"]]
    {
        let stderr = String::from_utf8(project.run(arguments).stderr).unwrap();
        assert!(stderr.starts_with("warning: the communication step 0.1 s is longer"), "{arguments:?}: {stderr}");
    }
    assert!(project.run(&["run", "scene.toml", "-q", "--step", "0.05"]).stderr.is_empty());
}

#[test]
fn inspect_shows_where_contact_nodes_are_and_what_the_scene_sets() {
    let project = Project::new();
    let rom = project.succeed(&["inspect", "small.rom.safetensors"]);
    assert!(rom.contains("r 0.250000 m, θ 0.000000 rad, z 0.000000 m, slope 0.0000"), "{rom}");
    let scene = project.succeed(&["inspect", "scene.toml"]);
    for shown in ["100 rad/s (954.9 rpm)", "damping ratio of the ROM", "\"watched_sectors\":[1]"] {
        assert!(scene.contains(shown), "{shown}: {scene}");
    }
}

#[test]
fn a_changed_scene_stops_the_demo_before_any_work() {
    let project = Project::new();
    fs::create_dir(project.path("demo")).unwrap();
    for (changed, kept) in [("rotor37.toml", SCENE), ("rotor37.toml", "")] {
        fs::write(project.path("demo").join(changed), kept).unwrap();
        let error = project.fail(&["demo", "--library", "none.so"], 1);
        assert!(error.contains("rotor37.toml") && error.contains("--out"), "{error}");
        assert_eq!(fs::read_to_string(project.path("demo").join(changed)).unwrap(), kept);
    }
    assert_eq!(fs::read_dir(project.path("demo")).unwrap().count(), 1);
}

#[test]
fn a_reduction_replaces_another_rom_only_by_force_and_warns_of_a_poor_one() {
    let project = Project::new();
    let coarse = ["reduce", "rotor37", "--mesh", "4x1x6", "-o", "blade.rom.safetensors", "--quiet"];
    project.succeed(&coarse);
    let before = fs::read(project.path("blade.rom.safetensors")).unwrap();
    let poor = [&coarse[..], &["--modes", "0"]].concat();
    let error = project.fail(&poor, 1);
    assert!(error.contains("blade.rom.safetensors") && error.contains("--force"), "{error}");
    // Said before the work, which would refuse this mesh; of the file written by default and of others as well.
    fs::write(project.path("rotor37.rom.safetensors"), "kept").unwrap();
    for line in [
        "reduce rotor37 --mesh 1x1x1 -o blade.rom.safetensors",
        "reduce rotor37 --mesh 1x1x1",
        "reduce rotor37 --mesh 1x1x1 -o new.rom.safetensors --inp scene.toml",
        "reduce rotor37 --mesh 1x1x1 -o new.rom.safetensors --vtk scene.toml",
    ] {
        let error = project.fail(&line.split(' ').collect::<Vec<_>>(), 1);
        assert!(error.contains("is there already") && error.contains("--force"), "{line}: {error}");
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
fn a_casing_is_reduced_and_options_of_the_other_model_are_refused() {
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
    assert!(error.contains("describes a casing"), "{error}");
    let error = project.fail(&["reduce", "casing", "--contact-nodes", "3"], 2);
    assert!(error.contains("--contact-grid"), "{error}");
    let error = project.fail(&["reduce", "casing", "--mesh", "30x1x8", "--force"], 1);
    assert!(error.contains("not a multiple of the 24 contact nodes"), "{error}");
}

#[test]
fn help_is_there_for_every_command() {
    let project = Project::new();
    for command in ["demo", "reduce", "package", "run", "inspect"] {
        let help = project.succeed(&[command, "--help"]);
        assert!(help.contains("Examples:") && help.contains("--json"), "{help}");
    }
}

#[test]
#[cfg(target_os = "linux")]
fn results_that_stdout_does_not_take_are_a_failure() {
    let project = Project::new();
    let onto = |stdout: fs::File| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        command.current_dir(project.root.path()).args(["run", "scene.toml", "--csv", "-", "-q"]);
        command.stdout(stdout).output().unwrap()
    };
    let full = onto(fs::OpenOptions::new().write(true).open("/dev/full").unwrap());
    assert_eq!(full.status.code(), Some(1));
    let message = String::from_utf8(full.stderr).unwrap();
    assert!(message.contains("stdout: cannot be written"), "{message}");
    let good = onto(fs::File::create(project.path("good.csv")).unwrap());
    assert_eq!(good.status.code(), Some(0));
}

#[test]
fn a_command_line_that_is_not_understood_is_answered_in_json_too() {
    let project = Project::new();
    for line in ["run --json", "frobnicate --json", "--json run scene.toml --stop", "package scene.toml --fmi 4 --json"]
    {
        let output = project.run(&line.split(' ').collect::<Vec<_>>());
        let json: serde_json::Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{line}: {error}"));
        assert_eq!((output.status.code(), json["error"]["exit_code"].as_u64()), (Some(2), Some(2)), "{line}");
        assert!(json["error"]["problem"].as_str().is_some_and(|text| !text.is_empty()), "{json}");
        assert!(!output.stderr.is_empty());
    }
    // Help is no failure, and a file may be called --json.
    assert!(String::from_utf8(project.run(&["--json", "--help"]).stdout).unwrap().contains("Usage"));
    assert!(project.run(&["run", "--nothing", "--", "--json"]).stdout.is_empty());
}

#[test]
fn a_run_is_warned_for_the_step_it_takes() {
    let project = Project::new();
    // 2/omega_max of the springs is 2 ms.
    let scene =
        SCENE.replace("step = 1e-4", "step = 3e-3").replace("lobes\", amplitude = 2e-3", "lobes\", amplitude = 2e-6");
    fs::write(project.path("scene.toml"), scene).unwrap();
    let warnings = |arguments: &[&str]| {
        let output = project.run(&[&["run", "scene.toml", "--quiet"], arguments].concat());
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{stderr}");
        stderr.lines().filter(|line| line.contains("not resolved")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(warnings(&[]), Vec::<String>::new());
    let told = warnings(&["--step", "2.5e-3"]);
    assert!(told.len() == 1 && told[0].contains("2.500e-3"), "{told:?}");
}

#[test]
fn slips_are_asked_about_by_every_command() {
    let project = Project::new();
    fs::write(
        project.path("scene.toml"),
        SCENE
            .replace("speed = 100.0", "speed = 17188.0")
            .replace("step = 1e-4", "step = 1e-5")
            .replace("amplitude = 2e-3", "amplitude = 2e-6"),
    )
    .unwrap();
    for line in [
        "run scene.toml --stop 1e-4 --step 1e-5",
        "inspect scene.toml",
        "package scene.toml -o x --library library.so",
        "inspect x/small_fmi3.fmu",
    ] {
        let output = project.run(&line.split(' ').collect::<Vec<_>>());
        let stderr = String::from_utf8(output.stderr).unwrap();
        let told: Vec<_> = stderr.lines().filter(|text| text.contains("rpm")).collect();
        assert!(output.status.success() && told.len() == 1 && told[0].contains("4297 m/s"), "{line}: {stderr}");
    }
    // A ROM by hand in millimetres.
    let path = project.path("small.rom.safetensors");
    let mut rom = tiprub_format::read_rom(&fs::read(&path).unwrap(), "small").unwrap();
    rom.contact_nodes[0].position[0] = 250.0;
    fs::write(&path, tiprub_format::write_rom(&rom)).unwrap();
    for line in ["inspect small.rom.safetensors", "inspect scene.toml"] {
        let output = project.run(&line.split(' ').collect::<Vec<_>>());
        assert!(String::from_utf8(output.stderr).unwrap().contains("millimetres"), "{line}");
    }
}

#[test]
fn gaps_of_sectors_stand_for_the_gap_and_heat_needs_friction() {
    let project = Project::new();
    fs::write(project.path("scene.toml"), SCENE.replace("gap = 1e-3", "sector_gaps = [1e-3, 1e-3, 1.2e-3, 1e-3]"))
        .unwrap();
    let (names, rows) = columns(&project.succeed(&["run", "scene.toml", "--csv", "-", "--quiet"]));
    let clearance = names.iter().position(|name| name == "clearance_minimum").unwrap();
    assert!(rows.last().unwrap()[clearance] <= 1e-3);
    assert!(project.succeed(&["inspect", "scene.toml", "--quiet"]).contains("gaps 0.001 m to 0.0012 m"));
    fs::write(project.path("scene.toml"), SCENE.replace("friction = 0.1", "heat_to_slave = 0.5")).unwrap();
    let error = project.fail(&["run", "scene.toml"], 1);
    assert!(error.contains("heat_to_slave") && error.contains("friction"), "{error}");
}

#[test]
fn step_limits_are_those_at_which_a_scene_is_refused() {
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

/// Everything on stdout, which must be one JSON object.
fn json(output: &Output) -> serde_json::Value {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    let value: serde_json::Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
    assert!(value.is_object(), "{text}");
    value
}

#[test]
#[cfg(unix)]
fn names_that_are_no_text_are_names_of_files() {
    use std::{ffi::OsStr, os::unix::ffi::OsStrExt};
    let project = Project::new();
    let odd = OsStr::from_bytes(b"a\xffb");
    let run = |words: &[&str], last: &OsStr| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        command.current_dir(project.root.path()).arg("--json").arg("--quiet").args(words).arg(last).output().unwrap()
    };
    let csv = run(&["run", "scene.toml", "--csv"], odd);
    assert_eq!(csv.status.code(), Some(0), "{csv:?}");
    assert_eq!(json(&csv)["csv"], "a\u{fffd}b");
    assert!(fs::read_to_string(project.path("").join(odd)).unwrap().starts_with("time,"));
    fs::remove_file(project.path("").join(odd)).unwrap();
    let package = run(&["package", "scene.toml", "--library", "library.so", "-o"], odd);
    assert_eq!(package.status.code(), Some(0), "{package:?}");
    assert!(json(&package)["fmus"][0]["file"].as_str().unwrap().starts_with("a\u{fffd}b/"));
    let scene = OsStr::from_bytes(b"s\xff.toml");
    fs::write(project.path("").join(scene), SCENE).unwrap();
    let inspect = run(&["inspect"], scene);
    assert_eq!((inspect.status.code(), &json(&inspect)["kind"]), (Some(0), &"scene".into()), "{inspect:?}");
}

#[cfg(unix)]
fn pipe(project: &Project, name: &str) -> PathBuf {
    let path = project.path(name);
    assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    path
}

#[test]
#[cfg(unix)]
fn pipes_and_devices_are_no_inputs_and_stdout_is_no_second_output() {
    let project = Project::new();
    for name in ["pipe", "pipe.toml", "pipe.fmu", "pipe.safetensors", "pipe.inp", "pipe.so"] {
        pipe(&project, name);
    }
    std::os::unix::fs::symlink("/dev/zero", project.path("zero.toml")).unwrap();
    let mesh = ["--contact-set", "A", "--clamp-set", "B"];
    for words in [
        &["run", "pipe"][..],
        &["run", "zero.toml"],
        &["package", "pipe.toml", "-o", "out"],
        &["package", "scene.toml", "-o", "out", "--library", "pipe.so"],
        &["inspect", "pipe.toml"],
        &["inspect", "zero.toml"],
        &["inspect", "pipe.fmu"],
        &["inspect", "pipe.safetensors"],
        &["inspect", "pipe"],
        &[&["reduce", "pipe.inp"], &mesh[..]].concat(),
    ] {
        let message = project.fail(words, 1);
        assert!(message.contains("pipe or a device"), "{message}");
    }
    // Stdout is a pipe here, and takes the summary.
    for words in [&["run", "scene.toml", "--csv", "/dev/stdout"][..], &["reduce", "rotor37", "-o", "/proc/self/fd/1"]] {
        let message = project.fail(words, 2);
        assert!(message.contains("is the same file as stdout"), "{message}");
    }
    project.succeed(&["run", "scene.toml", "--csv", "/dev/null"]);
}

#[test]
#[cfg(unix)]
fn a_pipe_that_nobody_reads_is_waited_for_with_a_word_and_takes_all() {
    use std::io::{BufRead, BufReader};
    let project = Project::new();
    let path = pipe(&project, "pipe");
    let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
    command.current_dir(project.root.path()).args(["run", "scene.toml", "--quiet", "--csv", "pipe"]);
    let mut child = command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped()).spawn().unwrap();
    let said =
        BufReader::new(child.stderr.take().unwrap()).lines().find(|line| line.as_ref().unwrap().contains("pipe"));
    assert_eq!(said.unwrap().unwrap(), "pipe is a pipe that nobody reads: waiting for its reader");
    let read = fs::read_to_string(&path).unwrap();
    assert!(child.wait().unwrap().success());
    assert_eq!(read, project.succeed(&["run", "scene.toml", "--quiet", "--csv", "-"]));
}

#[test]
#[cfg(unix)]
fn no_output_is_an_input_or_another_output() {
    let project = Project::new();
    fs::hard_link(project.path("scene.toml"), project.path("hard.csv")).unwrap();
    std::os::unix::fs::symlink("small.rom.safetensors", project.path("soft.csv")).unwrap();
    fs::create_dir(project.path("out")).unwrap();
    fs::write(project.path("out/scene.json"), SCENE).unwrap();
    fs::copy(project.path("library.so"), project.path("library.fmu")).unwrap();
    let before = project.files();
    for words in [
        &["run", "scene.toml", "--csv", "scene.toml"][..],
        &["run", "scene.toml", "--csv", "./out/../scene.toml"],
        &["run", "scene.toml", "--csv", "hard.csv"],
        &["run", "scene.toml", "--csv", "soft.csv"],
        &["reduce", "rotor37", "-o", "x", "--vtk", "x"],
        &["reduce", "rotor37", "-o", "new/x", "--inp", "new/y/../x"],
        &["reduce", "small.msh", "-o", "y", "--vtk", "small.msh", "--force"],
        &["package", "scene.toml", "--fmi", "2", "--library", "library.fmu", "-o", "library.fmu"],
        &["demo", "--out", "out", "--library", "out/report.html"],
    ] {
        fs::write(project.path("small.msh"), "").unwrap();
        fs::write(project.path("out/report.html"), "").unwrap();
        let message = project.fail(words, 2);
        assert!(message.contains("is the same file as"), "{message}");
    }
    let message = project.fail(&["study", "map", "out/scene.json", "--out", "out"], 2);
    assert!(message.contains("a file of the study may replace"), "{message}");
    assert_eq!(fs::read_to_string(project.path("scene.toml")).unwrap(), SCENE);
    assert_eq!(project.files().len(), before.len() + 1);
}

#[test]
fn a_run_beyond_the_memory_is_refused_with_its_size() {
    let project = Project::new();
    let message = project.fail(&["run", "scene.toml", "--step", "1e-9", "--quiet"], 2);
    assert!(message.contains("50000001 communication points") && message.contains("GB"), "{message}");
    let output = project.run(&["run", "scene.toml", "--step", "1e-9", "--json"]);
    assert_eq!(json(&output)["error"]["exit_code"], 2);
}

#[test]
#[cfg(unix)]
fn new_files_follow_the_umask() {
    use std::os::unix::fs::PermissionsExt;
    let project = Project::new();
    for (mask, mode) in [("077", 0o600), ("022", 0o644), ("002", 0o664)] {
        let line = format!("umask {mask}; exec \"$0\" run scene.toml --quiet --csv {mask}.csv");
        let mut shell = Command::new("sh");
        shell.current_dir(project.root.path()).args(["-c", &line, env!("CARGO_BIN_EXE_tiprub")]);
        assert!(shell.output().unwrap().status.success());
        let made = fs::metadata(project.path(&format!("{mask}.csv"))).unwrap().permissions().mode();
        assert_eq!(made & 0o777, mode, "umask {mask}");
    }
}

#[test]
fn nothing_that_a_terminal_obeys_is_printed() {
    let project = Project::new();
    let mut rom = tiprub_format::read_rom(&fs::read(project.path("small.rom.safetensors")).unwrap(), "").unwrap();
    rom.origin = "mass\u{1b}]0;owned\u{7}\u{9b}31m\u{202e}".into();
    fs::write(project.path("odd.safetensors"), tiprub_format::write_rom(&rom)).unwrap();
    let described = SCENE.replace("name = \"small\"", "name = \"small\"\ndescription = \"red \\u001b[31m\"");
    fs::write(project.path("odd.toml"), described).unwrap();
    for words in [
        &["inspect", "odd.safetensors"][..],
        &["inspect", "odd.safetensors", "--json"],
        &["inspect", "odd.toml"],
        &["inspect", "odd.toml", "--json"],
        &["inspect", "no\u{1b}[31m\nerror: forged.toml"],
        &["run", "no\u{1b}[31m\nerror: forged.toml", "--json"],
    ] {
        let output = project.run(words);
        let text = String::from_utf8([output.stdout.clone(), output.stderr.clone()].concat()).unwrap();
        let obeyed = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(
            !text.contains(obeyed) && !text.lines().any(|line| line.starts_with("error: forged")),
            "{words:?}: {text:?}"
        );
        if words.contains(&"--json") {
            json(&output);
        }
    }
}
