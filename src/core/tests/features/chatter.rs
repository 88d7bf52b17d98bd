//! Regenerative chatter: a blade that cuts the waves of its last pass, against the characteristic equation of orthogonal cutting with
//! delay, m s² + c s + k + k_c (1 − e^(−sτ)) = 0 (Tobias; Tlusty; Altintas, Manufacturing Automation, 2nd ed. 2012, section 4.4).

use std::f64::consts::TAU;

use nalgebra::{Complex, ComplexField};
use tiprub_core::scene::settings::{CoatingSettings, CuttingSettings};
use tiprub_core::{Rom, Scene};
use tiprub_test_models::{self as models, element, go, move_on, started};

/// Radial stiffness of the tip (N/m), frequency (rad/s) and damping ratio of its only mode.
const STIFFNESS: f64 = 1e7;
const OMEGA: f64 = TAU * 1000.0;
const DAMPING: f64 = 0.03;
/// Length along the axis (m).
const LENGTH: f64 = 0.03;
/// Ratio of normal to tangential force.
const RATIO: f64 = 0.8;
/// Whole waves between two passes: the lobe.
const WAVES: f64 = 1.0;
/// Cut per pass (m).
const DEPTH: f64 = 5e-6;

type C = Complex<f64>;

/// Returns 1/G of the blade: m s² + c s + k.
fn dynamic_stiffness(s: C) -> C {
    (s * s / (OMEGA * OMEGA) + s * (2.0 * DAMPING / OMEGA) + 1.0) * STIFFNESS
}

/// Returns the limit of the cutting stiffness (N/m) and the time between passes (s) at which the blade chatters with
/// `omega` (rad/s).
fn limit(omega: f64) -> (f64, f64) {
    let inverse = dynamic_stiffness(C::new(0.0, omega));
    let stiffness = -0.5 / inverse.inv().re;
    // 1/G = −k_c (1 − e^(−iφ)).
    let phase = -(inverse / stiffness + 1.0).argument();
    (stiffness, (phase.rem_euclid(TAU) + WAVES * TAU) / omega)
}

/// Returns the root near `s` of the equation whose cutting force leads the motion by `lead` (s).
fn root(cutting: f64, delay: f64, lead: f64, mut s: C) -> C {
    for _ in 0..50 {
        let (ahead, behind) = ((s * lead).exp(), (s * (lead - delay)).exp());
        let value = dynamic_stiffness(s) + (ahead - behind) * cutting;
        let slope = (s * 2.0 / (OMEGA * OMEGA) + 2.0 * DAMPING / OMEGA) * STIFFNESS
            + (ahead * lead - behind * (lead - delay)) * cutting;
        s -= value / slope;
    }
    s
}

/// Returns the root with the largest growth rate, among those near the frequency of the blade.
fn fastest(cutting: f64, delay: f64) -> C {
    let roots = (0..40).map(|i| root(cutting, delay, 0.0, C::new(0.0, OMEGA * (0.8 + 0.02 * f64::from(i)))));
    roots.max_by(|a, b| a.re.total_cmp(&b.re)).unwrap()
}

/// Returns blades with a rigid tip and one radial mode.
fn rotor(blades: usize) -> Rom {
    let size = OMEGA / STIFFNESS.sqrt();
    let shape = move |row: usize, _: usize| if row.is_multiple_of(3) { size } else { 0.0 };
    let nodes = ["low", "high"].into_iter().zip([0.0, LENGTH]);
    let nodes = nodes.map(|(name, z)| models::node(name, [models::RADIUS, 0.0, z], 0.0)).collect();
    Rom { sectors: blades, damping_ratio: DAMPING, ..models::modal("cutter", &[OMEGA / TAU], shape, nodes) }
}

/// Number of blades, and of cells and steps from one pass to the next.
#[derive(Clone, Copy)]
struct ChatterCase {
    blades: usize,
    cells: usize,
    steps: usize,
}

impl ChatterCase {
    fn scene(self, cutting: f64, delay: f64) -> Scene {
        let mut scene = models::round(rotor(self.blades));
        let settings = &mut scene.settings;
        settings.structures[0].speed = TAU / (self.blades as f64 * delay);
        settings.contacts[0].gap = 2e-5;
        settings.contacts[0].coating = Some(CoatingSettings {
            thickness: 1e-2,
            modulus: 0.0,
            yield_stress: 0.0,
            hardening: 0.0,
            cells_around: self.blades * self.cells,
            cells_along: 1,
            contact_width: None,
            cutting: Some(CuttingSettings { specific_energy: cutting / (RATIO * LENGTH), normal_ratio: RATIO }),
        });
        settings.time.step = delay / self.steps as f64;
        settings.outputs.watched_sectors = vec![1];
        settings.outputs.tip_displacements = true;
        scene
    }

    /// Returns the root of the continuous equation with the lead that a step causes, because it holds a force ahead of
    /// the motion.
    fn with_lead(self, cutting: f64, delay: f64) -> C {
        root(cutting, delay, delay / self.steps as f64, fastest(cutting, delay))
    }

