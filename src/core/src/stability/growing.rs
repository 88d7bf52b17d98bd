//! Growth of contact that is closed and slides: of the equations, and of the scheme.

use super::ContactDirections;
use super::held::Held;
use crate::dynamics::modal::ModalModel;
use crate::settings::Scheme;

/// The scheme may exceed the growth rate of the continuous equations by this factor.
const GROWTH_FACTOR: f64 = 1.05;
/// Growth per step below this is rounding of the eigenvalue solver.
const GROWTH_NOISE: f64 = 1e-7;
/// Largest number of modes for which growth rates are computed.
const GROWTH_UP_TO: usize = 150;

/// Growth rates of closed sliding contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Growth {
    /// Of the constrained differential equations (1/s); positive means flutter.
    pub continuous: f64,
    /// Of the constrained step map (1/s).
    pub stepped: f64,
    /// Rates below this are rounding of the eigenvalue solver (1/s).
    noise: f64,
}

impl Growth {
    /// The scheme adds growth that the equations do not have.
    pub fn is_added(&self) -> bool {
        self.stepped > GROWTH_FACTOR * self.continuous.max(0.0) + self.noise
    }

    /// The equations themselves are unstable.
    pub fn is_flutter(&self) -> bool {
        self.continuous > self.noise
    }
}

/// Growth with all contacts of `directions` closed and sliding; `None` without friction, for models too large for dense
/// eigenvalues, and where the contacts are redundant.
pub fn growth(
    model: &ModalModel,
    scheme: Scheme,
    step: f64,
    friction: f64,
    directions: &ContactDirections,
) -> Option<Growth> {
    let continuous = continuous(model, scheme, step, friction, directions)?;
    stepped(model, scheme, step, friction, directions, continuous)
}

/// Growth rate (1/s) of the differential equations, exact to a small part of what counts as rounding at steps up to `step` (s);
/// `None` as with [`growth`].
pub fn continuous(
    model: &ModalModel,
    scheme: Scheme,
    step: f64,
    friction: f64,
    directions: &ContactDirections,
) -> Option<f64> {
    let held = || Held::continuous(model, scheme, step, friction, directions);
    let eigenvalues = is_looked_at(model, friction).then(held)?.eigenvalues()?;
    Some(eigenvalues.iter().fold(f64::NEG_INFINITY, |largest, value| largest.max(value.re)) / step)
}

/// [`growth`] where that of the differential equations is known, `continuous` (1/s).
pub fn stepped(
    model: &ModalModel,
    scheme: Scheme,
    step: f64,
    friction: f64,
    directions: &ContactDirections,
    continuous: f64,
) -> Option<Growth> {
    let held = || Held::stepped(model, scheme, step, friction, directions);
    let eigenvalues = is_looked_at(model, friction).then(held)?.eigenvalues()?;
    // |1 + s|² − 1.
    let gain = eigenvalues.iter().fold(-1.0, |largest: f64, s| largest.max(2.0 * s.re + s.norm_sqr()));
    Some(Growth { continuous, stepped: 0.5 * libm::log1p(gain) / step, noise: GROWTH_NOISE / step })
}

fn is_looked_at(model: &ModalModel, friction: f64) -> bool {
    friction != 0.0 && model.len() <= GROWTH_UP_TO
}

/// Steps at which growth is looked at, from `largest` down to where every mode is resolved well (at most 12 octaves).
pub fn growth_steps(frequency: f64, largest: f64) -> impl Iterator<Item = f64> {
    let resolved = 0.1 / frequency;
    std::iter::successors(Some(largest), |step| Some(step * std::f64::consts::FRAC_1_SQRT_2))
        .take_while(move |step| *step > resolved)
        .take(24)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::tests::{model, radial};

    #[test]
    fn frictionless_contact_adds_no_growth_and_damped_contact_decays() {
        let shapes = [[1.0, 0.2, 0.0], [0.3, -0.8, 0.1], [0.7, 0.4, 0.0]];
        for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
            let model = model(&[900.0, 2300.0, 8000.0], &shapes, 0.0);
            // Friction so small that it changes nothing but makes the question asked.
            let found = growth(&model, scheme, 1e-4, 1e-12, &radial()).unwrap();
            assert!(found.continuous.abs() < 1e-6 && found.stepped.abs() < 1e-6, "{found:?}");
            assert!(!found.is_added() && !found.is_flutter());
        }
    }

    #[test]
    fn growth_of_a_fluttering_contact_converges_to_the_continuous_rate() {
        // Two close modes coupled by friction through the contact; 178.516 1/s is the largest real part of the
        // eigenvalues of the constrained equations, computed independently with NumPy.
        let shapes = [[-0.1, -0.5, 0.0], [-0.3, 1.0, 0.0], [0.9, -0.8, 0.0]];
        let model = model(&[1000.0, 1050.0, 5000.0], &shapes, 0.0);
        let rate = |step| growth(&model, Scheme::ModalExact, step, 0.4, &radial()).unwrap();
        let (coarse, fine) = (rate(2e-5), rate(1e-5));
        let continuous = fine.continuous;
        assert!((continuous - 178.5158).abs() < 1e-3, "{continuous}");
        let order = ((coarse.stepped - continuous) / (fine.stepped - continuous)).abs().log2();
        println!("growth rate {continuous} 1/s, stepped {} and {}: order {order}", coarse.stepped, fine.stepped);
        assert!(order > 3.7, "order {order}");
        assert!(fine.is_flutter() && !fine.is_added());
    }

    #[test]
    fn damped_contact_decays_and_says_so_at_every_step_size() {
        // The constraint used to add zero eigenvalues, whose rounding looked like flutter at large steps.
        let shapes = [[1.0, 0.2, 0.0], [0.3, -0.8, 0.1], [0.7, 0.4, 0.0], [0.2, 0.9, 0.0]];
        let model = model(&[900.0, 2300.0, 8000.0, 90_000.0], &shapes, 0.005);
        for step in [1e-7, 1e-6, 1e-5, 1e-4, 1e-3] {
            let found = growth(&model, Scheme::ModalExact, step, 0.1, &radial()).unwrap();
            assert!(found.continuous < -1.0 && !found.is_flutter(), "h = {step}: {found:?}");
        }
    }
}
