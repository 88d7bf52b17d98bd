//! Requirements and exclusions of features, schemes and solvers, in one table. Validation applies it, messages are composed of its rows,
//! and the guide prints them.

mod facts;
mod place;
#[cfg(test)]
mod tests;

use tiprub_cosim::Diagnostic;

use super::relations::Relations;
use super::{BodyMotion, Preset, Scene, SceneSettings, SpinSettings, StructureSettings};
use crate::scene::method::{Scheme, Solver};
use crate::scene::rom::DisplacementFrame;
use crate::{Error, Result, Rom};
use facts::*;
use place::{ScenePlace, path};

/// A feature that another feature needs or excludes at the same place.
type RelatedFeature = (&'static str, fn(&ScenePlace) -> bool);

/// One rule.
pub struct FeatureRule {
    features: &'static [Fact],
    needed: bool,
    other: RelatedFeature,
    because: &'static str,
    remedy: &'static str,
}

/// Defines rules. Each lists features, the feature that they need or exclude at the same place, the reason and the
/// remedy.
macro_rules! rules {
    ($([$($feature:ident),*] $relation:ident $other:expr, $because:literal, $remedy:literal;)*) => {
        &[$(FeatureRule {
            features: &[$($feature),*],
            needed: rules!($relation),
            other: $other,
            because: $because,
            remedy: $remedy,
        }),*]
    };
    (needs) => { true };
    (excludes) => { false };
}

const FREE: RelatedFeature = ("a free master", |at| at.is_free());
const ALL_FREE: RelatedFeature = ("a scene with free masters only", |at| at.contacts().all(|at| at.is_free()));
const COUPLED: RelatedFeature = ("a ROM whose sectors are coupled by harmonics", |at| at.rom().is_cyclic());

const CARRIED_CASING: RelatedFeature = ("`surface.structure` of a surface around an axis", |at| {
    at.contacts().any(|at| at.carrier().is_some() && !at.is_free())
});

/// Rules of structures, surfaces and contacts.
static PARTS: &[FeatureRule] = rules! {
    [SPEED, FACTORS, STIFFENING, GROWTH, CORIOLIS, WHIRL, AXIAL_SHIFT, SOFTENING, EXCITATION, INITIAL] needs
        ("`motion = \"rotating\"`", |at| at.structure().motion == BodyMotion::Rotating),
        "only a rotating structure has a speed, blades and a shaft",
        "Remove the line, or set motion = \"rotating\"";
    [LOAD] needs ("`motion = \"still\"`", |at| at.structure().motion == BodyMotion::Still),
        "only a stationary structure can have a load on its contact grid",
        "Remove the line, or set motion = \"still\"";
    [THERMAL] excludes ("`motion = \"free\"`", |at| at.structure().motion == BodyMotion::Free),
        "a free structure has no inputs",
        "Remove the line";
    [SOFTENING] needs ("`structure.thermal`", |at| at.structure().thermal),
        "softening depends on the temperature of the structure",
        "Set thermal = true, or remove the line";
    [VELOCITY] needs ("`motion = \"free\"`", |at| at.structure().motion == BodyMotion::Free),
        "only a free structure has an initial velocity",
        "Remove the line, or set motion = \"free\"";
    [CARRIED] needs
        ("a structure with `motion = \"still\"`", |at| at.carrier().is_some_and(|own| own.motion == BodyMotion::Still)),
        "only a stationary structure can carry a surface",
        "Name a stationary structure, or remove the line for a rigid surface";
    [CARRIED] excludes ("a structure that is the master of a contact", |at| {
            at.relations.carriers[at.index].is_some_and(|carrier| at.relations.touches(carrier))
        }),
        "a structure cannot be the master of one contact and carry the surface of another",
        "Make it the master of both contacts, and put the surfaces on the structures that it can touch";
    [RIGID] needs FREE,
        "a surface around a rotor is rigid if it has no `structure`",
        "Remove the line; for a rigid surface, also remove `structure`";
    [SHAPE, MOVING, RAMP_TIME, PATCHES, CLOSURE] excludes FREE,
        "only a surface around an axis can have it, and the surface of a free master is an open contact grid",
        "Remove the line";
    [GAP, SECTOR_GAPS, MERIDIAN, COATING, HEAT] excludes FREE,
        "the gaps and normals of a free master follow from the positions in both ROMs",
        "Remove the line";
    [FREE_MASTER] needs ("`surface.structure`", |at| at.surface().structure.is_some()),
        "the position of its surface comes from the ROM of a structure",
        "Give the surface a stationary `structure`; set `rigid = true` to ignore its deformation";
    [ONE_OF_SEVERAL] needs ("`contact.nodes`", |at| at.contact().nodes.is_some()),
        "otherwise each contact would use all contact nodes of the structure",
        "Set `nodes` in every contact to the prefix of the names of its contact nodes";
    [MERIDIAN] excludes ("a surface spline", |at| at.surface().spline.is_some() || at.carrier().is_some()),
        "a surface spline uses the normal at the closest point",
        "Remove the line";
    [HEAT] needs ("`contact.friction` above 0", |at| at.contact().friction > 0.0),
        "without friction there is no heat to distribute",
        "Give the contact a friction coefficient (friction > 0), or remove the line";
    [COATING] excludes ("a contact that is solved together with another one", |at| at.relations.is_coupled(at.settings, at.index)),
        "contacts of one structure, or of surfaces on one flexible structure, act on each other",
        "Remove the coating, or use a separate structure and a separate surface for this contact";
    [MODULUS, YIELD, HARDENING] excludes ("`contact.coating.cutting`", |at| at.is_cut()),
        "this key belongs to the plastic law, but this coating is cut",
        "Remove the line, or remove `cutting` to use the plastic law";
    [CONTACT_WIDTH] excludes ("`contact.coating.cutting`", |at| at.is_cut()),
        "the cutting force does not depend on the width of the tip",
        "Remove the line, or remove `cutting` to use the plastic law";
    [SOLVER] needs ("the solver of contact[1]", |at| at.contact().solver == at.settings.contacts[0].solver),
        "all contacts of a scene use the same solver",
        "Give all contacts the same solver";
};

/// Rules of outputs and inputs.
static VARIABLES: &[FeatureRule] = rules! {
    [WEAR, WEAR_PROFILE] needs ("`contact.coating`", |at| at.contacts().any(|at| at.is_coated())),
        "only coatings wear",
        "Add a `coating` to the contact, or remove the line";
    [STRESS, MODES, TIPS] needs ("`outputs.watched_sectors`", |at| !at.outputs().watched_sectors.is_empty()),
        "it is reported for watched sectors only",
        "Add a sector to `watched_sectors`, or remove the line";
    [DISPLACEMENT] needs CARRIED_CASING,
        "the output is a radial displacement: a rigid surface does not deform, and an open surface has no axis",
        "Give the surface around a rotor a `structure`, or remove the line";
    [SUPPORT] needs CARRIED_CASING,
        "a rigid surface has no separate support: its reaction is the contact force",
        "Give the surface around a rotor a `structure`, or remove the line";
    [MODES, TIPS, CASING_FORCES] excludes ALL_FREE,
        "it is reported for rotors and their casings only",
        "Remove the line";
    [OTHER_SECTORS, ALL_SECTORS, DIAMETERS] excludes ALL_FREE,
        "a free structure has one sector",
        "Remove the line; `watched_sectors` may be [1] or []";
    [INTERPOLATION] excludes ALL_FREE,
        "such a scene has no inputs",
        "Remove the line";
};

/// Rules of schemes and solvers, for those of the scene and for those chosen by parameters.
static METHODS: &[FeatureRule] = rules! {
    [STICKING] needs ("a scene packaged with it, or one with friction, rigid surfaces and rotors with uncoupled sectors", |at| {
            at.may_stick()
        }),
        "the solver is set up for larger problems only if the scene selects it",
        "Package the scene with contact.solver = \"coulomb\"";
    [UNCOATED] excludes ("a coating", |at| at.contacts().any(|at| at.is_coated())),
        "a coating yields within the linear complementarity problem, which only `lcp` solves",
        "Use solver = \"lcp\", or remove the coating";
    [MASSLESS] excludes ("a free master", |at| at.contacts().any(|at| at.is_free())),
        "this scheme does not support free structures",
        "Use \"modal-exact\" or \"central-difference\"";
    [MASSLESS] excludes ("`structure.spin.coriolis`", |at| at.settings.structures.iter().any(|own| own.spin.coriolis)),
        "its quasi-static modes have no velocity, on which the Coriolis force depends",
        "Use \"modal-exact\", or leave out the Coriolis force";
    [GALERKIN] excludes
        ("`structure.spin`", |at| at.settings.structures.iter().any(|own| own.spin != SpinSettings::default())),
        "its step tables assume that modes keep their stiffness and are loaded by contact alone",
        "Use \"modal-exact\", or leave out the effects of spin";
    [GALERKIN] excludes ("`structure.thermal` of a rotor or `structure.excitation`", |at| {
            let loaded = |own: &StructureSettings| own.thermal && own.motion == BodyMotion::Rotating;
            at.settings.structures.iter().any(|own| loaded(own) || own.excitation.is_some())
        }),
        "its step tables assume that blades are loaded by contact alone",
        "Use \"modal-exact\", or leave out the loads on the blades";
    [GALERKIN] excludes ("`contact.coating`", |at| at.contacts().any(|at| at.is_coated())),
        "it computes the forces that keep gaps from closing further, but a coating is compressed under force",
        "Use \"modal-exact\", or remove the coating";
    [MASSLESS] excludes ("`contact.coating.cutting`", |at| at.contacts().any(|at| at.is_cut())),
        "the cutting force depends on the sliding distance of the same step, but forces of this scheme act one step \
         later",
        "Use \"modal-exact\" or \"central-difference\", or remove `cutting` to use the plastic law";
    [GALERKIN] excludes ("`outputs.support_reaction`", |at| at.outputs().support_reaction),
        "it does not average the motion of the casing over a step",
        "Use \"modal-exact\", or remove the output";
    [GALERKIN] excludes ("`contact.solver = \"film\"`", |at| !at.solver.properties().complementary),
        "it needs a solver that enforces complementarity of gap and force",
        "Use solver = \"lcp\", or \"coulomb\"";
    [MASSLESS] excludes ("`contact.solver = \"film\"`", |at| !at.solver.properties().complementary),
        "`film` checks for penetration only once per step, and a massless node that it leaves inside the surface \
         stays there",
        "Use solver = \"lcp\", or another scheme";
    [GALERKIN] needs ("a clearance above 0 in every contact of a rotor", |at| {
            at.contacts().all(|at| at.is_free() || at.contact().nominal_gap() > 0.0)
        }),
        "its tolerance is a fraction of the clearance",
        "Give the contact a `gap`, or use \"modal-exact\"";
    [QUASI_STATIC] needs ("more than three modes per contact node", |at| at.has_modes_left()),
        "it makes the highest modes quasi-static, three per contact node, and at least one other mode must remain",
        "Use more modes or fewer contact nodes, or \"modal-exact\"";
    [MASSLESS] excludes
        ("several surfaces on one flexible structure", |at| at.contacts().any(|at| at.relations.shares_carrier(at.settings, at.index))),
        "the largest stable step is unknown in this case",
        "Use \"modal-exact\" or \"central-difference\", or rigid surfaces";
};

/// Rules of presets: settings that the scene file may have in addition. Parameters may have any value.
static PRESETS: &[FeatureRule] = rules! {
    [OTHER_SCHEME, OTHER_SOLVER] excludes ("`preset = \"paper\"`", |at| at.settings.preset == Preset::Paper),
        "the preset prescribes the scheme and the solver of the paper",
        "Remove the line or the preset";
};

/// Rules of ROMs.
static ROMS: &[FeatureRule] = rules! {
    [ROM_AROUND] needs ("`frame = cylindrical`", |at| at.rom().frame == DisplacementFrame::Cylindrical),
        "contact around an axis is computed from displacements along (r, θ, z)",
        "Write the ROM with frame = cylindrical";
    [ROM_FREE] needs ("`frame = cartesian`", |at| at.rom().frame == DisplacementFrame::Cartesian),
        "contact of a free master is computed from displacements along x, y, z",
        "Write the ROM with frame = cartesian";
    [ROM_FREE] needs ("`sectors = 1`", |at| at.rom().sectors == 1 && !at.rom().is_cyclic()),
        "a free master and the structures that it can touch must have a single sector",
        "Use a ROM with sectors = 1";
    [STIFFENING, GROWTH, CORIOLIS] needs ("spin matrices in the ROM", |at| at.rom().extras.spin.is_some()),
        "they describe the effect of the speed on the structure",
        "Reduce it with the option `--spin SPEED` (largest speed, rad/s), or remove the line";
    [FACTORS, STIFFENING, CORIOLIS, SOFTENING] excludes COUPLED,
        "nodal-diameter modes assume identical sectors and do not depend on speed or temperature",
        "Remove the line, or use a ROM of uncoupled sectors (without harmonics)";
    [INITIAL_SECTOR] excludes COUPLED,
        "the blades of such a disk have no individual modes",
        "Give a `nodal_diameter` instead";
    [THERMAL] needs ("thermal loads in the ROM", |at| at.rom().extras.thermal.is_some()),
        "they describe the thermal expansion caused by each patch",
        "Reduce the structure from a mesh with a single material (for a casing, with thermal patches), or remove the line";
    [COATING] excludes ("a ROM with several rows of contact patches across the thickness", |at| {
            at.master_rom().is_some_and(|rom| rom.rows() > 1)
        }),
        "the penetration of a row of cells is interpolated between two patches along the axis, and patches of \
         different rows would be interleaved",
        "Reduce the blade with --contact-rows 1, or remove the coating";
    [PLASTIC_COATING] needs ("`contact.coating.contact_width`, or contact patches with areas and lengths in the ROM of the master", |at| {
            at.contact().coating.is_some_and(|coating| coating.contact_width.is_some())
                || at.master_rom().is_some_and(Rom::has_patches)
        }),
        "the force on a tip increases with the width of the contact, and contact nodes have no width",
        "Set `contact_width` to the tip thickness divided by the cosine of the stagger angle (m), or reduce the blade with \
         --contact-patches";
    [STRESS] needs ("stress points in the ROM of a rotor", |at| {
            at.contacts().any(|at| !at.is_free() && at.master_rom().is_some_and(|rom| rom.extras.stress.is_some()))
        }),
        "stress is computed from the finite-element model that the ROM was reduced from",
        "Reduce the blade with --stress-modes or --stress-set, or remove the line";
    [HEATED_STRESS] needs ("static thermal stress in the ROM of the rotor (array `stress_thermal`)", |at| {
            at.stressed(|own| own.thermal).all(|rom| rom.extras.stress_thermal.is_some())
        }),
        "the reduced coordinates alone would give stress even for free thermal expansion, which is free of stress",
        "Reduce the blade again, add the array, or remove `thermal` or this line";
    [GROWN_STRESS] needs ("static centrifugal stress in the ROM of the rotor (array `stress_centrifugal`)", |at| {
            at.stressed(|own| own.spin.growth).all(|rom| rom.extras.stress_centrifugal.is_some())
        }),
        "a few modes do not resolve the stress of a load that acts on the whole blade",
        "Reduce the blade again, add the array, or remove `spin.growth` or this line";
    [MODES] excludes ("a rotor whose sectors are coupled by harmonics", |at| {
            at.contacts().any(|at| at.master_rom().is_some_and(Rom::is_cyclic))
        }),
        "its modes belong to nodal diameters, not to single sectors",
        "Use `nodal_diameters`, or remove the line";
    [SUPPORT] needs ("support rows in the ROM of a casing", |at| {
            at.contacts().any(|at| !at.is_free() && at.carrier_rom().is_some_and(|rom| rom.extras.support.is_some()))
        }),
        "they give the reaction at the clamped nodes of the finite-element model that the ROM was reduced from",
        "Reduce the casing again with clamped nodes, or remove the line";
    [LOAD] needs ("a contact grid in the ROM", |at| at.rom().extras.grid.is_some()),
        "the load acts on the rings of the grid",
        "Use a ROM with a contact grid, or remove the load";
    [CARRIED] excludes
        ("a structure whose sectors are coupled by harmonics", |at| at.carrier_rom().is_some_and(Rom::is_cyclic)),
        "the surface interpolates the contact grid of a structure that was reduced as a whole",
        "Use a separate structure with sectors = 1 to carry the surface";
    [CARRIED_AROUND] needs
        ("a contact grid in its ROM", |at| at.carrier_rom().is_some_and(|rom| rom.extras.grid.is_some())),
        "the surface interpolates this grid",
        "Reduce the casing with `tiprub reduce casing`, or add the metadata `contact_grid`";
    [CARRIED_OPEN] needs ("an open contact grid in its ROM", |at| {
            at.carrier_rom().and_then(|rom| rom.extras.grid).is_some_and(|grid| !grid.closed)
        }),
        "the surface interpolates this grid",
        "Add the metadata `contact_grid` for an open grid, with the contact nodes listed row by row";
};

/// All rows, in the order of the guide.
pub fn all() -> impl Iterator<Item = &'static FeatureRule> {
    PARTS.iter().chain(VARIABLES).chain(METHODS).chain(PRESETS).chain(ROMS)
}

