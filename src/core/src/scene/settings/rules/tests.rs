use nalgebra::{Complex, DMatrix};
use tiprub_cosim::ThermalPatch;

use super::all;
use crate::scene::method::{Scheme, Solver};
use crate::scene::rom::{
    ContactGrid, ContactNode, DisplacementFrame, Harmonic, RomChecks, RomExtras, Spin, Thermal, WatchedPoints,
};
use crate::scene::settings::*;
use crate::{Rom, Scene};

fn rom(frame: DisplacementFrame) -> Rom {
    let node =
        ContactNode { name: "tip".into(), position: [0.25, 0.0, 0.0], meridional_slope: 0.0, ..ContactNode::default() };
    let grid = Some(ContactGrid { around: 8, along: 2, closed: frame == DisplacementFrame::Cylindrical });
    Rom {
        name: "rom".into(),
        origin: String::new(),
        sectors: 1,
        frame,
        mass: DMatrix::identity(4, 4),
        stiffness: DMatrix::identity(4, 4),
        damping_ratio: 0.01,
        contact_map: DMatrix::identity(3, 4),
        contact_nodes: vec![node],
        checks: RomChecks::default(),
        extras: RomExtras { grid, ..RomExtras::default() },
    }
}

/// Scene with `master` and a surface of `under`, which stands still.
fn scene(motion: BodyMotion, frame: DisplacementFrame) -> Scene {
    let structure = |name: &str, motion| StructureSettings { name: name.into(), motion, ..Default::default() };
    let settings = SceneSettings {
        name: "scene".into(),
        preset: Preset::None,
        accept_implausible: false,
        silence: Vec::new(),
        structures: vec![structure("master", motion), structure("under", BodyMotion::Still)],
        surfaces: vec![SurfaceSettings {
            name: "surface".into(),
            structure: Some("under".into()),
            ..Default::default()
        }],
        contacts: vec![contact("surface")],
        description: String::new(),
        time: TimeSettings::default(),
        outputs: OutputSettings::default(),
        experiment: ExperimentSettings { start: 0.0, stop: 1.0, communication_step: 1e-3 },
    };
    Scene { settings, roms: vec![rom(frame), rom(frame)] }
}

fn contact(surface: &str) -> ContactSettings {
    ContactSettings { master: "master".into(), slave: surface.into(), friction: 0.1, ..Default::default() }
}

fn rotor() -> Scene {
    scene(BodyMotion::Rotating, DisplacementFrame::Cylindrical)
}

fn flight() -> Scene {
    scene(BodyMotion::Free, DisplacementFrame::Cartesian)
}

/// Requests the stress of a master.
fn stressed(scene: &mut Scene) {
    let points = scene.roms[0].contact_nodes.clone();
    scene.roms[0].extras.stress = Some(WatchedPoints { map: DMatrix::zeros(6, 4), points });
    (scene.settings.outputs.stress, scene.settings.outputs.watched_sectors) = (true, vec![1]);
}

fn cut() -> Option<CoatingSettings> {
    let cutting = Some(CuttingSettings { specific_energy: 1e9, normal_ratio: 1.0 });
    Some(CoatingSettings {
        modulus: 0.0,
        yield_stress: 0.0,
        hardening: 0.0,
        contact_width: None,
        cutting,
        ..coating()?
    })
}

fn coating() -> Option<CoatingSettings> {
    let (thickness, modulus, yield_stress, hardening) = (1e-4, 2e8, 1e6, 2e7);
    Some(CoatingSettings {
        thickness,
        modulus,
        yield_stress,
        hardening,
        cells_around: 500,
        cells_along: 3,
        contact_width: Some(3e-3),
        cutting: None,
    })
}

/// Adds a second contact of the same master, on a surface of the same structure.
fn second(settings: &mut SceneSettings) {
    settings.surfaces.push(SurfaceSettings { name: "other".into(), ..settings.surfaces[0].clone() });
    settings.contacts.push(contact("other"));
    for (contact, nodes) in settings.contacts.iter_mut().zip(["a", "b"]) {
        contact.nodes = Some(nodes.into());
    }
}

/// Makes a scene valid for `galerkin`: a rigid surface at a distance.
fn galerkin(settings: &mut SceneSettings) {
    settings.surfaces[0].structure = None;
    settings.contacts[0].gap = 1e-4;
    settings.time.scheme = Scheme::Galerkin;
}

