//! Seconds of an identification of Example I in closed loop, best of fifteen: alone, and with the residual tests.
//! `cargo run --release --example time_identify -- 1000000 20`

use std::time::Instant;

use innovant::identify::MemoryRecords;
use innovant::internal::systems;
use innovant::validate::identify_and_test;
use innovant::{Options, identify};

const RUNS: usize = 15;

fn best(
    mut run: impl FnMut() -> Result<(), innovant::IdentifyError>,
) -> Result<f64, innovant::IdentifyError> {
    let mut best = f64::INFINITY;
    for _ in 0..RUNS {
        let started = Instant::now();
        run()?;
        best = best.min(started.elapsed().as_secs_f64());
    }
    Ok(best)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let samples = arguments.next().map_or(Ok(1_000_000), |a| a.parse())?;
    let past = arguments.next().map_or(Ok(20), |a| a.parse())?;
    let logs = [systems::van_wingerden_one().record(samples, 1)];
    let options = Options {
        past: Some(past),
        ..Options::default()
    };
    let plain = best(|| identify(&logs, &options).map(drop))?;
    let tested = best(|| identify_and_test(&mut MemoryRecords::new(&logs)?, &options).map(drop))?;
    println!("{plain} {tested}");
    Ok(())
}
