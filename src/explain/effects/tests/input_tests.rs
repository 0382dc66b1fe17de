//! What inputs do on their way, in small steps of their equations.

use super::*;

const COMMAND: [f64; 8] = [0.5, 0.5, 2.0, -1.0, -1.2, 0.4, 0.45, 3.0];

fn same(found: &Driven, wanted: &Driven, within: f64) {
    let means = found.0.iter().zip(&wanted.0);
    let moments = found.1.iter().flatten().zip(wanted.1.iter().flatten());
    for (found, wanted) in means.chain(moments) {
        assert_abs_diff_eq!(*found, *wanted, epsilon = within);
    }
}

#[test]
fn a_rate_limit_ramps_within_the_interval() {
    // 0.2, 0.9 and 40 in an interval.
    for rate in [2.0, 9.0, 400.0] {
        let wanted = integrated(&COMMAND, |value, u, h| {
            value + (u - value).clamp(-rate * h, rate * h)
        });
        same(
            &driven("input_rate_limit", "", &[rate], &COMMAND),
            &wanted,
            1e-4,
        );
    }
    let (held, moment) = driven("input_rate_limit", "held", &[9.0], &[0.5, 2.0, -1.0]);
    assert_eq!(moment, [[0.0; 2]; 3]);
    for (found, wanted) in held.iter().zip([0.5, 1.4, 0.5]) {
        assert_abs_diff_eq!(*found, wanted, epsilon = 1e-12);
    }
}

#[test]
fn a_lag_is_an_exponential_within_the_interval() {
    for time_constant in [0.004, 0.1, 3.0] {
        let wanted = integrated(&COMMAND, |value, u, h| {
            u + (value - u) * (-h / time_constant).exp()
        });
        same(
            &driven("actuator_lag", "", &[time_constant], &COMMAND),
            &wanted,
            1e-5,
        );
    }
    // Where little decays the closed form gives way to a series: both agree where one takes over from the other.
    let moments = |a: f64| driven("actuator_lag", "", &[STEP / a], &COMMAND).1[2];
    let (below, above) = (moments(0.029_999_99), moments(0.030_000_01));
    for (degree, (below, above)) in below.iter().zip(above).enumerate() {
        assert_abs_diff_eq!(below / above, 1.0, epsilon = 1e-6 * (1 + 4 * degree) as f64);
    }

    let (held, _) = driven("actuator_lag", "held", &[STEP], &[0.5, 2.0]);
    assert_abs_diff_eq!(held[0], 0.5);
    assert_abs_diff_eq!(
        held[1],
        0.5 + 1.5 * (1.0 - (-1.0f64).exp()),
        epsilon = 1e-12
    );
}

#[test]
fn a_delay_moves_the_command_by_parts_of_an_interval() {
    for delay in [0.0, 0.03, 0.1, 0.27, 0.999] {
        const SMALL: usize = 1000;
        let h = 1.0 / SMALL as f64;
        let wanted: Driven = (0..COMMAND.len())
            .map(|k| {
                let (mut mean, mut moments) = (0.0, [0.0; 2]);
                for i in 0..SMALL {
                    let share = (i as f64 + 0.5) * h;
                    let sample = (k as f64 + share - delay / STEP).floor().max(0.0);
                    mean += h * COMMAND[sample as usize];
                    for (moment, weight) in moments.iter_mut().zip(legendre(share)) {
                        *moment += h * COMMAND[sample as usize] * weight;
                    }
                }
                (mean, moments)
            })
            .unzip();
        same(
            &driven("input_delay", "", &[delay], &COMMAND),
            &wanted,
            2e-3,
        );
        let (held, moment) = driven("input_delay", "interpolated", &[delay], &COMMAND);
        same(&(held, wanted.1.clone()), &wanted, 2e-3);
        assert_eq!(moment, [[0.0; 2]; COMMAND.len()]);
    }
}

