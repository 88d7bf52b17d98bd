//! Casings: thermal loads, residual vectors, reduction of a ring and of an imported mesh.

use std::sync::OnceLock;

use crate::common::casing::{at_rest, coarse, heated};
use crate::common::{distorted_box, nodes_at, wobble};
use faer::Mat;
use nalgebra::{DMatrix, DVector};
use tiprub_cosim::ThermalPatch;
use tiprub_model::assembly::{assemble, free_dofs};
use tiprub_model::casing::{
    CLAMPED, CasingReductionOptions, GridNodes, ModalForm, RingSupport, condense, modal_form, supported_ring,
};
use tiprub_model::craig_bampton::{InnerBasis, craig_bampton, craig_bampton_with, dense_modes};
use tiprub_model::element::{ElementKind, Formulation, stiffness, thermal_load};
use tiprub_model::free_interface::free_interface;
use tiprub_model::progress::silent;
use tiprub_model::sparse::{SparseMatrix, principal_pair};
use tiprub_model::thermal::{equal_patches, patch_loads};
use tiprub_model::{CasingOptions, Material, Mesh, Reduction, reduce_casing, reduce_ring};

/// Returns the static displacement of the whole finite-element model, all dofs × loads.
pub(super) fn full_at_rest(mesh: &Mesh, material: &Material, clamped: &[usize], loads: &Mat<f64>) -> Mat<f64> {
    let assembled = assemble(mesh, material, &silent).unwrap();
    let free = free_dofs(mesh.nodes.len(), clamped);
    let (stiffness, _) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    let right = Mat::from_fn(free.len(), loads.ncols(), |i, k| loads[(free[i], k)]);
    let solution = stiffness.factor("K", "").unwrap().solve(right);
    let mut all = Mat::zeros(loads.nrows(), loads.ncols());
    for (row, &dof) in free.iter().enumerate() {
        for k in 0..loads.ncols() {
            all[(dof, k)] = solution[(row, k)];
        }
    }
    all
}

/// Returns the coarse casing, reduced once for all tests of this file.
fn reduced(support: RingSupport) -> &'static Reduction {
    static REDUCTIONS: [OnceLock<Reduction>; 4] = [const { OnceLock::new() }; 4];
    let place = [RingSupport::Free, RingSupport::Low, RingSupport::High, RingSupport::Both]
        .iter()
        .position(|known| *known == support);
    REDUCTIONS[place.unwrap()].get_or_init(|| reduce_ring(&coarse(support), &silent).unwrap())
}

/// Returns the radial, tangential and axial components of the displacement of contact nodes, as in the ROM.
fn cylindrical(mesh: &Mesh, grid: &GridNodes, displacement: impl Fn(usize) -> f64) -> DVector<f64> {
    let parts = grid.nodes.iter().flat_map(|&node| {
        let [x, y, _] = mesh.nodes[node];
        let (cos, sin) = (x / x.hypot(y), y / x.hypot(y));
        let [u, v, w] = [0, 1, 2].map(|component| displacement(3 * node + component));
        [cos * u + sin * v, cos * v - sin * u, w]
    });
    DVector::from_iterator(3 * grid.nodes.len(), parts)
}

#[test]
fn thermal_loads_equal_stiffness_times_free_expansion() {
    let material = Material::titanium();
    for kind in ElementKind::ALL {
        let mesh = distorted_box(kind, [2, 2, 2], [0.3, 0.2, 0.25], wobble(0.15));
        let mut worst = 0.0_f64;
        for (number, element) in mesh.elements.iter().enumerate() {
            let coordinates = mesh.coordinates(element);
            let load = DVector::from_vec(thermal_load(kind, &coordinates, &material, number).unwrap());
            let growth = coordinates.iter().flatten().map(|x| material.expansion * x);
            let growth = DVector::from_iterator(load.len(), growth);
            let expected = stiffness(kind, &coordinates, &material, number).unwrap() * growth;
            worst = worst.max((&load - expected).amax() / load.amax());
        }
        println!("{kind:?}: largest deviation of the thermal load from K alpha x: {worst:.1e} of its size");
        assert!(worst < 1e-12, "{kind:?}: {worst:e}");
    }
}

