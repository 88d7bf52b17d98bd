//! Eqs 12 and 13 over all nodal diameters: the checks of the ROM, and their convergence with the number of modes.

use tiprub_core::scene::rom::RomChecks;

use super::component::Component;
use super::{ConvergenceRow, NodalDiameter};
use crate::Result;

/// Number of modes of the whole disk whose convergence is computed (figs 9 and 10 of the paper).
pub const WHEEL_MODES: usize = 56;

/// Returns eq. 13 (%). A rigid-body mode has no relative deviation.
pub(super) fn deviation(full: f64, reduced: f64) -> f64 {
    if full > 0.0 { (reduced - full) / full * 100.0 } else { 0.0 }
}

/// Merges the checks of all nodal diameters, by ascending frequency.
pub(super) fn merged(diameters: &[NodalDiameter]) -> RomChecks {
    let list = diameters.iter().flat_map(|one| {
        let number = u32::try_from(one.number).expect("the number of sectors fits into 32 bits");
        (0..one.full_frequencies.len()).map(move |k| {
            let values = [
                one.full_frequencies[k],
                one.reduced_frequencies[k],
                one.frequency_deviation[k],
                one.residual_criterion[k],
            ];
            (number, values)
        })
    });
    sorted_checks(list.collect())
}

/// One of the lowest modes of the disk: its nodal diameter and its index there.
#[derive(Debug, Clone, Copy)]
struct DiskMode {
    square: f64,
    nodal_diameter: usize,
    place: usize,
}

/// Lists the lowest modes of the disk, double modes twice. The list ends at the lowest of the last computed modes of
/// all nodal diameters, since it would be incomplete above.
fn disk_modes(full: &[&[f64]], sectors: usize) -> Vec<DiskMode> {
    let ceiling =
        full.iter().map(|list| list.last().copied().unwrap_or(f64::NEG_INFINITY)).fold(f64::INFINITY, f64::min);
    let mut modes: Vec<DiskMode> = Vec::new();
    for (nodal_diameter, list) in full.iter().enumerate() {
        let copies = if nodal_diameter == 0 || 2 * nodal_diameter == sectors { 1 } else { 2 };
        for (place, &square) in list.iter().enumerate().filter(|&(_, &square)| square <= ceiling) {
            modes.extend(core::iter::repeat_n(DiskMode { square, nodal_diameter, place }, copies));
        }
    }
    modes.sort_by(|a, b| a.square.total_cmp(&b.square).then(a.nodal_diameter.cmp(&b.nodal_diameter)));
    modes.truncate(WHEEL_MODES);
    modes
}

/// Computes eqs 12 and 13 of the lowest modes of the disk for 0, 1, 2 ... fixed-interface modes per nodal diameter.
pub(super) fn convergence(components: &[&Component], full: &[&[f64]], sectors: usize) -> Result<Vec<ConvergenceRow>> {
    let modes = disk_modes(full, sectors);
    let most = components.iter().map(|component| component.squares.len()).min().unwrap_or(0);
    let hertz = |square: f64| square.max(0.0).sqrt() / core::f64::consts::TAU;
    let row = |count: usize| {
        let needed = |n: usize| modes.iter().filter(|mode| mode.nodal_diameter == n).map(|mode| mode.place + 1).max();
        let qualities: Result<Vec<_>> = components
            .iter()
            .enumerate()
            .map(|(n, component)| component.quality(count, needed(n).unwrap_or(0)))
            .collect();
        let qualities = qualities?;
        let (mut frequency_deviation, mut residual_criterion) = (Vec::new(), Vec::new());
        for mode in &modes {
            let quality = &qualities[mode.nodal_diameter];
            // A mode that the reduced model has no coordinate for has an infinite deviation.
            let square = quality.squares.get(mode.place).copied().unwrap_or(f64::INFINITY);
            frequency_deviation.push(deviation(hertz(mode.square), hertz(square)));
            residual_criterion.push(quality.residual_criterion.get(mode.place).copied().unwrap_or(f64::INFINITY));
        }
        Ok(ConvergenceRow { modes: count, total_modes: count * sectors, frequency_deviation, residual_criterion })
    };
    (0..=most).map(row).collect()
}

/// Returns the checks of all nodal diameters in one list, by ascending frequency.
fn sorted_checks(list: Vec<(u32, [f64; 4])>) -> RomChecks {
    let mut list = list;
    list.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]).then(a.0.cmp(&b.0)));
    let column = |i: usize| list.iter().map(|entry| entry.1[i]).collect();
    RomChecks {
        full_frequencies: column(0),
        reduced_frequencies: column(1),
        frequency_deviation: column(2),
        residual_criterion: column(3),
        nodal_diameters: list.iter().map(|entry| entry.0).collect(),
        ..RomChecks::default()
    }
}
