//! Search.

pub(crate) mod cross_validation;
pub(crate) mod forward_selection;
pub(crate) mod penalties;
pub(crate) mod plausibility;
pub(crate) mod rectified_sensor;
pub(crate) mod richer_laws;
pub(crate) mod single_effects;
pub(crate) mod tank_candidates;
