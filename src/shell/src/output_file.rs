//! Writes files completely or not at all. A file has no name while it is written, if the system supports this (Linux: `O_TMPFILE`), so that nothing
//! remains when the program is killed; otherwise it is a hidden temporary file beside the target. Then it is renamed.
//!
//! New files get the permissions of the user's umask, replaced ones keep theirs. Symbolic links are followed. Devices and pipes (`/dev/null`, a
//! FIFO) are written to, never replaced.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use crate::{Failure, Result};

/// Largest number of symbolic links in a chain; more count as a loop.
const MOST_LINKS: usize = 40;

/// Creates the directory and its parents if they do not exist.
///
/// # Errors
/// The directory cannot be created.
pub fn create_directory(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(|error| Failure::file(path, "cannot create the directory", &error))
}

/// Checks that files can be written into the directory, which is created for this check if it does not exist, so that a wrong path is reported
/// before long work. Nothing remains.
///
/// # Errors
/// The directory cannot be created or cannot be written to.
pub fn try_directory(path: &Path) -> Result<()> {
    let named = path.ancestors().filter(|ancestor| !ancestor.as_os_str().is_empty());
    let missing: Vec<&Path> = named.take_while(|ancestor| !ancestor.exists()).collect();
    let trial = create_directory(path).and_then(|()| {
        PendingFile::new(path).map(drop).map_err(|error| Failure::file(path, "cannot write to this directory", &error))
    });
    for made in missing {
        // Only directories that were created here exist.
        let _ = fs::remove_dir(made);
    }
    trial
}

/// Checks that a file can be written under this name, as far as this can be known in advance. Nothing remains.
///
/// # Errors
/// The errors of [`begin`].
pub fn try_target(target: &Path) -> Result<()> {
    match place(target)? {
        OutputTarget::File(path) => try_directory(&parent(&path)),
        OutputTarget::Stream => Ok(()),
    }
}

/// Rejects a device or a pipe for files that the user did not name, since writing to them might block.
///
/// # Errors
/// The existing entry is not a file.
pub fn only_a_file(target: &Path) -> Result<()> {
    match place(target)? {
        OutputTarget::File(_) => Ok(()),
        OutputTarget::Stream => Err(Failure::new(target.display(), "is a pipe or a device, not a file", "Remove it")),
    }
}

/// Existing entry under the name of a target.
enum OutputTarget {
    /// No entry, or a file to replace, at this path (symbolic links resolved).
    File(PathBuf),
    /// Device or pipe, which is written to but not replaced.
    Stream,
}

fn place(target: &Path) -> Result<OutputTarget> {
    let path = destination(target).map_err(|error| Failure::file(target, "cannot be written", &error))?;
    let is_directory = || Failure::new(target.display(), "is a directory", "Give a file name");
    match fs::metadata(&path) {
        Ok(metadata) if metadata.is_dir() => Err(is_directory()),
        Ok(metadata) if metadata.is_file() => Ok(OutputTarget::File(path)),
        Ok(_) => Ok(OutputTarget::Stream),
        Err(error) if error.kind() == io::ErrorKind::NotFound => match path.file_name() {
            Some(_) if !target.as_os_str().as_encoded_bytes().ends_with(b"/") => Ok(OutputTarget::File(path)),
            _ => Err(is_directory()),
        },
        // A file in the place of a directory is reported when the directory is created.
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => Ok(OutputTarget::File(path)),
        Err(error) => Err(Failure::file(target, "cannot be written", &error)),
    }
}

/// Returns the path with symbolic links resolved, whether it exists or not.
pub fn destination(target: &Path) -> io::Result<PathBuf> {
    if let Ok(real) = fs::canonicalize(target) {
        return Ok(real);
    }
    let mut path = target.to_path_buf();
    for _ in 0..MOST_LINKS {
        // An open file has a link in /proc/self/fd whose target may not exist, although the file does.
        match fs::read_link(&path) {
            Ok(link) if !path.exists() => path = parent(&path).join(link),
            _ => return Ok(path),
        }
    }
    Err(io::Error::other("the symbolic links form a loop"))
}

/// File that is being written.
#[derive(Debug)]
pub struct PendingFile {
    file: File,
    /// Temporary file, if it already has a name.
    named: Option<NamedTempFile>,
}

impl PendingFile {
    /// Creates a file in this directory.
    fn new(directory: &Path) -> io::Result<Self> {
        if let Some(file) = unnamed(directory) {
            return Ok(Self { file, named: None });
        }
        let named = temporary().tempfile_in(directory)?;
        Ok(Self { file: named.reopen()?, named: Some(named) })
    }

    /// Gives the file a hidden temporary name, from which it can be renamed.
    fn name(self, directory: &Path) -> io::Result<tempfile::TempPath> {
        if let Some(named) = self.named {
            return Ok(named.into_temp_path());
        }
        Ok(temporary().make_in(directory, |path| link(&self.file, path))?.into_temp_path())
    }
}

