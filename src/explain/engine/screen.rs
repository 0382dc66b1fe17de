//! Score tests: how much each term at each place would take off the residual, if it were small.
//!
//! A term is propagated through the plant linearised along its predictions, whitened as the residual is, and what parameters
//! and initial states could do is projected off (C. R. Rao's score test, *Proc. Camb. Phil. Soc.* 44, 1948).

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::argument::{Argument, arguments};
use super::edit::{Edit, Place, literal, places, sensors};
use super::library::{Needs, Port, Starts, TERMS, Term};
use crate::noise::Series;
use crate::physics::estimate::{Fit, PlantRecording, Study};
use crate::physics::{Excitation, Hold, ModelSpec, Plant, parse};

/// A column of which less than this is left after projection is what parameters can do, but for rounding.
const LEAST_LEFT: f64 = 0.02;
/// Error of a step of a term's memory: a score test needs no more.
const TERM_ACCURACY: f64 = 1e-4;
/// Numbers of columns that are evaluated in one plant; those with a memory one by one, each in steps of its own.
const BATCH: usize = 64;

/// A term at a place, with the values of its shapes that the test liked best.
#[derive(Debug, Clone)]
pub(crate) struct Lead {
    pub term: &'static Term,
    pub place: Place,
    /// The place is a sensor's equation.
    pub sensor: bool,
    /// Place in the arguments; none for functions of time.
    pub argument: Option<usize>,
    pub shapes: Vec<f64>,
    /// Strength that the regression gives.
    pub strength: f64,
    /// Decrease of the deviance that it foretells.
    pub statistic: f64,
}

/// Leads, best first, and what they depend on.
pub(crate) struct Screen {
    pub leads: Vec<Lead>,
    pub arguments: Vec<Argument>,
}

/// The plant along its predictions.
struct Path {
    /// From sample to sample, for each recording.
    phi: Vec<Vec<DMatrix<f64>>>,
    gamma: Vec<Vec<DMatrix<f64>>>,
    c: Vec<Vec<DMatrix<f64>>>,
    d: Vec<Vec<DMatrix<f64>>>,
}

/// Places with the columns of the hooks that enter there.
struct Hooked {
    plant: Plant,
    places: Vec<Place>,
    /// Input of the hooked plant for each place.
    columns: Vec<usize>,
}

fn hooked(spec: &ModelSpec, arguments: &[Argument]) -> Option<Hooked> {
    let places = places(spec);
    let mut edit = Edit::default();
    let mut columns = Vec::new();
    let inputs = spec.inputs();
    let mut count = inputs.len();
    for (i, place) in places.iter().enumerate() {
        if let Place::Input(v) = place {
            columns.push(inputs.iter().position(|u| u == v)?);
            continue;
        }
        edit.declarations.push(format!("input Real hook_{i};"));
        edit.changes.push((*place, format!("{{v}} + hook_{i}")));
        columns.push(count);
        count += 1;
    }
    for (i, argument) in arguments.iter().enumerate() {
        edit.declarations.push(format!("output Real probe_{i};"));
        edit.equations
            .push(format!("probe_{i} = {};", argument.expression));
    }
    let plant = Plant::new(edit.apply(spec).ok()?);
    Some(Hooked {
        plant,
        places,
        columns,
    })
}

