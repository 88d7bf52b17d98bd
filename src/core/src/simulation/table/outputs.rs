//! Outputs of a rotor, one row each with what fills it.

use super::builder::Builder;
use super::contacts;
use super::units::{ANGLE, FORCE, LENGTH, TORQUE};
use super::{Parts, features, has_friction};
use crate::settings::Motion;
use crate::simulation::outputs::{Reader, each, scalar, whole};
use crate::variables::{Quantity, Span, Unit};
use crate::{Error, Result};

pub fn totals(table: &mut Builder, scene: &Parts) {
    let gap = Some((&LENGTH, scene.settings.contacts[0].gap));
    let (force, nodes) = (Some((&FORCE, 100.0)), scene.rom.contact_nodes.len());
    let angle = table.output(
        "rotor_angle",
        Span::Point,
        Some((&ANGLE, 1.0)),
        "Angle of the rotor about +z",
        scalar(|view| view.rotor_angle()),
    );
    (angle.display, angle.quantity) = (Some(0), Quantity::RotorAngle);
    contacts::smallest_clearance(
        table,
        gap,
        "Smallest clearance of the whole disk within the communication step, normal to the casing",
    );
    let each_node = table.output(
        "node_clearance_minimum",
        Span::Window,
        gap,
        format!(
            "Smallest clearance over all sectors within the communication step, per contact node ({})",
            node_list(scene)
        ),
        each(|view, node| view.lowest_of_node(node)),
    );
    (each_node.dimension, each_node.display) = (Some(nodes), Some(1));
    for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
        let text = format!("Contact force on the rotor along fixed {letter}, mean over the communication step");
        let read = scalar(move |view| view.mean * view.window.force_impulse[axis]);
        table.output(format!("force_{letter}"), Span::Mean, force, text, read);
    }
    moments(table, scene);
    contacts::totals(table, has_friction(scene));
}

fn moments(table: &mut Builder, scene: &Parts) {
    // The other two are for a model of the shaft, which is what gives whirl.
    let moments = ["moment_x", "moment_y", "torque"].into_iter().enumerate();
    for (axis, name) in moments.filter(|(axis, _)| *axis == 2 || scene.master.whirl) {
        let text = match axis {
            2 => {
                "Torque of the contact forces on the rotor about +z through the shaft's centre, conjugate to the rotor angle, mean \
                 over the communication step"
                    .to_owned()
            }
            _ => format!(
                "Moment of the contact forces on the rotor about fixed {} through the shaft's centre at z = 0 of the rotor \
                 (whirl and axial shift move it), mean over the communication step",
                ["x", "y"][axis]
            ),
        };
        let read = scalar(move |view| view.mean * view.window.moment_impulse[axis]);
        table.output(name, Span::Mean, Some((&TORQUE, 10.0)), text, read).quantity = Quantity::Moment(axis);
    }
}

fn node_list(scene: &Parts) -> String {
    let names: Vec<&str> = scene.rom.contact_nodes.iter().map(|node| node.name.as_str()).collect();
    names.join(", ")
}

pub fn watched(table: &mut Builder, scene: &Parts) -> Result<()> {
    let rom = scene.rom;
    let (gap, force) = (Some((&LENGTH, scene.settings.contacts[0].gap)), Some((&FORCE, 100.0)));
    for sector in &scene.settings.outputs.watched_sectors {
        if *sector == 0 || *sector > rom.sectors {
            return Err(Error::invalid(
                "outputs.watched_sectors",
                format!("sector {sector} of {}", rom.sectors),
                "Use sector numbers from 1 to the number of sectors of the ROM",
            ));
        }
        let list = node_list(scene);
        for row in watched_rows(sector - 1, [gap, force]) {
            if row.exists(scene.settings.outputs.instantaneous_forces, has_friction(scene)) {
                let text = format!("{} ({list})", row.text);
                row.add(table, format!("blade[{sector}].{}", row.name), text, rom.contact_nodes.len());
            }
        }
    }
    Ok(())
}

/// An output over the contact nodes of a sector.
pub struct NodeRow {
    quantity: Quantity,
    pub name: &'static str,
    span: Span,
    unit: Option<(&'static Unit, f64)>,
    pub text: &'static str,
    /// Only with friction, and only where instantaneous forces are asked for.
    needs: [bool; 2],
    read: Reader,
}

impl NodeRow {
    pub fn exists(&self, instantaneous: bool, friction: bool) -> bool {
        let [needs_friction, needs_instantaneous] = self.needs;
        (friction || !needs_friction) && (instantaneous || !needs_instantaneous)
    }

