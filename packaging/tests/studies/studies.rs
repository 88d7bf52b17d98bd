//! `tiprub study` in its quick forms, and the cache of built-in models behind it.

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use serde_json::{Value, json};

pub(super) fn tiprub(directory: &Path, cache: &str, arguments: &[&str]) -> (String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
    let output = command.current_dir(directory).env("TIPRUB_CACHE", cache).args(arguments).output().unwrap();
    let [stdout, stderr] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {stderr}");
    (stdout, stderr)
}

/// Checks that exactly these statements are answered with no.
#[track_caller]
pub(super) fn assert_only_no(json: &Value, no: &[&str]) {
    let statements = json["statements"].as_array().unwrap();
    let begins = |start: &&str| statements.iter().any(|one| one["expected"].as_str().unwrap().starts_with(*start));
    assert!(no.iter().all(begins), "{no:?} of {statements:#?}");
    for statement in statements {
        let holds = !no.iter().any(|start| statement["expected"].as_str().unwrap().starts_with(start));
        assert_ne!(statement["holds"], Value::Bool(!holds), "{statement:#}");
    }
}

pub(super) fn columns(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',').map(String::from).collect();
    (names, lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect())
}

/// The branch of engine order 4 extends far above its crossing with the first mode. Linear theory does not predict it, and the motion contains other
/// orders than the multiples of the two lobes of the casing and is not completely steady: three statements are answered with no.
#[test]
fn quick_interaction_map_shows_the_leaning_branch() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("scene.toml"), scene_with_blade("builtin:rotor37-paper")).unwrap();
    let arguments = ["study", "map", "scene.toml", "--quick", "--json", "--quiet", "--out", "out"];
    let (stdout, _) = tiprub(root.path(), env!("CARGO_TARGET_TMPDIR"), &arguments);
    let json: Value = serde_json::from_str(&stdout).unwrap();
    let no =
        ["The response repeats", "The largest response lies at a predicted", "The effective displacement is steady"];
    assert_only_no(&json, &no);
    let number = |value: &Value, name: &str| value[name].as_f64().unwrap();
    let results = &json["results"];
    let speeds: Vec<f64> = results["speeds"].as_array().unwrap().iter().map(|speed| speed.as_f64().unwrap()).collect();
    let coincidences = results["coincidences"].as_array().unwrap();
    let first = coincidences.iter().find(|one| one["engine_order"] == 4 && one["mode"] == 1).unwrap();
    // f = 865.22 Hz of the blade (`reduce rotor37 --contact-nodes 3`), excited four times per revolution.
    let predicted = number(first, "predicted_speed");
    assert!((4.0 * predicted / std::f64::consts::TAU - 865.22).abs() < 0.01, "{first:#}");
    assert!(speeds[0] < 0.81 * predicted && *speeds.last().unwrap() > 1.4 * predicted, "{speeds:?}");
    assert!(number(first, "relative_shift") > 0.05 && number(first, "relative_shift") < 0.25, "{first:#}");
    let amplitude = number(first, "response_amplitude");
    assert!((1e-3..5e-3).contains(&amplitude), "{first:#}");
    // Neighbouring crossings of the same order divide the range: no speed belongs to two of them.
    for pair in coincidences.iter().flat_map(|a| coincidences.iter().map(move |b| (a, b))) {
        let (a, b) = pair;
        if a["engine_order"] == b["engine_order"] && number(a, "predicted_speed") < number(b, "predicted_speed") {
            assert!(number(a, "sought_to") <= number(b, "sought_from") * (1.0 + 1e-12), "{a:#}\n{b:#}");
        }
    }
    let peaks = results["peaks"].as_array().unwrap();
    let largest = peaks.iter().max_by(|a, b| number(a, "amplitude").total_cmp(&number(b, "amplitude"))).unwrap();
    assert!((number(largest, "engine_order") - 4.0).abs() < 1.0 / 16.0, "{largest:#}");
    assert!(number(largest, "speed") > 1.05 * predicted, "{largest:#}");
    // Engine order 4 grows up to the top of the branch, and decreases behind it.
    let (names, rows) = columns(&root.path().join("out/amplitudes.csv"));
    assert!(names[3].starts_with("engine order 4"), "{names:?}");
    let top = rows.iter().position(|row| row[0].to_bits() == number(largest, "speed").to_bits()).unwrap();
    assert!(rows[top + 1][3] < 0.5 * rows[top][3] && rows[top - 1][3] < 0.7 * rows[top][3], "{rows:?}");
    for (row, force) in rows.iter().zip(columns(&root.path().join("out/normal-force.csv")).1) {
        assert!(force[1].to_bits() == row[7].to_bits() && force[1] > 1.0, "{row:?} {force:?}");
        assert!((0.01..0.5).contains(&row[6]), "{row:?}");
    }
}

