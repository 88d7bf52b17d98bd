//! Mesh of the whole disk from the mesh of one sector.

use super::{CyclicBoundary, boundary::turned};
use crate::Result;
use crate::mesh::{Element, Mesh};

/// Whole disk.
#[derive(Debug, Clone)]
pub struct WholeDisk {
    /// Mesh of the disk; its sets contain the nodes of all sectors.
    pub mesh: Mesh,
    /// Node of the disk for every sector and node of the sector.
    pub nodes: Vec<Vec<usize>>,
}

/// Merges rotated copies of a sector at their faces: the high face of one is the low face of the next.
///
/// # Errors
/// The errors of [`Mesh::validate`].
pub fn whole_disk(sector: &Mesh, boundary: &CyclicBoundary) -> Result<WholeDisk> {
    let count = sector.nodes.len();
    let mut low_of = vec![usize::MAX; count];
    for &[low, high] in &boundary.pairs {
        low_of[high] = low;
    }
    let mut place = vec![usize::MAX; count];
    let own: Vec<usize> = (0..count).filter(|&node| low_of[node] == usize::MAX).collect();
    for (index, &node) in own.iter().enumerate() {
        place[node] = index;
    }
    let mut mesh = Mesh::default();
    let mut nodes = Vec::with_capacity(boundary.sectors);
    for s in 0..boundary.sectors {
        #[expect(clippy::cast_precision_loss, reason = "sectors are far fewer than 2^52")]
        let angle = boundary.pitch() * s as f64;
        mesh.nodes.extend(own.iter().map(|&node| turned(sector.nodes[node], angle)));
        let next = (s + 1) % boundary.sectors;
        let number = |node: usize| match low_of[node] {
            usize::MAX => s * own.len() + place[node],
            low => next * own.len() + place[low],
        };
        nodes.push((0..count).map(number).collect::<Vec<_>>());
    }
    for numbers in &nodes {
        for element in &sector.elements {
            let nodes = element.nodes.iter().map(|&node| numbers[node]).collect();
            mesh.elements.push(Element { kind: element.kind, nodes });
        }
    }
    for (name, set) in &sector.sets {
        let mut all: Vec<usize> = nodes.iter().flat_map(|numbers| set.iter().map(|&node| numbers[node])).collect();
        all.sort_unstable();
        all.dedup();
        mesh.sets.insert(name.clone(), all);
    }
    mesh.validate()?;
    Ok(WholeDisk { mesh, nodes })
}
