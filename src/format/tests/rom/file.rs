//! ROM files: round trips, files written by hand as the user guide describes, and every kind of damage.

use nalgebra::DMatrix;
use proptest::prelude::*;
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, RomChecks};
use tiprub_format::{read_rom, write_rom};

use crate::cyclic::disks;
use crate::extras::with_extras;

/// Returns `count` numbers in (-1, 1).
fn numbers(seed: u64, count: usize) -> Vec<f64> {
    let mut next = crate::loose::numbers(seed);
    (0..count).map(|_| next()).collect()
}

fn random_rom(seed: u64, order: usize, nodes: usize, modes: usize, text: String) -> Rom {
    let square = |seed| DMatrix::from_vec(order, order, numbers(seed, order * order));
    let symmetric = |m: &DMatrix<f64>| (m + m.transpose()) * 0.5; // Exactly symmetric in floating point.
    let positive = |seed| symmetric(&(square(seed) * square(seed).transpose())) + DMatrix::identity(order, order);
    let values = numbers(seed + 5, nodes * 4);
    let contact_node = |index: usize| ContactNode {
        name: format!("node_{}", index + 1),
        position: [values[index * 4].abs() + 0.1, values[index * 4 + 1], values[index * 4 + 2]],
        meridional_slope: values[index * 4 + 3],
        ..ContactNode::default()
    };
    Rom {
        name: "blade".into(),
        origin: text,
        sectors: 1 + order,
        frame: if seed.is_multiple_of(2) { DisplacementFrame::Cylindrical } else { DisplacementFrame::Cartesian },
        mass: positive(seed + 1),
        stiffness: positive(seed + 2) * 1e9,
        damping_ratio: numbers(seed + 3, 1)[0].abs(),
        contact_map: DMatrix::from_vec(3 * nodes, order, numbers(seed + 4, 3 * nodes * order)),
        contact_nodes: (0..nodes).map(contact_node).collect(),
        checks: RomChecks {
            full_frequencies: numbers(seed + 6, modes),
            reduced_frequencies: numbers(seed + 7, modes),
            frequency_deviation: numbers(seed + 8, modes / 2),
            residual_criterion: Vec::new(),
            nodal_diameters: Vec::new(),
            ..RomChecks::default()
        },
        extras: tiprub_core::scene::rom::RomExtras::default(),
    }
}

/// Generates ROMs of all kinds.
fn roms() -> impl Strategy<Value = Rom> {
    let plain = (0..u64::MAX / 2, 1..8usize, 1..5usize, 0..6usize, ".*")
        .prop_map(|(seed, order, nodes, modes, text)| random_rom(seed, order, nodes, modes, text));
    prop_oneof![plain, disks(), with_extras()]
}

fn header_length(bytes: &[u8]) -> usize {
    8 + usize::try_from(u64::from_le_bytes(bytes[..8].try_into().unwrap())).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3 * 256, ..ProptestConfig::default() })]

    #[test]
    fn rom_round_trips_bit_for_bit(rom in roms()) {
        let bytes = write_rom(&rom);
        let again = read_rom(&bytes, "rom").unwrap();
        prop_assert_eq!(&again, &rom);
        // Compares bits, not values (0.0 == -0.0), because equal ROMs must give equal bytes.
        prop_assert_eq!(write_rom(&again), bytes);
    }

    #[test]
    fn corrupted_byte_is_rejected_or_harmless(rom in roms(), at in any::<prop::sample::Index>(), change in 1..=255u8) {
        let mut bytes = write_rom(&rom);
        let index = at.index(bytes.len());
        bytes[index] ^= change;
        if let Ok(read) = read_rom(&bytes, "rom") {
            prop_assert_eq!(read, rom);
        }
    }

    #[test]
    fn rejects_every_truncation(rom in roms(), at in any::<prop::sample::Index>()) {
        let bytes = write_rom(&rom);
        prop_assert!(read_rom(&bytes[..at.index(bytes.len())], "rom").is_err());
    }

    #[test]
    fn rejects_arbitrary_bytes_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(read_rom(&bytes, "rom").is_err());
    }
}

#[test]
fn corrupted_header_byte_is_rejected_or_harmless() {
    let rom = random_rom(3, 2, 2, 2, "a blade".into());
    let bytes = write_rom(&rom);
    let mut refused = 0;
    for index in 0..header_length(&bytes) {
        for change in [1, 0x20, 0x80] {
            let mut damaged = bytes.clone();
            damaged[index] ^= change;
            match read_rom(&damaged, "rom") {
                Ok(read) => assert_eq!(read, rom, "byte {index}"),
                Err(_) => refused += 1,
            }
        }
    }
    assert!(refused > header_length(&bytes), "{refused} changes refused");
}

