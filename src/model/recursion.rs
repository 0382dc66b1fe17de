//! The loop over samples that simulation and prediction share.

use nalgebra::DMatrix;

/// Rows are padded to this many, so that the inner loop has a fixed length and becomes vector
/// instructions.
const LANES: usize = 4;

/// State entries below this size become zero. A state that decays after the excitation has ended would
/// otherwise stay at the smallest subnormal numbers (0.9 times the smallest one rounds back to it), on
/// which many processors are a hundred times slower.
const NEGLIGIBLE: f64 = 1e-280;

/// The recursion `x[k+1] = F x[k] + G w[k]`, `y[k] = H x[k] + J w[k]` with `w` in `R^m`, stored for
/// speed: `[G F; J H]` in panels of [`LANES`] rows, each panel column after column. The columns of `w`
/// come first: their sums do not wait for the state of the previous sample.
#[derive(Debug, Clone)]
pub(super) struct Recursion {
    panels: Vec<[f64; LANES]>,
    states: usize,
    channels: usize,
    outputs: usize,
}

impl Recursion {
    /// From `F` (`n x n`), `G` (`n x m`), `H` (`l x n`), `J` (`l x m`).
    pub(super) fn new(
        f: &DMatrix<f64>,
        g: &DMatrix<f64>,
        h: &DMatrix<f64>,
        j: &DMatrix<f64>,
    ) -> Self {
        let (states, channels, outputs) = (f.nrows(), g.ncols(), h.nrows());
        let columns = channels + states;
        let mut panels = Vec::new();
        for panel in 0..(states + outputs).div_ceil(LANES) {
            for column in 0..columns {
                panels.push(std::array::from_fn(|lane| {
                    let row = panel * LANES + lane;
                    match (row, column < channels) {
                        (i, true) if i < states => g[(i, column)],
                        (i, false) if i < states => f[(i, column - channels)],
                        (i, true) if i < states + outputs => j[(i - states, column)],
                        (i, false) if i < states + outputs => h[(i - states, column - channels)],
                        _ => 0.0,
                    }
                }));
            }
        }
        Self {
            panels,
            states,
            channels,
            outputs,
        }
    }

    /// Runs over one block of samples: `channels` holds the `m` columns of `w`, `state` (`n`) is the
    /// state before the block and then the one after it. Appends to the `l` columns of `outputs`.
    pub(super) fn run(
        &self,
        state: &mut [f64],
        channels: &[&[f64]],
        samples: usize,
        outputs: &mut [Vec<f64>],
    ) {
        debug_assert_eq!(channels.len(), self.channels);
        debug_assert_eq!(outputs.len(), self.outputs);
        let columns = self.channels + self.states;
        for output in outputs.iter_mut() {
            output.reserve(samples);
        }
        if columns == 0 {
            for output in outputs.iter_mut() {
                output.resize(output.len() + samples, 0.0);
            }
            return;
        }
        let mut operand = vec![0.0; columns];
        operand[self.channels..].copy_from_slice(state);
        let mut result = vec![[0.0; LANES]; self.panels.len() / columns];
        for sample in 0..samples {
            for (slot, channel) in operand.iter_mut().zip(channels) {
                *slot = channel[sample];
            }
            for (sum, panel) in result.iter_mut().zip(self.panels.chunks_exact(columns)) {
                let mut accumulator = [0.0; LANES];
                for (&factor, column) in operand.iter().zip(panel) {
                    for (a, c) in accumulator.iter_mut().zip(column) {
                        *a += factor * c;
                    }
                }
                *sum = accumulator;
            }
            let flat = result.as_flattened();
            for (slot, &value) in operand[self.channels..].iter_mut().zip(flat) {
                *slot = if value.abs() < NEGLIGIBLE { 0.0 } else { value };
            }
            for (output, &value) in outputs.iter_mut().zip(&flat[self.states..]) {
                output.push(value);
            }
        }
        state.copy_from_slice(&operand[self.channels..]);
    }
}
