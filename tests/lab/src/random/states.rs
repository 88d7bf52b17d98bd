//! Saved states at random points, restored in the same and in other instances; derivatives over steps, which must have
//! no side effects.

use tiprub_core::{CoSimulation, Simulation};
use tiprub_test_models::SeededRandom;

use super::march::{OutputRecord, RandomPlan};
use super::oracles::Finding;
use super::scenes::{RandomScene, numbers};
use super::structures::chance;

/// Start time of an instance that begins later than any saved state (s).
pub(crate) const LATER: f64 = 7.5;

/// Returns the findings of the oracle of saved states, for a scene with the native `record`.
pub(crate) fn restored(trial: &RandomScene, plan: &RandomPlan, record: &OutputRecord) -> Vec<Finding> {
    let mut random = numbers(trial.seed, 2);
    if record.points.is_empty() {
        return Vec::new();
    }
    let found = saved_between(trial, plan, record, &mut random)
        .into_iter()
        .chain(saved_within(trial, plan, record, &mut random))
        .chain(after_reset(trial, plan, record, &mut random));
    found.map(|text| Finding { oracle: "states", text }).collect()
}

fn started(trial: &RandomScene, time: f64) -> Result<Simulation, String> {
    let mut simulation = Simulation::new(&trial.scene).map_err(|error| error.to_string())?;
    simulation.initialise(time).map_err(|error| error.to_string())?;
    Ok(simulation)
}

fn save(simulation: &Simulation) -> Vec<u8> {
    let mut state = vec![0; simulation.state_size()];
    simulation.save_state(&mut state).unwrap_or_else(|error| panic!("{error}"));
    state
}

/// Continues from a state and compares.
fn go_on(
    name: &str,
    simulation: &mut Simulation,
    state: &[u8],
    at: usize,
    (plan, record): (&RandomPlan, &OutputRecord),
) -> Option<String> {
    if let Err(error) = simulation.restore_state(state) {
        return Some(format!("{name} rejects the state of communication point {at}: {error}"));
    }
    let after = plan.march(simulation, at, |_, _| ());
    let off = after.differs(&record.from(at), plan, at)?;
    Some(format!("state of communication point {at} restored into {name}: {off}"))
}

/// Checks at a communication point that saving has no side effects, and that the state leads to the same bits in this
/// and in other instances.
fn saved_between(
    trial: &RandomScene,
    plan: &RandomPlan,
    record: &OutputRecord,
    random: &mut SeededRandom,
) -> Option<String> {
    let at = random.below(record.points.len() + 1);
    let mut simulation = started(trial, 0.0).ok()?;
    for index in 0..at {
        plan.step(&mut simulation, index).ok()?;
    }
    let state = save(&simulation);
    let after = plan.march(&mut simulation, at, |_, _| ());
    if let Some(off) = after.differs(&record.from(at), plan, at) {
        return Some(format!("saving the state at communication point {at} changes the run: {off}"));
    }
    let both = (plan, record);
    let (name, other) = match random.below(4) {
        0 => ("the same instance", Ok(simulation)),
        1 => ("an instance that was not initialised", Simulation::new(&trial.scene).map_err(|error| error.to_string())),
        2 => ("a fresh instance", started(trial, 0.0)),
        _ => ("an instance that started later", started(trial, LATER)),
    };
    // With future ramps, a scene may not start later.
    go_on(name, &mut other.ok()?, &state, at, both)
}

