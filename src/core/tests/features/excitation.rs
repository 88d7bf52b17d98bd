//! Excitation of blades by engine orders against frequency responses, and its work against forces times displacements.

use std::f64::consts::TAU;

use nalgebra::Complex;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{ExcitationSettings, ForceDirection, InputInterpolation};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_test_models::{self as models, bits, disk::TestDisk, go, real, saved, set, started};

const AMPLITUDE: f64 = 0.4;
const PHASE: f64 = 0.7;

/// Returns a rotor without contact, excited by `order` at `speed` (rad/s).
fn scene(rom: Rom, scheme: Scheme, order: u32, speed: f64) -> Scene {
    let mut scene = models::round(rom);
    let structure = &mut scene.settings.structures[0];
    (structure.speed, structure.damping_ratio) = (speed, Some(0.05));
    let (mode, node, direction) = (Some(1), None, None);
    structure.excitation =
        Some(ExcitationSettings { order, mode, node, direction, amplitude: AMPLITUDE, phase: PHASE });
    scene.settings.contacts[0].gap = 5e-3;
    scene.settings.time.scheme = scheme;
    scene
}

/// Replaces the modal load by a force at a node.
fn at_node(scene: &mut Scene, node: &str) {
    let excitation = scene.settings.structures[0].excitation.as_mut().unwrap();
    (excitation.mode, excitation.node, excitation.direction) =
        (None, Some(node.into()), Some(ForceDirection::Tangential));
}

/// Returns the largest difference of the contact displacements from `expected` (sector, row: complex amplitude of e^(i
/// order θ_r)), relative to the largest amplitude, after transients have decayed.
fn off(simulation: &mut Simulation, order: u32, expected: impl Fn(usize, usize) -> Complex<f64>) -> f64 {
    while simulation.time() < 0.055 {
        go(simulation, 5e-4);
    }
    let (mut off, mut size) = (0.0_f64, 0.0_f64);
    for _ in 0..40 {
        go(simulation, 3.7e-5);
        let (sine, cosine) = (f64::from(order) * real(simulation, "rotor_angle")).sin_cos();
        let bank = simulation.system().bank();
        for sector in 0..bank.sectors() {
            for row in 0..bank.rows() {
                let (found, expected) = (bank.row(row, sector), expected(sector, row));
                off = off.max((found - (expected * Complex::new(cosine, sine)).re).abs());
                size = size.max(expected.norm_sqr().sqrt());
            }
        }
    }
    off / size
}

/// Returns the amplitude of a mode per unit modal force.
fn response(frequency: f64, ratio: f64, excited: f64) -> Complex<f64> {
    Complex::new(1.0, 0.0) / Complex::new(frequency * frequency - excited * excited, 2.0 * ratio * frequency * excited)
}

fn turned(angle: f64) -> Complex<f64> {
    Complex::new(angle.cos(), angle.sin())
}

/// At resonance the component with the largest mode shape responds with A/(2ζk), k = ω²/φ², a quarter of a period late.
#[test]
fn mode_at_resonance_has_the_closed_form_amplitude() {
    println!("| scheme | error of A/(2ζk) at h | at h/2 |");
    for scheme in Scheme::RECURRENCES {
        let rom = models::rich_blade(7);
        let model = ModalModel::from_rom(&rom, 0.05).unwrap();
        let (order, frequency) = (3, model.frequencies[0]);
        let shape = model.contact_modes.column(0);
        let most = shape.iter().fold(0.0, |most: f64, value| if value.abs() > most.abs() { *value } else { most });
        let stiffness = frequency * frequency / (most * most);
        let errors = [2e-6, 1e-6].map(|step| {
            let mut scene = scene(rom.clone(), scheme, order, frequency / f64::from(order));
            scene.settings.time.step = step;
            if scheme == Scheme::CentralDifference {
                scene.roms[0] = models::blade(7);
            }
            let expected = |sector: usize, row: usize| {
                let angle = TAU * f64::from(order) * sector as f64 / 7.0 - PHASE - TAU / 4.0;
                turned(angle) * (AMPLITUDE / (2.0 * 0.05 * stiffness) * shape[row] / most)
            };
            off(&mut started(&scene), order, expected)
        });
        println!("| {} | {:.1e} | {:.1e} |", scheme.name(), errors[0], errors[1]);
        // Below 1e-6 only transients remain.
        let converges = errors[0] / errors[1] > 3.0 || errors[0] < 2e-6;
        assert!(errors[1] < 5e-5 && converges, "{scheme:?}: {errors:?}");
    }
}

