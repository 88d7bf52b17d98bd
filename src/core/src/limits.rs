//! Limits that are checked before a scene is stepped, so that it is rejected with numbers instead of returning wrong results.
//!
//! * Central differences need ω_max h < 2; frictionless closed contact never lowers that limit.
//! * Modal-exact is stable for any step, but its contact results may still be wrong: see [`unresolved`].
//! * The contact problem of a step has one solution for every gap exactly when the Delassus matrix
//!   W = C_Nᵀ A⁻¹ C_NT is a P-matrix; a positive definite symmetric part is sufficient.
//! * With contacts closed and sliding, the equations themselves may flutter. The scheme must not add growth:
//!   the spectral radius of the constrained step map is compared with the growth of the constrained
//!   differential equation.

pub mod cutting;
pub mod finding;
mod growing;
mod held;
pub mod judged;
pub mod lock_up;
pub mod massless;
pub mod plausibility;
mod secular;
pub mod unresolved;
pub(crate) mod wording;

pub use growing::{Fastest, GrowthRates, continuous, growth, stepped, without_node_mass};
pub(crate) use growing::{GROWTH_NOISE, GROWTH_UP_TO, growth_steps};

use nalgebra::DMatrix;

use crate::math::vector::{Vector3, vector3_at};
use crate::modes::modal::ModalModel;
use crate::scene::method::Scheme;
use finding::{ErrorKind, WarningKind};

/// Margin below the stability limit of a scheme.
const STABILITY_MARGIN: f64 = 1e-9;
/// Largest number of contact nodes for which all principal minors are computed.
const MINORS_UP_TO: usize = 12;
/// Minors and eigenvalues of a matrix with unit diagonal below this are zero up to rounding.
const SINGULAR: f64 = 1e-10;

/// Directions of the closed contacts of one group: (normal, slip direction) per node.
pub type ContactDirections = Vec<(Vector3, Vector3)>;

/// Contacts of a structure that are all closed and slide.
#[derive(Debug, Clone, Copy)]
pub struct SlidingContacts<'a> {
    model: &'a ModalModel,
    friction: f64,
    directions: &'a ContactDirections,
}

impl<'a> SlidingContacts<'a> {
    /// Creates the contacts of `directions` with a friction coefficient.
    pub fn new(model: &'a ModalModel, friction: f64, directions: &'a ContactDirections) -> Self {
        Self { model, friction, directions }
    }
}

/// Largest step (s) that central differences allow: 2/ω_max; infinite without a vibrating mode.
pub fn central_difference_limit(model: &ModalModel) -> f64 {
    2.0 / model.largest_frequency()
}

/// Returns W for one group with all nodes closed: rows normals, columns n − µ t.
pub fn delassus(contacts: SlidingContacts, scheme: Scheme, step: f64) -> DMatrix<f64> {
    let (normals, forces) = directional_modes(contacts.model, contacts.friction, contacts.directions);
    let compliance: Vec<f64> = contacts.model.coefficients(scheme, step).iter().map(|mode| mode.compliance).collect();
    let scaled = DMatrix::from_fn(forces.nrows(), forces.ncols(), |row, mode| forces[(row, mode)] * compliance[mode]);
    normals * scaled.transpose()
}

/// Returns the modes along the normals (n·Φ) and along the forces ((n − µt)·Φ), nodes × modes.
fn directional_modes(
    model: &ModalModel,
    friction: f64,
    directions: &ContactDirections,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let project = |along: &dyn Fn(usize) -> Vector3| {
        DMatrix::from_fn(directions.len(), model.len(), |node, mode| {
            along(node).dot(&vector3_at(model.contact_modes.column(mode).as_slice(), node))
        })
    };
    let normals = project(&|node| directions[node].0);
    let forces = project(&|node| {
        let (normal, slip) = directions[node];
        normal - friction * slip
    });
    (normals, forces)
}

/// Rejects a step (s) with which free vibration of the largest angular `frequency` (rad/s) is unstable.
///
/// # Errors
/// [`ErrorKind::UnstableStep`] at or beyond the stability limit of the scheme.
pub fn check_step_allowed(frequency: f64, scheme: Scheme, step: f64) -> Result<(), ErrorKind> {
    if frequency * step >= scheme.properties().stable_below * (1.0 - STABILITY_MARGIN) {
        return Err(ErrorKind::UnstableStep { scheme, frequency, step });
    }
    Ok(())
}

