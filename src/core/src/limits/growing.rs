//! Growth of closed sliding contact: by the differential equations, and by the scheme.

use nalgebra::Complex;
use tiprub_cosim::persist_fields;

use super::held::HeldContacts;
use super::secular;
use super::{SlidingContacts, is_solvable};
use crate::modes::modal::ModalModel;
use crate::scene::method::Scheme;

/// Growth per step below this is rounding of the eigenvalue solver.
pub(crate) const GROWTH_NOISE: f64 = 1e-7;
/// Two motions count as the same if their frequencies differ by less than this fraction.
const SAME_MOTION: f64 = 0.1;
/// Largest number of modes for which growth rates are computed.
pub(crate) const GROWTH_UP_TO: usize = 150;

/// The motion e^(st) that grows fastest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Fastest {
    /// Re s (1/s).
    pub rate: f64,
    /// |Im s| (rad/s); 0 for growth without oscillation.
    pub frequency: f64,
}

/// Growth rates of closed sliding contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GrowthRates {
    /// Rate of the constrained differential equations (1/s); positive means flutter.
    pub continuous: f64,
    /// Angular frequency of that motion (rad/s); 0 for growth without oscillation.
    pub frequency: f64,
    /// Rate of the constrained step map (1/s).
    pub stepped: f64,
    /// Angular frequency of that motion (rad/s) as sampled: at most π/h.
    pub swing: f64,
    /// Rates below this are rounding of the eigenvalue solver (1/s).
    pub noise: f64,
}

persist_fields!(Fastest { rate, frequency });
persist_fields!(GrowthRates { continuous, frequency, stepped, swing, noise });

impl GrowthRates {
    /// Growth that the scheme adds to that of the differential equations (1/s), 0 if it adds none.
    pub fn added(&self) -> f64 {
        let added = self.stepped - self.continuous.max(0.0);
        if added > self.noise { added } else { 0.0 }
    }

    /// Returns whether the fastest-growing motion of the time steps has the flutter frequency of the differential equations.
    pub(crate) fn matches_flutter(&self) -> bool {
        self.is_flutter() && (self.swing - self.frequency).abs() < SAME_MOTION * self.frequency
    }

    /// Returns whether the differential equations themselves are unstable.
    pub fn is_flutter(&self) -> bool {
        self.continuous > self.noise
    }
}

/// Computes the growth with all contacts of `directions` closed and sliding; `None` without friction, for models too large for dense
/// eigenvalues, and if the contacts are redundant.
pub fn growth(contacts: SlidingContacts, scheme: Scheme, step: f64) -> Option<GrowthRates> {
    stepped(contacts, scheme, step, continuous(contacts, scheme, step)?)
}

/// Computes the growth of the differential equations, exact to a small part of what counts as rounding at steps up to `step` (s); `None` as
/// with [`growth`].
pub fn continuous(contacts: SlidingContacts, scheme: Scheme, step: f64) -> Option<Fastest> {
    let unit = balanced(contacts.model, step);
    let held = || HeldContacts::continuous(contacts, scheme.properties().quasi_static, unit);
    fastest_held(&contacts.are_checked().then(held)?, unit)
}

/// Time (s) up to `step` with which the matrices of the differential equations are well balanced: up to ω_max h = 2.
fn balanced(model: &ModalModel, step: f64) -> f64 {
    step.min(2.0 / model.largest_frequency())
}

/// Finds the fastest growth of held contacts whose rates are per `unit` (s).
fn fastest_held(held: &HeldContacts, unit: f64) -> Option<Fastest> {
    let Fastest { rate, frequency } = fastest(&eigenvalues(held)?);
    Some(Fastest { rate: rate / unit, frequency: frequency / unit })
}

/// Computes the growth without the mass of the contact nodes, with their highest modes quasi-static: the limit of contact nodes without
/// lumped mass. `None` if the model has no other mode with inertia, and if the remaining flexibility of the contacts is no P-matrix with
/// this friction: then the limit has no solution, and unbounded growth would not be visible.
pub fn without_node_mass(contacts: SlidingContacts, step: f64) -> Option<Fastest> {
    if !contacts.are_checked() {
        return None;
    }
    let unit = balanced(contacts.model, step);
    let held = HeldContacts::continuous(contacts, true, unit);
    let has_limit = !held.modes.is_empty() && held.residual.as_ref().is_some_and(is_solvable);
    fastest_held(has_limit.then_some(&held)?, unit).filter(|found| found.rate.is_finite())
}

