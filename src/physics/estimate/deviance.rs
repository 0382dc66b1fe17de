//! The deviance of the recordings in one form, with its derivatives.

use std::rc::Rc;

use nalgebra::{DMatrix, DVector};

use super::Form;
use super::optimise::{Objective, RIDGE};
use super::plant_recording::Columns;
use super::problem::Problem;
use crate::noise::{Colour, Noise, Series};
use crate::physics::simulated::Run;
use crate::physics::simulation::{Direction, Observer, Plan, Point, Trajectory};

/// A covariance is believed where the deviance rises by at least this at a standard deviation, where a parabola rises by 1.
const LEAST_RISE: f64 = 0.1;
/// Part of the largest deviation that the ridge allows, from which on a number is not determined.
const UNDETERMINED: f64 = 0.01;
/// Steps that are tried for a difference, each the root of 10 times the one before: eight decades beyond the derivative's.
const MOST_STEPS: usize = 16;

/// Runs of all recordings at a point.
struct Runs {
    at: Vec<f64>,
    plans: Vec<Plan>,
    states: Vec<Series>,
    residual: Series,
}

/// How derivatives by the free numbers are computed in a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slopes {
    /// Approximately where the plant can; exactly once that finds nothing better.
    FrozenFirst,
    /// Approximately where the plant can.
    Frozen,
    Exact,
}

/// A run of each recording.
fn prepare<'r>(
    problem: &Problem,
    points: &'r [Point],
    columns: &'r [Columns<'r>],
    gain: Option<&'r DMatrix<f64>>,
    plans: &'r [Plan],
) -> Vec<Run<'r>> {
    let each = problem.recordings.iter().zip(points).zip(columns);
    each.zip(plans)
        .map(|(((recording, point), columns), plan)| Run {
            point,
            excitation: problem.excitation(recording, columns),
            observer: gain.map(|gain| Observer {
                gain,
                recorded: &columns.outputs,
            }),
            plan,
        })
        .collect()
}

/// The deviance in one form with a given noise model.
pub(super) struct Deviance<'p, 'a> {
    problem: &'p Problem<'a>,
    form: Form,
    pub(super) noise: Noise,
    /// True when the gain of the observer stays as it is: its derivatives are not computed.
    pub(super) gain_held: bool,
    pub(super) slopes: Slopes,
    /// The last runs, and those at which derivatives were computed last: a search returns to these.
    last: Option<Rc<Runs>>,
    base: Option<Rc<Runs>>,
}

impl<'p, 'a> Deviance<'p, 'a> {
    pub(crate) fn new(problem: &'p Problem<'a>, form: Form, noise: Noise) -> Self {
        Self {
            problem,
            form,
            noise,
            gain_held: false,
            slopes: Slopes::FrozenFirst,
            last: None,
            base: None,
        }
    }

    fn gain(&self, point: &[f64]) -> Option<DMatrix<f64>> {
        (self.form == Form::Innovation).then(|| self.problem.gain(point))
    }

    fn runs(&self, point: &[f64]) -> Option<Vec<Trajectory>> {
        let gain = self.gain(point);
        let problem = self.problem;
        let points = problem.points(point);
        let columns = problem.columns();
        let runs = prepare(problem, &points, &columns, gain.as_ref(), &problem.plans);
        problem.plant.run(&runs).ok()
    }

    fn run(&self, point: &[f64]) -> Option<Runs> {
        let trajectories = self.runs(point)?;
        let mut residual = Series::new();
        for (r, t) in self.problem.recordings.iter().zip(&trajectories) {
            for (y, s) in r.outputs.iter().zip(&t.outputs) {
                residual.push(
                    y.iter()
                        .zip(s)
                        .map(|(y, s)| if y.is_finite() { y - s } else { 0.0 })
                        .collect(),
                );
            }
        }
        let (plans, states) = trajectories.into_iter().map(|t| (t.plan, t.states)).unzip();
        Some(Runs {
            at: point.to_vec(),
            plans,
            states,
            residual,
        })
    }

    /// Runs at a point, which the noise model does not change.
    fn at(&mut self, point: &[f64]) -> Option<Rc<Runs>> {
        for known in [&self.last, &self.base].into_iter().flatten() {
            if known.at == point {
                return Some(Rc::clone(known));
            }
        }
        let runs = Rc::new(self.run(point)?);
        self.last = Some(Rc::clone(&runs));
        Some(runs)
    }

