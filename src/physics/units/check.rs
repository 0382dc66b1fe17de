//! Compares the units of what is added, compared and equated.
//!
//! What is not known for certain matches everything: variables without a unit, and numbers that may carry one.

use super::words::Words;
use super::{Unit, symbols};
use crate::physics::error::{SpecError, SpecErrorKind, excerpt};
use crate::physics::expression::{Binary, ExpressionId, Function, Node, Span, VariableId};
use crate::physics::spec::{ModelSpec, VariableKind};
use crate::physics::syntax::constant;

/// Sizes of units that differ by less than this part are equal: conversions are rounded.
const SAME_SIZE: f64 = 1e-3;

/// What is known about the unit of an expression.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Known {
    /// Nothing.
    Nothing,
    /// Made of literals: takes any unit in a sum.
    Literal {
        /// The number, where it follows from literals.
        value: f64,
        /// True when it is a pure number in a product; another literal may carry a unit, such as 3600 s/h.
        pure: bool,
    },
    /// A unit.
    Is {
        unit: Unit,
        /// Its size in base units of the SI; NaN where that is not known.
        size: f64,
        /// A literal is a factor: in the argument of a function it may carry the inverse unit.
        scaled: bool,
        /// A fraction times one other factor, as in `tau = 0.5*u`: this is the way to write a gain.
        gain: bool,
    },
}

impl Known {
    fn is(unit: Unit, size: f64) -> Self {
        Self::Is {
            unit,
            size,
            scaled: false,
            gain: false,
        }
    }

    /// The unit, where it is certain enough to be compared.
    pub(super) fn certain(self) -> Option<Unit> {
        match self {
            Self::Is {
                unit, gain: false, ..
            } => Some(unit),
            _ => None,
        }
    }

    /// The size of a unit that is certain; NaN where it is not known.
    fn size(self) -> f64 {
        match self {
            Self::Is {
                size, gain: false, ..
            } => size,
            _ => f64::NAN,
        }
    }
}

/// Compares the units of every sum, difference, comparison, minimum, branch, argument, equation, value and start.
///
/// # Errors
/// The first two parts, in the order of the text, that are of different dimension.
pub fn check_units(spec: &ModelSpec) -> Result<(), SpecError> {
    unit_conflicts(spec).into_iter().next().map_or(Ok(()), Err)
}

/// All conflicts that [`check_units`] looks for, in the order of the text. What is made of parts in conflict is not compared.
pub(crate) fn unit_conflicts(spec: &ModelSpec) -> Vec<SpecError> {
    let mut checker = Checker::examined(spec);
    checker.equations();
    checker.values();
    let mut conflicts = checker.conflicts;
    conflicts.sort_by_key(|c| c.0.start);
    let error = |(at, message)| {
        let kind = SpecErrorKind::UnitConflict(message);
        SpecError::new(&spec.text, at, kind)
    };
    conflicts.into_iter().map(error).collect()
}

/// Parts of one dimension and different size, which have to be alike.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(
    not(feature = "cli"),
    allow(dead_code, reason = "the command warns of them")
)]
pub(super) struct SizeConflict {
    /// What holds both.
    pub(super) at: Span,
    pub(super) parts: [ExpressionId; 2],
    pub(super) sizes: [f64; 2],
}

/// All parts of different size, in the order of the text.
#[cfg(feature = "cli")]
pub(super) fn size_conflicts(spec: &ModelSpec) -> Vec<SizeConflict> {
    let mut checker = Checker::examined(spec);
    checker.equations();
    checker.sizes.sort_by_key(|c| c.at.start);
    checker.sizes
}

/// The nodes that stand in the text, as opposed to those made by solving.
fn used(spec: &ModelSpec) -> Vec<bool> {
    let mut used = vec![false; spec.expressions.len()];
    let sides = spec.equations.iter().flat_map(|e| [e.left, e.right]);
    let values = spec
        .variables
        .iter()
        .flat_map(|v| [v.value, v.start])
        .flatten();
    for root in sides.chain(values) {
        used[root.index()] = true;
    }
    for index in (0..used.len()).rev() {
        if used[index] {
            for operand in spec.expressions.node(ExpressionId(index as u32)).operands() {
                used[operand.index()] = true;
            }
        }
    }
    used
}

