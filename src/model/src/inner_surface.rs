//! Inner surface of a casing mesh: points and parts of it, evaluated with the shape functions of its faces.
//!
//! Contact grids and thermal patches are at given angles and axial positions, independent of the nodes of the mesh. A
//! point of a grid is the place on a face with its angle and axial position. Its displacement is that of the face
//! there, Σ N_i u_i, and a force on it is distributed to the nodes of the face with the same weights N_i. So the work
//! is the same on both sides, the weights sum to one, and rigid motions, forces and moments are exact. Patches are
//! cut out of the faces along their borders, so that the heat of every patch stays within it.

use core::f64::consts::{PI, TAU};
use std::collections::{BTreeMap, BTreeSet, HashMap};

use tiprub_cosim::ThermalPatch;

use crate::mesh::{Element, Mesh};
use crate::patches::{face_points, on_face, points_between};
use crate::{Error, Result};

/// A face faces the axis if its normal is within 45 degrees of that direction.
const INWARD: f64 = -core::f64::consts::FRAC_1_SQRT_2;
/// Tolerance of equal angles as a fraction of a turn, and of equal axial positions as a fraction of the length of a
/// face.
const SAME: f64 = 1e-9;
/// A point coincides with a node if its weight there is closer to one than this.
const AT_NODE: f64 = 1e-9;
/// Weights below this value are rounding errors.
const ROUNDING: f64 = 1e-14;
/// Largest distance of the centre of the inner surface from the axis, as a fraction of the radius.
const OFF_AXIS: f64 = 0.01;
/// Newton steps for a place on a face; planar faces need one.
const STEPS: usize = 30;
/// Secant steps for the intersection of a border with an edge of a part of a face.
const BORDER_STEPS: usize = 6;
/// Gauss-Legendre points and weights on 0 to 1.
const GAUSS_3: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

const WHAT: &str = "inner surface of the casing";

/// Face of an element: number of the element, local numbers of the corners.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InnerFace {
    pub(crate) element: usize,
    pub(crate) corners: &'static [usize],
}

/// Point of the inner surface.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfacePoint {
    /// Nodes and their weights, which sum to one; a single node if the point coincides with it.
    pub weights: Vec<(usize, f64)>,
    /// Position (x, y, z) in m.
    pub position: [f64; 3],
}

/// Part of a face that lies in a patch.
enum CoveredFace {
    Nothing,
    Whole,
    /// Triangles, by the natural coordinates of their corners.
    Triangles(Vec<[[f64; 3]; 3]>),
}

/// Returns the faces that belong to one element only, in the order of elements.
pub(crate) fn outer_faces(mesh: &Mesh) -> Vec<InnerFace> {
    let key = |element: &Element, corners: &[usize]| {
        let mut nodes: Vec<usize> = corners.iter().map(|&corner| element.nodes[corner]).collect();
        nodes.sort_unstable();
        nodes
    };
    let mut count: HashMap<Vec<usize>, usize> = HashMap::new();
    let all = || {
        mesh.elements.iter().enumerate().flat_map(|(number, element)| {
            element.kind.faces().iter().map(move |&corners| (InnerFace { element: number, corners }, element))
        })
    };
    all().for_each(|(face, element)| *count.entry(key(element, face.corners)).or_default() += 1);
    all().filter(|(face, element)| count[&key(element, face.corners)] == 1).map(|(face, _)| face).collect()
}

impl InnerFace {
    pub(crate) fn corner_nodes(&self, mesh: &Mesh) -> Vec<usize> {
        self.corners.iter().map(|&corner| mesh.elements[self.element].nodes[corner]).collect()
    }

    pub(crate) fn corner_positions(&self, mesh: &Mesh) -> Vec<[f64; 3]> {
        self.corner_nodes(mesh).into_iter().map(|node| mesh.nodes[node]).collect()
    }

