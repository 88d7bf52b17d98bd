//! Blade section on its surface of revolution.
//!
//! The surface is unrolled conformally: X = R₀ ∫ ds/r along the meridian, Y = R₀ θ, with R₀ the mean radius of the
//! section. Lengths in that plane are those on the surface times R₀/r, so circles stay circles. In it the section is
//! bounded by a leading- and a trailing-edge circle and, in the chord frame (origin and end in the centres of the
//! circles, abscissa u = 0..1), by the two sides v = camber(u) ± half thickness(u), cubic B-splines with common
//! knots.

/// Order of the Chebyshev series of z(X).
const Z_TERMS: usize = 9;
/// Order of the Chebyshev series of r(X).
const R_TERMS: usize = 13;
/// The B-splines are defined on [-`SPLINE_END`, 1 + `SPLINE_END`].
const SPLINE_END: f64 = 0.005;

/// Compact description of a section; lengths in m, signs of θ as in the table of NASA TP-1659.
#[derive(Debug)]
pub struct AerofoilSection {
    /// R₀.
    pub(super) mean_radius: f64,
    /// Range of X on which the Chebyshev series are defined.
    pub(super) meridional_range: [f64; 2],
    /// Chebyshev coefficients of z(X).
    pub(super) z: [f64; Z_TERMS],
    /// Chebyshev coefficients of r(X).
    pub(super) r: [f64; R_TERMS],
    /// Centre X, Y and radius of the leading-edge circle.
    pub(super) leading_edge: [f64; 3],
    /// Centre X, Y and radius of the trailing-edge circle.
    pub(super) trailing_edge: [f64; 3],
    /// Inner knots of the sides.
    pub(super) knots: &'static [f64],
    /// B-spline coefficients of the camber.
    pub(super) camber: &'static [f64],
    /// B-spline coefficients of the half thickness.
    pub(super) half_thickness: &'static [f64],
}

/// Point in cylindrical coordinates (m, rad).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CylindricalPoint {
    /// Radius r.
    pub r: f64,
    /// Angle θ.
    pub theta: f64,
    /// Axial coordinate z.
    pub z: f64,
}

impl AerofoilSection {
    /// Returns the distance between the centres of the edge circles in the plane.
    pub fn chord(&self) -> f64 {
        let [a, b] = [self.leading_edge, self.trailing_edge];
        (b[0] - a[0]).hypot(b[1] - a[1])
    }

    /// Returns the radii of the leading- and the trailing-edge circle.
    pub fn edge_radii(&self) -> [f64; 2] {
        [self.leading_edge[2], self.trailing_edge[2]]
    }

    /// Returns camber and half thickness at the chord abscissa u.
    pub fn sides(&self, u: f64) -> [f64; 2] {
        [spline(self.knots, self.camber, u), spline(self.knots, self.half_thickness, u)]
    }

    /// Returns the plane coordinates (X, Y) of a point of the chord frame; u in chords, v in m.
    pub fn plane(&self, u: f64, v: f64) -> [f64; 2] {
        let chord = self.chord();
        let along = [0, 1].map(|i| (self.trailing_edge[i] - self.leading_edge[i]) / chord);
        let x = u * chord;
        [self.leading_edge[0] + x * along[0] - v * along[1], self.leading_edge[1] + x * along[1] + v * along[0]]
    }

    /// Returns the point of the surface of revolution at plane coordinates.
    pub fn on_surface(&self, [x, y]: [f64; 2]) -> CylindricalPoint {
        let [low, high] = self.meridional_range;
        let t = (2.0 * x - low - high) / (high - low);
        CylindricalPoint { r: chebyshev(&self.r, t), theta: y / self.mean_radius, z: chebyshev(&self.z, t) }
    }

