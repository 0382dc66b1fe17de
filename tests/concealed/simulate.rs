//! The fine-step integration of a plant with laws in it.
//!
//! Each step advances the linear part by its exact matrix exponential and adds the forces by Heun's rule, so
//! that a case without effects is the linear plant to rounding.

use super::actuator::InputPath;
use super::controller::Controller;
use super::dice::Dice;
use super::force::{Force, Memory};
use super::linear::{Matrix, dot, hold};
use super::numbers::{deviation, round_to};
use super::plant::{Plant, Site};
use super::sensor::Sensor;
use super::wiring::{Laws, ParallelMode};

/// What drives the plant.
#[derive(Debug, Clone)]
pub enum Drive<'a> {
    /// Input columns as they are.
    Open(&'a [Vec<f64>]),
    /// Controllers, and a reference column for each; further inputs get the extra columns.
    Loop {
        /// One controller a loop: output `i` to input `i`.
        controllers: &'a [Controller],
        /// References.
        references: &'a [Vec<f64>],
        /// Decimal digits of the recorded command, which is what the actuator gets.
        digits: usize,
    },
}

impl Drive<'_> {
    fn samples(&self) -> usize {
        match self {
            Self::Open(columns) => columns,
            Self::Loop { references, .. } => references,
        }
        .first()
        .map_or(0, Vec::len)
    }
}

/// A finished run.
#[derive(Debug, Clone, Default)]
pub struct Run {
    /// Commands.
    pub inputs: Vec<Vec<f64>>,
    /// What the sensors would read without noise, faults included.
    pub clean: Vec<Vec<f64>>,
    /// What they read.
    pub readings: Vec<Vec<f64>>,
    /// Position of each site at the samples.
    pub positions: Vec<Vec<f64>>,
    /// Velocity of each site at the samples.
    pub velocities: Vec<Vec<f64>>,
}

impl Run {
    /// Whether all signals are numbers of a sensible size.
    pub fn is_sane(&self) -> bool {
        const HUGE: f64 = 1e6;
        self.readings
            .iter()
            .chain(&self.inputs)
            .all(|column| column.iter().all(|v| v.abs() < HUGE))
    }

    /// Whether it is sane and its outputs are not much larger than the linear plant's, which have unit
    /// deviation: a loop that an effect has made unstable is not a recording anyone would keep.
    pub fn is_tame(&self) -> bool {
        const LARGEST: f64 = 2.0;
        self.is_sane() && self.clean.iter().all(|column| deviation(column) < LARGEST)
    }
}

/// The resolution of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resolution(pub usize);

impl Resolution {
    /// For final data: 50 steps a sample.
    pub const FINE: Self = Self(50);
    /// For the search of a strength.
    pub const SEARCH: Self = Self(20);
    /// For linear plants, whose step is exact.
    pub const EXACT: Self = Self(1);
}

struct Body {
    a: Matrix,
    b: Matrix,
    push: Matrix,
    c: Matrix,
    sites: Vec<Site>,
    forces: Vec<(usize, Force)>,
    state: Vec<f64>,
    /// Integrated velocity of the sites without a position state.
    travelled: Vec<f64>,
    memories: Vec<Memory>,
}

impl Body {
    fn new(plant: &Plant, laws: &Laws, step: f64) -> Self {
        let linear = plant.linear();
        let sites = plant.sites();
        let (n, m) = (linear.a.rows, linear.b.columns);
        let mut entries = Matrix::zeros(n, m + sites.len());
        for i in 0..n {
            for j in 0..m {
                entries.set(i, j, linear.b.at(i, j));
            }
            for (j, site) in sites.iter().enumerate() {
                entries.set(i, m + j, site.push[i]);
            }
        }
        let (a, held) = hold(&linear.a, &entries, step);
        Self {
            a,
            b: held.columns_from(0, m),
            push: held.columns_from(m, sites.len()),
            c: linear.c,
            travelled: vec![0.0; sites.len()],
            memories: vec![[0.0; 2]; laws.forces.len()],
            forces: laws.forces.clone(),
            sites,
            state: vec![0.0; n],
        }
    }

    fn motion(&self, site: usize, state: &[f64], step: f64) -> (f64, f64) {
        let place = &self.sites[site];
        let velocity = place.velocity.value(state);
        let position = match place.position {
            Some(coordinate) => coordinate.value(state),
            None => {
                let mean = 0.5 * (velocity + place.velocity.value(&self.state));
                self.travelled[site] + step * mean
            }
        };
        (position, velocity)
    }

    fn add_force(&self, state: &mut [f64], site: usize, force: f64) {
        for (i, value) in state.iter_mut().enumerate() {
            *value += self.push.at(i, site) * force;
        }
    }

    fn advance(&mut self, inputs: &[f64], time: f64, step: f64) {
        let mut next: Vec<f64> = (0..self.state.len())
            .map(|i| dot(self.a.row(i), &self.state) + dot(self.b.row(i), inputs))
            .collect();
        let mut before = Vec::with_capacity(self.forces.len());
        for ((site, law), memory) in self.forces.iter().zip(&self.memories) {
            let (x, v) = self.motion(*site, &self.state, 0.0);
            before.push((x, v, law.resist(x, v, memory, time)));
        }
        for ((site, _), (_, _, force)) in self.forces.iter().zip(&before) {
            self.add_force(&mut next, *site, *force);
        }
        let predicted = next.clone();
        for (j, (x0, v0, f0)) in before.into_iter().enumerate() {
            let (site, law) = &self.forces[j];
            let (x1, v1) = self.motion(*site, &predicted, step);
            let mut memory = self.memories[j];
            law.advance(0.5 * (x0 + x1), 0.5 * (v0 + v1), &mut memory, step);
            let after = law.resist(x1, v1, &memory, time + step);
            self.memories[j] = memory;
            self.add_force(&mut next, *site, 0.5 * (after - f0));
        }
        for (j, site) in self.sites.iter().enumerate() {
            let mean = 0.5 * (site.velocity.value(&self.state) + site.velocity.value(&next));
            self.travelled[j] += step * mean;
        }
        self.state = next;
    }
}

