//! Checks of the names in a plan, before its first run.

use tiprub_core::{CoSimulation, Simulation, VariableTable};
use tiprub_cosim::variables::Causality;
use tiprub_shell::{Failure, Result, native};

use super::PartRun;
use crate::{
    cases::Case,
    fields,
    plan::{Plan, PlanVariable, VariableTarget},
    result_file::check_variable_names,
};

/// Largest number of runs whose scenes are tried for the check of names, until one is accepted.
const MAX_TRIED_RUNS: usize = 8;
/// Keys of the scene whose value is the start value of a variable, each with the last part of the variable's name.
const REPLACED_FIELDS: [(&str, &str); 23] = [
    ("structure.speed", "speed"),
    ("structure.damping_ratio", "damping_ratio"),
    ("structure.damping_ratios", "damping_ratios"),
    ("structure.excitation.amplitude", "excitation_amplitude"),
    ("structure.excitation.order", "excitation_order"),
    ("structure.excitation.phase", "excitation_phase"),
    ("structure.initial.displacement", "initial_displacement"),
    ("structure.initial.velocity", "initial_velocity"),
    ("structure.load.amplitude", "casing_load_amplitude"),
    ("structure.load.order", "casing_load_order"),
    ("structure.load.phase", "casing_load_phase"),
    ("structure.velocity", "initial_velocity_x"),
    ("structure.velocity", "initial_velocity_y"),
    ("structure.velocity", "initial_velocity_z"),
    ("surface.ramp_time", "casing_ramp_time"),
    ("contact.friction", "friction_coefficient"),
    ("contact.solver", "solver"),
    ("contact.slave_heat_fraction", "casing_heat_fraction"),
    ("time.scheme", "scheme"),
    ("time.input_interpolation", "input_interpolation"),
    ("time.step", "internal_step_max"),
    ("time.tolerance", "tolerance"),
    ("time.max_internal_steps", "max_internal_steps"),
];

/// Returns the names of all start values of a plan.
fn start_values(plan: &Plan) -> impl Iterator<Item = &str> + Clone {
    let varied = plan.variables.iter().filter_map(|variable| match &variable.target {
        VariableTarget::StartValue(name) => Some(name.as_str()),
        _ => None,
    });
    plan.set.iter().map(|(name, _)| name.as_str()).chain(varied)
}

