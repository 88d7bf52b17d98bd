//! Scenes with a free master, and how many contact pairs a scene may have.

use crate::ranges::{self, at_most, within};
use crate::settings::{
    Closure, ContactSettings, InputInterpolation, Meridian, Motion, SceneSettings, Scheme, Shape, StructureSettings,
    SurfaceSettings,
};
use crate::{Error, Result};

impl SceneSettings {
    /// The free structure whose contact nodes are the masters; `None` in the scene of a rotor.
    pub fn free_master(&self) -> Option<&StructureSettings> {
        let masters = self.contacts.iter().map(|contact| &contact.master);
        let mut free = self.structures.iter().filter(|structure| structure.motion == Motion::Free);
        free.find(|structure| masters.clone().any(|master| *master == structure.name))
    }

    /// One master; every structure and every surface takes part, each in one place.
    pub(super) fn validate_pairs(&self) -> Result<()> {
        let Some(master) = self.free_master() else { return self.validate_not_free() };
        for (index, contact) in self.contacts.iter().enumerate() {
            let at = format!("contact[{}]", index + 1);
            if contact.master != master.name {
                let problem = format!("`{}` beside the free master `{}`", contact.master, master.name);
                return Err(Error::invalid(format!("{at}.master"), problem, "Give all pairs the same free master"));
            }
            let first = &self.contacts[0];
            if contact.friction.to_bits() != first.friction.to_bits() || contact.solver != first.solver {
                let problem =
                    "friction or solver differs from contact[1], whose problem is solved together with this one";
                return Err(Error::invalid(at, problem, "Give all pairs the same friction and solver"));
            }
            if index > 0 && (contact.nodes.is_none() || first.nodes.is_none()) {
                let problem = "of several pairs one claims all contact nodes of the master";
                let remedy = "Give every pair `nodes`: what the names of its contact nodes start with";
                return Err(Error::invalid(format!("{at}.nodes"), problem, remedy));
            }
        }
        for structure in self.structures.iter().filter(|structure| structure.name != master.name) {
            let carried = |surface: &&SurfaceSettings| surface.structure.as_ref() == Some(&structure.name);
            let count = self.surfaces.iter().filter(carried).count();
            once("structure", &structure.name, count, "carries one surface", "one [[surface]]")?;
        }
        for surface in &self.surfaces {
            let count = self.contacts.iter().filter(|contact| contact.slave == surface.name).count();
            once("surface", &surface.name, count, "belongs to one pair", "one [[contact]]")?;
        }
        self.validate_free_outputs()
    }

    fn validate_not_free(&self) -> Result<()> {
        if let Some(free) = self.structures.iter().find(|structure| structure.motion == Motion::Free) {
            let problem = format!("`{}` flies freely and is the master of no contact", free.name);
            return Err(Error::invalid(
                "structure.motion",
                problem,
                "Make it the master of a [[contact]], or remove it",
            ));
        }
        Ok(())
    }

    fn validate_free_outputs(&self) -> Result<()> {
        let outputs = &self.outputs;
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
        if self.time.scheme == Scheme::MasslessBoundary {
            let problem = "\"massless-boundary\" is not made for a master that flies freely";
            return Err(Error::invalid("time.scheme", problem, "Use \"modal-exact\" or \"central-difference\""));
        }
        if self.time.input_interpolation != InputInterpolation::default() {
            let problem = "a scene with a free master has no inputs";
            return Err(Error::invalid("time.input_interpolation", problem, "Remove the line"));
        }
        Ok(())
    }
}

fn once(kind: &str, name: &str, count: usize, rule: &str, what: &str) -> Result<()> {
    if count == 1 {
        return Ok(());
    }
    let remedy = format!("Name it in {what}, or remove it");
    Err(Error::invalid(
        format!("{kind} `{name}`"),
        format!("named {count} times; beside a free master it {rule}"),
        remedy,
    ))
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
        if self.nodes.as_ref().is_some_and(String::is_empty) {
            let remedy = "Give the beginning of the names, or remove the line for all nodes";
            return Err(Error::invalid(format!("{at}.nodes"), "an empty text", remedy));
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
