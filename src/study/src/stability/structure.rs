//! One structure with contact closed and sliding on a round casing: growth rates, what can be solved, and the internal step of each
//! scheme below which all are accepted, sought with the very checks of the core. Longer ones may be accepted too: growth by friction
//! comes in bands.

use nalgebra::{DMatrix, Schur};
use tiprub_core::{
    Result, Rom,
    dynamics::{cyclic::CyclicModel, modal::ModalModel},
    rom::Frame,
    settings::Scheme,
    shown,
    stability::{self, ContactDirections, Growth, massless::MasslessCheck},
};

use super::seek::{Sought, TRIED, seek};

/// Contact nodes up to this number are closed in every combination; of more, each alone, neighbours, and all.
const ALL_COMBINATIONS_UP_TO: usize = 3;
/// Friction coefficients for which solvability is tried, ascending.
const FRICTION_STEPS: u32 = 40;
const FRICTION_STEPS_PER_UNIT: f64 = 20.0;

/// What is known of the contact from a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sliding {
    /// Friction coefficient µ.
    pub friction: f64,
    /// Speed at the start (rad/s), whose sign is the sense of slip; both senses where it is 0.
    pub speed: f64,
}

impl Sliding {
    /// Senses of slip: 0 along +θ, 1 along −θ.
    fn senses(&self) -> impl Iterator<Item = usize> + use<> {
        let slides = [self.speed >= 0.0, self.speed <= 0.0];
        (0..2).filter(move |sense| slides[*sense])
    }
}

/// How far a scheme goes.
#[derive(Debug, Clone, PartialEq)]
pub enum Limit {
    /// Steps below this (s) are accepted.
    Below(f64),
    /// Nothing is refused, tried up to this step (s).
    Tried(f64),
    /// The scheme is refused at any step.
    Refused(String),
}

/// Limit of one scheme.
#[derive(Debug, Clone, PartialEq)]
pub struct StepLimit {
    /// Name as in a scene.
    pub scheme: &'static str,
    /// How far it goes.
    pub limit: Limit,
}

impl StepLimit {
    /// For people.
    pub fn to_text(&self) -> String {
        match &self.limit {
            Limit::Below(step) => format!("{step:.4e} s"),
            Limit::Tried(step) => format!("none found up to {step:.1e} s"),
            Limit::Refused(why) => format!("refused: {why}"),
        }
    }

    /// The limit (s), where there is one.
    pub fn below(&self) -> Option<f64> {
        match self.limit {
            Limit::Below(step) => Some(step),
            _ => None,
        }
    }
}

/// How closed sliding contact grows, of all sets of closed nodes the one that grows most.
#[derive(Debug, Clone, PartialEq)]
pub struct Rates {
    /// Growth of the equations and of the scheme's steps.
    pub growth: Growth,
    /// Frequency of what grows by itself (Hz); where nothing flutters, none.
    pub frequency: Option<f64>,
    /// Names of the closed nodes, of coupled sectors with the nodal diameter.
    pub closed: String,
}

/// A structure by itself.
#[derive(Debug)]
pub struct Structure<'a> {
    rom: &'a Rom,
    /// Its sector, or all nodal diameters of coupled sectors.
    pub models: Vec<ModalModel>,
    /// Natural angular frequencies (rad/s) of every nodal diameter of coupled sectors, from 0; else of the sector.
    pub frequencies: Vec<Vec<f64>>,
    /// Normal and slip direction of all contact nodes for slip in +θ and −θ.
    closed: [ContactDirections; 2],
}

impl<'a> Structure<'a> {
    /// The structure with a damping ratio, its modes at a speed (rad/s) that stiffens it, 0 where it does not.
    ///
    /// # Errors
    /// A ROM whose eigenproblem cannot be solved.
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

    /// Of mistuned blades, the one with the highest frequencies: all times `factor`.
    pub fn stiffened(mut self, factor: f64) -> Self {
        let models = self.models.iter_mut().flat_map(|model| &mut model.frequencies);
        models.chain(self.frequencies.iter_mut().flatten()).for_each(|frequency| *frequency *= factor);
        self
    }

    /// Normals straight inwards, whatever the slope of the contour.
    pub fn radial(mut self) -> Self {
        self.closed.iter_mut().flatten().for_each(|(normal, _)| *normal = [-1.0, 0.0, 0.0]);
        self
    }

