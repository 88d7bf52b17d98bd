//! Outputs from state and window: what a row of the table fills itself from.

use std::fmt;
use std::sync::Arc;

use super::table::LENGTH;
use super::window::Window;
use super::{Phase, Simulation};
use crate::contact::coating::Coating;
use crate::contact::gap::sector_angle;
use crate::dynamics::sectors::Sectors;
use crate::ledger::Ledger;
use crate::system::System;
use crate::variables::{Causality, NO_CLEARANCE, Quantity, Span, Variable};

type Fill = dyn Fn(&View, &mut [f64]) + Send + Sync;

/// What fills the elements of an output.
#[derive(Clone)]
pub struct Reader(Arc<Fill>);

impl fmt::Debug for Reader {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Reader")
    }
}

/// Of a scalar.
pub fn scalar(read: impl Fn(&View) -> f64 + Send + Sync + 'static) -> Reader {
    Reader(Arc::new(move |view, out| out[0] = read(view)))
}

/// Of an array, element by element.
pub fn each(read: impl Fn(&View, usize) -> f64 + Send + Sync + 'static) -> Reader {
    Reader(Arc::new(move |view, out| {
        out.iter_mut().enumerate().for_each(|(index, value)| *value = read(view, index));
    }))
}

/// Of an array as a whole.
pub fn whole(read: impl Fn(&View, &mut [f64]) + Send + Sync + 'static) -> Reader {
    Reader(Arc::new(read))
}

/// What outputs are read from, and what all of them share at one instant.
pub struct View<'a> {
    simulation: &'a Simulation,
    pub system: &'a System,
    pub window: &'a Window,
    /// 1/time since the communication step began, 0 if none has passed (1/s).
    pub mean: f64,
    /// That time (s).
    elapsed: f64,
    /// Share of the friction heat that goes into the slave; all of it where the scene does not say.
    slave_share: f64,
    /// Kinetic and strain energy of the instant (J), if the ledger is kept.
    pub energies: (f64, f64),
    /// Energy that the scheme conserves (J), if the ledger is kept.
    pub conserved: f64,
}

impl Simulation {
    /// Bring the outputs up to the internal time reached (means cover the part of the step done). Done by itself
    /// at every communication point; an importer that looks inside a step needs it.
    pub fn update_outputs(&mut self) {
        let elapsed = self.communication.offset(self.communication.done);
        let mean = if elapsed > 0.0 && self.communication.length > 0.0 { 1.0 / elapsed } else { 0.0 };
        self.system.close_ledger();
        let (mut energies, mut conserved) = ((0.0, 0.0), 0.0);
        if self.system.settings().ledger {
            let (kinetic, strain) = self.system.energies();
            (energies, conserved) = (self.system.energies_now(), kinetic + strain);
        }
        (self.energy, self.conserved) = (energies.0 + energies.1, conserved);
        let slave_share = self.table.with_quantity(Quantity::HeatToSlave);
        let slave_share = slave_share.map_or(1.0, |variable| self.values[variable.reference as usize]);
        let mut values = std::mem::take(&mut self.values);
        let (system, window) = (&self.system, &self.window);
        let view = View { simulation: self, system, window, mean, elapsed, slave_share, energies, conserved };
        let outputs = self.table.variables().iter().filter(|variable| variable.causality == Causality::Output);
        for (variable, read) in outputs.zip(&self.readers) {
            let start = variable.reference as usize;
            (read.0)(&view, &mut values[start..start + variable.len()]);
        }
        let time = self.communication.time(self.communication.done);
        for variable in self.table.variables().iter().filter(|row| row.causality == Causality::Independent) {
            values[variable.reference as usize] = time;
        }
        self.values = values;
    }
}

/// Of clearances, as an output tells it: finite.
fn smallest<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    values.fold(f64::INFINITY, |low: f64, value| low.min(*value)).min(NO_CLEARANCE)
}

