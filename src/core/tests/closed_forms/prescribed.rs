//! Prescribed motions and the points where they act, against closed forms with signs and positions: how inputs and
//! parameters move casing and shaft, which body slides on which, which sector and which structure a setting belongs to.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use tiprub_core::contact::ContactParameters;
use tiprub_core::geometry::open::OpenGap;
use tiprub_core::geometry::surface_spline::SurfaceSpline;
use tiprub_core::geometry::{FixedGap, GapLaw, PrescribedMotion, Vector3};
use tiprub_core::modes::bank::SectorModel;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::WatchedPoints;
use tiprub_core::scene::settings::{Interpolation, LoadSettings, Shape, SplineSettings};
use tiprub_core::system::{PairParts, StructureParts, SurfaceCarrier, System, SystemSettings};
use tiprub_core::time::{Recurrence, Stepper};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_test_models::{self as models, element, go, lattice, move_on, real, reference, set, single_sector, started};

const SECTORS: usize = 5;
const SLOPE: f64 = -0.2;
const LOBES: (f64, u32, f64) = (8e-5, 3, 0.4);
/// Watched points: distance inside the cone (m), angle (rad), axial position (m).
const WATCHED: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [3e-4, 0.013, 0.011], [0.0, 0.05, 0.031], [0.02, -0.1, 0.018]];
const GAPS: [f64; SECTORS] = [5e-4, 5.3e-4, 4.8e-4, 5.1e-4, 5.6e-4];

/// Returns blades with conical tips in a casing with lobes that every input can move.
fn movable() -> Scene {
    let mut scene = models::rub(SECTORS);
    for node in &mut scene.roms[0].contact_nodes {
        (node.position[0], node.meridional_slope) = (0.25 + SLOPE * node.position[2], SLOPE);
    }
    let place = |[inside, theta, z]: [f64; 3]| models::node("point", [0.25 + SLOPE * z - inside, theta, z], 0.0);
    let map = DMatrix::zeros(3 * WATCHED.len(), scene.roms[0].order());
    scene.roms[0].extras.watched = Some(WatchedPoints { map, points: WATCHED.map(place).to_vec() });
    (scene.settings.structures[0].whirl, scene.settings.structures[0].axial_shift) = (true, true);
    let (amplitude, order, phase) = LOBES;
    scene.settings.surfaces[0].shape = Shape::Lobes { amplitude, order, phase };
    scene.settings.surfaces[0].ramp_time = 0.0;
    scene.settings.contacts[0].sector_gaps = GAPS.to_vec();
    scene.settings.outputs.watched_sectors = (1..=SECTORS).collect();
    scene
}

/// Returns the distance of a point of a sector from the cone with lobes, in Cartesian coordinates, for the values of
/// [`INPUTS`].
fn distance([radius, theta, z]: [f64; 3], sector: usize, values: [f64; 8]) -> f64 {
    let [offset, change, factor, rotation, whirl_x, whirl_y, shift, start] = values;
    let angle = theta + TAU * sector as f64 / SECTORS as f64 + start;
    let [x, y, z] = [radius * angle.cos() + whirl_x, radius * angle.sin() + whirl_y, z + shift];
    let (amplitude, order, phase) = LOBES;
    let lobe = f64::from(order) * (y.atan2(x) - rotation) - phase;
    let casing = 0.25 + SLOPE * z + GAPS[sector] + offset + change - factor * amplitude * lobe.cos();
    let flank = factor * amplitude * f64::from(order) * lobe.sin() / radius;
    (casing - x.hypot(y)) / (1.0 + flank * flank + SLOPE * SLOPE).sqrt()
}

