//! A car that rolls to a stop: nothing but its speed is recorded.

use std::fmt::Write;

use crate::folder::Folder;
use crate::plant_initial_states::{noise, run};

/// Drag of the air alone.
const CAR: &str = r#"model Car
  final parameter Real m(unit="kg") = 1500;
  final parameter Real rho(unit="kg/m3") = 1.2;
  parameter Real CdA(unit="m2", min=0.2, max=1.2) = 0.7;
  output Real y(unit="m/s");
  Real v(unit="m/s", start=32);
equation
  m*der(v) = -0.5*rho*CdA*v*v;
  y = v;
end Car;
"#;

/// A speed that never turns does not show how friction comes up: a constant against the motion is friction, before a sensor
/// that drifts at its own time.
#[test]
fn rolling_resistance_is_dry_friction() {
    let folder = Folder::new();
    folder.text("car.mo", CAR);
    for seed in [1, 2] {
        let rate = |[v, _]: [f64; 2]| [-(180.0 + 0.5 * 1.2 * 0.6 * v * v) / 1500.0, 0.0];
        let mut normal = noise(seed);
        let mut text = String::from("t,y\n");
        for (k, x) in run(rate, [32.0, 0.0], 90, 1.0).iter().enumerate() {
            writeln!(text, "{k},{:.2}", x[0] + 0.05 * normal()).unwrap();
        }
        folder.text("log.csv", &text);
        let said = folder.explained("log.csv", "car.mo", &["--inputs", "none"]);
        let summary = &said["summary"];
        let effect = &said["effects"][0];
        assert_eq!(effect["effect"], "coulomb_friction", "{summary}");
        assert_eq!(said["effects"].as_array().unwrap().len(), 1, "{summary}");
        let force = effect["parameters"]["one_way_friction_c"]["value"]
            .as_f64()
            .unwrap();
        assert!((force + 180.0).abs() < 6.0, "{summary}");
    }
}
