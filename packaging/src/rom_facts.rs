//! What a user wants to know of a ROM before trusting it: size, frequencies, checks, limits.

use std::fmt::Write as _;

use serde_json::{Value, json};
use tiprub_core::{
    Rom,
    dynamics::modal::ModalModel,
    rom::Frame,
    settings::Scheme,
    stability::{self, ContactDirections},
};

use crate::{Failure, Result};

/// Friction coefficients for which solvability is tried, ascending.
const FRICTION_STEPS: u32 = 40;
const FRICTION_STEP: f64 = 0.05;

/// Modes that a warning of the checks is about: those that blade-tip contact excites most.
const FIRST_MODES: usize = 6;
/// Largest frequency deviation (eq. 13) and residual convergence criterion (eq. 12) without a warning, in %.
const DEVIATION_LIMIT: f64 = 0.3;
const RESIDUAL_LIMIT: f64 = 1.0;

/// Facts of one ROM.
#[derive(Debug, Clone)]
pub struct RomFacts {
    /// The ROM.
    pub rom: Rom,
    /// Natural frequencies of the reduced model (Hz), ascending, all of them.
    pub frequencies: Vec<f64>,
    /// Largest angular frequency ω_max (rad/s).
    pub largest_angular_frequency: f64,
    /// Largest stable internal step of central differences, 2/ω_max (s).
    pub central_difference_limit: f64,
    /// Largest friction coefficient (in steps of 0.05, up to 2) for which the contact problem with all nodes of one
    /// sector closed has a unique solution at h = 1/ω_max, for slip in both directions; `None` if not even for 0.
    pub solvable_friction: Option<f64>,
}

/// One row of the table of checks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckRow {
    /// Full model (Hz).
    pub full: f64,
    /// Reduced model (Hz).
    pub reduced: f64,
    /// Frequency deviation, eq. 13 (%).
    pub deviation: f64,
    /// Residual convergence criterion, eq. 12 (%).
    pub residual: f64,
}

impl RomFacts {
    /// Work out the facts of a ROM.
    ///
    /// # Errors
    /// A ROM whose eigenproblem cannot be solved.
    pub fn of(rom: &Rom) -> Result<Self> {
        let model = ModalModel::from_rom(rom, rom.damping_ratio)
            .map_err(|error| Failure::from_core(format!("ROM `{}`", rom.name), error))?;
        let mut frequencies: Vec<f64> = model.frequencies.iter().map(|omega| omega / std::f64::consts::TAU).collect();
        frequencies.sort_by(f64::total_cmp);
        Ok(Self {
            rom: rom.clone(),
            frequencies,
            largest_angular_frequency: model.largest_frequency(),
            central_difference_limit: stability::central_difference_limit(&model),
            solvable_friction: solvable_friction(rom, &model),
        })
    }

    /// What its checks say against a ROM: one line per mode beyond the limits, first modes only.
    pub fn warnings(&self) -> Vec<String> {
        let poor = |row: &CheckRow| row.deviation.abs() > DEVIATION_LIMIT || row.residual > RESIDUAL_LIMIT;
        let rows = (1..).zip(self.checks()).take(FIRST_MODES).filter(|(_, row)| poor(row));
        rows.map(|(mode, row)| {
            format!(
                "ROM `{}`: mode {mode} ({:.1} Hz) deviates by {:.3} % from the full model (eq. 13) with a residual of \
                 {:.3} % (eq. 12); good models stay below {DEVIATION_LIMIT} % and {RESIDUAL_LIMIT} %. Keep more modes",
                self.rom.name, row.full, row.deviation, row.residual
            )
        })
        .collect()
    }

    /// The checks that came with the ROM, mode by mode; empty where it came without.
    pub fn checks(&self) -> Vec<CheckRow> {
        let checks = &self.rom.checks;
        let columns = checks.full_frequencies.iter().zip(&checks.reduced_frequencies);
        columns
            .zip(checks.frequency_deviation.iter().zip(&checks.residual_criterion))
            .map(|((full, reduced), (deviation, residual))| CheckRow {
                full: *full,
                reduced: *reduced,
                deviation: *deviation,
                residual: *residual,
            })
            .collect()
    }

