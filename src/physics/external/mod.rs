//! External simulators: programs and functions whose parameters are estimated although their equations are not known.
//!
//! A simulator answers inputs and parameters with outputs, and nothing else is asked of it. It is run in parallel where it
//! allows that, never twice with the same values on the same recording, and its derivatives are differences of runs.
//!
//! | file | one idea |
//! |---|---|
//! | `mod` | the simulator, and the plant that the estimator sees |
//! | `error` | why a run gave no answer |
//! | `cache` | answers that are known already |
//! | `differences` | derivatives by differences of runs |
//! | `step` | how far a parameter is moved for a difference: rounding and tolerances of the simulator |

mod cache;
mod differences;
mod error;
mod step;

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use self::cache::{Answer, Cache, Key};
use self::step::Steps;
use super::expression::{Expressions, Span};
use super::simulated::{Run, RunError, Simulated, Slopes};
use super::simulation::{Direction, Excitation, Plan, Point, Trajectory};
use super::spec::{ModelSpec, Variable, VariableKind};

pub use error::{ExternalError, Failure};

/// A program or function that simulates.
pub trait ExternalSimulator: Send + Sync {
    /// Outputs, a column each, for inputs and all parameters by name.
    ///
    /// # Errors
    /// Why there is no answer.
    fn simulate(
        &self,
        excitation: &Excitation,
        parameters: &[(String, f64)],
    ) -> Result<Vec<Vec<f64>>, Failure>;

    /// Whether several runs may go on at a time.
    fn parallel(&self) -> bool {
        true
    }
}

/// A parameter of an external simulator.
#[derive(Debug, Clone, PartialEq)]
pub struct ExternalParameter {
    /// Name.
    pub name: String,
    /// Value that the search starts from.
    pub value: f64,
    /// Lower bound; `-inf` where there is none.
    pub min: f64,
    /// Upper bound; `inf` where there is none.
    pub max: f64,
    /// Unit, where stated.
    pub unit: Option<String>,
    /// In words.
    pub description: String,
}

/// How often a simulator was run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RunCount {
    /// Runs.
    pub runs: usize,
    /// Runs that gave no answer.
    pub failed: usize,
    /// The first of them.
    pub first_failure: Option<Box<ExternalError>>,
}

/// An external simulator with its parameters, as the estimator sees it.
#[derive(Clone)]
pub struct ExternalPlant {
    spec: Arc<ModelSpec>,
    nominal: Vec<f64>,
    names: Vec<String>,
    simulator: Arc<dyn ExternalSimulator>,
    state: Arc<Mutex<State>>,
}

/// What is known from the runs so far.
#[derive(Debug, Default)]
struct State {
    cache: Cache,
    count: RunCount,
    /// Whether all recordings have been simulated once with the same values.
    began: bool,
    /// Why nothing is run any more.
    stopped: Option<Box<ExternalError>>,
    steps: Steps,
}

impl fmt::Debug for ExternalPlant {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.debug_struct("ExternalPlant")
            .field("name", &self.spec.name)
            .field("parameters", &self.names)
            .finish_non_exhaustive()
    }
}

impl ExternalPlant {
    /// From a simulator, the names of its inputs and outputs, and its parameters.
    pub fn new(
        name: &str,
        inputs: &[String],
        outputs: &[String],
        parameters: &[ExternalParameter],
        simulator: Arc<dyn ExternalSimulator>,
    ) -> Self {
        let mut variables: Vec<Variable> = parameters.iter().map(declared).collect();
        let channels = inputs.iter().map(|n| (n, VariableKind::Input, false));
        let channels = channels.chain(outputs.iter().map(|n| (n, VariableKind::Algebraic, true)));
        variables.extend(channels.map(|(name, kind, output)| Variable {
            kind,
            output,
            ..blank(name)
        }));
        Self {
            spec: Arc::new(ModelSpec {
                name: name.to_owned(),
                description: String::new(),
                text: String::new(),
                variables,
                expressions: Expressions::default(),
                equations: Vec::new(),
                constants: Vec::new(),
            }),
            nominal: parameters.iter().map(|p| p.value).collect(),
            names: parameters.iter().map(|p| p.name.clone()).collect(),
            simulator,
            state: Arc::default(),
        }
    }

