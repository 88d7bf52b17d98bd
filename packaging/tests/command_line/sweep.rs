//! `tiprub sweep`, and `tiprub run --parquet`.

use std::{
    fs,
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use serde_json::Value;
use tiprub_table::{Cell, Table, parquet_file};

use crate::project::{Project, SCENE, columns};

/// A plan of 24 runs, one of which is refused.
const PLAN: &str = r#"
scene = "scene.toml"
stop = 3.0
[set]
damping_ratio = 0.02
[[variable]]
name = "friction_coefficient"
values = [0.0, 0.1, 0.2, -1.0]
[[variable]]
name = "gap"
field = "contact[1].gap"
values = { from = 5e-4, to = 2e-3, count = 6, spacing = "logarithmic" }
"#;

/// Columns that differ between equal runs.
const TIMES: [&str; 2] = ["seconds", "stepping_seconds"];

fn project() -> Project {
    let project = Project::new();
    fs::write(project.path("plan.toml"), PLAN).unwrap();
    project
}

#[test]
fn digests_are_checked_before_they_are_compared() {
    let project = project();
    for (digest, problem) in [("", "is not a digest"), ("12ab", "is not a digest"), (&"0".repeat(64), "differs")] {
        let message = project.fail(&["sweep", "plan.toml", "--digest", digest], if digest.len() == 64 { 1 } else { 2 });
        assert!(message.contains(problem), "{message}");
    }
    let check: Value = serde_json::from_str(&project.succeed(&["sweep", "plan.toml", "--check", "--json"])).unwrap();
    let digest = check["digest"].as_str().unwrap().to_uppercase();
    project.succeed(&["sweep", "plan.toml", "--part", "1/24", "--digest", &digest]);
}

/// Project whose runs are long enough to be killed in the middle of the sweep, also on a busy machine.
fn slow_project() -> Project {
    let project = Project::new();
    fs::write(project.path("plan.toml"), PLAN.replace("stop = 3.0", "stop = 12.0")).unwrap();
    project
}

/// Runs a sweep and returns its answer.
fn swept(project: &Project, arguments: &[&str]) -> Value {
    let all = [&["sweep", "plan.toml", "--json", "--quiet"], arguments].concat();
    serde_json::from_str(&project.succeed(&all)).unwrap()
}

/// Reads the results, without computing times.
fn table(project: &Project, name: &str) -> Table {
    let mut table = parquet_file::read(&project.path(name)).unwrap();
    table.columns.retain(|column| !TIMES.contains(&column.name.as_str()));
    table
}

fn texts(table: &Table, name: &str) -> Vec<String> {
    let cells = &table.column(name).unwrap_or_else(|| panic!("{name}")).cells;
    cells.iter().map(|cell| cell.as_ref().map_or_else(String::new, Cell::to_string)).collect()
}

fn command(project: &Project, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
    command.current_dir(project.root.path()).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Waits until the journal has this number of rows.
#[track_caller]
fn wait_for_rows(project: &Project, journal: &str, rows: usize) {
    let start = Instant::now();
    loop {
        let text = fs::read_to_string(project.path(journal)).unwrap_or_default();
        if text.lines().count() > rows {
            return;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "{text}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The program is killed twice in the middle, and continues each time.
#[test]
fn killed_sweep_resumes_and_gives_the_same_rows() {
    let project = slow_project();
    let answer = swept(&project, &["-o", "undisturbed.parquet"]);
    let numbers = ["plan_runs", "runs", "finished", "refused", "failed", "finished_before"];
    assert_eq!(numbers.map(|name| answer[name].as_u64().unwrap()), [24, 24, 18, 6, 0, 0]);
    let undisturbed = table(&project, "undisturbed.parquet");
    for rows in [3, 9] {
        let arguments = ["sweep", "plan.toml", "-o", "killed.parquet", "--threads", "2"];
        let mut child = command(&project, &arguments).spawn().unwrap();
        wait_for_rows(&project, "killed.parquet.journal", rows);
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(!project.path("killed.parquet").exists());
    }
    // A line that was cut.
    let journal = project.path("killed.parquet.journal");
    let bytes = fs::read(&journal).unwrap();
    fs::write(&journal, &bytes[..bytes.len() - 7]).unwrap();
    let answer = swept(&project, &["-o", "killed.parquet"]);
    let before = answer["finished_before"].as_u64().unwrap();
    assert!((8..24).contains(&before), "{answer}");
    assert_eq!(table(&project, "killed.parquet"), undisturbed);
    assert!(!project.files().iter().any(|name| name.ends_with("journal")), "{:?}", project.files());
    assert_eq!(swept(&project, &["-o", "killed.parquet"])["finished_before"], 24);
}

#[test]
fn parts_join_to_the_whole_table() {
    let project = project();
    swept(&project, &[]);
    let whole = table(&project, "plan.parquet");
    assert_eq!(texts(&whole, "run"), (1..=24).map(|run| run.to_string()).collect::<Vec<_>>());
    let mut joined = Table::default();
    for part in 1..=3 {
        let answer = swept(&project, &["--part", &format!("{part}/3")]);
        assert_eq!((answer["plan_runs"].as_u64(), answer["runs"].as_u64()), (Some(24), Some(8)));
        let part = table(&project, &format!("plan-{part}-of-3.parquet"));
        if joined.columns.is_empty() {
            joined = part;
            continue;
        }
        for column in part.columns {
            let same = joined.columns.iter_mut().find(|other| other.name == column.name);
            same.unwrap_or_else(|| panic!("{}", column.name)).cells.extend(column.cells);
        }
    }
    // The last part has other rows without results, but the same columns.
    assert_eq!(joined, whole);
    let status = texts(&whole, "status");
    assert_eq!(status.iter().filter(|status| *status == "refused").count(), 6);
    assert!(texts(&whole, "reason")[23].contains("friction_coefficient"), "{:?}", texts(&whole, "reason"));
    let (forces, heat) = (texts(&whole, "mean_total_normal_force"), texts(&whole, "friction_loss"));
    assert!(forces[..6].iter().any(|force| force.parse::<f64>().unwrap() > 0.0), "{forces:?}");
    assert!(heat[6].parse::<f64>().unwrap() > 0.0, "{heat:?}");
}

/// Rows of a sweep are the results of `tiprub run`.
#[test]
fn row_equals_the_single_run() {
    let project = project();
    let plan =
        "scene = \"scene.toml\"\n[[variable]]\nname = \"speed\"\nvalues = [90.0]\n[histories]\noutputs = [\"torque\"]";
    fs::write(project.path("plan.toml"), plan).unwrap();
    swept(&project, &[]);
    let row = table(&project, "plan.parquet");
    let arguments =
        ["run", "scene.toml", "--set", "speed=90", "--parquet", "run.parquet", "--csv", "run.csv", "--json"];
    let run: Value = serde_json::from_str(&project.succeed(&arguments)).unwrap();
    let number = |name: &str| texts(&row, name)[0].parse::<f64>().unwrap();
    for (name, value) in [
        ("largest_total_normal_force", &run["extremes"]["largest_total_normal_force"]["value"]),
        ("smallest_clearance_time", &run["extremes"]["smallest_clearance"]["time"]),
        ("mean_torque", &run["means"]["mean_torque"]),
        ("mean_friction_power", &run["means"]["mean_friction_power"]),
        ("friction_loss", &run["totals"]["friction_loss"]),
        ("internal_steps", &run["internal_steps"]),
    ] {
        let value = value.as_f64().unwrap_or_else(|| panic!("{name}"));
        assert!((number(name) - value).abs() <= 1e-14 * value.abs(), "{name}: {} {value}", number(name));
    }
    assert_eq!(run["parameters"]["speed"], 90.0);
    assert_eq!(run["parameters"]["solver"], "lcp");
    // Both files of a run have the same numbers, and so has the history of a sweep.
    let (names, rows) = columns(&fs::read_to_string(project.path("run.csv")).unwrap());
    let written = parquet_file::read(&project.path("run.parquet")).unwrap();
    assert_eq!(written.columns.iter().map(|column| column.name.clone()).collect::<Vec<_>>(), names);
    for (index, column) in written.columns.iter().enumerate() {
        let values: Vec<_> = rows.iter().map(|row| Some(Cell::Real(row[index]))).collect();
        assert_eq!(column.cells, values, "{}", column.name);
    }
    let history = parquet_file::read(&project.path("plan.histories.parquet")).unwrap();
    assert_eq!(history.column("torque").unwrap().cells, written.column("torque").unwrap().cells);
}

#[test]
#[cfg(unix)]
fn interrupted_sweep_reports_how_to_continue() {
    let project = slow_project();
    let child = command(&project, &["sweep", "plan.toml", "--threads", "1"]).spawn().unwrap();
    wait_for_rows(&project, "plan.parquet.journal", 2);
    let number = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &number]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("interrupted after") && stderr.contains("plan.parquet.journal"), "{stderr}");
    assert!(stderr.contains("Run the same command again"), "{stderr}");
    assert!(swept(&project, &[])["finished_before"].as_u64().unwrap() >= 2);
}

#[test]
fn fmus_and_scenes_give_the_same_rows() {
    let project = project();
    project.succeed(&["package", "scene.toml", "--fmi", "3", "--library", "library.so", "-o", "small.fmu"]);
    let plan = "scene = \"scene.toml\"\n[[variable]]\nname = \"speed\"\nvalues = [90.0, 100.0]";
    let rows = ["scene.toml", "small.fmu"].map(|scene| {
        fs::write(project.path("plan.toml"), plan.replace("scene.toml", scene)).unwrap();
        swept(&project, &["-o", &format!("{scene}.parquet")]);
        let mut table = table(&project, &format!("{scene}.parquet"));
        table.columns.retain(|column| column.name != "digest");
        table
    });
    assert_eq!(rows[0], rows[1]);
}

#[test]
fn unknown_names_end_the_sweep_before_any_run() {
    let project = project();
    for (from, to, words) in [
        ("friction_coefficient", "friction_coeficient", "Did you mean `friction_coefficient`?"),
        ("contact[1].gap", "contact[1].gaap", "Did you mean `contact.gap`?"),
        ("damping_ratio", "dampin_ratio", "Did you mean `damping_ratio`?"),
        ("stop =", "stopp =", "unknown field `stopp`"),
    ] {
        fs::write(project.path("plan.toml"), PLAN.replacen(from, to, 1)).unwrap();
        let error = project.fail(&["sweep", "plan.toml"], 2);
        assert!(error.contains("plan.toml") && error.contains(words), "{error}");
        assert!(!project.files().iter().any(|name| name.starts_with("plan.parquet")), "{:?}", project.files());
    }
    assert!(project.fail(&["sweep", "plan.toml", "--part", "4/3"], 2).contains("NUMBER/COUNT"));
    assert!(project.fail(&["sweep", "none.toml"], 1).contains("none.toml"));
    fs::write(project.path("plan.toml"), PLAN).unwrap();
    let files = project.files();
    assert_eq!(swept(&project, &["--check", "--part", "2/5"])["runs"], 5);
    assert_eq!(project.files(), files, "a check leaves no files");
    let error = project.fail(&["sweep", "plan.toml", "-o", "scene.toml"], 2);
    assert!(error.contains("same file as a file of the plan"), "{error}");
}

/// The step is slightly too long for the modes, which causes warnings in most runs.
#[test]
fn summary_counts_runs_with_warnings() {
    let project = project();
    let coarse = SCENE.replace("step = 1e-4", "step = 2.05e-3").replace("step = 1e-3", "step = 4.1e-3");
    fs::write(project.path("scene.toml"), coarse).unwrap();
    let text = project.succeed(&["sweep", "plan.toml", "--quiet"]);
    let table = table(&project, "plan.parquet");
    let warnings = texts(&table, "warnings");
    let count = warnings.iter().filter(|topics| !topics.is_empty()).count();
    assert!(count >= 18, "{warnings:?}");
    let line = text.lines().find(|line| line.starts_with(&format!("{count} runs with warnings or notes: ")));
    let line = line.unwrap_or_else(|| panic!("{count}: {text}"));
    // The second sweep only reads the rows of the finished file.
    let answer = swept(&project, &[]);
    assert_eq!(answer["runs_with_warnings"], count);
    let topics = answer["warning_counts"].as_array().unwrap();
    assert!(topics.len() > 1, "{answer}");
    for topic in topics {
        let id = topic["id"].as_str().unwrap();
        let runs = warnings.iter().filter(|topics| topics.split(", ").any(|topic| topic == id)).count();
        let first = warnings.iter().position(|topics| topics.split(", ").any(|topic| topic == id)).unwrap();
        assert_eq!((&topic["runs"], &topic["first_run"]), (&runs.into(), &(first + 1).into()), "{id}");
        assert!(line.contains(&format!("{id} in {runs}")), "{line}");
    }
}

/// The results are written even so. A part succeeds, because workflow managers repeat a part that failed.
#[test]
fn sweep_without_a_finished_run_fails() {
    let project = project();
    fs::write(project.path("plan.toml"), PLAN.replace("[0.0, 0.1, 0.2, -1.0]", "[-1.0]")).unwrap();
    for arguments in [&["sweep", "plan.toml"][..], &["sweep", "plan.toml", "--json"]] {
        let output = project.run(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        assert!(stderr.contains("error: plan.toml: no run finished. ") && stderr.contains("plan.parquet"), "{stderr}");
        let stdout = String::from_utf8(output.stdout).unwrap();
        if arguments.contains(&"--json") {
            let answer: Value = serde_json::from_str(&stdout).unwrap();
            assert_eq!((&answer["refused"], &answer["error"]["exit_code"]), (&6.into(), &1.into()), "{answer}");
            assert_eq!(answer["error"]["problem"], "no run finished");
        } else {
            assert!(stdout.starts_with("6 runs: 0 finished, 6 refused, 0 failed\n"), "{stdout}");
        }
    }
    assert_eq!(texts(&table(&project, "plan.parquet"), "status"), ["refused"; 6]);
    let answer = swept(&project, &["--part", "1/6"]);
    assert!(answer["refused"] == 1 && answer.get("error").is_none(), "{answer}");
    assert!(
        project
            .succeed(&["sweep", "plan.toml", "--part", "2/6"])
            .starts_with("1 run (part 2/6 of a plan with 6 runs): 0 finished")
    );
}

#[test]
fn rejects_names_of_other_table_formats_for_results() {
    let project = project();
    for (arguments, problem) in [
        (
            &["sweep", "plan.toml", "-o", "x.csv"][..],
            "--output x.csv: would contain Parquet, but its name ends in .csv",
        ),
        (
            &["run", "scene.toml", "--parquet", "x.CSV"],
            "--parquet x.CSV: would contain Parquet, but its name ends in .csv",
        ),
        (
            &["run", "scene.toml", "--parquet", "x.vtu"],
            "--parquet x.vtu: would contain Parquet, but its name ends in .vtu",
        ),
        (
            &["run", "scene.toml", "--csv", "x.parquet"],
            "--csv x.parquet: would contain CSV, but its name ends in .parquet",
        ),
    ] {
        let error = project.fail(arguments, 2);
        assert!(error.contains(problem), "{error}");
        assert!(error.contains("--csv for") || error.contains("--parquet for") || error.contains("ends in .parquet"));
    }
    let error = project.fail(&["sweep", "x.parquet"], 2);
    assert!(error.contains("x.parquet: is a table of results, not a plan"), "{error}");
    assert!(!project.files().iter().any(|name| name.starts_with("x.")), "{:?}", project.files());
}

#[test]
fn suggestion_ends_with_a_question_mark() {
    let project = project();
    fs::write(project.path("runs.csv"), "sped\n90\n").unwrap();
    let plan = "scene = \"scene.toml\"\ndesign = \"table\"\ntable = \"runs.csv\"\n";
    fs::write(project.path("plan.toml"), plan).unwrap();
    let error = project.fail(&["sweep", "plan.toml"], 2);
    assert!(error.contains("Did you mean `speed`? If the column only describes the runs"), "{error}");
}

#[test]
fn digest_covers_the_files_of_a_plan() {
    let project = project();
    let digest = || swept(&project, &["--check"])["digest"].as_str().unwrap().to_owned();
    let first = digest();
    assert_eq!(digest(), first);
    for name in ["plan.toml", "scene.toml", "small.rom.safetensors"] {
        let before = fs::read(project.path(name)).unwrap();
        fs::write(project.path(name), [&before[..], b"\n"].concat()).unwrap();
        assert_ne!(digest(), first, "{name}");
        let error = project.fail(&["sweep", "plan.toml", "--digest", &first], 1);
        assert!(error.contains("differs from those of the digest"), "{name}: {error}");
        assert!(!project.files().iter().any(|name| name.contains("parquet")), "nothing was run");
        fs::write(project.path(name), before).unwrap();
    }
    // A model of a run other than the first.
    fs::copy(project.path("small.rom.safetensors"), project.path("b.rom.safetensors")).unwrap();
    fs::copy(project.path("small.rom.safetensors"), project.path("a.rom.safetensors")).unwrap();
    let models =
        "\n[[variable]]\nname = \"model\"\nvalues = [\"a\", \"b\"]\n[rom.rotor]\nfile = \"{model}.rom.safetensors\"\n";
    fs::write(project.path("plan.toml"), format!("{PLAN}{models}")).unwrap();
    let first = digest();
    fs::write(project.path("b.rom.safetensors"), "other").unwrap();
    assert_ne!(digest(), first);
    fs::write(project.path("plan.toml"), PLAN).unwrap();
    let first = digest();
    assert_eq!(swept(&project, &["--digest", &first, "--part", "1/24"])["finished"], 1);
}
