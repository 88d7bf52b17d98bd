//! Findings of the map: peaks, and coincidences with predicted resonances.

use serde_json::{Value, json};
use tiprub_core::Scene;
use tiprub_core::modes::modal::ModalModel;
use tiprub_shell::{Failure, Result};

use super::{
    prediction::{Crossing, FrequencyPrediction},
    run::SpeedRun,
    spectrum, start,
};
use crate::Sheet;

/// Smallest peak that is listed, as a fraction of the largest amplitude of the map; side lobes of the window lie below it, too.
const LEAST_PEAK: f64 = 1e-2;
/// Largest relative distance below a crossing at which a response still belongs to it; farther below, it belongs to the previous crossing.
pub const NEAR: f64 = 0.05;

/// Peak of the map, at the leading edge of the blade with the largest amplitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPeak {
    /// Angular velocity (rad/s).
    pub speed: f64,
    /// Frequency in the rotating frame (Hz).
    pub frequency: f64,
    /// Amplitude (m).
    pub amplitude: f64,
    /// Frequency as a multiple of the rotational frequency.
    pub order: f64,
    /// Distance of the bins, as a multiple of the rotational frequency.
    pub bin: f64,
}

/// Crossing of an engine order of the casing with a mode, and the largest response to that order around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coincidence {
    /// Predicted crossing.
    pub crossing: Crossing,
    /// Range of angular velocities (rad/s) in which the response belongs to this crossing and not to a neighbour.
    pub window: [f64; 2],
    /// Angular velocity (rad/s) and amplitude (m) at the maximum of the response in the window; `None` if there is no maximum.
    pub response: Option<(f64, f64)>,
    /// Angular velocity and amplitude at an end of the range of speeds, if the response is larger there.
    pub beyond: Option<(f64, f64)>,
}

impl MapPeak {
    /// Returns the peak as JSON.
    pub fn json(&self) -> Value {
        json!({ "speed": self.speed, "frequency": self.frequency, "amplitude": self.amplitude, "engine_order": self.order })
    }

    /// Returns whether the peak lies within one bin of an engine order that the casing excites.
    pub fn on_order(&self, prediction: &FrequencyPrediction) -> bool {
        let nearest = self.order.round();
        let excited = prediction.base_order > 0 && (nearest / prediction.base_order as f64).fract() == 0.0;
        excited && nearest > 0.0 && (self.order - nearest).abs() <= self.bin
    }
}

impl Coincidence {
    /// Returns the relative distance of the response above the predicted speed.
    pub fn shift(&self) -> Option<f64> {
        Some(self.response?.0 / self.crossing.speed - 1.0)
    }

    /// Returns the coincidence as JSON.
    pub fn json(&self) -> Value {
        json!({
            "engine_order": self.crossing.order,
            "mode": self.crossing.mode + 1,
            "predicted_speed": self.crossing.speed,
            "predicted_frequency": self.crossing.frequency,
            "response_speed": self.response.map(|response| response.0),
            "response_amplitude": self.response.map(|response| response.1),
            "relative_shift": self.shift(),
            "sought_from": self.window[0],
            "sought_to": self.window[1],
            "larger_at_the_end": self.beyond.map(|end| end.0),
        })
    }
}

/// Returns all peaks, speed by speed.
pub fn peaks(runs: &[SpeedRun]) -> Vec<MapPeak> {
    let responses = || runs.iter().filter_map(|run| Some((run.speed, run.outcome.as_ref().ok()?)));
    let spectra = responses().flat_map(|(_, response)| response.largest_blade[0].iter().skip(spectrum::FIRST_BIN));
    let least = LEAST_PEAK * spectra.copied().fold(0.0, f64::max);
    let mut all = Vec::new();
    for (speed, response) in responses() {
        let turns = speed / std::f64::consts::TAU;
        let bin = response.resolution / turns;
        all.extend(spectrum::peaks(&response.largest_blade[0], least).into_iter().map(|peak| MapPeak {
            speed,
            frequency: peak.bin * response.resolution,
            amplitude: peak.amplitude,
            order: peak.bin * bin,
            bin,
        }));
    }
    all
}

/// Returns the amplitude of one engine order at every speed (m), at the leading edge of the blade with the largest amplitude.
pub fn order_curve(runs: &[SpeedRun], order: usize, revolutions: usize) -> Vec<(f64, f64)> {
    let amplitude = |run: &SpeedRun| run.outcome.as_ref().ok()?.largest_blade[0].get(order * revolutions).copied();
    runs.iter().filter_map(|run| Some((run.speed, amplitude(run)?))).collect()
}

/// Returns the excited crossings with the responses between the neighbouring crossings of the same engine order.
pub fn coincidences(
    runs: &[SpeedRun],
    prediction: &FrequencyPrediction,
    crossings: &[Crossing],
    revolutions: usize,
) -> Vec<Coincidence> {
    let excited = crossings.iter().filter(|crossing| crossing.excited);
    let found = |crossing: &Crossing| {
        let curve = order_curve(runs, crossing.order, revolutions);
        let ends: Vec<(f64, f64)> = [curve.first(), curve.last()].into_iter().flatten().copied().collect();
        let [low, high] = window(prediction, crossing);
        let range = [0, 1].map(|end| ends.get(end).map_or(crossing.speed, |end| end.0));
        let window = [low.max(range[0]), high.min(range[1])];
        let response = resonance(&curve, window);
        let most = response.map_or(0.0, |response| response.1);
        let larger = ends.into_iter().filter(|end| (low..=high).contains(&end.0) && end.1 > most);
        let beyond = larger.max_by(|a, b| a.1.total_cmp(&b.1));
        Coincidence { crossing: *crossing, window, response, beyond }
    };
    excited.map(found).collect()
}

