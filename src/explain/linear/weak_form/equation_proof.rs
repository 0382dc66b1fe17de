//! What the averaged equation proves: its fits, on all windows and on halves.

use super::correlated_regression::Regression;
use super::equation_of_motion::Equation;
use super::tether::{Tethered, tether};
use super::windows::{Reading, Windows};
use crate::explain::effects::Definition;
use crate::explain::linear::data::Data;
use crate::explain::linear::fit::{Fit, Problem};
use crate::explain::linear::screening::output_adequacy::Adequacy;
use crate::explain::linear::search::cross_validation;
use crate::noise::Mask;

/// What the averaged equation adds to a finding.
#[derive(Debug, Clone)]
pub(crate) struct Proof {
    pub(crate) equation: Equation,
    pub(crate) tethered: Tethered,
    /// Decrease of twice the negative log likelihood on held-out windows.
    pub(crate) heldout_gain: Option<f64>,
    /// Largest difference of the law's coefficients between the halves, in standard deviations.
    pub(crate) halves_disagree: Option<f64>,
    pub(crate) adequacy: Option<Adequacy>,
    pub(crate) adequate: bool,
    /// What the little that is left resembles, with its evidence.
    pub(crate) resembles: Option<(&'static Definition, f64)>,
    /// Half length of the windows in samples.
    pub(crate) half: usize,
    /// Whether a spring brings the mass back well within the recording: it is no drive, and its free run forgets.
    pub(crate) is_brought_back: bool,
}

impl Proof {
    /// Root mean square free-run error of each half of the recordings when the other half is fitted; `None` where a half
    /// does not determine the coefficients.
    pub(crate) fn error_across_halves(&self, problem: &Problem) -> Option<f64> {
        let windows = Windows::choose(problem.data, self.equation.reading)?;
        error_across_halves(&self.equation, &windows, problem.data, problem)
    }

    /// Whether any error of a free run adds up: the position of a mass is measured, which no spring brings back.
    pub(crate) fn drifts(&self) -> bool {
        self.equation.reading == Reading::Position && !self.is_brought_back
    }
}

/// Windows that lie inside the samples of `mask`.
pub(crate) fn inside(windows: &Windows, mask: &Mask) -> Windows {
    windows.only(|s, middle| {
        mask[s][middle - windows.half..=middle + windows.half]
            .iter()
            .all(|keep| *keep)
    })
}

/// A fit whose coefficients are tethered to the averaged equation over `mask`.
pub(crate) fn tethered(
    equation: &Equation,
    windows: &Windows,
    data: &Data,
    mask: &Mask,
) -> Option<(Tethered, Regression)> {
    let regression = equation.fit(windows, data, false)?;
    let covariance = regression.covariance();
    let mut fit = tether(
        equation,
        data,
        mask,
        (regression.coefficients.as_slice(), &covariance),
        windows.half,
    )?;
    // What the sensor's noise takes off mass and friction is an error of them as well, of a size that is known.
    for (i, share) in windows.attenuation.into_iter().enumerate() {
        fit.covariance[(i, i)] += (share * fit.coefficients[i]).powi(2);
    }
    Some((fit, regression))
}

pub(crate) fn as_fit(problem: &Problem, equation: &Equation, tethered: &Tethered) -> Option<Fit> {
    let (structure, theta) = equation.structure(
        &tethered.coefficients,
        &tethered.starts,
        problem.data.sample_time,
    )?;
    Fit::at(problem, structure, theta)
}

/// Root mean square free-run error of each half of the recordings when `equation` is fitted to the other.
pub(crate) fn error_across_halves(
    equation: &Equation,
    windows: &Windows,
    data: &Data,
    problem: &Problem,
) -> Option<f64> {
    cross_validation::across_halves(&problem.mask, |own| {
        let (fit, _) = tethered(equation, &inside(windows, own), data, own)?;
        Some(as_fit(problem, equation, &fit)?.residual)
    })
}

/// Largest difference of the laws' coefficients between the halves of the windows, in standard deviations.
pub(crate) fn halves(equation: &Equation, windows: &Windows, data: &Data) -> Option<f64> {
    let n = windows.places.len();
    let middle = windows.places[n / 2];
    let half = |first: bool| {
        equation
            .fit(
                &windows.only(|s, k| ((s, k) < middle) == first),
                data,
                false,
            )
            .map(|r| (r.coefficients.clone(), r.covariance()))
    };
    let ((a, p), (b, q)) = (half(true)?, half(false)?);
    equation
        .places(false)
        .into_iter()
        .flat_map(|(at, count)| at..at + count)
        .map(|i| (a[i] - b[i]).abs() / (p[(i, i)] + q[(i, i)]).max(1e-300).sqrt())
        .reduce(f64::max)
}
