//! Meshes for other programs: CalculiX input files and VTK.

mod common;

use std::collections::BTreeMap;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use common::straight_box;
use nalgebra::Complex;
use tiprub_model::casing::{ContactRings, Flange, InnerContour, RingCounts, RingGeometry, ring_mesh};
use tiprub_model::element::ElementKind;
use tiprub_model::inp::{CyclicSymmetry, calculix_cyclic_input, calculix_input};
use tiprub_model::stage::{SectorOptions, sector_mesh};
use tiprub_model::vtk::{self, NodalField, Values};
use tiprub_model::{Material, Mesh};

fn coarse() -> Mesh {
    sector_mesh(&SectorOptions::coarse()).unwrap().mesh
}

/// Returns keyword lines with the numbers that follow them, continuation lines joined.
fn blocks(text: &str) -> Vec<(String, Vec<String>)> {
    let mut blocks: Vec<(String, Vec<String>)> = Vec::new();
    let mut open = false;
    for line in text.lines() {
        assert!(line.len() <= 132 && line.split(',').count() <= 17, "too long for CalculiX: {line}");
        if line.starts_with('*') {
            blocks.push((line.to_owned(), Vec::new()));
        } else {
            let lines = &mut blocks.last_mut().expect("a keyword comes first").1;
            if open { lines.last_mut().unwrap().push_str(line) } else { lines.push(line.to_owned()) }
        }
        open = line.ends_with(',') && !line.starts_with('*');
    }
    blocks
}

fn numbers(line: &str) -> Vec<usize> {
    line.split(',').map(|number| number.trim().parse().unwrap()).collect()
}

#[test]
fn calculix_file_reproduces_the_mesh() {
    let ring = ring_mesh(
        &RingGeometry {
            contour: InnerContour::new(&[[-0.02, 0.3], [0.02, 0.29]]).unwrap(),
            thickness: 0.004,
            flanges: [Some(Flange { thickness: 0.004, height: 0.01 }), None],
        },
        RingCounts { around: 8, through: 1, along: 3, flange: 1 },
        ContactRings { around: 4, along: 2, axial: [-0.01, 0.01] },
        ElementKind::Hex20,
    );
    let boxes = ElementKind::ALL.map(|kind| straight_box(kind, [2, 1, 1], [0.2, 0.1, 0.1]));
    for mesh in boxes.into_iter().chain([coarse(), ring.unwrap().mesh]) {
        let text = calculix_input(&mesh, &Material::steel(), None, 5).unwrap();
        let blocks = blocks(&text);
        let nodes = &blocks.iter().find(|(keyword, _)| keyword.starts_with("*NODE, NSET")).unwrap().1;
        assert_eq!(nodes.len(), mesh.nodes.len());
        for (index, line) in nodes.iter().enumerate() {
            let fields: Vec<f64> = line.split(',').map(|field| field.trim().parse().unwrap()).collect();
            assert!((fields[0] - (index + 1) as f64).abs() < 0.1);
            for d in 0..3 {
                assert!((fields[d + 1] - mesh.nodes[index][d]).abs() <= 1e-12 * mesh.nodes[index][d].abs());
            }
        }
        let elements = &blocks.iter().find(|(keyword, _)| keyword.starts_with("*ELEMENT,")).unwrap();
        let kind = mesh.elements[0].kind.calculix_name();
        assert_eq!(elements.0, format!("*ELEMENT, TYPE={kind}, ELSET=EALL"));
        for (index, (line, element)) in elements.1.iter().zip(&mesh.elements).enumerate() {
            let expected: Vec<usize> =
                core::iter::once(index).chain(element.nodes.iter().copied()).map(|number| number + 1).collect();
            assert_eq!(numbers(line), expected);
        }
        let sets: BTreeMap<&str, Vec<usize>> = blocks
            .iter()
            .filter_map(|(keyword, lines)| Some((keyword.strip_prefix("*NSET, NSET=")?, numbers(&lines.concat()))))
            .collect();
        assert_eq!(sets.len(), mesh.sets.len());
        for (name, nodes) in &mesh.sets {
            assert_eq!(sets[name.to_uppercase().as_str()], nodes.iter().map(|node| node + 1).collect::<Vec<_>>());
        }
    }
}

fn cyclic(diameters: &[usize]) -> tiprub_model::Result<String> {
    let symmetry = CyclicSymmetry { faces: ["CYCLIC_LOW", "CYCLIC_HIGH"], sectors: 56, nodal_diameters: diameters };
    calculix_cyclic_input(&coarse(), &Material::titanium(), Some("CLAMPED"), &symmetry, 10)
}

#[test]
fn writes_a_sector_with_a_step_per_nodal_diameter() {
    let (mesh, text) = (coarse(), cyclic(&[0, 2, 28]).unwrap());
    let blocks = blocks(&text);
    let clamped = mesh.set("CLAMPED").unwrap();
    for (name, face) in [("TIED_LOW", "CYCLIC_LOW"), ("TIED_HIGH", "CYCLIC_HIGH")] {
        let tied = &blocks.iter().find(|(keyword, _)| *keyword == format!("*NSET, NSET={name}")).unwrap().1;
        let tied: Vec<usize> = numbers(&tied.concat()).iter().map(|number| number - 1).collect();
        let face = mesh.set(face).unwrap();
        let expected: Vec<usize> = face.iter().copied().filter(|node| !clamped.contains(node)).collect();
        assert!(expected.len() < face.len(), "the bore's nodes lie on the faces");
        assert_eq!(tied, expected, "CalculiX stops at nodes that are both clamped and tied");
    }
    for line in [
        "*TIE, NAME=CYCLIC, CYCLIC SYMMETRY\nSTIED_HIGH, STIED_LOW\n",
        "N=56, TIE=CYCLIC, ELSET=EALL\n0, 0, 0, 0, 0, 1\n",
    ] {
        assert!(text.contains(line), "{line}");
    }
    for n in [0, 2, 28] {
        assert!(text.contains(&format!("*FREQUENCY\n20\n*SELECT CYCLIC SYMMETRY MODES, NMIN={n}, NMAX={n}\n")));
    }
    assert_eq!(text.matches("*STEP").count(), 3);
    assert!(cyclic(&[29]).unwrap_err().to_string().contains("29 is too large for 56 sectors"));
}

