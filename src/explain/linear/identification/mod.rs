//! Ident.

pub(crate) mod autoregression;
pub(crate) mod minimal_order;
pub(crate) mod simulator_offset;
pub(crate) mod steiglitz_mcbride;
pub(crate) mod step_response_test;
