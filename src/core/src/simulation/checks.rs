//! Checks of the start of a scene and of its outputs.

use tiprub_cosim::shown_time;
use tiprub_cosim::variables::Causality;
use tiprub_cosim::warning::{Topic, Warning};

use super::Simulation;
use super::compile::Compiled;
use crate::limits::plausibility::{self, Slip};
use crate::{Error, Result};

/// Extension of a surface around an axis ([`crate::geometry::surface_spline::REACH`]), and the remedy for a node beyond it.
pub(crate) const OUT_OF_REACH: &str = "a quarter of the axial extent of the surface, the limit of its extrapolation along the \
                                tangents";
pub(crate) const OUT_OF_REACH_REMEDY: &str = "Use a casing whose contact grid covers the blade tips over their whole range of \
                                       motion, or check axial shift, loads and speed";

impl Compiled {
    /// Returns implausible values of the ROMs and of the scene.
    pub fn slips(&self) -> Vec<Slip> {
        let mut slips = Vec::new();
        for (index, body) in self.bodies.iter().enumerate() {
            let (structure, rom) = self.body(index);
            slips.extend(match &body.disk {
                Some(disk) => {
                    plausibility::of_rom(rom, disk.diameters.iter().flat_map(|one| one.frequencies.iter().copied()))
                }
                None => plausibility::of_rom(rom, body.model.frequencies.iter().copied()),
            });
            slips.extend(plausibility::of_velocity(&structure.name, structure.velocity));
        }
        for carrier in &self.carriers {
            let rom = &self.scene.roms[carrier.structure];
            slips.extend(plausibility::of_rom(rom, carrier.model.frequencies.iter().copied()));
        }
        slips
    }

    /// Returns the implausible value if tips are too fast at a speed (rad/s). Allocates only in this case.
    pub(crate) fn slip_of_speed(&self, body: usize, speed: f64) -> Option<Slip> {
        plausibility::of_speed(self.body(body).1, speed, || {
            let structure = if self.bodies.len() > 1 { format!("{}.", self.body(body).0.name) } else { String::new() };
            format!("`{structure}speed`")
        })
    }

    /// Rejects tips that are implausibly fast at a speed (rad/s), unless the scene accepts them. Allocates only to reject.
    pub(crate) fn check_tip_speed(&self, body: usize, speed: f64) -> Result<()> {
        if self.scene.settings.accept_implausible {
            return Ok(());
        }
        self.slip_of_speed(body, speed).map_or(Ok(()), |slip| Err(slip.error()))
    }

    /// Warns of patches for friction power in a scene without friction.
    pub(crate) fn idle_patches(&self) -> Option<Warning> {
        let settings = &self.scene.settings;
        let rubs = settings.contacts.iter().any(|contact| contact.friction > 0.0);
        let index = settings.surfaces.iter().position(|surface| surface.patches.is_some() && !rubs)?;
        let problem = format!(
            "surface[{}].patches: no contact has friction, so the friction power of all patches is zero",
            index + 1
        );
        Some(Warning::new(Topic::NoFrictionPower, problem, "Set `contact.friction`, or remove the patches"))
    }
}

impl Simulation {
    /// Rejects implausible values, unless the scene accepts them.
    ///
    /// # Errors
    /// The first implausible value, with the key that accepts it.
    pub(super) fn check_slips(&self) -> Result<()> {
        if self.compiled.scene.settings.accept_implausible {
            return Ok(());
        }
        if let Some(slip) = self.compiled.slips().first() {
            return Err(slip.error());
        }
        let mut speeds = self.speeds().into_iter().enumerate();
        speeds.try_for_each(|(body, speed)| self.compiled.check_tip_speed(body, speed))
    }

    /// Checks that the loads and the speed at the start displace the structures by amounts that small displacements can describe.
    pub(super) fn check_initial_state(&self) -> Result<()> {
        let Err(failure) = self.system.check_state() else { return Ok(()) };
        let (problem, _) = self.failure_texts(failure);
        let remedy = "Check the start values of loads, temperatures and speed, and the loads of the ROM; the model assumes \
                      small displacements";
        Err(Error::invalid("initial state", problem, remedy))
    }

    /// Checks that no output is NaN; outputs belong to `time` (s).
    ///
    /// # Errors
    /// An output that is not a number; the error names it. The state must not be used further.
    pub(crate) fn check_outputs(&self, time: f64) -> Result<()> {
        for variable in self.state.values.table().variables().iter().filter(|row| row.causality == Causality::Output) {
            let start = variable.reference as usize;
            let values = &self.state.values[start..start + variable.len()];
            if let Some(element) = values.iter().position(|value| !value.is_finite()) {
                let problem = format!("{} at t = {} s", values[element], shown_time(time));
                let remedy = "Check loads, inputs and the internal step";
                return Err(Error::invalid(format!("output `{}`", variable.element_name(element)), problem, remedy));
            }
        }
        Ok(())
    }

    /// Rejects a start in penetration, which would be an impact of arbitrary strength.
    pub(super) fn check_initial_gaps(&self) -> Result<()> {
        (0..self.compiled.bodies.len()).try_for_each(|body| self.check_initial_gaps_of(body))
    }

    fn check_initial_gaps_of(&self, body: usize) -> Result<()> {
        let structure = &self.system.structures()[body];
        let (gaps, lanes) = (structure.gaps(), structure.modes().lanes());
        let refuse = |problem: String, remedy: &str| Err(Error::invalid("initial clearance", problem, remedy));
        let name = |index: usize| self.compiled.node_name(body, index / lanes);
        if let Some(lost) = gaps.iter().position(|gap| gap.is_nan()) {
            let remedy = "Check the start values of loads and temperatures, which may deform the surface too much, and \
                          check that its contact grid is neither folded nor collapsed to a line";
            return refuse(format!("contact node {} has no closest point on its surface", name(lost)), remedy);
        }
        let own = self.compiled.plan.pairs_of(body).map(|(pair, _)| &self.system.pairs()[pair]);
        if let Some(index) = own.filter_map(|pair| pair.gap().out_of_reach()).next() {
            let problem = format!(
                "contact node {} of sector {} starts beyond the first or last ring of the casing surface by more than \
                 {OUT_OF_REACH}",
                name(index),
                index % lanes + 1
            );
            return refuse(problem, OUT_OF_REACH_REMEDY);
        }
        let deepest = gaps.iter().enumerate();
        let deepest = deepest.fold((0, 0.0), |worst, (index, gap)| if *gap < worst.1 { (index, *gap) } else { worst });
        if deepest.1 >= 0.0 {
            return Ok(());
        }
        let (touching, node) = (gaps.iter().filter(|gap| **gap < 0.0).count(), name(deepest.0));
        if self.compiled.bodies[body].translations.is_some() {
            let remedy = "Move one of the structures, because gaps follow from the contact positions in the ROMs; \
                          check that the normal of each contact grid (direction from row to row x direction along the rows) points to the master";
            let problem = format!(
                "{touching} contact nodes start inside the surfaces, with a maximum depth of {:.3e} m at {node}",
                -deepest.1
            );
            return refuse(problem, remedy);
        }
        let problem = format!(
            "{touching} contact nodes start inside the casing, with a maximum depth of {:.3e} m at {node} of sector {}",
            -deepest.1,
            deepest.0 % lanes + 1
        );
        refuse(
            problem,
            "Enlarge the gap, ramp up the casing shape with ramp_time (casing_ramp_time), start at another rotor \
             angle, or change the start values of loads, temperatures and the inputs that move the casing and the shaft",
        )
    }
}
