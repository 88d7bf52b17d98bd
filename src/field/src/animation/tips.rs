//! Forces, clearances, displacements and wear of the tips, for figures.

use nalgebra::Complex;
use tiprub_core::Simulation;
use tiprub_core::scene::rom::DisplacementFrame;

use super::capture::{Capture, Frame, angle_bin};
use crate::ring::Ring;
use crate::structure::{Coordinates, DisplacementMap, ModalShapes, Role, elements};

/// Largest number of rows of a map over the circumference.
const MAX_ROWS: usize = 72;

/// Blade or free body with the largest contact force.
#[derive(Debug, Clone, PartialEq)]
pub struct HitBlade {
    /// Index of the structure.
    pub structure: usize,
    /// Name of the structure.
    pub name: String,
    /// Sector (0-based).
    pub sector: usize,
    /// Number of sectors of the structure.
    pub sectors: usize,
    /// Largest sum of the normal forces of its contact nodes, mean over a communication step (N); 0 without contact.
    pub force: f64,
    /// Time of the largest force (s).
    pub time: f64,
}

/// Displacement of a contact node over time.
#[derive(Debug, Clone, PartialEq)]
pub struct TipHistory {
    /// Name of the contact node.
    pub node: String,
    /// Direction with the largest motion, such as `tangential`.
    pub direction: &'static str,
    /// Times (s), equally spaced.
    pub times: Vec<f64>,
    /// Displacement in that direction (m).
    pub values: Vec<f64>,
}

/// Wear of a coating at the end of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct WearMap {
    /// Name of the surface.
    pub name: String,
    /// First and last axial position (m).
    pub axial: [f64; 2],
    /// Wear depth (m) of each cell, `[row along the axis][cell around]`.
    pub depth: Vec<Vec<f64>>,
}

impl WearMap {
    /// Reads the wear of all coatings.
    pub(super) fn all(rings: &[Ring], simulation: &Simulation) -> Vec<Self> {
        let map = |ring: &Ring| {
            let cells = elements(simulation, ring.wear.as_ref()?)?;
            let ends = [ring.rows.first()?[1], ring.rows.last()?[1]];
            let depth = cells.chunks(ring.around).map(<[f64]>::to_vec).collect();
            Some(Self { name: ring.name.clone(), axial: ends, depth })
        };
        rings.iter().filter_map(map).collect()
    }
}

/// Returns the wear depth of a coating (m), averaged along the axis, at [`super::ANGLES`] angles; empty without a coating.
#[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
pub(super) fn mean_wear(ring: &Ring, simulation: &Simulation) -> Vec<f32> {
    let cells = ring.wear.as_ref().and_then(|name| elements(simulation, name)).unwrap_or_default();
    let rows = (cells.len() / ring.around) as f64;
    let mean = |angle: usize| {
        let cell = angle * ring.around / super::ANGLES;
        (cells.iter().skip(cell).step_by(ring.around).sum::<f64>() / rows) as f32
    };
    if cells.is_empty() { Vec::new() } else { (0..super::ANGLES).map(mean).collect() }
}

/// Clearances around the circumference.
#[derive(Debug, Clone, PartialEq)]
pub struct AngleClearances {
    /// Name of the rotor.
    pub name: String,
    /// Smallest clearance of the run in equal ranges of angle from 0 (m); infinite where no blade was.
    pub smallest: Vec<f64>,
    /// Times (s).
    pub times: Vec<f64>,
    /// Smallest clearance in equal ranges of angle over time (m), `[angle][time]`; infinite where no blade was.
    pub over_time: Vec<Vec<f64>>,
}

impl Capture {
    /// Returns the times of the frames (s).
    pub fn times(&self) -> Vec<f64> {
        self.frames.iter().map(|frame| frame.time).collect()
    }

    /// Returns the blade or free body with the largest contact force; without contact, the one with the smallest clearance.
    /// `None` if the scene has neither a rotor nor a free body.
    pub fn hardest_hit(&self) -> Option<HitBlade> {
        let movers = self.structures.iter().enumerate().filter(|(_, own)| matches!(own.role, Role::Rotor | Role::Free));
        let mut found: Option<(f64, HitBlade)> = None;
        for (structure, own) in movers {
            for (place, sector) in own.sectors.iter().enumerate() {
                for frame in &self.frames {
                    let body = &frame.bodies[structure];
                    let force = body.sector_forces.get(place).map_or(0.0, |force| f64::from(*force));
                    let clearance = body.clearances.get(place).map_or(f64::INFINITY, |gap| f64::from(*gap));
                    let rank = if force > 0.0 { force } else { -clearance };
                    if found.as_ref().is_none_or(|(most, _)| rank > *most) {
                        let (name, sectors) = (own.name.clone(), own.rom.sectors);
                        let time = frame.time;
                        found = Some((rank, HitBlade { structure, name, sector: *sector, sectors, force, time }));
                    }
                }
            }
        }
        found.map(|(_, blade)| blade)
    }

