//! Positions of the contact nodes of all sectors around the axis, and their rigid motion.

use super::frame::PolarFrame;
use super::{PrescribedMotion, Vector3};
use crate::math::real;
use crate::scene::ranges::SMALL;
use crate::{Error, Result, Rom};

/// Contact nodes of equally spaced sectors; arrays that differ by sector are `[node · lanes + lane]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Lanes of a row: sectors and padding.
    pub lanes: usize,
    /// Angle in the rotating frame (rad), `[node · lanes + lane]`.
    pub angles: Vec<f64>,
    /// Radius per node (m).
    pub radii: Vec<f64>,
    /// 1/radius per node (1/m).
    pub per_radius: Vec<f64>,
    /// Axial position per node (m).
    pub axial: Vec<f64>,
    /// Radial clearance per lane (m); infinite in padding lanes.
    pub clearances: Vec<f64>,
}

impl Layout {
    /// Places `rom.sectors` sectors around the axis; `clearances` contains one radial clearance (m) per sector.
    ///
    /// # Errors
    /// Wrong number of clearances.
    pub fn new(rom: &Rom, clearances: &[f64], lanes: usize) -> Result<Self> {
        let places: Vec<[f64; 3]> = rom.contact_nodes.iter().map(|node| node.position).collect();
        Self::of_places(&places, rom.sectors, clearances, lanes)
    }

    /// Creates a layout of points at these places (m, rad, m) of a sector.
    ///
    /// # Errors
    /// Wrong number of clearances.
    pub(crate) fn of_places(places: &[[f64; 3]], sectors: usize, clearances: &[f64], lanes: usize) -> Result<Self> {
        if clearances.len() != sectors {
            return Err(Error::invalid(
                "contact.sector_gaps",
                format!("{} values for {sectors} sectors", clearances.len()),
                "Give one gap (m) per sector, or remove the line to use `gap` for all",
            ));
        }
        let mut angles = vec![0.0; places.len() * lanes];
        for (node, [_, angle, _]) in places.iter().enumerate() {
            for sector in 0..sectors {
                angles[node * lanes + sector] = angle + sector_angle(sector, sectors);
            }
        }
        // Padding lanes are infinitely far away.
        let mut padded = vec![f64::INFINITY; lanes];
        padded[..sectors].copy_from_slice(clearances);
        Ok(Self {
            lanes,
            angles,
            radii: places.iter().map(|place| place[0]).collect(),
            per_radius: places.iter().map(|place| 1.0 / place[0]).collect(),
            axial: places.iter().map(|place| place[2]).collect(),
            clearances: padded,
        })
    }

    /// Returns the largest displacement (m) that counts as small: a tenth of the smallest radius.
    pub(crate) fn largest_displacement(&self) -> f64 {
        SMALL * self.radii.iter().fold(f64::INFINITY, |low: f64, radius| low.min(*radius))
    }

    /// Number of contact nodes per sector.
    pub fn nodes(&self) -> usize {
        self.radii.len()
    }

    /// Velocity by the motion of the rotor (m/s) of a node displaced by `moved` (m), in the coordinates of its displacements: r Ω around,
    /// since a displacement around is an arc of the undeformed radius r, plus the motion of the shaft centre.
    #[inline(always)]
    pub(crate) fn rigid_velocity(
        &self,
        node: usize,
        index: usize,
        drive: &PrescribedMotion,
        moved: Vector3,
    ) -> Vector3 {
        let spin = drive.speed * self.radii[node];
        if drive.shaft_velocity[0] == 0.0 && drive.shaft_velocity[1] == 0.0 {
            return Vector3::new(0.0, spin, drive.shaft_velocity[2]);
        }
        let shaft = self.shaft_motion(node, index, drive.rotor_angle, moved, drive.shaft_velocity);
        Vector3::new(shaft[0], spin + shaft[1], shaft[2])
    }

    /// Displacement or velocity `shaft` of the shaft centre in fixed directions, converted to the coordinates of the displacements of a
    /// node displaced by `moved` (m).
    pub fn shaft_motion(&self, node: usize, index: usize, rotor_angle: f64, moved: Vector3, shaft: Vector3) -> Vector3 {
        if shaft.iter().all(|along| *along == 0.0) {
            return shaft;
        }
        let mut shaft = self.displaced_frame(node, index, rotor_angle, moved[1]).local(shaft);
        shaft[1] /= 1.0 + moved[0] * self.per_radius[node];
        shaft
    }

    /// Directions at a node that is displaced by an arc `around` (m), at a rotor angle (rad).
    pub(crate) fn displaced_frame(&self, node: usize, index: usize, rotor_angle: f64, around: f64) -> PolarFrame {
        PolarFrame::new(self.angles[index] + rotor_angle + around * self.per_radius[node])
    }
}

/// Angle of sector `sector` of `sectors` (rad).
pub(crate) fn sector_angle(sector: usize, sectors: usize) -> f64 {
    std::f64::consts::TAU * (real(sector) / real(sectors))
}
