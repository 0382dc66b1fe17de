//! Parameter draws, for where a linearisation is not to be trusted.

use nalgebra::DMatrix;
use num_complex::Complex64;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{ChiSquared, Distribution, StandardNormal};
use rayon::prelude::*;

use super::covariance_error::CovarianceError;
use super::delta_method::Path;
use super::parameters::{ParameterCovariance, ParameterLayout};
use crate::linalg::{eigen, multiply, multiply_tn, svd_thin, symmetric_square_root_factor};
use crate::model::StateSpace;

/// Directions of `theta` whose tangent is this small against the largest are no change of basis.
const TANGENT_RANK: f64 = 1e-10;

/// Models drawn from `N(theta, Cov)`; from the multivariate Student law when the covariance was itself
/// estimated with few degrees of freedom. The same seed gives the same models, whatever the number of
/// threads.
///
/// A covariance in a fixed basis has parts that only change the basis, to first order: along
/// `[X A - A X; X B; X K; -C X; 0]` for any `X`. They do not move any invariant, but a finite step along
/// such a tangent leaves the set of equivalent models. So every step is projected on the orthogonal
/// complement first, which are the data-driven local coordinates of McKelvey, Helmersson & Ribarits
/// (Automatica 40, 2004); invariants keep their covariance.
///
/// # Errors
/// [`CovarianceError::Layout`] or [`CovarianceError::Size`] for the covariance of another model,
/// [`CovarianceError::Linalg`] when a factorisation fails.
pub(crate) fn draw_parameters(
    system: &StateSpace,
    covariance: &ParameterCovariance,
    count: usize,
    seed: u64,
) -> Result<Vec<StateSpace>, CovarianceError> {
    covariance.check(system)?;
    let layout = &covariance.layout;
    if layout.is_empty() {
        return Ok(vec![system.clone(); count]);
    }
    let mut factor = symmetric_square_root_factor(&covariance.matrix)?;
    if layout.states > 0 {
        let svd = svd_thin(&basis_tangent(system, layout))?;
        let smallest = TANGENT_RANK * svd.values.max();
        let rank = svd.values.iter().filter(|&&v| v > smallest).count();
        let tangent = svd.u.columns(0, rank).into_owned();
        factor -= multiply(&tangent, &multiply_tn(&tangent, &factor));
    }
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    let spread = covariance
        .degrees_of_freedom
        .filter(|nu| nu.is_finite())
        .and_then(|nu| Some((nu, ChiSquared::new(nu).ok()?)));
    let mut normal = DMatrix::zeros(layout.len(), count);
    for mut column in normal.column_iter_mut() {
        for value in column.iter_mut() {
            *value = StandardNormal.sample(&mut generator);
        }
        if let Some((nu, chi_squared)) = &spread {
            let scale: f64 = (nu / chi_squared.sample(&mut generator)).sqrt();
            column *= scale;
        }
    }
    let steps = multiply(&factor, &normal);
    let theta = layout.pack(system);
    Ok(steps
        .column_iter()
        .map(|step| {
            let moved: Vec<f64> = theta.iter().zip(step.iter()).map(|(t, s)| t + s).collect();
            layout.unpack(&moved, system)
        })
        .collect())
}

/// First-order effect on `theta` of the change of basis `I + X`, a column for each entry of `X`.
fn basis_tangent(system: &StateSpace, layout: &ParameterLayout) -> DMatrix<f64> {
    let n = layout.states;
    let mut tangent = DMatrix::zeros(layout.len(), n * n);
    for i in 0..n {
        for j in 0..n {
            // X has a one at (i, j): X M is row j of M in row i, M X is column i of M in column j.
            let mut x = DMatrix::zeros(n, n);
            x[(i, j)] = 1.0;
            let moved = StateSpace {
                a: &x * &system.a - &system.a * &x,
                b: &x * &system.b,
                k: &x * &system.k,
                c: -(&system.c * &x),
                d: DMatrix::zeros(system.outputs(), system.inputs()),
                sample_time: system.sample_time,
            };
            let column = layout.pack(&moved);
            tangent.column_mut(j * n + i).copy_from_slice(&column);
        }
    }
    tangent
}

/// A drawn model prepared for many frequencies.
enum Drawn {
    /// `C V`, `V^-1 B`, `V^-1 K` and the eigenvalues: a response costs `n l r` operations.
    Modal {
        values: Vec<Complex64>,
        output: DMatrix<Complex64>,
        input: DMatrix<Complex64>,
        noise: DMatrix<Complex64>,
        direct: DMatrix<f64>,
    },
    /// A draw with a defective state matrix.
    Direct(StateSpace),
}

impl Drawn {
    fn new(system: StateSpace) -> Self {
        let Ok(decomposition) = eigen(&system.a) else {
            return Self::Direct(system);
        };
        let complex = |m: &DMatrix<f64>| m.map(|v| Complex64::new(v, 0.0));
        Self::Modal {
            output: complex(&system.c) * &decomposition.right,
            input: &decomposition.left * complex(&system.b),
            noise: &decomposition.left * complex(&system.k),
            values: decomposition.values,
            direct: system.d,
        }
    }

