//! Maps over time: a row for every contact node, coloured by its value.

use std::fmt::Write as _;

use crate::{
    axis::{round_step, tick},
    escape,
};

/// Number of colours of the scale, which the style sheet of the page defines (`--q0` to `--q8`).
const LEVELS: usize = 9;
/// Heights in the picture (SVG units): of a row, of the space above the rows, and of the axis below them.
const ROW: f64 = 14.0;
const ABOVE: f64 = 4.0;
const BELOW: f64 = 46.0;
const RIGHT: f64 = 16.0;

/// Value of a cell that covers several times, and the direction of the colour scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shows {
    /// Largest value; large values have strong colours.
    Largest,
    /// Smallest value; small values have strong colours.
    Smallest,
}

/// Map over time.
#[derive(Debug, Clone)]
pub struct TimeMap {
    /// Axis label with unit.
    pub x_label: String,
    /// Quantity that the colour shows, with unit.
    pub value_label: String,
    /// Rows from top to bottom: name and values, all as long as `times`.
    pub rows: Vec<(String, Vec<f64>)>,
    /// Times, ascending.
    pub times: Vec<f64>,
    /// Value that a cell shows.
    pub shows: Shows,
}

/// Sizes of a picture.
struct MapSize {
    class: &'static str,
    width: f64,
    left: f64,
    bins: usize,
    font: f64,
    ticks: f64,
}

const SIZES: [MapSize; 2] = [
    MapSize { class: "wide", width: 920.0, left: 150.0, bins: 300, font: 13.0, ticks: 8.0 },
    MapSize { class: "narrow", width: 340.0, left: 96.0, bins: 120, font: 12.0, ticks: 4.0 },
];

