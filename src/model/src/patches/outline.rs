//! The outline of a tip: its two sides at every place along the chord.

use std::collections::HashMap;

use super::Faces;
use crate::mesh::Mesh;
use crate::places::Places;

/// Edges that belong to a single face of the tip: places along the chord and across it of both ends (m).
pub(super) struct Outline(Vec<[[f64; 2]; 2]>);

impl Outline {
    pub(super) fn new(mesh: &Mesh, faces: &Faces<'_>, places: &Places) -> Self {
        let mut count: HashMap<[usize; 2], usize> = HashMap::new();
        for (element, corners) in faces {
            for (index, &corner) in corners.iter().enumerate() {
                let (a, b) = (element.nodes[corner], element.nodes[corners[(index + 1) % corners.len()]]);
                *count.entry([a.min(b), a.max(b)]).or_default() += 1;
            }
        }
        let mut edges: Vec<[usize; 2]> =
            count.into_iter().filter(|(_, faces)| *faces == 1).map(|(edge, _)| edge).collect();
        // Sums must not depend on the order of a hash table.
        edges.sort_unstable();
        Self(edges.into_iter().map(|ends| ends.map(|node| places.developed(mesh.nodes[node]))).collect())
    }

    /// How far across a point stands, 0 to 1 between the sides there.
    pub(super) fn share_across(&self, [along, across]: [f64; 2]) -> f64 {
        let [low, high] = self.sides(along);
        if high > low { ((across - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 }
    }

    /// Outermost crossings of the outline with a line across the chord.
    fn sides(&self, along: f64) -> [f64; 2] {
        let mut found = [f64::INFINITY, f64::NEG_INFINITY];
        for [[a, low], [b, high]] in &self.0 {
            if (along - a) * (along - b) > 0.0 {
                continue;
            }
            let share = if (b - a).abs() < f64::MIN_POSITIVE { 0.5 } else { (along - a) / (b - a) };
            let across = low + share * (high - low);
            found = [found[0].min(across), found[1].max(across)];
        }
        found
    }
}
