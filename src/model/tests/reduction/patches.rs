//! Contact patches and free-interface modes: consistent weights, exact statics, exact low frequencies.

use crate::guide::print_row;

use crate::common::{dense, distorted_box, nodes_at, steel, straight_box, wobble};
use nalgebra::DMatrix;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_model::assembly::{assemble, free_dofs};
use tiprub_model::craig_bampton::dense_modes;
use tiprub_model::element::ElementKind;
use tiprub_model::patches::{contact_patches, tip_patches};
use tiprub_model::progress::silent;
use tiprub_model::reduce::{ContactPoint, Reduction, ReductionKind, ReductionOptions, reduce};
use tiprub_model::rotor37::{MeshCounts, TipContact, blade_mesh};
use tiprub_model::sparse::principal_pair;
use tiprub_model::stress::StressPlaces;
use tiprub_model::{Mesh, Rotor37Options, reduce_rotor37};

const SIZE: [f64; 3] = [0.3, 0.02, 0.06];

/// Returns a beam whose tip, at x = 0.3, has its longer side along z.
fn beam() -> Mesh {
    distorted_box(ElementKind::Hex20, [4, 1, 4], SIZE, wobble(0.1))
}

fn tip(mesh: &Mesh, count: usize) -> Vec<ContactPoint> {
    contact_patches(mesh, &nodes_at(mesh, 0, SIZE[0]), count, |index| format!("patch_{index}")).unwrap()
}

fn reduced(mesh: Mesh, contact: &[ContactPoint], kind: ReductionKind, modes: usize) -> tiprub_model::Result<Reduction> {
    let options = ReductionOptions {
        name: "beam".into(),
        kind,
        modes,
        checked_modes: 6,
        sectors: 1,
        frame: DisplacementFrame::Cylindrical,
        watched: Vec::new(),
        stress: StressPlaces::default(),
        damping_ratio: 0.01,
    };
    let clamped = nodes_at(&mesh, 0, 0.0);
    reduce(mesh, &steel(), &clamped, contact, &options, &silent)
}

/// Hat functions over the length 1 have their middles at 1/6, 1/2 and 5/6, whatever the elements.
#[test]
fn patch_position_is_the_centre_of_its_hat_function() {
    for kind in ElementKind::ALL {
        let mesh = straight_box(kind, [2, 2, 4], SIZE);
        let patches = tip(&mesh, 3);
        for (patch, expected) in patches.iter().zip([1.0 / 6.0, 0.5, 5.0 / 6.0]) {
            let total: f64 = patch.weights().map(|(_, weight)| weight).sum();
            let mean = |axis: usize| patch.weights().map(|(node, w)| w * mesh.nodes[node][axis]).sum::<f64>();
            assert!((total - 1.0).abs() < 1e-13 && (mean(1) / SIZE[1] - 0.5).abs() < 1e-12, "{kind:?} {patch:?}");
            assert!(
                (mean(2) / SIZE[2] - expected).abs() < 1e-12,
                "{kind:?}: {} instead of {expected}",
                mean(2) / SIZE[2]
            );
        }
        // One patch covers the whole face.
        assert!(tip(&mesh, 1)[0].patch.len() <= nodes_at(&mesh, 0, SIZE[0]).len());
    }
}

