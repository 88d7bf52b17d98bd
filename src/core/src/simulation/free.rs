//! Scenes with a free master: its pairs, the open surfaces it meets, and the system made of them.

use super::compile::{Compiled, MOST_COUPLED};
use super::slave_surface::Carrier;
use crate::contact::free_gap::{FreeGap, OpenSurface};
use crate::contact::gap::GapLaw;
use crate::contact::spline::SurfaceSpline;
use crate::dynamics::modal::ModalModel;
use crate::dynamics::rigid::Translations;
use crate::dynamics::sectors::SectorModel;
use crate::rom::{ContactGrid, Frame};
use crate::settings::Motion;
use crate::system::{System, SystemParts};
use crate::{Error, Result, Rom, Scene};

/// One contact pair of a free master.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// Surface.
    pub surface: usize,
    /// Structure through whose contact grid it is laid.
    pub structure: usize,
    /// Which of the carriers deforms it; `None` for a rigid surface.
    pub carrier: Option<usize>,
    /// Contact nodes of the master that take part.
    pub nodes: Vec<usize>,
}

/// What only the scene of a free master has.
#[derive(Debug, Clone)]
pub struct FreeParts {
    /// In the order of the scene.
    pub pairs: Vec<Pair>,
    /// Modes of each carrier, seen at the control points of its surface.
    pub carriers: Vec<ModalModel>,
    /// Translations of the master.
    pub translations: Translations,
}

/// The pairs of a validated scene with a free master.
///
/// # Errors
/// ROMs of the wrong kind, pairs without nodes, nodes of two pairs.
pub fn pairs(scene: &Scene) -> Result<Vec<Pair>> {
    let settings = &scene.settings;
    for (structure, rom) in settings.structures.iter().zip(&scene.roms) {
        check_rom(rom, structure.motion)?;
    }
    let (mut pairs, mut carriers): (Vec<Pair>, usize) = (Vec::new(), 0);
    for (index, contact) in settings.contacts.iter().enumerate() {
        let at = format!("contact[{}].nodes", index + 1);
        let master = settings.structures.iter().position(|structure| structure.name == contact.master);
        let surface = settings.surfaces.iter().position(|surface| surface.name == contact.slave);
        let (Some(master), Some(surface)) = (master, surface) else { unreachable!("validated") };
        let carrier = settings.surfaces[surface].structure.as_ref();
        let structure = settings.structures.iter().position(|structure| Some(&structure.name) == carrier);
        let Some(structure) = structure else { unreachable!("validated") };
        let start = contact.nodes.as_deref().unwrap_or_default();
        let names = scene.roms[master].contact_nodes.iter().enumerate();
        let nodes: Vec<usize> = names.filter(|(_, node)| node.name.starts_with(start)).map(|(node, _)| node).collect();
        if nodes.is_empty() {
            let first = &scene.roms[master].contact_nodes[0].name;
            let problem = format!("no contact node of ROM `{}` has a name that starts with {start:?}", contact.master);
            return Err(Error::invalid(at, problem, format!("Use the beginning of names such as `{first}`")));
        }
        if let Some((other, node)) = claimed(&pairs, &nodes) {
            let name = &scene.roms[master].contact_nodes[node].name;
            let problem = format!("claims the node `{name}`, which contact[{}] claims as well", other + 1);
            return Err(Error::invalid(at, problem, "Give each contact node to one pair"));
        }
        let carrier = (!settings.surfaces[surface].rigid).then_some(carriers);
        carriers += usize::from(carrier.is_some());
        pairs.push(Pair { surface, structure, carrier, nodes });
    }
    Ok(pairs)
}

/// A node that a pair before has already: (pair, node).
fn claimed(pairs: &[Pair], nodes: &[usize]) -> Option<(usize, usize)> {
    let both = |pair: &Pair| nodes.iter().copied().find(|node| pair.nodes.contains(node));
    pairs.iter().enumerate().find_map(|(index, pair)| both(pair).map(|node| (index, node)))
}

