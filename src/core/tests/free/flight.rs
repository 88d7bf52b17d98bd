//! Free masters: flight, impact, sliding between two surfaces; laws of mechanics, and states that continue.

use lattice::*;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::*;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_test_models::{element, go, lattice, real, saved, started};

const SCHEMES: [Scheme; 2] = [Scheme::CentralDifference, Scheme::ModalExact];

fn total_mass() -> f64 {
    places().map(node_mass).sum()
}

fn size(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Returns scenes with contact: (name, scene, communication steps of 1e-5 s).
fn events() -> Vec<(&'static str, Scene, usize)> {
    let thrown = |velocity| {
        scene(block([0.0; 3], 3e6), &[(BlockSide::Left, 0.0203), (BlockSide::Right, 0.021)], false, velocity)
    };
    let mut corner = scene(block([0.0; 3], 3e6), &[(BlockSide::Left, 0.0203)], false, [-15.0, 3.0, 2.0]);
    corner.settings.contacts[0].nodes = Some("left_00".into());
    let mut facets = squeezed();
    let mut rigid = squeezed_by(1e-4, [0.0, -40.0, 1.0]);
    for surface in &mut facets.settings.surfaces {
        surface.spline = Some(SplineSettings { interpolation: Interpolation::Facets, ..SplineSettings::default() });
    }
    rigid.settings.surfaces[1].rigid = true;
    vec![
        ("bounces between plates", thrown([-12.0, 6.0, 1.0]), 60),
        ("one edge hits", corner, 35),
        ("squeezed through", squeezed(), 150),
        ("squeezed through facets", facets, 130),
        ("one side rigid", rigid, 130),
    ]
}

/// The limit of small displacements is relative to the smallest surface that the body can touch, for both of its pairs.
#[test]
fn displacement_limit_scales_with_the_smallest_surface() {
    let mut both = scene(block([0.0; 3], 3e6), &[(BlockSide::Left, 0.06), (BlockSide::Right, 0.06)], false, [0.0; 3]);
    let wide = largest_of_pairs(&both);
    assert!(wide[0] > 0.0 && wide[0].to_bits() == wide[1].to_bits(), "{wide:?}");
    let plate = both.roms.last_mut().unwrap();
    for node in &mut plate.contact_nodes {
        node.position = [node.position[0], 0.01 * node.position[1], 0.01 * node.position[2]];
    }
    let narrow = largest_of_pairs(&both);
    assert!(narrow[0] < 0.2 * wide[0] && narrow[0].to_bits() == narrow[1].to_bits(), "{narrow:?} {wide:?}");
}

fn largest_of_pairs(scene: &Scene) -> Vec<f64> {
    let largest = |pair: &tiprub_core::system::ContactPair| match pair.gap() {
        tiprub_core::geometry::GapLaw::Open(gap) => gap.largest,
        other => panic!("{other:?}"),
    };
    started(scene).system().pairs().iter().map(largest).collect()
}

#[test]
fn every_scheme_and_solver_conserves_momentum_and_energy() {
    println!("| scene | scheme | solver | µ | momentum | residual / energy |\n|---|---|---|---|---|---|");
    let (mut momentum_off, mut residual_off) = (0.0_f64, 0.0_f64);
    for (name, scene, steps) in events() {
        for (scheme, solver, friction) in SCHEMES.iter().flat_map(|scheme| {
            Solver::ALL.iter().flat_map(move |solver| [0.0, 0.2].map(|friction| (*scheme, *solver, friction)))
        }) {
            let mut simulation = started(&with(scene.clone(), friction, solver, scheme));
            let (start, mut impulse, mut exchanged) = (vector(&simulation, "block.velocity"), [0.0; 3], 0.0_f64);
            let (mut off, mut residual) = (0.0_f64, 0.0_f64);
            for _ in 0..steps {
                go(&mut simulation, 1e-5);
                let force = vector(&simulation, "force");
                let pairs = scene
                    .settings
                    .surfaces
                    .iter()
                    .map(|surface| vector(&simulation, &format!("{}.force", surface.name)));
                let sum = pairs.fold([0.0; 3], |sum, force| std::array::from_fn(|i| sum[i] + force[i]));
                let apart: [f64; 3] = std::array::from_fn(|i| sum[i] - force[i]);
                assert!(size(apart) <= 1e-12 * size(force), "pairs {sum:?}, all {force:?}");
                impulse = std::array::from_fn(|i| impulse[i] + 1e-5 * force[i]);
                exchanged += 1e-5 * size(force);
                let velocity = vector(&simulation, "block.velocity");
                let missed = std::array::from_fn(|i| total_mass() * (velocity[i] - start[i]) - impulse[i]);
                off = off.max(size(missed));
                residual = residual.max(real(&simulation, "energy_residual_relative").abs());
            }
            let off = off / (exchanged + total_mass() * size(start));
            println!("| {name} | {scheme:?} | {solver:?} | {friction} | {off:.1e} | {residual:.1e} |");
            assert!(exchanged > 0.02 * total_mass() * 10.0, "{name}: hardly anything happened, {exchanged} N·s");
            (momentum_off, residual_off) = (momentum_off.max(off), residual_off.max(residual));
            assert!(
                off < 1e-13 && residual < 1e-13,
                "{name}, {scheme:?}, {solver:?}, {friction}: {off:e}, {residual:e}"
            );
            if friction == 0.0 {
                assert!(simulation.table().find("friction_loss").is_none());
            } else {
                assert!(real(&simulation, "friction_loss") > 0.0);
            }
        }
    }
    println!("momentum within {momentum_off:.1e}, energy within {residual_off:.1e}");
}

/// Returns the angular momentum about z of linear theory, Σ m (X × v), from the displacements of all nodes.
fn angular_momentum(simulation: &Simulation, rom: &tiprub_core::Rom) -> f64 {
    let bank = simulation.system().bank();
    let rate = |node: usize, i: usize| {
        (bank.displacement()[3 * node + i] - bank.displacement_before()[3 * node + i]) / bank.step()
    };
    let of = |(node, place): (usize, [usize; 3])| {
        let [x, y, _] = rom.contact_nodes[node].position;
        node_mass(place) * (x * rate(node, 1) - y * rate(node, 0))
    };
    places().enumerate().map(of).sum()
}

#[test]
fn off_centre_impact_rotates_the_body() {
    for (scheme, friction) in [(Scheme::CentralDifference, 0.0), (Scheme::ModalExact, 0.3)] {
        let (_, scene, _) = events().swap_remove(1);
        let scene = with(scene, friction, Solver::Lcp, scheme);
        let mut simulation = started(&scene);
        let (start, mut moment, mut largest) = (angular_momentum(&simulation, &scene.roms[0]), 0.0, 0.0_f64);
        simulation.begin_step(0.0, 3.5e-4).unwrap();
        loop {
            let finished = simulation.advance().unwrap().finished;
            for event in simulation.system().events() {
                let [x, y, _] = scene.roms[0].contact_nodes[event.node].position;
                moment += (x * event.force[1] - y * event.force[0]) * simulation.system().bank().step();
            }
            largest = largest.max(moment.abs());
            let off = angular_momentum(&simulation, &scene.roms[0]) - start - moment;
            // Velocities are differences of positions of 1e-2 m over 1e-6 s.
            assert!(off.abs() < 1e-9 * (largest + 1e-3), "{scheme:?}: {off:e} N·m·s of {largest:e}");
            if finished {
                break;
            }
        }
        println!("{scheme:?}: angular impulse {moment:.3e} N·m·s");
        assert!(largest > 1e-3, "nothing turned: {largest:e}");
    }
}

/// Returns the largest difference between left and right and the largest value: displacements across (m), forces (N).
fn asymmetry(simulation: &Simulation) -> [[f64; 2]; 2] {
    let mirror = |node: usize| (PER_SIDE - 1 - node / 9) * 9 + node % 9;
    let values = |name: &str| (0..27).map(|node| element(simulation, name, node)).collect::<Vec<_>>();
    let (x, force) = (values("block.node_displacement_x"), values("block.normal_force"));
    let largest = |values: &[f64]| values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let off = (0..27).map(|node| (x[node] + x[mirror(node)]).abs()).fold(0.0, f64::max);
    let uneven = (0..27).map(|node| (force[node] - force[mirror(node)]).abs()).fold(0.0, f64::max);
    [[off, largest(&x)], [uneven, largest(&force)]]
}

#[test]
fn a_symmetric_scene_stays_symmetric_to_rounding() {
    for (scheme, solver) in SCHEMES.iter().flat_map(|scheme| Solver::ALL.map(|solver| (*scheme, solver))) {
        let mut simulation = started(&with(squeezed(), 0.15, solver, scheme));
        let mut most = [[0.0_f64; 2]; 2];
        for _ in 0..60 {
            go(&mut simulation, 1e-5);
            let now = asymmetry(&simulation);
            most = std::array::from_fn(|i| std::array::from_fn(|j| most[i][j].max(now[i][j])));
        }
        let [off, uneven] = most.map(|[off, largest]| off / largest);
        let most = most[1][1];
        println!("{scheme:?}, {solver:?}: displacements {off:.1e}, forces {uneven:.1e} of {most:.3e} N");
        // Gauss-Seidel handles the contacts one after the other and ends at its tolerance.
        let bound = if solver == Solver::Coulomb { 1e-8 } else { 1e-10 };
        assert!(off < bound && uneven < bound && most > 100.0, "{scheme:?}, {solver:?}: {off:e}, {uneven:e}");
    }
}

#[test]
fn film_with_central_differences_matches_the_paper() {
    use nalgebra::{DMatrix, DVector};
    let (h, friction, velocity) = (1e-6, 0.2, [-12.0, 6.0, 1.0]);
    let distances = [0.0203, 0.0205];
    let plates = [(BlockSide::Left, distances[0]), (BlockSide::Right, distances[1])];
    let mut scene =
        with(scene(block([0.0; 3], 3e6), &plates, false, velocity), friction, Solver::Film, Scheme::CentralDifference);
    scene.settings.surfaces.iter_mut().for_each(|surface| surface.rigid = true);
    let (mut simulation, rom) = (started(&scene), &scene.roms[0]);
    let order = rom.order();
    let start = DVector::from_fn(order, |row, _| -h * velocity[row % 3]);
    let none = DMatrix::zeros(order, order);
    let (mass, stiffness) = (rom.mass.clone(), rom.stiffness.clone());
    let mut dense = tiprub_reference::paper::DenseFilm::new(mass, none, stiffness, h, DVector::zeros(order), start);
    let contacts: Vec<(usize, f64)> = (0..27)
        .filter_map(|node| [(0, 1.0), (2, -1.0)].into_iter().find(|side| side.0 == node / 9).map(|side| (node, side.1)))
        .collect();
    let gaps = DVector::from_iterator(18, contacts.iter().map(|(_, x)| distances[usize::from(*x < 0.0)] - 0.5 * SIDE));
    let (mut off, mut force_off, mut touched) = (0.0_f64, 0.0_f64, 0);
    for _ in 0..500 {
        // Prediction (9), whose slip determines the direction of friction.
        let force = &rom.stiffness * &dense.now;
        let moved = DVector::from_fn(order, |row, _| {
            dense.now[row] - dense.before[row] - h * h * force[row] / rom.mass[(row, row)]
        });
        let (mut normal, mut sliding) = (DMatrix::zeros(order, 18), DMatrix::zeros(order, 18));
        for (column, (node, x)) in contacts.iter().enumerate() {
            let [y, z] = [1, 2].map(|i| moved[3 * node + i]);
            normal[(3 * node, column)] = *x;
            sliding[(3 * node, column)] = *x;
            sliding[(3 * node + 1, column)] = -friction * y / y.hypot(z);
            sliding[(3 * node + 2, column)] = -friction * z / y.hypot(z);
        }
        let multipliers = dense.step(&normal, &sliding, &gaps);
        go(&mut simulation, h);
        touched += multipliers.iter().filter(|value| **value != 0.0).count();
        let displacement = simulation.system().bank().displacement();
        off = (0..order).fold(off, |off, row| off.max((displacement[row] - dense.now[row]).abs()));
        for (column, (node, _)) in contacts.iter().enumerate() {
            force_off = force_off.max((simulation.system().multiplier(*node, 0) - multipliers[column]).abs());
        }
    }
    println!("{touched} contacts, displacements {off:.1e} m, forces {force_off:.1e} N");
    assert!(touched > 200 && off < 1e-14 && force_off < 1e-4, "{touched}, {off:e}, {force_off:e}");
}

#[test]
fn distant_contact_pair_has_no_effect() {
    let (body, velocity) = (|| block([0.0; 3], 3e6), [-12.0, 6.0, 1.0]);
    let one = scene(body(), &[(BlockSide::Left, 0.0203)], true, velocity);
    let two = scene(body(), &[(BlockSide::Left, 0.0203), (BlockSide::Right, 5.0)], true, velocity);
    for solver in Solver::ALL {
        let mut runs = [&one, &two].map(|scene| started(&with(scene.clone(), 0.2, solver, Scheme::ModalExact)));
        let mut touched = false;
        for _ in 0..60 {
            for simulation in &mut runs {
                go(simulation, 1e-5);
            }
            let [first, second] = &runs;
            let bits = |simulation: &Simulation| {
                simulation.system().bank().displacement().iter().map(|value| value.to_bits()).collect::<Vec<_>>()
            };
            assert_eq!(bits(first), bits(second));
            touched |= real(first, "normal_impulse") > 0.0;
        }
        assert!(touched);
    }
}

#[test]
fn sticking_friction_stops_the_body() {
    let mut scene = with(squeezed_by(6e-4, [0.0, -14.0, 0.0]), 0.9, Solver::Coulomb, Scheme::ModalExact);
    scene.settings.structures.iter_mut().for_each(|structure| structure.damping_ratio = Some(0.05));
    let mut simulation = started(&scene);
    for _ in 0..800 {
        go(&mut simulation, 1e-5);
    }
    let (kinetic, strain) = (real(&simulation, "kinetic_energy"), real(&simulation, "strain_energy"));
    let velocity = size(vector(&simulation, "block.velocity"));
    let start = 0.5 * total_mass() * 14.0_f64.powi(2);
    println!("kinetic {kinetic:.2e} J of {start:.1} J, strain {strain:.2e} J, {velocity:.2e} m/s");
    assert!(kinetic < 1e-3 * start && strain > 10.0 * kinetic && velocity < 0.3);
    assert!(real(&simulation, "energy_residual_relative").abs() < 1e-13);
    assert!(simulation.integer(simulation.table().find("contact_count").unwrap().reference).unwrap() > 3);
}

#[test]
fn saved_state_continues_with_equal_bits_and_reset_restarts() {
    for solver in Solver::ALL {
        let scene = with(squeezed(), 0.15, solver, Scheme::ModalExact);
        let values = |simulation: &Simulation| {
            (0..u32::try_from(simulation.table().references()).unwrap())
                .filter_map(|reference| simulation.real(reference).ok().map(f64::to_bits))
                .collect::<Vec<_>>()
        };
        let mut simulation = started(&scene);
        (0..35).for_each(|_| go(&mut simulation, 1e-5));
        let state = saved(&simulation);
        (0..30).for_each(|_| go(&mut simulation, 1e-5));
        let end = values(&simulation);
        assert!(real(&simulation, "normal_impulse") > 0.0, "still in contact");

        simulation.restore_state(&state).unwrap();
        (0..30).for_each(|_| go(&mut simulation, 1e-5));
        assert_eq!(values(&simulation), end);
        let mut other = Simulation::new(&scene).unwrap();
        other.restore_state(&state).unwrap();
        (0..30).for_each(|_| go(&mut other, 1e-5));
        assert_eq!(values(&other), end);

        simulation.reset();
        simulation.initialise(0.0).unwrap();
        (0..65).for_each(|_| go(&mut simulation, 1e-5));
        assert_eq!(values(&simulation), end);
    }
}

#[test]
fn energy_balance_closes_when_the_step_changes() {
    for scheme in SCHEMES {
        let mut simulation = started(&with(squeezed(), 0.15, Solver::Lcp, scheme));
        for index in 0..120 {
            go(&mut simulation, if index % 2 == 0 { 1e-5 } else { 0.63e-5 });
            let residual = real(&simulation, "energy_residual_relative");
            assert!(residual.abs() < 1e-13, "{scheme:?}, step {index}: {residual:e}");
        }
        let (change, start) = (real(&simulation, "step_change_energy"), 0.5 * total_mass() * 1600.0);
        println!("{scheme:?}: energy by changes of the step {change:.2e} J of {start:.1} J");
        assert!(change != 0.0 && change.abs() < 0.02 * start);
    }
}

#[test]
fn the_initial_velocity_is_a_parameter() {
    let mut simulation = Simulation::new(squeezed()).unwrap();
    let reference = simulation.table().find("initial_velocity_z").unwrap().reference;
    simulation.set_real(reference, 7.0).unwrap();
    simulation.initialise(0.0).unwrap();
    let velocity = vector(&simulation, "block.velocity");
    assert!((velocity[1] + 40.0).abs() < 1e-13 && (velocity[2] - 7.0).abs() < 1e-14, "{velocity:?}");
    assert!(simulation.set_real(reference, 8.0).is_err(), "fixed");
}

#[test]
fn step_does_not_allocate() {
    for solver in Solver::ALL {
        let mut simulation = started(&with(squeezed(), 0.15, solver, Scheme::ModalExact));
        let mut time = 0.0;
        let count = crate::counting::allocations_of(|| {
            for _ in 0..150 {
                simulation.do_step(time, 1e-5).unwrap();
                time = simulation.time();
            }
        });
        assert_eq!(count, 0, "{solver:?}");
        assert!(simulation.system().factorisations() > 0, "{solver:?}: nothing touched");
    }
}

#[test]
fn the_first_step_may_have_any_length() {
    let velocity = [-12.0, 6.0, 1.0];
    for scheme in SCHEMES {
        let scene = with(
            scene(block([0.0; 3], 3e6), &[(BlockSide::Left, 0.1), (BlockSide::Right, 0.1)], false, velocity),
            0.2,
            Solver::Lcp,
            scheme,
        );
        // The scene uses steps of 1e-6 s; these change them.
        for first in [1e-5, 0.7e-6, 1.4e-6, 3.3e-6, 1e-9, 1e-12] {
            let mut simulation = started(&scene);
            let state = saved(&simulation);
            let mut restored = Simulation::new(&scene).unwrap();
            restored.restore_state(&state).unwrap();
            for simulation in [&mut simulation, &mut restored] {
                for length in [first, first, 1e-5, 0.63e-5] {
                    go(simulation, length);
                }
                let (found, moved) = (vector(simulation, "block.velocity"), vector(simulation, "block.displacement"));
                for axis in 0..3 {
                    let way = velocity[axis] * simulation.time();
                    assert!((found[axis] - velocity[axis]).abs() < 1e-10 * size(velocity), "H = {first} s: {found:?}");
                    assert!((moved[axis] - way).abs() < 1e-10 * way.abs(), "H = {first} s: {moved:?} m, not {way} m");
                }
                assert!(real(simulation, "energy_residual_relative").abs() < 1e-10, "H = {first} s");
            }
        }
    }
}

/// Returns the scene rotated about the origin by `r` and shifted by `shift` (m).
fn carried_elsewhere(scene: &Scene, r: [[f64; 3]; 3], shift: [f64; 3]) -> Scene {
    let turned = |v: [f64; 3]| r.map(|row| (0..3).map(|j| row[j] * v[j]).sum::<f64>());
    let mut scene = scene.clone();
    for rom in &mut scene.roms {
        for node in &mut rom.contact_nodes {
            let position = turned(node.position);
            node.position = std::array::from_fn(|i| position[i] + shift[i]);
        }
        let map = rom.contact_map.clone();
        for node in 0..rom.contact_nodes.len() {
            for column in 0..map.ncols() {
                let moved = turned([0, 1, 2].map(|i| map[(3 * node + i, column)]));
                (0..3).for_each(|i| rom.contact_map[(3 * node + i, column)] = moved[i]);
            }
        }
    }
    scene.settings.structures[0].velocity = turned(scene.settings.structures[0].velocity);
    scene
}

#[test]
fn result_is_independent_of_scene_position_and_orientation() {
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let about_z = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let oblique = [[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]];
    for solver in Solver::ALL {
        let here = with(squeezed_by(3e-4, [0.0, -40.0, 3.0]), 0.15, solver, Scheme::ModalExact);
        for (r, shift, bound) in [
            (about_z, [0.0; 3], 1e-10),
            (oblique, [0.0; 3], 1e-10),
            // Coordinates of 10 m round to 2e-15 m, penetrations are 1e-8 m.
            (identity, [10.0, -7.0, 3.0], 1e-7),
        ] {
            let mut runs = [started(&here), started(&carried_elsewhere(&here, r, shift))];
            let (mut off, mut largest) = (0.0_f64, 0.0_f64);
            for _ in 0..40 {
                runs.iter_mut().for_each(|simulation| go(simulation, 1e-5));
                for node in 0..27 {
                    let [first, second] = [0, 1].map(|run| element(&runs[run], "block.normal_force", node));
                    (off, largest) = (off.max((first - second).abs()), largest.max(first));
                }
            }
            println!("{solver:?}, {r:?} {shift:?}: {:.1e} of {largest:.2e} N", off / largest);
            assert!(largest > 100.0 && off < bound * largest, "{solver:?}, {shift:?}: {off:e} N");
            let losses = [0, 1].map(|run| real(&runs[run], "friction_loss"));
            assert!((losses[0] - losses[1]).abs() < bound * losses[0], "{losses:?}");
        }
    }
}

#[test]
fn the_chapter_on_variables_lists_every_variable() {
    let chapter = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/variables.md")).unwrap();
    let (_, free) = chapter.split_once("## Scenes of a free structure").unwrap();
    let mut scene = with(squeezed(), 0.15, Solver::Lcp, Scheme::ModalExact);
    scene.settings.outputs.instantaneous_forces = true;
    for variable in Simulation::new(&scene).unwrap().table().variables() {
        let name = variable.name.replace("right", "left");
        let name = name.strip_suffix("_y").or(name.strip_suffix("_z")).map_or(name.clone(), |axis| format!("{axis}_x"));
        assert!(name == "time" || free.contains(&format!("`{name}`")), "{name}");
    }
}

#[test]
fn gaps_at_the_start_are_distances_to_the_surfaces() {
    let flat = scene(block([0.0; 3], 3e6), &[(BlockSide::Left, 0.0203), (BlockSide::Right, 0.021)], false, [0.0; 3]);
    let simulation = started(&flat);
    for (node, place) in places().enumerate() {
        let expected = match place[0] {
            0 => 0.0003,
            2 => 0.001,
            // Nodes without a pair have nothing to touch.
            _ => 1e9,
        };
        let found = element(&simulation, "block.clearance", u32::try_from(node).unwrap());
        assert!((found - expected).abs() < 1e-16, "{found} m, {expected} m");
    }
}
