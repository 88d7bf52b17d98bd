//! Saves and restores state as bytes. One list of fields per struct defines its size, its saving and its restoring.

/// Writes little-endian values to a buffer.
#[derive(Debug)]
pub struct StateWriter<'a> {
    buffer: &'a mut [u8],
    at: usize,
}

impl<'a> StateWriter<'a> {
    /// Starts at the beginning of `buffer`.
    pub fn new(buffer: &'a mut [u8]) -> Self {
        Self { buffer, at: 0 }
    }

    /// Number of bytes written so far, also counted beyond the end of the buffer, so that an empty buffer measures the size.
    pub fn written(&self) -> usize {
        self.at
    }

    /// Returns the next `count` bytes of the buffer; `None` beyond its end.
    fn next(&mut self, count: usize) -> Option<&mut [u8]> {
        let from = self.at;
        self.at += count;
        self.buffer.get_mut(from..self.at)
    }

    fn put(&mut self, bytes: &[u8]) {
        if let Some(target) = self.next(bytes.len()) {
            target.copy_from_slice(bytes);
        }
    }
}

/// Reads little-endian values from a buffer; past its end it returns zeros (the caller checks the length beforehand).
#[derive(Debug, Clone)]
pub struct StateReader<'a> {
    buffer: &'a [u8],
    at: usize,
    fault: Option<&'static str>,
    largest: f64,
    infinite: usize,
}

impl<'a> StateReader<'a> {
    /// Starts at the beginning of `buffer`.
    pub fn new(buffer: &'a [u8]) -> Self {
        Self { buffer, at: 0, fault: None, largest: f64::MAX, infinite: 0 }
    }

    /// From here on, [`Persist::check`] rejects real numbers beyond ±`largest` and NaN; if `largest` is infinite, it accepts both.
    pub fn up_to(&mut self, largest: f64) {
        self.largest = largest;
    }

    /// Records an error in the bytes; only the first one is kept.
    pub fn refuse(&mut self, fault: &'static str) {
        self.fault.get_or_insert(fault);
    }

    /// Returns the first error in the bytes read so far.
    pub fn fault(&self) -> Option<&'static str> {
        self.fault
    }

    /// Number of infinite values read so far. The caller decides whether they are valid: gaps of padding lanes are infinite.
    pub fn infinite(&self) -> usize {
        self.infinite
    }

    /// Returns the next `count` values of N bytes; an empty slice if the buffer ends before the last value.
    fn next<const N: usize>(&mut self, count: usize) -> &'a [[u8; N]] {
        let from = self.at;
        self.at += count * N;
        self.buffer.get(from..self.at).unwrap_or_default().as_chunks().0
    }

    fn take<const N: usize>(&mut self) -> [u8; N] {
        self.next(1).first().copied().unwrap_or([0; N])
    }
}

/// A value that belongs to the saved state.
pub trait Persist {
    /// Appends the value.
    fn save(&self, writer: &mut StateWriter);
    /// Reads the value, in the order in which [`Persist::save`] wrote it.
    fn restore(&mut self, reader: &mut StateReader);
    /// Reads over the bytes of the value and calls [`StateReader::refuse`] if [`Persist::save`] cannot have written them. A whole
    /// state is checked in this way before anything is changed.
    fn check(&self, reader: &mut StateReader);

    /// Saves values one after the other.
    fn save_all(values: &[Self], writer: &mut StateWriter)
    where
        Self: Sized,
    {
        values.iter().for_each(|value| value.save(writer));
    }
    /// Reads values one after the other.
    fn restore_all(values: &mut [Self], reader: &mut StateReader)
    where
        Self: Sized,
    {
        values.iter_mut().for_each(|value| value.restore(reader));
    }
    /// Checks the saved bytes of values one after the other.
    fn check_all(values: &[Self], reader: &mut StateReader)
    where
        Self: Sized,
    {
        values.iter().for_each(|value| value.check(reader));
    }
}

/// Largest valid step counter; no run comes near it.
const MAX_COUNT: u64 = 1 << 53;

