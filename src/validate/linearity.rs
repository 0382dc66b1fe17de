//! Is what is left linear in the past?
//!
//! White residuals that past inputs do not predict are what a linear model can leave at best: a plant that is not
//! linear may pass both tests, because correlations only see what is linear. Here the residual of each output is
//! tested against squares and products of past inputs and outputs: the Lagrange multiplier test of neglected
//! nonlinearity (Lee, White & Granger 1993, Journal of Econometrics 56:269) in the form that is robust to the law of
//! the residuals (Wooldridge 1991, Journal of Econometrics 47:5).
//!
//! - *Terms.* `v^2` sees what is even (a valve, a tank), `v |v|` what is odd (friction, stiffening, limits), `v w` what
//!   depends on two signals. Channels are taken in standard deviations and cut at [`CUT_CHANNEL`] of them.
//! - *Given.* Past inputs, past outputs, past residuals, and the sensitivities of the residual to the parameters are
//!   projected out of the terms and of the residual. What is linear in the past is the business of the other tests, and
//!   to first order the errors of the parameters have no part in the statistic, on the record estimated from or on
//!   a fresh one.
//! - *Robust.* With `w~` the terms as that leaves them and `e~` the residual, cut at [`CUT_RESIDUAL`] of its own
//!   deviations, `s = sum w~ e~`, `V = sum w~ w~' e~^2` and `s' V^-1 s` is chi-square, whatever the size of the
//!   residual depends on. No value has more weight than the cuts allow.
//! - *Long records.* The sensitivities cost much, and a nonlinearity that matters shows in thousands of samples:
//!   longer records are tested on pieces of equal length, evenly spaced, and the result says so.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::parameter_errors::{Filters, directions};
use super::residuals::{Partial, Residuals, Start, cut, start_up};
use super::result::{LinearityScope, ResidualTest, Strongest};
use super::validate_error::ValidateError;
use super::validation_options::{RecordView, ValidationOptions};
use crate::covariance::ParameterCovariance;
use crate::linalg::{multiply, multiply_tn, symmetric_eigen};
use crate::model::{Predictor, StateSpace, estimate_initial_state};

/// Standard deviations at which channels are cut: a Gaussian signal hardly gets there, and the square of what does
/// weighs as much as sixteen ordinary samples at most.
const CUT_CHANNEL: f64 = 4.0;
/// Deviations (by the median) at which residuals are cut.
const CUT_RESIDUAL: f64 = 3.0;
/// From the median of the absolute values of a normal law to its standard deviation.
const MEDIAN_TO_DEVIATION: f64 = 1.482_602_218_505_602;
/// Terms at most: what more lags would show, these show as well.
const MOST_TERMS: usize = 36;
/// Samples for each term: below, the robust covariance, of their fourth moments, is not to be relied on.
const SAMPLES_PER_TERM: usize = 25;
/// Samples for each condition, of which only the projection is needed.
const SAMPLES_PER_CONDITION: usize = 5;
/// Lags of squares and products; then those that only inputs are squared at, so that a dead time is reached.
const LAGS: [usize; 4] = [1, 2, 4, 8];
const MORE_INPUT_LAGS: [usize; 6] = [3, 5, 6, 7, 9, 10];
/// Most samples that are tested, and the length of a piece of a longer record.
const MOST_SAMPLES: usize = 20_000;
const FEWEST_SAMPLES: usize = 4_000;
const PIECE: usize = 500;
/// Multiplications that the products of terms and conditions may take.
const EFFORT: usize = 25_000_000;
/// Directions of the robust covariance below this share of the largest say nothing.
const NO_VARIANCE: f64 = 1e-9;
const NORMAL_99: f64 = 2.575_829_303_548_901;

/// The model, the records and what the other tests found out about them.
pub(super) struct Linearity<'a> {
    pub(super) system: &'a StateSpace,
    pub(super) covariance: Option<&'a ParameterCovariance>,
    pub(super) innovation_covariance: Option<&'a DMatrix<f64>>,
    pub(super) records: &'a [RecordView<'a>],
    pub(super) residuals: &'a Residuals,
    /// Lags of past inputs that are given.
    pub(super) lags: usize,
    /// Lags of past residuals that are given.
    pub(super) own_past: usize,
    pub(super) feedthrough: bool,
    pub(super) options: &'a ValidationOptions,
}

