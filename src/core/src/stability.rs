//! Limits checked before a scene is stepped: refuse with numbers rather than return nonsense.
//!
//! * Central differences need ω_max h < 2; frictionless closed contact never lowers that limit.
//! * The contact problem of a step has one solution for every gap exactly when the Delassus matrix
//!   W = C_Nᵀ A⁻¹ C_NT is a P-matrix; a positive definite symmetric part is sufficient.
//! * With contacts closed and sliding, the equations themselves may flutter. What must not happen is that the
//!   scheme adds growth: the spectral radius of the constrained step map is compared with the growth of the
//!   constrained differential equation.

use nalgebra::DMatrix;

use crate::contact::gap::dot;
use crate::dynamics::modal::ModalModel;
use crate::dynamics::scheme::ModeCoefficients;
use crate::settings::Scheme;
use crate::{Error, Result};

/// Margin under the limit ω_max h = 2 of central differences.
const CENTRAL_MARGIN: f64 = 1e-9;
/// The scheme may exceed the growth rate of the continuous equations by this factor.
const GROWTH_FACTOR: f64 = 1.05;
/// Growth per step below this is rounding of the eigenvalue solver.
const GROWTH_NOISE: f64 = 1e-7;
/// Largest number of contact nodes for which all principal minors are computed.
const MINORS_UP_TO: usize = 12;
/// Largest number of modes for which growth rates are computed.
const GROWTH_UP_TO: usize = 150;

/// Directions of the closed contacts of one group: (normal, slip direction) per node.
pub type ContactDirections = Vec<([f64; 3], [f64; 3])>;

/// Largest step (s) that central differences allow: 2/ω_max; infinite without a vibrating mode.
pub fn central_difference_limit(model: &ModalModel) -> f64 {
    2.0 / model.largest_frequency()
}

/// W for one group, all nodes closed: rows normals, columns n − µ t.
pub fn delassus(
    model: &ModalModel,
    scheme: Scheme,
    step: f64,
    friction: f64,
    directions: &ContactDirections,
) -> DMatrix<f64> {
    let (normals, forces) = directional_modes(model, friction, directions);
    let compliance = model.frequencies.iter().zip(&model.damping_ratios);
    let compliance: Vec<f64> = compliance
        .map(|(frequency, ratio)| ModeCoefficients::new(scheme, *frequency, *ratio, step).compliance)
        .collect();
    let scaled = DMatrix::from_fn(forces.nrows(), forces.ncols(), |row, mode| forces[(row, mode)] * compliance[mode]);
    normals * scaled.transpose()
}

/// Modes seen along the normals (n·Φ) and along the forces ((n − µt)·Φ), nodes × modes.
fn directional_modes(
    model: &ModalModel,
    friction: f64,
    directions: &ContactDirections,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let project = |along: &dyn Fn(usize) -> [f64; 3]| {
        DMatrix::from_fn(directions.len(), model.len(), |node, mode| {
            let shape = std::array::from_fn(|i| model.contact_modes[(3 * node + i, mode)]);
            dot(along(node), shape)
        })
    };
    let normals = project(&|node| directions[node].0);
    let forces = project(&|node| {
        let (normal, slip) = directions[node];
        std::array::from_fn(|i| normal[i] - friction * slip[i])
    });
    (normals, forces)
}

/// Refuse step sizes beyond the linear limit; returns a warning for unresolved modes.
///
/// # Errors
/// [`Error::Unstable`] for central differences at or beyond ω_max h = 2.
pub fn check_step(model: &ModalModel, scheme: Scheme, step: f64) -> Result<Option<String>> {
    let product = model.largest_frequency() * step;
    match scheme {
        Scheme::CentralDifference if product >= 2.0 * (1.0 - CENTRAL_MARGIN) => Err(Error::Unstable {
            problem: format!(
                "central-difference with internal step {step:.6e} s has ω_max·h = {product:.4} ≥ 2 (ω_max = {:.6e} rad/s)",
                model.largest_frequency()
            ),
            remedy: format!(
                "Set the internal step below {:.6e} s, or use the scheme modal-exact",
                central_difference_limit(model)
            ),
        }),
        Scheme::ModalExact if product > 2.0 => Ok(Some(format!(
            "ω_max·h = {product:.2} > 2: modes above {:.4e} rad/s are not resolved by the internal step {step:.3e} s; \
             free motion stays exact, contact forces on them do not",
            2.0 / step
        ))),
        _ => Ok(None),
    }
}

