//! Equations that are found again, and what they are good for.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::columns_answer::doubt_below_remainder;
use super::*;
use crate::explain::linear::check::Checked;
use crate::explain::simulation::Simulation;
use crate::explain::{AugmentedPlantError, Explanation, Verdict};
use crate::log::Log;
use crate::physics::{Excitation, Point};

const SAMPLES: usize = 1500;

const PENDULUM: &str =
    "model Pendulum parameter Real d = 0.4; parameter Real k = 9.0; parameter Real c = 0.0;
  input Real u; output Real y; Real phi(start=0.2); Real w(start=0);
equation
  der(phi) = w; der(w) = 3*u - d*w - k*sin(phi) - c*w*abs(w); y = phi;
end Pendulum;";

/// A coil that drives a mass: the current and the position are seen.
const COIL: &str =
    "model Coil input Real u; output Real ic; output Real xl; Real i; Real x; Real v;
equation
  der(i) = 4*u - 3*i - 2*v; der(x) = v; der(v) = 5*i - 8*x - v; ic = i; xl = x;
end Coil;";

/// A level that is held for some samples, and jumps: the same numbers on every machine.
fn steps(every: usize) -> Vec<f64> {
    let mut state = 12_345_u64;
    let mut level = 0.0;
    (0..SAMPLES)
        .map(|k| {
            if k % every == 0 {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                level = (state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0;
            }
            level
        })
        .collect()
}

fn channel(name: &str) -> Channel {
    Channel {
        name: name.to_owned(),
        unit: None,
    }
}

fn run(text: &str, change: impl Fn(&mut Point), u: &[f64], h: f64) -> Vec<Vec<f64>> {
    let plant = Plant::new(parse(text).unwrap());
    let mut point = plant.nominal();
    change(&mut point);
    let excitation = Excitation {
        inputs: &[u],
        length: u.len(),
        sample_time: h,
        start_time: 0.0,
        hold: Hold::Zero,
    };
    plant.simulate(&point, &excitation, None).unwrap().outputs
}

fn found(text: &str, outputs: &[&str], u: &[f64], h: f64) -> Reproduced {
    let columns = [PlantRecording {
        outputs: run(text, |_| {}, u, h),
        inputs: vec![u.to_vec()],
        sample_time: h,
        start_time: 0.0,
    }];
    let spread = |y: &Vec<f64>| {
        let mean = y.iter().sum::<f64>() / y.len() as f64;
        (y.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / y.len() as f64).sqrt()
    };
    // A recording that differs by a twentieth of the outputs.
    let difference: Vec<f64> = columns[0]
        .outputs
        .iter()
        .map(|y| 0.05 * spread(y))
        .collect();
    let question = Question {
        inputs: &[channel("u")],
        outputs: &outputs.iter().map(|n| channel(n)).collect::<Vec<_>>(),
        difference: &difference,
    };
    reproduce(&columns, &question).unwrap()
}

#[test]
fn a_pendulum_is_found_with_its_sine_and_no_more() {
    let found = found(PENDULUM, &["y"], &steps(20), 0.05);
    assert!(found.misfit < REPRODUCED, "{}", found.misfit);
    let text = &found.plant.spec.text;
    assert_eq!(found.plant.spec.states().len(), 2, "{text}");
    assert_eq!(found.plant.spec.parameters().len(), 3, "{text}");
    assert!(text.contains("sin(y_state)"), "{text}");
    // The sensor is outside of the dynamics.
    assert!(text.contains("  y = y_state;"), "{text}");
}

/// A load on a rope, a tank with a valve, a cone, and a vehicle of given power.
#[test]
fn products_of_an_input_with_a_function_of_an_output_are_found() {
    let first_order = |rate: &str| {
        format!(
            "model Store input Real u; output Real y; Real x(start=2); equation der(x) = {rate}; y = x; end Store;"
        )
    };
    let crane = "model Crane input Real u; output Real y; Real x(start=0.3); Real w;
        equation der(x) = w; der(w) = -0.1*w - 8.5*sin(x) - 0.9*u*cos(x); y = x; end Crane;";
    for (text, term) in [
        (crane.to_owned(), "u*cos(y_state)"),
        (
            first_order("0.5 - 0.3*u*sqrt(max(x, 0))"),
            "u*sqrt(max(y_state, 0))",
        ),
        (
            first_order("(0.4*u - 0.3*sqrt(x))/x^2"),
            "u/max(y_state, 1e-9)^2",
        ),
        (first_order("u/max(x, 0.1) - 0.2*x"), "u/max(y_state, 1e-9)"),
    ] {
        let u: Vec<f64> = steps(20).iter().map(|u| 1.2 + 0.8 * u).collect();
        let found = found(&text, &["y"], &u, 0.05);
        let reproduced = &found.plant.spec.text;
        assert!(found.misfit < REPRODUCED, "{}: {reproduced}", found.misfit);
        assert!(reproduced.contains(term), "{term}: {reproduced}");
    }
}

#[test]
fn of_equivalent_orders_those_with_the_fewest_terms_are_taken() {
    let found = found(COIL, &["ic", "xl"], &steps(20), 0.05);
    let text = &found.plant.spec.text;
    // As in the original: three terms in the equation of the current, three in that of the speed.
    assert_eq!(found.plant.spec.parameters().len(), 6, "{text}");
    assert!(text.contains("ic = ic_state"), "{text}");
}

/// Two rooms with a wall between them: what passes through it is one flow with one strength.
#[test]
fn what_two_outputs_exchange_has_one_strength() {
    let rooms = "model Rooms input Real u; output Real a; output Real b; Real x(start=1); Real z(start=0.5);
equation
  der(x) = 0.5*u - 0.2*u*x - 0.3*(x - z); der(z) = 0.2*(x - z) - 0.1*z; a = x; b = z; end Rooms;";
    let u: Vec<f64> = steps(20).iter().map(|u| 1.2 + 0.8 * u).collect();
    let found = found(rooms, &["a", "b"], &u, 0.2);
    let text = &found.plant.spec.text;
    assert!(found.misfit < REPRODUCED, "{}: {text}", found.misfit);
    let value = |name: &str| -> f64 {
        let of = format!("parameter Real {name} = ");
        let value = text.split(&of).nth(1).and_then(|t| t.split(' ').next());
        value.and_then(|v| v.parse().ok()).unwrap_or(f64::NAN)
    };
    let equation = |left: &str| {
        let lines = text.lines().map(str::trim);
        lines
            .clone()
            .find_map(|l| l.trim_end_matches(';').strip_prefix(left))
            .unwrap_or("")
    };
    let exchange = equation("exchange1 = ");
    let strength = value(exchange.split('*').next().unwrap());
    assert!((strength - 0.3).abs() < 1e-3, "{text}");
    // Nothing of the first room is beside it; the second loses heat to the outside.
    assert!(exchange.ends_with("*(b_state - a_state)"), "{text}");
    let first = equation("der(a_state) = ");
    assert!(first.contains("exchange1 + "), "{text}");
    assert_eq!(first.matches("a_state").count(), 1, "{text}");
    let second = equation("der(b_state) = ");
    let ratio = second.split("*exchange1").next().unwrap();
    let ratio = value(ratio.rsplit(' ').next().unwrap());
    assert!((ratio + 2.0 / 3.0).abs() < 3e-3, "{text}");
}

fn log(u: &[f64], outputs: Vec<Vec<f64>>, sample_time: f64) -> Log {
    Log {
        name: "log".to_owned(),
        sample_time,
        start_time: 0.0,
        inputs: vec![channel("u")],
        outputs: vec![channel("y")],
        input_data: vec![u.to_vec()],
        output_data: outputs,
        sha256: None,
    }
}

/// A recording of a pendulum that differs from its simulation by a parameter, and the simulation.
fn differing(change: &dyn Fn(&mut Point)) -> (Log, Log) {
    let (u, h) = (steps(25), 0.05);
    let mut recorded = log(&u, run(PENDULUM, change, &u, h), h);
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for y in &mut recorded.output_data[0] {
        *y += 0.003 * random.sample::<f64, _>(StandardNormal);
    }
    (recorded, log(&u, run(PENDULUM, |_| {}, &u, h), h))
}

fn answer(change: &dyn Fn(&mut Point)) -> Explanation {
    let (recorded, simulated) = differing(change);
    let known = Simulation::Outputs(vec![simulated]);
    let checked = Checked::new(&[recorded], &known, &|_| true);
    explain_equations(&equations(&checked).unwrap(), &checked, &[]).unwrap()
}

/// Of a pendulum with a drag that the simulation leaves out.
pub(crate) fn drag() -> Explanation {
    answer(&|p| p.parameters[2] = 0.3)
}

#[test]
fn what_acts_in_the_recording_is_named_and_a_changed_parameter_is_not() {
    let drag = drag();
    assert_eq!(drag.verdict, Verdict::Named, "{:?}", drag.summary);
    assert_eq!(drag.effects[0].effect, "quadratic_drag");
    let plant = drag.plant.unwrap();
    assert!(plant.simulation.unwrap().contains("sin(y_state)"));
    let softer = answer(&|p| p.parameters[1] = 8.0);
    assert_eq!(softer.verdict, Verdict::Parameters, "{:?}", softer.summary);
}

#[test]
fn a_name_that_explains_less_than_the_equations_miss_is_taken_back() {
    let (recorded, simulated) = differing(&|p| p.parameters[2] = 0.3);
    let known = Simulation::Outputs(vec![simulated]);
    let checked = Checked::new(&[recorded], &known, &|_| true);
    let mut found = equations(&checked).unwrap();
    let named = explain_equations(&found, &checked, &[]).unwrap();
    let steps = &named.fit.train;
    let (left, kept) = (steps.parameters_only.rmse, steps.augmented.rmse);
    let mut judged = |missed: f64| {
        found.remainder = vec![vec![missed; SAMPLES]];
        let mut explanation = named.clone();
        doubt_below_remainder(&mut explanation, &found, &checked);
        explanation.verdict
    };
    assert_eq!(judged(0.5 * left), Verdict::Named);
    // More than was explained, and less than other parameters leave.
    assert_eq!(
        judged((left * left - 0.5 * kept * kept).sqrt()),
        Verdict::Unexplained
    );
    assert_eq!(judged(2.0 * left), Verdict::Parameters);
}

/// A recording with a sensor that lags behind a pendulum by 0.12 s.
fn lagging() -> (Log, Log) {
    let slow = PENDULUM.replace("c = 0.0;", "c = 0.12; Real s(start=0.2);");
    let slow = slow
        .replace("- c*w*abs(w)", "")
        .replace("y = phi", "c*der(s) = phi - s; y = s");
    let (u, h) = (steps(25), 0.05);
    let mut recorded = log(&u, run(&slow, |_| {}, &u, h), h);
    let mut random = ChaCha8Rng::seed_from_u64(2);
    for y in &mut recorded.output_data[0] {
        *y += 0.003 * random.sample::<f64, _>(StandardNormal);
    }
    (recorded, log(&u, run(PENDULUM, |_| {}, &u, h), h))
}

#[test]
fn a_sensor_is_named_without_equations_of_what_it_measures() {
    let (recorded, simulated) = lagging();
    let known = Simulation::Outputs(vec![simulated.clone()]);
    let checked = Checked::new(std::slice::from_ref(&recorded), &known, &|_| true);
    let found = explain_sensors(&checked, &[]).unwrap();
    assert_eq!(found.effects[0].effect, "sensor_lag", "{:?}", found.summary);
    let tau = found.effects[0].parameters.values().next().unwrap();
    assert!((tau.value - 0.12).abs() < 4.0 * tau.std.unwrap(), "{tau:?}");

    // It runs beside the simulator only.
    let plant = found.plant.unwrap();
    assert_eq!(plant.simulated_inputs, ["y_simulated"]);
    assert!(matches!(
        plant.simulate(&recorded, None),
        Err(AugmentedPlantError::NeedsSimulation { .. })
    ));
    let short = vec![simulated.output_data[0][1..].to_vec()];
    assert!(matches!(
        plant.simulate(&recorded, Some(&short)),
        Err(AugmentedPlantError::Simulation {
            needed: 1,
            found: 0
        })
    ));
    let error = |y: &[Vec<f64>]| {
        let pairs = y[0].iter().zip(&recorded.output_data[0]);
        pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    };
    let run = plant
        .simulate(&recorded, Some(&simulated.output_data))
        .unwrap();
    assert!(error(&run) < 0.1 * error(&simulated.output_data));
}

#[test]
fn what_acts_inside_is_no_sensor() {
    let (recorded, simulated) = differing(&|p| p.parameters[2] = 0.3);
    let known = Simulation::Outputs(vec![simulated]);
    let checked = Checked::new(&[recorded], &known, &|_| true);
    let sensors = explain_sensors(&checked, &[]);
    assert!(sensors.is_none(), "{:?}", sensors.map(|s| s.summary));
}
