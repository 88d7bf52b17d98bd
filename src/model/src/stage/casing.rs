//! Casing of the stage in the size of the paper (section 6.1): 68,768 nodes, 44,800 bricks, 206,304 degrees of
//! freedom.
//!
//! The mesh has 224 bricks around and a meridional section of 200 quadrilaterals with 307 nodes: a cylindrical wall
//! over the blades, two cells thick and 72 long; a flange of 2 × 12 cells at either end; two hooks of 1 × 4 cells
//! that carry the liner of the blade track. Both numbers determine the perimeter: a section of Q quadrilaterals
//! without holes has 1 + Q + B/2 nodes, so that B = 212 edges lie on its border. The casing is clamped at the face of
//! its low flange.

use core::f64::consts::TAU;
use std::collections::BTreeMap;

use super::{GAP, TIP_AXIAL, TIP_RADIUS};
use crate::casing::{CLAMPED, CasingReductionOptions, GridNodes, RingMesh, reduce_casing};
use crate::element::{ElementKind, Formulation};
use crate::material::Material;
use crate::mesh::{Element, Mesh};
use crate::progress::{Listener, ReductionStage, report};
use crate::reduce::Reduction;
use crate::thermal::equal_patches;
use crate::{Error, Result};

/// Axial ends of the casing (m).
const AXIAL: [f64; 2] = [-0.060, 0.060];
/// Axial distance of the outer contact rings from the blade tip (m).
const BEYOND: f64 = 4e-3;
/// Thickness of the wall (m).
const WALL: f64 = 5e-3;
/// Length of a flange along the axis (m).
const FLANGE: f64 = 5e-3;
/// Radial height of a flange over the wall (m).
const FLANGE_HEIGHT: f64 = 30e-3;
/// Radial height of a hook (m).
const HOOK_HEIGHT: f64 = 10e-3;
/// Cells through the wall, and along a flange.
const THROUGH: usize = 2;
/// Cells along the wall: low flange, to the low contact ring, between the outer rings, from the high ring on, high
/// flange.
const ALONG: [usize; 5] = [2, 22, 24, 22, 2];
/// Cells along the height of a flange and of a hook.
const HEIGHTS: [usize; 2] = [12, 4];
/// Axial cells of the two hooks: just outside the contact rings.
const HOOKS: [usize; 2] = [22, 49];
/// Number of nodes in the section of linear bricks.
#[cfg(test)]
const SECTION_NODES: usize = 307;

/// Options of the casing.
#[derive(Debug, Clone, PartialEq)]
pub struct StageCasingOptions {
    /// Name of the structure.
    pub name: String,
    /// Bricks around; a multiple of the contact nodes around.
    pub around: usize,
    /// Hex8 or hex20.
    pub kind: ElementKind,
    /// Formulation of hex8.
    pub formulation: Formulation,
    /// Material.
    pub material: Material,
    /// Contact nodes around, and number of rings along the axis: 2, 3, 4 or 5, evenly spaced from 4 mm before the
    /// blade tip to 4 mm behind it.
    pub contact: [usize; 2],
    /// Thermal patches around and along; no patches if either is zero.
    pub patches: [usize; 2],
    /// Number of fixed-interface modes, see [`CasingReductionOptions`].
    pub fixed_interface_modes: usize,
    /// Number of modes that are kept unchanged, see [`CasingReductionOptions`].
    pub modes: usize,
    /// Number of modes compared with the full model.
    pub checked_modes: usize,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
}

impl Default for StageCasingOptions {
    /// Returns titanium with the damping of the casing of the paper and 28 × 3 contact nodes, that is 14 around for
    /// each wave of an ovalised casing.
    fn default() -> Self {
        Self {
            name: "stage-casing".into(),
            around: 224,
            kind: ElementKind::Hex8,
            formulation: Formulation::IncompatibleModes,
            material: Material::titanium(),
            contact: [28, 3],
            patches: [0, 0],
            fixed_interface_modes: 160,
            modes: 60,
            checked_modes: 20,
            damping_ratio: 0.03,
        }
    }
}

