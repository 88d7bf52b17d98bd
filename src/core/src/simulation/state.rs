//! Saved states: a header that identifies the scene, the payload, and a checksum.
//!
//! Layout, little-endian: magic (8 bytes), format version (u64), scene fingerprint (u64), payload, FNV-1a checksum of all preceding bytes
//! (u64).

use tiprub_cosim::persist::{Persist, StateReader, StateWriter, fingerprint};
use tiprub_cosim::variables::Causality;
use tiprub_cosim::{persist_fields, shown};

use super::drive::RotorAngle;
use super::{Communication, Inputs, MOST_STEPS, SAME_STEP, Simulation, SimulationPhase, TIME_TOLERANCE, same_step};
use crate::{Error, Result};

const MAGIC: [u8; 8] = *b"tiprubST";
const VERSION: u64 = 13;
const CHECKSUM_BYTES: usize = 8;

persist_fields!(Communication { start, length, count, done, tried, most });

impl Persist for SimulationPhase {
    fn save(&self, writer: &mut StateWriter) {
        let code: u64 = match self {
            Self::Created => 0,
            Self::Ready => 1,
            Self::Stepping => 2,
            Self::Failed => 3,
        };
        code.save(writer);
    }
    fn restore(&mut self, reader: &mut StateReader) {
        let mut code = 0_u64;
        code.restore(reader);
        *self = match code {
            0 => Self::Created,
            1 => Self::Ready,
            2 => Self::Stepping,
            3 => Self::Failed,
            _ => return reader.refuse("its phase is unknown"),
        };
    }
    fn check(&self, reader: &mut StateReader) {
        (*self).clone().restore(reader);
    }
}

/// Upper bound on all values of a structure and of its ledger, in any unit; squares and products stay far from overflow.
const LARGEST: f64 = 1e50;

/// First part of a state, which determines the rest: read and checked before any change.
struct Lead {
    phase: SimulationPhase,
    time: f64,
    /// Start of the run (s), from which shapes grow.
    initial_time: f64,
    communication: Communication,
    inputs: Inputs,
    rotors: Vec<RotorAngle>,
    values: Vec<f64>,
    /// Reference speed of each master (rad/s), and its temperature (K).
    reference_speeds: Vec<f64>,
    reference_temperatures: Vec<f64>,
    /// Internal step (s).
    step: f64,
}

fn damaged<T>(problem: impl std::fmt::Display) -> Result<T> {
    Err(Error::state(problem))
}

impl Simulation {
    pub(super) fn measured_state(&self) -> usize {
        let mut writer = StateWriter::new(&mut []);
        self.write(&mut writer);
        writer.written() + CHECKSUM_BYTES
    }

    /// Implements [`CoSimulation::save_state`].
    pub(super) fn save_to(&self, buffer: &mut [u8]) -> Result<()> {
        self.check_size(buffer.len())?;
        let end = buffer.len() - CHECKSUM_BYTES;
        self.write(&mut StateWriter::new(&mut buffer[..end]));
        let checksum = fingerprint(&buffer[..end], 0);
        buffer[end..].copy_from_slice(&checksum.to_le_bytes());
        Ok(())
    }

    /// Implements [`CoSimulation::restore_state`].
    pub(super) fn restore_checked(&mut self, buffer: &[u8]) -> Result<()> {
        self.check_size(buffer.len())?;
        let (content, checksum) = buffer.split_at(buffer.len() - CHECKSUM_BYTES);
        if content[..MAGIC.len()] != MAGIC {
            return damaged("it was not saved by tiprub");
        }
        let mut reader = StateReader::new(&content[MAGIC.len()..]);
        let (mut version, mut scene) = (0_u64, 0_u64);
        version.restore(&mut reader);
        scene.restore(&mut reader);
        if version != VERSION {
            return damaged(format!("it has format version {version}, but this library reads version {VERSION}"));
        }
        if scene != self.compiled.fingerprint {
            return damaged("it belongs to a different scene or ROM");
        }
        if fingerprint(content, 0).to_le_bytes() != checksum {
            return damaged("its checksum does not match, so the data was changed");
        }
        let lead = self.lead(reader.clone())?;
        self.follow(lead)?;
        self.read(&mut reader);
        Ok(())
    }

