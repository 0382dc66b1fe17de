//! Forces in the middle of a sample, where they have moved what they act on themselves.

use approx::assert_abs_diff_eq;

use super::{force, motion};

/// A plant of one state, `x+ = a x + (1 - a)(u - k f(x))`, comes to rest where `x + k f(x) = u`, however quick it is.
#[test]
fn a_plant_rests_where_its_force_says() {
    type Force = fn(f64) -> f64;
    let laws: [(&str, &str, Force); 3] = [
        ("quadratic_drag", "", |v| v * v.abs()),
        ("cubic_stiffness", "", |x| x * x * x),
        ("quadratic_stiffness", "odd", |x| x * x.abs()),
    ];
    for (id, variant, law) in laws {
        for a in [0.97, 0.5, 0.05] {
            let (k, u) = (2.0, -3.0);
            let gain = (1.0 - a) * k;
            let mut x = 0.0;
            for sample in 0..4000 {
                let free = a * x + (1.0 - a) * u;
                let moves = motion(sample, [x, x], [free, free], [gain, gain]);
                x = free + gain * force(id, variant)(&[], &moves, &mut [0.0; 3]);
            }
            assert_abs_diff_eq!(x + k * law(x), u, epsilon = 1e-7);
        }
    }
}
