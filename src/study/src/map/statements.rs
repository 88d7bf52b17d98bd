//! Expectations of the map, and whether the results fulfil them.

use super::{
    Map, SpeedResponse,
    findings::{Coincidence, NEAR},
    prediction::Crossing,
};
use crate::{Statement, estimate::time_in_use};

/// Change of the effective displacement within the window that still counts as steady.
const STEADY: f64 = 0.02;
/// Largest plausible ratio of the response to the quasi-static response to the whole depth of the casing.
const MOST_DYNAMIC: f64 = 10.0;
/// Fraction of the squared amplitudes on engine orders that counts as nearly all of the response.
const NEARLY_ALL: f64 = 0.99;
/// Largest accepted penetration as a fraction of the clearance, unless adaptive steps have a larger tolerance.
const MAX_PENETRATION: f64 = 1e-3;
/// Largest residual of a closed ledger, relative to the exchanged energy.
const LEDGER: f64 = 1e-9;

/// Returns the expectations of the map, and whether it fulfils them.
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
        format!("The energy balance closes in every completed run, to {LEDGER:e} of the energy exchanged"),
        map.answered().all(|(_, response)| response.energy_residual < LEDGER),
        format!("largest residual {residual:.1e}"),
    ));
    let warned: Vec<String> = map.warning_lines().iter().map(|lines| lines.replace("\n    ", ". ")).collect();
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
        Some(first) => format!("{} of {} runs were rejected (grey in the map); {first}", refused.len(), map.runs.len()),
    };
    Statement::tested("Every run completes", refused.is_empty(), found)
}

