//! Neighbours of a fit's term: the form with one shape more, and the same function of one variable only.

use rayon::prelude::*;

use crate::explain::engine::fitting::fitted::{Fitted, TIE, with_more};
use crate::explain::engine::fitting::formulas::in_its_place;
use crate::explain::engine::hypothesis::Ground;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::terms::richer::richer;
use crate::explain::engine::terms::values::starts;
use crate::explain::engine::thresholds::{GLANCE, MOST_STEPS, ROUNDS, THOROUGH, limited};
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
    let strength = match term.free_strength {
        true => fitted.strength(),
        false => 1.0,
    };
    let new = term.shapes.last()?;
    let each = starts(new.starts, Some(argument), ground.recordings, &[]);
    let glanced = each.into_par_iter().filter_map(|start| {
        let shapes = [&fitted.shapes[..], &[start]].concat();
        let what = (term, fitted.lead.argument);
        in_its_place(
            fitted,
            what,
            (&shapes[..], strength),
            &glance,
            arguments,
            ground,
        )
    });
    clearly_better(fitted, glanced, ground)
}

/// The same function of one of the variables that a fit's term depends on, where that gains what ties do not explain: a screen asks
/// along the fit without the term, where the difference of two variables may look like one of them.
pub(in crate::explain::engine) fn of_one_variable(
    fitted: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let (term, place) = (fitted.lead.term, fitted.lead.argument?);
    let own = &arguments[place].variables;
    if own.len() < 2 || fitted.lead.curve.is_some() {
        return None;
    }
    let start = (&fitted.shapes[..], fitted.strength());
    let of_one = |a: &usize| {
        let argument = &arguments[*a];
        argument.variables.len() == 1
            && own.contains(&argument.variables[0])
            && argument.serves(term.needs)
    };
    let others: Vec<usize> = (0..arguments.len()).filter(of_one).collect();
    let glanced = others.into_par_iter().filter_map(|other| {
        in_its_place(
            fitted,
            (term, Some(other)),
            start,
            &glance,
            arguments,
            ground,
        )
    });
    clearly_better(fitted, glanced, ground)
}

fn glance(study: &Study, from: &Fit) -> Option<Fit> {
    study.glance(from, GLANCE)
}

/// The best of these, fitted until nothing changes, where it gains what ties do not explain.
fn clearly_better(
    fitted: &Fitted,
    glanced: impl ParallelIterator<Item = Fitted>,
    ground: &Ground,
) -> Option<Fitted> {
    let best = glanced.min_by(|a, b| a.fit.deviance.total_cmp(&b.fit.deviance))?;
    if best.fit.deviance > fitted.fit.deviance - TIE.0 {
        return None;
    }
    let options = with_more(ground.options, best.candidate.values.len());
    let limited = limited(best.candidate.plant.clone(), ground.study, MOST_STEPS);
    let study = ground.study.of(&limited, &options).ok()?;
    let fit = study.refit(&best.fit, ROUNDS, THOROUGH)?;
    let first = ground.study.parameters();
    let better = Fitted {
        gain: best.gain + best.fit.criterion - fit.criterion,
        shapes: fit.point[first..][..best.shapes.len()].to_vec(),
        fit,
        ..best
    };
    (better.gain > fitted.gain + TIE.0).then_some(better)
}
