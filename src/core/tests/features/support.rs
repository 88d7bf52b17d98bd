//! Forces on casings and on their supports, amplitudes of modes, displacements of tips: against momentum and each
//! other.

use nalgebra::DMatrix;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::rom::{SUPPORT_ROWS, SupportRows};
use tiprub_core::scene::settings::Shape;
use tiprub_core::{Scene, Simulation};
use tiprub_test_models::{self as models, element, go, move_on, real, set, started};

/// Frequency of the ring on its support (Hz); its modes have the amplitude 0.5 per unit.
const SWING: f64 = 900.0;
const STEP: f64 = 2e-7;

/// Returns a rub on a ring that moves as a rigid body on springs, in addition to its bending: nodal diameters 0 and 1,
/// without tilt, have modal mass 1 kg and displacement 0.5 m, so that it weighs 4 kg and the springs have 4 kg (2πf)².
fn scene(scheme: Scheme) -> Scene {
    let mut scene = models::bumps(models::blade(3));
    models::on_ring(&mut scene, models::ring(36, 3), 0.0);
    scene.settings.time.scheme = scheme;
    scene.settings.time.step = STEP;
    scene.settings.structures[0].whirl = true;
    (scene.settings.outputs.slave_displacement, scene.settings.outputs.casing_forces) = (true, true);
    scene.settings.outputs.support_reaction = true;
    let rom = &mut scene.roms[1];
    rom.damping_ratio = 0.0;
    // Translations of the ring: the mean displacement of its nodes along x and y.
    let nodes = rom.contact_nodes.len();
    let mean = DMatrix::from_fn(2, 3 * nodes, |axis, row| {
        let (sine, cosine) = rom.contact_nodes[row / 3].position[1].sin_cos();
        [[cosine, -sine, 0.0], [sine, cosine, 0.0]][axis][row % 3] / nodes as f64
    });
    let moved = mean * &rom.contact_map;
    let stiffness = 4.0 * (std::f64::consts::TAU * SWING).powi(2);
    let mut rows = DMatrix::zeros(SUPPORT_ROWS, rom.order());
    rows.view_mut((0, 0), (2, rom.order())).copy_from(&(moved * -stiffness));
    // Modes that tilt have the mean 0, except for rounding and the middle of the rings.
    for mode in 0..rom.order() {
        if (rom.stiffness[(mode, mode)].sqrt() / std::f64::consts::TAU - SWING).abs() > 1.0 {
            rows.column_mut(mode).fill(0.0);
        }
    }
    let thermal = DMatrix::zeros(SUPPORT_ROWS, 4);
    rom.extras.support =
        Some(SupportRows { mass: DMatrix::zeros(SUPPORT_ROWS, rom.order()), stiffness: rows, thermal });
    scene
}

/// Returns the rigid-body displacement of the ring, from the displacement outputs of its middle nodes.
fn place(run: &Simulation) -> [f64; 2] {
    let radial = |i: u32| element(run, "casing_displacement", 36 + i);
    let angle = |i: u32| std::f64::consts::TAU * f64::from(i) / 36.0;
    let sum = |of: fn(f64) -> f64| (0..36).map(|i| radial(i) * of(angle(i))).sum::<f64>() / 18.0;
    [sum(f64::cos), sum(f64::sin)]
}

