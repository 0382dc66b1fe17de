//! Where candidates of a step start: score tests along several fits of the plant.

use super::Stage;
use crate::explain::engine::fitting::second_effect::{are_apart, drop_alike};
use crate::explain::engine::screening::screen::{Lead, Screen, screen};
use crate::explain::engine::terms::names::{called, named};
use crate::explain::engine::thresholds::{FORETOLD, LEFT, MOST, chance};
use crate::explain::explanation::EquationMap;
use crate::physics::estimate::{Fit, Form};

/// Score tests, and the fit that their candidates start from.
pub(super) struct Origin {
    pub(super) screen: Screen,
    pub(super) fit: Fit,
}

/// All of a step.
pub(super) struct Origins {
    /// The first is the fit of the plant itself.
    pub(super) all: Vec<Origin>,
    /// The strongest test of the first, and how many there were.
    pub(super) strongest: (f64, usize),
    pub(super) map: Option<EquationMap>,
    /// A free run from the values of the text, before effects were found.
    pub(super) from_text: Option<Fit>,
    /// Whether the free run strays from the recording.
    pub(super) strays: bool,
}

impl Origins {
    pub(super) fn new(stage: &Stage) -> Self {
        let Stage {
            study,
            fit,
            options,
            ..
        } = *stage;
        let screened =
            |fit: &Fit, along: &Fit| screen(study, fit, along, stage.given, stage.recordings);
        let first = screened(fit, fit);
        let strongest = first.as_ref().map_or((0.0, 0), |s| {
            let best = s.leads.first().map_or(0.0, |l| l.statistic);
            (study.information() * best, s.tests)
        });
        let map = first.as_ref().map(|s| s.map.clone());
        // In free run with white noise: under the noise of a fit that does not follow, the values of the text lead to another that
        // does not.
        let free = Fit {
            form: Form::FreeRun,
            point: fit.point[..study.nominal().len()].to_vec(),
            ..fit.clone()
        };
        let from_text = study.gaussian(&free).and_then(|f| stage.of_text(&f));
        let origin = |screen: Screen, fit: &Fit| Origin {
            screen,
            fit: fit.clone(),
        };
        let mut all: Vec<Origin> = first.into_iter().map(|s| origin(s, fit)).collect();
        // Beside an effect that was found, a second one is looked for only where a test says that something is left.
        let insignificant = chance(strongest.0) * strongest.1 as f64 > LEFT;
        let absorbed = !options.least_squares && study.absorbs(fit);
        let nothing_left = insignificant && !absorbed;
        if stage.accepted > 0 && nothing_left || stage.accepted == MOST {
            all.iter_mut().for_each(|o| o.screen.clear());
            return Self {
                all,
                strongest,
                map,
                from_text,
                strays: false,
            };
        }
        // A noise model that was fitted where physics is missing absorbs it: the same again under white noise. A drift of a sensor that it
        // absorbs takes the free run far away.
        let mut free_run = options.least_squares.then(|| fit.clone());
        if !options.least_squares {
            let useful = |white: &Fit| absorbed || study.follows(white);
            free_run = study.least_squares(&fit.point).filter(useful);
            if let Some(white) = &free_run {
                all.extend(screened(white, white).map(|s| origin(s, white)));
            }
        }
        // Where a free run strays from the recording, what a term would do depends on where the recording was. That an observer
        // follows the noise too is of no matter for where fits start, but would be for the test above.
        let white = free_run.or_else(|| from_text.clone());
        let along = white
            .as_ref()
            .and_then(|white| study.along_recording(white));
        let strays = along.is_some();
        if let Some((white, along)) = white.zip(along)
            && let Some(mut s) = screened(&white, &along)
        {
            // What depends on inputs or time alone is the same along both, and what a sensor would show along the recording is the
            // recording.
            s.leads
                .retain(|l| !l.sensor && l.argument.is_some_and(|a| !s.arguments[a].held));
            all.push(origin(s, &white));
        }
        // Heavy tails discount what is rare and large, such as the contact with an end stop, and an observer recovers from it: the
        // same again where every value counts.
        if fit.form == Form::Innovation
            && fit.noise.degrees.is_finite()
            && let Some(gaussian) = study.gaussian(fit)
            && let Some(s) = screened(&gaussian, &gaussian)
            && chance(s.leads.first().map_or(0.0, |l| l.statistic)) * s.tests as f64 <= LEFT
        {
            all.push(origin(s, &gaussian));
        }
        // Where there is no free run to look at, what no test finds is what a candidate does to the observer.
        if all.len() == 1 && insignificant && !options.least_squares {
            all[0].screen.clear();
        }
        for origin in &mut all {
            restrict(&mut origin.screen, stage);
        }
        Self {
            all,
            strongest,
            map,
            from_text,
            strays,
        }
    }
}

/// What may be named in this step, and, beside an effect, what its test foretells enough of.
fn restrict(screen: &mut Screen, stage: &Stage) {
    let spec = &stage.plant.spec;
    stage.scope.restrict(spec, screen);
    if stage.accepted > 0 {
        let least = FORETOLD * stage.needed / stage.study.information();
        let arguments = &screen.arguments;
        // What often acts beside the first, as a function of the same, is fitted in any case.
        let often = |l: &Lead| {
            let variables = l.argument.map_or(&[][..], |a| &arguments[a].variables);
            let id = called(spec, l.term, l.place, variables);
            stage.first.is_some_and(|first| {
                l.place == first.lead.place
                    && spec.names(variables) == first.depends
                    && are_apart(id, named(stage.given, first))
            })
        };
        screen.leads.retain(|l| l.statistic >= least || often(l));
        screen.curves.retain(|l| l.statistic >= least);
    }
    if let Some(first) = stage.first {
        drop_alike(screen, spec, (first, named(stage.given, first)));
    }
}

impl Stage<'_> {
    /// A fit with the parameters of the text. What the plant's parameters have done to make up for a term may lead far from what
    /// they are beside it.
    pub(super) fn of_text(&self, from: &Fit) -> Option<Fit> {
        let text = (self.accepted == 0).then(|| self.study.nominal())?;
        let mut point = from.point.clone();
        point[..text.len()].copy_from_slice(&text);
        Some(Fit {
            point,
            ..from.clone()
        })
    }
}