    /// Returns whether the normal, counter-clockwise seen from outside, points towards the axis.
    pub(crate) fn looks_inward(&self, mesh: &Mesh) -> bool {
        let corners = self.corner_positions(mesh);
        let edge = |to: usize| -> [f64; 3] { core::array::from_fn(|i| corners[to][i] - corners[0][i]) };
        let ([ax, ay, az], [bx, by, bz]) = (edge(1), edge(corners.len() - 1));
        let [x, y, z] = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
        let middle = [0, 1].map(|i| corners.iter().map(|corner| corner[i]).sum::<f64>());
        let size = x.hypot(y).hypot(z) * middle[0].hypot(middle[1]);
        x * middle[0] + y * middle[1] < INWARD * size
    }

    /// Visits the points of a rule with the shape functions of the element and the area.
    pub(crate) fn integrate(&self, mesh: &Mesh, mut visit: impl FnMut(&[f64], f64)) {
        let element: &Element = &mesh.elements[self.element];
        let coordinates = mesh.coordinates(element);
        for (point, share) in face_points(element.kind, self.corners, GAUSS_3.to_vec()) {
            let (shape, area, _) = on_face(element.kind, &coordinates, point);
            visit(&shape, area * share);
        }
    }

    /// Integrates over the part of the face within a patch. The parts in patches that fill the surface fill the face.
    pub(crate) fn integrate_within(&self, mesh: &Mesh, patch: &ThermalPatch, mut visit: impl FnMut(&[f64], f64)) {
        let triangles = match self.part(mesh, patch) {
            CoveredFace::Nothing => return,
            CoveredFace::Whole => return self.integrate(mesh, visit),
            CoveredFace::Triangles(triangles) => triangles,
        };
        let element = &mesh.elements[self.element];
        let coordinates = mesh.coordinates(element);
        for [a, b, c] in triangles {
            // The third and the fourth corner of a triangle coincide: its sides degenerate, its area does not.
            for (point, share) in points_between([a, b, c, c], GAUSS_3.to_vec()) {
                let (shape, area, _) = on_face(element.kind, &coordinates, point);
                visit(&shape, area * share);
            }
        }
    }

    /// Returns whether part of the face lies in a patch.
    pub(crate) fn meets(&self, mesh: &Mesh, patch: &ThermalPatch) -> bool {
        !matches!(self.part(mesh, patch), CoveredFace::Nothing)
    }

