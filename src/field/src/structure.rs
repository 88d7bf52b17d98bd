//! Geometry and displacements of one structure of a scene.

use std::{borrow::Cow, f64::consts::TAU};

use nalgebra::{Complex, DMatrix};
use tiprub_core::geometry::Geometry;
use tiprub_core::modes::{bank::ModalBank, modal::ModalModel};
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame};
use tiprub_core::scene::settings::{BodyMotion, SceneSettings};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_cosim::variables::NO_CLEARANCE;
use tiprub_model::SurfaceShapes;

/// Vector (x, y, z).
pub(crate) type Vector = [f64; 3];

/// Rigid motion of a structure: a rotation about z, then a translation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RigidMotion {
    /// Angle (rad).
    pub angle: f64,
    /// Translation (m).
    pub shift: Vector,
}

impl RigidMotion {
    /// Returns the motion of a sector (0-based) of `sectors`.
    #[must_use]
    pub fn of_sector(self, sector: usize, sectors: usize) -> Self {
        Self { angle: self.angle + TAU * sector as f64 / sectors as f64, ..self }
    }

    /// Rotates vectors.
    pub fn rotate(&self, vectors: impl Iterator<Item = Vector>) -> impl Iterator<Item = Vector> {
        let (sine, cosine) = libm::sincos(self.angle);
        vectors.map(move |[x, y, z]| [cosine * x - sine * y, sine * x + cosine * y, z])
    }

    /// Moves points.
    pub fn place(&self, points: impl Iterator<Item = Vector>) -> impl Iterator<Item = Vector> {
        let shift = self.shift;
        self.rotate(points).map(move |point| [0, 1, 2].map(|axis| point[axis] + shift[axis]))
    }
}

/// Displacements per reduced coordinate, `[coordinate][row]`, of each nodal diameter.
pub(crate) struct DisplacementMap<'a, T> {
    pub(crate) diameters: Vec<[&'a [T]; 2]>,
}

impl<T: Copy + Into<f64>> DisplacementMap<'_, T> {
    /// Computes the displacements of sectors (0-based) of `count` sectors, in the directions of the first sector.
    ///
    /// Coupled sectors move by u_s = Σ w_n Re(C_n z_n e^(i n 2π s/N)), see [`tiprub_core::scene::rom::Harmonic`].
    pub(crate) fn displacements(&self, coordinates: &Coordinates, sectors: &[usize], count: usize) -> Vec<Vec<f64>> {
        let amplitudes = match coordinates {
            Coordinates::Uncoupled(own) => {
                let [real, _] = self.diameters[0];
                return own.iter().map(|own| sum(real, own.iter().copied())).collect();
            }
            Coordinates::Coupled(amplitudes) => amplitudes,
        };
        let spectrum: Vec<[Vec<f64>; 2]> = self
            .diameters
            .iter()
            .zip(amplitudes)
            .map(|([real, imaginary], own)| {
                let (re, im) = (|| own.iter().map(|z| z.re), || own.iter().map(|z| z.im));
                let mut parts = [sum(real, re()), sum(real, im())];
                for (part, sign, values) in [(0, -1.0, im().collect::<Vec<_>>()), (1, 1.0, re().collect())] {
                    let more = sum(imaginary, values.into_iter());
                    parts[part].iter_mut().zip(more).for_each(|(part, more)| *part += sign * more);
                }
                parts
            })
            .collect();
        let of_sector = |sector: &usize| {
            let mut moved = vec![0.0; spectrum.first().map_or(0, |[real, _]| real.len())];
            for (n, [real, imaginary]) in spectrum.iter().enumerate() {
                let share = if n == 0 || 2 * n == count { 1.0 } else { 2.0 };
                let weight = libm::sqrt(share / count as f64);
                // The remainder keeps the angle small.
                let (sine, cosine) = libm::sincos(TAU * (n * sector % count) as f64 / count as f64);
                let (along, across) = (weight * cosine, weight * sine);
                for ((moved, real), imaginary) in moved.iter_mut().zip(real).zip(imaginary) {
                    *moved += along * real - across * imaginary;
                }
            }
            moved
        };
        sectors.iter().map(of_sector).collect()
    }
}

