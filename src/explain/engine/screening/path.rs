//! A plant linearised along its predictions, and what a signal at a place does to its outputs there.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::explain::engine::fitting::edit::{Edit, Place, places};
use crate::explain::engine::terms::argument::Argument;
use crate::noise::Series;
use crate::physics::estimate::{Fit, PlantRecording, Study};
use crate::physics::{Hold, LinearPlant, ModelSpec, Plant};

/// Signals that are propagated together.
pub(in crate::explain::engine) const TOGETHER: usize = 4;
/// A number for each of them.
type Lanes = [f64; TOGETHER];

/// The plant along its predictions, for each recording.
pub(in crate::explain::engine) struct Path(Vec<Steps>);

/// The plant from sample to sample of a recording. Matrices are stored by rows, one sample after the other.
struct Steps {
    states: usize,
    outputs: usize,
    phi: Vec<f64>,
    c: Vec<f64>,
    of_input: Vec<OfInput>,
    of_sensor: Vec<OfInput>,
}

/// Where signals enter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::explain::engine) enum Entry {
    /// The input of a hooked plant.
    Hook(usize),
    /// The output that a sensor shows.
    Sensor(usize),
}

/// `A` and `B` from one sample to the next.
type Discrete = (DMatrix<f64>, DMatrix<f64>);

/// What one input does.
struct OfInput {
    /// To the next states, and to the outputs.
    gamma: Vec<f64>,
    d: Vec<f64>,
    /// To the next states through an observer; empty where there is none.
    observed: Vec<f64>,
}

impl Steps {
    /// Of discrete systems with the gain of an observer, which corrects by what was measured.
    fn new(
        plants: &[LinearPlant],
        (discrete, l): (&[Discrete], usize),
        gain: Option<&DMatrix<f64>>,
        recording: &PlantRecording,
    ) -> Self {
        let n = discrete.first().map_or(0, |(phi, _)| phi.nrows());
        let inputs = discrete.first().map_or(0, |(_, gamma)| gamma.ncols());
        let empty = || OfInput {
            gamma: vec![],
            d: vec![],
            observed: vec![],
        };
        let mut steps = Self {
            states: n,
            outputs: l,
            phi: vec![],
            c: vec![],
            of_input: (0..inputs).map(|_| empty()).collect(),
            of_sensor: (0..l).map(|_| empty()).collect(),
        };
        for (k, (plant, (phi, gamma))) in plants.iter().zip(discrete).enumerate() {
            let (c, d) = (plant.c.rows(0, l), plant.d.rows(0, l));
            let corrected = gain.map(|gain| {
                let measured = |o: usize| recording.outputs[o][k].is_finite();
                let at = |i, o| if measured(o) { gain[(i, o)] } else { 0.0 };
                phi * DMatrix::from_fn(n, l, at)
            });
            let phi = match &corrected {
                Some(corrected) => phi - corrected * c,
                None => phi.clone(),
            };
            steps.phi.extend(phi.transpose().iter());
            steps.c.extend(c.transpose().iter());
            for (j, of) in steps.of_input.iter_mut().enumerate() {
                of.gamma.extend(gamma.column(j).iter());
                of.d.extend(d.column(j).iter());
                if let Some(corrected) = &corrected {
                    of.observed.extend((corrected * d.column(j)).iter());
                }
            }
            for (o, of) in steps.of_sensor.iter_mut().enumerate() {
                of.gamma.extend(std::iter::repeat_n(0.0, n));
                of.d.extend((0..l).map(|other| f64::from(u8::from(other == o))));
                if let Some(corrected) = &corrected {
                    of.observed.extend(corrected.column(o).iter());
                }
            }
        }
        steps
    }

    /// Change of the outputs by signals that enter together, each between samples as `between` has it.
    fn propagate(&self, entry: Entry, signals: &[Lanes], between: &[Lanes]) -> Vec<Vec<Lanes>> {
        let (n, l) = (self.states, self.outputs);
        let of = match entry {
            Entry::Hook(column) => &self.of_input[column],
            Entry::Sensor(output) => &self.of_sensor[output],
        };
        let mut out = vec![vec![[0.0; TOGETHER]; signals.len()]; l];
        let (mut s, mut next) = (vec![[0.0; TOGETHER]; n], vec![[0.0; TOGETHER]; n]);
        for (k, (b, push)) in signals.iter().zip(between).enumerate() {
            for (o, y) in out.iter_mut().enumerate() {
                let row = &self.c[(k * l + o) * n..][..n];
                y[k] = product(row, &s, of.d[k * l + o], b);
            }
            let phi = &self.phi[k * n * n..][..n * n];
            for (i, next) in next.iter_mut().enumerate() {
                *next = product(&phi[i * n..][..n], &s, of.gamma[k * n + i], push);
                if let Some(observed) = of.observed.get(k * n + i) {
                    (0..TOGETHER).for_each(|w| next[w] -= observed * b[w]);
                }
            }
            std::mem::swap(&mut s, &mut next);
        }
        out
    }
}

