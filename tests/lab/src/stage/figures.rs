//! Figures of the stage.

use tiprub_figure::{
    plots::{Plot, Series},
    waterfall::{Waterfall, WaterfallAxis},
};
use tiprub_shell::Result;
use tiprub_study::{Picture, Sheet, StudyFigure};

use super::{CASINGS, RAMP_PERIODS, Run, SHOWN, StageCasing, StageSetup, nearest};

/// Nodal diameters below this fraction of the largest amplitude are not drawn.
const SILENT: f64 = 1e-4;

/// Draws all pictures of one casing.
pub(super) fn of(setup: &StageSetup, casing: StageCasing, runs: &[Run], names: &[String]) -> Result<Vec<StudyFigure>> {
    let mut all = vec![clearances(setup, casing, nearest(setup, runs)?, names)?];
    all.extend(SHOWN.map(|number| waterfall(setup, casing, runs, number)));
    all.push(amplitudes(setup, casing, runs, names)?);
    Ok(all)
}

fn of_casing(casing: StageCasing, names: [&'static str; 3]) -> &'static str {
    names[casing as usize]
}

/// Draws the clearances of blade 1 over time at one speed: fig. 11.
fn clearances(setup: &StageSetup, casing: StageCasing, run: &Run, names: &[String]) -> Result<StudyFigure> {
    let gap = setup.gap();
    let time = |time: &f64| time * setup.frequency;
    let series = names.iter().zip(&run.clearances).map(|(name, column)| {
        let points = run.times.iter().zip(column).map(|(at, value)| (time(at), value / gap)).collect();
        Series::line(name.replace('_', " "), points)
    });
    let mut plot = Plot::new(
        "time (periods of the first mode of nodal diameter 2)",
        "clearance / clearance at rest",
        series.collect(),
    );
    plot.height = 340;
    plot.levels.push((0.0, "contact".into()));
    let mut sheet = Sheet::new(["time (s)", "time (periods)"]);
    sheet.columns.extend(names.iter().map(|name| format!("{name} (m)")));
    sheet.columns.push("nodes in contact".into());
    for (index, at) in run.times.iter().enumerate() {
        let mut row = vec![*at, time(at)];
        row.extend(run.clearances.iter().map(|column| column[index]));
        row.push(run.contacts.get(index).copied().unwrap_or(0.0));
        sheet.rows.push(row);
    }
    Ok(StudyFigure {
        name: of_casing(casing, ["clearances-smooth", "clearances-rigid", "clearances-flexible"]),
        caption: format!(
            "Clearance between blade 1 and the casing at its three contact nodes, {}, at {:.1} rad/s. The oval grows \
             over the first {RAMP_PERIODS} periods. The blade is in contact where a curve is zero.",
            casing.name(),
            run.speed
        ),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}

/// Draws the amplitude of one nodal diameter over time and speed: fig. 12.
fn waterfall(setup: &StageSetup, casing: StageCasing, runs: &[Run], nodal_diameter: usize) -> StudyFigure {
    let critical = setup.critical_speed();
    let points = |run: &Run| {
        let column = run.times.iter().zip(&run.amplitudes[nodal_diameter]);
        column.map(|(time, value)| (time * setup.frequency, 1e6 * value)).collect::<Vec<_>>()
    };
    let all = runs.iter().flat_map(|run| run.amplitudes[nodal_diameter].iter().map(|value| 1e6 * value));
    let times = runs.iter().flat_map(|run| run.times.iter().map(|time| time * setup.frequency));
    let waterfall = Waterfall {
        x: WaterfallAxis::over("time (periods of the first mode of nodal diameter 2)", times),
        depth: WaterfallAxis::over("speed / critical speed", runs.iter().map(|run| run.speed / critical)),
        value: WaterfallAxis::over("amplitude (µm)", all.chain([0.0])),
        curves: runs.iter().map(|run| (run.speed / critical, points(run))).collect(),
    };
    let mut sheet = Sheet::new(["speed (rad/s)", "time (s)", "amplitude (m)"]);
    for run in runs {
        let column = run.times.iter().zip(&run.amplitudes[nodal_diameter]);
        sheet.rows.extend(column.map(|(time, value)| vec![run.speed, *time, *value]));
    }
    StudyFigure {
        name: if nodal_diameter == SHOWN[0] {
            of_casing(casing, ["nodal-diameter-2-smooth", "nodal-diameter-2-rigid", "nodal-diameter-2-flexible"])
        } else {
            of_casing(casing, ["nodal-diameter-4-smooth", "nodal-diameter-4-rigid", "nodal-diameter-4-flexible"])
        },
        caption: format!(
            "Share of nodal diameter {nodal_diameter} in the radial displacement of the blades (middle contact node) over time and \
             angular velocity, {}; the critical speed is {critical:.1} rad/s.",
            casing.name()
        ),
        picture: Picture::waterfall(&waterfall),
        sheet,
    }
}

/// Draws effective amplitudes against speed.
fn amplitudes(setup: &StageSetup, casing: StageCasing, runs: &[Run], names: &[String]) -> Result<StudyFigure> {
    let diameters = runs.first().map_or(0, |run| run.amplitudes.len());
    let value = |run: &Run, number: usize| run.effective(number, setup.full());
    let most = |number: usize| runs.iter().map(|run| value(run, number)).fold(0.0, f64::max);
    let largest = (0..diameters).map(most).fold(0.0, f64::max);
    let (shown, silent): (Vec<usize>, Vec<usize>) =
        (0..diameters.min(5)).partition(|number| most(*number) > SILENT * largest);
    let series = shown.into_iter().map(|number| {
        let points = runs.iter().map(|run| (run.speed, 1e6 * value(run, number))).collect();
        Series::line(format!("nodal diameter {number}"), points)
    });
    let plot = Plot {
        logarithmic: true,
        marked: true,
        height: 320,
        ..Plot::new("angular velocity (rad/s)", "effective amplitude (µm)", series.collect())
    };
    let mut caption = format!(
        "Effective amplitude (root mean square after the growth of the oval) of the nodal diameters against angular \
         velocity, {}.",
        casing.name()
    );
    if !silent.is_empty() {
        let silent = silent.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        caption.push_str(&format!(
            " Nodal diameters {silent} are below {SILENT:e} of the largest and not drawn; the data file contains them."
        ));
    }
    Ok(StudyFigure {
        name: of_casing(casing, ["amplitudes-smooth", "amplitudes-rigid", "amplitudes-flexible"]),
        caption,
        picture: Picture::plot(&plot)?,
        sheet: speeds_sheet(setup, runs, names),
    })
}

/// Tabulates the results at every speed.
fn speeds_sheet(setup: &StageSetup, runs: &[Run], names: &[String]) -> Sheet {
    let diameters = runs.first().map_or(0, |run| run.amplitudes.len());
    let mut sheet = Sheet::new(["speed (rad/s)", "speed / critical speed"]);
    sheet.columns.extend((0..diameters).map(|number| format!("nodal diameter {number} (m)")));
    sheet.columns.extend(["points with contact", "largest force (N)", "smallest clearance (m)"].map(String::from));
    sheet.columns.extend(names.iter().map(|name| format!("smallest clearance of {name} of blade 1 (m)")));
    sheet.columns.extend(names.iter().map(|name| format!("contacts of {name} of blade 1")));
    sheet.columns.push("completed (1 yes; 0 no)".into());
    for run in runs {
        let mut row = vec![run.speed, run.speed / setup.critical_speed()];
        row.extend((0..diameters).map(|number| run.effective(number, setup.full())));
        row.extend([run.touching(), run.largest_force, run.least_clearance]);
        row.extend(&run.least);
        row.extend(run.touches.iter().map(|count| *count as f64));
        row.push(f64::from(u8::from(run.ended.is_none())));
        sheet.rows.push(row);
    }
    sheet
}

/// Draws nodal diameter 4 relative to 2, for all casings.
pub(super) fn shares(setup: &StageSetup, runs: &[Vec<Run>; 3]) -> Result<StudyFigure> {
    let share = |run: &Run| match run.ended {
        Some(_) => f64::NAN,
        None => run.effective(SHOWN[1], setup.full()) / run.effective(SHOWN[0], setup.full()),
    };
    let series = CASINGS.into_iter().zip(runs).map(|(casing, runs)| {
        let points = runs.iter().map(|run| (run.speed, share(run))).filter(|point| point.1.is_finite());
        Series::line(casing.name(), points.collect())
    });
    let series = series.filter(|series| !series.points.is_empty());
    let label = "nodal diameter 4 / nodal diameter 2 (-)";
    let plot = Plot {
        logarithmic: true,
        marked: true,
        height: 320,
        ..Plot::new("angular velocity (rad/s)", label, series.collect())
    };
    let mut sheet = Sheet::new(["speed (rad/s)"]);
    sheet.columns.extend(CASINGS.map(|casing| casing.name().to_owned()));
    for index in 0..runs[0].len() {
        let row = runs.iter().map(|runs| share(&runs[index]));
        sheet.rows.push([runs[0][index].speed].into_iter().chain(row).collect());
    }
    Ok(StudyFigure {
        name: "share-of-4",
        caption:
            "Effective amplitude of nodal diameter 4 relative to that of 2 against angular velocity, for completed \
             runs."
                .into(),
        picture: Picture::plot(&plot)?,
        sheet,
    })
}
