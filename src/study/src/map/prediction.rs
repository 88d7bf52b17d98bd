//! Resonances predicted by linear theory: engine orders of the casing and natural frequencies in the rotating frame.

use realfft::RealFftPlanner;
use tiprub_core::modes::{cyclic::CyclicModel, modal::ModalModel};
use tiprub_core::scene::shape::CompiledShape;
use tiprub_core::{Scene, Simulation};
use tiprub_shell::{Failure, Result, native};

use super::start::{MapStart, master};

/// Returns the nodal diameter that an engine order excites among `sectors` blades, and whether the wave travels backwards.
///
/// Blade s of N passes a stationary pattern with k waves with the phase 2πks/N: the blades cannot distinguish k from k ± N, and for k above N/2 the
/// pattern is a wave of N − k nodal diameters in the opposite direction.
pub fn folded(order: usize, sectors: usize) -> (usize, bool) {
    let rest = order % sectors;
    if 2 * rest > sectors { (sectors - rest, true) } else { (rest, false) }
}

/// Number of speeds at which modes with stiffening are computed; linear interpolation in between.
const GRID: usize = 33;
/// Number of angles at which the shape of the casing is sampled.
const ANGLES: usize = 4096;
/// Harmonics of the shape below this fraction of the largest are rounding.
const NOTHING: f64 = 1e-6;

/// Natural frequencies of the master over a range of speeds, and the orders that the casing excites.
#[derive(Debug, Clone)]
pub struct FrequencyPrediction {
    /// Speeds of the grid (rad/s).
    speeds: Vec<f64>,
    /// Frequencies `[speed][nodal diameter][mode]` (Hz); one nodal diameter if the sectors are uncoupled, one speed if the modes do not depend on
    /// it.
    frequencies: Vec<Vec<Vec<f64>>>,
    sectors: usize,
    /// Base order: its multiples are the excited engine orders; 0 if the casing is round.
    pub base_order: usize,
    /// True if the modes include the stiffening by rotation.
    pub stiffening: bool,
}

/// Crossing of an engine order with a mode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Engine order n.
    pub order: usize,
    /// Index of the mode, from 0.
    pub mode: usize,
    /// Angular velocity (rad/s).
    pub speed: f64,
    /// Frequency (Hz).
    pub frequency: f64,
    /// True if the casing excites this order.
    pub excited: bool,
}

impl FrequencyPrediction {
    /// Predicts frequencies of the first master of a scene with its start values, at speeds up to `fastest` (rad/s).
    ///
    /// # Errors
    /// The eigenproblem of the ROM cannot be solved, or the shape cannot be evaluated.
    pub fn new(scene: &Scene, start: &MapStart, fastest: f64) -> Result<Self> {
        let master = master(&scene.settings)?;
        let (structure, rom) = (&scene.settings.structures[master], &scene.roms[master]);
        let in_rom = |error| Failure::from_core(format!("ROM `{}`", rom.name), error);
        let hertz = |frequencies: &[f64]| frequencies.iter().map(|omega| omega / std::f64::consts::TAU).collect();
        let stiffening = structure.spin.stiffening && !rom.is_cyclic();
        let (mut speeds, mut frequencies) = (vec![0.0], Vec::new());
        if rom.is_cyclic() {
            let disk = CyclicModel::from_rom(rom, rom.damping_ratio).map_err(in_rom)?;
            frequencies.push(disk.diameters.iter().map(|diameter| hertz(&diameter.frequencies)).collect());
        } else if stiffening {
            speeds = (0..GRID).map(|index| fastest * index as f64 / (GRID - 1) as f64).collect();
            for speed in &speeds {
                let model = ModalModel::at_speed(rom, rom.damping_ratio, *speed).map_err(in_rom)?;
                frequencies.push(vec![hertz(&model.frequencies)]);
            }
        } else {
            let model = ModalModel::from_rom(rom, rom.damping_ratio).map_err(in_rom)?;
            frequencies.push(vec![hertz(&model.frequencies)]);
        }
        Ok(Self { speeds, frequencies, sectors: rom.sectors, base_order: base_order(scene, start)?, stiffening })
    }

    /// Predicts the frequencies of the first master of a scene with replaced start values (name, value), up to the speed `fastest` (rad/s).
    ///
    /// # Errors
    /// The first master does not rotate, a start value is wrong, or the errors of [`FrequencyPrediction::new`].
    pub fn with_settings(scene: &Scene, settings: &[(String, String)], fastest: f64) -> Result<Self> {
        let mut simulation = Simulation::new(scene).map_err(|error| Failure::from_core(&scene.settings.name, error))?;
        settings.iter().try_for_each(|(name, value)| native::set(&mut simulation, name, value))?;
        Self::new(scene, &MapStart::of(scene, &simulation)?, fastest)
    }