/// Name, neutral value, tested value.
const INPUTS: [(&str, f64, f64); 8] = [
    ("gap_offset", 0.0, 7e-5),
    ("casing_radius_change", 0.0, -9e-5),
    ("casing_shape_factor", 1.0, -1.4),
    ("casing_shape_rotation", 0.0, 0.35),
    ("whirl_x", 0.0, 1.1e-4),
    ("whirl_y", 0.0, -1.3e-4),
    ("axial_shift", 0.0, 8e-4),
    ("initial_rotor_angle", 0.0, 0.3),
];

type Kind = (&'static str, fn(&mut Scene));
/// Kinds of surfaces.
const KINDS: [Kind; 3] = [
    ("revolution", |_| {}),
    ("spline", |scene| scene.settings.surfaces[0].spline = Some(SplineSettings::default())),
    ("flexible casing", models::flexible),
];

/// Covers each kind of surface, each input alone and all of them together.
#[test]
fn gaps_are_distances_for_any_casing_and_shaft_motion() {
    for (kind, change) in KINDS {
        let mut scene = movable();
        change(&mut scene);
        let template = Simulation::new(&scene).unwrap();
        for moved in (0..INPUTS.len()).map(|input| vec![input]).chain([(0..INPUTS.len()).collect()]) {
            let mut simulation = template.clone();
            let (mut values, unmoved) = (INPUTS.map(|input| input.1), INPUTS.map(|input| input.1));
            for input in &moved {
                let (name, _, value) = INPUTS[*input];
                // The shape of a casing that belongs to a structure does not turn.
                if simulation.table().find(name).is_some() {
                    set(&mut simulation, name, value);
                    values[*input] = value;
                }
            }
            simulation.initialise(0.0).unwrap_or_else(|error| panic!("{kind}, {moved:?}: {error}"));
            let (mut error, mut effect) = (0.0_f64, 0.0_f64);
            for (node, sector) in (0..3).flat_map(|node| (0..SECTORS).map(move |sector| (node, sector))) {
                let place = scene.roms[0].contact_nodes[node].position;
                let exact = distance(place, sector, values);
                error = error.max((simulation.system().gap(node, sector) - exact).abs());
                effect = effect.max((exact - distance(place, sector, unmoved)).abs());
                let watched =
                    reference(&simulation, &format!("blade[{}].clearance", sector + 1)) + u32::try_from(node).unwrap();
                let shown = simulation.real(watched).unwrap();
                assert_eq!(shown.to_bits(), simulation.system().gap(node, sector).to_bits());
            }
            let watched = &scene.roms[0].extras.watched.as_ref().unwrap().points;
            for (point, sector) in (0..WATCHED.len()).flat_map(|point| (0..SECTORS).map(move |sector| (point, sector)))
            {
                let name = format!("blade[{}].watched_clearance", sector + 1);
                let found = element(&simulation, &name, u32::try_from(point).unwrap());
                // Far inside, the curvature of the surface around the closest point matters.
                let curved = 1e-2 * WATCHED[point][0];
                let off = (found - distance(watched[point].position, sector, values)).abs();
                assert!(off < 1e-6 + curved, "{kind}, {moved:?}, {name}[{point}]: {found:e} is off by {off:e}");
            }
            println!("{kind}, {moved:?}: gaps move by {effect:.1e} m, off by {error:.1e} m");
            let has_none = values.map(f64::to_bits) == unmoved.map(f64::to_bits);
            assert!(effect > 5e-5 || has_none, "{kind}, {moved:?}: {effect:e}");
            assert!(error < 1e-6, "{kind}, {moved:?}: {error:e}");
        }
    }
}

/// A watched point at the position of a contact node moves with it in a rub: the gap of a node is linear in the
/// displacements, that of a point is not.
#[test]
fn a_point_at_a_contact_node_has_its_clearance_in_a_rub() {
    for (kind, change) in KINDS {
        let mut scene = models::rub(SECTORS);
        let rom = &mut scene.roms[0];
        rom.contact_nodes.iter_mut().for_each(|node| node.position[0] += SLOPE * node.position[2]);
        rom.extras.watched = Some(WatchedPoints { map: rom.contact_map.clone(), points: rom.contact_nodes.clone() });
        change(&mut scene);
        let mut simulation = started(&scene);
        let (mut off, mut moved, mut touched) = (0.0_f64, 0.0_f64, false);
        let at_rest = element(&simulation, "blade[2].clearance", 1);
        for _ in 0..60 {
            go(&mut simulation, 5e-5);
            touched |= real(&simulation, "normal_impulse") > 0.0;
            for (sector, node) in [(1, 0), (1, 1), (1, 2), (2, 0), (2, 1), (2, 2)] {
                let of = |name: &str| element(&simulation, &format!("blade[{sector}].{name}"), node);
                off = off.max((of("watched_clearance") - of("clearance")).abs());
                moved = moved.max((of("clearance") - at_rest).abs());
            }
        }
        println!("{kind}: off by {off:.1e} m of {moved:.1e} m");
        assert!(touched && moved > 0.5 * at_rest && off < 1e-8, "{kind}: {touched}, {off:e} of {moved:e}");
    }
}

/// Two pairs of one rotor: a point uses the surface of the nearest contact node; without friction or watched sectors it
/// costs nothing.
#[test]
fn output_point_uses_the_surface_of_its_nearest_contact_node() {
    let mut scene = movable();
    scene.settings.contacts[0].nodes = Some("leading".into());
    scene.settings.contacts[0].sector_gaps.clear();
    let (mut contact, mut surface) = (scene.settings.contacts[0].clone(), scene.settings.surfaces[0].clone());
    (contact.nodes, contact.slave, contact.gap) = (Some("trailing".into()), "other".into(), 9e-4);
    (surface.name, surface.shape) = ("other".into(), Shape::Circular {});
    scene.settings.contacts.push(contact);
    scene.settings.surfaces.push(surface);
    let simulation = started(&scene);
    let of = |point: u32| element(&simulation, "blade[1].watched_clearance", point);
    let normal = (1.0 + SLOPE * SLOPE).sqrt();
    assert!((of(2) - 9e-4 / normal).abs() < 1e-9, "{:e}", of(2));
    assert!((of(0) - element(&simulation, "blade[1].clearance", 0)).abs() < 1e-15, "{:e}", of(0));
    // Next to mid-chord, which touches nothing.
    assert!(of(1) >= 1e9 && of(3) >= 1e9, "{:e} {:e}", of(1), of(3));
    scene.settings.outputs.watched_sectors.clear();
    assert!(started(&scene).table().find("blade[1].watched_clearance").is_none());
}

/// Circular frequency of the radial, tangential and axial mode, and displacement per unit of each.
const MODES: [f64; 3] = [TAU * 850.0, TAU * 6000.0, TAU * 6500.0];
const SHAPE: f64 = 4.0;
const STIFFNESS: f64 = MODES[0] * MODES[0] / (SHAPE * SHAPE);
const CLOSING: f64 = 2e-4;
const FRICTION: f64 = 0.1;
const VELOCITY: f64 = 0.02;
/// Direction of the motion of the shaft or the casing: no blade is close to it or perpendicular to it.
const TOWARDS: f64 = 0.3;

/// Returns blades with one mode along each direction, in a round casing that can close; nothing turns.
fn blades(scheme: Scheme, solver: Solver, friction: f64) -> Scene {
    let mut scene = models::rub(SECTORS);
    let rom = &mut scene.roms[0];
    rom.mass = DMatrix::identity(3, 3);
    rom.stiffness = DMatrix::from_diagonal(&DVector::from_iterator(3, MODES.iter().map(|mode| mode * mode)));
    rom.contact_map = DMatrix::identity(3, 3) * SHAPE;
    rom.contact_nodes.truncate(1);
    (rom.contact_nodes[0].position, rom.contact_nodes[0].meridional_slope) = ([0.25, 0.0, 0.0], 0.0);
    let structure = &mut scene.settings.structures[0];
    (structure.speed, structure.damping_ratio) = (0.0, Some(0.5));
    (structure.whirl, structure.axial_shift) = (true, true);
    scene.settings.surfaces[0].shape = Shape::Circular {};
    (scene.settings.contacts[0].solver, scene.settings.contacts[0].friction) = (solver, friction);
    (scene.settings.time.scheme, scene.settings.time.step) = (scheme, 2e-6);
    scene
}

/// Closes the casing by more than the gap, and waits.
fn close(simulation: &mut Simulation, closing: f64) {
    move_on(simulation, "casing_radius_change", 0.0, -closing / 4e-3);
    go(simulation, 4e-3);
    move_on(simulation, "casing_radius_change", -closing, 0.0);
    go(simulation, 4e-3);
}

/// Checks that every blade that slides with `slip(θ)` (tangential, axial; m/s) feels the friction µλ against it, and
/// the heat µλ|slip|.
fn check_friction(simulation: &Simulation, case: &str, slip: impl Fn(f64) -> [f64; 2]) {
    let (mut heat, mut torque, mut axial) = (0.0, 0.0, 0.0);
    assert_eq!(simulation.system().events().len(), SECTORS, "{case}: open");
    for event in simulation.system().events() {
        let [around, along] = slip(TAU * event.sector as f64 / SECTORS as f64);
        let speed = around.hypot(along);
        let exact = [around, along].map(|slip| -FRICTION * event.normal * slip / speed);
        for (found, exact) in [(event.force[1], exact[0]), (event.force[2], exact[1])] {
            let off = (found - exact).abs() / (FRICTION * event.normal);
            assert!(off < 0.05, "{case}, sector {}: friction {found} N, exactly {exact} N", event.sector);
        }
        heat += FRICTION * event.normal * speed;
        torque += 0.25 * exact[0];
        axial += exact[1];
    }
    for (name, exact, scale) in [
        ("friction_power", heat, heat),
        ("torque", torque, heat / VELOCITY * 0.25),
        ("force_z", axial, heat / VELOCITY),
    ] {
        let found = real(simulation, name);
        println!("{case}: {name} {found:.5}, exactly {exact:.5}");
        assert!((found - exact).abs() < 0.05 * scale, "{case}: {name} {found}, exactly {exact}");
    }
}

/// The shaft moves sideways (and axially) at a constant velocity, while the rotor turns slowly or not at all.
#[test]
fn friction_opposes_whirl_and_axial_motion_of_the_shaft() {
    for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
        for solver in [Solver::Film, Solver::Lcp, Solver::Coulomb] {
            for (speed, along) in [(0.0, 0.0), (0.04, 0.0), (-0.04, 0.0), (0.04, 0.02), (-0.04, -0.02)] {
                // Only `coulomb` models axial slip.
                if along != 0.0 && solver != Solver::Coulomb {
                    continue;
                }
                let mut scene = blades(scheme, solver, FRICTION);
                scene.settings.structures[0].speed = speed;
                let sideways = if along == 0.0 { VELOCITY } else { 0.0 };
                let mut simulation = started(&scene);
                close(&mut simulation, 3.56e-4 + CLOSING);
                let rates = [sideways * TOWARDS.cos(), sideways * TOWARDS.sin(), along];
                let mut moved = 0.0;
                for length in [4e-3, 5e-5] {
                    for (name, rate) in ["whirl_x", "whirl_y", "axial_shift"].into_iter().zip(rates) {
                        move_on(&mut simulation, name, rate * moved, rate);
                    }
                    go(&mut simulation, length);
                    moved += length;
                }
                let case = format!("{scheme:?}, {solver:?}, speed {speed}, along {along}");
                check_friction(&simulation, &case, |angle| [0.25 * speed + sideways * (TOWARDS - angle).sin(), along]);
            }
        }
    }
}

