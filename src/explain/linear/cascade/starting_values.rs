//! Starting values come from two formulas, on a grid of the two time constants (in samples): about the mean
//! level, `sqrt` makes a pole at `T = 2 sqrt(x) / coefficient`, and in the mean, what flows in flows out.
//! Overflow must already act in the simulation it starts from, or its gradient is zero: rims start at a quantile of
//! the simulated level, never at its maximum.

use super::fit_cascade::{Problem, Trial};
use super::{Cascade, Law, NUMBERS, Number, Parts};

/// Time constants tried for each tank.
const TIMES: usize = 6;
/// The shortest: what is faster than two samples is passed on within one.
const SHORTEST: f64 = 2.0;
/// The longest, as a share of the longest record: of what is slower, hardly one lag is seen.
const LONGEST: f64 = 0.25;
/// Share of the time below the upper rim at the start. On recorded tanks 0.7 to 0.95 served alike.
pub(super) const BELOW_UPPER_RIM: f64 = 0.85;
/// The same of the lower rim, whose level is recorded: a tank that overflows less than this says little about it.
const BELOW_LOWER_RIM: f64 = 0.97;
/// Share of the overflow that reaches the lower tank at the start: anything between its bounds.
const SHARE: f64 = 0.3;

impl Problem {
    /// Cascades without rims on the grid of time constants, the best first.
    pub(crate) fn grid(&self, law: Law, pump_bias: bool) -> Vec<Trial> {
        let parts = Parts {
            law,
            upper_overflow: false,
            lower_overflow: false,
            constant_inflow: false,
            pump_bias,
        };
        let lowest = self
            .records
            .iter()
            .flat_map(|(u, _)| u)
            .fold(0.0_f64, |a, u| a.min(*u));
        // The pump still runs a little at the lowest input, or its gradient is zero.
        let stop = if pump_bias { lowest - 0.1 } else { 0.0 };
        let flow = self.mean(|u, _| u - stop);
        let level = match law {
            Law::Root => self.mean(|_, y| y.max(0.0).sqrt()),
            Law::Linear => self.mean(|_, y| y),
        };
        let longest = self.records.iter().map(|(u, _)| u.len()).max().unwrap_or(0) as f64 * LONGEST;
        let ratio = (longest / SHORTEST).max(2.0).powf(1.0 / (TIMES - 1) as f64);
        let times: Vec<f64> = (0..TIMES)
            .map(|i| SHORTEST * ratio.powi(i as i32))
            .collect();
        let mut trials = Vec::with_capacity(TIMES * TIMES);
        for upper in &times {
            for lower in &times {
                let mut cascade = Cascade {
                    parts,
                    numbers: [0.0; NUMBERS],
                };
                // Mean flow through both tanks, in units of the output a sample.
                let (d, through) = match law {
                    Law::Root => (2.0 * level / lower, 2.0 * level * level / lower),
                    Law::Linear => (1.0 / lower, level / lower),
                };
                let a = match law {
                    Law::Root => (2.0 * through / upper).sqrt(),
                    Law::Linear => 1.0 / upper,
                };
                let ratio = match law {
                    Law::Root => (d / a).powi(2),
                    Law::Linear => d / a,
                };
                cascade.set(Number::Pump, through / flow);
                cascade.set(Number::Bias, -stop * through / flow);
                cascade.set(Number::UpperOutflow, a);
                cascade.set(Number::LowerOutflow, d);
                let initial = self.first_outputs().map(|y| [ratio * y, y]).collect();
                trials.push(self.priced(Trial {
                    cascade,
                    initial,
                    cost: f64::INFINITY,
                }));
            }
        }
        trials.retain(|t| t.cost.is_finite());
        trials.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        trials
    }

