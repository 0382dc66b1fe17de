//! Kinds, order, solved equations, and what is said where they do not exist.

use crate::physics::expression::{ExpressionId, Node};
use crate::physics::spec::{ModelSpec, Unknown, VariableKind};
use crate::physics::syntax::parse;
use std::fmt::Write as _;
use std::time::{Duration, Instant};

fn message(text: &str) -> String {
    match parse(text) {
        Ok(_) => "no error".into(),
        Err(error) => error.to_string(),
    }
}

/// Value of an expression, where variables have the values given by their names.
fn value(spec: &ModelSpec, id: ExpressionId, of: &dyn Fn(&str) -> f64) -> f64 {
    let v = |id| value(spec, id, of);
    match spec.expressions.node(id) {
        Node::Number(number) => number,
        Node::Variable(x) | Node::Derivative(x) | Node::Previous(x) => of(&spec.variable(x).name),
        Node::Negate(a) => -v(a),
        Node::Binary(f, a, b) => super::constants::binary(f, v(a), v(b)),
        Node::Call(f, a) => super::constants::call(f, v(a)),
        Node::If { condition, yes, no } => {
            if v(condition) > 0.5 {
                v(yes)
            } else {
                v(no)
            }
        }
        node => panic!("{node:?}"),
    }
}

#[test]
fn equations_are_solved_for_their_unknown() {
    let of = |name: &str| match name {
        "a" => 2.0,
        "b" => 3.0,
        "c" => 5.0,
        _ => f64::NAN,
    };
    for (equation, wanted) in [
        ("y = a", 2.0),
        ("a = y", 2.0),
        ("-y = a", -2.0),
        ("a*y = b", 1.5),
        ("a*(y + b) = c", -0.5),
        ("a - y = b", -1.0),
        ("a - (b - y) = c", 6.0),
        ("y/a + y/b = c", 6.0),
        ("y = c - 2*y", 5.0 / 3.0),
        ("a*y - b + y*c = -(y - a)", 5.0 / 8.0),
        ("(if a > 0 then b*y else a) = c", 5.0 / 3.0),
        ("0 = (if a < 0 then a else y - c)", 5.0),
        ("(if a > 0 then 2*y + a else y)/(-a) = c", -6.0),
        ("y - a = 2*a - b*(c - y)*(-1)", 21.0 / 4.0),
        ("0 = y", 0.0),
        ("y*0.5 = 0.5*y + y - a", 2.0),
    ] {
        let text = format!(
            "model A parameter Real a = 2; input Real b, c; Real y; equation {equation}; end A;"
        );
        let spec = parse(&text).unwrap();
        let solved = spec.equations[0];
        let factor = solved.coefficient.map_or(1.0, |c| value(&spec, c, &of));
        let y = value(&spec, solved.rest, &of) / factor;
        let residual = |y: f64| {
            let of = |name: &str| if name == "y" { y } else { of(name) };
            value(&spec, solved.left, &of) - value(&spec, solved.right, &of)
        };
        assert!(residual(y).abs() < 1e-12, "{equation}: {y}");
        assert!((y - wanted).abs() < 1e-12, "{equation}: {y}");
    }
}

#[test]
fn the_unknown_stands_on_the_left_and_solutions_are_short() {
    let spec = parse("model A parameter Real J = 1, d = 2; input Real u; Real w; Real t; equation u - d*w = J*der(w); t = u; end A;").unwrap();
    let w = spec.find("w").unwrap();
    let equation = spec.equations[0];
    assert_eq!(equation.unknown, Unknown::Derivative(w));
    assert!(matches!(
        spec.expressions.node(equation.left),
        Node::Binary(..)
    ));
    assert_eq!(equation.rest, equation.right);
    let Some(coefficient) = equation.coefficient else {
        panic!()
    };
    assert_eq!(
        spec.expressions.node(coefficient),
        Node::Variable(spec.find("J").unwrap())
    );
    assert_eq!(spec.equations[1].coefficient, None);
}

