//! What the user may choose.

use serde::{Deserialize, Serialize};

use super::algorithms::{Method, Stochastic};
use super::identify_error::IdentifyError;
use super::subspace::Weight;
use crate::moments::Detrend;

/// Blocks of the delete-block jackknife: enough degrees of freedom for its quantiles, few enough that
/// each is long.
pub(super) const JACKKNIFE_BLOCKS: usize = 20;

/// Which state dimension.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// By singular values, with the chi-square test as referee.
    #[default]
    Auto,
    /// This one.
    Fixed(usize),
    /// The best of these, all of them compared in the result.
    Compare(Vec<usize>),
}

impl Order {
    /// The largest order asked for; 1 when the choice is free.
    pub(crate) fn largest(&self) -> usize {
        match self {
            Self::Auto => 1,
            Self::Fixed(n) => *n,
            Self::Compare(list) => list.iter().copied().max().unwrap_or(1),
        }
    }
}

/// When the estimate is polished to maximum likelihood.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Polish {
    /// PBSID_opt when the past window is long enough for it (the truncation measure says so); other methods
    /// and stochastic steps were asked for by name, and keep their own numbers.
    #[default]
    Auto,
    /// Whatever the truncation.
    Always,
    /// Not at all: the plain method with its own covariance.
    Never,
}

/// Which covariance of the parameters.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum CovarianceKind {
    /// From the model: valid when order and noise model are right.
    #[default]
    Model,
    /// Delete-block jackknife: valid also when they are not, about the best model of that order.
    Robust,
}

/// Options of [`identify`](super::identify()); the default is what the command line does without flags.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Options {
    /// Algorithm.
    pub method: Method,
    /// Step that estimates `K` and `Lambda`; `None` is the method's own.
    pub stochastic: Option<Stochastic>,
    /// State dimension.
    pub order: Order,
    /// Past window `p`; `None` chooses.
    pub past: Option<usize>,
    /// Future window `f` (at most `p` for PBSID_opt); `None` chooses.
    pub future: Option<usize>,
    /// Weight of the singular value decomposition; `None` is what the method prefers: the identity, unless the
    /// innovations of the outputs differ so much in size that their units would decide.
    pub weight: Option<Weight>,
    /// Maximum-likelihood polish.
    pub polish: Polish,
    /// Kind of covariance.
    pub covariance: CovarianceKind,
    /// What is removed from the channels.
    pub detrend: Detrend,
    /// Whether `D` is estimated. In closed loop it is only identifiable with a delay in the loop.
    pub feedthrough: bool,
    /// Known delay of each input in samples; empty is none, one value is for all inputs.
    pub input_delay: Vec<usize>,
    /// Whether the model must be stable.
    pub stable: bool,
    /// Seed of everything drawn (confidence bounds by draws).
    pub seed: u64,
    /// Most memory in bytes that this identification may take; `None` is the limit of the process
    /// (`INNOVANT_MEMORY`, else half of what this machine has).
    #[serde(skip)]
    pub memory_limit: Option<u64>,
}

impl Options {
    /// The known delay of each of `inputs` inputs.
    pub(super) fn delays_of(&self, inputs: usize) -> Result<Vec<usize>, IdentifyError> {
        match self.input_delay.as_slice() {
            [] => Ok(vec![0; inputs]),
            [one] => Ok(vec![*one; inputs]),
            many if many.len() == inputs => Ok(many.to_vec()),
            many => Err(IdentifyError::Option(format!(
                "--delay has {} values, but there are {inputs} inputs: give one value for all, or one for each",
                many.len()
            ))),
        }
    }

    /// Whether `--polish auto` polishes.
    pub(super) fn polishes_by_default(&self) -> bool {
        self.method.polishes_by_default() && self.stochastic.is_none()
    }

    /// What was asked for by name, and is not polished unless that is asked for too.
    pub(super) fn own_numbers(&self) -> String {
        match self.stochastic {
            Some(step) => format!("--stochastic {}", step.name()),
            None => format!("--method {}", self.method.name()),
        }
    }

    /// Whether the covariance is, or may have to be, that of the jackknife.
    pub(super) fn may_need_blocks(&self) -> bool {
        let formula = match self.stochastic {
            Some(step) if !self.method.has_own(step) => {
                self.method.has_propagation() && step.has_covariance()
            }
            _ => self.method.has_covariance(),
        };
        self.covariance == CovarianceKind::Robust || !(formula || self.polish == Polish::Always)
    }

    /// Whether the model may be polished at all.
    pub(super) fn may_polish(&self) -> bool {
        match self.polish {
            Polish::Never => false,
            Polish::Always => true,
            Polish::Auto => self.polishes_by_default(),
        }
    }
}
