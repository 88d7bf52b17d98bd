//! Structures and contact pairs of a scene, which make up everything that moves. One step is in `step.rs`.

pub(crate) mod carrier;
pub(crate) mod contact_view;
pub(crate) mod continuation;
pub(crate) mod delassus;
mod effort;
pub(crate) mod event;
pub(crate) mod failure;
pub(crate) mod group;
pub(crate) mod history;
pub(crate) mod ledger;
pub(crate) mod losses;
pub(crate) mod nearness;
pub(crate) mod pair;
pub(crate) mod pulling;
pub(crate) mod sets;
pub(crate) mod small;
pub(crate) mod structure;
pub(crate) mod witness;
pub(crate) mod work;

use tiprub_cosim::persist_fields;

use crate::contact::coating::Coating;
use crate::geometry::{GapLaw, PrescribedMotion};
use crate::modes::bank::{BankOptions, ModalBank, SectorModel};
use crate::modes::modal::ModalModel;
use crate::scene::method::{Scheme, Solver};
use crate::system::history::Two;
pub(crate) use contact_view::Bodies;
pub use effort::{Effort, EvaluatedBlocks};
pub use event::ContactEvent;
pub use failure::StepFailure;
use group::Reach;
pub(crate) use group::{ContactGroup, GroupSolution};
pub use ledger::Ledger;
use losses::LargestLosses;
pub use losses::Loss;
use nearness::Nearness;
pub use pair::{ContactPair, PairParts, SurfaceCarrier};
pub(crate) use pair::{SearchStart, ShapeGrowth};
pub use sets::StructureSets;
pub(crate) use sets::joined;
pub use small::Curved;
pub use structure::Structure;

/// A structure that is to become part of a system.
#[derive(Debug, Clone)]
pub enum StructureParts<'a> {
    /// A structure with contact nodes that touch surfaces.
    Touching(SectorModel<'a>, Box<BankOptions>),
    /// A structure that carries surfaces, whose control points have three contact rows each; and whether it has loads in addition
    /// to contact forces.
    Carrying(&'a ModalModel, bool),
}

/// Scheme, solver and options of a system.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SystemSettings {
    /// Time-stepping scheme.
    pub scheme: Scheme,
    /// Contact solver.
    pub solver: Solver,
    /// True if the damping loss is collected, without which the energy balance does not close.
    pub ledger: bool,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct RunTotals {
    /// Number of internal steps.
    pub steps: u64,
    /// Work of adaptive steps.
    pub effort: Effort,
    pub factorisations: u64,
    /// Number of steps after which the gap two steps back belongs to steps of the current size.
    pub witnessed: u64,
    /// Energy balance of each set.
    pub ledgers: Vec<Ledger>,
    /// Largest losses of the contacts of each set so far.
    taken: Vec<LargestLosses>,
}

persist_fields!(RunTotals { steps, effort, factorisations, witnessed, ledgers, taken });

impl RunTotals {
    /// Initial totals of a run.
    fn new(ledgers: Vec<Ledger>) -> Self {
        Self { taken: vec![LargestLosses::default(); ledgers.len()], ledgers, ..Self::default() }
    }
}

/// Part of a run in which all inputs rest and the rotors turn at constant speed. It is divided into spans of equal length
/// from its start. Its steps do not end at communication points.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct SteadyPhase {
    /// True if the run is in a steady phase.
    pub active: bool,
    /// Start of the phase (s).
    pub since: f64,
    /// Length of the spans (s).
    pub span: f64,
}

persist_fields!(SteadyPhase { active, since, span });

/// Structures, the contact pairs between them, and the groups of contacts that can influence each other.
#[derive(Debug, Clone)]
pub struct System {
    pub(crate) structures: Vec<Structure>,
    pub(crate) pairs: Vec<ContactPair>,
    /// Contact groups of the first sets, in the order of the sets.
    pub(crate) groups: Vec<ContactGroup>,
    pub(crate) sets: StructureSets,
    pub(crate) settings: SystemSettings,
    pub(crate) events: Two<Vec<ContactEvent>>,
    pub(crate) counted: RunTotals,
    pub(crate) evaluated: EvaluatedBlocks,
    pub(crate) steady_phase: SteadyPhase,
    /// Energy of each set before a change of the step size (J).
    mechanical: Vec<f64>,
}

