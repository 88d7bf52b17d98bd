//! Patches and free-interface modes of coupled sectors: exact statics, exact frequencies, forced responses that converge.

use core::f64::consts::TAU;

use crate::guide::print_row;

use crate::common::disk::{COARSE, CellCounts, boundary, copies, model, pencils, sector};
use faer::Mat;
use nalgebra::{Complex, DMatrix, DVector};
use tiprub_model::Mesh;
use tiprub_model::assembly::free_dofs;
use tiprub_model::cyclic::{CyclicOptions, CyclicReduction, ModeSelection, reduce_cyclic, whole_disk};
use tiprub_model::element::ElementKind;
use tiprub_model::patches::{contact_patches, find_tip};
use tiprub_model::progress::silent;
use tiprub_model::reduce::{ContactPoint, ReductionKind};
use tiprub_model::rotor37::TipContact;
use tiprub_model::sparse::principal_pair;
use tiprub_model::stage::{StageOptions, reduce_stage, stage_model};

const KINDS: [ReductionKind; 2] = [ReductionKind::FixedInterface, ReductionKind::FreeInterface];

fn patches(mesh: &Mesh, count: usize) -> Vec<ContactPoint> {
    contact_patches(mesh, mesh.set("TIP").unwrap(), count, |index| format!("patch_{index}")).unwrap()
}

fn reduced(
    mesh: &Mesh,
    (sectors, clamped): (usize, &[usize]),
    contact: &[ContactPoint],
    kind: ReductionKind,
    modes: usize,
) -> CyclicReduction {
    let modes = ModeSelection::Count(modes);
    let options = CyclicOptions { name: "disk".into(), kind, modes, checked_modes: 6, damping_ratio: 0.005 };
    reduce_cyclic(&model(mesh.clone()), clamped, contact, &boundary(mesh, sectors), &options, &silent).unwrap()
}

/// Returns the radial, tangential and axial unit vectors at a node.
fn directions([x, y, _]: [f64; 3]) -> [[f64; 3]; 3] {
    let radius = x.hypot(y);
    [[x / radius, y / radius, 0.0], [-y / radius, x / radius, 0.0], [0.0, 0.0, 1.0]]
}

/// Compares displacements of all patches of the disk under forces on those of one sector, in the disk itself and
/// through the nodal diameters.
#[test]
fn static_response_to_patch_forces_matches_full_disk() {
    let force = [1.0, -0.4, 0.3, 0.2, 0.7, -0.9];
    for (sectors, element) in [(7, ElementKind::Penta15), (6, ElementKind::Hex8)] {
        let mesh = sector(element, sectors, COARSE);
        let contact = patches(&mesh, 2);
        let disk = whole_disk(&mesh, &boundary(&mesh, sectors)).unwrap();
        let free = free_dofs(disk.mesh.nodes.len(), disk.mesh.set("BORE").unwrap());
        let all = model(disk.mesh.clone());
        let (stiffness, _) = principal_pair(&all.stiffness, &all.mass, &free);
        // Weights over the nodes of a patch, in the directions of each node.
        let spread = |s: usize, i: usize| -> Vec<(usize, f64)> {
            let of_node = |(node, weight): (usize, f64)| {
                let node = disk.nodes[s][node];
                let direction = directions(disk.mesh.nodes[node])[i % 3];
                (0..3).map(move |axis| (3 * node + axis, weight * direction[axis]))
            };
            let own = contact[i / 3].weights().flat_map(of_node);
            own.map(|(dof, value)| (free.binary_search(&dof).unwrap(), value)).collect()
        };
        let mut load = Mat::zeros(free.len(), 1);
        for (i, value) in force.into_iter().enumerate() {
            spread(0, i).into_iter().for_each(|(row, share)| load[(row, 0)] += share * value);
        }
        let full = stiffness.factor("K", "").unwrap().solve(load);
        for kind in KINDS {
            let rom = reduced(&mesh, (sectors, mesh.set("BORE").unwrap()), &contact, kind, 3).rom;
            let mut response = vec![DVector::<f64>::zeros(6); sectors];
            for (n, [_, stiffness, map]) in pencils(&rom).iter().enumerate() {
                let weight = (copies(n, sectors) as f64 / sectors as f64).sqrt();
                let right = map.adjoint() * DVector::from_fn(6, |i, _| Complex::new(weight * force[i], 0.0));
                let z = stiffness.clone().lu().solve(&right).unwrap();
                for (s, sum) in response.iter_mut().enumerate() {
                    let turn = Complex::from_polar(weight, TAU * (n * s) as f64 / sectors as f64);
                    *sum += (map * &z).map(|value| (value * turn).re);
                }
            }
            let largest = response.iter().map(|u| u.amax()).fold(0.0, f64::max);
            let apart = |s: usize, i: usize| -> f64 {
                let exact: f64 = spread(s, i).into_iter().map(|(row, share)| share * full[(row, 0)]).sum();
                (exact - response[s][i]).abs() / largest
            };
            let worst = (0..sectors).flat_map(|s| (0..6).map(move |i| (s, i))).map(|(s, i)| apart(s, i));
            let worst = worst.fold(0.0, f64::max);
            println!("{element:?}, {kind:?}: {worst:.1e}");
            assert!(worst < 1e-10, "{element:?}, {kind:?}: displacements differ by {worst:.1e}");
        }
    }
}

