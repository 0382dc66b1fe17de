//! What may be missing: the terms of the library, what they are functions of, and what they are called.

pub(crate) mod argument;
pub(crate) mod arguments_of_plant;
pub(crate) mod documentation;
pub(crate) mod library;
pub(crate) mod names;
pub(crate) mod richer;
pub(crate) mod summands;
pub(crate) mod term;
pub(crate) mod values;
