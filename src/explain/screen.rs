//! Which effects deserve a fit: one Gauss-Newton step for every entry of the library at every place it may act.
//!
//! The response of the plant to each law, evaluated on the simulated motion, is projected off what the free numbers of
//! the plant explain anyway; the residual's share along what is left is what the effect would gain (a score test,
//! linear in amplitude and direction). This is done around several starting points and under several noise models:
//! the truth then is among the first few (math/explain.md, choice 4), and the step supplies starting values.

use nalgebra::{DMatrix, DVector};

use super::data::{Data, Series};
use super::effects::{self, Action, Clock, Definition, Motion, Needs, Observed, Sense};
use super::fit::{Fit, Problem};
use super::noise::Noise;
use super::plant::Plant;
use super::run::run;
use super::structure::{
    Direction, Functionals, Instance, Signal, Structure, add_mode, dot, matched_sign,
};
use crate::linalg::multiply_tn;

/// Times of change that are tried over a recording.
const CHANGE_TIMES: usize = 40;
/// Frequencies at which a missing resonance is tried.
const MODE_FREQUENCIES: usize = 40;
/// Lines of the residual's spectrum that are tried as a disturbance.
const LINES: usize = 4;

/// An effect at a place with starting values, and what one step promises.
#[derive(Debug, Clone)]
pub(crate) struct Lead {
    pub instance: Instance,
    /// Its numbers, in the order and scale of the parameter vector.
    pub start: Vec<f64>,
    /// Predicted decrease of Schwarz's criterion.
    pub gain: f64,
}

/// Everything that screening around one fit needs.
pub(crate) struct Bench<'a> {
    problem: &'a Problem<'a>,
    basis: &'a Fit,
    plant: Plant,
    noise: &'a Noise,
    /// Square roots of the weights of the values that count.
    weights: Vec<f64>,
    /// Whitened weighted residual, projected off the free numbers.
    residual: DVector<f64>,
    /// Whitened weighted sensitivities, and the inverse of their Gram matrix.
    nuisance: DMatrix<f64>,
    nuisance_inverse: DMatrix<f64>,
    left: f64,
}

/// A place and law with its response: one column a linear coefficient.
struct Template {
    instance: Instance,
    shape: Vec<f64>,
    columns: Vec<Series>,
}

/// Signals of the basis: per segment.
pub(crate) struct Signals {
    pub instance_signal: Signal,
    pub position: Vec<Vec<f64>>,
    pub rate: Vec<Vec<f64>>,
}

/// Screens the library (entries that `allowed` lets pass) around `basis` under each of `noises`: a list each, best
/// first.
pub(crate) fn screen(
    problem: &Problem,
    basis: &mut Fit,
    noises: &[Noise],
    allowed: &dyn Fn(&Definition) -> bool,
) -> Vec<Vec<Lead>> {
    let sensitivities = basis.sensitivities(problem);
    let benches: Vec<Bench> = noises
        .iter()
        .filter_map(|noise| Bench::new(problem, basis, noise, sensitivities.clone()))
        .collect();
    let Some(bench) = benches.first() else {
        return Vec::new();
    };
    // Responses do not depend on the noise model: they are computed once.
    let signals = bench.signals();
    let lines = bench.lines();
    let mut lists: Vec<Vec<Lead>> = vec![Vec::new(); benches.len()];
    for definition in effects::library().filter(|d| allowed(d)) {
        for template in bench.templates(definition, &signals, &lines) {
            for (bench, leads) in benches.iter().zip(&mut lists) {
                for lead in bench.judge(&template) {
                    match leads
                        .iter_mut()
                        .find(|l| l.instance.is_same(&lead.instance))
                    {
                        Some(known) if known.gain >= lead.gain => {}
                        Some(known) => *known = lead,
                        None => leads.push(lead),
                    }
                }
            }
        }
    }
    for leads in &mut lists {
        leads.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    }
    lists
}

