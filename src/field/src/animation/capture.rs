//! Observes a run and keeps its frames in bounded memory.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix};
use tiprub_core::geometry::PrescribedMotion;
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::NO_CLEARANCE;
use tiprub_model::SurfaceShapes;
use tiprub_shell::{Result, schedule::Schedule};

use super::tips::WearMap;
use super::{ANGLES, MAX_BYTES, MAX_POINTS, MAX_TIMES};
use crate::ring::Ring;
use crate::structure::{ModalShapes, RigidMotion, Role, Structure, variable};

/// State of all structures at a communication point, with the largest forces and the smallest clearances since the previous frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Frame {
    /// Time (s).
    pub(super) time: f64,
    pub(super) bodies: Vec<BodyFrame>,
    pub(super) rings: Vec<RingFrame>,
}

/// State of one structure.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct BodyFrame {
    /// Modal amplitudes, in the order of `ModalShapes::amplitudes`.
    pub(super) amplitudes: Vec<f32>,
    /// Rigid motion; the angle counts revolutions.
    pub(super) motion: RigidMotion,
    /// Normal force on each contact node (N), mean over a communication step, sector by sector.
    pub(super) forces: Vec<f32>,
    /// Sum of these forces for each sector (N).
    pub(super) sector_forces: Vec<f32>,
    /// Sum of these forces for the structure (N).
    pub(super) total: f32,
    /// Smallest clearance of each sector (m); infinite if no surface is opposite.
    pub(super) clearances: Vec<f32>,
}

/// State of the surface of a contact.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RingFrame {
    /// Prescribed motion.
    pub(super) drive: PrescribedMotion,
    /// Mean wear along the axis at [`ANGLES`] angles (m); empty without a coating.
    pub(super) wear: Vec<f32>,
}

/// Observer of a run that keeps its motion and contacts in bounded memory.
pub struct Capture {
    pub(super) structures: Vec<Structure>,
    pub(super) shapes: Vec<Option<ModalShapes<'static>>>,
    pub(super) rings: Vec<Ring>,
    /// Variable with the forces on each sector of each structure: value reference and number of elements.
    forces: Vec<Vec<(u32, usize)>>,
    schedule: Schedule,
    /// Number of communication steps between two frames.
    stride: usize,
    /// Largest number of frames, which is even; 0 before the first frame.
    most: usize,
    pub(super) frames: Vec<Frame>,
    /// Forces and clearances since the last frame.
    pending: Option<Vec<BodyFrame>>,
    /// Smallest clearance at [`ANGLES`] angles over the run, of each rotor (m); infinite where no blade was.
    pub(super) by_angle: Vec<Vec<f32>>,
    pub(super) wear: Vec<WearMap>,
}

impl Capture {
    /// Prepares the capture of a run. The scene must watch all sectors (`FieldOptions::scene`); `shapes` are the surfaces of its
    /// structures, in its order.
    ///
    /// # Errors
    /// The shape of a surface cannot be evaluated.
    pub fn new(scene: &Scene, shapes: Vec<Option<SurfaceShapes>>, schedule: Schedule) -> Result<Self> {
        let thin = |(shapes, rom): (Option<SurfaceShapes>, &tiprub_core::Rom)| {
            shapes.map(|shapes| shapes.thinned(MAX_POINTS[usize::from(rom.sectors == 1)]))
        };
        let shapes = shapes.into_iter().zip(&scene.roms).map(thin).collect();
        let structures = Structure::of_scene(scene, shapes, &[]);
        let rings =
            (0..scene.settings.contacts.len()).filter_map(|contact| Ring::for_contact(contact, scene).transpose());
        let by_angle = structures.iter().map(|own| match own.role {
            Role::Rotor => vec![f32::INFINITY; ANGLES],
            _ => Vec::new(),
        });
        Ok(Self {
            by_angle: by_angle.collect(),
            rings: rings.collect::<Result<_>>()?,
            shapes: Vec::new(),
            forces: Vec::new(),
            structures,
            schedule,
            stride: 1,
            most: 0,
            frames: Vec::new(),
            pending: None,
            wear: Vec::new(),
        })
    }

    /// Prepares a capture with at most `most` frames, rounded down to an even number.
    ///
    /// # Errors
    /// The errors of [`Capture::new`].
    pub fn with_limit(
        scene: &Scene,
        shapes: Vec<Option<SurfaceShapes>>,
        schedule: Schedule,
        most: usize,
    ) -> Result<Self> {
        Ok(Self { most: most & !1, ..Self::new(scene, shapes, schedule)? })
    }

