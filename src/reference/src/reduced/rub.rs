//! Uncoupled blades rubbing against a rigid casing with two bumps, computed from the geometry alone.
//!
//! A blade node at radius r, angle θ and axial position z has the distance c + s(θ) − u_r + m u_z from the casing,
//! whose meridian has the slope m of the tip; s is the shape of the casing at the current angle of the node. The gap
//! is this distance divided by the length of its gradient, and the normal is the gradient over its length. Sliding
//! follows the rotation.

use nalgebra::DMatrix;

use super::modes::DampedModes;
use super::{NodeContact, ReducedScene, SparseRow};

/// Contact node: radius (m), angle (rad), meridional slope.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RubTip {
    /// Radius (m).
    pub radius: f64,
    /// Angle in the sector (rad).
    pub angle: f64,
    /// dr/dz of the tip contour.
    pub slope: f64,
}

/// Rigid casing with two bumps half a turn apart, and the motion of the blades along it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BumpedCasing {
    /// Radial clearance (m).
    pub clearance: f64,
    /// Angular velocity (rad/s).
    pub speed: f64,
    /// Coulomb friction coefficient.
    pub friction: f64,
    /// Height of the bumps (m), their width (as a fraction of half a turn) and the time over which they grow (s).
    pub bumps: [f64; 3],
}

/// Contact state of a point of a tip at the casing; directions are radial, tangential, axial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Gap (m).
    pub gap: f64,
    /// Gradient of the gap with respect to displacements.
    pub normal: [f64; 3],
    /// Force per unit multiplier, friction included.
    pub force: [f64; 3],
    /// Rate of the gap due to rotation and growth (m/s).
    pub(crate) rate: f64,
}

impl BumpedCasing {
    /// Returns the change of the radius of the casing at a fixed angle, its slope and its rate of growth, including
    /// the ramp.
    fn shape(&self, angle: f64, time: f64) -> [f64; 3] {
        use std::f64::consts::PI;
        let [height, width, ramp] = self.bumps;
        let away = (angle.rem_euclid(PI) / PI - 0.5) / width;
        let bump = -height * (-away * away).exp();
        let slope = -2.0 * away / (PI * width) * bump;
        if time >= ramp {
            return [bump, slope, 0.0];
        }
        let phase = PI * time / ramp;
        let (grown, growing) = (0.5 * (1.0 - phase.cos()), 0.5 * PI / ramp * phase.sin());
        [grown * bump, grown * slope, growing * bump]
    }

    /// Evaluates a point of the tip displaced by `moved` (m), at a time (s).
    pub fn meets(&self, tip: &RubTip, time: f64, [radial, tangential, axial]: [f64; 3]) -> Touch {
        let [shape, slope, growth] = self.shape(tip.angle + self.speed * time + tangential / tip.radius, time);
        let gradient = [-1.0, slope / tip.radius, tip.slope];
        let length = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        let normal = gradient.map(|g| g / length);
        // Along the circumference, within the tangent plane.
        let along = [-normal[1] * normal[0], 1.0 - normal[1] * normal[1], -normal[1] * normal[2]];
        let size = along.iter().map(|t| t * t).sum::<f64>().sqrt();
        Touch {
            gap: (self.clearance + shape - radial + tip.slope * axial) / length,
            normal,
            force: std::array::from_fn(|i| normal[i] - self.friction * along[i] / size),
            rate: (slope * self.speed + growth) / length,
        }
    }
}

/// Matrices of one blade with its surroundings.
#[derive(Debug, Clone, PartialEq)]
pub struct Blades {
    /// Mass.
    pub mass: DMatrix<f64>,
    /// Stiffness.
    pub stiffness: DMatrix<f64>,
    /// Radial, tangential and axial displacement of every tip node per coordinate.
    pub contact_map: DMatrix<f64>,
    /// Tip nodes.
    pub tips: Vec<RubTip>,
    /// Number of blades.
    pub sectors: usize,
    /// Modal damping ratio.
    pub damping: f64,
    /// Factor on the frequencies of each blade; if empty, 1.
    pub frequency_factors: Vec<f64>,
    /// Radial clearance of each blade (m); if empty, that of the obstacle.
    pub clearances: Vec<f64>,
    /// The casing.
    pub obstacle: BumpedCasing,
}

