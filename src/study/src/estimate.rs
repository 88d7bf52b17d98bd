//! Estimates the discretisation errors of steps, modes, patches along the chord and rows of patches across the thickness from coarser runs: only a
//! scene is needed, no mesh and no reference. The mesh error comes from the ROM, if it has been determined (`tiprub study convergence --into`).
//!
//! Each direction has three levels, each about twice as fine as the one before, with the scene's own as the finest; c₁ and c₂ are the changes
//! between them. If they decrease as a power, the remaining error is c₂/(r − 1) with r = c₁/c₂, limited to the ratios that later levels can have. If
//! they hardly decrease, the error is unknown. Longer steps may be rejected: then shorter ones are tried, and the error is c₁ + c₂/(r − 1).

mod step_bound;

use serde_json::{Value, json};
use tiprub_core::scene::rom::RubErrors;
use tiprub_core::{Rom, Scene};
use tiprub_cosim::shown;
use tiprub_shell::{Result, console::Console};

use crate::convergence::{
    Refined, Runner,
    coarsen::{coarsened, fewer_rows},
    refine::{OF_CLEARANCE, RefinementDirection, RefinementLevel, SECONDS, is_adaptive, with_division},
    truncate::{Truncation, truncated},
};
use crate::error::user_scene::own_division;

pub use step_bound::time_in_use;
use step_bound::{RUBS, step_bound, with_time_in_use};

/// Smallest ratio of two changes of the displacements from which the error is estimated.
const SHRINKING: f64 = 1.3;
/// Smallest and largest ratio of later changes. Steps converge with first order through contact, whatever long steps suggest: all further changes
/// together are as large as the last. Modes converge at least with first order, patches with nearly second order, since their hat functions follow a
/// smooth pressure.
const LATER: [(&str, [f64; 2]); 4] = [
    ("steps", [2.0, 2.0]),
    ("modes", [2.0, f64::INFINITY]),
    ("patches", [3.0, f64::INFINITY]),
    ("rows", [3.0, f64::INFINITY]),
];
/// Descriptions of directions whose names are not clear.
const WORDS: [(&str, &str); 2] =
    [("patches", "patches along the chord"), ("rows", "rows of patches across the thickness")];

/// Source of an estimated error.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ErrorSource {
    /// This run, compared with coarser runs of its scene.
    Run,
    /// Rubs of other scenes with the same tolerance; the error is the largest of these rubs.
    Rubs,
    /// The rub with this description, whose errors the ROM carries.
    Rom(String),
}

/// Estimated error of one direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// `steps`, `modes`, `patches`, `rows` or `mesh`.
    pub direction: &'static str,
    /// Error of the displacements (relative L2), or the reason why it is unknown. Impulse and work are too often close to the limit by chance to be
    /// estimated.
    pub left: std::result::Result<f64, String>,
    /// Source of the error.
    pub source: ErrorSource,
}

impl Estimate {
    fn unknown(direction: &'static str, why: impl Into<String>) -> Self {
        Self { direction, left: Err(why.into()), source: ErrorSource::Run }
    }

    /// Returns the error of the steps of `scene` as measured in other rubs. `set` contains the start values that are not applied to `scene`.
    fn of_measured_steps(scene: &Scene, set: &[(String, String)]) -> Self {
        Self { direction: "steps", left: step_bound(scene, set), source: ErrorSource::Rubs }
    }

    /// Replaces an unknown error of the model by the error that the ROM carries.
    fn or_of(self, rom: &Rom) -> Self {
        let Some(errors) = rom.checks.rub_errors.as_ref().filter(|_| self.left.is_err()) else { return self };
        let known = match self.direction {
            "modes" => errors.modes,
            "patches" => errors.patches,
            "rows" => errors.rows,
            "mesh" => errors.mesh,
            _ => None,
        };
        match known {
            Some(left) => Self { left: Ok(left), source: ErrorSource::Rom(errors.found_on.clone()), ..self },
            None => self,
        }
    }

