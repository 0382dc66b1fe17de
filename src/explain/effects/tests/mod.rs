//! Every law against its equation, integrated in small steps or written out, and against what it must keep.

mod implicit_force_tests;
mod input_tests;

use approx::assert_abs_diff_eq;

use super::*;

const STEP: f64 = 0.1;

fn clock() -> Clock {
    Clock {
        start: 2.0,
        step: STEP,
        fresh: false,
    }
}

/// Motion from `from` to `free`, which is where it goes without the force; `gain` is what a unit of it adds.
fn motion(sample: usize, from: [f64; 2], free: [f64; 2], gain: [f64; 2]) -> Motion {
    Motion {
        position: from[0],
        position_free: free[0],
        position_gain: gain[0],
        rate: from[1],
        rate_free: free[1],
        rate_gain: gain[1],
        input: 0.0,
        sample,
        clock: clock(),
    }
}

fn force(id: &str, variant: &str) -> ForceLaw {
    match find(id, variant).unwrap().action {
        Action::Force(law, ..) => law,
        _ => panic!("{id} is no force"),
    }
}

/// Force at a position and a rate that do not change.
fn at(id: &str, variant: &str, parameters: &[f64], position: f64, rate: f64) -> f64 {
    let still = motion(0, [position, rate], [position, rate], [0.0, 0.0]);
    force(id, variant)(parameters, &still, &mut [0.0; 3])
}

/// Mean and moments of an input after the law, in every interval.
type Driven = (Vec<f64>, Vec<Moments>);

fn driven(id: &str, variant: &str, parameters: &[f64], input: &[f64]) -> Driven {
    let (mut mean, mut moments) = (input.to_vec(), vec![[0.0; 2]; input.len()]);
    match find(id, variant).unwrap().action {
        Action::Input(law) => law(parameters, &mut mean, &mut moments, &clock()),
        _ => panic!("{id} is no law of an input"),
    }
    (mean, moments)
}

/// Legendre's polynomials of the first two degrees.
fn legendre(x: f64) -> Moments {
    [x - 0.5, x * x - x + 1.0 / 6.0]
}

fn seen(id: &str, variant: &str, parameters: &[f64], output: &[f64]) -> Vec<f64> {
    let mut output = output.to_vec();
    match find(id, variant).unwrap().action {
        Action::Sensor(law) => law(parameters, &mut output, &clock()),
        _ => panic!("{id} is no law of a sensor"),
    }
    output
}

/// Of one that moves on in small steps, `next(value, command, step)`: the value's mean and moments.
fn integrated(input: &[f64], next: impl Fn(f64, f64, f64) -> f64) -> Driven {
    const SMALL: usize = 20_000;
    let h = 1.0 / SMALL as f64;
    let mut value = input[0];
    input
        .iter()
        .map(|u| {
            let (mut mean, mut moments) = (0.0, [0.0; 2]);
            for i in 0..SMALL {
                let after = next(value, *u, h * STEP);
                let middle = 0.5 * (value + after);
                mean += h * middle;
                let weights = legendre((i as f64 + 0.5) * h);
                for (moment, weight) in moments.iter_mut().zip(weights) {
                    *moment += h * middle * weight;
                }
                value = after;
            }
            (mean, moments)
        })
        .unzip()
}

#[test]
fn springs_and_drags_are_their_equations() {
    for x in [-1.7, -0.2, 0.0, 0.6, 2.1f64] {
        for (id, variant, parameters, wanted) in [
            ("cubic_stiffness", "", &[][..], -x.powi(3)),
            (
                "cubic_stiffness",
                "off centre",
                &[0.3, 0.5],
                -(x - 0.3).powi(3),
            ),
            ("quadratic_stiffness", "odd", &[], -x * x.abs()),
            ("quadratic_stiffness", "even", &[], -x * x),
            (
                "cogging",
                "",
                &[0.7, 0.2],
                -(std::f64::consts::TAU * x / 0.7 + 0.2).sin(),
            ),
            ("end_stop", "upper", &[0.5], -(x - 0.5).max(0.0)),
            ("end_stop", "lower", &[-0.1], (-0.1 - x).max(0.0)),
            (
                "end_stop",
                "both",
                &[0.5],
                -(x.abs() - 0.5).max(0.0) * x.signum(),
            ),
        ] {
            assert_abs_diff_eq!(at(id, variant, parameters, x, 0.0), wanted, epsilon = 1e-12);
        }
        for (id, wanted) in [
            ("quadratic_drag", -x * x.abs()),
            ("direction_dependent_friction", -x.abs()),
        ] {
            assert_abs_diff_eq!(at(id, "", &[], 0.0, x), wanted, epsilon = 1e-12);
        }
    }
    let pushed = Motion {
        input: 3.0,
        ..motion(0, [1.0, 0.0], [2.0, 0.0], [0.0, 0.0])
    };
    assert_eq!(
        force("position_dependent_gain", "")(&[], &pushed, &mut [0.0; 3]),
        4.5
    );
    // In the middle of the interval, but where another instant is fitted.
    let moved = motion(0, [1.0, 2.0], [3.0, 6.0], [0.0, 0.0]);
    let now = |id: &str, variant: &str, p: &[f64]| force(id, variant)(p, &moved, &mut [0.0; 3]);
    assert_eq!(now("cubic_stiffness", "", &[]), -8.0);
    assert_eq!(now("cubic_stiffness", "off centre", &[0.0, 0.25]), -3.375);
    assert_eq!(now("quadratic_drag", "", &[]), -16.0);
}

