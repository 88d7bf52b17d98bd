//! Outputs of a rotor, one row each with its reader.

use tiprub_cosim::variables::{NO_CLEARANCE, Quantity, Span, VariableUnit};

use super::builder::{NominalUnit, TableBuilder};
use super::parts::{BodyFacts, TableFacts, refuse};
use crate::Result;
use crate::scene::rom::{ContactNode, DisplacementFrame, STRESSES};
use crate::simulation::outputs::{OutputReader, array_reader, each, scalar};
use crate::simulation::units::{ANGLE, FORCE, LENGTH, LINE_LOAD, PRESSURE, STRESS};

pub fn angle(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts) {
    let index = body.index;
    let text = format!("Angle of {} about +z", parts.rotor(body));
    let read = scalar(move |view| view.simulation.state.inputs.rotors[index].total_angle(view.elapsed));
    let angle = table.output("rotor_angle", Span::Point, Some((&ANGLE, 1.0)), text, read);
    angle.display(0).quantity(Quantity::RotorAngle);
}

/// Clearance for nominal values of a rotor's outputs (m): that of its first pair.
fn nominal(parts: &TableFacts, body: &BodyFacts) -> NominalUnit {
    let mut pairs = parts.plan.pairs_of(body.index);
    let gap = pairs.next().map_or(0.0, |(pair, _)| parts.settings.contacts[pair].nominal_gap());
    Some((&LENGTH, gap))
}

pub fn clearances(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts) {
    let index = body.index;
    let text = format!(
        "Smallest clearance over all sectors within the communication step, per contact node ({}){}",
        names(&body.rom.contact_nodes),
        untouched(parts, body)
    );
    let read = each(move |view, node| view.lowest_of_node(index, node));
    let row = table.output("node_clearance_minimum", Span::Window, nominal(parts, body), text, read);
    row.elements(body.rom.contact_nodes.len()).display(1);
}

/// Describes clearances if there is no surface to touch.
fn untouched(parts: &TableFacts, body: &BodyFacts) -> &'static str {
    let paired: usize = parts.plan.pairs_of(body.index).map(|(_, pair)| pair.nodes.len()).sum();
    if paired < body.rom.contact_nodes.len() { "; 1e9 m at nodes in no contact pair" } else { "" }
}

fn names(points: &[ContactNode]) -> String {
    points.iter().map(|point| point.name.as_str()).collect::<Vec<_>>().join(", ")
}

pub fn watched(table: &mut TableBuilder, parts: &TableFacts) -> Result<()> {
    let bodies = &parts.bodies;
    let most = bodies.iter().map(|body| body.rom.sectors).max().unwrap_or(0);
    for sector in &parts.settings.outputs.watched_sectors {
        if *sector == 0 || *sector > most {
            let remedy = "Use sector numbers from 1 to the number of sectors of the ROM";
            return refuse("watched_sectors", format!("sector {sector} is outside 1 to {most}"), remedy.to_owned());
        }
    }
    for body in bodies.iter().filter(|body| !body.free) {
        if let Some(count) =
            parts.settings.outputs.modal_amplitudes.filter(|count| !(1..=body.rom.order()).contains(count))
        {
            let problem = format!("{count} modes requested for {}, which has {}", parts.rotor(body), body.rom.order());
            return refuse("modal_amplitudes", problem, format!("Request 1 to {} modes", body.rom.order()));
        }
        table.belongs(body.index, parts.of_body(body));
        for sector in &parts.settings.outputs.watched_sectors {
            if *sector <= body.rom.sectors {
                watch(table, parts, body, *sector);
            }
        }
    }
    Ok(())
}

fn watch(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts, sector: usize) {
    watched_points(table, parts, body, sector);
    if parts.settings.outputs.stress {
        stresses(table, body, sector);
    }
    modes(table, parts, body, sector);
    if parts.settings.outputs.tip_displacements {
        tips(table, parts, body, sector);
    }
    patches(table, body, sector);
    let list = names(&body.rom.contact_nodes);
    for row in watched_rows(parts, body, sector - 1, [nominal(parts, body), Some((&FORCE, 100.0))]) {
        let untouched = if row.is_length() { untouched(parts, body) } else { "" };
        let text = format!("{} ({list}){untouched}", row.text);
        let name = format!("blade[{sector}].{}", row.name);
        row.add(table, name, text, body.rom.contact_nodes.len());
    }
}

/// Components of displacements in both frames.
const COMPONENTS: [[&str; 3]; 2] = [["radial", "tangential", "axial"], ["x", "y", "z"]];

