//! Score tests: how much each term at each place would take off the residual, if it were small.
//!
//! A term is propagated through the plant linearised along its predictions, whitened as the residual is, and what parameters
//! and initial states could do is projected off (C. R. Rao's score test, *Proc. Camb. Phil. Soc.* 44, 1948).

use rayon::prelude::*;

use super::curve::{Curve, curves};
use super::map::map;
use super::path::{Entry, Hooked, Path, TOGETHER, hooked, path};
use super::projection::{Projection, SIGNATURE};
use crate::explain::document::plots::spectrum;
use crate::explain::engine::fitting::edit::{Place, enters_several, is_of, sensors};
use crate::explain::engine::terms::argument::{Argument, ArgumentForm};
use crate::explain::engine::terms::arguments_of_plant::arguments;
use crate::explain::engine::terms::library::TERMS;
use crate::explain::engine::terms::names::{heats_itself, is_without_units, rank_of};
use crate::explain::engine::terms::term::{Needs, Port, Starts, Term};
use crate::explain::engine::terms::values::{Instance, evaluate, evaluate_with_ends, grid};
use crate::explain::engine::thresholds::significant;
use crate::explain::explanation::EquationMap;
use crate::noise::Series;
use crate::physics::estimate::{Fit, PlantRecording, Study};
use crate::physics::{ModelSpec, Node, Unknown, VariableId};

/// Numbers of columns that are evaluated in one plant; those with a memory one by one, each in steps of its own.
const BATCH: usize = 64;

/// Instants tried on either side of the best, each time in an interval so many times shorter.
const BETWEEN: usize = 8;
/// Ratios of the sizes at which something snaps that are tried after each other: the pattern of releases of a wandering input is
/// another one after a few per cent.
const RELEASES: [f64; 2] = [1.05, 1.01];
/// They are tried where the best at first has this part of the strongest test: a pattern that is half wrong still has half of the
/// right one's.
const NEAR: f64 = 0.5;

/// Terms whose columns differ by less than this angle are one: 1e-4 of the statistic of either tells them apart.
const SAME: f64 = 0.01;

/// Peaks of the spectrum of each output that are tried as periodic disturbances.
const PEAKS: usize = 3;
/// Fewer periods in a recording are a trend.
const LEAST_PERIODS: f64 = 3.0;

/// A term at a place, with the values of its shapes that the test liked best.
#[derive(Debug, Clone)]
pub(crate) struct Lead {
    pub(crate) term: &'static Term,
    pub(crate) place: Place,
    /// The place is a sensor's equation.
    pub(crate) sensor: bool,
    /// Place in the arguments; none for functions of time.
    pub(crate) argument: Option<usize>,
    pub(crate) shapes: Vec<f64>,
    /// Strength that the regression gives.
    pub strength: f64,
    /// What the regression adds to the numbers of the fit beside it; empty where that is not known.
    pub shift: Vec<f64>,
    /// Decrease of the deviance that it foretells.
    pub(crate) statistic: f64,
    /// What stands for the form of a curve.
    pub(crate) curve: Option<Curve>,
    /// A second equation that the term enters, and its strength there: what leaves one balance arrives in another.
    pub(crate) arrives: Option<(usize, f64)>,
    /// Products of its column with a few columns of noise: two terms that do the same to the recording have the same.
    signature: [f64; SIGNATURE],
}

impl Screen {
    /// Without leads, where nothing more is to be found.
    pub(in crate::explain::engine) fn clear(&mut self) {
        self.leads.clear();
        self.curves.clear();
    }
}

impl Lead {
    /// Whether it is the same term of the same argument at the same place.
    pub(in crate::explain::engine) fn is_alike(&self, other: &Self) -> bool {
        (self.term, self.place, self.argument) == (other.term, other.place, other.argument)
    }

    /// A term at a place that no test has looked at.
    pub(in crate::explain::engine) fn untested(term: &'static Term, place: Place) -> Self {
        Self {
            term,
            place,
            sensor: false,
            argument: None,
            shapes: vec![],
            strength: 0.0,
            shift: vec![],
            statistic: 0.0,
            curve: None,
            arrives: None,
            signature: [0.0; SIGNATURE],
        }
    }

    /// The same at a place of another text.
    pub(in crate::explain::engine) fn at(
        self,
        place: Place,
        argument: Option<usize>,
        shapes: &[f64],
    ) -> Self {
        Self {
            place,
            argument,
            shapes: shapes.to_vec(),
            ..self
        }
    }

