//! Largest and smallest values of a run, with their times.

use serde_json::{Value, json};
use tiprub_cosim::shown;

use crate::recording::Recording;

/// Largest or smallest value of a variable over a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Extreme {
    /// Name for programs: `largest_total_normal_force`.
    pub name: &'static str,
    /// Description for people.
    pub text: &'static str,
    /// Unit; empty for a number without unit.
    pub unit: &'static str,
    /// The value.
    pub value: f64,
    /// End of the communication step of the extreme, or the communication point (s).
    pub time: f64,
}

/// Returns the extremes of the variables that a recording has: forces, clearance, contacts.
pub fn extremes(recording: &Recording) -> Vec<Extreme> {
    // Finds the largest value of a column, or with `sense` −1 the smallest, and the first time at which it is reached.
    let found = |name, text, unit, sense: f64, values: Option<Vec<f64>>| {
        let values = values?.into_iter().zip(recording.times.iter().copied());
        let further = |best: (f64, f64), next: (f64, f64)| if sense * (next.0 - best.0) > 0.0 { next } else { best };
        let (value, time) = values.reduce(further)?;
        Some(Extreme { name, text, unit, value, time })
    };
    let [total, one, least, most] = [
        "largest total normal force of all contact nodes, mean over a communication step",
        "largest normal force on a single contact node in an internal step",
        "smallest clearance",
        "largest number of contact nodes touching at a communication point",
    ];
    let column = |name: &str| recording.column(name);
    let all = [
        found("largest_total_normal_force", total, "N", 1.0, total_normal_force(recording)),
        found("largest_node_normal_force", one, "N", 1.0, column("normal_force_peak")),
        found("smallest_clearance", least, "m", -1.0, column("clearance_minimum")),
        found("most_contacts", most, "", 1.0, column("contact_count")),
    ];
    all.into_iter().flatten().collect()
}

/// Returns the impulse of every communication step divided by its length (N); 0 at the start.
fn total_normal_force(recording: &Recording) -> Option<Vec<f64>> {
    let impulses = recording.column("normal_impulse")?;
    let steps = recording.times.windows(2).map(|two| two[1] - two[0]);
    Some([0.0].into_iter().chain(impulses.iter().skip(1).zip(steps).map(|(impulse, step)| impulse / step)).collect())
}

impl Extreme {
    /// Returns a line for the summary; an extreme of 0 has no time.
    pub fn line(&self) -> String {
        let Self { text, unit, value, time, .. } = self;
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let value = six_digits(*value);
        match self.value {
            0.0 if self.name != "smallest_clearance" => format!("{text}: 0{unit}"),
            _ => format!("{text}: {value}{unit} at t = {} s", six_digits(*time)),
        }
    }

    /// Returns all extremes of a run as JSON.
    pub fn json(all: &[Self]) -> Value {
        let one = |extreme: &Self| (extreme.name.to_owned(), json!({ "value": extreme.value, "time": extreme.time }));
        all.iter().map(one).collect::<serde_json::Map<_, _>>().into()
    }
}

/// Formats a value with six significant digits; never a negative zero.
pub fn six_digits(value: f64) -> String {
    match format!("{value:.5e}").parse::<f64>() {
        Ok(0.0) => "0".to_owned(),
        Ok(rounded) => shown(rounded),
        Err(_) => shown(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(names: &[&str], rows: &[&[f64]]) -> Recording {
        Recording {
            names: names.iter().map(ToString::to_string).collect(),
            times: (0..rows.len()).map(|row| 0.5 * row as f64).collect(),
            values: rows.concat(),
        }
    }

    #[test]
    fn reports_each_extreme_with_its_first_time() {
        let names = ["clearance_minimum", "normal_force_peak", "normal_impulse", "contact_count"];
        let rows: [&[f64]; 4] =
            [&[1e-3, 0.0, 0.0, 0.0], &[1.234_567e-5, 30.0, 4.0, 2.0], &[0.0, 80.0, 3.0, 5.0], &[0.0, 20.0, 4.0, 5.0]];
        let found = extremes(&recording(&names, &rows));
        let lines: Vec<String> = found.iter().map(Extreme::line).collect();
        // 4 N·s in 0.5 s.
        assert!(lines[0].ends_with("nodes, mean over a communication step: 8 N at t = 0.5 s"), "{lines:?}");
        assert!(lines[1].ends_with("internal step: 80 N at t = 1 s"), "{lines:?}");
        assert_eq!(lines[2], "smallest clearance: 0 m at t = 1 s");
        assert_eq!(lines[3], "largest number of contact nodes touching at a communication point: 5 at t = 1 s");
        assert_eq!(six_digits(1.234_567e-5), "1.23457e-5");
        assert_eq!(Extreme::json(&found)["most_contacts"], json!({ "value": 5.0, "time": 1.0 }));
    }

    #[test]
    fn omits_unrecorded_extremes_and_times_of_zero_values() {
        let found = extremes(&recording(&["normal_impulse", "torque"], &[&[0.0, 1.0], &[0.0, 2.0]]));
        assert_eq!(found.len(), 1);
        assert!(found[0].line().ends_with("communication step: 0 N"), "{}", found[0].line());
    }
}
