//! One step in time: the explicit method of Dormand and Prince, and a diagonally implicit one for stiff equations.
//!
//! Both carry slopes through the step, which so are the exact slopes of what is computed. The explicit method is of order 5 with an
//! embedded result of order 4 (Hairer, Norsett and Wanner, *Solving Ordinary Differential Equations I*, table II.5.2). The implicit method
//! is L-stable, of order 4 with 5 stages (Hairer and Wanner, *Solving Ordinary Differential Equations II*, table IV.6.5); the slopes of a
//! stage follow from its equation by one solution with the matrix of the last Newton iteration.

use nalgebra::Complex;

use super::dense::Factors;
use super::dual::Dual;
use super::field::Field;

/// Instants of the stages of the explicit method after the first, as fractions of the step.
const EXPLICIT_INSTANTS: [f64; 5] = [0.2, 0.3, 0.8, 8.0 / 9.0, 1.0];
/// Weights of the stages before, by rows.
const EXPLICIT_WEIGHTS: [&[f64]; 5] = [
    &[0.2],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[
        19372.0 / 6561.0,
        -25360.0 / 2187.0,
        64448.0 / 6561.0,
        -212.0 / 729.0,
    ],
    &[
        9017.0 / 3168.0,
        -355.0 / 33.0,
        46732.0 / 5247.0,
        49.0 / 176.0,
        -5103.0 / 18656.0,
    ],
];
/// Weights of the result.
const EXPLICIT_RESULT: [f64; 6] = [
    35.0 / 384.0,
    0.0,
    500.0 / 1113.0,
    125.0 / 192.0,
    -2187.0 / 6784.0,
    11.0 / 84.0,
];
/// Difference of the weights of the result and of the embedded result of order 4; the last is that of the derivatives at the end.
const EXPLICIT_DIFFERENCE: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];
/// Coefficients of its growth in a step of `der(x) = rate*x`, by powers of the step times the rate.
const GROWTH: [f64; 7] = [
    1.0,
    1.0,
    1.0 / 2.0,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 600.0,
];

/// What a mode grows by in an explicit step, of the step times its rate.
pub(super) fn growth(z: Complex<f64>) -> Complex<f64> {
    let powers = GROWTH.iter().rev();
    powers.fold(Complex::new(0.0, 0.0), |sum, k| sum * z + k)
}

/// Diagonal of the implicit method.
const GAMMA: f64 = 0.25;
/// Instants of its stages, as fractions of the step.
const INSTANTS: [f64; 5] = [0.25, 0.75, 11.0 / 20.0, 0.5, 1.0];
/// Weights of the stages before, by rows. The last row is that of the result.
const WEIGHTS: [&[f64]; 5] = [
    &[],
    &[0.5],
    &[17.0 / 50.0, -1.0 / 25.0],
    &[371.0 / 1360.0, -137.0 / 2720.0, 15.0 / 544.0],
    &[25.0 / 24.0, -49.0 / 48.0, 125.0 / 16.0, -85.0 / 12.0],
];
/// Difference of the weights of the result and of the embedded result of order 3.
const DIFFERENCE: [f64; 5] = [-3.0 / 16.0, -27.0 / 32.0, 25.0 / 32.0, 0.0, 0.25];
/// Newton iterations before a step is given up and halved.
const ITERATIONS: usize = 12;
/// A stage is solved to this part of the error that a step may have.
const STAGE_ACCURACY: f64 = 0.02;
/// Factors of an earlier iteration are kept while each iteration leaves at most this part of the error: one more evaluation
/// costs less than a Jacobian and its factors where they are good enough (Hairer and Wanner, section IV.8).
const CONTRACTION: f64 = 0.25;

/// To what the stages of an implicit step are solved.
pub(super) struct Accuracy<'a> {
    /// Error of each state.
    pub(super) absolute: &'a [f64],
    /// The same as a part of the move of the state in the stage, where that is more.
    pub(super) relative: f64,
}

/// Room for the stages of a step.
pub(super) struct Stages<const M: usize> {
    slopes: [Vec<Dual<M>>; 5],
    point: Vec<Dual<M>>,
    base: Vec<Dual<M>>,
    newton: Newton<M>,
}

