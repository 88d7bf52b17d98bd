//! Measures of the agreement of two histories.

use crate::cube::history::CubeHistory;

/// Interpolates a value linearly at a time between samples; the nearest end outside.
pub fn sample(times: &[f64], values: &[f64], time: f64) -> f64 {
    let after = times.partition_point(|t| *t <= time);
    if after == 0 {
        return values.first().copied().unwrap_or(0.0);
    }
    if after == times.len() {
        return values[after - 1];
    }
    let share = (time - times[after - 1]) / (times[after] - times[after - 1]);
    values[after - 1] + share * (values[after] - values[after - 1])
}

/// Returns ‖a − b‖/‖b‖ over samples at the given times.
pub fn relative_l2(a: (&[f64], &[f64]), b: (&[f64], &[f64]), at: &[f64]) -> f64 {
    let (mut difference, mut size) = (0.0, 0.0);
    for &time in at {
        let (x, y) = (sample(a.0, a.1, time), sample(b.0, b.1, time));
        difference += (x - y) * (x - y);
        size += y * y;
    }
    (difference / size).sqrt()
}

/// Returns the means of a force over windows of a length (s) up to `end` (s); each record counts for the time since
/// the one before.
pub fn windowed(times: &[f64], force: &[f64], length: f64, end: f64) -> Vec<f64> {
    let mut windows = Vec::new();
    while (windows.len() + 1) as f64 * length < end * (1.0 + 1e-12) {
        let (from, to) = (windows.len() as f64 * length, (windows.len() + 1) as f64 * length);
        let overlap = |i: usize| (times[i].min(to) - times[i - 1].max(from)).max(0.0);
        let first = times.partition_point(|t| *t <= from).max(1);
        let last = times.partition_point(|t| *t < to).min(times.len() - 1);
        windows.push((first..=last).map(|i| force[i] * overlap(i)).sum::<f64>() / length);
    }
    windows
}

/// Difference of one history from another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HistoryDifference {
    /// Relative L2 difference of u1x, u1y + vt (the deceleration) and u1z while node 1 touches.
    pub touching: [f64; 3],
    /// Relative L2 difference of these quantities while any node of the cube touches.
    pub contact: [f64; 3],
    /// Relative L2 difference of u1y while any node touches.
    pub path: f64,
    /// Relative L2 difference of the mean of λ1 over windows of [`WINDOW`].
    pub windows: f64,
    /// Ratio of the largest windowed λ1 to that of the other history, minus one.
    pub peak: f64,
    /// Ratio of the impulse of λ1 to that of the other history, minus one.
    pub impulse: f64,
    /// Ratio of the impulse of all normal forces on the left face to that of the other history, minus one.
    pub left_impulse: f64,
    /// Ratio of the exit speed to that of the other history, minus one.
    pub exit: f64,
}

/// Length of the force windows (s).
pub const WINDOW: f64 = 20e-6;

/// Compares `a` with `b`, both run at `speed` (m/s); `touching` and `contact` are the ends of the two windows (s).
pub fn agreement(a: &CubeHistory, b: &CubeHistory, speed: f64, touching: f64, contact: f64) -> HistoryDifference {
    let series = |history: &CubeHistory, component: usize| -> Vec<f64> {
        let lag = if component == 1 { speed } else { 0.0 };
        history.first(component).iter().zip(&history.times).map(|(u, t)| u + lag * t).collect()
    };
    let until = |end: f64| -> Vec<f64> { (1..=400).map(|i| end * f64::from(i) / 400.0).collect() };
    let l2 = |component: usize, end: f64| {
        relative_l2((&a.times, &series(a, component)), (&b.times, &series(b, component)), &until(end))
    };
    let window =
        |history: &CubeHistory| windowed(&history.times, &history.first_force(), WINDOW, touching + 2.0 * WINDOW);
    let (first, second) = (window(a), window(b));
    let norm = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>().sqrt();
    let differences: Vec<f64> = first.iter().zip(&second).map(|(x, y)| x - y).collect();
    let peak = |values: &[f64]| values.iter().fold(0.0, |largest: f64, x| largest.max(*x));
    let left = |history: &CubeHistory| {
        let forces: Vec<f64> = history.forces.iter().map(|sides| sides[0]).collect();
        windowed(&history.times, &forces, contact, contact)[0]
    };
    HistoryDifference {
        touching: [l2(0, touching), l2(1, touching), l2(2, touching)],
        contact: [l2(0, contact), l2(1, contact), l2(2, contact)],
        path: relative_l2((&a.times, &a.first(1)), (&b.times, &b.first(1)), &until(contact)),
        windows: norm(&differences) / norm(&second),
        peak: peak(&first) / peak(&second) - 1.0,
        impulse: first.iter().sum::<f64>() / second.iter().sum::<f64>() - 1.0,
        left_impulse: left(a) / left(b) - 1.0,
        exit: exit_speed(a) / exit_speed(b) - 1.0,
    }
}

/// Returns the speed of the centre of the cube along −y at the end (m/s).
pub fn exit_speed(history: &CubeHistory) -> f64 {
    history.velocity.last().map_or(f64::NAN, |velocity| -velocity[1])
}

/// Returns the largest difference between left and right: displacements ux of the corner pairs (1, 31), (6, 36), (85,
/// 91), (90, 96) relative to the largest, and their forces relative to the largest.
pub fn asymmetry(history: &CubeHistory, until: f64) -> [f64; 2] {
    let mut largest = [0.0_f64; 2];
    let mut difference = [0.0_f64; 2];
    for (i, _) in history.times.iter().enumerate().filter(|(_, time)| **time <= until) {
        let (moved, force) = (&history.corners[i], &history.corner_forces[i]);
        for pair in 0..4 {
            largest[0] = largest[0].max(moved[pair][0].abs());
            largest[1] = largest[1].max(force[pair]);
            difference[0] = difference[0].max((moved[pair][0] + moved[pair + 4][0]).abs());
            difference[1] = difference[1].max((force[pair] - force[pair + 4]).abs());
        }
    }
    [difference[0] / largest[0], difference[1] / largest[1]]
}
