//! State of all modes of all sectors, and the steps of all sectors together.
//!
//! Modes belong to groups that interact in contact only: uncoupled sectors, or the nodal diameters of a disk of coupled sectors,
//! whose amplitudes have a real and an imaginary part. Groups are SIMD lanes in chunks of `width` lanes; within a chunk the modes
//! follow each other, `state[((chunk · modes + mode) · parts + part) · width + lane]`. If a group has fewer modes than others, or is
//! padding of the last chunk, the coefficients of the additional modes are 0. One pass predicts (eq. 9 of the paper without contact),
//! recovers the displacements of the contact rows and sums the damping loss while a chunk is in registers; there is no horizontal
//! sum. Contact forces are then applied to the few sectors in contact, or to the [`Disk`].

mod coefficients;
mod correction;
mod coupling;
mod disk;
mod energy;
mod excited;
mod heated;
mod motion;
pub(crate) mod predict;
mod span;
pub(crate) mod surface;

use nalgebra::DMatrix;
use tiprub_cosim::persist::{Persist, StateReader, StateWriter};
use tiprub_cosim::persist_fields;

use super::cyclic::CyclicModel;
use super::excitation::{Excitation, ModalExcitation};
use super::modal::{ModalModel, ModalSpin, Oscillator};
use crate::math::simd::InstructionSet;
use crate::modes::schemes::{ModeCoefficients, Velocity};
use crate::scene::method::Scheme;
use coupling::Coupling;
pub use disk::Disk;
use heated::HeatLoads;
use surface::FlexibilityColumns;

/// Lanes of one chunk: one 512-bit register of f64.
pub(crate) const LANES: usize = 8;

/// Amplitudes below this are periodically set to zero: damped modes without load would decay into denormals.
const FLUSH_BELOW: f64 = 1e-150;

/// Number of lanes of a displacement row for this many sectors: rounded up to whole chunks, except for a single structure.
pub fn lanes(sectors: usize) -> usize {
    if sectors == 1 { 1 } else { sectors.div_ceil(LANES) * LANES }
}

/// Modes of the sectors.
#[derive(Debug, Clone, Copy)]
pub enum SectorModel<'a> {
    /// Modes of one uncoupled sector, and the number of sectors.
    Uncoupled(&'a ModalModel, usize),
    /// Modes of the whole disk.
    Coupled(&'a CyclicModel),
}

/// Optional features of a bank; a feature that is off takes neither time nor memory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BankOptions {
    /// Factor on the frequencies of every sector (mistuning); empty if all sectors are tuned.
    pub frequency_factors: Vec<f64>,
    /// True if there are modal loads in addition to contact forces: centrifugal growth, heat, nodal-diameter loads.
    pub loads: bool,
    /// Free expansion per kelvin in modal coordinates; empty without heat.
    pub expansion: Vec<f64>,
    /// Spin in modal coordinates, and which effects couple the modes: (stiffening, coriolis).
    pub coupling: Option<(ModalSpin, bool, bool)>,
    /// Loads of an engine order.
    pub excitation: Option<Excitation>,
    /// True if G = Φ diag(c) Φᵀ is not computed as a whole, because the structure has many contact rows.
    pub uses_modes: bool,
}

/// All state variables, except those of a [`Disk`].
#[derive(Debug, Clone, PartialEq)]
struct BankState {
    /// q at the current step.
    position: Vec<f64>,
    /// d = q − q⁻.
    increment: Vec<f64>,
    /// Displacements of the contact rows at the current step, `[row][lane]`.
    displacement: Vec<f64>,
    /// Displacements of the contact rows one step earlier, `[row][lane]`.
    displacement_before: Vec<f64>,
    /// Damping loss per group since the last collection (J).
    loss: Vec<f64>,
    /// Modal loads of the previous step; empty without loads.
    modal_load_before: Vec<f64>,
    /// Forces of the excitation in the previous step (N); empty without excitation.
    excited_before: Vec<f64>,
    /// Speed of the coupling (rad/s).
    speed: f64,
    /// Temperature of the structure (K).
    temperature: f64,
    /// Thermal loads of the previous step, for a sector without a factor; empty if all sectors are equal.
    heat_before: Vec<f64>,
    /// Change of the stiffness of quasi-static modes since the last step, relative to their stiffness; empty without softening.
    stiffened: Vec<f64>,
}

