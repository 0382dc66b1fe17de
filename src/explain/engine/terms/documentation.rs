//! What the ids of [`names`](super::names) mean: the library of plants in equations, for people. A test holds both together.

mod forces;
mod heat_and_flow;
mod inputs;
mod loads_and_parameters;
mod sensors;
#[cfg(test)]
mod tests;

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

/// All of them, by families.
pub fn plant_effects() -> impl Iterator<Item = &'static PlantEffect> {
    let families = [
        forces::FORCES,
        heat_and_flow::HEAT_AND_FLOW,
        loads_and_parameters::LOADS_AND_PARAMETERS,
        inputs::INPUTS,
        sensors::SENSORS,
    ];
    families.into_iter().flatten()
}

/// The description of an id.
pub fn plant_effect(id: &str) -> Option<&'static PlantEffect> {
    plant_effects().find(|e| e.id == id)
}

const fn like(effect: &'static str, experiment: &'static str) -> Imitation {
    Imitation { effect, experiment }
}

const fn effect(
    id: &'static str,
    title: &'static str,
    equation: &'static str,
    enters: &'static str,
    depends: &'static str,
    imitations: &'static [Imitation],
) -> PlantEffect {
    PlantEffect {
        id,
        title,
        equation,
        enters,
        depends,
        imitations,
    }
}

const ANY_EQUATION: &str = "the equation of a derivative or of an algebraic variable";
const AN_INPUT: &str = "an input, on its way into every equation that uses it";
const A_SENSOR: &str = "an output that copies a variable";
const A_PARAMETER: &str = "a parameter, in every equation that uses it";
const A_VELOCITY: &str = "a velocity: a variable in m/s or rad/s, or the derivative of another";
const A_POSITION: &str = "a position: a variable in m, mm, rad or deg of a plant that moves";
const ITSELF: &str = "the input itself";
const SHOWN: &str = "what the sensor shows";
const TIME: &str = "time";