    /// Returns the plane abscissa X of the parallel circle at axial coordinate z (bisection; z increases with X).
    pub fn abscissa(&self, z: f64) -> f64 {
        let [mut low, mut high] = self.meridional_range;
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.on_surface([middle, 0.0]).z < z { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// Returns the slope dr/dz of the surface of revolution at plane abscissa X.
    pub(crate) fn meridional_slope(&self, x: f64) -> f64 {
        let step = 1e-4 * (self.meridional_range[1] - self.meridional_range[0]);
        let [a, b] = [x - step, x + step].map(|x| self.on_surface([x, 0.0]));
        (b.r - a.r) / (b.z - a.z)
    }

    /// Returns the mean radius R₀ of the section, the scale of its plane.
    pub fn mean_radius(&self) -> f64 {
        self.mean_radius
    }

    /// Returns the closed outline as a polyline in the plane: `count` points per side and per edge arc.
    pub fn outline(&self, count: usize) -> Vec<[f64; 2]> {
        let feet = [1.0, -1.0].map(|side| [self.foot(side, 0.0), self.foot(side, 1.0)]);
        let mut points = Vec::with_capacity(4 * count);
        let share = |i: usize| i as f64 / count as f64;
        let side_point = |side: f64, u: f64| {
            let [camber, half] = self.sides(u);
            [u, camber + side * half]
        };
        let arc = |points: &mut Vec<[f64; 2]>, centre: f64, radius: f64, from: [f64; 2], to: [f64; 2], outward: f64| {
            let chord = self.chord();
            let angle = |p: [f64; 2]| p[1].atan2(outward * (p[0] - centre) * chord);
            let (first, last) = (angle(from), angle(to));
            for i in 0..=count {
                let angle = first + (last - first) * share(i);
                points.push(self.plane(centre + outward * radius * angle.cos() / chord, radius * angle.sin()));
            }
        };
        let [leading, trailing] = self.edge_radii();
        // One side from leading to trailing edge, around the trailing edge, back on the other side, around the
        // leading edge.
        let graded = |i: usize| 0.5 * (1.0 - (core::f64::consts::PI * share(i)).cos());
        for i in 0..=count {
            let [u, v] = side_point(1.0, feet[0][0] + (feet[0][1] - feet[0][0]) * graded(i));
            points.push(self.plane(u, v));
        }
        arc(&mut points, 1.0, trailing, side_point(1.0, feet[0][1]), side_point(-1.0, feet[1][1]), 1.0);
        for i in 0..=count {
            let [u, v] = side_point(-1.0, feet[1][1] + (feet[1][0] - feet[1][1]) * graded(i));
            points.push(self.plane(u, v));
        }
        arc(&mut points, 0.0, leading, side_point(-1.0, feet[1][0]), side_point(1.0, feet[0][0]), -1.0);
        points
    }

    /// Returns the abscissa at which a side (±1) is nearest to the centre of an edge circle (at u = 0 or 1), where
    /// the arc begins.
    fn foot(&self, side: f64, centre: f64) -> f64 {
        let chord = self.chord();
        let distance = |u: f64| {
            let [camber, half] = self.sides(u);
            ((u - centre) * chord).hypot(camber + side * half)
        };
        let (mut low, mut high) = (centre - SPLINE_END, centre + SPLINE_END);
        // Ternary search: the distance has one minimum in this short interval.
        for _ in 0..80 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if distance(a) < distance(b) { high = b } else { low = a }
        }
        0.5 * (low + high)
    }
}

/// Evaluates Σ c_k T_k(t) by Clenshaw's recurrence.
fn chebyshev(coefficients: &[f64], t: f64) -> f64 {
    let (mut next, mut after) = (0.0, 0.0);
    for &coefficient in coefficients[1..].iter().rev() {
        (next, after) = (coefficient + 2.0 * t * next - after, next);
    }
    coefficients[0] + t * next - after
}

/// Evaluates a clamped cubic B-spline by de Boor's algorithm; the last polynomial piece extends beyond the ends.
fn spline(inner: &[f64], coefficients: &[f64], u: f64) -> f64 {
    let knot = |i: usize| match i {
        0..4 => -SPLINE_END,
        i if i < 4 + inner.len() => inner[i - 4],
        _ => 1.0 + SPLINE_END,
    };
    let span = 3 + inner.iter().take_while(|&&knot| knot <= u).count();
    let mut work: [f64; 4] = core::array::from_fn(|i| coefficients[span - 3 + i]);
    for level in 1..4 {
        for i in (level..4).rev() {
            let (low, high) = (knot(span - 3 + i), knot(span + 1 + i - level));
            let weight = (u - low) / (high - low);
            work[i] = (1.0 - weight) * work[i - 1] + weight * work[i];
        }
    }
    work[3]
}
