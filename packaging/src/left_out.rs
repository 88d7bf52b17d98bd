//! Effects that a scene leaves out, their requirements, and their cost in this scene.

mod table;

use std::fmt::Write as _;

use serde_json::{Value, json};
use tiprub_core::scene::method::Scheme;
use tiprub_core::{CoSimulation, Error, Scene, Simulation};
use tiprub_cosim::Diagnostic;
use tiprub_shell::{
    native::{self, RunInputs},
    schedule::Schedule,
};

pub use table::{EFFECTS, Effect, RowGroup};

/// Number of communication steps whose time is measured.
const MEASURED_STEPS: usize = 100;

/// Cost that an effect adds to a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cost {
    /// Number of variables, as scalars.
    pub variables: i64,
    /// Bytes of the scene and models in the FMU.
    pub bytes: i64,
    /// Bytes of a saved state.
    pub state: i64,
    /// Time of a communication step relative to the scene without the effect, if it was measured.
    pub time: Option<f64>,
}

/// Effect that a scene leaves out.
pub struct LeftOut {
    /// The effect.
    pub effect: &'static Effect,
    /// Cost, or the reason why this scene cannot have the effect; `None` if keys alone are not enough.
    pub cost: Option<Result<Cost, FeatureRefusal>>,
}

/// Reason why a scene cannot have an effect.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FeatureRefusal {
    /// Rule that excludes it; for a scene with adaptive steps, also the rule that excludes it with fixed steps.
    pub reason: String,
    /// True if the rules permit it in the same scene with fixed steps, whose length is not checked.
    pub allowed_with_fixed_steps: bool,
}

/// Sizes of a scene.
struct SceneSizes {
    variables: i64,
    bytes: i64,
    state: i64,
    seconds: Option<f64>,
}

/// Returns all effects that a scene leaves out; with `measure`, the scene also runs with each effect to measure the time.
///
/// # Errors
/// The scene is rejected.
pub fn left_out(scene: &Scene, measure: bool) -> tiprub_core::Result<Vec<LeftOut>> {
    let own = sizes(scene, measure)?;
    let absent = EFFECTS.iter().filter(|effect| (effect.concerns)(scene) && !(effect.has)(scene));
    Ok(absent
        .map(|effect| LeftOut { effect, cost: effect.with.map(|with| cost(scene, with, &own, measure)) })
        .collect())
}

fn cost(scene: &Scene, with: fn(&mut Scene), own: &SceneSizes, measure: bool) -> Result<Cost, FeatureRefusal> {
    let mut other = scene.clone();
    with(&mut other);
    let found = sizes(&other, measure).map_err(|error| refusal(other, error))?;
    Ok(Cost {
        variables: found.variables - own.variables,
        bytes: found.bytes - own.bytes,
        state: found.state - own.state,
        time: found.seconds.zip(own.seconds).map(|(with, without)| with / without),
    })
}

/// Returns the reason why a scene is rejected. For a scene with adaptive steps, the rules are also checked with fixed steps.
fn refusal(mut scene: Scene, error: Error) -> FeatureRefusal {
    let mut reason = reason_of(error);
    let time = &mut scene.settings.time;
    if !time.scheme.properties().adaptive {
        return FeatureRefusal { reason, allowed_with_fixed_steps: false };
    }
    (time.scheme, time.tolerance) = (Scheme::default(), None);
    let with_fixed_steps = Simulation::new(&scene).map_err(reason_of);
    if let Some(other) = with_fixed_steps.as_ref().err().filter(|other| **other != reason) {
        let _ = write!(reason, ". With fixed steps, {other}");
    }
    FeatureRefusal { reason, allowed_with_fixed_steps: with_fixed_steps.is_ok() }
}

fn reason_of(error: Error) -> String {
    match error {
        Error::Invalid(Diagnostic { what, problem, .. }) => format!("{what}: {problem}"),
        other => other.to_string(),
    }
}

fn sizes(scene: &Scene, measure: bool) -> tiprub_core::Result<SceneSizes> {
    let count = |bytes: usize| i64::try_from(bytes).unwrap_or(i64::MAX);
    let mut simulation = Simulation::new(scene)?;
    simulation.initialise(scene.settings.experiment.start)?;
    let resources = tiprub_format::resource_files(scene, false);
    Ok(SceneSizes {
        variables: count(simulation.table().references()),
        bytes: count(resources.iter().map(|(_, bytes)| bytes.len()).sum()),
        state: count(simulation.state_size()),
        seconds: if measure { seconds(scene) } else { None },
    })
}

/// Returns the time of the first communication steps (s), the shorter of two runs.
fn seconds(scene: &Scene) -> Option<f64> {
    let mut schedule = Schedule::new(&scene.settings.experiment, None, None).ok()?;
    schedule.count = schedule.count.min(MEASURED_STEPS);
    let run = || Some(native::run(scene, &schedule, RunInputs::default(), &|_| {}).ok()?.stepping.as_secs_f64());
    Some(run()?.min(run()?))
}

/// Formats the list as text: the effects alone or, if `has_costs`, effects and features with their costs.
pub fn text(all: &[LeftOut], has_costs: bool) -> String {
    let mut text = String::new();
    let groups = [(RowGroup::Physics, "effects left out here"), (RowGroup::Machinery, "features that are off")];
    for (group, title) in groups.into_iter().take(if has_costs { 2 } else { 1 }) {
        let _ = writeln!(text, "\n{title:<53} how to include it");
        for LeftOut { effect, cost } in all.iter().filter(|one| one.effect.group == group) {
            let cost = if has_costs { cost_text(cost.as_ref()) } else { String::new() };
            let _ = writeln!(text, "  {:<51} {}{cost}", effect.name, effect.takes);
        }
    }
    text
}

