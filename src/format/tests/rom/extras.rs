//! Optional data of ROM files: spin, heat, contact grid.

use crate::loose::{Loose, numbers};
use nalgebra::DMatrix;
use proptest::prelude::*;
use sha2::{Digest, Sha256};
use tiprub_core::Rom;
use tiprub_core::scene::rom::{
    ContactGrid, ContactNode, DisplacementFrame, ReductionBasis, RubErrors, Spin, SupportRows, Thermal, WatchedPoints,
};
use tiprub_cosim::ThermalPatch;
use tiprub_format::{read_rom, write_rom};
use tiprub_test_models::{node, structure};

const AROUND: usize = 6;
const ALONG: usize = 2;

/// Returns a ring of 6 x 2 contact nodes with `order` coordinates; `value` generates its numbers.
fn ring(order: usize, value: &mut dyn FnMut() -> f64) -> Rom {
    let nodes = AROUND * ALONG;
    let place = |index: usize| {
        [0.25, (index % AROUND) as f64 * std::f64::consts::TAU / AROUND as f64, (index / AROUND) as f64 * 0.02]
    };
    let contact_nodes = (0..nodes).map(|index| node(format!("n{index}"), place(index), 0.0)).collect();
    let map = DMatrix::from_fn(3 * nodes, order, |_, _| value());
    let (mass, stiffness) = (DMatrix::identity(order, order), DMatrix::identity(order, order) * 1e6);
    let ring = structure("ring", mass, stiffness, map, contact_nodes);
    Rom { frame: DisplacementFrame::Cylindrical, damping_ratio: 0.001, origin: "by hand".into(), ..ring }
}

fn spin(order: usize, value: &mut dyn FnMut() -> f64) -> Spin {
    let mut square = |sign: f64| {
        let matrix = DMatrix::from_fn(order, order, |_, _| value());
        (&matrix + matrix.transpose() * sign) * 0.5
    };
    Spin {
        stiffness_speed2: square(1.0),
        stiffness_speed4: square(1.0) * 1e-9,
        coriolis: square(-1.0),
        centrifugal_load: (0..order).map(|_| value()).collect(),
        centrifugal_load_speed4: (0..order).map(|_| value()).collect(),
        largest_speed: 1800.0 + value(),
    }
}

fn thermal(order: usize, patches: usize, value: &mut dyn FnMut() -> f64) -> Thermal {
    let patch = |value: &mut dyn FnMut() -> f64| {
        let (angle, axial) = (value(), value());
        ThermalPatch { angle: [angle, angle + 1.0 + value()], axial: [axial, axial + 1.0 + value().abs()] }
    };
    Thermal {
        loads: DMatrix::from_fn(order, patches, |_, _| value()),
        patches: (0..patches).map(|_| patch(value)).collect(),
    }
}

fn complete(seed: u64, order: usize, patches: usize) -> Rom {
    let mut value = numbers(seed);
    let mut rom = ring(order, &mut value);
    rom.extras.spin = Some(spin(order, &mut value));
    rom.extras.thermal = Some(thermal(order, patches, &mut value));
    rom.extras.grid = Some(ContactGrid { around: AROUND, along: ALONG, closed: true });
    let point = |(index, name): (usize, &str)| ContactNode {
        name: name.into(),
        position: [0.25, 0.1 * index as f64, value()],
        ..ContactNode::default()
    };
    let points: Vec<ContactNode> = ["leading_edge", "mid_chord"].into_iter().enumerate().map(point).collect();
    rom.extras.watched =
        Some(WatchedPoints { map: DMatrix::from_fn(6, order, |_, _| value()), points: points.clone() });
    rom.extras.stress = Some(WatchedPoints { map: DMatrix::from_fn(12, order, |_, _| value()), points });
    rom.extras.stress_thermal = Some(DMatrix::from_fn(12, patches, |_, _| value()));
    rom.extras.stress_centrifugal = Some(DMatrix::from_fn(12, 1, |_, _| value()));
    rom.extras.support = Some(SupportRows {
        stiffness: DMatrix::from_fn(6, order, |_, _| value()),
        mass: DMatrix::from_fn(6, order, |_, _| value()),
        thermal: DMatrix::from_fn(6, patches, |_, _| value()),
    });
    rom.extras.basis = ReductionBasis::FreeInterface;
    (rom.checks.response_frequencies, rom.checks.response_deviation) = (vec![100.0, 2e3], vec![0.1, value()]);
    rom.checks.flexibility_deviation = vec![1e-9; rom.contact_nodes.len()];
    for node in &mut rom.contact_nodes {
        (node.area, node.length) = (value().abs(), value().abs());
    }
    rom
}

