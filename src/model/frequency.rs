//! Frequency responses.

use std::f64::consts::PI;

use nalgebra::DMatrix;
use num_complex::Complex64;

use super::model_error::ModelError;
use super::state_space::StateSpace;

/// Largest number of decades below the Nyquist frequency on the default grid.
const MOST_DECADES: f64 = 4.0;

/// The resolvent times what stands beside it, at one point `z`: `left = C (zI - A)^-1` (`l x n`) and
/// `right = (zI - A)^-1 M` (`n x m`). Entries are NaN where `z` is an eigenvalue of `A`.
#[derive(Debug, Clone)]
pub(crate) struct ResolventProducts {
    /// `C (zI - A)^-1`.
    pub(crate) left: DMatrix<Complex64>,
    /// `(zI - A)^-1 M`.
    pub(crate) right: DMatrix<Complex64>,
}

/// Both products at `z` for the input matrix `m` (`B` or `K`).
pub(crate) fn resolvent_products(
    system: &StateSpace,
    m: &DMatrix<f64>,
    z: Complex64,
) -> ResolventProducts {
    let (n, l) = (system.states(), system.outputs());
    let nan = Complex64::new(f64::NAN, f64::NAN);
    if n == 0 {
        return ResolventProducts {
            left: DMatrix::zeros(l, 0),
            right: DMatrix::zeros(0, m.ncols()),
        };
    }
    let factor = shifted(&system.a, z).lu();
    let right = factor.solve(&complexify(m));
    let left = shifted(&system.a.transpose(), z)
        .lu()
        .solve(&complexify(&system.c.transpose()));
    ResolventProducts {
        left: left.map_or_else(|| DMatrix::from_element(l, n, nan), |x| x.transpose()),
        right: right.unwrap_or_else(|| DMatrix::from_element(n, m.ncols(), nan)),
    }
}

/// `zI - A`.
fn shifted(a: &DMatrix<f64>, z: Complex64) -> DMatrix<Complex64> {
    let mut shifted = a.map(|v| Complex64::new(-v, 0.0));
    for i in 0..a.nrows() {
        shifted[(i, i)] += z;
    }
    shifted
}

fn complexify(matrix: &DMatrix<f64>) -> DMatrix<Complex64> {
    matrix.map(|v| Complex64::new(v, 0.0))
}

impl StateSpace {
    /// The point on the unit circle that belongs to a frequency in rad/s, `exp(j w Ts)`.
    pub fn unit_circle(&self, w_rad_s: f64) -> Complex64 {
        Complex64::from_polar(1.0, w_rad_s * self.sample_time)
    }

    /// Response from input to output, `G = C (zI - A)^-1 B + D` at `z = exp(j w Ts)` (`l x r`); `w` in
    /// rad/s. Entries are NaN where `z` is a pole exactly.
    pub fn frequency_response(&self, w_rad_s: f64) -> DMatrix<Complex64> {
        self.transfer(&self.b, &self.d, self.unit_circle(w_rad_s))
    }

    /// Response from innovation to output, `H = C (zI - A)^-1 K + I` at `z = exp(j w Ts)` (`l x l`); `w`
    /// in rad/s. Entries are NaN where `z` is a pole exactly.
    pub fn noise_response(&self, w_rad_s: f64) -> DMatrix<Complex64> {
        let identity = DMatrix::identity(self.outputs(), self.outputs());
        self.transfer(&self.k, &identity, self.unit_circle(w_rad_s))
    }

    fn transfer(
        &self,
        m: &DMatrix<f64>,
        direct: &DMatrix<f64>,
        z: Complex64,
    ) -> DMatrix<Complex64> {
        let direct = complexify(direct);
        if self.states() == 0 {
            return direct;
        }
        match shifted(&self.a, z).lu().solve(&complexify(m)) {
            Some(right) => complexify(&self.c) * right + direct,
            None => direct.map(|_| Complex64::new(f64::NAN, f64::NAN)),
        }
    }

    /// Nyquist frequency in rad/s, `pi / Ts`.
    pub fn nyquist(&self) -> f64 {
        PI / self.sample_time
    }

