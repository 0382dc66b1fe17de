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
    for (plant, order, n) in [(two_by_two(), 3, 1500usize), (two_by_two(), 3, 6000)] {
        let fits: Vec<_> = (0..runs)
            .into_par_iter()
            .map(|s| identified(&plant.record(n, s), order))
            .collect();
        let t = std::time::Instant::now();
        show(
            "two est",
            &study(runs, |s| {
                judged_fit(&fits[s as usize], &plant.record(n, s), Relation::Estimation)
            }),
        );
        println!("{:?}", t.elapsed());
        for nn in [500, n, 20000] {
            let t = std::time::Instant::now();
            show(
                &format!("two {n} fresh {nn}"),
                &study(runs, |s| {
                    judged_fit(
                        &fits[s as usize],
                        &plant.record(nn, s + 5000),
                        Relation::Fresh,
                    )
                }),
            );
            println!("{:?}", t.elapsed());
        }
    }
    let plant = van_wingerden_one();
    let log = plant.record(1_000_000, 1);
    let f = identified(&plant.record(5000, 3), 4);
    for rel in [Relation::Fresh, Relation::Estimation] {
        let t = std::time::Instant::now();
        let v = judged_fit(&f, &log, rel);
        println!("{:?} {} {:?}", t.elapsed(), v.rejected, v.findings);
    }
}
#[test]
fn timing() {
    let plant = van_wingerden_one();
    let log = plant.record(1_000_000, 1);
    let f = identified(&plant.record(5000, 3), 4);
    for rel in [Relation::Fresh, Relation::Estimation, Relation::Fresh] {
        let t = std::time::Instant::now();
        let v = judged_fit(&f, &log, rel);
        println!(
            "timing {:?} {} {:?} {:#?}",
            t.elapsed(),
            v.rejected,
            v.findings,
            v.past_inputs
        );
    }
    let t = std::time::Instant::now();
    let v = judged(&f.system, None, None, &log, &[], Relation::Fresh);
    println!("without cov {:?}", t.elapsed());
}
