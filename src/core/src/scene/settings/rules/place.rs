//! Places to which rules apply: structures and contacts of a scene, and the scene as a whole.

use crate::Rom;
use crate::scene::method::{Scheme, Solver};
use crate::scene::settings::relations::{Relations, structure};
use crate::scene::settings::{
    BodyMotion, CoatingSettings, ContactSettings, OutputSettings, SceneSettings, StructureSettings, SurfaceSettings,
};

/// A place of a scene: one of its structures or contacts, or the scene as a whole.
#[derive(Clone, Copy)]
pub(crate) struct ScenePlace<'a> {
    pub(super) settings: &'a SceneSettings,
    pub(super) relations: &'a Relations,
    /// ROMs of the structures; empty before they are known.
    pub(super) roms: &'a [Rom],
    pub(super) scheme: Scheme,
    pub(super) solver: Solver,
    /// Index of the structure or contact.
    pub(super) index: usize,
}

/// Returns the key with the number of its structure, surface or contact.
pub(super) fn path(at: &ScenePlace, key: &str) -> String {
    let (table, rest) = key.split_once('.').unwrap_or((key, ""));
    let number = match table {
        "structure" | "contact" => at.index,
        "surface" => at.relations.surfaces[at.index].unwrap_or(0),
        _ => return key.to_owned(),
    };
    format!("{table}[{}].{rest}", number + 1)
}

impl<'a> ScenePlace<'a> {
    /// Returns the places of a key: structures, contacts, or the scene.
    pub(super) fn all_of(self, key: &str) -> impl Iterator<Item = Self> {
        let count = match key.split('.').next() {
            Some("structure") => self.settings.structures.len(),
            Some("surface" | "contact") => self.settings.contacts.len(),
            _ => 1,
        };
        (0..count).map(move |index| Self { index, ..self })
    }

    pub(super) fn structure(&self) -> &'a StructureSettings {
        &self.settings.structures[self.index]
    }

    /// Returns the ROM of a structure, if ROMs are known.
    pub(super) fn rom(&self) -> &'a Rom {
        &self.roms[self.index]
    }

    pub(super) fn contact(&self) -> &'a ContactSettings {
        &self.settings.contacts[self.index]
    }

    /// Returns the surface of a contact, whose names are already checked.
    pub(super) fn surface(&self) -> &'a SurfaceSettings {
        let own = self.relations.surfaces[self.index];
        &self.settings.surfaces[own.unwrap_or_else(|| unreachable!("validated"))]
    }

    pub(super) fn outputs(&self) -> &'a OutputSettings {
        &self.settings.outputs
    }

    pub(super) fn contacts(self) -> impl Iterator<Item = Self> {
        self.all_of("contact")
    }

    /// Returns whether the master of the contact is a free body.
    pub(super) fn is_free(&self) -> bool {
        self.master().is_some_and(|master| master.motion == BodyMotion::Free)
    }

    pub(super) fn is_coated(&self) -> bool {
        self.contact().coating.is_some()
    }

    pub(super) fn is_cut(&self) -> bool {
        self.contact().coating.is_some_and(|coating| coating.cutting.is_some())
    }

    /// Returns whether the contact has a coating with this value.
    pub(super) fn plastic(&self, value: fn(&CoatingSettings) -> f64) -> bool {
        self.contact().coating.is_some_and(|coating| value(&coating) != 0.0)
    }

    fn master(&self) -> Option<&'a StructureSettings> {
        structure(self.settings, self.relations.masters[self.index])
    }

    /// Returns the structure under the surface of the contact.
    pub(super) fn carrier(&self) -> Option<&'a StructureSettings> {
        structure(self.settings, self.relations.carriers[self.index])
    }

    /// Returns whether the master of this contact has several contacts.
    pub(super) fn has_other_contacts(&self) -> bool {
        let Some(master) = self.relations.masters[self.index] else { return false };
        let own = self.relations.contacts[master].iter();
        own.filter(|contact| self.relations.masters[**contact] == Some(master)).count() > 1
    }

    /// Returns the ROM of the master of a contact.
    pub(super) fn master_rom(&self) -> Option<&'a Rom> {
        self.relations.masters[self.index].map(|index| &self.roms[index])
    }

    /// Returns the ROMs with recovered stress of the masters with a load.
    pub(super) fn stressed(self, is_loaded: fn(&StructureSettings) -> bool) -> impl Iterator<Item = &'a Rom> {
        let masters = self.contacts().filter(move |at| at.master().is_some_and(is_loaded));
        masters.filter_map(|at| at.master_rom()).filter(|rom| rom.extras.stress.is_some())
    }

    pub(super) fn carrier_rom(&self) -> Option<&'a Rom> {
        self.relations.carriers[self.index].map(|index| &self.roms[index])
    }

    /// Returns whether the structure takes part in a contact whose master has such a motion.
    pub(super) fn meets(&self, moves: fn(BodyMotion) -> bool) -> bool {
        let own = self.relations.contacts[self.index].iter();
        own.filter_map(|contact| Self { index: *contact, ..*self }.master()).any(|master| moves(master.motion))
    }

    /// Returns whether a solver with sticking is possible. For a coupled problem of all sectors, this requires that the
    /// scene selects it.
    pub(super) fn may_stick(&self) -> bool {
        let settings = self.settings;
        let small = self.contacts().all(|at| !at.is_free() && at.carrier().is_none());
        let uncoupled = self.roms.iter().all(|rom| !rom.is_cyclic());
        let rubs = settings.contacts.iter().any(|contact| contact.friction > 0.0);
        settings.contacts[0].solver.sticks()
            || (small && uncoupled && rubs && self.contacts().all(|at| !at.is_coated()))
    }

    /// Returns whether every master has modes with inertia; true before ROMs are known.
    pub(super) fn has_modes_left(&self) -> bool {
        let structures = self.roms.iter().enumerate();
        structures.filter(|(structure, _)| self.relations.touches(*structure)).all(|(_, rom)| {
            let harmonics = rom.extras.harmonics.iter().map(|harmonic| harmonic.mass.nrows());
            harmonics.chain([rom.order()]).all(|modes| modes > 3 * rom.contact_nodes.len())
        })
    }
}
