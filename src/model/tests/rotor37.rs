//! Blade of rotor 37: fit, mesh, frequencies against CalculiX, reduction.

use std::sync::OnceLock;

use tiprub_model::assembly::{assemble, free_dofs};
use tiprub_model::element::consistent_mass;
use tiprub_model::progress::silent;
use tiprub_model::reduce::full_modes;
use tiprub_model::rotor37::{AerofoilSection, FIT_ALONG_THETA, FIT_DISTANCE, MeshCounts, blade_mesh, sections};
use tiprub_model::sparse::principal_pair;
use tiprub_model::{Reduction, Rotor37Options, inp, reduce_rotor37, surface_quads};

/// Line of the table of NASA TP-1659: surface and station from 1, z and r in m, θ in rad.
struct Station {
    surface: usize,
    z: f64,
    r: f64,
    theta: [f64; 2],
}

fn sample() -> Vec<Station> {
    let text = include_str!("data/rotor37_sample.csv");
    text.lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
        .map(|line| {
            let words: Vec<f64> = line.split(',').map(|word| word.parse().unwrap()).collect();
            let surface = line.split(',').next().unwrap().parse().unwrap();
            Station { surface, z: words[2] / 100.0, r: words[3] / 100.0, theta: [words[4], words[5]] }
        })
        .collect()
}

/// Parses the complete table as published: `SURFACE NUMBER` lines, then lines of five columns.
fn complete_table(text: &str) -> Vec<Station> {
    let mut surface = 0;
    let mut stations = Vec::new();
    for line in text.lines() {
        if line.contains("SURFACE NUMBER") {
            surface += 1;
            continue;
        }
        let words: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        if words.len() == 5 && (1..=12).contains(&surface) {
            stations.push(Station { surface, z: words[1] / 100.0, r: words[2] / 100.0, theta: [words[3], words[4]] });
        }
    }
    stations
}

fn distance_to_segment(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (d, e) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = d[0] * d[0] + d[1] * d[1];
    let t = if length > 0.0 { ((d[0] * e[0] + d[1] * e[1]) / length).clamp(0.0, 1.0) } else { 0.0 };
    (e[0] - t * d[0]).hypot(e[1] - t * d[1])
}

/// Returns θ of the fitted side at the plane abscissa `x`; `None` on the edge arcs.
fn side_theta(section: &AerofoilSection, side: f64, x: f64) -> Option<f64> {
    let at = |u: f64| {
        let [camber, half] = section.sides(u);
        section.plane(u, camber + side * half)
    };
    let margin = 2.0 * section.edge_radii()[0] / section.chord();
    let (mut low, mut high) = (margin, 1.0 - margin);
    if x < at(low)[0] || x > at(high)[0] {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if at(middle)[0] < x { low = middle } else { high = middle }
    }
    Some(at(low)[1] / section.mean_radius())
}

/// Returns the largest errors (m) over the stations: normal distance to the closed outline combined with the error in
/// r at equal z, the error in r alone, and the distance along rθ at equal z for points on the sides.
fn fit_errors(stations: &[Station]) -> [f64; 3] {
    let outlines: Vec<Vec<[f64; 2]>> = sections().iter().map(|section| section.outline(400)).collect();
    let mut worst = [0.0_f64; 3];
    for station in stations {
        let (section, outline) = (&sections()[station.surface - 1], &outlines[station.surface - 1]);
        let x = section.abscissa(station.z);
        let radial = (section.on_surface([x, 0.0]).r - station.r).abs();
        let scale = station.r / section.mean_radius();
        for (side, theta) in [1.0, -1.0].into_iter().zip(station.theta) {
            let point = [x, theta * section.mean_radius()];
            let normal = outline.windows(2).map(|pair| distance_to_segment(point, pair[0], pair[1]));
            let normal = scale * normal.fold(f64::INFINITY, f64::min);
            let along = side_theta(section, side, x).map_or(0.0, |fitted| station.r * (fitted - theta).abs());
            worst = [worst[0].max(normal.hypot(radial)), worst[1].max(radial), worst[2].max(along)];
        }
    }
    worst
}

