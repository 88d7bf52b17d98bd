//! Hash of settings and ROMs. Saved states and the keys of stored checks contain it.

use nalgebra::DMatrix;
use tiprub_cosim::persist::{fingerprint, fingerprint_numbers};

use crate::Scene;
use crate::scene::rom::{ContactNode, Harmonic, Rom, RomExtras, Spin, SupportRows, Thermal, WatchedPoints};
use crate::scene::settings::SceneSettings;

/// Hash of everything that determines the results of a scene.
pub fn of_scene(scene: &Scene) -> u64 {
    // Silenced warnings and accepted values do not change results.
    let settings = SceneSettings { silence: Vec::new(), accept_implausible: false, ..scene.settings.clone() };
    let seed = fingerprint(format!("{settings:?}").as_bytes(), 0);
    scene.roms.iter().fold(seed, |seed, rom| rom_hash(rom, seed))
}

/// Hash of a ROM: of all its numbers, and of its other data as text. The name, the origin and the quality checks are left out,
/// because they do not change results.
fn rom_hash(rom: &Rom, seed: u64) -> u64 {
    let Rom {
        name: _,
        origin: _,
        sectors,
        frame,
        mass,
        stiffness,
        damping_ratio,
        contact_map,
        contact_nodes,
        checks: _,
        extras,
    } = rom;
    let RomExtras {
        spin,
        thermal,
        grid,
        harmonics,
        watched,
        stress,
        stress_thermal,
        stress_centrifugal,
        support,
        basis,
        rows,
    } = extras;
    let mut hash = Hash(seed);
    [mass, stiffness, contact_map].into_iter().for_each(|matrix| hash.matrix(matrix));
    if let Some(Spin {
        stiffness_speed2,
        stiffness_speed4,
        coriolis,
        centrifugal_load,
        centrifugal_load_speed4,
        largest_speed,
    }) = spin
    {
        [stiffness_speed2, stiffness_speed4, coriolis].into_iter().for_each(|matrix| hash.matrix(matrix));
        for values in [centrifugal_load, centrifugal_load_speed4, &vec![*largest_speed]] {
            hash.numbers(values);
        }
    }
    for Harmonic { mass, stiffness, contact_map } in harmonics {
        for matrix in [mass, stiffness, contact_map] {
            hash.numbers(&matrix.iter().flat_map(|value| [value.re, value.im]).collect::<Vec<_>>());
        }
    }
    for WatchedPoints { map, points } in watched.iter().chain(stress) {
        hash.matrix(map);
        // The other fields of the points have no effect, and ROM files do not contain them.
        points.iter().for_each(|ContactNode { name, position, .. }| hash.text(&format!("{name} {position:?}")));
    }
    if let Some(SupportRows { stiffness, mass, thermal }) = support {
        [stiffness, mass, thermal].into_iter().for_each(|matrix| hash.matrix(matrix));
    }
    stress_thermal.iter().chain(stress_centrifugal).for_each(|matrix| hash.matrix(matrix));
    thermal.iter().for_each(|Thermal { loads, .. }| hash.matrix(loads));
    let patches = thermal.as_ref().map(|thermal| &thermal.patches);
    let optional = [watched.is_some(), stress.is_some(), stress_thermal.is_some(), stress_centrifugal.is_some()];
    hash.text(&format!(
        "{sectors} {frame:?} {damping_ratio:?} {contact_nodes:?} {grid:?} {patches:?} {basis:?} {rows:?} {optional:?}"
    ));
    hash.0
}

/// Hash of the data so far.
struct Hash(u64);

impl Hash {
    fn numbers(&mut self, values: &[f64]) {
        self.0 = fingerprint_numbers(values, self.0);
    }

    fn matrix(&mut self, matrix: &DMatrix<f64>) {
        self.text(&format!("{:?}", matrix.shape()));
        self.numbers(matrix.as_slice());
    }

    fn text(&mut self, text: &str) {
        self.0 = fingerprint(text.as_bytes(), self.0);
    }
}
