//! Which parts of a cascade recordings ask for.
//!
//! Any greedy path to a cascade passes through models that are worse than a linear one (the root alone, either
//! overflow alone), so the full class is fitted first, from the grid; the others start from it with parts taken away.
//! Parts are chosen by Schwarz's criterion with white errors. Errors of a grey box are not white: [`CascadeFit`]
//! carries the number of samples that are worth as much as independent ones, by which all losses can be shrunk.

use nalgebra::DMatrix;

use super::applies::View;
use super::fit_cascade::{Problem, Trial};
use super::starting_values::BELOW_UPPER_RIM;
use super::{Cascade, Law, NUMBERS, Number, Parts};

/// More of the variance than this left: whatever made the recordings, it was not mainly this.
const UNEXPLAINED: f64 = 0.5;
/// Starts of the full class from the grid, and of every other.
const STARTS: usize = 6;
const FEWER_STARTS: usize = 2;
/// Share of the time below the upper rim at a second start of the full class.
const OFTEN_FULL: f64 = 0.5;
/// Steps by which starts are told apart, and steps to arrive.
const SCOUT: usize = 12;
const ARRIVE: usize = 80;
/// Errors below this share of the mean level are rounding.
const ROUNDING: f64 = 1e-9;

/// By how much the criterion worsens when a part is left out and everything else adapts. Zero for a part that is not in
/// the fit. `outflow` compares with the same tanks whose outflow is proportional, and can be negative.
#[cfg_attr(
    not(test),
    expect(dead_code, reason = "the tests ask what each part is worth")
)]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Losses {
    pub(crate) outflow: f64,
    /// Both rims.
    pub(crate) overflow: f64,
    pub(crate) upper_overflow: f64,
    /// Not a part, but which tank is which: the same class with the slower tank at the other place. Small where both
    /// answers explain the recordings; infinite where there is no second one.
    pub(crate) exchange: f64,
}

/// The cascade that recordings ask for.
#[cfg_attr(
    not(test),
    expect(dead_code, reason = "the tests ask what each part is worth")
)]
#[derive(Debug, Clone)]
pub(crate) struct CascadeFit {
    pub(crate) cascade: Cascade,
    /// Standard deviations of its numbers: white errors, then widened by `count / effective`. Infinite where the
    /// recordings say nothing, zero for numbers that are absent.
    pub(crate) deviations: [f64; NUMBERS],
    /// Levels at the first sample of each record.
    pub(crate) initial: Vec<[f64; 2]>,
    /// Root mean square of the residual over the samples that count.
    pub(crate) error: f64,
    /// Samples that count.
    pub(crate) count: usize,
    /// Free numbers, the initial levels of each record among them.
    pub(crate) free: usize,
    pub(crate) losses: Losses,
}

/// Fits cascades to records `(input, output)`; `mask` says which samples count. `None` when they cannot come from tanks, or
/// when those with every part leave a mean square error above `most`. Takes time in proportion to the samples.
pub(crate) fn fit(
    records: &[(&[f64], &[f64])],
    mask: &[Vec<bool>],
    most: f64,
) -> Option<CascadeFit> {
    let view = View { records, mask };
    let pump_bias = view.applies()?;
    let (unit_u, unit_y) = view.units()?;
    let scaled = |values: &[f64], unit: f64| values.iter().map(|v| v / unit).collect::<Vec<f64>>();
    let problem = Problem {
        records: records
            .iter()
            .map(|(u, y)| (scaled(u, unit_u), scaled(y, unit_y)))
            .collect(),
        mask: mask.to_vec(),
        count: view.counted().count(),
    };
    let (best, losses) = select(&problem, pump_bias, most / (unit_y * unit_y))?;
    let fit = CascadeFit::new(&problem, best, losses, (unit_u, unit_y), records);
    let mean = view.counted().map(|(_, y)| y).sum::<f64>() / fit.count as f64;
    let variance = view.counted().map(|(_, y)| (y - mean).powi(2)).sum::<f64>() / fit.count as f64;
    (fit.error.powi(2) < UNEXPLAINED * variance).then_some(fit)
}

/// Schwarz's criterion.
fn criterion(problem: &Problem, trial: &Trial) -> f64 {
    let n = problem.count as f64;
    n * (trial.cost / n).max(ROUNDING * ROUNDING).ln() + trial.free() as f64 * n.ln()
}

fn refine(problem: &Problem, trial: Trial, steps: usize) -> Trial {
    let searched = trial.searched();
    problem.refine(trial, &searched, steps)
}

