//! The study of `explain` on drawn cases: questions, scores, tables.
//!
//! | file | what it holds |
//! |---|---|
//! | `question` | a drawn case as the library takes it |
//! | `answer` | what was said, compared with the truth |
//! | `plan` | which cases are drawn |
//! | `tables` | the figures, for people |

#![allow(dead_code, reason = "shared by tests, which use different parts")]

pub mod answer;
pub mod plan;
pub mod question;
pub mod tables;
