//! One structure: its modes, its contact nodes and their history, and the forces on surfaces that it carries.

use tiprub_cosim::persist_fields;
use tiprub_cosim::variables::NO_CLEARANCE;

use crate::geometry::{Geometry, Vector3};
use crate::math::vector::{set_strided_vector3, strided_vector3, vector3_at};
use crate::modes::bank::{BankOptions, LANES, ModalBank, SectorModel};
use crate::modes::modal::ModalModel;
use crate::scene::method::Scheme;
use crate::system::contact_view::ContactMember;
use crate::system::history::ContactHistory;
use crate::system::nearness::Nearness;
use crate::system::pulling::Pulling;

/// Penetrations below this count as zero (m): the squares of the resulting values leave the range of double precision, and such
/// small modes are set to rest.
const LEAST_PENETRATION: f64 = 1e-150;

/// Value of a gap that is unknown because no output needs it (m). It is finite because saved states contain finite numbers only.
pub(crate) const UNKNOWN_GAP: f64 = NO_CLEARANCE;

/// A structure of a scene. Rows of its modes are three per contact node, or three per control point of the surfaces it carries.
#[derive(Debug, Clone)]
pub struct Structure {
    pub(crate) modes: ModalBank,
    /// Lanes of a row of the sectors.
    lanes: usize,
    /// Pair of each contact node.
    pub(crate) pair_of: Vec<Option<usize>>,
    /// History of the contact nodes.
    pub(crate) history: ContactHistory,
    /// Impulses on the contact nodes, if forces may pull.
    pub(crate) pulling: Pulling,
    /// Smallest gap of each lane (m).
    pub(crate) lowest: Vec<f64>,
    /// Modal contact force on its surfaces found in the last step (N·√kg⁻¹); empty if it carries none.
    pub(crate) delayed: Vec<f64>,
    /// Step control of each sector, for adaptive steps of single sectors.
    pub(crate) step_control: StepControl,
    /// Smallest gaps within the last span (m), `[node · lanes + lane]`, if the scheme evaluates them; otherwise empty.
    pub(crate) lowest_in_span: Vec<f64>,
    /// Selection of the smallest gaps that outputs need.
    pub(crate) needed_minima: NeededMinima,
    /// True for sectors whose state is read at communication points; empty if the state of every sector is read.
    read_sectors: Vec<bool>,
    /// Bounds of gaps that are not evaluated in every step.
    pub(crate) nearness: Nearness,
}

/// Smallest gaps within spans that outputs need. The stored values of other smallest gaps may be too large.
///
/// The smallest gap of each node over all sectors is always needed.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct NeededMinima {
    /// For each sector, true if the smallest gaps of all of its nodes are needed; empty if this holds for every sector.
    pub of_sectors: Vec<bool>,
    /// True if the smallest gap of each sector over all of its nodes is needed.
    pub by_sector: bool,
}

impl NeededMinima {
    /// Returns whether the smallest gaps of all nodes of a sector are needed.
    pub fn all_of(&self, sector: usize) -> bool {
        self.of_sectors.get(sector).copied().unwrap_or(true)
    }

    /// Returns whether an output depends on the gaps of a sector even if other sectors have smaller gaps.
    pub fn depends_on(&self, sector: usize) -> bool {
        self.by_sector || self.all_of(sector)
    }
}

/// State of adaptive steps for all sectors.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StepControl {
    /// Energy bank of contacts that opened and closed (J).
    pub bank: Vec<f64>,
    /// Largest energy so far, the reference for the bank (J).
    pub largest: Vec<f64>,
    /// Number of halvings of the span, for each sector.
    pub level: Vec<u64>,
    /// Slopes of contact forces over the last step (N/s), `[row · lanes + lane]`.
    pub slopes: Vec<f64>,
    /// Normals for which the contact forces were found, `[row · lanes + lane]`.
    pub normals: Vec<f64>,
    /// Open steps of the sectors in a steady phase, one after the other, each as numbers in SI units.
    pub open_steps: Vec<f64>,
    /// Energies at the starts of the open steps (J).
    pub energies: Vec<f64>,
    /// Kinetic and strain energies of each sector at the last communication point of a steady phase (J).
    pub energies_now: Vec<f64>,
}

