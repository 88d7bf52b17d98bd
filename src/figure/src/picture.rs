//! Draws the finite-element surface: orthographic projection, painter's algorithm, displacement as colour.

use std::fmt::Write as _;

use tiprub_model::{Mesh, surface_quads};

/// Surface of a mesh: faces with four corners over points (m).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshSurface {
    /// Points (x, y, z) in m, z the engine axis.
    pub points: Vec<[f64; 3]>,
    /// Faces by the indices of their corners, in order around the face.
    pub faces: Vec<[usize; 4]>,
}

/// Direction from which the observer looks.
#[derive(Debug, Clone, Copy)]
pub struct ViewPoint {
    /// Unit vector to the right in the picture.
    right: [f64; 3],
    /// Unit vector up in the picture.
    up: [f64; 3],
    /// Unit vector towards the observer.
    towards: [f64; 3],
}

/// Length of the longer edge of the picture in SVG units.
const EDGE: f64 = 400.0;

/// Anchors of the sequential colour scale, from zero to the largest value, light to dark so that it also reads in grey.
const SCALE_COLORS: [[f64; 3]; 7] = [
    [214.0, 222.0, 231.0],
    [253.0, 224.0, 178.0],
    [253.0, 190.0, 122.0],
    [250.0, 141.0, 89.0],
    [232.0, 92.0, 62.0],
    [196.0, 40.0, 36.0],
    [127.0, 10.0, 30.0],
];

/// Number of patches of constant colour along each edge of a face of a coloured surface.
const PATCHES: usize = 2;
/// Depth difference at which a surface hides a mark behind it, as a fraction of the size of the surface.
const HIDING: f64 = 1e-6;

impl ViewPoint {
    /// Creates a view of a blade that stands on the z axis: the radial direction of its centre points upwards, seen from `azimuth` (rad) around that
    /// direction (0: along the tangential direction, π/2: along the axis) and from `elevation` (rad) above.
    pub fn of_blade(surface: &MeshSurface, azimuth: f64, elevation: f64) -> Self {
        let count = surface.points.len().max(1) as f64;
        let centre = surface.points.iter().fold([0.0, 0.0], |sum, point| [sum[0] + point[0], sum[1] + point[1]]);
        let (x, y) = (centre[0] / count, centre[1] / count);
        let radius = x.hypot(y).max(f64::MIN_POSITIVE);
        let radial = [x / radius, y / radius, 0.0];
        let tangential = [-radial[1], radial[0], 0.0];
        let (sin, cos) = azimuth.sin_cos();
        let level = combine(cos, tangential, sin, [0.0, 0.0, 1.0]);
        let right = combine(-sin, tangential, cos, [0.0, 0.0, 1.0]);
        let (sin, cos) = elevation.sin_cos();
        Self { right, up: combine(cos, radial, -sin, level), towards: combine(cos, level, sin, radial) }
    }

    fn project(&self, point: [f64; 3]) -> [f64; 3] {
        [dot(self.right, point), dot(self.up, point), dot(self.towards, point)]
    }
}

/// Draws the surface, displaced by `scale · displacement` and coloured by |displacement| (0 to its own maximum), as an SVG element. Without
/// displacement it is plain grey with the lines of the mesh. `marks` (the contact nodes) are drawn as dots, or as circles if the surface hides them.
pub fn draw(
    surface: &MeshSurface,
    displacement: Option<(&[[f64; 3]], f64)>,
    marks: &[[f64; 3]],
    frame: &ProjectionFrame,
    view: &ViewPoint,
) -> String {
    let magnitudes: Vec<f64> = match displacement {
        Some((vectors, _)) => vectors.iter().map(|vector| dot(*vector, *vector).sqrt()).collect(),
        None => vec![0.0; surface.points.len()],
    };
    let largest = magnitudes.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let moved: Vec<[f64; 3]> = match displacement {
        Some((vectors, scale)) => {
            surface.points.iter().zip(vectors).map(|(point, vector)| combine(1.0, *point, scale, *vector)).collect()
        }
        None => surface.points.clone(),
    };
    let pieces = if displacement.is_some() { PATCHES } else { 1 };
    let mut patches = Vec::new();
    for face in &surface.faces {
        let corners = face.map(|index| moved[index]);
        let facing = normal(&corners);
        // Faces turned away are hidden by the rest of a closed surface.
        if dot(facing, view.towards) > 0.0 {
            let shade = brightness(facing, view);
            subdivide(&corners, face.map(|index| magnitudes[index] / largest), shade, view, pieces, &mut patches);
        }
    }
    patches.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let mut svg = frame.open();
    for patch in &patches {
        let base = if displacement.is_some() { scale_color(patch.share) } else { [198.0, 205.0, 214.0] };
        let color = hex(base.map(|channel| channel * patch.shade));
        // Mesh lines belong to the faces, so that nearer faces cover the lines of farther ones.
        let line = if displacement.is_some() { &color } else { MESH_LINE };
        let [a, b, c, d] = patch.corners.map(|corner| frame.place(corner));
        let _ = write!(
            svg,
            r##"<path d="M{} {}L{} {}L{} {}L{} {}Z" fill="{color}" stroke="{line}"/>"##,
            a.0, a.1, b.0, b.1, c.0, c.1, d.0, d.1
        );
    }
    let places: Vec<[f64; 3]> = marks.iter().map(|mark| view.project(*mark)).collect();
    draw_marks(&mut svg, &places, &patches, frame);
    svg.push_str("</svg>");
    svg
}

