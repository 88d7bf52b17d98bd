//! Results of one run.

use tiprub_cosim::warning::{self, Warning};
use tiprub_shell::{Failure, extremes::extremes, means, native::NativeRun, schedule::Schedule};
use tiprub_table::{Cell, ColumnType};

use crate::cases::CHANGED_SCENE;

/// Names of the first and the last columns of the results; the variables follow the first.
pub const RUN: &str = "run";
/// State of a run: `finished`, `refused` or `failed`.
pub const STATUS: &str = "status";
/// Digest of everything that determines a row.
pub const DIGEST: &str = "digest";
/// Identifiers of the warnings of a run.
const WARNINGS: &str = "warnings";
/// Separator of the identifiers in [`WARNINGS`].
const WARNING_SEPARATOR: &str = ", ";

/// Columns that every result has, after the variables. Other means and totals follow them, and [`LAST_COLUMNS`].
pub const FIRST_COLUMNS: [(&str, ColumnType); 13] = [
    (STATUS, ColumnType::Text),
    ("reason", ColumnType::Text),
    ("largest_total_normal_force", ColumnType::Real),
    ("largest_total_normal_force_time", ColumnType::Real),
    ("largest_node_normal_force", ColumnType::Real),
    ("largest_node_normal_force_time", ColumnType::Real),
    ("smallest_clearance", ColumnType::Real),
    ("smallest_clearance_time", ColumnType::Real),
    ("most_contacts", ColumnType::Real),
    ("most_contacts_time", ColumnType::Real),
    ("mean_total_normal_force", ColumnType::Real),
    ("communication_steps", ColumnType::Integer),
    ("internal_steps", ColumnType::Integer),
];

/// Columns at the end of every result.
pub const LAST_COLUMNS: [(&str, ColumnType); 5] = [
    (WARNINGS, ColumnType::Text),
    ("warning_texts", ColumnType::Text),
    ("seconds", ColumnType::Real),
    ("stepping_seconds", ColumnType::Real),
    (DIGEST, ColumnType::Text),
];

/// Names that variables of a plan must not have.
pub const RESERVED_NAMES: [&str; 19] = {
    let mut names = [RUN; 19];
    let mut index = 0;
    while index < FIRST_COLUMNS.len() {
        names[index + 1] = FIRST_COLUMNS[index].0;
        index += 1;
    }
    let mut last = 0;
    while last < LAST_COLUMNS.len() {
        names[index + 1 + last] = LAST_COLUMNS[last].0;
        last += 1;
    }
    names
};

/// Outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// All steps were taken.
    Finished,
    /// The scene, a model or a value was rejected before the first step.
    Refused,
    /// A step failed.
    Failed,
}

impl Status {
    /// Returns the name in the results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Finished => "finished",
            Self::Refused => "refused",
            Self::Failed => "failed",
        }
    }
}

/// Results of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Digest of everything that determines them.
    pub digest: String,
    /// Named values, without the variables.
    pub cells: Vec<(String, Cell)>,
}

impl Row {
    /// Creates the row of a finished run that took `seconds` (s) in all.
    pub fn finished(digest: &str, run: &NativeRun, schedule: &Schedule, seconds: f64) -> Self {
        let mut cells = vec![(STATUS.to_owned(), Cell::Text(Status::Finished.name().to_owned()))];
        for extreme in extremes(&run.recording) {
            cells.push((extreme.name.to_owned(), Cell::Real(extreme.value)));
            cells.push((format!("{}_time", extreme.name), Cell::Real(extreme.time)));
        }
        let count = |count: u64| Cell::Integer(i64::try_from(count).unwrap_or(i64::MAX));
        let means = means::means(run).into_iter();
        cells.extend(means.map(|mean| (mean.name, Cell::Real(mean.value))));
        cells.push(("communication_steps".to_owned(), count(schedule.count as u64)));
        cells.push(("internal_steps".to_owned(), count(run.internal_steps)));
        for total in means::totals(run) {
            if !RESERVED_NAMES.contains(&total.name.as_str()) {
                cells.push((total.name, Cell::Real(total.value)));
            }
        }
        cells.push(("stepping_seconds".to_owned(), Cell::Real(run.stepping.as_secs_f64())));
        Self::with_common_cells(digest, cells, &run.warnings, seconds)
    }