/// Arguments of a small map.
const MAP: [&str; 11] = [
    "study",
    "map",
    "builtin:rotor37-paper",
    "--speeds",
    "1300:1500:8",
    "--revolutions",
    "4",
    "--transient",
    "3",
    "--json",
    "--quiet",
];

/// Kills a study when its journal has at least two results, and returns their number.
#[track_caller]
fn killed_after_two(directory: &Path, journal: &Path, arguments: &[&str]) -> usize {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
    command.current_dir(directory).env("TIPRUB_CACHE", env!("CARGO_TARGET_TMPDIR")).args(arguments);
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let results = || fs::read_to_string(journal).map_or(0, |text| text.lines().count().saturating_sub(1));
    let begun = Instant::now();
    while results() < 2 {
        assert!(begun.elapsed() < Duration::from_secs(60) && child.try_wait().unwrap().is_none());
        thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    results()
}

#[test]
fn killed_stability_study_continues() {
    let root = tempfile::tempdir().unwrap();
    let study = ["study", "stability", "builtin:rotor37-paper", "--quick", "--threads", "1", "--out"];
    let cache = env!("CARGO_TARGET_TMPDIR");
    tiprub(root.path(), cache, &[&study[..], &["whole"]].concat());
    let journal = root.path().join("killed/stability.journal");
    let kept = killed_after_two(root.path(), &journal, &[&study[..], &["killed"]].concat());
    let (_, messages) = tiprub(root.path(), cache, &[&study[..], &["killed"]].concat());
    assert!(messages.contains(&format!("{kept} of")) && messages.contains("are already finished"), "{messages}");
    let page = |out: &str| fs::read_to_string(root.path().join(out).join("index.html")).unwrap();
    assert!(page("killed") == page("whole") && !journal.exists());
}

/// A killed map that continues, and a map of several parts, have the same numbers as an uninterrupted map.
#[test]
fn killed_map_continues_and_parts_are_combined() {
    let root = tempfile::tempdir().unwrap();
    let cache = env!("CARGO_TARGET_TMPDIR");
    let map = |more: &[&str]| -> Value {
        let (stdout, _) = tiprub(root.path(), cache, &[&MAP[..], more].concat());
        serde_json::from_str(&stdout).unwrap()
    };
    let numbers = |out: &str| fs::read(root.path().join(out).join("map.csv")).unwrap();
    map(&["--out", "whole"]);
    let journal = root.path().join("killed/map.journal");
    let kept = killed_after_two(root.path(), &journal, &[&MAP[..], &["--out", "killed", "--threads", "1"]].concat());
    assert!((2..8).contains(&kept), "{kept}");
    let (_, messages) = tiprub(root.path(), cache, &[&MAP[..10], &["--out", "killed"]].concat());
    assert!(messages.contains(&format!("{kept} of 8 runs are already finished")), "{messages}");
    assert!(numbers("killed") == numbers("whole") && !journal.exists());
    for part in ["1/3", "3/3"] {
        let answer = map(&["--out", "parts", "--part", part]);
        assert_eq!((answer["part"].as_str(), answer["all_runs"].as_u64()), (Some(part), Some(8)));
        assert!(!root.path().join("parts/index.html").exists());
    }
    // Other options do not use the results of the parts, and do not remove them.
    let mut other = Command::new(env!("CARGO_BIN_EXE_tiprub"));
    other.current_dir(root.path()).env("TIPRUB_CACHE", cache).args(MAP).args([
        "--out",
        "parts",
        "--set",
        "gap_offset=1e-5",
    ]);
    let refused = other.output().unwrap();
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stdout).contains("other options"), "{refused:?}");
    map(&["--out", "parts"]);
    assert_eq!(numbers("parts"), numbers("whole"));
    let files: Vec<_> = fs::read_dir(root.path().join("parts")).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(!files.iter().any(|path| path.extension().is_some_and(|kind| kind == "journal")), "{files:?}");
}

