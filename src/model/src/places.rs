//! Positions of the nodes of a tip: in the meridional plane, along its chord and across it.

use nalgebra::{DMatrix, DVector};

/// Axial positions closer than this fraction of the extent of the set coincide.
const SAME_PLACE: f64 = 1e-3;
/// Axial extent, as a fraction of the radius, below which a set has no slope and is ordered around the axis.
const FLAT: f64 = 1e-6;

/// Nodes of a set in the meridional plane, and on the developed surface along the chord and across it.
pub(crate) struct Places {
    axial: Vec<f64>,
    radius: Vec<f64>,
    /// Positions along the chord, by ascending z (m).
    along: Vec<f64>,
    /// Positions across the chord (m).
    across: Vec<f64>,
    /// True if the set lies in one plane across the axis.
    flat: bool,
    /// Direction of the chord on the developed surface, z and rθ.
    chord: [f64; 2],
    /// Cosine and sine of the reference angle of rθ.
    middle: [f64; 2],
}

fn extent(values: &[f64]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &value| [low.min(value), high.max(value)])
}

/// Returns the unit vector (z, rθ) of the largest extent of points: main axis of their second moments.
fn chord_direction(axial: &[f64], arc: &[f64]) -> [f64; 2] {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (z, s) = (mean(axial), mean(arc));
    let moment =
        |a: &dyn Fn(usize) -> f64, b: &dyn Fn(usize) -> f64| (0..axial.len()).map(|i| a(i) * b(i)).sum::<f64>();
    let (to_z, to_s) = (|i: usize| axial[i] - z, |i: usize| arc[i] - s);
    let (zz, ss, zs) = (moment(&to_z, &to_z), moment(&to_s, &to_s), moment(&to_z, &to_s));
    let angle = 0.5 * (2.0 * zs).atan2(zz - ss);
    let (sin, cos) = angle.sin_cos();
    // Ascending z; for a chord around the axis, ascending angle.
    if cos < -1e-9 || (cos.abs() <= 1e-9 && sin < 0.0) { [-cos, -sin] } else { [cos, sin] }
}

/// Returns rθ of a point (m), with θ counted from the direction `middle`, a cosine and a sine.
fn arc_from([cos, sin]: [f64; 2], [x, y, _]: [f64; 3]) -> f64 {
    x.hypot(y) * (y * cos - x * sin).atan2(x * cos + y * sin)
}