/// Computes [`growth`] for a known growth of the differential equations.
pub fn stepped(contacts: SlidingContacts, scheme: Scheme, step: f64, continuous: Fastest) -> Option<GrowthRates> {
    let held = || HeldContacts::stepped(contacts, scheme, step);
    let eigenvalues = eigenvalues(&contacts.are_checked().then(held)?)?;
    let found = fastest_stepped(&eigenvalues);
    Some(GrowthRates {
        continuous: continuous.rate,
        frequency: continuous.frequency,
        stepped: found.rate / step,
        swing: found.frequency / step,
        noise: GROWTH_NOISE / step,
    })
}

/// Finds the fastest growth of motions e^st.
pub(super) fn fastest(eigenvalues: &[Complex<f64>]) -> Fastest {
    let none = Fastest { rate: f64::NEG_INFINITY, frequency: 0.0 };
    eigenvalues.iter().fold(
        none,
        |most, s| {
            if s.re > most.rate { Fastest { rate: s.re, frequency: s.im.abs() } } else { most }
        },
    )
}

/// Finds the fastest growth of motions (1 + s)^t.
fn fastest_stepped(eigenvalues: &[Complex<f64>]) -> Fastest {
    // |1 + s|² − 1.
    let (mut gain, mut frequency) = (-1.0, 0.0);
    for s in eigenvalues {
        let own = 2.0 * s.re + s.norm_sqr();
        if own > gain {
            (gain, frequency) = (own, libm::atan2(s.im, 1.0 + s.re).abs());
        }
    }
    Fastest { rate: 0.5 * libm::log1p(gain), frequency }
}

impl SlidingContacts<'_> {
    fn are_checked(&self) -> bool {
        self.friction != 0.0 && self.model.len() <= GROWTH_UP_TO
    }
}

/// Steps at which growth is checked, from `largest` down to the step that resolves every mode well (at most 12 octaves).
pub(crate) fn growth_steps(frequency: f64, largest: f64) -> impl Iterator<Item = f64> {
    let resolved = 0.1 / frequency;
    std::iter::successors(Some(largest), |step| Some(step * std::f64::consts::FRAC_1_SQRT_2))
        .take_while(move |step| *step > resolved)
        .take(24)
}

