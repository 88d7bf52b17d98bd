//! Effect on a run of the growth that the step adds.
//!
//! A growing motion moves contact until contact opens: then its contact force is as large as the force that presses the contact, and its
//! displacement is at most the fraction of the static flexibility that belongs to modes of its frequency and above. Growth of a contact
//! node on its own small mass at hundreds of kilohertz therefore causes hardly any displacement, at any rate, and growth of bending moves
//! the blade. Displacements below [`TOLERANCE`] of the clearance do not matter: so growth at a rate σ matters for ln(1/tolerance)/σ, and
//! for a shorter time if contact opens sooner.

use tiprub_cosim::persist_fields;

use super::{ContactDirections, GrowthRates, SlidingContacts, directional_modes};
use crate::modes::modal::ModalModel;
use crate::scene::method::Scheme;

/// Fraction of the clearance below which displacements do not matter.
pub const TOLERANCE: f64 = 1e-3;
/// Errors above this fraction of the contact displacement are reported.
pub const TOLD: f64 = 0.01;
/// Errors above this fraction are rejected if the step increases the growth beyond that of the differential equations.
pub(crate) const REFUSED: f64 = 0.05;
/// Modes may contribute to a motion if their frequency is at least this fraction of its frequency: half an octave below.
const BELOW: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Growth of one set of closed contacts at one step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SetGrowth {
    /// Growth rates of the set.
    pub growth: GrowthRates,
    /// Fraction of the static flexibility that belongs to modes of the stepped motion's frequency and above.
    pub share: f64,
}

persist_fields!(SetGrowth { growth, share });

/// Samples that turn by more than this per step (rad) do not represent a motion of the differential equations.
const ALTERNATES: f64 = 0.9 * std::f64::consts::PI;

impl SetGrowth {
    /// Computes the growth of a model under a scheme with a step (s), with all contacts closed.
    pub fn new(contacts: SlidingContacts, scheme: Scheme, step: f64, growth: GrowthRates) -> Self {
        // Contact forces that act one step late cause additional motions, above the frequencies of all modes. Motions that change sign
        // from step to step also belong to the step and not to a mode. With central differences the sampled frequency is higher than the
        // frequency of the motion.
        let is_caused_by_delay = scheme.properties().delays_contact && !growth.matches_flutter();
        let is_of_step = is_caused_by_delay || growth.swing * step > ALTERNATES;
        let frequency = growth.swing.min(contacts.model.largest_frequency());
        let share = if is_of_step { 1.0 } else { share_of(contacts.model, contacts.directions, frequency) };
        Self { growth, share }
    }

    /// Returns the largest error of the motion by the step, as a fraction of the contact displacement, while contact stays closed for a
    /// time (s).
    pub fn error(&self, closed: f64) -> f64 {
        -self.share * libm::expm1(-self.growth.added() * closed.min(self.grown()))
    }

    /// Time in which a negligible motion grows until contact opens (s).
    fn grown(&self) -> f64 {
        -libm::log(TOLERANCE) / self.growth.stepped.max(f64::MIN_POSITIVE)
    }

    /// Longest time (s) for which contact may stay closed with at most this error; infinite if the error never exceeds it.
    pub fn within(&self, error: f64) -> f64 {
        if self.error(f64::INFINITY) <= error {
            return f64::INFINITY;
        }
        -libm::log1p(-error / self.share) / self.growth.added()
    }

    /// Longest time (s) for which contact may stay closed without rejection; infinite if nothing is rejected.
    pub fn allowed(&self) -> f64 {
        let by_equations = self.growth.added() <= self.growth.continuous.max(0.0);
        if by_equations { f64::INFINITY } else { self.within(REFUSED) }
    }
}

