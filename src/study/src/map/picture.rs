//! Draws the interaction map: amplitude in colour over speed and frequency, engine orders and modes as lines.

use std::fmt::Write as _;

use tiprub_figure::escape;

/// Size of the picture (SVG units).
const WIDTH: f64 = 920.0;
const HEIGHT: f64 = 600.0;
/// Left, top, right and bottom of the map in the picture (SVG units).
const FRAME: [f64; 4] = [74.0, 16.0, 772.0, 540.0];
/// Number of colour rows.
const ROWS: usize = 393;
/// Number of colour levels.
const LEVELS: usize = 32;
/// The matplotlib colour map viridis at nine equidistant values (public domain, CC0): its lightness increases evenly, and it remains readable with
/// colour-vision deficiency and in grey.
const VIRIDIS: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 45.0, 123.0],
    [59.0, 82.0, 139.0],
    [44.0, 114.0, 142.0],
    [33.0, 145.0, 140.0],
    [40.0, 174.0, 128.0],
    [94.0, 201.0, 98.0],
    [173.0, 220.0, 48.0],
    [253.0, 231.0, 37.0],
];

/// Amplitudes of one speed.
#[derive(Debug, Clone, Copy)]
pub struct SpeedColumn<'a> {
    /// Angular velocity (rad/s).
    pub speed: f64,
    /// Distance of the bins (Hz).
    pub resolution: f64,
    /// Amplitudes per bin (µm), from frequency 0; `None` if the run was rejected.
    pub amplitudes: Option<&'a [f64]>,
}

/// Line on the map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapLine {
    /// Points (speed in rad/s, frequency in Hz).
    pub points: Vec<(f64, f64)>,
    /// Label at the right end.
    pub label: String,
    /// Style of the line.
    pub kind: LineKind,
}

/// Meaning of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineKind {
    /// Engine order that the casing excites.
    Excited,
    /// Engine order that the casing does not excite.
    Silent,
    /// Natural frequency.
    Mode,
}

/// Complete map.
#[derive(Debug, Clone)]
pub struct HeatMap<'a> {
    /// Columns in ascending order of speed.
    pub columns: Vec<SpeedColumn<'a>>,
    /// Highest frequency (Hz).
    pub top: f64,
    /// Amplitudes of the first and the last colour (µm).
    pub range: [f64; 2],
    /// Lines, drawn in this order.
    pub lines: Vec<MapLine>,
    /// Excited crossings, marked as circles.
    pub marks: Vec<(f64, f64)>,
}

