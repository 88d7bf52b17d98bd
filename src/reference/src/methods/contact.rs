//! Contact between masters and the surface of a ring: gap, frame, weights; relative displacements; forces on the
//! bodies.

use crate::cube::scene::CubeScene;
use crate::surface::{add_scaled, cross, dot, minus, scaled, unit};

/// Displacements, forces or velocities of all dofs of cube, left ring, right ring.
pub(super) type Vectors = [Vec<f64>; 3];

/// Vectors at the masters (left face, then right) and at the carriers of the left and the right ring.
pub(super) type SurfaceVectors = [Vec<[f64; 3]>; 3];

/// Master near or inside a ring.
#[derive(Debug, Clone)]
pub(crate) struct RingContact {
    /// 0 left, 1 right.
    pub side: usize,
    /// Number of the master on its face.
    pub master: usize,
    /// Normal out of the ring and two tangents; the last lies in the plane of z and the normal.
    pub frame: [[f64; 3]; 3],
    /// Carriers of the surface of the ring at the foot, with their weights.
    pub weights: Vec<(usize, f64)>,
    /// Gap (m).
    pub gap: f64,
}

impl RingContact {
    /// Returns the displacement of the master relative to the surface at the foot, in global directions.
    pub(super) fn relative(&self, masters: usize, surface: &SurfaceVectors) -> [f64; 3] {
        let mut difference = surface[0][self.side * masters + self.master];
        for &(carrier, weight) in &self.weights {
            add_scaled(&mut difference, surface[1 + self.side][carrier], -weight);
        }
        difference
    }

    /// Transforms a global vector to the frame.
    pub(super) fn local(&self, vector: [f64; 3]) -> [f64; 3] {
        self.frame.map(|axis| dot(axis, vector))
    }

    /// Transforms a vector of the frame to global directions.
    pub(super) fn global(&self, local: [f64; 3]) -> [f64; 3] {
        let mut vector = [0.0; 3];
        self.frame.iter().zip(local).for_each(|(axis, x)| add_scaled(&mut vector, *axis, x));
        vector
    }
}

/// Extracts the displacements of masters and carriers from those of all dofs.
pub(super) fn surface_of(scene: &CubeScene, vectors: &Vectors) -> SurfaceVectors {
    core::array::from_fn(|index| {
        let body = &scene.bodies[index];
        let take = |&node: &usize| core::array::from_fn(|i| vectors[index][3 * node + i]);
        let nodal: Vec<[f64; 3]> = body.contact.iter().map(take).collect();
        if index == 0 { nodal } else { scene.surfaces[index - 1].carriers(&nodal) }
    })
}

/// Returns the positions of masters and carriers at rest.
pub(super) fn surface_at_rest(scene: &CubeScene) -> SurfaceVectors {
    core::array::from_fn(|index| {
        let body = &scene.bodies[index];
        let nodal: Vec<[f64; 3]> = body.contact.iter().map(|&node| body.mesh.nodes[node]).collect();
        if index == 0 { nodal } else { scene.surfaces[index - 1].carriers(&nodal) }
    })
}

/// Finds all masters with a gap below `margin` (m), left side first; `rest` are the positions at rest.
pub(super) fn find(scene: &CubeScene, rest: &SurfaceVectors, moved: &SurfaceVectors, margin: f64) -> Vec<RingContact> {
    let mut contacts = Vec::new();
    for side in 0..2 {
        let sum =
            |index: usize, i: usize| -> [f64; 3] { core::array::from_fn(|k| rest[index][i][k] + moved[index][i][k]) };
        let carriers: Vec<[f64; 3]> = (0..rest[1 + side].len()).map(|i| sum(1 + side, i)).collect();
        for master in 0..scene.masters {
            let place = sum(0, side * scene.masters + master);
            let Some(foot) = scene.surfaces[side].foot(place, &carriers, scene.guess(side, place)) else { continue };
            if foot.gap < margin {
                let axis = [0.0, 0.0, 1.0];
                let across = unit(minus(axis, scaled(foot.normal, foot.normal[2])));
                let frame = [foot.normal, cross(across, foot.normal), across];
                contacts.push(RingContact { side, master, frame, weights: foot.weights, gap: foot.gap });
            }
        }
    }
    contacts
}

/// Converts forces (local frames, on the masters) to forces on masters and carriers, action and reaction.
pub(super) fn surface_forces(scene: &CubeScene, contacts: &[RingContact], forces: &[[f64; 3]]) -> SurfaceVectors {
    let mut all: SurfaceVectors = [
        vec![[0.0; 3]; 2 * scene.masters],
        vec![[0.0; 3]; scene.surfaces[0].count()],
        vec![[0.0; 3]; scene.surfaces[1].count()],
    ];
    for (contact, force) in contacts.iter().zip(forces) {
        let force = contact.global(*force);
        add_scaled(&mut all[0][contact.side * scene.masters + contact.master], force, 1.0);
        for &(carrier, weight) in &contact.weights {
            add_scaled(&mut all[1 + contact.side][carrier], force, -weight);
        }
    }
    all
}

/// Adds forces on masters and carriers, times a factor, to loads on all dofs.
pub(super) fn add_to_loads(scene: &CubeScene, forces: &SurfaceVectors, factor: f64, loads: &mut Vectors) {
    for index in 0..3 {
        let body = &scene.bodies[index];
        let nodal = if index == 0 { forces[0].clone() } else { scene.surfaces[index - 1].spread(&forces[index]) };
        for (node, force) in body.contact.iter().zip(nodal) {
            (0..3).for_each(|i| loads[index][3 * node + i] += factor * force[i]);
        }
    }
}