/// A function of the past: `v^2`, `v |v|`, or `v w`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Term {
    Square(usize, usize),
    Signed(usize, usize),
    Product(usize, usize, usize),
}

impl Term {
    fn lag(self) -> usize {
        match self {
            Self::Square(_, lag) | Self::Signed(_, lag) | Self::Product(_, _, lag) => lag,
        }
    }

    /// Its value at sample `k` of channels in standard deviations.
    fn value(self, channels: &[Vec<f64>], k: usize) -> f64 {
        match self {
            Self::Square(c, lag) => channels[c][k - lag].powi(2),
            Self::Signed(c, lag) => channels[c][k - lag] * channels[c][k - lag].abs(),
            Self::Product(a, b, lag) => channels[a][k - lag] * channels[b][k - lag],
        }
    }

    fn name(self, of: impl Fn(usize) -> String) -> String {
        match self {
            Self::Square(c, _) => format!("{}^2", of(c)),
            Self::Signed(c, _) => format!("{0} |{0}|", of(c)),
            Self::Product(a, b, _) => format!("{} {}", of(a), of(b)),
        }
    }
}

/// Terms of `inputs` and `outputs` channels, most telling first, as many as may be.
fn terms(inputs: usize, outputs: usize, first: usize, most: usize) -> Vec<Term> {
    let channels = inputs + outputs;
    let mut out = Vec::new();
    for lag in LAGS {
        let lag_of = |c: usize| if c < inputs { lag - 1 + first } else { lag };
        out.extend((0..channels).map(|c| Term::Square(c, lag_of(c))));
        out.extend((0..channels).map(|c| Term::Signed(c, lag_of(c))));
        let pairs = (0..channels).flat_map(|a| (a + 1..channels).map(move |b| (a, b)));
        out.extend(pairs.map(|(a, b)| Term::Product(a, b, lag)));
    }
    for lag in MORE_INPUT_LAGS {
        out.extend((0..inputs).map(|c| Term::Square(c, lag)));
        out.extend((0..inputs).map(|c| Term::Signed(c, lag)));
    }
    out.truncate(most);
    out
}

/// A stretch of a record with the state that the predictor starts from.
struct Piece<'a> {
    inputs: Vec<&'a [f64]>,
    outputs: Vec<&'a [f64]>,
    start: Start,
}

/// A piece as columns: inputs and outputs in standard deviations, cut; residuals; sensitivities.
struct Columns<'a> {
    piece: &'a Piece<'a>,
    channels: Vec<Vec<f64>>,
    residuals: Vec<Vec<f64>>,
    psi: Vec<f64>,
}

