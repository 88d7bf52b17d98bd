//! Rods with adaptive steps: a sector against a fixed obstacle, integrated without a scene.
//!
//! The effect of constant loads without contact is known: static displacement, and a parabola of rigid motion. The rest
//! has no loads.

use nalgebra::{DMatrix, DVector};
use tiprub_core::contact::ContactParameters;
use tiprub_core::geometry::{Gap, Sliding, Vector3};
use tiprub_core::modes::coordinates::ContactModes;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::method::Scheme;
use tiprub_core::system::Effort;
use tiprub_core::time::galerkin::{
    island::Island,
    level::StepTables,
    span::StepGoal,
    state::SectorState,
    surroundings::{AcceptedStep, CarriersInStep, Surroundings, Witness},
    tables::Tables,
    trial::{ForceInterpolation, Obstacle, SlidingState},
};

use super::{
    rods::{CoreRod, NORMAL},
    run::{StepExtremes, TimedRun},
};

/// Gaps count as closed within this fraction of the tolerance, and within the rounding of lengths (m).
const PRECISION: [f64; 2] = [1e-4, 1e-15];
/// Number of points of a step.
const POINTS: usize = 4;

/// The obstacle, and a record of its contacts.
struct RigidObstacle {
    gap: f64,
    /// Displacement of the contact by loads alone: initial value (m), and its acceleration (m/s²).
    loaded: [f64; 2],
    /// Start and length of the span (s).
    span: [f64; 2],
    times: [f64; POINTS],
    seen: StepExtremes,
}

impl RigidObstacle {
    fn gap_at(&self, time: f64, moved: f64) -> f64 {
        self.gap - (moved + self.loaded[0] + 0.5 * self.loaded[1] * time * time)
    }
}

impl Obstacle for &mut RigidObstacle {
    fn gap(&mut self, _: usize, point: usize, moved: Vector3) -> Gap {
        Gap { distance: self.gap_at(self.times[point], moved[0]), normal: NORMAL, ..Gap::NOTHING }
    }

    fn parameters(&self, _: usize) -> &ContactParameters {
        &ContactParameters::FRICTIONLESS
    }

    fn sliding(&mut self, _: usize, _: usize, _: &SlidingState) -> Sliding {
        Sliding::default()
    }

    fn sector(&self) -> usize {
        0
    }

    fn angle(&self, _: usize, _: usize, _: Vector3) -> f64 {
        0.0
    }
}

impl Surroundings for RigidObstacle {
    type Surfaces<'a> = &'a mut Self;

    fn surfaces<'a>(&'a mut self, _: usize, _: CarriersInStep<'a>) -> &'a mut Self {
        self
    }
}

impl Witness for &mut RigidObstacle {
    fn begin_step(&mut self, from: f64, length: f64, level: &StepTables, kind: ForceInterpolation) {
        for (point, time) in self.times.iter_mut().enumerate() {
            let theta = match kind {
                ForceInterpolation::Constant => f64::from(u8::from(point > 0)),
                ForceInterpolation::Polynomial => level.basis.points.get(point).copied().unwrap_or(1.0),
            };
            *time = self.span[0] + self.span[1] * (from + length * theta);
        }
    }

    fn is_clear(&self, _: f64, _: f64, _: &[f64]) -> bool {
        false
    }

    fn record_damping(&mut self, _: f64) {}

    fn record_step(&mut self, step: &AcceptedStep) {
        let length = step.level.step;
        for point in 0..=step.trial.points() {
            let force = step.trial.multiplier(point, 0);
            let weight = match step.kind {
                ForceInterpolation::Constant => f64::from(u8::from(point == 1)),
                ForceInterpolation::Polynomial => step.level.basis.weights[point],
            };
            self.seen.impulse += weight * length * force;
            self.seen.adhesion = self.seen.adhesion.min(force);
            if force != 0.0 {
                self.seen.last_force = self.times[point];
            }
            if point > 0 {
                self.seen.penetration = self.seen.penetration.max(-step.trial.gap(point, 0));
            }
        }
    }
}

/// A run of a rod.
pub(crate) struct RodMarch<'a> {
    rod: &'a CoreRod,
    dynamic: usize,
    island: Island,
    ground: RigidObstacle,
    goal: StepGoal,
    effort: Effort,
}

