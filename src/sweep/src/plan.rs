//! The plan of a sweep: a TOML file.

mod values;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::Deserialize;
use tiprub_format::name_hint;
use tiprub_gallery::scene_source::{self, BUILTIN, SceneText};
use tiprub_shell::{Failure, Result, native::similar, schedule::Schedule};
use tiprub_table::{Cell, Column, ColumnType, Table, csv_file, parquet_file};
use toml::Value;

use crate::{
    design::{Combination, Design},
    fields,
    models::SweepSources,
    row::RESERVED_NAMES,
};
pub(crate) use values::field_value;
use values::{cells, flatten};

/// Largest plan (bytes).
const LARGEST_PLAN: u64 = 16 << 20;
/// Parameter that a sweep sets to 1 in every run.
const THREADS: &str = "threads";

/// Plan of a sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// File name without extension.
    pub name: String,
    /// Path of the plan, for messages.
    pub path: PathBuf,
    /// The scene.
    pub scene: SceneText,
    /// Scene as a tree of keys and values.
    pub document: toml::Table,
    /// Stop time (s) and communication step (s), instead of those of the scene.
    pub times: [Option<f64>; 2],
    /// Start values of all runs (name, value as text).
    pub set: Vec<(String, String)>,
    /// Variables, in the order of their columns.
    pub variables: Vec<PlanVariable>,
    /// ROMs to replace.
    pub roms: Vec<RomRule>,
    /// Values of the variables.
    pub design: Design,
    /// True if the values come from a table.
    pub is_table: bool,
    /// Outputs over time to store, if any.
    pub histories: Option<HistoryRequest>,
}

/// Variable of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlanVariable {
    /// Name of the column in the results.
    pub name: String,
    /// Where its value goes.
    pub target: VariableTarget,
}

/// Where the value of a variable goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum VariableTarget {
    /// Start value of an input, or a parameter, of this name.
    StartValue(String),
    /// Key of the scene file.
    Field(String),
    /// Braces of a `[rom]` entry, and the results; the plan gives neither `field` nor `label`.
    RomPart,
    /// Results, and braces of `[rom]` entries; the plan gives `label = true`.
    Label,
}

/// Replacement of the ROM of a structure; `{name}` stands for the value of a variable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RomRule {
    /// Index of the structure in the scene.
    pub structure: usize,
    /// Pattern of the ROM.
    pub pattern: RomPattern,
}

/// Pattern of a ROM.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RomPattern {
    /// ROM file, relative to the plan, or built-in model.
    File(String),
    /// Arguments of `tiprub reduce`.
    Reduction(String),
}

/// Outputs over time to store.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HistoryRequest {
    /// Names of outputs, or of arrays for all of their elements.
    pub outputs: Vec<String>,
    /// Stores every n-th communication point.
    #[serde(default = "one")]
    pub every: std::num::NonZero<usize>,
}

fn one() -> std::num::NonZero<usize> {
    std::num::NonZero::<usize>::MIN
}

