//! All features that a disk of coupled sectors supports: against uncoupled sectors in the limit, the ledger, states,
//! errors.

use crate::checks::{allocates_nothing, disturb, ledger_closes, state_continues};
use nalgebra::Complex;
use proptest::prelude::*;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::{Harmonic, Rom};
use tiprub_core::scene::settings::{LoadSettings, PatchSettings, Shape, SplineSettings};
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_test_models::{
    self as models, coating,
    disk::{TestDisk, with_rotor},
    flexible, go, real, started, try_started,
};

const SCHEMES: [Scheme; Scheme::RECURRENCES.len()] = Scheme::RECURRENCES;

type Feature = (&'static str, fn(&mut Scene));

fn growing(scene: &mut Scene) {
    let order = scene.roms[0].order();
    let mut spin = models::spin(order);
    spin.centrifugal_load.iter_mut().for_each(|load| *load *= scene.roms[0].mass[(0, 0)]);
    scene.roms[0].extras.spin = Some(spin);
    scene.settings.structures[0].spin.growth = true;
}

const FEATURES: [Feature; 9] = [
    ("plain", |_| {}),
    ("no friction", |scene| scene.settings.contacts[0].friction = 0.0),
    ("undamped", |scene| scene.settings.structures[0].damping_ratio = Some(0.0)),
    ("growth", growing),
    ("whirl and shift", |scene| {
        scene.settings.structures[0].whirl = true;
        scene.settings.structures[0].axial_shift = true;
    }),
    ("spline", |scene| scene.settings.surfaces[0].spline = Some(SplineSettings::default())),
    ("flexible casing", flexible),
    ("coating", coating),
    ("all together", |scene| {
        flexible(scene);
        coating(scene);
        growing(scene);
        scene.settings.structures[0].whirl = true;
        scene.settings.structures[1].thermal = true;
        scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 3e3, phase: 0.2 });
    }),
];

/// Returns whether the scene is rejected, as documented.
fn is_refused(scene: &Scene) -> bool {
    let (contact, scheme) = (&scene.settings.contacts[0], scene.settings.time.scheme);
    let solver = contact.solver.properties();
    (contact.coating.is_some() && !solver.solves_coatings)
        || (!solver.complementary && scheme == Scheme::MasslessBoundary)
}

fn scene_with(rom: Rom, feature: Feature, scheme: Scheme, solver: Solver) -> Scene {
    let mut scene = with_rotor(rom);
    scene.settings.time.scheme = scheme;
    scene.settings.contacts[0].solver = solver;
    scene.settings.surfaces[0].patches = Some(PatchSettings { around: 8, along: 2 });
    feature.1(&mut scene);
    scene
}

/// Writes uncoupled sectors as coupled ones: every nodal diameter has the same matrices.
fn without_coupling(rom: &Rom) -> Rom {
    let complex = |matrix: &nalgebra::DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    let mut rom = rom.clone();
    let harmonic = Harmonic {
        mass: complex(&rom.mass),
        stiffness: complex(&rom.stiffness),
        contact_map: complex(&rom.contact_map),
    };
    rom.extras.harmonics = vec![harmonic; rom.sectors / 2];
    rom
}

#[test]
fn uncoupled_disk_equals_independent_sectors() {
    println!(
        "| feature | scheme | solver | N | contact steps | displacement | energies |\n|---|---|---|---|---|---|---|"
    );
    let mut worst = 0.0_f64;
    for feature in FEATURES {
        for scheme in SCHEMES {
            for (solver, sectors) in Solver::ALL.into_iter().zip([12, 7].into_iter().cycle()) {
                let rom = models::rich_blade(sectors);
                let both = [without_coupling(&rom), rom];
                let scenes = both.map(|rom| {
                    let mut scene = scene_with(rom, feature, scheme, solver);
                    scene.settings.structures[0].damping_ratio =
                        scene.settings.structures[0].damping_ratio.or(Some(0.1));
                    scene
                });
                if is_refused(&scenes[0]) {
                    continue;
                }
                let mut both = scenes.each_ref().map(started);
                let (mut apart, mut size, mut contact) = (0.0_f64, 0.0_f64, 0);
                for index in 0..24 {
                    for simulation in &mut both {
                        disturb(simulation, index);
                        let (time, step) = (simulation.time(), if index % 7 == 0 { 6.3e-5 } else { 5e-5 });
                        simulation.do_step(time, step).unwrap();
                    }
                    let [disk, sectors] = &both;
                    let displacements = [disk, sectors].map(|simulation| simulation.system().bank().displacement());
                    for (a, b) in displacements[0].iter().zip(displacements[1]) {
                        apart = apart.max((a - b).abs());
                        size = size.max(b.abs());
                    }
                    contact += disk.system().events().len();
                }
                let energy = |name: &str| {
                    let [a, b] = both.each_ref().map(|simulation| real(simulation, name));
                    (a - b).abs() / b.abs().max(1e-12)
                };
                let energies = energy("kinetic_energy").max(energy("strain_energy")).max(energy("impact_loss"));
                println!(
                    "| {} | {scheme:?} | {solver:?} | {sectors} | {contact} | {:.1e} | {energies:.1e} |",
                    feature.0,
                    apart / size
                );
                assert!(contact > 0, "{} {scheme:?} {solver:?} never touched", feature.0);
                assert!(apart / size <= 1e-11, "{} {scheme:?} {solver:?}: {:e}", feature.0, apart / size);
                worst = worst.max(apart / size);
            }
        }
    }
    println!("worst {worst:.1e}");
}