/// Returns the ROM without most of its optional data.
fn plain(rom: &Rom) -> Rom {
    let mut rom = rom.clone();
    (rom.extras.watched, rom.extras.stress, rom.extras.basis) = (None, None, ReductionBasis::default());
    (rom.extras.stress_thermal, rom.extras.stress_centrifugal, rom.extras.support) = (None, None, None);
    rom.checks.response_frequencies.clear();
    rom.checks.response_deviation.clear();
    rom.checks.flexibility_deviation.clear();
    rom.contact_nodes.iter_mut().for_each(|node| (node.area, node.length) = (0.0, 0.0));
    rom
}

fn rub_errors() -> RubErrors {
    let found_on = "a light rub, 4 ms".into();
    RubErrors { found_on, modes: Some(0.0125), patches: None, rows: Some(0.23), mesh: Some(1.0 / 3.0) }
}

#[test]
fn reads_back_known_rub_errors() {
    let with = |errors: Option<RubErrors>| {
        let mut rom = plain(&complete(3, 4, 2));
        rom.checks.rub_errors = errors;
        rom
    };
    let without = write_rom(&with(None));
    // Unknown errors are not written.
    assert_eq!(write_rom(&with(Some(RubErrors { found_on: "nothing".into(), ..RubErrors::default() }))), without);
    let none = RubErrors { found_on: String::new(), patches: Some(0.0), ..rub_errors() };
    let across = RubErrors { rows: None, mesh: None, ..rub_errors() };
    for errors in [rub_errors(), none, across] {
        let rom = with(Some(errors));
        assert_eq!(read_rom(&write_rom(&rom), "rom").unwrap(), rom);
    }
    for (text, reported) in [
        ("modes=0.1,nodes=0.2", "\"nodes=0.2\" does not name a known error"),
        ("modes=0.1,modes=0.2", "\"modes=0.2\" is repeated or is not a non-negative number"),
        ("mesh=-1", "\"mesh=-1\" is repeated or is not"),
        ("mesh=NaN", "\"mesh=NaN\" is repeated or is not"),
        ("patches", "\"patches\" is repeated or is not"),
    ] {
        refused(
            |file| drop(file.entries.insert("rub_errors".into(), text.into())),
            &["metadata `rub_errors`", reported],
        );
    }
    let alone = |file: &mut Loose| drop(file.entries.insert("rub_errors_found_on".into(), "a rub".into()));
    refused(alone, &["metadata `rub_errors_found_on`: given without `rub_errors`"]);
}

#[test]
fn rejects_incomplete_or_unsupported_watched_points() {
    let rom = complete(5, 3, 1);
    let refused = |change: &dyn Fn(&mut Loose)| {
        let mut file = Loose::of(&rom);
        change(&mut file);
        read_rom(&file.bytes(), "rom").unwrap_err().to_string()
    };
    let reported = refused(&|file| drop(file.arrays.remove("watched_positions")));
    assert!(reported.contains("`watched_positions`") && reported.contains("`watched_map`"), "{reported}");
    let reported = refused(&|file| drop(file.entries.insert("watched_names".into(), "a,a".into())));
    assert!(reported.contains("`watched_names`") && reported.contains("twice"), "{reported}");
    let reported = refused(&|file| drop(file.arrays.remove("stress_map")));
    assert!(reported.contains("`stress_map`") && reported.contains("`stress_positions`"), "{reported}");
    let reported = refused(&|file| drop(file.entries.insert("stress_names".into(), "a".into())));
    assert!(reported.contains("`stress_names`") && reported.contains("`stress_positions`"), "{reported}");
    let reported = refused(&|file| {
        let map = file.arrays["watched_map"].clone();
        file.arrays.insert("stress_map".into(), map);
    });
    assert!(reported.contains("`stress_map`") && reported.contains("6 components"), "{reported}");
    let reported = refused(&|file| drop(file.entries.insert("basis".into(), "free_interface".into())));
    assert!(reported.contains("`basis`") && reported.contains("free-interface"), "{reported}");
    let mut negative = rom.clone();
    negative.contact_nodes[0].area = -1e-6;
    let reported = read_rom(&write_rom(&negative), "rom").unwrap_err().to_string();
    assert!(reported.contains("`contact_areas`, node 1"), "{reported}");
}

