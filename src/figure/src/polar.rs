//! Polar diagrams of the clearance around a casing. The outer circle is the casing; a curve reaches it where the clearance is 0.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use crate::{axis::tick, escape, grid_map::round_values};

/// Width and height of the picture (SVG units).
const SIZE: f64 = 460.0;
/// Radius of the outer circle (SVG units).
const OUTER: f64 = 180.0;
/// Radius of the largest clearance, as a fraction of the outer circle.
const INNER: f64 = 0.35;

/// Curve of a polar diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct PolarCurve {
    /// Label in the legend.
    pub label: String,
    /// Values at the middles of equal ranges of angle, counterclockwise from 0 (to the right). The curve has a gap where a value
    /// is not finite.
    pub values: Vec<f64>,
}

/// Polar diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct Polar {
    /// Quantity with unit.
    pub label: String,
    /// Curves; the last one is filled towards the outer circle.
    pub curves: Vec<PolarCurve>,
}

impl Polar {
    /// Returns the legend and the picture as HTML.
    pub fn to_html(&self) -> String {
        let entry = |(index, curve): (usize, &PolarCurve)| {
            format!("<span><i class=\"c{}\"></i>{}</span>", self.color(index), escape(&curve.label))
        };
        let legend: String = self.curves.iter().enumerate().map(entry).collect();
        format!("<div class=\"legend\">{legend}</div><div class=\"polar\">{}</div>", self.to_svg())
    }

    /// Returns the index of the colour of a curve; the last curve has the colour of contact.
    fn color(&self, index: usize) -> usize {
        if index + 1 == self.curves.len() { 1 } else { 4 }
    }

    /// Returns the largest finite value.
    fn largest(&self) -> f64 {
        let values = self.curves.iter().flat_map(|curve| &curve.values).copied().filter(|value| value.is_finite());
        values.fold(f64::MIN_POSITIVE, f64::max)
    }

    fn to_svg(&self) -> String {
        let half = 0.5 * SIZE;
        let mut svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" class="map" viewBox="0 0 {SIZE} {SIZE}" font-family="sans-serif" font-size="13">"#
        );
        let radius = |value: f64| OUTER * (1.0 - (1.0 - INNER) * (value / self.largest()).clamp(0.0, 1.0));
        for value in round_values([0.0, self.largest()], 4.0) {
            let width = if value == 0.0 { 2.5 } else { 1.0 };
            let class = if value == 0.0 { "rule" } else { "grid" };
            let _ = write!(
                svg,
                r#"<circle class="{class}" cx="{half}" cy="{half}" r="{:.1}" stroke-width="{width}"/>"#,
                radius(value)
            );
        }
        for degrees in (0..360_u16).step_by(45) {
            let (sine, cosine) = f64::from(degrees).to_radians().sin_cos();
            let place = |radius: f64| format!("{:.1} {:.1}", half + radius * cosine, half - radius * sine);
            let (from, to) = (place(0.25 * OUTER), place(OUTER));
            let _ = write!(svg, r#"<path class="grid" d="M{from}L{to}"/>"#);
            let place = [half + (OUTER + 22.0) * cosine, half - (OUTER + 22.0) * sine + 5.0];
            text(&mut svg, place, &format!("{degrees}°"));
        }
        for (index, curve) in self.curves.iter().enumerate() {
            self.draw(&mut svg, index, curve, &radius);
        }
        for value in round_values([0.0, self.largest()], 4.0) {
            text(&mut svg, [half, half - radius(value) + 14.0], &tick(value));
        }
        text(&mut svg, [half, half + 5.0], &self.label);
        svg.push_str("</svg>");
        svg
    }

    fn draw(&self, svg: &mut String, index: usize, curve: &PolarCurve, radius: &dyn Fn(f64) -> f64) {
        let count = curve.values.len();
        let place = |position: usize, radius: f64| {
            let (sine, cosine) = (TAU * (position as f64 + 0.5) / count as f64).sin_cos();
            format!("{:.1} {:.1}", 0.5 * SIZE + radius * cosine, 0.5 * SIZE - radius * sine)
        };
        // A gap interrupts the line. The first point is also the last one.
        let mut path = String::new();
        let mut pen = 'M';
        for position in 0..=count {
            match curve.values.get(position % count.max(1)).filter(|value| value.is_finite()) {
                Some(value) => {
                    let _ = write!(path, "{pen}{}", place(position, radius(*value)));
                    pen = 'L';
                }
                None => pen = 'M',
            }
        }
        let is_last = index + 1 == self.curves.len();
        if is_last && path.matches('M').count() == 1 {
            let circle = |sweep: u8| {
                let half = 0.5 * SIZE;
                format!("M{} {half}A{OUTER} {OUTER} 0 1 {sweep} {} {half}", half + OUTER, half - OUTER)
                    + &format!("A{OUTER} {OUTER} 0 1 {sweep} {} {half}z", half + OUTER)
            };
            let _ = write!(svg, r#"<path class="area" fill-rule="evenodd" d="{path}z{}"/>"#, circle(0));
        }
        let _ = write!(svg, r#"<path class="s{}" d="{path}"/>"#, self.color(index));
    }
}

fn text(svg: &mut String, [x, y]: [f64; 2], text: &str) {
    let _ = write!(svg, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="middle">{}</text>"#, escape(text));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polar(values: Vec<f64>) -> Polar {
        let curve = |label: &str, values: Vec<f64>| PolarCurve { label: label.into(), values };
        Polar { label: "µm".into(), curves: vec![curve("<at rest>", vec![400.0; 4]), curve("smallest", values)] }
    }

    #[test]
    fn curves_reach_the_outer_circle_where_they_touch() {
        let svg = polar(vec![0.0, 400.0, 0.0, 400.0]).to_svg();
        let curve = svg.split("class=\"s1\" d=\"").nth(1).unwrap().split('"').next().unwrap();
        let radius = |point: &str| {
            let [x, y]: [f64; 2] =
                point.split(' ').map(|n| n.parse().unwrap()).collect::<Vec<f64>>().try_into().unwrap();
            (x - 0.5 * SIZE).hypot(y - 0.5 * SIZE)
        };
        let radii: Vec<f64> = curve[1..].split('L').map(radius).collect();
        assert_eq!(radii.len(), 5);
        assert!((radii[0] - OUTER).abs() < 0.1 && (radii[1] - INNER * OUTER).abs() < 0.1, "{radii:?}");
        assert!(svg.contains("class=\"area\"") && svg.contains(">µm<"));
    }

    #[test]
    fn gaps_interrupt_a_curve() {
        let html = polar(vec![0.0, f64::INFINITY, 100.0, 100.0]).to_html();
        let curve = html.split("class=\"s1\" d=\"").nth(1).unwrap().split('"').next().unwrap();
        assert_eq!(curve.matches('M').count(), 2);
        assert!(!html.contains("inf") && !html.contains("class=\"area\"") && html.contains("&lt;at rest&gt;"));
        for values in [vec![], vec![0.0; 3], vec![f64::INFINITY; 3]] {
            let html = polar(values).to_html();
            assert!(html.contains("</svg>") && !html.contains("NaN") && !html.contains("inf"), "{html}");
        }
    }
}
