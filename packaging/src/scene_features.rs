//! Describes the features of a scene beyond sliding contact of a rotor in a rigid casing, and the limits of the model.

use tiprub_core::scene::settings::{
    BodyMotion, CoatingSettings, ContactSettings, CuttingSettings, InputInterpolation, Preset, SceneSettings,
    StructureSettings, SurfaceSettings,
};
use tiprub_core::{Rom, Scene};

/// Returns one phrase for every feature that is off by default but on in the scene; empty for a plain scene.
pub fn features(scene: &Scene) -> Vec<String> {
    let settings = &scene.settings;
    let mut found = Vec::new();
    for (structure, rom) in settings.structures.iter().zip(&scene.roms) {
        of_structure(structure, rom, &mut found);
    }
    for surface in &settings.surfaces {
        of_surface(surface, scene, &mut found);
    }
    for contact in &settings.contacts {
        of_contact(contact, &mut found);
    }
    let scheme = settings.time.scheme;
    if scheme.properties().quasi_static && !scheme.properties().adaptive {
        found.push(format!("the highest modes are quasi-static: contact nodes have no mass ({})", scheme.name()));
    }
    if let Some(tolerance) = settings.time.step_tolerance() {
        let is_shared =
            scene.roms.iter().any(Rom::is_cyclic) || settings.surfaces.iter().any(|one| one.structure.is_some());
        let whose = if is_shared { "that all blades share" } else { "of every blade" };
        found.push(format!(
            "adaptive steps {whose}, with a tolerance of {tolerance:e} of the clearance; contact nodes have no \
             mass (galerkin)"
        ));
    }
    if settings.time.input_interpolation == InputInterpolation::Hold {
        found.push("inputs act immediately, and their jumps act as impacts (input_interpolation = \"hold\")".into());
    }
    found
}

/// Returns the scheme with the reason for its choice.
pub fn scheme(settings: &SceneSettings) -> String {
    let name = settings.time.scheme.name();
    match (&settings.time.scheme_reason, settings.preset) {
        (Some(reason), _) => format!("{name}, {reason}"),
        (None, Preset::Paper) => format!("{name}, set by preset = \"paper\""),
        (None, Preset::None) => format!("{name}, set in the scene"),
    }
}

fn of_structure(structure: &StructureSettings, rom: &Rom, found: &mut Vec<String>) {
    let name = &structure.name;
    if structure.motion == BodyMotion::Free {
        let [x, y, z] = structure.velocity;
        found.push(format!("`{name}` is a free body with the initial velocity {x}, {y}, {z} m/s along x, y, z"));
    }
    let spin = structure.spin;
    let effects = [("stiffening", spin.stiffening), ("growth", spin.growth), ("coriolis", spin.coriolis)];
    let effects: Vec<&str> = effects.into_iter().filter(|(_, on)| *on).map(|(effect, _)| effect).collect();
    if !effects.is_empty() {
        found.push(format!("spin effects of `{name}`: {}", effects.join(", ")));
    }
    if structure.whirl {
        found.push(format!("the shaft of `{name}` whirls: its displacements in x and y are inputs"));
    }
    if structure.axial_shift {
        found.push(format!("`{name}` shifts axially: its axial displacement is an input"));
    }
    let factors = &structure.frequency_factors;
    if !factors.is_empty() {
        let low = factors.iter().copied().fold(f64::INFINITY, f64::min);
        let high = factors.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        found.push(format!("`{name}` is mistuned: frequency factors {low} to {high}"));
    }
    if rom.is_cyclic() {
        let (sectors, largest) = (rom.sectors, rom.largest_nodal_diameter());
        found.push(format!("the {sectors} sectors of `{name}` are coupled: nodal diameters 0 to {largest}"));
    }
    if let Some(excitation) = &structure.excitation {
        let where_to = match (excitation.mode, &excitation.node) {
            (Some(mode), Some(node)) => format!("mode {mode}, as excited by a force at {node}"),
            (Some(mode), None) => format!("mode {mode}"),
            (None, node) => format!("a force at {}", node.as_deref().unwrap_or_default()),
        };
        found.push(format!("`{name}` is excited by engine order {}: {where_to}", excitation.order));
    }
    if !structure.initial.is_empty() {
        found.push(format!(
            "the blades of `{name}` are already moving at the start ({} initial motions)",
            structure.initial.len()
        ));
    }
    if !structure.damping_ratios.is_empty() {
        found.push(format!(
            "the first {} modes of `{name}` have individual damping ratios",
            structure.damping_ratios.len()
        ));
    }
    if structure.softening > 0.0 {
        found.push(format!("`{name}` loses a fraction {} of its stiffness per kelvin", structure.softening));
    }
    if structure.thermal && structure.motion == BodyMotion::Rotating {
        found.push(format!("`{name}` heats up: its temperature is an input"));
    } else if let Some(thermal) = rom.extras.thermal.as_ref().filter(|_| structure.thermal) {
        found.push(format!("`{name}` heats up: temperatures of {} patches are inputs", thermal.patches.len()));
    }
    if let Some(load) = structure.load {
        found.push(format!("load with {} nodal diameters on `{name}`", load.order));
    }
}

