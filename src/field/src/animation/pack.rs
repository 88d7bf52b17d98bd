//! Binary data of an animation: thinned surfaces, their low-rank displacements, contact forces and casings over time.

use std::io::Write as _;

use base64::Engine as _;
use flate2::{Compression, write::ZlibEncoder};
use serde_json::{Value, json};
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_shell::{Failure, Result};

use super::basis::Basis;
use super::capture::{Capture, Frame};
use super::{ANGLES, MAX_TIMES};
use crate::cells::{contact_cells, points_alone};
use crate::structure::{Role, Structure};

/// Largest rank of the displacements of one structure.
const MAX_RANK: usize = 28;
/// Deviation below which a lower rank suffices.
const DEVIATION: f64 = 0.01;
/// Largest number of displacement values of one structure in memory.
const MAX_VALUES: usize = 25_000_000;
/// Number of times per period of the slowest elastic mode.
const TIMES_PER_PERIOD: f64 = 8.0;
/// Fraction of the interval that lies before the largest force, if the interval is shorter than the contact.
const BEFORE_PEAK: f64 = 0.4;
/// Radius around a contact node in which a contact force lights the surface, as a fraction of the extent of the contact nodes.
const LIGHT: f64 = 0.12;
/// Index of a point that no contact lights.
const NO_NODE: u16 = u16::MAX;
/// Number of quantisation steps of the vector with the largest contribution to the displacements.
const STEPS: f64 = 4000.0;
/// Smallest number of quantisation steps of a vector.
const MIN_STEPS: f64 = 30.0;
/// Number of quantisation steps of positions and forces, which is the largest value of an `i16`.
const FULL: f64 = 32_767.0;

/// Data of an animation of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Animation {
    /// Description of bodies, casings and times, with offsets into the data.
    pub header: Value,
    /// Data: little-endian numbers, compressed with zlib, in base64.
    pub data: String,
    /// First and last time (s).
    pub interval: [f64; 2],
    /// Whether contact also occurs outside the interval.
    pub is_cut: bool,
    /// Largest deviation of a displacement from the run, as a fraction of the largest displacement of its structure.
    pub deviation: f64,
}

/// Binary data, to which arrays are appended.
#[derive(Default)]
struct Packer(Vec<u8>);

impl Packer {
    /// Pads the data to a multiple of four bytes, and returns its length.
    fn align(&mut self) -> usize {
        while !self.0.len().is_multiple_of(4) {
            self.0.push(0);
        }
        self.0.len()
    }

    /// Adds two-byte numbers: first all low bytes, then all high bytes, which compresses better. Returns the offset.
    fn append_words(&mut self, values: &[[u8; 2]]) -> usize {
        let start = self.align();
        self.0.extend(values.iter().map(|word| word[0]));
        self.0.extend(values.iter().map(|word| word[1]));
        start
    }

    /// Adds integers, and returns the offset.
    fn append_integers(&mut self, values: impl Iterator<Item = u16>) -> usize {
        self.append_words(&values.map(u16::to_le_bytes).collect::<Vec<_>>())
    }

    /// Adds values in [`FULL`] steps from 0 to the largest magnitude; returns the offset and the value of one step.
    fn append_scaled(&mut self, values: &[f64]) -> (usize, f64) {
        self.append_quantised(values, FULL)
    }

    /// Adds values in `steps` steps from 0 to the largest magnitude; returns the offset and the value of one step.
    #[expect(clippy::cast_possible_truncation, reason = "scaled to the range of the type")]
    fn append_quantised(&mut self, values: &[f64], steps: f64) -> (usize, f64) {
        let largest = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let unit = if largest > 0.0 { largest / steps } else { 1.0 };
        let words: Vec<[u8; 2]> = values.iter().map(|value| ((value / unit).round() as i16).to_le_bytes()).collect();
        (self.append_words(&words), unit)
    }
}

