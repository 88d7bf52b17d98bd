//! Ranks configurations by cost for a given error, and determines orders of convergence.

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_figure::table::Table;

use super::{
    case::ErrorCase,
    competitor::{Competitor, PAPER},
    measure::{Figures, Measured, MeasuredRow},
};
use crate::Statement;

/// Target errors.
pub const TARGETS: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];
/// Number of points for the fit of an order.
const FITTED: usize = 3;
/// Errors below this are rounding.
const ROUNDING: f64 = 1e-12;

/// Kind of error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// Error of the steps alone, at the standard size.
    OfTime,
    /// Error of the steps against the limit of the equations that a competitor solves: methods with massless contact nodes or with sticking have
    /// another limit, which is no error of the steps.
    OfOwn,
    /// Error against the truth, over all sizes.
    Total,
}

impl ErrorKind {
    /// Returns the kind of error for the steps of a case: with one size and no exact solution, each competitor has its own limit.
    pub fn of_steps(case: &dyn ErrorCase) -> Self {
        if case.sizes().len() > 1 || case.exact().is_some() { Self::OfTime } else { Self::OfOwn }
    }

    /// Returns the error of this kind.
    pub fn of(self, figures: &Figures) -> f64 {
        match self {
            Self::OfTime => figures.of_time,
            Self::OfOwn => figures.of_own,
            Self::Total => figures.total,
        }
    }

    /// Returns the rows to which this kind of error applies.
    pub fn rows<'a>(self, case: &dyn ErrorCase, measured: &'a Measured) -> Vec<&'a MeasuredRow> {
        let standard = case.standard();
        measured.rows.iter().filter(|row| self == Self::Total || row.size == standard).collect()
    }
}

/// Returns the error below which differences cannot be resolved: the distance of two independent references, if the truth is one of them.
pub fn readable(case: &dyn ErrorCase, measured: &Measured, kind: ErrorKind) -> f64 {
    let apart = |size: usize| measured.references.get(size).map_or(0.0, |references| references.apart[0]);
    match (case.meeting(), kind) {
        (Some((distance, _)), _) => distance,
        (None, ErrorKind::OfTime | ErrorKind::OfOwn) => apart(case.standard()),
        (None, ErrorKind::Total) if case.exact().is_some() => 0.0,
        (None, ErrorKind::Total) => apart(measured.references.len().saturating_sub(1)),
    }
}

/// Returns the same bound for one competitor, with respect to its own limit.
pub fn readable_of(case: &dyn ErrorCase, measured: &Measured, kind: ErrorKind, competitor: Competitor) -> f64 {
    let own = || measured.references.get(case.standard())?.massless_apart;
    let massless = kind == ErrorKind::OfOwn && competitor.family().massless;
    own().filter(|_| massless).unwrap_or_else(|| readable(case, measured, kind))
}

/// Returns the rows of competitors whose limit is known accurately enough for this error.
pub fn conclusive_rows<'a>(
    case: &dyn ErrorCase,
    measured: &Measured,
    kind: ErrorKind,
    rows: &[&'a MeasuredRow],
    error: f64,
) -> Vec<&'a MeasuredRow> {
    rows.iter().copied().filter(|row| error >= readable_of(case, measured, kind, row.competitor)).collect()
}

/// Returns the fastest row with at most this error, among those of a competitor or of all.
pub fn cheapest<'a>(
    rows: &[&'a MeasuredRow],
    kind: ErrorKind,
    only: Option<Competitor>,
    error: f64,
) -> Option<(&'a MeasuredRow, &'a Figures)> {
    let asked = rows.iter().filter(|row| only.is_none_or(|competitor| row.competitor == competitor));
    let done = asked.filter_map(|row| row.outcome.as_ref().ok().map(|figures| (*row, figures)));
    let good = done.filter(|(_, figures)| kind.of(figures) <= error);
    good.min_by(|a, b| a.1.seconds.total_cmp(&b.1.seconds))
}

/// Formats a duration.
pub fn seconds(time: f64) -> String {
    match time {
        time if time < 1e-3 => format!("{:.3} ms", 1e3 * time),
        time if time < 1.0 => format!("{:.1} ms", 1e3 * time),
        _ => format!("{time:.2} s"),
    }
}

