//! Outputs from state and window.

use super::{Phase, Simulation};
use crate::contact::coating::Coating;
use crate::contact::gap::sector_angle;
use crate::dynamics::sectors::Sectors;
use crate::variables::{Causality, NO_CLEARANCE, Quantity, Span, Variable};

/// A clearance as an output tells it (m): finite.
fn told(gap: f64) -> f64 {
    gap.min(NO_CLEARANCE)
}

fn is_clearance(quantity: Quantity) -> bool {
    matches!(
        quantity,
        Quantity::Clearance(_)
            | Quantity::ClearanceMinimum
            | Quantity::NodeClearanceMinimum
            | Quantity::SectorClearanceMinimum
            | Quantity::WatchedClearanceMinimum(_)
    )
}

/// What all outputs of one instant share.
struct Instant {
    /// 1/time since the communication step began, 0 if none has passed (1/s).
    mean: f64,
    /// That time (s).
    elapsed: f64,
    /// Kinetic and strain energy of the instant (J), if the ledger is kept.
    energies: (f64, f64),
    /// Energy that the scheme conserves (J), if the ledger is kept.
    conserved: f64,
    /// Share of the friction heat that goes into the slave; all of it where the scene does not say.
    slave_share: f64,
}

impl Simulation {
    /// Bring the outputs up to the internal time reached (means cover the part of the step done). Done by itself
    /// at every communication point; an importer that looks inside a step needs it.
    pub fn update_outputs(&mut self) {
        let elapsed = self.communication.offset(self.communication.done);
        let mean = if elapsed > 0.0 && self.communication.length > 0.0 { 1.0 / elapsed } else { 0.0 };
        self.system.close_books();
        let (mut energies, mut conserved) = ((0.0, 0.0), 0.0);
        if self.system.settings().ledger {
            let (kinetic, strain) = self.system.energies();
            (energies, conserved) = (self.system.energies_now(), kinetic + strain);
        }
        (self.energy, self.conserved) = (energies.0 + energies.1, conserved);
        let slave_share = self.table.with_quantity(Quantity::HeatToSlave);
        let slave_share = slave_share.map_or(1.0, |variable| self.values[variable.reference as usize]);
        let instant = Instant { mean, elapsed, energies, conserved, slave_share };
        let mut values = std::mem::take(&mut self.values);
        for variable in self.table.variables() {
            if variable.causality == Causality::Output {
                let start = variable.reference as usize;
                self.fill(variable.quantity, &instant, &mut values[start..start + variable.len()]);
            } else if variable.causality == Causality::Independent {
                values[variable.reference as usize] = self.communication.time(self.communication.done);
            }
        }
        self.values = values;
    }

    /// Elements of one output.
    fn fill(&self, quantity: Quantity, instant: &Instant, out: &mut [f64]) {
        let (system, window, mean) = (&self.system, &self.window, instant.mean);
        let lanes = system.bank().lanes();
        let sectors = system.bank().sectors();
        let smallest = |values: &[f64]| values.iter().fold(f64::INFINITY, |low: f64, value| low.min(*value));
        match quantity {
            Quantity::ClearanceMinimum => out[0] = told(smallest(&window.lowest)),
            Quantity::NodeClearanceMinimum => {
                for (node, value) in out.iter_mut().enumerate() {
                    *value = told(smallest(&window.lowest[node * lanes..][..sectors]));
                }
            }
            Quantity::SectorClearanceMinimum => {
                for (sector, value) in out.iter_mut().enumerate() {
                    *value = told(window.lowest.chunks(lanes).fold(f64::INFINITY, |low, row| low.min(row[sector])));
                }
            }
            Quantity::SectorNormalForce => {
                for (sector, value) in out.iter_mut().enumerate() {
                    *value = mean * window.normal_impulse.chunks(lanes).map(|row| row[sector]).sum::<f64>();
                }
            }
            Quantity::NodalDiameterAmplitude => self.fill_nodal_diameters(out),
            Quantity::PatchFrictionPower => {
                for (value, heat) in out.iter_mut().zip(&window.patch_heat) {
                    *value = mean * instant.slave_share * heat;
                }
            }
            Quantity::WearDepth => {
                for (cell, value) in out.iter_mut().enumerate() {
                    *value = system.coating().map_or(0.0, |coating| coating.wear_depth(cell));
                }
            }
            Quantity::SlaveDisplacement => self.fill_slave_displacement(out),
            Quantity::NodeDisplacement(axis) => {
                for (node, value) in out.iter_mut().enumerate() {
                    *value = system.bank().displacement()[3 * node + axis];
                }
            }
            Quantity::Clearance(_)
            | Quantity::WatchedClearanceMinimum(_)
            | Quantity::NormalForce(_)
            | Quantity::TangentialForce(_)
            | Quantity::NormalForceNow(_)
            | Quantity::TangentialForceNow(_) => self.fill_watched(quantity, mean, out),
            _ => out[0] = self.scalar(quantity, instant),
        }
    }

