//! Keeps inputs and outputs of a command apart: no output is an input, another output, or the destination of the summary.

use std::{
    fs::{self, Metadata},
    io,
    path::{Component, Path, PathBuf},
};

use crate::{Failure, Result, output_file};

/// File with its description on the command line.
#[derive(Debug, Clone)]
pub struct NamedFile {
    /// Description on the command line.
    pub role: String,
    /// The file.
    pub path: PathBuf,
}

impl NamedFile {
    /// Creates a file at `path` with its `role`.
    pub fn new(role: impl Into<String>, path: impl Into<PathBuf>) -> Self {
        Self { role: role.into(), path: path.into() }
    }

    /// Creates the file of an option that may be omitted.
    pub fn option(role: &str, path: &Option<PathBuf>) -> Option<Self> {
        path.as_ref().map(|path| Self::new(role, path))
    }
}

/// Checks [`apart`], and that every output can be written as far as this can be known in advance.
///
/// # Errors
/// The errors of these checks.
pub fn outputs(inputs: &[NamedFile], outputs: &[NamedFile]) -> Result<()> {
    apart(inputs, outputs)?;
    outputs.iter().try_for_each(|output| output_file::try_target(&output.path))
}

/// Checks that no output is one of the inputs, another output, or the file or pipe to which stdout or stderr goes.
///
/// # Errors
/// Two names stand for one file, also through hard or symbolic links, open files, and directories that do not exist yet.
pub fn apart(inputs: &[NamedFile], outputs: &[NamedFile]) -> Result<()> {
    let mut known: Vec<(&str, String, Identity)> = Vec::new();
    let streams = [("stdout", stream(io::stdout())), ("stderr", stream(io::stderr()))];
    known.extend(streams.into_iter().filter_map(|(name, place)| Some((name, String::new(), place?))));
    for input in inputs {
        known.extend(
            identity(&input.path).map(|place| (input.role.as_str(), format!(" {}", input.path.display()), place)),
        );
    }
    for output in outputs {
        let Some(place) = identity(&output.path) else { continue };
        if let Some((role, path, _)) = known.iter().find(|(.., other)| *other == place) {
            let what = format!("{} {}", output.role, output.path.display());
            return Err(Failure::usage(what, format!("is the same file as {role}{path}"), "Give a different file"));
        }
        known.push((&output.role, format!(" {}", output.path.display()), place));
    }
    Ok(())
}

/// Identity of a path: the existing part of it, and the names below that do not exist yet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    there: Key,
    below: PathBuf,
}

#[cfg(unix)]
type Key = (u64, u64);
#[cfg(not(unix))]
type Key = PathBuf;

#[cfg(unix)]
fn key(_path: &Path, metadata: &Metadata) -> Option<Key> {
    use std::os::unix::fs::{FileTypeExt, MetadataExt};
    // Terminals and /dev/null may be named twice.
    (!metadata.file_type().is_char_device()).then(|| (metadata.dev(), metadata.ino()))
}

#[cfg(not(unix))]
fn key(path: &Path, _metadata: &Metadata) -> Option<Key> {
    fs::canonicalize(path).ok()
}

/// Returns the identity of a path; `None` for entries that may be named twice, and for impossible names.
pub fn identity(path: &Path) -> Option<Identity> {
    let path = output_file::destination(path).ok()?;
    let path = if path.is_absolute() { path } else { std::env::current_dir().ok()?.join(path) };
    let mut there = PathBuf::new();
    let mut below = PathBuf::new();
    for part in path.components() {
        match part {
            // The directory does not exist yet, and will be created as a plain directory.
            Component::ParentDir if below.as_os_str().is_empty() => there.push(part),
            Component::ParentDir => drop(below.pop()),
            Component::CurDir => {}
            _ if below.as_os_str().is_empty() && fs::metadata(there.join(part)).is_ok() => there.push(part),
            _ => below.push(part),
        }
    }
    let metadata = fs::metadata(&there).ok()?;
    Some(Identity { there: key(&there, &metadata)?, below })
}

/// Returns the identity of the destination of a stream of this process.
#[cfg(unix)]
fn stream(stream: impl std::os::fd::AsFd) -> Option<Identity> {
    let metadata = fs::File::from(stream.as_fd().try_clone_to_owned().ok()?).metadata().ok()?;
    Some(Identity { there: key(Path::new(""), &metadata)?, below: PathBuf::new() })
}

#[cfg(not(unix))]
fn stream<T>(_stream: T) -> Option<Identity> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn same(root: &Path, one: &str, two: &str) -> bool {
        let named = |name: &str| NamedFile::new("x", root.join(name));
        let [input, both] = [apart(&[named(one)], &[named(two)]), apart(&[], &[named(one), named(two)])];
        assert_eq!(input.is_err(), both.is_err(), "{one} {two}");
        assert!(input.err().is_none_or(|failure| failure.exit_code() == 2 && failure.problem.contains("same file")));
        both.is_err()
    }

    #[test]
    #[cfg(unix)]
    fn recognises_one_file_under_different_names() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        fs::create_dir(root.join("a")).unwrap();
        for name in ["file", "a/other"] {
            fs::write(root.join(name), "").unwrap();
        }
        fs::hard_link(root.join("file"), root.join("hard")).unwrap();
        for (link, target) in [("soft", "file"), ("b", "a"), ("dangling", "a/new"), ("again", "dangling")] {
            std::os::unix::fs::symlink(target, root.join(link)).unwrap();
        }
        for (one, two) in [
            ("file", "file"),
            ("file", "a/../file"),
            ("file", "hard"),
            ("file", "soft"),
            ("hard", "soft"),
            ("a/other", "b/other"),
            ("a/new", "b/new"),
            ("a/new", "dangling"),
            ("again", "b/./new"),
            ("new/x/y", "new/z/../x/y"),
            ("new/../n", "n"),
        ] {
            assert!(same(root, one, two), "{one} {two}");
        }
        for (one, two) in [("file", "a/other"), ("a/new", "new"), ("new/x", "new/y"), ("a/x/y", "b/x/z")] {
            assert!(!same(root, one, two), "{one} {two}");
        }
        // A device may be named twice.
        assert!(!same(root, "/dev/null", "/dev/null"));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn recognises_a_file_by_its_descriptor_path() {
        use std::os::fd::AsRawFd;
        let root = tempfile::tempdir().unwrap();
        let file = fs::File::create(root.path().join("x")).unwrap();
        assert!(same(root.path(), "x", &format!("/proc/self/fd/{}", file.as_raw_fd())));
    }
}
