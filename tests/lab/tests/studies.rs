//! Studies of the laboratory in their quick forms.

#[path = "../../guide.rs"]
mod guide;

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value;

fn lab(directory: &Path, cache: &str, arguments: &[&str]) -> (String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lab"));
    let output = command.current_dir(directory).env("TIPRUB_CACHE", cache).args(arguments).output().unwrap();
    let [stdout, stderr] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {stderr}");
    (stdout, stderr)
}

/// Returns the results of a quick study, after checking that all files exist and that the numbers of each figure are
/// complete.
#[track_caller]
fn study(root: &Path, name: &str, more: &[&str]) -> Value {
    let arguments = [&[name, "--quick", "--json", "--quiet", "--out", "out"], more].concat();
    let (stdout, _) = lab(root, env!("CARGO_TARGET_TMPDIR"), &arguments);
    let json: Value = serde_json::from_str(&stdout).unwrap();
    let out = root.join("out");
    let page = fs::read_to_string(out.join("index.html")).unwrap();
    assert!(!page.contains("http://") || page.matches("http://").count() == page.matches("http://www.w3.org").count());
    for figure in json["figures"].as_array().unwrap() {
        let svg = fs::read_to_string(out.join(figure["svg"].as_str().unwrap())).unwrap();
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>") || svg.trim_end().ends_with("</svg>"), "{figure}");
        let csv = fs::read_to_string(out.join(figure["csv"].as_str().unwrap())).unwrap();
        assert!(csv.lines().count() >= 3, "{figure}");
    }
    let written: Value = serde_json::from_str(&fs::read_to_string(out.join("results.json")).unwrap()).unwrap();
    assert_eq!(written["results"], json["results"]);
    json
}

/// Checks that exactly these statements are answered with no.
#[track_caller]
fn only_no(json: &Value, no: &[&str]) {
    let statements = json["statements"].as_array().unwrap();
    let begins = |start: &&str| statements.iter().any(|one| one["expected"].as_str().unwrap().starts_with(*start));
    assert!(no.iter().all(begins), "{no:?} of {statements:#?}");
    for statement in statements {
        let holds = !no.iter().any(|start| statement["expected"].as_str().unwrap().starts_with(start));
        assert_ne!(statement["holds"], Value::Bool(!holds), "{statement:#}");
    }
}

fn columns(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',').map(String::from).collect();
    (names, lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect())
}

#[test]
fn the_quick_study_of_convergence_reaches_the_limits() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "convergence", &[]);
    only_no(&json, &[]);
    let enough = json["results"]["enough"]["deviation"]["per_nodal_diameter"].as_u64().unwrap();
    let (_, rows) = columns(&root.path().join("out/deviation.csv"));
    for row in &rows {
        assert!(row[0] < enough as f64 || row[3].abs() < 0.3, "{row:?}");
    }
    assert!(
        rows.iter().any(|row| (row[0] - enough as f64 + 1.0).abs() < 0.5 && row[3].abs() >= 0.3),
        "one fewer is not enough"
    );
}

#[test]
fn the_quick_study_of_modes_draws_folded_engine_orders() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "modes", &["--speed", "1000"]);
    only_no(&json, &[]);
    assert_eq!(json["results"]["frequencies_hz"].as_array().unwrap().len(), 29);
    let (_, rows) = columns(&root.path().join("out/interference.csv"));
    for row in rows {
        let [number, frequency, order] = [row[0], row[2], row[4]];
        let rest = order % 56.0;
        assert_eq!(rest.min(56.0 - rest).to_bits(), number.to_bits(), "{row:?}");
        assert!((row[6] * order / std::f64::consts::TAU / frequency - 1.0).abs() < 1e-12);
    }
    assert!(root.path().join("out/shapes.vtu").is_file());
}

