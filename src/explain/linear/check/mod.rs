//! The data before the physics: what is wrong with recordings and simulated columns themselves.
//!
//! Exact or robust tests that fit nothing, each in time proportional to the samples. What is found is said, repaired in
//! what is compared from then on (samples left out, turns counted, a factor or a clock applied to the simulation), and the
//! physics is looked for in the rest. Everything that a test calls improbable has a level for a whole recording far below
//! what an ordinary one makes, heavy tails and physics that the simulation lacks included.
//!
//! | file | what it finds |
//! |---|---|
//! | `gross` | dropouts to one value, isolated outliers |
//! | `wrap` | an angle that starts again each turn |
//! | `relation` | exchanged outputs, another sign, another unit |
//! | `clock`, `rates` | clocks of different rates, and other parameters that a clock would make |
//! | `frozen_sensor`, `coarse_sensor` | a sensor that holds its value, a coarse one |
//! | `trouble_sentences` | what is said of it |

mod clock;
mod coarse_sensor;
mod finding;
mod frozen_sensor;
mod gross;
mod rates;
mod relation;
mod trouble_sentences;
mod wrap;

pub(crate) use coarse_sensor::coarse_sensor;
pub(crate) use finding::Trouble;
pub(crate) use frozen_sensor::{Freeze, frozen};
pub(crate) use rates::same_factor;

use self::relation::Pairs;
use super::data::{Data, Segment};
use super::identification::autoregression::identify_simulator;
use crate::explain::simulation::Simulation;
use crate::log::Log;
use crate::noise::Mask;

/// Recordings and simulation as they are compared, and what was wrong with them.
#[derive(Debug, Clone)]
pub(crate) struct Checked {
    pub(crate) recordings: Vec<Log>,
    pub(crate) simulation: Simulation,
    pub(crate) troubles: Vec<Trouble>,
    /// The simulated columns were interpolated: they are linear in the inputs only as far as that goes.
    pub(crate) interpolated: bool,
}

/// What interpolation between samples leaves of a linear simulator, as a share of its output, at most ...
pub(crate) const INTERPOLATION: f64 = 0.03;
/// ... and of what it was before.
const MUCH_MORE_LINEAR: f64 = 0.2;
/// A simulator that misses the linear by more is none, as the recordings' clock sees it.
const NOT_LINEAR: f64 = 1e-4;
/// A copy differs by no more than this share of its largest value: the last of the digits that files hold.
const COPIED: f64 = 2e-6;
/// Share of the samples that a copy repeats.
const ALL_OF_IT: f64 = 0.999;

impl Checked {
    /// Looks at `recordings` and the columns of `simulation`. Whatever does not fit together is left as it is: it is
    /// refused later, with the reason. `allowed` are the answers that may be given.
    pub(crate) fn new(
        recordings: &[Log],
        simulation: &Simulation,
        allowed: &dyn Fn(&str) -> bool,
    ) -> Self {
        let mut checked = Self {
            recordings: recordings.to_vec(),
            simulation: simulation.clone(),
            troubles: Vec::new(),
            interpolated: false,
        };
        if recordings.iter().any(|log| log.check().is_err()) {
            return checked;
        }
        match simulation {
            Simulation::Outputs(logs) if belong_together(recordings, logs) => {
                let mut simulated: Vec<Vec<Vec<f64>>> =
                    logs.iter().map(|l| l.output_data.clone()).collect();
                checked.of_columns(&mut simulated, allowed);
                let mut logs = logs.clone();
                for ((log, simulated), cut) in
                    logs.iter_mut().zip(simulated).zip(&checked.recordings)
                {
                    log.output_data = simulated;
                    log.start_time = cut.start_time;
                    let samples = cut.samples();
                    for column in &mut log.input_data {
                        column.truncate(samples);
                    }
                }
                checked.simulation = Simulation::Outputs(logs);
            }
            Simulation::Outputs(_) => {}
            Simulation::Model(model, _) => {
                // Beside nothing: a pulse stands out by itself.
                let nothing: Vec<Vec<Vec<f64>>> = recordings
                    .iter()
                    .map(|log| vec![vec![0.0; log.samples()]; log.outputs.len()])
                    .collect();
                if model.system.outputs() == recordings.first().map_or(0, |l| l.outputs.len()) {
                    checked.leave_out(&nothing, allowed);
                }
            }
        }
        checked
    }

