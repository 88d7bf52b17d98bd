//! One internal step: prediction, gaps, correction (section 4.3 of the paper), and the ledger kept on the way.

mod continuation;
mod group;
mod slave;
mod small;
mod witness;
mod work;

use crate::contact::coating::{CoatedProblem, Coating};
use crate::contact::coulomb::CoulombSolver;
use crate::contact::gap::{Drive, GapLaw, Geometry, dot};
use crate::contact::solver::ContactSolver;
use crate::contact::spline_gap::Frame;
use crate::contact::wrench::{Motion, Wrench};
use crate::dynamics::bank::BankOptions;
use crate::dynamics::modal::ModalModel;
use crate::dynamics::sectors::{SectorModel, Sectors};
use crate::ledger::Ledger;
use crate::persist::persist_fields;
use crate::settings::{Scheme, Solver};
pub use group::{Member, Solution};
pub use slave::Slave;
pub use small::Curved;

/// Denormals are flushed every this many steps.
const FLUSH_EVERY: u64 = 512;

/// One active contact of the last step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactEvent {
    /// Sector (0-based).
    pub sector: usize,
    /// Contact node (0-based).
    pub node: usize,
    /// Multiplier λ: normal force (N).
    pub normal: f64,
    /// Magnitude of the friction force (N): µλ against slip, less where the contact sticks; 0 without slip.
    pub tangential: f64,
    /// Force on the master (N) in the coordinates of its displacements.
    pub force: [f64; 3],
    /// What tells the contact point, see [`GapLaw::contact_point`].
    pub point: [f64; 3],
    /// The force in fixed directions, its moment, and where it acts.
    pub wrench: Wrench,
    /// Part of λ that a coating carries (N).
    pub coating: f64,
    /// Friction heat of the step (J).
    pub friction_heat: f64,
}

impl ContactEvent {
    fn new(
        (sector, node): (usize, usize),
        normal: f64,
        force: [f64; 3],
        coating: f64,
        (point, wrench): ([f64; 3], Wrench),
    ) -> Self {
        let square = dot(force, force) - normal * normal;
        // What rounding leaves of a frictionless contact is no friction.
        let tangential = if square > 1e-14 * normal * normal { square.sqrt() } else { 0.0 };
        Self { sector, node, normal, tangential, force, point, wrench, coating, friction_heat: 0.0 }
    }
}

/// What only some scenes need; what is off takes neither time nor memory.
#[derive(Debug, Clone, Default)]
pub struct SystemParts {
    /// Options of the master's modes.
    pub bank: BankOptions,
    /// Modes of each structure that carries a slave surface, one contact row per component of every control point, and
    /// whether it is loaded beside contact: at most one with [`GapLaw::Spline`], those that the surfaces of
    /// [`GapLaw::Free`] name, none with other gap functions.
    pub slaves: Vec<(ModalModel, bool)>,
    /// Abradable coating.
    pub coating: Option<Coating>,
    /// The solver may be [`Solver::Coulomb`].
    pub sticking: bool,
}

/// Why a step failed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StepFailure {
    /// A displacement or gap became infinite or NaN.
    NonFinite,
    /// A node is displaced or penetrates by more than a tenth of its radius, or meets a flank of the casing steeper than
    /// 45°; of a free master, by more than a tenth of the extent of the contact nodes.
    Implausible {
        /// Sector (0-based).
        sector: usize,
    },
    /// A structure that carries a slave surface is displaced by more than a tenth of the radius, or of the extent.
    CasingImplausible,
    /// A contact node of a free master moves by more than a tenth of the extent in one step: it could pass a surface unseen.
    TooFast,
    /// A node of a free master comes over a free edge and is behind the surface already.
    BehindEdge {
        /// Contact node (0-based).
        node: usize,
    },
    /// Normals turn and surfaces curve so far within steps that this adds energy which no input brings.
    Unbalanced {
        /// What it has added (J).
        work: f64,
        /// All energy exchanged (J).
        exchanged: f64,
    },
    /// A node moves so far around the axis that what linear kinematics misses is as large as its clearance.
    Curved(Curved),
    /// A node has left a surface around an axis over its edge, further than the surface goes on.
    OutOfReach {
        /// Contact node (0-based).
        node: usize,
        /// Sector (0-based).
        sector: usize,
    },
    /// A gap has changed by more than the motion of node and surface explains: it is not a distance.
    Unexplained {
        /// Contact node (0-based).
        node: usize,
        /// Sector (0-based).
        sector: usize,
        /// Change of the gap over two steps (m).
        jump: f64,
        /// What motion can explain of it (m).
        explained: f64,
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
    /// Part of λ that the coating carries (N); empty without one.
    coating_force: Vec<f64>,
    /// Displacement of the contact rows as the last step predicted it (m); of massless-boundary alone, whose prediction is
    /// that of the modes with inertia.
    predicted: Vec<f64>,
    /// Normals and places of the last step.
    geometry: Geometry,
    /// Contact points of the last step as [`GapLaw::contact_point`] tells them, `[row · lanes + lane]`.
    points: Vec<f64>,
    /// Prescribed motion at the last step, and over it.
    drive: Drive,
    motion: Motion,
    /// Steps done when the gap two steps back was first one of steps of this size.
    witnessed: u64,
    ledger: Ledger,
}

