//! One step in time: the classical Runge-Kutta method, and a diagonally implicit one for stiff equations.
//!
//! Both carry slopes through the step, which so are the exact slopes of what is computed. The implicit method is L-stable, of
//! order 4 with 5 stages (Hairer and Wanner, *Solving Ordinary Differential Equations II*, table IV.6.5); the slopes of a stage
//! follow from its equation by one solution with the matrix of the last Newton iteration.

use super::dense::Factors;
use super::dual::Dual;
use super::field::Field;

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

    /// Derivatives at the last stage of the explicit method: at the end of the step, but for an error of order 3.
    pub(crate) fn last_explicit(&self) -> &[Dual<M>] {
        &self.slopes[2]
    }

    /// Length of the explicit step times the fastest rate that its stages show: `2 |k3 - k2| / |k2 - k1|`, each state in units
    /// of `scale`; NaN where nothing moves. Above 2.8 the method is unstable, even where the step is at rest and shows no error:
    /// its slopes would grow.
    pub(crate) fn stiffness(&self, first: &[Dual<M>], scale: &[f64]) -> f64 {
        let [k2, k3, ..] = &self.slopes;
        let (mut change, mut base) = (0.0, 0.0);
        for (i, scale) in scale.iter().enumerate() {
            change += ((k3[i].value - k2[i].value) / scale).powi(2);
            base += ((k2[i].value - first[i].value) / scale).powi(2);
        }
        2.0 * (change / base).sqrt()
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

    /// The classical method; `first` is the derivative at the start.
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
        let varies = length.slope.iter().any(|&s| s != 0.0);
        let add = |to: &Dual<M>, factor: f64, k: &Dual<M>| {
            if varies {
                to.plus_product(factor, length, k)
            } else {
                to.plus(factor * length.value, k)
            }
        };
        let instant = |part: f64| time.plus_product(part, length, &one);
        let [k2, k3, k4, ..] = &mut self.slopes;
        for (p, (x, k)) in self.point.iter_mut().zip(x.iter().zip(first)) {
            *p = add(x, 0.5, k);
        }
        field.evaluate(&instant(0.5), &self.point, k2);
        for (p, (x, k)) in self.point.iter_mut().zip(x.iter().zip(&*k2)) {
            *p = add(x, 0.5, k);
        }
        field.evaluate(&instant(0.5), &self.point, k3);
        for (p, (x, k)) in self.point.iter_mut().zip(x.iter().zip(&*k3)) {
            *p = add(x, 1.0, k);
        }
        field.evaluate(&instant(1.0), &self.point, k4);
        for (i, r) in result.iter_mut().enumerate() {
            let sum = first[i]
                .plus(2.0, &k2[i])
                .plus(2.0, &k3[i])
                .plus(1.0, &k4[i]);
            *r = add(&x[i], 1.0 / 6.0, &sum);
        }
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
