//! Surface through a grid of data points: the slave surface of a flexible or measured casing.
//!
//! Bicubic uniform B-spline, eqs (6)-(7) of the paper: on patch (p, q), with s around and t along the axis,
//!
//! S(s, t) = (s³, s², s, 1) H Q_pq Hᵀ (t³, t², t, 1)ᵀ,   H = ⅙ [−1 3 −3 1; 3 −6 3 0; −3 0 3 0; 1 4 1 0],
//!
//! with the 4 × 4 control points Q_{p−1..p+2, q−1..q+2}. The control points solve the interpolation problem S(data point) = P. Along the
//! axis both edges are free: S_tt = 0 there. Around, the surface closes with continuous first and second derivatives ([`Closure::Smooth`],
//! fig. 8b), with free ends that meet in position only ([`Closure::FreeEnds`], fig. 8a), or not at all: an open surface
//! ([`SurfaceSpline::open`]) has two more free edges, S_ss = 0 there, and any position in space. [`Interpolation::Facets`] replaces all of
//! this by bilinear patches.
//!
//! A free end is the phantom control point Q₋₁ = 2 Q₀ − Q₁, so that phantoms depend on the others and there is exactly one control point
//! per data point, with the same index. Displacements of the data points become displacements of the control points by
//! [`SurfaceSpline::interpolate`]. [`SurfaceSpline::weights`] give the displacement at a place and distribute a force there over the
//! control points: virtual work is exact.
//!
//! A surface around the axis does not end at its first and last ring: it continues along its tangents, S(s, t) = S(s, 1) + (t − 1) S_t(s,
//! 1), for [`REACH`] of its axial extent. Since S_tt = 0 at the edge the continuation is as smooth as the rest: points, derivatives and
//! weights. A node that moves over the last ring and back thus always has a distance. An open surface, which is not around an axis, ends at
//! its edges.

pub(crate) mod close;
mod creases;
mod foot;
mod interpolation;
pub(crate) mod motion;
mod patch;
mod projection;

pub use patch::{Evaluation, Weights};
pub use projection::Projection;

use tiprub_cosim::persist_fields;

use crate::math::real;
use crate::math::vector::Vector3;
use crate::scene::settings::{Closure, Interpolation};
use crate::{Error, Result};
use interpolation::InterpolationRow;

/// Smallest number of data points around: with fewer the four control points of a patch would not be distinct.
pub(crate) const FEWEST_AROUND: usize = 4;
/// Smallest number of rings of data points along the axis, and of data points in either direction of an open surface.
pub(crate) const FEWEST_ALONG: usize = 2;

/// Extension of a surface around the axis beyond its first and last ring, as a fraction of its axial extent (counted in rings: exact for equal
/// distances). It does not depend on the fineness of the grid.
pub const REACH: f64 = 0.25;
/// A node at most this far (in patches) beyond an edge of an open surface is still on it, so that rounding does not decide for nodes
/// exactly on the edge.
const EDGE_TOLERANCE: f64 = 1e-9;
/// Rounding of saved places at the borders of patches (in patches).
const BORDER: f64 = 1e-6;

/// The two ends of a row of data points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ends {
    /// Closed, continuous up to the second derivative.
    Smooth,
    /// Closed, free ends that meet in position.
    Meeting,
    /// Free edges.
    Open,
}

/// A place on the surface: a patch and the parameters in it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ClosestPoint {
    /// Patch (p, q): p < around (around − 1 of an open surface) counts around from the first data point, q < along − 1
    /// along the axis.
    pub patch: [usize; 2],
    /// Parameter around, 0 at data point p and 1 at p + 1; beyond that by rounding at the edges of an open surface.
    pub s: f64,
    /// Parameter along the axis, 0 at ring q and 1 at ring q + 1; outside this range on the extension beyond the first and last ring, and
    /// by rounding at the edges of an open surface.
    pub t: f64,
}

persist_fields!(ClosestPoint { patch, s, t });