/// Kept modes are those of the full model, on a supported disk and on a free one, where they include rigid-body
/// motions.
#[test]
fn free_interface_sector_modes_match_full_disk() {
    let sectors = 5;
    let mesh = sector(ElementKind::Hex8, sectors, COARSE);
    let contact = patches(&mesh, 2);
    for clamped in [mesh.set("BORE").unwrap(), &[]] {
        let found = reduced(&mesh, (sectors, clamped), &contact, ReductionKind::FreeInterface, 8);
        for one in &found.nodal_diameters {
            assert_eq!(one.full_frequencies.len(), 6);
            let rigid = if clamped.is_empty() && one.number < 2 { 2 } else { 0 };
            for k in rigid..6 {
                let (deviation, rcc) = (one.frequency_deviation[k], one.residual_criterion[k]);
                assert!(deviation.abs() < 1e-6 && rcc.abs() < 1e-6, "{clamped:?}: {one:?}");
            }
            let first = one.full_frequencies[rigid];
            assert!(one.reduced_frequencies[..rigid].iter().all(|f| *f < 1e-4 * first), "{one:?}");
        }
        // The modes and the convergence table agree: a row with fewer modes contains the first of them.
        let row = &found.convergence[6];
        assert!(
            row.frequency_deviation.iter().all(|deviation| deviation.abs() < 1e-6 || clamped.is_empty()),
            "{row:?}"
        );
    }
}

/// Recovered shapes move the nodes of patches as the full model does: its modes do not depend on the contact.
#[test]
fn patches_do_not_change_sector_mode_shapes() {
    let sectors = 5;
    let mesh = sector(ElementKind::Penta6, sectors, COARSE);
    let bore = mesh.set("BORE").unwrap();
    let node = [ContactPoint::at("node", mesh.set("TIP").unwrap()[0], 0.0)];
    let [with, without] = [&patches(&mesh, 2)[..], &node[..]]
        .map(|contact| reduced(&mesh, (sectors, bore), contact, ReductionKind::FixedInterface, 4));
    for (a, b) in with.nodal_diameters.iter().zip(&without.nodal_diameters) {
        for (k, (f, g)) in a.full_frequencies.iter().zip(&b.full_frequencies).enumerate() {
            assert!((f / g - 1.0).abs() < 1e-9, "{f} {g}");
            let norm = |shape: &[[Complex<f64>; 3]]| shape.iter().flatten().map(Complex::norm_sqr).sum::<f64>();
            let inner: Complex<f64> =
                a.shapes[k].iter().flatten().zip(b.shapes[k].iter().flatten()).map(|(u, v)| u.conj() * v).sum();
            let alike = inner.norm_sqr() / (norm(&a.shapes[k]) * norm(&b.shapes[k]));
            assert!((alike - 1.0).abs() < 1e-6, "nodal diameter {}, mode {k}: {alike}", a.number);
        }
    }
}

/// Returns the response of a patch, m/N, with structural damping, in nodal diameter n.
fn receptance([mass, stiffness, map]: &[DMatrix<Complex<f64>>; 3], angular: f64) -> DMatrix<Complex<f64>> {
    let dynamic = stiffness * Complex::new(1.0, 0.01) - mass * Complex::new(angular * angular, 0.0);
    map * dynamic.lu().solve(&map.adjoint()).unwrap()
}

/// Forced responses between the second and the third frequency against a reduction with all modes: those of
/// free-interface modes are more accurate with fewer modes, which inertia relief also ensures for a free disk.
#[test]
fn free_interface_modes_converge_faster_for_patches() {
    let sectors = 5;
    let mesh = sector(ElementKind::Hex8, sectors, CellCounts { along: 1, ..COARSE });
    let contact = patches(&mesh, 2);
    for clamped in [mesh.set("BORE").unwrap(), &[]] {
        let all = reduced(&mesh, (sectors, clamped), &contact, ReductionKind::FixedInterface, 1).free_dofs - 6;
        let exact = reduced(&mesh, (sectors, clamped), &contact, ReductionKind::FixedInterface, all);
        let angular: Vec<f64> = exact
            .nodal_diameters
            .iter()
            .map(|one| TAU * (0.5 * one.full_frequencies[3] + 0.5 * one.full_frequencies[2]))
            .collect();
        let truth: Vec<_> = pencils(&exact.rom).iter().zip(&angular).map(|(p, w)| receptance(p, *w)).collect();
        let error = |kind, modes| -> f64 {
            let rom = reduced(&mesh, (sectors, clamped), &contact, kind, modes).rom;
            let found = pencils(&rom).into_iter().zip(&angular).map(|(pencil, w)| receptance(&pencil, *w));
            let apart = found.zip(&truth).map(|(a, b)| (a - b).map(|v| v.norm()).amax() / b.map(|v| v.norm()).amax());
            apart.fold(0.0, f64::max)
        };
        let mut last = f64::INFINITY;
        for modes in [4, 8, 12, 16] {
            let [fixed, free] = KINDS.map(|kind| error(kind, modes));
            print_row!("| {} | {modes} | {fixed} | {free} |", if clamped.is_empty() { "none" } else { "bore" });
            assert!(free < 0.3 * fixed && free < 0.3 * last, "{modes}: {fixed:.2e} {free:.2e}");
            last = free;
        }
    }
    crate::guide::hold("cargo test -p tiprub-model --test cyclic patches");
}

