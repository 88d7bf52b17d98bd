//! Start of the runs after the start values were changed: rotating master, clearances, shape of the casing, and other excitations.

use tiprub_core::scene::settings::{BodyMotion, SceneSettings};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::Quantity;
use tiprub_shell::{Failure, Result};

/// Start values that the prediction and the facts depend on.
#[derive(Debug, Clone, PartialEq)]
pub struct MapStart {
    /// Smallest and largest clearance of the tips from the round casing (m).
    pub clearance: [f64; 2],
    /// Factor on the shape of the casing.
    pub shape_factor: f64,
    /// Orders around the circumference of excitations other than the shape.
    pub orders: Vec<usize>,
    /// Causes of motion of tips or casing besides contact, which clearances at rest do not include.
    pub acting: Vec<&'static str>,
    /// Damping ratio ξ of the rotor.
    pub damping_ratio: f64,
    /// Friction coefficient µ.
    pub friction: f64,
    /// Time in which the shape of the casing grows (s).
    pub ramp_time: f64,
}

impl Default for MapStart {
    fn default() -> Self {
        Self {
            clearance: [0.0; 2],
            shape_factor: 1.0,
            orders: Vec::new(),
            acting: Vec::new(),
            damping_ratio: 0.0,
            friction: 0.0,
            ramp_time: 0.0,
        }
    }
}

impl MapStart {
    /// Reads the start from a simulation that has its start values.
    ///
    /// # Errors
    /// The master of the scene cannot rotate.
    pub fn of(scene: &Scene, simulation: &Simulation) -> Result<Self> {
        let value = |quantity| values(simulation, quantity).first().copied();
        let or_nothing = |quantity| value(quantity).unwrap_or(0.0);
        let contact = &scene.settings.contacts[0];
        let opened = or_nothing(Quantity::GapOffset) + or_nothing(Quantity::RadiusChange);
        let gaps =
            if contact.sector_gaps.is_empty() { std::slice::from_ref(&contact.gap) } else { &contact.sector_gaps };
        let smallest = gaps.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = gaps.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let amplitude = or_nothing(Quantity::LoadAmplitude);
        let order = simulation.table().with_quantity(Quantity::LoadOrder);
        let order = order.and_then(|variable| usize::try_from(simulation.integer(variable.reference).ok()?).ok());
        let whirls = [0, 1].iter().any(|component| or_nothing(Quantity::ShaftDisplacement(*component)) != 0.0);
        let temperatures = values(simulation, Quantity::CasingTemperature);
        let growth = scene.settings.structures[master(&scene.settings)?].spin.growth;
        let acting = [
            ("load", amplitude != 0.0),
            ("heat", temperatures.iter().any(|temperature| *temperature != 0.0)),
            ("growth", growth),
            ("whirl", whirls),
            ("axial shift", or_nothing(Quantity::ShaftDisplacement(2)) != 0.0),
        ];
        Ok(Self {
            clearance: [smallest + opened, largest + opened],
            shape_factor: value(Quantity::ShapeFactor).unwrap_or(1.0),
            orders: orders(order.filter(|_| amplitude != 0.0), whirls, &temperatures),
            acting: acting.into_iter().filter(|(_, acts)| *acts).map(|(name, _)| name).collect(),
            damping_ratio: or_nothing(Quantity::DampingRatio),
            friction: or_nothing(Quantity::Friction),
            ramp_time: or_nothing(Quantity::RampTime),
        })
    }

    /// Returns, for example, `", without load and heat"` if these act.
    pub fn without(&self) -> String {
        match self.acting.split_last() {
            None => String::new(),
            Some((only, [])) => format!(", without {only}"),
            Some((last, others)) => format!(", without {} and {last}", others.join(", ")),
        }
    }
}

/// Returns the structure that is the master of the first contact, which must be able to rotate.
///
/// # Errors
/// There is no such structure, or it is a free body or stationary.
pub fn master(settings: &SceneSettings) -> Result<usize> {
    let what = || format!("scene `{}`", settings.name);
    let name = settings.contacts.first().map(|contact| &contact.master);
    let found = settings.structures.iter().position(|structure| Some(&structure.name) == name);
    let master = found.ok_or_else(|| Failure::new(what(), "no contact has a master", "Add a contact"))?;
    let instead = match settings.structures[master].motion {
        BodyMotion::Rotating => return Ok(master),
        BodyMotion::Free => "is a free body",
        BodyMotion::Still => "does not rotate",
    };
    let name = &settings.structures[master].name;
    Err(Failure::usage(
        what(),
        format!("an interaction map needs a rotating master, and `{name}` {instead}"),
        "Give a scene whose first contact has a rotating master, such as builtin:rotor37, or use `tiprub run`",
    ))
}

/// Returns all elements of a real variable; empty if the scene does not have it.
fn values(simulation: &Simulation, quantity: Quantity) -> Vec<f64> {
    let Some(variable) = simulation.table().with_quantity(quantity) else { return Vec::new() };
    let references = (0..variable.len()).zip(variable.reference..);
    references.filter_map(|(_, reference)| simulation.real(reference).ok()).collect()
}

/// Returns the orders of a load, of an eccentric shaft (1), and of uneven temperatures (1, since they may contain any order).
fn orders(load: Option<usize>, whirls: bool, temperatures: &[f64]) -> Vec<usize> {
    let even = temperatures.windows(2).all(|two| two[0].to_bits() == two[1].to_bits());
    load.into_iter().chain(whirls.then_some(1)).chain((!even).then_some(1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loads_whirl_and_uneven_heat_contribute_orders() {
        assert_eq!(orders(None, false, &[]), [0; 0]);
        assert_eq!(orders(Some(6), false, &[20.0; 8]), [6]);
        assert_eq!(orders(Some(6), true, &[]), [6, 1]);
        assert_eq!(orders(None, false, &[20.0, 20.0, 21.0]), [1]);
    }

    #[test]
    fn lists_the_omitted_effects() {
        let of = |acting: &[&'static str]| MapStart { acting: acting.to_vec(), ..MapStart::default() }.without();
        assert_eq!(of(&[]), "");
        assert_eq!(of(&["heat"]), ", without heat");
        assert_eq!(of(&["load", "heat", "growth"]), ", without load, heat and growth");
    }
}
