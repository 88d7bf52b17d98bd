//! Converts displacements at every internal step to amplitudes over frequency: decimation, Hann window, Fourier transform, peaks.

use realfft::RealFftPlanner;
use tiprub_shell::{Failure, Result};

/// Number of boxcars in the decimation filter.
const BOXCARS: usize = 4;
/// First bin that is used; the window spreads the mean over the bins below.
pub const FIRST_BIN: usize = 3;
/// Number of bins on either side that a peak must exceed: the first side lobe of the Hann window lies 2.4 bins away.
const NEIGHBOURS: usize = 3;

/// Decimation by an integer factor M: four consecutive boxcars of M internal steps (a cubic B-spline over 4M steps), sampled at every M-th step.
///
/// A boxcar of M steps removes every multiple of the sampling rate, which would alias to frequencies near zero. Its attenuation of the retained
/// frequencies is known exactly and is corrected with [`Decimator::gain`].
#[derive(Debug, Clone)]
pub struct Decimator {
    factor: usize,
    channels: usize,
    weights: Vec<f64>,
    /// Samples, time by time.
    samples: Vec<f64>,
    /// Number of internal steps so far.
    seen: usize,
}

impl Decimator {
    /// Creates a decimator for `count` samples of `channels` signals, each from `factor` internal steps.
    pub fn new(factor: usize, channels: usize, count: usize) -> Self {
        let mut weights = vec![1.0];
        for _ in 0..BOXCARS {
            let mut longer = vec![0.0; weights.len() + factor - 1];
            for (start, weight) in weights.iter().enumerate() {
                longer[start..start + factor].iter_mut().for_each(|value| *value += weight / factor as f64);
            }
            weights = longer;
        }
        weights.resize(BOXCARS * factor, 0.0);
        Self { factor, channels, weights, samples: vec![0.0; channels * count], seen: 0 }
    }

    /// Number of further samples after which the last one is complete.
    pub const TAIL: usize = BOXCARS - 1;

    /// Adds the values of all channels at the next internal step.
    pub fn push(&mut self, values: &[f64]) {
        let (block, place) = (self.seen / self.factor, self.seen % self.factor);
        for age in 0..BOXCARS.min(block + 1) {
            let (start, weight) = ((block - age) * self.channels, self.weights[place + age * self.factor]);
            if let Some(row) = self.samples.get_mut(start..start + self.channels) {
                row.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
            }
        }
        self.seen += 1;
    }

    /// Returns the samples of one channel.
    pub fn channel(&self, channel: usize) -> impl Iterator<Item = f64> {
        self.samples.iter().skip(channel).step_by(self.channels).copied()
    }

    /// Returns the gain of the filter for an oscillation with `periods` periods per sample.
    pub fn gain(&self, periods: f64) -> f64 {
        gain(periods, self.factor)
    }
}

/// Returns the gain (sin πν / (M sin(πν/M)))⁴ at ν periods per sample.
pub fn gain(periods: f64, factor: usize) -> f64 {
    let (angle, count) = (std::f64::consts::PI * periods, factor as f64);
    let whole = count * (angle / count).sin();
    if whole.abs() < 1e-12 { 1.0 } else { (angle.sin() / whole).powi(4) }
}

/// Computes amplitudes over frequency for an oscillation about a mean; bin k is k periods in the length of the window.
pub struct Analyser {
    transform: std::sync::Arc<dyn realfft::RealToComplex<f64>>,
    window: Vec<f64>,
    /// Number of requested bins.
    bins: usize,
}

impl Analyser {
    /// Creates an analyser for windows of `count` samples and the first `bins` bins.
    pub fn new(count: usize, bins: usize) -> Self {
        Self::interpolated(count, 1, bins)
    }

    /// Creates an analyser for windows of `count` samples and the first `bins` bins, whose spacing is 1/(`factor` × length of the window). Zeros after
    /// the window interpolate the spectrum.
    pub fn interpolated(count: usize, factor: usize, bins: usize) -> Self {
        let turn = std::f64::consts::TAU / count as f64;
        let length = count * factor;
        Self {
            transform: RealFftPlanner::new().plan_fft_forward(length),
            window: (0..count).map(|index| 0.5 * (1.0 - (turn * index as f64).cos())).collect(),
            bins: bins.min(length / 2 + 1),
        }
    }

    /// Returns squared amplitudes: a sine of amplitude a in the middle of a bin gives a² there.
    ///
    /// # Errors
    /// The number of samples differs from that of the window.
    pub fn squares(&self, samples: impl Iterator<Item = f64>) -> Result<Vec<f64>> {
        let mut input: Vec<f64> = samples.collect();
        let count = input.len() as f64;
        let mean = input.iter().sum::<f64>() / count;
        input.iter_mut().zip(&self.window).for_each(|(value, weight)| *value = (*value - mean) * weight);
        if input.len() == self.window.len() {
            input.resize(self.transform.len(), 0.0);
        }
        let mut output = self.transform.make_output_vec();
        let transformed = self.transform.process(&mut input, &mut output);
        transformed.map_err(|error| Failure::new("spectrum", error, "Report this to the developers"))?;
        // One factor ½ for the two signs of the frequency, one for the mean of the window.
        let scale = 4.0 / count;
        Ok(output.iter().take(self.bins).map(|value| (scale * value.norm()).powi(2)).collect())
    }
}

