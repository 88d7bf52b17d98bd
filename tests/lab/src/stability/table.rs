//! The table of all cases: text, HTML, CSV, JSON and Markdown.

use std::{fmt::Write as _, path::Path};

use serde_json::{Value, json};
use tiprub_figure::{STYLE, escape};
use tiprub_shell::{Result, console::CommandOutcome, output_file};

use super::{CaseVerdict, child::StabilityRow, models::StabilityMethod};

/// All rows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StabilityTable {
    /// One row per case, in the order of the cases.
    pub rows: Vec<StabilityRow>,
}

impl StabilityTable {
    /// Files that [`StabilityTable::write`] writes.
    pub(crate) const FILES: [&str; 4] = ["index.html", "results.json", "stability.csv", "stability.md"];

    /// Returns the number of rows with a verdict.
    pub(crate) fn count(&self, verdict: CaseVerdict) -> usize {
        self.rows.iter().filter(|row| row.verdict == verdict).count()
    }

    fn families(&self) -> Vec<&str> {
        let mut families: Vec<&str> = Vec::new();
        for row in &self.rows {
            let family = family(row);
            if !families.contains(&family) {
                families.push(family);
            }
        }
        families
    }

    /// Returns the families with a row for each of their methods: cases, and the number of each verdict.
    fn methods(&self) -> Vec<FamilyCount<'_>> {
        let mut counted: Vec<FamilyCount<'_>> = Vec::new();
        for row in &self.rows {
            let (family, method) = (family(row), StabilityMethod::in_name(&row.name));
            let place = counted.iter().position(|one| one.family == family && one.method == method);
            let place = place.unwrap_or_else(|| {
                counted.push(FamilyCount { family, method, counts: [0; CaseVerdict::ALL.len()] });
                counted.len() - 1
            });
            let verdict = CaseVerdict::ALL.iter().position(|verdict| *verdict == row.verdict);
            counted[place].counts[verdict.unwrap_or(0)] += 1;
        }
        counted
    }

    /// Returns the families by schemes with their choice of the step: right + refused + ended, and the failures if
    /// there are any.
    fn by_method(&self) -> (Vec<&'static str>, Vec<(&str, Vec<String>)>) {
        let columns: Vec<Option<&str>> = StabilityMethod::integrations().map(Some).chain([None]).collect();
        let counted = self.methods();
        let cell = |family: &str, column: Option<&str>| {
            let rows = counted.iter().filter(|one| one.family == family && one.method.0 == column);
            let sum = |verdict: usize| rows.clone().map(|one| one.counts[verdict]).sum::<usize>();
            let [right, refused, ended] = [0, 1, 2].map(sum);
            let wrong: usize = (3..CaseVerdict::ALL.len()).map(sum).sum();
            match (right + refused + ended, wrong) {
                (0, 0) => String::new(),
                (_, 0) => format!("{right} + {refused} + {ended}"),
                _ => format!("{right} + {refused} + {ended}, {wrong} WRONG"),
            }
        };
        let line = |family| (family, columns.iter().map(|column| cell(family, *column)).collect());
        let names = StabilityMethod::integrations().chain([OTHER]).collect();
        (names, self.families().into_iter().map(line).collect())
    }

    /// Returns the rows that are neither correct nor rejected as expected.
    pub(crate) fn unsound(&self) -> impl Iterator<Item = &StabilityRow> {
        self.rows.iter().filter(|row| !row.verdict.is_sound())
    }

    fn summary(&self) -> String {
        let counts = CaseVerdict::ALL.map(|verdict| format!("{} {}", self.count(verdict), verdict.name()));
        format!("{} cases: {}", self.rows.len(), counts.join(", "))
    }

    fn to_text(&self) -> String {
        let mut text = format!("Stability on stiff and extreme cases\n{}\n\n", self.summary());
        let _ = writeln!(text, "  {:<16}{}", "family", CaseVerdict::ALL.map(|v| format!("{:>9}", v.name())).concat());
        for family in self.families() {
            let counts = CaseVerdict::ALL.map(|verdict| format!("{:>9}", self.of(family, verdict)));
            let _ = writeln!(text, "  {family:<16}{}", counts.concat());
        }
        let (columns, lines) = self.by_method();
        let _ = writeln!(text, "\nright + refused + ended, family by method\n\n  {:<16}{}", "family", wide(&columns));
        for (family, cells) in &lines {
            let _ = writeln!(text, "  {family:<16}{}", wide(cells));
        }
        for row in self.unsound() {
            let _ = write!(
                text,
                "\n{} {}\n  expected: {}\n  happened: {}\n",
                row.verdict.name(),
                row.name,
                row.expected,
                row.happened
            );
        }
        text
    }

    fn of(&self, asked: &str, verdict: CaseVerdict) -> usize {
        self.rows.iter().filter(|row| family(row) == asked && row.verdict == verdict).count()
    }

    /// Returns the table for programs.
    pub(crate) fn to_json(&self) -> Value {
        let counts: serde_json::Map<_, _> = CaseVerdict::ALL
            .iter()
            .map(|verdict| (verdict.name().to_lowercase(), json!(self.count(*verdict))))
            .collect();
        json!({
            "cases": self.rows.len(),
            "counts": counts,
            "methods": self.methods().iter().map(FamilyCount::to_json).collect::<Vec<_>>(),
            "rows": self.rows.iter().map(|row| json!({
                "case": row.name, "expected": row.expected, "happened": row.happened,
                "verdict": row.verdict.name(), "seconds": row.seconds,
            })).collect::<Vec<_>>(),
        })
    }

    fn to_csv(&self) -> String {
        let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
        let mut csv = String::from("case,expected,happened,verdict,seconds\n");
        for row in &self.rows {
            let cells = [&row.name, &row.expected, &row.happened].map(|text| quoted(text));
            let _ = writeln!(csv, "{},{},{:.3}", cells.join(","), row.verdict.name(), row.seconds);
        }
        csv
    }

    /// Returns the chapter of the guide, below its fixed introduction. It contains no times: equal sources give equal
    /// text.
    pub(crate) fn to_markdown(&self) -> String {
        let mut text =
            format!("{}\n\n| family | {} |\n", self.summary(), CaseVerdict::ALL.map(CaseVerdict::name).join(" | "));
        text.push_str("|---|---|---|---|---|---|---|\n");
        for family in self.families() {
            let counts = CaseVerdict::ALL.map(|verdict| self.of(family, verdict).to_string());
            let _ = writeln!(text, "| {family} | {} |", counts.join(" | "));
        }
        let (columns, lines) = self.by_method();
        let _ = write!(text, "\nRight + refused + ended:\n\n| family | {} |\n", columns.join(" | "));
        let _ = writeln!(text, "|{}", "---|".repeat(columns.len() + 1));
        for (family, cells) in &lines {
            let _ = writeln!(text, "| {family} | {} |", cells.join(" | "));
        }
        for family in self.families() {
            let _ = write!(text, "\n### {family}\n\n| case | expected | happened | verdict |\n|---|---|---|---|\n");
            let rows: Vec<&StabilityRow> = self.rows.iter().filter(|row| self::family(row) == family).collect();
            for (name, group) in groups(&rows) {
                let counts = CaseVerdict::ALL.map(|verdict| group.iter().filter(|row| row.verdict == verdict).count());
                let verdicts = CaseVerdict::ALL.iter().zip(counts).filter(|(_, count)| *count > 0);
                let verdicts: Vec<String> = match group.len() {
                    1 => verdicts.map(|(verdict, _)| verdict.name().to_owned()).collect(),
                    _ => verdicts.map(|(verdict, count)| format!("{count} {}", verdict.name())).collect(),
                };
                let cells =
                    [&name, &group[0].expected, &shortened(&group[0].happened)].map(|cell| cell.replace('|', "\\|"));
                let _ = writeln!(text, "| {} | {} |", cells.join(" | "), verdicts.join(", "));
            }
        }
        text
    }

    fn to_html(&self) -> String {
        let mut page = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>Stability - tiprub</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n\
             <header><h1>Stability on stiff and extreme cases</h1><p>{}</p></header>\n<section><table><thead><tr>\
             <th>case</th><th>expected</th><th>happened</th><th>verdict</th></tr></thead><tbody>\n",
            escape(&self.summary())
        );
        for row in &self.rows {
            let cells = [&row.name, &row.expected, &row.happened].map(|text| format!("<td>{}</td>", escape(text)));
            let _ = writeln!(page, "<tr>{}<td>{}</td></tr>", cells.concat(), row.verdict.name());
        }
        page.push_str("</tbody></table></section>\n</main>\n</body>\n</html>\n");
        page
    }

    /// Writes page, CSV and JSON to a directory, and returns a summary.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub(crate) fn write(&self, directory: &Path) -> Result<CommandOutcome> {
        output_file::create_directory(directory)?;
        let page = directory.join("index.html");
        output_file::write(&page, self.to_html())?;
        output_file::write(&directory.join("stability.csv"), self.to_csv())?;
        output_file::write(&directory.join("stability.md"), self.to_markdown())?;
        let json = self.to_json();
        output_file::write(&directory.join("results.json"), format!("{json:#}\n"))?;
        Ok(CommandOutcome {
            text: format!("{}\nopen {}", self.to_text(), page.display()),
            json,
            ..CommandOutcome::default()
        })
    }
}

