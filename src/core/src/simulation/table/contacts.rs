//! Outputs that every scene has.

use tiprub_cosim::variables::{DataType, Quantity, Span, Variability, VariableUnit};

use super::builder::TableBuilder;
use super::features;
use super::parts::{BodyFacts, TableFacts};
use crate::scene::settings::{BodyMotion, SceneSettings};
use crate::simulation::outputs::{OutputView, scalar};
use crate::simulation::units::{ENERGY, FORCE, IMPULSE, POWER, TIME};

pub fn smallest_clearance(table: &mut TableBuilder, unit: Option<(&'static VariableUnit, f64)>, text: &str) {
    let read = scalar(|view| view.lowest());
    table.output("clearance_minimum", Span::Window, unit, text, read).display = Some(1);
}

/// Adds total forces and contact counts.
pub fn totals(table: &mut TableBuilder, friction: bool) {
    let peak = table.output(
        "normal_force_peak",
        Span::Window,
        Some((&FORCE, 100.0)),
        "Largest normal force of any contact node in any internal step of the communication step (grows as 1/h for impacts)",
        scalar(|view| view.window.normal_peak),
    );
    peak.quantity = Quantity::NormalForcePeak;
    table.output(
        "normal_impulse",
        Span::Window,
        Some((&IMPULSE, 1e-3)),
        "Sum of the normal impulses of all contact nodes within the communication step",
        scalar(|view| view.whole_normal_impulse()),
    );
    if friction {
        table.output(
            "friction_power",
            Span::Mean,
            Some((&POWER, 100.0)),
            "Friction power, mean over the communication step",
            scalar(|view| view.mean * view.window.friction_heat),
        );
    }
    let count = table.output(
        "contact_count",
        Span::Point,
        None,
        "Number of contact nodes in contact at the communication point",
        scalar(|view| view.contacts()),
    );
    (count.kind, count.variability, count.quantity) =
        (DataType::Integer, Variability::Discrete, Quantity::ContactCount);
    count.min = Some(0.0);
    let touching = table.output(
        "in_contact",
        Span::Point,
        None,
        "Whether any contact node is in contact at the communication point",
        scalar(|view| f64::from(u8::from(!view.system.events().is_empty()))),
    );
    (touching.kind, touching.variability) = (DataType::Boolean, Variability::Discrete);
}

/// Name, span, quantity if other code looks it up, text, and the term of the ledger or the instantaneous energy.
type Energy = (&'static str, Span, Quantity, &'static str, fn(&OutputView) -> f64);

/// All rows of the ledger; rows without text have different texts for rotors and for free bodies.
const ENERGIES: [Energy; 19] = [
    ("kinetic_energy", Span::Point, Quantity::KineticEnergy, "", |view| view.energies.0),
    ("strain_energy", Span::Point, Quantity::StrainEnergy, "", |view| view.energies.1),
    (
        "scheme_energy",
        Span::Point,
        Quantity::Output,
        "Energy conserved by the time scheme and used in the energy balance: kinetic plus strain energy, up to a \
         difference of second order in the step",
        |view| view.conserved,
    ),
    (
        "damping_loss",
        Span::Total,
        Quantity::DampingLoss,
        "Energy dissipated by modal damping since the start",
        |view| view.ledger().damping_loss.value(),
    ),
    ("friction_loss", Span::Total, Quantity::FrictionLoss, "Energy dissipated by friction since the start", |view| {
        view.ledger().friction_loss.value()
    }),
    ("impact_loss", Span::Total, Quantity::ImpactLoss, "", |view| view.ledger().impact_loss.value()),
    (
        "wear_work",
        Span::Total,
        Quantity::Output,
        "Work of the normal force of the coating against the approaching blades since the start",
        |view| view.ledger().wear_work.value(),
    ),
    (
        "cutting_work",
        Span::Total,
        Quantity::Output,
        "Work spent on cutting the coating since the start: specific cutting energy times removed volume",
        |view| view.ledger().cutting_work.value(),
    ),
    (
        "load_work",
        Span::Total,
        Quantity::Output,
        "Work of centrifugal, thermal and nodal-diameter loads since the start",
        |view| view.ledger().load_work.value(),
    ),
    (
        "excitation_work",
        Span::Total,
        Quantity::Output,
        "Work of the excitation of the blades since the start",
        |view| view.ledger().excitation_work.value(),
    ),
    (
        "external_work",
        Span::Total,
        Quantity::ExternalWork,
        "Work of all inputs except loads since the start: shaft, whirl, axial shift, casing motion",
        |view| view.ledger().external_work(),
    ),
    (
        "shaft_work",
        Span::Total,
        Quantity::Output,
        "Work of the shaft through the contacts since the start: minus the integral of torque times speed",
        |view| view.ledger().shaft_work.value(),
    ),
    (
        "stiffening_work",
        Span::Total,
        Quantity::Output,
        "Strain energy added since the start by centrifugal stiffening when the speed changes",
        |view| view.ledger().stiffening_work.value(),
    ),
    (
        "whirl_work",
        Span::Total,
        Quantity::Output,
        "Work of the whirling shaft since the start: minus the integral of force times velocity of its centre",
        |view| view.ledger().whirl_work.value(),
    ),
    ("shift_work", Span::Total, Quantity::Output, "Work of the axial shift of the rotor since the start", |view| {
        view.ledger().shift_work.value()
    }),
    (
        "casing_motion_work",
        Span::Total,
        Quantity::Output,
        "Work of the prescribed motion of the casing (radius, gap offset, shape) since the start",
        |view| view.ledger().casing_work.value(),
    ),
    (
        "curvature_work",
        Span::Total,
        Quantity::CurvatureWork,
        "Spurious energy added by contact forces since the start because of rotating normals and surface curvature within an \
         internal step (vanishes with the step)",
        |view| view.ledger().curvature_work.value(),
    ),
    (
        "step_change_energy",
        Span::Total,
        Quantity::Output,
        "Energy added by changes of the internal step since the start",
        |view| view.ledger().step_change.value(),
    ),
    ("energy_residual", Span::Point, Quantity::Output, "Residual of the energy balance", |view| {
        view.ledger().residual(view.conserved)
    }),
];

/// Adds the rows of the ledger that the scene needs.
pub fn energies(table: &mut TableBuilder, parts: &TableFacts) {
    let mut words = energy_descriptions(parts).into_iter();
    for (name, span, quantity, text, read) in ENERGIES.into_iter().filter(|row| exists(parts, row.0)) {
        let text = if text.is_empty() { words.next().unwrap_or_default() } else { text };
        let text = if name == "stiffening_work" && softens(parts) { SOFTENED } else { text };
        table.output(name, span, Some((&ENERGY, 1.0)), text, scalar(read)).quantity = quantity;
    }
    let relative = table.output(
        "energy_residual_relative",
        Span::Point,
        None,
        "Residual of the energy balance relative to the initial energy plus all work exchanged",
        scalar(|view| view.relative_residual()),
    );
    relative.quantity = Quantity::EnergyResidualRelative;
}

/// Description of stiffening if heat also softens.
const SOFTENED: &str =
    "Strain energy added since the start by stiffening and softening when speed and temperature change";

fn softens(parts: &TableFacts) -> bool {
    parts.bodies.iter().any(|body| body.structure.softening != 0.0)
}

/// Returns the descriptions of kinetic energy, strain energy and impact losses.
fn energy_descriptions(parts: &TableFacts) -> [&'static str; 3] {
    if parts.bodies.iter().any(|body| body.free) {
        return [
            "Kinetic energy of all structures, including rigid-body motion",
            "Strain energy of all structures",
            "Energy lost since the start when contact nodes hit a surface",
        ];
    }
    [
        "Instantaneous kinetic energy of the vibration in the rotating frame",
        "Instantaneous strain energy",
        "Energy lost since the start when contact nodes hit the casing",
    ]
}

fn exists(parts: &TableFacts, name: &str) -> bool {
    let (bodies, pairs) = (&parts.bodies, &parts.pairs);
    let turns = |body: &BodyFacts| body.structure.motion == BodyMotion::Rotating;
    match name {
        "friction_loss" => parts.has_friction(),
        "wear_work" => pairs.iter().any(|pair| pair.contact.coating.is_some()),
        "cutting_work" => parts.is_cut(),
        "load_work" => features::is_loaded(parts),
        "excitation_work" => bodies.iter().any(|body| body.structure.excitation.is_some()),
        // Free bodies have no inputs that could do work.
        "external_work" => bodies.iter().any(|body| !body.free),
        "shaft_work" => bodies.iter().any(turns),
        "stiffening_work" => bodies.iter().any(|body| body.structure.spin.stiffening) || softens(parts),
        "whirl_work" => bodies.iter().any(|body| body.structure.whirl),
        "shift_work" => bodies.iter().any(|body| body.structure.axial_shift),
        "casing_motion_work" => pairs.iter().any(|pair| pair.surface.moving),
        _ => true,
    }
}

/// Name, text, and the count.
type Count = (&'static str, &'static str, fn(&OutputView) -> f64);

/// Counts of the effort for a tolerance since the start.
const EFFORTS: [Count; 3] = [
    (
        "internal_trials",
        "Number of trial internal steps of all blades together since the start, including accepted steps",
        |view| view.trials(),
    ),
    (
        "internal_steps_max",
        "Largest number of trial internal steps of all blades together in any communication step since the start",
        |view| view.most_tried(),
    ),
    (
        "missed_steps",
        "Number of galerkin steps of minimum length since the start that were accepted although they missed the tolerance",
        |view| view.missed(),
    ),
];

/// Adds the current internal step and the number of steps; with a tolerance, also the effort.
pub fn internal_steps(table: &mut TableBuilder, settings: &SceneSettings) {
    let with_tolerance = settings.takes_a_tolerance();
    let internal = table.output(
        "internal_step",
        Span::Point,
        Some((&TIME, settings.time.step)),
        if with_tolerance {
            "Internal time step in use; with galerkin the maximum step"
        } else {
            "Internal time step in use"
        },
        scalar(|view| view.system.step_size()),
    );
    (internal.variability, internal.quantity) = (Variability::Discrete, Quantity::InternalStep);
    let steps = table.output(
        "internal_steps",
        Span::Total,
        None,
        if with_tolerance {
            "Number of internal steps since the start; with galerkin, the total of all blades"
        } else {
            "Number of internal steps since the start"
        },
        scalar(|view| view.internal_steps()),
    );
    steps.variability = Variability::Discrete;
    for (name, text, read) in EFFORTS.into_iter().filter(|_| with_tolerance) {
        table.output(name, Span::Total, None, text, scalar(read)).variability = Variability::Discrete;
    }
}