/// Returns the sum of the columns of `map` times `factors`.
fn sum<T: Copy + Into<f64>>(map: &[T], factors: impl ExactSizeIterator<Item = f64>) -> Vec<f64> {
    let rows = map.len() / factors.len().max(1);
    let mut moved = vec![0.0; rows];
    if rows > 0 {
        for (column, factor) in map.chunks_exact(rows).zip(factors) {
            moved.iter_mut().zip(column).for_each(|(moved, value)| *moved += (*value).into() * factor);
        }
    }
    moved
}

/// Reduced coordinates of a structure at one instant.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Coordinates {
    /// Amplitudes of each chosen sector.
    Uncoupled(Vec<Vec<f64>>),
    /// Amplitudes of each nodal diameter.
    Coupled(Vec<Vec<Complex<f64>>>),
}

/// Mass-normalised mode shapes of a structure in reduced coordinates.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ModalShapes<'a> {
    /// Shapes of one sector.
    Uncoupled(Cow<'a, DMatrix<f64>>),
    /// Shapes of each nodal diameter.
    Coupled(Vec<Cow<'a, DMatrix<Complex<f64>>>>),
}

impl<'a> ModalShapes<'a> {
    /// Returns the shapes of a bank.
    pub(crate) fn from_bank(bank: &'a ModalBank) -> Self {
        match bank.disk() {
            None => Self::Uncoupled(Cow::Borrowed(&bank.model().shapes)),
            Some(disk) => Self::Coupled(disk.model().diameters.iter().map(|own| Cow::Borrowed(&own.shapes)).collect()),
        }
    }

    /// Copies the shapes, for use after the run.
    pub(crate) fn into_owned(self) -> ModalShapes<'static> {
        match self {
            Self::Uncoupled(shapes) => ModalShapes::Uncoupled(Cow::Owned(shapes.into_owned())),
            Self::Coupled(shapes) => {
                ModalShapes::Coupled(shapes.into_iter().map(|own| Cow::Owned(own.into_owned())).collect())
            }
        }
    }

    /// Reads the modal amplitudes of sectors (0-based): sector by sector, or real and imaginary parts of all nodal diameters.
    pub(crate) fn amplitudes(&self, bank: &ModalBank, sectors: &[usize]) -> Vec<f64> {
        match self {
            Self::Uncoupled(shapes) => {
                let modes = 0..shapes.ncols();
                let own = |sector: &usize| modes.clone().map(|mode| bank.amplitudes(mode, *sector)[0][0]).collect();
                sectors.iter().flat_map(|sector| -> Vec<f64> { own(sector) }).collect()
            }
            Self::Coupled(shapes) => {
                let modes = shapes.iter().enumerate().flat_map(|(n, own)| (0..own.ncols()).map(move |mode| (n, mode)));
                modes.flat_map(|(n, mode)| bank.amplitudes(mode, n)[0]).collect()
            }
        }
    }

    /// Returns the reduced coordinates from the modal amplitudes.
    pub(crate) fn coordinates(&self, amplitudes: &[f64]) -> Coordinates {
        match self {
            Self::Uncoupled(shapes) => {
                let sectors = amplitudes.chunks_exact(shapes.ncols().max(1));
                Coordinates::Uncoupled(sectors.map(|own| times(shapes, own)).collect())
            }
            Self::Coupled(shapes) => {
                let mut rest = amplitudes.as_chunks::<2>().0.iter().map(|[re, im]| Complex::new(*re, *im));
                let own = |shapes: &Cow<'_, DMatrix<Complex<f64>>>| {
                    let own: Vec<Complex<f64>> = rest.by_ref().take(shapes.ncols()).collect();
                    times(shapes, &own)
                };
                Coordinates::Coupled(shapes.iter().map(own).collect())
            }
        }
    }
}

