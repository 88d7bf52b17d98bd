//! Terminals: every member is a variable of the description, ports are complete, and a scene without terminals has no file.

use std::collections::BTreeSet;

use tiprub_core::{CoSimulation, Simulation};
use tiprub_model_description::{fmi3_terminals, fmi3_xml};

use crate::scene;

/// Returns the values of one attribute, in order.
fn values<'a>(xml: &'a str, attribute: &str) -> Vec<&'a str> {
    let key = format!(" {attribute}=\"");
    xml.split(&key).skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}

#[test]
fn terminal_members_exist_and_terminals_are_complete() {
    let complete = scene::complete();
    let simulation = Simulation::new(&complete).unwrap();
    for arrays in [false, true] {
        let description = scene::description(simulation.table(), &complete.roms, arrays);
        let xml = fmi3_xml(&description);
        let names: BTreeSet<&str> = values(&xml, "name").into_iter().collect();
        let terminals = fmi3_terminals(&description).unwrap();
        let members = values(&terminals, "variableName");
        assert!(members.iter().all(|member| names.contains(member)), "{members:?}");
        assert_eq!(members.iter().collect::<BTreeSet<_>>().len(), members.len(), "a variable belongs to one terminal");
        assert_eq!(members[..3], ["rotor_angle", "speed", "torque"]);
        let ports = values(&terminals, "name");
        let patches = if arrays {
            vec!["casing_patch".to_owned()]
        } else {
            (1..=4).map(|patch| format!("casing_patch[{patch}]")).collect()
        };
        assert_eq!(ports[..2], ["shaft", "centre"]);
        assert_eq!(ports[2..], patches);
        for port in terminals.split("<Terminal ").filter(|port| port.contains("casing_patch")) {
            assert_eq!(values(port, "memberName"), ["temperature", "heat"]);
            assert_eq!(values(port, "variableKind"), ["signal", "outflow"]);
        }
    }
}

/// Patches of a surface are at other places than those of the ROM, even if their numbers are equal.
#[test]
fn no_heat_terminal_for_surface_patches() {
    let complete = scene::complete();
    let simulation = Simulation::new(&complete).unwrap();
    let mut description = scene::description(simulation.table(), &complete.roms, false);
    description.patches_of_roms = false;
    assert_eq!(values(&fmi3_terminals(&description).unwrap(), "name"), ["shaft", "centre"]);
}

#[test]
fn single_rotor_has_shaft_and_force_terminals() {
    let rigid = scene::rigid();
    let simulation = Simulation::new(&rigid).unwrap();
    let terminals = fmi3_terminals(&scene::description(simulation.table(), &rigid.roms, false)).unwrap();
    assert_eq!(values(&terminals, "name"), ["shaft", "centre"]);
    assert!(values(&terminals, "memberName").contains(&"force_x"));
}
