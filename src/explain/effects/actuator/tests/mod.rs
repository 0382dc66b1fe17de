//! Starts of actuators.

use super::*;

fn seen(channel: Vec<f64>) -> Observed {
    Observed {
        channel,
        rate: Vec::new(),
        step: 0.5,
        change_times: Vec::new(),
        lines: Vec::new(),
        frequencies: Vec::new(),
    }
}

#[test]
fn levels_to_start_from_lie_within_what_was_seen() {
    // All over, and on a plateau: there is something above each level, and something below.
    let all_over: Vec<f64> = (0..=1000).map(|k| f64::from(k) / 500.0 - 1.0).collect();
    let plateau: Vec<f64> = (0..1000)
        .map(|k| if k % 3 == 0 { 0.1 } else { -3.0 })
        .collect();
    for (channel, top) in [(all_over, 1.0), (plateau, 3.0)] {
        let levels: Vec<f64> = reached(&seen(channel)).into_iter().map(|l| l[0]).collect();
        assert!(
            levels.windows(2).all(|pair| pair[0] < pair[1]),
            "{levels:?}"
        );
        assert!(
            levels.iter().all(|l| (0.3 * top..top).contains(l)),
            "{levels:?}"
        );
    }
    // Rates a second, up to the fastest.
    let ramp: Vec<f64> = (0..100).map(|k| 0.02 * f64::from(k * k)).collect();
    let fastest = 0.02 * f64::from(99 * 99 - 98 * 98) / 0.5;
    let found = super::super::command::rates(&seen(ramp));
    assert!(found.len() > 4);
    assert!(
        found
            .iter()
            .all(|r| (0.09 * fastest..fastest).contains(&r[0])),
        "{found:?}"
    );
    assert!(found.iter().any(|r| r[0] > 0.9 * fastest));
    assert!(super::super::command::rates(&seen(vec![1.0; 9])).is_empty());
}