persist_fields!(SystemState {
    steps,
    factorisations,
    gap,
    gap_before,
    multiplier,
    force,
    coating_force,
    predicted,
    geometry,
    points,
    drive,
    motion,
    witnessed,
    ledger
});

/// Modes, gap function and contact solver put together.
#[derive(Debug, Clone)]
pub struct System {
    bank: Sectors,
    /// Lanes of a row of the sectors.
    lanes: usize,
    /// All contacts form one group: through slaves, the disk, or as those of one free structure.
    coupled: bool,
    slaves: Vec<Slave>,
    law: GapLaw,
    settings: SystemSettings,
    problem: ContactSolver,
    coulomb: Option<CoulombSolver>,
    coating: Option<(Coating, CoatedProblem)>,
    events: Vec<ContactEvent>,
    events_before: Vec<ContactEvent>,
    lowest: Vec<f64>,
    /// The group being solved, sector by sector.
    members: Vec<Member>,
    chosen: Vec<bool>,
    row_directions: Vec<[f64; 3]>,
    column_directions: Vec<[f64; 3]>,
    solution: Solution,
    corrected: Vec<f64>,
    coating_share: Vec<f64>,
    /// Change of all gaps by the solution of a coupled group.
    response: Vec<f64>,
    /// Forces on the members of a group of a disk.
    member_forces: Vec<[f64; 3]>,
    /// Contact force on the rows of one sector.
    force: Vec<f64>,
    /// Contact force of the step before on all rows; only where it is needed.
    force_before: Vec<f64>,
    /// Fixed-frame angles of the nodes of one blade.
    angles: Vec<f64>,
    gap_oldest: Vec<f64>,
    geometry_before: Geometry,
    drive_before: Drive,
    displacement_oldest: Vec<f64>,
    predicted_before: Vec<f64>,
    state: SystemState,
}

/// Directions of a node's own frame at a rotor angle (rad); the fixed ones where nothing turns.
#[inline(always)]
fn frame_of(law: &GapLaw, index: usize, rotor_angle: f64) -> Frame {
    law.layout().map_or(Frame::FIXED, |layout| Frame::new(layout.angles[index] + rotor_angle))
}

impl System {
    /// All sectors at rest against something rigid. [`System::set_step`] and [`System::start`] come before the first step.
    pub fn new(model: &ModalModel, sectors: usize, law: GapLaw, settings: SystemSettings) -> Self {
        let sticking = settings.solver == Solver::Coulomb;
        let parts = SystemParts { sticking, ..SystemParts::default() };
        Self::with_parts(SectorModel::Uncoupled(model, sectors), law, settings, parts)
    }

    /// The same with coupled sectors, or with parts that only some scenes need.
    pub fn with_parts(model: SectorModel, law: GapLaw, settings: SystemSettings, parts: SystemParts) -> Self {
        let bank = Sectors::new(model, parts.bank);
        let (sectors, lanes, nodes) = (bank.sectors(), bank.lanes(), law.nodes());
        let contacts = nodes * lanes;
        let coupled = !parts.slaves.is_empty() || bank.coupled().is_some() || matches!(law, GapLaw::Free(_));
        let group = if coupled { nodes * sectors } else { nodes };
        let directions = if parts.sticking { 3 } else { 1 };
        let coating = parts.coating.map(|coating| {
            let problem = coating.problem(group / nodes);
            (coating, problem)
        });
        Self {
            slaves: parts.slaves.iter().map(|(model, loads)| Slave::new(model, *loads, group, directions)).collect(),
            problem: ContactSolver::new(group),
            coulomb: parts.sticking.then(|| CoulombSolver::new(group)),
            events: Vec::with_capacity(contacts),
            events_before: Vec::with_capacity(contacts),
            lowest: vec![0.0; lanes],
            members: Vec::with_capacity(group),
            chosen: vec![false; if coupled { contacts } else { 0 }],
            row_directions: vec![[0.0; 3]; directions * group],
            column_directions: vec![[0.0; 3]; directions * group],
            solution: Solution::new(directions * group),
            corrected: vec![0.0; group],
            coating_share: vec![0.0; group],
            response: vec![0.0; if coupled { contacts } else { 0 }],
            member_forces: vec![[0.0; 3]; if bank.coupled().is_some() { group } else { 0 }],
            force: vec![0.0; 3 * nodes],
            force_before: vec![0.0; 3 * contacts],
            angles: vec![0.0; nodes],
            gap_oldest: vec![f64::INFINITY; contacts],
            geometry_before: law.geometry(lanes),
            drive_before: Drive::default(),
            displacement_oldest: vec![0.0; 3 * contacts],
            predicted_before: vec![0.0; 3 * contacts],
            state: SystemState {
                steps: 0,
                factorisations: 0,
                // Padding lanes keep an infinite gap.
                gap: vec![f64::INFINITY; contacts],
                gap_before: vec![f64::INFINITY; contacts],
                multiplier: vec![0.0; contacts],
                force: vec![0.0; 3 * contacts],
                coating_force: vec![0.0; contacts],
                predicted: vec![0.0; 3 * contacts],
                geometry: law.geometry(lanes),
                points: vec![0.0; 3 * contacts],
                drive: Drive::default(),
                motion: Motion::default(),
                witnessed: 0,
                ledger: Ledger::default(),
            },
            bank,
            lanes,
            coupled,
            law,
            settings,
            coating,
        }
    }

