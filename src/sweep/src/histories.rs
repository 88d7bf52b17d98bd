//! Outputs over time: a journal of finished runs, and one Parquet file.
//!
//! A record of the journal consists of the digest of the run, the sizes and the names of its columns, its values, and a checksum of all of them.

use std::{
    collections::HashMap,
    fs::{self, File},
    io::{Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use sha2::{Digest, Sha256};
use tiprub_shell::{Failure, Result, recording::Recording};
use tiprub_table::{
    Cell, Column, ColumnType, Table,
    parquet_file::{ColumnLayout, ParquetWriter},
};

use crate::{
    journal::open_locked,
    plan::HistoryRequest,
    row::{RUN, Row},
};

/// First bytes of the journal.
const HEADER: &[u8] = b"tiprub sweep histories, version 1\n";
/// Number of bytes of a checksum.
const CHECKSUM: usize = 32;
/// Column of the time (s).
const TIME: &str = "time";
/// Number of values in a group of rows of the file.
const GROUP_VALUES: usize = 1 << 20;

/// Outputs of one run over time.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// Names of the outputs.
    pub names: Vec<String>,
    /// Communication points (s).
    pub times: Vec<f64>,
    /// Values of each output, one after the other.
    pub values: Vec<f64>,
}

impl History {
    /// Selects outputs and communication points of a recording. An array stands for its elements; outputs that the scene lacks are left out.
    pub fn of(recording: &Recording, request: &HistoryRequest) -> Self {
        let is_wanted = |name: &str| {
            let array = name.split_once('[').map(|(array, _)| array);
            let longest = name.rsplit_once('[').map(|(array, _)| array);
            request.outputs.iter().any(|wanted| *wanted == name || longest == Some(wanted) || array == Some(wanted))
        };
        let names: Vec<String> = recording.names.iter().filter(|name| is_wanted(name)).cloned().collect();
        let rows = (0..recording.rows()).step_by(request.every.get());
        let times = rows.clone().map(|row| recording.times[row]).collect();
        let column = |name: &String| recording.names.iter().position(|other| other == name).unwrap_or_default();
        let columns: Vec<usize> = names.iter().map(column).collect();
        let values = columns.iter().flat_map(|column| rows.clone().map(|row| recording.row(row)[*column])).collect();
        Self { names, times, values }
    }

    /// Returns the values of one output.
    fn column(&self, index: usize) -> &[f64] {
        &self.values[index * self.times.len()..(index + 1) * self.times.len()]
    }

    fn encoded(&self, digest: &str) -> Vec<u8> {
        let mut bytes = Vec::new();
        let length = |bytes: &mut Vec<u8>, length: usize| bytes.extend((length as u64).to_le_bytes());
        let text = |bytes: &mut Vec<u8>, text: &str| {
            length(bytes, text.len());
            bytes.extend(text.as_bytes());
        };
        text(&mut bytes, digest);
        length(&mut bytes, self.names.len());
        self.names.iter().for_each(|name| text(&mut bytes, name));
        length(&mut bytes, self.times.len());
        self.times.iter().chain(&self.values).for_each(|value| bytes.extend(value.to_le_bytes()));
        let mut record = (bytes.len() as u64).to_le_bytes().to_vec();
        record.extend(&bytes);
        record.extend(Sha256::digest(&bytes).iter());
        record
    }
}

/// Reads numbers and texts from the front of bytes; `None` at their end.
struct Decoder<'a>(&'a [u8]);

