//! Writes a long recording of Example I in closed loop as CSV: `long_log 1000000 > log.csv`.

use std::path::Path;

use innovant::systems::van_wingerden_one;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let samples = std::env::args()
        .nth(1)
        .map_or(Ok(1_000_000), |text| text.parse())?;
    van_wingerden_one()
        .record(samples, 1)
        .write_csv(Path::new("-"))?;
    Ok(())
}
