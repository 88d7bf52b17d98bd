//! Gap functions: where the master nodes are with respect to the slave, as affine functions of their displacement.
//!
//! The gap of a node (eq. 3 of the paper) is evaluated at its predicted place and linear in the correction of the
//! step from there, g = g_p + n·(u − u_p). For a surface of revolution with shape s(θ) and meridional slope m,
//! F = r_c(θ + u_θ/r, z) − r − u_r + m u_z has the gradient (−1, s'/r, m) with respect to (radial, tangential, axial)
//! displacement; dividing by its length N gives the unit normal from the casing to the blade and the gap F/N. The
//! slope is what lets a frictionless lobe draw power from the shaft: r n_θ λ is the torque conjugate to θ_r.

use super::surface::Surface;
use crate::dynamics::dispatch::{InstructionSet, Kernel};
use crate::settings::Meridian;
use crate::{Error, Result, Rom};

/// Prescribed motion of rotor and casing at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drive {
    /// Angle of the rotor θ_r (rad).
    pub rotor_angle: f64,
    /// Speed of the rotor Ω (rad/s).
    pub speed: f64,
    /// Added to every radial clearance (m).
    pub gap_offset: f64,
    /// Factor on the shape of the casing (-), ramp included.
    pub shape_factor: f64,
    /// Rotation of the shape about +z (rad).
    pub shape_rotation: f64,
    /// Uniform change of the casing radius (m).
    pub radius_change: f64,
}

/// Unit normals of one instant, arrays `[node · lanes + lane]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry {
    /// Components of the unit normal, pointing from the slave to the master.
    pub normal: [Vec<f64>; 3],
}

impl Geometry {
    fn new(len: usize) -> Self {
        Self { normal: [vec![0.0; len], vec![0.0; len], vec![0.0; len]] }
    }

    /// Unit normal of one node of one lane.
    pub fn normal_at(&self, index: usize) -> [f64; 3] {
        [self.normal[0][index], self.normal[1][index], self.normal[2][index]]
    }
}

/// A gap function compiled for stepping.
#[derive(Debug, Clone, PartialEq)]
pub enum GapLaw {
    /// Constant normals and gaps: plane obstacles and node-to-node pairs.
    Fixed(FixedGap),
    /// Sectors around an axis inside a rigid surface of revolution.
    Revolution(RevolutionGap),
}

/// Constant normals, gaps and sliding velocities of one group of contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct FixedGap {
    /// Unit normal of each contact, from the slave to the master.
    pub normals: Vec<[f64; 3]>,
    /// Initial gap of each contact (m).
    pub gaps: Vec<f64>,
    /// Prescribed velocity of the master relative to the slave (m/s), on top of the deformation.
    pub sliding: Vec<[f64; 3]>,
}

/// Contact nodes of equally spaced sectors facing a surface of revolution.
#[derive(Debug, Clone, PartialEq)]
pub struct RevolutionGap {
    surface: Surface,
    instruction_set: InstructionSet,
    lanes: usize,
    /// Angle in the rotating frame, `[node · lanes + lane]` (rad).
    angles: Vec<f64>,
    /// Radius per node (m).
    radii: Vec<f64>,
    /// 1/radius per node (1/m).
    per_radius: Vec<f64>,
    /// Meridional slope per node.
    slopes: Vec<f64>,
    /// Radial clearance per lane (m).
    clearances: Vec<f64>,
}

