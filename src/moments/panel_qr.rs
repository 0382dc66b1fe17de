//! The same factor by orthogonal transformations: slower, and accurate to the condition of the data
//! instead of its square.

use nalgebra::DMatrix;

use super::trend::Trend;
use crate::linalg::qr_r;

/// Values that a panel may hold: large enough for a fast factorisation, small enough for the cache and
/// for constant memory (8 MiB).
const PANEL_VALUES: usize = 1 << 20;

/// Streams windows `zeta[k]` into `R = qr([R; panel])`.
#[derive(Debug)]
pub struct PanelQr {
    past: usize,
    scale: Vec<f64>,
    trend: Trend,
    /// Scaled samples not yet in a panel, a column a channel; the first `past` of them are the
    /// beginning of the next window.
    samples: Vec<Vec<f64>>,
    /// Index in the experiment of the next sample.
    index: usize,
    panel_rows: usize,
    factor: Option<DMatrix<f64>>,
    columns: usize,
}

impl PanelQr {
    /// Windows of `past + 1` samples of channels that are divided by `scale`.
    pub fn new(past: usize, scale: &[f64]) -> Self {
        let order = (past + 1) * scale.len();
        Self {
            past,
            scale: scale.to_vec(),
            trend: Trend::zero(scale.len()),
            samples: vec![Vec::new(); scale.len()],
            index: 0,
            panel_rows: (PANEL_VALUES / order).max(2 * order),
            factor: None,
            columns: 0,
        }
    }

    /// Begins an experiment: windows do not reach over from the last one.
    pub fn start_experiment(&mut self, trend: &Trend) {
        self.flush();
        for column in &mut self.samples {
            column.clear();
        }
        self.index = 0;
        self.trend = trend.clone();
    }

    /// Appends samples, one slice a channel.
    pub fn push(&mut self, columns: &[&[f64]]) {
        let length = columns.first().map_or(0, |c| c.len());
        for (c, column) in columns.iter().enumerate() {
            let scaled = column
                .iter()
                .enumerate()
                .map(|(k, value)| (value - self.trend.at(c, self.index + k)) / self.scale[c]);
            self.samples[c].extend(scaled);
        }
        self.index += length;
        while self.samples[0].len() >= self.panel_rows + self.past {
            self.factor_panel(self.panel_rows);
        }
    }

    fn flush(&mut self) {
        let rows = self.samples[0].len().saturating_sub(self.past);
        if rows > 0 {
            self.factor_panel(rows);
        }
    }

    fn factor_panel(&mut self, rows: usize) {
        let q = self.scale.len();
        let order = (self.past + 1) * q;
        let above = self.factor.as_ref().map_or(0, |r| r.nrows());
        let mut stacked = DMatrix::zeros(above + rows, order);
        if let Some(r) = &self.factor {
            stacked.rows_mut(0, above).copy_from(r);
        }
        for i in 0..=self.past {
            for c in 0..q {
                let column = &self.samples[c][i..i + rows];
                stacked
                    .view_mut((above, i * q + c), (rows, 1))
                    .copy_from_slice(column);
            }
        }
        self.factor = Some(qr_r(&stacked));
        self.columns += rows;
        for column in &mut self.samples {
            column.drain(..rows);
        }
    }

    /// The factor and the number of windows in it; fewer windows than columns leave zero rows below.
    pub fn finish(mut self) -> (DMatrix<f64>, usize) {
        self.flush();
        let order = (self.past + 1) * self.scale.len();
        let mut square = DMatrix::zeros(order, order);
        if let Some(r) = &self.factor {
            square.rows_mut(0, r.nrows()).copy_from(r);
        }
        (square, self.columns)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Detrend, LagAccumulator, RFactor};
    use super::*;

    #[test]
    fn panels_and_lag_moments_give_the_same_factor() {
        let n = 5000;
        let columns: Vec<Vec<f64>> = (0..3)
            .map(|c| {
                (0..n)
                    .map(|k| (((k * (13 + 7 * c) + k * k) % 1009) as f64 / 500.0 - 1.0) + c as f64)
                    .collect()
            })
            .collect();
        let slices: Vec<&[f64]> = columns.iter().map(|c| c.as_slice()).collect();
        let mut accumulator = LagAccumulator::new(3, 6);
        accumulator.push(&slices);
        let moments = accumulator.moments();
        let trend = moments.trend(Detrend::Mean);
        let scale = moments.standard_deviation();
        let by_gram = RFactor::from_gram(&moments.gram(6, &trend), 1, &scale).unwrap();
        for chunk in [1, 100, 5000] {
            let mut panels = PanelQr::new(6, &scale);
            panels.panel_rows = 700;
            panels.start_experiment(&trend);
            for from in (0..n).step_by(chunk) {
                let to = (from + chunk).min(n);
                let part: Vec<&[f64]> = columns.iter().map(|c| &c[from..to]).collect();
                panels.push(&part);
            }
            let (r, count) = panels.finish();
            assert_eq!(count, n - 6);
            assert!((&r - &by_gram.r).amax() < 1e-10 * r.amax());
        }
    }
}
