//! Agreement measures on synthetic histories.

use tiprub_reference::compare::{agreement, asymmetry, relative_l2, sample, windowed};
use tiprub_reference::cube::history::CubeHistory;

#[test]
fn windowed_forces_conserve_the_impulse() {
    // 3 N in the first half of every millisecond, recorded at the end of each of 40 intervals.
    let times: Vec<f64> = (0..=40).map(|i| 1e-4 * f64::from(i)).collect();
    let force: Vec<f64> = (0..=40).map(|i| if (i + 9) % 10 < 5 { 3.0 } else { 0.0 }).collect();
    for (length, expected) in [(5e-4, [3.0, 0.0]), (1e-3, [1.5, 1.5]), (2.5e-4, [3.0, 3.0])] {
        let found = windowed(&times, &force, length, 4e-3);
        assert!((found[0] - expected[0]).abs() < 1e-9 && (found[1] - expected[1]).abs() < 1e-9, "{found:?}");
        let impulse: f64 = found.iter().sum::<f64>() * length;
        assert!((impulse - 3.0 * 2e-3).abs() < 1e-12, "{impulse} N·s");
    }
}

#[test]
fn samples_are_interpolated_linearly_and_errors_are_relative() {
    let (coarse, fine) = ([0.0, 1.0, 2.0], [0.0, 0.5, 1.0, 1.5, 2.0]);
    assert!((sample(&coarse, &[0.0, 2.0, 0.0], 1.25) - 1.5).abs() < 1e-15);
    let at = [0.1, 0.7, 1.2, 1.9];
    let same = relative_l2((&coarse, &[0.0, 2.0, 0.0]), (&fine, &[0.0, 1.0, 2.0, 1.0, 0.0]), &at);
    let tenth = relative_l2((&coarse, &[0.0, 2.2, 0.0]), (&fine, &[0.0, 1.0, 2.0, 1.0, 0.0]), &at);
    assert!(same < 1e-15 && (tenth - 0.1).abs() < 1e-12, "{same} {tenth}");
}

fn history(scale: f64) -> CubeHistory {
    let times: Vec<f64> = (0..=100).map(|i| 1e-6 * f64::from(i)).collect();
    let corner = |t: f64| {
        let left = [scale * t, -100.0 * t + scale * t * t, 2.0 * scale * t];
        let right = [-left[0], left[1], left[2]];
        [left, left, left, left, right, right, right, right]
    };
    CubeHistory {
        corners: times.iter().map(|t| corner(*t)).collect(),
        corner_forces: times.iter().map(|_| [scale; 8]).collect(),
        forces: times.iter().map(|_| [4.0 * scale, 4.0 * scale]).collect(),
        velocity: times.iter().map(|_| [0.0, -50.0 * scale, 0.0]).collect(),
        times,
        ..CubeHistory::default()
    }
}

#[test]
fn agreement_measures_relative_differences() {
    let found = agreement(&history(1.1), &history(1.0), 100.0, 5e-5, 1e-4);
    let tenths = [found.touching[0], found.touching[1], found.touching[2], found.contact[1], found.windows];
    assert!(tenths.iter().all(|x| (x - 0.1).abs() < 1e-6), "{found:?}");
    for ratio in [found.peak, found.impulse, found.left_impulse, found.exit] {
        assert!((ratio - 0.1).abs() < 1e-9, "{found:?}");
    }
    assert!(found.path < 1e-5, "{found:?}");
}

#[test]
fn asymmetry_detects_a_change_at_one_corner() {
    let mut one = history(1.0);
    assert!(asymmetry(&one, 1.0).iter().all(|x| *x == 0.0));
    one.corners[50][6][0] += 1e-6;
    one.corner_forces[20][7] -= 0.25;
    let [moved, force] = asymmetry(&one, 1.0);
    assert!((moved - 1e-2).abs() < 1e-9 && (force - 0.25).abs() < 1e-12, "{moved} {force}");
    assert!(asymmetry(&one, 1e-5)[1] == 0.0);
}