/// Steps from the largest down at which solvability is looked at: a communication step may be shorter than the
/// internal step, and W keeps its shape only once ω_max h ≪ 1.
fn steps_to_check(model: &ModalModel, largest: f64) -> impl Iterator<Item = f64> {
    let resolved = 0.1 / model.largest_frequency();
    std::iter::successors(Some(largest), |step| Some(0.5 * step)).take(60).scan(true, move |unresolved, step| {
        let take = *unresolved;
        *unresolved = step > resolved;
        take.then_some(step)
    })
}

/// Refuse a contact problem without a unique solution at `step` or at any smaller step, in any of the `senses` of slip.
///
/// # Errors
/// [`Error::Unstable`] naming µ and h.
pub fn check_solvable(
    model: &ModalModel,
    scheme: Scheme,
    step: f64,
    friction: f64,
    senses: &[ContactDirections],
) -> Result<()> {
    let solvable = |friction: f64| {
        steps_to_check(model, step).all(|step| {
            let at = |directions| is_solvable(&delassus(model, scheme, step, friction, directions));
            senses.iter().all(at)
        })
    };
    if friction == 0.0 || solvable(friction) {
        return Ok(());
    }
    // Solvability is not monotonic in µ: the first µ from 0 on at which it is lost is what helps.
    let part = |index: u32| friction * f64::from(index) / 64.0;
    let first = (1..=64).find(|index| !solvable(part(*index))).unwrap_or(64);
    let (mut low, mut high) = (part(first - 1), part(first));
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        *(if solvable(middle) { &mut low } else { &mut high }) = middle;
    }
    let (what, why) = if senses.iter().any(|directions| directions.len() > MINORS_UP_TO) {
        (
            "cannot be shown to have a unique solution",
            "the symmetric part of the Delassus matrix is not positive definite",
        )
    } else {
        ("has no unique solution", "a principal minor of the Delassus matrix is not positive")
    };
    Err(Error::Unstable {
        problem: format!(
            "with friction_coefficient µ = {friction} and internal steps up to h = {step:.3e} s the contact problem {what} ({why})"
        ),
        remedy: if low > 1e-9 * friction {
            format!("Use µ below {low:.4} for this structure, or another internal step")
        } else {
            "Use no friction, or fewer contact nodes or more modes: with more contacts than modes no friction is safe"
                .to_owned()
        },
    })
}

/// P-matrix test: all principal minors for small problems, positive definite symmetric part for large ones.
/// Redundant contacts (zero minors up to rounding) are accepted.
fn is_solvable(delassus: &DMatrix<f64>) -> bool {
    let nodes = delassus.nrows();
    let diagonal: Vec<f64> = (0..nodes).map(|node| delassus[(node, node)]).collect();
    if diagonal.iter().any(|value| *value <= 0.0) {
        return false;
    }
    let scaled = DMatrix::from_fn(nodes, nodes, |i, j| delassus[(i, j)] / (diagonal[i] * diagonal[j]).sqrt());
    if nodes > MINORS_UP_TO {
        let symmetric = (&scaled + scaled.transpose()) * 0.5;
        return symmetric.symmetric_eigenvalues().min() > -1e-10;
    }
    (1..1_usize << nodes).all(|set| {
        let members: Vec<usize> = (0..nodes).filter(|node| set >> node & 1 == 1).collect();
        let minor = DMatrix::from_fn(members.len(), members.len(), |i, j| scaled[(members[i], members[j])]);
        minor.determinant() > -1e-10
    })
}

