//! Hypotheses fitted as the library's terms are, from a few starts.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::{Change, Hypothesis, NewNumber};
use crate::explain::engine::fitting::candidate::Candidate;
use crate::explain::engine::fitting::edit::{Place, literal, sensors};
use crate::explain::engine::fitting::fitted::{Fitted, TIE, forms, with_more};
use crate::explain::engine::screening::along::along;
use crate::explain::engine::screening::screen::Lead;
use crate::explain::engine::terms::term::{Needs, Port, Term};
use crate::explain::engine::thresholds::{GLANCE, NEEDED, ROUNDS, SECOND, SURE, THOROUGH};
use crate::physics::Plant;
use crate::physics::estimate::{EstimateOptions, Fit, PlantRecording, Study};

/// Starts of a hypothesis that are looked at.
const STARTS: usize = 24;
/// ... and the best of them, which are fitted with a noise model of their own.
const FITTED: usize = 2;
/// Penalty for a parameter whose start was searched, as for the shapes of the library's terms.
const SEARCHED: f64 = 2.0;

/// What a hypothesis stands for among the library's terms.
const fn term(port: Port) -> Term {
    Term {
        id: "hypothesis",
        port,
        needs: Needs::Time,
        form: "",
        memories: &[],
        shapes: &[],
        free_strength: true,
        symbol: "",
        units: &[],
    }
}

static AT_EQUATION: Term = term(Port::Equation);
static AT_INPUT: Term = term(Port::Input);
static AT_SENSOR: Term = term(Port::Sensor);
static AT_PARAMETER: Term = term(Port::Parameter);

/// A plant, its fit, and the fits whose noise models a search starts from.
pub(crate) struct Ground<'a> {
    pub(crate) plant: &'a Plant,
    pub(crate) study: &'a Study<'a>,
    pub(crate) fit: &'a Fit,
    pub(crate) origins: Vec<&'a Fit>,
    pub(crate) recordings: &'a [PlantRecording],
    pub(crate) options: &'a EstimateOptions,
}

/// What the recordings say about a hypothesis.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trial {
    /// Added to the plant of the text; none where that cannot be simulated.
    pub(crate) alone: Option<Fitted>,
    /// Its gain beside the effects that were named.
    pub(crate) beside: Option<f64>,
    /// The step in which it was accepted.
    pub(crate) accepted: Option<usize>,
}

/// Fits the hypotheses that are not yet part of the plant; those that were fitted alone before also from there.
pub(crate) fn trials(all: &[Hypothesis], before: &[Trial], ground: &Ground) -> Vec<Fitted> {
    (all.par_iter().zip(before).enumerate())
        .filter(|(_, (_, trial))| trial.accepted.is_none())
        .filter_map(|(which, (hypothesis, trial))| {
            hypothesis.fitted(which, trial.alone.as_ref(), ground)
        })
        .collect()
}

/// A hypothesis that explains the recording as well as the best comes first: it was known before. What the best is sure of
/// must not be lost by that.
pub(crate) fn prefer_asked(fitted: &mut [Fitted]) {
    let best = fitted.iter().map(|f| f.gain).fold(0.0, f64::max);
    let as_sure = |gain: f64| {
        let thresholds = [NEEDED, SURE, SECOND.0];
        thresholds.iter().all(|t| (best >= *t) == (gain >= *t))
    };
    let asked = |f: &Fitted| f.hypothesis.is_some() && best - f.gain <= TIE.0 && as_sure(f.gain);
    if let Some(at) = fitted.iter().position(asked) {
        fitted[..=at].rotate_right(1);
    }
}

