//! Effects on blades other than contact: excitation by an engine order, heat, initial motion.

use nalgebra::DVector;
use tiprub_cosim::{shown, shown_time};

use super::compile::{Compiled, CompiledBody};
use super::drive::Input;
use super::{Quantity, Simulation};
use crate::modes::bank::{BankOptions, ModalBank};
use crate::modes::excitation::{Excitation, most_moved};
use crate::modes::modal::{ModalModel, ModalSpin};
use crate::scene::method::Scheme;
use crate::scene::ranges::SOFTENED;
use crate::scene::rom::WatchedPoints;
use crate::scene::settings::{InitialSettings, StructureSettings};
use crate::{Error, Result, Rom};

/// Modal load per kelvin of coupled sectors, on nodal diameter 0; empty if the scene does not heat them.
pub(crate) fn disk_heat(structure: &StructureSettings, rom: &Rom, model: &ModalModel) -> Vec<f64> {
    let Some(load) = whole_load(structure, rom).filter(|_| rom.is_cyclic()) else { return Vec::new() };
    let all = libm::sqrt(crate::math::real(rom.sectors));
    model.modal_load(&load).into_iter().map(|load| all * load).collect()
}

/// Load on the reduced coordinates per kelvin of a heated structure with one uniform temperature (N/K).
fn whole_load(structure: &StructureSettings, rom: &Rom) -> Option<Vec<f64>> {
    let thermal = rom.extras.thermal.as_ref().filter(|_| structure.thermal)?;
    Some(thermal.loads.row_iter().map(|row| row.iter().sum()).collect())
}

/// Free expansion K⁻¹f of uncoupled blades per kelvin, in coordinates of the modes of `model` at this temperature (K); empty if the scene
/// does not heat them. Free expansion strains only constrained parts, so it is the same at every speed and temperature.
///
/// # Errors
/// Stiffening of an unconstrained blade, which has no free expansion.
pub fn expansion(structure: &StructureSettings, rom: &Rom, model: &ModalModel, temperature: f64) -> Result<Vec<f64>> {
    let Some(load) = whole_load(structure, rom).filter(|_| !rom.is_cyclic()) else { return Ok(Vec::new()) };
    if !structure.spin.stiffening {
        let left = softened(structure, temperature);
        let modes = model.modal_load(&load).into_iter().zip(&model.frequencies);
        return Ok(modes.map(|(load, w)| if *w > 0.0 { left * load / (w * w) } else { 0.0 }).collect());
    }
    let held = rom.stiffness.clone().cholesky().ok_or_else(|| {
        let remedy = "Use a ROM with a clamped root, or leave out `thermal` or `spin.stiffening`";
        let problem = "not positive definite: an unconstrained structure has no static thermal expansion";
        Error::invalid("ROM array `stiffness`", problem, remedy)
    })?;
    Ok(model.modal_load((&rom.mass * held.solve(&DVector::from_vec(load))).as_slice()))
}

/// Static stress of the full model at the places of `stress` beyond that of the reduced coordinates, by heat (Pa/K) and by growth (Pa s²):
/// 6·places values each, none if the scene has no such load. The modes do not represent all of a load that acts in the whole blade; the
/// remaining stress is static.
///
/// # Errors
/// ROM without modes.
pub fn static_stress(
    structure: &StructureSettings,
    rom: &Rom,
    stress: &WatchedPoints,
    body: &CompiledBody,
) -> Result<(Vec<f64>, Vec<f64>)> {
    let beyond = |whole: DVector<f64>, modes: DVector<f64>| (whole - modes).as_slice().to_vec();
    let heat = rom.extras.stress_thermal.as_ref().filter(|_| structure.thermal);
    let heat = heat.map(|heat| beyond(heat.column_sum(), &body.stress * DVector::from_column_slice(&body.expansion)));
    let spin = rom.extras.spin.as_ref().filter(|_| structure.spin.growth);
    let growth = rom.extras.stress_centrifugal.as_ref().zip(spin).map(|(growth, spin)| {
        // The modes at rest, to which the static stress refers.
        let modes = ModalModel::from_rom(rom, 0.0)?;
        let load = modes.modal_load(&spin.centrifugal_load).into_iter().zip(&modes.frequencies);
        let moved = load.map(|(load, w)| if *w > 0.0 { load / (w * w) } else { 0.0 });
        let moved = &modes.shapes * DVector::from_iterator(modes.len(), moved);
        Ok::<_, Error>(beyond(growth.column_sum(), &stress.map * moved))
    });
    Ok((heat.unwrap_or_default(), growth.transpose()?.unwrap_or_default()))
}