impl Linearity<'_> {
    /// The test with what was tested; `None` when the record is too short for it or the residuals vanish.
    ///
    /// # Errors
    /// [`ValidateError`] from the predictor or the linear algebra.
    pub(super) fn test(&self) -> Result<Option<(ResidualTest, LinearityScope)>, ValidateError> {
        let (r, l) = (self.system.inputs(), self.system.outputs());
        let basis = match self.covariance {
            Some(covariance) => Some((covariance, directions(covariance, false)?.0)),
            None => None,
        };
        let m = basis.as_ref().map_or(0, |(_, basis)| basis.ncols());
        let given = (self.lags + 1) * r + LAGS.len() * l + self.own_past * l + m;
        let width = given + MOST_TERMS;
        let limit = (EFFORT / (l * width * width)).clamp(FEWEST_SAMPLES, MOST_SAMPLES);
        let pieces = self.pieces(limit)?;
        let skip = self.lags.max(self.own_past).max(10);
        let tested: usize = pieces
            .iter()
            .map(|p| p.outputs[0].len().saturating_sub(p.start.dropped + skip))
            .sum();
        let most = (tested.saturating_sub(SAMPLES_PER_CONDITION * given) / SAMPLES_PER_TERM)
            .min(MOST_TERMS);
        // Squares of every channel at least.
        if most < 2 * (r + l) {
            return Ok(None);
        }
        let terms = terms(r, l, usize::from(!self.feedthrough), most);
        let columns = self.columns(&pieces, basis.as_ref())?;
        let mut found: Vec<(f64, ResidualTest)> = Vec::new();
        let deviations = self.residuals.one_step.deviations();
        for (output, deviation) in deviations.iter().enumerate() {
            let variance = self.residuals.variance(output);
            if variance.sqrt() <= super::residuals::ROUNDING * deviation {
                continue;
            }
            let (x, conditions) = self.matrix(&columns, &terms, output, skip, tested, m);
            found.extend(
                self.of_output(x, conditions, &terms, output)?
                    .map(|test| (test.p_value, test)),
            );
        }
        let count = found.len() as f64;
        let shares: Vec<f64> = found.iter().map(|f| f.1.explained_share).collect();
        let Some((_, mut test)) = found.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return Ok(None);
        };
        // Of several outputs the one that speaks most, by Bonferroni's bound.
        test.p_value = (test.p_value * count).min(1.0);
        test.explained_share = shares.iter().sum::<f64>() / count;
        test.explained_share_by_channel = shares;
        let longest = terms.iter().map(|t| t.lag()).max().unwrap_or(0);
        let all = self.residuals.samples;
        let place = if pieces.len() > self.records.len() {
            format!(
                "{tested} of {all} samples, in {} evenly spaced pieces",
                pieces.len()
            )
        } else {
            format!("{tested} samples")
        };
        let scope = LinearityScope {
            samples: tested,
            pieces: pieces.len(),
            terms: terms.len(),
            longest_lag: longest,
            sentence: format!(
                "linearity was tested against {} squares (v^2 and v |v|) and products of past inputs and outputs, up to \
                 {longest} samples back, on {place}",
                terms.len()
            ),
        };
        Ok(Some((test, scope)))
    }

    /// The records, or evenly spaced pieces of those that are longer than `limit` together.
    fn pieces(&self, limit: usize) -> Result<Vec<Piece<'_>>, ValidateError> {
        let total: usize = self.records.iter().map(RecordView::samples).sum();
        let mut out = Vec::new();
        for (index, (record, start)) in self.records.iter().zip(&self.residuals.starts).enumerate()
        {
            let samples = record.samples();
            if total <= limit {
                out.push(Piece {
                    inputs: record.inputs.to_vec(),
                    outputs: record.outputs.to_vec(),
                    start: start.clone(),
                });
                continue;
            }
            let lead = start_up(self.system, samples)?.min(PIECE);
            let share = (limit as f64 * samples as f64 / total as f64) as usize;
            let count = (share / PIECE).max(1);
            let length = (PIECE + lead).min(samples);
            for piece in 0..count {
                let from = match count {
                    1 => 0,
                    _ => piece * (samples - length) / (count - 1),
                };
                let inputs = cut(record.inputs, from, from + length);
                let outputs = cut(record.outputs, from, from + length);
                let state = estimate_initial_state(
                    self.system,
                    &inputs,
                    &outputs,
                    self.innovation_covariance,
                )
                .map_err(|source| ValidateError::Data {
                    record: index + 1,
                    source,
                })?;
                let start = Start {
                    state,
                    dropped: lead.min(length),
                    means: Vec::new(),
                };
                out.push(Piece {
                    inputs,
                    outputs,
                    start,
                });
            }
        }
        Ok(out)
    }

    fn columns<'a>(
        &self,
        pieces: &'a [Piece<'a>],
        basis: Option<&(&ParameterCovariance, DMatrix<f64>)>,
    ) -> Result<Vec<Columns<'a>>, ValidateError> {
        let q = self.system.inputs() + self.system.outputs();
        let filters = basis.map(|(covariance, basis)| Filters::new(self.system, covariance, basis));
        let signal = |piece: &Piece<'a>, c: usize| match c.checked_sub(piece.inputs.len()) {
            None => piece.inputs[c],
            Some(output) => piece.outputs[output],
        };
        // Mean and deviation of each channel over all pieces.
        let moments: Vec<(f64, f64)> = (0..q)
            .map(|c| {
                let all = || pieces.iter().flat_map(|p| signal(p, c));
                let n = all().count().max(1) as f64;
                let mean = all().sum::<f64>() / n;
                let variance = all().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
                (mean, variance.sqrt())
            })
            .collect();
        let mut out = Vec::with_capacity(pieces.len());
        for piece in pieces {
            let channels = (0..q)
                .map(|c| {
                    let (mean, deviation) = moments[c];
                    let scaled = |v: &f64| match deviation > 0.0 {
                        true => ((v - mean) / deviation).clamp(-CUT_CHANNEL, CUT_CHANNEL),
                        false => 0.0,
                    };
                    signal(piece, c).iter().map(scaled).collect()
                })
                .collect();
            let residuals = Predictor::new(self.system, Some(&piece.start.state))
                .and_then(|mut predictor| predictor.step(&piece.inputs, &piece.outputs))
                .map_err(|source| ValidateError::Data { record: 1, source })?
                .innovations;
            let psi = filters.as_ref().map_or_else(Vec::new, |filters| {
                let record = RecordView {
                    inputs: &piece.inputs,
                    outputs: &piece.outputs,
                };
                let start = Start {
                    means: vec![0.0; q],
                    ..piece.start.clone()
                };
                let samples = record.samples() - start.dropped;
                filters.run(self.system, &record, &start, samples).psi
            });
            out.push(Columns {
                piece,
                channels,
                residuals,
                psi,
            });
        }
        Ok(out)
    }

    /// Conditions, terms and the residual of one output, one row a sample, about their means; and how many are
    /// conditions.
    fn matrix(
        &self,
        columns: &[Columns<'_>],
        terms: &[Term],
        output: usize,
        skip: usize,
        tested: usize,
        directions: usize,
    ) -> (DMatrix<f64>, usize) {
        let (r, l) = (self.system.inputs(), self.system.outputs());
        let first = usize::from(!self.feedthrough);
        let of_inputs = || (first..=self.lags).flat_map(|lag| (0..r).map(move |j| (j, lag)));
        let of_outputs = || LAGS.iter().flat_map(|lag| (0..l).map(move |o| (o, *lag)));
        let of_residuals = || (1..=self.own_past).flat_map(|lag| (0..l).map(move |o| (o, lag)));
        let conditions =
            of_inputs().count() + of_outputs().count() + of_residuals().count() + directions;
        let mut x = DMatrix::zeros(tested, conditions + terms.len() + 1);
        let mut row = 0;
        for part in columns {
            let (piece, length) = (part.piece, part.residuals[0].len());
            let begin = piece.start.dropped + skip;
            if begin >= length {
                continue;
            }
            let count = length - begin;
            let mut column = 0;
            let mut fill = |value: &mut dyn FnMut(usize) -> f64| {
                let target = &mut x.column_mut(column);
                for k in 0..count {
                    target[row + k] = value(begin + k);
                }
                column += 1;
            };
            for (j, lag) in of_inputs() {
                fill(&mut |k| piece.inputs[j][k - lag]);
            }
            for (o, lag) in of_outputs() {
                fill(&mut |k| piece.outputs[o][k - lag]);
            }
            for (o, lag) in of_residuals() {
                fill(&mut |k| part.residuals[o][k - lag]);
            }
            for direction in 0..directions {
                let at =
                    |k: usize| ((k - piece.start.dropped) * l + output) * directions + direction;
                fill(&mut |k| part.psi[at(k)]);
            }
            for term in terms {
                fill(&mut |k| term.value(&part.channels, k));
            }
            fill(&mut |k| part.residuals[output][k]);
            row += count;
        }
        for mut column in x.column_iter_mut() {
            let mean = column.sum() / tested.max(1) as f64;
            column.add_scalar_mut(-mean);
        }
        (x, conditions)
    }

    /// The test of one output.
    fn of_output(
        &self,
        x: DMatrix<f64>,
        conditions: usize,
        terms: &[Term],
        output: usize,
    ) -> Result<Option<ResidualTest>, ValidateError> {
        let (samples, last) = (x.nrows(), x.ncols() - 1);
        let n = samples as f64;
        let given: Vec<usize> = (0..conditions).collect();
        let tested: Vec<usize> = (conditions..last).collect();
        let partial = Partial::new(&multiply_tn(&x, &x), samples, &given, &tested, &[last])?;
        if partial.dimension() == 0 {
            return Ok(None);
        }
        let regressors = x.columns(0, last).into_owned();
        let mut whitened = multiply(&regressors, &partial.theta.transpose()) * n.sqrt();
        let explained = regressors.columns(0, conditions) * partial.coefficients.transpose();
        let mut residual: Vec<f64> = (x.column(last) - explained.column(0))
            .iter()
            .copied()
            .collect();
        cut_residual(&mut residual);
        for mut column in whitened.column_iter_mut() {
            for (value, e) in column.iter_mut().zip(&residual) {
                *value *= e;
            }
        }
        let score = DVector::from_iterator(
            whitened.ncols(),
            whitened.column_iter().map(|column| column.sum()),
        );
        let eigen = symmetric_eigen(&multiply_tn(&whitened, &whitened))?;
        let largest = eigen.values.amax();
        let along = eigen.vectors.tr_mul(&score);
        let (mut statistic, mut rank) = (0.0, 0);
        for (value, along) in eigen.values.iter().zip(along.iter()) {
            if *value > NO_VARIANCE * largest {
                statistic += along * along / value;
                rank += 1;
            }
        }
        // What the conditions have taken out of the residual is missing in its size.
        statistic *= ((n - 1.0 - conditions as f64) / n).max(0.0);
        let Ok(law) = ChiSquared::new(f64::from(rank)) else {
            return Ok(None);
        };
        if !statistic.is_finite() {
            return Ok(None);
        }
        let name = |c: usize| match c.checked_sub(self.system.inputs()) {
            None => self.options.input(c),
            Some(output) => self.options.output(output),
        };
        let covariances = partial.covariances();
        let size =
            |i: usize| partial.regressor_root.row(i).norm() * partial.target_root.row(0).norm();
        let strongest = terms
            .iter()
            .enumerate()
            .filter(|(i, _)| size(*i) > 0.0)
            .map(|(i, term)| (covariances[(i, 0)] / size(i), term))
            .max_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
            .map(|(correlation, term)| Strongest {
                from: term.name(name),
                to: self.options.output(output),
                lag: term.lag(),
                correlation: correlation.clamp(-1.0, 1.0),
                bound_99: (NORMAL_99 / n.sqrt()).min(1.0),
            });
        Ok(Some(ResidualTest {
            statistic,
            degrees_of_freedom: rank as usize,
            fitted_directions: 0,
            variance_inflation: 1.0,
            p_value: law.sf(statistic).clamp(0.0, 1.0),
            explained_share: partial.explained()[0],
            explained_share_by_channel: Vec::new(),
            strongest,
        }))
    }
}

