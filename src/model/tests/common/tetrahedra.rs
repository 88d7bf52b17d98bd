//! Rings of quadratic tetrahedra with irregular nodes, none of them at a regular angle.

use std::f64::consts::TAU;

use tiprub_model::casing::{CasingOptions, ContactRings, InnerContour, RingCounts, RingGeometry, RingSupport};
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::{Element, Mesh};

use super::{division, wobble};

/// Cylinder without flanges.
#[derive(Debug, Clone, Copy)]
pub struct TetrahedralRing {
    pub radius: f64,
    pub thickness: f64,
    pub axial: [f64; 2],
}

/// Angle of the first corner about the axis (rad): no node is at a regular angle.
const TURN: f64 = 0.0837;
/// Displacement of the corners as a fraction of the edges.
const JITTER: f64 = 0.18;

impl TetrahedralRing {
    /// Returns tetrahedra, six for each brick; corners of bricks move along the surfaces and inside. Mid-edge nodes
    /// lie on the curved surfaces. Sets: `inner`, `low` (the end face), `all`.
    pub fn tetrahedra(&self, counts: [usize; 3]) -> Mesh {
        self.tetrahedra_with(counts, true)
    }

    /// Returns tetrahedra; if the ring is not `closed`, its two ends coincide but share no node.
    pub fn tetrahedra_with(&self, [around, through, along]: [usize; 3], closed: bool) -> Mesh {
        let (columns, [low, high]) = (if closed { around } else { around + 1 }, self.axial);
        let number = |j: usize, i: usize, k: usize| j + (through + 1) * (i % columns + columns * k);
        let mut mesh = Mesh::default();
        for k in 0..=along {
            for i in 0..columns {
                for j in 0..=through {
                    let [shift_r, shift_around, shift_z] = wobble(JITTER)([i % around, j, k]);
                    let inside = |place: usize, count: usize, shift: f64| {
                        (place as f64 + if place > 0 && place < count { shift } else { 0.0 }) / count as f64
                    };
                    let radius = self.radius + self.thickness * inside(j, through, shift_r);
                    let (sin, cos) = (TURN + TAU * (i as f64 + shift_around) / around as f64).sin_cos();
                    mesh.nodes.push([radius * cos, radius * sin, low + (high - low) * inside(k, along, shift_z)]);
                }
            }
        }
        let corner = [(0, 0), (1, 0), (1, 1), (0, 1)];
        for k in 0..along {
            for i in 0..around {
                for j in 0..through {
                    let brick: Vec<usize> =
                        (0..8).map(|c| number(j + corner[c % 4].0, i + corner[c % 4].1, k + c / 4)).collect();
                    for part in division(ElementKind::Tet10) {
                        let nodes = part.iter().map(|&c| brick[c]).collect();
                        mesh.elements.push(Element { kind: ElementKind::Tet4, nodes });
                    }
                }
            }
        }
        let mut mesh = mesh.quadratic();
        for element in &mesh.elements {
            for (&middle, ends) in element.nodes[4..].iter().zip(element.kind.edges()) {
                let radius = 0.5
                    * ends.iter().map(|&end| mesh.nodes[element.nodes[end]]).map(|[x, y, _]| x.hypot(y)).sum::<f64>();
                let [x, y, z] = mesh.nodes[middle];
                let scale = radius / x.hypot(y);
                mesh.nodes[middle] = [scale * x, scale * y, z];
            }
        }
        let set = |inside: &dyn Fn([f64; 3]) -> bool| -> Vec<usize> {
            (0..mesh.nodes.len()).filter(|&node| inside(mesh.nodes[node])).collect()
        };
        let inner = set(&|[x, y, _]| (x.hypot(y) - self.radius).abs() < 1e-9);
        let end = set(&|[_, _, z]| (z - low).abs() < 1e-9);
        let all = set(&|_| true);
        mesh.sets = [("inner".into(), inner), ("low".into(), end), ("all".into(), all)].into();
        mesh
    }

    /// Returns the same ring of quadratic bricks with nodes at regular angles.
    pub fn bricks(
        &self,
        [around, through, along]: [usize; 3],
        rings: ContactRings,
        support: RingSupport,
    ) -> CasingOptions {
        let contour = InnerContour::new(&self.axial.map(|z| [z, self.radius])).unwrap();
        CasingOptions {
            name: "bricks".into(),
            geometry: RingGeometry { contour, thickness: self.thickness, flanges: [None, None] },
            counts: RingCounts { around, through, along, flange: 1 },
            rings,
            support,
            ..CasingOptions::default()
        }
    }
}
