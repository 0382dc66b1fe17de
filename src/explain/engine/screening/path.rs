//! A plant linearised along its predictions, and what a signal at a place does to its outputs there.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::explain::engine::fitting::edit::{Edit, Place, places};
use crate::explain::engine::terms::argument::Argument;
use crate::noise::Series;
use crate::physics::estimate::{Fit, PlantRecording, Study};
use crate::physics::{ModelSpec, Plant};

/// The plant along its predictions.
pub(in crate::explain::engine) struct Path {
    /// From sample to sample, for each recording.
    phi: Vec<Vec<DMatrix<f64>>>,
    gamma: Vec<Vec<DMatrix<f64>>>,
    c: Vec<Vec<DMatrix<f64>>>,
    d: Vec<Vec<DMatrix<f64>>>,
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

/// Linearises along the predictions, and fills in the values of the arguments.
pub(in crate::explain::engine) fn path(
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
    pub(crate) fn propagate(
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
