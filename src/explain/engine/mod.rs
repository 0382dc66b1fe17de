//! What a plant in equations leaves out: one engine over places, terms and arguments.

pub(crate) mod argument;
pub(crate) mod candidate;
pub(crate) mod edit;
pub(crate) mod library;
pub(crate) mod names;
pub(crate) mod screen;
pub(crate) mod search;
