//! Blades that move at the start, and modes with individual damping, against closed forms of free vibration.

use std::f64::consts::TAU;

use tiprub_core::modes::cyclic::CyclicModel;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::InitialSettings;
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_test_models::{self as models, disk::TestDisk, go, real, set_element, started};

const NONE: InitialSettings =
    InitialSettings { mode: 1, sector: None, nodal_diameter: None, phase: 0.0, displacement: 0.0, velocity: 0.0 };

/// Returns a rotor far from its casing.
fn scene(rom: Rom, scheme: Scheme, initial: Vec<InitialSettings>) -> Scene {
    let mut scene = models::round(rom);
    let structure = &mut scene.settings.structures[0];
    (structure.initial, structure.damping_ratio) = (initial, Some(0.02));
    scene.settings.contacts[0].gap = 5e-3;
    (scene.settings.time.scheme, scene.settings.time.step) = (scheme, 1e-6);
    scene
}

/// Returns q(t)/q₀ and q(t)/v₀ of free vibration.
fn free(frequency: f64, ratio: f64, time: f64) -> [f64; 2] {
    let damped = frequency * (1.0 - ratio * ratio).sqrt();
    let (sine, cosine) = (damped * time).sin_cos();
    let left = (-ratio * frequency * time).exp();
    [left * (cosine + ratio * frequency / damped * sine), left * sine / damped]
}

fn most(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most: f64, value| if value.abs() > most.abs() { value } else { most })
}

/// Two modes of all blades in patterns, and one mode of one blade: each continues as free vibration to rounding,
/// regardless of the first step.
#[test]
fn initial_motion_continues_as_free_vibration() {
    for scheme in [Scheme::ModalExact, Scheme::MasslessBoundary, Scheme::Galerkin, Scheme::CentralDifference] {
        let rom = if scheme.properties().quasi_static { models::rich_blade(6) } else { models::blade(6) };
        let model = ModalModel::from_rom(&rom, 0.02).unwrap();
        let initial = vec![
            InitialSettings { nodal_diameter: Some(2), phase: 0.4, displacement: 3e-5, velocity: 0.2, ..NONE },
            InitialSettings { mode: 3, sector: Some(4), displacement: -2e-6, velocity: 0.05, ..NONE },
        ];
        let mut run = started(&scene(rom, scheme, initial));
        let start = |s: usize| {
            let pattern = (TAU * 2.0 * s as f64 / 6.0 - 0.4).cos();
            let of_third = if s == 3 { [-2e-6, 0.05] } else { [0.0; 2] };
            [(0, [3e-5 * pattern, 0.2 * pattern]), (2, of_third)]
        };
        let size = |mode: usize| most(model.contact_modes.column(mode).iter().copied());
        let energy: f64 = (0..6)
            .flat_map(start)
            .map(|(mode, [d, v])| 0.5 * ((v / size(mode)).powi(2) + (model.frequencies[mode] * d / size(mode)).powi(2)))
            .sum();
        let reported = real(&run, "kinetic_energy") + real(&run, "strain_energy");
        let tolerance = if scheme == Scheme::CentralDifference { 1e-3 } else { 1e-11 };
        assert!((reported / energy - 1.0).abs() < tolerance, "{scheme:?}: {reported:e} J, {energy:e} J");
        let (mut off, mut largest) = (0.0_f64, 0.0_f64);
        for _ in 0..60 {
            // Not the step used at initialisation.
            go(&mut run, 3.3e-5);
            for s in 0..6 {
                for row in 0..9 {
                    let expected: f64 = start(s)
                        .into_iter()
                        .map(|(mode, [d, v])| {
                            let [of_d, of_v] = free(model.frequencies[mode], 0.02, run.time());
                            model.contact_modes[(row, mode)] / size(mode) * (d * of_d + v * of_v)
                        })
                        .sum();
                    off = off.max((run.system().bank().row(row, s) - expected).abs());
                    largest = largest.max(expected.abs());
                }
            }
        }
        println!("{}: {:.1e}", scheme.name(), off / largest);
        let tolerance = if scheme == Scheme::CentralDifference { 2e-4 } else { 1e-10 };
        assert!(off < tolerance * largest, "{scheme:?}: {:e}", off / largest);
        assert!(real(&run, "energy_residual_relative").abs() < 1e-10, "{scheme:?}");
    }
}

#[test]
fn initial_nodal_diameter_decays_without_exciting_others() {
    for scheme in [Scheme::ModalExact, Scheme::Galerkin] {
        let rom = TestDisk::random(6, 1, 7, 0.2, 3).cyclic();
        let model = CyclicModel::from_rom(&rom, 0.02).unwrap();
        for (n, phase) in [(0, 0.0), (1, 1.1), (2, 0.3), (3, 0.0)] {
            let one =
                InitialSettings { nodal_diameter: Some(n), phase, displacement: 4e-6, velocity: 0.03, mode: 2, ..NONE };
            let mut run = started(&scene(rom.clone(), scheme, vec![one]));
            let diameter = &model.diameters[n];
            let sizes = diameter.contact_modes.column(1).iter().map(|value| value.norm_sqr()).collect::<Vec<_>>();
            let row = (0..3).max_by(|a, b| sizes[*a].total_cmp(&sizes[*b])).unwrap();
            for _ in 0..40 {
                go(&mut run, 2.7e-5);
                let [of_d, of_v] = free(diameter.frequencies[1], 0.02, run.time());
                for s in 0..6 {
                    let pattern = (TAU * (n * s) as f64 / 6.0 - phase).cos();
                    let expected = pattern * (4e-6 * of_d + 0.03 * of_v);
                    let found = run.system().bank().row(row, s);
                    assert!((found - expected).abs() < 1e-15, "{scheme:?}, {n}: {found:e} {expected:e}");
                }
            }
            let others = (0..=3).filter(|other| *other != n);
            let disk = run.system().bank();
            assert!(others.map(|n| disk.group_energies(n, (0.0, 0.0))).all(|energies| energies == (0.0, 0.0)));
        }
    }
}

