//! Rotating contact: a rotor pressed into lobes, a load that travels around a ring, a blade on the flank of a lobe.
//!
//! Phases reveal a wrong speed or time. Under a force of e^(iΩt) each mode responds by its recurrence q⁺ = (1 + β − κ)
//! q − β q⁻ + c f, Q = c F/(z − 1 − β + κ + β/z) with z = e^(iΩh): to rounding, and within (Ωh)² of F/(ω² − Ω² +
//! 2iξωΩ), which is compared as well because it does not depend on the scheme.

use std::f64::consts::{PI, TAU};

use nalgebra::Complex;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{LoadSettings, Shape};
use tiprub_core::{CoSimulation, Result, Scene, Simulation};

use super::{
    super::{
        Cases, Check, Expected, StabilityCase,
        models::{GAP, LONGEST, RADIUS, StabilityMethod, Tower, allowed, on_ring, round, with_step},
        observe::{StabilityWatch, amplitudes, real, set, worse},
    },
    decay::modes,
};

/// Internal step (s).
const STEP: f64 = 2e-6;
/// Longest time between two samples of slow lobes (s).
const LOBE_STRIDE: f64 = 5e-4;
/// Phase of a load, or of a mode, in the longest step of galerkin (rad).
const LOAD_STEP: f64 = 0.05;
/// Difference of the wave of λ from that of a blade without time discretisation: its highest modes are followed
/// coarsely.
const BESIDE: f64 = 5e-4;

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [loads(), lobes(), flanks()].into_iter().flatten().collect()
}

/// Returns the recurrence of one mode by its formula, independently of the core: (β, κ, c).
fn recurrence(scheme: Scheme, frequency: f64, ratio: f64, step: f64) -> [f64; 3] {
    let (rate, angle) = (ratio * frequency * step, frequency * step);
    if scheme == Scheme::CentralDifference {
        return [(1.0 - rate) / (1.0 + rate), angle * angle / (1.0 + rate), step * step / (1.0 + rate)];
    }
    let damped = angle * (1.0 - ratio * ratio).sqrt();
    let kappa = (-rate).exp_m1().powi(2) + 4.0 * (-rate).exp() * (0.5 * damped).sin().powi(2);
    [(-2.0 * rate).exp(), kappa, kappa / (frequency * frequency)]
}

/// Returns the displacement per unit modal force, both as e^(iΩnh).
fn response(scheme: Scheme, frequency: f64, ratio: f64, omega: f64, step: f64) -> Complex<f64> {
    let [beta, kappa, compliance] = recurrence(scheme, frequency, ratio, step);
    let z = Complex::from_polar(1.0, omega * step);
    Complex::from(compliance) / (z - (1.0 + beta - kappa) + z.inv() * beta)
}

/// Returns this response of the mode without time discretisation.
fn mode(frequency: f64, ratio: f64, omega: f64) -> Complex<f64> {
    Complex::new(frequency * frequency - omega * omega, 2.0 * ratio * frequency * omega).inv()
}

/// A load that travels around a ring.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Travelling {
    /// Method.
    pub method: StabilityMethod,
    /// Number of nodal diameters.
    pub order: u32,
    /// Ω over the natural frequency, with the sign of the direction.
    pub ratio: f64,
    /// Number of internal steps by which the load in the scene is early, which must be detected.
    pub early: f64,
}

/// Returns the natural frequency (rad/s) of the ring's nodal diameters.
fn ring_frequency(order: u32) -> f64 {
    TAU * [9000.0, 900.0, 400.0, 1100.0, 2100.0][order as usize]
}

fn loads() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all_with(Solver::Lcp) {
        for order in [1, 2, 3, 4] {
            for ratio in [0.01, 0.3, 1.0, 1.7, 10.0, -0.3, -1.0, -1.7] {
                let travelling = Travelling { method, order, ratio, early: 0.0 };
                let expected = Expected::right("amplitude and phase of the nodal diameter under the travelling load");
                let name = format!("turning/load/{order}/{ratio}/{}", method.integration());
                let adaptive = method.is_adaptive() && (1.0..2.0).contains(&ratio);
                let quick = order == 2 && (adaptive || (!method.is_galerkin() && ratio < -1.1));
                cases.add(quick, name, expected, move || travelling.run());
            }
        }
    }
    cases
}