    /// `trial` with other parts: those that are new get starting values.
    pub(crate) fn furnished(&self, trial: &Trial, parts: Parts, below_upper_rim: f64) -> Trial {
        let mut next = trial.clone();
        let before = trial.cascade.parts;
        if parts.upper_overflow && !before.upper_overflow {
            let runs = self.records.iter().zip(&trial.initial);
            let levels = runs
                .flat_map(|((u, _), x)| trial.cascade.levels(u, *x))
                .map(|x| x[0]);
            next.cascade.set(
                Number::UpperRim,
                quantile(levels.collect(), below_upper_rim),
            );
            next.cascade.set(Number::Share, SHARE);
        }
        if parts.lower_overflow && !before.lower_overflow {
            next.cascade.set(
                Number::LowerRim,
                quantile(self.outputs().collect(), BELOW_LOWER_RIM),
            );
        }
        if parts.constant_inflow && !before.constant_inflow {
            next.cascade.set(Number::Inflow, 0.0);
        }
        next.cascade.parts = parts;
        self.priced(next)
    }

    /// Mean time constants of both tanks, in samples.
    pub(crate) fn times(&self, trial: &Trial) -> [f64; 2] {
        let cascade = &trial.cascade;
        let speed = [
            cascade.number(Number::UpperOutflow),
            cascade.number(Number::LowerOutflow),
        ];
        let (mut roots, mut n) = ([0.0; 2], 0.0);
        for ((u, _), x) in self.records.iter().zip(&trial.initial) {
            cascade.walk(&cascade.numbers, u, *x, |x| {
                roots = [
                    roots[0] + x[0].max(0.0).sqrt(),
                    roots[1] + x[1].max(0.0).sqrt(),
                ];
                n += 1.0;
            });
        }
        match cascade.parts.law {
            Law::Root => [0, 1].map(|i| 2.0 * roots[i] / n / speed[i]),
            Law::Linear => speed.map(|s| 1.0 / s),
        }
    }

    /// The tanks exchanged: about the mean levels, the response of the output to small flows is the same, so there
    /// is an optimum on either side. With `f = T2 / T1`, flows scale by `f` and the upper level by `f^2`.
    pub(crate) fn exchanged(&self, trial: &Trial) -> Trial {
        let [upper, lower] = self.times(trial);
        let f = lower / upper;
        let mut next = trial.clone();
        for number in [
            Number::Pump,
            Number::LowerOutflow,
            Number::Inflow,
            Number::Bias,
        ] {
            next.cascade.set(number, f * trial.cascade.number(number));
        }
        next.cascade.set(
            Number::UpperRim,
            f * f * trial.cascade.number(Number::UpperRim),
        );
        if trial.cascade.parts.law == Law::Linear {
            next.cascade.set(
                Number::UpperOutflow,
                trial.cascade.number(Number::UpperOutflow) / f,
            );
        }
        for x in &mut next.initial {
            x[0] *= f * f;
        }
        self.priced(next)
    }

    /// First output that counts in each record, as far as a level can have it.
    fn first_outputs(&self) -> impl Iterator<Item = f64> {
        self.records.iter().zip(&self.mask).map(|((_, y), mask)| {
            y.iter()
                .zip(mask)
                .find_map(|(y, keep)| keep.then_some(y.max(0.0)))
                .unwrap_or(0.0)
        })
    }

    fn outputs(&self) -> impl Iterator<Item = f64> {
        self.counted().map(|(_, y)| y)
    }

    fn counted(&self) -> impl Iterator<Item = (f64, f64)> {
        self.records
            .iter()
            .zip(&self.mask)
            .flat_map(|((u, y), mask)| {
                u.iter()
                    .zip(y)
                    .zip(mask)
                    .filter_map(|((u, y), keep)| keep.then_some((*u, *y)))
            })
    }

    fn mean(&self, of: impl Fn(f64, f64) -> f64) -> f64 {
        self.counted().map(|(u, y)| of(u, y)).sum::<f64>() / self.count.max(1) as f64
    }
}

/// The value below which this share of the values lies; positive, as levels are.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    let last = values.len().saturating_sub(1);
    let at = (share * last as f64) as usize;
    if values.is_empty() {
        return 1.0;
    }
    let (_, value, _) = values.select_nth_unstable_by(at, f64::total_cmp);
    value.max(1e-6)
}
