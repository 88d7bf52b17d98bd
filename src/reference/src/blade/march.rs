//! Time integration: elasticity by the trapezoidal rule, contact on velocities that close the gaps of the next
//! midpoint (D. E. Stewart and J. C. Trinkle, Int. J. Numer. Meth. Engng 39 (1996) 2673-2691):
//!
//! M(v⁺ − v) = −h K (u + h (v + v⁺)/4) + Σ p F,   u⁺ = u + h (v + v⁺)/2,   0 ≤ p ⟂ g/h + N v⁺ + r ≥ 0
//!
//! with gap g, its gradient N, the force row F = N − µT and the prescribed rate r at u + h v/2, t + h/2. The energy
//! changes by the work of the forces over h (v + v⁺)/2, to rounding. A = M + h²K/4 is factorised once; the response
//! of the tip to tip forces is stored. Without contact v⁺ = A⁻¹M(2v + 4u/h) − v − 4u/h.

use faer::Mat;
use nalgebra::{DMatrix, DVector};
use tiprub_model::sparse::Factor;
use tiprub_model::{Error, Result};

use super::{FullBlade, Gauge, TipPart, dot, product};
use crate::reduced::complementarity;
use crate::reduced::rub::{BumpedCasing, Touch};

/// Distance above which parts do not take part in a step (m): a hundred times the motion of a tip in one step.
const NEAR: f64 = 1e-4;

/// Step size and number of steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BladeSteps {
    /// Time between samples (s).
    pub interval: f64,
    /// Number of steps per interval.
    pub division: u32,
    /// Number of samples.
    pub samples: usize,
}

/// Results of a run at the samples.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BladeHistory {
    /// Displacements of the watched nodes, node by node along radius, circumference, axis (m).
    pub displacements: Vec<Vec<f64>>,
    /// Stress at the gauges, six components of each (Pa).
    pub stresses: Vec<Vec<f64>>,
    /// Mean forces on the parts, part by part along radius, circumference, axis (N), over all steps.
    pub forces: Vec<Vec<f64>>,
    /// Impulse of all normal forces since the last sample (N·s).
    pub impulses: Vec<f64>,
    /// Strain energy (J).
    pub strain: Vec<f64>,
    /// Work of friction since the start (J).
    pub friction_work: Vec<f64>,
    /// Largest number of parts in contact at the same time.
    pub pushed: usize,
    /// Largest |kinetic + strain energy − work of contact| relative to the largest energy.
    pub residual: f64,
}

/// Parts that can be in contact, with their responses.
struct PushedContact {
    parts: Vec<TipPart>,
    /// Displacements of the parts (three rows each) per displacement of the tip nodes.
    map: DMatrix<f64>,
    /// First row of every tip node.
    nodes: Vec<usize>,
    /// Velocities of the whole blade per impulse on the tip nodes.
    response: Mat<f64>,
    /// Velocities of the parts per impulse on them.
    flexibility: DMatrix<f64>,
}

impl PushedContact {
    fn new(blade: &FullBlade, parts: &[TipPart], factor: &Factor) -> Result<Self> {
        let clamped = || Error::invalid("tip of the blade", "one of its nodes is clamped", "Clamp the root only");
        let mut entries = Vec::new();
        let mut nodes = Vec::new();
        for (index, part) in parts.iter().enumerate() {
            for (node, rows) in part.seen() {
                let first = blade.rows[node].ok_or_else(clamped)?;
                nodes.push(first);
                entries.push((index, first, rows));
            }
        }
        nodes.sort_unstable();
        nodes.dedup();
        let mut map = DMatrix::zeros(3 * parts.len(), 3 * nodes.len());
        for (index, first, rows) in entries {
            let place = nodes.partition_point(|other| *other < first);
            (0..9).for_each(|i| map[(3 * index + i / 3, 3 * place + i % 3)] += rows[i / 3][i % 3]);
        }
        let units = Mat::from_fn(blade.order(), 3 * nodes.len(), |row, column| {
            f64::from(u8::from(row == nodes[column / 3] + column % 3))
        });
        let response = factor.solve(units);
        let tip = DMatrix::from_fn(3 * nodes.len(), 3 * nodes.len(), |i, j| response[(nodes[i / 3] + i % 3, j)]);
        let flexibility = &map * tip * map.transpose();
        Ok(Self { parts: parts.to_vec(), map, nodes, response, flexibility })
    }