    /// Normals and places of the last step.
    pub fn geometry(&self) -> &Geometry {
        &self.state.geometry
    }

    /// Prescribed motion at the last step.
    pub fn drive(&self) -> &Drive {
        &self.state.drive
    }

    /// The structure that carries the slave surface; of several the first.
    pub fn slave(&self) -> Option<&Slave> {
        self.slaves.first()
    }

    /// The structures that carry slave surfaces.
    pub fn slaves(&self) -> &[Slave] {
        &self.slaves
    }

    /// The same, to set loads and initial conditions.
    pub fn slaves_mut(&mut self) -> &mut [Slave] {
        &mut self.slaves
    }

    /// The coating.
    pub fn coating(&self) -> Option<&Coating> {
        self.coating.as_ref().map(|(coating, _)| coating)
    }

    /// Contacts whose forces acted over the last step, and whose work was entered for it: those of that step, or with
    /// massless-boundary those of the step before.
    pub fn acted(&self) -> &[ContactEvent] {
        if self.is_delayed() { &self.events_before } else { &self.events }
    }

    /// Contact forces act one step after they were found.
    fn is_delayed(&self) -> bool {
        self.settings.scheme == Scheme::MasslessBoundary
    }

    /// The modes.
    pub fn bank(&self) -> &Sectors {
        &self.bank
    }

    /// The modes, to set initial conditions before [`System::start`].
    pub fn bank_mut(&mut self) -> &mut Sectors {
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
        self.state.gap[node * self.lanes + sector]
    }

    /// Rate of that gap over the last step (m/s); 0 where there was or is nothing to touch.
    pub fn gap_rate(&self, node: usize, sector: usize) -> f64 {
        let index = node * self.lanes + sector;
        let change = self.state.gap[index] - self.state.gap_before[index];
        if change.is_finite() { change / self.bank.step() } else { 0.0 }
    }