/// Returns the eigenvalues: for few contacts by [`secular`], and otherwise, or if that proves nothing, from the dense matrix. At least one
/// of each complex pair; `None` if the contacts are redundant.
fn eigenvalues(held: &HeldContacts) -> Option<Vec<Complex<f64>>> {
    secular::eigenvalues(held).or_else(|| held.dense_eigenvalues())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::tests::{model, radial};
    use crate::limits::{ContactDirections, delassus, directional_modes, secular};
    use crate::math::vector::Vector3;
    use nalgebra::{DMatrix, DVector};
    use tiprub_test_models::SeededRandom;

    /// Random structure with at least two modes more than `contacts`, and with properties that make eigenvalues hard to find: equal and
    /// rigid modes, modes with little or no contact participation, damping of all sizes.
    fn anything(random: &mut SeededRandom, contacts: usize) -> ModalModel {
        let modes = 3 * contacts + 2 + random.below(20) + if random.unit() < 0.05 { 40 } else { 0 };
        let mut frequencies: Vec<f64> = (0..modes).map(|_| random.scale(1e3, 1e6)).collect();
        frequencies.sort_by(f64::total_cmp);
        if random.unit() < 0.2 {
            frequencies[1] = frequencies[0];
        }
        if random.unit() < 0.1 {
            frequencies[0] = 0.0;
        }
        let mut contact_modes = random.matrix(3 * contacts, modes);
        if random.unit() < 0.3 {
            let size = random.of(&[0.0, 1e-12, 1e-6]);
            contact_modes.column_mut(random.below(modes)).scale_mut(size);
        }
        let damping = random.of(&[0.0, 1e-6, 1e-3, 0.05, 0.9]);
        let shapes = DMatrix::identity(modes, modes);
        ModalModel {
            frequencies,
            damping_ratios: vec![damping; modes],
            contact_modes,
            shapes,
            quasi_static: 3 * contacts,
        }
    }

    /// Zeros of the small determinant against eigenvalues of the dense matrix: growth, and the conclusions from it.
    #[test]
    fn growth_from_determinant_zeros_matches_dense_matrix() {
        let mut random = SeededRandom(37);
        let (mut tried, mut proven, mut verdicts) = (0.0, 0.0, [0; 4]);
        for _ in 0..400 * Scheme::RECURRENCES.len() {
            let contacts = 1 + random.below(3);
            let model = anything(&mut random, contacts);
            let scheme = random.of(&Scheme::RECURRENCES);
            if scheme == Scheme::MasslessBoundary && model.frequencies[0] == 0.0 {
                continue;
            }
            let friction = random.scale(0.01, 3.0);
            let step = random.scale(0.05, 1.9) / model.largest_frequency();
            let directions: ContactDirections =
                (0..contacts).map(|_| (-Vector3::x(), random.of(&[1.0, -1.0]) * Vector3::y())).collect();
            let held = [
                HeldContacts::continuous(
                    SlidingContacts::new(&model, friction, &directions),
                    scheme.properties().quasi_static,
                    step,
                ),
                HeldContacts::stepped(SlidingContacts::new(&model, friction, &directions), scheme, step),
            ];
            tried += 1.0;
            let [Some(continuous), Some(stepped)] = held.each_ref().map(secular::eigenvalues) else { continue };
            proven += 1.0;
            let [Some(own), Some(own_stepped)] = held.each_ref().map(HeldContacts::dense_eigenvalues) else { continue };
            let noise = GROWTH_NOISE;
            let of = |continuous: &[Complex<f64>], stepped: &[Complex<f64>]| {
                let (continuous, stepped) = (fastest(continuous), fastest_stepped(stepped));
                let Fastest { rate, frequency } = continuous;
                GrowthRates { continuous: rate, frequency, stepped: stepped.rate, swing: stepped.frequency, noise }
            };
            let (found, dense) = (of(&continuous, &stepped), of(&own, &own_stepped));
            let near = |a: f64, b: f64| (a - b).abs() < 0.1 * GROWTH_NOISE + 1e-7 * b.abs();
            assert!(
                near(found.continuous, dense.continuous) && near(found.stepped, dense.stepped),
                "{found:?} for {dense:?}: {scheme:?}, µ = {friction}, h = {step:e}, {model:?}"
            );
            let verdict =
                |growth: &GrowthRates| (growth.added() > 0.05 * growth.continuous.max(0.0), growth.is_flutter());
            assert_eq!(verdict(&found), verdict(&dense));
            verdicts[2 * usize::from(verdict(&found).0) + usize::from(found.is_flutter())] += 1;
        }
        println!("{proven} of {tried} proven; stable, flutter, added growth, both: {verdicts:?}");
        assert!(proven > 0.9 * tried, "{proven} of {tried}");
        assert!(verdicts[..3].iter().all(|count| *count > 10), "{verdicts:?}");
    }

    /// Growth per step of the recurrence with the contacts closed, over the second half of 4000 steps.
    fn stepped_through(model: &ModalModel, scheme: Scheme, step: f64, directions: &ContactDirections) -> f64 {
        let dynamic = model.dynamic_modes(scheme);
        let coefficients = model.coefficients(scheme, step);
        let (normals, forces) = directional_modes(model, FRICTION, directions);
        let inverse = delassus(SlidingContacts::new(model, FRICTION, directions), scheme, step).try_inverse().unwrap();
        let (mut now, mut increment) = (DVector::from_element(dynamic, 1.0), DVector::zeros(dynamic));
        let (mut contact, mut growth) = (DVector::zeros(directions.len()), 0.0);
        for index in 0..4000 {
            let late = forces.columns(0, dynamic).transpose() * &contact;
            let mut next = DVector::from_fn(dynamic, |mode, _| {
                let own = &coefficients[mode];
                now[mode] * (1.0 - own.kappa) + own.beta * increment[mode] + own.delayed * late[mode]
            });
            contact = &inverse * (normals.columns(0, dynamic) * &next) * -1.0;
            let pushed = forces.columns(0, dynamic).transpose() * &contact;
            next += DVector::from_fn(dynamic, |mode, _| coefficients[mode].compliance * pushed[mode]);
            increment = &next - &now;
            let size = next.norm() + increment.norm();
            growth += if index < 2000 { 0.0 } else { libm::log(size) / 2000.0 };
            [&mut now, &mut increment, &mut contact].into_iter().for_each(|vector| *vector /= size);
            now = next / size;
        }
        growth
    }

    const FRICTION: f64 = 2.0;

    #[test]
    fn simulated_growth_matches_the_predicted_rate() {
        let mut random = SeededRandom(8);
        for scheme in Scheme::RECURRENCES {
            let mut compared = 0;
            while compared < 8 {
                let model = anything(&mut random, 1);
                let step = random.scale(0.3, 1.9) / model.largest_frequency();
                let Some(found) = growth(SlidingContacts::new(&model, FRICTION, &radial()), scheme, step) else {
                    continue;
                };
                if model.frequencies[0] > 0.0 && found.stepped * step > 0.05 {
                    let rate = stepped_through(&model, scheme, step, &radial());
                    assert!((rate - found.stepped * step).abs() < 2e-3, "{scheme:?}: {rate}, {found:?}, {step:e}");
                    compared += 1;
                }
            }
        }
    }

    #[test]
    fn frictionless_contact_does_not_grow_and_damping_decays() {
        let shapes = [[1.0, 0.2, 0.0], [0.3, -0.8, 0.1], [0.7, 0.4, 0.0]];
        for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
            let model = model(&[900.0, 2300.0, 8000.0], &shapes, 0.0);
            // Friction so small that it has no effect but enables the check.
            let found = growth(SlidingContacts::new(&model, 1e-12, &radial()), scheme, 1e-4).unwrap();
            assert!(found.continuous.abs() < 1e-6 && found.stepped.abs() < 1e-6, "{found:?}");
            assert!(found.added() < 1e-6 && !found.is_flutter());
        }
    }

    #[test]
    fn flutter_growth_converges_to_the_continuous_rate() {
        // Two close modes coupled by friction through the contact; 178.516 1/s is the largest real part of the
        // eigenvalues of the constrained equations, computed independently with NumPy.
        let shapes = [[-0.1, -0.5, 0.0], [-0.3, 1.0, 0.0], [0.9, -0.8, 0.0]];
        let model = model(&[1000.0, 1050.0, 5000.0], &shapes, 0.0);
        let rate = |step| growth(SlidingContacts::new(&model, 0.4, &radial()), Scheme::ModalExact, step).unwrap();
        let (coarse, fine) = (rate(2e-5), rate(1e-5));
        let continuous = fine.continuous;
        assert!((continuous - 178.5158).abs() < 1e-3, "{continuous}");
        let order = ((coarse.stepped - continuous) / (fine.stepped - continuous)).abs().log2();
        println!("growth rate {continuous} 1/s, stepped {} and {}: order {order}", coarse.stepped, fine.stepped);
        assert!(order > 3.7, "order {order}");
        assert!(fine.is_flutter() && fine.added() < 0.05 * continuous);
        // Between the two modes that friction couples, both as sampled and in the motion.
        assert!((1000.0..1400.0).contains(&fine.frequency), "{}", fine.frequency);
        assert!((fine.swing / fine.frequency - 1.0).abs() < 1e-4, "{} {}", fine.swing, fine.frequency);
    }

    #[test]
    fn damped_contact_decays_at_every_step_size() {
        // The constraint used to add zero eigenvalues, whose rounding looked like flutter at large steps.
        let shapes = [[1.0, 0.2, 0.0], [0.3, -0.8, 0.1], [0.7, 0.4, 0.0], [0.2, 0.9, 0.0]];
        let model = model(&[900.0, 2300.0, 8000.0, 90_000.0], &shapes, 0.005);
        for step in [1e-7, 1e-6, 1e-5, 1e-4, 1e-3] {
            let found = growth(SlidingContacts::new(&model, 0.1, &radial()), Scheme::ModalExact, step).unwrap();
            assert!(found.continuous < -1.0 && !found.is_flutter(), "h = {step}: {found:?}");
        }
    }

    /// Without the mass of the node, the rest is inclined: with µ > 0.5 it yields to no force, and there is no such limit.
    #[test]
    fn massless_node_that_locks_up_has_no_growth_rate() {
        let leaning = ModalModel { quasi_static: 1, ..model(&[1e3, 1e5], &[[1.0, 0.2, 0.0], [0.5, -1.0, 0.0]], 0.01) };
        let found = |friction: f64| without_node_mass(SlidingContacts::new(&leaning, friction, &radial()), 1e-5);
        assert!(found(0.49).is_some() && found(0.51).is_none(), "{:?}, {:?}", found(0.49), found(0.51));
    }
}
