//! Solving a few linear equations in place: the matrices of implicit steps are small, and there are very many of them.

/// Factors of a square matrix, by rows, with partial pivoting.
#[derive(Debug, Clone, Default)]
pub(super) struct Factors {
    matrix: Vec<f64>,
    pivots: Vec<usize>,
}

impl Factors {
    /// Factors the `n` by `n` matrix whose element `(i, j)` is `of(i, j)`. False when it is singular.
    pub(crate) fn factor(&mut self, n: usize, of: impl Fn(usize, usize) -> f64) -> bool {
        self.matrix.clear();
        self.matrix.extend((0..n * n).map(|at| of(at / n, at % n)));
        self.pivots.clear();
        for k in 0..n {
            let size = |i: usize| self.matrix[i * n + k].abs();
            let pivot = (k..n)
                .max_by(|&a, &b| size(a).total_cmp(&size(b)))
                .unwrap_or(k);
            if !(size(pivot) > 0.0 && size(pivot).is_finite()) {
                return false;
            }
            self.pivots.push(pivot);
            if pivot != k {
                for j in 0..n {
                    self.matrix.swap(k * n + j, pivot * n + j);
                }
            }
            for i in k + 1..n {
                let factor = self.matrix[i * n + k] / self.matrix[k * n + k];
                self.matrix[i * n + k] = factor;
                if factor != 0.0 {
                    for j in k + 1..n {
                        self.matrix[i * n + j] -= factor * self.matrix[k * n + j];
                    }
                }
            }
        }
        true
    }

    /// Solves for one right-hand side, in place.
    pub(crate) fn solve(&self, right: &mut [f64]) {
        let n = right.len();
        for (k, &pivot) in self.pivots.iter().enumerate() {
            right.swap(k, pivot);
        }
        for i in 1..n {
            for j in 0..i {
                right[i] -= self.matrix[i * n + j] * right[j];
            }
        }
        for i in (0..n).rev() {
            for j in i + 1..n {
                right[i] -= self.matrix[i * n + j] * right[j];
            }
            right[i] /= self.matrix[i * n + i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Factors;

    #[test]
    fn solutions_satisfy_their_equations() {
        for n in 1..9_usize {
            let of = |i: usize, j: usize| {
                ((7 * i + 3 * j + i * j) % 11) as f64 - 4.5 + if i == j { 0.3 } else { 0.0 }
            };
            let x: Vec<f64> = (0..n).map(|i| i as f64 - 1.5).collect();
            let mut right: Vec<f64> = (0..n)
                .map(|i| (0..n).map(|j| of(i, j) * x[j]).sum())
                .collect();
            let mut factors = Factors::default();
            assert!(factors.factor(n, of), "{n}");
            factors.solve(&mut right);
            for (found, x) in right.iter().zip(&x) {
                assert!((found - x).abs() < 1e-9, "{n}: {found} {x}");
            }
        }
        assert!(!Factors::default().factor(2, |i, _| i as f64));
        assert!(!Factors::default().factor(1, |_, _| f64::NAN));
    }
}
