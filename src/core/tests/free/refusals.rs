//! Errors of scenes with a free master, before and during the flight.

use lattice::*;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::*;
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_test_models::{go, lattice, real, started};

#[test]
fn excessive_penetration_of_free_body_ends_with_reason() {
    let fast = scene(block([0.0; 3], 1e3), &[(BlockSide::Left, 0.0203)], false, [-400.0, 0.0, 0.0]);
    let mut simulation = started(&fast);
    let error = (0..200).find_map(|_| simulation.do_step(simulation.time(), 1e-5).err()).unwrap().to_string();
    assert!(error.contains("a tenth of the extent"), "{error}");
}

/// Returns the error of a rejected scene.
#[track_caller]
fn refusal(change: impl FnOnce(&mut Scene)) -> String {
    let mut scene = squeezed();
    change(&mut scene);
    match Simulation::new(&scene) {
        Err(error) => error.to_string(),
        Ok(mut simulation) => simulation.initialise(0.0).unwrap_err().to_string(),
    }
}

#[test]
fn rejects_meaningless_scenes_with_reason() {
    type Case = (&'static str, fn(&mut Scene));
    let cases: [Case; 24] = [
        ("the structure is constrained", |scene| scene.roms[0].stiffness[(4, 4)] += 1e3),
        ("no contact node", |scene| scene.settings.contacts[0].nodes = Some("top".into())),
        ("the node `left_000` already belongs", |scene| scene.settings.contacts[1].nodes = Some("le".into())),
        ("would use all contact nodes", |scene| scene.settings.contacts[0].nodes = None),
        ("the text is empty", |scene| scene.settings.contacts[0].nodes = Some(String::new())),
        ("gap", |scene| scene.settings.contacts[0].gap = 1e-3),
        ("sector_gaps", |scene| scene.settings.contacts[0].sector_gaps = vec![1e-3]),
        ("meridian", |scene| scene.settings.contacts[0].meridian = Meridian::Cylinder),
        ("slave_heat_fraction", |scene| scene.settings.contacts[0].slave_heat_fraction = Some(0.5)),
        ("requires the solver of contact[1]", |scene| scene.settings.contacts[1].solver = Solver::Film),
        ("the position of its surface", |scene| scene.settings.surfaces[0].structure = None),
        ("shape", |scene| scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 1e-4, order: 2, phase: 0.0 }),
        ("moving", |scene| scene.settings.surfaces[0].moving = true),
        ("named by 0 contacts", |scene| drop(scene.settings.contacts.pop())),
        ("massless-boundary", |scene| scene.settings.time.scheme = Scheme::MasslessBoundary),
        ("all_sectors", |scene| scene.settings.outputs.all_sectors = true),
        ("nodal_diameters", |scene| scene.settings.outputs.nodal_diameters = Some(0)),
        ("an open contact grid in its ROM", |scene| scene.roms[1].extras.grid = None),
        ("coincide", |scene| scene.roms[1].contact_nodes[1].position = scene.roms[1].contact_nodes[0].position),
        ("velocity: requires `motion = \"free\"`", |scene| scene.settings.structures[1].velocity = [1.0, 0.0, 0.0]),
        ("whirl: requires `motion = \"rotating\"`", |scene| scene.settings.structures[0].whirl = true),
        ("is not part of any contact", |scene| scene.settings.surfaces[1].structure = Some("left_plate".into())),
        ("ω_max·h", |scene| {
            (scene.settings.time.scheme, scene.settings.time.step) = (Scheme::CentralDifference, 1e-5)
        }),
        ("start inside", |scene| {
            scene.roms[0].contact_nodes.iter_mut().for_each(|node| node.position[1] -= 0.045);
        }),
    ];
    for (part, change) in cases {
        let error = refusal(change);
        assert!(error.contains(part), "{part}: {error}");
    }
}

/// Adds a light mode that moves some contact nodes by given vectors.
fn with_mode(mut rom: Rom, shape: impl IntoIterator<Item = (usize, [f64; 3])>) -> Rom {
    let order = rom.order();
    let grown = |matrix: &nalgebra::DMatrix<f64>, rows: usize| matrix.clone().resize(rows, order + 1, 0.0);
    (rom.mass, rom.stiffness) = (grown(&rom.mass, order + 1), grown(&rom.stiffness, order + 1));
    rom.mass[(order, order)] = 1e-4;
    rom.stiffness[(order, order)] = 1e-4 * 1e4_f64.powi(2);
    rom.contact_map = grown(&rom.contact_map, order);
    for (node, vector) in shape {
        (0..3).for_each(|i| rom.contact_map[(3 * node + i, order)] = vector[i]);
    }
    rom
}

/// Returns the block flying at a plate at a distance (m).
fn at_plate(distance: f64) -> Scene {
    let scene = scene(block([0.0; 3], 3e6), &[(BlockSide::Left, distance)], false, [-15.0, 3.0, 0.0]);
    with(scene, 1.5, Solver::Lcp, Scheme::ModalExact)
}

