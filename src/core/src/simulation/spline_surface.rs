//! Surfaces through data points, and the modes of their surface carriers.

use crate::geometry::Vector3;
use crate::geometry::frame::PolarFrame;
use crate::geometry::layout::Layout;
use crate::geometry::spline::SplineGap;
use crate::geometry::surface_spline::SurfaceSpline;
use crate::math::{argsort, real};
use crate::modes::modal::ModalModel;
use crate::scene::rom::{ContactNode, DisplacementFrame};
use crate::scene::settings::{ContactSettings, SplineSettings, SurfaceSettings};
use crate::scene::shape::CompiledShape;
use crate::{Error, Result, Rom};
use nalgebra::DMatrix;

/// Rings of a rigid spline extend beyond the contact nodes by this fraction of their axial extent, and at least by the second fraction of
/// the radius.
const MARGIN_OF_EXTENT: f64 = 0.25;
const MARGIN_OF_RADIUS: f64 = 0.02;
/// Allowed difference between the radii of the surface and of the contact grid of its carrier, as a fraction of the radius.
const SAME_RADIUS: f64 = 0.1;

/// Positions of the data points of a surface.
#[derive(Debug, Clone)]
struct DataGrid {
    around: usize,
    /// Index of the first data point among the nodes of a contact grid.
    first_node: usize,
    first_angle: f64,
    rings: Vec<f64>,
}

/// A surface carrier.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CarrierModes<'a> {
    /// ROM of the structure.
    pub rom: &'a Rom,
    /// Modes, observed at the contact grid.
    pub model: &'a ModalModel,
}

/// Creates the gap function of some contact nodes of a structure against a surface through data points, which are those of the contact grid
/// of `carrier` if there is one.
///
/// # Errors
/// Structure without contact grid; contact nodes beyond the grid or far from it; too few points.
pub(crate) fn spline_gap(
    (master, nodes): (&Rom, &[usize]),
    layout: Layout,
    contact: &ContactSettings,
    surface: &SurfaceSettings,
    carrier: Option<(&Rom, Share)>,
) -> Result<SplineGap> {
    let settings = surface.spline.unwrap_or_default();
    let (contour, clearance) = (TipContour::new(master, nodes), contact.nominal_gap());
    let grid = match carrier {
        Some((rom, share)) => carried_grid(rom, share, &contour)?,
        None => rigid_grid(settings, &contour),
    };
    let round = data(&grid, |z, _| contour.radius(z) + clearance);
    if let Some((rom, _)) = carrier {
        check_radii(rom, grid.first_node, &round)?;
    }
    let spline = SurfaceSpline::new(&round, grid.around, grid.rings.len(), settings.closure, settings.interpolation)?;
    let shape = CompiledShape::new(&surface.shape, clearance)?;
    let change = data(&grid, |_, angle| shape.evaluate(angle).0);
    let mut change: Vec<_> = change.iter().map(|[x, y, _]| Vector3::new(*x, *y, 0.0)).collect();
    if shape == CompiledShape::Circular {
        change.clear();
    } else {
        spline.interpolate(&mut change);
    }
    let mut gap = SplineGap::new(layout, clearance, spline, change, shape.angular_scale());
    (gap.nodes, gap.first_node) = (nodes.to_vec(), grid.first_node);
    Ok(gap)
}

impl CarrierModes<'_> {
    /// Returns the modes, observed at the control points of a surface along x, y, z; data points of the surface are nodes of the contact
    /// grid from `first` on.
    pub(crate) fn at_control_points(&self, surface: &SurfaceSpline, first: usize) -> ModalModel {
        let nodes = surface.control_points().len();
        let mut model = self.model.clone();
        model.contact_modes = DMatrix::zeros(3 * nodes, model.len());
        let mut points = vec![Vector3::zeros(); nodes];
        for mode in 0..model.len() {
            for (node, point) in points.iter_mut().enumerate() {
                let row = 3 * (first + node);
                let own = self.model.contact_modes.fixed_view::<3, 1>(row, mode).into_owned();
                *point = along_axes(self.rom, first + node, own);
            }
            surface.interpolate(&mut points);
            for (node, point) in points.iter().enumerate() {
                for (component, value) in point.iter().enumerate() {
                    model.contact_modes[(3 * node + component, mode)] = *value;
                }
            }
        }
        // Contact acts on the residual flexibility of the master; all modes of the carrier keep their inertia.
        model.quasi_static = 0;
        model
    }
}

