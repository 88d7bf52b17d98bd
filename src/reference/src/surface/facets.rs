//! Closest point on bilinear facets.

use super::{SplineSurface, SurfaceFoot, add_scaled, cross, dot, minus, scaled, unit};

/// Returns the foot on the nearest facet of the cell of the guess and its eight neighbours. Beyond an edge between
/// facets that is convex towards the point, the foot lies on the edge and the normal is that of the nearer facet.
pub(super) fn foot(
    surface: &SplineSurface,
    point: [f64; 3],
    carriers: &[[f64; 3]],
    guess: [f64; 2],
) -> Option<SurfaceFoot> {
    let ends = [surface.rows - 1, surface.columns - 1];
    if (0..2).any(|i| !(guess[i] >= 0.0 && guess[i] <= ends[i] as f64)) {
        return None;
    }
    let cell: [usize; 2] = core::array::from_fn(|i| (0..ends[i]).rev().find(|k| *k as f64 <= guess[i]).unwrap_or(0));
    let around = |i: usize| cell[i].saturating_sub(1)..(cell[i] + 2).min(ends[i]);
    let mut nearest: Option<(f64, SurfaceFoot)> = None;
    for row in around(0) {
        for column in around(1) {
            let (distance, foot) = on_facet(surface, point, carriers, [row, column]);
            if nearest.as_ref().is_none_or(|(best, _)| distance < *best) {
                nearest = Some((distance, foot));
            }
        }
    }
    nearest.map(|(_, foot)| foot)
}

fn on_facet(
    surface: &SplineSurface,
    point: [f64; 3],
    carriers: &[[f64; 3]],
    [row, column]: [usize; 2],
) -> (f64, SurfaceFoot) {
    let corner = |i: usize, j: usize| (row + i) * surface.columns + column + j;
    let corners = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
    let mut at = [0.5; 2];
    for _ in 0..30 {
        let (position, s, t, twist) = evaluate(&corners.map(|c| carriers[c]), at);
        let away = minus(point, position);
        let (f, g) = (dot(away, s), dot(away, t));
        let (a, b, c) = (dot(s, s), dot(s, t) - dot(away, twist), dot(t, t));
        let determinant = a * c - b * b;
        let next =
            [at[0] + (c * f - b * g) / determinant, at[1] + (a * g - b * f) / determinant].map(|x| x.clamp(0.0, 1.0));
        let moved = (next[0] - at[0]).abs().max((next[1] - at[1]).abs());
        at = next;
        if moved < 1e-13 {
            break;
        }
    }
    let (position, s, t, _) = evaluate(&corners.map(|c| carriers[c]), at);
    let normal = scaled(unit(cross(s, t)), surface.orientation);
    let away = minus(point, position);
    let [x, y] = at;
    let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
    (
        dot(away, away),
        SurfaceFoot { normal, gap: dot(away, normal), weights: corners.into_iter().zip(weights).collect() },
    )
}

/// Returns position, derivatives along s and t, and mixed derivative of a bilinear facet.
fn evaluate(corners: &[[f64; 3]; 4], [x, y]: [f64; 2]) -> ([f64; 3], [f64; 3], [f64; 3], [f64; 3]) {
    let combine = |weights: [f64; 4]| {
        let mut sum = [0.0; 3];
        corners.iter().zip(weights).for_each(|(corner, weight)| add_scaled(&mut sum, *corner, weight));
        sum
    };
    (
        combine([(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y]),
        combine([y - 1.0, 1.0 - y, -y, y]),
        combine([x - 1.0, -x, 1.0 - x, x]),
        combine([1.0, -1.0, -1.0, 1.0]),
    )
}
