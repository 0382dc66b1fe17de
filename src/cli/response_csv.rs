//! Frequency responses as CSV.

use crate::covariance::ResponsePoint;

/// A row for each point; the innovation of output y is the input `e(y)`.
pub(super) fn response_csv<'a>(
    points: impl Iterator<Item = &'a ResponsePoint>,
) -> anyhow::Result<String> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    csv.write_record([
        "rad_s",
        "hz",
        "output",
        "input",
        "real",
        "imag",
        "variance_real",
        "covariance_real_imag",
        "variance_imag",
        "magnitude",
        "magnitude_95_low",
        "magnitude_95_high",
        "magnitude_99_low",
        "magnitude_99_high",
        "phase_rad",
        "phase_95_low",
        "phase_95_high",
    ])?;
    for point in points {
        csv.write_record(record(point))?;
    }
    Ok(String::from_utf8(csv.into_inner()?)?)
}

fn record(point: &ResponsePoint) -> [String; 17] {
    let number = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
    let end = |band: Option<[f64; 2]>, end: usize| number(band.map(|b| b[end]));
    let covariance = |i: usize, j: usize| number(point.covariance.map(|c| c[i][j]));
    [
        point.rad_s.to_string(),
        point.hz.to_string(),
        point.output.clone(),
        point.input.clone(),
        number(point.real),
        number(point.imag),
        covariance(0, 0),
        covariance(0, 1),
        covariance(1, 1),
        number(point.magnitude),
        end(point.magnitude_95, 0),
        end(point.magnitude_95, 1),
        end(point.magnitude_99, 0),
        end(point.magnitude_99, 1),
        number(point.phase_rad),
        end(point.phase_95, 0),
        end(point.phase_95, 1),
    ]
}
