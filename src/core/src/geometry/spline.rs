//! Gaps to a surface through data points: closest point, normal, and the place at which the force is transferred.

use tiprub_cosim::persist::{Persist, StateReader, StateWriter};

use super::frame::PolarFrame;
use super::layout::Layout;
use super::surface_spline::{ClosestPoint, Projection, SurfaceSpline};
use super::wrench::{At, MotionIncrement};
use super::{Geometry, PrescribedMotion, dot};

/// Gap of a node without a surface to touch: infinite, so that it is never used as a distance.
pub const NOTHING_TO_TOUCH: f64 = f64::INFINITY;

/// Contact nodes of equally spaced sectors facing a surface spline.
#[derive(Debug, Clone, PartialEq)]
pub struct SplineGap {
    /// Positions of the contact nodes of the structure.
    pub layout: Layout,
    /// Contact nodes that can touch the surface.
    pub nodes: Vec<usize>,
    /// Index of the first data point among the nodes of the contact grid that carries the surface.
    pub first_node: usize,
    /// Clearance at which the data points were placed (m).
    pub nominal_clearance: f64,
    /// The current surface.
    pub surface: SurfaceSpline,
    /// Control points of the round surface (m).
    pub round: Vec<[f64; 3]>,
    /// Displacement of the data points by the shape at factor 1 (m); empty for a round surface.
    pub shape: Vec<[f64; 3]>,
    /// Angle over which the shape changes noticeably (rad).
    pub angular_scale: f64,
    /// Largest change of a control point by the shape at factor 1 (m).
    pub shape_size: f64,
    /// Deviation of a ring through this number of points from a circle (m).
    pub ripple: f64,
    /// Control points in use.
    control: Vec<[f64; 3]>,
    factor: f64,
    /// Revolutions of the rotor over the current step.
    pub turned: f64,
    /// The first node, `node · lanes + lane`, that is beyond the extension of the surface ([`super::surface_spline::REACH`]).
    pub out_of_reach: Option<usize>,
}

impl SplineGap {
    /// Creates the gap function; `surface` is the round one, and `shape` is its change of control points at factor 1, empty if there is
    /// none.
    pub fn new(
        layout: Layout,
        nominal_clearance: f64,
        surface: SurfaceSpline,
        shape: Vec<[f64; 3]>,
        angular_scale: f64,
    ) -> Self {
        let round = surface.control_points().to_vec();
        let largest = shape.iter().fold(0.0, |most: f64, change| most.max(dot(*change, *change)));
        let radius = layout.radii.iter().fold(0.0, |most: f64, radius| most.max(*radius));
        Self {
            shape_size: largest.sqrt(),
            // The sagitta of a facet.
            ripple: 0.125 * radius * surface.spacing() * surface.spacing(),
            nodes: (0..layout.nodes()).collect(),
            first_node: 0,
            layout,
            nominal_clearance,
            surface,
            control: round.clone(),
            round,
            shape,
            angular_scale,
            factor: 0.0,
            turned: 0.0,
            out_of_reach: None,
        }
    }

    /// Moves the control points: shape factor, and displacements `moved` (m, three per control point; empty = rigid).
    pub fn follow(&mut self, factor: f64, moved: &[f64]) {
        if moved.is_empty() && (self.shape.is_empty() || factor.to_bits() == self.factor.to_bits()) {
            return;
        }
        self.factor = factor;
        self.control.copy_from_slice(&self.round);
        for (point, shape) in self.control.iter_mut().zip(&self.shape) {
            for component in 0..3 {
                point[component] += factor * shape[component];
            }
        }
        let (moved, _) = moved.as_chunks::<3>();
        for (point, moved) in self.control.iter_mut().zip(moved) {
            for component in 0..3 {
                point[component] += moved[component];
            }
        }
        self.surface.set_control_points(&self.control);
    }

