//! A packaged FMU driven the way any importer would: unzip, read modelDescription.xml, load the shared library,
//! and go through the standard's call sequence. It knows nothing of the scene or of the core behind the ABI.

mod description;
mod fmi2;
mod fmi3;
mod session;
mod slave;

use std::{
    fs,
    io::Read,
    path::{Component, Path, PathBuf},
    time::Duration,
};

use tempfile::TempDir;
use zip::ZipArchive;

pub use description::{ImportedDescription, ImportedVariable, VariableType, parse};
pub use session::Session;

use crate::{Failure, Result, recording::Recording, schedule::Schedule};

/// Largest uncompressed size accepted for one file of an archive: far beyond any FMU, far below a zip bomb.
const LARGEST_FILE: u64 = 4 << 30;

/// An FMU unpacked to a temporary directory, which lives as long as this value.
#[derive(Debug)]
pub struct UnpackedFmu {
    directory: TempDir,
    /// What modelDescription.xml says.
    pub description: ImportedDescription,
}

/// Results of a run through the C ABI.
#[derive(Debug, Clone)]
pub struct ImportedRun {
    /// All outputs at all communication points.
    pub recording: Recording,
    /// Time spent inside doStep.
    pub stepping: Duration,
    /// What the FMU logged.
    pub messages: Vec<String>,
}

/// Open a zip for reading, with messages for the ways in which a file can fail to be one.
///
/// # Errors
/// The file cannot be opened or is not a whole zip.
pub fn open_archive(path: &Path) -> Result<ZipArchive<std::io::BufReader<fs::File>>> {
    let file = fs::File::open(path).map_err(|error| Failure::file(path, "cannot be opened", &error))?;
    ZipArchive::new(std::io::BufReader::new(file)).map_err(|error| {
        Failure::new(
            path.display(),
            format!("not a whole zip archive ({error})"),
            "The file is truncated or no FMU. Copy it again, or make it again with `tiprub package`",
        )
    })
}

/// Contents of entry `index`, checked against its CRC.
///
/// # Errors
/// Damaged entry, illegal name, or absurd size.
pub fn read_entry(archive: &mut ZipArchive<impl Read + std::io::Seek>, index: usize) -> Result<(String, Vec<u8>)> {
    let damaged = |name: &str, error: &dyn std::fmt::Display| {
        Failure::new(
            format!("entry {name}"),
            format!("damaged ({error})"),
            "Copy the file again, or make it again with `tiprub package`",
        )
    };
    let entry = archive.by_index(index).map_err(|error| damaged(&format!("{}", index + 1), &error))?;
    let name = entry.name().map(std::borrow::Cow::into_owned);
    let name = name.map_err(|error| damaged(&format!("{}", index + 1), &error))?;
    if entry.size() > LARGEST_FILE {
        return Err(damaged(&name, &format!("{} bytes announced", entry.size())));
    }
    let mut bytes = Vec::new();
    entry.take(LARGEST_FILE).read_to_end(&mut bytes).map_err(|error| damaged(&name, &error))?;
    Ok((name, bytes))
}

impl UnpackedFmu {
    /// Unzip to a temporary directory and read modelDescription.xml.
    ///
    /// # Errors
    /// Not a zip, a damaged entry, a name that leads out of the directory, or an unreadable description.
    pub fn open(path: &Path) -> Result<Self> {
        let in_file = |failure: Failure| Failure { what: format!("{}: {}", path.display(), failure.what), ..failure };
        let mut archive = open_archive(path)?;
        let directory = TempDir::with_prefix("tiprub-fmu-")
            .map_err(|error| Failure::file(&std::env::temp_dir(), "no temporary directory can be made", &error))?;
        for index in 0..archive.len() {
            let (name, bytes) = read_entry(&mut archive, index).map_err(in_file)?;
            unpack(directory.path(), &name, &bytes).map_err(in_file)?;
        }
        let description_path = directory.path().join("modelDescription.xml");
        let text = fs::read_to_string(&description_path).map_err(|error| {
            Failure::new(
                path.display(),
                format!("has no readable modelDescription.xml ({error})"),
                "An FMU has this file at its root; is this one?",
            )
        })?;
        let description = parse(&text).map_err(in_file)?;
        Ok(Self { directory, description })
    }

