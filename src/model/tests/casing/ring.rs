//! Casing rings: frequencies against closed form and CalculiX, geometry, mesh, rejected input.

use std::f64::consts::TAU;
use std::sync::OnceLock;

use crate::common::casing::{coarse, heated};
use tiprub_core::scene::rom::ContactGrid;
use tiprub_model::casing::{
    CLAMPED, ContactRings, Flange, InnerContour, RingCounts, RingGeometry, RingSupport, casing37_contour,
    supported_ring,
};
use tiprub_model::element::ElementKind;
use tiprub_model::progress::silent;
use tiprub_model::rotor37::{MeshCounts, TIP_GAP, blade_mesh};
use tiprub_model::thermal::{equal_patches, patch_of_elements};
use tiprub_model::{CasingOptions, Material, Reduction, reduce_ring};

/// In-plane bending of a thin ring (Love): ω² = n²(n² − 1)²/(n² + 1) · EI/(ρAR⁴).
#[test]
fn thin_free_ring_has_textbook_bending_frequencies() {
    let (radius, length) = (0.25, 10e-3);
    let mut deviations = Vec::new();
    for thickness in [20e-3, 10e-3, 5e-3] {
        let inner = radius - 0.5 * thickness;
        let options = CasingOptions {
            name: "thin".into(),
            geometry: RingGeometry {
                contour: InnerContour::new(&[[0.0, inner], [length, inner]]).unwrap(),
                thickness,
                flanges: [None, None],
            },
            counts: RingCounts { around: 192, through: 1, along: 3, flange: 1 },
            rings: ContactRings { around: 12, along: 2, axial: [2.5e-3, 7.5e-3] },
            patches: [4, 1],
            fixed_interface_modes: 24,
            modes: 30,
            checked_modes: 20,
            support: RingSupport::Free,
            ..CasingOptions::default()
        };
        let reduction = reduce_ring(&options, &silent).unwrap();
        let Material { young_modulus, density, .. } = options.material;
        let unit = (young_modulus * thickness * thickness / (12.0 * density * radius.powi(4))).sqrt() / TAU;
        let theory = [2.0_f64, 3.0].map(|n| n * (n * n - 1.0) / (n * n + 1.0).sqrt() * unit);
        // In-plane modes hardly move along the axis.
        let in_plane = reduction.modes[6..].iter().filter(|mode| {
            let part = |i: usize| mode.shape.iter().map(|u| u[i] * u[i]).sum::<f64>();
            part(2) < 0.1 * (part(0) + part(1))
        });
        let found: Vec<f64> = in_plane.map(|mode| mode.frequency).collect();
        let deviation = [found[0] / theory[0] - 1.0, found[2] / theory[1] - 1.0];
        println!(
            "thickness/R {:.3}: n = 2 {:.3} Hz, thin ring {:.3} Hz, {:+.4} %; n = 3 {:.3} Hz, {:.3} Hz, {:+.4} %",
            thickness / radius,
            found[0],
            theory[0],
            100.0 * deviation[0],
            found[2],
            theory[1],
            100.0 * deviation[1]
        );
        assert!((found[1] / found[0] - 1.0).abs() < 1e-6 && (found[3] / found[2] - 1.0).abs() < 1e-6, "{found:?}");
        deviations.push(deviation[0]);
    }
    // Thickness reduces the frequency by shear and rotatory inertia, with the square of h/R.
    assert!(deviations[2].abs() < 5e-4, "{deviations:?}");
    assert!(deviations[0] < 0.0 && (deviations[0] / deviations[1] - 4.0).abs() < 0.6, "{deviations:?}");
}

fn default_casing() -> &'static Reduction {
    static DEFAULT: OnceLock<Reduction> = OnceLock::new();
    DEFAULT.get_or_init(|| reduce_ring(&CasingOptions::default(), &silent).unwrap())
}

