//! From settings to kernels: what is decided once, before anything moves.

use crate::contact::gap::{GapLaw, RevolutionGap};
use crate::contact::surface::Surface;
use crate::dynamics::modal::ModalModel;
use crate::rom::Frame;
use crate::system::{System, SystemSettings};
use crate::variables::Quantity;
use crate::{Error, Result, Scene};

use super::Simulation;

/// Gaps, casing shapes and displacements beyond this share of the radius are not what the model describes.
pub const SMALL_FRACTION: f64 = 0.1;

/// Places of values that the step reads.
#[derive(Debug, Clone, Copy)]
pub struct References {
    pub step_max: usize,
    pub gap_offset: usize,
    pub ramp_time: Option<usize>,
}

/// The parts of a scene that do not change while it runs.
#[derive(Debug, Clone)]
pub struct Compiled {
    pub scene: Scene,
    pub model: ModalModel,
    /// Hash of settings and ROMs; saved states carry it.
    pub fingerprint: u64,
    pub references: References,
}

impl Compiled {
    /// Validate the scene and solve the reduced eigenproblem.
    ///
    /// # Errors
    /// Invalid settings or ROM; scenes with more than one structure, surface or contact.
    pub fn new(scene: &Scene) -> Result<Self> {
        scene.settings.validate()?;
        let settings = &scene.settings;
        let counts = [settings.structures.len(), settings.surfaces.len(), settings.contacts.len()];
        if counts != [1, 1, 1] || scene.roms.len() != 1 {
            return Err(Error::invalid(
                "scene",
                format!("{} structures, {} surfaces, {} contacts", counts[0], counts[1], counts[2]),
                "This version takes one structure against one rigid surface of revolution: remove the others",
            ));
        }
        let rom = &scene.roms[0];
        if rom.frame != Frame::Cylindrical {
            return Err(Error::invalid(
                format!("ROM `{}`", rom.name),
                "its contact displacements are Cartesian; a surface of revolution needs (radial, tangential, axial)",
                "Write the ROM with frame = cylindrical",
            ));
        }
        let ratio = settings.structures[0].damping_ratio.unwrap_or(rom.damping_ratio);
        let model = ModalModel::from_rom(rom, ratio)?;
        let table = super::table::build(scene)?;
        let place = |quantity| table.with_quantity(quantity).map(|variable| variable.reference as usize);
        let references = References {
            step_max: place(Quantity::StepMax).unwrap_or(0),
            gap_offset: place(Quantity::GapOffset).unwrap_or(0),
            ramp_time: place(Quantity::RampTime),
        };
        Ok(Self { fingerprint: fingerprint(scene), scene: scene.clone(), model, references })
    }

    /// Fresh kernels at rest.
    ///
    /// # Errors
    /// Wrong number of sector gaps, bad shape table.
    pub fn system(&self) -> Result<System> {
        let (settings, rom) = (&self.scene.settings, &self.scene.roms[0]);
        let contact = &settings.contacts[0];
        let clearances =
            if contact.sector_gaps.is_empty() { vec![contact.gap; rom.sectors] } else { contact.sector_gaps.clone() };
        let surface = Surface::new(&settings.surfaces[0].shape, contact.gap)?;
        let smallest = rom.contact_nodes.iter().fold(f64::INFINITY, |low, node| low.min(node.position[0]));
        let largest_gap = clearances.iter().fold(0.0, |largest: f64, gap| largest.max(*gap));
        for (what, value) in [("surface.shape", surface.largest_change()), ("contact.gap", largest_gap)] {
            if value > SMALL_FRACTION * smallest {
                return Err(Error::invalid(
                    what,
                    format!("{value:.3e} m is not small against the radius {smallest:.3e} m of the contact nodes"),
                    "Give lengths in metres, well below a tenth of the radius",
                ));
            }
        }
        let lanes = crate::dynamics::bank::lanes(rom.sectors);
        let law = RevolutionGap::new(rom, surface, &clearances, contact.meridian, lanes)?;
        let system_settings = SystemSettings {
            scheme: settings.time.scheme,
            solver: contact.solver,
            friction: contact.friction,
            ledger: settings.outputs.energies,
        };
        Ok(System::new(&self.model, rom.sectors, GapLaw::Revolution(law), system_settings))
    }
}

fn fingerprint(scene: &Scene) -> u64 {
    let mut hash = crate::persist::fingerprint(format!("{:?}", scene.settings).as_bytes(), 0);
    for rom in &scene.roms {
        for matrix in [&rom.mass, &rom.stiffness, &rom.contact_map] {
            for value in matrix.iter() {
                hash = crate::persist::fingerprint(&value.to_bits().to_le_bytes(), hash);
            }
        }
        hash = crate::persist::fingerprint(format!("{:?}", rom.contact_nodes).as_bytes(), hash);
    }
    hash
}

impl Simulation {
    /// A start in penetration would be an impact of arbitrary strength.
    pub(super) fn check_initial_gaps(&self) -> Result<()> {
        let lanes = self.system.bank().lanes();
        let deepest = self
            .system
            .gaps()
            .iter()
            .enumerate()
            .fold((0, 0.0), |worst, (index, gap)| if *gap < worst.1 { (index, *gap) } else { worst });
        if deepest.1 >= 0.0 {
            return Ok(());
        }
        let touching = self.system.gaps().iter().filter(|gap| **gap < 0.0).count();
        let node = &self.compiled.scene.roms[0].contact_nodes[deepest.0 / lanes].name;
        Err(Error::invalid(
            "initial clearance",
            format!(
                "{touching} contact nodes start inside the casing, deepest {:.3e} m at {node} of sector {}",
                deepest.1,
                deepest.0 % lanes + 1
            ),
            "Enlarge the gap, let the casing shape grow in with ramp_time (casing_ramp_time), or start at another rotor angle",
        ))
    }
}