/// Fraction of the elastic stiffness that remains at a temperature (K).
pub fn softened(structure: &StructureSettings, temperature: f64) -> f64 {
    1.0 - structure.softening * temperature
}

impl Compiled {
    /// Fills in the modal loads of blades by growth, and of coupled sectors by heat.
    pub(crate) fn fill_loads(&self, body: usize, speed: f64, temperature: f64, loads: &mut [f64]) {
        let parts = &self.bodies[body];
        if parts.centrifugal.is_empty() {
            loads.fill(0.0);
        } else {
            super::loads::fill_centrifugal(&parts.centrifugal, speed, loads);
        }
        loads.iter_mut().zip(&parts.disk_heat).for_each(|(load, heat)| *load += temperature * heat);
    }

    /// Puts blades into equilibrium with growth and heat.
    pub fn settle(&self, body: usize, speed: f64, temperature: f64, modes: &mut ModalBank) {
        let mut load = vec![0.0; self.bodies[body].model.len()];
        self.fill_loads(body, speed, temperature, &mut load);
        modes.settle(&load);
        modes.settle_expansion(temperature);
    }

    /// Returns whether blades are loaded by growth or heat.
    pub(crate) fn loads_blades(&self, body: usize) -> bool {
        let parts = &self.bodies[body];
        [parts.centrifugal.is_empty(), parts.disk_heat.is_empty(), parts.expansion.is_empty()].contains(&false)
    }

    /// Factor on the elastic stiffness of a sector at a temperature (K): the square of its mistuning factor times the softening factor.
    pub(crate) fn stiffness_factor(&self, body: usize, sector: usize, temperature: f64) -> f64 {
        let structure = self.body(body).0;
        let factor = structure.frequency_factors.get(sector).copied().unwrap_or(1.0);
        factor * factor * softened(structure, temperature)
    }

    /// Returns the excitation of a structure, applied to its ROM.
    ///
    /// # Errors
    /// Mode or contact node that the structure does not have.
    pub fn excitation(&self, body: usize) -> Result<Option<Excitation>> {
        let (structure, rom) = self.body(body);
        let Some(asked) = &structure.excitation else { return Ok(None) };
        let at = format!("structure[{}].excitation", self.plan.bodies[body] + 1);
        if let Some(mode) = asked.mode {
            self.check_mode(body, &format!("{at}.mode"), mode, self.fewest_modes(body, None))?;
        }
        let row = |(name, direction): (&String, crate::scene::settings::ForceDirection)| {
            let node = rom.contact_nodes.iter().position(|node| node.name == *name);
            let names: Vec<&str> = rom.contact_nodes.iter().map(|node| node.name.as_str()).collect();
            let unknown = || {
                let problem = format!("`{name}` is not a contact node of the ROM");
                Error::invalid(format!("{at}.node"), problem, format!("Use one of: {}", names.join(", ")))
            };
            node.map(|node| 3 * node + direction as usize).ok_or_else(unknown)
        };
        let row = asked.node.as_ref().zip(asked.direction).map(row).transpose()?;
        Ok(Some(Excitation { order: asked.order, mode: asked.mode.map(|mode| mode - 1), row }))
    }

