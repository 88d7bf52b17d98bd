//! Structures, surfaces and contact pairs of a scene, resolved once from names.

use crate::scene::settings::relations::Relations;
use crate::scene::settings::{BodyMotion, ContactSettings, SceneSettings, StructureSettings, SurfaceSettings};
use crate::{Error, Result, Rom, Scene};

/// A contact pair of a scene.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PairPlan {
    /// Surface.
    pub surface: usize,
    /// Master: index in [`SteppingOrder::bodies`].
    pub body: usize,
    /// Structure whose contact grid defines an open surface.
    pub grid: Option<usize>,
    /// Structure that deforms the surface: index in [`SteppingOrder::carriers`].
    pub carrier: Option<usize>,
    /// Contact nodes of the pair.
    pub nodes: Vec<usize>,
}

/// Structures in the order in which they are stepped, and the pairs between them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SteppingOrder {
    /// Masters, in the order of the scene.
    pub bodies: Vec<usize>,
    /// Surface carriers that deform, in the order of the pairs.
    pub carriers: Vec<usize>,
    /// Contact pairs, in the order of the scene.
    pub pairs: Vec<PairPlan>,
    /// Pairs of each master.
    of_bodies: Vec<Vec<usize>>,
    /// Pairs whose surface each carrier deforms.
    of_carriers: Vec<Vec<usize>>,
}

/// Name prefix; empty if there is only one structure.
pub fn prefix(count: usize, name: &str) -> String {
    if count > 1 { format!("{name}.") } else { String::new() }
}

impl SteppingOrder {
    /// Orders the structures of a validated scene.
    ///
    /// # Errors
    /// ROMs without data that the scene requires; pairs without nodes; nodes in two pairs.
    pub fn new(scene: &Scene) -> Result<Self> {
        let settings = &scene.settings;
        if scene.roms.len() != settings.structures.len() {
            let problem = format!("{} structures but {} ROMs", settings.structures.len(), scene.roms.len());
            return Err(Error::invalid("scene", problem, "Give one ROM per structure"));
        }
        scene.check_roms()?;
        check_factors(scene)?;
        let relations = Relations::of(settings);
        let bodies: Vec<usize> = (0..settings.structures.len()).filter(|one| relations.touches(*one)).collect();
        let of_bodies = vec![Vec::new(); bodies.len()];
        let (pairs, of_carriers) = (Vec::<PairPlan>::new(), Vec::new());
        let mut plan = Self { bodies, carriers: Vec::new(), pairs, of_bodies, of_carriers };
        let mut carriers = vec![None; settings.structures.len()];
        for (index, contact) in settings.contacts.iter().enumerate() {
            let (Some(master), Some(surface)) = (relations.masters[index], relations.surfaces[index]) else {
                unreachable!("validated")
            };
            let carrying = relations.carriers[index];
            let open = settings.structures[master].motion == BodyMotion::Free;
            let body = plan.bodies.binary_search(&master).unwrap_or(0);
            let carrier = carrying.filter(|_| !settings.surfaces[surface].rigid).map(|structure| {
                *carriers[structure].get_or_insert_with(|| {
                    plan.carriers.push(structure);
                    plan.of_carriers.push(Vec::new());
                    plan.carriers.len() - 1
                })
            });
            let nodes = nodes_of(contact, &scene.roms[master], index)?;
            if let Some((other, node)) = claimed(plan.pairs_of(body), &nodes) {
                let name = &scene.roms[master].contact_nodes[node].name;
                let problem = format!("the node `{name}` already belongs to contact[{}]", other + 1);
                let at = format!("contact[{}].nodes", index + 1);
                return Err(Error::invalid(at, problem, "Assign each contact node to one pair only"));
            }
            plan.of_bodies[body].push(index);
            carrier.into_iter().for_each(|carrier| plan.of_carriers[carrier].push(index));
            plan.pairs.push(PairPlan { surface, body, grid: carrying.filter(|_| open), carrier, nodes });
        }
        Ok(plan)
    }

    /// Returns the pairs of a master.
    pub(crate) fn pairs_of(&self, body: usize) -> impl Iterator<Item = (usize, &PairPlan)> {
        self.of_bodies[body].iter().map(|pair| (*pair, &self.pairs[*pair]))
    }

    /// Returns the pairs whose surface a carrier deforms.
    pub(crate) fn pairs_on(&self, carrier: usize) -> impl Iterator<Item = (usize, &PairPlan)> {
        self.of_carriers[carrier].iter().map(|pair| (*pair, &self.pairs[*pair]))
    }

    /// Returns settings and ROM of a master.
    pub fn structure<'a>(&self, scene: &'a Scene, body: usize) -> (&'a StructureSettings, &'a Rom) {
        (&scene.settings.structures[self.bodies[body]], &scene.roms[self.bodies[body]])
    }

    /// Returns the prefix of names that belong to the structure of a body.
    pub(crate) fn body_prefix(&self, scene: &Scene, body: usize) -> String {
        prefix(self.bodies.len(), &self.structure(scene, body).0.name)
    }

    /// Returns the prefix of names that belong to a pair: the name of its surface.
    pub(crate) fn pair_prefix(&self, settings: &SceneSettings, pair: usize) -> String {
        prefix(self.pairs.len(), &self.surface(settings, pair).name)
    }

    /// Returns the surface of a pair.
    pub fn surface<'a>(&self, settings: &'a SceneSettings, pair: usize) -> &'a SurfaceSettings {
        &settings.surfaces[self.pairs[pair].surface]
    }

    /// Returns whether the surfaces of a master are open, described along x, y, z.
    pub fn is_free(&self, scene: &Scene, body: usize) -> bool {
        self.structure(scene, body).0.motion == BodyMotion::Free
    }
}

/// Returns the contact nodes of a pair.
fn nodes_of(contact: &ContactSettings, rom: &Rom, index: usize) -> Result<Vec<usize>> {
    let start = contact.nodes.as_deref().unwrap_or_default();
    let names = rom.contact_nodes.iter().enumerate();
    let nodes: Vec<usize> = names.filter(|(_, node)| node.name.starts_with(start)).map(|(node, _)| node).collect();
    if !nodes.is_empty() {
        return Ok(nodes);
    }
    let problem = format!("no contact node of ROM `{}` has a name that starts with {start:?}", rom.name);
    let remedy = rom.contact_nodes.first().map_or_else(
        || "Use a ROM with contact nodes".to_owned(),
        |first| format!("Use the beginning of a node name such as `{}`", first.name),
    );
    Err(Error::invalid(format!("contact[{}].nodes", index + 1), problem, remedy))
}

/// Returns a node that an earlier pair already uses: (pair, node).
fn claimed<'a>(mut pairs: impl Iterator<Item = (usize, &'a PairPlan)>, nodes: &[usize]) -> Option<(usize, usize)> {
    let both = |pair: &PairPlan| nodes.iter().copied().find(|node| pair.nodes.contains(node));
    pairs.find_map(|(index, pair)| both(pair).map(|node| (index, node)))
}

fn check_factors(scene: &Scene) -> Result<()> {
    for (index, (structure, rom)) in scene.settings.structures.iter().zip(&scene.roms).enumerate() {
        let factors = structure.frequency_factors.len();
        if factors != 0 && factors != rom.sectors {
            return Err(Error::invalid(
                format!("structure[{}].frequency_factors", index + 1),
                format!("{factors} values for {} sectors", rom.sectors),
                "Give one factor per sector, or remove the line",
            ));
        }
    }
    Ok(())
}
