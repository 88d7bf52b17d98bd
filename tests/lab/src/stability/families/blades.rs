//! Effects of rotation, heat and an engine order on blades; mistuned blades, and coatings that are cut.
//!
//! Every reference follows from the matrices directly: static displacements from K(Ω), free motion from the exponential
//! of the equations in the rotating frame, the response of every mode to a harmonic force, λ from the static
//! flexibility.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, DVector};
use tiprub_core::scene::method::Solver;
use tiprub_core::scene::rom::{Spin, Thermal};
use tiprub_core::scene::settings::{
    CoatingSettings, CuttingSettings, ExcitationSettings, ForceDirection, InitialSettings,
};
use tiprub_core::{CoSimulation, Result, Rom, Scene, Simulation};
use tiprub_cosim::ThermalPatch;

use super::super::{
    Cases, Check, Expected, StabilityCase,
    models::{GAP, RADIUS, StabilityMethod, Tower, allowed, blade, round},
    observe::{StabilityWatch, begin, real, set, steps, worse},
    press::pressed,
};
use super::decay::modes;

/// Internal step (s).
const STEP: f64 = 1e-6;
/// Clearance of blades without contact (m).
const FAR: f64 = 0.02;

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [spin(), mistuning(), excitation(), temperature(), cutting()].into_iter().flatten().collect()
}

/// Returns all methods with one solver; those that a rule excludes must give the error of the rule.
fn methods() -> impl Iterator<Item = StabilityMethod> {
    StabilityMethod::all_with(Solver::Lcp)
}

/// Expects a correct result, or the rule that excludes the scheme.
fn unless<const N: usize>(excluded: bool, against: &str, rule: [&str; N]) -> Expected {
    if excluded { Expected::refused(rule) } else { Expected::right(against) }
}

fn tower() -> Tower {
    Tower { sectors: 2, mass: [0.1, 1e-2], tip: 2e7, slope: 0.0, turned: 0.3, ..Tower::default() }
}

/// Returns the tower with the effect of a steady speed on its point masses: −m in the plane of rotation, 2Ωm across, mR
/// outwards.
fn spinning() -> Rom {
    let tower = tower();
    let mut rom = tower.rom();
    let mass = |i: usize| tower.mass[i / 3];
    let coriolis = DMatrix::from_fn(6, 6, |i, j| match (i / 3 == j / 3, i % 3, j % 3) {
        (true, 0, 1) => -mass(i),
        (true, 1, 0) => mass(i),
        _ => 0.0,
    });
    rom.extras.spin = Some(Spin {
        stiffness_speed2: DMatrix::from_fn(6, 6, |i, j| if i == j && i % 3 < 2 { -mass(i) } else { 0.0 }),
        stiffness_speed4: DMatrix::zeros(6, 6),
        coriolis,
        centrifugal_load: (0..6).map(|i| if i % 3 == 0 { mass(i) * RADIUS } else { 0.0 }).collect(),
        centrifugal_load_speed4: vec![0.0; 6],
        largest_speed: 2000.0,
    });
    rom
}

fn far(rom: Rom, method: StabilityMethod) -> Scene {
    let mut scene = method.stepping(round(rom), STEP);
    scene.settings.contacts[0].gap = FAR;
    scene
}

/// Returns the largest difference of the contact rows of the first sector from `expected`, relative to the largest of
/// these.
fn off(simulation: &Simulation, expected: &DVector<f64>) -> f64 {
    let row = |row: usize| simulation.system().bank().row(row, 0);
    let off = (0..expected.len()).map(|i| (row(i) - expected[i]).abs()).fold(0.0, worse);
    off / expected.amax()
}

fn solved(matrix: DMatrix<f64>, load: &DVector<f64>) -> DVector<f64> {
    matrix.lu().solve(load).unwrap_or_else(|| DVector::from_element(load.len(), f64::NAN))
}