fn couple(rom: &mut Rom) {
    let matrix = DMatrix::<Complex<f64>>::identity(4, 4);
    rom.extras.harmonics =
        vec![Harmonic { mass: matrix.clone(), stiffness: matrix.clone(), contact_map: matrix.rows(0, 3).into() }];
}

fn excitation() -> ExcitationSettings {
    ExcitationSettings { order: 2, mode: Some(1), node: None, direction: None, amplitude: 1.0, phase: 0.0 }
}

type Change = fn(&mut Scene);

/// Changes that violate a rule in a scene with a rotor, and the beginning of the message.
const OF_ROTORS: &[(&str, Change)] = &[
    ("structure[2].whirl: requires `motion = \"rotating\"`", |scene| scene.settings.structures[1].whirl = true),
    ("structure[1].load: requires `motion = \"still\"`", |scene| {
        scene.settings.structures[0].load = Some(LoadSettings { order: 2, amplitude: 1.0, phase: 0.0 });
    }),
    ("structure[1].softening: requires `structure.thermal`", |scene| scene.settings.structures[0].softening = 1e-4),
    ("structure[2].excitation: requires `motion = \"rotating\"`", |scene| {
        scene.settings.structures[1].excitation = Some(excitation());
    }),
    ("time.scheme: `galerkin` cannot be combined with `structure.thermal` of a rotor", |scene| {
        galerkin(&mut scene.settings);
        scene.settings.structures[0].excitation = Some(excitation());
    }),
    ("structure[1].initial.sector: cannot be combined with a ROM whose sectors", |scene| {
        let one = InitialSettings {
            mode: 1,
            sector: Some(1),
            nodal_diameter: None,
            phase: 0.0,
            displacement: 1e-6,
            velocity: 0.0,
        };
        scene.settings.structures[0].initial = vec![one];
        couple(&mut scene.roms[0]);
    }),
    ("structure[2].velocity: requires `motion = \"free\"`", |scene| {
        scene.settings.structures[1].velocity = [0.0, 1.0, 0.0];
    }),
    ("surface[1].structure: requires a structure with", |scene| {
        scene.settings.surfaces[0].structure = Some("master".into());
    }),
    ("surface[1].structure: cannot be combined with a structure that is the master", |scene| {
        scene.settings.contacts[0].master = "under".into();
    }),
    ("surface[1].rigid: requires a free master", |scene| scene.settings.surfaces[0].rigid = true),
    ("contact[1].master: a structure with several contacts requires", |scene| {
        second(&mut scene.settings);
        scene.settings.contacts[0].nodes = None;
    }),
    ("contact[1].meridian: cannot be combined with a surface spline", |scene| {
        scene.settings.contacts[0].meridian = Meridian::Cylinder;
    }),
    ("contact[1].slave_heat_fraction: requires `contact.friction`", |scene| {
        (scene.settings.contacts[0].friction, scene.settings.contacts[0].slave_heat_fraction) = (0.0, Some(0.5));
    }),
    ("contact[2].coating: cannot be combined with a contact that is solved together", |scene| {
        second(&mut scene.settings);
        scene.settings.contacts[1].coating = coating();
    }),
    ("contact[1].coating.modulus: cannot be combined with `contact.coating.cutting`", |scene| {
        scene.settings.contacts[0].coating = cut().map(|cut| CoatingSettings { modulus: 2e8, ..cut });
    }),
    ("contact[1].coating.contact_width: cannot be combined with `contact.coating.cutting`", |scene| {
        scene.settings.contacts[0].coating = cut().map(|cut| CoatingSettings { contact_width: Some(3e-3), ..cut });
    }),
    ("time.scheme: `massless-boundary` cannot be combined with `contact.coating.cutting`", |scene| {
        scene.settings.contacts[0].coating = cut();
        scene.settings.time.scheme = Scheme::MasslessBoundary;
    }),
    ("outputs.support_reaction: requires `surface.structure`", |scene| {
        scene.settings.surfaces[0].structure = None;
        scene.settings.outputs.support_reaction = true;
    }),
    ("outputs.support_reaction: requires support rows", |scene| {
        scene.settings.outputs.support_reaction = true;
    }),
    ("time.scheme: `galerkin` cannot be combined with `outputs.support_reaction`", |scene| {
        galerkin(&mut scene.settings);
        scene.settings.surfaces[0].structure = Some("under".into());
        scene.settings.outputs.support_reaction = true;
    }),
    ("outputs.modal_amplitudes: cannot be combined with a rotor whose sectors", |scene| {
        scene.settings.outputs.modal_amplitudes = Some(1);
        couple(&mut scene.roms[0]);
    }),
    ("contact[2].solver: requires the solver of contact[1]", |scene| {
        second(&mut scene.settings);
        scene.settings.contacts[1].solver = Solver::Film;
    }),
    ("outputs.wear: requires `contact.coating`", |scene| scene.settings.outputs.wear = true),
    ("outputs.stress: requires `outputs.watched_sectors`", |scene| {
        scene.settings.outputs.stress = true;
        scene.settings.outputs.watched_sectors.clear();
    }),
    ("outputs.stress: requires stress points in the ROM of a rotor", |scene| {
        scene.settings.outputs.stress = true;
    }),
    ("outputs.stress: stress of a rotor with `structure.thermal` requires static thermal stress", |scene| {
        stressed(scene);
        let patches = vec![ThermalPatch { angle: [0.0, 1.0], axial: [0.0, 1.0] }];
        scene.roms[0].extras.thermal = Some(Thermal { loads: DMatrix::zeros(4, 1), patches });
        scene.settings.structures[0].thermal = true;
    }),
    ("outputs.stress: stress of a rotor with `structure.spin.growth` requires static centrifugal stress", |scene| {
        stressed(scene);
        let none = DMatrix::zeros(4, 4);
        scene.roms[0].extras.spin = Some(Spin {
            stiffness_speed2: none.clone(),
            stiffness_speed4: none.clone(),
            coriolis: none,
            centrifugal_load: vec![0.0; 4],
            centrifugal_load_speed4: vec![0.0; 4],
            largest_speed: 1.0,
        });
        scene.settings.structures[0].spin.growth = true;
    }),
    ("outputs.slave_displacement: requires `surface.structure`", |scene| {
        scene.settings.surfaces[0].structure = None;
        scene.settings.outputs.slave_displacement = true;
    }),
    ("contact[1].solver: a solver other than `lcp` cannot be combined with a coating", |scene| {
        (scene.settings.contacts[0].coating, scene.settings.contacts[0].solver) = (coating(), Solver::Film);
    }),
    ("time.scheme: `massless-boundary` cannot be combined with `structure.spin.coriolis`", |scene| {
        scene.settings.structures[0].spin.coriolis = true;
        scene.settings.time.scheme = Scheme::MasslessBoundary;
    }),
    ("time.scheme: `massless-boundary` cannot be combined with several surfaces", |scene| {
        second(&mut scene.settings);
        scene.settings.time.scheme = Scheme::MasslessBoundary;
    }),
    ("time.scheme: a scheme other than `central-difference` cannot be combined with `preset = \"paper\"`", |scene| {
        scene.settings.preset = Preset::Paper;
        scene.settings.contacts[0].solver = Solver::Film;
    }),
    ("contact[1].solver: a solver other than `film` cannot be combined with `preset = \"paper\"`", |scene| {
        scene.settings.preset = Preset::Paper;
        scene.settings.time.scheme = Scheme::CentralDifference;
    }),
    ("time.scheme: `galerkin` cannot be combined with `structure.spin`", |scene| {
        galerkin(&mut scene.settings);
        scene.settings.structures[0].spin.growth = true;
    }),
    ("time.scheme: `galerkin` cannot be combined with `contact.coating`", |scene| {
        galerkin(&mut scene.settings);
        scene.settings.contacts[0].coating = coating();
    }),
    ("time.scheme: `galerkin` cannot be combined with `contact.solver", |scene| {
        galerkin(&mut scene.settings);
        scene.settings.contacts[0].solver = Solver::Film;
    }),
    ("time.scheme: `massless-boundary` cannot be combined with `contact.solver", |scene| {
        scene.settings.time.scheme = Scheme::MasslessBoundary;
        scene.settings.contacts[0].solver = Solver::Film;
    }),
    ("time.scheme: `galerkin` requires a clearance", |scene| {
        galerkin(&mut scene.settings);
        scene.settings.contacts[0].gap = 0.0;
    }),
    ("parameter `scheme`: `massless-boundary` or `galerkin` requires more than three modes", |scene| {
        scene.settings.time.scheme = Scheme::MasslessBoundary;
        scene.roms[0].mass = DMatrix::identity(3, 3);
    }),
    ("structure[1].rom: a structure in a contact around an axis requires `frame = cylindrical`", |scene| {
        scene.roms[0].frame = DisplacementFrame::Cartesian
    }),
    ("structure[1].spin.growth: requires spin matrices", |scene| scene.settings.structures[0].spin.growth = true),
    ("structure[1].frequency_factors: cannot be combined with a ROM whose sectors", |scene| {
        scene.settings.structures[0].frequency_factors = vec![1.0];
        couple(&mut scene.roms[0]);
    }),
    ("structure[2].thermal: requires thermal loads", |scene| scene.settings.structures[1].thermal = true),
    ("contact[1].coating: a coating without `cutting` requires `contact.coating.contact_width`", |scene| {
        scene.settings.contacts[0].coating =
            coating().map(|coating| CoatingSettings { contact_width: None, ..coating });
    }),
    ("contact[1].coating: cannot be combined with a ROM with several rows of contact patches", |scene| {
        scene.settings.contacts[0].coating = coating();
        scene.roms[0].extras.rows = Some(2);
    }),
    ("structure[2].load: requires a contact grid", |scene| {
        scene.settings.structures[1].load = Some(LoadSettings { order: 2, amplitude: 1.0, phase: 0.0 });
        scene.roms[1].extras.grid = None;
    }),
    ("surface[1].structure: cannot be combined with a structure whose sectors", |scene| couple(&mut scene.roms[1])),
    ("surface[1].structure: a surface around an axis requires a contact grid", |scene| {
        scene.roms[1].extras.grid = None
    }),
];