/// Returns the range of speeds (rad/s) in which the response to an engine order belongs to this crossing. Contact stiffens the blades, so that the
/// response extends upwards from the crossing, possibly far: the range ends where that of the next crossing of the same order begins.
fn window(prediction: &FrequencyPrediction, crossing: &Crossing) -> [f64; 2] {
    let Crossing { order, speed, .. } = *crossing;
    let all = || (0..prediction.modes(order, speed).len()).filter_map(|mode| prediction.meeting(order, mode));
    let below = all().filter(|other| *other < speed && *other > 0.0).max_by(f64::total_cmp);
    let above = all().filter(|other| *other > speed).min_by(f64::total_cmp);
    let border = |low: f64, high: f64| low.midpoint(high).max((1.0 - NEAR) * high);
    [below.map_or(0.0, |below| border(below, speed)), above.map_or(f64::INFINITY, |above| border(speed, above))]
}

/// Returns the largest local maximum of a curve within a range of speeds, refined by a parabola; the ends of the curve do not count.
fn resonance(curve: &[(f64, f64)], window: [f64; 2]) -> Option<(f64, f64)> {
    let within = |point: &(f64, f64)| (window[0]..=window[1]).contains(&point.0);
    let tops =
        curve.windows(3).filter(|three| three[1].1 > three[0].1 && three[1].1 >= three[2].1 && within(&three[1]));
    let top = tops.max_by(|a, b| a[1].1.total_cmp(&b[1].1))?;
    let (offset, height) = spectrum::parabola([0, 1, 2].map(|index| top[index].1.ln()));
    let speed = top[1].0 + offset * 0.5 * (top[2].0 - top[0].0);
    Some((speed.clamp(window[0], window[1]), height.exp()))
}

/// Returns the length of the displacement of the leading edge when a contact pushes it slowly inwards by `depth` (m); `None` for coupled sectors.
///
/// # Errors
/// The eigenproblem of the ROM cannot be solved.
pub fn static_displacement(scene: &Scene, depth: f64) -> Result<Option<f64>> {
    let rom = &scene.roms[start::master(&scene.settings)?];
    if rom.is_cyclic() || depth <= 0.0 {
        return Ok(None);
    }
    let model = ModalModel::from_rom(rom, rom.damping_ratio).map_err(|error| Failure::from_core("ROM", error))?;
    let modes = &model.contact_modes;
    let flexibility = |row: usize| -> f64 {
        let squares = model.frequencies.iter().map(|frequency| frequency * frequency);
        squares
            .enumerate()
            .filter(|(_, square)| *square > 0.0)
            .map(|(mode, square)| modes[(row, mode)] * modes[(0, mode)] / square)
            .sum()
    };
    let column = [0, 1, 2].map(flexibility);
    let length = column.iter().map(|value| value * value).sum::<f64>().sqrt();
    Ok((column[0] > 0.0).then(|| depth * length / column[0]))
}

/// Tabulates the peaks.
pub fn peak_sheet(peaks: &[MapPeak], prediction: &FrequencyPrediction) -> Sheet {
    let mut sheet = Sheet::new([
        "speed (rad/s)",
        "frequency (Hz)",
        "amplitude (m)",
        "frequency / rotational frequency",
        "on an excited engine order (1 yes; 0 no)",
    ]);
    sheet.rows = peaks
        .iter()
        .map(|peak| {
            let on_order = f64::from(u8::from(peak.on_order(prediction)));
            vec![peak.speed, peak.frequency, peak.amplitude, peak.order, on_order]
        })
        .collect();
    sheet
}

/// Tabulates predicted and observed resonances.
pub fn coincidence_sheet(coincidences: &[Coincidence]) -> Sheet {
    let mut sheet = Sheet::new([
        "engine order",
        "mode",
        "predicted speed (rad/s)",
        "predicted frequency (Hz)",
        "speed of the largest response to that order (rad/s)",
        "amplitude of that response (m)",
        "relative shift",
        "searched from (rad/s)",
        "searched to (rad/s)",
        "larger response at the end of the range (rad/s)",
    ]);
    sheet.rows = coincidences
        .iter()
        .map(|one| {
            let (speed, amplitude) = one.response.unwrap_or((f64::NAN, f64::NAN));
            let Crossing { order, mode, speed: predicted, frequency, .. } = one.crossing;
            let shift = one.shift().unwrap_or(f64::NAN);
            let beyond = one.beyond.map_or(f64::NAN, |end| end.0);
            let [from, to] = one.window;
            vec![order as f64, mode as f64 + 1.0, predicted, frequency, speed, amplitude, shift, from, to, beyond]
        })
        .collect();
    sheet
}
