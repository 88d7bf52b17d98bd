//! Table of results of a run, and its CSV form.

use std::{
    io::{BufWriter, Write},
    path::Path,
};

use crate::{Failure, Result, output_file};

/// Largest table (bytes); the demo holds three tables in memory.
const MOST_BYTES: f64 = 4e9;

/// Results of one run: one row per communication point, one column per recorded variable.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Column names: FMI 2.0 scalar names, without time.
    pub names: Vec<String>,
    /// Communication points (s).
    pub times: Vec<f64>,
    /// Values, row after row; integers and enumeration items as whole numbers, booleans as 0 and 1.
    pub values: Vec<f64>,
}

/// First difference of two recordings, and the largest difference.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingDifference {
    /// Communication points compared.
    pub points: usize,
    /// Variables compared.
    pub variables: usize,
    /// Number of values whose bits differ.
    pub different: usize,
    /// Largest absolute difference over all values.
    pub largest: f64,
    /// Name and time of the first difference.
    pub first: Option<(String, f64)>,
}

impl RecordingDifference {
    /// Returns whether every bit of every value is the same.
    pub fn is_exact(&self) -> bool {
        self.different == 0
    }
}

impl Recording {
    /// Creates an empty table with these columns and room for `rows` rows.
    ///
    /// # Errors
    /// The table needs more than 4 GB, or more than the available memory.
    pub fn with_columns(names: Vec<String>, rows: usize) -> Result<Self> {
        let bytes = 8.0 * rows as f64 * (names.len() + 1) as f64;
        let refuse = || {
            let size =
                format!("{rows} communication points with {} outputs would need {:.1} GB", names.len(), 1e-9 * bytes);
            let remedy =
                "Choose a longer communication step (--step), an earlier stop (--stop), or fewer outputs in the scene";
            Failure::usage("result table", size, remedy)
        };
        if bytes > MOST_BYTES {
            return Err(refuse());
        }
        let (mut times, mut values) = (Vec::new(), Vec::new());
        times
            .try_reserve_exact(rows)
            .and_then(|()| values.try_reserve_exact(names.len() * rows))
            .map_err(|_| refuse())?;
        Ok(Self { names, times, values })
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.times.len()
    }

    /// Returns the row `index`.
    pub fn row(&self, index: usize) -> &[f64] {
        &self.values[index * self.names.len()..(index + 1) * self.names.len()]
    }

    /// Returns a column by its name.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let column = self.names.iter().position(|candidate| candidate == name)?;
        Some((0..self.rows()).map(|row| self.row(row)[column]).collect())
    }

    /// Returns the last value of a column.
    pub fn last(&self, name: &str) -> Option<f64> {
        let column = self.names.iter().position(|candidate| candidate == name)?;
        self.rows().checked_sub(1).map(|row| self.row(row)[column])
    }

    /// Compares this recording with another one of the same run, bit by bit.
    ///
    /// # Errors
    /// The recordings differ in columns or in the number of rows.
    pub fn compare(&self, other: &Self) -> Result<RecordingDifference> {
        if self.names != other.names || self.rows() != other.rows() {
            return Err(Failure::new(
                "comparison of two runs",
                format!(
                    "they differ in size ({} columns x {} rows and {} x {}) or in variable names",
                    self.names.len(),
                    self.rows(),
                    other.names.len(),
                    other.rows()
                ),
                "Compare runs of the same scene with the same communication points",
            ));
        }
        let mut agreement = RecordingDifference {
            points: self.rows(),
            variables: self.names.len(),
            different: 0,
            largest: 0.0,
            first: None,
        };
        for row in 0..self.rows() {
            let times = (self.times[row], other.times[row]);
            agreement.note(times, "time", times.0);
            for (column, name) in self.names.iter().enumerate() {
                agreement.note((self.row(row)[column], other.row(row)[column]), name, times.0);
            }
        }
        Ok(agreement)
    }

    /// Returns CSV text: header `time,...`, numbers in the shortest form that reads back to the same bits.
    pub fn to_csv(&self) -> String {
        let lines = (0..self.rows()).map(|row| self.line(row));
        [self.header()].into_iter().chain(lines).collect()
    }

    fn header(&self) -> String {
        let names = self.names.iter().map(|name| quoted(name));
        ["time".to_owned()].into_iter().chain(names).collect::<Vec<_>>().join(",") + "\n"
    }

    fn line(&self, row: usize) -> String {
        let mut line = shortest(self.times[row]);
        for value in self.row(row) {
            line.push(',');
            line.push_str(&shortest(*value));
        }
        line + "\n"
    }

    /// Writes the CSV text to a file, completely or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_csv(&self, path: &Path) -> Result<()> {
        let failed = |error: std::io::Error| Failure::file(path, "cannot be written", &error);
        let mut file = BufWriter::new(output_file::begin(path)?);
        let lines = (0..self.rows()).map(|row| self.line(row));
        [self.header()]
            .into_iter()
            .chain(lines)
            .try_for_each(|line| file.write_all(line.as_bytes()))
            .map_err(failed)?;
        output_file::persist(file.into_inner().map_err(|error| failed(error.into_error()))?, path)
    }
}

