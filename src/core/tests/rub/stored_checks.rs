//! Stored results of slow checks give bitwise the same findings, and are used only for the same scene and parameters.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::persist::fingerprint;
use tiprub_cosim::variables::Value;
use tiprub_test_models::{self as models, coating, disk, flexible, reference};

/// Scenes with friction: blades in a rigid casing, in an elastic ring and against a coating, and a bladed disk.
fn scenes() -> Vec<(&'static str, Scene)> {
    let rotor = |change: fn(&mut Scene)| {
        let mut scene = models::rub(4);
        scene.settings.contacts[0].friction = 0.3;
        change(&mut scene);
        scene
    };
    let mut coupled = disk::with_rotor(disk::TestDisk::random(6, 2, 9, 0.25, 5).cyclic());
    coupled.settings.contacts[0].solver = Solver::Lcp;
    coupled.settings.contacts[0].friction = 0.05;
    vec![
        ("rigid casing", rotor(|_| {})),
        ("elastic ring", rotor(flexible)),
        ("coating", rotor(coating)),
        ("coupled sectors", coupled),
    ]
}

/// Results of all checks as bytes, and the findings as text.
type Found = (Vec<u8>, String);

/// Starts a scene with stored results and replaced parameters.
fn start(scene: &Scene, checks: &[u8], set: &[(&str, f64)]) -> Found {
    let mut simulation = Simulation::new(scene).unwrap();
    simulation.use_checks(checks);
    for (name, value) in set {
        replace(&mut simulation, name, *value);
    }
    simulation.initialise(0.0).unwrap();
    found(&simulation)
}

fn found(simulation: &Simulation) -> Found {
    (simulation.checks(), format!("{:?} {:?}", simulation.warnings(), simulation.if_reversed()))
}

fn replace(simulation: &mut Simulation, name: &str, value: f64) {
    let reference = reference(simulation, name);
    if simulation.set(reference, Value::Real(value)).is_err() {
        // An item of an enumeration.
        let item = (1_i32..9).find(|item| (f64::from(*item) - value).abs() < 0.5).unwrap();
        simulation.set(reference, Value::Integer(item.into())).unwrap();
    }
}

/// Writes the correct checksum at the end.
fn sealed(mut checks: Vec<u8>) -> Vec<u8> {
    let end = checks.len() - 8;
    let checksum = fingerprint(&checks[..end], 0);
    checks[end..].copy_from_slice(&checksum.to_le_bytes());
    checks
}

/// Changes one bit of each result and keeps its key, so that a test sees whether the results are used.
fn altered(checks: &[u8]) -> Vec<u8> {
    let word = |place: usize| u64::from_le_bytes(checks[place..][..8].try_into().unwrap());
    let (mut altered, mut place) = (checks.to_vec(), 16);
    while place + 8 < checks.len() {
        let length = usize::try_from(word(place + 16)).unwrap();
        place += 24;
        altered[place..][..length.min(1)].iter_mut().for_each(|byte| *byte ^= 1);
        place += length;
    }
    sealed(altered)
}

#[test]
fn stored_checks_give_the_same_findings_to_the_bit() {
    for (name, scene) in scenes() {
        let first = start(&scene, &[], &[]);
        assert!(first.0.len() > 200, "{name}: {}", first.0.len());
        assert_eq!(start(&scene, &first.0, &[]), first, "{name}");
        // A start keeps altered results with the same keys, so it computes nothing.
        let other = altered(&first.0);
        assert!(other != first.0 && start(&scene, &other, &[]).0 == other, "{name}");
    }
}

/// The keys contain every parameter that affects the checks: altered results of other parameters have no effect.
#[test]
fn changed_parameters_are_checked_again() {
    let central = Scheme::ALL.iter().position(|scheme| *scheme == Scheme::CentralDifference).unwrap() + 1;
    for (name, scene) in scenes() {
        let stored = altered(&start(&scene, &[], &[]).0);
        for set in [
            ("friction_coefficient", 0.04),
            ("damping_ratio", 0.011),
            ("internal_step_max", 0.9e-7),
            ("scheme", central as f64),
        ] {
            // Central differences need short steps.
            let set = [set, ("internal_step_max", set.1.min(1e-7))];
            assert_eq!(start(&scene, &stored, &set), start(&scene, &[], &set), "{name}: {set:?}");
        }
        let mut running = [&stored[..], &[]].map(|checks| {
            let mut simulation = Simulation::new(&scene).unwrap();
            simulation.use_checks(checks);
            replace(&mut simulation, "damping_ratio", 0.012);
            simulation.initialise(0.0).unwrap();
            replace(&mut simulation, "friction_coefficient", 0.03);
            found(&simulation)
        });
        assert_eq!(std::mem::take(&mut running[0]), running[1], "{name}: friction between steps");
    }
}

