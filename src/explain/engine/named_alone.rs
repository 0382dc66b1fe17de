//! A name beside a curve, where both leave structure.
//!
//! A curve that leaves structure may follow what enters elsewhere, so that an answer with one is not sure. What has a name and
//! explains the blocks left out by itself is: it is given alone, and that more is missing is said.

use crate::explain::engine::fitting::eliminate::alone;
use crate::explain::engine::fitting::fitted::with_more;
use crate::explain::engine::holdout::{EXPLAINED, Estimator, held_out};
use crate::explain::engine::search::Found;
use crate::explain::engine::select::CHANCE;
use crate::explain::engine::terms::names::named;
use crate::explain::engine::thresholds::chance;
use crate::physics::Hold;
use crate::physics::estimate::{PlantRecording, Study};

/// The effect with a name alone, where the other of two is a curve, structure is left, and the first takes more than half of the
/// error off blocks left out and leaves little; none otherwise.
pub(super) fn named_alone(
    found: &Found,
    recordings: &[PlantRecording],
    hold: Hold,
) -> Option<Found> {
    let (strongest, tests) = found.left();
    let without = &found.held_out.as_ref()?[0];
    if found.accepted != 2 || chance(strongest) * tests as f64 >= CHANCE {
        return None;
    }
    let (first, second) = (found.steps[0].first()?, found.steps[1].first()?);
    if [first, second].iter().any(|f| f.hypothesis.is_some()) {
        return None;
    }
    let is_law = [
        named(&found.given.spec, first) == "law",
        named(&first.candidate.plant.spec, second) == "law",
    ];
    let mut options = found.options.clone();
    options.free.truncate(found.given.spec.parameters().len());
    let one = match is_law {
        [false, true] => first.clone(),
        [true, false] => {
            let study = Study::new(&found.given, recordings, &options).ok()?;
            let study = study.with_information(found.information);
            let baseline = &found.baseline;
            alone(
                &found.given,
                &study,
                baseline,
                first,
                second,
                recordings,
                &options,
            )?
        }
        _ => return None,
    };
    let (plant, fit) = (one.candidate.plant.clone(), one.fit.clone());
    let estimator = match found.options.least_squares {
        true => Estimator::FreeRun,
        false => Estimator::Likelihood,
    };
    let with = held_out(&plant, &fit, estimator, recordings, hold)?;
    if !(with.follows_closely() && with.removed(without) >= EXPLAINED) {
        return None;
    }
    let mut steps = found.steps[..1].to_vec();
    if is_law[0] {
        steps[0].insert(0, one.clone());
    }
    Some(Found {
        options: with_more(&options, one.candidate.values.len()),
        steps,
        tests: found.tests[..2].to_vec(),
        plant,
        fit,
        accepted: 1,
        held_out: Some([without.clone(), with]),
        ..found.clone()
    })
}