impl Hypothesis {
    fn fitted(&self, which: usize, alone: Option<&Fitted>, ground: &Ground) -> Option<Fitted> {
        let spec = &ground.plant.spec;
        let place = self.place(spec)?;
        let parameters = ground.study.parameters();
        let options = with_more(ground.options, self.numbers.len());
        let (mut starts, searched, range) = self.starts(ground);
        starts.extend(alone.map(|f| f.values().to_vec()));
        let made: Vec<Candidate> = starts
            .iter()
            .filter_map(|values| self.candidate(spec, values).ok())
            .collect();
        let mut glanced: Vec<(usize, f64, &Candidate, Fit)> = ground
            .origins
            .iter()
            .enumerate()
            .flat_map(|(o, from)| made.iter().map(move |m| (o, *from, m)))
            .collect::<Vec<_>>()
            .into_par_iter()
            .filter_map(|(o, from, made)| {
                let study = ground.study.of(&made.plant, &options).ok()?;
                let start = made.from(from, parameters);
                let fit = study.refit(&start, 0, GLANCE)?;
                Some((o, from.deviance - fit.deviance, made, fit))
            })
            .collect();
        glanced.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut chosen = Vec::new();
        for origin in 0..ground.origins.len() {
            chosen.extend(glanced.iter().filter(|g| g.0 == origin).take(FITTED));
        }
        let best = chosen
            .into_par_iter()
            .filter_map(|(_, _, made, from)| {
                let study = ground.study.of(&made.plant, &options).ok()?;
                // As many noise models as a term of the library has: one when it is compared, and those of its last fit.
                let starts = forms(from.clone(), ground.fit, ground.study.gains());
                let fits = starts
                    .iter()
                    .filter_map(|start| study.refit(start, 1 + ROUNDS, THOROUGH));
                let fit = fits.min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
                Some((fit, *made))
            })
            .collect::<Vec<_>>()
            .into_iter()
            .min_by(|a, b| a.0.criterion.total_cmp(&b.0.criterion));
        let (fit, made) = best?;
        let sensor = matches!(place, Place::Equation(at) if sensors(spec).contains(&at));
        let mut lead = Lead::untested(
            match place {
                Place::Equation(_) if sensor => &AT_SENSOR,
                Place::Equation(_) => &AT_EQUATION,
                Place::Input(_) => &AT_INPUT,
                Place::Parameter(_) => &AT_PARAMETER,
            },
            place,
        );
        lead.sensor = sensor;
        Some(Fitted {
            lead,
            argument: String::new(),
            shapes: vec![],
            travel: 0.0,
            usual: 0.0,
            comes_back: true,
            depends: self.depends.clone(),
            range,
            gain: ground.fit.criterion - fit.criterion - searched,
            candidate: made.clone(),
            fit,
            hypothesis: Some(which),
            explains: false,
            proved: false,
            likelier: false,
        })
    }

    /// Names of new parameters that a fit has left at a bound.
    pub(crate) fn at_bounds(&self, values: &[f64]) -> Vec<&NewNumber> {
        let each = self.numbers.iter().zip(values);
        each.filter(|(n, v)| **v <= n.min || **v >= n.max)
            .map(|(n, _)| n)
            .collect()
    }

