//! The variable table of a scene: one row per variable. Features that are off have no row.
//!
//! Names of a scene with one rotor have no prefix. With several masters, names of their variables start with the name of the master; with
//! several pairs, names of their variables start with the name of the surface.

mod blades;
mod builder;
mod contacts;
mod features;
mod free;
mod parts;
mod rotor;

use tiprub_cosim::bounds;
use tiprub_cosim::variables::{Quantity, Span, Variability, VariableTable};

use super::outputs::{OutputReader, scalar};
use super::plan::SteppingOrder;
use super::units::{ANGLE, ANGULAR_SPEED, FORCE, LENGTH, TIME, TORQUE};
use crate::scene::ranges;
use crate::scene::settings::{BodyMotion, InputInterpolation, Scene, SceneSettings, Shape};
use crate::scene::shape::CompiledShape;
use crate::{Result, Rom};
use builder::{RAMPED, TableBuilder};
use parts::{AXES, BodyFacts, PairFacts, TableFacts, largest_length};

/// Builds the table of a validated scene, and the readers of its outputs, in their order.
///
/// # Errors
/// Watched sector or nodal diameter that no ROM has; pairs that do not fit the ROMs.
pub fn build(scene: &Scene, plan: &SteppingOrder) -> Result<(VariableTable, Vec<OutputReader>)> {
    let parts = &TableFacts::new(scene, plan);
    let mut table = TableBuilder::default();
    table.time();
    inputs(&mut table, parts)?;
    features::inputs(&mut table, parts);
    parameters(&mut table, parts);
    features::parameters(&mut table, parts);
    totals(&mut table, parts);
    free::bodies(&mut table, parts);
    rotor::watched(&mut table, parts)?;
    rotor::fields(&mut table, parts)?;
    features::outputs(&mut table, parts);
    table.belongs_to_all();
    if parts.settings.outputs.energies {
        contacts::energies(&mut table, parts);
    }
    contacts::internal_steps(&mut table, parts.settings);
    table.finish()
}

fn inputs(table: &mut TableBuilder, parts: &TableFacts) -> Result<()> {
    for body in parts.bodies.iter().filter(|body| body.structure.motion == BodyMotion::Rotating) {
        table.belongs(body.index, parts.of_body(body));
        let text = format!(
            "Speed of {} about +z; constant over a communication step, or linear if a derivative is set",
            parts.rotor(body)
        );
        let speed = table.input(Quantity::Speed, "speed", Some(&ANGULAR_SPEED), body.structure.speed, &text);
        speed.display(0).nominal(1000.0).range(-ranges::SPEED, ranges::SPEED);
    }
    for pair in parts.pairs.iter().filter(|pair| pair.surface.moving) {
        table.belongs(pair.index, parts.of_pair(pair));
        let largest = largest_length(pair.body.rom);
        let text = "Uniform change of the casing radius; positive values increase every clearance";
        let change = table.moving_input(Quantity::RadiusChange, "casing_radius_change", Some(&LENGTH), 0.0, text);
        change.nominal(1e-4).display(1).range(-largest, largest);
        if pair.surface.shape == (Shape::Circular {}) {
            continue;
        }
        let text = "Factor on the casing shape (0 = round, 1 = as in the scene)";
        let factor = table.moving_input(Quantity::ShapeFactor, "casing_shape_factor", None, 1.0, text);
        let change = CompiledShape::new(&pair.surface.shape, pair.contact.nominal_gap())?.largest_change();
        let largest = if change > 0.0 { largest / change } else { 1.0 };
        factor.range(-largest, largest);
        if pair.carrier.is_none() {
            let text = "Rotation of the casing shape about +z";
            table.moving_input(Quantity::ShapeRotation, "casing_shape_rotation", Some(&ANGLE), 0.0, text);
        }
    }
    Ok(())
}