impl Decoder<'_> {
    fn number(&mut self) -> Option<usize> {
        let (first, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        usize::try_from(u64::from_le_bytes(*first)).ok()
    }

    fn text(&mut self) -> Option<String> {
        let length = self.number()?;
        let (first, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        String::from_utf8(first.to_vec()).ok()
    }

    fn reals(&mut self, count: usize) -> Option<Vec<f64>> {
        let (first, rest) = self.0.split_at_checked(count.checked_mul(8)?)?;
        self.0 = rest;
        let value = |bytes: &[u8]| Some(f64::from_le_bytes(bytes.try_into().ok()?));
        first.chunks(8).map(value).collect()
    }
}

fn decoded(bytes: &[u8]) -> Option<(String, History)> {
    let mut decoder = Decoder(bytes);
    let digest = decoder.text()?;
    let count = decoder.number()?;
    let names = (0..count).map(|_| decoder.text()).collect::<Option<Vec<_>>>()?;
    let rows = decoder.number()?;
    let (times, values) = (decoder.reals(rows)?, decoder.reals(rows.checked_mul(count)?)?);
    Some((digest, History { names, times, values }))
}

/// Journal of histories. Only the positions of the records are kept in memory.
#[derive(Debug)]
pub struct HistoryJournal {
    file: File,
    path: PathBuf,
    /// Position and length (bytes) of the content of the record of each digest.
    records: HashMap<String, (u64, usize)>,
    end: u64,
}

impl HistoryJournal {
    /// Opens or creates a journal. A cut record at the end is removed.
    ///
    /// # Errors
    /// The file cannot be written, is not such a journal, or another process has it open.
    pub fn open(path: &Path) -> Result<Self> {
        let (mut file, bytes) = open_locked(path, HEADER)?;
        let failed = |error: std::io::Error| Failure::file(path, "cannot be written", &error);
        if bytes.len() < HEADER.len() {
            file.set_len(0).map_err(failed)?;
            file.rewind().and_then(|()| file.write_all(HEADER)).map_err(failed)?;
            let end = HEADER.len() as u64;
            return Ok(Self { file, path: path.to_owned(), records: HashMap::new(), end });
        }
        let (mut records, mut start) = (HashMap::new(), HEADER.len());
        while let Some((digest, content, next)) = record(&bytes, start) {
            records.insert(digest, (content.0 as u64, content.1));
            start = next;
        }
        file.set_len(start as u64).map_err(failed)?;
        Ok(Self { file, path: path.to_owned(), records, end: start as u64 })
    }

    /// Returns whether the history of a run is in the journal.
    pub fn holds(&self, digest: &str) -> bool {
        self.records.contains_key(digest)
    }

    /// Appends the history of a run.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, digest: &str, history: &History) -> Result<()> {
        let bytes = history.encoded(digest);
        let written = self.file.seek(SeekFrom::Start(self.end)).and_then(|_| self.file.write_all(&bytes));
        written.map_err(|error| Failure::file(&self.path, "cannot be written", &error))?;
        self.records.insert(digest.to_owned(), (self.end + 8, bytes.len() - 8 - CHECKSUM));
        self.end += bytes.len() as u64;
        Ok(())
    }

    /// Returns the history of a run; `None` if the journal does not have it.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn read(&mut self, digest: &str) -> Result<Option<History>> {
        let Some((position, length)) = self.records.get(digest).copied() else { return Ok(None) };
        let mut bytes = vec![0; length];
        let read = self.file.seek(SeekFrom::Start(position)).and_then(|_| self.file.read_exact(&mut bytes));
        read.map_err(|error| Failure::file(&self.path, "cannot be read", &error))?;
        Ok(decoded(&bytes).map(|(_, history)| history))
    }

    /// Removes the journal.
    ///
    /// # Errors
    /// The file cannot be removed.
    pub fn remove(self) -> Result<()> {
        fs::remove_file(&self.path).map_err(|error| Failure::file(&self.path, "cannot be removed", &error))
    }
}

/// Returns digest, position and length of the content, and end of the record at a position; `None` if it is cut or damaged.
fn record(bytes: &[u8], start: usize) -> Option<(String, (usize, usize), usize)> {
    let mut decoder = Decoder(bytes.get(start..)?);
    let length = decoder.number()?;
    let content = decoder.0.get(..length)?;
    let sum = decoder.0.get(length..length.checked_add(CHECKSUM)?)?;
    if Sha256::digest(content).as_slice() != sum {
        return None;
    }
    let digest = Decoder(content).text()?;
    Some((digest, (start + 8, length), start + 8 + length + CHECKSUM))
}

