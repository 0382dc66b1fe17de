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
