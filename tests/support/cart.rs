//! A cart on a spring, its recordings by an integrator of its own, and what is said of them.

#![allow(dead_code, reason = "not every test file uses all of it")]

use std::fmt::Write;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::folder::{Folder, json};

/// A cart on a spring, driven by a force.
pub const CART: &str = r#"model Cart "cart on a spring"
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
pub fn record(
    folder: &Folder,
    name: &str,
    mass: f64,
    extra: impl Fn(f64, f64, f64) -> f64,
    seed: u64,
) {
    record_with_input(folder, name, mass, |_, x, v, t| extra(x, v, t), seed);
}

/// The same with a force that depends on the input as well.
pub fn record_with_input(
    folder: &Folder,
    name: &str,
    mass: f64,
    extra: impl Fn(f64, f64, f64, f64) -> f64,
    seed: u64,
) {
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
            let force =
                |x: f64, v: f64, t: f64| (u - 40.0 * x - 1.0 * v + extra(u, x, v, t)) / mass;
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

pub fn explained(folder: &Folder, log: &str) -> serde_json::Value {
    explained_with(folder, log, &[])
}

pub fn explained_with(folder: &Folder, log: &str, more: &[&str]) -> serde_json::Value {
    let arguments = ["explain", log, "--simulation", "cart.mo"];
    folder
        .run(
            &[
                &arguments[..],
                &["--output", "e.json", "--report", "e.html"],
                more,
            ]
            .concat(),
        )
        .ok();
    json(&folder.join("e.json"))
}