#[test]
fn static_laws_of_an_input() {
    let u = [-3.0, -0.5, 0.0, 0.4, 2.0];
    for (id, variant, parameters, wanted) in [
        (
            "input_saturation",
            "",
            &[1.0][..],
            [-1.0, -0.5, 0.0, 0.4, 1.0],
        ),
        (
            "input_saturation",
            "upper",
            &[1.0],
            [-3.0, -0.5, 0.0, 0.4, 1.0],
        ),
        (
            "input_saturation",
            "lower",
            &[-1.0],
            [-1.0, -0.5, 0.0, 0.4, 2.0],
        ),
        (
            "input_dead_zone",
            "",
            &[0.45],
            [-2.55, -0.05, 0.0, 0.0, 1.55],
        ),
        ("input_asymmetry", "", &[0.1], [-2.7, -0.45, 0.0, 0.44, 2.2]),
        ("input_gain", "", &[0.1], [-3.3, -0.55, 0.0, 0.44, 2.2]),
    ] {
        let (found, moment) = driven(id, variant, parameters, &u);
        assert_eq!(moment, [[0.0; 2]; 5], "{id}");
        for (found, wanted) in found.iter().zip(wanted) {
            assert_abs_diff_eq!(*found, wanted, epsilon = 1e-12);
        }
    }
}

#[test]
fn a_soft_knee_is_its_equation_and_nearly_a_corner_when_it_is_sharp() {
    for sharpness in [1.0, 2.5, 8.0] {
        for u in [-7.0, -1.0, -0.2, 0.0, 0.9, 1.0, 1.1, 30.0] {
            let limit = 1.3f64;
            let wanted = u / (1.0 + f64::powf((u / limit).abs(), sharpness)).powf(1.0 / sharpness);
            let (found, _) = driven("input_saturation", "soft", &[limit, sharpness], &[u]);
            assert_abs_diff_eq!(found[0], wanted, epsilon = 1e-12);
            let found = seen("sensor_saturation", "soft", &[limit, sharpness], &[u]);
            assert_abs_diff_eq!(found[0], wanted, epsilon = 1e-12);
        }
    }
    for u in [-1e9, -0.3, 0.5, 1e9] {
        let (soft, _) = driven("input_saturation", "soft", &[1.0, 100.0], &[u]);
        let (hard, _) = driven("input_saturation", "", &[1.0], &[u]);
        assert_abs_diff_eq!(soft[0], hard[0], epsilon = 1e-9);
    }
}

#[test]
fn backlash_is_carried_along_at_the_ends_of_its_gap() {
    let u = [0.5, 0.9, 2.0, 1.9, 1.0, -0.5, -0.3, 0.0, 0.2, 0.6];
    let gap = 0.4;
    // Begins in the middle of the gap about zero, as far as it reaches.
    let mut held: f64 = 0.1;
    let (found, _) = driven("input_backlash", "", &[gap], &u);
    for (found, u) in found.iter().zip(u) {
        if u - held > gap {
            held = u - gap;
        } else if held - u > gap {
            held = u + gap;
        }
        assert_abs_diff_eq!(*found, held, epsilon = 1e-12);
    }
}

#[test]
fn backlash_begins_where_it_is_in_its_gap() {
    let u = [0.5, 0.4, 0.9, 1.4, 0.7, 0.3];
    for (start, wanted) in [
        (-1.0, [0.1, 0.1, 0.5, 1.0, 1.0, 0.7]),
        (1.0, [0.9, 0.8, 0.8, 1.0, 1.0, 0.7]),
    ] {
        let (found, _) = driven("input_backlash", "from its gap", &[0.4, start], &u);
        for (found, wanted) in found.iter().zip(wanted) {
            assert_abs_diff_eq!(*found, wanted, epsilon = 1e-12);
        }
    }
}

#[test]
fn a_gain_changes_within_the_interval_of_its_time() {
    // The interval that holds the change has it for a quarter.
    let change = 2.0 + 1.75 * STEP;
    let (found, _) = driven("gain_change", "", &[-0.4, change], &[1.0; 4]);
    for (found, wanted) in found.iter().zip([1.0, 0.9, 0.6, 0.6]) {
        assert_abs_diff_eq!(*found, wanted, epsilon = 1e-9);
    }
    let softened = force("stiffness_change", "");
    let load = force("load_step", "");
    for (sample, share) in [(0, 0.0), (1, 0.25), (2, 1.0)] {
        let moved = motion(sample, [1.0, 0.0], [3.0, 0.0], [0.0, 0.0]);
        assert_abs_diff_eq!(
            softened(&[change], &moved, &mut [0.0; 3]),
            -2.0 * share,
            epsilon = 1e-9
        );
        assert_abs_diff_eq!(
            load(&[change], &moved, &mut [0.0; 3]),
            share,
            epsilon = 1e-9
        );
        let fresh = Motion {
            clock: Clock {
                fresh: true,
                ..clock()
            },
            ..moved
        };
        assert_abs_diff_eq!(softened(&[change], &fresh, &mut [0.0; 3]), -2.0);
    }
}
