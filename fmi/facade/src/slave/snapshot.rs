//! Saved states: everything that determines the future of an instance, as bytes.
//!
//! Layout, little-endian: magic (8 bytes), version (u64), token, phase ([`SavedPhase`]), the core's state, hash of everything before (u64). The
//! length is the same for all states of an FMU.

use tiprub_cosim::persist::{Persist, StateReader, check_length, fingerprint, to_bytes};
use tiprub_cosim::persist_fields;

use super::{ExperimentTimes, InstancePhase, Refusal, Result, Slave};

const MAGIC: &[u8] = b"tiprubST";
const VERSION: u64 = 3;
const VERSION_BYTES: usize = 8;
const CHECKSUM: usize = 8;

/// One saved state.
pub(super) type SavedState = Vec<u8>;

/// Opaque address that the importer uses as the handle of a saved state.
pub(crate) type SnapshotHandle = *const SavedState;

fn damaged(problem: impl std::fmt::Display) -> Refusal {
    Refusal::error(format!(
        "the saved state cannot be used: {problem}. Use an unmodified state that was saved by this FMU"
    ))
}

/// Phase of an instance in a saved state.
#[derive(Default)]
struct SavedPhase {
    /// Number of the phase, in the order of a run.
    number: u64,
    has_stop: bool,
    /// Start time, or the time at which stepping ended (s).
    time: f64,
    /// Stop time (s), 0 without one.
    stop: f64,
}

persist_fields!(SavedPhase { number, has_stop, time, stop });

impl SavedPhase {
    fn new(phase: &InstancePhase) -> Self {
        let (number, time, stop) = match *phase {
            InstancePhase::Instantiated { experiment } => (0, experiment.start, experiment.stop),
            InstancePhase::Initialising { experiment, .. } => (1, experiment.start, experiment.stop),
            InstancePhase::Stepping { stop } | InstancePhase::Updating { stop, .. } => (2, 0.0, stop),
            InstancePhase::Failed { last_good } => (3, last_good, None),
            InstancePhase::Terminated { time } => (4, time, None),
        };
        Self { number, has_stop: stop.is_some(), time, stop: stop.unwrap_or(0.0) }
    }

    /// Reads the phase from its bytes. Returns `None` if they are invalid.
    fn read(bytes: &[u8]) -> Option<InstancePhase> {
        let (mut saved, mut reader) = (Self::default(), StateReader::new(bytes));
        saved.check(&mut reader);
        if reader.fault().is_some() || reader.infinite() > 0 {
            return None;
        }
        saved.restore(&mut StateReader::new(bytes));
        let Self { number, has_stop, time, stop } = saved;
        let stop = has_stop.then_some(stop);
        let experiment = ExperimentTimes { start: time, stop };
        match number {
            0 => Some(InstancePhase::Instantiated { experiment }),
            1 => Some(InstancePhase::Initialising { experiment, before: None }),
            2 => Some(InstancePhase::Stepping { stop }),
            3 => Some(InstancePhase::Failed { last_good: time }),
            4 => Some(InstancePhase::Terminated { time }),
            _ => None,
        }
    }
}

impl Slave {
    /// Saves the state and returns a handle for it. `existing` is a handle of this instance whose state is replaced.
    ///
    /// # Errors
    /// A handle that this instance did not return.
    pub(crate) fn save(&mut self, existing: Option<SnapshotHandle>) -> Result<SnapshotHandle> {
        let index = existing.map(|handle| self.index(handle)).transpose()?;
        // A new state replaces an existing one in the same memory.
        let mut bytes = index.map(|index| std::mem::take(&mut *self.snapshots[index])).unwrap_or_default();
        let outcome = self.encode(&mut bytes);
        if let Some(index) = index {
            *self.snapshots[index] = bytes;
            return outcome.map(|()| &raw const *self.snapshots[index]);
        }
        outcome?;
        self.store(None, bytes)
    }

    fn store(&mut self, existing: Option<SnapshotHandle>, bytes: SavedState) -> Result<SnapshotHandle> {
        if let Some(handle) = existing {
            let index = self.index(handle)?;
            *self.snapshots[index] = bytes;
            return Ok(handle);
        }
        self.snapshots.push(Box::new(bytes));
        Ok(self.snapshots.last().map_or(std::ptr::null(), |snapshot| std::ptr::from_ref(&**snapshot)))
    }

    fn index(&self, handle: SnapshotHandle) -> Result<usize> {
        let found = self.snapshots.iter().position(|snapshot| std::ptr::eq(&raw const **snapshot, handle));
        found.ok_or_else(|| {
            Refusal::error(
                "FMUstate is not a saved state of this instance: it was freed or belongs to another instance. To pass \
                 a state to another instance, serialise and deserialise it",
            )
        })
    }