fn times<T: nalgebra::ComplexField>(shapes: &DMatrix<T>, amplitudes: &[T]) -> Vec<T> {
    let mut sum = vec![T::zero(); shapes.nrows()];
    for (column, amplitude) in shapes.column_iter().zip(amplitudes) {
        sum.iter_mut().zip(column.iter()).for_each(|(sum, shape)| *sum += shape.clone() * amplitude.clone());
    }
    sum
}

/// Role of a structure in a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    /// Rotor or other master with sectors.
    Rotor,
    /// Free body.
    Free,
    /// Structure that carries surfaces and deforms.
    Carrier,
    /// Structure that does not move.
    Rigid,
}

/// Structure of a scene with its geometry.
#[derive(Debug)]
pub struct Structure {
    /// Name.
    pub(crate) name: String,
    /// Beginning of the names of its variables.
    pub(crate) prefix: String,
    pub(crate) role: Role,
    /// Index among the structures of the simulated system; `None` for a rigid structure.
    index: Option<usize>,
    pub(crate) rom: Rom,
    /// Surface of its model, if it is known.
    pub(crate) shapes: Option<SurfaceShapes>,
    /// Chosen sectors (0-based).
    pub(crate) sectors: Vec<usize>,
    /// Contact maps of the nodal diameters, real and imaginary parts, `[coordinate][row]`.
    contact_maps: Vec<[Vec<f64>; 2]>,
}

/// Displacements of a structure at one instant, in fixed directions.
pub(crate) struct Moved {
    /// Rigid motion, without that of the sector.
    pub motion: RigidMotion,
    /// Displacements of the contact nodes of each chosen sector (m).
    pub contact: Vec<Vec<Vector>>,
    /// Displacements of the surface of each chosen sector (m); empty if its surface is unknown.
    pub surface: Vec<Vec<Vector>>,
}

impl Structure {
    /// Returns the structures of a scene in its order. `shapes` are their surfaces, `chosen` the sectors (1-based) to
    /// show; all if it is empty.
    pub fn of_scene(scene: &Scene, shapes: Vec<Option<SurfaceShapes>>, chosen: &[usize]) -> Vec<Self> {
        let settings = &scene.settings;
        let masters: Vec<usize> = (0..settings.structures.len())
            .filter(|index| settings.contacts.iter().any(|contact| contact.master == settings.structures[*index].name))
            .collect();
        let carriers = carriers(settings);
        let structure = |(index, shapes): (usize, Option<SurfaceShapes>)| {
            let (own, rom) = (&settings.structures[index], scene.roms[index].clone());
            let body = masters.iter().position(|master| *master == index);
            let carrier = carriers.iter().position(|carrier| *carrier == index);
            let role = match (body, carrier) {
                (Some(_), _) if own.motion == BodyMotion::Free => Role::Free,
                (Some(_), _) => Role::Rotor,
                (None, Some(_)) => Role::Carrier,
                (None, None) => Role::Rigid,
            };
            let has_prefix = if role == Role::Rotor { masters.len() > 1 } else { true };
            let parts = |map: &DMatrix<Complex<f64>>| {
                let part = |pick: fn(&Complex<f64>) -> f64| map.iter().map(pick).collect();
                [part(|value| value.re), part(|value| value.im)]
            };
            let contact_maps = core::iter::once([rom.contact_map.as_slice().to_vec(), Vec::new()])
                .chain(rom.extras.harmonics.iter().map(|harmonic| parts(&harmonic.contact_map)));
            Self {
                name: own.name.clone(),
                prefix: if has_prefix { format!("{}.", own.name) } else { String::new() },
                role,
                index: body.or(carrier.map(|carrier| masters.len() + carrier)),
                sectors: (0..rom.sectors).filter(|s| chosen.is_empty() || chosen.contains(&(s + 1))).collect(),
                contact_maps: contact_maps.collect(),
                rom,
                shapes,
            }
        };
        shapes.into_iter().enumerate().map(structure).collect()
    }

