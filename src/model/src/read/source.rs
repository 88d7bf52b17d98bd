//! Lines of files that carry their position for messages.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{fmt, io};

use crate::{Error, Result};

/// Line of a file, for messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct SourceLine {
    /// Name of the file, as requested.
    pub file: Arc<str>,
    /// Line, from 1.
    pub line: usize,
}

impl fmt::Display for SourceLine {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}", self.file, self.line)
    }
}

impl SourceLine {
    /// Returns an error at this line.
    pub(super) fn error(&self, problem: impl ToString, remedy: impl ToString) -> Error {
        Error::read(self, problem, remedy)
    }
}

/// Function that opens files; tests keep files in memory.
pub(super) type Open<'a> = &'a dyn Fn(&Path) -> Result<Vec<u8>>;

/// Largest supported file (bytes): far beyond any mesh, far below the memory of the machine.
const LARGEST: u64 = 32 << 30;

/// Reads a whole file from disk. Rejects pipes and devices, which may have no end or never begin.
pub(super) fn open_file(path: &Path) -> Result<Vec<u8>> {
    let refuse = |problem: &str| Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    let read = std::fs::metadata(path).and_then(|metadata| {
        if !(metadata.is_file() || metadata.is_dir()) {
            return refuse("this is a pipe or a device, not a regular file");
        }
        if metadata.len() > LARGEST { refuse("the file is larger than 32 GiB") } else { std::fs::read(path) }
    });
    read.map_err(|source| Error::File { path: path.to_path_buf(), source })
}

/// Returns an error about a whole file.
pub(super) fn about(path: &Path, problem: impl ToString, remedy: impl ToString) -> Error {
    Error::read(path.display(), problem, remedy)
}

/// Returns the text of a file. Comments and headings come in many encodings, so bytes that are not UTF-8 are
/// replaced; if they matter (names of sets), the replacement character is visible in every message.
pub(super) fn text_of(bytes: &[u8]) -> String {
    let without_mark = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    String::from_utf8_lossy(without_mark).into_owned()
}

/// Resolves a path in a file relative to the directory of that file.
pub(super) fn beside(file: &Path, written: &str) -> PathBuf {
    // Files that were written on Windows may contain its separators.
    let written = written.trim().trim_matches(['"', '\'']).replace('\\', "/");
    file.parent().unwrap_or(Path::new("")).join(written)
}

/// Reads a finite number, including the Fortran exponent letter D.
pub(super) fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    let value = text.parse::<f64>().ok().or_else(|| text.replace(['d', 'D'], "e").parse().ok())?;
    // The standard library also parses `inf` and `nan`.
    value.is_finite().then_some(value)
}