// Everything that determines the future, except the step size; it is restored after the step size has been set.
persist_fields!(Structure { history, modes, delayed, step_control, pulling, nearness, .. });
persist_fields!(StepControl { bank, largest, level, slopes, normals, open_steps, energies, energies_now });

impl StepControl {
    fn new(sectors: usize, contacts: usize) -> Self {
        Self {
            bank: vec![0.0; sectors],
            largest: vec![0.0; sectors],
            level: vec![0; sectors],
            slopes: vec![0.0; 3 * contacts],
            normals: vec![0.0; 3 * contacts],
            open_steps: Vec::new(),
            energies: vec![0.0; sectors],
            energies_now: Vec::new(),
        }
    }
}

impl Structure {
    /// Creates a structure with contact nodes, the pair of each node, and whether one of these pairs finds places on a surface.
    pub(crate) fn touching(
        model: SectorModel,
        options: BankOptions,
        pair_of: Vec<Option<usize>>,
        has_places: bool,
    ) -> Self {
        Self::new(ModalBank::new(model, options), pair_of, has_places, Vec::new())
    }

    /// Creates a structure that carries surfaces, whose control points the rows of `model` move; `loads`: with loads in addition
    /// to contact forces.
    pub(crate) fn carrying(model: &ModalModel, loads: bool) -> Self {
        let options = BankOptions { loads, uses_modes: true, ..BankOptions::default() };
        let modes = ModalBank::new(SectorModel::Uncoupled(model, 1), options);
        Self::new(modes, Vec::new(), false, vec![0.0; model.len()])
    }

    fn new(modes: ModalBank, pair_of: Vec<Option<usize>>, has_places: bool, delayed: Vec<f64>) -> Self {
        let (contacts, rows) = (pair_of.len() * modes.lanes(), modes.rows() * modes.lanes());
        let touches = !pair_of.is_empty();
        Self {
            history: ContactHistory::new(Geometry::new(contacts, has_places), contacts, rows),
            pulling: Pulling::new(pair_of.len()),
            lowest: vec![f64::INFINITY; if touches { modes.lanes() } else { 0 }],
            delayed,
            step_control: StepControl::new(if touches { modes.sectors() } else { 0 }, contacts),
            lowest_in_span: Vec::new(),
            needed_minima: NeededMinima::default(),
            read_sectors: Vec::new(),
            nearness: Nearness::default(),
            pair_of,
            lanes: modes.lanes(),
            modes,
        }
    }

    /// Modes of the structure.
    pub fn modes(&self) -> &ModalBank {
        &self.modes
    }

    /// Modes of the structure, to set loads and initial conditions.
    pub fn modes_mut(&mut self) -> &mut ModalBank {
        &mut self.modes
    }

    /// Number of contact nodes per sector; 0 if it only carries surfaces.
    pub fn nodes(&self) -> usize {
        self.pair_of.len()
    }

    /// Returns whether the structure carries a surface.
    pub fn carries(&self) -> bool {
        !self.delayed.is_empty()
    }

    /// Returns the bank of modes, if sectors are not coupled.
    pub(crate) fn bank(&self) -> Option<&ModalBank> {
        self.modes.disk().is_none().then_some(&self.modes)
    }

    /// Lanes of a row of the sectors.
    #[inline(always)]
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Index of a node of a sector in arrays over all nodes and sectors.
    #[inline(always)]
    pub fn index(&self, node: usize, sector: usize) -> usize {
        node * self.lanes + sector
    }

    /// Returns the contacts of a sector; `structure` is the index of this structure.
    pub(crate) fn contacts(&self, structure: usize, sector: usize) -> impl Iterator<Item = ContactMember> {
        let pairs = self.pair_of.iter().enumerate().filter_map(|(node, pair)| Some((node, (*pair)?)));
        pairs.map(move |(node, pair)| ContactMember { structure, pair, node, sector, index: self.index(node, sector) })
    }

