//! What can be wrong with a question to `explain`.

use crate::limits::LimitError;
use crate::log::LogError;

/// Why there is no answer. Messages are worded for the command line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the messages explain the fields")]
pub enum ExplainError {
    /// It would take more memory than it may.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// What was given is no recording, or not of the same plant.
    #[error(transparent)]
    Log(#[from] LogError),
    /// Nothing to answer to, or nothing that answers.
    #[error(
        "{recording}: explain needs at least one input and one output; name the columns with --inputs and --outputs"
    )]
    NoChannels { recording: String },
    /// No recording was given.
    #[error("explain needs at least one recording")]
    NoRecording,
    /// Not as many simulated recordings as recordings.
    #[error(
        "{recordings} recordings and {simulations} simulations: give one simulation column file for each recording, in the same order, or one model"
    )]
    Count {
        recordings: usize,
        simulations: usize,
    },
    /// Lengths differ.
    #[error(
        "{simulation}: {simulated} samples, and {recording} has {recorded}; simulate exactly the recorded input"
    )]
    Length {
        recording: String,
        recorded: usize,
        simulation: String,
        simulated: usize,
    },
    /// Sampling differs.
    #[error(
        "{simulation}: sample time {simulated} s, and {recording} is sampled at {recorded} s; simulate at the recording's sample time"
    )]
    Sampling {
        recording: String,
        recorded: f64,
        simulation: String,
        simulated: f64,
    },
    /// Inputs or outputs differ in number.
    #[error(
        "{simulation}: {simulated}, and {recording} has {recorded}; name the columns that belong together with {option}"
    )]
    Channels {
        simulation: String,
        simulated: String,
        recording: String,
        recorded: usize,
        option: &'static str,
    },
    /// Units differ.
    #[error(
        "{simulation}: the units of {channel} contradict each other: it is in {simulated}, and the recording's is in {recorded}{factor}; convert one of them, or take the unit out of its header"
    )]
    Unit {
        simulation: String,
        channel: String,
        recorded: String,
        simulated: String,
        factor: String,
    },
    /// Numbers whose squares and products are none.
    #[error(
        "{recording}: {channel} moves by {size:e} and reaches {largest:e}; only sizes from 1e-60 to 1e60 are explained: give it in another unit"
    )]
    Size {
        recording: String,
        channel: String,
        size: f64,
        largest: f64,
    },
    /// Too few samples.
    #[error(
        "{recording}: {samples} samples are too few: {needed} are needed to fit {states} states and still hold out blocks for the proof; record longer"
    )]
    TooShort {
        recording: String,
        samples: usize,
        needed: usize,
        states: usize,
    },
    /// The simulated output runs away.
    #[error(
        "{name}: the simulation is unstable (spectral radius {radius:.6}): its output leaves every bound on the recorded input; give a stable model, or the simulated output of the plant inside its loop"
    )]
    Unstable { name: String, radius: f64 },
    /// The simulated output could not be understood.
    #[error(
        "{name}: no dynamic model reproduces this simulated output from the recorded inputs (best relative misfit {misfit:.2}); {}check that it was simulated with these inputs, or give the model itself as JSON",
        never_change(.constant)
    )]
    NotUnderstood {
        name: String,
        misfit: f64,
        /// Inputs that never change.
        constant: Vec<String>,
    },
    /// No inputs, and no equations in place of the simulation.
    #[error(
        "{name}: the recording has no inputs, and no equations were found that reproduce this simulated output; give the simulator as a plant in equations (.mo), or name the inputs with --inputs"
    )]
    NoEquations { name: String },
    /// More states than the engine runs.
    #[error(
        "{name}: {states} states, and at most {most} can be explained; reduce the model's order first"
    )]
    TooLarge {
        name: String,
        states: usize,
        most: usize,
    },
    /// A static simulation.
    #[error(
        "{name}: no output shows any state of this simulation, so there are no dynamics to explain; give a model with those of the plant"
    )]
    Static { name: String },
    /// An output that does not move.
    #[error(
        "{recording}: the output {output} is constant; leave it out with --outputs, or check the sensor"
    )]
    Constant { recording: String, output: String },
    /// An effect to leave out that does not exist.
    #[error("there is no effect called {id}; `innovant explain --help` lists them")]
    UnknownEffect { id: String },
    /// Every start failed.
    #[error(
        "{name}: no fit of the simulation to the recording succeeded; check that inputs and outputs are the ones that were simulated"
    )]
    NoFit { name: String },
}

/// What is to be said of inputs that never change, if there are any.
fn never_change(inputs: &[String]) -> String {
    let names: Vec<String> = inputs.iter().map(|name| format!("`{name}`")).collect();
    match names.as_slice() {
        [] => String::new(),
        [one] => format!(
            "the input {one} never changes, so that no response to it can be seen: leave it out with --inputs (`--inputs none` if it \
             is the only one), or "
        ),
        several => format!(
            "the inputs {} never change, so that no response to them can be seen: leave them out with --inputs (`--inputs none` if \
             there is no other), or ",
            several.join(", ")
        ),
    }
}
