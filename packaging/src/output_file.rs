//! Files appear whole or not at all. What is being written has no name yet where the system allows it (Linux: `O_TMPFILE`), so that
//! nothing stays when the program is killed; elsewhere it is a hidden temporary file beside the target. Then it is renamed.
//!
//! New files get the permissions that the user's umask leaves, replaced ones keep theirs. Symbolic links are followed.
//! Devices and pipes (`/dev/null`, a FIFO) are written to, never replaced.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use crate::{Failure, Result};

/// Links followed one after the other before they are taken for a circle.
const MOST_LINKS: usize = 40;

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
    let trial = create_directory(path)
        .and_then(|()| Draft::new(path).map(drop).map_err(|error| Failure::file(path, "cannot write there", &error)));
    for made in missing {
        // Those that were not made are not there.
        let _ = fs::remove_dir(made);
    }
    trial
}

/// Whether a file can be written under this name, as far as that shows before it is. Nothing stays.
///
/// # Errors
/// As [`begin`].
pub fn try_target(target: &Path) -> Result<()> {
    match place(target)? {
        Place::File(path) => try_directory(&parent(&path)),
        Place::Stream => Ok(()),
    }
}

/// What already is under the name of a target.
enum Place {
    /// Nothing, or a file to replace, at this path (symbolic links resolved).
    File(PathBuf),
    /// Something that takes bytes but is no file: a device or a pipe.
    Stream,
}

fn place(target: &Path) -> Result<Place> {
    let path = destination(target).map_err(|error| Failure::file(target, "cannot be written", &error))?;
    let is_directory = || Failure::new(target.display(), "is a directory", "Name a file");
    match fs::metadata(&path) {
        Ok(metadata) if metadata.is_dir() => Err(is_directory()),
        Ok(metadata) if metadata.is_file() => Ok(Place::File(path)),
        Ok(_) => Ok(Place::Stream),
        Err(error) if error.kind() == io::ErrorKind::NotFound => match path.file_name() {
            Some(_) if !target.as_os_str().as_encoded_bytes().ends_with(b"/") => Ok(Place::File(path)),
            _ => Err(is_directory()),
        },
        // A file where a directory should be: said by whoever makes the directory.
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => Ok(Place::File(path)),
        Err(error) => Err(Failure::file(target, "cannot be written", &error)),
    }
}

/// The path itself, or where symbolic links lead, whether something is there or not.
pub(crate) fn destination(target: &Path) -> io::Result<PathBuf> {
    if let Ok(real) = fs::canonicalize(target) {
        return Ok(real);
    }
    let mut path = target.to_path_buf();
    for _ in 0..MOST_LINKS {
        // What is open has a link in /proc/self/fd that leads nowhere, and is there all the same.
        match fs::read_link(&path) {
            Ok(link) if !path.exists() => path = parent(&path).join(link),
            _ => return Ok(path),
        }
    }
    Err(io::Error::other("symbolic links lead in a circle"))
}

/// A file in the making.
#[derive(Debug)]
pub struct Draft {
    file: File,
    /// Where it has a name already.
    named: Option<NamedTempFile>,
}

impl Draft {
    /// In this directory.
    fn new(directory: &Path) -> io::Result<Self> {
        if let Some(file) = unnamed(directory) {
            return Ok(Self { file, named: None });
        }
        let named = temporary().tempfile_in(directory)?;
        Ok(Self { file: named.reopen()?, named: Some(named) })
    }

