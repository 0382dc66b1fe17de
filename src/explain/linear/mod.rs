//! Linear.

pub(crate) mod answer;
pub(crate) mod augmented;
pub(crate) mod cascade;
pub(crate) mod check;
pub(crate) mod data;
pub(crate) mod decision;
pub(crate) mod effective_samples;
pub(crate) mod fit;
#[cfg(test)]
pub(crate) mod fixtures;
pub(crate) mod identification;
pub(crate) mod known_simulation;
pub(crate) mod model;
pub(crate) mod screening;
pub(crate) mod search;
pub(crate) mod weak_form;
