//! Vibration of a run over frequency: spectrum, peaks and spectrogram.

use tiprub_shell::Result;

use crate::map::spectrum::{Analyser, peaks};

/// Smallest number of samples of a spectrum.
const MIN_SAMPLES: usize = 64;
/// Length of a run divided by the length of a window of its spectrogram: for fewer than [`MANY_SAMPLES`] samples, and for at least that many.
const WINDOWS: [usize; 2] = [4, 8];
/// Number of samples from which windows are shorter.
const MANY_SAMPLES: usize = 2048;
/// Largest number of times of a spectrogram.
const TIMES: usize = 240;
/// Number of frequencies of a spectrogram per 1/(length of a window). Frequencies between multiples of 1/length are interpolated.
const INTERPOLATION: usize = 4;
/// Smallest peak that is listed, as a fraction of the largest.
const MIN_PEAK: f64 = 0.03;
/// Largest number of peaks.
const MAX_PEAKS: usize = 8;

/// Amplitudes of a signal over frequency.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// Spacing of the frequencies (Hz).
    pub resolution: f64,
    /// Amplitudes from frequency 0, in the unit of the signal.
    pub amplitudes: Vec<f64>,
}

/// Amplitudes of a signal over frequency and time.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrogram {
    /// Spacing of the frequencies (Hz).
    pub resolution: f64,
    /// Middles of the first and the last window (s).
    pub times: [f64; 2],
    /// Length of a window (s).
    pub window: f64,
    /// Amplitudes `[time][frequency]`, in the unit of the signal.
    pub amplitudes: Vec<Vec<f64>>,
}

impl Spectrum {
    /// Transforms samples with a constant `spacing` (s), with a Hann window. `None` if there are too few samples.
    ///
    /// # Errors
    /// The transform fails.
    pub fn from_samples(samples: &[f64], spacing: f64) -> Result<Option<Self>> {
        if samples.len() < MIN_SAMPLES {
            return Ok(None);
        }
        let squares = Analyser::new(samples.len(), samples.len()).squares(samples.iter().copied())?;
        let amplitudes = squares.into_iter().map(f64::sqrt).collect();
        Ok(Some(Self { resolution: 1.0 / (samples.len() as f64 * spacing), amplitudes }))
    }

    /// Returns the largest peaks (Hz, amplitude), by frequency.
    pub fn peaks(&self) -> Vec<(f64, f64)> {
        let most = self.amplitudes.iter().copied().fold(0.0, f64::max);
        let mut found: Vec<(f64, f64)> = peaks(&self.amplitudes, MIN_PEAK * most)
            .iter()
            .map(|peak| (peak.bin * self.resolution, peak.amplitude))
            .collect();
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        found.truncate(MAX_PEAKS);
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found
    }
}

impl Spectrogram {
    /// Transforms overlapping windows of samples that begin at the time `start` (s) and have a constant `spacing` (s). `None` if there are too few
    /// samples.
    ///
    /// # Errors
    /// The transform fails.
    pub fn from_samples(samples: &[f64], start: f64, spacing: f64) -> Result<Option<Self>> {
        let length = (samples.len() / WINDOWS[usize::from(samples.len() >= MANY_SAMPLES)]).max(MIN_SAMPLES);
        if samples.len() < 2 * MIN_SAMPLES {
            return Ok(None);
        }
        let analyser = Analyser::interpolated(length, INTERPOLATION, length * INTERPOLATION);
        let last = samples.len() - length;
        let count = TIMES.min(last + 1);
        let amplitudes = (0..count).map(|column| {
            let from = last * column / (count - 1).max(1);
            let squares = analyser.squares(samples[from..from + length].iter().copied())?;
            Ok(squares.into_iter().map(f64::sqrt).collect())
        });
        let window = length as f64 * spacing;
        Ok(Some(Self {
            resolution: 1.0 / (window * INTERPOLATION as f64),
            times: [start + 0.5 * window, start + 0.5 * window + last as f64 * spacing],
            window,
            amplitudes: amplitudes.collect::<Result<_>>()?,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns 1000 samples at a spacing of 0.1 ms of a sine of 500 Hz, followed by one of 1500 Hz with half the amplitude.
    fn changing() -> Vec<f64> {
        let sine = |hertz: f64, time: f64| (std::f64::consts::TAU * hertz * time).sin();
        let value = |time: f64| if time < 0.05 { 2.0 * sine(500.0, time) } else { sine(1500.0, time) };
        (0..1000).map(|sample| value(1e-4 * f64::from(sample))).collect()
    }

    #[test]
    fn spectrum_contains_both_frequencies() {
        let spectrum = Spectrum::from_samples(&changing(), 1e-4).unwrap().unwrap();
        assert!((spectrum.resolution - 10.0).abs() < 1e-9);
        let peaks = spectrum.peaks();
        for wanted in [500.0, 1500.0] {
            assert!(peaks.iter().any(|(hertz, _)| (hertz - wanted).abs() < 15.0), "{wanted}: {peaks:?}");
        }
    }

    #[test]
    fn spectrogram_follows_the_change() {
        let found = Spectrogram::from_samples(&changing(), 0.2, 1e-4).unwrap().unwrap();
        let largest = |column: &Vec<f64>| {
            let most = (0..column.len()).max_by(|a, b| column[*a].total_cmp(&column[*b])).unwrap();
            (most as f64 * found.resolution, column[most])
        };
        let (first, last) = (largest(&found.amplitudes[0]), largest(found.amplitudes.last().unwrap()));
        assert!((first.0 - 500.0).abs() < 41.0 && (first.1 - 2.0).abs() < 0.4, "{first:?}");
        assert!((last.0 - 1500.0).abs() < 41.0 && (last.1 - 1.0).abs() < 0.2, "{last:?}");
        assert!((found.times[0] - 0.2125).abs() < 1e-9 && (found.times[1] - 0.2875).abs() < 1e-9);
        assert_eq!(found.amplitudes.len(), TIMES);
        // Frequencies every 10 Hz, although a window of 25 ms alone distinguishes 40 Hz.
        assert!((found.resolution - 10.0).abs() < 1e-9 && found.amplitudes[0].len() == 501);
        // The frequency changes in the middle of the run, where a column contains both frequencies.
        let change = found.amplitudes.iter().position(|column| largest(column).0 > 1000.0).unwrap();
        assert!((0.45..0.6).contains(&(change as f64 / TIMES as f64)), "{change}");
    }

    #[test]
    fn short_signals_have_no_spectrum() {
        assert_eq!(Spectrum::from_samples(&[1.0; 63], 1e-4).unwrap(), None);
        assert_eq!(Spectrogram::from_samples(&[1.0; 127], 0.0, 1e-4).unwrap(), None);
        assert_eq!(Spectrum::from_samples(&[1.0; 64], 1e-4).unwrap().unwrap().peaks(), []);
    }
}