/// The best of the starts, of which the better two arrive, and of the best with its tanks exchanged.
fn arrive(problem: &Problem, starts: Vec<Trial>) -> Option<Trial> {
    let by_cost = |a: &Trial, b: &Trial| a.cost.total_cmp(&b.cost);
    let mut scouts: Vec<Trial> = starts
        .into_iter()
        .map(|t| refine(problem, t, SCOUT))
        .collect();
    scouts.sort_by(by_cost);
    let best = scouts
        .into_iter()
        .take(2)
        .map(|t| refine(problem, t, ARRIVE))
        .min_by(by_cost)?;
    let other = refine(problem, problem.exchanged(&best), ARRIVE);
    Some(if other.cost < best.cost { other } else { best })
}

/// The best with its tanks exchanged, or none if the exchange does not last.
fn exchanged(problem: &Problem, best: &Trial) -> Option<Trial> {
    let other = refine(problem, problem.exchanged(best), ARRIVE);
    let slower = |t: &Trial| {
        let [upper, lower] = problem.times(t);
        upper - lower
    };
    let kept = slower(best) * slower(&other) > 0.0;
    (!kept).then_some(other)
}

/// All classes of outflow by the root, fullest first, and what is needed of those with linear outflow. `None` when the fullest
/// leaves a mean square error above `most`.
fn select(problem: &Problem, pump_bias: bool, most: f64) -> Option<(Trial, Losses)> {
    let grid = problem.grid(Law::Root, pump_bias);
    let mut classes: Vec<Parts> = (0..8_u8)
        .map(|bits| Parts {
            law: Law::Root,
            upper_overflow: bits & 1 != 0,
            lower_overflow: bits & 2 != 0,
            constant_inflow: bits & 4 != 0,
            pump_bias,
        })
        .collect();
    classes.sort_by_key(|p| std::cmp::Reverse(Number::ALL.iter().filter(|n| p.has(**n)).count()));
    let mut fits: Vec<Trial> = Vec::with_capacity(classes.len());
    for parts in classes {
        let from_grid = if fits.is_empty() {
            STARTS
        } else {
            FEWER_STARTS
        };
        let mut starts: Vec<Trial> = grid
            .iter()
            .take(from_grid)
            .map(|t| problem.furnished(t, parts, BELOW_UPPER_RIM))
            .collect();
        if fits.is_empty() {
            // A tank that is full most of the time is not found from one that seldom is.
            starts.extend(
                grid.iter()
                    .take(from_grid)
                    .map(|t| problem.furnished(t, parts, OFTEN_FULL)),
            );
        }
        let fuller = fits.iter().filter(|f| parts.within(f.cascade.parts));
        starts.extend(fuller.map(|f| problem.furnished(f, parts, BELOW_UPPER_RIM)));
        fits.extend(arrive(problem, starts));
        // What the fullest class cannot do, no other can.
        if fits.first()?.cost > most * problem.count as f64 {
            return None;
        }
    }
    // What a class can do, every fuller one can.
    for i in (0..fits.len()).rev() {
        let parts = fits[i].cascade.parts;
        let smaller = fits
            .iter()
            .filter(|f| f.cascade.parts.within(parts) && f.cost < fits[i].cost);
        let starts: Vec<Trial> = smaller
            .map(|f| problem.furnished(f, parts, BELOW_UPPER_RIM))
            .collect();
        if let Some(better) = arrive(problem, starts).filter(|t| t.cost < fits[i].cost) {
            fits[i] = better;
        }
    }
    let least = |keep: &dyn Fn(Parts) -> bool, fits: &[Trial]| {
        let kept = fits.iter().filter(|f| keep(f.cascade.parts));
        kept.map(|f| criterion(problem, f))
            .fold(f64::INFINITY, f64::min)
    };
    let best = fits
        .iter()
        .min_by(|a, b| criterion(problem, a).total_cmp(&criterion(problem, b)))?
        .clone();
    let own = criterion(problem, &best);
    let linear = linear_outflow(problem, best.cascade.parts);
    let losses = Losses {
        outflow: least(&|_| true, &linear) - own,
        overflow: least(&|p| !p.upper_overflow && !p.lower_overflow, &fits) - own,
        upper_overflow: least(&|p| !p.upper_overflow, &fits) - own,
        exchange: exchanged(problem, &best).map_or(f64::INFINITY, |t| criterion(problem, &t)) - own,
    };
    Some((best, losses))
}

/// Tanks with linear outflow: with everything, with the parts of the best, and without rims.
fn linear_outflow(problem: &Problem, best: Parts) -> Vec<Trial> {
    let grid = problem.grid(Law::Linear, best.pump_bias);
    let own = Parts {
        law: Law::Linear,
        ..best
    };
    let plain = Parts {
        upper_overflow: false,
        lower_overflow: false,
        constant_inflow: true,
        ..own
    };
    let full = Parts {
        upper_overflow: true,
        lower_overflow: true,
        ..plain
    };
    let mut fits: Vec<Trial> = Vec::with_capacity(3);
    for parts in [full, own, plain] {
        let mut starts: Vec<Trial> = grid
            .iter()
            .take(STARTS / 2)
            .map(|t| problem.furnished(t, parts, BELOW_UPPER_RIM))
            .collect();
        starts.extend(
            fits.iter()
                .map(|f| problem.furnished(f, parts, BELOW_UPPER_RIM)),
        );
        fits.extend(arrive(problem, starts));
    }
    fits
}

