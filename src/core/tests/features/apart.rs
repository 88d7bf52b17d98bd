//! Structures that do not influence each other: each is checked and reported without the others.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{BodyMotion, LoadSettings, PatchSettings, Shape, StructureSettings};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation, Warning};
use tiprub_test_models::{
    RADIUS, coating_of, disk, flexible, go, lattice, modal, node, real, rich_blade, ring, ring_of, round, rub, saved,
    set, several, started, try_started,
};

/// Returns the rotors `front` and `rear`, each in a separate rigid casing.
fn two(change: impl Fn(&mut Scene)) -> Scene {
    let mut scene = rub(6);
    scene.roms[0] = rich_blade(6);
    let mut scene = several::two_rotors(scene, 0.1, |rear| rear.speed = -900.0);
    change(&mut scene);
    scene
}

/// Returns the first rotor alone.
fn alone(scene: &Scene) -> Scene {
    let mut alone = scene.clone();
    alone.settings.structures.truncate(1);
    alone.settings.surfaces.truncate(1);
    alone.settings.contacts.truncate(1);
    alone.roms.truncate(1);
    alone
}

/// For four times as many structures, a start or a step that searches all structures or pairs for each of them would
/// take 16 times as long.
#[test]
fn start_up_time_is_linear_in_the_number_of_structures() {
    let (mut elastic, mut adaptive) = (rub(2), rub(2));
    flexible(&mut elastic);
    adaptive.roms[0] = rich_blade(2);
    adaptive.settings.time.scheme = Scheme::Galerkin;
    let blocks = lattice::with(lattice::squeezed(), 0.0, Solver::Lcp, Scheme::ModalExact);
    let start = |scene: &Scene| {
        let clock = std::time::Instant::now();
        let mut simulation = started(scene);
        if scene.settings.time.scheme == Scheme::Galerkin {
            go(&mut simulation, 1e-5);
        }
        (clock.elapsed().as_secs_f64(), simulation.table().references())
    };
    for (what, scene, few) in
        [("rigid casings", rub(2), 250), ("elastic", elastic, 60), ("adaptive", adaptive, 250), ("blocks", blocks, 25)]
    {
        let scenes = [few, 4 * few].map(|count| several::copies(&scene, count));
        let ratio = |attempt: usize| {
            let [(short, _), (long, values)] = scenes.each_ref().map(start);
            println!("{what}: {values} values, {short:.4} s and {long:.4} s, attempt {attempt}");
            long / short
        };
        assert!((1..=8).any(|attempt| ratio(attempt) < 8.0), "{what}");
    }
}

/// Each value needs a name, a column and memory: no reader supports so many.
#[test]
fn rejects_too_many_output_values_by_name() {
    let mut scene = rub(4);
    scene.settings.contacts[0].coating = Some(coating_of(1.5e-4, [2000, 1000]));
    scene.settings.outputs.wear = true;
    let message = Simulation::new(&scene).unwrap_err().to_string();
    assert!(message.contains("exceeds the limit of 1000000; `wear_depth` alone has 2000000"), "{message}");
}

fn lobes(amplitude: f64, order: u32) -> Shape {
    Shape::Lobes { amplitude, order, phase: 0.0 }
}

/// Runs until an error, and returns it.
fn refused(scene: &Scene) -> (Simulation, String) {
    let mut simulation = started(scene);
    let length = scene.settings.experiment.communication_step;
    while simulation.time() < 3e-3 {
        if let Err(error) = simulation.do_step(simulation.time(), length) {
            return (simulation, error.to_string());
        }
    }
    panic!("ran to its end: {:?}", simulation.system().ledger())
}

