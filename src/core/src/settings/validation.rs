//! The documented range of every setting, and how settings go together.

mod pairs;

use super::{
    CoatingSettings, ContactSettings, Motion, SceneSettings, Scheme, Shape, Solver, SplineSettings, StructureSettings,
    SurfaceSettings,
};
use crate::ranges::{self, at_most, within};
use crate::{Error, Result, shown};

impl SceneSettings {
    /// Check every value against its documented range, and the names against each other.
    ///
    /// # Errors
    /// [`Error::Invalid`] naming the field as written in the scene file.
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
                    format!("`{name}` is not a plain name"),
                    "Use letters, digits and underscores, starting with a letter",
                ));
            }
        }
        if self.structures.is_empty() || self.contacts.is_empty() {
            return Err(Error::invalid(
                "scene",
                format!("{} structures and {} contacts", self.structures.len(), self.contacts.len()),
                "A scene needs at least one [[structure]] and one [[contact]]",
            ));
        }
        for (index, structure) in self.structures.iter().enumerate() {
            structure.validate(&format!("structure[{}]", index + 1))?;
        }
        for (index, surface) in self.surfaces.iter().enumerate() {
            surface.validate(self, &format!("surface[{}]", index + 1))?;
        }
        self.validate_unique_names()?;
        for (index, contact) in self.contacts.iter().enumerate() {
            contact.validate(self, &format!("contact[{}]", index + 1))?;
        }
        self.validate_pairs()?;
        self.validate_scheme()?;
        within("time.step", self.time.step, ranges::SHORTEST_STEP, ranges::LONGEST_STEP)?;
        let experiment = &self.experiment;
        at_most("experiment.start", experiment.start, ranges::TIME)?;
        at_most("experiment.stop", experiment.stop, ranges::TIME)?;
        let length = experiment.communication_step;
        within("experiment.communication_step", length, ranges::SHORTEST_STEP, ranges::TIME)?;
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
            return Err(Error::invalid("outputs.watched_sectors", "sector 0", "Sectors are counted from 1"));
        }
        let mut seen = outputs.watched_sectors.clone();
        seen.sort_unstable();
        if seen.windows(2).any(|pair| pair[0] == pair[1]) {
            return Err(Error::invalid("outputs.watched_sectors", "a sector is listed twice", "List each sector once"));
        }
        if outputs.wear && self.contacts.iter().all(|contact| contact.coating.is_none()) {
            let remedy = "Add a `coating` to the contact, or remove the line";
            return Err(Error::invalid("outputs.wear", "no contact has a coating that could wear", remedy));
        }
        if outputs.slave_displacement && self.surfaces.iter().all(|surface| surface.structure.is_none()) {
            let remedy = "Give the surface a `structure`, or remove the line";
            return Err(Error::invalid("outputs.slave_displacement", "every surface is rigid", remedy));
        }
        Ok(())
    }

    fn validate_scheme(&self) -> Result<()> {
        let coriolis = self.structures.iter().position(|structure| structure.spin.coriolis);
        match coriolis {
            Some(index) if self.time.scheme == Scheme::MasslessBoundary => Err(Error::invalid(
                format!("structure[{}].spin.coriolis", index + 1),
                "the Coriolis force is not available with time.scheme = \"massless-boundary\"",
                "Use scheme = \"modal-exact\", or leave the Coriolis force out",
            )),
            _ => Ok(()),
        }
    }

    fn validate_unique_names(&self) -> Result<()> {
        let names = self.structures.iter().map(|s| &s.name).chain(self.surfaces.iter().map(|s| &s.name));
        let mut sorted: Vec<&String> = names.collect();
        sorted.sort_unstable();
        match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            None => Ok(()),
            Some(pair) => Err(Error::invalid(
                "name",
                format!("`{}` is used by two structures or surfaces", pair[0]),
                "Give each structure and surface a name of its own",
            )),
        }
    }
}

impl StructureSettings {
    fn validate(&self, at: &str) -> Result<()> {
        at_most(&format!("{at}.speed"), self.speed, ranges::SPEED)?;
        if let Some(ratio) = self.damping_ratio {
            within(&format!("{at}.damping_ratio"), ratio, 0.0, ranges::DAMPING)?;
        }
        let other = match self.motion {
            Motion::Rotating => None,
            Motion::Still => Some("stands still"),
            Motion::Free => Some("flies freely"),
        };
        if let Some(other) = other.filter(|_| self.speed != 0.0) {
            return Err(Error::invalid(
                format!("{at}.speed"),
                format!("{} rad/s for a structure that {other}", shown(self.speed)),
                "Remove the speed, or set motion = \"rotating\"",
            ));
        }
        if let Some(other) = other.filter(|_| !self.frequency_factors.is_empty()) {
            return Err(Error::invalid(
                format!("{at}.frequency_factors"),
                format!("a structure that {other} has no blades to mistune"),
                "Remove the line, or give it to the rotor",
            ));
        }
        for (index, factor) in self.frequency_factors.iter().enumerate() {
            let [low, high] = ranges::FREQUENCY_FACTORS;
            within(&format!("{at}.frequency_factors[{}]", index + 1), *factor, low, high)?;
        }
        if let Some(load) = &self.load {
            at_most(&format!("{at}.load.amplitude"), load.amplitude, ranges::LINE_LOAD)?;
            at_most(&format!("{at}.load.phase"), load.phase, ranges::ANGLE)?;
        }
        self.validate_motion(at)
    }

