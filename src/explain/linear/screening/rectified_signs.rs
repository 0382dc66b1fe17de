//! What a sensor that loses the sign multiplies a change in front of it by.

use crate::explain::linear::data::{Data, Series};
use crate::explain::linear::model::structure::Structure;

/// Sign of what is in front of a rectifying sensor, where `structure` has one: what a change there is multiplied by.
pub(crate) fn signs(structure: &Structure, theta: &[f64], data: &Data) -> Option<Series> {
    let index = structure
        .effects
        .iter()
        .position(|e| e.definition.id == "sensor_rectification")?;
    let channel = structure.effects[index].channel;
    // It has no numbers, so that `theta` serves without it as well.
    let mut before = structure.clone();
    before.effects.remove(index);
    if index < before.known.len() {
        before.known.remove(index);
    } else if index < structure.first_new() {
        before.adjusted -= 1;
    }
    let signed = before.simulate(theta, data)?;
    Some(
        signed
            .iter()
            .enumerate()
            .map(|(s, y)| {
                y.iter()
                    .map(|y| {
                        if s % data.outputs == channel && *y < 0.0 {
                            -1.0
                        } else {
                            1.0
                        }
                    })
                    .collect()
            })
            .collect(),
    )
}