/// Colour of the lines of a mesh.
const MESH_LINE: &str = "#6c7784";

fn draw_marks(svg: &mut String, places: &[[f64; 3]], patches: &[FacePatch], frame: &ProjectionFrame) {
    let margin = HIDING * EDGE / frame.magnification;
    for place in places {
        let (x, y) = frame.place(*place);
        let hidden = patches.iter().any(|patch| patch.depth_at(*place).is_some_and(|depth| depth > place[2] + margin));
        let style = if hidden { r##"fill="none" stroke="#c7254e""## } else { r##"fill="#c7254e" stroke="#fff""## };
        let _ = write!(svg, r#"<circle cx="{x}" cy="{y}" r="5" {style} stroke-width="1.5"/>"#);
    }
}

/// Mapping from projected points to positions in a picture, the same for all pictures of one surface.
#[derive(Debug, Clone, Copy)]
pub struct ProjectionFrame {
    left: f64,
    top: f64,
    /// SVG units per metre.
    magnification: f64,
    width: f64,
    height: f64,
}

impl ProjectionFrame {
    /// Creates a frame for the surface with `margin` (fraction of its size) on every side, for displaced shapes.
    pub fn around(surface: &MeshSurface, view: &ViewPoint, margin: f64) -> Self {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for point in &surface.points {
            let projected = view.project(*point);
            for axis in 0..2 {
                low[axis] = low[axis].min(projected[axis]);
                high[axis] = high[axis].max(projected[axis]);
            }
        }
        if surface.points.is_empty() {
            (low, high) = ([0.0; 2], [1.0; 2]);
        }
        let size = (high[0] - low[0]).max(high[1] - low[1]).max(f64::MIN_POSITIVE);
        let border = margin * size;
        let magnification = EDGE / (size + 2.0 * border);
        Self {
            left: low[0] - border,
            top: high[1] + border,
            magnification,
            width: (high[0] - low[0] + 2.0 * border) * magnification,
            height: (high[1] - low[1] + 2.0 * border) * magnification,
        }
    }

    fn open(&self) -> String {
        format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {:.0} {:.0}" stroke-width="0.8" stroke-linejoin="round">"##,
            self.width, self.height
        )
    }

    /// Returns SVG coordinates, rounded to a tenth of a unit.
    fn place(&self, projected: [f64; 3]) -> (f64, f64) {
        let tenth = |value: f64| (value * 10.0).round() / 10.0;
        (tenth((projected[0] - self.left) * self.magnification), tenth((self.top - projected[1]) * self.magnification))
    }
}

/// Draws a horizontal colour scale from 0 to the maximum, with end labels.
pub fn color_scale(low: &str, high: &str) -> String {
    let mut svg = String::from(
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 30" font-family="sans-serif" font-size="14" fill="#343a42">"##,
    );
    for step in 0..50_u32 {
        let color = hex(scale_color((f64::from(step) + 0.5) / 50.0));
        let _ = write!(svg, r##"<rect x="{}" y="8" width="4.2" height="14" fill="{color}"/>"##, 100 + 4 * step);
    }
    let _ =
        write!(svg, r##"<text x="92" y="20" text-anchor="end">{low}</text><text x="308" y="20">{high}</text></svg>"##);
    svg
}

/// Part of a face, ready to be drawn.
struct FacePatch {
    /// Projected corners.
    corners: [[f64; 3]; 4],
    /// Distance towards the observer.
    depth: f64,
    /// Displacement as a fraction of the largest.
    share: f64,
    /// Brightness from the illumination.
    shade: f64,
}

impl FacePatch {
    /// Returns the distance towards the observer where a projected point lies on the patch, which is treated as two triangles.
    fn depth_at(&self, point: [f64; 3]) -> Option<f64> {
        let [a, b, c, d] = self.corners;
        [[a, b, c], [a, c, d]].into_iter().find_map(|[a, b, c]| {
            let area =
                |p: [f64; 3], q: [f64; 3], r: [f64; 3]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
            let whole = area(a, b, c);
            let shares = [area(point, b, c), area(a, point, c), area(a, b, point)].map(|part| part / whole);
            let inside = shares.iter().all(|share| *share >= 0.0);
            inside.then(|| shares[0] * a[2] + shares[1] * b[2] + shares[2] * c[2])
        })
    }
}

/// Divides a face into `pieces` by `pieces` patches by bilinear interpolation of corners and displacements.
fn subdivide(
    corners: &[[f64; 3]; 4],
    shares: [f64; 4],
    shade: f64,
    view: &ViewPoint,
    pieces: usize,
    patches: &mut Vec<FacePatch>,
) {
    let weights = |u: f64, v: f64| [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v];
    let point = |u: f64, v: f64| {
        let weights = weights(u, v);
        view.project(std::array::from_fn(|axis| (0..4).map(|corner| weights[corner] * corners[corner][axis]).sum()))
    };
    let step = 1.0 / pieces as f64;
    for (row, column) in (0..pieces).flat_map(|row| (0..pieces).map(move |column| (row, column))) {
        let (u, v) = (row as f64 * step, column as f64 * step);
        let middle = weights(u + 0.5 * step, v + 0.5 * step);
        patches.push(FacePatch {
            corners: [point(u, v), point(u + step, v), point(u + step, v + step), point(u, v + step)],
            depth: point(u + 0.5 * step, v + 0.5 * step)[2],
            share: (0..4).map(|corner| middle[corner] * shares[corner]).sum(),
            shade,
        });
    }
}

/// Returns the unit normal of a face, computed from its diagonals.
fn normal([a, b, c, d]: &[[f64; 3]; 4]) -> [f64; 3] {
    let normal = cross(combine(1.0, *c, -1.0, *a), combine(1.0, *d, -1.0, *b));
    let length = dot(normal, normal).sqrt().max(f64::MIN_POSITIVE);
    normal.map(|component| component / length)
}

fn brightness(normal: [f64; 3], view: &ViewPoint) -> f64 {
    // A light behind the observer's left shoulder.
    let light = combine(0.82, view.towards, 1.0, combine(-0.42, view.right, 0.38, view.up));
    0.62 + 0.38 * dot(normal, light).clamp(0.0, 1.0)
}

fn scale_color(share: f64) -> [f64; 3] {
    let last = SCALE_COLORS.len() - 1;
    let place = share.clamp(0.0, 1.0) * last as f64;
    let index = (1..last).rev().find(|index| place >= *index as f64).unwrap_or(0);
    let fraction = place - index as f64;
    std::array::from_fn(|channel| {
        SCALE_COLORS[index][channel] * (1.0 - fraction) + SCALE_COLORS[index + 1][channel] * fraction
    })
}

fn hex(color: [f64; 3]) -> String {
    let [red, green, blue] = color.map(channel);
    format!("#{red:02x}{green:02x}{blue:02x}")
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to 0..=255")]
fn channel(value: f64) -> u8 {
    value.clamp(0.0, 255.0).round() as u8
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn combine(alpha: f64, a: [f64; 3], beta: f64, b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| alpha * a[axis] + beta * b[axis])
}

/// Returns the outer surface of a mesh.
pub fn surface_of(mesh: &Mesh) -> MeshSurface {
    let corner = |face: &[usize], index: usize| face[index.min(face.len() - 1)];
    let faces = surface_quads(mesh);
    MeshSurface {
        points: mesh.nodes.clone(),
        faces: faces.iter().map(|face| std::array::from_fn(|index| corner(face, index))).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns two unit squares at x = 1 and x = 2; seen along x from far away, the nearer one is drawn last.
    fn two_squares() -> MeshSurface {
        let square = |x: f64| [[x, -0.5, 0.0], [x, 0.5, 0.0], [x, 0.5, 1.0], [x, -0.5, 1.0]];
        MeshSurface { points: [square(2.0), square(1.0)].concat(), faces: vec![[0, 1, 2, 3], [4, 5, 6, 7]] }
    }

    #[test]
    fn the_view_is_an_orthonormal_right_handed_triad() {
        let view = ViewPoint::of_blade(&two_squares(), 0.7, 0.3);
        let triad = [view.right, view.up, view.towards];
        for (i, a) in triad.iter().enumerate() {
            for (j, b) in triad.iter().enumerate() {
                assert!((dot(*a, *b) - f64::from(u8::from(i == j))).abs() < 1e-14);
            }
        }
        assert!((dot(cross(view.right, view.up), view.towards).abs() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn nearer_faces_are_drawn_last_and_inside_the_frame() {
        let surface = two_squares();
        // Seen from above: the radial direction (x) points towards the observer.
        let view = ViewPoint::of_blade(&surface, 0.0, std::f64::consts::FRAC_PI_2);
        let displacement: Vec<[f64; 3]> = (0..8).map(|index| [0.0, 0.0, f64::from(u8::from(index >= 4))]).collect();
        let frame = ProjectionFrame::around(&surface, &view, 0.1);
        let svg = draw(&surface, Some((&displacement, 0.0)), &[[1.0, 0.0, 0.5]], &frame, &view);
        let shade = brightness([1.0, 0.0, 0.0], &view);
        let color = |share: f64| hex(scale_color(share).map(|channel| channel * shade));
        let far = svg.find(&color(1.0)).expect("the displaced square is drawn");
        let near = svg.find(&color(0.0)).expect("the resting square is drawn");
        assert!(far < near, "{svg}");
        assert!(svg.contains("<circle") && svg.ends_with("</svg>"));
        let numbers = svg.split(['M', 'L', 'Z', ' ']).filter_map(|text| text.parse::<f64>().ok());
        assert!(numbers.fold(0.0, f64::max) <= EDGE);
    }

    #[test]
    fn back_faces_are_not_drawn() {
        let mut surface = two_squares();
        surface.faces[1].reverse();
        let view = ViewPoint::of_blade(&surface, 0.0, std::f64::consts::FRAC_PI_2);
        let svg = draw(&surface, None, &[], &ProjectionFrame::around(&surface, &view, 0.1), &view);
        assert_eq!(svg.matches("<path").count(), 1, "one face");
    }

    /// The near square covers the lines of the far one and a dot on it; a dot on the near square is visible.
    #[test]
    fn lines_and_marks_behind_a_face_are_hidden() {
        let surface = two_squares();
        let view = ViewPoint::of_blade(&surface, 0.0, std::f64::consts::FRAC_PI_2);
        let frame = ProjectionFrame::around(&surface, &view, 0.1);
        let (far, near, beside) = ([1.0, 0.1, 0.5], [2.0, 0.1, 0.5], [1.0, 0.7, 0.5]);
        let svg = draw(&surface, None, &[far, near, beside], &frame, &view);
        let paths: Vec<&str> = svg.split("<path ").skip(1).collect();
        assert!(paths.len() == 2 && paths.iter().all(|path| path.contains(MESH_LINE)), "each with its lines: {svg}");
        let filled: Vec<bool> =
            svg.split("<circle ").skip(1).map(|circle| circle.contains(r##"fill="#c7254e""##)).collect();
        assert_eq!(filled, [false, true, true], "{svg}");
    }

    #[test]
    fn the_colour_scale_goes_from_dark_to_light() {
        assert_eq!(hex(scale_color(0.0)), "#d6dee7");
        assert_eq!(hex(scale_color(1.0)), "#7f0a1e");
        assert_eq!(hex(scale_color(0.5)), hex(SCALE_COLORS[3]));
        let luminance = |share: f64| scale_color(share).iter().sum::<f64>();
        assert!((0..20).all(|step| luminance(f64::from(step) / 20.0) > luminance(f64::from(step + 1) / 20.0)));
    }
}