/// There are three casings. The rigid oval closes all nodes; with friction, contact on it flutters, and forces are
/// larger than without. The elastic casing is held at one end and yields: the leading edge does not touch.
#[test]
fn quick_stage_study_separates_rigid_and_flexible_casings() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "stage", &["--speeds", "900:1300:2"]);
    only_no(&json, &["Flexible casing: The clearance of each of the three nodes"]);
    let out = root.path().join("out");
    for name in ["clearances-smooth.csv", "clearances-rigid.csv", "clearances-flexible.csv"] {
        let (names, rows) = columns(&out.join(name));
        assert_eq!(&names[2..], ["leading_edge (m)", "mid_chord (m)", "trailing_edge (m)", "nodes in contact"]);
        assert!(rows.iter().any(|row| row[2..5].contains(&0.0)), "no contact of blade 1");
        assert!(rows.iter().all(|row| row[2..5].iter().all(|clearance| *clearance >= -1e-12)));
    }
    let least = |name: &str| columns(&out.join(name)).1.iter().map(|row| row[12..15].to_vec()).collect::<Vec<_>>();
    assert!(least("amplitudes-smooth.csv").iter().flatten().all(|clearance| *clearance == 0.0));
    assert!(least("amplitudes-flexible.csv").iter().all(|nodes| nodes[0] > 1e-6 && nodes[1] == 0.0));
    let [rigid, smooth] = ["rigid", "smooth"].map(|casing| columns(&out.join(format!("amplitudes-{casing}.csv"))).1);
    for (rigid, smooth) in rigid.iter().zip(&smooth) {
        assert!(rigid[18] > 0.5 && smooth[18] > 0.5, "reaches its end");
        assert!(rigid[10] > 1.3 * smooth[10], "flutter presses harder: {} N, {} N", rigid[10], smooth[10]);
    }
}

/// In the first 0.2 ms two rows of nodes touch. Statements hold, and the results are close to those of independent
/// methods, but not equal.
#[test]
fn quick_cube_study_agrees_with_independent_methods() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "cube", &[]);
    only_no(&json, &[]);
    let flights = json["results"]["flights"].as_array().unwrap();
    assert_eq!(flights.len(), 1);
    let runs = flights[0]["runs"].as_array().unwrap();
    assert_eq!(runs.len(), 4);
    for run in runs {
        assert!(run["failed"].is_null(), "{run}");
        let exit = run["exit_speed"].as_f64().unwrap();
        assert!((93.0..99.5).contains(&exit), "friction slows the cube: {run}");
    }
    let pairs = flights[0]["pairs"].as_array().unwrap();
    assert_eq!(pairs.len(), 6);
    for pair in pairs {
        let shares: Vec<f64> = pair["shares"].as_array().unwrap().iter().map(|share| share.as_f64().unwrap()).collect();
        assert!(shares[0] > 1e-6 && shares[0] < 0.005 && shares[1] < 0.02 && shares[2] < 0.01, "{pair}");
    }
    let (names, rows) = columns(&root.path().join("out/fig4a-u1x.csv"));
    // Names contain commas; numbers do not.
    assert_eq!(names[0], "time (ms)");
    assert!(rows.iter().all(|row| row.len() == 5), "time and four methods");
    // The cube and the rings share 1 mm of interference.
    let crest = rows.iter().map(|row| row[4]).fold(0.0, f64::max);
    assert!((0.5..1.0).contains(&crest), "{crest} mm");
    let tables = fs::read_to_string(root.path().join("out/tables.md")).unwrap();
    assert!(tables.contains("| product, lcp, modal-exact / a, film |"), "{tables}");
    let patches = json["results"]["patches"].as_array().unwrap();
    assert_eq!(patches.len(), 2);
    for one in patches {
        assert!((4.0..6.0).contains(&one["left_impulse"].as_f64().unwrap()), "{one}");
    }
}

#[test]
fn quick_conjugacy_study_finds_agreement() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "conjugacy", &[]);
    for statement in json["statements"].as_array().unwrap() {
        assert_eq!(statement["holds"], true, "{statement}");
    }
    let rows = json["results"]["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 25);
    // Whirl rotates: a moment about the shaft also acts about the axis of the casing.
    for row in rows {
        assert!(row["contacts"].as_u64().unwrap() > 300, "{row}");
        assert!(row["shaft"].as_f64().unwrap() < 1e-13 && row["ledger"].as_f64().unwrap() < 1e-13, "{row}");
        assert!(row["curvature"].as_f64().unwrap().abs() < 1e-4, "{row}");
    }
    let table = fs::read_to_string(root.path().join("out/table.md")).unwrap();
    assert_eq!(table.lines().count(), 27, "{table}");
}

