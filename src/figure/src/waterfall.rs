//! Waterfall diagrams: curves behind each other in oblique projection; nearer curves hide those behind.

use std::fmt::Write as _;

use crate::escape;

/// Size of the picture (SVG units).
const WIDTH: f64 = 920.0;
const HEIGHT: f64 = 470.0;
/// Position of the front left corner of the floor.
const ORIGIN: [f64; 2] = [110.0, 400.0];
/// Extent of the floor to the right, and the offsets to the right and upwards over the whole depth.
const ACROSS: f64 = 560.0;
const DEPTH: [f64; 2] = [150.0, 170.0];
/// Height of the value axis.
const UP: f64 = 190.0;
/// Largest number of drawn points of one curve; peaks are kept.
const MOST_POINTS: usize = 500;

/// One axis.
#[derive(Debug, Clone, PartialEq)]
pub struct WaterfallAxis {
    /// Label with unit.
    pub label: String,
    /// Displayed range.
    pub range: [f64; 2],
    /// True if it runs from the largest value to the smallest.
    pub reversed: bool,
}

impl WaterfallAxis {
    /// Creates an axis over the finite values among these; its range is never empty.
    pub fn over(label: impl Into<String>, values: impl Iterator<Item = f64>) -> Self {
        let extend = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
        let [low, high] = values.filter(|value| value.is_finite()).fold([f64::INFINITY, f64::NEG_INFINITY], extend);
        let range = match (low.is_finite(), high > low) {
            (false, _) => [0.0, 1.0],
            (true, true) => [low, high],
            (true, false) => [low - 0.5 * low.abs().max(1.0), low + 0.5 * low.abs().max(1.0)],
        };
        Self { label: label.into(), range, reversed: false }
    }

    /// Returns the position of a value on the axis, from 0 to 1.
    fn share(&self, value: f64) -> f64 {
        let share = ((value - self.range[0]) / (self.range[1] - self.range[0])).clamp(0.0, 1.0);
        if self.reversed { 1.0 - share } else { share }
    }

    /// Returns the axis in reversed direction.
    pub fn reversed(self) -> Self {
        Self { reversed: !self.reversed, ..self }
    }

    /// Returns about `count` round numbers within the range.
    fn ticks(&self, count: f64) -> Vec<f64> {
        let [low, high] = self.range;
        let raw = (high - low) / count;
        let power = 10_f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|step| *step >= raw * 0.999);
        let step = step.unwrap_or(10.0 * power);
        let first = (low / step - 1e-9).ceil();
        let tick = |index: u32| (first + f64::from(index)) * step;
        (0..64).map(tick).take_while(|value| *value <= high + 1e-9 * step).collect()
    }
}

/// Family of curves.
#[derive(Debug, Clone, PartialEq)]
pub struct Waterfall {
    /// Axis to the right.
    pub x: WaterfallAxis,
    /// Axis into the picture.
    pub depth: WaterfallAxis,
    /// Upward axis; values beyond its range are cut off.
    pub value: WaterfallAxis,
    /// Curves: position in depth, and points (x, value) with x ascending.
    pub curves: Vec<(f64, Vec<(f64, f64)>)>,
}

