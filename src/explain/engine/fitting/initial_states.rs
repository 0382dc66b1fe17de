//! Initial states of what effects add to a plant.
//!
//! A search takes them from the argument of the effect: a lag starts where its input is. The recorded plant may have started
//! elsewhere, such as with walls colder than the room, and a fresh recording starts elsewhere again.

use crate::explain::engine::search::Found;
use crate::explain::engine::thresholds::{MOST_STEPS, THOROUGH, limited};
use crate::physics::estimate::{Fit, PlantRecording, Study};
use crate::physics::{ModelSpec, Plant, VariableId, parse};

fn is_held(spec: &ModelSpec, state: VariableId) -> bool {
    let variable = spec.variable(state);
    variable.uncorrected && variable.fixed
}

/// The plant with the initial states of effects free, as those of its text are; none where it has no such states.
pub(crate) fn with_free_states(plant: &Plant) -> Option<Plant> {
    let mut spec = plant.spec.clone();
    let held: Vec<VariableId> = (spec.states().into_iter())
        .filter(|&v| is_held(&spec, v))
        .collect();
    if held.is_empty() {
        return None;
    }
    let mut text = spec.text.clone();
    for &state in &held {
        let declared = format!("Real {}(start=", spec.variable(state).name);
        let at = text.find(&declared)? + declared.len();
        let end = at + text[at..].find(';')?;
        let free = text[at..end].replace(", fixed=true", "");
        text.replace_range(at..end, &free);
    }
    let known = std::mem::replace(&mut spec, parse(&text).ok()?);
    for state in known.states().into_iter().map(|v| known.variable(v)) {
        let same = spec.find(&state.name)?;
        spec.variables[same.index()].uncorrected = state.uncorrected;
    }
    Some(Plant::new(spec).with_values(&plant.nominal().parameters))
}

impl Found {
    /// Estimates the initial states of the effects too, where Schwarz's criterion says that they are not those of the search.
    pub(crate) fn estimate_initial_states(&mut self, recordings: &[PlantRecording]) -> Option<()> {
        let freed = with_free_states(&self.plant)?;
        let held = Study::new(&self.plant, recordings, &self.options).ok()?;
        let held = held.with_information(self.information);
        let limited = limited(freed.clone(), &held, MOST_STEPS);
        let study = held.of(&limited, &self.options).ok()?;
        let first = study.parameters();
        let own = held.nominal().len();
        let mut point = self.fit.point[..first].to_vec();
        for start in held.starts(&self.fit) {
            point.extend(start);
        }
        point.extend(&self.fit.point[own..]);
        let from = Fit {
            point,
            ..self.fit.clone()
        };
        let fit = match self.options.least_squares {
            true => study.least_squares_with(&from.point, THOROUGH)?,
            false => study.refit(&from, 1, THOROUGH)?,
        };
        if fit.criterion < held.criterion(&self.fit) {
            (self.plant, self.fit) = (freed, fit);
        }
        Some(())
    }
}