/// Reports the cheapest setting for a scene, and two schemes that agree.
#[test]
fn quick_error_study_accepts_any_scene() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("scene.toml"), scene_with_blade("builtin:rotor37-paper")).unwrap();
    // Contact nodes do not define the width of the tip.
    let coated = with_rom("abradable", "builtin:rotor37-paper");
    let coated = coated.replace("\n[time]", "contact_width = 3e-3\n\n[time]");
    fs::write(root.path().join("coated.toml"), coated).unwrap();
    for (scene, more) in [("scene.toml", ["--window", "2e-3"]), ("coated.toml", ["--set", "friction_coefficient=0.1"])]
    {
        let arguments = ["study", "error", scene, "--quick", "--json", "--quiet", "--out", "out"];
        let (stdout, _) = tiprub(root.path(), env!("CARGO_TARGET_TMPDIR"), &[&arguments[..], &more].concat());
        let json: Value = serde_json::from_str(&stdout).unwrap();
        assert_only_no(&json, &[]);
        let found = &json["results"]["scenes"][0];
        let rows = found["rows"].as_array().unwrap();
        assert_eq!(rows.len(), 9 * 4 + 4, "every scheme and solver at every step, and four tolerances");
        // The scene's own step is among them, in spite of the rounding of 10 µs / 1 µs.
        let own = |row: &&Value| row["internal_step"].as_f64().is_some_and(|step| (step / 1e-6 - 1.0).abs() < 1e-9);
        assert_eq!(rows.iter().filter(own).count(), 9, "{found:#}");
        // Half the step gives about half the error or less.
        let errors: Vec<f64> = rows
            .iter()
            .filter(|row| row["competitor"] == "modal-exact + lcp")
            .map(|row| row["error_of_steps"].as_f64().unwrap())
            .collect();
        assert!(errors.len() == 4 && errors[3] < 0.6 * errors[1], "{errors:?}");
        let table = fs::read_to_string(root.path().join("out/tables.md")).unwrap();
        assert!(table.contains("| 1e-2 |") && table.contains("| modal-exact + lcp |"), "{table}");
        totals(&json["results"]["total"], &fs::read_to_string(root.path().join("out/cheapest.csv")).unwrap());
    }
}

