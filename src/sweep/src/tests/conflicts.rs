//! Plans in which one value would silently replace another one, and files that change during a sweep.

use super::*;
use crate::models::{RomOrigin, RomStore};

/// Otherwise the values of the field would have no effect.
#[test]
fn field_that_a_start_value_replaces_is_rejected() {
    let bench = Bench::new();
    let plan = |field: &str, values: &str, more: &str| {
        format!("scene = \"scene.toml\"\n[[variable]]\nname = \"a\"\nfield = \"{field}\"\nvalues = {values}\n{more}")
    };
    let variable = |name: &str, values: &str| format!("[[variable]]\nname = \"{name}\"\nvalues = {values}");
    for (field, values, more, name) in [
        ("contact[1].friction", "[0.1, 0.2]", variable("friction_coefficient", "[0.15, 0.25]"), "friction_coefficient"),
        ("contact[1].friction", "[0.2]", "[set]\nfriction_coefficient = 0.15".to_owned(), "friction_coefficient"),
        ("structure[rotor].speed", "[90.0, 100.0]", variable("speed", "[95.0]"), "speed"),
        ("time.step", "[1e-4, 5e-5]", "[set]\ninternal_step_max = 2e-5".to_owned(), "internal_step_max"),
    ] {
        let text = plan(field, values, &more);
        let failure = bench.try_part(&text, "a.parquet", Part::WHOLE, 1).expect_err(&text);
        assert_eq!(failure.what, "variable `a`", "{failure}");
        assert!(failure.problem.contains(&format!("the start value `{name}` of the plan replaces")), "{failure}");
    }
    let motion = "[structure.excitation]\norder = 2\nmode = 1\namplitude = 1.0\n[[structure.initial]]\nmode = 1\n\
                  displacement = 1e-6\n[[surface]]";
    fs::write(bench.path("scene.toml"), SCENE.replacen("[[surface]]", motion, 1)).unwrap();
    for (field, values, name, value) in [
        ("structure[rotor].damping_ratios", "[[0.01], [0.02]]", "damping_ratios", "0.03"),
        ("structure[rotor].excitation.amplitude", "[1.0, 2.0]", "excitation_amplitude", "3.0"),
        ("structure[rotor].excitation.order", "[2, 3]", "excitation_order", "4"),
        ("structure[rotor].excitation.phase", "[0.0, 1.0]", "excitation_phase", "2.0"),
        ("structure[rotor].initial[1].displacement", "[1e-6, 2e-6]", "initial_displacement", "3e-6"),
        ("structure[rotor].initial[1].velocity", "[0.01, 0.02]", "initial_velocity", "0.03"),
        ("time.input_interpolation", "[\"hold\", \"linear\"]", "input_interpolation", "1"),
    ] {
        let text = plan(field, values, &format!("[set]\n{name} = {value}"));
        let failure = bench.try_part(&text, "a.parquet", Part::WHOLE, 1).expect_err(&text);
        assert!(failure.problem.contains(&format!("sets `{field}`, which the start value `{name}`")), "{failure}");
    }
    fs::write(bench.path("scene.toml"), SCENE).unwrap();
    // These start values do not replace the field.
    for (field, values, more) in [
        ("contact[1].gap", "[5e-4, 1e-3]", variable("gap_offset", "[0.0, 1e-4]")),
        ("contact[1].friction", "[0.1, 0.2]", variable("speed", "[90.0, 100.0]")),
        ("time.scheme", "[\"modal-exact\", \"central-difference\"]", variable("internal_step_max", "[1e-4, 5e-5]")),
    ] {
        let text = plan(field, values, &more);
        bench.try_part(&text, &format!("{}.parquet", field.replace(['[', ']'], "")), Part::WHOLE, 1).expect(&text);
    }
}

