//! Answer.

pub(crate) mod drive_account;
pub(crate) mod effects_found;
pub(crate) mod learned_curve;
pub(crate) mod linear_answer;
pub(crate) mod parameter_changes;
pub(crate) mod probability;
pub(crate) mod regions;
