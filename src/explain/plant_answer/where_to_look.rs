//! Where to look, and what to record next, when no name is given.

use crate::explain::engine::fitting::fitted::TIE;
use crate::explain::engine::terms::documentation::{PARAMETERS, plant_effect};
use crate::explain::engine::thresholds::NEEDED;
use crate::explain::explanation::{Alternative, EffectFound, EquationMap};

/// Places that a sentence lists.
const MOST_PLACES: usize = 3;
/// Tests below this part of the strongest are not worth a look.
const WORTH: f64 = 0.5;

/// The strongest tests of the map in a sentence, each place once; none where all are within chance.
pub(super) fn places(map: &EquationMap) -> Option<String> {
    let mut strongest: Vec<(f64, &str, &str)> = map
        .places
        .iter()
        .zip(&map.share)
        .filter_map(|(place, row)| {
            let tested = row.iter().zip(&map.variables);
            let tested = tested.filter_map(|(share, v)| Some(((*share)?, v.as_str())));
            let (share, variable) = tested.max_by(|a, b| a.0.total_cmp(&b.0))?;
            Some((share, place.as_str(), variable))
        })
        .filter(|(share, ..)| *share > map.significant)
        .collect();
    strongest.sort_by(|a, b| b.0.total_cmp(&a.0));
    let most = strongest.first()?.0;
    let each: Vec<String> = strongest
        .iter()
        .take(MOST_PLACES)
        .filter(|(share, ..)| *share >= WORTH * most)
        .map(|(share, place, variable)| {
            let of = match *variable {
                "time" => "in time".to_owned(),
                variable => format!("as a function of {variable}"),
            };
            format!(
                "{place} {of} ({:.0} % of what the simulator leaves)",
                100.0 * share
            )
        })
        .collect();
    Some(format!(
        "Score tests are strongest at the {}.",
        each.join(", then the ")
    ))
}

/// The recording that tells the closest candidate from what looks like it: from a rival that explains this recording too, or from
/// other parameters; none where nothing that looks like it does.
pub(super) fn experiment(closest: &EffectFound, rivals: &[Alternative]) -> Option<String> {
    let best = closest.effect.as_str();
    let imitations = plant_effect(best)
        .filter(|_| !closest.hypothesis)?
        .imitations;
    let of = |id: &str| imitations.iter().find(|i| i.effect == id);
    let explains = |rival: &&Alternative| {
        let tied = closest.evidence.criterion_gain - rival.criterion_gain <= TIE.0;
        rival.criterion_gain >= NEEDED || rival.criterion_gain > 0.0 && tied
    };
    let imitation = rivals
        .iter()
        .filter(explains)
        .find_map(|rival| of(&rival.effect))
        .or_else(|| of(PARAMETERS))?;
    let other = match imitation.effect {
        PARAMETERS => "other parameters".to_owned(),
        id => id.replace('_', " "),
    };
    Some(format!(
        "{} (tells {} from {other})",
        imitation.experiment.trim_end_matches('.'),
        best.replace('_', " ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::plant_answer::plant_summary::tests::found;

    #[test]
    fn the_strongest_places_are_said_and_what_is_within_chance_is_not() {
        let mut map = EquationMap {
            places: vec!["equation of v".to_owned(), "input F".to_owned()],
            variables: vec!["v".to_owned(), "time".to_owned()],
            share: vec![vec![Some(0.3), Some(0.1)], vec![None, Some(0.2)]],
            significant: 0.01,
        };
        assert_eq!(
            places(&map).unwrap(),
            "Score tests are strongest at the equation of v as a function of v (30 % of what the simulator leaves), then the \
             input F in time (20 % of what the simulator leaves)."
        );
        map.significant = 0.4;
        assert_eq!(places(&map), None);
    }

    #[test]
    fn the_experiment_is_one_that_tells_rivals_apart() {
        let rival = |effect: &str| Alternative {
            effect: effect.to_owned(),
            support: 0.9,
            criterion_gain: 20.0,
            why_not: String::new(),
        };
        let mut closest = found("coulomb_friction", 24.0);
        let mut rivals = [rival("leak"), rival("stribeck_friction")];
        let said = experiment(&closest, &rivals).unwrap();
        assert!(said.ends_with("(tells coulomb friction from stribeck friction)"));
        // A rival that explains nothing needs no other recording.
        rivals[1].criterion_gain = 3.0;
        let said = experiment(&closest, &rivals);
        assert!(said.is_none_or(|said| said.ends_with("from other parameters)")));
        // A kettle does not cog: nothing of this recording looks like the disturbance.
        closest.effect = "periodic_disturbance".to_owned();
        assert_eq!(experiment(&closest, &rivals[..1]), None);
        // A hypothesis may have the name of an effect.
        closest.effect = "law".to_owned();
        assert!(experiment(&closest, &[]).is_some());
        closest.hypothesis = true;
        assert_eq!(experiment(&closest, &[]), None);
    }
}
