//! The answer: everything that `explain` says, in the form in which it is written (`innovant-explanation/1`).

mod fit_table;

pub use fit_table::{
    Detectable, EffectSize, FitFigure, FitSteps, FitTable, JointTest, NoiseFound, OutputFit,
    ParameterChange, Remaining,
};

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::identify::Recording;
use crate::linalg::Rows;
use crate::log::Channel;

/// Format name and version of the document.
pub const EXPLANATION_FORMAT: &str = "innovant-explanation/1";

fn one() -> usize {
    1
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_one(steps: &usize) -> bool {
    *steps == 1
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_false(value: &bool) -> bool {
    !*value
}

/// Answers whose criteria differ by less explain the recording equally well (Kass and Raftery 1995: 6 is "strong").
pub(crate) const EFFECTS_TIE: f64 = 6.0;

/// The answer's kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// No significant difference beyond noise.
    Consistent,
    /// Same physics, other parameters or another initial state.
    Parameters,
    /// The missing physics has a name.
    Named,
    /// Two or more kinds explain the recording equally well.
    Family,
    /// Something is missing that nothing in the library explains adequately.
    Unexplained,
}

/// What the recording shows that the simulation does not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Explanation {
    /// `innovant-explanation/1`.
    pub format: String,
    /// The answer's kind.
    pub verdict: Verdict,
    /// Probability that the answer is right, calibrated on recordings whose truth was known.
    pub probability: f64,
    /// A few lines for people.
    pub summary: Vec<String>,
    /// What was left out, most important first.
    pub effects: Vec<EffectFound>,
    /// What else was tried, best first.
    pub alternatives: Vec<Alternative>,
    /// What was asked of a plant in equations, in the order of the questions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hypotheses: Vec<HypothesisFound>,
    /// Where recording and simulation differ.
    #[serde(rename = "where")]
    pub location: Location,
    /// How well the outputs are explained, step by step.
    pub fit: FitTable,
    /// Parameters of the simulation that the recording contradicts.
    pub parameters: Vec<ParameterChange>,
    /// Test of all parameters of a plant in equations together, where nothing is missing in it and none differs alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parameters_together: Option<JointTest>,
    /// What the answer still leaves unexplained, with its test.
    pub remaining: Remaining,
    /// The recording that would settle an open question.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub separating_experiment: Option<String>,
    /// How large the effect is.
    pub effect_size: EffectSize,
    /// Smallest effects that this recording could have shown, where nothing was found.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub detectable: Vec<Detectable>,
    /// The noise that was estimated beside the answer.
    pub noise: Vec<NoiseFound>,
    /// The missing static law as the recording shows it, without a form assumed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<Curve>,
    /// The augmented model, ready to simulate; absent where the simulation is a plant in equations.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<AugmentedModel>,
    /// The plant in equations with what was left out, ready to simulate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plant: Option<AugmentedPlant>,
    /// Signals for pictures, thinned out.
    pub signals: Vec<SignalTraces>,
    /// The recordings.
    pub recordings: Vec<Recording>,
    /// Version of innovant.
    pub version: String,
}

/// An effect that was left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EffectFound {
    /// Id: `coulomb_friction`.
    pub effect: String,
    /// True where it is a hypothesis of the user, whose name stands in the place of the id.
    #[serde(default, skip_serializing_if = "is_false")]
    pub hypothesis: bool,
    /// Which form of it, where there are several.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub variant: String,
    /// The channel it belongs to.
    pub signal: String,
    /// Where it acts: `input`, `force`, `sensor`, `path`, or `process` where it is the plant itself.
    pub port: String,
    /// The law; of a plant in equations the changed equation, in its own language.
    pub equation: String,
    /// Of a plant in equations: the variable whose equation is changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enters: Option<String>,
    /// Of a plant in equations: the variables that the change is a function of.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub depends: Vec<String>,
    /// The change as a curve of one variable, where it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<Law>,
    /// Its numbers.
    pub parameters: BTreeMap<String, Quantity>,
    /// What speaks for it.
    pub evidence: Evidence,
    /// In plain words.
    pub sentence: String,
}

/// What is added to the right-hand side of an equation, over the values that a variable had.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Law {
    /// The variable.
    pub variable: String,
    /// Its values.
    pub at: Vec<f64>,
    /// What is added there.
    pub value: Vec<f64>,
    /// Standard deviation, given the form.
    pub std: Vec<f64>,
}