    /// Returns the current gaps of the contact nodes of the chosen sectors (m), sector by sector, node by node: at least
    /// [`NO_CLEARANCE`] for nodes without a surface to touch. They do not depend on the gaps that the steps evaluate.
    pub(crate) fn clearances(&self, simulation: &Simulation) -> Option<Vec<f64>> {
        let index = self.index.filter(|_| matches!(self.role, Role::Rotor | Role::Free))?;
        let system = simulation.system();
        let own = &system.structures()[index];
        let mut gaps = vec![NO_CLEARANCE; own.gaps().len()];
        for pair in system.pairs().iter().filter(|pair| pair.structure() == index) {
            let mut law = pair.gap().clone();
            let points = law.spline().map_or(0, |surface| surface.control_points().len());
            let moved = pair.carrier().map_or(&[][..], |carrier| {
                &system.structures()[carrier.structure].modes().displacement()[carrier.first_row..][..3 * points]
            });
            let mut geometry = Geometry::new(gaps.len(), points > 0);
            law.evaluate(pair.drive_now(), own.modes().displacement(), moved, None, &mut geometry, &mut gaps);
        }
        let nodes = 0..self.rom.contact_nodes.len();
        let of_sector = |sector: &usize| nodes.clone().map(|node| gaps[own.index(node, *sector)]).collect::<Vec<_>>();
        Some(self.sectors.iter().flat_map(of_sector).collect())
    }

    /// Returns the period (s) of the slowest elastic mode of the structure; `None` if it has none, or if its modes cannot be computed.
    pub(crate) fn slowest_period(&self) -> Option<f64> {
        let model = ModalModel::from_rom(&self.rom, self.rom.damping_ratio).ok()?;
        let slowest = model.frequencies.into_iter().find(|frequency| *frequency > 0.0)?;
        Some(TAU / slowest)
    }

    /// Returns the name of an output of a sector (0-based).
    pub(crate) fn sector_variable(&self, sector: usize, name: &str) -> String {
        match self.role {
            Role::Free => format!("{}{name}", self.prefix),
            _ => format!("{}blade[{}].{name}", self.prefix, sector + 1),
        }
    }