/// Returns the warning of modes up to the largest angular `frequency` (rad/s) that a step (s) does not resolve.
pub(crate) fn unresolved_modes(frequency: f64, scheme: Scheme, step: f64) -> Option<WarningKind> {
    (frequency * step > scheme.properties().resolved_up_to).then_some(WarningKind::UnresolvedModes {
        scheme,
        frequency,
        step,
    })
}

/// Calls [`check_step_allowed`] and `unresolved_modes`.
///
/// # Errors
/// As [`check_step_allowed`].
pub fn check_step(frequency: f64, scheme: Scheme, step: f64) -> Result<Option<WarningKind>, ErrorKind> {
    check_step_allowed(frequency, scheme, step)?;
    Ok(unresolved_modes(frequency, scheme, step))
}

/// Steps from the largest down at which solvability is checked: a communication step may be shorter than the internal step, and W keeps its
/// shape only for ω_max h ≪ 1.
fn steps_to_check(frequency: f64, largest: f64) -> impl Iterator<Item = f64> {
    let resolved = 0.1 / frequency;
    std::iter::successors(Some(largest), |step| Some(0.5 * step)).take(24).scan(true, move |unresolved, step| {
        let take = *unresolved;
        *unresolved = step > resolved;
        take.then_some(step)
    })
}

/// Rejects a contact problem without a unique solution at `step` or at any smaller step, in any of the `senses` of slip.
///
/// # Errors
/// [`ErrorKind::Unsolvable`] with µ and h.
pub fn check_solvable(
    model: &ModalModel,
    scheme: Scheme,
    step: f64,
    friction: f64,
    senses: &[ContactDirections],
) -> Result<(), ErrorKind> {
    let solvable = |friction: f64| {
        steps_to_check(model.largest_frequency(), step).all(|step| {
            let at =
                |directions| is_solvable(&delassus(SlidingContacts::new(model, friction, directions), scheme, step));
            senses.iter().all(at)
        })
    };
    let by_minors = senses.iter().all(|directions| directions.len() <= MINORS_UP_TO);
    refuse_unsolvable(solvable, by_minors, step, friction)
}

/// Rejects such a contact problem of coupled sectors: `diameters` are all nodal diameters as real structures (see
/// [`CyclicModel::paired`](crate::modes::cyclic::CyclicModel::paired)), with the `senses` of slip of each.
///
/// On a round casing W of all nodes of all sectors is block-circulant, and its Fourier blocks are the Delassus matrices of the nodal
/// diameters: if their symmetric parts are positive definite so is that of W, and hence that of every subset of the contacts.
///
/// # Errors
/// [`ErrorKind::Unsolvable`] with µ and h.
pub fn check_solvable_together(
    diameters: &[ModalModel],
    scheme: Scheme,
    step: f64,
    friction: f64,
    senses: &[Vec<ContactDirections>],
) -> Result<(), ErrorKind> {
    let frequency = diameters.iter().fold(0.0, |most: f64, model| most.max(model.largest_frequency()));
    let solvable = |friction: f64| {
        steps_to_check(frequency, step).all(|step| {
            diameters.iter().zip(senses).all(|(model, senses)| {
                let lowest = |directions| {
                    lowest_eigenvalue(&delassus(SlidingContacts::new(model, friction, directions), scheme, step))
                };
                senses.iter().all(|directions| lowest(directions).is_some_and(|lowest| lowest > -SINGULAR))
            })
        })
    };
    refuse_unsolvable(solvable, false, step, friction)
}

/// Returns the error with the smallest friction coefficient at which solvability is lost; `is_proven` if it is certainly lost there.
fn refuse_unsolvable(
    solvable: impl Fn(f64) -> bool,
    is_proven: bool,
    step: f64,
    friction: f64,
) -> Result<(), ErrorKind> {
    if friction == 0.0 || solvable(friction) {
        return Ok(());
    }
    // Solvability is not monotonic in µ: the remedy is the first µ from 0 on at which it is lost.
    let part = |index: u32| friction * f64::from(index) / 64.0;
    let first = (1..=64).find(|index| !solvable(part(*index))).unwrap_or(64);
    let (mut low, mut high) = (part(first - 1), part(first));
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        *(if solvable(middle) { &mut low } else { &mut high }) = middle;
    }
    Err(ErrorKind::Unsolvable { friction, step, solvable_below: low, is_proven })
}

/// P-matrix test: a positive definite symmetric part suffices; otherwise all principal minors decide if there are few contacts. Redundant
/// contacts (zero minors up to rounding) are accepted.
fn is_solvable(delassus: &DMatrix<f64>) -> bool {
    let Some(scaled) = scaled(delassus) else { return false };
    let lowest = lowest_of_symmetric_part(&scaled);
    if delassus.nrows() > MINORS_UP_TO { lowest > -SINGULAR } else { lowest > SINGULAR || has_minors(&scaled) }
}