/// An increasing load of one nodal diameter moves the casing as a rigid body; the blades are at rest and dragged along.
#[test]
fn friction_drags_blades_along_with_a_moving_casing() {
    for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
        // From rest tips vibrate faster than they slide; the friction law of `lcp` then adds energy, and its run ends.
        let solver = Solver::Coulomb;
        let mut scene = blades(scheme, solver, FRICTION);
        models::flexible(&mut scene);
        scene.settings.structures[1].damping_ratio = Some(0.5);
        scene.settings.structures[1].load = Some(LoadSettings { order: 1, amplitude: 0.0, phase: TOWARDS });
        scene.settings.outputs.slave_displacement = true;
        let mut simulation = started(&scene);
        close(&mut simulation, 3.56e-4 + CLOSING);
        // The mode has the displacement 0.5 cos θ and the mass 1, so its force is the line load times π R/2.
        let rate = VELOCITY * (TAU * 900.0).powi(2) / (0.5 * 0.5 * std::f64::consts::PI * 0.25);
        move_on(&mut simulation, "casing_load_amplitude", 0.0, rate);
        go(&mut simulation, 4e-3);
        // Nodes at 0 and 90 degrees of the first ring.
        let first = reference(&simulation, "casing_displacement");
        let position = |simulation: &Simulation| [0, 9].map(|node| simulation.real(first + node).unwrap());
        let before = position(&simulation);
        move_on(&mut simulation, "casing_load_amplitude", rate * 4e-3, rate);
        go(&mut simulation, 5e-5);
        let now = position(&simulation);
        let [x, y] = [0, 1].map(|axis| (now[axis] - before[axis]) / 5e-5);
        let case = format!("{scheme:?}, {solver:?}: casing at ({x:.4}, {y:.4}) m/s");
        assert!(x.hypot(y) > 0.8 * VELOCITY && (y.atan2(x) - TOWARDS).abs() < 0.1, "{case}");
        check_friction(&simulation, &case, |angle| [x * angle.sin() - y * angle.cos(), 0.0]);
    }
}

