//! The equations behind columns of simulated outputs, found from recorded inputs and noise-free outputs.
//!
//! A simulator of which only its outputs are known is identified: for every combination of orders the equation of each output
//! is a regression on filtered signals, with nonlinear functions selected one by one or in pairs ([`regression`]; S. L. Brunton,
//! J. L. Proctor and J. N. Kutz, *PNAS* 113, 2016, with integrals in place of derivatives). The equations become a plant
//! ([`chain`]), whose coefficients are fitted to the simulated outputs in free run, and coefficients that change them by less
//! than a hundredth of what the recording differs from the simulation are dropped. What is known of a plant in equations then holds
//! for columns too. What the equations miss of the simulated outputs is subtracted from the recorded ones.
//!
//! What a sensor does to the outputs needs no equations of what is before it ([`simulator_outputs`]).

mod chain;
mod chain_text;
mod column;
mod columns_answer;
mod drop_coefficients;
mod filtered_signals;
mod regression;
mod sharing;
mod simulator_outputs;

pub(crate) use column::Column;
pub(crate) use columns_answer::{doubt_rough, equations, explain_equations, logs_with_recordings};
pub(crate) use simulator_outputs::explain_sensors;

use nalgebra::DMatrix;
use rayon::prelude::*;

use self::chain::Chains;
use self::drop_coefficients::eliminate;
use self::filtered_signals::{Regressors, Signals};
use self::regression::{OutputEquation, output_equation};
use self::sharing::Sharing;
use crate::log::Channel;
use crate::noise::{Noise, Series};
use crate::physics::estimate::{EstimateOptions, Fit, PlantRecording, Study};
use crate::physics::{Hold, Plant, Point, parse};

/// Most states, and most in the chain of one output.
const MOST_STATES: usize = 5;
const MOST_IN_A_CHAIN: usize = 4;
/// Combinations of orders that are simulated, for each number of states.
const SIMULATED: usize = 3;
/// Of equations that leave less than this, relative to the highest derivative, those with the fewest terms come first.
const CLOSE: f64 = 1e-4;
/// Steps a sample that equations may need, on average.
const MOST_STEPS: usize = 20;
/// Equations that leave more of the highest derivative than this are not simulated.
const HOPELESS: f64 = 0.3;
/// A coefficient is dropped where the outputs change by less than this part of what the recording differs by. With equations that
/// reproduce the outputs so well no more states are tried.
const NEGLIGIBLE: f64 = 0.01;
pub(crate) const REPRODUCED: f64 = 0.005;
const EXACT: f64 = 1e-3;
/// A fit is continued where that leaves at most this part of the misfit.
const AGAIN: f64 = 0.7;
/// Equations that miss more of the simulated outputs than this part of what the recording differs by explain nothing.
pub(crate) const USEFUL: f64 = 0.5;

/// Equations in place of columns.
pub(crate) struct Reproduced {
    pub(crate) plant: Plant,
    pub(crate) hold: Hold,
    /// Simulated outputs less those of the equations, a column a recording and output.
    pub(crate) remainder: Series,
    /// Root mean square of the remainder over that of recorded less simulated outputs; of the output where it is largest.
    pub(crate) misfit: f64,
}

/// What simulated outputs are to be compared with.
pub(crate) struct Question<'a> {
    pub(crate) inputs: &'a [Channel],
    pub(crate) outputs: &'a [Channel],
    /// Root mean square of recorded less simulated, of each output.
    pub(crate) difference: &'a [f64],
}

/// Equations that were fitted to the simulated outputs.
struct Fitted {
    chains: Chains,
    plant: Plant,
    fit: Fit,
    misfit: f64,
}

/// Chains with the values of their coefficients and initial states.
struct Valued {
    chains: Chains,
    start: Vec<Vec<f64>>,
}

struct Columns<'a> {
    recordings: &'a [PlantRecording],
    signals: Signals,
    hold: Hold,
    inputs: Vec<Column>,
    outputs: Vec<Column>,
    difference: &'a [f64],
}

/// The equations that reproduce simulated outputs best, with the fewest states; none where no combination of orders can be
/// simulated.
pub(crate) fn reproduce(simulated: &[PlantRecording], question: &Question) -> Option<Reproduced> {
    let named = |all: &[Channel]| all.iter().cloned().map(Column).collect();
    let mut best: Option<(Columns, Fitted)> = None;
    for hold in [Hold::Zero, Hold::Linear] {
        let columns = Columns {
            recordings: simulated,
            signals: Signals::new(simulated, hold)?,
            hold,
            inputs: named(question.inputs),
            outputs: named(question.outputs),
            difference: question.difference,
        };
        if let Some(found) = columns.best()
            && best.as_ref().is_none_or(|(_, b)| found.misfit < b.misfit)
        {
            best = Some((columns, found));
        }
        if best.as_ref().is_some_and(|(_, b)| b.misfit <= REPRODUCED) {
            break;
        }
    }
    let (columns, found) = best?;
    let options = columns.options(&found.plant);
    let study = Study::new(&found.plant, simulated, &options).ok()?;
    let remainder = study.residual(&found.fit)?;
    let chains = columns.with_values(&found, &study)?;
    let shared = columns.shared(&chains, found.misfit);
    shared.or_else(|| {
        Some(Reproduced {
            plant: columns.plant(&chains, None)?,
            hold: columns.hold,
            remainder,
            misfit: found.misfit,
        })
    })
}

