//! Curves of straight pieces, recognised in a sum, so that one instruction computes what eight a knot would.
//!
//! ```text
//! c1*max(0, min(1, (k2 - z)/w1)) + c2*max(0, min((z - k1)/w1, (k3 - z)/w2)) + ... + c_n*max(0, min(1, (z - k_m)/w_m))
//! ```

use crate::physics::expression::{Binary, ExpressionId, Expressions, Node};

/// Knots that differ by less than this part of the range are one: rounding of their differences.
const ROUNDING: f64 = 1e-9;

/// A sum with such a curve in it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StraightPieces {
    pub(super) argument: ExpressionId,
    pub(super) knots: Vec<f64>,
    /// The factors of the pieces: the values at the knots.
    pub(super) values: Vec<ExpressionId>,
    /// The other terms of the sum.
    pub(super) rest: Vec<ExpressionId>,
}

/// One straight side of a piece: zero at `zero`, one at `one`.
struct Side {
    argument: ExpressionId,
    zero: f64,
    one: f64,
}

/// A piece: its knot, and the knots beside it.
struct Piece {
    value: ExpressionId,
    argument: ExpressionId,
    before: Option<f64>,
    knot: f64,
    after: Option<f64>,
}

/// The curve in a sum; none where there is no sum, or no curve of at least two pieces that belong together.
pub(super) fn straight_pieces(of: &Expressions, sum: ExpressionId) -> Option<StraightPieces> {
    let terms = terms(of, sum)?;
    let (mut pieces, mut rest): (Vec<Piece>, Vec<ExpressionId>) = (vec![], vec![]);
    for term in terms {
        match piece(of, term) {
            Some(p)
                if pieces
                    .first()
                    .is_none_or(|first| same(of, first.argument, p.argument)) =>
            {
                pieces.push(p);
            }
            _ => rest.push(term),
        }
    }
    pieces.sort_by(|a, b| a.knot.total_cmp(&b.knot));
    let (first, last) = (pieces.first()?, pieces.last()?);
    let close = |a: f64, b: f64| (a - b).abs() <= ROUNDING * (last.knot - first.knot);
    let meet = |pair: &[Piece]| {
        pair[0].after.is_some_and(|a| close(a, pair[1].knot))
            && pair[1].before.is_some_and(|b| close(b, pair[0].knot))
    };
    let whole = first.before.is_none() && last.after.is_none() && pieces.windows(2).all(meet);
    (whole && first.knot < last.knot).then(|| StraightPieces {
        argument: first.argument,
        knots: pieces.iter().map(|p| p.knot).collect(),
        values: pieces.iter().map(|p| p.value).collect(),
        rest,
    })
}

/// The terms of a sum.
fn terms(of: &Expressions, sum: ExpressionId) -> Option<Vec<ExpressionId>> {
    let is_sum = |id| matches!(of.node(id), Node::Binary(Binary::Add, ..));
    let mut terms = Vec::new();
    let mut left = vec![sum];
    while let Some(id) = left.pop() {
        match of.node(id) {
            Node::Binary(Binary::Add, a, b) => left.extend([b, a]),
            _ => terms.push(id),
        }
    }
    is_sum(sum).then_some(terms)
}

fn piece(of: &Expressions, term: ExpressionId) -> Option<Piece> {
    let Node::Binary(Binary::Multiply, value, shape) = of.node(term) else {
        return None;
    };
    let Node::Binary(Binary::Max, zero, least) = of.node(shape) else {
        return None;
    };
    let Node::Binary(Binary::Min, a, b) = of.node(least) else {
        return None;
    };
    if number(of, zero) != Some(0.0) {
        return None;
    }
    let falls = |s: &Side| s.zero > s.one;
    let second = side(of, b)?;
    let (before, after) = match number(of, a) {
        Some(1.0) if falls(&second) => (None, Some(second.zero)),
        Some(1.0) => (Some(second.zero), None),
        Some(_) => return None,
        None => {
            let first = side(of, a)?;
            let range = (second.zero - first.zero).abs();
            let closed = (first.one - second.one).abs() <= ROUNDING * range
                && !falls(&first)
                && falls(&second)
                && same(of, first.argument, second.argument);
            if !closed {
                return None;
            }
            (Some(first.zero), Some(second.zero))
        }
    };
    Some(Piece {
        value,
        argument: second.argument,
        before,
        knot: second.one,
        after,
    })
}

