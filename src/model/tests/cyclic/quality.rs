//! Checks of a cyclic reduction, choice of modes, and properties of its matrices.

use crate::common::disk::{COARSE, CellCounts, boundary, copies, model, options, pencils, sector, tips};
use tiprub_core::scene::rom::{DisplacementFrame, RomChecks};
use tiprub_model::Material;
use tiprub_model::cyclic::{
    CyclicOptions, CyclicReduction, ModeSelection, SMALLEST_GAP, WHEEL_MODES, reduce_cyclic, whole_disk,
};
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::Mesh;
use tiprub_model::progress::{ReductionProgress, silent};
use tiprub_model::reduce::{ContactPoint, ReductionKind, ReductionOptions, reduce};
use tiprub_model::stress::StressPlaces;

fn reduced(mesh: &Mesh, sectors: usize, clamped: bool, options: &CyclicOptions) -> CyclicReduction {
    let clamped = if clamped { mesh.set("BORE").unwrap() } else { &[] };
    let contact = tips(mesh, 3);
    reduce_cyclic(&model(mesh.clone()), clamped, &contact, &boundary(mesh, sectors), options, &silent).unwrap()
}

/// Repeats the values of the checks with the multiplicity of the modes in the disk.
fn of_the_disk(checks: &RomChecks, sectors: usize, values: &[f64]) -> Vec<f64> {
    let repeated = |(&n, &value): (&u32, &f64)| vec![value; copies(n as usize, sectors)];
    checks.nodal_diameters.iter().zip(values).flat_map(repeated).collect()
}

/// Reduces the same disk as one structure, with contact at all blades.
fn reduced_whole(mesh: &Mesh, sectors: usize, modes: usize, checked_modes: usize) -> RomChecks {
    let disk = whole_disk(mesh, &boundary(mesh, sectors)).unwrap();
    let contact: Vec<ContactPoint> = disk
        .nodes
        .iter()
        .enumerate()
        .flat_map(|(s, numbers)| {
            tips(mesh, 3).into_iter().map(move |point| ContactPoint {
                name: format!("{}_{s}", point.name),
                node: numbers[point.node],
                ..point
            })
        })
        .collect();
    let options = ReductionOptions {
        name: "whole".into(),
        kind: ReductionKind::FixedInterface,
        modes,
        checked_modes,
        sectors: 1,
        frame: DisplacementFrame::Cylindrical,
        watched: Vec::new(),
        stress: StressPlaces::default(),
        damping_ratio: 0.005,
    };
    let clamped = disk.mesh.set("BORE").unwrap().to_vec();
    reduce(disk.mesh, &Material::steel(), &clamped, &contact, &options, &silent).unwrap().rom.checks
}

#[track_caller]
fn assert_close(name: &str, one: &[f64], other: &[f64], relative: f64, absolute: f64) {
    assert_eq!(one.len(), other.len(), "{name}");
    for (k, (a, b)) in one.iter().zip(other).enumerate() {
        assert!((a - b).abs() <= relative * b.abs() + absolute, "{name} of mode {k}: {a:e} against {b:e}");
    }
}

