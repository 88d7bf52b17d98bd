//! A structure that carries a slave surface: its modes, and the control points they move.

use super::Solution;
use crate::contact::gap::GapLaw;
use crate::contact::spline::{ClosestPoint, SurfaceSpline};
use crate::contact::spline_gap::Frame;
use crate::dynamics::bank::{BankOptions, ModalBank};
use crate::dynamics::modal::ModalModel;
use crate::persist::{Persist, Reader, Writer};
use crate::settings::Scheme;
use nalgebra::DMatrix;

/// A flexible slave in the fixed frame.
#[derive(Debug, Clone)]
pub struct Slave {
    /// Its modes; the contact rows are x, y, z of every control point.
    pub bank: ModalBank,
    /// Modal contact force of the last step, which acts in the next one (massless-boundary).
    delayed: Vec<f64>,
    /// Scratch: displacements of the control points two steps before the one that is under way.
    oldest: Vec<f64>,
    /// Contacts of the group that act on this structure.
    members: Vec<usize>,
    /// Modes seen at the contacts of a group, along the rows and columns of the Delassus matrix.
    rows: Vec<f64>,
    columns: Vec<f64>,
    /// Scratch: modes seen at one place along x, y, z.
    seen: [Vec<f64>; 3],
    /// Scratch: modal forces and modal displacements.
    force: Vec<f64>,
    /// Displacement of the control points by the forces of a solution (m); between steps scratch.
    pub response: Vec<f64>,
}

/// The structure that carries the surface which a contact node meets, and this surface.
#[inline(always)]
pub(super) fn carrier_of<'a>(
    slaves: &'a [Slave],
    law: &'a GapLaw,
    node: usize,
) -> Option<(&'a Slave, &'a SurfaceSpline)> {
    if slaves.is_empty() { None } else { find_carrier(slaves, law, node) }
}

/// Out of line: in a rigid casing contacts never get here.
#[inline(never)]
fn find_carrier<'a>(slaves: &'a [Slave], law: &'a GapLaw, node: usize) -> Option<(&'a Slave, &'a SurfaceSpline)> {
    let (surface, carrier) = law.spline_of(node)?;
    Some((&slaves[carrier], surface))
}

impl Slave {
    /// `model` has one contact row per component of every control point; at most `contacts` contacts at once, with
    /// `directions` directions each.
    pub fn new(model: &ModalModel, loads: bool, contacts: usize, directions: usize) -> Self {
        let options = BankOptions { loads, flexibility: false, ..BankOptions::default() };
        let bank = ModalBank::with_options(model, 1, options);
        let modes = bank.modes();
        Self {
            delayed: vec![0.0; modes],
            oldest: vec![0.0; bank.rows()],
            members: Vec::with_capacity(contacts),
            rows: vec![0.0; contacts * directions * modes],
            columns: vec![0.0; contacts * directions * modes],
            seen: std::array::from_fn(|_| vec![0.0; modes]),
            force: vec![0.0; modes],
            response: vec![0.0; bank.rows()],
            bank,
        }
    }

    /// Predict one step; `delayed`: the contact forces of the last step act now.
    pub fn predict(&mut self, delayed: bool, with_loss: bool) {
        self.oldest.copy_from_slice(self.bank.displacement_before());
        self.bank.predict(with_loss);
        if delayed && self.delayed.iter().any(|force| *force != 0.0) {
            self.bank.act_delayed_modal(0, &self.delayed, with_loss);
        }
        self.delayed.fill(0.0);
    }

    /// Modal forces of the contacts of the last step.
    pub fn contact_force(&self) -> &[f64] {
        &self.delayed
    }

    /// Nothing has touched yet.
    pub fn start(&mut self) {
        self.bank.recover();
        self.bank.collect_loss();
        self.delayed.fill(0.0);
    }

    /// Use a step size from here, at rest or without regard to the state.
    pub fn set_step(&mut self, scheme: Scheme, step: f64) {
        self.bank.set_step(scheme, step);
    }

    /// Before [`Slave::carry_over`]: no force lasts.
    pub fn clear_lasting(&mut self) {
        self.response.fill(0.0);
    }

    /// Add a lasting contact force on the master (N, in the directions of `frame`) whose reaction acts on a place.
    pub fn add_lasting(&mut self, surface: &SurfaceSpline, place: ClosestPoint, frame: Frame, force: [f64; 3]) {
        let force = frame.fixed(force);
        for (index, weight) in surface.weights(place).iter() {
            for (component, value) in force.iter().enumerate() {
                self.response[3 * index + component] -= weight * value;
            }
        }
    }

    /// Carry the state to another step size under the lasting contact forces added.
    pub fn carry_over(&mut self, scheme: Scheme, step: f64) {
        self.bank.resample(scheme, step, &self.response);
    }

    /// Kinetic and strain energy at this instant under the lasting contact forces added (J).
    pub fn energies_now(&mut self) -> (f64, f64) {
        self.bank.energies_now(&self.response)
    }

    /// Half the displacement of a place over the last two steps, in the directions of `frame` (m).
    pub fn moved(&self, surface: &SurfaceSpline, place: ClosestPoint, frame: Frame) -> [f64; 3] {
        let (now, oldest) = (self.bank.displacement(), &self.oldest);
        frame.local(self.at(surface, place, |row| 0.5 * (now[row] - oldest[row])))
    }

