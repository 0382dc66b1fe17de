//! The time base: what is accepted, what is refused and where.

use super::{fails, read, read_as, roles};
use crate::log::*;

/// A recording with these time stamps.
fn stamped(header: &str, times: impl IntoIterator<Item = f64>) -> Result<Log, LogError> {
    let mut csv = format!("{header},u,y\n");
    for time in times {
        csv.push_str(&format!("{time},1,2\n"));
    }
    read(&csv)
}

#[test]
fn honest_doubles_are_uniform() {
    for (step, count) in [
        (0.1, 50_000),
        (1.0 / 3.0, 50_000),
        (1e-6, 40_000),
        (0.01, 2),
        (2.5e-3, 16_384),
    ] {
        let log = stamped("t", (0..count).map(|k| k as f64 * step)).unwrap();
        assert!(
            (log.sample_time - step).abs() <= 1e-15 * step,
            "{step}: {}",
            log.sample_time
        );
        assert_eq!(log.start_time, 0.0);
    }
    assert_eq!(
        stamped("t", (0..1000).map(|k| f64::from(k) * 0.1))
            .unwrap()
            .sample_time,
        0.1
    );
    // A running sum of 0.1, seconds since 1970 with steps of 1 ms, and a start before zero.
    let mut sum = 0.0;
    stamped(
        "t",
        (0..100_000).map(|_| {
            sum += 0.1;
            sum
        }),
    )
    .unwrap();
    let log = stamped("t", (0..20_000).map(|k| 1.7e9 + f64::from(k) * 1e-3)).unwrap();
    // Seconds since 1970 count from the first.
    assert_eq!((log.sample_time, log.start_time), (1e-3, 0.0));
    assert_eq!(
        stamped("t", (0..50).map(|k| f64::from(k) * 0.5 - 3.0))
            .unwrap()
            .start_time,
        -3.0
    );
}

#[test]
fn rounded_stamps_are_averaged() {
    let log = stamped(
        "t",
        (0..10_000).map(|k| (f64::from(k) / 30.0 * 1e4).round() / 1e4),
    )
    .unwrap();
    assert!((log.sample_time - 1.0 / 30.0).abs() < 1e-8);
    // Sixty hertz in whole milliseconds jitters by two per cent of a sample.
    let rounded = stamped(
        "t",
        (0..1000).map(|k| (f64::from(k) / 60.0 * 1e3).round() / 1e3),
    )
    .unwrap();
    assert!((rounded.sample_time - 1.0 / 60.0).abs() < 1e-6);
}

#[test]
fn units_of_time_are_converted() {
    for (header, scale) in [
        ("t [ms]", 1e3),
        ("Time [us]", 1e6),
        ("TIME [min]", 1.0 / 60.0),
        ("time [s]", 1.0),
        ("Seconds", 1.0),
        ("hours", 1.0 / 3600.0),
        ("elapsed_ms", 1e3),
    ] {
        let log = stamped(header, (0..100).map(|k| f64::from(k) * 0.25 * scale)).unwrap();
        assert!(
            (log.sample_time - 0.25).abs() < 1e-12,
            "{header}: {}",
            log.sample_time
        );
    }
    fails(
        stamped("t [fortnight]", [0.0, 1.0]),
        &[
            "column `t [fortnight]`",
            "unknown time unit `fortnight`",
            "--dt",
        ],
    );
}

#[test]
fn faults_are_located() {
    let bent = |at: usize, by: f64| {
        stamped(
            "t",
            (0..40_000).map(move |k| k as f64 * 0.01 + if k >= at { by } else { 0.0 }),
        )
    };
    fails(
        bent(100, 0.0048),
        &[
            "run.csv, line 102, column `t`",
            "irregular",
            "0.0148 s where 0.01",
            "`--resample 0.01",
        ],
    );
    // Small shifts are jitter, and one missing sample is interpolated.
    assert_eq!(bent(100, 0.0015).unwrap().samples(), 40_000);
    assert_eq!(bent(30_000, 0.01).unwrap().samples(), 40_001);
    fails(
        bent(30_000, 0.5),
        &["30000 samples from 0 s", "10000 samples from 300.5 s"],
    );
    // Three samples before a gap are too few for a recording of their own.
    assert_eq!(bent(3, 60.0).unwrap().samples(), 39_997);
    fails(bent(1, -5.0), &["line 3", "from 0 s to -4.99 s"]);
    fails(stamped("t", [1.0, 1.0, 1.0]), &["line 3", "must increase"]);
    fails(stamped("t", [3.0, 2.0, 1.0]), &["line 3", "must increase"]);
    fails(
        read("t,u,y\n2026-01-01T00:00:00,1,2\n"),
        &["run.csv: 1 samples", "--dt"],
    );
    fails(
        read("t,u,y\n0,1,2\nmonday,1,2\n2,1,2\n"),
        &["line 3, column `t`", "`monday` is not a number"],
    );
}

#[test]
fn a_slow_drift_is_seen() {
    // From 100 Hz to 100.9 Hz: no step is off by one per cent.
    let drift = stamped(
        "t",
        (0..20_000).map(|k| {
            let k = f64::from(k);
            0.01 * k + 0.45 * 1e-6 * 0.5 * k * k * 0.01
        }),
    );
    fails(
        drift,
        &[
            "run.csv, line ",
            "column `t`",
            "drifts",
            "uniform step",
            "--resample",
        ],
    );
    // A crystal that is off by 50 millionths while it warms up.
    stamped(
        "t",
        (0..20_000).map(|k| {
            let t = f64::from(k) * 0.01;
            t + 50e-6 * 20.0 * (1.0 - (-t / 20.0).exp())
        }),
    )
    .unwrap();
}

#[test]
fn a_given_sample_time_ignores_the_time_column() {
    let asked = Roles {
        sample_time: Some(0.5),
        ..Roles::default()
    };
    let log = read_as("time,u,y\nmonday,1,2\nmonday,2,3\n", &asked).unwrap();
    assert_eq!(
        (log.sample_time, log.start_time, log.samples()),
        (0.5, 0.0, 2)
    );
    assert_eq!(read_as("u,y\n1,2\n", &asked).unwrap().samples(), 1);
}

#[test]
fn a_column_t_is_the_time_and_no_temperature() {
    let csv = "t,u,T\n0,1,20\n1,1,21\n2,1,22\n";
    let log = read_as(csv, &roles("u", "T")).unwrap();
    assert_eq!((log.sample_time, log.output_data[0][2]), (1.0, 22.0));
    let error = read_as("t,u,y\n0,1,20\n1,1,21\n", &roles("u", "T")).unwrap_err();
    assert!(error.to_string().contains("no column `T`"), "{error}");
}
