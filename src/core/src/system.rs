//! One internal step: prediction, gaps, correction (section 4.3 of the paper), and the books kept on the way.

use crate::contact::gap::{Drive, GapLaw, Geometry, dot};
use crate::contact::solver::ContactSolver;
use crate::dynamics::bank::ModalBank;
use crate::dynamics::modal::ModalModel;
use crate::ledger::Ledger;
use crate::persist::{Persist, Reader, Writer, persist_fields};
use crate::settings::{Scheme, Solver};

/// Denormals are flushed every this many steps.
const FLUSH_EVERY: u64 = 512;
/// A contact force is continued over steps at most this many times as long as the one it was found in.
const FORCE_REACH: f64 = 4.0;

/// One active contact of the last step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactEvent {
    /// Sector (0-based).
    pub sector: usize,
    /// Contact node (0-based).
    pub node: usize,
    /// Multiplier λ: normal force (N).
    pub normal: f64,
    /// Friction force µλ (N) in the direction against slip; 0 without slip.
    pub tangential: f64,
    /// Force on the master (N) in the directions of the structure's frame.
    pub force: [f64; 3],
    /// Friction heat of the step (J).
    pub friction_heat: f64,
}

/// Why a step failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepFailure {
    /// A displacement or gap became infinite or NaN.
    NonFinite,
    /// A node is displaced or penetrates by more than a tenth of its radius, or meets a flank of the casing steeper than 45°.
    Implausible {
        /// Sector (0-based).
        sector: usize,
    },
    /// The contact problem of a sector has no solution within the pivoting limit.
    Unsolved {
        /// Sector (0-based).
        sector: usize,
    },
}

/// How the system is stepped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SystemSettings {
    /// Time-stepping scheme.
    pub scheme: Scheme,
    /// Contact solver.
    pub solver: Solver,
    /// Coulomb coefficient µ.
    pub friction: f64,
    /// Gather the damping loss, without which the ledger does not close.
    pub ledger: bool,
}

#[derive(Debug, Clone, PartialEq)]
struct SystemState {
    steps: u64,
    factorisations: u64,
    /// Gaps at the current step (m), `[node · lanes + lane]`.
    gap: Vec<f64>,
    /// Gaps one step earlier (m).
    gap_before: Vec<f64>,
    /// λ of the last step (N), `[node · lanes + lane]`.
    multiplier: Vec<f64>,
    /// Contact force of the last step on each row (N), `[row · lanes + lane]`.
    force: Vec<f64>,
    ledger: Ledger,
}

persist_fields!(SystemState { steps, factorisations, gap, gap_before, multiplier, force, ledger });

/// Modes, gap function and contact solver put together.
#[derive(Debug, Clone)]
pub struct System {
    bank: ModalBank,
    law: GapLaw,
    settings: SystemSettings,
    geometry: Geometry,
    problem: ContactSolver,
    events: Vec<ContactEvent>,
    lowest: Vec<f64>,
    slip: Vec<[f64; 3]>,
    force: Vec<f64>,
    gap_oldest: Vec<f64>,
    displacement_oldest: Vec<f64>,
    state: SystemState,
}

impl System {
    /// All sectors at rest. [`System::set_step`] and [`System::start`] come before the first step.
    pub fn new(model: &ModalModel, sectors: usize, law: GapLaw, settings: SystemSettings) -> Self {
        let bank = ModalBank::new(model, sectors);
        let (lanes, nodes) = (bank.lanes(), law.nodes());
        let contacts = nodes * lanes;
        Self {
            geometry: law.geometry(lanes),
            problem: ContactSolver::new(nodes),
            events: Vec::with_capacity(contacts),
            lowest: vec![0.0; lanes],
            slip: vec![[0.0; 3]; nodes],
            force: vec![0.0; 3 * nodes],
            gap_oldest: vec![f64::INFINITY; contacts],
            displacement_oldest: vec![0.0; 3 * contacts],
            state: SystemState {
                steps: 0,
                factorisations: 0,
                // Padding lanes keep an infinite gap.
                gap: vec![f64::INFINITY; contacts],
                gap_before: vec![f64::INFINITY; contacts],
                multiplier: vec![0.0; contacts],
                force: vec![0.0; 3 * contacts],
                ledger: Ledger::default(),
            },
            bank,
            law,
            settings,
        }
    }

    /// The modes.
    pub fn bank(&self) -> &ModalBank {
        &self.bank
    }

    /// The modes, to set initial conditions before [`System::start`].
    pub fn bank_mut(&mut self) -> &mut ModalBank {
        &mut self.bank
    }

    /// The gap function.
    pub fn law(&self) -> &GapLaw {
        &self.law
    }

    /// Active contacts of the last step.
    pub fn events(&self) -> &[ContactEvent] {
        &self.events
    }

