//! Facts about a ROM for its assessment: size, frequencies, checks, limits.

use std::fmt::Write as _;

use serde_json::{Value, json};
use tiprub_core::Rom;
use tiprub_core::limits;
use tiprub_core::limits::plausibility::{self, Slip};
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::rom::{ContactNode, DisplacementFrame};
use tiprub_cosim::warning::{Topic, Warning};
use tiprub_shell::{Failure, Result};
use tiprub_study::{
    estimate,
    stability::structure::{KnownContact, LockUp, SingleStructure, StepLimit},
};

/// Number of modes whose checks cause warnings: those that blade-tip contact excites most. For coupled sectors, these are the modes of the first
/// family, as many as there are sectors.
const FIRST_MODES: usize = 6;
/// Largest number of listed contact nodes.
const LISTED_NODES: usize = 24;
/// Largest number of printed rows of a table of checks; coupled sectors may have hundreds.
pub(crate) const ROWS_SHOWN: usize = 40;
/// Number of listed frequencies of each nodal diameter.
const FREQUENCIES_SHOWN: usize = 6;
/// Modes below this fraction of the highest checked frequency are rigid-body modes.
const RIGID: f64 = 1e-4;
/// Largest frequency deviation (eq. 13) without a warning (%), which the paper calls satisfactory.
pub const DEVIATION_LIMIT: f64 = 0.3;
/// Largest value of the residual convergence criterion (eq. 12) without a warning (%).
pub const RESIDUAL_LIMIT: f64 = 1.0;
/// Largest friction coefficient of tips; lock-up friction above it is irrelevant.
const USUAL_FRICTION: f64 = 1.0;
/// Ratio of the lock-up frictions of both senses of rotation from which the lower one causes a question.
const OTHER_SENSE: f64 = 2.0;

/// Facts of one ROM.
#[derive(Debug, Clone)]
pub struct RomFacts {
    /// The ROM.
    pub rom: Rom,
    /// All natural frequencies of the reduced model (Hz), ascending; double frequencies of coupled sectors appear once.
    pub frequencies: Vec<f64>,
    /// Natural frequencies of every nodal diameter of coupled sectors, from 0; otherwise empty.
    pub by_nodal_diameter: Vec<Vec<f64>>,
    /// Largest angular frequency ω_max (rad/s).
    pub largest_angular_frequency: f64,
    /// Largest stable internal step of central differences, 2/ω_max (s).
    pub central_difference_limit: f64,
    /// Largest friction coefficient (in steps of 0.05, up to 2) for which the contact problem with all nodes of one
    /// sector closed has a unique solution at h = 1/ω_max, for slip in both directions; `None` if not even for 0.
    pub solvable_friction: Option<f64>,
    /// Lock-up friction for sliding towards +θ and −θ (positive and negative `speed`); `None` if no friction causes lock-up, and for the sense in
    /// which a known scene does not rotate.
    pub lock_up: [Option<LockUp>; 2],
    /// Internal step of every scheme below which all steps are accepted, for the given contact.
    pub step_limits: Vec<StepLimit>,
    /// Contact for which the limits hold, if it was given.
    pub sliding: Option<KnownContact>,
}

/// One row of the table of checks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckRow {
    /// Frequency of the full model (Hz).
    pub full: f64,
    /// Frequency of the reduced model (Hz).
    pub reduced: f64,
    /// Frequency deviation, eq. 13 (%).
    pub deviation: f64,
    /// Residual convergence criterion, eq. 12 (%).
    pub residual: f64,
    /// Nodal diameter, for coupled sectors.
    pub nodal_diameter: Option<u32>,
}

/// Returns 0 for values that would be printed as -0.00000 with five decimals.
pub fn not_negative_zero(value: f64) -> f64 {
    if value.abs() < 5e-6 { 0.0 } else { value }
}

