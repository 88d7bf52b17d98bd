//! A ROM file as arrays and metadata entries that a test can change before writing it again, without checksum.

use std::collections::BTreeMap;

use tiprub_core::Rom;
use tiprub_format::{read_rom, write_rom};

/// Arrays (shape, values in row-major order) and metadata.
pub struct Loose {
    pub arrays: BTreeMap<String, (Vec<usize>, Vec<f64>)>,
    pub entries: BTreeMap<String, String>,
}

impl Loose {
    /// Returns the arrays and metadata of this ROM.
    pub fn of(rom: &Rom) -> Self {
        let bytes = write_rom(rom);
        let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
        let mut entries: BTreeMap<_, _> = header.metadata().clone().unwrap().into_iter().collect();
        entries.remove("checksum");
        let container = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        let values = |data: &[u8]| data.as_chunks::<8>().0.iter().map(|word| f64::from_le_bytes(*word)).collect();
        let array = |(name, view): (String, safetensors::tensor::TensorView)| {
            (name, (view.shape().to_vec(), values(view.data())))
        };
        Self { arrays: container.tensors().into_iter().map(array).collect(), entries }
    }

    /// Returns one of the arrays.
    pub fn array(&mut self, name: &str) -> &mut (Vec<usize>, Vec<f64>) {
        self.arrays.get_mut(name).unwrap()
    }

    /// Returns the file as bytes.
    pub fn bytes(&self) -> Vec<u8> {
        let mut header = serde_json::Map::from_iter([("__metadata__".to_owned(), serde_json::json!(self.entries))]);
        let mut data: Vec<u8> = Vec::new();
        for (name, (shape, values)) in &self.arrays {
            let start = data.len();
            data.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            let entry = serde_json::json!({"dtype": "F64", "shape": shape, "data_offsets": [start, data.len()]});
            header.insert(name.clone(), entry);
        }
        let header = serde_json::Value::Object(header).to_string();
        [u64::try_from(header.len()).unwrap().to_le_bytes().as_slice(), header.as_bytes(), &data].concat()
    }
}

/// Returns a generator of numbers in (-1, 1): matrices need many, and proptest's vectors are slow to shrink.
pub fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        f64::from(u32::try_from(state >> 32).unwrap()) / f64::from(u32::MAX) * 1.999 - 0.9995
    }
}

/// Checks that the file of `rom` is read back as `rom`, and that the changed file is rejected with a message that
/// contains all `parts`.
#[track_caller]
pub fn refused(rom: &Rom, change: impl FnOnce(&mut Loose), parts: &[&str]) {
    let mut file = Loose::of(rom);
    assert_eq!(read_rom(&file.bytes(), "of.rom").unwrap(), *rom);
    change(&mut file);
    let message = read_rom(&file.bytes(), "of.rom").unwrap_err().to_string();
    for part in ["of.rom: "].iter().chain(parts) {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
}
