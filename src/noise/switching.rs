//! Whether an input that switches between two values does so by what the outputs do: a thermostat, a level switch, a bang-bang controller.
//!
//! Its values say little that residuals could foretell: it holds nearly always, and switches at one level of an output. Of the phases
//! that have lasted as long, those end first whose output is farthest on. That is a score test of Cox's partial likelihood
//! (D. R. Cox, *J. R. Statist. Soc. B* 34, 1972), with the duration of a phase as the age, and the outputs at the sample before as
//! covariates. Simulated outputs are functions of the input's past: what an output tells beyond them is feedback.

use nalgebra::{Matrix2, Vector2};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{Mask, Series};

/// Probability by chance below which outputs say when an input switches, for all inputs and outputs together.
const LEVEL: f64 = 1e-6;
/// Values this near to one of two levels, as a part of their distance, are at it; most values of an input that switches are.
const AT_LEVEL: f64 = 0.1;
const MOST: f64 = 0.98;

/// The inputs that switch by what the outputs do beyond the simulated ones; `inputs` are columns of each recording.
pub(crate) fn inputs_switched(
    recorded: &Series,
    simulated: &Series,
    mask: &Mask,
    inputs: &[&[Vec<f64>]],
) -> Vec<usize> {
    let count = inputs.first().map_or(0, |columns| columns.len());
    let outputs = recorded.len() / inputs.len().max(1);
    let tests = (count * outputs) as f64;
    let switches = |input: &usize| {
        let columns: Vec<&[f64]> = inputs.iter().map(|c| &c[*input][..]).collect();
        let Some(phases) = phases(&columns) else {
            return false;
        };
        (0..outputs).any(|output| {
            let at = |recording: usize, k: usize| {
                let column = recording * outputs + output;
                let both = Vector2::new(recorded[column][k], simulated[column][k]);
                (mask[column][k] && both.iter().all(|v| v.is_finite())).then_some(both)
            };
            p_value(&phases, &at).is_some_and(|p| p * tests < LEVEL)
        })
    };
    (0..count).filter(switches).collect()
}

/// Samples during which an input holds one of its two values.
struct Phase {
    recording: usize,
    first: usize,
    samples: usize,
    high: bool,
    /// Whether it ends by switching, not with the recording.
    ends: bool,
}

/// The phases of an input of two values, without those that had begun before the recording; none where it has other values.
fn phases(columns: &[&[f64]]) -> Option<Vec<Phase>> {
    let all = || columns.iter().flat_map(|u| u.iter().copied());
    let low = all().fold(f64::INFINITY, f64::min);
    let high = all().fold(f64::NEG_INFINITY, f64::max);
    let range = high - low;
    if !range.is_finite() || range <= 0.0 {
        return None;
    }
    let (total, at) = all().fold((0.0, 0.0), |(total, at), u| {
        let near = (u - low).min(high - u) <= AT_LEVEL * range;
        (total + 1.0, at + f64::from(u8::from(near)))
    });
    if at < MOST * total {
        return None;
    }
    let mut phases: Vec<Phase> = Vec::new();
    for (recording, u) in columns.iter().enumerate() {
        let high = |k: usize| u[k] > low + 0.5 * range;
        let switches: Vec<usize> = (1..u.len()).filter(|&k| high(k) != high(k - 1)).collect();
        for (i, &first) in switches.iter().enumerate() {
            let next = switches.get(i + 1);
            phases.push(Phase {
                recording,
                first,
                samples: next.unwrap_or(&u.len()) - first,
                high: high(first),
                ends: next.is_some(),
            });
        }
    }
    Some(phases)
}

/// Probability by chance of what the recorded output says beyond the simulated one about when phases end; `at` gives both, of a recording
/// at a sample.
fn p_value(phases: &[Phase], at: &dyn Fn(usize, usize) -> Option<Vector2<f64>>) -> Option<f64> {
    let (mut statistic, mut degrees) = (0.0, 0.0);
    for high in [true, false] {
        let of_kind: Vec<&Phase> = phases.iter().filter(|p| p.high == high).collect();
        let mut ages: Vec<usize> = (of_kind.iter().filter(|p| p.ends))
            .map(|p| p.samples)
            .collect();
        ages.sort_unstable();
        ages.dedup();
        let (mut score, mut information) = (Vector2::zeros(), Matrix2::zeros());
        for age in ages {
            // Those that have lasted as long, and whether they end now.
            let lasting: Vec<(Vector2<f64>, bool)> = (of_kind.iter())
                .filter(|p| p.samples >= age)
                .filter_map(|p| {
                    let before = at(p.recording, p.first + age - 1)?;
                    Some((before, p.ends && p.samples == age))
                })
                .collect();
            let count = lasting.len() as f64;
            let ending = lasting.iter().filter(|(_, ends)| *ends).count() as f64;
            if count < 2.0 {
                continue;
            }
            let mean = lasting.iter().map(|(z, _)| z).sum::<Vector2<f64>>() / count;
            // Ties: as many end as do, whichever they are (the hypergeometric distribution).
            let weight = ending * (count - ending) / (count * (count - 1.0));
            for (z, ends) in &lasting {
                let z = z - mean;
                information += weight * z * z.transpose();
                score += if *ends { z } else { Vector2::zeros() };
            }
        }
        let slope = match information[(1, 1)] > 0.0 {
            true => information[(0, 1)] / information[(1, 1)],
            false => 0.0,
        };
        let variance = information[(0, 0)] - slope * information[(0, 1)];
        // Below rounding, the outputs of all phases are the same.
        if variance > 1e-9 * information[(0, 0)] {
            statistic += (score[0] - slope * score[1]).powi(2) / variance;
            degrees += 1.0;
        }
    }
    ChiSquared::new(degrees).ok().map(|law| law.sf(statistic))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A room that a heater warms: switched by its temperature, or for times of which each depends on the one before.
    fn inputs_that_switch(thermostat: bool, seed: u64) -> Vec<usize> {
        let samples = 1500;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (mut x, mut modelled, mut disturbance) = (0.0_f64, 0.0, 0.0);
        let (mut on, mut left, mut length) = (1.0, 20, 20.0);
        let [mut u, mut y, mut simulated] = [vec![], vec![], vec![]];
        for _ in 0..samples {
            let noise = |rng: &mut ChaCha8Rng| rng.random::<f64>() - 0.5;
            y.push(x + 0.3 * disturbance + 0.02 * noise(&mut rng));
            simulated.push(modelled);
            u.push(on);
            let measured = y[y.len() - 1];
            left -= 1;
            if thermostat && (on > 0.0 && measured > 0.6 || on == 0.0 && measured < 0.4) {
                on = 1.0 - on;
            } else if !thermostat && left == 0 {
                on = 1.0 - on;
                length = 12.0 + 10.0 * noise(&mut rng) + 0.4 * (35.0 - length);
                left = length as i32;
            }
            // The model has another law than the room.
            modelled = 0.97 * modelled + 0.03 * u[u.len() - 1];
            x = modelled.powf(1.3);
            disturbance = 0.98 * disturbance + 0.1 * noise(&mut rng);
        }
        let mask = vec![vec![true; samples]];
        inputs_switched(&vec![y], &vec![simulated], &mask, &[&[u]])
    }

    #[test]
    fn a_thermostat_is_told_from_a_schedule() {
        for seed in 0..20 {
            assert_eq!(inputs_that_switch(true, seed), [0], "{seed}");
            assert!(inputs_that_switch(false, seed).is_empty(), "{seed}");
        }
    }
}
