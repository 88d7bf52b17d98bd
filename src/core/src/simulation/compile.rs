//! From settings to kernels: what is decided once, before anything moves.

use crate::contact::coating::Coating;
use crate::contact::gap::{GapLaw, RevolutionGap};
use crate::contact::layout::Layout;
use crate::contact::spline_gap::SplineGap;
use crate::contact::surface::Surface;
use crate::dynamics::bank::BankOptions;
use crate::dynamics::cyclic::CyclicModel;
use crate::dynamics::modal::{ModalModel, ModalSpin};
use crate::dynamics::rigid::free_modes;
use crate::dynamics::sectors::SectorModel;
use crate::settings::{ContactSettings, Motion, Solver, StructureSettings, SurfaceSettings};
use crate::system::{System, SystemParts, SystemSettings};
use crate::variables::Quantity;
use crate::{Error, Result, Rom, Scene, shown};
use nalgebra::DMatrix;

use super::checks::{check_coupling, check_rom};
use super::free::FreeParts;
use super::loads::LoadVectors;
use super::patches::Patches;
use super::slave_surface::{Carrier, spline_law};

/// Gaps, casing shapes and displacements beyond this share of the radius are not what the model describes.
pub const SMALL_FRACTION: f64 = 0.1;
/// Most contact nodes of all sectors together that a flexible slave or the disk couples: their Delassus matrix is dense.
pub const MOST_COUPLED: usize = 2000;

/// Places of values that the step reads.
#[derive(Debug, Clone, Copy)]
pub struct References {
    pub step_max: usize,
    pub ramp_time: Option<usize>,
    pub input_interpolation: Option<usize>,
}

/// Which parts of a scene meet; of a free master (see [`super::free`]) the first pair, without its carrier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Roles {
    /// Structure whose contact nodes are the masters.
    pub master: usize,
    /// Surface they meet.
    pub surface: usize,
    /// Structure that carries the surface.
    pub carrier: Option<usize>,
}

impl Roles {
    /// Find them in a validated scene.
    ///
    /// # Errors
    /// More than one contact of a rotor, or a structure or surface that takes no part.
    pub fn new(scene: &Scene) -> Result<Self> {
        let settings = &scene.settings;
        let contact = &settings.contacts[0];
        if settings.free_master().is_some() {
            return Self::of_free_master(scene);
        }
        let structure = |name: &str| settings.structures.iter().position(|structure| structure.name == name);
        let surface = settings.surfaces.iter().position(|surface| surface.name == contact.slave).unwrap_or(0);
        let carrier =
            settings.surfaces.get(surface).and_then(|surface| surface.structure.as_deref()).and_then(structure);
        let roles = Self { master: structure(&contact.master).unwrap_or(0), surface, carrier };
        let counts = [settings.structures.len(), settings.surfaces.len(), settings.contacts.len()];
        let expected = [1 + usize::from(carrier.is_some()), 1, 1];
        if counts != expected || scene.roms.len() != counts[0] || carrier == Some(roles.master) {
            return Err(Error::invalid(
                "scene",
                format!("{} structures, {} surfaces, {} contacts", counts[0], counts[1], counts[2]),
                "A rotor takes one surface, which one other structure may carry (surface.structure): remove what takes no \
                 part. Several pairs need a master with motion = \"free\"",
            ));
        }
        Ok(roles)
    }

    fn of_free_master(scene: &Scene) -> Result<Self> {
        let structures = &scene.settings.structures;
        if scene.roms.len() != structures.len() {
            let problem = format!("{} structures with {} ROMs", structures.len(), scene.roms.len());
            return Err(Error::invalid("scene", problem, "Give one ROM per structure"));
        }
        let master = structures.iter().position(|structure| structure.motion == Motion::Free).unwrap_or(0);
        let slave = &scene.settings.contacts[0].slave;
        let surface = scene.settings.surfaces.iter().position(|surface| surface.name == *slave).unwrap_or(0);
        Ok(Self { master, surface, carrier: None })
    }
}

/// The parts of a scene that do not change while it runs.
#[derive(Debug, Clone)]
pub struct Compiled {
    pub scene: Scene,
    pub roles: Roles,
    /// Modes of the master, at the reference speed where spin stiffens it; of coupled sectors those of nodal diameter 0.
    pub model: ModalModel,
    /// Modes of the master where its sectors are coupled.
    pub disk: Option<CyclicModel>,
    /// Speed whose stiffness `model` has (rad/s).
    pub reference_speed: f64,
    /// Lowest and highest eigenvalue of the modal stiffness per Ω² and per Ω⁴, where spin stiffens the master.
    pub stiffness_range: Option<[[f64; 2]; 2]>,
    /// Modes of the structure that carries the surface, seen at its contact grid.
    pub carrier: Option<ModalModel>,
    /// Nodal diameters of the load on it.
    pub load_order: u32,
    pub loads: LoadVectors,
    pub patches: Option<Patches>,
    /// Pairs and carriers of a free master.
    pub free: Option<FreeParts>,
    /// Hash of settings and ROMs; saved states carry it.
    pub fingerprint: u64,
    pub references: References,
}

