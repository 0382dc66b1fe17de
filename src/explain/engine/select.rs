//! Which answer to give: likelihood searches, and free runs over data that no fit has seen decide whether it may be believed.
//!
//! A likelihood is right where its noise model is. Of a real plant every model leaves more out than noise, and the noise
//! model or the observer then takes over physics: what predicts the next sample best may simulate worse than before. So every
//! answer, and the plant without it, is fitted to a part of the data and simulated over the rest; where the likelihood's
//! answer leaves structure behind or simulates worse, the same search is made for the free run by least squares.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::explain::engine::holdout::{
    EXPLAINED, Estimator, HeldOut, SATISFACTORY, all_free, as_given, free_run_error, held_out,
};
use crate::explain::engine::long_recordings::part;
use crate::explain::engine::misled::{integrates, reacting_inputs};
use crate::explain::engine::named_alone::named_alone;
use crate::explain::engine::pairs::search;
use crate::explain::engine::scope::Scope;
use crate::explain::engine::search::{Found, Objective, Question};
use crate::explain::engine::terms::names::named;
use crate::explain::engine::thresholds::{MOST_STEPS, SECOND, chance, is_spent, limited};
use crate::physics::estimate::{EstimateError, Fit, Form, PlantRecording, Study};
use crate::physics::{Hold, Plant};

/// Free runs whose errors differ by less than this part are equally good (the tolerance of the project's score
/// on real recordings).
pub(super) const EQUAL: f64 = 0.02;
/// Level of the test that asks whether maximum likelihood and least squares differ by more than chance allows.
const MISSPECIFIED: f64 = 0.05;
/// Probability by chance below which the strongest score test says that something is left.
pub(crate) const CHANCE: f64 = 1e-9;

/// A plant with some of the effects of a search, fitted in one of the ways.
struct Rival {
    /// Which search, and how many of its effects.
    search: usize,
    accepted: usize,
    estimator: Estimator,
    fit: Fit,
    /// Of least squares the summit next to the likelihood's fit: where physics is missing, parameters at a higher one make up for it,
    /// and tests there say less.
    nearest: Option<Fit>,
    held_out: HeldOut,
    /// Error of the free run over all data.
    whole: f64,
    /// Its free run is worse than that of least squares by more than the noise allows.
    misspecified: bool,
}

/// What the equations leave out.
///
/// # Errors
/// As those of an estimation.
pub(crate) fn select(
    plant: &Plant,
    recordings: &[PlantRecording],
    hold: Hold,
    scope: &Scope,
) -> Result<Found, EstimateError> {
    let plant = &plant.clone().counting();
    let mut found = decide_by_part(plant, recordings, hold, scope)?;
    found.estimate_initial_states(recordings);
    Ok(found)
}

/// Of long recordings a part is searched; what it shows is fitted to all samples and judged by them.
fn decide_by_part(
    plant: &Plant,
    recordings: &[PlantRecording],
    hold: Hold,
    scope: &Scope,
) -> Result<Found, EstimateError> {
    let Some(part) = part(plant, recordings, hold) else {
        return decide(plant, recordings, hold, scope);
    };
    let found = decide(plant, &part.recordings, hold, scope)?;
    let Some(mut found) = found.on_all(recordings, &part) else {
        return decide(plant, recordings, hold, scope);
    };
    let rivals = rivals(&found, 0, recordings, hold);
    if worsens(&rivals, 0, found.accepted) {
        found.keep(0);
    }
    let judged = rivals.iter().any(|r| r.held_out.follows());
    settle(&mut found, &rivals, 0, judged, recordings);
    Ok(found)
}

