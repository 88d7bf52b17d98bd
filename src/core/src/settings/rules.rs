//! What features, schemes and solvers need and exclude: one table. Validation refuses by it, messages are made of its rows,
//! and the guide prints them.

mod facts;
mod place;
#[cfg(test)]
mod tests;

use super::relations::Relations;
use super::{BodyMotion, Preset, Scene, SceneSettings, Scheme, Solver, SpinSettings, StructureSettings};
use crate::rom::DisplacementFrame;
use crate::{Error, Result, Rom};
use facts::*;
use place::{ScenePlace, path};

/// A feature that another feature needs or excludes, at the same place.
type RelatedFeature = (&'static str, fn(&ScenePlace) -> bool);

/// One row.
pub struct FeatureRule {
    features: &'static [Fact],
    needed: bool,
    other: RelatedFeature,
    because: &'static str,
    remedy: &'static str,
}

const fn needs(
    features: &'static [Fact],
    other: RelatedFeature,
    because: &'static str,
    remedy: &'static str,
) -> FeatureRule {
    FeatureRule { features, needed: true, other, because, remedy }
}

const fn excludes(
    features: &'static [Fact],
    other: RelatedFeature,
    because: &'static str,
    remedy: &'static str,
) -> FeatureRule {
    FeatureRule { features, needed: false, other, because, remedy }
}

const FREE: RelatedFeature = ("a free master", |at| at.is_free());
const ALL_FREE: RelatedFeature = ("a scene of free masters only", |at| at.contacts().all(|at| at.is_free()));
const COUPLED: RelatedFeature = ("a ROM whose sectors are coupled by harmonics", |at| at.rom().is_cyclic());

/// Rules of structures, surfaces and contacts.
static PARTS: &[FeatureRule] = &[
    needs(
        &[SPEED, FACTORS, STIFFENING, GROWTH, CORIOLIS, WHIRL, AXIAL_SHIFT, SOFTENING, EXCITATION, INITIAL],
        ("`motion = \"rotating\"`", |at| at.structure().motion == BodyMotion::Rotating),
        "only a rotating structure has a speed, blades and a shaft",
        "Remove the line, or set motion = \"rotating\"",
    ),
    needs(
        &[LOAD],
        ("`motion = \"still\"`", |at| at.structure().motion == BodyMotion::Still),
        "only a structure that stands still has a load on its contact grid",
        "Remove the line, or set motion = \"still\"",
    ),
    excludes(
        &[THERMAL],
        ("`motion = \"free\"`", |at| at.structure().motion == BodyMotion::Free),
        "what flies has no inputs",
        "Remove the line",
    ),
    needs(
        &[SOFTENING],
        ("`structure.thermal`", |at| at.structure().thermal),
        "without a temperature nothing softens",
        "Set thermal = true, or remove the line",
    ),
    needs(
        &[VELOCITY],
        ("`motion = \"free\"`", |at| at.structure().motion == BodyMotion::Free),
        "only a free structure starts with one",
        "Remove the line, or set motion = \"free\"",
    ),
    needs(
        &[CARRIED],
        ("a structure with `motion = \"still\"`", |at| at.carrier().is_some_and(|own| own.motion == BodyMotion::Still)),
        "a surface stands still",
        "Name a structure that stands still, or remove the line for a rigid surface",
    ),
    excludes(
        &[CARRIED],
        ("a structure that is the master of a contact", |at| at.carrier_touches()),
        "contact nodes and control points of one structure together are not made for",
        "Let it be the master of both contacts, with surfaces on what it meets",
    ),
    needs(
        &[RIGID],
        FREE,
        "the surface around a rotor is rigid without `structure`",
        "Remove the line, and `structure` for a rigid surface",
    ),
    excludes(
        &[SHAPE, MOVING, RAMP_TIME, PATCHES, CLOSURE],
        FREE,
        "only a surface around an axis has it, and this one is the open contact grid of a structure",
        "Remove the line",
    ),
    excludes(
        &[GAP, SECTOR_GAPS, MERIDIAN, COATING, HEAT],
        FREE,
        "its gaps and normals follow from the positions in both ROMs",
        "Remove the line",
    ),
    needs(
        &[FREE_MASTER],
        ("`surface.structure`", |at| at.surface().structure.is_some()),
        "it needs to know where its surface is",
        "Give the surface a `structure` that stands still; `rigid = true` leaves out its deformation",
    ),
    needs(
        &[ONE_OF_SEVERAL],
        ("`contact.nodes`", |at| at.contact().nodes.is_some()),
        "without it one contact claims all its contact nodes",
        "Give every contact `nodes`: what the names of its contact nodes start with",
    ),
    excludes(
        &[MERIDIAN],
        ("a surface spline", |at| at.surface().spline.is_some() || at.carrier().is_some()),
        "its normal follows from the closest point",
        "Remove the line",
    ),
    needs(
        &[HEAT],
        ("`contact.friction` above 0", |at| at.contact().friction > 0.0),
        "without friction there is no heat to share",
        "Give the contact a friction coefficient (friction > 0), or remove the line",
    ),
    excludes(
        &[COATING],
        ("contacts solved together with another pair's", |at| at.is_coupled()),
        "pairs of one structure, or of surfaces on one flexible structure, push each other",
        "Leave out the coating, or give the pair a structure and a surface of its own",
    ),
    excludes(
        &[MODULUS, YIELD, HARDENING],
        ("`contact.coating.cutting`", |at| at.is_cut()),
        "what is cut off does not yield",
        "Remove the line, or `cutting` for the plastic law",
    ),
    excludes(
        &[CONTACT_WIDTH],
        ("`contact.coating.cutting`", |at| at.is_cut()),
        "a tip cuts with its edge, whatever its width",
        "Remove the line, or `cutting` for the plastic law",
    ),
    needs(
        &[SOLVER],
        ("that of contact[1]", |at| at.contact().solver == at.settings.contacts[0].solver),
        "a scene has one solver",
        "Give all pairs the same solver",
    ),
];

/// Rules of outputs and inputs.
static VARIABLES: &[FeatureRule] = &[
    needs(
        &[WEAR, WEAR_PROFILE],
        ("`contact.coating`", |at| at.contacts().any(|at| at.is_coated())),
        "nothing else wears",
        "Add a `coating` to the contact, or remove the line",
    ),
    needs(
        &[STRESS, MODES, TIPS],
        ("`outputs.watched_sectors`", |at| !at.outputs().watched_sectors.is_empty()),
        "it is told of watched sectors",
        "Watch a sector, or remove the line",
    ),
    needs(
        &[DISPLACEMENT],
        ("`surface.structure` of a surface around an axis", |at| {
            at.contacts().any(|at| at.carrier().is_some() && !at.is_free())
        }),
        "it is radial: a rigid surface does not deform, and an open one has no axis",
        "Give the surface around a rotor a `structure`, or remove the line",
    ),
    needs(
        &[SUPPORT],
        ("`surface.structure` of a surface around an axis", |at| {
            at.contacts().any(|at| at.carrier().is_some() && !at.is_free())
        }),
        "what is rigid has no support of its own: its reaction is the contact force",
        "Give the surface around a rotor a `structure`, or remove the line",
    ),
    excludes(
        &[MODES, TIPS, CASING_FORCES],
        ALL_FREE,
        "it is told of rotors and of what stands around them",
        "Remove the line",
    ),
    excludes(
        &[OTHER_SECTORS, ALL_SECTORS, DIAMETERS],
        ALL_FREE,
        "a free structure has one sector",
        "Remove the line; `watched_sectors` may be [1] or []",
    ),
    excludes(&[INTERPOLATION], ALL_FREE, "such a scene has no inputs", "Remove the line"),
];

/// Rules of schemes and solvers: those of the scene, and those chosen by parameters.
static METHODS: &[FeatureRule] = &[
    needs(
        &[COULOMB],
        ("a scene packaged with it, or with rotors of uncoupled sectors, rigid surfaces and friction", |at| {
            at.may_stick()
        }),
        "larger problems are prepared only where the scene says so",
        "Package the scene with contact.solver = \"coulomb\"",
    ),
    excludes(
        &[FILM, COULOMB],
        ("a coating", |at| at.contacts().any(|at| at.is_coated())),
        "its rods yield within the complementarity problem",
        "Use solver = \"lcp\", or remove the coating",
    ),
    excludes(
        &[MASSLESS],
        ("a free master", |at| at.contacts().any(|at| at.is_free())),
        "it is not made for structures that fly",
        "Use \"modal-exact\" or \"central-difference\"",
    ),
    excludes(
        &[MASSLESS],
        ("`structure.spin.coriolis`", |at| at.settings.structures.iter().any(|own| own.spin.coriolis)),
        "quasi-static modes have no velocity for the Coriolis force",
        "Use \"modal-exact\", or leave the Coriolis force out",
    ),
    excludes(
        &[GALERKIN],
        ("`structure.spin`", |at| at.settings.structures.iter().any(|own| own.spin != SpinSettings::default())),
        "its tables are those of modes that keep their stiffness and are loaded by contact alone",
        "Use \"modal-exact\", or leave the effects of spin out",
    ),
    excludes(
        &[GALERKIN],
        ("`structure.thermal` of a rotor, and `structure.excitation`", |at| {
            let loaded = |own: &StructureSettings| own.thermal && own.motion == BodyMotion::Rotating;
            at.settings.structures.iter().any(|own| loaded(own) || own.excitation.is_some())
        }),
        "its tables are those of blades that are loaded by contact alone",
        "Use \"modal-exact\", or leave the loads on the blades out",
    ),
    excludes(
        &[GALERKIN],
        ("`contact.coating`", |at| at.contacts().any(|at| at.is_coated())),
        "it seeks forces for gaps that close, and a coating takes force while they do",
        "Use \"modal-exact\", or remove the coating",
    ),
    excludes(
        &[MASSLESS],
        ("`contact.coating.cutting`", |at| at.contacts().any(|at| at.is_cut())),
        "the way that is cut is that of the step in which the force acts, and its forces act a step later",
        "Use \"modal-exact\" or \"central-difference\", or the plastic law",
    ),
    excludes(
        &[GALERKIN],
        ("`outputs.support_reaction`", |at| at.outputs().support_reaction),
        "it keeps no means of what the casing does within a step",
        "Use \"modal-exact\", or remove the output",
    ),
    excludes(
        &[GALERKIN],
        ("`contact.solver = \"film\"`", |at| at.solver == Solver::Film),
        "it solves the complementarity of contact",
        "Use solver = \"lcp\", or \"coulomb\"",
    ),
    excludes(
        &[MASSLESS],
        ("`contact.solver = \"film\"`", |at| at.solver == Solver::Film),
        "film looks once for penetration, and without inertia a node that it leaves inside the surface stays there",
        "Use solver = \"lcp\", or another scheme",
    ),
    needs(
        &[GALERKIN],
        ("a clearance above 0 of what does not fly", |at| {
            at.contacts().all(|at| at.is_free() || at.contact().nominal_gap() > 0.0)
        }),
        "its tolerance is a share of the clearance",
        "Give the contact a `gap`, or use \"modal-exact\"",
    ),
    needs(
        &[QUASI_STATIC],
        ("more than three modes per contact node", |at| at.has_modes_left()),
        "it makes the highest modes quasi-static, three per contact node, and else none is left",
        "Use more modes or fewer contact nodes, or \"modal-exact\"",
    ),
    excludes(
        &[MASSLESS],
        ("several surfaces on one flexible structure", |at| at.contacts().any(|at| at.shares_carrier())),
        "the largest step is not known there",
        "Use \"modal-exact\" or \"central-difference\", or rigid surfaces",
    ),
];

/// Rules of presets: settings that the scene file may have beside it. Parameters may be set to anything.
static PRESETS: &[FeatureRule] = &[excludes(
    &[OTHER_SCHEME, OTHER_SOLVER],
    ("`preset = \"paper\"`", |at| at.settings.preset == Preset::Paper),
    "the preset is the method of the paper whole",
    "Remove the line, or the preset",
)];

/// Rules of ROMs.
static ROMS: &[FeatureRule] = &[
    needs(
        &[ROM_AROUND],
        ("`frame = cylindrical`", |at| at.rom().frame == DisplacementFrame::Cylindrical),
        "surfaces around an axis meet displacements along (r, θ, z)",
        "Write the ROM with frame = cylindrical",
    ),
    needs(
        &[ROM_FREE],
        ("`frame = cartesian`", |at| at.rom().frame == DisplacementFrame::Cartesian),
        "a free master and what it meets are described along x, y, z",
        "Write the ROM with frame = cartesian",
    ),
    needs(
        &[ROM_FREE],
        ("`sectors = 1`", |at| at.rom().sectors == 1 && !at.rom().is_cyclic()),
        "a free master and what it meets are single structures",
        "Use sectors = 1",
    ),
    needs(
        &[STIFFENING, GROWTH, CORIOLIS],
        ("spin matrices in the ROM", |at| at.rom().extras.spin.is_some()),
        "they hold what the speed does to the structure",
        "Reduce it with `tiprub reduce --spin`, or leave spin out",
    ),
    excludes(
        &[FACTORS, STIFFENING, CORIOLIS, SOFTENING],
        COUPLED,
        "nodal diameters are modes of equal sectors, and the same at every speed and temperature",
        "Leave it out, or use a ROM of uncoupled sectors (without harmonics)",
    ),
    excludes(&[INITIAL_SECTOR], COUPLED, "a blade of such a disk has no mode of its own", "Give a `nodal_diameter`"),
    needs(
        &[THERMAL],
        ("thermal loads in the ROM", |at| at.rom().extras.thermal.is_some()),
        "they say how each patch expands the structure",
        "Reduce it from a mesh of one material (a casing: with thermal patches), or leave thermal out",
    ),
    excludes(
        &[COATING],
        ("a ROM whose contact patches are in rows across the thickness", |at| {
            at.master_rom().is_some_and(|rom| rom.rows() > 1)
        }),
        "a row of cells is worn by what it sees between two patches along the axis, and patches of several rows would take turns",
        "Reduce it with one row of patches (without --contact-rows), or remove the coating",
    ),
    needs(
        &[PLASTIC_COATING],
        ("`contact.coating.contact_width`, or contact patches with areas and lengths in the ROM of the master", |at| {
            at.contact().coating.is_some_and(|coating| coating.contact_width.is_some())
                || at.master_rom().is_some_and(Rom::has_patches)
        }),
        "the force on a tip grows with the width that it presses, which contact nodes do not have",
        "Give the thickness of the tip over the cosine of its stagger angle (m), or reduce the blade with --contact-patches",
    ),
    needs(
        &[STRESS],
        ("places of stress in the ROM of a rotor", |at| {
            at.contacts().any(|at| !at.is_free() && at.master_rom().is_some_and(|rom| rom.extras.stress.is_some()))
        }),
        "stress comes from the finite elements that the ROM was reduced from",
        "Reduce the blade with --stress-modes or --stress-set, or remove the line",
    ),
    needs(
        &[HEATED_STRESS],
        ("static thermal stress in that ROM (array `stress_thermal`)", |at| {
            at.stressed(|own| own.thermal).all(|rom| rom.extras.stress_thermal.is_some())
        }),
        "the expansion of a free blade causes no stress, and the reduced coordinates alone do not know that",
        "Reduce the blade again, add the array, or remove `thermal` or the line",
    ),
    needs(
        &[GROWN_STRESS],
        ("static centrifugal stress in that ROM (array `stress_centrifugal`)", |at| {
            at.stressed(|own| own.spin.growth).all(|rom| rom.extras.stress_centrifugal.is_some())
        }),
        "few modes do not resolve the stress of a load that acts in the whole blade",
        "Reduce the blade again, add the array, or remove `spin.growth` or the line",
    ),
    excludes(
        &[MODES],
        ("a rotor whose sectors are coupled by harmonics", |at| {
            at.contacts().any(|at| at.master_rom().is_some_and(Rom::is_cyclic))
        }),
        "its modes are those of nodal diameters, not of a sector",
        "Use `nodal_diameters`, or remove the line",
    ),
    needs(
        &[SUPPORT],
        ("rows of the support in the ROM of a casing", |at| {
            at.contacts().any(|at| !at.is_free() && at.carrier_rom().is_some_and(|rom| rom.extras.support.is_some()))
        }),
        "they say what held nodes feel, of the finite elements that the ROM was reduced from",
        "Reduce the casing again, held at some nodes, or remove the line",
    ),
    needs(
        &[LOAD],
        ("a contact grid in the ROM", |at| at.rom().extras.grid.is_some()),
        "the load acts on its rings",
        "Give a ROM with a contact grid, or leave the load out",
    ),
    excludes(
        &[CARRIED],
        ("a structure whose sectors are coupled by harmonics", |at| at.carrier_rom().is_some_and(Rom::is_cyclic)),
        "the surface is laid through the contact grid of a structure that was reduced as a whole",
        "Give a structure of its own (sectors = 1) to carry the surface",
    ),
    needs(
        &[CARRIED_AROUND],
        ("a contact grid in its ROM", |at| at.carrier_rom().is_some_and(|rom| rom.extras.grid.is_some())),
        "the surface is laid through it",
        "Reduce the casing with `tiprub reduce casing`, or add the metadata `contact_grid`",
    ),
    needs(
        &[CARRIED_OPEN],
        ("an open contact grid in its ROM", |at| {
            at.carrier_rom().and_then(|rom| rom.extras.grid).is_some_and(|grid| !grid.closed)
        }),
        "the surface is laid through it",
        "Add the metadata `contact_grid` for an open grid, its contact nodes row after row",
    ),
];

/// All rows, in the order of the guide.
pub fn all() -> impl Iterator<Item = &'static FeatureRule> {
    PARTS.iter().chain(VARIABLES).chain(METHODS).chain(PRESETS).chain(ROMS)
}