    pub fn add(&self, table: &mut Builder, name: String, text: String, nodes: usize) {
        let row = table.output(name, self.span, self.unit, text, self.read.clone());
        (row.dimension, row.quantity) = (Some(nodes), self.quantity);
        row.display = self.unit.filter(|(unit, _)| **unit == LENGTH).map(|_| 1);
    }
}

/// Outputs over the contact nodes of a sector (0-based); units of gaps and forces.
pub fn watched_rows(sector: usize, [gap, force]: [Option<(&'static Unit, f64)>; 2]) -> [NodeRow; 6] {
    [
        NodeRow {
            quantity: Quantity::Clearance(sector),
            name: "clearance",
            span: Span::Point,
            unit: gap,
            text: "Clearance normal to the casing at the communication point",
            needs: [false, false],
            read: each(move |view, node| view.clearance(node, sector)),
        },
        NodeRow {
            quantity: Quantity::WatchedClearanceMinimum(sector),
            name: "clearance_minimum",
            span: Span::Window,
            unit: gap,
            text: "Smallest clearance within the communication step",
            needs: [false, false],
            read: each(move |view, node| view.lowest_at(node, sector)),
        },
        NodeRow {
            quantity: Quantity::NormalForce(sector),
            name: "normal_force",
            span: Span::Mean,
            unit: force,
            text: "Normal contact force, mean over the communication step",
            needs: [false, false],
            read: each(move |view, node| view.mean * view.normal_impulse(node, sector)),
        },
        NodeRow {
            quantity: Quantity::TangentialForce(sector),
            name: "tangential_force",
            span: Span::Mean,
            unit: force,
            text: "Magnitude of the friction force (axial part included), mean over the communication step",
            needs: [true, false],
            read: each(move |view, node| view.mean * view.tangential_impulse(node, sector)),
        },
        NodeRow {
            quantity: Quantity::Output,
            name: "normal_force_now",
            span: Span::Point,
            unit: force,
            text: "Normal contact force of the last internal step",
            needs: [false, true],
            read: each(move |view, node| view.system.multiplier(node, sector)),
        },
        NodeRow {
            quantity: Quantity::Output,
            name: "tangential_force_now",
            span: Span::Point,
            unit: force,
            text: "Friction force of the last internal step",
            needs: [true, true],
            read: each(move |view, node| view.tangential_now(node, sector)),
        },
    ]
}

pub fn fields(table: &mut Builder, scene: &Parts) -> Result<()> {
    let (outputs, sectors) = (&scene.settings.outputs, scene.rom.sectors);
    let gap = scene.settings.contacts[0].gap;
    if outputs.all_sectors {
        let clearance = table.output(
            "sector_clearance_minimum",
            Span::Window,
            Some((&LENGTH, gap)),
            "Smallest clearance of each sector within the communication step",
            each(|view, sector| view.lowest_of_sector(sector)),
        );
        (clearance.dimension, clearance.display) = (Some(sectors), Some(1));
        let force = table.output(
            "sector_normal_force",
            Span::Mean,
            Some((&FORCE, 100.0)),
            "Normal contact force of each sector, mean over the communication step",
            each(|view, sector| view.mean * view.of_sector(&view.window.normal_impulse, sector).sum::<f64>()),
        );
        force.dimension = Some(sectors);
    }
    if let Some(largest) = outputs.nodal_diameters {
        if largest > sectors / 2 {
            return Err(Error::invalid(
                "outputs.nodal_diameters",
                format!("{largest} with {sectors} sectors"),
                format!("Use at most {}", sectors / 2),
            ));
        }
        let amplitude = table.output(
            "nodal_diameter_amplitude",
            Span::Point,
            Some((&LENGTH, gap)),
            "Amplitude of the radial displacement of the middle contact node per nodal diameter 0, 1, 2, …",
            whole(|view, out| view.nodal_diameters(out)),
        );
        (amplitude.dimension, amplitude.display) = (Some(largest + 1), Some(1));
        amplitude.quantity = Quantity::NodalDiameterAmplitude;
    }
    Ok(())
}

pub fn energies(table: &mut Builder, scene: &Parts) {
    let exists = |name: &str| match name {
        "friction_loss" => has_friction(scene),
        "wear_work" => scene.settings.contacts[0].coating.is_some(),
        "load_work" => features::is_loaded(scene),
        "shaft_work" => scene.master.motion == Motion::Rotating,
        "stiffening_work" => scene.master.spin.stiffening,
        "whirl_work" => scene.master.whirl,
        "shift_work" => scene.master.axial_shift,
        "casing_motion_work" => scene.surface.moving,
        _ => true,
    };
    let words = [
        "Kinetic energy of the vibration in the rotating frame, of the instant",
        "Strain energy of the instant",
        "Energy lost by contact nodes stopping at the casing since the start",
    ];
    contacts::energies(table, words, exists);
}
