//! Flexible features and learnt static laws: what a residual still holds, without a form assumed.

use nalgebra::{DMatrix, DVector};

use super::effects;
use super::screen::Bench;
use super::structure::{Functionals, Signal};
use crate::linalg::multiply_tn;

impl Bench<'_> {
    /// What a flexible set of features gains: `(gain, what there was, number of features)`.
    pub fn feature_gain(&self) -> Option<(f64, f64, usize)> {
        let signals = self.signals();
        let rows = Functionals::new(&self.plant);
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let data = self.data();
        let per_segment = |f: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
            data.segments
                .iter()
                .enumerate()
                .map(|(s, segment)| (0..segment.samples()).map(|k| f(s, k)).collect())
                .collect()
        };
        for &input in self
            .basis
            .structure
            .coordinates
            .active_inputs
            .iter()
            .filter(|j| **j < self.problem.data.signals())
        {
            let b = self.plant.b_column(input);
            let mut drives: Vec<Vec<Vec<f64>>> = Vec::new();
            let u = |s: usize, k: usize| data.segments[s].inputs[input][k];
            let channel: Vec<f64> = data
                .segments
                .iter()
                .flat_map(|s| s.inputs[input].clone())
                .collect();
            for (low, centre, high) in hats(&channel, 8) {
                drives.push(per_segment(&|s, k| hat(u(s, k), low, centre, high)));
            }
            for delay in [1usize, 2, 4] {
                drives.push(per_segment(&|s, k| u(s, k.saturating_sub(delay)) - u(s, k)));
            }
            for signal in &signals {
                let place = signal.instance_signal;
                let speed = |o: usize| rows.integrates(&self.plant, o);
                let sensible = match place {
                    Signal::Output(o) => !speed(o),
                    Signal::Integral(o) => speed(o),
                    Signal::Difference(i, j) => !speed(i) && !speed(j),
                };
                if !sensible {
                    continue;
                }
                let position: Vec<f64> = signal.position.concat();
                let rate: Vec<f64> = signal.rate.concat();
                for (low, centre, high) in hats(&position, 8) {
                    drives.push(per_segment(&|s, k| {
                        hat(signal.position[s][k], low, centre, high)
                    }));
                }
                for (low, centre, high) in hats(&rate, 8) {
                    drives.push(per_segment(&|s, k| {
                        hat(signal.rate[s][k], low, centre, high)
                    }));
                }
                drives.push(per_segment(&|s, k| signal.position[s][k] * u(s, k)));
                drives.push(per_segment(&|s, k| {
                    signal.position[s][k] * signal.rate[s][k]
                }));
                let size = effects::level(&position, 0.8, f64::abs);
                for share in [0.03, 0.2] {
                    drives.push(
                        signal
                            .position
                            .iter()
                            .map(|x| {
                                let mut held = x.first().copied().unwrap_or(0.0);
                                x.iter()
                                    .map(|x| {
                                        held = f64::clamp(held, x - share * size, x + share * size);
                                        held
                                    })
                                    .collect()
                            })
                            .collect(),
                    );
                }
            }
            for block in 0..8usize {
                let inside = |s: usize, k: usize| {
                    usize::from(k * 8 / data.segments[s].samples().max(1) == block) as f64
                };
                drives.push(per_segment(&inside));
                drives.push(per_segment(&|s, k| inside(s, k) * u(s, k)));
            }
            columns.extend(
                drives
                    .iter()
                    .map(|drive| self.flatten(&self.response(&b, drive))),
            );
        }
        let count = columns.len();
        let rows = self.weights.len();
        if count == 0 || rows < 4 * count {
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
    pub fn static_law(
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