    /// The shared library for this machine.
    ///
    /// # Errors
    /// The FMU has none.
    pub fn library(&self) -> Result<PathBuf> {
        let platform = if self.description.fmi_version.starts_with('2') { "linux64" } else { "x86_64-linux" };
        let name = format!("binaries/{platform}/{}.so", self.description.model_identifier);
        let path = self.directory.path().join(&name);
        if path.is_file() {
            Ok(path)
        } else {
            Err(Failure::new("FMU", format!("has no {name}"), "It was not made for this platform"))
        }
    }

    /// Directory of the unpacked resources.
    pub fn resources(&self) -> PathBuf {
        self.directory.path().join("resources")
    }

    /// Co-simulate over the schedule and record all outputs.
    ///
    /// # Errors
    /// The library cannot be loaded, or a call answers worse than Warning; the FMU's own messages are included.
    pub fn simulate(&self, schedule: &Schedule, progress: &dyn Fn(usize)) -> Result<ImportedRun> {
        let library = slave::load(&self.library()?)?;
        let run = |slave: &mut dyn slave::Slave| slave::drive(slave, &self.description, schedule, progress);
        match self.description.fmi_version.as_str() {
            "2.0" => run(&mut fmi2::Fmi2Slave::new(self, library)?),
            "3.0" => run(&mut fmi3::Fmi3Slave::new(self, library)?),
            other => Err(Failure::new("FMU", format!("FMI version {other}"), "Only 2.0 and 3.0 can be imported")),
        }
    }
}

fn unpack(directory: &Path, name: &str, bytes: &[u8]) -> Result<()> {
    if name.ends_with('/') {
        return Ok(());
    }
    let relative = Path::new(name);
    if !relative.components().all(|component| matches!(component, Component::Normal(_))) {
        return Err(Failure::new(name, "leads out of the archive", "Do not trust this file"));
    }
    let target = directory.join(relative);
    if let Some(parent) = target.parent() {
        fs::create_dir_all(parent).map_err(|error| Failure::file(parent, "cannot be made", &error))?;
    }
    fs::write(&target, bytes).map_err(|error| Failure::file(&target, "cannot be written", &error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archive::{self, Entry};

    fn archive_with(entries: &[Entry]) -> (TempDir, PathBuf) {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("x.fmu");
        archive::write(&path, entries).unwrap();
        (root, path)
    }

    #[test]
    fn a_truncated_zip_is_named_with_a_remedy() {
        let (_root, path) = archive_with(&[Entry::new("modelDescription.xml", "x".repeat(1000))]);
        let bytes = fs::read(&path).unwrap();
        for length in [0, 1, 30, bytes.len() / 2, bytes.len() - 1] {
            fs::write(&path, &bytes[..length]).unwrap();
            let failure = UnpackedFmu::open(&path).unwrap_err();
            assert!(failure.what.ends_with("x.fmu"), "{failure}");
            assert!(failure.problem.contains("not a whole zip") && failure.remedy.contains("again"), "{failure}");
        }
    }

    #[test]
    fn flipped_bits_anywhere_never_panic() {
        let (_root, path) =
            archive_with(&[Entry::new("modelDescription.xml", "<a/>".repeat(50)), Entry::new("b", "c")]);
        let bytes = fs::read(&path).unwrap();
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x41;
            fs::write(&path, damaged).unwrap();
            assert!(UnpackedFmu::open(&path).is_err(), "no FMU to begin with");
        }
    }

    #[test]
    fn a_zip_that_is_no_fmu_is_named() {
        let (_root, path) = archive_with(&[Entry::new("a.txt", "hello")]);
        assert!(UnpackedFmu::open(&path).unwrap_err().problem.contains("modelDescription.xml"));
    }

    #[test]
    fn names_that_lead_out_are_refused() {
        let root = tempfile::tempdir().unwrap();
        assert!(unpack(root.path(), "../evil", b"x").is_err());
        assert!(unpack(root.path(), "/evil", b"x").is_err());
        unpack(root.path(), "a/b", b"x").unwrap();
        assert_eq!(fs::read(root.path().join("a/b")).unwrap(), b"x");
    }
}
