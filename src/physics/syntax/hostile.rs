//! Texts that are large, deep or no text at all.

use super::parse;
use super::tests::{error, right};
use std::time::{Duration, Instant};

/// Time limit of what has to be fast, with room for a busy machine and a build without optimisation.
fn quick(what: impl FnOnce()) {
    let start = Instant::now();
    what();
    assert!(
        start.elapsed() < Duration::from_secs(10),
        "{:?}",
        start.elapsed()
    );
}

#[test]
fn deep_nesting_is_an_error_that_says_so() {
    let deep = |open: &str, close: &str, n: usize| {
        right(&format!("{}a{}", open.repeat(n), close.repeat(n)))
    };
    let limit =
        "expressions are nested more than 200 deep: name parts of this one, or use `elseif`";
    assert_eq!(deep("(", ")", 150), "a");
    assert_eq!(deep("(", ")", 100_000), limit);
    assert_eq!(deep("sin(", ")", 100_000), limit);
    assert_eq!(deep("a*(b + c^(d - ", "))", 100_000), limit);
    assert_eq!(deep("if a > 0 then 1 else ", "", 100_000), limit);
    let operators = "if a < 0 or b < 0 and not a < b + c * sin(";
    assert_eq!(deep(operators, "", 100_000), limit);
    assert_eq!(deep("if ", "", 100_000), limit);
}

#[test]
fn long_texts_are_read_without_recursion() {
    quick(|| {
        let sum = format!(
            "model A input Real a; Real y; equation y + {} = 0; end A;",
            vec!["a"; 100_000].join(" + ")
        );
        assert_eq!(parse(&sum).unwrap().equations.len(), 1);
        let own = format!(
            "model A input Real a; Real y; equation {} + a = 0; end A;",
            vec!["y"; 100_000].join(" + ")
        );
        assert_eq!(parse(&own).unwrap().equations.len(), 1);
        let branches = "elseif a > 1 then 2*y ".repeat(10_000);
        let table = format!(
            "model A input Real a; Real y; equation if a > 0 then y {branches} else 3 = 0; end A;"
        );
        assert!(error(&table).contains("`if` is outside"));
        let table = format!(
            "model A input Real a; Real y; equation a = if a > 0 then y {branches} else 3*y; end A;"
        );
        assert_eq!(parse(&table).unwrap().equations.len(), 1);
        let nested = format!(
            "model A Real y; equation y = {}1{}; end A;",
            "(2*".repeat(199),
            ")".repeat(199)
        );
        assert_eq!(parse(&nested).unwrap().equations.len(), 1);
    });
}

#[test]
fn too_much_text_is_refused() {
    let text = format!(
        "model A Real y; equation y = {}1; end A;",
        "1+".repeat(1_100_000)
    );
    assert_eq!(
        error(&text),
        "line 1, column 2000030: the expressions of the model have more than 2000000 parts"
    );
    assert_eq!(
        error(&" ".repeat(10_000_001)),
        "line 1, column 1: the text has 10000001 bytes: more than 10000000 are not read"
    );
}

/// A sequence that is the same in every run.
fn random(state: &mut u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}

#[test]
fn no_text_makes_it_panic() {
    let words = [
        "model",
        "A",
        "end",
        "Real",
        "x",
        "y",
        "u",
        "equation",
        "=",
        ";",
        "(",
        ")",
        "+",
        "-",
        "*",
        "/",
        "^",
        "der",
        "if",
        "then",
        "else",
        "elseif",
        "1",
        "2.5e3",
        "\"s\"",
        ",",
        "parameter",
        "input",
        "output",
        "start",
        "min",
        "unit",
        "time",
        "sin",
        "<",
        "and",
        "not",
        "delay",
        "smooth",
        "noEvent",
        "annotation",
        "'q'",
        ".",
        "[",
        "{",
        "==",
        "min",
        "import",
        "true",
        "/*",
        "//",
    ];
    let mut state = 0x9E37_79B9_7F4A_7C15;
    let head = "model A parameter Real p(min=0) = 1; input Real u; Real x, y; output Real z = x; equation ";
    for round in 0..4000 {
        let length = random(&mut state) % 40;
        let soup: Vec<&str> = (0..length)
            .map(|_| words[(random(&mut state) % words.len() as u64) as usize])
            .collect();
        let soup = soup.join(" ");
        let text = match round % 4 {
            0 => soup,
            1 => format!("{head}{soup}"),
            2 => format!("{head} der(x) = {soup}; y = u; end A;"),
            _ => (0..length * 4)
                .map(|_| char::from_u32((random(&mut state) % 0x300) as u32).unwrap_or(' '))
                .collect(),
        };
        match parse(&text) {
            Ok(spec) => drop(crate::physics::units::check_units(&spec)),
            Err(error) => drop(error.render("a.mo", &text)),
        }
    }
}

#[test]
fn no_change_of_a_good_text_makes_it_panic() {
    let good = "model A \"t\"\n  parameter Real p(unit=\"m\", min=0, max=3) = 2*k;\n  constant Real k = 1;\n  input Real u;\n  \
                output Real y;\n  Real x(start=p);\n  Real a = if x > 0 then u else delay(u, k);\nequation\n  p*der(x) = a - x;\n  \
                y = der(x)/2;\nend A;\n";
    assert!(parse(good).is_ok());
    for cut in 0..good.len() {
        let _ = parse(&good[..cut]);
        let _ = parse(&good[cut..]);
        let without = format!("{}{}", &good[..cut], &good[cut + 1..]);
        let _ = parse(&without).map_err(|e| e.render("a", &without));
        for extra in ["(", ")", "x", "=", "\"", "1", ";", "-", " if "] {
            let with = format!("{}{extra}{}", &good[..cut], &good[cut..]);
            let _ = parse(&with).map_err(|e| e.render("a", &with));
        }
    }
}

#[test]
fn many_parts_of_any_kind_take_little_time() {
    quick(|| {
        let groups = format!(
            "model A Real y; equation y = {}1; end A;",
            "(1)+".repeat(300_000)
        );
        assert_eq!(parse(&groups).map(|s| s.equations.len()), Ok(1));
        let lines: String = (0..50_000)
            .map(|i| format!("Real x{i}(start={i}); "))
            .collect();
        let equations: String = (0..50_000)
            .map(|i| format!("der(x{i}) = -x{i};\n"))
            .collect();
        let spec = parse(&format!("model A {lines} equation {equations} end A;"));
        assert_eq!(spec.map(|s| s.equations.len()), Ok(50_000));
        let imports = "import a.b.*; ".repeat(100_000);
        assert!(
            error(&format!("{imports} model A Real y = 1; end A;"))
                .contains("more than 32 imports")
        );
    });
}

#[test]
fn a_dense_loop_of_equations_is_explained_in_little_time() {
    quick(|| {
        let names: Vec<String> = (0..300).map(|i| format!("x{i}")).collect();
        let sum = names.join(" + ");
        let equations: String = names.iter().map(|n| format!("2*{n} = {sum};\n")).collect();
        let text = format!(
            "model A Real {};\nequation {equations} end A;",
            names.join(", ")
        );
        assert!(error(&text).contains("algebraic loop"));
    });
}
