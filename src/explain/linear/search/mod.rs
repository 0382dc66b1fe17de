//! Fits of effects, and what is kept of them.
//!
//! | file | what it holds |
//! |---|---|
//! | `null_models` | the simulation as given, with other initial states, with other parameters |
//! | `single_effects` | one effect beside a null model: fits and ranking |
//! | `richer_laws` | other forms of the laws that fit; finer steps |
//! | `rectified_sensor` | plants behind a sensor that loses the sign, which no effect added to the linear one becomes |
//! | `penalties` | the evidence that an effect needs, and penalties beyond BIC |
//! | `plausibility` | fits that contradict physics, and effects that imitate other parameters |
//! | `cross_validation` | held-out blocks, halves, and the figures of fit on them |
//! | `forward_selection` | validation of the best effect, a second effect, a feedthrough |

pub(crate) mod cross_validation;
pub(crate) mod forward_selection;
pub(crate) mod null_models;
pub(crate) mod penalties;
pub(crate) mod plausibility;
pub(crate) mod rectified_sensor;
pub(crate) mod richer_laws;
pub(crate) mod single_effects;
