//! Tip of a blade in front of a coating: positions of its contact nodes, and widths around the circumference.

use std::f64::consts::TAU;

use crate::math::argsort;
use crate::scene::rom::ContactNode;
use crate::scene::settings::CoatingSettings;

/// A single node represents an axial strip whose length is this fraction of its radius.
const STRIP: f64 = 0.1;
/// Contact nodes within this fraction of their radius along the axis have no axial extent.
const FLAT: f64 = 1e-6;

/// The tip of one blade: its contact nodes, in any order.
#[derive(Debug, Clone, PartialEq)]
pub struct BladeTip {
    /// Axial positions z (m).
    pub(super) axial: Vec<f64>,
    /// Radii (m).
    pub(super) radii: Vec<f64>,
    /// Widths around the circumference over which the nodes press the coating (m); unused if it is cut.
    pub(super) widths: Vec<f64>,
    /// Axial positions of the first and the last edge of the cells (m). Rows beyond the outermost nodes, and all rows of a single node, use
    /// the penetration of the nearest node.
    pub(super) extent: [f64; 2],
}

impl BladeTip {
    /// Creates a tip with nodes at axial positions and radii (m), all with the width `width` (m), and cells from the first to the last
    /// node.
    pub fn new(axial: &[f64], radii: &[f64], width: f64) -> Self {
        let low = axial.iter().copied().fold(f64::INFINITY, f64::min);
        let high = axial.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Self { axial: axial.to_vec(), radii: radii.to_vec(), widths: vec![width; axial.len()], extent: [low, high] }
    }

    /// Changes the extent of the cells (m).
    #[must_use]
    pub(crate) fn with_extent(self, extent: [f64; 2]) -> Self {
        Self { extent, ..self }
    }

    /// Creates the tip of contact nodes or patches of a ROM, with widths from the scene or from their areas and lengths.
    pub fn of(nodes: &[&ContactNode], settings: &CoatingSettings) -> Self {
        let [radii, _, axial] = [0, 1, 2].map(|i| nodes.iter().map(|node| node.position[i]).collect::<Vec<f64>>());
        let tip = Self::new(&axial, &radii, settings.contact_width.unwrap_or(0.0));
        let [low, high] = tip.extent;
        let tip = if high - low > FLAT * radii[0] {
            tip
        } else {
            let half = 0.5 * STRIP * radii[0];
            tip.with_extent([low - half, high + half])
        };
        match (settings.contact_width, settings.cutting) {
            (None, None) => Self { widths: widths_of_patches(nodes, tip.extent), ..tip },
            _ => tip,
        }
    }
}

/// Widths of patches around the circumference (m): area per length along the axis, which is the length along the chord times the cosine of
/// the angle between chord and axis at the patch. A single patch does not determine this angle: its area is distributed over the whole
/// extent (m).
fn widths_of_patches(nodes: &[&ContactNode], extent: [f64; 2]) -> Vec<f64> {
    let [low, high] = extent;
    if let [only] = nodes {
        return vec![only.area / (high - low)];
    }
    let axial: Vec<f64> = nodes.iter().map(|node| node.position[2]).collect();
    let order = argsort(&axial);
    let mut widths = vec![0.0; nodes.len()];
    for (place, node) in order.iter().enumerate() {
        let [before, after] = [place.saturating_sub(1), (place + 1).min(nodes.len() - 1)].map(|at| nodes[order[at]]);
        let [radial, turned, along] = [0, 1, 2].map(|i| after.position[i] - before.position[i]);
        let around = nodes[*node].position[0] * (turned - TAU * (turned / TAU).round());
        let cosine = along / (radial * radial + around * around + along * along).sqrt();
        widths[*node] = nodes[*node].area / (nodes[*node].length * cosine);
    }
    widths
}
