//! Compilation of settings into kernels: everything that is determined before the first step.

mod surfaces;

use crate::contact::ContactParameters;
use crate::contact::coating::{BladeTip, Coating};
use crate::modes::bank::SectorModel;
use crate::modes::cyclic::CyclicModel;
use crate::modes::modal::{ModalModel, ModalSpin};
use crate::modes::rigid::{Translations, free_modes};
use crate::scene::method::{Scheme, Solver};
use crate::scene::rom::{ContactNode, SupportRows};
use crate::scene::settings::{BodyMotion, ContactSettings, SceneSettings, StructureSettings};
use crate::system::{PairParts, StructureParts, SurfaceCarrier, System, SystemSettings};
use crate::{Error, Result, Rom, Scene};
use nalgebra::DMatrix;
use std::sync::Arc;
use tiprub_cosim::shown;
use tiprub_cosim::variables::{Quantity, VariableTable};

use super::blades::{disk_heat, expansion, softened, static_stress};
use super::loads::{CarrierLoads, centrifugal};
use super::outputs::OutputReader;
use super::patches::HeatPatches;
use super::plan::{SteppingOrder, prefix};
use super::spline_surface::Lining;
use super::table;

/// Largest number of contact nodes of all sectors that a flexible slave or the disk may couple: their Delassus matrix is dense.
pub(crate) const MAX_COUPLED: usize = 2000;

/// Indices of the values that the step reads.
#[derive(Debug, Clone)]
pub(crate) struct ValuePlaces {
    pub step_max: usize,
    pub input_interpolation: Option<usize>,
    /// Ramp time of each pair whose shape grows from zero.
    pub ramp_times: Vec<Option<usize>>,
    /// Engine order of each excited structure.
    pub engine_orders: Vec<Option<usize>>,
}

impl ValuePlaces {
    fn new(table: &VariableTable, plan: &SteppingOrder) -> Self {
        let place = |quantity| table.with_quantity(quantity).map(|variable| variable.reference as usize);
        let of = |quantity, of| Some(table.with_quantity_of(quantity, of)?.reference as usize);
        Self {
            step_max: place(Quantity::StepMax).unwrap_or(0),
            input_interpolation: place(Quantity::InputInterpolation),
            ramp_times: (0..plan.pairs.len()).map(|pair| of(Quantity::RampTime, pair)).collect(),
            engine_orders: (0..plan.bodies.len()).map(|body| of(Quantity::ExcitationOrder, body)).collect(),
        }
    }
}

/// Returns the solver of a scene, or the default solver if the solver of the scene does not make forces and gaps
/// complementary.
pub fn complementary(settings: &SceneSettings) -> Solver {
    let own = settings.contacts[0].solver;
    if own.properties().complementary { own } else { Solver::default() }
}

/// A master: a structure with contact nodes.
#[derive(Debug, Clone, Default)]
pub(crate) struct CompiledBody {
    /// Modes, at the reference speed if spin stiffens the structure; for coupled sectors those of nodal diameter 0.
    pub model: ModalModel,
    /// Modes of coupled sectors.
    pub disk: Option<CyclicModel>,
    /// Translations of a free body.
    pub translations: Option<Translations>,
    /// Speed at which `model` has its stiffness (rad/s).
    pub reference_speed: f64,
    /// Temperature at which `model` has its stiffness, if heat softens it (K).
    pub reference_temperature: f64,
    /// Lowest and highest eigenvalue of the modal stiffness per Ω² and per Ω⁴, if spin stiffens the structure.
    pub stiffness_range: Option<[[f64; 2]; 2]>,
    /// Modal load by growth, per Ω² and, with stiffening, per Ω⁴; empty without growth.
    pub centrifugal: Vec<[f64; 2]>,
    /// Modal load of coupled sectors per kelvin; empty without heat.
    pub disk_heat: Vec<f64>,
    /// Free expansion of uncoupled blades per kelvin in modal coordinates; empty without heat.
    pub expansion: Vec<f64>,
    /// Displacement of watched points per unit of each mode, 3·points × modes; empty without watched points.
    pub watched: DMatrix<f64>,
    /// Stress at places per unit of each mode, 6·places × modes (Pa); empty unless requested.
    pub stress: DMatrix<f64>,
    /// Static stress at these places per kelvin beyond that of the expansion of the modes, 6·places (Pa/K); empty without heat.
    pub stress_heat: Vec<f64>,
    /// Static stress at these places per Ω² by growth (Pa s²); empty without growth.
    pub stress_growth: Vec<f64>,
    /// 1 or −1 per mode, such that the contact node with the largest displacement moves in the positive direction; empty unless requested.
    pub senses: Vec<f64>,
}