    /// How often the simulator was run.
    pub fn count(&self) -> RunCount {
        self.lock().count.clone()
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // What another thread left half done is only a cache.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Answers to several runs, in their order: those that are known, and the others run in parallel.
    fn answers(&self, runs: &[(Excitation, Vec<f64>)]) -> Vec<Answer> {
        let mut state = self.lock();
        if let Some(error) = &state.stopped {
            return runs.iter().map(|_| Err(error.clone())).collect();
        }
        let keys: Vec<Key> = runs
            .iter()
            .map(|(excitation, values)| state.cache.key(excitation, values))
            .collect();
        let mut found: Vec<Option<Answer>> = keys.iter().map(|k| state.cache.get(k)).collect();
        drop(state);
        let new: Vec<usize> = (0..keys.len())
            .filter(|&i| found[i].is_none() && !keys[..i].contains(&keys[i]))
            .collect();
        let of = |&i: &usize| self.simulate(&runs[i].0, &runs[i].1);
        let answers: Vec<Answer> = if self.simulator.parallel() {
            // One at a time and thread: runs take very different times.
            new.par_iter().with_max_len(1).map(of).collect()
        } else {
            new.iter().map(of).collect()
        };
        let mut state = self.lock();
        for (&i, answer) in new.iter().zip(answers) {
            state.note(&answer);
            state.cache.insert(keys[i].clone(), answer.clone());
            for (found, key) in found.iter_mut().zip(&keys) {
                if *key == keys[i] {
                    *found = Some(answer.clone());
                }
            }
        }
        found.into_iter().flatten().collect()
    }

    fn simulate(&self, excitation: &Excitation, values: &[f64]) -> Answer {
        // A run that is waiting when another one ended everything.
        if let Some(error) = &self.lock().stopped {
            return Err(error.clone());
        }
        let parameters: Vec<(String, f64)> = self
            .names
            .iter()
            .cloned()
            .zip(values.iter().copied())
            .collect();
        let answer = self
            .simulator
            .simulate(excitation, &parameters)
            .and_then(|columns| self.checked(columns, excitation))
            .map_err(|failure| {
                Box::new(ExternalError {
                    failure,
                    parameters,
                })
            });
        if let Err(error) = &answer
            && error.failure.is_final()
        {
            self.lock().stopped.get_or_insert_with(|| error.clone());
        }
        answer.map(Arc::new)
    }

    fn checked(
        &self,
        columns: Vec<Vec<f64>>,
        excitation: &Excitation,
    ) -> Result<Vec<Vec<f64>>, Failure> {
        let outputs = self.spec.outputs();
        if columns.len() != outputs.len() {
            return Err(Failure::Outputs {
                expected: outputs.len(),
                found: columns.len(),
            });
        }
        for (column, &output) in columns.iter().zip(&outputs) {
            if column.len() != excitation.length {
                return Err(Failure::Rows {
                    expected: excitation.length,
                    found: column.len(),
                });
            }
            if let Some(k) = column.iter().position(|v| !v.is_finite()) {
                return Err(Failure::NotANumber {
                    output: self.spec.variable(output).name.clone(),
                    row: k + 1,
                    time: excitation.start_time + k as f64 * excitation.sample_time,
                    text: column[k].to_string(),
                });
            }
        }
        Ok(columns)
    }
}

impl State {
    fn note(&mut self, answer: &Answer) {
        self.count.runs += 1;
        if let Err(error) = answer {
            self.count.failed += 1;
            self.count
                .first_failure
                .get_or_insert_with(|| error.clone());
        }
    }
}

impl Simulated for ExternalPlant {
    fn spec(&self) -> &ModelSpec {
        &self.spec
    }

    fn nominal(&self) -> Point {
        Point {
            parameters: self.nominal.clone(),
            start: Vec::new(),
        }
    }

    fn start(&self, _: &Point) -> Vec<f64> {
        Vec::new()
    }

    fn first_run(&self, point: &Point, excitation: &Excitation) -> Result<Trajectory, RunError> {
        let runs = [(*excitation, point.parameters.clone())];
        let answer = self.answers(&runs).into_iter().next();
        let columns = answer.transpose()?.unwrap_or_default();
        Ok(trajectory(&columns))
    }

    fn plan(&self, _: &Point, _: &Excitation) -> Plan {
        Plan::default()
    }

    fn run(&self, runs: &[Run]) -> Result<Vec<Trajectory>, RunError> {
        let asked: Vec<_> = runs
            .iter()
            .map(|r| (r.excitation, r.point.parameters.clone()))
            .collect();
        let answers: Result<Vec<_>, _> = self.answers(&asked).into_iter().collect();
        let mut state = self.lock();
        match answers {
            Ok(columns) => {
                state.began = true;
                Ok(columns.iter().map(|c| trajectory(c)).collect())
            }
            Err(error) => {
                // Where not even the values that were given can be simulated there is nothing to search from.
                if !state.began {
                    state.stopped.get_or_insert_with(|| error.clone());
                }
                Err(error.into())
            }
        }
    }

    fn slopes(&self, runs: &[Run], directions: &[Direction]) -> Option<Vec<Slopes>> {
        differences::slopes(self, runs, directions)
    }

    fn for_search(&self) -> Arc<dyn Simulated> {
        Arc::new(self.clone())
    }

    fn costly(&self) -> bool {
        true
    }

    fn stopped(&self) -> Option<RunError> {
        self.lock().stopped.clone().map(RunError::External)
    }
}

fn trajectory(columns: &[Vec<f64>]) -> Trajectory {
    Trajectory {
        outputs: columns.to_vec(),
        states: Vec::new(),
        plan: Plan::default(),
    }
}

fn declared(parameter: &ExternalParameter) -> Variable {
    Variable {
        description: parameter.description.clone(),
        unit_text: parameter.unit.clone(),
        min: parameter.min,
        max: parameter.max,
        ..blank(&parameter.name)
    }
}

/// A parameter of this name, of which nothing else is known.
fn blank(name: &str) -> Variable {
    Variable {
        name: name.to_owned(),
        description: String::new(),
        kind: VariableKind::Parameter,
        output: false,
        unit: None,
        unit_text: None,
        min: f64::NEG_INFINITY,
        max: f64::INFINITY,
        nominal: None,
        start: None,
        fixed: false,
        value: None,
        number: None,
        span: Span::default(),
        uncorrected: false,
        starts: Vec::new(),
    }
}
