//! `tiprub run`.

use std::{
    fs,
    process::{Command, Stdio},
};

use crate::project::{Project, SCENE, columns, json};

#[test]
fn a_native_run_writes_one_row_per_communication_point() {
    let project = Project::new();
    let json = project.succeed(&["run", "scene.toml", "--csv", "new/out.csv", "--json", "--quiet"]);
    let summary: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(summary["communication_steps"], 50);
    assert_eq!(summary["internal_steps"], 500);
    let (names, rows) = columns(&fs::read_to_string(project.path("new/out.csv")).unwrap());
    assert_eq!((names[0].as_str(), rows.len()), ("time", 51));
    let clearance = names.iter().position(|name| name == "clearance_minimum").expect("a column for the clearance");
    assert!((rows[0][clearance] - rows[50][clearance]).abs() > 1e-6, "the casing's lobes meet the blades");
    assert!(rows.iter().all(|row| row.len() == names.len()));
    assert_eq!(rows[50][0].to_bits(), 0.05_f64.to_bits());
    let again = project.succeed(&["run", "scene.toml", "--csv", "-", "--quiet"]);
    assert_eq!(columns(&again).1, rows, "the same run gives the same bits");
}

#[test]
fn cached_checks_of_other_parameters_are_kept() {
    let project = Project::new();
    let stored = |friction: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        command.current_dir(project.root.path()).env("TIPRUB_CACHE", project.path("cache"));
        let set = format!("friction_coefficient={friction}");
        assert!(command.args(["run", "scene.toml", "--quiet", "--set", &set]).output().unwrap().status.success());
        let mut files = fs::read_dir(project.path("cache")).unwrap().map(|entry| entry.unwrap().path());
        let file = files.find(|path| path.extension().is_some_and(|extension| extension == "checks")).unwrap();
        assert!(files.next().is_none(), "one file per scene");
        fs::read(file).unwrap()
    };
    let first = stored("0.1");
    assert_eq!(stored("0.1"), first);
    let both = stored("0.15");
    assert!(both.len() > first.len(), "{} {}", both.len(), first.len());
    // The results of the last run come first.
    let again = stored("0.1");
    assert!(again.len() == both.len() && again != both);
    assert_eq!(stored("0.15"), both);
}

