//! The zip archive of an FMU: strict, small and reproducible.
//!
//! Importers differ in the zip features they can read, so the archive follows these rules: entries are stored or
//! deflated, need no more than zip 2.0, have no zip64 fields, no data descriptors, no directories and no "./"; names
//! are ASCII with forward slashes; the first entry in the file is the first one passed. Equal entries give equal bytes:
//! time stamps are 1980-01-01 00:00:00 (the zip epoch) and permissions are fixed.

use std::{
    collections::BTreeSet,
    io::{Seek, Write},
    path::Path,
};

use tiprub_shell::{Failure, Result, output_file};
use zip::{CompressionMethod, DateTime, ZipWriter, write::SimpleFileOptions};

/// One file inside the archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArchiveEntry {
    /// Name with forward slashes, relative to the root of the archive.
    pub name: String,
    /// Contents.
    pub bytes: Vec<u8>,
}

impl ArchiveEntry {
    /// Creates an entry.
    pub fn new(name: impl Into<String>, bytes: impl Into<Vec<u8>>) -> Self {
        Self { name: name.into(), bytes: bytes.into() }
    }
}

/// Writes the archive to `target`, completely or not at all. It is created in memory, because the zip library prints a
/// message when writing an unfinished archive fails.
///
/// # Errors
/// A name that breaks the rules above, a file that is too large, or a failed write.
pub fn write(target: &Path, entries: &[ArchiveEntry]) -> Result<()> {
    let mut archive = std::io::Cursor::new(Vec::new());
    write_into(&mut archive, entries).map_err(|failure| failure.at(target.display()))?;
    output_file::write(target, archive.into_inner())
}

/// Writes the archive to any seekable target.
///
/// # Errors
/// Same as [`write()`].
pub(crate) fn write_into(target: impl Write + Seek, entries: &[ArchiveEntry]) -> Result<()> {
    check_names(entries)?;
    let mut writer = ZipWriter::new(target);
    for entry in entries {
        writer
            .start_file(entry.name.as_str(), options(entry))
            .map_err(|error| Failure::new(&entry.name, format!("cannot be added: {error}"), ""))?;
        writer.write_all(&entry.bytes).map_err(|error| {
            Failure::new(&entry.name, format!("cannot be written: {error}"), "Check the free disk space")
        })?;
    }
    writer.finish().map_err(|error| Failure::new("archive", format!("cannot be finished: {error}"), ""))?;
    Ok(())
}

fn options(entry: &ArchiveEntry) -> SimpleFileOptions {
    // Deflating a picture or an empty file only makes it larger.
    let stored = entry.bytes.is_empty() || entry.name.ends_with(".png");
    let shared_library = entry.name.starts_with("binaries/");
    SimpleFileOptions::default()
        .compression_method(if stored { CompressionMethod::Stored } else { CompressionMethod::Deflated })
        .compression_level(if stored { None } else { Some(9) })
        .last_modified_time(DateTime::default())
        .large_file(false)
        .unix_permissions(if shared_library { 0o755 } else { 0o644 })
}