#[test]
fn quality_criteria_match_full_disk() {
    let sectors = 5;
    let mesh = sector(ElementKind::Hex8, sectors, COARSE);
    let reduction = reduced(&mesh, sectors, true, &options(ModeSelection::UpTo(21_000.0), 4));
    let checks = &reduction.rom.checks;
    let kept: usize = reduction
        .nodal_diameters
        .iter()
        .map(|one| copies(one.number, sectors) * one.fixed_interface_frequencies.len())
        .sum();
    assert!(kept > 0);
    let disk = reduced_whole(&mesh, sectors, kept, 12);
    let first = |values: &[f64]| of_the_disk(checks, sectors, values)[..12].to_vec();
    assert_close("full frequency", &first(&checks.full_frequencies), &disk.full_frequencies, 1e-8, 0.0);
    assert_close("reduced frequency", &first(&checks.reduced_frequencies), &disk.reduced_frequencies, 1e-8, 0.0);
    assert_close("deviation", &first(&checks.frequency_deviation), &disk.frequency_deviation, 1e-4, 1e-9);
    assert_close("criterion", &first(&checks.residual_criterion), &disk.residual_criterion, 1e-4, 1e-9);
    assert!(disk.residual_criterion.iter().any(|&value| value > 1e-3), "nothing to compare");
    // Without fixed-interface modes.
    let bare = reduced_whole(&mesh, sectors, 0, 12);
    let row = &reduction.convergence[0];
    assert_close("deviation of 0", &row.frequency_deviation[..12], &bare.frequency_deviation, 1e-6, 1e-9);
    assert_close("criterion of 0", &row.residual_criterion[..12], &bare.residual_criterion, 1e-6, 1e-9);
}

#[test]
fn convergence_table_rows_match_separate_reductions() {
    let sectors = 7;
    let mesh = sector(ElementKind::Penta6, sectors, COARSE);
    let most = reduced(&mesh, sectors, true, &options(ModeSelection::Count(8), 10));
    assert_eq!(most.convergence.len(), 9);
    for modes in [0, 3, 8] {
        let fewer = reduced(&mesh, sectors, true, &options(ModeSelection::Count(modes), 10));
        let (row, last) = (&most.convergence[modes], fewer.convergence.last().unwrap());
        assert_eq!((row.modes, row.total_modes), (modes, modes * sectors));
        assert_close("deviation", &row.frequency_deviation, &last.frequency_deviation, 1e-6, 1e-9);
        assert_close("criterion", &row.residual_criterion, &last.residual_criterion, 1e-6, 1e-9);
        let all = of_the_disk(&fewer.rom.checks, sectors, &fewer.rom.checks.residual_criterion);
        let count = row.residual_criterion.len();
        assert!((20..=WHEEL_MODES).contains(&count));
        assert_close("criterion of the ROM", &row.residual_criterion, &all[..count], 1e-6, 1e-9);
    }
    for two in most.convergence.windows(2) {
        for (before, after) in two[0].frequency_deviation.iter().zip(&two[1].frequency_deviation) {
            assert!(*after <= before + 1e-9 && *after >= -1e-9, "a further mode made it worse: {before} to {after}");
        }
    }
}

#[test]
fn matrices_are_hermitian_and_real_for_standing_waves() {
    for sectors in [7, 12] {
        let mesh = sector(ElementKind::Tet4, sectors, COARSE);
        let rom = reduced(&mesh, sectors, true, &options(ModeSelection::Count(5), 3)).rom;
        for (n, [mass, stiffness, map]) in pencils(&rom).iter().enumerate() {
            assert_eq!(mass, &mass.adjoint());
            assert_eq!(stiffness, &stiffness.adjoint());
            let imaginary = mass.iter().chain(stiffness.iter()).fold(0.0, |most: f64, v| most.max(v.im.abs()));
            if copies(n, sectors) == 1 {
                assert!(imaginary.to_bits() == 0, "{imaginary:e} at {n}");
            } else {
                assert!(imaginary > 1e-3, "a sheared disk has travelling waves");
            }
            assert!((map.map(|v| v.re) - nalgebra::DMatrix::identity(9, 14)).amax() < f64::MIN_POSITIVE);
        }
    }
}

/// Returns the mirror image of the sector, which turns +θ into -θ.
fn mirrored(mesh: &Mesh) -> Mesh {
    let mut mirrored = mesh.clone();
    mirrored.nodes.iter_mut().for_each(|node| node[1] = -node[1]);
    for element in &mut mirrored.elements {
        assert_eq!(element.kind, ElementKind::Hex8);
        element.nodes = [0, 3, 2, 1, 4, 7, 6, 5].map(|corner| element.nodes[corner]).to_vec();
    }
    mirrored
}