/// Changes that violate a rule in a scene with a free master, and the beginning of the message.
const OF_FREE_MASTERS: &[(&str, Change)] = &[
    ("structure[1].thermal: cannot be combined with `motion = \"free\"`", |scene| {
        scene.settings.structures[0].thermal = true
    }),
    ("surface[1].moving: cannot be combined with a free master", |scene| scene.settings.surfaces[0].moving = true),
    ("contact[1].gap: cannot be combined with a free master", |scene| scene.settings.contacts[0].gap = 1e-3),
    ("contact[1].master: a free structure requires `surface.structure`", |scene| {
        scene.settings.surfaces[0].structure = None;
    }),
    ("outputs.casing_forces: cannot be combined with a scene with free masters only", |scene| {
        scene.settings.outputs.casing_forces = true;
    }),
    ("outputs.all_sectors: cannot be combined with a scene with free masters only", |scene| {
        scene.settings.outputs.all_sectors = true
    }),
    ("outputs.slave_displacement: requires `surface.structure` of a surface around an axis", |scene| {
        scene.settings.outputs.slave_displacement = true;
    }),
    ("time.input_interpolation: cannot be combined with a scene with free masters only", |scene| {
        scene.settings.time.input_interpolation = InputInterpolation::Hold;
    }),
    ("time.scheme: `massless-boundary` cannot be combined with a free master", |scene| {
        scene.settings.time.scheme = Scheme::MasslessBoundary;
    }),
    ("structure[2].rom: a free structure or one that it can touch requires `frame = cartesian`", |scene| {
        scene.roms[1].frame = DisplacementFrame::Cylindrical;
    }),
    ("structure[1].rom: a free structure or one that it can touch requires `sectors = 1`", |scene| {
        scene.roms[0].sectors = 2;
    }),
    ("surface[1].structure: the surface of a free master requires an open contact grid", |scene| {
        scene.roms[1].extras.grid = Some(ContactGrid { around: 8, along: 2, closed: true });
    }),
];

