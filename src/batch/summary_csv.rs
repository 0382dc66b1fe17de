//! All rows as CSV.

use super::row::Row;

/// Decimals of the figures: fits to 0.001 %, times to a millisecond.
const DECIMALS: f64 = 1000.0;

/// The summary: a header line and a line a log.
///
/// # Errors
/// [`csv::Error`], which memory to write to does not give.
pub(crate) fn summary_csv(rows: &[Row]) -> Result<String, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        let rounded = |value: f64| (value * DECIMALS).round() / DECIMALS;
        writer.serialize(Row {
            fit_percent: row.fit_percent.map(rounded),
            free_run_fit_percent: row.free_run_fit_percent.map(rounded),
            seconds: rounded(row.seconds),
            ..row.clone()
        })?;
    }
    let bytes = writer
        .into_inner()
        .map_err(|error| csv::Error::from(error.into_error()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
