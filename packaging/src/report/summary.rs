//! Main results in words and in five numbers: force, duration of contact, heat, wear, and growth of vibration.

use std::fmt::Write as _;

use tiprub_field::animation::HitBlade;
use tiprub_shell::extremes;

use super::input::ReportInput;
use super::numbers::{rounded, with_prefix};

/// Factor on the largest vibration energy up to which vibration counts as steady.
const STEADY: f64 = 1.1;

/// Times of contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ContactTime {
    /// End of the first communication step with contact (s).
    pub(super) first: f64,
    /// Total length of the communication steps with contact (s).
    pub(super) total: f64,
}

/// Main results as numbers; `None` if the scene does not have them.
pub(super) struct Summary {
    /// Largest total normal force (N) and the end of its communication step (s).
    force: Option<(f64, f64)>,
    contact: Option<ContactTime>,
    /// Friction heat (J), and the largest friction power (W) if the scene reports it.
    heat: Option<(f64, Option<f64>)>,
    /// Largest wear depth (m).
    wear: Option<f64>,
    has_coating: bool,
    /// Largest vibration energy of the last third relative to the middle third.
    growth: Option<f64>,
    /// Torque (N m), mean over the run.
    torque: Option<f64>,
    /// Length of the run (s).
    length: f64,
}

impl Summary {
    pub(super) fn new(input: &ReportInput<'_>) -> Self {
        let recording = &input.native.recording;
        let value = |name: &str| input.answer.iter().find(|line| line.name == name).and_then(|line| line.value);
        let extremes = extremes::extremes(recording);
        let force = extremes.iter().find(|extreme| extreme.name == "largest_total_normal_force");
        let powers = recording.column("friction_power");
        let wear = input.capture.wear().iter().flat_map(|map| map.depth.iter().flatten()).copied().reduce(f64::max);
        let wear = wear.or_else(|| recording.last("wear_depth_maximum"));
        Self {
            force: force.map(|extreme| (extreme.value, extreme.time)),
            contact: contact_time(recording),
            heat: value("heat").map(|(heat, _)| (heat, powers.and_then(|powers| powers.into_iter().reduce(f64::max)))),
            wear,
            has_coating: input.scene.settings.contacts.iter().any(|contact| contact.coating.is_some()),
            growth: value("growth").map(|(growth, _)| growth),
            torque: value("torque").map(|(torque, _)| torque),
            length: input.schedule.stop - input.schedule.start,
        }
    }

    /// Returns the five numbers as HTML.
    pub(super) fn cards(&self) -> String {
        let missing = |reason: &str| ("–".to_owned(), reason.to_owned());
        let hard = match self.force {
            Some((0.0, _)) => ("0 N".to_owned(), "no contact occurred".to_owned()),
            Some((force, time)) => {
                let note = format!("largest normal force of all contacts, at {}", with_prefix(time, "s"));
                (with_prefix(force, "N"), note)
            }
            None => missing("the scene has no output of the total contact force"),
        };
        let long = match self.contact {
            Some(contact) if contact.total > 0.0 => {
                let note = format!("contact during {} % of the run", rounded(100.0 * contact.total / self.length));
                (with_prefix(contact.total, "s"), note)
            }
            Some(_) => ("0 s".to_owned(), "no contact occurred".to_owned()),
            None => missing("the scene has no output of the total contact force"),
        };
        let hot = match self.heat {
            Some((heat, power)) => {
                let mean = format!("friction heat; {} on average", with_prefix(heat / self.length, "W"));
                let most = power.map_or(String::new(), |power| format!(", {} at most", with_prefix(power, "W")));
                (with_prefix(heat, "J"), mean + &most)
            }
            None => missing("no contact has friction"),
        };
        let worn = match self.wear {
            Some(depth) => (with_prefix(depth, "m"), "largest wear depth of the coating".to_owned()),
            None if self.has_coating => missing("the scene does not report wear"),
            None => ("none".to_owned(), "the casing has no coating".to_owned()),
        };
        let grows = match self.growth {
            Some(growth) => {
                let word = if growth > STEADY { "yes" } else { "no" };
                let note = "largest vibration energy of the last third of the run, divided by that of the middle third";
                (format!("{word}, ×{}", rounded(growth)), note.to_owned())
            }
            None => missing("the run reports no vibration energy before its last third"),
        };
        let titles = ["How hard?", "How long?", "How hot?", "How much wear?", "Does it grow?"];
        let mut html = String::from("<dl class=\"cards five\">");
        for (title, (value, note)) in titles.into_iter().zip([hard, long, hot, worn, grows]) {
            let _ = write!(html, "<div><dt>{title}</dt><dd><b>{value}</b><small>{note}</small></dd></div>");
        }
        html + "</dl>"
    }