/// Otherwise one of them would have no effect.
#[test]
fn variables_that_set_the_same_key_are_rejected() {
    let bench = Bench::new();
    let variable = |name: &str, field: &str, values: &str| {
        format!("[[variable]]\nname = \"{name}\"\nfield = \"{field}\"\nvalues = {values}\n")
    };
    let whole = variable("all", "structure[1].damping_ratios", "[[0.01, 0.02]]");
    let one = variable("one", "structure[1].damping_ratios[1]", "[0.03]");
    for (plan, problem) in [
        (format!("stop = 0.002\n{}", variable("a", "experiment.stop", "[1e-3]")), "which `stop` also sets"),
        (
            format!("communication_step = 0.001\n{}", variable("a", "experiment.communication_step", "[1e-3]")),
            "which `communication_step` also sets",
        ),
        (format!("{whole}{one}"), "but `all` sets the key `structure[1].damping_ratios`"),
        ("[histories]\noutputs = []".to_owned(), "is empty"),
    ] {
        let failure =
            bench.try_part(&format!("scene = \"scene.toml\"\n{plan}"), "a.parquet", Part::WHOLE, 1).unwrap_err();
        assert!(failure.problem.contains(problem), "{failure}");
    }
    let stop = variable("a", "experiment.stop", "[1e-3, 2e-3]");
    bench.run(&format!("scene = \"scene.toml\"\n{stop}"), "a.parquet");
    assert_eq!(texts(&bench.table("a.parquet"), "communication_steps"), ["1", "2"]);
}

/// A variable in braces of `[rom]` sets a start value of the same name only if it has a `field`.
#[test]
fn part_of_a_rom_name_does_not_set_a_start_value() {
    let bench = Bench::new();
    for speed in [80, 90] {
        fs::copy(bench.path("small.rom.safetensors"), bench.path(&format!("rom{speed}.safetensors"))).unwrap();
    }
    let plan = |more: &str| {
        format!(
            "scene = \"scene.toml\"\n[[variable]]\nname = \"speed\"\nvalues = [80, 90]\n{more}\n[rom.rotor]\n\
             file = \"rom{{speed}}.safetensors\""
        )
    };
    let failure = bench.try_part(&plan(""), "a.parquet", Part::WHOLE, 1).unwrap_err();
    assert!(failure.problem.contains("has the name of a start value"), "{failure}");
    let forces = |more: &str, output: &str| {
        bench.run(&plan(more), output);
        texts(&bench.table(output), "largest_total_normal_force")
    };
    let (set, label) = (forces("field = \"structure[1].speed\"", "b.parquet"), forces("label = true", "c.parquet"));
    assert!(set[0] != set[1] && label[0] == label[1], "{set:?} {label:?}");
}

/// Rows of a ROM must not get the digest of another one.
#[test]
fn rom_that_changes_during_the_sweep_ends_it() {
    let bench = Bench::new();
    let path = bench.path("small.rom.safetensors");
    let cache = RomCache::off();
    let mut store = RomStore::new(&bench, bench.root.path(), &cache, &bench.path("models"));
    let origin = RomOrigin::File(path.clone());
    store.digest(&origin).unwrap();
    let console = Console::new(true, false);
    fs::write(&path, tiprub_format::write_rom(&rom(2e5))).unwrap();
    let failure = store.load(&origin, &console).unwrap_err();
    assert!(failure.problem.contains("has changed since the sweep began"), "{failure}");
    fs::remove_file(&path).unwrap();
    assert!(store.load(&origin, &console).is_err());
    fs::write(&path, tiprub_format::write_rom(&rom(1e5))).unwrap();
    store.load(&origin, &console).unwrap();
    assert!(store.get(&origin).is_ok());
}

/// A column with the name of a result would replace the result.
#[test]
fn label_with_the_name_of_a_result_is_rejected() {
    let bench = Bench::new();
    bench.run(GRID, "a.parquet");
    let whole = bench.table("a.parquet");
    let label = "[[variable]]\nname = \"friction_loss\"\nlabel = true\nvalues = [77]\n";
    let rejected = |plan: &str, output: &str| {
        let failure = bench.try_part(plan, output, Part::WHOLE, 1).unwrap_err();
        assert!(failure.what.contains("variable `friction_loss`"), "{failure}");
        assert!(failure.problem.contains("has the name of an output or a result"), "{failure}");
    };
    rejected(&format!("{GRID}{label}"), "a.parquet");
    assert!(bench.table("a.parquet") == whole && !bench.path("a.parquet.journal").exists());
    // Only the scene of the second run has this result. The rows stay in the journal until the label has another name.
    let energies = "[[variable]]\nname = \"energies\"\nfield = \"outputs.energies\"\nvalues = [false, true]\n";
    let plan = format!("scene = \"scene.toml\"\n{energies}{label}");
    rejected(&plan, "b.parquet");
    let outcome = bench.run(&plan.replace("friction_loss", "label"), "b.parquet");
    assert_eq!((outcome.resumed, outcome.finished), (2, 2));
    let loss = bench.table("b.parquet").columns.into_iter().find(|column| column.name == "friction_loss").unwrap();
    assert!(loss.cells[0].is_none() && loss.cells[1].is_some(), "{loss:?}");
}
