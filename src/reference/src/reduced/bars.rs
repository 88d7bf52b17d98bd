//! Rods of linear elements with lumped mass in contact with a rigid body or each other: Carpenter's bars, the
//! bouncing bar, and a bar that stays pressed on the ground.

use nalgebra::{DMatrix, DVector};

use super::modes::DampedModes;
use super::{NodeContact, ReducedScene, SparseRow};
use crate::carpenter;
use crate::closed::bouncing_bar;

/// Matrices of one or two rods, with their contact and initial state.
#[derive(Debug, Clone, PartialEq)]
pub struct RodModel {
    /// Lumped mass (kg).
    pub mass: DMatrix<f64>,
    /// Stiffness (N/m).
    pub stiffness: DMatrix<f64>,
    /// Change of the gap with the displacements: g = gap − closing·u.
    pub closing: DVector<f64>,
    /// Gap at zero displacement (m).
    pub gap: f64,
    /// Constant force on the nodes (N).
    pub load: DVector<f64>,
    /// Displacements at time 0 (m).
    pub displacement: DVector<f64>,
    /// Velocities at time 0 (m/s).
    pub velocity: DVector<f64>,
}

/// Adds the mass per node and stiffness of a rod of `elements` elements from `first` on; EA/l and ρAl of an element.
fn add_rod(mass: &mut DMatrix<f64>, stiffness: &mut DMatrix<f64>, first: usize, elements: usize, [k, m]: [f64; 2]) {
    for element in first..first + elements {
        for (i, j, sign) in [(0, 0, 1.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0)] {
            stiffness[(element + i, element + j)] += sign * k;
        }
        mass[(element, element)] += 0.5 * m;
        mass[(element + 1, element + 1)] += 0.5 * m;
    }
}

/// Returns node i of `count` as a unit vector.
fn unit(count: usize, i: usize) -> DVector<f64> {
    let mut vector = DVector::zeros(count);
    vector[i] = 1.0;
    vector
}

/// Creates Carpenter's two bars with `elements` elements each. `end_mass` is the fraction of their mass that the
/// contact nodes keep.
pub fn carpenter(elements: usize, end_mass: f64) -> RodModel {
    let size = carpenter::LENGTH / elements as f64;
    let element = [carpenter::YOUNG * carpenter::AREA / size, carpenter::DENSITY * carpenter::AREA * size];
    let (nodes, count) = (elements + 1, 2 * (elements + 1));
    let (mut mass, mut stiffness) = (DMatrix::zeros(count, count), DMatrix::zeros(count, count));
    add_rod(&mut mass, &mut stiffness, 0, elements, element);
    add_rod(&mut mass, &mut stiffness, nodes, elements, element);
    mass[(elements, elements)] *= end_mass;
    mass[(nodes, nodes)] *= end_mass;
    let sign = |node: usize| if node < nodes { 1.0 } else { -1.0 };
    RodModel {
        mass,
        stiffness,
        closing: unit(count, elements) - unit(count, nodes),
        gap: carpenter::GAP,
        load: DVector::zeros(count),
        displacement: DVector::zeros(count),
        velocity: DVector::from_fn(count, |node, _| sign(node) * carpenter::SPEED),
    }
}

/// Returns the approach of Carpenter's bars at a time (s): the relative displacement of their ends (m).
pub fn carpenter_exact(time: f64) -> f64 {
    let exact = carpenter::exact();
    let flight = time.min(exact.touch) - (time - exact.release).max(0.0);
    2.0 * carpenter::SPEED * flight
}

