//! Plants that are linear in their states: from sample to sample by matrices, exact but for rounding.
//!
//! With `der(x) = A x + w`, `w` a function of the inputs alone and `h` the sample time, inputs that are held give
//! `x+ = x + h phi1(A h) der(x)`; inputs on a straight line add `h phi2(A h)` times the change of `w` in the sample
//! (`phi1(z) = (e^z - 1)/z`, `phi2(z) = (e^z - 1 - z)/z^2`). `A` and both matrices carry the slopes in the parameters.

use super::dual::Dual;
use super::field::Field;
use super::run::Hold;
use crate::physics::expression::{Binary, ExpressionId, Node};
use crate::physics::spec::{ModelSpec, Unknown, VariableKind};

/// Largest norm of the matrix that the series is summed for; larger ones are halved first and doubled again.
const SERIES_NORM: f64 = 0.5;
/// Terms of the series: `0.5^17 / 17!` is below rounding.
const SERIES_TERMS: usize = 17;
/// Size of the states at which the equations are evaluated for their coefficients: what does not depend on the states then
/// cancels without loss.
const LARGE: f64 = (1u64 << 40) as f64;

/// How an expression depends on something.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Degree {
    Constant,
    Affine,
    Other,
}

/// How an expression depends on states and inputs.
#[derive(Debug, Clone, Copy)]
struct Dependence {
    states: Degree,
    inputs: Degree,
}

impl Dependence {
    const NONE: Self = Self {
        states: Degree::Constant,
        inputs: Degree::Constant,
    };

    fn constant(self) -> bool {
        self.states == Degree::Constant && self.inputs == Degree::Constant
    }

    fn sum(self, other: Self) -> Self {
        Self {
            states: self.states.max(other.states),
            inputs: self.inputs.max(other.inputs),
        }
    }

    /// Of a function that is not linear.
    fn bent(self) -> Self {
        let states = match self.states {
            Degree::Constant => Degree::Constant,
            _ => Degree::Other,
        };
        let inputs = if self.constant() {
            Degree::Constant
        } else {
            Degree::Other
        };
        Self { states, inputs }
    }

    fn product(self, other: Self) -> Self {
        match (self.constant(), other.constant()) {
            (true, _) => other,
            (_, true) => self,
            _ => self.sum(other).bent(),
        }
    }

    fn quotient(self, by: Self) -> Self {
        if by.constant() {
            self
        } else {
            self.sum(by).bent()
        }
    }
}

/// Holds of the inputs for which a plant goes by matrices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Linearity {
    /// None.
    No,
    /// Held inputs: they may enter in any way.
    Held,
    /// Any: inputs enter linearly as well.
    Any,
}

impl Linearity {
    /// Of the equations; switches and delays must have been excluded.
    pub(crate) fn of(spec: &ModelSpec) -> Self {
        let mut of_variable = vec![Dependence::NONE; spec.variables.len()];
        for (variable, known) in spec.variables.iter().zip(&mut of_variable) {
            match variable.kind {
                VariableKind::State => known.states = Degree::Affine,
                VariableKind::Input => known.inputs = Degree::Affine,
                _ => {}
            }
        }
        let mut of_derivative = vec![Dependence::NONE; spec.variables.len()];
        let mut of_node = vec![None; spec.expressions.len()];
        let mut all = Dependence::NONE;
        // An equation uses only what equations before it determine; so its nodes are visited when it is reached.
        for equation in &spec.equations {
            let mut of = |root| visit(spec, root, &of_variable, &of_derivative, &mut of_node);
            let rest = of(equation.rest);
            let value = match equation.coefficient {
                Some(c) => rest.quotient(of(c)),
                None => rest,
            };
            match equation.unknown {
                Unknown::Value(v) => of_variable[v.index()] = value,
                Unknown::Derivative(v) => {
                    of_derivative[v.index()] = value;
                    all = all.sum(value);
                }
            }
        }
        match all {
            Dependence {
                states: Degree::Other,
                ..
            } => Self::No,
            Dependence {
                inputs: Degree::Other,
                ..
            } => Self::Held,
            _ => Self::Any,
        }
    }

    pub(crate) fn holds(self, hold: Hold) -> bool {
        match self {
            Self::No => false,
            Self::Held => hold == Hold::Zero,
            Self::Any => true,
        }
    }
}

/// Dependence of `root`; that of the nodes under it is kept.
fn visit(
    spec: &ModelSpec,
    root: ExpressionId,
    of_variable: &[Dependence],
    of_derivative: &[Dependence],
    of_node: &mut [Option<Dependence>],
) -> Dependence {
    let mut stack = vec![root];
    let mut under = Vec::new();
    while let Some(id) = stack.pop() {
        if of_node[id.index()].is_none() {
            of_node[id.index()] = Some(Dependence::NONE);
            under.push(id);
            stack.extend(spec.expressions.node(id).operands());
        }
    }
    // Operands stand before their operators.
    under.sort_unstable();
    for id in under {
        let of = |id: ExpressionId| of_node[id.index()].unwrap_or(Dependence::NONE);
        let dependence = match spec.expressions.node(id) {
            Node::Number(_) => Dependence::NONE,
            Node::Time | Node::Delay { .. } => Dependence {
                states: Degree::Other,
                inputs: Degree::Other,
            },
            Node::Previous(_) => Dependence {
                states: Degree::Constant,
                inputs: Degree::Other,
            },
            Node::Variable(v) => of_variable[v.index()],
            Node::Derivative(v) => of_derivative[v.index()],
            Node::Negate(a) => of(a),
            Node::Not(a) | Node::Call(_, a) => of(a).bent(),
            Node::Binary(operator, a, b) => match operator {
                Binary::Add | Binary::Subtract => of(a).sum(of(b)),
                Binary::Multiply => of(a).product(of(b)),
                Binary::Divide => of(a).quotient(of(b)),
                _ => of(a).sum(of(b)).bent(),
            },
            Node::If { condition, yes, no } => of(condition).sum(of(yes)).sum(of(no)).bent(),
        };
        of_node[id.index()] = Some(dependence);
    }
    of_node[root.index()].unwrap_or(Dependence::NONE)
}

