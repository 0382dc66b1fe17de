//! Recordings of closed loops whose controllers act at once, and effects in one of several recordings.

use std::fmt::Write;

use crate::folder::{Folder, effects};
use crate::plant_initial_states::noise;

/// A vessel whose pressure a valve sets.
const VESSEL: &str = r#"model Vessel
  parameter Real K(unit="bar", min=0.02, max=0.3) = 0.08;
  parameter Real T(unit="s", min=1, max=20) = 5;
  input Real valve(unit="1");
  output Real pressure(unit="bar");
  Real p(unit="bar", start=6);
equation
  T*der(p) = K*(valve - 50) - (p - 6);
  pressure = p;
end Vessel;
"#;

/// What a controller of both parts does to the vessel, with slow and white noise: the recording, and the simulation. The valve
/// shows what the controller asks for; it opens to `least` at least.
fn regulated(seed: u64, least: f64) -> [String; 2] {
    let (mut normal, decay) = (noise(seed), (-0.5f64 / 5.0).exp());
    let (mut p, mut simulated, mut slow, mut sum, mut set) = (6.0, 6.0, 0.0, 0.0, 6.0);
    let mut recording = String::from("t [s],valve,pressure\n");
    let mut simulation = String::from("t [s],pressure\n");
    for k in 0..4000 {
        if k % 60 == 0 && normal() > 0.0 {
            set = if set > 6.0 { 5.5 } else { 6.5 };
        }
        slow = 0.97 * slow + 0.02 * normal();
        let y = p + slow + 0.03 * normal();
        let t = 0.5 * f64::from(k);
        sum += 0.4 * (set - y);
        let valve = 50.0 + 6.0 * (set - y) + sum;
        writeln!(recording, "{t},{valve:.6},{y:.6}").unwrap();
        writeln!(simulation, "{t},{simulated:.8}").unwrap();
        let follows =
            |p: f64, valve: f64| decay * p + (1.0 - decay) * (6.0 + 0.08 * (valve - 50.0));
        p = follows(p, valve.max(least));
        simulated = follows(simulated, valve);
    }
    [recording, simulation]
}

#[test]
fn noise_that_a_controller_feeds_back_at_once_is_no_physics() {
    let columns = ["--inputs", "valve", "--outputs", "pressure"];
    for seed in [3, 4] {
        let folder = Folder::new();
        let [recording, simulation] = regulated(seed, f64::NEG_INFINITY);
        folder.text("log.csv", &recording);
        folder.text("simulation.csv", &simulation);
        folder.text("vessel.mo", VESSEL);
        for said in [
            folder.explained("log.csv", "vessel.mo", &[]),
            folder.explained("log.csv", "simulation.csv", &columns),
        ] {
            assert_eq!(said["verdict"], "consistent", "{seed}: {}", said["summary"]);
        }
    }
}

#[test]
fn a_limit_of_the_actuator_is_found_inside_the_loop() {
    let folder = Folder::new();
    let [recording, simulation] = regulated(5, 47.0);
    folder.text("log.csv", &recording);
    folder.text("simulation.csv", &simulation);
    folder.text("vessel.mo", VESSEL);
    let columns = ["--inputs", "valve", "--outputs", "pressure"];
    for said in [
        folder.explained("log.csv", "vessel.mo", &[]),
        folder.explained("log.csv", "simulation.csv", &columns),
    ] {
        assert_eq!(effects(&said), ["input_saturation"], "{}", said["summary"]);
    }
}

