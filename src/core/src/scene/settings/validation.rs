//! The documented range of every setting, and the names of a scene. Combinations are checked in [`super::rules`].

mod pairs;

use std::collections::HashSet;

use tiprub_cosim::bounds::{at_most, within};
use tiprub_cosim::warning::Topic;
use tiprub_cosim::{bounds, shown};

use super::relations::{Relations, structure};
use super::{
    BodyMotion, CoatingSettings, ContactSettings, ExcitationSettings, InitialSettings, SceneSettings, Shape,
    SplineSettings, StructureSettings, SurfaceSettings,
};
use crate::scene::ranges;
use crate::{Error, Result};

impl SceneSettings {
    /// Checks every value against its documented range, and the names for consistency.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the field as written in the scene file.
    pub fn validate(&self) -> Result<()> {
        let word = |text: &str| {
            text.starts_with(|c: char| c.is_ascii_alphabetic())
                && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        };
        let names = self.structures.iter().map(|s| ("structure.name", &s.name));
        let names = names.chain(self.surfaces.iter().map(|s| ("surface.name", &s.name)));
        for (field, name) in names.chain([("name", &self.name)]) {
            if !word(name) {
                return Err(Error::invalid(
                    field,
                    format!("`{name}` is not a valid name"),
                    "Use letters, digits and underscores, starting with a letter",
                ));
            }
        }
        self.silence.iter().try_for_each(|id| Topic::find("silence", id).map(|_| ()))?;
        if self.structures.is_empty() || self.contacts.is_empty() {
            return Err(Error::invalid(
                "scene",
                format!("{} structures and {} contacts", self.structures.len(), self.contacts.len()),
                "Give at least one [[structure]] and one [[contact]]",
            ));
        }
        for (index, structure) in self.structures.iter().enumerate() {
            structure.validate(&format!("structure[{}]", index + 1))?;
        }
        let names: HashSet<&str> = self.structures.iter().map(|structure| structure.name.as_str()).collect();
        for (index, surface) in self.surfaces.iter().enumerate() {
            surface.validate((self, &names), &format!("surface[{}]", index + 1))?;
        }
        self.validate_unique_names()?;
        let relations = Relations::of(self);
        self.validate_contact_names(&relations)?;
        self.check_parts(&relations)?;
        self.validate_pairs(&relations)?;
        self.check_whole(&relations)?;
        for (index, contact) in self.contacts.iter().enumerate() {
            let master = structure(self, relations.masters[index]);
            let flies = master.is_some_and(|master| master.motion == BodyMotion::Free);
            contact.validate(flies, &format!("contact[{}]", index + 1))?;
        }
        self.time.validate()?;
        let experiment = &self.experiment;
        at_most("experiment.start", experiment.start, bounds::TIME)?;
        at_most("experiment.stop", experiment.stop, bounds::TIME)?;
        let length = experiment.communication_step;
        within("experiment.communication_step", length, bounds::SHORTEST_STEP, bounds::TIME)?;
        if !(self.experiment.stop.is_finite() && self.experiment.stop > self.experiment.start) {
            return Err(Error::invalid(
                "experiment.stop",
                format!(
                    "{} s is not after experiment.start = {} s",
                    shown(self.experiment.stop),
                    shown(self.experiment.start)
                ),
                "Give a stop time after the start time",
            ));
        }
        self.validate_outputs()
    }

    fn validate_outputs(&self) -> Result<()> {
        let outputs = &self.outputs;
        if outputs.watched_sectors.contains(&0) {
            return Err(Error::invalid("outputs.watched_sectors", "there is no sector 0", "Count sectors from 1"));
        }
        let mut seen = outputs.watched_sectors.clone();
        seen.sort_unstable();
        if seen.windows(2).any(|pair| pair[0] == pair[1]) {
            return Err(Error::invalid("outputs.watched_sectors", "a sector is listed twice", "List each sector once"));
        }
        Ok(())
    }