    fn response(&self, sample_time: f64, w_rad_s: f64, path: Path) -> DMatrix<Complex64> {
        let (values, output, source, direct) = match (self, path) {
            (Self::Direct(system), _) => return path.response(system, w_rad_s),
            (
                Self::Modal {
                    values,
                    output,
                    input,
                    direct,
                    ..
                },
                Path::Input,
            ) => (values, output, input, Some(direct)),
            (
                Self::Modal {
                    values,
                    output,
                    noise,
                    ..
                },
                Path::Innovation,
            ) => (values, output, noise, None),
        };
        let z = Complex64::from_polar(1.0, w_rad_s * sample_time);
        let gains: Vec<Complex64> = values.iter().map(|value| (z - value).inv()).collect();
        DMatrix::from_fn(output.nrows(), source.ncols(), |o, i| {
            let direct = direct.map_or_else(|| f64::from(o == i), |d| d[(o, i)]);
            let modes = gains
                .iter()
                .enumerate()
                .map(|(k, gain)| output[(o, k)] * source[(k, i)] * gain)
                .sum::<Complex64>();
            modes + direct
        })
    }
}

/// Drawn models with fast frequency responses.
pub(crate) struct ResponseDraws {
    drawn: Vec<Drawn>,
    sample_time: f64,
}

impl ResponseDraws {
    /// Draws as [`draw_parameters`].
    pub(crate) fn new(
        system: &StateSpace,
        covariance: &ParameterCovariance,
        count: usize,
        seed: u64,
    ) -> Result<Self, CovarianceError> {
        let systems = draw_parameters(system, covariance, count, seed)?;
        Ok(Self {
            // Order is kept, so the result does not depend on the threads.
            drawn: systems.into_par_iter().map(Drawn::new).collect(),
            sample_time: system.sample_time,
        })
    }

    /// The response of every draw at a frequency in rad/s.
    pub(crate) fn responses(&self, w_rad_s: f64, path: Path) -> Vec<DMatrix<Complex64>> {
        self.drawn
            .iter()
            .map(|drawn| drawn.response(self.sample_time, w_rad_s, path))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::delta_method::path_covariance;
    use crate::covariance::test_covariances;

    #[test]
    fn same_seed_same_draws_whatever_the_threads() {
        let (system, covariance) = test_covariances::two_by_three(false);
        let run = |threads: usize| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap()
                .install(|| {
                    ResponseDraws::new(&system, &covariance, 20, 7)
                        .unwrap()
                        .responses(1.0, Path::Input)
                })
        };
        assert_eq!(run(1), run(3));
        let other = draw_parameters(&system, &covariance, 1, 8).unwrap();
        assert_ne!(other, draw_parameters(&system, &covariance, 1, 7).unwrap());
    }

    #[test]
    fn modal_responses_equal_direct_ones() {
        let (system, covariance) = test_covariances::two_by_three(true);
        let draws = ResponseDraws::new(&system, &covariance, 5, 1).unwrap();
        let systems = draw_parameters(&system, &covariance, 5, 1).unwrap();
        for path in [Path::Input, Path::Innovation] {
            for (modal, system) in draws.responses(2.0, path).iter().zip(&systems) {
                assert!((modal - path.response(system, 2.0)).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn a_step_along_the_tangent_leaves_the_responses_alone() {
        let (system, covariance) = test_covariances::two_by_three(true);
        let layout = covariance.layout;
        let tangent = basis_tangent(&system, &layout);
        let theta = layout.pack(&system);
        for column in tangent.column_iter() {
            let moved: Vec<f64> = theta
                .iter()
                .zip(column.iter())
                .map(|(t, s)| t + 1e-6 * s)
                .collect();
            let change = layout.unpack(&moved, &system).frequency_response(1.0)
                - system.frequency_response(1.0);
            assert!(change.norm() < 1e-10, "{change}");
        }
    }

    #[test]
    fn spread_of_the_draws_is_the_linear_covariance() {
        let (system, mut covariance) = test_covariances::two_by_three(true);
        for nu in [None, Some(12.0)] {
            covariance.degrees_of_freedom = nu;
            let expected = path_covariance(&system, &covariance, 1.0, Path::Input).unwrap();
            // Variance of the Student law: nu / (nu - 2).
            let heavier = nu.map_or(1.0, |nu| nu / (nu - 2.0));
            let draws = ResponseDraws::new(&system, &covariance, 4000, 3).unwrap();
            let centre = system.frequency_response(1.0);
            let responses = draws.responses(1.0, Path::Input);
            for o in 0..3 {
                for i in 0..2 {
                    let mean = responses
                        .iter()
                        .map(|g| (g[(o, i)] - centre[(o, i)]).norm_sqr())
                        .sum::<f64>()
                        / 4000.0;
                    let linear = (expected[(o, i)][0][0] + expected[(o, i)][1][1]) * heavier;
                    assert!(
                        (mean / linear - 1.0).abs() < 0.12,
                        "{nu:?} {}",
                        mean / linear
                    );
                }
            }
        }
    }
}
