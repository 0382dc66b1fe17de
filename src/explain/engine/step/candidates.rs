//! Fits of promising terms: all at a glance, the best of them as far as they go.

use rayon::prelude::*;

use super::Stage;
use super::origins::{Origin, Origins};
use super::promising::{is_specific, promising};
use crate::explain::engine::fitting::candidate::{Candidate, candidate};
use crate::explain::engine::fitting::edit::{Place, places};
use crate::explain::engine::fitting::fitted::{Fitted, TIE, forms, searched, with_more};
use crate::explain::engine::fitting::release::released;
use crate::explain::engine::misled::reacting_inputs;
use crate::explain::engine::screening::screen::{Lead, integrates};
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::terms::library::TERMS;
use crate::explain::engine::terms::names::{called, named};
use crate::explain::engine::terms::term::Needs;
use crate::explain::engine::terms::values::grid;
use crate::explain::engine::thresholds::{
    COMPARED, FITTED, FOLLOWS, GLANCE, GLANCED_STEPS, MOST_STEPS, NEEDED, THOROUGH, times_more,
};
use crate::physics::ModelSpec;
use crate::physics::estimate::{Fit, Form, Study};

/// Terms with a name that are fitted at the place of a best that has none, and of one form.
const NAMED_THERE: usize = 6;
const NAMED_OF_A_FORM: usize = 2;

/// Limits of what integrates that are fitted thoroughly: one of each kind.
const LIMITS: usize = 3;

/// Parts of its strength with which a term begins where the whole of it lets no run end.
const WEAKER: &[f64] = &[0.3, 0.1, 0.03];

/// The fit as a free run, with so many of its numbers.
fn free_run(fit: &Fit, numbers: usize) -> Fit {
    Fit {
        form: Form::FreeRun,
        point: fit.point[..numbers].to_vec(),
        ..fit.clone()
    }
}

/// A lead that was fitted with the noise of the fit before, and what that gains.
#[derive(Clone)]
struct Glanced {
    gain: f64,
    lead: Lead,
    origin: usize,
    candidate: Candidate,
    fit: Fit,
}

/// The fits of one step.
pub(super) struct Candidates<'a> {
    pub(super) stage: &'a Stage<'a>,
    pub(super) origins: &'a Origins,
}