/// Implements [`Persist`] for a type of numbers, with the function that checks numbers from a saved state. Slices of
/// numbers are copied in one pass.
macro_rules! persist_numbers {
    ($($number:ty, $check:expr;)*) => {$(
        impl Persist for $number {
            fn save(&self, writer: &mut StateWriter) {
                writer.put(&self.to_le_bytes());
            }
            fn restore(&mut self, reader: &mut StateReader) {
                *self = Self::from_le_bytes(reader.take());
            }
            fn check(&self, reader: &mut StateReader) {
                let bytes = reader.take();
                $check(&[bytes], reader);
            }
            fn save_all(values: &[Self], writer: &mut StateWriter) {
                let target = writer.next(size_of_val(values)).unwrap_or_default();
                for (bytes, value) in target.as_chunks_mut().0.iter_mut().zip(values) {
                    *bytes = value.to_le_bytes();
                }
            }
            fn restore_all(values: &mut [Self], reader: &mut StateReader) {
                let source = reader.next(values.len());
                if source.is_empty() {
                    values.fill(Self::default());
                }
                for (value, bytes) in values.iter_mut().zip(source) {
                    *value = Self::from_le_bytes(*bytes);
                }
            }
            fn check_all(values: &[Self], reader: &mut StateReader) {
                let bytes = reader.next(values.len());
                $check(bytes, reader);
            }
        }
    )*};
}

persist_numbers! {
    f64, check_reals;
    u64, check_counts;
    usize, check_counts;
    i32, |_: &[[u8; 4]], _: &mut StateReader| {};
}

/// Counts infinite numbers and rejects other numbers that are out of range. The loop has no branches, so it takes no
/// longer than a copy.
fn check_reals(bytes: &[[u8; 8]], reader: &mut StateReader) {
    let (mut infinite, mut beyond) = (0_u64, 0_u64);
    for bytes in bytes {
        let size = f64::from_le_bytes(*bytes).abs();
        // NaN is not within the range.
        let is_within = size <= reader.largest;
        infinite += u64::from(size == f64::INFINITY);
        beyond += u64::from(!is_within);
    }
    reader.infinite += usize::try_from(infinite).unwrap_or(usize::MAX);
    if beyond > infinite && reader.largest.is_finite() {
        reader.refuse("a number is out of range");
    }
}

fn check_counts(bytes: &[[u8; 8]], reader: &mut StateReader) {
    if bytes.iter().any(|bytes| u64::from_le_bytes(*bytes) > MAX_COUNT) {
        reader.refuse("a counter is out of range");
    }
}

impl Persist for bool {
    fn save(&self, writer: &mut StateWriter) {
        writer.put(&[u8::from(*self)]);
    }
    fn restore(&mut self, reader: &mut StateReader) {
        let [byte] = reader.take();
        *self = byte != 0;
    }
    fn check(&self, reader: &mut StateReader) {
        let [byte] = reader.take();
        if byte > 1 {
            reader.refuse("a flag is neither 0 nor 1");
        }
    }
}

impl<T: Persist> Persist for [T] {
    fn save(&self, writer: &mut StateWriter) {
        T::save_all(self, writer);
    }
    fn restore(&mut self, reader: &mut StateReader) {
        T::restore_all(self, reader);
    }
    fn check(&self, reader: &mut StateReader) {
        T::check_all(self, reader);
    }
}

/// Implements [`Persist`] for containers as for slices.
macro_rules! persist_as_slice {
    ($([$($generics:tt)*] $container:ty;)*) => {$(
        impl<$($generics)*> Persist for $container {
            fn save(&self, writer: &mut StateWriter) {
                self.as_slice().save(writer);
            }
            fn restore(&mut self, reader: &mut StateReader) {
                self.as_mut_slice().restore(reader);
            }
            fn check(&self, reader: &mut StateReader) {
                self.as_slice().check(reader);
            }
        }
    )*};
}

// An optional part exists for the whole life of its owner, or never.
persist_as_slice! {
    [T: Persist] Vec<T>;
    [T: Persist] Option<T>;
    [T: Persist, const N: usize] [T; N];
}