    /// Highest angular frequency (rad/s).
    pub fn highest(&self) -> f64 {
        self.models.iter().map(ModalModel::largest_frequency).fold(0.0, f64::max)
    }

    /// Growth of sliding contact: of all sets of closed nodes and senses that of the largest rate of the steps. `None` without
    /// friction, and where it cannot be told.
    pub fn rates(&self, scheme: Scheme, step: f64, sliding: Sliding) -> Option<Rates> {
        let mut most: Option<(Growth, usize, Vec<usize>, usize)> = None;
        for sense in sliding.senses() {
            for nodes in self.combinations() {
                for model in 0..self.models.len() {
                    let Some(found) = self.growth_of(model, &nodes, sense, scheme, step, sliding.friction) else {
                        continue;
                    };
                    if most.as_ref().is_none_or(|most| found.stepped > most.0.stepped) {
                        most = Some((found, model, nodes.clone(), sense));
                    }
                }
            }
        }
        let (growth, model, nodes, sense) = most?;
        let seen = growth.is_flutter().then(|| self.seen(model, &nodes, sense));
        let frequency = seen.and_then(|(model, directions)| flutter_frequency(&model, sliding.friction, &directions));
        let names: Vec<&str> = nodes.iter().map(|node| self.rom.contact_nodes[*node].name.as_str()).collect();
        let diameter = if self.rom.is_cyclic() { format!(", nodal diameter {model}") } else { String::new() };
        Some(Rates { growth, frequency, closed: format!("{}{diameter}", names.join(", ")) })
    }

    /// One model and the directions of nodes closed on it: of both parts of a nodal diameter.
    fn seen(&self, model: usize, nodes: &[usize], sense: usize) -> (ModalModel, ContactDirections) {
        let (model, own) = (&self.models[model], self.rom.contact_nodes.len());
        let copies = model.contact_modes.nrows() / (3 * own);
        let places: Vec<usize> = (0..copies).flat_map(|part| nodes.iter().map(move |node| part * own + node)).collect();
        let directions = places.iter().map(|place| self.closed[sense][place % own]).collect();
        (model.with_nodes(&places), directions)
    }

    fn growth_of(
        &self,
        model: usize,
        nodes: &[usize],
        sense: usize,
        scheme: Scheme,
        step: f64,
        friction: f64,
    ) -> Option<Growth> {
        let (model, directions) = self.seen(model, nodes, sense);
        stability::growth(&model, scheme, step, friction, &directions)
    }

    /// Sets of contact nodes that are closed: all of a few; of many every one alone, neighbours, and all; of coupled sectors every
    /// one alone and all.
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

    /// Limits of every scheme; `sliding` is the contact where it is known. With coupled sectors, growth by friction is left to the
    /// scene.
    pub fn step_limits(&self, sliding: Option<Sliding>) -> Vec<StepLimit> {
        let sliding = sliding.unwrap_or(Sliding { friction: 0.0, speed: 0.0 });
        // A Cartesian ROM flies freely or stands still, where massless-boundary is not made or not asked for.
        let massless = self.rom.frame != Frame::Cartesian;
        let schemes = Scheme::RECURRENCES.into_iter().filter(|scheme| massless || *scheme != Scheme::MasslessBoundary);
        schemes.map(|scheme| StepLimit { scheme: scheme.name(), limit: self.limit(scheme, sliding) }).collect()
    }

    fn limit(&self, scheme: Scheme, sliding: Sliding) -> Limit {
        let [low, high] = TRIED.map(|product| product / self.highest());
        let usable = match self.massless(scheme, high) {
            Ok(usable) => usable.min(self.resolved(scheme)),
            Err(why) => return Limit::Refused(why),
        };
        let accepted = |step: f64| step < usable && self.accepts(scheme, step, sliding);
        // Where nothing else stands in the way the limit is known.
        let exact = if scheme == Scheme::CentralDifference { 2.0 / self.highest() } else { usable };
        match seek([low, high], Some(exact), |step| if accepted(step) { Ok(()) } else { Err(()) }) {
            Sought::All(step) => Limit::Tried(step),
            Sought::Below(step, ()) => Limit::Below(step),
            Sought::None(()) => {
                let step = shown((low * 1e9).round() / 1e9);
                Limit::Refused(format!("a step of {step} s is refused, at which every mode is resolved"))
            }
        }
    }

