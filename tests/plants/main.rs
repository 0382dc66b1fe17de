//! Plants in equations: read, simulated, estimated, explained, and the programs that stand in for them. One binary, because
//! each links the whole library.

#[path = "../support/cart.rs"]
mod cart;
mod external_simulator;
#[path = "../support/folder.rs"]
mod folder;
mod physics_estimate;
mod physics_messages;
mod physics_mutations;
mod physics_simulate;
mod physics_texts;
mod plant_arguments;
mod plant_cli;
mod plant_coast_down;
mod plant_confounded;
mod plant_explain;
mod plant_feedback;
mod plant_few_samples;
mod plant_forms;
mod plant_gravity;
mod plant_habits;
mod plant_held_out;
mod plant_hypotheses;
mod plant_initial_states;
mod plant_long;
mod plant_neighbours;
mod plant_pairs;
mod plant_parameters;
mod plant_parts;
mod plant_position_loops;
mod plant_search;
mod plant_sparse;
mod plant_travel;
