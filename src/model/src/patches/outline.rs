//! Outline of a tip: its two sides at every place along the chord.

use std::collections::HashMap;

use super::ElementFaces;
use crate::mesh::Mesh;
use crate::places::Places;

/// Number of straight parts that approximate a curved edge.
const PARTS: usize = 8;

/// Approximates the parabola through the ends and the mid-side node of an edge by straight parts.
fn curved([first, last]: [[f64; 2]; 2], middle: [f64; 2]) -> Vec<[[f64; 2]; 2]> {
    let at = |part: usize| -> [f64; 2] {
        let s = part as f64 / PARTS as f64;
        let [a, m, b] = [(1.0 - s) * (1.0 - 2.0 * s), 4.0 * s * (1.0 - s), s * (2.0 * s - 1.0)];
        std::array::from_fn(|i| a * first[i] + m * middle[i] + b * last[i])
    };
    (0..PARTS).map(|part| [at(part), at(part + 1)]).collect()
}

/// Edges that belong to a single face of the tip: positions of both ends along the chord and across it (m).
pub(super) struct Outline(Vec<[[f64; 2]; 2]>);

impl Outline {
    pub(super) fn new(mesh: &Mesh, faces: &ElementFaces<'_>, places: &Places) -> Self {
        let mut count: HashMap<[usize; 2], (usize, Option<usize>)> = HashMap::new();
        for (element, corners) in faces {
            for (index, &corner) in corners.iter().enumerate() {
                let next = corners[(index + 1) % corners.len()];
                let (a, b) = (element.nodes[corner], element.nodes[next]);
                let edge = element.kind.edges().iter().position(|ends| ends.contains(&corner) && ends.contains(&next));
                let middle = edge.and_then(|edge| element.nodes.get(element.kind.corner_count() + edge)).copied();
                count.entry([a.min(b), a.max(b)]).or_insert((0, middle)).0 += 1;
            }
        }
        let once = count.into_iter().filter(|(_, (faces, _))| *faces == 1);
        let mut edges: Vec<([usize; 2], Option<usize>)> = once.map(|(ends, (_, middle))| (ends, middle)).collect();
        // Sums must not depend on the order of a hash table.
        edges.sort_unstable();
        let place = |node: usize| places.developed(mesh.nodes[node]);
        let chords = |(ends, middle): ([usize; 2], Option<usize>)| match middle {
            Some(middle) => curved(ends.map(place), place(middle)),
            None => vec![ends.map(place)],
        };
        Self(edges.into_iter().flat_map(chords).collect())
    }

    /// Returns the position of a point across the tip, 0 to 1 between its sides.
    pub(super) fn share_across(&self, [along, across]: [f64; 2]) -> f64 {
        let [low, high] = self.sides(along);
        if high > low { ((across - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 }
    }

    /// Returns the outermost crossings of the outline with a line across the chord.
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
