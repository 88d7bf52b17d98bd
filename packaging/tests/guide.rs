//! Figures of the user guide: every table of figures states its source, and the guide shows the current output of the program. Blocks from tests are
//! checked by these tests ([`guide::hold`]).

#[path = "guide/book.rs"]
mod book;
#[path = "../../tests/guide.rs"]
mod guide;

use std::{collections::BTreeSet, fs, path::Path, process::Command};

use guide::{blocks, holds, missing, numbers, pages, print_row};

/// Returns the output of `tiprub ...`, line by line. The command may use the scene file of the page "First scene", and the plan of the page "Sweeps".
fn run(command: &str) -> Vec<String> {
    let root = tempfile::tempdir().unwrap();
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/first-scene.md");
    let page = fs::read_to_string(page).unwrap();
    let scene = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    fs::write(root.path().join("my_scene.toml"), scene).unwrap();
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/sweeps.md");
    let page = fs::read_to_string(page).unwrap();
    let plan = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    fs::write(root.path().join("plan.toml"), plan).unwrap();
    run_in(root.path(), command)
}

fn run_in(directory: &Path, command: &str) -> Vec<String> {
    let mut words = command.split_whitespace().skip(1);
    let mut tiprub = Command::new(env!("CARGO_BIN_EXE_tiprub"));
    tiprub.current_dir(directory).env("TIPRUB_CACHE", env!("CARGO_TARGET_TMPDIR")).args(&mut words).arg("--quiet");
    let output = tiprub.output().unwrap();
    assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(String::from).collect()
}

#[test]
fn command_outputs_match_the_guide() {
    let of_program: Vec<_> = blocks().into_iter().filter(|block| block.1.starts_with("tiprub ")).collect();
    let commands: BTreeSet<&str> = of_program.iter().map(|block| block.1.as_str()).collect();
    assert!(!commands.is_empty());
    for command in commands {
        let output = run(command);
        for (page, _, block) in of_program.iter().filter(|block| block.1 == command) {
            let missing = missing(block, &output);
            assert!(
                missing.is_empty(),
                "{page}: `{command}` does not say\n{}\nbut\n{}",
                missing.join("\n"),
                output.join("\n")
            );
        }
    }
}

/// Every block that names a test is checked by that test.
#[test]
fn every_quoted_test_output_is_checked_by_its_test() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let folders = [("tiprub-core", "src/core"), ("tiprub-model", "src/model"), ("tiprub", "packaging")];
    for (page, command, block) in blocks() {
        assert!(block.lines().any(|line| !numbers(line).is_empty()), "{page}: nothing in the block of `{command}`");
        let Some(test) = command.strip_prefix("cargo test -p ") else {
            assert!(command.starts_with("tiprub "), "{page}: {command}");
            continue;
        };
        let mut words = test.split(' ');
        let (package, file) = (words.next().unwrap(), words.nth(1).unwrap());
        let folder = folders.iter().find(|folder| folder.0 == package).unwrap_or_else(|| panic!("{page}: {command}")).1;
        let holds = format!("guide::hold(\"{command}\")");
        assert!(book::sources(&root.join(folder).join("tests"), file).contains(&holds), "{page}: {command}");
    }
}

/// The first scene of the reference is the built-in scene with its model and its scheme, because it has the same name.
#[test]
fn the_first_scene_of_the_reference_is_the_built_in_scene() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/scene-file.md");
    let page = fs::read_to_string(page).unwrap();
    let shown = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let [shown, built_in] = [shown, tiprub_gallery::scene_source::ROTOR37_SCENE]
        .map(|text| tiprub_format::parse_scene(text, "scene").unwrap());
    assert_eq!(shown.name, built_in.name);
    assert_eq!(shown.structures, built_in.structures);
    assert_eq!(shown.surfaces, built_in.surfaces);
    assert_eq!(shown.contacts, built_in.contacts);
    assert_eq!(shown.experiment, built_in.experiment);
    let method = |scene: &tiprub_core::scene::settings::SceneSettings| (scene.time.scheme, scene.time.step.to_bits());
    assert_eq!(method(&shown), method(&built_in));
}

/// Rub of the first run with the full, half and quarter internal step: the influence of the step that a newcomer sees.
#[test]
fn first_run_results_at_halved_steps() {
    for step in [0.5, 0.25, 0.125] {
        let lines = run(&format!("tiprub run builtin:rotor37-one-row --all --set internal_step_max={step}e-6"));
        let number = |name: &str| {
            let line =
                lines.iter().find(|line| line.trim_start().starts_with(name)).unwrap_or_else(|| panic!("{name}"));
            let rest = line.split_once(name).unwrap().1.trim_start_matches(|c: char| !c.is_ascii_digit());
            rest.split(' ').next().unwrap().parse::<f64>().unwrap()
        };
        let sum = number("largest total normal force of all contact nodes, mean over a communication step:");
        let node = number("largest normal force on a single contact node in an internal step:");
        let [heat, curvature] = ["friction_loss", "curvature_work"].map(number);
        print_row!("| {step} | {sum} | {node} | {heat} | {curvature} |");
    }
    guide::hold("cargo test -p tiprub --test guide halved");
}

