//! Linear models from recordings, and from columns of simulated outputs.
//!
//! | file | what it holds |
//! |---|---|
//! | `autoregression` | ARX models of noise-free outputs, realised with minimal order; initial states |
//! | `simulator_offset` | the constant of a simulated output: its operating point |
//! | `steiglitz_mcbride` | an output-error model of one input and output |
//! | `minimal_order` | the model of least order that reproduces simulated outputs to their digits |
//! | `step_response_test` | Wald's test of equal step responses, for models with a covariance |

pub(crate) mod autoregression;
pub(crate) mod minimal_order;
pub(crate) mod simulator_offset;
pub(crate) mod steiglitz_mcbride;
pub(crate) mod step_response_test;