impl<const M: usize> Stages<M> {
    pub(crate) fn new(states: usize) -> Self {
        let room = || vec![Dual::constant(0.0); states];
        Self {
            slopes: std::array::from_fn(|_| room()),
            point: room(),
            base: room(),
            newton: Newton::new(states),
        }
    }

    /// Length of the explicit step times the fastest rate that its last stages show (Hairer and Wanner, equation IV.2.11), each state in
    /// units of `scale`; NaN where nothing moves. Above 3.3 the method is unstable, even where the step is at rest and shows no error: its
    /// slopes would grow.
    pub(crate) fn stiffness(
        &self,
        length: f64,
        result: &[Dual<M>],
        end: &[Dual<M>],
        scale: &[f64],
    ) -> f64 {
        let (mut change, mut base) = (0.0, 0.0);
        for (i, scale) in scale.iter().enumerate() {
            change += ((end[i].value - self.slopes[4][i].value) / scale).powi(2);
            base += ((result[i].value - self.point[i].value) / scale).powi(2);
        }
        length * (change / base).sqrt()
    }

    /// Difference of the explicit step and the embedded one of order 4; `first` and `end` are the derivatives at its ends.
    pub(crate) fn explicit_error(
        &self,
        length: f64,
        first: &[Dual<M>],
        end: &[Dual<M>],
        error: &mut [f64],
    ) {
        let [of_first, between @ .., of_end] = &EXPLICIT_DIFFERENCE;
        for (i, e) in error.iter_mut().enumerate() {
            let between = between.iter().zip(&self.slopes);
            let between = between.map(|(d, k)| d * k[i].value).sum::<f64>();
            *e = length * (of_first * first[i].value + between + of_end * end[i].value);
        }
    }

    /// Difference of the implicit step and the embedded one of order 3, smoothed by the matrix of the last stage, which keeps
    /// stiff parts from counting that the step damps (Hairer and Wanner, equation IV.8.20).
    pub(crate) fn embedded_error(&self, length: f64, error: &mut [f64]) {
        for (i, e) in error.iter_mut().enumerate() {
            let each = self.slopes.iter().zip(DIFFERENCE);
            *e = length * each.map(|(k, d)| d * k[i].value).sum::<f64>();
        }
        self.newton.factors.solve(error);
    }

    /// The explicit method; `first` is the derivative at the start.
    pub(crate) fn explicit(
        &mut self,
        field: &mut Field<M>,
        time: &Dual<M>,
        length: &Dual<M>,
        x: &[Dual<M>],
        first: &[Dual<M>],
        result: &mut [Dual<M>],
    ) {
        let one = Dual::constant(1.0);
        for (stage, weights) in EXPLICIT_WEIGHTS.iter().enumerate() {
            let (known, unknown) = self.slopes.split_at_mut(stage);
            combine(length, x, (first, known), weights, &mut self.point);
            let instant = time.plus_product(EXPLICIT_INSTANTS[stage], length, &one);
            field.evaluate(&instant, &self.point, &mut unknown[0]);
        }
        combine(length, x, (first, &self.slopes), &EXPLICIT_RESULT, result);
    }