impl FeatureRule {
    fn relation(&self) -> String {
        format!("{} {}", if self.needed { "requires" } else { "cannot be combined with" }, self.other.0)
    }

    /// Returns the columns in the guide: features, requirement or exclusion, reason, remedy.
    pub fn columns(&self) -> [String; 4] {
        let features: Vec<String> = self.features.iter().map(Fact::shown).collect();
        [features.join(", "), self.relation(), self.because.to_owned(), self.remedy.to_owned()]
    }
}

impl SceneSettings {
    /// Checks the rules of structures, surfaces and contacts, whose names are already checked.
    pub(super) fn check_parts(&self, relations: &Relations) -> Result<()> {
        check(PARTS, self.place(relations), path)
    }

    /// Checks the rules of outputs, inputs, scheme and solver.
    pub(super) fn check_whole(&self, relations: &Relations) -> Result<()> {
        [PRESETS, VARIABLES, METHODS].into_iter().try_for_each(|rules| check(rules, self.place(relations), path))
    }

    /// Returns the rule that excludes a scheme from this scene, with its reason; `roms` may be empty before they are known.
    pub(super) fn excluded_method(&self, roms: &[Rom], scheme: Scheme) -> Option<String> {
        let relations = Relations::of(self);
        let refusal = check(METHODS, ScenePlace { roms, scheme, ..self.place(&relations) }, path).err()?;
        let Error::Invalid(Diagnostic { problem, .. }) = refusal else { return None };
        Some(problem)
    }

    fn place<'a>(&'a self, relations: &'a Relations) -> ScenePlace<'a> {
        let (scheme, solver) = (self.time.scheme, self.contacts[0].solver);
        ScenePlace { settings: self, relations, roms: &[], scheme, solver, index: 0 }
    }
}

impl Scene {
    /// Checks the rules of a validated scene for its ROMs.
    pub(crate) fn check_roms(&self) -> Result<()> {
        let relations = Relations::of(&self.settings);
        check(ROMS, ScenePlace { roms: &self.roms, ..self.settings.place(&relations) }, path)
    }

    /// Checks that a validated scene can be stepped with a scheme and a solver.
    ///
    /// # Errors
    /// A violated rule, with parameter and remedy.
    pub fn check_methods(&self, scheme: Scheme, solver: Solver) -> Result<()> {
        let parameter = |_: &ScenePlace, key: &str| format!("parameter `{}`", key.rsplit('.').next().unwrap_or(key));
        let relations = Relations::of(&self.settings);
        check(METHODS, ScenePlace { roms: &self.roms, scheme, solver, ..self.settings.place(&relations) }, parameter)
    }
}

/// Rejects violations of a rule; `name` returns the name of a key at a place.
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