/// A structure that carries surfaces.
#[derive(Debug, Clone)]
pub(crate) struct CarrierParts {
    /// Index in the scene.
    pub structure: usize,
    /// Modes, observed at the contact grid.
    pub model: ModalModel,
    /// Number of nodal diameters of its load.
    pub load_order: u32,
    pub loads: CarrierLoads,
    /// Force on the support per unit of each mode, if requested.
    pub support: Option<SupportRows>,
}

/// The parts of a scene that do not change while it runs.
#[derive(Debug, Clone)]
pub struct Compiled {
    pub scene: Arc<Scene>,
    pub plan: SteppingOrder,
    /// Masters, in the order of [`SteppingOrder::bodies`].
    pub bodies: Vec<CompiledBody>,
    /// Surface carriers, in the order of [`SteppingOrder::carriers`]; in the system they follow the masters.
    pub carriers: Vec<CarrierParts>,
    /// Patches that collect friction heat, per pair.
    pub patches: Vec<Option<HeatPatches>>,
    /// Linings between surface and mesh, per pair; empty if no support output is requested.
    pub linings: Vec<Option<Lining>>,
    /// True if adaptive steps are supported, with `lcp` instead of `film`.
    pub supports_adaptive: bool,
    /// Hash of settings and ROMs, stored in saved states.
    pub fingerprint: u64,
    pub references: ValuePlaces,
}

impl CompiledBody {
    fn new(scene: &Scene, plan: &SteppingOrder, body: usize) -> Result<Self> {
        let (structure, rom) = plan.structure(scene, body);
        let ratio = structure.damping_ratio.unwrap_or(rom.damping_ratio);
        let (model, translations) = if structure.motion == BodyMotion::Free {
            let (model, translations) = free_modes(rom, ratio)?;
            (model, Some(translations))
        } else {
            rom.validate()?;
            (modes(structure, rom, [0.0; 2])?, None)
        };
        let disk = rom.is_cyclic().then(|| CyclicModel::with_zero(rom, ratio, model.clone())).transpose()?;
        Ok(Self { model, disk, translations, ..Self::default() })
    }

    /// Largest angular frequency (rad/s), over all nodal diameters if sectors are coupled.
    pub fn largest_frequency(&self) -> f64 {
        self.disk.as_ref().map_or_else(|| self.model.largest_frequency(), CyclicModel::largest_frequency)
    }

    /// Lowest angular frequency of a vibrating mode (rad/s); infinite if there is none.
    pub fn lowest_frequency(&self) -> f64 {
        let frequencies = match &self.disk {
            Some(disk) => disk.diameters.iter().flat_map(|diameter| &diameter.frequencies).collect(),
            None => self.model.frequencies.iter().collect::<Vec<_>>(),
        };
        frequencies.into_iter().copied().filter(|value| *value > 0.0).fold(f64::INFINITY, f64::min)
    }
}

