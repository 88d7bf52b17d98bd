//! Sequential reading of the numbers in a section of a Gmsh file, from text or from bytes.

use std::sync::Arc;

use super::super::source::SourceLine;
use crate::{Error, Result};

/// Source of the numbers of one section.
#[derive(Debug)]
pub(super) enum Numbers<'a> {
    /// Words with the number of their line.
    Text { file: Arc<str>, rest: &'a str, line: usize },
    /// Bytes with the offset of the next one in the file.
    Bytes { file: Arc<str>, rest: &'a [u8], offset: usize, big_endian: bool },
}

impl<'a> Numbers<'a> {
    /// Returns an error at the current number.
    pub(super) fn error(&self, problem: impl ToString, remedy: impl ToString) -> Error {
        match self {
            Self::Text { file, line, .. } => SourceLine { file: Arc::clone(file), line: *line }.error(problem, remedy),
            Self::Bytes { file, offset, .. } => Error::read(format_args!("{file}, byte {offset}"), problem, remedy),
        }
    }

    /// Returns the current position for later messages.
    pub(super) fn place(&self) -> SourceLine {
        match self {
            Self::Text { file, line, .. } => SourceLine { file: Arc::clone(file), line: *line },
            Self::Bytes { file, offset, .. } => SourceLine { file: format!("{file}, byte").into(), line: *offset },
        }
    }

    /// Returns an upper bound of the remaining numbers; larger counts in the file are not trusted.
    pub(super) fn at_most(&self) -> usize {
        match self {
            Self::Text { rest, .. } => rest.len() / 2 + 1,
            Self::Bytes { rest, .. } => rest.len() / 4,
        }
    }

    fn word(&mut self) -> Option<&'a str> {
        let Self::Text { rest, line, .. } = self else { return None };
        let text: &'a str = rest;
        let start = text.find(|c: char| !c.is_ascii_whitespace())?;
        *line += text[..start].matches('\n').count();
        let text = &text[start..];
        let end = text.find(|c: char| c.is_ascii_whitespace()).unwrap_or(text.len());
        *rest = &text[end..];
        Some(&text[..end])
    }

    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let Self::Bytes { rest, offset, big_endian, .. } = self else { return None };
        let (taken, remaining) = rest.split_first_chunk::<N>()?;
        *rest = remaining;
        *offset += N;
        let mut taken = *taken;
        if *big_endian {
            taken.reverse();
        }
        Some(taken)
    }

    fn ended(&self) -> Error {
        self.error("the section ends too early or contains something that is not a number", "Export the mesh again")
    }

    /// Reads an `int` of the format.
    pub(crate) fn int(&mut self) -> Result<i64> {
        let value = match self {
            Self::Text { .. } => self.word().and_then(|word| word.parse::<i32>().ok()),
            Self::Bytes { .. } => self.bytes().map(i32::from_le_bytes),
        };
        value.map(i64::from).ok_or_else(|| self.ended())
    }

    /// Reads a `size_t` of the format.
    pub(super) fn size(&mut self) -> Result<u64> {
        let value = match self {
            Self::Text { .. } => self.word().and_then(|word| word.parse().ok()),
            Self::Bytes { .. } => self.bytes().map(u64::from_le_bytes),
        };
        value.ok_or_else(|| self.ended())
    }

    /// Reads a `size_t` that counts items of at least `each` numbers, all of which must still follow.
    pub(super) fn count(&mut self, each: usize) -> Result<usize> {
        let value = self.size()?;
        let most = self.at_most() / each.max(1) + 1;
        usize::try_from(value).ok().filter(|&count| count <= most).ok_or_else(|| {
            self.error(format!("the file declares {value} entries, more than it can contain"), "Export the mesh again")
        })
    }

    /// Reads a finite `double`.
    pub(super) fn real(&mut self) -> Result<f64> {
        let value = match self {
            Self::Text { .. } => self.word().and_then(|word| word.parse().ok()),
            Self::Bytes { .. } => self.bytes().map(f64::from_le_bytes),
        };
        value.filter(|value: &f64| value.is_finite()).ok_or_else(|| self.ended())
    }
}
