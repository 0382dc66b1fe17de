//! Backward elimination: coefficients that are of no consequence are dropped one by one, and the others follow.

use nalgebra::{DMatrix, DVector};

/// Keeps a matrix of dependent columns of unit length invertible.
const RIDGE: f64 = 1e-13;

/// Coefficients that are left, with their values, where those of least consequence become zero as long as the sum of squares
/// grows by no more than `allowed`. `information` is the Gram matrix of the columns, of unit length; only what `may_go` is
/// dropped. None where the columns are dependent.
pub(super) fn eliminate(
    information: &DMatrix<f64>,
    values: &[f64],
    allowed: f64,
    may_go: impl Fn(usize) -> bool,
) -> Option<Vec<(usize, f64)>> {
    let mut value = DVector::from_column_slice(values);
    let mut active: Vec<usize> = (0..values.len()).collect();
    let mut spent = 0.0;
    let all = information + DMatrix::identity(values.len(), values.len()) * RIDGE;
    let mut inverse = all.cholesky()?.inverse();
    loop {
        let cost = |i: usize| value[active[i]].powi(2) / inverse[(i, i)];
        let least = (0..active.len())
            .filter(|&i| may_go(active[i]))
            .min_by(|&a, &b| cost(a).total_cmp(&cost(b)));
        let Some(least) = least.filter(|&i| spent + cost(i) <= allowed) else {
            break;
        };
        spent += cost(least);
        let pivot = inverse[(least, least)];
        let column = inverse.column(least).into_owned();
        let step = value[active[least]] / pivot;
        for (i, &a) in active.iter().enumerate() {
            value[a] -= step * column[i];
        }
        inverse -= &column * column.transpose() / pivot;
        inverse = inverse.remove_row(least).remove_column(least);
        active.remove(least);
    }
    Some(active.into_iter().map(|i| (i, value[i])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_of_no_consequence_goes_and_the_others_follow() {
        // The first column is nearly the second: without it the second takes over its part.
        let information =
            DMatrix::from_row_slice(3, 3, &[1.0, 0.99, 0.0, 0.99, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let kept = eliminate(&information, &[0.1, 2.0, 0.5], 0.01, |_| true).unwrap();
        let (places, values): (Vec<usize>, Vec<f64>) = kept.into_iter().unzip();
        assert_eq!(places, [1, 2]);
        assert!((values[0] - 2.099).abs() < 1e-6 && (values[1] - 0.5).abs() < 1e-9);
        // What must stay stays, and nothing goes that costs more than is allowed.
        let all = eliminate(&information, &[0.1, 2.0, 0.5], 0.01, |i| i != 0).unwrap();
        assert_eq!(all.len(), 3);
        assert_eq!(
            eliminate(&information, &[0.1, 2.0, 0.5], 1e-6, |_| true)
                .unwrap()
                .len(),
            3
        );
    }
}
