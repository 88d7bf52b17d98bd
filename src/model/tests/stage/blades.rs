//! Parametric stage: counts, faces, shape, and the blade alone against CalculiX.

use tiprub_model::assembly::{assemble, free_dofs, lumped_masses};
use tiprub_model::element::ElementKind;
use tiprub_model::progress::silent;
use tiprub_model::quality::{quality, worst_quality};
use tiprub_model::reduce::full_modes;
use tiprub_model::sparse::principal_pair;
use tiprub_model::stage::{
    SECTORS, SectorOptions, StageOptions, TIP_AXIAL, TIP_RADIUS, blade_mesh, reduce_stage, sector_mesh, stage_model,
};
use tiprub_model::{Material, Mesh, surface_quads};

fn all_options() -> [(&'static str, SectorOptions); 4] {
    let mut linear = SectorOptions::default();
    (linear.kind, linear.counts.thickness) = (ElementKind::Penta6, 2);
    [
        ("default", SectorOptions::default()),
        ("3,764 elements", SectorOptions::with_3764_elements()),
        ("coarse", SectorOptions::coarse()),
        ("penta6", linear),
    ]
}

fn mass(mesh: &Mesh) -> f64 {
    lumped_masses(mesh, Material::titanium().density).unwrap().iter().sum()
}

#[test]
fn mesh_counts_match_the_guide() {
    let expected = [(6734, 1832, 635, 181), (13205, 3764, 1297, 249), (294, 60, 45, 29), (1948, 2544, 178, 77)];
    for ((name, options), (nodes, elements, face, bore)) in all_options().into_iter().zip(expected) {
        let mesh = sector_mesh(&options).unwrap().mesh;
        mesh.validate().unwrap();
        let size = |set: &str| mesh.set(set).unwrap().len();
        let (apart, whole) = (3 * SECTORS * mesh.nodes.len(), 3 * SECTORS * (mesh.nodes.len() - size("CYCLIC_LOW")));
        println!(
            "{name}: {} nodes, {} elements, disk {apart} dofs, in one piece {whole}",
            mesh.nodes.len(),
            mesh.elements.len()
        );
        assert_eq!((mesh.nodes.len(), mesh.elements.len()), (nodes, elements));
        assert_eq!([size("CYCLIC_LOW"), size("CYCLIC_HIGH"), size("CLAMPED"), size("CONTACT")], [face, face, bore, 3]);
    }
    assert_eq!(3 * SECTORS * 6734, 1_131_312, "the paper's number of dofs");
}

#[test]
fn cyclic_faces_match_after_rotation_to_rounding() {
    for (name, options) in all_options() {
        let mesh = sector_mesh(&options).unwrap().mesh;
        let (sin, cos) = options.geometry.pitch().sin_cos();
        let high = mesh.set("CYCLIC_HIGH").unwrap();
        let mut worst = 0.0_f64;
        for &low in mesh.set("CYCLIC_LOW").unwrap() {
            let [x, y, z] = mesh.nodes[low];
            let turned = [cos * x - sin * y, sin * x + cos * y, z];
            let distance =
                |node: &usize| (0..3).map(|d| (mesh.nodes[*node][d] - turned[d]).powi(2)).sum::<f64>().sqrt();
            worst = worst.max(high.iter().map(distance).fold(f64::INFINITY, f64::min));
        }
        println!("{name}: largest distance {worst:.1e} m");
        assert!(worst < 2e-16);
    }
}

#[test]
fn elements_are_well_shaped() {
    for ((name, options), least) in all_options().into_iter().zip([0.21, 0.20, 0.13, 0.20]) {
        let worst = worst_quality(&sector_mesh(&options).unwrap().mesh);
        println!("{name}: {worst:?}");
        assert!(worst.scaled_jacobian > least && worst.jacobian_ratio > 0.1);
    }
}

#[test]
fn quality_is_one_if_regular_and_negative_if_inverted() {
    let prism = |height: f64| {
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.5, 0.75_f64.sqrt()]];
        [0.0, height].into_iter().flat_map(|z| corners.map(|[x, y]| [x, y, z])).collect::<Vec<_>>()
    };
    let cube: Vec<[f64; 3]> = ElementKind::Hex20.natural_nodes().to_vec();
    let tetrahedron = vec![[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]];
    for (kind, nodes) in
        [(ElementKind::Penta6, prism(1.0)), (ElementKind::Hex20, cube), (ElementKind::Tet4, tetrahedron)]
    {
        let found = quality(kind, &nodes);
        assert!((found.scaled_jacobian - 1.0).abs() < 1e-14 && (found.jacobian_ratio - 1.0).abs() < 1e-14, "{found:?}");
    }
    let inverted = quality(ElementKind::Penta6, &prism(-1.0));
    assert!((inverted.scaled_jacobian + 1.0).abs() < 1e-14 && inverted.jacobian_ratio < 0.0, "{inverted:?}");
    let mut bent = prism(1.0);
    bent[3] = [0.5, 0.0, 1.0];
    // Unit edges 1, (1/2, √3/2) and (1/2, 0, 1)/√1.25 at the moved corner's foot.
    let found = quality(ElementKind::Penta6, &bent);
    println!("{found:?}");
    assert!(found.scaled_jacobian < 1.25_f64.sqrt().recip() + 1e-14 && found.scaled_jacobian > 0.4);
}

