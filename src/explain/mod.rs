//! What did the simulation leave out?
//!
//! A recording and a simulation of it differ. [`explain`] tells whether by more than noise, where, what physics is
//! missing, how sure that is, and returns the simulation with that physics in it:
//!
//! ```text
//! recording ──┐                        ┌── boring: initial state, parameters ──┐
//!             ├─ simulation known as ──┤                                        ├── rank ── decide ── prove ── say
//! simulation ─┘  plant + known effects └── screen ── fit effects, singly, pairs ┘
//! ```
//!
//! There are two engines: one for simulations that are linear models or columns of outputs, one for plants in equations.
//!
//! | folder or file | what it holds |
//! |---|---|
//! | `explain_recordings` | the question about a linear model or columns: which ways of answering it are taken |
//! | `simulation`, `memory` | the simulation as the caller gives it; the memory that a question takes |
//! | `effects` | the library of the linear engine, one file a family |
//! | `linear` | the linear engine: from the checks of the data to the answer |
//! | `engine` | the engine for plants in equations: terms at places of the equations |
//! | `plant_answer` | the question about a plant in equations, and its answer |
//! | `structures` | other plants in equations, offered where a linear simulation leaves structure |
//! | `columns` | equations that reproduce columns of outputs, for the engine of plants in equations |
//! | `compare_explanations` | the choice between the answers of both engines |
//! | `explanation` | the explanation as a document (`innovant-explanation/1`): its types |
//! | `document` | its sentences, plots, units and errors |

mod columns;
mod compare_explanations;
mod document;
pub(crate) mod effects;
mod engine;
mod explain_recordings;
mod explanation;
mod linear;
mod memory;
mod plant_answer;
mod simulation;
mod structures;

pub use document::explain_error::ExplainError;
pub use engine::hypothesis::{Hypothesis, HypothesisError, HypothesisErrorKind};
pub use engine::scope::UnknownPlantEffect;
pub use engine::terms::documentation::{Imitation, PlantEffect, plant_effect, plant_effects};
pub use explain_recordings::{Options, explain};
pub use explanation::{
    Alternative, AugmentedModel, AugmentedPlant, Curve, Detectable, EXPLANATION_FORMAT,
    EffectFound, EffectSize, EquationMap, Evidence, Explanation, FitFigure, FitSteps, FitTable,
    HypothesisFit, HypothesisFound, HypothesisRival, HypothesisVerdict, JointTest, Law, Location,
    Mechanics, ModelEffect, NoiseFound, OutputFit, ParameterChange, Quantity, Regime, Remaining,
    SignalReference, SignalTraces, Verdict,
};
pub use linear::augmented::simulate_augmented::AugmentedError;
pub use plant_answer::{
    AugmentedPlantError, Original, PlantOptions, PlantQuestionError, explain_plant,
};
pub use simulation::Simulation;
