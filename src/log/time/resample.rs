//! Another rate: values at uneven or too frequent times put on a uniform grid, without aliases.
//!
//! Where the new step is longer, a value is a weighted mean of the samples around it; the weights are a windowed sinc with
//! its cut-off below the new Nyquist frequency, times the time that each sample stands for, so that uneven samples count
//! for what they cover. Where the new step is shorter, inputs are held, as converters hold them, and outputs are joined by
//! straight lines. Inputs and outputs pass the same filter, which leaves their relation below the cut-off as it is.

/// Cut-off as a share of the new Nyquist frequency.
const CUT_OFF: f64 = 0.8;
/// Half width of the window, in new steps.
const HALF_WIDTH: f64 = 8.0;

/// Times of the samples of one recording and the grid that they are put on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Resampling<'a> {
    /// Increasing, in seconds.
    pub(crate) times: &'a [f64],
    /// Typical step of `times`.
    pub(crate) step: f64,
    /// Step of the grid.
    pub(crate) wanted: f64,
    /// First point of the grid, and what the last is not beyond.
    pub(crate) from: f64,
    pub(crate) to: f64,
}

impl Resampling<'_> {
    /// The values of a channel on the grid; `held` for an input.
    pub(crate) fn column(&self, values: &[f64], held: bool) -> Vec<f64> {
        if self.wanted > self.step * (1.0 + 1e-6) {
            self.filtered(values)
        } else {
            self.joined(values, held)
        }
    }

    /// The values of a channel at the points that are nearest to their times, the mean of those that share one; NaN elsewhere.
    pub(crate) fn placed(&self, values: &[f64]) -> Vec<f64> {
        let mut sums = vec![(0.0, 0.0); self.last() + 1];
        for (time, value) in self.times.iter().zip(values) {
            let at = ((time - self.from) / self.wanted).round();
            if at >= 0.0
                && let Some((sum, count)) = sums.get_mut(at as usize)
            {
                *sum += value;
                *count += 1.0;
            }
        }
        sums.into_iter().map(|(sum, count)| sum / count).collect()
    }

    /// Number of the last point.
    fn last(&self) -> usize {
        ((self.to - self.from) / self.wanted + 1e-6)
            .floor()
            .max(0.0) as usize
    }

    fn grid(&self) -> impl Iterator<Item = f64> {
        (0..=self.last()).map(|k| self.from + k as f64 * self.wanted)
    }

    fn filtered(&self, values: &[f64]) -> Vec<f64> {
        let reach = HALF_WIDTH * self.wanted;
        let stands_for: Vec<f64> = (0..self.times.len())
            .map(|k| {
                let at = |k: usize| self.times.get(k).copied();
                let here = at(k).unwrap_or(0.0);
                let before = k
                    .checked_sub(1)
                    .and_then(at)
                    .map_or(self.step, |t| here - t);
                let after = at(k + 1).map_or(self.step, |t| t - here);
                0.5 * (before + after)
            })
            .collect();
        let mut from = 0;
        self.grid()
            .map(|now| {
                while self.times.get(from).is_some_and(|t| *t < now - reach) {
                    from += 1;
                }
                let (mut sum, mut weights) = (0.0, 0.0);
                let around = self.times.iter().zip(values).zip(&stands_for).skip(from);
                for ((time, value), share) in
                    around.take_while(|((time, _), _)| **time <= now + reach)
                {
                    let weight = share * kernel((time - now) / self.wanted);
                    sum += weight * value;
                    weights += weight;
                }
                sum / weights
            })
            .collect()
    }

    /// The values of a channel on the grid, held or joined by straight lines.
    pub(crate) fn joined(&self, values: &[f64], held: bool) -> Vec<f64> {
        let mut at = 0;
        self.grid()
            .map(|now| {
                while self
                    .times
                    .get(at + 1)
                    .is_some_and(|t| *t <= now + 1e-9 * self.wanted)
                {
                    at += 1;
                }
                let here = values.get(at).copied().unwrap_or(f64::NAN);
                let (Some(start), Some(end), Some(next)) = (
                    self.times.get(at),
                    self.times.get(at + 1),
                    values.get(at + 1),
                ) else {
                    return here;
                };
                let share = ((now - start) / (end - start)).clamp(0.0, 1.0);
                if held {
                    here
                } else {
                    here + share * (next - here)
                }
            })
            .collect()
    }
}

/// Hann-windowed sinc; `x` in new steps.
fn kernel(x: f64) -> f64 {
    if x.abs() >= HALF_WIDTH {
        return 0.0;
    }
    let angle = std::f64::consts::PI * CUT_OFF * x;
    let sinc = if angle.abs() < 1e-8 {
        1.0
    } else {
        angle.sin() / angle
    };
    sinc * 0.5 * (1.0 + (std::f64::consts::PI * x / HALF_WIDTH).cos())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_signals_stay_and_fast_ones_go() {
        // Uneven by up to a third of a sample.
        let times: Vec<f64> = (0..4000_u32)
            .map(|k| 0.01 * (f64::from(k) + 0.3 * (f64::from(k * 7919 % 1000) / 1000.0 - 0.5)))
            .collect();
        let of = |hz: f64| -> Vec<f64> {
            times
                .iter()
                .map(|t| (std::f64::consts::TAU * hz * t).sin() + 5.0)
                .collect()
        };
        let to = Resampling {
            times: &times,
            step: 0.01,
            wanted: 0.05,
            from: times[0],
            to: times[3999],
        };
        let inner = |column: Vec<f64>| column[20..column.len() - 20].to_vec();
        for (k, value) in inner(to.column(&of(1.0), false)).iter().enumerate() {
            let time = times[0] + (k + 20) as f64 * 0.05;
            assert!(
                (value - 5.0 - (std::f64::consts::TAU * time).sin()).abs() < 0.01,
                "{k}: {value}"
            );
        }
        // 19 Hz would show as 1 Hz at 20 samples a second.
        assert!(
            inner(to.column(&of(19.0), false))
                .iter()
                .all(|v| (v - 5.0).abs() < 0.02)
        );
    }

    #[test]
    fn a_finer_grid_holds_inputs_and_joins_outputs() {
        let to = Resampling {
            times: &[0.0, 1.0, 2.0],
            step: 1.0,
            wanted: 0.5,
            from: 0.0,
            to: 2.0,
        };
        assert_eq!(to.column(&[1.0, 3.0, 5.0], true), [1.0, 1.0, 3.0, 3.0, 5.0]);
        assert_eq!(
            to.column(&[1.0, 3.0, 5.0], false),
            [1.0, 2.0, 3.0, 4.0, 5.0]
        );
        let places = to.placed(&[1.0, 3.0, 5.0]);
        assert_eq!((places[0], places[2], places[4]), (1.0, 3.0, 5.0));
        assert!(places[1].is_nan() && places[3].is_nan());
    }
}
