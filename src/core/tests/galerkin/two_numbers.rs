//! Compares steps of blades with two numbers per node with the general steps, which use three. To select the general steps for
//! the same motion, one node faces a second surface with the same shape.

use super::off_centre::{shift, whirl};
use super::{H, SECTORS, allocations_of, apart, scene};
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::settings::{Meridian, Shape};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_test_models::{RADIUS, element, go, modal, node, real, set, started};

const STEPS: u32 = 80;

/// A change of the scene, and the inputs that the importer sets before a communication step.
type Case = (&'static str, fn(&mut Scene), fn(&mut Simulation, u32));

const CASES: [Case; 14] = [
    ("two lobes", |_| (), |_, _| ()),
    ("without friction", |scene| scene.settings.contacts[0].friction = 0.0, |_, _| ()),
    (
        "friction that ends during contact",
        |_| (),
        |simulation, n| set(simulation, "friction_coefficient", if n % 8 < 5 { 0.15 } else { 0.0 }),
    ),
    ("meridian", |scene| scene.settings.contacts[0].meridian = Meridian::Contour, |_, _| ()),
    (
        "lobes, and a casing that moves",
        |scene| scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 4.2e-4, order: 3, phase: 0.4 },
        |simulation, n| put(simulation, "casing_radius_change", 2e-5 * (f64::from(n) * 0.3).sin()),
    ),
    (
        "table",
        |scene| {
            let radius_change = (0..24).map(|i| -4.6e-4 * (f64::from(i) * 0.9).sin().max(0.0)).collect();
            scene.settings.surfaces[0].shape = Shape::Table { radius_change };
        },
        |_, _| (),
    ),
    (
        "round, closing",
        |scene| scene.settings.surfaces[0].shape = Shape::Circular {},
        |simulation, n| {
            put(simulation, "casing_radius_change", -3.9e-4 * (f64::from(n) * 0.05).min(1.0));
        },
    ),
    (
        "tips that vibrate faster than they slide",
        |scene| scene.settings.contacts[0].friction = 0.02,
        |simulation, n| set(simulation, "speed", if n % 2 == 0 { 40.0 } else { -40.0 }),
    ),
    ("centred shaft", whirl, |_, _| ()),
    ("eccentric shaft", whirl, |simulation, _| shift(simulation, [1.5e-4, -0.8e-4, 0.0])),
    (
        "eccentric shaft in a round casing, meridian",
        |scene| {
            whirl(scene);
            scene.settings.surfaces[0].shape = Shape::Circular {};
            scene.settings.contacts[0].meridian = Meridian::Contour;
        },
        |simulation, n| shift(simulation, [4.2e-4 * (f64::from(n) * 0.05).min(1.0), 1e-4, 0.0]),
    ),
    (
        "whirl, shift, and a casing that moves",
        |scene| {
            whirl(scene);
            scene.settings.contacts[0].meridian = Meridian::Contour;
        },
        |simulation, n| {
            orbit(simulation, n);
            let time = f64::from(n) * 0.1;
            put(simulation, "casing_radius_change", 2e-5 * time.sin());
            put(simulation, "casing_shape_rotation", 0.05 * time);
        },
    ),
    (
        "whirl between lobes, accelerating",
        |scene| {
            whirl(scene);
            scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 3.6e-4, order: 3, phase: 0.4 };
        },
        |simulation, n| {
            orbit(simulation, n);
            set(simulation, "speed", 1300.0 + 10.0 * f64::from(n));
        },
    ),
    (
        "whirl that reverses slow tips",
        |scene| {
            whirl(scene);
            scene.settings.contacts[0].friction = 0.02;
        },
        |simulation, n| {
            orbit(simulation, n);
            set(simulation, "speed", -12.0);
        },
    ),
];

/// Moves the shaft centre along the chords of a circle, one chord per communication step, and along the axis.
fn orbit(simulation: &mut Simulation, n: u32) {
    let (sine, cosine) = (f64::from(n) * 0.06).sin_cos();
    shift(simulation, [1.6e-4 * (cosine - 1.0), 1.6e-4 * sine, 5e-5 * sine]);
}