/// Linearises along the predictions, and fills in the values of the arguments.
fn path(
    study: &Study,
    fit: &Fit,
    hooked: &Hooked,
    recordings: &[PlantRecording],
    arguments: &mut [Argument],
) -> Option<Path> {
    let trajectories = study.trajectories(fit)?;
    let l = study.outputs();
    let mut path = Path {
        phi: vec![],
        gamma: vec![],
        c: vec![],
        d: vec![],
    };
    let mut values: Vec<Vec<Vec<f64>>> = vec![Vec::new(); arguments.len()];
    let gain = study.gain(fit);
    for ((trajectory, recording), point) in
        trajectories.iter().zip(recordings).zip(study.points(fit))
    {
        let samples = recording.outputs.first().map_or(0, Vec::len);
        let mut lineariser = hooked.plant.lineariser(&point);
        let m = hooked.plant.spec.inputs().len();
        let mut inputs = vec![0.0; m];
        let mut all = Vec::with_capacity(samples);
        let mut of_arguments = vec![Vec::with_capacity(samples); arguments.len()];
        for k in 0..samples {
            let mut state: Vec<f64> = trajectory.states.iter().map(|x| x[k]).collect();
            for (to, u) in inputs.iter_mut().zip(&recording.inputs) {
                *to = u[k];
            }
            let time = recording.start_time + k as f64 * recording.sample_time;
            if let Some(gain) = &gain {
                // The states of a trajectory are those before the correction.
                let y: Vec<f64> = trajectory.outputs.iter().map(|y| y[k]).collect();
                for (i, x) in state.iter_mut().enumerate() {
                    for (j, y) in y.iter().enumerate() {
                        let error = recording.outputs[j][k] - y;
                        *x += if error.is_finite() {
                            gain[(i, j)] * error
                        } else {
                            0.0
                        };
                    }
                }
            }
            let linear = lineariser.at(&state, &inputs, time);
            for (column, &v) in of_arguments.iter_mut().zip(&linear.output[l..]) {
                column.push(v);
            }
            all.push(linear);
        }
        let discrete: Vec<(DMatrix<f64>, DMatrix<f64>)> = all
            .par_iter()
            .map(|linear| linear.discrete(recording.sample_time))
            .collect();
        let (phi, gamma) = discrete.into_iter().unzip();
        path.phi.push(phi);
        path.gamma.push(gamma);
        path.c
            .push(all.iter().map(|p| p.c.rows(0, l).into_owned()).collect());
        path.d
            .push(all.iter().map(|p| p.d.rows(0, l).into_owned()).collect());
        for (to, column) in values.iter_mut().zip(of_arguments) {
            to.push(column);
        }
    }
    for (argument, values) in arguments.iter_mut().zip(values) {
        argument.set(values);
    }
    Some(path)
}

impl Path {
    /// Change of the outputs by a signal that enters at a hook.
    fn propagate(
        &self,
        column: usize,
        signal: &[Vec<f64>],
        held: bool,
        gain: Option<&DMatrix<f64>>,
    ) -> Series {
        let mut out = Series::new();
        for (r, b) in signal.iter().enumerate() {
            let l = self.c[r].first().map_or(0, DMatrix::nrows);
            let n = self.phi[r].first().map_or(0, DMatrix::nrows);
            let mut y = vec![vec![0.0; b.len()]; l];
            let (mut s, mut next) = (vec![0.0; n], vec![0.0; n]);
            for k in 0..b.len() {
                let (c, d) = (&self.c[r][k], &self.d[r][k]);
                for o in 0..l {
                    let mut sum = d[(o, column)] * b[k];
                    for (j, s) in s.iter().enumerate() {
                        sum += c[(o, j)] * s;
                    }
                    y[o][k] = sum;
                }
                if let Some(gain) = gain {
                    for (i, s) in s.iter_mut().enumerate() {
                        for (o, y) in y.iter().enumerate() {
                            *s -= gain[(i, o)] * y[k];
                        }
                    }
                }
                let (phi, gamma) = (&self.phi[r][k], &self.gamma[r][k]);
                let push = if held || k + 1 == b.len() {
                    b[k]
                } else {
                    0.5 * (b[k] + b[k + 1])
                };
                for (i, next) in next.iter_mut().enumerate() {
                    let mut sum = gamma[(i, column)] * push;
                    for (j, s) in s.iter().enumerate() {
                        sum += phi[(i, j)] * s;
                    }
                    *next = sum;
                }
                std::mem::swap(&mut s, &mut next);
            }
            out.extend(y);
        }
        out
    }
}