    fn part(&self, mesh: &Mesh, patch: &ThermalPatch) -> CoveredFace {
        let element = &mesh.elements[self.element];
        let coordinates = mesh.coordinates(element);
        let corners = self.corner_positions(mesh);
        let middle = corners.iter().fold([0.0; 2], |[x, y], corner| [x + corner[0], y + corner[1]]);
        let middle = middle[1].atan2(middle[0]);
        // Angle from the middle of the face, and axial position.
        let place = |[x, y, z]: [f64; 3]| [wrapped(y.atan2(x) - middle), z];
        let places: Vec<[f64; 2]> = corners.iter().map(|&corner| place(corner)).collect();
        let width = patch.angle[1] - patch.angle[0];
        let extent = |axis: usize| {
            let values = places.iter().map(|place| place[axis]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        };
        let spans = [0, 1].map(extent);
        let slacks = [SAME * TAU, SAME * (spans[1][1] - spans[1][0])];
        let start = wrapped(patch.angle[0] - middle);
        // A patch around the whole circumference has no border; any other may begin on either side of the face.
        let turns: &[f64] = if width > TAU * (1.0 - SAME) { &[f64::NAN] } else { &[0.0, -TAU] };
        let mut triangles = Vec::new();
        for turn in turns {
            let angular =
                if turn.is_nan() { [f64::NEG_INFINITY, f64::INFINITY] } else { [start + turn, start + turn + width] };
            let window = [angular, patch.axial];
            let inside = |axis: usize| {
                spans[axis][0] >= window[axis][0] - slacks[axis] && spans[axis][1] <= window[axis][1] + slacks[axis]
            };
            let beside = |axis: usize| {
                spans[axis][1] <= window[axis][0] + slacks[axis] || spans[axis][0] >= window[axis][1] - slacks[axis]
            };
            if inside(0) && inside(1) {
                return CoveredFace::Whole;
            }
            if beside(0) || beside(1) {
                continue;
            }
            let at = |natural: [f64; 3]| {
                let shape = element.kind.shape(natural);
                place(core::array::from_fn(|i| coordinates.iter().zip(shape.values).map(|(x, n)| x[i] * n).sum()))
            };
            let mut polygon: Vec<[f64; 3]> =
                self.corners.iter().map(|&corner| element.kind.natural_nodes()[corner]).collect();
            for axis in [0, 1] {
                polygon = clipped(&polygon, |natural| at(natural)[axis] - window[axis][0]);
                polygon = clipped(&polygon, |natural| window[axis][1] - at(natural)[axis]);
            }
            triangles.extend((2..polygon.len()).map(|i| [polygon[0], polygon[i - 1], polygon[i]]));
        }
        if triangles.is_empty() { CoveredFace::Nothing } else { CoveredFace::Triangles(triangles) }
    }

    /// Returns the place on the face at an angle and an axial position, or the nearest to it: shape functions of the
    /// element, position, distance (m).
    fn foot(&self, mesh: &Mesh, angle: f64, axial: f64) -> Option<(Vec<f64>, [f64; 3], f64)> {
        let element = &mesh.elements[self.element];
        let coordinates = mesh.coordinates(element);
        let (sin, cos) = angle.sin_cos();
        // Offsets along the circumference and along the axis from the requested place.
        let off = |[x, y, z]: [f64; 3]| [y * cos - x * sin, z];
        let corners = self.corner_positions(mesh);
        let facing = corners.iter().all(|[x, y, _]| x * cos + y * sin > 0.0);
        let near = |axis: usize, target: f64| {
            let values = corners.iter().map(|&corner| off(corner)[axis]);
            let [low, high] =
                values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)]);
            (low - 0.5 * (high - low)..=high + 0.5 * (high - low)).contains(&target)
        };
        if !(facing && near(0, 0.0) && near(1, axial)) {
            return None;
        }
        let natural = |corner: usize| element.kind.natural_nodes()[self.corners[corner]];
        let (origin, last) = (natural(0), self.corners.len() - 1);
        let along = [1, last].map(|corner| -> [f64; 3] { core::array::from_fn(|i| natural(corner)[i] - origin[i]) });
        let at = |[a, b]: [f64; 2]| core::array::from_fn(|i| origin[i] + a * along[0][i] + b * along[1][i]);
        let position = |values: &[f64]| -> [f64; 3] {
            core::array::from_fn(|i| coordinates.iter().zip(values).map(|(x, n)| x[i] * n).sum())
        };
        let mut place = if last == 2 { [1.0 / 3.0; 2] } else { [0.5; 2] };
        for _step in 0..STEPS {
            let shape = element.kind.shape(at(place));
            let rate = |direction: [f64; 3]| {
                let rates = shape.gradients.map(|g| g[0] * direction[0] + g[1] * direction[1] + g[2] * direction[2]);
                off(position(&rates))
            };
            let ([ya, za], [yb, zb], [y, z]) = (rate(along[0]), rate(along[1]), off(position(&shape.values)));
            let (z, determinant) = (z - axial, ya * zb - yb * za);
            if determinant == 0.0 {
                return None;
            }
            let step = [(zb * y - yb * z) / determinant, (ya * z - za * y) / determinant];
            place = [0, 1].map(|i| (place[i] - step[i]).clamp(-1.0, 2.0));
            if step[0].abs().max(step[1].abs()) < 4.0 * f64::EPSILON {
                break;
            }
        }
        let [a, b] = place.map(|x| x.max(0.0));
        let place = if last == 2 { [a, b].map(|x| x / (a + b).max(1.0)) } else { [a, b].map(|x| x.min(1.0)) };
        let shape = element.kind.shape(at(place));
        let position = position(&shape.values);
        let [y, z] = off(position);
        Some((shape.values[..coordinates.len()].to_vec(), position, y.hypot(z - axial)))
    }
}