/// Adds displacements and clearances of the watched points of a ROM.
fn watched_points(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts, sector: usize) {
    let Some(watched) = &body.rom.extras.watched else { return };
    let (list, count) = (names(&watched.points), watched.points.len());
    for (axis, name) in COMPONENTS[body.rom.frame as usize].into_iter().enumerate() {
        let index = body.index;
        let text = format!("Displacement of watched points, {name} ({list})");
        let read = each(move |view, point| view.simulation.watched_row(index, 3 * point + axis, sector - 1));
        let row =
            table.output(format!("blade[{sector}].{name}_displacement"), Span::Point, nominal(parts, body), text, read);
        row.elements(count).display(1);
    }
    if body.rom.frame == DisplacementFrame::Cartesian {
        return;
    }
    let index = body.index;
    let untouched = untouched(parts, body);
    let text =
        format!("Clearance of watched points normal to the casing at the communication point ({list}){untouched}");
    let read = each(move |view, point| view.simulation.outputs.watched_gaps.clearance(index, point, sector - 1));
    let name = format!("blade[{sector}].watched_clearance");
    let row = table.output(name, Span::Point, nominal(parts, body), text, read);
    row.elements(count).display(1);
}

/// Adds amplitudes of the lowest modes.
fn modes(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts, sector: usize) {
    let Some(count) = parts.settings.outputs.modal_amplitudes else { return };
    let index = body.index;
    let text = format!(
        "Amplitudes of the lowest {count} modes, normalised to a modal mass of 1 kg with displacements in m per unit \
         amplitude; positive if the contact node with the largest displacement in the mode moves in its positive \
         direction"
    );
    let read = each(move |view, mode| view.modal_amplitude(index, sector - 1, mode));
    table.output(format!("blade[{sector}].modal_amplitude"), Span::Point, None, text, read).elements(count);
}

/// Adds displacements of the contact nodes.
fn tips(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts, sector: usize) {
    let index = body.index;
    for (axis, name) in COMPONENTS[body.rom.frame as usize].into_iter().enumerate() {
        let text = format!("Displacement of contact nodes, {name} ({})", names(&body.rom.contact_nodes));
        let read = each(move |view, node| view.modes(index).row(3 * node + axis, sector - 1));
        let name = format!("blade[{sector}].tip_{name}_displacement");
        let row = table.output(name, Span::Point, nominal(parts, body), text, read);
        row.elements(body.rom.contact_nodes.len()).display(1);
    }
}

/// Components of stress in both frames.
const STRESS_COMPONENTS: [[&str; STRESSES]; 2] = [
    ["radial", "tangential", "axial", "radial_tangential", "tangential_axial", "axial_radial"],
    ["x", "y", "z", "xy", "yz", "zx"],
];

/// Adds the stress at the places where a ROM recovers it.
fn stresses(table: &mut TableBuilder, body: &BodyFacts, sector: usize) {
    let Some(stress) = &body.rom.extras.stress else { return };
    let (index, places) = (body.index, stress.points.len());
    let list = names(&stress.points);
    let mut add = |name: String, text: String, read: OutputReader| {
        let row = table.output(format!("blade[{sector}].{name}"), Span::Point, Some((&STRESS, 1e8)), text, read);
        row.elements(places).display(0);
    };
    let read = each(move |view, place| view.von_mises(index, sector - 1, place));
    add("von_mises_stress".to_owned(), format!("Von Mises equivalent stress ({list})"), read);
    for (component, name) in STRESS_COMPONENTS[body.rom.frame as usize].into_iter().enumerate() {
        let text = format!(
            "{} stress, {} ({list})",
            if component < 3 { "Normal" } else { "Shear" },
            name.replace('_', " and ")
        );
        let read = each(move |view, place| view.stress(index, sector - 1, place, component));
        add(format!("{name}_stress"), text, read);
    }
}

