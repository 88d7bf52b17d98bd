//! Draws line plots as SVG: axes with units, light colours, series shortened without losing peaks.

use std::fmt::Write as _;

use plotters::{
    coord::Shift,
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};
use tiprub_shell::{Failure, Result};

use crate::{
    axis::{Axis, tick},
    decimate::decimate,
    escape,
};

/// Factor between the drawn and the displayed size: the SVG backend rounds to whole units.
const SCALE: u32 = 2;
const WIDTH: u32 = 920 * SCALE;
/// Sizes of a plot, in CSS pixels.
#[derive(Debug, Clone, Copy)]
struct PlotSize {
    width: u32,
    highest: u32,
    left: u32,
    x_labels: usize,
    buckets: usize,
}
const WIDE: PlotSize = PlotSize { width: WIDTH / SCALE, highest: u32::MAX, left: 78, x_labels: 10, buckets: 700 };
/// Size on the page for a phone.
const NARROW: PlotSize = PlotSize { width: 340, highest: 240, left: 62, x_labels: 5, buckets: 260 };
/// Height of a line of a legend above the plot, and the space around the legend, in CSS pixels.
const LEGEND_LINE: u32 = 22;
const LEGEND_ROOM: u32 = 6;
/// Left edge of the lines of a legend, in CSS pixels.
const LEGEND_LEFT: u32 = 86;
const INK: RGBColor = RGBColor(52, 58, 66);
const GRID: RGBColor = RGBColor(232, 235, 239);

/// Line colours, distinguishable with colour-vision deficiency and on grey paper.
pub const COLORS: [RGBColor; 11] = [
    RGBColor(31, 93, 160),
    RGBColor(214, 112, 24),
    RGBColor(36, 140, 118),
    RGBColor(170, 52, 116),
    RGBColor(110, 116, 124),
    RGBColor(92, 172, 222),
    RGBColor(120, 82, 28),
    RGBColor(152, 178, 40),
    RGBColor(226, 132, 172),
    RGBColor(20, 22, 26),
    RGBColor(116, 78, 178),
];

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Axis, Axis>>;

/// One line of a plot.
#[derive(Debug, Clone)]
pub struct Series {
    /// Legend text; a line with an empty label does not appear in the legend.
    pub label: String,
    /// Points, x ascending.
    pub points: Vec<(f64, f64)>,
    /// Index into [`COLORS`]; by default the next colour in order.
    pub color: Option<usize>,
    /// Style of the series.
    pub form: SeriesForm,
}

/// Style of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeriesForm {
    /// Line; peaks are kept if there are too many points.
    Line,
    /// Thin line through few points.
    Thin,
    /// Dot at every point.
    Dots,
}

impl Series {
    /// Creates a line.
    pub fn line(label: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self { label: label.into(), points, color: None, form: SeriesForm::Line }
    }

    /// Returns the series in another form and colour.
    pub fn drawn(self, form: SeriesForm, color: usize) -> Self {
        Self { form, color: Some(color), ..self }
    }

    fn color_number(&self, index: usize) -> usize {
        self.color.unwrap_or(index) % COLORS.len()
    }
}

/// One plot.
#[derive(Debug, Clone)]
pub struct Plot {
    /// Axis label with unit.
    pub x_label: String,
    /// Axis label with unit.
    pub y_label: String,
    /// Lines; colours repeat after the last of [`COLORS`].
    pub series: Vec<Series>,
    /// Height in CSS pixels at a width of 920.
    pub height: u32,
    /// Horizontal lines with a meaning (value, text); for linear axes.
    pub levels: Vec<(f64, String)>,
    /// True for a logarithmic y axis; values ≤ 0 are omitted.
    pub logarithmic: bool,
    /// True for a logarithmic x axis; values ≤ 0 are omitted.
    pub logarithmic_x: bool,
    /// True to mark the points.
    pub marked: bool,
}

impl Plot {
    /// Creates an empty plot with linear axes.
    pub fn new(x_label: impl Into<String>, y_label: impl Into<String>, series: Vec<Series>) -> Self {
        Self {
            x_label: x_label.into(),
            y_label: y_label.into(),
            series,
            height: 260,
            levels: Vec::new(),
            logarithmic: false,
            logarithmic_x: false,
            marked: false,
        }
    }

