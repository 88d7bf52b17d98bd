//! Growth of closed sliding contact: growth by the differential equations is reported in one warning; growth added by the step is rejected
//! if it matters.

use super::checking::Checking;
use super::in_range;
use super::known::CheckPart;
use crate::limits::finding::{ClosedContact, ErrorKind, SIGNIFICANT_GROWTH, StepGrowth, WarningKind};
use crate::limits::judged::{self, SetGrowth};
use crate::limits::{self, ContactDirections, Fastest, SlidingContacts, lock_up};
use crate::modes::modal::ModalModel;
use crate::simulation::clock::SAME_STEP;
use tiprub_cosim::persist_fields;

/// A motion whose frequency (rad/s) is below this fraction of its rate grows without oscillation.
const SWINGS: f64 = 0.1;
/// Number of steps checked per octave, and number of octaves from the step at which every mode is resolved well. Longer steps are far
/// beyond the resolution of all modes and are judged by the longest of these.
const PER_OCTAVE: i32 = 4;
const OCTAVES: i32 = 13;

/// Contact that slides in one sense.
#[derive(Debug, Clone, Default)]
pub struct Sense {
    /// Growth by the differential equations.
    grows: Vec<WarningKind>,
    /// Expected step (s).
    expected: f64,
    /// Largest step of each range of step sizes (s), descending, and the growth it adds.
    ranges: Vec<(f64, Option<Added>)>,
}

/// A step (s), and the set of closed nodes to which it adds most growth.
type Looked<'a> = (f64, Option<(&'a [usize], SetGrowth)>);

/// Growth that steps of one range, or shorter ones, add.
#[derive(Debug, Clone)]
struct Added {
    /// Durations of closed contact (s) up to which the scene is accepted, and accepted without a warning.
    allowed: f64,
    quiet: f64,
    growth: Box<StepGrowth>,
}

impl Sense {
    /// Returns the growth for which a step (s) is rejected while contact stays closed for a time (s). Allocates only to reject.
    fn rejected(&self, step: f64, closed: f64) -> Option<Box<StepGrowth>> {
        in_range(&self.ranges, step).filter(|added| closed > added.allowed).map(|added| added.growth.clone())
    }

    /// Rejects a step (s) that adds significant growth while contact stays closed for a time (s).
    ///
    /// # Errors
    /// [`ErrorKind::StepGrowth`] with numbers.
    pub fn check(&self, step: f64, closed: f64) -> Result<(), ErrorKind> {
        self.rejected(step, closed).map_or(Ok(()), |growth| Err(ErrorKind::StepGrowth(growth)))
    }

    /// Returns the warnings for the expected step.
    ///
    /// # Errors
    /// As [`Sense::check`].
    pub fn warnings(&self, closed: f64) -> Result<Vec<WarningKind>, ErrorKind> {
        self.check(self.expected, closed)?;
        let added = in_range(&self.ranges, self.expected).filter(|added| closed > added.quiet);
        Ok(self.grows(closed).chain(added.map(|added| WarningKind::StepGrowth(added.growth.clone()))).collect())
    }

    /// Returns the warnings after a reversal, when the expected step may be rejected only later.
    pub(crate) fn warnings_after_reversal(&self, closed: f64) -> Vec<WarningKind> {
        match self.rejected(self.expected, closed) {
            Some(growth) => vec![WarningKind::ReversedGrowth(growth)],
            None => self.warnings(closed).unwrap_or_default(),
        }
    }

    /// Returns the growth by the differential equations, with the time after which contact opens (s) if contact that closes for a time (s)
    /// opens before flutter matters.
    pub fn grows(&self, closed: f64) -> impl Iterator<Item = WarningKind> {
        self.grows.iter().map(move |kind| {
            let mut kind = kind.clone();
            if let WarningKind::Flutter { motion, opens_after, .. } = &mut kind {
                *opens_after = (motion.rate * closed < SIGNIFICANT_GROWTH.ln()).then_some(closed);
            }
            kind
        })
    }
}

/// The model that grows most at the expected step with some nodes closed, and its growth in continuous time, which does not depend on the
/// step. At other steps only this model is checked: with all nodal diameters of a disk at all steps the check would take a minute.
struct FastestGrowth {
    nodes: Vec<usize>,
    model: usize,
    continuous: Fastest,
    judged: SetGrowth,
}