pub(super) struct Checker<'a> {
    spec: &'a ModelSpec,
    words: Words<'a>,
    pub(super) used: Vec<bool>,
    pub(super) known: Vec<Known>,
    /// Where they stand, and what is said about them.
    conflicts: Vec<(Span, String)>,
    /// Parts of different size.
    sizes: Vec<SizeConflict>,
}

impl<'a> Checker<'a> {
    /// Finds what is known of every expression.
    pub(super) fn examined(spec: &'a ModelSpec) -> Self {
        let mut checker = Self {
            spec,
            words: Words::new(spec),
            used: used(spec),
            known: vec![Known::Nothing; spec.expressions.len()],
            conflicts: vec![],
            sizes: vec![],
        };
        for index in 0..spec.expressions.len() {
            if checker.used[index] {
                let id = ExpressionId(index as u32);
                checker.known[index] = checker.examine(id);
            }
        }
        checker
    }
}

impl Checker<'_> {
    fn text(&self, id: ExpressionId) -> String {
        excerpt(&self.spec.text, self.spec.expressions.span(id))
    }

    /// A unit in the words of the model where they state it.
    fn unit_text(&self, id: ExpressionId, unit: Unit) -> String {
        self.words.unit_text(id, unit)
    }

    /// What the units of products are made of: "; `k*x` is N/m times m = N", or nothing.
    fn made_of(&self, parts: &[(ExpressionId, Unit)]) -> String {
        let each = parts.iter().filter_map(|&(id, unit)| {
            let factors = self.words.factors(id)?;
            let whole = self.words.readable(unit);
            Some(format!("`{}` is {factors} = {whole}", self.text(id)))
        });
        let each: Vec<String> = each.collect();
        match each.as_slice() {
            [] => String::new(),
            some => format!("; {}", some.join(" and ")),
        }
    }

    fn conflict(&mut self, at: ExpressionId, message: String) {
        let span = self.spec.expressions.span(at);
        self.conflicts.push((span, message));
    }

    fn examine(&mut self, id: ExpressionId) -> Known {
        let of = |e: ExpressionId| self.known[e.index()];
        match self.spec.expressions.node(id) {
            Node::Number(value) => self.number(id, value),
            Node::Time => Known::Is {
                unit: Unit::SECOND,
                size: 1.0,
                // `sin(time)` is meant as `sin(1*time)`.
                scaled: true,
                gain: false,
            },
            Node::Variable(v) | Node::Previous(v) => self.declared(v),
            Node::Derivative(v) => match self.declared(v) {
                Known::Is { unit, size, .. } => Known::is(unit.per(&Unit::SECOND), size),
                other => other,
            },
            Node::Negate(a) => match of(a) {
                Known::Literal { value, pure } => Known::Literal {
                    value: -value,
                    pure,
                },
                other => other,
            },
            Node::Not(_) => Known::Nothing,
            Node::Call(function, a) => self.call(id, function, a),
            Node::Binary(operator, a, b) => self.binary(id, operator, a, b),
            Node::If { yes, no, .. } => self.alike(id, yes, no, "in one branch and", " in another"),
            Node::Delay { value, .. } => of(value),
        }
    }

    fn declared(&self, v: VariableId) -> Known {
        let variable = self.spec.variable(v);
        let Some(unit) = variable.unit else {
            return Known::Nothing;
        };
        let text = variable.unit_text.as_deref().unwrap_or("");
        // A constant number may be a conversion, such as 3600.
        let number = matches!(
            variable.kind,
            VariableKind::Constant | VariableKind::Parameter
        ) && unit.is_one();
        let size = symbols::parse(text.trim()).map_or(f64::NAN, |found| found.size);
        Known::is(unit, if number { f64::NAN } else { size })
    }

    fn number(&self, id: ExpressionId, value: f64) -> Known {
        let span = self.spec.expressions.span(id);
        let written = self.spec.text.get(span.start..span.end).unwrap_or("");
        if written.starts_with(|c: char| c.is_ascii_digit()) {
            return literal(value);
        }
        // A constant of the library, perhaps by a name that an import made shorter.
        let short = written.rsplit('.').next().unwrap_or("");
        match constant(&format!("Modelica.Constants.{short}")) {
            Some((_, Some("1"))) => Known::Literal { value, pure: true },
            Some((_, Some(unit))) => symbols::parse(unit)
                .map_or(Known::Nothing, |found| Known::is(found.unit, found.size)),
            _ => Known::Literal { value, pure: false },
        }
    }

    fn call(&mut self, id: ExpressionId, function: Function, a: ExpressionId) -> Known {
        let argument = self.known[a.index()];
        match function {
            Function::Abs => argument,
            Function::Sign => Known::is(Unit::ONE, 1.0),
            Function::Sqrt => power(argument, 0.5),
            _ => {
                if let Known::Is {
                    unit,
                    scaled: false,
                    ..
                } = argument
                    && !unit.is_one()
                {
                    let message = format!(
                        "`{}`: the argument is {}, and has to be a pure number{}",
                        self.text(id),
                        self.unit_text(a, unit),
                        self.made_of(&[(a, unit)])
                    );
                    self.conflict(id, message);
                }
                match argument {
                    Known::Literal { pure, .. } => Known::Literal {
                        value: f64::NAN,
                        pure,
                    },
                    _ => Known::is(Unit::ONE, 1.0),
                }
            }
        }
    }

    fn binary(
        &mut self,
        id: ExpressionId,
        operator: Binary,
        a: ExpressionId,
        b: ExpressionId,
    ) -> Known {
        let (left, right) = (self.known[a.index()], self.known[b.index()]);
        match operator {
            Binary::Add => self.alike(id, a, b, "plus", ""),
            Binary::Subtract => self.alike(id, a, b, "minus", ""),
            Binary::Multiply => product(left, right),
            Binary::Divide => match (left, product(left, power(right, -1.0))) {
                // A quotient such as `m*v^2/2` is no gain.
                (
                    Known::Is { gain, .. },
                    Known::Is {
                        unit, size, scaled, ..
                    },
                ) => Known::Is {
                    unit,
                    size,
                    scaled,
                    gain,
                },
                (_, quotient) => quotient,
            },
            Binary::Power => self.raise(id, b, left, right),
            Binary::Min | Binary::Max => self.alike(id, a, b, "and", ""),
            Binary::Atan2 => {
                self.alike(id, a, b, "and", "");
                Known::is(Unit::ONE, 1.0)
            }
            Binary::And | Binary::Or => Known::Nothing,
            _ => {
                self.alike(id, a, b, "compared with", "");
                Known::Nothing
            }
        }
    }

    /// Two parts that have to be of the same unit: the unit of both.
    fn alike(
        &mut self,
        id: ExpressionId,
        a: ExpressionId,
        b: ExpressionId,
        word: &str,
        end: &str,
    ) -> Known {
        let (left, right) = (self.known[a.index()], self.known[b.index()]);
        if let (Some(u), Some(v)) = (left.certain(), right.certain())
            && !u.same(&v)
        {
            let message = format!(
                "`{}`: {} {word} {}{end}{}",
                self.text(id),
                self.unit_text(a, u),
                self.unit_text(b, v),
                self.made_of(&[(a, u), (b, v)])
            );
            self.conflict(id, message);
            return Known::Nothing;
        }
        self.compare_sizes(self.spec.expressions.span(id), [a, b]);
        match (left, right) {
            (
                Known::Is {
                    unit,
                    size,
                    scaled,
                    gain,
                },
                Known::Is {
                    unit: other,
                    size: another,
                    scaled: also,
                    gain: weak,
                },
            ) => Known::Is {
                unit: if gain { other } else { unit },
                size: if gain || size.is_nan() { another } else { size },
                scaled: scaled || also,
                gain: gain && weak,
            },
            (Known::Is { gain: false, .. }, _) => left,
            (_, Known::Is { gain: false, .. }) => right,
            (Known::Literal { pure: x, .. }, Known::Literal { pure: y, .. }) => Known::Literal {
                value: f64::NAN,
                pure: x && y,
            },
            _ => Known::Nothing,
        }
    }

    /// Keeps parts of one dimension whose sizes differ.
    fn compare_sizes(&mut self, at: Span, parts: [ExpressionId; 2]) {
        let known = parts.map(|p| self.known[p.index()]);
        let [Some(one), Some(other)] = known.map(Known::certain) else {
            return;
        };
        let sizes = known.map(Known::size);
        let factor = sizes[0] / sizes[1];
        if one.same(&other) && factor.is_finite() && (factor - 1.0).abs() > SAME_SIZE {
            self.sizes.push(SizeConflict { at, parts, sizes });
        }
    }

    fn raise(&mut self, id: ExpressionId, exponent: ExpressionId, base: Known, by: Known) -> Known {
        if let Some(unit) = by.certain()
            && !unit.is_one()
        {
            let message = format!(
                "`{}`: the exponent is {}, and has to be a pure number{}",
                self.text(id),
                self.unit_text(exponent, unit),
                self.made_of(&[(exponent, unit)])
            );
            self.conflict(id, message);
            return Known::Nothing;
        }
        match (base, by) {
            (_, Known::Literal { value, .. }) if value.is_finite() => power(base, value),
            (Known::Is { unit, .. }, _) if unit.is_one() => base,
            (Known::Literal { pure: true, .. }, _) => Known::is(Unit::ONE, 1.0),
            _ => Known::Nothing,
        }
    }

    fn equations(&mut self) {
        for equation in &self.spec.equations {
            let (mut left, mut right) = (equation.left, equation.right);
            let start = |id| self.spec.expressions.span(id).start;
            if start(left) > start(right) {
                std::mem::swap(&mut left, &mut right);
            }
            let units = (
                self.known[left.index()].certain(),
                self.known[right.index()].certain(),
            );
            if let (Some(u), Some(v)) = units
                && !u.same(&v)
            {
                let message = format!(
                    "`{}`: {} on the left and {} on the right{}",
                    excerpt(&self.spec.text, equation.span),
                    self.unit_text(left, u),
                    self.unit_text(right, v),
                    self.made_of(&[(left, u), (right, v)])
                );
                self.conflict(left, message);
            }
            self.compare_sizes(equation.span, [left, right]);
        }
    }

    fn values(&mut self) {
        for variable in &self.spec.variables {
            for (what, value) in [("value", variable.value), ("start", variable.start)] {
                let (Some(declared), Some(value)) = (variable.unit, value) else {
                    continue;
                };
                if let Some(unit) = self.known[value.index()].certain()
                    && !unit.same(&declared)
                {
                    let message = format!(
                        "`{}`, the {what} of `{}`: {}, and the variable is in {}{}",
                        self.text(value),
                        variable.name,
                        self.unit_text(value, unit),
                        variable.unit_text.as_deref().unwrap_or("1"),
                        self.made_of(&[(value, unit)])
                    );
                    self.conflict(value, message);
                }
            }
        }
    }
}