#[test]
fn tip_contact_is_at_mid_thickness_of_a_cylinder() {
    for (_, options) in all_options() {
        let sector = sector_mesh(&options).unwrap();
        let mesh = &sector.mesh;
        let radius = |node: usize| mesh.nodes[node][0].hypot(mesh.nodes[node][1]);
        assert!(mesh.set("TIP").unwrap().iter().all(|&node| (radius(node) - TIP_RADIUS).abs() < 1e-15));
        assert!((0..mesh.nodes.len()).all(|node| radius(node) < TIP_RADIUS + 1e-15));
        let contact = sector.contact_points(3).unwrap();
        let names: Vec<&str> = contact.iter().map(|point| point.name.as_str()).collect();
        assert_eq!(names, ["leading_edge", "mid_chord", "trailing_edge"]);
        for (point, z) in contact.iter().zip([TIP_AXIAL[0], 0.0, TIP_AXIAL[1]]) {
            assert!((mesh.nodes[point.node][2] - z).abs() < 1e-17, "{point:?}");
        }
        let nodes: Vec<usize> = contact.iter().map(|point| point.node).collect();
        assert_eq!(nodes, mesh.set("CONTACT").unwrap());
        // The stage rotates towards +θ: blades lean the other way downstream.
        let angle = |node: usize| mesh.nodes[node][1].atan2(mesh.nodes[node][0]);
        assert!(angle(nodes[0]) > 0.05 && angle(nodes[1]).abs() < 1e-12 && angle(nodes[2]) < -0.05);
    }
}

/// Every edge of the outer faces belongs to two of them, in opposite directions: faces between cells are cut by the
/// same diagonals, and there are no gaps and no duplicate nodes.
#[test]
fn mesh_has_no_gaps_or_duplicate_nodes() {
    for (name, options) in all_options() {
        let mesh = sector_mesh(&options).unwrap().mesh;
        let mut edges = std::collections::HashMap::<[usize; 2], [i32; 2]>::new();
        for face in surface_quads(&mesh) {
            for (i, &a) in face.iter().enumerate() {
                let b = face[(i + 1) % face.len()];
                let [times, sum] = edges.entry([a.min(b), a.max(b)]).or_default();
                *times += 1;
                *sum += if a < b { 1 } else { -1 };
            }
        }
        assert!(!edges.is_empty() && edges.values().all(|&found| found == [2, 0]), "{name}");
        let mut nodes = mesh.nodes.clone();
        nodes.sort_by(|a, b| a[2].total_cmp(&b[2]));
        for (i, a) in nodes.iter().enumerate() {
            let close = nodes[i + 1..].iter().take_while(|b| b[2] - a[2] < 1e-6);
            assert!(close.into_iter().all(|b| (a[0] - b[0]).hypot(a[1] - b[1]) > 1e-5), "{name}: two nodes at {a:?}");
        }
    }
}

