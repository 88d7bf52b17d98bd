//! Growth of the stepping time with the numbers of sectors, modes, patches and touching blades: exponents of a fitted power.

use serde_json::{Value, json};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_figure::plots::{Plot, Series};
use tiprub_figure::table::Table;
use tiprub_gallery::{reduction, scene_source};
use tiprub_model::{
    Rotor37Options,
    rotor37::{MeshCounts, TipContact},
};
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::{
    Picture, Sheet, Statement, Study, StudyFigure,
    arguments::StudyCommon,
    error::{clock, scene::SceneRun, summary::rate},
    machine,
};

/// Communication step (s).
const INTERVAL: f64 = 1e-4;
/// Tolerance, the default of scenes.
const TOLERANCE: f64 = 1e-2;
/// Number of repetitions; the fastest one counts.
const REPETITIONS: usize = 3;
/// Clearance of blades that do not touch, relative to that of the others.
const AWAY: f64 = 4.0;
/// Largest deviation from 1 of the exponent of the attempted steps against the numbers of sectors and of touching blades.
const PROPORTIONAL: f64 = 0.1;

/// Numbers of the rotor.
#[derive(Debug, Clone, Copy)]
struct RotorSize {
    sectors: usize,
    modes: usize,
    patches: usize,
    /// Number of blades that touch; if `None`, all.
    touching: Option<usize>,
}

/// One varied number and its values.
struct Variation {
    name: &'static str,
    values: &'static [usize],
    with: fn(RotorSize, usize) -> RotorSize,
    /// True if the number is that of blades which need steps: the number of steps must be proportional to it.
    is_of_blades: bool,
}

/// Meshes, numbers that are not varied, and variations.
struct ScalingSize {
    mesh: MeshCounts,
    base: RotorSize,
    variations: [Variation; 4],
    milliseconds: u32,
}

const fn variations(
    sectors: &'static [usize],
    modes: &'static [usize],
    patches: &'static [usize],
    touching: &'static [usize],
) -> [Variation; 4] {
    [
        Variation {
            name: "sectors",
            values: sectors,
            with: |size, sectors| RotorSize { sectors, ..size },
            is_of_blades: true,
        },
        Variation {
            name: "modes per blade",
            values: modes,
            with: |size, modes| RotorSize { modes, ..size },
            is_of_blades: false,
        },
        Variation {
            name: "patches per blade",
            values: patches,
            with: |size, patches| RotorSize { patches, ..size },
            is_of_blades: false,
        },
        Variation {
            name: "touching blades",
            values: touching,
            with: |size, touching| RotorSize { touching: Some(touching), ..size },
            is_of_blades: true,
        },
    ]
}

/// Numbers that are not varied are those of `builtin:rotor37-one-row`.
const FULL: ScalingSize = ScalingSize {
    mesh: MeshCounts { chord: 24, thickness: 2, span: 40 },
    base: RotorSize { sectors: 36, modes: 80, patches: 9, touching: None },
    variations: variations(&[12, 20, 36, 64, 112], &[10, 20, 40, 80, 160], &[3, 5, 9, 17, 33], &[0, 2, 4, 9, 18, 36]),
    milliseconds: 10,
};
const QUICK: ScalingSize = ScalingSize {
    mesh: MeshCounts { chord: 8, thickness: 1, span: 5 },
    base: RotorSize { sectors: 12, modes: 12, patches: 3, touching: None },
    variations: variations(&[6, 12, 24], &[8, 16, 32], &[3, 5, 9], &[0, 3, 6, 12]),
    milliseconds: 4,
};

/// Result of one size.
#[derive(Debug, Clone, Copy)]
struct ScalingPoint {
    value: usize,
    /// Processor time per simulated second (s/s).
    seconds: f64,
    /// Number of attempted steps of all blades.
    trials: u64,
}

impl ScalingSize {
    fn rom(&self, size: RotorSize, common: &StudyCommon, console: &Console) -> Result<Rom> {
        let options = Rotor37Options {
            mesh: self.mesh,
            tip: TipContact::Patches(size.patches),
            modes: size.modes,
            ..Rotor37Options::one_row()
        };
        let name = format!("rotor37-scaling-modes-{}-patches-{}", size.modes, size.patches);
        let make = || Ok(reduction::rotor37(&options, console)?.rom);
        let rom = common.cache.cache().get(&name, &options, console, &make)?;
        Ok(Rom { sectors: size.sectors, ..rom })
    }

    /// Returns the light rub of a rotor. Blades that do not touch have a large clearance.
    fn scene(&self, size: RotorSize, common: &StudyCommon, console: &Console) -> Result<Scene> {
        let scene = scene_source::rotor37_scene_with(self.rom(size, common, console)?)?;
        let mut scene = SceneRun::changed(&scene, (Scheme::ADAPTIVE, Solver::Lcp), 8e-5, 0.0);
        scene.settings.time.tolerance = Some(TOLERANCE);
        // Blades of a rotor with many sectors overlap in angle.
        scene.settings.accept_implausible = true;
        scene.settings.experiment.communication_step = INTERVAL;
        if let Some(touching) = size.touching {
            let contact = &mut scene.settings.contacts[0];
            // Touching blades are evenly spaced.
            let touches = |sector: usize| (sector * touching) % size.sectors < touching;
            let factor = |sector: usize| if touches(sector) { 1.0 } else { AWAY };
            contact.sector_gaps = (0..size.sectors).map(|sector| contact.gap * factor(sector)).collect();
        }
        Ok(scene)
    }

