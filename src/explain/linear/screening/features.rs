//! Flexible features and learnt static laws: what a residual still holds, without a form assumed.

use nalgebra::{DMatrix, DVector};

use super::score_tests::{Bench, Signals, motions};
use crate::explain::effects;
use crate::explain::linear::data::Series;
use crate::explain::linear::fit::Fit;
use crate::explain::linear::model::functionals::Functionals;
use crate::linalg::multiply_tn;

/// Hats over a value, and over the rate of an input.
const HATS: usize = 8;
const RATE_HATS: usize = 6;
/// Blocks of time.
const BLOCKS: usize = 8;
/// Values that a feature needs, and features that make a test.
const VALUES_A_FEATURE: usize = 4;
const LEAST_FEATURES: usize = 8;
/// Half widths of play, over the size of the signal.
const PLAYS: [f64; 2] = [0.03, 0.2];

impl Bench<'_> {
    /// What a flexible set of features gains: `(gain, what there was, number of features)`. The laws are evaluated along
    /// the motion of `moving`: the basis itself, or the simulation as given where a misfit has taken the motion out of
    /// the basis.
    pub(crate) fn feature_gain(&self, moving: &Fit) -> Option<(f64, f64, usize)> {
        let plant = moving.structure.plant(&moving.theta);
        let signals = motions(self.problem, moving, &plant);
        let rows = Functionals::new(&plant);
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for &input in self
            .basis
            .structure
            .coordinates
            .active_inputs
            .iter()
            .filter(|j| **j < self.problem.data.signals())
        {
            let b = self.plant.b_column(input);
            let mut drives = self.input_drives(input);
            for signal in &signals {
                if rows.sensible(&plant, signal.instance_signal) {
                    drives.extend(self.motion_drives(input, signal));
                }
            }
            columns.extend(
                drives
                    .iter()
                    .map(|drive| self.flatten(&self.response(&b, drive))),
            );
        }
        let l = self.data().outputs;
        for o in 0..l {
            let seen: Vec<Vec<f64>> = moving
                .simulated
                .iter()
                .skip(o)
                .step_by(l)
                .cloned()
                .collect();
            columns.extend(
                self.sensor_drives(&seen)
                    .into_iter()
                    .map(|drive| self.flatten(&self.at_output(o, drive))),
            );
        }
        self.gain_of(&columns)
    }

    /// What a sensor may have added: curves in what it sees, and trends.
    fn sensor_drives(&self, seen: &[Vec<f64>]) -> Vec<Vec<Vec<f64>>> {
        let mut drives = Vec::new();
        for (low, centre, high) in hats(&seen.concat(), HATS) {
            drives.push(self.each(&|s, k| hat(seen[s][k], low, centre, high)));
        }
        for block in 0..=BLOCKS {
            drives.push(self.each(&|s, k| {
                let at = (k * BLOCKS) as f64 / seen[s].len().max(1) as f64;
                hat(at, block as f64 - 1.0, block as f64, block as f64 + 1.0)
            }));
        }
        drives
    }

    /// `drive` (a column a segment) added to output `o`.
    fn at_output(&self, o: usize, drive: Vec<Vec<f64>>) -> Series {
        let l = self.data().outputs;
        drive
            .into_iter()
            .flat_map(|column| {
                let silent = vec![0.0; column.len()];
                let mut outputs = vec![silent; l];
                outputs[o] = column;
                outputs
            })
            .collect()
    }

    fn each(&self, f: &dyn Fn(usize, usize) -> f64) -> Vec<Vec<f64>> {
        self.data()
            .segments
            .iter()
            .enumerate()
            .map(|(s, segment)| (0..segment.samples()).map(|k| f(s, k)).collect())
            .collect()
    }

    /// Drives that an input may have been changed by: curves in its value and its rate, delays, play, time.
    fn input_drives(&self, input: usize) -> Vec<Vec<Vec<f64>>> {
        let data = self.data();
        let u = |s: usize, k: usize| data.segments[s].inputs[input][k];
        let change = |s: usize, k: usize| u(s, k) - u(s, k.saturating_sub(1));
        let mut drives = Vec::new();
        let values = self.each(&u);
        for (low, centre, high) in hats(&values.concat(), HATS) {
            drives.push(self.each(&|s, k| hat(u(s, k), low, centre, high)));
        }
        for (low, centre, high) in hats(&self.each(&change).concat(), RATE_HATS) {
            drives.push(self.each(&|s, k| hat(change(s, k), low, centre, high)));
        }
        for delay in [1usize, 2, 4] {
            drives.push(self.each(&|s, k| u(s, k.saturating_sub(delay)) - u(s, k)));
        }
        drives.extend(plays(&values));
        for block in 0..BLOCKS {
            let inside = |s: usize, k: usize| {
                f64::from(u8::from(
                    k * BLOCKS / data.segments[s].samples().max(1) == block,
                ))
            };
            drives.push(self.each(&inside));
            drives.push(self.each(&|s, k| inside(s, k) * u(s, k)));
        }
        drives
    }

    /// Forces that a motion may have caused: curves in position and rate, products, play.
    fn motion_drives(&self, input: usize, signal: &Signals) -> Vec<Vec<Vec<f64>>> {
        let (x, v) = (&signal.position, &signal.rate);
        let u = |s: usize, k: usize| self.data().segments[s].inputs[input][k];
        let mut drives = Vec::new();
        for values in [x, v] {
            for (low, centre, high) in hats(&values.concat(), HATS) {
                drives.push(self.each(&|s, k| hat(values[s][k], low, centre, high)));
            }
        }
        drives.push(self.each(&|s, k| x[s][k] * u(s, k)));
        drives.push(self.each(&|s, k| x[s][k] * v[s][k]));
        drives.extend(plays(x));
        drives
    }

    /// What `columns` explain of the residual beyond the free numbers.
    fn gain_of(&self, columns: &[Vec<f64>]) -> Option<(f64, f64, usize)> {
        let rows = self.weights.len();
        // A short recording is asked about some of them, from all over.
        let every = (VALUES_A_FEATURE * columns.len())
            .div_ceil(rows.max(1))
            .max(1);
        let columns: Vec<&[f64]> = columns.iter().step_by(every).map(Vec::as_slice).collect();
        let count = columns.len();
        if count < LEAST_FEATURES {
            return None;
        }
        let mut before = Vec::with_capacity(count);
        for column in &columns {
            before.push(column.iter().map(|v| v * v).sum::<f64>().max(1e-300));
        }
        let columns = self.projected(&DMatrix::from_vec(rows, count, columns.concat()));
        let gram = multiply_tn(&columns, &columns);
        let inner = columns.tr_mul(&self.residual);
        // Features that the nuisance or one another explain are no features: keep the directions that stand out.
        let scaled = DMatrix::from_fn(count, count, |i, j| {
            gram[(i, j)] / (before[i] * before[j]).sqrt()
        });
        let right = DVector::from_iterator(count, (0..count).map(|i| inner[i] / before[i].sqrt()));
        let eigen = crate::linalg::symmetric_eigen(&scaled).ok()?;
        let mut gained = 0.0;
        let mut kept = 0;
        let largest = eigen.values.iter().copied().fold(0.0, f64::max);
        for (i, value) in eigen.values.iter().enumerate() {
            if *value > 1e-6 * largest {
                gained += eigen.vectors.column(i).dot(&right).powi(2) / value;
                kept += 1;
            }
        }
        Some((gained, self.left, kept))
    }

    /// A static law of `values` through input `drive`: hats at `knots`, `(gain, coefficients, covariance)`.
    pub(crate) fn static_law(
        &self,
        drive: usize,
        values: &[Vec<f64>],
        knots: &[f64],
    ) -> Option<(f64, DVector<f64>, DMatrix<f64>)> {
        let b = self.plant.b_column(drive);
        let m = knots.len();
        let columns: Vec<Vec<f64>> = (0..m)
            .map(|i| {
                let low = if i == 0 {
                    f64::NEG_INFINITY
                } else {
                    knots[i - 1]
                };
                let high = if i + 1 == m {
                    f64::INFINITY
                } else {
                    knots[i + 1]
                };
                let force: Vec<Vec<f64>> = values
                    .iter()
                    .map(|v| {
                        v.iter()
                            .map(|v| {
                                if (i == 0 && *v <= knots[0]) || (i + 1 == m && *v >= knots[m - 1])
                                {
                                    1.0
                                } else {
                                    hat(
                                        *v,
                                        low.max(knots[0] - 1.0),
                                        knots[i],
                                        high.min(knots[m - 1] + 1.0),
                                    )
                                }
                            })
                            .collect()
                    })
                    .collect();
                self.flatten(&self.response(&b, &force))
            })
            .collect();
        let rows = self.weights.len();
        let raw = DMatrix::from_vec(rows, m, columns.concat());
        let scale = raw
            .column_iter()
            .map(|c| c.norm_squared())
            .fold(0.0, f64::max);
        let columns = self.projected(&raw);
        let mut gram = multiply_tn(&columns, &columns);
        // A ridge far below what the data determine: the straight line belongs to the plant.
        for i in 0..m {
            gram[(i, i)] += 1e-7 * scale;
        }
        let inner = columns.tr_mul(&self.residual);
        let inverse = gram.cholesky()?.inverse();
        let coefficients = &inverse * &inner;
        let gain = coefficients.dot(&inner);
        let variance = (self.left - gain).max(0.0) / (rows as f64 - m as f64).max(1.0);
        gain.is_finite()
            .then(|| (gain, coefficients, inverse * variance))
    }
}

