//! What laws see: a clock, the motion over one sample, and the signals that starting values come from.

use super::{Parameter, Unit};

/// Time of the samples of one segment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    /// Time of the first sample in seconds.
    pub(crate) start: f64,
    /// Sample time in seconds.
    pub(crate) step: f64,
    /// The input is a new one: changes have happened before it, events of the recording are over.
    pub(crate) fresh: bool,
}

impl Clock {
    /// Time of sample `k`.
    pub(crate) fn time(&self, k: usize) -> f64 {
        self.start + k as f64 * self.step
    }

    /// How much of the sample interval that begins at sample `k` lies after `change`: 0 before, 1 after, linear in
    /// between, so that a change time can be fitted.
    pub(crate) fn share_after(&self, k: usize, change: f64) -> f64 {
        if self.fresh {
            1.0
        } else {
            ((self.time(k + 1) - change) / self.step).clamp(0.0, 1.0)
        }
    }
}

/// Steps of an implicit force, and the part of it that they settle to.
const IMPLICIT_STEPS: usize = 20;
const IMPLICIT_ACCURACY: f64 = 1e-9;

/// What a force sees over the sample interval `[k, k+1)`; `free` is what would be at its end without the force.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motion {
    pub(crate) position: f64,
    pub(crate) position_free: f64,
    /// Change of the position at the end of the interval that a unit of this force brings.
    pub(crate) position_gain: f64,
    pub(crate) rate: f64,
    pub(crate) rate_free: f64,
    /// Change of the rate at the end of the interval that a unit of this force brings.
    pub(crate) rate_gain: f64,
    /// The input that the force is matched with.
    pub(crate) input: f64,
    /// Which sample, and when.
    pub(crate) sample: usize,
    pub(crate) clock: Clock,
}

impl Motion {
    /// Position in the middle of the interval: second-order accurate for a force held over it.
    pub(crate) fn middle(&self) -> f64 {
        0.5 * (self.position + self.position_free)
    }

    /// Rate in the middle of the interval.
    pub(crate) fn middle_rate(&self) -> f64 {
        0.5 * (self.rate + self.rate_free)
    }

    /// A force of the position in the middle of the interval, where it has moved that itself.
    pub(crate) fn at_middle(&self, force: impl Fn(f64) -> f64) -> f64 {
        self.at_instant(0.5, force)
    }

    /// The same at another instant, as a part of the interval.
    pub(crate) fn at_instant(&self, part: f64, force: impl Fn(f64) -> f64) -> f64 {
        let free = self.position + part * (self.position_free - self.position);
        implicit(free, part * self.position_gain, force)
    }

    /// A force of the rate in the middle of the interval, where it has changed that itself.
    pub(crate) fn at_middle_rate(&self, force: impl Fn(f64) -> f64) -> f64 {
        implicit(self.middle_rate(), 0.5 * self.rate_gain, force)
    }

    /// Force in `[-limit, limit]` that brings the rate at the end of the interval to rest, or as near as it can: the
    /// implicit step of Moreau and Jean, which sticks without smoothing or chatter.
    pub(crate) fn stopping_force(&self, limit: f64) -> f64 {
        if self.rate_gain > 0.0 && limit >= 0.0 {
            (-self.rate_free / self.rate_gain).clamp(-limit, limit)
        } else {
            -limit * self.rate.signum()
        }
    }
}

/// The force `f = force(free + gain f)`: the implicit midpoint rule (E. Hairer, C. Lubich and G. Wanner, *Geometric Numerical
/// Integration*, 2nd ed. 2006, II.1.1). A plant that rests is where its force says; without `gain f` that would be another force on
/// quick plants. A force that pushes on is taken where it would be without itself.
fn implicit(free: f64, gain: f64, force: impl Fn(f64) -> f64) -> f64 {
    let explicit = force(free);
    // `f - force(free + gain f)` has a root between 0 and the explicit force where that resists.
    let excess = |f: f64| f - force(free + gain * f);
    let (mut near, mut far) = ((0.0, -explicit), (explicit, excess(explicit)));
    if near.1 * far.1 >= 0.0 {
        return explicit;
    }
    let settled = IMPLICIT_ACCURACY * explicit.abs();
    for _ in 0..IMPLICIT_STEPS {
        let f = far.0 - far.1 * (far.0 - near.0) / (far.1 - near.1);
        let left = excess(f);
        // Illinois' rule: an end that stays counts half.
        if left * far.1 < 0.0 {
            near = far;
        } else {
            near.1 *= 0.5;
        }
        let step = (f - far.0).abs();
        far = (f, left);
        if step <= settled || left == 0.0 {
            break;
        }
    }
    far.0
}

/// Signals from which starting values are taken.
#[derive(Debug, Clone)]
pub(crate) struct Observed {
    /// The channel itself (an input's values, an output's, or a position).
    pub(crate) channel: Vec<f64>,
    /// Its rate, for forces.
    pub(crate) rate: Vec<f64>,
    /// Sample time in seconds.
    pub(crate) step: f64,
    /// Times at which something may have changed: a coarse grid over the recording.
    pub(crate) change_times: Vec<f64>,
    /// Frequencies (Hz) at which the residual has a line.
    pub(crate) lines: Vec<f64>,
    /// Frequencies (Hz), a log grid, at which a resonance may be missing.
    pub(crate) frequencies: Vec<f64>,
}

