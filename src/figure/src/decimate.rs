//! Shortens long series for drawing without losing peaks.

/// Returns at most `2 * buckets + 2` of the `points` (x ascending): the first, the last, and the smallest and largest value of each of `buckets`
/// equal parts, in their order. Series that are short enough are returned unchanged.
pub(crate) fn decimate(points: &[(f64, f64)], buckets: usize) -> Vec<(f64, f64)> {
    if points.len() <= 2 * buckets + 2 || buckets == 0 {
        return points.to_vec();
    }
    let inner = &points[1..points.len() - 1];
    let mut kept = vec![points[0]];
    for bucket in 0..buckets {
        let part = &inner[bucket * inner.len() / buckets..(bucket + 1) * inner.len() / buckets];
        let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let (Some(low), Some(high)) = (part.iter().min_by(by_value), part.iter().max_by(by_value)) else { continue };
        let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
        kept.push(*first);
        if first != second {
            kept.push(*second);
        }
    }
    kept.push(points[points.len() - 1]);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimation_keeps_peaks_ends_and_order() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), (f64::from(i) * 1e-3).sin())).collect();
        points[31_415].1 = 50.0;
        points[77_777].1 = -40.0;
        let short = decimate(&points, 200);
        assert!(short.len() <= 402);
        assert!(short.contains(&(31_415.0, 50.0)) && short.contains(&(77_777.0, -40.0)));
        assert_eq!((short.first(), short.last()), (points.first(), points.last()));
        assert!(short.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }

    #[test]
    fn short_series_are_untouched() {
        let points = [(0.0, 1.0), (1.0, 2.0), (2.0, 0.0)];
        assert_eq!(decimate(&points, 10), points);
        assert!(decimate(&[], 10).is_empty());
    }
}
