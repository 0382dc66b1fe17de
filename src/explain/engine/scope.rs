//! Which effects of the library may be named, and what is asked beside them.

use crate::explain::engine::hypothesis::Hypothesis;
use crate::explain::engine::screening::screen::{Lead, Screen};
use crate::explain::engine::terms::documentation::plant_effects;
use crate::explain::engine::terms::names::called;
use crate::physics::{ModelSpec, nearest};

/// Part of the library, and hypotheses.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Scope {
    /// Nothing else is tried, unless empty.
    pub(crate) only: Vec<String>,
    /// What is not tried.
    pub(crate) without: Vec<String>,
    /// What the user holds possible.
    pub(crate) hypotheses: Vec<Hypothesis>,
}

/// An id that the library does not have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{option}: there is no effect called {id} of plants in equations{}; there are {}",
    .nearest.as_ref().map(|n| format!(" (did you mean {n}?)")).unwrap_or_default(),
    .known.join(", ")
)]
#[allow(missing_docs, reason = "the message explains the fields")]
pub struct UnknownPlantEffect {
    pub option: &'static str,
    pub id: String,
    pub nearest: Option<String>,
    pub known: Vec<&'static str>,
}

impl Scope {
    /// Checks that every id is known.
    pub(crate) fn new(only: &[String], without: &[String]) -> Result<Self, UnknownPlantEffect> {
        let ids = || plant_effects().map(|e| e.id);
        for (option, given) in [("--only", only), ("--without", without)] {
            if let Some(id) = given.iter().find(|id| !ids().any(|known| known == *id)) {
                return Err(UnknownPlantEffect {
                    option,
                    id: id.clone(),
                    nearest: nearest(id, ids()),
                    known: ids().collect(),
                });
            }
        }
        Ok(Self {
            only: only.to_vec(),
            without: without.to_vec(),
            hypotheses: vec![],
        })
    }

    /// Whether this id may be named.
    pub(crate) fn allows(&self, id: &str) -> bool {
        (self.only.is_empty() || self.only.iter().any(|o| o == id))
            && !self.without.iter().any(|w| w == id)
    }

    /// Drops what may not be named. The tests of what is left are made of all terms all the same.
    pub(crate) fn restrict(&self, spec: &ModelSpec, screen: &mut Screen) {
        if self.only.is_empty() && self.without.is_empty() {
            return;
        }
        let arguments = &screen.arguments;
        let allowed = |lead: &Lead| {
            let variables = lead
                .argument
                .map_or(&[][..], |a| arguments[a].variables.as_slice());
            self.allows(called(spec, lead.term, lead.place, variables))
        };
        screen.leads.retain(allowed);
        screen.curves.retain(allowed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_id_is_told_with_those_that_are_known() {
        let ids = |ids: &[&str]| ids.iter().map(|i| (*i).to_owned()).collect::<Vec<_>>();
        let error = Scope::new(&[], &ids(&["leak", "colomb_friction"])).unwrap_err();
        let said = error.to_string();
        assert!(said.starts_with("--without: there is no effect called colomb_friction"));
        assert!(said.contains("did you mean coulomb_friction?"), "{said}");
        assert!(said.contains("sensor_saturation"), "{said}");
        assert!(Scope::new(&ids(&["drag"]), &[]).is_err());
        let scope = Scope::new(&ids(&["leak", "law"]), &ids(&["law"])).unwrap();
        assert!(scope.allows("leak") && !scope.allows("law") && !scope.allows("overflow"));
        assert!(Scope::default().allows("overflow"));
    }
}