fn parameters(table: &mut TableBuilder, parts: &TableFacts) {
    let (settings, bodies, pairs) = (parts.settings, &parts.bodies, &parts.pairs);
    for body in bodies.iter().filter(|body| body.free) {
        table.belongs(body.index, parts.of_body(body));
        free::velocity(table, body);
    }
    friction(table, parts);
    for pair in pairs.iter().filter(|pair| !pair.body.free) {
        table.belongs(pair.index, parts.of_pair(pair));
        gap_offset(table, pair.body.rom);
    }
    for body in bodies {
        table.belongs(body.index, parts.of_body(body));
        let ratio = body.structure.damping_ratio.unwrap_or(body.rom.damping_ratio);
        let rigid = if body.free { "; its rigid-body modes are undamped" } else { "" };
        let text = format!("Modal damping ratio of {}{rigid}", parts.rotor(body));
        table.damping(Quantity::DampingRatio, "damping_ratio", ratio, &text);
        let name = parts.rotor(body);
        blades::mode_damping(table, Quantity::ModeDamping, "damping_ratios", body.structure, &name);
        blades::parameters(table, body);
    }
    for carrier in parts.carriers.iter().filter(|carrier| carrier.open) {
        features::damping(table, carrier, format!("{}.", carrier.structure.name), &carrier.structure.name);
    }
    table.belongs_to_all();
    table.methods(settings);
    if features::has_moving_inputs(parts) || settings.time.input_interpolation == InputInterpolation::Hold {
        table.input_interpolation(settings);
        table.step_derivatives();
    }
    for body in bodies.iter().filter(|body| !body.free) {
        table.belongs(body.index, parts.of_body(body));
        let text = format!("Initial angle of {} about +z", parts.rotor(body));
        table.parameter(Quantity::InitialAngle, "initial_rotor_angle", Some(&ANGLE), 0.0, &text).display(0);
    }
    for pair in pairs.iter().filter(|pair| !pair.body.free && pair.surface.shape != (Shape::Circular {})) {
        table.belongs(pair.index, parts.of_pair(pair));
        let text = "Time after the start over which the casing shape grows smoothly from round to its full amplitude";
        let ramp = table.parameter(Quantity::RampTime, "casing_ramp_time", Some(&TIME), pair.surface.ramp_time, text);
        ramp.range(0.0, bounds::TIME);
    }
    table.belongs_to_all();
    table.scene_name(settings);
}

/// Adds one friction coefficient if all pairs have the same, otherwise one each.
fn friction(table: &mut TableBuilder, parts: &TableFacts) {
    if !parts.has_friction() {
        return;
    }
    let free = parts.bodies.iter().all(|body| body.free);
    if has_one_friction(parts.settings) {
        table.belongs_to_all();
        let text = if free || parts.plan.pairs.len() > 1 {
            "Coulomb friction coefficient of all contacts"
        } else {
            "Coulomb friction coefficient between tip and casing"
        };
        table.friction(&parts.settings.contacts[0], text);
        return;
    }
    for pair in &parts.pairs {
        table.belongs(pair.index, parts.of_pair(pair));
        let text =
            format!("Coulomb friction coefficient between {} and {}", pair.body.structure.name, pair.surface.name);
        table.friction(pair.contact, &text);
    }
}

/// Returns whether all pairs of a scene have the same friction coefficient.
pub(crate) fn has_one_friction(settings: &SceneSettings) -> bool {
    let first = settings.contacts[0].friction.to_bits();
    settings.contacts.iter().all(|contact| contact.friction.to_bits() == first)
}

fn gap_offset(table: &mut TableBuilder, rom: &Rom) {
    let text = "Offset added to the radial clearance of every sector";
    let offset = table.parameter(Quantity::GapOffset, "gap_offset", Some(&LENGTH), 0.0, text);
    offset.description += RAMPED;
    offset.display(1).nominal(1e-4).range(-largest_length(rom), largest_length(rom)).variability = Variability::Tunable;
}

/// Adds angles, clearances, forces and moments of structures and pairs, and totals over all contacts.
fn totals(table: &mut TableBuilder, parts: &TableFacts) {
    let (bodies, pairs) = (&parts.bodies, &parts.pairs);
    let rotors = || bodies.iter().filter(|body| !body.free);
    for body in rotors() {
        table.belongs(body.index, parts.of_body(body));
        rotor::angle(table, parts, body);
    }
    table.belongs_to_all();
    smallest_clearance(table, parts);
    for body in rotors() {
        table.belongs(body.index, parts.of_body(body));
        rotor::clearances(table, parts, body);
    }
    for body in bodies {
        table.belongs(body.index, parts.of_body(body));
        forces(table, parts, body);
    }
    for pair in pairs.iter().filter(|pair| pair.body.free || pairs.len() > 1) {
        table.belongs(pair.index, String::new());
        pair_forces(table, pair);
    }
    table.belongs_to_all();
    contacts::totals(table, parts.has_friction());
}

