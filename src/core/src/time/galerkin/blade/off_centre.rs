//! Gaps of eight nodes for an off-centre shaft.
//!
//! With the shaft centre at (e_r, e_t, e_z) in the directions of a node, the gap is F/|∇F| with F and ∇F as in
//! [`revolution`](crate::geometry::revolution). A closing displacement a changes F by α a with α = (κ + m²)/M² and
//! κ = cos δ + s′ sin δ/ρ. Steps use F/α, whose derivative with respect to a is 1, and σ = (∂F/∂u_θ)/α. The contact problem, the gap
//! F/|∇F| and the directions of the forces then keep their form, and λ' is α times larger.
//!
//! u_r is approximated by −a/M². This is exact for a slope m = 0. Otherwise, it neglects the meridional displacement w, which changes the
//! gap by m (1 − κ) w. This is about 1e-5 w if the eccentricity equals the clearance.

use super::rows::BladeRows;
use super::surface::{DriveRate, PointDrive};
use crate::geometry::Vector3;
use crate::math::octet::{Eight, Octet, both};
use crate::scene::shape::CompiledShape;

/// Returns the components of a vector along the axes of a rotor, from its fixed components and the sine and cosine of the rotor angle.
pub(super) fn in_rotor((sine, cosine): (f64, f64), fixed: Vector3) -> Vector3 {
    Vector3::new(fixed[0] * cosine + fixed[1] * sine, fixed[1] * cosine - fixed[0] * sine, fixed[2])
}

/// Sines and cosines of the angles of nodes, in blocks of eight: angle addition for the rotor angle, and a power series
/// for the small angle of the circumferential displacement.
#[derive(Clone, Copy)]
pub(super) struct Directions<L> {
    sine: L,
    cosine: L,
}

impl<L: Octet> Directions<L> {
    /// Creates the directions at angles (sine, cosine), turned by a rotor angle (sine, cosine) and a small angle.
    #[inline(always)]
    pub fn new([sine, cosine]: [L; 2], rotor: (f64, f64), small: L) -> Self {
        let (s, c) = (L::splat(rotor.0), L::splat(rotor.1));
        let (sine, cosine) = (sine * c + cosine * s, cosine * c - sine * s);
        let square = small * small;
        let small_sine = small * (L::splat(1.0) - square * (L::splat(1.0 / 6.0) - square * L::splat(1.0 / 120.0)));
        let small_cosine = L::splat(1.0) - square * (L::splat(0.5) - square * L::splat(1.0 / 24.0));
        Self { sine: sine * small_cosine + cosine * small_sine, cosine: cosine * small_cosine - sine * small_sine }
    }

    /// Returns the fixed components of a vector with these radial and tangential components.
    #[inline(always)]
    pub fn fixed(&self, radial: L, tangential: L) -> [L; 2] {
        [radial * self.cosine - tangential * self.sine, radial * self.sine + tangential * self.cosine]
    }

    /// Returns the radial and tangential components of a vector that is the same for all nodes.
    #[inline(always)]
    pub fn local(&self, vector: &Vector3) -> [L; 2] {
        let (x, y) = (L::splat(vector[0]), L::splat(vector[1]));
        [x * self.cosine + y * self.sine, y * self.cosine - x * self.sine]
    }
}

/// Gaps of eight nodes and their derivatives, for an off-centre shaft.
pub(super) struct OffCentreGaps<L> {
    /// F/α without the closing displacement (m), and σ.
    pub clear: L,
    pub sigma: L,
    /// Coefficient of the squared circumferential displacement in F/α (1/m).
    pub bend: L,
    /// 1/α.
    pub scale: L,
    /// Shape of the surface (m) and its slope (m/rad), without the factor.
    pub shape: L,
    pub slope: L,
    /// Directions of the nodes relative to the rotor.
    frame: Directions<L>,
    /// Change of F per inward and per circumferential displacement of the shaft.
    by_shaft: [L; 2],
    /// Change of F per rotor angle (m/rad), minus the slope of the shape.
    turning: L,
}

