//! The engine for simulations that are linear models or columns of outputs.
//!
//! The simulation is a linear state-space model with effects. An effect acts on an input, on an output, or as a force on
//! the states. Each folder uses only folders above it in the table:
//!
//! | folder or file | what it holds |
//! |---|---|
//! | `data`, `effective_samples` | recordings as segments of samples; the number of independent values in a correlated series |
//! | `model` | the augmented model: linear plant, coordinates, effects, simulation |
//! | `fit` | maximum likelihood by Levenberg and Marquardt; covariance, profile likelihood |
//! | `identification` | a linear model from columns of simulated outputs; output-error models |
//! | `check` | data quality: dropouts, outliers, wraps, clocks, signs, units, exchanged outputs, a stuck sensor |
//! | `screening` | score tests of all effects at all places; tests of the residual |
//! | `search` | null models, fits of effects, forward selection, cross-validation, penalties |
//! | `known` | the simulation as the engine knows it, and the recordings as they are compared with it |
//! | `nonlinear_simulator` | a nonlinear simulator that is known by its outputs: the effect that it holds |
//! | `known_simulation` | checks of a simulation, and whether it is linear |
//! | `weak_form` | drives: the equation of motion averaged over windows |
//! | `decision` | the verdict, by output error and by the averaged equation of motion |
//! | `augmented` | the augmented model of a document: its simulation, its initial state |
//! | `answer` | from the decision to the document |

pub(crate) mod answer;
pub(crate) mod augmented;
pub(crate) mod check;
pub(crate) mod data;
pub(crate) mod decision;
pub(crate) mod effective_samples;
pub(crate) mod fit;
#[cfg(test)]
pub(crate) mod fixtures;
pub(crate) mod identification;
pub(crate) mod known;
pub(crate) mod known_simulation;
pub(crate) mod model;
pub(crate) mod nonlinear_simulator;
pub(crate) mod screening;
pub(crate) mod search;
pub(crate) mod weak_form;