    /// All samples of `data` but those that are left out.
    pub(crate) fn mask(&self, data: &Data) -> Mask {
        let mut mask: Mask = data
            .outputs_as_series()
            .map(|y| vec![true; y.len()])
            .collect();
        for trouble in &self.troubles {
            let (Some(segment), Some(log)) = (
                data.segments.get(trouble.recording),
                self.recordings.get(trouble.recording),
            ) else {
                continue;
            };
            let skipped = ((segment.start_time - log.start_time) / data.sample_time)
                .round()
                .max(0.0) as usize;
            let Some(mask) = mask.get_mut(trouble.recording * data.outputs + trouble.output) else {
                continue;
            };
            for range in &trouble.left_out {
                let to = range.end.saturating_sub(skipped).min(mask.len());
                let from = range.start.saturating_sub(skipped).min(to);
                mask[from..to].fill(false);
            }
        }
        mask
    }

    fn of_columns(&mut self, simulated: &mut [Vec<Vec<f64>>], allowed: &dyn Fn(&str) -> bool) {
        self.copies(simulated);
        if !self.troubles.is_empty() {
            return;
        }
        if allowed("sensor_wrap") {
            self.wraps(simulated);
        }
        let raw = self.recordings.clone();
        // Relations are looked for beside what stands out; that is looked for again beside the simulation as corrected.
        let wraps = std::mem::take(&mut self.troubles);
        self.leave_out(simulated, allowed);
        let provisional = std::mem::take(&mut self.troubles);
        if allowed("swapped_outputs") {
            self.exchanged(simulated);
        }
        self.relations(simulated);
        if allowed("clock_drift") {
            self.clocks(simulated);
        }
        if self.troubles.is_empty() {
            self.troubles = provisional;
        } else if !provisional.is_empty() {
            // As recorded, with turns counted; what was cut or read on another clock stays filled.
            for (r, (now, before)) in self.recordings.iter_mut().zip(&raw).enumerate() {
                if now.samples() != before.samples() {
                    continue;
                }
                for t in provisional.iter().filter(|t| t.recording == r) {
                    let raw = &before.output_data[t.output];
                    for k in t.left_out.iter().cloned().flatten() {
                        now.output_data[t.output][k] = raw[k];
                    }
                }
            }
            self.leave_out(simulated, allowed);
        }
        self.troubles.splice(0..0, wraps);
    }

    /// Columns that are copies of others.
    fn copies(&mut self, simulated: &[Vec<Vec<f64>>]) {
        for (r, (log, simulated)) in self.recordings.iter().zip(simulated).enumerate() {
            for (o, y) in log.output_data.iter().enumerate() {
                let other = simulated.iter().position(|s| is_copy(y, s));
                if let Some(of) = other {
                    self.troubles
                        .push(trouble_sentences::identical(log, r, o, of));
                }
            }
        }
    }

    fn exchanged(&mut self, simulated: &mut [Vec<Vec<f64>>]) {
        let outputs = self.recordings[0].outputs.len();
        let found = relation::exchanged(outputs, |i, j| {
            self.recordings
                .iter()
                .zip(&*simulated)
                .map(|(log, s)| (log.output_data[i].as_slice(), s[j].as_slice()))
                .collect()
        });
        if let Some((i, j)) = found {
            for s in simulated.iter_mut() {
                s.swap(i, j);
            }
            self.troubles
                .push(trouble_sentences::swapped(&self.recordings[0], i, j));
        }
    }

    fn wraps(&mut self, simulated: &mut [Vec<Vec<f64>>]) {
        for (r, (log, simulated)) in self.recordings.iter_mut().zip(simulated).enumerate() {
            for (o, simulated) in simulated.iter_mut().enumerate() {
                let found = wrap::wraps(&log.output_data[o], simulated);
                if found.0.is_none() && found.1.is_none() {
                    continue;
                }
                self.troubles
                    .push(trouble_sentences::wrapped(log, r, o, &found));
                if let Some(wrap) = found.0 {
                    log.output_data[o] = wrap.unwrapped;
                }
                if let Some(wrap) = found.1 {
                    *simulated = wrap.unwrapped;
                }
            }
        }
    }

    fn relations(&mut self, simulated: &mut [Vec<Vec<f64>>]) {
        for o in 0..self.recordings[0].outputs.len() {
            let pairs: Pairs = self
                .recordings
                .iter()
                .zip(&*simulated)
                .map(|(log, s)| (log.output_data[o].as_slice(), s[o].as_slice()))
                .collect();
            let Some(found) = relation::relation(&pairs) else {
                continue;
            };
            for s in simulated.iter_mut().flat_map(|s| s[o].iter_mut()) {
                *s = found.factor * *s + found.offset;
            }
            self.troubles
                .extend(trouble_sentences::related(&self.recordings[0], o, &found));
        }
    }

