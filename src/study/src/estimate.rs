//! What steps, modes and patches of a scene leave, estimated from coarser runs: a scene alone is needed, no mesh and no truth.
//!
//! Three levels of a direction, each about twice as fine as the one before, the scene's own the finest: changes c₁ and c₂ from level
//! to level. Where they shrink as a power, c₁/c₂ tells which, and c₂/(c₁/c₂ − 1) is what all further refinement would change. Where
//! they do not shrink, nothing is known. Longer steps may be refused: then shorter ones are tried, and c₁ + c₂/(c₁/c₂ − 1) is left.

use serde_json::{Map, Value, json};
use tiprub_core::Scene;
use tiprub_shell::{Result, console::Console};

use crate::convergence::{
    Refined, Runner,
    coarsen::coarsened,
    divisions,
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

    /// Of a direction that was run, its own level the first or the last.
    fn of(direction: &'static str, refined: &Refined) -> Self {
        if let Some(why) = refined.runs.iter().find_map(|run| run.as_ref().err()) {
            return Self::unknown(direction, format!("another run is refused: {why}"));
        }
        let changes = refined.changes();
        let [.., before, last] = &changes[..] else { return Self::unknown(direction, "there are no other levels") };
        let own_first = refined.direction.levels.first().is_some_and(|level| level.own);
        let left = |quantity: usize| {
            let (before, last): (f64, f64) = (before[quantity]?, last[quantity]?);
            Some(rest(before, last)? + if own_first { before } else { 0.0 })
        };
        Self { direction, left: std::array::from_fn(left), unknown: None }
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

fn direction(title: &str, unit: &'static str, levels: Vec<Level>) -> Direction {
    Direction { name: "estimate", title: title.into(), unit, levels, missing: String::new(), shorter: None }
}

fn steps(scene: &Scene, own: u32, divisions: [u32; 3]) -> Direction {
    let interval = scene.settings.experiment.communication_step;
    let level = |division: u32| {
        let mut scene = scene.clone();
        if division != own {
            scene.settings.time.step = interval / f64::from(division);
        }
        Level { value: interval / f64::from(division), own: division == own, scene, division }
    };
    direction("internal step", "s", divisions.map(level).into())
}

/// Of the steps: from longer ones, or from shorter ones where there are no longer ones, or they are refused.
fn of_steps(scene: &Scene, own: u32, runner: &Runner) -> Result<Estimate> {
    if own >= 4 {
        let coarser = runner.as_it_is(steps(scene, own, [own.div_ceil(4), own.div_ceil(2), own]))?;
        if coarser.runs.iter().all(std::result::Result::is_ok) {
            return Ok(Estimate::of("steps", &coarser));
        }
    }
    Ok(Estimate::of("steps", &runner.as_it_is(steps(scene, own, [own, 2 * own, 4 * own]))?))
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
    if let Err(several) = crate::one_rotor(&scene.settings) {
        let why = several.to_string();
        return Ok(["steps", "modes", "patches", "mesh"]
            .map(|direction| Estimate::unknown(direction, why.as_str()))
            .into());
    }
    let runner = Runner::new(settings, samples, console);
    let division = divisions(scene.settings.experiment.communication_step, scene.settings.time.step);
    let mut found = vec![of_steps(scene, division, &runner)?];
    for (name, direction) in [("modes", modes(scene, division)), ("patches", patches(scene, division))] {
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
