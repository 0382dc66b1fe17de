//! What a plant in equations leaves out: one engine over places, terms and arguments.
//!
//! `select` asks `pairs` and `search` for effects, by the likelihood and by free runs, and judges by `holdout`. A search takes one `step`
//! after the other: `screening` tests `terms` at places, `fitting` fits what the tests find; `pairs` asks whether two effects stand for
//! what it has found.

pub(crate) mod fitting;
pub(crate) mod holdout;
pub(crate) mod hypothesis;
pub(crate) mod long_recordings;
pub(crate) mod misled;
mod named_alone;
mod pairs;
pub(crate) mod scope;
pub(crate) mod screening;
pub(crate) mod search;
pub(crate) mod select;
pub(crate) mod shared_terms;
mod step;
pub(crate) mod terms;
pub(crate) mod thresholds;