/// The study refines its tolerance, beside the steps of other schemes; each is compared with the limit of its own equations.
#[test]
fn error_study_supports_adaptive_scenes() {
    let root = tempfile::tempdir().unwrap();
    let scene = scene_with_blade("builtin:rotor37-paper")
        .replace("step = 1.0e-6 ", "step = 8.0e-5 ")
        .replace("\"modal-exact\"", "\"galerkin\"\ntolerance = 1e-3");
    fs::write(root.path().join("scene.toml"), scene).unwrap();
    let run = |arguments: &[&str]| -> Value {
        let all = [arguments, &["--json", "--quiet"]].concat();
        serde_json::from_str(&tiprub(root.path(), env!("CARGO_TARGET_TMPDIR"), &all).0).unwrap()
    };
    let json = run(&["study", "error", "scene.toml", "--quick", "--window", "1.5e-3", "--out", "out"]);
    assert_only_no(&json, &[]);
    let found = &json["results"]["scenes"][0];
    let rows = found["rows"].as_array().unwrap();
    let errors = |name: &str, which: &str| -> Vec<f64> {
        rows.iter().filter(|row| row["competitor"] == name).filter_map(|row| row[which].as_f64()).collect()
    };
    // The limits with and without mass are far apart, and neither scheme is blamed for this.
    let away = found["massless_boundary_away"][0].as_f64().unwrap();
    let (own, plain) = (errors("galerkin", "error_of_own_limit"), errors("galerkin", "error_of_steps"));
    assert!(own.len() == 4 && own[0] < 2e-2 && own[3] < 1e-4 && own[3] < 0.1 * own[0], "{own:?}");
    assert!(away > 1e-3 && (plain[3] / away - 1.0).abs() < 0.05, "{away} {plain:?}");
    assert!(found["massless_apart"][0].as_f64().unwrap() < 2e-3, "{found:#}");
    let massless = errors("massless-boundary + lcp", "error_of_own_limit");
    assert!(massless.last().is_some_and(|error| *error < 0.2 * away), "{massless:?}");
    for cheapest in found["cheapest"].as_array().unwrap().iter().filter(|one| one["seconds"].is_number()) {
        assert!(cheapest["error_of_steps"].as_f64() <= cheapest["error"].as_f64(), "{cheapest:#}");
    }
    let total = &json["results"]["total"]["rows"];
    assert_eq!(total.as_array().unwrap().iter().filter(|row| row["own"] == true).count(), 1, "{total:#}");
    // The convergence study and the estimate of a run refine the tolerance.
    let json = run(&["study", "convergence", "scene.toml", "--quick", "--window", "1.5e-3", "--out", "out"]);
    let levels = json["results"]["directions"][0]["levels"].as_array().unwrap();
    let values: Vec<f64> = levels.iter().map(|level| level["value"].as_f64().unwrap()).collect();
    assert!(values.iter().zip([1e-2, 1e-3, 1e-4]).all(|(found, own)| (found / own - 1.0).abs() < 1e-9), "{values:?}");
    let changes = [0, 1].map(|level: usize| levels[level]["changes_to_next"]["displacements"].as_f64().unwrap());
    assert!(changes[1] < changes[0] && (1e-5..2e-2).contains(&changes[0]), "{changes:?}");
    let json = run(&["run", "scene.toml", "--stop", "1.5e-3", "--estimate"]);
    // A tolerance on the command line is refined like that of the scene. Without further runs, the error of other rubs stands in.
    let looser = run(&["run", "scene.toml", "--stop", "1.5e-3", "--estimate", "--set", "tolerance=1e-2"]);
    let other = run(&["run", "scene.toml", "--stop", "1e-4", "--set", "tolerance=2e-3"]);
    let [own, looser, other] = [&json, &looser, &other].map(|json| json["estimated_errors"]["steps"].clone());
    let [error, larger] = [&own, &looser].map(|steps| steps["displacements"].as_f64().unwrap());
    assert!((1e-6..1e-2).contains(&error) && error < larger && own["found_on"].is_null(), "{own:#} {looser:#}");
    assert_eq!(other["displacements"], 2e-3);
    assert!(other["found_on"].as_str().unwrap().starts_with("rubs of rotor 37"), "{other:#}");
    let per_step = &json["milliseconds_per_communication_step"];
    assert!(per_step["most"].as_f64() >= per_step["mean"].as_f64() && json["missed_steps"] == 0, "{json:#}");
    assert!(json["internal_trials"].as_u64() >= json["internal_steps"].as_u64(), "{json:#}");
}