#[test]
fn stage_reduces_with_five_tip_patches() {
    for kind in KINDS {
        let options = StageOptions {
            tip: TipContact::Patches(5),
            kind,
            modes: ModeSelection::Families(6),
            ..StageOptions::coarse()
        };
        let stage = stage_model(&options, &silent).unwrap();
        let names: Vec<&str> = stage.contact.iter().map(|point| point.name.as_str()).collect();
        assert_eq!(names, ["leading_edge", "tip_2", "mid_chord", "tip_4", "trailing_edge"]);
        let found = reduce_stage(&options, &silent).unwrap();
        assert_eq!((found.rom.contact_nodes.len(), found.rom.sectors), (5, 56));
        let worst = found.rom.checks.frequency_deviation.iter().fold(0.0, |worst: f64, d| worst.max(d.abs()));
        println!("{kind:?}: {worst:.1e} %, {}", found.rom.origin);
        assert!(worst < if kind == ReductionKind::FreeInterface { 1e-6 } else { 5.0 }, "{kind:?}: {worst:e} %");
        assert!(found.rom.origin.contains("5 patches"), "{}", found.rom.origin);
    }
}

#[test]
fn rejects_dependent_patches_and_a_patch_on_a_face() {
    let mesh = sector(ElementKind::Hex8, 5, COARSE);
    let (own, bore) = (patches(&mesh, 2), mesh.set("BORE").unwrap());
    let refused = |contact: &[ContactPoint]| {
        let modes = ModeSelection::Count(2);
        let kind = ReductionKind::FreeInterface;
        let options = CyclicOptions { name: "disk".into(), kind, modes, checked_modes: 2, damping_ratio: 0.0 };
        let result = reduce_cyclic(&model(mesh.clone()), bore, contact, &boundary(&mesh, 5), &options, &silent);
        result.unwrap_err().to_string()
    };
    let face = mesh.set("LOW").unwrap().iter().copied().find(|node| !bore.contains(node)).unwrap();
    let on_face = ContactPoint { patch: vec![(own[0].node, 0.5), (face, 0.5)], ..own[0].clone() };
    assert!(refused(&[on_face]).contains("cyclic face"));
    let twice = [own[0].clone(), ContactPoint { name: "again".into(), ..own[0].clone() }];
    assert!(refused(&twice).contains("depends on those of the other patches"));
}

/// The tip is the outermost connected face: that of the blade of the sector as its set defines it, not the rim beside
/// it.
#[test]
fn finds_the_tip_of_a_sector() {
    for kind in ElementKind::ALL {
        let mesh = sector(kind, 8, COARSE);
        let mut fixed = [mesh.set("LOW").unwrap(), mesh.set("HIGH").unwrap(), mesh.set("BORE").unwrap()].concat();
        fixed.sort_unstable();
        let tip = find_tip(&mesh, &fixed).unwrap();
        assert_eq!(tip.nodes, mesh.set("TIP").unwrap(), "{kind:?}");
        assert!(
            (tip.radius[1] - 0.25).abs() < 1e-12 && (tip.axial[1] - 0.05).abs() < 1e-12 && tip.elsewhere == 0,
            "{tip:?}"
        );
        let error = find_tip(&mesh, &tip.nodes).unwrap_err().to_string();
        assert!(error.contains("are clamped or lie on cyclic faces") && error.contains("--contact-set"), "{error}");
    }
    // A second blade beside the first is equally far out and is reported.
    let one = sector(ElementKind::Hex8, 8, COARSE);
    let mut two = one.clone();
    let (sin, cos) = (TAU / 16.0).sin_cos();
    two.nodes.extend(one.nodes.iter().map(|[x, y, z]| [cos * x - sin * y, sin * x + cos * y, *z]));
    two.elements.extend(one.elements.iter().map(|element| {
        let nodes = element.nodes.iter().map(|node| node + one.nodes.len()).collect();
        tiprub_model::mesh::Element { nodes, ..element.clone() }
    }));
    let tip = find_tip(&two, &[]).unwrap();
    assert_eq!((tip.faces, tip.elsewhere), (2, 2), "{tip:?}");
}
