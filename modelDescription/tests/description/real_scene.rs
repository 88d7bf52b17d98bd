//! Descriptions of a real scene: their statements about outputs agree with the simulation, and the chapter on variables in the user guide lists the
//! variables of the table.

use std::fs;
use std::path::Path;

use tiprub_core::scene::settings::OutputSettings;
use tiprub_core::{CoSimulation, Scene, Simulation, VariableTable};
use tiprub_cosim::variables::{Causality, DataType, Span, Variable};
use tiprub_model_description::{fmi2_xml, fmi3_xml, html, meaning_of_span};
use tiprub_test_models::started;

use crate::scene;

fn outputs(table: &VariableTable) -> impl Iterator<Item = (u32, Span)> + '_ {
    let real = |variable: &&Variable| variable.causality == Causality::Output && variable.kind == DataType::Real;
    table.variables().iter().filter(real).flat_map(|variable| {
        let elements = u32::try_from(variable.len()).unwrap();
        (variable.reference..variable.reference + elements).map(|reference| (reference, variable.span))
    })
}

fn bits(simulation: &Simulation) -> Vec<u64> {
    outputs(simulation.table()).map(|(reference, _)| simulation.real(reference).unwrap().to_bits()).collect()
}

fn inputs(simulation: &Simulation) -> Vec<u32> {
    let inputs = simulation.table().variables().iter().filter(|variable| variable.causality == Causality::Input);
    inputs.flat_map(|v| v.reference..v.reference + u32::try_from(v.len()).unwrap()).collect()
}

#[test]
fn outputs_do_not_depend_on_inputs_set_after_the_step() {
    for (scene, inputs) in [(scene::rigid(), 4), (scene::complete(), 15)] {
        keep_after_the_step(&scene, inputs);
    }
}

#[track_caller]
fn keep_after_the_step(scene: &Scene, count: usize) {
    let mut simulation = started(scene);
    let step = 1e-5;
    let in_contact = simulation.table().find("in_contact").unwrap().reference;
    let mut contacts = 0;
    for index in 0..20 {
        simulation.do_step(f64::from(index) * step, step).unwrap();
        contacts += i32::from(simulation.boolean(in_contact).unwrap());
    }
    assert!(contacts > 5, "{contacts} communication points with contact");
    let before = bits(&simulation);
    let inputs = inputs(&simulation);
    assert_eq!(inputs.len(), count);
    for reference in inputs {
        simulation.set_real(reference, 1e-5).unwrap();
    }
    assert_eq!(bits(&simulation), before);
    simulation.do_step(20.0 * step, step).unwrap();
    assert_ne!(bits(&simulation), before);
}

#[test]
fn means_and_totals_start_at_zero_for_any_inputs() {
    for (scene, value) in [(scene::rigid(), 0.0), (scene::complete(), 0.0), (scene::complete(), 1e-4)] {
        let mut simulation = Simulation::new(&scene).unwrap();
        for reference in inputs(&simulation) {
            simulation.set_real(reference, value).unwrap();
        }
        simulation.initialise(0.5).unwrap();
        let table = simulation.table();
        let zero = outputs(table).filter(|(_, span)| matches!(span, Span::Mean | Span::Total));
        let found: Vec<_> = zero.map(|(reference, _)| simulation.real(reference).unwrap()).collect();
        assert!(found.len() > 40, "{} values", found.len());
        assert!(found.iter().all(|value| *value == 0.0), "{found:?}");
    }
}

