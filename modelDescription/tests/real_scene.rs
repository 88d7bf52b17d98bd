//! Descriptions of a real scene: what they claim about outputs holds for the simulation, and the chapter on variables
//! of the user guide lists what the table holds.

#[path = "common/scene.rs"]
mod scene;

use std::fs;
use std::path::Path;

use tiprub_core::settings::{OutputSettings, SceneSettings};
use tiprub_core::variables::{Causality, Kind, Span, Variable};
use tiprub_core::{Simulation, VariableTable};
use tiprub_model_description::meaning_of_span;

fn outputs(table: &VariableTable) -> impl Iterator<Item = (u32, Span)> + '_ {
    let real = |variable: &&Variable| variable.causality == Causality::Output && variable.kind == Kind::Real;
    table.variables().iter().filter(real).flat_map(|variable| {
        let elements = u32::try_from(variable.len()).unwrap();
        (variable.reference..variable.reference + elements).map(|reference| (reference, variable.span))
    })
}

fn bits(simulation: &Simulation) -> Vec<u64> {
    outputs(simulation.table()).map(|(reference, _)| simulation.real(reference).unwrap().to_bits()).collect()
}

fn inputs(simulation: &Simulation) -> Vec<u32> {
    let variables = simulation.table().variables().iter();
    variables.filter(|variable| variable.causality == Causality::Input).map(|variable| variable.reference).collect()
}

#[test]
fn outputs_do_not_depend_on_inputs_set_after_the_step() {
    let mut simulation = Simulation::new(&scene::complete()).unwrap();
    simulation.initialise(0.0).unwrap();
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
    assert_eq!(inputs.len(), 4);
    for reference in inputs {
        simulation.set_real(reference, 1e-5).unwrap();
    }
    assert_eq!(bits(&simulation), before);
    simulation.do_step(20.0 * step, step).unwrap();
    assert_ne!(bits(&simulation), before);
}

#[test]
fn means_and_totals_are_zero_at_the_start_whatever_the_inputs() {
    for value in [0.0, 1e-4] {
        let mut simulation = Simulation::new(&scene::complete()).unwrap();
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
fn the_default_is_at_most_fifty_scalars() {
    let count = |outputs: OutputSettings| {
        let mut scene = scene::complete();
        scene.settings.surfaces[0].moving = false;
        scene.settings.outputs = outputs;
        Simulation::new(&scene).unwrap().table().references()
    };
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

/// Options without which the variable is not in the table.
fn needs(name: &str) -> String {
    let has = |switch_off: fn(&mut SceneSettings)| {
        let mut scene = scene::complete();
        switch_off(&mut scene.settings);
        Simulation::new(&scene).unwrap().table().find(name).is_some()
    };
    let options = scene::OPTIONS.iter().filter(|(_, switch_off)| !has(*switch_off));
    options.map(|(option, _)| *option).collect::<Vec<_>>().join(", ")
}

fn markdown_row(variable: &Variable) -> String {
    let unit = match (variable.kind, variable.unit) {
        (Kind::Real, Some(unit)) => match variable.display {
            Some(index) => format!("{} ({})", unit.name, unit.display[index].0),
            None => unit.name.to_owned(),
        },
        (Kind::Real, None) => "-".to_owned(),
        (Kind::Enumeration(choices), _) => {
            let item = |(index, (name, _)): (usize, &(&str, &str))| format!("{} = `{name}`", index + 1);
            choices.items.iter().enumerate().map(item).collect::<Vec<_>>().join(", ")
        }
        (kind, _) => format!("{kind:?}").to_lowercase(),
    };
    let name = variable.dimension.map_or(variable.name.clone(), |size| format!("{}[1..{size}]", variable.name));
    let set = matches!(variable.causality, Causality::Input | Causality::Parameter);
    let value = match (set, variable.variability) {
        (true, variability) => format!("{variability:?}").to_lowercase(),
        (false, _) => meaning_of_span(variable.span).0.to_owned(),
    };
    format!("| `{name}` | {unit} | {value} | {} | {} |\n", needs(&variable.name), variable.description)
}

fn markdown(table: &VariableTable) -> String {
    let mut text = String::new();
    for (heading, causality) in [
        ("Inputs", Causality::Input),
        ("Parameters", Causality::Parameter),
        ("Outputs", Causality::Output),
        ("Others", Causality::Local),
        ("Time", Causality::Independent),
    ] {
        text +=
            &format!("\n### {heading}\n\n| name | unit (display) | value | needs | meaning |\n|---|---|---|---|---|\n");
        table.variables().iter().filter(|v| v.causality == causality).for_each(|v| text += &markdown_row(v));
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
    let expected = markdown(Simulation::new(&scene::complete()).unwrap().table());
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        fs::write(&path, format!("{before}{BEGIN}{expected}{END}{after}")).unwrap();
    } else {
        let difference = expected.lines().zip(found.lines()).find(|(expected, found)| expected != found);
        assert_eq!(difference, None, "run with UPDATE_SNAPSHOTS=1 to write the chapter anew");
        assert_eq!(expected, found);
    }
}
