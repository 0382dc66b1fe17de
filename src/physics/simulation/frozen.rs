//! Slopes along a known run by the variational equation, frozen within each sample.
//!
//! ```text
//! dS/dt = (df/dx) S + df/dp        S = dx/dp,  derivatives at the middle of the sample
//! ```
//!
//! A sample is one matrix exponential, however many steps the run took in it. The error is of second order in the sample time,
//! and a switch within a sample is not seen: this finds the direction of a search, and is not for covariances.

use super::dual::Dual;
use super::field::Field;
use super::plant::Plant;
use super::run::{Direction, Excitation, Observer, Plan, Point};

/// Parameters whose derivatives are computed in one sweep.
const TOGETHER: usize = 8;
/// Most terms of the series, and the norm of a matrix whose series is summed.
const TERMS: usize = 9;
const SCALED: f64 = 0.5;
/// Terms below this are left out: what a sample changes within it is known less well.
const LAST_TERM: f64 = 1e-9;

/// Square matrices by rows.
type Matrix = Vec<f64>;

/// Most plants have few states: loops of a length that the compiler knows run in wide registers.
#[inline(always)]
fn product(n: usize, a: &[f64], b: &[f64], into: &mut [f64]) {
    match n {
        0 => {}
        1 => by_rows(1, a, b, into),
        2 => by_rows(2, a, b, into),
        3 => by_rows(3, a, b, into),
        4 => by_rows(4, a, b, into),
        5 => by_rows(5, a, b, into),
        6 => by_rows(6, a, b, into),
        _ => by_rows(n, a, b, into),
    }
}

#[inline(always)]
fn by_rows(n: usize, a: &[f64], b: &[f64], into: &mut [f64]) {
    for (row, into) in a.chunks_exact(n).zip(into.chunks_exact_mut(n)) {
        into.fill(0.0);
        for (factor, b) in row.iter().zip(b.chunks_exact(n)) {
            for (to, b) in into.iter_mut().zip(b) {
                *to += factor * b;
            }
        }
    }
}

/// `exp(A)` and `phi(A) = (exp(A) - I)/A` by their series and repeated squaring: `2 phi(2A) = phi(A) (exp(A) + I)`.
struct Exponential {
    n: usize,
    scaled: Matrix,
    exp: Matrix,
    phi: Matrix,
    room: Matrix,
}

impl Exponential {
    fn new(n: usize) -> Self {
        let room = || vec![0.0; n * n];
        Self {
            n,
            scaled: room(),
            exp: room(),
            phi: room(),
            room: room(),
        }
    }

    #[inline(always)]
    fn of(&mut self, matrix: &[f64], factor: f64) {
        let n = self.n;
        let norm = matrix
            .chunks(n.max(1))
            .map(|row| row.iter().map(|v| v.abs()).sum::<f64>())
            .fold(0.0, f64::max)
            * factor.abs();
        let halvings = (norm / SCALED).log2().ceil().clamp(0.0, 60.0) as i32;
        let factor = factor * 0.5f64.powi(halvings);
        for (to, from) in self.scaled.iter_mut().zip(matrix) {
            *to = factor * from;
        }
        let add_identity = |m: &mut Matrix| (0..n).for_each(|i| m[i * n + i] += 1.0);
        // Horner: phi = I + A/2 (I + A/3 (I + ...)).
        let norm = norm * 0.5f64.powi(halvings);
        let mut last = 1.0;
        let terms = (2..=TERMS).find(|&term| {
            last *= norm / term as f64;
            last < LAST_TERM
        });
        self.phi.fill(0.0);
        add_identity(&mut self.phi);
        for term in (2..=terms.unwrap_or(TERMS)).rev() {
            product(n, &self.scaled, &self.phi, &mut self.room);
            for (to, from) in self.phi.iter_mut().zip(&self.room) {
                *to = from / term as f64;
            }
            add_identity(&mut self.phi);
        }
        product(n, &self.scaled, &self.phi, &mut self.exp);
        add_identity(&mut self.exp);
        for _ in 0..halvings {
            product(n, &self.phi, &self.exp, &mut self.room);
            for (to, from) in self.phi.iter_mut().zip(&self.room) {
                *to = 0.5 * (*to + from);
            }
            product(n, &self.exp, &self.exp, &mut self.room);
            std::mem::swap(&mut self.exp, &mut self.room);
        }
    }
}