impl Travelling {
    /// Applies cos(nθ − Ωt) around the ring, waits, and compares over a turn.
    ///
    /// # Errors
    /// A rejected scene.
    pub(crate) fn run(self) -> Result<Vec<Check>> {
        let (damping, load) = (0.05, 1e3);
        let frequency = ring_frequency(self.order);
        let omega = self.ratio * frequency;
        // A tolerance does not account for loads: longest steps must be short compared with their period.
        let step = if self.method.is_galerkin() { LOAD_STEP / omega.abs().max(frequency) } else { STEP };
        let mut scene = self.method.on(round(Tower { slope: 0.0, ..Tower::default() }.rom()));
        on_ring(&mut scene, damping);
        scene.settings.structures[1].load = Some(LoadSettings { order: self.order, amplitude: load, phase: 0.0 });
        scene.settings.outputs.slave_displacement = true;
        scene.settings.contacts[0].gap = 0.02;
        let mut simulation = Simulation::new(with_step(scene, step))?;
        set(&mut simulation, "casing_load_phase", self.early * omega * step)?;
        simulation.initialise(0.0)?;
        let row = simulation.table().find("casing_load_phase").map_or(0, |row| row.reference);
        simulation.set_input_derivative(row, 1, omega)?;
        let settle = (25.0 / (damping * frequency) / step).ceil() * step;
        simulation.do_step(0.0, settle)?;
        let force = 0.25 * load * PI * RADIUS;
        let discrete = response(self.method.scheme, frequency, damping, omega, step) * force;
        let exact = mode(frequency, damping, omega) * force;
        let (mut off, mut beside, mut rest) = (0.0_f64, 0.0_f64, 0.0_f64);
        let stride = (TAU / omega.abs() / step / 200.0).ceil();
        for _ in 0..200 {
            simulation.do_step(simulation.time(), stride * step)?;
            let turned = Complex::from_polar(1.0, omega * simulation.time());
            // The cos and sin parts of cos(nθ − Ωt) are the real and the imaginary part of e^(iΩt).
            let [cosine, sine, other] = amplitudes(&simulation, self.order);
            off = worse(off, (Complex::new(cosine, sine) - discrete * turned).norm());
            beside = worse(beside, (Complex::new(cosine, sine) - exact * turned).norm());
            rest = worse(rest, other);
        }
        let size = discrete.norm();
        let fine = (omega.abs().max(frequency) * step).powi(2);
        let mut checks = vec![
            Check::at_most(
                "deviation of the wave from that of the oscillator",
                beside / exact.norm(),
                fine / (2.0 * damping),
            ),
            Check::at_most("amplitude of other shapes", rest / size, 1e-8),
            Check::at_most("energy residual", real(&simulation, "energy_residual_relative").abs(), 1e-9),
        ];
        if !self.method.is_galerkin() {
            checks.push(Check::at_most("deviation of the wave from that of the recurrence", off / size, 1e-8));
        }
        Ok(checks)
    }
}

/// A rotor with all blades pressed on a casing with lobes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PressedRotor {
    /// Method.
    pub method: StabilityMethod,
    /// Number of lobes.
    pub order: u32,
    /// Speed in the closed form (rad/s).
    pub speed: f64,
    /// Factor on the speed of the rotor in the scene, which must be detected unless it is 1.
    pub factor: f64,
    /// Number of internal steps by which the rotor is ahead, which must be detected.
    pub early: f64,
}

fn lobes() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        for order in [1, 3, 12, 40] {
            for speed in [0.1, 50.0, 1300.0, -1300.0, 5000.0] {
                // Lobes move the tip by less than a tolerance that is sufficient elsewhere.
                let method = method.within(1e-7);
                let pressed = PressedRotor { method, order, speed, factor: 1.0, early: 0.0 };
                let expected = Expected::right("λ of every blade from the dynamic stiffness, over a pass of a lobe");
                let name = format!("turning/lobes/{order}/Ω={speed}/{}", method.name());
                let quick = method.solver == Solver::Lcp && order == 3 && speed > 2000.0;
                cases.add(quick, name, expected, move || pressed.run());
            }
        }
    }
    cases
}

impl PressedRotor {
    fn scene(self) -> (Tower, Scene, f64) {
        // With almost no tangential motion the blade follows the rotor.
        let tower = Tower { sectors: 7, base: [4e7, 1e10, 2e7], tip: 2e8, slope: 0.0, ..Tower::default() };
        let lobes = f64::from(self.order);
        let fast = (lobes * self.speed).abs();
        // The longest adaptive step passes only a part of a lobe, as required of every scene.
        let longest = if self.method.is_adaptive() { LONGEST.min(0.5 / fast) } else { 5e-7 };
        let mut scene = with_step(self.method.on(round(tower.rom())), longest);
        // The lobes accelerate the tip by less than the pressure on it permits.
        let amplitude = 1e-6 / (1.0 + (fast / 2e4).powi(2)) / (1.0 + 0.1 * lobes);
        scene.settings.surfaces[0].shape = Shape::Lobes { amplitude, order: self.order, phase: 0.4 };
        scene.settings.structures[0].damping_ratio = Some(0.1);
        scene.settings.structures[0].speed = self.speed * self.factor;
        (tower, scene, amplitude)
    }