impl<'a> RodMarch<'a> {
    /// Creates a run in spans of `interval` (s), with `tolerance` relative to the reference length of the rod.
    pub(crate) fn new(rod: &'a CoreRod, interval: f64, tolerance: f64, perturbation: f64) -> Self {
        let model = &rod.model;
        let dynamic = model.dynamic_modes(Scheme::Galerkin);
        let modes = modes_of(model, dynamic);
        let mut island = Island::of_one(Tables::new(modes.clone(), interval));
        island.set_span(interval);
        let state = &mut island.sectors[0].state;
        for mode in 0..dynamic {
            let loaded = rod.loaded(mode, 0.0)[0];
            (state.position[mode], state.velocity[mode]) = (rod.start[0][mode] - loaded, rod.start[1][mode]);
        }
        let seen_by = |mode: usize| model.contact_modes[(0, mode)];
        let loaded = (0..model.len()).map(|mode| seen_by(mode) * rod.loaded(mode, 0.0)[0]).sum();
        let rigid = (0..model.len()).filter(|mode| model.frequencies[*mode] == 0.0);
        let acceleration = rigid.map(|mode| seen_by(mode) * rod.load[mode]).sum();
        let ground = RigidObstacle {
            gap: rod.gap * (1.0 + perturbation),
            loaded: [loaded, acceleration],
            span: [0.0, interval],
            times: [0.0; POINTS],
            seen: StepExtremes::nothing(),
        };
        // A contact that is closed at the start carries the load from then on.
        let moved: f64 = (0..dynamic).map(|mode| seen_by(mode) * state.position[mode]).sum();
        let gap = ground.gap_at(0.0, moved);
        if gap < 0.0 {
            state.multipliers[0] = -gap / modes.residual[(0, 0)];
            state.forces[0] = state.multipliers[0] * NORMAL[0];
        }
        state.gaps[0] = gap.max(0.0);
        state.normals.copy_from_slice(NORMAL.as_slice());
        let tolerance = tolerance * rod.length;
        let precision = (PRECISION[0] * tolerance).max(PRECISION[1] * rod.length);
        Self {
            rod,
            dynamic,
            island,
            ground,
            goal: StepGoal { tolerance, precision, longest: interval, most: u64::MAX },
            effort: Effort::default(),
        }
    }

    fn state(&self) -> &SectorState {
        &self.island.sectors[0].state
    }

    /// Returns modal displacements and velocities, including those by loads and contact forces.
    fn modal(&self) -> [DVector<f64>; 2] {
        let (model, time, state) = (&self.rod.model, self.ground.span[0], self.state());
        let both = |mode: usize| {
            let [moved, speed] = self.rod.loaded(mode, time);
            if mode < self.dynamic {
                return [state.position[mode] + moved, state.velocity[mode] + speed];
            }
            let force: f64 = (0..3).map(|row| model.contact_modes[(row, mode)] * state.forces[row]).sum();
            [moved + force / model.frequencies[mode].powi(2), 0.0]
        };
        [0, 1].map(|of| DVector::from_fn(model.len(), |mode, _| both(mode)[of]))
    }
}

/// Returns the modes with inertia, and the flexibility of the others.
fn modes_of(model: &ModalModel, dynamic: usize) -> ContactModes {
    let mut residual = DMatrix::zeros(3, 3);
    for mode in dynamic..model.len() {
        let shape = model.contact_modes.column(mode);
        residual += shape * shape.transpose() / model.frequencies[mode].powi(2);
    }
    ContactModes {
        frequencies: model.frequencies[..dynamic].to_vec(),
        damping_ratios: vec![0.0; dynamic],
        shapes: model.contact_modes.columns(0, dynamic).into_owned(),
        residual,
    }
}

impl TimedRun for RodMarch<'_> {
    fn advance(&mut self) -> Result<(), String> {
        let Self { island, ground, goal, effort, .. } = self;
        let marched = island.begin(ground, *goal).integrate(effort);
        ground.span[0] += ground.span[1];
        marched.map_err(|stopped| format!("{stopped:?} at t = {} s", ground.span[0]))
    }

    fn watch(&mut self, seen: &mut StepExtremes) -> Result<(), String> {
        self.ground.seen.next();
        self.advance()?;
        *seen = self.ground.seen.clone();
        Ok(())
    }

    fn displacements(&self) -> Vec<f64> {
        let [position, _] = self.modal();
        if self.rod.whole {
            return (&self.rod.model.shapes * position).iter().copied().collect();
        }
        vec![(self.rod.model.contact_modes.row(0) * position)[0]]
    }

    fn energy(&self) -> f64 {
        let ([position, velocity], frequencies) = (self.modal(), &self.rod.model.frequencies);
        let of = |mode: usize| {
            let (q, v) = (position[mode], velocity[mode]);
            0.5 * (v * v + (frequencies[mode] * q).powi(2)) - self.rod.load[mode] * q
        };
        (0..frequencies.len()).map(of).sum()
    }

    fn residual(&self) -> Option<f64> {
        None
    }
}
