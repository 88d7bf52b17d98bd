//! Pairing of the two faces of a sector by a rotation of one pitch.

use core::f64::consts::TAU;

use tiprub_core::scene::rom::MAX_SECTORS;

use super::CyclicBoundary;
use crate::{Error, Result};

/// Quality of the pairing of the two faces.
#[derive(Debug, Clone, PartialEq)]
pub struct PairingReport {
    /// Largest distance of a high node from its rotated low node (m).
    pub largest_mismatch: f64,
    /// Median of those distances (m).
    pub typical_mismatch: f64,
    /// Index of the low node with the largest distance.
    pub worst_node: usize,
    /// True if the sets were exchanged: the set given as low is the face at the greater angle.
    pub swapped: bool,
}

impl CyclicBoundary {
    /// Pairs the nodes of two faces: every high node is a low one rotated by +2π/`sectors` about z, to within
    /// `tolerance` (m). Faces in reverse order are exchanged, and the report states it.
    ///
    /// # Errors
    /// [`Error::Invalid`] for fewer than two sectors, empty or unequal faces, and nodes that are in both, on the axis
    /// or without a partner.
    pub fn pair(
        nodes: &[[f64; 3]],
        low: &[usize],
        high: &[usize],
        sectors: usize,
        tolerance: f64,
    ) -> Result<(Self, PairingReport)> {
        check_faces(nodes, low, high, sectors, tolerance)?;
        let forward = Match::of(nodes, low, high, sectors);
        // With two sectors, forward and backward rotation coincide, so that the faces cannot be distinguished.
        let (chosen, swapped) = if forward.worst.distance <= tolerance || sectors == 2 {
            (forward, false)
        } else {
            let backward = Match::of(nodes, high, low, sectors);
            if backward.worst.distance < forward.worst.distance { (backward, true) } else { (forward, false) }
        };
        let worst = chosen.worst;
        if worst.distance > tolerance {
            let problem = format!(
                "node {} rotated by 2π/{sectors} is {:.3e} m from the nearest node of the other face (node {}), more \
                 than the tolerance of {tolerance:.3e} m",
                worst.low + 1,
                worst.distance,
                worst.high + 1
            );
            let remedy = "Use identical meshes on both faces (copy one to the other), check the number of sectors and \
                          that the axis is z, or increase the tolerance to the accuracy of the coordinates";
            return Err(Error::invalid("cyclic faces", problem, remedy));
        }
        check_one_to_one(&chosen.pairs)?;
        check_spacing(nodes, if swapped { high } else { low }, worst)?;
        let mut distances = chosen.distances;
        distances.sort_by(f64::total_cmp);
        let report = PairingReport {
            largest_mismatch: worst.distance,
            typical_mismatch: distances[distances.len() / 2],
            worst_node: worst.low,
            swapped,
        };
        Ok((Self { pairs: chosen.pairs, sectors }, report))
    }

    /// Checks that the pairs are valid for a model of `count` nodes; [`Self::pair`] always returns valid ones.
    ///
    /// # Errors
    /// [`Error::Invalid`] for fewer than two sectors, and for nodes that do not exist or appear twice.
    pub(crate) fn validate(&self, count: usize) -> Result<()> {
        check_sectors(self.sectors)?;
        check_indices(count, self.pairs.iter().flatten())
    }

    /// Returns the angle from one sector to the next (rad).
    #[expect(clippy::cast_precision_loss, reason = "sectors are far fewer than 2^52")]
    pub fn pitch(&self) -> f64 {
        TAU / self.sectors as f64
    }

    /// Returns the largest nodal diameter ⌊N/2⌋.
    pub(crate) fn largest_nodal_diameter(&self) -> usize {
        self.sectors / 2
    }
}

/// Rotates a point by `angle` about z.
pub(super) fn turned([x, y, z]: [f64; 3], angle: f64) -> [f64; 3] {
    let (sin, cos) = angle.sin_cos();
    [cos * x - sin * y, sin * x + cos * y, z]
}

#[derive(Debug, Clone, Copy)]
struct Worst {
    low: usize,
    high: usize,
    distance: f64,
}

struct Match {
    pairs: Vec<[usize; 2]>,
    distances: Vec<f64>,
    worst: Worst,
}

impl Match {
    /// Finds the nearest high node of every low node rotated by one pitch.
    fn of(nodes: &[[f64; 3]], low: &[usize], high: &[usize], sectors: usize) -> Self {
        let pitch = CyclicBoundary { pairs: Vec::new(), sectors }.pitch();
        let mut by_height: Vec<usize> = high.to_vec();
        by_height.sort_by(|&a, &b| nodes[a][2].total_cmp(&nodes[b][2]));
        let mut result = Self {
            pairs: Vec::with_capacity(low.len()),
            distances: Vec::with_capacity(low.len()),
            worst: Worst { low: low[0], high: high[0], distance: -1.0 },
        };
        for &node in low {
            let (partner, distance) = nearest(nodes, &by_height, turned(nodes[node], pitch));
            result.pairs.push([node, partner]);
            result.distances.push(distance);
            if distance > result.worst.distance {
                result.worst = Worst { low: node, high: partner, distance };
            }
        }
        result
    }
}