fn spin() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in methods() {
        let (galerkin, name) = (method.is_galerkin(), method.integration());
        for speed in [1.0, 1300.0, -1300.0, 1900.0] {
            for stiffening in [false, true] {
                let against = "static centrifugal growth from K(Ω), at the start and later";
                let expected = unless(galerkin, against, ["galerkin", "structure.spin"]);
                let kind = if stiffening { "softened" } else { "plain" };
                cases.add(true, format!("spin/growth/{kind}/Ω={speed}/{name}"), expected, move || {
                    grown(method, speed, stiffening)
                });
            }
            let against = "free motion from the matrix exponential in the rotating frame; energy is conserved";
            let excluded = galerkin || method.is_massless();
            let expected = unless(excluded, against, [method.scheme.name(), "structure.spin"]);
            cases.add(speed > 1000.0, format!("spin/coriolis/Ω={speed}/{name}"), expected, move || {
                turned(method, speed)
            });
        }
    }
    cases
}

fn grown(method: StabilityMethod, speed: f64, stiffening: bool) -> Result<Vec<Check>> {
    let mut scene = far(spinning(), method);
    let rotor = &mut scene.settings.structures[0];
    (rotor.speed, rotor.spin.growth, rotor.spin.stiffening) = (speed, true, stiffening);
    let (mut simulation, mut watch) = begin(&scene)?;
    let rom = &scene.roms[0];
    let Some(spin) = &rom.extras.spin else { return Ok(Vec::new()) };
    let square = speed * speed;
    let load = DVector::from_row_slice(&spin.centrifugal_load) * square;
    let softer = if stiffening { square } else { 0.0 };
    let expected = &rom.contact_map * solved(&rom.stiffness + &spin.stiffness_speed2 * softer, &load);
    let start = off(&simulation, &expected);
    for _ in 0..100 {
        watch.step(&mut simulation, 3.0 * STEP)?;
    }
    Ok([
        watch.laws(),
        vec![
            Check::at_most("deviation of the initial displacement from the static one", start, 1e-9),
            Check::at_most(
                "deviation of the later displacement from the static one",
                off(&simulation, &expected),
                1e-9,
            ),
        ],
    ]
    .concat())
}

/// Compares a blade that is released in its first mode, without damping.
fn turned(method: StabilityMethod, speed: f64) -> Result<Vec<Check>> {
    let mut scene = far(spinning(), method);
    let rotor = &mut scene.settings.structures[0];
    (rotor.speed, rotor.spin.coriolis, rotor.spin.stiffening) = (speed, true, true);
    rotor.damping_ratio = Some(0.0);
    rotor.initial.push(InitialSettings {
        mode: 1,
        sector: Some(1),
        nodal_diameter: None,
        phase: 0.0,
        displacement: 1e-4,
        velocity: 0.0,
    });
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let rom = &scene.roms[0];
    let Some(spin) = &rom.extras.spin else { return Ok(Vec::new()) };
    let stiffness = &rom.stiffness + &spin.stiffness_speed2 * (speed * speed);
    let (_, shapes) = modes(&rom.mass, &stiffness);
    let seen = &rom.contact_map * shapes.column(0);
    let largest = seen.iter().fold(0.0, |most: f64, value| if value.abs() > most.abs() { *value } else { most });
    let mut state = DVector::zeros(12);
    state.rows_mut(0, 6).copy_from(&(shapes.column(0) * (1e-4 / largest)));
    let length = 20.0 * STEP;
    let forward = propagator(&rom.mass, &stiffness, &(&spin.coriolis * (2.0 * speed)), length);
    let (before, mut kept, mut apart) = (real(&simulation, "scheme_energy"), 0.0_f64, 0.0_f64);
    for _ in 0..100 {
        simulation.do_step(simulation.time(), length)?;
        state = &forward * &state;
        let expected = &rom.contact_map * state.rows(0, 6);
        let row = |row: usize| simulation.system().bank().row(row, 0);
        apart = (0..3).map(|i| (row(i) - expected[i]).abs() / 1e-4).fold(apart, worse);
        kept = worse(kept, (real(&simulation, "scheme_energy") / before - 1.0).abs());
    }
    Ok(vec![
        Check::at_most("deviation of the displacement from the matrix exponential", apart, 1e-3),
        Check::at_most("deviation of the energy from its initial value", kept, 1e-9),
    ])
}

