//! Scheme of a scene whose file does not give one.

use super::SceneSettings;
use crate::Rom;
use crate::scene::method::Scheme;

impl SceneSettings {
    /// Returns the scheme of this validated scene if its file gives none, and the reason in words.
    ///
    /// It is `galerkin` (adaptive steps) on rigid surfaces wherever no rule of [`rules`](super::rules) excludes it. It is `modal-exact`
    /// (fixed steps) otherwise: on elastic surfaces and with coupled sectors, where fixed steps are faster today.
    /// `roms` has one ROM per structure, or is empty before they are known.
    pub fn default_scheme(&self, roms: &[Rom]) -> (Scheme, String) {
        let rules_out = |scheme: Scheme| self.excluded_method(roms, scheme);
        match self.fixed_step_reason(roms).or_else(|| rules_out(Scheme::ADAPTIVE)) {
            None => (Scheme::ADAPTIVE, "the default for rigid surfaces: adaptive steps within `time.tolerance`".into()),
            Some(reason) => (Scheme::default(), format!("the default with fixed steps, because {reason}")),
        }
    }

    /// Returns the reason why fixed steps are faster.
    fn fixed_step_reason(&self, roms: &[Rom]) -> Option<String> {
        let elastic = self.surfaces.iter().find(|surface| surface.structure.is_some() && !surface.rigid);
        let coupled = || self.structures.iter().zip(roms).find(|(_, rom)| rom.is_cyclic());
        elastic
            .map(|surface| format!("the surface `{}` is elastic", surface.name))
            .or_else(|| coupled().map(|(structure, _)| format!("the sectors of `{}` are coupled", structure.name)))
    }
}
