//! Main results of a run in five lines: force, heat, torque, clearance, growth.

use serde_json::{Value, json};
use tiprub_core::scene::settings::{ContactSettings, SceneSettings};
use tiprub_shell::{
    extremes::{Extreme, extremes, six_digits},
    means::integral,
    recording::Recording,
};
use tiprub_study::estimate;

/// One line of the main results.
#[derive(Debug, Clone, PartialEq)]
pub struct AnswerLine {
    /// Name of the result.
    pub name: &'static str,
    /// Value and unit; `None` if the scene does not have it.
    pub value: Option<(f64, &'static str)>,
    /// Meaning of the value, or the reason why there is none.
    pub meaning: String,
}

/// Returns the five lines of a run of a scene; `set` contains the replaced start values (name, value as text).
pub fn scene_lines(recording: &Recording, settings: &SceneSettings, set: &[(String, String)]) -> [AnswerLine; 5] {
    lines(recording, allowed_error(settings, set))
}

/// Returns the largest gap or penetration (m) that adaptive steps accept in a closed contact; 0 with fixed steps.
fn allowed_error(settings: &SceneSettings, set: &[(String, String)]) -> f64 {
    let Some(tolerance) = estimate::time_in_use(settings, set).step_tolerance() else { return 0.0 };
    let gap = |contact: &ContactSettings| contact.nominal_gap();
    let smallest = settings.contacts.iter().map(gap).filter(|gap| *gap > 0.0).fold(f64::INFINITY, f64::min);
    if smallest.is_finite() { tolerance * smallest } else { 0.0 }
}

/// Returns the five lines of a run whose steps may leave closed contact open or penetrating by up to `tolerance` (m).
pub fn lines(recording: &Recording, tolerance: f64) -> [AnswerLine; 5] {
    let found = extremes(recording);
    let extreme = |name: &str| found.iter().find(|extreme| extreme.name == name);
    [
        force(extreme("largest_total_normal_force")),
        heat(recording),
        torque(recording),
        clearance(recording, &found, tolerance.max(ROUNDING)),
        growth(recording),
    ]
}

/// Formats the lines as text.
pub fn text(lines: &[AnswerLine]) -> String {
    let line = |AnswerLine { name, value, meaning }: &AnswerLine| {
        let value = value.map_or("-".to_owned(), |(value, unit)| format!("{} {unit}", six_digits(value)));
        format!("{name:<10} {:<16} {meaning}\n", value.trim_end())
    };
    lines.iter().map(line).collect()
}

/// Returns the lines as a JSON object of values, `null` if there is none.
pub fn json(lines: &[AnswerLine]) -> Value {
    let one = |line: &AnswerLine| (line.name.to_owned(), json!(line.value.map(|(value, _)| value)));
    lines.iter().map(one).collect::<serde_json::Map<_, _>>().into()
}

fn at(extreme: &Extreme) -> String {
    format!("at t = {} s", six_digits(extreme.time))
}

fn force(largest: Option<&Extreme>) -> AnswerLine {
    let (value, meaning) = match largest {
        Some(extreme) if extreme.value == 0.0 => (Some((0.0, "N")), "no contact occurred".to_owned()),
        Some(extreme) => {
            let meaning = "largest total normal force of all contacts, mean over a communication step";
            (Some((extreme.value, "N")), format!("{meaning}, {}", at(extreme)))
        }
        None => (None, "the scene has no output of the total contact force".to_owned()),
    };
    AnswerLine { name: "force", value, meaning }
}

fn heat(recording: &Recording) -> AnswerLine {
    let total = recording.column("friction_loss").and_then(|column| column.last().copied());
    let powers = || recording.column("friction_power").map(|powers| integral(recording, &powers));
    let (value, meaning) = match total.or_else(powers) {
        Some(heat) => (Some((heat, "J")), "friction heat over the whole run"),
        None => (None, "no contact in the scene has friction"),
    };
    AnswerLine { name: "heat", value, meaning: meaning.to_owned() }
}

fn torque(recording: &Recording) -> AnswerLine {
    let is_torque = |name: &&String| *name == "torque" || name.ends_with(".torque");
    let length = recording.times.last().copied().unwrap_or(0.0) - recording.times.first().copied().unwrap_or(0.0);
    let mean = |name: &String| {
        let column = recording.column(name).unwrap_or_default();
        integral(recording, &column) / length
    };
    let rotors: Vec<(&String, f64)> = recording.names.iter().filter(is_torque).map(|name| (name, mean(name))).collect();
    let (value, meaning) = match rotors.as_slice() {
        [] => (None, "the scene has no rotor".to_owned()),
        [(_, torque)] => (Some((*torque, "N m")), "contact torque on the rotor about +z, mean over the run".to_owned()),
        several => {
            let each = several.iter().map(|(name, torque)| format!("{name} {}", six_digits(*torque)));
            let sum = several.iter().map(|(_, torque)| torque).sum();
            (
                Some((sum, "N m")),
                format!("contact torques about +z, mean over the run: {}", each.collect::<Vec<_>>().join(", ")),
            )
        }
    };
    AnswerLine { name: "torque", value, meaning }
}

fn clearance(recording: &Recording, found: &[Extreme], tolerance: f64) -> AnswerLine {
    let least = found.iter().find(|extreme| extreme.name == "smallest_clearance");
    let touch = FirstContact::new(recording, tolerance);
    let (value, meaning) = match least {
        Some(extreme) if extreme.value.abs() < touch.limit => {
            let first = touch.time.unwrap_or(extreme.time);
            let how = if touch.has_force { "in contact" } else { "tips reach the casing without a contact force" };
            // In closed contact, the clearance is a rounding error, or an error of the adaptive steps.
            let is_rounding = extreme.value.abs() < ROUNDING;
            let [length, tolerance] = [extreme.value.abs(), tolerance].map(six_digits);
            let deviation = if extreme.value < 0.0 {
                format!("tips overlap the casing by up to {length} m")
            } else {
                format!("tips come within {length} m of the casing")
            };
            let allowed = if is_rounding {
                String::new()
            } else {
                format!(" ({deviation}, less than the tolerance of the adaptive steps, {tolerance} m)")
            };
            (Some((0.0, "m")), format!("{how}, first at t = {} s{allowed}", six_digits(first)))
        }
        Some(extreme) => {
            let penetrates =
                if extreme.value < 0.0 { "; it is negative, because tips penetrate the casing" } else { "" };
            (Some((extreme.value, "m")), format!("smallest, {}{penetrates}", at(extreme)))
        }
        None => (None, "some contact nodes face no surface; use --all to list the clearance of each node".to_owned()),
    };
    AnswerLine { name: "clearance", value, meaning }
}

/// Largest rounding error of a clearance in closed contact (m).
const ROUNDING: f64 = 1e-12;

/// First contact of a run.
struct FirstContact {
    /// False if the run has no contact force.
    has_force: bool,
    /// Clearance (m) below which tips are in contact: the tolerance of the steps, or rounding in a run without contact forces.
    limit: f64,
    /// Time of the first contact (s).
    time: Option<f64>,
}

impl FirstContact {
    fn new(recording: &Recording, tolerance: f64) -> Self {
        let impulses = recording.column("normal_impulse");
        let has_force = impulses.as_ref().is_none_or(|impulses| impulses.iter().any(|impulse| *impulse != 0.0));
        let limit = if has_force { tolerance } else { ROUNDING };
        let closed = |clearances: Vec<f64>| clearances.into_iter().map(|clearance| clearance < limit).collect();
        let touches: Vec<bool> = match impulses.filter(|_| has_force) {
            Some(impulses) => impulses.into_iter().map(|impulse| impulse != 0.0).collect(),
            None => recording.column("clearance_minimum").map_or_else(Vec::new, closed),
        };
        let time = touches.iter().zip(&recording.times).find(|(touches, _)| **touches).map(|(_, time)| *time);
        Self { has_force, limit, time }
    }
}

/// Returns the largest vibration energy of the last third of the run relative to that of the middle third.
fn growth(recording: &Recording) -> AnswerLine {
    let energies = recording.column("kinetic_energy").zip(recording.column("strain_energy"));
    let ratio = energies.and_then(|(kinetic, strain)| {
        let energy: Vec<f64> = kinetic.iter().zip(&strain).map(|(kinetic, strain)| kinetic + strain).collect();
        let third = energy.len() / 3;
        let most = |part: &[f64]| part.iter().copied().fold(0.0, f64::max);
        let (before, last) = (most(energy.get(third..2 * third)?), most(energy.get(2 * third..)?));
        (third > 0).then_some((before, last))
    });
    let (value, meaning) = match ratio {
        Some((before, last)) if before > 0.0 => {
            let meaning = format!(
                "largest vibration energy in the last third of the run ({} J) divided by that in the middle third",
                six_digits(last)
            );
            (Some((last / before, "")), meaning)
        }
        Some(_) => (None, "there is no vibration before the last third of the run".to_owned()),
        None => (None, "requires `outputs.energies = true` and at least three communication steps".to_owned()),
    };
    AnswerLine { name: "growth", value, meaning }
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
    fn run_summary_has_five_lines_with_six_digits() {
        let names =
            ["normal_impulse", "friction_loss", "torque", "clearance_minimum", "kinetic_energy", "strain_energy"];
        let rows: [&[f64]; 7] = [
            &[0.0, 0.0, 0.0, 1e-3, 0.0, 0.0],
            &[0.0, 1.0, -1.0, 1e-4, 1.0, 1.0],
            &[4.0, 2.0, -2.0, -3e-16, 2.0, 1.0],
            &[1.0, 3.0, -3.0, 1e-4, 1.0, 0.0],
            &[1.0, 4.0, -4.0, 1e-4, 3.0, 3.0],
            &[1.0, 5.0, -5.0, 1e-4, 1.0, 1.0],
            &[1.0, 1234.5678, -6.0, 1e-4, 1.0, 1.0],
        ];
        let lines = lines(&recording(&names, &rows), 0.0);
        let text = text(&lines);
        let values: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().take(2).collect()).collect();
        // 4 N·s in 0.5 s; the mean of −1 to −6 N m; (3 + 3)/(2 + 1) J.
        let expected = [["force", "8"], ["heat", "1234.57"], ["torque", "-3.5"], ["clearance", "0"], ["growth", "2"]];
        assert_eq!(values, expected, "{text}");
        assert!(text.contains("largest") && text.contains("in contact, first at t = 1 s"), "{text}");
        assert_eq!(json(&lines)["growth"], json!(2.0));
    }

