//! Free vibration after a release: blades that a casing releases, rings that a load releases, against the decay of each
//! mode.
//!
//! A structure at rest under a force that ends continues from q₀ = q₋₁ = φᵀf/ω². Without force every scheme is a
//! recurrence whose two roots a, b are known: e^(−ξωh ± iω√(1 − ξ²)h) for the exact one, otherwise those of central
//! differences. Therefore q_n = (A aⁿ + B bⁿ) q₀ to rounding, with A + B = A/a + B/b = 1, including the logarithmic
//! decrement.

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, DMatrix, DVector};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{InputInterpolation, LoadSettings};
use tiprub_core::{CoSimulation, Result, Simulation};

use super::super::{
    Cases, Check, Expected, StabilityCase,
    models::{GAP, RADIUS, StabilityMethod, Tower, allowed, on_ring, round},
    observe::{amplitudes, real, set, worse},
    press::pressed,
};

/// Depth of the casing before the release (m).
const DEPTH: f64 = 5e-5;
/// The motion is followed until this fraction of the slowest mode remains.
const LEFT: f64 = 1e-4;

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        for ratio in [1e-3, 0.005, 0.05, 0.3, 0.9] {
            for (kind, turned) in [("straight", 0.0), ("turned", 0.45)] {
                let released = Released { method, turned, ratio, reported: ratio };
                let name = format!("decay/blade/{kind}/ξ={ratio}/{}", method.name());
                let expected = Expected::right("decay of every mode from the static position, step by step");
                let quick = method.solver == Solver::Lcp && ratio >= 0.05;
                cases.add(quick, name, expected, move || released.blade());
            }
            for order in [1, 2, 3, 4].into_iter().filter(|_| method.solver == Solver::Lcp) {
                let name = format!("decay/ring/{order}/ξ={ratio}/{}", method.integration());
                let expected = Expected::right("decay of the nodal diameter from the static amplitude, step by step");
                cases.add(order == 2 && ratio >= 0.05, name, expected, move || ring(method, order, ratio, ratio));
            }
        }
    }
    cases
}

/// A blade with one node that is released.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Released {
    /// Method.
    pub method: StabilityMethod,
    /// Rotation angle of the principal axes of the base (rad).
    pub turned: f64,
    /// Damping ratio of the scene.
    pub ratio: f64,
    /// Damping ratio of the closed form: a different one must be detected.
    pub reported: f64,
}

/// Decay of one mode from rest under a force that has just ended: Re(A aⁿ + B bⁿ) with the roots a, b of its recurrence.
struct Decay {
    roots: [Complex<f64>; 2],
    shares: [Complex<f64>; 2],
    /// Radius of the slower root.
    radius: f64,
}

impl Decay {
    fn new(scheme: Scheme, frequency: f64, ratio: f64, step: f64) -> Self {
        let (rate, angle) = (ratio * frequency * step, frequency * step);
        let roots = if scheme == Scheme::CentralDifference {
            // Roots of (1 + ξωh) z² − (2 − ω²h²) z + (1 − ξωh); real for high damping and a coarse step.
            let (middle, product) = ((1.0 - 0.5 * angle * angle) / (1.0 + rate), (1.0 - rate) / (1.0 + rate));
            let apart = Complex::from(middle * middle - product).sqrt();
            [apart + middle, -apart + middle]
        } else {
            let turned = angle * (1.0 - ratio * ratio).sqrt();
            [turned, -turned].map(|turned| Complex::from_polar((-rate).exp(), turned))
        };
        let [a, b] = roots;
        let one = Complex::from(1.0);
        let shares = if scheme == Scheme::Galerkin {
            // Exact solution of the mode: one at rest at n = 0, where A ln a + B ln b = 0.
            [b.ln() / (b.ln() - a.ln()), a.ln() / (a.ln() - b.ln())]
        } else {
            // One at n = 0 and at n = −1.
            [a * (one - b) / (a - b), b * (one - a) / (b - a)]
        };
        Self { roots, shares, radius: a.norm().max(b.norm()) }
    }

    /// Returns the displacement after `n` steps without force, per displacement at rest.
    fn at(&self, n: f64) -> f64 {
        self.roots.iter().zip(self.shares).map(|(root, share)| (share * root.powf(n)).re).sum()
    }

    /// Returns the number of steps until the fraction `share` of the motion remains.
    fn steps(&self, share: f64) -> f64 {
        (share.ln() / self.radius.ln()).ceil()
    }
}

