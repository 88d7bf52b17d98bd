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

pub(super) const fn fact(key: &'static str, words: &'static str, holds: fn(&ScenePlace) -> bool) -> Fact {
    Fact { key, words, holds }
}

impl Fact {
    /// Returns the text in the guide.
    pub(super) fn shown(&self) -> String {
        if self.words.is_empty() { format!("`{}`", self.key) } else { format!("`{}`: {}", self.key, self.words) }
    }
}

pub(super) const SPEED: Fact = fact("structure.speed", "", |at| at.structure().speed != 0.0);
pub(super) const VELOCITY: Fact =
    fact("structure.velocity", "", |at| at.structure().velocity.iter().any(|one| *one != 0.0));
pub(super) const FACTORS: Fact =
    fact("structure.frequency_factors", "", |at| !at.structure().frequency_factors.is_empty());
pub(super) const STIFFENING: Fact = fact("structure.spin.stiffening", "", |at| at.structure().spin.stiffening);
pub(super) const GROWTH: Fact = fact("structure.spin.growth", "", |at| at.structure().spin.growth);
pub(super) const CORIOLIS: Fact = fact("structure.spin.coriolis", "", |at| at.structure().spin.coriolis);
pub(super) const WHIRL: Fact = fact("structure.whirl", "", |at| at.structure().whirl);
pub(super) const AXIAL_SHIFT: Fact = fact("structure.axial_shift", "", |at| at.structure().axial_shift);
pub(super) const THERMAL: Fact = fact("structure.thermal", "", |at| at.structure().thermal);
pub(super) const LOAD: Fact = fact("structure.load", "", |at| at.structure().load.is_some());
pub(super) const SOFTENING: Fact = fact("structure.softening", "", |at| at.structure().softening != 0.0);
pub(super) const EXCITATION: Fact = fact("structure.excitation", "", |at| at.structure().excitation.is_some());
pub(super) const INITIAL: Fact = fact("structure.initial", "", |at| !at.structure().initial.is_empty());
pub(super) const INITIAL_SECTOR: Fact =
    fact("structure.initial.sector", "", |at| at.structure().initial.iter().any(|one| one.sector.is_some()));
pub(super) const ROM_AROUND: Fact = fact("structure.rom", "a structure in a contact around an axis", |at| {
    at.meets(|motion| motion != BodyMotion::Free)
});
pub(super) const ROM_FREE: Fact = fact("structure.rom", "a free structure or one that it can touch", |at| {
    at.meets(|motion| motion == BodyMotion::Free)
});

pub(super) const SHAPE: Fact = fact("surface.shape", "", |at| at.surface().shape != Shape::default());
pub(super) const MOVING: Fact = fact("surface.moving", "", |at| at.surface().moving);
pub(super) const RAMP_TIME: Fact = fact("surface.ramp_time", "", |at| at.surface().ramp_time != 0.0);
pub(super) const CARRIED: Fact = fact("surface.structure", "", |at| at.surface().structure.is_some());
pub(super) const CARRIED_AROUND: Fact =
    fact("surface.structure", "a surface around an axis", |at| at.surface().structure.is_some() && !at.is_free());
pub(super) const CARRIED_OPEN: Fact =
    fact("surface.structure", "the surface of a free master", |at| at.surface().structure.is_some() && at.is_free());
pub(super) const RIGID: Fact = fact("surface.rigid", "", |at| at.surface().rigid);
pub(super) const PATCHES: Fact = fact("surface.patches", "", |at| at.surface().patches.is_some());
pub(super) const CLOSURE: Fact = fact("surface.spline.closure", "", |at| {
    at.surface().spline.is_some_and(|spline| spline.closure != Closure::default())
});

pub(super) const FREE_MASTER: Fact = fact("contact.master", "a free structure", |at| at.is_free());
pub(super) const ONE_OF_SEVERAL: Fact =
    fact("contact.master", "a structure with several contacts", |at| at.has_other_contacts());