fn contact(map: &Map) -> Vec<Statement> {
    let touching = map.answered().filter(|(_, response)| response.contact_share > 0.0).count();
    let most =
        |value: fn(&SpeedResponse) -> f64| map.answered().map(|(_, response)| value(response)).fold(0.0, f64::max);
    let (share, force) = (most(|response| response.contact_share), most(|response| response.normal_force));
    let depth = most(|response| response.penetration);
    let sum = format!(
        "contact at {touching} of {} angular velocities; a blade is in contact for at most {:.2} % of the time (mean \
         of all blades), the mean sum of normal forces is at most {force:.1} N, and the largest force on a node is {:.0} N",
        map.runs.len(),
        100.0 * share,
        most(|response| response.largest_force)
    );
    let contact = &map.setup.scene.settings.contacts[0];
    let gap = contact.sector_gaps.iter().copied().reduce(f64::min).unwrap_or(contact.gap);
    let allowed = time_in_use(&map.setup.scene.settings, &map.setup.settings)
        .step_tolerance()
        .unwrap_or(0.0)
        .max(MAX_PENETRATION);
    let expected = match allowed > MAX_PENETRATION {
        true => "No node penetrates by more than the tolerance of the adaptive steps",
        false => "No node penetrates by more than a thousandth of the clearance",
    };
    let found = format!(
        "largest value at any internal step of any window: {depth:.2e} m, {:.1e} of the clearance",
        depth / gap
    );
    // Gaps are measured from the original surface, before wear.
    let penetration = if contact.coating.is_some() {
        Statement::remark("Largest depth of a node below the unworn surface of the coating", found)
    } else {
        Statement::tested(expected, depth <= allowed * gap, found)
    };
    let expected = "The tips touch the casing in every completed run";
    vec![Statement::tested(expected, touching > 0 && touching == map.answered().count(), sum), penetration]
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
            "; largest peak off these orders: {:.2} µm at {:.3} times the rotational frequency ({:.1} Hz) and {:.1} \
             rad/s",
            1e6 * peak.amplitude,
            peak.order,
            peak.frequency,
            peak.speed
        )
    });
    let expected = format!(
        "The response repeats the shape of the casing: peaks on engine orders that the casing excites account for {:.0} % of \
         the sum of squared amplitudes",
        100.0 * NEARLY_ALL
    );
    if all.0 == 0 {
        return Statement::remark(expected, "there are no peaks");
    }
    Statement::tested(
        expected,
        on.1 >= NEARLY_ALL * all.1,
        format!(
            "multiples of {}: {} of {} peaks, {:.3} % of the sum of squared amplitudes{strongest}",
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
        "largest response: {:.2} µm at {:.2} Hz and {:.2} rad/s, {:.3} times the rotational frequency",
        1e6 * peak.amplitude,
        peak.frequency,
        peak.speed,
        peak.order
    );
    let Some(nearest) = orders.min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
        return Some(Statement::tested(
            expected,
            false,
            format!("{place}; no excited engine order at this frequency meets a mode in the range of speeds"),
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

/// Returns a statement if the largest response of a resonance lies outside the range of speeds.
fn room(map: &Map) -> Option<Statement> {
    let peak = map.peaks.iter().max_by(|a, b| a.amplitude.total_cmp(&b.amplitude))?;
    let [first, last] = [map.answered().next()?, map.answered().last()?].map(|end| end.0);
    Some(Statement::tested(
        "The largest response lies inside the range of speeds, not at one of its ends",
        first < peak.speed && peak.speed < last,
        format!("it is at {:.2} rad/s; the runs cover {first:.2} to {last:.2} rad/s", peak.speed),
    ))
}

/// Returns the statement that one-sided contact can only stiffen: its resonance lies above the linear one.
fn stiffening(map: &Map) -> Option<Statement> {
    let spacing = (map.runs[map.runs.len() - 1].speed - map.runs[0].speed) / (map.runs.len().max(2) - 1) as f64;
    stiffens(&map.coincidences, spacing)
}

/// Returns that statement for resonances at speeds `spacing` (rad/s) apart. It is undecided if a crossing responds more at an end of the range than
/// at any resonance, or if the strongest resonance lies within one spacing of its prediction.
pub fn stiffens(coincidences: &[Coincidence], spacing: f64) -> Option<Statement> {
    let amplitude = |place: Option<(f64, f64)>| place.map_or(0.0, |place| place.1);
    let most = |place: fn(&Coincidence) -> Option<(f64, f64)>| {
        let found = coincidences.iter().filter(|one| place(one).is_some());
        found.max_by(|a, b| amplitude(place(a)).total_cmp(&amplitude(place(b))))
    };
    let (strongest, leaving) = (most(|one| one.response), most(|one| one.beyond));
    let leaving = leaving.filter(|one| amplitude(one.beyond) > strongest.map_or(0.0, |one| amplitude(one.response)));
    if strongest.is_none() && leaving.is_none() {
        return None;
    }
    let shift = strongest.map_or(0.0, |one| one.response.map_or(0.0, |place| place.0) - one.crossing.speed);
    let why = match leaving {
        Some(one) => format!(
            "undecided: the response to engine order {} in mode {} extends beyond the range of speeds and is larger at \
             its end than any resonance found; ",
            one.crossing.order,
            one.crossing.mode + 1
        ),
        None if shift.abs() < spacing => "undecided: the shift is smaller than the spacing of the speeds; ".into(),
        None => String::new(),
    };
    let list: Vec<String> = coincidences.iter().filter_map(place_found).collect();
    Some(Statement {
        expected: "Contact stiffens the blades: the strongest resonance lies above the predicted one".into(),
        found: format!("{why}{}; the spacing of the speeds is {spacing:.2} rad/s", list.join("; ")),
        holds: why.is_empty().then_some(shift > 0.0),
    })
}

/// Describes where the response of a crossing is largest; `None` if there is no response.
fn place_found(one: &Coincidence) -> Option<String> {
    let Crossing { order, mode, speed: predicted, .. } = one.crossing;
    let end =
        |(speed, amplitude): (f64, f64)| format!("the end of the range, {:.2} µm at {speed:.2} rad/s", 1e6 * amplitude);
    let place = match (one.response, one.beyond) {
        (None, None) => return None,
        (None, Some(beyond)) => format!("no maximum, predicted at {predicted:.2} rad/s, largest at {}", end(beyond)),
        (Some((speed, amplitude)), beyond) => format!(
            "{:+.2} % (found at {speed:.2}, predicted at {predicted:.2} rad/s, {:.2} µm, searched from {:.1} to {:.1} \
             rad/s{})",
            100.0 * one.shift().unwrap_or(0.0),
            1e6 * amplitude,
            one.window[0],
            one.window[1],
            beyond.map_or(String::new(), |beyond| format!(", larger at {}", end(beyond)))
        ),
    };
    Some(format!("engine order {order} on mode {}: {place}", mode + 1))
}

fn scale(map: &Map) -> Option<Statement> {
    let slow = map.static_displacement?;
    let expected = format!(
        "The scale of the response is plausible: at most {MOST_DYNAMIC} times the static displacement caused by the \
         depth of the casing's shape"
    );
    if map.answered().all(|(_, response)| response.contact_share <= 0.0) {
        return Some(Statement::remark(expected, "undecided: there is no contact"));
    }
    let largest = map.answered().map(|(_, response)| response.deflection[0]).fold(0.0, f64::max);
    let smallest = map.answered().map(|(_, response)| response.deflection[0]).fold(f64::INFINITY, f64::min);
    Some(Statement::tested(
        expected,
        largest <= MOST_DYNAMIC * slow,
        format!(
            "the leading edge moves by {:.1} to {:.1} µm about its mean; the casing interferes by {:.1} µm with the \
             tips{}, its radius varies by {:.1} µm, and a slow push by this amount moves the leading edge by {:.1} µm",
            1e6 * smallest,
            1e6 * largest,
            1e6 * map.intrusion,
            map.start.without(),
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
        0 => format!("all {} runs within {:.0} %", map.answered().count(), 100.0 * STEADY),
        _ => format!(
            "{count} of {} runs change by more than {:.0} % from the first half of the window to the second, the \
             largest change at {:.2} rad/s: {:+.1} %",
            map.answered().count(),
            100.0 * STEADY,
            worst.0,
            100.0 * worst.1
        ),
    };
    let expected = format!("The effective displacement is steady to {:.0} % in every window", 100.0 * STEADY);
    Statement::tested(expected, count == 0, found)
}