    /// Returns the legend (if there is more than one line) and the SVG element, as HTML.
    ///
    /// # Errors
    /// The errors of [`Plot::to_svg`].
    pub fn to_html(&self) -> Result<String> {
        let mut html = String::new();
        if self.series.len() > 1 {
            html.push_str("<div class=\"legend\">");
            for (series, color) in self.legend() {
                let _ = write!(html, "<span><i class=\"c{color}\"></i>{}</span>", escape(&series.label));
            }
            html.push_str("</div>");
        }
        for (class, size) in [("wide", WIDE), ("narrow", NARROW)] {
            let _ = write!(html, "<div class=\"{class}\">{}</div>", self.svg(0, size)?);
        }
        Ok(html)
    }

    /// Returns the series that have a label and a curve, with the indices of their colours.
    fn legend(&self) -> impl Iterator<Item = (&Series, usize)> {
        let colored = self.series.iter().enumerate().map(|(index, series)| (series, series.color_number(index)));
        colored.filter(|(series, _)| !series.label.is_empty() && self.finite_points_of(series).next().is_some())
    }

    /// Returns the SVG element.
    ///
    /// # Errors
    /// The plotting library fails (not observed with finite data).
    pub fn to_svg(&self) -> Result<String> {
        self.svg(0, WIDE)
    }

    /// Returns the SVG element including the legend, for a separate file.
    ///
    /// # Errors
    /// The errors of [`Plot::to_svg`].
    pub fn to_whole_svg(&self) -> Result<String> {
        let lines = self.legend_places().iter().map(|(_, line)| line + 1).max().unwrap_or(0);
        self.svg(if self.series.len() > 1 { LEGEND_LINE * lines + LEGEND_ROOM } else { 0 }, WIDE)
    }

    /// Returns the left edge (CSS pixels) and the line of every entry of the legend.
    fn legend_places(&self) -> Vec<(u32, u32)> {
        let (mut left, mut line) = (LEGEND_LEFT, 0);
        let mut places = Vec::new();
        for (series, _) in self.legend() {
            // Letter widths are unknown here, so that each letter counts slightly more than usual.
            let width = 44 + 8 * u32::try_from(series.label.chars().count()).unwrap_or(0);
            if left + width > WIDTH / SCALE && left > LEGEND_LEFT {
                (left, line) = (LEGEND_LEFT, line + 1);
            }
            places.push((left, line));
            left += width;
        }
        places
    }

    /// Draws the plot with `legend` CSS pixels above it for a legend.
    fn svg(&self, legend: u32, size: PlotSize) -> Result<String> {
        let mut svg = String::new();
        {
            let height = (self.height.min(size.highest) + legend) * SCALE;
            let whole = SVGBackend::with_string(&mut svg, (size.width * SCALE, height)).into_drawing_area();
            let (top, area) = whole.split_vertically(legend * SCALE);
            if legend > 0 {
                self.draw_legend(&top).map_err(|error| Failure::new("report plot", error, ""))?;
            }
            self.draw(&area, size).map_err(|error| Failure::new("report plot", error, ""))?;
            area.present().map_err(|error| Failure::new("report plot", error, ""))?;
        }
        Ok(svg)
    }