/// Two rows are at the sides of the tip, a third between them, and together rows are the patches over its whole
/// thickness, on boxes and on rotor 37.
#[test]
fn rows_of_patches_sum_to_a_single_row() {
    let name = |index: usize| format!("patch_{index}");
    for kind in ElementKind::ALL {
        let mesh = straight_box(kind, [2, 2, 4], SIZE);
        let set = nodes_at(&mesh, 0, SIZE[0]);
        for rows in [2, 3] {
            let patches = tip_patches(&mesh, &set, [3, rows], name).unwrap();
            let place = |patch: &ContactPoint| {
                patch.weights().map(|(node, weight)| weight * mesh.nodes[node][1]).sum::<f64>() / SIZE[1]
            };
            let mut across: Vec<Vec<f64>> = patches.chunks(3).map(|row| row.iter().map(place).collect()).collect();
            across.sort_by(|a, b| a[0].total_cmp(&b[0]));
            // The tip is flat, and arcs around the axis differ slightly from its heights.
            for (row, own) in across.iter().enumerate() {
                let expected = row as f64 / (rows - 1) as f64;
                assert!(own.iter().all(|place| (place - expected).abs() < 2e-3), "{kind:?}, {rows}: {across:?}");
            }
            assert_eq!(patches.iter().map(|patch| patch.row).collect::<Vec<_>>()[..4], [0, 0, 0, 1]);
        }
        for (refused, reported) in [([3, 0], "0 rows of 3"), ([3, 40], "40 rows of 3"), ([99, 1], "99 is outside")] {
            let error = tip_patches(&mesh, &set, refused, name).unwrap_err().to_string();
            assert!(error.contains(reported), "{error}");
        }
    }
    // One linear element only has nodes at its sides.
    let mesh = straight_box(ElementKind::Hex8, [2, 1, 4], SIZE);
    let set = nodes_at(&mesh, 0, SIZE[0]);
    assert!(tip_patches(&mesh, &set, [3, 2], name).is_ok());
    let error = tip_patches(&mesh, &set, [3, 3], name).unwrap_err().to_string();
    assert!(error.contains("3 rows of 3 patches are too many") && error.contains("fewer rows"), "{error}");
    let blade = blade_mesh(MeshCounts { chord: 8, thickness: 2, span: 2 }).unwrap();
    let tip = blade.mesh.set("tip").unwrap();
    let (whole, rows) = (blade.contact_patches(5).unwrap(), tip_patches(&blade.mesh, tip, [5, 2], name).unwrap());
    let all = |patches: &[&ContactPoint], node: usize| -> f64 {
        let of =
            |patch: &&ContactPoint| patch.weights().filter(|at| at.0 == node).map(|at| patch.area * at.1).sum::<f64>();
        patches.iter().map(of).sum()
    };
    let area: f64 = whole.iter().map(|patch| patch.area).sum();
    let length = |patches: &[ContactPoint]| patches.iter().map(|patch| patch.length).sum::<f64>();
    assert!((2.0 * length(&whole) / length(&rows) - 1.0).abs() < 1e-12);
    for (index, patch) in whole.iter().enumerate() {
        let both = [&rows[index], &rows[5 + index]];
        for &node in tip {
            assert!((all(&both, node) - all(&[patch], node)).abs() < 1e-12 * area, "patch {index}, node {node}");
        }
        let share = both[0].area / both[1].area;
        assert!((share - 1.0).abs() < 0.05, "patch {index}: {share}");
    }
}

/// Static displacements under forces on patches are those of the full model, with any number of modes.
#[test]
fn static_responses_to_patch_forces_are_exact() {
    let mesh = beam();
    let contact = tip(&mesh, 3);
    let assembled = assemble(&mesh, &steel(), &silent).unwrap();
    let free = free_dofs(mesh.nodes.len(), &nodes_at(&mesh, 0, 0.0));
    let (stiffness, _) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    let mut loads = DMatrix::zeros(free.len(), 9);
    for (index, patch) in contact.iter().enumerate() {
        for (node, weight) in patch.weights() {
            let angle = mesh.nodes[node][1].atan2(mesh.nodes[node][0]);
            let directions = [[angle.cos(), angle.sin(), 0.0], [-angle.sin(), angle.cos(), 0.0], [0.0, 0.0, 1.0]];
            for (component, direction) in directions.into_iter().enumerate() {
                for (axis, share) in direction.into_iter().enumerate() {
                    let row = free.binary_search(&(3 * node + axis)).unwrap();
                    loads[(row, 3 * index + component)] += weight * share;
                }
            }
        }
    }
    let exact = loads.transpose() * dense(&stiffness).cholesky().unwrap().solve(&loads);
    let kinds = [ReductionKind::FreeInterface, ReductionKind::FixedInterface];
    for (modes, kind) in [0, 3, 12].into_iter().flat_map(|modes| kinds.map(|kind| (modes, kind))) {
        let rom = reduced(mesh.clone(), &contact, kind, modes).unwrap().rom;
        let found = &rom.contact_map * rom.stiffness.clone().cholesky().unwrap().solve(&rom.contact_map.transpose());
        let error = (&found - &exact).amax() / exact.amax();
        assert!(error < 1e-10, "{kind:?}, {modes} modes: {error:e}");
    }
}

/// Kept modes are those of the full model; the others, one per contact coordinate, lie above them.
#[test]
fn free_interface_modes_match_full_model() {
    let mesh = beam();
    for contact in [tip(&mesh, 2), vec![ContactPoint::at("corner", nodes_at(&mesh, 0, SIZE[0])[0], 0.0)]] {
        let reduction = reduced(mesh.clone(), &contact, ReductionKind::FreeInterface, 8).unwrap();
        let checks = &reduction.rom.checks;
        assert!(checks.frequency_deviation.iter().all(|deviation| deviation.abs() < 1e-7), "{checks:?}");
        assert!(checks.residual_criterion.iter().all(|rcc| rcc.abs() < 1e-7), "{checks:?}");
        let (squares, _) = dense_modes(&reduction.rom.stiffness, &reduction.rom.mass).unwrap();
        assert_eq!(squares.len(), 8 + 3 * contact.len());
        assert!(squares[8] > 1.05 * squares[7], "{squares:?}");
        let held = reduced(mesh.clone(), &contact[..0], ReductionKind::FreeInterface, 8);
        assert!(held.is_err(), "nothing touches");
    }
}