    /// λ of one node of one sector in the last step (N).
    pub fn multiplier(&self, node: usize, sector: usize) -> f64 {
        self.state.multiplier[node * self.lanes + sector]
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

    /// Clear history and ledger, take the present modal state as initial, and evaluate the gaps at `drive`.
    pub fn start(&mut self, drive: &Drive) {
        self.bank.recover();
        self.bank.collect_loss();
        self.slaves.iter_mut().for_each(Slave::start);
        if let Some((coating, _)) = &mut self.coating {
            coating.reset();
        }
        self.state.steps = 0;
        self.state.factorisations = 0;
        self.state.multiplier.fill(0.0);
        self.state.force.fill(0.0);
        self.state.coating_force.fill(0.0);
        self.events.clear();
        self.events_before.clear();
        self.state.points.fill(0.0);
        (self.state.drive, self.state.motion) = (*drive, Motion::default());
        self.evaluate_gaps(drive, false);
        self.state.gap_before.copy_from_slice(&self.state.gap);
        self.state.witnessed = 0;
        self.state.predicted.copy_from_slice(self.bank.displacement());
        self.state.ledger = Ledger { initial: self.mechanical_energy(), ..Ledger::default() };
    }

    fn mechanical_energy(&self) -> f64 {
        let (kinetic, strain) = self.energies();
        kinetic + strain
    }

    /// Kinetic and strain energy of all structures (J), in the quantity the scheme conserves and the ledger closes with.
    pub fn energies(&self) -> (f64, f64) {
        let slaves = self.slaves.iter().map(|slave| slave.bank.energies());
        slaves.fold(self.bank.energies(), |sum, slave| (sum.0 + slave.0, sum.1 + slave.1))
    }

    /// Follow the speed of the rotor (rad/s) where its modes depend on it; the strain energy this adds is work of the
    /// shaft.
    pub fn set_speed(&mut self, speed: f64) {
        let work = self.bank.set_speed(speed);
        self.state.ledger.stiffening_work.add(work);
        self.state.ledger.turnover.add(work.abs());
    }

    /// Move the damping loss gathered in the step kernel to the ledger.
    pub fn close_ledger(&mut self) {
        let loss = self.bank.collect_loss();
        self.state.ledger.damping_loss.add(loss);
        for slave in &mut self.slaves {
            self.state.ledger.damping_loss.add(slave.bank.collect_loss());
        }
    }

    /// One internal step to the instant described by `drive`.
    ///
    /// # Errors
    /// [`StepFailure`]; the state is then not meaningful any more.
    pub fn step(&mut self, drive: &Drive) -> Result<(), StepFailure> {
        let (delayed, ledger) = (self.is_delayed(), self.settings.ledger);
        self.displacement_oldest.copy_from_slice(self.bank.displacement_before());
        self.bank.predict(ledger);
        self.slaves.iter_mut().for_each(|slave| slave.predict(delayed, ledger));
        if delayed {
            self.act_delayed();
            std::mem::swap(&mut self.predicted_before, &mut self.state.predicted);
            self.state.predicted.copy_from_slice(self.bank.displacement());
        }
        std::mem::swap(&mut self.gap_oldest, &mut self.state.gap_before);
        std::mem::swap(&mut self.state.gap_before, &mut self.state.gap);
        std::mem::swap(&mut self.geometry_before, &mut self.state.geometry);
        self.drive_before = std::mem::replace(&mut self.state.drive, *drive);
        let motion = Motion::between(&self.drive_before, drive, self.bank.step());
        self.law.turn(motion.turn);
        self.check_travel()?;
        self.evaluate_gaps(drive, true);
        self.check_edges()?;
        self.retire_events();
        if self.coupled {
            self.solve_coupled(drive)?;
        } else {
            self.solve_sectors(drive)?;
        }
        self.witness(drive, &motion)?;
        self.book_all(&motion);
        self.state.motion = motion;
        self.finish_loads();
        self.state.steps += 1;
        if self.state.steps.is_multiple_of(FLUSH_EVERY) {
            self.bank.flush();
            self.slaves.iter_mut().for_each(|slave| slave.bank.flush());
        }
        Ok(())
    }

    /// Contact forces of the last step act on the modes with inertia.
    fn act_delayed(&mut self) {
        // A disk of coupled sectors keeps its forces until it predicts.
        let Sectors::Uncoupled(bank) = &mut self.bank else { return };
        let lanes = bank.lanes();
        for sector in 0..bank.sectors() {
            for (row, force) in self.force.iter_mut().enumerate() {
                *force = self.state.force[row * lanes + sector];
            }
            if self.force.iter().any(|force| *force != 0.0) {
                bank.act_delayed(sector, &self.force, self.settings.ledger);
            }
        }
    }

    fn finish_loads(&mut self) {
        let mut work = self.bank.finish_loads();
        for slave in &mut self.slaves {
            work += slave.bank.finish_loads();
        }
        if work != 0.0 {
            self.state.ledger.load_work.add(work);
            self.state.ledger.turnover.add(work.abs());
        }
    }

    /// Gap of every node, and the smallest of each lane.
    fn evaluate_gaps(&mut self, drive: &Drive, warm: bool) {
        let moved = self.slaves.first().map_or(&[][..], |slave| slave.bank.displacement());
        if let GapLaw::Free(law) = &mut self.law {
            for surface in &mut law.surfaces {
                if let Some(carrier) = surface.carrier {
                    surface.follow(self.slaves[carrier].bank.displacement());
                }
            }
        }
        let before = warm.then_some(&self.geometry_before);
        let state = &mut self.state;
        self.law.evaluate(drive, self.bank.displacement(), moved, before, &mut state.geometry, &mut state.gap);
        self.lowest.fill(f64::INFINITY);
        for row in self.state.gap.chunks(self.lanes) {
            for (lowest, gap) in self.lowest.iter_mut().zip(row) {
                // NaN sticks.
                *lowest = if *lowest <= *gap || lowest.is_nan() { *lowest } else { *gap };
            }
        }
    }

    /// The contacts of the last step become those of the step before.
    fn retire_events(&mut self) {
        let lanes = self.lanes;
        if self.settings.solver == Solver::Coulomb {
            self.force_before.copy_from_slice(&self.state.force);
        }
        std::mem::swap(&mut self.events, &mut self.events_before);
        for event in &self.events_before {
            self.state.multiplier[event.node * lanes + event.sector] = 0.0;
            self.state.coating_force[event.node * lanes + event.sector] = 0.0;
            for component in 0..3 {
                self.state.force[(3 * event.node + component) * lanes + event.sector] = 0.0;
            }
        }
        self.events.clear();
    }
}
