//! Features of a scene to which rules refer.

use super::place::ScenePlace;
use crate::scene::method::{Scheme, Solver};
use crate::scene::settings::{BodyMotion, Closure, InputInterpolation, Meridian, Shape};

/// A feature of a scene at a place.
pub(crate) struct Fact {
    /// Key of the scene file, whose first word determines the possible places.
    pub(super) key: &'static str,
    /// Description of the value, if the key alone does not give it.
    pub(super) words: &'static str,
    pub(super) holds: fn(&ScenePlace) -> bool,
}

/// Defines facts: the constant, the key, a description of the value, and whether it holds at a place.
macro_rules! facts {
    ($($fact:ident $key:literal $($words:literal)?, $holds:expr;)*) => {
        $(pub(super) const $fact: Fact = Fact { key: $key, words: concat!($($words)?), holds: $holds };)*
    };
}

impl Fact {
    /// Returns the text in the guide.
    pub(super) fn shown(&self) -> String {
        if self.words.is_empty() { format!("`{}`", self.key) } else { format!("`{}`: {}", self.key, self.words) }
    }
}

facts! {
    SPEED "structure.speed", |at| at.structure().speed != 0.0;
    VELOCITY "structure.velocity", |at| at.structure().velocity.iter().any(|one| *one != 0.0);
    FACTORS "structure.frequency_factors", |at| !at.structure().frequency_factors.is_empty();
    STIFFENING "structure.spin.stiffening", |at| at.structure().spin.stiffening;
    GROWTH "structure.spin.growth", |at| at.structure().spin.growth;
    CORIOLIS "structure.spin.coriolis", |at| at.structure().spin.coriolis;
    WHIRL "structure.whirl", |at| at.structure().whirl;
    AXIAL_SHIFT "structure.axial_shift", |at| at.structure().axial_shift;
    THERMAL "structure.thermal", |at| at.structure().thermal;
    LOAD "structure.load", |at| at.structure().load.is_some();
    SOFTENING "structure.softening", |at| at.structure().softening != 0.0;
    EXCITATION "structure.excitation", |at| at.structure().excitation.is_some();
    INITIAL "structure.initial", |at| !at.structure().initial.is_empty();
    INITIAL_SECTOR "structure.initial.sector", |at| at.structure().initial.iter().any(|one| one.sector.is_some());
    ROM_AROUND "structure.rom" "a structure in a contact around an axis",
        |at| at.meets(|motion| motion != BodyMotion::Free);
    ROM_FREE "structure.rom" "a free structure or one that it can touch",
        |at| at.meets(|motion| motion == BodyMotion::Free);

    SHAPE "surface.shape", |at| at.surface().shape != Shape::default();
    MOVING "surface.moving", |at| at.surface().moving;
    RAMP_TIME "surface.ramp_time", |at| at.surface().ramp_time != 0.0;
    CARRIED "surface.structure", |at| at.surface().structure.is_some();
    CARRIED_AROUND "surface.structure" "a surface around an axis",
        |at| at.surface().structure.is_some() && !at.is_free();
    CARRIED_OPEN "surface.structure" "the surface of a free master",
        |at| at.surface().structure.is_some() && at.is_free();
    RIGID "surface.rigid", |at| at.surface().rigid;
    PATCHES "surface.patches", |at| at.surface().patches.is_some();
    CLOSURE "surface.spline.closure",
        |at| at.surface().spline.is_some_and(|spline| spline.closure != Closure::default());

    FREE_MASTER "contact.master" "a free structure", |at| at.is_free();
    ONE_OF_SEVERAL "contact.master" "a structure with several contacts", |at| at.has_other_contacts();
    GAP "contact.gap", |at| at.contact().gap != 0.0;
    SECTOR_GAPS "contact.sector_gaps", |at| !at.contact().sector_gaps.is_empty();
    MERIDIAN "contact.meridian", |at| at.contact().meridian != Meridian::default();
    COATING "contact.coating", |at| at.is_coated();
    PLASTIC_COATING "contact.coating" "a coating without `cutting`", |at| at.is_coated() && !at.is_cut();
    CONTACT_WIDTH "contact.coating.contact_width",
        |at| at.contact().coating.is_some_and(|coating| coating.contact_width.is_some());
    MODULUS "contact.coating.modulus", |at| at.plastic(|coating| coating.modulus);
    YIELD "contact.coating.yield_stress", |at| at.plastic(|coating| coating.yield_stress);
    HARDENING "contact.coating.hardening", |at| at.plastic(|coating| coating.hardening);
    HEAT "contact.slave_heat_fraction", |at| at.contact().slave_heat_fraction.is_some();
    SOLVER "contact.solver", |_| true;
    STICKING "contact.solver" "`coulomb`", |at| at.solver.sticks();
    UNCOATED "contact.solver" "a solver other than `lcp`", |at| !at.solver.properties().solves_coatings;

    OTHER_SOLVER "contact.solver" "a solver other than `film`", |at| at.contact().solver != Solver::PAPER;
    OTHER_SCHEME "time.scheme" "a scheme other than `central-difference`",
        |at| at.settings.time.scheme != Scheme::PAPER;
    MASSLESS "time.scheme" "`massless-boundary`", |at| at.scheme.properties().delays_contact;
    GALERKIN "time.scheme" "`galerkin`", |at| at.scheme.properties().adaptive;
    QUASI_STATIC "time.scheme" "`massless-boundary` or `galerkin`", |at| at.scheme.properties().quasi_static;
    INTERPOLATION "time.input_interpolation",
        |at| at.settings.time.input_interpolation != InputInterpolation::default();
    OTHER_SECTORS "outputs.watched_sectors" "a sector other than 1",
        |at| at.outputs().watched_sectors.iter().any(|sector| *sector != 1);
    ALL_SECTORS "outputs.all_sectors", |at| at.outputs().all_sectors;
    DIAMETERS "outputs.nodal_diameters", |at| at.outputs().nodal_diameters.is_some();
    STRESS "outputs.stress", |at| at.outputs().stress;
    HEATED_STRESS "outputs.stress" "stress of a rotor with `structure.thermal`",
        |at| at.outputs().stress && at.stressed(|own| own.thermal).next().is_some();
    GROWN_STRESS "outputs.stress" "stress of a rotor with `structure.spin.growth`",
        |at| at.outputs().stress && at.stressed(|own| own.spin.growth).next().is_some();
    MODES "outputs.modal_amplitudes", |at| at.outputs().modal_amplitudes.is_some();
    TIPS "outputs.tip_displacements", |at| at.outputs().tip_displacements;
    CASING_FORCES "outputs.casing_forces", |at| at.outputs().casing_forces;
    SUPPORT "outputs.support_reaction", |at| at.outputs().support_reaction;
    WEAR_PROFILE "outputs.wear_profile", |at| at.outputs().wear_profile;
    WEAR "outputs.wear", |at| at.outputs().wear;
    DISPLACEMENT "outputs.slave_displacement", |at| at.outputs().slave_displacement;
}
