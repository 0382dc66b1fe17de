//! The augmented model of a document.
//!
//! | file | what it holds |
//! |---|---|
//! | `simulate_augmented` | the model written to a document and read back; its simulation |
//! | `estimate_initial_state` | the state at the first sample of another recording |

pub(crate) mod estimate_initial_state;
pub(crate) mod simulate_augmented;