/// Methods and steps of all four inputs; the table of the guide has a row for each run.
#[test]
fn quick_input_study_shows_impacts_only_for_held_inputs() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "inputs", &[]);
    let force = |input: &str, way: &str, step: usize| {
        json["results"][input][way][step]["force"].as_f64().unwrap_or_else(|| panic!("{input} {way}: {json:#}"))
    };
    for input in ["whirl", "gap-offset", "shape-factor", "temperature"] {
        let fine = json["results"][input]["fine"]["force"].as_f64().unwrap();
        assert!(fine > 1.0, "no contact: {input} {fine}");
        assert_eq!(force(input, "derivatives", 0).to_bits(), fine.to_bits(), "{input}");
    }
    // Effect of the longest communication step on the force of the fine run: small with the ramp, impacts if held.
    for input in ["whirl", "gap-offset", "shape-factor"] {
        let fine = json["results"][input]["fine"]["force"].as_f64().unwrap();
        let [ramp, hold] = ["ramp (default)", "hold"].map(|way| (force(input, way, 2) - fine) / fine);
        assert!(ramp.abs() < 0.15 && hold > 0.5 && hold > 20.0 * ramp.abs(), "{input}: {ramp} {hold}");
    }
    let table = fs::read_to_string(root.path().join("out/inputs.md")).unwrap();
    assert_eq!(table.lines().count(), 2 + 4 * 10, "{table}");
}

#[test]
fn quick_coupling_study_requires_derivatives_without_mass() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "coupling", &[]);
    only_no(&json, &[]);
    let found = |shaft: &str, way: &str| -> Vec<Value> {
        let runs = json["results"][shaft].as_array().unwrap();
        runs.iter()
            .filter(|run| run["way"].as_str().unwrap().starts_with(way))
            .map(|run| run["found"].clone())
            .collect()
    };
    // A fixed-point iteration suffices for a heavy shaft and fails for one without mass; the error of single steps
    // decreases with H.
    assert!(found("heavy", "fixed point").iter().all(|found| found["unsolved"] == 0));
    assert!(
        found("massless", "fixed point").iter().all(|found| found.is_null() || found["unsolved"].as_u64() > Some(0))
    );
    let errors: Vec<f64> = found("heavy", "once").iter().map(|found| found["error"].as_f64().unwrap()).collect();
    assert!(errors.windows(2).all(|pair| pair[1] < 0.75 * pair[0]), "{errors:?}");
    let solved: Vec<f64> = found("heavy", "Newton, der").iter().map(|found| found["error"].as_f64().unwrap()).collect();
    assert!(solved.iter().zip(&errors).all(|(solved, once)| *solved < 0.8 * once), "{solved:?} {errors:?}");
}

/// The blade enters the coating, which wears; statements hold, and depths are of the order of the closing.
#[test]
fn quick_wear_study_counts_lobes_and_vibrations() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "wear", &[]);
    only_no(&json, &[]);
    let rows = json["results"].as_array().unwrap();
    assert_eq!(rows.len(), 6);
    let mean = |row: &Value| row["wear"][0].as_f64().unwrap();
    assert!(rows.windows(2).all(|pair| mean(&pair[1]) > mean(&pair[0])), "{rows:#?}");
    let added: f64 = rows[1..].iter().map(|row| row["added"].as_f64().unwrap()).sum();
    assert!((mean(&rows[5]) - mean(&rows[0]) - added).abs() < 1e-12, "{rows:#?}");
    assert!(
        (1e-4..4e-4).contains(&mean(&rows[5])) && rows.iter().all(|row| row["end"].as_u64() >= Some(20)),
        "{rows:#?}"
    );
    assert_eq!(fs::read_to_string(root.path().join("out/wear.md")).unwrap().lines().count(), 2 + 6);
}