    /// Values that the search starts from, the penalty for having searched them, and the range of its one variable.
    fn starts(&self, ground: &Ground) -> (Vec<Vec<f64>>, f64, (f64, f64)) {
        let spec = &ground.plant.spec;
        let variables: Vec<&String> = self
            .depends
            .iter()
            .filter(|d| spec.find(d).is_some())
            .collect();
        let texts: Vec<String> = variables.iter().map(|v| (*v).clone()).collect();
        let values =
            (along((ground.study, ground.fit), ground.recordings, &texts)).unwrap_or_default();
        let range = match values.as_slice() {
            [one] => one
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| {
                    (l.min(v), h.max(v))
                }),
            _ => (0.0, 0.0),
        };
        let scales = self.scales(&values, ground.recordings);
        let mut grid: Vec<Vec<f64>> = vec![vec![]];
        let mut searched = 0.0;
        for (i, number) in self.numbers.iter().enumerate() {
            let choices = if let Some(start) = number.start {
                vec![start]
            } else if self.strengths.contains(&i) {
                // Where all strengths are 0 the first step of the fit is the score test of the term.
                vec![number.at(0.0)]
            } else {
                searched += SEARCHED;
                number.choices(&scales)
            };
            grid = grid
                .into_iter()
                .flat_map(|head| {
                    choices.iter().map(move |&v| {
                        let mut whole = head.clone();
                        whole.push(v);
                        whole
                    })
                })
                .collect();
            grid = thinned(grid, 16 * STARTS);
        }
        let mut grid = thinned(grid, STARTS);
        if self.change == Change::Replace {
            self.match_what_stands_there(ground, &mut grid);
        }
        (grid, searched, range)
    }

    /// Magnitudes that a parameter may have beside these values of variables.
    fn scales(&self, values: &[Vec<f64>], recordings: &[PlantRecording]) -> Vec<f64> {
        let mut scales = Vec::new();
        for column in values {
            let mut sorted: Vec<f64> = column.iter().copied().filter(|v| v.is_finite()).collect();
            sorted.sort_by(f64::total_cmp);
            let Some(last) = sorted.len().checked_sub(1) else {
                continue;
            };
            let quantile = |part: f64| sorted[(part * last as f64).round() as usize];
            let size = quantile(0.0).abs().max(quantile(1.0).abs());
            let spread = 0.5 * (quantile(0.84) - quantile(0.16));
            if spread <= 0.0 || !spread.is_finite() {
                continue;
            }
            scales.extend([0.02, 0.2, 1.0].map(|f| f * spread));
            scales.extend([0.15, 0.5, 0.85].map(quantile));
            scales.push(0.7 * size);
            scales.extend([1.0, 4.0].map(|f| f / spread));
        }
        let h = recordings.first().map_or(1.0, |r| r.sample_time);
        if self.depends.iter().any(|d| d == "time") {
            let (begin, end) = PlantRecording::span(recordings);
            let length = (end - begin).max(h);
            scales.extend((1..10).map(|i| begin + 0.1 * f64::from(i) * length));
            scales.extend([1.0, 3.0, 10.0, 30.0].map(|n| std::f64::consts::TAU * n / length));
        }
        if self.expression.contains("delay") {
            scales.extend([1.0, 4.0, 16.0].map(|n| n * h));
        }
        scales.extend([0.5, 2.0]);
        scales
    }

    /// Strengths with which a new right-hand side is as near as possible to the old one.
    fn match_what_stands_there(&self, ground: &Ground, grid: &mut [Vec<f64>]) {
        let spec = &ground.plant.spec;
        let free: Vec<usize> = self
            .strengths
            .iter()
            .copied()
            .filter(|&i| self.numbers[i].start.is_none())
            .collect();
        let Some(old) = self.replaced(spec).filter(|_| !free.is_empty()) else {
            return;
        };
        for values in grid {
            let at = |unit: Option<usize>| {
                self.expression_with(|word| {
                    let i = self.numbers.iter().position(|n| n.name == word)?;
                    let value = if free.contains(&i) {
                        f64::from(u8::from(unit == Some(i)))
                    } else {
                        values[i]
                    };
                    Some(format!("({})", literal(value)))
                })
            };
            let mut texts = vec![old.clone(), at(None)];
            texts.extend(free.iter().map(|&i| at(Some(i))));
            let Some(columns) = along((ground.study, ground.fit), ground.recordings, &texts) else {
                continue;
            };
            let rows: Vec<usize> = (0..columns[0].len())
                .filter(|&k| columns.iter().all(|c| c[k].is_finite()))
                .collect();
            let matrix = DMatrix::from_fn(rows.len(), free.len(), |r, c| {
                columns[c + 2][rows[r]] - columns[1][rows[r]]
            });
            let right = DVector::from_iterator(
                rows.len(),
                rows.iter().map(|&k| columns[0][k] - columns[1][k]),
            );
            if rows.is_empty() {
                continue;
            }
            let parts = matrix.svd(true, true);
            let small = 1e-9 * parts.singular_values.max();
            if let Ok(solved) = parts.solve(&right, small) {
                for (&i, &v) in free.iter().zip(solved.iter()) {
                    if v.is_finite() {
                        values[i] = self.numbers[i].at(v);
                    }
                }
            }
        }
    }
}

impl NewNumber {
    /// Starts within the bounds.
    fn choices(&self, scales: &[f64]) -> Vec<f64> {
        let width = self.max - self.min;
        let mut all: Vec<f64> = if width.is_finite() {
            [0.05, 0.2, 0.4, 0.6, 0.8, 0.95]
                .iter()
                .map(|part| self.min + part * width)
                .collect()
        } else {
            scales
                .iter()
                .copied()
                .filter(|v| *v > self.min && *v < self.max && *v != 0.0)
                .collect()
        };
        if all.is_empty() {
            all.push(self.at(1.0));
        }
        all.sort_by(f64::total_cmp);
        all.dedup_by(|a, b| (*a - *b).abs() <= 1e-3 * b.abs());
        all
    }
}

/// At most so many, evenly chosen; every choice of every parameter is among them in turn.
fn thinned(all: Vec<Vec<f64>>, most: usize) -> Vec<Vec<f64>> {
    if all.len() <= most {
        return all;
    }
    // Steps of the golden section: no parameter is left at one of its choices.
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let mut chosen: Vec<usize> = (0..most)
        .map(|i| ((i as f64 + 0.5) * GOLDEN).fract())
        .map(|part| (part * all.len() as f64) as usize)
        .collect();
    chosen.sort_unstable();
    chosen.dedup();
    chosen.into_iter().map(|i| all[i].clone()).collect()
}
