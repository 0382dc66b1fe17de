//! The form of a term with one shape more, in its place.

use rayon::prelude::*;

use crate::explain::engine::fitting::fitted::{Fitted, TIE, with_more};
use crate::explain::engine::fitting::formulas::in_its_place;
use crate::explain::engine::hypothesis::Ground;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::terms::richer::richer;
use crate::explain::engine::terms::values::starts;
use crate::explain::engine::thresholds::{GLANCE, MOST_STEPS, ROUNDS, THOROUGH};
use crate::physics::estimate::{Fit, Study};

/// The richer form of a fit's term, where that gains what ties do not explain. What the simple form leaves would else be taken
/// for a second effect.
pub(in crate::explain::engine) fn richer_form(
    fitted: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let term = richer(fitted.lead.term)?;
    let argument = &arguments[fitted.lead.argument?];
    let own = ground.study.parameters() + fitted.shapes.len();
    let strength = match term.free_strength {
        true => fitted.fit.point[own],
        false => 1.0,
    };
    let new = term.shapes.last()?;
    let glance = |study: &Study, from: &Fit| study.glance(from, GLANCE);
    let each = starts(new.starts, Some(argument), ground.recordings, &[]);
    let glanced = each.into_par_iter().filter_map(|start| {
        let shapes = [&fitted.shapes[..], &[start]].concat();
        let start = (&shapes[..], strength);
        in_its_place(fitted, term, start, &glance, arguments, ground)
    });
    let best = glanced.min_by(|a, b| a.fit.deviance.total_cmp(&b.fit.deviance))?;
    if best.fit.deviance > fitted.fit.deviance - TIE.0 {
        return None;
    }
    let options = with_more(ground.options, best.candidate.values.len());
    let limited = best.candidate.plant.clone().with_most_steps(MOST_STEPS);
    let study = ground.study.of(&limited, &options).ok()?;
    let fit = study.refit(&best.fit, ROUNDS, THOROUGH)?;
    let first = ground.study.parameters();
    let richer = Fitted {
        gain: best.gain + best.fit.criterion - fit.criterion,
        shapes: fit.point[first..][..best.shapes.len()].to_vec(),
        fit,
        ..best
    };
    (richer.gain > fitted.gain + TIE.0).then_some(richer)
}
