//! Studies: answer a question about a model with runs, pictures and figures, and check whether they show the expected results.
//!
//! A study is a function that returns a [`Study`]: facts, figures with the numbers behind them, and statements with their results. [`output`] writes
//! every study in the same form: one HTML page that opens offline, an SVG and a CSV per figure, and `results.json`. Independent runs go through
//! `tiprub_shell::sweep`; maps and stability studies store their results in journals (`tiprub_sweep::tasks`), so that an interrupted study
//! continues.

pub mod arguments;
pub mod convergence;
pub mod error;
pub mod estimate;
pub mod machine;
pub mod map;
pub mod output;
pub mod response;
pub mod stability;

use serde_json::{Value, json};
use tiprub_core::Scene;
use tiprub_core::scene::settings::SceneSettings;
use tiprub_figure::{plots::Plot, waterfall::Waterfall};
use tiprub_shell::{Failure, Result, recording::shortest};
use tiprub_sweep::tasks::{FinishedPart, TaskJournals};

/// Returns the index of the structure whose tips have the contact nodes.
pub fn master(scene: &Scene) -> usize {
    let name = &scene.settings.contacts[0].master;
    scene.settings.structures.iter().position(|structure| structure.name == *name).unwrap_or(0)
}

/// Rejects scenes with contact nodes on several structures: such a study varies one, its speed or its ROM.
///
/// # Errors
/// Several structures have contact nodes.
pub fn one_rotor(settings: &SceneSettings) -> Result<()> {
    let first = &settings.contacts[0].master;
    match settings.contacts.iter().find(|contact| contact.master != *first) {
        Some(other) => {
            let other = &other.master;
            let problem = format!("`{first}` and `{other}` are both masters, and this study varies only one structure");
            Err(several(settings, problem))
        }
        None => Ok(()),
    }
}

/// Rejects scenes with contact nodes on several structures, and scenes whose pairs differ in friction.
///
/// # Errors
/// Several structures have contact nodes, or pairs differ in friction.
pub fn one_rotor_and_friction(settings: &SceneSettings) -> Result<()> {
    one_rotor(settings)?;
    let first = settings.contacts[0].friction.to_bits();
    if settings.contacts.iter().all(|contact| contact.friction.to_bits() == first) {
        return Ok(());
    }
    Err(several(settings, "the contacts differ in friction, and this study varies only one coefficient".to_owned()))
}

fn several(settings: &SceneSettings, problem: String) -> Failure {
    let remedy = "Give a scene with only one rotor or pair; `tiprub study error` and `tiprub run` support several";
    Failure::usage(format!("scene `{}`", settings.name), problem, remedy)
}

/// Returns the number of internal steps of at most `step` (s) in a communication step of length `interval` (s).
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
pub(crate) fn divisions(interval: f64, step: f64) -> u32 {
    (interval / step * (1.0 - 1e-9)).ceil().clamp(1.0, 1e8) as u32
}

/// A finished study.
#[derive(Debug, Clone)]
pub struct Study {
    /// Short name, for files: `stage`.
    pub name: &'static str,
    /// Title of the page.
    pub title: String,
    /// Summary of the study, in one or a few sentences.
    pub summary: String,
    /// Facts of the study: names and values with units.
    pub facts: Vec<(String, String)>,
    /// Expectations with their results.
    pub statements: Vec<Statement>,
    /// The figures.
    pub figures: Vec<StudyFigure>,
    /// Results for programs, beside the numbers of the figures.
    pub results: Value,
    /// Further files to write: name, meaning, bytes.
    pub files: Vec<(String, String, Vec<u8>)>,
}

/// Outcome of a study.
#[derive(Debug)]
pub enum StudyOutcome {
    /// Finished study, and the journals of its runs, which the caller removes after writing the files of the study.
    Finished(Box<Study>, Option<TaskJournals>),
    /// Finished part of the runs, if only a part was requested.
    Part(FinishedPart),
}

impl From<Study> for StudyOutcome {
    fn from(study: Study) -> Self {
        Self::Finished(Box::new(study), None)
    }
}

/// Expectation of a study with its result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Statement {
    /// The expectation.
    pub expected: String,
    /// The result, with numbers.
    pub found: String,
    /// True if the result fulfils the expectation; `None` if it cannot be decided here.
    pub holds: Option<bool>,
}

impl Statement {
    /// Creates a statement that was tested.
    pub fn tested(expected: impl Into<String>, holds: bool, found: impl Into<String>) -> Self {
        Self { expected: expected.into(), found: found.into(), holds: Some(holds) }
    }