    /// Logarithmic grid of `points` frequencies in rad/s that ends at the Nyquist frequency.
    ///
    /// It starts a decade below the corner of the slowest pole, `1 / T` for a real pole of time constant
    /// `T` and the natural frequency for a pair, but at least one and at most four decades below Nyquist;
    /// integrators have no corner and are left out, and two decades are shown when nothing else is there.
    ///
    /// # Errors
    /// [`ModelError::Linalg`] when the poles cannot be computed.
    pub fn default_frequencies(&self, points: usize) -> Result<Vec<f64>, ModelError> {
        let nyquist = self.nyquist();
        let slowest = self
            .poles()?
            .iter()
            .filter(|pole| pole.damping.is_some() && pole.natural_frequency > 0.0)
            .map(|pole| pole.natural_frequency)
            .fold(f64::INFINITY, f64::min);
        let decades = if slowest.is_finite() {
            (nyquist / slowest).log10() + 1.0
        } else {
            2.0
        }
        .clamp(1.0, MOST_DECADES);
        Ok((0..points)
            .map(|i| {
                let below = (points - 1 - i) as f64 / (points - 1).max(1) as f64;
                nyquist * 10.0_f64.powf(-decades * below)
            })
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    fn first_order(pole: f64, sample_time: f64) -> StateSpace {
        StateSpace::new(
            dmatrix![pole],
            dmatrix![1.0],
            dmatrix![1.0],
            dmatrix![0.25],
            dmatrix![0.4],
            sample_time,
        )
        .unwrap()
    }

    #[test]
    fn first_order_closed_form() {
        let s = first_order(0.8, 0.1);
        for w in [0.0, 0.7, 5.0, s.nyquist()] {
            let z = Complex64::from_polar(1.0, w * 0.1);
            let g = Complex64::new(1.0, 0.0) / (z - 0.8) + 0.25;
            let h = Complex64::new(0.4, 0.0) / (z - 0.8) + 1.0;
            assert!((s.frequency_response(w)[(0, 0)] - g).norm() < 1e-14);
            assert!((s.noise_response(w)[(0, 0)] - h).norm() < 1e-14);
        }
    }

    #[test]
    fn response_is_the_transform_of_the_markov_parameters() {
        let s = StateSpace::deterministic(
            dmatrix![0.5, 0.3; -0.3, 0.4],
            dmatrix![1.0, 0.0; 0.5, 1.0],
            dmatrix![1.0, 2.0],
            dmatrix![0.0, 0.5],
            0.2,
        )
        .unwrap();
        let w = 3.0;
        let z = s.unit_circle(w);
        let mut sum = s.d.map(|v| Complex64::new(v, 0.0));
        let mut state = s.b.clone();
        for k in 1..200 {
            sum += (&s.c * &state).map(|v| z.powi(-k) * v);
            state = &s.a * state;
        }
        assert!((sum - s.frequency_response(w)).norm() < 1e-12);
        let products = resolvent_products(&s, &s.b, z);
        let direct = complexify(&s.c) * &products.right;
        assert!((&products.left * complexify(&s.b) - direct).norm() < 1e-13);
    }

    #[test]
    fn a_pole_on_the_grid_gives_no_number() {
        let s = first_order(1.0, 1.0);
        assert!(s.frequency_response(0.0)[(0, 0)].re.is_nan());
        assert!(
            resolvent_products(&s, &s.b, Complex64::new(1.0, 0.0)).left[(0, 0)]
                .re
                .is_nan()
        );
    }

    #[test]
    fn grid_spans_the_dynamics_and_ends_at_nyquist() {
        let s = first_order(0.99, 0.01);
        let grid = s.default_frequencies(50).unwrap();
        assert_eq!(grid.len(), 50);
        approx::assert_relative_eq!(grid[49], PI / 0.01, epsilon = 1e-9);
        // The corner is at -ln(0.99) / 0.01 = 1.005 rad/s; the grid starts a decade below.
        approx::assert_relative_eq!(grid[0], 0.1005, max_relative = 1e-3);
        let slow = first_order(1.0 - 1e-7, 1.0).default_frequencies(9).unwrap();
        approx::assert_relative_eq!(slow[0], PI * 1e-4, max_relative = 1e-9);
        let integrator = first_order(1.0, 1.0).default_frequencies(2).unwrap();
        approx::assert_relative_eq!(integrator[0], PI * 1e-2, max_relative = 1e-9);
        assert!(s.default_frequencies(0).unwrap().is_empty());
        assert_eq!(s.default_frequencies(1).unwrap(), [s.nyquist()]);
    }
}
