//! Runs a scene without FMI, with the core, communication points and outputs of the FMU.

use std::collections::HashSet;
use std::time::{Duration, Instant};

use tiprub_core::system::Effort;
use tiprub_core::{CoSimulation, Scene, Simulation, VariableTable, Warning};
use tiprub_cosim::variables::{Causality, DataType, Span, Value, Variable};

use crate::{
    Failure, Result,
    history::{Driver, InputHistory},
    means,
    recording::Recording,
    schedule::Schedule,
};

/// Results of a native run.
#[derive(Debug, Clone)]
pub struct NativeRun {
    /// All outputs at all communication points.
    pub recording: Recording,
    /// Facts about the columns of the recording, in their order.
    pub columns: Vec<OutputColumn>,
    /// Inputs and parameters at the start, in the order of the table.
    pub parameters: Vec<UsedParameter>,
    /// Time spent stepping (not in initialisation or recording).
    pub stepping: Duration,
    /// Longest duration of one communication step.
    pub slowest: Duration,
    /// Number of internal steps; with adaptive steps, of all blades together.
    pub internal_steps: u64,
    /// Work of adaptive steps, if the run uses them.
    pub effort: Option<Effort>,
    /// Warnings of the initialisation, the run and the schedule.
    pub warnings: Vec<Warning>,
    /// Results of slow checks, for [`RunInputs::checks`] of the next run.
    pub checks: Vec<u8>,
}

/// Facts about one column of the recording of a native run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutputColumn {
    /// Relation of its values to the communication step.
    pub span: Span,
    /// True if the output is an energy (J).
    pub is_energy: bool,
    /// True if the column is one element of an array.
    pub is_element: bool,
}

/// Value of an input or a parameter with which a run starts.
#[derive(Debug, Clone, PartialEq)]
pub struct UsedParameter {
    /// Name, without the index of an element.
    pub name: String,
    /// Value.
    pub value: ParameterValue,
}

/// Value of an input or a parameter (SI units).
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterValue {
    /// Real number.
    Real(f64),
    /// Elements of an array of real numbers.
    Reals(Vec<f64>),
    /// Whole number.
    Integer(i32),
    /// Truth value.
    Boolean(bool),
    /// Text, or the name of an item of an enumeration.
    Text(String),
}

/// Inputs of a run besides its scene.
#[derive(Debug, Clone, Copy, Default)]
pub struct RunInputs<'a> {
    /// Start values (name, value as text).
    pub settings: &'a [(String, String)],
    /// Inputs over time.
    pub history: Option<&'a InputHistory>,
    /// Results of slow checks of an earlier run. They have no effect if they belong to another scene or other
    /// parameters.
    pub checks: &'a [u8],
    /// Scene whose results the run has, if an observer needs more outputs than this scene has.
    pub observed: Option<&'a ObservedScene>,
}

/// Scene that is run with more outputs, for an observer. The state of every sector is then known at communication points.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObservedScene {
    /// Columns of its recording.
    columns: HashSet<String>,
    /// Its watched sectors (1-based).
    watched_sectors: Vec<usize>,
}

impl ObservedScene {
    /// Creates the description of a scene.
    ///
    /// # Errors
    /// The scene is rejected.
    pub fn new(scene: &Scene, schedule: &Schedule) -> Result<Self> {
        let columns = Outputs::of(compiled(scene, schedule)?.table()).names.into_iter().collect();
        Ok(Self { columns, watched_sectors: scene.settings.outputs.watched_sectors.clone() })
    }
}

/// Function that is called at every communication point with its index and the simulation.
pub type Observer<'a> = dyn FnMut(usize, &Simulation) -> Result<()> + 'a;

/// Runs `scene` over the schedule with replaced start values and inputs over time.
///
/// # Errors
/// Settings are unknown or wrong, the scene is rejected, or a step fails; the failure then contains the warnings so far.
pub fn run(scene: &Scene, schedule: &Schedule, given: RunInputs<'_>, progress: &dyn Fn(usize)) -> Result<NativeRun> {
    StartedRun::new(scene, schedule, given)?.finish(progress)
}