/// Also if the excitation turns by most of a radian in one step, near the limit: a held force would increase the
/// amplitude by 7 %.
#[test]
fn resonance_amplitude_is_correct_for_long_steps() {
    for (scheme, mode, turn) in [(Scheme::ModalExact, 4, 0.95), (Scheme::MasslessBoundary, 5, 0.3)] {
        let rom = if scheme.properties().quasi_static { models::rich_blade(5) } else { models::blade(5) };
        let model = ModalModel::from_rom(&rom, 0.05).unwrap();
        let (order, frequency) = (3, model.frequencies[mode - 1]);
        let step = turn / frequency;
        let mut scene = scene(rom, scheme, order, frequency / f64::from(order));
        scene.settings.accept_implausible = true;
        scene.settings.time.step = step;
        scene.settings.structures[0].excitation.as_mut().unwrap().mode = Some(mode);
        let shape = model.contact_modes.column(mode - 1);
        let most = shape.iter().fold(0.0, |most: f64, value| if value.abs() > most.abs() { *value } else { most });
        let size = AMPLITUDE * most.abs() / (2.0 * 0.05 * frequency * frequency);
        let mut run = started(&scene);
        (0..900).for_each(|_| go(&mut run, step));
        let mut largest = 0.0_f64;
        for _ in 0..300 {
            go(&mut run, step);
            let moved = (0..5).map(|sector| run.system().bank().modal_state(mode - 1, sector).0.abs());
            largest = moved.fold(largest, f64::max);
        }
        let error = largest / size - 1.0;
        println!("{}: {turn} rad per step, amplitude off by {error:.1e}", scheme.name());
        assert!(error.abs() < 2e-3, "{scheme:?}: {error:e}");
        assert!(real(&run, "energy_residual_relative").abs() < 1e-12);
    }
}

/// Central differences shift the resonance with the step, which no factor on the force can correct.
#[test]
fn central_differences_warn_of_excitation_on_long_steps() {
    for (turn, warned) in [(0.2, false), (0.3, true)] {
        let mut scene = scene(models::blade(3), Scheme::CentralDifference, 4, turn / 4.0 / 1e-6);
        scene.settings.accept_implausible = true;
        scene.settings.outputs.all_sectors = false;
        let mut run = started(&scene);
        go(&mut run, 2e-6);
        let notes = run.take_notes();
        let found = notes.iter().any(|text| text.contains("makes a resonance 2 % too large"));
        assert_eq!(found, warned, "{turn}: {notes:?}");
    }
}

/// A force at a contact node excites all modes, also quasi-static ones, which follow it one step late.
#[test]
fn force_at_a_node_follows_the_frequency_response() {
    for (scheme, tolerance) in
        [(Scheme::ModalExact, 1e-4), (Scheme::CentralDifference, 1e-4), (Scheme::MasslessBoundary, 2e-3)]
    {
        let rom = if scheme.properties().quasi_static { models::rich_blade(5) } else { models::blade(5) };
        let model = ModalModel::from_rom(&rom, 0.05).unwrap();
        let (order, speed, loaded) = (7, 1900.0, 4);
        let mut scene = scene(rom, scheme, order, speed);
        at_node(&mut scene, "mid_chord");
        let dynamic = model.dynamic_modes(scheme);
        let expected = |sector: usize, row: usize| {
            let excited = f64::from(order) * speed;
            let per_force: Complex<f64> = (0..model.len())
                .map(|mode| {
                    let shapes = model.contact_modes[(row, mode)] * model.contact_modes[(loaded, mode)];
                    let frequency = model.frequencies[mode];
                    let static_only = Complex::new(1.0 / (frequency * frequency), 0.0);
                    shapes * if mode < dynamic { response(frequency, 0.05, excited) } else { static_only }
                })
                .sum();
            per_force * turned(TAU * f64::from(order) * sector as f64 / 5.0 - PHASE) * AMPLITUDE
        };
        let error = off(&mut started(&scene), order, expected);
        println!("{}: {error:.1e}", scheme.name());
        assert!(error < tolerance, "{scheme:?}: {error:e}");
    }
}