/// A surface through around × along data points, index `along · around + i`. A closed surface has rings in order of increasing z, with the
/// points of a ring at angles that increase by 2π/around about z; an open surface is a quadrilateral grid of any shape, with "around" and
/// "along" as its two directions. Only construction allocates.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceSpline {
    around: usize,
    along: usize,
    ends: Ends,
    /// Extension beyond the first and last ring (patches).
    reach: f64,
    interpolation: Interpolation,
    /// Interpolation problems around and along.
    lines: [InterpolationRow; 2],
    /// Control points (m), one per data point.
    control: Vec<Vector3>,
    /// Control points with phantoms and repetitions, (along + 2) rings of (around + 3), so that a patch is a window of
    /// 4 × 4; three coordinates and a zero.
    mesh: Vec<[f64; 4]>,
    /// Angle of the first data point of each ring (rad), undeformed.
    first_angle: f64,
    /// Mean axial position of each ring (m), undeformed.
    rings: Vec<f64>,
    /// Data points of an open surface (m), undeformed.
    data: Vec<Vector3>,
}

impl SurfaceSpline {
    /// Creates the surface through `data`, Cartesian points (m).
    ///
    /// # Errors
    /// Fewer than 4 × 2 points; a wrong number of points; points that are not finite or not at their place in the grid (more than a quarter
    /// of the spacing 2π/around off in angle; rings that are not in order of z).
    pub fn new(
        data: &[[f64; 3]],
        around: usize,
        along: usize,
        closure: Closure,
        interpolation: Interpolation,
    ) -> Result<Self> {
        let ends = match closure {
            Closure::Smooth => Ends::Smooth,
            Closure::FreeEnds => Ends::Meeting,
        };
        Self::with_ends(data, around, along, ends, interpolation)
    }

    /// Creates an open surface through `data`, Cartesian points (m) of a quadrilateral grid of any shape, with free edges on all four
    /// sides. Its normal is S_t × S_s/|S_t × S_s|, with s from point to point of a row and t from row to row.
    ///
    /// # Errors
    /// Fewer than 2 × 2 points; a wrong number of points; points that are not finite.
    pub fn open(data: &[[f64; 3]], around: usize, along: usize, interpolation: Interpolation) -> Result<Self> {
        Self::with_ends(data, around, along, Ends::Open, interpolation)
    }

    fn with_ends(
        data: &[[f64; 3]],
        around: usize,
        along: usize,
        ends: Ends,
        interpolation: Interpolation,
    ) -> Result<Self> {
        let (fewest, remedy) = match ends {
            Ends::Open => (FEWEST_ALONG, "Give at least 2 x 2 points"),
            _ => (FEWEST_AROUND, "Give at least 4 points around and 2 rings along the axis"),
        };
        let counts = format!("{around} points around and {along} rings");
        if around < fewest || along < FEWEST_ALONG {
            return Err(Error::invalid("surface spline", counts, remedy));
        }
        let addressable = around.checked_mul(along).is_some_and(|count| u32::try_from(count).is_ok());
        if !addressable || around * along != data.len() {
            return Err(Error::invalid("surface spline", format!("{counts}, but {} data points", data.len()), remedy));
        }
        let lines = match interpolation {
            Interpolation::Facets => [InterpolationRow::facets(), InterpolationRow::facets()],
            Interpolation::Spline => {
                let ring = match ends {
                    Ends::Smooth => InterpolationRow::closed(around),
                    Ends::Meeting => InterpolationRow::free_ends(around, 0),
                    Ends::Open => InterpolationRow::free_ends(around, around - 1),
                };
                [ring, InterpolationRow::free_ends(along, along - 1)]
            }
        };
        let mut surface = Self {
            around,
            along,
            ends,
            reach: if ends == Ends::Open { EDGE_TOLERANCE } else { REACH * real(along - 1) },
            interpolation,
            lines,
            control: vec![Vector3::zeros(); around * along],
            mesh: vec![[0.0; 4]; (around + 3) * (along + 2)],
            first_angle: 0.0,
            rings: vec![0.0; along],
            data: vec![Vector3::zeros(); if ends == Ends::Open { data.len() } else { 0 }],
        };
        surface.set_data(data)?;
        Ok(surface)
    }