persist_fields!(BankState {
    position,
    increment,
    displacement,
    displacement_before,
    loss,
    modal_load_before,
    excited_before,
    speed,
    temperature,
    heat_before,
    stiffened
});

/// Coefficients of the special pass per mode and lane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct BankCoefficients {
    beta: f64,
    kappa: f64,
    /// Displacement per unit modal load; 0 in padding lanes.
    load: f64,
    loss: f64,
}

/// Identical sectors in modal coordinates, uncoupled or coupled to a disk, stepped together.
#[derive(Debug, Clone)]
pub struct ModalBank {
    /// Instruction set of the hot loops.
    pub(crate) instruction_set: InstructionSet,
    /// Modes of one sector; of coupled sectors, those of nodal diameter 0.
    model: ModalModel,
    pub(crate) options: BankOptions,
    sectors: usize,
    /// Number of groups: sectors or nodal diameters.
    groups: usize,
    /// Number of modes of a group; the largest number if the groups differ.
    modes: usize,
    /// Number of parts of an amplitude: 2 if it has a real and an imaginary part, otherwise 1.
    parts: usize,
    width: usize,
    chunks: usize,
    /// Number of lanes of a displacement row.
    lanes: usize,
    rows: usize,
    /// `[mode][row]`.
    contact_modes: Vec<f64>,
    /// `[row][mode]`.
    contact_rows: Vec<f64>,
    /// Number of sets of coefficients: one for all sectors, or one per sector with mistuning or per nodal diameter.
    pub(crate) sets: usize,
    /// Coefficients, `[set][mode]`; the default for modes that a group does not have.
    coefficients: Vec<ModeCoefficients>,
    /// Velocity coefficients, `[set][mode]`; quasi-static modes have none.
    velocities: Vec<Velocity>,
    /// True if the damping loss is collected.
    with_loss: bool,
    lane_coefficients: Vec<BankCoefficients>,
    /// G per set: displacement of the contact rows per unit force held for one step (m/N), rows × rows.
    flexibility: Vec<DMatrix<f64>>,
    /// Columns of G of a structure with many contact rows.
    columns: FlexibilityColumns,
    coupling: Option<Coupling>,
    excitation: Option<ModalExcitation>,
    heat: Option<HeatLoads>,
    disk: Option<Disk>,
    scheme: Scheme,
    step: f64,
    /// True if the damping ratios have changed since the coefficients were computed.
    coefficients_outdated: bool,
    state: BankState,
    /// Modal loads of the current step.
    modal_load: Vec<f64>,
    /// Increments of the previous step.
    increment_before: Vec<f64>,
    /// Scratch: modal forces on the current group, `[mode][part]`.
    modal_force: Vec<f64>,
    /// Scratch: change of the modal coordinates of the current sector.
    correction: Vec<f64>,
    /// Scratch: displacements of the rows of one sector by contact forces, and all displacements of its rows.
    moved: Vec<f64>,
    row_values: Vec<f64>,
    /// Scratch: modal coordinates and increments of one sector.
    gathered: [Vec<f64>; 2],
}