#[test]
fn merged_checks_serve_all_their_parameters() {
    for (name, scene) in scenes() {
        let frictions = [0.02, 0.03].map(|friction| [("friction_coefficient", friction)]);
        let [one, other] = frictions.map(|set| altered(&start(&scene, &[], &set).0));
        let merged = Simulation::merge_checks(&one, &other, usize::MAX);
        for (set, stored) in frictions.iter().zip([&one, &other]) {
            assert_eq!(start(&scene, &merged, set).0, *stored, "{name}: nothing is computed");
        }
        // The newest results stay, and they replace older ones with the same keys.
        let plain = start(&scene, &[], &frictions[0]).0;
        for older in [&other[..], &plain, &[], b"damaged"] {
            assert_eq!(Simulation::merge_checks(&one, older, 0), one, "{name}");
        }
        assert_eq!(Simulation::merge_checks(&one, &plain, usize::MAX), one, "{name}");
        assert_eq!(Simulation::merge_checks(&[], &merged, usize::MAX), merged, "{name}");
        let fewer = Simulation::merge_checks(&[], &merged, 1);
        assert!(!fewer.is_empty() && fewer.len() < one.len(), "{name}: {}", fewer.len());
    }
}

#[test]
fn adaptive_steps_use_checks_of_their_tolerance_only() {
    let mut scene = models::rub(4);
    scene.roms[0] = models::rich_blade(4);
    scene.settings.contacts[0].friction = 0.3;
    scene.settings.contacts[0].solver = Solver::Lcp;
    scene.settings.time.scheme = Scheme::ADAPTIVE;
    let first = start(&scene, &[], &[]);
    let stored = altered(&first.0);
    assert_eq!(start(&scene, &stored, &[]).0, stored);
    let set = [("tolerance", 2e-4)];
    assert_eq!(start(&scene, &stored, &set), start(&scene, &[], &set));
}

#[test]
fn checks_of_another_model_or_geometry_are_not_used() {
    let (_, scene) = scenes().remove(1);
    let stored = altered(&start(&scene, &[], &[]).0);
    let changes: [fn(&mut Scene); 5] = [
        |scene| scene.roms[0].stiffness *= 1.0 + f64::EPSILON,
        |scene| scene.roms[1].mass *= 1.0 + f64::EPSILON,
        |scene| scene.roms[0].contact_nodes[0].meridional_slope += 1e-3,
        |scene| scene.settings.contacts[0].gap *= 1.5,
        |scene| scene.settings.experiment.communication_step *= 1.5,
    ];
    for change in changes {
        let mut other = scene.clone();
        change(&mut other);
        assert_eq!(start(&other, &stored, &[]), start(&other, &[], &[]));
    }
    // Accepted values and silenced warnings do not change the checks.
    let mut silent = scene;
    silent.settings.accept_implausible = true;
    assert_eq!(start(&silent, &stored, &[]).0, stored);
}

#[test]
fn damaged_checks_are_computed_again() {
    let (_, scene) = scenes().remove(0);
    let first = start(&scene, &[], &[]);
    let stored = altered(&first.0);
    let mut damaged = vec![stored[..stored.len() / 2].to_vec(), stored[..stored.len() - 8].to_vec(), vec![1; 7]];
    for index in (0..stored.len()).step_by(stored.len() / 19) {
        damaged.push(stored.clone());
        damaged.last_mut().unwrap()[index] ^= 1;
    }
    // The last two have a correct checksum. One lacks its last bytes, and the other comes from another version.
    damaged.push(sealed(stored[..stored.len() - 16].to_vec()));
    damaged.push(stored.clone());
    damaged.last_mut().unwrap()[8] ^= 1;
    let last = damaged.pop().unwrap();
    damaged.push(sealed(last));
    for bytes in damaged {
        assert_eq!(start(&scene, &bytes, &[]), first);
    }
}