fn smallest_clearance(table: &mut TableBuilder, parts: &TableFacts) {
    let free = parts.bodies.iter().any(|body| body.free);
    let gap = if free { 1e-3 } else { parts.settings.contacts[0].nominal_gap() };
    let text = match (free, parts.plan.pairs.len()) {
        (true, _) => {
            "Smallest clearance of all contact nodes within the communication step, normal to their surfaces; 1e9 m if \
             no node faces a surface, for example beyond the edges"
        }
        (false, 1) => "Smallest clearance of the whole disk within the communication step, normal to the casing",
        _ => "Smallest clearance of all contact nodes within the communication step, normal to their surfaces",
    };
    contacts::smallest_clearance(table, Some((&LENGTH, gap)), text);
}

/// Adds force and moment on a structure: for a rotor about the centre of the shaft.
fn forces(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts) {
    let (index, name) = (body.index, parts.rotor(body));
    let text = if body.free {
        format!("Contact force on {name} along {{axis}}, all pairs, mean over the communication step")
    } else {
        format!("Contact force on {name} along the fixed {{axis}} axis, mean over the communication step")
    };
    table.vector("force", Span::Mean, Some((&FORCE, 100.0)), &text, move |view, axis| {
        view.mean * view.window.bodies[index].force_impulse[axis]
    });
    for axis in 0..3 {
        // The other two components of a rotor are for a model of the shaft, which provides the whirl.
        if !body.free && axis < 2 && !body.structure.whirl {
            continue;
        }
        let (row, text) = moment(parts, body, axis);
        let read = scalar(move |view| view.mean * view.window.bodies[index].moment_impulse[axis]);
        table.output(row, Span::Mean, Some((&TORQUE, 10.0)), text, read).quantity(Quantity::Moment(axis));
    }
}

/// Returns name and text of a moment.
fn moment(parts: &TableFacts, body: &BodyFacts, axis: usize) -> (String, String) {
    let (name, letter) = (parts.rotor(body), AXES[axis]);
    let (row, what, about) = match (body.free, axis) {
        (true, _) => {
            (format!("moment_{letter}"), "Moment", format!("about the {letter} axis through the origin, all pairs"))
        }
        (false, 2) => {
            let about = "about the +z axis through the shaft's centre, conjugate to the rotor angle";
            ("torque".to_owned(), "Torque", about.to_owned())
        }
        (false, _) => {
            let about = format!(
                "about the fixed {letter} axis through the shaft's centre at z = 0 of the rotor (which moves with whirl \
                 and axial shift)"
            );
            (format!("moment_{letter}"), "Moment", about)
        }
    };
    (row, format!("{what} of the contact forces on {name} {about}, mean over the communication step"))
}

/// Adds force and moment of one surface on the master.
fn pair_forces(table: &mut TableBuilder, pair: &PairFacts) {
    let (index, surface, master) = (pair.index, &pair.surface.name, &pair.body.structure.name);
    let point = if pair.body.free { "the origin" } else { "the shaft's centre" };
    let text = format!(
        "Moment of the contact force on {master} from {surface} about the {{axis}} axis through {point}, mean over the \
         communication step"
    );
    table.vector(&format!("{surface}.moment"), Span::Mean, Some((&TORQUE, 10.0)), &text, move |view, axis| {
        view.mean * view.window.pairs[index].moment_impulse[axis]
    });
    let text = format!("Contact force on {master} from {surface} along {{axis}}, mean over the communication step");
    table.vector(&format!("{surface}.force"), Span::Mean, Some((&FORCE, 100.0)), &text, move |view, axis| {
        view.mean * view.window.pairs[index].force_impulse[axis]
    });
}