#[test]
fn patch_loads_are_in_equilibrium_and_sum_to_uniform_heating() {
    let options = coarse(RingSupport::Free);
    let ring = supported_ring(&options).unwrap();
    let axial = options.geometry.contour.axial();
    let loads = patch_loads(&ring.mesh, &options.material, &equal_patches(12, 2, axial)).unwrap();
    let uniform = patch_loads(&ring.mesh, &options.material, &equal_patches(1, 1, axial)).unwrap();
    let largest = uniform.norm_max();
    let mut sum_error = 0.0_f64;
    for dof in 0..loads.nrows() {
        let sum: f64 = (0..24).map(|patch| loads[(dof, patch)]).sum();
        sum_error = sum_error.max((sum - uniform[(dof, 0)]).abs());
    }
    let (mut force_error, mut moment_error) = (0.0_f64, 0.0_f64);
    for patch in 0..24 {
        let (mut force, mut moment, mut size) = ([0.0; 3], [0.0; 3], 0.0);
        for (node, [x, y, z]) in ring.mesh.nodes.iter().enumerate() {
            let [fx, fy, fz] = [0, 1, 2].map(|i| loads[(3 * node + i, patch)]);
            [fx, fy, fz].iter().enumerate().for_each(|(i, f)| force[i] += f);
            [y * fz - z * fy, z * fx - x * fz, x * fy - y * fx].iter().enumerate().for_each(|(i, m)| moment[i] += m);
            size += fx.abs() + fy.abs() + fz.abs();
        }
        force_error = force.iter().fold(force_error, |worst, f| worst.max(f.abs() / size));
        moment_error = moment.iter().fold(moment_error, |worst, m| worst.max(m.abs() / (size * 0.25)));
    }
    println!("patch loads sum to the uniform one to {:.1e} of its largest entry", sum_error / largest);
    println!("resultants over the sum of magnitudes: force {force_error:.1e}, moment/0.25 m {moment_error:.1e}");
    assert!(sum_error < 1e-13 * largest && force_error < 1e-14 && moment_error < 1e-14);
}

#[test]
fn uniform_heating_expands_free_ring_without_stress() {
    let options = coarse(RingSupport::Free);
    let (rom, rise) = (&reduced(RingSupport::Free).rom, 100.0);
    let displacement = heated(rom, &[rise; 24]);
    let strain = options.material.expansion * rise;
    // Elastic modes carry no momentum: the centre of mass stays.
    let ring = supported_ring(&options).unwrap();
    let mass = assemble(&ring.mesh, &options.material, &silent).unwrap().mass;
    let ones = Mat::from_fn(mass.order(), 1, |dof, _| if dof % 3 == 2 { 1.0 } else { 0.0 });
    let nodal = mass.times(ones.as_ref());
    let weighted = |value: &dyn Fn(usize) -> f64| {
        (0..ring.mesh.nodes.len()).map(|node| nodal[(3 * node + 2, 0)] * value(node)).sum::<f64>()
    };
    let centre = weighted(&|node| ring.mesh.nodes[node][2]) / weighted(&|_| 1.0);
    let mut worst = [0.0_f64; 3];
    for (index, node) in rom.contact_nodes.iter().enumerate() {
        let [r, _, z] = node.position;
        let expected = [strain * r, 0.0, strain * (z - centre)];
        for i in 0..3 {
            worst[i] = worst[i].max((displacement[3 * index + i] - expected[i]).abs() / (strain * r));
        }
    }
    println!(
        "free growth over alpha dT R: radial off by {:.1e}, tangential {:.1e}, axial {:.1e}",
        worst[0], worst[1], worst[2]
    );
    // Rounding of the stiffness is amplified by the softness of bending: (ω of the stiffest / of the softest mode)²
    // is 3e6.
    assert!(worst.iter().all(|error| *error < 2e-9), "{worst:?}");
    // Rigid-body modes come first, have exactly zero stiffness and are not loaded.
    let squares = rom.stiffness.diagonal();
    assert!(squares.rows(0, 6).iter().all(|square| *square == 0.0) && squares[6] > 0.0);
    assert!(rom.extras.thermal.as_ref().unwrap().loads.rows(0, 6).iter().all(|load| *load == 0.0));
}

