//! Saved states: a header that says whose state it is, the payload, and a checksum.
//!
//! Layout, little-endian: magic (8 bytes), format version (u64), scene fingerprint (u64), payload, FNV-1a checksum of
//! all before (u64).

use super::{Communication, Inputs, Phase, Simulation};
use crate::persist::{Persist, Reader, Writer, fingerprint, persist_fields};
use crate::variables::Quantity;
use crate::{Error, Result};

const MAGIC: [u8; 8] = *b"tiprubST";
const VERSION: u64 = 4;
const CHECKSUM_BYTES: usize = 8;

persist_fields!(Communication { start, length, count, done });
persist_fields!(Inputs {
    speed,
    shape_factor,
    shape_rotation,
    radius_change,
    shaft,
    load_amplitude,
    load_phase,
    temperatures
});

impl Persist for Phase {
    fn save(&self, writer: &mut Writer) {
        let code: u64 = match self {
            Self::Created => 0,
            Self::Ready => 1,
            Self::Stepping => 2,
            Self::Failed => 3,
        };
        code.save(writer);
    }
    fn restore(&mut self, reader: &mut Reader) {
        let mut code = 0_u64;
        code.restore(reader);
        *self = match code {
            0 => Self::Created,
            1 => Self::Ready,
            2 => Self::Stepping,
            _ => Self::Failed,
        };
    }
}

impl Simulation {
    /// Size of a saved state in bytes (constant for a given scene).
    pub fn state_size(&self) -> usize {
        let mut writer = Writer::new(&mut []);
        self.write(&mut writer);
        writer.written() + CHECKSUM_BYTES
    }

    /// Write everything that determines the future into `buffer` (exactly [`Simulation::state_size`] bytes).
    ///
    /// # Errors
    /// Buffer of the wrong length.
    pub fn save_state(&self, buffer: &mut [u8]) -> Result<()> {
        self.check_size(buffer.len())?;
        let end = buffer.len() - CHECKSUM_BYTES;
        self.write(&mut Writer::new(&mut buffer[..end]));
        let checksum = fingerprint(&buffer[..end], 0);
        buffer[end..].copy_from_slice(&checksum.to_le_bytes());
        Ok(())
    }

    /// Restore a saved state; on error nothing is changed.
    ///
    /// # Errors
    /// Wrong length, wrong scene, damaged (checksum).
    pub fn restore_state(&mut self, buffer: &[u8]) -> Result<()> {
        self.check_size(buffer.len())?;
        let (content, checksum) = buffer.split_at(buffer.len() - CHECKSUM_BYTES);
        let damaged = |problem: &str| Err(Error::State { problem: problem.to_owned() });
        if content[..MAGIC.len()] != MAGIC {
            return damaged("it is not a state of this software");
        }
        let mut reader = Reader::new(&content[MAGIC.len()..]);
        let (mut version, mut scene) = (0_u64, 0_u64);
        version.restore(&mut reader);
        scene.restore(&mut reader);
        if version != VERSION {
            return damaged(&format!("it has format version {version}, this library reads {VERSION}"));
        }
        if scene != self.compiled.fingerprint {
            return damaged("it belongs to another scene or ROM");
        }
        if fingerprint(content, 0).to_le_bytes() != checksum {
            return damaged("its checksum does not match: the bytes were changed");
        }
        self.read(&mut reader)
    }

    fn check_size(&self, found: usize) -> Result<()> {
        let expected = self.state_size();
        if found == expected {
            return Ok(());
        }
        Err(Error::State { problem: format!("it has {found} bytes where this scene needs {expected}") })
    }

    fn write(&self, writer: &mut Writer) {
        u64::from_le_bytes(MAGIC).save(writer);
        VERSION.save(writer);
        self.compiled.fingerprint.save(writer);
        self.phase.save(writer);
        self.time.save(writer);
        self.initial_time.save(writer);
        self.initial_energy.save(writer);
        self.communication.save(writer);
        self.previous_length.save(writer);
        self.inputs.save(writer);
        self.rotor.save(writer);
        self.window.save(writer);
        self.values.save(writer);
        self.previous.save(writer);
        self.compiled.reference_speed.save(writer);
        self.system.save(writer);
    }

    fn read(&mut self, reader: &mut Reader) -> Result<()> {
        self.phase.restore(reader);
        self.time.restore(reader);
        self.initial_time.restore(reader);
        self.initial_energy.restore(reader);
        self.communication.restore(reader);
        self.previous_length.restore(reader);
        self.inputs.restore(reader);
        self.rotor.restore(reader);
        self.window.restore(reader);
        self.values.restore(reader);
        self.previous.restore(reader);
        // What the step takes from parameters follows from the restored values.
        let parameters = self.parameters();
        let mut speed = 0.0_f64;
        speed.restore(reader);
        // Before initialisation nothing has been computed from them, and values out of range are not refused yet.
        if self.phase != Phase::Created {
            self.compiled.set_load_order(self.value_of(Quantity::LoadOrder))?;
            self.follow_reference_speed(speed)?;
        }
        self.system.set_methods(parameters.scheme, parameters.solver);
        self.system.set_friction(parameters.friction);
        self.rest(&parameters);
        self.system.restore(reader);
        self.renew_limits();
        Ok(())
    }
}