const SWING: f64 = 60.0;
const PRESS: f64 = 200.0;
const DEPTH: f64 = 2e-4;
/// Flexibility of the contact of massless-boundary (m/N).
const SOFT: f64 = 1e-6;

/// Returns unit masses on springs: (ω, direction, displacement of the node), of which the last `quasi_static` have no
/// inertia.
fn masses(modes: &[(f64, usize, f64)], rows: usize, quasi_static: usize) -> ModalModel {
    ModalModel {
        frequencies: modes.iter().map(|mode| mode.0).collect(),
        damping_ratios: vec![0.0; modes.len()],
        contact_modes: DMatrix::from_fn(
            rows,
            modes.len(),
            |row, mode| {
                if row % 3 == modes[mode].1 { modes[mode].2 } else { 0.0 }
            },
        ),
        shapes: DMatrix::identity(modes.len(), modes.len()),
        quasi_static,
    }
}

/// Returns a mass on a plane, which its spring presses along z and which vibrates along x.
fn swinging_blade(scheme: Scheme, friction: f64, settings: SystemSettings) -> System {
    let modes = [(SWING, 0, 1.0), (PRESS, 2, 1.0), (1e4, 0, 1e4 * SOFT.sqrt()), (1e4, 2, 1e4 * SOFT.sqrt())];
    let delayed = scheme == Scheme::MasslessBoundary;
    let model = if delayed { masses(&modes, 3, 2) } else { masses(&modes[..2], 3, 0) };
    let law = FixedGap { normals: vec![Vector3::z()], gaps: vec![-DEPTH], sliding: vec![Vector3::zeros()] };
    single_sector(&model, GapLaw::Fixed(law), friction, settings)
}