impl System {
    /// Creates a system of any number of structures at rest and pairs; `coatings` are those of the pairs. Call [`System::set_step`] and
    /// [`System::start`] before the first step.
    pub fn of(
        parts: Vec<StructureParts>,
        pairs: Vec<PairParts>,
        coatings: Vec<(usize, Coating)>,
        settings: SystemSettings,
    ) -> Self {
        let mut own = vec![Vec::new(); parts.len()];
        pairs.iter().enumerate().for_each(|(index, pair)| own[pair.structure].push(index));
        let mut structures: Vec<Structure> =
            parts.into_iter().zip(&own).map(|(part, own)| made(part, own, &pairs)).collect();
        if !settings.ledger {
            structures.iter_mut().for_each(|structure| structure.modes.skip_losses());
        }
        let pairs: Vec<ContactPair> = pairs.into_iter().map(ContactPair::new).collect();
        let sets = StructureSets::new(&structures, &pairs);
        let mut of_sets: Vec<Option<Coating>> = vec![None; sets.count()];
        // Coated contacts of a set are solved with the first of their coatings.
        for (pair, coating) in coatings {
            of_sets[sets.of(pairs[pair].structure())].get_or_insert(coating);
        }
        allow_skipping(&mut structures, &pairs, |structure| of_sets[sets.of(structure)].is_some());
        let group = |(set, coating): (usize, Option<Coating>)| {
            let (reach, touching) = contact_reach(&structures, &pairs, &sets, set)?;
            let own = sets.pairs(set).iter();
            let mut carriers: Vec<usize> = own.filter_map(|pair| Some(pairs[*pair].carrier()?.structure)).collect();
            carriers.sort_unstable();
            carriers.dedup();
            Some(ContactGroup::new(reach, &touching, &carriers, &structures, settings.solver, coating))
        };
        let groups: Vec<ContactGroup> = of_sets.into_iter().enumerate().filter_map(group).collect();
        let contacts = structures.iter().map(|structure| structure.gaps().len()).sum();
        let room = || Vec::with_capacity(contacts);
        Self {
            groups,
            settings,
            events: Two { now: room(), before: room() },
            counted: RunTotals::new(vec![Ledger::default(); sets.count()]),
            evaluated: EvaluatedBlocks::default(),
            steady_phase: SteadyPhase::default(),
            mechanical: vec![0.0; sets.count()],
            sets,
            structures,
            pairs,
        }
    }

    /// The structures.
    pub fn structures(&self) -> &[Structure] {
        &self.structures
    }

    /// The structures, to set loads and initial conditions before [`System::start`].
    pub fn structures_mut(&mut self) -> &mut [Structure] {
        &mut self.structures
    }

    /// The contact pairs.
    pub fn pairs(&self) -> &[ContactPair] {
        &self.pairs
    }

    /// The coating of a pair.
    pub fn coating(&self, pair: usize) -> Option<&Coating> {
        let structure = self.pairs[pair].structure();
        self.groups.get(self.sets.of(structure))?.law.coating()
    }

    /// Contacts whose forces acted over the last step and whose work was recorded for it: those of that step or, for schemes
    /// whose contact forces act later, those of the previous step.
    pub fn acted(&self) -> &[ContactEvent] {
        self.events.at(self.when_acted())
    }

    /// Active contacts of the last step.
    pub fn events(&self) -> &[ContactEvent] {
        &self.events.now
    }

    /// Modes of the first structure.
    pub fn bank(&self) -> &ModalBank {
        self.structures[0].modes()
    }

    /// Modes of the first structure, to set initial conditions before [`System::start`].
    pub fn bank_mut(&mut self) -> &mut ModalBank {
        self.structures[0].modes_mut()
    }

    /// Gap of one node of one sector of the first structure (m).
    pub fn gap(&self, node: usize, sector: usize) -> f64 {
        self.structures[0].gap(node, sector)
    }

    /// λ of one node of one sector of the first structure in the last step (N).
    pub fn multiplier(&self, node: usize, sector: usize) -> f64 {
        self.structures[0].multiplier(node, sector)
    }

    /// Gaps of all contact nodes of all structures (m); infinite in padding lanes and where there is nothing to touch.
    pub fn gaps(&self) -> impl Iterator<Item = &f64> {
        self.structures.iter().flat_map(Structure::gaps)
    }

    /// Length of the internal step (s).
    pub fn step_size(&self) -> f64 {
        self.structures[0].modes().step()
    }

    /// Returns whether the run is in a steady phase.
    pub(crate) fn is_in_steady_phase(&self) -> bool {
        self.steady_phase.active
    }

    /// Number of internal steps, or of spans if sectors are integrated with adaptive steps.
    pub fn steps(&self) -> u64 {
        self.counted.steps
    }

    /// Returns the work of adaptive steps, summed over all sectors.
    pub fn effort(&self) -> &Effort {
        &self.counted.effort
    }

