//! Maps of values: rows over time or over an angle, coloured by their values.

use std::fmt::Write as _;

use crate::{
    axis::{round_step, tick},
    escape,
};

/// Number of colours of the scale, which the style sheet of the page defines (`--q0` to `--q8`).
const LEVELS: usize = 9;
/// Largest height of a named row (SVG units).
const ROW: f64 = 14.0;
/// Space above the rows, below them for the axis, and to the right (SVG units).
const ABOVE: f64 = 9.0;
const BELOW: f64 = 46.0;
const RIGHT: f64 = 16.0;
/// Height of all scaled rows together (SVG units).
const SCALED: f64 = 260.0;
/// Largest height of all named rows together (SVG units).
const NAMED: f64 = 420.0;

/// Value that a cell shows if it covers several values, and the direction of the colour scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shows {
    /// Largest value; large values have strong colours.
    Largest,
    /// Smallest value; small values have strong colours.
    Smallest,
}

/// Rows of a map, from top to bottom.
#[derive(Debug, Clone)]
pub enum MapRows {
    /// Every row has a name.
    Named(Vec<String>),
    /// Rows divide a range of values evenly.
    Scaled {
        /// Label with unit.
        label: String,
        /// Values at the bottom and at the top.
        range: [f64; 2],
        /// Values that are marked by a line, with their meaning.
        marks: Vec<(f64, String)>,
    },
}

/// Map of values.
#[derive(Debug, Clone)]
pub struct GridMap {
    /// Axis label with unit.
    pub x_label: String,
    /// Range of the axis.
    pub x_range: [f64; 2],
    /// Quantity that the colour shows, with unit.
    pub value_label: String,
    /// Meaning of the rows.
    pub rows: MapRows,
    /// Values of the rows, all of one length; cells whose values are not finite are empty.
    pub values: Vec<Vec<f64>>,
    /// Value that a cell shows if it covers several values.
    pub shows: Shows,
    /// Number of decades of a logarithmic colour scale; `None` for a linear one.
    pub decades: Option<f64>,
}

/// Sizes of a picture (SVG units), and the class of its element.
struct MapSize {
    class: &'static str,
    width: f64,
    left: f64,
    /// Largest number of columns.
    bins: usize,
    font: f64,
    /// Approximate number of ticks of the horizontal axis.
    ticks: f64,
}

const SIZES: [MapSize; 2] = [
    MapSize { class: "wide", width: 920.0, left: 150.0, bins: 300, font: 13.0, ticks: 8.0 },
    MapSize { class: "narrow", width: 340.0, left: 96.0, bins: 120, font: 12.0, ticks: 4.0 },
];

impl GridMap {
    /// Returns the pictures for wide and for narrow pages and the colour scale, as HTML.
    pub fn to_html(&self) -> String {
        let range = self.range();
        let mut html = self.scale(range);
        for size in &SIZES {
            let _ = write!(html, "<div class=\"{}\">{}</div>", size.class, self.picture(range, size));
        }
        html
    }

    /// Returns the range of the colours: from 0, or from the smallest value if it is negative beyond rounding, to a round number.
    fn range(&self) -> [f64; 2] {
        let values = self.values.iter().flatten().copied().filter(|value| value.is_finite());
        let [low, high] = values.fold([0.0_f64, 0.0_f64], |[low, high], value| [low.min(value), high.max(value)]);
        if let Some(decades) = self.decades {
            let high = if high > 0.0 { round_step(high) } else { 1.0 };
            return [high * 10_f64.powf(-decades), high];
        }
        if high <= 0.0 {
            return [low.min(-f64::MIN_POSITIVE), 0.0];
        }
        let step = round_step(high / 10.0);
        let down = if low < -1e-3 * high { (low / step).floor() * step } else { 0.0 };
        [down, (high / step).ceil() * step]
    }

    /// Returns the index of the colour of a value.
    fn level(&self, value: f64, [low, high]: [f64; 2]) -> usize {
        let share = match self.decades {
            Some(decades) => 1.0 + (value.max(f64::MIN_POSITIVE) / high).log10() / decades,
            None => (value - low) / (high - low),
        };
        let share = share.clamp(0.0, 1.0);
        let share = if self.shows == Shows::Smallest { 1.0 - share } else { share };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ share ≤ 1")]
        // Only values at the weak end have the weakest colour, so that even a light contact is visible.
        let level = (share * (LEVELS - 1) as f64).ceil() as usize;
        level.min(LEVELS - 1)
    }

    /// Returns the colour scale as HTML.
    fn scale(&self, [low, high]: [f64; 2]) -> String {
        let ends = if self.shows == Shows::Smallest { [high, low] } else { [low, high] };
        let [weak, strong] = ends.map(tick);
        let steps: String = (0..LEVELS).map(|level| format!("<i class=\"q{level}\"></i>")).collect();
        format!(
            "<div class=\"legend levels\"><span>{}</span><span>{weak}<b>{steps}</b>{strong}</span></div>",
            escape(&self.value_label)
        )
    }