    /// Whether a recording hardly tells two terms apart.
    fn same_as(&self, other: &Self) -> bool {
        let sign = if self.strength * other.strength < 0.0 {
            -1.0
        } else {
            1.0
        };
        let both = self.signature.iter().zip(&other.signature);
        let (apart, size) = both.fold((0.0, 0.0), |(d, s), (a, b)| {
            (d + (a - sign * b).powi(2), s + a * a)
        });
        apart <= SAME * SAME * size
    }
}

/// Leads, best first, and what they depend on.
pub(crate) struct Screen {
    pub(crate) leads: Vec<Lead>,
    /// Curves at the best places, best first.
    pub(crate) curves: Vec<Lead>,
    pub(crate) map: EquationMap,
    /// Number of tests.
    pub(crate) tests: usize,
    /// Whether the states were not those of the fit: it is far from what its terms would make of it.
    pub(crate) strays: bool,
    pub(crate) arguments: Vec<Argument>,
}

/// Tests every term at every place that the given plant has; what effects have added to it is neither place nor argument.
pub(crate) fn screen(
    study: &Study,
    fit: &Fit,
    along: &Fit,
    given: &ModelSpec,
    recordings: &[PlantRecording],
) -> Option<Screen> {
    let spec = &study.plant().spec;
    let mut arguments = arguments(spec);
    arguments.retain(|a| a.variables.iter().all(|&v| is_of(spec, v, given)));
    let hooked = hooked(spec, given, &arguments)?;
    let path = path(study, (along, fit), &hooked, recordings, &mut arguments)?;
    let projection = Projection::new(study, fit)?;
    let sensors = sensors(spec);
    let inputs = spec.inputs();
    let shown: Vec<VariableId> = sensors
        .iter()
        .flat_map(|&at| {
            let equation = &spec.equations[at];
            let copied = match spec.expressions.node(equation.rest) {
                Node::Variable(x) => Some(x),
                _ => None,
            };
            [Some(equation.unknown.variable()), copied]
        })
        .flatten()
        .collect();
    let peaks = peaks(study, fit, recordings);
    // All terms at all arguments that some place takes.
    let mut instances: Vec<Instance> = Vec::new();
    for term in TERMS {
        let candidates: Vec<Option<usize>> = if term.needs == Needs::Time {
            vec![None]
        } else {
            let serves = |a: &Argument| {
                (a.spread() > 0.0 || term.needs == Needs::SwitchedOn)
                    && (a.serves(term.needs)
                        || a.form == ArgumentForm::Product && term.id == "linear")
                    && (!term.remembers_way() || a.reverses())
                    && match term.port {
                        Port::Input => a.variables.len() == 1 && inputs.contains(&a.variables[0]),
                        Port::Sensor => {
                            term.needs == Needs::Another
                                || a.variables.len() == 1 && shown.contains(&a.variables[0])
                        }
                        Port::Equation | Port::Parameter => true,
                    }
            };
            (0..arguments.len())
                .filter(|&a| serves(&arguments[a]))
                .map(Some)
                .collect()
        };
        for argument in candidates {
            for shapes in grid(term, argument.map(|a| &arguments[a]), recordings, &peaks) {
                instances.push(Instance {
                    term,
                    argument,
                    shapes,
                });
            }
        }
    }
    let shown = study.gain(along).map(|_| {
        let each = arguments.iter().map(Argument::before_correction);
        each.collect::<Vec<_>>()
    });
    let tests = Tests {
        shown: shown.as_deref().unwrap_or(&arguments),
        study,
        fit,
        recordings,
        arguments: &arguments,
        hooked: &hooked,
        path: &path,
        projection: &projection,
    };
    let (remembering, instances): (Vec<_>, Vec<_>) = instances
        .into_iter()
        .partition(|i| !i.term.memories.is_empty());
    let chunks: Vec<&[Instance]> = instances
        .chunks(BATCH)
        .chain(remembering.chunks(1))
        .collect();
    let mut leads: Vec<Lead> = chunks
        .into_par_iter()
        .flat_map_iter(|chunk| tests.of(chunk))
        .collect();
    let count = leads.len();
    let found: Vec<Lead> = TERMS
        .par_iter()
        .flat_map_iter(|term| tests.between(term, &leads))
        .collect();
    leads.extend(found);
    leads.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
    let significant = significant(count) / study.information();
    let map = map(&leads, spec, &arguments, study.count(), significant);
    let leads = distinct(leads, spec, &arguments);
    let whiten = |series: &Series| fit.noise.whiten_kept(series, study.mask());
    let curves = curves(
        spec,
        &leads,
        &arguments,
        &hooked,
        &path,
        &projection,
        &whiten,
    );
    Some(Screen {
        leads,
        curves,
        map,
        tests: count,
        strays: !std::ptr::eq(fit, along),
        arguments,
    })
}