pub(super) const GAP: Fact = fact("contact.gap", "", |at| at.contact().gap != 0.0);
pub(super) const SECTOR_GAPS: Fact = fact("contact.sector_gaps", "", |at| !at.contact().sector_gaps.is_empty());
pub(super) const MERIDIAN: Fact = fact("contact.meridian", "", |at| at.contact().meridian != Meridian::default());
pub(super) const COATING: Fact = fact("contact.coating", "", |at| at.is_coated());
pub(super) const PLASTIC_COATING: Fact =
    fact("contact.coating", "a coating without `cutting`", |at| at.is_coated() && !at.is_cut());
pub(super) const CONTACT_WIDTH: Fact = fact("contact.coating.contact_width", "", |at| {
    at.contact().coating.is_some_and(|coating| coating.contact_width.is_some())
});
pub(super) const MODULUS: Fact = fact("contact.coating.modulus", "", |at| at.plastic(|coating| coating.modulus));
pub(super) const YIELD: Fact =
    fact("contact.coating.yield_stress", "", |at| at.plastic(|coating| coating.yield_stress));
pub(super) const HARDENING: Fact = fact("contact.coating.hardening", "", |at| at.plastic(|coating| coating.hardening));
pub(super) const HEAT: Fact = fact("contact.slave_heat_fraction", "", |at| at.contact().slave_heat_fraction.is_some());
pub(super) const SOLVER: Fact = fact("contact.solver", "", |_| true);
pub(super) const FILM: Fact = fact("contact.solver", "`film`", |at| at.solver == Solver::Film);
pub(super) const COULOMB: Fact = fact("contact.solver", "`coulomb`", |at| at.solver == Solver::Coulomb);

pub(super) const OTHER_SOLVER: Fact =
    fact("contact.solver", "a solver other than `film`", |at| at.contact().solver != Solver::Film);
pub(super) const OTHER_SCHEME: Fact =
    fact("time.scheme", "a scheme other than `central-difference`", |at| at.settings.time.scheme != Scheme::PAPER);
pub(super) const MASSLESS: Fact =
    fact("time.scheme", "`massless-boundary`", |at| at.scheme.properties().delays_contact);
pub(super) const GALERKIN: Fact = fact("time.scheme", "`galerkin`", |at| at.scheme.properties().adaptive);
pub(super) const QUASI_STATIC: Fact =
    fact("time.scheme", "`massless-boundary` or `galerkin`", |at| at.scheme.properties().quasi_static);
pub(super) const INTERPOLATION: Fact =
    fact("time.input_interpolation", "", |at| at.settings.time.input_interpolation != InputInterpolation::default());
pub(super) const OTHER_SECTORS: Fact = fact("outputs.watched_sectors", "a sector other than 1", |at| {
    at.outputs().watched_sectors.iter().any(|sector| *sector != 1)
});
pub(super) const ALL_SECTORS: Fact = fact("outputs.all_sectors", "", |at| at.outputs().all_sectors);
pub(super) const DIAMETERS: Fact = fact("outputs.nodal_diameters", "", |at| at.outputs().nodal_diameters.is_some());
pub(super) const STRESS: Fact = fact("outputs.stress", "", |at| at.outputs().stress);
pub(super) const HEATED_STRESS: Fact = fact("outputs.stress", "stress of a rotor with `structure.thermal`", |at| {
    at.outputs().stress && at.stressed(|own| own.thermal).next().is_some()
});
pub(super) const GROWN_STRESS: Fact = fact("outputs.stress", "stress of a rotor with `structure.spin.growth`", |at| {
    at.outputs().stress && at.stressed(|own| own.spin.growth).next().is_some()
});
pub(super) const MODES: Fact = fact("outputs.modal_amplitudes", "", |at| at.outputs().modal_amplitudes.is_some());
pub(super) const TIPS: Fact = fact("outputs.tip_displacements", "", |at| at.outputs().tip_displacements);
pub(super) const CASING_FORCES: Fact = fact("outputs.casing_forces", "", |at| at.outputs().casing_forces);
pub(super) const SUPPORT: Fact = fact("outputs.support_reaction", "", |at| at.outputs().support_reaction);
pub(super) const WEAR_PROFILE: Fact = fact("outputs.wear_profile", "", |at| at.outputs().wear_profile);
pub(super) const WEAR: Fact = fact("outputs.wear", "", |at| at.outputs().wear);
pub(super) const DISPLACEMENT: Fact = fact("outputs.slave_displacement", "", |at| at.outputs().slave_displacement);
