//! Actuators that integrate a command: ends of the travel, dead zones and limits, which each say little alone.

use crate::folder::{Folder, effects};
use crate::plant_neighbours::{explained, levels, number, recorded};

/// The rate of what cannot leave a travel.
fn within(rate: f64, position: f64, (lower, upper): (f64, f64)) -> f64 {
    rate.max((lower - position) * 100.0)
        .min((upper - position) * 100.0)
}

/// The vent of a greenhouse: a worm gear that does nothing below 14 % of the command, and a window with two ends. The fit without them
/// leaves its gain at nothing, and a noise model takes up what the dead zone does.
#[test]
fn the_ends_of_a_travel_and_a_dead_zone_are_found_together() {
    let command = levels(40, -75.0, 75.0);
    let log = recorded(
        "cmd,angle",
        (1800, 0.5),
        &[&command],
        |x, u, _| {
            let acts = (u[0].abs() - 14.0).max(0.0) * u[0].signum();
            vec![within(0.03 * acts, x[0], (0.0, 48.0))]
        },
        (&[20.0], &[(0, 0.2)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Vent\n  parameter Real k(unit=\"deg/s\", min=0.005, max=0.1) = 0.02;\n  input Real cmd;\n  output Real angle(unit=\"deg\");\n  Real a(unit=\"deg\", start=0);\nequation\n  der(a) = k*cmd;\n  angle = a;\nend Vent;\n",
    );
    let mut names = effects(&said);
    names.sort_unstable();
    assert_eq!(
        names,
        ["end_stop", "input_dead_zone"],
        "{}",
        said["summary"]
    );
    let of = |id: &str| effects(&said).iter().position(|e| *e == id).unwrap();
    let zone = number(&said, of("input_dead_zone"), "input_dead_zone_d");
    assert!((zone - 14.0).abs() < 0.3, "{zone}");
    let upper = &said["effects"][of("end_stop")]["parameters"]["limit_upper"];
    assert!(
        (upper["value"].as_f64().unwrap() - 48.0).abs() < 0.1,
        "{upper}"
    );
    assert_eq!(upper["unit"], "deg");
}

/// What acts late and is limited: the one is no form of the other.
#[test]
fn a_delay_and_a_limit_may_be_of_one_input() {
    let command = levels(24, 0.0, 95.0);
    let acting = |k: usize| command(k.saturating_sub(2)).min(65.0);
    let clean = recorded(
        "f,v",
        (1500, 0.25),
        &[&acting],
        |x, u, _| vec![(0.021 * u[0] - x[0]) / 0.8],
        (&[0.0], &[(0, 0.01)]),
    );
    let mut log = String::from("t,f,v\n");
    for (k, line) in clean.lines().skip(1).enumerate() {
        let each: Vec<&str> = line.split(',').collect();
        log.push_str(&format!("{},{},{}\n", each[0], command(k), each[2]));
    }
    let said = explained(
        &Folder::new(),
        &log,
        "model Conveyor\n  parameter Real K(unit=\"m/s\") = 0.018;\n  parameter Real T(unit=\"s\") = 1.0;\n  input Real f;\n  output Real v(unit=\"m/s\");\n  Real s(unit=\"m/s\", start=0);\nequation\n  T*der(s) = K*f - s;\n  v = s;\nend Conveyor;\n",
    );
    let mut names = effects(&said);
    names.sort_unstable();
    assert_eq!(
        names,
        ["input_delay", "input_saturation"],
        "{}",
        said["summary"]
    );
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
}

/// Heat capacity, loss and power have a common scale that no recording tells: the deviation of each is large, and that of what changes
/// too. It is proven all the same.
#[test]
fn a_common_scale_of_all_parameters_does_not_hide_a_change() {
    let heat = levels(60, 0.0, 24.0);
    let log = recorded(
        "u,T",
        (1500, 6.0),
        &[&heat],
        |x, u, t| {
            let power = if t > 4500.0 { 9.5 } else { 14.0 };
            vec![(power * u[0] - 3.2 * (x[0] - 20.0)) / 3200.0]
        },
        (&[22.0], &[(0, 0.15)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Boiler\n  parameter Real C(unit=\"J/K\") = 3800;\n  parameter Real G(unit=\"W/K\") = 2.7;\n  parameter Real P(unit=\"W\") = 12;\n  input Real u;\n  output Real T(unit=\"degC\");\n  Real Th(unit=\"degC\", start=22);\nequation\n  C*der(Th) = P*u - G*(Th - 20);\n  T = Th;\nend Boiler;\n",
    );
    assert_eq!(effects(&said), ["parameter_change"], "{}", said["summary"]);
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
}

/// A garage door with dry friction that hits the floor: alone the friction looks like one that falls with speed, which the contact does;
/// beside the stop it is plain.
#[test]
fn beside_a_stop_friction_keeps_its_simple_form() {
    let force = levels(50, -90.0, 110.0);
    let log = recorded(
        "force,pos",
        (2200, 0.05),
        &[&force],
        |x, u, _| {
            let floor = match x[0] < 0.0 {
                true => -4e4 * x[0] - 900.0 * x[1],
                false => 0.0,
            };
            let spring = 60.0 * (x[0] - 0.9);
            let friction = 35.0 * x[1] + 18.0 * (x[1] / 0.004).tanh();
            vec![x[1], (u[0] - friction - spring + floor) / 62.0]
        },
        (&[0.9, 0.0], &[(0, 0.0008)]),
    );
    let said = explained(
        &Folder::new(),
        &log,
        "model Door\n  parameter Real m(unit=\"kg\", min=40, max=90) = 55;\n  parameter Real d(unit=\"N.s/m\", min=5, max=120) = 50;\n  parameter Real k(unit=\"N/m\", min=20, max=120) = 50;\n  parameter Real x0(unit=\"m\", min=0.5, max=1.2) = 0.9;\n  input Real force(unit=\"N\");\n  output Real pos(unit=\"m\");\n  Real x(unit=\"m\", start=0.9);\n  Real v(unit=\"m/s\", start=0);\nequation\n  der(x) = v;\n  m*der(v) = force - d*v - k*(x - x0);\n  pos = x;\nend Door;\n",
    );
    let mut names = effects(&said);
    names.sort_unstable();
    assert_eq!(
        names,
        ["coulomb_friction", "end_stop"],
        "{}",
        said["summary"]
    );
}

/// A stairlift that is faster downhill than uphill, between two ends, measured with a tape of 5 cm: the free run of either effect alone
/// reaches the ends at other times than the recording.
#[test]
fn the_ends_of_a_travel_are_found_beside_an_asymmetry() {
    let varied = levels(35, -50.0, 50.0);
    let command = |k: usize| {
        varied(k)
            + if (k / 250).is_multiple_of(2) {
                60.0
            } else {
                -60.0
            }
    };
    let clean = recorded(
        "pwm,x",
        (1500, 0.2),
        &[&command],
        |x, u, _| {
            let rate = if u[0] > 0.0 { 0.0021 } else { 0.0028 };
            vec![within(rate * u[0], x[0], (0.2, 6.8))]
        },
        (&[3.0], &[(0, 0.004)]),
    );
    let mut log = String::from("t,pwm,x\n");
    for line in clean.lines().skip(1) {
        let (others, x) = line.rsplit_once(',').unwrap();
        let x: f64 = x.parse().unwrap();
        log.push_str(&format!("{others},{:.2}\n", (x / 0.05).round() * 0.05));
    }
    let said = explained(
        &Folder::new(),
        &log,
        "model Lift\n  parameter Real k(unit=\"m/s\") = 0.0025;\n  input Real pwm;\n  output Real x(unit=\"m\");\n  Real s(unit=\"m\", start=3);\nequation\n  der(s) = k*pwm;\n  x = s;\nend Lift;\n",
    );
    let mut names = effects(&said);
    names.sort_unstable();
    assert_eq!(
        names,
        ["end_stop", "input_asymmetry"],
        "{}",
        said["summary"]
    );
    let stop = effects(&said)
        .iter()
        .position(|e| *e == "end_stop")
        .unwrap();
    for (name, value) in [("limit_lower", 0.2), ("limit_upper", 6.8)] {
        let end = number(&said, stop, name);
        assert!((end - value).abs() < 0.02, "{name}: {end}");
    }
}
