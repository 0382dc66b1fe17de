//! Fits of candidates, and which of them stand beside each other.

pub(crate) mod candidate;
pub(crate) mod edit;
pub(crate) mod eliminate;
pub(crate) mod finish;
pub(crate) mod fitted;
pub(crate) mod formulas;
pub(crate) mod initial_states;
pub(crate) mod neighbours;
pub(crate) mod refined_curve;
pub(crate) mod release;
pub(crate) mod second_effect;