/// Values that a shape's search starts from.
fn starts(shape: Starts, argument: Option<&Argument>, recordings: &[PlantRecording]) -> Vec<f64> {
    let h = recordings.first().map_or(1.0, |r| r.sample_time);
    let samples = recordings
        .iter()
        .map(|r| r.outputs[0].len())
        .max()
        .unwrap_or(1);
    let begin = recordings.first().map_or(0.0, |r| r.start_time);
    let of = |parts: &[f64], value: &dyn Fn(&Argument, f64) -> f64| -> Vec<f64> {
        argument.map_or_else(Vec::new, |a| parts.iter().map(|&p| value(a, p)).collect())
    };
    match shape {
        Starts::Quantiles(parts) => of(parts, &|a, p| a.quantile(p)),
        Starts::SizeQuantiles(parts) => of(parts, &|a, p| a.size_quantile(p)),
        Starts::Spread(parts) => of(parts, &|a, p| p * a.spread()),
        Starts::Waves(counts) => of(counts, &|_, n| n),
        Starts::Length(parts) => parts
            .iter()
            .map(|p| begin + p * samples as f64 * h)
            .collect(),
        Starts::Samples(counts) => counts.iter().map(|c| c * h).collect(),
        Starts::Values(values) => values.to_vec(),
    }
}

/// The combinations of start values of all shapes.
fn grid(term: &Term, argument: Option<&Argument>, recordings: &[PlantRecording]) -> Vec<Vec<f64>> {
    let mut all: Vec<Vec<f64>> = vec![vec![]];
    for shape in term.shapes {
        let values = starts(shape.starts, argument, recordings);
        all = all
            .into_iter()
            .flat_map(|head| {
                values.iter().map(move |&v| {
                    let mut whole = head.clone();
                    whole.push(v);
                    whole
                })
            })
            .filter(|v| v.iter().all(|v| v.is_finite()))
            .collect();
    }
    all.retain(|values| {
        let positive = term.shapes.iter().zip(values);
        positive.into_iter().all(|(s, &v)| !s.positive || v > 0.0)
    });
    all
}

/// The form with its names filled in.
pub(crate) fn filled(
    form: &str,
    term: &Term,
    argument: &str,
    memory: &str,
    shapes: &[String],
    sample_time: f64,
) -> String {
    let mut text = form
        .replace("{z}", argument)
        .replace("{m}", memory)
        .replace("{fast}", &literal(2.0 / sample_time));
    for (shape, value) in term.shapes.iter().zip(shapes) {
        text = text.replace(&format!("{{{}}}", shape.symbol), value);
    }
    text
}

/// A term at an argument with shapes, whose values are asked for.
struct Instance {
    term: &'static Term,
    argument: Option<usize>,
    shapes: Vec<f64>,
}

/// Values of terms along the recordings.
fn evaluate(
    instances: &[Instance],
    arguments: &[Argument],
    recordings: &[PlantRecording],
) -> Option<Vec<Vec<Vec<f64>>>> {
    let h = recordings.first()?.sample_time;
    let mut used: Vec<usize> = instances.iter().filter_map(|i| i.argument).collect();
    used.sort_unstable();
    used.dedup();
    let mut columns: Vec<Vec<Vec<f64>>> = vec![vec![]; instances.len()];
    for (r, recording) in recordings.iter().enumerate() {
        let mut text = String::from("model Terms\n");
        for a in &used {
            text.push_str(&format!("input Real z{a};\n"));
        }
        let mut equations = String::from("equation\n");
        for (i, instance) in instances.iter().enumerate() {
            let name = instance.argument.map_or(String::new(), |a| format!("z{a}"));
            let shapes: Vec<String> = instance
                .shapes
                .iter()
                .map(|v| format!("({})", literal(*v)))
                .collect();
            let fill =
                |form: &str| filled(form, instance.term, &name, &format!("m{i}"), &shapes, h);
            text.push_str(&format!("output Real b{i};\n"));
            equations.push_str(&format!("b{i} = {};\n", fill(instance.term.form)));
            if let Some(rate) = instance.term.memory {
                let first = instance.argument.map_or(0.0, |a| arguments[a].values[r][0]);
                let first = memory_start(instance.term, first);
                text.push_str(&format!(
                    "Real m{i}(start={}, fixed=true);\n",
                    literal(first)
                ));
                equations.push_str(&format!("der(m{i}) = {};\n", fill(rate)));
            }
        }
        let plant = Plant::new(parse(&format!("{text}{equations}end Terms;\n")).ok()?)
            .with_accuracy(TERM_ACCURACY);
        let inputs: Vec<&[f64]> = used
            .iter()
            .map(|&a| arguments[a].values[r].as_slice())
            .collect();
        let excitation = Excitation {
            inputs: &inputs,
            length: recording.outputs[0].len(),
            sample_time: h,
            start_time: recording.start_time,
            hold: Hold::Linear,
        };
        let run = plant.simulate(&plant.nominal(), &excitation, None).ok()?;
        for (to, column) in columns.iter_mut().zip(run.outputs) {
            to.push(column);
        }
    }
    Some(columns)
}

