//! Table of all physical effects and features of the machinery, for `tiprub inspect` and for the guide.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{
    BodyMotion, ContactSettings, ExcitationSettings, InitialSettings, InputInterpolation, LoadSettings,
    StructureSettings, SurfaceSettings,
};
use tiprub_core::{Rom, Scene};

/// Topic of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RowGroup {
    /// Physical effect.
    Physics,
    /// Feature of the machinery.
    Machinery,
}

/// Effect or feature that a scene has or leaves out.
pub struct Effect {
    /// Name of the effect.
    pub name: &'static str,
    /// Topic of the effect.
    pub group: RowGroup,
    /// Keys or models that the effect needs.
    pub takes: &'static str,
    /// Function that returns whether the effect is meaningful for a scene.
    pub concerns: fn(&Scene) -> bool,
    /// Function that returns whether the scene has it; always false if it is not supported.
    pub has: fn(&Scene) -> bool,
    /// Function that adds the effect to a scene, if keys alone can do so.
    pub with: Option<fn(&mut Scene)>,
}

fn rotors(scene: &Scene) -> impl Iterator<Item = (&StructureSettings, &Rom)> {
    let all = scene.settings.structures.iter().zip(&scene.roms);
    all.filter(|(structure, _)| structure.motion == BodyMotion::Rotating)
}

fn rotates(scene: &Scene) -> bool {
    rotors(scene).next().is_some()
}

fn each_rotor(scene: &mut Scene, change: impl Fn(&mut StructureSettings)) {
    let all = scene.settings.structures.iter_mut();
    all.filter(|structure| structure.motion == BodyMotion::Rotating).for_each(change);
}

fn rotor(scene: &Scene, has: impl Fn(&StructureSettings) -> bool) -> bool {
    rotors(scene).any(|(structure, _)| has(structure))
}

fn casing(scene: &Scene, has: impl Fn(&StructureSettings) -> bool) -> bool {
    scene.settings.structures.iter().any(|structure| structure.motion == BodyMotion::Still && has(structure))
}

fn flexible(scene: &Scene) -> bool {
    scene.settings.surfaces.iter().any(|surface| surface.structure.is_some() && !surface.rigid)
}

fn each_casing(scene: &mut Scene, change: impl Fn(&mut StructureSettings)) {
    let all = scene.settings.structures.iter_mut();
    all.filter(|structure| structure.motion == BodyMotion::Still).for_each(change);
}

fn contact(scene: &Scene, has: impl Fn(&ContactSettings) -> bool) -> bool {
    scene.settings.contacts.iter().any(has)
}

fn surface(scene: &Scene, has: impl Fn(&SurfaceSettings) -> bool) -> bool {
    scene.settings.surfaces.iter().any(has)
}

fn always(_: &Scene) -> bool {
    true
}

fn never(_: &Scene) -> bool {
    false
}

const fn physics(
    name: &'static str,
    takes: &'static str,
    concerns: fn(&Scene) -> bool,
    has: fn(&Scene) -> bool,
) -> Effect {
    Effect { name, group: RowGroup::Physics, takes, concerns, has, with: None }
}

const fn machinery(name: &'static str, takes: &'static str, has: fn(&Scene) -> bool) -> Effect {
    Effect { name, group: RowGroup::Machinery, takes, concerns: always, has, with: None }
}

impl Effect {
    const fn by(self, with: fn(&mut Scene)) -> Self {
        Self { with: Some(with), ..self }
    }

    const fn of_rotors(self) -> Self {
        Self { concerns: rotates, ..self }
    }
}