/// Returns the bytes of a named array after checking the length before them.
fn array(text: &str, name: &str) -> Vec<u8> {
    let start = text.find(&format!("Name=\"{name}\"")).unwrap_or_else(|| panic!("no array {name}"));
    let block = text[start..].lines().nth(1).unwrap();
    let bytes = STANDARD.decode(block).unwrap();
    let (length, data) = bytes.split_at(8);
    assert_eq!(usize::try_from(u64::from_le_bytes(length.try_into().unwrap())).unwrap(), data.len());
    data.to_vec()
}

fn reals(text: &str, name: &str) -> Vec<f64> {
    array(text, name).chunks(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect()
}

#[test]
fn vtk_file_contains_mesh_sets_and_fields() {
    let mesh = coarse();
    let heights: Vec<f64> = mesh.nodes.iter().map(|node| node[2]).collect();
    let shape: Vec<[Complex<f64>; 3]> = mesh.nodes.iter().map(|node| node.map(|x| Complex::new(x, 2.0 * x))).collect();
    let mut fields = vec![NodalField::scalars("height & \"more\"", heights.clone())];
    fields.extend(NodalField::mode("mode", &shape));
    let text = String::from_utf8(vtk::write(&mesh, &fields).unwrap()).unwrap();
    assert!(text.contains("NumberOfPoints=\"294\" NumberOfCells=\"60\""));
    assert_eq!(reals(&text, "Points"), mesh.nodes.concat());
    let whole = |name: &str| -> Vec<usize> {
        array(&text, name)
            .chunks(8)
            .map(|bytes| usize::try_from(u64::from_le_bytes(bytes.try_into().unwrap())).unwrap())
            .collect()
    };
    assert_eq!(
        whole("connectivity"),
        mesh.elements.iter().flat_map(|element| element.nodes.clone()).collect::<Vec<_>>()
    );
    assert_eq!(whole("offsets"), (1..=60).map(|cell| 15 * cell).collect::<Vec<_>>());
    assert_eq!(array(&text, "types"), [26; 60]);
    let tip: Vec<usize> = (0..294).filter(|&node| array(&text, "set_TIP")[node] == 1).collect();
    assert_eq!(tip, mesh.set("TIP").unwrap());
    assert_eq!(reals(&text, "height &amp; &quot;more&quot;"), heights);
    assert_eq!(reals(&text, "mode_imaginary"), mesh.nodes.concat().iter().map(|x| 2.0 * x).collect::<Vec<_>>());
    let amplitudes = reals(&text, "mode_amplitude");
    for (node, amplitude) in mesh.nodes.iter().zip(amplitudes) {
        assert!((node.iter().map(|x| x * x).sum::<f64>().sqrt() * 5.0_f64.sqrt() / amplitude - 1.0).abs() < 1e-14);
    }
}

#[test]
fn rejects_invalid_nodal_fields() {
    let mesh = coarse();
    let count = mesh.nodes.len();
    let short = NodalField { name: "short".into(), values: Values::Vectors(vec![[0.0; 3]; count - 1]) };
    assert!(vtk::write(&mesh, &[short]).unwrap_err().to_string().contains("`short`: 293 values for 294 nodes"));
    let twice = [NodalField::scalars("a", vec![0.0; count]), NodalField::scalars("a", vec![0.0; count])];
    assert!(vtk::write(&mesh, &twice).unwrap_err().to_string().contains("`a`: its name appears twice"));
    let set = [NodalField::scalars("set_TIP", vec![0.0; count])];
    assert!(vtk::write(&mesh, &set).is_err());
}

/// A known wave of n diameters: the field of the first sector must reproduce it on all sectors.
#[test]
fn a_mode_is_expanded_to_the_disk() {
    let (mesh, sectors) = (coarse(), 56);
    let disk = vtk::disk(&mesh, sectors);
    disk.validate().unwrap();
    assert_eq!((disk.nodes.len(), disk.elements.len()), (56 * 294, 56 * 60));
    assert_eq!(disk.set("CONTACT").unwrap().len(), 168);
    for n in [0, 1, 5, 28] {
        let wave = |[x, y, _]: [f64; 3]| {
            let (angle, radius) = (y.atan2(x), x.hypot(y));
            let factor = Complex::from_polar(radius, n as f64 * angle);
            let (sin, cos) = angle.sin_cos();
            let [radial, around, along] = [Complex::new(1.0, 0.3), Complex::new(-0.4, 0.2), Complex::new(0.1, 1.0)];
            [cos * radial - sin * around, sin * radial + cos * around, along].map(|part| part * factor)
        };
        let shape: Vec<[Complex<f64>; 3]> = mesh.nodes.iter().map(|node| wave(*node)).collect();
        let expanded = vtk::on_disk(&shape, n, sectors);
        for (node, found) in disk.nodes.iter().zip(&expanded) {
            let expected = wave(*node).map(|part| part.re);
            assert!((0..3).all(|d| (found[d] - expected[d]).abs() < 1e-13), "{n}: {found:?} {expected:?}");
        }
    }
}
