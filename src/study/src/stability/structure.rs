//! One structure with closed sliding contact on a round casing: growth rates, solvability, and the internal step of each scheme below which all
//! steps are accepted, found with the same checks as in the core. Longer steps may be accepted too, because friction causes growth in bands.

use tiprub_core::geometry::Vector3;
use tiprub_core::limits::{
    self, ContactDirections, Fastest, GrowthRates, SlidingContacts, judged::SetGrowth, lock_up, massless::MasslessCheck,
};
use tiprub_core::modes::{cyclic::CyclicModel, modal::ModalModel};
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_core::{Result, Rom};
use tiprub_cosim::shown;

use super::seek::{Sought, TRIED, seek};

/// Contact nodes up to this number are closed in every combination; with more nodes, each alone, pairs of neighbours, and all.
const ALL_COMBINATIONS_UP_TO: usize = 3;
/// Number of friction coefficients for which solvability is checked, ascending.
const FRICTION_STEPS: u32 = 40;
const FRICTION_STEPS_PER_UNIT: f64 = 20.0;

/// Properties of the contact that are known from a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownContact {
    /// Friction coefficient µ.
    pub friction: f64,
    /// Speed at the start (rad/s), whose sign is the sense of slip; 0 stands for both senses.
    pub speed: f64,
}

impl KnownContact {
    /// Returns the senses of slip: 0 along +θ, 1 along −θ.
    fn senses(&self) -> impl Iterator<Item = usize> + use<> {
        let slides = [self.speed >= 0.0, self.speed <= 0.0];
        (0..2).filter(move |sense| slides[*sense])
    }
}

/// Limit of a scheme.
#[derive(Debug, Clone, PartialEq)]
pub enum SchemeLimit {
    /// Steps below this (s) are accepted.
    Below(f64),
    /// No step is rejected, up to this tried step (s).
    Tried(f64),
    /// The scheme is rejected at any step.
    Refused(String),
}

/// Limit of one scheme.
#[derive(Debug, Clone, PartialEq)]
pub struct StepLimit {
    /// Name as in a scene.
    pub scheme: &'static str,
    /// Largest step.
    pub limit: SchemeLimit,
}

impl StepLimit {
    /// Formats the limit for the terminal.
    pub fn to_text(&self) -> String {
        match &self.limit {
            SchemeLimit::Below(step) => format!("{step:.4e} s"),
            SchemeLimit::Tried(step) => format!("no limit found up to {step:.1e} s"),
            SchemeLimit::Refused(why) => format!("rejected: {why}"),
        }
    }

    /// Returns the limit (s), if there is one.
    pub fn below(&self) -> Option<f64> {
        match self.limit {
            SchemeLimit::Below(step) => Some(step),
            _ => None,
        }
    }
}

/// Growth of closed sliding contact, for the set of closed nodes with the largest growth.
#[derive(Debug, Clone, PartialEq)]
pub struct Rates {
    /// Growth of the model and of the scheme's steps.
    pub growth: GrowthRates,
    /// Fastest growth of the differential equations, without the mass of the contact nodes if the model permits it.
    pub physical: Fastest,
    /// Names of the closed nodes; for coupled sectors with the nodal diameter.
    pub closed: String,
}

impl Rates {
    /// Returns whether the differential equations themselves are unstable.
    pub fn is_flutter(&self) -> bool {
        self.physical.rate > self.growth.noise
    }

    /// Returns the frequency of the self-excited vibration (Hz), if there is one.
    pub fn frequency(&self) -> Option<f64> {
        self.is_flutter().then_some(self.physical.frequency / std::f64::consts::TAU)
    }
}

/// Lock-up of a tip.
#[derive(Debug, Clone, PartialEq)]
pub struct LockUp {
    /// Lock-up friction µ*: above it, no force balances closed sliding contact.
    pub friction: f64,
    /// Names of the closed nodes; for coupled sectors with the nodal diameter.
    pub closed: String,
    /// Sense of slip: 0 along +θ, 1 along −θ.
    pub sense: usize,
}

/// One structure by itself.
#[derive(Debug)]
pub struct SingleStructure<'a> {
    rom: &'a Rom,
    /// Model of the sector, or of all nodal diameters of coupled sectors.
    pub models: Vec<ModalModel>,
    /// Natural angular frequencies (rad/s) of the sector, or of every nodal diameter of coupled sectors, from 0.
    pub frequencies: Vec<Vec<f64>>,
    /// Normal and slip direction of all contact nodes for slip in +θ and −θ.
    closed: [ContactDirections; 2],
}

