//! Units as they are written, and conflicts between them.

use super::{Unit, check_units, type_unit};
use crate::physics::syntax::parse;

#[test]
fn units_are_read_and_compared() {
    for (a, b) in [
        ("N.m", "J"),
        ("kg.m2/s2", "J"),
        ("N.m.s/rad", "W.s2"),
        ("W/(m2.K)", "kg/(s3.K)"),
        ("K/(kg/s)", "K.s/kg"),
        ("V.s2/V", "s2"),
        ("mm/d", "m/s"),
        ("A.h", "C"),
        ("mA.h", "C"),
        ("1/s", "Hz"),
        ("s-1", "Hz"),
        ("rpm", "Hz"),
        ("W/%", "W"),
        ("deg", "rad"),
        ("1", "%"),
        ("degC", "K"),
        ("bar", "kPa"),
        ("l/min", "m3/s"),
        ("t", "g"),
        ("Ohm.F", "s"),
        ("H/Ohm", "s"),
        ("Wb/s", "V"),
        ("T.m2", "Wb"),
        ("kW.h", "J"),
        ("m^(1/2)", "m(1/2)"),
        ("m0.5", "m^(1/2)"),
        ("N.m.s2/rad2", "kg.m2"),
        ("W/m2/K", "W/(m2.K)"),
        ("daN", "N"),
        ("mol/l", "mol/m3"),
        ("min", "s"),
        ("cd", "lm/sr"),
    ] {
        let (Some(x), Some(y)) = (Unit::parse(a), Unit::parse(b)) else {
            panic!("{a} {b}");
        };
        assert!(x.same(&y), "{a} {b}");
    }
    for unknown in [
        "",
        "widget",
        "N..m",
        "N.",
        "(N",
        "m2K",
        "J/kg.K",
        "m^",
        "m^(1/0)",
        "N m",
        &"(".repeat(150),
    ] {
        assert_eq!(Unit::parse(unknown), None, "{unknown}");
    }
    assert!(!Unit::parse("m").is_some_and(|m| m.is_one()));
}

#[test]
fn units_are_written() {
    for (unit, wanted) in [
        ("N.m", "N.m"),
        ("rad/s", "1/s"),
        ("m/s2", "m/s2"),
        ("kg.m2", "m2.kg"),
        ("W/(m2.K)", "W/(m2.K)"),
        ("J/kg", "m2/s2"),
        ("%", "1"),
        ("m^(1/2)", "m^0.5"),
        ("mV", "V"),
    ] {
        assert_eq!(
            Unit::parse(unit).map(|u| u.to_string()).as_deref(),
            Some(wanted)
        );
    }
    let metre = Unit::parse("m").unwrap_or_default();
    assert_eq!(metre.power(f64::INFINITY), None);
    assert!(metre.power(0.0).is_some_and(|u| u.is_one()));
    assert!(metre.times(&metre).per(&metre).same(&metre));
}

#[test]
fn every_type_has_a_unit_that_can_be_read() {
    for name in ["Length", "Torque", "Velocity_kmh", "Work", "HeatFlux"] {
        let text = type_unit(name).unwrap_or("");
        assert!(Unit::parse(text).is_some(), "{name}");
    }
    assert!(
        super::types::TYPES
            .iter()
            .all(|t| Unit::parse(t.1).is_some())
    );
    assert_eq!(type_unit("Widget"), None);
}