/// Builds the mesh and the contact nodes; node sets `inner`, `flange` (face of the low flange) and [`CLAMPED`], which
/// equals `flange`.
///
/// # Errors
/// [`Error::Invalid`] for inconsistent counts.
pub fn stage_casing_mesh(options: &StageCasingOptions) -> Result<RingMesh> {
    check(options)?;
    let section = MeridionalSection::new();
    let mut mesh = Mesh::default();
    let mut numbers = BTreeMap::new();
    // Slice by slice, which gives some solvers a small bandwidth.
    for (slice, &[along, layer]) in (0..options.around).flat_map(|slice| section.cells.iter().map(move |c| (slice, c)))
    {
        let place = |natural: &[f64; 3]| {
            let station = |cell: usize, x: f64| 2 * cell + if x < 0.0 { 0 } else { 1 + usize::from(x > 0.0) };
            let around = station(slice, natural[1]) % (2 * options.around);
            [around, station(along, natural[2]), station(layer, natural[0])]
        };
        let mut nodes = Vec::with_capacity(options.kind.node_count());
        for natural in options.kind.natural_nodes() {
            let next = numbers.len();
            let number = *numbers.entry(place(natural)).or_insert(next);
            if number == next {
                mesh.nodes.push(section.position(place(natural), options.around));
            }
            nodes.push(number);
        }
        mesh.elements.push(Element { kind: options.kind, nodes });
    }
    let set = |inside: &dyn Fn([usize; 3]) -> bool| -> Vec<usize> {
        let mut nodes: Vec<usize> = numbers.iter().filter(|(p, _)| inside(**p)).map(|(_, node)| *node).collect();
        nodes.sort_unstable();
        nodes
    };
    let flange = set(&|[_, along, layer]| along == 0 && layer >= 2 * THROUGH);
    mesh.sets.insert("inner".into(), set(&|[_, _, layer]| layer == 0));
    mesh.sets.insert(CLAMPED.into(), flange.clone());
    mesh.sets.insert("flange".into(), flange);
    let [around, along] = options.contact;
    let step = 2 * options.around / around;
    let (low, between) = (2 * (ALONG[0] + ALONG[1]), 2 * ALONG[2] / (along - 1));
    let places = (0..along).flat_map(|k| (0..around).map(move |i| [step * i, low + between * k, 0]));
    let nodes = places.map(|place| numbers[&place]).collect();
    let grid = GridNodes { around, nodes, slopes: vec![0.0; along], points: Vec::new() };
    Ok(RingMesh { mesh, grid })
}

/// Builds, reduces and checks the casing of the stage.
///
/// # Errors
/// The errors of [`stage_casing_mesh`] and [`reduce_casing`].
pub fn reduce_stage_casing(options: &StageCasingOptions, listener: Listener<'_>) -> Result<Reduction> {
    report(listener, ReductionStage::Mesh, 0, 1);
    let ring = stage_casing_mesh(options)?;
    let clamped = ring.mesh.set(CLAMPED)?.to_vec();
    let [around, along] = options.patches;
    let patches = equal_patches(around, along, AXIAL);
    report(listener, ReductionStage::Mesh, 1, 1);
    let reduction_options = CasingReductionOptions {
        name: options.name.clone(),
        formulation: options.formulation,
        fixed_interface_modes: options.fixed_interface_modes,
        modes: options.modes,
        checked_modes: options.checked_modes,
        damping_ratio: options.damping_ratio,
    };
    let mut reduction =
        reduce_casing(ring.mesh, &options.material, &clamped, &ring.grid, &patches, &reduction_options, listener)?;
    reduction.rom.origin = format!(
        "Casing of the 56-blade stage: cylindrical wall of {:.1} mm inner radius and {:.1} mm thickness, z = {:.0} to {:.0} \
         mm, flanges of {:.0} mm x {:.0} mm, two hooks, held at the face of the flange at the lower z: {}",
        1e3 * (TIP_RADIUS + GAP),
        1e3 * WALL,
        1e3 * AXIAL[0],
        1e3 * AXIAL[1],
        1e3 * FLANGE,
        1e3 * FLANGE_HEIGHT,
        reduction.rom.origin
    );
    Ok(reduction)
}