    fn point(&self, scene: &Scene, value: usize) -> tiprub_core::Result<ScalingPoint> {
        let mut point = ScalingPoint { value, seconds: f64::INFINITY, trials: 0 };
        for _ in 0..REPETITIONS {
            let mut simulation = Simulation::new(scene)?;
            simulation.skip_unneeded_states();
            simulation.initialise(0.0)?;
            let mut seconds = 0.0;
            for step in 0..10 * self.milliseconds {
                let before = clock::now();
                simulation.do_step(f64::from(step) * INTERVAL, INTERVAL)?;
                seconds += (clock::now() - before).as_secs_f64();
            }
            point.seconds = point.seconds.min(seconds / (1e-3 * f64::from(self.milliseconds)));
            point.trials = simulation.system().steps_tried();
        }
        Ok(point)
    }
}

/// A power law through points: exponent, and largest deviation of a point as a fraction of the fitted value.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PowerFit {
    exponent: f64,
    deviation: f64,
}

impl PowerFit {
    /// Fits y = a·xᵏ to positive points by least squares of the logarithms; `None` if there are fewer than two.
    fn new(points: &[(f64, f64)]) -> Option<Self> {
        let logarithms = || points.iter().map(|(x, y)| (x.ln(), y.ln()));
        let count = points.len() as f64;
        let (x, y) = logarithms().fold((0.0, 0.0), |sum, point| (sum.0 + point.0 / count, sum.1 + point.1 / count));
        let (mixed, square) = logarithms()
            .fold((0.0, 0.0), |sum, point| (sum.0 + (point.0 - x) * (point.1 - y), sum.1 + (point.0 - x).powi(2)));
        let exponent = mixed / square;
        let deviations = logarithms().map(|point| ((point.1 - y - exponent * (point.0 - x)).exp() - 1.0).abs());
        let deviation = deviations.fold(0.0, f64::max);
        exponent.is_finite().then_some(Self { exponent, deviation })
    }
}

/// Points of a variation, with the fits of time and of attempted steps.
struct ScalingCurve<'a> {
    variation: &'a Variation,
    points: Vec<ScalingPoint>,
    time: Option<PowerFit>,
    trials: Option<PowerFit>,
    /// Fit of the times of the last two points only.
    last_times: Option<PowerFit>,
}

impl<'a> ScalingCurve<'a> {
    /// Fits the points. If the first value is 0, its time and its steps are subtracted from the others.
    fn new(variation: &'a Variation, points: Vec<ScalingPoint>) -> Self {
        let none = points.first().filter(|point| point.value == 0).copied();
        let rest = &points[usize::from(none.is_some())..];
        let fit = |points: &[ScalingPoint], of: &dyn Fn(&ScalingPoint) -> f64| {
            let least = none.as_ref().map_or(0.0, of);
            PowerFit::new(&points.iter().map(|point| (point.value as f64, of(point) - least)).collect::<Vec<_>>())
        };
        let (time, trials) = (fit(rest, &|point| point.seconds), fit(rest, &|point| point.trials as f64));
        let last_times = fit(&rest[rest.len().saturating_sub(2)..], &|point| point.seconds);
        Self { variation, points, time, trials, last_times }
    }

    fn cells(&self) -> Vec<String> {
        let [first, last] = [self.points[0], self.points[self.points.len() - 1]];
        let fitted = self.points.iter().find(|point| point.value > 0).map_or(0, |point| point.value);
        let exponent = |fit: Option<PowerFit>| fit.map_or("unknown".to_owned(), |fit| format!("{:.2}", fit.exponent));
        let deviation = self.time.map_or("unknown".to_owned(), |fit| format!("{:.0} %", 100.0 * fit.deviation));
        vec![
            self.variation.name.to_owned(),
            format!("{fitted} to {}", last.value),
            format!("{} to {}", rate(first.seconds), rate(last.seconds)),
            exponent(self.time),
            deviation,
            exponent(self.last_times),
            exponent(self.trials),
        ]
    }

    fn json(&self) -> Value {
        json!({
            "varied": self.variation.name,
            "exponent": self.time.map(|fit| fit.exponent), "deviation": self.time.map(|fit| fit.deviation),
            "exponent_of_last_two": self.last_times.map(|fit| fit.exponent),
            "exponent_of_trials": self.trials.map(|fit| fit.exponent),
            "points": self.points.iter().map(|point| json!({
                "value": point.value, "seconds_per_second": point.seconds, "trials": point.trials,
            })).collect::<Vec<_>>(),
        })
    }
}