/// A tank beside an operating point, with slow noise and a simulator whose parameters are 5 % off: the second recording has a load from
/// its middle on, which explains little of both.
#[test]
fn what_acts_in_one_of_two_recordings_is_found_there() {
    for draw in 0..3 {
        let folder = Folder::new();
        let mut arguments = vec!["explain".to_owned()];
        for (number, load) in [(1, 0.0), (2, -1.0)] {
            let (mut normal, mut y, mut simulated) = (noise(10 * draw + number), 80.0, 80.0);
            let (mut slow, mut u) = (0.0, 40.0);
            let mut recording = String::from("t [s],heater [%],temperature [degC]\n");
            let mut simulation = String::from("t [s],temperature [degC]\n");
            for k in 0..1500 {
                if k % 40 == 0 {
                    u = 40.0 + 8.0 * normal();
                }
                slow = 0.9 * slow + 0.05 * normal();
                writeln!(recording, "{k},{u:.6},{:.6}", y + slow + 0.05 * normal()).unwrap();
                writeln!(simulation, "{k},{simulated:.8}").unwrap();
                let acting = if k < 700 { u } else { u + load };
                y = 0.95 * y + 0.1 * acting;
                simulated = 0.9525 * simulated + 0.095 * u;
            }
            folder.text(&format!("log{number}.csv"), &recording);
            folder.text(&format!("simulation{number}.csv"), &simulation);
        }
        arguments.extend(["log1.csv", "log2.csv", "--simulation"].map(str::to_owned));
        arguments.extend(["simulation1.csv", "--simulation", "simulation2.csv"].map(str::to_owned));
        arguments.extend(["--inputs", "heater", "--outputs", "temperature"].map(str::to_owned));
        arguments.extend(["--output", "e.json"].map(str::to_owned));
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        folder.run(&arguments).ok();
        let said = crate::folder::json(&folder.join("e.json"));
        assert_eq!(effects(&said), ["load_step"], "{draw}: {}", said["summary"]);
        assert!(
            said["summary"].to_string().contains("log2.csv only"),
            "{draw}: {}",
            said["summary"]
        );
    }
}

/// Steam for the air of a room, which a controller sets by a sensor that drifts, and which arrives late. A noise model with a unit root
/// takes up both: neither alone is seen beside it.
#[test]
fn a_drift_and_a_delay_in_a_loop_are_told_from_wandering_noise() {
    const LATE: usize = 9;
    let (mut normal, decay) = (noise(4), (-0.5f64 * 10.0 / 280.0).exp());
    let mut x = 0.8;
    let mut steam: Vec<f64> = Vec::new();
    let mut recording = String::from("t [s],s [g/s],y [g/kg]\n");
    for k in 0..1500 {
        let t = 10.0 * k as f64;
        let part = ((k / 37) as f64 * 0.618_033_988_7 + 0.13).fract();
        let set = 0.6 + 2.4 * part;
        let y = x + 3e-4 * t + 0.02 * normal();
        steam.push((0.3 + 1.5 * (set - y)).clamp(0.0, 2.0));
        writeln!(recording, "{t},{:.6},{y:.5}", steam[k]).unwrap();
        let goal = 0.4 + 0.9 / 0.5 * steam[k.saturating_sub(LATE)];
        x = goal + (x - goal) * decay;
    }
    let folder = Folder::new();
    folder.text("log.csv", &recording);
    folder.text(
        "room.mo",
        "model Room\n  parameter Real M(unit=\"kg\", min=250, max=295) = 265;\n  parameter Real e(unit=\"1\", min=0.8, max=1) = 0.85;\n  parameter Real m(unit=\"kg/s\", min=0.45, max=0.55) = 0.48;\n  input Real s(unit=\"g/s\");\n  output Real y(unit=\"g/kg\");\n  Real x(unit=\"g/kg\", start=0.8);\nequation\n  M*der(x) = e*s - m*(x - 0.4);\n  y = x;\nend Room;\n",
    );
    let said = folder.explained("log.csv", "room.mo", &[]);
    let mut found = effects(&said);
    found.sort_unstable();
    assert_eq!(
        found,
        ["input_delay", "sensor_drift"],
        "{}",
        said["summary"]
    );
    for (id, name, truth, near) in [
        ("sensor_drift", "sensor_drift_c", 3e-4, 3e-6),
        ("input_delay", "input_delay_T", 90.0, 3.0),
    ] {
        let all = said["effects"].as_array().unwrap();
        let effect = all.iter().find(|e| e["effect"] == id).unwrap();
        let value = effect["parameters"][name]["value"].as_f64().unwrap();
        assert!((value - truth).abs() < near, "{name} {value}");
    }
}