/// Local maximum of a spectrum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Position in bins, interpolated between them.
    pub bin: f64,
    /// Amplitude at the maximum.
    pub amplitude: f64,
}

/// Returns the bins that are the largest of their neighbourhood and reach `least` and ten times the median. Their position is that of the parabola
/// through the logarithms of three bins, which misses the peak of a Hann window by at most 0.016 bins; their amplitude is corrected for the
/// attenuation of the window at that distance.
pub fn peaks(spectrum: &[f64], least: f64) -> Vec<Peak> {
    let mut sorted = spectrum.to_vec();
    sorted.sort_by(f64::total_cmp);
    let floor = 10.0 * sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let least = least.max(floor);
    let inner = FIRST_BIN..spectrum.len().saturating_sub(1);
    let is_peak = |bin: &usize| {
        let (value, around) =
            (spectrum[*bin], bin.saturating_sub(NEIGHBOURS)..(bin + NEIGHBOURS + 1).min(spectrum.len()));
        value >= least && value > 0.0 && around.into_iter().all(|other| spectrum[other] < value || other == *bin)
    };
    let refined = |bin: usize| {
        let (offset, _) = parabola([spectrum[bin - 1], spectrum[bin], spectrum[bin + 1]].map(f64::ln));
        Peak { bin: bin as f64 + offset, amplitude: spectrum[bin] / lobe(offset) }
    };
    inner.filter(is_peak).map(refined).collect()
}

/// Returns the main lobe of the Hann window: sin πδ / (πδ (1 − δ²)) at δ bins from its top, |δ| ≤ ½.
fn lobe(distance: f64) -> f64 {
    let angle = std::f64::consts::PI * distance;
    if angle.abs() < 1e-9 { 1.0 } else { angle.sin() / (angle * (1.0 - distance * distance)) }
}

/// Returns position (in spacings from the middle) and height of the vertex of the parabola through three equidistant values, of which the middle one
/// is the largest; the middle value itself if there is no such parabola.
pub fn parabola([before, here, after]: [f64; 3]) -> (f64, f64) {
    let bend = before - 2.0 * here + after;
    if !(bend.is_finite() && bend < 0.0) {
        return (0.0, here);
    }
    let offset = 0.5 * (before - after) / bend;
    (offset, here - 0.25 * (before - after) * offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 1024;

    fn decimated(factor: usize, signal: impl Fn(f64) -> f64) -> Decimator {
        let mut decimator = Decimator::new(factor, 2, COUNT);
        for step in 0..(COUNT + Decimator::TAIL) * factor {
            let value = signal(step as f64 / (COUNT * factor) as f64);
            decimator.push(&[value, -2.0 * value]);
        }
        decimator
    }

    fn spectrum(decimator: &Decimator, channel: usize) -> Vec<f64> {
        let squares = Analyser::new(COUNT, COUNT / 8).squares(decimator.channel(channel)).unwrap();
        let gain = |bin: usize| decimator.gain(bin as f64 / COUNT as f64);
        squares.iter().enumerate().map(|(bin, square)| square.sqrt() / gain(bin)).collect()
    }

    #[test]
    fn sine_amplitude_is_correct_between_frequency_bins() {
        for place in [17.0, 40.25, 99.5, 100.73] {
            let decimator = decimated(7, |time| 5.0 + 3e-5 * (std::f64::consts::TAU * place * time + 0.3).sin());
            for (channel, amplitude) in [(0, 3e-5), (1, 6e-5)] {
                let found = peaks(&spectrum(&decimator, channel), 1e-7);
                assert_eq!(found.len(), 1, "{place}: {found:?}");
                assert!((found[0].bin - place).abs() < 0.017, "{place}: {found:?}");
                let tolerance = if place.fract() == 0.0 { 1e-6 } else { 0.012 };
                assert!((found[0].amplitude / amplitude - 1.0).abs() < tolerance, "{place}: {found:?}");
            }
        }
    }

    /// Frequencies near the sampling rate would alias to low ones; plain sampling at the same rate shows by how much.
    #[test]
    fn frequencies_near_the_sampling_rate_do_not_alias() {
        let high = COUNT as f64 - 100.0;
        let signal = |time: f64| (std::f64::consts::TAU * high * time).sin();
        let filtered = spectrum(&decimated(7, signal), 0)[100];
        let mut plain = Decimator::new(1, 1, COUNT);
        (0..COUNT + Decimator::TAIL).for_each(|step| plain.push(&[signal(step as f64 / COUNT as f64)]));
        let plain = spectrum(&plain, 0)[100];
        assert!((plain - 1.0).abs() < 1e-9, "{plain}");
        let expected = gain(high / COUNT as f64, 7) / gain(100.0 / COUNT as f64, 7);
        assert!(expected < 4.2e-4 && (filtered / expected - 1.0).abs() < 1e-6, "{filtered} {expected}");
    }

    #[test]
    fn small_peaks_count_only_above_the_noise() {
        let mut noisy: Vec<f64> = (0..100_u32).map(|bin| 1.0 + 0.5 * f64::from(bin * bin % 7)).collect();
        (noisy[40], noisy[60]) = (100.0, 15.0);
        assert_eq!(peaks(&noisy, 0.0).len(), 1);
        assert_eq!(peaks(&noisy, 200.0), []);
        assert_eq!(peaks(&[0.0; 50], 0.0), []);
    }
}