/// Checks total errors of the model of the scene and of one with half of its modes, against one with twice as many and more nodes.
fn totals(total: &Value, cheapest: &str) {
    let number = |row: &Value, name: &str| row[name].as_f64().unwrap();
    assert!(total["truth"].as_str().unwrap().starts_with("5 nodes and 40 modes"), "{total:#}");
    assert_eq!(
        [&total["refined"], &total["not_refined"]],
        [&json!(["steps", "modes", "nodes"]), &json!(["mesh"])],
        "{total:#}"
    );
    // The built-in model carries its known errors.
    let known = &total["estimates_of_rom"];
    assert!(known["patches"]["displacements"] == 0.34 && known["mesh"]["unknown"].is_string(), "{known:#}");
    assert!(known["modes"]["found_on"].as_str().unwrap().contains("light rub of rotor 37"), "{known:#}");
    let rows = total["rows"].as_array().unwrap();
    let ran: Vec<&Value> = rows.iter().filter(|row| row["refused"].is_null()).collect();
    let of = |modes: u64| {
        let own = |row: &&&Value| row["competitor"] == "modal-exact + lcp" && number(row, "internal_step") < 1.1e-6;
        let found = ran.iter().filter(own).find(|row| row["modes"] == modes);
        number(found.unwrap_or_else(|| panic!("{total:#}")), "total_error")
    };
    assert!(of(20) < of(10) && of(20) > 1e-2, "fewer modes are worse, and so are three nodes: {total:#}");
    assert!(ran.iter().all(|row| number(row, "seconds") > 0.0), "{total:#}");
    assert_eq!(ran.iter().filter(|row| row["own"] == true).count(), 1);
    // The cheapest setting is the fastest of those that are accurate enough.
    let own = &total["cheapest"][0];
    let good = ran.iter().filter(|row| number(row, "total_error") <= number(own, "error"));
    let best = good.map(|row| number(row, "seconds")).fold(f64::INFINITY, f64::min);
    let hidden = total["readable"].as_f64().is_some_and(|least| number(own, "error") < least);
    assert!(hidden || best.is_infinite() || own["setting"]["seconds"] == best, "{own:#}");
    let lines: Vec<&str> = cheapest.lines().collect();
    assert!(
        lines.len() == 8 && lines[1].starts_with("steps,0.1,") && lines[5].starts_with("total,1e-1,"),
        "{cheapest}"
    );
}

/// Checks the errors of a scene with a ROM from a file. Without a finer model of the ROM, no error is called total, and the errors that the
/// ROM contains are also reported.
pub(super) fn check_errors_of_a_file(root: &Path, reported: &str) {
    let json: Value = serde_json::from_str(reported).unwrap();
    let of = &json["results"]["own_model"];
    assert_eq!([&of["refined"], &of["not_refined"]], [&json!(["steps"]), &json!(["modes", "nodes", "mesh"])], "{of:#}");
    assert!(of["truth"].as_str().unwrap().contains("the model of the scene") && of["readable"].is_null(), "{of:#}");
    assert!(of["estimates_of_rom"]["modes"]["displacements"].is_number(), "{of:#}");
    let statement = |about: &str| {
        let all = json["statements"].as_array().unwrap();
        let found = all.iter().find(|one| one["expected"].as_str().unwrap().contains(about));
        found.unwrap_or_else(|| panic!("{about}: {all:#?}"))["found"].as_str().unwrap().to_owned()
    };
    statement("error of the steps alone of the scene as it stands (refined: steps; not refined: modes, nodes, mesh)");
    assert!(statement("errors stored in the ROM").contains("from the ROM, for rotor37_rub"));
    for name in ["index.html", "results.json", "cheapest.csv", "own-model.csv", "tables.md"] {
        let text = fs::read_to_string(root.join("study-error").join(name)).unwrap().to_lowercase();
        assert!(!text.contains("total"), "{name}: {:?}", text.split("total").next().unwrap().lines().last());
    }
    assert!(
        fs::read_to_string(root.join("study-error/scene-own-model.svg")).unwrap().contains("error of the steps alone")
    );
}

/// Writes a user scene around a coarse blade.
pub(super) fn write_user_scene(root: &Path) {
    let reduce = ["reduce", "rotor37", "--mesh", "6x1x8", "--modes", "4", "--contact-nodes", "2", "--quiet"];
    tiprub(root, "", &[&reduce[..], &["-o", "coarse.rom.safetensors", "--inp", "blade.inp"]].concat());
    fs::write(root.join("own.toml"), scene_with_blade("coarse.rom.safetensors")).unwrap();
}

