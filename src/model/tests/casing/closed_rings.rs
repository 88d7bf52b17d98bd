//! Casing reduction of free rings against the closed forms of thin rings: modes of the ROM by their number of waves.

use crate::guide::print_row;
use std::f64::consts::TAU;

use tiprub_core::Rom;
use tiprub_model::casing::{ContactRings, InnerContour, RingCounts, RingGeometry, RingSupport};
use tiprub_model::progress::silent;
use tiprub_model::{CasingOptions, Material, reduce_ring};
use tiprub_reference::closed::frequencies::{free_ring, free_ring_out_of_plane};

const RADIUS: f64 = 0.25;
const AROUND: usize = 24;
/// Torsion constant of a square over the fourth power of its side (S. P. Timoshenko, J. N. Goodier, Theory of Elasticity).
const SQUARE_TORSION: f64 = 0.140_577;

/// Returns a ring of square section, reduced to 24 × 2 contact nodes.
fn ring(side: f64) -> Rom {
    let inner = RADIUS - 0.5 * side;
    let options = CasingOptions {
        name: "thin".into(),
        geometry: RingGeometry {
            contour: InnerContour::new(&[[0.0, inner], [side, inner]]).unwrap(),
            thickness: side,
            flanges: [None, None],
        },
        counts: RingCounts { around: 192, through: 2, along: 3, flange: 1 },
        rings: ContactRings { around: AROUND, along: 2, axial: [0.25 * side, 0.75 * side] },
        patches: [4, 1],
        fixed_interface_modes: 48,
        modes: 30,
        // Only the rigid-body modes: the test evaluates the ROM alone.
        checked_modes: 6,
        support: RingSupport::Free,
        ..CasingOptions::default()
    };
    reduce_ring(&options, &silent).unwrap().rom
}

/// Returns the number of waves with the largest amplitude of one displacement component (0 radial, 2 axial) of a mode
/// on the first ring.
fn waves(rom: &Rom, mode: usize, component: usize) -> (u32, f64) {
    let amplitude = |n: u32| -> f64 {
        let part = |phase: f64| -> f64 {
            (0..AROUND)
                .map(|i| {
                    rom.contact_map[(3 * i + component, mode)]
                        * (f64::from(n) * TAU * i as f64 / AROUND as f64 - phase).cos()
                })
                .sum()
        };
        part(0.0).hypot(part(0.25 * TAU))
    };
    (0..9).map(|n| (n, amplitude(n))).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap()
}

/// Returns the angular frequencies of the pair of modes with n waves that move mostly along `component`.
fn pair(rom: &Rom, n: u32, component: usize) -> [f64; 2] {
    let other = 2 - component;
    let found: Vec<f64> = (0..rom.order())
        .filter(|mode| rom.stiffness[(*mode, *mode)] > 0.0)
        .filter(|mode| {
            let ((waves_own, own), (_, across)) = (waves(rom, *mode, component), waves(rom, *mode, other));
            waves_own == n && own > 3.0 * across
        })
        .map(|mode| rom.stiffness[(mode, mode)].sqrt())
        .take(2)
        .collect();
    [found[0], found[1]]
}

#[test]
fn reduced_free_rings_have_textbook_frequencies() {
    let Material { young_modulus, density, poisson_ratio, .. } = CasingOptions::default().material;
    print_row!("| n | plane | side/R | ROM (Hz) | thin ring (Hz) | deviation | pair split |");
    print_row!("|---|---|---|---|---|---|---|");
    let (mut deviations, mut rows) = (Vec::new(), Vec::new());
    for side in [0.03, 0.015] {
        let rom = ring(side);
        let rigid = (0..rom.order()).filter(|mode| rom.stiffness[(*mode, *mode)] == 0.0).count();
        assert_eq!(rigid, 6, "rigid-body modes");
        let bending = young_modulus * side.powi(4) / 12.0;
        let torsion = young_modulus / (2.0 * (1.0 + poisson_ratio)) * SQUARE_TORSION * side.powi(4);
        let line = density * side * side;
        let mut list = Vec::new();
        for n in 2..=5 {
            for (plane, component) in [("in", 0), ("out of", 2)] {
                let exact = match component {
                    0 => free_ring(n, bending, line, RADIUS),
                    _ => free_ring_out_of_plane(n, bending, torsion, line, RADIUS),
                };
                let found = pair(&rom, n, component);
                let (deviation, split) = (found[0] / exact - 1.0, found[1] / found[0] - 1.0);
                print_row!(
                    "| {n} | {plane} | {:.2} | {:.3} | {:.3} | {:+.3} % | {split:.0e} |",
                    side / RADIUS,
                    found[0] / TAU,
                    exact / TAU,
                    100.0 * deviation
                );
                assert!(split.abs() < 1e-6, "a double mode splits by {split:e}");
                list.push(deviation);
                rows.push(format!("{:.3} | {:.3} | {:+.3} %", found[0] / TAU, exact / TAU, 100.0 * deviation));
            }
        }
        deviations.push(list);
    }
    for i in 0..deviations[0].len() {
        let [thick, thin] = [0, 1].map(|k| deviations[k][i]);
        // Shear and rotatory inertia reduce the frequency, with the square of n side/R; the remaining error is that
        // of mesh and reduction.
        let limit = (4.0 * thin - thick) / 3.0;
        print_row!("number {i}: extrapolated to a thin ring {:+.3} %", 100.0 * limit);
        assert!(thick < 0.0 && (3.2..6.0).contains(&(thick / thin)), "number {i}: {thick} {thin}");
        assert!(limit.abs() < 1.5e-3, "number {i}: {limit}");
        let [a, b] = [&rows[i], &rows[i + deviations[0].len()]];
        print_row!("| {} | {a} | {b} | {:+.2} % |", 2 + i / 2, 100.0 * limit);
    }
    crate::guide::hold("cargo test -p tiprub-model --test casing closed_rings");
}
