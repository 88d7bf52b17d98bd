//! Comparison of any scene of uncoupled blades in a rigid casing with a stepper that shares only the matrices of the
//! ROM with the product: geometry, modes, contact problem and time stepping are those of the reference crate (Moreau
//! and Jean).

use serde_json::json;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{Meridian, Preset, Shape, SpinSettings};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_figure::plots::{Plot, Series};
use tiprub_gallery::scene_source;
use tiprub_reference::reduced::{
    ReducedMethod,
    moreau::Moreau,
    rub::{BladeScene, Blades, BumpedCasing, RubTip},
};
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::{Picture, Sheet, Statement, Study, StudyFigure};

use crate::cli::BesideArguments;

/// Maximum number of communication steps compared.
const MOST_SAMPLES: u32 = 1050;
const QUICK_SAMPLES: u32 = 150;
/// Divisors of the step of the witness, relative to that of the product, or to [`LONGEST`] if that is shorter.
const SHARES: [u32; 3] = [1, 2, 4];
/// Longest step of the witness (s).
const LONGEST: f64 = 5e-7;
/// Both must agree within this multiple of the change caused by halving their steps.
const MARGIN: f64 = 4.0;

/// Result of one of the two programs.
pub(crate) struct SideBySideRun {
    /// Displacements of all contact rows and blades at the communication points (m), sample by sample.
    pub(crate) displacements: Vec<f64>,
    /// Sum of λ over all contacts, per communication step (N·s).
    impulses: Vec<f64>,
}

fn refused(what: impl Into<String>, why: &str) -> Failure {
    let remedy = "Remove the unsupported feature, or use `tiprub study error`, which compares the schemes of tiprub with each other";
    Failure::new(what.into(), why.to_owned(), remedy)
}

/// Converts the scene to the reference crate.
///
/// # Errors
/// A feature that the witness does not support, by name.
pub(crate) fn blades_of(scene: &Scene) -> Result<BladeScene> {
    let settings = &scene.settings;
    let ([rotor], [surface], [contact]) = (&settings.structures[..], &settings.surfaces[..], &settings.contacts[..])
    else {
        return Err(refused("structure, surface, contact", "the independent solver supports only one of each"));
    };
    let rom = &scene.roms[0];
    let unknown = [
        ("rom", rom.extras.harmonics.is_empty(), "coupled sectors"),
        ("spin", rotor.spin == SpinSettings::default(), "spin effects"),
        ("whirl", !rotor.whirl && !rotor.axial_shift, "a moving shaft"),
        ("load", rotor.load.is_none() && !rotor.thermal, "loads"),
        ("surface.structure", surface.structure.is_none(), "surfaces carried by a structure"),
        ("surface.spline", surface.spline.is_none(), "surfaces through data points"),
        ("contact.coating", contact.coating.is_none(), "coatings"),
        ("contact.nodes", contact.nodes.is_none(), "a selection of contact nodes"),
        ("contact.solver", contact.solver != Solver::Coulomb, "sticking friction"),
    ];
    if let Some((what, _, why)) = unknown.iter().find(|(_, known, _)| !known) {
        return Err(refused(*what, &format!("the independent solver does not support {why}")));
    }
    let (bumps, phase) = match surface.shape {
        Shape::Circular {} => ([0.0, 1.0, 0.0], 0.0),
        Shape::TwoLobe { depth, width, phase } => {
            ([2.0 * contact.nominal_gap() * depth, width, surface.ramp_time], phase)
        }
        _ => {
            return Err(refused(
                "surface.shape",
                "the independent solver supports only circular casings and two bumps",
            ));
        }
    };
    let meridional = f64::from(u8::from(contact.meridian == Meridian::Contour));
    let tips = rom.contact_nodes.iter().map(|node| RubTip {
        radius: node.position[0],
        angle: node.position[1] - phase,
        slope: meridional * node.meridional_slope,
    });
    let blades = Blades {
        mass: rom.mass.clone(),
        stiffness: rom.stiffness.clone(),
        contact_map: rom.contact_map.clone(),
        tips: tips.collect(),
        sectors: rom.sectors,
        damping: rotor.damping_ratio.unwrap_or(rom.damping_ratio),
        frequency_factors: rotor.frequency_factors.clone(),
        clearances: contact.sector_gaps.clone(),
        obstacle: BumpedCasing {
            clearance: contact.nominal_gap(),
            speed: rotor.speed,
            friction: contact.friction,
            bumps,
        },
    };
    BladeScene::new(blades).ok_or_else(|| refused("rom", "the mass matrix is not positive definite"))
}