#[test]
fn describes_arrays_and_kelvin_for_each_version() {
    let simulation = Simulation::new(scene::complete()).unwrap();
    let roms = scene::complete().roms;
    let description = |fmi3_arrays| scene::description(simulation.table(), &roms, fmi3_arrays);
    let (two, arrays, scalars) =
        (fmi2_xml(&description(true)), fmi3_xml(&description(true)), fmi3_xml(&description(false)));
    let first = simulation.table().find("casing_temperature").unwrap().reference;
    let variable = |xml: &str, name: &str| -> String {
        let start = xml.find(&format!("name=\"{name}\"")).unwrap_or_else(|| panic!("{name}"));
        let begin = xml[..start].rfind('<').unwrap();
        let end = xml[start..].find("name=").map_or(0, |_| xml[start + 5..].find("name=\"").unwrap() + start);
        xml[begin..end].to_owned()
    };
    let array = variable(&arrays, "casing_temperature");
    for part in
        ["<Float64 ", "causality=\"input\"", "start=\"0.0 0.0 0.0 0.0\"", "unit=\"K\"", "<Dimension start=\"4\"/>"]
    {
        assert!(array.contains(part), "{part} is not in {array}");
    }
    assert!(array.contains(&format!("valueReference=\"{first}\"")), "{array}");
    for element in 1..=4 {
        let reference = format!("valueReference=\"{}\"", first + element - 1);
        for xml in [&two, &scalars] {
            let row = variable(xml, &format!("casing_temperature[{element}]"));
            for part in ["causality=\"input\"", "start=\"0.0\"", "unit=\"K\"", &reference] {
                assert!(row.contains(part), "{part} is not in {row}");
            }
            assert!(!row.contains("Dimension"), "{row}");
        }
    }
    for xml in [&two, &arrays, &scalars] {
        let unit = &xml[xml.find("<Unit name=\"K\">").unwrap()..];
        assert!(unit[..unit.find("</Unit>").unwrap()].contains("<BaseUnit K=\"1\"/>"), "{unit}");
        for item in ["massless-boundary", "coulomb"] {
            let item = &xml[xml.find(&format!("<Item name=\"{item}\"")).unwrap()..];
            assert!(item[..item.find("/>").unwrap()].contains("value=\"3\""), "{xml}");
        }
    }
}

#[test]
fn page_describes_grid_heat_and_spin() {
    let simulation = Simulation::new(scene::complete()).unwrap();
    let roms = scene::complete().roms;
    let page = html(&scene::description(simulation.table(), &roms, true));
    for part in [
        "a grid of 24 around the circumference and 3 along the axis",
        "speeds up to 2000 rad/s",
        "<td class=\"number\">90.0000 to 180.000</td><td class=\"number\">-0.02000 to 0.05000</td>",
        "<code>casing_temperature[1..4]</code></td><td>K</td>",
    ] {
        assert!(page.contains(part), "{part} is not in {page}");
    }
    assert!(!page.contains("c17"), "not every node of the grid by name");
}

#[test]
fn default_has_at_most_50_scalars_with_fixed_steps() {
    let count_with = |tolerance: Option<f64>, outputs: OutputSettings| {
        let mut scene = scene::rigid();
        // The ROM has no watched points, which would add four outputs each.
        scene.roms[0].extras.watched = None;
        scene.settings.surfaces[0].moving = false;
        (scene.settings.outputs, scene.settings.time.tolerance) = (outputs, tolerance);
        // The time is not counted.
        Simulation::new(&scene).unwrap().table().references() - 1
    };
    let adaptive = count_with(Some(1e-3), OutputSettings::default());
    assert!(adaptive <= 57, "{adaptive} scalars");
    let count = |outputs: OutputSettings| count_with(None, outputs);
    let least = count(OutputSettings::default());
    assert!(least <= 50, "{least} scalars");
    let more = |change: fn(&mut OutputSettings)| {
        let mut outputs = OutputSettings::default();
        change(&mut outputs);
        count(outputs) - least
    };
    assert_eq!(more(|outputs| outputs.watched_sectors = vec![1, 2]), 4 * 3);
    assert_eq!(more(|outputs| outputs.all_sectors = true), 2 * 36);
    assert_eq!(more(|outputs| outputs.nodal_diameters = Some(18)), 19);
}

/// Returns the options without which the variable is not in the table.
fn needs(name: &str) -> String {
    let has = |switch_off: fn(&mut Scene)| {
        let mut scene = scene::complete();
        switch_off(&mut scene);
        Simulation::new(&scene).unwrap().table().find(name).is_some()
    };
    if !has(|_| {}) {
        return rigid_needs(name);
    }
    let chosen = |options: &[scene::Switch]| -> Vec<_> {
        options.iter().filter(|(_, switch_off)| !has(*switch_off)).map(|(option, _)| *option).collect()
    };
    let mut options = chosen(&scene::OPTIONS);
    if !options.iter().any(|option| ["`thermal = true`", "`structure` of the surface"].contains(option)) {
        options.extend(chosen(&scene::ALTERNATIVES));
    }
    options.join(", ")
}