/// Returns the modes of a pencil with diagonal mass: frequencies (rad/s) ascending, and mass-normalised shapes.
pub(crate) fn modes(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let order = mass.nrows();
    let scale = |i: usize| 1.0 / mass[(i, i)].sqrt();
    let eigen = DMatrix::from_fn(order, order, |i, j| scale(i) * stiffness[(i, j)] * scale(j)).symmetric_eigen();
    let mut places: Vec<usize> = (0..order).collect();
    places.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let shapes = DMatrix::from_fn(order, order, |i, j| scale(i) * eigen.eigenvectors[(i, places[j])]);
    (places.iter().map(|place| eigen.eigenvalues[*place].sqrt()).collect(), shapes)
}

impl Released {
    /// Presses at rest, releases, and compares the displacement of the node in every step.
    ///
    /// # Errors
    /// A rejected scene.
    pub(crate) fn blade(self) -> Result<Vec<Check>> {
        let step = 2e-6;
        let tower = Tower { sectors: 1, turned: self.turned, ..Tower::default() };
        let mut scene = self.method.stepping(round(tower.rom()), step);
        scene.settings.structures[0].damping_ratio = Some(self.ratio);
        // The casing is removed instantly: within a step for recurrences. The forces of galerkin are continuous, and so
        // is the motion of its casing.
        if !self.method.is_galerkin() {
            scene.settings.time.input_interpolation = InputInterpolation::Hold;
        }
        let rom = &scene.roms[0];
        let (frequencies, shapes) = modes(&rom.mass, &rom.stiffness);
        let seen = &rom.contact_map * &shapes;
        let decays: Vec<Decay> = frequencies
            .iter()
            .map(|frequency| Decay::new(self.method.scheme, *frequency, self.reported, step))
            .collect();
        let mut simulation = Simulation::new(&scene)?;
        simulation.initialise(0.0)?;
        let settle = 30.0 / (self.ratio * frequencies[0]);
        close(&mut simulation, settle)?;
        // With the radial depth; λ along the normal of the sloped tip.
        let length = (1.0 + tower.slope * tower.slope).sqrt();
        let force = pressed(rom, 0.0, DEPTH).multipliers[0] / length;
        let force = DVector::from_row_slice(&[-force, 0.0, tower.slope * force]);
        let rest: Vec<f64> = (0..frequencies.len())
            .map(|mode| seen.column(mode).dot(&force) / (frequencies[mode] * frequencies[mode]))
            .collect();
        let massless = self.method.is_massless();
        // In both schemes without mass in the contact node, the highest modes have no inertia. With massless-boundary
        // the force acts on the others one step longer.
        let late = if massless { 1.0 } else { 0.0 };
        let moving = frequencies.len() - if self.method.scheme.is_massless() { 3 } else { 0 };
        let slowest = decays[..moving].iter().max_by(|a, b| a.radius.total_cmp(&b.radius));
        let Some(slowest) = slowest else { return Ok(Vec::new()) };
        let place = |n: f64, row: usize| -> f64 {
            let n = (n - late).max(0.0);
            (0..moving).map(|mode| seen[(row, mode)] * rest[mode] * decays[mode].at(n)).sum()
        };
        let scale = |n: f64| {
            (0..moving).map(|mode| seen.column(mode).amax() * rest[mode].abs()).sum::<f64>() * slowest.radius.powf(n)
        };
        let row = |simulation: &Simulation, row: usize| simulation.system().bank().row(row, 0);
        let found: [f64; 3] = std::array::from_fn(|i| row(&simulation, i));
        let still = (0..3)
            .map(|i| (0..frequencies.len()).map(|mode| seen[(i, mode)] * rest[mode]).sum::<f64>() - found[i])
            .fold(0.0, |most: f64, off| worse(most, off.abs()));
        if massless {
            // Only far enough to end the force: the previous force still acts, and would do work over the whole
            // distance.
            let rest = |row: usize| (moving..frequencies.len()).map(|mode| seen[(row, mode)] * rest[mode]).sum::<f64>();
            let open = 1.05 * (rest(0) - tower.slope * rest(2)).abs();
            set(&mut simulation, "casing_radius_change", open - GAP - DEPTH)?;
        } else if self.method.is_galerkin() {
            // In this step, which is shorter than those before.
            let row = simulation.table().find("casing_radius_change").map_or(0, |row| row.reference);
            simulation.set_input_derivative(row, 1, (AWAY + GAP + DEPTH) / step)?;
        } else {
            set(&mut simulation, "casing_radius_change", AWAY)?;
        }
        let (mut off, mut n) = (0.0_f64, 0.0);
        while n < slowest.steps(LEFT).max(10.0) {
            simulation.do_step(simulation.time(), step)?;
            n += 1.0;
            for i in 0..3 {
                off = worse(off, (row(&simulation, i) - place(n, i)).abs() / scale(n));
            }
            set(&mut simulation, "casing_radius_change", AWAY)?;
        }
        // The motion of the casing removes the force while it opens the gap by the displacement of the tip, which takes
        // a ten-thousandth of a step.
        let bound =
            if self.method.is_galerkin() { 1e-6 + 0.1 * near(&scene, step, frequencies[moving - 1]) } else { 1e-6 };
        Ok(vec![
            Check::at_most(
                "deviation of the position before the release from the static one",
                still / DEPTH,
                1e-9 + 1e-3 * allowed(&scene) / DEPTH,
            ),
            Check::at_most(
                "deviation of the displacement from the modal decay, relative to the remaining amplitude",
                off,
                bound,
            ),
            Check::so("the decay takes at least ten steps", n >= 10.0),
        ])
    }
}

