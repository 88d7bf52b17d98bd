//! Means of a run over time, and totals at its end.

use serde_json::{Value, json};
use tiprub_cosim::variables::Span;

use crate::{
    native::{NativeRun, OutputColumn},
    recording::Recording,
};

/// Mean or total of an output over a run.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedValue {
    /// Name: that of the output; for means with `mean_` before the last part of the name.
    pub name: String,
    /// Value (SI unit of the output).
    pub value: f64,
}

/// Returns the means over the whole run of the total normal force (N) and of all scalar outputs that are means over a communication step, such as
/// force, torque and friction power. They are exact: sums of the exchanged impulse or energy, divided by the length of the run.
pub fn means(run: &NativeRun) -> Vec<NamedValue> {
    let recording = &run.recording;
    let length = recording.times.last().copied().unwrap_or(0.0) - recording.times.first().copied().unwrap_or(0.0);
    let force = recording.column("normal_impulse").map(|impulses| {
        let impulse: f64 = impulses.iter().skip(1).sum();
        NamedValue { name: "mean_total_normal_force".to_owned(), value: impulse / length }
    });
    let outputs = scalars(run, |span, _| span == Span::Mean);
    let mean = |(name, column): (&String, usize)| {
        let values: Vec<f64> = (0..recording.rows()).map(|row| recording.row(row)[column]).collect();
        NamedValue { name: with_prefix("mean_", name), value: integral(recording, &values) / length }
    };
    force.into_iter().chain(outputs.map(mean)).collect()
}

/// Returns the values at the end of the run of all scalar outputs that accumulate since the start, such as friction heat, wear and numbers of steps,
/// and of all energies.
pub fn totals(run: &NativeRun) -> Vec<NamedValue> {
    let last = run.recording.rows().checked_sub(1);
    let outputs = scalars(run, |span, is_energy| span == Span::Total || is_energy);
    let total = |(name, column): (&String, usize)| {
        let value = last.map_or(f64::NAN, |row| run.recording.row(row)[column]);
        NamedValue { name: name.clone(), value }
    };
    outputs.map(total).collect()
}

/// Returns the names of all means and totals of a run with these outputs.
pub fn names(names: &[String], columns: &[OutputColumn]) -> Vec<String> {
    let select = |is_wanted: &dyn Fn(&OutputColumn) -> bool| -> Vec<&String> {
        let scalars = names.iter().zip(columns).filter(|(_, facts)| !facts.is_element && is_wanted(facts));
        scalars.map(|(name, _)| name).collect()
    };
    let force = names.iter().any(|name| name == "normal_impulse").then(|| "mean_total_normal_force".to_owned());
    let means = select(&|facts| facts.span == Span::Mean).into_iter().map(|name| with_prefix("mean_", name));
    let totals = select(&|facts| facts.span == Span::Total || facts.is_energy).into_iter().cloned();
    force.into_iter().chain(means).chain(totals).collect()
}

/// Returns named values as a JSON object.
pub fn json(values: &[NamedValue]) -> Value {
    values.iter().map(|entry| (entry.name.clone(), json!(entry.value))).collect::<serde_json::Map<_, _>>().into()
}

/// Integrates an output that is a mean over each communication step over the run. The value at the start has no step.
pub fn integral(recording: &Recording, values: &[f64]) -> f64 {
    recording.times.windows(2).zip(values.iter().skip(1)).map(|(ends, mean)| (ends[1] - ends[0]) * mean).sum()
}

/// Returns names and columns of the scalar outputs that `is_wanted` selects by their span and by whether they are energies.
fn scalars(run: &NativeRun, is_wanted: impl Fn(Span, bool) -> bool) -> impl Iterator<Item = (&String, usize)> {
    let columns = run.recording.names.iter().zip(&run.columns).zip(0..);
    columns.filter_map(move |((name, facts), column)| {
        (!facts.is_element && is_wanted(facts.span, facts.is_energy)).then_some((name, column))
    })
}

/// Inserts a prefix before the last part of a structured name: `front.torque` becomes `front.mean_torque`.
fn with_prefix(prefix: &str, name: &str) -> String {
    match name.rsplit_once('.') {
        Some((owner, last)) => format!("{owner}.{prefix}{last}"),
        None => format!("{prefix}{name}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn run() -> NativeRun {
        let column = |span, is_energy, is_element| OutputColumn { span, is_energy, is_element };
        NativeRun {
            recording: Recording {
                names: ["normal_impulse", "front.torque", "friction_loss", "kinetic_energy", "clearance[1]", "heat[1]"]
                    .map(String::from)
                    .to_vec(),
                times: vec![0.0, 0.5, 0.75],
                values: [
                    [0.0, 0.0, 0.0, 1.0, 1.0, 0.0],
                    [3.0, -2.0, 5.0, 2.0, 1.0, 1.0],
                    [1.5, -8.0, 7.0, 3.0, 1.0, 1.0],
                ]
                .concat(),
            },
            columns: vec![
                column(Span::Window, false, false),
                column(Span::Mean, false, false),
                column(Span::Total, true, false),
                column(Span::Point, true, false),
                column(Span::Point, false, true),
                column(Span::Mean, false, true),
            ],
            parameters: Vec::new(),
            stepping: Duration::ZERO,
            slowest: Duration::ZERO,
            internal_steps: 0,
            effort: None,
            warnings: Vec::new(),
            checks: Vec::new(),
        }
    }

    #[test]
    fn means_weight_steps_by_their_length() {
        let found = means(&run());
        let expected = [("mean_total_normal_force", 4.5 / 0.75), ("front.mean_torque", (-1.0 - 2.0) / 0.75)];
        let expected = expected.map(|(name, value)| NamedValue { name: name.to_owned(), value });
        assert_eq!(found, expected);
        assert_eq!(json(&found)["front.mean_torque"], json!(-4.0));
        let run = run();
        let all = found.into_iter().chain(totals(&run)).map(|entry| entry.name);
        assert_eq!(names(&run.recording.names, &run.columns), all.collect::<Vec<_>>());
    }

    #[test]
    fn totals_are_taken_at_the_end_of_the_run() {
        let found: Vec<(String, f64)> = totals(&run()).into_iter().map(|entry| (entry.name, entry.value)).collect();
        assert_eq!(found, [("friction_loss".to_owned(), 7.0), ("kinetic_energy".to_owned(), 3.0)]);
    }
}
