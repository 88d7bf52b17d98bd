//! Stress recovered by a reduced model against the full model and closed forms.

use crate::common::{dense, distorted_box, nodes_at, steel, straight_box, wobble};
use crate::guide::{self, print_row};
use nalgebra::{DMatrix, DVector};
use tiprub_core::scene::rom::{DisplacementFrame, STRESSES, von_mises};
use tiprub_core::{CoSimulation, Simulation};
use tiprub_model::assembly::{assemble, free_dofs};
use tiprub_model::craig_bampton::dense_modes;
use tiprub_model::element::{ElementKind, nodal_stress};
use tiprub_model::patches::contact_patches;
use tiprub_model::progress::silent;
use tiprub_model::reduce::{ContactPoint, Reduction, ReductionKind, ReductionOptions, reduce};
use tiprub_model::sparse::principal_pair;
use tiprub_model::stress::StressPlaces;
use tiprub_model::thermal::{patch_loads, whole_mesh};
use tiprub_model::{Material, Mesh};
use tiprub_test_models as models;

const SIZE: [f64; 3] = [0.3, 0.02, 0.06];

fn reduced(
    mesh: &Mesh,
    contact: &[ContactPoint],
    (kind, modes): (ReductionKind, usize),
    stress: StressPlaces,
) -> tiprub_model::Result<Reduction> {
    let options = ReductionOptions {
        name: "beam".into(),
        kind,
        modes,
        checked_modes: 6,
        sectors: 1,
        frame: DisplacementFrame::Cartesian,
        watched: Vec::new(),
        stress,
        damping_ratio: 0.0,
    };
    let clamped = nodes_at(mesh, 0, 0.0);
    reduce(mesh.clone(), &steel(), &clamped, contact, &options, &silent)
}

/// Returns the node nearest to a point.
fn nearest(mesh: &Mesh, point: [f64; 3]) -> usize {
    let off = |node: &[f64; 3]| (0..3).map(|i| (node[i] - point[i]).powi(2)).sum::<f64>();
    (0..mesh.nodes.len()).min_by(|a, b| off(&mesh.nodes[*a]).total_cmp(&off(&mesh.nodes[*b]))).unwrap()
}

/// A cantilever loaded at its end: σxx = M y / I at half its length, for any number of modes.
#[test]
fn cantilever_bending_stress_matches_beam_theory() {
    let mesh = straight_box(ElementKind::Hex20, [12, 2, 3], SIZE);
    let tip = contact_patches(&mesh, &nodes_at(&mesh, 0, SIZE[0]), 1, |_| "end".into()).unwrap();
    let middle = [0.5 * SIZE[0], 0.0, 0.5 * SIZE[2]];
    let above = [middle[0], SIZE[1], middle[2]];
    let nodes = vec![("below".to_owned(), nearest(&mesh, middle)), ("above".to_owned(), nearest(&mesh, above))];
    for modes in [0, 5] {
        let places = StressPlaces { nodes: nodes.clone(), modes: 0 };
        let rom = reduced(&mesh, &tip, (ReductionKind::FreeInterface, modes), places).unwrap().rom;
        let force = rom.contact_map.transpose() * DVector::from_vec(vec![0.0, 1000.0, 0.0]);
        let moved = rom.stiffness.clone().lu().solve(&force).unwrap();
        let stress = &rom.extras.stress.as_ref().unwrap().map * moved;
        let inertia = SIZE[2] * SIZE[1].powi(3) / 12.0;
        let expected = 1000.0 * 0.5 * SIZE[0] * 0.5 * SIZE[1] / inertia;
        for (place, sign) in [(0, 1.0), (1, -1.0)] {
            let found = stress[STRESSES * place];
            assert!((found - sign * expected).abs() < 2e-3 * expected, "{modes} modes: {found:e}, {expected:e}");
            let all = std::array::from_fn(|component| stress[STRESSES * place + component]);
            assert!((von_mises(all) - expected).abs() < 2e-2 * expected, "{modes} modes: {all:?}");
        }
    }
}

