//! Which effects deserve a fit: one Gauss-Newton step for every entry of the library at every place it may act.
//!
//! The response of the plant to each law, evaluated on the simulated motion, is projected off what the free numbers of
//! the plant explain anyway; the residual's share along what is left is what the effect would gain (a score test,
//! linear in amplitude and direction). This is done around several starting points and under several noise models:
//! the truth then is among the first few (math/explain.md, choice 4), and the step supplies starting values.

use nalgebra::{DMatrix, DVector};

use crate::explain::effects::{self, Action, Clock, Definition, Sense};
use crate::explain::linear::data::{Data, Series};
use crate::explain::linear::fit::{Fit, Problem};
use crate::explain::linear::model::functionals::{Functionals, Signal, dot, matched_sign};
use crate::explain::linear::model::linear_plant::Plant;
use crate::explain::linear::model::structure::{Direction, Instance, Structure};
use crate::explain::linear::model::time_stepping::{Grid, run};
use crate::linalg::multiply_tn;
use crate::noise::Noise;

/// Lines of the residual's spectrum that are tried as a disturbance.
const LINES: usize = 4;

/// An effect at a place with starting values, and what one step promises.
#[derive(Debug, Clone)]
pub(crate) struct Lead {
    pub(crate) instance: Instance,
    /// Its numbers, in the order and scale of the parameter vector.
    pub(crate) start: Vec<f64>,
    /// Predicted decrease of Schwarz's criterion.
    pub(crate) gain: f64,
}

/// Everything that screening around one fit needs.
pub(crate) struct Bench<'a> {
    pub(crate) problem: &'a Problem<'a>,
    pub(crate) basis: &'a Fit,
    pub(crate) plant: Plant,
    pub(crate) rows: Functionals,
    pub(crate) noise: &'a Noise,
    /// Square roots of the weights of the values that count.
    pub(crate) weights: Vec<f64>,
    /// Whitened weighted residual, projected off the free numbers.
    pub(crate) residual: DVector<f64>,
    /// Whitened weighted sensitivities, and the inverse of their Gram matrix.
    pub(crate) nuisance: DMatrix<f64>,
    pub(crate) nuisance_inverse: DMatrix<f64>,
    pub(crate) left: f64,
    /// What a small change before the sensors is multiplied by, where they do not pass it on as it is.
    pub(crate) slopes: Option<Series>,
}

/// A place and law with its response: one column a linear coefficient.
pub(crate) struct Template {
    pub(crate) instance: Instance,
    pub(crate) shape: Vec<f64>,
    pub(crate) columns: Vec<Series>,
}

