//! The order of a recording that no linear model explains: by free runs on blocks held out.
//!
//! A recording with little noise of a plant that is not linear has no linear order: every further state follows the
//! nonlinear part of the motion a little better, and the evidence for it is beyond doubt, because noise is what
//! evidence is measured against. The singular values then hardly end, and a test against noise accepts nothing. What a
//! linear model can give there is the best linear approximation of the plant, and how good it is shows in free run, on
//! a part of the recording that it was not estimated from:
//!
//! - every order is estimated with several past windows, in full, as the final model would be: which model one step
//!   ahead is best says little about the free run where the plant is not linear;
//! - each is estimated again without each of some blocks, and run freely over that block, from the state that fits
//!   best a stretch before it;
//! - the order is the smallest whose mean square error is within one standard error (over the blocks) of the best
//!   (Breiman et al. 1984, *Classification and Regression Trees*, section 3.4.3). Only stable models take part.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::evidence;
use super::order_candidate::{Candidate, polish_is_used};
use super::select_order::{Selection, Windowed, select, windowed};
use crate::identify::data::Source;
use crate::identify::polish::{Effort, polish, stabilised};
use crate::identify::stable::largest_stable_radius;
use crate::identify::subspace::{Weight, decompose, varx};
use crate::identify::{IdentifyError, Options, Order, horizon};
use crate::linalg::spectral_radius;
use crate::model::{StateSpace, estimate_initial_state};
use crate::moments::{Gram, LagAccumulator, LagMoments, PanelQr, RFactor, Trend, Welch};

/// Orders that are run: what a plant that is not linear asks for beyond these is a nonlinear model.
const ORDERS: std::ops::RangeInclusive<usize> = 1..=8;
/// Past windows that are tried beside the one chosen, which is cut to the first of them: the estimate weighs frequencies
/// by what it predicts one step ahead, and that depends on the window.
const WINDOWS: [usize; 3] = [60, 40, 20];
/// From this proposal of the singular values on the free run is asked at once: plants of so many states are rare, and
/// plants that are not linear are not.
const MANY: usize = 15;
/// The free run overrules the singular values where it asks for this share of their order at most; else they were
/// right.
const FEW: f64 = 0.5;
/// Blocks that are held out one after the other: enough for a standard error.
const BLOCKS: usize = 8;
/// Samples of a block at least, in past windows: a shorter one is mostly its beginning.
const SHORTEST_BLOCK: usize = 2;
/// Samples that are run, at most.
const LONGEST_RUN: usize = 200_000;
/// Models whose error over all the data is this many times the smallest one (mean squares) are not looked at again.
const HOPELESS: f64 = 4.0;

/// What a linear model cannot hold of an output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FreeRunRest {
    /// Name of the output.
    pub output: String,
    /// Root mean square error of the free run on blocks held out, as a share of that of the output.
    pub share: f64,
    /// From where to where nine tenths of its power lie, in hertz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub band_hz: Option<[f64; 2]>,
}

/// What the free runs lead to.
pub(crate) struct FreeRun {
    /// Data of the window.
    pub(crate) windowed: Windowed,
    /// The order, with the sentence why.
    pub(crate) selection: Selection,
    /// Whether the model had to be made stable to be run.
    pub(crate) unstable: bool,
    /// What the model does not hold.
    pub(crate) rest: Vec<FreeRunRest>,
}

/// Whether the singular values ask for so many states that the plant is hardly linear.
///
/// # Errors
/// When the decomposition fails.
pub(crate) fn many_states(windowed: &Windowed, options: &Options) -> Result<bool, IdentifyError> {
    Ok(matches!(options.order, Order::Auto) && proposal(windowed, options)? >= MANY)
}

/// An order with a window.
struct Contender {
    windowed: Windowed,
    selection: Selection,
    polished: bool,
    system: StateSpace,
    unstable: bool,
}

/// Error of a contender on the blocks held out.
struct HeldOut {
    /// Mean square of each block, in scaled units, summed over the outputs.
    blocks: Vec<f64>,
    /// The errors themselves: one series an output.
    errors: Vec<Vec<f64>>,
}

impl HeldOut {
    fn mean(&self) -> f64 {
        self.blocks.iter().sum::<f64>() / self.blocks.len() as f64
    }

