//! Lock-up of a tip: beyond a friction coefficient no force can hold closed sliding contact, and the contact diverges at 0 Hz.

use nalgebra::{DMatrix, Schur};

use super::{ContactDirections, directional_modes};
use crate::modes::modal::ModalModel;

/// Smallest friction coefficient µ* at which det(W_nn − µ W_nt) = 0 with all contacts of `directions` closed, where W is the static
/// flexibility along normals and slip: w_nn/w_nt for one contact. Infinite if there is none; `None` for models with rigid-body modes, and
/// if the contacts are redundant.
pub fn least_friction(model: &ModalModel, directions: &ContactDirections) -> Option<f64> {
    if model.frequencies.contains(&0.0) {
        return None;
    }
    let (normals, without) = directional_modes(model, 0.0, directions);
    let (_, with) = directional_modes(model, 1.0, directions);
    let bent = |forces: &DMatrix<f64>| {
        let scaled = |mode: usize| model.frequencies[mode] * model.frequencies[mode];
        &normals * DMatrix::from_fn(model.len(), directions.len(), |mode, node| forces[(node, mode)] / scaled(mode))
    };
    let along = bent(&without);
    // Forces n − µt: the contribution of friction to the normals at µ = 1.
    let across = &along - bent(&with);
    let ratios = along.lu().solve(&across)?;
    let eigenvalues = Schur::try_new(ratios, f64::EPSILON, 100 * directions.len())?.complex_eigenvalues();
    let real = eigenvalues.iter().filter(|value| value.im.abs() <= 1e-9 * value.re.abs() && value.re > 0.0);
    Some(real.fold(f64::INFINITY, |least, value| least.min(1.0 / value.re)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits;
    use crate::limits::tests::{model, radial};
    use crate::math::vector::Vector3;
    use crate::scene::method::Scheme;

    #[test]
    fn contact_locks_up_above_the_flexibility_ratio() {
        // w_rr = 1/100² + 0.81/1e10 and w_rt = 0.9·2/1e10 − 0.5/100²; for free masses the ratio has the other sign.
        let shapes = [[1.0, -0.5, 0.0], [0.9, 2.0, 0.0]];
        let model = model(&[100.0, 1e5], &shapes, 0.02);
        let along = 1e-4 + 0.81e-10;
        let across = 0.5e-4 - 0.9 * 2.0 * 1e-10;
        let own = |directions: &ContactDirections| least_friction(&model, directions).unwrap();
        let other = vec![(-Vector3::x(), -Vector3::y())];
        let (locking, never) = if own(&other).is_finite() { (other, radial()) } else { (radial(), other) };
        let least = own(&locking);
        assert!((least / (along / across) - 1.0).abs() < 1e-12 && own(&never).is_infinite(), "{least}");
        // Below it no motion grows without oscillation, above it one does.
        let diverges = |friction: f64| {
            let growth =
                limits::growth(limits::SlidingContacts::new(&model, friction, &locking), Scheme::ModalExact, 1e-6)
                    .unwrap();
            growth.is_flutter() && growth.frequency == 0.0
        };
        assert!(!diverges(0.99 * least) && diverges(1.01 * least));
        let mut rigid = model;
        rigid.frequencies[0] = 0.0;
        assert_eq!(least_friction(&rigid, &radial()), None);
    }
}
