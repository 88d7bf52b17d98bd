//! Two tables over all scenes: the cheapest setting for each error of the steps and for each total error, beside the paper's method with the
//! same model.

use tiprub_figure::table::Table;

use super::{
    case::ErrorCase,
    competitor::{Competitor, PAPER},
    measure::{Figures, Measured, MeasuredRow},
    ranking::{self, ErrorKind, TARGETS, cheapest, conclusive_rows},
};

/// Run that finished: its setting and its measured values.
type Finished<'a> = (&'a MeasuredRow, &'a Figures);

/// Formats processor time per simulated time (s/s) with three significant digits.
pub fn rate(seconds: f64) -> String {
    match seconds {
        _ if seconds < 0.00995 => format!("{seconds:.2e}"),
        _ if seconds < 0.995 => format!("{seconds:.3}"),
        _ if seconds < 9.95 => format!("{seconds:.2}"),
        _ if seconds < 99.5 => format!("{seconds:.1}"),
        _ => format!("{seconds:.0}"),
    }
}

/// Returns the columns of both tables.
fn columns(error: &str) -> [&str; 8] {
    [
        "scene",
        error,
        "cheapest method",
        "step or tolerance",
        "time (s/s)",
        "galerkin (s/s)",
        "the paper's method (s/s)",
        "factor",
    ]
}

/// Tabulates the cheapest setting for each error of the steps. Every method is compared with the converged solution of its own equations.
pub fn of_steps(scenes: &[(&dyn ErrorCase, &Measured)]) -> Table {
    let mut table = Table::new("Cheapest setting for a given error of the steps", columns("error of the steps"));
    for &(case, measured) in scenes {
        let rows = ErrorKind::OfOwn.rows(case, measured);
        for target in TARGETS {
            let readable = conclusive_rows(case, measured, ErrorKind::OfOwn, &rows, target);
            let cells =
                cells(case, &readable, &rows, &|only| cheapest(&readable, ErrorKind::OfOwn, only, target), |_| {
                    String::new()
                });
            table.rows.push(beside(case, target, cells));
        }
    }
    table
}

/// Tabulates the cheapest setting for each total error: steps, and the errors of the model (modes, patches, rows, mesh, elements).
pub fn in_total(scenes: &[(&dyn ErrorCase, &Measured)]) -> Table {
    let mut table = Table::new("Cheapest setting for a given total error", columns("total error"));
    for &(case, measured) in scenes {
        let Some(error) = total_error(case) else { continue };
        let rows = ErrorKind::Total.rows(case, measured);
        for target in TARGETS {
            let readable = match case.model_error() {
                Some(_) => conclusive_rows(case, measured, ErrorKind::OfOwn, &rows, target),
                None => conclusive_rows(case, measured, ErrorKind::Total, &rows, target),
            };
            let best = |only: Option<Competitor>| {
                let own = readable.iter().filter(|row| only.is_none_or(|competitor| row.competitor == competitor));
                let finished = own.filter_map(|row| row.outcome.as_ref().ok().map(|figures| (*row, figures)));
                let within = finished.filter(|(_, figures)| error(figures) <= target);
                within.min_by(|a, b| a.1.seconds.total_cmp(&b.1.seconds))
            };
            let size = |row: &MeasuredRow| match case.sizes().len() {
                1 => String::new(),
                _ => format!(", {} {}", case.sizes()[row.size], case.size_name()),
            };
            let mut cells = cells(case, &readable, &rows, &best, size);
            if let (Some(left), "none") = (case.model_error(), cells[0].as_str())
                && left > target
            {
                cells[1] = format!("the model error is {left:.1e}");
            }
            table.rows.push(beside(case, target, cells));
        }
    }
    table
}

/// Function for the total error of a run.
type TotalError = Box<dyn Fn(&Figures) -> f64>;

/// Returns the function for the total error of a run; `None` if a case has no finer model and no known errors.
fn total_error(case: &dyn ErrorCase) -> Option<TotalError> {
    if let Some(left) = case.model_error() {
        return Some(Box::new(move |figures| figures.of_own + left));
    }
    super::sheets::has_total(case).then(|| Box::new(|figures: &Figures| figures.total) as TotalError)
}

fn beside(case: &dyn ErrorCase, target: f64, cells: Vec<String>) -> Vec<String> {
    [case.title().to_owned(), format!("{target:.0e}")].into_iter().chain(cells).collect()
}