    fn standard_error(&self) -> f64 {
        let (n, mean) = (self.blocks.len() as f64, self.mean());
        let squares: f64 = self.blocks.iter().map(|b| (b - mean).powi(2)).sum();
        (squares / (n * (n - 1.0))).sqrt()
    }
}

/// The order by free run; `None` when the recording is too short for blocks, when no model can be run, or when the free
/// run asks for about as many states as the singular values.
///
/// # Errors
/// When reading the recordings again fails, or memory does not allow a window.
pub(crate) fn by_free_run(
    chosen: &Windowed,
    source: &mut Source<'_>,
    options: &Options,
) -> Result<Option<FreeRun>, IdentifyError> {
    let proposal = proposal(chosen, options)?;
    let blocks = Blocks::read(source)?;
    let shortest = blocks.shortest();
    let windows: Vec<usize> = match options.past {
        Some(past) => vec![past],
        None => {
            let longest = chosen.factor.past.min(WINDOWS[0]);
            let shorter = WINDOWS.into_iter().filter(|w| *w < longest);
            [longest].into_iter().chain(shorter).collect()
        }
    };
    let contenders = contenders(&windows, source, options)?;
    let runs: Vec<f64> = contenders
        .par_iter()
        .map(|c| {
            let all = (0..blocks.all.len()).map(|b| blocks.run(&c.system, b).0);
            all.sum::<f64>()
        })
        .collect();
    let least = runs.iter().copied().fold(f64::INFINITY, f64::min);
    let contenders: Vec<Contender> = contenders
        .into_iter()
        .zip(runs)
        .filter(|(c, error)| {
            *error <= HOPELESS * least && shortest >= SHORTEST_BLOCK * c.windowed.factor.past
        })
        .map(|(c, _)| c)
        .collect();
    let parts: Vec<(usize, Vec<Option<RFactor>>)> = windows
        .iter()
        .map(|past| (*past, blocks.factors(*past, source.sizes().inputs)))
        .collect();
    let held_out: Vec<Option<HeldOut>> = contenders
        .par_iter()
        .map(|c| {
            let past = c.windowed.factor.past;
            let of_window = parts.iter().find(|(window, _)| *window == past)?;
            blocks.held_out(c, &of_window.1)
        })
        .collect();
    // The best window of each order, by order.
    let mut best: Vec<(Contender, HeldOut)> = Vec::new();
    for (contender, found) in contenders.into_iter().zip(held_out) {
        let Some(found) = found else { continue };
        let order = contender.selection.candidate.order;
        match best
            .iter_mut()
            .find(|(c, _)| c.selection.candidate.order == order)
        {
            Some(known) if known.1.mean() <= found.mean() => {}
            Some(known) => *known = (contender, found),
            None => best.push((contender, found)),
        }
    }
    best.sort_by_key(|(c, _)| c.selection.candidate.order);
    let Some((_, least)) = best.iter().min_by(|a, b| a.1.mean().total_cmp(&b.1.mean())) else {
        return Ok(None);
    };
    let bound = least.mean() + least.standard_error();
    let outputs = blocks.outputs() as f64;
    let percent = |mean: f64| 100.0 * (mean / outputs).sqrt();
    let table: Vec<String> = best
        .iter()
        .map(|(c, held)| {
            format!(
                "{}: {:.3} %",
                c.selection.candidate.order,
                percent(held.mean())
            )
        })
        .collect();
    let Some(place) = best.iter().position(|(_, held)| held.mean() <= bound) else {
        return Ok(None);
    };
    let (contender, held) = best.swap_remove(place);
    let mut selection = contender.selection;
    let order = selection.candidate.order;
    if proposal >= MANY && order as f64 > FEW * proposal as f64 {
        return Ok(None);
    }
    selection.explanation = format!(
        "order {order}: no linear model of few states explains the recording, so the free run on {} blocks held out \
         decides: the smallest order within one standard error of the best (rms error by order: {})",
        blocks.all.len(),
        table.join(", ")
    );
    Ok(Some(FreeRun {
        rest: blocks.rest(&held, source),
        windowed: contender.windowed,
        selection,
        unstable: contender.unstable,
    }))
}

