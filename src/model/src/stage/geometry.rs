//! Shape of one sector: a bladed disk with bore, web and rim, and a twisted blade of double-circular-arc section.
//!
//! The flow is along +z and the stage rotates towards +θ, so that blades lean towards -θ from leading to trailing
//! edge.

use core::f64::consts::TAU;

use tiprub_cosim::shown;

use super::{SECTORS, TIP_AXIAL, TIP_RADIUS};
use crate::{Error, Result};

/// Blade geometry. Pairs are the values at root and tip, between which they are linear in the radius.
#[derive(Debug, Clone, PartialEq)]
pub struct BladeGeometry {
    /// Radius of the cylindrical tip (m).
    pub tip_radius: f64,
    /// Axial positions of leading and trailing edge at the root (m).
    pub root_axial: [f64; 2],
    /// Axial positions of leading and trailing edge at the tip (m).
    pub tip_axial: [f64; 2],
    /// Angle between camber line and axis at the leading edge (rad).
    pub inlet_angle: [f64; 2],
    /// Angle between camber line and axis at the trailing edge (rad).
    pub outlet_angle: [f64; 2],
    /// Largest thickness, at half the axial chord (m).
    pub thickness: [f64; 2],
    /// Thickness of the edges (m).
    pub edge_thickness: [f64; 2],
    /// Radius of the fillet at the root (m); 0 without a fillet.
    pub fillet: f64,
}

/// Disk under the blades, symmetric about the plane z = 0 except for the ends of the rim.
#[derive(Debug, Clone, PartialEq)]
pub struct DiskGeometry {
    /// Radius of the bore (m).
    pub bore_radius: f64,
    /// Radial height of the thick ring at the bore (m).
    pub bore_height: f64,
    /// Axial width of this ring (m).
    pub bore_width: f64,
    /// Axial thickness of the web at the bore and at the rim (m).
    pub web_thickness: [f64; 2],
    /// Radial thickness of the rim (m).
    pub rim_thickness: f64,
    /// Axial ends of the rim (m).
    pub rim_axial: [f64; 2],
    /// Radius of the outer surface of the rim, where the blades start (m).
    pub hub_radius: f64,
}

/// Geometry of one sector of a bladed disk.
#[derive(Debug, Clone, PartialEq)]
pub struct SectorGeometry {
    /// Number of sectors of the disk.
    pub sectors: usize,
    /// The blade.
    pub blade: BladeGeometry,
    /// The disk.
    pub disk: DiskGeometry,
}

impl Default for BladeGeometry {
    fn default() -> Self {
        Self {
            tip_radius: TIP_RADIUS,
            root_axial: [-0.0225, 0.0225],
            tip_axial: TIP_AXIAL,
            inlet_angle: [0.70, 1.07],
            outlet_angle: [0.20, 0.93],
            thickness: [5.5e-3, 2.2e-3],
            edge_thickness: [0.9e-3, 0.6e-3],
            fillet: 2.0e-3,
        }
    }
}

impl Default for DiskGeometry {
    fn default() -> Self {
        Self {
            bore_radius: 0.085,
            bore_height: 0.02,
            bore_width: 0.044,
            web_thickness: [0.020, 0.014],
            rim_thickness: 0.018,
            rim_axial: [-0.028, 0.028],
            hub_radius: 0.245,
        }
    }
}

impl Default for SectorGeometry {
    fn default() -> Self {
        Self { sectors: SECTORS, blade: BladeGeometry::default(), disk: DiskGeometry::default() }
    }
}

/// Section of a blade at one radius.
#[derive(Debug, Clone, Copy)]
pub(super) struct BladeSection {
    axial: [f64; 2],
    /// Tangents of the camber angle at both edges.
    slopes: [f64; 2],
    thickness: f64,
    edge_thickness: f64,
    /// Thickness that the fillet adds to each side (m).
    fillet: f64,
}

/// Point of the camber line with the distance of the sides of the blade.
#[derive(Debug, Clone, Copy)]
pub(super) struct CamberPoint {
    /// Axial position (m).
    pub z: f64,
    /// Position along the circumference, rθ (m).
    pub along: f64,
    /// Half the thickness as a vector across the camber line: axial and circumferential part (m).
    pub half: [f64; 2],
}

impl BladeSection {
    /// Returns the point of the camber line at a fraction of the axial chord; outside 0..=1 the line and the sides
    /// continue straight.
    pub(super) fn at(&self, share: f64) -> CamberPoint {
        let [leading, trailing] = self.axial;
        let chord = trailing - leading;
        let (inside, [inlet, outlet]) = (share.clamp(0.0, 1.0), self.slopes);
        let slope = inlet + (outlet - inlet) * inside;
        // Integral of the slope, zero at mid-chord, where the sections are stacked.
        let height = |x: f64| inlet * x + 0.5 * (outlet - inlet) * x * x;
        let along = -chord * (height(inside) - height(0.5) + slope * (share - inside));
        let thickness = self.edge_thickness + (self.thickness - self.edge_thickness) * 4.0 * inside * (1.0 - inside);
        let half = 0.5 * thickness + self.fillet;
        let length = 1.0_f64.hypot(slope);
        CamberPoint { z: leading + chord * share, along, half: [half * slope / length, half / length] }
    }

    /// Returns the fraction of the axial chord at an axial position.
    pub(super) fn share(&self, z: f64) -> f64 {
        (z - self.axial[0]) / (self.axial[1] - self.axial[0])
    }
}

