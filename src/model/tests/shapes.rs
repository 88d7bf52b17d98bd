//! Displacements of surfaces per reduced coordinate: modes of the reduced models against those of the full ones.

mod common;

use std::collections::HashMap;

use common::casing::coarse;
use common::disk::{COARSE, boundary, model, options, sector, tips};
use common::{distorted_box, nodes_at, steel, wobble};
use nalgebra::{Complex, DMatrix};
use tiprub_core::modes::cyclic::CyclicModel;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_model::casing::RingSupport;
use tiprub_model::cube::{CubeOptions, RingOptions, RingSide, reduce_cube, reduce_cube_ring};
use tiprub_model::cyclic::{CyclicOptions, ModeSelection, reduce_cyclic};
use tiprub_model::element::ElementKind;
use tiprub_model::progress::silent;
use tiprub_model::reduce::{ContactPoint, ReductionKind, ReductionOptions, reduce};
use tiprub_model::shapes::DiameterShapes;
use tiprub_model::stress::StressPlaces;
use tiprub_model::{Mesh, Reduction, SurfaceShapes, reduce_ring};

/// Returns the nodes of the mesh at the points of the surface.
fn nodes(mesh: &Mesh, shapes: &SurfaceShapes) -> Vec<usize> {
    let key = |place: &[f64; 3]| place.map(f64::to_bits);
    let places: HashMap<_, usize> = mesh.nodes.iter().map(key).zip(0..).collect();
    shapes.points.iter().map(|place| places[&key(place)]).collect()
}

/// Returns the displacements of the points in the modes (columns of `modes` in reduced coordinates), 3·points × modes.
fn moved(shapes: &DiameterShapes, modes: &DMatrix<Complex<f64>>) -> DMatrix<Complex<f64>> {
    let rows = shapes.real.len() / shapes.order;
    let map = DMatrix::from_fn(rows, shapes.order, |row, k| {
        let place = k * rows + row;
        Complex::new(f64::from(shapes.real[place]), f64::from(shapes.imaginary.get(place).copied().unwrap_or(0.0)))
    });
    map * modes
}

/// Returns the smallest distance of a mode from another one of any phase, relative to its size.
fn distance(found: &[Complex<f64>], expected: &[Complex<f64>]) -> f64 {
    let size = |mode: &[Complex<f64>]| mode.iter().map(Complex::norm_sqr).sum::<f64>().sqrt();
    let product: Complex<f64> = found.iter().zip(expected).map(|(a, b)| a.conj() * b).sum();
    let turn = product / product.norm();
    let left: Vec<Complex<f64>> = found.iter().zip(expected).map(|(a, b)| a * turn - b).collect();
    size(&left) / size(expected)
}

/// Checks the lowest elastic modes from `first` on.
fn check(reduction: &Reduction, first: usize, count: usize, allowed: f64) {
    let (shapes, mesh) = (reduction.shapes.as_ref().unwrap(), reduction.mesh.as_ref().unwrap());
    assert_eq!(shapes.diameters.len(), 1);
    assert_eq!(shapes.diameters[0].order, reduction.rom.order());
    let nodes = nodes(mesh, shapes);
    let modes = ModalModel::at_speed(&reduction.rom, 0.0, 0.0).unwrap().shapes.map(|value| Complex::new(value, 0.0));
    let moved = moved(&shapes.diameters[0], &modes);
    for (k, mode) in reduction.modes.iter().enumerate().take(count).skip(first) {
        let expected = nodes.iter().flat_map(|node| mode.shape[*node]).map(|value| Complex::new(value, 0.0));
        let far = distance(moved.column(k).as_slice(), &expected.collect::<Vec<_>>());
        assert!(far < allowed, "{}: mode {k} differs by {far}", reduction.rom.name);
    }
}

/// Checks the displacements of contact nodes that are points of the surface against the contact map of the ROM.
fn check_contact(reduction: &Reduction) {
    let (rom, shapes) = (&reduction.rom, reduction.shapes.as_ref().unwrap());
    let (rows, mut compared) = (3 * shapes.points.len(), 0);
    for (index, node) in rom.contact_nodes.iter().enumerate() {
        let angle = if rom.frame == DisplacementFrame::Cylindrical { node.position[1] } else { 0.0 };
        let (sine, cosine) = angle.sin_cos();
        let place = match rom.frame {
            DisplacementFrame::Cylindrical => [node.position[0] * cosine, node.position[0] * sine, node.position[2]],
            DisplacementFrame::Cartesian => node.position,
        };
        let near = |point: &[f64; 3]| (0..3).all(|axis| (point[axis] - place[axis]).abs() < 1e-9);
        let Some(point) = shapes.points.iter().position(near) else { continue };
        compared += 1;
        for k in 0..rom.order() {
            let own = [0, 1, 2].map(|axis| f64::from(shapes.diameters[0].real[k * rows + 3 * point + axis]));
            let found = [cosine * own[0] + sine * own[1], cosine * own[1] - sine * own[0], own[2]];
            let size = rom.contact_map.column(k).amax();
            for (component, found) in found.into_iter().enumerate() {
                let expected = rom.contact_map[(3 * index + component, k)];
                assert!((found - expected).abs() <= 2e-7 * size, "{}: {index} {k}: {found} {expected}", rom.name);
            }
        }
    }
    assert!(2 * compared > rom.contact_nodes.len(), "{}: {compared}", rom.name);
}

