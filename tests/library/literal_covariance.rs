//! The lean covariance against van Wingerden's own form, written out with matrices as long as the record,
//! and the sign of the beta terms (B.2), (B.4), which is wrong in print.

use innovant::identify::Weight;
use innovant::internal::identify::{
    Estimate, Varx, decompose, predictor_coefficients, system_matrices, varx,
};
use innovant::internal::identify::{subspace_covariance, subspace_jacobian};
use innovant::internal::linalg::{pseudo_inverse, symmetric_square_root_factor};
use innovant::internal::moments::RFactor;
use innovant::internal::systems::{TestSystem, van_wingerden_one};
use innovant::log::Log;
use innovant::model::StateSpace;
use nalgebra::DMatrix;

struct Problem {
    log: Log,
    past: usize,
    future: usize,
    order: usize,
    factor: RFactor,
    varx: Varx,
    estimate: Estimate,
}

fn problem(plant: &TestSystem, samples: usize, past: usize, future: usize, seed: u64) -> Problem {
    let log = plant.record(samples, seed);
    let factor = RFactor::of_samples(&log.channel_data(), log.inputs.len(), past).unwrap();
    let varx = varx(&factor, false).unwrap();
    let order = plant.system.states();
    let decomposition = decompose(&factor, &varx, future, Weight::Identity).unwrap();
    let map = decomposition.svd.state_map(order);
    let estimate = system_matrices(&factor, &varx, &decomposition, map, 1.0).unwrap();
    Problem {
        log,
        past,
        future,
        order,
        factor,
        varx,
        estimate,
    }
}

impl Problem {
    fn sample(&self, k: usize, channel: usize) -> f64 {
        let inputs = self.log.inputs.len();
        if channel < inputs {
            self.log.input_data[channel][k]
        } else {
            self.log.output_data[channel - inputs][k]
        }
    }

    fn windows(&self, from: usize) -> DMatrix<f64> {
        let q = self.factor.channels();
        DMatrix::from_fn(self.past * q, self.varx.columns, |row, k| {
            self.sample(from + k + row / q, row % q)
        })
    }

    fn block(&self, first: usize, count: usize) -> DMatrix<f64> {
        DMatrix::from_fn(count, self.varx.columns, |row, k| {
            self.sample(self.past + k, first + row)
        })
    }

    /// (40)-(41) literally, with `alpha` of Appendix B, `P` written out, and the given sign of `beta`.
    fn literal(&self, beta_sign: f64) -> DMatrix<f64> {
        let (q, l, r) = (
            self.factor.channels(),
            self.factor.outputs,
            self.factor.inputs,
        );
        let (n, f, nc) = (self.order, self.future, self.varx.columns);
        let z = self.windows(0);
        let z_next = self.windows(1);
        let u = self.block(0, r);
        let y = self.block(r, l);
        let z_plus = z.transpose() * (&z * z.transpose()).try_inverse().unwrap();
        let e_hat = &y - &y * &z_plus * &z;

        // (38): f block rows of shifted block columns of Z^+.
        let mut arranged = DMatrix::zeros(f * nc, self.past * q);
        for i in 0..f {
            for j in i..self.past {
                arranged
                    .view_mut((i * nc, j * q), (nc, q))
                    .copy_from(&z_plus.columns((j - i) * q, q));
            }
        }
        let big_q = &arranged * &z;
        let big_q_next = &arranged * &z_next;

        let s = &self.estimate.state_map;
        let gamma_k = {
            let coefficients = &y * &z_plus;
            let mut out = DMatrix::zeros(f * l, self.past * q);
            for i in 0..f {
                let width = (self.past - i) * q;
                out.view_mut((i * l, i * q), (l, width))
                    .copy_from(&coefficients.columns(0, width));
            }
            out
        };
        let x_hat = s * gamma_k * &z;
        let mut phi = DMatrix::zeros(n + r + l, nc);
        phi.rows_mut(0, n).copy_from(&x_hat);
        phi.rows_mut(n, r).copy_from(&u);
        phi.rows_mut(n + r, l).copy_from(&e_hat);
        let phi_plus = pseudo_inverse(&phi, 1e-13).unwrap();
        let x_plus = pseudo_inverse(&x_hat, 1e-13).unwrap();

        let StateSpace { a, k, c, .. } = &self.estimate.system;
        let alpha_1 = (&big_q_next * &phi_plus).transpose().kronecker(s)
            - (&big_q * &phi_plus).transpose().kronecker(&(a * s));
        let projection = &z_plus * &z;
        let beta_1 = (&projection * &phi_plus).transpose().kronecker(k) * beta_sign;
        let alpha_2 = (&big_q * &x_plus).transpose().kronecker(&(-c * s));
        let identity = DMatrix::identity(l, l);
        let beta_2 = (&projection * &x_plus).transpose().kronecker(&identity) * beta_sign;

        // vec(I_f (x) E) = P vec(E).
        let mut p = DMatrix::<f64>::zeros(f * l * f * nc, l * nc);
        for i in 0..f {
            for k in 0..nc {
                for o in 0..l {
                    p[((i * nc + k) * f * l + i * l + o, k * l + o)] = 1.0;
                }
            }
        }
        let upper = &alpha_1 * &p + beta_1;
        let lower = &alpha_2 * &p + beta_2;
        let mut jacobian = DMatrix::zeros(upper.nrows() + lower.nrows(), l * nc);
        jacobian.rows_mut(0, upper.nrows()).copy_from(&upper);
        jacobian
            .rows_mut(upper.nrows(), lower.nrows())
            .copy_from(&lower);
        let root = symmetric_square_root_factor(&self.varx.innovation_covariance).unwrap();
        let noisy = &jacobian * DMatrix::<f64>::identity(nc, nc).kronecker(&root);
        &noisy * noisy.transpose()
    }
}