/// Normals of the front rotor that turn too far within a step, and modes that the step does not resolve; the rear one
/// exchanges a hundred times as much energy.
#[test]
fn energy_gain_of_one_rotor_ends_the_run() {
    let rubbing = |scene: &mut Scene| {
        scene.settings.surfaces[1].shape = lobes(4.2e-4, 3);
        scene.settings.surfaces[1].ramp_time = 1e-4;
        scene.settings.contacts[0].friction = 0.0;
    };
    let curved = two(|scene| {
        rubbing(scene);
        scene.settings.surfaces[0].shape = lobes(3.6e-4, 200);
        scene.settings.experiment.communication_step = 2.4e-5;
    });
    let unresolved = two(|scene| {
        rubbing(scene);
        scene.settings.structures[0].damping_ratio = Some(0.0);
        scene.settings.surfaces[0].shape = Shape::TwoLobe { depth: 1.0, width: 0.05, phase: 0.0 };
        (scene.settings.time.step, scene.settings.experiment.communication_step) = (4e-6, 4e-6);
    });
    for (scene, word) in [(curved, "J of spurious energy"), (unresolved, "gained spurious energy")] {
        let ((single, why), (both, reported)) = (refused(&alone(&scene)), refused(&scene));
        assert!(why.contains(word) && !why.contains("of front"), "{why}");
        assert!(reported.contains(word) && reported.contains(" of front ") && !reported.contains("rear"), "{reported}");
        assert_eq!(single.time().to_bits(), both.time().to_bits(), "{why}\n{reported}");
        // Together the two are within all bounds.
        let (ledger, energy) = (both.system().ledger(), real(&both, "kinetic_energy") + real(&both, "strain_energy"));
        println!("{word}: {} J of {} J, {energy} J", ledger.curvature_work.value(), ledger.exchanged());
        assert!(ledger.curvature_work.value().abs() < 0.3 * ledger.exchanged(), "{ledger:?}");
        assert!(energy < ledger.supplied().max(0.0) + 0.01 * ledger.scale(), "{energy} J, {ledger:?}");
        // The outputs of the scene are the sum.
        let sum: f64 = both.system().ledgers().iter().map(|ledger| ledger.friction_loss.value()).sum();
        assert!(both.system().ledgers().len() == 2 && (sum / ledger.friction_loss.value() - 1.0).abs() < 1e-15);
    }
}

/// Returns two rotors in one casing, and between them, in the order of the scene, a third one in a separate casing.
fn one_between_two() -> Scene {
    let mut scene = several::in_one_casing(rub(6), Solver::Lcp, 0.15);
    let settings = &mut scene.settings;
    let mut middle = settings.structures[0].clone();
    middle.name = "middle".into();
    let (mut surface, mut contact) = (settings.surfaces[0].clone(), settings.contacts[0].clone());
    (surface.name, surface.structure) = ("middle_casing".into(), None);
    (contact.master, contact.slave) = ("middle".into(), "middle_casing".into());
    settings.structures.insert(1, middle);
    settings.surfaces.insert(1, surface);
    settings.contacts.insert(1, contact);
    scene.roms.insert(1, scene.roms[0].clone());
    // The ring is bent from the start.
    scene.settings.structures[3].load = Some(LoadSettings { order: 2, amplitude: 100.0, phase: 0.1 });
    scene
}

/// A scene of two sets continues from its state with the same bits, including ledgers and energies of the start.
#[test]
fn saved_state_contains_energies_of_every_coupled_set() {
    let all = Scheme::RECURRENCES.into_iter().flat_map(|scheme| [(scheme, two(|_| ())), (scheme, one_between_two())]);
    for (scheme, mut scene) in all.filter(|(scheme, scene)| *scheme != Scheme::MasslessBoundary || scene.roms.len() < 3)
    {
        scene.settings.time.scheme = scheme;
        scene.settings.surfaces.iter_mut().for_each(|surface| surface.ramp_time = 1e-4);
        let mut simulation = started(&scene);
        (0..20).for_each(|_| go(&mut simulation, 2.5e-5));
        assert_eq!(simulation.system().ledgers().len(), 2);
        assert!(simulation.system().ledgers().iter().all(|ledger| ledger.friction_loss.value() > 0.0), "{scheme:?}");
        let mut other = Simulation::new(&scene).unwrap();
        other.restore_state(&saved(&simulation)).unwrap();
        for one in [&mut simulation, &mut other] {
            [2.5e-5, 1.03e-5, 2.5e-5].into_iter().for_each(|length| go(one, length));
        }
        assert_eq!(saved(&simulation), saved(&other), "{scheme:?}");
        // The ledger of the scene is the sum of those of its sets, to rounding.
        let relative = real(&simulation, "energy_residual_relative").abs();
        let largest = simulation.system().ledgers().iter().map(tiprub_core::Ledger::scale).fold(0.0, f64::max);
        let residual = real(&simulation, "energy_residual").abs();
        assert!(
            relative < 1e-12 && relative + 1e-15 >= residual / (2.0 * largest),
            "{relative:e}, {residual:e} of {largest:e}"
        );
    }
}

