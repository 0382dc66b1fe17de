//! What each law would do along the motion of a fit: columns to regress a residual on.

use super::score_tests::{Bench, Signals, Template};
use crate::explain::effects::{self, Action, CHARGE_ORDERS, Definition, Motion, Needs, Observed};
use crate::explain::linear::data::Series;
use crate::explain::linear::model::functionals::Signal;
use crate::explain::linear::model::linear_plant::Plant;
use crate::explain::linear::model::structure::{
    Direction, Instance, add_charge, add_mode, add_sine,
};
use crate::explain::linear::model::time_stepping::{Grid, run};

/// Times of change that are tried over a recording.
const CHANGE_TIMES: usize = 40;

/// Frequencies at which a missing resonance is tried.
const MODE_FREQUENCIES: usize = 40;

impl Bench<'_> {
    pub(crate) fn templates(
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
                .flat_map(|o| self.sensor_templates(definition, o))
                .collect(),
            Action::Sine => self.sine_templates(definition, lines),
            Action::Charge => (0..self.data().signals())
                .flat_map(|j| self.charge_templates(definition, j))
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
                    columns: self.path_columns(j),
                })
                .collect(),
            Action::Linear(_) | Action::Exact => Vec::new(),
        }
    }

    fn observed(&self, channel: Vec<f64>, rate: Vec<f64>, lines: &[f64]) -> Observed {
        let step = self.data().sample_time;
        let first = &self.data().segments[0];
        let length = first.samples() as f64 * step;
        let change_times = (1..CHANGE_TIMES)
            .map(|i| first.start_time + length * i as f64 / CHANGE_TIMES as f64)
            .collect();
        Observed {
            channel,
            rate,
            step,
            change_times,
            lines: lines.to_vec(),
            frequencies: mode_frequencies(length, step),
        }
    }

    /// Response of the outputs to `drive` (a column a segment) entering through `direction`.
    pub(crate) fn response(&self, direction: &[f64], drive: &[Vec<f64>]) -> Series {
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
            let grid = Grid::of_samples(w.len());
            let y = run(&plant, &[], &zero, &input, grid, &self.clock(index))
                .unwrap_or_else(|| vec![vec![0.0; w.len()]; plant.outputs]);
            series.extend(y);
        }
        for (y, slopes) in series.iter_mut().zip(self.slopes.iter().flatten()) {
            for (y, slope) in y.iter_mut().zip(slopes) {
                *y *= slope;
            }
        }
        series
    }

    /// Responses to `drive` through each state.
    pub(crate) fn directions(&self, drive: &[Vec<f64>]) -> Vec<Series> {
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
        let within = crate::explain::linear::model::continuous::moment_columns(&self.plant)
            .swap_remove(input);
        (definition.starts)(&observed)
            .into_iter()
            .map(|shape| {
                let mut drive = Vec::new();
                let mut moments: Vec<Vec<effects::Moments>> = Vec::new();
                for (index, s) in segments.iter().enumerate() {
                    let mut u = s.inputs[input].clone();
                    let mut m = vec![[0.0; 2]; u.len()];
                    law(&shape, &mut u, &mut m, &self.clock(index));
                    drive.push(u.iter().zip(&s.inputs[input]).map(|(a, b)| a - b).collect());
                    moments.push(m);
                }
                let mut column = self.response(&b, &drive);
                for (degree, push) in within.iter().enumerate() {
                    let drive: Vec<Vec<f64>> = moments
                        .iter()
                        .map(|m| m.iter().map(|m| m[degree]).collect())
                        .collect();
                    if drive.iter().flatten().all(|v| *v == 0.0) {
                        continue;
                    }
                    let response = self.response(push, &drive);
                    for (y, w) in column.iter_mut().flatten().zip(response.iter().flatten()) {
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

    fn sine_templates(&self, definition: &'static Definition, lines: &[f64]) -> Vec<Template> {
        let observed = self.observed(Vec::new(), Vec::new(), lines);
        let l = self.data().outputs;
        (definition.starts)(&observed)
            .into_iter()
            .map(|shape| {
                let part = |i: usize| -> Series {
                    let mut parts = vec![0.0; 2 * l];
                    parts[i] = 1.0;
                    let mut series = Vec::new();
                    for (index, segment) in self.data().segments.iter().enumerate() {
                        let mut y = vec![vec![0.0; segment.samples()]; l];
                        add_sine(shape[0], &parts, &self.clock(index), &mut y);
                        series.extend(y);
                    }
                    series
                };
                Template {
                    instance: Instance {
                        definition,
                        channel: 0,
                        signal: Signal::Output(0),
                        direction: Direction::Free,
                    },
                    columns: (0..2 * l).map(part).collect(),
                    shape,
                }
            })
            .collect()
    }

    /// Responses to an input through each state, and a level at each output.
    fn path_columns(&self, input: usize) -> Vec<Series> {
        let drive: Vec<Vec<f64>> = self
            .data()
            .segments
            .iter()
            .map(|s| s.inputs[input].clone())
            .collect();
        let mut columns = self.directions(&drive);
        let l = self.data().outputs;
        columns.extend((0..l).map(|o| -> Series {
            let series = self.basis.simulated.iter().enumerate();
            series
                .map(|(s, y)| vec![if s % l == o { 1.0 } else { 0.0 }; y.len()])
                .collect()
        }));
        columns
    }

    fn charge_templates(&self, definition: &'static Definition, input: usize) -> Vec<Template> {
        let segments = &self.data().segments;
        let channel = segments
            .iter()
            .flat_map(|s| s.inputs[input].clone())
            .collect();
        let observed = self.observed(channel, Vec::new(), &[]);
        let l = self.data().outputs;
        (definition.starts)(&observed)
            .into_iter()
            .map(|shape| {
                let column = |i: usize| -> Series {
                    let mut coefficients = vec![0.0; CHARGE_ORDERS * l];
                    coefficients[i] = 1.0;
                    let mut series = Vec::new();
                    for (index, segment) in segments.iter().enumerate() {
                        let mut y = vec![vec![0.0; segment.samples()]; l];
                        let clock = self.clock(index);
                        add_charge(
                            &shape,
                            &coefficients,
                            &segment.inputs[input],
                            &clock,
                            &mut y,
                        );
                        series.extend(y);
                    }
                    series
                };
                Template {
                    instance: Instance {
                        definition,
                        channel: input,
                        signal: Signal::Output(0),
                        direction: Direction::Free,
                    },
                    columns: (0..CHARGE_ORDERS * l).map(column).collect(),
                    shape,
                }
            })
            .collect()
    }

    fn sensor_templates(&self, definition: &'static Definition, output: usize) -> Vec<Template> {
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
        let observed = self.observed(channel, Vec::new(), &[]);
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
        let rows = &self.rows;
        let oscillates = self.plant.oscillates();
        let mut templates = Vec::new();
        for signal in signals {
            // One output of a plant that no spring holds (a drive) may be a speed as well as a position, so friction is tried on
            // both.
            let drive = || !oscillates && definition.id != "quadratic_drag";
            let possible = match (needs, signal.instance_signal) {
                (Needs::Time, place) => place == Signal::Output(0),
                (Needs::Rate, place @ Signal::Integral(_)) => {
                    drive() || rows.sensible(&self.plant, place)
                }
                (Needs::Position | Needs::Rate | Needs::Acceleration, place) => {
                    rows.sensible(&self.plant, place)
                }
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
}

/// From a few periods in the recording to most of the band, in steps of one ratio.
fn mode_frequencies(length: f64, step: f64) -> Vec<f64> {
    let (low, high) = (5.0 / length, 0.45 / step);
    (0..MODE_FREQUENCIES)
        .map(|i| low * (high / low).powf(i as f64 / (MODE_FREQUENCIES - 1) as f64))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_are_looked_for_in_the_band() {
        let found = mode_frequencies(40.0, 0.01);
        assert_eq!(found.len(), MODE_FREQUENCIES);
        assert!((found[0] - 0.125).abs() < 1e-12);
        assert!((found[MODE_FREQUENCIES - 1] - 45.0).abs() < 1e-9);
        let ratio = found[1] / found[0];
        assert!(ratio > 1.0);
        assert!(
            found
                .windows(2)
                .all(|f| (f[1] / f[0] / ratio - 1.0).abs() < 1e-9)
        );
    }
}