impl<'a> Bench<'a> {
    pub fn new(
        problem: &'a Problem<'a>,
        basis: &'a Fit,
        noise: &'a Noise,
        sensitivities: Vec<Option<Series>>,
    ) -> Option<Self> {
        let plant = basis.structure.plant(&basis.theta);
        let whitened = noise.whiten(&basis.residual);
        let mut weights = Vec::new();
        let mut e = Vec::new();
        for (column, mask) in whitened.iter().zip(&problem.mask) {
            for (v, keep) in column.iter().zip(mask) {
                if *keep {
                    let w = noise.weight(*v).sqrt();
                    weights.push(w);
                    e.push(w * v);
                }
            }
        }
        let rows = weights.len();
        let mut bench = Self {
            problem,
            basis,
            plant,
            noise,
            weights,
            residual: DVector::from_vec(e),
            nuisance: DMatrix::zeros(rows, 0),
            nuisance_inverse: DMatrix::zeros(0, 0),
            left: 0.0,
        };
        let mut flat: Vec<f64> = Vec::new();
        let mut count = 0;
        for series in sensitivities.iter().flatten() {
            let column = bench.flatten(series);
            let norm = column.iter().map(|v| v * v).sum::<f64>().sqrt();
            if norm > 0.0 && norm.is_finite() {
                flat.extend(column.iter().map(|v| v / norm));
                count += 1;
            }
        }
        let nuisance = DMatrix::from_vec(rows, count, flat);
        let mut gram = multiply_tn(&nuisance, &nuisance);
        for i in 0..count {
            gram[(i, i)] += 1e-9;
        }
        bench.nuisance_inverse = gram.cholesky()?.inverse();
        bench.nuisance = nuisance;
        let residual = DMatrix::from_column_slice(rows, 1, bench.residual.as_slice());
        bench.residual = bench.projected(&residual).column(0).into_owned();
        bench.left = bench.residual.norm_squared();
        (bench.left > 0.0).then_some(bench)
    }

    fn data(&self) -> &Data {
        self.problem.data
    }

    /// Whitened, weighted, without the values that do not count.
    fn flatten(&self, series: &Series) -> Vec<f64> {
        let mut flat = Vec::with_capacity(self.weights.len());
        for (column, mask) in self.noise.whiten(series).iter().zip(&self.problem.mask) {
            flat.extend(
                column
                    .iter()
                    .zip(mask)
                    .filter_map(|(v, keep)| keep.then_some(*v)),
            );
        }
        for (v, w) in flat.iter_mut().zip(&self.weights) {
            *v *= w;
        }
        flat
    }

    /// Columns less what the free numbers of the plant explain of them.
    fn projected(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        if self.nuisance.ncols() == 0 {
            return columns.clone();
        }
        let inner = multiply_tn(&self.nuisance, columns);
        let coefficients = &self.nuisance_inverse * inner;
        columns - crate::linalg::multiply(&self.nuisance, &coefficients)
    }

    fn clock(&self, segment: usize) -> Clock {
        Clock {
            start: self.data().segments[segment].start_time,
            step: self.data().sample_time,
            fresh: false,
        }
    }

    /// Positions and rates that forces may look at, from the motion of the basis.
    pub fn signals(&self) -> Vec<Signals> {
        let l = self.plant.outputs;
        let rows = Functionals::new(&self.plant);
        let mut places: Vec<Signal> = (0..l).map(Signal::Output).collect();
        places.extend((0..l).map(Signal::Integral));
        for i in 0..l {
            for j in i + 1..l {
                places.push(Signal::Difference(i, j));
            }
        }
        let mut reader = self.plant.clone();
        reader.c.clear();
        reader.d.clear();
        for place in &places {
            let rows = rows.of(&self.plant, *place);
            reader.c.extend(&rows.position);
            reader.d.extend(std::iter::repeat_n(0.0, reader.inputs));
            reader.c.extend(&rows.rate);
            reader.d.extend(&rows.rate_feedthrough);
        }
        reader.outputs = 2 * places.len();
        let mut found: Vec<Signals> = places
            .iter()
            .map(|place| Signals {
                instance_signal: *place,
                position: Vec::new(),
                rate: Vec::new(),
            })
            .collect();
        for (index, segment) in self.data().segments.iter().enumerate() {
            let x0 = self.basis.structure.initial_state(&self.basis.theta, index);
            let (inputs, _) = self.basis.structure.effective_inputs(
                &self.basis.theta,
                segment,
                &self.clock(index),
            );
            let forces = self.basis.structure.prepare(&self.basis.theta, &self.plant);
            let read = run(
                &reader,
                &forces,
                x0,
                &inputs,
                segment.samples(),
                &self.clock(index),
            )
            .unwrap_or_else(|| vec![vec![0.0; segment.samples()]; reader.outputs]);
            for (signals, pair) in found.iter_mut().zip(read.chunks_exact(2)) {
                signals.position.push(pair[0].clone());
                signals.rate.push(pair[1].clone());
            }
        }
        found
    }