/// Directions depend on the place: a cylindrical frame gives the same invariants, and normal stresses along its axes.
#[test]
fn stress_directions_follow_the_displacement_frame() {
    let mut mesh = distorted_box(ElementKind::Hex20, [4, 1, 3], SIZE, wobble(0.1));
    // Off the x axis, so that the directions differ.
    mesh.nodes.iter_mut().for_each(|node| node[1] += 0.2);
    let tip = contact_patches(&mesh, &nodes_at(&mesh, 0, SIZE[0]), 2, |index| format!("patch_{index}")).unwrap();
    let place = nearest(&mesh, [0.15, 0.22, 0.03]);
    let of = |frame| {
        let options = ReductionOptions {
            name: "beam".into(),
            kind: ReductionKind::FreeInterface,
            modes: 8,
            checked_modes: 6,
            sectors: 1,
            frame,
            watched: Vec::new(),
            stress: StressPlaces { nodes: vec![("place".into(), place)], modes: 0 },
            damping_ratio: 0.0,
        };
        let rom = reduce(mesh.clone(), &steel(), &nodes_at(&mesh, 0, 0.0), &tip, &options, &silent).unwrap().rom;
        // The same force along x on the first patch, in the directions of either frame at its middle.
        let [r, angle, _] = rom.contact_nodes[0].position;
        let direction = match frame {
            DisplacementFrame::Cartesian => [1.0, 0.0, 0.0],
            DisplacementFrame::Cylindrical => [angle.cos(), -angle.sin(), 0.0],
        };
        assert!(r > 0.0);
        let mut force = DVector::zeros(6);
        force.rows_mut(0, 3).copy_from_slice(&direction);
        let moved = rom.stiffness.clone().lu().solve(&(rom.contact_map.transpose() * force)).unwrap();
        let stress = rom.extras.stress.unwrap();
        let values: [f64; STRESSES] = std::array::from_fn(|i| (stress.map.row(i) * &moved)[0]);
        (values, stress.points[0].position)
    };
    let (cartesian, position) = of(DisplacementFrame::Cartesian);
    let (cylindrical, place) = of(DisplacementFrame::Cylindrical);
    assert!((place[0] - position[0].hypot(position[1])).abs() < 1e-15);
    // A patch distributes a cylindrical force along the directions of each node, which is nearly that force.
    let close = |a: f64, b: f64| assert!((a - b).abs() < 2e-2 * von_mises(cartesian), "{cartesian:?} {cylindrical:?}");
    close(von_mises(cartesian), von_mises(cylindrical));
    let (cos, sin) = (place[1].cos(), place[1].sin());
    let [xx, yy, zz, xy, ..] = cartesian;
    close(cylindrical[0], xx * cos * cos + yy * sin * sin + 2.0 * xy * sin * cos);
    close(cylindrical[1], xx * sin * sin + yy * cos * cos - 2.0 * xy * sin * cos);
    close(cylindrical[2], zz);
    close(cylindrical[3], (yy - xx) * sin * cos + xy * (cos * cos - sin * sin));
}

/// The largest stress of a mode: bending of a cantilever at its root, away from the clamped elements.
#[test]
fn modal_stress_points_lie_at_the_largest_stress() {
    let mesh = straight_box(ElementKind::Hex20, [12, 1, 3], SIZE);
    let tip = contact_patches(&mesh, &nodes_at(&mesh, 0, SIZE[0]), 2, |index| format!("patch_{index}")).unwrap();
    let places = StressPlaces { nodes: vec![("mine".into(), nearest(&mesh, [0.15, 0.02, 0.03]))], modes: 2 };
    let rom = reduced(&mesh, &tip, (ReductionKind::FreeInterface, 6), places).unwrap().rom;
    let names: Vec<&str> = rom.extras.stress.as_ref().unwrap().points.iter().map(|point| point.name.as_str()).collect();
    assert_eq!(names, ["mine", "mode_1", "mode_2"]);
    let at = |place: usize| rom.extras.stress.as_ref().unwrap().points[place].position;
    // First bending: the outer fibre of the first element that is not clamped.
    let element = SIZE[0] / 12.0;
    assert!((at(1)[0] - element).abs() < 1e-12, "{:?}", at(1));
    assert!(at(1)[1].abs() < 1e-12 || (at(1)[1] - SIZE[1]).abs() < 1e-12, "{:?}", at(1));
    let refused =
        |places: StressPlaces| reduced(&mesh, &tip, (ReductionKind::FreeInterface, 6), places).unwrap_err().to_string();
    let reported = refused(StressPlaces { nodes: Vec::new(), modes: 7 });
    assert!(reported.starts_with("points of largest stress: 7 requested"), "{reported}");
    let reported = refused(StressPlaces { nodes: vec![("a".into(), 100_000)], modes: 0 });
    assert!(reported.contains("`a`") && reported.contains("node 100001 does not exist"), "{reported}");
    let reported = refused(StressPlaces { nodes: vec![("a".into(), 0), ("a".into(), 1)], modes: 0 });
    assert!(reported.contains("`a`: it appears twice"), "{reported}");
}