#[test]
fn a_free_ring_has_six_rigid_modes() {
    let reduction = reduced(RingSupport::Free);
    let found: Vec<f64> = reduction.modes.iter().map(|mode| mode.frequency).collect();
    println!(
        "rigid modes of the full model below {:.1e} Hz, first elastic one {:.2} Hz",
        found[5].max(found[0]),
        found[6]
    );
    assert!(found[..6].iter().all(|frequency| *frequency < 1e-3 * found[6]) && found[6] > 50.0, "{found:?}");
    // Their shapes on the contact nodes are the rigid motions: a translation, in the cylindrical frame.
    let rom = &reduction.rom;
    let translation = rom.contact_nodes.iter().flat_map(|node| {
        let (sin, cos) = node.position[1].sin_cos();
        [cos, -sin, 0.0]
    });
    let translation = DVector::from_iterator(3 * rom.contact_nodes.len(), translation);
    let rigid = rom.contact_map.columns(0, 6).into_owned();
    let coefficients = (rigid.tr_mul(&rigid)).cholesky().unwrap().solve(&rigid.tr_mul(&translation));
    let left = (&translation - rigid * coefficients).amax();
    assert!(left < 1e-12, "{left:e}");
    let checks = &rom.checks;
    for k in 0..16 {
        assert!(checks.frequency_deviation[k] > -1e-6 && checks.residual_criterion[k] < 4.0, "mode {k}: {checks:?}");
    }
}

/// The response to a uniform temperature is exact to rounding even for a supported casing, and so is that to every
/// single patch.
#[test]
fn static_responses_match_the_full_model() {
    for support in [RingSupport::Low, RingSupport::High, RingSupport::Both] {
        let options = coarse(support);
        let ring = supported_ring(&options).unwrap();
        let patches = equal_patches(12, 2, options.geometry.contour.axial());
        let clamped = ring.mesh.set(CLAMPED).unwrap().to_vec();
        let thermal = patch_loads(&ring.mesh, &options.material, &patches).unwrap();
        // In addition to the patches: unit radial forces on three contact nodes.
        let nodes = [0, 30, 71];
        let mut loads = Mat::zeros(thermal.nrows(), 27);
        loads.get_mut(.., ..24).copy_from(&thermal);
        for (k, &index) in nodes.iter().enumerate() {
            let node = ring.grid.nodes[index];
            let [x, y, _] = ring.mesh.nodes[node];
            loads[(3 * node, 24 + k)] = x / x.hypot(y);
            loads[(3 * node + 1, 24 + k)] = y / x.hypot(y);
        }
        let exact = full_at_rest(&ring.mesh, &options.material, &clamped, &loads);
        let rom = &reduced(support).rom;
        let mut worst = [0.0_f64; 2];
        for k in 0..27 {
            let expected = cylindrical(&ring.mesh, &ring.grid, |dof| exact[(dof, k)]);
            let found = if k < 24 {
                let mut temperatures = [0.0; 24];
                temperatures[k] = 1.0;
                heated(rom, &temperatures)
            } else {
                at_rest(rom, &rom.contact_map.row(3 * nodes[k - 24]).transpose())
            };
            let error = (found - &expected).amax() / expected.amax();
            worst[usize::from(k >= 24)] = worst[usize::from(k >= 24)].max(error);
        }
        println!("{support:?}: at rest off by {:.1e} under heat, {:.1e} under contact forces", worst[0], worst[1]);
        assert!(worst.iter().all(|error| *error < 1e-9), "{support:?}: {worst:?}");
    }
}

/// The support of a casing at rest carries only the forces and moments on its contact nodes: heat causes none.
#[test]
fn static_support_reaction_balances_contact_loads() {
    for support in [RingSupport::Low, RingSupport::Both] {
        let rom = &reduced(support).rom;
        let rows = rom.extras.support.as_ref().unwrap();
        let felt = |forces: &DVector<f64>| {
            let answer = DVector::from_fn(rom.order(), |i, _| forces[i] / rom.stiffness[(i, i)]);
            &rows.stiffness * answer
        };
        let mut worst = [0.0_f64; 2];
        for node in [0, 30, 71] {
            let [radius, angle, z] = rom.contact_nodes[node].position;
            let (sine, cosine) = angle.sin_cos();
            let [x, y] = [radius * cosine, radius * sine];
            for (component, [fx, fy, fz]) in
                [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]].into_iter().enumerate()
            {
                let moment = [y * fz - z * fy, z * fx - x * fz, x * fy - y * fx];
                let found = felt(&rom.contact_map.row(3 * node + component).transpose());
                for (row, acting) in [fx, fy, fz].into_iter().chain(moment).enumerate() {
                    let size = if row < 3 { 1.0 } else { radius };
                    worst[0] = worst[0].max((found[row] + acting).abs() / size);
                }
            }
        }
        let thermal = rom.extras.thermal.as_ref().unwrap();
        for patch in 0..thermal.patches.len() {
            let elastic = felt(&thermal.loads.column(patch).into_owned());
            let left = &elastic - rows.thermal.column(patch);
            // Relative to the force that keeps the patch from expanding.
            worst[1] = worst[1].max(left.amax() / thermal_size(patch));
        }
        println!(
            "{support:?}: reaction off by {:.1e} of a contact force, {:.1e} of the force of a patch",
            worst[0], worst[1]
        );
        assert!(worst[0] < 1e-8 && worst[1] < 1e-8, "{support:?}: {worst:?}");
    }
    assert!(reduced(RingSupport::Free).rom.extras.support.is_none());
}