impl TimeMap {
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
        let values = self.rows.iter().flat_map(|row| row.1.iter().copied()).filter(|value| value.is_finite());
        let [low, high] = values.fold([0.0_f64, 0.0_f64], |[low, high], value| [low.min(value), high.max(value)]);
        if high <= 0.0 {
            return [low.min(-f64::MIN_POSITIVE), 0.0];
        }
        let step = round_step(high / 10.0);
        let down = if low < -1e-3 * high { (low / step).floor() * step } else { 0.0 };
        [down, (high / step).ceil() * step]
    }

    fn level(&self, value: f64, [low, high]: [f64; 2]) -> usize {
        let share = ((value - low) / (high - low)).clamp(0.0, 1.0);
        let share = if self.shows == Shows::Smallest { 1.0 - share } else { share };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ share ≤ 1")]
        // Only values at the weak end have the weakest colour, so that even a light contact is visible.
        let level = (share * (LEVELS - 1) as f64).ceil() as usize;
        level.min(LEVELS - 1)
    }

    fn scale(&self, [low, high]: [f64; 2]) -> String {
        let ends = if self.shows == Shows::Smallest { [high, low] } else { [low, high] };
        let [weak, strong] = ends.map(tick);
        let steps: String = (0..LEVELS).map(|level| format!("<i class=\"q{level}\"></i>")).collect();
        format!(
            "<div class=\"legend levels\"><span>{}</span><span>{weak}<b>{steps}</b>{strong}</span></div>",
            escape(&self.value_label)
        )
    }

    fn picture(&self, range: [f64; 2], size: &MapSize) -> String {
        let MapSize { width, left, font, .. } = size;
        let high = ROW * self.rows.len() as f64;
        let height = ABOVE + high + BELOW;
        let mut svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" class="map" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="{font}">"#
        );
        for (index, (name, _)) in self.rows.iter().enumerate() {
            let y = ABOVE + ROW * (index as f64 + 0.5) + 0.36 * font;
            text(&mut svg, [left - 8.0, y], "end", name);
        }
        self.cells(&mut svg, range, size);
        self.axis(&mut svg, ABOVE + high, size);
        svg.push_str("</svg>");
        svg
    }

    /// Draws one path per colour; neighbouring cells of one colour are merged.
    fn cells(&self, svg: &mut String, range: [f64; 2], size: &MapSize) {
        let bins = size.bins.min(self.times.len()).max(1);
        let cell = (size.width - size.left - RIGHT) / bins as f64;
        let mut paths = vec![String::new(); LEVELS];
        for (index, (_, values)) in self.rows.iter().enumerate() {
            let levels: Vec<usize> = (0..bins).map(|bin| self.level(self.of_bin(values, bin, bins), range)).collect();
            let y = ABOVE + ROW * index as f64;
            let mut from = 0;
            for bin in 1..=bins {
                if bin == bins || levels[bin] != levels[from] {
                    let (x, wide) = (size.left + cell * from as f64, cell * (bin - from) as f64);
                    let _ = write!(paths[levels[from]], "M{x:.1} {y}h{wide:.1}v{:.0}h-{wide:.1}z", ROW - 1.0);
                    from = bin;
                }
            }
        }
        for (level, path) in paths.iter().enumerate().filter(|(_, path)| !path.is_empty()) {
            let _ = write!(svg, r#"<path class="q{level}" d="{path}"/>"#);
        }
    }

    fn of_bin(&self, values: &[f64], bin: usize, bins: usize) -> f64 {
        let ends = [bin, bin + 1].map(|end| end * values.len() / bins);
        let own = values[ends[0]..ends[1].max(ends[0] + 1).min(values.len())].iter().copied();
        match self.shows {
            Shows::Largest => own.fold(f64::NEG_INFINITY, f64::max),
            Shows::Smallest => own.fold(f64::INFINITY, f64::min),
        }
    }

    fn axis(&self, svg: &mut String, y: f64, size: &MapSize) {
        let (Some(first), Some(last)) = (self.times.first(), self.times.last()) else { return };
        let wide = size.width - size.left - RIGHT;
        let step = round_step((last - first).max(f64::MIN_POSITIVE) / size.ticks);
        let from = (first / step - 1e-9).ceil();
        for index in 0..64_u32 {
            let value = (from + f64::from(index)) * step;
            if value > last + 1e-9 * step {
                break;
            }
            let x = size.left + wide * (value - first) / (last - first).max(f64::MIN_POSITIVE);
            let _ = write!(svg, r#"<path class="rule" d="M{x:.1} {y}v5"/>"#);
            text(svg, [x, y + 6.0 + size.font], "middle", &tick(value));
        }
        text(svg, [size.left + 0.5 * wide, y + 14.0 + 2.0 * size.font], "middle", &self.x_label);
    }
}

fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, text: &str) {
    let _ = write!(svg, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{}</text>"#, escape(text));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(shows: Shows, values: Vec<f64>) -> TimeMap {
        TimeMap {
            x_label: "time (ms)".into(),
            value_label: "force (N)".into(),
            times: (0..values.len()).map(|index| index as f64).collect(),
            rows: vec![("edge".into(), values), ("middle <2>".into(), vec![0.0; 4])],
            shows,
        }
    }

    #[test]
    fn short_contacts_are_visible_and_largest_force_is_strongest() {
        let mut values = vec![0.0; 4000];
        (values[2001], values[3000]) = (0.5, 940.0);
        let mut map = map(Shows::Largest, values);
        map.rows[1].1 = vec![0.0; 4000];
        let html = map.to_html();
        assert_eq!(map.range().map(f64::to_bits), [0.0, 1000.0].map(f64::to_bits));
        assert_eq!(html.matches("<svg").count(), 2);
        for class in ["q0", "q1", "q8"] {
            assert_eq!(html.matches(&format!("<path class=\"{class}\"")).count(), 2, "{class}");
        }
        assert!(html.contains("middle &lt;2&gt;") && html.contains("force (N)") && html.len() < 8000);
    }

    #[test]
    fn small_clearances_are_strong_and_negative_rounding_is_zero() {
        let map = map(Shows::Smallest, vec![-3e-16, 50.0, 100.0, 400.0]);
        let range = map.range();
        assert_eq!(range.map(f64::to_bits), [0.0, 400.0].map(f64::to_bits));
        assert_eq!([-3e-16, 100.0, 400.0].map(|value| map.level(value, range)), [8, 6, 0]);
        assert!(!map.to_html().contains("-0"), "{}", map.to_html());
    }

    #[test]
    fn draws_degenerate_maps() {
        for values in [vec![], vec![0.0], vec![f64::NAN; 3], vec![-1.0; 3]] {
            let mut map = map(Shows::Largest, values.clone());
            map.rows[1].1.clone_from(&values);
            if values.is_empty() {
                map.rows.clear();
            }
            let html = map.to_html();
            assert!(html.contains("</svg>") && !html.contains("NaN") && !html.contains("inf"), "{html}");
        }
    }
}