impl Plant {
    /// Derivatives of the outputs along the run with these states, approximately: for each output a column for each direction.
    /// None for plants with delays, and for those that are linear in their states, whose exact slopes cost no more.
    pub(in crate::physics) fn frozen_sensitivities(
        &self,
        point: &Point,
        excitation: &Excitation,
        observer: Option<&Observer>,
        plan: &Plan,
        states: &[Vec<f64>],
        directions: &[Direction],
    ) -> Option<Vec<Vec<Vec<f64>>>> {
        if !self.tape.delays.is_empty() || self.linearity.holds(excitation.hold) {
            return None;
        }
        // As one function, so that all of it uses the wide instructions of the processor.
        let columns = self.tape.arch.dispatch(
            #[inline(always)]
            || {
                let (n, l, d) = (states.len(), self.tape.outputs.len(), directions.len());
                let of_parameters: Vec<usize> = (0..d)
                    .filter(|&i| matches!(directions[i], Direction::Parameter(_)))
                    .collect();
                let groups: Vec<&[usize]> = match of_parameters.len() {
                    0 => vec![&[]],
                    _ => of_parameters.chunks(TOGETHER).collect(),
                };
                let chosen: Vec<Vec<Direction>> = groups
                    .iter()
                    .map(|group| group.iter().map(|&i| directions[i]).collect())
                    .collect();
                // Slopes of the states: a row for each state, a column for each direction.
                let mut slopes = vec![0.0; n * d];
                let mut fields: Vec<Field<TOGETHER>> = Vec::new();
                for (group, chosen) in groups.iter().zip(&chosen) {
                    let start =
                        self.integrator::<TOGETHER>(point, excitation, &plan.widths, chosen);
                    for (i, x) in start.x.iter().enumerate() {
                        for (lane, &column) in group.iter().enumerate() {
                            slopes[i * d + column] = x.slope[lane];
                        }
                    }
                    fields.push(start.field);
                }
                for (column, direction) in directions.iter().enumerate() {
                    if let Direction::Start(i) = direction {
                        slopes[i * d + column] = 1.0;
                    }
                }
                let mut columns = vec![vec![Vec::with_capacity(excitation.length); d]; l];
                let mut exponential = Exponential::new(n);
                let (mut derivative, mut jacobian) = (vec![0.0; n], vec![0.0; n * n]);
                let (mut value, mut of_outputs) = (vec![0.0; l], vec![0.0; l * n]);
                let mut x: Vec<f64> = vec![0.0; n];
                let mut dual = vec![Dual::constant(0.0); n];
                let mut rates = dual.clone();
                let mut push = vec![0.0; n * d];
                let mut next = vec![0.0; n * d];
                let mut of_y = vec![0.0; l * d];
                let mut evaluate = |field: &mut Field<TOGETHER>, time: f64, x: &[f64]| {
                    for (to, &x) in dual.iter_mut().zip(x) {
                        *to = Dual::constant(x);
                    }
                    field.evaluate_all(&Dual::constant(time), &dual, &mut rates);
                };
                for k in 0..excitation.length {
                    let now = excitation.time(k);
                    for (x, column) in x.iter_mut().zip(states) {
                        *x = column[k];
                    }
                    for field in &mut fields {
                        field.begin(k);
                    }
                    fields[0].linearise_outputs(
                        &Dual::constant(now),
                        &x,
                        &mut value,
                        &mut of_outputs,
                    );
                    of_y.fill(0.0);
                    for (field, group) in fields.iter_mut().zip(&groups) {
                        evaluate(field, now, &x);
                        for (o, &slot) in self.tape.outputs.iter().enumerate() {
                            for (lane, &column) in group.iter().enumerate() {
                                of_y[o * d + column] = field.frame.slot[slot].slope[lane];
                            }
                        }
                    }
                    for o in 0..l {
                        for i in 0..n {
                            let c = of_outputs[o * n + i];
                            if c != 0.0 {
                                for column in 0..d {
                                    of_y[o * d + column] += c * slopes[i * d + column];
                                }
                            }
                        }
                        for (to, &slope) in columns[o].iter_mut().zip(&of_y[o * d..(o + 1) * d]) {
                            to.push(slope);
                        }
                    }
                    if k + 1 == excitation.length {
                        break;
                    }
                    if let Some(observer) = observer {
                        for o in 0..l {
                            let error = observer.recorded[o][k] - value[o];
                            if !error.is_finite() {
                                continue;
                            }
                            for (i, x) in x.iter_mut().enumerate() {
                                let gain = observer.gain[(i, o)];
                                *x += gain * error;
                                for column in 0..d {
                                    slopes[i * d + column] -= gain * of_y[o * d + column];
                                }
                                let own = Direction::Gain(i, o);
                                if let Some(column) = directions.iter().position(|&d| d == own) {
                                    slopes[i * d + column] += error;
                                }
                            }
                        }
                    }
                    for (x, column) in x.iter_mut().zip(states) {
                        *x = 0.5 * (*x + column[k + 1]);
                    }
                    let middle = now + 0.5 * excitation.sample_time;
                    fields[0].linearise(
                        &Dual::constant(middle),
                        &x,
                        &mut derivative,
                        &mut jacobian,
                    );
                    exponential.of(&jacobian, excitation.sample_time);
                    push.fill(0.0);
                    for (field, group) in fields.iter_mut().zip(&groups) {
                        evaluate(field, middle, &x);
                        for (i, &slot) in self.tape.derivatives.iter().enumerate() {
                            for (lane, &column) in group.iter().enumerate() {
                                push[i * d + column] =
                                    excitation.sample_time * field.frame.slot[slot].slope[lane];
                            }
                        }
                    }
                    next.fill(0.0);
                    for i in 0..n {
                        let to = &mut next[i * d..(i + 1) * d];
                        for j in 0..n {
                            let (e, phi) = (exponential.exp[i * n + j], exponential.phi[i * n + j]);
                            let (s, p) = (&slopes[j * d..(j + 1) * d], &push[j * d..(j + 1) * d]);
                            for ((to, s), p) in to.iter_mut().zip(s).zip(p) {
                                *to += e * s + phi * p;
                            }
                        }
                    }
                    std::mem::swap(&mut slopes, &mut next);
                }
                columns
            },
        );
        let finite = columns.iter().flatten().flatten().all(|v| v.is_finite());
        finite.then_some(columns)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::physics::{Hold, parse};

    #[test]
    fn the_exponential_and_its_integral_agree_with_the_augmented_matrix() {
        let matrix = [-3.0, 2.0, 0.5, -400.0];
        let mut both = DMatrix::zeros(4, 4);
        for i in 0..2 {
            for j in 0..2 {
                both[(i, j)] = 0.3 * matrix[i * 2 + j];
            }
            both[(i, i + 2)] = 1.0;
        }
        let expected = both.exp();
        let mut found = Exponential::new(2);
        found.of(&matrix, 0.3);
        for i in 0..2 {
            for j in 0..2 {
                assert!((found.exp[i * 2 + j] - expected[(i, j)]).abs() < 1e-9);
                assert!((found.phi[i * 2 + j] - expected[(i, j + 2)]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn frozen_slopes_are_near_the_exact_ones_with_and_without_an_observer() {
        let text = "model Pendulum
               parameter Real J = 0.8; parameter Real d = 0.3; parameter Real g = 9;
               input Real u; output Real y; output Real z;
               Real phi(start=d); Real w(start=0.2);
             equation
               der(phi) = w; J*der(w) = u - d*w*abs(w) - g*sin(phi); y = phi; z = w + 0.1*d*u;
             end Pendulum;";
        let plant = Plant::new(parse(text).unwrap());
        let point = plant.nominal();
        let input: Vec<f64> = (0..400).map(|k| 3.0 * (0.11 * k as f64).sin()).collect();
        let recorded: Vec<f64> = (0..400).map(|k| 0.4 * (0.1 * k as f64).sin()).collect();
        let excitation = Excitation {
            inputs: &[&input],
            length: 400,
            sample_time: 0.02,
            start_time: 0.0,
            hold: Hold::Zero,
        };
        let gain = DMatrix::from_row_slice(2, 2, &[0.1, 0.02, 0.05, 0.1]);
        let observer = Observer {
            gain: &gain,
            recorded: &[&recorded, &recorded],
        };
        let directions = [
            Direction::Parameter(0),
            Direction::Parameter(1),
            Direction::Parameter(2),
            Direction::Start(1),
            Direction::Gain(0, 1),
        ];
        for (observer, directions) in [(None, &directions[..4]), (Some(&observer), &directions)] {
            let run = plant.simulate(&point, &excitation, observer).unwrap();
            let exact = plant.sensitivities(&point, &excitation, observer, &run.plan, directions);
            let frozen = plant
                .frozen_sensitivities(
                    &point,
                    &excitation,
                    observer,
                    &run.plan,
                    &run.states,
                    directions,
                )
                .unwrap();
            for (exact, frozen) in exact.iter().flatten().zip(frozen.iter().flatten()) {
                let size = exact.iter().map(|e| e * e).sum::<f64>().sqrt();
                let apart = exact.iter().zip(frozen).map(|(a, b)| (a - b).powi(2));
                let apart = apart.sum::<f64>().sqrt();
                assert!(size > 0.0 && apart < 0.02 * size, "{apart} of {size}");
            }
        }
    }
}
