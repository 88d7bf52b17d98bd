//! Files appear whole or not at all: written to a hidden temporary file beside the target, then renamed. Symbolic links
//! are followed. Devices and pipes (`/dev/stdout`, `/dev/null`, a FIFO) are written to, never replaced.

use std::{
    fs,
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use crate::{Failure, Result};

/// Create the directory (and its parents) if it is not there.
///
/// # Errors
/// The directory cannot be made.
pub fn create_directory(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(|error| Failure::file(path, "cannot create the directory", &error))
}

/// Whether files can be written into the directory, made for the trial if it is not there: so that long work does not end at a
/// wrong path. Nothing stays.
///
/// # Errors
/// The directory cannot be made, or not be written to.
pub fn try_directory(path: &Path) -> Result<()> {
    let named = path.ancestors().filter(|ancestor| !ancestor.as_os_str().is_empty());
    let missing: Vec<&Path> = named.take_while(|ancestor| !ancestor.exists()).collect();
    let trial = create_directory(path).and_then(|()| {
        let file = tempfile::Builder::new().prefix(".tiprub-").suffix(".part").tempfile_in(path);
        file.map(drop).map_err(|error| Failure::file(path, "cannot write there", &error))
    });
    for made in missing {
        // Those that were not made are not there.
        let _ = fs::remove_dir(made);
    }
    trial
}

/// What already is under the name of a target.
enum Place {
    /// Nothing, or a file to replace, at this path (symbolic links resolved).
    File(PathBuf),
    /// Something that takes bytes but is no file: a device or a pipe.
    Stream,
}

fn place(target: &Path) -> Result<Place> {
    let Ok(metadata) = fs::metadata(target) else { return Ok(Place::File(target.to_path_buf())) };
    if metadata.is_dir() {
        return Err(Failure::new(target.display(), "is a directory", "Name a file"));
    }
    if !metadata.is_file() {
        return Ok(Place::Stream);
    }
    let real = fs::canonicalize(target).map_err(|error| Failure::file(target, "cannot be found", &error))?;
    Ok(Place::File(real))
}

/// A hidden temporary file in the directory of `target` (which is created if missing). Nothing shows under the
/// target's name before [`persist`].
///
/// # Errors
/// The directory cannot be written to, or `target` is itself a directory.
pub fn begin(target: &Path) -> Result<NamedTempFile> {
    let directory = match place(target)? {
        Place::File(path) => parent(&path),
        Place::Stream => std::env::temp_dir(),
    };
    create_directory(&directory)?;
    tempfile::Builder::new()
        .prefix(".tiprub-")
        .suffix(".part")
        .tempfile_in(&directory)
        .map_err(|error| Failure::file(target, "cannot write there", &error))
}

/// Give the finished temporary file its name, replacing an older file of that name.
///
/// # Errors
/// The rename failed, and the temporary file is gone and an older target untouched; or a device or pipe took only a part.
pub fn persist(file: NamedTempFile, target: &Path) -> Result<()> {
    let Place::File(path) = place(target)? else { return copy_into_stream(&file, target) };
    set_ordinary_permissions(&file, target)?;
    file.persist(path).map_err(|error| Failure::file(target, "cannot be put in place", &error.error))?;
    Ok(())
}

fn copy_into_stream(file: &NamedTempFile, target: &Path) -> Result<()> {
    let copied = file.reopen().and_then(|mut finished| {
        let mut stream = fs::OpenOptions::new().write(true).open(target)?;
        std::io::copy(&mut finished, &mut stream)
    });
    copied.map(drop).map_err(|error| Failure::file(target, "cannot be written", &error))
}

/// Write `bytes` to `target` in one piece.
///
/// # Errors
/// The file cannot be written.
pub fn write(target: &Path, bytes: impl AsRef<[u8]>) -> Result<()> {
    let mut file = begin(target)?;
    std::io::Write::write_all(&mut file, bytes.as_ref())
        .map_err(|error| Failure::file(target, "cannot be written", &error))?;
    persist(file, target)
}

/// Refuse to replace a file that holds something else than `bytes`: what a user changed is not lost without notice.
///
/// # Errors
/// The file is there and differs (or cannot be read); `remedy` says what to do.
pub fn refuse_to_replace(target: &Path, bytes: impl AsRef<[u8]>, remedy: &str) -> Result<()> {
    match fs::read(target) {
        Ok(present) if present == bytes.as_ref() => Ok(()),
        Ok(_) => Err(Failure::new(target.display(), "is there already and differs from what would be written", remedy)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(Failure::file(target, "cannot be compared with what would be written", &error)),
    }
}

fn parent(target: &Path) -> PathBuf {
    match target.parent() {
        Some(directory) if !directory.as_os_str().is_empty() => directory.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

/// Temporary files are private (0600); results are ordinary files (0644).
#[cfg(unix)]
fn set_ordinary_permissions(file: &NamedTempFile, target: &Path) -> Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.as_file()
        .set_permissions(fs::Permissions::from_mode(0o644))
        .map_err(|error| Failure::file(target, "permissions cannot be set", &error))
}

#[cfg(not(unix))]
fn set_ordinary_permissions(_file: &NamedTempFile, _target: &Path) -> Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let entries = fs::read_dir(directory).unwrap();
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn missing_directories_are_created_and_only_the_target_stays() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("a/b/result.csv");
        write(&target, "1\n").unwrap();
        write(&target, "2\n").unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "2\n");
        assert_eq!(names(&root.path().join("a/b")), ["result.csv"]);
    }

    #[test]
    fn an_abandoned_file_leaves_nothing_and_keeps_the_old_one() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("rom.safetensors");
        write(&target, "old").unwrap();
        let file = begin(&target).unwrap();
        assert!(names(root.path()).iter().all(|name| name.starts_with('.') || name == "rom.safetensors"));
        drop(file);
        assert_eq!(names(root.path()), ["rom.safetensors"]);
        assert_eq!(fs::read_to_string(&target).unwrap(), "old");
    }

    #[test]
    #[cfg(unix)]
    fn links_are_followed_and_stay_links() {
        let root = tempfile::tempdir().unwrap();
        let (real, link) = (root.path().join("elsewhere/real.csv"), root.path().join("link.csv"));
        write(&real, "old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write(&link, "new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&real).unwrap(), "new");
    }

    /// Links stand for the devices here: replacing a real one would damage the machine that runs the tests.
    #[test]
    #[cfg(target_os = "linux")]
    fn devices_are_written_to_and_never_replaced() {
        let root = tempfile::tempdir().unwrap();
        for (device, works) in [("/dev/null", true), ("/dev/full", false)] {
            let link = root.path().join("device");
            std::os::unix::fs::symlink(device, &link).unwrap();
            let outcome = write(&link, "bytes");
            assert_eq!(outcome.is_ok(), works, "{device}");
            assert!(outcome.err().is_none_or(|failure| failure.problem.contains("cannot be written")), "{device}");
            assert!(fs::symlink_metadata(&link).unwrap().is_symlink(), "{device} was replaced");
            assert_eq!(names(root.path()), ["device"]);
            fs::remove_file(&link).unwrap();
        }
    }

    #[test]
    fn a_directory_is_not_a_target() {
        let root = tempfile::tempdir().unwrap();
        let failure = write(root.path(), "x").unwrap_err();
        assert!(failure.problem.contains("is a directory"), "{failure}");
        assert_eq!(names(root.path()).len(), 0);
    }

    #[test]
    fn only_a_file_with_other_contents_is_protected() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("scene.toml");
        refuse_to_replace(&target, "old", "Move it").unwrap();
        write(&target, "old").unwrap();
        refuse_to_replace(&target, "old", "Move it").unwrap();
        let failure = refuse_to_replace(&target, "new", "Move it").unwrap_err();
        assert!(failure.what.ends_with("scene.toml") && failure.remedy == "Move it", "{failure}");
    }

    #[test]
    fn a_directory_is_tried_and_nothing_stays() {
        let root = tempfile::tempdir().unwrap();
        try_directory(&root.path().join("a/b")).unwrap();
        assert_eq!(names(root.path()).len(), 0);
        fs::create_dir(root.path().join("there")).unwrap();
        try_directory(&root.path().join("there")).unwrap();
        assert_eq!(names(root.path()), ["there"]);
        assert_eq!(names(&root.path().join("there")).len(), 0);
        fs::write(root.path().join("file"), "").unwrap();
        for bad in ["file", "file/inside"] {
            let failure = try_directory(&root.path().join(bad)).unwrap_err();
            assert!(failure.problem.contains("cannot create the directory"), "{failure}");
        }
        // Made, but not to be written into: no file system takes files there.
        #[cfg(target_os = "linux")]
        assert!(try_directory(Path::new("/proc/self")).unwrap_err().problem.contains("cannot write there"));
    }

    #[test]
    fn a_target_that_cannot_be_written_says_so() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("file"), "").unwrap();
        let failure = write(&root.path().join("file/inside.csv"), "x").unwrap_err();
        assert!(failure.problem.contains("cannot create the directory"), "{failure}");
    }
}