#[test]
fn mirrored_sector_reverses_travelling_waves() {
    let sectors = 7;
    let mesh = sector(ElementKind::Hex8, sectors, COARSE);
    let one = reduced(&mesh, sectors, true, &options(ModeSelection::Count(5), 5));
    let other = reduced(&mirrored(&mesh), sectors, true, &options(ModeSelection::Count(5), 5));
    // A wave n of the mirrored disk is a wave -n, that is N - n, of the disk: conjugate, with tangential components reversed.
    let sign = |i: usize| if i < 9 && i % 3 == 1 { -1.0 } else { 1.0 };
    for (n, (a, b)) in pencils(&one.rom).iter().zip(&pencils(&other.rom)).enumerate() {
        assert_close(
            "frequency",
            &one.nodal_diameters[n].full_frequencies,
            &other.nodal_diameters[n].full_frequencies,
            1e-10,
            0.0,
        );
        for (matrix, image) in [(&a[0], &b[0]), (&a[1], &b[1])] {
            let largest = matrix.view((0, 0), (9, 9)).iter().fold(0.0, |most: f64, value| most.max(value.norm()));
            for i in 0..9 {
                for j in 0..9 {
                    let expected = matrix[(i, j)].conj() * (sign(i) * sign(j));
                    assert!((image[(i, j)] - expected).norm() < 1e-10 * largest, "n = {n}, ({i}, {j})");
                }
            }
        }
    }
}

#[test]
fn reduction_is_bit_identical_for_any_thread_count() {
    let mesh = sector(ElementKind::Penta15, 9, COARSE);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| reduced(&mesh, 9, true, &options(ModeSelection::Families(6), 5)))
    };
    let (one, two, three) = (with(1), with(2), with(3));
    let outside = reduced(&mesh, 9, true, &options(ModeSelection::Families(6), 5));
    for other in [two, three, outside] {
        assert_eq!(one.rom, other.rom);
        assert_eq!(one.convergence, other.convergence);
        for (a, b) in one.nodal_diameters.iter().zip(&other.nodal_diameters) {
            assert_eq!(a.shapes, b.shapes);
        }
    }
}

#[test]
fn a_free_disk_has_six_rigid_body_modes() {
    let sectors = 8;
    let mesh = sector(ElementKind::Hex8, sectors, CellCounts { hub: 1, ..COARSE });
    let reduction = reduced(&mesh, sectors, false, &options(ModeSelection::Count(6), 6));
    let elastic = reduction.nodal_diameters[2].full_frequencies[0];
    let rigid = |list: &[f64]| list.iter().filter(|&&f| f < 1e-4 * elastic).count();
    let count = |list: fn(&tiprub_model::cyclic::NodalDiameter) -> &[f64]| -> Vec<usize> {
        reduction.nodal_diameters.iter().map(|one| rigid(list(one))).collect()
    };
    assert_eq!(count(|one| &one.full_frequencies), [2, 2, 0, 0, 0]);
    assert_eq!(count(|one| &one.reduced_frequencies), [2, 2, 0, 0, 0]);
    let worst = reduction.rom.checks.residual_criterion.iter().copied().fold(0.0, f64::max);
    assert!(worst > 1e-6 && worst < 20.0, "criterion {worst} %");
    for one in &reduction.nodal_diameters {
        for (full, reduced) in one.full_frequencies.iter().zip(&one.reduced_frequencies) {
            assert!(*reduced >= full * (1.0 - 1e-9) - 1e-4 * elastic, "{reduced} Hz below {full} Hz");
        }
    }
}

