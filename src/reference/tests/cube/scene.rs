//! Meshes, matrices and surfaces of the cube between two rings.

use tiprub_model::Mesh;
use tiprub_reference::cube::files::{BodyFile, read_json, write_json};
use tiprub_reference::cube::scene::{CubeScene, CubeSetting, Mass};
use tiprub_reference::cube::{CENTRE, OUTER_RADIUS, RingSide, SIDE, THICKNESS, WIDTH};
use tiprub_reference::cube::{cube_mesh, cube_of, ring_mesh, ring_of};
use tiprub_reference::surface::{SplineSurface, SurfaceKind};

#[test]
fn meshes_match_the_paper() {
    let cube = cube_mesh();
    cube.validate().unwrap();
    assert_eq!((cube.nodes.len(), cube.elements.len()), (216, 125));
    for (set, corners) in [("CORNERS_LEFT", [1, 6, 85, 90]), ("CORNERS_RIGHT", [31, 36, 91, 96])] {
        let numbers: Vec<usize> = cube.set(set).unwrap().iter().map(|node| node + 1).collect();
        assert_eq!(numbers, corners);
    }
    for (a, b) in [(1, 31), (6, 36), (85, 91), (90, 96)] {
        let ([x, y, z], [u, v, w]) = (cube.nodes[a - 1], cube.nodes[b - 1]);
        assert!(x + u == 0.0 && y - v == 0.0 && z - w == 0.0, "nodes {a} and {b} mirror each other");
    }
    for side in RingSide::BOTH {
        assert_eq!(cube.set(if side == RingSide::Left { "MASTER_LEFT" } else { "MASTER_RIGHT" }).unwrap().len(), 36);
        let ring = ring_mesh(side);
        ring.validate().unwrap();
        assert_eq!((ring.nodes.len(), ring.elements.len()), (41 * 9 * 6, 1600));
        assert_eq!(ring.set("SLAVE").unwrap().len(), 41 * 9);
        assert_eq!(ring.set("CLAMPED").unwrap().len(), 2 * 54);
        // Outer face: 180 mm around x = ∓204 mm, 24 mm from the middle at the nearest point, 1 mm less than half the
        // cube.
        let nearest = ring.nodes.iter().map(|node| node[0].abs()).fold(f64::MAX, f64::min);
        assert!((nearest - 0.024).abs() < 1e-15 && (0.5 * SIDE - nearest - 0.001).abs() < 1e-15);
        for &node in ring.set("SLAVE").unwrap() {
            let [x, y, _] = ring.nodes[node];
            assert!((((x - side.sign() * CENTRE).hypot(y)) - OUTER_RADIUS).abs() < 1e-15);
        }
    }
}

#[test]
fn masses_are_exact_and_rigid_motion_costs_no_energy() {
    let arc = 2.0 * std::f64::consts::FRAC_PI_3;
    for mass in [Mass::Lumped, Mass::Consistent] {
        let scene = CubeScene::new(CubeSetting { mass, ..CubeSetting::default() }).unwrap();
        for (index, body) in scene.bodies.iter().enumerate() {
            let inner = OUTER_RADIUS - THICKNESS;
            // 40 chords instead of the arc: the area of a sector is that of the triangles.
            let ring = WIDTH * 20.0 * (arc / 40.0).sin() * (OUTER_RADIUS.powi(2) - inner * inner);
            let volume = if index == 0 { SIDE.powi(3) } else { ring };
            let total: f64 = body.mass.values.iter().sum::<f64>() / 3.0;
            assert!((total / (7800.0 * volume) - 1.0).abs() < 1e-12, "{mass:?}, body {index}: {total} kg");
            let column: f64 = (0..3)
                .map(|i| {
                    body.stiffness
                        .block(&[i], &(0..body.dofs()).step_by(3).collect::<Vec<_>>())
                        .row(0)
                        .iter()
                        .sum::<f64>()
                        .abs()
                })
                .sum();
            assert!(column < 1e-6 * body.stiffness.trace() / body.dofs() as f64, "body {index}: {column}");
        }
    }
}

fn grid(mesh: &Mesh) -> Vec<[f64; 3]> {
    mesh.set("SLAVE").unwrap().iter().map(|&node| mesh.nodes[node]).collect()
}

/// Returns the parameters of a point from its polar angle, in elements.
fn guess(side: RingSide, arc: usize, wide: usize, [x, y, z]: [f64; 3]) -> [f64; 2] {
    let angle = y.atan2(CENTRE - side.sign() * x) / std::f64::consts::FRAC_PI_3;
    [(angle + 1.0) * 0.5 * arc as f64, (z / WIDTH + 0.5) * wide as f64]
}