    /// Returns λ at the beginning of a step per tip displacement at its end, as e^(ikΩt).
    fn stiffness(self, tower: &Tower, step: f64, omega: f64) -> Complex<f64> {
        let rom = tower.rom();
        let (frequencies, shapes) = modes(&rom.mass, &rom.stiffness);
        let z = Complex::from_polar(1.0, omega * step);
        let moving = frequencies.len() - if self.method.is_massless() { 3 } else { 0 };
        let compliance = |mode: usize| -> Complex<f64> {
            let (frequency, seen) = (frequencies[mode], shapes[(3, mode)]);
            let per_force = if !self.method.is_massless() {
                response(self.method.scheme, frequency, 0.1, omega, step) * z
            } else if mode < moving {
                response(self.method.scheme, frequency, 0.1, omega, step)
            } else {
                Complex::from(1.0 / (frequency * frequency))
            };
            per_force * (seen * seen)
        };
        (0..frequencies.len()).map(compliance).sum::<Complex<f64>>().inv()
    }

    /// Returns λ per simultaneous tip displacement, of the blade without time discretisation; with galerkin the three
    /// highest modes have no inertia.
    fn own_stiffness(self, tower: &Tower, omega: f64) -> Complex<f64> {
        let rom = tower.rom();
        let (frequencies, shapes) = modes(&rom.mass, &rom.stiffness);
        let still = |index: usize| self.method.is_galerkin() && index + 3 >= frequencies.len();
        let seen = frequencies
            .iter()
            .enumerate()
            .map(|(index, own)| mode(*own, 0.1, if still(index) { 0.0 } else { omega }) * shapes[(3, index)].powi(2));
        seen.sum::<Complex<f64>>().inv()
    }

    /// Closes, waits, and compares over one lobe.
    ///
    /// # Errors
    /// A rejected scene.
    pub(crate) fn run(self) -> Result<Vec<Check>> {
        let (tower, scene, amplitude) = self.scene();
        let step = scene.settings.time.step;
        let (lobes, depth) = (f64::from(self.order), 2e-5);
        let omega = lobes * self.speed;
        let mut simulation = Simulation::new(&scene)?;
        set(&mut simulation, "initial_rotor_angle", self.early * self.speed * step)?;
        simulation.initialise(0.0)?;
        let row = simulation.table().find("casing_radius_change").map_or(0, |row| row.reference);
        simulation.set_input_derivative(row, 1, -(GAP + depth) / 4e-3)?;
        simulation.do_step(0.0, 4e-3)?;
        simulation.set_real(row, -(GAP + depth))?;
        simulation.do_step(simulation.time(), 2e-2)?;
        let stiffness = self.stiffness(&tower, step, omega);
        let at_rest = depth / (1.0 / tower.base[0] + 1.0 / tower.tip);
        let mut watch = StabilityWatch::new(&scene);
        // λ is the force at the beginning of its step; that of galerkin is instantaneous.
        let galerkin = self.method.is_galerkin();
        let late = if galerkin { 0.0 } else { omega * step };
        let own = self.own_stiffness(&tower, omega) * Complex::from_polar(1.0, -late);
        let (mut off, mut beside, mut open) = (0.0_f64, 0.0_f64, 0);
        let stride = (TAU / omega.abs() / 100.0).min(LOBE_STRIDE).max(step) / step;
        let stride = stride.ceil();
        for _ in 0..100 {
            if stride > 1.0 {
                simulation.do_step(simulation.time(), (stride - 1.0) * step)?;
            }
            watch.step(&mut simulation, step)?;
            open += tower.sectors - simulation.system().events().len();
            for event in simulation.system().events() {
                // Tip −depth − A cos(kθ − φ) at the end of the step: pushed inwards where the casing is narrow.
                let angle = lobes * TAU * event.sector as f64 / tower.sectors as f64 + omega * simulation.time() - 0.4;
                let [wave, exact] = [stiffness, own].map(|force| (force * Complex::from_polar(amplitude, angle)).re);
                let normal =
                    if galerkin { simulation.system().multiplier(event.node, event.sector) } else { event.normal };
                off = worse(off, (normal - at_rest - wave).abs());
                beside = worse(beside, (normal - at_rest - exact).abs());
            }
        }
        let mut checks = vec![Check::so("all blades in contact", open == 0), watch.ledger()];
        let (from_scheme, from_blade) = (off / (stiffness.norm() * amplitude), beside / (own.norm() * amplitude));
        if !galerkin {
            checks.push(Check::at_most("deviation of λ from the dynamic stiffness of the blade", from_scheme, 1e-6));
        }
        // Massless-boundary applies most of the force a step late.
        if !self.method.is_massless() {
            let coarse = BESIDE + (omega * step).powi(2);
            let bound = if self.method.is_adaptive() { BESIDE + 10.0 * allowed(&scene) / amplitude } else { coarse };
            checks.push(Check::at_most("deviation of λ from the exact response of the blade", from_blade, bound));
        }
        Ok(checks)
    }
}