impl Candidates<'_> {
    /// Candidates that were fitted, not yet until nothing changes.
    pub(super) fn fitted(&self) -> Vec<Fitted> {
        let chosen = self.chosen();
        let mut fitted: Vec<Fitted> = chosen.into_par_iter().filter_map(|g| self.fit(g)).collect();
        fitted.extend(self.named_at_the_best(&fitted));
        fitted.extend(self.limits());
        fitted
    }

    /// Limits of what integrates, whatever a test said of them: the plant without them runs far beyond, where nothing is like the recording,
    /// and a limit that is not reached does nothing. They begin at the ends of what was recorded, with parameters as they were and as
    /// the text has them.
    fn limits(&self) -> Vec<Fitted> {
        let Some(at) = self.origins.all.len().checked_sub(1) else {
            return vec![];
        };
        let Origin { screen, fit } = &self.origins.all[at];
        if screen.leads.is_empty() {
            return vec![];
        }
        let spec = &self.stage.plant.spec;
        let mut leads: Vec<Lead> = Vec::new();
        for place in places(spec, self.stage.given) {
            let Place::Equation(equation) = place else {
                continue;
            };
            let own = |a: &Argument| {
                a.serves(Needs::Integrated) && integrates(spec, equation, a.variables[0])
            };
            let Some(argument) = screen.arguments.iter().position(own) else {
                continue;
            };
            let limits = TERMS.iter().filter(|t| t.needs == Needs::Integrated);
            leads.extend(limits.flat_map(|term| {
                let argument_of = Some(&screen.arguments[argument]);
                let starts = grid(term, argument_of, self.stage.recordings, &[]);
                let lead = |shapes: Vec<f64>| {
                    Lead::untested(term, place).at(place, Some(argument), &shapes)
                };
                starts.into_iter().map(lead)
            }));
        }
        leads.retain(|l| {
            let variables = l
                .argument
                .map_or(&[][..], |a| &screen.arguments[a].variables);
            self.stage
                .scope
                .allows(called(spec, l.term, l.place, variables))
        });
        // An observer finds the same from wherever it starts.
        let from = [(fit, self.origins.strays)].into_iter();
        let from = from.chain(self.origins.from_text.iter().map(|text| (text, false)));
        // What the same start and effort leave without a limit.
        let from: Vec<(&Fit, bool, f64)> = from
            .map(|(fit, observed)| (fit, observed, self.without_limit(fit)))
            .collect();
        let starts: Vec<_> = (leads.iter())
            .flat_map(|lead| from.iter().map(move |from| (lead, from)))
            .collect();
        let begun = starts
            .into_par_iter()
            .filter_map(|(lead, &(from, observed, without))| {
                let (begun, deviance) = self.begin_limit(lead, at, from)?;
                // A free run that strays says little of which limit it is.
                let order = match observed {
                    true => f64::NEG_INFINITY,
                    false => deviance,
                };
                (observed || deviance < without - NEEDED).then_some((order, begun, observed))
            });
        let mut begun: Vec<(f64, Glanced, bool)> = begun.collect();
        begun.sort_by(|a, b| a.0.total_cmp(&b.0));
        let observed = begun.iter().filter(|b| b.2).count();
        begun.truncate(observed + LIMITS);
        let each = begun
            .into_par_iter()
            .filter_map(|(_, begun, observed)| self.limit(begun, observed));
        each.flatten_iter().collect()
    }

    /// Deviance of the free run with white noise after a few steps without a limit; infinite where there is none.
    fn without_limit(&self, from: &Fit) -> f64 {
        let study = self.stage.study;
        let start = study.gaussian(&free_run(from, study.nominal().len()));
        let fit = start.and_then(|start| study.refit(&start, 0, GLANCE));
        let fit = fit.and_then(|fit| study.gaussian(&fit));
        fit.map_or(f64::INFINITY, |fit| fit.deviance)
    }

    /// A limit after a few steps of its fit in free run, and the deviance of that with white noise.
    fn begin_limit(&self, lead: &Lead, origin: usize, from: &Fit) -> Option<(Glanced, f64)> {
        let Stage {
            plant,
            study,
            recordings,
            ..
        } = *self.stage;
        let screen = &self.origins.all[origin].screen;
        let made = candidate(&plant.spec, lead, &screen.arguments, recordings)?;
        let options = with_more(self.stage.options, made.values.len());
        let rough = made.rough(study, MOST_STEPS);
        let inner = study.of(&rough, &options).ok()?;
        let start = made.from(&free_run(from, study.nominal().len()), study.parameters());
        let start = inner.gaussian(&start)?;
        let fit = inner.refit(&start, 0, GLANCE)?;
        let deviance = inner.gaussian(&fit)?.deviance;
        let glanced = Glanced {
            gain: 0.0,
            lead: lead.clone(),
            origin,
            candidate: made,
            fit: start,
        };
        Some((glanced, deviance))
    }

    /// Fits of a limit in free run, and with an observer where a free run strays: where something else bends the rate too, it reaches the
    /// ends at other times than the recording.
    fn limit(&self, begun: Glanced, observed: bool) -> Option<Vec<Fitted>> {
        let study = self.stage.study;
        let options = with_more(self.stage.options, begun.candidate.values.len());
        let rough = begun.candidate.rough(study, MOST_STEPS);
        let inner = study.of(&rough, &options).ok()?;
        let start = begun.fit.clone();
        let observed = observed
            .then(|| inner.along_recording(&start))
            .flatten()
            .and_then(|along| inner.refit(&along, 1, THOROUGH));
        let from_observed = (observed.as_ref())
            .and_then(|along| inner.gaussian(&free_run(along, start.point.len())));
        let best = (std::iter::once(start).chain(from_observed))
            .filter_map(|start| inner.refit(&start, 1, THOROUGH))
            .min_by(|a, b| a.criterion.total_cmp(&b.criterion));
        // Least squares of the free run are not compared with what an observer leaves.
        let observed = observed.filter(|_| !self.stage.options.least_squares);
        let fits = best.into_iter().chain(observed);
        let fitted = fits.filter_map(|fit| {
            self.fit(Glanced {
                fit,
                ..begun.clone()
            })
        });
        Some(fitted.collect())
    }

    /// How many times more is tried.
    fn more(&self) -> usize {
        let study = self.stage.study;
        times_more(study.count().max(study.samples()))
    }

    /// The best at a glance of each screen, and those close to it that have a name of their own.
    fn chosen(&self) -> Vec<Glanced> {
        let (spec, more) = (&self.stage.plant.spec, self.more());
        let leads = (self.origins.all.iter().enumerate()).flat_map(|(i, origin)| {
            let each = promising(&origin.screen, spec, more).into_iter();
            each.map(move |lead| (i, lead))
        });
        let leads: Vec<(usize, Lead)> = leads.collect();
        let glanced = leads.into_par_iter().filter_map(|(i, l)| self.glance(i, l));
        let mut glanced: Vec<Glanced> = glanced.collect();
        glanced.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let mut chosen = Vec::new();
        for (i, origin) in self.origins.all.iter().enumerate() {
            let mut of_origin = glanced.iter().filter(|g| g.origin == i);
            let best: Vec<&Glanced> = of_origin.by_ref().take(more * FITTED).collect();
            let most = best.first().map_or(0.0, |g| g.gain);
            let close = |g: &&Glanced| {
                g.gain > (1.0 - TIE.1) * most && is_specific(&g.lead, &origin.screen, spec)
            };
            // A few steps may not do what the strongest test foretells.
            let strongest = glanced.iter().filter(|g| g.origin == i);
            let strongest = strongest.max_by(|a, b| a.lead.statistic.total_cmp(&b.lead.statistic));
            let known = |g: &&Glanced| best.iter().any(|b| std::ptr::eq(*b, *g)) || close(g);
            chosen.extend(strongest.filter(|g| !known(g)).cloned());
            chosen.extend(best.into_iter().cloned());
            chosen.extend(of_origin.filter(close).cloned());
        }
        chosen
    }

    /// A fit with the noise of the fit before.
    fn glance(&self, at: usize, lead: Lead) -> Option<Glanced> {
        let Stage {
            plant,
            study,
            recordings,
            ..
        } = *self.stage;
        let Origin { screen, fit: from } = &self.origins.all[at];
        let parameters = study.parameters();
        let made = candidate(&plant.spec, &lead, &screen.arguments, recordings)?;
        let options = with_more(self.stage.options, made.values.len());
        let rough = made.rough(study, GLANCED_STEPS);
        let inner = study.of(&rough, &options).ok()?;
        let start = match screen.strays {
            true => started(&inner, &made, &lead, (study, from)),
            false => made.from(from, parameters),
        };
        // What a memory does within a sample, such as a contact, frozen slopes do not see.
        let glance = |start: &Fit| match made.new_states {
            0 => inner.glance(start, GLANCE),
            _ => inner.refit(start, 0, GLANCE),
        };
        let text = self.stage.of_text(from).filter(|_| self.more() > 1);
        let otherwise =
            text.or_else(|| study.off_bounds(from, self.stage.given.parameters().len()));
        let otherwise = otherwise.and_then(|text| glance(&made.from(&text, parameters)));
        let begun = glance(&start).or_else(|| {
            // A parameter that its term turns negative may stop the plant.
            let weaker = lead.term.free_strength.then_some(WEAKER)?;
            weaker.iter().find_map(|part| {
                let mut start = start.clone();
                start.point[parameters + made.values.len() - 1] *= part;
                glance(&start)
            })
        });
        let fitted = (begun.into_iter().chain(otherwise))
            .min_by(|a, b| a.deviance.total_cmp(&b.deviance))?;
        let again = |fit: &Fit| inner.refit(fit, 0, GLANCE);
        let fit = released(&inner, lead.term, parameters, fitted, &again);
        Some(Glanced {
            gain: from.deviance - fit.deviance,
            lead,
            origin: at,
            candidate: made,
            fit,
        })
    }

    /// A fit with a noise model of its own.
    fn fit(&self, glanced: Glanced) -> Option<Fitted> {
        let Stage {
            plant,
            study,
            fit: before,
            recordings,
            ..
        } = *self.stage;
        let Glanced {
            lead,
            candidate: made,
            fit: from,
            ..
        } = glanced;
        let arguments = &self.origins.all[glanced.origin].screen.arguments;
        let options = with_more(self.stage.options, made.values.len());
        let rough = made.rough(study, MOST_STEPS);
        let inner = study.of(&rough, &options).ok()?;
        let starts = forms(from, before, study.gains());
        let best = starts
            .iter()
            .filter_map(|start| match made.new_states {
                0 => inner.compare(start, COMPARED),
                _ => inner.refit(start, 1, THOROUGH),
            })
            .filter(|fit| {
                fit.form == Form::Innovation
                    || inner.follows(fit) && still_shows((&inner, fit), &lead, &plant.spec)
            })
            .filter(|fit| !self.answers((&inner, fit), &lead, arguments))
            .min_by(|a, b| a.criterion.total_cmp(&b.criterion))?;
        let gain = before.criterion - best.criterion - searched(&lead, recordings);
        let argument = lead.argument.map(|a| &arguments[a]);
        let fitted = Fitted {
            depends: vec![],
            argument: String::new(),
            range: (0.0, 0.0),
            travel: 0.0,
            usual: 0.0,
            comes_back: true,
            shapes: best.point[study.parameters()..][..lead.shapes.len()].to_vec(),
            lead,
            candidate: made,
            fit: best,
            gain,
            hypothesis: None,
            explains: false,
            proved: false,
            likelier: false,
        };
        Some(fitted.depending_on(argument, &plant.spec, recordings))
    }

    /// Whether a term adds to a sensor an input that answers what the sensor shows: it would follow the noise.
    fn answers(&self, (study, fit): (&Study, &Fit), lead: &Lead, arguments: &[Argument]) -> bool {
        let spec = &self.stage.plant.spec;
        let argument = lead.argument.filter(|_| lead.term.needs == Needs::Another);
        let input = argument.and_then(|a| {
            let inputs = spec.inputs();
            inputs.iter().position(|u| arguments[a].variables == [*u])
        });
        input.is_some_and(|input| {
            let reacting = reacting_inputs(study, fit, self.stage.recordings, study.hold());
            reacting.contains(&input)
        })
    }

    /// Where the best has no name, terms that have one at its place, whatever a glance said of them.
    fn named_at_the_best(&self, fitted: &[Fitted]) -> Vec<Fitted> {
        let spec = &self.stage.plant.spec;
        let best = fitted.iter().max_by(|a, b| a.gain.total_cmp(&b.gain));
        let unnamed = |f: &&Fitted| f.gain > self.stage.needed && named(spec, f) == "law";
        let Some(best) = best.filter(unnamed) else {
            return vec![];
        };
        let mut more: Vec<(usize, Lead)> = Vec::new();
        // A function of an input alone may be one of its actuator.
        let of_input = match &best.depends[..] {
            [name] => spec.find(name).map(Place::Input),
            _ => None,
        };
        for (i, origin) in self.origins.all.iter().enumerate() {
            let leads = origin.screen.leads.iter();
            let there = |l: &&Lead| l.place == best.lead.place || Some(l.place) == of_input;
            for lead in leads.filter(there) {
                let known = fitted.iter().any(|f| f.lead.is_alike(lead))
                    || more.iter().any(|(_, l)| l.is_alike(lead));
                let of_form = more.iter().filter(|(_, l)| l.term == lead.term).count();
                if !known
                    && is_specific(lead, &origin.screen, spec)
                    && of_form < NAMED_OF_A_FORM
                    && more.len() < NAMED_THERE
                {
                    more.push((i, lead.clone()));
                }
            }
        }
        let glanced = more.into_par_iter().filter_map(|(i, l)| self.glance(i, l));
        glanced.filter_map(|g| self.fit(g)).collect()
    }
}

/// Where the fit of a candidate starts: with the other numbers as they were, or as the regression on its term moves them.
fn started(inner: &Study, made: &Candidate, lead: &Lead, (study, from): (&Study, &Fit)) -> Fit {
    let parameters = study.parameters();
    let plain = made.from(from, parameters);
    if lead.shift.is_empty() {
        return plain;
    }
    let moved = Fit {
        point: study.moved(from, &lead.shift),
        ..from.clone()
    };
    let moved = made.from(&moved, parameters);
    let deviance = |fit: &Fit| inner.deviance(fit).unwrap_or(f64::INFINITY);
    if deviance(&moved) < deviance(&plain) {
        moved
    } else {
        plain
    }
}

/// Whether a sensor shows more than a constant with the term in it.
fn still_shows((study, fit): (&Study, &Fit), lead: &Lead, spec: &ModelSpec) -> bool {
    if !lead.sensor {
        return true;
    }
    let variable = lead.place.variable(spec);
    let output = spec.outputs().into_iter().position(|y| y == variable);
    let left = output.and_then(|o| study.left(fit)?.get(o).copied());
    left.is_none_or(|left| left < FOLLOWS * FOLLOWS)
}