    /// Frequencies (Hz) of the largest lines of the residual's periodogram, whitened, all outputs together.
    fn lines(&self) -> Vec<f64> {
        let whitened = self.noise.whiten(&self.basis.residual);
        let n = whitened.iter().map(Vec::len).max().unwrap_or(0);
        if n < 32 {
            return Vec::new();
        }
        let mut planner = realfft::RealFftPlanner::<f64>::new();
        let transform = planner.plan_fft_forward(4 * n);
        let mut power = vec![0.0; 2 * n + 1];
        for column in &whitened {
            let mut padded = column.clone();
            padded.resize(4 * n, 0.0);
            let mut spectrum = transform.make_output_vec();
            if transform.process(&mut padded, &mut spectrum).is_err() {
                return Vec::new();
            }
            for (p, s) in power.iter_mut().zip(&spectrum) {
                *p += s.norm_sqr();
            }
        }
        let mut peaks = Vec::new();
        for _ in 0..LINES {
            // From one period in the recording on.
            let Some((at, _)) = power
                .iter()
                .enumerate()
                .skip(4)
                .max_by(|a, b| a.1.total_cmp(b.1))
            else {
                break;
            };
            peaks.push(at as f64 / (4.0 * n as f64 * self.data().sample_time));
            let (from, to) = (at.saturating_sub(8), (at + 8).min(power.len() - 1));
            power[from..=to].fill(0.0);
        }
        peaks
    }

    fn templates(
        &self,
        definition: &'static Definition,
        signals: &[Signals],
        lines: &[f64],
    ) -> Vec<Template> {
        match definition.action {
            Action::Input(_) => (0..self.data().signals())
                .filter(|j| self.basis.structure.coordinates.active_inputs.contains(j))
                .flat_map(|j| self.input_templates(definition, j))
                .collect(),
            Action::Sensor(_) => (0..self.data().outputs)
                .flat_map(|o| self.sensor_templates(definition, o, lines))
                .collect(),
            Action::Force(_, needs, _) => self.force_templates(definition, needs, signals),
            Action::Mode => (0..self.data().signals())
                .filter(|j| self.basis.structure.coordinates.active_inputs.contains(j))
                .flat_map(|j| self.mode_templates(definition, j))
                .collect(),
            Action::MissingPath => (0..self.data().signals())
                .filter(|j| !self.basis.structure.coordinates.active_inputs.contains(j))
                .map(|j| Template {
                    instance: Instance {
                        definition,
                        channel: j,
                        signal: Signal::Output(0),
                        direction: Direction::Free,
                    },
                    shape: Vec::new(),
                    columns: self.directions(
                        &self
                            .data()
                            .segments
                            .iter()
                            .map(|s| s.inputs[j].clone())
                            .collect::<Vec<_>>(),
                    ),
                })
                .collect(),
            Action::Exact => Vec::new(),
        }
    }

    fn observed(&self, channel: Vec<f64>, rate: Vec<f64>, lines: &[f64]) -> Observed {
        let step = self.data().sample_time;
        let first = &self.data().segments[0];
        let length = first.samples() as f64 * step;
        let change_times = (1..CHANGE_TIMES)
            .map(|i| first.start_time + length * i as f64 / CHANGE_TIMES as f64)
            .collect();
        // From a few periods in the recording to most of the band.
        let (low, high) = (5.0 / length, 0.45 / step);
        let frequencies = (0..MODE_FREQUENCIES)
            .map(|i| low * (high / low).powf(i as f64 / (MODE_FREQUENCIES - 1) as f64))
            .collect();
        Observed {
            channel,
            rate,
            step,
            change_times,
            lines: lines.to_vec(),
            frequencies,
        }
    }

