//! Saved states: a header that identifies the scene, the payload, and a checksum.
//!
//! Layout, little-endian: magic (8 bytes), format version (u64), scene fingerprint (u64), payload, hash of all
//! preceding bytes (u64).

use tiprub_cosim::persist::{Persist, StateReader, StateWriter, check_length, damaged, fingerprint};
use tiprub_cosim::variables::Causality;
use tiprub_cosim::{VariableValues, persist_fields};

use super::clock::{Clock, SAME_STEP, SimulationPhase};
use super::inputs::Inputs;
use super::window::StepWindow;
use super::{Compiled, Simulation};
use crate::Result;

const MAGIC: [u8; 8] = *b"tiprubST";
const VERSION: u64 = 18;
pub(super) const CHECKSUM_BYTES: usize = 8;
/// Upper bound on all values of a structure and of its ledger, in any unit; squares and products stay far from overflow.
const LARGEST: f64 = 1e50;

/// Everything beside the system that a run continues from.
#[derive(Debug, Clone)]
pub(crate) struct SimulationState {
    pub inputs: Inputs,
    pub clock: Clock,
    /// All variables with their current values.
    pub values: VariableValues,
    /// Values at the previous communication point, for derivatives.
    pub previous: Vec<f64>,
    /// Speed (rad/s) and temperature (K) at which each master has its stiffness.
    pub references: Vec<[f64; 2]>,
    /// Kinetic plus strain energy of each set of structures at the start (J).
    pub initial_energies: Vec<f64>,
    pub window: StepWindow,
}

persist_fields!(SimulationState { inputs, clock, values, previous, references, initial_energies, window });

impl SimulationState {
    /// Checks saved bytes, with sums of forces up to `largest`. Returns the number of infinite values of inputs, whose validity depends on
    /// the values.
    fn check_bytes(&self, reader: &mut StateReader, largest: f64) -> usize {
        let Self { inputs, clock, values, previous, references, initial_energies, window } = self;
        inputs.check(reader);
        let infinite = reader.infinite();
        let numbers: [&dyn Persist; 5] = [clock, values, previous, references, initial_energies];
        numbers.into_iter().for_each(|part| part.check(reader));
        reader.up_to(largest);
        window.check(reader);
        infinite
    }

    /// Checks that inputs are within their ranges, with a margin for rounding, now and at the end of the current step.
    fn check_inputs(&self) -> Result<()> {
        let clock = &self.clock;
        let stepping = clock.is_stepping() && clock.step.count > 0;
        let offsets = if stepping { [clock.offset_now(), clock.step.length] } else { [0.0; 2] };
        let mut angles = self.inputs.rotors.iter().flat_map(|rotor| offsets.map(|offset| rotor.total_angle(offset)));
        if !angles.all(f64::is_finite) {
            return damaged("the rotor angle is not finite");
        }
        for variable in self.values.table().variables().iter().filter(|variable| variable.causality == Causality::Input)
        {
            let (low, high) = (variable.min.unwrap_or(f64::MIN), variable.max.unwrap_or(f64::MAX));
            let rounding = SAME_STEP * low.abs().max(high.abs());
            for element in 0..variable.len() {
                let Some(input) = self.inputs.get(variable.quantity, variable.of, element) else { continue };
                let beyond = |offset: f64| (low - input.at(offset)).max(input.at(offset) - high);
                if !offsets.into_iter().all(|offset| input.at(offset).is_finite() && beyond(offset) <= rounding) {
                    return damaged(format!("`{}` is outside its range", variable.element_name(element)));
                }
            }
        }
        Ok(())
    }

    /// Checks the motion that the inputs cause, including inputs that this scene does not list.
    fn check_drives(&self, compiled: &Compiled) -> Result<()> {
        let moves = |pair: usize, offset: f64| {
            let drive = self.drive(compiled, pair, [offset, self.clock.time]);
            let single = [drive.speed, drive.gap_offset, drive.shape_factor, drive.shape_rotation, drive.radius_change];
            let mut all = single.iter().chain(&drive.shaft).chain(&drive.shaft_velocity);
            all.all(|value| value.abs() <= LARGEST)
        };
        let mut pairs = 0..self.inputs.pairs.len();
        if pairs.all(|pair| moves(pair, 0.0) && moves(pair, self.clock.step.length)) {
            return Ok(());
        }
        damaged("an input causes a motion that is out of range")
    }
}

impl Simulation {
    pub(super) fn measured_state(&self) -> usize {
        let mut writer = StateWriter::new(&mut []);
        self.write(&mut writer);
        writer.written() + CHECKSUM_BYTES
    }

    pub(super) fn write(&self, writer: &mut StateWriter) {
        [u64::from_le_bytes(MAGIC), VERSION, self.compiled.fingerprint].save(writer);
        self.state.save(writer);
        self.system.save(writer);
    }

    /// Restores a state of this simulation with the same parameters. Does not allocate.
    pub(super) fn restore_from(&mut self, mark: &[u8]) {
        let reader = &mut StateReader::new(mark);
        // Magic, version, scene.
        [0_u64; 3].restore(reader);
        self.state.restore(reader);
        self.stepper.restore(&mut self.system, reader);
    }

