//! Abradable coating: cells around the circumference and along the axis, each a rod that the blade wears.
//!
//! A blade is a band in θ around the line through its contact nodes, with the width of its tip. Axial row j of cells has the penetration
//! δ_j = −Σ N_ij g_i, interpolated between its two neighbouring nodes. Every cell that the band covers returns its force F = σ·b Δz, with
//! the covered arc b, to these nodes by the transpose of the same N, so that virtual work is exact. The arcs of a row add up to the width
//! of the tip for any width of the cells, which only resolve the wear. Gaps are measured to the unworn surface; the hard casing is h₀
//! behind it, g ≥ −h₀. [`CoatedProblem`] finds gaps, rod forces and hard contact forces of one step together; wear grows only in
//! [`Coating::commit`].

mod cutting;
mod problem;
mod rod;
#[cfg(test)]
mod tests;
mod tip;

use std::f64::consts::TAU;

use cutting::CoatingCut;
use nalgebra::DMatrix;
pub use problem::CoatedProblem;
pub(crate) use rod::{Branch, RodMaterial};
pub use tip::BladeTip;
use tiprub_cosim::persist::{Persist, StateReader, StateWriter};
use tiprub_cosim::shown;

use crate::math::{argsort, real};
use crate::scene::settings::CoatingSettings;
use crate::{Error, Result};

/// Contact nodes closer than this fraction of the axial extent are at the same place.
const SAME_PLACE: f64 = 1e-6;

/// Cells of one axial position.
#[derive(Debug, Clone, Copy, PartialEq)]
struct CellRow {
    /// Contact nodes of the blade that determine its penetration.
    nodes: [usize; 2],
    /// Weights of these nodes, sum 1.
    weights: [f64; 2],
    /// Area of one cell (m²).
    area: f64,
    /// Axial position of the centre (m).
    axial: f64,
    /// Radius, and width along the axis (m).
    radius: f64,
    width: f64,
    /// Width of the tip as a number of cells; 0 for a coating that is cut.
    covers: f64,
}

impl CellRow {
    /// Largest number of cells that a blade can press or cut simultaneously.
    fn most_cells(&self) -> usize {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ value ≤ cells around")]
        let covered = self.covers as usize;
        covered + 2
    }

    /// Returns the angle of a blade with contact nodes at `angles` (rad).
    fn angle(&self, angles: &[f64]) -> f64 {
        let [a, b] = self.nodes;
        let apart = angles[b] - angles[a];
        // Neighbouring nodes are less than half a turn apart; their angles may differ by whole turns.
        angles[a] + self.weights[1] * (apart - TAU * (apart / TAU).round())
    }
}

/// A cell in front of a blade.
#[derive(Debug, Clone, Copy, PartialEq)]
struct CellContact {
    cell: usize,
    /// Nodes within the group.
    nodes: [usize; 2],
    weights: [f64; 2],
    /// Area that the blade presses or cuts (m²).
    area: f64,
    /// Plastic strain before the step; if the coating is cut, ahead of the blade.
    plastic: f64,
    branch: Branch,
    /// Blade that presses or cuts the cell.
    blade: usize,
    row: usize,
    /// True for the cell that the blade faces, not for one that it has left in this step; if pressed in, for a cell whose middle it covers.
    faced: bool,
}

/// Coating of one slave: material, cells, wear.
#[derive(Debug, Clone, PartialEq)]
pub struct Coating {
    rod: RodMaterial,
    /// Thickness h₀ (m).
    pub(super) thickness: f64,
    around: usize,
    /// Contact nodes per blade.
    nodes: usize,
    rows: Vec<CellRow>,
    /// Plastic strain, `[row · around + place around]`: wear depth as a fraction of the thickness.
    plastic: Vec<f64>,
    /// State of cutting; `None` if the coating is pressed in.
    cutting: Option<CoatingCut>,
}

