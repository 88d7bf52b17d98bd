//! Steps of modal-exact that do not resolve the modes which contact excites.
//!
//! Modal-exact is stable for any step, and exact in free motion. A contact force, however, is constant over a step: it gives a mode
//! tan(ωh/2)/(ωh/2) times its impulse, and (sin(ωh/2)/(ωh/2))² of its correct displacement within a step. Beyond ωh = 2 neither factor is
//! near 1. The effect on a run depends on the importance of such modes: a stiff contact node may stay unresolved, the bending of a blade
//! may not. The measure is their fraction of the static flexibility of a contact, Σ φ²/ω².
//!
//! Without friction, blades of rotor 37 in hard rub against four lobes, and in a flexible casing that closes in on them, compared with
//! steps of ω_max h ≈ 0.6:
//!
//! | ω_max h | fraction of the flexibility | impulse | largest energy |
//! |---|---|---|---|
//! | 2.3 | 4 % | −0.1 % | −0.2 % |
//! | 4.6, 7.0 | 28 % | −0.2, −1.2 % | −0.7, −3.0 % |
//! | 9.3 | 65 % | −1.6 % | −4.5 % (casing: −6 % at 11.6) |
//! | 14 | 79 % | −2.6 % | −11 % |
//! | 23 | 82 % | −1.8 % | −25 % (casing: −21 %) |
//! | 46 | 90 % | −22 % | −59 % (casing: +100 %) |
//!
//! Steps are rejected if both ω_max h ≥ `HIGHEST` and the fraction exceeds [`SHARE`].

use super::finding::{ErrorKind, WarningKind};
use crate::math::{argsort, real};
use crate::modes::modal::ModalModel;
use crate::scene::method::Scheme;

/// Steps below this ω_max h are not rejected.
pub(crate) const HIGHEST: f64 = 10.0;
/// Steps are not rejected if modes beyond ωh = 2 have less than this fraction of the flexibility of contact, on average over the contact
/// nodes.
pub const SHARE: f64 = 0.5;
/// Fraction of the limit above which errors of some per cent are reported. For rotor 37 with nine patches and 80 modes, µ = 0.15, the error
/// of displacements is 5.8 % of the clearance at 0.68 of the limit, 4.0 % at 0.34, 0.5 % at 0.14 and 0.1 % at 0.07.
pub const NEAR: f64 = 0.2;
/// Modes beyond this ωh are not resolved.
const PASSED_OVER: f64 = 2.0;

/// Smallest step (s) that leaves too much unresolved of a structure whose contacts act along `directions` (per row of three of its contact
/// modes); infinite if no mode vibrates.
pub fn limit(model: &ModalModel, directions: &[[f64; 3]]) -> f64 {
    let seen = |mode: usize, node: usize| {
        let shape: f64 = (0..3).map(|i| directions[node][i] * model.contact_modes[(3 * node + i, mode)]).sum();
        let frequency = model.frequencies[mode];
        if frequency > 0.0 { (shape / frequency) * (shape / frequency) } else { 0.0 }
    };
    let vibrating = |mode: &usize| model.frequencies[*mode] > 0.0;
    let total = |node: usize| (0..model.len()).filter(vibrating).map(|mode| seen(mode, node)).sum::<f64>();
    let totals: Vec<(usize, f64)> =
        (0..directions.len()).map(|node| (node, total(node))).filter(|(_, total)| *total > 0.0).collect();
    let negated: Vec<f64> = model.frequencies.iter().map(|frequency| -frequency).collect();
    let modes: Vec<usize> = argsort(&negated).into_iter().filter(vibrating).collect();
    let enough = SHARE * real(totals.len());
    let mut passed = 0.0;
    for mode in &modes {
        passed += totals.iter().map(|(node, total)| seen(*mode, *node) / total).sum::<f64>();
        if passed > enough {
            return (PASSED_OVER / model.frequencies[*mode]).max(HIGHEST / model.largest_frequency());
        }
    }
    f64::INFINITY
}

/// Smallest such step (s) for contacts that may act along any axis of the rows: the tightest.
pub fn limit_along_axes(model: &ModalModel) -> f64 {
    let nodes = model.contact_modes.nrows() / 3;
    let along = |axis: usize| {
        let mut direction = [0.0; 3];
        direction[axis] = 1.0;
        limit(model, &vec![direction; nodes])
    };
    (0..3).map(along).fold(f64::INFINITY, f64::min)
}

/// Warning for a step (s) near the `limit` (s): errors grow with its square, to some four per cent at the limit.
pub fn warning(scheme: Scheme, step: f64, limit: f64) -> Option<WarningKind> {
    (step >= NEAR * limit).then_some(WarningKind::UnresolvedFlexibility { scheme, step, limit })
}

/// Rejects a step (s) at or beyond the `limit` (s) of a structure whose largest angular frequency (rad/s) is `frequency`.
///
/// # Errors
/// [`ErrorKind::UnresolvedContact`] with numbers.
pub fn check(scheme: Scheme, step: f64, limit: f64, frequency: f64) -> Result<(), ErrorKind> {
    if step < limit { Ok(()) } else { Err(ErrorKind::UnresolvedContact { scheme, step, limit, frequency }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    fn model(modes: &[(f64, f64)]) -> ModalModel {
        let count = modes.len();
        ModalModel {
            frequencies: modes.iter().map(|mode| mode.0).collect(),
            damping_ratios: vec![0.0; count],
            contact_modes: DMatrix::from_fn(3, count, |row, mode| if row == 0 { modes[mode].1 } else { 0.0 }),
            shapes: DMatrix::identity(count, count),
            quasi_static: 0,
        }
    }

    #[test]
    fn step_limit_ignores_modes_that_carry_little_contact() {
        let radial = [[-1.0, 0.0, 0.0]];
        // One oscillator: ωh = 10. A rigid-body mode adds no flexibility.
        let near =
            |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-12, "{found:e}, {expected:e}");
        near(limit(&model(&[(1e3, 2.0)]), &radial), 1e-2);
        near(limit(&model(&[(0.0, 1.0), (1e3, 2.0)]), &radial), 1e-2);
        assert!(limit(&model(&[(0.0, 1.0)]), &radial).is_infinite());
        // A stiff node on top may stay unresolved: its own mode has 1 % of the flexibility.
        near(limit(&model(&[(1e3, 1.0), (1e6, 100.0)]), &radial), 2e-3);
        // But not a node with most of the flexibility.
        near(limit(&model(&[(1e3, 1.0), (1e6, 2000.0)]), &radial), 1e-5);
        // No flexibility along other directions.
        assert!(limit(&model(&[(1e3, 1.0)]), &[[0.0, 1.0, 0.0]]).is_infinite());
        near(limit_along_axes(&model(&[(1e3, 1.0)])), 1e-2);
        // Any axis counts.
        for axis in 0..3 {
            let mut along = model(&[(1e3, 1.0)]);
            along.contact_modes.swap_rows(0, axis);
            near(limit_along_axes(&along), 1e-2);
        }
    }

    /// Errors are proportional to the square of the step: some four per cent at the limit; a tenth of that is not reported.
    #[test]
    fn warns_above_a_fifth_of_the_limit() {
        let near = |share: f64| warning(Scheme::default(), share * 1e-5, 1e-5).is_some();
        assert!(near(0.21) && near(0.9) && !near(0.19));
    }
}