fn check_rom(rom: &Rom, motion: Motion) -> Result<()> {
    let refuse = |problem: &str, remedy: &str| Err(Error::invalid(format!("ROM `{}`", rom.name), problem, remedy));
    if rom.frame != Frame::Cartesian {
        let problem =
            "its contact displacements are cylindrical; a free master and what it meets are described along x, y, z";
        return refuse(problem, "Write the ROM with frame = cartesian");
    }
    if rom.sectors != 1 || rom.is_cyclic() {
        return refuse(
            "it has several sectors; a free master and what it meets are single structures",
            "Use sectors = 1",
        );
    }
    match (motion, rom.extras.grid) {
        (Motion::Free, _) | (_, Some(ContactGrid { closed: false, .. })) => Ok(()),
        _ => refuse(
            "it has no open contact grid for a surface",
            "Add the metadata `contact_grid` for an open grid, its contact nodes row after row",
        ),
    }
}

impl Pair {
    /// The undeformed surface.
    fn surface(&self, scene: &Scene) -> Result<SurfaceSpline> {
        let rom = &scene.roms[self.structure];
        let Some(grid) = rom.extras.grid else { unreachable!("checked") };
        let data: Vec<[f64; 3]> = rom.contact_nodes.iter().map(|node| node.position).collect();
        let spline = scene.settings.surfaces[self.surface].spline.unwrap_or_default();
        SurfaceSpline::open(&data, grid.around, grid.along, spline.interpolation)
    }
}

impl FreeParts {
    /// Solve the eigenproblems of the carriers.
    ///
    /// # Errors
    /// As [`pairs`]; invalid ROMs and grids.
    pub fn new(scene: &Scene, translations: Translations) -> Result<Self> {
        let pairs = pairs(scene)?;
        let mut carriers = Vec::new();
        for pair in pairs.iter().filter(|pair| pair.carrier.is_some()) {
            let (structure, rom) = (&scene.settings.structures[pair.structure], &scene.roms[pair.structure]);
            let model = ModalModel::from_rom(rom, structure.damping_ratio.unwrap_or(rom.damping_ratio))?;
            carriers.push(Carrier { rom, model: &model }.control_modes(&pair.surface(scene)?));
        }
        Ok(Self { pairs, carriers, translations })
    }

    /// The gap function.
    ///
    /// # Errors
    /// Grids that no surface can be laid through.
    pub fn law(&self, scene: &Scene, master: usize) -> Result<FreeGap> {
        let rom = &scene.roms[master];
        let mut surface_of = vec![None; rom.contact_nodes.len()];
        for (index, pair) in self.pairs.iter().enumerate() {
            pair.nodes.iter().for_each(|node| surface_of[*node] = Some(index));
        }
        let surface = |pair: &Pair| Ok(OpenSurface::new(pair.surface(scene)?, pair.carrier));
        let surfaces: Vec<OpenSurface> = self.pairs.iter().map(surface).collect::<Result<_>>()?;
        let positions = rom.contact_nodes.iter().map(|node| node.position).collect();
        Ok(FreeGap::new(positions, surface_of, surfaces))
    }
}

impl Compiled {
    /// Fresh kernels of a free master at rest.
    pub(super) fn free_system(&self, free: &FreeParts) -> Result<System> {
        let taking_part: usize = free.pairs.iter().map(|pair| pair.nodes.len()).sum();
        if taking_part > MOST_COUPLED {
            return Err(Error::invalid(
                "contact.nodes",
                format!("{taking_part} contact nodes of all pairs, more than {MOST_COUPLED}"),
                "Choose fewer, or a coarser mesh",
            ));
        }
        let parts = SystemParts {
            slaves: free.carriers.iter().map(|model| (model.clone(), false)).collect(),
            sticking: self.may_stick(),
            ..SystemParts::default()
        };
        let law = GapLaw::Free(Box::new(free.law(&self.scene, self.roles.master)?));
        Ok(System::with_parts(SectorModel::Uncoupled(&self.model, 1), law, self.system_settings(), parts))
    }
}