impl Coating {
    /// Creates an unworn coating for `blades` equal tips.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the invalid value: no extent; two nodes at one axial position; too few cells or too wide a tip for separate
    /// cells of every blade.
    pub fn new(settings: &CoatingSettings, tip: &BladeTip, blades: usize) -> Result<Self> {
        let BladeTip { axial, radii, widths, extent } = tip;
        let order = sorted(tip)?;
        let (around, along) = (settings.cells_around, settings.cells_along);
        // Two cells per pitch, so that deformed blades never share a cell.
        if around < 2 * blades || along == 0 {
            return Err(Error::invalid(
                "contact.coating.cells_around, cells_along",
                format!("{around} x {along} cells for {blades} blades"),
                "Give at least two cells per blade around the circumference and one along the axis",
            ));
        }
        let width = (extent[1] - extent[0]) / real(along);
        let row = |index: usize| {
            let centre = extent[0] + (real(index) + 0.5) * width;
            let (nodes, weights) = neighbours(axial, &order, centre);
            let mean = |of: &[f64]| weights[0] * of[nodes[0]] + weights[1] * of[nodes[1]];
            let radius = mean(radii);
            let arc = radius * TAU / real(around);
            let covers = if settings.cutting.is_some() { 0.0 } else { mean(widths) / arc };
            CellRow { nodes, weights, area: arc * width, axial: centre, radius, width, covers }
        };
        let rows: Vec<CellRow> = (0..along).map(row).collect();
        // The cells of a band are up to one cell wider than the band.
        let pitch = real(around) / real(blades);
        if let Some(row) = rows.iter().find(|row| row.covers.is_nan() || row.covers + 1.0 > pitch) {
            return Err(Error::invalid(
                "contact.coating.contact_width",
                format!(
                    "the tip covers {} cells, but the {blades} blades share only {around}",
                    shown((row.covers * 1e3).round() / 1e3)
                ),
                "Use more cells around the circumference, or a `contact_width` (m) below the blade pitch",
            ));
        }
        Ok(Self {
            rod: settings.cutting.map_or_else(|| RodMaterial::new(settings), CoatingCut::rod),
            thickness: settings.thickness,
            around,
            nodes: axial.len(),
            rows,
            plastic: vec![0.0; around * along],
            cutting: settings.cutting.map(|cutting| CoatingCut::new(cutting, blades, along, axial.len())),
        })
    }

    /// Allocates scratch for groups of at most `blades` coupled blades.
    pub fn problem(&self, blades: usize) -> CoatedProblem {
        let cells = self.rows.iter().map(CellRow::most_cells).sum::<usize>();
        CoatedProblem::new(self.rod, self.thickness, blades * self.nodes, blades * cells)
    }

    /// Appends a blade to a group: its nodes follow the existing ones, with the cells that it covers in each row. `angles` are those of its
    /// contact nodes in the fixed frame (rad), in the order of the positions given at construction.
    pub fn locate(&self, problem: &mut CoatedProblem, angles: &[f64]) {
        let first = problem.append_nodes(self.nodes);
        for (index, row) in self.rows.iter().enumerate() {
            let [a, b] = row.nodes;
            // A cell wears with the depth in its middle; if cells are wider than the tip, with the depth in the middle of the tip.
            let half = 0.5 * row.covers.min(1.0);
            covered(row.angle(angles), row.covers, self.around, |place, share| {
                let cell = index * self.around + place;
                problem.append_contact(CellContact {
                    cell,
                    nodes: [first + a, first + b],
                    weights: row.weights,
                    area: row.area * share,
                    plastic: self.plastic[cell],
                    branch: Branch::Free,
                    blade: 0,
                    row: index,
                    faced: share >= half,
                });
            });
        }
    }

    /// Applies the wear of a solved problem; returns the work spent on it (J), plastic and hardening part.
    pub fn commit(&mut self, problem: &CoatedProblem) -> f64 {
        let mut work = 0.0;
        for (contact, after) in problem.worn() {
            let before = self.plastic[contact.cell];
            if after > before {
                // The whole cell, even if an edge of the tip covers only a part.
                work += self.rows[contact.row].area * self.thickness * self.rod.wear_work(before, after);
                self.plastic[contact.cell] = after;
            }
        }
        work
    }

    /// Number of contact nodes per blade.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Angle (rad) by which blades may turn in a step without skipping a cell: the width of a cell, or of the narrowest part of a tip.
    pub fn stride(&self) -> f64 {
        let narrowest = self.rows.iter().fold(f64::INFINITY, |narrowest, row| row.covers.min(narrowest));
        narrowest.max(1.0) * self.width()
    }

    /// Width of a cell around the circumference (rad).
    fn width(&self) -> f64 {
        TAU / real(self.around)
    }

    /// Wear depth of a cell (m); cell `row · around + i` is the i-th of its axial row.
    pub fn wear_depth(&self, cell: usize) -> f64 {
        self.plastic[cell] * self.thickness
    }

    /// Normal forces of contact nodes per depth of cut of all of them (N/m), nodes²; `None` if the coating is pressed in.
    pub fn cut_stiffness(&self) -> Option<DMatrix<f64>> {
        self.cutting.as_ref()?;
        let mut stiffness = DMatrix::zeros(self.nodes, self.nodes);
        let (_, modulus) = self.rod.line(Branch::Elastic, 0.0);
        for row in &self.rows {
            for (a, from) in row.nodes.into_iter().zip(row.weights) {
                for (b, to) in row.nodes.into_iter().zip(row.weights) {
                    stiffness[(a, b)] += modulus * row.width * from * to;
                }
            }
        }
        Some(stiffness)
    }

    /// Computes the mean wear depth (m) at every place around, averaged over the area of the rows there, or of every row.
    pub fn wear_profile(&self, around: bool, out: &mut [f64]) {
        let area: f64 = self.rows.iter().map(|row| row.area).sum();
        if around {
            out.fill(0.0);
            for (row, plastic) in self.rows.iter().zip(self.plastic.chunks(self.around)) {
                let share = self.thickness * row.area / area;
                out.iter_mut().zip(plastic).for_each(|(mean, plastic)| *mean += share * plastic);
            }
            return;
        }
        for (mean, plastic) in out.iter_mut().zip(self.plastic.chunks(self.around)) {
            *mean = self.thickness * plastic.iter().sum::<f64>() / real(self.around);
        }
    }