    /// Measures growth rate and frequency (rad/s) of the vibration while the casing closes by the same depth every
    /// pass: amplitudes near a frequency in two windows, whose ratio is exact for a single exponential.
    fn measured(self, cutting: f64, delay: f64) -> C {
        let mut run = started(&self.scene(cutting, delay));
        move_on(&mut run, "casing_radius_change", 0.0, -DEPTH / delay);
        let (samples, passes, [early, late], width) = (20, 52, [12, 32], 20);
        let (apart, near) = (delay / samples as f64, fastest(cutting, delay).im);
        let mut moved = Vec::new();
        for _ in 0..samples * passes {
            go(&mut run, apart);
            moved.push(element(&run, "blade[1].tip_radial_displacement", 0));
        }
        let cut = &moved[samples * early..];
        let mean = cut.iter().sum::<f64>() / cut.len() as f64;
        // The tip never leaves the coating, where the equation would no longer hold.
        let swing = cut.iter().fold(0.0_f64, |most, value| most.max((value - mean).abs()));
        assert!(swing < 0.4 * DEPTH, "{swing:e} m");
        let amplitude = |first: usize| -> C {
            let term = |i: usize| {
                let window = (0.5 * TAU * i as f64 / (samples * width) as f64).sin().powi(4);
                let turned = C::new(0.0, -near * apart * (first + i) as f64).exp();
                turned * (window * (moved[first + i] - mean))
            };
            (0..samples * width).map(term).sum()
        };
        let ratio = amplitude(samples * late) / amplitude(samples * early);
        C::new(0.0, near) + ratio.ln() / (delay * (late - early) as f64)
    }
}

/// Slightly below and above the limit at three speeds of a lobe: rates and the limit are of first order in the step.
#[test]
fn chatter_grows_beyond_the_limit_of_its_lobe() {
    println!(
        "| speed, chatter | step | growth at 0.9, 1.1 of the limit (1/s) | closed form | with a force one step ahead | limit off by |"
    );
    for chatter in [1.01, 1.03, 1.08] {
        let (limit, delay) = limit(chatter * OMEGA);
        let mut off = Vec::new();
        for steps in [500, 1000] {
            let case = ChatterCase { blades: 1, cells: 200, steps };
            let [below, above] = [0.9 * limit, 1.1 * limit].map(|cutting| {
                let [found, exact, ahead] =
                    [case.measured(cutting, delay), fastest(cutting, delay), case.with_lead(cutting, delay)];
                assert!((found - ahead).modulus() < 0.1, "{found} {ahead}");
                [found, exact, ahead].map(|root| root.re)
            });
            assert!(below[0] < 0.0 && above[0] > 0.0, "{below:?} {above:?}");
            // Point at which the measured rate is zero, by the slope of the exact one.
            let shift = (0.5 * (below[1] + above[1]) - 0.5 * (below[0] + above[0])) / ((above[1] - below[1]) / 0.2);
            println!(
                "| {:.1} rad/s, {chatter} | 1/{steps} pass | {:.2}, {:.2} | {:.2}, {:.2} | {:.2}, {:.2} | {:.2} % |",
                TAU / delay,
                below[0],
                above[0],
                below[1],
                above[1],
                below[2],
                above[2],
                100.0 * shift
            );
            off.push(shift);
        }
        assert!(off[0] < 0.04 && (off[0] / off[1] - 2.0).abs() < 0.1, "{off:?}");
    }
}

/// The error caused by cells is of second order in their width, also if the ends of steps coincide with their borders;
/// two blades are equivalent to one that turns twice as fast.
#[test]
fn chatter_growth_is_independent_of_cell_width() {
    let (limit, delay) = limit(1.03 * OMEGA);
    let cutting = 1.1 * limit;
    let off = |blades: usize, cells: usize, steps: usize| {
        let case = ChatterCase { blades, cells, steps };
        let (found, ahead) = (case.measured(cutting, delay), case.with_lead(cutting, delay));
        println!("{blades} blades, {cells} cells, {steps} steps a pass: {found:.3}, {ahead:.3} without cells");
        (found - ahead).modulus()
    };
    let widths = [25, 50, 100].map(|cells| off(1, cells, 500));
    assert!(widths.array_windows().all(|[wide, narrow]| (wide / narrow - 4.0).abs() < 0.4), "{widths:?}");
    // Two and a half steps per cell, cells of less than two steps, incommensurate ones, two blades.
    for [blades, cells, steps] in [[1, 200, 500], [1, 300, 500], [1, 207, 503], [2, 100, 500]] {
        assert!(off(blades, cells, steps) < 1.1 * widths[2], "{blades} {cells} {steps}");
    }
}

/// Below 2kζ(1 + ζ) the vibration grows at no speed.
#[test]
fn every_speed_is_stable_below_the_minimum_limit() {
    let least = 2.0 * STIFFNESS * DAMPING * (1.0 + DAMPING);
    let at = OMEGA * (1.0 + 2.0 * DAMPING).sqrt();
    assert!((limit(at).0 / least - 1.0).abs() < 1e-12);
    let (mut largest, case) = (f64::NEG_INFINITY, ChatterCase { blades: 1, cells: 100, steps: 500 });
    for share in 0..8 {
        let delay = limit(at).1 * (0.9 + 0.05 * f64::from(share));
        let (found, ahead) = (case.measured(0.95 * least, delay), case.with_lead(0.95 * least, delay));
        println!("{:.1} rad/s: {found:.3}, {ahead:.3} in closed form with the lead of a step", TAU / delay);
        largest = largest.max(found.re);
        assert!((found - ahead).re.abs() < 0.3, "{found} {ahead}");
    }
    assert!(largest < 0.0 && largest > -0.1 * OMEGA * DAMPING, "{largest}");
}