/// Every order with every window, as it would become the final model, made stable.
fn contenders(
    windows: &[usize],
    source: &mut Source<'_>,
    options: &Options,
) -> Result<Vec<Contender>, IdentifyError> {
    let mut out = Vec::new();
    for past in windows {
        let windowed = windowed(source, *past, options)?;
        for order in ORDERS {
            let fixed = Options {
                order: Order::Fixed(order),
                past: Some(*past),
                ..options.clone()
            };
            let selection = match select(&windowed, &fixed, source) {
                Ok(selection) => selection,
                Err(error @ IdentifyError::Limit(_)) => return Err(error),
                // More states than this window shows.
                Err(_) => break,
            };
            let polished = polish_is_used(options, &selection.candidate);
            let Candidate {
                polished: at_end,
                estimate,
                ..
            } = &selection.candidate;
            let system = match at_end {
                Some(at_end) if polished => &at_end.system,
                _ => &estimate.system,
            };
            let radius = largest_stable_radius(windowed.varx.columns);
            let unstable = spectral_radius(&system.a)? > radius;
            let system = match unstable {
                false => system.clone(),
                true => match stabilised(system, &windowed.varx) {
                    Ok(stable) => stable.system,
                    Err(_) => continue,
                },
            };
            out.push(Contender {
                windowed: Windowed {
                    factor: windowed.factor.clone(),
                    varx: windowed.varx.clone(),
                },
                selection,
                polished,
                system,
                unstable,
            });
        }
    }
    Ok(out)
}

/// The order that the singular value criterion proposes.
fn proposal(windowed: &Windowed, options: &Options) -> Result<usize, IdentifyError> {
    let Windowed { factor, varx } = windowed;
    let largest = evidence::LARGEST_AUTOMATIC_ORDER;
    let future = options
        .future
        .unwrap_or_else(|| horizon::future_for_order_choice(factor.past, factor.outputs, largest))
        .min(factor.past);
    let canonical = decompose(factor, varx, future, Weight::Cva)?;
    let correlations =
        evidence::canonical_correlations(&canonical.svd.singular_values, factor.columns);
    let possible = canonical.svd.largest_order().min(future * factor.outputs);
    let evidence = evidence::singular_value_criterion(
        &correlations,
        factor.inputs,
        factor.outputs,
        factor.columns,
        possible.min(largest),
    );
    Ok(evidence::proposal(&evidence).unwrap_or(1))
}

/// The recordings in scaled units, cut into blocks of about equal length.
struct Blocks {
    /// One an experiment, one column a channel.
    signals: Vec<Vec<Vec<f64>>>,
    inputs: usize,
    /// Experiment, first sample, sample after the last.
    all: Vec<(usize, usize, usize)>,
}

impl Blocks {
    fn read(source: &mut Source<'_>) -> Result<Self, IdentifyError> {
        let mut signals = Vec::new();
        for experiment in 0..source.experiments() {
            signals.push(source.first_signals(experiment, LONGEST_RUN)?);
        }
        let total: usize = signals.iter().map(|s| s[0].len()).sum();
        let mut all = Vec::new();
        for (experiment, columns) in signals.iter().enumerate() {
            let samples = columns[0].len();
            let count = (BLOCKS * samples).div_ceil(total.max(1)).max(1);
            let at = |i: usize| i * samples / count;
            all.extend((0..count).map(|i| (experiment, at(i), at(i + 1))));
        }
        Ok(Self {
            signals,
            inputs: source.sizes().inputs,
            all,
        })
    }

    fn outputs(&self) -> usize {
        self.signals[0].len() - self.inputs
    }

    fn shortest(&self) -> usize {
        self.all.iter().map(|b| b.2 - b.1).min().unwrap_or(0)
    }

