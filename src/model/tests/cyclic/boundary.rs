//! Pairing of the faces of a sector, and rejected input.

use crate::common::disk::{COARSE, CellCounts, boundary, model, options, sector, tips};
use tiprub_model::cyclic::{CyclicBoundary, ModeSelection, PairingReport, reduce_cyclic, whole_disk};
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::Mesh;
use tiprub_model::progress::silent;
use tiprub_model::reduce::ContactPoint;

const SECTORS: usize = 7;

fn coarse() -> Mesh {
    sector(ElementKind::Hex8, SECTORS, COARSE)
}

fn paired(mesh: &Mesh, low: &str, high: &str, tolerance: f64) -> Result<(CyclicBoundary, PairingReport), String> {
    let (low, high) = (mesh.set(low).unwrap(), mesh.set(high).unwrap());
    CyclicBoundary::pair(&mesh.nodes, low, high, SECTORS, tolerance).map_err(|error| error.to_string())
}

#[test]
fn pairs_cyclic_faces_in_either_order() {
    let mesh = coarse();
    let (forward, report) = paired(&mesh, "LOW", "HIGH", 1e-9).unwrap();
    assert!(!report.swapped);
    assert!(report.largest_mismatch < 1e-15 && report.typical_mismatch <= report.largest_mismatch);
    assert_eq!(forward.pairs.len(), mesh.set("LOW").unwrap().len());
    let turn = forward.pitch();
    for [low, high] in &forward.pairs {
        let ([x, y, z], [a, b, c]) = (mesh.nodes[*low], mesh.nodes[*high]);
        let (sin, cos) = turn.sin_cos();
        assert!((cos * x - sin * y - a).abs() + (sin * x + cos * y - b).abs() + (z - c).abs() < 1e-14);
    }
    let (backward, report) = paired(&mesh, "HIGH", "LOW", 1e-9).unwrap();
    assert!(report.swapped);
    let sorted = |boundary: &CyclicBoundary| {
        let mut pairs = boundary.pairs.clone();
        pairs.sort_unstable();
        pairs
    };
    assert_eq!(sorted(&forward), sorted(&backward));
}

#[test]
fn reports_the_largest_mismatch_and_its_node() {
    let mut mesh = coarse();
    let (exact, _) = paired(&mesh, "LOW", "HIGH", 1e-9).unwrap();
    let [low, high] = exact.pairs[3];
    mesh.nodes[high][2] += 2e-6;
    let (_, report) = paired(&mesh, "LOW", "HIGH", 1e-5).unwrap();
    assert!((report.largest_mismatch - 2e-6).abs() < 1e-12 && report.worst_node == low);
    assert!(report.typical_mismatch < 1e-12);
    let message = paired(&mesh, "LOW", "HIGH", 1e-6).unwrap_err();
    for part in [format!("node {} ", low + 1), format!("(node {})", high + 1), "2.000e-6 m".into(), "tolerance".into()]
    {
        assert!(message.contains(&part), "`{part}` is missing: {message}");
    }
}

#[test]
fn rejects_invalid_pairs_of_cyclic_faces() {
    let mesh = coarse();
    let (low, high) = (mesh.set("LOW").unwrap().to_vec(), mesh.set("HIGH").unwrap().to_vec());
    let refusal = |nodes: &[[f64; 3]], low: &[usize], high: &[usize], sectors, tolerance| {
        CyclicBoundary::pair(nodes, low, high, sectors, tolerance).unwrap_err().to_string()
    };
    let [a, b] = [low[0], low[1]];
    let partner = boundary(&mesh, SECTORS).pairs[0][1];
    let apart = *high.last().unwrap();
    let mut on_axis = mesh.nodes.clone();
    on_axis[a] = [0.0, 0.0, 0.01];
    let mut far = mesh.nodes.clone();
    far.push([f64::NAN; 3]);
    let cases = [
        (refusal(&mesh.nodes, &low, &high, 1, 1e-9), "1 sectors"),
        (refusal(&mesh.nodes, &low, &high, 8, 1e-9), "2π/8"),
        (refusal(&mesh.nodes, &low, &high[1..], SECTORS, 1e-9), "nodes on one face"),
        (refusal(&mesh.nodes, &[], &[], SECTORS, 1e-9), "0 nodes on one face"),
        (refusal(&mesh.nodes, &low, &high, SECTORS, f64::NAN), "tolerance of NaN m"),
        (refusal(&on_axis, &low, &high, SECTORS, 1e-9), "z axis"),
        (refusal(&mesh.nodes, &[a, a], &high[..2], SECTORS, 1e-9), "twice"),
        (refusal(&mesh.nodes, &[a], &[a], SECTORS, 1e-9), "twice"),
        (refusal(&mesh.nodes, &[99_999], &high[..1], SECTORS, 1e-9), "does not exist"),
        (refusal(&mesh.nodes, &[a, b], &[partner, apart], SECTORS, 1.0), "are both matched with"),
        (refusal(&far, &[far.len() - 1], &high[..1], SECTORS, 1e-9), "not finite"),
    ];
    for (message, expected) in cases {
        assert!(message.contains(expected), "`{expected}` expected: {message}");
    }
}

