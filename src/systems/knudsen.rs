//! The three test systems of Knudsen, *Subspace identification - reducing uncertainty on the stochastic part*
//! (2001), section 6 and table 1, with the excitation that reproduces the table.
//!
//! The paper prints rounded ARMAX coefficients. Behind them are closed forms, found from the printed digits: every
//! digit of the table agrees with them. The excitation is not printed either ("a suitable excitation"). A random
//! telegraph signal of amplitude one that switches with probability 0.15 gives the printed rms of all three systems;
//! other binary signals with runs of three to seven samples do so nearly as well.

use std::f64::consts::PI;

use nalgebra::DMatrix;

use super::TestSystem;
use crate::log::Log;
use crate::model::Armax;

/// Samples that are simulated and thrown away before a recording starts, so that it is stationary.
const BURN_IN: usize = 1000;
/// The standard normal quantile of 0.15, the probability that the telegraph signal switches.
const SWITCHES_BELOW: f64 = -1.036_433_389_493_789_8;

/// A system of the paper with what the paper does with it.
#[derive(Debug, Clone)]
pub struct KnudsenExample {
    /// The paper's abbreviation.
    pub name: &'static str,
    /// The system.
    pub system: TestSystem,
    /// Its polynomials.
    pub armax: Armax,
    /// Variance of the innovations.
    pub variance: f64,
    /// Both horizons of the subspace methods, `h = i`: "the smallest possible for the subid and n4sid methods".
    pub horizon: usize,
    /// The paper's table 1: rms error of tk-chol for each of [`KnudsenExample::parameters`] over 200 recordings of
    /// 500 samples.
    pub printed_rms: Vec<f64>,
}

impl KnudsenExample {
    fn new(
        name: &'static str,
        armax: Armax,
        variance: f64,
        horizon: usize,
        printed_rms: &[f64],
    ) -> Self {
        Self {
            name,
            system: TestSystem {
                system: armax.state_space(1.0),
                innovation_covariance: DMatrix::from_element(1, 1, variance),
                feedback: DMatrix::zeros(1, 1),
            },
            armax,
            variance,
            horizon,
            printed_rms: printed_rms.to_vec(),
        }
    }

    /// Order of the system.
    pub fn order(&self) -> usize {
        self.armax.a.len() - 1
    }

    /// The true parameters in the order of table 1: `a1..an, b0..bn, c1..cn, sigma^2`.
    pub fn parameters(&self) -> Vec<f64> {
        armax_parameters(&self.armax, self.variance)
    }

    /// Names of [`KnudsenExample::parameters`].
    pub fn parameter_names(&self) -> Vec<String> {
        let n = self.order();
        let numbered = |letter: &'static str, from: usize| {
            (from..=n).map(move |index| format!("{letter}{index}"))
        };
        numbered("a", 1)
            .chain(numbered("b", 0))
            .chain(numbered("c", 1))
            .chain(["sigma2".to_owned()])
            .collect()
    }

    /// A stationary recording with a random telegraph input of amplitude one.
    pub fn record(&self, samples: usize, seed: u64) -> Log {
        let mut level = 1.0;
        let mut log = self
            .system
            .record_with(samples + BURN_IN, seed, |_, _, white| {
                if white < SWITCHES_BELOW {
                    level = -level;
                }
                level
            });
        for column in log.input_data.iter_mut().chain(&mut log.output_data) {
            column.drain(..BURN_IN);
        }
        log
    }
}

/// ARMAX parameters in the order of Knudsen's table 1: `a1..an, b0..bn, c1..cn, sigma^2`.
pub(crate) fn armax_parameters(armax: &Armax, variance: f64) -> Vec<f64> {
    let mut parameters = armax.a[1..].to_vec();
    parameters.extend(&armax.b);
    parameters.extend(&armax.c[1..]);
    parameters.push(variance);
    parameters
}

/// First order, from van Overschee & De Moor (1996, section 4.4.5): the zero of the noise filter at 0.9996 makes the
/// bias of the residual covariance decay slowly.
pub fn knudsen_vo() -> KnudsenExample {
    // x[k+1] = a x + b u + k e, y = c x + d u + e, in the book's own numbers.
    let (a, b, c, d, k) = (0.949, 1.8805, 0.8725, -2.0895, -0.0580);
    let armax = Armax {
        a: vec![1.0, -a],
        b: vec![d, c * b - d * a],
        c: vec![1.0, c * k - a],
    };
    let printed = [0.0041, 0.25689, 0.303, 0.2048, 1.5246];
    KnudsenExample::new("VO", armax, 6.705, 3, &printed)
}

