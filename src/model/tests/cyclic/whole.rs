//! Cyclic-symmetric reduction against the whole disk.

use core::f64::consts::TAU;

use crate::common::disk::{COARSE, CellCounts, boundary, copies, model, options, pencils, sector, tips};
use faer::Mat;
use nalgebra::{Complex, DMatrix, DVector};
use tiprub_model::assembly::free_dofs;
use tiprub_model::craig_bampton::{craig_bampton, dense_modes};
use tiprub_model::cyclic::{CyclicOptions, CyclicReduction, ModeSelection, reduce_cyclic, whole_disk};
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::Mesh;
use tiprub_model::progress::silent;
use tiprub_model::reduce::full_modes;
use tiprub_model::sparse::{SparseMatrix, principal_pair};

fn reduced(mesh: &Mesh, sectors: usize, contact: usize, options: &CyclicOptions) -> CyclicReduction {
    let boundary = boundary(mesh, sectors);
    let contact = tips(mesh, contact);
    reduce_cyclic(&model(mesh.clone()), mesh.set("BORE").unwrap(), &contact, &boundary, options, &silent).unwrap()
}

/// K and M of the whole disk with its bore clamped, the free dofs, and the node of the disk for each sector and node.
struct AssembledDisk {
    stiffness: SparseMatrix,
    mass: SparseMatrix,
    free: Vec<usize>,
    nodes: Vec<Vec<usize>>,
    mesh: Mesh,
}

fn whole(mesh: &Mesh, sectors: usize) -> AssembledDisk {
    let disk = whole_disk(mesh, &boundary(mesh, sectors)).unwrap();
    let free = free_dofs(disk.mesh.nodes.len(), disk.mesh.set("BORE").unwrap());
    let all = model(disk.mesh.clone());
    let (stiffness, mass) = principal_pair(&all.stiffness, &all.mass, &free);
    AssembledDisk { stiffness, mass, free, nodes: disk.nodes, mesh: disk.mesh }
}

/// Returns the frequencies of all nodal diameters with their multiplicity in the disk, up to the end of the shortest
/// list.
fn disk_frequencies(reduction: &CyclicReduction, sectors: usize) -> Vec<f64> {
    let lists = reduction.nodal_diameters.iter().map(|one| one.full_frequencies.as_slice());
    let ceiling = lists.map(|list| *list.last().unwrap()).fold(f64::INFINITY, f64::min);
    let mut all: Vec<f64> = reduction
        .nodal_diameters
        .iter()
        .flat_map(|one| one.full_frequencies.iter().flat_map(|&f| vec![f; copies(one.number, sectors)]))
        .filter(|&f| f < ceiling)
        .collect();
    all.sort_by(f64::total_cmp);
    all
}

#[track_caller]
fn assert_same_frequencies(kind: ElementKind, sectors: usize, counts: CellCounts) {
    let mesh = sector(kind, sectors, counts);
    let reduction = reduced(&mesh, sectors, 2, &options(ModeSelection::Count(4), 6));
    let cyclic = disk_frequencies(&reduction, sectors);
    assert!(cyclic.len() >= 2 * sectors, "{} modes are too few to compare", cyclic.len());
    let whole = whole(&mesh, sectors);
    let full = full_modes(&whole.stiffness, &whole.mass, false, cyclic.len(), &silent).unwrap().modes.frequencies();
    let worst = cyclic.iter().zip(&full).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
    println!("{kind:?}, {sectors} sectors, {} dofs, {} modes: {worst:.2e}", whole.free.len(), cyclic.len());
    assert!(worst < 1e-8, "frequencies differ by {worst:.3e}\n{cyclic:?}\n{full:?}");
}

#[test]
fn frequencies_of_twelve_sectors_match_full_disk() {
    for kind in [ElementKind::Hex8, ElementKind::Penta6, ElementKind::Tet4] {
        assert_same_frequencies(kind, 12, COARSE);
    }
}

#[test]
fn frequencies_with_quadratic_elements_match_full_disk() {
    assert_same_frequencies(ElementKind::Penta15, 5, COARSE);
}

#[test]
fn frequencies_of_seven_sectors_match_full_disk() {
    assert_same_frequencies(ElementKind::Hex8, 7, COARSE);
}

#[test]
fn frequencies_of_two_and_three_sectors_match_full_disk() {
    let counts = CellCounts { around: 5, ..COARSE };
    assert_same_frequencies(ElementKind::Hex8, 2, counts);
    assert_same_frequencies(ElementKind::Hex8, 3, counts);
}

#[test]
fn frequencies_of_fifty_six_sectors_match_full_disk() {
    assert_same_frequencies(ElementKind::Hex8, 56, CellCounts { hub: 1, along: 1, ..COARSE });
}