    /// Returns the displacements or velocities of the parts, three rows each.
    fn seen(&self, u: &[f64]) -> DVector<f64> {
        let tip = self.nodes.iter().flat_map(|first| &u[*first..first + 3]).copied();
        &self.map * DVector::from_iterator(3 * self.nodes.len(), tip)
    }

    /// Returns the parts near the casing with their touch; `moved` are their displacements.
    fn near(&self, obstacle: &BumpedCasing, time: f64, moved: &DVector<f64>) -> Vec<(usize, Touch)> {
        let touch = |(index, part): (usize, &TipPart)| {
            let moved = std::array::from_fn(|i| moved[3 * index + i]);
            (index, obstacle.meets(&part.tip, time, moved))
        };
        self.parts.iter().enumerate().map(touch).filter(|(_, touch)| touch.gap < NEAR).collect()
    }

    /// Computes the impulses on these parts from their velocities without contact.
    fn impulses(&self, near: &[(usize, Touch)], step: f64, free: &DVector<f64>) -> Option<DVector<f64>> {
        let matrix = DMatrix::from_fn(near.len(), near.len(), |i, j| {
            let ((a, first), (b, second)) = (&near[i], &near[j]);
            let block = self.flexibility.fixed_view::<3, 3>(3 * a, 3 * b);
            (0..9).map(|k| first.normal[k / 3] * block[(k / 3, k % 3)] * second.force[k % 3]).sum()
        });
        let right = DVector::from_fn(near.len(), |i, _| {
            let (index, touch) = &near[i];
            touch.gap / step + touch.rate + (0..3).map(|k| touch.normal[k] * free[3 * index + k]).sum::<f64>()
        });
        if right.iter().all(|gap| *gap >= 0.0) {
            return Some(DVector::zeros(near.len()));
        }
        complementarity::solve(&matrix, &right)
    }

    /// Returns the forces on the parts.
    fn forces(&self, near: &[(usize, Touch)], impulses: &DVector<f64>) -> DVector<f64> {
        let mut forces = DVector::zeros(3 * self.parts.len());
        for ((index, touch), impulse) in near.iter().zip(impulses.iter()) {
            (0..3).for_each(|k| forces[3 * index + k] += touch.force[k] * impulse);
        }
        forces
    }

    /// Adds the response of the whole blade to impulses on the parts to v.
    fn push(&self, forces: &DVector<f64>, v: &mut [f64]) {
        let tip = self.map.tr_mul(forces);
        for (column, impulse) in tip.iter().enumerate().filter(|(_, impulse)| **impulse != 0.0) {
            v.iter_mut().zip(self.response.col(column).iter()).for_each(|(v, share)| *v += share * impulse);
        }
    }
}

