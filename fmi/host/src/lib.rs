//! A packaged FMU driven as an importer does it: unzip, read modelDescription.xml, load the shared library, and follow
//! the call sequence of the standard. It does not depend on the scene or the core behind the ABI.

#![warn(unreachable_pub)]
pub mod api;
pub mod archive;
mod description;
mod fmi2;
mod fmi3;
mod platform;
mod session;
mod slave;

use std::{
    fs,
    io::{self, Read},
    path::{Component, Path, PathBuf},
    time::Duration,
};

use tempfile::TempDir;
use zip::ZipArchive;

pub use description::{ImportedDescription, ImportedVariable, VariableType, parse};
pub use platform::Platform;
pub use session::Session;

use tiprub_shell::{Failure, Result, recording::Recording, schedule::Schedule};

/// Maximum size (bytes) of all files of an archive together, unpacked: far above any FMU, far below a zip bomb.
const LARGEST_UNPACKED: u64 = 2 << 30;
/// Name of the model description at the root of the archive.
const DESCRIPTION: &str = "modelDescription.xml";
/// Maximum size of a description (bytes), which a hundred thousand variables with long descriptions need.
const LARGEST_DESCRIPTION: u64 = 64 << 20;

/// An FMU unpacked to a temporary directory, which is deleted with this value.
#[derive(Debug)]
pub struct UnpackedFmu {
    directory: TempDir,
    /// Content of modelDescription.xml.
    pub description: ImportedDescription,
}

/// Results of a run through the C ABI.
#[derive(Debug, Clone)]
pub struct ImportedRun {
    /// All outputs at all communication points.
    pub recording: Recording,
    /// Time spent inside doStep.
    pub stepping: Duration,
    /// Log of the FMU.
    pub messages: Vec<String>,
}

/// Opens a zip for reading, with messages for the ways in which a file can fail to be one.
///
/// # Errors
/// A file that cannot be opened or is not a complete zip.
pub fn open_archive(path: &Path) -> Result<ZipArchive<io::BufReader<fs::File>>> {
    let file = tiprub_format::open_file(path).map_err(|error| Failure::file(path, "cannot be opened", &error))?;
    ZipArchive::new(io::BufReader::new(file)).map_err(|error| {
        Failure::new(
            path.display(),
            format!("not a complete zip archive ({error})"),
            "Copy the file again or recreate it with `tiprub package`; it is truncated or not an FMU",
        )
    })
}

/// Returns the names and sizes of all entries, as declared in the archive.
///
/// # Errors
/// A damaged entry, or more than 2 GiB in all.
pub fn entries(archive: &mut ZipArchive<impl Read + io::Seek>) -> Result<Vec<(String, u64)>> {
    let mut entries = Vec::new();
    let mut total = 0_u64;
    for index in 0..archive.len() {
        let entry = archive.by_index_raw(index).map_err(|error| damaged(&format!("{}", index + 1), &error))?;
        let name = entry.name().map_err(|error| damaged(&format!("{}", index + 1), &error))?.into_owned();
        total = total.saturating_add(entry.size());
        entries.push((name, entry.size()));
    }
    if total > LARGEST_UNPACKED {
        let problem =
            format!("its files would take {total} bytes unpacked, more than the limit of {LARGEST_UNPACKED} bytes");
        return Err(Failure::new(
            "archive",
            problem,
            "Do not trust this file; if it is your own FMU, use a smaller ROM",
        ));
    }
    Ok(entries)
}

/// Unpacks entry `index` into `target`, checked against its CRC and its declared size; never writes more than that.
///
/// # Errors
/// A damaged entry, or a target that cannot be written.
pub(crate) fn unpack_entry(
    archive: &mut ZipArchive<impl Read + io::Seek>,
    index: usize,
    name: &str,
    target: &mut impl io::Write,
) -> Result<()> {
    let mut entry = archive.by_index(index).map_err(|error| damaged(name, &error))?;
    let size = entry.size();
    let written = io::copy(&mut entry.by_ref().take(size), target).map_err(|error| damaged(name, &error))?;
    // Reading past the end compares the checksum.
    let more = entry.read(&mut [0]).map_err(|error| damaged(name, &error))?;
    if written != size || more != 0 {
        return Err(damaged(name, &format!("its size differs from the {size} bytes that the archive declares")));
    }
    Ok(())
}

/// Rejects a file that is larger than its kind can be.
fn check_size(name: &str, size: u64, largest: Option<u64>) -> Result<()> {
    let Some(most) = largest.filter(|most| size > *most) else { return Ok(()) };
    let problem = format!("it would take {size} bytes unpacked, more than the limit of {most} bytes for this file");
    Err(Failure::new(
        format!("entry {name}"),
        problem,
        "Do not trust this file; recreate the FMU with `tiprub package`",
    ))
}

