//! Creates the scenes of every level of a direction: other steps, modes, contact nodes, patches and meshes.

use tiprub_core::modes::modal::ModalModel;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_core::{Rom, Scene};
use tiprub_format::builtin_model;
use tiprub_gallery::{
    builtin::{self, ModelVariant},
    scene_source::BUILTIN,
};
use tiprub_model::rotor37::TipContact;
use tiprub_shell::{Failure, Result};

use super::{
    coarsen::coarsened,
    nodes::{common_start, named_as, starting_with},
    refine::{
        Again, MESH, MESH_NODES, MODES_KEPT, Meshed, NODES, OF_CLEARANCE, RefinementDirection, RefinementLevel,
        RomSource, SECONDS, STEP, is_adaptive, with_division,
    },
    rows::MOST_ROWS,
    truncate::{Truncation, truncated},
};
use crate::{master, stability::scene::divided};

/// Internal steps relative to the scene's, coarsest first.
const STEPS: [f64; 5] = [4.0, 2.0, 1.0, 0.5, 0.25];
const QUICK_STEPS: [f64; 3] = [2.0, 1.0, 0.5];
/// Tolerances relative to the scene's, coarsest first.
const DECADES: [f64; 4] = [10.0, 1.0, 0.1, 0.01];
/// Fractions of the modes of the ROM.
const FEWER: [f64; 3] = [0.25, 0.5, 0.75];
const QUICK_FEWER: [f64; 1] = [0.5];
/// Larger numbers of modes relative to the ROM, if the model can be reduced again.
const MORE: [f64; 2] = [1.5, 2.0];
const QUICK_MORE: [f64; 1] = [1.5];
/// Two models count as the same if their frequencies and contact nodes agree to this relative tolerance.
const SAME: f64 = 1e-6;
/// Creates variants of the models of a scene.
pub(crate) struct Refiner<'a> {
    pub(super) scene: &'a Scene,
    /// Internal steps per communication step, or the inverse of the tolerance.
    own: u32,
    pub(super) again: &'a Again<'a>,
    /// Number of nodes of the master's mesh, if it can be reduced again.
    mesh_nodes: Option<usize>,
}

impl<'a> Refiner<'a> {
    /// Creates the refiner, and checks that the source reproduces the model of the scene.
    ///
    /// # Errors
    /// The source does not reproduce the model, or its reduction fails.
    pub(crate) fn checked(scene: &'a Scene, own: u32, again: &'a Again<'a>) -> Result<Self> {
        let mut refiner = Self { scene, own, again, mesh_nodes: None };
        refiner.mesh_nodes = match again.source {
            Some(source) => Some(refiner.check(source)?),
            None => refiner.with_chord().and_then(|name| builtin::mesh_nodes(name, again.mesh)).transpose()?,
        };
        Ok(refiner)
    }

    /// Returns one scene per factor, with as many times its modes and intervals between contact points, and with more rows of patches as far as the
    /// mesh allows; empty if the master cannot be reduced again.
    pub(crate) fn finer(&self, factors: &[usize]) -> Vec<Scene> {
        let own = self.scene.roms[master(self.scene)].rows();
        // First one more row, then as many as show how straight the tip stays; the mesh limits the number of rows.
        let rows = |factor: usize| (own..=MOST_ROWS.min(own + factor / 2).max(own)).rev();
        factors.iter().map_while(|factor| rows(*factor).find_map(|rows| self.finer_in_rows(*factor, rows))).collect()
    }