/// Returns the options for variables of rigid casings only: the shape turns with an input.
fn rigid_needs(name: &str) -> String {
    let has = |change: fn(&mut Scene)| {
        let mut scene = scene::rigid();
        change(&mut scene);
        Simulation::new(&scene).unwrap().table().find(name).is_some()
    };
    assert!(has(|_| {}), "{name}");
    let of_casing = |option: &&scene::Switch| !["`thermal = true`", "`load` of the casing"].contains(&option.0);
    let options = scene::OPTIONS.iter().filter(of_casing).filter(|(_, switch_off)| !has(*switch_off));
    let options = options.map(|(option, _)| *option).chain(["a rigid surface (no `structure`)"]);
    options.collect::<Vec<_>>().join(", ")
}

/// Returns the valid values in the form of the page inside an FMU.
fn range(variable: &Variable) -> String {
    // Four digits are enough for limits that depend on the scene.
    let number = |value: f64| match value.abs() {
        size if size != 0.0 && !(1e-3..1e6).contains(&size) => format!("{value:e}"),
        _ => format!("{}", (value * 1e4).round() / 1e4),
    };
    match (variable.min, variable.max) {
        (Some(min), Some(max)) => format!("{} to {}", number(min), number(max)),
        (None, None) => String::new(),
        (Some(min), None) => format!("≥ {}", number(min)),
        (min, max) => panic!("`{}` has one limit only: {min:?}, {max:?}", variable.name),
    }
}

fn markdown_row(variable: &Variable) -> String {
    let unit = match (variable.kind, variable.unit) {
        (DataType::Real, Some(unit)) => match variable.display {
            Some(index) => format!("{} ({})", unit.name, unit.display[index].0),
            None => unit.name.to_owned(),
        },
        (DataType::Real, None) => "-".to_owned(),
        (DataType::Enumeration(choices), _) => {
            let item = |(index, (name, _)): (usize, &(&str, &str))| format!("{} = `{name}`", index + 1);
            choices.items.iter().enumerate().map(item).collect::<Vec<_>>().join(", ")
        }
        (kind, _) => format!("{kind:?}").to_lowercase(),
    };
    let name = variable.dimension.map_or(variable.name.clone(), |size| format!("{}[1..{size}]", variable.name));
    let value = match is_set(variable.causality) {
        true => format!("{:?} | {}", variable.variability, range(variable)).to_lowercase(),
        false => meaning_of_span(variable.span).0.to_owned(),
    };
    format!("| `{name}` | {unit} | {value} | {} | {} |\n", needs(&variable.name), variable.description)
}

fn is_set(causality: Causality) -> bool {
    matches!(causality, Causality::Input | Causality::Parameter)
}

/// Returns the variables of the complete scene, and those of a rigid casing only.
fn all_variables() -> Vec<Variable> {
    let rows = |scene: &Scene| Simulation::new(scene).unwrap().table().variables().to_vec();
    let mut all = rows(&scene::complete());
    let rigid = rows(&scene::rigid());
    for (index, variable) in rigid.iter().enumerate() {
        if all.iter().all(|other| other.name != variable.name) {
            let before = all.iter().position(|other| other.name == rigid[index - 1].name).unwrap();
            all.insert(before + 1, variable.clone());
        }
    }
    all
}

fn markdown(variables: &[Variable]) -> String {
    let mut text = String::new();
    for (heading, causality) in [
        ("Inputs", Causality::Input),
        ("Parameters", Causality::Parameter),
        ("Outputs", Causality::Output),
        ("Others", Causality::Local),
        ("Time", Causality::Independent),
    ] {
        let (range, line) = if is_set(causality) { ("range | ", "---|") } else { ("", "") };
        text += &format!(
            "\n### {heading}\n\n| name | unit (display) | value | {range}needs | meaning |\n|---|---|---|{line}---|---|\n"
        );
        variables.iter().filter(|v| v.causality == causality).for_each(|v| text += &markdown_row(v));
    }
    text
}

#[test]
fn the_chapter_on_variables_lists_the_table() {
    const BEGIN: &str = "<!-- generated: variables -->\n";
    const END: &str = "<!-- end of generated part -->";
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/variables.md");
    let chapter = fs::read_to_string(&path).unwrap();
    let (before, rest) = chapter.split_once(BEGIN).expect("start mark");
    let (found, after) = rest.split_once(END).expect("end mark");
    let expected = markdown(&all_variables());
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        fs::write(&path, format!("{before}{BEGIN}{expected}{END}{after}")).unwrap();
    } else {
        let difference = expected.lines().zip(found.lines()).find(|(expected, found)| expected != found);
        assert_eq!(difference, None, "run with UPDATE_SNAPSHOTS=1 to write the chapter anew");
        assert_eq!(expected, found);
    }
}