    /// Returns the evaluated blocks of nodes, summed over all sectors.
    pub fn evaluated_blocks(&self) -> &EvaluatedBlocks {
        &self.evaluated
    }

    /// Number of attempted steps, including accepted ones.
    pub fn steps_tried(&self) -> u64 {
        self.counted.effort.tried()
    }

    /// Number of small linear systems that the contact solver has factorised.
    pub fn factorisations(&self) -> u64 {
        self.counted.factorisations
    }

    /// Work and losses so far, of all structures.
    pub fn ledger(&self) -> Ledger {
        let mut ledgers = self.counted.ledgers.iter().copied();
        let first = ledgers.next().unwrap_or_default();
        ledgers.fold(first, |sum, one| sum.with(&one))
    }

    /// Work and losses so far, of each set of structures that influence each other.
    pub fn ledgers(&self) -> &[Ledger] {
        &self.counted.ledgers
    }

    /// Sets of structures that influence each other.
    pub fn sets(&self) -> &StructureSets {
        &self.sets
    }

    /// Current settings.
    pub fn settings(&self) -> &SystemSettings {
        &self.settings
    }

    /// Sets the friction coefficient of a pair (takes effect with the next step).
    pub(crate) fn set_friction(&mut self, pair: usize, friction: f64) {
        self.pairs[pair].parts.parameters.friction = friction;
    }

    /// Selects scheme and solver; only before [`System::start`]. Allocates if the solver changes.
    pub(crate) fn set_methods(&mut self, scheme: Scheme, solver: Solver) {
        self.settings.scheme = scheme;
        if solver != self.settings.solver {
            self.settings.solver = solver;
            self.groups.iter_mut().for_each(|group| group.set_solver(solver, &self.structures));
        }
    }

    /// Finds the gap of every node and the smallest gap of each lane. If `warm`, the search for closest points starts from those
    /// of the previous step.
    pub(crate) fn find_gaps(&mut self, start: SearchStart) {
        for index in 0..self.pairs.len() {
            self.pairs[index].find_gaps(&mut self.structures, start);
        }
        for structure in &mut self.structures {
            structure.find_lowest();
        }
    }

    /// Finds the gap of every node that may be in contact or that outputs need, and the smallest gap of each lane.
    pub(crate) fn find_near_gaps(&mut self) {
        self.structures.iter_mut().for_each(Structure::keep_geometry);
        for pair in &mut self.pairs {
            pair.find_near_gaps(&mut self.structures);
        }
        self.structures.iter_mut().for_each(Structure::find_lowest);
    }

    /// Makes the contacts of the last step those of the previous step.
    pub(crate) fn retire_events(&mut self) {
        self.events.shift();
        self.events.now.clear();
        if self.groups.iter().any(|group| group.law.starts_from_forces()) {
            self.structures.iter_mut().for_each(|structure| structure.history.keep_forces());
        }
        for event in &self.events.before {
            self.structures[event.structure].forget_force(event.node, event.sector);
        }
    }

    /// Sets the prescribed motion of a pair in the middle of the next step, and the growth of its shape, for methods that need them.
    pub(crate) fn set_middle(&mut self, pair: usize, drive: &PrescribedMotion, growth: ShapeGrowth) {
        self.pairs[pair].middle = (*drive, growth);
    }

    /// Clears history and ledger, uses the current modal state as initial state, and evaluates the gaps with the prescribed
    /// motion `drives`, one per pair.
    pub fn start(&mut self, drives: &[PrescribedMotion]) {
        self.structures.iter_mut().for_each(Structure::start);
        self.steady_phase = SteadyPhase::default();
        self.groups.iter_mut().filter_map(|group| group.law.coating_mut()).for_each(Coating::reset);
        self.events.now.clear();
        self.events.before.clear();
        self.pairs.iter_mut().zip(drives).for_each(|(pair, drive)| pair.start(drive));
        self.find_gaps(SearchStart::Positions);
        for structure in &mut self.structures {
            structure.remember_start();
        }
        let initial = |set| Ledger { initial: self.mechanical_energy(set), ..Ledger::default() };
        self.counted = RunTotals::new((0..self.sets.count()).map(initial).collect());
        self.evaluated = EvaluatedBlocks::default();
    }

    /// Kinetic plus strain energy of a set (J), in the form that the scheme conserves.
    pub(crate) fn mechanical_energy(&self, set: usize) -> f64 {
        let members = self.sets.members(set).iter();
        let (kinetic, strain) = sum_of(members.map(|member| self.conserved_energies(&self.structures[*member])));
        kinetic + strain
    }

