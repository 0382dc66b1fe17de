//! What is close to the best candidates: formulas in place of a curve, richer forms, changes of parameters.

use super::Stage;
use super::drop_repeated;
use crate::explain::engine::fitting::edit::Place;
use crate::explain::engine::fitting::fitted::{Fitted, TIE};
use crate::explain::engine::fitting::formulas::formulas;
use crate::explain::engine::fitting::neighbours::{
    also_elsewhere, as_parameter_changes, as_plain_functions, named_elsewhere, of_one_variable,
    of_what_is_shared, richer_form, simpler_form,
};
use crate::explain::engine::fitting::refined_curve::refined_curve;
use crate::explain::engine::hypothesis::Ground;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::terms::names::named;
use crate::explain::engine::thresholds::{FINISHED, IMITATED};

fn best_gain(fitted: &[Fitted]) -> f64 {
    fitted.iter().map(|f| f.gain).fold(0.0, f64::max)
}

/// Formulas beside the curve or the unnamed function that is close to the best: they say in two or three numbers what a curve says in
/// nine or more. Of equals the curve stays, for it is level beyond its ends.
pub(super) fn add_formulas(
    fitted: &mut Vec<Fitted>,
    arguments: &[Argument],
    (stage, ground): (&Stage, &Ground),
) {
    let best = best_gain(fitted);
    let unlisted = |f: &Fitted| {
        let unnamed = f.hypothesis.is_none() && named(&stage.plant.spec, f) == "law";
        f.lead.curve.is_some() || unnamed && matches!(f.lead.place, Place::Equation(_))
    };
    let close = (0..fitted.len())
        .filter(|&i| unlisted(&fitted[i]) && fitted[i].gain > (1.0 - TIE.1) * best);
    let Some(at) = close.max_by(|&a, &b| fitted[a].gain.total_cmp(&fitted[b].gain)) else {
        return;
    };
    let mut better = formulas(&fitted[at], arguments, ground).unwrap_or_default();
    if let Some(finer) = refined_curve(&fitted[at], arguments, ground) {
        better.extend(formulas(&finer, arguments, ground).unwrap_or_default());
        fitted[at] = finer;
    }
    better.retain(|f| {
        let id = named(&stage.plant.spec, f);
        f.gain > fitted[at].gain + TIE.0 && stage.scope.allows(id)
    });
    fitted.extend(better);
}

/// Richer forms in place of the best candidates, and the best one as a change of a parameter or another function of it.
pub(super) fn add_neighbours(
    mut fitted: Vec<Fitted>,
    arguments: &[Argument],
    (stage, ground): (&Stage, &Ground),
) -> Vec<Fitted> {
    let best = best_gain(&fitted);
    let of_library = |f: &&mut Fitted| f.hypothesis.is_none() && f.gain > IMITATED * best;
    let mut best_first: Vec<&mut Fitted> = fitted.iter_mut().filter(of_library).collect();
    best_first.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    for (rank, one) in best_first.into_iter().take(FINISHED).enumerate() {
        let richer = richer_form(one, arguments, ground);
        let close = rank == 0 && one.gain > (1.0 - TIE.1) * best;
        let of_one = || of_one_variable(one, arguments, ground);
        if let Some(better) = richer.or_else(|| close.then(of_one).flatten()) {
            *one = better;
        }
        if let Some(simpler) = simpler_form(one, arguments, ground) {
            *one = simpler;
        }
        if let Some(better) = also_elsewhere(one, stage.given, arguments, ground) {
            *one = better;
        }
        if let Some(of_its_own) = of_what_is_shared(one, arguments, ground) {
            *one = of_its_own;
        }
    }
    let of_library = fitted.iter().filter(|f| f.hypothesis.is_none());
    let Some(one) = of_library.max_by(|a, b| a.gain.total_cmp(&b.gain)) else {
        return fitted;
    };
    let mut more = as_parameter_changes(one, stage.given, arguments, ground);
    more.extend(as_plain_functions(one, arguments, ground));
    more.extend(named_elsewhere(one, stage.given, arguments, ground));
    let best_of_more = more.iter_mut().max_by(|a, b| a.gain.total_cmp(&b.gain));
    if let Some(better) = best_of_more.filter(|f| f.gain > one.gain)
        && let Some(richer) = richer_form(better, arguments, ground)
    {
        *better = richer;
    }
    more.retain(|f| stage.scope.allows(named(&stage.plant.spec, f)));
    fitted.extend(more);
    drop_repeated(fitted)
}