    fn fill_watched(&self, quantity: Quantity, mean: f64, out: &mut [f64]) {
        let lanes = self.system.bank().lanes();
        for (node, value) in out.iter_mut().enumerate() {
            let index = |sector: usize| node * lanes + sector;
            *value = match quantity {
                Quantity::Clearance(sector) => told(self.system.gaps()[index(sector)]),
                Quantity::WatchedClearanceMinimum(sector) => told(self.window.lowest[index(sector)]),
                Quantity::NormalForce(sector) => mean * self.window.normal_impulse[index(sector)],
                Quantity::TangentialForce(sector) => mean * self.window.tangential_impulse[index(sector)],
                Quantity::NormalForceNow(sector) => self.system.multiplier(node, sector),
                Quantity::TangentialForceNow(sector) => {
                    let event = self.system.events().iter().find(|event| (event.sector, event.node) == (sector, node));
                    event.map_or(0.0, |event| event.tangential)
                }
                _ => 0.0,
            };
        }
    }

    fn scalar(&self, quantity: Quantity, instant: &Instant) -> f64 {
        let (system, window) = (&self.system, &self.window);
        let ledger = system.ledger();
        let Instant { mean, elapsed, energies: (kinetic, strain), conserved, .. } = *instant;
        #[expect(clippy::cast_precision_loss, reason = "counts are below 2^52")]
        match quantity {
            Quantity::RotorAngle => self.rotor.total(&self.inputs.speed, elapsed),
            Quantity::Force(component) => mean * window.force_impulse[component],
            Quantity::PairForce(pair, axis) => mean * window.pair_impulse[pair][axis],
            Quantity::CentreVelocity(axis) => self.centre(axis, |(_, increment)| increment / system.bank().step()),
            Quantity::CentreDisplacement(axis) => self.centre(axis, |(position, _)| position),
            Quantity::PairMoment(pair, axis) => mean * window.pair_moment[pair][axis],
            Quantity::Moment(axis) => mean * window.moment_impulse[axis],
            Quantity::NormalForcePeak => window.normal_peak,
            Quantity::NormalImpulse => window.normal_impulse.iter().sum(),
            Quantity::FrictionPower => mean * window.friction_heat,
            Quantity::MasterFrictionPower => mean * (1.0 - instant.slave_share) * window.friction_heat,
            Quantity::WearDepthMaximum => system.coating().map_or(0.0, Coating::largest_wear_depth),
            Quantity::WornVolume => system.coating().map_or(0.0, Coating::worn_volume),
            Quantity::ContactCount => system.events().len() as f64,
            Quantity::InContact => f64::from(u8::from(!system.events().is_empty())),
            Quantity::KineticEnergy => kinetic,
            Quantity::StrainEnergy => strain,
            Quantity::SchemeEnergy => conserved,
            Quantity::DampingLoss => ledger.damping_loss.value(),
            Quantity::FrictionLoss => ledger.friction_loss.value(),
            Quantity::ImpactLoss => ledger.impact_loss.value(),
            Quantity::WearWork => ledger.wear_work.value(),
            Quantity::WearEnergy => ledger.wear_energy.value(),
            Quantity::LoadWork => ledger.load_work.value(),
            Quantity::ExternalWork => ledger.external_work(),
            Quantity::ShaftWork => ledger.shaft_work.value(),
            Quantity::StiffeningWork => ledger.stiffening_work.value(),
            Quantity::WhirlWork => ledger.whirl_work.value(),
            Quantity::ShiftWork => ledger.shift_work.value(),
            Quantity::CasingWork => ledger.casing_work.value(),
            Quantity::CurvatureWork => ledger.curvature_work.value(),
            Quantity::StepChangeEnergy => ledger.step_change.value(),
            Quantity::EnergyResidual => ledger.residual(conserved),
            Quantity::EnergyResidualRelative => {
                let residual = ledger.residual(conserved);
                if ledger.scale() > 0.0 { residual / ledger.scale() } else { 0.0 }
            }
            Quantity::InternalStep => system.bank().step(),
            Quantity::InternalSteps => system.steps() as f64,
            _ => 0.0,
        }
    }