/// Returns pulses of force on three patches, one after the other (N).
fn pushed(time: f64, pulse: f64) -> DVector<f64> {
    let mut force = DVector::zeros(9);
    for patch in 0..3 {
        let since = time - 0.5 * pulse * patch as f64;
        if (0.0..pulse).contains(&since) {
            let push = -3e3 * (std::f64::consts::PI * since / pulse).sin();
            force[3 * patch] = push;
            force[3 * patch + 1] = 0.15 * push;
        }
    }
    force
}

/// Computes modal coordinates (angular frequencies squared, shapes M-orthonormal) under forces of `loads` per unit,
/// sample by sample; each mode is exact for forces that are linear between samples.
fn driven(squares: &[f64], loads: &DMatrix<f64>, step: f64, samples: usize, pulse: f64) -> Vec<DVector<f64>> {
    let forces: Vec<DVector<f64>> = (0..=samples).map(|sample| loads * pushed(step * sample as f64, pulse)).collect();
    let mut all = vec![DVector::zeros(squares.len()); samples + 1];
    for (mode, square) in squares.iter().enumerate() {
        let omega = square.sqrt();
        let (sin, cos) = (omega * step).sin_cos();
        let (mut position, mut velocity) = (0.0, 0.0);
        for sample in 0..samples {
            let (from, to) = (forces[sample][mode] / square, forces[sample + 1][mode] / square);
            // The static response is linear; the rest is free vibration.
            let slope = (to - from) / step;
            let (off, speed) = (position - from, velocity - slope);
            position = to + off * cos + speed / omega * sin;
            velocity = slope - off * omega * sin + speed * cos;
            all[sample + 1][mode] = position;
        }
    }
    all
}

/// Stress under the same contact forces: a reduced model against all modes of the full one, for several numbers of
/// modes.
#[test]
fn stress_converges_to_the_full_model() {
    let mesh = distorted_box(ElementKind::Hex20, [6, 1, 4], SIZE, wobble(0.1));
    let tip = contact_patches(&mesh, &nodes_at(&mesh, 0, SIZE[0]), 3, |index| format!("patch_{index}")).unwrap();
    let clamped = nodes_at(&mesh, 0, 0.0);
    let free = free_dofs(mesh.nodes.len(), &clamped);
    let places = StressPlaces { nodes: Vec::new(), modes: 6 };
    let reference = reduced(&mesh, &tip, (ReductionKind::FreeInterface, 5), places.clone()).unwrap().rom;
    let points = &reference.extras.stress.as_ref().unwrap().points;
    let nodes: Vec<usize> = points.iter().map(|point| nearest(&mesh, point.position)).collect();
    // Full model, with the stress of the elements around each node.
    let assembled = assemble(&mesh, &steel(), &silent).unwrap();
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    let (squares, shapes) = dense_modes(&dense(&stiffness), &dense(&mass)).unwrap();
    let rows = full_rows(&mesh, &steel(), &free, &nodes);
    let mut push = DMatrix::zeros(free.len(), 9);
    for (index, point) in tip.iter().enumerate() {
        for (node, weight) in point.weights() {
            (0..3).for_each(|axis| push[(free.binary_search(&(3 * node + axis)).unwrap(), 3 * index + axis)] = weight);
        }
    }
    let (step, samples) = (1e-6, 4000);
    let counts = [5, 10, 20, 40, 80];
    let kinds = [ReductionKind::FixedInterface, ReductionKind::FreeInterface];
    let mut errors = vec![[0.0; 4]; counts.len()];
    for (column, pulse) in [(0, 5e-4), (2, 5e-5)] {
        let histories = |squares: &[f64], shapes: &DMatrix<f64>, push: &DMatrix<f64>, rows: &DMatrix<f64>| {
            let seen = rows * shapes;
            let moved = driven(squares, &(shapes.transpose() * push), step, samples, pulse);
            moved.into_iter().map(|modes| &seen * modes).collect::<Vec<_>>()
        };
        let full = histories(&squares, &shapes, &push, &rows);
        let largest = full.iter().fold(0.0, |most: f64, one| most.max(one.amax()));
        for (row, modes) in counts.into_iter().enumerate() {
            for (which, kind) in kinds.into_iter().enumerate() {
                let rom = reduced(&mesh, &tip, (kind, modes), places.clone()).unwrap().rom;
                let stress = rom.extras.stress.as_ref().unwrap();
                assert_eq!(&stress.points, points);
                let (own, shapes) = dense_modes(&rom.stiffness, &rom.mass).unwrap();
                let found = histories(&own, &shapes, &rom.contact_map.transpose(), &stress.map);
                let off = found.iter().zip(&full).fold(0.0, |most: f64, (a, b)| most.max((a - b).amax()));
                errors[row][column + which] = off / largest;
            }
        }
    }
    for (modes, row) in counts.iter().zip(&errors) {
        let values: Vec<String> = row.iter().map(|error| format!("{error:.0e}")).collect();
        print_row!("| {modes} | {} |", values.join(" | "));
    }
    for column in 0..4 {
        assert!(errors[4][column] < 0.1 * errors[0][column], "{errors:?}");
    }
    assert!(errors[4][1] < 1e-3, "{errors:?}");
    guide::hold("cargo test -p tiprub-model --test reduction");
}