#[test]
fn lean_covariance_is_the_papers() {
    for (past, future) in [(5, 5), (6, 3)] {
        let problem = problem(&van_wingerden_one(), 130, past, future, 3);
        let lean = subspace_covariance(&problem.estimate, &problem.varx)
            .unwrap()
            .matrix;
        let literal = problem.literal(1.0);
        let error = (&lean - &literal).amax() / literal.amax();
        println!("p = {past}, f = {future}: lean against literal {error:.1e}");
        assert!(error < 1e-9, "{error:e}");
    }
}

#[test]
fn printed_sign_changes_the_covariance() {
    let problem = problem(&van_wingerden_one(), 130, 5, 5, 3);
    let printed = problem.literal(-1.0);
    let corrected = problem.literal(1.0);
    let change = (&printed - &corrected).amax() / corrected.amax();
    println!(
        "printed minus sign of beta: covariance changes by {:.0} %",
        100.0 * change
    );
    assert!(change > 0.05);
}

/// With `A - K C` exactly nilpotent the paper's (35)-(36) is an identity, not an approximation, for the true
/// `A`, `K`, `C` in the basis `T = S Gamma`: that settles the sign.
#[test]
fn error_propagation_is_exact_for_a_nilpotent_predictor() {
    let plant = TestSystem {
        system: StateSpace {
            a: DMatrix::from_row_slice(2, 2, &[1.2, 1.0, -0.5, 0.0]),
            b: DMatrix::from_row_slice(2, 1, &[1.0, 0.4]),
            c: DMatrix::from_row_slice(1, 2, &[1.0, 0.0]),
            d: DMatrix::zeros(1, 1),
            k: DMatrix::from_row_slice(2, 1, &[1.2, -0.5]),
            sample_time: 1.0,
        },
        innovation_covariance: DMatrix::identity(1, 1),
        feedback: DMatrix::from_element(1, 1, -0.1),
    };
    let (past, future) = (4, 3);
    let problem = problem(&plant, 400, past, future, 8);
    let truth = &plant.system;

    let predictor = &truth.a - &truth.k * &truth.c;
    let mut gamma = DMatrix::zeros(future, 2);
    let mut row = truth.c.clone();
    for i in 0..future {
        gamma.row_mut(i).copy_from(&row.row(0));
        row = &row * &predictor;
    }
    let basis = &problem.estimate.state_map * gamma;
    let inverse = basis.clone().try_inverse().unwrap();
    let in_basis = StateSpace {
        a: &basis * &truth.a * &inverse,
        b: &basis * &truth.b,
        c: &truth.c * &inverse,
        d: truth.d.clone(),
        k: &basis * &truth.k,
        sample_time: 1.0,
    };
    let error_of_coefficients =
        &problem.varx.coefficients - predictor_coefficients(truth, past, false);
    let with_truth = Estimate {
        system: in_basis.clone(),
        ..problem.estimate.clone()
    };
    let (layout, jacobian) = subspace_jacobian(&with_truth, &problem.varx);
    let predicted = &jacobian
        * DMatrix::from_column_slice(jacobian.ncols(), 1, error_of_coefficients.as_slice());
    let estimated = layout.pack(&problem.estimate.system);
    let expected = layout.pack(&in_basis);
    let mut largest = 0.0_f64;
    let mut size = 0.0_f64;
    for i in 0..layout.len() {
        let error = estimated[i] - expected[i];
        largest = largest.max((error - predicted[(i, 0)]).abs());
        size = size.max(error.abs());
    }
    println!("pathwise: error {size:.2e}, left by the linear map {largest:.1e}");
    assert!(largest < 1e-10 * size.max(1.0));
}