    /// Returns the number of modes of a structure, at the nodal diameter with the fewest; only modes with inertia if a scheme is given.
    fn fewest_modes(&self, body: usize, scheme: Option<Scheme>) -> usize {
        let parts = &self.bodies[body];
        let uncoupled = || scheme.map_or(parts.model.len(), |scheme| parts.model.dynamic_modes(scheme));
        let of_disk = parts.disk.as_ref().and_then(|disk| {
            let count = |one: &crate::modes::cyclic::DiameterModes| {
                scheme.map_or(one.len(), |scheme| one.dynamic_modes(scheme))
            };
            disk.diameters.iter().map(count).min()
        });
        of_disk.unwrap_or_else(uncoupled)
    }

    fn check_mode(&self, body: usize, field: &str, mode: usize, most: usize) -> Result<()> {
        if mode <= most {
            return Ok(());
        }
        let problem = format!("mode {mode}, but `{}` has only {most} dynamic modes", self.body(body).0.name);
        Err(Error::invalid(field, problem, "Use a lower mode, or a ROM with more modes"))
    }

    /// Checks lists of modes, sectors and nodal diameters against the ROM.
    ///
    /// # Errors
    /// An invalid list; the error names the field.
    pub(crate) fn check_blades(&self) -> Result<()> {
        for (number, (structure, rom)) in self.scene.settings.structures.iter().zip(&self.scene.roms).enumerate() {
            let (listed, most) = (structure.damping_ratios.len(), rom.order());
            if listed > most {
                let problem = format!("{listed} values, but the ROM has only {most} modes");
                let remedy = "Give at most one value per mode, lowest mode first";
                return Err(Error::invalid(format!("structure[{}].damping_ratios", number + 1), problem, remedy));
            }
        }
        (0..self.bodies.len()).try_for_each(|body| {
            self.excitation(body)?;
            let (structure, rom) = self.body(body);
            let check = |(index, one): (usize, &InitialSettings)| {
                let at = format!("structure[{}].initial[{}]", self.plan.bodies[body] + 1, index + 1);
                self.check_mode(body, &format!("{at}.mode"), one.mode, self.fewest_modes(body, None))?;
                let remedy = "Use a value within the range of the ROM";
                if let Some(sector) = one.sector.filter(|sector| *sector > rom.sectors) {
                    let problem = format!("sector {sector}, but the ROM has only {} sectors", rom.sectors);
                    return Err(Error::invalid(format!("{at}.sector"), problem, remedy));
                }
                if let Some(n) = one.nodal_diameter.filter(|n| *n > rom.largest_nodal_diameter()) {
                    let largest = rom.largest_nodal_diameter();
                    let problem = format!("{n}, but {} sectors have nodal diameters 0 to {largest} only", rom.sectors);
                    return Err(Error::invalid(format!("{at}.nodal_diameter"), problem, remedy));
                }
                Ok(())
            };
            structure.initial.iter().enumerate().try_for_each(check)
        })
    }

    /// Rejects temperatures (K) at which a structure has no stiffness.
    ///
    /// # Errors
    /// A temperature out of range; the error names the variable.
    pub(crate) fn check_temperature(&self, body: usize, temperature: f64) -> Result<()> {
        let structure = self.body(body).0;
        let left = softened(structure, temperature);
        if (SOFTENED[0]..=SOFTENED[1]).contains(&left) {
            return Ok(());
        }
        Err(Error::invalid(
            format!("variable `{}rotor_temperature`", self.plan.body_prefix(&self.scene, body)),
            format!(
                "{} K with softening {} 1/K multiplies the stiffness by {}, outside the range {} to {}",
                shown(temperature),
                shown(structure.softening),
                shown(left),
                shown(SOFTENED[0]),
                shown(SOFTENED[1])
            ),
            "Use a lower temperature or less softening",
        ))
    }