/// Run that is initialised and has not taken a step yet.
pub struct StartedRun<'a> {
    simulation: Simulation,
    schedule: Schedule,
    driver: Option<Driver<'a>>,
    scene_name: String,
    outputs: Outputs,
    parameters: Vec<UsedParameter>,
    checks: Vec<u8>,
    warnings: Vec<Warning>,
    recording: Recording,
}

impl<'a> StartedRun<'a> {
    /// Initialises `scene` with replaced start values and inputs over time.
    ///
    /// # Errors
    /// Settings are unknown or wrong, the scene is rejected, or the results would not fit into memory.
    pub fn new(scene: &Scene, schedule: &Schedule, given: RunInputs<'a>) -> Result<Self> {
        let scene_name = scene.settings.name.clone();
        let in_scene = |error: tiprub_core::Error| in_scene(&scene_name, error);
        let mut simulation = compiled(scene, schedule)?;
        simulation.use_checks(given.checks);
        match given.observed {
            Some(observed) => simulation.search_minima_of(&observed.watched_sectors),
            None => simulation.skip_unneeded_states(),
        }
        check_set_once(given.settings.iter().map(|(name, _)| name.as_str()))?;
        for (variable, value) in given.settings {
            if given.history.is_some_and(|history| history.holds(variable)) {
                let problem = "the file given with --inputs also has a column for this variable";
                let remedy = "Set the variable with either --set or --inputs";
                return Err(Failure::usage(format!("--set {variable}"), problem, remedy));
            }
            set(&mut simulation, variable, value)?;
        }
        let driver = given.history.map(|history| history.drive(&simulation)).transpose()?;
        if let Some(driver) = &driver {
            driver.start(&mut simulation, schedule.start)?;
        }
        simulation.initialise(schedule.start).map_err(in_scene)?;
        let checks = simulation.checks();
        // Warnings of the start; those of the run are reported as its notes.
        let mut warnings = [simulation.warnings(), &schedule.warnings()].concat();
        warnings.extend(given.history.map(|history| history.warnings(schedule.step)).unwrap_or_default());
        warnings.retain(|warning| !scene.settings.is_silenced(warning.topic()));
        let parameters = start_values(&simulation).map_err(in_scene)?;
        let mut outputs = Outputs::of(simulation.table());
        if let Some(observed) = given.observed {
            outputs.keep(&observed.columns);
        }
        let recording = Recording::with_columns(outputs.names.clone(), schedule.count + 1)?;
        let schedule = *schedule;
        Ok(Self { simulation, schedule, driver, scene_name, outputs, parameters, checks, warnings, recording })
    }

    /// Takes all steps.
    ///
    /// # Errors
    /// A step fails; the failure contains the warnings so far.
    pub fn finish(self, progress: &dyn Fn(usize)) -> Result<NativeRun> {
        self.finish_observed(progress, &mut |_, _| Ok(()))
    }

    /// Takes all steps, and calls an observer at every communication point.
    ///
    /// # Errors
    /// A step or the observer fails; the failure contains the warnings so far.
    pub fn finish_observed(self, progress: &dyn Fn(usize), observer: &mut Observer<'_>) -> Result<NativeRun> {
        let Self { mut simulation, schedule, driver, scene_name, outputs, mut warnings, mut recording, .. } = self;
        let in_scene = |error: tiprub_core::Error| in_scene(&scene_name, error);
        let (mut stepping, mut slowest) = (Duration::ZERO, Duration::ZERO);
        for index in 0..=schedule.count {
            let time = schedule.time(index);
            recording.times.push(time);
            outputs.read(&simulation, &mut recording.values).map_err(in_scene)?;
            if let Err(failure) = observer(index, &simulation) {
                warnings.extend(simulation.take_notes());
                return Err(failure.with_warnings(warnings));
            }
            progress(index);
            if index < schedule.count {
                let next = schedule.time(index + 1);
                if let Some(driver) = &driver {
                    driver.step(&mut simulation, [time, next])?;
                }
                let clock = Instant::now();
                if let Err(error) = simulation.do_step(time, next - time) {
                    warnings.extend(simulation.take_notes());
                    return Err(in_scene(error).with_warnings(warnings));
                }
                let taken = clock.elapsed();
                (stepping, slowest) = (stepping + taken, slowest.max(taken));
            }
        }
        warnings.extend(simulation.take_notes());
        let system = simulation.system();
        let effort = (system.settings().scheme.properties().adaptive).then(|| *system.effort());
        let internal_steps = system.effort().steps;
        let (columns, parameters, checks) = (outputs.columns, self.parameters, self.checks);
        Ok(NativeRun { recording, columns, parameters, stepping, slowest, internal_steps, effort, warnings, checks })
    }
}