    /// Value of the centre of mass of a free master along an axis, from the modal (position, increment) of its translations.
    fn centre(&self, axis: usize, value: impl Fn((f64, f64)) -> f64) -> f64 {
        let (Some(free), Sectors::Uncoupled(bank)) = (&self.compiled.free, self.system.bank()) else { return 0.0 };
        free.translations.centre(axis, [0, 1, 2].map(|mode| value(bank.modal_state(mode, 0))))
    }

    /// Radial displacement of the contact grid of the carrier.
    fn fill_slave_displacement(&self, out: &mut [f64]) {
        let (Some(slave), Some(model)) = (self.system.slave(), &self.compiled.carrier) else { return };
        out.fill(0.0);
        for mode in 0..model.len() {
            let position = slave.bank.modal_state(mode, 0).0;
            for (node, value) in out.iter_mut().enumerate() {
                *value += model.contact_modes[(3 * node, mode)] * position;
            }
        }
    }

    /// |(2/N) Σ_b u_b e^(−i n θ_b)| (1/N for n = 0 and n = N/2) of the radial displacement of the middle node.
    fn fill_nodal_diameters(&self, out: &mut [f64]) {
        let bank = self.system.bank();
        let sectors = bank.sectors();
        let row = 3 * (bank.rows() / 6);
        #[expect(clippy::cast_precision_loss, reason = "sector counts are far below 2^52")]
        for (diameter, value) in out.iter_mut().enumerate() {
            let (mut real, mut imaginary) = (0.0, 0.0);
            for sector in 0..sectors {
                let (sine, cosine) = libm::sincos(diameter as f64 * sector_angle(sector, sectors));
                real += bank.row(row, sector) * cosine;
                imaginary += bank.row(row, sector) * sine;
            }
            let weight = if diameter == 0 || 2 * diameter == sectors { 1.0 } else { 2.0 };
            *value = weight / sectors as f64 * libm::hypot(real, imaginary);
        }
    }

    pub(super) fn derivative_of(&self, variable: &Variable, element: usize, reference: u32) -> f64 {
        let (now, before) = (self.values[reference as usize], self.previous[reference as usize]);
        let length = self.communication.length;
        match (variable.quantity, variable.span) {
            _ if self.phase == Phase::Created || length == 0.0 => 0.0,
            // From nothing to touch to a clearance, and back, there is no rate.
            _ if is_clearance(variable.quantity) && now.max(before) >= NO_CLEARANCE => 0.0,
            (Quantity::Clearance(sector), _) => self.system.gap_rate(element, sector),
            (Quantity::RotorAngle, _) => self.inputs.speed.at(0.0),
            (_, Span::Mean) if self.previous_length == 0.0 => 0.0,
            (_, Span::Mean) => (now - before) / (0.5 * (length + self.previous_length)),
            _ => (now - before) / length,
        }
    }
}