/// Converts a displacement of a contact node to the axes x, y, z.
fn along_axes(rom: &Rom, node: usize, own: Vector3) -> Vector3 {
    match rom.frame {
        DisplacementFrame::Cartesian => own,
        DisplacementFrame::Cylindrical => PolarFrame::new(rom.contact_nodes[node].position[1]).fixed(own),
    }
}

/// Part of a contact grid that a surface uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Share {
    /// The whole grid.
    Whole,
    /// The rings near the contact nodes that face it, since other surfaces use other rings.
    Near,
}

fn carried_grid(rom: &Rom, share: Share, contour: &TipContour) -> Result<DataGrid> {
    let Some(grid) = rom.extras.grid else { unreachable!("checked") };
    let mut rings: Vec<f64> = rom.contact_nodes.chunks(grid.around).map(|ring| ring[0].position[2]).collect();
    let (low, high) = (rings[0], rings[rings.len() - 1]);
    let [first, last] = contour.extent();
    if first < low || last > high {
        return Err(Error::invalid(
            format!("ROM `{}`", rom.name),
            format!(
                "the contact grid spans z = {low:.4e} to {high:.4e} m, but the contact nodes of the blades span \
                 {first:.4e} to {last:.4e} m"
            ),
            "Use a casing that covers the blade tips",
        ));
    }
    let mut first_ring = 0;
    if share == Share::Near {
        let margin = contour.margin();
        let below = rings.iter().filter(|z| **z <= first - margin).count();
        let above = rings.iter().filter(|z| **z < last + margin).count();
        first_ring = below.saturating_sub(1);
        rings = rings[first_ring..rings.len().min(above + 1)].to_vec();
    }
    let first_angle = rom.contact_nodes[0].position[1];
    Ok(DataGrid { around: grid.around, first_node: first_ring * grid.around, first_angle, rings })
}

fn rigid_grid(settings: SplineSettings, contour: &TipContour) -> DataGrid {
    let [first, last] = contour.extent();
    let margin = contour.margin();
    let (low, length) = (first - margin, last - first + 2.0 * margin);
    let ring = |ring: usize| low + length * real(ring) / real(settings.along - 1);
    let rings = (0..settings.along).map(ring).collect();
    DataGrid { around: settings.around, first_node: 0, first_angle: 0.0, rings }
}

/// Returns the points of all rings at the radius (m) given for (z, θ).
fn data(grid: &DataGrid, radius: impl Fn(f64, f64) -> f64) -> Vec<[f64; 3]> {
    let mut points = Vec::with_capacity(grid.rings.len() * grid.around);
    for z in &grid.rings {
        for index in 0..grid.around {
            let angle = grid.first_angle + std::f64::consts::TAU * real(index) / real(grid.around);
            let (sine, cosine) = libm::sincos(angle);
            let radius = radius(*z, angle);
            points.push([radius * cosine, radius * sine, *z]);
        }
    }
    points
}

/// Rings of a contact grid that carries a surface of another radius, such as the inner lining of a casing that the mesh omits. The lining
/// transfers forces as a rigid body, so that the support feels them with the lever arm of the surface.
#[derive(Debug, Clone)]
pub(crate) struct Lining {
    /// Index among the surface carriers.
    pub carrier: usize,
    /// Axial position, and radius of the surface minus that of the mesh, ascending along z (m).
    rings: Vec<[f64; 2]>,
}

impl Lining {
    /// Creates the lining between the grid of `rom` and the surface around the contact nodes `nodes` of `master`.
    ///
    /// # Errors
    /// Contact nodes beyond the grid.
    pub fn new(
        carrier: usize,
        (rom, share): (&Rom, Share),
        (master, nodes): (&Rom, &[usize]),
        contact: &ContactSettings,
    ) -> Result<Self> {
        let contour = TipContour::new(master, nodes);
        let grid = carried_grid(rom, share, &contour)?;
        let rings = grid.rings.iter().zip(rom.contact_nodes[grid.first_node..].chunks(grid.around));
        let mean = |ring: &[ContactNode]| ring.iter().map(|node| node.position[0]).sum::<f64>() / real(grid.around);
        let rings = rings.map(|(z, ring)| [*z, contour.radius(*z) + contact.nominal_gap() - mean(ring)]);
        Ok(Self { carrier, rings: rings.collect() })
    }