fn reference(kind: &str) -> Vec<[f64; 2]> {
    include_str!("../data/casing37_calculix.csv")
        .lines()
        .filter(|line| line.starts_with(kind))
        .map(|line| {
            let words: Vec<f64> = line.split(',').skip(2).map(|word| word.parse().unwrap_or(0.0)).collect();
            [words[0], words[1]]
        })
        .collect()
}

#[test]
fn casing37_and_its_reduction_agree_with_calculix() {
    let reduction = default_casing();
    let mesh = reduction.mesh.as_ref().unwrap();
    assert_eq!((mesh.nodes.len(), mesh.elements.len()), (7920, 1080), "the mesh of the reference");
    let (rom, checks) = (&reduction.rom, &reduction.rom.checks);
    rom.validate().unwrap();
    assert_eq!(rom.extras.grid, Some(ContactGrid { around: 24, along: 3, closed: true }));
    assert!(rom.order() <= 300, "{}", rom.order());
    let frequencies = reference("mode");
    assert_eq!((frequencies.len(), checks.full_frequencies.len()), (20, 20));
    let mut worst = [0.0_f64; 4];
    for k in 0..20 {
        let [frequency, _] = frequencies[k];
        worst[0] = worst[0].max((checks.full_frequencies[k] / frequency - 1.0).abs() * 100.0);
        worst[1] = worst[1].max(checks.frequency_deviation[k]);
        worst[2] = worst[2].max(checks.residual_criterion[k]);
        assert!(checks.frequency_deviation[k] > -1e-6);
    }
    println!("20 modes, {:.1} to {:.1} Hz: CalculiX {:.1e} %", frequencies[0][0], frequencies[19][0], worst[0]);
    println!("eq. 13 {:.3} %, eq. 12 {:.3} %", worst[1], worst[2]);
    assert!(worst[0] <= 1e-4 && worst[1] <= 0.15 && worst[2] <= 0.3, "{worst:?}");
    let displacement = heated(rom, &[100.0; 12]);
    for (ring, [radial, axial]) in reference("heated_ring").into_iter().enumerate() {
        let at = 3 * 24 * ring;
        let errors = [displacement[at] / radial - 1.0, displacement[at + 2] / axial - 1.0];
        println!(
            "ring {}, 100 K: {:.6e} m radially, off CalculiX by {:.1e}, {:.1e}",
            ring + 1,
            radial,
            errors[0],
            errors[1]
        );
        assert!(errors.iter().all(|error| error.abs() < 1e-6));
    }
}

#[test]
fn reduction_keeps_double_modes_of_casing37() {
    let reduction = default_casing();
    let splits =
        |frequencies: &[f64]| -> Vec<f64> { frequencies.as_chunks::<2>().0.iter().map(|[a, b]| b / a - 1.0).collect() };
    let reduced: Vec<f64> = reduction.reduced_angular_frequencies[..20].to_vec();
    let full: Vec<f64> = reduction.modes.iter().map(|mode| mode.frequency).collect();
    let largest = |values: Vec<f64>| values.into_iter().fold(0.0, f64::max);
    let (full, reduced) = (largest(splits(&full)), largest(splits(&reduced)));
    println!("the first ten pairs split by at most {full:.1e} in the full model, {reduced:.1e} in the reduced one");
    assert!(full < 1e-9 && reduced < 1e-6);
}

