//! A right model is rejected as often as the level says.

use super::support::*;
use crate::systems::{servo, two_by_two, van_wingerden_one};
use crate::validate::{Relation, Validation};

fn z() -> crate::validate::ResidualTest {
    crate::validate::ResidualTest {
        statistic: 0.0,
        degrees_of_freedom: 0,
        fitted_directions: 0,
        variance_inflation: 0.0,
        p_value: 1.0,
        explained_share: 0.0,
        explained_share_by_channel: vec![],
        strongest: None,
    }
}
fn show(name: &str, studies: &[Validation]) {
    let n = studies.len() as f64;
    let rate = |f: &dyn Fn(&Validation) -> Option<f64>, a: f64| {
        studies
            .iter()
            .filter(|v| f(v).is_some_and(|p| p < a))
            .count() as f64
            / n
            * 100.0
    };
    let ps: [(&str, &dyn Fn(&Validation) -> Option<f64>); 5] = [
        ("white", &|v| v.whiteness.as_ref().map(|t| t.p_value)),
        ("inputs", &|v| v.past_inputs.as_ref().map(|t| t.p_value)),
        ("same", &|v| v.same_sample.as_ref().map(|t| t.p_value)),
        ("feedback", &|v| v.feedback.as_ref().map(|t| t.p_value)),
        ("size", &|v| v.innovation_size.as_ref().map(|t| t.p_value)),
    ];
    print!("{name:24}");
    for (label, p) in ps {
        print!(
            " {label} {:.1}/{:.1}/{:.1}",
            rate(p, 0.5),
            rate(p, 0.05),
            rate(p, 0.01)
        );
    }
    let mean = |f: &dyn Fn(&Validation) -> f64| studies.iter().map(f).sum::<f64>() / n;
    println!(
        " rej {:.1} own {:.1} dof {:.1} {:.1} stat {:.1} {:.1} infl {:.2} share {:.4} {:.4}",
        100.0 * mean(&|v| f64::from(v.rejected)),
        mean(&|v| v.own_past_lags as f64),
        mean(&|v| v.whiteness.clone().unwrap_or(z()).degrees_of_freedom as f64),
        mean(&|v| v.past_inputs.clone().unwrap_or(z()).degrees_of_freedom as f64),
        mean(&|v| v.whiteness.clone().unwrap_or(z()).statistic),
        mean(&|v| v.past_inputs.clone().unwrap_or(z()).statistic),
        mean(&|v| v.past_inputs.clone().unwrap_or(z()).variance_inflation),
        mean(&|v| v.whiteness.clone().unwrap_or(z()).explained_share),
        mean(&|v| v.past_inputs.clone().unwrap_or(z()).explained_share),
    );
}

#[test]
fn explore() {
    let runs = 300;
    use rayon::prelude::*;
    for (name, plant, order, n, nn) in [("vw", van_wingerden_one(), 4usize, 1000usize, 1000usize), ("vw", van_wingerden_one(), 4, 1000, 20000), ("two", two_by_two(), 3, 20000, 20000), ("two", two_by_two(), 3, 1500, 20000), ("two2", two_by_two(), 2, 1500, 20000)] {
        let fits: Vec<_> = (0..runs).into_par_iter().map(|s| identified(&plant.record(n, s), order)).collect();
        show(&format!("{name} {n} fresh {nn}"), &study(runs, |s| judged_fit(&fits[s as usize], &plant.record(nn, s + 5000), Relation::Fresh)));
        let best = identified(&plant.record(100000, 777), order);
        for scale in [100000.0 / n as f64, 1000.0 / n as f64] {
            let mut cov = best.covariance.clone();
            cov.matrix *= scale;
            let f = crate::linalg::symmetric_square_root_factor(&cov.matrix).unwrap();
            let truth = crate::systems::TestSystem { system: best.system.clone(), innovation_covariance: best.innovation_covariance.clone(), feedback: plant.feedback.clone() };
            let theta = cov.layout.pack(&best.system);
            show(&format!("{name} drawn {scale} {nn}"), &study(runs, |s| {
                use rand::SeedableRng; use rand_distr::{Distribution, StandardNormal};
                let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(s + 99);
                let eta = nalgebra::DVector::from_fn(f.ncols(), |_, _| StandardNormal.sample(&mut random));
                let d = &f * eta;
                let t: Vec<f64> = theta.iter().zip(d.iter()).map(|(a, b): (&f64, &f64)| a + b).collect();
                let system = cov.layout.unpack(&t, &best.system);
                judged(&system, Some(&best.innovation_covariance), Some(&cov), &truth.record(nn, s + 7000), &[], Relation::Fresh)
            }));
        }
    }
}