    /// What only rotating structures have, only those that stand still, and only free ones.
    fn validate_motion(&self, at: &str) -> Result<()> {
        let (rotating, still, free) = (Motion::Rotating, Motion::Still, Motion::Free);
        let moves = self.velocity.iter().any(|component| *component != 0.0);
        let asked = [
            ("spin.stiffening", self.spin.stiffening, rotating),
            ("spin.growth", self.spin.growth, rotating),
            ("spin.coriolis", self.spin.coriolis, rotating),
            ("whirl", self.whirl, rotating),
            ("axial_shift", self.axial_shift, rotating),
            ("thermal", self.thermal, still),
            ("load", self.load.is_some(), still),
            ("velocity", moves, free),
        ];
        let Some((field, _, owner)) = asked.into_iter().find(|(_, asked, owner)| *asked && *owner != self.motion)
        else {
            let field = format!("{at}.velocity");
            return self.velocity.iter().try_for_each(|component| at_most(&field, *component, ranges::VELOCITY));
        };
        let who = |motion: Motion| match motion {
            Motion::Rotating => ("a rotating structure", "this one rotates", "rotating"),
            Motion::Still => ("a structure that stands still", "this one stands still", "still"),
            Motion::Free => ("a free structure", "this one flies freely", "free"),
        };
        let ((owner, _, word), (_, this, _)) = (who(owner), who(self.motion));
        Err(Error::invalid(
            format!("{at}.{field}"),
            format!("only {owner} has it, and {this}"),
            format!("Remove `{field}`, or set motion = \"{word}\""),
        ))
    }
}

impl SurfaceSettings {
    fn validate(&self, scene: &SceneSettings, at: &str) -> Result<()> {
        within(&format!("{at}.ramp_time"), self.ramp_time, 0.0, ranges::TIME)?;
        self.validate_carrier(scene, at)?;
        if let Some(SplineSettings { around, along, .. }) = self.spline {
            let ([least_around, most_around], [least_along, most_along]) =
                (ranges::SPLINE_AROUND, ranges::SPLINE_ALONG);
            count(&format!("{at}.spline.around"), around, least_around, most_around)?;
            count(&format!("{at}.spline.along"), along, least_along, most_along)?;
        }
        if let Some(patches) = self.patches {
            count(&format!("{at}.patches.around"), patches.around, 1, ranges::PATCHES)?;
            count(&format!("{at}.patches.along"), patches.along, 1, ranges::PATCHES)?;
            product(&format!("{at}.patches"), "patches", patches.around, patches.along, ranges::PATCHES)?;
        }
        self.validate_shape(at)
    }

    /// The structure that carries the surface.
    fn validate_carrier(&self, scene: &SceneSettings, at: &str) -> Result<()> {
        let Some(name) = &self.structure else { return Ok(()) };
        let still = |structure: &&StructureSettings| structure.motion == Motion::Still;
        let candidates: Vec<&str> = scene.structures.iter().filter(still).map(|s| s.name.as_str()).collect();
        let problem = match scene.structures.iter().find(|structure| structure.name == *name) {
            None => format!("`{name}` is not defined"),
            Some(structure) if structure.motion == Motion::Rotating => {
                format!("`{name}` rotates, and a surface stands still")
            }
            Some(structure) if structure.motion == Motion::Free => {
                format!("`{name}` flies freely, and a surface stands still")
            }
            Some(_) => return Ok(()),
        };
        let remedy = if candidates.is_empty() {
            "Add a [[structure]] with motion = \"still\", or remove the line for a rigid surface".to_owned()
        } else {
            format!("Use one of: {}; or remove the line for a rigid surface", candidates.join(", "))
        };
        Err(Error::invalid(format!("{at}.structure"), problem, remedy))
    }

    fn validate_shape(&self, at: &str) -> Result<()> {
        match &self.shape {
            Shape::Circular {} => Ok(()),
            Shape::Lobes { amplitude, order, phase } => {
                at_most(&format!("{at}.shape.amplitude"), *amplitude, ranges::POSITION)?;
                at_most(&format!("{at}.shape.phase"), *phase, ranges::ANGLE)?;
                if *order == 0 {
                    let remedy = "Use order ≥ 1, or gap and radius change for a uniform clearance";
                    return Err(Error::invalid(format!("{at}.shape.order"), "0 lobes", remedy));
                }
                within(&format!("{at}.shape.order"), f64::from(*order), 1.0, ranges::LOBES)
            }
            Shape::TwoLobe { depth, width, phase } => {
                at_most(&format!("{at}.shape.depth"), *depth, ranges::DEPTH)?;
                at_most(&format!("{at}.shape.phase"), *phase, ranges::ANGLE)?;
                within(&format!("{at}.shape.width"), *width, 1e-3, 0.25)
            }
            Shape::Table { radius_change } => {
                crate::gaps::shape::Surface::new(&Shape::Table { radius_change: radius_change.clone() }, 0.0)
                    .map(|_| ())
            }
        }
    }
}

