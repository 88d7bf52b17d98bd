//! Selection of fixed-interface modes: whole families, as far as frequencies distinguish them.
//!
//! A family of the blades (first bending, first torsion, ...) has nearly the same frequency at every nodal diameter.
//! If it is kept at some and omitted at others, the motion of one blade alone can no longer be composed from the
//! nodal diameters, and the reduced blades are coupled where the real ones are not. So the modes are cut at one
//! frequency for all nodal diameters, in a gap between families. A family of the disk rises steeply with the nodal
//! diameter and is kept where it lies below; the number of modes then differs between nodal diameters.
//!
//! More frequencies with the contact held are computed than the requested number η. The merged list of all nodal
//! diameters is complete up to the lowest of the highest computed ones. The candidates are the cuts between
//! neighbours in this list that keep η modes per nodal diameter on average, within a fifth. The widest relative gap
//! is chosen if it is at least [`SMALLEST_GAP`].

use super::ModeSelection;
use super::component::RequestedModes;

/// Relative gap below which frequencies do not distinguish families.
pub const SMALLEST_GAP: f64 = 0.005;

/// Numbers of modes that are kept, and notes for the user.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Choice {
    /// Number for every nodal diameter.
    pub counts: Vec<usize>,
    pub note: Option<String>,
}

/// Returns the modes that must be computed for a selection, of `available` modes.
pub(super) fn wanted(selection: ModeSelection, available: usize) -> RequestedModes {
    match selection {
        ModeSelection::Families(modes) => RequestedModes::Count((modes + (modes / 4).max(4)).min(available)),
        ModeSelection::Count(modes) => RequestedModes::Count(modes),
        ModeSelection::UpTo(frequency) => {
            let angular = core::f64::consts::TAU * frequency;
            RequestedModes::UpTo(angular * angular)
        }
    }
}

/// Chooses from the computed ω² of every nodal diameter, ascending.
pub(super) fn choose(selection: ModeSelection, squares: &[&[f64]]) -> Choice {
    match selection {
        ModeSelection::Count(modes) => Choice { counts: vec![modes; squares.len()], note: None },
        ModeSelection::UpTo(frequency) => {
            let angular = core::f64::consts::TAU * frequency;
            Choice { counts: below(squares, angular * angular), note: None }
        }
        ModeSelection::Families(modes) => whole_families(modes, squares),
    }
}

fn below(squares: &[&[f64]], limit: f64) -> Vec<usize> {
    squares.iter().map(|list| list.partition_point(|&square| square <= limit)).collect()
}

fn whole_families(modes: usize, squares: &[&[f64]]) -> Choice {
    let even = |note| Choice { counts: squares.iter().map(|list| modes.min(list.len())).collect(), note };
    if modes == 0 {
        return even(None);
    }
    let ceiling = squares.iter().filter_map(|list| list.last()).copied().fold(f64::INFINITY, f64::min);
    let mut all: Vec<f64> = squares.iter().flat_map(|list| list.iter()).copied().filter(|&s| s <= ceiling).collect();
    all.sort_by(f64::total_cmp);
    let spread = (modes / 5).max(1);
    let (least, most) = ((modes - spread).max(1) * squares.len(), (modes + spread) * squares.len());
    // A rigid-body motion does not form a family.
    let width = |cut: usize| -> f64 { if all[cut - 1] > 0.0 { 0.5 * (all[cut] / all[cut - 1]).ln() } else { 0.0 } };
    let off = |cut: usize| cut.abs_diff(modes * squares.len());
    let widest = (least.max(1)..=most.min(all.len().saturating_sub(1)))
        .max_by(|&a, &b| width(a).total_cmp(&width(b)).then(off(b).cmp(&off(a))));
    match widest {
        Some(cut) if width(cut) >= SMALLEST_GAP => {
            let limit = (all[cut] * all[cut - 1]).sqrt();
            let hertz = |square: f64| square.sqrt() / core::f64::consts::TAU;
            let note = format!(
                "modes truncated in the gap from {:.1} Hz to {:.1} Hz that all nodal diameters have in common",
                hertz(all[cut - 1]),
                hertz(all[cut])
            );
            Choice { counts: below(squares, limit), note: Some(note) }
        }
        _ => {
            let narrow = widest.map_or(0.0, width) * 100.0;
            even(Some(format!(
                "no frequency gap common to all nodal diameters near {modes} modes (the widest is {narrow:.2} %): the \
                 same number of modes is kept at every nodal diameter, so a mode family may be truncated at some"
            )))
        }
    }
}
