//! Journal of finished rows: a text file to which each row is appended when its run ends.
//!
//! A line contains the digest of a row, names and values, and a checksum, separated by tabs. If the program is killed while it writes a line, the
//! line is cut: it is removed when the journal is opened again, and only that run is repeated.

use std::{
    fs::{self, File, TryLockError},
    io::{Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};
use tiprub_shell::{Failure, Result, output_file};
use tiprub_table::Cell;

use crate::row::Row;

/// First line of the file.
const HEADER: &str = "tiprub sweep journal, version 1\n";
/// Number of hexadecimal digits of a checksum.
const CHECKSUM_DIGITS: usize = 16;

/// Open journal. Only one process at a time can open it.
#[derive(Debug)]
pub struct Journal {
    file: File,
    path: PathBuf,
}

impl Journal {
    /// Opens or creates a journal, and returns its rows. A cut line at the end is removed, and damaged lines are ignored.
    ///
    /// # Errors
    /// The file cannot be written, is not a journal, or another process has it open.
    pub fn open(path: &Path) -> Result<(Self, Vec<Row>)> {
        let (mut file, bytes) = open_locked(path, HEADER.as_bytes())?;
        let failed = |error: std::io::Error| Failure::file(path, "cannot be written", &error);
        // Only whole lines count.
        let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
        let text = String::from_utf8_lossy(&bytes[..whole]);
        let rows = text.lines().skip(1).filter_map(decoded).collect();
        if whole == 0 {
            file.set_len(0).map_err(failed)?;
            file.rewind().and_then(|()| file.write_all(HEADER.as_bytes())).map_err(failed)?;
        } else {
            file.set_len(whole as u64).map_err(failed)?;
            file.seek(SeekFrom::End(0)).map_err(failed)?;
        }
        Ok((Self { file, path: path.to_owned() }, rows))
    }

    /// Appends a row.
    ///
    /// # Errors
    /// The file cannot be written, for example because the disk is full.
    pub fn append(&mut self, row: &Row) -> Result<()> {
        let line = encoded(row);
        self.file.write_all(line.as_bytes()).map_err(|error| Failure::file(&self.path, "cannot be written", &error))
    }

    /// Removes the journal.
    ///
    /// # Errors
    /// The file cannot be removed.
    pub fn remove(self) -> Result<()> {
        fs::remove_file(&self.path).map_err(|error| Failure::file(&self.path, "cannot be removed", &error))
    }
}

/// Opens or creates a file for appending, and returns its content. Another process cannot open it in this way at the same time.
///
/// # Errors
/// The file cannot be opened, does not begin with `header` or with a part of it, or another process has it open.
pub(crate) fn open_locked(path: &Path, header: &[u8]) -> Result<(File, Vec<u8>)> {
    output_file::only_a_file(path)?;
    if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        output_file::create_directory(parent)?;
    }
    let failed = |error: std::io::Error| Failure::file(path, "cannot be opened for writing", &error);
    let mut file = loop {
        let mut options = File::options();
        let file = options.read(true).write(true).create(true).truncate(false).open(path).map_err(failed)?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            let remedy = "Wait until the other process has finished, or write to another file or directory";
            return Err(Failure::new(path.display(), "another process is working on this part", remedy));
        }
        // The process that had locked the file may have removed it.
        if is_at(&file, path) {
            break file;
        }
    };
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(failed)?;
    let common = header.len().min(bytes.len());
    if bytes[..common] != header[..common] {
        let remedy = "Remove the file, or write to another file or directory";
        return Err(Failure::new(path.display(), "exists and is not a journal of this release", remedy));
    }
    Ok((file, bytes))
}

/// Returns whether the path still names an open file.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |found: std::io::Result<fs::Metadata>| found.ok().map(|data| (data.dev(), data.ino()));
    let open = identity(file.metadata());
    open.is_some() && open == identity(fs::metadata(path))
}

/// Returns whether the path still names an open file. These systems do not remove open files.
#[cfg(not(unix))]
fn is_at(_file: &File, _path: &Path) -> bool {
    true
}

fn encoded(row: &Row) -> String {
    let mut line = row.digest.clone();
    for (name, cell) in &row.cells {
        let (kind, value) = match cell {
            Cell::Integer(value) => ('i', value.to_string()),
            Cell::Real(value) => ('r', value.to_string()),
            Cell::Boolean(value) => ('b', value.to_string()),
            Cell::Text(value) => ('t', escaped(value)),
        };
        line.push_str(&format!("\t{}\t{kind}{value}", escaped(name)));
    }
    let sum = checksum(&line);
    format!("{line}\t{sum}\n")
}