    /// Returns the contact at an index of the arrays over all nodes and lanes; `structure` is the index of this structure.
    pub(crate) fn contact_at(&self, structure: usize, index: usize) -> Option<ContactMember> {
        let (node, sector) = (index / self.lanes, index % self.lanes);
        Some(ContactMember { structure, pair: self.pair_of[node]?, node, sector, index })
    }

    /// Gaps at the current step (m), `[node · lanes + lane]`; padding lanes are infinite.
    pub fn gaps(&self) -> &[f64] {
        &self.history.gap.now
    }

    /// Gaps that were evaluated at the current step (m), as [`Structure::gaps`]; infinite for nodes whose gap is a lower bound.
    pub(crate) fn evaluated_gaps(&self) -> impl Iterator<Item = f64> {
        let gaps = self.history.gap.now.iter().enumerate();
        gaps.map(|(index, gap)| if self.nearness.is_skipped(index) { f64::INFINITY } else { *gap })
    }

    /// Selects the smallest gaps that are needed: the gap of every node of the sectors `watched` (1-based) and, if
    /// `by_sector`, the smallest gap of each sector.
    pub(crate) fn need_minima(&mut self, watched: &[usize], by_sector: bool) {
        let of_sectors = (1..=self.modes.sectors()).map(|sector| watched.contains(&sector)).collect();
        self.needed_minima = NeededMinima { of_sectors, by_sector };
    }

    /// Requires the state of only the sectors `watched` (1-based) at communication points.
    pub(crate) fn require_states_of(&mut self, watched: &[usize]) {
        self.read_sectors = (1..=self.modes.sectors()).map(|sector| watched.contains(&sector)).collect();
    }

    /// Returns whether the state of a sector is read at communication points.
    pub(crate) fn needs_state(&self, sector: usize) -> bool {
        self.read_sectors.get(sector).copied().unwrap_or(true)
    }

    /// Smallest gaps within the last step (m), as far as the scheme evaluates them, `[node · lanes + lane]`.
    pub(crate) fn lowest_gaps(&self) -> &[f64] {
        if self.lowest_in_span.is_empty() { &self.history.gap.now } else { &self.lowest_in_span }
    }

    /// Gap of one node of one sector (m).
    pub fn gap(&self, node: usize, sector: usize) -> f64 {
        self.history.gap.now[self.index(node, sector)]
    }

    /// Rate of the gap of one node of one sector over the last step (m/s); 0 if there was or is nothing to touch.
    pub fn gap_rate(&self, node: usize, sector: usize) -> f64 {
        let index = self.index(node, sector);
        let change = self.history.gap.now[index] - self.history.gap.before[index];
        if change.is_finite() { change / self.modes.step() } else { 0.0 }
    }

    /// λ of one node of one sector in the last step (N).
    pub fn multiplier(&self, node: usize, sector: usize) -> f64 {
        self.history.multiplier[self.index(node, sector)]
    }

    /// Normals and closest points of the last step.
    pub fn geometry(&self) -> &Geometry {
        &self.history.geometry.now
    }

    /// Modal forces on its surfaces found in the last step; empty if it carries none.
    pub fn contact_force(&self) -> &[f64] {
        &self.delayed
    }

    /// Makes the current values the previous ones, before a step of a method that finds them within the step.
    pub(crate) fn begin_span(&mut self) {
        self.history.geometry.shift();
        self.begin_interval();
    }

    /// Begins an interval of a steady phase, in which normals and closest points are not found.
    pub(crate) fn begin_interval(&mut self) {
        self.history.gap.shift();
        self.modes.begin_span();
    }

    /// Three components of a node of a sector from an array over rows.
    #[inline(always)]
    pub(crate) fn vector3(&self, rows: &[f64], node: usize, sector: usize) -> Vector3 {
        strided_vector3(rows, 3 * node * self.lanes + sector, self.lanes)
    }

