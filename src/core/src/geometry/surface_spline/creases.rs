//! Closest points at kinks of the surface: between facets, and at the seam of free ends.
//!
//! Between its creases the surface is a smooth sheet with its own closest point, which may lie on a crease.

use super::foot::{FootPoint, HeldBound, noise};
use super::{ClosestPoint, Ends, SurfaceSpline};
use crate::math::vector::Vector3;
use crate::scene::settings::Interpolation;

/// The eight neighbouring sheets.
const NEIGHBOURS: [[i8; 2]; 8] = [[-1, 0], [1, 0], [0, -1], [0, 1], [-1, -1], [1, -1], [-1, 1], [1, 1]];

impl SurfaceSpline {
    /// Returns the closest of the minima of this sheet and, near a crease, of the neighbouring sheets.
    ///
    /// A sheet across a crease at the distance b along this one can only contain a closer point if b < |r| tan(φ/2) for a fold of angle φ:
    /// b ≤ 2|r| covers folds up to 126°.
    pub(super) fn search_sheets(&self, x: Vector3, start: FootPoint) -> Option<FootPoint> {
        let rounding = self.rounding(x, &start);
        let mut best = start;
        // Every round lowers f, and a start on the opposite side has to cross half the facets.
        for _ in 0..self.around + self.along {
            let from = best;
            for sides in NEIGHBOURS {
                let Some(place) = self.across(&from, sides) else { continue };
                let candidate = self.descend(x, place)?;
                if candidate.half_square < best.half_square - noise(&best, rounding) {
                    best = candidate;
                }
            }
            if best.place == from.place {
                return Some(self.face_squarely(x, best));
            }
        }
        None
    }

    /// Returns the place across the creases on these sides, if they are near.
    fn across(&self, foot: &FootPoint, sides: [i8; 2]) -> Option<ClosestPoint> {
        let (room, [length_s, _, length_t]) = (self.room(foot.place), foot.metric());
        let ClosestPoint { patch: [p, q], s, t } = foot.place;
        let near = |side: i8, position: f64, [low, high]: [f64; 2], length: f64| {
            let distance = if side < 0 { position - low } else { high - position };
            side == 0 || distance * distance * length <= 8.0 * foot.half_square || distance <= 0.0
        };
        if !(near(sides[0], s, room[0], length_s) && near(sides[1], t, room[1], length_t)) {
            return None;
        }
        let last = p + 1 == self.columns();
        if self.ends == Ends::Open && ((sides[0] < 0 && p == 0) || (sides[0] > 0 && last)) {
            return None;
        }
        let (column, s) = match (sides[0], self.interpolation) {
            (0, _) => (p, s),
            (-1, Interpolation::Facets) => ((p + self.around - 1) % self.around, 1.0),
            (-1, Interpolation::Spline) => (self.around - 1, 1.0),
            (_, Interpolation::Facets) => ((p + 1) % self.around, 0.0),
            (_, Interpolation::Spline) => (0, 0.0),
        };
        let (ring, t) = match sides[1] {
            0 => (q, t),
            -1 if self.interpolation == Interpolation::Facets && q > 0 => (q - 1, 1.0),
            1 if self.interpolation == Interpolation::Facets && q + 2 < self.along => (q + 1, 0.0),
            _ => return None,
        };
        Some(ClosestPoint {
            patch: [column, ring],
            s,
            t: if sides[0] == 0 { t } else { t.clamp(room[1][0], room[1][1]) },
        })
    }

    /// Returns, for a point on a crease, the sheet whose normal is nearest to the direction of the node.
    fn face_squarely(&self, x: Vector3, foot: FootPoint) -> FootPoint {
        let mut best = foot;
        let squareness = |foot: &FootPoint| foot.residual.dot(&foot.normal()).abs();
        for sides in NEIGHBOURS {
            let stays = |axis: usize| {
                matches!((sides[axis], foot.held[axis]), (0, _) | (-1, HeldBound::Low) | (1, HeldBound::High))
            };
            if !(stays(0) && stays(1)) {
                continue;
            }
            let Some(place) = self.across(&foot, sides) else { continue };
            let held = std::array::from_fn(|axis| if sides[axis] == 0 { foot.held[axis] } else { HeldBound::No });
            let candidate = FootPoint { held, ..FootPoint::at(self, x, place) };
            if squareness(&candidate) > squareness(&best) {
                best = candidate;
            }
        }
        best
    }
}