impl RevolutionGap {
    /// Place `rom.sectors` sectors around the axis; `clearances` holds one radial clearance (m) per sector.
    ///
    /// # Errors
    /// Wrong number of clearances.
    pub fn new(rom: &Rom, surface: Surface, clearances: &[f64], meridian: Meridian, lanes: usize) -> Result<Self> {
        let sectors = rom.sectors;
        if clearances.len() != sectors {
            return Err(Error::invalid(
                "contact.sector_gaps",
                format!("{} values for {sectors} sectors", clearances.len()),
                "Give one gap (m) per sector, or remove the line to use `gap` for all",
            ));
        }
        let mut angles = vec![0.0; rom.contact_nodes.len() * lanes];
        for (node, contact) in rom.contact_nodes.iter().enumerate() {
            for sector in 0..sectors {
                angles[node * lanes + sector] = contact.position[1] + sector_angle(sector, sectors);
            }
        }
        // Padding lanes are infinitely far away.
        let mut padded = vec![f64::INFINITY; lanes];
        padded[..sectors].copy_from_slice(clearances);
        Ok(Self {
            surface,
            instruction_set: InstructionSet::detect(),
            lanes,
            angles,
            per_radius: rom.contact_nodes.iter().map(|node| 1.0 / node.position[0]).collect(),
            radii: rom.contact_nodes.iter().map(|node| node.position[0]).collect(),
            slopes: rom
                .contact_nodes
                .iter()
                .map(|node| if meridian == Meridian::Contour { node.meridional_slope } else { 0.0 })
                .collect(),
            clearances: padded,
        })
    }

    /// Fixed-frame angle of a node (rad) for a rotor angle.
    pub fn angle(&self, node: usize, sector: usize, rotor_angle: f64) -> f64 {
        self.angles[node * self.lanes + sector] + rotor_angle
    }

    /// Angle over which the casing shape changes noticeably (rad).
    pub fn angular_scale(&self) -> f64 {
        self.surface.angular_scale()
    }

    /// Radius of a contact node (m).
    pub fn radius(&self, node: usize) -> f64 {
        self.radii[node]
    }
}

/// Gaps and normals of all nodes and lanes on a surface of revolution.
struct Evaluate<'a> {
    law: &'a RevolutionGap,
    drive: &'a Drive,
    displacement: &'a [f64],
    geometry: &'a mut Geometry,
    gap: &'a mut [f64],
}

impl Kernel for Evaluate<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { law, drive, displacement, geometry, gap } = self;
        let opening = drive.gap_offset + drive.radius_change;
        let turned = drive.rotor_angle - drive.shape_rotation;
        let factor = drive.shape_factor;
        let lanes = law.lanes;
        for node in 0..law.radii.len() {
            let (slope, per_radius) = (law.slopes[node], law.per_radius[node]);
            let span = node * lanes..(node + 1) * lanes;
            let [radial, tangential, axial] =
                std::array::from_fn(|component| &displacement[(3 * node + component) * lanes..][..lanes]);
            let (angles, clearances) = (&law.angles[span.clone()], &law.clearances[..lanes]);
            let [normal_0, normal_1, normal_2] = &mut geometry.normal;
            let normal_0 = &mut normal_0[span.clone()];
            let (normal_1, normal_2) = (&mut normal_1[span.clone()], &mut normal_2[span.clone()]);
            let gap = &mut gap[span];
            // The normal arrays hold angle, shape and slope of the shape until they are overwritten.
            for lane in 0..lanes {
                normal_0[lane] = angles[lane] + turned + tangential[lane] * per_radius;
            }
            law.surface.evaluate_row(normal_0, normal_1, normal_2);
            for lane in 0..lanes {
                let sideways = factor * normal_2[lane] * per_radius;
                let per_length = 1.0 / (1.0 + sideways * sideways + slope * slope).sqrt();
                let clearance = clearances[lane] + opening + factor * normal_1[lane];
                gap[lane] = (clearance - radial[lane] + slope * axial[lane]) * per_length;
                normal_0[lane] = -per_length;
                normal_1[lane] = sideways * per_length;
                normal_2[lane] = slope * per_length;
            }
        }
    }
}

/// Angle of sector `sector` of `sectors` (rad).
pub fn sector_angle(sector: usize, sectors: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "sector counts are far below 2^52")]
    let fraction = sector as f64 / sectors as f64;
    std::f64::consts::TAU * fraction
}

impl GapLaw {
    /// Number of contact nodes per sector.
    pub fn nodes(&self) -> usize {
        match self {
            Self::Fixed(law) => law.gaps.len(),
            Self::Revolution(law) => law.radii.len(),
        }
    }

