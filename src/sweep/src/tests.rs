//! Sweeps of a small scene.

mod conflicts;
mod kept_files;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, AtomicUsize, Ordering},
};

use nalgebra::DMatrix;
use tempfile::TempDir;
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, RomChecks, RomExtras};
use tiprub_gallery::{
    rom_cache::RomCache,
    scene_source::{self, SceneText},
};
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_table::{Cell, Table, parquet_file};

use crate::{
    engine::{self, SweepFiles, SweepOutcome, SweepRequest},
    journal::Journal,
    models::SweepSources,
    part::Part,
    plan::Plan,
    result_file,
    row::{Row, Status},
};

const SCENE: &str = r#"
name = "small"
[[structure]]
name = "rotor"
rom = "small.rom.safetensors"
speed = 100.0
[[surface]]
name = "casing"
shape = { kind = "lobes", amplitude = 2e-3, order = 2 }
ramp_time = 0.002
[[contact]]
master = "rotor"
slave = "casing"
gap = 1e-3
friction = 0.1
[time]
step = 1e-4
[experiment]
stop = 0.01
communication_step = 1e-3
"#;

const GRID: &str = r#"
scene = "scene.toml"
[[variable]]
name = "speed"
values = { from = 80, to = 120, count = 3 }
[[variable]]
name = "gap"
field = "contact[1].gap"
values = [5e-4, 1e-3]
"#;

/// Columns that differ between equal runs.
const TIMES: [&str; 2] = ["seconds", "stepping_seconds"];

/// One mass on three springs, as four blades.
fn rom(stiffness: f64) -> Rom {
    Rom {
        name: "small".into(),
        origin: "One mass on three springs".into(),
        sectors: 4,
        frame: DisplacementFrame::Cylindrical,
        mass: DMatrix::identity(3, 3) * 0.1,
        stiffness: DMatrix::identity(3, 3) * stiffness,
        damping_ratio: 0.01,
        contact_map: DMatrix::identity(3, 3),
        contact_nodes: vec![ContactNode {
            name: "tip".into(),
            position: [0.25, 0.0, 0.0],
            meridional_slope: 0.0,
            ..ContactNode::default()
        }],
        checks: RomChecks::default(),
        extras: RomExtras::default(),
    }
}

/// Directory with a scene, and a source of models that counts reductions.
struct Bench {
    root: TempDir,
    reductions: AtomicUsize,
}

impl SweepSources for Bench {
    fn scene(&self, argument: &str) -> Result<SceneText> {
        scene_source::text(argument)
    }

    fn reduction_files(&self, arguments: &str, _directory: &Path) -> Result<Vec<PathBuf>> {
        match arguments.starts_with("spring ") {
            true => Ok(Vec::new()),
            false => Err(Failure::new(arguments, "no such model", "Choose spring")),
        }
    }

    fn reduce(&self, arguments: &str, _directory: &Path, _console: &Console) -> Result<Rom> {
        self.reductions.fetch_add(1, Ordering::Relaxed);
        let stiffness: f64 = arguments.trim_start_matches("spring ").parse().unwrap();
        if stiffness > 0.0 {
            Ok(rom(stiffness))
        } else {
            Err(Failure::new("spring", "is too soft", "Use a stiffer one"))
        }
    }
}

