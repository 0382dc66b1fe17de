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
        is_pair: false,
        held_out: Some([without.clone(), with]),
        ..found.clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::engine::fitting::fitted::Fitted;
    use crate::explain::engine::pairs::search;
    use crate::explain::engine::scope::Scope;
    use crate::explain::engine::search::{Objective, Question};
    use crate::physics::estimate::Fit;
    use crate::physics::{Plant, parse};

    const CART: &str = "model Cart
  parameter Real m(unit=\"kg\", min=0.5, max=2) = 1; parameter Real k(unit=\"N/m\", min=5, max=40) = 20;
  parameter Real d(unit=\"N.s/m\", min=0.1, max=3) = 1;
  input Real u(unit=\"N\"); output Real y(unit=\"m\");
  Real x(unit=\"m\"); Real v(unit=\"m/s\");
equation
  der(x) = v; m*der(v) = u - k*x - d*v; y = x;
end Cart;
";

    /// The cart with a cubic spring, and a force at one speed that nothing is called.
    fn recording() -> PlantRecording {
        let mut state = 9_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let force = |x: f64, v: f64| {
            -20.0 * x - v - 8.0 * x.powi(3) + 5.0 * (-((v - 0.8) / 0.3).powi(2)).exp()
        };
        let (mut x, mut v, mut u) = (0.0, 0.0, 0.0);
        let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
        for k in 0..2500 {
            if k % 25 == 0 {
                u = 40.0 * uniform();
            }
            inputs.push(u);
            outputs.push(x + 0.004 * (uniform() + uniform() + uniform()));
            for _ in 0..20 {
                v += 0.001 * (u + force(x, v));
                x += 0.001 * v;
            }
        }
        PlantRecording {
            inputs: vec![inputs],
            outputs: vec![outputs],
            sample_time: 0.02,
            start_time: 0.0,
        }
    }

    /// The best of one kind in this plant, and what the search for it has found.
    fn best(plant: &Plant, recordings: &[PlantRecording], id: &str) -> (Fitted, Found) {
        let scope = Scope::new(&[id.to_owned()], &[]).unwrap();
        let question = Question {
            plant,
            recordings,
            hold: Hold::Zero,
            scope: &scope,
            objective: Objective::Likelihood,
        };
        let found = search(question, None).unwrap();
        (found.steps[0][0].clone(), found)
    }

    #[test]
    fn of_a_name_and_a_curve_that_leave_structure_the_name_stays() {
        let (plant, recordings) = (Plant::new(parse(CART).unwrap()), [recording()]);
        let errors = |plant: &Plant, fit: &Fit| {
            held_out(plant, fit, Estimator::Likelihood, &recordings, Hold::Zero).unwrap()
        };
        let (cube, found) = best(&plant, &recordings, "cubic_stiffness");
        let (law, _) = best(&cube.candidate.plant, &recordings, "law");
        let mut options = found.options.clone();
        options.free.truncate(plant.spec.parameters().len());
        let options = with_more(&options, cube.candidate.values.len());
        let both = Found {
            options: with_more(&options, law.candidate.values.len()),
            held_out: Some([
                errors(&plant, &found.baseline),
                errors(&law.candidate.plant, &law.fit),
            ]),
            plant: law.candidate.plant.clone(),
            fit: law.fit.clone(),
            steps: vec![vec![cube], vec![law]],
            accepted: 2,
            tests: vec![(900.0, 200), (500.0, 200), (3.0, 200)],
            ..found.clone()
        };
        // Nothing is left: both stay.
        assert!(named_alone(&both, &recordings, Hold::Zero).is_none());
        let mut left = both.clone();
        left.tests[2] = (500.0, 200);
        let name = named_alone(&left, &recordings, Hold::Zero).unwrap();
        assert_eq!(name.accepted, 1);
        assert_eq!(named(&plant.spec, &name.steps[0][0]), "cubic_stiffness");
        // Mass, spring, damping, and what the cube has.
        let own = name.steps[0][0].candidate.values.len();
        assert_eq!(name.plant.spec.parameters().len(), 3 + own);
        // What the name does not explain by itself stays as it is: here the plant alone is as good as with it.
        left.held_out = Some([
            name.held_out.unwrap()[1].clone(),
            errors(&both.plant, &both.fit),
        ]);
        assert!(named_alone(&left, &recordings, Hold::Zero).is_none());
    }
}