/// The gap between the tip of rotor 37 and a surface through the contact rings of casing37, a natural spline along
/// the axis.
#[test]
fn casing37_follows_the_tip() {
    let rom = &default_casing().rom;
    let rings: Vec<[f64; 3]> = (0..3).map(|ring| rom.contact_nodes[24 * ring].position).collect();
    let [a, b] = [rings[1][2] - rings[0][2], rings[2][2] - rings[1][2]];
    let moment = 3.0 * ((rings[2][0] - rings[1][0]) / b - (rings[1][0] - rings[0][0]) / a) / (a + b);
    let surface = |z: f64| {
        let (i, h) = if z < rings[1][2] { (0, a) } else { (1, b) };
        let (s, t) = ((rings[i + 1][2] - z) / h, (z - rings[i][2]) / h);
        let bend = if i == 0 { t * t * t - t } else { s * s * s - s };
        s * rings[i][0] + t * rings[i + 1][0] + bend * moment * h * h / 6.0
    };
    let blade = blade_mesh(MeshCounts::default()).unwrap();
    let contour = casing37_contour();
    let (mut range, mut off) = ([f64::INFINITY, 0.0_f64], 0.0_f64);
    for &node in &blade.tip_line {
        let [x, y, z] = blade.mesh.nodes[node];
        let gap = surface(z) - x.hypot(y);
        range = [range[0].min(gap), range[1].max(gap)];
        off = off.max((contour.radius(z) - surface(z)).abs());
        assert!(z > rings[0][2] + 3e-3 && z < rings[2][2] - 3e-3, "contact rings reach beyond the blade");
    }
    println!("gap {:.4} to {:.4} mm, {:.3} mm asked for", 1e3 * range[0], 1e3 * range[1], 1e3 * TIP_GAP);
    println!("the mesh is off the spline through its contact rings by {off:.1e} m");
    assert!(range[0] > 0.9 * TIP_GAP && range[1] < 1.3 * TIP_GAP && off < 1e-9);
    for point in blade.contact_points(3).unwrap() {
        let [x, y, z] = blade.mesh.nodes[point.node];
        assert!((surface(z) - x.hypot(y) - TIP_GAP).abs() < 1e-12, "{}", point.name);
    }
}

#[test]
fn contours_interpolate_points_without_overshoot() {
    let cone = InnerContour::new(&[[0.1, 0.3], [0.2, 0.25]]).unwrap();
    assert!((cone.radius(0.15) - 0.275).abs() < 1e-15 && (cone.slope(0.13) + 0.5).abs() < 1e-14);
    let points = [[0.0, 0.30], [0.01, 0.30], [0.02, 0.29], [0.05, 0.288], [0.06, 0.295]];
    let contour = InnerContour::new(&points).unwrap();
    for [z, r] in points {
        assert!((contour.radius(z) - r).abs() < 1e-15);
    }
    for pair in points.windows(2) {
        let (low, high) = (pair[0][1].min(pair[1][1]), pair[0][1].max(pair[1][1]));
        for i in 1..20 {
            let z = pair[0][0] + (pair[1][0] - pair[0][0]) * f64::from(i) / 20.0;
            let r = contour.radius(z);
            assert!(r >= low - 1e-15 && r <= high + 1e-15, "{z}: {r}");
            let step = 1e-7;
            let numeric = (contour.radius(z + step) - contour.radius(z - step)) / (2.0 * step);
            assert!((contour.slope(z) - numeric).abs() < 1e-5, "{z}");
        }
    }
}