impl Bench {
    fn new() -> Self {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("scene.toml"), SCENE).unwrap();
        fs::write(root.path().join("small.rom.safetensors"), tiprub_format::write_rom(&rom(1e5))).unwrap();
        Self { root, reductions: AtomicUsize::new(0) }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.root.path().join(name)
    }

    fn plan(&self, text: &str) -> Result<Plan> {
        fs::write(self.path("plan.toml"), text).unwrap();
        Plan::load(&self.path("plan.toml"), self)
    }

    /// Runs a part with this number of threads.
    fn try_part(&self, text: &str, output: &str, part: Part, threads: usize) -> Result<SweepOutcome> {
        self.sweep(&self.plan(text)?, output, part, threads)
    }

    fn sweep(&self, plan: &Plan, output: &str, part: Part, threads: usize) -> Result<SweepOutcome> {
        let (stop, cache, console) = (AtomicBool::new(false), RomCache::off(), Console::new(true, false));
        engine::run(&SweepRequest {
            plan,
            part,
            output: &self.path(output),
            threads,
            stop: &stop,
            sources: self,
            cache: &cache,
            console: &console,
        })
    }

    fn run(&self, text: &str, output: &str) -> SweepOutcome {
        self.try_part(text, output, Part::WHOLE, 2).unwrap()
    }

    fn table(&self, output: &str) -> Table {
        let mut table = parquet_file::read(&self.path(output)).unwrap();
        table.columns.retain(|column| !TIMES.contains(&column.name.as_str()));
        table
    }

    fn files(&self) -> Vec<String> {
        let names = fs::read_dir(self.root.path()).unwrap();
        let mut names: Vec<_> = names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

fn texts(table: &Table, name: &str) -> Vec<String> {
    let cells = &table.column(name).unwrap_or_else(|| panic!("{name}")).cells;
    cells.iter().map(|cell| cell.as_ref().map_or_else(String::new, Cell::to_string)).collect()
}

#[test]
fn rows_do_not_depend_on_threads_and_parts() {
    let bench = Bench::new();
    let outcome = bench.run(GRID, "whole.parquet");
    assert_eq!((outcome.runs, outcome.finished, outcome.is_complete), (6, 6, true));
    let whole = bench.table("whole.parquet");
    assert_eq!(texts(&whole, "run"), ["1", "2", "3", "4", "5", "6"]);
    assert_eq!(texts(&whole, "speed"), ["80", "80", "100", "100", "120", "120"]);
    let forces = texts(&whole, "largest_total_normal_force");
    assert!(forces.iter().all(|force| force.parse::<f64>().unwrap() > 0.0) && forces[0] != forces[1], "{forces:?}");
    for (name, part, threads) in [("one.parquet", Part::WHOLE, 1), ("two.parquet", Part::WHOLE, 2)] {
        bench.try_part(GRID, name, part, threads).unwrap();
        assert_eq!(bench.table(name), whole, "{threads} threads");
    }
    let mut joined: Option<Table> = None;
    for number in 1..=4 {
        bench.try_part(GRID, "part.parquet", Part::new(number, 4).unwrap(), 2).unwrap();
        let part = bench.table("part.parquet");
        fs::remove_file(bench.path("part.parquet")).unwrap();
        match &mut joined {
            None => joined = Some(part),
            Some(joined) => {
                for (column, more) in joined.columns.iter_mut().zip(part.columns) {
                    assert_eq!(column.name, more.name);
                    column.cells.extend(more.cells);
                }
            }
        }
    }
    assert_eq!(joined, Some(whole));
    assert!(!bench.files().iter().any(|name| name.contains("journal") || name.contains("models")));
}

#[test]
fn journal_rows_are_not_computed_again() {
    let bench = Bench::new();
    bench.run(GRID, "whole.parquet");
    let (rows, _) = result_file::read(&bench.path("whole.parquet")).unwrap();
    let files = SweepFiles::new(&bench.path("new.parquet"));
    let (mut journal, _) = Journal::open(&files.journal).unwrap();
    // The marked value shows that the row is taken from the journal.
    let mut marked = rows[4].clone();
    marked.cells.iter_mut().find(|(name, _)| name == "most_contacts").unwrap().1 = Cell::Real(77.0);
    [&rows[1], &marked].into_iter().for_each(|row| journal.append(row).unwrap());
    drop(journal);
    let outcome = bench.run(GRID, "new.parquet");
    assert_eq!((outcome.resumed, outcome.finished), (2, 6));
    let table = bench.table("new.parquet");
    assert_eq!(texts(&table, "most_contacts")[4], "77");
    // A complete result is not computed again, and a longer plan adds its new runs only.
    assert_eq!(bench.run(GRID, "new.parquet").resumed, 6);
    assert_eq!(bench.table("new.parquet"), table);
    let longer = bench.run(&GRID.replace("[5e-4, 1e-3]", "[5e-4, 8e-4, 1e-3]"), "new.parquet");
    assert_eq!((longer.runs, longer.resumed, longer.finished), (9, 6, 9));
    assert_eq!(texts(&bench.table("new.parquet"), "most_contacts")[6], "77");
}

#[test]
fn refusals_and_failures_are_rows_with_reasons() {
    let bench = Bench::new();
    let plan = "scene = \"scene.toml\"\n[[variable]]\nname = \"friction_coefficient\"\nvalues = [0.1, -1, \"much\"]\n\
                [[variable]]\nname = \"gap\"\nfield = \"contact.gap\"\nvalues = [1e-3, true]";
    let outcome = bench.run(plan, "a.parquet");
    assert_eq!((outcome.finished, outcome.refused, outcome.failed), (1, 5, 0));
    let table = bench.table("a.parquet");
    assert_eq!(texts(&table, "status")[0], Status::Finished.name());
    let reasons = texts(&table, "reason");
    assert!(reasons[0].is_empty() && reasons[2].contains("friction_coefficient"), "{reasons:?}");
    assert!(reasons[4].contains("is not a number") && !reasons.concat().contains("--set"), "{reasons:?}");
    assert!(reasons[1].contains("gap") && !reasons[1].contains("this run"), "{reasons:?}");
    assert_eq!(outcome.reasons.iter().map(|(.., count)| count).sum::<usize>(), 5);
}

/// The second run needs more internal steps than it may take.
#[test]
fn failed_step_is_a_row_and_other_runs_continue() {
    let bench = Bench::new();
    // Adaptive steps need more modes than contact directions.
    let stiffness = DMatrix::from_fn(6, 6, |row, column| if row == column { 1e5 * (1.0 + row as f64) } else { 0.0 });
    let contact_map =
        DMatrix::from_fn(3, 6, |row, column| if column % 3 == row { 1.0 / (1.0 + column as f64) } else { 0.0 });
    let rom = Rom { mass: DMatrix::identity(6, 6) * 0.1, stiffness, contact_map, ..rom(1e5) };
    fs::write(bench.path("small.rom.safetensors"), tiprub_format::write_rom(&rom)).unwrap();
    let plan = "scene = \"scene.toml\"\n[[variable]]\nname = \"method\"\nfield = \"time.scheme\"\nvalues = [\"galerkin\"]\n\
                [[variable]]\nname = \"most\"\nfield = \"time.max_internal_steps\"\nvalues = [0, 1, 100000]";
    let outcome = bench.run(plan, "a.parquet");
    assert_eq!((outcome.finished, outcome.refused, outcome.failed), (2, 0, 1), "{outcome:?}");
    let table = bench.table("a.parquet");
    assert_eq!(texts(&table, "status"), ["finished", "failed", "finished"]);
    assert!(texts(&table, "reason")[1].contains("internal steps"), "{:?}", texts(&table, "reason"));
    assert!(texts(&table, "most_contacts")[1].is_empty() && texts(&table, "missed_steps")[0] == "0");
}

#[test]
fn equal_runs_are_computed_once() {
    let bench = Bench::new();
    let plan = "scene = \"scene.toml\"\ndesign = \"list\"\n[[variable]]\nname = \"speed\"\nvalues = [100, 90, 100]\n\
                [[variable]]\nname = \"id\"\nlabel = true\nvalues = [\"a\", \"b\", \"c\"]";
    bench.run(plan, "a.parquet");
    let table = parquet_file::read(&bench.path("a.parquet")).unwrap();
    let seconds = texts(&table, "seconds");
    assert!(seconds[0] == seconds[2] && seconds[0] != seconds[1], "{seconds:?}");
    assert_eq!(texts(&table, "id"), ["a", "b", "c"]);
}

#[test]
fn models_are_reduced_once_each_and_failures_are_rows() {
    let bench = Bench::new();
    let plan = "scene = \"scene.toml\"\n[[variable]]\nname = \"speed\"\nvalues = [90, 100]\n[[variable]]\n\
                name = \"stiffness\"\nvalues = [1e5, 2e5, -1.0]\n[rom.rotor]\nreduce = \"spring {stiffness}\"";
    let outcome = bench.run(plan, "a.parquet");
    assert_eq!((outcome.finished, outcome.refused), (4, 2));
    assert_eq!(bench.reductions.load(Ordering::Relaxed), 3);
    let table = bench.table("a.parquet");
    let forces = texts(&table, "largest_total_normal_force");
    assert!(forces[0] != forces[1] && texts(&table, "reason")[2].contains("too soft"), "{forces:?}");
    // The model in the file gives the same row as the reduced one.
    let same = bench.run("scene = \"scene.toml\"\n[[variable]]\nname = \"speed\"\nvalues = [90]", "b.parquet");
    assert_eq!(
        (same.finished, texts(&bench.table("b.parquet"), "largest_total_normal_force")),
        (1, forces[..1].to_vec())
    );
    // A complete part needs no model.
    bench.run(plan, "a.parquet");
    assert_eq!(bench.reductions.load(Ordering::Relaxed), 3);
}

#[test]
fn histories_contain_the_requested_outputs_of_finished_runs() {
    let bench = Bench::new();
    let plan = format!("{GRID}\n[histories]\noutputs = [\"torque\", \"contact_count\"]\nevery = 2");
    let outcome = bench.run(&plan, "a.parquet");
    assert_eq!(outcome.finished, 6);
    let histories = parquet_file::read(&bench.path("a.histories.parquet")).unwrap();
    let names: Vec<&str> = histories.columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["run", "time", "torque", "contact_count"]);
    // Eleven communication points in each run, every second one.
    assert_eq!(histories.rows(), 6 * 6);
    assert_eq!(texts(&histories, "run")[5..8], ["1", "2", "2"]);
    assert!(texts(&histories, "torque").iter().any(|torque| torque != "0"));
    let bytes = fs::read(bench.path("a.histories.parquet")).unwrap();
    assert_eq!(bench.run(&plan, "a.parquet").resumed, 6);
    assert_eq!(fs::read(bench.path("a.histories.parquet")).unwrap(), bytes);
    // Rows without the requested outputs are computed again.
    fs::remove_file(bench.path("a.histories.parquet")).unwrap();
    assert_eq!(bench.run(&plan, "a.parquet").resumed, 0);
    assert_eq!(fs::read(bench.path("a.histories.parquet")).unwrap(), bytes);
}