    /// Implements [`tiprub_cosim::CoSimulation::restore_state`].
    pub(super) fn restore_checked(&mut self, buffer: &[u8]) -> Result<()> {
        check_length(buffer.len(), self.state_size, "this scene")?;
        let (content, checksum) = buffer.split_at(buffer.len() - CHECKSUM_BYTES);
        if content[..MAGIC.len()] != MAGIC {
            return damaged("it was not saved by tiprub");
        }
        let mut reader = StateReader::new(&content[MAGIC.len()..]);
        let mut header = [0_u64; 2];
        header.restore(&mut reader);
        let [version, scene] = header;
        if version != VERSION {
            return damaged(format!("it has format version {version}, but this library reads version {VERSION}"));
        }
        if scene != self.compiled.fingerprint {
            return damaged("it belongs to a different scene or ROM");
        }
        if fingerprint(content, 0).to_le_bytes() != checksum {
            return damaged("its checksum does not match, so the data was changed");
        }
        let mut state = self.state.clone();
        let mut system = reader.clone();
        state.restore(&mut system);
        let internal_step = self.check_state(&state, reader)?;
        let before = std::mem::replace(&mut self.state, state);
        if let Err(error) = self.follow_state(internal_step) {
            self.state = before;
            return damaged(error);
        }
        self.state.references = self.compiled.references();
        // Step data that depends on parameters follows from the restored values.
        let parameters = self.parameters();
        self.rest(&parameters);
        if self.diagnostics.is_prepared(&parameters) {
            self.apply_friction(&parameters);
        } else {
            self.apply_methods(&parameters);
        }
        self.stepper.restore(&mut self.system, &mut system);
        self.renew_limits();
        self.make_room();
        self.make_room_for_tangent();
        if self.is_in_step() {
            self.set_mark();
        }
        Ok(())
    }

    /// Checks a whole state, which was read from bytes. The checksum finds accidental damage; bytes with a correct checksum may still be a
    /// state that no simulation can continue from. Returns the internal step (s).
    fn check_state(&self, state: &SimulationState, mut reader: StateReader) -> Result<f64> {
        // Before the start and after a failure a state may contain any values, since no step continues from it.
        let runs = matches!(state.clock.phase, SimulationPhase::Ready | SimulationPhase::Stepping);
        let largest = if runs { LARGEST } else { f64::INFINITY };
        let inputs = self.state.check_bytes(&mut reader, largest);
        let (step, endless) = self.system.check(&mut reader, runs);
        if let Some(fault) = reader.fault() {
            return damaged(fault);
        }
        // There are three kinds of gaps: current, previous step, and lowest.
        let endless = self.system.infinite_gap_count(&state.window.all_lowest()).map(|lowest| lowest + endless);
        if runs && endless != Some(reader.infinite() - inputs) {
            return damaged("it contains a number that is not finite");
        }
        if !state.clock.is_consistent(step, state.values[self.compiled.references.step_max]) {
            return damaged("its times and step counters contradict each other");
        }
        state.values.check_values()?;
        state.check_inputs()?;
        Ok(step)
    }

    /// Applies orders, speeds and temperatures of a state that was read, with internal steps of a length (s). Nothing changes if it is
    /// rejected.
    fn follow_state(&mut self, internal_step: f64) -> Result<()> {
        // Before initialisation nothing has been computed from the parameters, and inconsistent ones are not rejected yet.
        if self.state.clock.is_created() {
            return Ok(());
        }
        if self.state.clock.phase != SimulationPhase::Failed {
            self.state.check_drives(&self.compiled)?;
        }
        if self.is_in_step() {
            // Checked when a step begins and when a speed is set, not in every internal step.
            let length = self.state.clock.step.length;
            for (index, pair) in self.compiled.plan.pairs.iter().enumerate() {
                let rotation = self.state.inputs.pairs[index].shape_rotation.rate();
                let speed = &self.state.inputs.rotors[pair.body].speed;
                self.check_turning(index, internal_step, length, speed, rotation)?;
            }
        }
        let parameters = self.parameters();
        self.compiled.scene.check_methods(parameters.scheme, parameters.solver)?;
        let orders: Vec<u32> = self.compiled.carriers.iter().map(|carrier| carrier.load_order).collect();
        let references = self.state.references.clone();
        // The previous orders were accepted before.
        self.follow_load_orders().and_then(|()| self.follow_reference_speeds(&references)).inspect_err(|_| {
            for (carrier, order) in orders.into_iter().enumerate() {
                drop(self.compiled.set_load_order(carrier, f64::from(order)));
            }
        })
    }

    /// Sets the mark to which [`Simulation::withdraw`] returns. Does not allocate.
    pub(super) fn set_mark(&mut self) {
        let mut mark = std::mem::take(&mut self.mark);
        if !mark.is_empty() {
            self.write(&mut StateWriter::new(&mut mark));
        }
        self.mark = mark;
    }

    /// Returns to the mark, with the same parameters. Does not allocate.
    pub(super) fn withdraw(&mut self) {
        let mark = std::mem::take(&mut self.mark);
        self.restore_from(&mark);
        self.mark = mark;
        self.tangent.forget();
    }
}
