//! The program as its users run it: commands, files, messages, documents.

mod bad_input;
mod batch;
mod chiuso_picci_reference;
mod command;
mod concealed_data;
mod explain;
mod explain_plants;
#[path = "../support/folder.rs"]
mod folder;
mod formats;
mod identify;
mod open_loop_methods;
mod reference_values;
mod reproduce;
mod reproducible;
mod simulate_validate_show;