#[test]
fn plan_values_come_from_csv_and_parquet_tables() {
    let bench = Bench::new();
    fs::write(bench.path("runs.csv"), "id,speed,gap\nx,100,1e-3\ny,90.5,5e-4\n").unwrap();
    let plan = "scene = \"scene.toml\"\ndesign = \"table\"\ntable = \"runs.csv\"\n[[variable]]\nname = \"gap\"\n\
                field = \"contact.gap\"\n[[variable]]\nname = \"id\"\nlabel = true\n";
    bench.run(plan, "csv.parquet");
    let table = bench.table("csv.parquet");
    assert_eq!(
        (texts(&table, "id"), texts(&table, "speed")),
        (vec!["x".into(), "y".into()], vec!["100".into(), "90.5".into()])
    );
    // A result is a table, too.
    let mut values = table.clone();
    values.columns.retain(|column| ["id", "speed", "gap"].contains(&column.name.as_str()));
    parquet_file::write(&bench.path("runs.parquet"), &values, &[]).unwrap();
    bench.run(&plan.replace("runs.csv", "runs.parquet"), "parquet.parquet");
    assert_eq!(bench.table("parquet.parquet"), table);
}

/// Errors that end a sweep before its first run.
#[test]
fn wrong_plans_are_rejected_with_place_and_remedy() {
    let bench = Bench::new();
    fs::write(bench.path("runs.csv"), "sped\n100\n").unwrap();
    let variable = |keys: &str| format!("scene = \"scene.toml\"\n[[variable]]\n{keys}");
    for (text, problem, remedy) in [
        (variable("name = \"sped\"\nvalues = [1]"), "no such variable", "Did you mean `speed`?"),
        (variable("name = \"torque\"\nvalues = [1]"), "computed", "inputs and parameters"),
        (variable("name = \"gap\"\nfield = \"contact[1].gapp\"\nvalues = [1]"), "no such key", "`contact.gap`"),
        (variable("name = \"gap\"\nfield = \"contact[2].gap\"\nvalues = [1]"), "no entry `contact[2]`", "`contact[1]`"),
        (variable("name = \"speed\""), "has no values", "values"),
        (variable("name = \"speed\"\nvalues = { from = 1, to = 2 }"), "count", "count"),
        (variable("name = \"seconds\"\nvalues = [1]"), "column of the results", "another name"),
        (variable("name = \"torque\"\nlabel = true\nvalues = [1]"), "name of an output", "another name"),
        (variable("name = \"threads\"\nvalues = [2]"), "one thread", "--threads"),
        (variable("name = \"speed\"\nvalues = [1]\nvalue = 3"), "unknown field", "Did you mean `values`?"),
        ("scene = \"scene.toml\"\ndesign = \"tabel\"".to_owned(), "unknown variant", "Did you mean `table`?"),
        ("scene = \"scene.toml\"\n[sett]\nspeed = 3".to_owned(), "unknown field", "Did you mean `set`?"),
        ("scene = \"scene.toml\"\n[set]\nsped = 3".to_owned(), "no such variable", "`speed`"),
        ("scene = \"scene.toml\"\ndesign = \"table\"".to_owned(), "missing", "runs.csv"),
        ("scene = \"scene.toml\"\ndesign = \"table\"\ntable = \"runs.csv\"".to_owned(), "no such variable", "`speed`"),
        (
            "scene = \"scene.toml\"\n[histories]\nevery = 0\noutputs = [\"torque\"]".to_owned(),
            "expected a whole number of 1 or more",
            "Correct the plan",
        ),
        (SCENE.to_owned(), "field `", "use `tiprub run`"),
        ("scene = \"scene.toml\"\n[histories]\noutputs = [\"torq\"]".to_owned(), "no such output", "`torque`"),
        ("scene = \"scene.toml\"\n[rom.rotr]\nfile = \"a\"".to_owned(), "no such structure", "`rotor`"),
        ("scene = \"scene.toml\"\n[rom.rotor]\nreduce = \"plate\"".to_owned(), "no such model", "spring"),
        ("scene = \"scene.toml\"\n[rom.rotor]\nfile = \"{modes}\"".to_owned(), "no such variable", "variables"),
        ("scene = \"none.toml\"".to_owned(), "cannot be read", ""),
    ] {
        let failure = bench.try_part(&text, "a.parquet", Part::WHOLE, 1).expect_err(&text);
        let shown = failure.to_string();
        assert!(failure.problem.contains(problem) && failure.remedy.contains(remedy), "{text}\n{shown}");
        assert!(shown.contains("plan.toml") || shown.contains("none.toml"), "{text}\n{shown}");
        assert!(!bench.files().iter().any(|name| name.starts_with("a.parquet")), "{:?}", bench.files());
    }
}