    /// For people.
    pub fn to_text(&self) -> String {
        let rom = &self.rom;
        let mut text = String::new();
        let nodes: Vec<&str> = rom.contact_nodes.iter().map(|node| node.name.as_str()).collect();
        let _ = writeln!(text, "ROM {}: {}", rom.name, rom.origin);
        let _ = writeln!(text, "  sectors                   {}", rom.sectors);
        let _ = writeln!(text, "  reduced coordinates       {} per sector", rom.order());
        // Of a grid, the first node of every ring stands for the others.
        let shown = match rom.extras.grid {
            Some(grid) => {
                let _ = writeln!(text, "  contact nodes             {} around x {} along", grid.around, grid.along);
                grid.around
            }
            None => {
                let _ = writeln!(text, "  contact nodes             {} ({})", nodes.len(), nodes.join(", "));
                1
            }
        };
        for node in rom.contact_nodes.iter().step_by(shown.max(1)) {
            let [a, b, c] = node.position;
            let place = match rom.frame {
                Frame::Cylindrical => {
                    format!("r {a:.6} m, θ {b:.6} rad, z {c:.6} m, slope {:.4}", node.meridional_slope)
                }
                Frame::Cartesian => format!("x {a:.6} m, y {b:.6} m, z {c:.6} m"),
            };
            let _ = writeln!(text, "    {:<24}{place}", node.name);
        }
        let _ = writeln!(text, "  damping ratio             {}", rom.damping_ratio);
        text.push_str(&extras_text(rom));
        let _ = writeln!(text, "  largest frequency         {:.6e} rad/s", self.largest_angular_frequency);
        let _ =
            writeln!(text, "  largest stable step h     central-difference {:.4e} s", self.central_difference_limit);
        let _ = writeln!(
            text,
            "                            modal-exact: none; resolves all modes up to {:.4e} s",
            self.central_difference_limit
        );
        let friction = self.solvable_friction.map_or("none".into(), |value| format!("{value}"));
        let _ = writeln!(text, "  contact solvable up to µ  {friction} (all nodes closed, tried up to 2)");
        let checks = self.checks();
        if checks.is_empty() {
            let first: Vec<String> = self.frequencies.iter().take(6).map(|value| format!("{value:.2}")).collect();
            let _ = writeln!(text, "  first frequencies (Hz)    {}", first.join("  "));
            return text;
        }
        let _ = writeln!(text, "\n  mode    full (Hz)   reduced (Hz)   deviation eq. 13 (%)   residual eq. 12 (%)");
        for (row, mode) in checks.iter().zip(1..) {
            let CheckRow { full, reduced, deviation, residual } = row;
            let _ = writeln!(text, "  {mode:>4} {full:>12.3} {reduced:>14.3} {deviation:>22.5} {residual:>21.5}");
        }
        text
    }

    /// For programs.
    pub fn to_json(&self) -> Value {
        let rom = &self.rom;
        json!({
            "name": rom.name,
            "origin": rom.origin,
            "sectors": rom.sectors,
            "order": rom.order(),
            "contact_nodes": rom.contact_nodes.iter().map(|node| json!({
                "name": node.name, "position": node.position, "meridional_slope": node.meridional_slope,
            })).collect::<Vec<_>>(),
            "damping_ratio": rom.damping_ratio,
            "contact_grid": rom.extras.grid.map(|grid| json!({ "around": grid.around, "along": grid.along })),
            "spin": rom.extras.spin.as_ref().map(|spin| json!({ "largest_speed": spin.largest_speed })),
            "thermal_patches": rom.extras.thermal.as_ref().map(|thermal| {
                thermal.patches.iter().map(|patch| json!({ "angle": patch.angle, "axial": patch.axial }))
                    .collect::<Vec<_>>()
            }),
            "frequencies_hz": self.frequencies,
            "largest_angular_frequency": self.largest_angular_frequency,
            "largest_stable_step": {
                "central-difference": self.central_difference_limit,
                "modal-exact": null,
                "modal-exact_resolves_all_modes_up_to": self.central_difference_limit,
            },
            "solvable_up_to_friction": self.solvable_friction,
            "checks": self.checks().iter().map(|row| json!({
                "full_hz": row.full,
                "reduced_hz": row.reduced,
                "frequency_deviation_percent": row.deviation,
                "residual_criterion_percent": row.residual,
            })).collect::<Vec<_>>(),
        })
    }
}

/// Spin and heat, for people; nothing for a ROM without.
fn extras_text(rom: &Rom) -> String {
    let mut text = String::new();
    if let Some(spin) = &rom.extras.spin {
        let _ = writeln!(text, "  spin                      fitted up to {} rad/s", spin.largest_speed);
    }
    if let Some(thermal) = &rom.extras.thermal {
        let _ = writeln!(text, "  heated patches            {}", thermal.patches.len());
    }
    text
}

/// Largest µ tried for which the contact problem is solvable for both slip directions.
fn solvable_friction(rom: &Rom, model: &ModalModel) -> Option<f64> {
    let step = 1.0 / model.largest_frequency();
    let senses = [1.0, -1.0].map(|sign| closed_contacts(rom, sign));
    let solvable =
        |friction: f64| stability::check_solvable(model, Scheme::ModalExact, step, friction, &senses).is_ok();
    (0..=FRICTION_STEPS).map(|step| f64::from(step) * FRICTION_STEP).take_while(|friction| solvable(*friction)).last()
}

/// Normal and slip direction of every contact node against a round casing: inwards along the contour's normal, and
/// along ±θ.
fn closed_contacts(rom: &Rom, slip_sign: f64) -> ContactDirections {
    let directions = rom.contact_nodes.iter().map(|node| {
        let length = node.meridional_slope.hypot(1.0);
        let normal = [-1.0 / length, 0.0, node.meridional_slope / length];
        (normal, [0.0, slip_sign, 0.0])
    });
    directions.collect()
}