    /// Restores a saved state together with its phase.
    ///
    /// # Errors
    /// A handle that is not a state of this instance, or a state of another FMU; nothing is changed then.
    pub(crate) fn restore(&mut self, handle: SnapshotHandle) -> Result<()> {
        let index = self.index(handle)?;
        let snapshot = std::mem::take(&mut *self.snapshots[index]);
        let outcome = self.decode(&snapshot).and_then(|(phase, state)| {
            self.unit.restore_state(state)?;
            Ok(phase)
        });
        *self.snapshots[index] = snapshot;
        self.phase = outcome?;
        Ok(())
    }

    /// Frees a saved state.
    ///
    /// # Errors
    /// A handle that is not a state of this instance.
    pub(crate) fn free_snapshot(&mut self, handle: SnapshotHandle) -> Result<()> {
        let index = self.index(handle)?;
        self.snapshots.swap_remove(index);
        Ok(())
    }

    /// Returns the bytes of a saved state.
    ///
    /// # Errors
    /// A handle that is not a state of this instance.
    pub(crate) fn serialised(&self, handle: SnapshotHandle) -> Result<&[u8]> {
        Ok(&self.snapshots[self.index(handle)?])
    }

    /// Returns the length of every saved state of this FMU (bytes).
    pub(crate) fn serialised_size(&self) -> usize {
        let phase = to_bytes(&[&SavedPhase::default()]).len();
        MAGIC.len() + VERSION_BYTES + self.token.len() + phase + self.unit.state_size() + CHECKSUM
    }

    /// Creates a saved state from bytes that [`Slave::serialised`] returned, possibly in another process.
    ///
    /// # Errors
    /// Bytes of wrong length, of another FMU, or damaged.
    pub(crate) fn deserialise(&mut self, bytes: &[u8], existing: Option<SnapshotHandle>) -> Result<SnapshotHandle> {
        self.decode(bytes)?;
        self.store(existing, bytes.to_vec())
    }

    /// Replaces the content of `out` with the state. If this fails, an existing state in `out` stays unchanged.
    fn encode(&self, out: &mut SavedState) -> Result<()> {
        let phase = to_bytes(&[&SavedPhase::new(&self.phase)]);
        let head = [MAGIC, &VERSION.to_le_bytes(), self.token.as_bytes(), &phase].concat();
        out.resize(self.serialised_size(), 0);
        let (content, checksum) = out.split_at_mut(self.serialised_size() - CHECKSUM);
        let (front, target) = content.split_at_mut(head.len());
        match &self.phase {
            // Outputs computed in Initialization Mode are computed again when they are requested.
            InstancePhase::Initialising { before: Some(before), .. } => target.copy_from_slice(before),
            _ => self.unit.save_state(target)?,
        }
        front.copy_from_slice(&head);
        checksum.copy_from_slice(&fingerprint(content, 0).to_le_bytes());
        Ok(())
    }

    fn decode<'a>(&self, bytes: &'a [u8]) -> Result<(InstancePhase, &'a [u8])> {
        check_length(bytes.len(), self.serialised_size(), "this FMU")?;
        let (content, checksum) = bytes.split_at(bytes.len() - CHECKSUM);
        let (head, state) = content.split_at(content.len() - self.unit.state_size());
        let (magic, head) = head.split_at(MAGIC.len());
        let (token, phase) = head[VERSION_BYTES..].split_at(self.token.len());
        let mut version = 0_u64;
        version.restore(&mut StateReader::new(head));
        if magic != MAGIC {
            return Err(damaged("it is not a tiprub state"));
        }
        if version != VERSION {
            return Err(damaged(format!("it has format version {version}, but this FMU reads version {VERSION}")));
        }
        if token != self.token.as_bytes() {
            let token = String::from_utf8_lossy(token);
            return Err(damaged(format!(
                "it belongs to the FMU with token \"{token}\", but this FMU has token \"{}\"",
                self.token
            )));
        }
        if fingerprint(content, 0).to_le_bytes() != checksum {
            return Err(damaged("its checksum does not match its content"));
        }
        let phase = SavedPhase::read(phase).ok_or_else(|| damaged("its phase or its times are invalid"))?;
        Ok((phase, state))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejects_invalid_saved_phases() {
        let saved = |number, time, stop| to_bytes(&[&SavedPhase { number, has_stop: true, time, stop }]);
        let is_read = |bytes: &[u8]| SavedPhase::read(bytes).is_some();
        for number in 0..5 {
            let good = saved(number, 0.25, 1.0);
            assert!(is_read(&good) && !is_read(&saved(number + 5, 0.25, 1.0)), "{number}");
            let mut flag = good;
            flag[8] = 2;
            assert!(!is_read(&flag), "{number}");
            for wrong in [f64::NAN, f64::INFINITY] {
                assert!(!is_read(&saved(number, wrong, 1.0)) && !is_read(&saved(number, 0.25, wrong)));
            }
        }
    }
}
