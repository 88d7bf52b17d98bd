//! What the map shows: peaks, coincidences with predicted resonances, and whether expectations hold.

use serde_json::{Value, json};
use tiprub_core::{Scene, dynamics::modal::ModalModel};

use super::{
    Map,
    prediction::{self, Crossing, Prediction},
    run::Run,
    spectrum,
};
use crate::{
    Failure, Result,
    study::{Sheet, Statement},
};

/// Peaks below this share of the largest amplitude of the map are not listed; side lobes of the window are below it, too.
const LEAST_PEAK: f64 = 1e-2;
/// A response counts as lying at a coincidence within this relative distance of its speed; further below one it is that of
/// the crossing before.
const NEAR: f64 = 0.05;
/// Change of the effective displacement within the window that counts as none.
const STEADY: f64 = 0.02;
/// Largest plausible ratio of the response to what follows the casing's whole depth slowly.
const MOST_DYNAMIC: f64 = 10.0;

/// A peak of the map, at the leading edge of the blade that swings most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapPeak {
    /// Angular velocity (rad/s).
    pub speed: f64,
    /// Frequency in the rotating frame (Hz).
    pub frequency: f64,
    /// Amplitude (m).
    pub amplitude: f64,
    /// Frequency in multiples of the rotational one.
    pub order: f64,
    /// Distance of the bins, in the same.
    pub bin: f64,
}

/// A crossing of the casing's engine orders with a mode, and the largest response to that order around it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coincidence {
    /// The crossing predicted.
    pub crossing: Crossing,
    /// Angular velocities (rad/s) between which the response is that of this crossing and of no neighbour.
    pub window: [f64; 2],
    /// Angular velocity (rad/s) and amplitude (m) of the response's maximum in the window; none where it has none.
    pub response: Option<(f64, f64)>,
    /// The same at that end of the range of speeds where the response is larger still, if it is.
    pub beyond: Option<(f64, f64)>,
}

impl MapPeak {
    /// For programs.
    pub fn json(&self) -> Value {
        json!({ "speed": self.speed, "frequency": self.frequency, "amplitude": self.amplitude, "engine_order": self.order })
    }

    /// Whether it lies on an engine order that the casing excites, to within a bin.
    fn on_order(&self, prediction: &Prediction) -> bool {
        let nearest = self.order.round();
        let excited = prediction.base_order > 0 && (nearest / prediction.base_order as f64).fract() == 0.0;
        excited && nearest > 0.0 && (self.order - nearest).abs() <= self.bin
    }
}

impl Coincidence {
    /// By how much the response lies above the prediction, relative to it.
    pub fn shift(&self) -> Option<f64> {
        Some(self.response?.0 / self.crossing.speed - 1.0)
    }