/// The motion that grows fastest by the differential equations.
struct Flutter {
    found: Fastest,
    nodes: Vec<usize>,
    /// Growth with the mass of the contact nodes, if it was neglected.
    with_mass: Option<Fastest>,
    /// Fraction of the contact displacement that this motion contributes until contact opens.
    share: f64,
}

/// Growth by the differential equations.
#[derive(Default)]
struct Physics {
    flutter: Option<Flutter>,
    /// Smallest friction coefficient at which the tip locks up, the closed nodes, and the fastest growth without oscillation (1/s).
    lock_up: Option<(f64, Vec<usize>)>,
    divergence: f64,
}

impl Physics {
    fn add(&mut self, own: Flutter) {
        // For coupled sectors divergence drifts slowly around the disk, and double roots differ by rounding.
        if own.found.frequency < SWINGS * own.found.rate {
            self.divergence = self.divergence.max(own.found.rate);
        } else if self.flutter.as_ref().is_none_or(|known| own.found.rate > known.found.rate) {
            self.flutter = Some(own);
        }
    }

    fn note_lock_up(&mut self, least: f64, nodes: &[usize]) {
        if self.lock_up.as_ref().is_none_or(|known| least < known.0) {
            self.lock_up = Some((least, nodes.to_vec()));
        }
    }
}

/// Growth of one model while some nodes are closed.
#[derive(Default)]
struct ModelGrowth {
    continuous: Fastest,
    /// Growth without the mass of the contact nodes if `neglects_mass` is true. Otherwise the same as `continuous`, because
    /// the nodes have no mass, or because the scheme makes it irrelevant.
    physical: Fastest,
    neglects_mass: bool,
    /// Fraction of the contact displacement that this motion contributes.
    share: f64,
    /// Smallest friction coefficient at which the tip locks up; infinite if there is none.
    least: f64,
    /// Growth by fixed steps, valid if `is_judged` is true.
    judged: SetGrowth,
    is_judged: bool,
}

persist_fields!(ModelGrowth { continuous, physical, neglects_mass, share, least, judged, is_judged });

/// The set of closed nodes whose growth by a step is largest.
#[derive(Default)]
struct MostGrown {
    /// Index of the set of nodes.
    set: usize,
    judged: SetGrowth,
}

persist_fields!(MostGrown { set, judged });