/// Returns the nearest of the nodes `by_height` (ascending in z) and its distance. The search starts at the height of
/// the point and ends when the difference in height alone exceeds the smallest distance.
fn nearest(nodes: &[[f64; 3]], by_height: &[usize], point: [f64; 3]) -> (usize, f64) {
    let middle = by_height.partition_point(|&node| nodes[node][2] < point[2]);
    let mut best = (by_height[middle.min(by_height.len() - 1)], f64::INFINITY);
    let mut look = |node: usize| {
        let apart: [f64; 3] = core::array::from_fn(|i| nodes[node][i] - point[i]);
        let distance = (apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2]).sqrt();
        if distance < best.1 {
            best = (node, distance);
        }
        apart[2].abs() <= best.1
    };
    for &node in &by_height[middle..] {
        if !look(node) {
            break;
        }
    }
    for &node in by_height[..middle].iter().rev() {
        if !look(node) {
            break;
        }
    }
    best
}

fn refuse(problem: String, remedy: &str) -> Result<()> {
    Err(Error::invalid("cyclic faces", problem, remedy))
}

fn check_sectors(sectors: usize) -> Result<()> {
    if (2..=MAX_SECTORS).contains(&sectors) {
        return Ok(());
    }
    let problem = format!("{sectors} sectors are not between 2 and {MAX_SECTORS}");
    refuse(problem, "Give the number of sectors of the whole disk")
}

fn check_indices<'a>(count: usize, face_nodes: impl Iterator<Item = &'a usize>) -> Result<()> {
    let mut seen = vec![false; count];
    for &node in face_nodes {
        let Some(flag) = seen.get_mut(node) else {
            let problem = format!("node {} does not exist; the mesh has {count} nodes", node + 1);
            return refuse(problem, "Choose nodes of the mesh");
        };
        if core::mem::replace(flag, true) {
            return refuse(format!("node {} appears twice", node + 1), "List every node once, on one of the faces");
        }
    }
    Ok(())
}

fn check_faces(nodes: &[[f64; 3]], low: &[usize], high: &[usize], sectors: usize, tolerance: f64) -> Result<()> {
    check_sectors(sectors)?;
    if !(tolerance.is_finite() && tolerance >= 0.0) {
        let problem = format!("the tolerance of {tolerance} m is invalid");
        return refuse(problem, "Give a finite distance, for example 1e-6 of the radius");
    }
    if low.is_empty() || low.len() != high.len() {
        let problem = format!("{} nodes on one face and {} on the other", low.len(), high.len());
        return refuse(problem, "Use identical meshes on both faces and give all nodes of each, including the edges");
    }
    check_indices(nodes.len(), low.iter().chain(high))?;
    for &node in low.iter().chain(high) {
        let [x, y, z] = nodes[node];
        if !(x.is_finite() && y.is_finite() && z.is_finite()) {
            return refuse(format!("coordinates of node {} are not finite", node + 1), "Correct the mesh");
        }
        let radius = x.hypot(y);
        if radius <= 1e-9 * radius.hypot(z).max(tolerance) {
            let problem = format!("node {} lies on the z axis, where it belongs to every sector", node + 1);
            return refuse(problem, "Add a bore, even a very small one");
        }
    }
    Ok(())
}

/// Fraction of the distance of neighbouring nodes of a face above which a mismatch cannot be an inaccuracy of
/// coordinates.
const MISPLACED: f64 = 0.25;

/// Checks that a user-defined tolerance is not so wide that it pairs the wrong nodes.
fn check_spacing(nodes: &[[f64; 3]], low: &[usize], worst: Worst) -> Result<()> {
    let apart = |node: usize| {
        let [x, y, z]: [f64; 3] = core::array::from_fn(|i| nodes[node][i] - nodes[worst.low][i]);
        x.hypot(y).hypot(z)
    };
    let others = low.iter().copied().filter(|&node| node != worst.low);
    let spacing = others.map(apart).fold(f64::INFINITY, f64::min);
    if worst.distance <= MISPLACED * spacing {
        return Ok(());
    }
    let problem = format!(
        "node {} rotated by one pitch misses node {} by {:.3e} m, while neighbouring nodes are {spacing:.3e} m apart",
        worst.low + 1,
        worst.high + 1,
        worst.distance
    );
    refuse(
        problem,
        "Check the number of sectors and the axis, and use identical meshes on both faces: a larger tolerance \
         does not help",
    )
}

fn check_one_to_one(pairs: &[[usize; 2]]) -> Result<()> {
    let mut by_high: Vec<[usize; 2]> = pairs.iter().map(|&[low, high]| [high, low]).collect();
    by_high.sort_unstable();
    for two in by_high.windows(2) {
        if two[0][0] == two[1][0] {
            let problem =
                format!("nodes {} and {} are both matched with node {}", two[0][1] + 1, two[1][1] + 1, two[0][0] + 1);
            let remedy =
                "Reduce the tolerance below the distance between neighbouring nodes, or merge coincident nodes";
            return Err(Error::invalid("cyclic faces", problem, remedy));
        }
    }
    Ok(())
}