    /// Creates a remark, which has no verdict.
    pub fn remark(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self { expected: expected.into(), found: found.into(), holds: None }
    }

    /// Returns the verdict as one word.
    pub fn verdict(&self) -> &'static str {
        match self.holds {
            Some(true) => "yes",
            Some(false) => "no",
            None => "-",
        }
    }
}

/// Picture with its numbers and its caption.
#[derive(Debug, Clone)]
pub struct StudyFigure {
    /// Name for files: `clearances`.
    pub name: &'static str,
    /// Caption as plain text.
    pub caption: String,
    /// SVG file and the HTML for the page.
    pub picture: Picture,
    /// The numbers shown.
    pub sheet: Sheet,
}

/// Picture as an SVG file, and as HTML for the page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Complete SVG file.
    pub svg: String,
    /// HTML for the page.
    pub html: String,
}

impl Picture {
    /// Draws a line plot.
    ///
    /// # Errors
    /// The plotting library fails.
    pub fn plot(plot: &Plot) -> Result<Self> {
        Ok(Self { svg: plot.to_whole_svg()?, html: plot.to_html()? })
    }

    /// Draws a waterfall diagram.
    pub fn waterfall(waterfall: &Waterfall) -> Self {
        let svg = waterfall.to_svg();
        Self { html: svg.clone(), svg }
    }
}

/// Numbers with named columns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sheet {
    /// Column names with units: `time (s)`.
    pub columns: Vec<String>,
    /// Rows, each as long as `columns`.
    pub rows: Vec<Vec<f64>>,
}

impl Sheet {
    /// Creates an empty sheet.
    pub fn new<const N: usize>(columns: [&str; N]) -> Self {
        Self { columns: columns.map(String::from).to_vec(), rows: Vec::new() }
    }

    /// Returns comma-separated values; numbers are read back to the same bits.
    pub fn to_csv(&self) -> String {
        let quoted = |name: &String| if name.contains([',', '"']) { format!("{name:?}") } else { name.clone() };
        let mut text = self.columns.iter().map(quoted).collect::<Vec<_>>().join(",");
        for row in &self.rows {
            text.push('\n');
            text.push_str(&row.iter().map(|value| shortest(*value)).collect::<Vec<_>>().join(","));
        }
        text.push('\n');
        text
    }
}

impl Study {
    /// Returns facts, statements and results as JSON; the numbers of the figures are in their CSV files.
    pub fn to_json(&self) -> Value {
        json!({
            "study": self.name,
            "title": self.title,
            "facts": self.facts.iter().map(|(name, value)| (name.clone(), json!(value))).collect::<serde_json::Map<_, _>>(),
            "statements": self.statements.iter().map(|statement| json!({
                "expected": statement.expected, "found": statement.found, "holds": statement.holds,
            })).collect::<Vec<_>>(),
            "figures": self.figures.iter().map(|figure| json!({
                "name": figure.name, "caption": figure.caption,
                "svg": format!("{}.svg", figure.name), "csv": format!("{}.csv", figure.name),
            })).collect::<Vec<_>>(),
            "results": self.results,
        })
    }

    /// Returns the study as text for the terminal.
    pub fn to_text(&self) -> String {
        let mut text = format!("{}\n{}\n\n", self.title, self.summary);
        let width = self.facts.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        for (name, value) in &self.facts {
            text.push_str(&format!("  {name:<width$}  {value}\n"));
        }
        text.push_str("\nexpected results, and whether they were found:\n");
        for statement in &self.statements {
            text.push_str(&format!("  {:<4}{}\n      {}\n", statement.verdict(), statement.expected, statement.found));
        }
        text
    }

    /// Returns a figure by its name.
    ///
    /// # Errors
    /// There is no such figure.
    pub fn figure(&self, name: &str) -> Result<&StudyFigure> {
        let missing = || Failure::new(format!("study {}", self.name), format!("no figure {name}"), "");
        self.figures.iter().find(|figure| figure.name == name).ok_or_else(missing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheets_are_csv_with_numbers_that_read_back() {
        let mut sheet = Sheet::new(["time (s)", "a, b"]);
        sheet.rows.push(vec![0.1, -1.0 / 3.0]);
        assert_eq!(sheet.to_csv(), "time (s),\"a, b\"\n0.1,-0.3333333333333333\n");
    }

    #[test]
    fn statements_print_their_verdict() {
        let yes = Statement::tested("a", true, "b");
        assert_eq!(
            [yes.verdict(), Statement::tested("a", false, "b").verdict(), Statement::remark("a", "b").verdict()],
            ["yes", "no", "-"]
        );
    }
}