fn of_surface(surface: &SurfaceSettings, scene: &Scene, found: &mut Vec<String>) {
    let named = |name: &String| scene.settings.structures.iter().position(|structure| structure.name == *name);
    let carrier = surface.structure.as_ref().and_then(|name| Some((name, scene.roms.get(named(name)?)?)));
    if let Some((name, _)) = carrier.filter(|_| surface.rigid) {
        found.push(format!("surface `{}` is rigid: `{name}` defines its position", surface.name));
    } else if let Some((name, rom)) = carrier {
        found.push(format!("surface `{}` is flexible: carried by `{name}` with {} modes", surface.name, rom.order()));
    } else if let Some(spline) = surface.spline {
        let (around, along) = (spline.around, spline.along);
        found.push(format!("surface `{}` is a spline through {around} x {along} points", surface.name));
    }
    if let Some(patches) = surface.patches {
        let (around, along) = (patches.around, patches.along);
        found.push(format!("friction power is output for {around} x {along} patches of `{}`", surface.name));
    }
}

fn of_contact(contact: &ContactSettings, found: &mut Vec<String>) {
    found.extend(contact.solver.properties().feature.map(String::from));
    if let Some(CoatingSettings { thickness, cells_around, cells_along, contact_width, cutting, .. }) = contact.coating
    {
        let cut = cutting.map_or(String::new(), |cut| {
            let CuttingSettings { specific_energy, normal_ratio } = cut;
            format!(", cut at {specific_energy:e} J/m3, normal force {normal_ratio} times the tangential force")
        });
        let pressed = contact_width.map_or(String::new(), |width| format!(", contact width {width} m"));
        found.push(format!(
            "abradable coating on `{}`: {thickness} m, {cells_around} x {cells_along} cells{cut}{pressed}",
            contact.slave
        ));
    }
    if let Some(share) = contact.slave_heat_fraction {
        found.push(format!(
            "friction heat is shared: a fraction of {share} goes into `{}`, the rest into the blades",
            contact.slave
        ));
    }
}