/// The matrices of a run, by rows.
pub(super) struct Propagator<const M: usize> {
    /// `h phi1(A h)`
    held: Vec<Dual<M>>,
    /// `h phi2(A h)`, where inputs lie on straight lines.
    ramp: Option<Vec<Dual<M>>>,
    change: Vec<Dual<M>>,
}

impl<const M: usize> Propagator<M> {
    /// From the equations at the parameters of the frame.
    pub(crate) fn new(field: &mut Field<M>, states: usize, sample_time: f64, hold: Hold) -> Self {
        let n = states;
        let zero = Dual::constant(0.0);
        let now = Dual::constant(0.0);
        let mut x = vec![zero; n];
        let (mut still, mut moved) = (vec![zero; n], vec![zero; n]);
        field.begin(0);
        field.evaluate(&now, &x, &mut still);
        let mut a = vec![zero; n * n];
        for j in 0..n {
            x[j] = Dual::constant(LARGE);
            field.evaluate(&now, &x, &mut moved);
            x[j] = zero;
            for i in 0..n {
                a[i * n + j] = zero
                    .plus(sample_time / LARGE, &moved[i])
                    .plus(-sample_time / LARGE, &still[i]);
            }
        }
        let norm = a
            .chunks(n.max(1))
            .map(|row| row.iter().map(|v| v.value.abs()).sum::<f64>());
        let norm = norm.fold(0.0, f64::max);
        let doublings = if norm > SERIES_NORM && norm.is_finite() {
            (norm / SERIES_NORM).log2().ceil() as i32
        } else {
            0
        };
        let part = 0.5f64.powi(doublings);
        let mut z: Vec<Dual<M>> = a.iter().map(|v| zero.plus(part, v)).collect();
        // Horner's scheme for phi2 = sum z^k/(k + 2)!, then phi1 = 1 + z phi2.
        let unit = |scale: f64| {
            (0..n * n)
                .map(|i| Dual::constant(if i % (n + 1) == 0 { scale } else { 0.0 }))
                .collect::<Vec<_>>()
        };
        let mut phi2 = unit(1.0);
        for k in (3..SERIES_TERMS + 3).rev() {
            phi2 = add(&unit(1.0), 1.0 / k as f64, &multiply(&z, &phi2, n));
        }
        phi2.iter_mut().for_each(|v| *v = zero.plus(0.5, v));
        let mut phi1 = add(&unit(1.0), 1.0, &multiply(&z, &phi2, n));
        for _ in 0..doublings {
            let square = multiply(&phi1, &phi1, n);
            let twice = add(&square, 2.0, &phi2);
            phi2 = twice.iter().map(|v| zero.plus(0.25, v)).collect();
            phi1 = add(&phi1, 0.5, &multiply(&z, &square, n));
            z.iter_mut().for_each(|v| *v = zero.plus(2.0, v));
        }
        let scaled =
            |matrix: &[Dual<M>]| matrix.iter().map(|v| zero.plus(sample_time, v)).collect();
        Self {
            held: scaled(&phi1),
            ramp: (hold == Hold::Linear).then(|| scaled(&phi2)),
            change: vec![zero; n],
        }
    }

    /// States at the next sample; `rate` is their derivative at this one, and the field stands there.
    pub(crate) fn advance(
        &mut self,
        field: &mut Field<M>,
        next_time: f64,
        x: &mut [Dual<M>],
        rate: &[Dual<M>],
        room: &mut [Dual<M>],
    ) {
        if self.ramp.is_some() {
            // The derivative at the same states with the inputs of the next sample.
            field.evaluate(&Dual::constant(next_time), x, room);
            for (c, (after, before)) in self.change.iter_mut().zip(room.iter().zip(rate)) {
                *c = after.plus(-1.0, before);
            }
        }
        // A plant without states has rows of none.
        let n = x.len().max(1);
        for (x, row) in x.iter_mut().zip(self.held.chunks(n)) {
            *x = product(*x, row, rate);
        }
        if let Some(ramp) = &self.ramp {
            for (x, row) in x.iter_mut().zip(ramp.chunks(n)) {
                *x = product(*x, row, &self.change);
            }
        }
    }
}

/// `x` plus a row times a column.
fn product<const M: usize>(x: Dual<M>, row: &[Dual<M>], column: &[Dual<M>]) -> Dual<M> {
    let terms = row.iter().zip(column);
    terms.fold(x, |sum, (a, b)| sum.plus_product(1.0, a, b))
}

fn multiply<const M: usize>(a: &[Dual<M>], b: &[Dual<M>], n: usize) -> Vec<Dual<M>> {
    let mut product = vec![Dual::constant(0.0); n * n];
    for i in 0..n {
        for k in 0..n {
            for j in 0..n {
                product[i * n + j] =
                    product[i * n + j].plus_product(1.0, &a[i * n + k], &b[k * n + j]);
            }
        }
    }
    product
}

/// `a + factor b`
fn add<const M: usize>(a: &[Dual<M>], factor: f64, b: &[Dual<M>]) -> Vec<Dual<M>> {
    a.iter().zip(b).map(|(a, b)| a.plus(factor, b)).collect()
}