/// Generates ROMs with any of the extras.
pub fn with_extras() -> impl Strategy<Value = Rom> {
    (0..u64::MAX / 2, 1..7usize, 1..5usize, prop::array::uniform5(any::<bool>())).prop_map(
        |(seed, order, patches, has)| {
            let mut rom = complete(seed, order, patches);
            let extras = &mut rom.extras;
            if !has[0] {
                (extras.spin, extras.stress_centrifugal) = (None, None);
            }
            if !has[1] {
                // The patches are columns of the other arrays.
                (extras.thermal, extras.stress_thermal, extras.support) = (None, None, None);
            }
            if !has[2] {
                extras.grid = None;
            }
            if !has[3] {
                extras.watched = None;
            }
            if has[4] { plain(&rom) } else { rom }
        },
    )
}

/// Rows of patches must be complete rows of at least two patches with areas; a single row is rejected.
#[test]
fn rejects_patch_rows_that_do_not_match_the_patches() {
    let mut rom = complete(7, 3, 1);
    (rom.extras.grid, rom.extras.rows) = (None, Some(2));
    let nodes = rom.contact_nodes.len();
    assert!(nodes.is_multiple_of(2));
    let with = |rom: &Rom, rows: &str| {
        let mut file = Loose::of(rom);
        file.entries.insert("contact_rows".into(), rows.into());
        read_rom(&file.bytes(), "rom")
    };
    assert_eq!(with(&rom, " 2 ").unwrap().rows(), 2);
    assert_eq!(with(&rom, "1").unwrap().extras.rows, None);
    let more = (nodes + 1).to_string();
    for (rows, reported) in [("two", "not a whole number"), ("0", "patches in 0 rows"), (more.as_str(), "are required")]
    {
        let error = with(&rom, rows).unwrap_err().to_string();
        assert!(error.contains("`contact_rows`") && error.contains(reported), "{error}");
    }
    rom.contact_nodes[0].area = 0.0;
    assert!(with(&rom, "2").unwrap_err().to_string().contains("without areas"));
}

/// Returns a rectangle of 4 x 3 nodes with free edges, in a Cartesian frame.
fn panel(order: usize, value: &mut dyn FnMut() -> f64) -> Rom {
    let mut rom = ring(order, value);
    rom.frame = DisplacementFrame::Cartesian;
    for (index, node) in rom.contact_nodes.iter_mut().enumerate() {
        node.position = [(index % 4) as f64 * 0.01, (index / 4) as f64 * 0.02, 0.001 * value()];
    }
    rom.extras.grid = Some(ContactGrid { around: 4, along: 3, closed: false });
    rom
}

#[test]
fn open_grid_is_marked_in_the_metadata() {
    let mut value = numbers(11);
    let rom = panel(5, &mut value);
    let mut file = Loose::of(&rom);
    assert_eq!(file.entries["contact_grid"], "4,3,open");
    assert_eq!(read_rom(&file.bytes(), "panel").unwrap(), rom);
    file.entries.insert("contact_grid".into(), " 4 , 3 , open ".into());
    assert_eq!(read_rom(&file.bytes(), "panel").unwrap(), rom);
    for (text, part) in [
        ("4,3", "a closed contact grid needs a cylindrical frame"),
        ("4,3,shut", "is not of the form `around,along` or `around,along,open` with two whole numbers"),
        ("4,3,open,open", "or `around,along,open`"),
        ("5,3,open", "5 around x 3 along"),
        ("12,1,open", "less than 2 x 2"),
    ] {
        file.entries.insert("contact_grid".into(), text.into());
        let message = read_rom(&file.bytes(), "panel.rom").unwrap_err().to_string();
        assert!(message.starts_with("panel.rom: ") && message.contains(part), "{text}: {message}");
    }
    refused(|file| drop(file.entries.insert("contact_grid".into(), "6,2,open".into())), &["needs a Cartesian frame"]);
}

