//! Dead time of the inputs: samples over which an input does nothing yet.
//!
//! A dead time of `d` samples is `d` states for each input in a state-space model, and none where the input is shifted. In
//! the vector ARX model it is `d` leading coefficients of the input that are zero, whatever the noise and also in closed
//! loop, because a predictor of the form `H^-1 G u + (1 - H^-1) y` has the dead time of `G`. Leading coefficients that
//! are jointly insignificant propose a dead time; the model of the shifted input decides by Schwarz's criterion.

use nalgebra::DMatrix;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::order::{OrderEvidence, REFEREE_LEVEL};
use super::varx::Varx;
use crate::linalg::{cholesky_upper, solve_upper_transposed};

/// Significance of the leading coefficients from which a dead time has ended.
pub(super) const LEVEL: f64 = 0.01;
/// Leading lags of each input whose coefficients are jointly zero at [`LEVEL`]; 0 for an input without any significant one.
fn proposed(varx: &Varx, inputs: usize) -> Vec<usize> {
    let none = vec![0; inputs];
    if varx.dependent || varx.feedthrough {
        return none;
    }
    let Ok(upper) = cholesky_upper(&varx.innovation_covariance) else {
        return none;
    };
    (0..inputs)
        .map(|input| leading_zeros(varx, &upper, input).unwrap_or(0))
        .collect()
}

/// Wald's test of the first lag, of the first two, and so on, until it rejects.
fn leading_zeros(varx: &Varx, upper: &DMatrix<f64>, input: usize) -> Option<usize> {
    let (m, l) = (varx.regressors(), varx.coefficients.nrows());
    let q = m / varx.past;
    // Coefficients and columns of `R^-T`, whose products are their covariance, in units of the innovations.
    let mut coefficients = DMatrix::zeros(0, l);
    let mut factors = DMatrix::zeros(m, 0);
    for lag in 1..=varx.past {
        let column = (varx.past - lag) * q + input;
        let mut unit = DMatrix::zeros(m, 1);
        unit[(column, 0)] = 1.0;
        let whitened =
            solve_upper_transposed(upper, &varx.coefficients.columns(column, 1).into_owned());
        coefficients = coefficients.insert_row(lag - 1, 0.0);
        coefficients
            .row_mut(lag - 1)
            .copy_from(&whitened.transpose());
        factors = factors.insert_column(lag - 1, 0.0);
        factors
            .column_mut(lag - 1)
            .copy_from(&solve_upper_transposed(&varx.regressor_factor, &unit));
        let covariance = factors.tr_mul(&factors);
        let statistic = coefficients
            .tr_mul(&covariance.cholesky()?.solve(&coefficients))
            .trace();
        let p_value = ChiSquared::new((lag * l) as f64).ok()?.sf(statistic);
        if p_value < LEVEL {
            return Some(lag - 1);
        }
    }
    None
}

/// What an identification says about the dead time of its inputs.
#[derive(Debug, Clone)]
pub(super) struct Evidence {
    /// Leading lags of each input that do nothing.
    pub proposed: Vec<usize>,
    /// Schwarz's criterion of the model against its vector ARX model, where it was computed.
    schwarz: Option<f64>,
    /// Whether the chi-square test accepts the order.
    pub accepted: bool,
    /// `log det` of the innovation covariance of the vector ARX model in the user's units, by maximum likelihood.
    log_determinant: f64,
    /// Windows of the vector ARX model.
    windows: usize,
}

impl Evidence {
    /// Of a model with this evidence for its order; `scale` are the divisors of the outputs.
    pub(super) fn new(
        varx: &Varx,
        order: Option<&OrderEvidence>,
        inputs: usize,
        scale: &[f64],
    ) -> Self {
        let likeliest = &varx.sum_of_squares / varx.columns as f64;
        let half = cholesky_upper(&likeliest).map_or(f64::NEG_INFINITY, |upper| {
            upper.diagonal().iter().map(|d| d.ln()).sum::<f64>()
        });
        Self {
            proposed: proposed(varx, inputs),
            schwarz: order.and_then(|e| e.schwarz),
            accepted: order
                .and_then(|e| e.p_value)
                .is_none_or(|p| p >= REFEREE_LEVEL),
            log_determinant: 2.0 * (half + scale.iter().map(|s| s.ln()).sum::<f64>()),
            windows: varx.columns,
        }
    }

