//! Tables of all pairs of methods, and of every single run.

use std::fmt::Write as _;

use serde_json::{Value, json};
use tiprub_figure::escape;
use tiprub_reference::compare::{HistoryDifference, WINDOW, agreement, asymmetry, exit_speed, windowed};

use super::runs::{CubeFlight, CubeRun, released};

/// Headings of the pairs.
const PAIR: [&str; 10] = [
    "u1x",
    "slowing",
    "u1z",
    "u1y",
    "λ1, windows",
    "λ1, peak window",
    "λ1, impulse",
    "left face, impulse",
    "exit speed",
    "u1x until the cube separates",
];
/// Headings of the runs.
const RUN: [&str; 9] = [
    "u1x (mm)",
    "u1z (mm)",
    "λ1, largest 20 µs average (N)",
    "node 1 separates (ms)",
    "cube separates (ms)",
    "exit (m/s)",
    "left/right: ux, λ",
    "largest penetration (m)",
    "steps + preparation (CPU s)",
];

/// Two runs compared.
#[derive(Debug, Clone)]
pub(super) struct RunPair {
    pub first: &'static str,
    pub second: &'static str,
    pub found: HistoryDifference,
}

impl RunPair {
    /// Returns the relative differences in the columns of [`PAIR`].
    pub(super) fn shares(&self) -> [f64; 10] {
        let HistoryDifference { touching, contact, path, windows, peak, impulse, left_impulse, exit } = self.found;
        let [x, slowing, z] = touching;
        [x, slowing, z, path, windows, peak, impulse, left_impulse, exit, contact[0]]
    }

    fn cells(&self) -> Vec<String> {
        let percent = |(index, share): (usize, f64)| {
            if (5..9).contains(&index) { format!("{:+.2} %", 100.0 * share) } else { format!("{:.2} %", 100.0 * share) }
        };
        self.shares().into_iter().enumerate().map(percent).collect()
    }
}

/// Returns all pairs of successful runs, with windows as those of `a`, the first of them.
pub(super) fn pairs(outcomes: &[CubeRun], flight: &CubeFlight) -> Vec<RunPair> {
    let runs: Vec<_> = outcomes.iter().filter_map(|outcome| Some((outcome.name, outcome.history()?))).collect();
    let Some((_, a)) = runs.first() else { return Vec::new() };
    let end = a.times.last().copied().unwrap_or(0.0);
    let contact = a.last_contact().unwrap_or(end).min(end);
    let touching = released(a).clamp(2.0 * WINDOW, end - 2.0 * WINDOW);
    let mut pairs = Vec::new();
    for (index, (first, b)) in runs.iter().enumerate() {
        for (second, a) in &runs[index + 1..] {
            let found = agreement(a, b, flight.speed, touching, contact);
            pairs.push(RunPair { first, second, found });
        }
    }
    pairs
}

/// Returns the readings of a run.
fn readings(outcome: &CubeRun) -> Vec<String> {
    let Ok(run) = &outcome.result else { return vec![String::new(); RUN.len()] };
    let history = &run.history;
    let span = |component: usize| {
        let values = history.first(component);
        let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
        format!("{:.3} … {:.3}", 1e3 * low, 1e3 * high)
    };
    let end = history.times.last().copied().unwrap_or(0.0);
    // A contact that has not ended with the run has no time.
    let ended = |time: f64, text: String| if time < end * (1.0 - 1e-9) { text } else { "–".into() };
    let (leaves, last) = (released(history), history.last_contact().unwrap_or(0.0));
    let means = windowed(&history.times, &history.first_force(), WINDOW, end);
    let [moved, force] = asymmetry(history, f64::MAX);
    vec![
        span(0),
        span(2),
        format!("{:.0}", means.iter().fold(0.0, |most: f64, mean| most.max(*mean))),
        ended(leaves, format!("{:.3}", 1e3 * leaves)),
        ended(last, format!("{:.3}", 1e3 * last)),
        ended(last, format!("{:.3}", exit_speed(history))),
        format!("{moved:.0e}, {force:.0e}"),
        format!("{:.0e}", history.penetration.iter().fold(0.0, |most: f64, depth| most.max(*depth))),
        format!("{:.1} + {:.1}", history.processor_time, history.preparation_time),
    ]
}

/// Returns both tables as Markdown.
pub(super) fn markdown(outcomes: &[CubeRun], pairs: &[RunPair]) -> String {
    let mut text = String::new();
    let heading = |first: &str, columns: &[&str]| {
        format!("| {first} | {} |\n|---|{}\n", columns.join(" | "), "---|".repeat(columns.len()))
    };
    text.push_str(&heading("pair", &PAIR));
    for pair in pairs {
        let _ = writeln!(text, "| {} / {} | {} |", pair.second, pair.first, pair.cells().join(" | "));
    }
    text.push('\n');
    text.push_str(&heading("run", &RUN));
    for outcome in outcomes {
        let _ = match &outcome.result {
            Ok(_) => writeln!(text, "| {} | {} |", outcome.name, readings(outcome).join(" | ")),
            Err(problem) => writeln!(text, "| {} | failed: {problem} |", outcome.name),
        };
    }
    text
}

/// Returns the pairs for the page.
pub(super) fn html(pairs: &[RunPair]) -> String {
    let mut html = String::from("<table><thead><tr><th>pair</th>");
    for name in PAIR {
        let _ = write!(html, "<th>{name}</th>");
    }
    html.push_str("</tr></thead><tbody>");
    for pair in pairs {
        let name = escape(&format!("{} / {}", pair.second, pair.first));
        let _ = write!(html, "<tr><td>{name}</td><td>{}</td></tr>", pair.cells().join("</td><td>"));
    }
    html.push_str("</tbody></table>");
    html
}

/// Returns runs and pairs for programs.
pub(super) fn json(outcomes: &[CubeRun], pairs: &[RunPair], flight: &CubeFlight) -> Value {
    json!({
        "speed": flight.speed,
        "friction": flight.friction,
        "runs": outcomes.iter().map(|outcome| match &outcome.result {
            Err(problem) => json!({ "name": outcome.name, "failed": problem }),
            Ok(run) => json!({
                "name": outcome.name,
                "exit_speed": exit_speed(&run.history),
                "asymmetry": asymmetry(&run.history, f64::MAX),
                "node_1_leaves": released(&run.history),
                "cube_leaves": run.history.last_contact(),
                "energy": [run.history.total().first(), run.history.total().last()],
                "kinetic_in_the_end": run.history.kinetic.last(),
                "ledger_residual": outcome.is_product().then_some(run.residual),
                "processor_seconds": run.history.processor_time,
                "preparation_seconds": run.history.preparation_time,
                "internal_steps": run.internal_steps,
            }),
        }).collect::<Vec<_>>(),
        "pairs": pairs.iter().map(|pair| json!({
            "first": pair.first, "second": pair.second, "shares": pair.shares(),
        })).collect::<Vec<_>>(),
    })
}