fn damaged(name: &str, error: &dyn std::fmt::Display) -> Failure {
    let remedy = "Copy the file again or recreate it with `tiprub package`";
    Failure::new(format!("entry {name}"), format!("damaged ({error})"), remedy)
}

impl UnpackedFmu {
    /// Unzips to a temporary directory and reads modelDescription.xml.
    ///
    /// # Errors
    /// A file that is not a zip, a damaged entry, a name that leads out of the directory, or an unreadable description.
    pub fn open(path: &Path) -> Result<Self> {
        Self::open_part(path, |_| Some(LARGEST_UNPACKED))
    }

    /// Opens an FMU and unpacks modelDescription.xml and the entries for which `largest` returns a maximum size
    /// (bytes); the others are only read, to check them.
    ///
    /// # Errors
    /// Same as [`UnpackedFmu::open`]; an entry above its maximum size, before any is unpacked.
    pub fn open_part(path: &Path, largest: impl Fn(&str) -> Option<u64>) -> Result<Self> {
        let in_file = |failure: Failure| failure.at(path.display());
        let mut archive = open_archive(path)?;
        let largest = |name: &str| if name == DESCRIPTION { Some(LARGEST_DESCRIPTION) } else { largest(name) };
        let entries = entries(&mut archive).map_err(in_file)?;
        for (name, size) in &entries {
            check_size(name, *size, largest(name)).map_err(in_file)?;
        }
        let directory = TempDir::with_prefix("tiprub-fmu-")
            .map_err(|error| Failure::file(&std::env::temp_dir(), "cannot create a temporary directory", &error))?;
        for (index, (name, _)) in entries.into_iter().enumerate() {
            let unpacked = if largest(&name).is_some() {
                unpack(&mut archive, index, &name, directory.path())
            } else {
                unpack_entry(&mut archive, index, &name, &mut io::sink())
            };
            unpacked.map_err(in_file)?;
        }
        let description_path = directory.path().join(DESCRIPTION);
        let text = tiprub_format::read_file(&description_path, LARGEST_DESCRIPTION)
            .and_then(|bytes| String::from_utf8(bytes).map_err(io::Error::other));
        let text = text.map_err(|error| {
            Failure::new(
                path.display(),
                format!("has no readable modelDescription.xml ({error})"),
                "Give an FMU: a zip archive with this file at its root",
            )
        })?;
        let description = parse(&text).map_err(in_file)?;
        Ok(Self { directory, description })
    }

    /// Returns the path of the shared library for this machine.
    ///
    /// # Errors
    /// An FMU without such a library; the message lists the ones it has.
    pub(crate) fn library(&self) -> Result<PathBuf> {
        let (version, identifier) = (self.description.fmi_version.as_str(), self.description.model_identifier.as_str());
        let place = |platform: Platform| platform.place(version, identifier);
        let path = Platform::here().map(|here| self.directory.path().join(place(here)));
        if let Some(path) = path.filter(|path| path.is_file()) {
            return Ok(path);
        }
        let held = Platform::ALL.into_iter().filter(|platform| self.directory.path().join(place(*platform)).is_file());
        let held = held.map(Platform::tuple).collect::<Vec<_>>().join(", ");
        Err(Failure::new(
            "FMU",
            format!(
                "has no library for {}-{}; available platforms: {}",
                std::env::consts::ARCH,
                std::env::consts::OS,
                if held.is_empty() { "none" } else { &held }
            ),
            "Package it for this platform: `tiprub package --platform`",
        ))
    }

    /// Returns the directory of the unpacked resources.
    pub fn resources(&self) -> PathBuf {
        self.directory.path().join("resources")
    }

    /// Simulates over the schedule and records all outputs.
    ///
    /// # Errors
    /// A library that cannot be loaded, or a call with a status worse than Warning; the FMU's messages are included.
    pub fn simulate(&self, schedule: &Schedule, progress: &dyn Fn(usize)) -> Result<ImportedRun> {
        Session::new(self)?.run(schedule, progress)
    }
}

fn unpack(archive: &mut ZipArchive<impl Read + io::Seek>, index: usize, name: &str, directory: &Path) -> Result<()> {
    if name.ends_with('/') {
        return Ok(());
    }
    let target = inside(directory, name)?;
    if let Some(parent) = target.parent() {
        fs::create_dir_all(parent).map_err(|error| Failure::file(parent, "cannot be created", &error))?;
    }
    let mut file = fs::File::create(&target).map_err(|error| Failure::file(&target, "cannot be written", &error))?;
    unpack_entry(archive, index, name, &mut file)
}