/// Uncoupled blades, on a ring that yields as they do, have the same largest step when they are written as a disk.
#[test]
fn uncoupled_disk_has_the_step_limit_of_its_sectors() {
    let rom = models::rich_blade(12);
    let named = [without_coupling(&rom), rom].map(|rom| {
        let mut scene = scene_with(rom, ("flexible casing", flexible), Scheme::MasslessBoundary, Solver::Lcp);
        scene.settings.contacts[0].friction = 0.0;
        scene.roms[1].contact_map *= 30.0;
        (scene.settings.time.step, scene.settings.experiment.communication_step) = (1e-5, 1e-5);
        let reported = try_started(&scene).unwrap_err().to_string();
        let step = reported.split("`internal_step_max`) below ").nth(1).and_then(|text| text.split(' ').next());
        step.and_then(|step| step.parse::<f64>().ok()).unwrap_or_else(|| panic!("{reported}"))
    });
    assert!((named[0] / named[1] - 1.0).abs() < 1e-6, "{named:?}");
}

/// Runs `check` on every accepted combination, with its name.
fn every_combination(mut check: impl FnMut(&str, Scene)) {
    let disk = TestDisk::random(7, 2, 9, 0.25, 5);
    for feature in FEATURES {
        for (scheme, solver) in SCHEMES.into_iter().flat_map(|scheme| Solver::ALL.map(|solver| (scheme, solver))) {
            let name = format!("{} | {scheme:?} | {solver:?}", feature.0);
            let scene = scene_with(disk.cyclic(), feature, scheme, solver);
            if is_refused(&scene) {
                assert!(try_started(&scene).is_err(), "{name} was not refused");
            } else {
                check(&name, scene);
            }
        }
    }
}

#[test]
fn energy_balance_closes_for_every_combination() {
    every_combination(|name, scene| ledger_closes(name, started(&scene), 1e-12));
}

#[test]
fn a_saved_state_continues_with_identical_bits() {
    every_combination(|name, scene| {
        let solver = if name.starts_with("flexible casing") { Solver::Coulomb } else { Solver::Lcp };
        if scene.settings.contacts[0].solver == solver {
            state_continues(name, &|| started(&scene));
        }
    });
}

#[test]
fn a_step_allocates_nothing() {
    every_combination(|name, scene| {
        if scene.settings.contacts[0].solver == Solver::Lcp {
            allocates_nothing(name, started(&scene));
        }
    });
}

#[test]
fn rotating_the_casing_by_sectors_rotates_the_response() {
    for (sectors, shift) in [(5, 2), (8, 3), (2, 1), (56, 11)] {
        let disk = TestDisk::random(sectors, 1, 5, 0.2, 11);
        let run = |shift: usize| {
            let mut scene = scene_with(disk.cyclic(), ("plain", |_| {}), Scheme::ModalExact, Solver::Lcp);
            let phase = std::f64::consts::TAU * shift as f64 / sectors as f64;
            scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 6e-4, order: 1, phase };
            scene.settings.structures[0].damping_ratio = Some(0.1);
            let mut simulation = started(&scene);
            let mut contact = 0;
            while simulation.time() < 2e-3 {
                go(&mut simulation, 5e-5);
                contact += simulation.system().events().len();
            }
            assert!(contact > 0);
            simulation
        };
        let (first, second) = (run(0), run(shift));
        let (mut apart, mut size) = (0.0_f64, 0.0_f64);
        for sector in 0..sectors {
            for row in 0..3 {
                let moved = first.system().bank().row(row, sector);
                apart = apart.max((moved - second.system().bank().row(row, (sector + shift) % sectors)).abs());
                size = size.max(moved.abs());
            }
        }
        println!("N = {sectors}, turned by {shift}: {:.1e}", apart / size);
        assert!(apart / size < 1e-10, "N = {sectors}: {:e}", apart / size);
    }
}