impl<'a> SingleStructure<'a> {
    /// Creates the structure with a damping ratio and its modes at a speed (rad/s) that stiffens it, 0 without stiffening.
    ///
    /// # Errors
    /// The eigenproblem of the ROM cannot be solved.
    pub fn new(rom: &'a Rom, damping_ratio: f64, speed: f64) -> Result<Self> {
        let closed = [1.0, -1.0].map(|sign| closed_contacts(rom, sign));
        if rom.is_cyclic() {
            let disk = CyclicModel::from_rom(rom, damping_ratio)?;
            let frequencies = disk.diameters.iter().map(|diameter| diameter.frequencies.clone()).collect();
            let models = (0..disk.diameters.len()).map(|number| disk.paired(number)).collect();
            return Ok(Self { rom, models, frequencies, closed });
        }
        let model = if speed == 0.0 {
            ModalModel::from_rom(rom, damping_ratio)?
        } else {
            ModalModel::at_speed(rom, damping_ratio, speed)?
        };
        Ok(Self { rom, frequencies: vec![model.frequencies.clone()], models: vec![model], closed })
    }

    /// Returns the blade with the highest frequencies among mistuned blades: all frequencies times `factor`.
    pub fn stiffened(mut self, factor: f64) -> Self {
        let models = self.models.iter_mut().flat_map(|model| &mut model.frequencies);
        models.chain(self.frequencies.iter_mut().flatten()).for_each(|frequency| *frequency *= factor);
        self
    }

    /// Returns the structure with radial normals, independent of the slope of the contour.
    pub fn radial(mut self) -> Self {
        self.closed.iter_mut().flatten().for_each(|(normal, _)| *normal = -Vector3::x());
        self
    }

    /// Returns the highest angular frequency (rad/s).
    pub fn highest(&self) -> f64 {
        self.models.iter().map(ModalModel::largest_frequency).fold(0.0, f64::max)
    }

    /// Returns the growth of sliding contact, for the set of closed nodes and the sense with the largest growth rate of the steps. `None` without
    /// friction, and if the growth cannot be determined.
    pub fn rates(&self, scheme: Scheme, step: f64, sliding: KnownContact) -> Option<Rates> {
        let mut most: Option<GrowthRates> = None;
        let mut physical: Option<(Fastest, String)> = None;
        for sense in sliding.senses() {
            for nodes in self.combinations() {
                for model in 0..self.models.len() {
                    let (seen, directions) = self.seen(model, &nodes, sense);
                    let Some(found) =
                        limits::growth(SlidingContacts::new(&seen, sliding.friction, &directions), scheme, step)
                    else {
                        continue;
                    };
                    let own = self.physical(&seen, scheme, step, sliding.friction, &directions, &found);
                    if most.as_ref().is_none_or(|most| found.stepped > most.stepped) {
                        most = Some(found);
                    }
                    if physical.as_ref().is_none_or(|most| own.rate > most.0.rate) {
                        physical = Some((own, self.named(&nodes, model)));
                    }
                }
            }
        }
        let (growth, (physical, closed)) = most.zip(physical)?;
        Some(Rates { growth, physical, closed })
    }

    /// Returns the smallest friction at which closed sliding contact locks up, over all sets of closed nodes and over the senses of a speed (rad/s),
    /// both senses if it is 0. `None` if no friction causes lock-up, for free bodies, and for a ROM that does not define the position of the other
    /// body.
    pub fn lock_up(&self, speed: f64) -> Option<LockUp> {
        if self.rom.frame == DisplacementFrame::Cartesian {
            return None;
        }
        let mut least: Option<LockUp> = None;
        for sense in (KnownContact { friction: 1.0, speed }).senses() {
            for nodes in self.combinations() {
                for model in 0..self.models.len() {
                    let (seen, directions) = self.seen(model, &nodes, sense);
                    let own = lock_up::least_friction(&seen, &directions).unwrap_or(f64::INFINITY);
                    if own < least.as_ref().map_or(f64::INFINITY, |least| least.friction) {
                        least = Some(LockUp { friction: own, closed: self.named(&nodes, model), sense });
                    }
                }
            }
        }
        least
    }

    /// Returns the growth without the mass of the contact nodes if the model permits it.
    fn physical(
        &self,
        seen: &ModalModel,
        scheme: Scheme,
        step: f64,
        friction: f64,
        directions: &ContactDirections,
        found: &GrowthRates,
    ) -> Fastest {
        let own = Fastest { rate: found.continuous, frequency: found.frequency };
        let without = || limits::without_node_mass(SlidingContacts::new(seen, friction, directions), step);
        if scheme.properties().delays_contact { own } else { without().unwrap_or(own) }
    }

