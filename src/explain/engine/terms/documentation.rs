//! What the ids of [`names`](super::names) mean: the library of plants in equations, for people. A test holds both together.

mod effect_table;
#[cfg(test)]
mod tests;

pub use effect_table::PLANT_EFFECTS;

/// Other values of the text's own parameters, as an imitation of an effect.
pub(crate) const PARAMETERS: &str = "parameters";

/// What another effect has in common with one, and how a recording tells the two apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Imitation {
    /// Id of the other effect; `parameters` where other values of the text's own parameters do the same.
    pub effect: &'static str,
    /// The recording that separates them.
    pub experiment: &'static str,
}

/// An effect that can be missing in a plant in equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlantEffect {
    /// Id in documents, for `--only` and `--without`.
    pub id: &'static str,
    /// What people call it.
    pub title: &'static str,
    /// The changed equation; `...` is what the text says there, and `c`, `w`, `T` and the like are new parameters.
    pub equation: &'static str,
    /// What it may enter.
    pub enters: &'static str,
    /// What it is a function of.
    pub depends: &'static str,
    /// What looks like it.
    pub imitations: &'static [Imitation],
}

/// The description of an id.
pub fn plant_effect(id: &str) -> Option<&'static PlantEffect> {
    PLANT_EFFECTS.iter().find(|e| e.id == id)
}