fn decide(
    plant: &Plant,
    recordings: &[PlantRecording],
    hold: Hold,
    scope: &Scope,
) -> Result<Found, EstimateError> {
    let question = |objective: Objective| Question {
        plant,
        recordings,
        hold,
        scope,
        objective,
    };
    let mut likely = search(question(Objective::Likelihood), None)?;
    let mut rivals = rivals(&likely, 0, recordings, hold);
    let Some(without) = best(&rivals, |r| r.accepted == 0) else {
        return Ok(likely);
    };
    let study = Study::new(&likely.plant, recordings, &likely.options)?;
    let follows = 1.0 - without.whole.powi(2) > SATISFACTORY;
    let driven = !plant.spec.inputs().is_empty();
    likely.reacting = reacting_inputs(&study, &likely.fit, recordings, hold);
    likely.misled = !likely.reacting.is_empty()
        || driven && !follows && integrates(&likely.plant, &study, &likely.fit, recordings);
    let whole = best(&rivals, |r| r.accepted == likely.accepted);
    let holds = whole.is_some_and(|w| w.held_out.over(&without.held_out) <= 1.0 + EQUAL)
        && !worsens(&rivals, 0, likely.accepted);
    let (strongest, tests) = likely.left();
    let adequate = chance(strongest) * tests as f64 >= CHANCE;
    // What is left would not make a second effect: it does not put the first in doubt either.
    let found = likely.steps[0].first().filter(|_| likely.accepted > 0);
    let little_left = found.is_some_and(|first| strongest < SECOND.1 * first.gain);
    let mut searches = vec![likely];
    // An unstable plant does not run freely: its likelihood has no judge. A stable one may follow once an effect is found.
    let mut judged = rivals.iter().any(|r| r.held_out.follows());
    let stays = !searches[0].misled && rivals.iter().any(|r| r.held_out.stays());
    // What makes the free run of a plant that follows worse is no effect of it, even where free runs prove nothing.
    let refuted = searches[0].misled && worsens(&rivals, 0, searches[0].accepted);
    let mut chosen = (0, if refuted { 0 } else { searches[0].accepted });
    // Where least squares simulates better than the noise allows, a coloured noise stands for what is missing: little may be left
    // of the likelihood, and much of the free run. What least squares refutes is no longer among the rivals, and proves nothing.
    let is_last = |r: &&Rival| r.accepted == searches[0].accepted;
    let misspecified = rivals.iter().filter(is_last).any(|r| r.misspecified);
    let stands = (rivals.iter().filter(is_last)).any(|r| r.estimator == Estimator::Likelihood);
    // With an observer the residuals are white wherever the observer follows: that proves no effect.
    let free_run = searches[0].fit.form == Form::FreeRun;
    let proved = match searches[0].accepted {
        0 => adequate && !misspecified,
        _ => adequate || little_left && !misspecified,
    } && stands
        && free_run;
    if stays && !(judged && holds && proved) && !is_spent(plant) {
        let known = rivals
            .iter()
            .find(|r| r.accepted == 0 && r.estimator == Estimator::FreeRun)
            .map(|r| r.nearest.as_ref().unwrap_or(&r.fit).clone());
        if let Ok(found) = search(question(Objective::FreeRun), known.as_ref()) {
            rivals.extend(self::rivals(&found, 1, recordings, hold));
            searches.push(found);
        }
        judged = rivals.iter().any(|r| r.held_out.follows());
    }
    if searches.len() > 1 && judged {
        // A second effect that only free runs show, beside a first that both searches find, is what the formula of the first
        // leaves.
        let most = match &searches[..] {
            [likely, free_run] if same_first(plant, likely, free_run) => likely.accepted,
            _ => usize::MAX,
        };
        // What the likelihood proves with as many values as are independent, and explains the free run too, gives way only to
        // what explains it as clearly better.
        let kept = best(&rivals, |r| (r.search, r.accepted) == chosen)
            .filter(|r| r.accepted > 0 && holds && explains(r, best(&rivals, |r| r.accepted == 0)));
        let improving: Vec<&Rival> = rivals
            .iter()
            .filter(|r| !worsens(&rivals, r.search, r.accepted))
            .filter(|r| match kept {
                Some(kept) if r.search > 0 => simpler(r, kept) || explains(r, Some(kept)),
                Some(kept) if r.accepted == kept.accepted => {
                    !rivals.iter().any(|o| simpler(o, kept))
                }
                _ => true,
            })
            .filter(|r| r.search == 0 || r.accepted <= most && r.held_out.follows())
            .collect();
        chosen = match winner(&improving) {
            // Without an effect the tests of the likelihood count.
            Some((_, 0)) => (0, 0),
            Some(winner) => winner,
            None => chosen,
        };
    }
    let (which, accepted) = chosen;
    let steps = searches.iter().filter_map(|s| s.steps.first());
    let likelier = steps.flatten().find(|f| f.likelier).cloned();
    let mut found = searches.swap_remove(which);
    found.keep(accepted);
    found.likelier = likelier.filter(|_| accepted == 0 && !found.misled);
    settle(&mut found, &rivals, which, judged, recordings);
    Ok(named_alone(&found, recordings, hold).unwrap_or(found))
}