impl Capture {
    /// Chooses the times of the animation, and returns its data.
    ///
    /// # Errors
    /// The data cannot be compressed.
    pub fn animation(&self) -> Result<Animation> {
        let (chosen, is_cut) = self.chosen_frames();
        let frames: Vec<&Frame> = chosen.iter().map(|index| &self.frames[*index]).collect();
        // Contacts of frames between two chosen frames belong to the later one.
        let from = |place: usize| if place == 0 { chosen[0] } else { chosen[place - 1] + 1 };
        let total = |frame: &Frame| frame.bodies.iter().map(|body| f64::from(body.total)).sum::<f64>();
        let totals = (0..frames.len())
            .map(|place| self.frames[from(place)..=chosen[place]].iter().map(total).fold(0.0, f64::max));
        let totals: Vec<f64> = totals.collect();
        let force = |own: usize, place: usize| -> Vec<f64> {
            let mut largest = vec![0.0_f64; self.frames[chosen[place]].bodies[own].forces.len()];
            for frame in &self.frames[from(place)..=chosen[place]] {
                largest
                    .iter_mut()
                    .zip(&frame.bodies[own].forces)
                    .for_each(|(most, force)| *most = most.max(f64::from(*force)));
            }
            largest
        };
        let mut packer = Packer::default();
        let (mut bodies, mut deviation) = (Vec::new(), 0.0_f64);
        for (own, structure) in self.structures.iter().enumerate() {
            let forces: Vec<f64> = (0..frames.len()).flat_map(|place| force(own, place)).collect();
            let (body, deviates) = self.body(own, structure, &frames, &forces, &mut packer);
            bodies.push(body);
            deviation = deviation.max(deviates);
        }
        let walls: Vec<Value> = (0..self.rings.len()).map(|ring| self.wall(ring, &frames, &mut packer)).collect();
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        let compressed = encoder.write_all(&packer.0).and_then(|()| encoder.finish());
        let bytes = compressed.map_err(|error| Failure::new("--report", error, ""))?;
        let times: Vec<f64> = frames.iter().map(|frame| frame.time).collect();
        Ok(Animation {
            interval: [times.first().copied().unwrap_or(0.0), times.last().copied().unwrap_or(0.0)],
            header: json!({ "times": times, "totals": totals, "angles": ANGLES, "bodies": bodies, "walls": walls }),
            data: base64::engine::general_purpose::STANDARD.encode(bytes),
            is_cut,
            deviation,
        })
    }

    /// Returns the indices of the frames to show, and whether contact also occurs outside them.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "numbers of frames")]
    fn chosen_frames(&self) -> (Vec<usize>, bool) {
        let total = |frame: &Frame| frame.bodies.iter().map(|body| f64::from(body.total)).sum::<f64>();
        let totals: Vec<f64> = self.frames.iter().map(total).collect();
        let last = self.frames.len().saturating_sub(1);
        let touches = |index: &usize| totals[*index] > 0.0;
        let (first_touch, last_touch) = ((0..=last).find(touches), (0..=last).rfind(touches));
        let (mut from, mut to) = match first_touch.zip(last_touch) {
            None => (0, last),
            Some((first, end)) => {
                // A margin shows the approach and the vibration afterwards.
                let margin = ((end - first) / 10).max(10);
                (first.saturating_sub(margin), (end + margin).min(last))
            }
        };
        let spacing = self.period().map_or(f64::INFINITY, |period| period / TIMES_PER_PERIOD / self.spacing());
        let most = (spacing.max(1.0) * (MAX_TIMES - 1) as f64).min(1e9) as usize;
        if to - from > most {
            let peak = (from..=to).max_by(|a, b| totals[*a].total_cmp(&totals[*b])).unwrap_or(from);
            let start = peak.saturating_sub((BEFORE_PEAK * most as f64) as usize).clamp(from, to - most);
            (from, to) = (start, start + most);
        }
        let count = (to - from + 1).min(MAX_TIMES);
        let chosen = (0..count).map(|i| from + (to - from) * i / (count - 1).max(1)).collect();
        let is_cut = first_touch.is_some_and(|first| first < from) || last_touch.is_some_and(|end| end > to);
        (chosen, is_cut)
    }

    /// Returns the period (s) of the slowest elastic mode of all structures; `None` if no structure has one.
    fn period(&self) -> Option<f64> {
        self.structures.iter().filter_map(|own| own.slowest_period()).reduce(f64::max)
    }

