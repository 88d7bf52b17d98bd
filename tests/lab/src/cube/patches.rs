//! The faces of the cube as patches: means of gaps over hat functions instead of nodes. Global quantities against finer
//! meshes, symmetry, energy, and GetFEM's table of the same flight.

use serde_json::{Value, json};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::Interpolation;
use tiprub_core::{Rom, Scene};
use tiprub_gallery::{reduction, rom_cache::RomCache};
use tiprub_model::cube::{CubeOptions, MassMatrix, RingOptions, RingSide};
use tiprub_reference::{
    compare::{asymmetry, exit_speed, windowed},
    cube::{history::CubeHistory, outside},
};
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::Statement;

use super::{
    LEDGER, SYMMETRIC,
    product::{Product, ProductRun},
    runs::{CubeFlight, RECORD},
};

/// GetFEM's flight: facets, consistent mass, forces that enforce the gaps of nodes.
const GETFEM: &str = include_str!("../../../../src/reference/tests/data/cube_getfem_held.csv");
/// Elements along a side of the cube, and patches along a side of its faces; `None` means its nodes.
const CASES: [(usize, Option<usize>); 9] = [
    (5, None),
    (5, Some(2)),
    (5, Some(3)),
    (5, Some(4)),
    (5, Some(6)),
    (7, None),
    (7, Some(4)),
    (7, Some(6)),
    (7, Some(8)),
];
const QUICK_CASES: [(usize, Option<usize>); 2] = [(5, None), (5, Some(3))];
/// End times (s): of the fast flight, which is over then, and of the slow one.
const FAST_END: f64 = 1.2e-3;
const SLOW_END: f64 = 2.1e-3;

fn product(interpolation: Interpolation) -> Product {
    Product { solver: Solver::Lcp, scheme: Scheme::ModalExact, step: 5e-7, interpolation }
}

/// One kind of contact.
#[derive(Debug, Clone)]
pub(super) struct Patched {
    name: String,
    /// Impulse of the left face (N·s) and final speed (m/s) of the fast flight.
    impulse: f64,
    exit: f64,
    /// Differences of left and right: displacements and forces.
    apart: [f64; 2],
    residual: f64,
    /// Deepest penetration of contact nodes or patches (m).
    deepest: f64,
    /// Largest fraction of energy lost without friction, and final speed (m/s), of the slow flight.
    slow: Option<[f64; 2]>,
    /// Comparison with GetFEM: relative difference of the left face's impulse, and of the loss of speed of the cube's
    /// centre (L2).
    getfem: Option<[f64; 2]>,
}

/// Results of all cases.
#[derive(Debug, Clone)]
pub(super) struct PatchStudy(Vec<Patched>);

struct PatchRuns<'a> {
    scene: &'a Scene,
    fast: &'a CubeFlight,
    slow: CubeFlight,
    end: Option<f64>,
    tools: (&'a RomCache, &'a Console),
}

impl PatchStudy {
    /// Reduces the models and runs the flights. Quick ones end early (`end`, s) and include the fast flight only.
    ///
    /// # Errors
    /// A reduction or a run that is rejected; never with the built-in models.
    pub(super) fn new(
        scene: &Scene,
        (fast, slow): (&CubeFlight, CubeFlight),
        end: Option<f64>,
        tools: (&RomCache, &Console),
    ) -> Result<Self> {
        let work = PatchRuns { scene, fast, slow, end, tools };
        let cases = if end.is_some() { &QUICK_CASES[..] } else { &CASES[..] };
        Ok(Self(cases.iter().map(|(elements, patches)| work.patched(*elements, *patches)).collect::<Result<_>>()?))
    }

    pub(super) fn statements(&self) -> Vec<Statement> {
        let apart: Vec<f64> = self.0.iter().flat_map(|one| one.apart).collect();
        let residual = self.0.iter().map(|one| one.residual).fold(0.0, f64::max);
        let mut found = vec![Statement::tested(
            format!(
                "With patches, left and right agree to within {SYMMETRIC:e}, and the energy balance closes to \
                     {LEDGER:e}"
            ),
            apart.iter().all(|apart| *apart < SYMMETRIC) && residual < LEDGER,
            format!("largest difference {:.0e}, residual {residual:.0e}", apart.iter().fold(0.0_f64, |a, b| a.max(*b))),
        )];
        // The first contact of the corners does not represent the whole flight.
        if self.0.iter().all(|one| one.slow.is_some()) {
            let impulse = |start: &str| self.0.iter().find(|one| one.name.starts_with(start)).map(|one| one.impulse);
            let nodes = impulse("5, nodes").unwrap_or(f64::NAN);
            let patches =
                ["5, 2 ×", "5, 3 ×", "5, 4 ×", "5, 6 ×"].map(|start| impulse(start).unwrap_or(f64::NAN) / nodes - 1.0);
            let reported = patches.map(|share| format!("{:+.1} %", 100.0 * share));
            found.push(Statement::tested(
                "With more patches on the flat faces, the impulse of the left face comes closer to that of contact \
                 nodes",
                patches.is_sorted_by(|a, b| a.abs() > b.abs()),
                reported.join(", "),
            ));
        }
        found
    }

    pub(super) fn json(&self) -> Value {
        let row = |one: &Patched| {
            json!({
                "contact": one.name, "left_impulse": one.impulse, "exit_speed": one.exit, "asymmetry": one.apart,
                "ledger_residual": one.residual, "deepest": one.deepest, "slow": one.slow, "getfem": one.getfem,
            })
        };
        self.0.iter().map(row).collect()
    }