#[test]
fn kinds_and_order() {
    let spec = parse(
        "model A parameter Real w0 = sqrt(k/m); parameter Real k(min=1, max=10) = 2*c; parameter Real m(start=3);
         constant Real c = 2; final parameter Real f = 3; parameter Real r = f + c; input Real u;
         output Real y(start=1); output Real acc = der(y); Real z; Real n(min=-Modelica.Constants.inf, max=c^2, nominal=1e3);
         equation der(y) = -z*w0*r; z = n; n = u; end A;",
    )
    .unwrap();
    let kinds = |kind| -> Vec<&str> {
        spec.of_kind(kind)
            .map(|v| spec.variable(v).name.as_str())
            .collect()
    };
    assert_eq!(kinds(VariableKind::Constant), ["w0", "c", "f"]);
    assert_eq!(kinds(VariableKind::Parameter), ["k", "m", "r"]);
    assert_eq!(kinds(VariableKind::State), ["y"]);
    assert_eq!(kinds(VariableKind::Algebraic), ["acc", "z", "n"]);
    let order: Vec<&str> = spec
        .constants
        .iter()
        .map(|&v| spec.variable(v).name.as_str())
        .collect();
    assert_eq!(order, ["c", "k", "m", "w0", "f", "r"]);
    let solved: Vec<&str> = spec
        .equations
        .iter()
        .map(|e| spec.variable(e.unknown.variable()).name.as_str())
        .collect();
    assert_eq!(solved, ["n", "z", "y", "acc"]);
    let n = spec.variable(spec.find("n").unwrap());
    assert_eq!(
        (n.min, n.max, n.nominal),
        (f64::NEG_INFINITY, 4.0, Some(1e3))
    );
    assert!(spec.variable(spec.find("m").unwrap()).value.is_some());
}

#[test]
fn wrong_values_are_named() {
    for (declarations, wanted) in [
        (
            "parameter Real p;",
            "line 2, column 16: the parameter `p` has no value: write `= value` behind its name",
        ),
        (
            "constant Real p;",
            "line 2, column 15: the constant `p` has no value: write `= value` behind its name",
        ),
        (
            "parameter Real p = q; parameter Real q = 2*p;",
            "line 2, column 16: `p` and `q` need each other's value",
        ),
        (
            "parameter Real p = p + 1;",
            "line 2, column 16: the value of `p` needs itself",
        ),
        (
            "parameter Real p = 2*x;",
            "line 2, column 22: the value of `p` may use numbers, constants and parameters only: `x` is a state",
        ),
        (
            "parameter Real p = time;",
            "line 2, column 20: the value of `p` may use numbers, constants and parameters only: `time` changes",
        ),
        (
            "Real z(start=u) = 1;",
            "line 2, column 14: the start of `z` may use numbers, constants and parameters only: `u` is an input",
        ),
        (
            "Real z(max=z) = 1;",
            "line 2, column 12: the max of `z` may use numbers, constants and parameters only: `z` is determined by an equation",
        ),
        (
            "parameter Real p(min=0, max=3) = 5;",
            "line 2, column 16: the value 5 of `p` is outside its bounds: min = 0, max = 3",
        ),
        (
            "parameter Real p(min=4, max=3) = 5;",
            "line 2, column 16: min = 4 of `p` is above its max = 3",
        ),
        (
            "parameter Real p = 1/0;",
            "line 2, column 16: the value of `p` is not a finite number",
        ),
        (
            "Real z(start=5, max=3) = 1;",
            "line 2, column 6: the start 5 of `z` is outside its bounds: min = -inf, max = 3",
        ),
        (
            "Real z = delay(x, u);",
            "line 2, column 19: the time of a delay may use numbers, constants and parameters only: `u` changes",
        ),
        (
            "Real z = delay(x, -1);",
            "line 2, column 19: the time of a delay has to be zero or more",
        ),
        (
            "Real z = der(Modelica.Constants.pi);",
            "line 2, column 10: `der(Modelica.Constants.pi)`: the derivative of a constant is zero",
        ),
        (
            "parameter Real p = 1; Real z = der(p);",
            "line 2, column 32: `der(p)`: `p` does not change, its derivative is zero",
        ),
    ] {
        let text =
            format!("model A input Real u; Real x;\n{declarations}\nequation der(x) = u; end A;");
        assert_eq!(message(&text), wanted, "{declarations}");
    }
}