    /// Returns the name of each contact node of a blade, and the normal force on it over time (N); empty if the scene does not
    /// report these forces.
    pub fn node_forces(&self, blade: &HitBlade) -> Vec<(String, Vec<f64>)> {
        let nodes = &self.structures[blade.structure].rom.contact_nodes;
        let first = blade.sector * nodes.len();
        let is_known =
            self.frames.iter().all(|frame| frame.bodies[blade.structure].forces.len() >= first + nodes.len());
        let series = |node: usize| -> Vec<f64> {
            self.frames.iter().map(|frame| f64::from(frame.bodies[blade.structure].forces[first + node])).collect()
        };
        let named = nodes.iter().enumerate().map(|(node, own)| (own.name.clone(), series(node)));
        if is_known { named.collect() } else { Vec::new() }
    }

    /// Returns the displacement of the first contact node of a blade in the direction in which it moves most.
    pub fn tip_history(&self, blade: &HitBlade) -> Option<TipHistory> {
        let structure = &self.structures[blade.structure];
        let node = structure.rom.contact_nodes.first()?;
        let modes = self.contact_modes(blade.structure, 0);
        let parts = |pick: fn(&Complex<f64>) -> f64| -> Vec<Vec<f64>> {
            modes.iter().map(|own| own.iter().map(pick).collect()).collect()
        };
        let (real, imaginary) = (parts(|value| value.re), parts(|value| value.im));
        let is_coupled = matches!(self.shapes[blade.structure], Some(ModalShapes::Coupled(_)));
        let map = DisplacementMap {
            diameters: real
                .iter()
                .zip(&imaginary)
                .map(|(re, im)| [&re[..], if is_coupled { &im[..] } else { &[] }])
                .collect(),
        };
        let moved = |frame: &Frame| -> Option<[f64; 3]> {
            let amplitudes: Vec<f64> =
                frame.bodies[blade.structure].amplitudes.iter().map(|value| f64::from(*value)).collect();
            let coordinates = if is_coupled {
                let mut rest = amplitudes.as_chunks::<2>().0.iter().map(|[re, im]| Complex::new(*re, *im));
                Coordinates::Coupled(modes.iter().map(|own| rest.by_ref().take(own.ncols()).collect()).collect())
            } else {
                let count = modes.first()?.ncols();
                Coordinates::Uncoupled(vec![amplitudes.get(blade.sector * count..)?.get(..count)?.to_vec()])
            };
            let values = map.displacements(&coordinates, &[blade.sector], blade.sectors).into_iter().next()?;
            values.first_chunk::<3>().copied()
        };
        let moved: Vec<[f64; 3]> = self.frames.iter().map(moved).collect::<Option<_>>()?;
        let spread = |axis: usize| {
            let mean = moved.iter().map(|own| own[axis]).sum::<f64>() / moved.len().max(1) as f64;
            moved.iter().map(|own| (own[axis] - mean).powi(2)).sum::<f64>()
        };
        let axis = [0, 1, 2].into_iter().max_by(|a, b| spread(*a).total_cmp(&spread(*b)))?;
        let names = match structure.rom.frame {
            DisplacementFrame::Cylindrical => ["radial", "tangential", "axial"],
            DisplacementFrame::Cartesian => ["x", "y", "z"],
        };
        let values = moved.iter().map(|own| own[axis]).collect();
        Some(TipHistory { node: node.name.clone(), direction: names[axis], times: self.times(), values })
    }

    /// Returns the clearances of every rotor around the circumference.
    pub fn angle_clearances(&self) -> Vec<AngleClearances> {
        let rotors = self.structures.iter().enumerate().filter(|(_, own)| own.role == Role::Rotor);
        let one = |(structure, own): (usize, &crate::structure::Structure)| {
            let rows = own.rom.sectors.min(MAX_ROWS);
            let mut over_time = vec![vec![f64::INFINITY; self.frames.len()]; rows];
            for (time, frame) in self.frames.iter().enumerate() {
                let body = &frame.bodies[structure];
                for (sector, clearance) in own.sectors.iter().zip(&body.clearances) {
                    let value = &mut over_time[angle_bin(body.motion, *sector, own.rom.sectors, rows)][time];
                    *value = value.min(f64::from(*clearance));
                }
            }
            AngleClearances {
                name: own.name.clone(),
                smallest: self.by_angle[structure].iter().map(|gap| f64::from(*gap)).collect(),
                times: self.times(),
                over_time,
            }
        };
        rotors.map(one).filter(|own| own.smallest.iter().any(|gap| gap.is_finite())).collect()
    }
}