/// Returns an angle between −π and π.
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// Clips a polygon on the faces of an element to the part where a function is not negative; borders cross its edges
/// where the function is zero.
fn clipped(polygon: &[[f64; 3]], side: impl Fn([f64; 3]) -> f64) -> Vec<[f64; 3]> {
    let sides: Vec<f64> = polygon.iter().map(|&corner| side(corner)).collect();
    let mut kept = Vec::with_capacity(polygon.len() + 2);
    for (i, &corner) in polygon.iter().enumerate() {
        let next = (i + 1) % polygon.len();
        if sides[i] >= 0.0 {
            kept.push(corner);
        }
        if (sides[i] >= 0.0) != (sides[next] >= 0.0) {
            // Start from the same end on both sides of the border, so that both cut at the same place.
            let (from, to) = if sides[i] < 0.0 { (next, i) } else { (i, next) };
            let between = |t: f64| -> [f64; 3] {
                core::array::from_fn(|k| polygon[from][k] + t * (polygon[to][k] - polygon[from][k]))
            };
            let (mut low, mut high) = ((0.0, sides[from]), (1.0, sides[to]));
            let mut t = 0.0;
            for _step in 0..BORDER_STEPS {
                t = low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1);
                let value = side(between(t));
                if value >= 0.0 { low = (t, value) } else { high = (t, value) }
            }
            kept.push(between(t));
        }
    }
    kept
}

/// Inner surface of a full ring about the z axis.
#[derive(Debug, Clone)]
pub struct InnerSurface<'a> {
    mesh: &'a Mesh,
    faces: Vec<InnerFace>,
}

/// Border of a surface.
struct Border {
    /// Signed number of turns around the axis.
    turns: f64,
    /// Nodes, ascending.
    nodes: Vec<usize>,
    /// Means of x and y along the border (m).
    middle: [f64; 2],
}

impl<'a> InnerSurface<'a> {
    /// Finds the inner surface: the outer faces whose corners are all in the `set` (all nodes if absent) and whose
    /// normals are within 45 degrees of the direction to the axis, as far as they are connected by edges and lie
    /// between the axial positions (m; everywhere if absent).
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no such face, there are several surfaces, or the surface is not a full ring
    /// about the z axis or has gaps between the axial positions.
    pub fn find(mesh: &'a Mesh, set: Option<&[usize]>, axial: Option<[f64; 2]>) -> Result<Self> {
        let mut chosen = vec![set.is_none(); mesh.nodes.len()];
        set.into_iter().flatten().for_each(|&node| chosen[node] = true);
        let within = |face: &InnerFace| face.corner_nodes(mesh).iter().all(|&node| chosen[node]);
        let named: Vec<InnerFace> = outer_faces(mesh).into_iter().filter(within).collect();
        let inner: Vec<InnerFace> = named.iter().copied().filter(|face| face.looks_inward(mesh)).collect();
        let [from, to] = axial.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let pieces: Vec<Self> = pieces(mesh, &inner).into_iter().map(|faces| Self { mesh, faces }).collect();
        let mut there: Vec<Self> =
            pieces.into_iter().filter(|piece| piece.axial()[0] < to && piece.axial()[1] > from).collect();
        if there.is_empty() {
            let problem = match (named.is_empty(), inner.is_empty()) {
                (true, _) => "no outer face of the mesh has all of its corner nodes in the set".to_owned(),
                (_, true) => {
                    format!("none of the {} outer faces points towards the z axis to within 45 degrees", named.len())
                }
                _ => format!("no face directed towards the axis lies between z = {from:.6} m and {to:.6} m"),
            };
            let remedy =
                "Give the set of all nodes of the inner surface (--contact-set), and check --axis and axial positions";
            return Err(Error::invalid(WHAT, problem, remedy));
        }
        // Walls of holes partly face the axis; only a named set must be used as a whole.
        if set.is_none() && there.iter().any(Self::is_ring) {
            there.retain(Self::is_ring);
        }
        if there.len() > 1 {
            if !there.iter().any(Self::is_ring) {
                let largest = there.iter().max_by_key(|piece| piece.faces.len());
                largest.map_or(Ok(()), |piece| piece.check([from, to]))?;
            }
            let shown = there.iter().take(4).map(|piece| {
                let ([low, high], radius) = (piece.axial(), piece.radius());
                format!("z = {low:.6} m to {high:.6} m at radius {radius:.6} m")
            });
            let problem =
                format!("there are {} separate surfaces: {}", there.len(), shown.collect::<Vec<_>>().join("; "));
            let remedy = "Give the set of nodes on the surface that faces the blades (--contact-set), or axial \
                          positions within one surface (--contact-axial)";
            return Err(Error::invalid(WHAT, problem, remedy));
        }
        let surface = there.swap_remove(0);
        surface.check([from, to])?;
        Ok(surface)
    }

