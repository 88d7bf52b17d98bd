//! A block on a belt, held by a spring: stick-slip with two coefficients (J. P. den Hartog 1931).

/// Block, spring, belt and friction forces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StickSlipBelt {
    /// Mass (kg).
    pub mass: f64,
    /// Spring (N/m).
    pub stiffness: f64,
    /// Speed of the belt (m/s).
    pub speed: f64,
    /// Largest friction force while sticking F_s (N).
    pub sticking: f64,
    /// Friction force while sliding F_k (N).
    pub sliding: f64,
}

impl StickSlipBelt {
    /// ω = √(k/m) (rad/s).
    pub(crate) fn omega(&self) -> f64 {
        (self.stiffness / self.mass).sqrt()
    }

    /// a = (F_s − F_k)/k (m).
    pub(crate) fn offset(&self) -> f64 {
        (self.sticking - self.sliding) / self.stiffness
    }

    /// Amplitude about F_k/k: √(a² + v²/ω²) (m).
    pub fn amplitude(&self) -> f64 {
        self.offset().hypot(self.speed / self.omega())
    }

    /// Time of sliding: (2π − 2 atan(aω/v))/ω (s).
    pub fn slide_time(&self) -> f64 {
        (std::f64::consts::TAU - 2.0 * (self.offset() * self.omega() / self.speed).atan()) / self.omega()
    }

    /// Time of sticking: 2a/v (s).
    pub fn stick_time(&self) -> f64 {
        2.0 * self.offset() / self.speed
    }
}

/// A block on a spring that is thrown along a belt at rest, with a flexible contact without mass: it slides, stops, sticks and slides again.
///
/// While it sticks, the contact node u = q + G f keeps its place and the contact's flexibility G acts as a second spring; while it slides, the
/// friction force f has its largest value. Every part is a harmonic motion; its end is found by bisection.
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
    /// Kinetic and strain energy at the samples, that of the contact included (J).
    pub energies: Vec<f64>,
    /// Number of times that the block stops sliding.
    pub stops: usize,
}

impl ThrownBlock {
    /// Motion at `count` multiples of `interval` (s), to some 1e-12 of its size.
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
            // Sticking ends where the force is that of sliding, and sliding where the block stops.
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