/// The force of the blades plus that of the support is mass times acceleration, step by step: second differences of the
/// positions.
#[test]
fn casing_forces_equal_its_momentum_change() {
    let mut run = started(&scene(Scheme::CentralDifference));
    let (mut places, mut worst, mut largest) = (vec![place(&run)], [0.0_f64; 2], 0.0_f64);
    let mut before = [0.0; 2];
    for index in 0..4000 {
        move_on(&mut run, "whirl_x", 5e-4 * (f64::from(index) / 2000.0).min(1.0), 0.0);
        go(&mut run, STEP);
        places.push(place(&run));
        let force = ["x", "y"].map(|axis| {
            let contact = real(&run, &format!("casing_force_{axis}"));
            assert!(
                (contact + real(&run, &format!("force_{axis}"))).abs() < f64::MIN_POSITIVE,
                "opposite to the rotor"
            );
            contact + real(&run, &format!("support_force_{axis}"))
        });
        if index >= 1 {
            let [a, b, c] = [places.len() - 3, places.len() - 2, places.len() - 1].map(|place| places[place]);
            for axis in 0..2 {
                let inertia = 4.0 * (c[axis] - 2.0 * b[axis] + a[axis]) / (STEP * STEP);
                largest = largest.max(real(&run, ["casing_force_x", "casing_force_y"][axis]).abs());
                worst[axis] = worst[axis].max((force[axis] - inertia).abs());
            }
        }
        before = force;
    }
    println!("momentum of the casing: off by {worst:?} N of {largest} N; last {before:?}");
    assert!(largest > 100.0, "{largest} N");
    assert!(worst.iter().all(|worst| *worst < 1e-9 * largest), "{worst:?} of {largest}");
}

/// The moment about the axis is the opposite of that on the rotor, displaced by the shaft; on a rigid casing as well.
#[test]
fn casing_moments_balance_rotor_moments_about_origin() {
    for flexible in [true, false] {
        let mut scene = scene(Scheme::ModalExact);
        if !flexible {
            scene.settings.structures.truncate(1);
            scene.roms.truncate(1);
            scene.settings.surfaces[0].structure = None;
            (scene.settings.outputs.slave_displacement, scene.settings.outputs.support_reaction) = (false, false);
        }
        let mut run = started(&scene);
        let (shaft, mut seen) = ([2.5e-4, -1e-4], 0.0_f64);
        for index in 1..=60 {
            let share = f64::from(index) / 60.0;
            move_on(&mut run, "whirl_x", share * shaft[0], 0.0);
            move_on(&mut run, "whirl_y", share * shaft[1], 0.0);
            go(&mut run, 2e-5);
        }
        for _ in 0..200 {
            go(&mut run, 2e-5);
            let [fx, fy] = ["force_x", "force_y"].map(|name| real(&run, name));
            let expected = -(real(&run, "torque") + shaft[0] * fy - shaft[1] * fx);
            let moment = real(&run, "casing_moment_z");
            seen = seen.max(moment.abs());
            // For a surface of revolution the torque uses the undeformed lever arm.
            assert!((moment - expected).abs() <= 1e-9 * 0.25 * fx.hypot(fy), "{moment} {expected}");
        }
        assert!(seen > 1.0, "{seen} N m");
    }
}

/// Under a constant load the support carries all of it, and the inertia of the casing nothing.
#[test]
fn support_balances_static_contact_force() {
    let mut scene = scene(Scheme::ModalExact);
    // A resting, damped blade pressed into the casing.
    scene.settings.structures[0].speed = 0.0;
    scene.settings.structures[0].damping_ratio = Some(0.5);
    scene.settings.structures[1].damping_ratio = Some(0.5);
    scene.settings.contacts[0].friction = 0.0;
    scene.settings.time.step = 1e-6;
    let mut run = started(&scene);
    for _ in 0..400 {
        move_on(&mut run, "whirl_x", 5e-4, 0.0);
        go(&mut run, 2e-4);
    }
    let [contact, support] = ["casing_force_x", "support_force_x"].map(|name| real(&run, name));
    println!("at rest: {contact} N on the casing, {support} N of the support");
    assert!(contact.abs() > 10.0 && (contact + support).abs() < 1e-6 * contact.abs(), "{contact} {support}");
}