/// Returns whether all principal minors are positive, except those of redundant contacts; computes 2ⁿ determinants.
fn has_minors(scaled: &DMatrix<f64>) -> bool {
    let nodes = scaled.nrows();
    (1..1_usize << nodes).all(|set| {
        let members: Vec<usize> = (0..nodes).filter(|node| set >> node & 1 == 1).collect();
        let minor = DMatrix::from_fn(members.len(), members.len(), |i, j| scaled[(members[i], members[j])]);
        minor.determinant() > -SINGULAR
    })
}

/// Returns the lowest eigenvalue of the symmetric part of W with unit diagonal; `None` if a diagonal entry is not positive.
pub(crate) fn lowest_eigenvalue(delassus: &DMatrix<f64>) -> Option<f64> {
    Some(lowest_of_symmetric_part(&scaled(delassus)?))
}

/// W with unit diagonal; `None` if a diagonal entry is not positive, or another one not finite.
fn scaled(delassus: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let diagonal = delassus.diagonal();
    let entry = |i: usize, j: usize| delassus[(i, j)] / (diagonal[i] * diagonal[j]).sqrt();
    let positive = diagonal.iter().all(|value| *value > 0.0);
    let scaled = positive.then(|| DMatrix::from_fn(delassus.nrows(), delassus.ncols(), entry))?;
    scaled.iter().all(|value| value.is_finite()).then_some(scaled)
}