#[test]
fn a_stop_pushes_and_never_pulls() {
    let damping: f64 = 0.5;
    for speed in [-30.0, -1.0, 0.0, 2.0] {
        // Penetrates by 0.2.
        let resisting = (0.2 + damping * speed).max(0.0);
        for (variant, place, x, v, wanted) in [
            ("upper damped", 1.0, 1.2, speed, -resisting),
            ("lower damped", -1.0, -1.2, -speed, resisting),
            ("both damped", 1.0, 1.2, speed, -resisting),
            ("both damped", 1.0, -1.2, -speed, resisting),
        ] {
            let found = at("end_stop", variant, &[place, damping], x, v);
            assert_abs_diff_eq!(found, wanted, epsilon = 1e-12);
            assert_eq!(at("end_stop", variant, &[place, damping], 0.5 * x, v), 0.0);
        }
    }
}

#[test]
fn dry_friction_brings_to_rest_what_it_can() {
    let gain = 0.25;
    for (id, parameters, limit) in [
        ("coulomb_friction", &[][..], |_: f64| 1.0),
        ("stribeck_friction", &[0.8, 0.5], |v: f64| {
            1.0 + 0.8 * (-(v / 0.5).powi(2)).exp()
        }),
    ] as [(&str, &[f64], fn(f64) -> f64); 2]
    {
        for (rate, free) in [
            (0.1, 0.05),
            (0.3, -0.1),
            (2.0, 1.9),
            (-1.0, -1.2),
            (0.0, 0.2),
        ] {
            let moving = motion(0, [0.0, rate], [0.0, free], [0.0, gain]);
            let f = force(id, "")(parameters, &moving, &mut [0.0; 3]);
            let most = limit(0.5 * (rate + free));
            let left = free + gain * f;
            assert!(f.abs() <= most + 1e-12, "{id} {rate} {free}: {f}");
            // Sticks, or slips against its full strength.
            assert!(
                left.abs() < 1e-12 || (f + most * left.signum()).abs() < 1e-12,
                "{id} {rate} {free}: {f} leaves {left}"
            );
        }
        // Where the force does not reach the rate it looks at.
        assert_abs_diff_eq!(
            at(id, "", parameters, 0.0, 3.0),
            -limit(3.0),
            epsilon = 1e-12
        );
        assert_abs_diff_eq!(
            at(id, "", parameters, 0.0, -3.0),
            limit(3.0),
            epsilon = 1e-12
        );
    }
}

#[test]
fn a_smooth_knee_is_met_by_the_speed_that_it_leaves() {
    for width in [1e-3, 0.2, 5.0] {
        for gain in [-0.3, 0.0, 0.4, 30.0] {
            for free in [-3.0, -0.01, 0.0, 0.2, 8.0] {
                let moving = motion(0, [0.0, free], [0.0, free], [0.0, gain]);
                let f = force("coulomb_friction", "smooth")(&[width], &moving, &mut [0.0; 3]);
                let middle = free + 0.5 * f64::max(gain, 0.0) * f;
                // Near the jump of a narrow knee the speed is what is exact.
                let apart = (f + (middle / width).tanh()).abs();
                assert!(apart < 1e-6, "{width} {gain} {free}: {f}, {apart}");
            }
        }
    }
}

/// A path that goes on, back and on again.
fn path(k: usize) -> f64 {
    let t = k as f64 * STEP;
    (0.9 * t).sin() + 0.4 * (2.3 * t).sin()
}

/// What a force says along [`path`], which it does not change.
fn along(id: &str, variant: &str, parameters: &[f64], samples: usize) -> Vec<f64> {
    let mut memory = [0.0; 3];
    (0..samples)
        .map(|k| {
            let (x, next) = (path(k), path(k + 1));
            let v = (next - x) / STEP;
            let moving = motion(k, [x, v], [next, v], [0.0, 0.0]);
            force(id, variant)(parameters, &moving, &mut memory)
        })
        .collect()
}

/// The same in small steps: `next(state, dx)`, from the middle of one interval to that of the next.
fn along_in_small_steps(samples: usize, next: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    const SMALL: usize = 2000;
    let mut state = 0.0;
    let mut from = path(0);
    (0..samples)
        .map(|k| {
            let to = 0.5 * (path(k) + path(k + 1));
            for _ in 0..SMALL {
                state = next(state, (to - from) / SMALL as f64);
            }
            from = to;
            state
        })
        .collect()
}