    /// Returns the names of the closed nodes; for coupled sectors with the nodal diameter.
    fn named(&self, nodes: &[usize], model: usize) -> String {
        let names: Vec<&str> = nodes.iter().map(|node| self.rom.contact_nodes[*node].name.as_str()).collect();
        let diameter = if self.rom.is_cyclic() { format!(", nodal diameter {model}") } else { String::new() };
        match names.as_slice() {
            [first, .., last] if names.len() > ALL_COMBINATIONS_UP_TO => format!("{first} to {last}{diameter}"),
            names => format!("{}{diameter}", names.join(", ")),
        }
    }

    /// Returns one model and the directions of the nodes closed on it, of both parts of a nodal diameter.
    fn seen(&self, model: usize, nodes: &[usize], sense: usize) -> (ModalModel, ContactDirections) {
        let (model, own) = (&self.models[model], self.rom.contact_nodes.len());
        let copies = model.contact_modes.nrows() / (3 * own);
        let places: Vec<usize> = (0..copies).flat_map(|part| nodes.iter().map(move |node| part * own + node)).collect();
        let directions = places.iter().map(|place| self.closed[sense][place % own]).collect();
        (model.with_nodes(&places), directions)
    }

    /// Returns the sets of contact nodes that are closed: all combinations of a few nodes; for many nodes each alone, pairs of neighbours, and all;
    /// for coupled sectors each alone, and all.
    fn combinations(&self) -> Vec<Vec<usize>> {
        let nodes = self.rom.contact_nodes.len();
        let alone = (0..nodes).map(|node| vec![node]);
        if self.rom.is_cyclic() {
            return alone.chain([(0..nodes).collect()]).collect();
        }
        if nodes <= ALL_COMBINATIONS_UP_TO {
            let members = |set: usize| (0..nodes).filter(|node| set >> node & 1 == 1).collect();
            return (1..1 << nodes).map(members).collect();
        }
        alone.chain((1..nodes).map(|node| vec![node - 1, node])).chain([(0..nodes).collect()]).collect()
    }

    /// Returns the limits of every scheme; `sliding` is the contact if it is known. For coupled sectors, growth by friction is checked with the
    /// scene.
    pub fn step_limits(&self, sliding: Option<KnownContact>) -> Vec<StepLimit> {
        let sliding = sliding.unwrap_or(KnownContact { friction: 0.0, speed: 0.0 });
        // A Cartesian ROM belongs to a free or stationary body, for which massless-boundary is not supported or not needed.
        let massless = self.rom.frame != DisplacementFrame::Cartesian;
        let schemes = Scheme::RECURRENCES.into_iter().filter(|scheme| massless || !scheme.properties().quasi_static);
        schemes.map(|scheme| StepLimit { scheme: scheme.name(), limit: self.limit(scheme, sliding) }).collect()
    }

    fn limit(&self, scheme: Scheme, sliding: KnownContact) -> SchemeLimit {
        let [low, high] = TRIED.map(|product| product / self.highest());
        let usable = match self.massless(scheme, high) {
            Ok(usable) => usable.min(self.resolved(scheme)),
            Err(why) => return SchemeLimit::Refused(why),
        };
        let accepted = |step: f64| step < usable && self.accepts(scheme, step, sliding);
        // The limit is known unless another check rejects shorter steps.
        let stable = scheme.properties().stable_below;
        let exact = if stable.is_finite() { stable / self.highest() } else { usable };
        match seek([low, high], Some(exact), |step| if accepted(step) { Ok(()) } else { Err(()) }) {
            Sought::All(step) => SchemeLimit::Tried(step),
            Sought::Below(step, ()) => SchemeLimit::Below(step),
            Sought::None(()) => {
                let step = shown((low * 1e9).round() / 1e9);
                SchemeLimit::Refused(format!("even a step of {step} s, which resolves every mode, is rejected"))
            }
        }
    }

    /// Returns the steps of modal-exact (s) that resolve all modes on which contact acts; infinite for other schemes.
    fn resolved(&self, scheme: Scheme) -> f64 {
        if scheme.properties().resolved_up_to.is_infinite() {
            return f64::INFINITY;
        }
        let limit = |model: &ModalModel| match self.rom.frame {
            DisplacementFrame::Cartesian => limits::unresolved::limit_along_axes(model),
            DisplacementFrame::Cylindrical => {
                limits::unresolved::limit(model, &vec![[-1.0, 0.0, 0.0]; model.contact_modes.nrows() / 3])
            }
        };
        self.models.iter().map(limit).fold(f64::INFINITY, f64::min)
    }