impl Compiled {
    /// Validates the scene, builds its variable table and solves the reduced eigenproblems.
    ///
    /// # Errors
    /// Invalid settings or ROM; ROMs without data that the scene requires.
    pub fn new(scene: Arc<Scene>) -> Result<(Self, VariableTable, Vec<OutputReader>)> {
        scene.settings.validate()?;
        let plan = SteppingOrder::new(&scene)?;
        let (table, readers) = table::build(&scene, &plan)?;
        let bodies =
            (0..plan.bodies.len()).map(|body| CompiledBody::new(&scene, &plan, body)).collect::<Result<_>>()?;
        let carrier = |structure: &usize| {
            let (settings, rom) = (&scene.settings.structures[*structure], &scene.roms[*structure]);
            let load_order = settings.load.map_or(0, |load| load.order);
            rom.validate()?;
            let (model, loads) = (modes(settings, rom, [0.0; 2])?, CarrierLoads::default());
            let support = rom.extras.support.as_ref().filter(|_| scene.settings.outputs.support_reaction);
            let support = support.map(|rows| SupportRows {
                stiffness: &rows.stiffness * &model.shapes,
                mass: &rows.mass * &model.shapes,
                thermal: rows.thermal.clone(),
            });
            Ok(CarrierParts { structure: *structure, model, load_order, loads, support })
        };
        let carriers = plan.carriers.iter().map(carrier).collect::<Result<_>>()?;
        let mut compiled = Self {
            fingerprint: super::fingerprint::of_scene(&scene),
            patches: plan.pairs.iter().map(|pair| HeatPatches::new(&scene, &plan, pair)).collect(),
            linings: Vec::new(),
            supports_adaptive: scene.check_methods(Scheme::ADAPTIVE, complementary(&scene.settings)).is_ok(),
            references: ValuePlaces::new(&table, &plan),
            scene,
            plan,
            bodies,
            carriers,
        };
        for carrier in 0..compiled.carriers.len() {
            compiled.set_load_order(carrier, f64::from(compiled.carriers[carrier].load_order))?;
            compiled.load_carrier(carrier);
        }
        for body in 0..compiled.bodies.len() {
            compiled.set_reference_speed(body, [compiled.body(body).0.speed, 0.0])?;
        }
        compiled.check_blades()?;
        if compiled.scene.settings.outputs.support_reaction {
            compiled.linings =
                (0..compiled.plan.pairs.len()).map(|pair| compiled.lining(pair)).collect::<Result<_>>()?;
        }
        Ok((compiled, table, readers))
    }

    /// Returns settings and ROM of a master.
    pub fn body(&self, body: usize) -> (&StructureSettings, &Rom) {
        self.plan.structure(&self.scene, body)
    }

    /// Returns settings and ROM of a surface carrier.
    pub fn carrier(&self, carrier: usize) -> (&StructureSettings, &Rom) {
        let structure = self.carriers[carrier].structure;
        (&self.scene.settings.structures[structure], &self.scene.roms[structure])
    }

    /// Returns the settings of a contact pair.
    pub fn contact(&self, pair: usize) -> &ContactSettings {
        &self.scene.settings.contacts[pair]
    }

    /// Returns the name of a contact node, with the name of its structure if there are several masters.
    pub(crate) fn node_name(&self, body: usize, node: usize) -> String {
        let prefix = self.plan.body_prefix(&self.scene, body);
        format!("{prefix}{}", self.body(body).1.contact_nodes[node].name)
    }

    /// Returns the name of the rotating structure for messages: "the rotor", or its name if there are several masters.
    pub(crate) fn rotor_name(&self, body: usize) -> String {
        if self.bodies.len() > 1 { self.body(body).0.name.clone() } else { "the rotor".to_owned() }
    }

    /// Returns the name of a structure of the system.
    pub(crate) fn structure_name(&self, structure: usize) -> &str {
        match structure.checked_sub(self.bodies.len()) {
            Some(carrier) => &self.carrier(carrier).0.name,
            None => &self.body(structure).0.name,
        }
    }

    /// Returns the name of a surface carrier of the system for messages: "casing", or its name if there are several or if it is near a
    /// free body.
    pub(crate) fn carrier_name(&self, structure: usize) -> &str {
        let is_casing = self.carriers.len() == 1 && self.bodies.iter().all(|body| body.translations.is_none());
        match structure.checked_sub(self.bodies.len()) {
            Some(carrier) if !is_casing => &self.carrier(carrier).0.name,
            _ => "casing",
        }
    }

    /// Returns whether tips of a structure cut a coating.
    pub fn cuts(&self, body: usize) -> bool {
        self.plan
            .pairs_of(body)
            .any(|(pair, _)| self.contact(pair).coating.is_some_and(|coating| coating.cutting.is_some()))
    }

    /// Returns whether modes or loads of a structure depend on the speed.
    pub fn spins(&self, body: usize) -> bool {
        let spin = self.body(body).0.spin;
        spin.stiffening || spin.growth || spin.coriolis
    }

