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
//! use innovant::log::{Log, Roles, Source};
//! use innovant::{Options, identify};
//!
//! // Two inputs, two outputs, under feedback.
//! let log = Log::read(&Source::from("data/closed_loop.csv"), &Roles::default())?;
//! let model = identify(&[log], &Options::default())?;
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
//! The API is what these modules show; each has its parts in private files and lists in its `mod.rs` what it shows:
//!
//! | module | what it is for |
//! |---|---|
//! | [`log`] | recordings: CSV in and out, column roles, units, sampling |
//! | [`identify`](mod@identify) | windows, order, methods, polish to maximum likelihood, the [`Model`] |
//! | [`model`] | what a state-space system does: simulate, predict, frequency response, poles, zeros |
//! | [`covariance`] | the covariance of the parameters, and of what follows from them |
//! | [`validate`] | fit, and residual tests that hold their level in closed loop and under coloured noise |
//! | [`physics`] | a plant as equations: Modelica text in, simulation, estimation of its parameters |
//! | [`explain`](mod@explain) | what a simulation lacks: located, named, fitted, checked on held-out blocks |
//! | [`report`] | JSON documents with their schema, pages |
//!
//! Inside the crate stand, for these and for the command line:
//!
//! | module | what it is for |
//! |---|---|
//! | `moments` | one pass over the data: lag moments, and from them the triangular factor `R` |
//! | `noise` | the spectrum of what a plant in equations leaves |
//! | `linalg` | the only place that names faer |
//! | `limits` | how much memory a request may take |
//! | `batch` | many logs, a model of each: parallel, resumable |
//! | `reproduce` | the papers' experiments, run again, beside what the papers print |
//! | `systems` | the papers' examples, simulated, for tests and benchmarks |
//! | `cli` | the command line |
//! | `internal` | what the command, the wheel, tests and benchmarks use beside the API; no stability |
//!
//! The equations, from the recording to the covariance and to what a simulation leaves out, are one chapter:
//! [`mathematics`].
//!
//! # Features
//!
//! `cli`, on by default, is the command `innovant`; `report`, on by default and part of `cli`, writes HTML pages. A program that
//! identifies, explains and reads or writes JSON documents needs neither (`default-features = false`).
//!
//! # References
//! - J.W. van Wingerden, *The asymptotic variance of the PBSIDopt algorithm* (equation numbers in this
//!   documentation are that paper's; its printed sign of the terms beta in Appendix B is wrong, see
//!   [`covariance`]).
//! - A. Chiuso, G. Picci, *Estimating the asymptotic variance of closed loop subspace estimators*.
//! - T. Knudsen, *Subspace identification - reducing uncertainty on the stochastic part*.

// `pub` means API: `docs/public_api.txt` lists it. Anything else is `pub(crate)` or narrower.
#![warn(unreachable_pub)]

#[cfg(feature = "cli")]
mod batch;
#[cfg(feature = "cli")]
mod cli;
pub mod covariance;
pub mod explain;
pub mod identify;
#[doc(hidden)]
#[allow(missing_docs, reason = "not part of the API")]
pub mod internal;
mod limits;
mod linalg;
pub mod log;
pub mod model;
mod moments;
mod noise;
pub mod physics;
pub mod report;
#[cfg(feature = "cli")]
mod reproduce;
mod systems;
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

// Errors that those of several modules carry, and the limit that one of them is about.
pub use limits::{LimitError, set_memory_limit};
pub use linalg::LinalgError;

pub use identify::{IdentifyError, Model, Options, identify};