/// Open nodes stay outside the casing between the points of steps.
#[test]
fn quick_penetration_study_finds_no_missed_contact() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "penetration", &[]);
    only_no(&json, &[]);
    let rows = json["results"].as_array().unwrap();
    assert_eq!(rows.len(), 7);
    assert!(rows.iter().all(|row| row["touching"].as_u64() > Some(100)), "{rows:#?}");
}

/// Python of the tests, which has NumPy if `tests/run.sh` has created its environment; otherwise that of the system.
fn python() -> PathBuf {
    let own = tiprub_tests::root().join("target/tests-venv/bin/python");
    if own.is_file() { own } else { "python3".into() }
}

#[test]
fn quick_bench_gives_times_and_errors() {
    let root = tempfile::tempdir().unwrap();
    let library = std::env::var_os("TIPRUB_LIBRARY").map_or_else(tiprub_tests::shared, PathBuf::from);
    let python = python();
    let options = ["--library", library.to_str().unwrap(), "--python", python.to_str().unwrap()];
    let json = study(root.path(), "bench", &options);
    only_no(&json, &[]);
    let rows = json["results"].as_array().unwrap();
    let (timed, variants) = rows.split_at(rows.len() - 2);
    assert_eq!(
        timed.len(),
        4 * 3 + 2 * 3 + 3 + 2 + 1 + 7,
        "tolerances by communication steps, libraries, the paper's method, fixed steps, the independent solver, features"
    );
    let named = |row: &Value, method: &str| row["method"].as_str().is_some_and(|name| name.contains(method));
    let of = |method: &'static str| timed.iter().filter(move |row| named(row, method));
    let with_numpy = Command::new(&python).args(["-c", "import numpy"]).output().is_ok_and(|run| run.status.success());
    if !with_numpy {
        let why = of("NumPy").next().unwrap()["rejected"].as_str().unwrap();
        assert!(why.contains("skipped") && why.contains("Install NumPy"), "{why}");
    }
    for row in timed.iter().filter(|row| with_numpy || !named(row, "NumPy")) {
        assert!(row["rejected"].is_null() && row["seconds_per_second"].as_f64() > Some(0.0), "{row:#}");
        assert!(row["error"].as_f64().is_some_and(|error| error > 0.0 && error < 0.5), "{row:#}");
    }
    let errors: Vec<f64> = of("adaptive").map(|row| row["error"].as_f64().unwrap()).collect();
    assert!(errors[9] < 0.1 * errors[0], "a smaller tolerance gives a smaller error: {errors:?}");
    for row in of("library") {
        let off = row["error"].as_f64().unwrap() / errors[3] - 1.0;
        assert!(off.abs() < 1e-9, "a library and the core give the same displacements: {row:#}");
    }
    let dense: Vec<f64> = of("dense matrices").filter_map(|row| row["error"].as_f64()).collect();
    assert!(dense.iter().all(|error| (error / dense[0] - 1.0).abs() < 1e-6), "Rust and NumPy: {dense:?}");
    for variant in variants {
        let errors: Vec<f64> = variant["errors"].as_array().unwrap().iter().map(|one| one.as_f64().unwrap()).collect();
        assert!(errors[3] > 0.0 && errors[3] < 0.1 * errors[0], "{variant:#}");
    }
    let read = |name: &str| fs::read_to_string(root.path().join("out").join(name)).unwrap();
    let table = read("bench.md");
    assert!(table.contains("| ms per revolution |") && table.contains("| central-difference + film |"), "{table}");
    assert_eq!(read("tolerances.md").lines().count(), 2 + 2 + 2);
    assert_eq!(read("features.md").lines().count(), 2 + 2 + 7);
}

#[test]
fn bench_rejects_files_without_a_library() {
    let root = tempfile::tempdir().unwrap();
    let file = root.path().join("old.so");
    fs::write(&file, "text").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_lab"));
    command.current_dir(root.path()).args(["bench", "--quick", "--library", "old.so"]);
    let reported = String::from_utf8(command.output().unwrap().stderr).unwrap();
    assert!(reported.contains("old.so: is not a complete shared library"), "{reported}");
}

