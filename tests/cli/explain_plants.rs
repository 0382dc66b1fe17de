//! Plants of another class than the linear one, drawn by an integrator of small steps in physical units, explained from a
//! linear model that was identified from the same recording: tanks, and sensors that lose the sign. And recordings that
//! look like theirs and are not.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use serde_json::Value;

use crate::folder::{Folder, effects, json};

/// Small steps a sample.
const FINE: usize = 100;
const SAMPLES: usize = 1000;

fn table(sample_time: f64, u: &[f64], y: &[f64]) -> String {
    let mut text = "t,u1,y1\n".to_owned();
    for (k, (u, y)) in u.iter().zip(y).enumerate() {
        text.push_str(&format!("{},{u:.8},{y:.8}\n", k as f64 * sample_time));
    }
    text
}

/// Levels between `low` and `high`, each held for so many samples.
fn levels(seed: u64, low: f64, high: f64, held: usize) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut u = Vec::with_capacity(SAMPLES);
    while u.len() < SAMPLES {
        let share: f64 = StandardUniform.sample(&mut random);
        u.extend(std::iter::repeat_n(low + share * (high - low), held));
    }
    u.truncate(SAMPLES);
    u
}

fn with_noise(y: &[f64], deviation: f64, seed: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    y.iter()
        .map(|y| {
            let e: f64 = StandardNormal.sample(&mut random);
            y + deviation * e
        })
        .collect()
}

/// What is said of a recording whose simulation is a linear model identified from it.
fn said(sample_time: f64, u: &[f64], y: &[f64]) -> Value {
    let folder = Folder::new();
    folder.text("log.csv", &table(sample_time, u, y));
    folder
        .run(&["identify", "log.csv", "--output", "model.json"])
        .ok();
    folder
        .run(&[
            "explain",
            "log.csv",
            "--simulation",
            "model.json",
            "--output",
            "explanation.json",
        ])
        .ok();
    json(&folder.join("explanation.json"))
}

/// Distance of a fitted parameter from the truth, in its standard deviations.
fn distance(explanation: &Value, effect: usize, name: &str, truth: f64) -> f64 {
    let q = &explanation["effects"][effect]["parameters"][name];
    let (value, std) = (q["value"].as_f64().unwrap(), q["std"].as_f64().unwrap());
    (value - truth).abs() / std
}

/// Two tanks of one area each: outflow coefficients in level^(1/2)/s, rims in level.
struct Tanks {
    pump: f64,
    outflow: [f64; 2],
    rim: [f64; 2],
    caught: f64,
    sample_time: f64,
}

const TANKS: Tanks = Tanks {
    pump: 0.055,
    outflow: [0.045, 0.05],
    rim: [f64::INFINITY; 2],
    caught: 0.7,
    sample_time: 4.0,
};

impl Tanks {
    fn run(&self, input: &[f64], mut x: [f64; 2]) -> Vec<f64> {
        let h = self.sample_time / FINE as f64;
        input
            .iter()
            .map(|u| {
                let y = x[1];
                for _ in 0..FINE {
                    let out = [0, 1].map(|i| self.outflow[i] * x[i].sqrt());
                    x[0] = (x[0] + h * (self.pump * u - out[0])).max(0.0);
                    let over = (x[0] - self.rim[0]).max(0.0);
                    x[0] -= over;
                    x[1] = (x[1] + h * (out[0] - out[1]) + self.caught * over).max(0.0);
                    x[1] = x[1].min(self.rim[1]);
                }
                y
            })
            .collect()
    }
}

/// Four standard deviations: one in ten thousand.
const FAR: f64 = 4.0;

#[test]
fn tanks_that_do_not_overflow() {
    let u = levels(1, 0.8, 3.2, 30);
    let y = with_noise(&TANKS.run(&u, [3.0, 2.5]), 0.03, 2);
    let said = said(TANKS.sample_time, &u, &y);
    assert_eq!(effects(&said), ["tank_outflow"], "{}", said["summary"]);
    for (name, truth) in [
        ("upper_outflow", TANKS.outflow[0]),
        ("lower_outflow", TANKS.outflow[1]),
    ] {
        let far = distance(&said, 0, name, truth);
        assert!(far < FAR, "{name}: {far} deviations; {}", said["summary"]);
    }
}

#[test]
fn tanks_that_overflow() {
    let tanks = Tanks {
        rim: [9.0, 6.5],
        ..TANKS
    };
    let u = levels(3, 0.8, 3.4, 30);
    let clean = tanks.run(&u, [3.0, 2.5]);
    let said = said(tanks.sample_time, &u, &with_noise(&clean, 0.03, 4));
    assert_eq!(
        effects(&said),
        ["tank_outflow", "overflow", "overflow"],
        "{}",
        said["summary"]
    );
    let rim = &said["effects"][1]["parameters"]["above_from"];
    let (rim, std) = (rim["value"].as_f64().unwrap(), rim["std"].as_f64().unwrap());
    assert!((rim - tanks.rim[1]).abs() < FAR * std, "{rim} +- {std}");
}

