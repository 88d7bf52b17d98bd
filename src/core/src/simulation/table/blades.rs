//! Rows of effects on blades other than contact: excitation, heat, initial motion; and of damping by modes.

use tiprub_cosim::variables::Quantity;

use super::builder::TableBuilder;
use super::features::LARGEST_TEMPERATURE;
use super::parts::{BodyFacts, TableFacts};
use crate::scene::ranges;
use crate::scene::settings::StructureSettings;
use crate::simulation::units::{ANGLE, FORCE, LENGTH, LINEAR_SPEED, TEMPERATURE};

/// Adds excitation and temperature.
pub fn inputs(table: &mut TableBuilder, parts: &TableFacts, body: &BodyFacts) {
    if let Some(excitation) = &body.structure.excitation {
        let text = "Amplitude of the engine-order excitation of each blade";
        let (name, quantity) = ("excitation_amplitude", Quantity::Excitation(0));
        let row = table.moving_input(quantity, name, Some(&FORCE), excitation.amplitude, text);
        row.nominal(1.0).range(-ranges::EXCITATION, ranges::EXCITATION);
        let text = "Phase of the excitation: the load on blade j of N is amplitude cos(order (rotor angle + 2 pi (j - 1)/N) - \
             phase)";
        let (name, quantity) = ("excitation_phase", Quantity::Excitation(1));
        table.moving_input(quantity, name, Some(&ANGLE), excitation.phase, text).display(0);
    }
    if body.structure.thermal {
        let text = format!(
            "Temperature of {} relative to the reference temperature, at which it is undeformed",
            parts.rotor(body)
        );
        let row = table.moving_input(Quantity::RotorTemperature, "rotor_temperature", Some(&TEMPERATURE), 0.0, &text);
        row.nominal(100.0).range(-LARGEST_TEMPERATURE, LARGEST_TEMPERATURE);
    }
}

/// Adds engine order and initial motion.
pub fn parameters(table: &mut TableBuilder, body: &BodyFacts) {
    if let Some(excitation) = &body.structure.excitation {
        let text = "Engine order of the excitation of the blades";
        let row = table.whole(Quantity::ExcitationOrder, "excitation_order", excitation.order, text);
        row.range(0.0, ranges::ENGINE_ORDER);
    }
    let initial = &body.structure.initial;
    if initial.is_empty() {
        return;
    }
    let [displacements, velocities] =
        [initial.iter().map(|one| one.displacement).collect(), initial.iter().map(|one| one.velocity).collect()];
    let text = "Initial displacement of the blades, one value per [[structure.initial]]";
    let (name, quantity) = ("initial_displacement", Quantity::InitialDisplacement);
    let row = table.parameter(quantity, name, Some(&LENGTH), 0.0, text);
    row.starts(displacements).nominal(1e-4).display(1).range(-ranges::POSITION, ranges::POSITION);
    let text = "Initial velocity of the blades, one value per [[structure.initial]]";
    let row = table.parameter(Quantity::InitialRate, "initial_velocity", Some(&LINEAR_SPEED), 0.0, text);
    row.starts(velocities).nominal(1.0).range(-ranges::VELOCITY, ranges::VELOCITY);
}

/// Adds the damping ratios of the first modes.
pub(crate) fn mode_damping(
    table: &mut TableBuilder,
    quantity: Quantity,
    name: &str,
    structure: &StructureSettings,
    owner: &str,
) {
    let ratios = &structure.damping_ratios;
    if !ratios.is_empty() {
        let text = format!("Modal damping ratios of the first modes of {owner}");
        table.damping(quantity, name, 0.0, &text).starts(ratios.clone());
    }
}