/// Returns the sum of the magnitudes of the nodal forces of a patch of the coarse casing (N/K).
fn thermal_size(patch: usize) -> f64 {
    let options = coarse(RingSupport::Low);
    let ring = supported_ring(&options).unwrap();
    let patches = equal_patches(12, 2, options.geometry.contour.axial());
    let loads = patch_loads(&ring.mesh, &options.material, &patches).unwrap();
    (0..loads.nrows()).map(|dof| loads[(dof, patch)].abs()).sum()
}

fn box_pencil() -> (Mesh, SparseMatrix, SparseMatrix) {
    let mesh = distorted_box(ElementKind::Hex8, [4, 2, 2], [0.3, 0.04, 0.05], wobble(0.1));
    let assembled = assemble(&mesh, &Material::steel(), &silent).unwrap();
    let free = free_dofs(mesh.nodes.len(), &nodes_at(&mesh, 0, 0.0));
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    (mesh, stiffness, mass)
}

#[test]
fn static_responses_make_loads_exact() {
    let (_, stiffness, mass) = box_pencil();
    let order = stiffness.order();
    let interface = [order - 1, order - 2, order - 3, 10, 11, 12];
    let plain = craig_bampton(&stiffness, &mass, &interface, 4, &silent).unwrap();
    // Loads 1 and 2: arbitrary; 3: twice the first; 4: zero; 5: inertia of a mode that is kept; 6: on the interface
    // alone.
    let mut loads = Mat::from_fn(order, 6, |i, k| ((3 * i + 5 * k) as f64).sin());
    let mode = Mat::from_fn(order, 1, |i, _| plain.transformation[(i, 7)]);
    let inertia = mass.times(mode.as_ref());
    for i in 0..order {
        loads[(i, 2)] = 2.0 * loads[(i, 0)];
        loads[(i, 3)] = 0.0;
        loads[(i, 4)] = inertia[(i, 0)];
        loads[(i, 5)] = if interface.contains(&i) { 1.0 } else { 0.0 };
    }
    let inner = InnerBasis { modes: 4, whole_pairs: false, loads: Some(loads.as_ref()) };
    let reduced = craig_bampton_with(&stiffness, &mass, &interface, &inner, &silent).unwrap();
    assert_eq!(reduced.mass.nrows(), 6 + 4 + 2, "two of the six loads are new");
    assert_eq!(reduced.fixed_interface_frequencies, plain.fixed_interface_frequencies);
    let exact = stiffness.factor("K", "").unwrap().solve(loads.clone());
    let right = reduced.transformation.transpose() * &loads;
    let right = DMatrix::from_fn(right.nrows(), 6, |i, k| right[(i, k)]);
    let small = reduced.stiffness.clone().cholesky().unwrap().solve(&right);
    let found = &reduced.transformation * Mat::from_fn(small.nrows(), 6, |i, k| small[(i, k)]);
    for k in [0, 1, 2, 4, 5] {
        let size = exact.get(.., k..k + 1).norm_max();
        let error = (exact.get(.., k..k + 1) - found.get(.., k..k + 1)).norm_max() / size;
        println!("load {}: the reduced model is off by {error:.1e} at rest", k + 1);
        assert!(error < 1e-10, "load {}: {error:e}", k + 1);
    }
    // Without the static responses the response to the first load is wrong, which the test would detect.
    let right = plain.transformation.transpose() * &loads;
    let right = DVector::from_fn(right.nrows(), |i, _| right[(i, 0)]);
    let small = plain.stiffness.clone().cholesky().unwrap().solve(&right);
    let found = &plain.transformation * Mat::from_fn(small.nrows(), 1, |i, _| small[i]);
    assert!((exact.get(.., ..1) - found).norm_max() > 1e-4 * exact.get(.., ..1).norm_max());
}