    /// Steps of modal-exact below which it does not pass over what contact acts on (s); infinite for other schemes.
    fn resolved(&self, scheme: Scheme) -> f64 {
        if scheme != Scheme::ModalExact {
            return f64::INFINITY;
        }
        let limit = |model: &ModalModel| match self.rom.frame {
            Frame::Cartesian => stability::unresolved::limit_along_axes(model),
            Frame::Cylindrical => {
                stability::unresolved::limit(model, &vec![[-1.0, 0.0, 0.0]; model.contact_modes.nrows() / 3])
            }
        };
        self.models.iter().map(limit).fold(f64::INFINITY, f64::min)
    }

    /// Usable step of massless-boundary (s); infinite for other schemes.
    fn massless(&self, scheme: Scheme, largest: f64) -> Result<f64, String> {
        if scheme != Scheme::MasslessBoundary {
            return Ok(f64::INFINITY);
        }
        let mut usable = f64::INFINITY;
        for model in &self.models {
            if model.dynamic_modes(scheme) == 0 {
                return Err("it makes three modes per contact node quasi-static, and none is left".to_owned());
            }
            let copies = model.contact_modes.nrows() / (3 * self.rom.contact_nodes.len());
            let normals = self.closed[0].repeat(copies).into_iter().map(|(normal, _)| normal).collect();
            let check = MasslessCheck { model, normals, slaves: Vec::new() };
            usable = usable.min(check.limit(largest).map_err(|error| error.to_string())?.usable);
        }
        Ok(usable)
    }

    fn accepts(&self, scheme: Scheme, step: f64, sliding: Sliding) -> bool {
        if stability::check_step_allowed(self.highest(), scheme, step).is_err() {
            return false;
        }
        if sliding.friction == 0.0 || self.rom.is_cyclic() {
            return true;
        }
        let grows = |nodes: &Vec<usize>, sense: usize| {
            let found = self.growth_of(0, nodes, sense, scheme, step, sliding.friction);
            found.is_some_and(|found| found.is_added())
        };
        self.combinations().iter().all(|nodes| !sliding.senses().any(|sense| grows(nodes, sense)))
    }

    /// Largest friction coefficient (in steps of 0.05, up to 2) for which the contact problem with all nodes of one sector closed
    /// has a unique solution at h = 1/ω_max, for slip in both directions; `None` if not even for 0.
    ///
    /// A Cartesian ROM does not say where the other body is: what can be solved is checked with the scene.
    pub fn solvable_friction(&self) -> Option<f64> {
        if self.rom.frame == Frame::Cartesian {
            return None;
        }
        let step = 1.0 / self.highest();
        // Real and imaginary parts of a nodal diameter are contacts of their own.
        let copies = |model: &ModalModel| model.contact_modes.nrows() / (3 * self.rom.contact_nodes.len());
        let of = |model: &ModalModel| self.closed.iter().map(|sense| sense.repeat(copies(model))).collect();
        let together: Vec<Vec<ContactDirections>> = self.models.iter().map(of).collect();
        let solvable = |friction: f64| {
            if self.rom.is_cyclic() {
                stability::check_solvable_together(&self.models, Scheme::ModalExact, step, friction, &together).is_ok()
            } else {
                stability::check_solvable(&self.models[0], Scheme::ModalExact, step, friction, &self.closed).is_ok()
            }
        };
        let tried = (0..=FRICTION_STEPS).map(|step| f64::from(step) / FRICTION_STEPS_PER_UNIT);
        tried.take_while(|friction| solvable(*friction)).last()
    }
}

/// Normal and slip direction of every contact node against a round casing: inwards along the contour's normal, and
/// along ±θ.
fn closed_contacts(rom: &Rom, slip_sign: f64) -> ContactDirections {
    let directions = rom.contact_nodes.iter().map(|node| {
        let length = node.meridional_slope.hypot(1.0);
        let normal = [-1.0 / length, 0.0, node.meridional_slope / length];
        (normal, [0.0, slip_sign, 0.0])
    });
    directions.collect()
}

