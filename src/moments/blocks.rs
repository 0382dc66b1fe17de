//! Moments kept by blocks of the record, for the delete-block jackknife.

use super::accumulator::LagAccumulator;
use super::gram::Gram;
use super::lag_moments::LagMoments;
use super::trend::Trend;

/// Accumulates a record of unknown length as between `target` and `2 * target` blocks of equal length
/// (the last one is shorter): when there are twice as many as wanted, neighbours are merged and the
/// blocks to come are twice as long.
#[derive(Debug)]
pub(crate) struct BlockAccumulator {
    channels: usize,
    lags: usize,
    target: usize,
    block_samples: usize,
    finished: Vec<LagMoments>,
    open: LagAccumulator,
}

impl BlockAccumulator {
    /// Blocks much longer than `lags` samples; between `target` and `2 target` of them in the end.
    pub(crate) fn new(channels: usize, lags: usize, target: usize) -> Self {
        Self {
            channels,
            lags,
            target: target.max(2),
            block_samples: lags.max(8),
            finished: Vec::new(),
            open: LagAccumulator::new(channels, lags),
        }
    }

    /// Appends samples, one slice a channel.
    pub(crate) fn push(&mut self, columns: &[&[f64]]) {
        let length = columns.first().map_or(0, |c| c.len());
        let mut from = 0;
        while from < length {
            let take = (self.block_samples - self.open.samples()).min(length - from);
            let part: Vec<&[f64]> = columns.iter().map(|c| &c[from..from + take]).collect();
            self.open.push(&part);
            from += take;
            if self.open.samples() == self.block_samples {
                self.close_block();
            }
        }
    }

    fn close_block(&mut self) {
        let open = std::mem::replace(
            &mut self.open,
            LagAccumulator::new(self.channels, self.lags),
        );
        self.finished.push(open.moments());
        if self.finished.len() >= 2 * self.target {
            self.finished = self
                .finished
                .chunks(2)
                .map(|pair| match pair {
                    [a, b] => a.append(b),
                    rest => rest[0].clone(),
                })
                .collect();
            self.block_samples *= 2;
        }
    }

    /// The blocks in order. A last block shorter than half a block joins its neighbour.
    pub(crate) fn finish(mut self) -> Vec<LagMoments> {
        let rest = self.open.moments();
        if rest.samples() > 0 {
            match self.finished.last_mut() {
                Some(last) if rest.samples() < self.block_samples / 2 => *last = last.append(&rest),
                _ => self.finished.push(rest),
            }
        }
        self.finished
    }
}

/// Gram matrix of the windows that *begin* in each block, so that the blocks add up to the whole.
/// `trend` is that of the record.
pub(crate) fn block_grams(blocks: &[LagMoments], past: usize, trend: &Trend) -> Vec<Gram> {
    let mut start = 0_usize;
    blocks
        .iter()
        .enumerate()
        .map(|(index, block)| {
            let mut extended = block.clone();
            let mut missing = past;
            for next in &blocks[index + 1..] {
                if missing == 0 {
                    break;
                }
                let beginning = next.beginning(missing);
                missing -= beginning.samples();
                extended = extended.append(&beginning);
            }
            let shifted = Trend {
                level: (0..trend.level.len()).map(|c| trend.at(c, start)).collect(),
                slope: trend.slope.clone(),
            };
            start += block.samples();
            extended.gram(past, &shifted)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::Detrend;
    use super::*;

    #[test]
    fn blocks_add_up_to_the_whole() {
        let n = 4321;
        let columns: Vec<Vec<f64>> = (0..2)
            .map(|c| {
                (0..n)
                    .map(|k| ((k * (5 + c) + k * k * 3) % 97) as f64 + 0.01 * k as f64)
                    .collect()
            })
            .collect();
        let slices: Vec<&[f64]> = columns.iter().map(|c| c.as_slice()).collect();
        let mut whole = LagAccumulator::new(2, 7);
        whole.push(&slices);
        let whole = whole.moments();
        let trend = whole.trend(Detrend::Linear);
        let expected = whole.gram(7, &trend);
        let mut blocks = BlockAccumulator::new(2, 7, 10);
        for from in (0..n).step_by(113) {
            let part: Vec<&[f64]> = columns
                .iter()
                .map(|c| &c[from..(from + 113).min(n)])
                .collect();
            blocks.push(&part);
        }
        let blocks = blocks.finish();
        assert!((10..=20).contains(&blocks.len()), "{}", blocks.len());
        let mut sum = Gram::empty(16);
        for gram in block_grams(&blocks, 7, &trend) {
            sum.add(&gram);
        }
        assert_eq!(sum.columns, expected.columns);
        assert!((&sum.gram - &expected.gram).amax() < 1e-10 * expected.gram.amax());
        let merged = blocks
            .iter()
            .skip(1)
            .fold(blocks[0].clone(), |a, b| a.append(b));
        assert_eq!(merged.samples(), n);
    }
}
