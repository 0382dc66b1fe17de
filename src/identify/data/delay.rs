//! Known input delays: channels are shifted as they stream by.

/// Aligns `y[k]` with `u_i[k - d_i]`. The first `max d_i` samples have no complete partner and are dropped.
#[derive(Debug)]
pub(crate) struct Aligner {
    /// Samples still to be dropped from each channel.
    skip: Vec<usize>,
    pending: Vec<Vec<f64>>,
    aligned: bool,
}

impl Aligner {
    /// `delays`: one an input; `outputs`: number of outputs, which follow the inputs.
    pub(crate) fn new(delays: &[usize], outputs: usize) -> Self {
        let longest = delays.iter().copied().max().unwrap_or(0);
        let skip: Vec<usize> = delays
            .iter()
            .map(|delay| longest - delay)
            .chain(std::iter::repeat_n(longest, outputs))
            .collect();
        Self {
            pending: vec![Vec::new(); skip.len()],
            skip,
            aligned: longest == 0,
        }
    }

    /// Passes on what is complete.
    pub(crate) fn push(&mut self, columns: &[&[f64]], sink: &mut dyn FnMut(&[&[f64]])) {
        if self.aligned {
            sink(columns);
            return;
        }
        for ((pending, skip), column) in self.pending.iter_mut().zip(&mut self.skip).zip(columns) {
            let drop = (*skip).min(column.len());
            *skip -= drop;
            pending.extend_from_slice(&column[drop..]);
        }
        let ready = self.pending.iter().map(Vec::len).min().unwrap_or(0);
        if ready > 0 {
            let slices: Vec<&[f64]> = self.pending.iter().map(|c| &c[..ready]).collect();
            sink(&slices);
            for pending in &mut self.pending {
                pending.drain(..ready);
            }
        }
    }
}

/// Collects what an [`Aligner`] passes on, one column a channel.
#[derive(Debug)]
pub(crate) struct AlignedColumns {
    aligner: Aligner,
    /// The samples so far.
    pub(crate) columns: Vec<Vec<f64>>,
}

impl AlignedColumns {
    /// `delays`: one an input; `outputs`: number of outputs, which follow the inputs.
    pub(crate) fn new(delays: &[usize], outputs: usize) -> Self {
        Self {
            aligner: Aligner::new(delays, outputs),
            columns: vec![Vec::new(); delays.len() + outputs],
        }
    }

    /// Adds a block of samples.
    pub(crate) fn push(&mut self, block: &[&[f64]]) {
        let columns = &mut self.columns;
        self.aligner.push(block, &mut |part| {
            for (column, part) in columns.iter_mut().zip(part) {
                column.extend_from_slice(part);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_do_not_depend_on_chunks() {
        let u: Vec<f64> = (0..20).map(f64::from).collect();
        let v: Vec<f64> = (0..20).map(|k| f64::from(k) + 100.0).collect();
        let y: Vec<f64> = (0..20).map(|k| f64::from(k) + 1000.0).collect();
        for chunk in [1, 3, 20] {
            let mut aligned = AlignedColumns::new(&[3, 1], 1);
            for from in (0..20).step_by(chunk) {
                let to = (from + chunk).min(20);
                aligned.push(&[&u[from..to], &v[from..to], &y[from..to]]);
            }
            assert_eq!(aligned.columns, [&u[..17], &v[2..19], &y[3..]]);
        }
    }
}
