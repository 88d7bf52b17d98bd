//! The variable table of a scene with a free master.

use super::builder::Builder;
use super::outputs::{CURVATURE, watched_rows};
use super::units::{ENERGY, FORCE, IMPULSE, LENGTH, LINEAR_SPEED, POWER, TORQUE};
use crate::Result;
use crate::Rom;
use crate::ranges;
use crate::settings::{Scene, StructureSettings};
use crate::simulation::compile::Roles;
use crate::simulation::free::{Pair, pairs};
use crate::variables::{Kind, Quantity, Span, Unit, Variability, VariableTable};

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
pub fn build(scene: &Scene) -> Result<VariableTable> {
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
    table.internal_steps(&scene.settings);
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
    table
        .output(
            Quantity::ClearanceMinimum,
            "clearance_minimum",
            Span::Window,
            Some((&LENGTH, 1e-3)),
            "Smallest clearance of all contact nodes within the communication step, normal to their surfaces; 1e9 m where \
             none of them has a surface to touch, beyond the edges",
        )
        .display = Some(1);
    for (component, axis) in AXES.into_iter().enumerate() {
        let text = format!("Contact force on {master} along {axis}, all pairs, mean over the communication step");
        table.output(Quantity::Force(component), format!("force_{axis}"), Span::Mean, force, text);
    }
    let moment = Some((&TORQUE, 10.0));
    for (axis, letter) in AXES.into_iter().enumerate() {
        let text = format!(
            "Moment of the contact forces on {master} about {letter} through the origin, all pairs, mean over the communication step"
        );
        table.output(Quantity::Moment(axis), format!("moment_{letter}"), Span::Mean, moment, text);
    }
    for (index, pair) in parts.pairs.iter().enumerate() {
        let surface = parts.surface(pair);
        for (axis, letter) in AXES.into_iter().enumerate() {
            let text = format!(
                "Moment of the contact force on {master} from {surface} about {letter} through the origin, mean over the \
                 communication step"
            );
            let name = format!("{surface}.moment_{letter}");
            table.output(Quantity::PairMoment(index, axis), name, Span::Mean, moment, text);
        }
        for (component, axis) in AXES.into_iter().enumerate() {
            let text =
                format!("Contact force on {master} from {surface} along {axis}, mean over the communication step");
            table.output(
                Quantity::PairForce(index, component),
                format!("{surface}.force_{axis}"),
                Span::Mean,
                force,
                text,
            );
        }
    }
    let text = "Largest normal force of any contact node in any internal step of the communication step (grows as 1/h for \
                impacts)";
    table.output(Quantity::NormalForcePeak, "normal_force_peak", Span::Window, force, text);
    let text = "Sum of the normal impulses of all contact nodes within the communication step";
    table.output(Quantity::NormalImpulse, "normal_impulse", Span::Window, Some((&IMPULSE, 1e-3)), text);
    if parts.has_friction() {
        let text = "Friction heat per time, mean over the communication step";
        table.output(Quantity::FrictionPower, "friction_power", Span::Mean, Some((&POWER, 100.0)), text);
    }
    let text = "Contact nodes touching at the communication point";
    let count = table.output(Quantity::ContactCount, "contact_count", Span::Point, None, text);
    (count.kind, count.variability) = (Kind::Integer, Variability::Discrete);
    let text = "Whether any contact node touches at the communication point";
    let touching = table.output(Quantity::InContact, "in_contact", Span::Point, None, text);
    (touching.kind, touching.variability) = (Kind::Boolean, Variability::Discrete);
}

/// Rigid motion.
fn body(table: &mut Builder, parts: &Parts) {
    let master = &parts.master.0.name;
    for (component, axis) in AXES.into_iter().enumerate() {
        let text = format!("Velocity of the centre of mass of {master} along {axis}, mean over the last internal step");
        let name = format!("{master}.velocity_{axis}");
        table.output(Quantity::CentreVelocity(component), name, Span::Point, Some((&LINEAR_SPEED, 100.0)), text);
    }
    for (component, axis) in AXES.into_iter().enumerate() {
        let text = format!("Displacement of the centre of mass of {master} along {axis} since the start");
        let name = format!("{master}.displacement_{axis}");
        let row = table.output(Quantity::CentreDisplacement(component), name, Span::Point, Some((&LENGTH, 1e-2)), text);
        row.display = Some(1);
    }
}

/// Arrays over the contact nodes.
fn nodes(table: &mut Builder, parts: &Parts) {
    if parts.scene.settings.outputs.watched_sectors.is_empty() {
        return;
    }
    let (master, rom) = parts.master;
    let list = node_list(rom);
    let units: [Option<(&'static Unit, f64)>; 2] = [Some((&LENGTH, 1e-3)), Some((&FORCE, 100.0))];
    let rows = watched_rows(0, units, parts.scene.settings.outputs.instantaneous_forces, parts.has_friction());
    for (quantity, name, span, unit, _) in rows {
        let text = match quantity {
            Quantity::Clearance(_) => {
                "Clearance normal to the surface at the communication point; 1e9 m where there is nothing to touch, beyond an \
                 edge and for nodes of no pair"
            }
            Quantity::WatchedClearanceMinimum(_) => "Smallest clearance within the communication step",
            Quantity::NormalForce(_) => "Normal contact force, mean over the communication step",
            Quantity::TangentialForce(_) => "Magnitude of the friction force, mean over the communication step",
            Quantity::NormalForceNow(_) => "Normal contact force of the last internal step",
            _ => "Friction force of the last internal step",
        };
        let row = table.output(quantity, format!("{}.{name}", master.name), span, unit, format!("{text} ({list})"));
        row.dimension = Some(rom.contact_nodes.len());
        row.display = unit.filter(|(unit, _)| **unit == LENGTH).map(|_| 1);
    }
    for (axis, letter) in AXES.into_iter().enumerate() {
        let text = format!("Displacement along {letter} since the start, rigid motion included ({list})");
        let name = format!("{}.node_displacement_{letter}", master.name);
        let row = table.output(Quantity::NodeDisplacement(axis), name, Span::Point, Some((&LENGTH, 1e-3)), text);
        (row.dimension, row.display) = (Some(rom.contact_nodes.len()), Some(1));
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
    let rows = [
        (Quantity::KineticEnergy, "kinetic_energy", Span::Point, "Kinetic energy of all structures, flight included"),
        (Quantity::StrainEnergy, "strain_energy", Span::Point, "Strain energy of all structures"),
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
            "Energy lost by contact nodes stopping at a surface since the start",
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
    for (quantity, name, span, text) in rows {
        if quantity != Quantity::FrictionLoss || parts.has_friction() {
            table.output(quantity, name, span, Some((&ENERGY, 1.0)), text);
        }
    }
    let text = "Closure residual relative to the initial energy plus all work exchanged";
    table.output(Quantity::EnergyResidualRelative, "energy_residual_relative", Span::Point, None, text);
}