    /// Returns the names of the structures that are shown by their contact nodes only.
    pub fn without_surface(&self) -> Vec<&str> {
        self.structures.iter().filter(|own| own.shapes.is_none()).map(|own| own.name.as_str()).collect()
    }

    /// Adds a communication point.
    pub fn add(&mut self, index: usize, simulation: &Simulation) {
        if index == 0 {
            self.start(simulation);
        }
        let is_kept = index.is_multiple_of(self.stride);
        let mut bodies: Vec<BodyFrame> = (0..self.structures.len()).map(|own| self.contacts(own, simulation)).collect();
        self.record_angles(&bodies);
        if let Some(pending) = self.pending.take() {
            bodies.iter_mut().zip(&pending).for_each(|(own, other)| own.merge(other));
        }
        if index == self.schedule.count {
            self.wear = WearMap::all(&self.rings, simulation);
            if let (false, Some(last)) = (is_kept, self.frames.last_mut()) {
                last.bodies.iter_mut().zip(&bodies).for_each(|(own, other)| own.merge(other));
            }
        }
        if !is_kept {
            self.pending = Some(bodies);
            return;
        }
        for (own, body) in bodies.iter_mut().enumerate() {
            body.amplitudes = self.amplitudes(own, simulation).into_iter().map(single).collect();
        }
        let rings = self.rings.iter().map(|ring| RingFrame {
            drive: *simulation.system().pairs()[ring.contact].drive_now(),
            wear: super::tips::mean_wear(ring, simulation),
        });
        let frame = Frame { time: self.schedule.time(index), rings: rings.collect(), bodies };
        if self.most == 0 {
            self.most = (MAX_BYTES / frame.bytes().max(1)).clamp(2 * MAX_TIMES, 1 << 20) & !1;
        }
        self.frames.push(frame);
        if self.frames.len() > self.most {
            self.halve();
        }
    }

    /// Reads the mode shapes, and finds the variables with the forces.
    fn start(&mut self, simulation: &Simulation) {
        self.shapes = self
            .structures
            .iter()
            .map(|own| Some(ModalShapes::from_bank(own.bank(simulation)?).into_owned()))
            .collect();
        let variables = |own: &Structure| -> Vec<(u32, usize)> {
            let found = |name: String| simulation.table().find(&name).map(|found| (found.reference, found.len()));
            let names = own.sectors.iter().map(|sector| own.sector_variable(*sector, "normal_force"));
            names.map(found).collect::<Option<_>>().unwrap_or_default()
        };
        self.forces = self.structures.iter().map(variables).collect();
    }

    /// Reads the modal amplitudes of a structure.
    fn amplitudes(&self, own: usize, simulation: &Simulation) -> Vec<f64> {
        let structure = &self.structures[own];
        let read = |shapes: &ModalShapes<'_>| Some(shapes.amplitudes(structure.bank(simulation)?, &structure.sectors));
        self.shapes[own].as_ref().and_then(read).unwrap_or_default()
    }

    /// Reads motion, forces and clearances of a structure.
    fn contacts(&self, own: usize, simulation: &Simulation) -> BodyFrame {
        let structure = &self.structures[own];
        let mut motion = structure.rigid_motion(simulation);
        if structure.role == Role::Rotor {
            motion.angle = variable(simulation, &format!("{}rotor_angle", structure.prefix));
        }
        let references = self.forces[own].iter().flat_map(|(first, count)| (*first..).take(*count));
        let forces: Vec<f32> = references.map(|reference| simulation.real(reference).map_or(0.0, single)).collect();
        let nodes = structure.rom.contact_nodes.len().max(1);
        let gaps = structure.clearances(simulation).unwrap_or_default();
        let smallest = |gaps: &[f64]| {
            let near = gaps.iter().copied().filter(|gap| *gap < NO_CLEARANCE);
            single(near.fold(f64::INFINITY, f64::min))
        };
        let clearances = gaps.chunks(nodes).map(smallest).collect();
        let sector_forces: Vec<f32> = forces.chunks(nodes).map(|own| own.iter().sum()).collect();
        let total = sector_forces.iter().sum();
        BodyFrame { amplitudes: Vec::new(), motion, forces, sector_forces, total, clearances }
    }

