//! Writes a recording of Example I in closed loop as CSV, of any length in constant memory:
//! `long_log SAMPLES [COPIES [DECIMALS]]`.
//!
//! `long_log 1000000 > log.csv` writes all digits; `long_log 20000 8` has 8 copies of the plant side by side, 16 inputs
//! and 16 outputs; `long_log 100000000 1 4` has four decimals, as a logger has.

use std::path::Path;

use innovant::internal::systems::{channels, van_wingerden_one};
use innovant::log::{Block, CsvWriter};

/// Samples written at a time.
const BLOCK: usize = 16_384;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: usize| arguments.next().map_or(Ok(default), |text| text.parse());
    let (samples, copies) = (number(1_000_000)?, number(1)?);
    let steps = arguments
        .next()
        .map(|text| text.parse().map(|digits| 10_f64.powi(digits)));
    let steps: Option<f64> = steps.transpose()?;
    let rounded = |value: f64| steps.map_or(value, |steps| (value * steps).round() / steps);
    let plant = van_wingerden_one().side_by_side(copies);
    let (inputs, outputs) = (plant.system.inputs(), plant.system.outputs());
    let (u, y) = (channels('u', inputs), channels('y', outputs));
    let sample_time = plant.system.sample_time;
    let mut writer = CsvWriter::create(Path::new("-"), sample_time, 0.0, u.iter().chain(&y))?;
    let mut recording = plant.samples(1).take(samples);
    let mut left = samples;
    while left > 0 {
        let mut block = Block::new();
        block.columns = vec![Vec::with_capacity(BLOCK); inputs + outputs];
        for (u, y) in recording.by_ref().take(BLOCK) {
            for (column, value) in block.columns.iter_mut().zip(u.iter().chain(y.iter())) {
                column.push(rounded(*value));
            }
        }
        left -= block.len();
        writer.write_block(&block.columns)?;
    }
    writer.finish()?;
    Ok(())
}