/// `(z - a)/w` or `(a - z)/w`
fn side(of: &Expressions, id: ExpressionId) -> Option<Side> {
    let Node::Binary(Binary::Divide, difference, width) = of.node(id) else {
        return None;
    };
    let Node::Binary(Binary::Subtract, a, b) = of.node(difference) else {
        return None;
    };
    let width = number(of, width).filter(|w| *w > 0.0)?;
    match (number(of, a), number(of, b)) {
        (None, Some(zero)) => Some(Side {
            argument: a,
            zero,
            one: zero + width,
        }),
        (Some(zero), None) => Some(Side {
            argument: b,
            zero,
            one: zero - width,
        }),
        _ => None,
    }
}

fn number(of: &Expressions, id: ExpressionId) -> Option<f64> {
    match of.node(id) {
        Node::Number(value) => Some(value),
        Node::Negate(a) => match of.node(a) {
            Node::Number(value) => Some(-value),
            _ => None,
        },
        _ => None,
    }
}

/// Whether two expressions are written alike.
fn same(of: &Expressions, a: ExpressionId, b: ExpressionId) -> bool {
    let mut left = vec![(a, b)];
    while let Some((a, b)) = left.pop() {
        if a == b {
            continue;
        }
        let (x, y) = (of.node(a), of.node(b));
        let alike = match (x, y) {
            (Node::Negate(_), Node::Negate(_)) => true,
            (Node::Call(f, _), Node::Call(g, _)) => f == g,
            (Node::Binary(f, ..), Node::Binary(g, ..)) => f == g,
            // Others are compared as they stand: leaves by what they are, the rest by their operands' places.
            _ => x == y,
        };
        if !alike {
            return false;
        }
        left.extend(x.operands().zip(y.operands()));
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::Hold;
    use crate::physics::parse;
    use crate::physics::simulation::{Direction, Excitation, Plant};

    const PIECES: [&str; 3] = [
        "max(0, min(1, ((0.1) - (y - 0.1*u))/0.6))",
        "max(0, min(((y - 0.1*u) - (-0.5))/0.6, ((0.7) - (y - 0.1*u))/0.6))",
        "max(0, min(1, ((y - 0.1*u) - (0.1))/0.6))",
    ];

    /// A plant with the sum of these products.
    fn plant(products: &[String]) -> Plant {
        let text = format!(
            "model Curve
               parameter Real a = 0.4; parameter Real b = -0.3; parameter Real c = 0.9;
               input Real u; output Real y; Real x(start=0.2);
             equation
               der(x) = u - x + {}; y = x;
             end Curve;",
            products.join(" + ")
        );
        Plant::new(parse(&text).unwrap())
    }

    #[test]
    fn a_curve_is_computed_as_its_pieces_are() {
        let recognised = |plant: &Plant| {
            let spec = &plant.spec;
            (spec.equations.iter()).any(|e| straight_pieces(&spec.expressions, e.rest).is_some())
        };
        let each = |form: &dyn Fn(&str, &str) -> String| -> Vec<String> {
            let named = ["a", "b", "c"].into_iter().zip(PIECES);
            named.map(|(name, piece)| form(name, piece)).collect()
        };
        let curve = plant(&each(&|name, piece| format!("{name}*{piece}")));
        let pieces = plant(&each(&|name, piece| format!("{piece}*{name}")));
        assert!(recognised(&curve) && !recognised(&pieces));
        // Pieces that do not meet are no curve.
        let apart = plant(&[format!("a*{}", PIECES[0]), format!("b*{}", PIECES[1])]);
        assert!(!recognised(&apart));

        let input: Vec<f64> = (0..300)
            .map(|k| 1.5 * (0.13 * f64::from(k)).sin())
            .collect();
        let excitation = Excitation {
            inputs: &[&input],
            length: 300,
            sample_time: 0.1,
            start_time: 0.0,
            hold: Hold::Zero,
        };
        let directions: Vec<Direction> = (0..3).map(Direction::Parameter).collect();
        let of = |plant: &Plant| {
            let run = plant.simulate(&plant.nominal(), &excitation, None).unwrap();
            let slopes =
                plant.sensitivities(&plant.nominal(), &excitation, None, &run.plan, &directions);
            (run.outputs[0].clone(), slopes[0].concat())
        };
        let ((y, slopes), (expected, expected_slopes)) = (of(&curve), of(&pieces));
        let far = |a: &[f64], b: &[f64]| {
            let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
            apart.fold(0.0, f64::max)
        };
        assert!(
            y.iter().copied().fold(0.0, f64::max) > 0.7,
            "all knots are passed"
        );
        assert!(far(&y, &expected) < 1e-9);
        assert!(far(&slopes, &expected_slopes) < 1e-6);
    }
}
