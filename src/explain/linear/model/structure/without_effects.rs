//! A structure that is a plant alone, and one without what was added to it.

use std::sync::Arc;

use super::Structure;
use crate::explain::linear::model::coordinates::Coordinates;
use crate::explain::linear::model::linear_plant::Plant;

/// A plant without effects in minimal coordinates.
pub(crate) fn bare(plant: &Plant, initial: &[Vec<f64>]) -> Structure {
    let coordinates = Arc::new(Coordinates::new(plant));
    let initial = initial
        .iter()
        .map(|x| {
            (&coordinates.to_here * nalgebra::DVector::from_column_slice(x))
                .iter()
                .copied()
                .collect()
        })
        .collect();
    Structure {
        coordinates,
        plant_free: false,
        initial_free: false,
        initial,
        feedthrough_free: false,
        substeps: 1,
        recording: None,
        effects: Vec::new(),
        known: Vec::new(),
        adjusted: 0,
    }
}

impl Structure {
    /// The same structure and numbers without the effects that were looked for.
    pub(crate) fn without_new_effects(&self, theta: &[f64]) -> (Self, Vec<f64>) {
        let first = self.first_new();
        let mut without = self.clone();
        without.effects.truncate(first);
        (without, theta[..self.effect_offset(first)].to_vec())
    }
}
