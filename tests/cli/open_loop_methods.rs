//! Knudsen's methods, the prediction error method and subid through the whole pipeline: library, command line, JSON.

use innovant::covariance::pole_uncertainties;
use innovant::identify::Method;
use innovant::identify::Stochastic;
use innovant::identify::{Model, Options, Order, Polish, identify};
use innovant::internal::linalg::{spectral_radius, symmetric_eigen};
use innovant::internal::systems;
use innovant::log::Log;
use innovant::model::StateSpace;

use crate::folder::{Folder, json};

fn options(method: Method, order: usize) -> Options {
    Options {
        method,
        order: Order::Fixed(order),
        ..Options::default()
    }
}

/// Poles within five standard deviations, a covariance that is one, a stable predictor.
fn check(model: &Model, truth: &StateSpace, what: &str) {
    let covariance = model.covariance.as_ref().unwrap();
    let values = symmetric_eigen(&covariance.matrix).unwrap().values;
    let largest = values.iter().copied().fold(0.0, f64::max);
    assert!(
        largest > 0.0 && values.iter().all(|v| *v > -1e-9 * largest),
        "{what}"
    );
    assert!(
        spectral_radius(&model.system.predictor_matrix()).unwrap() < 1.0,
        "{what}"
    );
    let found = pole_uncertainties(&model.system, covariance).unwrap();
    for pole in truth.poles().unwrap() {
        let nearest = found
            .iter()
            .min_by(|a, b| {
                let d =
                    |p: &innovant::covariance::PoleUncertainty| (p.pole.value - pole.value).norm();
                d(a).total_cmp(&d(b))
            })
            .unwrap();
        let c = nearest.covariance.unwrap();
        let std = (c[0][0] + c[1][1]).sqrt();
        let distance = (nearest.pole.value - pole.value).norm();
        assert!(
            distance < 5.0 * std,
            "{what}: {distance:.2e}, std {std:.2e}"
        );
    }
    // Poles that are close together have wide intervals; the responses do not.
    for w in [0.1, 0.5, 1.0] {
        let w = w / truth.sample_time;
        let (g, t) = (
            model.system.frequency_response(w),
            truth.frequency_response(w),
        );
        let error = (&g - &t).norm() / t.norm();
        assert!(
            error < 0.15,
            "{what}: response at {w} rad/s is {error:.3} off"
        );
    }
}

fn held(example: &systems::TestSystem, samples: usize, seed: u64) -> Log {
    example.record(samples, seed)
}

#[test]
fn every_method_finds_the_armax_system() {
    let example = systems::knudsen_armax();
    let log = example.record(3000, 5);
    let truth = &example.system.system;
    for method in [Method::Knudsen, Method::Pem, Method::Subid] {
        for polish in [Polish::Auto, Polish::Always] {
            let model = identify(
                std::slice::from_ref(&log),
                &Options {
                    polish,
                    ..options(method, 2)
                },
            )
            .unwrap();
            let what = format!("{} {polish:?}", method.name());
            check(&model, truth, &what);
            let summary = model.summary.as_ref().unwrap();
            assert_eq!(summary.method, method);
            assert_eq!(summary.polished, polish == Polish::Always, "{what}");
            let variance = model.innovation_covariance.as_ref().unwrap()[(0, 0)];
            assert!(
                (variance / example.variance - 1.0).abs() < 0.2,
                "{what}: {variance}"
            );
            // Only subid has no formula, and takes the jackknife.
            let blocks = summary.diagnostics.jackknife_blocks;
            let jackknife = method == Method::Subid && polish != Polish::Always;
            assert_eq!(blocks.is_some(), jackknife, "{what}");
        }
    }
}

#[test]
fn several_inputs_and_outputs_and_feedthrough() {
    let mut example = systems::two_by_two();
    example.system.d[(0, 1)] = 0.4;
    let log = held(&example, 4000, 3);
    for method in [Method::Knudsen, Method::Pem, Method::Subid] {
        let model = identify(
            std::slice::from_ref(&log),
            &Options {
                feedthrough: true,
                ..options(method, 3)
            },
        )
        .unwrap();
        check(&model, &example.system, method.name());
        let d = &model.system.d;
        assert!(
            (d[(0, 1)] - 0.4).abs() < 0.05 && d[(1, 0)].abs() < 0.05,
            "{d}"
        );
    }
}

/// Any deterministic part with any stochastic step. Near the zero of the noise model a gain of nothing would be off
/// by 1.3 times the response.
#[test]
fn stochastic_steps_go_with_every_method() {
    let example = systems::knudsen_armax();
    let log = example.record(2000, 8);
    let truth = example.system.system.noise_response(0.7)[(0, 0)];
    for method in [Method::PbsidOpt, Method::Knudsen, Method::Subid] {
        for step in [
            Stochastic::FirstColumn,
            Stochastic::Cholesky,
            Stochastic::Innovations,
        ] {
            let model = identify(
                std::slice::from_ref(&log),
                &Options {
                    stochastic: Some(step),
                    past: Some(24),
                    future: (method != Method::Subid).then_some(6),
                    ..options(method, 2)
                },
            )
            .unwrap();
            let what = format!("{} {}", method.name(), step.name());
            let found = model.system.noise_response(0.7)[(0, 0)];
            assert!(
                (found - truth).norm() < 0.4 * truth.norm(),
                "{what}: {found} {truth}"
            );
            assert_eq!(model.summary.unwrap().stochastic, Some(step));
        }
    }
}