fn check(scene: &Scene, solver: Solver) -> crate::Result<()> {
    let relations = super::Relations::of(&scene.settings);
    scene.settings.check_parts(&relations)?;
    scene.settings.check_whole(&relations)?;
    scene.check_roms()?;
    scene.check_methods(scene.settings.time.scheme, solver)
}

#[test]
fn every_rule_rejects_its_violation_with_a_message() {
    let mut reported = Vec::new();
    for (whole, changes) in [(rotor(), OF_ROTORS), (flight(), OF_FREE_MASTERS)] {
        check(&whole, Solver::Lcp).unwrap();
        for (beginning, change) in changes {
            let mut scene = whole.clone();
            change(&mut scene);
            let error = check(&scene, scene.settings.contacts[0].solver).unwrap_err().to_string();
            assert!(error.starts_with(beginning), "{error:?} instead of {beginning:?}");
            reported.push(error);
        }
    }
    reported.push(check(&rotor(), Solver::Coulomb).unwrap_err().to_string());
    for rule in all() {
        let [features, relation, because, remedy] = rule.columns();
        let whole =
            |error: &String| [&relation, &because, &remedy].into_iter().all(|part| error.contains(part.as_str()));
        assert!(reported.iter().any(whole), "{features} {relation}: no case here breaks it");
    }
}
