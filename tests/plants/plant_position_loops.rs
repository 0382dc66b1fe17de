//! Drives under position control: the plant integrates, and its input reacts to what disturbs it.

use std::fmt::Write;

use crate::folder::{Folder, effects};
use crate::plant_initial_states::noise;
use crate::plant_neighbours::{levels, recorded};

const STEP: f64 = 0.01;
/// Steps of the truth in a sample.
const FINE: usize = 20;

/// A slide that a motor moves from place to place; `load` acts on it, as a function of time, position and velocity.
fn moved(seed: u64, samples: usize, load: impl Fn(f64, f64, f64) -> f64) -> String {
    let mut normal = noise(seed);
    let (mut x, mut v, mut set, mut last) = (0.0, 0.0, 0.0, 0.0);
    let mut log = String::from("t [s],u [V],y [m]\n");
    for k in 0..samples {
        let t = STEP * k as f64;
        if k % 130 == 0 {
            set = 0.6 * normal();
        }
        let y = x + 2e-4 * normal();
        let u = (60.0 * (set - y) - 12.0 * (y - last) / STEP).clamp(-24.0, 24.0);
        last = y;
        writeln!(log, "{t:.3},{u:.6},{y:.6}").unwrap();
        let h = STEP / FINE as f64;
        for i in 0..FINE {
            let at = t + h * i as f64;
            let pull = |x: f64, v: f64| (9.0 * u - 30.0 * v - load(at, x, v)) / 8.0;
            let a = pull(x, v);
            let b = pull(x + h * v, v + h * a);
            x += h * (v + 0.5 * h * a);
            v += 0.5 * h * (a + b);
        }
    }
    log
}

const SLIDE: &str = r#"model Slide
  parameter Real m(unit="kg", min=6, max=10) = 7;
  parameter Real b(unit="N.s/m", min=20, max=40) = 27;
  parameter Real kf(unit="N/V", min=7, max=11) = 8.5;
  input Real u(unit="V");
  output Real y(unit="m");
  Real x(unit="m", start=0);
  Real v(unit="m/s", start=0);
equation
  der(x) = v;
  m*der(v) = kf*u - b*v;
  y = x;
end Slide;
"#;

fn explained(log: &str) -> serde_json::Value {
    let folder = Folder::new();
    folder.text("log.csv", log);
    folder.text("slide.mo", SLIDE);
    folder.explained("log.csv", "slide.mo", &[])
}

/// Twenty-odd pitches within the travel: a wave number that is off by one goes out of step with the recording.
#[test]
fn cogging_of_a_slide() {
    let wave = std::f64::consts::TAU / 0.11;
    let log = moved(1, 3000, |_, x, _| 9.0 * (wave * x + 0.4).sin());
    let said = explained(&log);
    assert_eq!(effects(&said), ["cogging"], "{}", said["summary"]);
    let found = &said["effects"][0]["parameters"]["sine_k"]["value"];
    let found = found.as_f64().unwrap();
    assert!((found / wave - 1.0).abs() < 1e-3, "{found} of {wave}");
}

/// A curve of the input takes more off at first than either does alone.
#[test]
fn friction_and_a_load_that_comes_later() {
    let log = moved(2, 3000, |t, _, v| {
        18.0 * (v / 1e-3).tanh() + if t < 19.0 { 0.0 } else { 24.0 }
    });
    let said = explained(&log);
    let mut ids = effects(&said);
    ids.sort_unstable();
    assert_eq!(
        ids,
        ["coulomb_friction", "load_step"],
        "{}",
        said["summary"]
    );
}

/// An axis that no spring brings back, with columns in place of equations: its simulation drifts away, so that a noise model with a slow
/// root takes up what cogging does. Nothing is missing for that model; the equations that reproduce the columns say what is.
#[test]
fn cogging_of_an_axis_that_drifts_is_no_noise() {
    let volt = levels(15, -3.0, 3.0);
    let axis = |cogging: f64, noise: f64| {
        recorded(
            "volt [V],pan [deg]",
            (3000, 0.004),
            &[&volt],
            |x, u, _| {
                let rate = x[1].to_degrees();
                let turned = (x[0] / 15.0 * std::f64::consts::TAU).sin();
                vec![rate, (0.3 * u[0] - 0.12 * x[1] - cogging * turned) / 0.02]
            },
            (&[0.0, 0.0], &[(0, noise)]),
        )
    };
    let folder = Folder::new();
    folder.text("log.csv", &axis(0.06, 0.2));
    folder.text("simulation.csv", &axis(0.0, 0.0));
    let columns = ["--inputs", "volt [V]", "--outputs", "pan [deg]"];
    let said = folder.explained("log.csv", "simulation.csv", &columns);
    assert_eq!(effects(&said), ["cogging"], "{}", said["summary"]);
}
