//! Contact grids, through which surfaces are laid, and rows of contact patches.

use super::{ContactGrid, ContactNode, DisplacementFrame, Rom};
use crate::Result;
use crate::math::real;

/// Nodes closer than this fraction of the longest edge of an open grid are the same node.
const SAME_NODE: f64 = 1e-9;

impl Rom {
    /// Number of rows of contact patches across the thickness; 1 if it is not given.
    pub fn rows(&self) -> usize {
        self.extras.rows.unwrap_or(1)
    }

    pub(super) fn validate_rows(&self) -> Result<()> {
        let Some(rows) = self.extras.rows else { return Ok(()) };
        let nodes = self.contact_nodes.len();
        let patches = self.contact_nodes.iter().all(|node| node.area > 0.0);
        if rows >= 2 && nodes.is_multiple_of(rows) && patches && self.extras.grid.is_none() {
            return Ok(());
        }
        let what = if patches { "patches" } else { "contact nodes without areas" };
        let problem =
            format!("{nodes} {what} in {rows} rows; at least two rows with the same number of patches are required");
        super::refuse("ROM metadata `contact_rows`", problem)
    }

    /// Checks that the contact nodes form the grid that the ROM describes.
    pub(super) fn validate_grid(&self) -> Result<()> {
        let Some(grid) = self.extras.grid else { return Ok(()) };
        let (nodes, [least_around, least_along]) =
            (self.contact_nodes.len(), if grid.closed { [4, 2] } else { [2, 2] });
        let fits = grid.around.checked_mul(grid.along) == Some(nodes);
        if !fits || grid.around < least_around || grid.along < least_along {
            let ContactGrid { around, along, .. } = grid;
            return refuse(format!(
                "{around} around x {along} along does not match {nodes} nodes, or is less than \
                 {least_around} x {least_along}"
            ));
        }
        if self.sectors != 1 {
            return refuse("a contact grid needs a ROM with one sector".to_owned());
        }
        match (grid.closed, self.frame) {
            (true, DisplacementFrame::Cylindrical) => closed_ring(grid, &self.contact_nodes),
            (false, DisplacementFrame::Cartesian) => open_grid(grid, &self.contact_nodes),
            (true, DisplacementFrame::Cartesian) => {
                refuse("a closed contact grid needs a cylindrical frame".to_owned())
            }
            (false, DisplacementFrame::Cylindrical) => {
                refuse("an open contact grid needs a Cartesian frame".to_owned())
            }
        }
    }
}

fn refuse(problem: String) -> Result<()> {
    super::refuse("ROM metadata `contact_grid`", problem)
}

/// Checks for rings in order of increasing z, with nodes equally spaced about z.
fn closed_ring(grid: ContactGrid, nodes: &[ContactNode]) -> Result<()> {
    let step = std::f64::consts::TAU / real(grid.around);
    for (along, ring) in nodes.chunks(grid.around).enumerate() {
        let (first, axial) = (nodes[0].position[1], ring[0].position[2]);
        for (i, node) in ring.iter().enumerate() {
            let turns = (node.position[1] - first - step * real(i)) / std::f64::consts::TAU;
            let off = (turns - turns.round()).abs() * std::f64::consts::TAU;
            if off > 1e-3 * step || (node.position[2] - axial).abs() > 1e-3 * step * node.position[0] {
                return refuse(format!("node {} of ring {} is not at its grid position", i + 1, along + 1));
            }
        }
        if along > 0 && axial <= nodes[(along - 1) * grid.around].position[2] {
            return refuse(format!("ring {} is not at a larger z than ring {along}", along + 1));
        }
    }
    Ok(())
}

/// Checks that no edge between neighbours of a row or of a column has zero length.
fn open_grid(grid: ContactGrid, nodes: &[ContactNode]) -> Result<()> {
    let length = |a: usize, b: usize| {
        let apart: [f64; 3] = std::array::from_fn(|i| nodes[a].position[i] - nodes[b].position[i]);
        apart.iter().map(|value| value * value).sum::<f64>().sqrt()
    };
    let around = (0..nodes.len()).filter(|node| (node + 1) % grid.around != 0).map(|node| [node, node + 1]);
    let along = (0..nodes.len() - grid.around).map(|node| [node, node + grid.around]);
    let edges: Vec<[usize; 2]> = around.chain(along).collect();
    let longest = edges.iter().fold(0.0, |longest: f64, [a, b]| longest.max(length(*a, *b)));
    match edges.iter().find(|[a, b]| length(*a, *b) <= SAME_NODE * longest) {
        None => Ok(()),
        Some([a, b]) => {
            let (a, b) = (&nodes[*a].name, &nodes[*b].name);
            refuse(format!("the neighbouring nodes `{a}` and `{b}` coincide"))
        }
    }
}
