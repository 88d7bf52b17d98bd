//! The variable table of a scene with a free master.

use super::builder::Builder;
use super::contacts;
use super::outputs::watched_rows;
use super::units::{FORCE, LENGTH, LINEAR_SPEED, TORQUE};
use crate::Result;
use crate::Rom;
use crate::ranges;
use crate::settings::{Scene, StructureSettings};
use crate::simulation::compile::Roles;
use crate::simulation::free::{Pair, pairs};
use crate::simulation::outputs::{Reader, each, scalar};
use crate::variables::{Quantity, Span, Unit, VariableTable};

const AXES: [&str; 3] = ["x", "y", "z"];

/// What of a scene the variables depend on.
struct Parts<'a> {
    scene: &'a Scene,
    master: (&'a StructureSettings, &'a Rom),
    pairs: Vec<Pair>,
}

/// Build the table of a validated scene with a free master.
///
/// # Errors
/// Pairs that do not fit the ROMs.
pub fn build(scene: &Scene) -> Result<(VariableTable, Vec<Reader>)> {
    let roles = Roles::new(scene)?;
    let master = (&scene.settings.structures[roles.master], &scene.roms[roles.master]);
    let parts = Parts { scene, master, pairs: pairs(scene)? };
    let mut table = Builder::default();
    table.time();
    parameters(&mut table, &parts);
    totals(&mut table, &parts);
    body(&mut table, &parts);
    nodes(&mut table, &parts);
    if scene.settings.outputs.energies {
        energies(&mut table, &parts);
    }
    contacts::internal_steps(&mut table, &scene.settings);
    table.finish()
}

impl Parts<'_> {
    fn has_friction(&self) -> bool {
        self.scene.settings.contacts[0].friction > 0.0
    }

    fn surface(&self, pair: &Pair) -> &str {
        &self.scene.settings.surfaces[pair.surface].name
    }
}

fn parameters(table: &mut Builder, parts: &Parts) {
    let (settings, (master, rom)) = (&parts.scene.settings, parts.master);
    let contact = &settings.contacts[0];
    for (axis, name) in AXES.into_iter().enumerate() {
        let velocity = table.parameter(
            Quantity::InitialVelocity(axis),
            &format!("initial_velocity_{name}"),
            Some(&LINEAR_SPEED),
            master.velocity[axis],
            &format!("Velocity of {} as a whole along {name} at the start", master.name),
        );
        velocity.nominal = Some(100.0);
        (velocity.min, velocity.max) = (Some(-ranges::VELOCITY), Some(ranges::VELOCITY));
    }
    if parts.has_friction() {
        table.friction(contact, "Coulomb friction coefficient of all contacts");
    }
    let text = format!("Modal damping ratio of {}; its rigid modes are not damped", master.name);
    table.damping(Quantity::DampingRatio, "damping_ratio", master.damping_ratio.unwrap_or(rom.damping_ratio), &text);
    for (carrier, pair) in parts.pairs.iter().filter(|pair| pair.carrier.is_some()).enumerate() {
        let (structure, rom) = (&settings.structures[pair.structure], &parts.scene.roms[pair.structure]);
        let name = format!("{}.damping_ratio", structure.name);
        let text = format!("Modal damping ratio of {}", structure.name);
        let start = structure.damping_ratio.unwrap_or(rom.damping_ratio);
        table.damping(Quantity::SlaveDampingRatio(carrier), &name, start, &text);
    }
    table.methods(settings);
    table.scene_name(settings);
}

