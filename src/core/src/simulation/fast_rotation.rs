//! Warning at the start of rotors that turn fast compared with their first natural frequency but have the stiffness at rest.

use tiprub_cosim::shown;
use tiprub_cosim::warning::Topic;

use super::Simulation;
use super::compile::Compiled;
use crate::Warning;
use crate::scene::rom::DisplacementFrame;
use crate::scene::settings::BodyMotion;

/// Largest Ω/ω₁ without a warning. The lowest frequency rises as ω₁(Ω)² ≈ ω₁² + BΩ² (Southwell). Rotor 37 has B = 5.7 (865 Hz at rest, 1102
/// Hz at 1800 rad/s), so at 0.2 a fifth of its stiffness is neglected.
const SLOW: f64 = 0.2;

impl Simulation {
    /// Warns of rotors whose stiffness at speed differs from the stiffness at rest that the scene gives them.
    pub(super) fn warn_of_fast_rotation(&mut self) {
        let speeds = self.speeds().into_iter().enumerate();
        let warnings = speeds.filter_map(|(body, speed)| self.compiled.fast_rotation(body, speed));
        self.diagnostics.warnings.extend(warnings);
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
             at rest. Centrifugal stiffening and growth can change contact forces by tens of per cent",
            self.rotor_name(body),
            shown(speed),
        );
        let remedy = if rom.extras.spin.is_some() {
            "Set `spin = { stiffening = true, growth = true }` for the structure and `time.scheme = \"modal-exact\"`"
        } else if self.bodies[body].disk.is_some() {
            "Reduce matrices that were computed at speed and silence this warning, because coupled sectors do not \
             support spin effects"
        } else {
            "Use a ROM with spin matrices (reduce --spin), `spin = { stiffening = true, growth = true }` and `time.scheme = \"modal-exact\"`"
        };
        Some(Warning::new(Topic::StiffnessAtRest, problem, remedy))
    }
}
