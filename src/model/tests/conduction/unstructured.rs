//! Conduction of casings of irregular tetrahedra, whose faces cross the borders of patches and of the heated surface.

use std::f64::consts::PI;

use tiprub_cosim::ThermalPatch;
use tiprub_model::CasingOptions;
use tiprub_model::casing::{ContactRings, RingSupport};
use tiprub_model::conduction::Conductor;
use tiprub_model::conduction::{ConductionOptions, FullConduction, reduce_mesh_conduction, reduce_ring_conduction};
use tiprub_model::mesh::Mesh;
use tiprub_model::progress::silent;
use tiprub_model::thermal::equal_patches;

use super::options;
use crate::common::tetrahedra::TetrahedralRing;

const RING: TetrahedralRing = TetrahedralRing { radius: 0.05, thickness: 0.02, axial: [0.0, 0.04] };
const HEATED: [f64; 2] = [0.0113, 0.0291];
const PATCHES: [usize; 2] = [5, 1];
const COUNTS: [[usize; 3]; 2] = [[12, 1, 3], [24, 2, 6]];

fn full(mesh: &Mesh, heated: [f64; 2], patches: &[ThermalPatch]) -> FullConduction {
    FullConduction::new(mesh, patches, &options([400.0, 60.0], heated, 4)).unwrap()
}

fn sum(values: impl Iterator<Item = f64>) -> f64 {
    values.sum()
}

/// The heat of a patch is complete, and evenly distributed over its area between its borders, regardless of the
/// faces.
#[test]
fn patch_heat_is_distributed_within_the_patch_borders() {
    for patches in [equal_patches(5, 1, RING.axial), equal_patches(3, 2, RING.axial)] {
        let moments = COUNTS.map(|counts| {
            let mesh = RING.tetrahedra(counts);
            let full = full(&mesh, HEATED, &patches);
            let area = 2.0 * PI * RING.radius * (HEATED[1] - HEATED[0]);
            let mut worst = [(full.areas[2] / area - 1.0).abs(), 0.0_f64];
            for (column, patch) in patches.iter().enumerate() {
                let heat = full.heat.col(column);
                assert!((sum(heat.iter().copied()) - 1.0).abs() < 1e-14, "patch {column}");
                let middle = 0.5 * (patch.angle[0] + patch.angle[1]);
                let half = 0.5 * (patch.angle[1] - patch.angle[0]);
                let axial = [patch.axial[0].max(HEATED[0]), patch.axial[1].min(HEATED[1])];
                let place = |i: usize| sum(heat.iter().zip(&mesh.nodes).map(|(share, node)| share * node[i]));
                // Means of x, y and z over the patch of a cylinder.
                let radius = RING.radius * half.sin() / half;
                let expected = [radius * middle.cos(), radius * middle.sin(), 0.5 * (axial[0] + axial[1])];
                for (i, expected) in expected.into_iter().enumerate() {
                    worst[1] = worst[1].max((place(i) - expected).abs() / RING.radius);
                }
            }
            worst
        });
        println!("{} patches: area and centres off by {moments:?}", patches.len());
        let [coarse, fine] = moments;
        assert!(fine[0] < 1e-5 && fine[1] < 1e-4, "{moments:?}");
        assert!(fine[0] < 0.2 * coarse[0] && fine[1] < 0.3 * coarse[1], "{moments:?}");
    }
}

/// A temperature that is linear along an axis has known means over patches, of surfaces and of volumes.
#[test]
fn patch_means_match_those_of_a_cylinder() {
    let patches = equal_patches(5, 1, RING.axial);
    let found = COUNTS.map(|counts| {
        let mesh = RING.tetrahedra(counts);
        let full = full(&mesh, HEATED, &patches);
        let mut worst = 0.0_f64;
        for (column, patch) in patches.iter().enumerate() {
            let mean = full.patch_means.col(column);
            assert!((sum(mean.iter().copied()) - 1.0).abs() < 1e-13);
            let (middle, half) = (0.5 * (patch.angle[0] + patch.angle[1]), 0.5 * (patch.angle[1] - patch.angle[0]));
            let (a, b) = (RING.radius, RING.radius + RING.thickness);
            let radius = 2.0 / 3.0 * (b.powi(3) - a.powi(3)) / (b * b - a * a) * half.sin() / half;
            let off = |i: usize, expected: f64| {
                (sum(mean.iter().zip(&mesh.nodes).map(|(m, node)| m * node[i])) - expected).abs()
            };
            worst = worst.max(off(0, radius * middle.cos()).max(off(1, radius * middle.sin())) / a);
        }
        worst
    });
    println!("means over volumes off by {found:?} of the radius");
    assert!(found[1] < 0.02 && found[1] < 0.7 * found[0], "{found:?}");
}