    /// Hidden under a name of its own, ready to be renamed.
    fn name(self, directory: &Path) -> io::Result<tempfile::TempPath> {
        if let Some(named) = self.named {
            return Ok(named.into_temp_path());
        }
        Ok(temporary().make_in(directory, |path| link(&self.file, path))?.into_temp_path())
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

fn temporary<'a>() -> tempfile::Builder<'a, 'a> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".tiprub-").suffix(".part");
    #[cfg(unix)]
    builder.permissions(ordinary());
    builder
}

/// What the umask leaves of this is what new files get.
#[cfg(unix)]
fn ordinary() -> fs::Permissions {
    std::os::unix::fs::PermissionsExt::from_mode(0o666)
}

/// A file without a name; none where the file system knows none.
#[cfg(target_os = "linux")]
fn unnamed(directory: &Path) -> Option<File> {
    use std::os::unix::fs::OpenOptionsExt;
    fs::OpenOptions::new().read(true).write(true).custom_flags(libc::O_TMPFILE).mode(0o666).open(directory).ok()
}

#[cfg(not(target_os = "linux"))]
fn unnamed(_directory: &Path) -> Option<File> {
    None
}

/// Give a file without a name one.
#[cfg(target_os = "linux")]
fn link(file: &File, path: &Path) -> io::Result<()> {
    use rustix::fs::{AtFlags, CWD};
    use std::os::fd::AsRawFd;
    let open = format!("/proc/self/fd/{}", file.as_raw_fd());
    Ok(rustix::fs::linkat(CWD, open, CWD, path, AtFlags::SYMLINK_FOLLOW)?)
}

#[cfg(not(target_os = "linux"))]
fn link(_file: &File, _path: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Begin a file in the directory of `target` (which is created if missing). Nothing shows under the target's name before
/// [`persist`].
///
/// # Errors
/// The directory cannot be written to, or `target` is itself a directory or no possible name.
pub fn begin(target: &Path) -> Result<Draft> {
    let place = place(target)?;
    let directory = match &place {
        Place::File(path) => parent(path),
        Place::Stream => std::env::temp_dir(),
    };
    create_directory(&directory)?;
    let draft = Draft::new(&directory).and_then(|draft| match &place {
        Place::File(path) => keep_permissions(&draft.file, path).map(|()| draft),
        Place::Stream => Ok(draft),
    });
    draft.map_err(|error| Failure::file(target, "cannot write there", &error))
}

/// A file that replaces another is no more open to others than that one.
fn keep_permissions(file: &File, target: &Path) -> io::Result<()> {
    match fs::metadata(target) {
        Ok(metadata) => file.set_permissions(metadata.permissions()),
        Err(_) => Ok(()),
    }
}

/// Give the finished file its name, replacing an older file of that name.
///
/// # Errors
/// The rename failed, and the temporary file is gone and an older target untouched; or a device or pipe took only a part.
pub fn persist(draft: Draft, target: &Path) -> Result<()> {
    let Place::File(path) = place(target)? else { return copy_into_stream(draft, target) };
    let named = draft.name(&parent(&path));
    let renamed = named.and_then(|named| named.persist(path).map_err(|error| error.error));
    renamed.map_err(|error| Failure::file(target, "cannot be put in place", &error))
}

fn copy_into_stream(draft: Draft, target: &Path) -> Result<()> {
    let mut finished = draft.file;
    let copied = io::Seek::rewind(&mut finished)
        .and_then(|()| open_stream(target))
        .and_then(|mut stream| io::copy(&mut finished, &mut stream));
    copied.map(drop).map_err(|error| Failure::file(target, "cannot be written", &error))
}

/// Open a device or a pipe to write. A pipe that nobody reads is waited for, and not in silence.
fn open_stream(target: &Path) -> io::Result<File> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
        if fs::metadata(target)?.file_type().is_fifo() {
            let asked = fs::OpenOptions::new().write(true).custom_flags(libc::O_NONBLOCK).open(target);
            if asked.is_err_and(|error| error.raw_os_error() == Some(libc::ENXIO)) {
                let name = crate::console::printable(&target.display().to_string()).into_owned();
                // A closed stderr must not stop the work.
                let _ = writeln!(io::stderr(), "{name} is a pipe that nobody reads: waiting for its reader");
            }
        }
    }
    fs::OpenOptions::new().write(true).open(target)
}

/// Write `bytes` to `target` in one piece.
///
/// # Errors
/// The file cannot be written.
pub fn write(target: &Path, bytes: impl AsRef<[u8]>) -> Result<()> {
    let mut draft = begin(target)?;
    draft.write_all(bytes.as_ref()).map_err(|error| Failure::file(target, "cannot be written", &error))?;
    persist(draft, target)
}