/// Returns ω² of a small Hermitian pencil through the real symmetric one of twice the size, where every value appears
/// twice.
fn squares([mass, stiffness, _]: &[DMatrix<Complex<f64>>; 3]) -> Vec<f64> {
    let m = mass.nrows();
    let real = |matrix: &DMatrix<Complex<f64>>| {
        DMatrix::from_fn(2 * m, 2 * m, |i, j| match (i < m, j < m) {
            (true, true) | (false, false) => matrix[(i % m, j % m)].re,
            (true, false) => -matrix[(i % m, j % m)].im,
            (false, true) => matrix[(i % m, j % m)].im,
        })
    };
    dense_modes(&real(stiffness), &real(mass)).unwrap().0.into_iter().step_by(2).collect()
}

#[test]
fn craig_bampton_of_the_sector_matches_full_disk() {
    let sectors = 12;
    let mesh = sector(ElementKind::Hex8, sectors, COARSE);
    let (contact, limit) = (tips(&mesh, 2), 14_000.0);
    let reduction = reduced(&mesh, sectors, 2, &options(ModeSelection::UpTo(limit), 4));
    let pencils = pencils(&reduction.rom);
    let mut cyclic: Vec<f64> = pencils
        .iter()
        .enumerate()
        .flat_map(|(n, p)| squares(p).into_iter().flat_map(move |s| vec![s; copies(n, 12)]))
        .collect();
    cyclic.sort_by(f64::total_cmp);
    let whole = whole(&mesh, sectors);
    let interface: Vec<usize> = whole
        .nodes
        .iter()
        .flat_map(|numbers| contact.iter().map(|point| numbers[point.node]))
        .flat_map(|node| 3 * node..3 * node + 3)
        .map(|dof| whole.free.binary_search(&dof).unwrap())
        .collect();
    let kept = cyclic.len() - interface.len();
    assert!(kept > 3 * sectors, "{kept} fixed-interface modes");
    assert_eq!(reduction.rom.total_order(), cyclic.len());
    let disk = craig_bampton(&whole.stiffness, &whole.mass, &interface, kept, &silent).unwrap();
    let highest = *disk.fixed_interface_frequencies.last().unwrap();
    assert!(highest <= limit, "the limit splits the modes: {highest} Hz");
    let full = dense_modes(&disk.stiffness, &disk.mass).unwrap().0;
    let worst = cyclic.iter().zip(&full).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
    println!("Craig-Bampton, {} dofs: {worst:.2e}", full.len());
    assert!(worst < 1e-8, "reduced eigenvalues differ by {worst:.3e}");
}

#[test]
fn static_response_to_one_blade_force_matches_full_disk() {
    for sectors in [7, 12] {
        let mesh = sector(ElementKind::Penta6, sectors, COARSE);
        let contact = tips(&mesh, 2);
        let reduction = reduced(&mesh, sectors, 2, &options(ModeSelection::Count(3), 2));
        let force = DVector::from_column_slice(&[1.0, -0.4, 0.3, 0.2, 0.7, -0.9]);
        // u_s = sum w_n Re(C_n z_n e^(2πins/N)) with K_n z_n = w_n C_nᴴ f.
        let mut response = vec![DVector::<f64>::zeros(6); sectors];
        for (n, [_, stiffness, map]) in pencils(&reduction.rom).iter().enumerate() {
            let weight = (copies(n, sectors) as f64 / sectors as f64).sqrt();
            let right = map.adjoint() * force.map(|value| Complex::new(weight * value, 0.0));
            let z = stiffness.clone().lu().solve(&right).unwrap();
            for (s, sum) in response.iter_mut().enumerate() {
                let turn = Complex::from_polar(weight, TAU * (n * s) as f64 / sectors as f64);
                *sum += (map * &z).map(|value| (value * turn).re);
            }
        }
        let whole = whole(&mesh, sectors);
        let factor = whole.stiffness.factor("K", "").unwrap();
        let row =
            |s: usize, i: usize| whole.free.binary_search(&(3 * whole.nodes[s][contact[i / 3].node] + i % 3)).unwrap();
        // Directions (radial, tangential, axial) of contact node i/3 of sector s, as rows.
        let directions = |s: usize, point: usize| {
            let [x, y, _] = whole.mesh.nodes[whole.nodes[s][contact[point].node]];
            let r = x.hypot(y);
            nalgebra::Matrix3::new(x / r, y / r, 0.0, -y / r, x / r, 0.0, 0.0, 0.0, 1.0)
        };
        let mut load = Mat::zeros(whole.free.len(), 1);
        for i in 0..6 {
            let turned = directions(0, i / 3).transpose() * force.fixed_rows::<3>(i / 3 * 3);
            load[(row(0, i), 0)] = turned[i % 3];
        }
        let full = factor.solve(load);
        let largest = response.iter().map(|u| u.amax()).fold(0.0, f64::max);
        let mut worst = 0.0_f64;
        for s in 0..sectors {
            for point in 0..2 {
                let cartesian = nalgebra::Vector3::from_fn(|i, _| full[(row(s, 3 * point + i), 0)]);
                let apart = directions(s, point) * cartesian - response[s].fixed_rows::<3>(3 * point);
                worst = worst.max(apart.amax() / largest);
            }
        }
        println!("static response, {sectors} sectors: {worst:.2e}");
        assert!(worst < 1e-10, "displacements differ by {worst:.3e}");
    }
}