fn in_scene(name: &str, error: tiprub_core::Error) -> Failure {
    Failure::from_core(format!("scene `{name}`"), error)
}

/// Compiles a scene for a schedule: checks and warnings apply to the communication step that is used.
///
/// # Errors
/// The scene is rejected.
pub fn compiled(scene: &Scene, schedule: &Schedule) -> Result<Simulation> {
    let step = schedule.time(1) - schedule.time(0);
    let compile = |scene: &Scene| Simulation::new(scene).map_err(|error| in_scene(&scene.settings.name, error));
    if scene.settings.experiment.communication_step.to_bits() == step.to_bits() {
        return compile(scene);
    }
    let mut scene = scene.clone();
    scene.settings.experiment.communication_step = step;
    compile(&scene)
}

/// Returns the current values of all inputs and parameters, which are the start values before initialisation.
///
/// # Errors
/// Only programming errors.
pub fn start_values(simulation: &Simulation) -> tiprub_core::Result<Vec<UsedParameter>> {
    let read = |variable: &Variable| {
        let first = variable.reference;
        let value = match variable.kind {
            DataType::Real if variable.dimension.is_some() => {
                let elements = (first..).take(variable.len());
                ParameterValue::Reals(elements.map(|element| simulation.real(element)).collect::<Result<_, _>>()?)
            }
            DataType::Real => ParameterValue::Real(simulation.real(first)?),
            DataType::Boolean => ParameterValue::Boolean(simulation.boolean(first)?),
            DataType::Integer => ParameterValue::Integer(simulation.integer(first)?),
            DataType::Enumeration(enumeration) => {
                let number = simulation.integer(first)?;
                let item = usize::try_from(number - 1).ok().and_then(|index| enumeration.items.get(index));
                item.map_or(ParameterValue::Integer(number), |(item, _)| ParameterValue::Text((*item).to_owned()))
            }
            DataType::String => return Ok(None),
        };
        Ok(Some(UsedParameter { name: variable.name.clone(), value }))
    };
    let settable = simulation.table().variables().iter().filter(|variable| variable.is_settable());
    settable.filter_map(|variable| read(variable).transpose()).collect()
}

/// Returns the current values of all numeric outputs, in the order of the table.
pub fn numeric_outputs(simulation: &Simulation) -> Vec<f64> {
    let mut values = Vec::new();
    // Every reference comes from the table from which it is read.
    let _ = Outputs::of(simulation.table()).read(simulation, &mut values);
    values
}

/// Numeric outputs of a table, element by element.
struct Outputs {
    names: Vec<String>,
    columns: Vec<OutputColumn>,
    elements: Vec<(DataType, u32)>,
}

impl Outputs {
    fn of(table: &VariableTable) -> Self {
        let is_numeric_output =
            |variable: &&Variable| variable.causality == Causality::Output && variable.kind != DataType::String;
        let mut outputs = Self { names: Vec::new(), columns: Vec::new(), elements: Vec::new() };
        for variable in table.variables().iter().filter(is_numeric_output) {
            let column = OutputColumn {
                span: variable.span,
                is_energy: variable.unit.is_some_and(|unit| unit.name == "J"),
                is_element: variable.dimension.is_some(),
            };
            for (index, reference) in (0..variable.len()).zip(variable.reference..) {
                outputs.names.push(variable.element_name(index));
                outputs.columns.push(column);
                outputs.elements.push((variable.kind, reference));
            }
        }
        outputs
    }