/// Returns limits of validity that the user of an importer should know; one sentence each.
pub fn limits(scene: &Scene) -> Vec<String> {
    let settings = &scene.settings;
    if settings.free_master().is_some() {
        return limits_of_flight(settings).into_iter().map(String::from).collect();
    }
    let any = |test: fn(&ContactSettings) -> bool| settings.contacts.iter().any(test);
    let flexible = settings.surfaces.iter().any(|surface| surface.structure.is_some());
    let stiffens = settings.structures.iter().any(|structure| structure.spin.stiffening);
    let coupled = scene.roms.iter().any(Rom::is_cyclic);
    let whirls = settings.structures.iter().any(|structure| structure.whirl || structure.axial_shift);
    let choose = |first: bool, one: &'static str, other: &'static str| if first { one } else { other };
    let mut limits = vec![
        "Displacements within each structure are small; the rotation between rotor and casing may be large.",
        choose(
            any(|contact| contact.solver.sticks()),
            "Friction is Coulomb friction that sticks and slides, with one coefficient for both.",
            "Friction is Coulomb friction in steady sliding along the circumference; sticking is not modelled.",
        ),
        choose(
            flexible,
            "The casing surface is parallel to the contour of the blade tips at the given clearance, whatever the \
             radius of its mesh, and bends with the modes of its reduced model; beyond its contact rings it is \
             extended along its tangents by a quarter of its axial extent.",
            "The casing is a rigid surface of the given shape, parallel to the contour of the blade tips.",
        ),
        blades(coupled, stiffens),
        "Forces and torques are means over the communication step, so that the transferred momentum is exact; the \
         instantaneous force of an impact grows as 1/h.",
        "Sliding friction can make the structure itself flutter; a scheme that would add numerical growth is rejected.",
        choose(
            settings.time.scheme.properties().quasi_static,
            "The highest modes, three per contact node, respond to contact immediately and have no inertia.",
            "The mass of a contact node loses its kinetic energy at impact: an error of first order in mesh size, not in h.",
        ),
    ];
    if whirls {
        limits.push("Whirl and shift of the shaft displace the blades, but cause no inertia forces on them.");
    }
    if any(|contact| contact.coating.is_some()) {
        limits.push(
            "Clearances are measured to the unworn coating: they become negative where a blade penetrates it. Wear is \
             permanent, and the coating has no mass.",
        );
    }
    limits.into_iter().map(String::from).collect()
}

/// Returns the limits of a scene whose master is a free body.
fn limits_of_flight(settings: &SceneSettings) -> [&'static str; 5] {
    let sticks = settings.contacts.iter().any(|contact| contact.solver.sticks());
    [
        "Displacements within each structure are small; the free structure may travel any distance, but its rotations \
         must stay small.",
        if sticks {
            "Friction is Coulomb friction that sticks and slides, with one coefficient for both."
        } else {
            "Friction is Coulomb friction in sliding; sticking is not modelled."
        },
        "Surfaces pass through the contact grids of their structures; a contact node that moves beyond an edge of a \
         grid has no contact with it.",
        "Forces are means over the communication step, so that the transferred momentum is exact; the instantaneous \
         force of an impact grows as 1/h.",
        "The mass of a contact node loses its kinetic energy at impact: an error of first order in mesh size, not in h.",
    ]
}