/// Steady heat from the gas to the air: the temperature is logarithmic in the radius.
#[test]
fn radial_conduction_in_tetrahedra_is_logarithmic() {
    let (a, b, length) = (RING.radius, RING.radius + RING.thickness, RING.axial[1]);
    let k = Conductor::steel().conductivity;
    let [gas, air] = [400.0 * 2.0 * PI * a * length, 60.0 * 2.0 * PI * b * length];
    let wall = (b / a).ln() / (2.0 * PI * k * length);
    let flow = 300.0 / (1.0 / gas + wall + 1.0 / air);
    let found = COUNTS.map(|counts| {
        let mesh = RING.tetrahedra(counts);
        let full = full(&mesh, HEATED, &equal_patches(5, 1, RING.axial));
        let load = full.film_loads();
        let load = faer::Mat::from_fn(load.nrows(), 1, |i, _| 300.0 * load[(i, 0)]);
        let temperatures = full.operator([1.0; 2]).factor("K + H", "").unwrap().solve(load);
        let expected = |r: f64| 300.0 - flow / gas - flow * (r / a).ln() / (2.0 * PI * k * length);
        let off =
            mesh.nodes.iter().enumerate().map(|(i, [x, y, _])| (temperatures[(i, 0)] - expected(x.hypot(*y))).abs());
        off.fold(0.0, f64::max) / (300.0 - expected(b) - flow / gas)
    });
    println!("profile off by {found:?} of the difference over the wall");
    assert!(found[1] < 2e-3 && found[1] < 0.3 * found[0], "{found:?}");
}

/// The reduced model of tetrahedra agrees with that of bricks whose faces end at all borders.
#[test]
fn conduction_in_tetrahedra_matches_bricks() {
    let rings = ContactRings { around: 20, along: 2, axial: HEATED };
    let of_bricks = CasingOptions { patches: PATCHES, ..RING.bricks([40, 2, 12], rings, RingSupport::Free) };
    let settings = ConductionOptions { ..options([400.0, 60.0], HEATED, 12) };
    let bricks = reduce_ring_conduction(&of_bricks, &settings, &silent).unwrap();
    let answers = |model: &tiprub_thermal::ConductionModel| {
        let matrix = &model.conduction + &model.gas_convection + &model.ambient_convection;
        let answer = matrix.cholesky().unwrap().solve(&model.heat_loads);
        [&model.patch_means * &answer, model.heat_loads.transpose() * &answer]
    };
    let [means, surfaces] = answers(&bricks.model);
    let conducting = |mesh: &Mesh| {
        let own = (mesh.set("inner").ok(), Some(HEATED));
        reduce_mesh_conduction(mesh, own, PATCHES, &settings, &silent).unwrap()
    };
    let deviations = COUNTS.map(|counts| {
        let found = conducting(&RING.tetrahedra(counts));
        let [own_means, own_surfaces] = answers(&found.model);
        let rate = found.time_constants[0] / bricks.time_constants[0] - 1.0;
        [(&own_means - &means).amax() / means.amax(), (&own_surfaces - &surfaces).amax() / surfaces.amax(), rate.abs()]
    });
    println!("patches, surfaces and time constants off by {deviations:?}");
    let [coarse, fine] = deviations;
    for (quantity, most) in [3e-3, 8e-3, 1e-4].into_iter().enumerate() {
        assert!(fine[quantity] < most && fine[quantity] < 0.5 * coarse[quantity], "{quantity}: {deviations:?}");
    }
    let mesh = RING.tetrahedra(COUNTS[0]);
    let found = conducting(&mesh);
    let own = (mesh.set("inner").ok(), Some(HEATED));
    let found_surface = reduce_mesh_conduction(&mesh, (None, Some(HEATED)), PATCHES, &settings, &silent).unwrap();
    assert_eq!(found_surface.model.heat_loads, found.model.heat_loads);
    let mut torn = mesh.clone();
    let nodes = torn.nodes.clone();
    torn.elements.retain(|element| element.nodes.iter().all(|&node| nodes[node][1] > -0.03));
    let error = reduce_mesh_conduction(&torn, own, PATCHES, &settings, &silent).unwrap_err().to_string();
    assert!(error.contains("not a full ring about the z axis"), "{error}");
}
