//! Blade of rotor 37 under spin against CalculiX: full model, and reduced model with its fit over the speed.

use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector};
use tiprub_model::assembly::{Assembled, assemble, free_dofs};
use tiprub_model::craig_bampton::dense_modes;
use tiprub_model::progress::silent;
use tiprub_model::reduce::ReductionKind;
use tiprub_model::reduce::full_modes;
use tiprub_model::rotor37::{DESIGN_SPEED, MeshCounts, TipContact, blade_mesh};
use tiprub_model::sparse::{SparseMatrix, principal_pair};
use tiprub_model::spin::{
    Rotating, SpinningState, frequencies_at, gyroscopic_frequencies, static_growth, stiffness_at, turned_about_axis,
};
use tiprub_model::{Material, Mesh, Reduction, Rotor37Options, reduce_rotor37};

/// Returns the lines of the reference: kind, speed, number, values.
fn reference(kind: &str, speed: f64) -> Vec<(usize, Vec<f64>)> {
    include_str!("data/rotor37_spin_calculix.csv")
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>())
        .filter(|words| words[0] == kind && words[1].parse() == Ok(speed))
        .map(|words| (words[2].parse().unwrap(), words[3..].iter().map(|word| word.parse().unwrap()).collect()))
        .collect()
}

struct SpinBlade {
    mesh: Mesh,
    assembled: Assembled,
    free: Vec<usize>,
    stiffness: SparseMatrix,
    mass: SparseMatrix,
}

impl SpinBlade {
    fn new(counts: MeshCounts) -> Self {
        let mesh = blade_mesh(counts).unwrap().mesh;
        let assembled = assemble(&mesh, &Material::maraging_steel(), &silent).unwrap();
        let free = free_dofs(mesh.nodes.len(), mesh.set("hub").unwrap());
        let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
        Self { mesh, assembled, free, stiffness, mass }
    }

    fn at(&self, speed: f64) -> SpinningState {
        let material = Material::maraging_steel();
        let body = Rotating::new(&self.mesh, &material, &self.assembled, &self.free, &self.stiffness).unwrap();
        body.equilibrium(speed, body.at_rest()).unwrap()
    }
}

/// Returns the full blade, computed once.
fn full() -> &'static SpinBlade {
    static BLADE: OnceLock<SpinBlade> = OnceLock::new();
    BLADE.get_or_init(|| SpinBlade::new(MeshCounts::default()))
}

/// Returns the reduced blade, computed once for all tests of this file.
fn reduced() -> &'static Reduction {
    static REDUCTION: OnceLock<Reduction> = OnceLock::new();
    REDUCTION.get_or_init(|| {
        let options = Rotor37Options { spin: Some(DESIGN_SPEED), ..Rotor37Options::paper() };
        reduce_rotor37(&options, &silent).unwrap()
    })
}

#[test]
fn the_full_model_under_spin_agrees_with_calculix() {
    let blade = full();
    for speed in [900.0, 1300.0, 1800.0] {
        let state = blade.at(speed);
        println!("{speed} rad/s: {} corrections, residual {:.1e}", state.iterations, state.residual);
        let nodes = reference("growth", speed);
        assert_eq!(nodes.len(), 7);
        let largest = nodes.iter().flat_map(|(_, growth)| growth).fold(0.0_f64, |worst, value| worst.max(value.abs()));
        let mut worst = 0.0_f64;
        for (node, growth) in nodes {
            for (i, expected) in growth.iter().enumerate() {
                let row = blade.free.binary_search(&(3 * (node - 1) + i)).unwrap();
                let deviation = (state.displacement[(row, 0)] - expected) / largest;
                worst = worst.max(deviation.abs());
                assert!(deviation.abs() < 1e-6, "{speed} rad/s, node {node}, direction {i}: off by {deviation:e}");
            }
        }
        println!(
            "{speed} rad/s: growth of the tip off by {worst:.1e} of the largest, strain {:.1e}",
            state.largest_strain
        );
        let modes = full_modes(&state.stiffness, &blade.mass, false, 10, &silent).unwrap().modes;
        for ((mode, expected), found) in reference("frequency", speed).iter().zip(modes.frequencies()) {
            let deviation = (found / expected[0] - 1.0) * 100.0;
            println!("{speed} rad/s, mode {mode}: {found:.4} Hz, CalculiX {} Hz, {deviation:.1e} %", expected[0]);
            assert!(deviation.abs() < 1e-4);
        }
        let coriolis = reference("coriolis", speed);
        if coriolis.is_empty() {
            continue;
        }
        // As in CalculiX: the Coriolis force among these ten modes only.
        let product =
            modes.shapes.transpose() * blade.mass.times(turned_about_axis(&blade.free, &modes.shapes).as_ref());
        let gyroscopic = DMatrix::from_fn(10, 10, |i, j| speed * (product[(i, j)] - product[(j, i)]));
        let found = gyroscopic_frequencies(&modes.eigenvalues, &gyroscopic);
        for (((mode, expected), found), still) in coriolis.iter().zip(found).zip(modes.frequencies()) {
            println!(
                "{speed} rad/s, mode {mode}: Coriolis {:+.4} Hz, CalculiX {:+.4} Hz",
                found - still,
                expected[0] - still
            );
            // The last printed digit is 1 mHz, and the iteration of CalculiX has about the same error; shifts reach
            // 200 mHz.
            assert!((found - expected[0]).abs() < 3e-3);
        }
    }
}