    /// Returns the natural frequencies that an engine order can excite at a speed (rad/s), in Hz.
    pub fn modes(&self, order: usize, speed: f64) -> Vec<f64> {
        let diameters = self.frequencies[0].len();
        let diameter = if diameters > 1 { folded(order, self.sectors).0.min(diameters - 1) } else { 0 };
        let last = self.speeds.len() - 1;
        let after = self.speeds.partition_point(|known| *known < speed).clamp(usize::from(last > 0), last);
        let before = after.saturating_sub(1);
        let width = self.speeds[after] - self.speeds[before];
        let share = if width > 0.0 { (speed - self.speeds[before]) / width } else { 0.0 };
        let [low, high] = [before, after].map(|index| &self.frequencies[index][diameter]);
        low.iter().zip(high).map(|(low, high)| low + share * (high - low)).collect()
    }

    /// Returns the frequencies of all nodal diameters at a speed, for the lines of the map.
    pub fn lines(&self, speed: f64) -> Vec<f64> {
        let orders = 0..if self.frequencies[0].len() > 1 { self.sectors / 2 + 1 } else { 1 };
        orders.flat_map(|order| self.modes(order, speed)).collect()
    }

    /// Returns the speed (rad/s) at which an engine order meets the mode (from 0); with stiffening, this is a fixed point.
    pub fn meeting(&self, order: usize, mode: usize) -> Option<f64> {
        let next = |speed: f64| Some(std::f64::consts::TAU * self.modes(order, speed).get(mode)? / order as f64);
        (0..100).try_fold(0.0, |speed, _| next(speed))
    }

    /// Returns whether the casing excites an engine order.
    pub fn excites(&self, order: usize) -> bool {
        self.base_order > 0 && order.is_multiple_of(self.base_order)
    }

    /// Returns all crossings within a range of speeds (rad/s) and below a frequency (Hz), ordered by mode and speed.
    pub fn crossings(&self, range: [f64; 2], top: f64) -> Vec<Crossing> {
        let mut found = Vec::new();
        let most =
            (1..10_000_u16).take_while(|order| f64::from(*order) * range[0] / std::f64::consts::TAU < top).last();
        for order in 1..=usize::from(most.unwrap_or(0)) {
            for mode in 0..self.modes(order, range[0]).len() {
                let Some(speed) = self.meeting(order, mode) else { continue };
                let frequency = order as f64 * speed / std::f64::consts::TAU;
                if (range[0]..=range[1]).contains(&speed) && frequency <= top && frequency > 0.0 {
                    found.push(Crossing { order, mode, speed, frequency, excited: self.excites(order) });
                }
            }
        }
        found.sort_by(|a, b| (a.mode, a.speed).partial_cmp(&(b.mode, b.speed)).unwrap_or(std::cmp::Ordering::Equal));
        found
    }
}

/// Returns the rigid shape of the casing at equally spaced angles (m), scaled by `factor`.
///
/// # Errors
/// The shape cannot be evaluated.
pub fn shape(scene: &Scene, factor: f64) -> Result<Vec<f64>> {
    let (Some(contact), Some(surface)) = (scene.settings.contacts.first(), scene.settings.surfaces.first()) else {
        return Ok(vec![0.0; ANGLES]);
    };
    let shape = CompiledShape::new(&surface.shape, contact.gap).map_err(|error| Failure::from_core("casing", error))?;
    let angle = |index: usize| std::f64::consts::TAU * index as f64 / ANGLES as f64;
    Ok((0..ANGLES).map(|index| factor * shape.evaluate(angle(index)).0).collect())
}

/// Returns the greatest common divisor of the orders in the shape of the casing and in the other excitations. Contact creates harmonics of these
/// orders and no others, as long as the motion repeats with them.
fn base_order(scene: &Scene, start: &MapStart) -> Result<usize> {
    let mut values = shape(scene, start.shape_factor)?;
    let transform = RealFftPlanner::new().plan_fft_forward(values.len());
    let mut harmonics = transform.make_output_vec();
    let transformed = transform.process(&mut values, &mut harmonics);
    transformed.map_err(|error| Failure::new("casing", error, "Report this to the developers"))?;
    let largest = harmonics.iter().skip(1).map(|harmonic| harmonic.norm()).fold(0.0, f64::max);
    let present = |order: &usize| largest > 0.0 && harmonics[*order].norm() > NOTHING * largest;
    Ok((1..harmonics.len()).filter(present).chain(start.orders.iter().copied()).fold(0, divisor))
}

fn divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { divisor(b, a % b) }
}

#[cfg(test)]
pub(super) mod tests {
    use nalgebra::DMatrix;
    use tiprub_core::Rom;
    use tiprub_core::scene::rom::{ContactNode, DisplacementFrame, RomChecks, RomExtras, Spin};
    use tiprub_core::scene::settings::Shape;

    use super::*;