/// Tabulates the cheapest configuration for every target, and the cost of the paper's method.
pub fn winners(case: &dyn ErrorCase, measured: &Measured, kind: ErrorKind) -> Table {
    let rows = kind.rows(case, measured);
    let sizes = case.sizes();
    let what = match kind {
        ErrorKind::OfTime | ErrorKind::OfOwn => format!(
            "{}: cheapest setting for a given error of the steps alone, with {} {}",
            case.title(),
            sizes[case.standard()],
            case.size_name()
        ),
        ErrorKind::Total => {
            format!(
                "{}: cheapest setting for a given total error, over all numbers of {}",
                case.title(),
                case.size_name()
            )
        }
    };
    let columns = ["error", "cheapest", case.size_name(), "step or tolerance", "time", "the paper's method", "factor"];
    let mut table = Table::new(what, columns);
    let readable = readable(case, measured, kind);
    for target in TARGETS {
        let conclusive = conclusive_rows(case, measured, kind, &rows, target);
        if conclusive.is_empty() && cheapest(&rows, kind, None, target).is_some() {
            let why = format!("not measurable: the references differ by {readable:.1e}");
            let empty = std::iter::repeat_n(String::new(), table.columns.len() - 2);
            table.rows.push([format!("{target:.0e}"), why].into_iter().chain(empty).collect());
            continue;
        }
        let paper = cheapest(&conclusive, kind, Some(PAPER), target);
        let text = |(row, figures): (&MeasuredRow, &Figures)| {
            let size = if kind == ErrorKind::Total {
                format!("{} {}, ", sizes[row.size], case.size_name())
            } else {
                String::new()
            };
            format!("{} ({size}{})", seconds(figures.seconds), row.competitor.setting(row.step))
        };
        let paper_text = paper.map_or_else(|| "not reached".into(), text);
        let mut cells = vec![format!("{target:.0e}")];
        cells.extend(match cheapest(&conclusive, kind, None, target) {
            None => ["none", "", "", ""].map(String::from).into_iter().chain([paper_text, String::new()]).collect(),
            Some((row, figures)) => vec![
                row.competitor.name(),
                sizes[row.size].to_string(),
                row.competitor.setting(row.step),
                seconds(figures.seconds),
                paper_text,
                paper.map_or_else(|| "-".into(), |(_, paper)| format!("{:.1}", paper.seconds / figures.seconds)),
            ],
        });
        table.rows.push(cells);
    }
    table
}

/// Returns the cost of every competitor for every target.
pub fn costs(case: &dyn ErrorCase, measured: &Measured, kind: ErrorKind) -> Table {
    let rows = kind.rows(case, measured);
    let of = if kind == ErrorKind::Total { "total error" } else { "error of the steps alone" };
    let caption = format!("{}: time of every competitor for a given {of}", case.title());
    let mut table = Table::new(
        caption,
        ["competitor", "1e-1", "1e-2", "1e-3", "1e-4", "smallest error", "largest step or tolerance that ran"],
    );
    for competitor in Competitor::all() {
        let own: Vec<&MeasuredRow> = rows.iter().copied().filter(|row| row.competitor == competitor).collect();
        let done = || own.iter().filter_map(|row| row.outcome.as_ref().ok().map(|figures| (row, figures)));
        if own.is_empty() {
            continue;
        }
        let readable = readable_of(case, measured, kind, competitor);
        let mut cells = vec![competitor.name()];
        cells.extend(TARGETS.map(|target| match cheapest(&own, kind, None, target) {
            None => "-".into(),
            Some(_) if target < readable => "not measurable".into(),
            Some((_, figures)) => seconds(figures.seconds),
        }));
        if done().next().is_none() {
            cells.extend(["none", "none"].map(String::from));
            table.rows.push(cells);
            continue;
        }
        let least = done().map(|(_, figures)| kind.of(figures)).fold(f64::INFINITY, f64::min);
        let largest = done().map(|(row, _)| row.step).fold(0.0, f64::max);
        cells.extend([format!("{least:.1e}"), competitor.setting(largest)]);
        table.rows.push(cells);
    }
    table
}