    fn validate_contact_names(&self, relations: &Relations) -> Result<()> {
        for (index, contact) in self.contacts.iter().enumerate() {
            let master = relations.masters[index].is_none().then_some(("master", &contact.master));
            let slave = relations.surfaces[index].is_none().then_some(("slave", &contact.slave));
            let Some((field, name)) = master.or(slave) else { continue };
            let known: Vec<&str> = match field {
                "master" => self.structures.iter().map(|structure| structure.name.as_str()).collect(),
                _ => self.surfaces.iter().map(|surface| surface.name.as_str()).collect(),
            };
            return Err(Error::invalid(
                format!("contact[{}].{field}", index + 1),
                format!("`{name}` is not defined"),
                format!("Use one of: {}", known.join(", ")),
            ));
        }
        Ok(())
    }

    fn validate_unique_names(&self) -> Result<()> {
        let structures = self.structures.iter().map(|structure| ("structure", &structure.name)).zip(1..);
        let surfaces = self.surfaces.iter().map(|surface| ("surface", &surface.name)).zip(1..);
        let mut before = HashSet::new();
        for ((kind, name), number) in structures.chain(surfaces) {
            if !before.insert(name) {
                return Err(Error::invalid(
                    format!("{kind}[{number}].name"),
                    format!("`{name}` is used by two structures or surfaces"),
                    "Give every structure and every surface a unique name",
                ));
            }
        }
        Ok(())
    }
}

impl StructureSettings {
    fn validate(&self, at: &str) -> Result<()> {
        at_most(&format!("{at}.speed"), self.speed, ranges::SPEED)?;
        if let Some(ratio) = self.damping_ratio {
            within(&format!("{at}.damping_ratio"), ratio, 0.0, ranges::DAMPING)?;
        }
        for (index, ratio) in self.damping_ratios.iter().enumerate() {
            within(&format!("{at}.damping_ratios[{}]", index + 1), *ratio, 0.0, ranges::DAMPING)?;
        }
        within(&format!("{at}.softening"), self.softening, 0.0, ranges::SOFTENING)?;
        for (index, factor) in self.frequency_factors.iter().enumerate() {
            between(&format!("{at}.frequency_factors[{}]", index + 1), *factor, ranges::FREQUENCY_FACTORS)?;
        }
        if let Some(load) = &self.load {
            at_most(&format!("{at}.load.amplitude"), load.amplitude, ranges::LINE_LOAD)?;
            at_most(&format!("{at}.load.phase"), load.phase, ranges::ANGLE)?;
        }
        if let Some(excitation) = &self.excitation {
            excitation.validate(&format!("{at}.excitation"))?;
        }
        for (index, initial) in self.initial.iter().enumerate() {
            initial.validate(&format!("{at}.initial[{}]", index + 1))?;
        }
        let field = format!("{at}.velocity");
        self.velocity.iter().try_for_each(|component| at_most(&field, *component, ranges::VELOCITY))
    }
}

/// Checks a number of a mode or sector, which count from 1.
fn counted(field: String, number: Option<usize>) -> Result<()> {
    if number == Some(0) { Err(Error::invalid(field, "0 is out of range", "Count from 1")) } else { Ok(()) }
}

impl ExcitationSettings {
    fn validate(&self, at: &str) -> Result<()> {
        within(&format!("{at}.order"), f64::from(self.order), 0.0, ranges::ENGINE_ORDER)?;
        at_most(&format!("{at}.amplitude"), self.amplitude, ranges::EXCITATION)?;
        at_most(&format!("{at}.phase"), self.phase, ranges::ANGLE)?;
        counted(format!("{at}.mode"), self.mode)?;
        if self.node.is_some() != self.direction.is_some() {
            let remedy = "Give both, or leave out both and give a `mode`";
            return Err(Error::invalid(format!("{at}.node"), "only one of `node` and `direction` is given", remedy));
        }
        if self.node.is_none() && self.mode.is_none() {
            let remedy = "Give the loaded `mode`, or the `node` and the `direction` of a force, or all three";
            return Err(Error::invalid(format!("{at}.mode"), "neither `mode` nor `node` is given", remedy));
        }
        Ok(())
    }
}

