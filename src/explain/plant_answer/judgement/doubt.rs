//! Why an effect that the criterion is sure of is not named: the recording does not tell it from something else.

use crate::explain::engine::fitting::fitted::Fitted;
use crate::explain::explanation::Law;
use crate::physics::ModelSpec;
use crate::physics::estimate::PlantRecording;

/// A change of an input from one sample to the next by this part of its range is a step.
const STEP: f64 = 0.25;
/// Steps of an input begin as near to a change as chance has it with less than this probability.
const BY_CHANCE: f64 = 0.05;
/// Standard deviations of an instant within which it may be another.
const NEAR: f64 = 2.0;
/// Steps back to where an input was before, beyond the one at the instant, that show that a change is not its effect.
const RETURNS: usize = 3;

/// Why an effect is not named.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::explain::plant_answer) enum Doubt {
    /// A curve of a variable that only rises or only falls: a function of time does the same.
    OnceThrough(String),
    /// A change in time that begins with a step of this input.
    WithInput(String),
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::OnceThrough(argument) => write!(
                f,
                "Not named, because {argument} runs through its range only once: the recording does not tell a curve of {argument} \
                 from something that changes in time, such as another state."
            ),
            Self::WithInput(input) => write!(
                f,
                "Not named, because it begins with a step of the input {input}: the recording does not tell it from an effect of \
                 {input}."
            ),
        }
    }
}

/// Why an effect is not named; `instant` is the time at which it begins, with its standard deviation.
pub(in crate::explain::plant_answer) fn doubt(
    fitted: &Fitted,
    instant: Option<(f64, f64)>,
    spec: &ModelSpec,
    recordings: &[PlantRecording],
) -> Option<Doubt> {
    if fitted.lead.curve.is_some() && !fitted.comes_back {
        return Some(Doubt::OnceThrough(fitted.argument.clone()));
    }
    let input = begins_with(instant?, recordings)?;
    let variable = *spec.inputs().get(input)?;
    Some(Doubt::WithInput(
        spec.variable(variable).column().to_owned(),
    ))
}

/// Whether an unproven law may predict: it is known better than its size is throughout its range, and does not grow with the state whose
/// rate it enters. Beyond its range such a law carries the state away.
pub(in crate::explain::plant_answer) fn is_safe(law: &Law, state: Option<&str>) -> bool {
    let largest = law.value.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let known = law.std.iter().all(|std| *std < largest);
    let first = law.variable.trim_start_matches('(').split(' ').next();
    let grows = |pair: Option<&[f64]>| pair.is_some_and(|v| v[1] > v[0]);
    let mut steps = law.value.windows(2);
    let (low, high) = (steps.next(), steps.next_back());
    known && !(state.is_some() && state == first && (grows(low) || grows(high)))
}

/// Whether an input comes back so often to where it was before an instant that what it does there would have shown before.
fn returns(i: usize, time: f64, recordings: &[PlantRecording]) -> bool {
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    let (mut times, mut last) = (0, f64::NAN);
    for r in recordings {
        for (k, &u) in r.inputs[i].iter().enumerate() {
            if r.start_time + (k as f64) * r.sample_time < time {
                (least, most) = (least.min(u), most.max(u));
            } else if (u - last).abs() >= STEP * (most - least) && least <= u && u <= most {
                times += 1;
            }
            last = u;
        }
    }
    times > RETURNS
}

/// The input that steps at an instant, where its steps are so few that this is no chance, and it is rarely back where it was.
fn begins_with((time, std): (f64, f64), recordings: &[PlantRecording]) -> Option<usize> {
    let inputs = recordings.first()?.inputs.len();
    let (begin, end) = PlantRecording::span(recordings);
    (0..inputs).find(|&i| {
        let values = recordings.iter().flat_map(|r| &r.inputs[i]);
        let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &u| {
            (a.min(u), b.max(u))
        });
        let steps = recordings.iter().flat_map(|r| {
            let pairs = r.inputs[i].windows(2).enumerate();
            pairs
                .filter(|(_, u)| most > least && (u[1] - u[0]).abs() >= STEP * (most - least))
                .map(|(k, _)| (r.start_time + (k + 1) as f64 * r.sample_time, r.sample_time))
        });
        let (mut count, mut at_step) = (0.0, false);
        let mut near = 0.0;
        for (at, sample_time) in steps {
            near = f64::max(sample_time, NEAR * std);
            count += 1.0;
            at_step |= (time - at).abs() <= near;
        }
        at_step && 2.0 * near * count < BY_CHANCE * (end - begin) && !returns(i, time, recordings)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(steps: &[usize]) -> PlantRecording {
        let mut level = 0.0;
        let input = (0..1000).map(|k| {
            level = if steps.contains(&k) {
                1.0 - level
            } else {
                level
            };
            level
        });
        PlantRecording {
            inputs: vec![input.collect()],
            outputs: vec![vec![0.0; 1000]],
            sample_time: 0.1,
            start_time: 5.0,
        }
    }

    #[test]
    fn a_law_that_carries_its_state_away_does_not_predict() {
        let law = |variable: &str, value: [f64; 3], std: f64| Law {
            variable: variable.to_owned(),
            at: vec![0.0, 1.0, 2.0],
            value: value.to_vec(),
            std: vec![0.1, std, 0.1],
        };
        assert!(is_safe(&law("T", [0.0, -1.0, -3.0], 0.1), Some("T")));
        assert!(!is_safe(&law("T", [0.0, 1.0, 3.0], 0.1), Some("T")));
        assert!(!is_safe(&law("(T - Ta)", [0.0, 1.0, 3.0], 0.1), Some("T")));
        // It drives another state, or none.
        assert!(is_safe(&law("T", [0.0, 1.0, 3.0], 0.1), Some("x")));
        assert!(is_safe(&law("T", [0.0, 1.0, 3.0], 0.1), None));
        // Somewhere nothing is known.
        assert!(!is_safe(&law("T", [0.0, -1.0, -3.0], 3.0), Some("T")));
    }

    #[test]
    fn a_change_at_a_step_of_an_input_may_be_its_effect() {
        let few = [recording(&[200, 600])];
        // The input steps at 25 s and at 65 s.
        assert_eq!(begins_with((65.0, 0.01), &few), Some(0));
        assert_eq!(begins_with((65.3, 0.01), &few), None);
        assert_eq!(begins_with((65.3, 0.2), &few), Some(0));
        // Of many steps one is always near.
        let many: Vec<usize> = (0..100).map(|k| 10 * k + 5).collect();
        assert_eq!(begins_with((65.5, 0.01), &[recording(&many)]), None);
        // It goes on as before.
        let on = recording(&[200, 300, 600, 700, 800, 900]);
        assert_eq!(begins_with((35.0, 0.01), &[on]), None);
        // An input that does not move has no steps.
        assert_eq!(begins_with((65.0, 0.01), &[recording(&[])]), None);
    }
}
