//! What a missing term is a function of, with its values along the recordings.

use std::f64::consts::TAU;

use crate::physics::{Binary, ModelSpec, Node, Unknown, VariableId, VariableKind};

use crate::explain::engine::terms::names::{
    is_position, is_velocity, may_be_angle, may_be_velocity,
};
use crate::explain::engine::terms::term::Needs;

/// How an argument is made of variables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ArgumentForm {
    Variable,
    /// A difference of two variables of one unit.
    Difference,
    /// A difference of a variable and a number or parameter that stands in the text.
    FromReference,
    /// A weighted sum of variables that stands in the text, such as how fast a strut on a turning body is compressed.
    Sum,
    Product,
    /// The difference of the fourth powers of two absolute temperatures in 100 K.
    Radiation,
    /// The reciprocal of an absolute temperature in K: rates of reactions are exponentials of it (Arrhenius).
    Reciprocal,
    /// The size of what drives a velocity, with the sign of this: a loss in proportion to the force.
    Driven,
}

/// An expression of the plant's variables.
#[derive(Debug, Clone)]
pub(crate) struct Argument {
    pub(crate) expression: String,
    pub(crate) variables: Vec<VariableId>,
    /// Place of the equation behind which all of it is known; none where states and inputs are enough.
    pub(crate) known_after: Option<usize>,
    pub(crate) form: ArgumentForm,
    /// The plant declares it as the difference of two others, or as the distance of two that move.
    pub(crate) is_difference: bool,
    /// Its derivative, where the plant has variables for that.
    pub(crate) rate: Option<String>,
    /// In radians.
    pub(crate) angle: bool,
    /// One turn of an angle, in its unit.
    pub(crate) turn: Option<f64>,
    pub(crate) velocity: bool,
    pub(crate) position: bool,
    /// Changes at samples only: it is made of inputs.
    pub(crate) held: bool,
    /// Values along each recording.
    pub(crate) values: Vec<Vec<f64>>,
    /// Values at the end of each sample, before anything of the next one is known: inputs that are held have not changed yet, and
    /// an observer has not corrected. Under feedback they would tell of the noise that is to come.
    pub(crate) ends: Vec<Vec<f64>>,
    sorted: Vec<f64>,
}

/// What is smaller than this part of the largest value for this part of the time comes down to zero.
const AT_ZERO: f64 = 0.1;
/// Part of its range that an argument must go back for a reversal: noise of a sensor is less.
const BACK: f64 = 0.1;
/// Samples that quantiles are taken of.
const SORTED: usize = 4000;

impl Argument {
    pub(super) fn new(spec: &ModelSpec, expression: String, variables: Vec<VariableId>) -> Self {
        let known_after = variables
            .iter()
            .filter(|&&v| spec.variable(v).kind == VariableKind::Algebraic)
            .filter_map(|&v| {
                spec.equations
                    .iter()
                    .position(|e| e.unknown.variable() == v)
            })
            .max();
        let unit = |v: VariableId| spec.variable(v).unit_text.as_deref().unwrap_or("");
        let held = variables
            .iter()
            .all(|&v| spec.variable(v).kind == VariableKind::Input);
        let turn = match variables[..] {
            [v] if unit(v) == "rad" || may_be_angle(spec, &[v]) => Some(TAU),
            [v] if unit(v) == "deg" => Some(360.0),
            _ => None,
        };
        Self {
            form: ArgumentForm::Variable,
            velocity: is_velocity(spec, &variables)
                || may_be_velocity(spec, &variables)
                    && variables
                        .iter()
                        .all(|&v| spec.variable(v).kind != VariableKind::Input),
            angle: turn == Some(TAU),
            turn,
            position: is_position(spec, &variables),
            is_difference: variables.len() == 1 && moves_apart(spec, variables[0]),
            rate: rate(spec, &variables),
            held,
            expression,
            variables,
            known_after,
            values: Vec::new(),
            ends: Vec::new(),
            sorted: Vec::new(),
        }
    }

    /// Takes over the values.
    pub(crate) fn set(&mut self, values: Vec<Vec<f64>>, ends: Vec<Vec<f64>>) {
        self.ends = ends;
        let all: Vec<f64> = values.iter().flatten().copied().collect();
        let every = (all.len() / SORTED).max(1);
        self.sorted = all.into_iter().step_by(every).collect();
        self.sorted.sort_by(f64::total_cmp);
        self.values = values;
    }

    /// The same at points of its axis; its quantiles stay those of the recordings.
    pub(crate) fn at_points(&self, points: &[f64]) -> Self {
        Self {
            values: vec![points.to_vec()],
            ends: vec![points.to_vec()],
            ..self.clone()
        }
    }

