//! What a plant in equations leaves out: one engine over places, terms and arguments.

pub(crate) mod argument;
pub(crate) mod candidate;
pub(crate) mod curve;
pub(crate) mod documentation;
pub(crate) mod edit;
mod eliminate;
mod finish;
pub(crate) mod fitted;
mod formulas;
pub(crate) mod holdout;
pub(crate) mod hypothesis;
pub(crate) mod library;
mod map;
pub(crate) mod names;
mod path;
mod projection;
pub(crate) mod scope;
pub(crate) mod screen;
pub(crate) mod search;
mod second_effect;
pub(crate) mod select;
mod step;
pub(crate) mod thresholds;
pub(crate) mod values;