/// Returns a mass on a vibrating plane. A second node without contact gives the free structure an extent.
fn swinging_plane(scheme: Scheme, friction: f64, settings: SystemSettings) -> System {
    let modes = [(PRESS, 2, 1.0), (1e4, 0, 1e4 * SOFT.sqrt()), (1e4, 2, 1e4 * SOFT.sqrt())];
    let delayed = scheme == Scheme::MasslessBoundary;
    let model = if delayed { masses(&modes, 6, 2) } else { masses(&modes[..1], 6, 0) };
    let grid: Vec<[f64; 3]> =
        (0..16).map(|index| [0.05 * f64::from(index / 4) - 0.075, 0.05 * f64::from(index % 4) - 0.075, 0.0]).collect();
    let surface = SurfaceSpline::open(&grid, 4, 4, Interpolation::Spline).unwrap();
    let plane = masses(&[(SWING, 0, 1.0)], 48, 0);
    let positions = vec![-DEPTH * Vector3::z(), 0.1 * Vector3::x()];
    let gap = GapLaw::Open(Box::new(OpenGap::new(positions, vec![0], surface)));
    let touching = StructureParts::Touching(SectorModel::Uncoupled(&model, 1), Box::default());
    let carrier = Some(SurfaceCarrier { structure: 1, first_row: 0 });
    let parameters = ContactParameters { friction, ..ContactParameters::FRICTIONLESS };
    let pair = PairParts { structure: 0, gap, carrier, parameters };
    System::of(vec![touching, StructureParts::Carrying(&plane, false)], vec![pair], Vec::new(), settings)
}

