//! Vibrations and numbers of lobes: largest amplitudes by their number per revolution.

use std::f64::consts::TAU;

/// Largest number per revolution evaluated, starting just above the casing's lobes.
const MOST: u32 = 40;
const FINENESS: u32 = 100;
/// Fraction of the largest from which on a second line is reported.
const SHARE: f64 = 0.5;

/// An oscillation with a number of periods per revolution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpectralLine {
    pub(super) rate: f64,
    pub(super) amplitude: f64,
}

/// Returns |Σ x exp(-iωk)|.
fn transform(values: &[f64], step: f64) -> f64 {
    let each = values.iter().zip(0_u32..).map(|(value, index)| {
        let (sine, cosine) = (step * f64::from(index)).sin_cos();
        [value * cosine, value * sine]
    });
    let [real, imaginary] = each.fold([0.0; 2], |sum, one| [sum[0] + one[0], sum[1] + one[1]]);
    real.hypot(imaginary)
}

/// Returns the largest line, and a second one that is not much smaller.
fn largest(mut lines: Vec<SpectralLine>) -> Vec<SpectralLine> {
    lines.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
    let least = SHARE * lines.first().map_or(0.0, |line| line.amplitude);
    lines.into_iter().take(2).filter(|line| line.amplitude >= least).collect()
}

/// Returns the peaks of the spectrum of `per_turn` samples per revolution, without drift and without numbers up to
/// `below` per revolution; Hann's window.
pub(super) fn swings(samples: &[f64], per_turn: u32, below: u32) -> Vec<SpectralLine> {
    let count = samples.len() as f64;
    let middle = 0.5 * (count - 1.0);
    let mean = samples.iter().sum::<f64>() / count;
    let places = || (0..samples.len()).map(|index| index as f64 - middle);
    let slope = places().zip(samples).map(|(place, value)| place * value).sum::<f64>()
        / places().map(|place| place * place).sum::<f64>();
    let weighted: Vec<f64> = places()
        .zip(samples)
        .map(|(place, value)| (value - mean - slope * place) * (0.5 + 0.5 * (TAU * place / count).cos()))
        .collect();
    let rates = FINENESS * (below + 1)..FINENESS * MOST;
    let line = |rate: u32| {
        let rate = f64::from(rate) / f64::from(FINENESS);
        SpectralLine { rate, amplitude: 4.0 / count * transform(&weighted, TAU * rate / f64::from(per_turn)) }
    };
    let all: Vec<SpectralLine> = rates.map(line).collect();
    let peaks = all.windows(3).filter(|of| of[1].amplitude > of[0].amplitude && of[1].amplitude >= of[2].amplitude);
    largest(peaks.map(|of| of[1]).collect())
}

/// Returns the largest orders of a map over the circumference, above `below`.
pub(super) fn lobes(map: &[f64], below: u32) -> Vec<SpectralLine> {
    let count = map.len() as f64;
    let line = |order: u32| {
        let rate = f64::from(order);
        SpectralLine { rate, amplitude: 2.0 / count * transform(map, TAU * rate / count) }
    };
    largest((below + 1..=MOST).map(line).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(count: u32, value: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..count).map(|index| value(TAU * f64::from(index) / 100.0)).collect()
    }

    /// Two vibrations of any phase on a drift and the casing's lobes.
    #[test]
    fn detects_vibrations_despite_drift_and_lobes() {
        for (first, second) in [(5.78, 11.56), (8.72, 17.41), (6.59, 12.0)] {
            let samples = series(400, |turn| {
                3.0 * turn + 5.0 * (2.0 * turn).cos() + (first * turn + 1.0).cos() + 0.7 * (second * turn - 2.0).sin()
            });
            let found = swings(&samples, 100, 2);
            assert!((found[0].rate - first).abs() < 0.02 && (found[1].rate - second).abs() < 0.03, "{found:?}");
            assert!((found[0].amplitude - 1.0).abs() < 0.03 && (found[1].amplitude - 0.7).abs() < 0.03, "{found:?}");
        }
    }

    #[test]
    fn counts_lobes_and_ignores_a_small_second_order() {
        let map = |second: f64| {
            series(100, |turn| 2.0 + 3.0 * turn.cos() + (7.0 * turn - 0.4).sin() + second * (9.0 * turn).cos())
        };
        let rates = |second| lobes(&map(second), 2).iter().map(|line| line.rate).collect::<Vec<_>>();
        assert_eq!((rates(0.4), rates(0.7), rates(1.5)), (vec![7.0], vec![7.0, 9.0], vec![9.0, 7.0]));
    }
}
