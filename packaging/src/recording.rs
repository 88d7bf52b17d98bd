//! The table of results of a run, and its CSV form.

use std::{fmt::Write as _, path::Path};

use crate::{Failure, Result, output_file};

/// Numbers of one run: one row per communication point, one column per recorded variable.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Column names: FMI 2.0 scalar names, without time.
    pub names: Vec<String>,
    /// Communication points (s).
    pub times: Vec<f64>,
    /// Values, row after row; integers and enumeration items as whole numbers, booleans as 0 and 1.
    pub values: Vec<f64>,
}

/// Where two recordings first differ, and by how much at most.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreement {
    /// Communication points compared.
    pub points: usize,
    /// Variables compared.
    pub variables: usize,
    /// Values that are not the same bits.
    pub different: usize,
    /// Largest absolute difference over all values.
    pub largest: f64,
    /// Name and time of the first difference.
    pub first: Option<(String, f64)>,
}

impl Agreement {
    /// Every bit of every value is the same.
    pub fn is_exact(&self) -> bool {
        self.different == 0
    }
}

impl Recording {
    /// An empty table with these columns and room for `rows` rows.
    pub fn with_columns(names: Vec<String>, rows: usize) -> Self {
        let values = Vec::with_capacity(names.len() * rows);
        Self { names, times: Vec::with_capacity(rows), values }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.times.len()
    }

    /// Row `index`.
    pub fn row(&self, index: usize) -> &[f64] {
        &self.values[index * self.names.len()..(index + 1) * self.names.len()]
    }

    /// Column by name.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let column = self.names.iter().position(|candidate| candidate == name)?;
        Some((0..self.rows()).map(|row| self.row(row)[column]).collect())
    }

    /// Last value of a column.
    pub fn last(&self, name: &str) -> Option<f64> {
        let column = self.names.iter().position(|candidate| candidate == name)?;
        self.rows().checked_sub(1).map(|row| self.row(row)[column])
    }

    /// Compare with another recording of the same run, bit by bit.
    ///
    /// # Errors
    /// Different columns or numbers of rows.
    pub fn compare(&self, other: &Self) -> Result<Agreement> {
        if self.names != other.names || self.rows() != other.rows() {
            return Err(Failure::new(
                "comparison of two runs",
                format!(
                    "{} columns x {} rows against {} x {}, or different variable names",
                    self.names.len(),
                    self.rows(),
                    other.names.len(),
                    other.rows()
                ),
                "Both runs must come from the same scene and the same communication points",
            ));
        }
        let mut agreement =
            Agreement { points: self.rows(), variables: self.names.len(), different: 0, largest: 0.0, first: None };
        for row in 0..self.rows() {
            let times = (self.times[row], other.times[row]);
            agreement.note(times, "time", times.0);
            for (column, name) in self.names.iter().enumerate() {
                agreement.note((self.row(row)[column], other.row(row)[column]), name, times.0);
            }
        }
        Ok(agreement)
    }

    /// CSV text: header `time,...`, numbers in the shortest form that reads back to the same bits.
    pub fn to_csv(&self) -> String {
        let mut text = String::with_capacity(self.values.len() * 12 + 1024);
        text.push_str("time");
        for name in &self.names {
            text.push(',');
            text.push_str(&quoted(name));
        }
        text.push('\n');
        for row in 0..self.rows() {
            let _ = write!(text, "{}", shortest(self.times[row]));
            for value in self.row(row) {
                let _ = write!(text, ",{}", shortest(*value));
            }
            text.push('\n');
        }
        text
    }

    /// Write the CSV text to a file, whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_csv(&self, path: &Path) -> Result<()> {
        output_file::write(path, self.to_csv())
    }
}

impl Agreement {
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

/// Shortest decimal that reads back to the same bits; exponent form where the plain one would be long.
pub fn shortest(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude != 0.0 && !(1e-4..1e15).contains(&magnitude) { format!("{value:e}") } else { format!("{value}") }
}

/// Names with commas or quotes are quoted as RFC 4180 wants it.
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
    fn comparison_sees_a_single_bit_and_the_sign_of_zero() {
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
    fn columns_are_found_by_name() {
        assert_eq!(sample().column("odd,name").map(|column| column.map_bits()), Some(vec![-0.0, 1e300].map_bits()));
        assert_eq!(sample().last("odd,name"), Some(1e300));
        assert_eq!(sample().column("none"), None);
    }
}