fn between([first, last]: [f64; 2], share: f64) -> f64 {
    first + (last - first) * share
}

impl SectorGeometry {
    /// Returns the angle of one sector (rad).
    #[expect(clippy::cast_precision_loss, reason = "numbers of sectors are small")]
    pub fn pitch(&self) -> f64 {
        TAU / self.sectors as f64
    }

    /// Returns the section of the blade at a radius (m).
    pub(super) fn section(&self, radius: f64) -> BladeSection {
        let (blade, hub) = (&self.blade, self.disk.hub_radius);
        let share = (radius - hub) / (blade.tip_radius - hub);
        let height = (blade.fillet - (radius - hub)).max(0.0);
        BladeSection {
            axial: core::array::from_fn(|end| between([blade.root_axial[end], blade.tip_axial[end]], share)),
            slopes: [between(blade.inlet_angle, share).tan(), between(blade.outlet_angle, share).tan()],
            thickness: between(blade.thickness, share),
            edge_thickness: between(blade.edge_thickness, share),
            // A quarter of a circle tangent to blade and rim.
            fillet: blade.fillet - (blade.fillet * blade.fillet - height * height).max(0.0).sqrt(),
        }
    }

    /// Returns the axial thickness of the web at a radius (m).
    pub(super) fn web(&self, radius: f64) -> f64 {
        let disk = &self.disk;
        let (low, high) = (disk.bore_radius + disk.bore_height, disk.hub_radius - disk.rim_thickness);
        between(disk.web_thickness, (radius - low) / (high - low))
    }

    /// Checks that the lengths define a bladed disk.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the length, angle or number.
    pub(crate) fn validate(&self) -> Result<()> {
        let (blade, disk) = (&self.blade, &self.disk);
        if self.sectors < 3 {
            let remedy = "Give at least three, so that a sector is less than half a turn";
            return Err(Error::invalid("stage, number of sectors", format!("{} is too few", self.sectors), remedy));
        }
        let rim_inside = disk.hub_radius - disk.rim_thickness;
        rising(
            "radii (0, bore, outside of the bore ring, inside of the rim, hub)",
            &[0.0, disk.bore_radius, disk.bore_radius + disk.bore_height, rim_inside, disk.hub_radius],
        )?;
        rising("hub radius, tip radius minus fillet radius", &[disk.hub_radius, blade.tip_radius - blade.fillet])?;
        rising("axial positions of the blade edges at the tip", &blade.tip_axial)?;
        rising("axial positions of the blade edges at the root", &blade.root_axial)?;
        for [web, wide] in [[disk.web_thickness[0], disk.bore_width], [disk.web_thickness[1], 2.0 * self.rim_reach()]] {
            rising("0 and web thickness", &[0.0, web])?;
            not_above("web thickness", web, "width of the adjacent bore or rim", wide)?;
        }
        not_above(
            "axial position of the low end of the rim",
            disk.rim_axial[0],
            "position of the leading edge at the root",
            blade.root_axial[0],
        )?;
        not_above(
            "axial position of the trailing edge at the root",
            blade.root_axial[1],
            "position of the high end of the rim",
            disk.rim_axial[1],
        )?;
        if blade.fillet.is_nan() || blade.fillet < 0.0 {
            return Err(Error::invalid(
                "stage, fillet radius",
                format!("{} m is below 0", shown(blade.fillet)),
                REMEDY,
            ));
        }
        for end in 0..2 {
            rising(
                "thicknesses of the edges and of the blade",
                &[0.0, blade.edge_thickness[end], blade.thickness[end]],
            )?;
            for angle in [blade.inlet_angle[end], blade.outlet_angle[end]] {
                rising("camber-line angle between its two limits", &[-LARGEST_ANGLE, angle, LARGEST_ANGLE])?;
            }
        }
        self.validate_width()
    }

    /// Returns the shorter of the two axial distances of the rim ends from z = 0 (m).
    fn rim_reach(&self) -> f64 {
        self.disk.rim_axial[1].min(-self.disk.rim_axial[0])
    }

    /// Checks the space between the roots of neighbouring blades, and before and behind them for the fillet.
    fn validate_width(&self) -> Result<()> {
        let (root, hub) = (self.section(self.disk.hub_radius), self.disk.hub_radius);
        let widest = (0..=20).map(|i| root.at(f64::from(i) / 20.0).half[1]).fold(0.0, f64::max);
        not_above(
            "width of the blade root with its fillet",
            2.0 * widest,
            "limit of 0.9 times the sector width",
            0.9 * self.pitch() * hub,
        )
    }
}

/// Largest angle of the camber line (rad); above it the sections are sheared too much for a mesh.
const LARGEST_ANGLE: f64 = 1.3;

const REMEDY: &str = "Give the dimensions of a valid bladed disk: lengths in m, angles in rad";

fn rising(what: &str, values: &[f64]) -> Result<()> {
    if values.iter().all(|value| value.is_finite()) && values.windows(2).all(|pair| pair[0] < pair[1]) {
        return Ok(());
    }
    Err(Error::invalid(format!("stage, {what}"), format!("{values:?} are not strictly increasing"), REMEDY))
}

fn not_above(low: &str, value: f64, high: &str, limit: f64) -> Result<()> {
    if value <= limit {
        return Ok(());
    }
    Err(Error::invalid(
        format!("stage, {low}"),
        format!("{} is above {}, the {high}", shown(value), shown(limit)),
        REMEDY,
    ))
}