/// Runs the product over `samples` communication steps, with its internal step divided by `division`.
fn product(scene: &Scene, division: u32, samples: u32) -> tiprub_core::Result<SideBySideRun> {
    let mut scene = scene.clone();
    let (time, interval) = (&mut scene.settings.time, scene.settings.experiment.communication_step);
    if let Some(tolerance) = time.step_tolerance() {
        time.tolerance = Some(tolerance / f64::from(division.pow(4)));
    } else {
        time.step /= f64::from(division);
    }
    // The settings now contain everything that the preset selects, except for the step.
    scene.settings.preset = Preset::None;
    let mut simulation = Simulation::new(&scene)?;
    simulation.initialise(0.0)?;
    let mut found = SideBySideRun { displacements: Vec::new(), impulses: Vec::new() };
    for sample in 0..samples {
        simulation.do_step(f64::from(sample) * interval, interval)?;
        let bank = simulation.system().bank();
        for row in bank.displacement().chunks_exact(bank.lanes()) {
            found.displacements.extend_from_slice(&row[..scene.roms[0].sectors]);
        }
        found.impulses.push(impulse(&simulation));
    }
    Ok(found)
}

/// Returns Σ λ over the last communication step (N·s).
fn impulse(simulation: &Simulation) -> f64 {
    let reference = simulation.table().find("normal_impulse").map(|variable| variable.reference);
    reference.and_then(|reference| simulation.real(reference).ok()).unwrap_or(f64::NAN)
}

/// Runs the witness over as many steps, each at most `longest` (s).
pub(crate) fn witness(
    scene: &BladeScene,
    interval: f64,
    longest: f64,
    samples: u32,
) -> std::result::Result<SideBySideRun, String> {
    let division = (interval / longest * (1.0 - 1e-9)).ceil().max(1.0);
    let step = interval / division;
    let mut method = Moreau::new(scene, step);
    let mut found = SideBySideRun { displacements: Vec::new(), impulses: Vec::new() };
    for _ in 0..samples {
        let mut impulse = 0.0;
        let mut done = 0.0;
        while done < division {
            impulse += method.step()?.forces.iter().map(|(_, force)| force * step).sum::<f64>();
            done += 1.0;
        }
        found.displacements.extend(tiprub_reference::reduced::ReducedScene::observed(scene, method.state().0));
        found.impulses.push(impulse);
    }
    Ok(found)
}

/// Returns the relative distance of two sequences (L2).
pub(crate) fn apart(a: &[f64], b: &[f64]) -> f64 {
    let square = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>();
    let size = square(&mut b.iter().copied());
    if size == 0.0 { 0.0 } else { (square(&mut a.iter().zip(b).map(|(a, b)| a - b)) / size).sqrt() }
}

/// Runs the study.
///
/// # Errors
/// A scene with features that the witness does not support, by name; a run that is rejected or fails.
pub(crate) fn study(arguments: &BesideArguments, console: &Console) -> Result<Study> {
    let scene = scene_source::load(&arguments.scene, &arguments.common.cache.cache(), console)?;
    let blades = blades_of(&scene)?;
    let experiment = &scene.settings.experiment;
    let (interval, most) =
        (experiment.communication_step, if arguments.common.quick { QUICK_SAMPLES } else { MOST_SAMPLES });
    let samples =
        (1..=most).take_while(|sample| f64::from(*sample) * interval <= experiment.stop * (1.0 + 1e-9)).count();
    let samples = u32::try_from(samples).unwrap_or(most).max(1);
    let failed =
        |what: &str, why: String| Failure::new(what.to_owned(), why, "Choose a step size at which the scene runs");
    let own = product(&scene, 1, samples).map_err(|error| failed("simulation", error.to_string()))?;
    let half =
        product(&scene, 2, samples).map_err(|error| failed("simulation with half the step", error.to_string()))?;
    let longest = scene.settings.time.step.min(LONGEST);
    let mut witnesses = Vec::new();
    let task = console.task("Independent solver", Some(SHARES.len() as u64));
    for (done, share) in (0..).zip(SHARES) {
        task.at(done);
        let step = longest / f64::from(share);
        witnesses.push((
            step,
            witness(&blades, interval, step, samples).map_err(|error| failed("independent solver", error))?,
        ));
    }
    Ok(report(&scene, (&own, &half), &witnesses, interval))
}