/// With held patches Craig-Bampton converges to the frequencies of the full model, and its shapes are displacements
/// of nodes.
#[test]
fn fixed_interface_modes_with_patches_converge() {
    let mesh = straight_box(ElementKind::Hex8, [3, 1, 2], SIZE);
    let free = 3 * (mesh.nodes.len() - nodes_at(&mesh, 0, 0.0).len());
    let deviation = |modes: usize| -> [f64; 2] {
        let checks = reduced(mesh.clone(), &tip(&mesh, 2), ReductionKind::FixedInterface, modes).unwrap().rom.checks;
        [checks.frequency_deviation, checks.residual_criterion].map(|all| all.iter().fold(0.0, |a, b| b.abs().max(a)))
    };
    let [few, some, all] = [3, 12, free - 6].map(deviation);
    assert!(few[0] > some[0] && few[1] > some[1] && all[0] < 1e-8 && all[1] < 1e-8, "{few:?} {some:?} {all:?}");
}

/// An unsupported structure keeps its rigid-body motions and its modes with patches and a node in contact.
#[test]
fn free_structure_with_patches_keeps_all_modes() {
    let mesh = beam();
    let root = ContactPoint::at("root", *nodes_at(&mesh, 0, 0.0).last().unwrap(), 0.0);
    let contact = [tip(&mesh, 2), vec![root]].concat();
    let options = ReductionOptions {
        name: "beam".into(),
        kind: ReductionKind::FreeInterface,
        modes: 10,
        checked_modes: 10,
        sectors: 1,
        frame: DisplacementFrame::Cylindrical,
        watched: Vec::new(),
        stress: StressPlaces::default(),
        damping_ratio: 0.01,
    };
    let rom = reduce(mesh, &steel(), &[], &contact, &options, &silent).unwrap().rom;
    assert_eq!(rom.order(), 9 + 10);
    let checks = &rom.checks;
    assert!(checks.frequency_deviation[6..].iter().all(|deviation| deviation.abs() < 1e-6), "{checks:?}");
    assert!(checks.reduced_frequencies[..6].iter().all(|f| *f < 1e-3 * checks.full_frequencies[6]), "{checks:?}");
}

/// Displacements under point forces grow with mesh refinement; those under forces on patches converge.
#[test]
fn patch_flexibility_converges_and_point_flexibility_does_not() {
    let own = |tip: TipContact, chord: usize| -> f64 {
        let mesh = MeshCounts { chord, thickness: (chord / 8).max(1), span: chord };
        let options = Rotor37Options {
            tip,
            mesh,
            kind: ReductionKind::FreeInterface,
            modes: 4,
            checked_modes: 2,
            ..Rotor37Options::paper()
        };
        let rom = reduce_rotor37(&options, &silent).unwrap().rom;
        rom.stiffness.cholesky().unwrap().inverse()[(6, 6)]
    };
    let grows = |tip: TipContact| [6, 12, 24].map(|chord| own(tip, chord));
    let (points, patches) = (grows(TipContact::Nodes(5)), grows(TipContact::Patches(5)));
    for (chord, (point, patch)) in [6, 12, 24].into_iter().zip(points.into_iter().zip(patches)) {
        print_row!("| {chord} | {point} | {patch} |");
    }
    crate::guide::hold("cargo test -p tiprub-model --test reduction patches");
    let change = |values: [f64; 3]| (values[2] / values[1] - 1.0).abs();
    assert!(change(patches) < 0.05 && change(points) > 3.0 * change(patches), "{points:?} {patches:?}");
}

/// A mean of Cartesian positions would lie inside the arc of the chord.
#[test]
fn patch_position_of_rotor37_lies_on_the_chord_arc() {
    let blade = blade_mesh(MeshCounts { chord: 8, thickness: 1, span: 4 }).unwrap();
    let patches = blade.contact_patches(3).unwrap();
    assert_eq!(patches.iter().map(|patch| patch.name.as_str()).collect::<Vec<_>>(), ["patch_1", "patch_2", "patch_3"]);
    let options = Rotor37Options {
        tip: TipContact::Patches(3),
        kind: ReductionKind::FreeInterface,
        mesh: MeshCounts { chord: 8, thickness: 1, span: 4 },
        modes: 4,
        checked_modes: 2,
        ..Rotor37Options::paper()
    };
    let rom = reduce_rotor37(&options, &silent).unwrap().rom;
    for (patch, node) in patches.iter().zip(&rom.contact_nodes) {
        let mean = |pick: &dyn Fn([f64; 3]) -> f64| -> f64 {
            patch.weights().map(|(node, weight)| weight * pick(blade.mesh.nodes[node])).sum()
        };
        let radius = mean(&|[x, y, _]| x.hypot(y));
        let inside = radius - mean(&|[x, ..]| x).hypot(mean(&|[_, y, _]| y));
        assert!((node.position[0] - radius).abs() < 1e-15 && (1e-5..3e-4).contains(&inside), "{inside:e}");
        let slope = (
            blade.tip_slopes.iter().fold(f64::INFINITY, |a, b| a.min(*b)),
            blade.tip_slopes.iter().fold(-1.0, |a: f64, b| a.max(*b)),
        );
        assert!(
            (slope.0 - 0.02..slope.1 + 0.02).contains(&node.meridional_slope),
            "{} {slope:?}",
            node.meridional_slope
        );
    }
}