    /// Returns the usable step of massless-boundary (s); infinite for other schemes.
    fn massless(&self, scheme: Scheme, largest: f64) -> Result<f64, String> {
        if !scheme.properties().delays_contact {
            return Ok(f64::INFINITY);
        }
        let mut usable = f64::INFINITY;
        for model in &self.models {
            if model.dynamic_modes(scheme) == 0 {
                return Err(
                    "the scheme makes three modes per contact node quasi-static, and no mode is left".to_owned()
                );
            }
            let copies = model.contact_modes.nrows() / (3 * self.rom.contact_nodes.len());
            let normals = self.closed[0].repeat(copies).into_iter().map(|(normal, _)| normal).collect();
            let check = MasslessCheck { model, normals, carriers: Vec::new() };
            usable = usable.min(check.limit(largest).map_err(|error| error.to_string())?.usable);
        }
        Ok(usable)
    }

    fn accepts(&self, scheme: Scheme, step: f64, sliding: KnownContact) -> bool {
        if limits::check_step_allowed(self.highest(), scheme, step).is_err() {
            return false;
        }
        if sliding.friction == 0.0 || self.rom.is_cyclic() {
            return true;
        }
        // Independent of the duration of contact.
        let grows = |nodes: &Vec<usize>, sense: usize| {
            let (seen, directions) = self.seen(0, nodes, sense);
            let contacts = SlidingContacts::new(&seen, sliding.friction, &directions);
            let found = limits::growth(contacts, scheme, step);
            found.is_some_and(|found| SetGrowth::new(contacts, scheme, step, found).allowed().is_finite())
        };
        self.combinations().iter().all(|nodes| !sliding.senses().any(|sense| grows(nodes, sense)))
    }

    /// Returns the largest friction coefficient (in steps of 0.05, up to 2) for which the contact problem with all nodes of one sector closed has a
    /// unique solution at h = 1/ω_max, for slip in both directions; `None` if there is none even for 0.
    ///
    /// A Cartesian ROM does not define the position of the other body, so that solvability is checked with the scene.
    pub fn solvable_friction(&self) -> Option<f64> {
        if self.rom.frame == DisplacementFrame::Cartesian {
            return None;
        }
        let step = 1.0 / self.highest();
        // Real and imaginary parts of a nodal diameter count as separate contacts.
        let copies = |model: &ModalModel| model.contact_modes.nrows() / (3 * self.rom.contact_nodes.len());
        let of = |model: &ModalModel| self.closed.iter().map(|sense| sense.repeat(copies(model))).collect();
        let together: Vec<Vec<ContactDirections>> = self.models.iter().map(of).collect();
        let solvable = |friction: f64| {
            if self.rom.is_cyclic() {
                limits::check_solvable_together(&self.models, Scheme::default(), step, friction, &together).is_ok()
            } else {
                limits::check_solvable(&self.models[0], Scheme::default(), step, friction, &self.closed).is_ok()
            }
        };
        let tried = (0..=FRICTION_STEPS).map(|step| f64::from(step) / FRICTION_STEPS_PER_UNIT);
        tried.take_while(|friction| solvable(*friction)).last()
    }
}

/// Returns normal and slip direction of every contact node against a round casing: inwards along the normal of the contour, and along ±θ.
fn closed_contacts(rom: &Rom, slip_sign: f64) -> ContactDirections {
    let directions = rom.contact_nodes.iter().map(|node| {
        let length = node.meridional_slope.hypot(1.0);
        (Vector3::new(-1.0 / length, 0.0, node.meridional_slope / length), slip_sign * Vector3::y())
    });
    directions.collect()
}

#[cfg(test)]
mod tests {
    use tiprub_core::{CoSimulation, Simulation};
    use tiprub_gallery::scene_source;
    use tiprub_model::{
        cyclic::ModeSelection,
        reduce::ReductionKind,
        rotor37::TipContact,
        stage::{StageOptions, reduce_stage},
    };

    use super::*;

    /// The limits of the structure alone agree with the warnings at the start of a run; with less friction there is no warning.
    #[test]
    fn lock_up_friction_matches_the_warning_of_a_run() {
        let options = StageOptions {
            tip: TipContact::Patches(3),
            kind: ReductionKind::FreeInterface,
            modes: ModeSelection::Count(4),
            ..StageOptions::coarse()
        };
        let rom = reduce_stage(&options, &|_| {}).unwrap().rom;
        let found = SingleStructure::new(&rom, rom.damping_ratio, 0.0).unwrap().lock_up(1000.0).unwrap();
        let mut scene = scene_source::rotor37_scene_with(rom).unwrap();
        let mut warned = |share: f64| {
            scene.settings.contacts[0].friction = share * found.friction;
            let mut simulation = Simulation::new(&scene).unwrap();
            simulation.initialise(0.0).unwrap();
            simulation.warnings().iter().any(|warning| warning.contains(&format!("µ* = {:.3}", found.friction)))
        };
        assert!(warned(1.05) && !warned(0.95), "{found:?}");
        assert!(found.sense == 0 && (0.01..2.0).contains(&found.friction), "{found:?}");
    }
}