impl RomFacts {
    /// Determines the facts of a ROM; `sliding` is its contact, if a scene defines it.
    ///
    /// # Errors
    /// The eigenproblem of the ROM cannot be solved.
    pub fn of(rom: &Rom, sliding: Option<KnownContact>) -> Result<Self> {
        let in_rom = |error| Failure::from_core(format!("ROM `{}`", rom.name), error);
        let structure = SingleStructure::new(rom, rom.damping_ratio, 0.0).map_err(in_rom)?;
        let hertz = |frequencies: &Vec<f64>| frequencies.iter().map(|omega| omega / std::f64::consts::TAU).collect();
        let by_nodal_diameter: Vec<Vec<f64>> = structure.frequencies.iter().map(hertz).collect();
        let mut frequencies = by_nodal_diameter.concat();
        frequencies.sort_by(f64::total_cmp);
        let limits = structure.models.iter().map(limits::central_difference_limit);
        let speed = sliding.map_or(0.0, |sliding| sliding.speed);
        let turns = |sense: f64| sense * speed >= 0.0;
        let lock_up = [1.0, -1.0].map(|sense| turns(sense).then(|| structure.lock_up(sense)).flatten());
        Ok(Self {
            rom: rom.clone(),
            frequencies,
            by_nodal_diameter: if rom.is_cyclic() { by_nodal_diameter } else { Vec::new() },
            largest_angular_frequency: structure.highest(),
            central_difference_limit: limits.fold(f64::INFINITY, f64::min),
            solvable_friction: structure.solvable_friction(),
            lock_up,
            step_limits: structure.step_limits(sliding),
            sliding,
        })
    }

    /// Returns the warnings of the checks of a ROM: one line per mode beyond the limits, first modes only.
    pub fn warnings(&self) -> Vec<Warning> {
        let checks = self.checks();
        // For rigid-body modes, the deviation would compare two rounding errors.
        let rigid = RIGID * checks.iter().map(|row| row.full.abs()).fold(0.0, f64::max);
        let poor = |row: &CheckRow| row.deviation.abs() > DEVIATION_LIMIT || row.residual > RESIDUAL_LIMIT;
        let poor = |row: &CheckRow| poor(row) && !(row.full.abs() < rigid && row.reduced.abs() < rigid);
        let rows = (1..).zip(checks).take(self.first_modes()).filter(|(_, row)| poor(row));
        let poor = rows.map(|(mode, row)| {
            let problem = format!(
                "ROM `{}`: mode {mode} ({:.1} Hz) deviates by {:.3} % from the full model (eq. 13) with a residual of \
                 {:.3} % (eq. 12); good models stay below {DEVIATION_LIMIT} % and {RESIDUAL_LIMIT} %",
                self.rom.name, row.full, row.deviation, row.residual
            );
            Warning::new(Topic::RomAccuracy, problem, "Keep more modes")
        });
        poor.collect()
    }

    /// Returns implausible values of the ROM.
    pub fn slips(&self) -> Vec<Slip> {
        plausibility::of_rom(&self.rom, self.frequencies.iter().map(|hertz| hertz * std::f64::consts::TAU))
    }

    /// Returns the number of checked modes that should be accurate.
    fn first_modes(&self) -> usize {
        let (sectors, numbers) = (self.rom.sectors, &self.rom.checks.nodal_diameters);
        if numbers.is_empty() {
            return FIRST_MODES;
        }
        let of_disk = |number: &u32| if *number == 0 || 2 * *number as usize == sectors { 1 } else { 2 };
        let before = numbers.iter().scan(0, |sum, number| {
            *sum += of_disk(number);
            Some(*sum)
        });
        before.take_while(|sum| *sum <= sectors).count()
    }

