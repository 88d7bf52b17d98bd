//! From settings to kernels: what is decided once, before anything moves.

use crate::contact::gap::{GapLaw, RevolutionGap};
use crate::contact::surface::Surface;
use crate::dynamics::modal::ModalModel;
use crate::rom::Frame;
use crate::settings::{Meridian, Scheme, Solver};
use crate::stability::{self, ContactDirections};
use crate::system::{System, SystemSettings};
use crate::variables::Quantity;
use crate::{Error, Result, Scene};

use super::Simulation;

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
    scene: Scene,
    model: ModalModel,
    /// Hash of settings and ROMs; saved states carry it.
    pub fingerprint: u64,
    pub references: References,
}

/// Parameters that decide stability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    pub friction: f64,
    pub damping_ratio: f64,
    pub step: f64,
    pub scheme: Scheme,
    pub solver: Solver,
}

/// Result of the last check of limits.
#[derive(Debug, Clone)]
pub struct Checked {
    parameters: Parameters,
    outcome: Result<Vec<String>>,
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
        if surface.largest_change() > 0.5 * smallest {
            return Err(Error::invalid(
                "surface.shape",
                format!(
                    "it changes the casing radius by up to {:.3e} m where contact nodes have {smallest:.3e} m",
                    surface.largest_change()
                ),
                "Give a shape that is small against the radius, in metres",
            ));
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

    /// Normals and slip directions of the contact nodes `nodes` on a round casing, slipping with `sense` (±1).
    fn directions(&self, sense: f64) -> ContactDirections {
        let meridian = self.scene.settings.contacts[0].meridian;
        let nodes = self.scene.roms[0].contact_nodes.iter();
        nodes
            .map(|node| {
                let slope = if meridian == Meridian::Contour { node.meridional_slope } else { 0.0 };
                let length = (1.0 + slope * slope).sqrt();
                ([-1.0 / length, 0.0, slope / length], [0.0, sense, 0.0])
            })
            .collect()
    }

    /// All limits of this scene with these parameters; returns warnings.
    ///
    /// # Errors
    /// Refusals with numbers and remedy.
    pub fn check(&self, parameters: &Parameters) -> Result<Vec<String>> {
        let Parameters { friction, damping_ratio, step, scheme, .. } = *parameters;
        let mut model = self.model.clone();
        model.damping_ratios.fill(damping_ratio);
        let mut warnings: Vec<String> = stability::check_step(&model, scheme, step)?.into_iter().collect();
        let senses = [1.0, -1.0].map(|sense| self.directions(sense));
        stability::check_solvable(&model, scheme, step, friction, &senses)?;
        for directions in senses {
            // Flutter is looked for with everything closed and with each node alone.
            let alone = |node: usize| model.with_nodes(&[node]);
            warnings.extend(stability::check_growth(&model, scheme, step, friction, &directions)?);
            if directions.len() > 1 {
                for (node, direction) in directions.iter().enumerate() {
                    let warning = stability::check_growth(&alone(node), scheme, step, friction, &vec![*direction])?;
                    warnings.extend(warning.map(|text| format!("contact node {}: {text}", node + 1)));
                }
            }
        }
        Ok(warnings)
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
    pub(super) fn parameters(&self) -> Parameters {
        let scheme =
            if self.value_of(Quantity::SchemeChoice) < 1.5 { Scheme::CentralDifference } else { Scheme::ModalExact };
        let solver = if self.value_of(Quantity::SolverChoice) < 1.5 { Solver::Film } else { Solver::Lcp };
        Parameters {
            friction: self.value_of(Quantity::Friction),
            damping_ratio: self.value_of(Quantity::DampingRatio),
            step: self.value_of(Quantity::StepMax),
            scheme,
            solver,
        }
    }

    /// Check limits unless the same parameters were checked last.
    pub(super) fn check_limits(&mut self, parameters: Parameters) -> Result<()> {
        let known = self.checked.as_ref().filter(|checked| checked.parameters == parameters);
        let outcome = known.map_or_else(|| self.compiled.check(&parameters), |checked| checked.outcome.clone());
        self.checked = Some(Checked { parameters, outcome: outcome.clone() });
        self.warnings = outcome?;
        Ok(())
    }

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