    /// Updates the smallest clearance at each angle.
    fn record_angles(&mut self, bodies: &[BodyFrame]) {
        for ((smallest, structure), body) in self.by_angle.iter_mut().zip(&self.structures).zip(bodies) {
            // Only rotors have angles.
            if smallest.is_empty() {
                continue;
            }
            for (sector, clearance) in structure.sectors.iter().zip(&body.clearances) {
                let bin = angle_bin(body.motion, *sector, structure.rom.sectors, ANGLES);
                smallest[bin] = smallest[bin].min(*clearance);
            }
        }
    }

    /// Drops every second frame, and merges its contacts into the next one.
    fn halve(&mut self) {
        self.stride *= 2;
        let mut kept: Vec<Frame> = Vec::with_capacity(self.frames.len() / 2 + 1);
        let mut dropped: Option<Frame> = None;
        for (place, mut frame) in self.frames.drain(..).enumerate() {
            if place.is_multiple_of(2) {
                if let Some(dropped) = dropped.take() {
                    frame.bodies.iter_mut().zip(&dropped.bodies).for_each(|(own, other)| own.merge(other));
                }
                kept.push(frame);
            } else {
                dropped = Some(frame);
            }
        }
        self.pending = dropped.map(|frame| frame.bodies);
        self.frames = kept;
    }

    /// Returns the wear of all coatings at the end of the run.
    pub fn wear(&self) -> &[WearMap] {
        &self.wear
    }

    /// Returns whether a contact has a round surface.
    pub fn has_rings(&self) -> bool {
        !self.rings.is_empty()
    }

    /// Returns the time between two frames (s).
    pub fn spacing(&self) -> f64 {
        self.stride as f64 * self.schedule.step
    }

    /// Returns the displacements of a contact node per unit of each modal amplitude: one matrix for uncoupled sectors, or one
    /// per nodal diameter.
    pub(super) fn contact_modes(&self, own: usize, node: usize) -> Vec<DMatrix<Complex<f64>>> {
        let rom = &self.structures[own].rom;
        let rows = |map: &DMatrix<Complex<f64>>| map.rows(3 * node, 3).into_owned();
        let maps = core::iter::once(rom.contact_map.map(|value| Complex::new(value, 0.0)))
            .chain(rom.extras.harmonics.iter().map(|own| own.contact_map.clone()));
        match &self.shapes[own] {
            None => Vec::new(),
            Some(ModalShapes::Uncoupled(shapes)) => {
                maps.take(1).map(|map| rows(&map) * shapes.map(|value| Complex::new(value, 0.0))).collect()
            }
            Some(ModalShapes::Coupled(shapes)) => {
                maps.zip(shapes).map(|(map, shapes)| rows(&map) * shapes.as_ref()).collect()
            }
        }
    }
}

/// Returns in which of `count` equal ranges of angle a sector is.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a fraction of a turn")]
pub(super) fn angle_bin(motion: RigidMotion, sector: usize, sectors: usize, count: usize) -> usize {
    let turn = motion.of_sector(sector, sectors).angle.rem_euclid(TAU) / TAU;
    (turn * count as f64) as usize % count
}

impl Frame {
    /// Returns the approximate memory of the frame (bytes).
    fn bytes(&self) -> usize {
        let body = |own: &BodyFrame| {
            4 * (own.amplitudes.len() + own.forces.len() + own.sector_forces.len() + own.clearances.len()) + 128
        };
        let ring = |own: &RingFrame| 4 * own.wear.len() + size_of::<RingFrame>();
        self.bodies.iter().map(body).sum::<usize>() + self.rings.iter().map(ring).sum::<usize>()
    }
}

impl BodyFrame {
    /// Includes the contacts of another communication point: the larger forces and the smaller clearances.
    fn merge(&mut self, other: &Self) {
        let largest =
            |own: &mut [f32], other: &[f32]| own.iter_mut().zip(other).for_each(|(own, other)| *own = own.max(*other));
        largest(&mut self.forces, &other.forces);
        largest(&mut self.sector_forces, &other.sector_forces);
        self.total = self.total.max(other.total);
        self.clearances.iter_mut().zip(&other.clearances).for_each(|(own, other)| *own = own.min(*other));
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
fn single(value: f64) -> f32 {
    value as f32
}