    /// Returns the main results in words as HTML.
    pub(super) fn words(&self, input: &ReportInput<'_>, blade: Option<&HitBlade>) -> String {
        let has_rotor = input.rotors().next().is_some();
        let [tips, touch] = if has_rotor { ["The blades", "touch the casing"] } else { ["The bodies", "touch"] };
        let Some(contact) = self.contact.filter(|contact| contact.total > 0.0) else {
            let what = if has_rotor { "No blade touches the casing" } else { "No body touches another" };
            return format!("<p class=\"answer\">{what} in {}.</p>", with_prefix(self.length, "s"));
        };
        let mut text = format!(
            "{tips} {touch} for the first time after {} and are in contact during {} of {}.",
            with_prefix(contact.first - input.schedule.start, "s"),
            with_prefix(contact.total, "s"),
            with_prefix(self.length, "s")
        );
        if let Some(blade) = blade.filter(|blade| blade.force > 0.0 && blade.sectors > 1) {
            let name = input.blade_name(blade).replacen("blade", "Blade", 1);
            let [force, time] = [(blade.force, "N"), (blade.time, "s")].map(|(value, unit)| with_prefix(value, unit));
            let _ = write!(text, " {name} is hit hardest, with {force} at {time}.");
        }
        if let Some((heat, _)) = self.heat {
            let _ = write!(text, " Friction turns {} into heat", with_prefix(heat, "J"));
            if let Some(torque) = self.torque.filter(|torque| *torque != 0.0) {
                let _ = write!(text, ", and the contact torque is {} on average", with_prefix(torque, "N\u{a0}m"));
            }
            text.push('.');
        }
        if let Some(depth) = self.wear.filter(|depth| *depth > 0.0) {
            let _ = write!(text, " The coating is worn by up to {}.", with_prefix(depth, "m"));
        }
        match self.growth {
            Some(growth) if growth > STEADY => {
                text.push_str(" Vibration is stronger in the last third of the run than in the middle third.")
            }
            Some(growth) if growth < 1.0 / STEADY => {
                text.push_str(" Vibration is weaker in the last third of the run than in the middle third.")
            }
            Some(_) => text.push_str(" Vibration is as strong in the last third of the run as in the middle third."),
            None => {}
        }
        format!("<p class=\"answer\">{text}</p>")
    }
}

/// Finds the communication steps with contact; `None` if the scene does not report it.
fn contact_time(recording: &tiprub_shell::recording::Recording) -> Option<ContactTime> {
    let impulses = recording.column("normal_impulse")?;
    let steps = recording.times.windows(2).zip(&impulses[1.min(impulses.len())..]);
    let touching: Vec<(f64, f64)> =
        steps.filter(|(_, impulse)| **impulse != 0.0).map(|(ends, _)| (ends[1], ends[1] - ends[0])).collect();
    let first = touching.first().map_or(0.0, |step| step.0);
    Some(ContactTime { first, total: touching.iter().fold(0.0, |sum, step| sum + step.1) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contact_time_counts_steps_with_an_impulse() {
        let recording = tiprub_shell::recording::Recording {
            names: vec!["normal_impulse".into()],
            times: vec![0.0, 1.0, 2.0, 3.0, 3.5],
            values: vec![0.0, 0.0, 2.0, 0.0, 1.0],
        };
        let found = contact_time(&recording).unwrap();
        assert_eq!(found, ContactTime { first: 2.0, total: 1.5 });
        let free = tiprub_shell::recording::Recording { values: vec![0.0; 5], ..recording };
        assert_eq!(contact_time(&free).unwrap().total.to_bits(), 0.0_f64.to_bits());
    }
}