/// Returns the cheapest method with its setting and time, the times of `galerkin` and of the paper's method, and the factor between the first and
/// the last.
fn cells<'a>(
    case: &dyn ErrorCase,
    readable: &[&'a MeasuredRow],
    all: &[&'a MeasuredRow],
    best: &dyn Fn(Option<Competitor>) -> Option<Finished<'a>>,
    size: impl Fn(&MeasuredRow) -> String,
) -> Vec<String> {
    let simulated = case.interval() * case.samples() as f64;
    let time = |(_, figures): Finished| rate(figures.seconds / simulated);
    let any = best(None);
    let paper = best(Some(PAPER));
    let factor = any.zip(paper).map(|((_, any), (_, paper))| format!("{:.1}", paper.seconds / any.seconds));
    let first = match any {
        Some((row, _)) => [format!("`{}`", row.competitor.name()), row.competitor.setting(row.step) + &size(row)],
        None if readable.is_empty() => ["none".into(), "below the difference between the references".into()],
        None => ["none".into(), String::new()],
    };
    let without =
        || if all.iter().any(|row| row.competitor == case.tolerant()) { "not reached" } else { "-" }.to_owned();
    first
        .into_iter()
        .chain([
            any.map_or_else(String::new, time),
            best(Some(case.tolerant())).map_or_else(without, time),
            paper.map_or_else(|| paper_misses(all), time),
            factor.unwrap_or_else(|| "-".into()),
        ])
        .collect()
}

/// Explains why the paper's method does not reach an error: rejected at every step that was tried, or its smallest error.
fn paper_misses(rows: &[&MeasuredRow]) -> String {
    let own = || rows.iter().filter(|row| row.competitor == PAPER);
    let shortest = own().map(|row| row.step).fold(f64::INFINITY, f64::min);
    let errors = own().filter_map(|row| row.outcome.as_ref().ok()).map(|figures| ErrorKind::OfOwn.of(figures));
    match errors.reduce(f64::min) {
        _ if shortest.is_infinite() => "-".into(),
        Some(least) => format!("not reached, {least:.1e} at best"),
        None => format!("rejected, down to {}", PAPER.setting(shortest)),
    }
}

/// Tabulates the distances of the references, which limit the errors that can be resolved.
pub fn limits(scenes: &[(&dyn ErrorCase, &Measured)]) -> Table {
    let mut table = Table::new(
        "Smallest measurable errors: differences between the references",
        ["scene", "window (ms)", "first and second reference", "galerkin and massless-boundary"],
    );
    for &(case, measured) in scenes {
        let massless = measured.references.get(case.standard()).and_then(|own| own.massless_apart);
        table.rows.push(vec![
            case.title().to_owned(),
            format!("{:.2}", 1e3 * case.interval() * case.samples() as f64),
            format!("{:.1e}", ranking::readable(case, measured, ErrorKind::OfOwn)),
            massless.map_or_else(|| "-".into(), |apart| format!("{apart:.1e}")),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::competitor::TOLERANT;

    fn row(competitor: Competitor, step: f64, outcome: Result<f64, &str>) -> MeasuredRow {
        let figures = |error: f64| Figures {
            seconds: 1e-3,
            total: error,
            of_time: error,
            of_own: error,
            impulse: 0.0,
            impulse_total: 0.0,
            energy: 0.0,
            residual: None,
            penetration: 0.0,
            adhesion: 0.0,
            release: None,
        };
        MeasuredRow { size: 0, competitor, step, outcome: outcome.map(figures).map_err(str::to_owned) }
    }

    #[test]
    fn rates_keep_three_digits() {
        assert_eq!([1.284e-5, 0.1234, 1.234, 12.34, 1234.5].map(rate), ["1.28e-5", "0.123", "1.23", "12.3", "1234"]);
    }

    #[test]
    fn rejection_names_the_shortest_step() {
        let rejected =
            [row(PAPER, 1e-6, Err("growth")), row(PAPER, 2.5e-7, Err("growth")), row(TOLERANT, 1e-2, Ok(1e-3))];
        assert_eq!(paper_misses(&rejected.iter().collect::<Vec<_>>()), "rejected, down to h = 0.250 µs");
        let ran = [row(PAPER, 1e-6, Err("growth")), row(PAPER, 2.5e-7, Ok(2e-3))];
        assert_eq!(paper_misses(&ran.iter().collect::<Vec<_>>()), "not reached, 2.0e-3 at best");
        assert_eq!(paper_misses(&[]), "-");
    }
}
