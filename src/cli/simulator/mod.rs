//! `innovant identify --simulator`: another program simulates, and its parameters are estimated.

pub(crate) mod identify_simulator;
mod simulator_command;
mod simulator_parameters;

pub(crate) use identify_simulator::SimulatorFlags;