    /// For programs.
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

/// All peaks, speed by speed.
pub fn peaks(runs: &[Run]) -> Vec<MapPeak> {
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

/// Amplitude of one engine order at every speed (m), at the leading edge of the blade that swings most.
pub fn order_curve(runs: &[Run], order: usize, revolutions: usize) -> Vec<(f64, f64)> {
    let amplitude = |run: &Run| run.outcome.as_ref().ok()?.largest_blade[0].get(order * revolutions).copied();
    runs.iter().filter_map(|run| Some((run.speed, amplitude(run)?))).collect()
}

/// The excited crossings with the response found between those of the same engine order beside them.
pub fn coincidences(
    runs: &[Run],
    prediction: &Prediction,
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

/// Speeds (rad/s) at which the response to an engine order is that of this crossing. Contact stiffens, so that it leans
/// upwards from the crossing, maybe far: it ends only where that of the next crossing of the same order may begin.
fn window(prediction: &Prediction, crossing: &Crossing) -> [f64; 2] {
    let Crossing { order, speed, .. } = *crossing;
    let all = || (0..prediction.modes(order, speed).len()).filter_map(|mode| prediction.meeting(order, mode));
    let below = all().filter(|other| *other < speed && *other > 0.0).max_by(f64::total_cmp);
    let above = all().filter(|other| *other > speed).min_by(f64::total_cmp);
    let border = |low: f64, high: f64| low.midpoint(high).max((1.0 - NEAR) * high);
    [below.map_or(0.0, |below| border(below, speed)), above.map_or(f64::INFINITY, |above| border(speed, above))]
}

/// The largest local maximum of a curve within a window of speeds, refined by a parabola; the ends of the curve are none.
fn resonance(curve: &[(f64, f64)], window: [f64; 2]) -> Option<(f64, f64)> {
    let within = |point: &(f64, f64)| (window[0]..=window[1]).contains(&point.0);
    let tops =
        curve.windows(3).filter(|three| three[1].1 > three[0].1 && three[1].1 >= three[2].1 && within(&three[1]));
    let top = tops.max_by(|a, b| a[1].1.total_cmp(&b[1].1))?;
    let (offset, height) = spectrum::parabola([0, 1, 2].map(|index| top[index].1.ln()));
    Some((top[1].0 + offset * 0.5 * (top[2].0 - top[0].0), height.exp()))
}

/// Length of the displacement of the leading edge when a contact pushes it inwards by `depth` (m), slowly; none of
/// coupled sectors.
///
/// # Errors
/// A ROM whose eigenproblem cannot be solved.
pub fn static_displacement(scene: &Scene, depth: f64) -> Result<Option<f64>> {
    let rom = &scene.roms[prediction::master(&scene.settings)?];
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

/// The list of peaks as a table.
pub fn peak_sheet(peaks: &[MapPeak], prediction: &Prediction) -> Sheet {
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

/// Predicted and found resonances as a table.
pub fn coincidence_sheet(coincidences: &[Coincidence]) -> Sheet {
    let mut sheet = Sheet::new([
        "engine order",
        "mode",
        "predicted speed (rad/s)",
        "predicted frequency (Hz)",
        "speed of the largest response to that order (rad/s)",
        "its amplitude (m)",
        "relative shift",
        "sought from (rad/s)",
        "sought to (rad/s)",
        "larger still at the end of the range (rad/s)",
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

/// What the map should show and whether it does.
pub fn statements(map: &Map) -> Vec<Statement> {
    let mut all = vec![runs_end(map)];
    all.extend(contact(map));
    all.push(on_orders(map));
    all.extend(room(map));
    all.extend(at_coincidence(map));
    all.extend(stiffening(map));
    all.extend(scale(map));
    all.push(steadiness(map));
    let residual = map.answered().map(|(_, response)| response.energy_residual).fold(0.0, f64::max);
    all.push(Statement::tested(
        "The energy ledger closes in every run",
        residual < 1e-9,
        format!("largest residual {residual:.1e} of the energy exchanged"),
    ));
    let warned = map.warnings();
    all.push(Statement::remark(
        "Warnings of the runs",
        if warned.is_empty() { "none".into() } else { warned.join("; ") },
    ));
    all
}

fn runs_end(map: &Map) -> Statement {
    let refused: Vec<String> = map
        .runs
        .iter()
        .filter_map(|run| Some(format!("{:.2} rad/s: {}", run.speed, run.outcome.as_ref().err()?)))
        .collect();
    let found = match refused.first() {
        None => format!("all {} runs", map.runs.len()),
        Some(first) => format!("{} of {} are refused, marked grey in the map; {first}", refused.len(), map.runs.len()),
    };
    Statement::tested("Every run reaches its end", refused.is_empty(), found)
}

fn contact(map: &Map) -> Vec<Statement> {
    let touching = map.answered().filter(|(_, response)| response.contact_share > 0.0).count();
    let most =
        |value: fn(&super::Response) -> f64| map.answered().map(|(_, response)| value(response)).fold(0.0, f64::max);
    let (share, force) = (most(|response| response.contact_share), most(|response| response.normal_force));
    let depth = most(|response| response.penetration);
    let sum = format!(
        "at {touching} of {} angular velocities; a blade touches at most {:.2} % of the time, the mean of all normal forces \
         together is at most {force:.1} N, the largest one of a node {:.0} N",
        map.runs.len(),
        100.0 * share,
        most(|response| response.largest_force)
    );
    let gap = map.setup.scene.settings.contacts[0].gap;
    let found =
        format!("deepest at any internal step of any window: {depth:.2e} m, {:.1e} of the clearance", depth / gap);
    vec![
        Statement::tested("The tips touch the casing", touching > 0, sum),
        Statement::tested("No node penetrates by more than a thousandth of the clearance", depth <= 1e-3 * gap, found),
    ]
}

fn on_orders(map: &Map) -> Statement {
    let weight = |on: bool| {
        let peaks = map.peaks.iter().filter(|peak| !on || peak.on_order(&map.prediction));
        peaks.fold((0_usize, 0.0), |(count, sum), peak| (count + 1, sum + peak.amplitude * peak.amplitude))
    };
    let (all, on) = (weight(false), weight(true));
    let off = map.peaks.iter().filter(|peak| !peak.on_order(&map.prediction));
    let strongest = off.max_by(|a, b| a.amplitude.total_cmp(&b.amplitude));
    let strongest = strongest.map_or(String::new(), |peak| {
        format!(
            "; the largest that does not: {:.2} µm, {:.3} times the rotational frequency ({:.1} Hz) at {:.1} rad/s",
            1e6 * peak.amplitude,
            peak.order,
            peak.frequency,
            peak.speed
        )
    });
    Statement::tested(
        "Response is a repetition of the casing's shape: peaks lie on engine orders that the casing excites",
        all.0 > 0 && on.1 >= 0.99 * all.1,
        format!(
            "multiples of {}: {} of {} peaks, {:.3} % of the sum of their squared amplitudes{strongest}",
            map.prediction.base_order,
            on.0,
            all.0,
            100.0 * on.1 / all.1.max(f64::MIN_POSITIVE)
        ),
    )
}

fn at_coincidence(map: &Map) -> Option<Statement> {
    let peak = map.peaks.iter().max_by(|a, b| a.amplitude.total_cmp(&b.amplitude))?;
    let expected = "The largest response lies at a predicted coincidence";
    let orders = map.coincidences.iter().filter(|one| (one.crossing.order as f64 - peak.order).abs() <= peak.bin);
    let distance = |one: &&Coincidence| (peak.speed / one.crossing.speed - 1.0).abs();
    let place = format!(
        "largest: {:.2} µm at {:.2} Hz and {:.2} rad/s, {:.3} times the rotational frequency",
        1e6 * peak.amplitude,
        peak.frequency,
        peak.speed,
        peak.order
    );
    let Some(nearest) = orders.min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
        return Some(Statement::tested(
            expected,
            false,
            format!("{place}; no excited order there meets a mode in this range"),
        ));
    };
    let Crossing { order, mode, speed, frequency, .. } = nearest.crossing;
    let found = format!(
        "{place}; engine order {order} meets mode {} at {frequency:.2} Hz and {speed:.2} rad/s, {:+.2} % away",
        mode + 1,
        100.0 * (peak.speed / speed - 1.0)
    );
    Some(Statement::tested(format!("{expected} (within {:.0} %)", 100.0 * NEAR), distance(&nearest) <= NEAR, found))
}

/// A branch that leans out of the range of speeds has its largest response elsewhere.
fn room(map: &Map) -> Option<Statement> {
    let peak = map.peaks.iter().max_by(|a, b| a.amplitude.total_cmp(&b.amplitude))?;
    let [first, last] = [map.answered().next()?, map.answered().last()?].map(|end| end.0);
    Some(Statement::tested(
        "The largest response lies within the range of speeds, not at an end of it",
        first < peak.speed && peak.speed < last,
        format!("it is at {:.2} rad/s, the runs reach from {first:.2} to {last:.2} rad/s", peak.speed),
    ))
}

/// One-sided contact can only stiffen: resonance should lie above the free one.
fn stiffening(map: &Map) -> Option<Statement> {
    let found: Vec<&Coincidence> = map.coincidences.iter().filter(|one| one.response.is_some()).collect();
    let strongest = found.iter().max_by(|a, b| {
        let amplitude = |one: &Coincidence| one.response.map_or(0.0, |response| response.1);
        amplitude(a).total_cmp(&amplitude(b))
    })?;
    let spacing = (map.runs[map.runs.len() - 1].speed - map.runs[0].speed) / (map.runs.len().max(2) - 1) as f64;
    let text = |one: &&Coincidence| {
        let (speed, amplitude) = one.response.unwrap_or_default();
        let beyond = one.beyond.map_or(String::new(), |(speed, amplitude)| {
            format!(", larger still at the end of the range, {:.2} µm at {speed:.2} rad/s", 1e6 * amplitude)
        });
        format!(
            "engine order {} on mode {}: {:+.2} % ({speed:.2} for {:.2} rad/s, {:.2} µm, sought from {:.1} to {:.1} rad/s{beyond})",
            one.crossing.order,
            one.crossing.mode + 1,
            100.0 * one.shift().unwrap_or(0.0),
            one.crossing.speed,
            1e6 * amplitude,
            one.window[0],
            one.window[1]
        )
    };
    let list: Vec<String> = found.iter().map(text).collect();
    Some(Statement::tested(
        "Contact stiffens: the strongest resonance lies above the predicted one",
        strongest.shift().is_some_and(|shift| shift > 0.0),
        format!("{}; one speed is {spacing:.2} rad/s from the next", list.join("; ")),
    ))
}

fn scale(map: &Map) -> Option<Statement> {
    let slow = map.static_displacement?;
    let largest = map.answered().map(|(_, response)| response.deflection[0]).fold(0.0, f64::max);
    let smallest = map.answered().map(|(_, response)| response.deflection[0]).fold(f64::INFINITY, f64::min);
    Some(Statement::tested(
        "The scale of the response is plausible: that of a blade pushed back by the depth of the casing's shape, up to ten times",
        largest <= MOST_DYNAMIC * slow,
        format!(
            "the leading edge swings by {:.1} to {:.1} µm about its mean; the casing reaches {:.1} µm beyond the tips, its radius \
             varies by {:.1} µm, and a slow push by that much moves the leading edge by {:.1} µm",
            1e6 * smallest,
            1e6 * largest,
            1e6 * map.intrusion,
            1e6 * map.depth,
            1e6 * slow
        ),
    ))
}

fn steadiness(map: &Map) -> Statement {
    let unsteady = map.answered().filter(|(_, response)| response.drift.abs() > STEADY);
    let (count, worst) = unsteady.fold((0, (0.0, 0.0_f64)), |(count, worst), (speed, response)| {
        (count + 1, if response.drift.abs() > worst.1.abs() { (speed, response.drift) } else { worst })
    });
    let found = match count {
        0 => format!("all {} within {:.0} %", map.answered().count(), 100.0 * STEADY),
        _ => format!(
            "{count} of {} change by more than {:.0} % from the first half of the window to the second, most at {:.2} rad/s: {:+.1} %",
            map.answered().count(),
            100.0 * STEADY,
            worst.0,
            100.0 * worst.1
        ),
    };
    Statement::remark("Effective displacement is steady over the window", found)
}
