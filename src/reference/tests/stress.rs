//! Static stress of a loaded blade against CalculiX.

use tiprub_reference::blade::{PushedBlade, equivalent};

/// Node (from 0), displacements, stress for the same displacements, and stress by CalculiX's default.
type StressRow = (usize, [f64; 3], [f64; 6], [f64; 6]);

fn recorded() -> Vec<StressRow> {
    let lines = include_str!("data/blade_stress_calculix.csv").lines();
    let rows = lines.filter(|line| line.starts_with("mode_")).map(|line| {
        let values: Vec<f64> = line.split(',').skip(1).map(|value| value.parse().unwrap()).collect();
        let at = |from: usize| std::array::from_fn(|i| values[from + i]);
        let node = line.split(',').nth(1).unwrap().parse::<usize>().unwrap() - 1;
        (node, std::array::from_fn(|i| values[1 + i]), at(4), at(10))
    });
    rows.collect()
}

/// Displacements match those of CalculiX, and so does the stress of these displacements at the points of reduced
/// integration, extrapolated to the nodes by CalculiX. The stress from the 27 points of its default bricks is another
/// evaluation of the same field.
#[test]
fn stress_of_loaded_blade_matches_calculix() {
    let blade = PushedBlade::new().unwrap();
    let reported = blade.unit_stresses().unwrap();
    let rows = recorded();
    assert_eq!(
        rows.iter().map(|row| row.0).collect::<Vec<_>>(),
        PushedBlade::places().map(|one| one.1).collect::<Vec<_>>()
    );
    let largest = reported.iter().map(|(_, stress)| equivalent(*stress)).fold(0.0, f64::max);
    let farthest = reported.iter().flat_map(|(moved, _)| moved).fold(0.0, |most: f64, one| most.max(one.abs()));
    for ((node, moved, same, own), (ours, stress)) in rows.into_iter().zip(&reported) {
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
        let [same, own] = [same, own].map(|stress| blade.turned(node, stress));
        println!(
            "node {}: von Mises {:.4} MPa, CalculiX {:.4} MPa, from its 27 points {:.4} MPa; components off by {:.1e}, displacements by {:.1e}",
            node + 1,
            1e-6 * equivalent(*stress),
            1e-6 * equivalent(same),
            1e-6 * equivalent(own),
            apart(&same, stress) / largest,
            apart(&moved, ours) / farthest,
        );
        // CalculiX prints six digits. Its stress is smaller than ours by the same factor at all places, 2.6e-5.
        assert!(apart(&moved, ours) < 2e-6 * farthest && apart(&same, stress) < 3e-5 * largest);
        assert!((equivalent(same) / equivalent(*stress) - 1.0 + 2.6e-5).abs() < 4e-5);
        assert!(apart(&own, stress) < 0.1 * largest);
    }
}