impl FeatureRule {
    fn relation(&self) -> String {
        format!("{} {}", if self.needed { "needs" } else { "excludes" }, self.other.0)
    }

    /// As the guide prints it: features, what they need or exclude, why, what to do.
    pub fn columns(&self) -> [String; 4] {
        let features: Vec<String> = self.features.iter().map(Fact::shown).collect();
        [features.join(", "), self.relation(), self.because.to_owned(), self.remedy.to_owned()]
    }
}

impl SceneSettings {
    /// Checks the needs and exclusions of structures, surfaces and contacts, whose names are checked.
    pub(super) fn check_parts(&self) -> Result<()> {
        check(PARTS, self.place(&Relations::of(self)), path)
    }

    /// The same of outputs, inputs, scheme and solver.
    pub(super) fn check_whole(&self) -> Result<()> {
        let relations = Relations::of(self);
        [PRESETS, VARIABLES, METHODS].into_iter().try_for_each(|rules| check(rules, self.place(&relations), path))
    }

    /// Returns which rule excludes a scheme from this scene, and why; `roms` may be empty before they are known.
    pub(super) fn excluded_method(&self, roms: &[Rom], scheme: Scheme) -> Option<String> {
        let relations = Relations::of(self);
        let refusal = check(METHODS, ScenePlace { roms, scheme, ..self.place(&relations) }, path).err()?;
        let Error::Invalid { problem, .. } = refusal else { return None };
        Some(problem)
    }

