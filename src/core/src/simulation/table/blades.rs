//! Rows of effects on blades other than contact: excitation, heat, initial motion; and of damping by modes.

use tiprub_cosim::variables::{DataType, Quantity, StartValue};

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
        row.nominal = Some(1.0);
        (row.min, row.max) = (Some(-ranges::EXCITATION), Some(ranges::EXCITATION));
        let text = "Phase of the excitation: the load on blade j of N is amplitude cos(order (rotor angle + 2 pi (j - 1)/N) - \
             phase)";
        let (name, quantity) = ("excitation_phase", Quantity::Excitation(1));
        table.moving_input(quantity, name, Some(&ANGLE), excitation.phase, text).display = Some(0);
    }
    if body.structure.thermal {
        let text = format!(
            "Temperature of {} relative to the reference temperature, at which it is undeformed",
            parts.rotor(body)
        );
        let row = table.moving_input(Quantity::RotorTemperature, "rotor_temperature", Some(&TEMPERATURE), 0.0, &text);
        row.nominal = Some(100.0);
        (row.min, row.max) = (Some(-LARGEST_TEMPERATURE), Some(LARGEST_TEMPERATURE));
    }
}

/// Adds engine order and initial motion.
pub fn parameters(table: &mut TableBuilder, body: &BodyFacts) {
    if let Some(excitation) = &body.structure.excitation {
        let text = "Engine order of the excitation of the blades";
        let row = table.parameter(Quantity::ExcitationOrder, "excitation_order", None, 0.0, text);
        (row.kind, row.min, row.max) = (DataType::Integer, Some(0.0), Some(ranges::ENGINE_ORDER));
        row.start = Some(StartValue::Integer(i32::try_from(excitation.order).unwrap_or(i32::MAX)));
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
    (row.dimension, row.start, row.nominal, row.display) =
        (Some(initial.len()), Some(StartValue::Real(displacements)), Some(1e-4), Some(1));
    (row.min, row.max) = (Some(-ranges::POSITION), Some(ranges::POSITION));
    let text = "Initial velocity of the blades, one value per [[structure.initial]]";
    let row = table.parameter(Quantity::InitialRate, "initial_velocity", Some(&LINEAR_SPEED), 0.0, text);
    (row.dimension, row.start, row.nominal) = (Some(initial.len()), Some(StartValue::Real(velocities)), Some(1.0));
    (row.min, row.max) = (Some(-ranges::VELOCITY), Some(ranges::VELOCITY));
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
        let row = table.damping(quantity, name, 0.0, &format!("Modal damping ratios of the first modes of {owner}"));
        (row.dimension, row.start) = (Some(ratios.len()), Some(StartValue::Real(ratios.clone())));
    }
}
