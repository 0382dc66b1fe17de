//! Decision.

pub(crate) mod averaged_decision;
pub(crate) mod free_run_decision;
