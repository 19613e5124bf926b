//! Rank correlation: how well predictions order what was then measured.

/// Spearman's rank correlation of pairs, those of equal values sharing their mean rank; `None` if one side is constant.
pub fn rank_correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let sides = [ranks(pairs.iter().map(|p| p.0).collect()), ranks(pairs.iter().map(|p| p.1).collect())];
    let mean = (pairs.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>();
    let [x, y] = &sides;
    let spread = (product(x, x) * product(y, y)).sqrt();
    (spread > 0.0).then(|| product(x, y) / spread)
}

/// The rank of each value, from 0.
fn ranks(values: Vec<f64>) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0.0; values.len()];
    let mut first = 0;
    for equal in order.chunk_by(|&a, &b| values[a] == values[b]) {
        let rank = first as f64 + (equal.len() as f64 - 1.0) / 2.0;
        equal.iter().for_each(|&i| ranks[i] = rank);
        first += equal.len();
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_correlated_not_values() {
        let of = |values: &[f64]| {
            let pairs: Vec<_> = values.iter().enumerate().map(|(i, &v)| (i as f64, v)).collect();
            rank_correlation(&pairs)
        };
        assert_eq!(of(&[0.0, 1.0, 100.0, 101.0]), Some(1.0));
        assert_eq!(of(&[3.0, 2.0, 1.0, -90.0]), Some(-1.0));
        // 1 - 6 (1 + 1) / (4 (16 - 1)).
        assert!((of(&[0.0, 2.0, 1.0, 3.0]).unwrap() - 0.8).abs() < 1e-12);
        // Ranks 0.5, 0.5, 2, 3: 4.5 / sqrt(5 * 4.5).
        assert!((of(&[7.0, 7.0, 8.0, 9.0]).unwrap() - 0.9_f64.sqrt()).abs() < 1e-12);
        assert_eq!((of(&[1.0; 4]), of(&[]), of(&[1.0])), (None, None, None));
    }
}