/// A blade that rests on the flank of a lobe, without rotation or sliding.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Flank {
    /// Method.
    pub method: StabilityMethod,
    /// Slope of the flank, ds/dθ/R.
    pub slope: f64,
    /// Fraction of the tangential part of the normal in the closed form: a value other than 1 must be detected.
    pub share: f64,
}

fn flanks() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        for slope in [1e-6, -1e-3, 0.05, -0.3, 0.9, 1.1, -2.0] {
            let flank = Flank { method, slope, share: 1.0 };
            let expected = if slope.abs() > 1.0 {
                Expected::refused(["45°"])
            } else {
                Expected::right("static contact with the tilted normal, tangential force λ n_t")
            };
            let name = format!("turning/flank/{slope}/{}", method.name());
            cases.add(method.solver == Solver::Lcp, name, expected, move || flank.run());
        }
    }
    cases
}

impl Flank {
    /// Returns the position of the tip and λ at rest: the tip is on s(θ), θ = u_t/R, pushed along the normal there.
    fn at_rest(self, tower: &Tower, shape: impl Fn(f64) -> [f64; 2], depth: f64) -> [f64; 4] {
        let flexible = [0, 1].map(|i| 1.0 / tower.base[i] + 1.0 / tower.tip);
        let (mut tangential, mut radial, mut force, mut tilt) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..200 {
            let [height, slope] = shape(tangential / RADIUS);
            let sideways = self.share * slope / RADIUS;
            let length = (1.0 + sideways * sideways).sqrt();
            tilt = sideways / length;
            // u_r = −S_r λ/N must be at height − depth.
            radial = height - depth;
            force = -radial * length / flexible[0];
            tangential = flexible[1] * force * tilt;
        }
        [radial, tangential, force, tilt]
    }

    /// Presses slowly, waits for rest, and compares.
    ///
    /// # Errors
    /// A rejected scene, or a flank that is too steep.
    pub(crate) fn run(self) -> Result<Vec<Check>> {
        let tower = Tower { sectors: 1, base: [4e7, 4e7, 2e7], slope: 0.0, ..Tower::default() };
        let mut scene = self.method.stepping(round(tower.rom()), 5e-7);
        let (order, depth) = (30, 1e-5);
        let lobes = f64::from(order);
        // −A cos(kθ − π/2) = −A sin kθ: the slope at θ = 0 is −kA.
        let amplitude = -self.slope * RADIUS / lobes;
        let phase = 0.5 * PI;
        scene.settings.surfaces[0].shape = Shape::Lobes { amplitude, order, phase };
        scene.settings.structures[0].speed = 0.0;
        scene.settings.structures[0].damping_ratio = Some(0.3);
        let shape = |angle: f64| {
            let (sine, cosine) = (lobes * angle - phase).sin_cos();
            [-amplitude * cosine, amplitude * lobes * sine]
        };
        let mut simulation = Simulation::new(&scene)?;
        simulation.initialise(0.0)?;
        let row = simulation.table().find("casing_radius_change").map_or(0, |row| row.reference);
        let mut watch = StabilityWatch::new(&scene);
        simulation.set_input_derivative(row, 1, -(GAP + depth) / 4e-3)?;
        watch.step(&mut simulation, 4e-3)?;
        simulation.set_real(row, -(GAP + depth))?;
        watch.step(&mut simulation, 2e-2)?;
        let [radial, tangential, force, tilt] = self.at_rest(&tower, shape, depth);
        let system = simulation.system();
        let found = [0, 1].map(|row| system.bank().row(row, 0));
        let sideways = system.events().first().map_or(f64::NAN, |event| event.force[1]);
        // Galerkin closes gaps to a fraction of its tolerance.
        let bound = 1e-6 + 1e-3 * allowed(&scene) / depth;
        Ok([
            watch.laws(),
            vec![
                Check::relative("deviation of λ from the static solution", system.multiplier(0, 0), force, bound),
                Check::at_most(
                    "deviation of the radial position from the static one",
                    (found[0] - radial).abs() / depth,
                    bound,
                ),
                Check::at_most(
                    "deviation of the tangential position from the static one",
                    (found[1] / tangential - 1.0).abs(),
                    bound,
                ),
                Check::relative("deviation of the tangential force from λ n_t", sideways, force * tilt, bound),
            ],
        ]
        .concat())
    }
}
