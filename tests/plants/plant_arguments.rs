//! What a term is a function of, and in which form: sums that stand in the text, products that count from a reference, exponential laws.

use crate::folder::{Folder, effects};
use crate::plant_neighbours::{explained, levels, number, recorded};

/// A strut on a turning plank is compressed at `v + b*w`, which the text has as part of a product. It brakes harder one way.
#[test]
fn a_weighted_sum_of_the_text_is_one_argument() {
    let (force, torque) = (levels(23, -12.0, 12.0), levels(31, -9.0, 9.0));
    let log = recorded(
        "F [N],M [N.m],y1 [m],y2 [rad]",
        (2000, 0.02),
        &[&force, &torque],
        |x, u, _| {
            let (z, v, q, w) = (x[0], x[1], x[2], x[3]);
            let speed = v + 0.8 * w;
            let strut = 20.0 * (z + 0.8 * q) + 1.2 * speed + 0.9 * speed.max(0.0);
            let lift = (u[0] - 12.0 * z - 0.8 * v - strut) / 2.0;
            let turn = (u[1] - 9.0 * q - 0.5 * w - 0.8 * strut) / 1.1;
            vec![v, lift, w, turn]
        },
        (&[0.0; 4], &[(0, 0.003), (2, 0.003)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Plank\n  parameter Real m(unit=\"kg\", min=1.7, max=2.4) = 2.1;\n  parameter Real J(unit=\"kg.m2\", min=0.9, max=1.4) = 1.2;\n  parameter Real k(unit=\"N/m\", min=17, max=24) = 21;\n  parameter Real d(unit=\"N.s/m\", min=0.5, max=3) = 1.3;\n  parameter Real b(unit=\"m\") = 0.8;\n  parameter Real k0(unit=\"N/m\", min=9, max=15) = 11.5;\n  parameter Real d0(unit=\"N.s/m\", min=0.4, max=1.5) = 0.7;\n  parameter Real k1(unit=\"N.m/rad\", min=7, max=11) = 9.3;\n  parameter Real d1(unit=\"N.m.s/rad\", min=0.2, max=1) = 0.6;\n  input Real F(unit=\"N\");\n  input Real M(unit=\"N.m\");\n  output Real y1(unit=\"m\");\n  output Real y2(unit=\"rad\");\n  Real z(unit=\"m\");\n  Real v(unit=\"m/s\");\n  Real q(unit=\"rad\");\n  Real w(unit=\"rad/s\");\n  Real fr(unit=\"N\") = k*(z + b*q) + d*(v + b*w);\nequation\n  der(z) = v;\n  m*der(v) = F - k0*z - d0*v - fr;\n  der(q) = w;\n  J*der(w) = M - k1*q - d1*w - b*fr;\n  y1 = z;\n  y2 = q;\nend Plank;\n",
    );
    assert_eq!(
        effects(&said),
        ["asymmetric_damping"],
        "{}",
        said["summary"]
    );
    assert_eq!(said["effects"][0]["enters"], "fr");
    assert_eq!(said["effects"][0]["depends"], serde_json::json!(["v", "w"]));
    let harder = number(&said, 0, "one_sided_c");
    assert!((harder - 0.9).abs() < 0.03, "{harder}");
}

/// A heating wire takes less power when it is hot: `P*(1 - a*(T - 20))`, which is `T*P` only where a parameter can be 6 % larger.
#[test]
fn a_product_counts_from_a_reference() {
    let power = levels(17, 0.0, 150.0);
    let log = recorded(
        "P [W],y [degC]",
        (1500, 2.0),
        &[&power],
        |x, u, _| {
            let above = x[0] - 20.0;
            vec![(u[0] * (1.0 - 0.003 * above) - 1.5 * above) / 90.0]
        },
        (&[20.0], &[(0, 0.15)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Heater\n  parameter Real C(unit=\"J/K\", min=88, max=95) = 92;\n  parameter Real h(unit=\"W/K\", min=1.4, max=1.6) = 1.45;\n  input Real P(unit=\"W\");\n  output Real y(unit=\"degC\");\n  Real T(unit=\"degC\", start=20);\nequation\n  C*der(T) = P - h*(T - 20);\n  y = T;\nend Heater;\n",
    );
    let summary = &said["summary"];
    assert_eq!(
        effects(&said),
        ["temperature_dependent_resistance"],
        "{summary}"
    );
}

/// A tendon that stiffens as `exp(x/s) - 1`: where the force turns most, a run without it goes far beyond what was recorded.
#[test]
fn an_exponential_law_is_found_from_its_curve() {
    let force = levels(29, -9.0, 22.0);
    let log = recorded(
        "F [N],y [m]",
        (2000, 0.02),
        &[&force],
        |x, u, _| {
            let tendon = 1.6 * ((x[0] / 0.4).exp() - 1.0);
            vec![x[1], (u[0] - 4.0 * x[0] - 1.5 * x[1] - tendon) / 0.8]
        },
        (&[0.0; 2], &[(0, 0.004)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Limb\n  parameter Real m(unit=\"kg\", min=0.7, max=0.9) = 0.85;\n  parameter Real k(unit=\"N/m\", min=3, max=5) = 4.3;\n  parameter Real d(unit=\"N.s/m\", min=1, max=2) = 1.4;\n  input Real F(unit=\"N\");\n  output Real y(unit=\"m\");\n  Real x(unit=\"m\");\n  Real v(unit=\"m/s\");\nequation\n  der(x) = v;\n  m*der(v) = F - k*x - d*v;\n  y = x;\nend Limb;\n",
    );
    assert_eq!(effects(&said), ["law"], "{}", said["summary"]);
    let equation = said["effects"][0]["equation"].as_str().unwrap();
    assert!(equation.contains("(exp(x/formula_s) - 1)"), "{equation}");
    let scale = number(&said, 0, "formula_s");
    assert!((scale - 0.4).abs() < 0.01, "{scale}");
}

/// The rate of a reaction grows with temperature as Arrhenius has it: five times from the coldest to the hottest.
#[test]
fn a_rate_constant_that_grows_with_temperature_is_a_law_of_it() {
    let (flow, jacket) = (levels(31, 60.0, 140.0), levels(47, 318.0, 342.0));
    let log = recorded(
        "q [L/min],Tj [K],y1 [mol/L],y2 [K]",
        (1500, 6.0),
        &[&flow, &jacket],
        |x, u, _| {
            let (c, temperature) = (x[0], x[1]);
            let k = 0.9 * (7000.0 * (1.0 / 350.0 - 1.0 / temperature)).exp();
            let (rate, renewed) = (k * c, u[0] / 100.0);
            let heat = 45.0 * rate - 1.2 * (temperature - u[1]);
            vec![
                (renewed * (1.0 - c) - rate) / 60.0,
                (renewed * (350.0 - temperature) + heat) / 60.0,
            ]
        },
        (&[0.4, 348.0], &[(0, 0.003), (1, 0.1)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Reactor\n  parameter Real k(unit=\"1/min\", min=0.5, max=1.5) = 0.8;\n  parameter Real h(unit=\"K.L/mol\", min=35, max=55) = 42;\n  parameter Real a(unit=\"1/min\", min=1, max=1.5) = 1.3;\n  constant Real V(unit=\"L\") = 100;\n  constant Real minute(unit=\"s/min\") = 60;\n  input Real q(unit=\"L/min\");\n  input Real Tj(unit=\"K\");\n  output Real y1(unit=\"mol/L\");\n  output Real y2(unit=\"K\");\n  Real c(unit=\"mol/L\", start=0.4);\n  Real T(unit=\"K\", start=348);\n  Real r(unit=\"mol/(L.min)\") = k*c;\nequation\n  minute*der(c) = q/V*(1 - c) - r;\n  minute*der(T) = q/V*(350 - T) + h*r - a*(T - Tj);\n  y1 = c;\n  y2 = T;\nend Reactor;\n",
    );
    assert_eq!(effects(&said), ["law"], "{}", said["summary"]);
    let depends = &said["effects"][0]["depends"];
    assert_eq!(depends, &serde_json::json!(["T", "k"]));
    let activation = &said["effects"][0]["parameters"]["parameter_exponential_E"];
    let (value, std) = (&activation["value"], &activation["std"]);
    let (value, std) = (value.as_f64().unwrap(), std.as_f64().unwrap());
    assert!(std < 150.0, "{activation}");
    assert!((value - 7000.0).abs() < 4.0 * std, "{activation}");
    assert_eq!(activation["unit"], "K");
}

/// A thermometer in the sun shows more than the room has.
#[test]
fn a_sensor_that_feels_a_recorded_input_is_found() {
    let heating = levels(37, 0.0, 3000.0);
    let sun = |k: usize| 700.0 * (0.011 * k as f64).sin().max(0.0) * levels(13, 0.3, 1.0)(k);
    let log = recorded(
        "P [W],G [W/m2],y [degC]",
        (1500, 60.0),
        &[&heating, &sun],
        |x, u, _| vec![(u[0] + 1.8 * u[1] - 120.0 * (x[0] - 5.0)) / 8.0e5],
        (&[15.0], &[(0, 0.05)]),
    );
    let shown: Vec<String> = (log.lines().enumerate())
        .map(|(row, line)| {
            let cells: Vec<&str> = line.split(',').collect();
            let last = match row {
                0 => cells[3].to_owned(),
                _ => {
                    let number = |i: usize| cells[i].parse::<f64>().unwrap();
                    format!("{:.4}", number(3) + 0.004 * number(2))
                }
            };
            [&cells[..3], &[last.as_str()]].concat().join(",")
        })
        .collect();
    let said = explained(
        &Folder::new(),
        &(shown.join("\n") + "\n"),
        "model Room\n  parameter Real C(unit=\"J/K\", min=6e5, max=1e6) = 8.6e5;\n  parameter Real h(unit=\"W/K\", min=90, max=150) = 112;\n  parameter Real A(unit=\"m2\", min=1, max=3) = 1.6;\n  input Real P(unit=\"W\");\n  input Real G(unit=\"W/m2\");\n  output Real y(unit=\"degC\");\n  Real T(unit=\"degC\", start=15);\nequation\n  C*der(T) = P + A*G - h*(T - 5);\n  y = T;\nend Room;\n",
    );
    assert_eq!(effects(&said), ["cross_coupling"], "{}", said["summary"]);
    assert_eq!(said["effects"][0]["enters"], "y");
    assert_eq!(said["effects"][0]["depends"], serde_json::json!(["G"]));
    let feels = number(&said, 0, "cross_coupling_c");
    assert!((feels - 0.004).abs() < 2e-4, "{feels}");
}