/// Second order ARMAX: the process has period 20 and damping 0.5, the zeros of the noise filter period 10 and
/// damping 0.25.
pub fn knudsen_armax() -> KnudsenExample {
    let process = SecondOrder::sampled(2.0 * PI / 20.0, 0.5);
    let noise = SecondOrder::sampled(2.0 * PI / 10.0, 0.25);
    let armax = Armax {
        a: process.denominator.to_vec(),
        b: process.numerator.to_vec(),
        c: noise.denominator.to_vec(),
    };
    let printed = [0.0130, 0.011, 0.00649, 0.010, 0.0096, 0.0699, 0.116, 2.8e-4];
    KnudsenExample::new("ARMAX", armax, 0.0030, 4, &printed)
}

/// Fourth order, of Box-Jenkins structure: `y = (B / F) u + (C / D) e` with second order parts, so that `A = F D` and
/// `C F` have the factor `F` in common.
pub fn knudsen_bj() -> KnudsenExample {
    let process = SecondOrder::sampled(2.0 * PI / 10.0, 0.5);
    let noise = SecondOrder::sampled(2.0 * PI / 20.0, 0.7);
    let (f, d) = (&process.denominator, &noise.denominator);
    // A tenth of the process acts at once; the static gain is one.
    let direct: Vec<f64> = (0..3)
        .map(|i| 0.1 * f[i] + 0.9 * process.numerator[i])
        .collect();
    let monic = [1.0, noise.numerator[2] / noise.numerator[1], 0.0];
    let armax = Armax {
        a: product(f, d),
        b: product(&direct, d),
        c: product(&monic, f),
    };
    let printed = [
        0.2205, 0.458, 0.35, 0.098, 0.00070, 0.022, 0.0149, 0.034, 0.031, 0.2079, 0.076, 0.086,
        0.091, 1.67e-5,
    ];
    KnudsenExample::new("BJ", armax, 1e-4, 6, &printed)
}

/// `w^2 / (s^2 + 2 z w s + w^2)` behind a zero-order hold of one second.
struct SecondOrder {
    numerator: [f64; 3],
    denominator: [f64; 3],
}

impl SecondOrder {
    fn sampled(frequency: f64, damping: f64) -> Self {
        let decay = (-damping * frequency).exp();
        let damped = frequency * (1.0 - damping * damping).sqrt();
        let (sine, cosine) = damped.sin_cos();
        let ratio = damping * frequency / damped;
        Self {
            numerator: [
                0.0,
                1.0 - decay * (cosine + ratio * sine),
                decay * (decay + ratio * sine - cosine),
            ],
            denominator: [1.0, -2.0 * decay * cosine, decay * decay],
        }
    }
}

fn product(p: &[f64], q: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; p.len() + q.len() - 1];
    for (i, a) in p.iter().enumerate() {
        for (j, b) in q.iter().enumerate() {
            out[i + j] += a * b;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Table 1 as printed.
    #[test]
    fn every_printed_digit_agrees() {
        let printed: [(KnudsenExample, &[(f64, i32)]); 3] = [
            (
                knudsen_vo(),
                &[
                    (-0.9490, 4),
                    (-2.08950, 5),
                    (3.624, 3),
                    (-0.9996, 4),
                    (6.7050, 4),
                ],
            ),
            (
                knudsen_armax(),
                &[
                    (-1.6464, 4),
                    (0.730, 3),
                    (0.0, 5),
                    (0.044, 3),
                    (0.0398, 4),
                    (-1.4026, 4),
                    (0.730, 3),
                    (0.0030, 4),
                ],
            ),
            (
                knudsen_bj(),
                &[
                    (-2.8148, 4),
                    (3.134, 3),
                    (-1.64, 2),
                    (0.344, 3),
                    (0.1, 5),
                    (-0.140, 3),
                    (0.2067, 4),
                    (-0.252, 3),
                    (0.108, 3),
                    (-0.3864, 4),
                    (-0.546, 3),
                    (0.461, 3),
                    (0.0, 4),
                    (0.0001, 4),
                ],
            ),
        ];
        for (example, table) in printed {
            let parameters = example.parameters();
            assert_eq!(parameters.len(), table.len());
            assert_eq!(parameters.len(), example.printed_rms.len());
            for ((value, (digits, places)), name) in
                parameters.iter().zip(table).zip(example.parameter_names())
            {
                let unit = 10.0_f64.powi(-places);
                assert!(
                    (value - digits).abs() <= 0.5001 * unit,
                    "{} {name}: {value} against {digits}",
                    example.name
                );
            }
        }
    }

    #[test]
    fn the_telegraph_switches_as_often_as_it_should() {
        let log = knudsen_armax().record(20_000, 3);
        assert_eq!(log.samples(), 20_000);
        let u = &log.input_data[0];
        assert!(u.iter().all(|v| v.abs() == 1.0));
        let switches = u.windows(2).filter(|w| w[0] != w[1]).count() as f64;
        // Four standard deviations of a binomial count.
        let std = (20_000.0_f64 * 0.15 * 0.85).sqrt();
        assert!((switches - 3000.0).abs() < 4.0 * std, "{switches}");
    }
}