    /// Returns the first and last axial position of its corners (m).
    pub fn axial(&self) -> [f64; 2] {
        let corners = self.faces.iter().flat_map(|face| face.corner_positions(self.mesh));
        corners.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], [_, _, z]| [low.min(z), high.max(z)])
    }

    /// Returns the mean radius (m), weighted by area.
    pub fn radius(&self) -> f64 {
        let (mut sum, mut whole) = (0.0, 0.0);
        for face in &self.faces {
            let nodes = &self.mesh.elements[face.element].nodes;
            face.integrate(self.mesh, |shape, area| {
                let [x, y] =
                    [0, 1].map(|i| nodes.iter().zip(shape).map(|(&node, n)| n * self.mesh.nodes[node][i]).sum::<f64>());
                sum += area * x.hypot(y);
                whole += area;
            });
        }
        sum / whole
    }

    /// Returns the corner nodes of its faces, ascending.
    pub fn corner_nodes(&self) -> Vec<usize> {
        let nodes: BTreeSet<usize> = self.faces.iter().flat_map(|face| face.corner_nodes(self.mesh)).collect();
        nodes.into_iter().collect()
    }

    /// Returns the point at an angle (rad) and an axial position (m).
    ///
    /// # Errors
    /// [`Error::Invalid`] if the surface is further away than the tolerance (m).
    pub fn point(&self, angle: f64, axial: f64, tolerance: f64) -> Result<SurfacePoint> {
        let feet = self.faces.iter().filter_map(|face| Some((face, face.foot(self.mesh, angle, axial)?)));
        let nearest = feet.min_by(|a, b| a.1.2.total_cmp(&b.1.2));
        let Some((face, (values, position, _))) = nearest.as_ref().filter(|(_, (_, _, miss))| *miss <= tolerance)
        else {
            let ([low, high], degrees) = (self.axial(), angle.to_degrees());
            let distance =
                nearest.map_or_else(|| "far away".to_owned(), |(_, (_, _, miss))| format!("{miss:.2e} m away"));
            let problem = format!(
                "it is {distance} from the grid point at {degrees:.3}° and z = {axial:.6} m, more than the tolerance \
                 of {tolerance:.2e} m; it extends from z = {low:.6} m to {high:.6} m"
            );
            let remedy =
                "Give axial positions on the surface (--contact-axial), or a set of all its nodes (--contact-set)";
            return Err(Error::invalid(WHAT, problem, remedy));
        };
        let nodes = &self.mesh.elements[face.element].nodes;
        let pairs = || nodes.iter().copied().zip(values.iter().copied());
        if let Some((node, _)) = pairs().find(|(_, weight)| *weight > 1.0 - AT_NODE) {
            return Ok(SurfacePoint { weights: vec![(node, 1.0)], position: self.mesh.nodes[node] });
        }
        let weights = pairs().filter(|(_, weight)| weight.abs() > ROUNDING).collect();
        Ok(SurfacePoint { weights, position: *position })
    }

    fn is_ring(&self) -> bool {
        self.borders().iter().filter(|border| border.turns.abs() > 0.5).count() == 2
    }

    fn check(&self, [from, to]: [f64; 2]) -> Result<()> {
        let borders = self.borders();
        if !self.is_ring() {
            let remedy = "Mesh the full ring, merge coincident nodes where its parts meet, and check --axis";
            return Err(Error::invalid(
                WHAT,
                format!("it is not a full ring about the z axis: {}", self.opening(&borders)),
                remedy,
            ));
        }
        let hole = borders.iter().filter(|border| border.turns.abs() <= 0.5).find(|border| {
            let [low, high] = self.extent(&border.nodes, |[_, _, z]| z);
            low < to && high > from
        });
        if let Some(hole) = hole {
            let [low, high] = self.extent(&hole.nodes, |[_, _, z]| z);
            let [x, y] = [0, 1].map(|i| hole.nodes.iter().map(|&node| self.mesh.nodes[node][i]).sum::<f64>());
            let degrees = y.atan2(x).to_degrees().rem_euclid(360.0);
            let problem = format!(
                "it has a hole at {degrees:.3}°, z = {low:.6} m to {high:.6} m, with {} nodes on its edge",
                hole.nodes.len()
            );
            let remedy = "Close the hole in the model, merge coincident nodes, add the missing faces to the set, or \
                          give axial positions clear of the hole (--contact-axial)";
            return Err(Error::invalid(WHAT, problem, remedy));
        }
        // Uses both ends: gaps between them do not move the centre.
        let ends = || borders.iter().filter(|border| border.turns.abs() > 0.5);
        let [x, y] = [0, 1].map(|i| ends().map(|end| end.middle[i]).sum::<f64>() / ends().count() as f64);
        let radius = self.radius();
        if x.hypot(y) > OFF_AXIS * radius {
            let problem = format!(
                "it is not centred on the z axis: its centre is at x = {x:.6} m, y = {y:.6} m, with a mean radius of \
                 {radius:.6} m"
            );
            return Err(Error::invalid(WHAT, problem, "Move the model onto the axis of the engine, or check --axis"));
        }
        Ok(())
    }

    /// Describes where a surface that is not a full ring is open.
    fn opening(&self, borders: &[Border]) -> String {
        // Tenths of a degree that are covered by faces.
        let mut covered = [false; 3600];
        for face in &self.faces {
            let angles: Vec<f64> = face.corner_positions(self.mesh).iter().map(|[x, y, _]| y.atan2(*x)).collect();
            let spans = angles.iter().map(|angle| wrapped(angle - angles[0]));
            let [low, high] = spans.fold([0.0_f64; 2], |[low, high], x| [low.min(x), high.max(x)]);
            let bin = |angle: f64| {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 3600")]
                let bin = (angle.rem_euclid(TAU) / TAU * 3600.0) as usize;
                bin % 3600
            };
            let (mut at, end) = (bin(angles[0] + low), bin(angles[0] + high));
            while at != end {
                covered[at] = true;
                at = (at + 1) % 3600;
            }
            covered[end] = true;
        }
        let degrees = covered.iter().filter(|covered| **covered).count() as f64 / 10.0;
        if degrees < 360.0 {
            let open = (0..3600).find(|&bin| !covered[bin] && covered[(bin + 3599) % 3600]).unwrap_or(0) as f64 / 10.0;
            return format!("its faces cover {degrees:.1}° of 360°, with no face at {open:.1}°");
        }
        let [low, high] = self.axial();
        let middle = borders.iter().flat_map(|border| &border.nodes).min_by(|a, b| {
            let off = |node: usize| (self.mesh.nodes[node][2] - 0.5 * (low + high)).abs();
            off(**a).total_cmp(&off(**b))
        });
        middle.map_or_else(
            || "it has no edge".to_owned(),
            |&node| {
                let [x, y, z] = self.mesh.nodes[node];
                let degrees = y.atan2(x).to_degrees().rem_euclid(360.0);
                format!("its faces are not connected at {degrees:.3}°, z = {z:.6} m")
            },
        )
    }

    fn extent(&self, nodes: &[usize], pick: impl Fn([f64; 3]) -> f64) -> [f64; 2] {
        let values = nodes.iter().map(|&node| pick(self.mesh.nodes[node]));
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    }

    /// Returns the edges that belong to one face only, grouped by connectivity.
    fn borders(&self) -> Vec<Border> {
        let mut counted: BTreeMap<[usize; 2], Option<[usize; 2]>> = BTreeMap::new();
        for [a, b] in self.faces.iter().flat_map(|face| edges(&face.corner_nodes(self.mesh))) {
            counted.entry([a.min(b), a.max(b)]).and_modify(|edge| *edge = None).or_insert(Some([a, b]));
        }
        let open: Vec<[usize; 2]> = counted.into_values().flatten().collect();
        let angle = |node: usize| self.mesh.nodes[node][1].atan2(self.mesh.nodes[node][0]);
        groups(&open.iter().map(|edge| edge.to_vec()).collect::<Vec<_>>())
            .into_iter()
            .map(|group| {
                let turns =
                    group.iter().map(|&edge| wrapped(angle(open[edge][1]) - angle(open[edge][0]))).sum::<f64>() / TAU;
                let mut nodes: Vec<usize> = group.iter().flat_map(|&edge| open[edge]).collect();
                nodes.sort_unstable();
                nodes.dedup();
                let (mut sums, mut length) = ([0.0; 2], 0.0);
                for [a, b] in group.iter().map(|&edge| open[edge].map(|node| self.mesh.nodes[node])) {
                    let part = (a[0] - b[0]).hypot(a[1] - b[1]).hypot(a[2] - b[2]);
                    sums = [0, 1].map(|i| sums[i] + 0.5 * part * (a[i] + b[i]));
                    length += part;
                }
                Border { turns, nodes, middle: sums.map(|sum| sum / length) }
            })
            .collect()
    }
}