    /// Starts without earlier contact, from the current modal state.
    pub(crate) fn start(&mut self) {
        self.modes.recover();
        self.modes.collect_loss();
        self.delayed.fill(0.0);
        self.history.clear();
        self.pulling.clear();
        self.nearness.clear();
        self.step_control.bank.fill(0.0);
        self.step_control.largest.fill(0.0);
        self.step_control.level.fill(0);
        self.step_control.slopes.fill(0.0);
        self.step_control.normals.fill(0.0);
        self.step_control.open_steps.fill(0.0);
        self.step_control.energies_now.fill(0.0);
    }

    /// Uses gaps and predictions at the start as those of the previous steps.
    pub(crate) fn remember_start(&mut self) {
        let ContactHistory { gap, predicted, .. } = &mut self.history;
        gap.before.copy_from_slice(&gap.now);
        let rows = predicted.now.len();
        predicted.now.copy_from_slice(&self.modes.displacement()[..rows]);
    }

    /// Predicts one step (eq. 9 of the paper). If contact forces act one step later, those of the last step act now.
    pub(crate) fn predict(&mut self, scheme: Scheme) {
        self.history.shift(self.modes.displacement_before());
        self.modes.predict();
        if scheme.properties().delays_contact {
            self.act_later();
            self.history.predicted.shift();
            let touching = self.history.predicted.now.len();
            self.history.predicted.now.copy_from_slice(&self.modes.displacement()[..touching]);
        }
        self.delayed.fill(0.0);
    }

    /// Applies the contact forces of the last step to the modes with inertia.
    fn act_later(&mut self) {
        // A disk of coupled sectors keeps its forces until it predicts.
        if self.modes.disk().is_some() {
            return;
        }
        if self.delayed.iter().any(|force| *force != 0.0) {
            self.modes.act_delayed_modal(0, &self.delayed);
        }
        if !self.pair_of.is_empty() {
            self.modes.act_delayed(&self.history.force.now);
        }
    }

    /// Sets the contact force on a node to zero.
    pub(crate) fn forget_force(&mut self, node: usize, sector: usize) {
        let (index, lanes) = (self.index(node, sector), self.lanes);
        self.history.multiplier[index] = 0.0;
        self.history.coating_force[index] = 0.0;
        set_strided_vector3(&mut self.history.force.now, 3 * node * lanes + sector, lanes, Vector3::zeros());
    }

    /// Finds the smallest gap of each lane; NaN is kept.
    pub(crate) fn find_lowest(&mut self) {
        self.lowest.fill(f64::INFINITY);
        for row in self.history.gap.now.chunks(self.lanes) {
            for (lowest, gap) in self.lowest.iter_mut().zip(row) {
                *lowest = if *lowest <= *gap || lowest.is_nan() { *lowest } else { *gap };
            }
        }
    }

    /// Includes the current gaps in the smallest gaps within the last span.
    pub(crate) fn include_gaps_now(&mut self) {
        let ends = self.lowest_in_span.iter_mut().zip(&self.history.gap.now);
        ends.for_each(|(lowest, gap)| *lowest = lowest.min(*gap));
    }

    /// Returns the first sector from `first` on in which a node penetrates. NaN counts as penetrating, so that the solver reports it.
    #[inline(always)]
    pub(crate) fn touching_from(&self, first: usize) -> Option<usize> {
        // Eight sectors per iteration, most of which are open.
        let open = |gap: &f64| *gap >= -LEAST_PENETRATION;
        let mut start = first;
        for chunk in self.lowest.get(first..)?.chunks(LANES) {
            if !chunk.iter().fold(true, |all, gap| all & open(gap)) {
                return chunk.iter().position(|gap| !open(gap)).map(|later| start + later);
            }
            start += chunk.len();
        }
        None
    }

    /// Largest displacement of a control point (m).
    pub(crate) fn largest_displacement(&self) -> f64 {
        let rows = self.modes.displacement();
        let square = |point: usize| vector3_at(rows, point).norm_squared();
        (0..rows.len() / 3).map(square).fold(0.0, f64::max).sqrt()
    }
}
