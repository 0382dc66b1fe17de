//! Filtered signals: what the equations behind simulated outputs may be made of.
//!
//! An equation `D^n y = sum a_k D^k y + sum b_k D^k u + sum c_k D^k f(y, u)` holds as well after a filter `1/(D + lambda)^m`
//! on both sides, and then it needs no derivative of a signal, only its low-pass filtered versions (P. C. Young, *Automatica*
//! 17, 1981: state variable filters). It is linear in its coefficients.

use nalgebra::DMatrix;

use crate::linalg::qr_r;
use crate::physics::Hold;
use crate::physics::estimate::PlantRecording;

/// Parts of a sample for which signals are taken as straight lines.
const PARTS: usize = 4;
/// Rows of a regression; longer recordings are thinned after the filters.
const MOST_ROWS: usize = 20_000;
/// An output that swings by less than this is not an angle whose sine differs from it; more than this is none, in radians.
const ANGLE: (f64, f64) = (0.5, 1e3);
/// What lies below zero by less than this part of its range is positive.
const POSITIVE: f64 = 1e-3;

/// What a function is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Output(usize),
    /// Derivative of an output.
    Rate(usize),
    Input(usize),
}

/// A signal of the equations.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Signal {
    Output(usize),
    Input(usize),
    One,
    /// A form of the table, and what stands for `{a}` and `{b}`.
    Function(usize, Vec<Part>),
}

/// Which arguments a form needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Domain {
    Any,
    /// Both signs; of one sign it is another form.
    Signed,
    Positive,
    Angle,
}

/// A function of one or two arguments.
struct Form {
    text: &'static str,
    value: fn(f64, f64) -> f64,
    /// Of the first argument.
    domain: Domain,
    /// None for a function of one argument.
    pair: Option<Pair>,
}

/// What a function of two arguments is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pair {
    /// Any two, in either order the same.
    Any,
    /// Two outputs, in either order the same.
    Outputs,
    /// An output that the domain admits, and anything else.
    OutputAnd,
}

const fn two(text: &'static str, value: fn(f64, f64) -> f64, domain: Domain, pair: Pair) -> Form {
    Form {
        text,
        value,
        domain,
        pair: Some(pair),
    }
}

const fn one(text: &'static str, value: fn(f64, f64) -> f64, domain: Domain) -> Form {
    Form {
        text,
        value,
        domain,
        pair: None,
    }
}

/// Nonlinear functions that the right-hand sides of simulators are made of.
const FORMS: [Form; 16] = [
    one("{a}*abs({a})", |a, _| a * a.abs(), Domain::Any),
    one("{a}^2", |a, _| a * a, Domain::Signed),
    one("{a}^3", |a, _| a.powi(3), Domain::Any),
    one("abs({a})", |a, _| a.abs(), Domain::Signed),
    one("sin({a})", |a, _| a.sin(), Domain::Angle),
    one("cos({a})", |a, _| a.cos(), Domain::Angle),
    one(
        "sqrt(max({a}, 0))",
        |a, _| a.max(0.0).sqrt(),
        Domain::Positive,
    ),
    one(
        "1/max({a}, 1e-9)",
        |a, _| a.max(1e-9).recip(),
        Domain::Positive,
    ),
    // The outflow of a cone.
    one(
        "1/max({a}, 1e-9)^1.5",
        |a, _| a.max(1e-9).powf(-1.5),
        Domain::Positive,
    ),
    two("{a}*{b}", |a, b| a * b, Domain::Any, Pair::Any),
    two(
        "sign({a} - {b})*sqrt(abs({a} - {b}))",
        |a, b| (a - b).signum() * (a - b).abs().sqrt(),
        Domain::Any,
        Pair::Outputs,
    ),
    // A valve at a pressure or level, and what is shared by an amount, by a level and its square.
    two(
        "{b}*sqrt(max({a}, 0))",
        |a, b| b * a.max(0.0).sqrt(),
        Domain::Positive,
        Pair::OutputAnd,
    ),
    two(
        "{b}/max({a}, 1e-9)",
        |a, b| b / a.max(1e-9),
        Domain::Positive,
        Pair::OutputAnd,
    ),
    two(
        "{b}/max({a}, 1e-9)^2",
        |a, b| b / a.max(1e-9).powi(2),
        Domain::Positive,
        Pair::OutputAnd,
    ),
    // Components of what acts on a body that turns.
    two(
        "{b}*sin({a})",
        |a, b| b * a.sin(),
        Domain::Angle,
        Pair::OutputAnd,
    ),
    two(
        "{b}*cos({a})",
        |a, b| b * a.cos(),
        Domain::Angle,
        Pair::OutputAnd,
    ),
];

