//! Coarse bladed disks: one sector of an annulus with a blade on its rim, sheared so that it has no symmetry.

use core::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};
use tiprub_core::Rom;
use tiprub_model::cyclic::{CyclicBoundary, CyclicOptions, ModeSelection};
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::{Element, Mesh};
use tiprub_model::progress::silent;
use tiprub_model::reduce::{ContactPoint, ReductionKind};
use tiprub_model::{FeModel, Material};

use super::{division, linear};

/// Numbers of cells of the annulus in radius, around and along the axis; the blade is one cell thick and `blade`
/// cells high.
#[derive(Debug, Clone, Copy)]
pub struct CellCounts {
    pub hub: usize,
    pub around: usize,
    pub along: usize,
    pub blade: usize,
}

pub const COARSE: CellCounts = CellCounts { hub: 2, around: 3, along: 2, blade: 2 };

/// Returns a sector with its two faces as node sets LOW and HIGH, the bore as BORE and the tip of the blade as TIP.
pub fn sector(kind: ElementKind, sectors: usize, counts: CellCounts) -> Mesh {
    let pitch = TAU / sectors as f64;
    let blade_cell = counts.around / 2;
    let mut number = std::collections::BTreeMap::new();
    let mut mesh = Mesh::default();
    let mut node = |mesh: &mut Mesh, [i, j, k]: [usize; 3]| {
        *number.entry([i, j, k]).or_insert_with(|| {
            let radius = if i <= counts.hub {
                0.10 + 0.06 * i as f64 / counts.hub as f64
            } else {
                0.16 + 0.09 * (i - counts.hub) as f64 / counts.blade as f64
            };
            let z = 0.05 * k as f64 / counts.along as f64;
            // Sheared along the axis and, unevenly, in radius: the faces are neither plane nor radial.
            let angle = pitch * (j as f64 / counts.around as f64 + 4.0 * z + 9.0 * (radius - 0.1) * (radius - 0.1));
            mesh.nodes.push([radius * angle.cos(), radius * angle.sin(), z]);
            mesh.nodes.len() - 1
        })
    };
    for i in 0..counts.hub + counts.blade {
        for j in 0..counts.around {
            if i >= counts.hub && j != blade_cell {
                continue;
            }
            for k in 0..counts.along {
                let corner = [(0, 0), (1, 0), (1, 1), (0, 1)];
                let brick: Vec<usize> =
                    (0..8).map(|c| node(&mut mesh, [i + corner[c % 4].0, j + corner[c % 4].1, k + c / 4])).collect();
                for part in division(kind) {
                    let nodes = part.iter().map(|&c| brick[c]).collect();
                    mesh.elements.push(Element { kind: linear(kind), nodes });
                }
            }
        }
    }
    let at = |keep: &dyn Fn([usize; 3]) -> bool| {
        let mut set: Vec<usize> = number.iter().filter(|(place, _)| keep(**place)).map(|(_, &node)| node).collect();
        set.sort_unstable();
        set
    };
    let sets = [
        ("LOW", at(&|[i, j, _]| j == 0 && i <= counts.hub)),
        ("HIGH", at(&|[i, j, _]| j == counts.around && i <= counts.hub)),
        ("BORE", at(&|[i, _, _]| i == 0)),
        ("TIP", at(&|[i, _, _]| i == counts.hub + counts.blade)),
    ];
    mesh.sets.extend(sets.map(|(name, nodes)| (name.to_owned(), nodes)));
    if kind == linear(kind) { mesh } else { with_middles(mesh.quadratic(), &mesh) }
}

/// Adds the mid-edge nodes between the nodes of each set of the linear mesh.
fn with_middles(mut quadratic: Mesh, mesh: &Mesh) -> Mesh {
    for (element, old) in quadratic.elements.iter().zip(&mesh.elements) {
        for (&[a, b], &middle) in old.kind.edges().iter().zip(&element.nodes[old.nodes.len()..]) {
            for set in quadratic.sets.values_mut() {
                if set.contains(&old.nodes[a]) && set.contains(&old.nodes[b]) && !set.contains(&middle) {
                    set.push(middle);
                }
            }
        }
    }
    quadratic.sets.values_mut().for_each(|set| set.sort_unstable());
    quadratic
}

pub fn boundary(mesh: &Mesh, sectors: usize) -> CyclicBoundary {
    CyclicBoundary::pair(&mesh.nodes, mesh.set("LOW").unwrap(), mesh.set("HIGH").unwrap(), sectors, 1e-9).unwrap().0
}

/// Returns some of the tip nodes.
pub fn tips(mesh: &Mesh, count: usize) -> Vec<ContactPoint> {
    let tip = mesh.set("TIP").unwrap();
    let node = |i: usize| tip[i * (tip.len() - 1) / (count - 1).max(1)];
    let point = |i: usize| ContactPoint::at(format!("tip_{i}"), node(i), 0.0);
    (0..count).map(point).collect()
}

pub fn model(mesh: Mesh) -> FeModel {
    FeModel::assembled(mesh, &Material::steel(), "test sector".into(), &silent).unwrap()
}

/// Returns (M_n, K_n, C_n) of every nodal diameter.
pub fn pencils(rom: &Rom) -> Vec<[DMatrix<Complex<f64>>; 3]> {
    let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    let mut list = vec![[complex(&rom.mass), complex(&rom.stiffness), complex(&rom.contact_map)]];
    list.extend(rom.extras.harmonics.iter().map(|h| [h.mass.clone(), h.stiffness.clone(), h.contact_map.clone()]));
    list
}

/// Returns the multiplicity of a mode of nodal diameter n in the disk.
pub fn copies(nodal_diameter: usize, sectors: usize) -> usize {
    if nodal_diameter == 0 || 2 * nodal_diameter == sectors { 1 } else { 2 }
}

/// Returns the options of a Craig-Bampton reduction.
pub fn options(modes: ModeSelection, checked_modes: usize) -> CyclicOptions {
    CyclicOptions {
        name: "disk".into(),
        kind: ReductionKind::FixedInterface,
        modes,
        checked_modes,
        damping_ratio: 0.005,
    }
}
