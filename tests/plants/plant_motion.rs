//! Plants that move: gravity that the simulator leaves out, and step responses of which nothing is left out.

use std::fmt::Write;

use crate::folder::{Folder, json};
use crate::plant_initial_states::{noise, run};

const PENDULUM: &str = r#"model Pendulum
  parameter Real J(unit="kg.m2", min=0.1, max=0.2) = 0.14;
  parameter Real b(unit="N.m.s/rad", min=0, max=0.5) = 0.02;
  output Real angle(unit="rad");
  Real phi(unit="rad", start=2.5);
  Real w(unit="rad/s");
equation
  der(phi) = w;
  J*der(w) = -b*w;
  angle = phi;
end Pendulum;
"#;

const MOTOR: &str = r#"model Motor
  parameter Real K(unit="rpm", min=0.15, max=0.4) = 0.25;
  parameter Real tau(unit="s", min=0.01, max=0.2) = 0.05;
  parameter Real c(min=0, max=1500) = 500;
  input Real pwm;
  output Real speed(unit="rpm");
  Real w(unit="rpm", start=0);
equation
  tau*der(w) = K*(pwm - c*sign(w)) - w;
  speed = w;
end Motor;
"#;

#[test]
fn gravity_is_found_in_a_swing() {
    let folder = Folder::new();
    folder.text("pendulum.mo", PENDULUM);
    let rate = |[phi, w]: [f64; 2]| [w, (-0.03 * w - 2.0 * phi.sin()) / 0.15];
    let mut normal = noise(5);
    let mut text = String::from("t,angle\n");
    for (k, x) in run(rate, [2.5, 0.0], 600, 0.02).iter().enumerate() {
        writeln!(text, "{},{}", 0.02 * k as f64, x[0] + 0.01 * normal()).unwrap();
    }
    folder.text("log.csv", &text);
    let explain = [
        "explain",
        "log.csv",
        "--simulation",
        "pendulum.mo",
        "--output",
        "e.json",
    ];
    folder.run(&explain).ok();
    let said = json(&folder.join("e.json"));
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    assert_eq!(
        said["effects"][0]["effect"], "gravity_torque",
        "{}",
        said["summary"]
    );
    assert_eq!(said["effects"][0]["enters"], "w");
}

/// Each recording is one step from rest, so that its blocks say little apart.
#[test]
fn step_responses_give_the_parameters_of_a_plant_that_lacks_nothing() {
    let folder = Folder::new();
    folder.text("motor.mo", MOTOR);
    let mut normal = noise(6);
    let steps = [3192.0, 2394.0, -1062.0, -2658.0];
    let names = ["a.csv", "b.csv", "c.csv", "d.csv"];
    for (name, pwm) in names.iter().zip(steps) {
        let drive: f64 = 0.33 * (pwm - 760.0 * f64::signum(pwm));
        let speeds = run(|[w, _]| [(drive - w) / 0.037, 0.0], [0.0, 0.0], 85, 0.005);
        let mut text = String::from("t,pwm,speed\n");
        for (k, x) in speeds.iter().enumerate() {
            let speed = x[0] + 10.0 * normal();
            writeln!(text, "{},{pwm},{speed}", 0.005 * k as f64).unwrap();
        }
        folder.text(name, &text);
    }
    let options = ["--simulation", "motor.mo", "--output", "e.json"];
    folder
        .run(&[&["explain"][..], &names, &options].concat())
        .ok();
    let said = json(&folder.join("e.json"));
    assert_eq!(said["verdict"], "parameters", "{}", said["summary"]);
    for (name, expected) in [("K", 0.33), ("tau", 0.037), ("c", 760.0)] {
        let all = said["parameters"].as_array().unwrap();
        let found = all.iter().find(|p| p["name"] == name).unwrap();
        let number = |key: &str| found[key].as_f64().unwrap();
        let error = (number("recording") - expected).abs();
        assert!(error < 4.0 * number("std"), "{found}");
    }
}