/// Growth rates (1/s) with all contacts of `directions` closed and sliding: (continuous, stepped).
pub fn growth_rates(
    model: &ModalModel,
    scheme: Scheme,
    step: f64,
    friction: f64,
    directions: &ContactDirections,
) -> Option<(f64, f64)> {
    let modes = model.len();
    let (normals, forces) = directional_modes(model, friction, directions);
    let continuous = {
        let coupling = (&normals * forces.transpose()).try_inverse()?;
        let projector = DMatrix::identity(modes, modes) - forces.transpose() * coupling * &normals;
        let stiffness = DMatrix::from_fn(modes, modes, |i, j| -projector[(i, j)] * model.frequencies[j].powi(2));
        let damping = DMatrix::from_fn(modes, modes, |i, j| {
            -2.0 * projector[(i, j)] * model.damping_ratios[j] * model.frequencies[j]
        });
        // Time scaled by the step keeps the matrix balanced.
        let mut map = DMatrix::zeros(2 * modes, 2 * modes);
        map.view_mut((0, modes), (modes, modes)).fill_with_identity();
        map.view_mut((modes, 0), (modes, modes)).copy_from(&(stiffness * (step * step)));
        map.view_mut((modes, modes), (modes, modes)).copy_from(&(damping * step));
        map.complex_eigenvalues().iter().fold(f64::MIN, |largest, value| largest.max(value.re)) / step
    };
    let coefficients: Vec<ModeCoefficients> = model
        .frequencies
        .iter()
        .zip(&model.damping_ratios)
        .map(|(frequency, ratio)| ModeCoefficients::new(scheme, *frequency, *ratio, step))
        .collect();
    let inverse = delassus(model, scheme, step, friction, directions).try_inverse()?;
    let response =
        DMatrix::from_fn(modes, directions.len(), |mode, node| coefficients[mode].compliance * forces[(node, mode)]);
    let correction = response * inverse * &normals;
    let mut map = DMatrix::zeros(2 * modes, 2 * modes);
    for i in 0..modes {
        for j in 0..modes {
            let (kept, k) = (correction[(i, j)], &coefficients[j]);
            let unit = if i == j { 1.0 } else { 0.0 };
            // d⁺ = (β d − κ q) − correction·(q + β d − κ q), q⁺ = q + d⁺.
            map[(modes + i, j)] = -k.kappa * unit - kept * (1.0 - k.kappa);
            map[(modes + i, modes + j)] = k.beta * unit - kept * k.beta;
            map[(i, j)] = unit + map[(modes + i, j)];
            map[(i, modes + j)] = map[(modes + i, modes + j)];
        }
    }
    let radius =
        map.complex_eigenvalues().iter().fold(0.0, |largest: f64, value| largest.max(libm::hypot(value.re, value.im)));
    Some((continuous, libm::log(radius) / step))
}

