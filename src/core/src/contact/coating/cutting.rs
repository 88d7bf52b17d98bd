//! Cutting: a blade shears the coating off along its path. For a row of width b and a depth of cut a, the force against the motion is
//! u·b·a, with the specific cutting energy u, and κ times that away from the casing. The volume removed per sliding distance is b·a, so
//! that the work along the path is u times the volume.
//!
//! A blade cuts the material that was in front of it when it entered a cell: the depth of the whole cell grows while the blade passes, the
//! depth of the part ahead does not. The path of one step may lie in two cells, each with its fraction of the path. Forces therefore do not
//! depend on the width of cells.

use tiprub_cosim::persist_fields;

use super::{Branch, CellContact, CellRow, CoatedProblem, Coating, RodMaterial, place};
use crate::scene::settings::CuttingSettings;

/// Edge of one row of a blade that cuts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Edge {
    /// Number of the cell, from 1; 0 without cutting.
    cell: u64,
    /// Depth of that cell ahead of the blade, as a fraction of the thickness.
    ahead: f64,
    /// Direction of motion around: 1, −1, or 0 at rest.
    sense: f64,
}

persist_fields!(Edge { cell, ahead, sense });
persist_fields!(CoatingCut { edges, .. });

/// Material removed from a cell in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Chip {
    cell: usize,
    row: usize,
    blade: usize,
    /// Force against the motion (N).
    force: f64,
}

/// State of cutting of a coating.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CoatingCut {
    /// Specific cutting energy (J/m³).
    energy: f64,
    /// Ratio of tangential to normal force.
    tangential: f64,
    /// Edges, `[blade · rows + row]`.
    edges: Vec<Edge>,
    /// Edges after the current step: a row that is no longer pressed in starts anew.
    next: Vec<Edge>,
    /// Chips of the current step; none between steps.
    chips: Vec<Chip>,
    /// Sliding distance of each contact node against the force (m) in the current step, `[blade · nodes + node]`.
    ways: Vec<f64>,
}

impl CoatingCut {
    pub(super) fn new(settings: CuttingSettings, blades: usize, rows: usize, nodes: usize) -> Self {
        Self {
            energy: settings.specific_energy,
            tangential: 1.0 / settings.normal_ratio,
            edges: vec![Edge::default(); blades * rows],
            next: vec![Edge::default(); blades * rows],
            chips: Vec::with_capacity(2 * blades * rows),
            ways: vec![0.0; blades * nodes],
        }
    }

    /// Returns the normal force κ·u·b·a as that of a rod: with the area b·h₀ it has the modulus κ·u, and it never yields.
    pub(super) fn rod(settings: CuttingSettings) -> RodMaterial {
        let modulus = settings.normal_ratio * settings.specific_energy;
        RodMaterial { modulus, yield_stress: f64::INFINITY, hardening: 0.0 }
    }

    pub(super) fn reset(&mut self) {
        self.edges.fill(Edge::default());
        self.forget();
    }

    /// Discards the results of the current step.
    pub(super) fn forget(&mut self) {
        self.next.fill(Edge::default());
        self.chips.clear();
        self.ways.fill(0.0);
    }

    /// Returns whether an edge is outside a coating with a number of cells.
    pub(super) fn is_outside(&self, cells: usize) -> bool {
        self.edges.iter().any(|edge| edge.cell > cells as u64 || edge.ahead < 0.0 || edge.sense.abs() > 1.0)
    }
}

impl Coating {
    /// Returns whether the coating is cut instead of pressed in.
    pub(crate) fn is_cut(&self) -> bool {
        self.cutting.is_some()
    }

    /// Ratio of tangential to normal force of a cut (-); 0 if the coating is pressed in.
    pub(crate) fn tangential_ratio(&self) -> f64 {
        self.cutting.as_ref().map_or(0.0, |cutting| cutting.tangential)
    }