    /// Displacement of a place over the last step, in the directions of `frame` (m).
    pub fn moved_last(&self, surface: &SurfaceSpline, place: ClosestPoint, frame: Frame) -> [f64; 3] {
        let (now, before) = (self.bank.displacement(), self.bank.displacement_before());
        frame.local(self.at(surface, place, |row| now[row] - before[row]))
    }

    /// Displacement of a place by the last [`Slave::respond`], in the directions of `frame` (m).
    pub fn responded(&self, surface: &SurfaceSpline, place: ClosestPoint, frame: Frame) -> [f64; 3] {
        frame.local(self.at(surface, place, |row| self.response[row]))
    }

    fn at(&self, surface: &SurfaceSpline, place: ClosestPoint, value: impl Fn(usize) -> f64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (index, weight) in surface.weights(place).iter() {
            for (component, sum) in sum.iter_mut().enumerate() {
                *sum += weight * value(3 * index + component);
            }
        }
        sum
    }

    /// Forget the group.
    pub fn clear_members(&mut self) {
        self.members.clear();
    }

    /// Project the modes on the directions (in `frame`) of contact `member` of the group, which acts on this structure.
    pub fn see(
        &mut self,
        member: usize,
        surface: &SurfaceSpline,
        place: ClosestPoint,
        frame: Frame,
        rows: &[[f64; 3]],
        columns: &[[f64; 3]],
    ) {
        self.members.push(member);
        let modes = self.bank.modes();
        for (component, seen) in self.seen.iter_mut().enumerate() {
            seen.fill(0.0);
            for (index, weight) in surface.weights(place).iter() {
                let shapes = self.bank.contact_row(3 * index + component);
                seen.iter_mut().zip(shapes).for_each(|(sum, shape)| *sum += weight * shape);
            }
        }
        let [x, y, z] = &self.seen;
        for (directions, target) in [(rows, &mut self.rows), (columns, &mut self.columns)] {
            for (index, direction) in directions.iter().enumerate() {
                let [a, b, c] = frame.fixed(*direction);
                let target = &mut target[(member * directions.len() + index) * modes..][..modes];
                for (((value, x), y), z) in target.iter_mut().zip(x).zip(y).zip(z) {
                    *value = a * x + b * y + c * z;
                }
            }
        }
    }

    /// Add this structure's part to the Delassus matrix (m/N) of a group with `per` directions per contact.
    pub fn add_delassus(&mut self, matrix: &mut DMatrix<f64>, per: usize) {
        for at in 0..self.members.len() {
            for column in per * self.members[at]..per * (self.members[at] + 1) {
                self.prepare_column(column);
                for member in &self.members {
                    for row in per * member..per * (member + 1) {
                        matrix[(row, column)] += self.delassus(row);
                    }
                }
            }
        }
    }

    /// Entry (row, column) of the slave's part of the Delassus matrix (m/N); [`Slave::prepare_column`] comes before.
    fn delassus(&self, row: usize) -> f64 {
        let modes = self.bank.modes();
        self.rows[row * modes..][..modes].iter().zip(&self.force).map(|(shape, moved)| shape * moved).sum()
    }

    /// Modal displacement per unit force along a column of the Delassus matrix.
    fn prepare_column(&mut self, column: usize) {
        let modes = self.bank.modes();
        let shapes = &self.columns[column * modes..][..modes];
        for ((value, shape), k) in self.force.iter_mut().zip(shapes).zip(self.bank.coefficients(0)) {
            *value = k.compliance * shape;
        }
    }

    /// Modal force −Σ F_j λ_j of a solution with `per` directions per contact into the scratch.
    fn gather(&mut self, solution: &Solution, per: usize) {
        let modes = self.bank.modes();
        self.force.fill(0.0);
        let columns = self.members.iter().flat_map(|member| per * member..per * (member + 1));
        for (column, value) in columns.map(|column| (column, solution.values()[column])) {
            if value != 0.0 {
                let shapes = &self.columns[column * modes..][..modes];
                self.force.iter_mut().zip(shapes).for_each(|(sum, shape)| *sum -= value * shape);
            }
        }
    }

    /// What the forces of a solution would do to the control points.
    pub fn respond(&mut self, solution: &Solution, per: usize) {
        self.gather(solution, per);
        if self.members.is_empty() {
            self.response.fill(0.0);
            return;
        }
        self.bank.response_to_modal(&self.force, &mut self.response);
    }

    /// Let the forces of the solution act that [`Slave::respond`] was asked about last.
    pub fn apply(&mut self, with_loss: bool) {
        self.delayed.copy_from_slice(&self.force);
        if self.members.is_empty() {
            return;
        }
        self.bank.correct_modal(&self.force, &self.response, with_loss);
    }

    /// Write everything that determines the future.
    pub fn save(&self, writer: &mut Writer) {
        self.bank.save(writer);
        self.delayed.save(writer);
    }

    /// Pass over a saved state and refuse what is none.
    pub fn check(&self, reader: &mut Reader) {
        self.bank.check(reader);
        self.delayed.check(reader);
    }

    /// Restore a saved state, after the step size is set.
    pub fn restore(&mut self, reader: &mut Reader) {
        self.bank.restore(reader);
        self.delayed.restore(reader);
    }
}
