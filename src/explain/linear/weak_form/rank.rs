//! Which law: all of them, each with and without a spring, by Schwarz's criterion with as many windows as are
//! independent.

use super::correlated_regression::Regression;
use super::equation_of_motion::Equation;
use super::laws::Form;
use super::windows::Windows;
use crate::explain::effects::Definition;
use crate::explain::linear::data::Data;

/// An equation with its fit.
#[derive(Debug, Clone)]
pub(crate) struct Candidate {
    pub(crate) equation: Equation,
    pub(crate) regression: Regression,
    /// Schwarz's criterion, smaller is better.
    pub(crate) criterion: f64,
}

/// Neighbours of a grid of shapes are about this factor apart.
const GRID: f64 = 2.0;
/// Cogging pitches and load times lie closer.
const FINE_GRID: f64 = 1.06;

/// All equations with one law more than `base`, and `base` itself, best first. `independent` is the number of
/// independent windows; without it that of the best one.
pub(crate) fn rank(
    windows: &Windows,
    data: &Data,
    base: &Equation,
    forms: &[Form],
    independent: Option<f64>,
) -> Vec<Candidate> {
    let mut found: Vec<Candidate> = Vec::new();
    let mut add = |equation: Equation| {
        if let Some(regression) = equation.fit(windows, data, true)
            && equation.is_physical(&regression)
        {
            found.push(Candidate {
                equation,
                regression,
                criterion: 0.0,
            });
        }
    };
    let start = data.segments[0].start_time;
    let springs: &[bool] = match (base.spring, base.reading) {
        (true, _) => &[true],
        (false, super::windows::Reading::Velocity) => &[false],
        (false, super::windows::Reading::Position) => &[false, true],
    };
    for &spring in springs {
        let plain = Equation {
            spring,
            ..base.clone()
        };
        add(plain.clone());
        for form in forms {
            let best = form
                .shapes(windows, start, data.sample_time)
                .into_iter()
                .filter_map(|shape| {
                    let mut equation = plain.clone();
                    equation.laws.push((*form, shape));
                    let regression = equation.fit(windows, data, true)?;
                    equation
                        .is_physical(&regression)
                        .then_some((regression.motion_squares(), equation))
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, equation)) = best {
                let width = if form.owed() > 1 { FINE_GRID } else { GRID };
                add(equation.refined(windows, data, width));
            }
        }
    }
    let criterion = |c: &Candidate, n: f64| {
        n * (c.regression.motion_squares() / windows.places.len() as f64)
            .max(1e-300)
            .ln()
            + c.equation.owed(&c.regression) * n.max(2.0).ln()
    };
    let white = windows.places.len() as f64;
    let n = independent.unwrap_or_else(|| {
        found
            .iter()
            .min_by(|a, b| criterion(a, white).total_cmp(&criterion(b, white)))
            .map_or(white, |c| c.regression.effective())
    });
    for candidate in &mut found {
        candidate.criterion = criterion(candidate, n);
    }
    found.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    found
}

/// The best candidate with exactly `laws` laws.
pub(crate) fn best_of(candidates: &[Candidate], laws: usize) -> Option<&Candidate> {
    candidates.iter().find(|c| c.equation.laws.len() == laws)
}

/// The law that a candidate has more than its base.
pub(crate) fn last_law(candidate: &Candidate) -> Option<&'static Definition> {
    candidate
        .equation
        .laws
        .last()
        .map(|(form, _)| form.definition)
}