fn cost_text(cost: Option<&Result<Cost, FeatureRefusal>>) -> String {
    match cost {
        None => String::new(),
        Some(Err(FeatureRefusal { reason, allowed_with_fixed_steps })) => {
            let what = if *allowed_with_fixed_steps {
                "needs fixed steps (`time.scheme = \"modal-exact\"` and `time.step`)"
            } else {
                "not supported by this scene"
            };
            format!("\n  {:<51} {what}: {reason}", "")
        }
        Some(Ok(Cost { variables, bytes, state, time })) => {
            let time = time.map_or(String::new(), |time| format!(", {time:.2} times the time per step"));
            // A feature can make the text of the scene a few bytes shorter, which is not a gain.
            let bytes = bytes.max(&0);
            format!("\n  {:<51} costs {variables:+} variables, {bytes:+} bytes, state {state:+} bytes{time}", "")
        }
    }
}

/// Returns the list as JSON.
pub fn json(all: &[LeftOut]) -> Value {
    let one = |LeftOut { effect, cost }: &LeftOut| {
        let group = if effect.group == RowGroup::Physics { "physics" } else { "machinery" };
        let cost = match cost {
            None => Value::Null,
            Some(Err(FeatureRefusal { reason, allowed_with_fixed_steps })) => {
                json!({ "refused": reason, "allowed_with_fixed_steps": allowed_with_fixed_steps })
            }
            Some(Ok(cost)) => json!({
                "variables": cost.variables, "bytes": cost.bytes, "state_bytes": cost.state, "time": cost.time,
            }),
        };
        json!({ "name": effect.name, "group": group, "takes": effect.takes, "cost": cost })
    };
    all.iter().map(one).collect()
}

/// Returns the table of the guide.
pub fn markdown() -> String {
    let mut text = String::new();
    for (group, title) in [(RowGroup::Physics, "effect"), (RowGroup::Machinery, "feature")] {
        let _ = write!(text, "\n| {title} | how to include it |\n|---|---|\n");
        for effect in EFFECTS.iter().filter(|effect| effect.group == group) {
            let _ = writeln!(text, "| {} | {} |", effect.name, effect.takes);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use tiprub_test_models::{blade, round, rub};

    /// The guide contains this table; `UPDATE_SNAPSHOTS=1` regenerates it.
    #[test]
    fn guide_contains_the_generated_table() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/left-out.md");
        let page = std::fs::read_to_string(path).unwrap();
        let [begin, end] = ["<!-- generated: left out -->\n", "<!-- end of generated part -->"];
        let (before, rest) = page.split_once(begin).unwrap();
        let (found, after) = rest.split_once(end).unwrap();
        if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
            std::fs::write(path, format!("{before}{begin}{}{end}{after}", markdown())).unwrap();
        } else {
            assert_eq!(found, markdown(), "run with UPDATE_SNAPSHOTS=1 to write the page anew");
        }
    }

    /// An effect that a key switches on is present afterwards; effects that the scene has are not listed.
    #[test]
    fn enabled_effects_are_detected_in_the_scene() {
        let scene = rub(4);
        for effect in EFFECTS {
            let Some(with) = effect.with.filter(|_| (effect.concerns)(&scene)) else { continue };
            let mut other = scene.clone();
            with(&mut other);
            assert!((effect.has)(&other), "{}", effect.name);
        }
        let names: BTreeSet<&str> = EFFECTS.iter().map(|effect| effect.name).collect();
        assert_eq!(names.len(), EFFECTS.len(), "every name once");
    }

    #[test]
    fn list_reports_cost_or_rejection_for_the_scene() {
        let scene = round(blade(4));
        let all = left_out(&scene, false).unwrap();
        let of = |name: &str| all.iter().find(|one| one.effect.name == name);
        // Two inputs for the displacement of the centre, two moments, and the work of the whirl.
        let whirl = of("whirl of the shaft").unwrap().cost.as_ref().unwrap().as_ref().unwrap();
        assert!(whirl.variables >= 4 && whirl.bytes > 0 && whirl.state > 0, "{whirl:?}");
        let spin = of("centrifugal stiffening").unwrap().cost.as_ref().unwrap().as_ref().unwrap_err();
        assert!(spin.reason.contains("spin"), "{spin:?}");
        assert!(of("energy balance").is_none() && of("temperature of the casing").is_none());
        let mut adaptive = round(tiprub_test_models::rich_blade(4));
        adaptive.settings.time.scheme = Scheme::Galerkin;
        let all_adaptive = left_out(&adaptive, false).unwrap();
        let refused = |name: &str| {
            let found = all_adaptive.iter().find(|one| one.effect.name == name).unwrap();
            found.cost.as_ref().unwrap().as_ref().unwrap_err()
        };
        let excitation = refused("excitation by engine orders");
        assert!(excitation.allowed_with_fixed_steps && excitation.reason.contains("galerkin"), "{excitation:?}");
        // The ROM has no spin matrices either.
        let spin = refused("centrifugal stiffening");
        assert!(!spin.allowed_with_fixed_steps && spin.reason.contains("With fixed steps, "), "{spin:?}");
        assert!(text(&all_adaptive, true).contains("needs fixed steps"));
        let [short, long] = [false, true].map(|has_costs| text(&all, has_costs));
        assert!(long.contains("features that are off") && long.contains(" costs +"), "{long}");
        assert!(!short.contains("features that are off") && !short.contains(" costs +"), "{short}");
        assert!(short.contains("left out here") && json(&all)[0]["name"].is_string());
    }
}
