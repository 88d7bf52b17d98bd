//! Warnings at the start: of rotors that rotate fast but have the stiffness at rest, and of tips that slide more slowly
//! than they vibrate.

use nalgebra::DMatrix;
use tiprub_cosim::shown;
use tiprub_cosim::warning::Topic;

use super::Simulation;
use super::compile::Compiled;
use super::limits::Parameters;
use crate::Warning;
use crate::modes::modal::ModalModel;
use crate::scene::rom::DisplacementFrame;
use crate::scene::settings::BodyMotion;
use crate::scene::shape::CompiledShape;

/// Largest Ω/ω₁ without a warning. The lowest frequency rises as ω₁(Ω)² ≈ ω₁² + BΩ² (Southwell). Rotor 37 has B = 5.7
/// (865 Hz at rest, 1102 Hz at 1800 rad/s), so at 0.2 a fifth of its stiffness is neglected.
const SLOW: f64 = 0.2;

/// Scene settings that include the effects of spin. The step suits built-in blades. If it is too long for a blade, the
/// simulation rejects it at the start and prints the longest step that it accepts.
const SPIN_SETTINGS: &str = "set `spin = { stiffening = true, growth = true }` for the structure, and \
                             `scheme = \"modal-exact\"` and `step = 2.5e-7` under `[time]`";

/// Angles at which a shape is sampled.
const ANGLES: u32 = 720;

impl Simulation {
    /// Warns of rotors that have the stiffness at rest although their speed changes it noticeably.
    pub(super) fn warn_of_fast_rotation(&mut self) {
        let speeds = self.speeds().into_iter().enumerate();
        let warnings = speeds.filter_map(|(body, speed)| self.compiled.fast_rotation(body, speed));
        self.diagnostics.warnings.extend(warnings);
    }

    /// Warns of tips that slide more slowly than they vibrate: they stick at times, which the sliding law does not model.
    pub(super) fn warn_of_sticking(&mut self, parameters: &Parameters) {
        for body in 0..self.compiled.bodies.len() {
            let (speed, friction) =
                (&self.state.inputs.rotors[body].speed, parameters.friction_of(&self.compiled, body));
            if self.compiled.bodies[body].translations.is_some()
                || parameters.solver.sticks()
                || (friction == 0.0 && !self.compiled.cuts(body))
                || speed.slope != 0.0
            {
                continue;
            }
            let slow = self.compiled.slow_sliding(body, friction);
            if speed.value.abs() >= slow {
                continue;
            }
            let rotor = self.compiled.rotor_name(body);
            let cuts = self.compiled.cuts(body);
            let problem = format!(
                "{rotor} starts at a speed of {} rad/s with {}: the sliding law does not model sticking, which occurs below \
                 about {slow:.1e} rad/s. The run ends if {} energy",
                shown(speed.value),
                if cuts { "a coating that the blades cut" } else { "friction" },
                if cuts { "friction or cutting forces add" } else { "friction adds" },
            );
            let remedy = "Trust the results only once the tips slide faster than they vibrate";
            let remedy = if cuts { remedy.to_owned() } else { format!("{remedy}, or use the solver coulomb") };
            self.diagnostics.warnings.push(Warning::new(Topic::Sticking, problem, remedy));
        }
    }
}

impl Compiled {
    /// Returns the warning for a rotor that starts at `speed` (rad/s).
    fn fast_rotation(&self, body: usize, speed: f64) -> Option<Warning> {
        let (structure, rom) = self.body(body);
        let ratio = speed.abs() / self.bodies[body].lowest_frequency();
        let turns = structure.motion == BodyMotion::Rotating && rom.frame == DisplacementFrame::Cylindrical;
        if !turns || structure.spin.stiffening || ratio <= SLOW {
            return None;
        }
        let problem = format!(
            "{} starts at a speed of {} rad/s, {ratio:.2} times its first natural frequency, but has the stiffness of a rotor \
             at rest. Centrifugal stiffening and growth can double contact forces, and multiply the heat of a light rub",
            self.rotor_name(body),
            shown(speed),
        );
        let remedy = if rom.extras.spin.is_some() {
            format!("In the scene, {SPIN_SETTINGS}")
        } else if self.bodies[body].disk.is_some() {
            "Reduce matrices that were computed at speed and silence this warning, because coupled sectors do not \
             support spin effects"
                .to_owned()
        } else {
            format!("Reduce the blade with the option `--spin {}`, {SPIN_SETTINGS}", shown(speed.abs().ceil()))
        };
        Some(Warning::new(Topic::StiffnessAtRest, problem, remedy))
    }

    /// Speed (rad/s) below which tips may vibrate faster than they slide. The vibration is that of the lowest mode with an amplitude of the
    /// clearance or of the inward extent of the shape, or that after a release from the same depth with this friction coefficient.
    pub(super) fn slow_sliding(&self, body: usize, friction: f64) -> f64 {
        let parts = &self.bodies[body];
        let lowest = parts.lowest_frequency();
        let radius = self.body(body).1.contact_nodes.iter().fold(0.0, |most: f64, node| most.max(node.position[0]));
        if !lowest.is_finite() {
            return 0.0;
        }
        let reach = self.plan.pairs_of(body).map(|(pair, _)| self.depth_of_shape(pair)).fold(0.0, f64::max);
        let rate = match &parts.disk {
            Some(disk) => (0..disk.diameters.len())
                .map(|diameter| released(&disk.paired(diameter), friction))
                .fold(lowest, f64::max),
            None => released(&parts.model, friction).max(lowest),
        };
        reach * rate / radius
    }

    /// Clearance of a pair, or the inward extent of the shape of its surface if that is larger (m).
    fn depth_of_shape(&self, pair: usize) -> f64 {
        let gap = self.contact(pair).nominal_gap();
        let shape = &self.plan.surface(&self.scene.settings, pair).shape;
        let Ok(shape) = CompiledShape::new(shape, gap) else { return gap };
        let angle = |place: u32| std::f64::consts::TAU * f64::from(place) / f64::from(ANGLES);
        (0..ANGLES).fold(gap, |most, place| most.max(-shape.evaluate(angle(place)).0))
    }
}

/// Velocity around the axis per depth (1/s) of the node that is fastest after a release: a force λ along its normal and µλ around the axis
/// presses it in by λΣφ_n²/ω², and every mode then vibrates with ω times its contribution. The phases of the modes differ, so that their
/// squares are added.
fn released(model: &ModalModel, friction: f64) -> f64 {
    let modes = || (0..model.len()).filter(|mode| model.frequencies[*mode] > 0.0);
    let row = |shapes: &DMatrix<f64>, row: usize, mode: usize| shapes[(row, mode)].abs();
    let node = |node: usize| {
        let of = |mode: usize| [0, 1].map(|axis| row(&model.contact_modes, 3 * node + axis, mode));
        let pressed: f64 = modes().map(|mode| (of(mode)[0] / model.frequencies[mode]).powi(2)).sum();
        let speeds = modes().map(|mode| {
            let [across, around] = of(mode);
            (around * (across + friction * around) / model.frequencies[mode]).powi(2)
        });
        if pressed > 0.0 { speeds.sum::<f64>().sqrt() / pressed } else { 0.0 }
    };
    (0..model.contact_modes.nrows() / 3).map(node).fold(0.0, f64::max)
}
