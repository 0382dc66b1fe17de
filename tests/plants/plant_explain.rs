//! `explain` where the simulation is a plant in equations, on recordings of an integrator of its own.

use crate::cart::{CART, explained, explained_with, record};
use crate::folder::Folder;

#[test]
fn a_missing_drag_is_named_in_its_equation_and_can_be_simulated() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    record(&folder, "log.csv", 1.1, |_, v, _| -2.5 * v * v.abs(), 1);
    let said = explained(&folder, "log.csv");
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    let effect = &said["effects"][0];
    assert_eq!(effect["effect"], "quadratic_drag", "{}", said["summary"]);
    assert_eq!(said["effects"].as_array().unwrap().len(), 1);
    assert_eq!(
        (&effect["enters"], &effect["depends"][0]),
        (&"v".into(), &"v".into())
    );
    assert!(
        effect["equation"]
            .as_str()
            .unwrap()
            .starts_with("m*der(v) = u - k*x - d*v")
    );
    let strength = &effect["parameters"]["signed_square_c"];
    let (value, std) = (
        strength["value"].as_f64().unwrap(),
        strength["std"].as_f64().unwrap(),
    );
    assert!(
        (value + 2.5).abs() < 4.0 * std && std < 0.5,
        "{value} +- {std}"
    );
    // N over the square of m/s.
    assert_eq!(strength["unit"], "kg/m");
    let summary = said["summary"].to_string();
    assert!(
        summary.contains("Estimated: signed_square_c = -2."),
        "{summary}"
    );
    let law = &effect["law"];
    let (at, curve) = (
        law["at"].as_array().unwrap(),
        law["value"].as_array().unwrap(),
    );
    for (v, f) in at.iter().zip(curve) {
        let v = v.as_f64().unwrap();
        let expected = value * v * v.abs();
        assert!((f.as_f64().unwrap() - expected).abs() < 1e-6 * (1.0 + expected.abs()));
    }
    let mass = said["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .find(|p| p["name"] == "m")
        .unwrap();
    assert!(
        (mass["recording"].as_f64().unwrap() - 1.1).abs() < 4.0 * mass["std"].as_f64().unwrap()
    );
    assert!(
        std::fs::read_to_string(folder.join("e.html"))
            .unwrap()
            .contains("quadratic drag")
    );
    // What was found is simulated, and is a plant like any other.
    record(&folder, "fresh.csv", 1.1, |_, v, _| -2.5 * v * v.abs(), 2);
    folder
        .run(&["simulate", "e.json", "fresh.csv", "--output", "p.csv"])
        .ok();
    let read = |name: &str, column: usize| -> Vec<f64> {
        let text = std::fs::read_to_string(folder.join(name)).unwrap();
        let row = |l: &str| l.split(',').nth(column).unwrap().parse().unwrap();
        text.lines().skip(1).map(row).collect()
    };
    let (predicted, recorded) = (read("p.csv", 1), read("fresh.csv", 2));
    let squares: f64 = predicted
        .iter()
        .zip(&recorded)
        .map(|(a, b)| (a - b).powi(2))
        .sum();
    let rmse = (squares / predicted.len() as f64).sqrt();
    assert!(rmse < 0.006, "{rmse}");
}

#[test]
fn other_parameters_are_no_missing_physics() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    for (mass, verdict) in [(1.0, "consistent"), (1.15, "parameters")] {
        record(&folder, "log.csv", mass, |_, _, _| 0.0, 5);
        let said = explained(&folder, "log.csv");
        assert_eq!(said["verdict"], verdict, "{}", said["summary"]);
        assert!(said["effects"].as_array().unwrap().is_empty());
    }
}

/// The text falls over in free run; the recording was made with another spring, which holds it.
#[test]
fn a_text_that_cannot_be_simulated_is_not_given_a_fit() {
    let folder = Folder::new();
    let falls = CART.replace("min=30, max=50) = 40", "min=-30, max=50) = -20");
    folder.text("cart.mo", &falls);
    record(&folder, "log.csv", 1.0, |_, _, _| 0.0, 5);
    let said = explained(&folder, "log.csv");
    let fit = said["fit"]["train"]["simulation"]["fit_percent"]
        .as_f64()
        .unwrap();
    assert!(fit.abs() < 1e-6, "{fit}");
    let summary = said["summary"].to_string();
    assert!(summary.contains("cannot be simulated"), "{summary}");
}