/// Checks within a communication step, between two internal steps.
fn saved_within(
    trial: &RandomScene,
    plan: &RandomPlan,
    record: &OutputRecord,
    random: &mut SeededRandom,
) -> Option<String> {
    let at = random.below(record.points.len());
    let mut simulation = started(trial, 0.0).ok()?;
    for index in 0..at {
        plan.step(&mut simulation, index).ok()?;
    }
    plan.set_inputs(&mut simulation, at).ok()?;
    simulation.begin_step(plan.times[at], plan.length(at)).ok()?;
    simulation.fly_ahead();
    let before = random.below(6);
    for _ in 0..before {
        if simulation.advance().ok()?.finished {
            return None;
        }
    }
    let state = save(&simulation);
    let mut fresh = started(trial, 0.0).ok()?;
    if let Err(error) = fresh.restore_state(&state) {
        return Some(format!("the state within communication step {} is rejected: {error}", at + 1));
    }
    for (name, instance) in [("the same", &mut simulation), ("a fresh", &mut fresh)] {
        while !instance.advance().ok()?.finished {}
        let after = super::march::SteppedInstance::bits(instance, &plan.outputs);
        let expected = &record.points[at];
        if let Some(place) = after.iter().zip(expected).position(|(own, other)| own != other) {
            let [own, other] = [after[place], expected[place]].map(f64::from_bits);
            return Some(format!(
                "{name} instance, continued after {before} internal steps of communication step {}, gives {own:e} for \
                 output {}, not {other:e}",
                at + 1,
                plan.outputs[place]
            ));
        }
    }
    None
}

/// Checks the run after a reset at a random point.
fn after_reset(
    trial: &RandomScene,
    plan: &RandomPlan,
    record: &OutputRecord,
    random: &mut SeededRandom,
) -> Option<String> {
    if !chance(random, 0.3) {
        return None;
    }
    let at = random.below(record.points.len());
    let mut simulation = started(trial, 0.0).ok()?;
    for index in 0..at {
        plan.step(&mut simulation, index).ok()?;
    }
    simulation.reset();
    if let Err(error) = simulation.initialise(0.0) {
        return Some(format!("initialisation after a reset is rejected: {error}"));
    }
    let again = plan.march(&mut simulation, 0, |_, _| ());
    let off = again.differs(record, plan, 0)?;
    Some(format!("after a reset at communication point {at}: {off}"))
}

/// Checks that derivatives over some steps have no side effects, compared with a run in which derivatives are allowed but not computed: if they
/// are allowed, adaptive steps end at communication points, which changes the last bits.
pub(crate) fn differentiated(trial: &RandomScene, plan: &RandomPlan) -> Option<Finding> {
    let mut random = numbers(trial.seed, 3);
    let inputs = plan.inputs();
    let begin = || {
        let mut simulation = Simulation::new(&trial.scene).ok()?;
        let parameter = simulation.table().find("step_derivatives")?.reference;
        simulation.set_integer(parameter, 2).ok()?;
        simulation.initialise(0.0).ok()?;
        Some(simulation)
    };
    let record = plan.march(&mut begin()?, 0, |_, _| ());
    let mut simulation = begin()?;
    let outputs: Vec<u32> = simulation
        .table()
        .variables()
        .iter()
        .filter(|row| plan.outputs.contains(&row.reference) && row.len() == 1)
        .filter(|row| row.variability == tiprub_cosim::variables::Variability::Continuous)
        .map(|row| row.reference)
        .take(5)
        .collect();
    let asked: Vec<usize> = (0..2).map(|_| random.below(plan.len())).collect();
    let mut refusal = None;
    let after = {
        let mut own = OutputRecord::default();
        for index in 0..plan.len() {
            match plan.step(&mut simulation, index) {
                Ok(point) => own.points.push(point),
                Err(end) => {
                    own.end = Some(end);
                    break;
                }
            }
            if asked.contains(&index) {
                let seed: Vec<f64> = inputs.iter().map(|_| random.signed()).collect();
                let mut found = vec![0.0; outputs.len()];
                match simulation.step_derivative(&outputs, &inputs, &seed, &mut found) {
                    Ok(()) if found.iter().all(|value| value.is_finite()) => {}
                    Ok(()) => refusal = Some(format!("the derivatives are not finite: {found:?}")),
                    Err(error) => refusal = super::oracles::names(&error).map(|finding| finding.text),
                }
            }
        }
        own
    };
    let text = refusal.or_else(|| {
        let off = after.differs(&record, plan, 0)?;
        Some(format!("computing derivatives over the steps {asked:?} changes the run: {off}"))
    })?;
    Some(Finding { oracle: "derivatives", text })
}