/// `row s + factor b` in every lane.
fn product(row: &[f64], s: &[Lanes], factor: f64, b: &Lanes) -> Lanes {
    let mut sum = b.map(|b| factor * b);
    for (a, s) in row.iter().zip(s) {
        (0..TOGETHER).for_each(|w| sum[w] += a * s[w]);
    }
    sum
}

/// Places with the columns of the hooks that enter there.
pub(in crate::explain::engine) struct Hooked {
    plant: Plant,
    pub(in crate::explain::engine) places: Vec<Place>,
    /// Input of the hooked plant for each place.
    pub(in crate::explain::engine) columns: Vec<usize>,
}

pub(in crate::explain::engine) fn hooked(
    spec: &ModelSpec,
    given: &ModelSpec,
    arguments: &[Argument],
) -> Option<Hooked> {
    let places = places(spec, given);
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

/// Linearises along the predictions of a fit, and fills in the values of the arguments. Signals are then propagated with the
/// observer of the fit that is tested.
pub(in crate::explain::engine) fn path(
    study: &Study,
    (fit, tested): (&Fit, &Fit),
    hooked: &Hooked,
    recordings: &[PlantRecording],
    arguments: &mut [Argument],
) -> Option<Path> {
    let trajectories = study.trajectories(fit)?;
    let l = study.outputs();
    let mut path = Path(vec![]);
    let mut values: Vec<[Series; 2]> = vec![Default::default(); arguments.len()];
    let held = usize::from(study.hold() == Hold::Linear);
    let (gain, tested) = (study.gain(fit), study.gain(tested));
    for ((trajectory, recording), point) in
        trajectories.iter().zip(recordings).zip(study.points(fit))
    {
        let samples = recording.outputs.first().map_or(0, Vec::len);
        let mut lineariser = hooked.plant.lineariser(&point);
        let m = hooked.plant.spec.inputs().len();
        let mut inputs = vec![0.0; m];
        let mut all = Vec::with_capacity(samples);
        let column = || Vec::with_capacity(samples);
        let mut of_arguments: Vec<[Vec<f64>; 2]> =
            arguments.iter().map(|_| [column(), column()]).collect();
        let at = |k: usize| -> Vec<f64> { trajectory.states.iter().map(|x| x[k]).collect() };
        let time = |k: usize| recording.start_time + k as f64 * recording.sample_time;
        for k in 0..samples {
            let mut state = at(k);
            for (to, u) in inputs.iter_mut().zip(&recording.inputs) {
                *to = u[k];
            }
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
            let linear = lineariser.at(&state, &inputs, time(k));
            let after = (k + 1).min(samples - 1);
            for (to, u) in inputs.iter_mut().zip(&recording.inputs) {
                *to = u[(k + held).min(after)];
            }
            let end = lineariser.at(&at(after), &inputs, time(after));
            let both = linear.output[l..].iter().zip(&end.output[l..]);
            for ([values, ends], (&value, &end)) in of_arguments.iter_mut().zip(both) {
                values.push(value);
                ends.push(end);
            }
            all.push(linear);
        }
        let discrete: Vec<Discrete> = all
            .par_iter()
            .map(|linear| linear.discrete(recording.sample_time))
            .collect();
        let steps = Steps::new(&all, (&discrete, l), tested.as_ref(), recording);
        path.0.push(steps);
        for (to, columns) in values.iter_mut().zip(of_arguments) {
            to.iter_mut().zip(columns).for_each(|(to, c)| to.push(c));
        }
    }
    for (argument, [values, ends]) in arguments.iter_mut().zip(values) {
        argument.set(values, ends);
    }
    Some(path)
}

impl Path {
    /// Changes of the outputs by signals that enter at one place, at most [`TOGETHER`] of them, each with its values at the end of
    /// each sample; between, it is a straight line.
    pub(crate) fn propagate(&self, entry: Entry, signals: &[(&Series, &Series)]) -> Vec<Series> {
        let mut all = vec![Series::new(); signals.len()];
        for (r, steps) in self.0.iter().enumerate() {
            let samples = signals.first().map_or(0, |(signal, _)| signal[r].len());
            let mut values = vec![[0.0; TOGETHER]; samples];
            let mut between = values.clone();
            for (w, (signal, ends)) in signals.iter().enumerate() {
                for (k, (b, end)) in signal[r].iter().zip(&ends[r]).enumerate() {
                    values[k][w] = *b;
                    between[k][w] = 0.5 * (b + end);
                }
            }
            for y in steps.propagate(entry, &values, &between) {
                for (w, series) in all.iter_mut().enumerate() {
                    series.push(y.iter().map(|lanes| lanes[w]).collect());
                }
            }
        }
        all
    }
}