/// Coefficients of a curve among its numbers: those of the polynomials of order two to five.
pub(super) const CURVE_COEFFICIENTS: &[usize] = &[2, 3, 4, 5];

/// Numbers of a static curve: where it is looked at, which stays, and its coefficients, in the unit of its value.
pub(super) const fn curve_parameters(of: Unit, value: Unit) -> [Parameter; 6] {
    [
        Parameter::real("centre", of).held(),
        Parameter::positive("half_range", of).held(),
        Parameter::real("c2", value),
        Parameter::real("c3", value),
        Parameter::real("c4", value),
        Parameter::real("c5", value),
    ]
}

/// `c2 P2(s) + c3 P3(s) + c4 P4(s) + c5 P5(s)` with Legendre's polynomials and `s = (v - centre)/half_range`; a straight
/// line beyond the range that was seen. The constant and the straight line belong to the plant.
pub(super) fn curve(p: &[f64], v: f64) -> f64 {
    let s = (v - p[0]) / p[1];
    let inside = s.clamp(-1.0, 1.0);
    let (mut before, mut now) = (1.0, inside);
    let (mut slope_before, mut slope) = (0.0, 1.0);
    let (mut value, mut rise) = (0.0, 0.0);
    for (order, c) in (1..).zip(&p[2..6]) {
        // Bonnet's recursion, and its derivative.
        let n = f64::from(order);
        let next = ((2.0 * n + 1.0) * inside * now - n * before) / (n + 1.0);
        let slope_next = slope_before + (2.0 * n + 1.0) * now;
        (before, now) = (now, next);
        (slope_before, slope) = (slope, slope_next);
        value += c * now;
        rise += c * slope;
    }
    value + rise * (s - inside)
}

/// Coefficients of a curve of the integral of an input, an output: polynomials of order one to four.
pub(crate) const CHARGE_ORDERS: usize = 4;

/// Legendre's polynomials of order one to four in `s = (v - centre)/half_range`; straight lines beyond the range.
pub(crate) fn charge(shape: &[f64], v: f64) -> [f64; CHARGE_ORDERS] {
    let of = |order: usize| {
        let mut p = [shape[0], shape[1], 0.0, 0.0, 0.0, 0.0];
        p[order] = 1.0;
        curve(&p, v)
    };
    [(v - shape[0]) / shape[1], of(2), of(3), of(4)]
}

/// Curves to start from, over the range of `values`, of `size` times it: bent one way, and bent both ways.
pub(super) fn curves(values: &[f64], size: f64) -> Vec<Vec<f64>> {
    let (low, high) = (level(values, 0.002, |v| v), level(values, 0.998, |v| v));
    let half = 0.5 * (high - low);
    if half.is_nan() || half <= 0.0 {
        return Vec::new();
    }
    let c = size * half;
    [[c, 0.0, 0.0, 0.0], [0.0, c, 0.0, 0.0]]
        .map(|coefficients| {
            let mut numbers = vec![0.5 * (low + high), half];
            numbers.extend(coefficients);
            numbers
        })
        .to_vec()
}

/// Quantile `q` of `values` (0..1), of at most about 4000 of them.
pub(crate) fn level(values: &[f64], q: f64, of: fn(f64) -> f64) -> f64 {
    let stride = values.len().div_ceil(4000).max(1);
    let mut sample: Vec<f64> = values.iter().step_by(stride).map(|v| of(*v)).collect();
    if sample.is_empty() {
        return 0.0;
    }
    let at = ((sample.len() - 1) as f64 * q).round() as usize;
    *sample.select_nth_unstable_by(at, f64::total_cmp).1
}

/// `exp(-x)` for positive `x`, zero where that is next to no number: the mathematics library takes many times as long to say
/// so.
pub(crate) fn decay(x: f64) -> f64 {
    const NOTHING_LEFT: f64 = 700.0;
    if x > NOTHING_LEFT { 0.0 } else { (-x).exp() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_the_sum_of_its_polynomials() {
        let p = [3.0, 2.0, 0.7, -0.3, 0.2, 0.1];
        let literal = |s: f64| {
            0.7 * 0.5 * (3.0 * s * s - 1.0) - 0.3 * 0.5 * (5.0 * s.powi(3) - 3.0 * s)
                + 0.2 * 0.125 * (35.0 * s.powi(4) - 30.0 * s * s + 3.0)
                + 0.1 * 0.125 * (63.0 * s.powi(5) - 70.0 * s.powi(3) + 15.0 * s)
        };
        for s in [-1.0, -0.4, 0.0, 0.3, 1.0] {
            assert!((curve(&p, 3.0 + 2.0 * s) - literal(s)).abs() < 1e-12, "{s}");
        }
        // Beyond the range a straight line, without a corner.
        let slope = (literal(1.0) - literal(1.0 - 1e-6)) / 1e-6;
        assert!((curve(&p, 3.0 + 2.0 * 1.5) - literal(1.0) - 0.5 * slope).abs() < 1e-4);
    }
}