/// Blades in their modes.
#[derive(Debug, Clone, PartialEq)]
pub struct BladeScene {
    blades: Blades,
    modes: DampedModes,
    /// Contact rows of one blade over its modes.
    rows: Vec<Vec<f64>>,
    load: Vec<f64>,
}

impl BladeScene {
    /// Creates the scene; `None` for a mass that is not positive definite.
    pub fn new(blades: Blades) -> Option<Self> {
        let modes = DampedModes::new(&blades.mass, &blades.stiffness, blades.damping)?;
        let seen = &blades.contact_map * &modes.shapes;
        let rows = seen.row_iter().map(|row| row.iter().copied().collect()).collect();
        let mut modes = modes.repeated(blades.sectors);
        for (own, factor) in modes.frequencies.chunks_mut(seen.ncols()).zip(&blades.frequency_factors) {
            own.iter_mut().for_each(|frequency| *frequency *= factor);
        }
        Some(Self { load: vec![0.0; modes.len()], rows, modes, blades })
    }

    /// Returns the matrices and the surroundings.
    pub fn blades(&self) -> &Blades {
        &self.blades
    }

    fn each(&self) -> usize {
        self.rows[0].len()
    }

    fn moved(&self, row: usize, sector: usize, position: &[f64]) -> f64 {
        let each = self.each();
        self.rows[row].iter().zip(&position[sector * each..]).map(|(a, b)| a * b).sum()
    }

    fn contact(&self, node: usize, sector: usize, time: f64, position: &[f64], within: f64) -> Option<NodeContact> {
        let (tip, blades) = (self.blades.tips[node], &self.blades);
        let moved = std::array::from_fn(|component| self.moved(3 * node + component, sector, position));
        let pitch = std::f64::consts::TAU * sector as f64 / blades.sectors as f64;
        let tip = RubTip { angle: tip.angle + pitch, ..tip };
        let clearance = blades.clearances.get(sector).copied().unwrap_or(blades.obstacle.clearance);
        let Touch { gap, normal, force, rate } = BumpedCasing { clearance, ..blades.obstacle }.meets(&tip, time, moved);
        if gap > within {
            return None;
        }
        let row = |direction: [f64; 3]| {
            let entry = |mode: usize| (0..3).map(|i| direction[i] * self.rows[3 * node + i][mode]).sum();
            SparseRow(vec![(sector * self.each(), (0..self.each()).map(entry).collect())])
        };
        Some(NodeContact {
            node: node * blades.sectors + sector,
            group: sector,
            gap,
            rate,
            normal: row(normal),
            force: row(force),
        })
    }
}

impl ReducedScene for BladeScene {
    fn modes(&self) -> &DampedModes {
        &self.modes
    }

    fn contacts(&self, time: f64, position: &[f64], within: f64) -> Vec<NodeContact> {
        let mut found = Vec::new();
        for sector in 0..self.blades.sectors {
            for node in 0..self.blades.tips.len() {
                found.extend(self.contact(node, sector, time, position, within));
            }
        }
        found
    }

    fn load(&self) -> &[f64] {
        &self.load
    }

    fn start(&self) -> (Vec<f64>, Vec<f64>) {
        (vec![0.0; self.modes.len()], vec![0.0; self.modes.len()])
    }

    /// Returns the displacements row by row, every sector.
    fn observed(&self, position: &[f64]) -> Vec<f64> {
        let rows = 0..self.rows.len();
        rows.flat_map(|row| (0..self.blades.sectors).map(move |sector| self.moved(row, sector, position))).collect()
    }
}