/// Fraction of the static flexibility along the normals that belongs to modes of an angular frequency (rad/s) and above, including half an
/// octave below: of the contact with the largest fraction.
pub(crate) fn share_of(model: &ModalModel, directions: &ContactDirections, frequency: f64) -> f64 {
    let frequency = BELOW * frequency;
    if frequency <= 0.0 || model.frequencies.contains(&0.0) {
        return 1.0;
    }
    let (normals, _) = directional_modes(model, 0.0, directions);
    let share = |node: usize| {
        let seen = |mode: usize| (normals[(node, mode)] / model.frequencies[mode]).powi(2);
        let all: f64 = (0..model.len()).map(seen).sum();
        let from: f64 = (0..model.len()).filter(|mode| model.frequencies[*mode] >= frequency).map(seen).sum();
        if all > 0.0 { from / all } else { 0.0 }
    };
    (0..directions.len()).map(share).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::tests::radial;
    use crate::limits::{SlidingContacts, delassus, growth};
    use nalgebra::{DMatrix, DVector};
    use tiprub_test_models::SeededRandom;

    /// One contact node on modes of all frequencies, damped.
    fn anything(random: &mut SeededRandom) -> ModalModel {
        let modes = 5 + random.below(12);
        let mut frequencies: Vec<f64> = (0..modes).map(|_| random.scale(1e3, 1e6)).collect();
        frequencies.sort_by(f64::total_cmp);
        ModalModel {
            damping_ratios: vec![random.of(&[1e-3, 5e-3, 0.05]); modes],
            contact_modes: random.matrix(3, modes),
            shapes: DMatrix::identity(modes, modes),
            quasi_static: 3,
            frequencies,
        }
    }

    /// Simulates the contact, pressed by 1 at rest and disturbed by a tolerance: whether it ever opens, and the largest deviation of the
    /// node as a fraction of the contact displacement, over a number of steps. `None` if the contact problem has no solution.
    fn march(model: &ModalModel, scheme: Scheme, step: f64, friction: f64, steps: usize) -> Option<(bool, f64)> {
        let coefficients = model.coefficients(scheme, step);
        let (normals, forces) = directional_modes(model, friction, &radial());
        let square = |mode: usize| model.frequencies[mode] * model.frequencies[mode];
        let bent = DVector::from_fn(model.len(), |mode, _| forces[(0, mode)] / square(mode));
        let (yielding, within) =
            ((&normals * &bent)[0], delassus(SlidingContacts::new(model, friction, &radial()), scheme, step)[0]);
        if yielding <= 0.0 || within <= 0.0 {
            return None;
        }
        let rest = bent / yielding;
        let size = (&model.contact_modes * &rest).amax();
        let kicked = |mode: usize| TOLERANCE * rest[mode] * (step * model.frequencies[mode]).min(1.0);
        let (mut now, mut increment) = (rest.clone(), DVector::from_fn(model.len(), |mode, _| kicked(mode)));
        let mut contact = 1.0 / yielding;
        let (mut opens, mut most) = (false, 0.0_f64);
        for _ in 0..steps {
            let mut next = DVector::from_fn(model.len(), |mode, _| {
                let own = &coefficients[mode];
                now[mode] * (1.0 - own.kappa) + own.beta * increment[mode] + own.delayed * forces[(0, mode)] * contact
            });
            contact = ((1.0 - (&normals * &next)[0]) / within).max(0.0);
            opens |= contact == 0.0;
            next +=
                DVector::from_fn(model.len(), |mode, _| coefficients[mode].compliance * forces[(0, mode)] * contact);
            increment = &next - &now;
            now = next;
            most = most.max((&model.contact_modes * (&now - &rest)).amax() / size);
        }
        Some((opens, most))
    }

    /// Contact that comes to rest by the differential equations: accepted steps leave it at rest, and rejected steps do not.
    #[test]
    fn accepted_steps_keep_contact_closed_and_rejected_open_it() {
        let mut random = SeededRandom(11);
        let (mut accepted, mut refused, mut farthest) = (0, 0, 0.0_f64);
        for _ in 0..4000 {
            let model = anything(&mut random);
            let scheme = random.of(&Scheme::RECURRENCES);
            let (friction, product) = (random.scale(0.02, 1.5), random.scale(0.1, 1.9));
            let step = product / model.largest_frequency()
                * if scheme == Scheme::ModalExact { random.scale(1.0, 5.0) } else { 1.0 };
            let directions = radial();
            let contacts = SlidingContacts::new(&model, friction, &directions);
            let Some(growth) = growth(contacts, scheme, step) else { continue };
            if growth.continuous > -1e-3 / step / 5e3 {
                continue;
            }
            let judged = SetGrowth::new(contacts, scheme, step, growth);
            let steps = 3000;
            let closed = step * f64::from(steps);
            if judged.allowed() > closed {
                if growth.added() == 0.0 && accepted > 200 {
                    continue;
                }
                let Some((_, most)) = march(&model, scheme, step, friction, 3000) else { continue };
                accepted += 1;
                farthest = farthest.max(most);
                assert!(most < REFUSED, "{most:.3}: {scheme:?}, µ = {friction}, h = {step:e}, {judged:?}, {model:?}");
            } else if growth.added() * closed > 20.0 {
                let Some((opens, _)) = march(&model, scheme, step, friction, 3000) else { continue };
                refused += 1;
                assert!(opens, "{scheme:?}, µ = {friction}, h = {step:e}, {judged:?}, {model:?}");
            }
        }
        println!("{accepted} accepted, displaced by {farthest:.3} at most; {refused} refused");
        assert!(accepted > 100 && refused > 20, "{accepted} {refused}");
    }

    /// Two modes along the normal, of 1000 rad/s with 4/5 of the flexibility and 2000 rad/s with 1/5.
    #[test]
    fn flexibility_share_counts_modes_above_half_octave_below() {
        let model = ModalModel { quasi_static: 0, ..crate::limits::tests::model(&[1e3, 2e3], &[[1.0; 3]; 2], 0.0) };
        for (frequency, share) in [(1400.0, 1.0), (1430.0, 0.2), (2800.0, 0.2), (2850.0, 0.0)] {
            assert!((share_of(&model, &radial(), frequency) - share).abs() < 1e-15, "{frequency}");
        }
        // A force that acts one step late causes additional motions, which no mode bounds.
        let growth = GrowthRates { continuous: -1.0, frequency: 0.0, stepped: 1.0, swing: 1430.0, noise: 0.0 };
        let directions = radial();
        let contacts = SlidingContacts::new(&model, 0.0, &directions);
        let share = |scheme: Scheme| SetGrowth::new(contacts, scheme, 1e-5, growth).share;
        let [exact, massless] = [Scheme::ModalExact, Scheme::MasslessBoundary].map(share);
        assert!((exact - 0.2).abs() < 1e-15 && (massless - 1.0).abs() < 1e-15, "{exact}, {massless}");
        // The modes bound flutter of the equations, unless the steps change its frequency.
        for (swing, expected) in [(1450.0, 0.2), (1700.0, 1.0)] {
            let growth = GrowthRates { continuous: 5.0, frequency: 1430.0, stepped: 6.0, swing, noise: 0.0 };
            let share = SetGrowth::new(contacts, Scheme::MasslessBoundary, 1e-5, growth).share;
            assert!((share - expected).abs() < 1e-15, "{swing}: {share}");
        }
    }

    #[test]
    fn error_increases_with_time_and_growth() {
        let of = |continuous: f64, stepped: f64, share: f64| SetGrowth {
            growth: GrowthRates { continuous, frequency: 1e4, stepped, swing: 1e4, noise: 0.0 },
            share,
        };
        // Small: share · a · T.
        assert!((of(-5.0, 10.0, 0.5).error(1e-4) / 5e-4 - 1.0).abs() < 1e-3);
        assert!(of(-5.0, 10.0, 1.0).allowed() < of(-5.0, 1.0, 1.0).allowed());
        assert!((of(-5.0, 10.0, 1.0).error(of(-5.0, 10.0, 1.0).allowed()) / REFUSED - 1.0).abs() < 1e-9);
        // Contact without flexibility causes no displacement, and growth mainly by the differential equations is only reported.
        assert!(of(-5.0, 1e5, 0.9 * REFUSED).allowed().is_infinite());
        let flutter = of(1000.0, 1500.0, 1.0);
        assert!(flutter.allowed().is_infinite() && flutter.within(TOLD) < 1e-4);
        assert!(of(1000.0, 2500.0, 1.0).allowed() < 1e-4);
        assert!(of(1000.0, 900.0, 1.0).within(TOLD).is_infinite());
    }
}
