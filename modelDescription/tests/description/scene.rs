//! Scene with every option on, small blades in a small flexible casing, and the list of options.

use nalgebra::DMatrix;
use tiprub_core::scene::rom::{SUPPORT_ROWS, SupportRows, Thermal, WatchedPoints};
use tiprub_core::scene::settings::*;
use tiprub_core::{Rom, Scene, VariableTable};
use tiprub_cosim::ThermalPatch;
use tiprub_model_description::{DefaultExperiment, Description};
use tiprub_test_models as models;

/// Returns a scene with every option on.
pub fn complete() -> Scene {
    let mut scene = rigid();
    scene.settings.time.tolerance = Some(1e-3);
    let rotor = &mut scene.settings.structures[0];
    rotor.spin = SpinSettings { stiffening: true, growth: true, coriolis: true };
    (rotor.whirl, rotor.axial_shift) = (true, true);
    (rotor.thermal, rotor.softening, rotor.damping_ratios) = (true, 3e-4, vec![0.002, 0.004]);
    let (mode, node, direction) = (Some(1), None, None);
    rotor.excitation = Some(ExcitationSettings { order: 4, mode, node, direction, amplitude: 0.0, phase: 0.0 });
    let (mode, sector, nodal_diameter) = (1, None, Some(3));
    rotor.initial =
        vec![InitialSettings { mode, sector, nodal_diameter, phase: 0.0, displacement: 0.0, velocity: 0.0 }];
    models::on_ring(&mut scene, models::ring(24, 3), 0.01);
    let ring = &mut scene.settings.structures[1];
    (ring.thermal, ring.load) = (true, Some(LoadSettings { order: 2, amplitude: 0.0, phase: 0.0 }));
    scene.settings.surfaces[0].patches = Some(PatchSettings { around: 8, along: 1 });
    let contact = &mut scene.settings.contacts[0];
    contact.slave_heat_fraction = Some(0.4);
    contact.coating = Some(CoatingSettings {
        thickness: 1e-3,
        modulus: 0.0,
        yield_stress: 0.0,
        hardening: 0.0,
        cells_around: 360,
        cells_along: 5,
        contact_width: None,
        cutting: Some(CuttingSettings { specific_energy: 1e8, normal_ratio: 1.0 }),
    });
    let outputs = &mut scene.settings.outputs;
    (outputs.wear, outputs.wear_profile, outputs.slave_displacement, outputs.support_reaction) =
        (true, true, true, true);
    let rom = &mut scene.roms[1];
    let zeros = |columns: usize| DMatrix::zeros(SUPPORT_ROWS, columns);
    let patches = rom.extras.thermal.as_ref().map_or(0, |thermal| thermal.patches.len());
    let (stiffness, mass) = (zeros(rom.order()), zeros(rom.order()));
    rom.extras.support = Some(SupportRows { stiffness, mass, thermal: zeros(patches) });
    scene
}

/// Returns a scene with a rigid casing and every option that it permits.
pub fn rigid() -> Scene {
    let mut rom = models::blade(36);
    rom.extras.spin = Some(models::spin(rom.order()));
    let whole = ThermalPatch { angle: [0.0, std::f64::consts::TAU], axial: [-1.0, 1.0] };
    rom.extras.thermal = Some(Thermal { loads: DMatrix::zeros(rom.order(), 1), patches: vec![whole] });
    let points = ["edge_1", "edge_2"].map(|name| models::node(name, rom.contact_nodes[0].position, 0.0)).to_vec();
    let two = |rows: usize| DMatrix::from_fn(rows * points.len(), rom.order(), |i, j| rom.contact_map[(i % 6, j)]);
    let (moved, stress) = (two(3), two(6));
    rom.extras.watched = Some(WatchedPoints { map: moved, points: points.clone() });
    let static_stress = DMatrix::zeros(6 * points.len(), 1);
    (rom.extras.stress_thermal, rom.extras.stress_centrifugal) = (Some(static_stress.clone()), Some(static_stress));
    rom.extras.stress = Some(WatchedPoints { map: stress, points });
    let mut scene = models::bumps(rom);
    let settings = &mut scene.settings;
    settings.time.tolerance = Some(1e-3);
    settings.structures[0].speed = 1800.0;
    settings.surfaces[0].shape = Shape::TwoLobe { depth: 1.2, width: 0.15, phase: 0.0 };
    settings.surfaces[0].ramp_time = 1e-4;
    settings.outputs = OutputSettings {
        watched_sectors: vec![1],
        all_sectors: true,
        nodal_diameters: Some(18),
        energies: true,
        instantaneous_forces: true,
        stress: true,
        modal_amplitudes: Some(3),
        tip_displacements: true,
        casing_forces: true,
        ..OutputSettings::default()
    };
    settings.experiment.communication_step = 1e-5;
    scene
}