/// Refuse where the scheme adds growth to closed sliding contact; returns a warning where the physics flutters.
///
/// # Errors
/// [`Error::Unstable`] with both growth rates.
pub fn check_growth(
    model: &ModalModel,
    scheme: Scheme,
    step: f64,
    friction: f64,
    directions: &ContactDirections,
) -> Result<Option<String>> {
    if friction == 0.0 || model.len() > GROWTH_UP_TO {
        return Ok(None);
    }
    let Some((continuous, stepped)) = growth_rates(model, scheme, step, friction, directions) else {
        return Ok(None);
    };
    let noise = GROWTH_NOISE / step;
    if stepped > GROWTH_FACTOR * continuous.max(0.0) + noise {
        return Err(Error::Unstable {
            problem: format!(
                "with µ = {friction}, closed sliding contact grows by {stepped:.3e} 1/s when stepped with h = {step:.3e} s, by \
                 {continuous:.3e} 1/s without time discretisation"
            ),
            remedy: "Use a smaller internal step, less friction or more damping".to_owned(),
        });
    }
    Ok((continuous > noise).then(|| {
        format!("with µ = {friction}, closed sliding contact is physically unstable (flutter), growth rate {continuous:.3e} 1/s")
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two modes whose contact node moves along both radial and tangential directions.
    fn model(frequencies: &[f64], shapes: &[[f64; 3]], damping: f64) -> ModalModel {
        let modes = frequencies.len();
        ModalModel {
            frequencies: frequencies.to_vec(),
            damping_ratios: vec![damping; modes],
            contact_modes: DMatrix::from_fn(3, modes, |row, mode| shapes[mode][row]),
            shapes: DMatrix::identity(modes, modes),
        }
    }

    fn radial() -> ContactDirections {
        vec![([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0])]
    }

    #[test]
    fn central_difference_limit_is_two_over_omega() {
        let model = model(&[100.0, 4000.0], &[[1.0, 0.0, 0.0], [0.5, 0.0, 0.0]], 0.01);
        for (factor, stable) in [(0.9, true), (0.999, true), (1.001, false), (10.0, false)] {
            let step = factor * central_difference_limit(&model);
            assert_eq!(check_step(&model, Scheme::CentralDifference, step).is_ok(), stable, "factor {factor}");
            assert!(check_step(&model, Scheme::ModalExact, step).is_ok());
        }
        assert!(check_step(&model, Scheme::ModalExact, 1e-3).unwrap().is_some());
    }

    #[test]
    fn too_much_friction_is_refused_and_the_bound_is_the_exact_one() {
        // n·G(n − µt) = Grr + µ Grt > 0 fails at µ = −Grr/Grt.
        let model = model(&[1000.0], &[[0.5, -1.0, 0.0]], 0.0);
        let step = 1e-6;
        assert!(check_solvable(&model, Scheme::ModalExact, step, 0.49, &[radial()]).is_ok());
        let refusal = check_solvable(&model, Scheme::ModalExact, step, 0.6, &[radial()]).unwrap_err();
        assert!(refusal.to_string().contains("µ below 0.5000"), "{refusal}");
    }

    #[test]
    fn steps_below_the_largest_are_looked_at() {
        // At h = 1e-3 the stiff mode is static and Grt ≈ 0; at small h it moves freely and turns the tip inwards.
        let model = model(&[100.0, 1e5], &[[1.0, 0.0, 0.0], [0.9, -2.0, 0.0]], 0.0);
        let solvable = |step| is_solvable(&delassus(&model, Scheme::ModalExact, step, 1.1, &radial()));
        assert!(solvable(1e-3) && !solvable(1e-6));
        let refusal = check_solvable(&model, Scheme::ModalExact, 1e-3, 1.1, &[radial()]).unwrap_err().to_string();
        // Free masses: 1 + 0.9² − µ·0.9·2 > 0.
        assert!(refusal.contains("µ below 1.00"), "{refusal}");
        assert_eq!(steps_to_check(&model, 1e-7).count(), 1);
    }

    #[test]
    fn frictionless_contact_adds_no_growth_and_damped_contact_decays() {
        let shapes = [[1.0, 0.2, 0.0], [0.3, -0.8, 0.1], [0.7, 0.4, 0.0]];
        for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
            let model = model(&[900.0, 2300.0, 8000.0], &shapes, 0.0);
            let (continuous, stepped) = growth_rates(&model, scheme, 1e-4, 0.0, &radial()).unwrap();
            assert!(continuous.abs() < 1e-3 && stepped < GROWTH_NOISE / 1e-4, "{continuous} {stepped}");
        }
    }

    #[test]
    fn growth_of_a_fluttering_contact_converges_to_the_continuous_rate() {
        // Two close modes coupled by friction through the contact; 178.516 1/s is the largest real part of the
        // eigenvalues of the constrained equations, computed independently with NumPy.
        let shapes = [[-0.1, -0.5, 0.0], [-0.3, 1.0, 0.0], [0.9, -0.8, 0.0]];
        let model = model(&[1000.0, 1050.0, 5000.0], &shapes, 0.0);
        let rate = |step| growth_rates(&model, Scheme::ModalExact, step, 0.4, &radial()).unwrap();
        let (continuous, coarse) = rate(2e-5);
        let fine = rate(1e-5).1;
        assert!((continuous - 178.5158).abs() < 1e-3, "{continuous}");
        let order = ((coarse - continuous) / (fine - continuous)).abs().log2();
        println!("growth rate {continuous} 1/s, stepped {coarse} and {fine}: order {order}");
        assert!(order > 3.7, "order {order}");
        let warning = check_growth(&model, Scheme::ModalExact, 1e-5, 0.4, &radial()).unwrap().unwrap();
        assert!(warning.contains("flutter") && warning.contains("1.785e2"), "{warning}");
    }
}