fn check_names(entries: &[ArchiveEntry]) -> Result<()> {
    let mut seen = BTreeSet::new();
    for entry in entries {
        let name = entry.name.as_str();
        let parts_legal = name.split('/').all(|part| !matches!(part, "" | "." | ".."));
        let characters_legal = name.bytes().all(|byte| matches!(byte, 0x20..0x7f) && byte != b'\\' && byte != b':');
        if !parts_legal || !characters_legal {
            return Err(Failure::new(
                name,
                "not a valid file name in an FMU",
                "Use ASCII letters and digits, relative paths and forward slashes",
            ));
        }
        if u32::try_from(entry.bytes.len()).is_err() {
            let remedy = "Reduce the model: files in an FMU must be smaller than 4 GiB";
            return Err(Failure::new(name, "the file is 4 GiB or larger", remedy));
        }
        if !seen.insert(name) {
            return Err(Failure::new(name, "the archive contains this name twice", "Give the files different names"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn sample() -> Vec<ArchiveEntry> {
        let noise: Vec<u8> =
            (0..5000_u32).map(|i| u8::try_from(i.wrapping_mul(2_654_435_761) >> 24).unwrap()).collect();
        vec![
            ArchiveEntry::new("modelDescription.xml", "<fmiModelDescription/>".repeat(50)),
            ArchiveEntry::new("binaries/linux64/tiprub.so", noise),
            ArchiveEntry::new("resources/empty", ""),
            ArchiveEntry::new("model.png", [1, 2, 3]),
        ]
    }

    fn bytes(entries: &[ArchiveEntry]) -> Vec<u8> {
        let mut buffer = Cursor::new(Vec::new());
        write_into(&mut buffer, entries).unwrap();
        buffer.into_inner()
    }

    fn u16_at(bytes: &[u8], at: usize) -> u16 {
        u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap())
    }

    fn u32_at(bytes: &[u8], at: usize) -> usize {
        usize::try_from(u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())).unwrap()
    }

    /// Checks every header field against the layout in PKWARE's APPNOTE 4.3.7, 4.3.12 and 4.3.16, without another
    /// library.
    #[test]
    fn zip_headers_conform_to_the_specification() {
        let entries = sample();
        let archive = bytes(&entries);
        let mut at = 0;
        let mut offsets = Vec::new();
        for entry in &entries {
            offsets.push(at);
            assert_eq!(&archive[at..at + 4], b"PK\x03\x04", "local header of {}", entry.name);
            let stored = entry.name.ends_with("empty") || entry.name.ends_with(".png");
            assert!(u16_at(&archive, at + 4) <= 20, "version needed of {}", entry.name);
            assert_eq!(u16_at(&archive, at + 6), 0, "flags of {}: no data descriptor, no encryption", entry.name);
            assert_eq!(u16_at(&archive, at + 8), if stored { 0 } else { 8 }, "method of {}", entry.name);
            assert_eq!((u16_at(&archive, at + 10), u16_at(&archive, at + 12)), (0, 0x21), "time of {}", entry.name);
            let (packed, unpacked) = (u32_at(&archive, at + 18), u32_at(&archive, at + 22));
            assert_eq!(unpacked, entry.bytes.len());
            let name_length = usize::from(u16_at(&archive, at + 26));
            assert_eq!(u16_at(&archive, at + 28), 0, "extra field of {}", entry.name);
            assert_eq!(&archive[at + 30..at + 30 + name_length], entry.name.as_bytes());
            at += 30 + name_length + packed;
        }
        let directory = at;
        for (entry, offset) in entries.iter().zip(&offsets) {
            assert_eq!(&archive[at..at + 4], b"PK\x01\x02", "central header of {}", entry.name);
            assert!(u16_at(&archive, at + 6) <= 20, "version needed of {}", entry.name);
            assert_eq!(u16_at(&archive, at + 8), 0, "flags of {}", entry.name);
            assert_eq!((u16_at(&archive, at + 12), u16_at(&archive, at + 14)), (0, 0x21), "time of {}", entry.name);
            assert_eq!((u16_at(&archive, at + 30), u16_at(&archive, at + 32)), (0, 0), "extra, comment");
            assert_eq!(u32_at(&archive, at + 42), *offset);
            at += 46 + usize::from(u16_at(&archive, at + 28));
        }
        assert_eq!(&archive[at..at + 4], b"PK\x05\x06", "no zip64 record between directory and end");
        assert_eq!(usize::from(u16_at(&archive, at + 10)), entries.len());
        assert_eq!((u32_at(&archive, at + 12), u32_at(&archive, at + 16)), (at - directory, directory));
        assert_eq!(at + 22, archive.len(), "no comment, nothing behind the end");
    }

    #[test]
    fn archives_are_reproducible_and_round_trip() {
        let entries = sample();
        let archive = bytes(&entries);
        assert_eq!(archive, bytes(&entries));
        let mut reader = zip::ZipArchive::new(Cursor::new(archive)).unwrap();
        for (index, entry) in entries.iter().enumerate() {
            let mut file = reader.by_index(index).unwrap();
            let mut contents = Vec::new();
            std::io::Read::read_to_end(&mut file, &mut contents).unwrap();
            assert_eq!(file.name().unwrap(), entry.name);
            assert_eq!(contents, entry.bytes);
        }
    }

    #[test]
    fn rejects_names_that_importers_cannot_handle() {
        for name in ["./a", "a//b", "/a", "a\\b", "../a", "", "a/", "ä", "c:a"] {
            let failure = write_into(Cursor::new(Vec::new()), &[ArchiveEntry::new(name, "x")]).unwrap_err();
            assert_eq!(failure.what, name);
        }
        let twice = [ArchiveEntry::new("a", "x"), ArchiveEntry::new("a", "y")];
        assert!(write_into(Cursor::new(Vec::new()), &twice).unwrap_err().problem.contains("twice"));
    }

    #[test]
    fn rejected_archive_leaves_no_file() {
        let root = tempfile::tempdir().unwrap();
        assert!(write(&root.path().join("x.fmu"), &[ArchiveEntry::new("./a", "x")]).is_err());
        assert_eq!(std::fs::read_dir(root.path()).unwrap().count(), 0);
    }
}