impl CascadeFit {
    fn new(
        problem: &Problem,
        best: Trial,
        losses: Losses,
        units: (f64, f64),
        records: &[(&[f64], &[f64])],
    ) -> Self {
        let mut cascade = best.cascade.rescaled(units.0, units.1);
        for number in Number::ALL.into_iter().filter(|n| !cascade.parts.has(*n)) {
            cascade.numbers[number as usize] = 0.0;
        }
        let initial: Vec<[f64; 2]> = best
            .initial
            .iter()
            .map(|x| x.map(|x| x * units.1))
            .collect();
        let levels: Vec<Vec<[f64; 2]>> = records
            .iter()
            .zip(&initial)
            .map(|((u, _), x)| cascade.levels(u, *x))
            .collect();
        let simulated: Vec<Vec<f64>> = levels
            .iter()
            .map(|x| x.iter().map(|x| x[1]).collect())
            .collect();
        let residual: Vec<Vec<f64>> = records
            .iter()
            .zip(&simulated)
            .map(|((_, y), s)| y.iter().zip(s).map(|(y, s)| y - s).collect())
            .collect();
        let n = problem.count as f64;
        let effective = effective(&residual, &problem.mask);
        let variance = best.cost / effective.max(1.0);
        let mut deviations = [0.0; NUMBERS];
        let relative = deviations_of(problem, &best, variance);
        for (number, relative) in best.searched().into_iter().zip(relative) {
            // Units act on a deviation as they do on the number.
            let mut carrier = best.cascade;
            let sign = if number.positive() {
                best.cascade.number(number)
            } else {
                1.0
            };
            carrier.set(number, relative * sign);
            deviations[number as usize] = carrier.rescaled(units.0, units.1).number(number);
        }
        let error = (best.cost / n).sqrt() * units.1;
        Self {
            cascade,
            deviations,
            initial,
            error,
            count: problem.count,
            free: best.free(),
            losses,
        }
    }
}

/// Standard deviations of the coordinates of `trial`, for errors of this variance.
fn deviations_of(problem: &Problem, trial: &Trial, variance: f64) -> Vec<f64> {
    let searched = trial.searched();
    let (h, _) = problem.normal(trial, &searched);
    let seen: Vec<usize> = (0..h.nrows()).filter(|i| h[(*i, *i)] > 0.0).collect();
    let scale: Vec<f64> = seen.iter().map(|i| h[(*i, *i)].sqrt()).collect();
    let scaled = DMatrix::from_fn(seen.len(), seen.len(), |i, j| {
        h[(seen[i], seen[j])] / (scale[i] * scale[j])
    });
    let mut deviations = vec![f64::INFINITY; searched.len()];
    if let Some(cholesky) = scaled.cholesky() {
        let inverse = cholesky.inverse();
        for (at, i) in seen
            .iter()
            .enumerate()
            .filter(|(_, i)| **i < searched.len())
        {
            deviations[*i] = (variance * inverse[(at, at)]).sqrt() / scale[at];
        }
    }
    deviations
}

/// Bartlett's `N / sum rho^2`, over lags up to the first whose correlation is within two deviations of none.
fn effective(residual: &[Vec<f64>], mask: &[Vec<bool>]) -> f64 {
    let masked: Vec<Vec<f64>> = residual
        .iter()
        .zip(mask)
        .map(|(r, m)| {
            r.iter()
                .zip(m)
                .map(|(r, keep)| if *keep { *r } else { 0.0 })
                .collect()
        })
        .collect();
    let count = mask.iter().flatten().filter(|keep| **keep).count() as f64;
    let at = |lag: usize| -> f64 {
        masked
            .iter()
            .map(|r| {
                r.iter()
                    .zip(r.iter().skip(lag))
                    .map(|(a, b)| a * b)
                    .sum::<f64>()
            })
            .sum()
    };
    let power = at(0);
    let longest = masked.iter().map(Vec::len).max().unwrap_or(0);
    if power <= 0.0 {
        return count;
    }
    let correlations = (1..longest).map(|lag| at(lag) / power);
    let significant = correlations.take_while(|rho| rho.abs() > 2.0 / count.sqrt());
    count / (1.0 + 2.0 * significant.map(|rho| rho * rho).sum::<f64>())
}
