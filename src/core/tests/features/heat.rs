//! Heated blades: free expansion, softening, their work.

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, DVector};
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::rom::Thermal;
use tiprub_core::scene::settings::{InitialSettings, InputInterpolation};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_cosim::ThermalPatch;
use tiprub_test_models::{self as models, bits, disk::TestDisk, go, real, saved, set, started};

const SOFTENING: f64 = 4e-4;

/// Adds a load per kelvin to the ROM.
fn heated(mut rom: Rom) -> Rom {
    let load = DMatrix::from_fn(rom.order(), 1, |row, _| 2.0 + 1.5 * (row as f64).sin());
    let patches = vec![ThermalPatch { angle: [0.0, TAU], axial: [-1.0, 1.0] }];
    rom.extras.thermal = Some(Thermal { loads: load, patches });
    rom
}

fn scene(rom: Rom) -> Scene {
    let mut scene = models::round(heated(rom));
    scene.settings.structures[0].thermal = true;
    scene.settings.contacts[0].gap = 5e-3;
    scene
}

fn warm(scene: &Scene, temperature: f64) -> Simulation {
    let mut run = Simulation::new(scene).unwrap();
    set(&mut run, "rotor_temperature", temperature);
    run.initialise(0.0).unwrap();
    run
}

fn displacements(run: &Simulation) -> Vec<f64> {
    run.system().bank().displacement().to_vec()
}

fn apart(found: &[f64], expected: &[f64]) -> f64 {
    let size = expected.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    found.iter().zip(expected).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) / size
}

/// The free expansion CΦω⁻²Φᵀf T is reached at the start, and after slow heating; coupled sectors agree. Softening does
/// not change it.
#[test]
fn warm_blades_rest_at_their_free_expansion() {
    for rom in [models::blade(3), TestDisk::random(3, 1, 6, 0.2, 3).cyclic()] {
        let stiffness = rom.stiffness.clone().cholesky().unwrap();
        let load = heated(rom.clone()).extras.thermal.unwrap().loads;
        let free = &rom.contact_map * stiffness.solve(&load) * 250.0;
        let mut given = scene(rom.clone());
        given.settings.structures[0].damping_ratio = Some(0.3);
        for softening in if rom.is_cyclic() { vec![0.0] } else { vec![0.0, SOFTENING] } {
            given.settings.structures[0].softening = softening;
            let lanes = started(&given).system().bank().lanes();
            let expected: Vec<f64> =
                free.iter().flat_map(|row| (0..lanes).map(move |lane| if lane < 3 { *row } else { 0.0 })).collect();
            let mut run = warm(&given, 250.0);
            assert!(apart(&displacements(&run), &expected) < 1e-12);
            go(&mut run, 1e-3);
            assert!(apart(&displacements(&run), &expected) < 1e-9, "rest stays rest");
            let mut run = started(&given);
            for step in 1..=200 {
                set(&mut run, "rotor_temperature", 2.5 * f64::from(step).min(100.0));
                go(&mut run, 2e-4);
            }
            let left = apart(&displacements(&run), &expected);
            assert!(left < 1e-7, "{left:e}");
            assert!(real(&run, "energy_residual_relative").abs() < 1e-11);
            assert!(real(&run, "load_work") > 0.0);
        }
    }
}