/// A plant in equations with what was left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AugmentedPlant {
    /// Flat Modelica with the changes and the estimated values.
    pub modelica: String,
    /// How its inputs behave between samples.
    pub hold: String,
    /// Its inputs as the recordings call them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inputs: Vec<Channel>,
    /// Its outputs as the recordings call them.
    pub outputs: Vec<Channel>,
    /// Equations that reproduce the simulated outputs, where only these were given: its parameters are those of the simulation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulation: Option<String>,
    /// Its last inputs, which are the outputs of the simulation, where only these were given and sensors are explained.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub simulated_inputs: Vec<String>,
    /// Parameters that say when something has changed. Another recording comes after that.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub times_of_change: Vec<String>,
}

/// A number with its uncertainty and unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Quantity {
    /// Value.
    pub value: f64,
    /// Standard deviation; absent where the recording does not determine one.
    pub std: Option<f64>,
    /// Unit, empty when unknown or a pure number.
    pub unit: String,
}

/// What speaks for an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Evidence {
    /// Decrease of Schwarz's criterion against the best explanation without it.
    pub criterion_gain: f64,
    /// What is needed of it, given how much was tried.
    pub criterion_needed: f64,
    /// Decrease of twice the negative log likelihood on blocks that were not fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heldout_gain: Option<f64>,
    /// Its parameters in the first and in the second half of the recording agree: `|difference|/std`, the largest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub halves_disagree: Option<f64>,
}

/// A rival of the answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Alternative {
    /// Id.
    pub effect: String,
    /// Its gain in Schwarz's criterion, as a share of the answer's.
    pub support: f64,
    /// Its gain in Schwarz's criterion.
    pub criterion_gain: f64,
    /// Why it lost.
    pub why_not: String,
}

/// What recordings say about a hypothesis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum HypothesisVerdict {
    /// It is the answer, or a part of it.
    Best,
    /// It explains the recording, and something else does as well.
    Supported,
    /// Something else explains the recording better, or nothing is missing where it enters.
    NotSupported,
    /// Within its bounds it makes nothing better, or the plant with it cannot be simulated.
    Refused,
}

/// A hypothesis of the user about a plant in equations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HypothesisFound {
    /// Its name.
    pub name: String,
    /// As it was written.
    pub text: String,
    /// What the recordings say.
    pub verdict: HypothesisVerdict,
    /// Gain in Schwarz's criterion over the plant without it; absent where the plant with it cannot be simulated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// Its gain beside the effects that are named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_beside: Option<f64>,
    /// The gain that is needed.
    pub gain_needed: f64,
    /// The changed equation, in the language of the plant.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub equation: String,
    /// Its new parameters.
    pub parameters: BTreeMap<String, Quantity>,
    /// What explains the recording as well or better, best first.
    pub rivals: Vec<HypothesisRival>,
    /// Free run without and with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit: Option<HypothesisFit>,
    /// In plain words.
    pub sentence: String,
}

/// What explains a recording as well as a hypothesis, or better.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HypothesisRival {
    /// Id, or the name of another hypothesis.
    pub effect: String,
    /// Its gain in Schwarz's criterion.
    pub gain: f64,
    /// The changed equation.
    pub equation: String,
}

/// Free run of the output that the answer shows most, on the samples that were fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HypothesisFit {
    /// The output.
    pub output: String,
    /// With estimated parameters and initial states only.
    pub parameters_only: FitFigure,
    /// With the hypothesis, and what was named before it.
    pub with_hypothesis: FitFigure,
}

/// Where recording and simulation differ.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Location {
    /// Outputs that differ beyond noise.
    pub outputs: Vec<String>,
    /// Where in the loop: `input`, `inside`, `output`, `disturbance`.
    pub port: Option<String>,
    /// Recordings (counted from 0) in which the effect acts, where it does not act in all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<usize>,
    /// Windows `[from s, to s, strength]`, strongest first; empty means throughout.
    pub time: Vec<[f64; 3]>,
    /// Bands `[from Hz, to Hz, excess over noise in dB]`.
    pub frequency: Vec<[f64; 3]>,
    /// Operating regions in which the difference is larger than elsewhere.
    pub regime: Vec<Regime>,
    /// Where in the equations of a simulator that has them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equations: Option<EquationMap>,
}

/// For every place in the equations and every variable the strongest score test, before anything was added.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EquationMap {
    /// Equations, inputs, parameters and sensors.
    pub places: Vec<String>,
    /// Variables, differences and products of them, and `time`.
    pub variables: Vec<String>,
    /// Part of what the simulator leaves, whitened, that the best term of this variable at this place would take off: a row for
    /// each place, a column for each variable; null where no term was tested.
    pub share: Vec<Vec<Option<f64>>>,
    /// The same by chance: the largest of all tests stays below it with 99 % probability.
    pub significant: f64,
}