    /// Response of the outputs to `drive` (a column a segment) entering through `direction`.
    fn response(&self, direction: &[f64], drive: &[Vec<f64>]) -> Series {
        let plant = Plant {
            inputs: 1,
            b: direction.to_vec(),
            d: vec![0.0; self.plant.outputs],
            ..self.plant.clone()
        };
        let zero = vec![0.0; plant.states];
        let mut series = Vec::new();
        for (index, w) in drive.iter().enumerate() {
            let input = vec![w.clone()];
            let y = run(&plant, &[], &zero, &input, w.len(), &self.clock(index))
                .unwrap_or_else(|| vec![vec![0.0; w.len()]; plant.outputs]);
            series.extend(y);
        }
        series
    }

    /// Responses to `drive` through each state.
    fn directions(&self, drive: &[Vec<f64>]) -> Vec<Series> {
        let n = self.plant.states;
        (0..n)
            .map(|i| {
                let mut unit = vec![0.0; n];
                unit[i] = 1.0;
                self.response(&unit, drive)
            })
            .collect()
    }

    fn input_templates(&self, definition: &'static Definition, input: usize) -> Vec<Template> {
        let Action::Input(law) = definition.action else {
            return Vec::new();
        };
        let segments = &self.data().segments;
        let channel = segments
            .iter()
            .flat_map(|s| s.inputs[input].clone())
            .collect();
        let observed = self.observed(channel, Vec::new(), &[]);
        let b = self.plant.b_column(input);
        let moment = super::coordinates::Derivatives::new(&self.plant)
            .moment
            .swap_remove(input);
        (definition.starts)(&observed)
            .into_iter()
            .map(|shape| {
                let mut drive = Vec::new();
                let mut drive_moment = Vec::new();
                for (index, s) in segments.iter().enumerate() {
                    let mut u = s.inputs[input].clone();
                    let mut m = vec![0.0; u.len()];
                    law(&shape, &mut u, &mut m, &self.clock(index));
                    drive.push(u.iter().zip(&s.inputs[input]).map(|(a, b)| a - b).collect());
                    drive_moment.push(m);
                }
                let mut column = self.response(&b, &drive);
                if drive_moment.iter().flatten().any(|v| *v != 0.0) {
                    let within = self.response(&moment, &drive_moment);
                    for (y, w) in column.iter_mut().flatten().zip(within.iter().flatten()) {
                        *y += w;
                    }
                }
                Template {
                    instance: Instance {
                        definition,
                        channel: input,
                        signal: Signal::Output(0),
                        direction: Direction::Matched(input),
                    },
                    shape,
                    columns: vec![column],
                }
            })
            .collect()
    }

    fn sensor_templates(
        &self,
        definition: &'static Definition,
        output: usize,
        lines: &[f64],
    ) -> Vec<Template> {
        let Action::Sensor(law) = definition.action else {
            return Vec::new();
        };
        let l = self.data().outputs;
        let simulated = &self.basis.simulated;
        let channel = simulated
            .iter()
            .skip(output)
            .step_by(l)
            .flatten()
            .copied()
            .collect();
        let observed = self.observed(channel, Vec::new(), lines);
        let change = |shape: &[f64], scale: f64| -> Series {
            simulated
                .iter()
                .enumerate()
                .map(|(s, y)| {
                    if s % l != output {
                        return vec![0.0; y.len()];
                    }
                    let mut seen = y.clone();
                    law(shape, &mut seen, &self.clock(s / l));
                    seen.iter().zip(y).map(|(a, b)| (a - b) / scale).collect()
                })
                .collect()
        };
        let size = self.problem.scale[output];
        (definition.starts)(&observed)
            .into_iter()
            .map(|shape| {
                let columns = if definition.linear.is_empty() {
                    vec![change(&shape, 1.0)]
                } else {
                    definition
                        .linear
                        .iter()
                        .map(|&i| {
                            let mut alone = shape.clone();
                            for &j in definition.linear {
                                alone[j] = 0.0;
                            }
                            alone[i] = size;
                            change(&alone, size)
                        })
                        .collect()
                };
                Template {
                    instance: Instance {
                        definition,
                        channel: output,
                        signal: Signal::Output(output),
                        direction: Direction::Free,
                    },
                    shape,
                    columns,
                }
            })
            .collect()
    }

