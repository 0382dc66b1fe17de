//! Grammar, and the message of every kind of error.

use super::parse;
use crate::physics::expression::{Binary, ExpressionId, Node};
use crate::physics::spec::{ModelSpec, VariableKind};

fn show(spec: &ModelSpec, id: ExpressionId) -> String {
    let of = |id| show(spec, id);
    match spec.expressions.node(id) {
        Node::Number(value) => format!("{value}"),
        Node::Time => "time".into(),
        Node::Variable(v) => spec.variable(v).name.clone(),
        Node::Derivative(v) => format!("der({})", spec.variable(v).name),
        Node::Negate(a) => format!("(-{})", of(a)),
        Node::Not(a) => format!("(not {})", of(a)),
        Node::Call(f, a) => format!("{f:?}({})", of(a)),
        Node::Binary(Binary::Power, a, b) => format!("({}^{})", of(a), of(b)),
        Node::Binary(f, a, b) => {
            let sign = match f {
                Binary::Add => "+",
                Binary::Subtract => "-",
                Binary::Multiply => "*",
                Binary::Divide => "/",
                _ => return format!("{f:?}({}, {})", of(a), of(b)),
            };
            format!("({}{sign}{})", of(a), of(b))
        }
        Node::If { condition, yes, no } => {
            format!("(if {} then {} else {})", of(condition), of(yes), of(no))
        }
        Node::Previous(v) => format!("pre({})", spec.variable(v).name),
        Node::Delay { value, time } => format!("delay({}, {})", of(value), of(time)),
    }
}

/// The right side of `y = ...` with all parentheses.
pub(super) fn right(expression: &str) -> String {
    let text =
        format!("model A input Real a, b, c, d; output Real y; equation y = {expression}; end A;");
    match parse(&text) {
        Ok(spec) => show(&spec, spec.equations[0].right),
        Err(error) => error.kind.to_string(),
    }
}