/// Lets the first node face a separate surface with the same shape.
fn split(scene: &mut Scene) {
    for (index, node) in scene.roms[0].contact_nodes.iter_mut().enumerate() {
        node.name = if index == 0 { "first".into() } else { format!("other_{index}") };
    }
    let settings = &mut scene.settings;
    let mut surface = settings.surfaces[0].clone();
    surface.name = "second".into();
    settings.surfaces.push(surface);
    let mut contact = settings.contacts[0].clone();
    (contact.nodes, contact.slave) = (Some("first".into()), "second".into());
    settings.contacts[0].nodes = Some("other".into());
    settings.contacts.push(contact);
}

/// Sets an input of each surface.
fn put(simulation: &mut Simulation, name: &str, value: f64) {
    let own = ["", "casing.", "second."].map(|prefix| format!("{prefix}{name}"));
    let known = own.iter().filter_map(|name| Some(simulation.table().find(name)?.reference));
    let known: Vec<_> = known.collect();
    assert!(!known.is_empty(), "{name}");
    known.into_iter().for_each(|reference| simulation.set_real(reference, value).unwrap());
}

/// Values of a run.
struct Values {
    displacements: Vec<f64>,
    /// Forces, moments and heat.
    forces: Vec<f64>,
    trials: u64,
}

fn values(scene: &Scene, drive: fn(&mut Simulation, u32)) -> Values {
    let mut simulation = started(scene);
    // With a limit, all steps end at communication points.
    let limit = simulation.table().find("max_internal_steps").unwrap().reference;
    simulation.set_integer(limit, 1_000_000).unwrap();
    let (mut displacements, mut forces) = (Vec::new(), Vec::new());
    for n in 0..STEPS {
        drive(&mut simulation, n);
        go(&mut simulation, H);
        let bank = simulation.system().bank();
        for row in 0..bank.rows() {
            displacements.extend_from_slice(&bank.displacement()[row * bank.lanes()..][..SECTORS]);
        }
        for name in ["force_x", "force_y", "force_z", "torque"] {
            forces.push(real(&simulation, name));
        }
        for sector in 1..=SECTORS {
            forces.extend((0..3).map(|node| element(&simulation, &format!("blade[{sector}].normal_force"), node)));
        }
        let ledger = simulation.system().ledger();
        let works = [&ledger.friction_loss, &ledger.curvature_work, &ledger.casing_work, &ledger.shift_work];
        forces.extend(works.map(|work| 1e3 * work.value()));
        forces.push(1e3 * ledger.whirl_work.value());
        if scene.settings.structures[0].whirl {
            forces.extend(["moment_x", "moment_y"].map(|name| 10.0 * real(&simulation, name)));
        }
    }
    let ledger = simulation.system().ledger();
    let (kinetic, strain) = simulation.system().energies();
    let residual = ledger.residual(kinetic + strain).abs() / ledger.scale();
    assert!(residual < 1e-12, "{residual:e}");
    Values { displacements, forces, trials: simulation.system().effort().trials }
}

#[test]
fn two_numbers_per_node_agree_with_three() {
    for (name, change, drive) in CASES {
        // Coarse steps do not resolve the times at which tips stop sliding.
        let coarse = if name.contains("faster than they slide") { 1e-3 } else { 1e-2 };
        for tolerance in [coarse, 1e-4, 1e-7] {
            let mut plane = scene(Scheme::Galerkin, H, tolerance);
            change(&mut plane);
            let plane_is_centred = !plane.settings.structures[0].whirl;
            let mut space = plane.clone();
            split(&mut space);
            let [two, three] = [plane, space].map(|scene| values(&scene, drive));
            let moved = apart(&two.displacements, &three.displacements);
            let force = apart(&two.forces, &three.forces);
            println!("{name}, {tolerance:e}: {moved:.1e} {force:.1e}, trials {} {}", two.trials, three.trials);
            assert!(three.forces.iter().any(|force| *force != 0.0), "{name}: no contact");
            // The steps differ, because only steps with two numbers per node bound the penetration of nodes in contact.
            // With an off-centre shaft, they approach motions that differ by up to 7e-6.
            let limit = (2.0 * tolerance).max(if plane_is_centred { 1e-6 } else { 1e-5 });
            assert!(moved < limit && force < limit, "{name}, {tolerance:e}: {moved:e} {force:e}");
        }
    }
}