/// Text of a form with its arguments.
pub(super) fn written(form: usize, arguments: &[String]) -> String {
    let mut text = FORMS[form].text.to_owned();
    for (symbol, argument) in ["{a}", "{b}"].iter().zip(arguments) {
        text = text.replace(symbol, argument);
    }
    text
}

/// A recording between its samples.
struct Fine {
    outputs: Vec<Vec<f64>>,
    rates: Vec<Vec<f64>>,
    /// Inputs at the left and right end of each part of a sample.
    inputs: Vec<[Vec<f64>; 2]>,
}

/// Second derivatives at the knots of the natural cubic spline through equidistant values.
fn bends(y: &[f64], h: f64) -> Vec<f64> {
    let n = y.len();
    let mut second = vec![0.0; n];
    let mut factor = vec![0.0; n];
    for i in 1..n.saturating_sub(1) {
        let right = 6.0 * (y[i + 1] - 2.0 * y[i] + y[i - 1]) / (h * h);
        let pivot = 4.0 - factor[i - 1];
        factor[i] = 1.0 / pivot;
        second[i] = (right - second[i - 1]) / pivot;
    }
    for i in (1..n.saturating_sub(1)).rev() {
        second[i] -= factor[i] * second[i + 1];
    }
    second
}

/// A spline and its derivative at all parts of the samples.
fn spline(y: &[f64], h: f64) -> (Vec<f64>, Vec<f64>) {
    let second = bends(y, h);
    let (mut value, mut slope) = (Vec::new(), Vec::new());
    for k in 0..(y.len() - 1) * PARTS + 1 {
        let i = (k / PARTS).min(y.len() - 2);
        let b = (k - i * PARTS) as f64 / PARTS as f64;
        let a = 1.0 - b;
        let curved = |x: f64| (x.powi(3) - x) * h * h / 6.0;
        value.push(a * y[i] + b * y[i + 1] + curved(a) * second[i] + curved(b) * second[i + 1]);
        let bent = |x: f64| (3.0 * x * x - 1.0) * h / 6.0;
        slope.push((y[i + 1] - y[i]) / h - bent(a) * second[i] + bent(b) * second[i + 1]);
    }
    (value, slope)
}

impl Fine {
    fn new(recording: &PlantRecording, hold: Hold) -> Self {
        let (outputs, rates) = recording
            .outputs
            .iter()
            .map(|y| spline(y, recording.sample_time))
            .unzip();
        let end = |u: &[f64], side: usize| -> Vec<f64> {
            (0..(u.len() - 1) * PARTS)
                .map(|k| {
                    let (i, part) = (k / PARTS, (k % PARTS + side) as f64 / PARTS as f64);
                    match hold {
                        Hold::Zero => u[i],
                        Hold::Linear => u[i] + (u[i + 1] - u[i]) * part,
                    }
                })
                .collect()
        };
        Self {
            outputs,
            rates,
            inputs: recording
                .inputs
                .iter()
                .map(|u| [end(u, 0), end(u, 1)])
                .collect(),
        }
    }

    /// Values at the left (0) or right (1) end of each part of a sample.
    fn part(&self, part: Part, side: usize) -> &[f64] {
        let between = |v: &'_ [f64]| -> std::ops::Range<usize> { side..v.len() - 1 + side };
        match part {
            Part::Output(j) => &self.outputs[j][between(&self.outputs[j])],
            Part::Rate(j) => &self.rates[j][between(&self.rates[j])],
            Part::Input(m) => &self.inputs[m][side],
        }
    }

    fn signal(&self, signal: &Signal, side: usize) -> Vec<f64> {
        match signal {
            Signal::Output(j) => self.part(Part::Output(*j), side).to_vec(),
            Signal::Input(m) => self.part(Part::Input(*m), side).to_vec(),
            Signal::One => vec![1.0; self.outputs[0].len() - 1],
            Signal::Function(form, of) => {
                let a = self.part(of[0], side);
                let b = self.part(*of.last().unwrap_or(&of[0]), side);
                let value = FORMS[*form].value;
                a.iter().zip(b).map(|(&a, &b)| value(a, b)).collect()
            }
        }
    }
}

