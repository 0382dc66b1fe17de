//! Plants in equations against closed solutions, differences, and answers of another integrator.

use std::path::{Path, PathBuf};

use innovant::log::{Channel, Log, RoleNeed, Roles, Source};
use innovant::physics::{
    Direction, Excitation, Hold, Observer, Plant, Point, SimulationError, parse,
};
use nalgebra::DMatrix;

fn plant(text: &str) -> Plant {
    Plant::new(parse(text).unwrap_or_else(|e| panic!("{}", e.render("plant.mo", text))))
}

/// A recorded-like input: steps and a sine.
fn signal(samples: usize, size: f64) -> Vec<f64> {
    let step = |k: usize| {
        if (k / 37).is_multiple_of(2) {
            1.0
        } else {
            -0.6
        }
    };
    (0..samples)
        .map(|k| size * (step(k) + 0.4 * (0.11 * k as f64).sin()))
        .collect()
}

fn excitation<'a>(
    inputs: &'a [&'a [f64]],
    length: usize,
    sample_time: f64,
    hold: Hold,
) -> Excitation<'a> {
    Excitation {
        inputs,
        length,
        sample_time,
        start_time: 0.0,
        hold,
    }
}

/// Largest difference of sensitivities and central differences, relative to the norm of the differences.
fn slope_error(
    plant: &Plant,
    excitation: &Excitation,
    observer: Option<&Observer>,
    at: &Point,
    step: f64,
) -> f64 {
    let run = plant.simulate(at, excitation, observer).unwrap();
    let states = plant.spec.states().len();
    let mut directions: Vec<Direction> =
        (0..at.parameters.len()).map(Direction::Parameter).collect();
    directions.extend((0..states).map(Direction::Start));
    let slopes = plant.sensitivities(at, excitation, observer, &run.plan, &directions);
    let start = plant.start(at);
    let mut worst: f64 = 0.0;
    for (d, direction) in directions.iter().enumerate() {
        let moved = |sign: f64| {
            let mut point = at.clone();
            let width = match *direction {
                Direction::Parameter(i) => {
                    let width = step * at.parameters[i].abs().max(1e-6);
                    point.parameters[i] += sign * width;
                    width
                }
                Direction::Start(i) => {
                    let width = step * start[i].abs().max(0.1);
                    point.start[i] = Some(start[i] + sign * width);
                    width
                }
                Direction::Gain(..) => unreachable!("no gain is asked for"),
            };
            (
                plant
                    .simulate_as(&point, excitation, observer, &run.plan)
                    .unwrap()
                    .outputs,
                width,
            )
        };
        let ((high, width), (low, _)) = (moved(1.0), moved(-1.0));
        for output in 0..high.len() {
            let differences = high[output]
                .iter()
                .zip(&low[output])
                .map(|(h, l)| (h - l) / (2.0 * width));
            let (mut error, mut norm) = (0.0, 0.0);
            for (difference, slope) in differences.zip(&slopes[output][d]) {
                error += (difference - slope).powi(2);
                norm += difference * difference;
            }
            if norm > 1e-12 {
                worst = worst.max((error / norm).sqrt());
            }
        }
    }
    worst
}