    fn finer_in_rows(&self, factor: usize, rows: usize) -> Option<Scene> {
        let index = master(self.scene);
        let own = &self.scene.roms[index];
        let (modes, points) = self.own_counts();
        let start = common_start(self.scene, index);
        let tip = match start.is_ok() {
            true => self.tip_in_rows(factor * (points - 1) + 1, rows),
            false => self.tip(points),
        };
        let found = match (self.again.source, self.with_chord()) {
            (Some(source), _) => source.reduce(None, factor * modes, tip, self.again.console).map(|found| found.rom),
            (None, Some(name)) => {
                let other = ModelVariant { modes: factor as f64, tip, mesh: self.again.mesh };
                builtin::refined(name, other, self.again.cache, self.again.console)?
            }
            (None, None) => return None,
        };
        let rom = Rom { damping_ratio: own.damping_ratio, ..found.ok()? };
        let rom = match &start {
            Ok(start) => starting_with(start, rom),
            Err(_) => named_as(own, rom),
        };
        Some(self.with_rom(index, rom))
    }

    pub(super) fn level(&self, value: f64, own: bool, scene: Scene) -> RefinementLevel {
        RefinementLevel { value, own, scene, division: self.own }
    }

    pub(super) fn with_rom(&self, index: usize, rom: Rom) -> Scene {
        let mut scene = self.scene.clone();
        scene.roms[index] = rom;
        scene
    }

    /// Returns the number of fixed-interface modes of the master, and of its contact nodes along the chord.
    pub(super) fn own_counts(&self) -> (usize, usize) {
        let rom = &self.scene.roms[master(self.scene)];
        (rom.order().saturating_sub(rom.contact_map.nrows()), rom.contact_nodes.len() / rom.rows())
    }

    /// Returns a tip with `count` nodes along the chord, or with as many patches in each row if the master has patches.
    pub(super) fn tip(&self, count: usize) -> TipContact {
        self.tip_in_rows(count, self.scene.roms[master(self.scene)].rows())
    }

    pub(super) fn tip_in_rows(&self, count: usize, rows: usize) -> TipContact {
        let nodes = &self.scene.roms[master(self.scene)].contact_nodes;
        if nodes.iter().all(|node| node.area > 0.0) {
            TipContact::patches([count, rows])
        } else {
            TipContact::Nodes(count)
        }
    }

    /// Reduces the model from the source, with the damping of the scene's ROM, because the command line may propose another damping.
    fn reduced(&self, source: &dyn RomSource, other: Option<usize>, [modes, nodes]: [usize; 2]) -> Result<Meshed> {
        let found = source.reduce(other, modes, self.tip(nodes), self.again.console)?;
        let damping_ratio = self.scene.roms[master(self.scene)].damping_ratio;
        Ok(Meshed { rom: Rom { damping_ratio, ..found.rom }, ..found })
    }