/// Returns the stress per displacement of the free dofs at these nodes, 6·nodes × free, averaged here over the
/// elements around each node.
fn full_rows(mesh: &Mesh, material: &Material, free: &[usize], nodes: &[usize]) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(STRESSES * nodes.len(), free.len());
    for (place, node) in nodes.iter().enumerate() {
        let around: Vec<usize> = (0..mesh.elements.len()).filter(|e| mesh.elements[*e].nodes.contains(node)).collect();
        for number in &around {
            let element = &mesh.elements[*number];
            let local = element.nodes.iter().position(|own| own == node).unwrap();
            let one = nodal_stress(element.kind, &mesh.coordinates(element), material, local, *number).unwrap();
            for (index, column) in one.column_iter().enumerate() {
                if let Ok(dof) = free.binary_search(&(3 * element.nodes[index / 3] + index % 3)) {
                    (0..STRESSES).for_each(|i| rows[(STRESSES * place + i, dof)] += column[i] / around.len() as f64);
                }
            }
        }
    }
    rows
}

/// Returns D(Bu − αT) per kelvin at these nodes, with u of the full matrices under the thermal load.
fn full_thermal_stress(mesh: &Mesh, material: &Material, clamped: &[usize], nodes: &[usize]) -> DMatrix<f64> {
    let free = free_dofs(mesh.nodes.len(), clamped);
    let assembled = assemble(mesh, material, &silent).unwrap();
    let (stiffness, _) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    let load = patch_loads(mesh, material, &[whole_mesh(mesh)]).unwrap();
    let load = DVector::from_fn(free.len(), |row, _| load[(free[row], 0)]);
    let moved = dense(&stiffness).cholesky().unwrap().solve(&load);
    let strained = full_rows(mesh, material, &free, nodes) * moved;
    // Fully constrained uniform expansion: −EαT/(1 − 2ν) in all directions.
    let held = material.young_modulus * material.expansion / (1.0 - 2.0 * material.poisson_ratio);
    DMatrix::from_fn(strained.nrows(), 1, |row, _| strained[row] - if row % STRESSES < 3 { held } else { 0.0 })
}

/// The array for heated structures is the static stress of the full model. A cantilever is free of stress away from
/// its root, a bar clamped at both ends has −EαT along it, and an unsupported structure has none.
#[test]
fn thermal_stress_of_heated_structure_matches_full_model() {
    let mesh = straight_box(ElementKind::Hex20, [12, 1, 2], SIZE);
    // Without lateral contraction the mean over each section is −EαT for any support of the ends.
    let material = Material { expansion: 12e-6, poisson_ratio: 0.0, ..steel() };
    let largest = material.young_modulus * material.expansion;
    let nodes = [[0.15, 0.0, 0.03], [0.0125, 0.02, 0.03], [0.025, 0.0, 0.0]].map(|point| nearest(&mesh, point));
    let [left, right] = [0.0, SIZE[0]].map(|x| nodes_at(&mesh, 0, x));
    // Not collinear, so that they constrain an otherwise unsupported structure.
    let tip = [[0.1, 0.03], [0.2, 0.0], [0.2, 0.06]]
        .map(|[x, z]| ContactPoint::at(format!("at_{x}_{z}"), nearest(&mesh, [x, SIZE[1], z]), 0.0));
    for (clamped, along) in [(left.clone(), 0.0), ([left, right].concat(), -largest), (Vec::new(), 0.0)] {
        for kind in [ReductionKind::FixedInterface, ReductionKind::FreeInterface] {
            let places = nodes.iter().enumerate().map(|(index, node)| (format!("at_{index}"), *node)).collect();
            let options = ReductionOptions {
                name: "bar".into(),
                kind,
                modes: if clamped.is_empty() { 12 } else { 4 },
                checked_modes: 4,
                sectors: 1,
                frame: DisplacementFrame::Cartesian,
                watched: Vec::new(),
                stress: StressPlaces { nodes: places, modes: 0 },
                damping_ratio: 0.0,
            };
            let rom = reduce(mesh.clone(), &material, &clamped, &tip, &options, &silent).unwrap().rom;
            let found = rom.extras.stress_thermal.unwrap();
            let expected = if clamped.is_empty() {
                DMatrix::zeros(STRESSES * nodes.len(), 1)
            } else {
                full_thermal_stress(&mesh, &material, &clamped, &nodes)
            };
            let off = (&found - &expected).amax() / largest;
            let middle = (found[0] - along).abs() / largest;
            println!("{} clamped, {kind:?}: off {off:.1e}, in the middle {middle:.1e}", clamped.len());
            assert!(off < 1e-8 && middle < 1e-2, "{off:e} {middle:e}");
            assert!(clamped.is_empty() || found.rows(STRESSES, 12).amax() > 0.05 * largest, "the root is held");
        }
    }
}