/// Returns the path to which an entry is unpacked.
fn inside(directory: &Path, name: &str) -> Result<PathBuf> {
    let relative = Path::new(name);
    if relative.components().all(|component| matches!(component, Component::Normal(_))) {
        return Ok(directory.join(relative));
    }
    Err(Failure::new(name, "points outside the archive", "Do not trust this file"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archive::{self, ArchiveEntry};

    fn archive_with(entries: &[ArchiveEntry]) -> (TempDir, PathBuf) {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("x.fmu");
        archive::write(&path, entries).unwrap();
        (root, path)
    }

    #[test]
    fn rejects_truncated_zip_with_name_and_remedy() {
        let (_root, path) = archive_with(&[ArchiveEntry::new("modelDescription.xml", "x".repeat(1000))]);
        let bytes = fs::read(&path).unwrap();
        for length in [0, 1, 30, bytes.len() / 2, bytes.len() - 1] {
            fs::write(&path, &bytes[..length]).unwrap();
            let failure = UnpackedFmu::open(&path).unwrap_err();
            assert!(failure.what.ends_with("x.fmu"), "{failure}");
            assert!(failure.problem.contains("not a complete zip") && failure.remedy.contains("again"), "{failure}");
        }
    }

    #[test]
    fn bit_flips_never_panic() {
        let (_root, path) =
            archive_with(&[ArchiveEntry::new("modelDescription.xml", "<a/>".repeat(50)), ArchiveEntry::new("b", "c")]);
        let bytes = fs::read(&path).unwrap();
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x41;
            fs::write(&path, damaged).unwrap();
            assert!(UnpackedFmu::open(&path).is_err(), "no FMU to begin with");
        }
    }

    #[test]
    fn rejects_zip_that_is_not_an_fmu_by_name() {
        let (_root, path) = archive_with(&[ArchiveEntry::new("a.txt", "hello")]);
        assert!(UnpackedFmu::open(&path).unwrap_err().problem.contains("modelDescription.xml"));
    }

    #[test]
    fn rejects_names_outside_the_target_directory() {
        let root = tempfile::tempdir().unwrap();
        assert!(inside(root.path(), "../evil").is_err());
        assert!(inside(root.path(), "/evil").is_err());
        assert_eq!(inside(root.path(), "a/b").unwrap(), root.path().join("a/b"));
    }

    /// Changes the declared size of an entry, in its local header and in the directory.
    fn announce(path: &Path, size: u32) {
        let mut bytes = fs::read(path).unwrap();
        let mut change = |at: usize| bytes[at..at + 4].copy_from_slice(&size.to_le_bytes());
        change(22);
        let directory = fs::read(path).unwrap().windows(4).position(|four| four == b"PK\x01\x02").unwrap();
        change(directory + 24);
        fs::write(path, bytes).unwrap();
    }

    #[test]
    fn rejects_zip_bomb_before_unpacking() {
        let (_root, path) = archive_with(&[ArchiveEntry::new("resources/zeros", vec![0; 1 << 20])]);
        announce(&path, 3 << 30);
        let failure = UnpackedFmu::open(&path).unwrap_err();
        assert!(failure.to_string().contains("x.fmu") && failure.problem.contains("3221225472 bytes"), "{failure}");
        // An entry that declares less than it holds is not unpacked further.
        for size in [0, 1, (1 << 20) - 1, (1 << 20) + 1] {
            announce(&path, size);
            let failure = UnpackedFmu::open(&path).unwrap_err();
            assert!(
                failure.to_string().contains("resources/zeros") && failure.problem.contains("damaged"),
                "{size}: {failure}"
            );
        }
    }

    /// A well compressed entry, such as a text of newlines, may not take more disk or memory than its kind can need.
    #[test]
    fn rejects_oversized_entries_before_unpacking() {
        for name in [DESCRIPTION, "resources/scene.toml", "resources/package.toml", "resources/a.safetensors"] {
            let (_root, path) = archive_with(&[ArchiveEntry::new(name, "\n".repeat(1 << 16))]);
            announce(&path, 1 << 30);
            let resource = |name: &str| name.strip_prefix("resources/").and_then(tiprub_format::largest_resource);
            let failure = UnpackedFmu::open_part(&path, resource).unwrap_err();
            assert!(failure.what.ends_with(&format!("entry {name}")), "{failure}");
            assert!(failure.problem.contains("1073741824 bytes unpacked, more than the"), "{failure}");
        }
    }

    #[test]
    fn unpacks_only_requested_entries_and_verifies_them() {
        let (_root, path) =
            archive_with(&[ArchiveEntry::new("a", "x".repeat(100)), ArchiveEntry::new(DESCRIPTION, "no XML")]);
        let root = tempfile::tempdir().unwrap();
        let mut archive = open_archive(&path).unwrap();
        let mut sizes = entries(&mut archive).unwrap();
        assert_eq!(sizes.remove(0), ("a".to_owned(), 100));
        let mut few = Vec::new();
        unpack_entry(&mut archive, 0, "a", &mut few).unwrap();
        assert_eq!(few, "x".repeat(100).into_bytes());
        unpack(&mut archive, 0, "a", root.path()).unwrap();
        assert_eq!(fs::read(root.path().join("a")).unwrap(), few);
    }
}
