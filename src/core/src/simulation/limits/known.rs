//! Stored results of slow checks. A later start with the same scene and parameters does not repeat these checks.
//!
//! Each result has a key: a hash of the scene with its ROMs, of the parameters, and of the part of the check. A stored
//! result is used only for a check with the same key.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use tiprub_cosim::persist::{Persist, StateReader, fingerprint, to_bytes};

use super::Parameters;
use crate::simulation::compile::Compiled;

/// First word of stored results, and version of their layout and of the checks.
const MAGIC: u64 = u64::from_le_bytes(*b"tiprubCK");
const VERSION: u64 = 3;

/// Hash of everything that a result depends on.
type Key = [u64; 2];

/// Bytes of the results by their keys. A result without bytes represents `None`.
type Results = BTreeMap<Key, Vec<u8>>;

/// Part of the checks of a structure.
#[derive(Debug, Clone, Copy)]
pub(super) enum CheckPart {
    /// Growth of one of the models with some nodes closed.
    Set,
    /// Growth that a step adds.
    Step,
    /// Whether the contact problem has a unique solution.
    Solvable,
    /// Effect of the surface carriers.
    Carriers,
    /// Growth while blades cut.
    Cutting,
    /// Eigenvalue that surface carriers add while all blades are in contact.
    AllBladesOnCarrier,
}

/// Stored results, and the results of the last check.
#[derive(Debug, Clone, Default)]
pub(crate) struct KnownChecks {
    stored: Arc<Results>,
    used: Results,
}

impl KnownChecks {
    /// Reads results that [`KnownChecks::to_bytes`] wrote; reads none if the bytes are damaged or from another version.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Self {
        Self { stored: Arc::new(read(bytes).unwrap_or_default()), used: Results::new() }
    }

    /// Returns the results of the last check as bytes; empty if nothing was checked.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        write(self.used.iter())
    }

    /// Begins a check: removes the results of the previous one.
    pub(super) fn begin(&mut self) {
        self.used.clear();
    }
}

/// Returns the results of `newest`, followed by those of `older` with other keys, up to `max_results` results. Keeps all of `newest`.
pub(crate) fn merge(newest: &[u8], older: &[u8], max_results: usize) -> Vec<u8> {
    let [newest, older] = [newest, older].map(|bytes| read::<Vec<_>>(bytes).unwrap_or_default());
    let max_results = max_results.max(newest.len());
    let mut known = BTreeSet::new();
    let results: Vec<_> =
        newest.into_iter().chain(older).filter(|(key, _)| known.insert(*key)).take(max_results).collect();
    write(results.iter().map(|(key, result)| (key, result)))
}

/// Formats results in the given order; empty if there are none.
fn write<'a>(results: impl ExactSizeIterator<Item = (&'a Key, &'a Vec<u8>)>) -> Vec<u8> {
    if results.len() == 0 {
        return Vec::new();
    }
    let mut bytes = to_bytes(&[&[MAGIC, VERSION]]);
    for (key, result) in results {
        bytes.extend(to_bytes(&[key, &result.len()]));
        bytes.extend(result);
    }
    bytes.extend(fingerprint(&bytes, 0).to_le_bytes());
    bytes
}

/// Reads results in their order; `None` if the bytes are damaged.
fn read<R: Default + Extend<(Key, Vec<u8>)>>(bytes: &[u8]) -> Option<R> {
    let (content, checksum) = bytes.split_last_chunk()?;
    if fingerprint(content, 0) != u64::from_le_bytes(*checksum) {
        return None;
    }
    let mut rest = content.strip_prefix(&to_bytes(&[&[MAGIC, VERSION]])[..])?;
    let mut results = R::default();
    while !rest.is_empty() {
        let (mut key, mut length) = (Key::default(), 0_usize);
        let (head, others) = rest.split_at_checked(to_bytes(&[&key, &length]).len())?;
        let reader = &mut StateReader::new(head);
        key.restore(reader);
        length.restore(reader);
        let (result, others) = others.split_at_checked(length)?;
        results.extend([(key, result.to_vec())]);
        rest = others;
    }
    Some(results)
}

/// Results for one structure with some parameters.
pub(super) struct BodyChecks<'a> {
    known: &'a RefCell<KnownChecks>,
    /// The structure.
    pub(super) body: usize,
    /// Hash of the scene, the structure and the parameters.
    key: Key,
}

impl<'a> BodyChecks<'a> {
    pub(super) fn new(
        known: &'a RefCell<KnownChecks>,
        compiled: &Compiled,
        body: usize,
        parameters: &Parameters,
    ) -> Self {
        // Speeds are left out: each check depends on the sense of slip separately, and the reference speeds of the
        // stiffness determine the modes.
        let parameters = Parameters { speeds: Vec::new(), ..parameters.clone() };
        let version = env!("CARGO_PKG_VERSION");
        let text = format!("{version} {:x} {body} {:?} {parameters:?}", compiled.fingerprint, compiled.references());
        Self { known, body, key: [1, 2].map(|seed| fingerprint(text.as_bytes(), seed)) }
    }

    /// Returns the result of a part of the check: the stored one with the same key, or that of `compute`.
    pub(super) fn get<T: Persist + Default>(
        &self,
        part: CheckPart,
        details: &[u64],
        compute: impl FnOnce() -> Option<T>,
    ) -> Option<T> {
        let [first, second] = self.key;
        let bytes = to_bytes(&[&vec![first, second, part as u64], &details.to_vec()]);
        let key = [1, 2].map(|seed| fingerprint(&bytes, seed));
        let stored = self.known.borrow().stored.get(&key).cloned();
        let mut value = T::default();
        let length = to_bytes(&[&value]).len();
        let result = stored
            .filter(|result| result.is_empty() || result.len() == length)
            .unwrap_or_else(|| compute().map_or_else(Vec::new, |computed| to_bytes(&[&computed])));
        value.restore(&mut StateReader::new(&result));
        let found = (!result.is_empty()).then_some(value);
        self.known.borrow_mut().used.insert(key, result);
        found
    }
}