/// Returns the distance by which film stays behind lcp; only if several nodes are coupled.
pub fn floor(case: &dyn ErrorCase, found: &Measured) -> Option<Statement> {
    let errors = |solver: Solver| -> Vec<f64> {
        let competitor = Competitor::Core(Scheme::default(), solver);
        let own = found.rows.iter().filter(|row| row.size == case.standard() && row.competitor == competitor);
        own.filter_map(|row| row.outcome.as_ref().ok().map(|figures| figures.of_time)).collect()
    };
    let (film, lcp) = (*errors(Solver::Film).last()?, *errors(Solver::Lcp).last()?);
    case.several_nodes().then(|| {
        Statement::remark(
            format!("{}: error of film compared with lcp", case.title()),
            format!(
                "modal-exact at the finest step: {film:.1e} with film, {lcp:.1e} with lcp, a factor of {:.1}",
                film / lcp
            ),
        )
    })
}

/// Order of convergence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Order {
    /// The error is proportional to this power of h.
    Power(f64),
    /// There is only rounding error.
    Exact,
    /// The error stops decreasing: it does not tend to this limit.
    Floor(f64),
    /// There are too few runs.
    Unknown,
}

impl Order {
    /// Formats the order for a table.
    pub fn text(self) -> String {
        match self {
            Self::Power(power) => format!("{power:.1}"),
            Self::Exact => "exact".into(),
            Self::Floor(error) => format!("stays at {error:.0e}"),
            Self::Unknown => "-".into(),
        }
    }
}

/// Returns the order of a competitor at the standard size, from its finest steps, against the limit of its own equations.
pub fn order(case: &dyn ErrorCase, measured: &Measured, competitor: Competitor) -> Order {
    let rows = measured.rows.iter().filter(|row| row.size == case.standard() && row.competitor == competitor);
    let points: Vec<(f64, f64)> =
        rows.filter_map(|row| row.outcome.as_ref().ok().map(|figures| (row.step, figures.of_own))).collect();
    if points.len() < FITTED {
        return Order::Unknown;
    }
    let fine = &points[points.len() - FITTED..];
    if fine.iter().all(|point| point.1 < ROUNDING) {
        return Order::Exact;
    }
    let power = slope(fine);
    if power < 0.3 { Order::Floor(fine[FITTED - 1].1) } else { Order::Power(power) }
}

/// Returns the slope of a straight line through the logarithms.
fn slope(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let logs: Vec<(f64, f64)> = points.iter().map(|(h, e)| (h.ln(), e.max(f64::MIN_POSITIVE).ln())).collect();
    let mean = |part: fn(&(f64, f64)) -> f64| logs.iter().map(part).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let above: f64 = logs.iter().map(|(a, b)| (a - x) * (b - y)).sum();
    above / logs.iter().map(|(a, _)| (a - x) * (a - x)).sum::<f64>()
}

/// Tabulates the orders of all competitors in several scenes.
pub fn orders(scenes: &[(&dyn ErrorCase, &Measured)]) -> Table {
    let caption = format!(
        "Observed orders of convergence of the displacements to the converged solution of the same model, from the \
         finest {FITTED} steps"
    );
    let mut columns = vec!["competitor".to_owned()];
    columns.extend(scenes.iter().map(|(case, _)| case.title().to_owned()));
    let mut table = Table { caption, columns, rows: Vec::new() };
    for competitor in Competitor::all() {
        let mut cells = vec![competitor.name()];
        cells.extend(scenes.iter().map(|(case, measured)| order(*case, measured, competitor).text()));
        if cells[1..].iter().any(|cell| cell != "-") {
            table.rows.push(cells);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recovers_the_exponent_of_a_power_law() {
        let points: Vec<(f64, f64)> = [1.0, 0.5, 0.2].iter().map(|h: &f64| (*h, 3.0 * h.powf(1.7))).collect();
        assert!((slope(&points) - 1.7).abs() < 1e-12);
    }
}