impl Places {
    pub(crate) fn new(nodes: &[[f64; 3]], set: &[usize]) -> Self {
        let points: Vec<[f64; 3]> = set.iter().map(|&node| nodes[node]).collect();
        let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), point| (x + point[0], y + point[1]));
        let (sin, cos) = y.atan2(x).sin_cos();
        let middle = [cos, sin];
        let radius: Vec<f64> = points.iter().map(|point| point[0].hypot(point[1])).collect();
        let arc: Vec<f64> = points.iter().map(|point| arc_from(middle, *point)).collect();
        let axial: Vec<f64> = points.iter().map(|point| point[2]).collect();
        let [low, high] = extent(&axial);
        let flat = high - low <= FLAT * extent(&radius)[1].max(f64::MIN_POSITIVE);
        let chord = chord_direction(&axial, &arc);
        let [cz, cs] = chord;
        let along = axial.iter().zip(&arc).map(|(z, s)| cz * z + cs * s).collect();
        let across = axial.iter().zip(&arc).map(|(z, s)| cz * s - cs * z).collect();
        Self { axial, radius, along, across, flat, chord, middle }
    }

    /// Returns the distance of the outermost nodes along the chord (m).
    pub(crate) fn chord_length(&self) -> f64 {
        let [low, high] = extent(&self.along);
        high - low
    }

    /// Returns the position of a point along the chord of the set, 0 to 1 between its ends.
    pub(crate) fn share_along(&self, point: [f64; 3]) -> f64 {
        let [low, high] = extent(&self.along);
        let [cz, cs] = self.chord;
        (cz * point[2] + cs * arc_from(self.middle, point) - low) / (high - low)
    }

    /// Returns the position of a point along the chord of the set and across it (m).
    pub(crate) fn developed(&self, point: [f64; 3]) -> [f64; 2] {
        let ([cz, cs], arc) = (self.chord, arc_from(self.middle, point));
        [cz * point[2] + cs * arc, cz * arc - cs * point[2]]
    }

    /// Returns the length of the chord (m).
    pub(crate) fn length(&self) -> f64 {
        let [low, high] = extent(&self.along);
        high - low
    }

    /// Returns the number of different positions along the chord.
    pub(crate) fn stations(&self) -> usize {
        let mut along = self.along.clone();
        along.sort_by(f64::total_cmp);
        let [low, high] = extent(&along);
        1 + along.windows(2).filter(|pair| pair[1] - pair[0] > SAME_PLACE * (high - low)).count()
    }

    /// Returns positions in the set by ascending z, as evenly along the chord as its nodes allow, in the middle of
    /// the thickness.
    pub(crate) fn evenly(&self, count: usize) -> Vec<usize> {
        let all = self.axial.len();
        let mut chosen: Vec<usize> = if count == all { (0..all).collect() } else { Vec::with_capacity(count) };
        let [low, high] = extent(&self.along);
        let mut free = vec![true; all];
        for index in chosen.len()..count {
            let share = if count == 1 { 0.5 } else { index as f64 / (count - 1) as f64 };
            let target = low + share * (high - low);
            let middle = self.middle_at(target);
            let distance = |&place: &usize| (self.along[place] - target).hypot(self.across[place] - middle);
            let nearest = (0..all).filter(|&place| free[place]).min_by(|a, b| distance(a).total_cmp(&distance(b)));
            if let Some(place) = nearest {
                free[place] = false;
                chosen.push(place);
            }
        }
        let by_axis = |a: &usize, b: &usize| self.axial[*a].total_cmp(&self.axial[*b]);
        let by_chord = |a: &usize, b: &usize| self.along[*a].total_cmp(&self.along[*b]);
        chosen.sort_by(|a, b| if self.flat { by_chord(a, b) } else { by_axis(a, b).then(by_chord(a, b)) });
        chosen
    }

    /// Returns the middle of the thickness at a position along the chord: halfway between the outermost of the
    /// nearest nodes.
    fn middle_at(&self, target: f64) -> f64 {
        let mut nearest: Vec<usize> = (0..self.along.len()).collect();
        nearest.sort_by(|&a, &b| (self.along[a] - target).abs().total_cmp(&(self.along[b] - target).abs()));
        // Uses all adjacent nodes; otherwise the middle of three would be that of two.
        let [first, last] = extent(&self.along);
        let away = |place: usize| (self.along[place] - target).abs();
        let least = nearest[(self.along.len() / 10).max(2).min(nearest.len()) - 1];
        let reach = away(least) + SAME_PLACE * (last - first);
        nearest.retain(|&place| away(place) <= reach);
        let [low, high] = extent(&nearest.iter().map(|&place| self.across[place]).collect::<Vec<_>>());
        0.5 * (low + high)
    }

    /// Returns dr/dz at a node: parabola through the nearest third of the axial positions (at least three), by least
    /// squares.
    pub(crate) fn slope(&self, place: usize) -> f64 {
        let mut levels = self.levels();
        let here = self.axial[place];
        levels.sort_by(|a, b| (a.0 - here).abs().total_cmp(&(b.0 - here).abs()));
        levels.truncate((levels.len() / 3).max(3));
        let terms = levels.len().min(3);
        if terms < 2 {
            return 0.0;
        }
        let reach = levels.iter().map(|level| (level.0 - here).abs()).fold(0.0, f64::max);
        let powers = DMatrix::from_fn(levels.len(), terms, |i, j| {
            let local = (levels[i].0 - here) / reach;
            [1.0, local, local * local][j]
        });
        let radii = DVector::from_iterator(levels.len(), levels.iter().map(|level| level.1));
        powers.svd(true, true).solve(&radii, 1e-12).map_or(0.0, |coefficients| coefficients[1] / reach)
    }

    /// Returns the different axial positions with the mean radius there.
    fn levels(&self) -> Vec<(f64, f64)> {
        let [low, high] = extent(&self.axial);
        let mut order: Vec<usize> = (0..self.axial.len()).collect();
        order.sort_by(|&a, &b| self.axial[a].total_cmp(&self.axial[b]));
        let mut levels: Vec<(f64, f64, f64)> = Vec::new();
        for place in order {
            let (axial, radius) = (self.axial[place], self.radius[place]);
            match levels.last_mut() {
                Some((first, sum, count)) if self.flat || axial - *first <= SAME_PLACE * (high - low) => {
                    *sum += radius;
                    *count += 1.0;
                }
                _ => levels.push((axial, radius, 1.0)),
            }
        }
        levels.into_iter().map(|(axial, sum, count)| (axial, sum / count)).collect()
    }
}
