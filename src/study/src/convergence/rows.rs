//! Refines the rows of contact patches across the thickness of the master's tip.

use tiprub_core::Rom;
use tiprub_model::rotor37::TipContact;
use tiprub_shell::Result;

use super::{
    coarsen::fewer_rows,
    nodes::{common_start, starting_with},
    refine::{ROWS, RefinementDirection},
    refiner::{Refiner, no_source},
};
use crate::master;

/// Maximum number of rows: the two sides and the middle between them.
pub(super) const MOST_ROWS: usize = 3;

impl Refiner<'_> {
    /// Returns the direction for rows: fewer rows follow from the ROM itself, more rows need another reduction; `None` for contact nodes.
    pub(super) fn rows(&self) -> Result<Option<RefinementDirection>> {
        let index = master(self.scene);
        let (modes, along) = self.own_counts();
        let (rom, own) = (&self.scene.roms[index], self.scene.roms[index].rows());
        if matches!(self.tip(along), TipContact::Nodes(_)) {
            return Ok(None);
        }
        let title =
            format!("rows of contact patches of {}, across the thickness", self.scene.settings.structures[index].name);
        let mut direction = RefinementDirection::new(ROWS, title, "rows");
        let fewer = (1..own).filter_map(|rows| Some((rows, fewer_rows(rom, rows).ok()?)));
        for (rows, rom) in fewer {
            direction.levels.push(self.level(rows as f64, false, self.with_rom(index, rom)));
        }
        direction.levels.push(self.level(own as f64, true, self.scene.clone()));
        let start = match common_start(self.scene, index) {
            Ok(start) => start,
            Err(why) => {
                direction.misses(why);
                return Ok(Some(direction));
            }
        };
        for rows in own + 1..=MOST_ROWS {
            match self.in_rows([modes, along, rows]) {
                Some(Ok(found)) => {
                    let found = starting_with(&start, Rom { damping_ratio: rom.damping_ratio, ..found });
                    direction.levels.push(self.level(rows as f64, false, self.with_rom(index, found)));
                }
                // The mesh limits the number of rows.
                Some(Err(failure)) => direction.misses(format!("{rows} rows: {failure}")),
                None => direction.misses(no_source("more rows of patches", rom)),
            }
        }
        Ok(Some(direction))
    }

    /// Reduces the master with this number of modes, patches along the chord and rows; `None` if it cannot be reduced again.
    fn in_rows(&self, [modes, along, rows]: [usize; 3]) -> Option<Result<Rom>> {
        let tip = self.tip_in_rows(along, rows);
        match (self.again.source, self.with_chord()) {
            (Some(source), _) => Some(source.reduce(None, modes, tip, self.again.console).map(|found| found.rom)),
            (None, Some(name)) => Some(self.built_in_with(name, tip, 1.0)),
            (None, None) => None,
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use tiprub_core::Scene;
    use tiprub_gallery::{rom_cache::RomCache, scene_source};
    use tiprub_model::{
        Rotor37Options,
        reduce::ReductionKind,
        reduce_rotor37,
        rotor37::{MeshCounts, TipContact},
    };
    use tiprub_shell::console::Console;

    use super::*;
    use crate::convergence::refine::{Again, Meshed, RomSource};

    /// Coarse blade with patches.
    pub(crate) struct PatchedBlade;

    impl RomSource for PatchedBlade {
        fn reduce(&self, _: Option<usize>, modes: usize, tip: TipContact, _: &Console) -> Result<Meshed> {
            let mesh = MeshCounts { chord: 4, thickness: 2, span: 2 };
            let kind = ReductionKind::FreeInterface;
            let found = reduce_rotor37(&Rotor37Options { mesh, tip, modes, kind, ..Rotor37Options::paper() }, &|_| {});
            let found = found.unwrap();
            // A few blades are enough.
            Ok(Meshed { rom: Rom { sectors: 3, ..found.rom }, nodes: found.nodes })
        }

        fn others(&self) -> usize {
            0
        }
    }

    pub(crate) fn scene(rows: usize) -> Scene {
        let rom = PatchedBlade.reduce(None, 6, TipContact::patches([3, rows]), &Console::new(true, false)).unwrap().rom;
        let mut scene = scene_source::rotor37_scene_with(rom).unwrap();
        scene.settings.structures[0].rom = "own.rom.safetensors".into();
        scene
    }

    #[test]
    fn rows_are_coarsened_from_the_rom_or_refined_from_the_mesh() {
        let (console, cache) = (Console::new(true, false), RomCache::off());
        let found = |rows: usize, source: Option<&dyn RomSource>| {
            let scene = scene(rows);
            let again =
                Again { source, cache: &cache, mesh: 1.0, finest_tip: 4, only: &[], quick: true, console: &console };
            let direction = Refiner::checked(&scene, 1, &again).unwrap().rows().unwrap().unwrap();
            let of = |level: &crate::convergence::refine::RefinementLevel| {
                let rom = &level.scene.roms[0];
                assert_eq!((rom.rows() as f64, rom.contact_nodes.len()), (level.value, 3 * rom.rows()));
                (rom.rows(), level.own)
            };
            (direction.levels.iter().map(of).collect::<Vec<_>>(), direction.missing)
        };
        let (levels, missing) = found(1, Some(&PatchedBlade));
        assert_eq!((levels, missing.as_str()), (vec![(1, true), (2, false), (3, false)], ""));
        let (levels, missing) = found(3, None);
        assert_eq!((levels, missing.as_str()), (vec![(1, false), (2, false), (3, true)], ""));
        let (levels, missing) = found(2, None);
        assert!(levels == [(1, false), (2, true)] && missing.contains("more rows of patches require"), "{missing}");
    }

    /// The first finer model has one more row; the next has as many rows as needed to see whether the tip stays straight, as far as its mesh allows.
    #[test]
    fn finer_models_have_more_patch_rows() {
        let (console, cache) = (Console::new(true, false), RomCache::off());
        for (rows, finer) in [(1, [(5, 2), (9, 3)]), (2, [(5, 3), (9, 3)]), (3, [(5, 3), (9, 3)])] {
            let scene = scene(rows);
            let again = Again {
                source: Some(&PatchedBlade),
                cache: &cache,
                mesh: 1.0,
                finest_tip: 4,
                only: &[],
                quick: true,
                console: &console,
            };
            let found = Refiner::checked(&scene, 1, &again).unwrap().finer(&[2, 4]);
            let tips: Vec<(usize, usize)> = found
                .iter()
                .map(|scene| &scene.roms[0])
                .map(|rom| (rom.contact_nodes.len() / rom.rows(), rom.rows()))
                .collect();
            assert_eq!(tips, finer);
        }
    }

    /// Three rows are needed for an estimate.
    #[test]
    fn row_error_estimate_requires_three_rows() {
        let levels = crate::estimate::rows(&scene(3), 1).unwrap().levels;
        assert_eq!(levels.iter().map(|level| level.scene.roms[0].rows()).collect::<Vec<_>>(), [1, 2, 3]);
        for rows in [1, 2] {
            let why = crate::estimate::rows(&scene(rows), 1).unwrap_err();
            assert!(why.contains(&format!("the ROM has {rows}:")) && why.contains("--contact-rows 3"), "{why}");
        }
    }
}
