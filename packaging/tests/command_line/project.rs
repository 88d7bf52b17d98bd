//! Small scene with its files, and runs of the program on it.

use std::{
    fs,
    path::PathBuf,
    process::{Command, Output},
};

use nalgebra::DMatrix;
use tempfile::TempDir;
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, RomChecks};

pub const SCENE: &str = r#"
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

/// Directory with a scene of four one-node blades.
pub struct Project {
    pub root: TempDir,
}

impl Project {
    pub fn new() -> Self {
        let root = tempfile::tempdir().unwrap();
        let rom = Rom {
            name: "small".into(),
            origin: "One mass on three springs".into(),
            sectors: 4,
            frame: DisplacementFrame::Cylindrical,
            mass: DMatrix::identity(3, 3) * 0.1,
            stiffness: DMatrix::identity(3, 3) * 1e5,
            damping_ratio: 0.01,
            contact_map: DMatrix::identity(3, 3),
            contact_nodes: vec![ContactNode {
                name: "tip".into(),
                position: [0.25, 0.0, 0.0],
                meridional_slope: 0.0,
                ..ContactNode::default()
            }],
            checks: RomChecks::default(),
            extras: tiprub_core::scene::rom::RomExtras::default(),
        };
        fs::write(root.path().join("small.rom.safetensors"), tiprub_format::write_rom(&rom)).unwrap();
        fs::write(root.path().join("scene.toml"), SCENE).unwrap();
        // The header of a shared library for Linux on x86-64 is all that packaging checks.
        let mut library = vec![0_u8; 4096];
        library[64..86].copy_from_slice(b"fmi2DoStep\0fmi3DoStep\0");
        library[96..][..tiprub_format::LIBRARY_RELEASE.len()]
            .copy_from_slice(tiprub_format::LIBRARY_RELEASE.as_bytes());
        library[..20].copy_from_slice(b"\x7fELF\x02\x01\x01\0\0\0\0\0\0\0\0\0\x03\0\x3e\0");
        fs::write(root.path().join("library.so"), library).unwrap();
        Self { root }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.root.path().join(name)
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        command.current_dir(self.root.path()).env_remove("SOURCE_DATE_EPOCH").args(arguments);
        command.output().unwrap()
    }

    #[track_caller]
    pub fn succeed(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {stderr}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// Returns the error line of a run that must fail with this code.
    #[track_caller]
    pub fn fail(&self, arguments: &[&str], code: i32) -> String {
        let output = self.run(arguments);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
        stderr.lines().find(|line| line.starts_with("error: ")).unwrap_or_else(|| panic!("{stderr}")).to_string()
    }

    pub fn files(&self) -> Vec<String> {
        let names = fs::read_dir(self.root.path()).unwrap();
        let mut names: Vec<_> = names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

pub fn columns(csv: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut lines = csv.lines();
    let names = lines.next().unwrap().split(',').map(String::from).collect();
    (names, lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect())
}

/// Parses stdout, which must be one JSON object.
pub fn json(output: &Output) -> serde_json::Value {
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    let value: serde_json::Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
    assert!(value.is_object(), "{text}");
    value
}