impl View<'_> {
    pub fn rotor_angle(&self) -> f64 {
        self.simulation.rotor.total(&self.simulation.inputs.speed, self.elapsed)
    }

    pub fn slave_share(&self) -> f64 {
        self.slave_share
    }

    pub fn ledger(&self) -> &Ledger {
        self.system.ledger()
    }

    pub fn relative_residual(&self) -> f64 {
        let (residual, scale) = (self.ledger().residual(self.conserved), self.ledger().scale());
        if scale > 0.0 { residual / scale } else { 0.0 }
    }

    #[expect(clippy::cast_precision_loss, reason = "counts are below 2^52")]
    pub fn contacts(&self) -> f64 {
        self.system.events().len() as f64
    }

    #[expect(clippy::cast_precision_loss, reason = "counts are below 2^52")]
    pub fn internal_steps(&self) -> f64 {
        self.system.steps() as f64
    }

    /// What a coating tells; nothing without one.
    pub fn coating(&self, read: impl Fn(&Coating) -> f64) -> f64 {
        self.system.coating().map_or(0.0, read)
    }

    fn index(&self, node: usize, sector: usize) -> usize {
        node * self.system.bank().lanes() + sector
    }

    /// Smallest clearance of all nodes within the communication step (m).
    pub fn lowest(&self) -> f64 {
        smallest(self.window.lowest.iter())
    }

    /// The same of a node over all sectors.
    pub fn lowest_of_node(&self, node: usize) -> f64 {
        let bank = self.system.bank();
        smallest(self.window.lowest[node * bank.lanes()..][..bank.sectors()].iter())
    }

    /// The same of a sector over all nodes.
    pub fn lowest_of_sector(&self, sector: usize) -> f64 {
        smallest(self.of_sector(&self.window.lowest, sector))
    }

    /// The same of one node.
    pub fn lowest_at(&self, node: usize, sector: usize) -> f64 {
        self.window.lowest[self.index(node, sector)].min(NO_CLEARANCE)
    }

    /// Values of a sector, node by node.
    pub fn of_sector<'a>(&self, values: &'a [f64], sector: usize) -> impl Iterator<Item = &'a f64> + use<'a> {
        values.iter().skip(sector).step_by(self.system.bank().lanes())
    }

    pub fn clearance(&self, node: usize, sector: usize) -> f64 {
        self.system.gaps()[self.index(node, sector)].min(NO_CLEARANCE)
    }

    pub fn normal_impulse(&self, node: usize, sector: usize) -> f64 {
        self.window.normal_impulse[self.index(node, sector)]
    }

    pub fn tangential_impulse(&self, node: usize, sector: usize) -> f64 {
        self.window.tangential_impulse[self.index(node, sector)]
    }

    /// Friction force of the last internal step (N).
    pub fn tangential_now(&self, node: usize, sector: usize) -> f64 {
        let event = self.system.events().iter().find(|event| (event.sector, event.node) == (sector, node));
        event.map_or(0.0, |event| event.tangential)
    }

    /// Value of the centre of mass of a free master along an axis, from the modal (position, increment) of its translations.
    pub fn centre(&self, axis: usize, value: impl Fn((f64, f64)) -> f64) -> f64 {
        let (Some(free), Sectors::Uncoupled(bank)) = (&self.simulation.compiled.free, self.system.bank()) else {
            return 0.0;
        };
        free.translations.centre(axis, [0, 1, 2].map(|mode| value(bank.modal_state(mode, 0))))
    }

    /// Radial displacement of the contact grid of the carrier.
    pub fn slave_displacement(&self, out: &mut [f64]) {
        let (Some(slave), Some(model)) = (self.system.slave(), &self.simulation.compiled.carrier) else { return };
        out.fill(0.0);
        for mode in 0..model.len() {
            let position = slave.bank.modal_state(mode, 0).0;
            for (node, value) in out.iter_mut().enumerate() {
                *value += model.contact_modes[(3 * node, mode)] * position;
            }
        }
    }

    /// |(2/N) Σ_b u_b e^(−i n θ_b)| (1/N for n = 0 and n = N/2) of the radial displacement of the middle node.
    pub fn nodal_diameters(&self, out: &mut [f64]) {
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
}

impl Simulation {
    pub(super) fn derivative_of(&self, variable: &Variable, element: usize, reference: u32) -> f64 {
        let (now, before) = (self.values[reference as usize], self.previous[reference as usize]);
        let length = self.communication.length;
        match (variable.quantity, variable.span) {
            _ if self.phase == Phase::Created || length == 0.0 => 0.0,
            // From nothing to touch to a clearance, and back, there is no rate.
            _ if variable.unit == Some(&LENGTH) && now.max(before) >= NO_CLEARANCE => 0.0,
            (Quantity::Clearance(sector), _) => self.system.gap_rate(element, sector),
            (Quantity::RotorAngle, _) => self.inputs.speed.at(0.0),
            (_, Span::Mean) if self.previous_length == 0.0 => 0.0,
            (_, Span::Mean) => (now - before) / (0.5 * (length + self.previous_length)),
            _ => (now - before) / length,
        }
    }
}