    fn check_size(&self, found: usize) -> Result<()> {
        let expected = self.state_size;
        if found == expected {
            return Ok(());
        }
        damaged(format!("it has {found} bytes, but this scene needs {expected}"))
    }

    fn write(&self, writer: &mut StateWriter) {
        u64::from_le_bytes(MAGIC).save(writer);
        VERSION.save(writer);
        self.compiled.fingerprint.save(writer);
        self.phase.save(writer);
        self.time.save(writer);
        self.initial_time.save(writer);
        self.initial_energies.save(writer);
        self.communication.save(writer);
        self.previous_length.save(writer);
        self.most_tried.save(writer);
        self.inputs.save(writer);
        self.rotors.save(writer);
        self.window.save(writer);
        self.values.save(writer);
        self.previous.save(writer);
        self.compiled.bodies.iter().for_each(|body| body.reference_speed.save(writer));
        self.compiled.bodies.iter().for_each(|body| body.reference_temperature.save(writer));
        self.system.save(writer);
    }

    /// Checks a whole state. The checksum finds accidental damage; bytes with a correct checksum may still be a state that no simulation
    /// can continue from. The order is that of `write`.
    fn lead(&self, mut reader: StateReader) -> Result<Lead> {
        let reader = &mut reader;
        let mut lead = Lead {
            phase: self.phase,
            time: 0.0,
            initial_time: 0.0,
            communication: Communication::default(),
            inputs: self.inputs.clone(),
            rotors: self.rotors.clone(),
            values: self.values.to_vec(),
            reference_speeds: vec![0.0; self.rotors.len()],
            reference_temperatures: vec![0.0; self.rotors.len()],
            step: 0.0,
        };
        lead.phase.restore(reader);
        // Before the start and after a failure a state may contain any values, since no step continues from it.
        let runs = matches!(lead.phase, SimulationPhase::Ready | SimulationPhase::Stepping);
        let largest = if runs { LARGEST } else { f64::INFINITY };
        take(&mut lead.time, reader);
        take(&mut lead.initial_time, reader);
        self.initial_energies.check(reader);
        take(&mut lead.communication, reader);
        self.previous_length.check(reader);
        self.most_tried.check(reader);
        // Values of inputs are checked where they are read.
        let others = reader.infinite();
        take(&mut lead.inputs, reader);
        let infinite = reader.infinite() - others;
        take(&mut lead.rotors, reader);
        reader.up_to(largest);
        let mut window = self.window.clone();
        take(&mut window, reader);
        reader.up_to(f64::MAX);
        take(&mut lead.values, reader);
        self.previous.check(reader);
        take(&mut lead.reference_speeds, reader);
        take(&mut lead.reference_temperatures, reader);
        reader.up_to(largest);
        let endless;
        (lead.step, endless) = self.system.check(reader, runs);
        if let Some(fault) = reader.fault() {
            return damaged(fault);
        }
        // There are three kinds of gaps: current, previous step, and lowest.
        let endless = self.system.infinite_gap_count(&window.all_lowest()).map(|lowest| lowest + endless);
        if runs && endless != Some(reader.infinite() - infinite) {
            return damaged("it contains a number that is not finite");
        }
        self.check_counts(&lead)?;
        self.check_values(&lead.values)?;
        self.check_inputs(&mut lead)?;
        Ok(lead)
    }

