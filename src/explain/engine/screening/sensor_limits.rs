//! A sensor at its limit shows nothing of what it measures: where it does, it does not saturate.
//!
//! Limits that cut off the free run of a plant that drifts away take much error off it, and are no physics.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::along::{along, every};
use crate::explain::engine::fitting::fitted::Fitted;
use crate::explain::engine::thresholds::LEFT;
use crate::physics::estimate::{PlantRecording, Study};

/// Fewer changes beyond a limit say nothing.
const FEWEST: usize = 8;

/// Whether a sensor that is said to saturate follows what it measures beyond its limits: its changes are correlated with those that it
/// would not show, at the level of the score tests. `study` is that of the plant with the term. Where it is least beyond a limit, errors
/// of the simulation decide whether it is, so that the half that is further beyond counts.
pub(in crate::explain::engine) fn shows_beyond_limits(
    fitted: &Fitted,
    study: &Study,
    recordings: &[PlantRecording],
) -> bool {
    let [lower, upper] = fitted.shapes[..] else {
        return false;
    };
    if fitted.lead.term.id != "sensor_saturation" {
        return false;
    }
    let spec = &study.plant().spec;
    let variable = fitted.lead.place.variable(spec);
    let output = spec.outputs().into_iter().position(|y| y == variable);
    let texts = [fitted.argument.clone()];
    let values = along((study, &fitted.fit), recordings, &texts).and_then(|mut all| all.pop());
    let (Some(output), Some(values)) = (output, values) else {
        return false;
    };
    let shown = recordings.iter().map(|r| {
        let y = &r.outputs[output];
        y.iter().copied().step_by(every(r)).collect::<Vec<f64>>()
    });
    // How far beyond a limit, and both changes.
    let mut beyond: Vec<(f64, f64, f64)> = Vec::new();
    let mut rest = &values[..];
    for shown in shown {
        let (hidden, later) = rest.split_at(shown.len().min(rest.len()));
        rest = later;
        for (z, y) in hidden.windows(2).zip(shown.windows(2)) {
            let excess = (z[0].min(z[1]) - upper).max(lower - z[0].max(z[1]));
            if excess > 0.0 && y.iter().all(|y| y.is_finite()) {
                beyond.push((excess, z[1] - z[0], y[1] - y[0]));
            }
        }
    }
    beyond.sort_by(|a, b| b.0.total_cmp(&a.0));
    beyond.truncate(beyond.len().div_ceil(2));
    let count = beyond.len() as f64;
    if beyond.len() < FEWEST {
        return false;
    }
    let mean = |of: &dyn Fn(&(f64, f64, f64)) -> f64| beyond.iter().map(of).sum::<f64>() / count;
    let (hidden, shown) = (mean(&|b| b.1), mean(&|b| b.2));
    let both = mean(&|b| (b.1 - hidden) * (b.2 - shown));
    let sizes = mean(&|b| (b.1 - hidden).powi(2)) * mean(&|b| (b.2 - shown).powi(2));
    let correlation = both / sizes.sqrt().max(f64::MIN_POSITIVE);
    let t = correlation * ((count - 2.0) / (1.0 - correlation * correlation).max(1e-12)).sqrt();
    StudentsT::new(0.0, 1.0, count - 2.0).is_ok_and(|law| law.sf(t) < LEFT)
}