/// Signals of the basis: per segment.
pub(crate) struct Signals {
    pub(crate) instance_signal: Signal,
    pub(crate) position: Vec<Vec<f64>>,
    pub(crate) rate: Vec<Vec<f64>>,
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
    pub(crate) fn new(
        problem: &'a Problem<'a>,
        basis: &'a Fit,
        noise: &'a Noise,
        sensitivities: Vec<Option<Series>>,
    ) -> Option<Self> {
        let plant = basis.structure.plant(&basis.theta);
        let whitened = noise.whiten(&basis.residual, &problem.mask);
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
            rows: Functionals::new(&plant),
            problem,
            basis,
            plant,
            noise,
            weights,
            residual: DVector::from_vec(e),
            nuisance: DMatrix::zeros(rows, 0),
            nuisance_inverse: DMatrix::zeros(0, 0),
            left: 0.0,
            slopes: super::rectified_signs::signs(&basis.structure, &basis.theta, problem.data),
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

    pub(crate) fn data(&self) -> &Data {
        self.problem.data
    }

    /// Whitened, weighted, without the values that do not count.
    pub(crate) fn flatten(&self, series: &Series) -> Vec<f64> {
        let mut flat = self.noise.whiten_kept(series, &self.problem.mask);
        for (v, w) in flat.iter_mut().zip(&self.weights) {
            *v *= w;
        }
        flat
    }

    /// Columns less what the free numbers of the plant explain of them.
    pub(crate) fn projected(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        if self.nuisance.ncols() == 0 {
            return columns.clone();
        }
        let inner = multiply_tn(&self.nuisance, columns);
        let coefficients = &self.nuisance_inverse * inner;
        columns - crate::linalg::multiply(&self.nuisance, &coefficients)
    }

    pub(crate) fn clock(&self, segment: usize) -> Clock {
        clock(self.data(), segment)
    }

    /// Positions and rates that forces may look at, from the motion of the basis.
    pub(crate) fn signals(&self) -> Vec<Signals> {
        motions(self.problem, self.basis, &self.plant)
    }

    /// Frequencies (Hz) of the largest lines of the residual's periodogram, whitened, all outputs together.
    fn lines(&self) -> Vec<f64> {
        let whitened = self.noise.whiten(&self.basis.residual, &self.problem.mask);
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
        let curve = template.instance.definition.is_curve();
        if let (false, Some((coefficients, gained))) = (curve, solve(&gram, &inner, &before)) {
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
            let rows = self.rows.of(&self.plant, instance.signal);
            match instance.direction {
                Direction::Matched(input) => {
                    let amplitude =
                        coefficients[0] * matched_sign(&self.plant, &rows.forward, input);
                    if sense == Sense::Resists && amplitude <= 0.0 {
                        return None;
                    }
                    start.push(amplitude);
                }
                Direction::Free => {
                    if sense == Sense::Resists && dot(&rows.forward, coefficients) <= 0.0 {
                        return None;
                    }
                    start.extend_from_slice(coefficients);
                }
            }
        }
        let mut shape = template.shape.clone();
        if definition.is_curve() {
            // Its coefficients are the amplitude.
            let amplitude = std::mem::replace(&mut start[0], 1.0);
            definition
                .linear
                .iter()
                .for_each(|i| shape[*i] *= amplitude);
        } else if coefficients.len() == 1 {
            // The template held the start values; the coefficient multiplies them.
            let scaled = matches!(definition.action, Action::Input(_));
            for &i in definition.linear {
                shape[i] = if scaled {
                    shape[i] * coefficients[0]
                } else {
                    coefficients[0]
                };
            }
        } else {
            for (&i, c) in definition.linear.iter().zip(coefficients) {
                shape[i] = *c;
            }
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
        if matches!(
            definition.action,
            Action::Mode | Action::Sine | Action::MissingPath | Action::Charge
        ) {
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

/// Positions and rates that forces may look at, from the motion of `fit`, whose plant is `plant`.
pub(crate) fn motions(problem: &Problem, fit: &Fit, plant: &Plant) -> Vec<Signals> {
    let l = plant.outputs;
    let rows = Functionals::new(plant);
    let mut places: Vec<Signal> = (0..l).map(Signal::Output).collect();
    places.extend((0..l).map(Signal::Integral));
    for i in 0..l {
        for j in i + 1..l {
            places.push(Signal::Difference(i, j));
        }
    }
    let prepared = fit.structure.prepare(&fit.theta);
    let mut reader = prepared.plant.clone();
    reader.c.clear();
    reader.d.clear();
    for place in &places {
        let rows = rows.of(plant, *place);
        reader.c.extend(&rows.position);
        let mut direct = rows.position_feedthrough;
        direct.resize(reader.inputs, 0.0);
        reader.d.extend(direct);
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
    for (index, segment) in problem.data.segments.iter().enumerate() {
        let x0 = fit.structure.initial_state(&fit.theta, index);
        let (inputs, _) =
            fit.structure
                .effective_inputs(&fit.theta, segment, &clock(problem.data, index));
        let read = run(
            &reader,
            &prepared.forces,
            x0,
            &inputs,
            Grid::of_samples(segment.samples()),
            &clock(problem.data, index),
        )
        .unwrap_or_else(|| vec![vec![0.0; segment.samples()]; reader.outputs]);
        for (signals, pair) in found.iter_mut().zip(read.chunks_exact(2)) {
            signals.position.push(pair[0].clone());
            signals.rate.push(pair[1].clone());
        }
    }
    found
}

fn clock(data: &Data, segment: usize) -> Clock {
    Clock {
        start: data.segments[segment].start_time,
        step: data.sample_time,
        fresh: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::linear::fixtures::{effect, recorded, spring};
    use crate::explain::linear::model::structure::Structure;
    use crate::noise::Colours;

    /// The lead of an effect at the place where it acts, beside the plant as it is.
    fn lead(truth: &Structure, theta: &[f64], direction: Direction) -> (Lead, f64) {
        let data = recorded(truth, theta, 6);
        let problem = Problem::new(&data);
        let plain = spring(Vec::new());
        let mut basis = Fit::at(&problem, plain, Vec::new()).unwrap();
        let id = truth.effects[0].definition.id;
        let noise = Noise::estimate(&basis.residual, 1, &problem.mask, Colours::All);
        let leads = screen(&problem, &mut basis, &[noise], &|d| d.id == id)
            .swap_remove(0)
            .into_iter();
        let here = leads.filter(|l| l.instance.direction == direction);
        let best = here
            .max_by(|a, b| a.gain.total_cmp(&b.gain))
            .expect("a lead");
        let fit = Fit::at(&problem, truth.clone(), theta.to_vec()).unwrap();
        let brought = basis.noise.deviance(&basis.residual, &problem.mask)
            - basis.noise.deviance(&fit.residual, &problem.mask);
        (best, brought)
    }

    #[test]
    fn a_force_is_tried_with_each_input_at_its_size() {
        let truth = spring(vec![effect("cubic_stiffness", "")]);
        let (lead, _) = lead(&truth, &[30.0], Direction::Matched(0));
        let size = lead.start[0] / 30.0;
        assert!((0.5..1.5).contains(&size), "{:?}", lead.start);
        assert!(lead.gain > 20.0, "{}", lead.gain);
    }

    /// In phase and out of phase with its input.
    #[test]
    fn a_mode_is_seen_in_either_phase() {
        for residues in [[0.3, 0.0], [0.0, 0.3]] {
            let truth = spring(vec![Instance {
                direction: Direction::Free,
                ..effect("extra_mode", "")
            }]);
            let theta = [1.0_f64.ln(), 0.05_f64.ln(), residues[0], residues[1]];
            let (lead, brought) = lead(&truth, &theta, Direction::Free);
            println!("{residues:?}: {} of {brought}", lead.gain);
            assert!(lead.gain > 0.3 * brought, "{} of {brought}", lead.gain);
        }
    }
}