#[test]
fn reading_outputs_within_a_step_changes_nothing() {
    let disk = TestDisk::random(6, 1, 5, 0.25, 5);
    let run = |look: bool| {
        let mut simulation = started(&scene_with(disk.cyclic(), FEATURES[0], Scheme::ModalExact, Solver::Lcp));
        for _ in 0..60 {
            simulation.begin_step(simulation.time(), 5e-5).unwrap();
            while !simulation.advance().unwrap().finished {
                if look {
                    simulation.update_outputs().unwrap();
                }
            }
        }
        simulation.system().bank().displacement().iter().map(|value| value.to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(run(false), run(true));
}

#[test]
fn a_change_of_step_keeps_the_order_of_the_scheme() {
    // Free vibration of all nodal diameters after the casing has moved away: modal-exact is exact at every step size.
    let disk = TestDisk::random(7, 1, 5, 0.25, 5);
    let run = |steps: &[f64]| {
        let mut scene = scene_with(disk.cyclic(), FEATURES[0], Scheme::ModalExact, Solver::Lcp);
        scene.settings.contacts[0].gap = 5e-3;
        scene.settings.contacts[0].friction = 0.0;
        scene.settings.surfaces[0].shape = Shape::Circular {};
        scene.settings.time.step = 2e-5;
        let mut system = started(&scene).system().clone();
        system.set_step(2e-6);
        let bank = system.bank_mut();
        for n in 0..4 {
            for mode in 0..5 {
                let amplitude = 1e-5 / (1.0 + mode as f64 + n as f64);
                bank.set_amplitude(mode, n, [amplitude, -0.5 * amplitude], [0.1 * amplitude, 0.0]);
            }
        }
        let drive = tiprub_core::geometry::PrescribedMotion { speed: 1300.0, ..Default::default() };
        system.start(&[drive]);
        for step in steps {
            system.set_step(*step);
            Recurrence.step(&mut system, &[drive]).unwrap();
        }
        system.bank().displacement().to_vec()
    };
    let even = run(&[2e-6; 101]);
    let changes = (0..40).map(|i| if i % 4 < 2 { 1e-6 } else { 9e-6 });
    let mixed: Vec<f64> = std::iter::once(2e-6).chain(changes).collect();
    assert!((mixed.iter().sum::<f64>() - 2.02e-4).abs() < 1e-18);
    let other = run(&mixed);
    let size = even.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let apart = even.iter().zip(&other).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    println!("steps changed 40 times: {:.1e}", apart / size);
    assert!(size > 1e-6 && apart / size < 1e-11, "{:e}", apart / size);
}

#[test]
fn rejects_features_unsupported_for_coupled_sectors() {
    let disk = TestDisk::random(6, 1, 5, 0.2, 3);
    let refusal = |change: fn(&mut Scene)| {
        let mut scene = scene_with(disk.cyclic(), FEATURES[0], Scheme::ModalExact, Solver::Lcp);
        change(&mut scene);
        let started = Simulation::new(&scene).and_then(|mut simulation| simulation.initialise(0.0));
        started.err().map_or_else(|| "accepted".to_owned(), |error| error.to_string())
    };
    let cases: [Feature; 5] = [
        ("structure[1].frequency_factors", |scene| scene.settings.structures[0].frequency_factors = vec![1.0; 6]),
        ("structure[1].spin.stiffening", |scene| {
            scene.roms[0].extras.spin = Some(models::spin(5));
            scene.settings.structures[0].spin.stiffening = true;
        }),
        ("structure[1].spin.coriolis", |scene| {
            scene.roms[0].extras.spin = Some(models::spin(5));
            scene.settings.structures[0].spin.coriolis = true;
        }),
        ("µ below", |scene| {
            // Tips that move into the casing when friction pushes them backwards.
            let harmonics = &mut scene.roms[0].extras.harmonics;
            let map = &mut harmonics[1].contact_map;
            for mode in 0..map.ncols() {
                let radial = map[(0, mode)];
                map[(1, mode)] += radial * Complex::new(3.0, 0.5);
            }
            scene.settings.contacts[0].friction = 2.0;
        }),
        ("ω_max·h", |scene| {
            scene.settings.time.scheme = Scheme::CentralDifference;
            scene.settings.time.step = 1e-3;
            scene.settings.experiment.communication_step = 1e-3;
        }),
    ];
    for (expected, change) in cases {
        let message = refusal(change);
        println!("{message}");
        assert!(message.contains(expected), "{expected}: {message}");
    }
}

/// An array, and the change made to it.
type Damage = (&'static str, fn(&mut Rom));

#[test]
fn rejects_invalid_harmonics_by_name() {
    let disk = TestDisk::random(6, 1, 5, 0.2, 3);
    let refusal = |change: fn(&mut Rom)| {
        let mut rom = disk.cyclic();
        change(&mut rom);
        let made = Simulation::new(scene_with(rom, FEATURES[0], Scheme::ModalExact, Solver::Lcp));
        made.err().map_or_else(|| "accepted".to_owned(), |error| error.to_string())
    };
    let cases: [Damage; 8] = [
        ("mass_1", |rom| rom.extras.harmonics[0].mass[(0, 1)].im += 1.0),
        ("stiffness_2", |rom| rom.extras.harmonics[1].stiffness[(2, 0)].re = f64::NAN),
        ("stiffness_2", |rom| rom.extras.harmonics[1].stiffness *= Complex::new(-1.0, 0.0)),
        ("stiffness_3", |rom| rom.extras.harmonics[2].stiffness *= Complex::new(-1.0, 0.0)),
        ("contact_map_2", |rom| rom.extras.harmonics[1].contact_map = nalgebra::DMatrix::zeros(3, 4)),
        ("contact_map_3", |rom| rom.extras.harmonics[2].contact_map[(0, 0)].im = 0.5),
        ("mass_2", |rom| rom.extras.harmonics[1].mass *= Complex::new(-1.0, 0.0)),
        ("harmonics", |rom| rom.extras.harmonics.truncate(2)),
    ];
    for (expected, change) in cases {
        let message = refusal(change);
        assert!(message.contains(expected), "{expected}: {message}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Random disks, frictionless and undamped: ledgers close, gaps and multipliers have the correct sign, and the
    /// response of the other sectors to a force on one is reciprocal.
    #[test]
    fn random_disks_satisfy_energy_contact_and_reciprocity(
        sectors in 2..=23_usize,
        nodes in 1..=2_usize,
        more in 1..=5_usize,
        coupling in 0.0..0.3_f64,
        seed in any::<u64>(),
    ) {
        let disk = TestDisk::random(sectors, nodes, 3 * nodes + more, coupling, seed);
        let mut scene = scene_with(disk.cyclic(), FEATURES[0], Scheme::ModalExact, Solver::Lcp);
        scene.settings.contacts[0].friction = 0.0;
        scene.settings.structures[0].damping_ratio = Some(0.0);
        let mut simulation = started(&scene);
        for _ in 0..25 {
            go(&mut simulation, 5e-5);
            let system = simulation.system();
            for (index, gap) in system.gaps().enumerate().filter(|(index, _)| index % system.bank().lanes() < sectors) {
                let multiplier = system.multiplier(index / system.bank().lanes(), index % system.bank().lanes());
                prop_assert!(*gap >= -1e-16 && multiplier >= 0.0);
                prop_assert!(multiplier == 0.0 || gap.abs() < 1e-16);
            }
        }
        prop_assert!(real(&simulation, "energy_residual_relative").abs() < 1e-11);
        let bank = simulation.system().bank().disk().unwrap();
        for difference in 0..sectors {
            for (a, b) in (0..nodes).flat_map(|a| (0..nodes).map(move |b| (a, b))) {
                let there = bank.flexibility(difference, a, b);
                let back = bank.flexibility((sectors - difference) % sectors, b, a);
                for i in 0..3 {
                    for j in 0..3 {
                        prop_assert!((there[i][j] - back[j][i]).abs() < 1e-13 * bank.flexibility(0, a, a)[0][0]);
                    }
                }
            }
        }
    }
}
