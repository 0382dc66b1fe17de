//! A right model is rejected as often as the level says.

use super::support::*;
use crate::systems::{two_by_two, van_wingerden_one};
use crate::validate::Relation::{Estimation, Fresh};
use rayon::prelude::*;

/// Identified in closed loop; judged on its own record, on a fresh one, and on a fresh one ten times as long,
/// where the errors of the parameters are most of what is seen.
#[test]
fn identified_in_closed_loop() {
    let plant = van_wingerden_one();
    let fits: Vec<_> = (0..300)
        .into_par_iter()
        .map(|seed| identified(&plant.record(1000, seed), 4))
        .collect();
    let own = study(300, |s| {
        judged_fit(&fits[s as usize], &plant.record(1000, s), Estimation)
    });
    assert_level("closed loop, own", &own, &["whiteness", "past inputs"]);
    let fitted =
        |v: &crate::validate::Validation| v.past_inputs.as_ref().map_or(0, |t| t.fitted_directions);
    assert!(own.iter().all(|v| fitted(v) > 3));
    assert!(
        own.iter()
            .all(|v| v.feedback.as_ref().is_some_and(|t| t.p_value < 1e-6))
    );

    let fresh = study(300, |s| {
        judged_fit(&fits[s as usize], &plant.record(1000, s + 5000), Fresh)
    });
    assert_level(
        "closed loop, fresh",
        &fresh,
        &["whiteness", "past inputs", "size"],
    );

    let long = study(60, |s| {
        judged_fit(&fits[s as usize], &plant.record(10_000, s + 9000), Fresh)
    });
    let rejected = long.iter().filter(|v| v.rejected).count();
    assert!(rejected <= 4, "{rejected} of 60 rejected on long records");
    // The same without the parameter covariance: what the correction is for.
    let naive = study(60, |s| {
        let fit = &fits[s as usize];
        let log = plant.record(10_000, s + 9000);
        let stated = Some(&fit.innovation_covariance);
        judged(&fit.system, stated, None, &log, &fit.levels, Fresh)
    });
    assert!(naive.iter().filter(|v| v.rejected).count() > 40);
}

#[test]
fn identified_in_open_loop() {
    let plant = two_by_two();
    let fits: Vec<_> = (0..100)
        .into_par_iter()
        .map(|seed| identified(&plant.record(1500, seed), 3))
        .collect();
    let own = study(100, |s| {
        judged_fit(&fits[s as usize], &plant.record(1500, s), Estimation)
    });
    assert_level(
        "open loop, own",
        &own,
        &[
            "whiteness",
            "past inputs",
            "linearity",
            "feedback",
            "same sample",
        ],
    );
    let fresh = study(100, |s| {
        judged_fit(&fits[s as usize], &plant.record(1500, s + 5000), Fresh)
    });
    assert_level(
        "open loop, fresh",
        &fresh,
        &["whiteness", "past inputs", "size"],
    );
}

/// The true system, with and without its noise model: white and coloured residuals.
#[test]
fn true_systems() {
    let plants = [
        ("closed loop", van_wingerden_one(), 1000),
        ("servo", steady_servo(), 2000),
        ("two by two", two_by_two(), 1500),
    ];
    for (name, plant, samples) in plants {
        let stated = Some(&plant.innovation_covariance);
        let white = study(300, |s| {
            judged(
                &plant.system,
                stated,
                None,
                &plant.record(samples, s),
                &[],
                Fresh,
            )
        });
        assert_level(name, &white, &["whiteness", "past inputs", "size"]);
        let without = bare(&plant);
        let coloured = study(300, |s| {
            judged(
                &without,
                None,
                None,
                &plant.record(samples, s + 700),
                &[],
                Fresh,
            )
        });
        assert_level(&format!("{name}, K = 0"), &coloured, &["past inputs"]);
        // Coloured indeed.
        assert!(coloured.iter().filter(|v| v.own_past_lags > 3).count() > 250);
        let alarms = coloured.iter().filter(|v| v.rejected).count();
        assert!(alarms <= 9, "{name}: {alarms}");
    }
}