/// Writes the histories of rows as a Parquet file with the columns `run`, `time` and the outputs. `rows` are the runs (from 1) with their rows; `facts`
/// are stored in the file. Runs without a history have no lines.
///
/// # Errors
/// A file cannot be read or written.
pub fn write(
    target: &Path,
    journal: &mut HistoryJournal,
    rows: &[(usize, &Row)],
    facts: &[(&str, String)],
) -> Result<()> {
    let mut names: Vec<String> = Vec::new();
    for (_, row) in rows {
        for name in journal.read(&row.digest)?.map(|history| history.names).unwrap_or_default() {
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    let mut layout =
        vec![ColumnLayout::required(RUN, ColumnType::Integer), ColumnLayout::required(TIME, ColumnType::Real)];
    layout.extend(names.iter().map(|name| ColumnLayout::optional(name.clone(), ColumnType::Real)));
    let columns =
        layout.iter().map(|layout| Column { name: layout.name.clone(), kind: layout.kind, cells: Vec::new() });
    let empty = Table { columns: columns.collect() };
    let mut file = ParquetWriter::new(target, layout, facts)?;
    let mut group = empty.clone();
    for (run, row) in rows {
        let Some(history) = journal.read(&row.digest)? else { continue };
        add(&mut group, *run, &history);
        if group.rows() * group.columns.len() >= GROUP_VALUES {
            file.write_rows(&group)?;
            group = empty.clone();
        }
    }
    file.write_rows(&group)?;
    file.finish()
}

/// Appends the history of a run to a table.
fn add(table: &mut Table, run: usize, history: &History) {
    let rows = history.times.len();
    let real = |values: &[f64]| values.iter().map(|value| Some(Cell::Real(*value))).collect::<Vec<_>>();
    for column in &mut table.columns {
        match (column.name.as_str(), history.names.iter().position(|name| *name == column.name)) {
            (RUN, _) => {
                let number = i64::try_from(run).unwrap_or(i64::MAX);
                column.cells.extend(std::iter::repeat_n(Some(Cell::Integer(number)), rows));
            }
            (TIME, None) => column.cells.extend(real(&history.times)),
            (_, Some(index)) => column.cells.extend(real(history.column(index))),
            (_, None) => column.cells.extend(std::iter::repeat_n(None, rows)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn history(number: f64) -> History {
        History {
            names: vec!["a".into(), "b[1]".into()],
            times: vec![0.0, 0.5],
            values: vec![number, 2.0, f64::NAN, -0.0],
        }
    }

    #[test]
    fn cut_journal_keeps_all_complete_records() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("a.journal");
        let mut journal = HistoryJournal::open(&path).unwrap();
        let mut ends = Vec::new();
        for digest in ["one", "two"] {
            journal.append(digest, &history(1.0)).unwrap();
            ends.push(fs::read(&path).unwrap().len());
        }
        drop(journal);
        let whole = fs::read(&path).unwrap();
        for length in 0..=whole.len() {
            fs::write(&path, &whole[..length]).unwrap();
            let mut journal = HistoryJournal::open(&path).unwrap();
            let complete = ends.iter().filter(|end| **end <= length).count();
            assert_eq!(["one", "two"].map(|digest| journal.holds(digest)), [complete > 0, complete > 1], "{length}");
            journal.append("new", &history(7.0)).unwrap();
            drop(journal);
            let mut journal = HistoryJournal::open(&path).unwrap();
            let found = journal.read("new").unwrap().unwrap();
            let bits = |history: &History| history.values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            assert_eq!((&found.names, &found.times), (&history(7.0).names, &history(7.0).times), "{length}");
            assert_eq!(bits(&found), bits(&history(7.0)), "{length}");
        }
    }

    #[test]
    fn history_has_the_requested_outputs_and_points() {
        let recording = Recording {
            names: ["torque", "blade[1].gap[1]", "blade[1].gap[2]", "torque_x"].map(String::from).to_vec(),
            times: vec![0.0, 1.0, 2.0],
            values: (0..12).map(f64::from).collect(),
        };
        let outputs = vec!["torque".to_owned(), "blade[1].gap".to_owned()];
        let request = HistoryRequest { outputs, every: std::num::NonZero::new(2).unwrap() };
        let found = History::of(&recording, &request);
        assert_eq!(found.names, ["torque", "blade[1].gap[1]", "blade[1].gap[2]"]);
        assert_eq!((found.times.clone(), found.column(1).to_vec()), (vec![0.0, 2.0], vec![1.0, 9.0]));
    }
}