    /// Gaps at the current step (m), `[node · lanes + lane]`; padding lanes are infinite.
    pub fn gaps(&self) -> &[f64] {
        &self.state.gap
    }

    /// Gap of one node of one sector (m).
    pub fn gap(&self, node: usize, sector: usize) -> f64 {
        self.state.gap[node * self.bank.lanes() + sector]
    }

    /// Rate of that gap over the last step (m/s).
    pub fn gap_rate(&self, node: usize, sector: usize) -> f64 {
        let index = node * self.bank.lanes() + sector;
        (self.state.gap[index] - self.state.gap_before[index]) / self.bank.step()
    }

    /// λ of one node of one sector in the last step (N).
    pub fn multiplier(&self, node: usize, sector: usize) -> f64 {
        self.state.multiplier[node * self.bank.lanes() + sector]
    }

    /// Internal steps done.
    pub fn steps(&self) -> u64 {
        self.state.steps
    }

    /// Small linear systems factorised by the contact solver.
    pub fn factorisations(&self) -> u64 {
        self.state.factorisations
    }

    /// Work and losses so far.
    pub fn ledger(&self) -> &Ledger {
        &self.state.ledger
    }

    /// Settings in use.
    pub fn settings(&self) -> &SystemSettings {
        &self.settings
    }

    /// Change friction (takes effect with the next step).
    pub fn set_friction(&mut self, friction: f64) {
        self.settings.friction = friction;
    }

    /// Choose scheme and solver; only before [`System::start`].
    pub fn set_methods(&mut self, scheme: Scheme, solver: Solver) {
        self.settings.scheme = scheme;
        self.settings.solver = solver;
    }

    /// Use step size `step` (s) from here. A running state is carried over by resampling the modal motion under
    /// the last contact force; the energy this adds is booked in the ledger.
    ///
    /// Only a force that lasts is continued: that of a contact closed at both ends of the last step. The multiplier of
    /// an impact is p/h, an impulse that is over, and means nothing over a step of another length. A much longer
    /// step reaches back to times of which the last force knows nothing; there it fades out.
    pub fn set_step(&mut self, step: f64) {
        let old = self.bank.step();
        if old > 0.0 && self.state.steps > 0 {
            let before = self.mechanical_energy();
            self.lasting_force(old, step);
            self.bank.resample(self.settings.scheme, step, &self.displacement_oldest);
            let ratio = step / old;
            for (before, now) in self.state.gap_before.iter_mut().zip(&self.state.gap) {
                if now.is_finite() {
                    *before = now - ratio * (now - *before);
                }
            }
            let after = self.mechanical_energy();
            self.state.ledger.step_change.add(after - before);
            self.state.ledger.turnover.add((after - before).abs());
        } else {
            self.bank.set_step(self.settings.scheme, step);
        }
    }

    /// Leaves in `displacement_oldest` (scratch between steps) the contact forces without those of impacts.
    fn lasting_force(&mut self, old: f64, new: f64) {
        let lanes = self.bank.lanes();
        let reach = (FORCE_REACH * old / new).min(1.0);
        for (lasting, force) in self.displacement_oldest.iter_mut().zip(&self.state.force) {
            *lasting = reach * reach * force;
        }
        for (index, gap) in self.state.gap_before.iter().enumerate() {
            let lasts = *gap <= 0.0 && self.state.gap[index] <= 0.0;
            if !lasts {
                let (node, sector) = (index / lanes, index % lanes);
                for component in 0..3 {
                    self.displacement_oldest[(3 * node + component) * lanes + sector] = 0.0;
                }
            }
        }
    }

    /// Clear history and books, take the present modal state as initial, and evaluate the gaps at `drive`.
    pub fn start(&mut self, drive: &Drive) {
        self.bank.recover();
        self.bank.collect_loss();
        self.state.steps = 0;
        self.state.factorisations = 0;
        self.state.multiplier.fill(0.0);
        self.state.force.fill(0.0);
        self.events.clear();
        self.evaluate_gaps(drive);
        self.state.gap_before.copy_from_slice(&self.state.gap);
        self.state.ledger = Ledger { initial: self.mechanical_energy(), ..Ledger::default() };
    }

    fn mechanical_energy(&self) -> f64 {
        let (kinetic, strain) = self.bank.energies();
        kinetic + strain
    }

    /// Kinetic and strain energy (J).
    pub fn energies(&self) -> (f64, f64) {
        self.bank.energies()
    }

    /// Move the damping loss gathered in the step kernel to the ledger.
    pub fn close_books(&mut self) {
        let loss = self.bank.collect_loss();
        self.state.ledger.damping_loss.add(loss);
    }

