//! Estimated against Monte Carlo and true asymptotic variance of a frequency response, as in section 5 of Chiuso & Picci.

use innovant::covariance::frequency_response_covariance;
use innovant::identify::Detrend;
use innovant::identify::{Method, Order, Polish, Prediction, Weight};
use innovant::internal::identify::{AsymptoticMethod, asymptotic_covariance};
use innovant::internal::systems::ClosedLoop;
use innovant::{Options, identify};
use num_complex::Complex64;
use rayon::prelude::*;

/// Runs of one method on recordings of one closed loop.
pub struct Study<'a> {
    pub plant: &'a ClosedLoop,
    pub method: Method,
    pub weight: Weight,
    pub past: usize,
    pub future: usize,
    /// Samples of each recording.
    pub samples: usize,
    pub runs: u64,
    pub seed: u64,
}

/// Variances of one entry of a frequency response at one frequency, real and imaginary part together.
#[derive(Debug, Clone, Copy)]
pub struct Variances {
    pub rad: f64,
    /// Of the estimates about the truth, over the runs.
    pub monte_carlo: f64,
    /// Mean of what the runs state.
    pub mean_estimated: f64,
    /// 5 % point, median and 95 % point of what the runs state.
    pub percentiles: [f64; 3],
    /// Asymptotic, divided by the number of windows.
    pub asymptotic: f64,
}

impl Study<'_> {
    /// Windows of the method in each recording: what an asymptotic covariance is divided by.
    pub fn windows(&self) -> f64 {
        let longest = match self.method {
            Method::PbsidOpt => self.past,
            _ => self.past + self.future,
        };
        (self.samples - longest) as f64
    }

    pub fn run(&self, frequencies: &[f64]) -> Vec<Variances> {
        let options = Options {
            method: self.method,
            weight: Some(self.weight),
            order: Order::Fixed(self.plant.plant.states()),
            past: Some(self.past),
            future: Some(self.future),
            polish: Polish::Never,
            detrend: Detrend::None,
            ..Options::default()
        };
        let runs: Vec<Vec<(Complex64, f64)>> = (0..self.runs)
            .into_par_iter()
            .map(|run| {
                let log = self.plant.record(self.samples, self.seed + run).unwrap();
                let model = identify(&[log], &options).unwrap();
                let covariance = model.covariance.as_ref().unwrap();
                frequencies
                    .iter()
                    .map(|&w| {
                        let response = model.system.frequency_response(w)[0];
                        let spread =
                            frequency_response_covariance(&model.system, covariance, w).unwrap();
                        (response, spread[0][0][0] + spread[0][1][1])
                    })
                    .collect()
            })
            .collect();
        let method = match self.method {
            Method::Whitening => AsymptoticMethod::Nested(Prediction::Whitening),
            Method::InnovationEstimation => {
                AsymptoticMethod::Nested(Prediction::InnovationEstimation)
            }
            _ => AsymptoticMethod::PbsidOpt,
        };
        let truth = &self.plant.plant;
        let asymptotic =
            asymptotic_covariance(self.plant, method, self.weight, self.past, self.future).unwrap();
        frequencies
            .iter()
            .enumerate()
            .map(|(k, &rad)| {
                let count = runs.len() as f64;
                let exact = truth.frequency_response(rad)[0];
                let mut stated: Vec<f64> = runs.iter().map(|run| run[k].1).collect();
                stated.sort_by(f64::total_cmp);
                let at =
                    |p: f64| stated[((p * (count - 1.0)).round() as usize).min(stated.len() - 1)];
                let spread = frequency_response_covariance(truth, &asymptotic, rad).unwrap()[0];
                Variances {
                    rad,
                    monte_carlo: runs
                        .iter()
                        .map(|run| (run[k].0 - exact).norm_sqr())
                        .sum::<f64>()
                        / count,
                    mean_estimated: stated.iter().sum::<f64>() / count,
                    percentiles: [at(0.05), at(0.5), at(0.95)],
                    asymptotic: (spread[0][0] + spread[1][1]) / self.windows(),
                }
            })
            .collect()
    }
}