/// Friction turns the casing: its support carries the moment of the contact, also if the mesh is larger than the
/// surface, with a lining in between.
#[test]
fn support_balances_static_contact_moment() {
    for larger in [0.0, 0.07] {
        let mut scene = scene(Scheme::ModalExact);
        scene.settings.surfaces[0].shape = Shape::Circular {};
        scene.settings.surfaces[0].moving = true;
        scene.settings.structures[0].damping_ratio = Some(0.5);
        scene.settings.structures[1].damping_ratio = Some(0.5);
        scene.settings.contacts[0].friction = 0.3;
        scene.settings.time.step = 1e-6;
        let rom = &mut scene.roms[1];
        // The ring turns as a rigid body on springs, in addition to its other modes: v = q/2 of a mass of 4 kg.
        let radius = (1.0 + larger) * (models::RADIUS + models::GAP);
        rom.contact_nodes.iter_mut().for_each(|node| node.position[0] = radius);
        let (mode, square) = (rom.order(), (std::f64::consts::TAU * SWING).powi(2));
        rom.mass = DMatrix::identity(mode + 1, mode + 1);
        rom.stiffness = rom.stiffness.clone().resize(mode + 1, mode + 1, 0.0);
        rom.stiffness[(mode, mode)] = square;
        rom.contact_map = rom.contact_map.clone().insert_column(mode, 0.0);
        (0..rom.contact_nodes.len()).for_each(|node| rom.contact_map[(3 * node + 1, mode)] = 0.5);
        let thermal = rom.extras.thermal.as_mut().unwrap();
        thermal.loads = thermal.loads.clone().insert_row(mode, 0.0);
        let support = rom.extras.support.as_mut().unwrap();
        support.stiffness = support.stiffness.clone().insert_column(mode, 0.0);
        support.stiffness[(5, mode)] = -4.0 * square * 0.5 * radius;
        support.mass = DMatrix::zeros(SUPPORT_ROWS, mode + 1);
        let mut run = started(&scene);
        set(&mut run, "gap_offset", -3.7e-4);
        (0..100).for_each(|_| go(&mut run, 2e-4));
        // The ring oscillates slightly; over some time it gains no momentum.
        let (mut contact, mut support) = (0.0, 0.0);
        for _ in 0..200 {
            go(&mut run, 2e-4);
            contact += real(&run, "casing_moment_z") / 200.0;
            support += real(&run, "support_moment_z") / 200.0;
        }
        println!("mesh {larger} larger: {contact} N m on the casing, {support} N m of the support");
        assert!(contact.abs() > 10.0 && (contact + support).abs() < 1e-3 * contact.abs(), "{contact} {support}");
    }
}

/// Contact displacements are the sum of the modes, with unit modal mass.
#[test]
fn tip_displacement_matches_modal_amplitudes() {
    let mut scene = models::bumps(models::blade(4));
    let modes = scene.roms[0].order();
    scene.settings.outputs.watched_sectors = vec![3];
    scene.settings.outputs.modal_amplitudes = Some(modes);
    scene.settings.outputs.tip_displacements = true;
    let map = scene.roms[0].contact_map.clone();
    let mut run = started(&scene);
    let mut largest = 0.0_f64;
    for _ in 0..200 {
        go(&mut run, 2e-5);
        for node in 0..3_u32 {
            for (axis, name) in ["radial", "tangential", "axial"].into_iter().enumerate() {
                let reported = element(&run, &format!("blade[3].tip_{name}_displacement"), node);
                let row = 3 * node as usize + axis;
                // The modes of this ROM are its coordinates, up to their sign.
                let term = |mode: usize| {
                    let column = map.column(mode);
                    let most = column.iter().fold(0.0_f64, |a, b| if b.abs() > a.abs() { *b } else { a });
                    let amplitude = element(&run, "blade[3].modal_amplitude", u32::try_from(mode).unwrap());
                    1.0_f64.copysign(most) * amplitude * map[(row, mode)]
                };
                let sum: f64 = (0..modes).map(term).sum();
                largest = largest.max(reported.abs());
                assert!((reported - sum).abs() < 1e-10 * (reported.abs() + 1e-6), "{reported:e} {sum:e}");
            }
        }
    }
    assert!(largest > 1e-6, "{largest:e} m");
}