/// Play of some widths: what friction, backlash and hysteresis have in common.
fn plays(values: &[Vec<f64>]) -> Vec<Vec<Vec<f64>>> {
    let size = effects::level(&values.concat(), 0.8, f64::abs);
    PLAYS
        .map(|share| {
            values
                .iter()
                .map(|x| {
                    x.iter()
                        .scan(x.first().copied().unwrap_or(0.0), |held, x| {
                            *held = f64::clamp(*held, x - share * size, x + share * size);
                            Some(*held)
                        })
                        .collect()
                })
                .collect()
        })
        .to_vec()
}

/// Hats over the quantiles of `values`: `(left foot, top, right foot)`.
fn hats(values: &[f64], count: usize) -> Vec<(f64, f64, f64)> {
    let mut knots: Vec<f64> = (0..=count + 1)
        .map(|i| effects::level(values, i as f64 / (count + 1) as f64, |v| v))
        .collect();
    knots.dedup();
    knots.windows(3).map(|w| (w[0], w[1], w[2])).collect()
}

fn hat(v: f64, low: f64, centre: f64, high: f64) -> f64 {
    if v <= low || v >= high {
        0.0
    } else if v <= centre {
        (v - low) / (centre - low)
    } else {
        (high - v) / (high - centre)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hats_stand_over_the_quantiles() {
        let values: Vec<f64> = (0..=100).map(f64::from).collect();
        let found = hats(&values, 4);
        let wanted = [
            (0.0, 20.0, 40.0),
            (20.0, 40.0, 60.0),
            (40.0, 60.0, 80.0),
            (60.0, 80.0, 100.0),
        ];
        assert_eq!(found, wanted);
        // Between the outer tops they add up to one, and each is one at its own.
        for v in [20.0, 33.0, 71.0, 80.0] {
            let sum: f64 = found.iter().map(|(l, c, h)| hat(v, *l, *c, *h)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{v}: {sum}");
        }
        assert_eq!(hat(30.0, 20.0, 40.0, 60.0), 0.5);
        assert_eq!(hat(55.0, 20.0, 40.0, 60.0), 0.25);
        assert_eq!(
            [hat(20.0, 20.0, 40.0, 60.0), hat(60.0, 20.0, 40.0, 60.0)],
            [0.0; 2]
        );
        // A value that is taken often makes fewer hats, and none without a width.
        let mut often = values;
        often.extend([50.0; 400]);
        assert!(hats(&often, 4).iter().all(|(l, c, h)| l < c && c < h));
    }

    #[test]
    fn play_is_carried_along() {
        let x: Vec<f64> = (0..200).map(|k| (0.1 * f64::from(k)).sin()).collect();
        let size = effects::level(&x, 0.8, f64::abs);
        let all = plays(std::slice::from_ref(&x));
        assert_eq!(all.len(), PLAYS.len());
        for (share, play) in PLAYS.into_iter().zip(all) {
            let gap = share * size;
            for k in 1..x.len() {
                let (held, before) = (play[0][k], play[0][k - 1]);
                assert!((held - x[k]).abs() <= gap + 1e-12);
                // Moves only where it is carried.
                let carried = ((held - x[k]).abs() - gap).abs() < 1e-12;
                assert!(held == before || carried, "{k}");
            }
        }
    }
}