    /// Returns the checks of the ROM, mode by mode; empty if it has none.
    pub fn checks(&self) -> Vec<CheckRow> {
        let checks = &self.rom.checks;
        let columns = checks.full_frequencies.iter().zip(&checks.reduced_frequencies);
        columns
            .zip(checks.frequency_deviation.iter().zip(&checks.residual_criterion))
            .enumerate()
            .map(|(mode, ((full, reduced), (deviation, residual)))| CheckRow {
                full: *full,
                reduced: *reduced,
                deviation: *deviation,
                residual: *residual,
                nodal_diameter: checks.nodal_diameters.get(mode).copied(),
            })
            .collect()
    }

    /// Formats the facts for the terminal.
    pub fn to_text(&self) -> String {
        let rom = &self.rom;
        let mut text = String::new();
        let nodes: Vec<&str> = rom.contact_nodes.iter().map(|node| node.name.as_str()).collect();
        let _ = writeln!(text, "ROM {}: {}", rom.name, rom.origin);
        let _ = writeln!(text, "  sectors                   {}", sectors_text(rom));
        let _ = writeln!(text, "  reduced coordinates       {}", order_text(rom));
        // For a grid, the first node of every ring represents the others; for many nodes, only some are shown.
        let shown = match rom.extras.grid {
            Some(grid) => {
                let edges = if grid.closed { "" } else { ", four free edges" };
                let _ =
                    writeln!(text, "  contact nodes             {} around x {} along{edges}", grid.around, grid.along);
                grid.around
            }
            None if nodes.len() > LISTED_NODES => {
                let (first, last) = (nodes[0], nodes[nodes.len() - 1]);
                let _ = writeln!(text, "  contact nodes             {} ({first} ... {last})", nodes.len());
                nodes.len().div_ceil(LISTED_NODES)
            }
            None => {
                let _ = writeln!(text, "  contact nodes             {} ({})", nodes.len(), nodes.join(", "));
                1
            }
        };
        for node in rom.contact_nodes.iter().step_by(shown.max(1)) {
            let [a, b, c] = node.position;
            let place = match rom.frame {
                DisplacementFrame::Cylindrical => {
                    format!("r {a:.6} m, θ {b:.6} rad, z {c:.6} m, slope {:.4}", node.meridional_slope)
                }
                DisplacementFrame::Cartesian => format!("x {a:.6} m, y {b:.6} m, z {c:.6} m"),
            };
            let _ = writeln!(text, "    {:<24}{place}", node.name);
        }
        text.push_str(&rows_text(rom));
        let _ = writeln!(text, "  damping ratio             {}", rom.damping_ratio);
        text.push_str(&extras_text(rom));
        let _ = writeln!(text, "  largest frequency         {:.6e} rad/s", self.largest_angular_frequency);
        text.push_str(&self.steps_text());
        if rom.frame == DisplacementFrame::Cylindrical {
            let friction = self.solvable_friction.map_or("none".into(), |value| format!("{value}"));
            let _ = writeln!(text, "  contact solvable up to µ  {friction} (all nodes closed, tried up to 2)");
            let lock_up = self.lock_up_text();
            let _ = writeln!(text, "  locks up above µ*         {lock_up}");
        }
        self.write_frequencies(&mut text);
        self.write_checks(&mut text);
        self.write_responses(&mut text);
        if let Some(errors) = estimate::rom_errors_text(&estimate::of_rom(rom)) {
            let _ = writeln!(text, "\n  {errors}");
        }
        text
    }

    /// Writes the deviations of the response at the contact nodes.
    fn write_responses(&self, text: &mut String) {
        let checks = &self.rom.checks;
        let worst = |values: &[f64]| values.iter().fold(0.0, |worst: f64, value| worst.max(*value));
        if let Some(last) = checks.response_frequencies.last() {
            let (rest, forced) = (worst(&checks.flexibility_deviation), worst(&checks.response_deviation));
            let _ = writeln!(
                text,
                "\n  deviation from the full model at the contact nodes: static response {rest:.1e} %, \
                 dynamic response up to {last:.0} Hz {forced:.1e} %"
            );
        }
    }

