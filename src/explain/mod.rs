//! What did the simulation leave out?
mod adequacy;
mod baseline;
mod coordinates;
mod data;
pub mod effects;
mod engine;
mod exact;
mod fit;
mod inquiry;
mod noise;
mod plant;
mod run;
mod screen;
mod search;
mod structure;
pub use engine::{Simulation, scratch};
