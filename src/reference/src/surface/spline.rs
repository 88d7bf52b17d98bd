//! Closest point on a bicubic uniform B-spline (eqs 6 and 7).

use super::{SplineSurface, SurfaceFoot, add_scaled, cross, dot, minus, scaled, unit};

/// Returns the cubic basis on one segment, x from 0 to 1: values, first and second derivatives.
fn basis(x: f64) -> [[f64; 4]; 3] {
    let y = 1.0 - x;
    [
        [y * y * y, 3.0 * x * x * x - 6.0 * x * x + 4.0, 3.0 * y * y * y - 6.0 * y * y + 4.0, x * x * x]
            .map(|b| b / 6.0),
        [-0.5 * y * y, 1.5 * x * x - 2.0 * x, -1.5 * y * y + 2.0 * y, 0.5 * x * x],
        [y, 3.0 * x - 2.0, 3.0 * y - 2.0, x],
    ]
}

/// Weights of the control points along one direction, derivative by derivative; points outside the grid are
/// eliminated by Q_{−1} = 2 Q₀ − Q₁.
struct LineWeights {
    first: usize,
    weights: [[f64; 4]; 3],
}

impl LineWeights {
    fn at(parameter: f64, count: usize) -> Self {
        let mut segment = 0;
        while segment + 2 < count && parameter >= (segment + 1) as f64 {
            segment += 1;
        }
        let raw = basis(parameter - segment as f64);
        if segment == 0 {
            let fold = |b: [f64; 4]| [b[1] + 2.0 * b[0], b[2] - b[0], b[3], 0.0];
            return Self { first: 0, weights: raw.map(fold) };
        }
        if segment + 2 == count {
            let fold = |b: [f64; 4]| [0.0, b[0], b[1] - b[3], b[2] + 2.0 * b[3]];
            return Self { first: count - 4, weights: raw.map(fold) };
        }
        Self { first: segment - 1, weights: raw }
    }
}

struct SurfaceTerm {
    /// S, S_s, S_t, S_ss, S_st, S_tt.
    jets: [[f64; 3]; 6],
    lines: [LineWeights; 2],
}

const JETS: [(usize, usize); 6] = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)];

fn evaluate(surface: &SplineSurface, carriers: &[[f64; 3]], [s, t]: [f64; 2]) -> SurfaceTerm {
    let lines = [LineWeights::at(s, surface.rows), LineWeights::at(t, surface.columns)];
    let mut jets = [[0.0; 3]; 6];
    for a in 0..4 {
        for b in 0..4 {
            let control = carriers[(lines[0].first + a) * surface.columns + lines[1].first + b];
            for (jet, (i, j)) in jets.iter_mut().zip(JETS) {
                add_scaled(jet, control, lines[0].weights[i][a] * lines[1].weights[j][b]);
            }
        }
    }
    SurfaceTerm { jets, lines }
}

/// Solves (x − S)·S_s = (x − S)·S_t = 0 by Newton's method.
pub(super) fn foot(
    surface: &SplineSurface,
    point: [f64; 3],
    carriers: &[[f64; 3]],
    guess: [f64; 2],
) -> Option<SurfaceFoot> {
    let ends = [(surface.rows - 1) as f64, (surface.columns - 1) as f64];
    let mut at = guess;
    for _ in 0..30 {
        if (0..2).any(|i| !(at[i] > -0.5 && at[i] < ends[i] + 0.5)) {
            return None;
        }
        let found = evaluate(surface, carriers, at);
        let [position, s, t, ss, st, tt] = found.jets;
        let away = minus(point, position);
        let (f, g) = (dot(away, s), dot(away, t));
        let (a, b, c) = (dot(s, s) - dot(away, ss), dot(s, t) - dot(away, st), dot(t, t) - dot(away, tt));
        let determinant = a * c - b * b;
        let move_by = [(c * f - b * g) / determinant, (a * g - b * f) / determinant];
        at = [at[0] + move_by[0], at[1] + move_by[1]];
        if move_by[0].abs().max(move_by[1].abs()) < 1e-13 {
            break;
        }
    }
    // A foot beyond a free edge is invalid, except for rounding.
    (0..2).all(|i| at[i] >= -1e-9 && at[i] <= ends[i] + 1e-9).then(|| {
        let found = evaluate(surface, carriers, at);
        let normal = scaled(unit(cross(found.jets[1], found.jets[2])), surface.orientation);
        let mut weights = Vec::with_capacity(16);
        for a in 0..4 {
            for b in 0..4 {
                let carrier = (found.lines[0].first + a) * surface.columns + found.lines[1].first + b;
                weights.push((carrier, found.lines[0].weights[0][a] * found.lines[1].weights[0][b]));
            }
        }
        SurfaceFoot { normal, gap: dot(minus(point, found.jets[0]), normal), weights }
    })
}
