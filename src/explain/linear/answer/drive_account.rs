//! A drive in words: laws, mass and friction with their uncertainty.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::effects_found::{amplitude_name, amplitude_unit, port_name};
use super::linear_answer::Answer;
use crate::explain::document::sentences;
use crate::explain::explanation::{EffectFound, Evidence, Mechanics, Quantity, Remaining};
use crate::explain::linear::screening::output_adequacy::LEVEL;
use crate::explain::linear::search::penalties::NEEDED;
use crate::explain::linear::weak_form::equation_proof::Proof;
use crate::explain::linear::weak_form::windows::Reading;

/// Units of angles: what they move is an inertia.
const ANGLES: &[&str] = &["rad", "deg", "rev", "turn", "turns"];

impl Proof {
    fn std(&self, i: usize) -> Option<f64> {
        Some(self.tethered.covariance[(i, i)].max(0.0).sqrt())
    }

    /// What is left of the force.
    pub(crate) fn remaining(&self) -> Remaining {
        let Some(a) = self.adequacy else {
            return Remaining {
                adequate: true,
                p_value: 1.0,
                share: 0.0,
                share_of_removed: None,
                features: 0,
                sentence: "The recording is too short to test what is left of the force."
                    .to_owned(),
            };
        };
        let sentence = if a.p_value > LEVEL {
            let found = a.sentence(" of the force");
            format!("{found}.")
        } else if self.adequate {
            let resembles = self.resembles.map_or_else(String::new, |(law, gain)| {
                format!(
                    " It resembles {} (evidence {}).",
                    law.name,
                    sentences::number(gain)
                )
            });
            format!(
                "{:.0} % of what is left of the force is structure still: real, but {:.1} % of what was found.{resembles}",
                100.0 * a.share,
                100.0 * a.of_removed
            )
        } else {
            format!(
                "{:.0} % of what is left of the force is structure (p = {:.0e}).",
                100.0 * a.share,
                a.p_value
            )
        };
        Remaining {
            adequate: self.adequate,
            p_value: a.p_value,
            share: a.share,
            share_of_removed: Some(a.of_removed),
            features: a.features,
            sentence,
        }
    }
}

impl Answer<'_> {
    /// Mass, friction and constant force.
    pub(crate) fn mechanics(&self, proof: &Proof) -> Mechanics {
        let c = &proof.tethered.coefficients;
        let side = c[0].signum();
        let units = Units::new(self, proof.equation.reading);
        let quantity = |i: usize, unit: &str| Quantity {
            value: side * c[i],
            std: proof.std(i),
            unit: unit.to_owned(),
        };
        let (mass, viscous, constant) = (
            quantity(0, &units.mass),
            quantity(1, &units.viscous),
            quantity(2, &units.force),
        );
        let stiffness = proof.equation.spring.then(|| quantity(3, &units.stiffness));
        let spring = stiffness.as_ref().map_or_else(String::new, |k| {
            format!(", stiffness {}", sentences::quantity(k))
        });
        let wired = if side < 0.0 {
            " The input pushes backwards."
        } else {
            ""
        };
        let sentence = format!(
            "{} {}, viscous friction {}{spring}, constant force {}.{wired}",
            if units.rotates { "Inertia" } else { "Mass" },
            sentences::quantity(&mass),
            sentences::quantity(&viscous),
            sentences::quantity(&constant),
        );
        Mechanics {
            reading: match proof.equation.reading {
                Reading::Position => "position",
                Reading::Velocity => "velocity",
            }
            .to_owned(),
            mass,
            viscous_friction: viscous,
            constant_force: constant,
            stiffness,
            window: 2.0 * proof.half as f64 * self.data().sample_time,
            sentence,
        }
    }

    /// The laws that were found.
    pub(crate) fn drive_effects(&self, proof: &Proof) -> Vec<EffectFound> {
        let (input, output) = (&self.inputs()[0], &self.outputs()[0]);
        let integral = proof.equation.reading == Reading::Velocity;
        let c = &proof.tethered.coefficients;
        let side = c[0].signum();
        let text = |unit: &Option<String>| unit.clone().unwrap_or_default();
        let mut found = Vec::new();
        for ((form, shape), (at, count)) in
            proof.equation.laws.iter().zip(proof.equation.places(false))
        {
            let definition = form.definition;
            let own = &c[at..at + count];
            let (amplitude, numbers) = form.numbers(own, *shape);
            let mut parameters = BTreeMap::new();
            let block = proof.tethered.covariance.view((at, at), (count, count));
            let std = |of: &dyn Fn(&[f64]) -> f64| deviation(of, own, &block.into_owned());
            if !form.on_input() {
                parameters.insert(
                    amplitude_name(definition.id).to_owned(),
                    Quantity {
                        value: side * amplitude,
                        std: std(&|own| form.numbers(own, *shape).0),
                        unit: amplitude_unit(
                            definition.id,
                            &text(&input.unit),
                            &text(&output.unit),
                            integral,
                        ),
                    },
                );
            }
            for (i, (p, value)) in definition.parameters.iter().zip(&numbers).enumerate() {
                parameters.insert(
                    p.name.to_owned(),
                    Quantity {
                        value: *value,
                        std: std(&|own| form.numbers(own, *shape).1[i]),
                        unit: sentences::unit_text(p.unit, input, output, integral),
                    },
                );
            }
            let mut effect = EffectFound {
                hypothesis: false,
                enters: None,
                depends: vec![],
                law: None,
                effect: definition.id.to_owned(),
                variant: definition.variant.to_owned(),
                signal: if form.on_input() {
                    input.name.clone()
                } else {
                    output.name.clone()
                },
                port: port_name(definition.port()).to_owned(),
                equation: definition.equation.to_owned(),
                parameters,
                evidence: Evidence {
                    criterion_gain: self.finding.gain,
                    criterion_needed: NEEDED,
                    heldout_gain: None,
                    halves_disagree: proof.halves_disagree,
                },
                sentence: String::new(),
            };
            effect.sentence = sentences::sentence(definition, &effect);
            found.push(effect);
        }
        if let Some(first) = found.first_mut() {
            first.sentence = format!("{} {}", first.sentence, self.mechanics(proof).sentence);
        }
        found
    }
}