    /// Returns the lower lock-up friction of both senses.
    fn least_lock_up(&self) -> Option<&LockUp> {
        self.lock_up.iter().flatten().min_by(|a, b| a.friction.total_cmp(&b.friction))
    }

    /// Returns a warning if the blade locks up with little friction in the sense of a positive speed, and with much more or none in the other sense:
    /// it may be staggered for the opposite rotation.
    pub fn sense_warning(&self) -> Option<String> {
        let [forward, backward] =
            self.lock_up.each_ref().map(|found| found.as_ref().map_or(f64::INFINITY, |own| own.friction));
        if forward >= USUAL_FRICTION || backward < OTHER_SENSE * forward {
            return None;
        }
        let other = if backward.is_finite() {
            format!("only at µ = {backward:.2} and above")
        } else {
            "at no friction coefficient".to_owned()
        };
        let ahead = self.leading_edge().map_or(String::new(), |node| {
            format!(" With a positive `speed`, the edge at z = {:.4} m ({}) leads.", node.position[2], node.name)
        });
        Some(format!(
            "the tip locks up at friction µ* = {forward:.2} and above when the rotor turns towards +θ (positive `speed`), but \
             {other} when it turns towards −θ: is the blade staggered for the opposite sense of rotation?{ahead} If \
             the other edge should lead, give a negative `speed`, or mirror the mesh"
        ))
    }

    /// Returns the contact node at the end of the chord that leads when the rotor turns towards +θ.
    fn leading_edge(&self) -> Option<&ContactNode> {
        let nodes = &self.rom.contact_nodes;
        let along = |a: &&ContactNode, b: &&ContactNode| a.position[2].total_cmp(&b.position[2]);
        let ends = [nodes.iter().min_by(along)?, nodes.iter().max_by(along)?];
        ends.into_iter().max_by(|a, b| a.position[1].total_cmp(&b.position[1]))
    }

    /// Formats lock-up frictions: "0.080 (closed at tip_2, nodal diameter 0, sliding in +θ); 0.310 (closed at tip_1, nodal diameter 0, sliding in
    /// −θ)".
    pub(crate) fn lock_up_text(&self) -> String {
        let reported = |LockUp { friction, closed, sense }: &LockUp| {
            format!("{friction:.3} (closed at {closed}, sliding in {})", ["+θ", "−θ"][*sense])
        };
        let senses: Vec<String> = self.lock_up.iter().flatten().map(reported).collect();
        if senses.is_empty() { "none".to_owned() } else { senses.join("; ") }
    }

    /// Describes the conditions of the limits.
    pub(crate) fn steps_hold_for(&self) -> String {
        match self.sliding {
            Some(KnownContact { friction, speed }) if friction > 0.0 && !self.rom.is_cyclic() => {
                let sense = if speed > 0.0 { "+θ" } else { "−θ" };
                let sense = if speed == 0.0 { "either sense" } else { sense };
                format!(
                    "for one sector, with µ = {friction} and sliding in {sense}; the friction check of a run may require smaller steps"
                )
            }
            Some(sliding) if sliding.friction > 0.0 => {
                "for the disk; with friction, a scene may require smaller steps".to_owned()
            }
            Some(_) => "without friction".to_owned(),
            None => "without friction; with friction, a scene may require smaller steps".to_owned(),
        }
    }

    fn steps_text(&self) -> String {
        let mut text = format!("  all steps accepted below  {}\n", self.steps_hold_for());
        for limit in &self.step_limits {
            let _ = writeln!(text, "    {:<24}{}", limit.scheme, limit.to_text());
        }
        let resolved = self.central_difference_limit;
        let _ = writeln!(text, "    all modes resolved up to {resolved:.4e} s");
        text
    }