/// The volume of the blade is the integral of thickness over the camber surface, by the midpoint rule and
/// independently of the mesh: offsets to both sides of a curve enclose its length times the thickness.
#[test]
fn blade_mass_matches_its_sections() {
    let mut options = SectorOptions::default();
    options.geometry.blade.fillet = 0.0;
    let (blade, hub) = (&options.geometry.blade, options.geometry.disk.hub_radius);
    let mix = |[a, b]: [f64; 2], share: f64| a + (b - a) * share;
    let (steps, mut volume) = (200, 0.0);
    for i in 0..steps {
        let span = (f64::from(i) + 0.5) / f64::from(steps);
        let chord = mix([blade.root_axial[1] - blade.root_axial[0], blade.tip_axial[1] - blade.tip_axial[0]], span);
        let slopes = [mix(blade.inlet_angle, span).tan(), mix(blade.outlet_angle, span).tan()];
        let (middle, edge) = (mix(blade.thickness, span), mix(blade.edge_thickness, span));
        for j in 0..steps {
            let x = (f64::from(j) + 0.5) / f64::from(steps);
            let thickness = edge + (middle - edge) * 4.0 * x * (1.0 - x);
            volume +=
                thickness * 1.0_f64.hypot(mix(slopes, x)) * chord * (blade.tip_radius - hub) / f64::from(steps * steps);
        }
    }
    let found = mass(&blade_mesh(&options).unwrap().mesh) / Material::titanium().density;
    println!("blade: {found:.6e} m3, sections {volume:.6e} m3");
    assert!((found / volume - 1.0).abs() < 2e-3);
}

#[test]
fn refinement_keeps_the_mass_of_the_stage() {
    let [default, fine, coarse] =
        [SectorOptions::default(), SectorOptions::with_3764_elements(), SectorOptions::coarse()]
            .map(|options| mass(&sector_mesh(&options).unwrap().mesh));
    let blade = mass(&blade_mesh(&SectorOptions::default()).unwrap().mesh);
    println!("sector {default:.6} kg, finer mesh {fine:.6} kg, coarse {coarse:.6} kg, blade {blade:.6} kg");
    assert!((default / fine - 1.0).abs() < 1e-4);
    let disk = 56.0 * default;
    assert!((22.0..22.5).contains(&disk) && (0.069..0.071).contains(&blade), "{disk} kg, {blade} kg");
}

fn frequencies(mesh: &Mesh, count: usize) -> Vec<f64> {
    let assembled = assemble(mesh, &Material::titanium(), &silent).unwrap();
    let free = free_dofs(mesh.nodes.len(), mesh.set("CLAMPED").unwrap());
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    full_modes(&stiffness, &mass, false, count, &silent).unwrap().modes.frequencies()
}

#[test]
fn blade_without_disk_agrees_with_calculix() {
    let found = frequencies(&blade_mesh(&SectorOptions::default()).unwrap().mesh, 10);
    let reference: Vec<f64> = include_str!("../data/stage_blade_calculix.csv")
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
        .map(|line| line.split(',').nth(1).unwrap().parse().unwrap())
        .collect();
    assert_eq!(reference.len(), 10);
    for (k, (found, reference)) in found.iter().zip(&reference).enumerate() {
        let deviation = (found / reference - 1.0) * 100.0;
        println!("mode {}: {found:.4} Hz, CalculiX {reference} Hz, deviation {deviation:.2e} %", k + 1);
        assert!(deviation.abs() < 0.05);
    }
}