/// Content of the file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    scene: String,
    stop: Option<f64>,
    communication_step: Option<f64>,
    #[serde(default)]
    set: toml::Table,
    #[serde(default)]
    design: DesignKind,
    table: Option<PathBuf>,
    #[serde(default)]
    variable: Vec<VariableEntry>,
    #[serde(default)]
    rom: BTreeMap<String, RomEntry>,
    histories: Option<HistoryRequest>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum DesignKind {
    #[default]
    Grid,
    List,
    Table,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct VariableEntry {
    name: String,
    field: Option<String>,
    #[serde(default)]
    label: bool,
    values: Option<Value>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RomEntry {
    file: Option<String>,
    reduce: Option<String>,
}

impl Plan {
    /// Reads a plan. Paths in it are relative to its directory.
    ///
    /// # Errors
    /// The file cannot be read, a key is unknown or has a wrong value, or a table or the scene cannot be read.
    pub fn load(path: &Path, sources: &dyn SweepSources) -> Result<Self> {
        let in_plan = |failure: Failure| Failure { usage: true, ..failure }.at(path.display());
        let file = parse(path)?;
        let directory = directory(path);
        let scene = if file.scene.starts_with(BUILTIN) {
            sources.scene(&file.scene)?
        } else {
            sources.scene(&directory.join(&file.scene).display().to_string())?
        };
        let document: toml::Table = toml::from_str(&scene.text)
            .map_err(|error| Failure::new(&scene.name, error.message(), "Correct the scene file"))?;
        let roms = rom_rules(&file.rom, &document).map_err(in_plan)?;
        let (variables, columns) = columns(&file, directory).map_err(in_plan)?;
        let variables = targets(&file, variables, &roms).map_err(in_plan)?;
        let combination = if file.design == DesignKind::Grid { Combination::Grid } else { Combination::List };
        let mut set = Vec::new();
        flatten(&file.set, "", &mut set).map_err(in_plan)?;
        check_names(&variables, &set).map_err(in_plan)?;
        let plan = Self {
            name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            path: path.to_owned(),
            document,
            times: [file.stop, file.communication_step],
            set,
            variables,
            roms,
            design: Design::new(columns, combination).map_err(in_plan)?,
            is_table: file.design == DesignKind::Table,
            histories: file.histories,
            scene,
        };
        plan.check_fields().map_err(in_plan)?;
        if plan.histories.as_ref().is_some_and(|request| request.outputs.is_empty()) {
            let remedy = "Name outputs, or remove the table [histories]";
            return Err(in_plan(Failure::new("histories.outputs", "is empty", remedy)));
        }
        Ok(plan)
    }

    /// Returns the directory to which paths in the plan are relative.
    pub fn directory(&self) -> &Path {
        directory(&self.path)
    }

    /// Returns the values of all variables in a run (from 0).
    pub fn values(&self, run: usize) -> impl Iterator<Item = (&PlanVariable, &Cell)> {
        self.variables.iter().enumerate().map(move |(index, variable)| (variable, self.design.value(run, index)))
    }

    /// Returns the communication points of a scene with these times.
    ///
    /// # Errors
    /// The stop is not after the start, or the step is not positive.
    pub fn schedule(&self, settings: &tiprub_core::scene::settings::SceneSettings) -> Result<Schedule> {
        let [stop, step] = self.times;
        let mut experiment = settings.experiment.clone();
        experiment.stop = stop.unwrap_or(experiment.stop);
        experiment.communication_step = step.unwrap_or(experiment.communication_step);
        Schedule::new(&experiment, None, None)
    }

    /// Checks that the scene has all fields, with the values of the first run, and that no two variables set the same key.
    fn check_fields(&self) -> Result<()> {
        let mut document = self.document.clone();
        let mut places: Vec<(String, &str)> = Vec::new();
        for rule in &self.roms {
            places.push((format!("structure[{}].rom", rule.structure + 1), "[rom]"));
        }
        for (time, key) in self.times.iter().zip(["stop", "communication_step"]) {
            if time.is_some() {
                places.push((format!("experiment.{key}"), key));
            }
        }
        for (variable, value) in self.values(0) {
            if let VariableTarget::Field(path) = &variable.target {
                fields::set(&mut document, path, field_value(value))?;
                let place = fields::place(&document, path)?;
                if let Some((known, other)) = places.iter().find(|(known, _)| fields::overlap(known, &place)) {
                    let problem = if *known == place {
                        format!("sets the key `{place}`, which `{other}` also sets")
                    } else {
                        format!("sets the key `{place}`, but `{other}` sets the key `{known}`")
                    };
                    return Err(Failure::new(format!("variable `{}`", variable.name), problem, "Remove one of them"));
                }
                places.push((place, &variable.name));
            }
        }
        Ok(())
    }
}

/// Returns the files that a plan names, as far as this can be known without running it: the scene with its ROMs, ROM files and the table of values.
/// A plan with errors names none.
pub fn input_files(path: &Path) -> Vec<PathBuf> {
    let Ok(file) = parse(path) else { return Vec::new() };
    let directory = directory(path);
    let mut found: Vec<PathBuf> = file.table.iter().map(|table| directory.join(table)).collect();
    if !file.scene.starts_with(BUILTIN) {
        let scene = directory.join(&file.scene);
        found.extend(scene_source::files(&scene.display().to_string()));
        found.push(scene);
    }
    let roms = file.rom.values().filter_map(|entry| entry.file.as_ref());
    found.extend(roms.filter(|rom| !rom.starts_with(BUILTIN) && !rom.contains('{')).map(|rom| directory.join(rom)));
    found
}

fn directory(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}

fn parse(path: &Path) -> Result<PlanFile> {
    let bytes = tiprub_format::read_file(path, LARGEST_PLAN).map_err(|error| unreadable(path, &error))?;
    let text = String::from_utf8(bytes)
        .map_err(|_| Failure::usage(path.display(), "is not UTF-8 text", "Give a plan (TOML)"))?;
    toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| 1 + text[..span.start.min(text.len())].matches('\n').count());
        let remedy = "Correct the plan; the guide page \"Sweeps\" lists its keys";
        let remedy = format!("{}{remedy}", hint(error.message()));
        let is_scene = toml::from_str::<toml::Table>(&text).is_ok_and(|keys| keys.contains_key("structure"));
        let remedy = if is_scene {
            "This file is a scene: use `tiprub run`, or name it in a plan with the key `scene`"
        } else {
            &remedy
        };
        let problem = error.message().replace("a nonzero usize", "a whole number of 1 or more");
        Failure::usage(format!("{}:{line}", path.display()), problem, remedy)
    })
}