fn check(options: &StageCasingOptions) -> Result<()> {
    let StageCasingOptions { around, kind, contact, .. } = *options;
    if !matches!(kind, ElementKind::Hex8 | ElementKind::Hex20) {
        let problem = format!("{} is neither hex8 nor hex20", kind.calculix_name());
        return Err(Error::invalid("casing of the stage, element kind", problem, "Choose hex8"));
    }
    if contact[0] < 4 || !(2..=5).contains(&contact[1]) {
        let problem = format!("{} around and {} along are not supported", contact[0], contact[1]);
        let remedy = "Give at least 4 around, and 2 to 5 along";
        return Err(Error::invalid("casing of the stage, contact nodes", problem, remedy));
    }
    if around == 0 || !around.is_multiple_of(contact[0]) {
        let problem = format!("{around} bricks around are not a multiple of the {} contact nodes around", contact[0]);
        let remedy = "Use 28, 32, 56 or 112 contact nodes with 224 bricks, or another number of bricks";
        return Err(Error::invalid("casing of the stage, contact nodes", problem, remedy));
    }
    Ok(())
}

/// Meridional section.
struct MeridionalSection {
    /// (axial, radial) index of every cell.
    cells: Vec<[usize; 2]>,
    /// Axial positions (m), two per cell.
    axial: Vec<f64>,
    /// Radial offsets of flange and hook stations from the inner radius (m), two per cell.
    radial: [Vec<f64>; 2],
}

impl MeridionalSection {
    fn new() -> Self {
        let [low, high] = [TIP_AXIAL[0] - BEYOND, TIP_AXIAL[1] + BEYOND];
        let ends = [AXIAL[0] + FLANGE, low, high, AXIAL[1] - FLANGE, AXIAL[1]];
        let mut axial = vec![AXIAL[0]];
        ends.iter().zip(ALONG).for_each(|(&end, cells)| divide(&mut axial, end, 2 * cells));
        let radial = [(FLANGE_HEIGHT, HEIGHTS[0]), (HOOK_HEIGHT, HEIGHTS[1])].map(|(height, cells)| {
            let mut offsets = vec![0.0];
            divide(&mut offsets, WALL, 2 * THROUGH);
            divide(&mut offsets, WALL + height, 2 * cells);
            offsets
        });
        let length: usize = ALONG.iter().sum();
        let layers = |along: usize| {
            let outside = match along {
                _ if along < ALONG[0] || along >= length - ALONG[4] => HEIGHTS[0],
                _ if HOOKS.contains(&along) => HEIGHTS[1],
                _ => 0,
            };
            THROUGH + outside
        };
        let cells = (0..length).flat_map(|along| (0..layers(along)).map(move |layer| [along, layer])).collect();
        Self { cells, axial, radial }
    }

    /// Returns the position of the station (around, along, radial), with two stations per cell in each direction.
    fn position(&self, [around, along, layer]: [usize; 3], cells_around: usize) -> [f64; 3] {
        // Hooks are on the wall, away from the flanges.
        let hooked = HOOKS.iter().any(|&hook| (2 * hook..=2 * hook + 2).contains(&along));
        let radius = TIP_RADIUS + GAP + self.radial[usize::from(hooked)][layer];
        let angle = TAU * around as f64 / (2 * cells_around) as f64;
        [radius * angle.cos(), radius * angle.sin(), self.axial[along]]
    }
}

/// Appends `count` even divisions up to `end`.
fn divide(stations: &mut Vec<f64>, end: f64, count: usize) {
    let start = stations[stations.len() - 1];
    stations
        .extend((1..=count).map(|i| if i == count { end } else { start + (end - start) * i as f64 / count as f64 }));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn section_has_the_element_and_node_counts_of_the_paper() {
        let section = MeridionalSection::new();
        let mut corners: Vec<[usize; 2]> =
            section.cells.iter().flat_map(|&[i, j]| [[i, j], [i + 1, j], [i, j + 1], [i + 1, j + 1]]).collect();
        corners.sort_unstable();
        corners.dedup();
        assert_eq!((section.cells.len(), corners.len()), (200, SECTION_NODES));
        // 224 around gives the numbers that the paper states for its casing.
        assert_eq!((200 * 224, SECTION_NODES * 224, 3 * SECTION_NODES * 224), (44_800, 68_768, 206_304));
    }
}
