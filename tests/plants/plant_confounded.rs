//! What a recording does not tell apart, and forms that are easily taken for others: found by testers on recordings of their own.

use crate::folder::{Folder, effects};
use crate::plant_neighbours::{explained, levels, number, recorded};

/// A pendulum that only damping in proportion to the speed brings to rest: damping in one direction does the same to its swings.
#[test]
fn viscous_damping_of_free_swings_comes_first() {
    let log = recorded(
        "a",
        (130, 0.1),
        &[],
        |x, _, _| vec![x[1], -6.7 * x[0].sin() - 0.0164 * x[1]],
        (&[-0.285, 0.0], &[(0, 1e-3)]),
    );
    let folder = Folder::new();
    let said = explained(
        &folder,
        &log,
        "model Pendulum\n  parameter Real L(unit=\"m\", min=1.3, max=1.6) = 1.45;\n  output Real a(unit=\"rad\");\n  Real phi(unit=\"rad\", start=-0.285);\n  Real w(unit=\"rad/s\", start=0);\nequation\n  der(phi) = w;\n  der(w) = -9.81/L*sin(phi);\n  a = phi;\nend Pendulum;\n",
    );
    assert_eq!(effects(&said), ["viscous_friction"], "{}", said["summary"]);
    let damping = number(&said, 0, "linear_c");
    assert!((damping + 0.0164).abs() < 1e-3, "{damping}");
}

const TANK: &str = "model Heater\n  parameter Real C(unit=\"J/K\", min=800, max=1200) = 950;\n  parameter Real G(unit=\"W/K\", min=0.5, max=2) = 1.1;\n  input Real P(unit=\"W\");\n  output Real y(unit=\"degC\");\n  Real T(unit=\"degC\", start=20);\nequation\n  C*der(T) = P - G*(T - 20);\n  y = T;\nend Heater;\n";

/// A loss that begins with the only step of the input may be an effect of the input; one at another time is a load.
#[test]
fn a_load_that_begins_with_an_input_is_not_named() {
    let explained = |begin: f64| {
        let power = |k: usize| if (200..500).contains(&k) { 60.0 } else { 10.0 };
        let log = recorded(
            "P,y",
            (800, 5.0),
            &[&power],
            |x, u, t| {
                let loss = if t >= begin { 9.0 } else { 0.0 };
                vec![(u[0] - 1.0 * (x[0] - 20.0) - loss) / 1000.0]
            },
            (&[25.0], &[(0, 0.05)]),
        );
        explained(&Folder::new(), &log, TANK)
    };
    let at_step = explained(2500.0);
    assert_eq!(at_step["verdict"], "unexplained", "{}", at_step["summary"]);
    let summary = at_step["summary"].to_string();
    assert!(
        summary.contains("begins with a step of the input P"),
        "{summary}"
    );
    let later = explained(3100.0);
    assert_eq!(later["verdict"], "named", "{}", later["summary"]);
}

/// A block that warms up beside another one: its temperature only rises, and a curve of it follows anything.
#[test]
fn a_curve_of_what_only_rises_is_not_named() {
    let log = recorded(
        "y",
        (200, 10.0),
        &[],
        |x, _, _| {
            let (air, inside) = (0.004 * (22.0 - x[0]), 0.006 * (x[1] - x[0]));
            vec![air + inside, -0.5 * inside]
        },
        (&[-1.0, -6.0], &[(0, 0.01)]),
    );
    let folder = Folder::new();
    folder.text("log.csv", &log);
    folder.text(
        "plant.mo",
        "model Board\n  parameter Real tau(unit=\"s\", min=100, max=900) = 250;\n  output Real y(unit=\"degC\");\n  Real T(unit=\"degC\", start=-1);\nequation\n  tau*der(T) = 22 - T;\n  y = T;\nend Board;\n",
    );
    // Where no second block is thought of.
    let said = folder.explained("log.csv", "plant.mo", &["--only", "law"]);
    assert_ne!(said["verdict"], "named", "{}", said["summary"]);
}