/// A force over the extent of a patch: name, words, unit, nominal value, and the extent of a contact node.
type PerExtent = (&'static str, &'static str, &'static VariableUnit, f64, fn(&ContactNode) -> f64);

const PER_EXTENT: [PerExtent; 2] = [
    ("normal_pressure", "pressure", &PRESSURE, 1e6, |node| node.area),
    ("normal_line_force", "force per unit length along the chord", &LINE_LOAD, 1e4, |node| node.length),
];

/// Adds pressure and force per length of contact patches.
fn patches(table: &mut TableBuilder, body: &BodyFacts, sector: usize) {
    for (name, quantity, unit, nominal, extent) in PER_EXTENT {
        let extents: Vec<f64> = body.rom.contact_nodes.iter().map(extent).collect();
        if extents.contains(&0.0) {
            continue;
        }
        let (index, count) = (body.index, extents.len());
        let list = names(&body.rom.contact_nodes);
        let text =
            format!("Normal contact {quantity} at the centre of each patch ({list}), mean over the communication step");
        let read = each(move |view, node| view.mean * view.normal_impulse(index, node, sector - 1) / extents[node]);
        table.output(format!("blade[{sector}].{name}"), Span::Mean, Some((unit, nominal)), text, read).elements(count);
    }
}

/// An output over the contact nodes of a sector.
pub(crate) struct NodeRow {
    quantity: Quantity,
    pub name: &'static str,
    span: Span,
    unit: NominalUnit,
    pub text: &'static str,
    read: OutputReader,
}

impl NodeRow {
    fn is_length(&self) -> bool {
        self.unit.is_some_and(|(unit, _)| *unit == LENGTH)
    }

    pub fn add(self, table: &mut TableBuilder, name: String, text: String, nodes: usize) {
        let display = self.is_length().then_some(1);
        let row = table.output(name, self.span, self.unit, text, self.read);
        row.elements(nodes).quantity(self.quantity).display = display;
    }
}

/// Returns the outputs over the contact nodes of a sector of a structure (0-based), with the units of gaps and forces.
/// Outputs of friction and of single internal steps are included only if the scene has them.
pub(crate) fn watched_rows(
    parts: &TableFacts,
    body: &BodyFacts,
    sector: usize,
    [gap, force]: [NominalUnit; 2],
) -> Vec<NodeRow> {
    let friction = if body.free { parts.has_friction() } else { parts.has_tangential_forces() };
    let (instantaneous, body) = (parts.settings.outputs.instantaneous_forces, body.index);
    let mut rows = Vec::new();
    let mut add =
        |quantity, name, span, unit, text, read| rows.push(NodeRow { quantity, name, span, unit, text, read });
    let text = "Clearance normal to the casing at the communication point";
    let read = each(move |view, node| view.system.structures()[body].gap(node, sector).min(NO_CLEARANCE));
    add(Quantity::Clearance(sector), "clearance", Span::Point, gap, text, read);
    let text = "Smallest clearance within the communication step";
    let read = each(move |view, node| view.lowest_at(body, node, sector));
    add(Quantity::WatchedClearanceMinimum(sector), "clearance_minimum", Span::Window, gap, text, read);
    let text = "Normal contact force, mean over the communication step";
    let read = each(move |view, node| view.mean * view.normal_impulse(body, node, sector));
    add(Quantity::NormalForce(sector), "normal_force", Span::Mean, force, text, read);
    if friction {
        let text = "Magnitude of the friction force (axial part included), mean over the communication step";
        let read = each(move |view, node| {
            view.mean * view.window.bodies[body].tangential_impulse[view.index(body, node, sector)]
        });
        add(Quantity::TangentialForce(sector), "tangential_force", Span::Mean, force, text, read);
    }
    if instantaneous {
        let text = "Normal contact force in the last internal step";
        let read = each(move |view, node| view.system.structures()[body].multiplier(node, sector));
        add(Quantity::Output, "normal_force_instantaneous", Span::Point, force, text, read);
    }
    if friction && instantaneous {
        let text = "Friction force in the last internal step";
        let read = each(move |view, node| view.tangential_now(body, node, sector));
        add(Quantity::Output, "tangential_force_instantaneous", Span::Point, force, text, read);
    }
    rows
}

pub fn fields(table: &mut TableBuilder, parts: &TableFacts) -> Result<()> {
    for body in parts.bodies.iter().filter(|body| !body.free) {
        table.belongs(body.index, parts.of_body(body));
        if parts.settings.outputs.all_sectors {
            all_sectors(table, parts, body);
        }
        if let Some(largest) = parts.settings.outputs.nodal_diameters {
            nodal_diameters(table, parts, body, largest)?;
        }
    }
    Ok(())
}

fn all_sectors(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts) {
    let (index, sectors) = (body.index, body.rom.sectors);
    let text = "Smallest clearance of each sector within the communication step";
    let read = each(move |view, sector| view.lowest_of_sector(index, sector));
    let clearance = table.output("sector_clearance_minimum", Span::Window, nominal(parts, body), text, read);
    clearance.elements(sectors).display(1);
    let text = "Normal contact force of each sector, mean over the communication step";
    let read = each(move |view, sector| {
        let impulses = &view.window.bodies[index].normal_impulse;
        view.mean * view.of_sector(index, impulses, sector).sum::<f64>()
    });
    table.output("sector_normal_force", Span::Mean, Some((&FORCE, 100.0)), text, read).elements(sectors);
}

fn nodal_diameters(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts, largest: usize) -> Result<()> {
    let (index, sectors, rows) = (body.index, body.rom.sectors, body.rom.rows());
    if largest > sectors / 2 {
        let remedy = format!("Use at most {}", sectors / 2);
        return refuse("nodal_diameters", format!("{largest} is too large for {sectors} sectors"), remedy);
    }
    let text = "Amplitude of the radial displacement of the middle contact node (mean over the rows of patches) per nodal \
                diameter 0, 1, 2, …";
    let read = array_reader(move |view, out| view.nodal_diameters(index, rows, out));
    let amplitude = table.output("nodal_diameter_amplitude", Span::Point, nominal(parts, body), text, read);
    amplitude.elements(largest + 1).display(1).quantity(Quantity::NodalDiameterAmplitude);
    Ok(())
}
