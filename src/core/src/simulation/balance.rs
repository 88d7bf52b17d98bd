//! Check of the energy of a run at every communication point, and the messages if it is too large.

use tiprub_cosim::shown_time;
use tiprub_cosim::warning::Topic;

use super::outputs::SetEnergy;
use super::{Simulation, SimulationPhase};
use crate::limits::finding::Subject;
use crate::scene::method::{Scheme, Solver};
use crate::system::Loss;
use crate::system::ledger::Ledger;
use crate::{Error, Result, Warning};

/// The instantaneous energy may exceed the supplied energy by this factor. With modal-exact it is cos²(ωh/2) of the supplied energy, a
/// quarter at ωh = 2π/3, the limit of resolution; with central differences at least 1 − (ωh/2)². Any larger energy is in modes that the
/// step does not resolve.
const ENERGY_FACTOR: f64 = 4.0;
/// Additional fraction of all work exchanged, for rounding.
const ENERGY_SLACK: f64 = 0.01;

/// Curvature work is reported once it is as large as the net work of inputs or of the shaft alone. Users read these net values and not the
/// exchanged magnitudes, and the sign of the net values is then unknown.
const CURVATURE_OF_NET: f64 = 1.0;
/// Curvature work is reported only above this fraction of all exchanged energy: if the net is nearly zero, any error is as large.
const CURVATURE_OF_ALL: f64 = 0.1;

impl Simulation {
    /// Warns of the first curvature work that is large compared with the net work of inputs.
    pub(super) fn note_curvature(&mut self, time: f64) {
        let found = self.system.ledgers().iter().enumerate().find_map(|(set, ledger)| Some((set, misled(ledger)?)));
        let Some((set, (who, work))) = found else { return };
        if !self.diagnostics.reported.is_first(Topic::CurvatureWork, Subject::Scene) {
            return;
        }
        let curvature = self.system.ledgers()[set].curvature_work.value();
        let problem = format!(
            "up to t = {} s, the rotation of contact normals and the curvature of surfaces within internal steps have added \
             {curvature:.3e} J of spurious energy (curvature work){}, compared with {work:.3e} J of net work of {who}: \
             this net work may be wrong by the same amount and may have the wrong sign",
            shown_time(time),
            self.of_set(set)
        );
        self.note(Warning::new(Topic::CurvatureWork, problem, "Use a smaller internal step"));
    }

    /// Checks that vibration has no more energy than forces times velocities have supplied: the energy that the scheme conserves omits the
    /// energy of modes that the step does not resolve. With massless-boundary, quasi-static modes hold energy one step before its work is
    /// known; that scheme has a step limit instead.
    pub(super) fn check_energy(&mut self, time: f64) -> Result<()> {
        let settings = self.system.settings();
        if !settings.ledger || settings.scheme.properties().delays_contact {
            return Ok(());
        }
        let Some(set) = (0..self.outputs.energies.len()).find(|set| !self.has_its_energy(*set)) else { return Ok(()) };
        self.state.clock.phase = SimulationPhase::Failed;
        Err(Error::unstable(
            format!(
                "at t = {} s (last good time {} s) the kinetic and strain energy{} is {:.4e} J, but it was {:.4e} J at \
                 the start and work minus friction and damping losses supplied only {:.4e} J: modes that the internal \
                 step of {:.3e} s does not resolve have gained spurious energy",
                shown_time(time),
                shown_time(self.state.clock.time),
                self.of_set(set),
                self.outputs.energies[set].now,
                self.state.initial_energies[set],
                self.supplied(set),
                self.system.step_size()
            ),
            "Use a smaller internal step (internal_step_max)",
        ))
    }

    /// Returns whether structures that influence each other have no more energy than was supplied to them.
    fn has_its_energy(&self, set: usize) -> bool {
        let step = self.system.step_size();
        let stable_below = self.system.settings().scheme.properties().stable_below;
        let factor = if stable_below.is_finite() {
            let frequency = self.compiled.largest_frequency(self.system.sets().members(set));
            let share = (frequency * step / stable_below).min(1.0 - 1e-9);
            1.0 / (1.0 - share * share)
        } else {
            1.0
        };
        let bound = factor.max(ENERGY_FACTOR) * (self.state.initial_energies[set] + self.supplied(set))
            + ENERGY_SLACK * self.system.ledgers()[set].scale();
        // In a steady phase, the ledger belongs to the starts of the open steps, like the conserved energy.
        let SetEnergy { now, conserved } = self.outputs.energies[set];
        (if self.system.is_in_steady_phase() { conserved } else { now }) <= bound
    }