/// Start of a memory where its argument has this value.
pub(crate) fn memory_start(term: &Term, argument: f64) -> f64 {
    if term.memory.is_some_and(|m| m.contains("{z}^2")) {
        argument * argument
    } else {
        argument
    }
}

/// What the regression of the residual on terms needs.
struct Projection {
    q: DMatrix<f64>,
    residual: Vec<f64>,
}

impl Projection {
    fn new(study: &Study, fit: &Fit) -> Option<Self> {
        let mut q = study.derivatives(fit)?;
        for mut column in q.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        let parts = q.svd(true, false);
        let u = parts.u?;
        let kept: Vec<usize> = (0..u.ncols())
            .filter(|&i| parts.singular_values[i] > 1e-7)
            .collect();
        let q = u.select_columns(&kept);
        let e = fit.noise.whiten_kept(&study.residual(fit)?, study.mask());
        let mut residual: Vec<f64> = e.iter().map(|&e| fit.noise.weight(e) * e).collect();
        let n = residual.len().max(1) as f64;
        let size = (residual.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        residual.iter_mut().for_each(|e| *e /= size.max(1e-300));
        let mut projection = Self {
            q,
            residual: vec![],
        };
        projection.off(&mut residual);
        projection.residual = residual;
        Some(projection)
    }

    fn off(&self, column: &mut [f64]) {
        for q in self.q.column_iter() {
            let along: f64 = q.iter().zip(column.iter()).map(|(q, c)| q * c).sum();
            column
                .iter_mut()
                .zip(q.iter())
                .for_each(|(c, q)| *c -= along * q);
        }
    }

    /// Decrease of the deviance and strength of a whitened column; none where parameters can do the same.
    fn test(&self, mut column: Vec<f64>, free: bool) -> Option<(f64, f64)> {
        let square = |c: &[f64]| c.iter().map(|v| v * v).sum::<f64>();
        let before = square(&column);
        self.off(&mut column);
        let after = square(&column);
        if !(after > LEAST_LEFT * LEAST_LEFT * before && after.is_finite()) {
            return None;
        }
        let along: f64 = column.iter().zip(&self.residual).map(|(c, r)| c * r).sum();
        if free {
            Some((along * along / after, along / after))
        } else {
            // A term of given size: it should be there whole.
            Some((along.max(0.0).powi(2) / after, 1.0))
        }
    }
}

/// Tests every term at every place.
pub(crate) fn screen(study: &Study, fit: &Fit, recordings: &[PlantRecording]) -> Option<Screen> {
    let spec = &study.plant().spec;
    let mut arguments = arguments(spec);
    let hooked = hooked(spec, &arguments)?;
    let path = path(study, fit, &hooked, recordings, &mut arguments)?;
    let projection = Projection::new(study, fit)?;
    let gain = study.gain(fit);
    // All terms at all arguments that some place takes.
    let mut instances: Vec<Instance> = Vec::new();
    for term in TERMS {
        let candidates: Vec<Option<usize>> = if term.needs == Needs::Time {
            vec![None]
        } else {
            let serves = |a: &Argument| {
                a.spread() > 0.0 && (a.serves(term.needs) || a.product && term.id == "linear")
            };
            (0..arguments.len())
                .filter(|&a| serves(&arguments[a]))
                .map(Some)
                .collect()
        };
        for argument in candidates {
            for shapes in grid(term, argument.map(|a| &arguments[a]), recordings) {
                instances.push(Instance {
                    term,
                    argument,
                    shapes,
                });
            }
        }
    }
    for i in &mut instances {
        for (shape, value) in i.term.shapes.iter().zip(&mut i.shapes) {
            if let (Starts::Waves(_), Some(a)) = (shape.starts, i.argument) {
                *value *= 2.0 * std::f64::consts::PI / arguments[a].range();
            }
        }
    }
    let sensors = sensors(spec);
    let outputs = spec.outputs();
    let (remembering, instances): (Vec<_>, Vec<_>) =
        instances.into_iter().partition(|i| i.term.memory.is_some());
    let chunks: Vec<&[Instance]> = instances
        .chunks(BATCH)
        .chain(remembering.chunks(1))
        .collect();
    let leads: Vec<Lead> = chunks
        .into_par_iter()
        .flat_map_iter(|chunk| {
            let values = evaluate(chunk, &arguments, recordings);
            let mut leads = Vec::new();
            for (instance, signal) in chunk.iter().zip(values.into_iter().flatten()) {
                if !signal.iter().flatten().all(|v| v.is_finite()) {
                    continue;
                }
                let argument = instance.argument.map(|a| &arguments[a]);
                let held = argument.is_some_and(|a| a.held) && instance.term.memory.is_none();
                let mut test = |place: Place, sensor: bool, series: &Series| {
                    let column = fit.noise.whiten_kept(series, study.mask());
                    if let Some((statistic, strength)) =
                        projection.test(column, instance.term.free_strength)
                    {
                        leads.push(Lead {
                            term: instance.term,
                            place,
                            sensor,
                            argument: instance.argument,
                            shapes: instance.shapes.clone(),
                            strength,
                            statistic,
                        });
                    }
                };
                match instance.term.port {
                    Port::Sensor => {
                        for &at in &sensors {
                            let v = spec.equations[at].unknown.variable();
                            let Some(o) = outputs.iter().position(|&y| y == v) else { continue };
                            let shown = spec.expressions.node(spec.equations[at].rest);
                            let own = argument.is_none_or(|a| {
                                a.variables == [v]
                                    || matches!(shown, crate::physics::Node::Variable(x) if a.variables == [x])
                            });
                            if !own {
                                continue;
                            }
                            let l = outputs.len();
                            let series: Series = (0..recordings.len() * l)
                                .map(|s| {
                                    if s % l == o { signal[s / l].clone() } else { vec![0.0; signal[s / l].len()] }
                                })
                                .collect();
                            test(Place::Equation(at), true, &series);
                        }
                    }
                    port => {
                        for (place, &column) in hooked.places.iter().zip(&hooked.columns) {
                            let fits = match (*place, port) {
                                (Place::Equation(at), Port::Equation) => {
                                    argument.is_none_or(|a| a.known_after.is_none_or(|k| k < at))
                                }
                                (Place::Input(v), Port::Input) => {
                                    argument.is_some_and(|a| a.variables == [v])
                                }
                                (Place::Parameter(_), Port::Parameter) => {
                                    argument.is_none_or(|a| a.known_after.is_none())
                                }
                                _ => false,
                            };
                            if fits {
                                let series = path.propagate(column, &signal, held, gain.as_ref());
                                test(*place, false, &series);
                            }
                        }
                    }
                }
            }
            leads
        })
        .collect();
    let mut leads = leads;
    leads.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
    Some(Screen { leads, arguments })
}
