//! Meshes of the cube and of the rings with any refinement, with their node sets.

use std::collections::BTreeMap;

use super::{CENTRE, CUBE_ELEMENTS, HALF_ARC, INNER_RADIUS, RING_ELEMENTS, RingSide, SIDE, START, THICKNESS, WIDTH};
use crate::Mesh;
use crate::element::ElementKind;
use crate::mesh::Element;

/// Builds the cube of the paper, 5 × 5 × 5 bricks; see [`cube_of`].
pub fn cube_mesh() -> Mesh {
    cube_of(CUBE_ELEMENTS)
}

/// Builds the ring of the paper on one side, 5 × 8 × 40 bricks; see [`ring_of`].
pub fn ring_mesh(side: RingSide) -> Mesh {
    ring_of(side, RING_ELEMENTS)
}

/// Builds a cube of n × n × n bricks at its initial position.
///
/// The numbering follows figure 2 of the paper: the n + 1 nodes of every line along z are consecutive; first the
/// whole leading face (smallest y), from left to right; then, layer by layer, the lines of the left and of the right
/// face; then the rest. With n = 5 the corners of the left face are 1, 6, 85, 90 and those of the right one 31, 36,
/// 91, 96 (from 1).
///
/// Sets: `MASTER_LEFT`, `MASTER_RIGHT` (the faces x = ∓25 mm), with their corners `CORNERS_LEFT`, `CORNERS_RIGHT`.
pub fn cube_of(n: usize) -> Mesh {
    let line = n + 1;
    let lines = cube_lines(n);
    let mut nodes = vec![[0.0; 3]; lines.len() * line];
    let mut number = vec![0; lines.len()];
    for (place, &(a, layer)) in lines.iter().enumerate() {
        number[layer * line + a] = place * line;
        for b in 0..line {
            nodes[place * line + b] = [centred(a, n), START + SIDE * layer as f64 / n as f64, centred(b, n)];
        }
    }
    let node = |a: usize, layer: usize, b: usize| number[layer * line + a] + b;
    let mut elements = Vec::with_capacity(n * n * n);
    for layer in 0..n {
        for a in 0..n {
            for b in 0..n {
                let face = |z: usize| {
                    [(a, layer), (a + 1, layer), (a + 1, layer + 1), (a, layer + 1)].map(|(a, y)| node(a, y, z))
                };
                elements.push(Element { kind: ElementKind::Hex8, nodes: [face(b), face(b + 1)].concat() });
            }
        }
    }
    let mut sets = BTreeMap::new();
    for (name, a) in [("LEFT", 0), ("RIGHT", n)] {
        let face = (0..line).flat_map(|layer| (0..line).map(move |b| (layer, b)));
        insert(&mut sets, format!("MASTER_{name}"), face.map(|(layer, b)| node(a, layer, b)).collect());
        let corners = [(0, 0), (0, n), (n, 0), (n, n)].map(|(layer, b)| node(a, layer, b));
        insert(&mut sets, format!("CORNERS_{name}"), corners.to_vec());
    }
    Mesh { nodes, elements, sets }
}

/// Returns the lines of nodes along z in the order of their numbers, as (position along x, layer along y).
fn cube_lines(n: usize) -> Vec<(usize, usize)> {
    let leading = (0..=n).map(|a| (a, 0));
    let faces = (1..=n).flat_map(|layer| [(0, layer), (n, layer)]);
    let inside = (1..=n).flat_map(|layer| (1..n).map(move |a| (a, layer)));
    leading.chain(faces).chain(inside).collect()
}

/// Returns the coordinate of node `index` of `n` elements across the cube, exactly antisymmetric about the middle
/// (m).
fn centred(index: usize, n: usize) -> f64 {
    SIDE * (index as f64 - (n - index) as f64) / (2 * n) as f64
}

/// Builds a ring of bricks from the numbers of elements along radius, width (even) and arc (even).
///
/// Node ((i (w + 1)) + j) (r + 1) + k with i along the arc (from y < 0 to y > 0), j along z and k along the radius.
/// Sets: `SLAVE` (outer face; ascending numbers run through j first, then i) and `CLAMPED` (both ends).
pub fn ring_of(side: RingSide, [radial, wide, arc]: [usize; 3]) -> Mesh {
    let node = |i: usize, j: usize, k: usize| (i * (wide + 1) + j) * (radial + 1) + k;
    let mut nodes = Vec::with_capacity((radial + 1) * (wide + 1) * (arc + 1));
    for i in 0..=arc {
        let angle = HALF_ARC * (i as f64 - (arc - i) as f64) / arc as f64;
        for j in 0..=wide {
            let z = WIDTH * (j as f64 - (wide - j) as f64) / (2 * wide) as f64;
            nodes.extend((0..=radial).map(|k| {
                let radius = INNER_RADIUS + THICKNESS * k as f64 / radial as f64;
                [side.sign() * (CENTRE - radius * angle.cos()), radius * angle.sin(), z]
            }));
        }
    }
    let mut elements = Vec::with_capacity(radial * wide * arc);
    for i in 0..arc {
        for j in 0..wide {
            for k in 0..radial {
                let mut quad = [(i, k), (i, k + 1), (i + 1, k + 1), (i + 1, k)];
                if side == RingSide::Right {
                    quad.swap(1, 3);
                }
                let face = |j: usize| quad.map(|(i, k)| node(i, j, k));
                elements.push(Element { kind: ElementKind::Hex8, nodes: [face(j), face(j + 1)].concat() });
            }
        }
    }
    let mut sets = BTreeMap::new();
    let grid = |i: usize| (0..=wide).map(move |j| (i, j));
    insert(&mut sets, "SLAVE".into(), (0..=arc).flat_map(grid).map(|(i, j)| node(i, j, radial)).collect());
    let ends = [0, arc].into_iter().flat_map(grid);
    insert(&mut sets, "CLAMPED".into(), ends.flat_map(|(i, j)| (0..=radial).map(move |k| node(i, j, k))).collect());
    Mesh { nodes, elements, sets }
}

fn insert(sets: &mut BTreeMap<String, Vec<usize>>, name: String, mut nodes: Vec<usize>) {
    nodes.sort_unstable();
    sets.insert(name, nodes);
}