#[test]
fn mode_shapes_satisfy_the_sector_eigenproblem() {
    let sectors = 6;
    let mesh = sector(ElementKind::Hex8, sectors, COARSE);
    let reduction = reduced(&mesh, sectors, true, &options(ModeSelection::Count(3), 3));
    let model = model(mesh.clone());
    let faces = boundary(&mesh, sectors);
    let (sin, cos) = faces.pitch().sin_cos();
    for one in &reduction.nodal_diameters {
        let wave = nalgebra::Complex::from_polar(1.0, faces.pitch() * one.number as f64);
        for (shape, frequency) in one.shapes.iter().zip(&one.full_frequencies) {
            let energy = |matrix: &tiprub_model::sparse::SparseMatrix| -> f64 {
                let part = |pick: fn(&nalgebra::Complex<f64>) -> f64| {
                    let u = faer::Mat::from_fn(matrix.order(), 1, |i, _| pick(&shape[i / 3][i % 3]));
                    u.col(0).transpose() * matrix.times(u.as_ref()).col(0)
                };
                part(|value| value.re) + part(|value| value.im)
            };
            let omega = core::f64::consts::TAU * frequency;
            assert!((energy(&model.mass) - 1.0).abs() < 1e-9);
            assert!((energy(&model.stiffness) / (omega * omega) - 1.0).abs() < 1e-8);
            let size = shape.iter().flatten().fold(0.0, |most: f64, value| most.max(value.norm()));
            for &[low, high] in &faces.pairs {
                let [x, y, z] = shape[low];
                let turned = [x * cos - y * sin, x * sin + y * cos, z].map(|value| value * wave);
                let apart = turned.iter().zip(&shape[high]).fold(0.0, |most: f64, (a, b)| most.max((a - b).norm()));
                assert!(apart < 1e-13 * size);
            }
        }
    }
}

#[test]
fn mode_families_are_truncated_at_a_spectral_gap() {
    let sectors = 16;
    let mesh = sector(ElementKind::Hex8, sectors, COARSE);
    let reduction = reduced(&mesh, sectors, true, &options(ModeSelection::Families(5), 2));
    assert!(reduction.notes[0].contains("gap from"), "{:?}", reduction.notes);
    let more = reduced(&mesh, sectors, true, &options(ModeSelection::Count(9), 2));
    let kept = |n: usize| &reduction.nodal_diameters[n].fixed_interface_frequencies;
    let highest = (0..=8).filter_map(|n| kept(n).last()).copied().fold(0.0, f64::max);
    let lowest = (0..=8)
        .map(|n| more.nodal_diameters[n].fixed_interface_frequencies[kept(n).len()])
        .fold(f64::INFINITY, f64::min);
    assert!(lowest > highest * (1.0 + SMALLEST_GAP), "{highest} Hz kept, {lowest} Hz left out");
    let mean = (0..=8).map(|n| kept(n).len()).sum::<usize>() as f64 / 9.0;
    assert!((mean - 5.0).abs() <= 1.0, "{mean} on average");
}

#[test]
fn progress_comes_from_calling_thread_and_reaches_100_percent() {
    let mesh = sector(ElementKind::Hex8, 7, COARSE);
    let caller = std::thread::current().id();
    let reported = std::cell::RefCell::new(Vec::new());
    let listener = |progress: ReductionProgress| {
        assert_eq!(std::thread::current().id(), caller);
        reported.borrow_mut().push(progress);
    };
    let contact = tips(&mesh, 2);
    let bore = mesh.set("BORE").unwrap();
    let options = options(ModeSelection::Count(3), 3);
    reduce_cyclic(&model(mesh.clone()), bore, &contact, &boundary(&mesh, 7), &options, &listener).unwrap();
    let reported = reported.into_inner();
    for stage in reported.iter().map(|progress| progress.stage) {
        let fractions: Vec<f64> = reported.iter().filter(|p| p.stage == stage).map(|p| p.fraction).collect();
        assert!(fractions.windows(2).all(|two| two[0] <= two[1]), "{stage}: {fractions:?}");
        assert!((fractions.last().unwrap() - 1.0).abs() < 1e-12, "{stage} ends at {:?}", fractions.last());
    }
}
