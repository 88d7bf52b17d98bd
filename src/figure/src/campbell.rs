//! Campbell diagrams with the response of a run: natural frequencies and engine orders over speed, and the spectrum of the run beside them.

use std::fmt::Write as _;

use crate::{axis::tick, escape, grid_map::round_values};

/// Largest speed of the axis, as a multiple of the largest speed of the run.
pub const SPEED_AXIS_FACTOR: f64 = 1.25;
/// Radius of the largest circle (SVG units).
const CIRCLE: f64 = 13.0;

/// Campbell diagram of a run at one speed, or over a range of speeds.
#[derive(Debug, Clone, PartialEq)]
pub struct Campbell {
    /// Smallest and largest speed of the run (rad/s).
    pub speeds: [f64; 2],
    /// Highest frequency (Hz).
    pub top: f64,
    /// Natural frequencies over speed: points (rad/s, Hz).
    pub modes: Vec<Vec<(f64, f64)>>,
    /// Engine orders, and whether the casing excites them.
    pub orders: Vec<(usize, bool)>,
    /// Spectrum of the run: points (Hz, amplitude), ascending.
    pub response: Vec<(f64, f64)>,
    /// Peaks of the spectrum: points (Hz, amplitude).
    pub peaks: Vec<(f64, f64)>,
    /// Quantity of the spectrum, with unit.
    pub response_label: String,
}

/// Sizes of a picture (SVG units), and the class of its element.
struct Size {
    class: &'static str,
    width: f64,
    height: f64,
    left: f64,
    font: f64,
    /// Approximate number of ticks of the speed axis.
    ticks: f64,
}

const SIZES: [Size; 2] = [
    Size { class: "wide", width: 920.0, height: 430.0, left: 72.0, font: 13.0, ticks: 7.0 },
    Size { class: "narrow", width: 340.0, height: 330.0, left: 56.0, font: 12.0, ticks: 3.0 },
];
/// Space below the diagram, for the axis (SVG units).
const BELOW: f64 = 48.0;
/// Space above the diagram (SVG units).
const ABOVE: f64 = 8.0;

impl Campbell {
    /// Returns the pictures for wide and for narrow pages as HTML.
    pub fn to_html(&self) -> String {
        SIZES.iter().map(|size| format!("<div class=\"{}\">{}</div>", size.class, self.picture(size))).collect()
    }

