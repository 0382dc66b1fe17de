//! What an identification takes of memory, before anything of that size is allocated.
//!
//! With `q = r + l` channels, `T` lags, `m = (T + 1) q` and a model of order `n` with `P = n^2 + n r + 2 n l (+ l r)`
//! parameters:
//!
//! - the lag moments hold `q^2` spectra of one FFT segment, twice while they are finished, and `(T + 1) q^2`
//!   correlations a block of the jackknife;
//! - the Gram matrix and its factors are `m x m` ([`FACTORS`] of them at the peak);
//! - the derivative of the predictor with respect to the parameters is `l p q x P`, and the regression on it holds
//!   [`DERIVATIVES`] of that size, with one `l p q x n^2` beside them;
//! - the residual tests, which come after the fit, average the sensitivity of the residuals to the parameters
//!   (`validate::parameter_errors`, within `covariance::residual_budget`).
//!
//! The counts are measured ones; `tests/limits.rs` holds the sum against peaks.

use crate::covariance::numbers_of_tests;
use crate::identify::IdentifyError;
use crate::identify::options::{JACKKNIFE_BLOCKS, Options};
use crate::limits::{self, of_numbers};
use crate::log::BLOCK_ROWS;
use crate::moments::LagAccumulator;

/// What the program takes for nothing: code, buffers, what is kept of small recordings.
const BASE: u64 = 12 << 20;
/// Matrices of the size of the Gram matrix at the peak: it, what was added to it, its factor, the vector ARX copy of
/// that, and work.
const FACTORS: usize = 5;
/// Matrices of the size of the derivative of the predictor at the peak.
const DERIVATIVES: usize = 4;

/// Sizes of a request, as far as they are known.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sizes {
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    /// Past window, where it is known; nothing of the size of a window is counted before.
    pub(crate) past: Option<usize>,
    /// Lags of the moments.
    pub(crate) lags: usize,
    /// Order, where it is known.
    pub(crate) order: Option<usize>,
}

impl Sizes {
    /// Bytes that an identification takes at its peak.
    fn bytes(&self, options: &Options) -> u64 {
        let (r, l) = (self.inputs, self.outputs);
        let q = r.saturating_add(l);
        let moments = of_numbers(&[4, q, q, LagAccumulator::segment_of(self.lags)]);
        let blocks = if options.may_need_blocks() {
            // As many before neighbours are merged.
            2 * JACKKNIFE_BLOCKS
        } else {
            2
        };
        let correlations = of_numbers(&[blocks, q, q, self.lags.saturating_add(1)]);
        let reading = of_numbers(&[2, q, BLOCK_ROWS]);
        // What waits for the inputs of the longest delay.
        let longest = options.input_delay.iter().copied().max().unwrap_or(0);
        let waiting = of_numbers(&[r, longest]);
        let mut bytes = [BASE, moments, correlations, reading, waiting]
            .into_iter()
            .fold(0_u64, u64::saturating_add);
        if let Some(past) = self.past {
            let window = if options.method.lags(past, options.future) > past {
                self.lags
            } else {
                past
            };
            let m = window.saturating_add(1).saturating_mul(q);
            bytes = bytes.saturating_add(of_numbers(&[FACTORS, m, m]));
            if let Some(n) = self.order {
                let coefficients = past.saturating_mul(q).saturating_mul(l);
                let squares = n.saturating_mul(n);
                let parameters = squares
                    .saturating_add(n.saturating_mul(r))
                    .saturating_add(n.saturating_mul(l).saturating_mul(2));
                let fit = of_numbers(&[DERIVATIVES, coefficients, parameters])
                    .saturating_add(of_numbers(&[coefficients, squares]))
                    .saturating_add(of_numbers(&[DERIVATIVES, parameters, parameters]));
                // The residual tests come when the fit is done.
                let directions = if options.may_polish() {
                    parameters - squares
                } else {
                    parameters
                };
                let tests = of_numbers(&[numbers_of_tests(r, l, directions)]);
                bytes = bytes.saturating_add(fit.max(tests));
            }
        }
        bytes
    }

    /// Refuses what is beyond the limit.
    ///
    /// # Errors
    /// [`IdentifyError::Limit`].
    pub(crate) fn check(&self, options: &Options) -> Result<(), IdentifyError> {
        limits::check(
            self.bytes(options),
            options.memory_limit,
            || self.to_string(),
            || self.advice(options),
        )?;
        Ok(())
    }

    fn advice(&self, options: &Options) -> String {
        let mut smaller = Vec::new();
        if self.past.is_some() {
            smaller.push("a smaller --past");
        }
        if options.method.lags(1, Some(1)) > 1 {
            smaller.push("a smaller --future");
        }
        if self.order.is_some_and(|n| n > 1) {
            smaller.push("a smaller --order");
        }
        if options.input_delay.iter().any(|delay| *delay > 0) {
            smaller.push("a smaller --delay");
        }
        smaller.push("fewer channels (--inputs, --outputs)");
        format!("give {}", smaller.join(" or "))
    }
}

impl std::fmt::Display for Sizes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let count = |n: usize, what: &str| {
            let plural = if n == 1 { "" } else { "s" };
            format!("{n} {what}{plural}")
        };
        match self.order {
            Some(order) => write!(f, "a model of order {order}")?,
            None => f.write_str("a model")?,
        }
        write!(
            f,
            " of {} from {}",
            count(self.outputs, "output"),
            count(self.inputs, "input")
        )?;
        match self.past {
            Some(past) => write!(f, " with a past window of {}", count(past, "sample")),
            None => Ok(()),
        }
    }
}