    /// Replaces the data points (m) and the data of [`SurfaceSpline::locate`].
    ///
    /// # Errors
    /// As [`SurfaceSpline::new`]; the surface is then unchanged.
    pub fn set_data(&mut self, data: &[[f64; 3]]) -> Result<()> {
        self.check(data)?;
        self.data.iter_mut().zip(data).for_each(|(own, data)| *own = (*data).into());
        self.first_angle = libm::atan2(data[0][1], data[0][0]);
        for (ring, points) in self.rings.iter_mut().zip(data.chunks(self.around)) {
            *ring = mean_axial(points);
        }
        let mut control = std::mem::take(&mut self.control);
        control.iter_mut().zip(data).for_each(|(point, data)| *point = (*data).into());
        self.interpolate(&mut control);
        self.control = control;
        self.fill_mesh();
        Ok(())
    }

    fn check(&self, data: &[[f64; 3]]) -> Result<()> {
        let refuse = |what: String, problem: String| {
            let remedy = "Give rings in order of increasing z, each with points at angles about z that increase by \
                          2π divided by the number of points per ring";
            Err(Error::invalid(what, problem, remedy))
        };
        if data.len() != self.around * self.along {
            let problem = format!("{} data points for a grid of {} x {} points", data.len(), self.around, self.along);
            return refuse("surface spline".into(), problem);
        }
        if let Some(index) = data.iter().position(|point| point.iter().any(|value| !value.is_finite())) {
            let problem = format!("{:?} m is not finite", data[index]);
            return refuse(format!("surface spline, data point {}", index + 1), problem);
        }
        if self.ends == Ends::Open {
            return Ok(());
        }
        let spacing = std::f64::consts::TAU / real(self.around);
        let first = libm::atan2(data[0][1], data[0][0]);
        for (index, point) in data.iter().enumerate() {
            let expected = first + spacing * real(index % self.around);
            let turns = (libm::atan2(point[1], point[0]) - expected) / std::f64::consts::TAU;
            let off = (turns - libm::round(turns)).abs() * std::f64::consts::TAU;
            if off > 0.25 * spacing || (point[0] == 0.0 && point[1] == 0.0) {
                let problem = format!("{point:?} m is {off:.3e} rad away from its expected angle in the ring");
                return refuse(format!("surface spline, data point {}", index + 1), problem);
            }
        }
        let rings = data.chunks(self.around);
        if let Some(ring) = rings.clone().zip(rings.skip(1)).position(|(a, b)| mean_axial(a) >= mean_axial(b)) {
            let problem = format!("ring {} is not at a larger z than ring {}", ring + 2, ring + 1);
            return refuse("surface spline".into(), problem);
        }
        Ok(())
    }

    /// Sets every control point (m) to the value of a function of its index, for example to the undeformed control
    /// point plus a linear combination of interpolated mode shapes.
    pub fn set_control_points(&mut self, of: impl Fn(usize) -> Vector3) {
        self.control.iter_mut().enumerate().for_each(|(index, point)| *point = of(index));
        self.fill_mesh();
    }

    /// Control points (m), with index `along · around + i` like the data points.
    pub fn control_points(&self) -> &[Vector3] {
        &self.control
    }

    /// Number of data points around the circumference.
    pub fn around(&self) -> usize {
        self.around
    }

    /// Number of rings of data points along the axis.
    pub fn along(&self) -> usize {
        self.along
    }

    /// Angle between data points around an axis (rad).
    pub fn spacing(&self) -> f64 {
        std::f64::consts::TAU / real(self.around)
    }

    /// Number of patches around.
    pub fn columns(&self) -> usize {
        if self.ends == Ends::Open { self.around - 1 } else { self.around }
    }

    /// Returns whether the patch of a place exists.
    pub(crate) fn has_patch(&self, place: ClosestPoint) -> bool {
        place.patch[0] < self.columns() && place.patch[1] < self.along - 1
    }

    /// Returns whether a place is on this surface or on its extension beyond the first or last ring, up to rounding.
    pub(crate) fn has_place(&self, place: ClosestPoint) -> bool {
        let within = |value: f64, [low, high]: [f64; 2]| (low - BORDER..=high + BORDER).contains(&value);
        self.has_patch(place) && within(place.s, [0.0, 1.0]) && within(place.t, self.span(place.patch[1]))
    }

