//! ROM files of coupled sectors: a pencil per nodal diameter.

use std::collections::BTreeMap;

use crate::loose::{Loose, numbers};
use nalgebra::{Complex, DMatrix};
use proptest::prelude::*;
use tiprub_core::Rom;
use tiprub_core::scene::rom::{DisplacementFrame, Harmonic, RomChecks, RomExtras};
use tiprub_format::{read_rom, write_rom};
use tiprub_test_models::{node, structure};

/// Returns a Hermitian, positive definite matrix that equals its adjoint exactly; real for standing patterns.
fn hermitian(order: usize, real: bool, value: &mut dyn FnMut() -> f64) -> DMatrix<Complex<f64>> {
    let mut entry = |row: usize, column: usize| match (row == column, real) {
        (true, _) => Complex::new(4.0 * order as f64 + value(), 0.0),
        (false, true) => Complex::new(value(), 0.0),
        (false, false) => Complex::new(value(), value()),
    };
    let upper = DMatrix::from_fn(order, order, &mut entry);
    DMatrix::from_fn(order, order, |i, j| if i <= j { upper[(i, j)] } else { upper[(j, i)].conj() })
}

/// Returns a disk whose nodal diameters have different numbers of coordinates.
fn disk(seed: u64, sectors: usize, nodes: usize, order: impl Fn(usize) -> usize) -> Rom {
    let mut value = numbers(seed);
    let harmonic = |number: usize, value: &mut dyn FnMut() -> f64| {
        let real = 2 * number == sectors;
        let order = order(number);
        let mut entry = |_, _| Complex::new(value(), if real { 0.0 } else { value() });
        let contact_map = DMatrix::from_fn(3 * nodes, order, &mut entry);
        let (mass, stiffness) = (hermitian(order, real, value), hermitian(order, real, value) * Complex::from(1e6));
        Harmonic { mass, stiffness, contact_map }
    };
    let harmonics: Vec<_> = (1..=sectors / 2).map(|number| harmonic(number, &mut value)).collect();
    let modes = if harmonics.is_empty() { 0 } else { 4 };
    let frequencies: Vec<f64> = (0..modes).map(|_| 100.0 + value()).collect();
    let map = DMatrix::from_fn(3 * nodes, order(0), |_, _| value());
    let contact_nodes = (0..nodes).map(|index| node(format!("n{index}"), [0.35, 0.01 * index as f64, 0.0], 0.0));
    let identity = DMatrix::identity(order(0), order(0));
    let rom = structure("disk", identity.clone(), identity * 1e6, map, contact_nodes.collect());
    let checks = RomChecks {
        full_frequencies: frequencies.clone(),
        reduced_frequencies: frequencies,
        nodal_diameters: (0..modes).map(|mode| u32::try_from(mode % (sectors / 2 + 1)).unwrap()).collect(),
        ..RomChecks::default()
    };
    let extras = RomExtras { harmonics, ..RomExtras::default() };
    Rom { sectors, frame: DisplacementFrame::Cylindrical, damping_ratio: 0.005, checks, extras, ..rom }
}

/// Generates disks of all sizes, with any orders.
pub fn disks() -> impl Strategy<Value = Rom> {
    (0..u64::MAX / 2, 1..9usize, 1..4usize, prop::collection::vec(1..5usize, 5))
        .prop_map(|(seed, sectors, nodes, orders)| disk(seed, sectors, nodes, |number| orders[number]))
}

/// The real and the imaginary part are adjacent on the last axis; rows come before columns.
#[test]
fn complex_arrays_use_numpy_layout_with_parts_last() {
    let rom = disk(7, 4, 1, |number| 2 + number);
    let file = Loose::of(&rom);
    let (shape, values) = &file.arrays["mass_1"];
    assert_eq!(shape, &[3, 3, 2]);
    let mass = &rom.extras.harmonics[0].mass;
    assert_eq!(values[2..4].map_bits(), [mass[(0, 1)].re, mass[(0, 1)].im].map_bits());
    assert_eq!(values[6..8].map_bits(), [mass[(1, 0)].re, mass[(1, 0)].im].map_bits());
    let (shape, values) = &file.arrays["contact_map_2"];
    assert_eq!(shape, &[1, 3, 4, 2]);
    let map = &rom.extras.harmonics[1].contact_map;
    assert_eq!(values[2 * (4 + 3)..][..2].map_bits(), [map[(1, 3)].re, map[(1, 3)].im].map_bits());
    assert_eq!(file.arrays["nodal_diameters"], (vec![4], vec![0.0, 1.0, 2.0, 0.0]));
}

