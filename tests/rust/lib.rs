//! Helpers shared by the whole-product tests: a small scene, the built library, and importers over the C ABI.
#![allow(clippy::missing_panics_doc, reason = "helpers of tests panic where a test fails")]

#[macro_use]
mod calls;
pub mod fmi2;
pub mod fmi3;
pub mod refusals;
pub mod scene;

use std::ffi::{CStr, CString, c_char, c_void};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Status numbers of both standards: OK.
pub const OK: i32 = 0;
/// Warning.
pub const WARNING: i32 = 1;
/// Discard.
pub const DISCARD: i32 = 2;
/// Error.
pub const ERROR: i32 = 3;

/// Returns the root of the workspace.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests lie inside the workspace").to_path_buf()
}

/// Builds the FMU library as it is released (or with the feature that makes it panic on request) and returns its path.
///
/// The environment variables `TIPRUB_LIBRARY`, `TIPRUB_LIBRARY_TEST_PANIC` and `TIPRUB_LIBRARY_THERMAL` select
/// libraries built elsewhere (for example against an old glibc) instead. It is built alone (`-p`), because a workspace
/// build would unify features, and in a separate target directory, because the default one may be locked.
#[track_caller]
pub fn library(profile: &str, features: &[&str]) -> PathBuf {
    let elsewhere = if features.is_empty() { "TIPRUB_LIBRARY" } else { "TIPRUB_LIBRARY_TEST_PANIC" };
    library_of(("tiprub-fmi", "libtiprub_fmi.so", elsewhere), profile, features)
}

#[track_caller]
fn library_of((package, file, elsewhere): (&str, &str, &str), profile: &str, features: &[&str]) -> PathBuf {
    if let Some(path) = std::env::var_os(elsewhere) {
        return path.into();
    }
    let target = root().join("target").join(if features.is_empty() { "product" } else { "product-features" });
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root()).args(["build", "--quiet", "-p", package, "--profile", profile]);
    command.arg("--target-dir").arg(&target);
    if !features.is_empty() {
        command.args(["--features", &features.join(",")]);
    }
    let output = command.output().expect("cargo can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    target.join(profile).join(file)
}

/// Returns the path of the released library.
#[track_caller]
pub fn shipped() -> PathBuf {
    library("fmu", &[])
}

/// Returns the path of the released library of heat conduction.
#[track_caller]
pub fn thermal() -> PathBuf {
    library_of(("tiprub-fmi-thermal", "libtiprub_thermal_fmi.so", "TIPRUB_LIBRARY_THERMAL"), "fmu", &[])
}

/// Builds the library of the demo as `tiprub demo` does, and returns its path.
#[track_caller]
pub fn shared() -> PathBuf {
    let executable = std::env::current_exe().expect("a test has a path");
    let target = executable.ancestors().find(|directory| directory.join(".rustc_info.json").is_file());
    let target = target.expect("tests run from a target directory of cargo");
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root()).args(["build", "--quiet", "--release", "--lib", "-p", "tiprub", "-p", "tiprub-fmi"]);
    let output = command.arg("--target-dir").arg(target).output().expect("cargo can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    target.join("release/libtiprub_fmi.so")
}

/// One message that an importer received.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// Status of the message.
    pub status: i32,
    /// Category.
    pub category: String,
    /// Text.
    pub text: String,
}

/// Target of an instance's environment pointer.
#[derive(Debug, Default)]
pub struct Journal {
    /// Messages so far.
    pub messages: Vec<Message>,
}

impl Journal {
    /// Returns all texts, one per line.
    pub fn text(&self) -> String {
        self.messages.iter().map(|message| format!("{}\n", message.text)).collect()
    }
}

impl AsMut<Journal> for Journal {
    fn as_mut(&mut self) -> &mut Journal {
        self
    }
}

fn pointer(text: &Option<CString>) -> *const c_char {
    text.as_ref().map_or(std::ptr::null(), |text| text.as_ptr())
}

fn owned(text: *const c_char) -> String {
    assert!(!text.is_null(), "the library passed a NULL text");
    // SAFETY: not null; texts of log callbacks are NUL-terminated.
    unsafe { CStr::from_ptr(text) }.to_str().expect("messages are UTF-8").to_owned()
}

/// FMI 2.0 logger. The library calls it as variadic with the format "%s" and one text, which on the System V ABI arrives
/// like a sixth fixed argument.
///
/// # Safety
/// `environment` points to a [`Journal`].
pub unsafe extern "C" fn journal2(
    environment: *mut c_void,
    name: *const c_char,
    status: i32,
    category: *const c_char,
    format: *const c_char,
    text: *const c_char,
) {
    assert_eq!((owned(name).as_str(), owned(format).as_str()), ("rub", "%s"));
    // SAFETY: guaranteed by the caller.
    let journal = unsafe { &mut *environment.cast::<Journal>() };
    journal.messages.push(Message { status, category: owned(category), text: owned(text) });
}

/// FMI 3.0 logger.
///
/// # Safety
/// `environment` points to a [`Journal`].
pub unsafe extern "C" fn journal3(environment: *mut c_void, status: i32, category: *const c_char, text: *const c_char) {
    // SAFETY: guaranteed by the caller.
    let journal = unsafe { &mut *environment.cast::<Journal>() };
    journal.messages.push(Message { status, category: owned(category), text: owned(text) });
}
