//! Which structures and surfaces go together, and what only structures that fly freely have.

use crate::ranges::{self, at_most, within};
use crate::settings::{
    Closure, ContactSettings, InputInterpolation, Meridian, Motion, SceneSettings, Scheme, Shape, StructureSettings,
    SurfaceSettings,
};
use crate::{Error, Result};

impl SceneSettings {
    /// The first free structure whose contact nodes touch something; `None` in scenes of rotors.
    pub fn free_master(&self) -> Option<&StructureSettings> {
        let free = |structure: &&StructureSettings| structure.motion == Motion::Free;
        self.structures.iter().filter(free).find(|structure| self.touches(structure))
    }

    /// Whether contact nodes of a structure touch something.
    fn touches(&self, structure: &StructureSettings) -> bool {
        self.contacts.iter().any(|contact| contact.master == structure.name)
    }

    /// The structure whose contact nodes touch in a pair.
    pub(super) fn master_of(&self, contact: &ContactSettings) -> Option<&StructureSettings> {
        self.structures.iter().find(|structure| structure.name == contact.master)
    }

    /// Every structure and every surface takes part; a surface belongs to one pair.
    pub(super) fn validate_pairs(&self) -> Result<()> {
        for (index, structure) in self.structures.iter().enumerate() {
            self.validate_part(structure, format!("structure[{}]", index + 1))?;
        }
        for (index, surface) in self.surfaces.iter().enumerate() {
            let count = self.contacts.iter().filter(|contact| contact.slave == surface.name).count();
            if count != 1 {
                return Err(Error::invalid(
                    format!("surface[{}].name", index + 1),
                    format!("`{}` is named by {count} contacts; a surface belongs to one pair", surface.name),
                    "Name it in one [[contact]], or remove it: another pair takes a [[surface]] of its own, on the same structure if \
                     it has one",
                ));
            }
        }
        for (index, contact) in self.contacts.iter().enumerate() {
            self.validate_beside_others(index, contact)?;
        }
        if self.free_master().is_some() { self.validate_free_outputs() } else { Ok(()) }
    }

    /// A structure touches something or carries a surface.
    fn validate_part(&self, structure: &StructureSettings, at: String) -> Result<()> {
        let carries = self.surfaces.iter().any(|surface| surface.structure.as_ref() == Some(&structure.name));
        let (name, what) = (&structure.name, format!("{at}.name"));
        match (self.touches(structure), carries) {
            (true, true) => Err(Error::invalid(
                what,
                format!(
                    "`{name}` is the master of a contact and carries a surface: contact nodes and control points of one structure \
                     together are not made for"
                ),
                "Let it be the master of both contacts, with surfaces on what it meets",
            )),
            (false, false) if structure.motion == Motion::Free => Err(Error::invalid(
                format!("{at}.motion"),
                format!("`{name}` flies freely and is the master of no contact"),
                "Make it the master of a [[contact]], or remove it",
            )),
            (false, false) => {
                let remedy = "Make it the `master` of a [[contact]] or the `structure` of a [[surface]], or remove it";
                Err(Error::invalid(what, format!("`{name}` takes no part in any contact"), remedy))
            }
            _ => Ok(()),
        }
    }

    /// What a pair may be beside other pairs.
    fn validate_beside_others(&self, index: usize, contact: &ContactSettings) -> Result<()> {
        let (at, first) = (format!("contact[{}]", index + 1), &self.contacts[0]);
        if contact.solver != first.solver {
            let problem = "differs from that of contact[1]: a scene has one solver";
            return Err(Error::invalid(format!("{at}.solver"), problem, "Give all pairs the same solver"));
        }
        let same = |other: &&ContactSettings| other.master == contact.master;
        if contact.nodes.is_none() && self.contacts.iter().filter(same).count() > 1 {
            let problem = "of several pairs of one structure one claims all its contact nodes";
            let remedy = "Give every pair `nodes`: what the names of its contact nodes start with";
            return Err(Error::invalid(format!("{at}.nodes"), problem, remedy));
        }
        if contact.coating.is_some() && self.contacts.iter().any(|other| self.are_together(contact, other)) {
            let problem = "its contacts are solved together with those of another pair, of the same structure or through the \
                           structure that carries both surfaces";
            let remedy = "Leave out the coating, or give the pair a structure and a surface of its own";
            return Err(Error::invalid(format!("{at}.coating"), problem, remedy));
        }
        Ok(())
    }