    /// Returns the modes of the structure; `None` if it is rigid.
    pub(crate) fn bank<'s>(&self, simulation: &'s Simulation) -> Option<&'s ModalBank> {
        Some(simulation.system().structures()[self.index?].modes())
    }

    /// Returns the current rigid motion of the structure, without the angle of a sector.
    pub(crate) fn rigid_motion(&self, simulation: &Simulation) -> RigidMotion {
        let mut motion = RigidMotion::default();
        let value = |name: &str| variable(simulation, &format!("{}{name}", self.prefix));
        match self.role {
            Role::Rotor => {
                motion.angle = value("rotor_angle") % TAU;
                motion.shift = ["whirl_x", "whirl_y", "axial_shift"].map(value);
            }
            Role::Free => motion.shift = ["displacement_x", "displacement_y", "displacement_z"].map(value),
            Role::Carrier | Role::Rigid => {}
        }
        motion
    }

    /// Returns the displacements (m) of contact nodes and surface from the reduced coordinates, sector by sector, in the
    /// directions of the first sector. Displacements of contact nodes have the directions of the ROM.
    pub(crate) fn sector_displacements(&self, coordinates: Option<&Coordinates>) -> [Vec<Vec<f64>>; 2] {
        let count = self.rom.sectors;
        let points = self.shapes.as_ref().map(|shapes| shapes.points.len());
        let Some(coordinates) = coordinates else {
            let at_rest = |points: usize| vec![vec![0.0; 3 * points]; self.sectors.len()];
            return [at_rest(self.rom.contact_nodes.len()), points.map_or_else(Vec::new, at_rest)];
        };
        let maps = self.contact_maps.iter().map(|map| map.each_ref().map(Vec::as_slice)).collect();
        let contact = DisplacementMap { diameters: maps }.displacements(coordinates, &self.sectors, count);
        let surface = self.shapes.as_ref().map(|shapes| {
            let maps = shapes.diameters.iter().map(|own| [&own.real[..], &own.imaginary[..]]).collect();
            DisplacementMap { diameters: maps }.displacements(coordinates, &self.sectors, count)
        });
        [contact, surface.unwrap_or_default()]
    }

    /// Returns the current displacements.
    pub(crate) fn moved(&self, simulation: &Simulation) -> Moved {
        let (motion, count) = (self.rigid_motion(simulation), self.rom.sectors);
        let coordinates = self.bank(simulation).map(|bank| {
            let shapes = ModalShapes::from_bank(bank);
            shapes.coordinates(&shapes.amplitudes(bank, &self.sectors))
        });
        let [contact, surface] = self.sector_displacements(coordinates.as_ref());
        let turned = |values: Vec<Vec<f64>>, is_of_contact: bool| {
            let of_sector = |(values, sector): (Vec<f64>, &usize)| {
                let vectors = values.as_chunks::<3>().0.iter().copied();
                let own = motion.of_sector(*sector, count);
                let directed = vectors
                    .enumerate()
                    .map(|(node, vector)| if is_of_contact { self.cartesian(node, vector) } else { vector });
                // The translation of a free body is a part of its displacement.
                let removed = if self.role == Role::Free { motion.shift } else { [0.0; 3] };
                own.rotate(directed).map(|vector| [0, 1, 2].map(|axis| vector[axis] - removed[axis])).collect()
            };
            values.into_iter().zip(&self.sectors).map(of_sector).collect()
        };
        Moved { motion, contact: turned(contact, true), surface: turned(surface, false) }
    }

    /// Converts the displacement of a contact node to x, y, z of the first sector.
    pub(crate) fn cartesian(&self, node: usize, [a, b, c]: Vector) -> Vector {
        match self.rom.frame {
            DisplacementFrame::Cartesian => [a, b, c],
            DisplacementFrame::Cylindrical => {
                let (sine, cosine) = libm::sincos(self.rom.contact_nodes[node].position[1]);
                [cosine * a - sine * b, sine * a + cosine * b, c]
            }
        }
    }

    /// Returns the undeformed position of a point of the ROM (x, y, z in m).
    pub(crate) fn position(&self, node: &ContactNode) -> Vector {
        match self.rom.frame {
            DisplacementFrame::Cartesian => node.position,
            DisplacementFrame::Cylindrical => {
                let [radius, angle, z] = node.position;
                let (sine, cosine) = libm::sincos(angle);
                [radius * cosine, radius * sine, z]
            }
        }
    }
}

/// Returns the structures that carry surfaces and deform, in the order of the contacts.
fn carriers(settings: &SceneSettings) -> Vec<usize> {
    let mut carriers = Vec::new();
    for contact in &settings.contacts {
        let surface = settings.surfaces.iter().find(|surface| surface.name == contact.slave && !surface.rigid);
        let name = surface.and_then(|surface| surface.structure.as_ref());
        let carrier = settings.structures.iter().position(|structure| Some(&structure.name) == name);
        carriers.extend(carrier.filter(|carrier| !carriers.contains(carrier)));
    }
    carriers
}

/// Returns the value of a scalar variable; 0 if the scene does not have it.
pub(crate) fn variable(simulation: &Simulation, name: &str) -> f64 {
    let found = simulation.table().find(name).and_then(|variable| simulation.real(variable.reference).ok());
    found.unwrap_or(0.0)
}

/// Returns the elements of an array variable; `None` if the scene does not have it.
pub(crate) fn elements(simulation: &Simulation, name: &str) -> Option<Vec<f64>> {
    let variable = simulation.table().find(name)?;
    let references = (variable.reference..).take(variable.len());
    references.map(|reference| simulation.real(reference).ok()).collect()
}