/// Friction F on a mass on a spring k reduces the amplitude by 2F/k at every reversal, whichever of the two bodies
/// vibrates.
#[test]
fn friction_reduces_amplitude_equally_every_half_period() {
    println!("| swings | scheme | solver | amplitudes (mm) | largest error |\n|---|---|---|---|---|");
    let (friction, amplitude, step) = (0.1, 4e-3, 5e-5);
    for scheme in [Scheme::CentralDifference, Scheme::ModalExact, Scheme::MasslessBoundary] {
        for solver in [Solver::Film, Solver::Lcp, Solver::Coulomb] {
            for plane in [false, true] {
                let settings = SystemSettings { scheme, solver, ledger: true };
                let mut system = if plane {
                    swinging_plane(scheme, friction, settings)
                } else {
                    swinging_blade(scheme, friction, settings)
                };
                system.set_step(step);
                let soft = if scheme == Scheme::MasslessBoundary { SOFT } else { 0.0 };
                let pressed = DEPTH / (1.0 + PRESS * PRESS * soft);
                if plane {
                    system.bank_mut().set_modal_state(0, 0, pressed, 0.0);
                    system.structures_mut()[1].modes_mut().set_modal_state(0, 0, amplitude, 0.0);
                } else {
                    system.bank_mut().set_modal_state(0, 0, amplitude, 0.0);
                    system.bank_mut().set_modal_state(1, 0, pressed, 0.0);
                }
                system.start(&[PrescribedMotion::default()]);
                let normal = PRESS * PRESS * pressed;
                let (mut turns, mut last) = (Vec::new(), amplitude);
                while turns.len() < 6 {
                    Recurrence.step(&mut system, &[PrescribedMotion::default()]).unwrap();
                    let bank = system.structures()[usize::from(plane)].modes();
                    let (now, increment) = bank.modal_state(0, 0);
                    let towards = if turns.len() % 2 == 0 { -1.0 } else { 1.0 };
                    if increment * towards < 0.0 && system.steps() > 100 {
                        turns.push(last);
                    }
                    last = now;
                    assert!(system.steps() < 10_000, "no turn after {turns:?}");
                }
                let mut worst = 0.0_f64;
                for (turn, found) in turns.iter().enumerate() {
                    let left = amplitude - 2.0 * (turn + 1) as f64 * friction * normal / (SWING * SWING);
                    let exact = if turn % 2 == 0 { -left } else { left };
                    worst = worst.max((found - exact).abs() / amplitude);
                }
                let swings = if plane { "plane" } else { "mass" };
                let shown = [turns[0], turns[5]].map(|turn| 1e3 * turn);
                println!("| {swings} | {scheme:?} | {solver:?} | {shown:.4?} | {worst:.1e} |");
                assert!(worst < 0.01, "{swings}, {scheme:?}, {solver:?}: {turns:?}");
            }
        }
    }
}