    fn force_templates(
        &self,
        definition: &'static Definition,
        needs: Needs,
        signals: &[Signals],
    ) -> Vec<Template> {
        let Action::Force(law, ..) = definition.action else {
            return Vec::new();
        };
        let rows = Functionals::new(&self.plant);
        let speed: Vec<bool> = (0..self.plant.outputs)
            .map(|o| rows.integrates(&self.plant, o))
            .collect();
        let aperiodic = crate::linalg::eigenvalues(&self.plant.a_matrix())
            .is_ok_and(|poles| poles.iter().all(|p| p.im == 0.0));
        let mut templates = Vec::new();
        for signal in signals {
            // An output without static gain is a speed: positions are its integral. One of a plant that cannot
            // oscillate (a drive) may be a speed as well as a position, so friction is tried on both.
            let possible = match (needs, signal.instance_signal) {
                (Needs::Time, Signal::Output(0)) => true,
                (Needs::Time, _) => false,
                (Needs::Position | Needs::Rate, Signal::Output(o)) => !speed[o],
                (Needs::Position, Signal::Integral(o)) => speed[o],
                (Needs::Rate, Signal::Integral(o)) => {
                    speed[o] || aperiodic && definition.id != "quadratic_drag"
                }
                (_, Signal::Difference(i, j)) => !speed[i] && !speed[j],
            };
            if !possible {
                continue;
            }
            let observed = self.observed(signal.position.concat(), signal.rate.concat(), &[]);
            for shape in (definition.starts)(&observed) {
                let drive: Vec<Vec<f64>> = (0..self.data().segments.len())
                    .map(|s| self.force(law, &shape, signal, s))
                    .collect();
                templates.push(Template {
                    instance: Instance {
                        definition,
                        channel: 0,
                        signal: signal.instance_signal,
                        direction: Direction::Free,
                    },
                    shape,
                    columns: self.directions(&drive),
                });
            }
        }
        templates
    }

    /// The law evaluated along the motion of the basis.
    fn force(
        &self,
        law: effects::ForceLaw,
        shape: &[f64],
        signal: &Signals,
        segment: usize,
    ) -> Vec<f64> {
        let (x, v) = (&signal.position[segment], &signal.rate[segment]);
        let clock = self.clock(segment);
        let mut memory = [0.0; 3];
        let inputs = &self.data().segments[segment].inputs;
        (0..x.len())
            .map(|k| {
                let next = (k + 1).min(x.len() - 1);
                let motion = Motion {
                    position: x[k],
                    position_free: x[next],
                    position_gain: 0.0,
                    rate: v[k],
                    rate_free: v[next],
                    rate_gain: 0.0,
                    input: inputs.first().map_or(0.0, |u| u[k]),
                    sample: k,
                    clock,
                };
                law(shape, &motion, &mut memory)
            })
            .collect()
    }

    fn mode_templates(&self, definition: &'static Definition, input: usize) -> Vec<Template> {
        let observed = self.observed(Vec::new(), Vec::new(), &[]);
        let l = self.data().outputs;
        (definition.starts)(&observed)
            .into_iter()
            .map(|shape| {
                let mut columns: Vec<Series> = (0..2 * l)
                    .map(|_| {
                        self.basis
                            .simulated
                            .iter()
                            .map(|y| vec![0.0; y.len()])
                            .collect()
                    })
                    .collect();
                for (index, segment) in self.data().segments.iter().enumerate() {
                    for part in 0..2 {
                        let mut y = vec![vec![0.0; segment.samples()]];
                        let residues = if part == 0 { [1.0, 0.0] } else { [0.0, 1.0] };
                        add_mode(
                            &shape,
                            &residues,
                            &segment.inputs[input],
                            &self.clock(index),
                            &mut y,
                        );
                        for o in 0..l {
                            columns[2 * o + part][index * l + o] = y[0].clone();
                        }
                    }
                }
                Template {
                    instance: Instance {
                        definition,
                        channel: input,
                        signal: Signal::Output(0),
                        direction: Direction::Free,
                    },
                    shape,
                    columns,
                }
            })
            .collect()
    }

