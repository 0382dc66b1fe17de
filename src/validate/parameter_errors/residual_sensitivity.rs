//! Averages over a record of how its residuals move with the parameters of the model.

use nalgebra::DMatrix;

use super::averages::{Averages, Regressor};
use super::curvature::Curvature;
use super::filters::{Filters, Segment};
use crate::covariance::{ParameterCovariance, samples_followed};
use crate::linalg::{multiply, multiply_nt, symmetric_eigen};
use crate::model::StateSpace;
use crate::validate::residuals::{Partial, Start};
use crate::validate::{RecordView, Relation, ValidateError};

/// Samples handled at a time.
const BLOCK: usize = 512;
/// Batches that tell how accurate the averages are, at most and at least so long.
const BATCHES: usize = 16;
const SHORTEST_BATCH: usize = 64;
/// Parameter directions below this share of the largest variance, parameters scaled to unit variance, are
/// directions of the state basis.
const GAUGE: f64 = 1e-9;

/// Sensitivities along directions of the parameter space, with the samples they belong to.
#[derive(Debug)]
pub(crate) struct Sensitivity {
    segments: Vec<Segment>,
    /// Number of directions `m`.
    directions: usize,
    inputs: usize,
    outputs: usize,
    past: usize,
    /// Covariance of the coordinates along the directions.
    covariance: DMatrix<f64>,
    /// Whether that is the identity.
    uncorrelated: bool,
    /// Number of parameters that the data determine.
    rank: usize,
    /// Models drawn from the covariance; only along its range.
    curvature: Option<Curvature>,
    /// Mean of `psi Cov(theta) psi'` for each output: residual variance that parameter errors add.
    pub(crate) excess: Vec<f64>,
}