    /// Checks that times, step sizes and counts are consistent.
    fn check_counts(&self, lead: &Lead) -> Result<()> {
        if lead.phase == SimulationPhase::Created {
            return if lead.time.is_finite() { Ok(()) } else { damaged("its time is not finite") };
        }
        let Communication { start, length, count, done, .. } = lead.communication;
        #[expect(clippy::cast_precision_loss, reason = "checked to be at most 2^53")]
        let number = count as f64;
        let (ends, within) = match lead.phase {
            SimulationPhase::Ready => (done == count, lead.time.to_bits() == lead.communication.time(count).to_bits()),
            phase => {
                (done < count || phase == SimulationPhase::Failed, (lead.time - start).abs() <= TIME_TOLERANCE * length)
            }
        };
        // A first step may begin before the start by this tolerance.
        let started = lead.initial_time.is_finite() && lead.initial_time <= lead.time + TIME_TOLERANCE * length;
        let counted = started && lead.time.is_finite() && (1.0..=MOST_STEPS).contains(&number) && done <= count && ends;
        let largest = lead.values[self.compiled.references.step_max];
        let internal = if length > 0.0 { length / number } else { largest };
        let same = if length > 0.0 { same_step(start, length) } else { SAME_STEP };
        let divided = (0.0..=f64::MAX).contains(&length)
            && (lead.step - internal).abs() <= 2.0 * same * internal
            && lead.step <= largest * (1.0 + 2.0 * same);
        if counted && within && divided { Ok(()) } else { damaged("its times and step counters contradict each other") }
    }

    /// Checks that parameters and inputs could have been set, and outputs could have been read.
    fn check_values(&self, values: &[f64]) -> Result<()> {
        for variable in self.values.table().variables() {
            let values = &values[variable.reference as usize..][..variable.len()];
            if let Some(value) = values.iter().find(|value| !variable.can_have(**value)) {
                return damaged(format!("`{}` has the invalid value {}", variable.name, shown(*value)));
            }
        }
        Ok(())
    }

    /// Checks that inputs are within their ranges, with a margin for rounding, now and at the end of the current step.
    fn check_inputs(&self, lead: &mut Lead) -> Result<()> {
        let Communication { length, count, done, .. } = lead.communication;
        let stepping = lead.phase == SimulationPhase::Stepping && count > 0;
        let offsets = if stepping { [lead.communication.offset(done), length] } else { [0.0; 2] };
        let mut rotors = lead.rotors.iter().zip(&lead.inputs.rotors);
        let counts = |(angle, rotor): (&RotorAngle, &super::RotorInputs)| {
            offsets.into_iter().all(|offset| angle.total(&rotor.speed, offset).is_finite())
        };
        if !rotors.all(counts) {
            return damaged("the rotor angle is not finite");
        }
        for variable in self.values.table().variables().iter().filter(|variable| variable.causality == Causality::Input)
        {
            let (low, high) = (variable.min.unwrap_or(f64::MIN), variable.max.unwrap_or(f64::MAX));
            let rounding = SAME_STEP * low.abs().max(high.abs());
            for element in 0..variable.len() {
                let Some(input) = lead.inputs.get_mut(variable.quantity, variable.of, element) else { continue };
                let beyond = |offset: f64| (low - input.at(offset)).max(input.at(offset) - high);
                if !offsets.into_iter().all(|offset| input.at(offset).is_finite() && beyond(offset) <= rounding) {
                    return damaged(format!("`{}` is outside its range", variable.element_name(element)));
                }
            }
        }
        Ok(())
    }

    /// Prepares everything for a state that follows from its parameters and can be rejected.
    fn follow(&mut self, lead: Lead) -> Result<()> {
        let before = (
            self.values.replace(lead.values),
            std::mem::replace(&mut self.inputs, lead.inputs),
            std::mem::replace(&mut self.initial_time, lead.initial_time),
        );
        // Before initialisation nothing has been computed from the parameters, and inconsistent ones are not rejected yet.
        let moves = self.is_moved_within_reason(lead.communication.length, lead.time);
        let references = lead.reference_speeds.iter().zip(&lead.reference_temperatures);
        let references: Vec<[f64; 2]> = references.map(|(speed, temperature)| [*speed, *temperature]).collect();
        let outcome = match lead.phase {
            SimulationPhase::Ready | SimulationPhase::Stepping if !moves => {
                damaged("an input causes a motion that is out of range")
            }
            SimulationPhase::Created => Ok(()),
            // Checked when a step begins and when a speed is set, not in every internal step.
            SimulationPhase::Stepping => {
                self.check_turning_of_all(lead.step, lead.communication.length).and_then(|()| self.adopt(&references))
            }
            SimulationPhase::Ready | SimulationPhase::Failed => self.adopt(&references),
        };
        if outcome.is_err() {
            self.values.replace(before.0);
            (self.inputs, self.initial_time) = (before.1, before.2);
        }
        outcome.or_else(damaged)
    }

