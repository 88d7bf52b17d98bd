//! Meshes for the tests.
#![allow(dead_code)] // Every test binary uses its own part of these helpers.

pub mod casing;
pub mod disk;
pub mod tetrahedra;

use nalgebra::DMatrix;
use tiprub_model::Material;
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::{Element, Mesh};
use tiprub_model::sparse::SparseMatrix;

/// Returns the division of a brick with eight corners into elements of a linear kind.
pub fn division(kind: ElementKind) -> Vec<Vec<usize>> {
    match kind {
        ElementKind::Hex8 | ElementKind::Hex20 => vec![(0..8).collect()],
        ElementKind::Penta6 | ElementKind::Penta15 => vec![vec![0, 1, 2, 4, 5, 6], vec![0, 2, 3, 4, 6, 7]],
        // Six tetrahedra around the diagonal 0-6: the same division in every brick, so faces match.
        ElementKind::Tet4 | ElementKind::Tet10 => {
            let rim = [1, 2, 3, 7, 4, 5];
            (0..6).map(|i| vec![0, rim[i], rim[(i + 1) % 6], 6]).collect()
        }
    }
}

pub fn linear(kind: ElementKind) -> ElementKind {
    match kind {
        ElementKind::Hex8 | ElementKind::Hex20 => ElementKind::Hex8,
        ElementKind::Penta6 | ElementKind::Penta15 => ElementKind::Penta6,
        ElementKind::Tet4 | ElementKind::Tet10 => ElementKind::Tet4,
    }
}

/// Returns a box of `counts` bricks, each divided into elements of `kind`, with straight edges; `shift` moves inner
/// nodes, as a fraction of the edges of a brick.
pub fn distorted_box(
    kind: ElementKind,
    counts: [usize; 3],
    size: [f64; 3],
    shift: impl Fn([usize; 3]) -> [f64; 3],
) -> Mesh {
    let [nx, ny, nz] = counts;
    let number = |i: usize, j: usize, k: usize| i + (nx + 1) * (j + (ny + 1) * k);
    let mut mesh = Mesh::default();
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                let place = [i, j, k];
                let inner = (0..3).all(|d| place[d] > 0 && place[d] < counts[d]);
                let shift = if inner { shift(place) } else { [0.0; 3] };
                mesh.nodes.push(core::array::from_fn(|d| size[d] * (place[d] as f64 + shift[d]) / counts[d] as f64));
            }
        }
    }
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let corner = [(0, 0), (1, 0), (1, 1), (0, 1)];
                let brick: Vec<usize> =
                    (0..8).map(|c| number(i + corner[c % 4].0, j + corner[c % 4].1, k + c / 4)).collect();
                for part in division(kind) {
                    let nodes = part.iter().map(|&c| brick[c]).collect();
                    mesh.elements.push(Element { kind: linear(kind), nodes });
                }
            }
        }
    }
    if kind == linear(kind) { mesh } else { mesh.quadratic() }
}

/// Returns a box without distortion.
pub fn straight_box(kind: ElementKind, counts: [usize; 3], size: [f64; 3]) -> Mesh {
    distorted_box(kind, counts, size, |_| [0.0; 3])
}

/// Returns irregular but fixed numbers in ±`amplitude`.
pub fn wobble(amplitude: f64) -> impl Fn([usize; 3]) -> [f64; 3] {
    move |[i, j, k]| {
        let phase = (i + 3 * j + 7 * k) as f64;
        [0.9, 2.3, 4.1].map(|factor| amplitude * (factor * phase + factor).sin())
    }
}

/// Returns the nodes at which the given coordinate has the given value.
pub fn nodes_at(mesh: &Mesh, direction: usize, value: f64) -> Vec<usize> {
    (0..mesh.nodes.len()).filter(|&node| (mesh.nodes[node][direction] - value).abs() < 1e-9).collect()
}

/// Returns steel without thermal expansion.
pub fn steel() -> Material {
    Material { density: 7800.0, expansion: 0.0, ..Material::steel() }
}

/// Returns the material of the blades in tests of spin.
pub fn blade_steel(poisson_ratio: f64) -> Material {
    Material { young_modulus: 200e9, poisson_ratio, ..Material::maraging_steel() }
}

/// Returns the nodes of one element in physical space: the natural ones, scaled and bent by a smooth map without
/// symmetry.
pub fn distorted_nodes(kind: ElementKind) -> Vec<[f64; 3]> {
    let map = |[x, y, z]: [f64; 3]| {
        [
            0.03 * x + 0.004 * y + 0.002 * z + 0.002 * y * z,
            0.003 * x + 0.02 * y - 0.003 * z + 0.001 * x * z,
            -0.002 * x + 0.002 * y + 0.025 * z + 0.0015 * x * y,
        ]
    };
    kind.natural_nodes().iter().map(|&node| map(node)).collect()
}

/// Returns the whole matrix as a dense one.
pub fn dense(matrix: &SparseMatrix) -> DMatrix<f64> {
    let all: Vec<usize> = (0..matrix.order()).collect();
    let block = matrix.block(&all, &all);
    DMatrix::from_fn(all.len(), all.len(), |i, j| block[(i, j)])
}