    /// Estimates the error of a direction that was run, with the scene's own level first or last.
    fn of(direction: &'static str, refined: &Refined) -> Self {
        if let Some(why) = refined.runs.iter().find_map(|run| run.as_ref().err()) {
            return Self::unknown(direction, format!("a run with another setting was rejected: {why}"));
        }
        let changes = refined.changes();
        let [.., before, last] = &changes[..] else {
            return Self::unknown(direction, "there are too few other levels");
        };
        let bounds = LATER.iter().find(|(name, _)| *name == direction).map_or(LATER[0].1, |(_, bounds)| *bounds);
        let left = before[0].zip(last[0]).and_then(|(before, last)| Some((before, last, ratio(before, last, bounds)?)));
        let Some((before, last, ratio)) = left else {
            return Self::unknown(direction, "the changes in the displacements do not shrink from level to level");
        };
        let own_first = refined.direction.levels.first().is_some_and(|level| level.own);
        let left = last / (ratio - 1.0) + if own_first { before } else { 0.0 };
        Self { direction, left: Ok(left), source: ErrorSource::Run }
    }

    /// Returns the name and the value, or the reason why it is unknown.
    pub fn json(&self) -> (String, Value) {
        let value = match &self.left {
            Ok(left) => json!({ "displacements": left, "found_on": self.found_on() }),
            Err(why) => json!({ "unknown": why }),
        };
        (self.direction.to_owned(), value)
    }

    /// Returns the description of the rubs on which the error was found, unless it was this one.
    fn found_on(&self) -> Option<&str> {
        match &self.source {
            ErrorSource::Run => None,
            ErrorSource::Rubs => Some(RUBS),
            ErrorSource::Rom(found_on) => Some(found_on),
        }
    }

    fn direction_text(&self) -> &'static str {
        WORDS.iter().find(|(name, _)| *name == self.direction).map_or(self.direction, |(_, words)| words)
    }

    /// Formats the error: "modes 1.2 %"; "mesh unknown".
    pub fn text(&self) -> String {
        match (&self.left, &self.source) {
            (Ok(left), ErrorSource::Rubs) => {
                format!("{} up to about {} % ({RUBS})", self.direction_text(), shown(100.0 * left))
            }
            (Ok(left), _) => format!("{} {:.2} %", self.direction_text(), 100.0 * left),
            (Err(_), _) => format!("{} unknown", self.direction_text()),
        }
    }
}

/// Returns the ratio by which changes decrease between levels, within bounds; `None` if they hardly decrease.
fn ratio(before: f64, last: f64, [least, most]: [f64; 2]) -> Option<f64> {
    if before <= 0.0 || last <= 0.0 {
        return (before <= 0.0 && last <= 0.0).then_some(least);
    }
    (before >= SHRINKING * last).then(|| (before / last).clamp(least, most))
}

/// Returns one line with the errors of modes, patches and mesh that a ROM carries; `None` if it has none.
pub fn rom_errors_text(estimates: &[Estimate]) -> Option<String> {
    let of_model: Vec<Estimate> = estimates.iter().filter(|one| one.direction != "steps").cloned().collect();
    (!of_model.is_empty()).then(|| errors_text(&of_model))
}

/// Returns names and values as JSON.
pub fn json_of(estimates: &[Estimate]) -> Value {
    estimates.iter().map(Estimate::json).collect::<serde_json::Map<_, _>>().into()
}