#[test]
fn wrong_equations_are_named() {
    let head = "model A\ninput Real u;\nReal x, y, z;\nequation\n";
    for (equations, wanted) in [
        (
            "x = u;\ny = u;",
            "line 3, column 12: no equation determines `z`: add one, such as `z = ...;`, or declare `z` as an `input` or a `parameter`",
        ),
        (
            "x = u;\ny = x;\nx = 2*u;\nz = y;",
            "line 7, column 1: `x` is determined twice: here and by `x = u` in line 5, column 1; remove one of the two equations",
        ),
        (
            "x = u;\ny = x;\nz = y;\nx + y + z = u;",
            "line 8, column 1: this equation has nothing left to determine: other equations determine `x` by line 5, `y` by line 6 and `z` by line 7 (4 equations for 3 unknowns)",
        ),
        (
            "der(x) = u;\nx = 2*u;\ny = u; z = u;",
            "line 6, column 1: this equation determines nothing: `x` is a state, which other equations determine by their derivatives; remove it, or the equation for the derivative",
        ),
        (
            "x = u;\ny = z;",
            "line 3, column 12: no equation determines `z`: add one, such as `z = ...;`, or declare `z` as an `input` or a `parameter`",
        ),
        (
            "x = u;\ny = z + x;\nz = 2*y;",
            "line 6, column 1: algebraic loop: `y` and `z` need each other at the same instant (lines 6 and 7); solve the equations by hand for one of them, or give one a small inertia or time constant, as in `T*der(y) = ... - y`",
        ),
        (
            "x = y + z;\ny = x - sin(z);\nz = y;",
            "line 6, column 1: algebraic loop: `y` and `z` need each other at the same instant (lines 6 and 7); solve the equations by hand for one of them, or give one a small inertia or time constant, as in `T*der(y) = ... - y`",
        ),
        (
            "x + y = u;\nx - y = u;\nx + 2*y = 1;\nz = x;",
            "line 7, column 1: 3 equations (lines 5, 6 and 7) for 2 unknowns: `x` and `y` (4 equations for 3 unknowns in all)",
        ),
        (
            "der(x) + der(y) = u;\nder(x) - der(y) = 0;\nz = u;",
            "line 5, column 1: algebraic loop: `der(x)` and `der(y)` need each other at the same instant (lines 5 and 6); solve the equations by hand for one of them, and put the solution into the other equations",
        ),
        (
            "x = u; y = u;\nz^3 = u;",
            "line 6, column 1: `z^3 = u` has to determine `z`, and is not linear in it: it stands inside `z^3`; write it solved for `z`",
        ),
        (
            "x = u; y = u;\nz*z = u;",
            "line 6, column 1: `z*z = u` has to determine `z`, and is not linear in it: it is multiplied by itself in `z*z`; write it solved for `z`",
        ),
        (
            "x = u; y = u;\nu = 1/z;",
            "line 6, column 5: `u = 1/z` has to determine `z`, and is not linear in it: it stands in the denominator of `1/z`; write it solved for `z`",
        ),
        (
            "x = u; y = u;\nz = if z > 0 then 1 else 2;",
            "line 6, column 8: `z = if z > 0 then 1 else 2` has to determine `z`, and is not linear in it: it stands inside `z > 0`; write it solved for `z`",
        ),
        (
            "x = u; y = u;\nz = delay(z, 1) + u;",
            "line 6, column 5: `z = delay(z, 1) + u` has to determine `z`, and is not linear in it: its present value is needed by `delay(z, 1)`; write it solved for `z`",
        ),
        (
            "x = u; y = u;\nz - z = u;",
            "line 6, column 1: `z - z = u` has to determine `z`, and is not linear in it: it cancels out; write it solved for `z`",
        ),
    ] {
        let text = format!("{head}{equations}\nend A;");
        let answer = message(&text);
        // Which member of a pair is named first is not part of the contract.
        let other = wanted
            .replace("der(y) = ... - y", "der(z) = ... - z")
            .replace("`y` and `z`", "`z` and `y`")
            .replace("`der(x)` and `der(y)`", "`der(y)` and `der(x)`");
        assert!(
            answer == wanted || answer == other,
            "{equations}\n{answer}\n{wanted}"
        );
    }
}