    /// Whether two different pairs share a structure.
    fn are_together(&self, one: &ContactSettings, other: &ContactSettings) -> bool {
        let carrier = |contact: &ContactSettings| {
            let surface = self.surfaces.iter().find(|surface| surface.name == contact.slave);
            surface.filter(|surface| !surface.rigid).and_then(|surface| surface.structure.as_deref())
        };
        let shared = carrier(one).is_some() && carrier(one) == carrier(other);
        one.slave != other.slave && (one.master == other.master || shared)
    }

    fn validate_free_outputs(&self) -> Result<()> {
        let outputs = &self.outputs;
        let free = |contact: &ContactSettings| self.master_of(contact).is_some_and(|one| one.motion == Motion::Free);
        if !self.contacts.iter().all(free) {
            return self.validate_free_methods();
        }
        let watched = outputs.watched_sectors.iter().any(|sector| *sector != 1);
        let asked = [
            ("watched_sectors", watched, "a free structure has one sector", "Use [1], or [] for none"),
            ("all_sectors", outputs.all_sectors, "a free structure has one sector", "Remove the line"),
            ("nodal_diameters", outputs.nodal_diameters.is_some(), "a free structure has none", "Remove the line"),
            (
                "slave_displacement",
                outputs.slave_displacement,
                "it is radial, and open surfaces have no axis",
                "Remove the line",
            ),
        ];
        if let Some((field, _, problem, remedy)) = asked.into_iter().find(|(_, asked, ..)| *asked) {
            return Err(Error::invalid(format!("outputs.{field}"), problem, remedy));
        }
        if self.time.input_interpolation != InputInterpolation::default() {
            let problem = "a scene with a free master has no inputs";
            return Err(Error::invalid("time.input_interpolation", problem, "Remove the line"));
        }
        self.validate_free_methods()
    }

    fn validate_free_methods(&self) -> Result<()> {
        if self.time.scheme == Scheme::MasslessBoundary {
            let problem = "\"massless-boundary\" is not made for a master that flies freely";
            return Err(Error::invalid("time.scheme", problem, "Use \"modal-exact\" or \"central-difference\""));
        }
        Ok(())
    }
}

impl ContactSettings {
    /// A pair of a free master: gaps follow from positions, surfaces are open grids.
    pub(super) fn validate_free(&self, scene: &SceneSettings, at: &str) -> Result<()> {
        at_most(&format!("{at}.gap"), self.gap, ranges::POSITION)?;
        within(&format!("{at}.friction"), self.friction, 0.0, ranges::FRICTION)?;
        let asked = [
            ("gap", self.gap != 0.0),
            ("sector_gaps", !self.sector_gaps.is_empty()),
            ("meridian", self.meridian != Meridian::default()),
            ("coating", self.coating.is_some()),
            ("heat_to_slave", self.heat_to_slave.is_some()),
        ];
        if let Some((field, _)) = asked.into_iter().find(|(_, asked)| *asked) {
            let problem = "a free master does not have it: its gaps and normals follow from the positions in both ROMs";
            return Err(Error::invalid(format!("{at}.{field}"), problem, "Remove the line"));
        }
        let Some(surface) = scene.surfaces.iter().find(|surface| surface.name == self.slave) else { return Ok(()) };
        surface.validate_open(at)
    }
}

impl SurfaceSettings {
    /// What a surface around an axis has and an open one does not.
    fn validate_open(&self, at: &str) -> Result<()> {
        let what = |field: &str| format!("surface `{}` of {at}: {field}", self.name);
        if self.structure.is_none() {
            let remedy = "Give it a `structure` that stands still; `rigid = true` leaves out its deformation";
            return Err(Error::invalid(
                what("structure"),
                "absent, and a free master needs to know where it is",
                remedy,
            ));
        }
        let asked = [
            ("shape", self.shape != Shape::default()),
            ("moving", self.moving),
            ("ramp_time", self.ramp_time != 0.0),
            ("patches", self.patches.is_some()),
            ("spline.closure", self.spline.is_some_and(|spline| spline.closure != Closure::default())),
        ];
        match asked.into_iter().find(|(_, asked)| *asked) {
            None => Ok(()),
            Some((field, _)) => {
                let problem =
                    "only a surface around an axis has it, and this one is the open contact grid of a structure";
                Err(Error::invalid(what(field), problem, "Remove the line"))
            }
        }
    }
}