    /// Keeps the elements with these names.
    fn keep(&mut self, names: &HashSet<String>) {
        let kept: Vec<bool> = self.names.iter().map(|name| names.contains(name)).collect();
        let mut next = kept.iter().copied();
        self.names.retain(|_| next.next().unwrap_or(false));
        next = kept.iter().copied();
        self.columns.retain(|_| next.next().unwrap_or(false));
        next = kept.iter().copied();
        self.elements.retain(|_| next.next().unwrap_or(false));
    }

    fn read(&self, simulation: &Simulation, values: &mut Vec<f64>) -> tiprub_core::Result<()> {
        for &(kind, reference) in &self.elements {
            values.push(match kind {
                DataType::Real => simulation.real(reference)?,
                DataType::Boolean => f64::from(u8::from(simulation.boolean(reference)?)),
                _ => f64::from(simulation.integer(reference)?),
            });
        }
        Ok(())
    }
}

/// Checks that no start value has no effect because a later one replaces it. An array may come before its elements.
///
/// # Errors
/// Names of a variable that is set twice, or of an array that comes after one of its elements.
pub fn check_set_once<'a>(names: impl Iterator<Item = &'a str> + Clone) -> Result<()> {
    for (index, name) in names.clone().enumerate() {
        let is_element = |other: &str| other.strip_prefix(name).is_some_and(|rest| rest.starts_with('['));
        let mut earlier = names.clone().take(index);
        let problem = match earlier.find(|other| *other == name || is_element(other)) {
            Some(other) if other == name => "this variable is set twice".to_owned(),
            Some(other) => format!("replaces the value of `{other}`, which is set before it"),
            None => continue,
        };
        return Err(Failure::usage(format!("--set {name}"), problem, "Give one value per variable"));
    }
    Ok(())
}

/// Sets a start value by name: a scalar, one element `name[i]`, all elements of an array to one value, or each element to its value of a list in
/// brackets.
pub fn set(simulation: &mut Simulation, name: &str, text: &str) -> Result<()> {
    let (kind, dimension, first) = locate(simulation.table(), name)?;
    for (reference, text) in (first..).zip(texts(name, text, dimension)?) {
        let option = format!("--set {name}={text}");
        let outcome = match kind {
            DataType::Real => simulation.set_real(reference, number(&option, text)?),
            DataType::Integer => simulation.set_integer(reference, number(&option, text)?),
            DataType::Boolean => simulation.set_boolean(reference, number(&option, text)?),
            DataType::String => simulation.set(reference, Value::String(text)),
            DataType::Enumeration(enumeration) => {
                let items = enumeration.items.iter().map(|(item, _)| *item).collect::<Vec<_>>();
                let item = items.iter().zip(1..).find(|(item, _)| **item == text).map(|(_, value)| value);
                let unknown =
                    || Failure::usage(&option, "unknown value", format!("Choose one of {}", items.join(", ")));
                simulation.set_integer(reference, item.or_else(|| text.parse().ok()).ok_or_else(unknown)?)
            }
        };
        outcome.map_err(|error| Failure { usage: true, ..Failure::from_core(&option, error) })?;
    }
    Ok(())
}

/// Returns the text of each element of an array of that dimension, or of a scalar.
fn texts<'a>(name: &str, text: &'a str, dimension: Option<usize>) -> Result<Vec<&'a str>> {
    let refused = |problem: String, remedy: String| Err(Failure::usage(format!("--set {name}"), problem, remedy));
    let list = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    match (list.map(|list| list.split(',').map(str::trim).collect::<Vec<_>>()), dimension) {
        (None, dimension) => Ok(vec![text; dimension.unwrap_or(1)]),
        (Some(_), None) => {
            refused("is a scalar and takes one value, not a list".into(), "Give the value without brackets".into())
        }
        (Some(values), Some(count)) if values.len() == count => Ok(values),
        (Some(values), Some(count)) => refused(
            format!("{} values are given for an array of {count} elements", values.len()),
            format!("Give {count} values, or a single value without brackets for all elements"),
        ),
    }
}