impl FullBlade {
    /// Integrates from rest, with contact on `parts`; records displacements of the `watched` nodes and stress at the
    /// gauges.
    ///
    /// # Errors
    /// A clamped node among these, or a contact problem that is not solved.
    pub fn march(
        &self,
        parts: &[TipPart],
        obstacle: &BumpedCasing,
        steps: BladeSteps,
        (watched, gauges): (&[usize], &[Gauge]),
    ) -> Result<BladeHistory> {
        let h = steps.interval / f64::from(steps.division);
        let factor = self.factor(0.25 * h * h)?;
        let contact = PushedContact::new(self, parts, &factor)?;
        let watched: Vec<TipPart> =
            watched.iter().map(|node| TipPart::mean(&self.nodes, [(*node, 1.0)].into_iter(), 0.0)).collect();
        let (mut u, mut v) = (vec![0.0; self.order()], vec![0.0; self.order()]);
        let mut found = BladeHistory::default();
        let (mut work, mut friction, mut largest, mut off) = (0.0, 0.0, 0.0_f64, 0.0_f64);
        for sample in 0..steps.samples {
            let mut impulse = 0.0;
            for inner in 0..steps.division {
                let time = sample as f64 * steps.interval + (f64::from(inner) + 0.5) * h;
                let middle: Vec<f64> = u.iter().zip(&v).map(|(u, v)| u + 0.5 * h * v).collect();
                let mut next = self.free(&factor, &u, &v, h);
                let near = contact.near(obstacle, time, &contact.seen(&middle));
                let impulses = contact.impulses(&near, h, &contact.seen(&next)).ok_or_else(|| unsolved(time))?;
                let forces = contact.forces(&near, &impulses);
                contact.push(&forces, &mut next);
                found.forces.push((&forces / h).as_slice().to_vec());
                let mean: Vec<f64> = v.iter().zip(&next).map(|(v, next)| 0.5 * (v + next)).collect();
                let moving = contact.seen(&mean);
                work += forces.dot(&moving);
                friction += rubbed(&contact.parts, obstacle, &near, &impulses, &moving);
                found.pushed = found.pushed.max(impulses.iter().filter(|impulse| **impulse > 0.0).count());
                impulse += impulses.sum();
                u.iter_mut().zip(&mean).for_each(|(u, mean)| *u += h * mean);
                v = next;
            }
            found.impulses.push(impulse);
            found.friction_work.push(friction);
            found.displacements.push(self.watch(&watched, &u));
            found.stresses.push(self.stress(gauges, &u));
            found.strain.push(0.5 * dot(&u, &product(&self.stiffness, &u)));
            let energy = found.strain[sample] + 0.5 * dot(&v, &self.momentum(&v));
            largest = largest.max(energy);
            off = off.max((energy - work).abs());
        }
        found.residual = off / largest.max(f64::MIN_POSITIVE);
        Ok(found)
    }

    /// Returns the velocity after a step without contact.
    fn free(&self, factor: &Factor, u: &[f64], v: &[f64], h: f64) -> Vec<f64> {
        let past: Vec<f64> = u.iter().zip(v).map(|(u, v)| v + 4.0 / h * u).collect();
        let both: Vec<f64> = past.iter().zip(v).map(|(past, v)| past + v).collect();
        let momentum = self.momentum(&both);
        let solved = factor.solve(Mat::from_fn(self.order(), 1, |row, _| momentum[row]));
        past.iter().enumerate().map(|(row, past)| solved[(row, 0)] - past).collect()
    }

    fn watch(&self, watched: &[TipPart], u: &[f64]) -> Vec<f64> {
        let of = |part: &TipPart| {
            let mut found = [0.0; 3];
            for (node, rows) in part.seen() {
                let first = self.rows[node].unwrap_or_default();
                (0..3).for_each(|i| found[i] += (0..3).map(|k| rows[i][k] * u[first + k]).sum::<f64>());
            }
            found
        };
        watched.iter().flat_map(of).collect()
    }
}

/// Returns the work of friction: forces along the slip of the tip over the casing.
fn rubbed(
    parts: &[TipPart],
    obstacle: &BumpedCasing,
    near: &[(usize, Touch)],
    impulses: &DVector<f64>,
    moving: &DVector<f64>,
) -> f64 {
    let of = |((index, touch), impulse): (&(usize, Touch), &f64)| {
        let turning = [0.0, parts[*index].tip.radius * obstacle.speed, 0.0];
        let dragged = |k: usize| (touch.normal[k] - touch.force[k]) * (moving[3 * index + k] + turning[k]);
        impulse * (0..3).map(dragged).sum::<f64>()
    };
    near.iter().zip(impulses.iter()).map(of).sum()
}

fn unsolved(time: f64) -> Error {
    Error::invalid("contact of the full blade", format!("no solution at {time:e} s"), "Use shorter steps")
}