/// In a scene the stress of a warm blade is that of the full model at rest for any number of modes, and not the
/// stress of the displacements alone, which lacks −EαT/(1 − 2ν).
#[test]
fn stress_of_warm_blade_in_scene_matches_full_model() {
    let mut mesh = straight_box(ElementKind::Hex20, [10, 1, 2], [0.07, 0.006, 0.012]);
    mesh.nodes.iter_mut().for_each(|x| *x = [x[0] + 0.18, x[1] - 0.003, x[2] - 0.006]);
    let clamped = nodes_at(&mesh, 0, 0.18);
    let middle = nearest(&mesh, [0.25, 0.003, 0.0]);
    let contact = [ContactPoint::at("tip", middle, 0.0)];
    let (alpha, temperature) = (12e-6, 300.0);
    let material = Material { expansion: alpha, ..steel() };
    // On the middle plane, where the local directions are those of the mesh.
    let nodes = [[0.215, 0.0, 0.006], [0.187, 0.0, 0.006], [0.18, 0.0, -0.006]].map(|point| nearest(&mesh, point));
    assert!(nodes.iter().all(|node| mesh.nodes[*node][1].abs() < 1e-12), "{nodes:?}");
    let expected = full_thermal_stress(&mesh, &material, &clamped, &nodes) * temperature;
    for kind in [ReductionKind::FixedInterface, ReductionKind::FreeInterface] {
        let places = nodes.iter().enumerate().map(|(index, node)| (format!("at_{index}"), *node)).collect();
        let options = ReductionOptions {
            name: "bar".into(),
            kind,
            modes: 3,
            checked_modes: 4,
            sectors: 2,
            frame: DisplacementFrame::Cylindrical,
            watched: Vec::new(),
            stress: StressPlaces { nodes: places, modes: 0 },
            damping_ratio: 0.01,
        };
        let rom = reduce(mesh.clone(), &material, &clamped, &contact, &options, &silent).unwrap().rom;
        let mut scene = models::round(rom);
        (scene.settings.structures[0].thermal, scene.settings.contacts[0].gap) = (true, 2e-3);
        (scene.settings.outputs.stress, scene.settings.outputs.watched_sectors) = (true, vec![1]);
        let mut run = Simulation::new(&scene).unwrap();
        models::set(&mut run, "rotor_temperature", temperature);
        run.initialise(0.0).unwrap();
        models::go(&mut run, 1e-4);
        let names = ["radial", "tangential", "axial", "radial_tangential", "tangential_axial", "axial_radial"];
        for (place, _) in nodes.iter().enumerate() {
            for (component, name) in names.into_iter().enumerate() {
                let found = models::element(&run, &format!("blade[1].{name}_stress"), u32::try_from(place).unwrap());
                let expected = expected[STRESSES * place + component];
                assert!((found - expected).abs() < 1e3, "{kind:?}, place {place}, {name}: {found:e} {expected:e}");
            }
            let found = models::element(&run, "blade[1].von_mises_stress", u32::try_from(place).unwrap());
            println!("{kind:?}, place {place}: {:.3} MPa", 1e-6 * found);
        }
        assert!(models::element(&run, "blade[1].von_mises_stress", 0) < 1e6);
        assert!(models::element(&run, "blade[1].von_mises_stress", 2) > 1e8, "the root is held");
    }
}