impl Waterfall {
    /// Returns the SVG element.
    pub fn to_svg(&self) -> String {
        let mut svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="14" fill="#343a42" stroke-linejoin="round">"##
        );
        self.draw_floor(&mut svg);
        let mut order: Vec<_> = self.curves.iter().collect();
        order.sort_by(|a, b| self.depth.share(b.0).total_cmp(&self.depth.share(a.0)));
        for (place, points) in order {
            self.draw_curve(&mut svg, self.depth.share(*place), points);
        }
        self.draw_labels(&mut svg);
        svg.push_str("</svg>");
        svg
    }

    /// Returns the SVG coordinates of relative positions on the three axes, to a tenth.
    fn place(x: f64, depth: f64, value: f64) -> String {
        let tenth = |value: f64| (value * 10.0).round() / 10.0;
        let right = ORIGIN[0] + ACROSS * x + DEPTH[0] * depth;
        format!("{} {}", tenth(right), tenth(ORIGIN[1] - DEPTH[1] * depth - UP * value))
    }

    fn draw_floor(&self, svg: &mut String) {
        let line = |svg: &mut String, from: String, to: String, color: &str| {
            let _ = write!(svg, r#"<path d="M{from}L{to}" stroke="{color}" fill="none"/>"#);
        };
        for tick in self.x.ticks(8.0).iter().map(|value| self.x.share(*value)) {
            line(svg, Self::place(tick, 0.0, 0.0), Self::place(tick, 1.0, 0.0), "#e8ebef");
        }
        for tick in self.depth.ticks(5.0).iter().map(|value| self.depth.share(*value)) {
            line(svg, Self::place(0.0, tick, 0.0), Self::place(1.0, tick, 0.0), "#e8ebef");
        }
        for tick in self.value.ticks(4.0).iter().map(|value| self.value.share(*value)) {
            line(svg, Self::place(0.0, 1.0, tick), Self::place(1.0, 1.0, tick), "#e8ebef");
            line(svg, Self::place(0.0, 0.0, tick), Self::place(0.0, 1.0, tick), "#e8ebef");
        }
        line(svg, Self::place(0.0, 0.0, 0.0), Self::place(0.0, 0.0, 1.0), "#99a0a8");
        line(svg, Self::place(0.0, 0.0, 0.0), Self::place(1.0, 0.0, 0.0), "#99a0a8");
        line(svg, Self::place(1.0, 0.0, 0.0), Self::place(1.0, 1.0, 0.0), "#99a0a8");
    }

    /// Draws a curve: a white area down to the floor hides the curves behind it; the colour depends on the depth.
    fn draw_curve(&self, svg: &mut String, depth: f64, points: &[(f64, f64)]) {
        let finite: Vec<(f64, f64)> =
            points.iter().copied().filter(|point| point.0.is_finite() && point.1.is_finite()).collect();
        let shown = super::decimate::decimate(&finite, MOST_POINTS / 4);
        let (Some(first), Some(last)) = (shown.first(), shown.last()) else { return };
        let mut path = String::new();
        for (x, value) in &shown {
            let letter = if path.is_empty() { 'M' } else { 'L' };
            let _ = write!(path, "{letter}{}", Self::place(self.x.share(*x), depth, self.value.share(*value)));
        }
        let floor = |x: f64| Self::place(self.x.share(x), depth, 0.0);
        let (right, left) = (floor(last.0), floor(first.0));
        let _ = write!(svg, r##"<path d="{path}L{right}L{left}Z" fill="#fff" fill-opacity="0.85"/>"##);
        let [red, green, blue] =
            [[31.0, 150.0], [93.0, 170.0], [160.0, 190.0]].map(|[near, far]| (near + depth * (far - near)).round());
        let _ = write!(svg, r#"<path d="{path}" fill="none" stroke="rgb({red},{green},{blue})" stroke-width="1.4"/>"#);
    }

    fn draw_labels(&self, svg: &mut String) {
        let text = |svg: &mut String, [x, y]: [f64; 2], anchor: &str, text: &str| {
            let _ = write!(svg, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{}</text>"#, escape(text));
        };
        for value in self.x.ticks(8.0) {
            text(svg, [ORIGIN[0] + ACROSS * self.x.share(value), ORIGIN[1] + 18.0], "middle", &number(value));
        }
        for value in self.depth.ticks(5.0) {
            let share = self.depth.share(value);
            let place = [ORIGIN[0] + ACROSS + DEPTH[0] * share + 8.0, ORIGIN[1] - DEPTH[1] * share + 5.0];
            text(svg, place, "start", &number(value));
        }
        for value in self.value.ticks(4.0) {
            text(svg, [ORIGIN[0] - 8.0, ORIGIN[1] - UP * self.value.share(value) + 5.0], "end", &number(value));
        }
        text(svg, [ORIGIN[0] + 0.5 * ACROSS, ORIGIN[1] + 44.0], "middle", &self.x.label);
        text(svg, [WIDTH - 12.0, ORIGIN[1] + 44.0], "end", &self.depth.label);
        let (x, y) = (24.0, ORIGIN[1] - 0.5 * UP);
        let label = escape(&self.value.label);
        let _ = write!(svg, r#"<text transform="translate({x} {y}) rotate(-90)" text-anchor="middle">{label}</text>"#);
    }
}

/// Formats a number without trailing zeros or rounding digits.
fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&value.abs()) {
        let text = format!("{value:.2e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'));
    }
    format!("{value:.4}").trim_end_matches('0').trim_end_matches('.').to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Waterfall {
        let curve = |place: f64| (place, (0..2000).map(|i| (f64::from(i), if i == 777 { 5.0 } else { 0.1 })).collect());
        Waterfall {
            x: WaterfallAxis::over("mode (-)", [1.0, 60.0].into_iter()),
            depth: WaterfallAxis::over("modes kept (-)", [0.0, 25.0].into_iter()),
            value: WaterfallAxis::over("deviation (%)", [0.0, 3.0].into_iter()),
            curves: vec![curve(0.0), curve(10.0), (25.0, Vec::new()), (20.0, vec![(1.0, f64::NAN)])],
        }
    }

    #[test]
    fn axes_are_labelled_and_the_picture_stays_small() {
        let svg = sample().to_svg();
        for text in ["mode (-)", "modes kept (-)", "deviation (%)", ">60<", ">25<", ">3<"] {
            assert!(svg.contains(text), "{text} is not in {svg}");
        }
        assert!(svg.len() < 60_000 && !svg.contains("NaN"), "{} bytes", svg.len());
    }

    #[test]
    fn draws_the_nearest_curve_last_and_clips_values() {
        let svg = sample().to_svg();
        let (far, near) = (svg.find("stroke=\"rgb(79,").unwrap(), svg.find("stroke=\"rgb(31,93,160)").unwrap());
        assert!(far < near);
        let heights = svg.split(['M', 'L', 'Z']).filter_map(|text| text.split(['"', ' ']).nth(1)?.parse::<f64>().ok());
        assert!(heights.fold(f64::INFINITY, f64::min) >= ORIGIN[1] - DEPTH[1] - UP);
    }

    #[test]
    fn ticks_are_round_numbers_within_the_axis() {
        let axis = |low, high| WaterfallAxis { label: String::new(), range: [low, high], reversed: false };
        assert_eq!(axis(0.0, 3.0).ticks(4.0), [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(axis(0.0, 1456.0).ticks(5.0), [0.0, 500.0, 1000.0]);
        assert_eq!(axis(-1e-6, 4e-6).ticks(5.0).len(), 6);
        let range = |axis: WaterfallAxis| axis.range.map(f64::to_bits);
        assert_eq!(range(WaterfallAxis::over("", [7.0].into_iter())), [3.5_f64, 10.5].map(f64::to_bits));
        assert_eq!(range(WaterfallAxis::over("", std::iter::empty())), [0.0_f64, 1.0].map(f64::to_bits));
        let places = [axis(0.0, 4.0), axis(0.0, 4.0).reversed()].map(|axis| axis.share(1.0).to_bits());
        assert_eq!(places, [0.25_f64, 0.75].map(f64::to_bits));
    }
}