const HEAD: &str = "model A
constant Real g(unit=\"m/s2\") = 9.81;
parameter Real m(unit=\"kg\") = 1, d(unit=\"N.m.s/rad\") = 1, J(unit=\"kg.m2\") = 1, l(unit=\"m\") = 1, free = 1;
input Real u(unit=\"V\"), tau(unit=\"N.m\"), odd(unit=\"widget\"), T(unit=\"degC\");
Real phi(unit=\"rad\"), w(unit=\"rad/s\"), y;
equation
der(phi) = w;
";

/// The message on an equation for `der(w)` and one for `y`.
fn check(equation: &str, binding: &str) -> String {
    let text = format!("{HEAD}{equation};\ny = {binding};\nend A;");
    match parse(&text).and_then(|spec| check_units(&spec)) {
        Ok(()) => "fine".into(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn what_fits_or_is_unknown_is_accepted() {
    for equation in [
        "J*der(w) = tau - d*w",
        "(m*l^2 + J)*der(w) = tau - d*w - m*Modelica.Constants.g_n*l*sin(phi)",
        "J*der(w) = tau - free*w",
        "J*der(w) = tau - odd",
        "J*der(w) = tau - 0.5*u",
        "J*der(w) = tau - 37*u",
        "J*der(w) = tau - 3",
        "J*der(w) = 0.5*m*g*l - 2*tau + 0.25*exp(-20*phi)",
        "J*der(w) = 2*Modelica.Constants.pi*tau + sqrt(tau^2)",
        "J*der(w) = if phi > 1 then tau else 0",
        "J*der(w) = max(tau, 0) + abs(tau)*sign(w)",
        "J*der(w) = tau*tanh(w/0.01) + tau*tanh(10*w) + tau*sin(time)",
        "der(w) = (tau - d*w)/J",
        "J*der(w) = tau*T/(T + 273) + tau^free/tau^free",
        "w = J*der(w)*w/tau",
    ] {
        assert_eq!(check(equation, "1"), "fine", "{equation}");
    }
}

#[test]
fn conflicts_are_in_the_words_of_the_model() {
    for (equation, binding, wanted) in [
        (
            "J*der(w) = tau - w",
            "1",
            "line 8, column 12: unit conflict: `tau - w`: N.m minus rad/s",
        ),
        (
            "J*der(w) = tau + d*w*w",
            "1",
            "line 8, column 12: unit conflict: `tau + d*w*w`: N.m plus W; `d*w*w` is N.m.s/rad times rad/s times rad/s = W",
        ),
        (
            "J*der(w) = u",
            "1",
            "line 8, column 1: unit conflict: `J*der(w) = u`: N.m on the left and V on the right; `J*der(w)` is kg.m2 times rad/s2 = N.m",
        ),
        (
            "u = J*der(w)",
            "1",
            "line 8, column 1: unit conflict: `u = J*der(w)`: V on the left and N.m on the right; `J*der(w)` is kg.m2 times rad/s2 = N.m",
        ),
        (
            "J*der(w) = tau*sin(l)",
            "1",
            "line 8, column 16: unit conflict: `sin(l)`: the argument is m, and has to be a pure number",
        ),
        (
            "J*der(w) = tau^(l)",
            "1",
            "line 8, column 12: unit conflict: `tau^(l)`: the exponent is m, and has to be a pure number",
        ),
        (
            "J*der(w) = tau",
            "max(l, m)",
            "line 9, column 5: unit conflict: `max(l, m)`: m and kg",
        ),
        (
            "J*der(w) = tau",
            "if l > m then 1 else 0",
            "line 9, column 8: unit conflict: `l > m`: m compared with kg",
        ),
        (
            "J*der(w) = tau",
            "if l > 0 then l else m",
            "line 9, column 5: unit conflict: `if l > 0 then l else m`: m in one branch and kg in another",
        ),
        (
            "J*der(w) = tau",
            "l^2 + m",
            "line 9, column 5: unit conflict: `l^2 + m`: m2 plus kg",
        ),
        (
            "J*der(w) = 2*u",
            "1",
            "line 8, column 1: unit conflict: `J*der(w) = 2*u`: N.m on the left and V on the right; `J*der(w)` is kg.m2 times rad/s2 = N.m",
        ),
        (
            "J*der(w) = 0.5*m*g",
            "1",
            "line 8, column 1: unit conflict: `J*der(w) = 0.5*m*g`: N.m on the left and N on the right; `J*der(w)` is kg.m2 times rad/s2 = N.m and `0.5*m*g` is kg times m/s2 = N",
        ),
        (
            "J*der(w) = tau",
            "sqrt(l) + l",
            "line 9, column 5: unit conflict: `sqrt(l) + l`: m^0.5 plus m",
        ),
        (
            "J*der(w) = tau",
            "l + Modelica.Constants.g_n",
            "line 9, column 5: unit conflict: `l + Modelica.Constants.g_n`: m plus m/s2",
        ),
    ] {
        let answer = check(equation, binding);
        assert_eq!(answer, wanted);
    }
}

#[test]
fn bindings_and_starts_are_compared() {
    let text = "model A constant Modelica.Units.SI.Length a = 3; constant Real b(unit=\"s\") = 2*a; Real x(unit=\"kg\", start=a);
equation der(x) = 1; end A;";
    let error = parse(text)
        .and_then(|s| check_units(&s))
        .map_err(|e| e.to_string());
    assert_eq!(
        error,
        Err("line 1, column 78: unit conflict: `2*a`, the value of `b`: m, and the variable is in s".into())
    );
    let error = parse(&text.replace("2*a", "2"))
        .and_then(|s| check_units(&s))
        .map_err(|e| e.to_string());
    assert!(
        error.is_err_and(|e| e.contains("`a`, the start of `x`: m, and the variable is in kg"))
    );
}

#[test]
fn products_are_explained_by_their_factors() {
    let text = "model A parameter Real k(unit=\"N/m\") = 1, h(unit=\"W/(m2.K)\") = 1, A(unit=\"m2\") = 1, c(unit=\"J/(kg.K)\") = 1;
Real x(unit=\"m\"), T(unit=\"degC\"), P(unit=\"W\"), tau(unit=\"N.m\");
equation der(x) = 1; der(T) = 1; P = 3; tau = RIGHT; end A;";
    for (right, wanted) in [
        ("P - k*x", "`P - k*x`: W minus N; `k*x` is N/m times m = N"),
        (
            "P + h*A*T/x",
            "`P + h*A*T/x`: W plus W/m; `h*A*T/x` is W/(m2.K) times m2 times degC per m = W/m",
        ),
        ("P - 3*x", "`P - 3*x`: W minus m"),
    ] {
        let text = text.replace("RIGHT", right);
        let error = parse(&text).and_then(|s| check_units(&s));
        let message = error.map_err(|e| e.kind.to_string());
        assert_eq!(message, Err(format!("unit conflict: {wanted}")));
    }
}

#[test]
fn unknown_units_are_named_with_the_nearest() {
    for (unit, nearest) in [
        ("radd", Some("rad")),
        ("N.m.s/radd", Some("N.m.s/rad")),
        ("pa", Some("Pa")),
        ("radians/second", Some("rad/s")),
        ("J/kg.K", Some("J/(kg.K)")),
        ("N m", Some("N.m")),
        ("kg m^2", Some("kg.m^2")),
        ("widget", None),
        ("EUR", None),
    ] {
        let text = format!("model A Real phi(unit=\"{unit}\") = 1; end A;");
        let spec = parse(&text).unwrap_or_else(|e| panic!("{e}"));
        let unknown = super::unknown_units(&spec);
        assert_eq!(unknown.len(), 1, "{unit}");
        assert_eq!(unknown[0].nearest.as_deref(), nearest, "{unit}");
        assert_eq!((unknown[0].line, unknown[0].column), (1, 14));
    }
    let spec =
        parse("model A Real phi(unit=\"radd\") = 1; end A;").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(
        super::unknown_units(&spec)[0].to_string(),
        "the unit `radd` of `phi` is not known and not compared; did you mean `rad`?"
    );
}
