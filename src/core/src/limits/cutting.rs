//! Growth of vibration while tips cut: the force of a cut increases with its depth like a spring force, but it also has a tangential part,
//! which no spring has. Waves that an earlier blade left and a later one cuts (regenerative chatter) are not checked.

use nalgebra::DMatrix;

use super::growing::{Fastest, GROWTH_UP_TO, fastest};
use super::held::general_eigenvalues;
use super::{ContactDirections, directional_modes};
use crate::modes::modal::ModalModel;

/// Returns the motion that grows fastest with the contacts of `directions` cutting fresh coating: normal forces Sδ of the depths δ (S in
/// N/m), and `tangential` times as much against the sliding direction. `None` for models too large for dense eigenvalues.
pub fn growth(
    model: &ModalModel,
    directions: &ContactDirections,
    stiffness: &DMatrix<f64>,
    tangential: f64,
) -> Option<Fastest> {
    let size = model.len();
    if size > GROWTH_UP_TO {
        return None;
    }
    let (normals, forces) = directional_modes(model, tangential, directions);
    let cut = forces.transpose() * (stiffness * &normals);
    // In units of the fastest mode, including the stiffness of the cut.
    let unit = 1.0 / (model.largest_frequency().powi(2) + cut.norm()).sqrt();
    let mut flow = DMatrix::zeros(2 * size, 2 * size);
    flow.view_mut((0, size), (size, size)).fill_with_identity();
    flow.view_mut((size, 0), (size, size)).copy_from(&(cut * (-unit * unit)));
    for (mode, (frequency, ratio)) in model.frequencies.iter().zip(&model.damping_ratios).enumerate() {
        let angle = unit * frequency;
        flow[(size + mode, mode)] -= angle * angle;
        flow[(size + mode, size + mode)] = -2.0 * ratio * angle;
    }
    let Fastest { rate, frequency } = fastest(&general_eigenvalues(flow)?);
    Some(Fastest { rate: rate / unit, frequency: frequency / unit })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::tests::{model, radial};

    /// One mode along (−1, c): (ω² + k(1 − τc)) q = 0 has real roots once τc > 1 + ω²/k, and the growth √(k(τc − 1) − ω²).
    #[test]
    fn cutting_tip_diverges_when_drawn_in() {
        let (omega, spring) = (1000.0, 3e6);
        let found = |along: f64| {
            let shapes = [[-1.0, along, 0.0]];
            growth(&model(&[omega], &shapes, 0.0), &radial(), &DMatrix::from_element(1, 1, spring), 1.0).unwrap()
        };
        let square = |along: f64| spring * (along.abs() - 1.0) - omega * omega;
        let drawn = [found(2.0), found(-2.0)].into_iter().max_by(|a, b| a.rate.total_cmp(&b.rate)).unwrap();
        assert!(
            (drawn.rate / square(2.0).sqrt() - 1.0).abs() < 1e-9 && drawn.frequency < 1e-6 * drawn.rate,
            "{drawn:?}"
        );
        for along in [1.2, -1.2] {
            assert!(found(along).rate < 1e-6 * omega, "{:?}", found(along));
        }
    }

    /// A radial and a tangential mode of one frequency do not couple back, so nothing grows. Coupled by an oblique third mode they flutter.
    #[test]
    fn coupled_modes_of_similar_frequency_flutter_when_cutting() {
        let spring = DMatrix::from_element(1, 1, 1e6);
        let stable =
            growth(&model(&[900.0, 1100.0], &[[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 0.0), &radial(), &spring, 1.0);
        assert!(stable.unwrap().rate < 1e-3);
        // [ω₁² + k a₁b₁, k a₁b₂; k a₂b₁, ω₂² + k a₂b₂] with depths b and forces a: complex for a₁b₂a₂b₁ < 0 and near frequencies.
        let shapes = [[-1.0, 0.3, 0.0], [-0.8, 1.9, 0.0]];
        let squares = [1000.0_f64.powi(2), 1050.0_f64.powi(2)];
        let rate = |sense: f64| {
            let force = shapes.map(|[r, t, _]| -r - sense * t);
            let depth = shapes.map(|[r, _, _]| -r);
            let entry = |i: usize, j: usize| 1e6 * force[i] * depth[j] + if i == j { squares[i] } else { 0.0 };
            let (half, product) = (0.5 * (entry(0, 0) + entry(1, 1)), entry(0, 1) * entry(1, 0));
            let under = (0.5 * (entry(0, 0) - entry(1, 1))).powi(2) + product;
            // s² = −half ± i √−under.
            if under < 0.0 { ((half.hypot((-under).sqrt()) - half) / 2.0).sqrt() } else { 0.0 }
        };
        let expected = rate(1.0).max(rate(-1.0));
        let along = growth(&model(&[1000.0, 1050.0], &shapes, 0.0), &radial(), &spring, 1.0).unwrap().rate;
        let turned: Vec<_> = radial().iter().map(|(normal, slip)| (*normal, slip.map(|value| -value))).collect();
        let against = growth(&model(&[1000.0, 1050.0], &shapes, 0.0), &turned, &spring, 1.0).unwrap().rate;
        assert!(expected > 1.0 && (along.max(against) / expected - 1.0).abs() < 1e-6, "{along} {against} {expected}");
    }
}
