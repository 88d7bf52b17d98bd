//! Number of modes that the bodies need: cube and rings with more and fewer modes than the built-in models.

use serde_json::{Value, json};
use tiprub_core::Scene;
use tiprub_core::scene::method::Scheme;
use tiprub_core::scene::method::Solver;
use tiprub_core::scene::settings::Interpolation;
use tiprub_gallery::{reduction, rom_cache::RomCache};
use tiprub_model::cube::{CubeOptions, RingOptions, RingSide};
use tiprub_reference::{compare::agreement, cube::history::CubeHistory};
use tiprub_shell::{Failure, Result, console::Console};

use super::{
    patches::replace,
    product::{Product, ProductRun},
    runs::{CubeFlight, RECORD, released},
};

/// Modes and static responses of the rings.
const RINGS: [[usize; 2]; 7] = [[20, 0], [40, 0], [60, 60], [100, 0], [300, 0], [200, 400], [200, 1000]];
const QUICK_RINGS: [[usize; 2]; 2] = [[20, 0], [100, 0]];
/// Numbers of fixed-interface modes of the cube; the last is all of them.
const CUBE: [usize; 5] = [30, 60, 120, 240, 432];
/// End of the runs (s): while node 1 touches, and the windows of its force.
const END: f64 = 4.5e-4;
/// The paper's method on reduced models.
const PRODUCT: Product = Product {
    solver: Solver::Film,
    scheme: Scheme::CentralDifference,
    step: 5e-7,
    interpolation: Interpolation::Spline,
};

/// A run with one body reduced differently.
#[derive(Debug, Clone)]
pub(crate) struct CubeSize {
    pub modes: usize,
    pub static_responses: usize,
    /// Size of the ROM file (bytes).
    pub bytes: usize,
    /// Relative L2 differences of u1x, slowing, u1z while node 1 touches, and of the windows of its force.
    pub apart: [f64; 4],
    /// Processor time of the steps (s).
    pub seconds: f64,
}

/// Rings compared with method a, and the cube with all its modes.
#[derive(Debug, Clone)]
pub(crate) struct SizeStudy {
    pub rings: Vec<CubeSize>,
    pub cube: Vec<CubeSize>,
}

impl SizeStudy {
    /// Reduces (or loads from the cache), runs and compares; `a` is the flight of method a.
    ///
    /// # Errors
    /// A reduction or a run that is rejected; never with the built-in models.
    pub(super) fn new(
        scene: &Scene,
        flight: &CubeFlight,
        a: &CubeHistory,
        quick: bool,
        tools: (&RomCache, &Console),
    ) -> Result<Self> {
        let last = a.times.last().copied().unwrap_or(0.0);
        let work = SizeRuns { scene, flight, end: END.min(last), touching: released(a), tools };
        let mut rings = Vec::new();
        for [modes, static_responses] in if quick { &QUICK_RINGS[..] } else { &RINGS[..] } {
            rings.push(work.rings(*modes, *static_responses, a)?);
        }
        Ok(Self { rings, cube: if quick { Vec::new() } else { work.cubes()? } })
    }

    /// Returns the study for programs.
    pub(super) fn json(&self) -> Value {
        let rows = |sizes: &[CubeSize]| -> Vec<Value> {
            let row = |size: &CubeSize| {
                json!({
                    "modes": size.modes, "static_responses": size.static_responses, "rom_bytes": size.bytes,
                    "apart": size.apart, "processor_seconds": size.seconds,
                })
            };
            sizes.iter().map(row).collect()
        };
        json!({ "rings": rows(&self.rings), "cube": rows(&self.cube) })
    }

    /// Returns both tables.
    pub(super) fn markdown(&self) -> String {
        let percent = |share: f64| format!("{:.3} %", 100.0 * share);
        let mut text = String::from(
            "## Reduced models\n\nRings, compared with method a:\n\n| modes | static responses | ROM file (MB) | u1x | \
             slowing | u1z | λ1, windows | \
             steps (CPU s) |\n|---|---|---|---|---|---|---|---|\n",
        );
        for CubeSize { modes, static_responses, bytes, apart, seconds } in &self.rings {
            let shares = apart.map(percent).join(" | ");
            let megabytes = *bytes as f64 / 1e6;
            text.push_str(&format!("| {modes} | {static_responses} | {megabytes:.1} | {shares} | {seconds:.2} |\n"));
        }
        if !self.cube.is_empty() {
            text.push_str(
                "\nCube, compared with the model with all modes:\n\n| fixed-interface modes | u1x | slowing | u1z | \
                 λ1, windows |\n|---|---|---|---|---|\n",
            );
        }
        for size in &self.cube {
            text.push_str(&format!("| {} | {} |\n", size.modes, size.apart.map(percent).join(" | ")));
        }
        text
    }
}

struct SizeRuns<'a> {
    scene: &'a Scene,
    flight: &'a CubeFlight,
    end: f64,
    /// Contact time of node 1 (s).
    touching: f64,
    tools: (&'a RomCache, &'a Console),
}

impl SizeRuns<'_> {
    fn rings(&self, modes: usize, static_responses: usize, a: &CubeHistory) -> Result<CubeSize> {
        let (cache, console) = self.tools;
        let mut scene = self.scene.clone();
        let mut bytes = 0;
        for (side, name) in [(RingSide::Left, "left"), (RingSide::Right, "right")] {
            let options = RingOptions { modes, static_responses, ..RingOptions::new(side) };
            let file = format!("ring-{name}-study-{modes}-{static_responses}");
            let rom = cache.get(&file, &options, console, &|| Ok(reduction::cube_ring(&options, console)?.rom))?;
            bytes = tiprub_format::write_rom(&rom).len();
            replace(&mut scene, rom)?;
        }
        let run = self.run(&scene)?;
        Ok(self.size([modes, static_responses], bytes, &run, a))
    }

    fn cubes(&self) -> Result<Vec<CubeSize>> {
        let (cache, console) = self.tools;
        let mut runs = Vec::new();
        for modes in CUBE {
            let options = CubeOptions { modes: Some(modes), ..CubeOptions::default() };
            let file = format!("cube-study-{modes}");
            let rom = cache.get(&file, &options, console, &|| Ok(reduction::cube(&options, console)?.rom))?;
            let bytes = tiprub_format::write_rom(&rom).len();
            let mut scene = self.scene.clone();
            replace(&mut scene, rom)?;
            runs.push((modes, bytes, self.run(&scene)?));
        }
        let Some((.., all)) = runs.last() else { return Ok(Vec::new()) };
        Ok(runs.iter().map(|(modes, bytes, run)| self.size([*modes, 0], *bytes, run, &all.history)).collect())
    }

    fn run(&self, scene: &Scene) -> Result<ProductRun> {
        let run = PRODUCT.run(scene, self.flight, self.end, RECORD);
        run.map_err(|error| Failure::from_below("lab cube", error))
    }

    fn size(
        &self,
        [modes, static_responses]: [usize; 2],
        bytes: usize,
        run: &ProductRun,
        other: &CubeHistory,
    ) -> CubeSize {
        let found = agreement(&run.history, other, self.flight.speed, self.touching, self.end);
        let [x, slowing, z] = found.touching;
        let seconds = run.history.processor_time;
        CubeSize { modes, static_responses, bytes, apart: [x, slowing, z, found.windows], seconds }
    }
}
