//! The recordings as the engine sees them: segments of one sampling, one set of channels.

/// One contiguous recording.
#[derive(Debug, Clone)]
pub(crate) struct Segment {
    /// `inputs[channel][sample]`.
    pub(crate) inputs: Vec<Vec<f64>>,
    /// `outputs[channel][sample]`.
    pub(crate) outputs: Vec<Vec<f64>>,
    /// Time of the first sample in seconds.
    pub(crate) start_time: f64,
}

impl Segment {
    pub(crate) fn samples(&self) -> usize {
        self.inputs
            .first()
            .or_else(|| self.outputs.first())
            .map_or(0, Vec::len)
    }
}

/// All recordings that are explained together.
#[derive(Debug, Clone)]
pub(crate) struct Data {
    pub(crate) segments: Vec<Segment>,
    pub(crate) sample_time: f64,
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    /// The last input is the constant 1, through which operating points enter.
    pub(crate) constant: bool,
}

pub(crate) use crate::noise::Series;

/// `a - b`.
pub(crate) fn difference(a: &Series, b: &Series) -> Series {
    a.iter()
        .zip(b)
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a - b).collect())
        .collect()
}

impl Data {
    /// Samples over all segments (a sample holds all channels).
    pub(crate) fn samples(&self) -> usize {
        self.segments.iter().map(Segment::samples).sum()
    }

    /// Inputs that are signals: all but the constant.
    pub(crate) fn signals(&self) -> usize {
        self.inputs - usize::from(self.constant)
    }

    /// Measured outputs minus `simulated`.
    pub(crate) fn residual(&self, simulated: &Series) -> Series {
        self.outputs_as_series()
            .zip(simulated)
            .map(|(y, s)| y.iter().zip(s).map(|(y, s)| y - s).collect())
            .collect()
    }

    /// The recorded outputs, series by series.
    pub(crate) fn outputs_as_series(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.segments.iter().flat_map(|s| s.outputs.iter())
    }

    /// Standard deviation of each output over all segments.
    pub(crate) fn output_scale(&self) -> Vec<f64> {
        (0..self.outputs)
            .map(|o| deviation(self.segments.iter().flat_map(|s| s.outputs[o].iter())))
            .collect()
    }

    /// Standard deviation of each input over all segments.
    pub(crate) fn input_scale(&self) -> Vec<f64> {
        (0..self.inputs)
            .map(|i| deviation(self.segments.iter().flat_map(|s| s.inputs[i].iter())))
            .collect()
    }
}

/// Standard deviation about the mean; 1 when there is no variation to divide by, but that of rounding.
pub(super) fn deviation<'a>(values: impl Iterator<Item = &'a f64> + Clone) -> f64 {
    let n = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / n;
    let variance = values.map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    match variance > (4.0 * f64::EPSILON * mean).powi(2) {
        true => variance.sqrt(),
        false => 1.0,
    }
}

/// An input held back by a delay in samples: before it begins, it had its first value.
pub(crate) fn delayed(u: &[f64], delay: usize) -> Vec<f64> {
    (0..u.len()).map(|k| u[k.saturating_sub(delay)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_about_the_mean_over_all_segments() {
        let segment = |u: &[f64], y: &[f64]| Segment {
            inputs: vec![u.to_vec()],
            outputs: vec![y.to_vec()],
            start_time: 0.0,
        };
        let data = Data {
            segments: vec![
                segment(&[1.0, 3.0], &[5.0, 5.0]),
                segment(&[5.0, 7.0], &[5.0, 5.0]),
            ],
            sample_time: 1.0,
            inputs: 1,
            outputs: 1,
            constant: false,
        };
        assert_eq!(data.samples(), 4);
        assert!((data.input_scale()[0] - 5.0_f64.sqrt()).abs() < 1e-12);
        // What does not vary is divided by one.
        assert_eq!(data.output_scale(), [1.0]);
        let simulated = vec![vec![1.0, 2.0], vec![3.0, 4.0]];
        assert_eq!(data.residual(&simulated), [[4.0, 3.0], [2.0, 1.0]]);
    }
}
