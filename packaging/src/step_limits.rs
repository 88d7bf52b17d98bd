//! Internal step of each scheme with one structure below which all are accepted, sought with the very checks that refuse
//! steps. Longer ones may be accepted too: growth by friction comes in bands.

use tiprub_core::{
    Rom,
    dynamics::modal::ModalModel,
    rom::Frame,
    settings::Scheme,
    shown,
    stability::{self, ContactDirections, massless::MasslessCheck},
};

/// Steps tried, times the highest angular frequency: from where every mode is resolved well to far beyond.
const TRIED: [f64; 2] = [0.1, 1e3];
/// Halvings of the interval between a step that is accepted and one that is not.
const HALVINGS: u32 = 7;
/// Contact nodes up to this number are closed in every combination; of more, each alone, neighbours, and all.
const ALL_COMBINATIONS_UP_TO: usize = 3;

/// What is known of the contact from a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sliding {
    /// Friction coefficient µ.
    pub friction: f64,
    /// Speed at the start (rad/s), whose sign is the sense of slip; both senses where it is 0.
    pub speed: f64,
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

/// Limits of every scheme for a structure whose `models` are its sector, or all nodal diameters of coupled sectors; `sliding`
/// is its contact where it is known. With coupled sectors, growth by friction is left to the scene. `closed` are the
/// directions of all contact nodes for slip in +θ and −θ.
pub fn step_limits(
    rom: &Rom,
    models: &[ModalModel],
    sliding: Option<Sliding>,
    closed: &[ContactDirections; 2],
) -> Vec<StepLimit> {
    let sliding = sliding.unwrap_or(Sliding { friction: 0.0, speed: 0.0 });
    let seeker = Seeker { rom, models, sliding, closed };
    // A Cartesian ROM flies freely or stands still, where massless-boundary is not made or not asked for.
    let massless = rom.frame != Frame::Cartesian;
    let schemes = Scheme::ALL.into_iter().filter(|scheme| massless || *scheme != Scheme::MasslessBoundary);
    schemes.map(|scheme| StepLimit { scheme: scheme.name(), limit: seeker.limit(scheme) }).collect()
}

struct Seeker<'a> {
    rom: &'a Rom,
    models: &'a [ModalModel],
    sliding: Sliding,
    closed: &'a [ContactDirections; 2],
}

impl Seeker<'_> {
    fn highest(&self) -> f64 {
        self.models.iter().map(ModalModel::largest_frequency).fold(0.0, f64::max)
    }

    fn limit(&self, scheme: Scheme) -> Limit {
        let [low, high] = TRIED.map(|product| product / self.highest());
        let usable = match self.massless(scheme, high) {
            Ok(usable) => usable.min(self.resolved(scheme)),
            Err(why) => return Limit::Refused(why),
        };
        let accepted = |step: f64| step < usable && self.accepts(scheme, step);
        let (mut good, mut bad) = (0.0, low);
        while accepted(bad) {
            if bad >= high {
                return Limit::Tried(high);
            }
            (good, bad) = (bad, (2.0 * bad).min(high));
        }
        if good == 0.0 {
            let step = shown((low * 1e9).round() / 1e9);
            return Limit::Refused(format!("a step of {step} s is refused, at which every mode is resolved"));
        }
        // Where nothing else stands in the way the limit is known.
        let exact = if scheme == Scheme::CentralDifference { 2.0 / self.highest() } else { usable };
        if good < exact && exact <= bad && accepted(exact * (1.0 - 1e-6)) {
            return Limit::Below(exact);
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (good + bad);
            *(if accepted(middle) { &mut good } else { &mut bad }) = middle;
        }
        Limit::Below(good)
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
        for model in self.models {
            if model.dynamic_modes(scheme) == 0 {
                return Err("it makes three modes per contact node quasi-static, and none is left".to_owned());
            }
            let copies = model.contact_modes.nrows() / (3 * self.rom.contact_nodes.len());
            let normals = self.closed[0].repeat(copies).into_iter().map(|(normal, _)| normal).collect();
            let check = MasslessCheck { model, normals, slave: None };
            usable = usable.min(check.limit(largest).map_err(|error| error.to_string())?.usable);
        }
        Ok(usable)
    }

    fn accepts(&self, scheme: Scheme, step: f64) -> bool {
        if stability::check_step_allowed(self.highest(), scheme, step).is_err() {
            return false;
        }
        let [model] = self.models else { return true };
        let Sliding { friction, speed } = self.sliding;
        if friction == 0.0 || self.rom.is_cyclic() {
            return true;
        }
        self.combinations().iter().all(|nodes| {
            let seen = model.with_nodes(nodes);
            let senses = self.closed.iter().zip([speed >= 0.0, speed <= 0.0]).filter(|(_, slides)| *slides);
            senses.into_iter().all(|(closed, _)| {
                let directions = nodes.iter().map(|node| closed[*node]).collect();
                let found = stability::growth(&seen, scheme, step, friction, &directions);
                found.is_none_or(|found| !found.is_added())
            })
        })
    }

    fn combinations(&self) -> Vec<Vec<usize>> {
        let nodes = self.rom.contact_nodes.len();
        if nodes <= ALL_COMBINATIONS_UP_TO {
            let members = |set: usize| (0..nodes).filter(|node| set >> node & 1 == 1).collect();
            return (1..1 << nodes).map(members).collect();
        }
        let alone = (0..nodes).map(|node| vec![node]);
        alone.chain((1..nodes).map(|node| vec![node - 1, node])).chain([(0..nodes).collect()]).collect()
    }
}