/// The reference file was written by the release before there were extras.
#[test]
fn file_without_extras_is_unchanged() {
    let mut value = numbers(5);
    let bytes = write_rom(&ring(3, &mut value));
    let digest: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(
        (bytes.len(), digest.as_str()),
        (2392, "d97baeef343c74d1d34917d6b55eb51abd1011bf1a3b2eb47abda1920d904261")
    );
    let text = String::from_utf8_lossy(&bytes).into_owned();
    for name in ["stiffness_speed2", "coriolis", "centrifugal", "thermal", "largest_speed", "contact_grid"] {
        assert!(!text.contains(name), "{name}");
    }
}

#[test]
fn units_are_listed_for_the_arrays_in_the_file() {
    let units = |rom: &Rom| {
        let bytes = write_rom(rom);
        let (_, header) = safetensors::SafeTensors::read_metadata(&bytes).unwrap();
        header.metadata().as_ref().unwrap()["units"].clone()
    };
    let mut rom = complete(3, 2, 2);
    assert!(units(&rom).contains("\nstiffness_speed4 [n, n]: kg s^2\n"), "{}", units(&rom));
    assert!(units(&rom).contains("\nthermal_patches [patches, 4]: rad, rad, m, m\n"), "{}", units(&rom));
    assert!(units(&plain(&rom)).ends_with("\nthermal_patches [patches, 4]: rad, rad, m, m"));
    rom.extras.spin = None;
    assert!(units(&rom).contains("thermal_loads") && !units(&rom).contains("speed"), "{}", units(&rom));
}

#[track_caller]
fn refused(change: impl FnOnce(&mut Loose), parts: &[&str]) {
    crate::loose::refused(&complete(9, 2, 2), change, parts);
}

#[test]
fn rejects_incomplete_groups_of_arrays() {
    for name in ["stiffness_speed2", "stiffness_speed4", "coriolis", "centrifugal_load", "centrifugal_load_speed4"] {
        let missing = format!("array `{name}`: missing, although `");
        refused(|file| drop(file.arrays.remove(name)), &[&missing, "Give all of `stiffness_speed2`, "]);
    }
    for (name, other) in [("thermal_loads", "thermal_patches"), ("thermal_patches", "thermal_loads")] {
        let missing = format!("array `{name}`: missing, although `{other}` is present");
        refused(|file| drop(file.arrays.remove(name)), &[&missing]);
    }
    refused(|file| drop(file.entries.remove("largest_speed")), &["metadata `largest_speed`: missing", "(rad/s)"]);
    let without = |file: &mut Loose| file.arrays.retain(|name, _| !name.contains("speed") && !name.starts_with('c'));
    refused(
        |file| {
            let kept = ["contact_map", "contact_positions", "contact_meridional_slopes"];
            let kept = kept.map(|name| (name.to_owned(), file.arrays[name].clone()));
            without(file);
            file.arrays.extend(kept);
        },
        &["metadata `largest_speed`: given without the array `stiffness_speed2`"],
    );
}

#[test]
fn rejects_wrong_shapes_by_name() {
    for name in ["stiffness_speed2", "stiffness_speed4", "coriolis"] {
        let shape = format!("array `{name}`: found shape [4, 1], expected [2, 2]");
        refused(|file| file.array(name).0 = vec![4, 1], &[&shape]);
        let dimensions = format!("array `{name}`: found shape [4], expected [n, n]");
        refused(|file| file.array(name).0 = vec![4], &[&dimensions]);
    }
    let parts = ["array `centrifugal_load`: found shape [2, 1], expected [n]"];
    refused(|file| file.array("centrifugal_load").0 = vec![2, 1], &parts);
    let parts = ["array `thermal_patches`: found shape [4, 2], expected [4, 4]", "two angles and two axial"];
    refused(|file| file.array("thermal_patches").0 = vec![4, 2], &parts);
    let parts = ["array `thermal_loads`: found shape [1, 4], expected [2, 2]"];
    refused(|file| file.array("thermal_loads").0 = vec![1, 4], &parts);
    refused(|file| drop(file.arrays.insert("thermal_load".into(), (vec![1], vec![0.0]))), &["`thermal_loads`?"]);
}

