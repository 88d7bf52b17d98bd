//! Plots error against time: logarithmic axes, a colour per scheme, a marker per solver, and the Pareto front.

use std::fmt::Write as _;

use tiprub_figure::escape;

use super::competitor::Competitor;

/// Size of the picture and of the plot area (SVG units).
const WIDTH: f64 = 920.0;
const HEIGHT: f64 = 470.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 660.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 420.0;
/// Colours by index, distinguishable with colour-vision deficiency.
const COLORS: [&str; 8] = ["#d67018", "#1f5da0", "#248c76", "#aa3474", "#6e747c", "#b9a12a", "#5b3a1e", "#c4151c"];
/// Errors outside this range are drawn at its edge.
const ERRORS: [f64; 2] = [1e-7, 3.0];

/// Points of one competitor.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    /// The competitor.
    pub competitor: Competitor,
    /// Times (s) and errors, in the order of the steps.
    pub points: Vec<(f64, f64)>,
}

/// Chart of errors against time.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorChart {
    /// Label of the vertical axis.
    pub error_label: String,
    /// Points of all competitors.
    pub all: Vec<Points>,
    /// True to join the points of a competitor by lines.
    pub joined: bool,
    /// Error below which the references cannot resolve differences, with its description.
    pub readable: Option<(f64, String)>,
}

/// Returns the Pareto front, ordered by time: the points that no other point beats in both time and error.
pub fn front(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sorted: Vec<_> = points.iter().copied().filter(|(time, error)| *time > 0.0 && error.is_finite()).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut best = f64::INFINITY;
    sorted.retain(|(_, error)| {
        let better = *error < best;
        best = best.min(*error);
        better
    });
    sorted
}

/// Returns whole decades that enclose the values.
fn decades(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let extend = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
    let [low, high] = values.filter(|value| *value > 0.0).fold([f64::INFINITY, 0.0], extend);
    if high <= 0.0 {
        return [0.0, 1.0];
    }
    let (low, high) = (low.log10().floor(), high.log10().ceil());
    [low, if high > low { high } else { low + 1.0 }]
}

/// Mapping from values to positions on the page.
struct ChartFrame {
    time: [f64; 2],
    error: [f64; 2],
}

impl ChartFrame {
    fn x(&self, time: f64) -> f64 {
        tenth(LEFT + (RIGHT - LEFT) * (time.log10() - self.time[0]) / (self.time[1] - self.time[0]))
    }

    fn y(&self, error: f64) -> f64 {
        let error = error.clamp(10_f64.powf(self.error[0]), 10_f64.powf(self.error[1]));
        tenth(BOTTOM - (BOTTOM - TOP) * (error.log10() - self.error[0]) / (self.error[1] - self.error[0]))
    }
}