    /// Writes the first frequencies, for coupled sectors by nodal diameter; omitted if the checks list them.
    fn write_frequencies(&self, text: &mut String) {
        let list = |frequencies: &[f64], separator: &str| {
            let first = frequencies.iter().take(FREQUENCIES_SHOWN).map(|value| format!("{value:.2}"));
            first.collect::<Vec<_>>().join(separator)
        };
        if !self.by_nodal_diameter.is_empty() {
            let _ = writeln!(text, "  first frequencies (Hz) by nodal diameter");
            for (number, frequencies) in self.by_nodal_diameter.iter().enumerate() {
                let columns: Vec<String> =
                    frequencies.iter().take(FREQUENCIES_SHOWN).map(|value| format!("{value:>11.2}")).collect();
                let _ = writeln!(text, "    {number:>3} {}   ({} coordinates)", columns.concat(), frequencies.len());
            }
        } else if self.checks().is_empty() {
            let _ = writeln!(text, "  first frequencies (Hz)    {}", list(&self.frequencies, "  "));
        }
    }

    fn write_checks(&self, text: &mut String) {
        let checks = self.checks();
        if checks.is_empty() {
            return;
        }
        let of = |number: Option<u32>| number.map_or(String::new(), |number| format!("{number:>5}"));
        let heading = if checks[0].nodal_diameter.is_some() { "    n" } else { "" };
        let _ = writeln!(
            text,
            "\n  mode{heading}    full (Hz)   reduced (Hz)   deviation eq. 13 (%)   residual eq. 12 (%)"
        );
        for (row, mode) in checks.iter().zip(1..).take(ROWS_SHOWN) {
            let CheckRow { full, reduced, nodal_diameter, .. } = row;
            let [deviation, residual] = [row.deviation, row.residual].map(not_negative_zero);
            let number = of(*nodal_diameter);
            let _ =
                writeln!(text, "  {mode:>4}{number} {full:>12.3} {reduced:>14.3} {deviation:>22.5} {residual:>21.5}");
        }
        if let Some(rest) = OmittedRows::of(&checks, ROWS_SHOWN) {
            let _ = writeln!(
                text,
                "  {} more, up to {:.1} Hz: deviation at most {:.5} %, residual at most {:.5} %",
                rest.count, rest.frequency, rest.deviation, rest.residual
            );
        }
    }

    /// Returns the largest stable step of every scheme with fixed steps, and the contact for which it holds, as JSON.
    fn step_limits_json(&self) -> Value {
        let of = |scheme: Scheme| self.step_limits.iter().find(|limit| limit.scheme == scheme.name());
        let limits = Scheme::RECURRENCES.map(|scheme| (scheme.name(), json!(of(scheme).and_then(StepLimit::below))));
        let others = [
            ("friction", json!(self.sliding.map(|sliding| sliding.friction))),
            ("modal-exact_resolves_all_modes_up_to", json!(self.central_difference_limit)),
        ];
        limits.into_iter().chain(others).collect()
    }