impl Compiled {
    /// Validate the scene and solve the reduced eigenproblems.
    ///
    /// # Errors
    /// Invalid settings or ROM; ROMs without what the scene asks of them.
    pub fn new(scene: &Scene) -> Result<Self> {
        scene.settings.validate()?;
        let roles = Roles::new(scene)?;
        let is_free = scene.settings.free_master().is_some();
        if is_free {
            super::free::pairs(scene)?;
        } else {
            for (structure, rom) in scene.settings.structures.iter().zip(&scene.roms) {
                check_rom(structure, rom)?;
            }
            check_coupling(scene, roles)?;
        }
        let (model, free) = if is_free {
            let (structure, rom) = (&scene.settings.structures[roles.master], &scene.roms[roles.master]);
            let (model, translations) = free_modes(rom, structure.damping_ratio.unwrap_or(rom.damping_ratio))?;
            (model, Some(FreeParts::new(scene, translations)?))
        } else {
            (modes(scene, roles.master, 0.0)?, None)
        };
        let carrier = roles.carrier.map(|index| modes(scene, index, 0.0)).transpose()?;
        let (table, _) = super::table::build(scene)?;
        let place = |quantity| table.with_quantity(quantity).map(|variable| variable.reference as usize);
        let references = References {
            step_max: place(Quantity::StepMax).unwrap_or(0),
            ramp_time: place(Quantity::RampTime),
            input_interpolation: place(Quantity::InputInterpolation),
        };
        let mut compiled = Self {
            fingerprint: super::fingerprint::of_scene(scene),
            scene: scene.clone(),
            roles,
            model,
            free,
            disk: disk(scene, roles.master)?,
            reference_speed: 0.0,
            stiffness_range: None,
            carrier,
            load_order: roles
                .carrier
                .and_then(|index| scene.settings.structures[index].load)
                .map_or(0, |load| load.order),
            loads: LoadVectors::default(),
            patches: Patches::new(scene, roles),
            references,
        };
        compiled.set_load_order(f64::from(compiled.load_order))?;
        compiled.set_reference_speed(scene.settings.structures[roles.master].speed)?;
        Ok(compiled)
    }

    /// The master.
    pub fn master(&self) -> (&StructureSettings, &Rom) {
        (&self.scene.settings.structures[self.roles.master], &self.scene.roms[self.roles.master])
    }

    /// The contact pair.
    pub fn contact(&self) -> &ContactSettings {
        &self.scene.settings.contacts[0]
    }

    fn surface(&self) -> &SurfaceSettings {
        &self.scene.settings.surfaces[self.roles.surface]
    }

    /// Largest angular frequency of the master (rad/s), of all nodal diameters where its sectors are coupled.
    pub fn largest_frequency(&self) -> f64 {
        self.disk.as_ref().map_or_else(|| self.model.largest_frequency(), CyclicModel::largest_frequency)
    }

    /// Speed (rad/s) below which tips that vibrate by their clearance in the lowest mode move faster than they slide.
    pub fn slow_sliding(&self) -> f64 {
        let frequencies = match &self.disk {
            Some(disk) => disk.diameters.iter().flat_map(|diameter| &diameter.frequencies).collect(),
            None => self.model.frequencies.iter().collect::<Vec<_>>(),
        };
        let lowest = frequencies.into_iter().copied().filter(|value| *value > 0.0).fold(f64::INFINITY, f64::min);
        let radius = self.master().1.contact_nodes.iter().fold(0.0, |most: f64, node| most.max(node.position[0]));
        if lowest.is_finite() { self.contact().nominal_gap() * lowest / radius } else { 0.0 }
    }

    /// Whether modes or loads of the master depend on the speed.
    pub fn spins(&self) -> bool {
        let spin = self.master().0.spin;
        spin.stiffening || spin.growth || spin.coriolis
    }

    /// Take the modes of the master at a steady speed (rad/s).
    ///
    /// # Errors
    /// A speed at which the stiffness is lost, or beyond what the ROM was fitted for.
    pub fn set_reference_speed(&mut self, speed: f64) -> Result<()> {
        let stiffening = self.master().0.spin.stiffening;
        self.check_speed(speed)?;
        if stiffening {
            self.model = modes(&self.scene, self.roles.master, speed)?;
            let range = |matrix: &DMatrix<f64>| {
                let values = matrix.symmetric_eigenvalues();
                [values.min(), values.max()]
            };
            let spin = self.master().1.extras.spin.as_ref();
            let spin = spin.map(|spin| ModalSpin::new(spin, &self.model, speed));
            self.stiffness_range = spin.map(|spin| [range(&spin.stiffness_speed2), range(&spin.stiffness_speed4)]);
        }
        self.reference_speed = speed;
        self.load();
        Ok(())
    }