#[test]
fn ten_thousand_equations_in_reverse_order_are_sorted_quickly() {
    const COUNT: usize = 10_000;
    let mut text = String::from("model A input Real u;\n");
    for i in 0..COUNT {
        let _ = writeln!(
            text,
            "Real x{i}; parameter Real p{i} = {};",
            if i + 1 < COUNT {
                format!("p{} + 1", i + 1)
            } else {
                "1".into()
            }
        );
    }
    text.push_str("equation\n");
    for i in 0..COUNT - 1 {
        let _ = writeln!(text, "x{i} = p{i}*x{} + u;", i + 1);
    }
    let good = format!("{text}x{} = u;\nend A;", COUNT - 1);
    let ring = format!("{text}x{} = x0;\nend A;", COUNT - 1);
    let start = Instant::now();
    let spec = parse(&good).unwrap();
    assert_eq!(spec.equations.len(), COUNT);
    assert_eq!(
        spec.variable(spec.equations[0].unknown.variable()).name,
        format!("x{}", COUNT - 1)
    );
    assert!(spec.parameters().len() == 1 && spec.constants.len() == COUNT);
    assert!(message(&ring).contains("and 9992 more need each other at the same instant (lines"));
    let lost = good.replace("x5 = p5*x6 + u;", "x5 = p5*y6 + u;");
    assert!(message(&lost).ends_with("`y6` is not declared; did you mean `p6`?"));
    assert!(
        start.elapsed() < Duration::from_secs(10),
        "{:?}",
        start.elapsed()
    );
}

/// All messages on a text, without the excerpt.
fn messages(text: &str) -> Vec<String> {
    match crate::physics::diagnose(text) {
        Ok(_) => vec![],
        Err(errors) => errors.iter().map(ToString::to_string).collect(),
    }
}

#[test]
fn what_is_not_determined_is_said_with_what_to_add() {
    for (declarations, equations, wanted) in [
        (
            "Real x(start=0), v(start=1);",
            "der(x) = v;",
            "line 2, column 18: `v` has a start value but no equation for `der(v)`: add one, such as `der(v) = ...;`",
        ),
        (
            "Real x(start=0); Real v(start=1);",
            "der(x) = u;",
            "line 2, column 23: `v` has a start value but no equation for `der(v)`: add one, such as `der(v) = ...;`",
        ),
        (
            "Real x; output Real y;",
            "der(x) = -x + u;",
            "line 2, column 21: no equation determines the output `y`: add one, such as `y = ...;`",
        ),
        (
            "Real x; Real a;",
            "a = der(x);",
            "line 2, column 6: no equation determines `der(x)`: add one, such as `der(x) = ...;`",
        ),
        (
            "Real x; Real y;",
            "x + y = u;",
            "line 2, column 6: 1 equation is missing (1 equation for 2 unknowns): the others do not determine `x` and `y`",
        ),
        (
            "Real x; Real y = u;",
            "der(x) = y; y = 2*u;",
            "line 4, column 13: `y` is determined twice: here and by `y = u` in line 2, column 14; remove one of the two equations",
        ),
        (
            "Real x;",
            "x = u; x = 3;",
            "line 4, column 8: `x` is determined twice: here and by `x = u` in line 4, column 1; remove one of the two equations",
        ),
        (
            "Real x = 1;",
            "der(x) = u;",
            "line 2, column 6: `x` is a state, because `der(x)` is used, and `= 1` gives it a second equation: a start value is written `x(start=1)`",
        ),
        (
            "Real x; parameter Real a = 1, b = 2;",
            "der(x) = u; a = 2*b;",
            "line 4, column 13: this equation determines nothing: it has only inputs, parameters and numbers; a parameter that follows from others is declared with its value, as in `parameter Real b = 2*a;`",
        ),
        (
            "Real x; Real v;",
            "der(x) = u; der(v) = u; x = 2*v;",
            "line 4, column 25: this equation determines nothing: `x` and `v` are states, which other equations determine by their derivatives; a relation between states has to be differentiated by hand, and one of them computed from the others",
        ),
    ] {
        let text = format!("model A input Real u;\n{declarations}\nequation\n{equations}\nend A;");
        assert_eq!(messages(&text), [wanted], "{declarations} {equations}");
    }
}