fn number<T: std::str::FromStr>(option: &str, text: &str) -> Result<T> {
    let kind = std::any::type_name::<T>();
    let wanted = match kind {
        "f64" => "a number",
        "bool" => "true or false",
        _ => "a whole number",
    };
    text.parse().map_err(|_| {
        Failure::usage(option, format!("{text:?} is not {wanted}"), format!("Give {wanted}{}", example(kind)))
    })
}

fn example(kind: &str) -> &'static str {
    if kind == "f64" { ", for example 1.5e-3" } else { "" }
}

/// Checks that a variable or an element of this name has a start value.
///
/// # Errors
/// There is no such variable, with similar names; or the variable is an output.
pub fn check_settable(table: &VariableTable, name: &str) -> Result<()> {
    let (.., reference) = locate(table, name)?;
    let owner = |variable: &&Variable| (variable.reference..).take(variable.len()).any(|other| other == reference);
    if table.variables().iter().find(owner).is_some_and(Variable::is_settable) {
        return Ok(());
    }
    let remedy = "Set inputs and parameters only; docs/variables.md lists them";
    Err(Failure::usage(format!("--set {name}"), "it is computed and cannot be set", remedy))
}

/// Returns the names of all means and totals of a run.
pub fn result_names(table: &VariableTable) -> Vec<String> {
    let Outputs { names, columns, .. } = Outputs::of(table);
    means::names(&names, &columns)
}

/// Returns the names of the columns of the recording that an output stands for: itself, or all elements of an array.
///
/// # Errors
/// There is no such output, with similar names.
pub fn output_columns(table: &VariableTable, name: &str) -> Result<Vec<String>> {
    let Outputs { names, .. } = Outputs::of(table);
    if names.iter().any(|column| column == name) {
        return Ok(vec![name.to_owned()]);
    }
    let is_element = |column: &&String| column.strip_prefix(name).is_some_and(|rest| rest.starts_with('['));
    let elements: Vec<String> = names.iter().filter(is_element).cloned().collect();
    if elements.is_empty() {
        let candidates: Vec<&str> = names.iter().map(String::as_str).collect();
        let remedy = similar(name, &candidates, "outputs");
        return Err(Failure::usage(format!("output `{name}`"), "no such output", remedy));
    }
    Ok(elements)
}

/// Returns type, dimension and first value reference of a variable or of one of its elements.
fn locate(table: &VariableTable, name: &str) -> Result<(DataType, Option<usize>, u32)> {
    if let Some(variable) = table.find(name) {
        return Ok((variable.kind, variable.dimension, variable.reference));
    }
    for variable in table.variables() {
        let element =
            (0..variable.len()).zip(variable.reference..).find(|(index, _)| variable.element_name(*index) == name);
        if let Some((_, reference)) = element {
            return Ok((variable.kind, None, reference));
        }
    }
    if let Some(variable) = name.rsplit_once('[').and_then(|(whole, _)| table.find(whole)) {
        let whole = &variable.name;
        let (problem, remedy) = match variable.dimension {
            None => (format!("`{whole}` has a single value"), format!("Write `{whole}`, without an index")),
            Some(count) => {
                (format!("`{whole}` has {count} elements"), format!("Write `{whole}[1]` to `{whole}[{count}]`"))
            }
        };
        return Err(Failure::usage(format!("--set {name}"), problem, remedy));
    }
    if name == "tolerance" {
        let remedy = "Set `time.scheme = \"galerkin\"` in the scene";
        return Err(Failure::usage(
            format!("--set {name}"),
            "only scenes with adaptive steps have a tolerance",
            remedy,
        ));
    }
    let settable: Vec<&str> = table
        .variables()
        .iter()
        .filter(|variable| variable.is_settable())
        .map(|variable| variable.name.as_str())
        .collect();
    Err(Failure::usage(format!("--set {name}"), "no such variable", suggestion(name, &settable)))
}