impl InitialSettings {
    fn validate(&self, at: &str) -> Result<()> {
        counted(format!("{at}.mode"), Some(self.mode))?;
        counted(format!("{at}.sector"), self.sector)?;
        if self.sector.is_some() && self.nodal_diameter.is_some() {
            let remedy = "Give only one of them; several [[structure.initial]] entries are superposed";
            return Err(Error::invalid(format!("{at}.sector"), "cannot be combined with `nodal_diameter`", remedy));
        }
        at_most(&format!("{at}.displacement"), self.displacement, ranges::POSITION)?;
        at_most(&format!("{at}.velocity"), self.velocity, ranges::VELOCITY)?;
        at_most(&format!("{at}.phase"), self.phase, ranges::ANGLE)
    }
}

impl SurfaceSettings {
    /// Checks a surface; `known` are the scene and the names of its structures.
    fn validate(&self, known: (&SceneSettings, &HashSet<&str>), at: &str) -> Result<()> {
        within(&format!("{at}.ramp_time"), self.ramp_time, 0.0, bounds::TIME)?;
        self.validate_carrier(known, at)?;
        if let Some(SplineSettings { around, along, .. }) = self.spline {
            count(&format!("{at}.spline.around"), around, ranges::SPLINE_AROUND)?;
            count(&format!("{at}.spline.along"), along, ranges::SPLINE_ALONG)?;
        }
        if let Some(patches) = self.patches {
            count(&format!("{at}.patches.around"), patches.around, [1, bounds::PATCHES])?;
            count(&format!("{at}.patches.along"), patches.along, [1, bounds::PATCHES])?;
            product(&format!("{at}.patches"), "patches", patches.around, patches.along, bounds::PATCHES)?;
        }
        self.validate_shape(at)
    }

    /// Checks the structure that carries the surface.
    fn validate_carrier(&self, (scene, names): (&SceneSettings, &HashSet<&str>), at: &str) -> Result<()> {
        let Some(name) = &self.structure else { return Ok(()) };
        if names.contains(name.as_str()) {
            return Ok(());
        }
        let still = scene.structures.iter().filter(|structure| structure.motion == BodyMotion::Still);
        let candidates: Vec<&str> = still.map(|structure| structure.name.as_str()).collect();
        let remedy = if candidates.is_empty() {
            "Add a [[structure]] with motion = \"still\", or remove the line for a rigid surface".to_owned()
        } else {
            format!("Use one of: {}; or remove the line for a rigid surface", candidates.join(", "))
        };
        Err(Error::invalid(format!("{at}.structure"), format!("`{name}` is not defined"), remedy))
    }

    fn validate_shape(&self, at: &str) -> Result<()> {
        match &self.shape {
            Shape::Circular {} => Ok(()),
            Shape::Lobes { amplitude, order, phase } => {
                at_most(&format!("{at}.shape.amplitude"), *amplitude, ranges::POSITION)?;
                at_most(&format!("{at}.shape.phase"), *phase, ranges::ANGLE)?;
                if *order == 0 {
                    let remedy = "Use order ≥ 1; set a uniform clearance with the gap and the radius change";
                    return Err(Error::invalid(format!("{at}.shape.order"), "0 lobes", remedy));
                }
                within(&format!("{at}.shape.order"), f64::from(*order), 1.0, ranges::LOBES)
            }
            Shape::TwoLobe { depth, width, phase } => {
                at_most(&format!("{at}.shape.depth"), *depth, ranges::DEPTH)?;
                at_most(&format!("{at}.shape.phase"), *phase, ranges::ANGLE)?;
                between(&format!("{at}.shape.width"), *width, ranges::LOBE_WIDTH)
            }
            Shape::Table { radius_change } => {
                crate::scene::shape::CompiledShape::new(&Shape::Table { radius_change: radius_change.clone() }, 0.0)
                    .map_or_else(|error| Err(error.placed("surface", at)), |_| Ok(()))
            }
        }
    }
}