    /// Returns the options of the modes of a master, contact aside.
    pub(crate) fn bank_options(&self, body: usize, excitation: Option<Excitation>) -> BankOptions {
        let ((structure, rom), parts) = (self.body(body), &self.bodies[body]);
        let coupled = structure.spin.stiffening || structure.spin.coriolis;
        let spin = rom.extras.spin.as_ref().filter(|_| coupled);
        let modal = spin.map(|spin| ModalSpin::new(spin, &parts.model, parts.reference_speed));
        let modal = if structure.softening == 0.0 {
            modal
        } else {
            let modal = modal.unwrap_or_else(|| ModalSpin::without_spin(&parts.model));
            let (share, temperature) = (structure.softening, parts.reference_temperature);
            Some(modal.softened(&rom.stiffness, &parts.model, share, temperature))
        };
        let coupling = modal.map(|modal| (modal, structure.spin.stiffening, structure.spin.coriolis));
        BankOptions {
            frequency_factors: structure.frequency_factors.clone(),
            loads: self.loads_blades(body),
            expansion: parts.expansion.clone(),
            coupling,
            excitation,
            ..BankOptions::default()
        }
    }

    /// Returns the speed (rad/s) and temperature (K) at which the stiffness of each master is taken.
    pub fn references(&self) -> Vec<[f64; 2]> {
        self.bodies.iter().map(|body| [body.reference_speed, body.reference_temperature]).collect()
    }

    /// Returns whether modes or loads of a structure depend on speed or temperature.
    pub fn varies(&self, body: usize) -> bool {
        self.spins(body) || self.softens(body)
    }

    /// Returns whether heat softens a structure.
    pub fn softens(&self, body: usize) -> bool {
        self.body(body).0.softening != 0.0
    }
}

impl Simulation {
    /// Returns the damping ratios of the first modes of each master, then of the surface carriers.
    pub(super) fn mode_damping(&self) -> Vec<Vec<f64>> {
        let (bodies, carriers) = (self.compiled.bodies.len(), self.compiled.carriers.len());
        let bodies = (0..bodies).map(|body| self.values_of(Quantity::ModeDamping, body));
        bodies.chain((0..carriers).map(|carrier| self.values_of(Quantity::CarrierModeDamping, carrier))).collect()
    }

    /// Returns all elements of a variable; empty if it does not exist.
    fn values_of(&self, quantity: Quantity, of: usize) -> Vec<f64> {
        self.state.values.elements(quantity, of).unwrap_or_default().to_vec()
    }

