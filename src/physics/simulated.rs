//! What the estimator needs of what it estimates: a plant in equations, or an external simulator.

use std::sync::Arc;

use super::external::ExternalError;
use super::simulation::{
    Direction, Excitation, Observer, Plan, Plant, Point, SimulationError, Trajectory,
};
use super::spec::ModelSpec;

/// One run: values, inputs, and for predictions from sample to sample an observer.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// Parameters and initial states.
    pub point: &'a Point,
    /// Inputs and time.
    pub excitation: Excitation<'a>,
    /// For predictions instead of a free run.
    pub observer: Option<Observer<'a>>,
    /// Steps and ramps of an earlier run.
    pub plan: &'a Plan,
}

/// Derivatives of the outputs of one run: for each output a column for each direction.
pub type Slopes = Vec<Vec<Vec<f64>>>;

/// Why there is no answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The equations cannot be simulated.
    #[error(transparent)]
    Equations(#[from] SimulationError),
    /// The external simulator failed.
    #[error(transparent)]
    External(#[from] Box<ExternalError>),
}

/// What can be estimated from recordings.
pub trait Simulated: Send + Sync {
    /// Inputs, outputs, states and parameters, with names, units and bounds.
    fn spec(&self) -> &ModelSpec;

    /// The values that the estimation starts from.
    fn nominal(&self) -> Point;

    /// Initial states at `point`.
    fn start(&self, point: &Point) -> Vec<f64>;

    /// A first run of the values that the estimation starts from.
    ///
    /// # Errors
    /// When these values cannot be simulated.
    fn first_run(&self, point: &Point, excitation: &Excitation) -> Result<Trajectory, RunError>;

    /// The steps of that run, for later ones to begin with; empty where it has none.
    fn plan(&self, point: &Point, excitation: &Excitation) -> Plan {
        let run = self.first_run(point, excitation);
        run.map(|t| t.plan).unwrap_or_default()
    }

    /// The answers of several runs, in their order.
    ///
    /// # Errors
    /// When one of them has no answer.
    fn run(&self, runs: &[Run]) -> Result<Vec<Trajectory>, RunError>;

    /// The derivatives of the answers of several runs; none where there are none.
    fn slopes(&self, runs: &[Run], directions: &[Direction]) -> Option<Vec<Slopes>>;

    /// The same along runs whose states are known, approximately and at less cost; none where there is no such way.
    fn frozen_slopes(
        &self,
        _runs: &[Run],
        _states: &[Vec<Vec<f64>>],
        _directions: &[Direction],
    ) -> Option<Vec<Slopes>> {
        None
    }

    /// The same, simulated only as accurately as a search needs.
    fn for_search(&self) -> Arc<dyn Simulated>;

    /// The equations, where there are any: the innovation form needs them.
    fn equations(&self) -> Option<&Plant> {
        None
    }

    /// Whether one run takes so long that few starts are tried.
    fn costly(&self) -> bool {
        false
    }

    /// Why the estimation must end, whatever else could be tried.
    fn stopped(&self) -> Option<RunError> {
        None
    }
}

/// Error of a step while parameters are sought: residuals are larger by orders of magnitude than what adds up from it.
const SEARCH_ACCURACY: f64 = 1e-7;

impl Simulated for Plant {
    fn spec(&self) -> &ModelSpec {
        &self.spec
    }

    fn nominal(&self) -> Point {
        Plant::nominal(self)
    }

    fn start(&self, point: &Point) -> Vec<f64> {
        Plant::start(self, point)
    }

    fn first_run(&self, point: &Point, excitation: &Excitation) -> Result<Trajectory, RunError> {
        Ok(self.simulate(point, excitation, None)?)
    }

    fn run(&self, runs: &[Run]) -> Result<Vec<Trajectory>, RunError> {
        runs.iter()
            .map(|r| Ok(self.simulate_as(r.point, &r.excitation, r.observer.as_ref(), r.plan)?))
            .collect()
    }

    fn slopes(&self, runs: &[Run], directions: &[Direction]) -> Option<Vec<Slopes>> {
        let of_run = |r: &Run| {
            self.sensitivities(
                r.point,
                &r.excitation,
                r.observer.as_ref(),
                r.plan,
                directions,
            )
        };
        Some(runs.iter().map(of_run).collect())
    }

    fn frozen_slopes(
        &self,
        runs: &[Run],
        states: &[Vec<Vec<f64>>],
        directions: &[Direction],
    ) -> Option<Vec<Slopes>> {
        let of_run = |(r, states): (&Run, &Vec<Vec<f64>>)| {
            self.frozen_sensitivities(
                r.point,
                &r.excitation,
                r.observer.as_ref(),
                r.plan,
                states,
                directions,
            )
        };
        runs.iter().zip(states).map(of_run).collect()
    }

    fn for_search(&self) -> Arc<dyn Simulated> {
        Arc::new(
            self.clone()
                .with_accuracy(self.accuracy.max(SEARCH_ACCURACY)),
        )
    }

    fn equations(&self) -> Option<&Plant> {
        Some(self)
    }
}
