//! Free vibration after a release: blades that a casing let go, rings that a load let go, against the decay of each mode.
//!
//! A structure at rest under a force that ends goes on from q₀ = q₋₁ = φᵀf/ω². Without force every scheme is a recurrence whose
//! two roots a, b are known: e^(−ξωh ± iω√(1 − ξ²)h) where it is exact, those of central differences else. So
//! q_n = (A aⁿ + B bⁿ) q₀ to rounding, with A + B = A/a + B/b = 1, logarithmic decrement and all.

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, DMatrix, DVector};
use tiprub_core::{
    Result, Simulation,
    settings::{InputInterpolation, LoadSettings, Scheme, Solver},
};

use super::super::{
    Case, Cases, Check, Expected,
    models::{GAP, RADIUS, SCHEMES, SOLVERS, Tower, on_ring, round, with_methods, with_step},
    observe::{amplitudes, real, set, worse},
    press::pressed,
};

/// How far the casing is pressed on before it lets go (m).
const DEPTH: f64 = 5e-5;
/// The motion is followed until this share of the slowest mode is left.
const LEFT: f64 = 1e-4;

/// All of them.
pub(crate) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for (scheme, scheme_name) in SCHEMES {
        for ratio in [1e-3, 0.005, 0.05, 0.3, 0.9] {
            for (kind, turned) in [("straight", 0.0), ("turned", 0.45)] {
                for (solver, solver_name) in SOLVERS {
                    let released = Released { scheme, solver, turned, ratio, told: ratio };
                    let name = format!("decay/blade/{kind}/ξ={ratio}/{scheme_name}/{solver_name}");
                    let expected = Expected::right("decay of every mode from the static place, step by step");
                    let quick =
                        solver == Solver::Lcp && ratio >= if scheme == Scheme::ModalExact { 0.005 } else { 0.05 };
                    cases.add(quick, name, expected, move || released.blade());
                }
            }
            for order in [1, 2, 3, 4] {
                let name = format!("decay/ring/{order}/ξ={ratio}/{scheme_name}");
                let expected = Expected::right("decay of the nodal diameter from the static amplitude, step by step");
                cases.add(order == 2 && ratio >= 0.05, name, expected, move || ring(scheme, order, ratio, ratio));
            }
        }
    }
    cases
}

/// A blade with one node that is let go.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Released {
    /// Scheme.
    pub scheme: Scheme,
    /// Solver.
    pub solver: Solver,
    /// Turn of the principal axes of the base (rad).
    pub turned: f64,
    /// Damping ratio of the scene.
    pub ratio: f64,
    /// Damping ratio that the closed form is told: another one must be found out.
    pub told: f64,
}

/// Decay of one mode from rest under a force that has just ended: Re(A aⁿ + B bⁿ) with the roots a, b of its recurrence.
struct Decay {
    roots: [Complex<f64>; 2],
    shares: [Complex<f64>; 2],
    /// Of the slower root.
    radius: f64,
}

impl Decay {
    fn new(scheme: Scheme, frequency: f64, ratio: f64, step: f64) -> Self {
        let (rate, angle) = (ratio * frequency * step, frequency * step);
        let roots = if scheme == Scheme::CentralDifference {
            // Of (1 + ξωh) z² − (2 − ω²h²) z + (1 − ξωh); real where damping is high and the step coarse.
            let (middle, product) = ((1.0 - 0.5 * angle * angle) / (1.0 + rate), (1.0 - rate) / (1.0 + rate));
            let apart = Complex::from(middle * middle - product).sqrt();
            [apart + middle, -apart + middle]
        } else {
            let turned = angle * (1.0 - ratio * ratio).sqrt();
            [turned, -turned].map(|turned| Complex::from_polar((-rate).exp(), turned))
        };
        // One at n = 0 and at n = −1.
        let [a, b] = roots;
        let one = Complex::from(1.0);
        let shares = [a * (one - b) / (a - b), b * (one - a) / (b - a)];
        Self { roots, shares, radius: a.norm().max(b.norm()) }
    }

    /// Displacement after `n` steps without force, per displacement at rest.
    fn at(&self, n: f64) -> f64 {
        self.roots.iter().zip(self.shares).map(|(root, share)| (share * root.powf(n)).re).sum()
    }