/// Returns exp(A t) of (q, q̇) with M q̈ + D q̇ + K q = 0.
fn propagator(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>, damping: &DMatrix<f64>, time: f64) -> DMatrix<f64> {
    let order = mass.nrows();
    let mut matrix = DMatrix::zeros(2 * order, 2 * order);
    for i in 0..order {
        matrix[(i, order + i)] = 1.0;
        for j in 0..order {
            matrix[(order + i, j)] = -stiffness[(i, j)] / mass[(i, i)];
            matrix[(order + i, order + j)] = -damping[(i, j)] / mass[(i, i)];
        }
    }
    // A Taylor series of a short time, squared repeatedly.
    let short = &matrix * (time / 65_536.0);
    let one = DMatrix::identity(2 * order, 2 * order);
    let series = (1..=12).rev().fold(one.clone(), |sum, power| &one + &short * sum / f64::from(power));
    (0..16).fold(series, |power, _| &power * &power)
}

fn mistuning() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        for spread in [1e-6, 0.01, 0.3] {
            let against = "static λ of every blade, proportional to the square of its frequency factor";
            let name = format!("mistuning/{spread}/{}", method.name());
            let quick = method.solver == Solver::Lcp && spread > 0.1;
            cases.add(quick, name, Expected::right(against), move || mistuned(method, spread));
        }
    }
    cases
}

/// Closes a round casing on the blades of a scene and waits until they are at rest.
fn at_rest(scene: &Scene, depth: f64) -> Result<(Simulation, StabilityWatch)> {
    let mut scene = scene.clone();
    scene.settings.structures[0].damping_ratio = Some(0.3);
    let length = scene.settings.time.step.max(20.0 * STEP);
    let (mut simulation, mut watch) = begin(&scene)?;
    for index in 0..steps(16e-3, length) {
        let share = (f64::from(index) * length / 4e-3).min(1.0);
        set(&mut simulation, "casing_radius_change", -(GAP + depth) * share * share * (3.0 - 2.0 * share))?;
        watch.step(&mut simulation, length)?;
    }
    Ok((simulation, watch))
}

/// Returns the relative accuracy of static forces: galerkin closes gaps to a fraction of its tolerance.
fn near(scene: &Scene, depth: f64) -> f64 {
    1e-6 + 1e-3 * allowed(scene) / depth
}

fn mistuned(method: StabilityMethod, spread: f64) -> Result<Vec<Check>> {
    let (sectors, depth) = (4, 3e-5);
    let rom = Tower { sectors, ..tower() }.rom();
    let exact = pressed(&rom, 0.0, depth).multipliers[0];
    let mut scene = method.stepping(round(rom), STEP);
    let factor = |sector: usize| 1.0 + spread * (sector as f64 / 3.0 - 0.5);
    scene.settings.structures[0].frequency_factors = (0..sectors).map(factor).collect();
    let (simulation, watch) = at_rest(&scene, depth)?;
    let found = |sector: usize| simulation.system().multiplier(0, sector) / (exact * factor(sector).powi(2)) - 1.0;
    let apart = (0..sectors).map(|sector| found(sector).abs()).fold(0.0, worse);
    let check = Check::at_most("deviation of λ from the static solution", apart, near(&scene, depth));
    Ok([watch.books_of(method.scheme), vec![check]].concat())
}