/// `x/(D + lambda)` at the ends of the parts, from zero.
fn low_pass([left, right]: [&[f64]; 2], lambda: f64, h: f64) -> Vec<f64> {
    let decay = (-lambda * h).exp();
    let of_both = (1.0 - decay) / lambda;
    let of_right = (h - of_both) / (lambda * h);
    let mut state = 0.0;
    let mut all = Vec::with_capacity(left.len() + 1);
    all.push(0.0);
    for (l, r) in left.iter().zip(right) {
        state = decay * state + (of_both - of_right) * l + of_right * r;
        all.push(state);
    }
    all
}

/// The signals of recordings.
pub(super) struct Signals {
    pub(super) all: Vec<Signal>,
    fine: Vec<Fine>,
    sample_time: f64,
    samples: Vec<usize>,
    pub(super) outputs: usize,
}

/// Filtered derivatives of all signals, as columns of the triangular factor: what the geometry of least squares needs.
pub(super) struct Regressors {
    /// Highest derivative.
    order: usize,
    /// Columns of unit length: derivative 0 to `order` of each signal, then what initial states leave.
    pub(super) columns: Vec<Vec<f64>>,
    /// Lengths of the columns.
    pub(super) scale: Vec<f64>,
    signals: usize,
}

impl Regressors {
    pub(crate) fn column(&self, signal: usize, derivative: usize) -> usize {
        signal * (self.order + 1) + derivative
    }

    /// Columns of what initial states leave.
    pub(crate) fn transients(&self) -> std::ops::Range<usize> {
        self.signals * (self.order + 1)..self.columns.len()
    }
}

/// Whether `rate` is the derivative of `a`: its product with a function of `a` is the derivative of another one.
fn is_rate_of(rate: Part, a: Part) -> bool {
    matches!((rate, a), (Part::Rate(i), Part::Output(j)) if i == j)
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
        (a.min(v), b.max(v))
    })
}

impl Signals {
    /// Signals of recordings of one sample time; none where values are missing or a recording is too short.
    pub(crate) fn new(recordings: &[PlantRecording], hold: Hold) -> Option<Self> {
        let first = recordings.first()?;
        let (outputs, inputs) = (first.outputs.len(), first.inputs.len());
        let whole = |r: &PlantRecording| {
            let mut columns = r.inputs.iter().chain(&r.outputs);
            r.outputs[0].len() > 2 && columns.all(|c| c.iter().all(|v| v.is_finite()))
        };
        if outputs == 0 || !recordings.iter().all(whole) {
            return None;
        }
        let fine: Vec<Fine> = recordings.iter().map(|r| Fine::new(r, hold)).collect();
        let of = |part: Part| range(fine.iter().flat_map(|f| f.part(part, 0).iter().copied()));
        let mut all: Vec<Signal> = (0..outputs).map(Signal::Output).collect();
        all.extend((0..inputs).map(Signal::Input));
        all.push(Signal::One);
        let mut parts: Vec<Part> = Vec::new();
        for j in 0..outputs {
            parts.extend([Part::Output(j), Part::Rate(j)]);
        }
        parts.extend((0..inputs).map(Part::Input));
        let moves = |a: Part| {
            let (least, most) = of(a);
            most > least
        };
        let admits = |domain: Domain, a: Part| {
            let (least, most) = of(a);
            let output = matches!(a, Part::Output(_));
            match domain {
                Domain::Any => true,
                Domain::Signed => least < 0.0 && most > 0.0,
                Domain::Positive => output && least > -POSITIVE * (most - least),
                Domain::Angle => output && (ANGLE.0..ANGLE.1).contains(&(most - least)),
            }
        };
        parts.retain(|&a| moves(a));
        for (form, of_form) in FORMS.iter().enumerate() {
            for (i, &a) in parts.iter().enumerate() {
                if !admits(of_form.domain, a) {
                    continue;
                }
                let second = |b: &Part| match of_form.pair {
                    Some(Pair::Outputs) => matches!((a, *b), (Part::Output(_), Part::Output(_))),
                    Some(Pair::OutputAnd) => a != *b && !is_rate_of(*b, a),
                    _ => true,
                };
                match of_form.pair {
                    None => all.push(Signal::Function(form, vec![a])),
                    Some(pair) => {
                        let from = if pair == Pair::OutputAnd { 0 } else { i + 1 };
                        let others = parts[from..].iter().copied().filter(second);
                        all.extend(others.map(|b| Signal::Function(form, vec![a, b])));
                    }
                }
            }
        }
        Some(Self {
            all,
            fine,
            sample_time: first.sample_time,
            samples: recordings.iter().map(|r| r.outputs[0].len()).collect(),
            outputs,
        })
    }