/// A tip that touches a stiff ring, and a seal that touches a lighter one: the step of massless-boundary accounts for
/// both, in whichever order they are written.
#[test]
fn massless_limit_includes_every_casing_of_a_blade() {
    let scene = |light: f64, seal_first: bool| {
        let mut scene = rub(6);
        scene.roms[0] = rich_blade(6);
        let mut scene = several::tip_and_seal(scene, Solver::Lcp);
        scene.roms[0].contact_nodes[2].position[0] = RADIUS;
        scene.settings.time.scheme = Scheme::MasslessBoundary;
        for (surface, (name, size)) in [("tip_ring", 1.0), ("seal_ring", light)].into_iter().enumerate() {
            scene.settings.surfaces[surface].structure = Some(name.into());
            let (name, motion) = (name.to_owned(), BodyMotion::Still);
            let structure = StructureSettings { name, motion, damping_ratio: Some(0.01), ..Default::default() };
            scene.settings.structures.push(structure);
            let mut ring = ring(36, 3);
            ring.contact_map *= size;
            scene.roms.push(ring);
        }
        if seal_first {
            scene.settings.surfaces.swap(0, 1);
            scene.settings.contacts.swap(0, 1);
        }
        scene
    };
    for seal_first in [false, true] {
        assert!(try_started(&scene(10.0, seal_first)).is_ok());
        let reported = try_started(&scene(30.0, seal_first)).unwrap_err().to_string();
        assert!(reported.contains("too long for massless-boundary") && reported.contains("2.910109e-7"), "{reported}");
    }
}

/// The maximum number of contacts solved together is counted for contacts that influence each other.
#[test]
fn only_coupled_contacts_count_towards_the_limit() {
    let both = several::in_one_casing(rub(350), Solver::Lcp, 0.0);
    let reported = Simulation::new(&both).unwrap_err().to_string();
    assert!(
        reported.starts_with("surface[2].structure: 2100 coupled contact nodes") && reported.contains("`rear`"),
        "{reported}"
    );
    let mut apart = both;
    let mut second = apart.settings.structures[2].clone();
    second.name = "second".into();
    apart.settings.structures.push(second);
    apart.roms.push(ring(36, 8));
    apart.settings.surfaces[1].structure = Some("second".into());
    let simulation = Simulation::new(&apart).unwrap();
    assert_eq!(simulation.system().sets().count(), 2);
}

fn flutter(texts: &[Warning], name: &str) -> usize {
    texts.iter().filter(|text| text.starts_with(&format!("{name}: ")) && text.contains("flutter")).count()
}

/// Each rotor flutters with friction when it turns backwards; the front one starts with friction, the rear one gets it
/// later.
#[test]
fn flutter_is_reported_for_each_rotor() {
    let scene = two(|scene| {
        scene.settings.structures[0].speed = -1300.0;
        scene.settings.contacts[1].friction = 0.001;
    });
    let mut simulation = started(&scene);
    let front = flutter(simulation.warnings(), "front");
    assert!(front > 0 && flutter(simulation.warnings(), "rear") == 0, "{:?}", simulation.warnings());
    go(&mut simulation, 1e-6);
    set(&mut simulation, "front_casing.friction_coefficient", 0.001);
    assert!(simulation.take_notes().is_empty());
    set(&mut simulation, "rear_casing.friction_coefficient", 0.15);
    let reported = simulation.take_notes();
    assert!(flutter(&reported, "rear") == front && flutter(&reported, "front") == 0, "{reported:?}");
    // Only once.
    for friction in [0.001, 0.15] {
        set(&mut simulation, "rear_casing.friction_coefficient", friction);
    }
    assert!(simulation.take_notes().is_empty());
}

/// Rotors bent aside by their rub, one after the other: the error of linear gaps is reported for each.
#[test]
fn linear_gap_error_is_reported_for_each_rotor() {
    let scene = two(|scene| {
        for (surface, ramp_time) in scene.settings.surfaces.iter_mut().zip([2e-3, 4e-3]) {
            (surface.shape, surface.ramp_time) = (lobes(2e-3, 3), ramp_time);
        }
    });
    let mut simulation = started(&scene);
    let mut reported = Vec::new();
    let why = loop {
        let outcome = simulation.do_step(simulation.time(), 2e-5);
        reported.extend(simulation.take_notes());
        if let Err(error) = outcome {
            break error.to_string();
        }
        if simulation.time() > 1e-2 {
            panic!("{reported:?}")
        }
    };
    let of = |name: &str| reported.iter().filter(|text| text.contains(&format!("of {name} is displaced"))).count();
    assert!(of("front") == 1 && of("rear") == 1 && reported.len() == 2, "{reported:?}\n{why}");
}

