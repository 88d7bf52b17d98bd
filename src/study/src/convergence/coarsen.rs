//! Derives a ROM with about half of its contact patches: a hat function over twice the length is a sum of hat functions over the single length. Runs
//! with such a ROM show the effect of coarser patches.

use nalgebra::{ComplexField, DMatrix};
use tiprub_core::Rom;
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, Harmonic};

/// Returns the ROM with every other patch along the chord, each extended by half of both neighbours.
///
/// # Errors
/// The ROM has contact nodes, or its number of patches is not 3, 5, 7, ...
pub fn coarsened(rom: &Rom) -> Result<Rom, String> {
    let along = along(rom)?;
    if along < 3 || along.is_multiple_of(2) {
        return Err(format!(
            "{along} patches along the chord cannot be coarsened by dropping every other patch; the number must be odd and at least 3"
        ));
    }
    let shares = DMatrix::identity(rom.rows(), rom.rows()).kronecker(&shares(along));
    let kept = along.div_ceil(2);
    made(rom, &shares, rom.rows(), |row| (row / kept) * along + 2 * (row % kept), "")
}

/// Returns the ROM with fewer rows of patches across the thickness: one from any number, or two from three. If hat functions are sums of finer ones,
/// their duals are sums of the finer duals.
///
/// # Errors
/// The ROM has contact nodes or one row, or the requested rows are not sums of its rows.
pub fn fewer_rows(rom: &Rom, rows: usize) -> Result<Rom, String> {
    let along = along(rom)?;
    let shares = row_shares(rom.rows(), rows)
        .ok_or_else(|| format!("a model with {rows} rows of patches cannot be derived from one with {}", rom.rows()))?;
    let shares = shares.kronecker(&DMatrix::identity(along, along));
    made(rom, &shares, rows, |row| row, &format!(", {rows} across the thickness"))
}

/// Returns the number of patches along the chord.
fn along(rom: &Rom) -> Result<usize, String> {
    if rom.contact_nodes.iter().any(|patch| patch.area <= 0.0) {
        return Err("the ROM has contact nodes, which cannot be merged like contact patches".into());
    }
    Ok(rom.contact_nodes.len() / rom.rows())
}

/// Returns the weights of the rows in fewer rows, as integrals over the rows.
fn row_shares(own: usize, fewer: usize) -> Option<DMatrix<f64>> {
    match (own, fewer) {
        (2.., 1) => Some(DMatrix::from_element(1, own, 1.0)),
        // χ_k = Σ c_kl χ_l of three rows with c_kl = ∫ χ_k h_l / ∫ h_l; the duals of two rows are 2 − 3s and 3s − 1.
        (3, 2) => Some(DMatrix::from_row_slice(2, 3, &[1.5, 0.5, -0.5, -0.5, 0.5, 1.5])),
        _ => None,
    }
}

/// Builds the ROM with `rows` rows of merged patches; `middle` is the old patch from which a new one takes its name and place.
fn made(
    rom: &Rom,
    shares: &DMatrix<f64>,
    rows: usize,
    middle: impl Fn(usize) -> usize,
    note: &str,
) -> Result<Rom, String> {
    let areas: Vec<f64> = rom.contact_nodes.iter().map(|patch| patch.area).collect();
    let weights = weighted(shares, &areas);
    let kept = shares.nrows();
    let mut found = rom.clone();
    found.contact_map = mapped(&weights, &rom.contact_map);
    found.extras.harmonics = rom
        .extras
        .harmonics
        .iter()
        .map(|own| Harmonic { contact_map: mapped(&weights, &own.contact_map), ..own.clone() })
        .collect();
    found.contact_nodes = (0..kept).map(|row| patch(rom, (row, middle(row)), &weights, shares)).collect();
    let lengths = rows as f64 / rom.rows() as f64;
    found.contact_nodes.iter_mut().for_each(|patch| patch.length *= lengths);
    found.extras.rows = Some(rows).filter(|rows| *rows > 1);
    found.origin = format!("{}; coarsened from {} to {kept} patches{note}", rom.origin, areas.len());
    found.checks.flexibility_deviation.clear();
    found.checks.rub_errors = None;
    found.validate().map_err(|error| error.to_string())?;
    Ok(found)
}

/// Returns the weights of the patches in every other patch, which includes half of its two neighbours.
fn shares(patches: usize) -> DMatrix<f64> {
    DMatrix::from_fn(patches.div_ceil(2), patches, |row, column| match column.abs_diff(2 * row) {
        0 => 1.0,
        1 => 0.5,
        _ => 0.0,
    })
}

/// Returns the matrix that averages displacements over merged patches, weighted with these areas (m²).
fn weighted(shares: &DMatrix<f64>, areas: &[f64]) -> DMatrix<f64> {
    let mut weights = shares.clone();
    for mut row in weights.row_iter_mut() {
        let area: f64 = row.iter().zip(areas).map(|(share, area)| share * area).sum();
        row.iter_mut().zip(areas).for_each(|(weight, own)| *weight *= own / area);
    }
    weights
}

/// Number of patches that models with 3, 5, 9, 17, ... patches have in common.
pub(super) const COMMON: usize = 3;

