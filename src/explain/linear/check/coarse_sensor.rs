//! A sensor of coarse resolution.

use crate::explain::linear::data::{Data, Series};
use crate::log::spacing;
use crate::noise::Mask;

/// Share of the innovation variance that rounding to levels must make up to be named.
pub(crate) const COARSE: f64 = 0.25;

/// An output on a lattice so coarse that rounding is a good part of the residual: `(output, step, share)`.
pub(crate) fn coarse_sensor(
    data: &Data,
    residual: &Series,
    mask: &Mask,
) -> Option<(usize, f64, f64)> {
    data.outputs_as_series()
        .enumerate()
        .filter_map(|(series, y)| {
            // Samples that are left out were not read from the sensor.
            let read: Vec<f64> = y
                .iter()
                .zip(&mask[series])
                .filter_map(|(y, keep)| keep.then_some(*y))
                .collect();
            let step = spacing(&read)?;
            let counted = residual[series]
                .iter()
                .zip(&mask[series])
                .filter_map(|(e, keep)| keep.then_some(e * e));
            let (sum, n) = counted.fold((0.0, 0usize), |(sum, n), e| (sum + e, n + 1));
            let variance = sum / n.max(1) as f64;
            // Variance of rounding: step^2/12.
            let share = step * step / 12.0 / variance.max(1e-300);
            (share > COARSE).then_some((series % data.outputs, step, share))
        })
        .max_by(|a, b| a.2.total_cmp(&b.2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::linear::fit::{Fit, Problem};
    use crate::explain::linear::fixtures::{NOISE, recorded, spring};

    #[test]
    fn a_lattice_is_told_of_where_rounding_is_much_of_what_is_left() {
        let structure = spring(Vec::new());
        let clean = recorded(&structure, &[], 3);
        for step in [0.0, 0.02, 0.2, 0.4] {
            let mut data = clean.clone();
            if step > 0.0 {
                for y in &mut data.segments[0].outputs[0] {
                    *y = (*y / step).round() * step;
                }
            }
            let problem = Problem::new(&data);
            let fit = Fit::at(&problem, structure.clone(), Vec::new()).unwrap();
            let rounding = step * step / 12.0;
            let expected = rounding / (rounding + NOISE * NOISE);
            match coarse_sensor(&data, &fit.residual, &problem.mask) {
                None => assert!(expected < COARSE, "{step}"),
                Some((output, found, share)) => {
                    assert!(expected > COARSE && output == 0, "{step}");
                    assert!((found / step - 1.0).abs() < 1e-6, "{found}");
                    // A coarse lattice takes some of the noise with it.
                    let ratio = share / expected;
                    assert!((0.85..1.25).contains(&ratio), "{step}: {ratio}");
                }
            }
        }
    }
}