/// Runs the study.
///
/// # Errors
/// A reduction or a run that fails.
pub(crate) fn study(common: &StudyCommon, console: &Console) -> Result<Study> {
    let size = if common.quick { QUICK } else { FULL };
    let count: usize = size.variations.iter().map(|variation| variation.values.len()).sum();
    let mut curves = Vec::new();
    let mut done = 0;
    for variation in &size.variations {
        let mut points = Vec::new();
        for &value in variation.values {
            let failed = |error| Failure::from_core(format!("lab scaling, {value} {}", variation.name), error);
            let scene = size.scene((variation.with)(size.base, value), common, console)?;
            let point = size.point(&scene, value).map_err(failed)?;
            done += 1;
            console.print_progress(format!(
                "  point {done} of {count}: {value} {}, {} s/s, {} attempted steps",
                variation.name,
                rate(point.seconds),
                point.trials
            ));
            points.push(point);
        }
        curves.push(ScalingCurve::new(variation, points));
    }
    Ok(report(&size, &curves))
}

fn report(size: &ScalingSize, curves: &[ScalingCurve]) -> Study {
    let columns = [
        "varied number",
        "range of the fit",
        "time (s/s)",
        "exponent",
        "largest deviation",
        "exponent of the last two values",
        "exponent of attempted steps",
    ];
    let mut table = Table::new("Exponents of the stepping time", columns);
    table.rows = curves.iter().map(ScalingCurve::cells).collect();
    let mut all = Table::new("Stepping time by size", ["varied number", "value", "time (s/s)", "attempted steps"]);
    for curve in curves {
        all.rows.extend(curve.points.iter().map(|point| {
            let (value, trials) = (point.value.to_string(), point.trials.to_string());
            vec![curve.variation.name.to_owned(), value, rate(point.seconds), trials]
        }));
    }
    let of_blades: Vec<&ScalingCurve> = curves.iter().filter(|curve| curve.variation.is_of_blades).collect();
    let exponents: Vec<f64> = of_blades.iter().map(|curve| curve.trials.map_or(f64::NAN, |fit| fit.exponent)).collect();
    let RotorSize { sectors, modes, patches, .. } = size.base;
    Study {
        name: "scaling",
        title: "Growth of the stepping time with the size of a rub".into(),
        summary: format!(
            "Processor time of adaptive steps in a light rub of rotor 37 with one row of patches, while one number varies. The \
             others are {sectors} sectors, {modes} modes and {patches} patches per blade, all of which touch. The exponent k is \
             that of a power a·nᵏ fitted to the times. The time without touching blades is subtracted before the fit of the \
             touching blades."
        ),
        facts: machine::facts(),
        statements: vec![Statement::tested(
            "The number of attempted steps is proportional to the numbers of sectors and of touching blades",
            exponents.iter().all(|exponent| (exponent - 1.0).abs() < PROPORTIONAL),
            format!("exponents {}", exponents.iter().map(|one| format!("{one:.2}")).collect::<Vec<_>>().join(" and ")),
        )],
        figures: figure(curves).into_iter().collect(),
        results: curves.iter().map(ScalingCurve::json).collect(),
        files: vec![
            ("scaling.md".into(), "table of the exponents".into(), table.to_markdown().into_bytes()),
            ("points.md".into(), "table of all points".into(), all.to_markdown().into_bytes()),
        ],
    }
}

fn figure(curves: &[ScalingCurve]) -> Option<StudyFigure> {
    let points = |curve: &ScalingCurve| -> Vec<(f64, f64)> {
        let positive = curve.points.iter().filter(|point| point.value > 0);
        positive.map(|point| (point.value as f64, point.seconds)).collect()
    };
    let series = curves.iter().map(|curve| Series::line(curve.variation.name, points(curve))).collect();
    let plot = Plot {
        logarithmic: true,
        logarithmic_x: true,
        ..Plot::new("varied number", "processor time per simulated time (s/s)", series)
    };
    let mut sheet = Sheet::new(["value", "processor time per simulated time (s/s)", "attempted steps"]);
    for point in curves.iter().flat_map(|curve| &curve.points) {
        sheet.rows.push(vec![point.value as f64, point.seconds, point.trials as f64]);
    }
    let caption = "Processor time of the steps while one number varies.".to_owned();
    Some(StudyFigure { name: "scaling", caption, picture: Picture::plot(&plot).ok()?, sheet })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fit_finds_the_exponent_of_a_power() {
        let points: Vec<(f64, f64)> = [3.0, 5.0, 9.0, 33.0].map(|x: f64| (x, 0.7 * x.powf(1.4))).to_vec();
        let fit = PowerFit::new(&points).unwrap();
        assert!((fit.exponent - 1.4).abs() < 1e-12 && fit.deviation < 1e-12, "{fit:?}");
        let mut off = points;
        off[1].1 *= 1.2;
        assert!(PowerFit::new(&off).unwrap().deviation > 0.08);
        assert_eq!(PowerFit::new(&[(3.0, 1.0)]), None);
    }
}