#[test]
fn one_tank() {
    let tanks = Tanks {
        outflow: [1e3, 0.05],
        ..TANKS
    };
    let u = levels(5, 0.5, 3.0, 30);
    // An upper tank without resistance: what the pump brings arrives at once.
    let h = tanks.sample_time / FINE as f64;
    let mut x: f64 = 2.0;
    let clean: Vec<f64> = u
        .iter()
        .map(|u| {
            let y = x;
            for _ in 0..FINE {
                x = (x + h * (tanks.pump * u - tanks.outflow[1] * x.sqrt())).max(0.0);
            }
            y
        })
        .collect();
    let said = said(tanks.sample_time, &u, &with_noise(&clean, 0.03, 6));
    assert_eq!(effects(&said), ["tank_outflow"], "{}", said["summary"]);
    let far = distance(&said, 0, "outflow", tanks.outflow[1]);
    assert!(far < FAR, "{far} deviations; {}", said["summary"]);
}

/// Two tanks whose outflow is proportional to the level are a linear plant.
#[test]
fn a_linear_process_is_no_tank() {
    let u = levels(7, 0.8, 3.2, 30);
    let h = 4.0 / FINE as f64;
    let mut x = [2.0, 2.0];
    let clean: Vec<f64> = u
        .iter()
        .map(|u| {
            let y = x[1];
            for _ in 0..FINE {
                let flow = [0.03 * x[0], 0.03 * x[1]];
                x = [
                    x[0] + h * (0.03 * u - flow[0]),
                    x[1] + h * (flow[0] - flow[1]),
                ];
            }
            y
        })
        .collect();
    let said = said(4.0, &u, &with_noise(&clean, 0.02, 8));
    let ids = effects(&said);
    assert!(
        !ids.contains(&"tank_outflow") && !ids.contains(&"overflow"),
        "{}",
        said["summary"]
    );
}

/// Speed of a motor with an elastic load, `(friction, knee)` on the load; the motor's own friction is viscous.
fn drive(input: &[f64], friction: f64, knee: f64) -> Vec<f64> {
    let (inertia, viscous, stiffness, damping) = ([0.02, 0.05], [0.05, 0.06], 4.0, 0.02);
    let h = DRIVE_TIME / FINE as f64;
    let (mut speed, mut twist) = ([0.0, 0.0], 0.0);
    input
        .iter()
        .map(|u| {
            let y = speed[1];
            for _ in 0..FINE {
                let torque = stiffness * twist + damping * (speed[0] - speed[1]);
                let dry = if friction > 0.0 {
                    friction * (speed[1] / knee).tanh()
                } else {
                    0.0
                };
                speed = [
                    speed[0] + h * (0.2 * u - viscous[0] * speed[0] - torque) / inertia[0],
                    speed[1] + h * (torque - viscous[1] * speed[1] - dry) / inertia[1],
                ];
                twist += h * (speed[0] - speed[1]);
            }
            y
        })
        .collect()
}

const DRIVE_TIME: f64 = 0.05;

#[test]
fn a_drive_whose_sensor_loses_the_sign() {
    let u = levels(9, -2.0, 2.0, 12);
    let y: Vec<f64> = drive(&u, 0.0, 1.0).iter().map(|y| y.abs()).collect();
    let said = said(DRIVE_TIME, &u, &with_noise(&y, 0.02, 10));
    assert_eq!(
        effects(&said),
        ["sensor_rectification"],
        "{}",
        said["summary"]
    );
}

#[test]
fn a_drive_with_friction_whose_sensor_loses_the_sign() {
    let u = levels(11, -3.0, 3.0, 15);
    let y: Vec<f64> = drive(&u, 0.2, 0.3).iter().map(|y| y.abs()).collect();
    let said = said(DRIVE_TIME, &u, &with_noise(&y, 0.02, 12));
    assert_eq!(
        effects(&said),
        ["sensor_rectification", "coulomb_friction"],
        "{}",
        said["summary"]
    );
    // Friction in units of the input, which drives with 0.2 a unit.
    let far = distance(&said, 1, "friction_force", 1.0);
    assert!(far < FAR, "{far} deviations; {}", said["summary"]);
}

/// A motor that is only driven forwards comes to rest again and again, and no sign is lost.
#[test]
fn a_drive_that_stands_still_has_its_sign() {
    let u: Vec<f64> = levels(13, -2.0, 2.0, 20)
        .iter()
        .map(|u| u.max(0.0))
        .collect();
    let y = drive(&u, 0.0, 1.0);
    let said = said(DRIVE_TIME, &u, &with_noise(&y, 0.02, 14));
    assert!(
        !effects(&said).contains(&"sensor_rectification"),
        "{}",
        said["summary"]
    );
}