#[test]
fn stopped_sweep_keeps_its_rows() {
    let bench = Bench::new();
    let plan = bench.plan(GRID).unwrap();
    let (cache, console) = (RomCache::off(), Console::new(true, false));
    let request = |stop, output| SweepRequest {
        plan: &plan,
        part: Part::WHOLE,
        output,
        threads: 1,
        stop,
        sources: &bench,
        cache: &cache,
        console: &console,
    };
    let output = bench.path("a.parquet");
    let [stopping, running] = [true, false].map(AtomicBool::new);
    let stopped = engine::run(&request(&stopping, &output)).unwrap();
    assert!(!stopped.is_complete && stopped.finished == 0 && !output.exists());
    assert!(SweepFiles::new(&output).journal.exists());
    let size = engine::check(&request(&running, &output)).unwrap();
    assert_eq!((size.plan_runs, size.runs, size.pending), (6, 6, 6));
    assert!(engine::run(&request(&running, &output)).unwrap().is_complete);
}

/// A part without a finished run, or without any run, has the same columns as the other parts.
#[test]
fn part_with_only_rejected_runs_has_all_columns() {
    let bench = Bench::new();
    let plan = "scene = \"scene.toml\"\n[[variable]]\nname = \"friction_coefficient\"\nvalues = [-1.0, 0.1]";
    for number in [1, 2] {
        bench.try_part(plan, &format!("{number}.parquet"), Part::new(number, 2).unwrap(), 1).unwrap();
    }
    let [refused, finished] = ["1.parquet", "2.parquet"].map(|name| bench.table(name));
    assert_eq!(
        (texts(&refused, "status"), texts(&finished, "status")),
        (vec!["refused".into()], vec!["finished".into()])
    );
    let facts =
        |table: &Table| -> Vec<_> { table.columns.iter().map(|column| (column.name.clone(), column.kind)).collect() };
    assert_eq!(facts(&refused), facts(&finished));
    assert_eq!(texts(&refused, "friction_loss"), [""]);
    // The same part again, and a part without runs.
    bench.try_part(plan, "1.parquet", Part::new(1, 2).unwrap(), 1).unwrap();
    assert_eq!(bench.table("1.parquet"), refused);
    bench.try_part(plan, "none.parquet", Part::new(1, 3).unwrap(), 1).unwrap();
    let names = |table: &Table| -> Vec<_> { table.columns.iter().map(|column| column.name.clone()).collect() };
    assert_eq!(names(&bench.table("none.parquet")), names(&finished));
}

#[test]
fn names_and_keys_that_clash_are_rejected() {
    let bench = Bench::new();
    let gap =
        |name: &str, field: &str| format!("[[variable]]\nname = \"{name}\"\nfield = \"{field}\"\nvalues = [5e-4]\n");
    let scene = "scene = \"scene.toml\"\n";
    for (text, words) in [
        (gap("mean_torque", "contact[1].gap"), "name of an output or a result"),
        (gap("friction_loss", "contact[1].gap"), "name of an output or a result"),
        (gap("a", "contact[1].gap") + &gap("b", "contact.gap"), "`contact[1].gap`, which `a` also sets"),
        (
            "[[variable]]\nname = \"a\"\nfield = \"structure[rotor].rom\"\nvalues = [\"b.rom.safetensors\"]\n\
             [rom.rotor]\nfile = \"small.rom.safetensors\"\n"
                .to_owned(),
            "which `[rom]` also sets",
        ),
    ] {
        let failure = bench.try_part(&format!("{scene}{text}"), "a.parquet", Part::WHOLE, 1).unwrap_err();
        assert!(failure.usage && failure.to_string().contains(words), "{failure}");
    }
}
