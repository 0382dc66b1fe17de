//! Steps at the accuracy of a search, where what is not resolved shows in the sensitivities first.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Direction, Excitation, Hold, Plant};
use crate::physics::parse;

/// One input, held from sample to sample.
fn held<'a>(inputs: &'a [&'a [f64]], sample_time: f64) -> Excitation<'a> {
    Excitation {
        inputs,
        length: inputs[0].len(),
        sample_time,
        start_time: 0.0,
        hold: Hold::Zero,
    }
}

#[test]
fn sensitivities_stay_bounded_where_friction_holds() {
    let text = "model M parameter Real J = 0.02; parameter Real d = 0.05; parameter Real c = 0.3; input Real u; output Real y;
         Real w(start=0); equation J*der(w) = u - d*w - c*sign(w); y = w; end M;";
    let plant = Plant::new(parse(text).expect("a plant")).with_accuracy(1e-7);
    let directions: Vec<Direction> = (0..3).map(Direction::Parameter).collect();
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for draw in 0..200 {
        // Pushes beyond the friction and below it, a little different at each sample: it slides, slows down, and is held.
        let mut push = 0.0;
        let u: Vec<f64> = (0..600)
            .map(|k| {
                if k % 20 == 0 {
                    push = 1.4 * random.random::<f64>() - 0.7;
                }
                push + 0.1 * (random.random::<f64>() - 0.5)
            })
            .collect();
        let inputs: [&[f64]; 1] = [&u];
        let excitation = held(&inputs, 0.02);
        let point = plant.nominal();
        let run = plant.simulate(&point, &excitation, None).expect("a run");
        let slopes = plant.sensitivities(&point, &excitation, None, &run.plan, &directions);
        let largest = slopes[0]
            .iter()
            .flatten()
            .fold(0.0f64, |m, s| m.max(s.abs()));
        // A push of 0.7 on J for one time constant J/d: dw/dJ stays below 0.7/d/J.
        assert!(largest < 0.7 / 0.05 / 0.02, "draw {draw}: {largest:e}");
    }
}

/// No stage of a step shows the fast mode of `z`, which stays 0 to the last bit; its sensitivity to `p` does not.
#[test]
fn modes_at_rest_limit_the_step() {
    let text = "model R parameter Real p = 0; input Real u; output Real y; Real x(start=0); Real z(start=0);
         equation der(x) = u - x; der(z) = p - 400*z*(1 + x^2); y = x + z; end R;";
    let plant = Plant::new(parse(text).expect("a plant"));
    let u: Vec<f64> = (0..400).map(|k| f64::from(u8::from(k % 40 < 20))).collect();
    let inputs: [&[f64]; 1] = [&u];
    let excitation = held(&inputs, 0.02);
    let (point, directions) = (plant.nominal(), [Direction::Parameter(0)]);
    let run = plant.simulate(&point, &excitation, None).expect("a run");
    let slopes = plant.sensitivities(&point, &excitation, None, &run.plan, &directions);
    for (k, slope) in slopes[0][0].iter().enumerate().skip(1) {
        let x = run.states[0][k];
        // At rest `p = 400 z (1 + x^2)`.
        let rest = 1.0 / (400.0 * (1.0 + x * x));
        assert!((slope - rest).abs() < 0.02 * rest, "{k}: {slope} {rest}");
    }
}

#[test]
fn a_plant_without_states_is_simulated() {
    let text =
        "model G parameter Real k = 2; input Real u; output Real y; equation y = k*u; end G;";
    let plant = Plant::new(parse(text).expect("a plant"));
    for hold in [Hold::Zero, Hold::Linear] {
        let excitation = Excitation {
            inputs: &[&[1.0, -0.5, 3.0]],
            length: 3,
            sample_time: 0.1,
            start_time: 0.0,
            hold,
        };
        let run = plant
            .simulate(&plant.nominal(), &excitation, None)
            .expect("a run");
        assert_eq!(run.outputs, [[2.0, -1.0, 6.0]]);
    }
}

#[test]
fn states_of_any_size_are_no_divergence_and_have_scales_of_their_own() {
    let text = "model E parameter Real q = 0.5; input Real u; output Real T(start=40); output Real p(start=3e9);
         equation der(T) = u*(20 - T) + q; der(p) = 0.02*(2e9 - p) + 4e7*u; end E;";
    let plant = Plant::new(parse(text).expect("a plant"));
    let (point, start) = (plant.nominal(), [40.0, 3e9]);
    // Without flow the temperature rises for ever, however slowly beside the pressure.
    assert_eq!(plant.equilibrium(&point, &start, &[0.0]), None);
    let rest = plant
        .equilibrium(&point, &start, &[0.5])
        .expect("an equilibrium");
    assert!(
        (rest[0] - 21.0).abs() < 1e-6 && (rest[1] - 3e9).abs() < 1.0,
        "{rest:?}"
    );
    let flow = [0.5; 400];
    let inputs: [&[f64]; 1] = [&flow];
    let excitation = held(&inputs, 2.0);
    let run = plant.simulate(&point, &excitation, None).expect("a run");
    assert!((run.outputs[0][399] - 21.0).abs() < 1e-6);
}

/// A tank behind a valve with play `g` and one that sticks until `S`.
const VALVES: &str = "model M parameter Real g = 0.2; parameter Real S = 0.3; parameter Real c = 0.5; input Real u; output Real y;
     output Real stuck; Real p(start=0.1); Real q(start=0.15); Real h(start=0.4);
     equation p = min(max(pre(p), u - g), u + g); q = if abs(u - pre(q)) > S then u else pre(q);
     der(h) = p + q - c*h; y = h; stuck = q; end M;";

#[test]
fn what_a_valve_was_at_the_sample_before_is_exact() {
    let plant = Plant::new(parse(VALVES).expect("a plant"));
    let u: Vec<f64> = (0..300)
        .map(|k| (0.07 * f64::from(k)).sin() + 0.4 * (0.31 * f64::from(k)).cos())
        .collect();
    let inputs: [&[f64]; 1] = [&u];
    let excitation = held(&inputs, 0.1);
    let point = plant.nominal();
    let run = plant.simulate(&point, &excitation, None).expect("a run");
    let (mut p, mut q, mut h) = (0.1f64, 0.15f64, 0.4f64);
    for (k, &u) in u.iter().enumerate() {
        p = p.max(u - 0.2).min(u + 0.2);
        if (u - q).abs() > 0.3 {
            q = u;
        }
        assert!((run.outputs[0][k] - h).abs() < 1e-8, "sample {k}");
        assert_eq!(run.outputs[1][k], q, "sample {k}");
        let rest = (p + q) / 0.5;
        h = rest + (h - rest) * (-0.05f64).exp();
    }
    // The play moves with its width; where a valve that sticks lets go does not change by little.
    let directions: Vec<Direction> = (0..3).map(Direction::Parameter).collect();
    let slopes = plant.sensitivities(&point, &excitation, None, &run.plan, &directions);
    for (i, slope) in slopes[0].iter().enumerate() {
        let step = 1e-6;
        let at = |sign: f64| {
            let mut moved = point.clone();
            moved.parameters[i] += sign * step;
            plant.simulate(&moved, &excitation, None).expect("a run")
        };
        let (above, below) = (at(1.0), at(-1.0));
        for (k, s) in slope.iter().enumerate() {
            let difference = (above.outputs[0][k] - below.outputs[0][k]) / (2.0 * step);
            assert!((difference - s).abs() < 1e-5, "parameter {i}, sample {k}");
        }
    }
    // Linearised at one sample after the other, it remembers too.
    let mut lineariser = plant.lineariser(&point);
    for (k, &u) in u.iter().enumerate() {
        let linear = lineariser.at(&[run.states[0][k]], &[u], excitation.time(k));
        assert_eq!(linear.output[1], run.outputs[1][k], "sample {k}");
    }
}

#[test]
fn work_is_counted_alike_at_each_run_and_with_what_counts_together() {
    let text = "model V parameter Real d = 0.3; input Real u; output Real y; Real v(start=1);
         equation der(v) = u - d*v*abs(v); y = v; end V;";
    let plant = Plant::new(parse(text).expect("a plant"));
    let input = [1.0; 200];
    let inputs: [&[f64]; 1] = [&input];
    let excitation = held(&inputs, 0.1);
    let point = plant.nominal();
    assert_eq!(plant.work(), 0);
    let run = plant.simulate(&point, &excitation, None).expect("a run");
    let one = plant.work();
    assert!(one >= 200, "{one}");
    let other = Plant::new(plant.spec.clone()).counting_with(&plant);
    other.simulate(&point, &excitation, None).expect("a run");
    assert_eq!(plant.work(), 2 * one);
    // Sensitivities are as many numbers for each value.
    plant.sensitivities(
        &point,
        &excitation,
        None,
        &run.plan,
        &[Direction::Parameter(0)],
    );
    assert!(plant.work() > 3 * one, "{} {one}", plant.work());
    assert_eq!(plant.clone().counting().work(), 0);
}

/// A dead zone in what is shown takes no steps of its own: between samples nothing uses it.
#[test]
fn what_only_an_output_uses_takes_no_steps() {
    let text = |shown: &str| {
        format!(
            "model S parameter Real k = 1; input Real u; output Real y; Real x(start=0);
             equation der(x) = u - k*x - 0.1*x^3; y = {shown}; end S;"
        )
    };
    let u: Vec<f64> = (0..200).map(|k| (0.3 * f64::from(k)).sin()).collect();
    let inputs: [&[f64]; 1] = [&u];
    let excitation = held(&inputs, 0.1);
    let run = |shown: &str| {
        let plant = Plant::new(parse(&text(shown)).expect("a plant"));
        let run = plant.simulate(&plant.nominal(), &excitation, None);
        run.expect("a run")
    };
    let zone = run("if x > 0.2 then x - 0.2 elseif x < -0.2 then x + 0.2 else 0.0");
    let plain = run("x");
    assert_eq!(zone.plan.steps(), plain.plan.steps());
    for (shown, x) in zone.outputs[0].iter().zip(&plain.outputs[0]) {
        let expected = x.signum() * (x.abs() - 0.2).max(0.0);
        assert!((shown - expected).abs() < 1e-12, "{shown} {expected}");
    }
}
