//! Outputs that every scene has.

use tiprub_cosim::variables::{DataType, Quantity, Span, Variability};

use super::builder::{NominalUnit, TableBuilder};
use super::features;
use super::parts::TableFacts;
use crate::scene::settings::{BodyMotion, SceneSettings};
use crate::simulation::outputs::{OutputView, count, scalar};
use crate::simulation::units::{ENERGY, FORCE, IMPULSE, POWER, TIME};

pub fn smallest_clearance(table: &mut TableBuilder, unit: NominalUnit, text: &str) {
    table.output("clearance_minimum", Span::Window, unit, text, scalar(|view| view.lowest())).display(1);
}

/// Adds total forces and contact counts.
pub fn totals(table: &mut TableBuilder, friction: bool) {
    let text = "Largest normal force of any contact node in any internal step of the communication step (grows as 1/h for \
                impacts)";
    let read = scalar(|view| view.window.normal_peak);
    let peak = table.output("normal_force_peak", Span::Window, Some((&FORCE, 100.0)), text, read);
    peak.quantity(Quantity::NormalForcePeak);
    let text = "Sum of the normal impulses of all contact nodes within the communication step";
    let read = scalar(|view| view.window.bodies.iter().flat_map(|body| &body.normal_impulse).sum());
    table.output("normal_impulse", Span::Window, Some((&IMPULSE, 1e-3)), text, read);
    if friction {
        let text = "Friction power, mean over the communication step";
        let read = scalar(|view| view.mean * view.window.friction_heat);
        table.output("friction_power", Span::Mean, Some((&POWER, 100.0)), text, read);
    }
    let text = "Number of contact nodes in contact at the communication point";
    let contacts =
        table.output("contact_count", Span::Point, None, text, count(|view| view.system.events().len() as u64));
    (contacts.kind, contacts.variability, contacts.min) = (DataType::Integer, Variability::Discrete, Some(0.0));
    contacts.quantity(Quantity::ContactCount);
    let text = "Whether any contact node is in contact at the communication point";
    let read = scalar(|view| f64::from(u8::from(!view.system.events().is_empty())));
    let touching = table.output("in_contact", Span::Point, None, text, read);
    (touching.kind, touching.variability) = (DataType::Boolean, Variability::Discrete);
}

/// Name, span, quantity, text, the term of the ledger or the instantaneous energy, and whether a scene has the row.
type Energy = (&'static str, Span, Quantity, &'static str, fn(&OutputView) -> f64, fn(&TableFacts) -> bool);

/// Defines rows of the energy ledger: quantity, name, term, text, and whether a scene has the row.
macro_rules! terms {
    ($($quantity:ident $name:literal $($term:ident).+ $text:expr, $exists:expr;)*) => {
        [$(($name, Span::Total, Quantity::$quantity, $text, |view| view.ledger.$($term).+(), $exists)),*]
    };
}

/// Instantaneous energies. A row without a text gets its text elsewhere, because rotors and free bodies need different
/// texts.
const STATES: [Energy; 3] = [
    ("kinetic_energy", Span::Point, Quantity::KineticEnergy, "", |view| view.energies.0, |_| true),
    ("strain_energy", Span::Point, Quantity::StrainEnergy, "", |view| view.energies.1, |_| true),
    (
        "scheme_energy",
        Span::Point,
        Quantity::Output,
        "Energy conserved by the time scheme and used in the energy balance: kinetic plus strain energy, up to a \
         difference of second order in the step",
        |view| view.conserved,
        |_| true,
    ),
];