trait MapBits {
    fn map_bits(&self) -> Vec<u64>;
}
impl MapBits for [f64] {
    fn map_bits(&self) -> Vec<u64> {
        self.iter().map(|value| value.to_bits()).collect()
    }
}

/// 34 coordinates at 29 nodal diameters, three contact nodes: the file contains the matrices of all nodal diameters and
/// little else.
#[test]
fn reference_disk_takes_a_few_megabytes() {
    let size = write_rom(&disk(2, 56, 3, |_| 34)).len();
    let matrices = 28 * 2 * 8 * (2 * 34 * 34 + 9 * 34);
    assert!((matrices..matrices + 40_000).contains(&size), "{size} bytes, matrices above 0 take {matrices}");
}

#[test]
fn array_units_are_listed_once_for_all_nodal_diameters() {
    let units = |rom: &Rom| Loose::of(rom).entries["units"].clone();
    let coupled = units(&disk(3, 6, 1, |_| 2));
    assert!(coupled.contains("\nmass_<n> [m, m, 2]: kg\n"), "{coupled}");
    assert!(coupled.contains("\ncontact_map_<n> [nodes, 3, m, 2]: m per unit coordinate\n"), "{coupled}");
    assert!(coupled.ends_with("\nnodal_diameters [modes]: 1"), "{coupled}");
    let mut rom = disk(3, 6, 1, |_| 2);
    rom.extras.harmonics.clear();
    rom.checks.nodal_diameters.clear();
    assert!(!units(&rom).contains("_<n>") && !units(&rom).contains("nodal_diameters"));
}

#[track_caller]
fn refused(sectors: usize, change: impl FnOnce(&mut Loose), parts: &[&str]) {
    crate::loose::refused(&disk(9, sectors, 1, |_| 2), change, parts);
}

#[test]
fn rejects_missing_nodal_diameters() {
    for missing in ["mass_1", "stiffness_2", "contact_map_3"] {
        let part = format!("array `{missing}`: missing, although `");
        refused(6, |file| drop(file.arrays.remove(missing)), &[&part, "for every n from 1 to 3"]);
    }
    let last = |file: &mut Loose| file.arrays.retain(|name, _| !name.ends_with("_3"));
    refused(6, last, &["array `mass_3`: missing", "half of metadata `sectors`"]);
    let more = |file: &mut Loose| drop(file.entries.insert("sectors".into(), "8".into()));
    refused(6, more, &["array `mass_4`: missing"]);
    let fewer = |file: &mut Loose| drop(file.entries.insert("sectors".into(), "4".into()));
    refused(7, fewer, &["_3`: nodal diameter 3, but 4 sectors allow numbered arrays for 1 to 2 only"]);
    let one = |file: &mut Loose| drop(file.entries.insert("sectors".into(), "1".into()));
    refused(7, one, &["nodal diameter 1, but 1 sector(s) have none above 0"]);
    let zero = |file: &mut Loose| drop(file.arrays.insert("mass_0".into(), (vec![2, 2, 2], vec![0.0; 8])));
    refused(6, zero, &["array `mass_0`: nodal diameter 0, but 6 sectors", "nodal diameter 0 have no number"]);
}

#[test]
fn rejects_names_that_resemble_nodal_diameters() {
    for name in ["mass_01", "mass_+1", "mass_", "stiffness_1a", "mass_<n>", "contact_map_99999999999999999999999"] {
        let change = |file: &mut Loose| drop(file.arrays.insert(name.into(), (vec![1], vec![0.0])));
        refused(6, change, &[&format!("array `{name}`: ")]);
    }
    let change = |file: &mut Loose| drop(file.arrays.insert("stifness_1".into(), (vec![1], vec![0.0])));
    refused(6, change, &["array `stifness_1`: unknown array"]);
}