/// The extremes agree with the CSV; the lobes of the scene extend through the gap.
#[test]
fn run_summary_reports_extremes() {
    let project = Project::new();
    let text = project.succeed(&["run", "scene.toml", "--csv", "out.csv", "--all", "--quiet"]);
    let json = project.succeed(&["run", "scene.toml", "--json", "--quiet"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let (names, rows) = columns(&fs::read_to_string(project.path("out.csv")).unwrap());
    let column = |name: &str| {
        let index = names.iter().position(|other| other == name).unwrap();
        rows.iter().map(|row| (row[0], row[index])).collect::<Vec<_>>()
    };
    // The communication step is 1 ms.
    let total: Vec<_> = column("normal_impulse").into_iter().map(|(time, impulse)| (time, impulse / 1e-3)).collect();
    let largest = |column: Vec<(f64, f64)>| column.into_iter().map(|row| row.1).fold(f64::MIN, f64::max);
    let least = column("clearance_minimum").into_iter().map(|row| row.1).fold(f64::MAX, f64::min);
    for (name, value) in [
        ("largest_total_normal_force", largest(total.clone())),
        ("largest_node_normal_force", largest(column("normal_force_peak"))),
        ("smallest_clearance", least),
        ("most_contacts", largest(column("contact_count"))),
    ] {
        let found = &json["extremes"][name];
        assert!((found["value"].as_f64().unwrap() - value).abs() <= 1e-9 * value.abs(), "{name}: {found}, {value}");
    }
    let force = &json["extremes"]["largest_total_normal_force"];
    assert!(force["value"].as_f64().unwrap() > 1.0, "{force}");
    let at = force["time"].as_f64().unwrap();
    let there = total.iter().find(|row| row.0.to_bits() == at.to_bits()).unwrap();
    assert!((there.1 - largest(total.clone())).abs() <= 1e-9 * there.1, "{there:?}");
    let reported = text.split("over the run:").nth(1).unwrap();
    assert!(reported.contains(&format!(" N at t = {at} s")) && reported.contains("smallest clearance: "), "{text}");
    assert!(reported.contains("largest number of contact nodes touching at a communication point: "), "{text}");
}

/// The five lines come first, the same with and without `--all`, then the references to other results.
#[test]
fn run_output_starts_with_five_summary_lines() {
    let project = Project::new();
    let [short, long] = [&[][..], &["--all"]]
        .map(|more| project.succeed(&[&["run", "scene.toml", "--csv", "out.csv", "--quiet"], more].concat()));
    let first = |text: &str| text.lines().take(5).map(str::to_owned).collect::<Vec<_>>();
    let names: Vec<String> = first(&short).iter().map(|line| line.split(' ').next().unwrap().to_owned()).collect();
    assert_eq!(names, ["force", "heat", "torque", "clearance", "growth"]);
    assert_eq!(first(&short), first(&long));
    assert!(short.contains("--all") && short.contains("out.csv") && !short.contains("at the end:\n"), "{short}");
    assert!(long.contains("at the end:\n") && long.contains("rotor_angle"), "{long}");
    let (names, rows) = columns(&fs::read_to_string(project.path("out.csv")).unwrap());
    let heat = rows.last().unwrap()[names.iter().position(|name| name == "friction_loss").unwrap()];
    let reported: f64 = first(&short)[1].split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!(heat > 0.0 && (reported - heat).abs() <= 5e-6 * heat, "{reported} {heat}");
}

#[test]
#[cfg(target_os = "linux")]
fn closed_output_pipe_is_a_failure() {
    let project = Project::new();
    let command = |line: &str| {
        let mut shell = Command::new("sh");
        shell.current_dir(project.root.path()).args(["-c", line, env!("CARGO_BIN_EXE_tiprub")]);
        shell
    };
    let run = "exec \"$0\" run scene.toml --quiet --csv -";
    let closed = command(&format!("{run} >&-")).output().unwrap();
    let reported = String::from_utf8_lossy(&closed.stderr).into_owned();
    assert!(closed.status.code() == Some(1) && reported.starts_with("error: stdout: is closed"), "{reported}");
    let mut left = command(run).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(left.stdout.take());
    let left = left.wait_with_output().unwrap();
    assert!(left.status.code() == Some(141) && left.stderr.is_empty(), "{left:?}");
    assert!(command(&format!("{run} > /dev/null")).status().unwrap().success());
}

#[test]
fn settings_and_times_can_be_replaced() {
    let project = Project::new();
    let csv = |arguments: &[&str]| {
        let all = [&["run", "scene.toml", "--csv", "-", "--quiet"], arguments].concat();
        columns(&project.succeed(&all)).1
    };
    assert_eq!(csv(&["--stop", "0.01", "--step", "0.003"]).len(), 5);
    assert_ne!(csv(&["--set", "speed=50"]), csv(&[]));
    assert_eq!(csv(&["--set", "speed=100"]), csv(&[]));
}

/// Inputs from a file: an increasing speed is integrated exactly, a constant input changes nothing, and an input that cannot be followed is
/// reported.
#[test]
fn time_varying_inputs_are_followed_without_delay() {
    let project = Project::new();
    let csv = |inputs: &str| {
        fs::write(project.path("inputs.csv"), inputs).unwrap();
        columns(&project.succeed(&["run", "scene.toml", "--csv", "-", "--quiet", "--inputs", "inputs.csv"]))
    };
    let plain = columns(&project.succeed(&["run", "scene.toml", "--csv", "-", "--quiet"]));
    assert_eq!(csv("time,speed,gap_offset\n0,100,0\n"), plain);
    let (names, rows) = csv("time,speed\n0,100\n0.02,150\n");
    let angle = names.iter().position(|name| name == "rotor_angle").unwrap();
    for row in &rows {
        let (time, ramp) = (row[0], row[0].min(0.02));
        let expected = 100.0 * ramp + 0.5 * 2500.0 * ramp * ramp + 150.0 * (time - ramp);
        assert!((row[angle] - expected).abs() < 1e-12 * expected.max(1.0), "{row:?}: {expected}");
    }
    let least = |rows: &[Vec<f64>]| {
        let at = names.iter().position(|name| name == "clearance_minimum").unwrap();
        rows[40..].iter().map(|row| row[at]).fold(f64::MAX, f64::min)
    };
    let away = csv("time,gap_offset\n0,0\n0.01,2e-3\n").1;
    assert!(least(&away) > least(&plain.1) + 1e-3, "{} {}", least(&away), least(&plain.1));
    for (inputs, more, reported) in [
        ("time,sped\n0,1\n", &[][..], "inputs.csv, `sped`: no such variable. Did you mean `speed`?"),
        ("time,torque\n0,1\n", &[], "inputs.csv, `torque`: it cannot change during a run"),
        ("time,speed\n0,100\n0.01,1e9\n", &[], "variable `speed`: with the derivative"),
        (
            "time,speed\n0,100\n",
            &["--set", "speed=50"],
            "--set speed: the file given with --inputs also has a column for this variable",
        ),
    ] {
        fs::write(project.path("inputs.csv"), inputs).unwrap();
        let output = project.run(&[&["run", "scene.toml", "--quiet", "--inputs", "inputs.csv"], more].concat());
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && stderr.contains(reported), "{inputs}: {stderr}");
    }
}

#[test]
fn warns_of_communication_step_longer_than_the_run() {
    let project = Project::new();
    fs::write(project.path("scene.toml"), SCENE.replace("communication_step = 1e-3", "communication_step = 0.1"))
        .unwrap();
    for arguments in
        [&["run", "scene.toml", "-q"][..], &["package", "scene.toml", "-o", "x", "--library", "library.so", "-q"]]
    {
        let stderr = String::from_utf8(project.run(arguments).stderr).unwrap();
        assert!(
            stderr.starts_with("warning [communication-step] the communication step 0.1 s is longer"),
            "{arguments:?}: {stderr}"
        );
    }
    assert!(project.run(&["run", "scene.toml", "-q", "--step", "0.05"]).stderr.is_empty());
}

#[test]
fn run_warnings_refer_to_the_actual_step() {
    let project = Project::new();
    // 2/omega_max of the springs is 2 ms.
    let scene =
        SCENE.replace("step = 1e-4", "step = 3e-3").replace("lobes\", amplitude = 2e-3", "lobes\", amplitude = 2e-6");
    fs::write(project.path("scene.toml"), scene).unwrap();
    let warnings = |arguments: &[&str]| {
        let output = project.run(&[&["run", "scene.toml", "--quiet"], arguments].concat());
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{stderr}");
        stderr.lines().filter(|line| line.contains("not resolved")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(warnings(&[]), Vec::<String>::new());
    let reported = warnings(&["--step", "2.5e-3"]);
    assert!(reported.len() == 1 && reported[0].contains("2.500e-3"), "{reported:?}");
}

#[test]
fn sector_gaps_replace_the_gap_and_heat_requires_friction() {
    let project = Project::new();
    fs::write(project.path("scene.toml"), SCENE.replace("gap = 1e-3", "sector_gaps = [1e-3, 1e-3, 1.2e-3, 1e-3]"))
        .unwrap();
    let (names, rows) = columns(&project.succeed(&["run", "scene.toml", "--csv", "-", "--quiet"]));
    let clearance = names.iter().position(|name| name == "clearance_minimum").unwrap();
    assert!(rows.last().unwrap()[clearance] <= 1e-3);
    assert!(project.succeed(&["inspect", "scene.toml", "--quiet"]).contains("gaps 0.001 m to 0.0012 m"));
    fs::write(project.path("scene.toml"), SCENE.replace("friction = 0.1", "slave_heat_fraction = 0.5")).unwrap();
    let error = project.fail(&["run", "scene.toml"], 1);
    assert!(error.contains("slave_heat_fraction") && error.contains("friction"), "{error}");
}

#[test]
fn rejects_run_larger_than_memory_with_its_size() {
    let project = Project::new();
    let message = project.fail(&["run", "scene.toml", "--step", "1e-9", "--quiet"], 2);
    assert!(message.contains("50000001 communication points") && message.contains("GB"), "{message}");
    let output = project.run(&["run", "scene.toml", "--step", "1e-9", "--json"]);
    assert_eq!(json(&output)["error"]["exit_code"], 2);
}