impl PartRun<'_> {
    /// Checks that all variables and outputs of the plan exist, in the first pending run whose scene is accepted, or without such a run in another
    /// one. If no scene is accepted, the reasons become rows.
    pub(super) fn check_names(&mut self) -> Result<()> {
        let plan = self.request.plan;
        let in_plan = |failure: Failure| {
            let mut failure = Failure { usage: true, ..failure };
            if let Some(name) = failure.diagnostic.what.strip_prefix("--set ") {
                failure.diagnostic.what = format!("variable `{name}`");
            }
            failure.at(plan.path.display())
        };
        let pending = self.pending.iter().copied().take(MAX_TRIED_RUNS);
        let others = (0..plan.design.runs()).take(MAX_TRIED_RUNS);
        for run in pending.chain(others).collect::<Vec<_>>() {
            self.load_models(run)?;
            let scene = self.case(run).and_then(|case| case.scene(&self.store));
            let compiled = scene.and_then(|scene| native::compiled(&scene, &plan.schedule(&scene.settings)?));
            let Ok(simulation) = compiled else { continue };
            let table = simulation.table();
            for name in start_values(plan) {
                native::check_settable(table, name).map_err(|failure| in_plan(suggest_label(plan, name, failure)))?;
            }
            check_rom_parts(plan, table).map_err(in_plan)?;
            native::check_set_once(start_values(plan)).map_err(in_plan)?;
            for output in plan.histories.iter().flat_map(|request| &request.outputs) {
                native::output_columns(table, output).map_err(in_plan)?;
            }
            let outputs = table.variables().iter().filter(|variable| variable.causality == Causality::Output);
            let results = native::result_names(table);
            check_variable_names(plan, outputs.map(|output| &output.name).chain(&results))?;
            self.check_replaced_fields(run, &simulation).map_err(in_plan)?;
            self.results = results;
            return Ok(());
        }
        Ok(())
    }

    /// Rejects a plan in which a start value replaces a field that also varies, because the values of this field would have no effect. `simulation`
    /// is that of the run.
    fn check_replaced_fields(&self, run: usize, simulation: &Simulation) -> Result<()> {
        let plan = self.request.plan;
        for (index, variable) in plan.variables.iter().enumerate() {
            let VariableTarget::Field(path) = &variable.target else { continue };
            let key = fields::key(path)?;
            for (_, end) in REPLACED_FIELDS.iter().filter(|(field, _)| *field == key) {
                let mut candidates = start_values(plan).filter(|name| array_name(name).ends_with(end));
                let Some(name) = candidates.find(|name| self.has_effect(run, index, array_name(name), simulation))
                else {
                    continue;
                };
                let problem = format!("sets `{path}`, which the start value `{name}` of the plan replaces");
                return Err(Failure::new(format!("variable `{}`", variable.name), problem, "Remove one of them"));
            }
        }
        Ok(())
    }

    /// Returns whether the start value `name` depends on the field of a variable (by index): whether it changes if the field has its value in the
    /// scene, or another value of the plan.
    fn has_effect(&self, run: usize, variable: usize, name: &str, simulation: &Simulation) -> bool {
        let plan = self.request.plan;
        let start_value = |simulation: &Simulation| {
            let all = native::start_values(simulation).unwrap_or_default();
            all.into_iter().find(|own| own.name == name).map(|own| own.value)
        };
        let own = start_value(simulation);
        let value = plan.design.value(run, variable);
        let next = (0..plan.design.runs()).map(|run| plan.design.value(run, variable)).find(|other| *other != value);
        [None].into_iter().chain(next.map(Some)).any(|other| {
            let scene = Case::with_field(plan, run, variable, other).and_then(|case| case.scene(&self.store));
            let changed = scene.and_then(|scene| native::compiled(&scene, &plan.schedule(&scene.settings)?));
            changed.is_ok_and(|changed| start_value(&changed) != own)
        })
    }
}

/// Adds a remedy to the error for an unknown name: a column of a table can be declared as a label.
fn suggest_label(plan: &Plan, name: &str, mut failure: Failure) -> Failure {
    if plan.is_table && !plan.set.iter().any(|(other, _)| other == name) {
        let how =
            format!("If the column only describes the runs, add [[variable]] with name = \"{name}\" and label = true");
        let end = if failure.remedy.ends_with('?') { "" } else { "." };
        failure.diagnostic.remedy = format!("{}{end} {how}", failure.remedy.trim_end_matches('.'));
    }
    failure
}

/// Rejects a variable in braces of `[rom]` that has the name of a start value but does not set it.
fn check_rom_parts(plan: &Plan, table: &VariableTable) -> Result<()> {
    let is_part = |variable: &&PlanVariable| variable.target == VariableTarget::RomPart;
    for PlanVariable { name, .. } in plan.variables.iter().filter(is_part) {
        if native::check_settable(table, name).is_ok() {
            let problem = "is in braces of [rom] and has the name of a start value, but would not set it";
            let remedy = "Give its `field` in the scene, which also fills the braces, or add label = true if it is only part of the ROM's name";
            return Err(Failure::new(format!("variable `{name}`"), problem, remedy));
        }
    }
    Ok(())
}

/// Returns the name of a variable without the index of an element.
fn array_name(name: &str) -> &str {
    match name.strip_suffix(']').and_then(|rest| rest.rsplit_once('[')) {
        Some((array, _)) => array,
        None => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_that_is_a_start_value_is_checked() {
        let mut keys = tiprub_format::FIELDS.iter().filter(|field| field.description.starts_with("Start value of"));
        let unknown = keys.find(|field| !REPLACED_FIELDS.iter().any(|(key, _)| *key == field.path));
        assert!(unknown.is_none(), "{unknown:?}");
    }
}
