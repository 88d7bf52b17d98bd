//! Runs of the study: the product with its schemes and solvers, the reference methods, four flights.

use tiprub_core::Scene;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::Interpolation;
use tiprub_reference::{
    cube::{
        history::CubeHistory,
        scene::{CubeScene as FullScene, CubeSetting, Mass},
    },
    methods::{CubeMethod, MethodRun},
    surface::SurfaceKind,
};
use tiprub_shell::{Failure, Result};

use super::product::{Product, ProductRun};

/// Flight of the cube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CubeFlight {
    /// Speed along −y (m/s).
    pub speed: f64,
    pub friction: f64,
}

/// A method of either kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum CubeCompetitor {
    Product(Product),
    Reference { method: CubeMethod, surface: SurfaceKind, step: f64, stride: usize },
}

/// One run; failures are results.
#[derive(Debug, Clone)]
pub(super) struct CubeRun {
    pub name: &'static str,
    pub competitor: CubeCompetitor,
    pub result: std::result::Result<ProductRun, String>,
}

impl CubeRun {
    pub(super) fn history(&self) -> Option<&CubeHistory> {
        self.result.as_ref().ok().map(|run| &run.history)
    }

    pub(crate) fn is_product(&self) -> bool {
        matches!(self.competitor, CubeCompetitor::Product(_))
    }
}

const fn product(solver: Solver, scheme: Scheme) -> CubeCompetitor {
    CubeCompetitor::Product(Product { solver, scheme, step: 5e-7, interpolation: Interpolation::Spline })
}

fn reference(method: CubeMethod, surface: SurfaceKind, step: f64, stride: usize) -> CubeCompetitor {
    CubeCompetitor::Reference { method, surface, step, stride }
}

/// Name of the product's run with the paper's method, to which statements refer.
pub(super) const PAPER: &str = "product, film, central differences";
pub(crate) const BEST: &str = "product, lcp, modal-exact";
pub(super) const STICKING: &str = "product, coulomb, modal-exact";
/// Name of the reference method a on the same surface.
pub(super) const A: &str = "a, film";
pub(super) const B: &str = "b, bi-potential";
pub(super) const C: &str = "c, augmented Lagrangian";

/// Returns all methods of a flight, also on facets if `facets`.
pub(super) fn competitors(flight: &CubeFlight, quick: bool, facets: bool) -> Vec<(&'static str, CubeCompetitor)> {
    let (film, augmented, spline) =
        (CubeMethod::Film(Default::default()), CubeMethod::Augmented(Default::default()), SurfaceKind::Spline);
    let mut list = vec![
        (A, reference(film, spline, 5e-7, 2)),
        (B, reference(CubeMethod::Bipotential, spline, 1e-6, 1)),
        (PAPER, product(Solver::Film, Scheme::CentralDifference)),
        (BEST, product(Solver::Lcp, Scheme::ModalExact)),
    ];
    if quick {
        return list;
    }
    list.push(("product, lcp, central differences", product(Solver::Lcp, Scheme::CentralDifference)));
    if flight.friction > 0.0 {
        list.push((STICKING, product(Solver::Coulomb, Scheme::ModalExact)));
    }
    list.push((C, reference(augmented, spline, 1e-6, 1)));
    list.push(("d, penalty", reference(CubeMethod::Penalty(Default::default()), spline, 1e-7, 10)));
    if facets {
        let flat = Product {
            solver: Solver::Lcp,
            scheme: Scheme::ModalExact,
            step: 5e-7,
            interpolation: Interpolation::Facets,
        };
        list.push(("b, facets", reference(CubeMethod::Bipotential, SurfaceKind::Facets, 1e-6, 1)));
        list.push(("c, facets", reference(augmented, SurfaceKind::Facets, 1e-6, 1)));
        list.push(("product, lcp, modal-exact, facets", CubeCompetitor::Product(flat)));
    }
    list
}

/// Interval of the records (s), equal for all runs.
pub(crate) const RECORD: f64 = 1e-6;

/// Performs one run to `end` (s), alone, so that the processor time is exact.
///
/// # Errors
/// A full model that cannot be assembled.
pub(super) fn run(
    (name, competitor): (&'static str, CubeCompetitor),
    scene: &Scene,
    flight: &CubeFlight,
    end: f64,
) -> Result<CubeRun> {
    let result = match competitor {
        CubeCompetitor::Product(product) => product.run(scene, flight, end, RECORD).map_err(|error| error.to_string()),
        CubeCompetitor::Reference { method, surface, step, stride } => {
            let setting = CubeSetting { speed: flight.speed, friction: flight.friction, surface, mass: Mass::Lumped };
            let full = FullScene::new(setting).map_err(|error| Failure::from_below("lab cube", error))?;
            let history = method.run(&full, &MethodRun { step, end, stride, snapshots: Vec::new() });
            history.map_err(|error| error.to_string()).map(|history| ProductRun {
                internal_steps: (history.times.len() * stride) as u64,
                history,
                curvature: Vec::new(),
                residual: 0.0,
                stepping: std::time::Duration::ZERO,
            })
        }
    };
    Ok(CubeRun { name, competitor, result })
}

/// Returns the last time of contact of node 1 (s); a contact ends when the node has been free for 50 µs.
pub(super) fn released(history: &CubeHistory) -> f64 {
    let mut last = None;
    for (time, force) in history.times.iter().zip(history.first_force()) {
        if force > 0.0 {
            last = Some(*time);
        } else if last.is_some_and(|last| time - last > 5e-5) {
            break;
        }
    }
    last.unwrap_or(0.0)
}