    /// The data factor without each block; `None` where it cannot be made.
    fn factors(&self, past: usize, inputs: usize) -> Vec<Option<RFactor>> {
        let q = self.signals[0].len();
        let scale = vec![1.0; q];
        let zero = Trend::zero(q);
        let slices = |experiment: usize, from: usize, to: usize| -> Vec<&[f64]> {
            let columns = &self.signals[experiment];
            columns.iter().map(|c| &c[from..to]).collect()
        };
        let moments = |experiment, from, to| -> LagMoments {
            let mut accumulator = LagAccumulator::new(q, past);
            accumulator.push(&slices(experiment, from, to));
            accumulator.moments()
        };
        let grams: Vec<Gram> = self
            .all
            .iter()
            .map(|&(e, from, to)| moments(e, from, to).gram(past, &zero))
            .collect();
        (0..self.all.len())
            .into_par_iter()
            .map(|left_out| {
                let mut sum = Gram::empty((past + 1) * q);
                let others = || (0..self.all.len()).filter(|i| *i != left_out);
                for i in others() {
                    sum.add(&grams[i]);
                }
                if let Ok(factor) = RFactor::from_gram(&sum, inputs, &scale) {
                    return Some(factor);
                }
                let mut panels = PanelQr::new(past, &scale);
                for i in others() {
                    let (experiment, from, to) = self.all[i];
                    panels.start_experiment(&zero);
                    panels.push(&slices(experiment, from, to));
                }
                let (r, columns) = panels.finish();
                (columns > 0).then(|| RFactor::from_panels(r, columns, inputs, &scale))
            })
            .collect()
    }

    /// Mean square and series of the error of a free run over a block. The state at its beginning is that which fits
    /// best the stretch before it, or the block itself where nothing is before it.
    fn run(&self, system: &StateSpace, block: usize) -> (f64, Vec<Vec<f64>>) {
        let (experiment, from, to) = self.all[block];
        let columns = &self.signals[experiment];
        let lead = from.min(to - from);
        let cut = |from: usize, to: usize| -> (Vec<&[f64]>, Vec<&[f64]>) {
            let part: Vec<&[f64]> = columns.iter().map(|c| &c[from..to]).collect();
            (part[..self.inputs].to_vec(), part[self.inputs..].to_vec())
        };
        let mut quiet = system.clone();
        quiet.k.fill(0.0);
        let (u, y) = cut(from - lead, to);
        let (head_u, head_y) = match lead {
            0 => (u.clone(), y.clone()),
            some => cut(from - lead, from - lead + some),
        };
        let simulated = estimate_initial_state(&quiet, &head_u, &head_y, None)
            .and_then(|state| quiet.simulate(&u, Some(&state)));
        let Ok(simulated) = simulated else {
            return (f64::INFINITY, Vec::new());
        };
        let errors: Vec<Vec<f64>> = simulated
            .iter()
            .zip(&y)
            .map(|(s, y)| {
                s[lead..]
                    .iter()
                    .zip(&y[lead..])
                    .map(|(s, y)| y - s)
                    .collect()
            })
            .collect();
        let sum: f64 = errors.iter().flatten().map(|e| e * e).sum();
        let mean = sum / (to - from).max(1) as f64;
        (if mean.is_nan() { f64::INFINITY } else { mean }, errors)
    }

    /// The contender estimated again without each block and run over it; `None` where that cannot be done.
    fn held_out(&self, contender: &Contender, parts: &[Option<RFactor>]) -> Option<HeldOut> {
        let mut found = HeldOut {
            blocks: Vec::new(),
            errors: vec![Vec::new(); self.outputs()],
        };
        for (block, part) in parts.iter().enumerate() {
            let part = part.as_ref()?;
            let system = if contender.polished || contender.unstable {
                let varx = varx(part, contender.windowed.varx.feedthrough).ok()?;
                let radius = largest_stable_radius(varx.columns);
                let inside = Some(radius);
                // From the end on all data it is not far.
                polish(&contender.system, &varx, inside, Effort::Referee)
                    .ok()?
                    .system
            } else {
                let estimate = &contender.selection.candidate.estimate;
                estimate.uncertain.replicate(part).ok()?
            };
            let (mean, errors) = self.run(&system, block);
            if !mean.is_finite() {
                return None;
            }
            found.blocks.push(mean);
            for (all, errors) in found.errors.iter_mut().zip(errors) {
                all.extend(errors);
            }
        }
        (found.blocks.len() > 1).then_some(found)
    }