/// Returns one line for reports: errors of this run, then those that the ROM carries from another run.
pub fn errors_text(estimates: &[Estimate]) -> String {
    let list = |of_rom: bool| {
        let chosen = estimates.iter().filter(|one| matches!(one.source, ErrorSource::Rom(_)) == of_rom);
        chosen.map(Estimate::text).collect::<Vec<_>>().join(", ")
    };
    let found_on = estimates.iter().find_map(|one| match &one.source {
        ErrorSource::Rom(found_on) => Some(found_on),
        _ => None,
    });
    let of_rom = found_on.map(|found_on| {
        let found_on = if found_on.is_empty() { "an unnamed rub" } else { found_on };
        format!("from the ROM, for {found_on}: {}", list(true))
    });
    let parts: Vec<String> = [Some(list(false)).filter(|own| !own.is_empty()), of_rom].into_iter().flatten().collect();
    format!("estimated error of the displacements: {}", parts.join("; "))
}

/// Returns the errors that a ROM carries; empty if it has none.
pub fn of_rom(rom: &Rom) -> Vec<Estimate> {
    if rom.checks.rub_errors.as_ref().is_none_or(RubErrors::is_empty) {
        return Vec::new();
    }
    let steps = Estimate::unknown("steps", "it depends on the run, not on the ROM: use `tiprub run --estimate`");
    std::iter::once(steps).chain(of_model(rom)).collect()
}

fn of_model(rom: &Rom) -> [Estimate; 4] {
    ["modes", "patches", "rows", "mesh"].map(|direction| {
        Estimate::unknown(direction, "not stored in the ROM: use `tiprub study convergence --into`").or_of(rom)
    })
}

/// Returns the errors of a run that are known without further runs: the error of the steps as measured in other rubs, and the errors that the ROM
/// contains. `settings` are replaced start values (name, value as text). The list is empty if no error is known.
pub fn without_runs(scene: &Scene, settings: &[(String, String)]) -> Vec<Estimate> {
    let (scene, others) = with_time_in_use(scene, settings);
    let steps = Estimate::of_measured_steps(&scene, &others);
    let model = of_model(&scene.roms[crate::master(&scene)]);
    let all: Vec<Estimate> = std::iter::once(steps).chain(model).collect();
    if all.iter().any(|estimate| estimate.left.is_ok()) { all } else { Vec::new() }
}

fn direction(title: &str, unit: &'static str, levels: Vec<RefinementLevel>) -> RefinementDirection {
    RefinementDirection { name: "estimate", title: title.into(), unit, levels, missing: String::new(), shorter: None }
}

fn steps(scene: &Scene, own: u32, divisions: [u32; 3]) -> RefinementDirection {
    let interval = scene.settings.experiment.communication_step;
    let tolerant = is_adaptive(scene);
    let level = |division: u32| {
        let changed = if division == own { scene.clone() } else { with_division(scene, division) };
        let whole = if tolerant { 1.0 } else { interval };
        RefinementLevel { value: whole / f64::from(division), own: division == own, scene: changed, division }
    };
    let (title, unit) = if tolerant { ("tolerance", OF_CLEARANCE) } else { ("internal step", SECONDS) };
    direction(title, unit, divisions.map(level).into())
}

/// Estimates the error of the steps: from longer steps, or from shorter ones if longer ones are impossible or rejected. With adaptive steps: from
/// smaller tolerances, a decade apart, since errors follow the tolerance in steps.
fn of_steps(scene: &Scene, own: u32, runner: &Runner) -> Result<Estimate> {
    if is_adaptive(scene) {
        let decades = [1, 10, 100].map(|times| own.saturating_mul(times));
        return Ok(Estimate::of("steps", &runner.as_it_is(steps(scene, own, decades))?));
    }
    if own >= 4 {
        let coarser = runner.as_it_is(steps(scene, own, [own.div_ceil(4), own.div_ceil(2), own]))?;
        if coarser.runs.iter().all(std::result::Result::is_ok) {
            return Ok(Estimate::of("steps", &coarser));
        }
    }
    Ok(Estimate::of("steps", &runner.as_it_is(steps(scene, own, [own, 2 * own, 4 * own]))?))
}