/// Largest number of names that a message lists.
const MOST_LISTED: usize = 60;

pub(crate) fn suggestion(name: &str, candidates: &[&str]) -> String {
    similar(name, candidates, "inputs and parameters")
}

/// Returns the remedy for an unknown name: the similar name, or all candidates, whose `kind` is given.
pub fn similar(name: &str, candidates: &[&str], kind: &str) -> String {
    match tiprub_format::closest_name(name, candidates.iter().copied()) {
        Some(candidate) => format!("Did you mean `{candidate}`?"),
        _ if candidates.len() > MOST_LISTED => format!(
            "Available {kind}: {}, and {} more; use `tiprub inspect` to list those of an FMU",
            candidates[..MOST_LISTED].join(", "),
            candidates.len() - MOST_LISTED
        ),
        _ => format!("Available {kind}: {}", candidates.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A variable with one value has no index, and every variable is set once.
    #[test]
    fn superfluous_indices_and_repeated_names_are_rejected() {
        let scene = tiprub_test_models::rub(4);
        let mut simulation = Simulation::new(&scene).unwrap();
        let failure = set(&mut simulation, "speed[2]", "3").unwrap_err();
        let text = "--set speed[2]: `speed` has a single value. Write `speed`, without an index.";
        assert_eq!(failure.to_string(), text);
        let schedule = Schedule::new(&scene.settings.experiment, None, None).unwrap();
        let settings = [("speed", "3"), ("friction_coefficient", "0"), ("speed", "4")];
        let settings = settings.map(|(name, value)| (name.to_owned(), value.to_owned()));
        let given = RunInputs { settings: &settings, ..RunInputs::default() };
        let failure = StartedRun::new(&scene, &schedule, given).err().unwrap();
        assert_eq!(failure.to_string(), "--set speed: this variable is set twice. Give one value per variable.");
        assert!(check_set_once(["a", "a[1]", "b", "ab"].into_iter()).is_ok());
        let failure = check_set_once(["a[2]", "b", "a"].into_iter()).unwrap_err();
        assert!(failure.problem.contains("replaces the value of `a[2]`"), "{failure}");
    }

    #[test]
    fn suggests_similar_name_or_lists_all_names() {
        let names = ["speed", "friction_coefficient"];
        assert_eq!(suggestion("sped", &names), "Did you mean `speed`?");
        assert_eq!(suggestion("xyz", &names), "Available inputs and parameters: speed, friction_coefficient");
    }

    #[test]
    fn list_must_match_array_length() {
        assert_eq!(texts("heat", "3.5", None).unwrap(), ["3.5"]);
        assert_eq!(texts("heat", "3.5", Some(2)).unwrap(), ["3.5", "3.5"]);
        assert_eq!(texts("heat", "[1, -2e3]", Some(2)).unwrap(), ["1", "-2e3"]);
        assert_eq!(texts("heat", "[1]", Some(1)).unwrap(), ["1"]);
        for (text, dimension) in [("[1]", None), ("[1]", Some(2)), ("[1,2,3]", Some(2)), ("[]", Some(2))] {
            let failure = texts("heat", text, dimension).unwrap_err();
            assert!(failure.what == "--set heat" && failure.usage && failure.remedy.starts_with("Give"), "{failure}");
        }
    }

    #[test]
    fn invalid_values_report_the_expected_type() {
        let failure = number::<f64>("--set speed=fast", "fast").unwrap_err();
        assert_eq!(
            failure.to_string(),
            "--set speed=fast: \"fast\" is not a number. Give a number, for example 1.5e-3."
        );
        assert!(number::<bool>("--set a=1", "1").unwrap_err().remedy.contains("true or false"));
        assert!(number::<i32>("--set a=1.5", "1.5").unwrap_err().remedy.contains("whole number"));
    }
}
