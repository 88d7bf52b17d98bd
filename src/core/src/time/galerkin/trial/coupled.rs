//! Trials of sectors that step together because they move each other or touch a common surface.

use super::{Obstacle, Trial, TrialResult};
use crate::math::vector::{Vector3, vector3_at};
use crate::time::galerkin::compliance::LaneCompliance;
use crate::time::galerkin::state::SectorState;

impl Trial {
    /// Sets the displacements (m) and velocities (m/s) of the rows at the start from the values of the caller.
    pub(crate) fn start_at(&mut self, of_row: impl Fn(usize) -> [f64; 2]) {
        for (row, (moved, velocity)) in self.start.iter_mut().zip(&mut self.velocities).enumerate() {
            [*moved, *velocity] = of_row(row);
        }
        self.known = true;
    }

    /// Finds unknown gaps at the start; `gap` returns the gap of a node with a given displacement (m).
    pub(crate) fn find_start_gaps(&mut self, state: &SectorState, mut gap: impl FnMut(usize, Vector3) -> f64) {
        if !state.gaps_known {
            for node in 0..self.nodes() {
                self.start_contacts.gaps[node] = gap(node, vector3_at(&self.start, node));
            }
        }
    }

    /// Returns the smallest gap at the start (m).
    pub(crate) fn lowest_at_start(&self) -> f64 {
        self.start_contacts.gaps.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Sets the displacements without forces so that the total displacement (m) of a node at point 1 … s equals that of the
    /// caller, which includes the effect of other sectors.
    pub fn carry(&mut self, of: impl Fn(usize, usize) -> Vector3) {
        for lane in 0..self.lanes.len() {
            let (point, node) = self.lanes.place(lane);
            self.lanes.set(&mut self.free, lane, of(point, node) - self.lanes.vector3(&self.pushed, lane));
        }
    }

    /// Finds gaps (m) and normals at point 1 … s, for the current displacements of the nodes (m). [`Trial::set_gap`] sets the gaps to
    /// smooth rings on elastic casings.
    pub(crate) fn find_gaps_at(&mut self, point: usize, obstacle: &mut impl Obstacle) {
        let Self { lanes, moved, gaps, normals, .. } = self;
        obstacle.gaps_at(point, *lanes, moved, gaps, normals);
    }

    /// Prepares the compliance of the obstacle at the chosen lanes, unless it is known from an earlier solution of this trial. Later gaps
    /// are evaluated with the motion of the obstacle, so its compliance need not be exact.
    pub(super) fn prepare_carriers(&mut self, obstacle: &mut impl Obstacle) {
        let (lanes, stride) = (self.lanes, 3 * self.lanes.width());
        self.carrier_is_fresh = (0..lanes.len()).any(|lane| self.chosen[lane] && !self.carrier_known[lane]);
        if self.carrier_is_fresh {
            self.carrier_known.copy_from_slice(&self.chosen);
            self.carrier_yields = obstacle.prepare_compliance(lanes, &self.chosen, &self.normals[..stride]);
        }
    }

    /// Begins the exchange of forces with other sectors on the obstacle, starting from the last evaluated gaps.
    pub(super) fn begin_exchange(&mut self) {
        let count = self.lanes.len();
        self.evaluated[..count].copy_from_slice(&self.multipliers[..count]);
        self.applied[..count].copy_from_slice(&self.multipliers[..count]);
        self.shifts.fill(0.0);
    }

    /// Adds the motion of the obstacle under the changed forces of other sectors to the gaps without forces. Returns the largest change of
    /// a gap (m).
    pub(super) fn find_shifts(&mut self, obstacle: &impl Obstacle) -> f64 {
        let (width, mut largest) = (self.lanes.width(), 0.0_f64);
        if !self.carrier_yields || !obstacle.is_coupled() {
            return largest;
        }
        for lane in (0..self.lanes.len()).filter(|lane| self.carrier_known[*lane]) {
            // The contact problem already includes the forces of this sector.
            let own = self.members.iter().map(|member| {
                self.carrier_columns[member * width + lane] * (self.applied[*member] - self.evaluated[*member])
            });
            let shift = obstacle.gap_change(lane) - own.sum::<f64>();
            let change = shift - std::mem::replace(&mut self.shifts[lane], shift);
            self.without[lane] += change;
            largest = largest.max(change.abs());
        }
        largest
    }

    /// Applies the changes of the forces since the last solution to the obstacle.
    pub(super) fn apply_force_changes(&mut self, obstacle: &mut impl Obstacle) {
        if !self.carrier_yields || !obstacle.is_coupled() {
            return;
        }
        for lane in (0..self.lanes.len()).filter(|lane| self.carrier_known[*lane]) {
            let now = self.multipliers[lane];
            let change = now - std::mem::replace(&mut self.applied[lane], now);
            if change != 0.0 {
                obstacle.add_force_change(lane, change);
            }
        }
        obstacle.apply_force_changes();
    }

    /// Solves the contact problem again if forces of other sectors have changed a gap by more than `precision` (m). Returns whether there
    /// is a solution, and whether the problem was solved again.
    pub(crate) fn solve_again(
        &mut self,
        compliance: &LaneCompliance,
        obstacle: &mut impl Obstacle,
        precision: f64,
        verdict: &mut TrialResult,
    ) -> [bool; 2] {
        if self.find_shifts(obstacle) <= precision {
            return [true, false];
        }
        [self.find_forces(compliance, obstacle, verdict), true]
    }

    /// Impulse error on the rows of a node (N·s); valid after the step has been judged.
    pub fn impulse(&self, node: usize) -> Vector3 {
        vector3_at(&self.impulses, node)
    }
}