    fn draw_legend(&self, area: &DrawingArea<SVGBackend<'_>, Shift>) -> Result<(), String> {
        let font = ("sans-serif", 14 * SCALE).into_font().color(&INK);
        let pixels = |value: u32| i32::try_from(value * SCALE).unwrap_or(i32::MAX);
        for ((series, color), (left, line)) in self.legend().zip(self.legend_places()) {
            let top = line * LEGEND_LINE;
            let corners = [(pixels(left), pixels(top + 12)), (pixels(left + 20), pixels(top + 15))];
            area.draw(&Rectangle::new(corners, COLORS[color].filled())).map_err(|error| error.to_string())?;
            let text = Text::new(series.label.clone(), (pixels(left + 26), pixels(top + 6)), font.clone());
            area.draw(&text).map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    fn draw(&self, area: &DrawingArea<SVGBackend<'_>, Shift>, size: PlotSize) -> Result<(), String> {
        let x_range = self.x_range();
        let levels = self.levels.iter().map(|level| level.0);
        let y_range = padded(self.finite_points().map(|point| point.1).chain(levels), 0.06);
        let y_range = if self.logarithmic { y_range.start.floor()..y_range.end.ceil() } else { y_range };
        let mut builder = ChartBuilder::on(area);
        builder.margin(8 * SCALE).x_label_area_size(42 * SCALE).y_label_area_size(size.left * SCALE);
        let axes = (Axis::new(x_range, self.logarithmic_x), Axis::new(y_range, self.logarithmic));
        let mut chart = builder.build_cartesian_2d(axes.0, axes.1).map_err(|error| error.to_string())?;
        self.draw_axes(&mut chart, size)?;
        self.draw_levels(&mut chart)?;
        self.draw_series(&mut chart, size)
    }

    fn draw_axes(&self, chart: &mut Chart<'_, '_>, size: PlotSize) -> Result<(), String> {
        let y_label = |value: &f64| match self.logarithmic {
            false => tick(*value),
            true if value.fract().abs() < 1e-9 => format!("1e{}", value.round()),
            true => tick(10_f64.powf(*value)),
        };
        let x_label = |value: &f64| match self.logarithmic_x {
            false => tick(*value),
            true => tick(10_f64.powf(*value)),
        };
        chart
            .configure_mesh()
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .axis_desc_style(("sans-serif", 15 * SCALE).into_font().color(&INK))
            .label_style(("sans-serif", 14 * SCALE).into_font().color(&INK))
            .x_labels(size.x_labels)
            .y_labels(6)
            .max_light_lines(1)
            .bold_line_style(GRID.stroke_width(SCALE))
            .light_line_style(TRANSPARENT)
            .axis_style(INK.mix(0.5).stroke_width(SCALE))
            .y_label_formatter(&y_label)
            .x_label_formatter(&x_label)
            .draw()
            .map_err(|error| error.to_string())
    }

    /// Draws dashed horizontal lines with their meaning at the right end.
    fn draw_levels(&self, chart: &mut Chart<'_, '_>) -> Result<(), String> {
        let x_range = self.x_range();
        for (level, label) in &self.levels {
            let ends = [(x_range.start, *level), (x_range.end, *level)];
            let style = INK.mix(0.55).stroke_width(SCALE);
            chart.draw_series(DashedLineSeries::new(ends, 10, 8, style)).map_err(|error| error.to_string())?;
            let font = ("sans-serif", 13 * SCALE).into_font().color(&INK.mix(0.8));
            let text = Text::new(label.clone(), (-6, -6), font.pos(Pos::new(HPos::Right, VPos::Bottom)));
            let element = EmptyElement::at((x_range.end, *level)) + text;
            chart.draw_series(std::iter::once(element)).map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    fn draw_series(&self, chart: &mut Chart<'_, '_>, size: PlotSize) -> Result<(), String> {
        for (index, series) in self.series.iter().enumerate() {
            let finite: Vec<_> = self.finite_points_of(series).collect();
            let color = COLORS[series.color_number(index)];
            let width = if series.form == SeriesForm::Line { SCALE + SCALE / 2 } else { SCALE / 2 };
            if series.form != SeriesForm::Dots {
                let line = LineSeries::new(decimate(&finite, size.buckets), color.stroke_width(width));
                chart.draw_series(line).map_err(|error| error.to_string())?;
            }
            if self.marked || series.form == SeriesForm::Dots {
                let circle = |point: &(f64, f64)| Circle::new(*point, 4 * SCALE, color.filled());
                chart.draw_series(finite.iter().map(circle)).map_err(|error| error.to_string())?;
            }
        }
        Ok(())
    }

    /// Returns the points that can be drawn, with logarithms on logarithmic axes.
    fn finite_points_of<'s>(&self, series: &'s Series) -> impl Iterator<Item = (f64, f64)> + use<'s> {
        let (x_logarithmic, y_logarithmic) = (self.logarithmic_x, self.logarithmic);
        let scaled = |value: f64, logarithmic: bool| if logarithmic { value.log10() } else { value };
        let points = series.points.iter().map(move |(x, y)| (scaled(*x, x_logarithmic), scaled(*y, y_logarithmic)));
        points.filter(|(x, y)| x.is_finite() && y.is_finite())
    }

    /// Returns the range of x over all series, drawable or not, so that plots of one run have the same axis.
    fn x_range(&self) -> std::ops::Range<f64> {
        if self.logarithmic_x {
            return padded(self.finite_points().map(|point| point.0), 0.05);
        }
        let all = self.series.iter().flat_map(|series| series.points.iter().map(|point| point.0));
        padded(all.filter(|x| x.is_finite()), 0.0)
    }

    fn finite_points(&self) -> impl Iterator<Item = (f64, f64)> {
        self.series.iter().flat_map(|series| self.finite_points_of(series))
    }
}

/// Returns the smallest range that contains the values, with a margin; never empty.
fn padded(values: impl Iterator<Item = f64>, margin: f64) -> std::ops::Range<f64> {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if !(low.is_finite() && high.is_finite()) {
        return 0.0..1.0;
    }
    let span = high - low;
    if span > 1e-12 * high.abs().max(low.abs()) {
        low - margin * span..high + margin * span
    } else {
        let half = if high == 0.0 { 1.0 } else { 0.1 * high.abs() };
        low - half..high + half
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_shows_its_labels_and_stays_small() {
        let points: Vec<(f64, f64)> = (0..200_000).map(|i| (f64::from(i), f64::from(i % 977))).collect();
        let mut plot = Plot::new("time (ms)", "gap (µm)", vec![Series::line("leading edge", points)]);
        plot.levels.push((500.0, "nominal".into()));
        plot.series.push(Series::line("empty", Vec::new()));
        let svg = plot.to_html().unwrap();
        for text in ["time (ms)", "gap (µm)", "leading edge", "nominal", "class=\"wide\"", "class=\"narrow\""] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("empty"), "no entry of the legend without a curve");
        assert!(svg.len() < 90_000, "{} bytes", svg.len());
    }

    #[test]
    fn separate_legend_holds_labelled_lines_only() {
        let line = |label: &str| Series::line(label, vec![(0.0, 1.0), (1.0, 2.0)]);
        let series = vec![line("first"), line("").drawn(SeriesForm::Thin, 4), line("third").drawn(SeriesForm::Dots, 7)];
        let plot = Plot::new("x", "y", series);
        let svg = plot.to_whole_svg().unwrap();
        assert!(svg.contains("first") && svg.contains("third"));
        assert!(!plot.to_svg().unwrap().contains("first"), "a page has it beside the picture");
        assert_eq!(svg.matches("<circle").count(), 2);
        assert_eq!(plot.to_html().unwrap().matches("<i class").count(), 2);
    }

    #[test]
    fn long_legend_wraps_within_the_picture() {
        let line =
            |index: u32| Series::line(format!("a method with a long name {index}"), vec![(0.0, 1.0), (1.0, 2.0)]);
        let plot = Plot::new("x", "y", (0..7).map(line).collect());
        let places = plot.legend_places();
        assert!(places.iter().all(|(left, _)| left + 44 + 8 * 27 <= WIDTH / SCALE), "{places:?}");
        assert!(places.windows(2).all(|pair| pair[1] > pair[0] || pair[1].1 > pair[0].1));
        assert_eq!(places.last().unwrap().1, 2);
        let height =
            |svg: String| svg.split("height=\"").nth(1).unwrap().split('"').next().unwrap().parse::<u32>().unwrap();
        assert_eq!(height(plot.to_whole_svg().unwrap()) - height(plot.to_svg().unwrap()), (3 * 22 + 6) * SCALE);
    }

    #[test]
    fn powers_of_ten_are_labelled_on_a_logarithmic_axis() {
        let points = vec![(0.0, 1e-17), (1.0, 3e-15), (2.0, 0.0)];
        let plot = Plot { logarithmic: true, ..Plot::new("x", "y", vec![Series::line("a", points)]) };
        let svg = plot.to_svg().unwrap();
        assert!(svg.contains("1e-16") && svg.contains("1e-15"), "{svg}");
    }

    #[test]
    fn plots_degenerate_data() {
        for points in [vec![], vec![(0.0, 0.0)], vec![(1.0, f64::NAN), (2.0, 3.0)], vec![(0.0, 7.0), (1.0, 7.0)]] {
            for logarithmic in [false, true] {
                let plot = Plot { logarithmic, ..Plot::new("x", "y", vec![Series::line("a", points.clone())]) };
                assert!(plot.to_svg().unwrap().starts_with("<svg"));
            }
        }
    }
}