pub(super) fn error(text: &str) -> String {
    match parse(text) {
        Ok(_) => "no error".into(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn precedence_is_that_of_modelica() {
    for (expression, wanted) in [
        ("-a^2", "(-(a^2))"),
        ("-a*b", "(-(a*b))"),
        ("-a + b", "((-a)+b)"),
        ("a - b - c", "((a-b)-c)"),
        ("a/b*c", "((a/b)*c)"),
        ("a + b*c^2", "(a+(b*(c^2)))"),
        ("(a + b)*c", "((a+b)*c)"),
        ("(a^b)^c", "((a^b)^c)"),
        ("2^(-1)", "(2^(-1))"),
        ("+a", "a"),
        ("a*(-b)", "(a*(-b))"),
        ("noEvent(a) + smooth(1, b)", "(a+b)"),
        ("Modelica.Math.sin(a)", "Sin(a)"),
        ("Modelica.Constants.pi", "3.141592653589793"),
        (
            "if a > 0 and b > 0 or not c > 0 then 1 elseif true then 2 else 3",
            "(if Or(And(Greater(a, 0), Greater(b, 0)), (not Greater(c, 0))) then 1 else (if 1 then 2 else 3))",
        ),
        (
            "if a + b <= c*d then a else b",
            "(if LessOrEqual((a+b), (c*d)) then a else b)",
        ),
        (
            "if noEvent(a <> b) then 1 else 0",
            "(if NotEqual(a, b) then 1 else 0)",
        ),
        ("delay(a, 0.5, 2*0.5)", "delay(a, 0.5)"),
        ("atan2(a, max(b, 1e-3))", "Atan2(a, Max(b, 0.001))"),
    ] {
        assert_eq!(right(expression), wanted, "{expression}");
    }
}

#[test]
fn wrong_expressions_say_what_is_wrong() {
    for (expression, wanted) in [
        (
            "a^b^c",
            "a power of a power needs parentheses: write `(a^b)^c` or `a^(b^c)`",
        ),
        (
            "a*-b",
            "a sign behind an operator needs parentheses: write `(-a)`",
        ),
        (
            "1 + if a > 0 then 1 else 2",
            "an if-expression behind an operator needs parentheses: write `(if a then b else c)`",
        ),
        (
            "a + (b > c)",
            "`b > c` is a condition, and a number is needed here",
        ),
        (
            "if a then 1 else 2",
            "`a` is a number, and a condition is needed here, such as `x > 0`",
        ),
        (
            "if a > 0 then 1",
            "expected an operator, `elseif` or `else`: an if-expression needs a value for every case, found `;`",
        ),
        (
            "if a < b < c then 1 else 2",
            "`a < b` is compared once more: comparisons are joined with `and`, as in `a < b and b < c`",
        ),
        ("sin(a, b)", "`sin` takes 1 argument, 2 are given"),
        ("max(a)", "`max` takes 2 arguments, 1 is given"),
        ("delay(a)", "`delay` takes 2 arguments, 1 is given"),
        (
            "smooth(a, b)",
            "`a` is the order of `smooth`, and must be a whole number",
        ),
        (
            "sine(a)",
            "`sine` is not a known function; did you mean `sin`?",
        ),
        (
            "(a + b",
            "expected `)` that closes the `(` of line 1, or an operator, found `;`",
        ),
        (
            "a b",
            "expected `;` or an operator behind the equation, found `b`",
        ),
        ("\"a\"", "a text stands where a number is needed"),
        ("", "expected a number, a name or `(`, found `;`"),
        (
            "a .* b",
            "`.*` is outside the flat subset of Modelica: write `*`",
        ),
        (
            "a && b",
            "conditions are joined with `and`, `or` and `not`; unequal is `<>`",
        ),
        (
            "{a, b}",
            "arrays are outside the flat subset of Modelica: write one variable for each element, as in `x1`, `x2`, `x3`",
        ),
        (
            "a[1]",
            "arrays are outside the flat subset of Modelica: write one variable for each element, as in `x1`, `x2`, `x3`",
        ),
        (
            "pre(a)",
            "`pre(a)` is the value at the sample before, and needs a variable whose equation has inputs, parameters and `pre` only; write `q = a` and `pre(q)`",
        ),
        (
            "der(a + b)",
            "`der` takes the name of one variable: give the expression a name of its own, as in `v = der(x)`, and write `der` of that name",
        ),
        ("a = b", "a second `=` in one equation: write two equations"),
        ("y2", "`y2` is not declared; did you mean `y`?"),
        ("q", "`q` is not declared"),
        ("e3", "`e3` is not declared; did you mean `1e3`?"),
        (
            "g",
            "`g` is not declared; did you mean `Modelica.Constants.g_n`?",
        ),
        ("tme", "`tme` is not declared; did you mean `time`?"),
        (
            "Modelica.Constants.PI",
            "`Modelica.Constants.PI` is not declared; did you mean `Modelica.Constants.pi`?",
        ),
        (
            "der(a)",
            "`der(a)`: `a` is an input, whose derivative is not known; give the rate an input of its own, or filter `a` by a state",
        ),
    ] {
        assert_eq!(right(expression), wanted, "{expression}");
    }
}

#[test]
fn wrong_texts_say_line_and_column() {
    for (text, wanted) in [
        (
            "",
            "line 1, column 1: the text is empty: expected `model Name ... end Name;`",
        ),
        (
            " // nothing\n",
            "line 2, column 1: the text is empty: expected `model Name ... end Name;`",
        ),
        (
            "t,u,y\n1,2,3",
            "line 1, column 1: expected `model`: the text has to read `model Name ... end Name;`, found `t`",
        ),
        (
            "model A\nReal x;\nequation\nder(x) = -x;\nend B;",
            "line 5, column 5: `end B` does not match `model A`",
        ),
        (
            "model A\nReal x;\nequation\nder(x) = -x;\nend A",
            "line 5, column 6: expected `;` at the end of the model, found the end of the text",
        ),
        (
            "model A Real x; equation der(x) = -x; end A; model B end B;",
            "line 1, column 46: expected nothing behind the model: a text holds one model, found `model`",
        ),
        (
            "model A\nend A;",
            "line 1, column 1: the model `A` declares no variable",
        ),
        (
            "model A\nReal x;\nReal omega;\n Real x;",
            "line 4, column 7: `x` is declared twice: first in line 2, column 6",
        ),
        (
            "model A\nReal x, omega;\nequation\nder(omega) = -omga; x = 1; end A;",
            "line 4, column 15: `omga` is not declared; did you mean `omega`?",
        ),
        (
            "model A Real when; end A;",
            "line 1, column 14: `when` is a word of the language and cannot be a name",
        ),
        (
            "model A Real time; end A;",
            "line 1, column 14: `time` is a word of the language and cannot be a name",
        ),
        (
            "model A real x; end A;",
            "line 1, column 9: `real` is not a type; did you mean `Real`?",
        ),
        (
            "model A parameter J = 3; end A;",
            "line 1, column 19: `J` has no type: write `Real J`",
        ),
        (
            "model A Real x; x = 3; end A;",
            "line 1, column 17: `x` starts neither a declaration such as `Real x;` nor, before the word `equation`, an equation",
        ),
        (
            "model A Real x; der(x) = 3; end A;",
            "line 1, column 17: an equation before the word `equation`: put that word in a line above it",
        ),
        (
            "model A Real x; equation x == 3; end A;",
            "line 1, column 26: an equation is written with `=`; `==` compares",
        ),
        (
            "model A Real x; equation x := 3; end A;",
            "line 1, column 28: `:=` stands in algorithms only: write `=`",
        ),
        (
            "model A Real x; equation x = 3; Real y; end A;",
            "line 1, column 33: declarations stand before the word `equation`",
        ),
        (
            "model A Real x(strat=1); end A;",
            "line 1, column 16: `strat` is not an attribute; did you mean `start`?",
        ),
        (
            "model A Real x(start=1, start=2); end A;",
            "line 1, column 25: the attribute `start` is given twice",
        ),
        (
            "model A Real x(unit=m); end A;",
            "line 1, column 21: expected a text in quotes, such as `unit=\"m/s\"`, found `m`",
        ),
        (
            "model A Real x(fixed=1); end A;",
            "line 1, column 22: expected `true` or `false`, found `1`",
        ),
        (
            "model A input Real u = 3; end A;",
            "line 1, column 22: the input `u` is given from outside, and can have no binding: remove it, or remove `input`",
        ),
        (
            "model A parameter input Real u; end A;",
            "line 1, column 9: a variable is only one of `constant`, `parameter`, `input` and `output`",
        ),
        (
            "model A Real x annotation(a(b=1); end A;",
            "line 1, column 16: this annotation has no end: a closing `)` is missing",
        ),
    ] {
        assert_eq!(error(text), wanted, "{text}");
    }
}

#[test]
fn what_is_outside_the_subset_is_named() {
    for (text, wanted) in [
        ("model A Real x[3]; end A;", "arrays are outside"),
        ("model A Real[3] x; end A;", "arrays are outside"),
        ("model A Integer n; end A;", "`Integer` is outside"),
        ("model A discrete Real n; end A;", "`discrete` is outside"),
        ("model A flow Real n; end A;", "`flow` is outside"),
        ("model A extends B; end A;", "`extends` is outside"),
        (
            "model A replaceable Real x; end A;",
            "`replaceable` is outside",
        ),
        (
            "model A Modelica.Blocks.Sources.Step s; end A;",
            "a component of the type `Modelica.Blocks.Sources.Step` is outside",
        ),
        (
            "model A Modelica.Blocks.Interfaces.RealInput u; end A;",
            "declare it `input Real`",
        ),
        (
            "model A Real x if b; end A;",
            "conditional declarations are outside",
        ),
        (
            "model A Real x; initial equation x = 1; end A;",
            "`initial` is outside",
        ),
        (
            "model A Real x; algorithm x := 1; end A;",
            "`algorithm` is outside",
        ),
        (
            "model A Real x; equation when x > 1 then end when; end A;",
            "`when` is outside",
        ),
        (
            "model A Real x; equation for i in 1:3 loop end for; end A;",
            "`for` is outside",
        ),
        (
            "model A Real x; equation connect(a, b); end A;",
            "`connect` is outside",
        ),
        (
            "model A Real x; equation if x > 1 then x = 1; end if; end A;",
            "`if` is outside",
        ),
        (
            "model A Real x; equation reinit(x, 1); end A;",
            "`reinit` is outside",
        ),
        ("function f end f;", "`function` is outside"),
        (
            "model A = B;",
            "a model that is another one with changes is outside",
        ),
    ] {
        assert!(error(text).contains(wanted), "{text}: {}", error(text));
    }
    assert!(error("model A extends B; end A;").contains("OpenModelica"));
}

#[test]
fn all_of_the_surroundings_are_accepted() {
    let text = r#"
within Plants;
import SI = Modelica.Units.SI;
import Modelica.Constants.pi;
encapsulated partial block 'My plant' "one " + "two"
  annotation(Icon(graphics={Line(points={{0,1}})}));
  import Modelica.Math.*;
protected
  SI.Length 'a b'(final start=1, fixed=true, displayUnit="mm", stateSelect=StateSelect.prefer, quantity="Length") "length"
    annotation(Dialog(tab="x"));
public
  constant .Modelica.Units.SI.Time T = 2*pi; final parameter Real k = 3, p(start=4);
  Modelica.Blocks.y.z x; // no such type
end 'My plant';
"#;
    assert!(
        error(text).contains("component of the type"),
        "{}",
        error(text)
    );
    let text = text.replace("  Modelica.Blocks.y.z x; // no such type\n", "  Real m.w;\nequation\n  T*der('a b') = -k*'a b' \"decay\" annotation(a=1);\nequation\n  m.w = sin(time);\n  annotation(x=1);\n");
    let spec = parse(&text).unwrap();
    assert_eq!(
        (spec.name.as_str(), spec.description.as_str()),
        ("'My plant'", "one two")
    );
    let a = &spec.variables[0];
    assert_eq!(
        (a.name.as_str(), a.description.as_str()),
        ("'a b'", "length")
    );
    assert_eq!(
        (a.kind, a.fixed, a.unit_text.as_deref()),
        (VariableKind::State, true, Some("m"))
    );
    assert_eq!(spec.variables[1].unit_text.as_deref(), Some("s"));
    assert_eq!(spec.variables[3].kind, VariableKind::Constant);
    assert_eq!(spec.variables[4].name, "m.w");
}

#[test]
fn habits_from_other_languages_are_named() {
    for (equation, wanted) in [
        ("y = a(t)", "variables are written without `(t)`: write `a`"),
        (
            "y = a(time)",
            "variables are written without `(time)`: write `a`",
        ),
        ("y(t) = a", "variables are written without `(t)`: write `y`"),
        (
            "y = a(b + 1)",
            "`a` is a variable and no function: a product is written `a*(...)`",
        ),
        (
            "der(y, t) = a",
            "`der` is the derivative with respect to time and takes one name: write `der(y)`",
        ),
        (
            "der(y(t)) = a",
            "variables are written without `(t)`: write `der(y)`",
        ),
        (
            "y = sin a",
            "`sin` is a function: its argument stands in parentheses, as in `sin(x)`",
        ),
        ("y = a**2", "a power is written with `^`, as in `x^2`"),
        (
            "y = 0,5*a",
            "expected `;`, found `,`: a decimal number is written with a point, as in `0.5`",
        ),
        (
            "y = a \u{2212} b",
            "the character `\u{2212}` (U+2212) only looks like `-`: write `-`",
        ),
        (
            "y = a % half",
            "the character `%` has no meaning here: comments start with `//`",
        ),
        (
            "y' = a",
            "this quoted name has no end: a closing `'` is missing; a derivative is written `der(x)`",
        ),
    ] {
        let text = format!("model A input Real a, b; output Real y; equation {equation}; end A;");
        let message = parse(&text).map_err(|e| e.kind.to_string()).err();
        assert_eq!(message.as_deref(), Some(wanted), "{equation}");
    }
    for (text, wanted) in [
        (
            "model A parameter Real J = 0,5; end A;",
            "line 1, column 30: a number behind `,`: a decimal number is written with a point, as in `0.5`",
        ),
        (
            "model A model B Real x; end B; B b; end A;",
            "line 1, column 9: `model` is outside the flat subset of Modelica: flatten the model with OpenModelica (`instantiateModel`, or `omc --flatModelica`) and use what it prints",
        ),
        (
            "model A\n  Real x;\nequation\n  der(x) = -x\nend A;",
            "line 4, column 13: a `;` is missing at the end of this line",
        ),
    ] {
        assert_eq!(error(text), wanted, "{text}");
    }
}