#[test]
fn modes_of_a_blade_move_its_surface_like_the_full_model() {
    for (frame, kind) in [
        (DisplacementFrame::Cartesian, ReductionKind::FixedInterface),
        (DisplacementFrame::Cylindrical, ReductionKind::FixedInterface),
        (DisplacementFrame::Cylindrical, ReductionKind::FreeInterface),
    ] {
        let mut mesh = distorted_box(ElementKind::Hex20, [5, 2, 2], [0.3, 0.04, 0.05], wobble(0.1));
        let clamped = nodes_at(&mesh, 0, 0.0);
        let tip = nodes_at(&mesh, 0, 0.3);
        // Away from the axis, and off the x axis.
        mesh.nodes.iter_mut().for_each(|node| (node[0], node[1]) = (node[0] + 0.2, node[1] + 0.1));
        let contact = [ContactPoint::at("a", tip[0], 0.0), ContactPoint::at("b", tip[3], 0.0)];
        let options = ReductionOptions {
            name: "box".into(),
            kind,
            modes: 20,
            checked_modes: 4,
            sectors: 1,
            frame,
            watched: Vec::new(),
            stress: StressPlaces::default(),
            damping_ratio: 0.005,
        };
        let reduction = reduce(mesh, &steel(), &clamped, &contact, &options, &silent).unwrap();
        check(&reduction, 0, 3, 1e-3);
        // Unit displacements of contact nodes that are points of the surface.
        let shapes = reduction.shapes.as_ref().unwrap();
        let nodes = nodes(reduction.mesh.as_ref().unwrap(), shapes);
        for (index, point) in contact.iter().enumerate() {
            let Some(place) = nodes.iter().position(|node| *node == point.node) else { continue };
            let rows = 3 * nodes.len();
            for component in 0..3 {
                let own = &shapes.diameters[0].real[(3 * index + component) * rows + 3 * place..][..3];
                let size: f32 = own.iter().map(|value| value * value).sum();
                assert!((size - 1.0).abs() < 1e-6, "{own:?}");
            }
        }
    }
}

#[test]
fn casings_and_free_bodies_move_like_the_full_model() {
    // The two modes of a double frequency of a ring have no defined direction, so that their space is compared.
    let casing = reduce_ring(&coarse(RingSupport::Low), &silent).unwrap();
    let shapes = casing.shapes.as_ref().unwrap();
    let nodes = nodes(casing.mesh.as_ref().unwrap(), shapes);
    let modes = ModalModel::at_speed(&casing.rom, 0.0, 0.0).unwrap().shapes.map(|value| Complex::new(value, 0.0));
    let moved = moved(&shapes.diameters[0], &modes);
    let full = DMatrix::from_fn(3 * nodes.len(), 2, |row, k| casing.modes[k].shape[nodes[row / 3]][row % 3]);
    let own = moved.columns(0, 2).map(|value| value.re);
    let turn = (full.transpose() * &full).try_inverse().unwrap() * full.transpose() * &own;
    let far = (&full * turn - &own).norm() / own.norm();
    // The coarse reduction changes the modes by some thousandths, so the contact nodes are compared as well: without an error.
    assert!(far < 5e-3, "{far}");
    check_contact(&casing);
    // The modes of a cube have no defined direction either.
    check_contact(&reduce_cube(&CubeOptions { modes: Some(40), ..CubeOptions::default() }, &silent).unwrap());
    let ring = reduce_cube_ring(&RingOptions::new(RingSide::Left), &silent).unwrap();
    check_contact(&ring);
    check(&ring, 0, 3, 1e-3);
}

#[test]
fn coupled_sectors_move_like_the_full_model() {
    let sectors = 7;
    let mesh = sector(ElementKind::Hex20, sectors, COARSE);
    let (contact, faces) = (tips(&mesh, 2), boundary(&mesh, sectors));
    let clamped = mesh.set("BORE").unwrap().to_vec();
    for kind in [ReductionKind::FixedInterface, ReductionKind::FreeInterface] {
        let options = CyclicOptions { kind, ..options(ModeSelection::Count(12), 4) };
        let reduction = reduce_cyclic(&model(mesh.clone()), &clamped, &contact, &faces, &options, &silent).unwrap();
        let shapes = reduction.shapes.as_ref().unwrap();
        let nodes = nodes(&mesh, shapes);
        let modes = CyclicModel::from_rom(&reduction.rom, 0.0).unwrap();
        assert_eq!(shapes.diameters.len(), modes.diameters.len());
        for (n, (own, diameter)) in shapes.diameters.iter().zip(&modes.diameters).enumerate() {
            assert_eq!(own.order, diameter.len());
            assert_eq!(own.imaginary.is_empty(), n == 0);
            let moved = moved(own, &diameter.shapes);
            let full = &reduction.nodal_diameters[n];
            for (k, shape) in full.shapes.iter().enumerate().take(2).filter(|(k, _)| full.full_frequencies[*k] > 1.0) {
                let expected: Vec<Complex<f64>> = nodes.iter().flat_map(|node| shape[*node]).collect();
                let far = distance(moved.column(k).as_slice(), &expected);
                assert!(far < 2e-3, "{kind:?}, {n} diameters: mode {k} differs by {far}");
            }
        }
        // The faces to the neighbours are inside the disk.
        let mut start = 0;
        for end in shapes.ends.iter().map(|end| *end as usize) {
            let corners = || shapes.corners[start..end].iter().map(|corner| nodes[*corner as usize]);
            assert!(
                [0, 1].iter().all(|side| !corners().all(|node| faces.pairs.iter().any(|pair| pair[*side] == node)))
            );
            start = end;
        }
    }
}