fn lowest_of_symmetric_part(scaled: &DMatrix<f64>) -> f64 {
    ((scaled + scaled.transpose()) * 0.5).symmetric_eigenvalues().min()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tiprub_test_models::SeededRandom;

    /// Two modes whose contact node moves along both radial and tangential directions.
    pub fn model(frequencies: &[f64], shapes: &[[f64; 3]], damping: f64) -> ModalModel {
        let modes = frequencies.len();
        ModalModel {
            frequencies: frequencies.to_vec(),
            damping_ratios: vec![damping; modes],
            contact_modes: DMatrix::from_fn(3, modes, |row, mode| shapes[mode][row]),
            shapes: DMatrix::identity(modes, modes),
            quasi_static: 0,
        }
    }

    pub fn radial() -> ContactDirections {
        vec![(-Vector3::x(), Vector3::y())]
    }

    #[test]
    fn central_difference_limit_is_two_over_omega() {
        let model = model(&[100.0, 4000.0], &[[1.0, 0.0, 0.0], [0.5, 0.0, 0.0]], 0.01);
        for (factor, stable) in [(0.9, true), (0.999, true), (1.001, false), (10.0, false)] {
            let step = factor * central_difference_limit(&model);
            assert_eq!(
                check_step(model.largest_frequency(), Scheme::CentralDifference, step).is_ok(),
                stable,
                "factor {factor}"
            );
            assert!(check_step(model.largest_frequency(), Scheme::ModalExact, step).is_ok());
        }
        assert!(check_step(model.largest_frequency(), Scheme::ModalExact, 1e-3).unwrap().is_some());
    }

    #[test]
    fn rejects_excessive_friction_at_the_exact_bound() {
        // n·G(n − µt) = Grr + µ Grt > 0 fails at µ = −Grr/Grt.
        let model = model(&[1000.0], &[[0.5, -1.0, 0.0]], 0.0);
        let step = 1e-6;
        assert!(check_solvable(&model, Scheme::ModalExact, step, 0.49, &[radial()]).is_ok());
        let refusal = check_solvable(&model, Scheme::ModalExact, step, 0.6, &[radial()]).unwrap_err();
        assert!(refusal.to_string().contains("µ below 0.5000"), "{refusal}");
    }

    /// Pressing node 1 pushes the tip of node 2 along its slip: W = c(I + µτ e₂e₁ᵀ), whose symmetric part is definite for µτ < 2. Few
    /// contacts are solvable beyond this, since the minors of a triangular matrix are those of its diagonal; for many contacts this is not
    /// proven, nor for the nodal diameters of a disk.
    #[test]
    fn many_contacts_require_a_definite_symmetric_part() {
        let (turned, step) = (2.5, 1e-5);
        let pressed = |nodes: usize| ModalModel {
            frequencies: vec![1000.0; nodes],
            damping_ratios: vec![0.0; nodes],
            contact_modes: DMatrix::from_fn(3 * nodes, nodes, |row, mode| match (row / 3, row % 3) {
                (node, 0) if node == mode => -1.0,
                (0, 1) if mode == 1 => turned,
                _ => 0.0,
            }),
            shapes: DMatrix::identity(nodes, nodes),
            quasi_static: 0,
        };
        let closed = |nodes: usize| vec![vec![(-Vector3::x(), Vector3::y()); nodes]];
        let alone = |nodes: usize, friction: f64| {
            check_solvable(&pressed(nodes), Scheme::ModalExact, step, friction, &closed(nodes))
        };
        let disk = |nodes: usize, friction: f64| {
            check_solvable_together(&[pressed(nodes)], Scheme::ModalExact, step, friction, &[closed(nodes)])
        };
        let bound = 2.0 / turned;
        for outcome in
            [alone(MINORS_UP_TO + 1, 1.01 * bound), disk(2, 1.01 * bound), disk(MINORS_UP_TO + 1, 1.01 * bound)]
        {
            let refusal = outcome.unwrap_err().to_string();
            assert!(refusal.contains("µ below 0.8000") && refusal.contains("positive definite"), "{refusal}");
        }
        assert!(alone(MINORS_UP_TO, 10.0 * bound).is_ok());
        for friction in [0.0, 0.99 * bound] {
            assert!(alone(MINORS_UP_TO + 1, friction).is_ok() && disk(2, friction).is_ok());
        }
        // Redundant contacts, such as two nodes that move together, are acceptable: W is singular.
        let mut twice = pressed(MINORS_UP_TO + 1);
        twice.contact_modes.fill_row(0, -1.0);
        twice.contact_modes.fill_row(3, -1.0);
        assert!(check_solvable(&twice, Scheme::ModalExact, step, 0.0, &closed(MINORS_UP_TO + 1)).is_ok());
    }

    /// Two nodes on one mode, of which one is inclined: the symmetric part of W, 1 − (µτ)²/8 at most, is definite only without friction.
    #[test]
    fn reports_when_no_friction_coefficient_is_safe() {
        let model = ModalModel {
            contact_modes: DMatrix::from_column_slice(6, 1, &[-1.0, 0.0, 0.0, -1.0, 1.0, 0.0]),
            ..model(&[1000.0], &[[0.0; 3]], 0.0)
        };
        let senses = [vec![vec![radial()[0]; 2]]];
        let reported =
            check_solvable_together(&[model], Scheme::ModalExact, 1e-5, 0.3, &senses).unwrap_err().to_string();
        assert!(reported.contains("no friction coefficient is safe"), "{reported}");
    }

    /// A definite symmetric part makes the minors unnecessary: they accept every such matrix, and they alone decide on the others.
    #[test]
    fn positive_definite_matrices_have_positive_minors() {
        let mut random = SeededRandom(5);
        let (mut definite, mut solvable, mut refused) = (0, 0, 0);
        for _ in 0..600 {
            let nodes = 1 + random.below(5);
            let size = random.scale(0.1, 2.0);
            let matrix = DMatrix::identity(nodes, nodes) + random.matrix(nodes, nodes) * size;
            let Some(scaled) = scaled(&matrix) else { continue };
            let minors = has_minors(&scaled);
            assert_eq!(is_solvable(&matrix), minors, "{matrix}");
            *(match (lowest_of_symmetric_part(&scaled) > -SINGULAR, minors) {
                (true, _) => &mut definite,
                (false, true) => &mut solvable,
                (false, false) => &mut refused,
            }) += 1;
        }
        assert!(definite > 10 && solvable > 10 && refused > 10, "{definite}, {solvable}, {refused}");
    }

    #[test]
    fn solvability_is_checked_for_shorter_steps() {
        // At h = 1e-3 the stiff mode is static and Grt ≈ 0; at small h it moves freely and turns the tip inwards.
        let model = model(&[100.0, 1e5], &[[1.0, 0.0, 0.0], [0.9, -2.0, 0.0]], 0.0);
        let solvable =
            |step| is_solvable(&delassus(SlidingContacts::new(&model, 1.1, &radial()), Scheme::ModalExact, step));
        assert!(solvable(1e-3) && !solvable(1e-6));
        let refusal = check_solvable(&model, Scheme::ModalExact, 1e-3, 1.1, &[radial()]).unwrap_err().to_string();
        // Free masses: 1 + 0.9² − µ·0.9·2 > 0.
        assert!(refusal.contains("µ below 1.00"), "{refusal}");
        assert_eq!(steps_to_check(model.largest_frequency(), 1e-7).count(), 1);
    }
}
