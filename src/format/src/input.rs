//! Reading of complete regular files.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// Opens a file for reading. Directories are rejected, and so are pipes and devices, which may never end or never
/// deliver data.
///
/// # Examples
/// ```
/// # let directory = tempfile::tempdir()?;
/// # let path = directory.path().join("scene.toml");
/// # std::fs::write(&path, "name = \"bench\"")?;
/// let file = tiprub_format::open_file(&path)?;
/// assert_eq!(file.metadata()?.len(), 14);
/// assert!(tiprub_format::open_file(directory.path()).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A path that is not a regular file, or a file that cannot be opened.
pub fn open_file(path: &Path) -> io::Result<File> {
    let metadata = fs::metadata(path)?;
    if metadata.is_dir() {
        return Err(io::Error::new(ErrorKind::IsADirectory, "it is a directory"));
    }
    if !metadata.is_file() {
        return Err(io::Error::new(ErrorKind::InvalidInput, "it is a pipe or a device, not a file"));
    }
    File::open(path)
}

/// Returns the contents of a file of at most `most` bytes.
///
/// # Examples
/// ```
/// # let directory = tempfile::tempdir()?;
/// # let path = directory.path().join("scene.toml");
/// # std::fs::write(&path, "name = \"bench\"")?;
/// let bytes = tiprub_format::read_file(&path, 1 << 20)?;
/// assert_eq!(bytes, b"name = \"bench\"");
/// assert!(tiprub_format::read_file(&path, 10).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Same as [`open_file`]; more than `most` bytes, or bytes that cannot be read.
pub fn read_file(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open_file(path)?;
    let length = file.metadata()?.len();
    let too_large = || io::Error::new(ErrorKind::FileTooLarge, format!("it exceeds the limit of {most} bytes"));
    if length > most {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(usize::try_from(length).unwrap_or(usize::MAX))?;
    file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(too_large()) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_only_regular_files_up_to_the_size_limit() {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let manifest = here.join("Cargo.toml");
        let bytes = read_file(&manifest, 1 << 20).unwrap();
        assert_eq!(read_file(&manifest, bytes.len() as u64).unwrap(), bytes);
        assert_eq!(read_file(&manifest, bytes.len() as u64 - 1).unwrap_err().kind(), ErrorKind::FileTooLarge);
        assert_eq!(read_file(here, 1).unwrap_err().kind(), ErrorKind::IsADirectory);
        #[cfg(target_os = "linux")]
        {
            assert!(read_file(Path::new("/dev/zero"), 1).unwrap_err().to_string().contains("device"));
            // The length of this file is reported as zero.
            assert_eq!(read_file(Path::new("/proc/self/status"), 9).unwrap_err().kind(), ErrorKind::FileTooLarge);
        }
    }
}
