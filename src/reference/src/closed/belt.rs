//! Stick-slip with two coefficients of a block on a belt, held by a spring (J. P. den Hartog 1931).

/// Block, spring, belt and friction forces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StickSlipBelt {
    /// Mass (kg).
    pub mass: f64,
    /// Spring stiffness (N/m).
    pub stiffness: f64,
    /// Speed of the belt (m/s).
    pub speed: f64,
    /// Largest friction force while sticking F_s (N).
    pub sticking: f64,
    /// Friction force while sliding F_k (N).
    pub sliding: f64,
}

impl StickSlipBelt {
    /// Returns ω = √(k/m) (rad/s).
    pub(crate) fn omega(&self) -> f64 {
        (self.stiffness / self.mass).sqrt()
    }

    /// Returns a = (F_s − F_k)/k (m).
    pub(crate) fn offset(&self) -> f64 {
        (self.sticking - self.sliding) / self.stiffness
    }

    /// Returns the amplitude about F_k/k: √(a² + v²/ω²) (m).
    pub fn amplitude(&self) -> f64 {
        self.offset().hypot(self.speed / self.omega())
    }

    /// Returns the time of sliding: (2π − 2 atan(aω/v))/ω (s).
    pub fn slide_time(&self) -> f64 {
        (std::f64::consts::TAU - 2.0 * (self.offset() * self.omega() / self.speed).atan()) / self.omega()
    }

    /// Returns the time of sticking: 2a/v (s).
    pub fn stick_time(&self) -> f64 {
        2.0 * self.offset() / self.speed
    }
}

/// Block on a spring with an initial velocity along a belt at rest, with a flexible contact without mass: it slides,
/// stops, sticks and slides again.
///
/// While it sticks, the contact node u = q + G f keeps its position and the contact flexibility G acts as a second
/// spring; while it slides, the friction force f has its largest value. Every phase is a harmonic motion, whose end
/// is found by bisection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThrownBlock {
    /// Mass (kg).
    pub mass: f64,
    /// √(k/m) of the spring (rad/s).
    pub omega: f64,
    /// Flexibility of the contact G (m/N).
    pub flexibility: f64,
    /// Largest friction force (N).
    pub friction: f64,
    /// Velocity at the start (m/s).
    pub velocity: f64,
}

/// Motion of a [`ThrownBlock`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ThrownMotion {
    /// Displacement of the contact node at the samples (m).
    pub positions: Vec<f64>,
    /// Kinetic and strain energy at the samples, including that of the contact (J).
    pub energies: Vec<f64>,
    /// Number of times the block stops sliding.
    pub stops: usize,
}

impl ThrownBlock {
    /// Computes the motion at `count` multiples of `interval` (s), to about 1e-12 of its size.
    pub fn motion(&self, interval: f64, count: usize) -> ThrownMotion {
        let Self { mass, omega, flexibility, friction, velocity } = *self;
        let swing = |w: f64, q: f64, v: f64, s: f64| {
            [q * (w * s).cos() + v / w * (w * s).sin(), v * (w * s).cos() - q * w * (w * s).sin()]
        };
        let stiff = (omega * omega + 1.0 / (mass * flexibility)).sqrt();
        let share = 1.0 / (mass * flexibility * stiff * stiff);
        let (mut q, mut v, mut u, mut force, mut start) = (0.0, velocity, 0.0, 0.0, 0.0);
        let mut sticks = true;
        let mut motion = ThrownMotion::default();
        while motion.positions.len() < count {
            let rest = if sticks { share * u } else { force / (mass * omega * omega) };
            let at = |s: f64| -> [f64; 2] {
                let [x, w] = swing(if sticks { stiff } else { omega }, q - rest, v, s);
                [x + rest, w]
            };
            // Sticking ends when the force reaches that of sliding, and sliding ends when the block stops.
            let left = |s: f64| if sticks { friction - (u - at(s)[0]).abs() / flexibility } else { -force * at(s)[1] };
            let (grain, end) = (1e-3 / stiff, interval * count as f64 - start);
            let mut high = grain;
            while left(high) > 0.0 && high < end {
                high += grain;
            }
            let mut low = high - grain;
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                *(if left(middle) > 0.0 { &mut low } else { &mut high }) = middle;
            }
            while motion.positions.len() < count && interval * (motion.positions.len() + 1) as f64 <= start + high {
                let s = interval * (motion.positions.len() + 1) as f64 - start;
                let [x, w] = at(s);
                let force = if sticks { (u - x) / flexibility } else { force };
                motion.positions.push(if sticks { u } else { x + flexibility * force });
                let kinetic = 0.5 * mass * (w * w + omega * omega * x * x);
                motion.energies.push(kinetic + 0.5 * flexibility * force * force);
            }
            [q, v] = at(high);
            (u, start) = (if sticks { u } else { q + flexibility * force }, start + high);
            force = if sticks { friction * (u - q).signum() } else { 0.0 };
            motion.stops += usize::from(!sticks && motion.positions.len() < count);
            sticks = !sticks;
        }
        motion
    }
}
