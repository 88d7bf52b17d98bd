//! Limit of a sequence of refinements by Richardson extrapolation with the observed order.
//!
//! The remaining error at a size h (a step, the length of an edge or a patch, the inverse of a number of modes) is C hᵖ. Three levels determine C, p
//! and the limit. The order is limited to [`MOST`], because a sequence that once falls faster does not predict the next level. If the order is below
//! [`LEAST`], or the values oscillate, there is no extrapolation.

/// Largest order; larger observed orders are reduced to it.
pub const MOST: f64 = 2.0;
/// Smallest order that is accepted.
pub const LEAST: f64 = 0.5;
/// Smallest order for three meshes. Displacements of rubs of rotor 37 converge with orders from 1.7 to 2 on sufficiently fine meshes; changes
/// between coarse meshes decrease more slowly at first, so that they would overestimate the error (`lab estimates`).
pub const LEAST_OF_MESHES: f64 = 1.5;
/// Order that is assumed if there are only two meshes.
const OF_TWO_MESHES: f64 = 1.75;
/// Ratios between the sizes of levels that are extrapolated together, in order of preference.
const SPREAD: [f64; 3] = [1.9, 1.35, 1.0];
/// Changes below this fraction of a value are rounding.
const ROUNDING: f64 = 1e-12;

/// Extrapolation from three levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvergedLimit {
    /// Observed order, from [`LEAST`] to [`MOST`].
    pub order: f64,
    /// Remaining change of the value by further refinement, estimated at the finest level.
    pub rest: f64,
}

/// Extrapolates a value from its two `changes` between three levels with decreasing `sizes`; the order is at least `least`. Returns `None` if the
/// changes show no convergence.
pub fn of_changes(sizes: [f64; 3], changes: [f64; 2], least: f64) -> Option<ConvergedLimit> {
    let [before, last] = changes;
    if before == 0.0 && last == 0.0 {
        return Some(ConvergedLimit { order: MOST, rest: 0.0 });
    }
    let ratio = before / last;
    if !(ratio.is_finite() && ratio >= falls(sizes, LEAST)) {
        return None;
    }
    let order = order(sizes, ratio).max(least);
    let [_, middle, fine] = sizes.map(|size| size.powf(order));
    Some(ConvergedLimit { order, rest: last * fine / (middle - fine) })
}

/// Extrapolates from the values of three levels; changes within rounding count as zero.
pub fn of_values(sizes: [f64; 3], values: [f64; 3]) -> Option<ConvergedLimit> {
    let least = ROUNDING * values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let change = |from: f64, to: f64| if (to - from).abs() <= least { 0.0 } else { to - from };
    of_changes(sizes, [change(values[0], values[1]), change(values[1], values[2])], LEAST)
}

/// Extrapolates from two meshes, the first of them coarser than the second.
pub fn of_two_meshes([coarse, fine]: [f64; 2], change: f64) -> ConvergedLimit {
    let [coarse, fine] = [coarse, fine].map(|size| size.powf(OF_TWO_MESHES));
    ConvergedLimit { order: OF_TWO_MESHES, rest: change * fine / (coarse - fine) }
}

/// Chooses the finest of levels with decreasing sizes, and two coarser ones far enough apart to determine an order; fewer if there are not enough
/// levels.
pub fn chosen(sizes: &[f64]) -> Vec<usize> {
    let far = |spread: f64| {
        let mut found: Vec<usize> = Vec::new();
        for index in (0..sizes.len()).rev() {
            let last = found.last().map(|last| sizes[*last]);
            if found.len() < 3 && last.is_none_or(|last| sizes[index] >= spread * last) {
                found.push(index);
            }
        }
        found.reverse();
        found
    };
    let all = SPREAD.map(far);
    all.iter().find(|found| found.len() == 3).or(all.last()).cloned().unwrap_or_default()
}

/// Returns the ratio of consecutive changes for an order of convergence.
fn falls([coarse, middle, fine]: [f64; 3], order: f64) -> f64 {
    let [coarse, middle, fine] = [coarse, middle, fine].map(|size| size.powf(order));
    (coarse - middle) / (middle - fine)
}

/// Returns the order for a ratio of consecutive changes; it increases with the ratio.
fn order(sizes: [f64; 3], ratio: f64) -> f64 {
    let (mut low, mut high) = (LEAST, MOST);
    if ratio >= falls(sizes, high) {
        return high;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if falls(sizes, middle) < ratio { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Extrapolates 7 + 3 hᵖ at unevenly decreasing sizes to 7.
    #[test]
    fn convergence_order_is_found_from_any_three_sizes() {
        for power in [0.6, 1.0, 1.7, 2.0_f64] {
            for sizes in [[4.0, 2.0, 1.0], [3.0, 2.0, 0.5], [1.0, 0.9, 0.7]] {
                let values = sizes.map(|size: f64| 7.0 + 3.0 * size.powf(power));
                let found = of_values(sizes, values).unwrap();
                assert!((found.order - power).abs() < 1e-6, "{power} {sizes:?}: {found:?}");
                assert!((values[2] + found.rest - 7.0).abs() < 1e-6, "{power} {sizes:?}: {found:?}");
            }
        }
    }

    #[test]
    fn selected_refinement_levels_are_well_separated() {
        let of_modes = [20.0, 40.0, 60.0, 80.0, 120.0, 160.0_f64].map(|modes| 1.0 / modes);
        assert_eq!(chosen(&of_modes), [1, 3, 5]);
        assert_eq!(chosen(&of_modes[3..]), [0, 1, 2]);
        assert_eq!(chosen(&[2.0, 1.41, 1.0, 0.71]), [1, 2, 3]);
        assert_eq!(chosen(&[2.0, 1.0]), [0, 1]);
        assert!(chosen(&[]).is_empty());
        // For orders from one to two, the error is within a factor of three, with two meshes and with three.
        for order in [1.0, 2.0_f64] {
            for coarse in [1.414, 2.0_f64] {
                let truth = 1.0 / (coarse.powf(order) - 1.0);
                let two = of_two_meshes([coarse, 1.0], 1.0).rest;
                let three = of_changes([coarse * coarse, coarse, 1.0], [coarse.powf(order), 1.0], LEAST_OF_MESHES);
                for found in [two, three.unwrap().rest] {
                    assert!(found < 3.0 * truth && truth < 3.0 * found, "{order} {coarse}: {found} {truth}");
                }
            }
        }
    }

    #[test]
    fn limits_orders_to_two_and_requires_decreasing_changes() {
        let sizes = [4.0, 2.0, 1.0];
        let fast = of_changes(sizes, [100.0, 1.0], LEAST).unwrap();
        assert_eq!((fast.order, fast.rest), (MOST, 1.0 / 3.0));
        for changes in [[1.0, 1.0], [1.0, 1.2], [-1.0, 0.2], [0.0, 1.0], [1.0, 0.0], [f64::NAN, 1.0]] {
            assert_eq!(of_changes(sizes, changes, LEAST), None, "{changes:?}");
        }
        let still = ConvergedLimit { order: MOST, rest: 0.0 };
        assert_eq!([of_changes(sizes, [0.0; 2], LEAST), of_values(sizes, [5.0, 5.0, 5.0 + 1e-14])], [Some(still); 2]);
    }
}