/// Cogging of a linear motor over many pitches, behind the lag of its current.
#[test]
fn cogging_along_a_line_acts_on_what_moves() {
    let current = levels(30, -4.0, 4.0);
    let log = recorded(
        "i,y",
        (2400, 0.015),
        &[&current],
        |x, u, _| {
            let cogging = 7.0 * (2.0 * std::f64::consts::PI * x[1] / 0.4 + 0.6).sin();
            let force = 0.5 * x[0] - 24.0 * x[2] - 15.0 * x[1] - cogging;
            vec![(10.0 * u[0] - x[0]) / 0.006, x[2], force / 5.4]
        },
        (&[0.0; 3], &[(1, 0.005)]),
    );
    let folder = Folder::new();
    let said = explained(
        &folder,
        &log,
        "model Stage\n  parameter Real m(unit=\"kg\", min=4.3, max=5.9) = 5;\n  parameter Real b(unit=\"N.s/m\", min=14, max=28) = 20;\n  parameter Real k(unit=\"N/A\", min=8, max=11.5) = 9.5;\n  parameter Real Tc(unit=\"s\", min=0.002, max=0.008) = 0.004;\n  input Real i(unit=\"A\");\n  output Real y(unit=\"m\");\n  Real F(unit=\"N\", start=0);\n  Real x(unit=\"m\", start=0);\n  Real v(unit=\"m/s\", start=0);\nequation\n  Tc*der(F) = k*i - F;\n  der(x) = v;\n  m*der(v) = 0.5*F - b*v - 15*x;\n  y = x;\nend Stage;\n",
    );
    assert_eq!(effects(&said), ["cogging"], "{}", said["summary"]);
    assert_eq!(said["effects"][0]["enters"], "v");
    let wave = number(&said, 0, "sine_k");
    let pitch = 2.0 * std::f64::consts::PI / wave;
    assert!((pitch - 0.4).abs() < 0.004, "{pitch}");
}

/// A thermometer with a wrong scale and a wrong zero.
#[test]
fn a_sensor_has_a_scale_and_a_zero() {
    let power = levels(60, 0.0, 60.0);
    let log = recorded(
        "P,y1,y2",
        (1200, 10.0),
        &[&power],
        |x, u, _| {
            let between = 4.6 * (x[0] - x[1]);
            let heats = (u[0] - between) / 2200.0;
            vec![
                heats,
                (between - 1.5 * (x[1] - 20.0)) / 6600.0,
                0.92 * (between - 1.5 * (x[1] - 20.0)) / 6600.0,
            ]
        },
        (&[24.0, 22.0, 0.92 * 22.0 + 2.5], &[(0, 0.05), (2, 0.05)]),
    );
    let folder = Folder::new();
    let said = explained(
        &folder,
        &log,
        "model Incubator\n  parameter Real C1(unit=\"J/K\", min=1500, max=3000) = 2000;\n  parameter Real C2(unit=\"J/K\", min=4500, max=9000) = 6000;\n  parameter Real k(unit=\"W/K\", min=2, max=8) = 4;\n  parameter Real h(unit=\"W/K\", min=0.8, max=2.5) = 1.3;\n  input Real P(unit=\"W\");\n  output Real y1(unit=\"degC\");\n  output Real y2(unit=\"degC\");\n  Real T1(unit=\"degC\", start=24);\n  Real T2(unit=\"degC\", start=22);\nequation\n  C1*der(T1) = P - k*(T1 - T2);\n  C2*der(T2) = k*(T1 - T2) - h*(T2 - 20);\n  y1 = T1;\n  y2 = T2;\nend Incubator;\n",
    );
    assert_eq!(effects(&said), ["sensor_scale"], "{}", said["summary"]);
    let scale = number(&said, 0, "sensor_scale_c");
    assert!((scale + 0.08).abs() < 0.01, "{scale}");
}

