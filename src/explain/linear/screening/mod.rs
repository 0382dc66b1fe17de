//! Which effects deserve a fit, and whether a residual is noise.
//!
//! | file | what it holds |
//! |---|---|
//! | `score_tests` | one Gauss-Newton step for every effect at every place |
//! | `templates` | the response of the plant to each law: columns for the score tests |
//! | `features` | flexible features, and laws without a form |
//! | `output_adequacy` | the test of the residual |
//! | `rectified_signs` | the derivative of a sensor that loses the sign |

pub(crate) mod features;
pub(crate) mod output_adequacy;
pub(crate) mod rectified_signs;
pub(crate) mod score_tests;
pub(crate) mod templates;
