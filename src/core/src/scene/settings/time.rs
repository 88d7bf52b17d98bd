//! Internal time stepping: settings with their ranges, and the default scheme.

use serde::{Deserialize, Serialize};
use tiprub_cosim::bounds::{self, within};

use super::{SceneSettings, is_default};
use crate::scene::method::Scheme;
use crate::scene::ranges;
use crate::{Result, Rom};

/// Default error tolerance of a step of `galerkin`, as a fraction of the smallest clearance.
pub const TOLERANCE: f64 = 1e-2;

/// Default longest step of `galerkin` (s). The communication step also limits the step.
pub const ADAPTIVE_STEP: f64 = 8e-5;

/// Interpolation between communication points of inputs that move or load a structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InputInterpolation {
    /// Ramp from the current value to the new one, which is reached at the end of the step (default).
    #[default]
    Ramp,
    /// The new value acts immediately: a jump within one internal step.
    Hold,
}

/// Internal time stepping.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeSettings {
    /// Scheme. A file without this key has the [default](SceneSettings::default_scheme), which is chosen when the file is read.
    #[serde(default)]
    pub scheme: Scheme,
    /// Reason why this scheme was chosen, if the file does not specify a scheme; used in messages only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scheme_reason: Option<String>,
    /// Largest internal step h (s); the actual step divides the communication step evenly. With adaptive steps, the
    /// longest step; [`ADAPTIVE_STEP`] if the file does not specify it.
    #[serde(default)]
    pub step: f64,
    /// Tolerance on the displacement error of a step of `galerkin`, as a fraction of the smallest clearance; 1e-2 if
    /// absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Largest number of internal steps of one communication step, including rejected trials; no limit if 0 or absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_internal_steps: Option<u32>,
    /// Interpolation of inputs between communication points.
    #[serde(default, skip_serializing_if = "is_default")]
    pub input_interpolation: InputInterpolation,
}

impl TimeSettings {
    /// Returns the error tolerance of adaptive steps; `None` with fixed steps.
    pub fn step_tolerance(&self) -> Option<f64> {
        self.scheme.properties().adaptive.then(|| self.tolerance.unwrap_or(TOLERANCE))
    }

    /// Checks every value against its range.
    pub(super) fn validate(&self) -> Result<()> {
        within("time.max_internal_steps", f64::from(self.max_internal_steps.unwrap_or(0)), 0.0, ranges::STEPS)?;
        if let Some(tolerance) = self.tolerance {
            within("time.tolerance", tolerance, ranges::TOLERANCE[0], ranges::TOLERANCE[1])?;
        }
        within("time.step", self.step, bounds::SHORTEST_STEP, ranges::LONGEST_STEP)
    }
}

impl SceneSettings {
    /// Returns whether the importer may limit the number of internal steps. This requires adaptive steps or a limit in
    /// the scene.
    pub fn bounds_steps(&self) -> bool {
        self.time.max_internal_steps.is_some() || self.takes_a_tolerance()
    }

    /// Returns whether the importer may set a tolerance instead of a step.
    pub(crate) fn takes_a_tolerance(&self) -> bool {
        self.time.tolerance.is_some() || self.time.scheme.properties().adaptive
    }

    /// Returns whether threads may share the blades: adaptive steps on rigid surfaces.
    pub(crate) fn shares_blades(&self) -> bool {
        self.takes_a_tolerance() && self.surfaces.iter().all(|surface| surface.structure.is_none())
    }

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
