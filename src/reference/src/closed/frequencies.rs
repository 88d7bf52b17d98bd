//! Natural frequencies in closed form.

use std::f64::consts::PI;

/// Returns the root number n = 1, 2, … of cos βL cosh βL = −1 of a cantilever.
pub fn cantilever_root(n: u32) -> f64 {
    // cos x + 1/cosh x changes sign once between multiples of π.
    let value = |x: f64| x.cos() + 1.0 / x.cosh();
    let (mut low, mut high) = (f64::from(n - 1) * PI, f64::from(n) * PI);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if value(low) * value(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Returns the angular frequency of a cantilever (rad/s): (βL)² √(EI/ρAL⁴).
pub fn cantilever(n: u32, bending: f64, mass_per_length: f64, length: f64) -> f64 {
    cantilever_root(n).powi(2) * (bending / mass_per_length).sqrt() / (length * length)
}

/// Returns the angular frequency of in-plane bending of a free thin ring with n ≥ 2 waves (rad/s): ω² = n²(n² −
/// 1)²/(n² + 1) EI/ρAR⁴; 2.683 √(EI/ρAR⁴) for n = 2.
pub fn free_ring(n: u32, bending: f64, mass_per_length: f64, radius: f64) -> f64 {
    let square = f64::from(n * n);
    ((square * (square - 1.0).powi(2) / (square + 1.0)) * bending / mass_per_length).sqrt() / (radius * radius)
}

/// Returns the angular frequency of out-of-plane bending and torsion of a free thin ring with n ≥ 2 waves (rad/s): ω² =
/// n²(n² − 1)²/(n² + EI/GJ) EI/ρAR⁴, with EI of bending out of the plane and GJ of torsion (A. E. H. Love,
/// Mathematical Theory of Elasticity, section 293).
pub fn free_ring_out_of_plane(n: u32, bending: f64, torsion: f64, mass_per_length: f64, radius: f64) -> f64 {
    let square = f64::from(n * n);
    ((square * (square - 1.0).powi(2) / (square + bending / torsion)) * bending / mass_per_length).sqrt()
        / (radius * radius)
}

/// Returns the angular frequency of a cyclic chain of N masses m on springs k, neighbours coupled by k_c (rad/s): ω² =
/// (k + 4k_c sin²(πn/N))/m.
pub fn cyclic_chain(n: u32, sectors: u32, mass: f64, spring: f64, coupling: f64) -> f64 {
    let sine = (PI * f64::from(n) / f64::from(sectors)).sin();
    ((spring + 4.0 * coupling * sine * sine) / mass).sqrt()
}