/// Takes the fits that are to be trusted, without the effects and with them.
fn settle(
    found: &mut Found,
    rivals: &[Rival],
    search: usize,
    judged: bool,
    recordings: &[PlantRecording],
) {
    let fitted = |accepted: usize| {
        let own = |r: &&Rival| r.accepted == accepted && (accepted == 0 || r.search == search);
        trusted(&rivals.iter().filter(own).collect::<Vec<_>>(), judged)
    };
    let (baseline, last) = (fitted(0), fitted(found.accepted));
    if let Some(without) = baseline {
        found.baseline = without.fit.clone();
    }
    if let Some(with) = last {
        found.options.least_squares = with.estimator != Estimator::Likelihood;
        found.fit = with.fit.clone();
        found.take_shapes(recordings);
        found.information = information(found, recordings).unwrap_or(1.0);
        if judged && let Some(without) = baseline {
            found.held_out = Some([without.held_out.clone(), with.held_out.clone()]);
        }
    }
}

/// Whether a free run with fewer effects, but some, of another search follows all of the data as closely.
fn simpler(rival: &Rival, than: &Rival) -> bool {
    rival.search != than.search
        && (1..than.accepted).contains(&rival.accepted)
        && rival.whole <= (1.0 + EQUAL) * than.whole
}

/// Whether two searches have found the same effect first.
fn same_first(plant: &Plant, a: &Found, b: &Found) -> bool {
    let first = |found: &Found| {
        let best = found
            .steps
            .first()?
            .first()
            .filter(|_| found.accepted > 0)?;
        Some((named(&plant.spec, best), best.lead.place))
    };
    first(a).is_some() && first(a) == first(b)
}

/// Whether a free run takes more than half of the mean square off that of another, in blocks left out.
fn explains(rival: &Rival, other: Option<&Rival>) -> bool {
    other.is_some_and(|o| rival.held_out.removed(&o.held_out) >= EXPLAINED)
}

/// Of the fits of one plant the likelihood's, whose standard deviations hold, unless it simulates worse, in blocks left out or
/// by more than its noise allows. Least squares stands for it, unless the values of the text simulate better in blocks left out.
/// A plant to which nothing is added is there to be simulated: least squares comes first, unless another is better in blocks left
/// out by more than chance.
fn trusted<'a>(rivals: &[&'a Rival], judged: bool) -> Option<&'a Rival> {
    let least = *rivals.iter().min_by(|a, b| order(a, b))?;
    let follows = |r: &Rival| !judged || r.held_out.over(&least.held_out) <= 1.0 + EQUAL;
    let likelihood = |r: &&&Rival| {
        r.estimator == Estimator::Likelihood && follows(r) && !(judged && r.misspecified)
    };
    let free_run = |r: &&&Rival| r.estimator == Estimator::FreeRun && follows(r);
    let simulates = |r: &&&Rival| {
        let without = judged && r.accepted == 0 && r.estimator == Estimator::FreeRun;
        without && !least.held_out.surely_smaller(&r.held_out)
    };
    let chosen = rivals.iter().find(simulates);
    let chosen = chosen.or_else(|| rivals.iter().find(likelihood));
    let chosen = chosen.or_else(|| rivals.iter().find(free_run));
    Some(chosen.copied().unwrap_or(least))
}

/// Information in a value of what the final fit leaves.
fn information(found: &Found, recordings: &[PlantRecording]) -> Option<f64> {
    if !found.options.least_squares {
        return Some(1.0);
    }
    let study = Study::new(&found.plant, recordings, &found.options).ok()?;
    study.effective_share(&found.fit)
}

fn order(a: &Rival, b: &Rival) -> std::cmp::Ordering {
    a.held_out.over(&b.held_out).total_cmp(&1.0)
}

fn best<'a>(
    rivals: impl IntoIterator<Item = &'a Rival>,
    which: impl Fn(&Rival) -> bool,
) -> Option<&'a Rival> {
    rivals
        .into_iter()
        .filter(|r| which(r))
        .min_by(|a, b| order(a, b))
}