impl RecordingDifference {
    fn note(&mut self, (mine, theirs): (f64, f64), name: &str, time: f64) {
        if mine.to_bits() == theirs.to_bits() {
            return;
        }
        self.different += 1;
        let difference = (mine - theirs).abs();
        self.largest = if difference.is_nan() { f64::NAN } else { self.largest.max(difference) };
        self.first.get_or_insert_with(|| (name.to_string(), time));
    }
}

/// Returns the shortest decimal that reads back to the same bits; in exponent form if the plain form would be long.
pub fn shortest(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude != 0.0 && !(1e-4..1e15).contains(&magnitude) { format!("{value:e}") } else { format!("{value}") }
}

/// Quotes names with commas or quotes according to RFC 4180.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n']) { format!("\"{}\"", name.replace('"', "\"\"")) } else { name.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Recording {
        Recording {
            names: vec!["blade[1].clearance[1]".into(), "odd,name".into()],
            times: vec![0.0, 0.1],
            values: vec![1.0 / 3.0, -0.0, 5e-324, 1e300],
        }
    }

    #[test]
    fn csv_numbers_read_back_to_the_same_bits() {
        let sample = sample();
        let text = sample.to_csv();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("time,blade[1].clearance[1],\"odd,name\""));
        let read: Vec<f64> = lines.flat_map(|line| line.split(',').map(|cell| cell.parse::<f64>().unwrap())).collect();
        let expected = [0.0, 1.0 / 3.0, -0.0, 0.1, 5e-324, 1e300];
        assert_eq!(read.map_bits(), expected.to_vec().map_bits());
        assert!(text.contains("5e-324") && text.len() < 120, "numbers are short: {text}");
    }

    trait MapBits {
        fn map_bits(&self) -> Vec<u64>;
    }
    impl MapBits for Vec<f64> {
        fn map_bits(&self) -> Vec<u64> {
            self.iter().map(|value| value.to_bits()).collect()
        }
    }

    #[test]
    fn comparison_detects_a_single_bit_and_the_sign_of_zero() {
        let one = sample();
        assert!(one.compare(&one).unwrap().is_exact());
        let mut two = one.clone();
        two.values[0] = f64::from_bits(two.values[0].to_bits() + 1);
        two.values[1] = 0.0;
        let agreement = one.compare(&two).unwrap();
        assert_eq!((agreement.different, agreement.points, agreement.variables), (2, 2, 2));
        assert_eq!(agreement.first, Some(("blade[1].clearance[1]".to_string(), 0.0)));
        two.names.pop();
        assert!(one.compare(&two).is_err());
    }

    #[test]
    fn rejects_table_larger_than_memory_with_its_size() {
        let names = || vec!["clearance".to_owned(); 185];
        for (rows, size) in [(50_000_001, "74.4 GB"), (usize::MAX, "GB")] {
            let failure = Recording::with_columns(names(), rows).unwrap_err();
            assert!(failure.usage && failure.problem.contains(size) && failure.remedy.contains("--step"), "{failure}");
        }
        assert!(Recording::with_columns(names(), 1000).is_ok());
    }

    #[test]
    fn csv_file_equals_csv_text() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("x.csv");
        sample().write_csv(&path).unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), sample().to_csv());
    }

    #[test]
    fn columns_are_found_by_name() {
        assert_eq!(sample().column("odd,name").map(|column| column.map_bits()), Some(vec![-0.0, 1e300].map_bits()));
        assert_eq!(sample().last("odd,name"), Some(1e300));
        assert_eq!(sample().column("none"), None);
    }
}
