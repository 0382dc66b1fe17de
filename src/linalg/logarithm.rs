//! Principal logarithm and exponential of a small matrix.

use nalgebra::DMatrix;

/// Square roots taken before the series: the ninth root halves a logarithm of norm 50 to 0.1.
const MOST_ROOTS: usize = 16;
/// Iterations of Denman and Beavers, which converge quadratically.
const MOST_ITERATIONS: usize = 40;

/// Principal logarithm of `matrix`; `None` when an eigenvalue is zero or on the negative real axis.
///
/// Inverse scaling and squaring (Higham, *Functions of Matrices*, 2008, section 11.5): square roots by the
/// product form of Denman and Beavers' iteration until the matrix is near the identity, then
/// `log M = 2 artanh((M - I)(M + I)^-1)` by its power series.
pub(crate) fn logarithm(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = matrix.nrows();
    let identity = DMatrix::identity(n, n);
    let mut root = matrix.clone();
    let mut roots = 0;
    while (&root - &identity).norm() > 0.2 {
        if roots == MOST_ROOTS {
            return None;
        }
        root = square_root(&root)?;
        roots += 1;
    }
    let x = (&root - &identity) * (&root + &identity).try_inverse()?;
    let square = &x * &x;
    let mut power = x.clone();
    let mut sum = x;
    // |x| <= 0.12: the term of order 17 is below 1e-16 relative.
    for order in (3..19).step_by(2) {
        power = &power * &square;
        sum += &power / f64::from(order);
    }
    sum *= 2.0 * f64::from(1u32 << roots);
    sum.iter().all(|v| v.is_finite()).then_some(sum)
}

fn square_root(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = matrix.nrows();
    let mut y = matrix.clone();
    let mut z = DMatrix::identity(n, n);
    for _ in 0..MOST_ITERATIONS {
        let next_y = (&y + z.clone().try_inverse()?) * 0.5;
        let next_z = (&z + y.clone().try_inverse()?) * 0.5;
        let change = (&next_y - &y).norm();
        let size = next_y.norm();
        if !size.is_finite() {
            return None;
        }
        y = next_y;
        z = next_z;
        if change <= 1e-14 * size {
            break;
        }
    }
    let error = (&y * &y - matrix).norm();
    (error <= 1e-9 * matrix.norm()).then_some(y)
}

/// Exponential of `matrix`, by scaling, a Taylor polynomial of order 18 and squaring.
pub(crate) fn exponential(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.nrows();
    let norm = matrix.norm();
    let squarings = if norm > 0.5 {
        (norm / 0.5).log2().ceil().clamp(0.0, 60.0) as i32
    } else {
        0
    };
    let scaled = matrix / 2f64.powi(squarings);
    let mut sum = DMatrix::identity(n, n);
    let mut term = DMatrix::identity(n, n);
    for order in 1..19 {
        term = &term * &scaled / f64::from(order);
        sum += &term;
    }
    for _ in 0..squarings {
        sum = &sum * &sum;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_undoes_the_exponential() {
        let a = DMatrix::from_row_slice(3, 3, &[-0.3, 2.0, 0.0, -2.0, -0.3, 0.4, 0.1, 0.0, -1.5]);
        let back = logarithm(&exponential(&a)).expect("no eigenvalue on the negative axis");
        assert!((back - a).norm() < 1e-12);
    }

    #[test]
    fn an_integrator_has_a_logarithm_and_a_negative_pole_has_none() {
        let double = DMatrix::from_row_slice(2, 2, &[1.0, 0.01, 0.0, 1.0]);
        let log = logarithm(&double).expect("a double integrator");
        assert!((log[(0, 1)] - 0.01).abs() < 1e-12 && log[(0, 0)].abs() < 1e-12);
        let negative = DMatrix::from_row_slice(2, 2, &[-0.5, 0.0, 0.0, 0.9]);
        assert!(logarithm(&negative).is_none());
    }
}