#[test]
fn rejects_impossible_values() {
    refused(|file| file.array("stiffness_speed2").1[1] += 1.0, &["array `stiffness_speed2`: not symmetric"]);
    refused(|file| file.array("coriolis").1[0] += 1.0, &["array `coriolis`: not skew-symmetric"]);
    refused(|file| file.array("centrifugal_load").1[0] = f64::NAN, &["array `centrifugal_load`"]);
    refused(|file| file.array("thermal_loads").1[0] = f64::INFINITY, &["array `thermal_loads`"]);
    refused(
        |file| file.array("thermal_patches").1[5] = -9.0,
        &["array `thermal_patches`, patch 2", "do not define a patch"],
    );
    for speed in ["0", "-1", "inf", "NaN"] {
        let change = |file: &mut Loose| drop(file.entries.insert("largest_speed".into(), speed.into()));
        refused(change, &["ROM metadata `largest_speed`", "not a finite positive speed"]);
    }
    let entry = |name: &'static str, text: &'static str| {
        move |file: &mut Loose| drop(file.entries.insert(name.into(), text.into()))
    };
    refused(entry("largest_speed", "fast"), &["metadata `largest_speed`: \"fast\" is not a valid number"]);
    for text in ["", "6", "6,2,1", "6,2,open,", "open", "6x2", "-6,2", "6.0,2", "99999999999999999999,2"] {
        refused(entry("contact_grid", text), &["metadata `contact_grid`", "is not of the form `around,along`"]);
    }
    refused(entry("contact_grid", "2,6"), &["metadata `contact_grid`: 2 around x 6 along"]);
    refused(entry("contact_grid", "18446744073709551615,2"), &["metadata `contact_grid`"]);
    refused(entry("contact_grid", "4,3"), &["metadata `contact_grid`", "is not at its grid position"]);
    refused(entry("sectors", "3"), &["metadata `contact_grid`", "one sector"]);
    let spaces = |file: &mut Loose| drop(file.entries.insert("contact_grid".into(), " 6 , 2 ".into()));
    let mut file = Loose::of(&complete(9, 2, 2));
    spaces(&mut file);
    assert_eq!(
        read_rom(&file.bytes(), "ring").unwrap().extras.grid,
        Some(ContactGrid { around: 6, along: 2, closed: true })
    );
}

#[test]
fn reads_back_every_extra_on_its_own() {
    let full = complete(3, 4, 2);
    let without = plain(&full);
    let with: [fn(&mut Rom, &Rom); 12] = [
        |rom, full| rom.extras.support.clone_from(&full.extras.support),
        |rom, full| rom.extras.stress.clone_from(&full.extras.stress),
        |rom, full| {
            rom.extras.stress.clone_from(&full.extras.stress);
            rom.extras.stress_thermal.clone_from(&full.extras.stress_thermal);
        },
        |rom, full| {
            rom.extras.stress.clone_from(&full.extras.stress);
            rom.extras.stress_centrifugal.clone_from(&full.extras.stress_centrifugal);
        },
        |rom, full| rom.extras.watched.clone_from(&full.extras.watched),
        |rom, full| rom.extras.basis = full.extras.basis,
        |rom, full| rom.checks.response_frequencies.clone_from(&full.checks.response_frequencies),
        |rom, full| rom.checks.flexibility_deviation.clone_from(&full.checks.flexibility_deviation),
        |rom, full| rom.contact_nodes[1].area = full.contact_nodes[1].area,
        |rom, full| rom.contact_nodes[1].length = full.contact_nodes[1].length,
        |rom, _| rom.checks.rub_errors = Some(rub_errors()),
        |rom, full| {
            rom.contact_nodes.clone_from(&full.contact_nodes);
            (rom.extras.grid, rom.extras.rows) = (None, Some(2));
        },
    ];
    for change in with {
        let mut rom = without.clone();
        change(&mut rom, &full);
        assert_ne!(rom, without);
        assert_eq!(read_rom(&write_rom(&rom), "rom").unwrap(), rom);
    }
}
