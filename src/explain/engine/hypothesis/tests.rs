use super::*;

const CART: &str = "model Cart
  parameter Real m(unit=\"kg\") = 1.0; parameter Real k = 40; final parameter Real g = 9.81; parameter Real spare = 1;
  input Real u(unit=\"N\"); output Real y; Real x; Real v;
  Real Fs = k*x;
equation
  der(x) = v; m * der(v) = u - Fs; 2*y = x;
end Cart;
";

fn spec() -> ModelSpec {
    parse(CART).unwrap()
}

fn read(text: &str) -> Result<Hypothesis, HypothesisError> {
    Hypothesis::parse(text, &spec())
}

/// The changed equation, with new parameters at 1 or the nearest bound.
fn equation(text: &str) -> String {
    let h = read(text).unwrap_or_else(|e| panic!("{}", e.render("here")));
    let values: Vec<f64> = h.numbers.iter().map(|n| n.at(1.0)).collect();
    h.candidate(&spec(), &values).unwrap().equation
}

fn said(text: &str) -> String {
    read(text).expect_err(text).to_string()
}

/// Beside an effect that was found: the observer corrects none of the states that this has added.
#[test]
fn states_of_effects_stay_what_they_are() {
    let mut with_effect = spec();
    let state = with_effect.find("x").unwrap();
    with_effect.variables[state.index()].uncorrected = true;
    let hypothesis = read("a: u = c*u^2").unwrap();
    let changed = hypothesis.candidate(&with_effect, &[1.0]).unwrap().plant;
    let kept = |name: &str| {
        changed
            .spec
            .variable(changed.spec.find(name).unwrap())
            .uncorrected
    };
    assert!(kept("x") && !kept("v"));
}

#[test]
fn a_term_enters_where_the_text_says() {
    for (text, expected) in [
        (
            "a: m*der(v) += -c*v*abs(v), c > 0",
            "m * der(v) = u - Fs - c*v*abs(v)",
        ),
        ("a: m*der(v) -= c*v", "m * der(v) = u - Fs - c*v"),
        (
            "a: m*der(v) += -a*v + b",
            "m * der(v) = u - Fs + (-a*v + b)",
        ),
        ("a: m*der(v) -= a*v + b", "m * der(v) = u - Fs - (a*v + b)"),
        ("a: m*der(v) = u - Fs - c*v", "m * der(v) = u - Fs - c*v"),
        // The derivative itself: what stands beside it stands beside the term.
        ("a: der(v) += -c*v", "m * der(v) = u - Fs + m * (-c*v)"),
        ("a: der(v) = c*u", "m * der(v) = m * (c*u)"),
        ("a: Fs += k3*x^3", "Fs = k*x + k3*x^3"),
        ("a: y += b", "2*y = x + 2*(b)"),
        ("a: 2*y += b", "2*y = x + b"),
        (
            "a: u = min(max(u, -L), L), L > 0",
            "u_acting = min(max(u, -L), L)",
        ),
        ("a: m += c*time", "m_acting = m + c*time"),
        (
            "a: m*der(v) += if time > t0 then c else 0",
            "m * der(v) = u - Fs + (if time > t0 then c else 0)",
        ),
    ] {
        assert_eq!(equation(text), expected, "{text}");
    }
}

#[test]
fn bounds_starts_and_units_are_read() {
    let h = read(
        "s: Fs += c*tanh(x/w) + d + e*g, 0 < c <= 3, w > 0, w = 0.1, -2 <= d, c [N], e < 1e3 [kg]",
    )
    .unwrap();
    assert_eq!(h.name(), "s");
    let number = |name: &str| h.numbers.iter().find(|n| n.name == name).unwrap();
    assert_eq!((number("c").min, number("c").max), (0.0, 3.0));
    assert_eq!((number("w").min, number("w").start), (0.0, Some(0.1)));
    assert_eq!((number("d").min, number("d").max), (-2.0, f64::INFINITY));
    assert_eq!(number("c").unit.as_deref(), Some("N"));
    assert_eq!(
        (number("e").max, number("e").unit.as_deref()),
        (1e3, Some("kg"))
    );
    assert_eq!(h.depends, ["x"]);
    let strengths: Vec<&str> = h
        .strengths
        .iter()
        .map(|&i| h.numbers[i].name.as_str())
        .collect();
    assert_eq!(strengths.len(), 3, "{strengths:?}");
    assert!(!strengths.contains(&"w"));
}

#[test]
fn products_of_strengths_are_not_all_strengths() {
    let h = read("s: Fs += a*b*x + (if x > 0 then c else 0)*time").unwrap();
    assert_eq!(h.strengths.len(), 2);
    assert_eq!(h.depends, ["x", "time"]);
}

#[test]
fn errors_say_where_and_what_to_type() {
    for (text, column, parts) in [
        (
            "m*der(v) += c*v",
            1,
            &["begins with a name", "drag: m*der(v)"][..],
        ),
        ("drag m*der(v) += c*v", 1, &["begins with a name"]),
        ("a: m*der(v) c*v", 15, &["`+=`", "`=`"]),
        ("a: m*der(v) == c*v", 13, &["`+=`"]),
        (
            "a: m*der(w) += c*v",
            4,
            &[
                "`m*der(w)` is no left-hand side",
                "`m * der(v)`",
                "`u`",
                "`k`",
            ],
        ),
        (
            "a: v += c*x",
            4,
            &["`v` is a state", "`m * der(v)`", "`der(v)`"],
        ),
        ("a: g += c", 4, &["`g` is certain"]),
        (
            "a: spare += c",
            4,
            &["no equation of the plant uses `spare`"],
        ),
        ("a: Fs += ", 9, &["expression is missing"]),
        (
            "a: Fs += c*foo(x)",
            12,
            &["`foo` is no function", "tanh", "sqrt"],
        ),
        ("a: Fs += c*sgn(x)", 12, &["did you mean `sign`?"]),
        ("a: Fs += c*sin(2*pi*x)", 18, &["Modelica.Constants.pi"]),
        ("a: Fs += c*t", 12, &["`time`"]),
        ("a: Fs += c*(x", 13, &["parentheses"]),
        ("a: Fs += c*x)", 13, &["parentheses"]),
        ("a: Fs += c*x;", 13, &["`;` has no place"]),
        ("a: Fs += c*x // new", 14, &["comments"]),
        ("a: Fs += c*(x > 0)", 13, &["condition"]),
        (
            "a: Fs += c*x, d > 0",
            15,
            &["`d` is no new parameter", "it has c"],
        ),
        (
            "a: Fs += c*x, k > 0",
            15,
            &["`k`", "bounds stand in the text"],
        ),
        ("a: Fs += c*x, c > big", 19, &["expected a bound"]),
        ("a: Fs += c*x, 3 < c < 1", 19, &["no value of `c`"]),
        ("a: Fs += c*x, c > 0, c = -1", 22, &["no value of `c`"]),
        (
            "a: Fs += c*x, c = 1, c = 2",
            22,
            &["start value of `c` is given twice"],
        ),
        ("a: Fs += c*x, c [blorp/x]", 18, &["unit `blorp/x`"]),
        ("a: Fs += c*x*", 14, &["expected"]),
        (
            "a: Fs += c*der(v)",
            10,
            &["cannot be solved", "algebraic loop", "lines 4 and 6"],
        ),
    ] {
        let message = said(text);
        for part in parts {
            assert!(message.contains(part), "{text}: {message}");
        }
        assert!(
            message.starts_with(&format!("column {column}:")),
            "{text}: {message}"
        );
    }
    let shown = read("a: Fs += c*foo(x)")
        .unwrap_err()
        .render("--hypothesis");
    assert!(
        shown.ends_with("   | a: Fs += c*foo(x)\n   |            ^^^"),
        "{shown}"
    );
}

#[test]
fn no_text_makes_it_panic() {
    let good =
        "drag: m*der(v) += -c*v*abs(v) + (if x > x0 then 1 else 0), 0 < c < 3, x0 = -1e-3 [m]";
    assert!(read(good).is_ok());
    for cut in (0..=good.len()).filter(|&c| good.is_char_boundary(c)) {
        let _ = read(&good[..cut]).map_err(|e| e.render("a"));
        let _ = read(&good[cut..]).map_err(|e| e.render("a"));
        for extra in [
            "(", ")", ",", "=", "\"", "[", "]", ";", "-", " if ", "\u{e9}", "{v}",
        ] {
            let with = format!("{}{extra}{}", &good[..cut], &good[cut..]);
            let _ = read(&with).map_err(|e| e.render("a"));
        }
    }
}