#[test]
fn the_reduced_model_under_spin_agrees_with_calculix() {
    let reduction = reduced();
    let rom = &reduction.rom;
    let spin = rom.extras.spin.as_ref().unwrap();
    for speed in [900.0, 1300.0, 1800.0] {
        let found = frequencies_at(rom, speed, false).unwrap();
        for ((mode, expected), found) in reference("frequency", speed).iter().zip(found) {
            let deviation = (found / expected[0] - 1.0) * 100.0;
            println!("{speed} rad/s, mode {mode}: {found:.3} Hz, CalculiX {} Hz, {deviation:+.4} %", expected[0]);
            assert!(deviation.abs() < if *mode <= 6 { 0.05 } else { 0.3 });
        }
        let growth = static_growth(&rom.stiffness, spin, speed).unwrap();
        let nodes = reference("growth", speed);
        let line: Vec<_> = [103, 1927, 3751].map(|node| nodes.iter().find(|entry| entry.0 == node).unwrap()).to_vec();
        let mut worst = 0.0_f64;
        let mut largest = 0.0_f64;
        for (index, (contact, (_, cartesian))) in rom.contact_nodes.iter().zip(&line).enumerate() {
            let (sin, cos) = contact.position[1].sin_cos();
            let exact =
                [cos * cartesian[0] + sin * cartesian[1], -sin * cartesian[0] + cos * cartesian[1], cartesian[2]];
            let found = [0, 1, 2].map(|i| growth[3 * index + i]);
            println!(
                "{speed} rad/s, {}: radial, tangential, axial {:.3?} µm, CalculiX {:.3?} µm",
                contact.name,
                found.map(|x| 1e6 * x),
                exact.map(|x| 1e6 * x)
            );
            for i in 0..3 {
                worst = worst.max((found[i] - exact[i]).abs());
                largest = largest.max(exact[i].abs());
            }
        }
        println!("{speed} rad/s: growth off by {:.3} % of the largest", worst / largest * 100.0);
        assert!(worst < 0.005 * largest);
    }
}

/// Unit forces on the contact nodes: the reduced model has the compliance of the full one about the same spinning
/// state.
#[test]
fn contact_compliance_under_spin_matches_full_model() {
    let (blade, rom) = (full(), &reduced().rom);
    let spin = rom.extras.spin.as_ref().unwrap();
    let nodes = [103, 1927, 3751].map(|number: usize| number - 1);
    let rows: Vec<usize> = nodes
        .iter()
        .flat_map(|node| (0..3).map(move |i| 3 * node + i))
        .map(|dof| blade.free.binary_search(&dof).unwrap())
        .collect();
    let mut turn = DMatrix::<f64>::identity(9, 9);
    for (k, contact) in rom.contact_nodes.iter().enumerate() {
        let (sin, cos) = contact.position[1].sin_cos();
        turn.view_mut((3 * k, 3 * k), (2, 2)).copy_from_slice(&[cos, sin, -sin, cos]);
    }
    for (speed, tolerance) in [(1300.0, 2e-3), (1800.0, 1e-7)] {
        let unit = faer::Mat::from_fn(blade.free.len(), 9, |i, j| if i == rows[j] { 1.0 } else { 0.0 });
        let response = blade.at(speed).stiffness.factor("K", "").unwrap().solve(unit);
        let full = turn.transpose() * DMatrix::from_fn(9, 9, |i, j| response[(rows[i], j)]) * &turn;
        let reduced = stiffness_at(&rom.stiffness, spin, speed).cholesky().unwrap().inverse();
        let deviation = (reduced.view((0, 0), (9, 9)) - &full).amax() / full.amax();
        println!("{speed} rad/s: compliance of the contact nodes off by {deviation:.1e}");
        assert!(deviation < tolerance);
    }
}

/// φᵢᵀGφⱼ between the first six modes about the spinning state, which are defined up to their signs. These entries
/// are small, since the blade hardly moves across its flat sides, and sensitive to the shapes: 20 component modes of
/// the default mesh cause an error of 6 % of the largest, 80 an error of 0.2 %, 1 % on the mesh of this test.
#[test]
fn coriolis_coupling_matches_full_model() {
    let mesh = COARSE;
    let options = Rotor37Options { mesh, modes: 80, spin: Some(DESIGN_SPEED), ..Rotor37Options::paper() };
    let (blade, rom) = (SpinBlade::new(mesh), reduce_rotor37(&options, &silent).unwrap().rom);
    let spin = rom.extras.spin.as_ref().unwrap();
    let modes = full_modes(&blade.at(DESIGN_SPEED).stiffness, &blade.mass, false, 6, &silent).unwrap().modes;
    let full = modes.shapes.transpose() * blade.mass.times(turned_about_axis(&blade.free, &modes.shapes).as_ref());
    let (_, vectors) = dense_modes(&stiffness_at(&rom.stiffness, spin, DESIGN_SPEED), &rom.mass).unwrap();
    let reduced = vectors.transpose() * &spin.coriolis * &vectors;
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for (i, j) in (0..6).flat_map(|i| (0..i).map(move |j| (i, j))) {
        worst = worst.max((full[(i, j)].abs() - reduced[(i, j)].abs()).abs());
        largest = largest.max(full[(i, j)].abs());
    }
    println!("Coriolis coupling: largest entry {largest:.5}, off by up to {worst:.1e}");
    assert!(largest > 0.01 && worst < 0.02 * largest);
}

