//! The released simulation on the cube's scene, with its outputs as a history of the same type as that of the reference
//! methods.

use std::time::{Duration, Instant};

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{Interpolation, SplineSettings};
use tiprub_core::{CoSimulation, Result, Scene, Simulation};
use tiprub_cosim::variables::Quantity;
use tiprub_reference::cube::history::{CubeHistory, processor_time};

use super::CubeFlight;

/// Returns corners 1, 6, 85, 90 and 31, 36, 91, 96 of the paper's figure 2 among the contact nodes of two faces, each a
/// square of `face` nodes.
fn corners(face: usize) -> [usize; 8] {
    let side = face.isqrt();
    let own = [0, side - 1, face - side, face - 1];
    std::array::from_fn(|corner| own[corner % 4] + corner / 4 * face)
}

/// Scheme and solver of the product.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Product {
    pub solver: Solver,
    pub scheme: Scheme,
    /// Largest internal step (s).
    pub step: f64,
    pub interpolation: Interpolation,
}

/// A history, with the results that only the product provides.
#[derive(Debug, Clone)]
pub(crate) struct ProductRun {
    pub history: CubeHistory,
    /// Curvature work at every record (J).
    pub curvature: Vec<f64>,
    /// Largest closure residual of the energy ledger, relative.
    pub residual: f64,
    /// Wall time of the steps.
    pub stepping: Duration,
    pub internal_steps: u64,
}

impl Product {
    /// Runs to `end` (s), with one record per communication step of `record` (s).
    ///
    /// # Errors
    /// A scene or a state that is rejected.
    pub(super) fn run(&self, scene: &Scene, flight: &CubeFlight, end: f64, record: f64) -> Result<ProductRun> {
        let started = processor_time();
        let mut simulation = Simulation::new(self.scene(scene, flight))?;
        simulation.initialise(0.0)?;
        let columns = Columns::new(&simulation, scene.roms[0].contact_nodes.len() / 2);
        let mut run = ProductRun {
            history: CubeHistory { method: "product".into(), step: self.step, ..CubeHistory::default() },
            curvature: Vec::new(),
            residual: 0.0,
            stepping: Duration::ZERO,
            internal_steps: 0,
        };
        let prepared = processor_time();
        columns.record(&simulation, 0.0, &mut run)?;
        let mut index = 0_u32;
        while f64::from(index) * record < end * (1.0 - 1e-9) {
            let (from, to) = (f64::from(index) * record, f64::from(index + 1) * record);
            let clock = Instant::now();
            simulation.begin_step(from, to - from)?;
            while !simulation.advance()?.finished {
                run.internal_steps += 1;
            }
            run.internal_steps += 1;
            run.stepping += clock.elapsed();
            columns.record(&simulation, to, &mut run)?;
            index += 1;
        }
        run.history.processor_time = processor_time() - prepared;
        run.history.preparation_time = prepared - started;
        Ok(run)
    }

    fn scene(&self, scene: &Scene, flight: &CubeFlight) -> Scene {
        let mut scene = scene.clone();
        let settings = &mut scene.settings;
        settings.structures[0].velocity = [0.0, -flight.speed, 0.0];
        for contact in &mut settings.contacts {
            (contact.friction, contact.solver) = (flight.friction, self.solver);
        }
        for surface in &mut settings.surfaces {
            let spline = SplineSettings { interpolation: self.interpolation, ..SplineSettings::default() };
            surface.spline = (self.interpolation == Interpolation::Facets).then_some(spline);
        }
        (settings.time.scheme, settings.time.step) = (self.scheme, self.step);
        scene
    }
}

/// First references of the outputs that are recorded.
struct Columns {
    displacement: [u32; 3],
    force: u32,
    velocity: [u32; 3],
    kinetic: u32,
    strain: u32,
    curvature: u32,
    residual: u32,
    /// Number of contact nodes or patches of one face.
    face: usize,
}

impl Columns {
    /// Finds the outputs, all of which exist in the built-in scene.
    fn new(simulation: &Simulation, face: usize) -> Self {
        let first = |quantity| simulation.table().with_quantity(quantity).map_or(0, |variable| variable.reference);
        Self {
            displacement: [0, 1, 2].map(|axis| first(Quantity::NodeDisplacement(axis))),
            force: first(Quantity::NormalForce(0)),
            velocity: [0, 1, 2].map(|axis| first(Quantity::CentreVelocity(axis))),
            kinetic: first(Quantity::KineticEnergy),
            strain: first(Quantity::StrainEnergy),
            curvature: first(Quantity::CurvatureWork),
            residual: first(Quantity::EnergyResidualRelative),
            face,
        }
    }

    fn record(&self, simulation: &Simulation, time: f64, run: &mut ProductRun) -> Result<()> {
        let element = |reference: u32, node: usize| simulation.real((reference..).nth(node).unwrap_or(reference));
        let history = &mut run.history;
        let forces: Vec<f64> = (0..2 * self.face).map(|node| element(self.force, node)).collect::<Result<_>>()?;
        let (left, right) = forces.split_at(self.face);
        let places = corners(self.face);
        let mut corners = [[0.0; 3]; 8];
        for (corner, node) in corners.iter_mut().zip(places) {
            for (value, reference) in corner.iter_mut().zip(self.displacement) {
                *value = element(reference, node)?;
            }
        }
        let mut velocity = [0.0; 3];
        for (value, reference) in velocity.iter_mut().zip(self.velocity) {
            *value = simulation.real(reference)?;
        }
        history.times.push(time);
        history.corners.push(corners);
        history.corner_forces.push(places.map(|node| forces[node]));
        history.forces.push([left.iter().sum(), right.iter().sum()]);
        history.kinetic.push(simulation.real(self.kinetic)?);
        history.strain.push(simulation.real(self.strain)?);
        history.velocity.push(velocity);
        history.penetration.push(simulation.system().gaps().fold(0.0, |most: f64, gap| most.max(-gap)));
        run.curvature.push(simulation.real(self.curvature)?);
        run.residual = run.residual.max(simulation.real(self.residual)?.abs());
        Ok(())
    }
}
