//! Other parameters that are a wrong time base: every rate of the plant differs by one factor, and nothing else does.

use crate::explain::linear::model::linear_plant::Plant;
use crate::linalg::eigenvalues;
use crate::model::StateSpace;

/// Clocks are not further off.
const MOST: f64 = 0.03;
/// Rates that differ by less are no change.
const LEAST: f64 = 1e-3;
/// Rates agree to this share of their change, as far as a fit determines them.
const ALIKE: f64 = 0.25;
/// Dampings and static gains that differ by less have not changed.
const UNCHANGED: f64 = 0.02;

/// Poles as rate and damping ratio (cosine of the angle to the negative real axis), per sample, by rising rate.
fn poles(plant: &Plant) -> Option<Vec<(f64, f64)>> {
    let mut poles: Vec<(f64, f64)> = eigenvalues(&plant.a_matrix())
        .ok()?
        .iter()
        .map(|z| {
            let p = z.ln();
            (p.norm(), -p.re / p.norm().max(1e-300))
        })
        .collect();
    poles.sort_by(|a, b| a.0.total_cmp(&b.0));
    poles.iter().all(|p| p.0.is_finite()).then_some(poles)
}

fn static_gains(plant: &Plant) -> Option<nalgebra::DMatrix<f64>> {
    StateSpace::deterministic(
        plant.a_matrix(),
        plant.b_matrix(),
        plant.c_matrix(),
        plant.d_matrix(),
        plant.sample_time,
    )
    .ok()?
    .static_gain()
}

/// What is said where the plant `after` is `before` on another clock; `signals` are the inputs that are no constant.
pub(crate) fn same_factor(before: &Plant, after: &Plant, signals: usize) -> Option<String> {
    let (given, found) = (poles(before)?, poles(after)?);
    if given.len() != found.len() || given.is_empty() {
        return None;
    }
    let fastest = given.last()?.0;
    let ratios: Vec<(f64, f64)> = given
        .iter()
        .zip(&found)
        // What integrates has no rate.
        .filter(|(b, _)| b.0 > 1e-6 * fastest)
        .map(|(b, a)| (a.0 / b.0, a.1 - b.1))
        .collect();
    let mean = ratios.iter().map(|r| r.0).sum::<f64>() / ratios.len().max(1) as f64;
    let change = mean - 1.0;
    if !(LEAST..MOST).contains(&change.abs())
        || ratios
            .iter()
            .any(|r| (r.0 - mean).abs() > ALIKE * change.abs() || r.1.abs() > UNCHANGED)
    {
        return None;
    }
    if let (Some(before), Some(after)) = (static_gains(before), static_gains(after)) {
        let largest = before.columns(0, signals).amax();
        let moved = (after.columns(0, signals) - before.columns(0, signals)).amax();
        if moved > UNCHANGED * largest {
            return None;
        }
    }
    Some(format!(
        "All natural frequencies (rates) of the recording are {:.1} % {} than the simulation's, and damping and static gains hardly differ: a clock (time base, sample time) that is wrong by as much looks the same.",
        100.0 * change.abs(),
        if change > 0.0 { "higher" } else { "lower" }
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mass on a spring of natural frequency `rate` a sample, exact at the samples, gain 1.
    fn spring(rate: f64, damping: f64, gain: f64) -> Plant {
        let (re, im) = (-damping * rate, rate * (1.0 - damping * damping).sqrt());
        let (size, c, s) = (re.exp(), im.cos(), im.sin());
        // The modal form; the input is scaled to the static gain.
        let a = vec![size * c, size * s, -size * s, size * c];
        let mut plant = Plant {
            states: 2,
            inputs: 1,
            outputs: 1,
            a,
            b: vec![0.0, 1.0],
            c: vec![1.0, 0.0],
            d: vec![0.0],
            sample_time: 0.1,
        };
        let now = static_gains(&plant).unwrap()[(0, 0)];
        plant.b[1] *= gain / now;
        plant
    }

    #[test]
    fn a_clock_changes_all_rates_and_nothing_else() {
        let given = spring(0.3, 0.1, 2.0);
        let said = same_factor(&given, &spring(0.303, 0.1, 2.0), 1).unwrap();
        assert!(
            said.contains("1.0 % higher") && said.contains("clock"),
            "{said}"
        );
        // Another damping, another gain, no change, or one that no clock makes.
        for other in [
            spring(0.303, 0.2, 2.0),
            spring(0.303, 0.1, 2.2),
            spring(0.3, 0.1, 2.0),
            spring(0.33, 0.1, 2.0),
        ] {
            assert_eq!(same_factor(&given, &other, 1), None);
        }
    }
}