/// Frequency (Hz) of the motion that grows fastest while all contacts of `directions` are closed and slide: the equations
/// q̈ = −P(ω²q + 2ξωq̇) with P = I − F(NᵀF)⁻¹Nᵀ on the null space of the normals N, F = N − µT (see [`stability::growth`], which
/// tells the rate and not the frequency).
pub fn flutter_frequency(model: &ModalModel, friction: f64, directions: &ContactDirections) -> Option<f64> {
    let (rate, angular) = fastest(model, friction, directions)?;
    (rate.is_finite() && angular.is_finite()).then_some(angular / std::f64::consts::TAU)
}

/// Rate (1/s) and angular frequency (rad/s) of the fastest-growing motion.
fn fastest(model: &ModalModel, friction: f64, directions: &ContactDirections) -> Option<(f64, f64)> {
    let (modes, nodes) = (model.len(), directions.len());
    let seen = |node: usize, mode: usize, along: [f64; 3]| -> f64 {
        (0..3).map(|i| along[i] * model.contact_modes[(3 * node + i, mode)]).sum()
    };
    let normals = DMatrix::from_fn(modes, nodes, |mode, node| seen(node, mode, directions[node].0));
    let slips = DMatrix::from_fn(modes, nodes, |mode, node| seen(node, mode, directions[node].1));
    let forces = &normals - slips * friction;
    let reaction = &forces * (normals.transpose() * &forces).try_inverse()? * normals.transpose();
    // What stays of the motion once the normals are held: the null space of their projector.
    let range = normals.qr().q();
    let held = (&range * range.transpose()).symmetric_eigen();
    let free: Vec<usize> = (0..modes).filter(|column| held.eigenvalues[*column] < 0.5).collect();
    let tangent = held.eigenvectors.select_columns(&free);
    let projected = tangent.transpose() * (DMatrix::identity(modes, modes) - reaction);
    // Time in units of the highest frequency.
    let unit = 1.0 / model.largest_frequency();
    let scaled = |value: &dyn Fn(usize) -> f64| {
        &projected * DMatrix::from_fn(modes, free.len(), |mode, column| value(mode) * tangent[(mode, column)])
    };
    let omega = |mode: usize| model.frequencies[mode] * unit;
    let count = free.len();
    let mut flow = DMatrix::zeros(2 * count, 2 * count);
    flow.view_mut((0, count), (count, count)).fill_with_identity();
    flow.view_mut((count, 0), (count, count)).copy_from(&scaled(&|mode| -omega(mode) * omega(mode)));
    flow.view_mut((count, count), (count, count))
        .copy_from(&scaled(&|mode| -2.0 * model.damping_ratios[mode] * omega(mode)));
    let values = Schur::try_new(flow, f64::EPSILON, 200 * count)?.complex_eigenvalues();
    let most = values.iter().max_by(|a, b| a.re.total_cmp(&b.re))?;
    Some((most.re / unit, most.im.abs() / unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The model of the core's own test, whose rate of 178.516 1/s NumPy confirms; the frequency by hand lies between those of the
    /// two modes that friction couples.
    #[test]
    fn the_frequency_belongs_to_the_rate_of_the_core() {
        let shapes = [[-0.1, -0.5, 0.0], [-0.3, 1.0, 0.0], [0.9, -0.8, 0.0]];
        let model = ModalModel {
            frequencies: vec![1000.0, 1050.0, 5000.0],
            damping_ratios: vec![0.0; 3],
            contact_modes: DMatrix::from_fn(3, 3, |row, mode| shapes[mode][row]),
            shapes: DMatrix::identity(3, 3),
            quasi_static: 0,
        };
        let closed = vec![([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0])];
        let core = stability::growth(&model, Scheme::ModalExact, 1e-6, 0.4, &closed).unwrap();
        let (rate, angular) = fastest(&model, 0.4, &closed).unwrap();
        assert!((rate / core.continuous - 1.0).abs() < 1e-6, "{rate} {core:?}");
        let own = flutter_frequency(&model, 0.4, &closed).unwrap();
        assert!((own * std::f64::consts::TAU / angular - 1.0).abs() < 1e-12);
        assert!((1000.0..1400.0).contains(&angular), "{angular}");
    }
}
