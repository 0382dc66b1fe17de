//! The verdict: consistent, parameters, named, family or unexplained.
//!
//! | file | what it holds |
//! |---|---|
//! | `output_error_decision` | by output error: the search, its tests, the verdict |
//! | `averaged_decision` | by the averaged equation of motion, for drives |

pub(crate) mod averaged_decision;
pub(crate) mod output_error_decision;