/// Returns the block with such a mode, and the plate rigid.
fn with_local_mode(distance: f64, shape: &[(usize, [f64; 3])]) -> Scene {
    let mut scene = at_plate(distance);
    scene.settings.surfaces[0].rigid = true;
    scene.roms[0] = with_mode(scene.roms[0].clone(), shape.iter().copied());
    scene
}

#[test]
fn rejects_friction_that_jams_a_free_body() {
    // Near, and after a flight of two lengths of the block.
    for distance in [0.0203, 0.1] {
        // When it is pushed in, the node moves along its slip: friction against the slip pushes it in further.
        let mut simulation = Simulation::new(with_local_mode(distance, &[(0, [1.0, 1.0, 0.0])])).unwrap();
        let error = simulation.initialise(0.0).unwrap_err().to_string();
        assert!(error.contains("contact problem of left_000 alone has no unique solution"), "{error}");
        let other = started(&with_local_mode(distance, &[(0, [1.0, -1.0, 0.0])]));
        assert!(other.warnings().is_empty(), "{:?}", other.warnings());
    }
}

/// The plate yields along the slip instead.
#[test]
fn rejects_friction_that_jams_contact_on_a_plate() {
    let with_plate = |sideways: f64| {
        let mut scene = at_plate(0.0203);
        let nodes = scene.roms[1].contact_nodes.len();
        scene.roms[1] = with_mode(scene.roms[1].clone(), (0..nodes).map(|node| (node, [1.0, sideways, 0.0])));
        scene
    };
    let mut jams = Simulation::new(with_plate(1.0)).unwrap();
    let error = jams.initialise(0.0).unwrap_err().to_string();
    assert!(error.contains("alone has no unique solution"), "{error}");
    let other = started(&with_plate(-1.0));
    assert!(other.warnings().is_empty(), "{:?}", other.warnings());
}

#[test]
fn warns_of_friction_without_a_unique_solution_in_flight() {
    let simulation = started(&with_local_mode(0.0203, &[(0, [1.0, 0.0, 0.0]), (1, [0.0, 1.0, 0.0])]));
    let reported = simulation.warnings().join(" ");
    assert!(reported.contains("cannot be shown to have a unique solution"), "{reported}");
    let mut frictionless = with_local_mode(0.0203, &[(0, [1.0, 0.0, 0.0]), (1, [0.0, 1.0, 0.0])]);
    frictionless.settings.contacts[0].friction = 0.0;
    let simulation = started(&frictionless);
    assert!(simulation.warnings().is_empty(), "{:?}", simulation.warnings());
}

#[test]
fn rejects_a_body_that_is_too_fast_for_the_step() {
    // Obliquely through the plate within one step: beyond its edge before and after.
    for velocity in [[-1e5, 1e5, 0.0], [-1e5, 0.0, 0.0], [0.0, 0.0, -5e4], [5000.0, 0.0, 0.0]] {
        let mut scene = scene(block([0.0; 3], 3e6), &[(BlockSide::Left, 0.06)], false, velocity);
        scene.settings.accept_implausible = true;
        let mut simulation = started(&with(scene, 0.0, Solver::Lcp, Scheme::ModalExact));
        let error = simulation.do_step(0.0, 1e-5).unwrap_err().to_string();
        assert!(
            error.contains("could pass through a surface undetected") && error.contains("smaller internal step"),
            "{error}"
        );
    }
    // The limit is a tenth of the block in one step.
    let mut slow = scene(block([0.0; 3], 3e6), &[(BlockSide::Left, 0.5)], false, [3900.0, 0.0, 0.0]);
    slow.settings.accept_implausible = true;
    let mut slow = started(&slow);
    go(&mut slow, 1e-5);
}

#[test]
fn rejects_node_that_crosses_an_edge_from_behind() {
    let thrown = |distance, velocity, steps: u32| {
        let scene = scene(block([0.0, 0.1101, 0.0], 3e6), &[(BlockSide::Left, distance)], false, velocity);
        let mut simulation = started(&with(scene, 0.15, Solver::Lcp, Scheme::ModalExact));
        (0..steps).try_for_each(|_| simulation.do_step(simulation.time(), 1e-5)).map(|()| simulation)
    };
    // Its face flies 0.2 mm to 0.2 µm behind the plate.
    for depth in [2e-4, 2e-5, 2e-7] {
        let error = thrown(0.02 - depth, [0.0, -40.0, 0.0], 60).unwrap_err().to_string();
        assert!(error.contains("contact node left_00") && error.contains("has passed the edge"), "{depth} m: {error}");
    }
    // In front of the plate there is no error, and a node that arrives from the front in the step that passes the edge
    // has an impact.
    assert!(real(&thrown(0.0203, [0.0, -40.0, 0.0], 60).unwrap(), "impact_loss") == 0.0);
    for distance in [0.020_010, 0.020_05] {
        let hit = thrown(distance, [-4.0, -40.0, 0.0], 8).unwrap();
        assert!(vector(&hit, "block.velocity")[0] > -3.9, "{distance} m: it was not hit");
        assert!(real(&hit, "energy_residual_relative").abs() < 1e-13);
    }
}