    /// Arrays of the right size, filled once for laws that never change.
    pub fn geometry(&self, lanes: usize) -> Geometry {
        let mut geometry = Geometry::new(self.nodes() * lanes);
        if let Self::Fixed(law) = self {
            for (node, normal) in law.normals.iter().enumerate() {
                for component in 0..3 {
                    geometry.normal[component][node * lanes] = normal[component];
                }
            }
        }
        geometry
    }

    /// Gaps (m) and normals at an instant, for the displacements `[row · lanes + lane]` of the contact rows (m).
    /// Gaps of padding lanes are infinite.
    pub fn evaluate(&self, drive: &Drive, displacement: &[f64], geometry: &mut Geometry, gap: &mut [f64]) {
        match self {
            Self::Fixed(law) => {
                for (node, (normal, initial)) in law.normals.iter().zip(&law.gaps).enumerate() {
                    gap[node] = initial + dot(*normal, std::array::from_fn(|i| displacement[3 * node + i]));
                }
            }
            Self::Revolution(law) => law.instruction_set.run(Evaluate { law, drive, displacement, geometry, gap }),
        }
    }

    /// Largest displacement (m) that counts as small: a tenth of the smallest radius; no limit for fixed obstacles.
    pub fn largest_displacement(&self) -> f64 {
        match self {
            Self::Fixed(_) => f64::INFINITY,
            Self::Revolution(law) => 0.1 * law.radii.iter().fold(f64::INFINITY, |low: f64, radius| low.min(*radius)),
        }
    }

    /// Whether a contact is within what small displacements and a casing seen from inside can describe: less deep than
    /// a tenth of the radius, on a flank below 45°.
    pub fn is_plausible(&self, node: usize, gap: f64, normal: [f64; 3]) -> bool {
        match self {
            Self::Fixed(_) => true,
            Self::Revolution(law) => gap > -0.1 * law.radii[node] && normal[1].abs() <= -normal[0],
        }
    }

    /// Prescribed velocity of the master relative to the slave (m/s), without deformation.
    pub fn sliding_velocity(&self, node: usize, drive: &Drive) -> [f64; 3] {
        match self {
            Self::Fixed(law) => law.sliding[node],
            Self::Revolution(law) => [0.0, drive.speed * law.radii[node], 0.0],
        }
    }

    /// Unit slip direction of the master in the tangent plane, from the predicted relative velocity (m/s); zero
    /// when nothing slides. On surfaces of revolution axial slip is neglected, as in section 4.3 of the paper.
    pub fn slip_direction(&self, velocity: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
        let candidate = match self {
            Self::Fixed(_) => velocity,
            Self::Revolution(_) => [0.0, velocity[1], 0.0],
        };
        let along = dot(candidate, normal);
        let tangent: [f64; 3] = std::array::from_fn(|i| candidate[i] - along * normal[i]);
        let length = dot(tangent, tangent).sqrt();
        if length > 0.0 { tangent.map(|value| value / length) } else { [0.0; 3] }
    }
}

/// Scalar product.
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Shape;

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let lanes = 16;
        let shape = Shape::TwoLobe { depth: 0.6, width: 0.15, phase: 0.3 };
        let law = |instruction_set| RevolutionGap {
            surface: Surface::new(&shape, 3.56e-4).unwrap(),
            instruction_set,
            lanes,
            angles: (0..16).map(|lane| 0.41 * f64::from(lane)).collect(),
            radii: vec![0.25],
            per_radius: vec![4.0],
            slopes: vec![-0.26],
            clearances: vec![3.56e-4; 16],
        };
        let displacement: Vec<f64> = (0..48).map(|i| 1e-4 * f64::from(i).sin()).collect();
        let drive = Drive { rotor_angle: 1.1, shape_factor: 1.0, ..Drive::default() };
        let run = |instruction_set| {
            let law = GapLaw::Revolution(law(instruction_set));
            let (mut geometry, mut gap) = (law.geometry(lanes), vec![0.0; 16]);
            law.evaluate(&drive, &displacement, &mut geometry, &mut gap);
            let all = geometry.normal.iter().flatten().chain(&gap);
            all.map(|value| value.to_bits()).collect::<Vec<_>>()
        };
        assert_eq!(run(InstructionSet::Baseline), run(InstructionSet::detect()));
    }
}
