//! Model.

pub(crate) mod continuous;
pub(crate) mod coordinates;
pub(crate) mod functionals;
pub(crate) mod linear_plant;
pub(crate) mod structure;
pub(crate) mod substeps;
pub(crate) mod time_stepping;