/// Option in the words of the user guide, and a function that switches it off.
pub type Switch = (&'static str, fn(&mut Scene));

/// All options that add variables, in a scene with a flexible casing.
pub const OPTIONS: [Switch; 32] = [
    ("`tolerance`, or the scheme `galerkin`", |scene| scene.settings.time.tolerance = None),
    ("`motion = \"rotating\"`", |scene| {
        let rotor = &mut scene.settings.structures[0];
        (rotor.motion, rotor.speed, rotor.spin) = (BodyMotion::Still, 0.0, SpinSettings::default());
        (rotor.whirl, rotor.axial_shift) = (false, false);
        (rotor.excitation, rotor.softening) = (None, 0.0);
        rotor.initial.clear();
    }),
    ("`excitation`", |scene| scene.settings.structures[0].excitation = None),
    ("`initial`", |scene| scene.settings.structures[0].initial.clear()),
    ("`damping_ratios`", |scene| scene.settings.structures[0].damping_ratios.clear()),
    ("`softening`", |scene| scene.settings.structures[0].softening = 0.0),
    ("`thermal = true` of the rotor", |scene| {
        (scene.settings.structures[0].thermal, scene.settings.structures[0].softening) = (false, 0.0);
    }),
    ("`whirl = true`", |scene| scene.settings.structures[0].whirl = false),
    ("`axial_shift = true`", |scene| scene.settings.structures[0].axial_shift = false),
    ("`structure` of the surface", |scene| {
        scene.settings.structures.truncate(1);
        scene.roms.truncate(1);
        scene.settings.surfaces[0].structure = None;
        (scene.settings.outputs.slave_displacement, scene.settings.outputs.support_reaction) = (false, false);
    }),
    ("`thermal = true`", |scene| scene.settings.structures[1].thermal = false),
    ("`load` of the casing", |scene| scene.settings.structures[1].load = None),
    ("`moving = true`", |scene| scene.settings.surfaces[0].moving = false),
    ("a shape other than `circular`", |scene| scene.settings.surfaces[0].shape = Shape::Circular {}),
    ("`friction` > 0", |scene| {
        // Without friction there is no heat to distribute.
        (scene.settings.contacts[0].friction, scene.settings.contacts[0].slave_heat_fraction) = (0.0, None);
    }),
    ("`slave_heat_fraction`", |scene| scene.settings.contacts[0].slave_heat_fraction = None),
    ("`coating`", |scene| {
        scene.settings.contacts[0].coating = None;
        (scene.settings.outputs.wear, scene.settings.outputs.wear_profile) = (false, false);
    }),
    ("`cutting` of the coating", |scene| {
        let coating = scene.settings.contacts[0].coating.as_mut();
        coating.into_iter().for_each(|own| (own.cutting, own.modulus, own.contact_width) = (None, 1e9, Some(2e-3)));
    }),
    ("`watched_sectors`", |scene| {
        scene.settings.outputs.watched_sectors.clear();
        let outputs = &mut scene.settings.outputs;
        (outputs.stress, outputs.tip_displacements, outputs.modal_amplitudes) = (false, false, None);
    }),
    ("`stress = true`", |scene| scene.settings.outputs.stress = false),
    ("watched points of the ROM", |scene| scene.roms[0].extras.watched = None),
    ("`all_sectors = true`", |scene| scene.settings.outputs.all_sectors = false),
    ("`nodal_diameters`", |scene| scene.settings.outputs.nodal_diameters = None),
    ("`energies = true`", |scene| scene.settings.outputs.energies = false),
    ("`instantaneous_forces = true`", |scene| scene.settings.outputs.instantaneous_forces = false),
    ("`modal_amplitudes`", |scene| scene.settings.outputs.modal_amplitudes = None),
    ("`tip_displacements = true`", |scene| scene.settings.outputs.tip_displacements = false),
    ("`casing_forces = true`", |scene| scene.settings.outputs.casing_forces = false),
    ("`support_reaction = true`", |scene| scene.settings.outputs.support_reaction = false),
    ("`wear_profile = true`", |scene| scene.settings.outputs.wear_profile = false),
    ("`wear = true`", |scene| scene.settings.outputs.wear = false),
    ("`slave_displacement = true`", |scene| scene.settings.outputs.slave_displacement = false),
];

/// Groups of options, each of which is sufficient, for variables that no single option switches off.
pub const ALTERNATIVES: [Switch; 3] = [
    ("`patches` of the surface or `thermal = true`", |scene| {
        scene.settings.surfaces[0].patches = None;
        scene.settings.structures[1].thermal = false;
    }),
    ("`spin.growth`, `thermal` or `load`", |scene| {
        scene.settings.structures[0].spin.growth = false;
        (scene.settings.structures[0].thermal, scene.settings.structures[0].softening) = (false, 0.0);
        scene.settings.structures[1].thermal = false;
        scene.settings.structures[1].load = None;
    }),
    ("`spin.stiffening` or `softening`", |scene| {
        scene.settings.structures[0].spin.stiffening = false;
        scene.settings.structures[0].softening = 0.0;
    }),
];

/// Returns a description of the scene; parts without influence on variables are short.
pub fn description<'a>(table: &'a VariableTable, roms: &'a [Rom], fmi3_arrays: bool) -> Description<'a> {
    Description {
        model_name: "rotor_rub",
        identifier: "tiprub",
        about: "It steps.",
        steps: "They are long.",
        token: "{}",
        description: "",
        generated: "",
        generation_tool: "tiprub",
        version: "1",
        author: "-",
        copyright: "-",
        license: "-",
        experiment: DefaultExperiment { start: 0.0, stop: 0.1, step: 1e-5 },
        fixed_internal_step: None,
        patches_of_roms: true,
        table,
        fmi3_arrays,
        structures: ["rotor", "ring"].into_iter().zip(roms).collect(),
        features: Vec::new(),
        limits: Vec::new(),
        warnings: Vec::new(),
    }
}