const PENDULUM: &str = "model Pendulum
  parameter Real m(unit=\"kg\", min=0.1, max=1) = 0.5;
  parameter Real d(unit=\"N.m.s/rad\") = 0.05;
  final parameter Real l(unit=\"m\") = 0.4;
  input Real u(unit=\"N.m\");
  output Real y(unit=\"rad\");
  Real phi(unit=\"rad\", start=0.3);
  Real w(unit=\"rad/s\", start=0);
equation
  der(phi) = w;
  m*l^2*der(w) = u - d*w - m*Modelica.Constants.g_n*l*sin(phi);
  y = phi;
end Pendulum;";

#[test]
fn smooth_sensitivities_are_those_of_differences() {
    let plant = plant(PENDULUM);
    let u = signal(400, 0.5);
    let inputs = [u.as_slice()];
    for hold in [Hold::Zero, Hold::Linear] {
        let excitation = excitation(&inputs, 400, 0.02, hold);
        let error = slope_error(&plant, &excitation, None, &plant.nominal(), 1e-4);
        assert!(error < 1e-5, "{hold:?}: {error}");
    }
}

#[test]
fn an_observer_has_sensitivities_too() {
    let plant = plant(PENDULUM);
    let u = signal(300, 0.5);
    let inputs = [u.as_slice()];
    let excitation = excitation(&inputs, 300, 0.02, Hold::Zero);
    let recorded: Vec<f64> = (0..300).map(|k| 0.5 * (0.07 * k as f64).sin()).collect();
    let recorded = [recorded.as_slice()];
    let gain = DMatrix::from_row_slice(2, 1, &[0.3, 0.8]);
    let observer = Observer {
        gain: &gain,
        recorded: &recorded,
    };
    let error = slope_error(&plant, &excitation, Some(&observer), &plant.nominal(), 1e-4);
    assert!(error < 1e-5, "{error}");
    let run = plant
        .simulate(&plant.nominal(), &excitation, Some(&observer))
        .unwrap();
    let slopes = plant.sensitivities(
        &plant.nominal(),
        &excitation,
        Some(&observer),
        &run.plan,
        &[Direction::Gain(1, 0)],
    );
    let with = |g: f64| {
        let gain = DMatrix::from_row_slice(2, 1, &[0.3, g]);
        let observer = Observer {
            gain: &gain,
            recorded: &recorded,
        };
        plant
            .simulate(&plant.nominal(), &excitation, Some(&observer))
            .unwrap()
            .outputs
            .remove(0)
    };
    for ((h, l), s) in with(0.8001).iter().zip(with(0.7999)).zip(&slopes[0][0]) {
        assert!(((h - l) / 2e-4 - s).abs() < 1e-5, "{} {s}", (h - l) / 2e-4);
    }
}

/// A mass that slides and stops: `v = v0 - (f/m) t` until `t = v0 m/f`, then rest. Position at rest `m v0^2/(2 f)`.
#[test]
fn dry_friction_stops_and_sticks() {
    let plant = plant(
        "model Slide parameter Real m = 2; parameter Real f = 3; output Real y; Real x(start=0); Real v(start=1.7);
         equation der(x) = v; m*der(v) = -f*sign(v); y = x; end Slide;",
    );
    let excitation = excitation(&[], 200, 0.01, Hold::Zero);
    let point = plant.nominal();
    let run = plant.simulate(&point, &excitation, None).unwrap();
    let rest = 2.0 * 1.7 * 1.7 / (2.0 * 3.0);
    let (stop, y) = (1.7 * 2.0 / 3.0, &run.outputs[0]);
    for (k, y) in y.iter().enumerate() {
        let t = 0.01 * k as f64;
        let truth = if t < stop {
            1.7 * t - 0.75 * t * t
        } else {
            rest
        };
        assert!((y - truth).abs() < 1e-5 * rest, "{t}: {y} {truth}");
    }
    // The time of the stop depends on all of them: d rest/dm = v0^2/(2f), /df = -m v0^2/(2f^2), /dv0 = m v0/f.
    let directions = [
        Direction::Parameter(0),
        Direction::Parameter(1),
        Direction::Start(1),
    ];
    let slopes = plant.sensitivities(&point, &excitation, None, &run.plan, &directions);
    for (found, truth) in
        slopes[0]
            .iter()
            .zip([1.7 * 1.7 / 6.0, -2.0 * 1.7 * 1.7 / 18.0, 2.0 * 1.7 / 3.0])
    {
        assert!(
            (found[199] / truth - 1.0).abs() < 1e-3,
            "{} {truth}",
            found[199]
        );
    }
}

#[test]
fn friction_that_reverses_has_the_sensitivities_of_differences() {
    let plant = plant(
        "model Drive parameter Real J = 0.02; parameter Real d = 0.05; parameter Real c = 0.3; input Real u; output Real y;
         Real w(start=0.2); equation J*der(w) = u - d*w - c*sign(w); y = w; end Drive;",
    );
    let u: Vec<f64> = (0..300).map(|k| 1.1 * (0.13 * k as f64).sin()).collect();
    let inputs = [u.as_slice()];
    let excitation = excitation(&inputs, 300, 0.01, Hold::Zero);
    let error = slope_error(&plant, &excitation, None, &plant.nominal(), 1e-4);
    assert!(error < 3e-2, "{error}");
}

/// `T x' = u(t - L) - x` from rest, a step: `1 - exp(-(t - L)/T)`, where `L` is no multiple of the sample time.
#[test]
fn delays_of_inputs_are_exact_between_samples() {
    let plant = plant(
        "model Lag parameter Real T = 0.7; parameter Real L = 0.1234; input Real u; output Real y; Real x(start=0);
         equation T*der(x) = delay(u, L) - x; y = x; end Lag;",
    );
    let u: Vec<f64> = (0..100).map(|k| f64::from(k >= 10)).collect();
    let inputs = [u.as_slice()];
    let excitation = excitation(&inputs, 100, 0.05, Hold::Zero);
    let run = plant.simulate(&plant.nominal(), &excitation, None).unwrap();
    let slopes = plant.sensitivities(
        &plant.nominal(),
        &excitation,
        None,
        &run.plan,
        &[Direction::Parameter(1)],
    );
    for (k, (found, found_slope)) in run.outputs[0].iter().zip(&slopes[0][0]).enumerate() {
        let t = 0.05 * k as f64 - 0.5 - 0.1234;
        let (truth, slope) = if t > 0.0 {
            (1.0 - (-t / 0.7).exp(), -(-t / 0.7).exp() / 0.7)
        } else {
            (0.0, 0.0)
        };
        assert!((found - truth).abs() < 1e-7, "{k}: {} {truth}", found);
        assert!(
            (found_slope - slope).abs() < 1e-6,
            "{k}: {} {slope}",
            found_slope
        );
    }
}

/// `x' = -x(t - 1)` from `x = 1`: `1 - t` in the first second, `1 - t + (t - 1)^2/2` in the second.
/// Slopes by delays against differences, from whole samples (where most searches start), parts of them, and equal ones.
#[test]
fn delays_have_slopes_wherever_a_search_starts() {
    let plant = plant(
        "model Lag parameter Real T(min=0)=0.13; parameter Real S(min=0)=0.13; input Real u; input Real v; output Real y;
         Real x(start=0); equation der(x) = delay(u, T) + 0.5*delay(v, S) - x^3 - x; y = x; end Lag;",
    );
    let u = signal(120, 1.0);
    let v: Vec<f64> = u.iter().rev().copied().collect();
    let inputs = [u.as_slice(), v.as_slice()];
    let excitation = excitation(&inputs, 120, 0.1, Hold::Zero);
    let directions = [Direction::Parameter(0), Direction::Parameter(1)];
    for delays in [
        [0.0, 0.0],
        [0.1, 0.1],
        [0.3, 0.3],
        [0.13, 0.13],
        [0.7, 0.26],
    ] {
        let mut point = plant.nominal();
        point.parameters = delays.to_vec();
        let run = plant.simulate(&point, &excitation, None).unwrap();
        let slopes = plant.sensitivities(&point, &excitation, None, &run.plan, &directions);
        for (which, slope) in slopes[0].iter().enumerate() {
            let step = 1e-4;
            let mut moved = point.clone();
            moved.parameters[which] += step;
            let later = plant.simulate(&moved, &excitation, None).unwrap();
            let (mut error, mut size) = (0.0, 0.0);
            for ((after, before), slope) in later.outputs[0].iter().zip(&run.outputs[0]).zip(slope)
            {
                let difference = (after - before) / step;
                error += (difference - slope).powi(2);
                size += difference.powi(2);
            }
            assert!(
                size > 0.1 && error < 1e-4 * size,
                "{delays:?}, {which}: {error} of {size}"
            );
        }
    }
}

#[test]
fn states_may_be_delayed() {
    let plant = plant(
        "model Past output Real y; Real x(start=1); equation der(x) = -delay(x, 1); y = x; end Past;",
    );
    let run = plant
        .simulate(
            &plant.nominal(),
            &excitation(&[], 41, 0.05, Hold::Zero),
            None,
        )
        .unwrap();
    for (k, y) in run.outputs[0].iter().enumerate() {
        let t = 0.05 * k as f64;
        let truth = if t < 1.0 {
            1.0 - t
        } else {
            1.0 - t + 0.5 * (t - 1.0).powi(2)
        };
        assert!((y - truth).abs() < 1e-5, "{t}: {y} {truth}");
    }
}

/// Robertson's reaction: rates of 0.04, 1e4 and 3e7. Reference at t = 40 from Hairer and Wanner, section IV.1.
#[test]
fn stiff_plants_take_the_implicit_method() {
    let plant = plant(
        "model Robertson output Real a; Real x(start=1); Real y(start=0); Real z(start=0);
         equation der(x) = -0.04*x + 1e4*y*z; der(y) = 0.04*x - 1e4*y*z - 3e7*y^2; der(z) = 3e7*y^2; a = x; end Robertson;",
    );
    let run = plant
        .simulate(
            &plant.nominal(),
            &excitation(&[], 41, 1.0, Hold::Zero),
            None,
        )
        .unwrap();
    assert!(
        (run.outputs[0][40] - 0.715_826_87).abs() < 1e-6,
        "{}",
        run.outputs[0][40]
    );
    assert!(run.plan.implicit_steps() > run.plan.steps() / 2);
    // The explicit method alone would be unstable in steps longer than 1/700 s: 28 000 steps.
    assert!(run.plan.steps() < 4000, "{}", run.plan.steps());
}

#[test]
fn what_has_no_value_is_said_with_time_expression_and_values() {
    let plant = plant(
        "model Tank\n  output Real y;\n  Real h(start=0.5);\nequation\n  der(h) = -0.3 - 0.1*sqrt(h);\n  y = h;\nend Tank;",
    );
    let error = plant
        .simulate(
            &plant.nominal(),
            &excitation(&[], 100, 0.1, Hold::Zero),
            None,
        )
        .unwrap_err();
    let SimulationError::NotANumber {
        time,
        expression,
        line,
        values,
    } = &error
    else {
        panic!("{error}")
    };
    assert!((1.2..1.6).contains(time), "{time}");
    assert_eq!((expression.as_str(), *line), ("sqrt(h)", 5));
    assert!(values[0].0 == "h" && values[0].1 < 0.0, "{values:?}");

    let unstable = self::plant(
        "model Up output Real y; Real x(start=1); equation der(x) = 3*x; y = x; end Up;",
    );
    let error = unstable
        .simulate(
            &unstable.nominal(),
            &excitation(&[], 200, 0.1, Hold::Zero),
            None,
        )
        .unwrap_err();
    assert!(
        matches!(&error, SimulationError::Diverged { state, .. } if state == "x"),
        "{error}"
    );
}

#[test]
fn linearisation_and_equilibrium() {
    let plant = plant(PENDULUM);
    let point = plant.nominal();
    let up = plant.equilibrium(&point, &[3.0, 0.0], &[0.0]).unwrap();
    assert!((up[0] - std::f64::consts::PI).abs() < 1e-9, "{up:?}");
    let linear = plant.linearise(&point, &up, &[0.0], 0.0);
    let inertia = 0.5 * 0.16;
    let expected = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 9.80665 / 0.4, -0.05 / inertia]);
    assert!((&linear.a - expected).amax() < 1e-8, "{}", linear.a);
    assert!((linear.b[(1, 0)] - 1.0 / inertia).abs() < 1e-9);
}

#[test]
fn a_run_that_needs_far_more_steps_than_another_is_given_up() {
    let plant = plant(
        "model Spring parameter Real k = 1; output Real x(start=1); Real v; equation der(x) = v; der(v) = -k*x^3; end Spring;",
    );
    let excitation = excitation(&[], 100, 0.1, Hold::Zero);
    let mut point = plant.nominal();
    let soft = plant.simulate(&point, &excitation, None).unwrap();
    point.parameters[0] = 100.0;
    plant
        .simulate_as(&point, &excitation, None, &soft.plan)
        .unwrap();
    point.parameters[0] = 1e16;
    let error = plant
        .simulate_as(&point, &excitation, None, &soft.plan)
        .unwrap_err();
    let SimulationError::TooFast { steps, samples, .. } = error else {
        panic!("{error}")
    };
    assert!(steps >= 10_000 && samples == 1, "{error}");
}

fn shared() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/physics/dev");
    path.is_dir().then_some(path)
}

fn columns(path: &Path, need: RoleNeed, inputs: &[Channel], outputs: &[Channel]) -> Log {
    let roles = Roles::named(inputs, outputs);
    Log::read_with(&Source::from(path.to_owned()), &roles, need).unwrap()
}

/// 64 recordings of eight kinds of plants, simulated by another integrator: each to 1e-6 of its range, and what was rounded away
/// when it was written.
#[test]
fn simulations_of_another_integrator_are_reproduced() {
    let Some(folder) = shared() else { return };
    let mut cases: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    cases.retain(|c| c.join("simulator.mo").is_file());
    assert!(cases.len() >= 64, "{}", cases.len());
    for case in cases {
        let plant = plant(&std::fs::read_to_string(case.join("simulator.mo")).unwrap());
        let named = |ids: Vec<_>| -> Vec<Channel> {
            ids.into_iter()
                .map(|v| Channel::new(plant.spec.variable(v).column()))
                .collect()
        };
        let (inputs, outputs) = (named(plant.spec.inputs()), named(plant.spec.outputs()));
        for (input, answer) in [
            ("recording.csv", "simulation.csv"),
            ("fresh_input.csv", "fresh_simulation.csv"),
        ] {
            let log = columns(&case.join(input), RoleNeed::InputsOnly, &inputs, &outputs);
            let reference = columns(&case.join(answer), RoleNeed::OutputsOnly, &inputs, &outputs);
            let given: Vec<&[f64]> = log.input_data.iter().map(Vec::as_slice).collect();
            let excitation = Excitation {
                inputs: &given,
                length: log.samples(),
                sample_time: log.sample_time,
                start_time: log.start_time,
                hold: Hold::Zero,
            };
            let run = plant.simulate(&plant.nominal(), &excitation, None).unwrap();
            for (found, truth) in run.outputs.iter().zip(&reference.output_data) {
                let (low, high) = truth
                    .iter()
                    .fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(*v), h.max(*v)));
                let allowed = 1e-6 * (high - low) + 5e-7 * high.abs().max(low.abs());
                for (k, (f, t)) in found.iter().zip(truth).enumerate() {
                    assert!(
                        (f - t).abs() <= allowed,
                        "{} {answer} sample {k}: {f} {t}",
                        case.display()
                    );
                }
            }
        }
    }
}

/// Two inertias on a shaft, driven by a current that settles within a hundredth of a sample; it turns on without end.
const LINEAR: &str = "model Drive
  parameter Real J = 0.02; parameter Real I = 0.05; parameter Real k = 30; parameter Real d = 0.02; parameter Real L = 1e-5;
  input Real u; output Real y; output Real z = w*w;
  Real i; Real w(start = 1); Real v; Real twist(start = 0.01); Real angle;
  Real torque = k*twist + d*(w - v);
equation
  L*der(i) = u - i + 0.3; J*der(w) = 0.5*i - torque - 0.1*w; I*der(v) = torque EXTRA; der(twist) = w - v; der(angle) = v;
  y = angle;
end Drive;";

#[test]
fn linear_plants_go_by_matrices() {
    let linear = plant(&LINEAR.replace("EXTRA", ""));
    let (samples, h) = (300, 0.02);
    let u = signal(samples, 2.0);
    // The states, the inputs at the sample and their change in it, and 1.
    let (j, i, k, d, l) = (0.02, 0.05, 30.0, 0.02, 1e-5);
    #[rustfmt::skip]
    let matrix = DMatrix::from_row_slice(8, 8, &[
        -1.0 / l, 0.0, 0.0, 0.0, 0.0, 1.0 / l, 0.0, 0.3 / l,
        0.5 / j, (-d - 0.1) / j, d / j, -k / j, 0.0, 0.0, 0.0, 0.0,
        0.0, d / i, -d / i, k / i, 0.0, 0.0, 0.0, 0.0,
        0.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0 / h, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ]);
    let step = (matrix * h).exp();
    for hold in [Hold::Zero, Hold::Linear] {
        let run = linear
            .simulate(
                &linear.nominal(),
                &excitation(&[&u], samples, h, hold),
                None,
            )
            .unwrap();
        assert_eq!(run.plan.steps(), 0);
        let mut x = DMatrix::from_column_slice(8, 1, &[0.0, 1.0, 0.0, 0.01, 0.0, 0.0, 0.0, 1.0]);
        let range = run.outputs[0].iter().fold(0.0f64, |m, y| m.max(y.abs()));
        for (k, &input) in u.iter().enumerate() {
            assert!(
                (run.outputs[0][k] - x[4]).abs() < 1e-10 * range,
                "{hold:?} {k}"
            );
            let speed = x[1];
            assert!(
                (run.outputs[1][k] - speed * speed).abs() < 1e-9,
                "{hold:?} {k}"
            );
            let next = u[(k + 1).min(samples - 1)];
            x[5] = input;
            x[6] = if hold == Hold::Linear {
                next - input
            } else {
                0.0
            };
            x = &step * x;
        }
        let slopes = slope_error(
            &linear,
            &excitation(&[&u], samples, h, hold),
            None,
            &linear.nominal(),
            1e-5,
        );
        // The start of the current moves the angle so little that differences see it to 1e-4.
        assert!(slopes < 3e-4, "{hold:?} {slopes}");
    }
    // A term that is not linear takes the steps, and agrees where it is nothing.
    let general = plant(&LINEAR.replace("EXTRA", "+ 0*w*w"));
    let inputs: [&[f64]; 1] = [&u];
    let e = excitation(&inputs, samples, h, Hold::Linear);
    let (a, b) = (
        linear.simulate(&linear.nominal(), &e, None).unwrap(),
        general.simulate(&general.nominal(), &e, None).unwrap(),
    );
    assert!(b.plan.steps() > 0);
    let range = a.outputs[0].iter().fold(0.0f64, |m, y| m.max(y.abs()));
    for (a, b) in a.outputs[0].iter().zip(&b.outputs[0]) {
        assert!((a - b).abs() < 1e-6 * range);
    }
}

#[test]
fn held_inputs_may_enter_a_linear_plant_in_any_way() {
    let plant = plant(
        "model H parameter Real a = 2; parameter Real b = 3; input Real u; output Real y; Real x;
         equation der(x) = -a*x + b*u*abs(u) + sign(u - 0.2); y = x; end H;",
    );
    let u = signal(100, 1.0);
    let run = |hold| {
        plant
            .simulate(&plant.nominal(), &excitation(&[&u], 100, 0.1, hold), None)
            .unwrap()
    };
    assert_eq!(run(Hold::Zero).plan.steps(), 0);
    assert!(run(Hold::Linear).plan.steps() > 0);
    let mut x = 0.0;
    let pass = (-0.2f64).exp();
    for (u, y) in u.iter().zip(&run(Hold::Zero).outputs[0]) {
        assert!((x - y).abs() < 1e-12);
        let inflow = 3.0 * u * u.abs() + if *u > 0.2 { 1.0 } else { -1.0 };
        x = pass * x + (1.0 - pass) / 2.0 * inflow;
    }
}