    /// Computes gaps (m), normals and closest points of all nodes, for the displacements of the contact rows (m) and of the control points.
    /// `guess` contains the closest points of the previous step; with `None` the search starts from the angle. Nodes out of reach have no
    /// surface to touch and are reported by [`SplineGap::out_of_reach`].
    pub fn evaluate(
        &mut self,
        drive: &PrescribedMotion,
        displacement: &[f64],
        moved: &[f64],
        guess: Option<&[ClosestPoint]>,
        geometry: &mut Geometry,
        gap: &mut [f64],
    ) {
        self.follow(drive.shape_factor, moved);
        self.out_of_reach = None;
        let lanes = self.layout.lanes;
        let nodes = self.nodes.iter().flat_map(|node| (0..lanes).map(move |lane| (*node, lane)));
        // Padding lanes are infinitely far away.
        for (node, lane) in nodes.filter(|(_, lane)| self.layout.clearances[*lane].is_finite()) {
            let index = node * lanes + lane;
            let local: [f64; 3] = std::array::from_fn(|component| displacement[(3 * node + component) * lanes + lane]);
            let at = At { node, index, drive };
            let (projection, frame) = self.project(at, local, guess.map(|places| places[index]));
            match projection {
                Projection::Found { place, normal, gap: found, .. } => {
                    gap[index] = found;
                    let normal = frame.local(normal);
                    for component in 0..3 {
                        geometry.normal[component][index] = normal[component];
                    }
                    geometry.places[index] = place;
                }
                Projection::BeyondEdge { place } => {
                    gap[index] = NOTHING_TO_TOUCH;
                    geometry.places[index] = place;
                    self.out_of_reach = self.out_of_reach.or(Some(index));
                }
                // The caller detects this: the model no longer describes such a state.
                Projection::Lost => gap[index] = f64::NAN,
            }
        }
    }

    /// Returns the closest point of a node displaced by `moved` (m), searched from its previous place or from its angle, and the directions
    /// of the node.
    #[inline(always)]
    fn project(&self, at: At<'_>, moved: [f64; 3], guess: Option<ClosestPoint>) -> (Projection, PolarFrame) {
        let angle = self.layout.angles[at.index] + at.drive.rotor_angle - at.drive.shape_rotation;
        let frame = PolarFrame::new(angle);
        let [radial, tangential, axial] = self.shaft_offset(angle, at.drive);
        let arm = self.arm(at.node, at.index % self.layout.lanes, at.drive, moved);
        let place = [arm[0] + radial, arm[1] + tangential, arm[2] + axial];
        let point = frame.fixed(place);
        let start = guess.map_or_else(|| self.surface.locate(point), |place| self.surface.advance(place, self.turned));
        (self.surface.project(point, start), frame)
    }

    /// Replaces the contact nodes by points at other places.
    pub fn of_points(self, layout: Layout) -> Self {
        Self { nodes: (0..layout.nodes()).collect(), layout, ..self }
    }

    /// Gap (m) of one node displaced by `moved` (m) to the current surface; infinite beyond its edges.
    pub fn gap_of_one(&self, at: At<'_>, moved: [f64; 3]) -> f64 {
        match self.project(at, moved, None).0 {
            Projection::Found { gap, .. } => gap,
            Projection::BeyondEdge { .. } => NOTHING_TO_TOUCH,
            Projection::Lost => f64::NAN,
        }
    }

    /// Returns gap (m), unit normal and closest point of one node displaced by `moved` (m); the surface is rigid.
    pub(super) fn gap_of_node(&mut self, at: At<'_>, moved: [f64; 3]) -> (f64, [f64; 3], ClosestPoint) {
        self.follow(at.drive.shape_factor, &[]);
        match self.project(at, moved, None) {
            (Projection::Found { place, normal, gap, .. }, frame) => (gap, frame.local(normal), place),
            (Projection::BeyondEdge { place }, _) => (NOTHING_TO_TOUCH, [-1.0, 0.0, 0.0], place),
            (Projection::Lost, _) => (f64::NAN, [-1.0, 0.0, 0.0], ClosestPoint::default()),
        }
    }

    /// Displacement of the shaft centre along the directions of a node at `angle` from the shape (m).
    fn shaft_offset(&self, angle: f64, drive: &PrescribedMotion) -> [f64; 3] {
        let [x, y, z] = drive.shaft;
        if x == 0.0 && y == 0.0 {
            [0.0, 0.0, z]
        } else {
            PolarFrame::new(angle + drive.shape_rotation).local([x, y, z])
        }
    }

    /// Position of a node displaced by `moved` from the shaft centre (m, own directions); additional clearance, which the surface does not
    /// contain, moves it inwards.
    #[inline(always)]
    pub fn arm(&self, node: usize, lane: usize, drive: &PrescribedMotion, moved: [f64; 3]) -> [f64; 3] {
        let clearance = self.layout.clearances[lane] - self.nominal_clearance + drive.gap_offset + drive.radius_change;
        [self.layout.radii[node] - clearance + moved[0], moved[1], self.layout.axial[node] + moved[2]]
    }

