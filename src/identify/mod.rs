//! From recordings to a model.

mod candidate;
mod data;
mod delay;
mod error;
mod finish;
mod fit;
mod horizon;
mod model;
mod options;
mod order;
mod pbsid_opt;
mod polish;
mod records;
mod scaling;
mod select;
mod stable;
mod summary;
mod truncation;
mod varx;
mod warnings;

pub use delay::Aligner;
pub use error::IdentifyError;
pub use fit::{Fit, fit};
pub use model::{IdentifiedChannel, Model, identify, identify_records};
pub use options::{CovarianceKind, Options, Order, Polish};
pub use order::OrderEvidence;
pub use pbsid_opt::{Decomposition, Estimate, Weight, decompose, system_matrices};
pub use polish::{Polished, coefficient_cost, polish, predictor_coefficients};
pub use records::{FileRecords, MemoryRecords, ReadProgress, Recording, Records};
pub use summary::{Asked, Diagnostics, Horizons, OrderTest, PastEvidence, StabilityCost, Summary};
pub use varx::{Varx, varx};