/// Returns the failure of a plan that cannot be read.
fn unreadable(path: &Path, error: &std::io::Error) -> Failure {
    let mut failure = Failure::file(path, "cannot be read", error);
    if error.kind() == std::io::ErrorKind::NotFound {
        failure.diagnostic.remedy = "Give the path of a plan (TOML); `tiprub run` runs a single scene".to_owned();
    }
    failure
}

/// Returns the question whether a similar key or value was meant; empty if none is similar. The parser's message about an unknown name quotes this name
/// and all accepted names in backticks.
fn hint(message: &str) -> String {
    let mut names = message.split('`').skip(1).step_by(2);
    let given = names.next().filter(|_| message.starts_with("unknown "));
    given.map_or(String::new(), |given| name_hint(given, names))
}

/// Returns the rules of the `[rom]` tables.
fn rom_rules(entries: &BTreeMap<String, RomEntry>, scene: &toml::Table) -> Result<Vec<RomRule>> {
    let structures = scene.get("structure").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
    let names: Vec<&str> =
        structures.iter().map(|table| table.get("name").and_then(Value::as_str).unwrap_or_default()).collect();
    let rule = |(name, entry): (&String, &RomEntry)| {
        let what = format!("rom.{name}");
        let Some(structure) = names.iter().position(|other| other == name) else {
            let remedy = similar(name, &names, "structures of the scene");
            return Err(Failure::new(what, "the scene has no such structure", remedy));
        };
        let pattern = match (&entry.file, &entry.reduce) {
            (Some(file), None) => RomPattern::File(file.clone()),
            (None, Some(arguments)) => RomPattern::Reduction(arguments.clone()),
            _ => {
                let remedy = "Give either `file`, or `reduce` with the arguments of `tiprub reduce`";
                return Err(Failure::new(what, "needs one of two keys", remedy));
            }
        };
        Ok(RomRule { structure, pattern })
    };
    entries.iter().map(rule).collect()
}

/// Names of variables with their entries in the plan; a column of a table may have none.
type NamedEntries<'a> = Vec<(String, Option<&'a VariableEntry>)>;

/// Returns the variables with their fields and labels, and a column of values for each.
fn columns<'a>(file: &'a PlanFile, directory: &Path) -> Result<(NamedEntries<'a>, Vec<Column>)> {
    if file.design == DesignKind::Table {
        return table_columns(file, directory);
    }
    if file.table.is_some() {
        let remedy = "Set design = \"table\", or remove the key `table`";
        return Err(Failure::new("table", "is not used by this design", remedy));
    }
    let column = |entry: &VariableEntry| {
        let what = || format!("variable `{}`", entry.name);
        let values = entry.values.as_ref().ok_or_else(|| {
            Failure::new(what(), "has no values", "Give a list `values = [...]` or a range { from, to, count }")
        })?;
        let cells = cells(values).map_err(|failure| failure.at(what()))?;
        // Values keep their types, because a key of the scene may accept a number or a text.
        let kind = ColumnType::common(&cells);
        Ok(Column { name: entry.name.clone(), kind, cells: cells.into_iter().map(Some).collect() })
    };
    let columns = file.variable.iter().map(column).collect::<Result<_>>()?;
    Ok((file.variable.iter().map(|entry| (entry.name.clone(), Some(entry))).collect(), columns))
}