/// A rotating, stiffened blade expands as at rest: growth K(Ω)⁻¹(Ω²c + Ω⁴c₂) plus free expansion, at the start and for
/// later changes of speed and temperature. Softening changes the growth but not the expansion.
#[test]
fn rotation_does_not_change_thermal_expansion() {
    let mut rom = models::blade(3);
    rom.extras.spin = Some(models::spin(rom.order()));
    let (speed, temperature) = (1600.0_f64, 250.0);
    let square = speed * speed;
    let spin = rom.extras.spin.clone().unwrap();
    let load = heated(rom.clone()).extras.thermal.unwrap().loads;
    let free = rom.stiffness.clone().cholesky().unwrap().solve(&load) * temperature;
    for softening in [0.0, SOFTENING] {
        let elastic = &rom.stiffness * (1.0 - softening * temperature);
        let turning = elastic + &spin.stiffness_speed2 * square + &spin.stiffness_speed4 * (square * square);
        let stretch = DVector::from_fn(rom.order(), |row, _| {
            square * (spin.centrifugal_load[row] + square * spin.centrifugal_load_speed4[row])
        });
        let moved = &rom.contact_map * (turning.cholesky().unwrap().solve(&stretch) + &free);
        let mut given = scene(rom.clone());
        let structure = &mut given.settings.structures[0];
        (structure.softening, structure.damping_ratio, structure.speed) = (softening, Some(0.3), speed);
        (structure.spin.growth, structure.spin.stiffening) = (true, true);
        let lanes = started(&given).system().bank().lanes();
        let expected: Vec<f64> =
            moved.iter().flat_map(|row| (0..lanes).map(move |lane| if lane < 3 { *row } else { 0.0 })).collect();
        assert!(apart(&displacements(&warm(&given, temperature)), &expected) < 1e-12);
        given.settings.structures[0].speed = 1200.0;
        let mut run = started(&given);
        for step in 1..=200 {
            let share = (0.01 * f64::from(step)).min(1.0);
            set(&mut run, "rotor_temperature", temperature * share);
            set(&mut run, "speed", 1200.0 + (speed - 1200.0) * share);
            go(&mut run, 2e-4);
        }
        let left = apart(&displacements(&run), &expected);
        assert!(left < 1e-6, "{left:e}");
        assert!(real(&run, "energy_residual_relative").abs() < 1e-10);
    }
    // An unconstrained structure has no static thermal expansion to preserve.
    let mut loose = scene(rom);
    loose.settings.structures[0].spin.stiffening = true;
    loose.roms[0].stiffness.row_mut(0).fill(0.0);
    loose.roms[0].stiffness.column_mut(0).fill(0.0);
    let refused = Simulation::new(&loose).and_then(|mut run| run.initialise(0.0)).unwrap_err().to_string();
    assert!(refused.contains("`stiffness`") && refused.contains("not positive definite"), "{refused}");
}

/// A softened blade vibrates at ω√(1 − sT): from the start, and when it is heated during the vibration, where its
/// energy changes by the work of the heat.
#[test]
fn softening_lowers_frequency_by_root_of_stiffness() {
    let (temperature, first) = (300.0, ModalModel::from_rom(&models::blade(1), 0.0).unwrap().frequencies[0]);
    let left = (1.0 - SOFTENING * temperature).sqrt();
    for (starts_warm, hold, scheme) in [
        (true, false, Scheme::ModalExact),
        (false, false, Scheme::ModalExact),
        (false, true, Scheme::ModalExact),
        (false, false, Scheme::CentralDifference),
        (false, false, Scheme::MasslessBoundary),
    ] {
        let mut given = scene(if scheme.properties().quasi_static { models::rich_blade(1) } else { models::blade(1) });
        // Nothing expands.
        given.roms[0].extras.thermal.as_mut().unwrap().loads.fill(0.0);
        let structure = &mut given.settings.structures[0];
        (structure.softening, structure.damping_ratio) = (SOFTENING, Some(0.0));
        let (mode, displacement) = (1, 1e-5);
        structure.initial =
            vec![InitialSettings { mode, sector: None, nodal_diameter: None, phase: 0.0, displacement, velocity: 0.0 }];
        (given.settings.time.scheme, given.settings.time.step) = (scheme, 5e-7);
        if hold {
            given.settings.time.input_interpolation = InputInterpolation::Hold;
        }
        let mut run = warm(&given, if starts_warm { temperature } else { 0.0 });
        for step in 1..=20 {
            if !starts_warm {
                set(&mut run, "rotor_temperature", temperature * f64::from(step) / 20.0);
            }
            go(&mut run, 1e-4);
        }
        // From the phase between two times of one mode alone.
        let q = |run: &Simulation| run.system().bank().modal_state(0, 0).0;
        let third = TAU / first / 3.0;
        let samples: Vec<f64> = (0..30)
            .map(|_| {
                go(&mut run, third);
                q(&run)
            })
            .collect();
        let (above, below) = samples.windows(3).fold((0.0, 0.0), |(above, below), three| {
            (above + 0.5 * (three[0] + three[2]) * three[1], below + three[1] * three[1])
        });
        let found = (above / below).clamp(-1.0, 1.0).acos() / third;
        let error = (found / (first * left) - 1.0).abs();
        println!("{} {starts_warm} {hold}: {error:.1e}", scheme.name());
        assert!(error < 1e-5, "{found} {}", first * left);
        assert!(real(&run, "energy_residual_relative").abs() < 1e-11);
        let work = real(&run, "stiffening_work");
        assert!(if starts_warm { work == 0.0 } else { work < 0.0 }, "{work:e}");
        // Slowly softened vibration keeps its action: its energy falls with its frequency.
        if !starts_warm {
            let energy = real(&run, "kinetic_energy") + real(&run, "strain_energy");
            let before = energy - work;
            assert!((energy / before / left - 1.0).abs() < 0.02, "{}", energy / before);
        }
    }
    assert!((left - (1.0_f64 - 0.12).sqrt()).abs() < 1e-15 && PI > 3.0);
}