/// Returns the direction with half and a quarter of the modes of the master.
fn modes(scene: &Scene, division: u32) -> std::result::Result<RefinementDirection, String> {
    let master = crate::master(scene);
    let rom = &scene.roms[master];
    let own = Truncation::of(rom).modes(rom);
    if own < 8 {
        return Err(format!("{own} modes are too few; at least 8 are needed"));
    }
    let mut levels = Vec::new();
    for modes in [own / 4, own / 2] {
        levels.push(with_rom(scene, master, modes, truncated(rom, modes)?, division));
    }
    levels.push(RefinementLevel { value: own as f64, own: true, scene: scene.clone(), division });
    Ok(direction("modes", "modes", levels))
}

fn patches(scene: &Scene, division: u32) -> std::result::Result<RefinementDirection, String> {
    let master = crate::master(scene);
    let along = |rom: &Rom| rom.contact_nodes.len() / rom.rows();
    let own = along(&scene.roms[master]);
    let half = coarsened(&scene.roms[master])?;
    let quarter = coarsened(&half)?;
    let levels = [quarter, half].map(|rom| with_rom(scene, master, along(&rom), rom, division));
    let mut levels = Vec::from(levels);
    levels.push(RefinementLevel { value: own as f64, own: true, scene: scene.clone(), division });
    Ok(direction("contact patches", "patches", levels))
}

/// Returns the direction with one and two of three rows across the thickness; fewer rows do not show the effect of more.
pub(crate) fn rows(scene: &Scene, division: u32) -> std::result::Result<RefinementDirection, String> {
    let master = crate::master(scene);
    let rom = &scene.roms[master];
    if rom.contact_nodes.iter().any(|patch| patch.area <= 0.0) {
        return Err("the ROM has contact nodes, which do not resolve the thickness of the tip".into());
    }
    let own = rom.rows();
    if own < 3 {
        return Err(format!(
            "the estimate needs three rows of patches, and the ROM has {own}: reduce it with --contact-rows 3, or use \
             `tiprub study convergence` if the ROM can be reduced again"
        ));
    }
    let mut levels = Vec::new();
    for fewer in [1, 2] {
        levels.push(with_rom(scene, master, fewer, fewer_rows(rom, fewer)?, division));
    }
    levels.push(RefinementLevel { value: own as f64, own: true, scene: scene.clone(), division });
    Ok(direction("rows of contact patches", "rows", levels))
}

fn with_rom(scene: &Scene, index: usize, value: usize, rom: Rom, division: u32) -> RefinementLevel {
    let mut scene = scene.clone();
    scene.roms[index] = rom;
    RefinementLevel { value: value as f64, own: false, scene, division }
}

/// Estimates the errors of a scene over a window of `samples` communication steps, with replaced start values (name, value as text); a scene alone
/// does not show the mesh error.
///
/// # Errors
/// Errors other than rejected coarser runs, which make an estimate unknown.
pub fn estimates(
    scene: &Scene,
    settings: &[(String, String)],
    samples: usize,
    console: &Console,
) -> Result<Vec<Estimate>> {
    if let Err(several) = crate::one_rotor(&scene.settings) {
        let why = several.to_string();
        return Ok(["steps", "modes", "patches", "rows", "mesh"]
            .map(|direction| Estimate::unknown(direction, why.as_str()))
            .into());
    }
    let (scene, settings) = &with_time_in_use(scene, settings);
    let runner = Runner::new(settings, samples, console);
    let division = own_division(scene);
    let steps = of_steps(scene, division, &runner)?;
    let measured = Estimate::of_measured_steps(scene, settings);
    let mut found = vec![if steps.left.is_err() && measured.left.is_ok() { measured } else { steps }];
    let own =
        [("modes", modes(scene, division)), ("patches", patches(scene, division)), ("rows", rows(scene, division))];
    for (name, direction) in own {
        found.push(match direction {
            Ok(direction) => Estimate::of(name, &runner.as_it_is(direction)?),
            Err(why) => Estimate::unknown(name, why),
        });
    }
    found.push(Estimate::unknown(
        "mesh",
        "it cannot be estimated from a single mesh: `tiprub study convergence SCENE --into ROM` determines it and \
         stores it in the ROM",
    ));
    let rom = &scene.roms[crate::master(scene)];
    Ok(found.into_iter().map(|estimate| estimate.or_of(rom)).collect())
}

