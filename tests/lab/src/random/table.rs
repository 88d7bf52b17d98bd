//! Tables of the outcomes of random scenes.

use std::fmt::Write as _;

use serde_json::{Value, json};
use tiprub_core::scene::method::{Scheme, Solver};

use super::features::FEATURES;
use super::{RandomRow, SceneOutcome};

/// Numbers of scenes that ran, were rejected, ended with a reason, or failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct SceneCounts([usize; 4]);

/// Names of the counts.
const COUNTS: [&str; 4] = ["ran", "rejected", "ended", "wrong"];

impl SceneCounts {
    fn of<'a>(rows: impl Iterator<Item = &'a RandomRow>) -> Self {
        let mut counts = Self::default();
        for row in rows {
            let place = match (row.is_wrong(), row.outcome) {
                (true, _) => 3,
                (_, SceneOutcome::Ran) => 0,
                (_, SceneOutcome::Rejected) => 1,
                (_, SceneOutcome::Ended) => 2,
            };
            counts.0[place] += 1;
        }
        counts
    }

    fn cell(self) -> String {
        if self == Self::default() { "-".to_owned() } else { self.0.map(|count| count.to_string()).join("/") }
    }

    fn to_json(self) -> Value {
        COUNTS
            .iter()
            .zip(self.0)
            .map(|(name, count)| ((*name).to_owned(), json!(count)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    }
}

/// All rows of a run.
#[derive(Debug)]
pub(super) struct RandomTable {
    /// One row per scene.
    pub rows: Vec<RandomRow>,
}

impl RandomTable {
    /// Returns the rows with findings.
    pub(super) fn wrong(&self) -> impl Iterator<Item = &RandomRow> {
        self.rows.iter().filter(|row| row.is_wrong())
    }

    fn methods(&self) -> Vec<(Scheme, Solver)> {
        let all = Scheme::ALL.into_iter().flat_map(|scheme| Solver::ALL.map(|solver| (scheme, solver)));
        all.filter(|(scheme, solver)| self.rows.iter().any(|row| (row.scheme, row.solver) == (*scheme, *solver)))
            .collect()
    }

    fn counts(&self, scheme: Option<Scheme>, solver: Option<Solver>, feature: Option<usize>) -> SceneCounts {
        SceneCounts::of(self.rows.iter().filter(|row| {
            scheme.is_none_or(|scheme| row.scheme == scheme)
                && solver.is_none_or(|solver| row.solver == solver)
                && feature.is_none_or(|feature| row.features.contains(&feature))
        }))
    }

    /// Returns the number of findings of each oracle, largest first.
    fn oracles(&self) -> Vec<(&'static str, usize)> {
        let mut counts: Vec<(&'static str, usize)> = Vec::new();
        for finding in self.rows.iter().flat_map(|row| &row.findings) {
            match counts.iter_mut().find(|(oracle, _)| *oracle == finding.oracle) {
                Some((_, count)) => *count += 1,
                None => counts.push((finding.oracle, 1)),
            }
        }
        counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        counts
    }

    /// Returns the table for a terminal.
    pub(super) fn to_text(&self) -> String {
        let all = SceneCounts::of(self.rows.iter());
        let summary =
            COUNTS.iter().zip(all.0).map(|(name, count)| format!("{count} {name}")).collect::<Vec<_>>().join(", ");
        let compared = self.rows.iter().filter(|row| row.compared).count();
        let mut text =
            format!("{} random scenes: {summary}; {compared} compared with the FMU library\n\n", self.rows.len());
        let _ = writeln!(text, "  {:<38}{}", "scheme, solver", COUNTS.map(|name| format!("{name:>9}")).concat());
        for (scheme, solver) in self.methods() {
            let counts = self.counts(Some(scheme), Some(solver), None).0.map(|count| format!("{count:>9}"));
            let _ = writeln!(text, "  {:<38}{}", format!("{}, {}", scheme.name(), solver.name()), counts.concat());
        }
        let head = Scheme::ALL.map(|scheme| format!("{:>20}", scheme.name())).concat();
        let _ = writeln!(text, "\n  {:<20}{head}   ({})", "feature", COUNTS.join("/"));
        for (index, (name, _)) in FEATURES.iter().enumerate() {
            let cells =
                Scheme::ALL.map(|scheme| format!("{:>20}", self.counts(Some(scheme), None, Some(index)).cell()));
            let _ = writeln!(text, "  {name:<20}{}", cells.concat());
        }
        for (oracle, count) in self.oracles() {
            let _ = write!(text, "\n  {count} findings of the check `{oracle}`");
        }
        text
    }

    /// Returns everything, with the counts of each scheme, solver and feature.
    pub(super) fn to_json(&self) -> Value {
        let mut cells = Vec::new();
        for (scheme, solver) in self.methods() {
            let mut cell = |feature: &str, counts: SceneCounts| {
                cells.push(json!({
                    "scheme": scheme.name(), "solver": solver.name(), "feature": feature, "counts": counts.to_json(),
                }));
            };
            cell("all", self.counts(Some(scheme), Some(solver), None));
            for (index, (name, _)) in FEATURES.iter().enumerate() {
                cell(name, self.counts(Some(scheme), Some(solver), Some(index)));
            }
        }
        let oracles: serde_json::Map<_, _> =
            self.oracles().into_iter().map(|(oracle, count)| (oracle.to_owned(), json!(count))).collect();
        json!({
            "scenes": self.rows.len(),
            "counts": SceneCounts::of(self.rows.iter()).to_json(),
            "compared": self.rows.iter().filter(|row| row.compared).count(),
            "oracles": oracles,
            "cells": cells,
            "wrong": self.wrong().map(row_as_json).collect::<Vec<_>>(),
        })
    }
}

/// Returns a complete row.
pub(super) fn row_as_json(row: &RandomRow) -> Value {
    json!({
        "seed": row.seed,
        "scheme": row.scheme.name(),
        "solver": row.solver.name(),
        "features": row.features.iter().map(|index| FEATURES[*index].0).collect::<Vec<_>>(),
        "outcome": format!("{:?}", row.outcome).to_lowercase(),
        "message": row.message,
        "findings": row.findings.iter().map(|one| json!({ "oracle": one.oracle, "text": one.text })).collect::<Vec<_>>(),
        "seconds": row.seconds,
    })
}

/// Describes a row in words.
pub(super) fn row_as_text(row: &RandomRow) -> String {
    let features: Vec<&str> = row.features.iter().map(|index| FEATURES[*index].0).collect();
    let mut text = format!(
        "scene {}: {}, {}; {}\n  {}",
        row.seed,
        row.scheme.name(),
        row.solver.name(),
        features.join(", "),
        format!("{:?}", row.outcome).to_lowercase()
    );
    if let Some(message) = &row.message {
        let _ = write!(text, ": {}", message.trim());
    }
    for finding in &row.findings {
        let _ = write!(text, "\n  WRONG ({}): {}", finding.oracle, finding.text);
    }
    text
}
