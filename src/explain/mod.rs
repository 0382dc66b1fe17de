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
//! | file | what it holds |
//! |---|---|
//! | `simulation`, `baseline`, `offset`, `rebaseline` | the simulation as a model, also from a column of its outputs |
//! | `coordinates`, `plant`, `structure`, `functionals`, `run`, `finer` | the augmented model: numbers, effects, the recursion |
//! | `effects` | the library, one file a family |
//! | `noise`, `fit` | coloured, heavy-tailed noise; Levenberg and Marquardt |
//! | `screen`, `templates`, `features` | one Gauss-Newton step for everything |
//! | `cascade`, `tanks`, `rectified` | plants of another class, which no effect added to the linear one becomes |
//! | `search`, `refine`, `plausible`, `second`, `inquiry` | the fits, what is kept of them, the decision |
//! | `weak` | drives: the averaged equation of motion, where a free run cannot tell |
//! | `question`, `memory` | which ways are gone and which of them speaks; what that takes of the memory |
//! | `check` | the data before the physics: dropouts, outliers, wraps, clocks, signs, units, exchanged outputs, a stuck sensor |
//! | `adequacy` | tests of what is left |
//! | `locate`, `curve`, `prove`, `probability` | where, the law without a form, held-out blocks, how sure |
//! | `engine`, `plant_answer` | simulations that are plants in equations: terms at places of the equations, and what is said |
//! | `answer`, `account`, `words`, `explanation`, `augmented`, `start` | what is said, and the model that can be run |

mod columns;
mod compare_explanations;
mod document;
pub(crate) mod effects;
mod engine;
mod explain_recordings;
mod linear;
mod memory;
mod plant_answer;
mod simulation;

pub use document::explain_error::ExplainError;
pub use document::explanation::{
    Alternative, AugmentedModel, AugmentedPlant, Curve, Detectable, EXPLANATION_FORMAT,
    EffectFound, EffectSize, EquationMap, Evidence, Explanation, FitFigure, FitSteps, FitTable,
    HypothesisFit, HypothesisFound, HypothesisRival, HypothesisVerdict, Law, Location, Mechanics,
    ModelEffect, NoiseFound, ParameterChange, Quantity, Regime, Remaining, SignalReference,
    SignalTraces, StatePrior, Verdict,
};
pub use engine::hypothesis::{Hypothesis, HypothesisError, HypothesisErrorKind};
pub use engine::scope::UnknownPlantEffect;
pub use engine::terms::documentation::{Imitation, PLANT_EFFECTS, PlantEffect, plant_effect};
pub use explain_recordings::{Options, explain};
pub use linear::augmented::simulate_augmented::AugmentedError;
pub use plant_answer::{
    AugmentedPlantError, Original, PlantOptions, PlantQuestionError, explain_plant,
};
pub use simulation::Simulation;