    /// One internal step to the instant described by `drive`.
    ///
    /// # Errors
    /// [`StepFailure`]; the state is then not meaningful any more.
    pub fn step(&mut self, drive: &Drive) -> Result<(), StepFailure> {
        self.displacement_oldest.copy_from_slice(self.bank.displacement_before());
        self.bank.predict(self.settings.ledger);
        std::mem::swap(&mut self.gap_oldest, &mut self.state.gap_before);
        std::mem::swap(&mut self.state.gap_before, &mut self.state.gap);
        self.evaluate_gaps(drive);
        self.clear_events();
        for sector in 0..self.bank.sectors() {
            // NaN counts as touching, and is found out there.
            if self.lowest[sector] < 0.0 || self.lowest[sector].is_nan() {
                self.solve_sector(sector, drive)?;
            }
        }
        self.state.steps += 1;
        if self.state.steps.is_multiple_of(FLUSH_EVERY) {
            self.bank.flush();
        }
        Ok(())
    }

    /// Gap of every node, and the smallest of each lane.
    fn evaluate_gaps(&mut self, drive: &Drive) {
        self.law.evaluate(drive, self.bank.displacement(), &mut self.geometry, &mut self.state.gap);
        self.lowest.fill(f64::INFINITY);
        for row in self.state.gap.chunks(self.bank.lanes()) {
            for (lowest, gap) in self.lowest.iter_mut().zip(row) {
                // NaN sticks.
                *lowest = if *lowest <= *gap || lowest.is_nan() { *lowest } else { *gap };
            }
        }
    }

    fn clear_events(&mut self) {
        let lanes = self.bank.lanes();
        for event in &self.events {
            self.state.multiplier[event.node * lanes + event.sector] = 0.0;
            for component in 0..3 {
                self.state.force[(3 * event.node + component) * lanes + event.sector] = 0.0;
            }
        }
        self.events.clear();
    }

    fn solve_sector(&mut self, sector: usize, drive: &Drive) -> Result<(), StepFailure> {
        let (lanes, nodes) = (self.bank.lanes(), self.law.nodes());
        for node in 0..nodes {
            let index = node * lanes + sector;
            let gap = self.state.gap[index];
            if !gap.is_finite() {
                return Err(StepFailure::NonFinite);
            }
            if gap < 0.0 && !self.law.is_plausible(node, gap, self.geometry.normal_at(index)) {
                return Err(StepFailure::Implausible { sector });
            }
            self.problem.gaps[node] = gap;
            // Closed in the last step: the likeliest guess for this one.
            self.problem.active[node] = self.state.gap_before[index] <= 0.0;
        }
        self.fill_delassus(sector, drive);
        let outcome = match self.settings.solver {
            Solver::Film => self.problem.film(),
            Solver::Lcp | Solver::Coulomb => self.problem.lcp(),
        };
        self.state.factorisations += outcome.factorisations as u64;
        if self.problem.multipliers.iter().any(|value| !value.is_finite()) {
            return Err(StepFailure::NonFinite);
        }
        if !outcome.solved {
            return Err(StepFailure::Unsolved { sector });
        }
        self.apply(sector);
        self.record(sector, drive);
        Ok(())
    }

    /// W_ij = n_iᵀ G_ij (n_j − µ t_j).
    fn fill_delassus(&mut self, sector: usize, drive: &Drive) {
        let (lanes, nodes) = (self.bank.lanes(), self.law.nodes());
        for node in 0..nodes {
            let normal = self.geometry.normal_at(node * lanes + sector);
            let mut velocity = self.law.sliding_velocity(node, drive);
            for (component, value) in velocity.iter_mut().enumerate() {
                let row = 3 * node + component;
                *value += (self.bank.row(row, sector) - self.bank.row_before(row, sector)) / self.bank.step();
            }
            self.slip[node] =
                if self.settings.friction > 0.0 { self.law.slip_direction(velocity, normal) } else { [0.0; 3] };
        }
        let flexibility = self.bank.flexibility(sector).as_slice();
        for column in 0..nodes {
            let direction = self.force_direction(column, sector);
            let [first, second, third] =
                std::array::from_fn(|j| &flexibility[(3 * column + j) * 3 * nodes..][..3 * nodes]);
            for row in 0..nodes {
                let normal = self.geometry.normal_at(row * lanes + sector);
                let moved: [f64; 3] = std::array::from_fn(|i| {
                    let at = 3 * row + i;
                    first[at] * direction[0] + second[at] * direction[1] + third[at] * direction[2]
                });
                self.problem.delassus[(row, column)] = dot(normal, moved);
            }
        }
    }