    /// Outputs at a point.
    pub(crate) fn simulated(&self, point: &[f64]) -> Option<Series> {
        Some(
            self.runs(point)?
                .into_iter()
                .flat_map(|t| t.outputs)
                .collect(),
        )
    }

    /// Recording minus prediction.
    pub(crate) fn residual(&mut self, point: &[f64]) -> Option<Series> {
        self.at(point).map(|r| r.residual.clone())
    }

    /// White noise of the size of the residual at a point.
    pub(crate) fn rescale(&mut self, point: &[f64]) -> Option<Noise> {
        Some(Noise::white(
            &self.at(point)?.residual,
            self.problem.outputs(),
            &self.problem.mask,
        ))
    }

    #[allow(
        clippy::needless_range_loop,
        reason = "a direction is a column of every output"
    )]
    /// Whitened derivatives of the predictions, a column for each free number, and whether they are approximate.
    fn jacobian(&self, runs: &Runs, slopes: Slopes) -> Option<(DMatrix<f64>, bool)> {
        let problem = self.problem;
        let gain = self.gain(&runs.at);
        let l = problem.outputs();
        let parameters = problem.free.iter().map(|&i| Direction::Parameter(i));
        let starts = problem.starts.iter().map(|&i| Direction::Start(i));
        let mut directions: Vec<Direction> = parameters.chain(starts).collect();
        if gain.is_some() && !self.gain_held {
            directions.extend(
                problem
                    .places_of_gains()
                    .map(|(i, j)| Direction::Gain(i, j)),
            );
        }
        let (p, s, count) = (
            problem.free.len(),
            problem.starts.len(),
            problem.recordings.len(),
        );
        let rows = problem.count();
        let mut matrix = DMatrix::zeros(rows, runs.at.len());
        let mut row = 0;
        let points = problem.points(&runs.at);
        let columns = problem.columns();
        let prepared = prepare(problem, &points, &columns, gain.as_ref(), &runs.plans);
        let frozen = match slopes {
            Slopes::Exact => None,
            _ => problem
                .plant
                .frozen_slopes(&prepared, &runs.states, &directions),
        };
        let is_frozen = frozen.is_some();
        let slopes = match frozen {
            Some(slopes) => slopes,
            None => problem.plant.slopes(&prepared, &directions)?,
        };
        for (r, slopes) in slopes.iter().enumerate() {
            let mask = &problem.mask[r * l..(r + 1) * l];
            let mut height = 0;
            for d in 0..directions.len() {
                let series: Series = (0..l).map(|o| slopes[o][d].clone()).collect();
                let whitened = self.noise.whiten_kept(&series, &mask.to_vec());
                height = whitened.len();
                let column = if d < p {
                    d
                } else if d < p + s {
                    p + r * s + (d - p)
                } else {
                    p + count * s + (d - p - s)
                };
                for (k, v) in whitened.into_iter().enumerate() {
                    matrix[(row + k, column)] = v;
                }
            }
            row += height;
        }
        let finite = matrix.iter().all(|v| v.is_finite());
        finite.then_some((matrix, is_frozen))
    }

    /// Whitened derivatives of the predictions at a point: a row for each value that counts, a column for each free number.
    pub(crate) fn derivatives(&mut self, point: &[f64]) -> Option<DMatrix<f64>> {
        let runs = self.at(point)?;
        Some(self.jacobian(&runs, Slopes::Exact)?.0)
    }

    /// Covariances of the free numbers.
    pub(crate) fn covariances(&mut self, point: &[f64]) -> Covariances {
        let m = point.len();
        let nothing_known = || DMatrix::from_diagonal_element(m, m, f64::INFINITY);
        // The derivatives of steps at the edge of stability, as at a contact, may grow without bound; those of the equations do not.
        let jacobian = self.at(point).and_then(|runs| {
            let exact = self.jacobian(&runs, Slopes::Exact);
            let jacobian = exact.or_else(|| self.jacobian(&runs, Slopes::Frozen))?;
            Some((jacobian.0, runs))
        });
        let Some((plant, runs)) = jacobian else {
            return Covariances {
                joint: nothing_known(),
                given_noise: nothing_known(),
            };
        };
        let first = self.covariances_from(&plant, &runs);
        if self.foretells(point, &first.given_noise, &plant) {
            return first;
        }
        match self.secants(point, &plant) {
            Some(secants) => self.covariances_from(&secants, &runs),
            None => first,
        }
    }

    /// Whether the deviance rises as the covariance foretells, by 1 at a standard deviation, or at least by a part of that. Where an
    /// equation has a kink with an infinite slope, as a root at 0, derivatives at a point may be any number of times too large. What
    /// the recordings do not determine has the deviation that the ridge gives it: nothing rises there, and nothing is wrong.
    fn foretells(
        &mut self,
        point: &[f64],
        covariance: &DMatrix<f64>,
        derivatives: &DMatrix<f64>,
    ) -> bool {
        let Some(base) = Objective::deviance(self, point) else {
            return true;
        };
        let ranges = self.problem.ranges();
        (0..ranges.len()).all(|i| {
            let std = covariance[(i, i)].max(0.0).sqrt();
            // Against the deviation with everything else known.
            let times = std * derivatives.column(i).norm();
            if !times.is_finite() || times == 0.0 || times > UNDETERMINED / RIDGE.sqrt() {
                return true;
            }
            let mut rises = [1.0, -1.0].into_iter().filter_map(|sign: f64| {
                let moved: Vec<f64> = (0..point.len())
                    .map(|j| point[j] + sign * covariance[(j, i)] / std)
                    .collect();
                let inside = moved.iter().zip(&ranges);
                let inside = inside.into_iter().all(|(p, r)| *p >= r.min && *p <= r.max);
                inside.then(|| Objective::deviance(self, &moved))?
            });
            // What leaves the bounds, or cannot be simulated, is not asked.
            rises.all(|deviance| deviance - base > LEAST_RISE)
        })
    }

    /// Derivatives as differences over such a step of each number that the deviance rises by about 1; those of `exact` where no step
    /// within the bounds does that.
    fn secants(&mut self, point: &[f64], exact: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let runs = self.at(point)?;
        let base = self.noise.whiten_kept(&runs.residual, &self.problem.mask);
        let deviance = self.noise.deviance(&runs.residual, &self.problem.mask);
        let ranges = self.problem.ranges();
        let mut secants = exact.clone();
        for (i, range) in ranges.iter().enumerate() {
            let mut step = 1.0 / exact.column(i).norm();
            for _ in 0..MOST_STEPS {
                if !step.is_finite() || step == 0.0 {
                    break;
                }
                let mut moved = point.to_vec();
                moved[i] += step;
                if moved[i] > range.max {
                    step = -step;
                    moved[i] = point[i] + step;
                }
                if moved[i] < range.min || moved[i] > range.max {
                    break;
                }
                let Some(there) = self.at(&moved) else {
                    break;
                };
                let e = self.noise.whiten_kept(&there.residual, &self.problem.mask);
                if e.len() != base.len() {
                    break;
                }
                let rise = self.noise.deviance(&there.residual, &self.problem.mask) - deviance;
                let column = e.iter().zip(&base).map(|(e, base)| (base - e) / step);
                secants.set_column(i, &DVector::from_iterator(base.len(), column));
                if rise.abs() > LEAST_RISE {
                    break;
                }
                step *= 10f64.sqrt();
            }
        }
        Some(secants)
    }

    fn covariances_from(&self, plant: &DMatrix<f64>, runs: &Runs) -> Covariances {
        let m = plant.ncols();
        let nothing_known = || DMatrix::from_diagonal_element(m, m, f64::INFINITY);
        let of_noise = self.noise_columns(&runs.residual);
        let all = DMatrix::from_fn(plant.nrows(), m + of_noise.len(), |i, j| {
            match j.checked_sub(m) {
                None => plant[(i, j)],
                Some(j) => of_noise[j][i],
            }
        });
        // Information of the location of Student's t: (v + 1)/(v + 3) of that of a Gaussian of its scale.
        let v = self.noise.degrees;
        let information = if v.is_finite() {
            (v + 1.0) / (v + 3.0)
        } else {
            1.0
        };
        let inverse = |of: &DMatrix<f64>| {
            let covariance = invert(&(information * of.tr_mul(of)));
            covariance.map_or_else(nothing_known, |c| c.view((0, 0), (m, m)).into_owned())
        };
        Covariances {
            joint: inverse(&all),
            given_noise: inverse(plant),
        }
    }

    /// Derivatives of the whitened residual by the coefficients of the colours, by differences.
    fn noise_columns(&self, residual: &Series) -> Vec<Vec<f64>> {
        const STEP: f64 = 1e-6;
        let base = self.noise.whiten_kept(residual, &self.problem.mask);
        let mut columns = Vec::new();
        for (o, colour) in self.noise.colours.iter().enumerate() {
            for i in 0..colour.len() {
                let moved = [STEP, -STEP].into_iter().find_map(|step| {
                    let (mut ar, mut ma) = (colour.ar.clone(), colour.ma.clone());
                    match i.checked_sub(ar.len()) {
                        None => ar[i] += step,
                        Some(j) => ma[j] += step,
                    }
                    Some((step, Colour::new(ar, ma)?))
                });
                let Some((step, moved)) = moved else { continue };
                let mut noise = self.noise.clone();
                noise.colours[o] = moved;
                let whitened = noise.whiten_kept(residual, &self.problem.mask);
                columns.push(
                    whitened
                        .iter()
                        .zip(&base)
                        .map(|(a, b)| (a - b) / step)
                        .collect(),
                );
            }
        }
        columns
    }
}