    /// Creates the row of a run without results that took `seconds` (s).
    pub fn without_results(digest: &str, status: Status, failure: &Failure, seconds: f64) -> Self {
        let cells = vec![
            (STATUS.to_owned(), Cell::Text(status.name().to_owned())),
            ("reason".to_owned(), Cell::Text(reason(failure))),
        ];
        Self::with_common_cells(digest, cells, &failure.warnings, seconds)
    }

    fn with_common_cells(digest: &str, mut cells: Vec<(String, Cell)>, warnings: &[Warning], seconds: f64) -> Self {
        let mut topics: Vec<&str> = Vec::new();
        for id in warnings.iter().map(|warning| warning.topic().id()) {
            if !topics.contains(&id) {
                topics.push(id);
            }
        }
        if !warnings.is_empty() {
            cells.push((WARNINGS.to_owned(), Cell::Text(topics.join(WARNING_SEPARATOR))));
            cells.push(("warning_texts".to_owned(), Cell::Text(warning::texts(warnings).join("\n"))));
        }
        cells.push(("seconds".to_owned(), Cell::Real(seconds)));
        Self { digest: digest.to_owned(), cells }
    }

    /// Returns a value by its name.
    pub fn cell(&self, name: &str) -> Option<&Cell> {
        self.cells.iter().find(|(other, _)| other == name).map(|(_, cell)| cell)
    }

    /// Returns the identifiers of the warnings, each once.
    pub fn warning_ids(&self) -> Vec<&str> {
        match self.cell(WARNINGS) {
            Some(Cell::Text(topics)) => topics.split(WARNING_SEPARATOR).collect(),
            _ => Vec::new(),
        }
    }

    /// Returns whether the run ended in this way.
    pub fn has_status(&self, status: Status) -> bool {
        matches!(self.cell(STATUS), Some(Cell::Text(name)) if name == status.name())
    }
}

/// Begins the option of `tiprub run` for a start value, which messages name.
const SETTING: &str = "--set ";

/// Returns the reason of a failure, without places in the changed scene and without options of `tiprub run`.
fn reason(failure: &Failure) -> String {
    let mut failure = failure.clone();
    let is_hidden = |place: &str| place.starts_with(CHANGED_SCENE) || place.starts_with(SETTING);
    failure.diagnostic.place = failure.diagnostic.place.filter(|place| !is_hidden(place));
    if let Some(variable) = failure.diagnostic.what.strip_prefix(SETTING).map(str::to_owned) {
        failure.diagnostic.what = variable;
    }
    failure.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reserved_names_are_all_fixed_columns() {
        let fixed = FIRST_COLUMNS.iter().chain(&LAST_COLUMNS).map(|(name, _)| *name);
        let expected: Vec<&str> = [RUN].into_iter().chain(fixed).collect();
        assert_eq!(RESERVED_NAMES.to_vec(), expected);
    }

    #[test]
    fn reasons_do_not_name_places_that_users_cannot_see() {
        let failure = Failure::usage("--set speed=fast", "\"fast\" is not a number", "Give a number");
        assert_eq!(reason(&failure), "speed=fast: \"fast\" is not a number. Give a number.");
        let failure = Failure::new("contact[1].gap", "is negative", "Give 0 or more");
        let placed = failure.clone().at(format!("{CHANGED_SCENE}:12:3"));
        assert_eq!(reason(&placed), reason(&failure));
        let ranged = Failure::new("variable `speed`", "9 is out of range", "Give less").at("--set speed=9");
        assert_eq!(reason(&ranged), "variable `speed`: 9 is out of range. Give less.");
        assert!(reason(&failure.at("blade.rom.safetensors")).starts_with("blade.rom.safetensors: contact[1].gap"));
    }
}