/// Campbell table: frequencies increase with the speed by stress stiffening; the Coriolis force shifts them slightly,
/// by more at higher speeds, and not at rest.
#[test]
fn campbell_table_rises_and_coriolis_shift_is_small() {
    let rom = &reduced().rom;
    println!("rad/s   without Coriolis (Hz)                      with (Hz)");
    let mut before: Option<Vec<f64>> = None;
    for speed in [0.0, 450.0, 900.0, 1350.0, 1800.0] {
        let [without, with] = [false, true].map(|coriolis| frequencies_at(rom, speed, coriolis).unwrap());
        println!("{speed:6} {:10.3?} {:10.3?}", &without[..4], &with[..4]);
        for mode in 0..4 {
            let shift = (with[mode] / without[mode] - 1.0).abs();
            assert!(shift < 3e-4 && (speed > 0.0) == (shift > 1e-9), "{speed} rad/s, mode {}: {shift:e}", mode + 1);
            assert!(before.as_ref().is_none_or(|before| without[mode] > before[mode]));
        }
        before = Some(without);
    }
}

#[test]
fn built_in_blade_passes_its_spin_checks() {
    let reduction = reduced();
    assert_eq!(reduction.rom.order(), 29, "spin costs no coordinates");
    reduction.rom.validate().unwrap();
    for check in &reduction.spin_checks {
        println!(
            "{} rad/s: frequencies {:.4?} %, growth {:.4} %",
            check.speed,
            check.frequency_deviation(),
            check.growth_deviation()
        );
        assert!(check.frequency_deviation().iter().all(|deviation| deviation.abs() < 0.3));
        assert!(check.growth_deviation() < 0.5);
    }
    let still = reduce_rotor37(&Rotor37Options::paper(), &silent).unwrap();
    let mut stripped = reduction.rom.clone();
    stripped.extras.spin = None;
    // Linear theory: the resting stiffness under Ω²c gives the growth of a linear static step, 388.6 µm at the
    // leading edge (CalculiX, without NLGEOM, node 103).
    let spin = reduction.rom.extras.spin.as_ref().unwrap();
    let load = DVector::from_column_slice(&spin.centrifugal_load) * DESIGN_SPEED.powi(2);
    let linear = still.rom.stiffness.clone().cholesky().unwrap().solve(&load);
    println!("linear axial growth of the leading edge {:.1} µm", 1e6 * linear[2]);
    assert!((linear[2] / -3.886_326e-4 - 1.0).abs() < 0.02);
    assert!(stripped == still.rom, "the resting part is that of the ROM without spin, bit for bit");
}

#[test]
fn spin_arrays_are_bit_identical_for_any_thread_count() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let options = Rotor37Options { mesh: COARSE, spin: Some(DESIGN_SPEED), ..Rotor37Options::paper() };
        pool.install(|| reduce_rotor37(&options, &silent)).unwrap().rom
    };
    let alone = on(1);
    for threads in [2, 5] {
        assert!(on(threads) == alone, "{threads} threads");
    }
}

/// An eighth of the elements, for tests that do not need the blade of the reference.
const COARSE: MeshCounts = MeshCounts { chord: 8, thickness: 1, span: 10 };

/// Cases in which an earlier method of aligning the modes failed: more contact nodes, other numbers of modes; on a
/// mesh with two fifths of the elements.
#[test]
fn spin_checks_pass_for_other_reductions() {
    use ReductionKind::{FixedInterface, FreeInterface};
    for (tip, kind, modes) in [
        (TipContact::Patches(5), FixedInterface, 20),
        (TipContact::Nodes(3), FixedInterface, 40),
        (TipContact::Patches(5), FreeInterface, 20),
        (TipContact::Nodes(3), FreeInterface, 20),
    ] {
        let (mesh, spin) = (MeshCounts { chord: 14, thickness: 1, span: 18 }, Some(DESIGN_SPEED));
        let options = Rotor37Options { mesh, tip, kind, modes, checked_modes: 6, spin, ..Rotor37Options::paper() };
        for check in reduce_rotor37(&options, &silent).unwrap().spin_checks {
            let (frequencies, growth) = (check.frequency_deviation(), check.growth_deviation());
            println!("{tip:?}, {kind:?}, {modes} modes, {} rad/s: {frequencies:.3?} %, {growth:.3} %", check.speed);
            assert!(frequencies.iter().all(|deviation| deviation.abs() < 0.2) && growth < 0.5);
        }
    }
}