/// The depth of two bumps is relative to the mean clearance, on a surface of revolution, on a spline and in the nominal
/// values.
#[test]
fn sector_gaps_replace_the_common_gap() {
    for spline in [None, Some(SplineSettings::default())] {
        let mut scene = models::rub(SECTORS);
        (scene.settings.surfaces[0].spline, scene.settings.surfaces[0].ramp_time) = (spline, 0.0);
        let gap = scene.settings.contacts[0].gap;
        let mut listed = scene.clone();
        (listed.settings.contacts[0].gap, listed.settings.contacts[0].sector_gaps) = (0.0, vec![gap; SECTORS]);
        let [one, listed] = [scene, listed].map(|scene| started(&scene));
        for (own, other) in one.system().gaps().zip(listed.system().gaps()).filter(|(own, _)| own.is_finite()) {
            assert!((own - other).abs() < 1e-12, "{spline:?}: {own} and {other} m");
        }
        let nominal = |simulation: &Simulation| -> Vec<Option<f64>> {
            simulation.table().variables().iter().map(|variable| variable.nominal).collect()
        };
        assert_eq!(nominal(&one), nominal(&listed));
    }
}

/// Blades of different frequencies and gaps, elongated by spin, press on the casing: each has its individual force.
#[test]
fn gaps_and_frequency_factors_belong_to_their_own_sectors() {
    let factors = [1.0, 1.1, 0.85, 0.95, 1.25];
    let (speed, load) = (600.0, 2e-3);
    for scheme in [Scheme::CentralDifference, Scheme::ModalExact] {
        let mut scene = blades(scheme, Solver::Lcp, 0.0);
        scene.settings.structures[0].speed = speed;
        scene.settings.structures[0].frequency_factors = factors.to_vec();
        scene.settings.time.step = 2e-5;
        scene.settings.contacts[0].sector_gaps = GAPS.to_vec();
        let mut spin = models::spin(3);
        (spin.centrifugal_load, spin.centrifugal_load_speed4) = (vec![load, 0.0, 0.0], vec![0.0; 3]);
        scene.roms[0].extras.spin = Some(spin);
        scene.settings.structures[0].spin.growth = true;
        let mut simulation = started(&scene);
        let stiffness = |sector: usize| STIFFNESS * factors[sector] * factors[sector];
        let push = load * speed * speed / SHAPE;
        for (sector, gap) in GAPS.iter().enumerate() {
            let (found, exact) = (simulation.system().gap(0, sector), gap - push / stiffness(sector));
            assert!((found - exact).abs() < 1e-12, "{scheme:?}, sector {sector}: gap {found}, exactly {exact}");
        }
        move_on(&mut simulation, "casing_radius_change", 0.0, -8e-4 / 4e-3);
        go(&mut simulation, 4e-3);
        // The forces of a step close its gaps: each blade deflects by its individual flexibility.
        for (sector, gap) in GAPS.iter().enumerate() {
            let left = gap - 8e-4 - simulation.system().bank().row(0, sector);
            assert!(left.abs() < 1e-12, "{scheme:?}, sector {sector}: {left:e} m are left between blade and casing");
        }
        move_on(&mut simulation, "casing_radius_change", -8e-4, 0.0);
        go(&mut simulation, 4e-3);
        for (sector, gap) in GAPS.iter().enumerate() {
            let (found, exact) = (simulation.system().multiplier(0, sector), stiffness(sector) * (8e-4 - gap) + push);
            println!("{scheme:?}, sector {sector}: {found:.4} N, exactly {exact:.4} N");
            assert!((found / exact - 1.0).abs() < 1e-5, "{scheme:?}, sector {sector}: {found} N, exactly {exact} N");
        }
    }
}