#[test]
fn bristles_yield_as_dahl_says() {
    let distance = 0.15;
    let dahl = |z: f64, dx: f64| z + dx / distance * (1.0 - z * dx.signum());
    let wanted = along_in_small_steps(80, dahl);
    let found = along("coulomb_friction", "presliding", &[distance], 80);
    for (found, wanted) in found.iter().zip(&wanted) {
        assert_abs_diff_eq!(*found, -wanted, epsilon = 1e-3);
    }
    // With damping of their own, as LuGre says: the speed of the bristle adds to its deflection.
    let time = 0.03;
    let damped = along("coulomb_friction", "bristles", &[distance, time], 80);
    let breaking = along(
        "stribeck_friction",
        "bristles",
        &[distance, time, 0.7, 0.5],
        80,
    );
    let elastic = along("stribeck_friction", "presliding", &[distance, 0.7, 0.5], 80);
    let mut before = 0.0;
    for k in 0..80 {
        let v = (path(k + 1) - path(k)) / STEP;
        let strength = 1.0 + 0.7 * (-(v / 0.5).powi(2)).exp();
        let lugre = wanted[k] + time * (wanted[k] - before) / STEP;
        assert_abs_diff_eq!(damped[k], -lugre, epsilon = 2e-3);
        assert_abs_diff_eq!(breaking[k], -strength * lugre, epsilon = 4e-3);
        assert_abs_diff_eq!(elastic[k], -strength * wanted[k], epsilon = 2e-3);
        before = wanted[k];
    }
}

/// Stiff bristles that hold what they act on: the force is the one at the position that it brings about.
#[test]
fn bristles_are_met_by_the_position_that_they_leave() {
    for (gain, distance, time) in [
        (0.0, 0.02, 0.0),
        (0.01, 0.1, 0.04),
        (1.0, 1e-3, 0.0),
        (1.0, 1e-3, 0.2),
        (50.0, 1e-4, 0.01),
    ] {
        for (before, free) in [(0.0, 0.21), (0.9, -0.3), (-1.0, 0.2001), (1.0, 0.3)] {
            let x = 0.2;
            let moving = motion(3, [x, 0.0], [free, 0.0], [gain, 0.0]);
            let mut memory = [before, x, 0.0];
            let f = -force("coulomb_friction", "bristles")(&[distance, time], &moving, &mut memory);
            let middle = |f: f64| 0.5 * (x + free) - 0.5 * gain * f;
            let damping = time / STEP;
            let deflection = |f: f64| {
                let moved = middle(f) - x;
                let side = moved.signum();
                side - (side - before) * (-moved.abs() / distance).exp()
            };
            let bristle = |f: f64| deflection(f) + damping * (deflection(f) - before);
            // More force leaves less deflection.
            let most = 1.0 + 2.0 * damping;
            let (mut low, mut high) = (-most, most);
            for _ in 0..70 {
                let half = 0.5 * (low + high);
                if bristle(half) > half {
                    low = half;
                } else {
                    high = half;
                }
            }
            assert_abs_diff_eq!(f, low, epsilon = 1e-12 * most);
            assert_abs_diff_eq!(
                memory[0],
                (low + damping * before) / (1.0 + damping),
                epsilon = 1e-12
            );
            assert_abs_diff_eq!(memory[1], middle(f), epsilon = 1e-12);
        }
    }
}

#[test]
fn hysteresis_loads_and_unloads_as_bouc_and_wen_say() {
    let (distance, shape) = (0.5, 0.6);
    let law = |z: f64, dx: f64| {
        let loading = if dx * z >= 0.0 { 1.0 } else { -1.0 };
        z + dx / distance * (1.0 - z.abs() * (shape * loading + 1.0 - shape))
    };
    let found = along("hysteresis", "", &[distance, shape], 80);
    for (found, wanted) in found.iter().zip(along_in_small_steps(80, law)) {
        assert_abs_diff_eq!(*found, -wanted, epsilon = 0.02);
        assert!(found.abs() <= 1.0);
    }
}

#[test]
fn sensors_show_what_their_equations_say() {
    let y = [-3.0, -0.5, 0.0, 0.4, 2.0];
    // Over half a second from 2 s on.
    for (id, variant, parameters, wanted) in [
        (
            "sensor_saturation",
            "",
            &[1.0][..],
            [-1.0, -0.5, 0.0, 0.4, 1.0],
        ),
        (
            "sensor_saturation",
            "upper",
            &[1.0],
            [-3.0, -0.5, 0.0, 0.4, 1.0],
        ),
        ("sensor_rectification", "", &[], [3.0, 0.5, 0.0, 0.4, 2.0]),
        ("sensor_offset", "", &[0.2], [-2.8, -0.3, 0.2, 0.6, 2.2]),
        ("sensor_drift", "", &[2.0], [-3.0, -0.3, 0.4, 1.0, 2.8]),
        (
            "sensor_drift",
            "curved",
            &[1.0, 2.0, 5.0],
            [-3.0, -0.18, 1.04, 2.8, 6.64],
        ),
        (
            "sensor_drift",
            "late",
            &[2.0, 2.25],
            [-3.0, -0.5, 0.0, 0.5, 2.3],
        ),
    ] {
        let found = seen(id, variant, parameters, &y);
        for (found, wanted) in found.iter().zip(wanted) {
            assert_abs_diff_eq!(*found, wanted, epsilon = 1e-9);
        }
    }
}