    #[test]
    fn clearance_within_the_tolerance_counts_as_contact() {
        let at = |clearance: f64| {
            let rows: [&[f64]; 3] = [&[1e-4], &[clearance], &[1e-4]];
            text(&lines(&recording(&["clearance_minimum"], &rows), 1e-7))
        };
        for (clearance, words) in
            [(-6e-9, "overlap the casing by up to 6e-9 m"), (6e-9, "come within 6e-9 m of the casing")]
        {
            let text = at(clearance);
            assert!(
                text.contains(&format!("{words}, less than the tolerance of the adaptive steps, 1e-7 m")),
                "{text}"
            );
            assert!(text.contains("clearance  0 m") && text.contains("in contact, first at t = 0.5 s"), "{text}");
        }
        let penetration = at(-6e-7);
        assert!(penetration.contains("-6e-7 m") && penetration.contains("tips penetrate the casing"), "{penetration}");
        assert!(!penetration.contains("in contact"), "{penetration}");
        let rows: [&[f64]; 3] = [&[1e-4, 0.0], &[0.0, 0.0], &[1e-4, 0.0]];
        let grazing = text(&lines(&recording(&["clearance_minimum", "normal_impulse"], &rows), 1e-7));
        assert!(grazing.contains("without a contact force") && !grazing.contains("in contact"), "{grazing}");
        // Without a contact force, tips that come closer than the tolerance do not touch.
        let rows: [&[f64]; 3] = [&[1e-4, 0.0], &[6e-9, 0.0], &[1e-4, 0.0]];
        let missed = text(&lines(&recording(&["clearance_minimum", "normal_impulse"], &rows), 1e-7));
        assert!(missed.contains("clearance  6e-9 m") && missed.contains("smallest, at t = 0.5 s"), "{missed}");
        let rows: [&[f64]; 3] = [&[6e-9, 0.0], &[6e-9, 2.0], &[1e-4, 0.0]];
        let late = text(&lines(&recording(&["clearance_minimum", "normal_impulse"], &rows), 1e-7));
        assert!(late.contains("in contact, first at t = 0.5 s"), "{late}");
    }

    #[test]
    fn missing_results_show_a_dash_and_reason() {
        let lines = lines(&recording(&["front.torque", "rear.torque"], &[&[0.0, 0.0], &[1.0, -3.0]]), 0.0);
        let text = text(&lines);
        assert!(text.contains("heat       -                no contact"), "{text}");
        assert!(text.contains("torque     -2 N m") && text.contains("front.torque 1, rear.torque -3"), "{text}");
        assert_eq!(json(&lines)["heat"], Value::Null);
        assert_eq!(six_digits(-0.0), "0");
    }
}