/// Refuse to replace a file that holds something else than `bytes`: what a user changed is not lost without notice. Devices
/// and pipes are not read.
///
/// # Errors
/// The file is there and differs (or cannot be read); `remedy` says what to do.
pub fn refuse_to_replace(target: &Path, bytes: impl AsRef<[u8]>, remedy: &str) -> Result<()> {
    if fs::metadata(target).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir()) {
        return Ok(());
    }
    match fs::read(target) {
        Ok(present) if present == bytes.as_ref() => Ok(()),
        Ok(_) => Err(Failure::new(target.display(), "is there already and differs from what would be written", remedy)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(Failure::file(target, "cannot be compared with what would be written", &error)),
    }
}

fn parent(target: &Path) -> PathBuf {
    match target.parent() {
        Some(directory) if !directory.as_os_str().is_empty() => directory.to_path_buf(),
        _ => PathBuf::from("."),
    }
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

    #[test]
    #[cfg(unix)]
    fn links_to_nothing_are_followed_and_circles_are_named() {
        let root = tempfile::tempdir().unwrap();
        let [link, chain, circle] = ["link.csv", "chain.csv", "circle"].map(|name| root.path().join(name));
        std::os::unix::fs::symlink("new.csv", &link).unwrap();
        std::os::unix::fs::symlink("link.csv", &chain).unwrap();
        std::os::unix::fs::symlink("circle", &circle).unwrap();
        write(&chain, "new").unwrap();
        assert!([&link, &chain].iter().all(|link| fs::symlink_metadata(link).unwrap().is_symlink()));
        assert_eq!(fs::read_to_string(root.path().join("new.csv")).unwrap(), "new");
        assert!(write(&circle, "x").unwrap_err().problem.contains("circle"));
    }

    #[cfg(unix)]
    fn mode(path: &Path) -> u32 {
        use std::os::unix::fs::PermissionsExt;
        fs::metadata(path).unwrap().permissions().mode() & 0o7777
    }

    /// The umask belongs to the whole process; a file that the system makes shows what it is.
    #[test]
    #[cfg(unix)]
    fn new_files_follow_the_umask_and_replaced_ones_keep_their_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let root = tempfile::tempdir().unwrap();
        let [plain, target] = ["plain", "target"].map(|name| root.path().join(name));
        fs::write(&plain, "").unwrap();
        write(&target, "1").unwrap();
        assert_eq!(mode(&target), mode(&plain));
        for kept in [0o600, 0o640, 0o755] {
            fs::set_permissions(&target, fs::Permissions::from_mode(kept)).unwrap();
            write(&target, "2").unwrap();
            assert_eq!(mode(&target), kept);
        }
    }

    /// Where files without a name are not to be had, hidden ones do.
    #[test]
    #[cfg(unix)]
    fn hidden_files_become_the_same_as_files_without_a_name() {
        let root = tempfile::tempdir().unwrap();
        let [plain, target] = ["plain", "target"].map(|name| root.path().join(name));
        fs::write(&plain, "").unwrap();
        let named = temporary().tempfile_in(root.path()).unwrap();
        let mut draft = Draft { file: named.reopen().unwrap(), named: Some(named) };
        draft.write_all(b"bytes").unwrap();
        persist(draft, &target).unwrap();
        assert_eq!((fs::read_to_string(&target).unwrap().as_str(), mode(&target)), ("bytes", mode(&plain)));
        assert_eq!(names(root.path()).len(), 2);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn an_unfinished_file_has_no_name() {
        let root = tempfile::tempdir().unwrap();
        let draft = begin(&root.path().join("x")).unwrap();
        // Where the file system knows such files.
        assert!(draft.named.is_some() || names(root.path()).is_empty());
    }

    #[test]
    fn impossible_names_are_refused_before_any_work() {
        let root = tempfile::tempdir().unwrap();
        for name in ["", ".", "..", "missing/", &"l".repeat(300)] {
            let target = if name.is_empty() { PathBuf::new() } else { root.path().join(name) };
            assert!(try_target(&target).is_err() && begin(&target).is_err(), "{name}");
        }
        try_target(&root.path().join("a/b/c")).unwrap();
        assert_eq!(names(root.path()).len(), 0);
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
