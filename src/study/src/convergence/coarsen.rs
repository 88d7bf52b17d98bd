//! A ROM with about half of its contact patches: hat functions over twice the length are sums of those over one, so that a ROM
//! tells what coarser patches would do.

use nalgebra::{ComplexField, DMatrix};
use tiprub_core::{
    Rom,
    rom::{ContactNode, Frame, Harmonic},
};

/// The ROM with every other patch, each with half of its two neighbours.
///
/// # Errors
/// Why there is none: contact nodes, or a number of patches that is not 3, 5, 7, ...
pub fn coarsened(rom: &Rom) -> Result<Rom, String> {
    let patches = &rom.contact_nodes;
    if patches.iter().any(|patch| patch.area <= 0.0) {
        return Err("contact is at nodes, of which no coarser ones follow".into());
    }
    if patches.len() < 3 || patches.len().is_multiple_of(2) {
        return Err(format!("{} patches have no half: 3, 5, 7, ... do", patches.len()));
    }
    let kept = patches.len().div_ceil(2);
    let areas: Vec<f64> = patches.iter().map(|patch| patch.area).collect();
    let (shares, weights) = (shares(patches.len()), weights(&areas));
    let mut found = rom.clone();
    found.contact_map = mapped(&weights, &rom.contact_map);
    found.extras.harmonics = rom
        .extras
        .harmonics
        .iter()
        .map(|own| Harmonic { contact_map: mapped(&weights, &own.contact_map), ..own.clone() })
        .collect();
    found.contact_nodes = (0..kept).map(|row| patch(rom, row, &weights, &shares)).collect();
    found.origin = format!("{}; {kept} patches of its {}", rom.origin, patches.len());
    found.checks.flexibility_deviation.clear();
    found.checks.rub_errors = None;
    found.validate().map_err(|error| error.to_string())?;
    Ok(found)
}

/// Shares of patches in every other one, which has half of its two neighbours.
fn shares(patches: usize) -> DMatrix<f64> {
    DMatrix::from_fn(patches.div_ceil(2), patches, |row, column| match column.abs_diff(2 * row) {
        0 => 1.0,
        1 => 0.5,
        _ => 0.0,
    })
}

/// Displacements of every other patch of those with these areas (m²).
fn weights(areas: &[f64]) -> DMatrix<f64> {
    let mut weights = shares(areas.len());
    for mut row in weights.row_iter_mut() {
        let area: f64 = row.iter().zip(areas).map(|(share, area)| share * area).sum();
        row.iter_mut().zip(areas).for_each(|(weight, own)| *weight *= own / area);
    }
    weights
}

/// Patches that models with 3, 5, 9, 17, ... of them have in common.
pub(super) const COMMON: usize = 3;

/// Displacements of the [`COMMON`] patches from those of a tip; `None` of contact nodes and of other numbers of patches.
pub(super) fn common(patches: &[ContactNode]) -> Option<DMatrix<f64>> {
    let mut areas: Vec<f64> = patches.iter().map(|patch| patch.area).collect();
    if areas.iter().any(|area| *area <= 0.0) {
        return None;
    }
    let mut map = DMatrix::identity(areas.len(), areas.len());
    while areas.len() > COMMON && !areas.len().is_multiple_of(2) {
        map = weights(&areas) * map;
        let shares = shares(areas.len());
        areas = shares.row_iter().map(|row| row.iter().zip(&areas).map(|(share, area)| share * area).sum()).collect();
    }
    (areas.len() == COMMON).then_some(map)
}

/// Rows (patch, component) of the map of coarser patches.
fn mapped<T: ComplexField<RealField = f64>>(weights: &DMatrix<f64>, map: &DMatrix<T>) -> DMatrix<T> {
    DMatrix::from_fn(3 * weights.nrows(), map.ncols(), |row, column| {
        let of = |patch: usize| map[(3 * patch + row % 3, column)].clone().scale(weights[(row / 3, patch)]);
        (0..weights.ncols()).map(of).fold(T::zero(), |sum, one| sum + one)
    })
}

/// Where a coarser patch is: the mean of its parts.
fn patch(rom: &Rom, row: usize, weights: &DMatrix<f64>, shares: &DMatrix<f64>) -> ContactNode {
    let patches = &rom.contact_nodes;
    let middle = &patches[2 * row];
    let sum = |weights: &DMatrix<f64>, value: &dyn Fn(&ContactNode) -> f64| -> f64 {
        patches.iter().enumerate().map(|(index, patch)| weights[(row, index)] * value(patch)).sum()
    };
    let around = |patch: &ContactNode, axis: usize| {
        let off = patch.position[axis] - middle.position[axis];
        // Angles from the middle do not jump.
        if axis == 1 && rom.frame == Frame::Cylindrical { off.sin().atan2(off.cos()) } else { off }
    };
    ContactNode {
        position: std::array::from_fn(|axis| middle.position[axis] + sum(weights, &|patch| around(patch, axis))),
        meridional_slope: sum(weights, &|patch| patch.meridional_slope),
        area: sum(shares, &|patch| patch.area),
        length: sum(shares, &|patch| patch.length),
        ..middle.clone()
    }
}

#[cfg(test)]
mod tests {
    use tiprub_model::{
        Rotor37Options,
        reduce::ReductionKind,
        reduce_rotor37,
        rotor37::{MeshCounts, Tip},
    };

    use super::*;

    /// Hat functions are nested: patches of patches are the patches of half as many, where the mesh integrates both alike.
    #[test]
    fn patches_of_patches_are_those_of_the_reduction_with_half_as_many() {
        let of = |patches: usize| {
            let options = Rotor37Options {
                mesh: MeshCounts { chord: 8, thickness: 1, span: 4 },
                tip: Tip::Patches(patches),
                kind: ReductionKind::FreeInterface,
                modes: 6,
                ..Rotor37Options::paper()
            };
            reduce_rotor37(&options, &|_| {}).unwrap().rom
        };
        let (fine, coarse) = (of(9), of(5));
        let found = coarsened(&fine).unwrap();
        for (a, b) in found.contact_nodes.iter().zip(&coarse.contact_nodes) {
            let size = |x: f64, y: f64| (x / y - 1.0).abs();
            assert!(size(a.area, b.area) < 1e-2 && size(a.length, b.length) < 1e-12, "{a:?} {b:?}");
            assert!(size(a.position[0], b.position[0]) < 1e-4, "{a:?} {b:?}");
        }
        let flexibility = |rom: &Rom| {
            let inverse = rom.stiffness.clone().try_inverse().unwrap();
            &rom.contact_map * inverse * rom.contact_map.transpose()
        };
        let off = (flexibility(&found) - flexibility(&coarse)).amax() / flexibility(&coarse).amax();
        assert!(off < 5e-3, "{off:e}");
        assert!(coarsened(&of(2)).unwrap_err().contains("2 patches"));
        // What patches have in common is the same by one step or by two.
        let [of_fine, of_coarse] = [&fine, &found].map(|rom| common(&rom.contact_nodes).unwrap());
        let areas: Vec<f64> = fine.contact_nodes.iter().map(|patch| patch.area).collect();
        assert_eq!(of_fine.shape(), (COMMON, 9));
        assert!((&of_fine - of_coarse * weights(&areas)).amax() < 1e-14);
        assert!(of_fine.row_iter().all(|row| (row.sum() - 1.0).abs() < 1e-14));
        assert!(common(&fine.contact_nodes[..8]).is_none() && common(&fine.contact_nodes[..7]).is_none());
    }
}