impl Sensitivity {
    /// Runs the sensitivity filters over the beginning of the records.
    ///
    /// On the estimation record a jackknife covariance may have a smaller rank than the model has parameters:
    /// then along all parameters instead of only those in the range of the covariance.
    pub(crate) fn new(
        system: &StateSpace,
        covariance: &ParameterCovariance,
        records: &[RecordView<'_>],
        starts: &[Start],
        past: usize,
        relation: Relation,
    ) -> Result<Option<Self>, ValidateError> {
        let fresh = relation == Relation::Fresh;
        let whole_space = !fresh && covariance.degrees_of_freedom.is_some();
        let (basis, inner, rank) = directions(covariance, whole_space)?;
        let m = basis.ncols();
        if m == 0 {
            return Ok(None);
        }
        let (r, l) = (system.inputs(), system.outputs());
        let width = (past + 1) * (r + l);
        let limit = samples_followed(m * l, width);
        let total: usize = records.iter().map(RecordView::samples).sum();
        let filters = Filters::new(system, covariance, &basis);
        let mut segments = Vec::new();
        let mut excess = vec![0.0; l];
        let mut used = 0.0;
        let mut followed = Vec::with_capacity(records.len());
        for (record, start) in records.iter().zip(starts) {
            let kept = record.samples() - start.dropped;
            let share = if total > limit {
                kept.min((limit * kept / total).max(2 * past))
            } else {
                kept
            };
            followed.push(if share > past { share } else { 0 });
            if share <= past {
                continue;
            }
            let segment = filters.run(system, record, start, share);
            for sample in segment.psi[past * l * m..].chunks_exact(l * m) {
                for (o, row) in sample.chunks_exact(m).enumerate() {
                    excess[o] += if whole_space {
                        quadratic(&inner, row)
                    } else {
                        row.iter().map(|v| v * v).sum()
                    };
                }
            }
            used += (share - past) as f64;
            segments.push(segment);
        }
        if segments.is_empty() {
            return Ok(None);
        }
        let finite = segments
            .iter()
            .all(|segment| segment.psi.iter().all(|v| v.is_finite()));
        if !finite {
            return Err(crate::linalg::LinalgError::NotFinite {
                what: "sensitivities of the predictor",
            }
            .into());
        }
        let curvature = if fresh {
            let layout = covariance.layout;
            Some(Curvature::new(
                system, layout, &basis, records, starts, &followed, past,
            )?)
        } else {
            None
        };
        Ok(Some(Self {
            curvature,
            segments,
            directions: m,
            inputs: r,
            outputs: l,
            past,
            covariance: inner,
            uncorrelated: !whole_space,
            rank,
            excess: excess.into_iter().map(|v| v / used).collect(),
        }))
    }

    /// Number of parameters that the data determine.
    pub(crate) fn rank(&self) -> usize {
        self.rank
    }

    /// Covariance of the coordinates along the directions.
    pub(crate) fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// `tr(a Cov b')`, `Cov` being the covariance of the coordinates.
    fn inner(&self, a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
        if self.uncorrelated {
            a.dot(b)
        } else {
            multiply(a, &self.covariance).dot(b)
        }
    }

    /// Averages for a test: `tested` given `conditions`, which are lags of the residuals.
    pub(crate) fn averages(
        &self,
        partial: &Partial,
        conditions: &[Regressor],
        tested: &[Regressor],
        target: &[Regressor],
    ) -> Averages {
        let (m, l) = (self.directions, self.outputs);
        let q = self.inputs + l;
        let regressors: Vec<Regressor> = conditions.iter().chain(tested).copied().collect();
        let n = partial.samples as f64;
        let rank_w = partial.theta.nrows();
        let rank_t = partial.target.nrows();
        let used: usize = self.segments.iter().map(|s| s.samples - self.past).sum();
        let batch = (used / BATCHES).max(SHORTEST_BATCH);

        let whiten = |sum: &DMatrix<f64>, samples: f64| {
            let half = multiply(&partial.theta, sum); // rank_w x (l m)
            let mut cross = DMatrix::zeros(rank_w * rank_t, m);
            for direction in 0..m {
                for t in 0..rank_t {
                    for o in 0..l {
                        let factor = partial.target[(t, o)] * n / samples;
                        for w in 0..rank_w {
                            cross[(w + rank_w * t, direction)] +=
                                factor * half[(w, o * m + direction)];
                        }
                    }
                }
            }
            cross
        };

        let mut sum = DMatrix::zeros(regressors.len(), l * m);
        let mut information = DMatrix::zeros(m, m);
        // Of the batches only sums are kept: each is as large as the averages themselves.
        let (mut batches, mut squares) = (0.0, 0.0);
        let mut of_batches = DMatrix::zeros(rank_w * rank_t, m);
        for segment in &self.segments {
            let mut from = self.past;
            while from < segment.samples {
                // The last batch takes what is left over.
                let to = if segment.samples - from < 2 * batch {
                    segment.samples
                } else {
                    from + batch
                };
                let mut part = DMatrix::zeros(regressors.len(), l * m);
                let mut begin = from;
                while begin < to {
                    let end = (begin + BLOCK).min(to);
                    let psi = segment.filtered(begin, end, conditions, partial, self);
                    let w = DMatrix::from_fn(regressors.len(), end - begin, |i, k| {
                        let (channel, lag) = regressors[i];
                        segment.z[(begin + k - lag) * q + channel]
                    });
                    part += multiply_nt(&w, &psi);
                    // Whitened target rows, one block of `m` a target direction.
                    for t in 0..rank_t {
                        let mut rows = DMatrix::zeros(m, end - begin);
                        for o in 0..l {
                            rows += psi.rows(o * m, m) * partial.target[(t, o)];
                        }
                        information += multiply_nt(&rows, &rows);
                    }
                    begin = end;
                }
                let whitened = whiten(&part, (to - from) as f64);
                batches += 1.0;
                squares += self.inner(&whitened, &whitened);
                of_batches += whitened;
                sum += part;
                from = to;
            }
        }
        let cross = whiten(&sum, used as f64);
        // Sum over the batches of the squared distance to `cross`.
        let scatter =
            squares - 2.0 * self.inner(&of_batches, &cross) + batches * self.inner(&cross, &cross);
        let error = if batches > 1.0 {
            scatter.max(0.0) / (batches * (batches - 1.0) * (cross.nrows().max(1)) as f64)
        } else {
            0.0
        };
        let mut averages = Averages {
            cross,
            error,
            information: information * (n / used as f64),
            remainder: 0.0,
            samples: used,
        };
        if let Some(curvature) = &self.curvature {
            averages.remainder =
                curvature.remainder(partial, &averages, conditions, tested, target);
        }
        averages
    }
}

impl Segment {
    /// Sensitivities of samples `from..to`, filtered like the target: `psi[k] - sum Phi_c psi[k - lag]` with the
    /// autoregression of the residuals that the conditions are. One column a sample.
    fn filtered(
        &self,
        from: usize,
        to: usize,
        conditions: &[Regressor],
        partial: &Partial,
        of: &Sensitivity,
    ) -> DMatrix<f64> {
        let (m, l) = (of.directions, of.outputs);
        let width = l * m;
        let mut out =
            DMatrix::from_column_slice(width, to - from, &self.psi[from * width..to * width]);
        for (c, &(channel, lag)) in conditions.iter().enumerate() {
            let other = channel - of.inputs;
            for o in 0..l {
                let factor = partial.coefficients[(o, c)];
                for k in from..to {
                    let at = (k - lag) * width + other * m;
                    let past = &self.psi[at..at + m];
                    let column = (k - from) * width + o * m;
                    let now = &mut out.as_mut_slice()[column..column + m];
                    for (n, p) in now.iter_mut().zip(past) {
                        *n -= factor * p;
                    }
                }
            }
        }
        out
    }
}

/// Basis of the parameter space (columns), covariance of the coordinates, and rank.
pub(crate) fn directions(
    covariance: &ParameterCovariance,
    whole_space: bool,
) -> Result<(DMatrix<f64>, DMatrix<f64>, usize), ValidateError> {
    let matrix = &covariance.matrix;
    let deviation: Vec<f64> = matrix
        .diagonal()
        .iter()
        .map(|v| v.max(0.0).sqrt())
        .collect();
    let inverse = |i: usize| {
        if deviation[i] > 0.0 {
            1.0 / deviation[i]
        } else {
            0.0
        }
    };
    let order = matrix.nrows();
    let correlation = DMatrix::from_fn(order, order, |i, j| {
        0.5 * (matrix[(i, j)] + matrix[(j, i)]) * inverse(i) * inverse(j)
    });
    if order == 0 || correlation.amax() == 0.0 {
        return Ok((DMatrix::zeros(order, 0), DMatrix::zeros(0, 0), 0));
    }
    if whole_space {
        let scale = DMatrix::from_fn(order, order, |i, j| if i == j { deviation[i] } else { 0.0 });
        return Ok((scale, correlation, covariance.layout.identifiable()));
    }
    let eigen = symmetric_eigen(&correlation)?;
    let largest = eigen.values.amax();
    let kept: Vec<usize> = (0..order)
        .filter(|&i| eigen.values[i] > GAUGE * largest)
        .collect();
    let basis = DMatrix::from_fn(order, kept.len(), |i, j| {
        deviation[i] * eigen.vectors[(i, kept[j])] * eigen.values[kept[j]].sqrt()
    });
    let m = kept.len();
    Ok((basis, DMatrix::identity(m, m), m))
}

fn quadratic(matrix: &DMatrix<f64>, v: &[f64]) -> f64 {
    (0..v.len())
        .map(|i| v[i] * (0..v.len()).map(|j| matrix[(i, j)] * v[j]).sum::<f64>())
        .sum()
}