/// Creates the bouncing bar per unit of cross-section; node 0 is its bottom.
pub fn bouncing(elements: usize, end_mass: f64) -> RodModel {
    let size = bouncing_bar::LENGTH / elements as f64;
    let count = elements + 1;
    let (mut mass, mut stiffness) = (DMatrix::zeros(count, count), DMatrix::zeros(count, count));
    let element = [bouncing_bar::YOUNG / size, bouncing_bar::DENSITY * size];
    add_rod(&mut mass, &mut stiffness, 0, elements, element);
    let load = DVector::from_fn(count, |node, _| -bouncing_bar::GRAVITY * mass[(node, node)]);
    mass[(0, 0)] *= end_mass;
    RodModel {
        mass,
        stiffness,
        closing: -unit(count, 0),
        gap: bouncing_bar::HEIGHT,
        load,
        displacement: DVector::zeros(count),
        velocity: DVector::zeros(count),
    }
}

/// Creates a bar that is held at its top and hangs above the ground (`touching` false) or stands on it under twice
/// its weight (true), with an excitation so small that it never touches or never lifts off.
pub fn shaken(elements: usize, end_mass: f64, touching: bool) -> RodModel {
    let whole = bouncing(elements, end_mass);
    let keep = |matrix: &DMatrix<f64>| matrix.view((0, 0), (elements, elements)).into_owned();
    let (mass, stiffness) = (keep(&whole.mass), keep(&whole.stiffness));
    let load = whole.load.rows(0, elements) * 2.0;
    let mut held = stiffness.clone();
    if touching {
        // The bottom stays in place: at rest the ground supports it.
        held.row_mut(0).fill(0.0);
        held.column_mut(0).fill(0.0);
        held[(0, 0)] = 1.0;
    }
    let mut resting = load.clone();
    resting[0] *= f64::from(u8::from(!touching));
    let displacement = held.cholesky().map_or_else(|| DVector::zeros(elements), |factor| factor.solve(&resting));
    let swing = |node: usize| (std::f64::consts::PI * node as f64 / elements as f64).sin();
    RodModel {
        mass,
        stiffness,
        closing: -unit(elements, 0),
        gap: if touching { 0.0 } else { 10.0 },
        load,
        displacement,
        velocity: DVector::from_fn(elements, |node, _| 0.2 * swing(node)),
    }
}

/// Rod in its modes.
#[derive(Debug, Clone, PartialEq)]
pub struct RodScene {
    modes: DampedModes,
    load: Vec<f64>,
    start: (Vec<f64>, Vec<f64>),
    normal: Vec<f64>,
    gap: f64,
    /// True to compare all modal amplitudes instead of the displacement of the contact.
    whole: bool,
}

impl RodScene {
    /// Creates the scene. `whole`: compare all modal amplitudes (displacements weighted with the mass) instead of the
    /// displacement of the contact. Returns `None` for a mass that is not positive.
    pub fn new(rod: &RodModel, whole: bool) -> Option<Self> {
        let modes = DampedModes::new(&rod.mass, &rod.stiffness, 0.0)?;
        Some(Self {
            load: modes.force(&rod.load),
            start: (modes.amplitudes(&rod.mass, &rod.displacement), modes.amplitudes(&rod.mass, &rod.velocity)),
            normal: modes.force(&-&rod.closing),
            gap: rod.gap,
            modes,
            whole,
        })
    }
}

impl ReducedScene for RodScene {
    fn modes(&self) -> &DampedModes {
        &self.modes
    }

    fn contacts(&self, _: f64, position: &[f64], within: f64) -> Vec<NodeContact> {
        let gap = self.gap + self.normal.iter().zip(position).map(|(n, q)| n * q).sum::<f64>();
        if gap > within {
            return Vec::new();
        }
        let row = SparseRow(vec![(0, self.normal.clone())]);
        vec![NodeContact { node: 0, group: 0, gap, rate: 0.0, normal: row.clone(), force: row }]
    }

    fn load(&self) -> &[f64] {
        &self.load
    }

    fn start(&self) -> (Vec<f64>, Vec<f64>) {
        self.start.clone()
    }

    fn observed(&self, position: &[f64]) -> Vec<f64> {
        if self.whole {
            return (&self.modes.shapes * DVector::from_row_slice(position)).iter().copied().collect();
        }
        vec![-self.normal.iter().zip(position).map(|(n, q)| n * q).sum::<f64>()]
    }
}
