//! A part that is coupled to the rest, where the simulation has one body: on a shaft that twists, and with play.

use std::fmt::Write;

use crate::folder::{Folder, json};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Motor and load as one inertia.
const STIFF: &str = r#"model Drive
  parameter Real J(unit="kg.m2", min=0.01, max=0.1) = 0.03;
  parameter Real d(unit="N.m.s/rad", min=0, max=1) = 0.1;
  input Real u(unit="N.m"); output Real y(unit="rad/s");
  Real w(unit="rad/s");
equation
  J*der(w) = u - d*w;
  y = w;
end Drive;
"#;

/// The same with a shaft between the two, whose torque is a function of its twist.
fn with_shaft(torque: &str) -> String {
    format!(
        r#"model Drive
  input Real u(unit="N.m"); output Real y(unit="rad/s");
  Real w(unit="rad/s"); Real wl(unit="rad/s"); Real twist(unit="rad");
  Real T(unit="N.m") = {torque};
equation
  der(twist) = w - wl;
  0.02*der(w) = u - 0.1*w - T;
  0.015*der(wl) = T;
  y = w;
end Drive;
"#
    )
}

/// The answer where the simulator is `simulator`, and the plant has a shaft with `torque`.
fn explained(simulator: &str, torque: &str, seed: u64) -> serde_json::Value {
    let folder = Folder::new();
    folder.text("simulator.mo", simulator);
    folder.text("shaft.mo", &with_shaft(torque));
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut dice) };
    let (mut input, mut u) = (String::from("t,u\n"), Vec::new());
    for sample in 0..2500 {
        let now = match sample % 20 {
            0 => normal(),
            _ => u[sample - 1],
        };
        u.push(now);
        writeln!(input, "{},{now}", 0.01 * sample as f64).unwrap();
    }
    folder.text("input.csv", &input);
    folder
        .run(&["simulate", "shaft.mo", "input.csv", "--output", "true.csv"])
        .ok();
    let simulated = std::fs::read_to_string(folder.join("true.csv")).unwrap();
    let mut log = String::from("t,u,y\n");
    for (line, u) in simulated.lines().skip(1).zip(&u) {
        let (t, y) = line.split_once(',').unwrap();
        let y: f64 = y.rsplit(',').next().unwrap().parse().unwrap();
        writeln!(log, "{t},{u},{}", y + 0.05 * normal()).unwrap();
    }
    folder.text("log.csv", &log);
    let arguments = ["explain", "log.csv", "--simulation", "simulator.mo"];
    folder
        .run(&[&arguments[..], &["--output", "e.json"]].concat())
        .ok();
    json(&folder.join("e.json"))
}

fn parameter(said: &serde_json::Value, name: &str) -> (f64, f64) {
    let parameter = &said["effects"][0]["parameters"][name];
    let number = |key: &str| parameter[key].as_f64().unwrap();
    (number("value"), number("std"))
}

#[test]
fn a_shaft_that_twists_is_found_with_its_share_and_frequency() {
    // The load of 0.015 is 3/7 of all; alone on the shaft it swings at sqrt(20/0.015) rad/s.
    let said = explained(STIFF, "20*twist + 0.03*(w - wl)", 1);
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    assert_eq!(said["effects"][0]["effect"], "extra_mode");
    assert_eq!(said["effects"][0]["enters"], "w");
    let (share, std) = parameter(&said, "extra_mode_f");
    assert!((share - 3.0 / 7.0).abs() < 4.0 * std, "{share} +- {std}");
    let (time, std) = parameter(&said, "extra_mode_T");
    let expected = (0.015f64 / 20.0).sqrt();
    assert!((time - expected).abs() < 4.0 * std, "{time} +- {std}");
}

#[test]
fn play_between_two_parts_is_found_with_its_width() {
    // Damped: parts that rattle for long move so irregularly that a free run does not follow.
    let contact = "40*(max(twist - 0.1, 0) + min(twist + 0.1, 0))";
    let said = explained(STIFF, &format!("{contact} + 0.3*(w - wl)"), 2);
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    assert_eq!(said["effects"][0]["effect"], "backlash");
    let (play, std) = parameter(&said, "backlash_g");
    assert!((play - 0.1).abs() < 4.0 * std + 0.002, "{play} +- {std}");
}

#[test]
fn play_in_a_shaft_that_the_simulator_has_is_found_with_its_width() {
    let contact = "40*(max(twist - 0.03, 0) + min(twist + 0.03, 0))";
    let simulator = with_shaft("k*twist + 0.3*(w - wl)").replace(
        "  input",
        "  parameter Real k(unit=\"N.m/rad\", min=20, max=80) = 45;\n  input",
    );
    let said = explained(&simulator, &format!("{contact} + 0.3*(w - wl)"), 3);
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    assert_eq!(said["effects"].as_array().map(Vec::len), Some(1));
    assert_eq!(said["effects"][0]["effect"], "backlash");
    let (play, std) = parameter(&said, "gap_g");
    assert!((play - 0.03).abs() < 4.0 * std + 0.0006, "{play} +- {std}");
}