    /// Computes the modes of a structure at a steady speed (rad/s) and temperature (K).
    ///
    /// # Errors
    /// Speed or temperature at which the stiffness is lost, or outside the range for which the ROM was fitted.
    pub(crate) fn set_reference_speed(&mut self, body: usize, [speed, temperature]: [f64; 2]) -> Result<()> {
        self.check_speed(body, speed)?;
        self.check_temperature(body, temperature)?;
        let (structure, rom) = self.plan.structure(&self.scene, body);
        let parts = &mut self.bodies[body];
        let known = (!structure.spin.stiffening || parts.reference_speed.to_bits() == speed.to_bits())
            && (structure.softening == 0.0 || parts.reference_temperature.to_bits() == temperature.to_bits());
        if !known {
            parts.model = modes(structure, rom, [speed, temperature])?;
        }
        if structure.softening != 0.0 {
            parts.reference_temperature = temperature;
        }
        if let Some(spin) = rom.extras.spin.as_ref().filter(|_| structure.spin.stiffening) {
            let range = |matrix: &DMatrix<f64>| {
                let values = matrix.symmetric_eigenvalues();
                [values.min(), values.max()]
            };
            let spin = ModalSpin::new(spin, &parts.model, speed);
            parts.stiffness_range = Some([range(&spin.stiffness_speed2), range(&spin.stiffness_speed4)]);
        }
        let asked = self.scene.settings.outputs.stress;
        let modes_told = self.scene.settings.outputs.modal_amplitudes.is_some();
        let body = &mut self.bodies[body];
        body.reference_speed = speed;
        body.centrifugal = centrifugal(structure, rom, &body.model);
        body.disk_heat = disk_heat(structure, rom, &body.model);
        body.expansion = expansion(structure, rom, &body.model, temperature)?;
        if let Some(watched) = &rom.extras.watched {
            body.watched = &watched.map * &body.model.shapes;
        }
        if let Some(stress) = rom.extras.stress.as_ref().filter(|_| asked) {
            body.stress = &stress.map * &body.model.shapes;
            (body.stress_heat, body.stress_growth) = static_stress(structure, rom, stress, body)?;
        }
        if modes_told {
            let largest = |a: f64, b: &f64| if b.abs() > a.abs() { *b } else { a };
            let shapes = body.model.contact_modes.column_iter();
            body.senses =
                shapes.map(|shape| shape.iter().fold(0.0, largest)).map(|most| 1.0_f64.copysign(most)).collect();
        }
        Ok(())
    }

    fn load_carrier(&mut self, carrier: usize) {
        let (structure, rom) = self.carrier(carrier);
        let parts = &self.carriers[carrier];
        self.carriers[carrier].loads = CarrierLoads::new(structure, parts.load_order, rom, &parts.model);
    }