impl Checking<'_> {
    /// Checks growth of sliding contact in one sense, at the expected step (s) and at all others.
    pub(super) fn sense(&self, sense: usize, expected: f64) -> Sense {
        if self.friction == 0.0 {
            return Sense::default();
        }
        let sign = [1.0, -1.0][sense];
        let (watched, physics) = self.watched(expected, sign);
        let steps = looked_at(self.largest_frequency(), self.parameters.step);
        let compute = |step: f64| {
            let judged = (0..watched.len()).filter_map(|set| Some((set, self.judged(&watched[set], step, sign)?)));
            let (set, judged) = judged.reduce(|known, found| {
                if known.1.within(judged::TOLD) <= found.1.within(judged::TOLD) { known } else { found }
            })?;
            Some(MostGrown { set, judged })
        };
        let most_at = |step: f64| {
            let details = [sense as u64, expected.to_bits(), step.to_bits()];
            let MostGrown { set, judged } = self.known.get(CheckPart::Step, &details, || compute(step))?;
            Some((watched.get(set)?.nodes.as_slice(), judged))
        };
        let looked: Vec<_> = steps.into_iter().map(|step| (step, most_at(step))).collect();
        Sense { ranges: self.added(&looked, sign), ..self.growth(physics, sign, expected) }
    }

    /// Checks growth at the expected step; adaptive steps add none, and nothing has to be watched at other steps.
    fn watched(&self, expected: f64, sign: f64) -> (Vec<FastestGrowth>, Physics) {
        let (mut watched, mut physics) = (Vec::new(), Physics::default());
        let noise = limits::GROWTH_NOISE / self.parameters.step;
        for nodes in self.combinations() {
            let mut most: Option<FastestGrowth> = None;
            for model in 0..self.models.len() {
                let Some(found) = self.set_growth(model, &nodes, sign, expected) else { continue };
                let ModelGrowth { continuous, physical, neglects_mass, share, least, judged, is_judged } = found;
                if physical.rate > noise {
                    let with_mass = neglects_mass.then_some(continuous);
                    physics.add(Flutter { found: physical, nodes: nodes.clone(), with_mass, share });
                }
                if least < self.friction {
                    physics.note_lock_up(least, &nodes);
                }
                if is_judged && most.as_ref().is_none_or(|most| judged.growth.stepped > most.judged.growth.stepped) {
                    most = Some(FastestGrowth { nodes: nodes.clone(), model, continuous, judged });
                }
            }
            watched.extend(most);
        }
        (watched, physics)
    }

    /// Returns the growth of one of the models with some nodes closed, at the expected step (s); `None` if it is not
    /// checked.
    fn set_growth(&self, model: usize, nodes: &[usize], sign: f64, expected: f64) -> Option<ModelGrowth> {
        let numbers = [model as u64, sign.to_bits(), expected.to_bits()].into_iter();
        let details: Vec<u64> = numbers.chain(nodes.iter().map(|node| *node as u64)).collect();
        self.known.get(CheckPart::Set, &details, || self.computed_growth(model, nodes, sign, expected))
    }

    fn computed_growth(&self, model: usize, nodes: &[usize], sign: f64, expected: f64) -> Option<ModelGrowth> {
        let (scheme, friction, largest) = (self.parameters.scheme, self.friction, self.parameters.step);
        let properties = scheme.properties();
        let (seen, directions) = self.closed_at(model, nodes, sign);
        let contacts = SlidingContacts::new(&seen, friction, &directions);
        let continuous = limits::continuous(contacts, scheme, largest)?;
        let without = if properties.quasi_static { None } else { limits::without_node_mass(contacts, largest) };
        let physical = without.unwrap_or(continuous);
        let stepped = || limits::stepped(contacts, scheme, expected, continuous);
        let growth = if properties.adaptive { None } else { stepped() };
        Some(ModelGrowth {
            continuous,
            physical,
            neglects_mass: without.is_some(),
            share: judged::share_of(&seen, &directions, physical.frequency),
            least: lock_up::least_friction(&seen, &directions).unwrap_or(f64::INFINITY),
            judged: growth.map_or_else(SetGrowth::default, |growth| SetGrowth::new(contacts, scheme, expected, growth)),
            is_judged: growth.is_some(),
        })
    }

    fn judged(&self, watched: &FastestGrowth, step: f64, sign: f64) -> Option<SetGrowth> {
        let (seen, directions) = self.closed_at(watched.model, &watched.nodes, sign);
        let (scheme, friction) = (self.parameters.scheme, self.friction);
        let contacts = SlidingContacts::new(&seen, friction, &directions);
        let growth = limits::stepped(contacts, scheme, step, watched.continuous)?;
        Some(SetGrowth::new(contacts, scheme, step, growth))
    }

    /// Returns one of the models observed at closed nodes (at both parts of a nodal diameter), and their directions.
    fn closed_at(&self, model: usize, nodes: &[usize], sign: f64) -> (ModalModel, ContactDirections) {
        let all = self.directions(&self.models[model], sign);
        let own = self.nodes.len();
        let places = (0..all.len() / own).flat_map(|part| nodes.iter().map(move |node| part * own + node));
        let places: Vec<usize> = places.collect();
        (self.models[model].with_nodes(&places), places.iter().map(|place| all[*place]).collect())
    }

    /// Limits of every range, from one checked step to the next: a longer step is rejected or reported whenever a shorter one is. The
    /// checked steps do not depend on the largest step, so that a step is rejected in every scene that also allows longer ones.
    fn added(&self, ranges: &[Looked<'_>], sign: f64) -> Vec<(f64, Option<Added>)> {
        let mut added: Vec<(f64, Option<Added>)> = Vec::new();
        let (mut allowed, mut quiet) = (f64::INFINITY, f64::INFINITY);
        let (mut accepted, mut silent) = (None, None);
        let mut worst: Option<(f64, &[usize], SetGrowth)> = None;
        for (step, found) in ranges.iter().rev() {
            if let Some((nodes, judged)) = found {
                let own = judged.within(judged::TOLD);
                if own < quiet {
                    (quiet, worst) = (own, Some((*step, *nodes, *judged)));
                }
                allowed = allowed.min(judged.allowed());
            }
            if allowed.is_infinite() {
                accepted = Some(*step);
            }
            if quiet.is_infinite() {
                silent = Some(*step);
            }
            let growth = worst.map(|(step, nodes, judged)| {
                Box::new(StepGrowth {
                    contact: self.contact(nodes, sign),
                    step,
                    rates: judged.growth,
                    error: judged.error(f64::INFINITY),
                    accepted,
                    silent,
                })
            });
            let is_longest = added.len() + 1 == ranges.len();
            added.push((
                if is_longest { f64::INFINITY } else { next_step(*step) },
                growth.map(|growth| Added { allowed, quiet, growth }),
            ));
        }
        added.reverse();
        added
    }

    fn contact(&self, nodes: &[usize], sign: f64) -> ClosedContact {
        let nodes: Vec<usize> = nodes.iter().map(|node| self.nodes[*node]).collect();
        let mut frictions: Vec<f64> = nodes.iter().map(|node| self.friction_at(*node)).collect();
        frictions.sort_by(f64::total_cmp);
        frictions.dedup();
        ClosedContact { nodes, all_sectors: self.disk().is_some(), sense: usize::from(sign < 0.0), frictions }
    }

    /// Returns the warnings of growth by the differential equations.
    fn growth(&self, physics: Physics, sign: f64, expected: f64) -> Sense {
        let rate = Some(physics.divergence).filter(|rate| *rate != 0.0);
        let lock_up = physics.lock_up.map(|(friction, nodes)| WarningKind::LockUp {
            contact: self.contact(&nodes, sign),
            friction,
            rate,
        });
        let flutter = physics.flutter.map(|Flutter { found, nodes, with_mass, share }| WarningKind::Flutter {
            contact: self.contact(&nodes, sign),
            motion: found,
            with_mass,
            share,
            opens_after: None,
            tolerance: self.parameters.scheme.properties().adaptive.then_some(self.parameters.tolerance),
        });
        Sense { grows: lock_up.into_iter().chain(flutter).collect(), expected, ranges: Vec::new() }
    }
}

