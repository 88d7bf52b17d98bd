//! Hash of settings and ROMs, stored in saved states.

use tiprub_cosim::persist::fingerprint;

use crate::Scene;
use crate::scene::settings::SceneSettings;

/// Hash of everything that determines the results of a scene.
pub fn of_scene(scene: &Scene) -> u64 {
    // Silenced warnings and accepted values do not change results.
    let settings = SceneSettings { silence: Vec::new(), accept_implausible: false, ..scene.settings.clone() };
    let mut hash = fingerprint(format!("{settings:?}").as_bytes(), 0);
    for rom in &scene.roms {
        let mut matrices = vec![&rom.mass, &rom.stiffness, &rom.contact_map];
        if let Some(spin) = &rom.extras.spin {
            matrices.extend([&spin.stiffness_speed2, &spin.stiffness_speed4, &spin.coriolis]);
            let loads = format!("{:?} {:?}", spin.centrifugal_load, spin.centrifugal_load_speed4);
            hash = fingerprint(loads.as_bytes(), hash);
        }
        matrices.extend(rom.extras.thermal.iter().map(|thermal| &thermal.loads));
        matrices.extend(rom.extras.watched.iter().map(|watched| &watched.map));
        matrices.extend(rom.extras.support.iter().flat_map(|own| [&own.stiffness, &own.mass, &own.thermal]));
        for matrix in matrices {
            for value in matrix.iter() {
                hash = fingerprint(&value.to_bits().to_le_bytes(), hash);
            }
        }
        for harmonic in &rom.extras.harmonics {
            for matrix in [&harmonic.mass, &harmonic.stiffness, &harmonic.contact_map] {
                for value in matrix.iter().flat_map(|value| [value.re, value.im]) {
                    hash = fingerprint(&value.to_bits().to_le_bytes(), hash);
                }
            }
        }
        let patches = rom.extras.thermal.as_ref().map(|thermal| &thermal.patches);
        let rest = format!("{} {:?} {:?} {:?}", rom.sectors, rom.contact_nodes, rom.extras.grid, patches);
        hash = fingerprint(rest.as_bytes(), hash);
    }
    hash
}
