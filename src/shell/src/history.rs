//! Inputs over time from a CSV file; a run applies them without delay.

use std::{
    collections::{HashMap, HashSet},
    path::Path,
};

use tiprub_core::{CoSimulation, Simulation, Warning};
use tiprub_cosim::variables::{Causality, DataType, Quantity, Variability, Variable};
use tiprub_cosim::warning::Topic;

use crate::{Failure, Result, native};

/// Largest file (bytes); ten million values at full precision need less than half of it.
const LARGEST: u64 = 512 << 20;
/// Longest line that messages show in full (characters).
const MOST_SHOWN: usize = 60;

/// Inputs over time: one column each, linear between the rows, constant before the first and after the last row.
#[derive(Debug, Clone, PartialEq)]
pub struct InputHistory {
    /// Origin of the data, for messages.
    name: String,
    /// Names of the columns after the time.
    names: Vec<String>,
    /// Times of the rows (s), increasing.
    times: Vec<f64>,
    /// Values, row after row.
    values: Vec<f64>,
}

impl InputHistory {
    /// Reads a CSV file whose first column is `time` (s); the other columns are inputs and tunable parameters with their FMI 2.0 names.
    ///
    /// # Errors
    /// The file cannot be read, the header has no `time` or repeats a name, a row is not numeric, or the times do not increase.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes =
            tiprub_format::read_file(path, LARGEST).map_err(|error| Failure::file(path, "cannot be read", &error))?;
        Self::parse(&bytes, &path.display().to_string())
    }

    fn parse(bytes: &[u8], name: &str) -> Result<Self> {
        let refused =
            |place: String, problem: String, remedy: &str| Failure::new(format!("{name}{place}"), problem, remedy);
        let whole = |problem: String, remedy: &str| refused(String::new(), problem, remedy);
        let header = "Start the file with a header line: time,NAME,NAME,...";
        // Spreadsheets write a byte order mark before the first name.
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
        let names = reader.headers().map_err(|error| whole(error.to_string(), header))?;
        let names: Vec<String> = names.iter().map(str::to_owned).collect();
        if names.first().map(String::as_str) != Some("time") || names.len() < 2 {
            return Err(whole(format!("its first line {} is not a header", beginning(&names.join(","))), header));
        }
        let mut known = HashSet::with_capacity(names.len());
        if let Some(twice) = names.iter().find(|name| !known.insert(name.as_str())) {
            return Err(whole(format!("column `{twice}` appears twice"), "Give each variable only one column"));
        }
        let (mut times, mut values) = (Vec::<f64>::new(), Vec::new());
        for record in reader.records() {
            let uneven = "Give one value per column in every line";
            let record = record.map_err(|error| whole(error.to_string(), uneven))?;
            let line = record.position().map_or(0, csv::Position::line);
            for (column, text) in record.iter().enumerate() {
                let value = text.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| {
                    let place = format!(", line {line}, `{}`", names[column]);
                    let problem = format!("{text:?} is not a finite number");
                    refused(place, problem, "Give finite numbers with a decimal point")
                })?;
                if column > 0 {
                    values.push(value);
                    continue;
                }
                if let Some(last) = times.last().filter(|last| **last >= value) {
                    let problem = format!("the time {value} s is not after {last} s");
                    let remedy = "Sort the lines by time and give each time only once";
                    return Err(refused(format!(", line {line}"), problem, remedy));
                }
                times.push(value);
            }
        }
        if times.is_empty() {
            return Err(whole("it contains no values".to_owned(), "Add at least one line of values"));
        }
        Ok(Self { name: name.to_owned(), names: names[1..].to_vec(), times, values })
    }

    /// Returns the value of a column at a time (s).
    fn at(&self, column: usize, time: f64) -> f64 {
        let value = |row: usize| self.values[row * self.names.len() + column];
        match self.times.partition_point(|own| *own <= time) {
            0 => value(0),
            after if after == self.times.len() => value(after - 1),
            after => {
                let (from, to) = (self.times[after - 1], self.times[after]);
                value(after - 1) + (time - from) / (to - from) * (value(after) - value(after - 1))
            }
        }
    }

    /// Returns the origin of the data, such as the path of the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the names of the columns after the time.
    pub fn variables(&self) -> &[String] {
        &self.names
    }

    /// Returns the smallest and the largest value of a variable during an interval (s); `None` if the variable has no column.
    pub fn range(&self, name: &str, [start, stop]: [f64; 2]) -> Option<[f64; 2]> {
        let column = self.names.iter().position(|own| own == name)?;
        let within = self.times.iter().copied().filter(|time| (start..stop).contains(time));
        let values = within.chain([start, stop]).map(|time| self.at(column, time));
        Some(values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]))
    }

    /// Assigns the columns to variables of a simulation.
    ///
    /// # Errors
    /// A name is neither an input nor a tunable parameter.
    pub fn drive(&self, simulation: &Simulation) -> Result<Driver<'_>> {
        let rows = simulation.table().variables();
        let each = |row| {
            (0..Variable::len(row))
                .zip(row.reference..)
                .map(move |(index, element)| (row.element_name(index), (row, element)))
        };
        let known: HashMap<String, (&Variable, u32)> = rows.iter().flat_map(each).collect();
        let mut elements = Vec::with_capacity(self.names.len());
        for name in &self.names {
            let found = known.get(name).copied();
            let Some((row, reference)) = found.filter(|(row, _)| is_drivable(row)) else {
                let problem = if found.is_some() { "it cannot change during a run" } else { "no such variable" };
                let all = rows.iter().filter(|row| is_drivable(row));
                let names: Vec<&str> = all.map(|row| row.name.as_str()).collect();
                let remedy = native::suggestion(name, &names);
                return Err(Failure::new(format!("{}, `{name}`", self.name), problem, remedy));
            };
            elements.push(match (row.causality, row.quantity) {
                (Causality::Input, _) => ColumnTarget::Line(reference),
                (_, Quantity::GapOffset) => ColumnTarget::Reached(reference),
                _ => ColumnTarget::Held(reference),
            });
        }
        Ok(Driver { history: self, elements })
    }

    /// Returns whether there is a column for this variable or one of its elements.
    pub fn holds(&self, name: &str) -> bool {
        self.names.iter().any(|own| own == name || own.strip_prefix(name).is_some_and(|rest| rest.starts_with('[')))
    }

    /// Returns warnings about parts of the history that the communication step does not resolve.
    pub fn warnings(&self, step: f64) -> Vec<Warning> {
        let shortest = self.times.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
        if shortest >= 0.999 * step {
            return Vec::new();
        }
        let problem = format!(
            "{}: some lines are only {shortest:.3e} s apart, but values are read only at communication points, every \
             {step:.3e} s",
            self.name
        );
        vec![Warning::new(Topic::InputLines, problem, "Use a shorter communication step (--step)")]
    }
}

