//! Outputs of a rotor.

use super::builder::Builder;
use super::units::{ANGLE, ENERGY, FORCE, IMPULSE, LENGTH, POWER, TORQUE};
use super::{Parts, features, has_friction};
use crate::settings::Motion;
use crate::variables::{Kind, Quantity, Span, Unit, Variability};
use crate::{Error, Result};

pub fn totals(table: &mut Builder, scene: &Parts) {
    let gap = Some((&LENGTH, scene.settings.contacts[0].gap));
    let (force, nodes) = (Some((&FORCE, 100.0)), scene.rom.contact_nodes.len());
    table
        .output(Quantity::RotorAngle, "rotor_angle", Span::Point, Some((&ANGLE, 1.0)), "Angle of the rotor about +z")
        .display = Some(0);
    table
        .output(
            Quantity::ClearanceMinimum,
            "clearance_minimum",
            Span::Window,
            gap,
            "Smallest clearance of the whole disk within the communication step, normal to the casing",
        )
        .display = Some(1);
    let each = table.output(
        Quantity::NodeClearanceMinimum,
        "node_clearance_minimum",
        Span::Window,
        gap,
        format!(
            "Smallest clearance over all sectors within the communication step, per contact node ({})",
            node_list(scene)
        ),
    );
    (each.dimension, each.display) = (Some(nodes), Some(1));
    for (component, axis) in ["x", "y", "z"].into_iter().enumerate() {
        table.output(
            Quantity::Force(component),
            format!("force_{axis}"),
            Span::Mean,
            force,
            format!("Contact force on the rotor along fixed {axis}, mean over the communication step"),
        );
    }
    // The other two are for a model of the shaft, which is what gives whirl.
    let moments = ["moment_x", "moment_y", "torque"].into_iter().enumerate();
    for (component, name) in moments.filter(|(component, _)| *component == 2 || scene.master.whirl) {
        let text = match component {
            2 => {
                "Torque of the contact forces on the rotor about +z through the shaft's centre, conjugate to the rotor angle, mean \
                 over the communication step"
                    .to_owned()
            }
            _ => format!(
                "Moment of the contact forces on the rotor about fixed {} through the shaft's centre at z = 0 of the rotor \
                 (whirl and axial shift move it), mean over the communication step",
                ["x", "y"][component]
            ),
        };
        table.output(Quantity::Moment(component), name, Span::Mean, Some((&TORQUE, 10.0)), text);
    }
    table.output(
        Quantity::NormalForcePeak,
        "normal_force_peak",
        Span::Window,
        force,
        "Largest normal force of any contact node in any internal step of the communication step (grows as 1/h for impacts)",
    );
    table.output(
        Quantity::NormalImpulse,
        "normal_impulse",
        Span::Window,
        Some((&IMPULSE, 1e-3)),
        "Sum of the normal impulses of all contact nodes within the communication step",
    );
    if has_friction(scene) {
        table.output(
            Quantity::FrictionPower,
            "friction_power",
            Span::Mean,
            Some((&POWER, 100.0)),
            "Friction heat per time, mean over the communication step",
        );
    }
    let count = table.output(
        Quantity::ContactCount,
        "contact_count",
        Span::Point,
        None,
        "Contact nodes touching at the communication point",
    );
    (count.kind, count.variability) = (Kind::Integer, Variability::Discrete);
    let touching = table.output(
        Quantity::InContact,
        "in_contact",
        Span::Point,
        None,
        "Whether any contact node touches at the communication point",
    );
    (touching.kind, touching.variability) = (Kind::Boolean, Variability::Discrete);
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
        let (index, list) = (sector - 1, node_list(scene));
        let rows = watched_rows(index, [gap, force], scene.settings.outputs.instantaneous_forces, has_friction(scene));
        for (quantity, name, span, unit, text) in rows {
            let name = format!("blade[{sector}].{name}");
            let variable = table.output(quantity, name, span, unit, format!("{text} ({list})"));
            variable.dimension = Some(rom.contact_nodes.len());
            variable.display = unit.filter(|(unit, _)| **unit == LENGTH).map(|_| 1);
        }
    }
    Ok(())
}

/// Quantity, name, span, unit and description of an output per contact node.
type NodeRow = (Quantity, &'static str, Span, Option<(&'static Unit, f64)>, &'static str);