/// Distance by which the casing is removed (m).
const AWAY: f64 = 2e-2;

/// Returns the accuracy of the release with galerkin: its tolerance, but at most the effect of a force that acts half a
/// step longer.
fn near(scene: &tiprub_core::Scene, step: f64, frequency: f64) -> f64 {
    (allowed(scene) / DEPTH).min(0.5 * frequency * step)
}

/// Closes over 2 ms and waits (s).
fn close(simulation: &mut Simulation, settle: f64) -> Result<()> {
    let Some(row) = simulation.table().find("casing_radius_change").map(|row| row.reference) else { return Ok(()) };
    simulation.set_input_derivative(row, 1, -(GAP + DEPTH) / 2e-3)?;
    simulation.do_step(0.0, 2e-3)?;
    simulation.set_real(row, -(GAP + DEPTH))?;
    let count = (settle / 0.05).ceil();
    let mut done = 0.0;
    while done < count {
        simulation.do_step(simulation.time(), (settle / count / 2e-6).ceil() * 2e-6)?;
        done += 1.0;
    }
    Ok(())
}

/// Compares a ring under a nodal-diameter load that ends; damping `ratio` in the scene, `reported` in the closed form.
///
/// # Errors
/// A rejected scene.
pub(crate) fn ring(method: StabilityMethod, order: u32, ratio: f64, reported: f64) -> Result<Vec<Check>> {
    let step = 2e-6;
    let mut scene = method.stepping(round(Tower { slope: 0.0, ..Tower::default() }.rom()), step);
    on_ring(&mut scene, ratio);
    scene.settings.structures[1].load = Some(LoadSettings { order, amplitude: 1e4, phase: 0.0 });
    scene.settings.outputs.slave_displacement = true;
    scene.settings.contacts[0].gap = 0.02;
    // The load is removed instantly.
    scene.settings.time.input_interpolation = InputInterpolation::Hold;
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let omega = TAU * [9000.0, 900.0, 400.0, 1100.0, 2100.0][order as usize];
    let rest = 0.25 * 1e4 * PI * RADIUS / (omega * omega);
    // Only contact modes of the blades lose their inertia.
    let decay = Decay::new(method.scheme, omega, reported, step);
    set(&mut simulation, "casing_load_amplitude", 0.0)?;
    let (mut off, mut across, mut n) = (0.0_f64, 0.0_f64, 0.0);
    let last = decay.steps(LEFT).max(10.0);
    let stride = (last / 3000.0).ceil();
    while n < last {
        simulation.do_step(simulation.time(), stride * step)?;
        n += stride;
        let [cosine, sine, _] = amplitudes(&simulation, order);
        let scale = rest * decay.radius.powf(n);
        off = worse(off, (cosine - rest * decay.at(n)).abs() / scale);
        across = worse(across, sine.abs() / scale);
    }
    let energy = real(&simulation, "energy_residual_relative").abs();
    Ok(vec![
        Check::at_most(
            "deviation of the amplitude from the modal decay, relative to the remaining amplitude",
            off,
            1e-6,
        ),
        Check::at_most("sine amplitude of the nodal diameter", across, 1e-6),
        Check::at_most("energy residual", energy, 1e-9),
    ])
}