/// Cases of a family with one method.
#[derive(Debug)]
struct FamilyCount<'a> {
    family: &'a str,
    /// Scheme with its choice of the step, and solver, as far as the names of cases contain them.
    method: (Option<&'static str>, Option<&'static str>),
    /// Number of cases per verdict.
    counts: [usize; CaseVerdict::ALL.len()],
}

impl FamilyCount<'_> {
    fn to_json(&self) -> Value {
        let counts = CaseVerdict::ALL.iter().zip(self.counts);
        let counts: serde_json::Map<_, _> =
            counts.map(|(verdict, count)| (verdict.name().to_lowercase(), json!(count))).collect();
        json!({
            "family": self.family,
            "method": self.method.0.unwrap_or(OTHER),
            "solver": self.method.1,
            "cases": self.counts.iter().sum::<usize>(),
            "counts": counts,
        })
    }
}

/// Column of cases without a method in their names: most run modal-exact with lcp.
const OTHER: &str = "other";

/// Returns the cells of a table as text.
fn wide(cells: &[impl AsRef<str>]) -> String {
    cells.iter().map(|cell| format!("{:>18}", cell.as_ref())).collect()
}

fn family(row: &StabilityRow) -> &str {
    row.name.split('/').next().unwrap_or(&row.name)
}