#[test]
fn quick_scaling_study_fits_every_variation() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "scaling", &[]);
    only_no(&json, &[]);
    let curves = json["results"].as_array().unwrap();
    let names: Vec<&str> = curves.iter().map(|curve| curve["varied"].as_str().unwrap()).collect();
    assert_eq!(names, ["sectors", "modes per blade", "patches per blade", "touching blades"]);
    for curve in curves {
        // Differences of times can vanish on a busy machine; numbers of steps are the same in every run.
        assert!(curve["varied"] == "touching blades" || curve["exponent"].as_f64().is_some(), "{curve:#}");
        assert!((0.0..1.2).contains(&curve["exponent_of_trials"].as_f64().unwrap()), "{curve:#}");
        let points = curve["points"].as_array().unwrap();
        assert!(points.len() >= 3 && points.iter().all(|point| point["trials"].as_u64() > Some(0)), "{curve:#}");
    }
    let read = |name: &str| fs::read_to_string(root.path().join("out").join(name)).unwrap();
    assert_eq!(read("scaling.md").lines().count(), 2 + 2 + 4);
    assert_eq!(read("points.md").lines().count(), 2 + 2 + 3 + 3 + 3 + 4);
    let (_, progress) = lab(root.path(), env!("CARGO_TARGET_TMPDIR"), &["scaling", "--quick", "--out", "out"]);
    assert!(progress.contains("point 13 of 13: 12 touching blades"), "{progress}");
}

/// The errors occur before any reduction, and no directory is created.
#[test]
fn rejects_unsupported_studies_before_running() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("file"), "").unwrap();
    let refuse = |arguments: &[&str], code: i32| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lab"));
        let output = command.current_dir(root.path()).env("TIPRUB_CACHE", "").args(arguments).output().unwrap();
        let reported = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{reported}");
        assert!(!reported.contains("Reducing"), "{reported}");
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1, "something stays");
        reported
    };
    for name in [
        "convergence",
        "modes",
        "cube",
        "stage",
        "error",
        "inputs",
        "coupling",
        "witness",
        "stress",
        "bases",
        "scatter",
        "penetration",
        "bench",
        "scaling",
        "wear",
    ] {
        let reported = refuse(&[name, "--quick", "--out", "file/out"], 1);
        assert!(reported.contains("file/out: cannot create the directory"), "{reported}");
    }
}

/// Returns the study names in `lab NAME`, at the start of a line of code or of text between backticks.
fn studies_named(page: &str) -> impl Iterator<Item = &str> {
    let lines = page.lines().filter_map(|line| line.strip_prefix("    "));
    let spans = page.split('`').skip(1).step_by(2);
    let named = lines.chain(spans).filter_map(|code| code.trim_start().strip_prefix("lab "));
    named.filter_map(|rest| rest.split_whitespace().next())
}

#[test]
fn quick_estimate_study_matches_true_errors() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "estimates", &[]);
    only_no(&json, &[]);
    let rows = json["results"].as_array().unwrap();
    assert_eq!(rows.len(), 2 * (3 + 2), "scenes and directions, the mesh from one coarser and from two");
    for (index, row) in rows.iter().enumerate() {
        let truth = row["truth"].as_f64().unwrap();
        let estimate = row["estimate"].as_f64();
        // The discretisation error of the mesh may be unknown.
        assert!(estimate.map_or(index >= 6, |estimate| estimate > 0.0) && (1e-6..0.5).contains(&truth), "{row:#}");
    }
}

/// The unreduced full model and the product on reduced models agree with the same contact, and differ with another one.
/// Three patches on this coarse mesh are too few to be better than three nodes.
#[test]
fn quick_witness_study_matches_reduced_models() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "witness", &[]);
    only_no(&json, &["The default model is closer"]);
    let rows = json["results"]["runs"].as_array().unwrap();
    assert_eq!(rows.len(), 9 + 4);
    let row = |start: &str| rows.iter().find(|row| row["run"].as_str().unwrap().starts_with(start)).unwrap();
    for name in ["more modes", "two rows, more modes"] {
        let own = &row(name)["same_contact"];
        assert!(own["displacements"].as_f64().unwrap() < 0.01 && own["impulse"].as_f64().unwrap() < 0.01, "{own}");
        assert!(row(name)["sides"]["displacements"].as_f64().unwrap() > 0.1, "{rows:#?}");
    }
    let impulse = |name: &str| row(name)["sides"]["impulse"].as_f64().unwrap();
    assert!(impulse("two rows, more modes") < 0.07 && impulse("more modes") > 0.2, "{rows:#?}");
    assert!(row("full model")["friction_work"].as_f64().unwrap() > 5.0);
    assert!(json["results"]["refused"].as_array().unwrap().is_empty());
}