    /// Sets the number of nodal diameters of the load on a carrier.
    ///
    /// # Errors
    /// Number that the contact grid does not resolve.
    pub(crate) fn set_load_order(&mut self, carrier: usize, order: f64) -> Result<()> {
        let (structure, rom) = self.carrier(carrier);
        // Half the number of nodes would have a single phase and count twice; larger numbers are aliases of smaller ones.
        let most = u32::try_from(rom.extras.grid.map_or(0, |grid| (grid.around - 1) / 2)).unwrap_or(u32::MAX);
        if structure.load.is_some() && !(0.0..=f64::from(most)).contains(&order) {
            return Err(Error::invalid(
                format!("parameter `{}casing_load_order`", prefix(self.carriers.len(), &structure.name)),
                format!("{order} nodal diameters, but the contact grid of the casing resolves only 0 to {most}"),
                "Use fewer nodal diameters, or a casing with more contact nodes around the circumference",
            ));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within 0 and a u32")]
        let order = order as u32;
        if order != self.carriers[carrier].load_order {
            self.carriers[carrier].load_order = order;
            self.load_carrier(carrier);
        }
        Ok(())
    }

    /// Rejects speeds for which the spin matrices were not fitted.
    ///
    /// # Errors
    /// Speed above 1.05 times the largest fitted speed.
    pub fn check_speed(&self, body: usize, speed: f64) -> Result<()> {
        let (structure, rom) = self.body(body);
        let Some(spin) = rom.extras.spin.as_ref().filter(|_| structure.spin != Default::default()) else {
            return Ok(());
        };
        if speed.abs() <= 1.05 * spin.largest_speed {
            return Ok(());
        }
        Err(Error::invalid(
            format!("variable `{}speed`", self.plan.body_prefix(&self.scene, body)),
            format!(
                "{} rad/s is beyond the {} rad/s for which stiffening and growth were fitted",
                shown(speed),
                shown(spin.largest_speed)
            ),
            format!(
                "Reduce the structure again with the option `--spin {}`, or remove `spin`",
                shown(speed.abs().ceil())
            ),
        ))
    }

    /// Creates kernels at rest: masters, then carriers.
    ///
    /// # Errors
    /// Wrong number of sector gaps or frequency factors; invalid shape table; surfaces that do not fit the nodes.
    pub fn system(&self) -> Result<System> {
        self.check_size()?;
        let gap = |pair| self.gap(pair).map_err(|error| self.of_pair(pair, error));
        let gaps = (0..self.plan.pairs.len()).map(gap).collect::<Result<Vec<_>>>()?;
        let control = self.control_modes(&gaps);
        let excitations = (0..self.bodies.len()).map(|body| self.excitation(body)).collect::<Result<Vec<_>>>()?;
        let touching = (0..self.bodies.len()).map(|body| {
            let uncoupled = SectorModel::Uncoupled(&self.bodies[body].model, self.body(body).1.sectors);
            let model = self.bodies[body].disk.as_ref().map_or(uncoupled, SectorModel::Coupled);
            let excitation = excitations[body];
            StructureParts::Touching(model, Box::new(self.bank_options(body, excitation)))
        });
        let carrying = self.carriers.iter().zip(&control);
        let carrying = carrying.map(|(carrier, model)| StructureParts::Carrying(model, carrier.loads.are_there()));
        let structures = touching.chain(carrying).collect();
        let mut rows = vec![0; self.carriers.len()];
        let mut pairs = Vec::new();
        for (index, (plan, gap)) in self.plan.pairs.iter().zip(gaps).enumerate() {
            let carrier = plan.carrier.map(|carrier| {
                let first_row = rows[carrier];
                rows[carrier] += 3 * gap.spline().map_or(0, |surface| surface.control_points().len());
                SurfaceCarrier { structure: self.bodies.len() + carrier, first_row }
            });
            let parameters = ContactParameters::new(self.contact(index));
            pairs.push(PairParts { structure: plan.body, gap, carrier, parameters });
        }
        let coating = |pair| self.coating(pair).map_err(|error| self.of_pair(pair, error));
        let coatings = (0..pairs.len()).filter_map(|pair| Some((pair, coating(pair).transpose()?)));
        let coatings = coatings.map(|(pair, coating)| Ok((pair, coating?))).collect::<Result<_>>()?;
        let settings = &self.scene.settings;
        let methods = SystemSettings {
            scheme: settings.time.scheme,
            solver: settings.contacts[0].solver,
            ledger: settings.outputs.energies,
        };
        Ok(System::of(structures, pairs, coatings, methods))
    }

    /// Adds the contact and the surface of a pair, with their numbers, to an error.
    pub(crate) fn of_pair(&self, pair: usize, error: Error) -> Error {
        let surface = self.plan.pairs[pair].surface + 1;
        error.placed("contact", &format!("contact[{}]", pair + 1)).placed("surface", &format!("surface[{surface}]"))
    }

    fn coating(&self, pair: usize) -> Result<Option<Coating>> {
        let Some(settings) = &self.contact(pair).coating else { return Ok(None) };
        let plan = &self.plan.pairs[pair];
        let rom = self.body(plan.body).1;
        let nodes: Vec<&ContactNode> = plan.nodes.iter().map(|node| &rom.contact_nodes[*node]).collect();
        Ok(Some(Coating::new(settings, &BladeTip::of(&nodes, settings), rom.sectors)?))
    }
}

/// Solves the eigenproblem of a valid ROM at a speed (rad/s) and a temperature (K).
fn modes(structure: &StructureSettings, rom: &Rom, [speed, temperature]: [f64; 2]) -> Result<ModalModel> {
    let ratio = structure.damping_ratio.unwrap_or(rom.damping_ratio);
    if structure.softening != 0.0 {
        let speed = structure.spin.stiffening.then_some(speed);
        return ModalModel::softened(rom, ratio, speed, softened(structure, temperature));
    }
    if structure.spin.stiffening { ModalModel::at_speed(rom, ratio, speed) } else { ModalModel::at_rest(rom, ratio) }
}
