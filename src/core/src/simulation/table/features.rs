//! Rows of what only some scenes ask for.

use super::builder::Builder;
use super::units::{ANGLE, ENERGY, LENGTH, LINE_LOAD, POWER, TEMPERATURE, VOLUME};
use super::{Parts, has_friction, largest_length};
use crate::contact::coating::Coating;
use crate::ranges;
use crate::simulation::outputs::{each, scalar, whole};
use crate::variables::{Kind, Quantity, Span, Start, Variability};

/// Temperatures beyond this are not what a linear expansion describes (K).
const LARGEST_TEMPERATURE: f64 = 3000.0;

/// Whether centrifugal, thermal or nodal-diameter loads act.
pub fn is_loaded(scene: &Parts) -> bool {
    scene.master.spin.growth || scene.carrier.is_some_and(|(carrier, _)| carrier.thermal || carrier.load.is_some())
}

/// Whether inputs move or load something; growth and stiffening follow the speed as such an input.
pub fn has_moving_inputs(scene: &Parts) -> bool {
    let Parts { master, surface, .. } = scene;
    surface.moving
        || master.whirl
        || master.axial_shift
        || master.spin.stiffening
        || master.spin.coriolis
        || is_loaded(scene)
}

/// Whirl, axial shift, temperatures, nodal-diameter load.
pub fn inputs(table: &mut Builder, scene: &Parts) {
    let largest = largest_length(scene);
    let mut shaft = |component: usize, name: &str, text: &str| {
        let row = table.moving_input(Quantity::ShaftDisplacement(component), name, Some(&LENGTH), 0.0, text);
        (row.nominal, row.display) = (Some(1e-4), Some(1));
        (row.min, row.max) = (Some(-largest), Some(largest));
    };
    if scene.master.whirl {
        shaft(0, "whirl_x", "Displacement of the shaft's centre along fixed x");
        shaft(1, "whirl_y", "Displacement of the shaft's centre along fixed y");
    }
    if scene.master.axial_shift {
        shaft(2, "axial_shift", "Axial displacement of the rotor along +z");
    }
    let Some((carrier, rom)) = scene.carrier else { return };
    if let Some(thermal) = rom.extras.thermal.as_ref().filter(|_| carrier.thermal) {
        let row = table.moving_input(
            Quantity::CasingTemperature,
            "casing_temperature",
            Some(&TEMPERATURE),
            0.0,
            "Temperature of each casing patch above the reference, at which the casing is undeformed",
        );
        let patches = thermal.patches.len();
        row.dimension = Some(patches);
        row.start = Some(Start::Real(vec![0.0; patches]));
        row.nominal = Some(100.0);
        (row.min, row.max) = (Some(-LARGEST_TEMPERATURE), Some(LARGEST_TEMPERATURE));
    }
    if let Some(load) = carrier.load {
        let text = "Amplitude of the radial line load with nodal diameters on the casing, outwards positive";
        let row = table.moving_input(
            Quantity::LoadAmplitude,
            "casing_load_amplitude",
            Some(&LINE_LOAD),
            load.amplitude,
            text,
        );
        row.nominal = Some(1e4);
        (row.min, row.max) = (Some(-ranges::LINE_LOAD), Some(ranges::LINE_LOAD));
        let text = "Phase of the nodal-diameter load: amplitude cos(n theta - phase)";
        table.moving_input(Quantity::LoadPhase, "casing_load_phase", Some(&ANGLE), load.phase, text).display = Some(0);
    }
}

/// Damping of the casing, share of the friction heat.
pub fn parameters(table: &mut Builder, scene: &Parts) {
    if let Some((carrier, rom)) = scene.carrier {
        let ratio = carrier.damping_ratio.unwrap_or(rom.damping_ratio);
        let text = "Modal damping ratio of the casing";
        table.damping(Quantity::SlaveDampingRatio(0), "casing_damping_ratio", ratio, text);
    }
    if let Some(load) = scene.carrier.and_then(|(carrier, _)| carrier.load) {
        let text = "Number of nodal diameters of the radial line load on the casing";
        let row = table.parameter(Quantity::LoadOrder, "casing_load_order", None, 0.0, text);
        row.kind = Kind::Integer;
        row.start = Some(Start::Integer(i32::try_from(load.order).unwrap_or(i32::MAX)));
    }
    if let Some(share) = scene.settings.contacts[0].heat_to_slave.filter(|_| has_friction(scene)) {
        let text = "Share of the friction heat that goes into the casing, the rest into the blades";
        let row = table.parameter(Quantity::HeatToSlave, "casing_heat_fraction", None, share, text);
        (row.min, row.max, row.variability) = (Some(0.0), Some(1.0), Variability::Tunable);
    }
}

/// Heat, wear, casing displacement.
pub fn outputs(table: &mut Builder, scene: &Parts) {
    let contact = &scene.settings.contacts[0];
    let power = Some((&POWER, 100.0));
    if has_friction(scene) && scene.patches > 0 {
        let text = "Friction power into each casing patch, mean over the communication step";
        let read = each(|view, patch| view.mean * view.slave_share() * view.window.patch_heat[patch]);
        table.output("casing_friction_power", Span::Mean, power, text, read).dimension = Some(scene.patches);
    }
    if has_friction(scene) && contact.heat_to_slave.is_some() {
        let text = "Friction power into the blades, mean over the communication step";
        let read = scalar(|view| view.mean * (1.0 - view.slave_share()) * view.window.friction_heat);
        table.output("blade_friction_power", Span::Mean, power, text, read);
    }
    if let Some(coating) = &contact.coating {
        let depth = Some((&LENGTH, coating.thickness));
        let text = "Largest wear depth of the coating";
        let read = scalar(|view| view.coating(Coating::largest_wear_depth));
        table.output("wear_depth_maximum", Span::Total, depth, text, read).display = Some(1);
        let read = scalar(|view| view.coating(Coating::worn_volume));
        table.output("worn_volume", Span::Total, Some((&VOLUME, 1e-9)), "Volume worn off the coating", read);
        let text = "Energy that wearing the coating takes since the start; no cutting force or torque carries it";
        let read = scalar(|view| view.ledger().wear_energy.value());
        table.output("wear_energy", Span::Total, Some((&ENERGY, 1.0)), text, read);
        if scene.settings.outputs.wear {
            let text = format!(
                "Wear depth of each coating cell: {} around from theta = 0, row after row along z ({} rows)",
                coating.cells_around, coating.cells_along
            );
            let read = each(|view, cell| view.coating(|coating| coating.wear_depth(cell)));
            let row = table.output("wear_depth", Span::Total, depth, text, read);
            (row.dimension, row.display) = (Some(coating.cells_around * coating.cells_along), Some(1));
        }
    }
    if let Some((_, rom)) = scene.carrier.filter(|_| scene.settings.outputs.slave_displacement) {
        let text = "Radial displacement of the contact grid of the casing, ring after ring along z, outwards positive";
        let read = whole(|view, out| view.slave_displacement(out));
        let row = table.output("casing_displacement", Span::Point, Some((&LENGTH, 1e-4)), text, read);
        (row.dimension, row.display) = (Some(rom.contact_nodes.len()), Some(1));
        row.quantity = Quantity::SlaveDisplacement;
    }
}