    /// Packs one structure; returns its description and the deviation of its displacements.
    fn body(
        &self,
        own: usize,
        structure: &Structure,
        frames: &[&Frame],
        forces: &[f64],
        packer: &mut Packer,
    ) -> (Value, f64) {
        let nodes: Vec<[f64; 3]> = structure.rom.contact_nodes.iter().map(|node| structure.position(node)).collect();
        let surface = structure.shapes.as_ref().map_or(&[][..], |shapes| &shapes.points);
        let points: Vec<[f64; 3]> = surface.iter().chain(&nodes).copied().collect();
        let basis = self.basis(own, structure, frames, points.len());
        let rank = basis.vectors.len();
        // Vectors with a small contribution need fewer steps, which compress better.
        let largest = |values: &mut dyn Iterator<Item = f32>| values.fold(0.0_f32, |most, value| most.max(value.abs()));
        let contribution = |k: usize| {
            let weight = largest(&mut basis.coefficients.iter().map(|own| own[k]));
            f64::from(weight) * f64::from(largest(&mut basis.vectors[k].iter().copied()))
        };
        let contributions: Vec<f64> = (0..rank).map(contribution).collect();
        let most = contributions.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let (mut coefficients, mut vectors) = (Vec::new(), Vec::new());
        for (k, own) in contributions.iter().enumerate() {
            let steps = (STEPS * own / most).clamp(MIN_STEPS, FULL).round();
            let series: Vec<f64> = basis.coefficients.iter().map(|own| f64::from(own[k])).collect();
            coefficients.push(packer.append_quantised(&series, steps));
            let vector: Vec<f64> = basis.vectors[k].iter().map(|value| f64::from(*value)).collect();
            vectors.push(packer.append_quantised(&vector, steps));
        }
        let (place, unit) = packer.append_scaled(&points.iter().flatten().copied().collect::<Vec<_>>());
        let (triangles, lines) = (triangles(structure), lines(structure));
        let short = |index: usize| u16::try_from(index).unwrap_or(NO_NODE);
        let lights = lights(&points, &nodes);
        let motion: Vec<[f64; 4]> = frames
            .iter()
            .map(|frame| {
                let motion = frame.bodies[own].motion;
                [motion.angle, motion.shift[0], motion.shift[1], motion.shift[2]]
            })
            .collect();
        let (force_place, force_unit) = packer.append_scaled(forces);
        let ring = self.rings.iter().position(|ring| ring.carrier == Some(own));
        let value = json!({
            "name": structure.name,
            "role": match structure.role {
                Role::Rotor => "rotor",
                Role::Free => "free",
                Role::Carrier | Role::Rigid => "casing",
            },
            "cylindrical": structure.rom.frame == DisplacementFrame::Cylindrical,
            "sectors": structure.rom.sectors,
            "points": points.len(),
            "nodes": nodes.len(),
            "rank": rank,
            "wall": ring,
            "motion": motion,
            "place": [place, unit],
            "basis": vectors,
            "weights": coefficients,
            "triangles": [packer.append_integers(triangles.iter().map(|index| short(*index))), triangles.len()],
            "lines": [packer.append_integers(lines.iter().map(|index| short(index + surface.len()))), lines.len()],
            "lights": packer.append_integers(lights.iter().map(|(node, _)| *node)),
            "light": packer.append_integers(lights.iter().map(|(_, strength)| *strength)),
            "forces": [force_place, force_unit, if forces.is_empty() { 0 } else { 1 }],
        });
        (value, basis.deviation)
    }