/// A loop with a delay: the prediction error method is not misled.
#[test]
fn the_prediction_error_method_works_in_closed_loop() {
    let example = systems::van_wingerden_one();
    let log = held(&example, 3000, 2);
    let model = identify(std::slice::from_ref(&log), &options(Method::Pem, 4)).unwrap();
    check(&model, &example.system, "pem");
}

#[test]
fn orders_are_chosen_with_every_method() {
    let example = systems::knudsen_armax();
    let log = example.record(3000, 6);
    for method in [Method::Knudsen, Method::Pem, Method::Subid] {
        let automatic = Options {
            method,
            ..Options::default()
        };
        let model = identify(std::slice::from_ref(&log), &automatic).unwrap();
        assert_eq!(model.system.states(), 2, "{}", method.name());
    }
}

/// A window shows as many states as it has outputs in all samples but one.
#[test]
fn an_order_that_the_window_cannot_show_is_refused() {
    for (log, past, most) in [
        (systems::knudsen_armax().record(600, 2), 5, 4),
        (held(&systems::two_by_two(), 600, 2), 4, 6),
    ] {
        for (order, possible) in [(most, true), (most + 1, false)] {
            let options = Options {
                past: Some(past),
                polish: Polish::Never,
                ..options(Method::Subid, order)
            };
            match identify(std::slice::from_ref(&log), &options) {
                Ok(model) => assert!(possible && model.system.states() == order),
                Err(error) => {
                    let said = error.to_string();
                    assert!(!possible, "{said}");
                    assert!(said.contains(&most.to_string()), "{said}");
                }
            }
        }
    }
}

#[test]
fn the_command_line_takes_the_names_and_the_document_gives_them() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::servo(), 3000, 1);
    for (method, extra) in [
        ("knudsen", ["--stochastic", "first-column"]),
        ("pem", ["--polish", "never"]),
        ("subid", ["--past", "12"]),
    ] {
        let mut line = vec!["identify", "log.csv", "--order", "3", "--method", method];
        line.extend(extra);
        line.extend(["--output", "model.json"]);
        folder.run(&line).ok();
        let model = json(&folder.join("model.json"));
        assert_eq!(model["method"], method);
        if method == "knudsen" {
            assert_eq!(model["stochastic"], "first-column");
            assert_eq!(model["horizons"]["future"], 5);
        }
        let std = model["invariants"]["poles"][0]["natural_frequency_std"].as_f64();
        assert!(std.is_some_and(|s| s > 0.0), "{method}");
    }
    let wrong = folder.run(&[
        "identify", "log.csv", "--order", "3", "--method", "knudsen", "--past", "6", "--future",
        "3",
    ]);
    let text = wrong.error();
    assert!(text.contains("order 3 is not possible"), "{text}");
}

/// Bias by feedback is in no covariance: it has to be said. In open loop there is nothing to say.
#[test]
fn open_loop_methods_say_so_when_the_loop_is_closed() {
    let folder = Folder::new();
    folder.recording("closed.csv", &systems::van_wingerden_one(), 2000, 1);
    folder.recording("open.csv", &systems::two_by_two(), 2000, 1);
    let warned = |log: &str, order: &str, extra: &[&str]| {
        let mut line = vec!["identify", log, "--order", order, "--output", "model.json"];
        line.extend(extra);
        folder.run(&line).ok();
        let model = json(&folder.join("model.json"));
        let warnings = model["warnings"].as_array().unwrap().clone();
        warnings
            .iter()
            .any(|w| w.as_str().unwrap().contains("taken in closed loop"))
    };
    for method in Method::all() {
        let extra = ["--method", method.name()];
        let biased = method.open_loop_only();
        assert_eq!(warned("closed.csv", "4", &extra), biased, "{extra:?}");
        assert!(!warned("open.csv", "3", &extra), "{extra:?}");
    }
    for step in Stochastic::all() {
        let extra = ["--stochastic", step.name()];
        let biased = step.open_loop_only();
        assert_eq!(warned("closed.csv", "4", &extra), biased, "{extra:?}");
    }
    // Maximum likelihood has left the bias of its start behind.
    let polished = ["--method", "subid", "--polish", "always"];
    assert!(!warned("closed.csv", "4", &polished));
}

/// `--polish auto` leaves a method that was asked for by name as it is, and says how to have it polished.
#[test]
fn what_is_not_polished_says_so() {
    let log = systems::knudsen_armax().record(3000, 5);
    let explained = |options: &Options| {
        let model = identify(std::slice::from_ref(&log), options).unwrap();
        let lines = model.summary.unwrap().explanation;
        lines.iter().any(|line| line.starts_with("not polished: "))
    };
    for method in Method::all() {
        let own = !matches!(method, Method::PbsidOpt | Method::Pem);
        assert_eq!(explained(&options(*method, 2)), own, "{}", method.name());
        let always = Options {
            polish: Polish::Always,
            ..options(*method, 2)
        };
        assert!(!explained(&always), "{}", method.name());
    }
}
