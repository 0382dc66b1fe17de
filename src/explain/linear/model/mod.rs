//! The augmented model: a linear plant, effects, and their simulation.
//!
//! | file | what it holds |
//! |---|---|
//! | `linear_plant` | `A`, `B`, `C`, `D` in plain arrays |
//! | `continuous` | the continuous plant: derivatives and integrals of its outputs, inputs that change within a sample |
//! | `functionals` | rows that read positions, rates and integrals off a state |
//! | `coordinates` | minimal coordinates: as many parameters as the input-output behaviour has |
//! | `time_stepping` | the recursion over samples |
//! | `substeps` | the recursion at a finer step than the samples |
//! | `structure` | which parameters are free, and how they become a simulation |

pub(crate) mod continuous;
pub(crate) mod coordinates;
pub(crate) mod functionals;
pub(crate) mod linear_plant;
pub(crate) mod structure;
pub(crate) mod substeps;
pub(crate) mod time_stepping;