fn edges(corners: &[usize]) -> Vec<[usize; 2]> {
    (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]]).collect()
}

/// Groups faces that are connected by edges.
fn pieces(mesh: &Mesh, faces: &[InnerFace]) -> Vec<Vec<InnerFace>> {
    let mut numbers: HashMap<[usize; 2], usize> = HashMap::new();
    let of_face = |face: &InnerFace| {
        let own = edges(&face.corner_nodes(mesh)).into_iter().map(|[a, b]| {
            let next = numbers.len();
            *numbers.entry([a.min(b), a.max(b)]).or_insert(next)
        });
        own.collect()
    };
    let keys: Vec<Vec<usize>> = faces.iter().map(of_face).collect();
    groups(&keys).into_iter().map(|group| group.into_iter().map(|face| faces[face]).collect()).collect()
}

/// Groups items that are connected by common keys, in the order of their first items.
fn groups(keys: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut holders: HashMap<usize, Vec<usize>> = HashMap::new();
    for (item, own) in keys.iter().enumerate() {
        own.iter().for_each(|&key| holders.entry(key).or_default().push(item));
    }
    let (mut seen, mut found) = (vec![false; keys.len()], Vec::new());
    for first in 0..keys.len() {
        let (mut open, mut group) = (vec![first], Vec::new());
        while let Some(item) = open.pop() {
            if !core::mem::replace(&mut seen[item], true) {
                group.push(item);
                open.extend(keys[item].iter().flat_map(|key| &holders[key]));
            }
        }
        group.sort_unstable();
        if !group.is_empty() {
            found.push(group);
        }
    }
    found
}