    /// n − µ t: force on the master per unit multiplier.
    fn force_direction(&self, node: usize, sector: usize) -> [f64; 3] {
        let normal = self.geometry.normal_at(node * self.bank.lanes() + sector);
        std::array::from_fn(|i| normal[i] - self.settings.friction * self.slip[node][i])
    }

    fn apply(&mut self, sector: usize) {
        let lanes = self.bank.lanes();
        for node in 0..self.law.nodes() {
            let direction = self.force_direction(node, sector);
            for component in 0..3 {
                self.force[3 * node + component] = self.problem.multipliers[node] * direction[component];
            }
            self.state.gap[node * lanes + sector] = self.problem.gaps[node];
        }
        self.bank.correct(sector, &self.force, self.settings.ledger);
    }

    fn record(&mut self, sector: usize, drive: &Drive) {
        let lanes = self.bank.lanes();
        for node in 0..self.law.nodes() {
            let normal = self.problem.multipliers[node];
            if normal == 0.0 {
                continue;
            }
            let index = node * lanes + sector;
            self.state.multiplier[index] = normal;
            let force = std::array::from_fn(|i| self.force[3 * node + i]);
            for component in 0..3 {
                self.state.force[(3 * node + component) * lanes + sector] = force[component];
            }
            let sliding = dot(self.slip[node], self.slip[node]) > 0.0;
            let tangential = if sliding { self.settings.friction * normal } else { 0.0 };
            let friction_heat = self.book(sector, node, normal, tangential, drive);
            self.events.push(ContactEvent { sector, node, normal, tangential, force, friction_heat });
        }
    }

    /// Enter one contact's work into the ledger; returns its friction heat (J).
    ///
    /// The work on the structure is f·(u⁺ − u⁻)/2. Its normal part splits into what the approach of the node costs
    /// (λ times half the change of gap) and what the moving surface does; its friction part into the heat µλ·slip
    /// and what the prescribed sliding supplies.
    fn book(&mut self, sector: usize, node: usize, normal: f64, tangential: f64, drive: &Drive) -> f64 {
        let lanes = self.bank.lanes();
        let index = node * lanes + sector;
        let moved: [f64; 3] = std::array::from_fn(|component| {
            let row = (3 * node + component) * lanes + sector;
            0.5 * (self.bank.displacement()[row] - self.displacement_oldest[row])
        });
        let closing = -0.5 * normal * (self.state.gap[index] - self.gap_oldest[index]);
        let pushed = normal * dot(self.geometry.normal_at(index), moved) + closing;
        let supplied = tangential * dot(self.slip[node], self.law.sliding_velocity(node, drive)) * self.bank.step();
        let heat = tangential * dot(self.slip[node], moved) + supplied;
        let ledger = &mut self.state.ledger;
        ledger.impact_loss.add(closing);
        ledger.friction_loss.add(heat);
        ledger.external_work.add(pushed + supplied);
        ledger.turnover.add(pushed.abs() + supplied.abs());
        heat
    }

    /// Whether the state is still what the model describes.
    ///
    /// # Errors
    /// Coordinates that are not finite; displacements beyond a tenth of the radius.
    pub fn check_state(&self) -> Result<(), StepFailure> {
        if !self.bank.is_finite() {
            return Err(StepFailure::NonFinite);
        }
        let limit = self.law.largest_displacement();
        let beyond = self.bank.displacement().iter().position(|displacement| displacement.abs() > limit);
        let sector = beyond.map(|index| index % self.bank.lanes());
        sector.map_or(Ok(()), |sector| Err(StepFailure::Implausible { sector }))
    }

    /// Write everything that determines the future, the step size included.
    pub fn save(&self, writer: &mut Writer) {
        self.bank.step().save(writer);
        self.bank.save(writer);
        self.state.save(writer);
    }

    /// Restore a saved state; coefficients are recomputed from the saved step size.
    pub fn restore(&mut self, reader: &mut Reader) {
        let mut step = 0.0_f64;
        step.restore(reader);
        if step > 0.0 {
            self.bank.set_step(self.settings.scheme, step);
        }
        self.bank.restore(reader);
        self.state.restore(reader);
        self.rebuild_events();
    }

    /// The events of the last step follow from the saved multipliers and forces (heat is not part of the future).
    fn rebuild_events(&mut self) {
        let lanes = self.bank.lanes();
        self.events.clear();
        for sector in 0..self.bank.sectors() {
            for node in 0..self.law.nodes() {
                let normal = self.state.multiplier[node * lanes + sector];
                if normal != 0.0 {
                    let force = std::array::from_fn(|i| self.state.force[(3 * node + i) * lanes + sector]);
                    let square = dot(force, force) - normal * normal;
                    let tangential = square.max(0.0).sqrt();
                    self.events.push(ContactEvent { sector, node, normal, tangential, force, friction_heat: 0.0 });
                }
            }
        }
    }
}
