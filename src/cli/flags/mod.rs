//! Flags that several commands have: columns, choice of the model, threads and memory; and how their values are read.

mod model_flags;
pub(crate) mod numbers;
mod resources;
mod role_flags;
mod show_format;

pub(crate) use model_flags::ModelFlags;
pub(crate) use resources::Resources;
pub(crate) use role_flags::{RoleFlags, tell_reading};
pub(crate) use show_format::ShowFormat;
