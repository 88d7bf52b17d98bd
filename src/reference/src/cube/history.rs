//! Results of a run, in the same form for every method.

use serde::{Deserialize, Serialize};

/// Displacements of all masters at one time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CubeSnapshot {
    /// Time (s).
    pub time: f64,
    /// (x, y, z) of the masters, left face then right (m).
    pub masters: Vec<[f64; 3]>,
}

/// Time histories of a run, one entry per recorded step.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct CubeHistory {
    /// Name of the method.
    pub method: String,
    /// Step (s).
    pub step: f64,
    /// Times (s).
    pub times: Vec<f64>,
    /// Displacement (x, y, z) of the corner nodes 1, 6, 85, 90, 31, 36, 91, 96 (m).
    pub corners: Vec<[[f64; 3]; 8]>,
    /// Normal contact force on the same nodes (N).
    pub corner_forces: Vec<[f64; 8]>,
    /// Sum of the normal forces on the left face, and on the right (N).
    pub forces: Vec<[f64; 2]>,
    /// Kinetic energy of all bodies (J), half a step later for schemes that store displacements only.
    pub kinetic: Vec<f64>,
    /// Strain energy of all bodies (J), at the time of the kinetic one; the scheme conserves their sum without
    /// contact.
    pub strain: Vec<f64>,
    /// Velocity of the cube's centre of mass (m/s).
    pub velocity: Vec<[f64; 3]>,
    /// Largest penetration after each step (m).
    pub penetration: Vec<f64>,
    /// Displacements of all masters at the requested times.
    pub snapshots: Vec<CubeSnapshot>,
    /// Processor time of the steps (s), all threads.
    pub processor_time: f64,
    /// Processor time of preparation other than assembly: factors and condensed matrices (s).
    pub preparation_time: f64,
    /// Total number of iterations of the contact solver.
    pub iterations: usize,
}

impl CubeHistory {
    /// Returns the sum of kinetic and strain energy (J).
    pub fn total(&self) -> Vec<f64> {
        self.kinetic.iter().zip(&self.strain).map(|(kinetic, strain)| kinetic + strain).collect()
    }

    /// Returns one component (0, 1, 2) of the displacement of node 1 (m).
    pub fn first(&self, component: usize) -> Vec<f64> {
        self.corners.iter().map(|corner| corner[0][component]).collect()
    }

    /// Returns the contact force on node 1 (N).
    pub fn first_force(&self) -> Vec<f64> {
        self.corner_forces.iter().map(|force| force[0]).collect()
    }

    /// Returns the last time at which the cube touches a ring (s); `None` if it never does.
    pub fn last_contact(&self) -> Option<f64> {
        self.forces.iter().rposition(|force| force[0] > 0.0 || force[1] > 0.0).map(|index| self.times[index])
    }

    /// Returns a table with a header: times, node 1, its force, energies, velocity; SI units.
    pub fn csv(&self) -> String {
        let mut text = String::from("t,u1x,u1y,u1z,lambda1,left,right,kinetic,strain,vx,vy,vz,penetration\n");
        for i in 0..self.times.len() {
            let [x, y, z] = self.corners[i][0];
            let [vx, vy, vz] = self.velocity[i];
            let numbers = [
                self.times[i],
                x,
                y,
                z,
                self.corner_forces[i][0],
                self.forces[i][0],
                self.forces[i][1],
                self.kinetic[i],
                self.strain[i],
                vx,
                vy,
                vz,
                self.penetration[i],
            ];
            text.push_str(&numbers.map(|x| format!("{x:e}")).join(","));
            text.push('\n');
        }
        text
    }
}

/// Returns the processor time of this process so far (s), user and system; zero if the system does not provide it.
pub fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Fields 14 and 15 after the name in parentheses; in hundredths of a second on Linux.
    let after = stat.rsplit(')').next().unwrap_or_default();
    after.split_whitespace().skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}