    /// What a flexible set of features gains: `(gain, what there was, number of features)`.
    pub fn feature_gain(&self) -> Option<(f64, f64, usize)> {
        let signals = self.signals();
        let rows = Functionals::new(&self.plant);
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let data = self.data();
        let per_segment = |f: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
            data.segments
                .iter()
                .enumerate()
                .map(|(s, segment)| (0..segment.samples()).map(|k| f(s, k)).collect())
                .collect()
        };
        for &input in self
            .basis
            .structure
            .coordinates
            .active_inputs
            .iter()
            .filter(|j| **j < self.problem.data.signals())
        {
            let b = self.plant.b_column(input);
            let mut drives: Vec<Vec<Vec<f64>>> = Vec::new();
            let u = |s: usize, k: usize| data.segments[s].inputs[input][k];
            let channel: Vec<f64> = data
                .segments
                .iter()
                .flat_map(|s| s.inputs[input].clone())
                .collect();
            for (low, centre, high) in hats(&channel, 8) {
                drives.push(per_segment(&|s, k| hat(u(s, k), low, centre, high)));
            }
            for delay in [1usize, 2, 4] {
                drives.push(per_segment(&|s, k| u(s, k.saturating_sub(delay)) - u(s, k)));
            }
            for signal in &signals {
                let place = signal.instance_signal;
                let speed = |o: usize| rows.integrates(&self.plant, o);
                let sensible = match place {
                    Signal::Output(o) => !speed(o),
                    Signal::Integral(o) => speed(o),
                    Signal::Difference(i, j) => !speed(i) && !speed(j),
                };
                if !sensible {
                    continue;
                }
                let position: Vec<f64> = signal.position.concat();
                let rate: Vec<f64> = signal.rate.concat();
                for (low, centre, high) in hats(&position, 8) {
                    drives.push(per_segment(&|s, k| {
                        hat(signal.position[s][k], low, centre, high)
                    }));
                }
                for (low, centre, high) in hats(&rate, 8) {
                    drives.push(per_segment(&|s, k| {
                        hat(signal.rate[s][k], low, centre, high)
                    }));
                }
                drives.push(per_segment(&|s, k| signal.position[s][k] * u(s, k)));
                drives.push(per_segment(&|s, k| {
                    signal.position[s][k] * signal.rate[s][k]
                }));
                let size = effects::level(&position, 0.8, f64::abs);
                for share in [0.03, 0.2] {
                    drives.push(
                        signal
                            .position
                            .iter()
                            .map(|x| {
                                let mut held = x.first().copied().unwrap_or(0.0);
                                x.iter()
                                    .map(|x| {
                                        held = f64::clamp(held, x - share * size, x + share * size);
                                        held
                                    })
                                    .collect()
                            })
                            .collect(),
                    );
                }
            }
            for block in 0..8usize {
                let inside = |s: usize, k: usize| {
                    usize::from(k * 8 / data.segments[s].samples().max(1) == block) as f64
                };
                drives.push(per_segment(&inside));
                drives.push(per_segment(&|s, k| inside(s, k) * u(s, k)));
            }
            columns.extend(
                drives
                    .iter()
                    .map(|drive| self.flatten(&self.response(&b, drive))),
            );
        }
        let count = columns.len();
        let rows = self.weights.len();
        if count == 0 || rows < 4 * count {
            return None;
        }
        let mut before = Vec::with_capacity(count);
        for column in &columns {
            before.push(column.iter().map(|v| v * v).sum::<f64>().max(1e-300));
        }
        let columns = self.projected(&DMatrix::from_vec(rows, count, columns.concat()));
        let gram = multiply_tn(&columns, &columns);
        let inner = columns.tr_mul(&self.residual);
        // Features that the nuisance or one another explain are no features: keep the directions that stand out.
        let scaled = DMatrix::from_fn(count, count, |i, j| {
            gram[(i, j)] / (before[i] * before[j]).sqrt()
        });
        let right = DVector::from_iterator(count, (0..count).map(|i| inner[i] / before[i].sqrt()));
        let eigen = crate::linalg::symmetric_eigen(&scaled).ok()?;
        let mut gained = 0.0;
        let mut kept = 0;
        let largest = eigen.values.iter().copied().fold(0.0, f64::max);
        for (i, value) in eigen.values.iter().enumerate() {
            if *value > 1e-6 * largest {
                gained += eigen.vectors.column(i).dot(&right).powi(2) / value;
                kept += 1;
            }
        }
        Some((gained, self.left, kept))
    }

    /// A static law of `values` through input `drive`: hats at `knots`, `(gain, coefficients, covariance)`.
    pub fn static_law(
        &self,
        drive: usize,
        values: &[Vec<f64>],
        knots: &[f64],
    ) -> Option<(f64, DVector<f64>, DMatrix<f64>)> {
        let b = self.plant.b_column(drive);
        let m = knots.len();
        let columns: Vec<Vec<f64>> = (0..m)
            .map(|i| {
                let low = if i == 0 {
                    f64::NEG_INFINITY
                } else {
                    knots[i - 1]
                };
                let high = if i + 1 == m {
                    f64::INFINITY
                } else {
                    knots[i + 1]
                };
                let force: Vec<Vec<f64>> = values
                    .iter()
                    .map(|v| {
                        v.iter()
                            .map(|v| {
                                if (i == 0 && *v <= knots[0]) || (i + 1 == m && *v >= knots[m - 1])
                                {
                                    1.0
                                } else {
                                    hat(
                                        *v,
                                        low.max(knots[0] - 1.0),
                                        knots[i],
                                        high.min(knots[m - 1] + 1.0),
                                    )
                                }
                            })
                            .collect()
                    })
                    .collect();
                self.flatten(&self.response(&b, &force))
            })
            .collect();
        let rows = self.weights.len();
        let raw = DMatrix::from_vec(rows, m, columns.concat());
        let scale = raw
            .column_iter()
            .map(|c| c.norm_squared())
            .fold(0.0, f64::max);
        let columns = self.projected(&raw);
        let mut gram = multiply_tn(&columns, &columns);
        // A ridge far below what the data determine: the straight line belongs to the plant.
        for i in 0..m {
            gram[(i, i)] += 1e-7 * scale;
        }
        let inner = columns.tr_mul(&self.residual);
        let inverse = gram.cholesky()?.inverse();
        let coefficients = &inverse * &inner;
        let gain = coefficients.dot(&inner);
        let variance = (self.left - gain).max(0.0) / (rows as f64 - m as f64).max(1.0);
        gain.is_finite()
            .then(|| (gain, coefficients, inverse * variance))
    }

    /// What a template gains, with starting values; a force also matched with each input.
    fn judge(&self, template: &Template) -> Vec<Lead> {
        let rows = self.weights.len();
        let m = template.columns.len();
        let flat: Vec<f64> = template
            .columns
            .iter()
            .flat_map(|c| self.flatten(c))
            .collect();
        let columns = DMatrix::from_vec(rows, m, flat);
        let before: Vec<f64> = (0..m).map(|i| columns.column(i).norm_squared()).collect();
        let columns = self.projected(&columns);
        let gram = multiply_tn(&columns, &columns);
        let inner = columns.tr_mul(&self.residual);
        let mut leads = Vec::new();
        if let Some((coefficients, gained)) = solve(&gram, &inner, &before) {
            leads.extend(self.lead(template, template.instance, &coefficients, gained, m));
        }
        let Action::Force(..) = template.instance.definition.action else {
            return leads;
        };
        for &input in self
            .basis
            .structure
            .coordinates
            .active_inputs
            .iter()
            .filter(|j| **j < self.problem.data.signals())
        {
            let b = DVector::from_vec(self.plant.b_column(input));
            let square = (b.transpose() * &gram * &b)[(0, 0)];
            let along = b.dot(&inner);
            let size: f64 = b.iter().zip(&before).map(|(b, s)| b.abs() * s.sqrt()).sum();
            if square.is_nan() || square <= 1e-8 * size * size {
                continue;
            }
            let instance = Instance {
                direction: Direction::Matched(input),
                ..template.instance
            };
            leads.extend(self.lead(
                template,
                instance,
                &[along / square],
                along * along / square,
                1,
            ));
        }
        leads
    }

    fn lead(
        &self,
        template: &Template,
        instance: Instance,
        coefficients: &[f64],
        gained: f64,
        columns: usize,
    ) -> Option<Lead> {
        let definition = instance.definition;
        let mut start = Vec::new();
        if let Action::Force(_, _, sense) = definition.action {
            let rows = Functionals::new(&self.plant).of(&self.plant, instance.signal);
            match instance.direction {
                Direction::Matched(input) => {
                    let amplitude = coefficients[0] * matched_sign(&self.plant, &rows.rate, input);
                    if sense == Sense::Resists && amplitude <= 0.0 {
                        return None;
                    }
                    start.push(amplitude);
                }
                Direction::Free => {
                    if sense == Sense::Resists && dot(&rows.rate, coefficients) <= 0.0 {
                        return None;
                    }
                    start.extend_from_slice(coefficients);
                }
            }
        }
        let mut shape = template.shape.clone();
        for (&i, c) in definition.linear.iter().zip(coefficients) {
            shape[i] = match definition.action {
                // The template held the start value; the coefficient multiplies it.
                Action::Input(_) => shape[i] * c,
                _ => *c,
            };
        }
        if definition.linear.is_empty() && definition.grows_with_first() {
            // Twice the width does about twice as much: the coefficient corrects the template's.
            shape[0] *= coefficients[0].clamp(0.02, 3.0);
        }
        start.extend(definition.parameters.iter().zip(&shape).map(|(p, v)| {
            if p.logarithmic {
                v.max(p.lower).ln()
            } else {
                v.clamp(p.lower, p.upper)
            }
        }));
        if matches!(definition.action, Action::Mode | Action::MissingPath) {
            start.extend_from_slice(coefficients);
        }
        let n = self.weights.len() as f64;
        let after = (self.left - gained).max(1e-12 * self.left);
        let nonlinear = definition.parameters.len() - definition.linear.len();
        let gain = n * (self.left / after).ln() - (columns + nonlinear) as f64 * n.ln();
        gain.is_finite().then_some(Lead {
            instance,
            start,
            gain,
        })
    }
}