impl ModalBank {
    /// Creates a bank with all sectors at rest; call [`ModalBank::set_step`] before stepping.
    ///
    /// # Panics
    /// If coupled sectors get options that they do not support: mistuning, or spin that couples modes.
    pub fn new(model: SectorModel, options: BankOptions) -> Self {
        let (model, sectors, disk) = match model {
            SectorModel::Uncoupled(model, sectors) => (model.clone(), sectors, None),
            SectorModel::Coupled(disk) => {
                assert!(
                    options.frequency_factors.is_empty() && options.coupling.is_none(),
                    "coupled sectors support neither mistuning nor spin coupling"
                );
                (disk.paired(0), disk.sectors, Some(Disk::new(disk)))
            }
        };
        let coupled = disk.as_ref().map(Disk::model);
        let groups = coupled.map_or(sectors, |disk| disk.diameters.len());
        let (modes, parts) = coupled.map_or((model.len(), 1), |disk| (disk.most_modes(), 2));
        let width = if sectors == 1 && coupled.is_none() { 1 } else { LANES };
        let (rows, chunks) = (model.contact_modes.nrows(), groups.div_ceil(width));
        let (state_len, lanes) = (chunks * modes * parts * width, lanes(sectors));
        let sets = if coupled.is_none() && options.frequency_factors.is_empty() { 1 } else { groups };
        let special = coupled.is_none() && (options.loads || sets > 1);
        let load_len = |is_there: bool| if is_there { model.len() } else { 0 };
        let coupling = options
            .coupling
            .clone()
            .map(|(spin, stiffening, coriolis)| Coupling::new(spin, stiffening, coriolis, &options.frequency_factors));
        let heat = HeatLoads::new(&options.expansion, &options.frequency_factors);
        let softening = coupling.as_ref().is_some_and(Coupling::softens);
        let excitation =
            options.excitation.map(|excitation| ModalExcitation::new(excitation, &model, coupled, sectors));
        Self {
            instruction_set: InstructionSet::detect(),
            sectors,
            groups,
            modes,
            parts,
            width,
            chunks,
            lanes,
            rows,
            contact_modes: model.contact_modes.as_slice().to_vec(),
            contact_rows: model.contact_modes.transpose().as_slice().to_vec(),
            sets,
            coefficients: vec![ModeCoefficients::default(); sets * modes],
            velocities: vec![Velocity::default(); sets * modes],
            with_loss: true,
            lane_coefficients: vec![BankCoefficients::default(); if special { state_len } else { 0 }],
            flexibility: vec![
                DMatrix::zeros(rows, rows);
                if !options.uses_modes && coupled.is_none() { sets } else { 0 }
            ],
            columns: FlexibilityColumns::new(if options.uses_modes { rows } else { 0 }),
            scheme: Scheme::default(),
            step: 0.0,
            coefficients_outdated: true,
            state: BankState {
                position: vec![0.0; state_len],
                increment: vec![0.0; state_len],
                displacement: vec![0.0; rows * lanes],
                displacement_before: vec![0.0; rows * lanes],
                loss: vec![0.0; chunks * width],
                modal_load_before: vec![0.0; load_len(options.loads)],
                excited_before: vec![0.0; excitation.as_ref().map_or(0, |excitation| excitation.now.len())],
                speed: coupling.as_ref().map_or(0.0, |coupling| coupling.speed),
                temperature: coupling.as_ref().map_or(0.0, |coupling| coupling.temperature),
                heat_before: vec![0.0; heat.as_ref().map_or(0, |heat| heat.now.len())],
                stiffened: vec![0.0; if softening { model.quasi_static.min(modes) } else { 0 }],
            },
            modal_load: vec![0.0; load_len(special || options.loads)],
            increment_before: vec![0.0; state_len],
            modal_force: vec![0.0; modes * parts],
            correction: vec![0.0; modes],
            moved: vec![0.0; rows],
            row_values: vec![0.0; rows],
            gathered: [vec![0.0; modes], vec![0.0; modes]],
            coupling,
            excitation,
            heat,
            disk,
            options,
            model,
        }
    }

    /// Stops collecting the damping loss, which takes time.
    pub(crate) fn skip_losses(&mut self) {
        self.with_loss = false;
    }

    /// Number of sectors.
    pub fn sectors(&self) -> usize {
        self.sectors
    }

    /// Number of lanes of a displacement row: sectors rounded up to whole chunks.
    #[inline(always)]
    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// Number of contact rows of a sector (3 per contact node).
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of modes of one sector; of coupled sectors, the largest number of modes of a nodal diameter.
    pub fn modes(&self) -> usize {
        self.modes
    }

    /// Modes of one sector; of coupled sectors, those of nodal diameter 0.
    pub fn model(&self) -> &ModalModel {
        &self.model
    }

    /// Returns the coupling of the sectors; `None` if they are uncoupled.
    #[inline(always)]
    pub fn disk(&self) -> Option<&Disk> {
        self.disk.as_ref()
    }

    /// Returns the coupling of the sectors, for computing the effects of forces; `None` if they are uncoupled.
    #[inline(always)]
    pub(crate) fn disk_mut(&mut self) -> Option<&mut Disk> {
        self.disk.as_mut()
    }

