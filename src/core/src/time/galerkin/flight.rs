//! Free flight over any length of time, in closed form.

use crate::modes::coordinates::ContactModes;

/// Motion of a mode with angular frequency ω and damping ratio ξ < 1 over one length of time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Swing {
    /// Coefficients of q and q̇ in q and q̇ at the end.
    end: [[f64; 2]; 2],
    /// Coefficients of q², 2qq̇ and q̇² in the damping loss 2ξω∫q̇² dt (J).
    loss: [f64; 3],
}

impl Swing {
    /// q̇(t) = e^(−at) (v cos ω_d t + s sin ω_d t), s = −(ω²q + av)/ω_d, a = ξω.
    fn new(frequency: f64, ratio: f64, length: f64) -> Self {
        if frequency == 0.0 {
            return Self { end: [[1.0, length], [0.0, 1.0]], loss: [0.0; 3] };
        }
        let (a, d) = (ratio * frequency, frequency * (1.0 - ratio * ratio).sqrt());
        let (sine, cosine) = libm::sincos(d * length);
        let decay = libm::exp(-a * length);
        let square = frequency * frequency;
        let end = [
            [decay * (cosine + a / d * sine), decay * sine / d],
            [-decay * square / d * sine, decay * (cosine - a / d * sine)],
        ];
        if a == 0.0 {
            return Self { end, loss: [0.0; 3] };
        }
        // ∫e^(−2at) times 1, cos 2ω_d t and sin 2ω_d t.
        let (double, left) = (2.0 * sine * cosine, decay * decay);
        let (even, norm) = (left * (1.0 - 2.0 * sine * sine), 2.0 * square);
        let plain = -libm::expm1(-2.0 * a * length) / (2.0 * a);
        let (of_cosine, of_sine) =
            ((a * (1.0 - even) + d * left * double) / norm, (d * (1.0 - even) - a * left * double) / norm);
        let (of_v, of_s, of_both) = (a * (plain + of_cosine), a * (plain - of_cosine), a * of_sine);
        let (by_q, by_v) = (-square / d, -a / d);
        let loss =
            [of_s * by_q * by_q, of_s * by_q * by_v + of_both * by_q, of_v + of_s * by_v * by_v + 2.0 * of_both * by_v];
        Self { end, loss }
    }
}

/// Free flight of the modes of one kind of sector over one length of time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FreeFlight {
    length: f64,
    /// ω (rad/s) and ξ.
    modes: Vec<[f64; 2]>,
    swings: Vec<Swing>,
}

impl FreeFlight {
    /// Creates tables of these modes; call [`FreeFlight::set_length`] before the first flight.
    pub fn new(modes: &ContactModes) -> Self {
        let ratios = modes.frequencies.iter().zip(&modes.damping_ratios);
        let modes: Vec<[f64; 2]> = ratios.map(|(frequency, ratio)| [*frequency, *ratio]).collect();
        Self { length: 0.0, swings: vec![Swing::default(); modes.len()], modes }
    }

    /// Fills the tables for a length of time (s). Does not allocate.
    pub(crate) fn set_length(&mut self, length: f64) {
        if self.length.to_bits() != length.to_bits() {
            self.length = length;
            for (swing, [frequency, ratio]) in self.swings.iter_mut().zip(&self.modes) {
                *swing = Swing::new(*frequency, *ratio, length);
            }
        }
    }

    /// Advances q and q̇ over the flight and returns the damping loss (J).
    pub fn take(&self, position: &mut [f64], velocity: &mut [f64]) -> f64 {
        let mut loss = 0.0;
        for (Swing { end, loss: form }, (q, v)) in self.swings.iter().zip(position.iter_mut().zip(velocity)) {
            loss += form[0] * *q * *q + 2.0 * form[1] * *q * *v + form[2] * *v * *v;
            (*q, *v) = (end[0][0] * *q + end[0][1] * *v, end[1][0] * *q + end[1][1] * *v);
        }
        loss
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::galerkin::response::{GROUP, ModalResponse};

    /// Compares with the matrix exponential, and checks the energy at long times, where the exponential overflows.
    #[test]
    fn flight_propagation_matches_the_step_response() {
        for (frequency, ratio) in [(4e3, 0.0), (5e3, 0.005), (3e3, 0.3), (8e2, 0.99), (0.0, 0.0)] {
            let swing = Swing::new(frequency, ratio, 7e-4);
            let response = ModalResponse::compute([frequency; GROUP], [ratio; GROUP], 7e-4)[0];
            let scale: f64 = if frequency == 0.0 { 1.0 } else { frequency };
            for (of, (row, exact)) in swing.end.iter().zip([response.position, response.velocity]).enumerate() {
                for (term, (value, exact)) in row.iter().zip(&exact[..2]).enumerate() {
                    // q per q and q̇ per q̇ are dimensionless, q per q̇ is a time, and q̇ per q a frequency squared times a time.
                    let size = [[1.0, 1.0 / scale], [scale, 1.0]][of][term];
                    assert!((value - exact).abs() < 1e-12 * size, "{frequency} {ratio}: {value} {exact}");
                }
            }
            for (value, (i, k)) in swing.loss.iter().zip([(0, 0), (0, 1), (1, 1)]) {
                let exact = response.loss[i][k];
                assert!((value - exact).abs() < 1e-10 * (1.0 + scale * scale), "{frequency} {ratio}: {value} {exact}");
            }
            for length in [1e-3, 0.1, 100.0] {
                let swing = Swing::new(frequency, ratio, length);
                let ([mut q, mut v], mut flight) =
                    ([[2e-6], [3e-3]], FreeFlight { length, modes: Vec::new(), swings: vec![swing] });
                let energy = |q: f64, v: f64| 0.5 * (v * v + (frequency * q).powi(2));
                let before = energy(q[0], v[0]);
                let loss = flight.take(&mut q, &mut v);
                let left = energy(q[0], v[0]);
                assert!(
                    (before - loss - left).abs() < 1e-11 * before,
                    "{frequency} {ratio} {length}: {before} {loss} {left}"
                );
                flight.set_length(length);
                assert_eq!(flight.swings[0], swing);
            }
        }
    }
}