#[test]
fn negative_zero_round_trips() {
    let mut rom = random_rom(4, 2, 1, 0, String::new());
    rom.contact_map[(0, 1)] = -0.0;
    let read = read_rom(&write_rom(&rom), "rom").unwrap();
    assert_eq!(read.contact_map[(0, 1)].to_bits(), (-0.0f64).to_bits());
}

/// A safetensors file as Python's `safetensors.numpy.save_file` writes it: metadata of the caller, arrays in any order.
struct ByHand {
    metadata: Vec<(&'static str, String)>,
    arrays: Vec<(&'static str, &'static str, Vec<usize>, Vec<f64>)>,
}

impl ByHand {
    /// Returns the example of the user guide: two coordinates, one contact node.
    fn example() -> Self {
        let text = |key, value: &str| (key, value.to_owned());
        Self {
            metadata: vec![
                text("format", "tiprub-rom"),
                text("format_version", "1"),
                text("name", "pendulum"),
                text("sectors", "12"),
                text("frame", "cylindrical"),
            ],
            arrays: vec![
                ("mass", "F64", vec![2, 2], vec![1.0, 0.0, 0.0, 2.0]),
                ("stiffness", "F64", vec![2, 2], vec![3e6, -1e6, -1e6, 4e6]),
                ("contact_map", "F64", vec![1, 3, 2], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
                ("contact_positions", "F64", vec![1, 3], vec![0.25, 0.1, 0.01]),
            ],
        }
    }

    fn array(&mut self, name: &str) -> &mut (&'static str, &'static str, Vec<usize>, Vec<f64>) {
        self.arrays.iter_mut().find(|array| array.0 == name).unwrap()
    }

    fn without(mut self, name: &str) -> Self {
        self.arrays.retain(|array| array.0 != name);
        self.metadata.retain(|entry| entry.0 != name);
        self
    }

    fn with(mut self, key: &'static str, value: &str) -> Self {
        self.metadata.retain(|entry| entry.0 != key);
        self.metadata.push((key, value.to_owned()));
        self
    }

    fn bytes(&self) -> Vec<u8> {
        let metadata: serde_json::Map<_, _> =
            self.metadata.iter().map(|(key, value)| ((*key).to_owned(), value.as_str().into())).collect();
        let mut header = serde_json::Map::from_iter([("__metadata__".to_owned(), metadata.into())]);
        let mut data: Vec<u8> = Vec::new();
        for (name, dtype, shape, values) in &self.arrays {
            let start = data.len();
            let single = |value: &f64| value.to_string().parse::<f32>().unwrap().to_le_bytes();
            match *dtype {
                "F32" => data.extend(values.iter().flat_map(single)),
                _ => data.extend(values.iter().flat_map(|value| value.to_le_bytes())),
            }
            let entry = serde_json::json!({"dtype": dtype, "shape": shape, "data_offsets": [start, data.len()]});
            header.insert((*name).to_owned(), entry);
        }
        let header = serde_json::Value::Object(header).to_string();
        let length = u64::try_from(header.len()).unwrap().to_le_bytes();
        [length.as_slice(), header.as_bytes(), &data].concat()
    }

    #[track_caller]
    fn refused_with(&self, parts: &[&str]) {
        let message = read_rom(&self.bytes(), "my.rom").unwrap_err().to_string();
        for part in ["my.rom: "].iter().chain(parts) {
            assert!(message.contains(part), "{part:?} is not in {message:?}");
        }
    }
}

#[test]
fn accepts_file_with_only_the_required_arrays() {
    let rom = read_rom(&ByHand::example().bytes(), "my.rom").unwrap();
    assert_eq!((rom.name.as_str(), rom.origin.as_str(), rom.sectors), ("pendulum", "", 12));
    assert_eq!(rom.frame, DisplacementFrame::Cylindrical);
    assert_eq!(rom.stiffness, DMatrix::from_row_slice(2, 2, &[3e6, -1e6, -1e6, 4e6]));
    // Rows are (node, component), columns coordinates.
    assert_eq!(rom.contact_map, DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    let node = ContactNode {
        name: "node_1".into(),
        position: [0.25, 0.1, 0.01],
        meridional_slope: 0.0,
        ..ContactNode::default()
    };
    assert_eq!(rom.contact_nodes, [node]);
    assert_eq!(rom.checks, RomChecks::default());
    assert_eq!(rom.damping_ratio.to_bits(), 0);
}

#[test]
fn rejects_wrong_array_shapes_with_name_and_both_shapes() {
    ByHand::example().without("mass").refused_with(&["array `mass`: missing", "`stiffness`", "[n, n]"]);
    let mut file = ByHand::example();
    file.array("stiffness").2 = vec![4, 1];
    file.refused_with(&["array `stiffness`: found shape [4, 1], expected [2, 2]"]);
    let mut file = ByHand::example();
    file.array("contact_map").2 = vec![3, 2];
    file.refused_with(&["array `contact_map`: found shape [3, 2], expected [nodes, 3, n]"]);
    let mut file = ByHand::example();
    file.array("contact_positions").2 = vec![3, 1];
    file.refused_with(&["array `contact_positions`: found shape [3, 1], expected [3, 3]"]);
    let mut file = ByHand::example();
    file.arrays.push(("contact_meridional_slopes", "F64", vec![2], vec![0.0, 0.0]));
    file.refused_with(&["array `contact_meridional_slopes`: found shape [2], expected [1]"]);
    let mut file = ByHand::example();
    file.arrays.push(("stifness", "F64", vec![1], vec![0.0]));
    file.refused_with(&["array `stifness`: unknown array", "Did you mean `stiffness`?"]);
    let mut file = ByHand::example();
    file.array("mass").1 = "F32";
    file.refused_with(&["array `mass`: found data type F32, expected F64", "astype(numpy.float64)"]);
    let mut file = ByHand::example();
    file.arrays.push(("full_frequencies", "F64", vec![2], vec![1.0, f64::NAN]));
    file.refused_with(&["array `full_frequencies`: entry 1 is NaN"]);
}

#[test]
fn rejects_values_that_do_not_describe_a_structure() {
    let mut file = ByHand::example();
    file.array("mass").3[3] = f64::INFINITY;
    file.refused_with(&["`mass`", "non-finite entry at (1, 1)"]);
    let mut file = ByHand::example();
    file.array("mass").3[3] = -2.0;
    file.refused_with(&["`mass`", "not positive definite"]);
    let mut file = ByHand::example();
    file.array("stiffness").3[1] = 7e6;
    file.refused_with(&["`stiffness`", "not symmetric"]);
    let mut file = ByHand::example();
    file.array("contact_positions").3[0] = -0.25;
    file.refused_with(&["`contact_positions`, node 1"]);
}

#[test]
fn rejects_invalid_metadata_by_key() {
    ByHand::example().with("format", "pt").refused_with(&["metadata `format`: found \"pt\"", "not a tiprub ROM file"]);
    ByHand::example().without("format").refused_with(&["metadata `format`: found nothing"]);
    ByHand::example().with("format_version", "2").refused_with(&["metadata `format_version`: found \"2\"", "release"]);
    ByHand::example().without("sectors").refused_with(&["metadata `sectors`: missing", "1 to 10000"]);
    ByHand::example().with("sectors", "-3").refused_with(&["metadata `sectors`: \"-3\" is not a valid number"]);
    ByHand::example().with("sectors", "0").refused_with(&["`sectors`", "zero sectors"]);
    for many in ["10001", "1000000000", "18446744073709551615"] {
        ByHand::example().with("sectors", many).refused_with(&["`sectors`", many, "exceed the limit of 10000"]);
    }
    ByHand::example().with("frame", "Cylindric").refused_with(&["metadata `frame`", "Did you mean `cylindrical`?"]);
    ByHand::example().with("damping_ratio", "1.5").refused_with(&["`damping_ratio`", "1.5"]);
    ByHand::example().with("dampingratio", "0.1").refused_with(&["`dampingratio`", "Did you mean `damping_ratio`?"]);
    ByHand::example().with("contact_names", "a,b").refused_with(&["`contact_names`: found 2 names, expected 1"]);
    ByHand::example().with("contact_names", "1st").refused_with(&["\"1st\" cannot be part of a variable name"]);
    ByHand::example().with("checksum", "0").refused_with(&["metadata `checksum`: stated \"0\"", "remove the entry"]);
}

#[test]
fn reports_that_a_file_is_truncated() {
    let bytes = ByHand::example().bytes();
    let message = |length| read_rom(&bytes[..length], "my.rom").unwrap_err().to_string();
    assert!(message(bytes.len() - 1).contains("truncated"), "{}", message(bytes.len() - 1));
    assert!(message(40).contains("does not match the file size of 40 bytes"), "{}", message(40));
    assert!(message(3).contains("only 3 bytes"), "{}", message(3));
    assert_eq!(read_rom(b"", "my.rom").unwrap_err().place.as_deref(), Some("my.rom"));
}