#[test]
fn rejects_invalid_and_dependent_patches() {
    let mesh = beam();
    let all = nodes_at(&mesh, 0, SIZE[0]);
    let refused =
        |set: &[usize], count: usize| contact_patches(&mesh, set, count, |i| i.to_string()).unwrap_err().to_string();
    assert!(refused(&all, 0).contains("0 is outside the range 1 to 9"), "{}", refused(&all, 0));
    assert!(refused(&all, 10).contains("10 is outside the range 1 to 9"));
    assert!(refused(&all[..3], 2).contains("no outer face of an element has all of its nodes in the contact set"));
    let contact = tip(&mesh, 3);
    let reported =
        |contact: &[ContactPoint], kind, modes| reduced(mesh.clone(), contact, kind, modes).unwrap_err().to_string();
    let twice = [contact[0].clone(), ContactPoint { name: "again".into(), ..contact[0].clone() }];
    assert!(reported(&twice, ReductionKind::FreeInterface, 4).contains("flexibility of the contact coordinates"));
    assert!(reported(&twice, ReductionKind::FixedInterface, 4).contains("depends on those of the other patches"));
    let free = 3 * (mesh.nodes.len() - nodes_at(&mesh, 0, 0.0).len());
    assert!(
        reported(&contact, ReductionKind::FreeInterface, free - 8).contains("possible besides 9 contact coordinates")
    );
    assert!(reported(&contact, ReductionKind::FreeInterface, free - 9).contains("has no residual flexibility"));
}

/// The forced-response deviation in a ROM agrees with dense solutions with the full matrices, between the checked
/// frequencies.
#[test]
fn forced_response_error_matches_rom_estimate() {
    let mesh = beam();
    let contact = tip(&mesh, 2);
    let free = free_dofs(mesh.nodes.len(), &nodes_at(&mesh, 0, 0.0));
    let assembled = assemble(&mesh, &steel(), &silent).unwrap();
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    let (stiffness, mass) = (dense(&stiffness), dense(&mass));
    let loads = DMatrix::from_fn(free.len(), contact.len(), |row, patch| {
        let weight = |&(node, weight): &(usize, f64)| {
            let [x, y, _] = mesh.nodes[node];
            let along = [x / x.hypot(y), y / x.hypot(y), 0.0][free[row] % 3];
            if free[row] / 3 == node { weight * along } else { 0.0 }
        };
        contact[patch].patch.iter().map(weight).sum::<f64>()
    });
    for (kind, modes) in [(ReductionKind::FixedInterface, 4), (ReductionKind::FreeInterface, 8)] {
        let rom = reduced(mesh.clone(), &contact, kind, modes).unwrap().rom;
        assert!(rom.checks.response_frequencies.len() >= 2, "{:?}", rom.checks);
        assert!(rom.checks.flexibility_deviation.iter().all(|off| *off < 1e-6), "{:?}", rom.checks);
        let radial = DMatrix::from_fn(contact.len(), rom.order(), |patch, column| rom.contact_map[(3 * patch, column)]);
        for (frequency, reported) in rom.checks.response_frequencies.iter().zip(&rom.checks.response_deviation) {
            let square = (std::f64::consts::TAU * frequency).powi(2);
            let solved = |stiffness: &DMatrix<f64>, mass: &DMatrix<f64>, map: &DMatrix<f64>| {
                map.transpose() * (stiffness - mass * square).lu().solve(map).unwrap()
            };
            let (full, own) =
                (solved(&stiffness, &mass, &loads), solved(&rom.stiffness, &rom.mass, &radial.transpose()));
            let off = 100.0 * (&full - own).norm() / full.norm();
            assert!(
                (off - reported).abs() <= 1e-3 * off + 1e-7,
                "{kind:?} at {frequency} Hz: {off:e} %, told {reported:e} %"
            );
        }
    }
}
