//! What may be said of a fit: tests, and how sure an answer is.

pub(super) mod doubt;
pub(super) mod free_run;
pub(super) mod joint_test;
pub(super) mod stated_probability;
