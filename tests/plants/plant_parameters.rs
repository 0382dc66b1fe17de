//! Columns of simulators whose parameters are a little wrong, and nothing else.

use std::fmt::Write;

use crate::folder::{Folder, effects};
use crate::plant_initial_states::noise;

/// Steps of a simulation in a sample.
const STEPS: usize = 20;

/// A force that is another one after so many samples.
fn steps(samples: usize, every: usize, mut normal: impl FnMut() -> f64) -> Vec<f64> {
    let levels: Vec<f64> = (0..samples.div_ceil(every))
        .map(|_| 10.0 * normal())
        .collect();
    (0..samples).map(|k| levels[k / every]).collect()
}

/// Two masses with a spring between them and one to the ground, pushed at the first: positions of the second at every sample.
fn two_masses(force: &[f64], step: f64, between: f64) -> Vec<f64> {
    let (mut x, mut v) = ([0.0; 2], [0.0; 2]);
    let h = step / STEPS as f64;
    force
        .iter()
        .map(|f| {
            let seen = x[1];
            for _ in 0..STEPS {
                let stretched = between * (x[0] - x[1]);
                let sliding = 0.8 * (v[0] - v[1]);
                let a = [
                    f - stretched - sliding - 60.0 * x[0] - 1.0 * v[0],
                    (stretched + sliding) / 0.6,
                ];
                for i in 0..2 {
                    v[i] += h * a[i];
                    x[i] += h * v[i];
                }
            }
            seen
        })
        .collect()
}

/// A cylinder that a valve drives, with the natural frequency `frequency` (rad/s), in a position loop: what the valve did, and where
/// the cylinder was.
fn cylinder(
    frequency: f64,
    valve: Option<&[f64]>,
    mut noise: impl FnMut() -> f64,
) -> [Vec<f64>; 2] {
    let (mut x, mut v, mut a) = (0.0, 0.0, 0.0);
    let (mut set, mut valves, mut positions) = (0.0, vec![], vec![]);
    let h = 0.005 / STEPS as f64;
    for k in 0..2000 {
        if k % 100 == 0 {
            set = 20.0 * noise();
        }
        let y = x + 0.1 * noise();
        let u = valve.map_or(0.08 * (set - y), |valve| valve[k]);
        valves.push(u);
        positions.push(if valve.is_some() { x } else { y });
        for _ in 0..STEPS {
            let jerk = frequency * frequency * (60.0 * u - v) - 2.0 * 0.3 * frequency * a;
            a += h * jerk;
            v += h * a;
            x += h * v;
        }
    }
    [valves, positions]
}

fn explained(input: &[f64], recorded: &[f64], simulated: &[f64], step: f64) -> serde_json::Value {
    let folder = Folder::new();
    let mut recording = String::from("t [s],u,y\n");
    let mut simulation = String::from("t [s],y\n");
    for (k, u) in input.iter().enumerate() {
        let t = step * k as f64;
        writeln!(recording, "{t},{u:.7},{:.7}", recorded[k]).unwrap();
        writeln!(simulation, "{t},{:.9}", simulated[k]).unwrap();
    }
    folder.text("log.csv", &recording);
    folder.text("simulation.csv", &simulation);
    folder.explained("log.csv", "simulation.csv", &[])
}

/// One of several springs is stiffer by 2 %: all modes move, and no change at some time, mass or drag stands for it. In two of eight
/// draws one did, where the null models held no mass and did not start again.
#[test]
fn another_spring_is_no_missing_physics() {
    for seed in 1..=8 {
        let mut normal = noise(seed);
        let force = steps(1600, 25, &mut normal);
        let simulated = two_masses(&force, 0.01, 300.0);
        let mut recorded = two_masses(&force, 0.01, 1.02 * 300.0);
        recorded.iter_mut().for_each(|y| *y += 0.0015 * normal());
        let said = explained(&force, &recorded, &simulated, 0.01);
        assert_eq!(said["verdict"], "parameters", "{seed}: {}", said["summary"]);
    }
}

/// An axis in a position loop: the averaged equation of a drive is blind to its resonance, the free run is not.
#[test]
fn another_resonance_of_an_axis_is_found() {
    for (seed, factor) in [(1, 1.04), (2, 0.97)] {
        let [valve, recorded] = cylinder(60.0 * factor, None, noise(seed));
        let [_, simulated] = cylinder(60.0, Some(&valve), noise(seed));
        let said = explained(&valve, &recorded, &simulated, 0.005);
        assert_eq!(said["verdict"], "parameters", "{seed}: {}", said["summary"]);
        assert_eq!(effects(&said), Vec::<String>::new());
        let resonance = said["parameters"]
            .as_array()
            .and_then(|all| all.iter().find(|p| p["name"] == "natural frequency"))
            .unwrap_or_else(|| panic!("{seed}: {}", said["summary"]));
        let ratio =
            resonance["recording"].as_f64().unwrap() / resonance["simulation"].as_f64().unwrap();
        assert!((ratio - factor).abs() < 0.015, "{seed}: {ratio}");
    }
}

/// A mass on a spring that becomes heavier by a quarter: what is said is the mass that was added, in the unit of the input over that
/// of the acceleration.
#[test]
fn the_mass_that_was_added_is_stated() {
    let mut normal = noise(4);
    let force = steps(2000, 30, &mut normal);
    let positions = |added: f64| -> Vec<f64> {
        let (mut x, mut v) = (0.0, 0.0);
        let h = 0.02 / STEPS as f64;
        let each = force.iter().enumerate();
        each.map(|(k, f)| {
            let seen = x;
            let mass = if k < 900 { 2.0 } else { 2.0 + added };
            for _ in 0..STEPS {
                v += h * (f - 3.0 * v - 80.0 * x) / mass;
                x += h * v;
            }
            seen
        })
        .collect()
    };
    let mut recorded = positions(0.5);
    recorded.iter_mut().for_each(|y| *y += 0.003 * normal());
    let said = explained(&force, &recorded, &positions(0.0), 0.02);
    assert_eq!(effects(&said), ["mass_change"], "{}", said["summary"]);
    let parameters = &said["effects"][0]["parameters"];
    let mass = parameters["mass_change"]["value"].as_f64().unwrap();
    assert!((mass - 0.5).abs() < 0.02, "{parameters}");
}