/// Returns the row of a line; `None` if the line is damaged.
fn decoded(line: &str) -> Option<Row> {
    let (content, sum) = line.rsplit_once('\t')?;
    if sum != checksum(content) {
        return None;
    }
    let mut items = content.split('\t');
    let digest = items.next()?.to_owned();
    let mut cells = Vec::new();
    while let Some(name) = items.next() {
        let (kind, value) = items.next()?.split_at_checked(1)?;
        let cell = match kind {
            "i" => Cell::Integer(value.parse().ok()?),
            "r" => Cell::Real(value.parse().ok()?),
            "b" => Cell::Boolean(value.parse().ok()?),
            "t" => Cell::Text(restored(value)),
            _ => return None,
        };
        cells.push((restored(name), cell));
    }
    Some(Row { digest, cells })
}

fn checksum(text: &str) -> String {
    let digits: String = Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect();
    digits[..CHECKSUM_DIGITS].to_owned()
}

/// Replaces tabs and line breaks.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\").replace('\t', "\\t").replace('\n', "\\n").replace('\r', "\\r")
}

fn restored(text: &str) -> String {
    let (mut plain, mut letters) = (String::new(), text.chars());
    while let Some(letter) = letters.next() {
        plain.push(match (letter, letter == '\\') {
            (_, true) => match letters.next() {
                Some('t') => '\t',
                Some('n') => '\n',
                Some('r') => '\r',
                other => other.unwrap_or('\\'),
            },
            (letter, false) => letter,
        });
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(number: i64) -> Row {
        let cells = vec![
            ("count".to_owned(), Cell::Integer(number)),
            ("front.mean\tforce".to_owned(), Cell::Real(1.0 / (number as f64 - 2.0))),
            ("tiny".to_owned(), Cell::Real(-5e-324)),
            ("reason".to_owned(), Cell::Text("a\\n\tb\nc \r µ".to_owned())),
            ("on".to_owned(), Cell::Boolean(number % 2 == 0)),
            ("empty".to_owned(), Cell::Text(String::new())),
        ];
        Row { digest: format!("{number:064x}"), cells }
    }

    fn written(path: &Path, count: i64) -> Vec<Row> {
        let (mut journal, _) = Journal::open(path).unwrap();
        let rows: Vec<Row> = (0..count).map(row).collect();
        rows.iter().for_each(|row| journal.append(row).unwrap());
        rows
    }

    /// The process that had locked the file may have removed it, and another process may have created a new file.
    #[cfg(unix)]
    #[test]
    fn removed_files_are_recognised() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.journal");
        let file = File::create(&path).unwrap();
        assert!(is_at(&file, &path));
        fs::remove_file(&path).unwrap();
        assert!(!is_at(&file, &path));
        fs::write(&path, "").unwrap();
        assert!(!is_at(&file, &path));
    }

    #[test]
    fn rows_read_back_to_the_same_bits() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.journal");
        let rows = written(&path, 5);
        let (journal, found) = Journal::open(&path).unwrap();
        assert_eq!(found.len(), 5);
        for (one, two) in rows.iter().zip(&found) {
            let same = |(one, two): (&(String, Cell), &(String, Cell))| one.0 == two.0 && one.1.is_identical(&two.1);
            assert!(one.digest == two.digest && one.cells.iter().zip(&two.cells).all(same), "{one:?} {two:?}");
        }
        journal.remove().unwrap();
        assert!(!path.exists());
    }

    /// The file is cut at every byte: all rows whose lines are complete remain, and new rows follow them.
    #[test]
    fn cut_journal_keeps_all_complete_rows() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.journal");
        let rows = written(&path, 3);
        let whole = fs::read(&path).unwrap();
        for length in 0..=whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            let complete = whole[..length].iter().filter(|byte| **byte == b'\n').count().saturating_sub(1);
            let (mut journal, found) = Journal::open(&path).unwrap();
            assert_eq!(found, rows[..complete], "{length}");
            journal.append(&row(9)).unwrap();
            drop(journal);
            let (_, found) = Journal::open(&path).unwrap();
            assert_eq!((found.len(), found.last()), (complete + 1, Some(&row(9))), "{length}");
        }
    }

    #[test]
    fn damaged_lines_are_ignored() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.journal");
        let rows = written(&path, 3);
        let text = fs::read_to_string(&path).unwrap();
        let second = text.match_indices("count\ti1").next().unwrap().0;
        for damage in ["kount\ti1", "count\ti7", "count\tx1", "\0\0\0\0\0\0\0\0"] {
            let mut bytes = text.clone().into_bytes();
            bytes[second..second + damage.len()].copy_from_slice(damage.as_bytes());
            fs::write(&path, bytes).unwrap();
            let (_, found) = Journal::open(&path).unwrap();
            assert_eq!(found, [rows[0].clone(), rows[2].clone()], "{damage}");
        }
    }

    #[test]
    fn journal_of_a_running_sweep_and_other_files_are_rejected() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.journal");
        let (_journal, _) = Journal::open(&path).unwrap();
        assert!(Journal::open(&path).unwrap_err().problem.contains("another process"));
        let other = root.path().join("other");
        fs::write(&other, "speed,force\n1,2\n").unwrap();
        assert!(Journal::open(&other).unwrap_err().problem.contains("not a journal"));
        assert_eq!(fs::read_to_string(&other).unwrap(), "speed,force\n1,2\n");
    }
}