/// An operating region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Regime {
    /// What varies: a channel, `|u1|`, `d/dt y1`.
    pub variable: String,
    /// From this value ...
    pub from: f64,
    /// ... to this.
    pub to: f64,
    /// Mean square difference here over that elsewhere.
    pub excess: f64,
    /// Probability of as much by chance, all regions considered.
    pub p_value: f64,
}

/// A static law as the recording shows it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Curve {
    /// What it is a function of.
    pub variable: String,
    /// What it gives, in words with unit.
    pub force: String,
    /// Values of the variable.
    pub at: Vec<f64>,
    /// The law there.
    pub value: Vec<f64>,
    /// Its standard deviation.
    pub std: Vec<f64>,
    /// The law that was fitted, for comparison.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fitted: Vec<f64>,
    /// Known shapes that it resembles, with the correlation.
    pub resembles: Vec<(String, f64)>,
}

/// Values of which those that are missing are `null`.
fn with_missing<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
    let values = Vec::<Option<f64>>::deserialize(from)?;
    Ok(values.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect())
}

/// Signals of one output of one recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SignalTraces {
    /// The output.
    pub output: String,
    /// Unit.
    pub unit: String,
    /// Which recording, from 0.
    pub recording: usize,
    /// Time of each point in seconds.
    pub time: Vec<f64>,
    /// As recorded; `null` in a document and NaN here where it was not.
    #[serde(deserialize_with = "with_missing")]
    #[schemars(with = "Vec<Option<f64>>")]
    pub recorded: Vec<f64>,
    /// The simulation as it was given.
    pub simulated: Vec<f64>,
    /// With other parameters only.
    pub parameters_only: Vec<f64>,
    /// With what was found.
    pub augmented: Vec<f64>,
    /// Spectra of what is left, `[Hz, dB before, dB after]`.
    pub spectrum: Vec<[f64; 3]>,
}

/// What an effect in a model looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SignalReference {
    /// An output is the position.
    Output(usize),
    /// An output is the rate.
    Integral(usize),
    /// Position of one output relative to another.
    Difference(usize, usize),
}

/// One effect in a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ModelEffect {
    /// Id.
    pub effect: String,
    /// Which form of it.
    #[serde(default)]
    pub variant: String,
    /// Index of the input or output it belongs to.
    pub channel: usize,
    /// What a force looks at.
    pub looks_at: SignalReference,
    /// Direction through which a force enters, amplitude included.
    #[serde(default)]
    pub direction: Vec<f64>,
    /// Shape parameters in the library's order.
    pub parameters: Vec<f64>,
    /// Residues of a mode, or the column of a missing path.
    #[serde(default)]
    pub coefficients: Vec<f64>,
}

/// A plant with effects: `x+ = A x + B u_eff + sum b_i f_i`, `y = sensor(C x + D u_eff)`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AugmentedModel {
    /// Sample time in seconds.
    pub sample_time: f64,
    /// Inputs.
    pub inputs: Vec<Channel>,
    /// Delay of each input in samples.
    pub input_delays: Vec<usize>,
    /// The last column of `B` and `D` belongs to the constant 1.
    pub constant_input: bool,
    /// Outputs.
    pub outputs: Vec<Channel>,
    /// State matrix.
    #[serde(rename = "A")]
    pub a: Rows,
    /// Input matrix.
    #[serde(rename = "B")]
    pub b: Rows,
    /// Output matrix.
    #[serde(rename = "C")]
    pub c: Rows,
    /// Feedthrough.
    #[serde(rename = "D")]
    pub d: Rows,
    /// State at the beginning of each recording.
    pub initial_states: Vec<Vec<f64>>,
    /// Effects; those that the simulation knew already come first.
    pub effects: Vec<ModelEffect>,
    /// Steps of the recursion in a sample interval.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub substeps: usize,
    /// The same plant as an equation of motion, where it is a mass that the input moves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mechanics: Option<Mechanics>,
    /// What stood for a simulator that is known by its outputs alone: its answer to a new input is corrected by the
    /// difference of the two models.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<Box<AugmentedModel>>,
}

/// A mass that the input moves: `u = mass a + viscous_friction v + constant_force [+ stiffness x] + effects`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mechanics {
    /// What the output is: `position` or `velocity`.
    pub reading: String,
    /// Mass, or inertia of a rotating drive: input over acceleration.
    pub mass: Quantity,
    /// Viscous friction: input over velocity.
    pub viscous_friction: Quantity,
    /// Force that acts all the time, against the input.
    pub constant_force: Quantity,
    /// Stiffness of a spring to the position 0, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<Quantity>,
    /// Length of the windows that the equation was averaged over, in seconds.
    pub window: f64,
    /// In words.
    pub sentence: String,
}