    /// Steps until `share` of the motion is left.
    fn steps(&self, share: f64) -> f64 {
        (share.ln() / self.radius.ln()).ceil()
    }
}

/// Modes of a pencil with diagonal mass: frequencies (rad/s) ascending, and mass-normalised shapes.
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
    /// Press at rest, let go, and compare the node's displacement in every step.
    ///
    /// # Errors
    /// The scene is refused.
    pub(crate) fn blade(self) -> Result<Vec<Check>> {
        let step = 2e-6;
        let tower = Tower { sectors: 1, turned: self.turned, ..Tower::default() };
        let mut scene = with_step(with_methods(round(tower.rom()), self.scheme, self.solver), step);
        scene.settings.structures[0].damping_ratio = Some(self.ratio);
        // The casing is taken away at once.
        scene.settings.time.input_interpolation = InputInterpolation::Hold;
        let rom = &scene.roms[0];
        let (frequencies, shapes) = modes(&rom.mass, &rom.stiffness);
        let seen = &rom.contact_map * &shapes;
        let decays: Vec<Decay> =
            frequencies.iter().map(|frequency| Decay::new(self.scheme, *frequency, self.told, step)).collect();
        let mut simulation = Simulation::new(&scene)?;
        simulation.initialise(0.0)?;
        let settle = 30.0 / (self.ratio * frequencies[0]);
        close(&mut simulation, settle)?;
        // With the radial depth, λ along the normal of the sloped tip.
        let length = (1.0 + tower.slope * tower.slope).sqrt();
        let force = pressed(rom, 0.0, DEPTH).multipliers[0] / length;
        let force = DVector::from_row_slice(&[-force, 0.0, tower.slope * force]);
        let rest: Vec<f64> = (0..frequencies.len())
            .map(|mode| seen.column(mode).dot(&force) / (frequencies[mode] * frequencies[mode]))
            .collect();
        let massless = self.scheme == Scheme::MasslessBoundary;
        // Its highest modes have no inertia, and the force acts on the others one step longer.
        let (moving, late) = if massless { (frequencies.len() - 3, 1.0) } else { (frequencies.len(), 0.0) };
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
        set(&mut simulation, "casing_radius_change", 2e-2)?;
        let (mut off, mut n) = (0.0_f64, 0.0);
        while n < slowest.steps(LEFT).max(10.0) {
            simulation.do_step(simulation.time(), step)?;
            n += 1.0;
            for i in 0..3 {
                off = worse(off, (row(&simulation, i) - place(n, i)).abs() / scale(n));
            }
        }
        Ok(vec![
            Check::at_most("place before the release from the static one", still / DEPTH, 1e-9),
            Check::at_most("displacement from the decay of the modes, per what is left", off, 1e-6),
            Check::so("something was left to see", n >= 10.0),
        ])
    }
}

/// Close over 2 ms and wait (s).
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

/// A ring under a nodal-diameter load that ends; damping `ratio` in the scene, `told` in the closed form.
///
/// # Errors
/// The scene is refused.
pub(crate) fn ring(scheme: Scheme, order: u32, ratio: f64, told: f64) -> Result<Vec<Check>> {
    let step = 2e-6;
    let mut scene = with_methods(round(Tower { slope: 0.0, ..Tower::default() }.rom()), scheme, Solver::Lcp);
    on_ring(&mut scene, ratio);
    scene.settings.structures[1].load = Some(LoadSettings { order, amplitude: 1e4, phase: 0.0 });
    scene.settings.outputs.slave_displacement = true;
    scene.settings.contacts[0].gap = 0.02;
    // The load is taken off at once.
    scene.settings.time.input_interpolation = InputInterpolation::Hold;
    let mut simulation = Simulation::new(&with_step(scene, step))?;
    simulation.initialise(0.0)?;
    let omega = TAU * [9000.0, 900.0, 400.0, 1100.0, 2100.0][order as usize];
    let rest = 0.25 * 1e4 * PI * RADIUS / (omega * omega);
    // Only contact modes of the blades lose their inertia.
    let decay = Decay::new(scheme, omega, told, step);
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
        Check::at_most("amplitude from the decay of the mode, per what is left", off, 1e-6),
        Check::at_most("amplitude across", across, 1e-6),
        Check::at_most("ledger residual", energy, 1e-9),
    ])
}
