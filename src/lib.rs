//! State-space models with uncertainty from recordings, in open or closed loop.
//!
//! Given samples of the inputs `u` and outputs `y` of a plant, find
//!
//! ```text
//! x[k+1] = A x[k] + B u[k] + K e[k]
//! y[k]   = C x[k] + D u[k] + e[k],      e white, cov(e) = Lambda,
//! ```
//!
//! together with the covariance of `A, B, K, C, D`, what follows from it for everything that does not depend on
//! the choice of the state (frequency response, poles, zeros, step response), and tests that tell whether the
//! model is to be believed. `e` is the *innovation*: the part of the output that the past does not predict.
//!
//! ```
//! use innovant::{Options, identify, systems};
//!
//! // Two inputs, two outputs, under feedback: u = 0.5 y + reference.
//! let recording = systems::van_wingerden_one().record(2000, 1);
//! let model = identify(&[recording], &Options::default())?;
//!
//! assert_eq!(model.system.states(), 4);
//! let covariance = model.covariance.as_ref().ok_or("identified models have one")?;
//! for pole in innovant::covariance::pole_uncertainties(&model.system, covariance)? {
//!     println!("{:.3} +- {:.3} rad/s", pole.pole.natural_frequency, pole.natural_frequency_std.unwrap_or(f64::NAN));
//! }
//! println!("{model}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The map
//!
//! Data flow one way; each arrow is one module calling the next, and none points back:
//!
//! ```text
//! CSV ── log ──> Log ── moments ──> R factor ── identify ──> Model + covariance ── validate ──> residual tests
//!                                                                  └──────── report, cli ────────┘
//! ```
//!
//! | module | what it is for |
//! |---|---|
//! | [`log`] | recordings: CSV in and out, column roles, units, sampling |
//! | [`moments`] | one pass over the data: lag moments, and from them the triangular factor `R` |
//! | [`identify`](mod@identify) | windows, order, methods, polish to maximum likelihood, the [`Model`] |
//! | [`model`] | what a state-space system does: simulate, predict, frequency response, poles, zeros |
//! | [`covariance`] | the covariance of the parameters, and of what follows from them |
//! | [`validate`] | fit, and residual tests that hold their level in closed loop and under coloured noise |
//! | [`explain`](mod@explain) | what a simulation lacks: located, named, fitted, checked on held-out blocks |
//! | [`batch`] | many logs, a model of each: parallel, resumable |
//! | [`report`] | JSON documents with their schema, tables for people |
//! | [`reproduce`] | the papers' experiments, run again, beside what the papers print |
//! | [`limits`] | how much memory a request may take |
//! | [`cli`] | the command line |
//! | [`linalg`] | the only place that names faer |
//! | [`systems`] | the papers' examples, simulated, for tests and benchmarks |
//!
//! The equations, from the recording to the covariance and to what a simulation leaves out, are one chapter:
//! [`mathematics`].
//!
//! # References
//! - J.W. van Wingerden, *The asymptotic variance of the PBSIDopt algorithm* (equation numbers in this
//!   documentation are that paper's; its printed sign of the terms beta in Appendix B is wrong, see
//!   [`covariance`]).
//! - A. Chiuso, G. Picci, *Estimating the asymptotic variance of closed loop subspace estimators*.
//! - T. Knudsen, *Subspace identification - reducing uncertainty on the stochastic part*.

pub mod batch;
pub mod cli;
pub mod covariance;
pub mod explain;
pub mod identify;
pub mod limits;
pub mod linalg;
pub mod log;
pub mod model;
pub mod moments;
mod noise;
pub mod physics;
pub mod report;
pub mod reproduce;
pub mod systems;
pub mod validate;

// The formulas are drawn by KaTeX, which the page carries with it, so that it opens offline; the fonts that the formulas
// use stand in the style sheet. The lint reads the script as HTML.
#[cfg(doc)]
#[allow(rustdoc::invalid_html_tags)]
#[doc = include_str!("../docs/mathematics.md")]
#[doc = concat!(
    "\n<style>",
    include_str!("../docs/katex/katex.min.css"),
    "</style>\n\n<script>",
    include_str!("../docs/katex/katex.min.js"),
    "</script>\n\n<script>",
    include_str!("../docs/katex/render.js"),
    "</script>\n"
)]
pub mod mathematics {}

pub use identify::{IdentifyError, Model, Options, identify};