#[test]
fn what_is_not_available_with_plants_is_said() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    folder.text("other.mo", CART);
    record(&folder, "log.csv", 1.0, |_, _, _| 0.0, 5);
    let arguments = [
        "explain",
        "log.csv",
        "--simulation",
        "cart.mo",
        "--map",
        "a=y",
    ];
    let said = folder.run(&arguments).error();
    assert!(said.contains("--map"), "{said}");
    let said = folder
        .run(&["explain", "log.csv", "--simulation", "cart.mo", "other.mo"])
        .error();
    assert!(said.contains("one plant"), "{said}");
}

#[test]
fn a_contact_that_lasts_a_few_samples_is_named() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    let stop = |x: f64, _: f64, _: f64| -1500.0 * (x - 0.9).max(0.0);
    record(&folder, "log.csv", 1.1, stop, 4);
    let said = explained(&folder, "log.csv");
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    let effect = &said["effects"][0];
    assert_eq!(effect["effect"], "end_stop", "{}", said["summary"]);
    assert_eq!(effect["depends"][0], "x");
    let gap = &effect["parameters"]["above_from"];
    let (value, std) = (gap["value"].as_f64().unwrap(), gap["std"].as_f64().unwrap());
    assert!(
        (value - 0.9).abs() < 4.0 * std + 0.005 && std < 0.02,
        "{value} +- {std}"
    );
}

#[test]
fn a_force_that_repeats_in_time_is_named_with_its_frequency() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    let force = |_: f64, _: f64, t: f64| 0.8 * (3.7 * t + 1.0).sin();
    record(&folder, "log.csv", 1.1, force, 6);
    let said = explained(&folder, "log.csv");
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    let effect = &said["effects"][0];
    assert_eq!(effect["effect"], "periodic_disturbance");
    assert_eq!(effect["enters"], "v");
    let frequency = &effect["parameters"]["periodic_w"];
    let (value, std) = (
        frequency["value"].as_f64().unwrap(),
        frequency["std"].as_f64().unwrap(),
    );
    assert!(
        (value - 3.7).abs() < 4.0 * std && std < 0.02,
        "{value} +- {std}"
    );
}

#[test]
fn effects_are_left_out_or_tried_alone() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    record(&folder, "log.csv", 1.1, |_, v, _| -2.5 * v * v.abs(), 1);
    let names = |said: &serde_json::Value| -> Vec<String> {
        let rivals = said["alternatives"].as_array().unwrap().iter();
        let effects = said["effects"].as_array().unwrap().iter();
        let id = |e: &serde_json::Value| e["effect"].as_str().unwrap().to_owned();
        effects.chain(rivals).map(id).collect()
    };
    let said = explained_with(&folder, "log.csv", &["--without", "quadratic_drag"]);
    let found = names(&said);
    assert!(!found.contains(&"quadratic_drag".to_owned()), "{found:?}");
    // Something else of the same speed stands in for it.
    assert_eq!(
        said["effects"][0]["depends"][0], "v",
        "{found:?} {}",
        said["summary"]
    );
    let said = explained_with(&folder, "log.csv", &["--only", "end_stop,coulomb_friction"]);
    let found = names(&said);
    assert!(
        found
            .iter()
            .all(|f| f == "end_stop" || f == "coulomb_friction"),
        "{found:?}"
    );
    // What may not be named is missing all the same.
    assert_eq!(said["remaining"]["adequate"], false);
    for option in ["--without", "--only"] {
        let arguments = ["explain", "log.csv", "--simulation", "cart.mo"];
        let unknown = [option, "quadratic_drag,quadratic_damping"];
        let said = folder.run(&[&arguments[..], &unknown].concat()).error();
        assert!(
            said.contains(option)
                && said.contains("quadratic_damping of plants")
                && said.contains("cogging"),
            "{said}"
        );
    }
}

#[test]
fn the_effects_are_listed_and_described() {
    let folder = Folder::new();
    let all = folder.run(&["effects"]).ok();
    assert!(
        all.contains("quadratic_drag") && all.contains("tank_outflow"),
        "{all}"
    );
    let one = folder.run(&["effects", "quadratic_drag"]).ok();
    for part in [
        "m*der(v) = ... + c*v*abs(v)",
        "enters",
        "function of",
        "imitated by",
        "cubic_drag:",
    ] {
        assert!(one.contains(part), "{one}");
    }
    let said = folder.run(&["effects", "quadratic_drg"]).error();
    assert!(said.contains("did you mean quadratic_drag?"), "{said}");
}