impl ContactSettings {
    fn validate(&self, scene: &SceneSettings, at: &str) -> Result<()> {
        let structures: Vec<&str> = scene.structures.iter().map(|s| s.name.as_str()).collect();
        let surfaces: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
        for (field, name, known) in [("master", &self.master, &structures), ("slave", &self.slave, &surfaces)] {
            if !known.contains(&name.as_str()) {
                return Err(Error::invalid(
                    format!("{at}.{field}"),
                    format!("`{name}` is not defined"),
                    format!("Use one of: {}", known.join(", ")),
                ));
            }
        }
        let slave = scene.surfaces.iter().find(|surface| surface.name == self.slave);
        if slave.and_then(|surface| surface.structure.as_ref()) == Some(&self.master) {
            return Err(Error::invalid(
                format!("{at}.slave"),
                format!("`{}` is the surface of `{}`, which is the master of this contact", self.slave, self.master),
                "Give the surface of another structure, or a rigid one",
            ));
        }
        if self.nodes.as_ref().is_some_and(String::is_empty) {
            let remedy = "Give the beginning of the names, or remove the line for all nodes";
            return Err(Error::invalid(format!("{at}.nodes"), "an empty text", remedy));
        }
        if scene.master_of(self).is_some_and(|master| master.motion == Motion::Free) {
            return self.validate_free(scene, at);
        }
        if slave.is_some_and(|surface| surface.rigid) {
            let remedy = "Remove the line; without `structure` the surface around a rotor is rigid";
            return Err(Error::invalid(format!("{at}.slave"), format!("surface `{}` is `rigid`", self.slave), remedy));
        }
        if self.gap == 0.0 && self.sector_gaps.is_empty() {
            let remedy = "Add the radial tip clearance to [[contact]]: number, m (> 0, up to a tenth of the radius); only a free master has none";
            return Err(Error::invalid(format!("{at}.gap"), "missing or 0", remedy));
        }
        if self.gap != 0.0 || self.sector_gaps.is_empty() {
            gap(&format!("{at}.gap"), self.gap)?;
        }
        self.sector_gaps.iter().try_for_each(|value| gap(&format!("{at}.sector_gaps"), *value))?;
        within(&format!("{at}.friction"), self.friction, 0.0, ranges::FRICTION)?;
        if let Some(share) = self.heat_to_slave {
            let field = format!("{at}.heat_to_slave");
            within(&field, share, 0.0, 1.0)?;
            if self.friction == 0.0 {
                let remedy = "Give the contact a friction coefficient (friction > 0), or remove the line";
                return Err(Error::invalid(field, "without friction there is no heat to share", remedy));
            }
        }
        let Some(coating) = &self.coating else { return Ok(()) };
        if self.solver != Solver::Lcp {
            let name = if self.solver == Solver::Film { "film" } else { "coulomb" };
            return Err(Error::invalid(
                format!("{at}.solver"),
                format!("\"{name}\" cannot solve a contact with a coating"),
                "Use solver = \"lcp\", or remove the coating",
            ));
        }
        coating.validate(&format!("{at}.coating"))
    }
}

impl CoatingSettings {
    fn validate(&self, at: &str) -> Result<()> {
        let ([thinnest, thickest], [softest, stiffest]) = (ranges::THICKNESS, ranges::MODULUS);
        within(&format!("{at}.thickness"), self.thickness, thinnest, thickest)?;
        within(&format!("{at}.modulus"), self.modulus, softest, stiffest)?;
        within(&format!("{at}.yield_stress"), self.yield_stress, 0.0, ranges::STRESS)?;
        within(&format!("{at}.hardening"), self.hardening, 0.0, ranges::STRESS)?;
        count(&format!("{at}.cells_around"), self.cells_around, 2, ranges::CELLS)?;
        count(&format!("{at}.cells_along"), self.cells_along, 1, ranges::CELLS)?;
        product(at, "cells", self.cells_around, self.cells_along, ranges::CELLS)
    }
}

/// A clearance. Smaller than an atom it is as good as none, and right.
fn gap(field: &str, value: f64) -> Result<()> {
    if !(value.is_finite() && value > 0.0) {
        return Err(Error::invalid(field, format!("{} m", shown(value)), "Give a finite value > 0"));
    }
    within(field, value, 0.0, ranges::POSITION)
}

fn count(field: &str, value: usize, least: usize, most: usize) -> Result<()> {
    if (least..=most).contains(&value) {
        Ok(())
    } else {
        Err(Error::invalid(field, format!("{value}"), format!("Give a whole number from {least} to {most}")))
    }
}

fn product(field: &str, what: &str, around: usize, along: usize, most: usize) -> Result<()> {
    if around.checked_mul(along).is_some_and(|total| total <= most) {
        Ok(())
    } else {
        let problem = format!("{around} around x {along} along are more than {most} {what}");
        Err(Error::invalid(field, problem, format!("Give at most {most} {what} in all")))
    }
}
