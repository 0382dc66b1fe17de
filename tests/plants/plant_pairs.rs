//! Effects that one term at one place does not describe: what leaves one balance and arrives in another, two effects of which each
//! alone does little, and inputs that are switched on as the recording begins.

use crate::folder::{Folder, effects};
use crate::plant_neighbours::{explained, levels, number, recorded};

/// What flows over the rim of the upper of two tanks falls into the lower one: the term enters both balances.
#[test]
fn what_flows_over_a_rim_arrives_in_the_next_tank() {
    let pump = levels(20, 0.5, 4.5);
    let log = recorded(
        "u,y",
        (1600, 4.0),
        &[&pump],
        |x, u, _| {
            let [upper, lower] = [x[0], x[1]].map(|h| h.max(0.0).sqrt());
            let over = 0.2 * (x[0] - 9.0).max(0.0);
            let filled = 0.05 * u[0] - 0.05 * upper - over;
            vec![filled, 0.05 * upper - 0.055 * lower + 0.6 * over]
        },
        (&[4.0, 4.0], &[(1, 0.02)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Tanks\n  parameter Real b(min=0.01, max=0.2) = 0.045;\n  parameter Real a(min=0.01, max=0.2) = 0.055;\n  parameter Real g(min=0.01, max=0.2) = 0.045;\n  parameter Real d(min=0.01, max=0.2) = 0.05;\n  input Real u(unit=\"V\");\n  output Real y(unit=\"V\");\n  Real h1(unit=\"V\", start=4);\n  Real h2(unit=\"V\", start=4);\nequation\n  der(h1) = b*u - a*sqrt(max(h1, 0));\n  der(h2) = g*sqrt(max(h1, 0)) - d*sqrt(max(h2, 0));\n  y = h2;\nend Tanks;\n",
    );
    assert_eq!(effects(&said), ["overflow"], "{}", said["summary"]);
    assert_eq!(said["effects"][0]["enters"], "h1");
    let equation = said["effects"][0]["equation"].as_str().unwrap();
    assert!(
        equation.contains("der(h1)") && equation.contains("der(h2)"),
        "{equation}"
    );
    // The level of the upper tank has no scale: only its lower one is measured.
    let lost = number(&said, 0, "above_c");
    assert!((lost + 0.2).abs() < 0.02, "{lost}");
}

/// A propeller that lifts an arm: its thrust grows with the square of the voltage, and follows it late. Hysteresis of the input does some
/// of the work of both.
#[test]
fn two_effects_stand_for_one_that_leaves_structure() {
    let voltage = |k: usize| [1.0, 0.5, 1.3, 0.8][(k / 60).min(3)];
    let log = recorded(
        "u,y",
        (240, 0.03),
        &[&voltage],
        |x, u, _| {
            let pull = -40.0 * x[0].sin() - 2.5 * x[1] + 25.0 * x[2];
            vec![x[1], pull, (u[0] * u[0] - x[2]) / 0.12]
        },
        (&[0.0; 3], &[(0, 0.01)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Arm\n  parameter Real a(min=20, max=80) = 45;\n  parameter Real d(min=0, max=10) = 2;\n  parameter Real k(min=5, max=60) = 20;\n  input Real u(unit=\"V\");\n  output Real y(unit=\"rad\");\n  Real th(unit=\"rad\", start=0);\n  Real w(unit=\"rad/s\", start=0);\nequation\n  der(th) = w;\n  der(w) = -a*sin(th) - d*w + k*u;\n  y = th;\nend Arm;\n",
    );
    // Between 0.5 and 1.3 V a constant load and a larger gain are nearly the square.
    let names = effects(&said);
    assert_eq!(names.len(), 2, "{}", said["summary"]);
    assert!(names.contains(&"actuator_lag"), "{}", said["summary"]);
    assert!(
        names.contains(&"load_step") || names.contains(&"input_curve"),
        "{}",
        said["summary"]
    );
}

/// A recording that begins with its step: the input was off before, and arrives late.
#[test]
fn an_input_that_is_switched_on_may_arrive_late() {
    let arrives = |k: usize| if k < 7 { 0.0 } else { 6.0 };
    let clean = recorded(
        "u,y",
        (120, 0.01),
        &[&arrives],
        |x, u, _| vec![(50.0 * u[0] - x[0]) / 0.15],
        (&[0.0], &[(0, 1.0)]),
    );
    let mut log = String::from("t,u,y\n");
    for line in clean.lines().skip(1) {
        let each: Vec<&str> = line.split(',').collect();
        log.push_str(&format!("{},6,{}\n", each[0], each[2]));
    }
    let said = explained(
        &Folder::new(),
        &log,
        "model Motor\n  parameter Real K(min=30, max=80) = 55;\n  parameter Real T(unit=\"s\", min=0.05, max=0.5) = 0.2;\n  input Real u(unit=\"V\");\n  output Real y(unit=\"1/s\");\n  Real w(unit=\"1/s\", start=0);\nequation\n  T*der(w) = K*u - w;\n  y = w;\nend Motor;\n",
    );
    assert_eq!(effects(&said), ["input_delay"], "{}", said["summary"]);
    let delay = number(&said, 0, "input_delay_T");
    assert!((delay - 0.07).abs() < 0.005, "{delay}");
}

/// A fogger that does nothing below 12 %, and a sensor that follows late: beside the lag the dead zone is plain, alone it says little.
#[test]
fn an_effect_that_says_little_alone_is_proven_beside_a_second() {
    let command = |k: usize| (levels(24, -20.0, 80.0)(k)).max(0.0);
    let log = recorded(
        "fogger,humidity",
        (2400, 5.0),
        &[&command],
        |x, u, _| {
            let fog = 0.004 * (u[0] - 12.0).max(0.0);
            vec![fog - (x[0] - 6.0) / 420.0, (x[0] - x[1]) / 25.0]
        },
        (&[8.0, 8.0], &[(1, 0.04)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Fog\n  parameter Real b(min=0.002, max=0.008) = 0.005;\n  parameter Real tau(unit=\"s\", min=200, max=800) = 300;\n  parameter Real out(unit=\"g/m3\", min=3, max=9) = 5;\n  input Real fogger(unit=\"%\");\n  output Real humidity(unit=\"g/m3\");\n  Real x(unit=\"g/m3\", start=8);\nequation\n  der(x) = b*fogger - (x - out)/tau;\n  humidity = x;\nend Fog;\n",
    );
    let mut names = effects(&said);
    // Behind the dead zone the rest is linear: a lag is the same before it and after it.
    let lags = ["actuator_lag", "sensor_lag"];
    names.retain(|name| !lags.contains(name));
    assert_eq!(names, ["input_dead_zone"], "{}", said["summary"]);
    assert_eq!(effects(&said).len(), 2, "{}", said["summary"]);
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
}

/// An amplifier that does nothing below a small command, and no more above a large one: both are forms of the input's curve, and
/// neither is what the other leaves.
#[test]
fn a_dead_zone_and_a_limit_may_be_of_one_input() {
    let command = levels(15, -250.0, 250.0);
    let log = recorded(
        "command,speed",
        (1500, 0.02),
        &[&command],
        |x, u, _| {
            let acts = (u[0].abs() - 35.0).clamp(0.0, 125.0) * u[0].signum();
            vec![(9.0 * acts - x[0]) / 0.12]
        },
        (&[0.0], &[(0, 15.0)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Wheel\n  parameter Real K(unit=\"1/min\", min=2, max=20) = 6;\n  parameter Real tau(unit=\"s\", min=0.05, max=0.5) = 0.2;\n  input Real command;\n  output Real speed(unit=\"1/min\");\n  Real w(unit=\"1/min\", start=0);\nequation\n  tau*der(w) = K*command - w;\n  speed = w;\nend Wheel;\n",
    );
    let mut names = effects(&said);
    names.sort_unstable();
    assert_eq!(
        names,
        ["input_dead_zone", "input_saturation"],
        "{}",
        said["summary"]
    );
}