    /// Returns the name of the master's model if it is a built-in model whose contact nodes and mesh can be chosen.
    pub(super) fn with_chord(&self) -> Option<&'a str> {
        let structure = &self.scene.settings.structures[master(self.scene)];
        builtin_model(structure).filter(|name| builtin::has_chord(name))
    }

    /// Checks that the source reproduces the model of the scene, since the study would otherwise describe another model. Returns the number of nodes
    /// of its mesh.
    fn check(&self, source: &dyn RomSource) -> Result<usize> {
        let rom = &self.scene.roms[master(self.scene)];
        let (modes, nodes) = self.own_counts();
        let Meshed { rom: again, nodes: of_mesh } = self.reduced(source, None, [modes, nodes])?;
        let differs = |problem: String| {
            let remedy =
                "Give the mesh and the options that the ROM was reduced with (sets, material, units, axis, sectors)";
            Err(Failure::new(
                "--mesh",
                format!("the mesh does not reproduce the ROM `{}` of the scene: {problem}", rom.name),
                remedy,
            ))
        };
        if (again.sectors, again.contact_nodes.len()) != (rom.sectors, rom.contact_nodes.len()) {
            let of = |rom: &Rom| format!("{} contact nodes and {} sectors", rom.contact_nodes.len(), rom.sectors);
            return differs(format!("{} instead of {}", of(&again), of(rom)));
        }
        let size =
            rom.contact_nodes.iter().flat_map(|node| node.position).fold(0.0, |most: f64, value| most.max(value.abs()));
        for (own, other) in rom.contact_nodes.iter().zip(&again.contact_nodes) {
            if own.position.iter().zip(other.position).any(|(a, b)| (a - b).abs() > SAME * size) {
                return differs(format!("contact node `{}` is at a different position", own.name));
            }
        }
        let frequencies = |rom: &Rom| ModalModel::from_rom(rom, 0.0).map(|model| model.frequencies).unwrap_or_default();
        let (own, other) = (frequencies(rom), frequencies(&again));
        let first = |all: &[f64]| all.first().copied().unwrap_or(f64::NAN) / std::f64::consts::TAU;
        let close = own.iter().zip(&other).all(|(a, b)| (a - b).abs() <= SAME * a.abs().max(b.abs()));
        if own.len() == other.len() && close {
            Ok(of_mesh)
        } else {
            differs(format!(
                "first frequency {:.3} Hz instead of {:.3} Hz, {} coordinates instead of {}",
                first(&other),
                first(&own),
                other.len(),
                own.len()
            ))
        }
    }

    pub(super) fn steps(&self) -> RefinementDirection {
        let shares = if self.again.quick { &QUICK_STEPS[..] } else { &STEPS[..] };
        let time = &self.scene.settings.time;
        let tolerant = is_adaptive(self.scene);
        let divided = || divided(self.scene.settings.experiment.communication_step, time.step);
        let step = time.step_tolerance().unwrap_or_else(divided);
        // Tolerances are a decade apart, because errors follow them in steps.
        let shares = if tolerant { DECADES.get(..shares.len()).unwrap_or(&DECADES) } else { shares };
        let mut divisions: Vec<u32> = shares.iter().map(|share| count(f64::from(self.own) / share)).collect();
        divisions.dedup();
        let level = |division: u32| {
            // The level of the scene is the unchanged scene, to the last bit.
            let scene = if division == self.own { self.scene.clone() } else { with_division(self.scene, division) };
            let value = step * f64::from(self.own) / f64::from(division);
            RefinementLevel { value, own: division == self.own, scene, division }
        };
        let levels = divisions.into_iter().map(level).collect();
        let (title, unit) = if tolerant { ("tolerance", OF_CLEARANCE) } else { ("internal step", SECONDS) };
        RefinementDirection { levels, ..RefinementDirection::new(STEP, title.into(), unit) }
    }

    /// Returns the direction for the modes of one structure: fewer of the ROM's modes, and more if the model can be reduced again.
    pub(super) fn modes(&self, index: usize, name: &'static str) -> Result<RefinementDirection> {
        let (rom, structure) = (&self.scene.roms[index], &self.scene.settings.structures[index]);
        let form = Truncation::of(rom);
        let own = form.modes(rom);
        let mut direction = RefinementDirection::new(name, format!("modes of {}", structure.name), MODES_KEPT);
        let fewer = if self.again.quick { &QUICK_FEWER[..] } else { &FEWER[..] };
        let mut counts: Vec<usize> = fewer.iter().map(|share| count(share * own as f64) as usize).collect();
        counts.retain(|count| *count < own);
        counts.dedup();
        for modes in counts {
            match truncated(rom, modes) {
                Ok(rom) => direction.levels.push(self.level(modes as f64, false, self.with_rom(index, rom))),
                Err(why) => direction.misses(format!("{modes} modes: {why}")),
            }
        }
        direction.levels.push(self.level(own as f64, true, self.scene.clone()));
        let more = if self.again.quick { &QUICK_MORE[..] } else { &MORE[..] };
        for factor in more {
            match self.more_modes(index, own, *factor) {
                Some(rom) => {
                    let rom = rom?;
                    let modes = Truncation::of(&rom).modes(&rom);
                    if modes > own {
                        direction.levels.push(self.level(modes as f64, false, self.with_rom(index, rom)));
                    }
                }
                None => direction.misses(no_more(&structure.rom, rom, index == master(self.scene))),
            }
        }
        Ok(direction)
    }

    fn more_modes(&self, index: usize, own: usize, factor: f64) -> Option<Result<Rom>> {
        let rom = &self.scene.roms[index];
        let (nodes, master) = (rom.contact_nodes.len() / rom.rows(), index == master(self.scene));
        let again = match self.again.source.filter(|_| master) {
            Some(source) => {
                self.reduced(source, None, [count(factor * own as f64) as usize, nodes]).map(|found| found.rom)
            }
            None => {
                let name = builtin_model(&self.scene.settings.structures[index])?;
                let mesh = if master { self.again.mesh } else { 1.0 };
                let other = ModelVariant { modes: factor, tip: self.tip(nodes), mesh };
                builtin::refined(name, other, self.again.cache, self.again.console)?
            }
        };
        Some(again.map(|again| named_as(&self.scene.roms[index], again)))
    }

    /// Returns the direction for the contact nodes of the master along its chord; all numbers share the same end points.
    pub(super) fn nodes(&self) -> Result<RefinementDirection> {
        let index = master(self.scene);
        let structure = &self.scene.settings.structures[index];
        let title = format!("contact nodes of {}", structure.name);
        let mut direction = RefinementDirection::new(NODES, title, "nodes");
        let builtin = self.with_chord();
        let (modes, own) = self.own_counts();
        let patches = !matches!(self.tip(own), TipContact::Nodes(_));
        if patches {
            (direction.title, direction.unit) = (format!("contact patches of {}", structure.name), "patches");
            self.fewer_patches(&mut direction);
        }
        if self.again.source.is_none() && builtin.is_none() {
            direction.misses(
                if self.scene.roms[index].frame == DisplacementFrame::Cartesian || structure.rom.starts_with(BUILTIN) {
                    "other numbers of contact nodes are only supported for blades".into()
                } else {
                    let what = if patches { "more patches" } else { "other numbers of contact nodes" };
                    no_source(what, &self.scene.roms[index])
                },
            );
            if !direction.levels.is_empty() {
                direction.levels.push(self.level(own as f64, true, self.scene.clone()));
            }
            return Ok(direction);
        }
        let start = match common_start(self.scene, index) {
            Ok(start) => start,
            Err(why) => {
                direction.levels.clear();
                direction.missing = why;
                return Ok(direction);
            }
        };
        let most = if self.again.quick { 2 } else { self.again.finest_tip };
        let factors = std::iter::successors(Some(1), |factor| Some(2 * factor)).take_while(|factor| *factor <= most);
        let mut counts: Vec<usize> = factors.map(|factor| factor * (own - 1) + 1).collect();
        if !patches {
            counts.push(2);
        }
        counts.sort_unstable();
        counts.dedup();
        for nodes in counts {
            let rom = match (self.again.source, &builtin) {
                _ if nodes == own => Ok(self.scene.roms[index].clone()),
                (Some(source), _) => self.reduced(source, None, [modes, nodes]).map(|found| found.rom),
                (None, name) => self.built_in(name.unwrap_or_default(), nodes, 1.0),
            };
            match rom {
                Ok(rom) if nodes == own => {
                    direction.levels.push(self.level(nodes as f64, true, self.with_rom(index, rom)))
                }
                Ok(rom) => {
                    let scene = self.with_rom(index, starting_with(&start, rom));
                    direction.levels.push(self.level(nodes as f64, false, scene));
                }
                // The number of nodes of the mesh limits the number of contact nodes.
                Err(failure) => direction.misses(format!("{nodes} {}: {failure}", direction.unit)),
            }
        }
        Ok(direction)
    }

    /// Adds half and a quarter of the patches, which follow from the ROM itself, fewest first.
    fn fewer_patches(&self, direction: &mut RefinementDirection) {
        let index = master(self.scene);
        let mut rom = self.scene.roms[index].clone();
        for _ in 0..if self.again.quick { 1 } else { 2 } {
            match coarsened(&rom) {
                Ok(found) => rom = found,
                Err(why) => {
                    direction.misses(why);
                    return;
                }
            }
            let patches = rom.contact_nodes.len() / rom.rows();
            direction.levels.insert(0, self.level(patches as f64, false, self.with_rom(index, rom.clone())));
        }
    }

    /// Reduces a built-in model with another tip or mesh.
    fn built_in(&self, name: &str, nodes: usize, mesh: f64) -> Result<Rom> {
        self.built_in_with(name, self.tip(nodes), mesh)
    }

    pub(super) fn built_in_with(&self, name: &str, tip: TipContact, mesh: f64) -> Result<Rom> {
        let other = ModelVariant { modes: 1.0, tip, mesh: mesh * self.again.mesh };
        let found = builtin::refined(name, other, self.again.cache, self.again.console);
        found.unwrap_or_else(|| Err(Failure::new(name, "no such model", "")))
    }

    /// Returns the direction for meshes of the master with its number of modes and contact nodes.
    ///
    /// # Errors
    /// A mesh cannot be reduced.
    pub(crate) fn meshes(&self) -> Result<RefinementDirection> {
        let index = master(self.scene);
        let (rom, structure) = (&self.scene.roms[index], &self.scene.settings.structures[index]);
        let mut direction = RefinementDirection::new(MESH, format!("mesh of {}", structure.name), MESH_NODES);
        let Some(own_nodes) = self.mesh_nodes else {
            direction.missing = if structure.rom.starts_with(BUILTIN) || rom.frame == DisplacementFrame::Cartesian {
                "other meshes are only supported for blades".into()
            } else {
                no_source("other meshes", rom)
            };
            return Ok(direction);
        };
        let (modes, nodes) = self.own_counts();
        let mut found = Vec::new();
        match (self.again.source, self.with_chord()) {
            (Some(source), _) => {
                for other in 0..source.others() {
                    found.push(self.reduced(source, Some(other), [modes, nodes])?);
                }
                if found.is_empty() {
                    direction.missing =
                        "the mesh error requires other meshes of the same blade: give coarser or finer ones with \
                                         --other-mesh FILE"
                            .into();
                    return Ok(direction);
                }
            }
            (None, name) => {
                let name = name.unwrap_or_default();
                let factors = if self.again.quick { &builtin::MESHES[..1] } else { &builtin::MESHES[..] };
                for factor in factors {
                    let rom = self.built_in(name, nodes, *factor)?;
                    let of_mesh = builtin::mesh_nodes(name, factor * self.again.mesh).transpose()?.unwrap_or_default();
                    found.push(Meshed { rom, nodes: of_mesh });
                }
            }
        }
        direction.levels.push(self.level(own_nodes as f64, true, self.scene.clone()));
        for Meshed { rom: again, nodes } in found {
            let again = named_as(rom, Rom { damping_ratio: rom.damping_ratio, ..again });
            direction.levels.push(self.level(nodes as f64, false, self.with_rom(index, again)));
        }
        direction.levels.sort_by(|a, b| a.value.total_cmp(&b.value));
        Ok(direction)
    }
}

/// Explains why a ROM from a file cannot be refined; coupled sectors are chosen in whole families, which a ROM does not contain.
pub(super) fn no_source(what: &str, rom: &Rom) -> String {
    if rom.is_cyclic() {
        return format!("{what} are not available: the only bladed disk that can be reduced again is the built-in one");
    }
    format!("{what} require the mesh of the ROM: give it with --mesh FILE and the options of the reduction")
}

fn no_more(name: &str, rom: &Rom, master: bool) -> String {
    match (name.starts_with(BUILTIN), master) {
        (true, _) => "the model already has all of its modes".into(),
        (false, true) => no_source("more modes than the ROM has", rom),
        (false, false) => "more modes than the ROM has are only available for the master, with --mesh FILE".into(),
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
fn count(value: f64) -> u32 {
    value.round().clamp(1.0, 1e8) as u32
}