    #[allow(
        clippy::needless_range_loop,
        reason = "a state is an element of several lists"
    )]
    /// The implicit method. False when Newton's iteration does not converge to `accuracy`.
    pub(crate) fn implicit(
        &mut self,
        field: &mut Field<M>,
        time: &Dual<M>,
        length: &Dual<M>,
        x: &[Dual<M>],
        accuracy: &Accuracy,
        result: &mut [Dual<M>],
    ) -> bool {
        let n = x.len();
        let one = Dual::constant(1.0);
        for stage in 0..5 {
            self.base.copy_from_slice(x);
            for (weight, k) in WEIGHTS[stage].iter().zip(&self.slopes) {
                for (b, k) in self.base.iter_mut().zip(k) {
                    *b = b.plus_product(*weight, length, k);
                }
            }
            let at = time.plus_product(INSTANTS[stage], length, &one);
            let step = GAMMA * length.value;
            for i in 0..n {
                let base = self.base[i].value;
                self.newton.base[i] = base;
                self.newton.z[i] = match stage {
                    0 => x[i].value,
                    _ => base + step * self.slopes[stage - 1][i].value,
                };
            }
            if !self.newton.solve(field, &at, step, accuracy) {
                return false;
            }
            let Newton {
                z,
                base,
                factors,
                right,
                ..
            } = &mut self.newton;
            let slope = |i: usize| {
                if step > 0.0 {
                    (z[i] - base[i]) / step
                } else {
                    0.0
                }
            };
            for i in 0..n {
                let mut point = self.base[i];
                point.value = z[i];
                for (p, l) in point.slope.iter_mut().zip(&length.slope) {
                    *p += GAMMA * l * slope(i);
                }
                self.point[i] = point;
            }
            // Without slopes the stage itself says what its derivatives are.
            if M > 0 || step <= 0.0 {
                field.evaluate(&at, &self.point, &mut self.slopes[stage]);
            }
            if M > 0 {
                // k = f(base + step k): (I - step J) dk = J dbase + df
                for lane in 0..M {
                    for (r, k) in right.iter_mut().zip(&self.slopes[stage]) {
                        *r = k.slope[lane];
                    }
                    factors.solve(right);
                    for (r, k) in right.iter().zip(&mut self.slopes[stage]) {
                        k.slope[lane] = *r;
                    }
                }
            }
            if step > 0.0 {
                for (i, k) in self.slopes[stage].iter_mut().enumerate() {
                    k.value = slope(i);
                }
            }
        }
        for (i, r) in result.iter_mut().enumerate() {
            *r = self.base[i].plus_product(GAMMA, length, &self.slopes[4][i]);
        }
        true
    }
}

/// `x` and a combination of stages, the first of which stands apart.
#[inline(always)]
fn combine<const M: usize>(
    length: &Dual<M>,
    x: &[Dual<M>],
    (first, stages): (&[Dual<M>], &[Vec<Dual<M>>]),
    weights: &[f64],
    into: &mut [Dual<M>],
) {
    let Some((of_first, others)) = weights.split_first() else {
        return;
    };
    let varies = length.slope.iter().any(|&s| s != 0.0);
    for (i, to) in into.iter_mut().enumerate() {
        let start = Dual::constant(0.0).plus(*of_first, &first[i]);
        let stages = others.iter().zip(stages);
        let sum = stages.fold(start, |sum, (weight, k)| sum.plus(*weight, &k[i]));
        *to = match varies {
            true => x[i].plus_product(1.0, length, &sum),
            false => x[i].plus(length.value, &sum),
        };
    }
}

/// Newton's iteration for `z = base + step f(z)`.
struct Newton<const M: usize> {
    base: Vec<f64>,
    z: Vec<f64>,
    derivative: Vec<f64>,
    jacobian: Vec<f64>,
    taken: Vec<f64>,
    right: Vec<f64>,
    /// Of `I - step J`.
    factors: Factors,
    /// The step of the factors, where they may be used again.
    factored: Option<f64>,
    point: Vec<Dual<M>>,
    slope: Vec<Dual<M>>,
}

impl<const M: usize> Newton<M> {
    fn new(n: usize) -> Self {
        let room = || vec![0.0; n];
        Self {
            base: room(),
            z: room(),
            derivative: room(),
            jacobian: vec![0.0; n * n],
            taken: room(),
            right: room(),
            factors: Factors::default(),
            factored: None,
            point: vec![Dual::constant(0.0); n],
            slope: vec![Dual::constant(0.0); n],
        }
    }

    /// The largest of `values`, as a part of the error that is allowed.
    fn size(&self, values: &[f64], accuracy: &Accuracy) -> f64 {
        let moved = self.z.iter().zip(&self.base).map(|(z, b)| (z - b).abs());
        let allowed = accuracy.absolute.iter().zip(moved);
        let each = values.iter().zip(allowed).map(|(v, (&absolute, moved))| {
            let part = (v / absolute.max(accuracy.relative * moved)).abs();
            if part.is_nan() { f64::INFINITY } else { part }
        });
        each.fold(0.0, f64::max)
    }

