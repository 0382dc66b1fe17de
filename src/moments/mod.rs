//! One pass over the data: lag moments, and from them the triangular factor `R` that everything else
//! is computed from.
//!
//! With `z[k] = [u[k]; y[k]]` in `R^q` and `zeta[k] = [z[k]; ...; z[k+p]]`, every estimate of this crate
//! is a function of `R' R = sum_k zeta[k] zeta[k]'`, a matrix of order `(p + 1) q` whatever the number
//! of samples. That sum is almost block-Toeplitz: going one block down the diagonal removes one sample
//! at the beginning and adds one at the end, so only its first block row needs the data, and that row
//! is a set of lag correlations, which the FFT delivers for all lags at once.
//!
//! ```text
//! samples ── LagAccumulator ──> LagMoments ── gram ──> Gram ── factor ──> RFactor
//!            (FFT, streaming)   (append: chunks        (add: experiments)   (Cholesky)
//!                                of one log)
//!                          PanelQr: the same R by orthogonal factorisation, when the Gram matrix
//!                          is too ill-conditioned for Cholesky
//! ```
//!
//! Memory grows with `p` and `q`, never with the number of samples. Source of the displacement
//! structure: van Wingerden's regression data (7)-(10); the derivation is in the documentation of
//! [`LagMoments::gram`].

mod accumulator;
mod blocks;
mod factor;
mod gram;
mod lag_moments;
mod panel_qr;
mod spectrum;
mod trend;

pub use accumulator::LagAccumulator;
pub(crate) use blocks::{BlockAccumulator, block_grams};
pub use factor::{RFactor, Route};
pub(crate) use gram::Gram;
pub(crate) use lag_moments::LagMoments;
pub use panel_qr::PanelQr;
pub use spectrum::Excitation;
pub(crate) use spectrum::Welch;
pub use trend::{Detrend, Trend};
