//! The three bodies as linear systems (M + c K) x = b, and their compliance at the contact surfaces.

use nalgebra::{DMatrix, Matrix3};
use tiprub_model::sparse::Factor;
use tiprub_model::{Error, Result};

use super::blocks::BlockMatrix;
use super::contact::{RingContact, SurfaceVectors, Vectors};
use crate::cube::scene::{CubeScene, Mass};
use crate::surface::{SplineSurface, is_zero};

#[derive(Debug)]
enum Inverse {
    /// 1/m, zero where clamped.
    Diagonal(Vec<f64>),
    Factor(Factor),
}

/// Displacements of contact points per contact force: of masters for the cube, of carriers for a ring.
#[derive(Debug)]
enum MethodCompliance {
    /// Equal in all three directions, and uncoupled.
    Isotropic(DMatrix<f64>),
    Full(DMatrix<f64>),
}

impl MethodCompliance {
    fn block(&self, a: usize, b: usize) -> Matrix3<f64> {
        match self {
            Self::Isotropic(matrix) => Matrix3::identity() * matrix[(a, b)],
            Self::Full(matrix) => matrix.fixed_view::<3, 3>(3 * a, 3 * b).into_owned(),
        }
    }
}

/// M + c K of the three bodies.
#[derive(Debug)]
pub(super) struct BodyOperator {
    inverses: [Inverse; 3],
    compliances: [MethodCompliance; 3],
    pub(super) stiffness: [BlockMatrix; 3],
    pub(super) mass: [BlockMatrix; 3],
    free: [Vec<bool>; 3],
}

impl BodyOperator {
    pub(super) fn new(scene: &CubeScene, c: f64) -> Result<Self> {
        let (mut inverses, mut compliances) = (Vec::new(), Vec::new());
        for (index, body) in scene.bodies.iter().enumerate() {
            let surface = (index > 0).then(|| &scene.surfaces[index - 1]);
            if c == 0.0 && scene.setting.mass == Mass::Lumped {
                let mut inverse = vec![0.0; body.dofs()];
                let diagonal = |dof: usize| body.mass.block(&[dof], &[dof])[(0, 0)];
                let mut position = 0;
                for &dof in &body.free {
                    // Three equal masses per node: one look-up for each.
                    inverse[dof] =
                        if dof % 3 > 0 && position + 1 == dof { inverse[position] } else { 1.0 / diagonal(dof) };
                    position = dof;
                }
                let contact = DMatrix::from_fn(body.contact.len(), body.contact.len(), |a, b| {
                    if a == b { inverse[3 * body.contact[a]] } else { 0.0 }
                });
                compliances.push(MethodCompliance::Isotropic(isotropic_carriers(surface, contact)));
                inverses.push(Inverse::Diagonal(inverse));
            } else {
                let factor = body.factor(c)?;
                compliances.push(MethodCompliance::Full(carriers(surface, body.contact_inverse(&factor))));
                inverses.push(Inverse::Factor(factor));
            }
        }
        let three = |list: Vec<_>| list.try_into().unwrap_or_else(|_| unreachable!("one per body"));
        let free = core::array::from_fn(|index| {
            let mut flags = vec![false; scene.bodies[index].dofs()];
            scene.bodies[index].free.iter().for_each(|&dof| flags[dof] = true);
            flags
        });
        Ok(Self {
            inverses: three(inverses),
            compliances: compliances.try_into().unwrap_or_else(|_| unreachable!("one per body")),
            stiffness: core::array::from_fn(|index| BlockMatrix::new(&scene.bodies[index].stiffness)),
            mass: core::array::from_fn(|index| BlockMatrix::new(&scene.bodies[index].mass)),
            free,
        })
    }

    /// Returns (M + c K)⁻¹ b.
    pub(super) fn solve(&self, scene: &CubeScene, right: &Vectors) -> Vectors {
        core::array::from_fn(|index| match &self.inverses[index] {
            Inverse::Diagonal(inverse) => inverse.iter().zip(&right[index]).map(|(a, b)| a * b).collect(),
            Inverse::Factor(factor) => scene.bodies[index].solve(factor, &right[index]),
        })
    }

    /// Rejects a step beyond 2/ω of the highest frequency, found by power iteration on M⁻¹K of every body (c = 0).
    pub(super) fn check_step(&self, scene: &CubeScene, step: f64) -> Result<()> {
        let mut vectors: Vectors = core::array::from_fn(|index| {
            let count = scene.bodies[index].dofs();
            (0..count).map(|dof| if self.free[index][dof] { (1.7 * dof as f64).sin() } else { 0.0 }).collect()
        });
        let mut largest = 0.0_f64;
        for _ in 0..60 {
            vectors = self.solve(scene, &self.elastic(&vectors));
            largest = 0.0;
            for vector in &mut vectors {
                let length = inner(vector, vector).sqrt();
                largest = largest.max(length);
                vector.iter_mut().for_each(|x| *x /= length);
            }
        }
        let limit = 2.0 / largest.sqrt();
        if step <= limit {
            return Ok(());
        }
        let problem = format!("{step:.3e} s exceeds the stability limit of central differences, {limit:.3e} s");
        Err(Error::invalid("step", problem, "Use a smaller step"))
    }

