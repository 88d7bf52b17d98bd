//! Cubic polynomials on 0 ≤ θ ≤ 1, given by their coefficients (lowest degree first).

/// Value at θ of the polynomial with these coefficients, lowest degree first.
pub fn evaluate(coefficients: &[f64; 4], theta: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * theta + coefficient)
}

/// Returns the θ in 0 < θ < 1 at which the polynomial has a minimum; up to degree 3 there is at most one.
pub(crate) fn interior_minimum(coefficients: &[f64; 4]) -> Option<f64> {
    let [_, slope, bend, twist] = *coefficients;
    // p′ = slope + 2 bend θ + 3 twist θ²; at the minimum p″ = 2√(bend² − 3 slope twist) > 0.
    let discriminant = bend * bend - 3.0 * slope * twist;
    if discriminant.is_nan() || discriminant <= 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    let theta = if bend >= 0.0 { -slope / (bend + root) } else { (root - bend) / (3.0 * twist) };
    (theta > 0.0 && theta < 1.0).then_some(theta)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interior_minimum_matches_sampled_polynomial() {
        let mut found = 0;
        for case in 0..400_u32 {
            // Straight lines and parabolas are included.
            let number = |salt: u32| f64::from((case * 7919 + salt * 104_729) % 1009) / 504.0 - 1.0;
            let part = |degree: u32| if case % 4 < degree { 0.0 } else { number(degree) };
            let cubic = [number(9), number(1), part(2), part(3)];
            let values = (0..=1000).map(|place| evaluate(&cubic, f64::from(place) * 1e-3));
            let sampled = values.fold(f64::INFINITY, f64::min);
            let minimum = interior_minimum(&cubic);
            let value = minimum.map_or(f64::INFINITY, |theta| evaluate(&cubic, theta));
            let lowest = value.min(evaluate(&cubic, 0.0)).min(evaluate(&cubic, 1.0));
            assert!(lowest < sampled + 1e-12 && lowest > sampled - 1e-5, "case {case}: {lowest}, {sampled}");
            found += u32::from(minimum.is_some());
        }
        assert!(found > 40, "{found}");
    }
}