/// Coupled sectors under every engine order against the whole disk as one structure, whose modes have no nodal
/// diameters.
#[test]
fn engine_order_excitation_matches_full_disk() {
    let mut worst = 0.0_f64;
    for (sectors, orders) in [(5, 0..11_u32), (6, 0..13)] {
        let disk = TestDisk::random(sectors, 1, 6, 0.2, 11);
        let whole = ModalModel::from_rom(&disk.whole(), 0.05).unwrap();
        for order in orders {
            let speed = if order == 0 { 100.0 } else { 5000.0 / f64::from(order) };
            let mut scene = scene(disk.cyclic(), Scheme::ModalExact, order, speed);
            at_node(&mut scene, "node_0_0");
            let force = |s: usize| turned(TAU * f64::from(order) * s as f64 / sectors as f64 - PHASE) * AMPLITUDE;
            // Order 0 is constant at its real part.
            let force = |s: usize| if order == 0 { Complex::new(force(s).re, 0.0) } else { force(s) };
            let modal: Vec<Complex<f64>> = (0..whole.len())
                .map(|mode| {
                    let load: Complex<f64> =
                        (0..sectors).map(|s| force(s) * whole.contact_modes[(3 * s + 1, mode)]).sum();
                    load * response(whole.frequencies[mode], 0.05, f64::from(order) * speed)
                })
                .collect();
            let expected = |sector: usize, row: usize| {
                let all = modal.iter().enumerate();
                all.map(|(mode, q)| q * whole.contact_modes[(3 * sector + row, mode)]).sum::<Complex<f64>>()
            };
            let mut run = started(&scene);
            let error = off(&mut run, order, expected);
            worst = worst.max(error);
            assert!(error < 5e-5, "{sectors} sectors, order {order}: {error:e}");
            // Only the nodal diameter of the order moves.
            let alias = order as usize % sectors;
            let excited = alias.min(sectors - alias);
            let disk = run.system().bank();
            let of = |n: usize| {
                let (kinetic, strain) = disk.group_energies(n, (0.0, 0.0));
                kinetic + strain
            };
            let others = (0..=sectors / 2).filter(|n| *n != excited).map(of).fold(0.0, f64::max);
            assert!(others == 0.0 && of(excited) > 0.0, "order {order}: {others:e} J beside {excited}");
        }
    }
    println!("largest difference of all orders: {worst:.1e} of the amplitude");
}

/// One mode family of an uncoupled disk responds like that of uncoupled sectors.
#[test]
fn family_of_an_uncoupled_disk_responds_as_one_blade() {
    let mut disk = TestDisk::random(6, 1, 6, 0.2, 5);
    disk.mass[1].fill(0.0);
    disk.stiffness[1].fill(0.0);
    let mut alone = disk.cyclic();
    alone.extras.harmonics.clear();
    for order in [1, 4, 9] {
        let moved = [alone.clone(), disk.cyclic()].map(|rom| {
            let mut run = started(&scene(rom, Scheme::ModalExact, order, 700.0));
            (0..20).for_each(|_| go(&mut run, 1e-4));
            let bank = run.system().bank();
            let places = (0..6).flat_map(|sector| (0..3).map(move |row| (row, sector)));
            places.map(|(row, sector)| bank.row(row, sector)).collect::<Vec<_>>()
        });
        let size = moved[0].iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let apart = moved[0].iter().zip(&moved[1]).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
        assert!(size > 1e-9 && apart < 1e-9 * size, "order {order}: {apart:e} of {size:e}");
    }
}

/// During a rub of the blades, the ledger contains F cos(…) at a node times its displacement, computed without modes.
#[test]
fn excitation_work_is_force_times_displacement() {
    let disk = TestDisk::random(6, 2, 10, 0.2, 3);
    for (rom, node, loaded) in [(models::rich_blade(6), "mid_chord", 4), (disk.cyclic(), "node_0_1", 4)] {
        for scheme in Scheme::RECURRENCES {
            let mut scene = models::bumps(rom.clone());
            scene.settings.surfaces[0].moving = true;
            (scene.settings.time.scheme, scene.settings.time.step) = (scheme, 5e-7);
            scene.settings.contacts[0].solver = Solver::Lcp;
            scene.settings.structures[0].damping_ratio = Some(0.02);
            let (mode, node, direction) = (None, Some(node.into()), Some(ForceDirection::Tangential));
            let excitation = ExcitationSettings { order: 5, mode, node, direction, amplitude: 3.0, phase: PHASE };
            scene.settings.structures[0].excitation = Some(excitation);
            let mut run = started(&scene);
            set(&mut run, "casing_radius_change", -1.5e-4);
            let sectors = run.system().bank().sectors();
            let row = |run: &Simulation, sector: usize| run.system().bank().row(loaded, sector);
            let amplitude = 3.0 * scheme.harmonic_factor(5.0 * 1300.0 * 5e-7);
            let force =
                |angle: f64, s: usize| amplitude * (5.0 * (angle + TAU * s as f64 / sectors as f64) - PHASE).cos();
            let (mut work, mut touched) = (0.0, 0);
            let mut before: Vec<f64> = (0..sectors).map(|s| row(&run, s)).collect();
            let mut now = before.clone();
            let mut exchanged = 0.0_f64;
            for _ in 0..5000 {
                let angle = real(&run, "rotor_angle");
                go(&mut run, 5e-7);
                for s in 0..sectors {
                    let next = row(&run, s);
                    let one = force(angle, s) * 0.5 * (next - before[s]);
                    (work, exchanged) = (work + one, exchanged + one.abs());
                    (before[s], now[s]) = (now[s], next);
                }
                touched += usize::from(!run.system().events().is_empty());
            }
            let reported = real(&run, "excitation_work");
            // Quasi-static modes use the force of the current time.
            let tolerance = if scheme.properties().quasi_static { 3e-3 } else { 1e-10 };
            let (apart, residual) = ((reported - work).abs() / exchanged, real(&run, "energy_residual_relative").abs());
            println!(
                "{}, {}: {touched} steps in contact, {reported:.6e} J, apart {apart:.1e}, residual {residual:.1e}",
                rom.name,
                scheme.name()
            );
            assert!(
                touched > 50 && reported.abs() > 1e-6 && apart < tolerance && residual < 1e-10,
                "{apart:e} {residual:e}"
            );
        }
    }
}