impl ContactSettings {
    /// Checks the numbers of a contact; there is no gap before a master that `flies`.
    fn validate(&self, flies: bool, at: &str) -> Result<()> {
        if self.nodes.as_ref().is_some_and(String::is_empty) {
            let remedy = "Give the prefix of the node names, or remove the line to use all nodes";
            return Err(Error::invalid(format!("{at}.nodes"), "the text is empty", remedy));
        }
        within(&format!("{at}.friction"), self.friction, 0.0, ranges::FRICTION)?;
        if let Some(share) = self.slave_heat_fraction {
            within(&format!("{at}.slave_heat_fraction"), share, 0.0, 1.0)?;
        }
        if let Some(coating) = &self.coating {
            coating.validate(&format!("{at}.coating"))?;
        }
        if flies {
            return Ok(());
        }
        if self.gap == 0.0 && self.sector_gaps.is_empty() {
            let remedy = "Add the radial tip clearance (m) to [[contact]], above 0 and at most a tenth of the radius; \
                          only contacts of free masters have no gap";
            return Err(Error::invalid(format!("{at}.gap"), "missing or 0", remedy));
        }
        if self.gap != 0.0 || self.sector_gaps.is_empty() {
            gap(&format!("{at}.gap"), self.gap)?;
        }
        self.sector_gaps.iter().try_for_each(|value| gap(&format!("{at}.sector_gaps"), *value))
    }
}

impl CoatingSettings {
    fn validate(&self, at: &str) -> Result<()> {
        between(&format!("{at}.thickness"), self.thickness, ranges::THICKNESS)?;
        if let Some(cutting) = &self.cutting {
            between(&format!("{at}.cutting.specific_energy"), cutting.specific_energy, ranges::CUTTING_ENERGY)?;
            between(&format!("{at}.cutting.normal_ratio"), cutting.normal_ratio, ranges::NORMAL_RATIO)?;
        } else {
            between(&format!("{at}.modulus"), self.modulus, ranges::MODULUS)?;
        }
        within(&format!("{at}.yield_stress"), self.yield_stress, 0.0, ranges::STRESS)?;
        within(&format!("{at}.hardening"), self.hardening, 0.0, ranges::STRESS)?;
        if let Some(width) = self.contact_width {
            between(&format!("{at}.contact_width"), width, ranges::CONTACT_WIDTH)?;
        }
        count(&format!("{at}.cells_around"), self.cells_around, [2, ranges::CELLS])?;
        count(&format!("{at}.cells_along"), self.cells_along, [1, ranges::CELLS])?;
        product(at, "cells", self.cells_around, self.cells_along, ranges::CELLS)
    }
}

/// Checks a clearance. Values smaller than an atom are valid, though practically zero.
fn gap(field: &str, value: f64) -> Result<()> {
    if !(value.is_finite() && value > 0.0) {
        return Err(Error::invalid(field, format!("{} m is out of range", shown(value)), "Give a finite value > 0"));
    }
    within(field, value, 0.0, ranges::POSITION)
}

fn between(field: &str, value: f64, range: [f64; 2]) -> Result<()> {
    within(field, value, range[0], range[1])
}

fn count(field: &str, value: usize, range: [usize; 2]) -> Result<()> {
    let [least, most] = range;
    if (least..=most).contains(&value) {
        Ok(())
    } else {
        let remedy = format!("Give a whole number from {least} to {most}");
        Err(Error::invalid(field, format!("{value} is out of range"), remedy))
    }
}

fn product(field: &str, what: &str, around: usize, along: usize, most: usize) -> Result<()> {
    if around.checked_mul(along).is_some_and(|total| total <= most) {
        Ok(())
    } else {
        let problem = format!("{around} around x {along} along exceed the limit of {most} {what}");
        Err(Error::invalid(field, problem, format!("Use at most {most} {what} in total")))
    }
}