/// Implements [`Persist`] for a struct from the list of its fields; a missing field is a compile error, unless the list ends with `..`
/// because the other fields are not part of the state. `field.part` saves this part of a field, such as the components of a vector:
/// `force.data.0`.
#[macro_export]
macro_rules! persist_fields {
    ($name:ident $(<$generic:ident>)? { $($field:ident $(. $part:tt)*),+ , .. }) => {
        $crate::persist_fields!($name $(<$generic>)? [, ..] $($field $(. $part)*),+);
    };
    ($name:ident $(<$generic:ident>)? { $($field:ident $(. $part:tt)*),+ $(,)? }) => {
        $crate::persist_fields!($name $(<$generic>)? [] $($field $(. $part)*),+);
    };
    ($name:ident $(<$generic:ident>)? [$($rest:tt)*] $($field:ident $(. $part:tt)*),+) => {
        impl $(<$generic: $crate::persist::Persist>)? $crate::persist::Persist for $name $(<$generic>)? {
            fn save(&self, writer: &mut $crate::persist::StateWriter) {
                let Self { $($field: _),+ $($rest)* } = self;
                $($crate::persist::Persist::save(&self.$field$(.$part)*, writer);)+
            }
            fn restore(&mut self, reader: &mut $crate::persist::StateReader) {
                $($crate::persist::Persist::restore(&mut self.$field$(.$part)*, reader);)+
            }
            fn check(&self, reader: &mut $crate::persist::StateReader) {
                $($crate::persist::Persist::check(&self.$field$(.$part)*, reader);)+
            }
        }
    };
}

/// Returns values as bytes, one after the other.
pub fn to_bytes(values: &[&dyn Persist]) -> Vec<u8> {
    let write = |buffer: &mut [u8]| {
        let mut writer = StateWriter::new(buffer);
        values.iter().for_each(|value| value.save(&mut writer));
        writer.written()
    };
    let mut bytes = vec![0; write(&mut [])];
    write(&mut bytes);
    bytes
}

/// Returns the error of a saved state that cannot be restored.
///
/// # Errors
/// Always.
pub fn damaged<T>(problem: impl std::fmt::Display) -> crate::Result<T> {
    Err(crate::Error::state(problem))
}

/// Checks the length (bytes) of a saved state; `owner` names what the state belongs to, such as "this scene".
///
/// # Errors
/// The length differs from the expected one.
pub fn check_length(found: usize, expected: usize, owner: &str) -> crate::Result<()> {
    if found == expected { Ok(()) } else { damaged(format!("it has {found} bytes, but {owner} needs {expected}")) }
}

/// Number of hashes that are computed side by side and combined at the end.
const LANES: usize = 8;

/// Hash of bytes, for fingerprints and checksums of saved states (not for security). Every change of a single word
/// changes the hash.
pub fn fingerprint(bytes: &[u8], seed: u64) -> u64 {
    let (words, last) = bytes.as_chunks();
    let mut rest = [0; 8];
    rest[..last.len()].copy_from_slice(last);
    let end = mix(bytes.len() as u64, u64::from_le_bytes(rest));
    hash_words(words, u64::from_le_bytes, mix(seed, end))
}

/// Hash of the bits of numbers, for the same purposes as [`fingerprint`].
pub fn fingerprint_numbers(values: &[f64], seed: u64) -> u64 {
    hash_words(values, f64::to_bits, mix(seed, values.len() as u64))
}

fn hash_words<T: Copy>(words: &[T], bits: impl Fn(T) -> u64, seed: u64) -> u64 {
    let mut lanes: [u64; LANES] = std::array::from_fn(|lane| mix(seed, lane as u64));
    let mut take = |words: &[T]| {
        for (lane, word) in lanes.iter_mut().zip(words) {
            *lane = mix(*lane, bits(*word));
        }
    };
    let (blocks, rest) = words.as_chunks::<LANES>();
    blocks.iter().for_each(|block| take(block));
    take(rest);
    let hash = lanes.into_iter().fold(seed, mix);
    mix(hash, hash >> 32)
}

/// Adds a word to a hash. The result is a bijection of either argument. The product spreads bits upwards, and the
/// rotation returns them to the low end.
fn mix(hash: u64, word: u64) -> u64 {
    (hash ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
}
