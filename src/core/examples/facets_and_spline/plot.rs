//! Two panels as SVG, without a library: core depends on none.

use std::fmt::Write as _;

const WIDTH: f64 = 920.0;
const LEFT: f64 = 92.0;
const RIGHT: f64 = 12.0;
const INK: &str = "#343a42";
const GRID: &str = "#e8ebef";
const BUCKETS: usize = 540;

/// One line.
pub struct PlotLine<'a> {
    /// Legend text.
    pub label: &'a str,
    /// Stroke colour.
    pub color: &'a str,
    /// One value per x.
    pub values: &'a [f64],
}

/// One panel.
pub struct PlotPanel<'a> {
    /// Label of the vertical axis.
    pub label: &'a str,
    /// Range of the vertical axis; of the decimal logarithm where that is drawn. What lies beyond is cut off.
    pub range: [f64; 2],
    /// Distance of the grid lines.
    pub spacing: f64,
    /// Draw decimal logarithms, and of each bucket the largest value only.
    pub logarithmic: bool,
    /// Lines, drawn in this order.
    pub series: Vec<PlotLine<'a>>,
}

/// Panels above each other over a common axis in degrees, 0 to 360.
pub fn draw(angles: &[f64], panels: &[PlotPanel<'_>], title: &str) -> String {
    let (height, gap) = (230.0, 84.0);
    let total = 40.0 + (height + gap) * panels.len() as f64 - 32.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {total}\" font-family=\"sans-serif\" \
         font-size=\"14\" fill=\"{INK}\">\n<title>{title}</title>\n<rect width=\"{WIDTH}\" height=\"{total}\" fill=\"#fff\"/>\n"
    );
    for (index, panel) in panels.iter().enumerate() {
        let top = 40.0 + (height + gap) * index as f64;
        let _ = writeln!(
            svg,
            "<clipPath id=\"p{index}\"><rect x=\"{LEFT}\" y=\"{top}\" width=\"{}\" height=\"{height}\"/></clipPath>",
            WIDTH - LEFT - RIGHT
        );
        draw_axes(&mut svg, panel, top, height);
        for series in &panel.series {
            let path = path(angles, series.values, panel, top, height);
            let _ = writeln!(
                svg,
                "<path d=\"{path}\" clip-path=\"url(#p{index})\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"/>",
                series.color
            );
        }
        draw_legend(&mut svg, panel, top);
    }
    svg.push_str("</svg>\n");
    svg
}

fn x_of(angle: f64) -> f64 {
    LEFT + (WIDTH - LEFT - RIGHT) * angle / 360.0
}

fn y_of(value: f64, panel: &PlotPanel<'_>, top: f64, height: f64) -> f64 {
    let [low, high] = panel.range;
    let value = if panel.logarithmic { value.max(1e-300).log10() } else { value };
    // Far beyond the frame is far enough.
    top + height * (1.0 - ((value - low) / (high - low)).clamp(-0.1, 1.1))
}

fn draw_axes(svg: &mut String, panel: &PlotPanel<'_>, top: f64, height: f64) {
    let bottom = top + height;
    let right = WIDTH - RIGHT;
    let [low, high] = panel.range;
    let lines = ((high - low) / panel.spacing).round() as usize;
    for line in 0..=lines {
        let level = low + panel.spacing * line as f64;
        let y = bottom - height * line as f64 / lines as f64;
        let text = if panel.logarithmic { format!("1e{level}") } else { format!("{level}") };
        let _ = writeln!(svg, "<path d=\"M{LEFT} {y:.1}H{right}\" stroke=\"{GRID}\"/>");
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>", LEFT - 6.0, y + 5.0);
    }
    for angle in (0..=360).step_by(60) {
        let x = x_of(f64::from(angle));
        let _ = writeln!(svg, "<path d=\"M{x:.1} {top}V{bottom}\" stroke=\"{GRID}\"/>");
        let anchor = if angle == 360 { "end" } else { "middle" };
        let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"{anchor}\">{angle}</text>", bottom + 18.0);
    }
    let _ = writeln!(
        svg,
        "<path d=\"M{LEFT} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"{INK}\" stroke-opacity=\"0.5\"/>"
    );
    let middle = (LEFT + right) / 2.0;
    let _ = writeln!(svg, "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">rotor angle (°)</text>", bottom + 38.0);
    let y = top + height / 2.0;
    let _ = writeln!(
        svg,
        "<text transform=\"translate(20 {y}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
        panel.label
    );
}

fn draw_legend(svg: &mut String, panel: &PlotPanel<'_>, top: f64) {
    let mut x = WIDTH - RIGHT;
    for series in panel.series.iter().rev() {
        x -= 7.2 * series.label.chars().count() as f64 + 8.0;
        let y = top - 14.0;
        let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{}\">{}</text>", y + 5.0, series.label);
        let _ = writeln!(svg, "<path d=\"M{:.1} {y}h22\" stroke=\"{}\" stroke-width=\"3\"/>", x - 28.0, series.color);
        x -= 46.0;
    }
}

/// Least and largest value of each bucket in their order, so that no peak is lost.
fn path(angles: &[f64], values: &[f64], panel: &PlotPanel<'_>, top: f64, height: f64) -> String {
    let bucket = values.len().div_ceil(BUCKETS);
    let mut path = String::new();
    for (angles, values) in angles.chunks(bucket).zip(values.chunks(bucket)) {
        let by_value = |a: &usize, b: &usize| values[*a].total_cmp(&values[*b]);
        let largest = (0..values.len()).max_by(by_value).unwrap_or(0);
        let least = (0..values.len()).min_by(by_value).unwrap_or(0);
        let mut ends = vec![largest];
        if !panel.logarithmic && least != largest {
            ends.push(least);
        }
        ends.sort_unstable();
        for index in ends {
            let command = if path.is_empty() { 'M' } else { 'L' };
            let _ = write!(path, "{command}{:.1} {:.1}", x_of(angles[index]), y_of(values[index], panel, top, height));
        }
    }
    path
}