    /// Derivatives at `z`, and their Jacobian where it is not `known`.
    fn evaluate(&mut self, field: &mut Field<M>, at: &Dual<M>, known: bool) {
        if !known {
            field.linearise(at, &self.z, &mut self.derivative, &mut self.jacobian);
            return;
        }
        for (p, &z) in self.point.iter_mut().zip(&self.z) {
            *p = Dual::constant(z);
        }
        field.evaluate(at, &self.point, &mut self.slope);
        for (d, s) in self.derivative.iter_mut().zip(&self.slope) {
            *d = s.value;
        }
    }

    /// Solves from the guess in `z`. False when it does not converge to `accuracy`. The factors are those at the solution where
    /// slopes are wanted.
    fn solve(
        &mut self,
        field: &mut Field<M>,
        at: &Dual<M>,
        step: f64,
        accuracy: &Accuracy,
    ) -> bool {
        let n = self.base.len();
        let size = |of: &[f64]| {
            let each = of.iter().zip(accuracy.absolute);
            each.fold(0.0, |worst: f64, (r, a)| {
                if r.is_finite() {
                    worst.max((r / a).abs().min(f64::MAX))
                } else {
                    f64::INFINITY
                }
            })
        };
        let mut before = f64::INFINITY;
        // Size of the last change.
        let mut last = None;
        // Whether every iteration has a Jacobian of its own.
        let mut exact = M > 0;
        self.taken.fill(0.0);
        for _ in 0..ITERATIONS {
            let known = !exact && self.factored == Some(step);
            self.evaluate(field, at, known);
            for i in 0..n {
                self.right[i] = self.base[i] + step * self.derivative[i] - self.z[i];
            }
            let now = size(&self.right);
            if !now.is_finite() || (now > 2.0 * before && before.is_finite()) {
                // Too far: half of the step that was taken.
                if size(&self.taken) == 0.0 {
                    return false;
                }
                for (t, z) in self.taken.iter_mut().zip(&mut self.z) {
                    *t *= 0.5;
                    *z -= *t;
                }
                exact = true;
                continue;
            }
            before = now;
            if !known {
                let jacobian = &self.jacobian;
                let of = |i, j| f64::from(i == j) - step * jacobian[i * n + j];
                self.factored = None;
                if !self.factors.factor(n, of) {
                    return false;
                }
                self.factored = Some(step);
            }
            self.taken.copy_from_slice(&self.right);
            self.factors.solve(&mut self.taken);
            for (t, z) in self.taken.iter().zip(&mut self.z) {
                *z += t;
            }
            let change = self.size(&self.taken, accuracy);
            let left = match (known, last) {
                (false, _) => change,
                // Factors of a stiffer place make any change small: the residual itself is what counts.
                (true, None) => change.max(self.size(&self.right, accuracy)),
                (true, Some(last)) if change <= CONTRACTION * last => {
                    change * change / (last - change)
                }
                (true, Some(_)) => {
                    exact = true;
                    f64::INFINITY
                }
            };
            if left <= STAGE_ACCURACY {
                return true;
            }
            last = Some(change);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Conditions of order 1 and 2 of the stages and 5 of a linear equation, and the growth that these weights give it.
    #[test]
    fn weights_of_the_explicit_method_fulfil_their_conditions() {
        for (weights, instant) in EXPLICIT_WEIGHTS.iter().zip(EXPLICIT_INSTANTS) {
            assert!((weights.iter().sum::<f64>() - instant).abs() < 1e-14);
        }
        assert!(EXPLICIT_DIFFERENCE.iter().sum::<f64>().abs() < 1e-15);
        // Stages of der(x) = z*x from x = 1, as polynomials in z.
        let mut stages = vec![vec![1.0]];
        let sum = |weights: &[f64], stages: &[Vec<f64>]| {
            let mut powers = vec![0.0; 7];
            powers[0] = 1.0;
            for (weight, stage) in weights.iter().zip(stages) {
                for (power, c) in stage.iter().enumerate() {
                    powers[power + 1] += weight * c;
                }
            }
            powers
        };
        for weights in EXPLICIT_WEIGHTS {
            let mut stage = sum(weights, &stages);
            stage.truncate(6);
            stages.push(stage);
        }
        let growth = sum(&EXPLICIT_RESULT, &stages);
        for (found, expected) in growth.iter().zip(GROWTH) {
            assert!((found - expected).abs() < 1e-14, "{growth:?}");
        }
    }
}