#[test]
fn the_default_mesh_of_the_blade_is_converged() {
    let mut fine = SectorOptions::default();
    (fine.counts.chord, fine.counts.span, fine.counts.thickness) = (20, 30, 2);
    let [coarse, fine] =
        [SectorOptions::default(), fine].map(|options| frequencies(&blade_mesh(&options).unwrap().mesh, 6));
    for (k, (coarse, fine)) in coarse.iter().zip(&fine).enumerate() {
        let deviation = (coarse / fine - 1.0) * 100.0;
        println!("mode {}: {coarse:.2} Hz, finer mesh {fine:.2} Hz, {deviation:.3} %", k + 1);
        assert!((0.0..1.0).contains(&deviation));
    }
}

#[test]
fn rejects_invalid_stage_options_by_name() {
    type Change = fn(&mut SectorOptions);
    let wrong: [(Change, &str); 16] = [
        (|o| o.counts.chord = 5, "`chord`: 5 is odd"),
        (|o| o.counts.span = 0, "`span`: it is zero"),
        (|o| o.counts.web = [5, 3], "`web and bore`"),
        (|o| o.counts.bore[0] = 9, "`web and bore`"),
        (|o| o.counts.overhang = 0, "`overhang`"),
        (|o| o.counts.bore[0] = 0, "`bore`"),
        (|o| o.kind = ElementKind::Penta6, "C3D6 with 1 layers"),
        (|o| o.kind = ElementKind::Hex20, "C3D20"),
        (|o| o.geometry.sectors = 2, "number of sectors"),
        (|o| o.geometry.disk.bore_radius = f64::NAN, "radii"),
        (|o| o.geometry.blade.tip_radius = 0.24, "tip radius"),
        (|o| o.geometry.blade.fillet = -1e-3, "fillet"),
        (|o| o.geometry.blade.inlet_angle[1] = 70.0, "angles"),
        (|o| o.geometry.blade.edge_thickness[0] = 0.01, "thicknesses"),
        (|o| o.geometry.blade.thickness[0] = 0.03, "width of the blade root"),
        (|o| o.geometry.disk.rim_axial[0] = -0.01, "rim"),
    ];
    for (change, part) in wrong {
        let mut options = SectorOptions::default();
        change(&mut options);
        let message = sector_mesh(&options).expect_err(part).to_string();
        println!("{message}");
        assert!(message.contains(part), "`{message}` lacks `{part}`");
    }
}

#[test]
fn the_disk_is_reduced_with_its_contact_nodes() {
    let options = StageOptions::coarse();
    let stage = stage_model(&options, &silent).unwrap();
    assert_eq!((stage.boundary.pairs.len(), stage.boundary.sectors), (45, SECTORS));
    assert!(stage.pairing.largest_mismatch < 2e-16 && !stage.pairing.swapped);
    let reduction = reduce_stage(&options, &silent).unwrap();
    let rom = &reduction.rom;
    rom.validate().unwrap();
    assert!(rom.is_cyclic() && rom.sectors == SECTORS && reduction.nodal_diameters.len() == 29);
    for (node, (name, z)) in rom.contact_nodes.iter().zip([
        ("leading_edge", TIP_AXIAL[0]),
        ("mid_chord", 0.0),
        ("trailing_edge", TIP_AXIAL[1]),
    ]) {
        assert_eq!(node.name, name);
        assert!((node.position[0] - TIP_RADIUS).abs() < 1e-15 && (node.position[2] - z).abs() < 1e-17);
        assert!(node.meridional_slope.abs() < f64::MIN_POSITIVE);
    }
    // One blade bends at 408 Hz (coarse mesh 430 Hz); families are separate, and the disk takes part below 4 nodal
    // diameters.
    let first = |n: usize| reduction.nodal_diameters[n].full_frequencies[0];
    println!("{:?}", (0..29).map(first).collect::<Vec<_>>());
    assert!((6..29).all(|n| (first(n) / first(28) - 1.0).abs() < 0.01) && first(0) < 0.85 * first(28));
    let last = reduction.convergence.last().unwrap();
    let largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
    println!("{last:?}");
    assert!(last.frequency_deviation.len() == 56 && largest(&last.frequency_deviation) < 0.3);
    assert!(largest(&last.residual_criterion) < 1.0);
}
