//! Score tests: what each term would take off the residual at each place.

pub(crate) mod along;
pub(crate) mod curve;
pub(crate) mod map;
pub(crate) mod path;
pub(crate) mod projection;
pub(crate) mod screen;
