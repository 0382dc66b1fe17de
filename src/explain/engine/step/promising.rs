//! Which of the tested terms are fitted.

use crate::explain::engine::screening::screen::{Lead, Screen};
use crate::explain::engine::terms::names::{SPECIFIC, called, rank_of};
use crate::explain::engine::thresholds::{AT_A_PLACE, GLANCED, IMITATED, OF_A_KIND};
use crate::physics::{ModelSpec, VariableId};

/// Variables that a lead's term is a function of.
fn variables<'a>(lead: &Lead, screen: &'a Screen) -> &'a [VariableId] {
    lead.argument
        .map_or(&[][..], |a| &screen.arguments[a].variables)
}

/// Whether a term has a name of its own at its place.
pub(super) fn is_specific(lead: &Lead, screen: &Screen, spec: &ModelSpec) -> bool {
    rank_of(spec, lead.term, lead.place, variables(lead, screen)) < SPECIFIC
}

/// Leads of a screen that are fitted with the noise of the fit before.
pub(super) fn promising(screen: &Screen, spec: &ModelSpec, more: usize) -> Vec<Lead> {
    let mut kept: Vec<Lead> = Vec::new();
    for lead in &screen.leads {
        let kind = |l: &&Lead| l.term == lead.term;
        let place = |l: &&Lead| l.place == lead.place;
        if kept.iter().any(|l| l.is_alike(lead))
            || kept.iter().filter(kind).count() >= OF_A_KIND
            || kept.iter().filter(place).count() >= more * AT_A_PLACE
        {
            continue;
        }
        kept.push(lead.clone());
        if kept.len() == more * GLANCED {
            break;
        }
    }
    // What has a name of its own is not crowded out by curves that imitate it, nor by its term in another place.
    let strong = screen.leads.first().map_or(0.0, |l| IMITATED * l.statistic);
    let specific = |l: &&Lead| l.statistic > strong && is_specific(l, screen, spec);
    let id = |l: &Lead| called(spec, l.term, l.place, variables(l, screen));
    for lead in screen.leads.iter().filter(specific) {
        let same = |l: &Lead| l.term == lead.term && id(l) == id(lead);
        if !kept.iter().any(same) {
            kept.push(lead.clone());
        }
    }
    kept.extend(screen.curves.iter().cloned());
    kept
}