/// Steps at which growth is checked, descending (s): quarters of an octave from the step that resolves every mode well up to the largest,
/// independent of the largest; if that is shorter than all of them, the shortest.
fn looked_at(frequency: f64, largest: f64) -> Vec<f64> {
    let resolved = 0.1 / frequency;
    let top = libm::floor(f64::from(PER_OCTAVE) * libm::log2(largest * (1.0 + SAME_STEP) / resolved));
    #[expect(clippy::cast_possible_truncation, reason = "the range of a step over that of a frequency")]
    let top = top.clamp(0.0, f64::from(PER_OCTAVE * OCTAVES)) as i32;
    (0..=top).rev().map(|place| resolved * libm::exp2(f64::from(place) / f64::from(PER_OCTAVE))).collect()
}

/// End of the range that begins with a checked step: just below the next (s).
fn next_step(step: f64) -> f64 {
    step * libm::exp2(1.0 / f64::from(PER_OCTAVE)) * (1.0 - 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Warning;
    use crate::limits::finding::Subject;
    use crate::limits::wording::Context;
    use tiprub_cosim::warning::Severity;

    #[test]
    fn flutter_is_only_a_note_if_contact_opens_before_growth() {
        let contact = ClosedContact { nodes: vec![0], all_sectors: false, sense: 0, frictions: vec![0.5] };
        let lock_up = WarningKind::LockUp { contact: contact.clone(), friction: 0.4, rate: None };
        let motion = Fastest { rate: 1e3, frequency: 1e4 };
        let flutter = |tolerance| WarningKind::Flutter {
            contact: contact.clone(),
            motion,
            with_mass: None,
            share: 1.0,
            opens_after: None,
            tolerance,
        };
        let sense = Sense { grows: vec![lock_up, flutter(Some(0.01)), flutter(None)], ..Sense::default() };
        // ln 1000 = 6.9 at 1000 1/s.
        for (closed, level) in [(6e-3, Severity::Note), (7e-3, Severity::Warning), (f64::INFINITY, Severity::Warning)] {
            let rendered = |kind: WarningKind| kind.of(Subject::Scene).warning(&Context::default());
            let found: Vec<Warning> = sense.grows(closed).map(rendered).collect();
            assert_eq!(found[0].level(), Severity::Warning, "self-locking is never a note");
            assert_eq!(found[1].level(), level, "{closed} s");
            for text in [&found[1].lines()[1], &*found[1]] {
                assert_eq!(text.contains("No action is needed"), level == Severity::Note, "{text}");
                assert_eq!(text.contains("Use less friction"), level == Severity::Warning, "{text}");
                let is_about_tolerance = text.contains("far below the tolerance of the adaptive steps (0.01)");
                assert_eq!(is_about_tolerance, level == Severity::Warning, "{text}");
            }
            assert!(!found[2].contains("tolerance"), "fixed steps have none: {}", &*found[2]);
        }
    }
}