impl Columns<'_> {
    fn options(&self, plant: &Plant) -> EstimateOptions {
        EstimateOptions {
            free: vec![true; plant.spec.parameters().len()],
            hold: self.hold,
            form: None,
            least_squares: true,
        }
    }

    /// Tries combinations of orders from few states to many.
    fn best(&self) -> Option<Fitted> {
        let all = combinations(self.signals.outputs);
        // Of each highest order.
        let mut regressors: Vec<Option<Regressors>> = Vec::new();
        let mut best: Option<Fitted> = None;
        for states in 1..=MOST_STATES {
            while regressors.len() < states.min(MOST_IN_A_CHAIN) {
                regressors.push(self.signals.regressors(regressors.len() + 1));
            }
            let of_size = all.par_iter().filter(|o| o.iter().sum::<usize>() == states);
            let mut equations: Vec<(f64, Vec<OutputEquation>)> = of_size
                .filter_map(|orders| {
                    let highest = orders.iter().copied().max()?;
                    let regressors = regressors.get(highest.checked_sub(1)?)?.as_ref()?;
                    let each: Vec<OutputEquation> = (0..orders.len())
                        .map(|j| output_equation(&self.signals, regressors, j, orders))
                        .collect();
                    let worst = each.iter().map(|e| e.error).fold(0.0, f64::max);
                    (worst < HOPELESS).then_some((worst, each))
                })
                .collect();
            let terms = |each: &[OutputEquation]| each.iter().map(|e| e.terms.len()).sum::<usize>();
            equations.sort_by(|a, b| {
                let by_error = a.0.max(CLOSE).total_cmp(&b.0.max(CLOSE));
                by_error.then(terms(&a.1).cmp(&terms(&b.1)))
            });
            for (_, each) in equations.iter().take(SIMULATED) {
                let found = Chains::new(&self.signals, each).and_then(|c| self.fitted(c));
                let Some(found) = found.map(|f| self.reduced(f)) else {
                    continue;
                };
                let better = |b: &Fitted| match b.misfit.max(found.misfit) <= REPRODUCED {
                    true => found.chains.size() < b.chains.size(),
                    false => found.misfit < b.misfit,
                };
                if best.as_ref().is_none_or(better) {
                    best = Some(found);
                }
            }
            if best.as_ref().is_some_and(|b| b.misfit <= REPRODUCED) {
                break;
            }
        }
        best
    }

    /// Fits the coefficients in free run.
    fn fitted(&self, chains: Chains) -> Option<Fitted> {
        let start = self.signals.start(&chains.orders);
        let text = chains.text(&self.signals, &self.inputs, &self.outputs, &start, None);
        let plant = Plant::new(parse(&text).ok()?).with_most_steps(MOST_STEPS);
        let options = self.options(&plant);
        let study = Study::new(&plant, self.recordings, &options).ok()?;
        let mut fit = study.least_squares(&study.nominal())?;
        let mut misfit = self.misfit(&study, &fit)?;
        // The size of what is left changes by orders of magnitude.
        while misfit > EXACT {
            let Some(again) = study.least_squares(&fit.point) else {
                break;
            };
            let less = self.misfit(&study, &again)?;
            if less > AGAIN * misfit {
                break;
            }
            (fit, misfit) = (again, less);
        }
        drop(study);
        Some(Fitted {
            chains,
            plant,
            fit,
            misfit,
        })
    }

    /// The chains and the initial states with what was fitted.
    fn with_values(&self, found: &Fitted, study: &Study) -> Option<Valued> {
        let point = study.points(&found.fit).into_iter().next()?;
        let mut chains = found.chains.clone();
        for (term, value) in chains.terms.iter_mut().zip(&point.parameters) {
            term.value = *value;
        }
        let start = self.started(&chains, &point)?;
        Some(Valued { chains, start })
    }

    /// The initial states of a point: as in the first recording.
    fn started(&self, chains: &Chains, point: &Point) -> Option<Vec<Vec<f64>>> {
        let mut fitted = point.start.iter().map(|s| s.unwrap_or(0.0));
        let mut start = self.signals.start(&chains.orders);
        for state in start.iter_mut().flatten() {
            *state = fitted.next()?;
        }
        Some(start)
    }

    fn plant(&self, valued: &Valued, sharing: Option<&Sharing>) -> Option<Plant> {
        let Valued { chains, start } = valued;
        let (inputs, outputs) = (&self.inputs, &self.outputs);
        let text = chains.text(&self.signals, inputs, outputs, start, sharing);
        Some(Plant::new(parse(&text).ok()?))
    }

    /// The same with one strength for what equations share, if these reproduce the outputs as well then.
    fn shared(&self, valued: &Valued, misfit: f64) -> Option<Reproduced> {
        let mut sharing = valued.chains.sharing(&self.signals)?;
        let plant = self.plant(valued, Some(&sharing))?;
        let plant = plant.with_most_steps(MOST_STEPS);
        let options = self.options(&plant);
        let study = Study::new(&plant, self.recordings, &options).ok()?;
        let fit = study.least_squares(&study.nominal())?;
        let less = self.misfit(&study, &fit)?;
        let point = study.points(&fit).into_iter().next()?;
        let used = sharing.values.iter_mut().filter(|v| **v != 0.0);
        for (value, fitted) in used.zip(&point.parameters) {
            *value = *fitted;
        }
        let fitted = Valued {
            chains: valued.chains.clone(),
            start: self.started(&valued.chains, &point)?,
        };
        if less > misfit.max(REPRODUCED) {
            return None;
        }
        Some(Reproduced {
            plant: self.plant(&fitted, Some(&sharing))?,
            hold: self.hold,
            remainder: study.residual(&fit)?,
            misfit: less,
        })
    }

    fn misfit(&self, study: &Study, fit: &Fit) -> Option<f64> {
        let residual = study.residual(fit)?;
        let outputs = self.difference.len();
        let of = |j: usize| {
            let values = residual.iter().skip(j).step_by(outputs).flatten();
            let (sum, count) = values.fold((0.0, 0), |(s, n), e| (s + e * e, n + 1));
            (sum / f64::from(count.max(1))).sqrt() / self.difference[j]
        };
        let worst = (0..outputs).map(of).fold(0.0, f64::max);
        worst.is_finite().then_some(worst)
    }

    /// Without the coefficients that are of no consequence.
    fn reduced(&self, found: Fitted) -> Fitted {
        let Some(kept) = self.needed(&found) else {
            return found;
        };
        if kept.len() == found.chains.terms.len() {
            return found;
        }
        let terms = kept.iter().map(|&(i, value)| chain::Term {
            value,
            ..found.chains.terms[i]
        });
        let fewer = Chains {
            orders: found.chains.orders.clone(),
            terms: terms.collect(),
        };
        match self.fitted(fewer) {
            Some(fewer) if fewer.misfit <= found.misfit + 2.0 * NEGLIGIBLE => fewer,
            _ => found,
        }
    }

    /// Coefficients that are left, with their values, where those of least consequence are dropped one by one and the others
    /// follow: backward elimination with the derivatives at the fit.
    fn needed(&self, found: &Fitted) -> Option<Vec<(usize, f64)>> {
        let options = self.options(&found.plant);
        let study = Study::new(&found.plant, self.recordings, &options).ok()?;
        let noise = Noise {
            scale: self.difference.to_vec(),
            ..Noise::unit(self.difference.len())
        };
        let at_scale = Fit {
            noise,
            ..found.fit.clone()
        };
        let derivatives = study.derivatives(&at_scale)?;
        let size: Vec<f64> = derivatives
            .column_iter()
            .map(|c| c.norm().max(1e-300))
            .collect();
        let scaled = DMatrix::from_fn(derivatives.nrows(), size.len(), |i, j| {
            derivatives[(i, j)] / size[j]
        });
        let coefficients = found.chains.terms.len();
        let values: Vec<f64> = (0..size.len())
            .map(|i| found.fit.point[i] * size[i])
            .collect();
        let allowed = (NEGLIGIBLE * NEGLIGIBLE * study.count() as f64).min(1.0);
        let kept = eliminate(&scaled.tr_mul(&scaled), &values, allowed, |i| {
            i < coefficients
        })?;
        let kept = kept.into_iter().filter(|(i, _)| *i < coefficients);
        Some(kept.map(|(i, value)| (i, value / size[i])).collect())
    }
}

/// Orders of the outputs, at least one state and at most [`MOST_STATES`] in all.
fn combinations(outputs: usize) -> Vec<Vec<usize>> {
    let mut all = vec![vec![]];
    for _ in 0..outputs {
        let longer = |orders: &Vec<usize>| -> Vec<Vec<usize>> {
            let left = MOST_STATES - orders.iter().sum::<usize>();
            let more = 0..=left.min(MOST_IN_A_CHAIN);
            more.map(|n| [orders.as_slice(), &[n]].concat()).collect()
        };
        all = all.iter().flat_map(longer).collect();
    }
    all.retain(|orders| orders.iter().sum::<usize>() > 0);
    all
}

#[cfg(test)]
pub(super) mod tests;