    /// Returns K u without reactions of clamped dofs.
    pub(super) fn elastic(&self, u: &Vectors) -> Vectors {
        core::array::from_fn(|index| {
            let mut force = vec![0.0; u[index].len()];
            self.stiffness[index].times(&u[index], &mut force);
            force.iter_mut().zip(&self.free[index]).for_each(|(force, free)| *force = if *free { *force } else { 0.0 });
            force
        })
    }

    /// Returns vᵀ M w / 2.
    pub(super) fn kinetic(&self, v: &Vectors) -> f64 {
        (0..3)
            .map(|index| {
                let mut momentum = vec![0.0; v[index].len()];
                self.mass[index].times(&v[index], &mut momentum);
                0.5 * inner(&v[index], &momentum)
            })
            .sum()
    }

    /// Returns the relative displacement (local frames) of each contact per force on each, 3n × 3n.
    pub(super) fn delassus(&self, contacts: &[RingContact], masters: usize) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(3 * contacts.len(), 3 * contacts.len());
        let frames: Vec<Matrix3<f64>> =
            contacts.iter().map(|contact| Matrix3::from_fn(|i, j| contact.frame[j][i])).collect();
        for (b, second) in contacts.iter().enumerate() {
            for (a, first) in contacts.iter().enumerate() {
                let place = |contact: &RingContact| contact.side * masters + contact.master;
                let mut block = self.compliances[0].block(place(first), place(second));
                if first.side == second.side {
                    let ring = &self.compliances[1 + first.side];
                    for &(i, x) in &first.weights {
                        for &(j, y) in &second.weights {
                            block += ring.block(i, j) * (x * y);
                        }
                    }
                }
                let local = frames[a].transpose() * block * frames[b];
                matrix.fixed_view_mut::<3, 3>(3 * a, 3 * b).copy_from(&local);
            }
        }
        matrix
    }

    /// Returns the displacements that contact forces cause: of the masters (left, then right) and of the carriers of
    /// both rings.
    pub(super) fn surface_response(&self, forces: &SurfaceVectors) -> SurfaceVectors {
        core::array::from_fn(|index| {
            let mut moved = vec![[0.0; 3]; forces[index].len()];
            for (b, force) in forces[index].iter().enumerate().filter(|(_, force)| !is_zero(force)) {
                for (a, u) in moved.iter_mut().enumerate() {
                    match &self.compliances[index] {
                        MethodCompliance::Isotropic(matrix) => (0..3).for_each(|i| u[i] += matrix[(a, b)] * force[i]),
                        MethodCompliance::Full(matrix) => {
                            for i in 0..3 {
                                u[i] += (0..3).map(|j| matrix[(3 * a + i, 3 * b + j)] * force[j]).sum::<f64>();
                            }
                        }
                    }
                }
            }
            moved
        })
    }
}

pub(super) fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns A⁻¹ S A⁻ᵀ with the map A⁻¹ from nodes to carriers.
fn carriers(surface: Option<&SplineSurface>, nodal: DMatrix<f64>) -> DMatrix<f64> {
    let Some(surface) = surface else { return nodal };
    let map = |matrix: &DMatrix<f64>| {
        let mut mapped = DMatrix::zeros(matrix.nrows(), matrix.ncols());
        for column in 0..matrix.ncols() {
            let vectors: Vec<[f64; 3]> =
                (0..surface.count()).map(|i| core::array::from_fn(|k| matrix[(3 * i + k, column)])).collect();
            for (i, vector) in surface.carriers(&vectors).into_iter().enumerate() {
                (0..3).for_each(|k| mapped[(3 * i + k, column)] = vector[k]);
            }
        }
        mapped
    };
    map(&map(&nodal).transpose()).transpose()
}

fn isotropic_carriers(surface: Option<&SplineSurface>, nodal: DMatrix<f64>) -> DMatrix<f64> {
    let Some(surface) = surface else { return nodal };
    let map = |matrix: &DMatrix<f64>| {
        let mut mapped = DMatrix::zeros(matrix.nrows(), matrix.ncols());
        for column in 0..matrix.ncols() {
            let vectors: Vec<[f64; 3]> = (0..surface.count()).map(|i| [matrix[(i, column)], 0.0, 0.0]).collect();
            for (i, vector) in surface.carriers(&vectors).into_iter().enumerate() {
                mapped[(i, column)] = vector[0];
            }
        }
        mapped
    };
    map(&map(&nodal).transpose()).transpose()
}