impl HeatMap<'_> {
    /// Returns the SVG element.
    pub fn to_svg(&self) -> String {
        let mut svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="14" fill="#343a42">"##
        );
        let [left, top, right, bottom] = FRAME;
        let (width, height) = (right - left, bottom - top);
        let _ = write!(
            svg,
            r##"<clipPath id="map"><rect x="{left}" y="{top}" width="{width}" height="{height}"/></clipPath><rect x="{left}" y="{top}" width="{width}" height="{height}" fill="{}"/><g clip-path="url(#map)">"##,
            color(0.0)
        );
        self.draw_cells(&mut svg);
        self.draw_lines(&mut svg);
        svg.push_str("</g>");
        self.draw_axes(&mut svg);
        self.draw_legend(&mut svg);
        svg.push_str("</svg>");
        svg
    }

    fn speeds(&self) -> [f64; 2] {
        let first = self.columns.first().map_or(0.0, |column| column.speed);
        let last = self.columns.last().map_or(1.0, |column| column.speed);
        if last > first { [first, last] } else { [first - 0.5, first + 0.5] }
    }

    /// Returns the shown range of speeds, extended by half a column width at both ends so that all columns are complete.
    fn shown_speeds(&self) -> [f64; 2] {
        let [first, last] = self.speeds();
        let half = 0.5 * (last - first) / self.columns.len().saturating_sub(1).max(1) as f64;
        [first - half, last + half]
    }

    fn x(&self, speed: f64) -> f64 {
        let [first, last] = self.shown_speeds();
        tenth(FRAME[0] + (FRAME[2] - FRAME[0]) * (speed - first) / (last - first))
    }

    fn y(&self, frequency: f64) -> f64 {
        tenth(FRAME[3] - (FRAME[3] - FRAME[1]) * frequency / self.top)
    }

    /// Returns the colour level of an amplitude.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the steps there are")]
    fn level(&self, amplitude: f64) -> usize {
        let [low, high] = self.range.map(f64::ln);
        let share = (amplitude.max(f64::MIN_POSITIVE).ln() - low) / (high - low);
        (share * LEVELS as f64).clamp(0.0, LEVELS as f64 - 1.0) as usize
    }

    /// Returns the largest amplitude within a row of the picture; that of the nearest bin if no bin lies in the row.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rows and bins are few")]
    fn row(&self, column: &SpeedColumn<'_>, amplitudes: &[f64], row: usize) -> f64 {
        let edge = |row: usize| self.top * row as f64 / ROWS as f64 / column.resolution;
        let (first, last) = (edge(row).ceil() as usize, edge(row + 1).ceil() as usize);
        let inside = amplitudes.get(first..last.min(amplitudes.len())).unwrap_or(&[]);
        let nearest = edge(row).midpoint(edge(row + 1)).round() as usize;
        inside.iter().copied().reduce(f64::max).or(amplitudes.get(nearest).copied()).unwrap_or(0.0)
    }

    /// Draws the cells: adjacent cells of one colour in a column are one rectangle, and all rectangles of one colour are one path.
    fn draw_cells(&self, svg: &mut String) {
        let mut paths = vec![String::new(); LEVELS];
        let [first, last] = self.shown_speeds();
        let half = 0.5 * (last - first) / self.columns.len().max(1) as f64;
        let height = |rows: usize| (FRAME[3] - FRAME[1]) * rows as f64 / ROWS as f64;
        for column in &self.columns {
            let (left, right) = (self.x(column.speed - half), self.x(column.speed + half));
            let Some(amplitudes) = column.amplitudes else {
                self.draw_refused(svg, left, right);
                continue;
            };
            let levels: Vec<usize> = (0..ROWS).map(|row| self.level(self.row(column, amplitudes, row))).collect();
            let mut start = 0;
            for run in levels.chunk_by(|a, b| a == b) {
                let (low, high) = (tenth(FRAME[3] - height(start)), tenth(FRAME[3] - height(start + run.len())));
                start += run.len();
                if run[0] > 0 {
                    let _ = write!(paths[run[0]], "M{left} {low}V{high}H{right}V{low}z");
                }
            }
        }
        for (level, path) in paths.iter().enumerate().filter(|(_, path)| !path.is_empty()) {
            let color = color((level as f64 + 0.5) / LEVELS as f64);
            let _ = write!(svg, r#"<path fill="{color}" shape-rendering="crispEdges" d="{path}"/>"#);
        }
    }

    fn draw_refused(&self, svg: &mut String, left: f64, right: f64) {
        let [_, top, _, bottom] = FRAME;
        let _ = write!(
            svg,
            r##"<rect class="refused" x="{left}" y="{top}" width="{}" height="{}" fill="#bbb"/><path d="M{left} {top}L{right} {bottom}M{right} {top}L{left} {bottom}" stroke="#c22"/>"##,
            tenth(right - left),
            bottom - top
        );
    }

    fn draw_lines(&self, svg: &mut String) {
        for line in &self.lines {
            let mut path = String::new();
            for (speed, frequency) in &line.points {
                let _ = write!(
                    path,
                    "{}{} {}",
                    if path.is_empty() { 'M' } else { 'L' },
                    self.x(*speed),
                    self.y(*frequency)
                );
            }
            let style = match line.kind {
                LineKind::Excited => r#"stroke-opacity="0.75""#,
                LineKind::Silent => r#"stroke-opacity="0.35" stroke-dasharray="2 5""#,
                LineKind::Mode => r#"stroke-opacity="0.9" stroke-dasharray="9 5""#,
            };
            let _ = write!(svg, r##"<path d="{path}" fill="none" stroke="#fff" stroke-width="1.1" {style}/>"##);
        }
        for (speed, frequency) in &self.marks {
            let (x, y) = (self.x(*speed), self.y(*frequency));
            let _ = write!(svg, r##"<circle cx="{x}" cy="{y}" r="7" fill="none" stroke="#fff" stroke-width="1.8"/>"##);
        }
    }

    fn draw_axes(&self, svg: &mut String) {
        let [left, top, right, bottom] = FRAME;
        let text = |svg: &mut String, x: f64, y: f64, anchor: &str, text: &str| {
            let _ = write!(svg, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{}</text>"#, escape(text));
        };
        for value in ticks(self.shown_speeds(), 8.0) {
            let x = self.x(value);
            let _ = write!(svg, r##"<path d="M{x} {bottom}v5" stroke="#99a0a8"/>"##);
            text(svg, x, bottom + 20.0, "middle", &format!("{value}"));
        }
        for value in ticks([0.0, self.top], 8.0) {
            let y = self.y(value);
            let _ = write!(svg, r##"<path d="M{left} {y}h-5" stroke="#99a0a8"/>"##);
            text(svg, left - 9.0, y + 5.0, "end", &format!("{value}"));
        }
        text(svg, left.midpoint(right), bottom + 46.0, "middle", "angular velocity (rad/s)");
        let _ = write!(
            svg,
            r#"<text transform="translate(18 {}) rotate(-90)" text-anchor="middle">frequency in the rotating frame (Hz)</text>"#,
            top.midpoint(bottom)
        );
        let mut taken: Vec<f64> = Vec::new();
        for line in self.lines.iter().filter(|line| !line.label.is_empty()) {
            let Some(end) = line.points.last().filter(|end| end.1 <= self.top) else { continue };
            let y = self.y(end.1) + 5.0;
            if taken.iter().all(|other| (other - y).abs() > 13.0) {
                text(svg, right + 6.0, y, "start", &line.label);
                taken.push(y);
            }
        }
    }

    fn draw_legend(&self, svg: &mut String) {
        let [_, top, _, bottom] = FRAME;
        let (left, width, height) = (850.0, 16.0, (bottom - top) / LEVELS as f64);
        for level in 0..LEVELS {
            let y = bottom - height * (level + 1) as f64;
            let color = color((level as f64 + 0.5) / LEVELS as f64);
            let _ = write!(
                svg,
                r#"<rect x="{left}" y="{y:.1}" width="{width}" height="{:.1}" fill="{color}"/>"#,
                height + 0.3
            );
        }
        let [low, high] = self.range.map(f64::log10);
        for power in (-12..12).map(f64::from).filter(|power| (low - 1e-9..=high + 1e-9).contains(power)) {
            let y = bottom - (bottom - top) * (power - low) / (high - low);
            let value = 10_f64.powf(power);
            let label = if power < -3.0 { format!("1e{power}") } else { format!("{value}") };
            let _ = write!(
                svg,
                r##"<path d="M{} {y:.1}h5" stroke="#99a0a8"/><text x="{}" y="{:.1}">{label}</text>"##,
                left + width,
                left + width + 8.0,
                y + 5.0
            );
        }
        let _ =
            write!(svg, r#"<text x="{}" y="{}" text-anchor="end">amplitude (µm)</text>"#, WIDTH - 6.0, bottom + 24.0);
    }
}

fn tenth(value: f64) -> f64 {
    (value * 10.0).round() / 10.0
}

/// Returns about `count` round numbers within a range.
fn ticks([low, high]: [f64; 2], count: f64) -> Vec<f64> {
    let raw = (high - low) / count;
    let power = 10_f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0].map(|factor| factor * power).into_iter().find(|step| *step >= raw * 0.999);
    let step = step.unwrap_or(10.0 * power);
    let first = (low / step - 1e-9).ceil();
    let rounded = |value: f64| (value * 1e6).round() / 1e6;
    (0..64).map(|index| rounded((first + f64::from(index)) * step)).take_while(|value| *value <= high).collect()
}

fn color(share: f64) -> String {
    let last = VIRIDIS.len() - 1;
    let place = share.clamp(0.0, 1.0) * last as f64;
    let index = (1..last).rev().find(|index| place >= *index as f64).unwrap_or(0);
    let fraction = place - index as f64;
    let channel = |channel: usize| VIRIDIS[index][channel] * (1.0 - fraction) + VIRIDIS[index + 1][channel] * fraction;
    format!("rgb({:.0},{:.0},{:.0})", channel(0), channel(1), channel(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map<'a>(columns: Vec<SpeedColumn<'a>>) -> HeatMap<'a> {
        let line = |kind, label: &str| MapLine { points: vec![(90.0, 30.0), (110.0, 40.0)], label: label.into(), kind };
        HeatMap {
            columns,
            top: 100.0,
            range: [0.01, 100.0],
            lines: vec![line(LineKind::Excited, "4Ω"), line(LineKind::Mode, "mode 1")],
            marks: vec![(100.0, 35.0)],
        }
    }

    #[test]
    fn spectral_line_is_drawn_as_one_rectangle() {
        let mut amplitudes = vec![0.0; 101];
        amplitudes[50] = 200.0;
        let column = |speed| SpeedColumn { speed, resolution: 1.0, amplitudes: Some(&amplitudes) };
        let svg = map(vec![column(90.0), column(110.0)]).to_svg();
        let cells = svg.split(r#"<path fill=""#).nth(1).unwrap();
        let cells = cells.split(r#"d=""#).nth(1).unwrap().split('"').next().unwrap();
        assert_eq!(cells.matches('M').count(), 2, "{cells}");
        let numbers: Vec<f64> = cells.split(['M', 'V', 'H', 'z', ' ']).filter_map(|text| text.parse().ok()).collect();
        let middle = FRAME[1].midpoint(FRAME[3]);
        assert!(
            (numbers[0] - FRAME[0]).abs() < 0.11 && (numbers[3] - FRAME[0].midpoint(FRAME[2])).abs() < 0.11,
            "{cells}"
        );
        assert!(numbers[1] >= middle - 2.0 && numbers[2] <= middle + 2.0 && numbers[1] > numbers[2], "{cells}");
        assert!(svg.contains(&color(1.0 - 0.5 / LEVELS as f64)) && svg.matches("<circle").count() == 1);
    }

    #[test]
    fn rejected_runs_are_marked_and_labels_are_present() {
        let amplitudes = vec![1.0; 101];
        let columns = vec![
            SpeedColumn { speed: 90.0, resolution: 1.0, amplitudes: Some(&amplitudes) },
            SpeedColumn { speed: 100.0, resolution: 1.0, amplitudes: None },
            SpeedColumn { speed: 110.0, resolution: 1.0, amplitudes: Some(&amplitudes) },
        ];
        let svg = map(columns).to_svg();
        assert_eq!(svg.matches("refused").count(), 1);
        for text in ["angular velocity (rad/s)", "amplitude (µm)", ">4Ω<", ">100<", ">0.01<"] {
            assert!(svg.contains(text), "{text}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn colours_lighten_and_levels_span_the_range() {
        let map = map(Vec::new());
        assert_eq!([0.0, 0.0101, 1.01, 99.0, 1e9].map(|value| map.level(value)), [0, 0, 16, 31, 31]);
        assert_eq!((color(0.0), color(1.0)), ("rgb(68,1,84)".into(), "rgb(253,231,37)".into()));
        assert_eq!(ticks([1087.2, 1630.8], 8.0), [1100.0, 1200.0, 1300.0, 1400.0, 1500.0, 1600.0]);
    }
}