/// Outputs over the contact nodes of a sector (0-based); units of gaps and forces.
pub fn watched_rows(
    index: usize,
    [gap, force]: [Option<(&'static Unit, f64)>; 2],
    instantaneous: bool,
    friction: bool,
) -> impl Iterator<Item = NodeRow> {
    let rows: [NodeRow; 6] = [
        (
            Quantity::Clearance(index),
            "clearance",
            Span::Point,
            gap,
            "Clearance normal to the casing at the communication point",
        ),
        (
            Quantity::WatchedClearanceMinimum(index),
            "clearance_minimum",
            Span::Window,
            gap,
            "Smallest clearance within the communication step",
        ),
        (
            Quantity::NormalForce(index),
            "normal_force",
            Span::Mean,
            force,
            "Normal contact force, mean over the communication step",
        ),
        (
            Quantity::TangentialForce(index),
            "tangential_force",
            Span::Mean,
            force,
            "Magnitude of the friction force (axial part included), mean over the communication step",
        ),
        (
            Quantity::NormalForceNow(index),
            "normal_force_now",
            Span::Point,
            force,
            "Normal contact force of the last internal step",
        ),
        (
            Quantity::TangentialForceNow(index),
            "tangential_force_now",
            Span::Point,
            force,
            "Friction force of the last internal step",
        ),
    ];
    rows.into_iter().filter(move |row| match row.0 {
        Quantity::TangentialForce(_) => friction,
        Quantity::NormalForceNow(_) => instantaneous,
        Quantity::TangentialForceNow(_) => instantaneous && friction,
        _ => true,
    })
}

pub fn fields(table: &mut Builder, scene: &Parts) -> Result<()> {
    let (outputs, sectors) = (&scene.settings.outputs, scene.rom.sectors);
    let gap = scene.settings.contacts[0].gap;
    if outputs.all_sectors {
        let clearance = table.output(
            Quantity::SectorClearanceMinimum,
            "sector_clearance_minimum",
            Span::Window,
            Some((&LENGTH, gap)),
            "Smallest clearance of each sector within the communication step",
        );
        (clearance.dimension, clearance.display) = (Some(sectors), Some(1));
        let force = table.output(
            Quantity::SectorNormalForce,
            "sector_normal_force",
            Span::Mean,
            Some((&FORCE, 100.0)),
            "Normal contact force of each sector, mean over the communication step",
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
            Quantity::NodalDiameterAmplitude,
            "nodal_diameter_amplitude",
            Span::Point,
            Some((&LENGTH, gap)),
            "Amplitude of the radial displacement of the middle contact node per nodal diameter 0, 1, 2, …",
        );
        (amplitude.dimension, amplitude.display) = (Some(largest + 1), Some(1));
    }
    Ok(())
}

/// Of every scene.
pub const CURVATURE: &str = "Energy that contact forces add since the start because normals turn and surfaces curve within an \
                             internal step (vanishes with the step)";

pub fn energies(table: &mut Builder, scene: &Parts) {
    let rows = [
        (
            Quantity::KineticEnergy,
            "kinetic_energy",
            Span::Point,
            "Kinetic energy of the vibration in the rotating frame, of the instant",
        ),
        (Quantity::StrainEnergy, "strain_energy", Span::Point, "Strain energy of the instant"),
        (
            Quantity::SchemeEnergy,
            "scheme_energy",
            Span::Point,
            "Energy that the time scheme conserves and the ledger closes with: kinetic plus strain energy up to the second order of \
             the step",
        ),
        (Quantity::DampingLoss, "damping_loss", Span::Total, "Energy lost by modal damping since the start"),
        (Quantity::FrictionLoss, "friction_loss", Span::Total, "Friction heat since the start"),
        (
            Quantity::ImpactLoss,
            "impact_loss",
            Span::Total,
            "Energy lost by contact nodes stopping at the casing since the start",
        ),
        (
            Quantity::WearWork,
            "wear_work",
            Span::Total,
            "Work of the coating's normal force against the approach of the blades since the start",
        ),
        (
            Quantity::LoadWork,
            "load_work",
            Span::Total,
            "Work of centrifugal, thermal and nodal-diameter loads since the start",
        ),
        (
            Quantity::ExternalWork,
            "external_work",
            Span::Total,
            "Work of all inputs but loads since the start: shaft, whirl, axial shift, moving casing",
        ),
        (
            Quantity::ShaftWork,
            "shaft_work",
            Span::Total,
            "Work of the shaft through the contacts since the start: minus the integral of torque times speed",
        ),
        (
            Quantity::StiffeningWork,
            "stiffening_work",
            Span::Total,
            "Strain energy that changes of the speed add by stiffening since the start",
        ),
        (
            Quantity::WhirlWork,
            "whirl_work",
            Span::Total,
            "Work of the whirling shaft since the start: minus the integral of force times velocity of its centre",
        ),
        (Quantity::ShiftWork, "shift_work", Span::Total, "Work of the axial shift of the rotor since the start"),
        (
            Quantity::CasingWork,
            "casing_motion_work",
            Span::Total,
            "Work of prescribed motion of the casing (radius, gap offset, shape) since the start",
        ),
        (Quantity::CurvatureWork, "curvature_work", Span::Total, CURVATURE),
        (
            Quantity::StepChangeEnergy,
            "step_change_energy",
            Span::Total,
            "Energy added by changes of the internal step since the start",
        ),
        (Quantity::EnergyResidual, "energy_residual", Span::Point, "Closure residual of the energy ledger"),
    ];
    let exists = |quantity| match quantity {
        Quantity::FrictionLoss => has_friction(scene),
        Quantity::WearWork => scene.settings.contacts[0].coating.is_some(),
        Quantity::LoadWork => features::is_loaded(scene),
        Quantity::ShaftWork => scene.master.motion == Motion::Rotating,
        Quantity::StiffeningWork => scene.master.spin.stiffening,
        Quantity::WhirlWork => scene.master.whirl,
        Quantity::ShiftWork => scene.master.axial_shift,
        Quantity::CasingWork => scene.surface.moving,
        _ => true,
    };
    for (quantity, name, span, text) in rows.into_iter().filter(|row| exists(row.0)) {
        table.output(quantity, name, span, Some((&ENERGY, 1.0)), text);
    }
    table.output(
        Quantity::EnergyResidualRelative,
        "energy_residual_relative",
        Span::Point,
        None,
        "Closure residual relative to the initial energy plus all work exchanged",
    );
}