/// Under the same contact forces the stress converges to that of the full model as modes are added, faster than in a
/// rub, in which time steps differ too.
#[test]
fn quick_stress_study_recovers_full_model_stress() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "stress", &[]);
    only_no(&json, &[]);
    let results = &json["results"];
    assert!(
        results["rest"].as_f64().unwrap() < 1e-6 && results["refused"].as_array().unwrap().is_empty(),
        "{results:#}"
    );
    let rows = results["runs"].as_array().unwrap();
    let forced: Vec<f64> = rows.iter().filter_map(|row| row["same_forces"]["stress"].as_f64()).collect();
    assert!(forced.len() == 3 && forced[2] < 0.06 && forced[0] > 0.2, "{forced:?}");
    let largest = |row: &Value| row["same_forces"]["worst_place"].as_f64();
    assert!(rows.iter().filter_map(largest).next_back().unwrap() < 0.05, "{rows:#?}");
    let full = results["largest_von_mises"]["full"].as_array().unwrap();
    assert!(full.len() == 6 && full.iter().all(|value| value.as_f64().unwrap() > 5e7), "{full:?}");
}

/// Blades of different clearances and frequencies, shifted bumps, a cylinder: independent geometry, modes, contact and
/// steps agree. Unsupported features give an error.
#[test]
fn independent_witness_agrees_with_any_blade_scene() {
    let root = tempfile::tempdir().unwrap();
    let list =
        |value: &dyn Fn(i32) -> f64| (0..36).map(|blade| format!("{:e}", value(blade))).collect::<Vec<_>>().join(", ");
    let file = |name: &str, structure: &str, contact: &str| {
        let text = format!(
            "name = \"{name}\"\n[[structure]]\nname = \"rotor\"\nrom = \"builtin:rotor37-paper\"\nspeed = 1800.0\ndamping_ratio = 2e-3\n{structure}\n\
             [[surface]]\nname = \"casing\"\nramp_time = 2e-4\n[surface.shape]\nkind = \"two-lobe\"\ndepth = 0.8\nwidth = 0.2\nphase = 0.4\n\
             [[contact]]\nmaster = \"rotor\"\nslave = \"casing\"\n{contact}\nfriction = 0.1\n\
             [time]\nscheme = \"modal-exact\"\nstep = 2.5e-7\n[experiment]\nstop = 1.5e-3\ncommunication_step = 1e-5\n"
        );
        fs::write(root.path().join(format!("{name}.toml")), text).unwrap();
        format!("{name}.toml")
    };
    let factors = format!("frequency_factors = [{}]", list(&|blade| 1.0 + 0.01 * f64::from(blade % 5 - 2)));
    let gaps =
        format!("sector_gaps = [{}]\nmeridian = \"cylinder\"", list(&|blade| 3e-4 + 1e-5 * f64::from(blade % 7)));
    let uneven = file("uneven", &factors, &gaps);
    let json = study(root.path(), "beside", &[&uneven]);
    only_no(&json, &[]);
    let found = |name: &str| json["results"][name].as_f64().unwrap();
    assert!(found("displacements") < 0.02 && found("impulse") < 0.005, "{:#}", json["results"]);
    let whirl = file("whirl", "whirl = true", "gap = 3.56e-4");
    let mut command = Command::new(env!("CARGO_BIN_EXE_lab"));
    let output = command.current_dir(root.path()).args(["beside", &whirl, "--out", "none"]).output().unwrap();
    let reported = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && reported.contains("whirl") && reported.contains("a moving shaft"),
        "{reported}"
    );
}