/// All effects.
pub static EFFECTS: &[Effect] = &[
    physics("friction", "`contact.friction`", always, |scene| contact(scene, |one| one.friction > 0.0)),
    physics("sticking friction", "`contact.solver = \"coulomb\"`", always, |scene| {
        contact(scene, |one| one.solver.sticks())
    })
    .by(|scene| scene.settings.contacts.iter_mut().for_each(|one| one.solver = Solver::STICKING)),
    physics(
        "separate contact of both sides of the tip",
        "a ROM with two rows of patches (`--contact-rows 2`)",
        rotates,
        |scene| rotors(scene).any(|(_, rom)| rom.rows() > 1),
    ),
    physics("flexible casing", "`surface.structure`, a ROM of the casing", rotates, flexible),
    physics("blades coupled through the disk", "a ROM of a sector (`tiprub reduce sector`)", rotates, |scene| {
        scene.roms.iter().any(Rom::is_cyclic)
    }),
    physics("mistuning", "`structure.frequency_factors`, one per blade", rotates, |scene| {
        rotor(scene, |one| !one.frequency_factors.is_empty())
    })
    .by(|scene| {
        let sectors: Vec<usize> = scene.roms.iter().map(|rom| rom.sectors).collect();
        let all = scene.settings.structures.iter_mut().zip(sectors);
        for (structure, sectors) in all.filter(|(structure, _)| structure.motion == BodyMotion::Rotating) {
            structure.frequency_factors = (0..sectors).map(|blade| [1.0, 1.001][blade % 2]).collect();
        }
    }),
    physics("centrifugal stiffening", "`structure.spin.stiffening`, a ROM with spin matrices", rotates, |scene| {
        rotor(scene, |one| one.spin.stiffening)
    })
    .by(|scene| each_rotor(scene, |one| one.spin.stiffening = true)),
    physics("centrifugal growth", "`structure.spin.growth`, a ROM with spin matrices", rotates, |scene| {
        rotor(scene, |one| one.spin.growth)
    })
    .by(|scene| each_rotor(scene, |one| one.spin.growth = true)),
    physics("Coriolis force", "`structure.spin.coriolis`, a ROM with spin matrices", rotates, |scene| {
        rotor(scene, |one| one.spin.coriolis)
    })
    .by(|scene| each_rotor(scene, |one| one.spin.coriolis = true)),
    physics("whirl of the shaft", "`structure.whirl`", rotates, |scene| rotor(scene, |one| one.whirl))
        .by(|scene| each_rotor(scene, |one| one.whirl = true)),
    physics("axial shift of the rotor", "`structure.axial_shift`", rotates, |scene| {
        rotor(scene, |one| one.axial_shift)
    })
    .by(|scene| each_rotor(scene, |one| one.axial_shift = true)),
    physics("temperature of the blades", "`structure.thermal` of the rotor", rotates, |scene| {
        rotor(scene, |one| one.thermal)
    })
    .by(|scene| each_rotor(scene, |one| one.thermal = true)),
    physics("softening of heated blades", "`structure.softening`, `structure.thermal`", rotates, |scene| {
        rotor(scene, |one| one.softening > 0.0)
    })
    .by(|scene| each_rotor(scene, |one| (one.thermal, one.softening) = (true, 5e-4))),
    physics("excitation by engine orders", "`structure.excitation`", rotates, |scene| {
        rotor(scene, |one| one.excitation.is_some())
    })
    .by(|scene| {
        let excitation =
            ExcitationSettings { order: 2, mode: Some(1), node: None, direction: None, amplitude: 0.0, phase: 0.0 };
        each_rotor(scene, |one| one.excitation = Some(excitation.clone()));
    }),
    physics("initial motion of the blades", "`structure.initial`", rotates, |scene| {
        rotor(scene, |one| !one.initial.is_empty())
    })
    .by(|scene| {
        let initial = InitialSettings {
            mode: 1,
            sector: None,
            nodal_diameter: None,
            phase: 0.0,
            displacement: 0.0,
            velocity: 0.0,
        };
        each_rotor(scene, |one| one.initial = vec![initial]);
    }),
    physics("damping ratios of individual modes", "`structure.damping_ratios`", rotates, |scene| {
        scene.settings.structures.iter().any(|one| !one.damping_ratios.is_empty())
    })
    .by(|scene| each_rotor(scene, |one| one.damping_ratios = vec![1e-3])),
    physics("moving casing", "`surface.moving`", rotates, |scene| surface(scene, |one| one.moving))
        .by(|scene| scene.settings.surfaces.iter_mut().for_each(|one| one.moving = true)),
    physics("temperature of the casing", "`structure.thermal` of the casing", flexible, |scene| {
        casing(scene, |one| one.thermal)
    })
    .by(|scene| each_casing(scene, |one| one.thermal = true)),
    physics("nodal-diameter load on the casing", "`structure.load` of the casing", flexible, |scene| {
        casing(scene, |one| one.load.is_some())
    })
    .by(|scene| each_casing(scene, |one| one.load = Some(LoadSettings { order: 2, amplitude: 0.0, phase: 0.0 }))),
    physics("wear of a coating", "`contact.coating`, one-row ROM, fixed steps", rotates, |scene| {
        contact(scene, |one| one.coating.is_some())
    }),
    physics("cutting of a coating", "`contact.coating.cutting`", rotates, |scene| {
        contact(scene, |one| one.coating.is_some_and(|coating| coating.cutting.is_some()))
    }),
    physics("friction heat shared with the casing", "`contact.slave_heat_fraction`", rotates, |scene| {
        contact(scene, |one| one.slave_heat_fraction.is_some())
    })
    .by(|scene| scene.settings.contacts.iter_mut().for_each(|one| one.slave_heat_fraction = Some(0.5))),
    physics("inertia of contact nodes", "a scheme other than `galerkin` and `massless-boundary`", always, |scene| {
        !scene.settings.time.scheme.properties().quasi_static
    }),
    physics("rebound of contact nodes", "not supported: a node stops when its gap closes", always, never),
    physics("rounded edges of the tip", "not supported: rows of patches touch at sharp edges", rotates, never),
    physics(
        "second-order change of gaps with displacement",
        "not supported: rejected where u²/2r reaches the clearance",
        rotates,
        never,
    ),
    physics("Euler force due to a changing speed", "not supported", rotates, never),
    physics("large deformation within a structure", "not supported: structures are linear", always, never),
    physics("temperature fields within a blade", "not supported: one temperature per rotor", rotates, never),
    physics("heat conduction", "a separate FMU: `tiprub thermal`", rotates, never),
    physics("dynamics of the shaft", "a model coupled to the FMU: examples/shaft", rotates, never),
    physics(
        "aerodynamic forces and damping",
        "a model coupled to the FMU through `structure.excitation`",
        rotates,
        never,
    ),
    physics("friction in blade roots and shrouds", "not supported: include it in the damping ratios", rotates, never),
    physics("chips, and wear of the blade tip", "not supported: only a coating wears", rotates, never),
    machinery("adaptive steps", "`time.scheme = \"galerkin\"`", |scene| {
        scene.settings.time.scheme.properties().adaptive
    })
    .by(|scene| scene.settings.time.scheme = Scheme::ADAPTIVE),
    machinery("limited number of internal steps", "`time.max_internal_steps`, or adaptive steps", |scene| {
        scene.settings.bounds_steps()
    })
    .by(|scene| scene.settings.time.max_internal_steps = Some(0)),
    machinery("inputs that jump", "`time.input_interpolation = \"hold\"`", |scene| {
        scene.settings.time.input_interpolation == InputInterpolation::Hold
    })
    .by(|scene| scene.settings.time.input_interpolation = InputInterpolation::Hold),
    machinery("spline surface through data points", "`surface.spline`, or a flexible casing", |scene| {
        surface(scene, |one| one.spline.is_some()) || flexible(scene)
    })
    .of_rotors()
    .by(|scene| scene.settings.surfaces.iter_mut().for_each(|one| one.spline = Some(Default::default()))),
    machinery("several rotors or contact pairs", "more `[[structure]]` and `[[contact]]` tables", |scene| {
        scene.settings.contacts.len() > 1
    }),
    machinery("energy balance", "`outputs.energies`", |scene| scene.settings.outputs.energies)
        .by(|scene| scene.settings.outputs.energies = true),
    machinery("clearance and force of every blade", "`outputs.all_sectors`", |scene| {
        scene.settings.outputs.all_sectors
    })
    .of_rotors()
    .by(|scene| scene.settings.outputs.all_sectors = true),
    machinery("amplitudes by nodal diameter", "`outputs.nodal_diameters`", |scene| {
        scene.settings.outputs.nodal_diameters.is_some()
    })
    .of_rotors()
    .by(|scene| scene.settings.outputs.nodal_diameters = Some(2)),
    machinery("instantaneous forces", "`outputs.instantaneous_forces`", |scene| {
        scene.settings.outputs.instantaneous_forces
    })
    .by(|scene| scene.settings.outputs.instantaneous_forces = true),
    machinery("stress", "`outputs.stress`, a ROM with stress recovery", |scene| scene.settings.outputs.stress)
        .of_rotors()
        .by(|scene| scene.settings.outputs.stress = true),
    machinery("modal amplitudes", "`outputs.modal_amplitudes`", |scene| {
        scene.settings.outputs.modal_amplitudes.is_some()
    })
    .by(|scene| scene.settings.outputs.modal_amplitudes = Some(3)),
    machinery("displacements of the tip", "`outputs.tip_displacements`", |scene| {
        scene.settings.outputs.tip_displacements
    })
    .by(|scene| scene.settings.outputs.tip_displacements = true),
    machinery("force and moment on the casing", "`outputs.casing_forces`", |scene| {
        scene.settings.outputs.casing_forces
    })
    .of_rotors()
    .by(|scene| scene.settings.outputs.casing_forces = true),
    machinery("reaction at the support of the casing", "`outputs.support_reaction`, a flexible casing", |scene| {
        scene.settings.outputs.support_reaction
    })
    .of_rotors()
    .by(|scene| scene.settings.outputs.support_reaction = true),
    machinery("displacement of the casing", "`outputs.slave_displacement`, a flexible casing", |scene| {
        scene.settings.outputs.slave_displacement
    })
    .of_rotors()
    .by(|scene| scene.settings.outputs.slave_displacement = true),
    machinery("stress in coupled sectors and casings", "not supported", never).of_rotors(),
    machinery("one structure with contact nodes and a surface", "not supported: use two structures", never),
    machinery(
        "shells, beams, constraints, anisotropic materials",
        "not supported: use solid elements, or your own matrices",
        never,
    ),
    machinery(
        "derivatives with respect to current inputs",
        "not supported: outputs depend on the start of the step",
        never,
    ),
    machinery("wear map", "`outputs.wear`, a coating", |scene| scene.settings.outputs.wear)
        .of_rotors()
        .by(|scene| scene.settings.outputs.wear = true),
    machinery("friction power per patch", "`surface.patches`", |scene| {
        surface(scene, |one| one.patches.is_some()) || casing(scene, |one| one.thermal)
    })
    .of_rotors()
    .by(|scene| {
        let patches = tiprub_core::scene::settings::PatchSettings { around: 8, along: 1 };
        scene.settings.surfaces.iter_mut().for_each(|one| one.patches = Some(patches));
    }),
];
