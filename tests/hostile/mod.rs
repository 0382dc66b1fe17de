//! Hostile inputs: what each target of `fuzz/` does with its bytes. `tests/hostile.rs` does the same with drawn bytes.
//!
//! A target decodes its bytes into what people hand to the program (a file, a document, a log with options) and holds the
//! answer to more than that nothing panics: `sound` has what must be true of everything that is accepted and of every
//! refusal.

mod bytes;
mod csv_reader;
mod edits;
mod explain_logs;
mod explanation_json;
mod identify_logs;
mod logs;
mod model_json;
mod sound;

pub use csv_reader::csv_reader;
pub use explain_logs::explain_log as explain;
pub use explanation_json::{explanation_json, parse as parse_explanation};
pub use identify_logs::{identify_log as identify, run as run_identify};
pub use model_json::{model_json, parse as parse_model};
