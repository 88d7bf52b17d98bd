//! Energy ledger: kinetic + strain = initial + external work + load work + step changes − damping − friction − impact
//! losses − wear work.
//!
//! All terms are those of the discrete equations (see [`crate::dynamics::scheme`]), so the closure residual measures
//! rounding and programming errors, not the scheme's truncation error.

use crate::persist::persist_fields;

/// Sum with Neumaier's compensation: long runs add millions of tiny losses.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sum {
    total: f64,
    compensation: f64,
}

persist_fields!(Sum { total, compensation });

impl Sum {
    /// Add a term.
    pub fn add(&mut self, term: f64) {
        let sum = self.total + term;
        self.compensation +=
            if self.total.abs() >= term.abs() { (self.total - sum) + term } else { (term - sum) + self.total };
        self.total = sum;
    }

    /// The compensated value.
    pub fn value(&self) -> f64 {
        self.total + self.compensation
    }
}

/// Work and losses since the start (J).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ledger {
    /// Kinetic plus strain energy at the start.
    pub initial: f64,
    /// Modal damping.
    pub damping_loss: Sum,
    /// Friction heat: µλ times the slip, rigid motion included.
    pub friction_loss: Sum,
    /// Energy the contact nodes lose when a gap closes within a step.
    pub impact_loss: Sum,
    /// Work of the coating's normal force on the approaching blades.
    pub wear_work: Sum,
    /// Energy that wearing cells takes, ∫(Y + Kε_p) dε_p: not part of the balance, see the coating's limits.
    pub wear_energy: Sum,
    /// Work of centrifugal, thermal and nodal-diameter loads.
    pub load_work: Sum,
    /// Work done by the shaft and by a moving casing through the contacts.
    pub external_work: Sum,
    /// Energy added (or removed) by carrying the state to another step size.
    pub step_change: Sum,
    /// Sum of the magnitudes of all external work: the scale of the residual.
    pub turnover: Sum,
}

persist_fields!(Ledger {
    initial,
    damping_loss,
    friction_loss,
    impact_loss,
    wear_work,
    wear_energy,
    load_work,
    external_work,
    step_change,
    turnover
});

impl Ledger {
    /// Energy that should be there minus what is (J), given kinetic + strain energy now.
    pub fn residual(&self, mechanical: f64) -> f64 {
        let mut balance = Sum::default();
        balance.add(self.initial);
        balance.add(self.external_work.value());
        balance.add(self.step_change.value());
        balance.add(-self.damping_loss.value());
        balance.add(-self.friction_loss.value());
        balance.add(-self.impact_loss.value());
        balance.add(-self.wear_work.value());
        balance.add(self.load_work.value());
        balance.add(-mechanical);
        balance.value()
    }

    /// Energy put into vibration since the start by forces times speeds (J): work of inputs and loads and changes of step, less
    /// heat of friction and damping and work on the coating. Impacts, which only take, are left out.
    pub fn supplied(&self) -> f64 {
        let put_in = self.external_work.value() + self.load_work.value() + self.step_change.value();
        put_in - self.friction_loss.value() - self.damping_loss.value() - self.wear_work.value()
    }

    /// What the residual is compared with (J): initial energy plus all work exchanged.
    pub fn scale(&self) -> f64 {
        self.initial.abs() + self.turnover.value()
    }
}
