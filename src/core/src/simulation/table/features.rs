//! Rows that only some scenes have.

use tiprub_cosim::variables::{Quantity, Span, Variability};

use super::blades;
use super::builder::TableBuilder;
use super::parts::{BodyFacts, CarrierFacts, PairFacts, TableFacts, largest_length};
use crate::contact::coating::Coating;
use crate::scene::ranges;
use crate::scene::settings::{CoatingSettings, StructureSettings};
use crate::simulation::outputs::{OutputView, array_reader, each, scalar};
use crate::simulation::units::{ANGLE, ENERGY, FORCE, LENGTH, LINE_LOAD, POWER, TEMPERATURE, TORQUE, VOLUME};

/// A linear expansion does not describe temperatures beyond this (K).
pub(crate) const LARGEST_TEMPERATURE: f64 = 3000.0;

/// Returns whether centrifugal, thermal or nodal-diameter loads act.
pub fn is_loaded(parts: &TableFacts) -> bool {
    let loaded = |carrier: &CarrierFacts| carrier.structure.thermal || carrier.structure.load.is_some();
    let heated = |body: &BodyFacts| body.structure.spin.growth || body.structure.thermal;
    parts.bodies.iter().any(heated) || parts.carriers.iter().any(loaded)
}

/// Returns whether inputs move or load a structure; growth and stiffening follow the speed like such an input.
pub(crate) fn has_moving_inputs(parts: &TableFacts) -> bool {
    let moves = |body: &BodyFacts| {
        let StructureSettings { whirl, axial_shift, spin, excitation, .. } = body.structure;
        *whirl || *axial_shift || spin.stiffening || spin.coriolis || excitation.is_some()
    };
    parts.pairs.iter().any(|pair| pair.surface.moving) || parts.bodies.iter().any(moves) || is_loaded(parts)
}

/// Adds whirl, axial shift, excitation, temperatures, nodal-diameter load.
pub fn inputs(table: &mut TableBuilder, parts: &TableFacts) {
    for body in &parts.bodies {
        table.belongs(body.index, parts.of_body(body));
        shaft(table, body);
        blades::inputs(table, parts, body);
    }
    for carrier in &parts.carriers {
        table.belongs(carrier.index, parts.of_carrier(carrier));
        loads(table, carrier);
    }
}

fn shaft(table: &mut TableBuilder, body: &BodyFacts) {
    let largest = largest_length(body.rom);
    let rows = [
        (body.structure.whirl, "whirl_x", "Displacement of the shaft's centre along the fixed x axis"),
        (body.structure.whirl, "whirl_y", "Displacement of the shaft's centre along the fixed y axis"),
        (body.structure.axial_shift, "axial_shift", "Axial displacement of the rotor along +z"),
    ];
    for (component, (exists, name, text)) in rows.into_iter().enumerate() {
        if exists {
            let quantity = Quantity::ShaftDisplacement(component);
            let row = table.moving_input(quantity, name, Some(&LENGTH), 0.0, text);
            row.nominal(1e-4).display(1).range(-largest, largest);
        }
    }
}

fn loads(table: &mut TableBuilder, CarrierFacts { structure, rom, .. }: &CarrierFacts) {
    if let Some(thermal) = rom.extras.thermal.as_ref().filter(|_| structure.thermal) {
        let text = "Temperature of each casing patch relative to the reference temperature, at which the casing is \
                    undeformed";
        let (quantity, name) = (Quantity::CasingTemperature, "casing_temperature");
        let row = table.moving_input(quantity, name, Some(&TEMPERATURE), 0.0, text);
        row.starts(vec![0.0; thermal.patches.len()]).nominal(100.0).range(-LARGEST_TEMPERATURE, LARGEST_TEMPERATURE);
    }
    if let Some(load) = structure.load {
        let text = "Amplitude of the radial nodal-diameter line load on the casing, positive outwards";
        let (name, quantity) = ("casing_load_amplitude", Quantity::LoadAmplitude);
        let row = table.moving_input(quantity, name, Some(&LINE_LOAD), load.amplitude, text);
        row.nominal(1e4).range(-ranges::LINE_LOAD, ranges::LINE_LOAD);
        let text = "Phase of the nodal-diameter load: the load is amplitude cos(n theta - phase)";
        table.moving_input(Quantity::LoadPhase, "casing_load_phase", Some(&ANGLE), load.phase, text).display(0);
    }
}