/// Spin and heat together: states continue with the same bits, and a start at speed and temperature agrees with K₀(1 −
/// sT) + Ω²K₁ + Ω⁴K₂.
#[test]
fn speed_and_temperature_act_together() {
    let mut given = scene(models::blade(2));
    let order = given.roms[0].order();
    given.roms[0].extras.spin = Some(models::spin(order));
    let structure = &mut given.settings.structures[0];
    (structure.spin.stiffening, structure.spin.growth, structure.softening) = (true, true, SOFTENING);
    let mut run = warm(&given, 200.0);
    let rom = &given.roms[0];
    let (spin, speed) = (rom.extras.spin.as_ref().unwrap(), 1300.0_f64);
    let square = speed * speed;
    let stiffness = &rom.stiffness * (1.0 - SOFTENING * 200.0)
        + &spin.stiffness_speed2 * square
        + &spin.stiffness_speed4 * (square * square);
    let softer = Rom { stiffness, ..rom.clone() };
    let expected = ModalModel::from_rom(&softer, 0.0).unwrap().frequencies;
    let found = &run.system().bank().model().frequencies;
    assert!(found.iter().zip(&expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{found:?} {expected:?}");
    set(&mut run, "rotor_temperature", 260.0);
    go(&mut run, 1e-3);
    let state = saved(&run);
    let mut other = Simulation::new(&given).unwrap();
    other.restore_state(&state).unwrap();
    for temperature in [300.0, 150.0] {
        for run in [&mut run, &mut other] {
            set(run, "rotor_temperature", temperature);
            set(run, "speed", 1200.0);
            go(run, 1e-3);
        }
    }
    assert_eq!(bits(&run), bits(&other));
    assert!(real(&run, "energy_residual_relative").abs() < 1e-11);
}

#[test]
fn rejects_temperatures_that_remove_all_stiffness() {
    let mut given = scene(models::blade(1));
    given.settings.structures[0].softening = 1e-3;
    let mut run = warm(&given, 100.0);
    set(&mut run, "rotor_temperature", 950.0);
    let error = run.do_step(0.0, 1e-3).unwrap_err().to_string();
    assert!(error.starts_with("variable `rotor_temperature` at t = 0 s: 950 K with softening"), "{error}");
    let mut hot = Simulation::new(&given).unwrap();
    set(&mut hot, "rotor_temperature", 950.0);
    assert!(hot.initialise(0.0).is_err());
}

/// Returns the displacements of all blades as far as they reach without contact: `rows` of each, in the lanes of a run.
fn in_lanes(run: &Simulation, rows: &DMatrix<f64>) -> Vec<f64> {
    let (lanes, sectors) = (run.system().bank().lanes(), run.system().bank().sectors());
    rows.iter().flat_map(|row| (0..lanes).map(move |lane| if lane < sectors { *row } else { 0.0 })).collect()
}

/// α T L holds for any stiffness: mistuned blades rest at the position of the others, at the start and after heating,
/// also if speed and heat change their stiffness.
#[test]
fn mistuned_blades_expand_equally() {
    let factors = vec![0.9, 1.0, 1.1];
    for (softening, stiffening, scheme) in [
        (0.0, false, Scheme::ModalExact),
        (SOFTENING, false, Scheme::ModalExact),
        (SOFTENING, true, Scheme::ModalExact),
        (SOFTENING, false, Scheme::CentralDifference),
        (SOFTENING, true, Scheme::MasslessBoundary),
    ] {
        let mut rom = if scheme.properties().quasi_static { models::rich_blade(3) } else { models::blade(3) };
        rom.extras.spin = Some(models::spin(rom.order()));
        let load = heated(rom.clone()).extras.thermal.unwrap().loads;
        let free = &rom.contact_map * rom.stiffness.clone().cholesky().unwrap().solve(&load) * 250.0;
        let mut given = scene(rom);
        let structure = &mut given.settings.structures[0];
        (structure.frequency_factors, structure.softening) = (factors.clone(), softening);
        (structure.spin.stiffening, structure.damping_ratio) = (stiffening, Some(0.3));
        (given.settings.time.scheme, given.settings.time.step) = (scheme, 5e-7);
        let mut run = warm(&given, 250.0);
        let expected = in_lanes(&run, &free);
        let off = apart(&displacements(&run), &expected);
        assert!(off < 1e-12, "{} {softening} {stiffening}: {off:e} at the start", scheme.name());
        go(&mut run, 1e-3);
        assert!(apart(&displacements(&run), &expected) < 1e-9, "rest stays rest");
        let mut run = started(&given);
        for step in 1..=200 {
            set(&mut run, "rotor_temperature", 2.5 * f64::from(step).min(100.0));
            go(&mut run, 2e-4);
        }
        let (off, residual) = (apart(&displacements(&run), &expected), real(&run, "energy_residual_relative"));
        println!("{} {softening} {stiffening}: {off:.1e}, residual {residual:.1e}", scheme.name());
        assert!(off < 1e-6 && residual.abs() < 1e-11, "{off:e} {residual:e}");
    }
}

/// Modes that a step does not resolve, and quasi-static ones, soften like the others: the free expansion is correct at
/// any temperature, and a force moves the blade as far as its softened stiffness permits.
#[test]
fn softening_applies_to_unresolved_and_quasi_static_modes() {
    for (scheme, step) in
        [(Scheme::ModalExact, 1e-5), (Scheme::MasslessBoundary, 1e-6), (Scheme::MasslessBoundary, 4e-6)]
    {
        for stiffening in [false, true] {
            let mut rom = models::rich_blade(3);
            rom.extras.spin = Some(models::spin(rom.order()));
            let load = heated(rom.clone()).extras.thermal.unwrap().loads;
            let temperature = 300.0;
            let solved = rom.stiffness.clone().cholesky().unwrap();
            let free = &rom.contact_map * solved.solve(&load) * temperature;
            let mut given = scene(rom.clone());
            let structure = &mut given.settings.structures[0];
            (structure.softening, structure.damping_ratio) = (SOFTENING, Some(0.3));
            (structure.spin.stiffening, structure.spin.growth) = (stiffening, !stiffening);
            (given.settings.time.scheme, given.settings.time.step) = (scheme, step);
            let mut run = started(&given);
            for step in 1..=200 {
                set(&mut run, "rotor_temperature", 0.01 * temperature * f64::from(step).min(100.0));
                go(&mut run, 2e-4);
            }
            let mut moved = free.clone();
            if !stiffening {
                let spin = rom.extras.spin.as_ref().unwrap();
                let pull = DVector::from_fn(rom.order(), |row, _| 1300.0 * 1300.0 * spin.centrifugal_load[row]);
                moved += &rom.contact_map * solved.solve(&pull) / (1.0 - SOFTENING * temperature);
            }
            let off = apart(&displacements(&run), &in_lanes(&run, &moved));
            let residual = real(&run, "energy_residual_relative");
            println!("{} {step:e} {stiffening}: {off:.1e}, residual {residual:.1e}", scheme.name());
            assert!(off < 1e-6 && residual.abs() < 1e-11, "{off:e} {residual:e}");
        }
    }
}

/// The mistuning factor of a blade scales its frequencies at every temperature and speed, regardless of the start.
#[test]
fn mistuned_blades_soften_and_stiffen_by_their_own_stiffness() {
    let factor = 1.2;
    let mut rom = models::blade(2);
    rom.extras.spin = Some(models::spin(rom.order()));
    rom.extras.spin.as_mut().unwrap().stiffness_speed2 *= 20.0;
    let rings = |starts_there: bool, sector: usize| {
        let mut given = scene(rom.clone());
        given.roms[0].extras.thermal.as_mut().unwrap().loads.fill(0.0);
        let structure = &mut given.settings.structures[0];
        (structure.frequency_factors, structure.softening) = (vec![1.0, factor], SOFTENING);
        (structure.spin.stiffening, structure.damping_ratio) = (true, Some(0.0));
        structure.speed = if starts_there { 1600.0 } else { 800.0 };
        structure.initial = vec![InitialSettings {
            mode: 1,
            sector: None,
            nodal_diameter: None,
            phase: 0.0,
            displacement: 1e-5,
            velocity: 0.0,
        }];
        given.settings.time.step = 5e-7;
        let mut run = warm(&given, if starts_there { 300.0 } else { 0.0 });
        for step in 1..=20 {
            if !starts_there {
                set(&mut run, "rotor_temperature", 15.0 * f64::from(step));
                set(&mut run, "speed", 800.0 + 40.0 * f64::from(step));
            }
            go(&mut run, 1e-4);
        }
        assert!(real(&run, "energy_residual_relative").abs() < 1e-11);
        // Zero crossings of the initial mode.
        let mut crossings = Vec::new();
        let q = |run: &Simulation| run.system().bank().modal_state(0, sector).0;
        let mut before = q(&run);
        while crossings.len() < 13 {
            go(&mut run, 1e-5);
            let now = q(&run);
            if (before < 0.0) != (now < 0.0) {
                crossings.push(run.time() - 1e-5 * now / (now - before));
            }
            before = now;
        }
        6.0 / (crossings[12] - crossings[0])
    };
    let tuned = rings(true, 0);
    for starts_there in [true, false] {
        let found = rings(starts_there, 1) / tuned;
        println!("{starts_there}: {found:.5} times");
        assert!((found / factor - 1.0).abs() < 1e-3, "{found}");
        let found = rings(starts_there, 0) / tuned;
        assert!((found - 1.0).abs() < 1e-3, "{found}");
    }
}

/// A rub with changing speed and temperature, and with everything that changes stiffness or loads: the energy balance
/// closes, states continue.
#[test]
fn the_energy_balance_closes_in_a_rub_that_warms_up() {
    for scheme in [Scheme::ModalExact, Scheme::CentralDifference, Scheme::MasslessBoundary] {
        let mut rom = models::rich_blade(4);
        rom.extras.spin = Some(models::spin(rom.order()));
        let mut given = models::bumps(heated(rom));
        let structure = &mut given.settings.structures[0];
        (structure.thermal, structure.softening) = (true, SOFTENING);
        structure.frequency_factors = vec![0.97, 1.0, 1.03, 1.0];
        (structure.spin.stiffening, structure.spin.growth) = (true, true);
        structure.spin.coriolis = !scheme.properties().quasi_static;
        (given.settings.time.scheme, given.settings.time.step) = (scheme, 5e-7);
        let mut run = started(&given);
        let mut other = None;
        for step in 1..=100 {
            set(&mut run, "rotor_temperature", 1.5 * f64::from(step));
            set(&mut run, "speed", 1300.0 + f64::from(step));
            go(&mut run, 5e-5);
            if step == 50 {
                let mut copy = Simulation::new(&given).unwrap();
                copy.restore_state(&saved(&run)).unwrap();
                other = Some(copy);
            } else if let Some(other) = &mut other {
                set(other, "rotor_temperature", 1.5 * f64::from(step));
                set(other, "speed", 1300.0 + f64::from(step));
                go(other, 5e-5);
            }
        }
        let residual = real(&run, "energy_residual_relative");
        let heat = real(&run, "friction_loss");
        println!("{}: {heat:.1} J, residual {residual:.1e}", scheme.name());
        assert!(heat > 0.1 && residual.abs() < 1e-10, "{heat} J, {residual:e}");
        assert_eq!(bits(&run), bits(&other.unwrap()), "{}", scheme.name());
    }
}
