//! A structure that carries surfaces, over the steps of the sectors that touch them.

use crate::dynamics::bank::ModalBank;
use crate::galerkin::basis::POINTS;
use crate::galerkin::compliance::Lanes;
use crate::galerkin::whole::{Coordinates, Whole};
use crate::galerkin::trial::Kind;
use crate::gaps::frame::Frame;
use crate::gaps::surface_spline::{ClosestPoint, SurfaceSpline};
use crate::settings::Scheme;
use crate::system::Carrier;

/// A place on a surface, as the node sees it that touches there.
#[derive(Debug, Clone, Copy)]
pub struct Spot<'a> {
    /// The surface, and where it is carried.
    pub surface: (&'a SurfaceSpline, Carrier),
    /// The place.
    pub place: ClosestPoint,
    /// Directions of the node.
    pub frame: Frame,
}

/// Tables, state and scratch of such a structure.
#[derive(Debug, Clone)]
pub struct Casing {
    /// Which structure.
    pub structure: usize,
    /// Its modes.
    pub whole: Whole,
    /// `[row][mode]` of the rows that move control points.
    shapes: Vec<f64>,
    /// Displacements of these rows at the points of the step (m), and velocities at its start (m/s).
    moved: [Vec<f64>; POINTS],
    velocity: Vec<f64>,
    /// Of each point of the step taken: what forces there work on, Σ_k S_ik of the displacements (m).
    worked: [Vec<f64>; POINTS],
    /// δ² per squared impulse on each mode: ½ mean φ²/ω².
    error_form: Vec<f64>,
    impulses: Vec<f64>,
    /// Modes as each lane sees them along x, y, z of its node, and along its normal; lanes that face this structure.
    seen: [Vec<f64>; 3],
    along: Vec<f64>,
    facing: Vec<bool>,
    /// Modes under a unit of λ of one lane.
    force: Vec<f64>,
}

impl Casing {
    /// With polynomials of degree `degree`, seen by sectors of at most so many lanes.
    pub fn new(structure: usize, bank: &ModalBank, degree: usize, lanes: Lanes) -> Self {
        let coordinates = coordinates(bank);
        let (modes, rows) = (bank.modes(), bank.rows());
        let shapes: Vec<f64> = (0..rows).flat_map(|row| bank.contact_row(row).to_vec()).collect();
        let lowest = coordinates.frequencies.iter().copied().filter(|w| *w > 0.0).fold(f64::INFINITY, f64::min);
        #[expect(clippy::cast_precision_loss, reason = "some hundreds of rows")]
        let of_mode = |mode: usize| {
            let square: f64 = (0..rows).map(|row| shapes[row * modes + mode].powi(2)).sum();
            0.5 * coordinates.inertia[mode] * square / rows as f64 / coordinates.frequencies[mode].max(lowest).powi(2)
        };
        Self {
            error_form: (0..modes).map(of_mode).collect(),
            structure,
            shapes,
            moved: std::array::from_fn(|_| vec![0.0; rows]),
            velocity: vec![0.0; rows],
            worked: std::array::from_fn(|_| vec![0.0; rows]),
            impulses: vec![0.0; modes],
            seen: std::array::from_fn(|_| vec![0.0; lanes.len() * modes]),
            along: vec![0.0; lanes.len() * modes],
            facing: vec![false; lanes.len()],
            force: vec![0.0; modes],
            whole: if bank.is_loaded() { Whole::new(coordinates, degree).loaded() } else { Whole::new(coordinates, degree) },
        }
    }

    /// Displacements of the rows at a point of the step (m).
    pub fn moved(&self, point: usize) -> &[f64] {
        &self.moved[point]
    }

    /// The rows at the points `points` of the step, under the forces set there.
    pub fn recover(&mut self, points: std::ops::RangeInclusive<usize>) {
        for point in points {
            rows_of(&self.shapes, self.whole.at(point), &mut self.moved[point]);
        }
    }

    /// Velocities of the rows at the start of the step.
    pub fn find_velocity(&mut self) {
        rows_of(&self.shapes, self.whole.velocity(), &mut self.velocity);
    }

    /// Velocity of a place at the start of the step (m/s), in the directions of the node.
    pub fn velocity_at(&self, spot: Spot) -> [f64; 3] {
        at(spot, &self.velocity)
    }

    /// What a force at point i of the step works on there (m), in the directions of the node.
    pub fn worked_at(&self, spot: Spot, i: usize) -> [f64; 3] {
        at(spot, &self.worked[i])
    }

    /// Weigh displacements at the points for the work of forces there, with the weights of point i.
    pub fn weigh(&mut self, points: usize, weights: impl Fn(usize) -> [f64; POINTS]) {
        for i in 0..=points {
            let weights = weights(i);
            let Self { worked, moved, .. } = self;
            for (row, worked) in worked[i].iter_mut().enumerate() {
                *worked = (0..=points).map(|k| weights[k] * moved[k][row]).sum();
            }
        }
    }

