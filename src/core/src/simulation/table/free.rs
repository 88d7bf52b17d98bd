//! Rows of free bodies.

use tiprub_cosim::variables::{Quantity, Span};

use super::builder::TableBuilder;
use super::parts::{AXES, BodyFacts, TableFacts};
use super::rotor::watched_rows;
use crate::Rom;
use crate::scene::ranges;
use crate::simulation::outputs::{each, scalar};
use crate::simulation::units::{FORCE, LENGTH, LINEAR_SPEED};

/// Adds the initial velocity.
pub fn velocity(table: &mut TableBuilder, body: &BodyFacts) {
    for (axis, name) in AXES.into_iter().enumerate() {
        let velocity = table.parameter(
            Quantity::InitialVelocity(axis),
            &format!("initial_velocity_{name}"),
            Some(&LINEAR_SPEED),
            body.structure.velocity[axis],
            &format!("Initial rigid-body velocity of {} along {name}", body.structure.name),
        );
        velocity.nominal(100.0).range(-ranges::VELOCITY, ranges::VELOCITY);
    }
}

/// Adds rigid motion and contact nodes.
pub fn bodies(table: &mut TableBuilder, parts: &TableFacts) {
    for body in parts.bodies.iter().filter(|body| body.free) {
        table.belongs(body.index, format!("{}.", body.structure.name));
        motion(table, body);
        if !parts.settings.outputs.watched_sectors.is_empty() {
            nodes(table, parts, body);
        }
    }
}

fn motion(table: &mut TableBuilder, body: &BodyFacts) {
    let (index, name) = (body.index, &body.structure.name);
    for (axis, letter) in AXES.into_iter().enumerate() {
        let text = format!("Velocity of the centre of mass of {name} along {letter}, mean over the last internal step");
        let read = scalar(move |view| view.centre(index, axis, |(_, increment)| increment / view.system.step_size()));
        let row = table.output(format!("velocity_{letter}"), Span::Point, Some((&LINEAR_SPEED, 100.0)), text, read);
        row.quantity(Quantity::CentreVelocity(axis));
    }
    for (axis, letter) in AXES.into_iter().enumerate() {
        let text = format!("Displacement of the centre of mass of {name} along {letter} since the start");
        let read = scalar(move |view| view.centre(index, axis, |(position, _)| position));
        table.output(format!("displacement_{letter}"), Span::Point, Some((&LENGTH, 1e-2)), text, read).display(1);
    }
}

/// Adds arrays over the contact nodes.
fn nodes(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts) {
    let (list, count, index) = (node_list(body.rom), body.rom.contact_nodes.len(), body.index);
    for row in watched_rows(parts, body, 0, [Some((&LENGTH, 1e-3)), Some((&FORCE, 100.0))]) {
        let text = match row.name {
            "clearance" => {
                "Clearance normal to the surface at the communication point; 1e9 m where a node faces no surface, \
                 beyond an edge, and for nodes in no contact pair"
            }
            "tangential_force" => "Magnitude of the friction force, mean over the communication step",
            _ => row.text,
        };
        let name = row.name.to_owned();
        row.add(table, name, format!("{text} ({list})"), count);
    }
    for (axis, letter) in AXES.into_iter().enumerate() {
        let text = format!("Displacement along {letter} since the start, including rigid-body motion ({list})");
        let read = each(move |view, node| view.modes(index).displacement()[3 * node + axis]);
        let name = format!("node_displacement_{letter}");
        let row = table.output(name, Span::Point, Some((&LENGTH, 1e-3)), text, read);
        row.elements(count).display(1).quantity(Quantity::NodeDisplacement(axis));
    }
}

/// Lists the names of a few nodes; the first and the last of many.
fn node_list(rom: &Rom) -> String {
    let names: Vec<&str> = rom.contact_nodes.iter().map(|node| node.name.as_str()).collect();
    match names.as_slice() {
        [first, .., last] if names.len() > 8 => format!("{} contact nodes, {first} to {last}", names.len()),
        all => all.join(", "),
    }
}
