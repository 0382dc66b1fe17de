//! `explain` where the simulation is a plant in equations, on recordings of an integrator of its own.

#[path = "support/folder.rs"]
mod folder;

use std::fmt::Write;

use folder::Folder;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A cart on a spring, driven by a force.
const CART: &str = r#"model Cart "cart on a spring"
  parameter Real m(unit="kg", min=0.8, max=1.2) = 1.0 "mass";
  parameter Real k(unit="N/m", min=30, max=50) = 40 "spring";
  parameter Real d(unit="N.s/m", min=0, max=3) = 1.0 "damper";
  input Real u(unit="N");
  output Real y(unit="m");
  Real x(unit="m", start=0);
  Real v(unit="m/s", start=0);
equation
  der(x) = v;
  m*der(v) = u - k*x - d*v;
  y = x;
end Cart;
"#;

/// A recording of the cart: `extra` is the force that the equations leave out, of position, speed and time.
fn record(folder: &Folder, name: &str, mass: f64, extra: impl Fn(f64, f64, f64) -> f64, seed: u64) {
    const PARTS: usize = 40;
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut dice) };
    let (h, mut x, mut v, mut u) = (0.02, 0.0, 0.0, 0.0);
    let mut text = String::from("t,u [N],y [m]\n");
    for sample in 0..2500 {
        if sample % 25 == 0 {
            u = 20.0 * normal();
        }
        let time = h * f64::from(sample);
        writeln!(text, "{time},{u},{}", x + 0.004 * normal()).unwrap();
        for part in 0..PARTS {
            let step = h / PARTS as f64;
            let force = |x: f64, v: f64, t: f64| (u - 40.0 * x - 1.0 * v + extra(x, v, t)) / mass;
            let t = time + step * part as f64;
            // Heun's method.
            let a = force(x, v, t);
            let (x1, v1) = (x + step * v, v + step * a);
            x += 0.5 * step * (v + v1);
            v += 0.5 * step * (a + force(x1, v1, t + step));
        }
    }
    folder.text(name, &text);
}

fn explained(folder: &Folder, log: &str) -> serde_json::Value {
    let arguments = ["explain", log, "--simulation", "cart.mo"];
    folder
        .run(
            &[
                &arguments[..],
                &["--output", "e.json", "--report", "e.html"],
            ]
            .concat(),
        )
        .ok();
    serde_json::from_str(&std::fs::read_to_string(folder.join("e.json")).unwrap()).unwrap()
}

#[test]
fn a_missing_drag_is_named_in_its_equation_and_can_be_simulated() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    record(&folder, "log.csv", 1.1, |_, v, _| -2.5 * v * v.abs(), 1);
    let said = explained(&folder, "log.csv");
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    let effect = &said["effects"][0];
    assert_eq!(effect["effect"], "quadratic_drag", "{}", said["summary"]);
    assert_eq!(said["effects"].as_array().unwrap().len(), 1);
    assert_eq!(
        (&effect["enters"], &effect["depends"][0]),
        (&"v".into(), &"v".into())
    );
    assert!(
        effect["equation"]
            .as_str()
            .unwrap()
            .starts_with("m*der(v) = u - k*x - d*v")
    );
    let strength = &effect["parameters"]["signed_square_c"];
    let (value, std) = (
        strength["value"].as_f64().unwrap(),
        strength["std"].as_f64().unwrap(),
    );
    assert!(
        (value + 2.5).abs() < 4.0 * std && std < 0.5,
        "{value} +- {std}"
    );
    let law = &effect["law"];
    let (at, curve) = (
        law["at"].as_array().unwrap(),
        law["value"].as_array().unwrap(),
    );
    for (v, f) in at.iter().zip(curve) {
        let v = v.as_f64().unwrap();
        let expected = value * v * v.abs();
        assert!((f.as_f64().unwrap() - expected).abs() < 1e-6 * (1.0 + expected.abs()));
    }
    let mass = said["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .find(|p| p["name"] == "m")
        .unwrap();
    assert!(
        (mass["recording"].as_f64().unwrap() - 1.1).abs() < 4.0 * mass["std"].as_f64().unwrap()
    );
    assert!(
        std::fs::read_to_string(folder.join("e.html"))
            .unwrap()
            .contains("quadratic drag")
    );
    // What was found is simulated, and is a plant like any other.
    record(&folder, "fresh.csv", 1.1, |_, v, _| -2.5 * v * v.abs(), 2);
    folder
        .run(&["simulate", "e.json", "fresh.csv", "--output", "p.csv"])
        .ok();
    let read = |name: &str, column: usize| -> Vec<f64> {
        let text = std::fs::read_to_string(folder.join(name)).unwrap();
        let row = |l: &str| l.split(',').nth(column).unwrap().parse().unwrap();
        text.lines().skip(1).map(row).collect()
    };
    let (predicted, recorded) = (read("p.csv", 1), read("fresh.csv", 2));
    let squares: f64 = predicted
        .iter()
        .zip(&recorded)
        .map(|(a, b)| (a - b).powi(2))
        .sum();
    let rmse = (squares / predicted.len() as f64).sqrt();
    assert!(rmse < 0.006, "{rmse}");
}

#[test]
fn other_parameters_are_no_missing_physics() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    for (mass, verdict) in [(1.0, "consistent"), (1.15, "parameters")] {
        record(&folder, "log.csv", mass, |_, _, _| 0.0, 5);
        let said = explained(&folder, "log.csv");
        assert_eq!(said["verdict"], verdict, "{}", said["summary"]);
        assert!(said["effects"].as_array().unwrap().is_empty());
    }
}

/// The text falls over in free run; the recording was made with another spring, which holds it.
#[test]
fn a_text_that_cannot_be_simulated_is_not_given_a_fit() {
    let folder = Folder::new();
    let falls = CART.replace("min=30, max=50) = 40", "min=-30, max=50) = -20");
    folder.text("cart.mo", &falls);
    record(&folder, "log.csv", 1.0, |_, _, _| 0.0, 5);
    let said = explained(&folder, "log.csv");
    let fit = said["fit"]["train"]["simulation"]["fit_percent"]
        .as_f64()
        .unwrap();
    assert!(fit.abs() < 1e-6, "{fit}");
    let summary = said["summary"].to_string();
    assert!(summary.contains("cannot be simulated"), "{summary}");
}

#[test]
fn what_is_not_available_with_plants_is_said() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    folder.text("other.mo", CART);
    record(&folder, "log.csv", 1.0, |_, _, _| 0.0, 5);
    let arguments = [
        "explain",
        "log.csv",
        "--simulation",
        "cart.mo",
        "--without",
        "cogging",
    ];
    let said = folder.run(&arguments).error();
    assert!(said.contains("--without"), "{said}");
    let said = folder
        .run(&["explain", "log.csv", "--simulation", "cart.mo", "other.mo"])
        .error();
    assert!(said.contains("one plant"), "{said}");
}
