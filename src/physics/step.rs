//! One step in time: the classical Runge-Kutta method, and a diagonally implicit one for stiff equations.
//!
//! Both carry slopes through the step, which so are the exact slopes of what is computed. The implicit method is L-stable, of
//! order 4 with 5 stages (Hairer and Wanner, *Solving Ordinary Differential Equations II*, table IV.6.5); the slopes of a stage
//! follow from its equation by one solution with the matrix of the last Newton iteration.

use nalgebra::DMatrix;

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
/// Newton iterations before a step is given up and halved.
const ITERATIONS: usize = 12;
/// A stage is solved to this part of the error that a step may have.
const STAGE_ACCURACY: f64 = 0.02;

/// Room for the stages of a step.
pub(super) struct Stages<const M: usize> {
    slopes: [Vec<Dual<M>>; 5],
    point: Vec<Dual<M>>,
    base: Vec<Dual<M>>,
}

impl<const M: usize> Stages<M> {
    pub fn new(states: usize) -> Self {
        let room = || vec![Dual::constant(0.0); states];
        Self {
            slopes: std::array::from_fn(|_| room()),
            point: room(),
            base: room(),
        }
    }

    /// The classical method; `first` is the derivative at the start.
    pub fn explicit(
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

    /// The implicit method. False when Newton's iteration does not converge to `accuracy` of each state.
    pub fn implicit(
        &mut self,
        field: &mut Field<M>,
        time: &Dual<M>,
        length: &Dual<M>,
        x: &[Dual<M>],
        accuracy: &[f64],
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
            let guess: Vec<f64> = match stage {
                0 => x.iter().map(|x| x.value).collect(),
                _ => (0..n)
                    .map(|i| self.base[i].value + step * self.slopes[stage - 1][i].value)
                    .collect(),
            };
            let base: Vec<f64> = self.base.iter().map(|b| b.value).collect();
            let Some((values, matrix)) = solve(field, &at, step, &base, guess, accuracy) else {
                return false;
            };
            let slope = |i: usize| {
                if step > 0.0 {
                    (values[i] - base[i]) / step
                } else {
                    0.0
                }
            };
            for i in 0..n {
                let mut point = self.base[i];
                point.value = values[i];
                for (p, l) in point.slope.iter_mut().zip(&length.slope) {
                    *p += GAMMA * l * slope(i);
                }
                self.point[i] = point;
            }
            field.evaluate(&at, &self.point, &mut self.slopes[stage]);
            if M > 0 {
                // k = f(base + step k): (I - step J) dk = J dbase + df
                let right = DMatrix::from_fn(n, M, |i, j| self.slopes[stage][i].slope[j]);
                let Some(solved) = matrix.lu().solve(&right) else {
                    return false;
                };
                for (i, k) in self.slopes[stage].iter_mut().enumerate() {
                    k.slope = std::array::from_fn(|j| solved[(i, j)]);
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

/// Solves `z = base + step f(z)`; gives `z` and the matrix `I - step J` there.
fn solve<const M: usize>(
    field: &mut Field<M>,
    at: &Dual<M>,
    step: f64,
    base: &[f64],
    guess: Vec<f64>,
    accuracy: &[f64],
) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let n = base.len();
    let (mut derivative, mut jacobian) = (vec![0.0; n], vec![0.0; n * n]);
    let mut z = guess;
    let size = |of: &[f64]| {
        of.iter()
            .zip(accuracy)
            .map(|(r, a)| (r / a).abs())
            .fold(0.0, f64::max)
    };
    let mut before = f64::INFINITY;
    let mut taken = vec![0.0; n];
    for _ in 0..ITERATIONS {
        field.linearise(at, &z, &mut derivative, &mut jacobian);
        let residual: Vec<f64> = (0..n)
            .map(|i| z[i] - base[i] - step * derivative[i])
            .collect();
        let now = size(&residual);
        if !now.is_finite() || (now > 2.0 * before && before.is_finite()) {
            // Too far: half of the step that was taken.
            taken.iter_mut().zip(&mut z).for_each(|(t, z)| {
                *t *= 0.5;
                *z -= *t;
            });
            before = if before.is_finite() { before } else { f64::MAX };
            if size(&taken) == 0.0 {
                return None;
            }
            continue;
        }
        before = now;
        let matrix = DMatrix::from_fn(n, n, |i, j| f64::from(i == j) - step * jacobian[i * n + j]);
        let change = matrix
            .clone()
            .lu()
            .solve(&nalgebra::DVector::from_vec(residual))?;
        for i in 0..n {
            taken[i] = -change[i];
            z[i] += taken[i];
        }
        if size(&taken) <= STAGE_ACCURACY {
            return Some((z, matrix));
        }
    }
    None
}
