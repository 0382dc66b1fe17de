//! The page of a plant.

use super::super::tests::{is_sound, opens_offline, own};
use super::plant_page;
use crate::physics::estimate::{EstimateOptions, PlantRecording, estimate, evaluate};
use crate::physics::{Hold, Plant, parse};
use crate::report::PlantDocument;

fn page(description: &str, outputs: usize) -> String {
    let second = if outputs == 2 { "output Real z;" } else { "" };
    let equation = if outputs == 2 { "z = 2*x;" } else { "" };
    let text = format!(
        "model Lag \"{description}\" parameter Real T(unit=\"s\", min=0.1, max=9) = 1; parameter Real k = 1; input Real u \
         \"{description}\"; output Real y; {second} Real x(start=0); equation T*der(x) = k*u - x; y = x; {equation} end Lag;"
    );
    let plant = Plant::new(parse(&text).unwrap());
    let noise = |k: usize| 0.1 * ((k * k) as f64 * 0.7).sin();
    let u: Vec<f64> = (0..300)
        .map(|k| f64::from(u8::from(k / 20 % 3 == 0)))
        .collect();
    let mut x = 0.0;
    let y: Vec<f64> = (0..300)
        .map(|k| {
            let y = x + noise(k);
            x += 0.1 * (u[k] - x);
            y
        })
        .collect();
    let mut columns = vec![y.clone()];
    if outputs == 2 {
        columns.push(
            y.iter()
                .enumerate()
                .map(|(k, y)| 2.0 * y + noise(3 * k + 1))
                .collect(),
        );
    }
    let records = [PlantRecording {
        inputs: vec![u],
        outputs: columns,
        sample_time: 0.1,
        start_time: 0.0,
    }];
    let options = EstimateOptions {
        free: vec![true; 2],
        hold: Hold::Zero,
        form: None,
        least_squares: true,
    };
    let found = estimate(&plant, &records, &options).unwrap();
    let document = PlantDocument::new(&plant, &found, Hold::Zero);
    let (_, point) = document.plant().unwrap();
    let found = evaluate(&plant, &records, &document.held_with_starts(&plant, &point)).unwrap();
    plant_page(&plant, &document, &records, &found).unwrap()
}

#[test]
fn a_page_has_everything_and_loads_nothing() {
    let page = page("a lag", 2);
    opens_offline("plant", &page);
    is_sound("plant", &page);
    let own = own(&page);
    // Two outputs and an input; two residuals; two autocorrelations.
    assert_eq!(own.matches("class=\"drawing\"").count(), 3 + 2 + 2);
    assert!(own.contains("T*der(x) = k*u - x"));
}

#[test]
fn what_comes_from_files_is_escaped() {
    let page = page("<script>alert(1)</script><!-- & 'single'", 1);
    is_sound("evil", &page);
    let own = own(&page);
    assert!(!own.contains("<script>alert") && !own.contains("<!--"));
    assert!(own.contains("&lt;script&gt;alert"));
}