fn tenth(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

impl ErrorChart {
    /// Returns the complete SVG file.
    pub fn to_svg(&self) -> String {
        let points = || self.all.iter().flat_map(|each| each.points.iter());
        let clamped = points().map(|point| point.1.clamp(ERRORS[0], ERRORS[1]));
        let frame = ChartFrame { time: decades(points().map(|point| point.0)), error: decades(clamped) };
        let mut svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="13" fill="#343a42"><rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>"##
        );
        self.draw_axes(&frame, &mut svg);
        self.draw_front(&frame, &mut svg);
        for each in &self.all {
            self.draw_points(&frame, each, &mut svg);
        }
        self.draw_legend(&mut svg);
        svg.push_str("</svg>\n");
        svg
    }

    fn draw_axes(&self, frame: &ChartFrame, svg: &mut String) {
        let line = |svg: &mut String, [x, y]: [f64; 2], [u, v]: [f64; 2], color: &str| {
            let _ = write!(svg, r#"<path d="M{x} {y}L{u} {v}" stroke="{color}" fill="none"/>"#);
        };
        for power in whole(frame.time) {
            let x = frame.x(10_f64.powi(power));
            line(svg, [x, TOP], [x, BOTTOM], "#e8ebef");
            let _ = write!(svg, r#"<text x="{x}" y="{}" text-anchor="middle">1e{power}</text>"#, BOTTOM + 18.0);
        }
        for power in whole(frame.error) {
            let y = frame.y(10_f64.powi(power));
            line(svg, [LEFT, y], [RIGHT, y], "#e8ebef");
            let _ = write!(svg, r#"<text x="{}" y="{}" text-anchor="end">1e{power}</text>"#, LEFT - 8.0, y + 4.0);
        }
        line(svg, [LEFT, TOP], [LEFT, BOTTOM], "#99a0a8");
        line(svg, [LEFT, BOTTOM], [RIGHT, BOTTOM], "#99a0a8");
        let (across, up) = (0.5 * (LEFT + RIGHT), 0.5 * (TOP + BOTTOM));
        let _ = write!(
            svg,
            r#"<text x="{across}" y="{}" text-anchor="middle">stepping time (s)</text><text transform="translate(18 {up}) rotate(-90)" text-anchor="middle">{}</text>"#,
            BOTTOM + 40.0,
            escape(&self.error_label)
        );
        if let Some((readable, meaning)) = self.readable.as_ref().filter(|(error, _)| error.log10() > frame.error[0]) {
            let y = frame.y(*readable);
            let _ = write!(
                svg,
                r##"<path d="M{LEFT} {y}L{RIGHT} {y}" stroke="#343a42" stroke-dasharray="6 5" fill="none"/><text x="{}" y="{}" text-anchor="end" font-size="12">{}</text>"##,
                RIGHT - 4.0,
                y - 5.0,
                escape(meaning)
            );
        }
    }

    fn draw_front(&self, frame: &ChartFrame, svg: &mut String) {
        let points: Vec<_> = self.all.iter().flat_map(|each| each.points.iter().copied()).collect();
        let mut path = String::new();
        for (index, (time, error)) in front(&points).into_iter().enumerate() {
            let (x, y) = (frame.x(time), frame.y(error));
            let _ = if index == 0 { write!(path, "M{x} {y}") } else { write!(path, "H{x}V{y}") };
        }
        let _ = write!(svg, r##"<path d="{path}" stroke="#c9ced5" stroke-width="7" fill="none"/>"##);
    }

    fn draw_points(&self, frame: &ChartFrame, each: &Points, svg: &mut String) {
        let color = COLORS[each.competitor.color() % COLORS.len()];
        let places: Vec<_> = each.points.iter().map(|(time, error)| (frame.x(*time), frame.y(*error))).collect();
        if self.joined && places.len() > 1 {
            let path: Vec<String> = places.iter().map(|(x, y)| format!("{x} {y}")).collect();
            let _ = write!(
                svg,
                r#"<path d="M{}" stroke="{color}" stroke-width="1.2" stroke-opacity="0.7" fill="none"/>"#,
                path.join("L")
            );
        }
        for (x, y) in places {
            mark(svg, each.competitor.marker(), color, x, y);
        }
    }

    fn draw_legend(&self, svg: &mut String) {
        let (x, mut y) = (RIGHT + 18.0, TOP + 10.0);
        for each in &self.all {
            mark(svg, each.competitor.marker(), COLORS[each.competitor.color() % COLORS.len()], x, y - 4.0);
            let _ = write!(
                svg,
                r#"<text x="{}" y="{y}" font-size="12">{}</text>"#,
                x + 12.0,
                escape(&each.competitor.name())
            );
            y += 20.0;
        }
        let _ = write!(
            svg,
            r##"<path d="M{} {}h16" stroke="#c9ced5" stroke-width="7"/><text x="{}" y="{y}" font-size="12">Pareto front</text>"##,
            x - 8.0,
            y - 4.0,
            x + 12.0
        );
    }
}

/// Returns the integer powers of ten in a range.
#[expect(clippy::cast_possible_truncation, reason = "powers of ten of seconds and errors")]
fn whole([low, high]: [f64; 2]) -> std::ops::RangeInclusive<i32> {
    low as i32..=high as i32
}

/// Draws a marker: square, disc, triangle, cross or plus.
fn mark(svg: &mut String, marker: usize, color: &str, x: f64, y: f64) {
    let at = |dx: f64, dy: f64| format!("{} {}", tenth(x + dx), tenth(y + dy));
    let _ = match marker {
        0 => write!(svg, r#"<path d="M{}h8v8h-8z" fill="{color}"/>"#, at(-4.0, -4.0)),
        1 => write!(svg, r#"<circle cx="{x}" cy="{y}" r="4.4" fill="{color}"/>"#),
        2 => write!(svg, r#"<path d="M{}l5 9h-10z" fill="none" stroke="{color}" stroke-width="1.6"/>"#, at(0.0, -5.0)),
        3 => write!(
            svg,
            r#"<path d="M{}l8 8m0 -8l-8 8" stroke="{color}" stroke-width="2.2" fill="none"/>"#,
            at(-4.0, -4.0)
        ),
        _ => {
            write!(svg, r#"<path d="M{}h10m-5 -5v10" stroke="{color}" stroke-width="2.2" fill="none"/>"#, at(-5.0, 0.0))
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pareto_front_contains_only_undominated_points() {
        let points = [(3.0, 1e-3), (1.0, 1e-1), (2.0, 2e-1), (2.0, 1e-2), (4.0, 1e-3), (0.5, f64::NAN)];
        assert_eq!(front(&points), [(1.0, 1e-1), (2.0, 1e-2), (3.0, 1e-3)]);
    }

    #[test]
    fn a_chart_marks_every_point_and_names_every_competitor() {
        let all: Vec<Points> = Competitor::all()
            .into_iter()
            .map(|competitor| Points { competitor, points: vec![(1e-3, 1e-2), (1e-1, 1e-4)] })
            .collect();
        let svg = ErrorChart {
            error_label: "error".into(),
            all,
            joined: true,
            readable: Some((1e-3, "distance of the two".into())),
        }
        .to_svg();
        for competitor in Competitor::all() {
            assert!(svg.contains(&escape(&competitor.name())), "{}", competitor.name());
        }
        // Two points and the legend, for each of the four schemes with lcp and for the bi-potential on the full model.
        assert_eq!(svg.matches("<circle").count(), 15);
        assert!(svg.contains("1e-4") && svg.contains("distance of the two") && !svg.contains("NaN"));
    }
}