/// Covariances of the free numbers.
pub(super) struct Covariances {
    /// With the numbers of the noise model estimated beside them: under feedback these estimates are correlated.
    pub(super) joint: DMatrix<f64>,
    /// With the noise model given.
    pub(super) given_noise: DMatrix<f64>,
}

impl Objective for Deviance<'_, '_> {
    fn deviance(&mut self, point: &[f64]) -> Option<f64> {
        let runs = self.at(point)?;
        let deviance = self.noise.deviance(&runs.residual, &self.problem.mask);
        deviance.is_finite().then_some(deviance)
    }

    fn curvature(&mut self, point: &[f64]) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let runs = self.at(point)?;
        self.base = Some(Rc::clone(&runs));
        let (jacobian, frozen) = self.jacobian(&runs, self.slopes)?;
        if !frozen {
            // External simulators and plants that are linear in their states have exact slopes only.
            self.slopes = Slopes::Exact;
        }
        let e = self.noise.whiten_kept(&runs.residual, &self.problem.mask);
        let weights: Vec<f64> = e.iter().map(|&e| self.noise.weight(e)).collect();
        let mut weighted = jacobian.clone();
        for mut column in weighted.column_iter_mut() {
            column.iter_mut().zip(&weights).for_each(|(v, w)| *v *= w);
        }
        let descent = weighted.tr_mul(&DVector::from_vec(e));
        Some((weighted.tr_mul(&jacobian), descent))
    }

    fn approximate(&self) -> bool {
        self.slopes != Slopes::Exact
    }

    fn refine(&mut self) -> bool {
        let refined = self.slopes == Slopes::FrozenFirst;
        if refined {
            self.slopes = Slopes::Exact;
        }
        refined
    }
}

/// Inverse of an information matrix, on the scale of its own diagonal; what moves nothing has an infinite variance.
pub(super) fn invert(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let m = information.nrows();
    let used: Vec<usize> = (0..m).filter(|&i| information[(i, i)] > 0.0).collect();
    let scale: Vec<f64> = used.iter().map(|&i| information[(i, i)].sqrt()).collect();
    let k = used.len();
    let unit = DMatrix::from_fn(k, k, |a, b| {
        let r = information[(used[a], used[b])] / (scale[a] * scale[b]);
        r + if a == b { RIDGE } else { 0.0 }
    });
    let inverse = unit.cholesky()?.inverse();
    let mut covariance = DMatrix::zeros(m, m);
    (0..m).for_each(|i| covariance[(i, i)] = f64::INFINITY);
    for (a, &i) in used.iter().enumerate() {
        for (b, &j) in used.iter().enumerate() {
            covariance[(i, j)] = inverse[(a, b)] / (scale[a] * scale[b]);
        }
    }
    Some(covariance)
}