#[test]
fn quick_random_rub_study_meets_tolerance_and_energy_bounds() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "scatter", &[]);
    only_no(&json, &[]);
    let results = &json["results"];
    assert!(results["rubs"].as_u64().unwrap() >= 6, "{results:#}");
    assert!(results["energy"].as_array().unwrap().iter().all(|one| one["switches"].as_u64() >= Some(2000)));
    assert!(results["problems"].as_array().unwrap().iter().all(|one| one["trials"].as_u64() >= Some(5000)));
    assert_eq!(
        fs::read_to_string(root.path().join("out/scatter.md")).unwrap().lines().count(),
        6 + 5 + 5 + 10 + 3 + 10 + 3 + 6
    );
    let [flown, rub] = [0, 1].map(|index: usize| results["milliseconds_of_long_steps"][index].as_f64().unwrap());
    assert!(flown < 0.1 * rub, "{results:#}");
    let mission = &results["mission"];
    assert!(mission["steps"] == 360 && mission["of_them_rubbing"] == 1, "{mission:#}");
    assert!(
        mission["residual"].as_f64().unwrap() < 1e-9 && mission["friction_loss"].as_f64().unwrap() > 1.0,
        "{mission:#}"
    );
    assert!(results["solutions"].as_array().unwrap().iter().all(|one| one["problems"].as_u64() >= Some(1000)));
}

#[test]
fn quick_basis_study_compares_free_and_fixed_interface() {
    let root = tempfile::tempdir().unwrap();
    let json = study(root.path(), "bases", &[]);
    only_no(&json, &[]);
    let rows = json["results"].as_array().unwrap();
    assert_eq!(rows.len(), 4 * 2);
    for row in rows {
        let limit =
            |name: &str| row["limits"].as_array().unwrap().iter().find(|limit| limit[0] == name).unwrap()[1].as_f64();
        let [central, massless] = ["central-difference", "massless-boundary"].map(|name| limit(name).unwrap());
        assert!(massless > 2.0 * central, "{row:#}");
        // A step beyond the limit is rejected, and therefore not timed.
        for run in row["runs"].as_array().unwrap().iter().filter(|run| run["scheme"] == "central-difference") {
            assert!(run["step"].as_f64().unwrap() < central, "{run}");
        }
        assert!(row["step_seconds"].as_f64().unwrap() > 0.0, "{row:#}");
    }
    let tables = fs::read_to_string(root.path().join("out/bases.md")).unwrap();
    assert_eq!(tables.lines().count(), (2 + 8) + 1 + (2 + 2 * 4), "{tables}");
}

#[test]
fn guide_lists_exactly_the_existing_studies() {
    let root = tempfile::tempdir().unwrap();
    let (help, _) = lab(root.path(), "", &["--help"]);
    let list = help.split_once("\nCommands:\n").unwrap().1.split("\n\n").next().unwrap();
    let names = list.lines().filter(|line| !line.starts_with("   ")).filter_map(|line| line.split_whitespace().next());
    let known: BTreeSet<&str> = names.filter(|name| *name != "help").collect();
    let pages = guide::pages();
    let named: BTreeSet<&str> = pages.iter().flat_map(|page| studies_named(&page.1)).collect();
    assert_eq!(named, known);
}

#[test]
fn invalid_command_lines_are_reported_as_json() {
    for (line, what) in [("cube --jsn --json", "--jsn"), ("--json error --scene bar", "--scene"), ("--json", "lab")] {
        let output = Command::new(env!("CARGO_BIN_EXE_lab")).args(line.split(' ')).output().unwrap();
        let error = &serde_json::from_slice::<Value>(&output.stdout).unwrap()["error"];
        assert_eq!((output.status.code(), error["exit_code"].as_i64()), (Some(2), Some(2)), "{line}");
        assert!(error["what"].as_str().unwrap().contains(what), "{line}: {error}");
        assert!(
            error["remedy"].as_str().unwrap().ends_with("See `lab --help` or the `--help` of the command"),
            "{error}"
        );
    }
}