/// Quotes a line for messages; long lines are shortened.
fn beginning(line: &str) -> String {
    match line.char_indices().nth(MOST_SHOWN) {
        Some((end, _)) => format!("{:?}...", &line[..end]),
        None => format!("{line:?}"),
    }
}

/// Returns whether a variable is a real input or a tunable parameter.
fn is_drivable(row: &Variable) -> bool {
    let tunable = row.causality == Causality::Parameter && row.variability == Variability::Tunable;
    row.kind == DataType::Real && (row.causality == Causality::Input || tunable)
}

/// Rule by which a variable follows a column.
#[derive(Debug, Clone, Copy)]
enum ColumnTarget {
    /// Set to the value at the start of a communication step, with the derivative over the step.
    Line(u32),
    /// Set to the value at the end of the step, to which it is ramped, without derivative.
    Reached(u32),
    /// Set to the value at the start of a step, where it jumps.
    Held(u32),
}

/// Columns of a history, assigned to variables.
#[derive(Debug)]
pub struct Driver<'a> {
    history: &'a InputHistory,
    elements: Vec<ColumnTarget>,
}

impl Driver<'_> {
    /// Sets the start values.
    ///
    /// # Errors
    /// A variable rejects a value.
    pub fn start(&self, simulation: &mut Simulation, time: f64) -> Result<()> {
        for (column, element) in self.elements.iter().enumerate() {
            let (ColumnTarget::Line(reference) | ColumnTarget::Reached(reference) | ColumnTarget::Held(reference)) =
                *element;
            self.set(simulation, (column, reference), time)?;
        }
        Ok(())
    }

    /// Sets the inputs of a communication step from one time to another (s).
    ///
    /// # Errors
    /// A variable rejects a value.
    pub fn step(&self, simulation: &mut Simulation, [from, to]: [f64; 2]) -> Result<()> {
        for (column, element) in self.elements.iter().enumerate() {
            match *element {
                ColumnTarget::Line(reference) => {
                    self.set(simulation, (column, reference), from)?;
                    let slope = (self.history.at(column, to) - self.history.at(column, from)) / (to - from);
                    let set = simulation.set_input_derivative(reference, 1, slope);
                    set.map_err(|error| self.refused(column, from, error))?;
                }
                ColumnTarget::Reached(reference) => self.set(simulation, (column, reference), to)?,
                // A constant value is not set and checked again.
                ColumnTarget::Held(reference) if self.rests(simulation, (column, reference), from) => {}
                ColumnTarget::Held(reference) => self.set(simulation, (column, reference), from)?,
            }
        }
        Ok(())
    }

    fn rests(&self, simulation: &Simulation, (column, reference): (usize, u32), time: f64) -> bool {
        simulation.real(reference).is_ok_and(|value| value.to_bits() == self.history.at(column, time).to_bits())
    }

    /// Sets a variable to the value of its column at a time.
    fn set(&self, simulation: &mut Simulation, (column, reference): (usize, u32), time: f64) -> Result<()> {
        let set = simulation.set_real(reference, self.history.at(column, time));
        set.map_err(|error| self.refused(column, time, error))
    }

    fn refused(&self, column: usize, time: f64, error: tiprub_core::Error) -> Failure {
        let InputHistory { name, names, .. } = self.history;
        Failure::from_core(format!("{name}, `{}` at {time} s", names[column]), error)
    }
}