    /// Radius of the surface minus that of the mesh at an axial position (m).
    fn thickness(&self, z: f64) -> f64 {
        let upper = self.rings.iter().position(|ring| z <= ring[0]).unwrap_or(self.rings.len() - 1).max(1);
        let ([from, first], [to, last]) = (self.rings[upper - 1], self.rings[upper]);
        first + (last - first) * ((z - from) / (to - from)).clamp(0.0, 1.0)
    }

    /// Additional moment (N·m) of a force (N) at a point of the surface compared with the same force on the mesh.
    pub fn moment(&self, point: Vector3, force: Vector3) -> Vector3 {
        let radius = libm::hypot(point[0], point[1]);
        let share = self.thickness(point[2]) / radius;
        Vector3::new(share * point[0], share * point[1], 0.0).cross(&force)
    }
}

fn check_radii(rom: &Rom, first: usize, points: &[[f64; 3]]) -> Result<()> {
    for (node, point) in rom.contact_nodes[first..].iter().zip(points) {
        let (own, wanted) = (node.position[0], libm::hypot(point[0], point[1]));
        if (own - wanted).abs() > SAME_RADIUS * wanted {
            return Err(Error::invalid(
                format!("ROM `{}`", rom.name),
                format!(
                    "node `{}` has a radius of {own:.4e} m, but the tip contour and the gap require {wanted:.4e} m",
                    node.name
                ),
                "Use the casing that belongs to this rotor, in metres",
            ));
        }
    }
    Ok(())
}

/// Tip contour r(z) through the contact nodes: natural cubic spline through three or more, straight line through fewer and beyond the ends.
struct TipContour {
    /// (z, r, r''), ascending in z.
    points: Vec<(f64, f64, f64)>,
    /// dr/dz if there is a single point.
    slope: f64,
}

impl TipContour {
    fn new(rom: &Rom, nodes: &[usize]) -> Self {
        let places: Vec<[f64; 3]> = nodes.iter().map(|node| rom.contact_nodes[*node].position).collect();
        let axial: Vec<f64> = places.iter().map(|place| place[2]).collect();
        let point = |index: usize| (places[index][2], places[index][0], 0.0);
        let mut points: Vec<(f64, f64, f64)> = argsort(&axial).into_iter().map(point).collect();
        let apart = 1e-9 * points[0].1;
        points.dedup_by(|a, b| (a.0 - b.0).abs() < apart);
        second_derivatives(&mut points);
        Self { points, slope: rom.contact_nodes[nodes[0]].meridional_slope }
    }

    fn extent(&self) -> [f64; 2] {
        [self.points[0].0, self.points[self.points.len() - 1].0]
    }

    /// Extent of a surface beyond the nodes (m).
    fn margin(&self) -> f64 {
        let [first, last] = self.extent();
        (MARGIN_OF_EXTENT * (last - first)).max(MARGIN_OF_RADIUS * self.points[0].1)
    }

    fn radius(&self, z: f64) -> f64 {
        let [first, last] = self.extent();
        if self.points.len() == 1 {
            return self.points[0].1 + self.slope * (z - first);
        }
        let inside = z.clamp(first, last);
        let upper = self.points.iter().position(|point| inside <= point.0).unwrap_or(1).max(1);
        let (a, b) = (self.points[upper - 1], self.points[upper]);
        let length = b.0 - a.0;
        let t = (inside - a.0) / length;
        let bend = |t: f64| t * t * t - t;
        let value = (1.0 - t) * a.1 + t * b.1 + length * length / 6.0 * (bend(1.0 - t) * a.2 + bend(t) * b.2);
        let slope = (b.1 - a.1) / length
            + length / 6.0 * ((3.0 * t * t - 1.0) * b.2 - (3.0 * (1.0 - t) * (1.0 - t) - 1.0) * a.2);
        value + slope * (z - inside)
    }
}

/// Computes the natural cubic spline by the tridiagonal (Thomas) recurrence.
fn second_derivatives(points: &mut [(f64, f64, f64)]) {
    let count = points.len();
    let mut upper = vec![0.0; count];
    for i in 1..count.saturating_sub(1) {
        let (low, high) = (points[i].0 - points[i - 1].0, points[i + 1].0 - points[i].0);
        let right = 6.0 * ((points[i + 1].1 - points[i].1) / high - (points[i].1 - points[i - 1].1) / low);
        let pivot = 2.0 * (low + high) - low * upper[i - 1];
        upper[i] = high / pivot;
        points[i].2 = (right - low * points[i - 1].2) / pivot;
    }
    for i in (1..count.saturating_sub(1)).rev() {
        points[i].2 -= upper[i] * points[i + 1].2;
    }
}