/// Logarithmic decrement of each mode, with individual or common damping ratio, for uncoupled and coupled sectors.
#[test]
fn every_mode_decays_at_its_damping_ratio() {
    let ratios = [0.003, 0.05];
    for rom in [models::blade(4), TestDisk::random(4, 1, 5, 0.2, 3).cyclic()] {
        for (mode, ratio) in [(1, ratios[0]), (2, ratios[1]), (3, 0.02)] {
            let one = InitialSettings { mode, displacement: 1e-6, ..NONE };
            let mut scene = scene(rom.clone(), Scheme::ModalExact, vec![one]);
            scene.settings.structures[0].damping_ratios = ratios.to_vec();
            let frequency = if rom.is_cyclic() {
                CyclicModel::from_rom(&rom, 0.0).unwrap().diameters[0].frequencies[mode - 1]
            } else {
                ModalModel::from_rom(&rom, 0.0).unwrap().frequencies[mode - 1]
            };
            let mut run = started(&scene);
            let period = TAU / (frequency * (1.0_f64 - ratio * ratio).sqrt());
            let at = |run: &Simulation| most((0..3).map(|row| run.system().bank().row(row, 0)));
            let first = at(&run);
            (0..5).for_each(|_| go(&mut run, period));
            let decrement = (first / at(&run)).ln() / 5.0;
            let expected = TAU * ratio / (1.0_f64 - ratio * ratio).sqrt();
            assert!((decrement / expected - 1.0).abs() < 1e-8, "mode {mode}: {decrement} {expected}");
            assert!(real(&run, "energy_residual_relative").abs() < 1e-11);
        }
    }
}

#[test]
fn starts_and_ratios_are_checked_parameters() {
    let one = InitialSettings { displacement: 1e-6, ..NONE };
    let given = scene(models::blade(4), Scheme::ModalExact, vec![one]);
    let mut run = Simulation::new(&given).unwrap();
    set_element(&mut run, "initial_displacement", 0, 2e-6);
    run.initialise(0.0).unwrap();
    let most_moved = most((0..9).map(|row| run.system().bank().row(row, 0)));
    assert!((most_moved - 2e-6).abs() < 1e-20, "{most_moved:e}");
    // Every other blade towards the casing.
    let mut narrow = given.clone();
    narrow.settings.contacts[0].gap = 1e-6;
    narrow.settings.structures[0].initial[0].nodal_diameter = Some(2);
    let mut inside = Simulation::new(&narrow).unwrap();
    set_element(&mut inside, "initial_displacement", 0, 1e-4);
    let error = inside.initialise(0.0).unwrap_err().to_string();
    assert!(error.contains("contact nodes start inside the casing"), "{error}");
    assert!(!error.contains("depth of -"), "{error}");
    let reported = |change: fn(&mut Scene)| {
        let mut scene = given.clone();
        change(&mut scene);
        let refused = Simulation::new(&scene).and_then(|mut run| run.initialise(0.0));
        refused.unwrap_err().to_string()
    };
    for (beginning, change) in [
        (
            "structure[1].initial[1].mode: mode 9",
            (|scene| scene.settings.structures[0].initial[0].mode = 9) as fn(&mut Scene),
        ),
        ("structure[1].initial[1].sector: sector 5, but the ROM has only 4 sectors", |scene| {
            scene.settings.structures[0].initial[0].sector = Some(5);
        }),
        ("structure[1].initial[1].nodal_diameter: 3", |scene| {
            scene.settings.structures[0].initial[0].nodal_diameter = Some(3);
        }),
        ("structure[1].initial[1].sector: cannot be combined", |scene| {
            let one = &mut scene.settings.structures[0].initial[0];
            (one.sector, one.nodal_diameter) = (Some(1), Some(1));
        }),
        ("structure[1].damping_ratios: 9 values", |scene| {
            scene.settings.structures[0].damping_ratios = vec![0.01; 9];
        }),
        ("structure[1].damping_ratios[2]", |scene| scene.settings.structures[0].damping_ratios = vec![0.01, 1.5]),
    ] {
        let found = reported(change);
        assert!(found.starts_with(beginning), "{found}");
    }
    let mut massless =
        scene(models::rich_blade(4), Scheme::MasslessBoundary, vec![InitialSettings { mode: 12, ..one }]);
    massless.settings.time.step = 5e-7;
    let error = Simulation::new(&massless).unwrap().initialise(0.0).unwrap_err().to_string();
    assert!(error.starts_with("structure[1].initial[1].mode: mode 12, but `rotor` has only 9"), "{error}");
}