/// Adds the damping of a surface carrier.
pub fn damping(table: &mut TableBuilder, carrier: &CarrierFacts, prefix: String, name: &str) {
    table.belongs(carrier.index, prefix);
    let ratio = carrier.structure.damping_ratio.unwrap_or(carrier.rom.damping_ratio);
    let row = if carrier.open { "damping_ratio" } else { "casing_damping_ratio" };
    table.damping(Quantity::CarrierDampingRatio, row, ratio, &format!("Modal damping ratio of {name}"));
    blades::mode_damping(table, Quantity::CarrierModeDamping, &format!("{row}s"), carrier.structure, name);
}

/// Adds damping of casings and the fraction of the friction heat.
pub fn parameters(table: &mut TableBuilder, parts: &TableFacts) {
    let carriers = &parts.carriers;
    for carrier in carriers.iter().filter(|carrier| !carrier.open) {
        let name = if carriers.len() > 1 { &carrier.structure.name } else { "the casing" };
        damping(table, carrier, parts.of_carrier(carrier), name);
    }
    for carrier in carriers {
        if let Some(load) = carrier.structure.load {
            table.belongs(carrier.index, parts.of_carrier(carrier));
            let text = "Number of nodal diameters of the radial line load on the casing";
            table.whole(Quantity::LoadOrder, "casing_load_order", load.order, text).min = Some(0.0);
        }
    }
    for pair in &parts.pairs {
        if let Some(share) = pair.contact.slave_heat_fraction.filter(|_| parts.has_friction()) {
            table.belongs(pair.index, parts.of_pair(pair));
            let text = "Fraction of the friction heat that flows into the casing; the rest flows into the blades";
            let row = table.parameter(Quantity::HeatToSlave, "casing_heat_fraction", None, share, text);
            row.range(0.0, 1.0).variability = Variability::Tunable;
        }
    }
}

/// Adds heat, wear and casing displacement.
pub fn outputs(table: &mut TableBuilder, parts: &TableFacts) {
    let pairs = &parts.pairs;
    for pair in pairs.iter().filter(|_| parts.has_friction()) {
        table.belongs(pair.index, parts.of_pair(pair));
        heat(table, pair);
    }
    for pair in pairs {
        table.belongs(pair.index, parts.of_pair(pair));
        if let Some(coating) = &pair.contact.coating {
            wear(table, parts, pair, coating);
        }
    }
    for pair in pairs.iter().filter(|pair| parts.settings.outputs.casing_forces && !pair.body.free) {
        table.belongs(pair.index, parts.of_pair(pair));
        casing_forces(table, pair);
    }
    for carrier in parts.carriers.iter().filter(|_| parts.settings.outputs.support_reaction) {
        if carrier.rom.extras.support.is_some() && !carrier.open {
            table.belongs(carrier.index, parts.of_carrier(carrier));
            support(table, carrier);
        }
    }
    for carrier in parts.carriers.iter().filter(|carrier| parts.settings.outputs.slave_displacement && !carrier.open) {
        table.belongs(carrier.index, parts.of_carrier(carrier));
        let text = "Radial displacement of the contact grid of the casing, ring by ring along z, positive outwards";
        let index = carrier.index;
        let read = array_reader(move |view, out| view.slave_displacement(index, out));
        let row = table.output("casing_displacement", Span::Point, Some((&LENGTH, 1e-4)), text, read);
        row.elements(carrier.rom.contact_nodes.len()).display(1).quantity(Quantity::SlaveDisplacement);
    }
}