    fn picture(&self, size: &Size) -> String {
        let Size { width, height, left, font, .. } = size;
        let bottom = height - BELOW;
        let right = left + 0.66 * (width - left - 16.0);
        // The spectrum stands beside the diagram.
        let (start, end) = (right + 18.0, width - 12.0);
        let [slowest, fastest] = self.speeds;
        let last = if fastest > 0.0 { SPEED_AXIS_FACTOR * fastest } else { 1.0 };
        let x = |speed: f64| left + (right - left) * speed / last;
        let y = |hertz: f64| bottom - (bottom - ABOVE) * (hertz / self.top).clamp(0.0, 1.0);
        let mut svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" class="map" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="{font}">"#
        );
        for hertz in round_values([0.0, self.top], 7.0) {
            let _ =
                write!(svg, r#"<path class="grid" d="M{left} {0:.1}H{right:.1}M{start:.1} {0:.1}H{end}"/>"#, y(hertz));
            text(&mut svg, [left - 7.0, y(hertz) + 0.36 * font], "end", &tick(hertz));
        }
        for speed in round_values([0.0, last], size.ticks) {
            let _ = write!(svg, r#"<path class="rule" d="M{:.1} {bottom}v5"/>"#, x(speed));
            text(&mut svg, [x(speed), bottom + 6.0 + font], "middle", &tick(speed));
        }
        let mut labels: Vec<[f64; 2]> = Vec::new();
        for (order, is_excited) in &self.orders {
            let hertz = *order as f64 * last / std::f64::consts::TAU;
            let share = if hertz > self.top { self.top / hertz } else { 1.0 };
            let class = if *is_excited { "order excited" } else { "order" };
            let (to_x, to_y) = (x(share * last), y(share * hertz));
            let _ = write!(svg, r#"<path class="{class}" d="M{left} {bottom}L{to_x:.1} {to_y:.1}"/>"#);
            // Labels of close lines would overlap.
            let place = [to_x - 4.0, to_y + font];
            let is_free = labels.iter().all(|other| (other[0] - place[0]).hypot(other[1] - place[1]) > 1.8 * font);
            if *is_excited && is_free {
                labels.push(place);
                text(&mut svg, place, "end", &order.to_string());
            }
        }
        for mode in &self.modes {
            let mut path = String::new();
            for (speed, hertz) in mode.iter().filter(|(_, hertz)| *hertz <= self.top) {
                let pen = if path.is_empty() { 'M' } else { 'L' };
                let _ = write!(path, "{pen}{:.1} {:.1}", x(*speed), y(*hertz));
            }
            let _ = write!(svg, r#"<path class="mode" d="{path}"/>"#);
        }
        let is_varied = slowest < fastest;
        for speed in [slowest, fastest].into_iter().take(if is_varied { 2 } else { 1 }) {
            let _ = write!(svg, r#"<path class="mark" d="M{0:.1} {ABOVE}V{bottom}"/>"#, x(speed));
        }
        let largest = self.response.iter().chain(&self.peaks).map(|point| point.1).fold(f64::MIN_POSITIVE, f64::max);
        for (hertz, amplitude) in &self.peaks {
            let radius = CIRCLE * (amplitude / largest).sqrt();
            let title = format!("<title>{} Hz: {}</title>", tick(hertz.round()), tick(round3(*amplitude)));
            let _ = if is_varied {
                let ([from, to], y) = ([slowest, fastest].map(x), y(*hertz));
                write!(svg, r#"<path class="peak" d="M{from:.1} {y:.1}H{to:.1}">{title}</path>"#)
            } else {
                let (x, y) = (x(fastest), y(*hertz));
                write!(svg, r#"<circle class="peak" cx="{x:.1}" cy="{y:.1}" r="{radius:.1}">{title}</circle>"#)
            };
        }
        self.draw_spectrum(&mut svg, [start, end], bottom, &y, largest);
        text(&mut svg, [0.5 * (left + right), height - 8.0], "middle", "angular velocity (rad/s)");
        text(&mut svg, [0.5 * (start + end), height - 8.0], "middle", &self.response_label);
        let _ = write!(svg, r#"<g transform="translate({} {:.1}) rotate(-90)">"#, 1.1 * font, 0.5 * bottom);
        text(&mut svg, [0.0, 0.0], "middle", "frequency (Hz)");
        svg.push_str("</g></svg>");
        svg
    }

    fn draw_spectrum(&self, svg: &mut String, [start, end]: [f64; 2], bottom: f64, y: &dyn Fn(f64) -> f64, most: f64) {
        let x = |amplitude: f64| start + (end - start) * amplitude / most;
        let mut path = format!("M{start:.1} {bottom}");
        // Frequencies within one unit of the picture are drawn as one point with their largest amplitude.
        for own in self.response.chunk_by(|a, b| y(a.0).round().to_bits() == y(b.0).round().to_bits()) {
            if own[0].0 <= self.top {
                let largest = own.iter().map(|point| point.1).fold(0.0, f64::max);
                let _ = write!(path, "L{:.1} {:.1}", x(largest), y(own[0].0));
            }
        }
        let _ = write!(svg, r#"<path class="response" d="{path}L{start:.1} {ABOVE}"/>"#);
        for value in [0.0, most] {
            let anchor = if value == 0.0 { "start" } else { "end" };
            text(svg, [x(value), bottom + 18.0], anchor, &tick(round3(value)));
        }
    }
}

/// Rounds to three significant digits.
fn round3(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, text: &str) {
    let _ = write!(svg, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{}</text>"#, escape(text));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shows_modes_orders_and_the_response() {
        let campbell = Campbell {
            speeds: [1000.0; 2],
            top: 2000.0,
            modes: vec![vec![(0.0, 400.0), (1250.0, 500.0)], vec![(0.0, 5000.0), (1250.0, 5000.0)]],
            orders: vec![(1, false), (2, true), (40, false)],
            response: (0..400).map(|i| (f64::from(10 * i), f64::from(u8::from(i == 45)))).collect(),
            peaks: vec![(450.0, 1.0)],
            response_label: "amplitude (µm)".into(),
        };
        let html = campbell.to_html();
        assert_eq!(html.matches("<svg").count(), 2);
        assert_eq!(html.matches("class=\"order\"").count(), 4);
        assert_eq!(html.matches("class=\"order excited\"").count(), 2);
        assert!(html.contains(">2</text>") && html.contains("450 Hz: 1") && html.contains("amplitude (µm)"), "{html}");
        // A line of 40 orders leaves the picture at the top.
        assert!(!html.contains("NaN") && !html.contains(" -"), "{html}");
        assert_eq!([html.matches("class=\"mark\"").count(), html.matches("<circle").count()], [2, 2]);
        let varied = Campbell { speeds: [500.0, 1000.0], ..campbell.clone() }.to_html();
        assert_eq!([varied.matches("class=\"mark\"").count(), varied.matches("<circle").count()], [4, 0]);
        let still = Campbell { speeds: [0.0; 2], response: Vec::new(), peaks: Vec::new(), ..campbell };
        assert!(!still.to_html().contains("NaN") && !still.to_html().contains("inf"));
    }
}