/// A literal is a pure number when it is a small whole number, the half of one, or the inverse of one.
fn literal(value: f64) -> Known {
    let size = value.abs();
    let whole = |v: f64| (v - v.round()).abs() < 1e-12;
    let pure = size == 0.0
        || (size <= 10.0 && whole(2.0 * size))
        || (size < 1.0 && 1.0 / size <= 10.5 && whole(1.0 / size));
    Known::Literal { value, pure }
}

fn product(a: Known, b: Known) -> Known {
    match (a, b) {
        (Known::Nothing, _) | (_, Known::Nothing) => Known::Nothing,
        (Known::Literal { value: x, pure: p }, Known::Literal { value: y, pure: q }) => {
            Known::Literal {
                value: x * y,
                pure: (p && q) || matches!(literal(x * y), Known::Literal { pure: true, .. }),
            }
        }
        (Known::Literal { value, pure }, Known::Is { unit, size, .. })
        | (Known::Is { unit, size, .. }, Known::Literal { value, pure }) => {
            if unit.is_one() {
                // `0.1*exp(x)` may stand for 0.1 V.
                let value = f64::NAN;
                return Known::Literal { value, pure };
            }
            if !pure {
                return Known::Nothing;
            }
            let fraction = value.is_finite() && value.fract() != 0.0;
            Known::Is {
                unit,
                size,
                scaled: true,
                gain: fraction,
            }
        }
        (
            Known::Is {
                unit, size, scaled, ..
            },
            Known::Is {
                unit: other,
                size: another,
                scaled: also,
                ..
            },
        ) => Known::Is {
            unit: unit.times(&other),
            size: size * another,
            scaled: scaled || also,
            gain: false,
        },
    }
}

fn power(base: Known, exponent: f64) -> Known {
    match base {
        Known::Literal { value, pure } => Known::Literal {
            value: value.powf(exponent),
            pure,
        },
        Known::Is {
            unit,
            size,
            scaled,
            gain,
        } => unit
            .power(exponent)
            .map_or(Known::Nothing, |unit| Known::Is {
                unit,
                size: size.powf(exponent),
                scaled,
                gain,
            }),
        Known::Nothing => Known::Nothing,
    }
}