/// Adds force and moment on a surface: opposite to those on the rotor, at the same points.
fn casing_forces(table: &mut TableBuilder, pair: &PairFacts) {
    let index = pair.index;
    let text = "Contact force on the casing along the fixed {axis} axis, mean over the communication step";
    table.vector("casing_force", Span::Mean, Some((&FORCE, 100.0)), text, move |view, axis| {
        -view.mean * view.window.pairs[index].force_impulse[axis]
    });
    let text = "Moment of the contact forces on the casing about the fixed {axis} axis through the origin on the casing axis, \
                mean over the communication step";
    table.vector("casing_moment", Span::Mean, Some((&TORQUE, 10.0)), text, move |view, axis| {
        -view.mean * view.window.pairs[index].casing_moment[axis]
    });
}

/// Adds force and moment of the support on a casing.
fn support(table: &mut TableBuilder, carrier: &CarrierFacts) {
    let index = carrier.index;
    let text = "Force of the support on the casing along the fixed {axis} axis, mean over the communication step";
    table.vector("support_force", Span::Mean, Some((&FORCE, 100.0)), text, move |view, axis| view.support(index, axis));
    let text = "Moment of the support on the casing about the fixed {axis} axis through the origin on the casing axis, mean \
                over the communication step";
    let read = move |view: &OutputView, axis: usize| view.support(index, 3 + axis);
    table.vector("support_moment", Span::Mean, Some((&TORQUE, 10.0)), text, read);
}

fn heat(table: &mut TableBuilder, pair: &PairFacts) {
    let (index, power) = (pair.index, Some((&POWER, 100.0)));
    if pair.patches > 0 {
        let text = "Friction power into each casing patch, mean over the communication step";
        let read =
            each(move |view, patch| view.mean * view.slave_share(index) * view.window.pairs[index].patch_heat[patch]);
        table.output("casing_friction_power", Span::Mean, power, text, read).elements(pair.patches);
    }
    if pair.contact.slave_heat_fraction.is_some() {
        let text = "Friction power into the blades, mean over the communication step";
        let read =
            scalar(move |view| view.mean * (1.0 - view.slave_share(index)) * view.window.pairs[index].friction_heat);
        table.output("blade_friction_power", Span::Mean, power, text, read);
    }
}

fn wear(table: &mut TableBuilder, parts: &TableFacts, pair: &PairFacts, coating: &CoatingSettings) {
    let (index, depth) = (pair.index, Some((&LENGTH, coating.thickness)));
    let read = scalar(move |view| view.coating(index, Coating::largest_wear_depth));
    let text = "Largest wear depth of the coating";
    table.output("wear_depth_maximum", Span::Total, depth, text, read).display(1);
    let read = scalar(move |view| view.coating(index, Coating::worn_volume));
    table.output("worn_volume", Span::Total, Some((&VOLUME, 1e-9)), "Worn volume of the coating", read);
    // Total over all coatings.
    if parts.settings.contacts[..index].iter().all(|contact| contact.coating.is_none()) {
        table.belongs_to_all();
        let text = "Energy consumed by wear of the coating since the start; supplied by the shaft if the coating is \
                    cut, and not in the energy balance if it is pressed in";
        let read = scalar(|view| view.ledger.wear_energy.value());
        table.output("wear_energy", Span::Total, Some((&ENERGY, 1.0)), text, read);
        table.belongs(index, parts.of_pair(pair));
    }
    if parts.settings.outputs.wear_profile {
        for (name, around, text) in [
            (
                "wear_profile_around",
                true,
                "Wear depth at each circumferential cell position from theta = 0, mean over the rows along z",
            ),
            ("wear_profile_along", false, "Wear depth of each row along z, mean over the circumference"),
        ] {
            let read = array_reader(move |view, out| view.wear_profile(index, around, out));
            let count = if around { coating.cells_around } else { coating.cells_along };
            table.output(name, Span::Total, depth, text, read).elements(count).display(1);
        }
    }
    if parts.settings.outputs.wear {
        let text = format!(
            "Wear depth of each coating cell: {} cells around from theta = 0, row by row along z ({} rows)",
            coating.cells_around, coating.cells_along
        );
        let read = each(move |view, cell| view.coating(index, |coating| coating.wear_depth(cell)));
        let cells = coating.cells_around * coating.cells_along;
        table.output("wear_depth", Span::Total, depth, text, read).elements(cells).display(1);
    }
}