/// What score tests need.
struct Tests<'a> {
    study: &'a Study<'a>,
    fit: &'a Fit,
    recordings: &'a [PlantRecording],
    arguments: &'a [Argument],
    /// The same as sensors are expected to show them.
    shown: &'a [Argument],
    hooked: &'a Hooked,
    path: &'a Path,
    projection: &'a Projection,
}

/// Values of shapes to test, from the best ones, so many steps of this size away.
type Moved<'a> = dyn Fn(&[f64], f64, f64) -> Vec<Vec<f64>> + 'a;

impl Tests<'_> {
    /// Tests terms at every place that takes them.
    fn of(&self, chunk: &[Instance]) -> Vec<Lead> {
        let hold = self.study.hold();
        let at_sensor = |i: &&Instance| i.term.port == Port::Sensor;
        let of_sensors: Vec<Instance> = chunk.iter().filter(at_sensor).cloned().collect();
        let others: Vec<Instance> = chunk.iter().filter(|i| !at_sensor(i)).cloned().collect();
        let values = evaluate_with_ends(&others, self.arguments, self.recordings, hold);
        let signals: Vec<(&Instance, [Series; 2])> = (others.iter())
            .zip(values.into_iter().flatten())
            .filter(|(_, both)| both.iter().flatten().flatten().all(|v| v.is_finite()))
            .collect();
        let mut leads = Vec::new();
        let values = evaluate(&of_sensors, self.shown, self.recordings);
        for (instance, signal) in of_sensors.iter().zip(values.into_iter().flatten()) {
            if signal.iter().flatten().all(|v| v.is_finite()) {
                leads.extend(self.at_sensors(instance, &signal));
            }
        }
        for (&place, &column) in self.hooked.places.iter().zip(&self.hooked.columns) {
            let here: Vec<&(&Instance, [Series; 2])> = (signals.iter())
                .filter(|(instance, _)| self.fits(instance, place))
                .collect();
            for together in here.chunks(TOGETHER) {
                let entering: Vec<(&Series, &Series)> = (together.iter())
                    .map(|(_, [signal, ends])| (signal, ends))
                    .collect();
                let propagated = self.path.propagate(Entry::Hook(column), &entering);
                let each = together.iter().zip(&propagated);
                leads
                    .extend(each.filter_map(|((i, _), series)| self.test(i, place, false, series)));
            }
        }
        leads
    }

    fn argument(&self, instance: &Instance) -> Option<&Argument> {
        instance.argument.map(|a| &self.arguments[a])
    }

    /// Tests what a term does to the outputs.
    fn test(
        &self,
        instance: &Instance,
        place: Place,
        sensor: bool,
        series: &Series,
    ) -> Option<Lead> {
        let column = self.fit.noise.whiten_kept(series, self.study.mask());
        let tested = (self.projection).test(column, instance.term.free_strength)?;
        Some(Lead {
            term: instance.term,
            place,
            sensor,
            argument: instance.argument,
            shapes: instance.shapes.clone(),
            strength: tested.strength,
            shift: tested.shift,
            statistic: tested.statistic,
            curve: None,
            arrives: None,
            signature: tested.signature,
        })
    }

    /// Tests a term of a sensor at the sensors that take it.
    fn at_sensors(&self, instance: &Instance, signal: &Series) -> Vec<Lead> {
        let spec = &self.study.plant().spec;
        let outputs = spec.outputs();
        let argument = self.argument(instance);
        let of = |at: usize| {
            let v = spec.equations[at].unknown.variable();
            let o = outputs.iter().position(|&y| y == v)?;
            let shown = spec.expressions.node(spec.equations[at].rest);
            let own = argument.is_none_or(|a| {
                let own =
                    a.variables == [v] || matches!(shown, Node::Variable(x) if a.variables == [x]);
                match instance.term.needs {
                    Needs::Another => !own && a.known_after.is_none_or(|k| k < at),
                    _ => own,
                }
            });
            let test = || {
                let propagated = self.path.propagate(Entry::Sensor(o), &[(signal, signal)]);
                self.test(instance, Place::Equation(at), true, propagated.first()?)
            };
            own.then(test).flatten()
        };
        sensors(spec).into_iter().filter_map(of).collect()
    }

    /// Whether a term that is none of a sensor may enter at a place.
    fn fits(&self, instance: &Instance, place: Place) -> bool {
        let spec = &self.study.plant().spec;
        let argument = self.argument(instance);
        match (place, instance.term.port) {
            (Place::Equation(at), Port::Equation) if instance.term.needs == Needs::OwnState => {
                let own = spec.equations[at].unknown;
                argument.is_some_and(|a| own == Unknown::Derivative(a.variables[0]))
            }
            (Place::Equation(at), Port::Equation) if instance.term.needs == Needs::Integrated => {
                argument.is_some_and(|a| integrates(spec, at, a.variables[0]))
            }
            (Place::Equation(at), Port::Equation) => {
                argument.is_none_or(|a| a.known_after.is_none_or(|k| k < at))
            }
            (Place::Input(v), Port::Input) => argument.is_some_and(|a| a.variables == [v]),
            // Equations that were found from columns have no variable for a force between bodies.
            (Place::Input(v), Port::Equation) => {
                !matches!(instance.term.needs, Needs::OwnState | Needs::Integrated)
                    && is_without_units(spec)
                    && enters_several(spec, v)
                    && argument.is_some_and(|a| !a.held && a.known_after.is_none())
            }
            (Place::Parameter(p), Port::Parameter) => {
                let unit = spec.variable(p).unit_text.as_deref();
                let units = instance.term.units;
                let heats = || argument.is_some_and(|a| heats_itself(spec, p, &a.variables));
                (units.is_empty() || unit.is_some_and(|u| units.contains(&u)) || heats())
                    && argument.is_none_or(|a| a.known_after.is_none())
            }
            _ => false,
        }
    }

    /// Shapes between those that were tested, where descent cannot find the best, because what a recording says of them changes in
    /// jumps: instants, to the sample, and sizes at which something snaps.
    fn between(&self, term: &'static Term, tested: &[Lead]) -> Vec<Lead> {
        let Some((shape, others)) = term.shapes.split_first() else {
            return vec![];
        };
        // The strongest with each value of the other shapes.
        let mut best: Vec<&Lead> = Vec::new();
        for lead in tested.iter().filter(|l| l.term == term) {
            match best.iter_mut().find(|b| b.shapes[1..] == lead.shapes[1..]) {
                Some(known) if known.statistic < lead.statistic => *known = lead,
                Some(_) => {}
                None => best.push(lead),
            }
        }
        match shape.starts {
            Starts::Instants(parts) => {
                let mut rounds = Vec::new();
                let mut step = self.study.duration() * (parts[1] - parts[0]);
                while step > self.recordings[0].sample_time {
                    // An end is found once its beginning is, and was tested at few lengths.
                    rounds.extend(others.iter().flat_map(|_| [step, step]));
                    step /= BETWEEN as f64;
                    rounds.push(step);
                }
                // The beginning, and, of what lasts, the end too.
                let moved = |shapes: &[f64], k: f64, step: f64| {
                    let by = k * step;
                    match *shapes {
                        [begin, length] => {
                            vec![vec![begin + by, length - by], vec![begin, length + by]]
                        }
                        _ => vec![vec![shapes[0] + by]],
                    }
                };
                let strongest = best.into_iter();
                let strongest = strongest.max_by(|a, b| a.statistic.total_cmp(&b.statistic));
                let each = strongest.into_iter();
                each.flat_map(|b| self.rounds(b, &rounds, BETWEEN - 1, &moved))
                    .collect()
            }
            Starts::Releases(parts) => {
                let most = tested.iter().map(|l| l.statistic).fold(0.0, f64::max);
                let close = best.into_iter().filter(|b| b.statistic >= NEAR * most);
                let whole = (parts[parts.len() - 1] / parts[0]).ln();
                let [first, finer] = RELEASES.map(f64::ln);
                let of = |best: &Lead| {
                    let tested = tested
                        .iter()
                        .filter(|l| (l.term, l.argument) == (term, best.argument));
                    let (least, most) = tested.fold((f64::INFINITY, 0.0f64), |(least, most), l| {
                        (least.min(l.shapes[0]), most.max(l.shapes[0]))
                    });
                    let moved = |shapes: &[f64], k: f64, step: f64| {
                        let size = shapes[0] * (k * step).exp();
                        let whole = [&[size], &shapes[1..]].concat();
                        let tested = (least..=most).contains(&size);
                        Vec::from_iter(tested.then_some(whole))
                    };
                    // The first round goes over all that were tested.
                    let count = (whole / first).ceil() as usize;
                    let mut found = self.rounds(best, &[first], count, &moved);
                    let strongest = found.iter().chain([best]);
                    let strongest = strongest.max_by(|a, b| a.statistic.total_cmp(&b.statistic));
                    if let Some(best) = strongest.cloned() {
                        found.extend(self.rounds(&best, &[finer], BETWEEN - 1, &moved));
                    }
                    found
                };
                close.flat_map(of).collect()
            }
            _ => vec![],
        }
    }

    /// So many steps of shapes to either side of the best, which may move it, in each round.
    fn rounds(&self, best: &Lead, steps: &[f64], count: usize, moved: &Moved) -> Vec<Lead> {
        let mut best = best.clone();
        let mut found = Vec::new();
        for &step in steps {
            let finer: Vec<Instance> = (1..=count)
                .flat_map(|k| [-1.0, 1.0].map(|sign| sign * k as f64))
                .flat_map(|k| moved(&best.shapes, k, step))
                .filter(|shapes| {
                    let each = best.term.shapes.iter().zip(shapes);
                    each.into_iter().all(|(s, v)| !s.positive || *v > 0.0)
                })
                .map(|shapes| Instance {
                    term: best.term,
                    argument: best.argument,
                    shapes,
                })
                .collect();
            let leads: Vec<Lead> = match best.term.memories {
                [] => self.of(&finer),
                _ => finer
                    .par_chunks(1)
                    .flat_map_iter(|one| self.of(one))
                    .collect(),
            };
            let strongest = leads
                .iter()
                .max_by(|a, b| a.statistic.total_cmp(&b.statistic));
            if let Some(lead) = strongest.filter(|l| l.statistic > best.statistic) {
                best = lead.clone();
            }
            found.extend(leads);
        }
        found
    }
}