    fn place<'a>(&'a self, relations: &'a Relations) -> ScenePlace<'a> {
        let (scheme, solver) = (self.time.scheme, self.contacts[0].solver);
        ScenePlace { settings: self, relations, roms: &[], scheme, solver, index: 0 }
    }
}

impl Scene {
    /// Checks what a validated scene needs of its ROMs, and what they exclude.
    pub(crate) fn check_roms(&self) -> Result<()> {
        let relations = Relations::of(&self.settings);
        check(ROMS, ScenePlace { roms: &self.roms, ..self.settings.place(&relations) }, path)
    }

    /// Whether a validated scene can be stepped with a scheme and a solver.
    ///
    /// # Errors
    /// Naming parameter and remedy.
    pub fn check_methods(&self, scheme: Scheme, solver: Solver) -> Result<()> {
        let parameter = |_: &ScenePlace, key: &str| format!("parameter `{}`", key.rsplit('.').next().unwrap_or(key));
        let relations = Relations::of(&self.settings);
        check(METHODS, ScenePlace { roms: &self.roms, scheme, solver, ..self.settings.place(&relations) }, parameter)
    }
}

/// Refuse what breaks a row; `name` tells of a key at a place what it is called.
fn check(rules: &[FeatureRule], scene: ScenePlace, name: impl Fn(&ScenePlace, &str) -> String) -> Result<()> {
    for (rule, feature) in rules.iter().flat_map(|rule| rule.features.iter().map(move |feature| (rule, feature))) {
        let breaks = |at: &ScenePlace| (feature.holds)(at) && (rule.other.1)(at) != rule.needed;
        if let Some(at) = scene.all_of(feature.key).find(breaks) {
            let words = if feature.words.is_empty() { String::new() } else { format!("{} ", feature.words) };
            let problem = format!("{words}{}: {}", rule.relation(), rule.because);
            return Err(Error::invalid(name(&at, feature.key), problem, rule.remedy));
        }
    }
    Ok(())
}