fn totals(table: &mut Builder, parts: &Parts) {
    let (force, master) = (Some((&FORCE, 100.0)), &parts.master.0.name);
    contacts::smallest_clearance(
        table,
        Some((&LENGTH, 1e-3)),
        "Smallest clearance of all contact nodes within the communication step, normal to their surfaces; 1e9 m where none of them \
         has a surface to touch, beyond the edges",
    );
    for (axis, letter) in AXES.into_iter().enumerate() {
        let text = format!("Contact force on {master} along {letter}, all pairs, mean over the communication step");
        let read = scalar(move |view| view.mean * view.window.force_impulse[axis]);
        table.output(format!("force_{letter}"), Span::Mean, force, text, read);
    }
    let moment = Some((&TORQUE, 10.0));
    for (axis, letter) in AXES.into_iter().enumerate() {
        let text = format!(
            "Moment of the contact forces on {master} about {letter} through the origin, all pairs, mean over the communication step"
        );
        let read = scalar(move |view| view.mean * view.window.moment_impulse[axis]);
        table.output(format!("moment_{letter}"), Span::Mean, moment, text, read).quantity = Quantity::Moment(axis);
    }
    for (index, pair) in parts.pairs.iter().enumerate() {
        let surface = parts.surface(pair);
        for (axis, letter) in AXES.into_iter().enumerate() {
            let text = format!(
                "Moment of the contact force on {master} from {surface} about {letter} through the origin, mean over the \
                 communication step"
            );
            let read = scalar(move |view| view.mean * view.window.pair_moment[index][axis]);
            table.output(format!("{surface}.moment_{letter}"), Span::Mean, moment, text, read);
        }
        for (axis, letter) in AXES.into_iter().enumerate() {
            let text =
                format!("Contact force on {master} from {surface} along {letter}, mean over the communication step");
            let read = scalar(move |view| view.mean * view.window.pair_impulse[index][axis]);
            table.output(format!("{surface}.force_{letter}"), Span::Mean, force, text, read);
        }
    }
    contacts::totals(table, parts.has_friction());
}

/// Rigid motion.
fn body(table: &mut Builder, parts: &Parts) {
    let master = &parts.master.0.name;
    for (axis, letter) in AXES.into_iter().enumerate() {
        let text =
            format!("Velocity of the centre of mass of {master} along {letter}, mean over the last internal step");
        let read = scalar(move |view| view.centre(axis, |(_, increment)| increment / view.system.bank().step()));
        let name = format!("{master}.velocity_{letter}");
        table.output(name, Span::Point, Some((&LINEAR_SPEED, 100.0)), text, read).quantity =
            Quantity::CentreVelocity(axis);
    }
    for (axis, letter) in AXES.into_iter().enumerate() {
        let text = format!("Displacement of the centre of mass of {master} along {letter} since the start");
        let read = scalar(move |view| view.centre(axis, |(position, _)| position));
        let name = format!("{master}.displacement_{letter}");
        table.output(name, Span::Point, Some((&LENGTH, 1e-2)), text, read).display = Some(1);
    }
}

/// Arrays over the contact nodes.
fn nodes(table: &mut Builder, parts: &Parts) {
    if parts.scene.settings.outputs.watched_sectors.is_empty() {
        return;
    }
    let (master, rom) = parts.master;
    let (list, count) = (node_list(rom), rom.contact_nodes.len());
    let units: [Option<(&'static Unit, f64)>; 2] = [Some((&LENGTH, 1e-3)), Some((&FORCE, 100.0))];
    for row in watched_rows(0, units) {
        if row.exists(parts.scene.settings.outputs.instantaneous_forces, parts.has_friction()) {
            let text = match row.name {
                "clearance" => {
                    "Clearance normal to the surface at the communication point; 1e9 m where there is nothing to touch, beyond an \
                     edge and for nodes of no pair"
                }
                "tangential_force" => "Magnitude of the friction force, mean over the communication step",
                _ => row.text,
            };
            row.add(table, format!("{}.{}", master.name, row.name), format!("{text} ({list})"), count);
        }
    }
    for (axis, letter) in AXES.into_iter().enumerate() {
        let text = format!("Displacement along {letter} since the start, rigid motion included ({list})");
        let read = each(move |view, node| view.system.bank().displacement()[3 * node + axis]);
        let name = format!("{}.node_displacement_{letter}", master.name);
        let row = table.output(name, Span::Point, Some((&LENGTH, 1e-3)), text, read);
        (row.dimension, row.display, row.quantity) = (Some(count), Some(1), Quantity::NodeDisplacement(axis));
    }
}

/// Names of a few nodes; of many the first and the last.
fn node_list(rom: &Rom) -> String {
    let names: Vec<&str> = rom.contact_nodes.iter().map(|node| node.name.as_str()).collect();
    match names.as_slice() {
        [first, .., last] if names.len() > 8 => format!("{} contact nodes, {first} to {last}", names.len()),
        all => all.join(", "),
    }
}

fn energies(table: &mut Builder, parts: &Parts) {
    let exists = |name: &str| match name {
        "friction_loss" => parts.has_friction(),
        "wear_work" | "load_work" | "external_work" | "shaft_work" | "stiffening_work" | "whirl_work"
        | "shift_work" | "casing_motion_work" => false,
        _ => true,
    };
    let words = [
        "Kinetic energy of all structures, flight included",
        "Strain energy of all structures",
        "Energy lost by contact nodes stopping at a surface since the start",
    ];
    contacts::energies(table, words, exists);
}