fn assert_fit(stations: &[Station], what: &str) {
    let [distance, radial, along] = fit_errors(stations);
    println!(
        "{what}: {} points; largest distance {:.4} mm, in r {:.4} mm, along rθ on the sides {:.4} mm",
        2 * stations.len(),
        1e3 * distance,
        1e3 * radial,
        1e3 * along
    );
    assert!(distance <= FIT_DISTANCE && radial <= FIT_DISTANCE && along <= FIT_ALONG_THETA);
    assert!(FIT_DISTANCE.max(FIT_ALONG_THETA) <= 0.02e-3);
}

#[test]
fn fit_is_within_20_micrometres_of_the_sample() {
    let stations = sample();
    assert_eq!(stations.len(), 12 * 17);
    assert_fit(&stations, "thinned table");
}

/// All 2400 points. The table is not part of the repository:
/// `TIPRUB_ROTOR37_COORDINATES=FILE cargo test --release -p tiprub-model --test rotor37 -- --ignored --nocapture`
/// with table IV of NASA TP-1659 in FILE runs the test.
#[test]
#[ignore = "needs the complete table of NASA TP-1659 in the file named by TIPRUB_ROTOR37_COORDINATES"]
fn fit_is_within_twenty_micrometres_of_the_table() {
    let path = std::env::var("TIPRUB_ROTOR37_COORDINATES").expect("TIPRUB_ROTOR37_COORDINATES names the table");
    let stations = complete_table(&std::fs::read_to_string(path).unwrap());
    assert_eq!(stations.len(), 1200);
    assert_fit(&stations, "complete table");
}

#[test]
fn detects_a_displaced_blade() {
    let mut stations = sample();
    stations[8].theta[0] += 0.05e-3 / stations[8].r;
    let [distance, _, along] = fit_errors(&stations);
    assert!(distance > 0.02e-3 && along > 0.02e-3, "{distance} {along}");
}

/// The area inside the outline (shoelace) agrees with the area of the cross-section of the mesh to 0.1 % because of
/// the flat ends. Ending the mesh at the centres of the arcs would lose 0.3 %.
#[test]
fn mesh_volume_matches_rounded_sections() {
    let areas: Vec<f64> = sections()
        .iter()
        .map(|section| {
            let outline = section.outline(2000);
            let twice: f64 = outline.windows(2).map(|pair| pair[0][0] * pair[1][1] - pair[1][0] * pair[0][1]).sum();
            0.5 * twice.abs()
        })
        .collect();
    for (section, area) in sections().iter().zip(areas) {
        let [leading, trailing] =
            section.edge_radii().map(|radius| core::f64::consts::FRAC_PI_4 * radius / section.chord());
        let count = 20_000;
        let width = (1.0 + leading + trailing) / f64::from(count);
        let flat: f64 = (0..count)
            .map(|i| 2.0 * section.sides(-leading + (f64::from(i) + 0.5) * width)[1] * width * section.chord())
            .sum();
        assert!((flat / area - 1.0).abs() < 1e-3, "area with flat ends {flat}, with round ends {area}");
    }
}

#[test]
fn mesh_is_valid_and_surface_is_closed() {
    let counts = MeshCounts::default();
    let blade = blade_mesh(counts).unwrap();
    blade.mesh.validate().unwrap();
    let quads = surface_quads(&blade.mesh);
    let MeshCounts { chord, thickness, span } = counts;
    assert_eq!(quads.len(), 2 * (chord * thickness + chord * span + thickness * span));
    let mut edges = std::collections::HashMap::new();
    for quad in &quads {
        for i in 0..4 {
            let (a, b) = (quad[i], quad[(i + 1) % 4]);
            *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
        }
    }
    assert!(edges.values().all(|&sum| sum == 0), "every edge is run through once in each direction");
    // The divergence theorem over the faces gives the volume, positive if they are oriented outwards.
    let corner = |node: usize| nalgebra::Vector3::from(blade.mesh.nodes[node]);
    let volume: f64 = quads
        .iter()
        .map(|q| {
            let [a, b, c, d] = [q[0], q[1], q[2], q[3]].map(corner);
            (a.dot(&b.cross(&c)) + a.dot(&c.cross(&d))) / 6.0
        })
        .sum();
    let mass: f64 = blade
        .mesh
        .elements
        .iter()
        .enumerate()
        .map(|(n, e)| consistent_mass(e.kind, &blade.mesh.coordinates(e), 1.0, n).unwrap().sum())
        .sum();
    assert!((volume / mass - 1.0).abs() < 0.02, "{volume} {mass}");
}

