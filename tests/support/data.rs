//! How the recordings of `data/` are made: simulated test systems, operating points added, rounded as a
//! data logger would.

use innovant::internal::systems;
use innovant::log::{Channel, Log};

/// File names and contents.
pub fn recordings() -> Vec<(&'static str, String)> {
    vec![
        ("closed_loop.csv", closed_loop()),
        ("servo.csv", servo("servo", 2)),
        ("servo_check.csv", servo("servo", 3)),
        ("two_by_two.csv", two_by_two()),
    ]
}

fn closed_loop() -> String {
    let log = systems::van_wingerden_one().record(2000, 1);
    table(&log, &[0.0; 4], 6)
}

/// Steps of the voltage between two levels, held for at least 10 ms.
fn servo(name: &str, seed: u64) -> String {
    let mut level = 1.0;
    let mut log = systems::servo().record_with(4000, seed, |k, _, white| {
        if k % 10 == 0 {
            level = if white > 0.0 { 1.0 } else { -1.0 };
        }
        level
    });
    log.name = name.to_owned();
    log.inputs = vec![Channel::parse("voltage [V]")];
    log.outputs = vec![Channel::parse("speed [rad/s]")];
    table(&log, &[1.5, 100.0], 4)
}

fn two_by_two() -> String {
    let mut held = [0.0; 2];
    let mut log = systems::two_by_two().record_with(3000, 4, |k, channel, white| {
        if k % 5 == 0 {
            held[channel] = white;
        }
        held[channel]
    });
    log.inputs = vec![
        Channel::parse("u_heater [kW]"),
        Channel::parse("u_pump [V]"),
    ];
    log.outputs = vec![
        Channel::parse("y_temperature [K]"),
        Channel::parse("y_level [cm]"),
    ];
    table(&log, &[20.0, 5.0, 350.0, 42.0], 5)
}

/// CSV text with a time column, levels added, `digits` decimals.
fn table(log: &Log, levels: &[f64], digits: usize) -> String {
    let mut out = String::from("t");
    for channel in log.inputs.iter().chain(&log.outputs) {
        out.push(',');
        out.push_str(&channel.to_string());
    }
    out.push('\n');
    for k in 0..log.samples() {
        // Milliseconds as integers, so that the time stamps are exact decimals.
        let milliseconds = (k as f64 * log.sample_time * 1e3).round() as u64;
        out.push_str(&format!(
            "{}.{:03}",
            milliseconds / 1000,
            milliseconds % 1000
        ));
        for (column, level) in log.input_data.iter().chain(&log.output_data).zip(levels) {
            out.push_str(&format!(",{:.digits$}", column[k] + level));
        }
        out.push('\n');
    }
    out
}