    /// Where the chains of states start: outputs and their first derivatives.
    pub(crate) fn start(&self, orders: &[usize]) -> Vec<Vec<f64>> {
        let of = |(j, &order): (usize, &usize)| {
            let fine = &self.fine[0];
            let known = [fine.outputs[j][0], fine.rates[j][0]];
            (0..order)
                .map(|k| known.get(k).copied().unwrap_or(0.0))
                .collect()
        };
        orders.iter().enumerate().map(of).collect()
    }

    /// Rate of the filter: how fast the quickest output moves.
    pub(crate) fn rate(&self) -> f64 {
        let mean = |v: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = v.fold((0.0, 0), |(s, n), x| (s + x, n + 1));
            sum / f64::from(count.max(1))
        };
        let of = |j: usize| {
            let y = || self.fine.iter().flat_map(|f| f.outputs[j].iter().copied());
            let level = mean(&mut y());
            let spread = mean(&mut y().map(|v| (v - level).powi(2)));
            let rates = self.fine.iter().flat_map(|f| f.rates[j].iter().copied());
            (mean(&mut rates.map(|v| v * v)) / spread.max(f64::MIN_POSITIVE)).sqrt()
        };
        (0..self.outputs).map(of).fold(0.0, f64::max)
    }

    /// All derivatives up to `order`, after `1/(D + rate)^order`.
    pub(crate) fn regressors(&self, order: usize) -> Option<Regressors> {
        let lambda = self.rate();
        let h = self.sample_time / PARTS as f64;
        let rows: usize = self.samples.iter().sum();
        let stride = rows.div_ceil(MOST_ROWS);
        let kept = |all: &[f64], every: usize| -> Vec<f64> {
            all.iter().step_by(every).step_by(stride).copied().collect()
        };
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for signal in &self.all {
            let mut derivatives = vec![Vec::new(); order + 1];
            for fine in &self.fine {
                let ends = [fine.signal(signal, 0), fine.signal(signal, 1)];
                let mut whole = ends[0].clone();
                whole.extend(ends[1].last());
                let mut filtered = vec![kept(&whole, PARTS)];
                let mut now = ends;
                for _ in 0..order {
                    let next = low_pass([&now[0], &now[1]], lambda, h);
                    filtered.push(kept(&next, PARTS));
                    now = [next[..next.len() - 1].to_vec(), next[1..].to_vec()];
                }
                // D^k/(D + lambda)^order = ((D + lambda) - lambda)^k/(D + lambda)^order
                for (k, column) in derivatives.iter_mut().enumerate() {
                    let mut sum = vec![0.0; filtered[0].len()];
                    let mut binomial = 1.0;
                    for j in 0..=k {
                        let weight = binomial * (-lambda).powi((k - j) as i32);
                        for (s, v) in sum.iter_mut().zip(&filtered[order - j]) {
                            *s += weight * v;
                        }
                        binomial *= (k - j) as f64 / (j + 1) as f64;
                    }
                    column.extend(sum);
                }
            }
            columns.extend(derivatives);
        }
        let lengths: Vec<usize> = self.samples.iter().map(|n| n.div_ceil(stride)).collect();
        let total: usize = lengths.iter().sum();
        let mut first = 0;
        for length in lengths {
            for k in 0..order {
                let mut column = vec![0.0; total];
                for (i, v) in column[first..first + length].iter_mut().enumerate() {
                    let t = lambda * (i * stride) as f64 * self.sample_time;
                    *v = t.powi(k as i32) * (-t).exp();
                }
                columns.push(column);
            }
            first += length;
        }
        let scale: Vec<f64> = columns
            .iter()
            .map(|c| c.iter().map(|v| v * v).sum::<f64>().sqrt())
            .collect();
        let unit = DMatrix::from_fn(total, columns.len(), |i, j| {
            columns[j][i] / scale[j].max(f64::MIN_POSITIVE)
        });
        if !unit.iter().all(|v| v.is_finite()) {
            return None;
        }
        let factor = qr_r(&unit);
        Some(Regressors {
            order,
            columns: factor
                .column_iter()
                .map(|c| c.iter().copied().collect())
                .collect(),
            scale,
            signals: self.all.len(),
        })
    }
}
