//! Saved states: everything that determines the future of an instance, as bytes.
//!
//! Layout, little-endian: magic (8 bytes), version u32, length of the token u32, token, phase u8, flag of a defined
//! stop time u8, two zero bytes, time f64, stop time f64, length of the core's state u64, the core's state, hash of
//! everything before (u64). The length is the same for all states of an FMU.

use tiprub_cosim::persist::fingerprint;

use super::{ExperimentTimes, InstancePhase, Refusal, Result, Slave};

const MAGIC: &[u8; 8] = b"tiprubST";
const VERSION: u32 = 2;
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

/// Reads fields from the front of a byte string.
struct SnapshotReader<'a>(&'a [u8]);

impl<'a> SnapshotReader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        let (front, rest) = self.0.split_at_checked(count).ok_or_else(|| damaged("it ends too early"))?;
        self.0 = rest;
        Ok(front)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        Ok(bytes)
    }

    fn length(&mut self) -> Result<usize> {
        usize::try_from(u64::from_le_bytes(self.array()?)).map_err(damaged)
    }
}

/// Writes the fields of a phase: tag, time, stop time.
fn encode_phase(phase: &InstancePhase, out: &mut SavedState) {
    let (tag, time, stop) = match *phase {
        InstancePhase::Instantiated { experiment } => (0, experiment.start, experiment.stop),
        InstancePhase::Initialising { experiment, .. } => (1, experiment.start, experiment.stop),
        InstancePhase::Stepping { stop } | InstancePhase::Updating { stop, .. } => (2, 0.0, stop),
        InstancePhase::Failed { last_good } => (3, last_good, None),
        InstancePhase::Terminated { time } => (4, time, None),
    };
    out.extend([tag, u8::from(stop.is_some()), 0, 0]);
    out.extend(time.to_le_bytes());
    out.extend(stop.unwrap_or(0.0).to_le_bytes());
}

fn decode_phase(reader: &mut SnapshotReader<'_>) -> Result<InstancePhase> {
    let [tag, has_stop, unused @ ..] = reader.array::<4>()?;
    let [time, stop] = [f64::from_le_bytes(reader.array()?), f64::from_le_bytes(reader.array()?)];
    if has_stop > 1 || unused != [0; 2] || !time.is_finite() || !stop.is_finite() {
        return Err(damaged("its times or flags are invalid"));
    }
    let stop = (has_stop == 1).then_some(stop);
    let experiment = ExperimentTimes { start: time, stop };
    match tag {
        0 => Ok(InstancePhase::Instantiated { experiment }),
        1 => Ok(InstancePhase::Initialising { experiment, before: None }),
        2 => Ok(InstancePhase::Stepping { stop }),
        3 => Ok(InstancePhase::Failed { last_good: time }),
        4 => Ok(InstancePhase::Terminated { time }),
        _ => Err(damaged("its phase is unknown")),
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
        MAGIC.len() + 4 + 4 + self.token.len() + 4 + 8 + 8 + 8 + self.unit.state_size() + CHECKSUM
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
        let mut head = SavedState::with_capacity(256);
        head.extend(MAGIC);
        head.extend(VERSION.to_le_bytes());
        head.extend(u32::try_from(self.token.len()).map_err(damaged)?.to_le_bytes());
        head.extend(self.token.as_bytes());
        encode_phase(&self.phase, &mut head);
        let state = self.unit.state_size();
        head.extend(u64::try_from(state).map_err(damaged)?.to_le_bytes());
        out.resize(self.serialised_size(), 0);
        let target = &mut out[head.len()..][..state];
        match &self.phase {
            // Outputs computed in Initialization Mode are computed again when they are requested.
            InstancePhase::Initialising { before: Some(before), .. } => target.copy_from_slice(before),
            _ => self.unit.save_state(target)?,
        }
        out[..head.len()].copy_from_slice(&head);
        let end = out.len() - CHECKSUM;
        let checksum = fingerprint(&out[..end], 0);
        out[end..].copy_from_slice(&checksum.to_le_bytes());
        Ok(())
    }

    fn decode<'a>(&self, bytes: &'a [u8]) -> Result<(InstancePhase, &'a [u8])> {
        let mut reader = SnapshotReader(bytes);
        if reader.take(MAGIC.len())? != MAGIC {
            return Err(damaged("it is not a tiprub state"));
        }
        let version = u32::from_le_bytes(reader.array()?);
        if version != VERSION {
            return Err(damaged(format!("it has format version {version}, but this FMU reads version {VERSION}")));
        }
        let length = usize::try_from(u32::from_le_bytes(reader.array()?)).map_err(damaged)?;
        let token = String::from_utf8_lossy(reader.take(length)?);
        if token != self.token.as_str() {
            return Err(damaged(format!(
                "it belongs to the FMU with token \"{token}\", but this FMU has token \"{}\"",
                self.token
            )));
        }
        if bytes.len() != self.serialised_size() {
            return Err(damaged(format!("it has {} bytes instead of {}", bytes.len(), self.serialised_size())));
        }
        let (content, tail) = bytes.split_at(bytes.len() - CHECKSUM);
        if fingerprint(content, 0).to_le_bytes() != tail {
            return Err(damaged("its checksum does not match its content"));
        }
        let phase = decode_phase(&mut reader)?;
        let state = reader.length()?;
        Ok((phase, reader.take(state)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the tag, the flag of the stop time, two zero bytes, the time and the stop time as bytes.
    fn bytes(head: [u8; 4], time: f64, stop: f64) -> Vec<u8> {
        [&head[..], &time.to_le_bytes(), &stop.to_le_bytes()].concat()
    }

    #[test]
    fn rejects_invalid_encoded_phases() {
        let read = |bytes: &[u8]| decode_phase(&mut SnapshotReader(bytes)).is_ok();
        for tag in 0..5 {
            assert!(read(&bytes([tag, 1, 0, 0], 0.25, 1.0)) && read(&bytes([tag, 0, 0, 0], 0.25, 0.0)), "{tag}");
            for head in [[tag, 2, 0, 0], [tag, 0, 1, 0], [tag, 0, 0, 1], [tag + 5, 0, 0, 0]] {
                assert!(!read(&bytes(head, 0.25, 0.0)), "{head:?}");
            }
            for wrong in [f64::NAN, f64::INFINITY] {
                assert!(!read(&bytes([tag, 1, 0, 0], wrong, 1.0)) && !read(&bytes([tag, 1, 0, 0], 0.25, wrong)));
            }
        }
        assert!(!read(&bytes([0; 4], 0.0, 0.0)[..19]));
    }
}