/// Returns the distances of two runs in displacements, and of their total impulses.
fn distances(a: &SideBySideRun, b: &SideBySideRun) -> [f64; 2] {
    let [own, other] = [a, b].map(|found| found.impulses.iter().sum::<f64>());
    [apart(&a.displacements, &b.displacements), if other == 0.0 { own.abs() } else { (own / other - 1.0).abs() }]
}

fn report(
    scene: &Scene,
    (own, half): (&SideBySideRun, &SideBySideRun),
    witnesses: &[(f64, SideBySideRun)],
    interval: f64,
) -> Study {
    let (_, finest) = &witnesses[witnesses.len() - 1];
    let (_, before) = &witnesses[witnesses.len() - 2];
    let (between, halved, own_halved) = (distances(half, finest), distances(before, finest), distances(own, half));
    let with_mass = matches!(scene.settings.time.scheme, Scheme::CentralDifference | Scheme::ModalExact);
    let allowed = [0, 1].map(|which| MARGIN * (halved[which] + own_halved[which]) + 1e-12);
    let found = format!(
        "displacements differ by {:.1e}, the impulse by {:.1e}; halving the step changes the results of tiprub by {:.1e}, {:.1e} and \
         the independent solver by {:.1e}, {:.1e}",
        between[0], between[1], own_halved[0], own_halved[1], halved[0], halved[1]
    );
    let expected = format!(
        "tiprub and the independent solver differ by at most {MARGIN} times the change due to \
                            halving their steps"
    );
    let meets = match with_mass {
        true => Statement::tested(expected, between[0] <= allowed[0] && between[1] <= allowed[1], found),
        false => Statement::remark(
            "the independent solver has mass at the contact nodes and this scheme has none, so they agree only up to \
             this difference",
            found,
        ),
    };
    let touches = finest.impulses.iter().any(|impulse| *impulse > 0.0);
    let mut sheet = Sheet::new(["step (s)", "displacement difference from tiprub", "impulse difference"]);
    for (step, witness) in witnesses {
        let [displacements, impulse] = distances(half, witness);
        sheet.rows.push(vec![*step, displacements, impulse]);
    }
    Study {
        name: "beside",
        title: format!("{} compared with an independent solver", scene.settings.name),
        summary:
            "tiprub with the step of the scene and with half that step, compared with Moreau-Jean time stepping with \
                  independent geometry, modes and contact solution at three steps."
                .into(),
        facts: vec![
            ("communication steps".into(), own.impulses.len().to_string()),
            ("scheme".into(), format!("{:?}, {:?}", scene.settings.time.scheme, scene.settings.contacts[0].solver)),
        ],
        statements: vec![
            meets,
            Statement::tested("there is contact", touches, format!("{:.4e} N·s", finest.impulses.iter().sum::<f64>())),
        ],
        results: json!({
            "displacements": between[0], "impulse": between[1], "witness_halved": halved, "product_halved": own_halved,
        }),
        figures: figure((half, finest), interval, sheet).into_iter().collect(),
        files: Vec::new(),
    }
}

fn figure((product, witness): (&SideBySideRun, &SideBySideRun), interval: f64, sheet: Sheet) -> Option<StudyFigure> {
    let series = |found: &SideBySideRun| -> Vec<(f64, f64)> {
        let mean = |(sample, impulse): (usize, &f64)| (1e3 * interval * (sample as f64 + 1.0), impulse / interval);
        found.impulses.iter().enumerate().map(mean).collect()
    };
    let plot = Plot::new(
        "time (ms)",
        "total normal force (N)",
        vec![Series::line("tiprub", series(product)), Series::line("independent solver", series(witness))],
    );
    let caption = "Sum of all normal forces, averaged over communication steps.".to_owned();
    Some(StudyFigure { name: "forces", caption, picture: Picture::plot(&plot).ok()?, sheet })
}