#[test]
fn restored_state_keeps_the_excitation_phase() {
    for rom in [models::blade(5), TestDisk::random(5, 1, 6, 0.2, 3).cyclic()] {
        let scene = scene(rom, Scheme::ModalExact, 6, 800.0);
        let mut run = started(&scene);
        for length in [5e-5, 3.1e-5, 5e-5] {
            go(&mut run, length);
        }
        let state = saved(&run);
        let mut other = Simulation::new(&scene).unwrap();
        other.restore_state(&state).unwrap();
        for length in [5e-5, 1.7e-5, 5e-5] {
            go(&mut run, length);
            go(&mut other, length);
        }
        assert_eq!(bits(&run), bits(&other));
        assert!(real(&run, "energy_residual_relative").abs() < 1e-12);
        // Another order gives another motion, both immediately and from a state.
        let mut third = Simulation::new(&scene).unwrap();
        let order = models::reference(&third, "excitation_order");
        third.set_integer(order, 2).unwrap();
        third.initialise(0.0).unwrap();
        go(&mut third, 5e-5);
        let kept = saved(&third);
        other.restore_state(&kept).unwrap();
        go(&mut other, 5e-5);
        go(&mut third, 5e-5);
        assert_eq!(bits(&other), bits(&third));
        assert_ne!(real(&third, "excitation_work").to_bits(), real(&run, "excitation_work").to_bits());
    }
}

#[test]
fn rejects_invalid_excitations() {
    let reported = |change: fn(&mut ExcitationSettings)| {
        let mut scene = scene(models::blade(3), Scheme::ModalExact, 2, 500.0);
        change(scene.settings.structures[0].excitation.as_mut().unwrap());
        Simulation::new(&scene).map(|_| ()).unwrap_err().to_string()
    };
    for (beginning, change) in [
        ("structure[1].excitation.mode: mode 9", (|it| it.mode = Some(9)) as fn(&mut ExcitationSettings)),
        ("structure[1].excitation.mode: 0", |it| it.mode = Some(0)),
        ("structure[1].excitation.mode: neither", |it| it.mode = None),
        ("structure[1].excitation.node: only one of", |it| it.node = Some("mid_chord".into())),
        ("structure[1].excitation.node: `tip` is not a contact node", |it| {
            (it.node, it.direction) = (Some("tip".into()), Some(ForceDirection::Axial));
        }),
        ("structure[1].excitation.amplitude", |it| it.amplitude = f64::NAN),
        ("structure[1].excitation.order", |it| it.order = 2_000_000),
    ] {
        let found = reported(change);
        assert!(found.starts_with(beginning), "{found}");
    }
    let mut scene = scene(models::blade(3), Scheme::ModalExact, 4000, 500.0);
    scene.settings.time.step = 1e-6;
    let error = started(&scene).do_step(0.0, 1e-6).unwrap_err().to_string();
    assert!(error.contains("`excitation_order`") && error.contains("2.000e0 rad"), "{error}");
}

/// The pattern turns with the speed and with its phase: the change of the phase counts in both directions.
#[test]
fn rejects_excessive_excitation_phase_change() {
    let mut scene = scene(models::blade(3), Scheme::ModalExact, 2, 500.0);
    scene.settings.time.step = 1e-6;
    for (turn, refused) in [(1.9, false), (2.1, true), (-1.9, false), (-2.1, true)] {
        let mut run = started(&scene);
        set(&mut run, "excitation_phase", PHASE + turn);
        let done = run.do_step(0.0, 2e-6);
        assert_eq!(done.is_err(), refused, "{turn}: {done:?}");
        // A constant phase is no rotation.
        let mut scene = scene.clone();
        scene.settings.time.input_interpolation = InputInterpolation::Hold;
        let mut run = started(&scene);
        set(&mut run, "excitation_phase", PHASE + turn);
        run.do_step(0.0, 2e-6).unwrap();
    }
}
