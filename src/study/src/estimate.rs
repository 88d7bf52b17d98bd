//! What steps, modes and patches of a scene leave, estimated from coarser runs: a scene alone is needed, no mesh and no truth.
//!
//! Three levels of a direction, each about twice as fine as the one before, the scene's own the finest: changes c₁ and c₂ from level
//! to level. Where they shrink as a power, c₁/c₂ tells which, and c₂/(c₁/c₂ − 1) is what all further refinement would change. Where
//! they do not shrink, nothing is known.

use serde_json::{Map, Value, json};
use tiprub_core::Scene;
use tiprub_shell::{Result, console::Console};

use crate::convergence::{
    Refined,
    coarsen::coarsened,
    refine::{Direction, Level},
    truncate::{Form, truncated},
};

/// Least ratio of two changes that lets the rest be estimated: a third and all further ones are then no larger than twice the last.
const SHRINKING: f64 = 1.5;

/// Quantities of an estimate.
pub const QUANTITIES: [&str; 3] = ["displacements", "impulse", "friction work"];

/// What one direction leaves, relative, in the order of [`QUANTITIES`]; `None` where it is not known, or nothing is there to compare.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// `steps`, `modes`, `patches` or `mesh`.
    pub direction: &'static str,
    /// Of each quantity.
    pub left: [Option<f64>; 3],
    /// Why nothing at all is known.
    pub unknown: Option<String>,
}

impl Estimate {
    fn unknown(direction: &'static str, why: impl Into<String>) -> Self {
        Self { direction, left: [None; 3], unknown: Some(why.into()) }
    }

    /// Of a direction that was run.
    pub(crate) fn of(direction: &'static str, refined: &Refined) -> Self {
        if let Some(why) = refined.runs.iter().find_map(|run| run.as_ref().err()) {
            return Self::unknown(direction, format!("a coarser run is refused: {why}"));
        }
        let changes = refined.changes();
        let [.., before, last] = &changes[..] else { return Self::unknown(direction, "there are no coarser levels") };
        Self {
            direction,
            left: std::array::from_fn(|quantity| rest(before[quantity]?, last[quantity]?)),
            unknown: None,
        }
    }

    /// Name and values, `null` where they are not known, and why.
    pub fn json(&self) -> (String, Value) {
        let mut values: Map<String, Value> =
            QUANTITIES.iter().zip(self.left).map(|(name, left)| (name.replace(' ', "_"), json!(left))).collect();
        if let Some(why) = &self.unknown {
            values.insert("unknown".into(), json!(why));
        }
        (self.direction.to_owned(), Value::Object(values))
    }

    /// "modes 1.2 %", by the displacements; "mesh unknown".
    pub fn told(&self) -> String {
        match self.left[0] {
            Some(left) => format!("{} {:.2} %", self.direction, 100.0 * left),
            None => format!("{} unknown", self.direction),
        }
    }
}

/// What all further refinement would change, from the last two changes.
fn rest(before: f64, last: f64) -> Option<f64> {
    if last == 0.0 {
        return (before == 0.0).then_some(0.0);
    }
    let ratio = before / last;
    (ratio >= SHRINKING).then(|| last / (ratio - 1.0))
}

/// One line for reports.
pub fn told(estimates: &[Estimate]) -> String {
    let all: Vec<String> = estimates.iter().map(Estimate::told).collect();
    format!("estimated error of the displacements: {}", all.join(", "))
}

/// Directions of a scene whose coarser levels follow from it, `division` internal steps per communication step; `Err` says why one
/// has none.
pub(crate) fn directions(scene: &Scene, division: u32) -> Vec<(&'static str, std::result::Result<Direction, String>)> {
    vec![("steps", steps(scene, division)), ("modes", modes(scene, division)), ("patches", patches(scene, division))]
}

fn direction(title: &str, unit: &'static str, levels: Vec<Level>) -> Direction {
    Direction { name: "estimate", title: title.into(), unit, levels, missing: String::new(), shorter: None }
}

