//! What `explain` says of a plant in equations holds for data that the fit has not seen, on recordings of an integrator of its
//! own.

use crate::cart::{CART, explained, record};
use crate::folder::Folder;

/// The values of a column of outputs changed one by one, with their place counted from 0 and their number.
fn with_outputs(folder: &Folder, name: &str, change: impl Fn(f64, usize, usize) -> f64) {
    let text = std::fs::read_to_string(folder.join(name)).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let count = lines.len() - 1;
    let mut changed = vec![lines[0].to_owned()];
    for (k, line) in lines[1..].iter().enumerate() {
        let (rest, y) = line.rsplit_once(',').unwrap();
        changed.push(format!("{rest},{}", change(y.parse().unwrap(), k, count)));
    }
    folder.text(name, &(changed.join("\n") + "\n"));
}

fn error(said: &serde_json::Value, step: &str) -> f64 {
    said["fit"]["heldout"][step]["rmse"].as_f64().unwrap()
}

#[test]
fn blocks_that_no_fit_has_seen_prove_the_answer() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    record(&folder, "log.csv", 1.1, |_, v, _| -2.5 * v * v.abs(), 1);
    let said = explained(&folder, "log.csv");
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    // The noise is 0.004.
    let (without, with) = (error(&said, "parameters_only"), error(&said, "augmented"));
    assert!(with < 0.0045 && without > 2.0 * with, "{without} {with}");
    assert_eq!(said["fit"]["heldout_blocks"].as_array().unwrap().len(), 3);
    let summary = said["summary"].to_string();
    assert!(
        summary.contains("without a third of the recording"),
        "{summary}"
    );
}

#[test]
fn one_wrong_value_is_no_effect() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    record(&folder, "log.csv", 1.1, |_, _, _| 0.0, 7);
    with_outputs(
        &folder,
        "log.csv",
        |y, k, count| {
            if k + 1 == count { y + 0.5 } else { y }
        },
    );
    let said = explained(&folder, "log.csv");
    assert!(
        said["effects"].as_array().unwrap().is_empty(),
        "{}",
        said["summary"]
    );
}

#[test]
fn a_sensor_that_loses_the_sign_is_named() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    record(&folder, "log.csv", 1.1, |_, _, _| 0.0, 3);
    with_outputs(&folder, "log.csv", |y, _, _| y.abs());
    let said = explained(&folder, "log.csv");
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    let effect = &said["effects"][0];
    assert_eq!(
        effect["effect"], "sensor_rectification",
        "{}",
        said["summary"]
    );
    assert_eq!(effect["enters"], "y");
}

/// A force that no equation can foresee is what an observer takes over, and with it whatever else is missing.
#[test]
fn no_answer_simulates_worse_than_the_plant_without_it() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    for seed in 1..=3_u32 {
        let phase = f64::from(seed);
        let pushed = move |_: f64, v: f64, t: f64| {
            let slow = (0.9 * t + phase).sin() + (0.37 * t * phase).cos() + (0.053 * t * t).sin();
            3.0 * slow - 1.5 * v * v.abs()
        };
        record(&folder, "log.csv", 1.1, pushed, u64::from(seed));
        let said = explained(&folder, "log.csv");
        if said["fit"]["heldout"].is_null() {
            assert!(said["effects"].as_array().unwrap().is_empty());
            continue;
        }
        let (without, with) = (error(&said, "parameters_only"), error(&said, "augmented"));
        assert!(
            with <= 1.03 * without,
            "{seed}: {without} {with} {}",
            said["summary"]
        );
    }
}