/// Whether so many effects of a search make the free run over all data worse, by whatever estimator, although the plant without
/// them follows: over short blocks a wrong plant is saved by its initial state.
fn worsens(rivals: &[Rival], search: usize, accepted: usize) -> bool {
    let least = |which: &dyn Fn(&Rival) -> bool| {
        let errors = rivals.iter().filter(|r| which(r)).map(|r| r.whole);
        errors.fold(f64::INFINITY, f64::min)
    };
    let without = least(&|r| r.accepted == 0);
    let with = least(&|r| r.accepted == accepted && (accepted == 0 || r.search == search));
    without < 1.0 && with > (1.0 + EQUAL) * without
}

/// The search and the number of effects whose free runs follow best; of equals the one with fewer effects.
fn winner(rivals: &[&Rival]) -> Option<(usize, usize)> {
    let best = best(rivals.iter().copied(), |_| true)?;
    let equal = |r: &&&Rival| r.held_out.over(&best.held_out) <= 1.0 + EQUAL;
    let fewest = rivals.iter().filter(equal).map(|r| r.accepted).min()?;
    let chosen = rivals
        .iter()
        .filter(equal)
        .filter(|r| r.accepted == fewest)
        .min_by(|a, b| order(a, b))?;
    Some((chosen.search, chosen.accepted))
}

/// Every number of effects of a search, by both estimators, and once the plant as it was given.
fn rivals(found: &Found, search: usize, recordings: &[PlantRecording], hold: Hold) -> Vec<Rival> {
    let mut all = Vec::new();
    // The plant with an effect less, by least squares.
    let mut fewer: Option<Fit> = None;
    for accepted in 0..=found.accepted {
        let (plant, fit) = found.stage(accepted);
        let nested = fewer.take().and_then(|fewer| {
            let candidate = &found.steps[accepted - 1].first()?.candidate;
            let new = candidate.values.len();
            let first = plant.spec.parameters().len() - new;
            let mut from = candidate.from(&fewer, first);
            from.point[first..][..new].copy_from_slice(&fit.point[first..][..new]);
            Some(from.point)
        });
        let of_search = match found.options.least_squares {
            true => Estimator::FreeRun,
            false => Estimator::Likelihood,
        };
        let given = match (search, accepted) {
            (0, 0) => as_given(plant, recordings, hold),
            _ => None,
        };
        let own = [(of_search, fit.clone())];
        let given = given.map(|given| (Estimator::Given, given));
        let mut fits: Vec<(Estimator, Fit, bool)> = (own.into_iter().chain(given))
            .map(|(estimator, fit)| (estimator, fit, false))
            .collect();
        let mut nearest = None;
        let points: Vec<&[f64]> = fits.iter().map(|f| f.1.point.as_slice()).collect();
        if of_search == Estimator::Likelihood
            && let Some((least_squares, refuted, next)) =
                by_least_squares(plant, &points, nested, recordings, hold)
        {
            nearest = next;
            for ((.., misspecified), refuted) in fits.iter_mut().zip(refuted) {
                *misspecified = refuted;
            }
            fewer = Some(least_squares.clone());
            fits.insert(1, (Estimator::FreeRun, least_squares, false));
        }
        let first = all.len();
        for (estimator, fit, misspecified) in fits {
            let options = all_free(plant, hold, estimator);
            let study = Study::new(plant, recordings, &options).ok();
            let unstable = |study: &Study| accepted > 0 && study.depends_on_rounding(&fit);
            if study.as_ref().is_some_and(unstable) {
                continue;
            }
            let Some(held_out) = held_out(plant, &fit, estimator, recordings, hold) else {
                continue;
            };
            let whole = study.and_then(|s| free_run_error(&s, &fit, recordings));
            all.push(Rival {
                search,
                accepted,
                estimator,
                fit,
                nearest: nearest.take_if(|_| estimator == Estimator::FreeRun),
                held_out,
                whole: whole.unwrap_or(f64::INFINITY),
                misspecified,
            });
        }
        drop_refuted(&mut all, first);
    }
    all.retain(|r| !(found.is_pair && r.accepted == 1));
    all
}

/// Drops what least squares refutes: values that leave more than twice its mean square over all data, and more than the noise
/// allows, or a free run that is unsatisfactory. Blocks left out of a short recording hold too little to say otherwise.
fn drop_refuted(rivals: &mut Vec<Rival>, first: usize) {
    let of_free_run = |r: &&Rival| r.estimator == Estimator::FreeRun;
    let Some(least) = rivals[first..].iter().find(of_free_run).map(|r| r.whole) else {
        return;
    };
    let unsatisfactory = |r: &Rival| 1.0 - r.whole.powi(2) <= SATISFACTORY;
    let refuted = |r: &Rival| {
        (r.misspecified || unsatisfactory(r)) && 1.0 - (least / r.whole).powi(2) >= EXPLAINED
    };
    let kept = rivals.split_off(first);
    rivals.extend(kept.into_iter().filter(|r| !refuted(r)));
}

