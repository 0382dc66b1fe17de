//! The polish of a model that must be stable.

use super::{Effort, Polished, polish};
use crate::identify::stable::{largest_stable_radius, with_poles_inside};
use crate::identify::subspace::Varx;
use crate::linalg::LinalgError;
use crate::model::StateSpace;

/// The best model found whose poles are inside the stability radius: the poles are moved in, then all
/// parameters are polished again under the constraint.
///
/// # Errors
/// [`LinalgError`] from the polish, or for a defective `A`.
pub(crate) fn stabilised(start: &StateSpace, varx: &Varx) -> Result<Polished, LinalgError> {
    let radius = largest_stable_radius(varx.columns);
    let inside = with_poles_inside(start, radius)?;
    polish(&inside, varx, Some(radius), Effort::Full)
}