    /// Finds the displacements of all points of all sectors at the chosen times.
    fn basis(&self, own: usize, structure: &Structure, frames: &[&Frame], points: usize) -> Basis {
        let values = frames.len() * structure.sectors.len() * 3 * points;
        // The basis of very large rotors comes from fewer frames.
        let every = values.div_ceil(MAX_VALUES).max(1);
        let field = |frame: &&Frame| -> Vec<Vec<f32>> {
            let body = &frame.bodies[own];
            let amplitudes: Vec<f64> = body.amplitudes.iter().map(|value| f64::from(*value)).collect();
            let coordinates = self.shapes[own].as_ref().map(|shapes| shapes.coordinates(&amplitudes));
            let [contact, mut surface] = structure.sector_displacements(coordinates.as_ref());
            surface.resize(contact.len(), Vec::new());
            let shift = if structure.role == Role::Free { body.motion.shift } else { [0.0; 3] };
            let of_sector = |(surface, contact): (Vec<f64>, Vec<f64>)| -> Vec<f32> {
                let nodes = contact.as_chunks::<3>().0.iter().enumerate();
                let nodes = nodes.map(|(node, vector)| structure.cartesian(node, *vector));
                let all = surface.as_chunks::<3>().0.iter().copied().chain(nodes);
                all.flat_map(|vector| [0, 1, 2].map(|axis| single(vector[axis] - shift[axis]))).collect()
            };
            surface.into_iter().zip(contact).map(of_sector).collect()
        };
        if every == 1 {
            return Basis::new(&frames.iter().flat_map(field).collect::<Vec<_>>(), MAX_RANK, DEVIATION);
        }
        let shown = frames.iter().step_by(every).flat_map(field).collect::<Vec<_>>();
        let found = Basis::new(&shown, MAX_RANK, DEVIATION);
        drop(shown);
        found.project(frames.iter().flat_map(field))
    }

    /// Packs the surface of a contact; returns its description.
    fn wall(&self, index: usize, frames: &[&Frame], packer: &mut Packer) -> Value {
        let ring = &self.rings[index];
        let change = |frame: &&Frame| -> Vec<f64> {
            let own = &frame.rings[index];
            let wear = own.wear.iter().map(|wear| f64::from(*wear)).chain(std::iter::repeat(0.0));
            ring.radius_changes(&own.drive, ANGLES).zip(wear).map(|(change, wear)| change + wear).collect()
        };
        let changes: Vec<f64> = frames.iter().flat_map(change).collect();
        let (place, unit) = packer.append_scaled(&changes);
        json!({ "name": ring.name, "rows": ring.rows, "gap": ring.gap, "carrier": ring.carrier, "change": [place, unit] })
    }
}

/// Returns the corners of the triangles of the surface of a structure.
fn triangles(structure: &Structure) -> Vec<usize> {
    let faces = structure.shapes.iter().flat_map(|shapes| shapes.faces());
    faces
        .flat_map(|face| (1..face.len() - 1).flat_map(move |k| [face[0], face[k], face[k + 1]]).collect::<Vec<_>>())
        .collect()
}

/// Returns the ends of lines between the contact nodes of a structure without a surface.
fn lines(structure: &Structure) -> Vec<usize> {
    if structure.shapes.is_some() {
        return Vec::new();
    }
    let nodes = structure.rom.contact_nodes.len();
    let cells = contact_cells(&structure.rom, vec![(0..nodes).collect()]);
    let is_alone = cells == points_alone(nodes);
    let around = cells.into_iter().filter(|_| !is_alone).flat_map(|(corners, kind)| {
        let close = if kind == crate::vtu::cell::POLY_LINE { None } else { corners.first().copied() };
        let ends: Vec<usize> = corners.iter().copied().chain(close).collect();
        ends.windows(2).flat_map(|pair| [pair[0], pair[1]]).collect::<Vec<_>>()
    });
    around.collect()
}

/// Returns for each point the contact node whose force lights it, and the strength of this light (0 to [`FULL`]).
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "scaled to the range of the type")]
fn lights(points: &[[f64; 3]], nodes: &[[f64; 3]]) -> Vec<(u16, u16)> {
    let square = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>();
    let extent = nodes.iter().map(|node| square(node, &nodes[0])).fold(0.0, f64::max).sqrt();
    let reach = (LIGHT * extent).max(f64::MIN_POSITIVE);
    let light = |point: &[f64; 3]| {
        let nearest = nodes.iter().enumerate().min_by(|a, b| square(a.1, point).total_cmp(&square(b.1, point)));
        let Some((node, place)) = nearest else { return (NO_NODE, 0) };
        let strength = (-square(place, point) / (reach * reach)).exp();
        if strength < 0.01 { (NO_NODE, 0) } else { (node as u16, (FULL * strength) as u16) }
    };
    points.iter().map(light).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
fn single(value: f64) -> f32 {
    value as f32
}