#[test]
fn condensing_keeps_low_modes_and_static_response() {
    let (_, stiffness, mass) = box_pencil();
    let order = stiffness.order();
    let interface: Vec<usize> = (order - 6..order).collect();
    let reduced = craig_bampton(&stiffness, &mass, &interface, 30, &silent).unwrap();
    let all = modal_form(&reduced.stiffness, &reduced.mass, &DMatrix::zeros(36, 0)).unwrap();
    let gram = all.shapes.transpose() * &reduced.mass * &all.shapes;
    let worst = (gram - DMatrix::identity(36, 36)).amax();
    println!("modes are orthonormal in the mass to {worst:.1e}");
    assert!(worst < 1e-9);
    let loads = DMatrix::from_fn(36, 6, |i, k| if i == k { 1.0 } else { 0.0 });
    let fewer = condense(&all, 10, &loads);
    assert_eq!((fewer.squares.len(), fewer.condensed_from), (16, Some(10)));
    assert_eq!(fewer.squares[..10], all.squares[..10]);
    assert_eq!(fewer.shapes.columns(0, 10), all.shapes.columns(0, 10));
    let flexibility = |form: &ModalForm| {
        let inverse = DMatrix::from_diagonal(&DVector::from_vec(form.squares.iter().map(|s| 1.0 / s).collect()));
        loads.transpose() * &form.shapes * inverse * form.shapes.transpose() * &loads
    };
    let (exact, found) = (flexibility(&all), flexibility(&fewer));
    assert!((&exact - &found).amax() < 1e-11 * exact.amax());
    // Truncation alone loses part of the response.
    let cut = condense(&all, 10, &DMatrix::zeros(36, 0));
    assert!((&exact - flexibility(&cut)).amax() > 1e-6 * exact.amax());
    assert_eq!(condense(&all, 36, &loads).squares, all.squares);
}

/// Condensation of a pencil with all modes yields the same as free-interface modes with residual flexibility; with
/// fewer fixed-interface modes the static response is the same and the frequencies are higher.
#[test]
fn condensation_equals_free_interface_reduction() {
    let (_, stiffness, mass) = box_pencil();
    let order = stiffness.order();
    let interface: Vec<usize> = (order - 6..order).collect();
    let loads = Mat::from_fn(order, 6, |i, k| if i == interface[k] { 1.0 } else { 0.0 });
    let direct = free_interface(&stiffness, &mass, loads.as_ref(), 10, &silent).unwrap();
    let (direct, _) = dense_modes(&direct.stiffness, &direct.mass).unwrap();
    let condensed = |modes: usize| {
        let reduced = craig_bampton(&stiffness, &mass, &interface, modes, &silent).unwrap();
        let all = modal_form(&reduced.stiffness, &reduced.mass, &DMatrix::zeros(6 + modes, 0)).unwrap();
        condense(&all, 10, &DMatrix::from_fn(6 + modes, 6, |i, k| if i == k { 1.0 } else { 0.0 })).squares
    };
    let off = |found: &[f64]| found.iter().zip(&direct).map(|(a, b)| a / b - 1.0).fold(0.0, f64::max);
    let (all, some) = (condensed(order - 6), condensed(20));
    println!("squares of all modes off by {:.1e}, of twenty by {:.1e}", off(&all), off(&some));
    assert!(
        all.len() == direct.len() && off(&all).abs() < 1e-9 && off(&some) > 1e-6,
        "{:e} {:e}",
        off(&all),
        off(&some)
    );
}