/// Returns the map from the displacements of a tip to those of the [`COMMON`] patches over the whole thickness; `None` for contact nodes and for
/// other numbers of patches.
pub(super) fn common(patches: &[ContactNode], rows: usize) -> Option<DMatrix<f64>> {
    let mut areas: Vec<f64> = patches.iter().map(|patch| patch.area).collect();
    if areas.iter().any(|area| *area <= 0.0) {
        return None;
    }
    let sums = |shares: &DMatrix<f64>, areas: &[f64]| -> Vec<f64> {
        shares.row_iter().map(|row| row.iter().zip(areas).map(|(share, area)| share * area).sum()).collect()
    };
    let along = areas.len() / rows;
    let whole = DMatrix::from_element(1, rows, 1.0).kronecker(&DMatrix::identity(along, along));
    let mut map = weighted(&whole, &areas);
    areas = sums(&whole, &areas);
    while areas.len() > COMMON && !areas.len().is_multiple_of(2) {
        let shares = shares(areas.len());
        map = weighted(&shares, &areas) * map;
        areas = sums(&shares, &areas);
    }
    (areas.len() == COMMON).then_some(map)
}

/// Returns the rows (patch, component) of the contact map for merged patches.
fn mapped<T: ComplexField<RealField = f64>>(weights: &DMatrix<f64>, map: &DMatrix<T>) -> DMatrix<T> {
    DMatrix::from_fn(3 * weights.nrows(), map.ncols(), |row, column| {
        let of = |patch: usize| map[(3 * patch + row % 3, column)].clone().scale(weights[(row / 3, patch)]);
        (0..weights.ncols()).map(of).fold(T::zero(), |sum, one| sum + one)
    })
}

/// Returns a merged patch at the mean position of its parts.
fn patch(rom: &Rom, (row, middle): (usize, usize), weights: &DMatrix<f64>, shares: &DMatrix<f64>) -> ContactNode {
    let patches = &rom.contact_nodes;
    let middle = &patches[middle];
    let sum = |weights: &DMatrix<f64>, value: &dyn Fn(&ContactNode) -> f64| -> f64 {
        patches.iter().enumerate().map(|(index, patch)| weights[(row, index)] * value(patch)).sum()
    };
    let around = |patch: &ContactNode, axis: usize| {
        let off = patch.position[axis] - middle.position[axis];
        // Angles relative to the middle do not jump.
        if axis == 1 && rom.frame == DisplacementFrame::Cylindrical { off.sin().atan2(off.cos()) } else { off }
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
        rotor37::{MeshCounts, TipContact},
    };

    use super::*;

    /// Hat functions are nested: merged patches equal a reduction with half as many patches, if the mesh integrates both equally.
    #[test]
    fn merged_patches_equal_a_reduction_with_half_the_patches() {
        let of = |patches: usize| {
            let options = Rotor37Options {
                mesh: MeshCounts { chord: 8, thickness: 1, span: 4 },
                tip: TipContact::Patches(patches),
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
        // Merging in one step and in two steps gives the same common patches.
        let [of_fine, of_coarse] = [&fine, &found].map(|rom| common(&rom.contact_nodes, 1).unwrap());
        let areas: Vec<f64> = fine.contact_nodes.iter().map(|patch| patch.area).collect();
        assert_eq!(of_fine.shape(), (COMMON, 9));
        assert!((&of_fine - of_coarse * weighted(&shares(9), &areas)).amax() < 1e-14);
        assert!(of_fine.row_iter().all(|row| (row.sum() - 1.0).abs() < 1e-14));
        assert!(common(&fine.contact_nodes[..8], 1).is_none() && common(&fine.contact_nodes[..7], 1).is_none());
    }

    /// Duals of hat functions are nested across the thickness, and so are the hat functions along the chord within each row.
    #[test]
    fn merged_rows_equal_a_reduction_with_fewer_rows() {
        let of = |counts: [usize; 2]| {
            let options = Rotor37Options {
                mesh: MeshCounts { chord: 8, thickness: 2, span: 2 },
                tip: TipContact::patches(counts),
                kind: ReductionKind::FreeInterface,
                modes: 6,
                ..Rotor37Options::paper()
            };
            reduce_rotor37(&options, &|_| {}).unwrap().rom
        };
        let flexibility = |rom: &Rom| {
            let inverse = rom.stiffness.clone().try_inverse().unwrap();
            &rom.contact_map * inverse * rom.contact_map.transpose()
        };
        let three = of([5, 3]);
        let two = fewer_rows(&three, 2).unwrap();
        let one = fewer_rows(&two, 1).unwrap();
        assert_eq!(fewer_rows(&three, 1).unwrap().rows(), 1);
        for (found, expected) in [
            (&two, of([5, 2])),
            (&one, of([5, 1])),
            (&fewer_rows(&three, 1).unwrap(), of([5, 1])),
            (&coarsened(&two).unwrap(), of([3, 2])),
        ] {
            assert_eq!((found.rows(), found.contact_nodes.len()), (expected.rows(), expected.contact_nodes.len()));
            for (a, b) in found.contact_nodes.iter().zip(&expected.contact_nodes) {
                let off = (a.area / b.area - 1.0).abs().max((a.length / b.length - 1.0).abs());
                assert!(off < 1e-2 && (a.position[0] / b.position[0] - 1.0).abs() < 1e-4, "{a:?} {b:?}");
            }
            let off = (flexibility(found) - flexibility(&expected)).amax() / flexibility(&expected).amax();
            assert!(off < 1e-2, "{off:e}");
        }
        assert!(fewer_rows(&one, 1).is_err() && fewer_rows(&two, 3).unwrap_err().contains("a model with 3 rows"));
        let [of_three, of_one] = [&three, &one].map(|rom| common(&rom.contact_nodes, rom.rows()).unwrap());
        let sums = DMatrix::from_element(1, 3, 1.0).kronecker(&DMatrix::identity(5, 5));
        let areas: Vec<f64> = three.contact_nodes.iter().map(|patch| patch.area).collect();
        assert!((of_three - of_one * weighted(&sums, &areas)).amax() < 1e-14);
    }
}
