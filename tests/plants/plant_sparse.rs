//! Recordings with values that are missing, and at irregular times.

use std::fmt::Write;

use crate::folder::{Folder, columns};
use crate::plant_few_samples::BOLUS;
use crate::plant_initial_states::noise;

/// Water that a heater warms, with the loss to the room.
const KETTLE: &str = r#"model Kettle
  parameter Real C(unit="J/K", min=500, max=5000) = 2000;
  parameter Real G(unit="W/K", min=0.1, max=20) = 4;
  input Real u(unit="W");
  output Real y(unit="degC");
  Real T(unit="degC", start=20);
equation
  C*der(T) = u - G*(T - 20);
  y = T;
end Kettle;
"#;

/// Hours after a dose.
const HOURS: [f64; 14] = [
    0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0,
];

#[test]
fn irregular_times_are_compared_where_they_are() {
    let folder = Folder::new();
    folder.text("plant.mo", BOLUS);
    let mut normal = noise(5);
    let mut text = String::from("t [h],y [mg/l]\n");
    for h in HOURS {
        writeln!(
            text,
            "{h},{:.3}",
            12.0 * (-0.45 * h).exp() + 0.05 * normal()
        )
        .unwrap();
    }
    folder.text("log.csv", &text);
    let run = folder.run(&[
        "identify",
        "log.csv",
        "--structure",
        "plant.mo",
        "--output",
        "m.json",
    ]);
    assert!(run.stderr.contains("on a grid of 900 s"), "{}", run.stderr);
    let said = crate::folder::json(&folder.join("m.json"));
    let ke = &said["parameters"][0];
    let (value, std) = (ke["value"].as_f64().unwrap(), ke["std"].as_f64().unwrap());
    // By the derivatives at the true values 0.0028, if the size of the noise is known.
    assert!(
        (value - 0.45).abs() < 3.0 * std && std > 0.0014 && std < 0.0056,
        "{ke}"
    );
    assert!(said["fit"][0]["free_run_percent"].as_f64().unwrap() > 97.0);

    let said = folder.explained("log.csv", "plant.mo", &[]);
    assert!(
        ["parameters", "consistent"].contains(&said["verdict"].as_str().unwrap()),
        "{said}"
    );
}

/// What is not measured is not interpolated: the deviations are those of the values that are there.
#[test]
fn missing_outputs_leave_the_recording_whole() {
    let folder = Folder::new();
    folder.text("plant.mo", KETTLE);
    let (mut normal, mut warm) = (noise(2), 20.0_f64);
    let (mut every, mut fourth) = (String::from("t,u,y\n"), String::from("t,u,y\n"));
    for k in 0..1200 {
        let u = if (k / 150) % 2 == 0 { 300.0 } else { 80.0 };
        let y = warm + 0.1 * normal();
        writeln!(every, "{},{u},{y:.3}", 5 * k).unwrap();
        match k % 4 {
            0 => writeln!(fourth, "{},{u},{y:.3}", 5 * k).unwrap(),
            _ => writeln!(fourth, "{},{u},", 5 * k).unwrap(),
        }
        let settled = 20.0 + u / 3.0;
        warm = settled + (warm - settled) * (-5.0 * 3.0 / 1500.0_f64).exp();
    }
    folder.text("every.csv", &every);
    folder.text("fourth.csv", &fourth);
    let std = |log: &str| {
        let run = folder.run(&[
            "identify",
            log,
            "--structure",
            "plant.mo",
            "--output",
            "m.json",
        ]);
        run.ok();
        let said = crate::folder::json(&folder.join("m.json"));
        assert_eq!(said["recordings"].as_array().unwrap().len(), 1);
        let of = |i: usize, truth: f64| {
            let p = &said["parameters"][i];
            let (value, std) = (p["value"].as_f64().unwrap(), p["std"].as_f64().unwrap());
            assert!((value - truth).abs() < 3.5 * std, "{log}: {p}");
            std
        };
        of(0, 1500.0);
        of(1, 3.0)
    };
    let ratio = std("fourth.csv") / std("every.csv");
    assert!((ratio - 2.0).abs() < 0.4, "{ratio}");

    // The rows without an output are predicted.
    let forecast = fourth
        .lines()
        .take(900)
        .map(|row| format!("{row}\n"))
        .collect::<String>();
    let rest = every.lines().skip(900).map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        format!("{},{},\n", cells[0], cells[1])
    });
    folder.text("forecast.csv", &(forecast + &rest.collect::<String>()));
    let simulated = folder.run(&[
        "simulate",
        "m.json",
        "forecast.csv",
        "--initial-state",
        "estimate",
    ]);
    let simulated = columns(&simulated.ok()).1;
    let recorded = columns(&every).1;
    let errors = simulated[1]
        .iter()
        .zip(&recorded[2])
        .map(|(s, y)| (s - y).powi(2));
    assert_eq!(simulated[1].len(), 1200);
    assert!((errors.sum::<f64>() / 1200.0).sqrt() < 0.13);
}

/// The search sees an effect through the same values.
#[test]
fn an_effect_is_found_in_a_recording_with_missing_values() {
    let folder = Folder::new();
    folder.text("plant.mo", KETTLE);
    let (mut normal, mut warm) = (noise(4), 20.0_f64);
    let mut text = String::from("t;u;y\n");
    for k in 0..900 {
        let u = [400.0, 90.0, 700.0][(k / 75) % 3];
        let y = warm + 0.1 * normal();
        match k % 5 < 2 || (300..340).contains(&k) {
            true => writeln!(text, "{};{u};", 5 * k).unwrap(),
            false => writeln!(text, "{};{u};{y:.2}", 5 * k).unwrap(),
        }
        let kelvin = |t: f64| (t + 273.15).powi(4);
        for _ in 0..50 {
            let loss = 1.5 * (warm - 20.0) + 2.5e-8 * (kelvin(warm) - kelvin(20.0));
            warm += 0.1 * (u - loss) / 1500.0;
        }
    }
    folder.text("log.csv", &text);
    let said = folder.explained("log.csv", "plant.mo", &[]);
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    assert_eq!(said["recordings"].as_array().unwrap().len(), 1);
    let effect = said["effects"][0]["effect"].as_str().unwrap();
    assert!(
        ["radiation", "law"].contains(&effect),
        "{}",
        said["summary"]
    );
    let fit = &said["fit"]["train"]["augmented"]["fit_percent"];
    assert!(fit.as_f64().unwrap() > 98.0, "{}", said["summary"]);

    // What was written with values missing can be read again.
    let again = folder.run(&["simulate", "e.json", "log.csv", "--inputs", "u"]);
    let rows = columns(&again.ok()).1;
    assert_eq!(rows[1].len(), 900);
}