fn excitation() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in methods() {
        let name = method.integration();
        for order in [0, 1, 3, 7] {
            for ratio in [0.3, 0.97, 1.6] {
                let against = "amplitude and phase of every blade from its modal response";
                let expected = unless(method.is_galerkin(), against, ["galerkin", "structure.excitation"]);
                let name = format!("excitation/order={order}/{ratio}ω/{name}");
                cases.add(order == 3 && ratio > 0.9, name, expected, move || excited(method, order, ratio));
            }
        }
    }
    cases
}

/// Compares blades under a tangential force on the tips of five blades, of `ratio` times their first frequency.
fn excited(method: StabilityMethod, order: u32, ratio: f64) -> Result<Vec<Check>> {
    let (sectors, damping, force, phase) = (5, 0.05, 20.0, 0.6);
    let rom = Tower { sectors, ..tower() }.rom();
    let (frequencies, shapes) = modes(&rom.mass, &rom.stiffness);
    let rate = if order == 0 { 0.0 } else { ratio * frequencies[0] };
    let mut scene = far(rom, method);
    let rotor = &mut scene.settings.structures[0];
    rotor.damping_ratio = Some(damping);
    rotor.speed = if order == 0 { 500.0 } else { rate / f64::from(order) };
    rotor.excitation = Some(ExcitationSettings {
        order,
        mode: None,
        node: Some("node_0".into()),
        direction: Some(ForceDirection::Tangential),
        amplitude: force,
        phase,
    });
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let response = |row: usize| -> Complex<f64> {
        let each = frequencies.iter().enumerate().map(|(mode, own)| {
            // Its three highest modes follow the force immediately.
            let per_force = if method.is_massless() && mode >= 3 {
                Complex::from(1.0 / (own * own))
            } else {
                Complex::new(own * own - rate * rate, 2.0 * damping * own * rate).inv()
            };
            per_force * (shapes[(3 + row, mode)] * shapes[(4, mode)])
        });
        each.sum::<Complex<f64>>() * force
    };
    let size = (0..3).map(|row| response(row).norm()).fold(0.0, worse);
    let mut apart = 0.0_f64;
    for step in 0..600 {
        simulation.do_step(simulation.time(), 50.0 * STEP)?;
        if step < 500 {
            continue;
        }
        for sector in 0..sectors {
            let angle = f64::from(order) * TAU * sector as f64 / sectors as f64 + rate * simulation.time() - phase;
            for row in 0..3 {
                let expected = (response(row) * Complex::from_polar(1.0, angle)).re;
                apart = worse(apart, (simulation.system().bank().row(row, sector) - expected).abs() / size);
            }
        }
    }
    // Quasi-static modes of massless-boundary follow the force one step late.
    let late = if method.is_massless() { rate * STEP } else { 0.0 };
    Ok(vec![
        Check::at_most("deviation of the displacement from the modal response", apart, 2e-3 + late),
        Check::at_most("energy residual", real(&simulation, "energy_residual_relative").abs(), 1e-9),
    ])
}

fn temperature() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in methods() {
        let name = method.integration();
        for degrees in [1e-6, 300.0, -300.0] {
            for softening in [0.0, 4e-4] {
                let against = "free thermal expansion; λ of the warm blade from its reduced stiffness";
                let expected = unless(method.is_galerkin(), against, ["galerkin", "structure.thermal"]);
                let name = format!("temperature/{degrees:e}/softening={softening}/{name}");
                cases.add(degrees > 1.0 && softening > 0.0, name, expected, move || warm(method, degrees, softening));
            }
        }
    }
    cases
}