#[test]
fn rejects_wrong_shapes_by_name() {
    for name in ["mass_2", "stiffness_2"] {
        let part = format!("array `{name}`: found shape [");
        refused(6, |file| file.array(name).0 = vec![2, 4], &[&part, "expected [2, 2, 2]"]);
        refused(6, |file| file.array(name).0 = vec![8], &[&part]);
    }
    refused(
        6,
        |file| file.array("contact_map_1").0 = vec![3, 2, 2],
        &["array `contact_map_1`: found shape [3, 2, 2], expected [1, 3, 2, 2]"],
    );
    let other = |file: &mut Loose| *file.array("stiffness_3") = (vec![1, 1, 2], vec![1.0, 0.0]);
    refused(6, other, &["array `stiffness_3`: found shape [1, 1, 2], expected [2, 2, 2] (same shape as `mass_3`)"]);
    let empty = |file: &mut Loose| {
        *file.array("mass_1") = (vec![0, 0, 2], vec![]);
        *file.array("stiffness_1") = (vec![0, 0, 2], vec![]);
        *file.array("contact_map_1") = (vec![1, 3, 0, 2], vec![]);
    };
    refused(6, empty, &["array `mass_1`"]);
}

#[test]
fn rejects_impossible_values_by_name() {
    refused(7, |file| file.array("mass_2").1[3] += 1.0, &["array `mass_2`", "not Hermitian"]);
    refused(7, |file| file.array("stiffness_3").1[1] += 1e6, &["array `stiffness_3`", "not Hermitian"]);
    refused(7, |file| file.array("mass_1").1[0] = -9.0, &["array `mass_1`", "not positive definite"]);
    refused(7, |file| file.array("contact_map_2").1[5] = f64::NAN, &["array `contact_map_2`", "non-finite"]);
    // For half as many nodal diameters as sectors, neighbours move in opposite directions, so the pattern cannot
    // travel.
    refused(6, |file| file.array("contact_map_3").1[1] = 0.5, &["array `contact_map_3`", "imaginary part"]);
}

#[test]
fn rejects_inconsistent_nodal_diameters_of_the_checks() {
    let name = "array `nodal_diameters`: ";
    let set = |index: usize, value: f64| move |file: &mut Loose| file.array("nodal_diameters").1[index] = value;
    for (value, text) in [(0.5, "entry 1 is 0.5"), (-1.0, "entry 1 is -1"), (4.0, "not a whole number from 0 to 3")] {
        refused(6, set(1, value), &[name, text]);
    }
    refused(6, set(2, f64::NAN), &[name, "entry 2 is NaN"]);
    let short = |file: &mut Loose| *file.array("nodal_diameters") = (vec![3], vec![0.0; 3]);
    refused(6, short, &[name, "found 3 values, but 4 in `full_frequencies`"]);
    let uncoupled = |file: &mut Loose| file.arrays.retain(|name, _| !name.ends_with(|c: char| c.is_ascii_digit()));
    refused(6, uncoupled, &[name, "given although the sectors are not coupled"]);
}

/// After removing these arrays from the file, everything that does not belong to nodal diameters is read unchanged.
#[test]
fn without_the_arrays_of_nodal_diameters_sectors_are_uncoupled() {
    let mut file = Loose::of(&disk(9, 6, 1, |_| 2));
    let coupled: BTreeMap<_, _> = std::mem::take(&mut file.arrays);
    let kept = coupled.into_iter().filter(|(name, _)| !name.ends_with(|c: char| c.is_ascii_digit()));
    file.arrays = kept.filter(|(name, _)| name != "nodal_diameters").collect();
    let rom = read_rom(&file.bytes(), "blades").unwrap();
    assert!(!rom.is_cyclic() && rom.sectors == 6 && rom.checks.nodal_diameters.is_empty());
}