    pub(super) fn markdown(&self) -> String {
        let mut text = String::from(
            "## Patches\n\n| elements, contact | left face, impulse (N·s) | exit (m/s) | left/right: ux, λ | energy \
             residual | largest penetration (m) | 50 m/s, µ = 0: energy loss | exit (m/s) | against GetFEM: left face, \
             impulse | speed loss |\n|---|---|---|---|---|---|---|---|---|---|\n",
        );
        let shares = |pair: Option<[f64; 2]>, digits: usize, second: &dyn Fn(f64) -> String| match pair {
            Some([a, b]) => format!("{:.digits$} % | {}", 100.0 * a, second(b)),
            None => "– | –".to_owned(),
        };
        for one in &self.0 {
            let [moved, force] = one.apart;
            text.push_str(&format!(
                "| {} | {:.2} | {:.3} | {moved:.0e}, {force:.0e} | {:.0e} | {:.0e} | {} | {} |\n",
                one.name,
                one.impulse,
                one.exit,
                one.residual,
                one.deepest,
                shares(one.slow, 3, &|exit| format!("{exit:.3}")),
                shares(one.getfem, 2, &|lost| format!("{:.2} %", 100.0 * lost)),
            ));
        }
        text
    }
}

impl PatchRuns<'_> {
    fn patched(&self, elements: usize, patches: Option<usize>) -> Result<Patched> {
        let lumped = self.with(elements, patches, MassMatrix::Lumped)?;
        let fast = self.run(&lumped, self.fast, Interpolation::Spline, self.end.unwrap_or(FAST_END))?;
        let slow = match self.end {
            Some(_) => None,
            None => {
                let run = self.run(&lumped, &self.slow, Interpolation::Spline, SLOW_END)?;
                let total = run.history.total();
                let least =
                    total.iter().zip(&run.curvature).map(|(total, gain)| total - gain).fold(f64::INFINITY, f64::min);
                Some([1.0 - least / total[0], exit_speed(&run.history)])
            }
        };
        let touching = patches.map_or("nodes".to_owned(), |side| format!("{side} × {side} patches"));
        Ok(Patched {
            name: format!("{elements}, {touching}"),
            impulse: impulse(&fast.history, fast.history.times[fast.history.times.len() - 1]),
            exit: exit_speed(&fast.history),
            apart: asymmetry(&fast.history, f64::MAX),
            residual: fast.residual,
            deepest: fast.history.penetration.iter().fold(0.0, |most: f64, depth| most.max(*depth)),
            slow,
            getfem: if self.end.is_some() || elements != 5 { None } else { Some(self.beside_getfem(patches)?) },
        })
    }

    fn beside_getfem(&self, patches: Option<usize>) -> Result<[f64; 2]> {
        let theirs = outside::read(GETFEM, self.fast.speed).map_err(|error| Failure::from_below("lab cube", error))?;
        let end = theirs.times[theirs.times.len() - 1];
        let mut scene = self.with(5, patches, MassMatrix::Consistent)?;
        for side in RingSide::BOTH {
            let options = RingOptions { mass: MassMatrix::Consistent, ..RingOptions::new(side) };
            let rom = self.tools.0.get(
                &format!("{}-study-consistent", options.name.replace('_', "-")),
                &options,
                self.tools.1,
                &|| Ok(reduction::cube_ring(&options, self.tools.1)?.rom),
            )?;
            replace(&mut scene, rom)?;
        }
        let own = self.run(&scene, self.fast, Interpolation::Facets, end)?.history;
        let times: Vec<f64> = (1..=100).map(|sample| end * f64::from(sample) / 100.0).collect();
        let lost =
            |history: &CubeHistory| history.velocity.iter().map(|v| v[1] + self.fast.speed).collect::<Vec<f64>>();
        let lost =
            tiprub_reference::compare::relative_l2((&own.times, &lost(&own)), (&theirs.times, &lost(&theirs)), &times);
        Ok([impulse(&own, end) / impulse(&theirs, end) - 1.0, lost])
    }

    /// Returns the scene with this cube and all its modes.
    fn with(&self, elements: usize, patches: Option<usize>, mass: MassMatrix) -> Result<Scene> {
        let (cache, console) = self.tools;
        let options = CubeOptions { elements, mass, patches: patches.map(|side| [side; 2]), ..CubeOptions::default() };
        let mut scene = self.scene.clone();
        if options != CubeOptions::default() {
            let kind = if mass == MassMatrix::Lumped { "" } else { "-consistent" };
            let file = format!("cube-study-{elements}-patches-{}{kind}", patches.unwrap_or(0));
            replace(&mut scene, cache.get(&file, &options, console, &|| Ok(reduction::cube(&options, console)?.rom))?)?;
        }
        Ok(scene)
    }

    fn run(&self, scene: &Scene, flight: &CubeFlight, interpolation: Interpolation, end: f64) -> Result<ProductRun> {
        let run = product(interpolation).run(scene, flight, end, RECORD);
        run.map_err(|error| Failure::from_below("lab cube", error))
    }
}

/// Returns the impulse of the left face up to a time (s).
fn impulse(history: &CubeHistory, end: f64) -> f64 {
    let left: Vec<f64> = history.forces.iter().map(|sides| sides[0]).collect();
    windowed(&history.times, &left, end, end)[0] * end
}

/// Replaces the ROM of the same name.
pub(super) fn replace(scene: &mut Scene, rom: Rom) -> Result<()> {
    let missing = || Failure::new("lab cube", format!("the scene has no structure `{}`", rom.name), "");
    let place = scene.roms.iter().position(|old| old.name == rom.name).ok_or_else(missing)?;
    scene.roms[place] = rom;
    Ok(())
}