    /// Step size of the current coefficients (s).
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Index of the set of coefficients of a group.
    pub(crate) fn set_of(&self, group: usize) -> usize {
        if self.sets == 1 { 0 } else { group }
    }

    /// Coefficients of the modes of one group.
    pub fn coefficients(&self, group: usize) -> &[ModeCoefficients] {
        &self.coefficients[self.set_of(group) * self.modes..][..self.modes]
    }

    /// Flexibility of the contact rows of one uncoupled sector over one step (m/N), rows × rows; not symmetric with Coriolis forces.
    pub fn flexibility(&self, sector: usize) -> &DMatrix<f64> {
        &self.flexibility[self.set_of(sector)]
    }

    /// Displacement of one contact row of an uncoupled sector per unit of each modal coordinate.
    pub fn contact_row(&self, row: usize) -> &[f64] {
        &self.contact_rows[row * self.modes..][..self.modes]
    }

    /// Displacements of the contact rows at the current step (m), `[row][lane]`.
    #[inline(always)]
    pub fn displacement(&self) -> &[f64] {
        &self.state.displacement
    }

    /// Displacements of the contact rows one step earlier (m), `[row][lane]`.
    #[inline(always)]
    pub fn displacement_before(&self) -> &[f64] {
        &self.state.displacement_before
    }

    /// Displacement of one contact row of one sector (m).
    #[inline(always)]
    pub fn row(&self, row: usize, sector: usize) -> f64 {
        self.state.displacement[row * self.lanes + sector]
    }

    /// Displacement of one contact row of one sector one step earlier (m).
    #[inline(always)]
    pub fn row_before(&self, row: usize, sector: usize) -> f64 {
        self.state.displacement_before[row * self.lanes + sector]
    }

    /// Index of the real part of a mode of a group; the imaginary part is `width` entries later.
    fn index(&self, mode: usize, group: usize) -> usize {
        (group / self.width * self.modes + mode) * self.parts * self.width + group % self.width
    }

    /// Returns a mode of a group, if there is one.
    fn oscillator(&self, mode: usize, group: usize) -> Option<Oscillator> {
        match &self.disk {
            Some(disk) => disk.model().diameters[group].oscillator(mode, 1.0),
            None => self.model.oscillator(mode, self.factor(group)),
        }
    }

    /// Factor on the frequencies of a sector.
    fn factor(&self, sector: usize) -> f64 {
        self.options.frequency_factors.get(sector).copied().unwrap_or(1.0)
    }

    /// Angular frequency of a mode of an uncoupled sector (rad/s).
    pub(crate) fn frequency(&self, mode: usize, sector: usize) -> f64 {
        self.model.frequencies[mode] * self.factor(sector)
    }

    /// Modal loads of the next step, on every sector or on nodal diameter 0. Set them before [`ModalBank::predict`].
    pub fn loads_mut(&mut self) -> &mut [f64] {
        &mut self.modal_load
    }

    /// Number of groups, starting with the first, on which the modal loads act. Loads rotate with a disk, so they act
    /// only on its nodal diameter 0.
    fn loaded_groups(&self) -> usize {
        if self.disk.is_some() { 1 } else { self.sectors }
    }
}

/// Everything but the step size, which [`ModalBank::set_step`] sets before a state is restored.
impl Persist for ModalBank {
    fn save(&self, writer: &mut StateWriter) {
        self.state.save(writer);
        if let Some(disk) = &self.disk {
            self.increment_before.save(writer);
            disk.state.save(writer);
        }
    }
    fn restore(&mut self, reader: &mut StateReader) {
        self.state.restore(reader);
        if let Some(disk) = &mut self.disk {
            self.increment_before.restore(reader);
            disk.state.restore(reader);
        }
        let BankState { speed, temperature, .. } = self.state;
        let has_changed = self.coupling.as_ref().is_some_and(|coupling| !coupling.matches(speed, temperature));
        if has_changed && self.step > 0.0 {
            self.refresh_coupling();
        }
    }
    fn check(&self, reader: &mut StateReader) {
        self.state.check(reader);
        if let Some(disk) = &self.disk {
            self.increment_before.check(reader);
            disk.state.check(reader);
        }
    }
}

#[cfg(test)]
mod tests;