/// A worm gear: what it loses grows with the torque that drives it.
#[test]
fn a_worm_gear_loses_a_part_of_what_drives() {
    let torque = levels(40, -20.0, 20.0);
    let log = recorded(
        "M,w",
        (1500, 0.02),
        &[&torque],
        |x, u, _| {
            let loss = 0.2 * u[0].abs() * (x[0] / 0.02).tanh();
            vec![(u[0] - 3.0 * x[0] - loss) / 0.8]
        },
        (&[0.0], &[(0, 0.03)]),
    );
    let folder = Folder::new();
    let said = explained(
        &folder,
        &log,
        "model Gear\n  parameter Real J(unit=\"kg.m2\", min=0.6, max=1) = 0.7;\n  parameter Real b(unit=\"N.m.s/rad\", min=2, max=5) = 3.4;\n  input Real M(unit=\"N.m\");\n  output Real w(unit=\"rad/s\");\n  Real n(unit=\"rad/s\", start=0);\nequation\n  J*der(n) = M - b*n;\n  w = n;\nend Gear;\n",
    );
    assert_eq!(effects(&said), ["efficiency"], "{}", said["summary"]);
    let part = number(&said, 0, "efficiency_c");
    assert!((part.abs() - 0.2).abs() < 0.02, "{part}");
}

/// A catalyst whose activity falls off exponentially from 60 s on: no step, and nothing else than the parameter. It may be described by
/// an exponential from there, or by a sigmoid about the instant half-way.
#[test]
fn a_parameter_takes_its_time_to_change() {
    let feed = levels(50, 0.5, 1.5);
    let log = recorded(
        "q,c",
        (1500, 0.1),
        &[&feed],
        |x, u, t| {
            let decay = 0.5 + 0.5 * (-f64::max(t - 60.0, 0.0) / 8.0).exp();
            vec![u[0] * (2.0 - x[0]) - 0.6 * decay * x[0]]
        },
        (&[1.2], &[(0, 0.004)]),
    );
    let folder = Folder::new();
    let said = explained(
        &folder,
        &log,
        "model Reactor\n  parameter Real k(unit=\"1/s\", min=0.3, max=0.9) = 0.5;\n  input Real q(unit=\"1/s\");\n  output Real c(unit=\"mol/l\");\n  Real z(unit=\"mol/l\", start=1.2);\nequation\n  der(z) = q*(2 - z) - k*z;\n  c = z;\nend Reactor;\n",
    );
    assert_eq!(effects(&said), ["parameter_change"], "{}", said["summary"]);
    let (begin, time) = (
        number(&said, 0, "parameter_step_t0"),
        number(&said, 0, "parameter_step_T"),
    );
    assert!((59.0..67.0).contains(&begin), "{begin}");
    assert!((5.0..11.0).contains(&time), "{time}");
}

/// A pendulum whose simulation was linearised about its rest: the angle stands where the plant has its sine, a spring would have a cube.
#[test]
fn gravity_of_a_linearised_pendulum_is_no_cubic_spring() {
    let torque = levels(61, -4.0, 4.0);
    let log = recorded(
        "M [N.m],a [rad]",
        (1200, 0.05),
        &[&torque],
        |x, u, _| vec![x[1], u[0] / 1.3 - 7.1 * x[0].sin() - 0.11 * x[1]],
        (&[0.5, 0.0], &[(0, 3e-3)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Arm\n  parameter Real J(unit=\"kg.m2\", min=1, max=1.6) = 1.25;\n  parameter Real k(unit=\"1/s2\", min=5, max=9) = 6.8;\n  parameter Real d(unit=\"1/s\", min=0, max=0.5) = 0.1;\n  input Real M(unit=\"N.m\");\n  output Real a(unit=\"rad\");\n  Real phi(unit=\"rad\", start=0.5);\n  Real w(unit=\"rad/s\");\nequation\n  der(phi) = w;\n  der(w) = M/J - k*phi - d*w;\n  a = phi;\nend Arm;\n",
    );
    assert_eq!(effects(&said), ["gravity_torque"], "{}", said["summary"]);
    let parameters = said["effects"][0]["parameters"].as_object().unwrap();
    let strength = parameters.values().next().unwrap()["value"].as_f64();
    assert!(
        strength.is_some_and(|c| (c.abs() - 7.1).abs() < 0.05),
        "{parameters:?}"
    );
}