#[test]
fn independent_errors_are_all_reported() {
    for (text, wanted) in [
        (
            "model A\nReal x(strat=1);\nReal y;\nequation\nder(x) = -x;\ny := 3*x;\nend A;",
            vec![
                "line 2, column 8: `strat` is not an attribute; did you mean `start`?",
                "line 6, column 3: `:=` stands in algorithms only: write `=`",
            ],
        ),
        (
            "model A\nReal x\nReal omega;\nequation\nder(x) = -omga;\nomega = 3*y;\nend A;",
            vec![
                "line 2, column 6: a `;` is missing at the end of this line",
                "line 5, column 11: `omga` is not declared; did you mean `omega`?",
                "line 6, column 11: `y` is not declared",
            ],
        ),
        (
            "model A\nparameter Real a;\nparameter Real b(min=2) = 1;\nparameter Real c;\nReal x;\nequation\nder(x) = a*b*c;\nend A;",
            vec![
                "line 2, column 16: the parameter `a` has no value: write `= value` behind its name",
                "line 4, column 16: the parameter `c` has no value: write `= value` behind its name",
            ],
        ),
        (
            "model A\nReal x(unit=\"m\"), v(unit=\"m/s\"), y;\nequation\nder(x) = v + x;\nder(v) = -x + v;\ny = sin(x);\nend A;",
            vec![
                "line 4, column 10: unit conflict: `v + x`: m/s plus m",
                "line 5, column 10: unit conflict: `-x + v`: m plus m/s",
                "line 6, column 5: unit conflict: `sin(x)`: the argument is m, and has to be a pure number",
            ],
        ),
        (
            "model A\nReal x, y, z;\nequation\nx = 1;\nx = 2;\ny = 1;\nend A;",
            vec![
                "line 2, column 12: no equation determines `z`: add one, such as `z = ...;`, or declare `z` as an `input` or a `parameter`",
                "line 5, column 1: `x` is determined twice: here and by `x = 1` in line 4, column 1; remove one of the two equations",
            ],
        ),
        (
            "model A\nReal x;\nder(x) = 3*q;\nder(x) = 2;\nend A;",
            vec![
                "line 3, column 1: an equation before the word `equation`: put that word in a line above it",
            ],
        ),
    ] {
        assert_eq!(messages(text), wanted, "{text}");
    }
    let many = "Real a b;\n".repeat(100);
    assert_eq!(
        messages(&format!("model A\n{many}equation\nend A;")).len(),
        8
    );
}

#[test]
fn the_sample_before_is_known_of_what_changes_at_samples_only() {
    let with = |equations: &str| {
        message(&format!(
            "model M parameter Real k = 1; input Real u; output Real y; Real p(start=1); Real x; equation {equations} end M;"
        ))
    };
    assert_eq!(
        with("der(x) = p - x; p = 0.5*pre(p) + k*u; y = x;"),
        "no error"
    );
    for (equations, why) in [
        (
            "der(x) = u; p = x + pre(p); y = p;",
            "`p` follows from the state `x`",
        ),
        ("der(x) = u; p = u; y = pre(x) + p;", "`x` is a state"),
        (
            "der(x) = u; p = time; y = pre(p);",
            "`p` follows from `time`",
        ),
        ("der(x) = u; p = u; y = p + pre(u);", "write `q = u`"),
    ] {
        let said = with(equations);
        assert!(said.contains(why), "{equations}: {said}");
    }
    let said = with("der(x) = u; p = pre(u + 1); y = p;");
    assert!(said.contains("`pre` takes"), "{said}");
}