    /// What the free run leaves of each output, and at which frequencies.
    fn rest(&self, held: &HeldOut, source: &Source<'_>) -> Vec<FreeRunRest> {
        let names = source.output_names();
        names
            .into_iter()
            .zip(&held.errors)
            .enumerate()
            .map(|(o, (output, errors))| {
                let all = || self.signals.iter().flat_map(|s| &s[self.inputs + o]);
                let n = all().count().max(1) as f64;
                let mean = all().sum::<f64>() / n;
                let variance = all().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
                let square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64;
                let mut spectrum = Welch::default();
                spectrum.push(errors);
                spectrum.end();
                FreeRunRest {
                    output,
                    share: (square / variance.max(f64::MIN_POSITIVE)).sqrt(),
                    band_hz: spectrum.excitation(source.sample_time()).map(|e| e.band),
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use crate::identify::{Options, identify};
    use crate::log::{Channel, Log};

    /// The Bouc-Wen benchmark (Noel & Schoukens 2016): mass, spring and hysteresis, random-phase multisine of 5 to 150
    /// Hz and 50 N, sampled at 750 Hz; integrated at 15 kHz.
    fn bouc_wen(seed: u64, samples: usize) -> Log {
        const FINER: usize = 20;
        let rate = 750.0 * FINER as f64;
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let lines: Vec<(f64, f64)> = (55..1638)
            .map(|k| {
                let phase = random.random::<f64>() * std::f64::consts::TAU;
                (std::f64::consts::TAU * f64::from(k) * 750.0 / 8192.0, phase)
            })
            .collect();
        let amplitude = 50.0 * (2.0 / lines.len() as f64).sqrt();
        // Held between the samples: the sum of all lines is dear.
        let force: Vec<f64> = (0..samples)
            .map(|k| {
                let t = k as f64 / 750.0;
                let sum: f64 = lines.iter().map(|(w, phase)| (w * t + phase).cos()).sum();
                amplitude * sum
            })
            .collect();
        let slope = |[x, v, z]: [f64; 3], u: f64| {
            let hysteresis = 5e4 * v - 1e3 * (0.8 * v.abs() * z - 1.1 * v * z.abs());
            [v, (u - 10.0 * v - 5e4 * x - z) / 2.0, hysteresis]
        };
        let mut state = [0.0; 3];
        let mut y = Vec::with_capacity(samples);
        for u in &force {
            y.push(state[0] * 1e3 + 0.008 * (random.random::<f64>() - 0.5) * 12_f64.sqrt());
            for _ in 0..FINER {
                let h = 1.0 / rate;
                let ahead = |d: [f64; 3], h: f64| {
                    [
                        state[0] + h * d[0],
                        state[1] + h * d[1],
                        state[2] + h * d[2],
                    ]
                };
                let first = slope(state, *u);
                let second = slope(ahead(first, h / 2.0), *u);
                let third = slope(ahead(second, h / 2.0), *u);
                let fourth = slope(ahead(third, h), *u);
                for i in 0..3 {
                    state[i] += h / 6.0 * (first[i] + 2.0 * (second[i] + third[i]) + fourth[i]);
                }
            }
        }
        Log {
            name: "hysteresis".to_owned(),
            sample_time: 1.0 / 750.0,
            start_time: 0.0,
            inputs: vec![Channel::new("force")],
            outputs: vec![Channel::new("displacement")],
            input_data: vec![force],
            output_data: vec![y],
            sha256: None,
        }
    }

    /// The free run on another recording is as good as that of a linear model can be, and the report says what is left.
    #[test]
    fn hysteresis_has_the_order_of_its_best_linear_model() {
        let model = identify(&[bouc_wen(1, 12_000)], &Options::default()).unwrap();
        assert!((2..=5).contains(&model.system.states()), "{model}");
        let fresh = bouc_wen(2, 6_000);
        let (u, y) = (&fresh.input_data[0], &fresh.output_data[0]);
        let start = model.initial_state_of(&[u], &[y]).unwrap();
        let run = model.simulate(&[u], Some(&start)).unwrap();
        let error: f64 = run[0].iter().zip(y).map(|(a, b)| (a - b).powi(2)).sum();
        let size: f64 = y.iter().map(|v| v * v).sum();
        let fit = 100.0 * (1.0 - (error / size).sqrt());
        assert!(fit > 65.0, "{fit} {model}");
        let summary = model.summary.unwrap();
        let rest = &summary.diagnostics.free_run_rest[0];
        assert!((0.15..0.4).contains(&rest.share), "{rest:?}");
        assert!(rest.band_hz.is_some_and(|[from, to]| from < to));
        assert!(summary.warnings.iter().any(|w| w.contains("does not hold")));
    }
}