/// Describes the connection of the blades, and the effects of speed. Coupled blades are rejected with stiffening.
fn blades(coupled: bool, stiffens: bool) -> &'static str {
    match (coupled, stiffens) {
        (true, _) => {
            "Blades are coupled through the disk; all sectors are identical, and speed causes neither stiffening nor \
             Coriolis forces."
        }
        (false, true) => {
            "Blades are mounted on a rigid hub and are not coupled; speed stiffens them as fitted in their model."
        }
        (false, false) => "Blades are mounted on a rigid hub and are not coupled; speed does not stiffen them.",
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use tiprub_core::scene::method::{Scheme, Solver};
    use tiprub_core::scene::rom::{DisplacementFrame, Harmonic, RomChecks, RomExtras};

    use super::*;
    use tiprub_gallery::scene_source::ROTOR37_ONE_ROW_SCENE;

    fn scene(change: impl FnOnce(&mut Scene)) -> Scene {
        let settings = tiprub_format::parse_scene(ROTOR37_ONE_ROW_SCENE, "scene").unwrap();
        let mut scene = Scene { settings, roms: Vec::new() };
        change(&mut scene);
        scene
    }

    #[test]
    fn a_plain_scene_has_no_features_and_seven_limits() {
        let plain = scene(|_| {});
        assert_eq!(features(&plain), Vec::<String>::new());
        let held = features(&scene(|scene| scene.settings.time.input_interpolation = InputInterpolation::Hold));
        assert!(held.len() == 1 && held[0].contains("act immediately"), "{held:?}");
        assert_eq!(limits(&plain).len(), 7);
        let text = limits(&plain).concat();
        assert!(text.contains("sticking is not modelled") && text.contains("a rigid surface"), "{text}");
    }

    #[test]
    fn free_body_is_reported_with_its_limits() {
        let settings = tiprub_format::parse_scene(tiprub_gallery::scene_source::CUBE_SCENE, "scene").unwrap();
        let mut scene = Scene { settings, roms: vec![two_sectors(false); 3] };
        scene.settings.surfaces[1].rigid = true;
        let text = features(&scene).join("\n");
        let free = "`cube` is a free body with the initial velocity 0, -100, 0 m/s";
        for part in [free, "`left` is flexible", "`right` is rigid"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let text = limits(&scene).join("\n");
        for wrong in ["blade", "casing", "rotor"] {
            assert!(!text.contains(wrong), "{wrong}: {text}");
        }
        assert!(text.contains("sticking is not modelled"));
        scene.settings.contacts.iter_mut().for_each(|contact| contact.solver = Solver::Coulomb);
        assert!(limits(&scene).concat().contains("sticks and slides"));
    }

    #[test]
    fn limits_follow_the_scene() {
        let text = limits(&scene(|scene| {
            scene.settings.contacts[0].solver = Solver::Coulomb;
            scene.settings.surfaces[0].structure = Some("ring".into());
            scene.settings.structures[0].whirl = true;
            scene.settings.structures[0].spin.stiffening = true;
            scene.settings.time.scheme = tiprub_core::scene::method::Scheme::MasslessBoundary;
        }))
        .concat();
        for wrong in ["sticking is not modelled", "a rigid surface", "does not stiffen", "loses its kinetic energy"] {
            assert!(!text.contains(wrong), "{wrong}: {text}");
        }
        assert!(text.contains("sticks and slides") && text.contains("no inertia forces"), "{text}");
    }

    fn two_sectors(coupled: bool) -> Rom {
        let pencil = Harmonic {
            mass: DMatrix::identity(1, 1),
            stiffness: DMatrix::identity(1, 1),
            contact_map: DMatrix::zeros(0, 1),
        };
        Rom {
            name: "pair".into(),
            origin: String::new(),
            sectors: 2,
            frame: DisplacementFrame::Cylindrical,
            mass: DMatrix::identity(1, 1),
            stiffness: DMatrix::identity(1, 1),
            contact_map: DMatrix::zeros(0, 1),
            contact_nodes: Vec::new(),
            damping_ratio: 0.0,
            checks: RomChecks::default(),
            extras: RomExtras { harmonics: if coupled { vec![pencil] } else { Vec::new() }, ..RomExtras::default() },
        }
    }

    #[test]
    fn coupled_blades_are_not_reported_as_uncoupled() {
        for coupled in [false, true] {
            let adaptive = scene(|scene| {
                scene.roms = vec![two_sectors(coupled)];
                scene.settings.time.scheme = Scheme::Galerkin;
            });
            let scene = scene(|scene| scene.roms = vec![two_sectors(coupled)]);
            assert_eq!(limits(&scene).concat().contains("not coupled"), !coupled);
            assert_eq!(limits(&scene).len(), 7);
            assert_eq!(features(&scene).concat().contains("are coupled: nodal diameters 0 to 1"), coupled);
            let steps = features(&adaptive).concat();
            assert!(steps.contains(if coupled { "steps that all blades share" } else { "steps of every blade" }));
        }
    }
}