/// The least squares fit of the free run; whether it refutes each of the other points, of which the first is the likelihood's; and
/// the least squares fit next to that.
///
/// Least squares has summits of its own: it starts from the likelihood's point, and from `nested`, the fit with an effect less; of
/// the plant alone where [`estimate`](crate::physics::estimate::estimate) starts.
fn by_least_squares(
    plant: &Plant,
    others: &[&[f64]],
    nested: Option<Vec<f64>>,
    recordings: &[PlantRecording],
    hold: Hold,
) -> Option<(Fit, Vec<bool>, Option<Fit>)> {
    let options = all_free(plant, hold, Estimator::FreeRun);
    let own = Study::new(plant, recordings, &options).ok()?;
    let limited = limited(plant.clone(), &own, MOST_STEPS);
    let study = own.of(&limited, &options).ok()?;
    let from_likelihood = study.least_squares(others.first()?);
    let otherwise = match nested {
        None => study.fit(Some(Form::FreeRun)).ok(),
        Some(nested) => study.least_squares(&nested),
    };
    let fit = (from_likelihood.iter().cloned().chain(otherwise))
        .min_by(|a, b| a.deviance.total_cmp(&b.deviance))?;
    let refuted = |other: &&[f64]| agreement(&study, &fit, other).is_some_and(|p| p < MISSPECIFIED);
    let refuted = others.iter().map(refuted).collect();
    let nearest = from_likelihood.filter(|near| study.follows(near));
    study.follows(&fit).then_some((fit, refuted, nearest))
}

/// How probable it is by chance that other values of the same parameters are so much worse (J. A. Hausman, *Econometrica* 46, 1978:
/// where both are consistent, the excess of the sum of squares over its minimum, in units of the noise, is at most chi-square with a
/// degree of freedom for each parameter).
pub(crate) fn agreement(study: &Study, least_squares: &Fit, point: &[f64]) -> Option<f64> {
    let numbers = least_squares.point.len();
    let square = |point: &[f64]| -> Option<f64> {
        let fit = Fit {
            form: Form::FreeRun,
            point: point[..numbers].to_vec(),
            ..least_squares.clone()
        };
        let whitened = (fit.noise).whiten_kept(&study.residual(&fit)?, study.mask());
        Some(whitened.iter().map(|e| e * e).sum())
    };
    let excess = square(point)? - square(&least_squares.point)?;
    let share = study.effective_share(least_squares)?;
    let law = ChiSquared::new(numbers as f64).ok()?;
    Some(law.sf(share * excess.max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Noise;

    fn rival(estimator: Estimator, whole: f64, misspecified: bool) -> Rival {
        Rival {
            search: 0,
            accepted: 0,
            estimator,
            fit: Fit {
                form: Form::FreeRun,
                point: vec![],
                noise: Noise::unit(1),
                deviance: 0.0,
                criterion: 0.0,
            },
            nearest: None,
            held_out: HeldOut {
                squares: vec![1.0],
                variances: vec![2.0],
                errors: vec![],
            },
            whole,
            misspecified,
        }
    }

    /// Of errors of 0.2 and more twice the mean square begins at 0.283.
    #[test]
    fn least_squares_refutes_what_leaves_twice_its_mean_square() {
        let kept = |given: f64, misspecified: bool| {
            let mut all = vec![
                rival(Estimator::Given, 9.0, true),
                rival(Estimator::Likelihood, 0.21, true),
                rival(Estimator::FreeRun, 0.2, false),
                rival(Estimator::Given, given, misspecified),
            ];
            // The first belongs to another number of effects.
            drop_refuted(&mut all, 1);
            all.len()
        };
        assert_eq!(kept(0.28, true), 4);
        assert_eq!(kept(0.29, true), 3);
        assert_eq!(kept(0.29, false), 4);
        // A free run that explains less than half of the variance needs no test.
        assert_eq!(kept(0.70, false), 4);
        assert_eq!(kept(0.71, false), 3);
    }
}