    fn clocks(&mut self, simulated: &mut [Vec<Vec<f64>>]) {
        for (r, simulated) in simulated.iter_mut().enumerate() {
            let log = &self.recordings[r];
            let pairs: Pairs = log
                .output_data
                .iter()
                .zip(&*simulated)
                .map(|(y, s)| (y.as_slice(), s.as_slice()))
                .collect();
            let Some(drift) = clock::drift(&pairs) else {
                continue;
            };
            // A clock is at fault where its correction makes the simulation linear in the recorded inputs, or where it is
            // linear already and inputs that never rest leave it no other reason.
            let before = misfit_of(log, simulated);
            let (cut, read) = if before < NOT_LINEAR {
                if !never_rests(log) {
                    continue;
                }
                clock::recording_corrected(log, simulated, drift)
            } else {
                let (cut, read) = clock::simulation_corrected(log, simulated, drift);
                let after = misfit_of(&cut, &read);
                if after > INTERPOLATION || after > MUCH_MORE_LINEAR * before {
                    continue;
                }
                self.interpolated = true;
                (cut, read)
            };
            let trouble = trouble_sentences::drifts(log, r, drift, before < NOT_LINEAR);
            self.troubles.push(trouble);
            self.recordings[r] = cut;
            *simulated = read;
        }
    }

    /// Leaves dropouts and outliers out: their samples hold what those beside them say.
    fn leave_out(&mut self, simulated: &[Vec<Vec<f64>>], allowed: &dyn Fn(&str) -> bool) {
        for (r, (log, simulated)) in self.recordings.iter_mut().zip(simulated).enumerate() {
            for (o, s) in simulated.iter().enumerate() {
                let mut found = gross::gross(&log.output_data[o], s);
                if !allowed("sensor_dropout") {
                    found.dropouts = None;
                }
                if !allowed("sensor_outliers") {
                    found.outliers.clear();
                }
                if found.is_empty() {
                    continue;
                }
                self.troubles
                    .extend(trouble_sentences::gross(log, s, (r, o), &found));
                log.output_data[o] = gross::filled(&log.output_data[o], s, found.samples());
            }
        }
    }
}

/// Names of inputs that never change.
pub(crate) fn constant_inputs(recordings: &[Log]) -> Vec<String> {
    let inputs = recordings.first().map_or(&[][..], |log| &log.inputs);
    let moves = |j: usize| {
        let of = |log: &Log| {
            let u = log.input_data.get(j).map_or(&[][..], Vec::as_slice);
            u.iter().any(|v| *v != u[0])
        };
        recordings.iter().any(of)
    };
    let constant = inputs.iter().enumerate().filter(|(j, _)| !moves(*j));
    constant.map(|(_, channel)| channel.name.clone()).collect()
}

/// Whether columns can be compared one by one.
fn belong_together(recordings: &[Log], logs: &[Log]) -> bool {
    !recordings.is_empty()
        && recordings.len() == logs.len()
        && recordings.iter().zip(logs).all(|(log, simulated)| {
            simulated.check().is_ok()
                && log.outputs.len() == recordings[0].outputs.len()
                && log.outputs.len() == simulated.outputs.len()
                && log.samples() == simulated.samples()
        })
}

/// Whether `y` moves and repeats `s` sample by sample.
fn is_copy(y: &[f64], s: &[f64]) -> bool {
    let largest = s.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let same = y
        .iter()
        .zip(s)
        .filter(|(y, s)| (*y - *s).abs() <= COPIED * largest)
        .count();
    let moves = y.iter().any(|v| *v != y[0]);
    moves && same as f64 >= ALL_OF_IT * y.len() as f64
}

/// What the best linear simulator misses of simulated columns.
fn misfit_of(log: &Log, simulated: &[Vec<f64>]) -> f64 {
    let data = Data {
        segments: vec![Segment {
            inputs: log.input_data.clone(),
            outputs: simulated.to_vec(),
            start_time: log.start_time,
        }],
        sample_time: log.sample_time,
        inputs: log.inputs.len(),
        outputs: log.outputs.len(),
        constant: false,
    };
    identify_simulator(&data).map_or(f64::INFINITY, |s| s.misfit)
}

/// Whether an input moves in each eighth of the recording by a good part of what it moves at all: a plant that rings or
/// coasts by itself runs ahead of its simulation as a clock would.
fn never_rests(log: &Log) -> bool {
    let n = log.samples();
    log.input_data.iter().any(|u| {
        let whole = super::data::deviation(u.iter());
        u.chunks(n.div_ceil(8).max(1)).all(|part| {
            super::data::deviation(part.iter()) > 0.3 * whole && part.iter().any(|v| *v != part[0])
        })
    })
}
