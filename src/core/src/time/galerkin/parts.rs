//! Search for the smallest gaps in parts of a step. Parts are halved until the smallest gap is accurate or not needed, or until the shortest
//! part is reached.

use super::basis::real;

/// Largest number of halvings of a step into parts.
pub(super) const MAX_HALVINGS: usize = 7;
/// Number of instants at which motion is stored: the ends of the step, and the middle of one part of each length.
pub(super) const STORED_TIMES: usize = MAX_HALVINGS + 2;
/// Nodes are followed if they may come closer between the points of a step than at them by more than this fraction of the tolerance.
pub(super) const FOLLOW_FRACTION: f64 = 0.1;
/// Largest interpolation error at which the minimum of a cubic is recorded, as a fraction of the tolerance. The shortest parts have no limit.
pub(super) const MINIMUM_FRACTION: f64 = 0.3;

/// Part of a step that is halved `halvings` times. `index` counts the parts from the start of the step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    pub halvings: usize,
    pub index: usize,
    /// Indices of the stored instants at both ends.
    pub ends: [usize; 2],
}

impl Part {
    /// The whole step. The motion at its ends is stored first.
    pub const WHOLE: Self = Self { halvings: 0, index: 0, ends: [0, 1] };

    /// Returns the length as a fraction of the step.
    #[inline(always)]
    pub fn length(&self) -> f64 {
        1.0 / real(1 << self.halvings)
    }

    /// Returns both ends as fractions of the step.
    #[inline(always)]
    pub fn span(&self) -> [f64; 2] {
        [self.index, self.index + 1].map(|end| real(end) * self.length())
    }

    /// Returns both halves. `middle` is the index of the stored instant between them.
    #[inline(always)]
    fn halves(&self, middle: usize) -> [Self; 2] {
        let half = |index: usize, ends: [usize; 2]| Self { halvings: self.halvings + 1, index, ends };
        [half(2 * self.index, [self.ends[0], middle]), half(2 * self.index + 1, [middle, self.ends[1]])]
    }
}

/// Search in parts of a step. The motion at the ends of the step must be stored.
pub(super) trait PartSearch {
    /// Returns a bound on the interpolation error (m) of displacements in a part after `halvings` halvings.
    fn interpolation_error(&mut self, halvings: usize) -> f64;

    /// Records the smallest gaps within a part if they are needed and accurate enough. Returns whether the part must be halved instead; always
    /// false after [`MAX_HALVINGS`] halvings. `error` bounds the interpolation error of the displacements (m).
    fn needs_halving(&mut self, part: Part, error: f64) -> bool;

    /// Finds the motion in the middle of a part, and stores it at the index `middle`.
    fn find_middle(&mut self, part: Part, middle: usize);
}

/// Halves parts, starting with the whole step, until no part needs to be halved.
#[inline(always)]
pub(super) fn search_parts(search: &mut impl PartSearch) {
    let mut errors = [f64::NAN; MAX_HALVINGS + 1];
    let mut parts = [Part::WHOLE; MAX_HALVINGS + 1];
    let mut count = 1;
    while count > 0 {
        count -= 1;
        let part = parts[count];
        if errors[part.halvings].is_nan() {
            errors[part.halvings] = search.interpolation_error(part.halvings);
        }
        if !search.needs_halving(part, errors[part.halvings]) {
            continue;
        }
        let middle = 2 + part.halvings;
        search.find_middle(part, middle);
        let [first, second] = part.halves(middle);
        (parts[count], parts[count + 1]) = (second, first);
        count += 2;
    }
}