/// The leading edge of the compressor blade is ahead: for positive speed θ decreases from leading to trailing edge.
#[test]
fn leading_edge_is_ahead_for_positive_speed() {
    let blade = blade_mesh(MeshCounts::default()).unwrap();
    let theta = |node: usize| blade.mesh.nodes[node][1].atan2(blade.mesh.nodes[node][0]);
    let (first, last) = (blade.tip_line[0], blade.tip_line[blade.tip_line.len() - 1]);
    assert!(theta(first) > theta(last));
    assert!(blade.mesh.nodes[first][2] < blade.mesh.nodes[last][2]);
    // Tip nodes lie on the tip surface of the table.
    let tip = &sections()[11];
    for &node in &blade.tip_line {
        let [x, y, z] = blade.mesh.nodes[node];
        assert!((tip.on_surface([tip.abscissa(z), 0.0]).r - x.hypot(y)).abs() < 1e-9);
    }
}

#[test]
fn contact_nodes_are_named_and_spread_along_the_tip() {
    let blade = blade_mesh(MeshCounts::default()).unwrap();
    let names = |count: usize| -> Vec<String> {
        blade.contact_points(count).unwrap().into_iter().map(|point| point.name).collect()
    };
    assert_eq!(names(2), ["leading_edge", "trailing_edge"]);
    assert_eq!(names(3), ["leading_edge", "mid_chord", "trailing_edge"]);
    assert_eq!(names(5), ["leading_edge", "tip_2", "mid_chord", "tip_4", "trailing_edge"]);
    let points = blade.contact_points(7).unwrap();
    let z: Vec<f64> = points.iter().map(|point| blade.mesh.nodes[point.node][2]).collect();
    assert!(z.windows(2).all(|pair| pair[1] - pair[0] > 3e-3), "{z:?}");
    assert!(points.iter().all(|point| (-0.4..-0.1).contains(&point.meridional_slope)), "{points:?}");
    assert_eq!(blade.contact_points(33).unwrap().len(), 33);
    for count in [0, 1, 34] {
        let error = blade.contact_points(count).unwrap_err().to_string();
        assert!(
            error.starts_with(&format!("number of contact nodes: {count} is outside the range 2 to 33")),
            "{error}"
        );
    }
    // With one element through the thickness the line passes through mid-side nodes, which only exist at corner
    // stations.
    assert_eq!(blade_mesh(MeshCounts { chord: 8, thickness: 1, span: 4 }).unwrap().contact_points(9).unwrap().len(), 9);
    let error = blade_mesh(MeshCounts { span: 0, ..MeshCounts::default() }).unwrap_err().to_string();
    assert!(error.starts_with("mesh count `span`: it is zero"), "{error}");
}

/// Returns the reduced blade, computed once for all tests of this file.
fn default_reduction() -> &'static Reduction {
    static REDUCTION: OnceLock<Reduction> = OnceLock::new();
    REDUCTION.get_or_init(|| reduce_rotor37(&Rotor37Options::paper(), &silent).unwrap())
}

