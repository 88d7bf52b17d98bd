//! Properties of a scene that the variables depend on: masters, contact pairs, surface carriers.

use crate::scene::ranges;
use crate::scene::settings::{ContactSettings, Scene, SceneSettings, StructureSettings, SurfaceSettings};
use crate::simulation::patches::HeatPatches;
use crate::simulation::plan::{PairPlan, SteppingOrder, prefix};
use crate::{Error, Result, Rom};

pub const AXES: [&str; 3] = ["x", "y", "z"];

/// Properties of a scene that the variables depend on.
pub(crate) struct TableFacts<'a> {
    pub settings: &'a SceneSettings,
    pub plan: &'a SteppingOrder,
    pub bodies: Vec<BodyFacts<'a>>,
    pub pairs: Vec<PairFacts<'a>>,
    pub carriers: Vec<CarrierFacts<'a>>,
}

/// A master.
#[derive(Clone, Copy)]
pub(crate) struct BodyFacts<'a> {
    pub index: usize,
    pub structure: &'a StructureSettings,
    pub rom: &'a Rom,
    pub free: bool,
}

/// A contact pair.
pub(crate) struct PairFacts<'a> {
    pub index: usize,
    pub contact: &'a ContactSettings,
    pub surface: &'a SurfaceSettings,
    pub body: BodyFacts<'a>,
    /// Structure that deforms the surface.
    pub carrier: Option<usize>,
    /// Number of patches that collect friction power.
    pub patches: usize,
}

/// A surface carrier.
pub(crate) struct CarrierFacts<'a> {
    pub index: usize,
    pub structure: &'a StructureSettings,
    pub rom: &'a Rom,
    /// True if the surfaces are open.
    pub open: bool,
}

impl<'a> TableFacts<'a> {
    pub fn new(scene: &'a Scene, plan: &'a SteppingOrder) -> Self {
        let settings = &scene.settings;
        let body = |index: usize| {
            let (structure, rom) = plan.structure(scene, index);
            BodyFacts { index, structure, rom, free: plan.is_free(scene, index) }
        };
        let bodies: Vec<BodyFacts> = (0..plan.bodies.len()).map(body).collect();
        let pair = |(index, pair): (usize, &PairPlan)| PairFacts {
            index,
            contact: &settings.contacts[index],
            surface: &settings.surfaces[pair.surface],
            body: bodies[pair.body],
            carrier: pair.carrier,
            patches: HeatPatches::new(scene, plan, pair).as_ref().map_or(0, HeatPatches::len),
        };
        let pairs = plan.pairs.iter().enumerate().map(pair).collect();
        let carrier = |(index, structure): (usize, &usize)| CarrierFacts {
            index,
            structure: &settings.structures[*structure],
            rom: &scene.roms[*structure],
            open: plan.pairs_on(index).any(|(_, pair)| plan.is_free(scene, pair.body)),
        };
        let carriers = plan.carriers.iter().enumerate().map(carrier).collect();
        Self { settings, plan, bodies, pairs, carriers }
    }

    /// Returns whether there are friction variables; a scene without a friction coefficient has none.
    pub(crate) fn has_friction(&self) -> bool {
        self.settings.contacts.iter().any(|contact| contact.friction > 0.0)
    }

    /// Returns whether blades cut a coating.
    pub(crate) fn is_cut(&self) -> bool {
        let mut coatings = self.settings.contacts.iter().filter_map(|contact| contact.coating);
        coatings.any(|coating| coating.cutting.is_some())
    }

    /// Returns whether there are tangential forces.
    pub(crate) fn has_tangential_forces(&self) -> bool {
        self.has_friction() || self.is_cut()
    }

    pub(crate) fn of_body(&self, body: &BodyFacts) -> String {
        prefix(self.plan.bodies.len(), &body.structure.name)
    }

    pub(crate) fn of_pair(&self, pair: &PairFacts) -> String {
        prefix(self.plan.pairs.len(), &pair.surface.name)
    }

    pub(crate) fn of_carrier(&self, carrier: &CarrierFacts) -> String {
        prefix(self.plan.carriers.len(), &carrier.structure.name)
    }

    /// Returns the name of a structure for texts: the rotor, or its name.
    pub fn rotor(&self, body: &BodyFacts) -> String {
        if body.free || self.plan.bodies.len() > 1 { body.structure.name.clone() } else { "the rotor".to_owned() }
    }
}

/// Largest length that is small compared with the radius of the contact nodes (m).
pub(crate) fn largest_length(rom: &Rom) -> f64 {
    let radii = rom.contact_nodes.iter().map(|node| node.position[0]);
    ranges::SMALL * radii.fold(f64::INFINITY, f64::min)
}

/// Rejects indices that no structure has.
pub fn refuse<T>(field: &str, problem: String, remedy: String) -> Result<T> {
    Err(Error::invalid(format!("outputs.{field}"), problem, remedy))
}