/// Units of the equation of motion, empty where the channels have none.
struct Units {
    rotates: bool,
    force: String,
    mass: String,
    viscous: String,
    stiffness: String,
}

impl Units {
    fn new(answer: &Answer, reading: Reading) -> Self {
        let force = answer.inputs()[0].unit.clone().unwrap_or_default();
        let read = answer.outputs()[0].unit.clone().unwrap_or_default();
        let travel = match reading {
            Reading::Position => read,
            // What is a rate is a travel per second, whatever it is called.
            Reading::Velocity => match read.strip_suffix("/s") {
                Some(travel) => travel.to_owned(),
                None if read.is_empty() => String::new(),
                None => format!("{read} s"),
            },
        };
        let rotates = ANGLES.contains(&travel.as_str());
        let torque = ["N m", "Nm", "N*m"].contains(&force.as_str());
        let known = !force.is_empty() && !travel.is_empty();
        let per = |what: &str| match known {
            true => format!("{force} {what}/{travel}").replace("  ", " "),
            false => String::new(),
        };
        Self {
            mass: match (force.as_str(), travel.as_str()) {
                ("N", "m") => "kg".to_owned(),
                (_, "rad") if torque => "kg m^2".to_owned(),
                _ => per("s^2"),
            },
            viscous: per("s"),
            stiffness: per(""),
            rotates,
            force,
        }
    }
}

/// Standard deviation of a function of numbers with this covariance, by its gradient; `None` where it does not depend on
/// them.
fn deviation(
    of: &dyn Fn(&[f64]) -> f64,
    numbers: &[f64],
    covariance: &DMatrix<f64>,
) -> Option<f64> {
    let here = of(numbers);
    let gradient = DVector::from_fn(numbers.len(), |i, _| {
        let step = 1e-4 * covariance[(i, i)].max(0.0).sqrt().max(1e-300);
        let mut moved = numbers.to_vec();
        moved[i] += step;
        (of(&moved) - here) / step
    });
    let variance = (gradient.transpose() * covariance * &gradient)[(0, 0)];
    (variance > 0.0).then(|| variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncertainty_goes_through_functions_in_any_unit() {
        for unit in [1e-9, 1.0, 1e9] {
            let numbers = [0.3 * unit, 0.4 * unit];
            let covariance = DMatrix::from_row_slice(2, 2, &[4e-4, 1e-4, 1e-4, 9e-4]) * unit * unit;
            let length = |c: &[f64]| c[0].hypot(c[1]);
            // Along (0.6, 0.8).
            let expected = (0.36 * 4e-4 + 2.0 * 0.48 * 1e-4 + 0.64 * 9e-4_f64).sqrt() * unit;
            let found = deviation(&length, &numbers, &covariance).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-4, "{unit}: {found}");
            assert_eq!(deviation(&|_| 2.0, &numbers, &covariance), None);
        }
    }
}
