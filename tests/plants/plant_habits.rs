//! What recordings of ordinary plants are like: dates in every file, thermostats, rates that nothing pulls back.

use std::fmt::Write;

use crate::folder::{Folder, effects};
use crate::plant_initial_states::noise;

/// Gas in the air of a town, one value a day, with a season.
fn season(days: std::ops::Range<usize>, seed: u64) -> (String, Vec<f64>) {
    let mut normal = noise(seed);
    let mut log = String::from("date,ppm\n");
    let turn = std::f64::consts::TAU / 365.25;
    let truth = days.map(|day| 400.0 + 0.01 * day as f64 + 4.0 * (turn * day as f64).sin());
    let truth: Vec<f64> = truth.collect();
    truth
        .iter()
        .for_each(|y| writeln!(log, "DATE,{:.4}", y + 0.4 * normal()).unwrap());
    (log, truth)
}

/// The days of a log as dates from 2003-05-03 on, with this many days before the first.
fn dated(log: &str, before: usize) -> String {
    let first = jiff::civil::date(2003, 5, 3);
    let mut text = String::new();
    for (k, line) in log.lines().enumerate() {
        let day = i64::try_from(before + k).unwrap() - 1;
        let date = first.checked_add(jiff::Span::new().days(day)).unwrap();
        writeln!(text, "{}", line.replace("DATE", &date.to_string())).unwrap();
    }
    text
}

/// A season is one of dates: a later recording begins at another part of it. And a rate that is a number has an equation, which a
/// disturbance may enter.
#[test]
fn a_season_is_predicted_by_the_date() {
    let folder = Folder::new();
    folder.text(
        "air.mo",
        "model Air\n  parameter Real r(min=0, max=1e-6) = 1e-7;\n  output Real ppm;\n  Real x(start=400);\nequation\n  der(x) = r;\n  ppm = x;\nend Air;\n",
    );
    let (log, _) = season(0..1100, 3);
    folder.text("log.csv", &dated(&log, 0));
    let (later, truth) = season(1250..1500, 4);
    folder.text("later.csv", &dated(&later, 1250));
    let said = folder.explained("log.csv", "air.mo", &[]);
    assert_eq!(
        effects(&said),
        ["periodic_disturbance"],
        "{}",
        said["summary"]
    );
    let run = [
        "simulate",
        "e.json",
        "later.csv",
        "--initial-state",
        "estimate",
    ];
    folder
        .run(&[&run[..], &["--output", "foretold.csv"]].concat())
        .ok();
    let foretold = std::fs::read_to_string(folder.join("foretold.csv")).unwrap();
    let rows = foretold.lines().skip(1);
    let values = rows.map(|row| row.split(',').nth(1).unwrap().parse::<f64>().unwrap());
    let squares = values.zip(&truth).map(|(s, y)| (s - y).powi(2));
    let error = (squares.sum::<f64>() / truth.len() as f64).sqrt();
    assert!(error < 0.5, "{error}");
}

/// Water that is drawn makes the thermostat switch earlier. Neither is in the simulator, and no sensor saturates.
#[test]
fn a_thermostat_reacts_to_what_no_column_shows() {
    let folder = Folder::new();
    folder.text(
        "boiler.mo",
        "model Boiler\n  parameter Real C(unit=\"J/K\", min=500, max=2500) = 1200;\n  parameter Real G(unit=\"W/K\", min=0.5, max=6) = 2;\n  input Real P(unit=\"W\");\n  output Real T(unit=\"degC\");\n  Real x(unit=\"degC\", start=20);\nequation\n  C*der(x) = P - G*(x - 22);\n  T = x;\nend Boiler;\n",
    );
    let mut normal = noise(11);
    let (mut x, mut sensor, mut on) = (21.0_f64, 21.0_f64, true);
    let mut log = String::from("t,P,T\n");
    for k in 0..2400 {
        let shown = ((sensor + 0.05 * normal()) * 4.0).round() / 4.0;
        on = shown < 91.0 || on && shown <= 94.0;
        let power = if on { 1150.0 } else { 0.0 };
        writeln!(log, "{k},{power},{shown}").unwrap();
        let draws = k > 700 && k % 600 > 500;
        for _ in 0..10 {
            let drawn = if draws { 3.6 * (x - 15.0) } else { 0.0 };
            x += 0.1 * (power - 2.6 * (x - 22.0) - drawn) / 1450.0;
            sensor += 0.1 * (x - sensor) / 9.0;
        }
    }
    folder.text("log.csv", &log);
    let said = folder.explained("log.csv", "boiler.mo", &[]);
    assert_eq!(said["verdict"], "unexplained", "{}", said["summary"]);
}
