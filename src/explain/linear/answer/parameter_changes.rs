//! What changed between the simulation's plant and the recording's, in terms that people use: natural frequency, damping,
//! time constant, static gain, each with its uncertainty by the delta method.

use nalgebra::{DMatrix, DVector};

use super::linear_answer::Answer;
use crate::explain::explanation::ParameterChange;
use crate::explain::linear::fit::{Fit, Problem};
use crate::explain::linear::model::linear_plant::Plant;
use crate::explain::linear::model::structure::Structure;
use crate::model::StateSpace;

/// A change is listed when it is this many of its standard deviations.
const CHANGED: f64 = 2.0;
/// Where a standard deviation is not known, a change is listed when it is this share of the value.
const SHOWN: f64 = 1e-3;
/// Difference step of the delta method, in standard deviations of each number.
const STEP: f64 = 0.1;
/// A pole whose time constant is longer than this many recordings is an integrator.
const INTEGRATES: f64 = 3.0;

/// One property of a plant.
struct Property {
    name: String,
    value: f64,
    unit: String,
}

impl Answer<'_> {
    /// What differs between the plant of the simulation and that of the model that stands.
    pub(crate) fn parameter_changes(&self, problem: &Problem, model: &Fit) -> Vec<ParameterChange> {
        let structure = &model.structure;
        // A plant of another class has nothing to compare with.
        let known = &self.known.structure;
        if !(structure.plant_free || structure.adjusted > 0) {
            return Vec::new();
        }
        let before = self.properties(&known.plant(&known.given()));
        let (listed, stds) = self.estimated(problem, model);
        // Few numbers that stand for many are known too well: what the recording says of each number is what the fit of all says.
        let full = &self.finding.boring.full;
        let is_restricted = !structure.plant_free && structure.new_effects().is_empty();
        let all = (is_restricted && full.structure.plant_free)
            .then(|| self.estimated(problem, full))
            .filter(|(list, stds)| {
                list.iter()
                    .zip(stds)
                    .any(|(now, std)| std.is_some() && moved(&before, now, *std))
            });
        let (listed, stds) = all.unwrap_or((listed, stds));
        let changed = listed.iter().zip(&stds);
        changed
            .filter(|(now, std)| moved(&before, now, **std))
            .filter_map(|(now, std)| {
                let was = before.iter().find(|p| p.name == now.name)?;
                Some(ParameterChange {
                    name: now.name.clone(),
                    simulation: was.value,
                    recording: now.value,
                    std: *std,
                    unit: now.unit.clone(),
                })
            })
            .collect()
    }

    /// Properties of the plant of a fit, and their standard deviations.
    fn estimated(&self, problem: &Problem, fit: &Fit) -> (Vec<Property>, Vec<Option<f64>>) {
        let properties = self.properties(&effective(&fit.structure, &fit.theta));
        let covariance = fit.clone().certainty(problem).map(|c| c.covariance);
        let stds = covariance.map(|c| self.deviations(fit, &c, &properties));
        let known = |i: usize| {
            let std = stds.as_ref().map(|s| s[i]);
            std.filter(|s| s.is_finite() && *s > 0.0)
        };
        let stds = (0..properties.len()).map(known).collect();
        (properties, stds)
    }

    /// Standard deviations of the properties of `model`.
    fn deviations(&self, model: &Fit, covariance: &DMatrix<f64>, at: &[Property]) -> Vec<f64> {
        let m = model.theta.len();
        let mut slopes = DMatrix::zeros(at.len(), m);
        for i in 0..m {
            let step = STEP * covariance[(i, i)].max(0.0).sqrt();
            if step == 0.0 {
                continue;
            }
            let moved = |by: f64| {
                let mut theta = model.theta.clone();
                theta[i] += by;
                self.properties(&effective(&model.structure, &theta))
            };
            let (up, down) = (moved(step), moved(-step));
            for (p, property) in at.iter().enumerate() {
                let of = |list: &[Property]| {
                    list.iter()
                        .find(|q| q.name == property.name)
                        .map(|q| q.value)
                };
                slopes[(p, i)] = match (of(&up), of(&down)) {
                    (Some(a), Some(b)) => (a - b) / (2.0 * step),
                    _ => f64::NAN,
                };
            }
        }
        (0..at.len())
            .map(|p| {
                let row = DVector::from_iterator(m, slopes.row(p).iter().copied());
                (row.transpose() * covariance * &row)[(0, 0)]
                    .max(0.0)
                    .sqrt()
            })
            .collect()
    }

    /// Poles as natural frequency and damping or as time constant, and static gains.
    fn properties(&self, plant: &Plant) -> Vec<Property> {
        let Ok(system) = StateSpace::deterministic(
            plant.a_matrix(),
            plant.b_matrix(),
            plant.c_matrix(),
            plant.d_matrix(),
            plant.sample_time,
        ) else {
            return Vec::new();
        };
        let longest = INTEGRATES * self.data().samples() as f64 * self.data().sample_time;
        let mut found = Vec::new();
        let mut poles = system.poles().unwrap_or_default();
        // What decays within a sample is a rest of the sampling.
        poles.retain(|p| p.value.im >= 0.0 && p.value.norm() > 1e-6);
        poles.sort_by(|a, b| a.natural_frequency.total_cmp(&b.natural_frequency));
        let pairs = poles.iter().filter(|p| p.value.im > 0.0);
        for (i, pole) in pairs.enumerate() {
            let number = if i == 0 {
                String::new()
            } else {
                format!(" {}", i + 1)
            };
            found.push(Property {
                name: format!("natural frequency{number}"),
                value: pole.natural_frequency / std::f64::consts::TAU,
                unit: "Hz".to_owned(),
            });
            if let Some(damping) = pole.damping {
                found.push(Property {
                    name: format!("damping ratio{number}"),
                    value: damping,
                    unit: String::new(),
                });
            }
        }
        let real = poles
            .iter()
            .filter(|p| p.value.im == 0.0 && p.value.re > 0.0);
        for (i, pole) in real.enumerate() {
            let number = if i == 0 {
                String::new()
            } else {
                format!(" {}", i + 1)
            };
            let value = -plant.sample_time / pole.value.re.ln();
            found.push(Property {
                name: format!("time constant{number}"),
                value: if value > 0.0 && value < longest {
                    value
                } else {
                    f64::INFINITY
                },
                unit: "s".to_owned(),
            });
        }
        if let Some(gain) = system.static_gain() {
            for (o, output) in self.outputs().iter().enumerate() {
                for (j, input) in self.inputs().iter().enumerate().take(self.data().signals()) {
                    if gain[(o, j)].abs() > 1e-9 {
                        found.push(Property {
                            name: format!("static gain {}/{}", output.name, input.name),
                            value: gain[(o, j)],
                            unit: match (&output.unit, &input.unit) {
                                (Some(y), Some(u)) => format!("{y}/{u}"),
                                _ => String::new(),
                            },
                        });
                    }
                }
            }
        }
        found
    }
}

/// Whether a property differs from what it was by more than chance allows.
fn moved(before: &[Property], now: &Property, std: Option<f64>) -> bool {
    before.iter().any(|was| {
        let finite = was.value.is_finite() && now.value.is_finite();
        let change = (now.value - was.value).abs();
        let least = std.map_or(SHOWN * was.value.abs(), |std| CHANGED * std);
        was.name == now.name && finite && change > least
    })
}

/// The plant with what was adjusted beside it: gains of the inputs, springs and dampers.
fn effective(structure: &Structure, theta: &[f64]) -> Plant {
    let mut plant = structure.prepare(theta).plant;
    for index in structure.known.len()..structure.first_new() {
        let effect = &structure.effects[index];
        if effect.definition.id == "input_gain" {
            let gain = 1.0 + structure.effect_numbers(theta, index)[0];
            for matrix in [&mut plant.b, &mut plant.d] {
                for row in matrix.chunks_exact_mut(plant.inputs) {
                    row[effect.channel] *= gain;
                }
            }
        }
    }
    plant
}