/// e^(−2ξωh) of every mode: a damping parameter affects the structure in its name.
#[test]
fn damping_parameters_belong_to_their_own_structures() {
    let mut ring = models::rub(3);
    models::flexible(&mut ring);
    let plates = lattice::with(lattice::squeezed(), 0.0, Solver::Lcp, Scheme::ModalExact);
    let cases: [(Scene, &[(&str, f64)]); 2] = [
        (ring, &[("damping_ratio", 0.03), ("casing_damping_ratio", 0.11)]),
        (plates, &[("damping_ratio", 0.04), ("left_plate.damping_ratio", 0.07), ("right_plate.damping_ratio", 0.13)]),
    ];
    for (scene, ratios) in cases {
        let mut simulation = Simulation::new(&scene).unwrap();
        for (name, ratio) in ratios {
            set(&mut simulation, name, *ratio);
        }
        simulation.initialise(0.0).unwrap();
        go(&mut simulation, 7.7e-7);
        let system = simulation.system();
        let banks = system.structures().iter().map(|structure| structure.modes());
        let banks: Vec<_> = banks.collect();
        assert_eq!(banks.len(), ratios.len());
        for (bank, (name, ratio)) in banks.iter().zip(ratios) {
            for (mode, frequency) in bank.model().frequencies.iter().enumerate() {
                let exact = (-2.0 * ratio * frequency * bank.step()).exp();
                let found = bank.coefficients(0)[mode].beta;
                assert!((found - exact).abs() < 1e-14, "{name}, mode {mode}: {found}, exactly {exact}");
            }
        }
    }
}

/// A released structure decays with its damping parameter, whatever the scene sets: the casing by its load, the blades
/// by their speed.
#[test]
fn casing_and_blades_decay_at_their_damping_parameters() {
    let (casing, rotor) = (0.06, 0.03);
    let mut scene = blades(Scheme::ModalExact, Solver::Lcp, 0.0);
    models::flexible(&mut scene);
    scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 2e3, phase: 0.0 });
    scene.settings.outputs.slave_displacement = true;
    scene.settings.structures[0].speed = 600.0;
    let mut spin = models::spin(3);
    (spin.centrifugal_load, spin.centrifugal_load_speed4) = (vec![2e-3, 0.0, 0.0], vec![0.0; 3]);
    scene.roms[0].extras.spin = Some(spin);
    scene.settings.structures[0].spin.growth = true;
    let mut simulation = Simulation::new(&scene).unwrap();
    set(&mut simulation, "casing_damping_ratio", casing);
    set(&mut simulation, "damping_ratio", rotor);
    simulation.initialise(0.0).unwrap();
    let read = |simulation: &Simulation| {
        [simulation.real(reference(simulation, "casing_displacement")).unwrap(), simulation.system().bank().row(0, 0)]
    };
    let start = read(&simulation);
    set(&mut simulation, "casing_load_amplitude", 0.0);
    set(&mut simulation, "speed", 0.0);
    // One internal step of a thousandth of a period: the course of the load within it is irrelevant.
    go(&mut simulation, 1e-6);
    for _ in 0..40 {
        go(&mut simulation, 1e-4);
        let found = read(&simulation);
        for (body, (ratio, omega)) in [(casing, TAU * 400.0), (rotor, MODES[0])].into_iter().enumerate() {
            let damped = omega * (1.0_f64 - ratio * ratio).sqrt();
            let (time, lag) = (simulation.time() - 5e-7, ratio * omega / damped);
            let exact = (-ratio * omega * time).exp() * ((damped * time).cos() + lag * (damped * time).sin());
            let found = found[body] / start[body];
            assert!((found - exact).abs() < 0.01, "body {body} at {time}: {found}, exactly {exact}");
        }
    }
}
