//! From the decision to the document.
//!
//! | file | what it holds |
//! |---|---|
//! | `linear_answer` | the whole document |
//! | `effects_found` | effects with their parameters, data errors, alternatives, detectable sizes |
//! | `drive_account` | the same for drives: mass, friction, laws |
//! | `parameter_changes` | natural frequency, damping, time constant and gain that changed |
//! | `learned_curve` | the static law without a form |
//! | `regions` | where recording and simulation differ: time, frequency, operating region |
//! | `probability` | how often answers like this one are right |

pub(crate) mod drive_account;
pub(crate) mod effects_found;
pub(crate) mod learned_curve;
pub(crate) mod linear_answer;
pub(crate) mod parameter_changes;
pub(crate) mod probability;
pub(crate) mod regions;