impl Write for PendingFile {
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

/// Returns the permissions of new files under the umask.
#[cfg(unix)]
fn ordinary() -> fs::Permissions {
    std::os::unix::fs::PermissionsExt::from_mode(0o666)
}

/// Opens a file without a name; `None` if the file system does not support this.
#[cfg(target_os = "linux")]
fn unnamed(directory: &Path) -> Option<File> {
    use std::os::unix::fs::OpenOptionsExt;
    fs::OpenOptions::new().read(true).write(true).custom_flags(libc::O_TMPFILE).mode(0o666).open(directory).ok()
}

#[cfg(not(target_os = "linux"))]
fn unnamed(_directory: &Path) -> Option<File> {
    None
}

/// Gives a name to a file without one.
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

/// Begins a file in the directory of `target`, which is created if missing. Nothing appears under the target's name before [`persist`].
///
/// # Errors
/// The directory cannot be written to, or `target` is a directory or an impossible name.
pub fn begin(target: &Path) -> Result<PendingFile> {
    let place = place(target)?;
    let directory = match &place {
        OutputTarget::File(path) => parent(path),
        OutputTarget::Stream => std::env::temp_dir(),
    };
    create_directory(&directory)?;
    let draft = PendingFile::new(&directory).and_then(|draft| match &place {
        OutputTarget::File(path) => keep_permissions(&draft.file, path).map(|()| draft),
        OutputTarget::Stream => Ok(draft),
    });
    draft.map_err(|error| Failure::file(target, "cannot be created", &error))
}

/// Keeps the permissions of a replaced file, so that the new one is not more accessible.
fn keep_permissions(file: &File, target: &Path) -> io::Result<()> {
    match fs::metadata(target) {
        Ok(metadata) => file.set_permissions(metadata.permissions()),
        Err(_) => Ok(()),
    }
}

/// Gives the finished file its name, replacing an older file of that name.
///
/// # Errors
/// The rename failed: the temporary file is removed and an older target is unchanged; or a device or pipe accepted only a part.
pub fn persist(draft: PendingFile, target: &Path) -> Result<()> {
    let OutputTarget::File(path) = place(target)? else { return copy_into_stream(draft, target) };
    let named = draft.name(&parent(&path));
    let renamed = named.and_then(|named| named.persist(path).map_err(|error| error.error));
    renamed.map_err(|error| Failure::file(target, "cannot be renamed from its temporary file", &error))
}

fn copy_into_stream(draft: PendingFile, target: &Path) -> Result<()> {
    let mut finished = draft.file;
    let copied = io::Seek::rewind(&mut finished)
        .and_then(|()| open_stream(target))
        .and_then(|mut stream| io::copy(&mut finished, &mut stream));
    copied.map(drop).map_err(|error| Failure::file(target, "cannot be written", &error))
}

/// Opens a device or a pipe for writing. If a pipe has no reader, a message is printed before waiting for one.
fn open_stream(target: &Path) -> io::Result<File> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
        if fs::metadata(target)?.file_type().is_fifo() {
            let asked = fs::OpenOptions::new().write(true).custom_flags(libc::O_NONBLOCK).open(target);
            if asked.is_err_and(|error| error.raw_os_error() == Some(libc::ENXIO)) {
                let name = crate::console::printable(&target.display().to_string()).into_owned();
                // A closed stderr must not stop the work.
                let _ = writeln!(io::stderr(), "{name} is a pipe without a reader: waiting for one");
            }
        }
    }
    fs::OpenOptions::new().write(true).open(target)
}

/// Writes `bytes` to `target` in one piece.
///
/// # Errors
/// The file cannot be written.
pub fn write(target: &Path, bytes: impl AsRef<[u8]>) -> Result<()> {
    let mut draft = begin(target)?;
    draft.write_all(bytes.as_ref()).map_err(|error| Failure::file(target, "cannot be written", &error))?;
    persist(draft, target)
}

/// Rejects the replacement of a file whose content differs from `bytes`, so that changes by the user are not lost silently. Devices and pipes are
/// not read.
///
/// # Errors
/// The file exists and differs (or cannot be read); `remedy` is the remedy of the error.
pub fn refuse_to_replace(target: &Path, bytes: impl AsRef<[u8]>, remedy: &str) -> Result<()> {
    if fs::metadata(target).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir()) {
        return Ok(());
    }
    match fs::read(target) {
        Ok(present) if present == bytes.as_ref() => Ok(()),
        Ok(_) => Err(Failure::new(target.display(), "already exists and differs from the new content", remedy)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(Failure::file(target, "cannot be compared with the new content", &error)),
    }
}

fn parent(target: &Path) -> PathBuf {
    match target.parent() {
        Some(directory) if !directory.as_os_str().is_empty() => directory.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

#[cfg(test)]
mod tests;