/// An imported mesh: other node numbers, contact nodes as an unordered set, prisms.
#[test]
fn reduction_is_independent_of_node_numbering() {
    let options = coarse(RingSupport::Low);
    let ring = supported_ring(&options).unwrap();
    let count = ring.mesh.nodes.len();
    // 7919 is a prime and does not divide the count: a permutation.
    let number = |node: usize| node * 7919 % count;
    let mut mesh = Mesh { nodes: vec![[0.0; 3]; count], ..Mesh::default() };
    (0..count).for_each(|node| mesh.nodes[number(node)] = ring.mesh.nodes[node]);
    mesh.elements = ring.mesh.elements.clone();
    mesh.elements.iter_mut().for_each(|element| element.nodes.iter_mut().for_each(|node| *node = number(*node)));
    let contact: Vec<usize> = ring.grid.nodes.iter().rev().map(|node| number(*node)).collect();
    let clamped: Vec<usize> = ring.mesh.set(CLAMPED).unwrap().iter().map(|node| number(*node)).collect();
    let grid = GridNodes::sorted(&mesh, &contact, 3).unwrap();
    let same: Vec<usize> = ring.grid.nodes.iter().map(|node| number(*node)).collect();
    assert_eq!((grid.around, &grid.nodes), (24, &same));
    for (parabola, contour) in grid.slopes.iter().zip(&ring.grid.slopes) {
        assert!((parabola - contour).abs() < 0.03, "{:?} {:?}", grid.slopes, ring.grid.slopes);
    }
    let settings = CasingReductionOptions {
        formulation: Formulation::Displacement,
        name: "own".into(),
        fixed_interface_modes: options.fixed_interface_modes,
        modes: options.modes,
        checked_modes: options.checked_modes,
        damping_ratio: 0.01,
    };
    let patches = equal_patches(12, 2, options.geometry.contour.axial());
    let own =
        reduce_casing(mesh.clone(), &options.material, &clamped, &grid, &patches, &settings, &silent).unwrap().rom;
    let parametric = &reduced(RingSupport::Low).rom;
    for (a, b) in own.checks.reduced_frequencies.iter().zip(&parametric.checks.reduced_frequencies) {
        assert!((a / b - 1.0).abs() < 1e-8);
    }
    let temperatures: Vec<f64> = (0..24).map(|k| f64::from(k * k % 7)).collect();
    let (a, b) = (heated(&own, &temperatures), heated(parametric, &temperatures));
    assert!((&a - &b).amax() < 1e-9 * b.amax());
    // Without patches there are no thermal loads, and heat adds no coordinates.
    let cold = reduce_casing(mesh.clone(), &options.material, &clamped, &grid, &[], &settings, &silent).unwrap().rom;
    assert!(cold.extras.thermal.is_none() && cold.order() < own.order());

    let refused = |grid: &GridNodes, patches: &[ThermalPatch], hint: &str| {
        let result = reduce_casing(mesh.clone(), &options.material, &clamped, grid, patches, &settings, &silent);
        let error = result.unwrap_err().to_string();
        assert!(error.contains(hint), "{error}");
    };
    let mut held = grid.clone();
    held.nodes[5] = clamped[0];
    refused(&held, &patches, "contact node `ring_1_node_6`: it is clamped");
    let mut shifted = grid.clone();
    shifted.nodes.swap(3, 4);
    refused(&shifted, &patches, "not at its grid position");
    refused(&GridNodes { around: 0, ..grid.clone() }, &patches, "72 nodes and 3 slopes do not fit rings of 0");
    refused(&GridNodes { slopes: vec![0.0; 2], ..grid.clone() }, &patches, "2 slopes do not fit rings of 24");
    let outside = ThermalPatch { angle: [0.0, 1.0], axial: [1.0, 2.0] };
    refused(&grid, &[patches[0], outside], "thermal patch 2: no element");
    refused(&grid, &[patches[0], patches[0]], "thermal patches 1 and 2: both contain element");
    let error = GridNodes::sorted(&mesh, &contact[1..], 3).unwrap_err().to_string();
    assert!(error.contains("71 nodes cannot be divided into 3 rings"), "{error}");
}

/// Even without modes the static response is that of the full model, and rigid-body modes are kept.
#[test]
fn casing_without_modes_keeps_exact_static_response() {
    let full = &reduced(RingSupport::Free).rom;
    let options = CasingOptions { fixed_interface_modes: 0, modes: 0, ..coarse(RingSupport::Free) };
    let rom = reduce_ring(&options, &silent).unwrap().rom;
    let rigid = rom.stiffness.diagonal().iter().filter(|square| **square == 0.0).count();
    assert_eq!((rigid, rom.order()), (6, 216 + 24));
    let temperatures: Vec<f64> = (0..24).map(|k| f64::from(k * k % 7)).collect();
    let (a, b) = (heated(full, &temperatures), heated(&rom, &temperatures));
    println!("no modes: at rest off the usual model by {:.1e}", (&a - &b).amax() / a.amax());
    assert!((&a - &b).amax() < 1e-8 * a.amax());
}

#[test]
fn rom_is_bit_identical_for_any_thread_count() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| reduce_ring(&coarse(RingSupport::Low), &silent)).unwrap().rom
    };
    for threads in [1, 5] {
        assert!(on(threads) == reduced(RingSupport::Low).rom, "{threads} threads");
    }
}
