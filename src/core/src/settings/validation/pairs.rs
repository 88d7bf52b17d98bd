//! Which structures and surfaces take part, and which contacts push each other.

use crate::settings::{ContactSettings, Motion, SceneSettings, StructureSettings};
use crate::{Error, Result};

impl SceneSettings {
    /// The first free structure whose contact nodes touch something; `None` in scenes of rotors.
    pub fn free_master(&self) -> Option<&StructureSettings> {
        let free = |structure: &&StructureSettings| structure.motion == Motion::Free;
        self.structures.iter().filter(free).find(|structure| self.touches(structure))
    }

    /// Whether contact nodes of a structure touch something.
    pub(in crate::settings) fn touches(&self, structure: &StructureSettings) -> bool {
        self.contacts.iter().any(|contact| contact.master == structure.name)
    }

    /// The structure whose contact nodes touch in a pair.
    pub fn master_of(&self, contact: &ContactSettings) -> Option<&StructureSettings> {
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
        Ok(())
    }

    /// A structure touches something or carries a surface.
    fn validate_part(&self, structure: &StructureSettings, at: String) -> Result<()> {
        let carries = self.surfaces.iter().any(|surface| surface.structure.as_ref() == Some(&structure.name));
        let (name, what) = (&structure.name, format!("{at}.name"));
        match (self.touches(structure), carries) {
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

    /// Whether two different pairs have their surfaces on one flexible structure.
    pub(in crate::settings) fn share(&self, one: &ContactSettings, other: &ContactSettings) -> bool {
        let carrier = |contact: &ContactSettings| {
            let surface = self.surfaces.iter().find(|surface| surface.name == contact.slave);
            surface.filter(|surface| !surface.rigid).and_then(|surface| surface.structure.as_deref())
        };
        one.slave != other.slave && carrier(one).is_some() && carrier(one) == carrier(other)
    }

    /// Whether two different pairs share a structure, and are solved together.
    pub(in crate::settings) fn are_together(&self, one: &ContactSettings, other: &ContactSettings) -> bool {
        (one.slave != other.slave && one.master == other.master) || self.share(one, other)
    }
}