    /// Largest wear depth (m).
    pub fn largest_wear_depth(&self) -> f64 {
        self.plastic.iter().copied().fold(0.0, f64::max) * self.thickness
    }

    /// Worn volume (m³).
    pub fn worn_volume(&self) -> f64 {
        let cells = self.rows.iter().zip(self.plastic.chunks(self.around));
        cells.map(|(row, plastic)| row.area * plastic.iter().sum::<f64>()).sum::<f64>() * self.thickness
    }

    /// Removes all wear.
    pub fn reset(&mut self) {
        self.plastic.fill(0.0);
        self.cutting.iter_mut().for_each(CoatingCut::reset);
    }
}

/// The wear is the state; material and cells are part of the scene.
impl Persist for Coating {
    fn save(&self, writer: &mut StateWriter) {
        self.plastic.save(writer);
        self.cutting.save(writer);
    }
    fn restore(&mut self, reader: &mut StateReader) {
        self.plastic.restore(reader);
        self.cutting.restore(reader);
        self.cutting.iter_mut().for_each(CoatingCut::forget);
    }
    fn check(&self, reader: &mut StateReader) {
        let mut saved = self.clone();
        saved.restore(&mut reader.clone());
        self.plastic.check(reader);
        self.cutting.check(reader);
        if saved.plastic.iter().any(|strain| *strain < 0.0) {
            reader.refuse("the coating is thicker than when new");
        }
        if saved.cutting.iter().any(|cutting| cutting.is_outside(saved.plastic.len())) {
            reader.refuse("a blade cuts outside the coating");
        }
    }
}

/// Sorts the nodes by increasing z; all must be at different places of a finite extent.
fn sorted(BladeTip { axial, radii, extent, .. }: &BladeTip) -> Result<Vec<usize>> {
    let length = extent[1] - extent[0];
    let refuse = |problem: String, remedy: &str| Err(Error::invalid("contact.coating", problem, remedy));
    let order = argsort(axial);
    if !(length.is_finite() && length > 0.0) || radii.len() != axial.len() {
        let problem = format!("{} contact nodes per blade over an axial length of {} m", axial.len(), shown(length));
        return refuse(problem, "Use a ROM with contact nodes at two or more axial positions");
    }
    match order.windows(2).find(|pair| axial[pair[1]] - axial[pair[0]] <= SAME_PLACE * length) {
        None => Ok(order),
        Some(pair) => refuse(
            format!("contact nodes {} and {} are at the same axial position", pair[0] + 1, pair[1] + 1),
            "Reduce the model again with one contact node per axial position",
        ),
    }
}

/// Returns the two nodes around an axial position and their weights.
fn neighbours(axial: &[f64], order: &[usize], position: f64) -> ([usize; 2], [f64; 2]) {
    let above = order.partition_point(|node| axial[*node] <= position);
    if above == 0 || above == order.len() {
        let node = order[above.saturating_sub(1)];
        return ([node; 2], [1.0, 0.0]);
    }
    let [a, b] = [order[above - 1], order[above]];
    let share = (position - axial[a]) / (axial[b] - axial[a]);
    ([a, b], [1.0 - share, share])
}

/// Index of the one of `around` equal parts of the circumference that contains an angle (rad), and the position of the angle within it (-,
/// 0 to 1). Both follow from one number, so that they agree at a border, where rounding decides.
fn place(angle: f64, around: usize) -> (usize, f64) {
    let turns = angle / TAU;
    let places = (turns - turns.floor()) * real(around);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ value ≤ cells around")]
    // The fraction of a tiny negative angle rounds to 1.
    let index = (places as usize).min(around - 1);
    (index, places - real(index))
}

/// Calls `take` for the cells covered by a band of this width (in cells) with its middle at an angle (rad): with the place of each cell
/// around, and the covered fraction of it. Fractions add up to the width.
fn covered(angle: f64, width: f64, around: usize, mut take: impl FnMut(usize, f64)) {
    let (middle, within) = place(angle, around);
    let [low, high] = [within - 0.5 * width, within + 0.5 * width];
    let mut edge = low.floor();
    // Cells before the one in the middle, fewer than there are around.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ value ≤ cells around")]
    let before = -edge.min(0.0) as usize;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 or 1")]
    let after = edge.max(0.0) as usize;
    let mut cell = (middle + around - before + after) % around;
    while edge < high {
        let share = high.min(edge + 1.0) - low.max(edge);
        if share > 0.0 {
            take(cell, share);
        }
        cell = if cell + 1 == around { 0 } else { cell + 1 };
        edge += 1.0;
    }
}