/// Rub of the first run after two revolutions, with massless contact nodes: points along the tip, and patches.
#[test]
fn first_run_results_with_points_and_patches() {
    let root = tempfile::tempdir().unwrap();
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../src/gallery/scenes/rotor37-one-row.toml");
    let scene = fs::read_to_string(shipped).unwrap();
    assert!(scene.contains("modal-exact") && scene.contains("step = 5.0e-7 "));
    let scene = scene.replace("modal-exact", "massless-boundary");
    for what in ["nodes", "patches"] {
        for count in [3, 5, 9] {
            let rom = format!("{what}-{count}.rom.safetensors");
            let kept = "--kind free-interface --modes 20 --mesh 16x2x20";
            let rows = if what == "patches" { "--contact-rows 1" } else { "" };
            let reduce = format!("tiprub reduce rotor37 --contact-{what} {count} {rows} {kept} -o {rom}");
            run_in(root.path(), &reduce);
            fs::write(root.path().join("scene.toml"), scene.replace("builtin:rotor37-one-row", &rom)).unwrap();
            let rows = run_in(root.path(), "tiprub run scene.toml --stop 0.007 --csv -");
            let last = |name: &str| {
                let at = rows[0].split(',').position(|known| known == name).unwrap();
                rows.last().unwrap().split(',').nth(at).unwrap().parse::<f64>().unwrap()
            };
            print_row!("| {count} {what} | {} | {} |", last("strain_energy"), last("friction_loss"));
        }
    }
    guide::hold("cargo test -p tiprub --test guide patches");
}

/// Tables with decimals stand in a block, in a generated part, or after a mark that states their source and date, or that they are given values.
#[test]
fn every_numeric_table_states_its_source() {
    let marks = ["<!-- from: ", "<!-- generated: ", "<!-- written: ", "<!-- given -->"];
    for (page, text) in pages() {
        let mut marked = false;
        for (line, number) in text.lines().zip(1..) {
            let mark = line.trim_start();
            if mark.starts_with("<!-- end") {
                marked = false;
            } else if marks.iter().any(|known| mark.starts_with(known)) {
                marked = true;
                let dated = mark.contains("20") && mark.contains('.');
                assert!(!mark.starts_with("<!-- written: ") || dated, "{page}, line {number}: no date or version");
            }
            let figures = line.split('|').filter(|cell| decimal(cell)).count();
            let table = line.trim_start().starts_with('|');
            assert!(marked || !table || figures < 2, "{page}, line {number} does not say where it comes from: {line}");
        }
    }
}

/// Returns whether a cell shows a number with decimals or an exponent.
fn decimal(cell: &str) -> bool {
    let digit = |c: Option<&char>| c.is_some_and(char::is_ascii_digit);
    let all: Vec<char> = cell.chars().collect();
    (1..all.len()).any(|at| {
        digit(all.get(at - 1))
            && (all[at] == '.' || all[at] == 'e')
            && all.get(at + 1).is_some_and(|c| c.is_ascii_digit() || *c == '-')
    })
}

/// The comparison detects a different last digit, sign or order, and a missing number.
#[test]
fn comparison_detects_any_difference_in_figures() {
    let found = "| ModalExact | Lcp | 200 | 133452.84 | 49.42 | -1.0e-3, 2.0e-13 |".to_owned();
    let seen = |shown: &str| holds(&found, &numbers(shown));
    for right in ["| | 200 | 133,452.8 | 49.42 |", "200, 49.4, 0.0010", "−0.0010", "−1e-3", "2e-13"] {
        assert!(seen(right), "{right}");
    }
    for wrong in ["133,452.9", "49.41", "+0.0010", "49.42, 133,452.8", "200, 200", "3e-3", "201"] {
        assert!(!seen(wrong), "{wrong}");
    }
    assert!(seen("5e-14") && !seen("1e-14"), "rounding is about as small as shown, not of the same digits");
    assert_eq!(missing("| 7 |\n|---|\n| a | 200 |\n| b | 7 |\nwords", &[found]), ["| b | 7 |"]);
}

/// The sample in the README prints mean torque and largest force of the demo.
#[test]
fn readme_sample_prints_the_documented_values() {
    let readme = pages().into_iter().find(|page| page.0 == "README.md").unwrap().1;
    let line = readme.lines().find(|line| line.starts_with("print(result[\"torque\"]")).unwrap();
    let [torque, force] = numbers(line.split('#').nth(1).unwrap())[..] else { panic!("{line}") };
    let rows = run("tiprub run builtin:rotor37 --csv - --stop 0.0105 --step 1e-5");
    let names: Vec<&str> = rows[0].split(',').collect();
    let column = |name: &str| -> Vec<f64> {
        let at = names.iter().position(|known| *known == name).unwrap_or_else(|| panic!("{name} of {names:?}"));
        rows[1..].iter().map(|row| row.split(',').nth(at).unwrap().parse().unwrap()).collect()
    };
    let torques = column("torque");
    let mean = torques.iter().sum::<f64>() / torques.len() as f64;
    let largest = names.iter().filter(|name| name.starts_with("blade[1].normal_force[")).flat_map(|name| column(name));
    let largest = largest.fold(0.0, f64::max);
    assert!(torque.is(mean) && force.is(largest), "{line}: {mean} N.m, {largest} N");
}