    /// By how much Schwarz's criterion is smaller than that of `other`; `None` where one of them is not known.
    pub(super) fn gain_over(&self, other: &Self) -> Option<f64> {
        let windows = self.windows.min(other.windows) as f64;
        let criterion = |e: &Self| Some(e.schwarz? + windows * e.log_determinant);
        Some(criterion(other)? - criterion(self)?).filter(|gain| gain.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use crate::identify::aligned::fit_aligned;
    use crate::identify::{MemoryRecords, Model, Options, identify};
    use crate::log::{Channel, Log};

    /// `y` follows `u` with a pole at 0.9 after `dead` samples, under slow and white noise; with `gain` a controller closes the
    /// loop.
    fn recorded(dead: usize, samples: usize, gain: f64, seed: u64) -> Log {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let (mut u, mut y, mut x, mut slow, mut r) = (vec![], vec![], 0.0, 0.0, 0.0);
        for k in 0..samples {
            slow = 0.9 * slow + 0.1 * normal();
            let measured: f64 = x + slow + 0.1 * normal();
            if k % 8 == 0 {
                r = normal();
            }
            u.push(r - gain * measured);
            y.push(measured);
            let late: f64 = if k >= dead { u[k - dead] } else { 0.0 };
            x = 0.9 * x + 0.1 * late;
        }
        Log {
            name: "dead time".to_owned(),
            sample_time: 1.0,
            start_time: 0.0,
            inputs: vec![Channel::new("u")],
            outputs: vec![Channel::new("y")],
            input_data: vec![u],
            output_data: vec![y],
            sha256: None,
        }
    }

    fn model(log: Log, input_delay: Vec<usize>) -> Model {
        let options = Options {
            input_delay,
            ..Options::default()
        };
        identify(&[log], &options).unwrap()
    }

    /// To a sample more where the first coefficient is small, in open and closed loop.
    #[test]
    fn leading_coefficients_tell_the_dead_time() {
        for (dead, gain) in [(3, 0.0), (8, 0.0), (8, 0.5), (15, 0.0)] {
            let found: Vec<usize> = (0..5)
                .map(|seed| {
                    let logs = [recorded(dead, 3000, gain, seed)];
                    let mut records = MemoryRecords::new(&logs).unwrap();
                    let fit = fit_aligned(&mut records, &Options::default()).unwrap();
                    fit.dead_time.proposed[0]
                })
                .collect();
            let right = found.iter().filter(|d| (dead..=dead + 1).contains(d));
            assert!(right.count() >= 4, "{dead} {gain}: {found:?}");
        }
    }

    /// Two outputs that are heated by two inputs, each over its own lags: without the dead time no order is accepted.
    #[test]
    fn dead_time_costs_no_states() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let (dead, samples) = (8, 2500);
        let (mut u, mut y) = (vec![Vec::new(); 2], vec![Vec::new(); 2]);
        let (mut x, mut slow) = ([0.0; 2], [0.0; 2]);
        let mut held = [0.0; 2];
        for k in 0..samples {
            for i in 0..2 {
                if (k + 7 * i) % 15 == 0 {
                    held[i] = normal();
                }
                u[i].push(held[i]);
                slow[i] = 0.95 * slow[i] + 0.02 * normal();
                y[i].push(x[i] + slow[i] + 0.02 * normal());
            }
            let late = |i: usize| if k >= dead { u[i][k - dead] } else { 0.0 };
            x = [
                0.96 * x[0] + 0.01 * x[1] + 0.05 * late(0),
                0.01 * x[0] + 0.95 * x[1] + 0.06 * late(1),
            ];
        }
        let mut log = recorded(0, 10, 0.0, 1);
        log.inputs.push(Channel::new("v"));
        log.outputs.push(Channel::new("z"));
        (log.input_data, log.output_data) = (u, y);
        let model = model(log, Vec::new());
        let delays: Vec<usize> = model.inputs.iter().map(|c| c.delay).collect();
        assert!(
            delays.iter().all(|d| (dead - 1..=dead).contains(d)),
            "{delays:?}"
        );
        assert!(model.system.states() <= 3, "{model}");
    }

    #[test]
    fn a_plant_without_dead_time_has_none() {
        for seed in 0..10 {
            let model = model(recorded(0, 3000, 0.0, seed), Vec::new());
            assert_eq!(model.inputs[0].delay, 0, "{seed}");
        }
    }

    #[test]
    fn what_the_user_says_counts() {
        assert_eq!(model(recorded(8, 2000, 0.0, 1), vec![0]).inputs[0].delay, 0);
        assert_eq!(model(recorded(8, 2000, 0.0, 1), vec![5]).inputs[0].delay, 5);
    }
}