    /// Velocity by the motion of the rotor (m/s) of a node displaced by `moved` (m), in its own directions: Ω × (x − e) + ė.
    pub fn rigid_velocity(&self, node: usize, index: usize, drive: &PrescribedMotion, moved: [f64; 3]) -> [f64; 3] {
        let [outwards, around, _] = self.arm(node, index % self.layout.lanes, drive, moved);
        let [x, y, z] = drive.shaft_velocity;
        let [radial, tangential, axial] =
            if x == 0.0 && y == 0.0 { [0.0, 0.0, z] } else { self.frame(index, drive.rotor_angle).local([x, y, z]) };
        [radial - drive.speed * around, tangential + drive.speed * outwards, axial]
    }

    /// Position of the contact point at `place` from the shaft centre (m), in the directions of the node.
    pub fn contact_arm(&self, index: usize, drive: &PrescribedMotion, place: ClosestPoint) -> [f64; 3] {
        let angle = self.layout.angles[index] + drive.rotor_angle - drive.shape_rotation;
        let point = PolarFrame::new(angle).local(self.surface.evaluate(place).point);
        let shaft = self.shaft_offset(angle, drive);
        std::array::from_fn(|i| point[i] - shaft[i])
    }

    /// Returns the displacement of the surface along `normal` by its prescribed motion (m), at a contact point `arm` from the shaft centre
    /// (m, directions of the node).
    pub fn surface_motion(
        &self,
        at: At<'_>,
        arm: [f64; 3],
        normal: [f64; 3],
        place: ClosestPoint,
        motion: &MotionIncrement,
    ) -> f64 {
        if motion.casing_rests() {
            return 0.0;
        }
        let angle = self.layout.angles[at.index] + at.drive.rotor_angle - at.drive.shape_rotation;
        let mut grown = [0.0; 3];
        if motion.shape_factor != 0.0 && !self.shape.is_empty() {
            for (index, weight) in self.surface.weights(place).iter() {
                grown = std::array::from_fn(|i| grown[i] + motion.shape_factor * weight * self.shape[index][i]);
            }
        }
        let grown = PolarFrame::new(angle).local(grown);
        let shaft = self.shaft_offset(angle, at.drive);
        let turned = [-(arm[1] + shaft[1]), arm[0] + shaft[0], 0.0].map(|arm| motion.shape_rotation * arm);
        normal[0] * motion.opening + dot(normal, grown) + dot(normal, turned)
    }

    /// Angle of the position of a displaced node on the casing (rad), in the fixed frame.
    pub fn angle_on_casing(&self, at: At<'_>, moved: [f64; 3]) -> f64 {
        let angle = self.layout.angles[at.index] + at.drive.rotor_angle;
        let arm = self.arm(at.node, at.index % self.layout.lanes, at.drive, moved);
        let shaft = PolarFrame::new(angle).local(at.drive.shaft);
        angle + libm::atan2(arm[1] + shaft[1], arm[0] + shaft[0])
    }

    /// Radial, tangential and axial directions of a node at a rotor angle (rad), in the fixed frame.
    pub fn frame(&self, index: usize, rotor_angle: f64) -> PolarFrame {
        PolarFrame::new(self.layout.angles[index] + rotor_angle)
    }
}

/// Returns whether a normal in the directions of a node is that of a casing seen from inside, on a flank below 45°.
pub fn faces_inwards(normal: [f64; 3]) -> bool {
    let sideways = dot([0.0, normal[1], normal[2]], [0.0, normal[1], normal[2]]).sqrt();
    sideways <= -normal[0]
}

impl Persist for ClosestPoint {
    fn save(&self, writer: &mut StateWriter) {
        for part in self.patch {
            u64::try_from(part).unwrap_or(u64::MAX).save(writer);
        }
        self.s.save(writer);
        self.t.save(writer);
    }
    fn restore(&mut self, reader: &mut StateReader) {
        for part in &mut self.patch {
            let mut value = 0_u64;
            value.restore(reader);
            *part = usize::try_from(value).unwrap_or(0);
        }
        self.s.restore(reader);
        self.t.restore(reader);
    }
    /// Checks the numbers only: the surface is unknown here.
    fn check(&self, reader: &mut StateReader) {
        let mut place = *self;
        place.restore(reader);
        if !(place.s.is_finite() && place.t.is_finite()) {
            reader.refuse("the surface position of a contact node is not finite");
        }
    }
}