    /// Returns a place at about the angle and the axial position of a point (m), on the edge for points beyond it, or the nearest data
    /// point of an open surface: the start for [`SurfaceSpline::project`] without a place from the last step.
    pub fn locate(&self, point: Vector3) -> ClosestPoint {
        if self.ends == Ends::Open {
            return self.nearest_data_point(point);
        }
        self.locate_at(libm::atan2(point[1], point[0]), point[2])
    }

    /// Returns a place near an angle about z (rad) and an axial position (m) on a closed surface. For positions beyond an edge, the place is on this edge.
    #[inline(always)]
    pub(crate) fn locate_at(&self, angle: f64, axial: f64) -> ClosestPoint {
        let turns = (angle - self.first_angle) / std::f64::consts::TAU;
        let (p, s) = split((turns - turns.floor()) * real(self.around), self.around);
        let q = self.rings[1..self.along - 1].iter().filter(|ring| **ring <= axial).count();
        let t = (axial - self.rings[q]) / (self.rings[q + 1] - self.rings[q]);
        ClosestPoint { patch: [p, q], s, t: if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 } }
    }

    fn nearest_data_point(&self, point: Vector3) -> ClosestPoint {
        let nearest = self.data.iter().map(|data| (point - data).norm_squared()).enumerate();
        let nearest = nearest.min_by(|a, b| a.1.total_cmp(&b.1));
        let index = nearest.map_or(0, |(index, _)| index);
        let (p, q) = (index % self.around, index / self.around);
        let patch = [p.min(self.around - 2), q.min(self.along - 2)];
        ClosestPoint { patch, s: real(p - patch[0]), t: real(q - patch[1]) }
    }

    /// Returns the place `turns` revolutions further about z, a start value after the rotor has turned; closed surfaces only.
    #[inline]
    pub fn advance(&self, place: ClosestPoint, turns: f64) -> ClosestPoint {
        let whole = real(self.around);
        let s = place.s + turns * whole;
        if (0.0..1.0).contains(&s) {
            return ClosestPoint { s, ..place };
        }
        let moved = (real(place.patch[0]) + place.s + turns * whole) / whole;
        let (p, s) = split((moved - moved.floor()) * whole, self.around);
        ClosestPoint { patch: [p, place.patch[1]], s, t: place.t }
    }

    /// Writes phantoms and repetitions around the control points.
    fn fill_mesh(&mut self) {
        let (around, width) = (self.around, self.around + 3);
        for (ring, points) in self.control.chunks_exact(around).enumerate() {
            let row = &mut self.mesh[(ring + 1) * width..(ring + 2) * width];
            for (slot, point) in row[1..=around].iter_mut().zip(points) {
                *slot = point.push(0.0).into();
            }
            let ends = match (self.interpolation, self.ends) {
                (_, Ends::Open) => {
                    // The last slot belongs to no patch.
                    let beyond = phantom(row[around], row[around - 1]);
                    [phantom(row[1], row[2]), beyond, beyond]
                }
                (Interpolation::Spline, Ends::Meeting) => {
                    [phantom(row[1], row[2]), row[1], phantom(row[1], row[around])]
                }
                _ => [row[around], row[1], row[2]],
            };
            [row[0], row[around + 1], row[around + 2]] = ends;
        }
        let last = self.along * width;
        for slot in 0..width {
            self.mesh[slot] = phantom(self.mesh[width + slot], self.mesh[2 * width + slot]);
            self.mesh[last + width + slot] = phantom(self.mesh[last + slot], self.mesh[last - width + slot]);
        }
    }
}

/// Control point beyond a free end, Q₋₁ = 2 Q₀ − Q₁.
fn phantom(end: [f64; 4], inner: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| 2.0 * end[i] - inner[i])
}

fn mean_axial(points: &[[f64; 3]]) -> f64 {
    points.iter().map(|point| point[2]).sum::<f64>() / real(points.len())
}

/// Splits a value in [0, count] into a whole part below `count` and the rest.
pub(crate) fn split(value: f64, count: usize) -> (usize, f64) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ value ≤ count")]
    let whole = (value as usize).min(count - 1);
    (whole, value - real(whole))
}