fn warm(method: StabilityMethod, degrees: f64, softening: f64) -> Result<Vec<Check>> {
    let depth = 4e-5;
    let mut rom = tower().rom();
    let load = DVector::from_row_slice(&[2.0, 1.0, -1.0, 0.4, -0.2, 0.1]);
    let patches = vec![ThermalPatch { angle: [0.0, TAU], axial: [-1.0, 1.0] }];
    rom.extras.thermal = Some(Thermal { loads: DMatrix::from_column_slice(6, 1, load.as_slice()), patches });
    let expansion = &rom.contact_map * solved(rom.stiffness.clone(), &(&load * degrees));
    let mut softer = rom.clone();
    softer.stiffness *= 1.0 - softening * degrees;
    let exact = pressed(&softer, 0.0, depth + expansion[0]).multipliers[0];
    let mut scene = method.stepping(round(rom), STEP);
    let rotor = &mut scene.settings.structures[0];
    (rotor.thermal, rotor.softening, rotor.damping_ratio) = (true, softening, Some(0.3));
    let mut simulation = Simulation::new(&scene)?;
    set(&mut simulation, "rotor_temperature", degrees)?;
    simulation.initialise(0.0)?;
    let start = off(&simulation, &expansion);
    for index in 0..800 {
        let share = (f64::from(index) / 200.0).min(1.0);
        set(&mut simulation, "casing_radius_change", -(GAP + depth) * share * share * (3.0 - 2.0 * share))?;
        simulation.do_step(simulation.time(), 20.0 * STEP)?;
    }
    Ok(vec![
        Check::at_most("deviation of the initial displacement from the free expansion", start, 1e-9),
        Check::relative("deviation of λ from the static solution", simulation.system().multiplier(0, 0), exact, 1e-6),
        Check::at_most("energy residual", real(&simulation, "energy_residual_relative").abs(), 1e-9),
    ])
}

fn cutting() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        for energy in [1e5, 1e8, 1e11] {
            let against = "work u V, per cell and in total; wear only grows; signs of the energy terms";
            let excluded = method.is_massless() || method.is_galerkin();
            let expected = if method.solver != Solver::Lcp {
                Expected::refused(["solver", "coating"])
            } else if energy > 1e10 && !excluded {
                // The force is so large that the cut drags blades around the axis, or feeds tips that vibrate faster
                // than they slide.
                let feeds: &[&str] = &["cutting forces have added"];
                Expected::either_as(against, &[&["is displaced by", "around the axis"], feeds])
            } else {
                unless(excluded, against, [method.scheme.name(), "contact.coating"])
            };
            let name = format!("cutting/u={energy:e}/{}", method.name());
            cases.add(method.solver == Solver::Lcp, name, expected, move || cut(method, energy));
        }
    }
    cases
}

fn cut(method: StabilityMethod, specific_energy: f64) -> Result<Vec<Check>> {
    let mut scene = method.stepping(round(blade(4)), STEP);
    scene.settings.structures[0].damping_ratio = Some(0.05);
    scene.settings.contacts[0].coating = Some(CoatingSettings {
        cutting: Some(CuttingSettings { specific_energy, normal_ratio: 0.8 }),
        ..CoatingSettings {
            modulus: 0.0,
            yield_stress: 0.0,
            hardening: 0.0,
            // A tip cuts with its edge.
            contact_width: None,
            ..tiprub_test_models::coating_of(1e-3, [720, 3])
        }
    });
    let (mut simulation, mut watch) = begin(&scene)?;
    let (mut before, mut fallen) = (0.0_f64, 0.0_f64);
    for index in 0..2000 {
        let swing = 0.5 - 0.5 * (TAU * f64::from(index) / 2000.0).cos();
        set(&mut simulation, "casing_radius_change", -(GAP + 4e-5) * swing)?;
        watch.step(&mut simulation, STEP)?;
        let volume = real(&simulation, "worn_volume");
        fallen = worse(fallen, before - volume);
        before = volume;
    }
    let work = real(&simulation, "cutting_work");
    Ok([
        watch.laws(),
        vec![
            Check::so("material was cut, and wear only grows", before > 0.0 && fallen <= 0.0),
            Check::relative("deviation of the work from u V", work, specific_energy * before, 1e-9),
            Check::relative(
                "deviation of the energy of the cells from the work",
                real(&simulation, "wear_energy"),
                work,
                1e-9,
            ),
        ],
    ]
    .concat())
}