#[cfg(test)]
mod tests {
    use tiprub_model::{
        Rotor37Options, reduce_rotor37,
        rotor37::{MeshCounts, TipContact},
    };

    use super::*;

    #[test]
    fn remaining_error_of_a_power_law_is_extrapolated() {
        // Values 1 + h^p at h = 4, 2, 1: the remaining error at 1 is 1.
        for order in [1.0, 2.0, 3.5_f64] {
            let value = |level: f64| level.powf(order);
            let (before, last) = (value(4.0) - value(2.0), value(2.0) - value(1.0));
            let left = last / (ratio(before, last, [2.0, 99.0]).unwrap() - 1.0);
            assert!((left - 1.0).abs() < 1e-12, "{order}: {left}");
        }
        assert_eq!([ratio(1.0, 0.9, [2.0; 2]), ratio(0.0, 1.0, [2.0; 2]), ratio(1.0, 0.0, [2.0; 2])], [None; 3]);
        assert_eq!(
            [ratio(0.0, 0.0, [3.0, 5.0]), ratio(1.5, 1.0, [3.0, 5.0]), ratio(9.0, 1.0, [3.0, 5.0])],
            [3.0, 3.0, 5.0].map(Some)
        );
    }

    #[test]
    fn error_line_lists_known_and_unknown_estimates() {
        let of = |direction, left| Estimate { direction, left: Ok(left), source: ErrorSource::Run };
        let all = [of("steps", 1.2e-3), Estimate::unknown("mesh", "no other")];
        assert_eq!(errors_text(&all), "estimated error of the displacements: steps 0.12 %, mesh unknown");
    }

    #[test]
    fn uses_error_estimates_stored_in_the_rom() {
        let mesh = MeshCounts { chord: 2, thickness: 1, span: 2 };
        let options = Rotor37Options { mesh, tip: TipContact::Nodes(2), modes: 2, ..Rotor37Options::paper() };
        let mut rom = reduce_rotor37(&options, &|_| {}).unwrap().rom;
        assert!(of_rom(&rom).is_empty());
        let found_on = "a light rub".to_owned();
        rom.checks.rub_errors =
            Some(RubErrors { found_on, modes: None, patches: Some(0.02), rows: None, mesh: Some(0.05) });
        let known = Estimate { direction: "patches", left: Ok(0.01), source: ErrorSource::Run };
        let all = [Estimate::unknown("modes", "refused"), known.clone(), Estimate::unknown("mesh", "no other")];
        let all = all.map(|estimate| estimate.or_of(&rom));
        assert_eq!(all[1], known, "what the run tells stays");
        let reported = errors_text(&all);
        assert!(
            reported
                .ends_with("modes unknown, patches along the chord 1.00 %; from the ROM, for a light rub: mesh 5.00 %"),
            "{reported}"
        );
        let reported = super::errors_text(&of_rom(&rom));
        assert!(
            reported.contains(
                "steps unknown, modes unknown, rows of patches across the thickness unknown; from the ROM, for a light \
                 rub: patches along the chord 2.00 %, mesh 5.00 %"
            ),
            "{reported}"
        );
        rom.checks.rub_errors = Some(RubErrors { rows: Some(0.28), ..RubErrors::default() });
        let reported = super::errors_text(&of_rom(&rom));
        assert!(
            reported.ends_with(
                "mesh unknown; from the ROM, for an unnamed rub: rows of patches across the thickness 28.00 %"
            ),
            "{reported}"
        );
        rom.checks.rub_errors = Some(RubErrors { found_on: "nothing".into(), ..RubErrors::default() });
        assert!(of_rom(&rom).is_empty());
    }
}