#[test]
fn default_blade_and_its_reduction_agree_with_calculix() {
    let reduction = default_reduction();
    let mesh = reduction.mesh.as_ref().unwrap();
    assert_eq!((mesh.nodes.len(), mesh.elements.len()), (3813, 640), "the mesh of the reference");
    let checks = &reduction.rom.checks;
    let reference: Vec<f64> = include_str!("data/rotor37_calculix.csv")
        .lines()
        .filter(|line| line.starts_with(|c: char| c.is_ascii_digit()))
        .map(|line| line.split(',').nth(1).unwrap().parse().unwrap())
        .collect();
    assert_eq!(reference.len(), 10);
    for (k, (full, reference)) in checks.full_frequencies.iter().zip(&reference).enumerate() {
        let deviation = (full / reference - 1.0) * 100.0;
        println!("mode {}: {full:.4} Hz, CalculiX {reference} Hz, deviation {deviation:.2e} %", k + 1);
        // CalculiX prints seven digits.
        assert!(deviation.abs() <= 5e-5, "{deviation:e} %");
    }
    for k in 0..checks.full_frequencies.len() {
        let (deviation, residual) = (checks.frequency_deviation[k], checks.residual_criterion[k]);
        println!("mode {}: Craig-Bampton deviation {deviation:.2e} %, RCC {residual:.2e} %", k + 1);
        assert!(deviation >= -1e-7 && residual <= 1.0);
    }
    assert!(checks.frequency_deviation[..4].iter().all(|&deviation| deviation <= 0.1));
    assert!(reduction.largest_residual < 1e-8);
    let rom = &reduction.rom;
    assert_eq!((rom.sectors, rom.order(), rom.contact_nodes.len()), (36, 29, 3));
    rom.validate().unwrap();
}

#[test]
fn default_mesh_is_converged_to_half_a_percent() {
    let mesh = blade_mesh(MeshCounts { chord: 32, thickness: 2, span: 40 }).unwrap().mesh;
    let assembled = assemble(&mesh, &Rotor37Options::paper().material, &silent).unwrap();
    let free = free_dofs(mesh.nodes.len(), mesh.set("hub").unwrap());
    let (stiffness, mass) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    let fine = full_modes(&stiffness, &mass, false, 10, &silent).unwrap().modes.frequencies();
    let coarse = &default_reduction().rom.checks.full_frequencies;
    assert_eq!((coarse.len(), fine.len()), (10, 10));
    for (k, (coarse, fine)) in coarse.iter().zip(&fine).enumerate() {
        println!("mode {}: default {coarse:.3} Hz, four times as many elements {fine:.3} Hz", k + 1);
        assert!((coarse / fine - 1.0).abs() < 5e-3);
    }
}

#[test]
fn exported_file_is_complete_or_absent() {
    let blade = blade_mesh(MeshCounts { chord: 3, thickness: 1, span: 2 }).unwrap();
    let material = Rotor37Options::paper().material;
    let text = inp::calculix_input(&blade.mesh, &material, Some("hub"), 10).unwrap();
    let section = |keyword: &str| -> Vec<&str> {
        text.lines()
            .skip_while(|line| !line.starts_with(keyword))
            .skip(1)
            .take_while(|line| !line.starts_with('*'))
            .collect()
    };
    let nodes = section("*NODE,");
    assert_eq!(nodes.len(), blade.mesh.nodes.len());
    for (line, node) in nodes.iter().zip(&blade.mesh.nodes) {
        let fields: Vec<&str> = line.split(',').skip(1).map(str::trim).collect();
        assert!(fields.iter().all(|field| field.len() <= 20), "CalculiX reads 20 characters: {line}");
        fields.iter().zip(node).for_each(|(f, x)| assert!((f.parse::<f64>().unwrap() - x).abs() <= 1e-12 * x.abs()));
    }
    let numbers: Vec<usize> =
        section("*ELEMENT").join(" ").split([',', ' ']).filter_map(|word| word.parse().ok()).collect();
    assert_eq!(numbers.len(), 21 * blade.mesh.elements.len());
    assert_eq!(section("*BOUNDARY"), ["HUB, 1, 3"]);
    let error = inp::calculix_input(&blade.mesh, &material, Some("root"), 10).unwrap_err().to_string();
    assert!(error.contains("node set `root`") && error.contains("hub"), "{error}");
}

#[test]
fn rom_is_bit_identical_for_any_thread_count() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| reduce_rotor37(&Rotor37Options::paper(), &silent)).unwrap().rom
    };
    for threads in [1, 5] {
        assert!(on(threads) == default_reduction().rom, "{threads} threads");
    }
}
