//! The form of a term with one shape more, in its place.

use rayon::prelude::*;

use crate::explain::engine::fitting::fitted::{Fitted, TIE};
use crate::explain::engine::fitting::formulas::in_its_place;
use crate::explain::engine::hypothesis::Ground;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::terms::library::richer;
use crate::explain::engine::terms::values::starts;

/// The richer form of a fit's term, where that gains what ties do not explain. What the simple form leaves would else be taken
/// for a second effect.
pub(in crate::explain::engine) fn richer_form(
    fitted: &Fitted,
    arguments: &[Argument],
    ground: &Ground,
) -> Option<Fitted> {
    let term = richer(fitted.lead.term)?;
    let argument = &arguments[fitted.lead.argument?];
    let first = ground.study.parameters() + fitted.shapes.len();
    let strength = match term.free_strength {
        true => fitted.fit.point[first],
        false => 1.0,
    };
    let new = term.shapes.last()?;
    let each = starts(new.starts, Some(argument), ground.recordings, &[]);
    each.into_par_iter()
        .filter_map(|start| {
            let shapes = [&fitted.shapes[..], &[start]].concat();
            in_its_place(fitted, term, (&shapes, strength), arguments, ground)
        })
        .filter(|f| f.gain > fitted.gain + TIE.0)
        .max_by(|a, b| a.gain.total_cmp(&b.gain))
}