    /// The same with the values before an observer corrects them: what a sensor is expected to show.
    pub(crate) fn before_correction(&self) -> Self {
        let before = |(values, ends): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
            let first = values.first().copied();
            let others = ends.iter().copied().take(values.len().saturating_sub(1));
            first.into_iter().chain(others).collect()
        };
        let values = self.values.iter().zip(&self.ends).map(before).collect();
        let mut before = self.clone();
        before.set(values, self.ends.clone());
        before
    }

    /// The value below which this part of all values lies.
    pub(crate) fn quantile(&self, part: f64) -> f64 {
        let last = self.sorted.len().saturating_sub(1);
        let at = (part * last as f64).round() as usize;
        self.sorted.get(at.min(last)).copied().unwrap_or(0.0)
    }

    /// The same of the absolute values.
    pub(crate) fn size_quantile(&self, part: f64) -> f64 {
        let mut sizes: Vec<f64> = self.sorted.iter().map(|v| v.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let last = sizes.len().saturating_sub(1);
        let at = (part * last as f64).round() as usize;
        sizes.get(at.min(last)).copied().unwrap_or(0.0)
    }

    /// Its median, to two digits of its spread: a number that people can read.
    pub(crate) fn usual(&self) -> f64 {
        let (middle, spread) = (self.quantile(0.5), self.spread());
        if spread <= 0.0 {
            return middle;
        }
        let digit = 10f64.powf(spread.log10().floor() - 1.0);
        let usual = (middle / digit).round() * digit;
        // As it is written: without what the multiplication has added, nor a sign of zero.
        format!("{usual:.12e}").parse().unwrap_or(usual) + 0.0
    }

    /// Whether it goes back by more than [`BACK`] of its range after it has gone up, and after it has gone down: what remembers the
    /// way that it went shows only then.
    pub(crate) fn reverses(&self) -> bool {
        let (mut fall, mut rise) = (0.0_f64, 0.0_f64);
        for values in &self.values {
            let (mut highest, mut lowest) = (f64::NEG_INFINITY, f64::INFINITY);
            for &v in values.iter().filter(|v| v.is_finite()) {
                (highest, lowest) = (highest.max(v), lowest.min(v));
                (fall, rise) = (fall.max(highest - v), rise.max(v - lowest));
            }
        }
        fall.min(rise) > BACK * self.range()
    }

    pub(crate) fn range(&self) -> f64 {
        self.quantile(1.0) - self.quantile(0.0)
    }

    pub(crate) fn spread(&self) -> f64 {
        let n = self.sorted.len().max(1) as f64;
        let mean = self.sorted.iter().sum::<f64>() / n;
        (self.sorted.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
    }

    /// Root mean square of its changes from sample to sample, for a unit of time.
    pub(crate) fn rate_size(&self, sample_time: f64) -> f64 {
        let changes = self
            .values
            .iter()
            .flat_map(|v| v.windows(2))
            .map(|w| w[1] - w[0]);
        let (sum, count) = changes
            .filter(|d| d.is_finite())
            .fold((0.0, 0.0), |(sum, n), d| (sum + d * d, n + 1.0));
        (sum / f64::max(count, 1.0)).sqrt() / sample_time
    }

    /// Range of its integral, the largest of all recordings.
    pub(crate) fn travel(&self, sample_time: f64) -> f64 {
        let of = |values: &Vec<f64>| {
            let (mut sum, mut low, mut high) = (0.0f64, 0.0f64, 0.0f64);
            for v in values.iter().filter(|v| v.is_finite()) {
                sum += v * sample_time;
                (low, high) = (low.min(sum), high.max(sum));
            }
            high - low
        };
        self.values.iter().map(of).fold(0.0, f64::max)
    }

    /// Whether a term can be a function of it.
    pub(crate) fn serves(&self, needs: Needs) -> bool {
        if self.form == ArgumentForm::Product
            || self.form == ArgumentForm::Radiation && needs != Needs::Radiation
            || self.form == ArgumentForm::Reciprocal && needs != Needs::Reciprocal
            || self.form == ArgumentForm::FromReference && needs != Needs::Difference
            || self.form == ArgumentForm::Driven && needs != Needs::Driven
        {
            return false;
        }
        let both = self.quantile(0.05) < 0.0 && self.quantile(0.95) > 0.0;
        let turns = self.quantile(0.0) < 0.0 && self.quantile(1.0) > 0.0;
        match needs {
            Needs::Anything => true,
            Needs::BothSigns => both,
            Needs::AboutZero => {
                both || self.size_quantile(AT_ZERO) < AT_ZERO * self.size_quantile(1.0)
            }
            Needs::Positive => self.quantile(0.0) >= 0.0,
            Needs::Radiation => self.form == ArgumentForm::Radiation,
            Needs::Reciprocal => self.form == ArgumentForm::Reciprocal,
            Needs::Driven => self.form == ArgumentForm::Driven && both,
            Needs::Difference => {
                let of_text = [ArgumentForm::Difference, ArgumentForm::FromReference];
                of_text.contains(&self.form) || self.is_difference
            }
            Needs::Stretch => self.position && self.serves(Needs::Difference),
            Needs::Angle => self.angle,
            Needs::AlongPath => self.angle || self.position && self.variables.len() == 1,
            Needs::Velocity => both && self.velocity,
            Needs::Turning => both || self.velocity && turns,
            Needs::Directed => turns || self.serves(Needs::OneWay),
            // It may begin at rest.
            Needs::OneWay => self.velocity && !turns,
            Needs::Another => self.form == ArgumentForm::Variable,
            Needs::OwnState | Needs::Integrated => {
                self.form == ArgumentForm::Variable && !self.held
            }
            Needs::SwitchedOn => {
                self.held
                    && self
                        .values
                        .iter()
                        .all(|v| v.first().is_some_and(|u| *u != 0.0))
            }
            Needs::Time => false,
        }
    }
}

/// The derivative of a variable, or of the difference of two, where the plant has it as `der(x) = v`.
pub(super) fn rate(spec: &ModelSpec, variables: &[VariableId]) -> Option<String> {
    let of = |v: VariableId| {
        let equation = spec
            .equations
            .iter()
            .find(|e| e.unknown == Unknown::Derivative(v))?;
        match spec.expressions.node(equation.rest) {
            Node::Variable(rate) if equation.coefficient.is_none() => {
                Some(spec.variable(rate).name.clone())
            }
            _ => None,
        }
    };
    match *variables {
        [v] => of(v).or_else(|| {
            let equation = spec
                .equations
                .iter()
                .find(|e| e.unknown == Unknown::Value(v))?;
            let Node::Binary(Binary::Subtract, a, b) = spec.expressions.node(equation.rest) else {
                return None;
            };
            let operands = (spec.expressions.node(a), spec.expressions.node(b));
            let (Node::Variable(a), Node::Variable(b)) = operands else {
                return None;
            };
            let whole = equation.coefficient.is_none();
            whole.then(|| Some(format!("({} - {})", of(a)?, of(b)?)))?
        }),
        [a, b] => Some(format!("({} - {})", of(a)?, of(b)?)),
        _ => None,
    }
}

/// Whether a variable is the distance of two that move: `der(x) = a - b`.
fn moves_apart(spec: &ModelSpec, v: VariableId) -> bool {
    let is_variable = |id| matches!(spec.expressions.node(id), Node::Variable(_));
    spec.equations.iter().any(|e| {
        e.unknown == Unknown::Derivative(v)
            && e.coefficient.is_none()
            && matches!(spec.expressions.node(e.rest),
                Node::Binary(Binary::Subtract, a, b) if is_variable(a) && is_variable(b))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::engine::terms::arguments_of_plant::arguments;
    use crate::physics::parse;

    /// The argument `x` with these values in two recordings.
    fn with_values(values: [Vec<f64>; 2]) -> Argument {
        let spec = parse(
            "model M input Real u; output Real y; Real x; equation der(x) = u; y = x; end M;",
        )
        .unwrap();
        let mut x = arguments(&spec)
            .into_iter()
            .find(|a| a.expression == "x")
            .unwrap();
        x.set(values.to_vec(), values.to_vec());
        x
    }

    #[test]
    fn what_only_rises_does_not_reverse_and_noise_is_no_reversal() {
        let rising = |k: i32| f64::from(k) + 0.5 * f64::from(k % 2);
        let up: Vec<f64> = (0..20).map(rising).collect();
        let down: Vec<f64> = up.iter().rev().copied().collect();
        assert!(!with_values([up.clone(), up.clone()]).reverses());
        // Between recordings nothing moves, but each may move in a way of its own.
        let to_and_fro = [&up[..], &down[..]].concat();
        assert!(with_values([up, to_and_fro]).reverses());
    }

    #[test]
    fn a_usual_value_has_two_digits_of_the_spread() {
        let warm: Vec<f64> = (0..101)
            .map(|k| 318.4321 + 0.1 * f64::from(k - 50))
            .collect();
        assert_eq!(with_values([warm.clone(), warm]).usual(), 318.4);
        assert_eq!(with_values([vec![5.0; 3], vec![5.0; 3]]).usual(), 5.0);
        let about_zero = vec![-3.0, -0.001, 3.0];
        let usual = with_values([about_zero.clone(), about_zero]).usual();
        assert_eq!(usual.to_string(), "0");
    }
}