    fn check_turning_of_all(&self, step: f64, length: f64) -> Result<()> {
        self.compiled.plan.pairs.iter().enumerate().try_for_each(|(index, pair)| {
            let rotation = self.inputs.pairs[index].shape_rotation.rate();
            self.check_turning(index, step, length, &self.inputs.rotors[pair.body].speed, rotation)
        })
    }

    /// Checks the motion that the inputs cause, including inputs that this scene does not list.
    fn is_moved_within_reason(&self, length: f64, time: f64) -> bool {
        let moments = (0..self.drives.len()).flat_map(|pair| [(pair, 0.0), (pair, length)]);
        moments.into_iter().all(|(pair, offset)| {
            let drive = self.drive(pair, offset, time);
            let single = [drive.speed, drive.gap_offset, drive.shape_factor, drive.shape_rotation, drive.radius_change];
            let mut all = single.iter().chain(&drive.shaft).chain(&drive.shaft_velocity);
            all.all(|value| value.abs() <= LARGEST)
        })
    }

    fn adopt(&mut self, references: &[[f64; 2]]) -> Result<()> {
        let parameters = self.parameters();
        self.compiled.scene.check_methods(parameters.scheme, parameters.solver)?;
        let orders: Vec<u32> = self.compiled.carriers.iter().map(|carrier| carrier.load_order).collect();
        // The previous orders were accepted before.
        self.follow_load_orders().and_then(|()| self.follow_reference_speeds(references)).inspect_err(|_| {
            for (carrier, order) in orders.into_iter().enumerate() {
                drop(self.compiled.set_load_order(carrier, f64::from(order)));
            }
        })
    }

    /// Reads a state that was checked before.
    fn read(&mut self, reader: &mut StateReader) {
        self.read_values(reader);
        // Step data that depends on parameters follows from the restored values.
        let parameters = self.parameters();
        self.rest(&parameters);
        if self.is_prepared(&parameters) {
            self.apply_friction(&parameters);
        } else {
            self.apply_methods(&parameters);
        }
        self.stepper.restore(&mut self.system, reader);
        if self.phase != SimulationPhase::Created {
            self.renew_limits();
        }
        self.make_room();
        self.make_room_for_tangent();
        if self.phase == SimulationPhase::Stepping {
            self.set_mark();
        }
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

    /// Restores a state of this simulation with the same parameters. Does not allocate.
    pub(super) fn restore_from(&mut self, mark: &[u8]) {
        let reader = &mut StateReader::new(mark);
        // Magic, version, scene.
        [0_u64; 3].restore(reader);
        self.read_values(reader);
        self.stepper.restore(&mut self.system, reader);
    }

    /// Reads a state without the part of the system.
    fn read_values(&mut self, reader: &mut StateReader) {
        self.phase.restore(reader);
        self.time.restore(reader);
        self.initial_time.restore(reader);
        self.initial_energies.restore(reader);
        self.communication.restore(reader);
        self.previous_length.restore(reader);
        self.most_tried.restore(reader);
        self.inputs.restore(reader);
        self.rotors.restore(reader);
        self.window.restore(reader);
        self.values.restore(reader);
        self.previous.restore(reader);
        // Already applied by `follow`.
        self.rotors.iter().for_each(|_| [0.0_f64; 2].restore(reader));
    }
}

/// Checks the bytes of a value and reads them.
fn take(value: &mut impl Persist, reader: &mut StateReader) {
    let mut bytes = reader.clone();
    value.check(reader);
    value.restore(&mut bytes);
}