    /// Returns the facts as JSON.
    pub fn to_json(&self) -> Value {
        let rom = &self.rom;
        json!({
            "name": rom.name,
            "origin": rom.origin,
            "sectors": rom.sectors,
            "order": rom.order(),
            "nodal_diameters": rom.is_cyclic().then(|| json!({
                "orders": self.by_nodal_diameter.iter().map(Vec::len).collect::<Vec<_>>(),
                "total_order": rom.total_order(),
                "frequencies_hz": self.by_nodal_diameter,
            })),
            "contact_nodes": rom.contact_nodes.iter().map(|node| json!({
                "name": node.name, "position": node.position, "meridional_slope": node.meridional_slope,
                "area": node.area, "length": node.length,
            })).collect::<Vec<_>>(),
            "damping_ratio": rom.damping_ratio,
            "contact_rows": rom.rows(),
            "contact_grid": rom.extras.grid.map(|grid| json!({
                "around": grid.around, "along": grid.along, "closed": grid.closed,
            })),
            "spin": rom.extras.spin.as_ref().map(|spin| json!({ "largest_speed": spin.largest_speed })),
            "thermal_patches": rom.extras.thermal.as_ref().map(|thermal| {
                thermal.patches.iter().map(|patch| json!({ "angle": patch.angle, "axial": patch.axial }))
                    .collect::<Vec<_>>()
            }),
            "frequencies_hz": self.frequencies,
            "largest_angular_frequency": self.largest_angular_frequency,
            "largest_stable_step": self.step_limits_json(),
            "solvable_up_to_friction": self.solvable_friction,
            "locks_up_above": self.least_lock_up().map(lock_up_json),
            "locks_up_by_sense": self.lock_up.iter().flatten().map(lock_up_json).collect::<Vec<_>>(),
            "checks": self.checks().iter().map(|row| json!({
                "full_hz": row.full,
                "reduced_hz": row.reduced,
                "frequency_deviation_percent": row.deviation,
                "residual_criterion_percent": row.residual,
                "nodal_diameter": row.nodal_diameter,
            })).collect::<Vec<_>>(),
            "flexibility_deviation_percent": rom.checks.flexibility_deviation,
            "response_hz": rom.checks.response_frequencies,
            "response_deviation_percent": rom.checks.response_deviation,
            "rub_errors": rom.checks.rub_errors.as_ref().map(|errors| json!({
                "found_on": errors.found_on, "modes": errors.modes, "patches": errors.patches, "rows": errors.rows,
                "mesh": errors.mesh,
            })),
        })
    }
}

/// Summary of the omitted rows of a long table of checks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OmittedRows {
    pub count: usize,
    pub frequency: f64,
    pub deviation: f64,
    pub residual: f64,
}

impl OmittedRows {
    /// Summarises the rows from `shown` on; `None` if there are none.
    pub fn of(checks: &[CheckRow], shown: usize) -> Option<Self> {
        let rest = checks.get(shown..).filter(|rest| !rest.is_empty())?;
        let most = |value: &dyn Fn(&CheckRow) -> f64| rest.iter().map(value).fold(0.0, f64::max);
        Some(Self {
            count: rest.len(),
            frequency: most(&|row| row.full),
            deviation: most(&|row| row.deviation.abs()),
            residual: most(&|row| row.residual),
        })
    }
}

fn lock_up_json(found: &LockUp) -> Value {
    json!({
        "friction": found.friction, "closed": found.closed, "sense": if found.sense == 0 { 1 } else { -1 },
    })
}

/// Describes the number of sectors and their coupling.
pub(crate) fn sectors_text(rom: &Rom) -> String {
    match (rom.is_cyclic(), rom.sectors) {
        (true, sectors) => format!("{sectors}, coupled: nodal diameters 0 to {}", rom.largest_nodal_diameter()),
        (false, sectors) => sectors.to_string(),
    }
}

/// Describes the number of reduced coordinates, which may differ between nodal diameters.
pub(crate) fn order_text(rom: &Rom) -> String {
    if !rom.is_cyclic() {
        return format!("{} per sector", rom.order());
    }
    let orders = rom.extras.harmonics.iter().map(|harmonic| harmonic.mass.nrows()).chain([rom.order()]);
    let (low, high) = orders.fold((usize::MAX, 0), |(low, high), order| (low.min(order), high.max(order)));
    let each = if low == high { format!("{low}") } else { format!("{low} to {high}") };
    format!("{each} per nodal diameter, {} for the whole disk", rom.total_order())
}

/// Describes rows of patches; empty for contact nodes.
fn rows_text(rom: &Rom) -> String {
    if rom.frame == DisplacementFrame::Cartesian || rom.contact_nodes.iter().any(|node| node.area <= 0.0) {
        return String::new();
    }
    let alone = match rom.rows() {
        1 => ": the sides of the tip do not touch separately (this requires --contact-rows 2)",
        _ => "",
    };
    format!("  rows across the thickness {}{alone}\n", rom.rows())
}

/// Describes spin matrices and thermal loads; empty for a ROM without them.
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