    /// Kinetic and strain energy of all structures (J), in the form that the scheme conserves and the energy balance uses.
    pub fn energies(&self) -> (f64, f64) {
        sum_of(self.structures.iter().map(|structure| self.conserved_energies(structure)))
    }

    /// Kinetic and strain energy of a structure (J). In a steady phase, the first number is the sum of both at the starts
    /// of the open steps, to which the ledger belongs, and the second is 0.
    fn conserved_energies(&self, structure: &Structure) -> (f64, f64) {
        if self.steady_phase.active {
            (structure.step_control.energies.iter().sum(), 0.0)
        } else {
            structure.modes().energies()
        }
    }

    /// Makes the current modal state the initial state again, for a first step of another length.
    pub(crate) fn renew_start(&mut self) {
        for set in 0..self.sets.count() {
            self.counted.ledgers[set].initial = self.mechanical_energy(set);
        }
        // Gaps two steps back are not known yet.
        self.counted.witnessed = 2;
    }

    /// Sets speed (rad/s) and temperature (K) of a rotor whose modes depend on them; the change of strain energy is work of the
    /// shaft and of heat.
    pub fn set_speed(&mut self, structure: usize, speed: f64, temperature: f64) {
        let work = self.structures[structure].modes_mut().set_speed(speed, temperature);
        let ledger = &mut self.counted.ledgers[self.sets.of(structure)];
        ledger.stiffening_work.add(work);
        ledger.turnover.add(work.abs());
    }

    /// Moves the damping loss collected in the step kernel to the ledger.
    pub fn close_ledger(&mut self) {
        for (index, structure) in self.structures.iter_mut().enumerate() {
            let ledger = &mut self.counted.ledgers[self.sets.of(index)];
            ledger.damping_loss.add(structure.modes_mut().collect_loss());
        }
    }
}

/// Sums of pairs of energies.
fn sum_of(mut energies: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let first = energies.next().unwrap_or_default();
    energies.fold(first, |sum, one| (sum.0 + one.0, sum.1 + one.1))
}

fn made(part: StructureParts, own: &[usize], pairs: &[PairParts]) -> Structure {
    let (model, options) = match part {
        StructureParts::Carrying(model, loads) => return Structure::carrying(model, loads),
        StructureParts::Touching(model, options) => (model, *options),
    };
    let gaps = || own.iter().map(|pair| (*pair, &pairs[*pair].gap));
    let nodes = gaps().map(|(_, gap)| gap.nodes()).max().unwrap_or(0);
    let mut pair_of = vec![None; nodes];
    for (pair, gap) in gaps() {
        gap.members().into_iter().for_each(|node| pair_of[node] = Some(pair));
    }
    let has_places = gaps().any(|(_, gap)| gap.spline().is_some());
    Structure::touching(model, options, pair_of, has_places)
}

/// Lets structures skip nodes that face surfaces of other structures, if all of these surfaces are smooth rings. `is_coated` returns whether
/// nodes share cells of a coating.
fn allow_skipping(structures: &mut [Structure], pairs: &[ContactPair], is_coated: impl Fn(usize) -> bool) {
    let carried = || pairs.iter().filter(|pair| pair.carrier().is_some());
    for pair in carried() {
        let mut own = carried().filter(|other| other.structure() == pair.structure());
        if own.all(|other| other.gap().smooth_ring().is_some()) && !is_coated(pair.structure()) {
            let structure = &mut structures[pair.structure()];
            structure.nearness = Nearness::new(structure.nodes(), structure.lanes());
        }
    }
}

/// Finds the structures with contact nodes of a set, and how far their contacts are coupled; `None` without contact nodes.
fn contact_reach(
    structures: &[Structure],
    pairs: &[ContactPair],
    sets: &StructureSets,
    set: usize,
) -> Option<(Reach, Vec<usize>)> {
    let members = sets.members(set).iter().copied();
    let touching: Vec<usize> = members.filter(|member| structures[*member].nodes() > 0).collect();
    let first = *touching.first()?;
    let own = || sets.pairs(set).iter().map(|pair| &pairs[*pair]);
    let carried = own().any(|pair| pair.carrier().is_some());
    // Sectors turn relative to a stationary surface; a single structure is one sector with all of its contacts.
    let open = own().any(|pair| pair.structure() == first && matches!(pair.gap(), GapLaw::Open(_)));
    let coupled = carried || structures[first].modes().disk().is_some() || open;
    Some((if coupled { Reach::All } else { Reach::Sector }, touching))
}
