//! What is asked about a plant in equations.

use crate::explain::engine::hypothesis::{Hypothesis, HypothesisError};
use crate::explain::engine::scope::UnknownPlantEffect;
use crate::physics::Hold;
use crate::physics::estimate::EstimateError;

/// A question to [`explain_plant`](super::explain_plant).
#[derive(Debug, Clone, PartialEq)]
pub struct PlantOptions {
    /// How inputs behave between samples.
    pub hold: Hold,
    /// Ids of the only effects of the library that are tried; all where empty.
    pub only: Vec<String>,
    /// Ids of effects that are not tried.
    pub without: Vec<String>,
    /// What is asked beside the library: each is reported, whether it wins or not.
    pub hypotheses: Vec<Hypothesis>,
}

/// Where the equations come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Origin {
    /// The user: parameters are reported that differ from the text.
    Text,
    /// A structure that ships with the program: its values are fitted, and all are reported.
    Structure,
}

impl Default for PlantOptions {
    fn default() -> Self {
        Self {
            hold: Hold::Zero,
            only: vec![],
            without: vec![],
            hypotheses: vec![],
        }
    }
}

/// Why there is no answer about a plant in equations. Messages are worded for the command line.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlantQuestionError {
    /// An effect to try or to leave out that does not exist.
    #[error(transparent)]
    UnknownEffect(#[from] UnknownPlantEffect),
    /// Two hypotheses of one name.
    #[error(transparent)]
    Hypothesis(#[from] HypothesisError),
    /// The parameters of the plant cannot be estimated.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
}