/// Returns the columns of a table of values.
fn table_columns<'a>(file: &'a PlanFile, directory: &Path) -> Result<(NamedEntries<'a>, Vec<Column>)> {
    let path = file.table.as_ref().ok_or_else(|| {
        Failure::new("table", "missing: the design is a table", "Name a CSV or Parquet file: table = \"runs.csv\"")
    })?;
    let path = directory.join(path);
    let is_parquet = path.extension().is_some_and(|kind| kind.eq_ignore_ascii_case("parquet"));
    let Table { columns } = if is_parquet { parquet_file::read(&path) } else { csv_file::read(&path) }?;
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    for entry in &file.variable {
        if !names.contains(&entry.name.as_str()) {
            let remedy = similar(&entry.name, &names, "columns");
            let problem = format!("the table {} has no column of this name", path.display());
            return Err(Failure::new(format!("variable `{}`", entry.name), problem, remedy));
        }
        if entry.values.is_some() {
            let problem = "its values come from the table";
            return Err(Failure::new(format!("variable `{}`", entry.name), problem, "Remove the key `values`"));
        }
    }
    let entry = |name: &String| file.variable.iter().find(|entry| entry.name == *name);
    Ok((columns.iter().map(|column| (column.name.clone(), entry(&column.name))).collect(), columns))
}

/// Returns the variables with the places of their values.
fn targets(file: &PlanFile, variables: NamedEntries, roms: &[RomRule]) -> Result<Vec<PlanVariable>> {
    let names: Vec<&str> = variables.iter().map(|(name, _)| name.as_str()).collect();
    let mut in_roms = Vec::new();
    for rule in roms {
        let (RomPattern::File(pattern) | RomPattern::Reduction(pattern)) = &rule.pattern;
        for name in placeholders(pattern)? {
            if !names.contains(&name) {
                let remedy = similar(name, &names, "variables of the plan");
                return Err(Failure::new(format!("rom: {{{name}}}"), "the plan has no such variable", remedy));
            }
            in_roms.push(name.to_owned());
        }
    }
    let target = |name: &String, entry: Option<&VariableEntry>| match entry {
        Some(VariableEntry { field: Some(path), .. }) => VariableTarget::Field(path.clone()),
        Some(VariableEntry { label: true, .. }) => VariableTarget::Label,
        _ if in_roms.contains(name) => VariableTarget::RomPart,
        _ => VariableTarget::StartValue(name.clone()),
    };
    if let Some(entry) = file.variable.iter().find(|entry| entry.label && entry.field.is_some()) {
        let remedy = "Remove one of the keys `field` and `label`";
        return Err(Failure::new(format!("variable `{}`", entry.name), "is both a field and a label", remedy));
    }
    Ok(variables.into_iter().map(|(name, entry)| PlanVariable { target: target(&name, entry), name }).collect())
}

/// Returns the names in braces.
pub(crate) fn placeholders(pattern: &str) -> Result<Vec<&str>> {
    let wrong = || Failure::new(format!("rom: {pattern}"), "has an open brace", "Write {NAME} with a variable's name");
    pattern.split('{').skip(1).map(|rest| rest.split_once('}').map(|(name, _)| name).ok_or_else(wrong)).collect()
}

/// Checks that names of columns are unique, and that no variable is set twice.
fn check_names(variables: &[PlanVariable], set: &[(String, String)]) -> Result<()> {
    let is_set = |name: &str| set.iter().any(|(other, _)| other == name);
    for (index, variable) in variables.iter().enumerate() {
        let name = &variable.name;
        let wrong = |problem: &str, remedy: &str| Err(Failure::new(format!("variable `{name}`"), problem, remedy));
        if variables[..index].iter().any(|other| other.name == *name) {
            return wrong("occurs twice", "Give each variable its own name");
        }
        if RESERVED_NAMES.contains(&name.as_str()) {
            return wrong("has the name of a column of the results", "Give it another name and a `field`");
        }
        if variable.target == VariableTarget::StartValue(name.clone()) && is_set(name) {
            return wrong("is also in [set]", "Remove it from [set]");
        }
    }
    let is_threads = |variable: &PlanVariable| variable.target == VariableTarget::StartValue(THREADS.to_owned());
    if is_set(THREADS) || variables.iter().any(is_threads) {
        let remedy = "Remove it; --threads of the command is the number of runs at the same time";
        return Err(Failure::new(format!("variable `{THREADS}`"), "a run of a sweep uses one thread", remedy));
    }
    Ok(())
}