    /// Returns a blade with one mode of `frequency` Hz and one of ten times that frequency, both radial with one tangential component.
    pub fn blade(frequency: f64, sectors: usize) -> Rom {
        let square = |hertz: f64| (std::f64::consts::TAU * hertz).powi(2);
        let node = |name: &str, z: f64| ContactNode {
            name: name.into(),
            position: [0.25, 0.0, z],
            meridional_slope: 0.0,
            ..ContactNode::default()
        };
        Rom {
            name: "beam".into(),
            origin: "test".into(),
            sectors,
            frame: DisplacementFrame::Cylindrical,
            mass: DMatrix::identity(2, 2) * 0.1,
            stiffness: DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![
                square(frequency),
                square(10.0 * frequency),
            ])) * 0.1,
            damping_ratio: 2e-3,
            contact_map: DMatrix::from_row_slice(6, 2, &[0.4, 0.5, 1.0, -0.2, 0.1, 0.0, 0.3, 0.6, 0.9, 0.2, 0.1, 0.1]),
            contact_nodes: vec![node("leading_edge", 0.0), node("trailing_edge", 0.03)],
            checks: RomChecks::default(),
            extras: RomExtras::default(),
        }
    }

    /// Returns that blade in the scene of rotor 37.
    pub fn scene(frequency: f64, sectors: usize) -> Scene {
        tiprub_gallery::scene_source::rotor37_scene_with(blade(frequency, sectors)).unwrap()
    }

    #[test]
    fn two_lobes_excite_even_orders_plus_those_of_loads() {
        let mut scene = scene(100.0, 4);
        let with = |scene: &Scene, start: &MapStart| FrequencyPrediction::new(scene, start, 1.0).unwrap().base_order;
        let base = |scene: &Scene| with(scene, &MapStart::default());
        let acting = |orders: &[usize]| MapStart { orders: orders.to_vec(), ..MapStart::default() };
        assert_eq!(base(&scene), 2);
        assert_eq!(with(&scene, &acting(&[6])), 2);
        assert_eq!(with(&scene, &acting(&[3])), 1);
        assert_eq!(with(&scene, &MapStart { shape_factor: 0.0, ..acting(&[]) }), 0);
        assert_eq!(with(&scene, &MapStart { shape_factor: 0.0, ..acting(&[6, 9]) }), 3);
        scene.settings.surfaces[0].shape = Shape::Lobes { amplitude: 1e-4, order: 3, phase: 0.2 };
        assert_eq!(base(&scene), 3);
        scene.settings.surfaces[0].shape = Shape::Circular {};
        assert_eq!(base(&scene), 0);
        assert_eq!(with(&scene, &acting(&[5])), 5);
    }

    #[test]
    fn engine_order_crossings_are_at_the_expected_speeds() {
        let prediction = FrequencyPrediction::new(&scene(100.0, 4), &MapStart::default(), 1.0).unwrap();
        let found = prediction.crossings([140.0, 160.0], 1100.0);
        let of_first: Vec<_> = found.iter().filter(|crossing| crossing.mode == 0).collect();
        assert_eq!(of_first.len(), 1, "{found:?}");
        assert!(of_first[0].order == 4 && of_first[0].excited && (of_first[0].frequency - 100.0).abs() < 1e-9);
        assert!((of_first[0].speed - 50.0 * std::f64::consts::PI).abs() < 1e-9);
        // 1000 Hz lies between orders 40 and 44 from 140 to 160 rad/s.
        assert_eq!(found.iter().filter(|crossing| crossing.mode == 1).count(), 5, "{found:?}");
    }

    /// With f² = f₀² + B (Ω/2π)², order n meets the mode at Ω/2π = f₀/√(n² − B).
    #[test]
    fn stiffening_moves_the_crossings() {
        let mut scene = scene(100.0, 4);
        let (rom, campbell) = (&mut scene.roms[0], 2.5);
        rom.extras.spin = Some(Spin {
            stiffness_speed2: rom.mass.clone() * campbell,
            stiffness_speed4: DMatrix::zeros(2, 2),
            coriolis: DMatrix::zeros(2, 2),
            centrifugal_load: vec![0.0; 2],
            centrifugal_load_speed4: vec![0.0; 2],
            largest_speed: 1000.0,
        });
        let meeting = |scene: &Scene| {
            FrequencyPrediction::new(scene, &MapStart::default(), 400.0).unwrap().meeting(4, 0).unwrap()
        };
        assert!((meeting(&scene) - 50.0 * std::f64::consts::PI).abs() < 1e-9, "stiffening is not asked for");
        scene.settings.structures[0].spin.stiffening = true;
        let expected = std::f64::consts::TAU * 100.0 / (16.0 - campbell).sqrt();
        assert!((meeting(&scene) / expected - 1.0).abs() < 1e-4, "{} {expected}", meeting(&scene));
    }
}
