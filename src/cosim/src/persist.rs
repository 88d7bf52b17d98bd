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

    fn put(&mut self, bytes: &[u8]) {
        if let Some(target) = self.buffer.get_mut(self.at..self.at + bytes.len()) {
            target.copy_from_slice(bytes);
        }
        self.at += bytes.len();
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

    fn take<const N: usize>(&mut self) -> [u8; N] {
        let mut bytes = [0; N];
        if let Some(source) = self.buffer.get(self.at..self.at + N) {
            bytes.copy_from_slice(source);
        }
        self.at += N;
        bytes
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
}

/// Largest valid step counter; no run comes near it.
const MAX_COUNT: u64 = 1 << 53;

/// Implements [`Persist`] for numbers, with the check of a number that was read.
macro_rules! persist_numbers {
    ($($number:ty, |$value:ident, $reader:ident| $check:expr;)*) => {$(
        impl Persist for $number {
            fn save(&self, writer: &mut StateWriter) {
                writer.put(&self.to_le_bytes());
            }
            fn restore(&mut self, reader: &mut StateReader) {
                *self = Self::from_le_bytes(reader.take());
            }
            fn check(&self, $reader: &mut StateReader) {
                let $value = Self::from_le_bytes($reader.take());
                $check
            }
        }
    )*};
}

persist_numbers! {
    f64, |value, reader| {
        if value.is_infinite() {
            reader.infinite += 1;
        } else if !(value.abs() <= reader.largest || reader.largest.is_infinite()) {
            reader.refuse("a number is out of range");
        }
    };
    u64, |value, reader| if value > MAX_COUNT { reader.refuse("a counter is out of range") };
    i32, |_value, reader| {};
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
        for value in self {
            value.save(writer);
        }
    }
    fn restore(&mut self, reader: &mut StateReader) {
        for value in self {
            value.restore(reader);
        }
    }
    fn check(&self, reader: &mut StateReader) {
        for value in self {
            value.check(reader);
        }
    }
}

/// Implements [`Persist`] for containers as for slices.
macro_rules! persist_as_slice {
    ($([$($generics:tt)*] $container:ty;)*) => {$(
        impl<$($generics)*> Persist for $container {
            fn save(&self, writer: &mut StateWriter) {
                self[..].save(writer);
            }
            fn restore(&mut self, reader: &mut StateReader) {
                self[..].restore(reader);
            }
            fn check(&self, reader: &mut StateReader) {
                self[..].check(reader);
            }
        }
    )*};
}

persist_as_slice! {
    [T: Persist] Vec<T>;
    [T: Persist, const N: usize] [T; N];
    [] crate::VariableValues;
}

/// Implements [`Persist`] for a struct from the list of its fields; a missing field is a compile error. `field.part` saves this part of a
/// field, such as the components of a vector: `force.data.0`.
#[macro_export]
macro_rules! persist_fields {
    ($name:ident { $($field:ident $(. $part:tt)*),+ $(,)? }) => {
        impl $crate::persist::Persist for $name {
            fn save(&self, writer: &mut $crate::persist::StateWriter) {
                let Self { $($field: _),+ } = self;
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

/// Checks the length of a saved state (bytes) of its `owner`, such as "this scene".
///
/// # Errors
/// Another length than the expected one.
pub fn check_length(found: usize, expected: usize, owner: &str) -> crate::Result<()> {
    if found == expected { Ok(()) } else { damaged(format!("it has {found} bytes, but {owner} needs {expected}")) }
}

/// FNV-1a hash of bytes, for fingerprints and checksums of saved states (not for security).
pub fn fingerprint(bytes: &[u8], seed: u64) -> u64 {
    bytes
        .iter()
        .fold(seed ^ 0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3))
}