/// The failure of a rotor is not attributed to the flutter of another one.
#[test]
fn failure_is_attributed_to_flutter_of_the_same_structure() {
    let fails = |front: f64| {
        let scene = two(|scene| {
            scene.settings.structures[0].speed = -1300.0;
            (scene.settings.surfaces[0].shape, scene.settings.surfaces[0].ramp_time) = (lobes(5e-3, 3), 2e-3);
            scene.settings.surfaces[1].shape = lobes(1e-4, 3);
            scene.settings.contacts[0].friction = front;
        });
        assert!(flutter(started(&scene).warnings(), "rear") > 0);
        refused(&scene).1
    };
    let (quiet, fluttering) = (fails(0.001), fails(0.15));
    assert!(quiet.contains("of front") && !quiet.contains("flutter") && !quiet.contains("rear"), "{quiet}");
    assert!(fluttering.contains("front: ") && fluttering.contains("flutter"), "{fluttering}");
}

/// A warning about the step is reported for each structure concerned.
#[test]
fn unresolved_modes_are_reported_for_each_structure() {
    let mut scene = two(|scene| {
        scene.settings.contacts.iter_mut().for_each(|contact| contact.friction = 0.0);
        scene.settings.time.step = 8e-6;
        scene.settings.experiment.communication_step = 1e-6;
    });
    // The highest frequency of the rear rotor is half as high.
    scene.roms[1].stiffness *= 0.25;
    let mut simulation = started(&scene);
    let reported = [1e-6, 3e-6, 6e-6].map(|length| {
        go(&mut simulation, length);
        simulation.take_notes()
    });
    let of = |texts: &[Warning], name: &str| texts.iter().filter(|text| text.starts_with(name)).count();
    assert_eq!(reported.each_ref().map(|texts| [of(texts, "front: "), of(texts, "rear: ")]), [[0, 0], [1, 0], [1, 1]]);
}

/// The radial displacement of a flexible casing is an output of rotors; the open surface of another pair has none.
#[test]
fn rejects_output_that_no_pair_provides() {
    let mut scene = lattice::squeezed();
    let rotor = rub(3);
    scene.settings.structures.extend(rotor.settings.structures);
    scene.settings.surfaces.extend(rotor.settings.surfaces);
    scene.settings.contacts.extend(rotor.settings.contacts);
    scene.settings.outputs = Default::default();
    scene.roms.extend(rotor.roms);
    Simulation::new(&scene).unwrap();
    scene.settings.outputs.slave_displacement = true;
    let reported = Simulation::new(&scene).unwrap_err().to_string();
    assert!(reported.starts_with("outputs.slave_displacement: requires"), "{reported}");
    let place = scene.settings.surfaces.len() - 1;
    scene.settings.surfaces[place].structure = Some("ring".into());
    let (name, motion) = ("ring".into(), BodyMotion::Still);
    scene.settings.structures.push(StructureSettings { name, motion, ..Default::default() });
    scene.roms.push(ring_of(36, 3, 4));
    let simulation = Simulation::new(&scene).unwrap();
    let rows = simulation.table().variables().iter().filter(|row| row.name.ends_with("casing_displacement"));
    assert_eq!(rows.map(|row| row.name.as_str()).collect::<Vec<_>>(), ["ring.casing_displacement"]);
}

