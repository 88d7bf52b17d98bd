//! Checks that structures and surfaces take part in contact pairs.

use std::collections::HashSet;

use crate::scene::settings::relations::Relations;
use crate::scene::settings::{BodyMotion, ContactSettings, SceneSettings, StructureSettings};
use crate::{Error, Result};

impl SceneSettings {
    /// Returns the first free master; `None` in scenes of rotors.
    pub fn free_master(&self) -> Option<&StructureSettings> {
        let free = |structure: &&StructureSettings| structure.motion == BodyMotion::Free;
        self.touching().into_iter().map(|structure| &self.structures[structure]).find(free)
    }

    /// Returns the master of a pair.
    pub fn master_of(&self, contact: &ContactSettings) -> Option<&StructureSettings> {
        self.structures.iter().find(|structure| structure.name == contact.master)
    }

    /// Checks that every structure and every surface takes part; a surface belongs to one pair.
    pub(super) fn validate_pairs(&self, relations: &Relations) -> Result<()> {
        let carriers: HashSet<&str> = self.surfaces.iter().filter_map(|surface| surface.structure.as_deref()).collect();
        for (index, structure) in self.structures.iter().enumerate() {
            let (name, at) = (&structure.name, format!("structure[{}]", index + 1));
            if relations.touches(index) || carriers.contains(name.as_str()) {
                continue;
            }
            if structure.motion == BodyMotion::Free {
                let problem = format!("the free structure `{name}` is not the master of any contact");
                let remedy = "Make it the master of a [[contact]], or remove it";
                return Err(Error::invalid(format!("{at}.motion"), problem, remedy));
            }
            let remedy = "Make it the `master` of a [[contact]] or the `structure` of a [[surface]], or remove it";
            return Err(Error::invalid(format!("{at}.name"), format!("`{name}` is not part of any contact"), remedy));
        }
        let mut counts = vec![0; self.surfaces.len()];
        relations.surfaces.iter().flatten().for_each(|surface| counts[*surface] += 1);
        for (index, (surface, count)) in self.surfaces.iter().zip(counts).enumerate() {
            if count != 1 {
                return Err(Error::invalid(
                    format!("surface[{}].name", index + 1),
                    format!("`{}` is named by {count} contacts, but a surface belongs to exactly one", surface.name),
                    "Name it in exactly one [[contact]], or remove it; give each further contact a separate \
                     [[surface]], which may be on the same structure",
                ));
            }
        }
        Ok(())
    }
}