#[test]
fn rings_have_exact_node_sets_and_volume() {
    let flange = Flange { thickness: 5e-3, height: 10e-3 };
    let geometry = RingGeometry {
        contour: InnerContour::new(&[[0.0, 0.25], [0.06, 0.25]]).unwrap(),
        thickness: 4e-3,
        flanges: [Some(flange), None],
    };
    let area = |inner: f64, outer: f64| 0.5 * TAU * (outer * outer - inner * inner);
    let expected = area(0.25, 0.254) * 0.06 + area(0.254, 0.264) * 5e-3;
    for (kind, tolerance) in [(ElementKind::Hex20, 1e-5), (ElementKind::Hex8, 2e-3)] {
        let options = CasingOptions {
            geometry: geometry.clone(),
            kind,
            counts: RingCounts { around: 72, through: 2, along: 12, flange: 2 },
            rings: ContactRings { around: 24, along: 3, axial: [0.005, 0.055] },
            support: RingSupport::Both,
            ..CasingOptions::default()
        };
        let ring = supported_ring(&options).unwrap();
        ring.mesh.validate().unwrap();
        let unit = Material { density: 1.0, ..Material::steel() };
        let volume: f64 = tiprub_model::assembly::lumped_masses(&ring.mesh, unit.density).unwrap().iter().sum();
        println!("{kind:?}: volume off by {:.1e}", volume / expected - 1.0);
        assert!((volume / expected - 1.0).abs() < tolerance);
        let holds = |set: &str, inside: &dyn Fn(f64, f64) -> bool| {
            let by_place: Vec<usize> = (0..ring.mesh.nodes.len())
                .filter(|&node| {
                    let [x, y, z] = ring.mesh.nodes[node];
                    inside(x.hypot(y), z)
                })
                .collect();
            assert_eq!(ring.mesh.set(set).unwrap(), by_place, "{kind:?}: {set}");
        };
        // Mid-side nodes lie on the circle, too.
        holds("inner", &|r, _| (r - 0.25).abs() < 1e-9);
        holds("low_face", &|_, z| z.abs() < 1e-12);
        holds("high_face", &|_, z| (z - 0.06).abs() < 1e-12);
        holds(CLAMPED, &|_, z| z.abs() < 1e-12 || (z - 0.06).abs() < 1e-12);
        holds("outer", &|r, _| (r - 0.254).abs() < 1e-9);
        assert_eq!(ring.grid.nodes.len(), 72);
        assert_eq!(ring.mesh.nodes[ring.grid.nodes[0]][2].to_bits(), 0.005_f64.to_bits());
    }
}

#[test]
fn centroid_on_an_edge_belongs_to_the_following_patch() {
    let options = coarse(RingSupport::Free);
    let mesh = supported_ring(&options).unwrap().mesh;
    // 24 elements and 16 patches around: every second edge halves an element.
    let found = patch_of_elements(&mesh, &equal_patches(16, 1, options.geometry.contour.axial())).unwrap();
    let mut sizes = [0; 16];
    found.iter().for_each(|patch| sizes[patch.unwrap()] += 1);
    let rows = mesh.elements.len() / 24;
    assert!((0..16).all(|patch| sizes[patch] == if patch % 2 == 0 { rows } else { 2 * rows }), "{sizes:?}");
}

#[test]
fn rejects_invalid_ring_options_by_name() {
    let refused = |change: &dyn Fn(&mut CasingOptions), hint: &str| {
        let mut options = coarse(RingSupport::Low);
        change(&mut options);
        let error = reduce_ring(&options, &silent).unwrap_err().to_string();
        assert!(error.contains(hint), "{error}");
    };
    refused(&|o| o.counts.around = 30, "Give 48 elements around");
    refused(&|o| o.counts.through = 0, "element count `through`: it is zero");
    refused(&|o| o.geometry.thickness = -1e-3, "casing, thickness: -0.001 m is not positive");
    refused(&|o| o.geometry.flanges[0].as_mut().unwrap().thickness = 0.09, "thick in total");
    refused(&|o| o.rings.axial[1] = 0.05, "contact rings: 0.0026 m to 0.05 m is not an ascending range inside");
    refused(&|o| o.rings.axial[0] = f64::NAN, "is not an ascending range inside");
    refused(&|o| o.rings.along = 1, "at least 4 around and 2 along");
    refused(&|o| o.kind = ElementKind::Tet10, "C3D10 is neither hex8 nor hex20");
    refused(&|o| o.material.expansion = 11.7, "thermal expansion coefficient: 11.7 does not satisfy");
    refused(&|o| o.patches = [48, 1], "no element has its centroid");
    refused(&|o| o.fixed_interface_modes = 1_000_000, "number of fixed-interface modes");
    for points in [vec![[0.0, 0.25]], vec![[0.0, 0.25], [0.0, 0.26]], vec![[0.0, 0.25], [0.1, -0.2]]] {
        assert!(InnerContour::new(&points).unwrap_err().to_string().starts_with("contour of the casing"));
    }
}
