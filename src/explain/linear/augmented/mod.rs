//! Augmented.

pub(crate) mod estimate_initial_state;
pub(crate) mod simulate_augmented;
