//! A lane of a trial as its contact law sees it.

use super::{Obstacle, Trial};
use crate::contact::{ContactParameters, ContactPrediction};
use crate::geometry::Sliding;
use crate::math::vector::{Vector3, set_vector3_at, vector3_at};
use crate::time::galerkin::compliance::Lanes;
use crate::time::galerkin::kernels::AddProduct;
use nalgebra::DMatrix;

/// A contact node at a point of the step, before its force is known.
pub(super) struct LanePrediction<'a, O> {
    /// Gap without the force (m).
    pub gap: f64,
    /// True if the last solution of the trial, or the step before, closed the contact.
    pub closed: bool,
    pub normal: Vector3,
    /// Displacement of the node (m).
    pub moved: Vector3,
    /// Slip over the step without the force (m).
    pub slip: Vector3,
    pub sliding: Sliding,
    /// Force of the last solution (N).
    pub last_force: Vector3,
    pub obstacle: &'a O,
    pub point: usize,
    pub node: usize,
}

/// Values of all lanes before a contact problem.
pub(super) struct LaneValues<'a> {
    pub lanes: Lanes,
    /// Gaps without the forces (m).
    pub without: &'a [f64],
    /// Multipliers of the last solution (N).
    pub multipliers: &'a [f64],
    pub normals: &'a [f64],
    /// Displacements (m).
    pub moved: &'a [f64],
}

impl LaneValues<'_> {
    /// Returns the prediction for a lane; slip and sliding are those of a contact that does not slide.
    pub fn prediction<'a, O: Obstacle>(&self, lane: usize, obstacle: &'a O) -> LanePrediction<'a, O> {
        let (point, node) = self.lanes.place(lane);
        LanePrediction {
            gap: self.without[lane],
            closed: self.multipliers[lane] > 0.0,
            normal: self.lanes.vector3(self.normals, lane),
            moved: self.lanes.vector3(self.moved, lane),
            slip: Vector3::zeros(),
            sliding: Sliding::default(),
            last_force: Vector3::zeros(),
            obstacle,
            point,
            node,
        }
    }
}

impl<O: Obstacle> ContactPrediction for LanePrediction<'_, O> {
    fn gap(&self) -> f64 {
        self.gap
    }
    fn was_closed(&self, _depth: f64) -> bool {
        self.closed
    }
    fn normal(&self) -> Vector3 {
        self.normal
    }
    fn parameters(&self) -> &ContactParameters {
        self.obstacle.parameters(self.node)
    }
    fn slip(&self) -> Vector3 {
        self.slip
    }
    fn last_force(&self) -> Vector3 {
        self.last_force
    }
    fn sliding(&self) -> Sliding {
        self.sliding
    }
    fn sector(&self) -> usize {
        self.obstacle.sector()
    }
    fn angle(&self) -> f64 {
        self.obstacle.angle(self.node, self.point, self.moved)
    }
}

impl Trial {
    /// Finds the displacements at the points by the modes with inertia.
    ///
    /// The total displacements are unsuitable: without mass, nodes follow the force back and forth, much faster than they slide.
    pub(super) fn find_inert(&mut self, residual: &DMatrix<f64>) {
        for point in 0..=self.lanes.points {
            for node in 0..self.lanes.nodes {
                let (force, moved) = (self.force(point, node), self.displacement(point, node));
                set_vector3_at(&mut self.withdrawn, node, -force);
                set_vector3_at(&mut self.inert[point], node, moved);
            }
            let y = &mut self.inert[point];
            self.instructions.run(AddProduct { matrix: residual, x: &self.withdrawn, y });
        }
    }

    /// Returns the sliding distance over which a force on a node at a point does work (m).
    pub(super) fn sliding_distance(&self, point: usize, node: usize) -> Vector3 {
        let terms = self.work_weights[point].iter().zip(&self.inert);
        terms.map(|(weight, inert)| *weight * vector3_at(inert, node)).sum()
    }
}