    /// Returns the energy that forces times velocities have supplied to a set (J).
    fn supplied(&self, set: usize) -> f64 {
        let ledger = &self.system.ledgers()[set];
        ledger.supplied().max(self.outputs.energies[set].conserved - ledger.initial).max(0.0)
    }

    /// Returns problem and remedy if friction or impacts have supplied energy (J).
    pub(super) fn gain_texts(&self, set: usize, loss: Loss, [given, exchanged]: [f64; 2]) -> (String, String) {
        let (of, settings) = (self.of_set(set), self.system.settings());
        match loss {
            Loss::Friction => (
                format!(
                    "friction{of} has added {given:.3e} J to the vibration, out of {exchanged:.3e} J exchanged, \
                     although it can only dissipate: tips vibrate faster than they slide, and this friction law does \
                     not model sticking"
                ),
                self.against_sliding(settings.scheme),
            ),
            Loss::Cutting => (
                format!(
                    "cutting forces{of} have added {given:.3e} J to tips that move backwards, when nothing is cut, \
                     out of {exchanged:.3e} J exchanged: tips vibrate faster than they slide, and the cutting law does \
                     not model sticking"
                ),
                "Use a smaller internal step, a lower `specific_energy`, or a motion in which the tips keep sliding"
                    .to_owned(),
            ),
            Loss::Impact => (
                format!(
                    "impacts{of} have added {given:.3e} J to the vibration, out of {exchanged:.3e} J of contact work, \
                     although they can only dissipate"
                ),
                if !settings.solver.properties().complementary {
                    let [own, other] = [settings.solver, Solver::default()].map(Solver::name);
                    format!("Use solver = \"{other}\", because {own} leaves nodes inside the surface for one step")
                } else if settings.scheme.properties().adaptive {
                    "Use a smaller `tolerance`".to_owned()
                } else if settings.scheme.properties().delays_contact {
                    let other = Scheme::default().name();
                    format!("Use a smaller internal step or more damping, or the scheme {other}")
                } else {
                    "Use a smaller internal step".to_owned()
                },
            ),
        }
    }

    /// Returns the remedy for tips that do not only slide: the law with sticking, if the scene supports it.
    fn against_sliding(&self, scheme: Scheme) -> String {
        let scene = &self.compiled.scene;
        let name = Solver::STICKING.name();
        let sticking = match scene.check_methods(scheme, Solver::STICKING) {
            Ok(()) => format!("Use the solver {name}, "),
            Err(_) if scene.settings.contacts.iter().all(|contact| contact.coating.is_none()) => {
                format!("Set contact.solver = \"{name}\" in the scene, or use ")
            }
            Err(_) => "Use ".to_owned(),
        };
        format!("{sticking}less friction, or a motion in which the tips keep sliding")
    }
}

/// Returns the net work (J) that is misleading because curvature work is large compared with it.
fn misled(ledger: &Ledger) -> Option<(&'static str, f64)> {
    let (all, shaft) = (ledger.external_work(), ledger.shaft_work.value());
    let net = if shaft != 0.0 && shaft.abs() < all.abs() { ("the shaft", shaft) } else { ("all inputs", all) };
    let work = ledger.curvature_work.value().abs();
    (work > CURVATURE_OF_NET * net.1.abs() && work > CURVATURE_OF_ALL * ledger.exchanged()).then_some(net)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curvature_work_is_compared_with_the_net_input_work() {
        let ledger = |shaft: f64, casing: f64, curvature: f64, turnover: f64| {
            let mut ledger = Ledger::default();
            ledger.shaft_work.add(shaft);
            ledger.casing_work.add(casing);
            ledger.curvature_work.add(curvature);
            ledger.turnover.add(turnover);
            ledger
        };
        // Curvature work, though a third of the exchange, decides the sign of the net work.
        assert_eq!(misled(&ledger(-5.85, 0.0, 7.03, 20.0)), Some(("all inputs", -5.85)));
        assert_eq!(misled(&ledger(0.5, 90.0, 15.0, 100.0)), Some(("the shaft", 0.5)));
        // A small error of a large net, and an error that is small compared with the exchange.
        assert_eq!(misled(&ledger(90.0, 0.0, 2.0, 100.0)), None);
        assert_eq!(misled(&ledger(0.01, 0.0, 0.5, 100.0)), None);
    }
}