    /// Returns the height of a row (SVG units).
    fn row(&self) -> f64 {
        let count = self.values.len().max(1) as f64;
        match &self.rows {
            MapRows::Named(_) => ROW.min(NAMED / count),
            MapRows::Scaled { .. } => SCALED / count,
        }
    }

    fn picture(&self, range: [f64; 2], size: &MapSize) -> String {
        let MapSize { width, font, .. } = size;
        let left = self.left(size);
        let high = self.row() * self.values.len() as f64;
        let height = ABOVE + high + BELOW;
        let mut svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" class="map" viewBox="0 0 {width} {height:.1}" font-family="sans-serif" font-size="{font}">"#
        );
        self.cells(&mut svg, range, size);
        match &self.rows {
            MapRows::Named(names) => {
                // Labels of many rows would overlap.
                let every = (font / self.row()).ceil().max(1.0);
                for (index, name) in names.iter().enumerate().filter(|(index, _)| *index as f64 % every == 0.0) {
                    let y = ABOVE + self.row() * (index as f64 + 0.5) + 0.36 * font;
                    text(&mut svg, [left - 8.0, y], "end", name);
                }
            }
            MapRows::Scaled { label, range: [low, high_value], marks } => {
                let y = |value: f64| ABOVE + high * (high_value - value) / (high_value - low);
                for value in round_values([*low, *high_value], 6.0) {
                    let _ = write!(svg, r#"<path class="rule" d="M{left} {:.1}h-5"/>"#, y(value));
                    text(&mut svg, [left - 8.0, y(value) + 0.36 * font], "end", &tick(value));
                }
                let middle = ABOVE + 0.5 * high;
                let _ = write!(svg, r#"<g transform="translate({} {middle}) rotate(-90)">"#, 1.1 * font);
                text(&mut svg, [0.0, 0.0], "middle", label);
                svg.push_str("</g>");
                let mut last = f64::INFINITY;
                for (value, words) in marks.iter().filter(|(value, _)| (*low..=*high_value).contains(value)) {
                    let _ = write!(svg, r#"<path class="mark" d="M{left} {:.1}H{}"/>"#, y(*value), width - RIGHT);
                    // Labels of close lines would overlap.
                    if (last - y(*value)).abs() > 1.2 * font {
                        last = y(*value);
                        svg.push_str(r#"<g class="mark">"#);
                        text(&mut svg, [width - RIGHT - 3.0, last - 3.0], "end", words);
                        svg.push_str("</g>");
                    }
                }
            }
        }
        self.axis(&mut svg, ABOVE + high, size);
        svg.push_str("</svg>");
        svg
    }

    /// Returns the left edge of the cells (SVG units).
    fn left(&self, size: &MapSize) -> f64 {
        match &self.rows {
            MapRows::Named(names) => {
                let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0) as f64;
                (0.6 * size.font * longest + 14.0).clamp(40.0, size.left)
            }
            MapRows::Scaled { .. } => 5.2 * size.font,
        }
    }

    /// Draws one path for each colour, and merges neighbouring cells of one colour.
    fn cells(&self, svg: &mut String, range: [f64; 2], size: &MapSize) {
        let (left, row) = (self.left(size), self.row());
        let bins = size.bins.min(self.values.first().map_or(1, Vec::len)).max(1);
        let cell = (size.width - left - RIGHT) / bins as f64;
        let line = if row > 8.0 { 1.0 } else { 0.0 };
        let mut paths = vec![String::new(); LEVELS];
        for (index, values) in self.values.iter().enumerate() {
            let level = |bin: usize| Some(self.bin_value(values, bin, bins)).filter(|value| value.is_finite());
            let levels: Vec<Option<usize>> =
                (0..bins).map(|bin| level(bin).map(|value| self.level(value, range))).collect();
            // Neighbouring rows use the same rounded edge, so that no gap appears.
            let [y, below] = [index, index + 1].map(|index| ABOVE + row * index as f64);
            let mut from = 0;
            for run in levels.chunk_by(|a, b| a == b) {
                if let Some(level) = run[0] {
                    let [x, end] = [from, from + run.len()].map(|bin| left + cell * bin as f64);
                    let _ = write!(paths[level], "M{x:.1} {y:.1}H{end:.1}V{:.1}H{x:.1}z", below - line);
                }
                from += run.len();
            }
        }
        for (level, path) in paths.iter().enumerate().filter(|(_, path)| !path.is_empty()) {
            let _ = write!(svg, r#"<path class="q{level}" shape-rendering="crispEdges" d="{path}"/>"#);
        }
    }

    /// Returns the value that a column of a row shows.
    fn bin_value(&self, values: &[f64], bin: usize, bins: usize) -> f64 {
        let ends = [bin, bin + 1].map(|end| end * values.len() / bins);
        let own = values[ends[0]..ends[1].max(ends[0] + 1).min(values.len())].iter().copied();
        match self.shows {
            Shows::Largest => own.fold(f64::NEG_INFINITY, f64::max),
            Shows::Smallest => own.fold(f64::INFINITY, f64::min),
        }
    }

    fn axis(&self, svg: &mut String, y: f64, size: &MapSize) {
        let [first, last] = self.x_range;
        let left = self.left(size);
        let wide = size.width - left - RIGHT;
        for value in round_values(self.x_range, size.ticks) {
            let x = left + wide * (value - first) / (last - first).max(f64::MIN_POSITIVE);
            let _ = write!(svg, r#"<path class="rule" d="M{x:.1} {y:.1}v5"/>"#);
            text(svg, [x, y + 6.0 + size.font], "middle", &tick(value));
        }
        text(svg, [left + 0.5 * wide, y + 14.0 + 2.0 * size.font], "middle", &self.x_label);
    }
}

/// Returns about `count` round numbers within a range.
pub(crate) fn round_values([first, last]: [f64; 2], count: f64) -> impl Iterator<Item = f64> {
    let span = last - first;
    let step = round_step(if span > 0.0 { span } else { 1.0 } / count);
    let from = (first / step - 1e-9).ceil();
    (0..64_u32).map(move |index| (from + f64::from(index)) * step).take_while(move |value| *value <= last + 1e-9 * step)
}

fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, text: &str) {
    let _ = write!(svg, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{}</text>"#, escape(text));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(shows: Shows, values: Vec<f64>) -> GridMap {
        GridMap {
            x_label: "time (ms)".into(),
            x_range: [0.0, values.len() as f64],
            value_label: "force (N)".into(),
            rows: MapRows::Named(vec!["edge".into(), "middle <2>".into()]),
            values: vec![values, vec![0.0; 4]],
            shows,
            decades: None,
        }
    }

    #[test]
    fn short_contacts_are_visible_and_largest_force_is_strongest() {
        let mut values = vec![0.0; 4000];
        (values[2001], values[3000]) = (0.5, 940.0);
        let mut map = map(Shows::Largest, values);
        map.values[1] = vec![0.0; 4000];
        let html = map.to_html();
        assert_eq!(map.range().map(f64::to_bits), [0.0, 1000.0].map(f64::to_bits));
        assert_eq!(html.matches("<svg").count(), 2);
        for class in ["q0", "q1", "q8"] {
            assert_eq!(html.matches(&format!("<path class=\"{class}\"")).count(), 2, "{class}");
        }
        assert!(html.contains("middle &lt;2&gt;") && html.contains("force (N)") && html.len() < 8000);
    }

    #[test]
    fn small_clearances_have_strong_colours() {
        let map = map(Shows::Smallest, vec![-3e-16, 50.0, 100.0, 400.0]);
        let range = map.range();
        assert_eq!(range.map(f64::to_bits), [0.0, 400.0].map(f64::to_bits));
        assert_eq!([-3e-16, 100.0, 400.0].map(|value| map.level(value, range)), [8, 6, 0]);
        assert!(!map.to_html().contains("-0"), "{}", map.to_html());
    }

    #[test]
    fn scaled_rows_have_ticks_and_marks_and_a_logarithmic_scale() {
        let mut map = map(Shows::Largest, vec![1e-6, 1e-3, 1.0, f64::INFINITY]);
        map.decades = Some(4.0);
        let marks = vec![(250.0, "mode 1".into()), (900.0, "outside".into())];
        map.rows = MapRows::Scaled { label: "frequency (Hz)".into(), range: [0.0, 500.0], marks };
        let range = map.range();
        assert_eq!([1e-6, 1e-4, 1e-2, 1.0].map(|value| map.level(value, range)), [0, 0, 4, 8]);
        let html = map.to_html();
        assert!(html.contains("frequency (Hz)") && html.contains(">500<") && html.contains("mode 1"), "{html}");
        assert!(!html.contains("outside") && !html.contains("inf"), "{html}");
    }

    #[test]
    fn labels_of_many_rows_do_not_overlap() {
        let mut map = map(Shows::Largest, vec![1.0; 3]);
        map.values = vec![vec![1.0; 3]; 100];
        map.rows = MapRows::Named((0..100).map(|row| format!("row {row}")).collect());
        let html = map.to_html();
        assert!(html.contains(">row 0<") && !html.contains(">row 1<"), "{html}");
    }

    #[test]
    fn draws_maps_that_are_empty_or_constant() {
        for values in [vec![], vec![0.0], vec![f64::NAN; 3], vec![-1.0; 3]] {
            let mut map = map(Shows::Largest, values.clone());
            map.values[1].clone_from(&values);
            if values.is_empty() {
                (map.values, map.rows) = (Vec::new(), MapRows::Named(Vec::new()));
            }
            let html = map.to_html();
            assert!(html.contains("</svg>") && !html.contains("NaN") && !html.contains("inf"), "{html}");
        }
    }
}