    /// Load vectors for the modes and the load order in use.
    fn load(&mut self) {
        let (structure, rom) = self.master();
        let centrifugal = LoadVectors::of_master(structure, rom, &self.model);
        self.loads = LoadVectors { centrifugal, ..LoadVectors::default() };
        if let (Some(index), Some(model)) = (self.roles.carrier, &self.carrier) {
            let (structure, rom) = (&self.scene.settings.structures[index], &self.scene.roms[index]);
            self.loads.add_slave(structure, self.load_order, rom, model);
        }
    }

    fn has_load(&self) -> bool {
        self.roles.carrier.is_some_and(|index| self.scene.settings.structures[index].load.is_some())
    }

    /// Take another number of nodal diameters for the load on the carrier.
    ///
    /// # Errors
    /// A number that its contact grid does not resolve.
    pub fn set_load_order(&mut self, order: f64) -> Result<()> {
        let grid = self.roles.carrier.and_then(|index| self.scene.roms[index].extras.grid);
        // Half as many as nodes would have one phase only, and count twice; more are aliases of fewer.
        let most = u32::try_from(grid.map_or(0, |grid| (grid.around - 1) / 2)).unwrap_or(u32::MAX);
        if self.carrier.is_some() && !(0.0..=f64::from(most)).contains(&order) && self.has_load() {
            return Err(Error::invalid(
                "parameter `casing_load_order`",
                format!("{order} nodal diameters, where the contact grid of the casing resolves 0 to {most}"),
                "Use fewer nodal diameters, or a casing with more contact nodes around",
            ));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within 0 and a u32")]
        let order = order as u32;
        if order != self.load_order {
            self.load_order = order;
            self.load();
        }
        Ok(())
    }

    /// Refuse speeds that the spin matrices were not fitted for.
    ///
    /// # Errors
    /// Beyond 1.05 times the largest fitted speed.
    pub fn check_speed(&self, speed: f64) -> Result<()> {
        let (structure, rom) = self.master();
        let Some(spin) = rom.extras.spin.as_ref().filter(|_| structure.spin != Default::default()) else {
            return Ok(());
        };
        if speed.abs() <= 1.05 * spin.largest_speed {
            return Ok(());
        }
        Err(Error::invalid(
            "variable `speed`",
            format!(
                "{} rad/s is beyond the {} rad/s that stiffening and growth were fitted for",
                shown(speed),
                shown(spin.largest_speed)
            ),
            "Reduce the structure again with a larger speed (`tiprub reduce --spin`), or leave spin out",
        ))
    }

    /// Fresh kernels at rest.
    ///
    /// # Errors
    /// Wrong number of sector gaps or frequency factors, bad shape table, surfaces that do not fit the nodes.
    pub fn system(&self) -> Result<System> {
        if let Some(free) = &self.free {
            return self.free_system(free);
        }
        let contact = self.contact();
        let (structure, rom) = self.master();
        let clearances =
            if contact.sector_gaps.is_empty() { vec![contact.gap; rom.sectors] } else { contact.sector_gaps.clone() };
        let surface = Surface::new(&self.surface().shape, contact.nominal_gap())?;
        let smallest = rom.contact_nodes.iter().fold(f64::INFINITY, |low, node| low.min(node.position[0]));
        let largest_gap = clearances.iter().fold(0.0, |largest: f64, gap| largest.max(*gap));
        for (what, value) in [("contact.gap", largest_gap), ("surface.shape", surface.largest_change())] {
            if value > SMALL_FRACTION * smallest {
                return Err(Error::invalid(
                    what,
                    format!("{value:.3e} m is not small against the radius {smallest:.3e} m of the contact nodes"),
                    "Give lengths in metres, well below a tenth of the radius",
                ));
            }
        }
        let lanes = crate::dynamics::bank::lanes(rom.sectors);
        let contacts = rom.sectors * rom.contact_nodes.len();
        if (self.disk.is_some() || self.roles.carrier.is_some()) && contacts > MOST_COUPLED {
            return Err(Error::invalid(
                if self.disk.is_some() { "ROM metadata `sectors`" } else { "surface.structure" },
                format!("{contacts} contact nodes of all sectors together, coupled, more than {MOST_COUPLED}"),
                "Use fewer contact nodes or sectors, or uncoupled sectors on a rigid surface",
            ));
        }
        let (law, slave) = self.law(surface, &clearances, lanes)?;
        let parts = SystemParts {
            bank: self.bank_options(structure, rom),
            slaves: slave.map(|model| (model, self.loads.on_slave())).into_iter().collect(),
            coating: self.coating(rom)?,
            sticking: self.may_stick(),
        };
        let uncoupled = SectorModel::Uncoupled(&self.model, rom.sectors);
        let model = self.disk.as_ref().map_or(uncoupled, SectorModel::Coupled);
        Ok(System::with_parts(model, law, self.system_settings(), parts))
    }

    /// Scheme, solver, friction and ledger of the kernels.
    pub(super) fn system_settings(&self) -> SystemSettings {
        let (settings, contact) = (&self.scene.settings, self.contact());
        SystemSettings {
            scheme: settings.time.scheme,
            solver: contact.solver,
            friction: contact.friction,
            ledger: settings.outputs.energies,
        }
    }

    fn law(&self, surface: Surface, clearances: &[f64], lanes: usize) -> Result<(GapLaw, Option<ModalModel>)> {
        let (structure, rom) = self.master();
        let (contact, settings) = (self.contact(), self.surface());
        if settings.spline.is_none() && self.roles.carrier.is_none() {
            let law = RevolutionGap::new(rom, surface, clearances, contact.meridian, lanes)?;
            let law = law.with_moving_shaft(structure.whirl || structure.axial_shift);
            return Ok((GapLaw::Revolution(law), None));
        }
        let layout = Layout::new(rom, clearances, lanes)?;
        let carrier = self.roles.carrier.zip(self.carrier.as_ref());
        let carrier = carrier.map(|(index, model)| Carrier { rom: &self.scene.roms[index], model });
        let law = spline_law(rom, layout, contact, settings, carrier)?;
        let slave = match (&law, carrier) {
            (GapLaw::Spline(law), Some(carrier)) => Some(carrier.control_modes(&law.surface)),
            _ => None,
        };
        Ok((law, slave))
    }

    fn bank_options(&self, structure: &StructureSettings, rom: &Rom) -> BankOptions {
        let coupled = structure.spin.stiffening || structure.spin.coriolis;
        let spin = rom.extras.spin.as_ref().filter(|_| coupled);
        let coupling = spin.map(|spin| {
            let modal = ModalSpin::new(spin, &self.model, self.reference_speed);
            (modal, structure.spin.stiffening, structure.spin.coriolis)
        });
        BankOptions {
            frequency_factors: structure.frequency_factors.clone(),
            loads: !self.loads.centrifugal.is_empty(),
            coupling,
            flexibility: true,
        }
    }

    fn coating(&self, rom: &Rom) -> Result<Option<Coating>> {
        let Some(settings) = &self.contact().coating else { return Ok(None) };
        let nodes = || rom.contact_nodes.iter();
        let axial: Vec<f64> = nodes().map(|node| node.position[2]).collect();
        let radii: Vec<f64> = nodes().map(|node| node.position[0]).collect();
        let low = axial.iter().copied().fold(f64::INFINITY, f64::min);
        let high = axial.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let coating = if high - low > 1e-6 * radii[0] {
            Coating::new(settings, &axial, &radii, rom.sectors)?
        } else {
            // One node stands for a strip as wide as a tenth of its radius.
            let half = 0.05 * radii[0];
            Coating::with_extent(settings, &axial, &radii, [low - half, high + half], rom.sectors)?
        };
        Ok(Some(coating))
    }

    /// The carrier's modes at the control points; empty without one.
    pub fn slave_modes(&self, law: &SplineGap) -> ModalModel {
        let carrier = self.roles.carrier.zip(self.carrier.as_ref());
        carrier.map_or_else(
            || self.model.with_nodes(&[]),
            |(index, model)| Carrier { rom: &self.scene.roms[index], model }.control_modes(&law.surface),
        )
    }

    /// Whether `coulomb` can be chosen: a coupled problem of all sectors has room for it only if the scene says so.
    pub fn may_stick(&self) -> bool {
        let contact = self.contact();
        let small = self.roles.carrier.is_none() && self.disk.is_none() && self.free.is_none();
        contact.solver == Solver::Coulomb || (small && contact.friction > 0.0 && contact.coating.is_none())
    }
}

fn modes(scene: &Scene, index: usize, speed: f64) -> Result<ModalModel> {
    let (structure, rom) = (&scene.settings.structures[index], &scene.roms[index]);
    let ratio = structure.damping_ratio.unwrap_or(rom.damping_ratio);
    if structure.spin.stiffening { ModalModel::at_speed(rom, ratio, speed) } else { ModalModel::from_rom(rom, ratio) }
}

/// Modes of coupled sectors.
fn disk(scene: &Scene, index: usize) -> Result<Option<CyclicModel>> {
    let (structure, rom) = (&scene.settings.structures[index], &scene.roms[index]);
    let ratio = structure.damping_ratio.unwrap_or(rom.damping_ratio);
    rom.is_cyclic().then(|| CyclicModel::from_rom(rom, ratio)).transpose()
}