#[test]
fn spline_converges_to_cylinder_at_fourth_order() {
    for side in RingSide::BOTH {
        let mut errors = Vec::new();
        for arc in [20, 40, 80] {
            let nodes = grid(&ring_of(side, [1, 8, arc]));
            let surface = SplineSurface::new(SurfaceKind::Spline, arc + 1, 9, -side.sign());
            let carriers = surface.carriers(&nodes);
            for node in nodes.iter().filter(|node| node[1].abs() < 0.15 && node[2].abs() < 0.039) {
                let foot = surface.foot(*node, &carriers, guess(side, arc, 8, *node)).unwrap();
                assert!(foot.gap.abs() < 1e-15, "gap {} at a node", foot.gap);
            }
            // Points 0.3 mm off the surface, on both sides, well away from the ends.
            let mut worst = 0.0_f64;
            for i in 0..200 {
                let angle = 0.3 * (f64::from(i) / 100.0 - 1.0);
                let offset = if i % 2 == 0 { 3e-4 } else { -3e-4 };
                let radius = OUTER_RADIUS + offset;
                let point = [side.sign() * (CENTRE - radius * angle.cos()), radius * angle.sin(), 0.01 * angle];
                let foot = surface.foot(point, &carriers, guess(side, arc, 8, point)).unwrap();
                worst = worst.max((foot.gap - offset).abs());
                let outward = [-side.sign() * angle.cos(), angle.sin(), 0.0];
                assert!((0..3).all(|k| (foot.normal[k] - outward[k]).abs() < 1e-3), "{:?} {outward:?}", foot.normal);
                assert!((foot.weights.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-14);
            }
            errors.push(worst);
        }
        let orders = [(errors[0] / errors[1]).log2(), (errors[1] / errors[2]).log2()];
        println!("{side:?}: gap on the cylinder off by {errors:?} m, orders {orders:.2?}");
        assert!(orders[1] > 3.8 && errors[1] < 1e-7, "{errors:?}");
    }
}

/// An uneven surface, so that nodes on its ends and edges are only reproduced with the right end conditions.
#[test]
fn spline_interpolates_nodes_at_ends_and_edges() {
    let (rows, columns) = (7, 6);
    let place = |i: usize, j: usize| [i as f64, j as f64, 0.3 * (2.0 * i as f64 + 3.1 * j as f64).sin()];
    let nodes: Vec<[f64; 3]> = (0..rows).flat_map(|i| (0..columns).map(move |j| place(i, j))).collect();
    let surface = SplineSurface::new(SurfaceKind::Spline, rows, columns, 1.0);
    let carriers = surface.carriers(&nodes);
    for i in 0..rows {
        for j in 0..columns {
            let foot = surface.foot(place(i, j), &carriers, [i as f64, j as f64]).expect("a node lies on the surface");
            assert!(foot.gap.abs() < 1e-14, "gap {} at node ({i}, {j})", foot.gap);
            let mut met = [0.0; 3];
            foot.weights
                .iter()
                .for_each(|(carrier, weight)| (0..3).for_each(|k| met[k] += weight * carriers[*carrier][k]));
            let node = place(i, j);
            assert!((0..3).all(|k| (met[k] - node[k]).abs() < 1e-13), "{met:?} instead of {node:?}");
        }
    }
}

#[test]
fn facets_are_the_chords_of_the_cylinder() {
    let nodes = grid(&ring_mesh(RingSide::Left));
    let surface = SplineSurface::new(SurfaceKind::Facets, 41, 9, 1.0);
    let half = std::f64::consts::FRAC_PI_3 / 40.0;
    // At the middle of a facet the cylinder is higher by its sagitta R (1 − cos(π/120)).
    let point = [-CENTRE + OUTER_RADIUS * half.cos(), OUTER_RADIUS * half.sin(), 0.003];
    let foot = surface.foot(point, &surface.carriers(&nodes), guess(RingSide::Left, 40, 8, point)).unwrap();
    let sagitta = OUTER_RADIUS * (1.0 - half.cos());
    assert!((foot.gap - sagitta).abs() < 1e-12, "{} {sagitta}", foot.gap);
    assert!((foot.weights.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-14);
}

#[test]
fn distributed_forces_conserve_work() {
    let surface = SplineSurface::new(SurfaceKind::Spline, 41, 9, 1.0);
    let irregular = |seed: f64| -> Vec<[f64; 3]> {
        (0..surface.count()).map(|i| core::array::from_fn(|k| (seed * (i as f64 + 0.3) + k as f64).sin())).collect()
    };
    let (nodal, forces) = (irregular(12.9), irregular(7.7));
    let work = |a: &[[f64; 3]], b: &[[f64; 3]]| -> f64 {
        a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| x * y).sum()
    };
    let (on_carriers, on_nodes) = (work(&surface.carriers(&nodal), &forces), work(&nodal, &surface.spread(&forces)));
    assert!((on_carriers - on_nodes).abs() < 1e-12 * on_nodes.abs(), "{on_carriers} {on_nodes}");
}

#[test]
fn matrices_round_trip_through_a_file() {
    let setting = CubeSetting { mass: Mass::Consistent, ..CubeSetting::default() };
    let rings = RingSide::BOTH.map(|side| ring_of(side, [1, 2, 6]));
    let scene = CubeScene::of(setting, cube_of(2), rings, [6, 2]).unwrap();
    let directory = std::env::temp_dir().join(format!("tiprub-reference-{}", std::process::id()));
    std::fs::create_dir_all(&directory).unwrap();
    for body in &scene.bodies {
        let path = directory.join("body.json");
        write_json(&path, &BodyFile::from(body)).unwrap();
        let model = read_json::<BodyFile>(&path).unwrap().fe_model("file").unwrap();
        assert_eq!(model.sets, body.mesh.sets);
        assert_eq!(model.stiffness.pattern, body.stiffness.pattern);
        let off =
            |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs() / b.abs().max(1e-9)).fold(0.0, f64::max);
        assert!(off(&model.stiffness.values, &body.stiffness.values) < 1e-15);
        assert!(off(&model.mass.values, &body.mass.values) < 1e-15);
        let mut broken = BodyFile::from(body);
        broken.mass.pop();
        assert!(broken.fe_model("file").unwrap_err().to_string().contains("do not match"));
    }
    std::fs::remove_dir_all(&directory).unwrap();
}