struct Side {
    mode: ParallelMode,
    transition: (Matrix, Matrix),
    state: [f64; 2],
}

impl Side {
    fn new(mode: &ParallelMode, step: f64) -> Self {
        let square = mode.rate * mode.rate;
        let a = Matrix::from_rows(&[&[0.0, 1.0], &[-square, -2.0 * mode.damping * mode.rate]]);
        let b = Matrix::from_rows(&[&[0.0], &[square]]);
        Self {
            mode: mode.clone(),
            transition: hold(&a, &b, step),
            state: [0.0; 2],
        }
    }

    fn advance(&mut self, inputs: &[f64]) {
        let u = inputs[self.mode.channel];
        let (a, b) = &self.transition;
        self.state = std::array::from_fn(|i| dot(a.row(i), &self.state) + b.at(i, 0) * u);
    }
}

/// Runs the plant with its laws from rest; `noise` has a column for each output, or none for no noise.
pub fn run(
    plant: &Plant,
    laws: &Laws,
    drive: &Drive,
    noise: &[Vec<f64>],
    resolution: Resolution,
) -> Run {
    let dt = plant.kind.sample_time();
    let steps = resolution.0;
    let step = dt / steps as f64;
    let (inputs, outputs, samples) = (plant.inputs(), plant.outputs(), drive.samples());
    let mut body = Body::new(plant, laws, step);
    let mut sides: Vec<Side> = laws.parallel.iter().map(|m| Side::new(m, step)).collect();
    let mut paths: Vec<InputPath> = (0..inputs)
        .map(|channel| InputPath::new(of_channel(&laws.elements, channel)))
        .collect();
    let sensors: Vec<Sensor> = (0..outputs)
        .map(|output| Sensor::new(of_channel(&laws.faults, output)))
        .collect();
    let (mut spotless, mut sensors) = (sensors.clone(), sensors);
    let mut controllers = match drive {
        Drive::Loop { controllers, .. } => controllers.to_vec(),
        Drive::Open(_) => Vec::new(),
    };
    let (jitter, jitter_seed) = laws.jitter;
    let mut lateness = Dice::new(jitter_seed, 0);
    let mut trail: Vec<Vec<f64>> = vec![vec![0.0]; outputs];
    let mut out = Run {
        inputs: vec![Vec::with_capacity(samples); inputs],
        clean: vec![Vec::with_capacity(samples); outputs],
        readings: vec![Vec::with_capacity(samples); outputs],
        positions: vec![Vec::with_capacity(samples); body.sites.len()],
        velocities: vec![Vec::with_capacity(samples); body.sites.len()],
    };
    let read_out = |body: &Body, sides: &[Side], i: usize| {
        let beside: f64 = sides
            .iter()
            .filter(|side| side.mode.output == i)
            .map(|side| side.mode.gain * side.state[0])
            .sum();
        dot(body.c.row(i), &body.state) + beside
    };
    let mut effective = vec![0.0; inputs];
    for k in 0..samples {
        let late = jitter * lateness.unit() * steps as f64;
        for i in 0..outputs {
            let output = if jitter > 0.0 {
                before_end(&trail[i], late)
            } else {
                read_out(&body, &sides, i)
            };
            let disturbance = noise.get(i).map_or(0.0, |column| column[k]);
            out.clean[i].push(spotless[i].read(output, 0.0, k));
            out.readings[i].push(sensors[i].read(output, disturbance, k));
        }
        for site in 0..body.sites.len() {
            let (x, v) = body.motion(site, &body.state, 0.0);
            out.positions[site].push(x);
            out.velocities[site].push(v);
        }
        for channel in 0..inputs {
            let command = match drive {
                Drive::Open(columns) => columns[channel][k],
                Drive::Loop {
                    references, digits, ..
                } => {
                    let reference = references[channel][k];
                    let command = match controllers.get_mut(channel) {
                        Some(law) => law.command(reference, out.readings[channel][k], dt),
                        None => reference,
                    };
                    round_to(command, *digits)
                }
            };
            out.inputs[channel].push(command);
        }
        for column in &mut trail {
            column.clear();
        }
        for i in 0..steps {
            if jitter > 0.0 {
                for (output, column) in trail.iter_mut().enumerate() {
                    column.push(read_out(&body, &sides, output));
                }
            }
            let time = (k as f64 + i as f64 / steps as f64) * dt;
            for (value, (path, column)) in
                effective.iter_mut().zip(paths.iter_mut().zip(&out.inputs))
            {
                *value = path.advance(column, time, step, dt);
            }
            body.advance(&effective, time, step);
            for side in &mut sides {
                side.advance(&effective);
            }
        }
        if jitter > 0.0 {
            for (output, column) in trail.iter_mut().enumerate() {
                column.push(read_out(&body, &sides, output));
            }
        }
    }
    out
}

fn of_channel<T: Clone>(items: &[(usize, T)], channel: usize) -> Vec<T> {
    items
        .iter()
        .filter(|(at, _)| *at == channel)
        .map(|(_, item)| item.clone())
        .collect()
}

/// The value `late` steps before the end of a trail, interpolated.
fn before_end(trail: &[f64], late: f64) -> f64 {
    let last = trail.len().saturating_sub(1) as f64;
    let at = (last - late).max(0.0);
    let low = at as usize;
    let high = (low + 1).min(trail.len() - 1);
    trail[low] + (trail[high] - trail[low]) * (at - low as f64)
}
