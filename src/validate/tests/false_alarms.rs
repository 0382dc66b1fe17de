//! A right model is rejected as often as the level says.

use super::support::*;
use crate::systems::{servo, two_by_two, van_wingerden_one};
use crate::validate::{Relation, Validation};

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
        mean(&|v| v.whiteness.as_ref().unwrap().degrees_of_freedom as f64),
        mean(&|v| v.past_inputs.as_ref().unwrap().degrees_of_freedom as f64),
        mean(&|v| v.whiteness.as_ref().unwrap().statistic),
        mean(&|v| v.past_inputs.as_ref().unwrap().statistic),
        mean(&|v| v.past_inputs.as_ref().unwrap().variance_inflation),
        mean(&|v| v.whiteness.as_ref().unwrap().explained_share),
        mean(&|v| v.past_inputs.as_ref().unwrap().explained_share),
    );
}

#[test]
fn explore() {
    let runs = 300;
    let vw = van_wingerden_one();
    let plants = [
        ("vw", vw.clone(), 4, 1000),
        ("servo", servo(), 3, 2000),
        ("two", two_by_two(), 3, 1500),
        ("vw5000", vw.clone(), 4, 5000),
    ];
    for (name, plant, order, n) in &plants {
        let t = std::time::Instant::now();
        let fits: Vec<_> = {
            use rayon::prelude::*;
            (0..runs)
                .into_par_iter()
                .map(|s| identified(&plant.record(*n, s), *order))
                .collect()
        };
        let tf = t.elapsed();
        show(
            &format!("{name} est"),
            &study(runs, |s| {
                judged_fit(
                    &fits[s as usize],
                    &plant.record(*n, s),
                    Relation::Estimation,
                )
            }),
        );
        println!("fit {tf:?} with val {:?}", t.elapsed());
        show(
            &format!("{name} fresh"),
            &study(runs, |s| {
                judged_fit(
                    &fits[s as usize],
                    &plant.record(*n, s + 5000),
                    Relation::Fresh,
                )
            }),
        );
        show(
            &format!("{name} true"),
            &study(runs, |s| {
                judged(
                    &plant.system,
                    Some(&plant.innovation_covariance),
                    None,
                    &plant.record(*n, s),
                    &[],
                    Relation::Fresh,
                )
            }),
        );
        let system = bare(plant);
        show(
            &format!("{name} bare"),
            &study(runs, |s| {
                judged(
                    &system,
                    None,
                    None,
                    &plant.record(*n, s),
                    &[],
                    Relation::Fresh,
                )
            }),
        );
        let mut gain = plant.system.clone();
        gain.b *= 1.2;
        show(
            &format!("{name} gain"),
            &study(30, |s| {
                judged(
                    &gain,
                    None,
                    None,
                    &plant.record(*n, s),
                    &[],
                    Relation::Fresh,
                )
            }),
        );
        let mut gain = bare(plant);
        gain.b *= 1.2;
        show(
            &format!("{name} gain bare"),
            &study(30, |s| {
                judged(
                    &gain,
                    None,
                    None,
                    &plant.record(*n, s),
                    &[],
                    Relation::Fresh,
                )
            }),
        );
        show(
            &format!("{name} order-1"),
            &study(30, |s| {
                let log = plant.record(*n, s);
                judged_fit(&identified(&log, order - 1), &log, Relation::Estimation)
            }),
        );
    }
}
