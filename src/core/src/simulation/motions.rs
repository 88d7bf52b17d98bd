//! Prescribed motion of contact pairs, which follows from inputs and time.

use super::Simulation;
use super::compile::Compiled;
use super::state::SimulationState;
use crate::geometry::PrescribedMotion;
use crate::system::ShapeGrowth;

/// Prescribed motion of every contact pair over an internal step or a free flight.
#[derive(Debug, Clone)]
pub struct Motions {
    /// At the end of the current internal step.
    pub drives: Vec<PrescribedMotion>,
    /// Rotation of the rotor relative to the shape in free flight (rad).
    pub turns: Vec<f64>,
}

impl Motions {
    /// Allocates the motion of a number of pairs.
    pub fn new(pairs: usize) -> Self {
        Self { drives: vec![PrescribedMotion::default(); pairs], turns: vec![0.0; pairs] }
    }

    /// Computes the motion at an offset from the start of the communication step and a time (s).
    pub fn find(&mut self, state: &SimulationState, compiled: &Compiled, point: [f64; 2]) {
        self.drives.iter_mut().enumerate().for_each(|(pair, drive)| *drive = state.drive(compiled, pair, point));
    }
}

impl SimulationState {
    /// Returns the motion of a pair at an offset from the start of the communication step and a time (s).
    pub fn drive(&self, compiled: &Compiled, pair: usize, [offset, time]: [f64; 2]) -> PrescribedMotion {
        let rotor = &self.inputs.rotors[compiled.plan.pairs[pair].body];
        let surface = &self.inputs.pairs[pair];
        PrescribedMotion {
            rotor_angle: rotor.angle.phase(&rotor.speed, offset),
            speed: rotor.speed.at(offset),
            gap_offset: surface.gap_offset.at(offset),
            shape_factor: surface.shape_factor.at(offset) * self.ramp(compiled, pair, time),
            // Exact, so that a rotation by many turns does not cancel the rotor's own.
            shape_rotation: surface.shape_rotation.at(offset) % std::f64::consts::TAU,
            radius_change: surface.radius_change.at(offset),
            shaft: rotor.shaft.map(|input| input.at(offset)).into(),
            shaft_velocity: rotor.shaft.map(|input| input.rate()).into(),
        }
    }

    /// Returns the motion of a pair at an offset from the start of the communication step (s), as if the shape were fully
    /// grown.
    pub(super) fn motion_without_growth(&self, compiled: &Compiled, pair: usize, offset: f64) -> PrescribedMotion {
        let shape_factor = self.inputs.pairs[pair].shape_factor.at(offset);
        PrescribedMotion { shape_factor, ..self.drive(compiled, pair, [offset, self.clock.time]) }
    }

    /// Returns the rotation of the rotor relative to the shape of a pair until an offset (rad).
    pub fn turn(&self, compiled: &Compiled, pair: usize, offset: f64) -> f64 {
        let rotor = &self.inputs.rotors[compiled.plan.pairs[pair].body];
        let shape = &self.inputs.pairs[pair].shape_rotation;
        let total = |offset: f64| rotor.angle.total(&rotor.speed, offset);
        total(offset) - total(0.0) - (shape.at(offset) - shape.at(0.0))
    }

    /// Grown fraction of the casing shape: ½(1 − cos(πt/T)) until T.
    fn ramp(&self, compiled: &Compiled, pair: usize, time: f64) -> f64 {
        let Some(reference) = compiled.references.ramp_times[pair] else { return 1.0 };
        ShapeGrowth::share(time - self.clock.initial_time, self.values[reference])
    }

    /// Returns the growth of the shape of a pair between two points, each an offset and a time (s).
    pub fn growth(&self, compiled: &Compiled, pair: usize, points: [[f64; 2]; 2]) -> ShapeGrowth {
        ShapeGrowth {
            factors: points.map(|[offset, _]| self.inputs.pairs[pair].shape_factor.at(offset)),
            elapsed: points.map(|[_, time]| time - self.clock.initial_time),
            length: compiled.references.ramp_times[pair].map_or(0.0, |reference| self.values[reference]),
        }
    }
}

impl Simulation {
    /// Factor on the casing shape of the first pair at the internal time reached (-), with its ramp.
    ///
    /// # Examples
    /// ```
    /// # use tiprub_core::{CoSimulation, Simulation};
    /// # let scene = tiprub_test_models::rub(2);
    /// # let mut simulation = Simulation::new(&scene)?;
    /// # simulation.initialise(0.0)?;
    /// // The bumps of this casing grow in over the first millisecond.
    /// assert_eq!(simulation.shape_factor(), 0.0);
    /// simulation.do_step(0.0, 1e-3)?;
    /// assert_eq!(simulation.shape_factor(), 1.0);
    /// # Ok::<(), tiprub_core::Error>(())
    /// ```
    pub fn shape_factor(&self) -> f64 {
        let clock = &self.state.clock;
        let time = clock.step.time(clock.step.done);
        self.state.inputs.pairs[0].shape_factor.at(clock.offset_now()) * self.state.ramp(&self.compiled, 0, time)
    }
}