fn steps(scene: &Scene, division: u32) -> std::result::Result<Direction, String> {
    let interval = scene.settings.experiment.communication_step;
    if division < 4 {
        return Err(format!("{division} internal steps per communication step have no half and no quarter"));
    }
    let level = |division: u32, own: bool| {
        let mut scene = scene.clone();
        if !own {
            scene.settings.time.step = interval / f64::from(division);
        }
        Level { value: interval / f64::from(division), own, scene, division }
    };
    let levels = vec![level(division.div_ceil(4), false), level(division.div_ceil(2), false), level(division, true)];
    Ok(direction("internal step", "s", levels))
}

/// Half and a quarter of the modes of the master.
fn modes(scene: &Scene, division: u32) -> std::result::Result<Direction, String> {
    let master = crate::master(scene);
    let rom = &scene.roms[master];
    let own = Form::of(rom).modes(rom);
    if own < 8 {
        return Err(format!("{own} modes have no half and no quarter"));
    }
    let mut levels = Vec::new();
    for modes in [own / 4, own / 2] {
        levels.push(with_rom(scene, master, modes, truncated(rom, modes)?, division));
    }
    levels.push(Level { value: own as f64, own: true, scene: scene.clone(), division });
    Ok(direction("modes", "modes", levels))
}

fn patches(scene: &Scene, division: u32) -> std::result::Result<Direction, String> {
    let master = crate::master(scene);
    let own = scene.roms[master].contact_nodes.len();
    let half = coarsened(&scene.roms[master])?;
    let quarter = coarsened(&half)?;
    let levels = [quarter, half].map(|rom| with_rom(scene, master, rom.contact_nodes.len(), rom, division));
    let mut levels = Vec::from(levels);
    levels.push(Level { value: own as f64, own: true, scene: scene.clone(), division });
    Ok(direction("contact patches", "patches", levels))
}

fn with_rom(scene: &Scene, index: usize, value: usize, rom: tiprub_core::Rom, division: u32) -> Level {
    let mut scene = scene.clone();
    scene.roms[index] = rom;
    Level { value: value as f64, own: false, scene, division }
}

/// Estimates of a scene over a window of `samples` communication steps, with start values replaced (name, value as text); the mesh is
/// not known from a scene.
///
/// # Errors
/// Never of coarser runs that are refused: these are estimates that are not known.
pub fn estimates(
    scene: &Scene,
    settings: &[(String, String)],
    samples: usize,
    console: &Console,
) -> Result<Vec<Estimate>> {
    let runner = crate::convergence::Runner::new(settings, samples, console);
    let division =
        crate::convergence::divisions(scene.settings.experiment.communication_step, scene.settings.time.step);
    let mut found = Vec::new();
    for (name, direction) in directions(scene, division) {
        found.push(match direction {
            Ok(direction) => Estimate::of(name, &runner.as_it_is(direction)?),
            Err(why) => Estimate::unknown(name, why),
        });
    }
    found.push(Estimate::unknown(
        "mesh",
        "a ROM does not tell of other meshes: compare two with `tiprub study convergence`",
    ));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_of_a_power_is_its_sum_and_of_none_unknown() {
        // Values 1 + h^p at h = 4, 2, 1: what is left at 1 is 1.
        for order in [1.0, 2.0, 3.5_f64] {
            let value = |level: f64| level.powf(order);
            let left = rest(value(4.0) - value(2.0), value(2.0) - value(1.0)).unwrap();
            assert!((left - 1.0).abs() < 1e-12, "{order}: {left}");
        }
        assert_eq!([rest(1.0, 0.9), rest(0.0, 1.0), rest(1.0, 0.0), rest(0.0, 0.0)], [None, None, None, Some(0.0)]);
    }

    #[test]
    fn a_line_tells_what_is_known() {
        let of = |direction, left| Estimate { direction, left: [left, None, None], unknown: None };
        let all = [of("steps", Some(1.2e-3)), Estimate::unknown("mesh", "no other")];
        assert_eq!(told(&all), "estimated error of the displacements: steps 0.12 %, mesh unknown");
    }
}