/// Whether an equation determines the derivative of a state, and does not depend on it.
pub(in crate::explain::engine) fn integrates(
    spec: &ModelSpec,
    at: usize,
    state: VariableId,
) -> bool {
    let equation = &spec.equations[at];
    equation.unknown == Unknown::Derivative(state)
        && !spec.expressions.variables(equation.rest).contains(&state)
}

/// Frequencies in rad/s at which the whitened residual has most power, the strongest of each output; those of fewer periods than
/// [`LEAST_PERIODS`] in a recording are trends.
fn peaks(study: &Study, fit: &Fit, recordings: &[PlantRecording]) -> Vec<f64> {
    let Some(residual) = study.residual(fit) else {
        return vec![];
    };
    let whitened = fit.noise.whiten(&residual, study.mask());
    let (l, h) = (study.outputs(), recordings[0].sample_time);
    let mut found = Vec::new();
    for o in 0..l {
        let power = spectrum(&whitened, l, o, h);
        let least = LEAST_PERIODS / study.duration();
        let mut of_output: Vec<(f64, f64)> = power
            .windows(3)
            .filter(|w| w[1].0 >= least && w[1].1 > w[0].1 && w[1].1 >= w[2].1)
            .map(|w| {
                // The vertex of the parabola through three values of the window's main lobe.
                let bend = w[0].1 - 2.0 * w[1].1 + w[2].1;
                let shift = 0.5 * (w[0].1 - w[2].1) / bend.min(-f64::MIN_POSITIVE);
                (w[1].1, w[1].0 + shift.clamp(-0.5, 0.5) * (w[1].0 - w[0].0))
            })
            .collect();
        of_output.sort_by(|a, b| b.0.total_cmp(&a.0));
        of_output.truncate(PEAKS);
        found.extend(of_output.iter().map(|p| 2.0 * std::f64::consts::PI * p.1));
    }
    found
}

/// Of the best leads that do the same to the recording, the most specific one, and of these the simplest; best first.
fn distinct(leads: Vec<Lead>, spec: &ModelSpec, arguments: &[Argument]) -> Vec<Lead> {
    let rank = |l: &Lead| {
        let variables = l.argument.map_or(&[][..], |a| &arguments[a].variables);
        let numbers = l.term.shapes.len() + l.term.memories.len();
        let rank = rank_of(spec, l.term, l.place, variables);
        (rank, variables.len(), numbers)
    };
    let mut kept: Vec<Lead> = Vec::new();
    for lead in leads {
        // The same column has the same statistic.
        let near = |k: &&mut Lead| k.statistic < (1.0 + 4.0 * SAME) * lead.statistic + 1e-9;
        let like = kept.iter_mut().rev().take_while(near);
        // Which of two sensors it is, parameters say that would have to make up for it.
        let other_sensor = |k: &Lead| k.sensor && lead.sensor && k.place != lead.place;
        match (like.into_iter()).find(|k| k.same_as(&lead) && !other_sensor(k)) {
            Some(known) if rank(&lead) < rank(known) => *known = lead,
            Some(_) => {}
            None => kept.push(lead),
        }
    }
    kept
}