#[test]
fn rejects_wrong_sector_count_at_any_tolerance() {
    let mesh = coarse();
    let (low, high) = (mesh.set("LOW").unwrap(), mesh.set("HIGH").unwrap());
    for sectors in [2, 6, 8, 14] {
        let message = CyclicBoundary::pair(&mesh.nodes, low, high, sectors, 10.0).unwrap_err().to_string();
        assert!(message.contains("misses node") || message.contains("are both matched with"), "{sectors}: {message}");
    }
    // A single pair has no neighbours to be confused with; a tolerance that is merely wide is harmless.
    assert!(CyclicBoundary::pair(&mesh.nodes, low, high, SECTORS, 10.0).is_ok());
}

#[test]
fn rejects_contact_on_cyclic_faces_and_loose_structures() {
    let mesh = coarse();
    let (faces, bore) = (boundary(&mesh, SECTORS), mesh.set("BORE").unwrap().to_vec());
    let options = options(ModeSelection::Count(2), 2);
    let refusal = |clamped: &[usize], contact: &[ContactPoint]| {
        reduce_cyclic(&model(mesh.clone()), clamped, contact, &faces, &options, &silent).unwrap_err().to_string()
    };
    let at = |node| vec![ContactPoint::at("edge", node, 0.0)];
    let rim = *mesh.set("LOW").unwrap().iter().find(|node| !bore.contains(node)).unwrap();
    assert!(refusal(&bore, &at(rim)).contains("cyclic face"));
    assert!(refusal(&bore, &at(bore[1])).contains("clamped"));
    assert!(refusal(&bore, &[]).contains("none given"));
    let other = CyclicBoundary { pairs: vec![[0, 99_999]], sectors: SECTORS };
    let error = reduce_cyclic(&model(mesh.clone()), &bore, &tips(&mesh, 2), &other, &options, &silent).unwrap_err();
    assert!(error.to_string().contains("does not exist"), "{error}");
    // A disconnected brick.
    let mut loose = mesh.clone();
    let first = loose.nodes.len();
    loose.nodes.extend(
        (0..8).map(|i| [0.3 + 0.01 * f64::from(i & 1), 0.01 * f64::from(i >> 1 & 1), 0.01 * f64::from(i >> 2)]),
    );
    let corners = [0, 1, 3, 2, 4, 5, 7, 6].map(|i| first + i).to_vec();
    loose.elements.push(tiprub_model::mesh::Element { kind: ElementKind::Hex8, nodes: corners });
    let error = reduce_cyclic(&model(loose), &bore, &tips(&mesh, 2), &faces, &options, &silent).unwrap_err();
    assert!(error.to_string().contains("connected neither to"), "{error}");
}

#[test]
fn clamping_one_face_node_clamps_its_partner() {
    let mesh = coarse();
    let (faces, bore) = (boundary(&mesh, SECTORS), mesh.set("BORE").unwrap().to_vec());
    let options = options(ModeSelection::Count(2), 2);
    let high = mesh.set("HIGH").unwrap();
    let one_side: Vec<usize> = bore.iter().copied().filter(|node| !high.contains(node)).collect();
    assert!(one_side.len() < bore.len());
    let rom = |clamped: &[usize]| {
        reduce_cyclic(&model(mesh.clone()), clamped, &tips(&mesh, 2), &faces, &options, &silent).unwrap().rom
    };
    let (half, both) = (rom(&one_side), rom(&bore));
    assert_eq!(half.mass, both.mass);
    assert_eq!(half.extras.harmonics, both.extras.harmonics);
}

#[test]
fn sectors_assemble_into_a_closed_disk() {
    let mesh = coarse();
    let disk = whole_disk(&mesh, &boundary(&mesh, SECTORS)).unwrap();
    let per_sector = mesh.nodes.len() - mesh.set("LOW").unwrap().len();
    assert_eq!(disk.mesh.nodes.len(), SECTORS * per_sector);
    assert_eq!(disk.mesh.elements.len(), SECTORS * mesh.elements.len());
    // Every node is at the rotated position of the node of the sector, including those that belong to the next
    // sector.
    for (s, numbers) in disk.nodes.iter().enumerate() {
        let (sin, cos) = (core::f64::consts::TAU * s as f64 / SECTORS as f64).sin_cos();
        for (own, &number) in numbers.iter().enumerate() {
            let ([x, y, z], [a, b, c]) = (mesh.nodes[own], disk.mesh.nodes[number]);
            assert!((cos * x - sin * y - a).abs() + (sin * x + cos * y - b).abs() + (z - c).abs() < 1e-14);
        }
    }
}

#[test]
fn rejects_two_sectors_that_can_rotate_about_a_line() {
    let mesh = sector(ElementKind::Hex8, 2, CellCounts { around: 5, ..COARSE });
    let options = options(ModeSelection::Count(2), 0);
    let faces = boundary(&mesh, 2);
    let inner =
        *mesh.set("BORE").unwrap().iter().find(|node| !faces.pairs.iter().flatten().any(|n| n == *node)).unwrap();
    let reduce =
        |clamped: &[usize]| reduce_cyclic(&model(mesh.clone()), clamped, &tips(&mesh, 3), &faces, &options, &silent);
    assert!(reduce(mesh.set("BORE").unwrap()).is_ok());
    let error = reduce(&[inner]).unwrap_err().to_string();
    assert!(error.contains("nodal diameter") && error.contains("rigid-body motion"), "{error}");
}