/// Messages identify the item by its number or its name.
#[test]
fn messages_name_the_contact_surface_or_structure() {
    let reported = |change: fn(&mut Scene)| Simulation::new(two(change)).unwrap_err().to_string();
    for (beginning, change) in [
        ("contact[2].gap: ", (|scene| scene.settings.contacts[1].gap = 0.03) as fn(&mut Scene)),
        ("contact[2].sector_gaps: ", |scene| scene.settings.contacts[1].sector_gaps = vec![1e-4; 2]),
        ("surface[2].shape: ", |scene| scene.settings.surfaces[1].shape = lobes(0.03, 3)),
        ("surface[2].shape.radius_change: ", |scene| {
            scene.settings.surfaces[1].shape = Shape::Table { radius_change: vec![0.0; 2] };
        }),
        ("structure[2].frequency_factors: ", |scene| scene.settings.structures[1].frequency_factors = vec![1.0; 2]),
    ] {
        let reported = reported(change);
        assert!(reported.starts_with(beginning), "{reported}");
    }
    // Tips that are too fast are rejected by the name of their input, or accepted once.
    let fast = |accept: bool| {
        two(|scene| {
            scene.settings.accept_implausible = accept;
            scene.settings.contacts.iter_mut().for_each(|contact| contact.friction = 0.0);
            scene.settings.structures[1].speed = 7000.0;
            scene.settings.surfaces.iter_mut().for_each(|surface| surface.shape = Shape::Circular {});
        })
    };
    let refused = try_started(&fast(false)).unwrap_err().to_string();
    assert!(refused.starts_with("`rear.speed`: at a speed of 7000"), "{refused}");
    let mut simulation = started(&fast(true));
    assert!(simulation.warnings().iter().any(|text| text.starts_with("`rear.speed`: at a speed of 7000")));
    set(&mut simulation, "front.speed", 7000.0);
    go(&mut simulation, 1e-6);
    go(&mut simulation, 1e-6);
    assert!(simulation.take_notes().iter().any(|text| text.starts_with("`front.speed`: at a speed of 7000")));
    // Patches without friction cause no warning.
    let scene = two(|scene| {
        scene.settings.contacts.iter_mut().for_each(|contact| contact.friction = 0.0);
        scene.settings.surfaces[1].patches = Some(PatchSettings { around: 4, along: 1 });
    });
    let warnings = started(&scene).warnings().join("; ");
    assert!(warnings.contains("surface[2].patches: no contact has friction"), "{warnings}");
    // Nodes without contact are reported.
    let mut scene = several::tip_and_seal(rub(3), Solver::Lcp);
    scene.settings.contacts.truncate(1);
    scene.settings.surfaces.truncate(1);
    let simulation = started(&scene);
    let rows = simulation.table().variables().iter().filter(|row| row.description.contains("1e9 m at nodes in no"));
    let names: Vec<&str> = rows.map(|row| row.name.as_str()).collect();
    assert!(names.contains(&"node_clearance_minimum") && names.contains(&"blade[1].clearance"), "{names:?}");
    assert!(real(&simulation, "clearance_minimum") < 1.0 && !names.contains(&"clearance_minimum"));
}

/// In a disk with one node per blade, that node represents all nodes.
#[test]
fn warns_once_of_disk_flutter_with_one_node_per_blade() {
    let mut scene = disk::with_rotor(disk::TestDisk::random(6, 1, 9, 0.25, 6).cyclic());
    scene.settings.contacts[0].friction = 0.5;
    let warnings = started(&scene).warnings().to_vec();
    assert_eq!(warnings.iter().filter(|text| text.contains("flutter")).count(), 1, "{warnings:?}");
}

/// An inclined node locks up above µ = 0.5; that of the other pair does not and may have a higher coefficient.
#[test]
fn contact_pairs_have_independent_friction() {
    let outcome = |leaning: f64, upright: f64| {
        // Both nodes on separate springs, along all axes.
        let shape = |row: usize, mode: usize| match (mode, row) {
            (0, 0) => 0.5,
            (0, 1) | (1, 3) => 1.0,
            _ if mode == row + 2 => 0.05,
            _ => 0.0,
        };
        let nodes = [("leaning", 0.0), ("upright", 0.015)].map(|(name, z)| node(name, [RADIUS, 0.0, z], 0.0));
        let frequencies = [1000.0, 1500.0, 4e4, 4.1e4, 4.2e4, 4.3e4, 4.4e4, 4.5e4];
        let rom = modal("pair", &frequencies, shape, nodes.into());
        let mut scene = several::split(&round(Rom { sectors: 3, damping_ratio: 0.01, ..rom }));
        (scene.settings.contacts[0].friction, scene.settings.contacts[1].friction) = (leaning, upright);
        (scene.settings.time.step, scene.settings.experiment.communication_step) = (1e-7, 1e-6);
        let turned = [1.0, -1.0].map(|sense| {
            scene.settings.structures[0].speed = sense * 1300.0;
            try_started(&scene).map(drop).map_err(|error| error.to_string())
        });
        turned.into_iter().collect::<Result<Vec<_>, _>>()
    };
    assert!(outcome(0.45, 0.9).is_ok(), "{:?}", outcome(0.45, 0.9));
    let reported = outcome(0.9, 0.45).unwrap_err();
    assert!(reported.contains("no unique solution"), "{reported}");
}