impl<L: Octet> OffCentreGaps<L> {
    /// Finds the gaps of a block of nodes from their angles in the rotor (rad) with sines and cosines, and from their closing and
    /// circumferential displacements (m).
    #[inline(always)]
    pub fn new(
        surface: &CompiledShape,
        drive: &PointDrive,
        (rows, block): (&BladeRows, usize),
        (angles, directions): (L, [L; 2]),
        [closing, around]: [L; 2],
    ) -> Self {
        let one = L::splat(1.0);
        let (per_radius, slope) = (L::load(&rows.per_radius[block]), L::load(&rows.slopes[block]));
        let per_square = L::load(&rows.per_steepness[block]) * L::load(&rows.per_steepness[block]);
        let small = around * per_radius;
        let frame = Directions::new(directions, (0.0, 1.0), small);
        let [outwards, sideways] = frame.local(&drive.shaft);
        let radial = L::zero() - closing * per_square;
        let radius = one / per_radius + radial;
        let arm = radius + outwards;
        let distance = (arm * arm + sideways * sideways).sqrt();
        let per_distance = one / distance;
        let (sine, cosine) = (sideways * per_distance, arm * per_distance);
        let at = angles + L::splat(drive.turned) + small + small_arc_tangent(sideways / arm);
        let [shape, steepness, curvature] = surface.evaluate_octet::<L>(at);
        let factor = L::splat(drive.factor);
        let along = steepness * factor;
        let per_arc = along * per_distance;
        let by_shaft = [cosine + per_arc * sine, per_arc * cosine - sine];
        let stretch = one + radial * per_radius;
        let scale = one / ((by_shaft[0] + slope * slope) * per_square);
        // ρ − r − u_r without cancellation.
        let shifted = outwards + sideways * sideways / (distance + arm) - slope * L::splat(drive.shaft[2]);
        let open = L::splat(drive.clearance) + shape * factor - shifted + closing;
        let around_arc = stretch * by_shaft[1];
        // d(φ + δ)/dφ and dδ/dφ.
        let seen = radius * per_distance * cosine;
        let less = L::zero() - (arm * outwards + sideways * sideways) * per_distance * per_distance;
        let second = curvature * factor * seen * seen
            - along * radius * per_distance * sine * (seen + less)
            - radius * cosine * less;
        Self {
            clear: open * scale - closing,
            sigma: around_arc * scale,
            bend: second * scale * per_radius * per_radius * L::splat(0.5),
            scale,
            shape,
            slope: steepness,
            frame,
            by_shaft,
            turning: around_arc / per_radius - along,
        }
    }

    /// Returns the rate of F/α (m/s) from the rates of the closing and circumferential displacements (m/s).
    #[inline(always)]
    pub fn rate(&self, drive: &PointDrive, rate: &DriveRate, slope: L, [closing, around]: [L; 2]) -> L {
        let [outwards, sideways] = self.frame.local(&drive.shaft_velocity);
        let of_shaft =
            slope * L::splat(drive.shaft_velocity[2]) + self.by_shaft[1] * sideways - self.by_shaft[0] * outwards;
        let of_casing = L::splat(rate.clearance)
            + self.shape * L::splat(rate.factor)
            + self.slope * L::splat(drive.factor * rate.turned);
        closing + self.scale * (of_casing + of_shaft + self.turning * L::splat(drive.speed)) + self.sigma * around
    }

    /// Returns the components of a shaft displacement or velocity that are conjugate to the closing and circumferential forces.
    /// `shaft` is given along the axes of the rotor, and `stretch` is (r + u_r)/r.
    #[inline(always)]
    pub fn seen(&self, slope: L, stretch: L, shaft: &Vector3) -> [L; 2] {
        let [outwards, sideways] = self.frame.local(shaft);
        [slope * L::splat(shaft[2]) - outwards, sideways / stretch]
    }
}

/// Returns arctan t for |t| ≤ 0.2. The truncation error is below 1e-16 t.
#[inline(always)]
fn small_arc_tangent<L: Octet>(t: L) -> L {
    let square = t * t;
    let mut sum = L::splat(1.0 / 21.0);
    for odd in [19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0] {
        sum = L::splat(1.0 / odd) - square * sum;
    }
    t * (L::splat(1.0) - square * sum)
}

/// Returns the sines and cosines of the angles of a block of nodes.
#[inline(always)]
pub(super) fn directions_of<L: Octet>(of_nodes: &[Vec<Eight>; 2], block: usize) -> [L; 2] {
    both(|of| L::load(&of_nodes[of][block]))
}