    /// Finds the one or two cells of each row that a cutting blade passes in the step, as [`Coating::locate`] does for
    /// other blades. `angles`: angles of its contact nodes on the casing (rad). `slid`: sliding distance of each node
    /// over the step (m), positive towards increasing angles.
    pub(crate) fn locate_cut(&self, problem: &mut CoatedProblem, blade: usize, angles: &[f64], slid: &[f64]) {
        let Some(cutting) = &self.cutting else { return };
        let first = problem.append_nodes(self.nodes);
        for (index, row) in self.rows.iter().enumerate() {
            let (angle, [a, b]) = (row.angle(angles), row.nodes);
            let slid = row.weights[0] * slid[a] + row.weights[1] * slid[b];
            let edge = cutting.edges[blade * self.rows.len() + index];
            let mut append = |place: usize, share: f64, faced: bool| {
                let cell = index * self.around + place;
                let known = edge.cell == cell as u64 + 1 && edge.sense.total_cmp(&sense(slid)).is_eq();
                problem.append_contact(CellContact {
                    cell,
                    nodes: [first + a, first + b],
                    weights: row.weights,
                    area: row.width * self.thickness * share,
                    plastic: if known { edge.ahead } else { self.plastic[cell] },
                    branch: Branch::Free,
                    blade,
                    row: index,
                    faced,
                });
            };
            let (here, within) = place(angle, self.around);
            let behind = self.behind(within, slid, row.radius);
            append(here, 1.0 - behind, true);
            if behind > 0.0 {
                let back = if slid > 0.0 { here + self.around - 1 } else { here + 1 };
                append(back % self.around, behind, false);
            }
        }
    }

    /// Fraction of the sliding distance (m, at a radius) that is behind the border of its last cell, in which it ends at the position
    /// `within` (-).
    fn behind(&self, within: f64, slid: f64, radius: f64) -> f64 {
        let turned = slid / radius;
        if turned == 0.0 {
            return 0.0;
        }
        let since = if turned > 0.0 { within } else { 1.0 - within };
        (1.0 - since * self.width() / turned.abs()).clamp(0.0, 1.0)
    }

    /// Records the chips of a solved problem, for nodes that have slid by these distances (m).
    pub(in crate::contact) fn take_chips(&mut self, problem: &CoatedProblem, slid: &[f64]) {
        let (rows, Some(cutting)) = (self.rows.len(), &mut self.cutting) else { return };
        for contact in &problem.contacts {
            let CellContact { cell, row, blade, plastic: ahead, .. } = *contact;
            let sense = sense((0..2).map(|end| contact.weights[end] * slid[contact.nodes[end]]).sum());
            let pressed = problem.strain(contact, &problem.gaps) > 0.0;
            let next = &mut cutting.next[blade * rows + row];
            if contact.faced && pressed {
                *next = Edge { cell: cell as u64 + 1, ahead, sense };
            }
            if contact.branch != Branch::Free && sense != 0.0 {
                let force = cutting.tangential * problem.force(contact, &problem.gaps).max(0.0);
                cutting.chips.push(Chip { cell, row, blade, force });
            }
        }
    }

    /// Sets the sliding distance of a contact node against its force in the step (m).
    pub fn slid(&mut self, blade: usize, node: usize, way: f64) {
        let nodes = self.nodes;
        if let Some(cutting) = &mut self.cutting {
            cutting.ways[blade * nodes + node] = way;
        }
    }

    /// Removes the material that the blades have cut along their path; returns the energy this consumes (J).
    pub fn cut(&mut self) -> f64 {
        let Some(cutting) = &mut self.cutting else { return 0.0 };
        let mut energy = 0.0;
        for Chip { cell, row, blade, force } in cutting.chips.drain(..) {
            let (CellRow { nodes, weights, area, .. }, first) = (self.rows[row], blade * self.nodes);
            let way = (0..2).map(|end| weights[end] * cutting.ways[first + nodes[end]]).sum::<f64>().max(0.0);
            energy += force * way;
            self.plastic[cell] += force * way / (cutting.energy * area * self.thickness);
        }
        cutting.ways.fill(0.0);
        std::mem::swap(&mut cutting.edges, &mut cutting.next);
        cutting.next.fill(Edge::default());
        energy
    }
}

/// Returns 1, −1 or 0.
fn sense(way: f64) -> f64 {
    if way > 0.0 {
        1.0
    } else if way < 0.0 {
        -1.0
    } else {
        0.0
    }
}
