//! Simulation in the units of the recording.

use nalgebra::DVector;

use super::identified_model::Model;
use crate::linalg::spectral_radius;
use crate::model::{ModelError, Prediction, estimate_initial_state};

impl Model {
    /// Inputs as deviations from the operating point, delayed by the known delays; before the first sample
    /// they stand still.
    fn input_deviations(&self, inputs: &[&[f64]]) -> Result<Vec<Vec<f64>>, ModelError> {
        if inputs.len() != self.inputs.len() {
            return Err(ModelError::Channels {
                kind: "inputs",
                given: inputs.len(),
                expected: self.inputs.len(),
            });
        }
        Ok(self
            .inputs
            .iter()
            .zip(inputs)
            .map(|(channel, column)| {
                (0..column.len())
                    .map(|k| column[k.saturating_sub(channel.delay)] - channel.level)
                    .collect()
            })
            .collect())
    }

    /// Free run from the inputs alone, `y = level + system(u - level)`, known delays applied.
    ///
    /// One slice an input, in the units of the recording; one column an output comes back. The initial state
    /// is that of the operating point unless given. An unstable model may leave the range of numbers: the
    /// caller checks.
    ///
    /// # Errors
    /// [`ModelError`] when the number or the length of the inputs is wrong.
    pub fn simulate(
        &self,
        inputs: &[&[f64]],
        initial_state: Option<&DVector<f64>>,
    ) -> Result<Vec<Vec<f64>>, ModelError> {
        let inputs = self.input_deviations(inputs)?;
        let slices: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
        let mut outputs = self.system.simulate(&slices, initial_state)?;
        for (column, channel) in outputs.iter_mut().zip(&self.outputs) {
            for value in column {
                *value += channel.level;
            }
        }
        Ok(outputs)
    }

    /// Outputs as deviations from the operating point.
    fn output_deviations(&self, outputs: &[&[f64]]) -> Result<Vec<Vec<f64>>, ModelError> {
        if outputs.len() != self.outputs.len() {
            return Err(ModelError::Channels {
                kind: "outputs",
                given: outputs.len(),
                expected: self.outputs.len(),
            });
        }
        Ok(self
            .outputs
            .iter()
            .zip(outputs)
            .map(|(channel, column)| column.iter().map(|y| y - channel.level).collect())
            .collect())
    }

    /// One-step predictions and innovations of a recording, in its units; known delays applied.
    ///
    /// The initial state is that of the operating point unless given
    /// ([`initial_state_of`](Model::initial_state_of) has the one that fits best).
    ///
    /// # Errors
    /// [`ModelError`] when the number or the length of the channels is wrong.
    pub fn predict(
        &self,
        inputs: &[&[f64]],
        outputs: &[&[f64]],
        initial_state: Option<&DVector<f64>>,
    ) -> Result<Prediction, ModelError> {
        let inputs = self.input_deviations(inputs)?;
        let outputs = self.output_deviations(outputs)?;
        let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
        let outputs: Vec<&[f64]> = outputs.iter().map(Vec::as_slice).collect();
        let mut prediction = self.system.one_step(&inputs, &outputs, initial_state)?;
        for (column, channel) in prediction.predicted.iter_mut().zip(&self.outputs) {
            for value in column {
                *value += channel.level;
            }
        }
        Ok(prediction)
    }

    /// Refuses simulated outputs that have left the range of numbers; `start_time` is that of the first sample.
    ///
    /// # Errors
    /// [`ModelError::Diverges`] says which output, when, and why.
    pub fn check_finite(&self, outputs: &[Vec<f64>], start_time: f64) -> Result<(), ModelError> {
        let first = outputs
            .iter()
            .enumerate()
            .filter_map(|(o, column)| Some((column.iter().position(|y| !y.is_finite())?, o)))
            .min();
        let Some((sample, output)) = first else {
            return Ok(());
        };
        Err(ModelError::Diverges {
            output: self.outputs[output].channel.name.clone(),
            sample,
            time: start_time + sample as f64 * self.system.sample_time,
            spectral_radius: spectral_radius(&self.system.a).unwrap_or(f64::NAN),
        })
    }

    /// The state at the first sample that explains a recording best (least squares of the innovations),
    /// inputs and outputs in the units of the recording.
    ///
    /// # Errors
    /// [`ModelError`] when the number or the length of the channels is wrong.
    pub fn initial_state_of(
        &self,
        inputs: &[&[f64]],
        outputs: &[&[f64]],
    ) -> Result<DVector<f64>, ModelError> {
        let inputs = self.input_deviations(inputs)?;
        let outputs = self.output_deviations(outputs)?;
        let inputs: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
        let outputs: Vec<&[f64]> = outputs.iter().map(Vec::as_slice).collect();
        estimate_initial_state(
            &self.system,
            &inputs,
            &outputs,
            self.innovation_covariance.as_ref(),
        )
    }
}

#[cfg(test)]
mod tests {
    use crate::identify::{Options, Order, identify};
    use crate::systems::servo;

    #[test]
    fn simulation_is_in_the_units_of_the_recording() {
        let mut log = servo().record(3000, 1);
        for value in &mut log.input_data[0] {
            *value = 5.0 + 0.1 * *value;
        }
        for value in &mut log.output_data[0] {
            *value += 300.0;
        }
        let options = Options {
            order: Order::Fixed(3),
            ..Options::default()
        };
        let model = identify(std::slice::from_ref(&log), &options).unwrap();
        let (u, y) = (&log.input_data[0], &log.output_data[0]);
        let start = model.initial_state_of(&[u], &[y]).unwrap();
        let simulated = model.simulate(&[u], Some(&start)).unwrap();
        let error: f64 = simulated[0]
            .iter()
            .zip(y)
            .map(|(a, b)| (a - b).powi(2))
            .sum();
        let spread: f64 = y.iter().map(|y| (y - 300.0).powi(2)).sum();
        assert!(error < 0.3 * spread, "{error} of {spread}");
        assert!(model.simulate(&[u, u], None).is_err());
    }
}