/// Cuts what is beyond [`CUT_RESIDUAL`] deviations.
fn cut_residual(residual: &mut [f64]) {
    let mut sizes: Vec<f64> = residual.iter().map(|v| v.abs()).collect();
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    let bound = CUT_RESIDUAL * MEDIAN_TO_DEVIATION * *median;
    // Most samples on one value: there is no middle to cut from.
    if bound > 0.0 {
        for value in residual {
            *value = value.clamp(-bound, bound);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_are_there_once_and_the_first_are_the_nearest() {
        let all = terms(1, 1, 1, 100);
        for (i, a) in all.iter().enumerate() {
            assert!(!all[..i].contains(a), "{a:?}");
        }
        assert_eq!(all.len(), 4 * 5 + 6 * 2);
        assert!(terms(2, 2, 1, 8).iter().all(|t| t.lag() == 1));
        // With feedthrough the input of the same sample is past enough.
        assert_eq!(terms(1, 1, 0, 1), [Term::Square(0, 0)]);
    }

    #[test]
    fn outliers_are_cut_and_the_rest_is_not() {
        let mut e: Vec<f64> = (0..101).map(|k| f64::from(k % 21) - 10.0).collect();
        let before = e.clone();
        e[7] = 1e9;
        cut_residual(&mut e);
        assert!(e[7] < 30.0);
        assert_eq!(e[8..], before[8..]);
    }
}