/// Hats over the quantiles of `values`: `(left foot, top, right foot)`.
fn hats(values: &[f64], count: usize) -> Vec<(f64, f64, f64)> {
    let mut knots: Vec<f64> = (0..=count + 1)
        .map(|i| effects::level(values, i as f64 / (count + 1) as f64, |v| v))
        .collect();
    knots.dedup();
    knots.windows(3).map(|w| (w[0], w[1], w[2])).collect()
}

fn hat(v: f64, low: f64, centre: f64, high: f64) -> f64 {
    if v <= low || v >= high {
        0.0
    } else if v <= centre {
        (v - low) / (centre - low)
    } else {
        (high - v) / (high - centre)
    }
}

/// Least squares coefficients and gain; directions that the projection wiped out are left alone.
fn solve(gram: &DMatrix<f64>, inner: &DVector<f64>, before: &[f64]) -> Option<(Vec<f64>, f64)> {
    let m = gram.nrows();
    let scale: Vec<f64> = before.iter().map(|b| b.sqrt().max(1e-300)).collect();
    let mut scaled = gram.clone();
    for i in 0..m {
        for j in 0..m {
            scaled[(i, j)] /= scale[i] * scale[j];
        }
        scaled[(i, i)] += 1e-9;
    }
    let right = DVector::from_iterator(m, (0..m).map(|i| inner[i] / scale[i]));
    let solved = scaled.cholesky()?.solve(&right);
    let gained = solved.dot(&right);
    let coefficients: Vec<f64> = (0..m).map(|i| solved[i] / scale[i]).collect();
    (gained.is_finite() && coefficients.iter().all(|c| c.is_finite()))
        .then_some((coefficients, gained))
}

/// The structure of `basis` with one more effect, and its starting vector.
pub(crate) fn extended(structure: &Structure, theta: &[f64], lead: &Lead) -> (Structure, Vec<f64>) {
    let mut structure = structure.clone();
    structure.effects.push(lead.instance);
    let mut start = theta.to_vec();
    start.extend_from_slice(&lead.start);
    (structure, start)
}