#[cfg(test)]
mod tests {
    use super::InputHistory;

    fn parsed(text: &str) -> crate::Result<InputHistory> {
        InputHistory::parse(text.as_bytes(), "inputs.csv")
    }

    #[test]
    fn columns_are_interpolated_linearly_and_held_outside() {
        let history = parsed("\u{feff}time, a,b\r\n0.5,1,-1\r\n1.5,3,-1\r\n2,0,1e3\r\n").unwrap();
        let at = |time: f64| [history.at(0, time), history.at(1, time)];
        for (time, expected) in [
            (0.0, [1.0, -1.0]),
            (0.5, [1.0, -1.0]),
            (1.0, [2.0, -1.0]),
            (1.5, [3.0, -1.0]),
            (1.75, [1.5, 499.5]),
            (2.0, [0.0, 1e3]),
            (9.0, [0.0, 1e3]),
        ] {
            assert_eq!(at(time).map(f64::to_bits), expected.map(f64::to_bits), "{time}");
        }
        assert!(history.holds("a") && !history.holds("c"));
        let range = |interval| history.range("a", interval);
        assert_eq!([range([0.0, 0.4]), range([1.0, 1.75])], [Some([1.0, 1.0]), Some([1.5, 3.0])]);
        assert_eq!((range([-1.0, 9.0]), history.range("c", [0.0, 1.0])), (Some([0.0, 3.0]), None));
        assert_eq!(history.warnings(0.5).len(), 0);
        assert!(history.warnings(0.6)[0].contains("5.000e-1 s apart"));
    }

    /// If all names were compared with each other, this would take 10 s.
    #[test]
    fn reads_a_hundred_thousand_columns_quickly() {
        let names = (0..100_000).map(|column| format!(",n{column}")).collect::<String>();
        let clock = std::time::Instant::now();
        let history = parsed(&format!("time{names}\n0{}\n", ",1".repeat(100_000))).unwrap();
        assert!(history.holds("n99999"));
        let failure = parsed(&format!("time{names},n7\n")).unwrap_err().to_string();
        assert!(failure.contains("column `n7` appears twice"), "{failure}");
        let failure = parsed(&format!("t{names}\n")).unwrap_err().to_string();
        assert!(failure.contains("its first line \"t,n0,n1,") && failure.len() < 300, "{failure}");
        assert!(clock.elapsed().as_secs() < 3, "{:?}", clock.elapsed());
    }

    #[test]
    fn errors_report_their_line() {
        for (text, reported) in [
            ("", "its first line \"\" is not a header"),
            ("t,a\n0,1\n", "its first line \"t,a\" is not a header"),
            ("time\n0\n", "its first line \"time\" is not a header"),
            ("time,a,a\n0,1,2\n", "column `a` appears twice"),
            ("time,a\n", "it contains no values"),
            ("time,a\n0,1\n1,x\n", "inputs.csv, line 3, `a`: \"x\" is not a finite number"),
            ("time,a\n0,1\n1,NaN\n", "line 3, `a`: \"NaN\" is not a finite number"),
            ("time,a\n0,1\n0,2\n", "line 3: the time 0 s is not after 0 s"),
            ("time,a\n0,1\n1\n", "1 fields"),
        ] {
            let failure = parsed(text).unwrap_err().to_string();
            assert!(failure.contains(reported), "{text:?}: {failure}");
        }
    }
}
