//! Casing of the stage: counts of the paper, volume, and reduction on a coarser mesh.

use std::f64::consts::TAU;

use tiprub_model::assembly::lumped_masses;
use tiprub_model::casing::CLAMPED;
use tiprub_model::element::ElementKind;
use tiprub_model::progress::silent;
use tiprub_model::stage::casing::{StageCasingOptions, reduce_stage_casing, stage_casing_mesh};
use tiprub_model::stage::{GAP, TIP_AXIAL, TIP_RADIUS};

/// Section 6.1: 44,800 elements, 68,768 nodes, 206,304 degrees of freedom.
#[test]
fn default_mesh_has_the_size_of_the_paper() {
    let ring = stage_casing_mesh(&StageCasingOptions::default()).unwrap();
    ring.mesh.validate().unwrap();
    let counts = (ring.mesh.elements.len(), ring.mesh.nodes.len(), 3 * ring.mesh.nodes.len());
    assert_eq!(counts, (44_800, 68_768, 206_304));
    assert_eq!(ring.mesh.set("inner").unwrap().len(), 73 * 224);
    assert_eq!(ring.mesh.set(CLAMPED).unwrap().len(), 13 * 224);
    assert_eq!((ring.grid.around, ring.grid.nodes.len()), (28, 84));
    for (index, &node) in ring.grid.nodes.iter().enumerate() {
        let [x, y, z] = ring.mesh.nodes[node];
        let angle = TAU * (index % 28) as f64 / 28.0;
        assert!((x.hypot(y) - TIP_RADIUS - GAP).abs() < 1e-15, "node {node}");
        assert!((y.atan2(x).rem_euclid(TAU) - angle).abs() < 1e-12, "node {node} at {z} m");
        let expected = [TIP_AXIAL[0] - 4e-3, 0.0, TIP_AXIAL[1] + 4e-3][index / 28];
        assert!((z - expected).abs() < 1e-15, "node {node} at {z} m instead of {expected} m");
    }
}

/// The elements fill wall, flanges and hooks, as annuli of 224 straight sides, without gap or overlap.
#[test]
fn the_elements_fill_the_section() {
    let ring = stage_casing_mesh(&StageCasingOptions::default()).unwrap();
    let volume: f64 = lumped_masses(&ring.mesh, 1.0).unwrap().iter().sum();
    let inner = TIP_RADIUS + GAP;
    let annulus = |from: f64, to: f64, length: f64| 0.5 * TAU * (to * to - from * from) * length;
    let outer = inner + 5e-3;
    // A hook is one of the 22 cells over 35 mm.
    let hook = 35e-3 / 22.0;
    let parts = [
        annulus(inner, outer, 0.12),
        2.0 * annulus(outer, outer + 30e-3, 5e-3),
        annulus(outer, outer + 10e-3, 2.0 * hook),
    ];
    // Bricks have straight chords.
    let step = TAU / 224.0;
    let exact = parts.iter().sum::<f64>() * step.sin() / step;
    assert!((volume / exact - 1.0).abs() < 1e-11, "{volume} m³ instead of {exact} m³");
}

fn coarse() -> StageCasingOptions {
    StageCasingOptions {
        around: 28,
        contact: [14, 2],
        fixed_interface_modes: 60,
        modes: 40,
        checked_modes: 8,
        patches: [14, 1],
        ..StageCasingOptions::default()
    }
}

#[test]
fn the_reduced_casing_has_its_modes() {
    let reduction = reduce_stage_casing(&coarse(), &silent).unwrap();
    assert_eq!((reduction.nodes, reduction.free_dofs), (307 * 28, 3 * (307 - 13) * 28));
    let checks = &reduction.rom.checks;
    println!("{checks:?}");
    for (full, deviation) in checks.full_frequencies.iter().zip(&checks.frequency_deviation) {
        assert!((-1e-6..0.5).contains(deviation), "{full} Hz: {deviation} %");
    }
    assert!(checks.residual_criterion.iter().all(|criterion| *criterion < 1.0), "{:?}", checks.residual_criterion);
    let thermal = reduction.rom.extras.thermal.as_ref().unwrap();
    assert_eq!(thermal.loads.ncols(), 14);
    assert!(reduction.rom.origin.contains("hex8 with incompatible modes"), "{}", reduction.rom.origin);
}

#[test]
fn rejects_invalid_element_and_contact_counts() {
    let refusal = |options: StageCasingOptions| stage_casing_mesh(&options).err().unwrap().to_string();
    let default = StageCasingOptions::default;
    assert!(
        refusal(StageCasingOptions { contact: [30, 3], ..default() }).contains("224 bricks around are not a multiple")
    );
    assert!(refusal(StageCasingOptions { contact: [28, 6], ..default() }).contains("28 around and 6 along"));
    assert!(refusal(StageCasingOptions { contact: [2, 3], ..default() }).contains("2 around and 3 along"));
    assert!(refusal(StageCasingOptions { kind: ElementKind::Tet4, ..default() }).contains("C3D4 is neither"));
}
