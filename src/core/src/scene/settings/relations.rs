//! Structures and surfaces of each contact, resolved once from names, so that the time of checks is linear in the length of the scene.

use std::collections::HashMap;

use super::{SceneSettings, StructureSettings};

/// Indices of structures and surfaces that contacts name.
pub(crate) struct Relations {
    /// Master of each contact.
    pub(crate) masters: Vec<Option<usize>>,
    /// Surface of each contact.
    pub(crate) surfaces: Vec<Option<usize>>,
    /// Structure under that surface, rigid or not, of each contact.
    pub(crate) carriers: Vec<Option<usize>>,
    /// Contacts of each structure, as master or under the surface.
    pub(crate) contacts: Vec<Vec<usize>>,
}

/// Returns the first index of each name.
fn places<'a>(names: impl Iterator<Item = &'a String>) -> HashMap<&'a str, usize> {
    let mut places = HashMap::new();
    for (place, name) in names.enumerate() {
        places.entry(name.as_str()).or_insert(place);
    }
    places
}

impl Relations {
    /// Finds the relations of a scene whose names may be undefined.
    pub(crate) fn of(settings: &SceneSettings) -> Self {
        let structures = places(settings.structures.iter().map(|structure| &structure.name));
        let named = places(settings.surfaces.iter().map(|surface| &surface.name));
        let contacts = &settings.contacts;
        let masters: Vec<_> = contacts.iter().map(|contact| structures.get(contact.master.as_str()).copied()).collect();
        let surfaces: Vec<_> = contacts.iter().map(|contact| named.get(contact.slave.as_str()).copied()).collect();
        let carrier = |surface: &Option<usize>| {
            structures.get(settings.surfaces[(*surface)?].structure.as_ref()?.as_str()).copied()
        };
        let carriers: Vec<_> = surfaces.iter().map(carrier).collect();
        let mut of_structures = vec![Vec::new(); settings.structures.len()];
        for (contact, (master, carrier)) in masters.iter().zip(&carriers).enumerate() {
            for structure in master.iter().chain(carrier.iter().filter(|carrier| Some(**carrier) != *master)) {
                of_structures[*structure].push(contact);
            }
        }
        Self { masters, surfaces, carriers, contacts: of_structures }
    }

    /// Returns whether a structure is the master of a contact.
    pub(crate) fn touches(&self, structure: usize) -> bool {
        self.contacts[structure].iter().any(|contact| self.masters[*contact] == Some(structure))
    }

    /// Returns the structure that a contact deforms.
    fn flexible(&self, settings: &SceneSettings, contact: usize) -> Option<usize> {
        let surface = self.surfaces[contact]?;
        self.carriers[contact].filter(|_| !settings.surfaces[surface].rigid)
    }

    /// Returns whether another pair has its surface on the same flexible structure.
    pub(crate) fn shares_carrier(&self, settings: &SceneSettings, contact: usize) -> bool {
        let Some(carrier) = self.flexible(settings, contact) else { return false };
        let mut others = self.contacts[carrier].iter().filter(|other| self.surfaces[**other] != self.surfaces[contact]);
        others.any(|other| self.flexible(settings, *other) == Some(carrier))
    }

    /// Returns whether another pair has a structure in common and is solved together with this one.
    pub(crate) fn is_coupled(&self, settings: &SceneSettings, contact: usize) -> bool {
        let Some(master) = self.masters[contact] else { return false };
        let same =
            |other: &usize| self.masters[*other] == Some(master) && self.surfaces[*other] != self.surfaces[contact];
        self.contacts[master].iter().any(same) || self.shares_carrier(settings, contact)
    }
}

impl SceneSettings {
    /// Returns the indices of the masters.
    pub(crate) fn touching(&self) -> Vec<usize> {
        let relations = Relations::of(self);
        (0..self.structures.len()).filter(|structure| relations.touches(*structure)).collect()
    }
}

/// Returns a structure by its index, if any.
pub(crate) fn structure(settings: &SceneSettings, place: Option<usize>) -> Option<&StructureSettings> {
    place.map(|place| &settings.structures[place])
}