/// Families with more cases than this have one line per group in the guide.
const LISTED: usize = 60;
/// Number of characters of the actual end that the guide shows.
const SHOWN: usize = 160;

/// Returns the rows of a family with their labels: single rows, or rows that differ in the last part of the name
/// together, with the first of them as an example.
fn groups<'a>(rows: &[&'a StabilityRow]) -> Vec<(String, Vec<&'a StabilityRow>)> {
    let own = |row: &StabilityRow| row.name.split_once('/').map_or(row.name.clone(), |(_, rest)| rest.to_owned());
    if rows.len() <= LISTED {
        return rows.iter().map(|row| (own(row), vec![*row])).collect();
    }
    let mut groups: Vec<(String, Vec<&StabilityRow>)> = Vec::new();
    for row in rows {
        let name = own(row);
        let name = name.rsplit_once('/').map_or(name.clone(), |(before, _)| format!("{before}/…"));
        match groups.iter_mut().find(|(known, _)| *known == name) {
            Some((_, group)) => group.push(row),
            None => groups.push((name, vec![row])),
        }
    }
    groups
}

fn shortened(text: &str) -> String {
    if text.chars().count() <= SHOWN {
        return text.to_owned();
    }
    let short: String = text.chars().take(SHOWN).collect();
    format!("{short}…")
}