    /// Applies the engine orders of the parameters.
    pub(super) fn follow_engine_orders(&mut self) {
        for body in 0..self.compiled.bodies.len() {
            if let Some(reference) = self.compiled.references.engine_orders[body] {
                let order = self.state.values[reference];
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "of an integer from 0 to 1e6"
                )]
                self.system.structures_mut()[body].modes_mut().set_excitation_order(order as u32);
            }
        }
    }

    /// Returns engine order times rotor angle minus phase at an offset (rad), and the amplitude (N).
    pub(super) fn excitation_at(&self, body: usize, offset: f64) -> Option<[f64; 2]> {
        let rotor = &self.state.inputs.rotors[body];
        let [amplitude, phase] = rotor.excitation.first_chunk::<2>()?;
        let order = self.state.values[self.compiled.references.engine_orders[body]?];
        // The phase of the rotor omits whole turns; times the order these are whole turns, too.
        let angle = (order * self.state.inputs.rotors[body].angle.phase(&rotor.speed, offset)) % std::f64::consts::TAU;
        Some([amplitude.at(offset), angle - phase.at(offset)])
    }

    /// Returns the angular frequency of the excitation at an offset, from the speed and from its phase (rad/s).
    pub(super) fn excitation_rate(&self, body: usize, offset: f64) -> f64 {
        let rotor = &self.state.inputs.rotors[body];
        let order = self.compiled.references.engine_orders[body].map_or(0.0, |reference| self.state.values[reference]);
        order * rotor.speed.at(offset) - rotor.excitation.get(1).map_or(0.0, Input::rate)
    }

    /// Checks that the excitation does not turn too far within an internal step, by the speed and by its phase (rad/s) together.
    pub(super) fn check_excitation(&self, body: usize, step: f64, speeds: [f64; 2], phase: f64) -> Result<()> {
        let Some(reference) = self.compiled.references.engine_orders[body] else { return Ok(()) };
        let order = self.state.values[reference];
        let angle = speeds.into_iter().fold(0.0, |most: f64, speed| most.max(((order * speed - phase) * step).abs()));
        if angle <= crate::scene::ranges::EXCITED_ANGLE {
            return Ok(());
        }
        Err(Error::invalid(
            format!("parameter `{}excitation_order`", self.compiled.plan.body_prefix(&self.compiled.scene, body)),
            format!(
                "the excitation of order {} rotates by {angle:.3e} rad in one internal step of {step:.3e} s at t = {} \
                 s, more than the limit of {} rad",
                shown(order),
                shown_time(self.state.clock.time),
                shown(crate::scene::ranges::EXCITED_ANGLE)
            ),
            "Use a smaller internal_step_max (time.step), a lower order, a lower speed or a phase that changes more slowly",
        ))
    }

    /// Sets the initial motion of blades on top of their static equilibrium; called again for another length of the first step.
    pub(super) fn launch_blades(&mut self) {
        for body in 0..self.compiled.bodies.len() {
            let initial = &self.compiled.body(body).0.initial;
            if initial.is_empty() {
                continue;
            }
            let [displacements, velocities] =
                [Quantity::InitialDisplacement, Quantity::InitialRate].map(|quantity| self.values_of(quantity, body));
            let [speed, temperature] = self.state.inputs.rotors[body].reference();
            let modes = self.system.structures_mut()[body].modes_mut();
            if self.compiled.loads_blades(body) {
                self.compiled.settle(body, speed, temperature, modes);
            } else {
                modes.rest();
            }
            for ((one, displacement), velocity) in initial.iter().zip(displacements).zip(velocities) {
                launch(modes, one, displacement, velocity);
            }
            modes.recover();
        }
        if self.compiled.bodies.iter().enumerate().any(|(body, _)| !self.compiled.body(body).0.initial.is_empty()) {
            self.system.renew_start();
        }
    }

    /// Checks that modes with an initial motion have inertia under the scheme and move a contact node.
    pub(super) fn check_launch(&self, scheme: Scheme) -> Result<()> {
        (0..self.compiled.bodies.len()).try_for_each(|body| {
            let most = self.compiled.fewest_modes(body, Some(scheme));
            let of = |(index, one): (usize, &InitialSettings)| {
                let field = format!("structure[{}].initial[{}].mode", self.compiled.plan.bodies[body] + 1, index + 1);
                self.compiled.check_mode(body, &field, one.mode, most)
            };
            self.compiled.body(body).0.initial.iter().enumerate().try_for_each(of)
        })
    }
}

/// Adds an initial motion to the motion of the modes.
fn launch(bank: &mut ModalBank, one: &InitialSettings, displacement: f64, velocity: f64) {
    let mode = one.mode - 1;
    let n = one.nodal_diameter.unwrap_or(0);
    match bank.disk() {
        None => {
            let shape = |row: usize| bank.model().contact_modes[(row, mode)];
            let most = shape(most_moved((0..bank.rows()).map(|row| shape(row).abs())));
            let sectors = bank.sectors();
            for sector in (0..sectors).filter(|sector| one.sector.is_none_or(|own| own == sector + 1)) {
                let angle = crate::geometry::sector_angle(n * sector % sectors, sectors);
                let share = if one.sector.is_some() { 1.0 } else { libm::cos(angle - one.phase) } / most;
                bank.add_amplitude(mode, sector, [share * displacement, 0.0], [share * velocity, 0.0]);
            }
        }
        Some(disk) => {
            let shapes = &disk.model().diameters[n].contact_modes;
            let size = |row: usize| libm::hypot(shapes[(row, mode)].re, shapes[(row, mode)].im);
            let most = shapes[(most_moved((0..shapes.nrows()).map(size)), mode)];
            let square = most.re * most.re + most.im * most.im;
            let (sine, cosine) = libm::sincos(one.phase);
            // e^(−i phase)/Ψ.
            let share = [(cosine * most.re - sine * most.im) / square, -(sine * most.re + cosine * most.im) / square];
            let times = |value: f64| share.map(|part| part * value);
            bank.add_amplitude(mode, n, times(displacement), times(velocity));
        }
    }
}