    /// The reaction to a force on a node at a place, at point i.
    pub fn react(&mut self, spot: Spot, i: usize, force: [f64; 3]) {
        add_transposed(&self.shapes, spot, force.map(|f| -f), self.whole.forces_mut(i));
    }

    /// Forget impulses, or add one on a node at a place (N·s).
    pub fn clear_impulses(&mut self) {
        self.impulses.fill(0.0);
    }

    /// See [`Casing::clear_impulses`].
    pub fn add_impulse(&mut self, spot: Spot, impulse: [f64; 3]) {
        add_transposed(&self.shapes, spot, impulse, &mut self.impulses);
    }

    /// The displacement that these leave (m).
    pub fn error(&self) -> f64 {
        self.impulses.iter().zip(&self.error_form).map(|(impulse, form)| impulse * impulse * form).sum::<f64>().sqrt()
    }

    /// No lane faces it yet.
    pub fn look_away(&mut self) {
        self.facing.fill(false);
    }

    /// A lane of the sector that is solved faces a place, with this normal.
    pub fn look(&mut self, lane: usize, spot: Spot, normal: [f64; 3]) {
        let modes = self.force.len();
        self.facing[lane] = true;
        let Self { seen, shapes, along, .. } = self;
        let window = lane * modes..(lane + 1) * modes;
        for (component, seen) in seen.iter_mut().enumerate() {
            let mut unit = [0.0; 3];
            unit[component] = 1.0;
            let seen = &mut seen[window.clone()];
            seen.fill(0.0);
            add_transposed(shapes, spot, unit, seen);
        }
        let [x, y, z] = seen.each_ref().map(|seen| &seen[window.clone()]);
        for (mode, along) in along[window.clone()].iter_mut().enumerate() {
            *along = normal[0] * x[mode] + normal[1] * y[mode] + normal[2] * z[mode];
        }
    }

    /// By how much it gives way at all lanes (m, along their normals) per λ of one with the force `direction` per λ: added to `given`.
    pub fn give(
        &mut self,
        (level, kind): (usize, Kind),
        lanes: Lanes,
        lane: usize,
        direction: [f64; 3],
        given: &mut [f64],
    ) {
        if !self.facing[lane] {
            return;
        }
        let modes = self.force.len();
        let [x, y, z] = self.seen.each_ref().map(|seen| &seen[lane * modes..][..modes]);
        let (k, _) = lanes.place(lane);
        let (influence, coordinates) = (self.whole.influence(level), self.whole.coordinates());
        for i in 1..=lanes.points {
            for (mode, force) in self.force.iter_mut().enumerate() {
                let by = &influence[mode];
                let inert = coordinates.inertia[mode]
                    * if kind == Kind::Constant { by.constant } else { by.points[i - 1][k] };
                let soft = if i == k { coordinates.softness[mode] } else { 0.0 };
                *force = (inert + soft) * (direction[0] * x[mode] + direction[1] * y[mode] + direction[2] * z[mode]);
            }
            for node in (0..lanes.nodes).filter(|node| self.facing[lanes.at(i, *node)]) {
                let other = lanes.at(i, node);
                let along = &self.along[other * modes..][..modes];
                given[other] += along.iter().zip(&self.force).map(|(along, force)| along * force).sum::<f64>();
            }
        }
    }
}

/// Modes of a structure that carries surfaces.
pub fn coordinates(bank: &ModalBank) -> Coordinates {
    let model = bank.model();
    let dynamic = model.dynamic_modes(Scheme::Galerkin);
    Coordinates::new(&model.frequencies, &model.damping_ratios, dynamic)
}

fn rows_of(shapes: &[f64], coordinates: &[f64], rows: &mut [f64]) {
    for (row, shape) in rows.iter_mut().zip(shapes.chunks_exact(coordinates.len())) {
        *row = shape.iter().zip(coordinates).map(|(shape, q)| shape * q).sum();
    }
}

/// Values of rows at a place, in the directions of the node.
fn at(spot: Spot, rows: &[f64]) -> [f64; 3] {
    let (surface, carrier) = spot.surface;
    let mut sum = [0.0; 3];
    for (index, weight) in surface.weights(spot.place).iter() {
        for (component, sum) in sum.iter_mut().enumerate() {
            *sum += weight * rows[carrier.first_row + 3 * index + component];
        }
    }
    spot.frame.local(sum)
}

/// Forces on modes by one at a place, in the directions of the node, added to `modal`.
fn add_transposed(shapes: &[f64], spot: Spot, force: [f64; 3], modal: &mut [f64]) {
    let ((surface, carrier), modes) = (spot.surface, modal.len());
    let fixed = spot.frame.fixed(force);
    for (index, weight) in surface.weights(spot.place).iter() {
        for (component, force) in fixed.iter().enumerate() {
            let shapes = &shapes[(carrier.first_row + 3 * index + component) * modes..][..modes];
            modal.iter_mut().zip(shapes).for_each(|(sum, shape)| *sum += weight * force * shape);
        }
    }
}
