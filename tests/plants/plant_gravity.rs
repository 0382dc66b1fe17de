//! Gravity that the simulator of a pendulum leaves out.

use std::fmt::Write;

use crate::folder::Folder;
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
    let said = folder.explained("log.csv", "pendulum.mo", &[]);
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    assert_eq!(
        said["effects"][0]["effect"], "gravity_torque",
        "{}",
        said["summary"]
    );
    assert_eq!(said["effects"][0]["enters"], "w");
}