/// Returns the built-in scene around another blade with few contact nodes, for which longer steps are sufficient.
pub(super) fn scene_with_blade(rom: &str) -> String {
    with_rom("rotor37-one-row", rom)
}

pub(super) fn with_rom(scene: &str, rom: &str) -> String {
    let (_, shipped) = tiprub_gallery::scene_source::BUILTIN_SCENES.iter().find(|(name, _)| *name == scene).unwrap();
    assert!(shipped.contains("step = 5.0e-7 "));
    shipped.replace("builtin:rotor37-one-row", rom).replace("step = 5.0e-7 ", "step = 1.0e-6 ")
}

/// Reported immediately: no model is reduced, and no directory is created.
#[test]
fn rejects_unsupported_studies_before_running() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("file"), "").unwrap();
    let refuse = |arguments: &[&str], code: i32| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        let output = command.current_dir(root.path()).env("TIPRUB_CACHE", "").args(arguments).output().unwrap();
        let reported = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{reported}");
        assert!(!reported.contains("Reducing"), "{reported}");
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1, "something stays");
        reported
    };
    for name in ["map", "error", "stability", "convergence"] {
        let reported = refuse(&["study", name, "builtin:rotor37", "--quick", "--out", "file/out"], 1);
        assert!(reported.contains("file/out: cannot create the directory"), "{reported}");
    }
    let reported = refuse(&["study", "convergence", "builtin:rotor37", "--quick", "--into", "file/at.rom"], 1);
    assert!(reported.contains("file: cannot create the directory"), "{reported}");
    let reported = refuse(&["study", "map", "builtin:cube-between-rings"], 2);
    assert!(reported.contains("`cube` is a free body") && reported.contains("rotating master"), "{reported}");
    assert!(refuse(&["study", "tip"], 2).contains("Choose `map`, `error`"));
    let reported = refuse(&["study", "error", "builtin:rotor37", "--set", "scheme=film"], 2);
    assert!(reported.contains("--set scheme: the study varies this setting itself"), "{reported}");
}

#[test]
fn built_in_models_are_cached_unless_disabled() {
    let root = tempfile::tempdir().unwrap();
    let kept = root.path().join("kept");
    let kept = kept.to_str().unwrap();
    fs::write(root.path().join("scene.toml"), scene_with_blade("builtin:rotor37-paper")).unwrap();
    let run = |cache: &str, more: &[&str]| {
        tiprub(root.path(), cache, &[&["run", "scene.toml", "--stop", "1e-4", "--csv", "out.csv"], more].concat()).1
    };
    assert!(run(kept, &[]).contains("Reducing"));
    let first = fs::read(root.path().join("out.csv")).unwrap();
    let again = run(kept, &[]);
    assert!(again.contains("Using the cached model") && !again.contains("Reducing"), "{again}");
    assert_eq!(fs::read(root.path().join("out.csv")).unwrap(), first, "a kept model gives the same bits");
    assert!(run(kept, &["--no-cache"]).contains("Reducing"));
    assert!(run("", &[]).contains("Reducing"), "an empty TIPRUB_CACHE keeps nothing");
    let damage = |extension: &str| {
        let files: Vec<_> = fs::read_dir(kept).unwrap().map(|entry| entry.unwrap().path()).collect();
        let file = files.iter().find(|path| path.extension().is_some_and(|ending| ending == extension)).unwrap();
        let mut bytes = fs::read(file).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        fs::write(file, bytes).unwrap();
    };
    damage("rom");
    let repaired = run(kept, &[]);
    assert!(repaired.contains("is damaged; reducing the model again") && repaired.contains("Reducing"), "{repaired}");
    assert_eq!(fs::read(root.path().join("out.csv")).unwrap(), first);
    damage("checks");
    let checked_again = run(kept, &[]);
    assert!(!checked_again.contains("Reducing"), "{checked_again}");
    assert_eq!(fs::read(root.path().join("out.csv")).unwrap(), first, "damaged checks are made again");
}