/// Terms of the energy ledger.
const TERMS: [Energy; 15] = terms! {
    DampingLoss "damping_loss" damping_loss.value "Energy dissipated by modal damping since the start", |_| true;
    FrictionLoss "friction_loss" friction_loss.value
        "Energy dissipated by friction since the start",
        |parts| parts.has_friction();
    ImpactLoss "impact_loss" impact_loss.value "", |_| true;
    Output "wear_work" wear_work.value
        "Work of the normal force of the coating against the approaching blades since the start",
        |parts| parts.pairs.iter().any(|pair| pair.contact.coating.is_some());
    Output "cutting_work" cutting_work.value
        "Work spent on cutting the coating since the start: specific cutting energy times removed volume",
        |parts| parts.is_cut();
    Output "load_work" load_work.value
        "Work of centrifugal, thermal and nodal-diameter loads since the start",
        features::is_loaded;
    Output "excitation_work" excitation_work.value
        "Work of the excitation of the blades since the start",
        |parts| parts.bodies.iter().any(|body| body.structure.excitation.is_some());
    ExternalWork "external_work" external_work
        "Work of all inputs except loads since the start: shaft, whirl, axial shift, casing motion",
        // Free bodies have no inputs that could do work.
        |parts| parts.bodies.iter().any(|body| !body.free);
    Output "shaft_work" shaft_work.value
        "Work of the shaft through the contacts since the start: minus the integral of torque times speed",
        |parts| parts.bodies.iter().any(|body| body.structure.motion == BodyMotion::Rotating);
    Output "stiffening_work" stiffening_work.value
        "Strain energy added since the start by centrifugal stiffening when the speed changes",
        |parts| parts.bodies.iter().any(|body| body.structure.spin.stiffening) || softens(parts);
    Output "whirl_work" whirl_work.value
        "Work of the whirling shaft since the start: minus the integral of force times velocity of its centre",
        |parts| parts.bodies.iter().any(|body| body.structure.whirl);
    Output "shift_work" shift_work.value
        "Work of the axial shift of the rotor since the start",
        |parts| parts.bodies.iter().any(|body| body.structure.axial_shift);
    Output "casing_motion_work" casing_work.value
        "Work of the prescribed motion of the casing (radius, gap offset, shape) since the start",
        |parts| parts.pairs.iter().any(|pair| pair.surface.moving);
    CurvatureWork "curvature_work" curvature_work.value
        "Spurious energy added by contact forces since the start because of rotating normals and surface curvature within an \
         internal step (vanishes with the step)",
        |_| true;
    Output "step_change_energy" step_change.value
        "Energy added by changes of the internal step since the start",
        |_| true;
};

/// Adds the rows of the ledger that the scene needs.
pub fn energies(table: &mut TableBuilder, parts: &TableFacts) {
    let mut words = energy_descriptions(parts).into_iter();
    for (name, span, quantity, text, read, _) in STATES.into_iter().chain(TERMS).filter(|row| row.5(parts)) {
        let text = if text.is_empty() { words.next().unwrap_or_default() } else { text };
        let text = if name == "stiffening_work" && softens(parts) { SOFTENED } else { text };
        table.output(name, span, Some((&ENERGY, 1.0)), text, scalar(read)).quantity(quantity);
    }
    let read = scalar(|view| view.ledger.residual(view.conserved));
    let text = "Residual of the energy balance";
    table.output("energy_residual", Span::Point, Some((&ENERGY, 1.0)), text, read);
    let text = "Residual of the energy balance relative to the initial energy plus all work exchanged";
    let read = scalar(|view| view.relative_residual());
    let relative = table.output("energy_residual_relative", Span::Point, None, text, read);
    relative.quantity(Quantity::EnergyResidualRelative);
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

/// Name, text, and the count.
type Count = (&'static str, &'static str, fn(&OutputView) -> u64);

/// Counts of the effort for a tolerance since the start.
const EFFORTS: [Count; 3] = [
    (
        "internal_trials",
        "Number of trial internal steps of all blades together since the start, including accepted steps",
        |view| view.system.steps_tried(),
    ),
    (
        "internal_steps_max",
        "Largest number of trial internal steps of all blades together in any communication step since the start",
        |view| view.simulation.state.clock.most_tried,
    ),
    (
        "missed_steps",
        "Number of galerkin steps of minimum length since the start that were accepted although they missed the tolerance",
        |view| view.system.effort().missed,
    ),
];

/// Adds the current internal step and the number of steps; with a tolerance, also the effort.
pub fn internal_steps(table: &mut TableBuilder, settings: &SceneSettings) {
    let with_tolerance = settings.takes_a_tolerance();
    let [step_text, count_text] = if with_tolerance {
        [
            "Internal time step in use; with galerkin the maximum step",
            "Number of internal steps since the start; with galerkin, the total of all blades",
        ]
    } else {
        ["Internal time step in use", "Number of internal steps since the start"]
    };
    let (unit, read) = (Some((&TIME, settings.time.step)), scalar(|view| view.system.step_size()));
    let internal = table.output("internal_step", Span::Point, unit, step_text, read);
    internal.quantity(Quantity::InternalStep).variability = Variability::Discrete;
    let read = count(|view| view.system.effort().steps);
    table.output("internal_steps", Span::Total, None, count_text, read).variability = Variability::Discrete;
    for (name, text, read) in EFFORTS.into_iter().filter(|_| with_tolerance) {
        table.output(name, Span::Total, None, text, count(read)).variability = Variability::Discrete;
    }
}