/// Some sectors are so much slower than the others that only their steps have a smaller degree.
#[test]
fn mistuned_sectors_may_differ_in_degree() {
    let bending = [850.0, 2300.0, 3100.0, 5200.0, 9000.0, 15_000.0, 24_000.0, 40_000.0];
    let local = [45_000.0, 50_000.0, 55_000.0, 47_000.0, 52_000.0, 57_000.0];
    let frequencies: Vec<f64> = bending.into_iter().chain(local).collect();
    let shape = |row: usize, mode: usize| match mode.checked_sub(bending.len()) {
        None => [1.0, 4.0, 1.6][row % 3] * (1.3 * mode as f64 + 2.1 * (row % 3) as f64 + 0.1 * row as f64).cos(),
        Some(local) if local == row => 14.0,
        Some(_) => (mode as f64 + 1.9 * row as f64).sin(),
    };
    let nodes = [0.0, 0.02].map(|place| node(format!("tip_{place}"), [RADIUS, place, place], -0.2));
    let rom = modal("blade", &frequencies, shape, nodes.into());
    let displacements = |general: bool, factor: f64| {
        let mut scene = scene(Scheme::Galerkin, H, 1e-2);
        scene.roms[0] = Rom { sectors: SECTORS, damping_ratio: 0.005, ..rom.clone() };
        scene.settings.structures[0].frequency_factors = vec![1.0, factor, 1.02, factor];
        if general {
            split(&mut scene);
        }
        let mut simulation = started(&scene);
        let mut found = Vec::new();
        for _ in 0..60 {
            go(&mut simulation, H);
            let bank = simulation.system().bank();
            (0..bank.rows()).for_each(|row| found.extend((0..SECTORS).map(|sector| bank.row(row, sector))));
        }
        let ledger = simulation.system().ledger();
        let (kinetic, strain) = simulation.system().energies();
        let residual = ledger.residual(kinetic + strain).abs() / ledger.scale();
        assert!(ledger.friction_loss.value() > 0.0 && residual < 1e-12, "{factor}: {residual:e}");
        found
    };
    for factor in [0.51, 0.6] {
        let distance = apart(&displacements(false, factor), &displacements(true, factor));
        println!("{factor}: {distance:.1e}");
        assert!(distance < 2e-3, "{factor}: {distance:e}");
    }
}

/// A blade whose nodes fill three blocks of eight.
fn blade_of_many_nodes(nodes: u32) -> Rom {
    let bending = [850.0, 2300.0, 3100.0, 5200.0, 9000.0, 15_000.0, 24_000.0, 40_000.0];
    let local = (0..3 * nodes).map(|mode| 45_000.0 + 5000.0 * f64::from(mode));
    let frequencies: Vec<f64> = bending.into_iter().chain(local).collect();
    let place = |index: u32| [RADIUS + 3e-4 * f64::from(index), 0.02 * f64::from(index % 3), 4e-3 * f64::from(index)];
    let nodes = (0..nodes).map(|index| node(format!("tip_{index}"), place(index), 0.03 * f64::from(index) - 0.2));
    let shape = |row: usize, mode: usize| match mode.checked_sub(bending.len()) {
        None => [1.0, 4.0, 1.6][row % 3] * (0.07 * row as f64 + 1.3 * mode as f64 + 2.1 * (row % 3) as f64).cos(),
        Some(local) if local == row => 40.0,
        Some(local) => 0.3 * (local as f64 + 1.9 * row as f64).sin(),
    };
    Rom { sectors: SECTORS, damping_ratio: 0.005, ..modal("blade", &frequencies, shape, nodes.collect()) }
}

#[test]
fn steps_of_many_nodes_allocate_only_warnings() {
    for (general, moves) in [(false, false), (true, false), (false, true)] {
        let mut scene = scene(Scheme::Galerkin, H, 1e-3);
        scene.roms[0] = blade_of_many_nodes(18);
        if general {
            split(&mut scene);
        }
        if moves {
            whirl(&mut scene);
        }
        let mut simulation = started(&scene);
        let mut contacts = 0;
        for step in 0..50 {
            if moves {
                orbit(&mut simulation, step);
            }
            let allocations = allocations_of(|| go(&mut simulation, H));
            let warnings = simulation.take_notes();
            assert!(
                allocations == 0 || !warnings.is_empty(),
                "step {step}, general {general}, {moves}: {allocations} allocations"
            );
            contacts += simulation.system().events().len();
        }
        assert!(contacts > 0, "general {general}");
    }
}
