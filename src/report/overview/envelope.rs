//! The smallest and the largest value of each stretch of a signal whose length is not known beforehand.

/// Stretches at most; when they are used up, neighbours are joined. Two values of each are as many points as a page
/// draws.
const STRETCHES: usize = 2500;

/// An envelope that grows with the signal, in memory that does not.
#[derive(Debug, Clone)]
pub(super) struct Envelope {
    stretches: Vec<Stretch>,
    /// Samples of a stretch.
    length: usize,
    /// Samples so far.
    samples: usize,
}

/// Where a stretch is smallest and largest, and how large.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    low: (usize, f64),
    high: (usize, f64),
}

impl Default for Envelope {
    fn default() -> Self {
        Self {
            stretches: Vec::new(),
            length: 1,
            samples: 0,
        }
    }
}

impl Stretch {
    fn join(&mut self, other: Self) {
        if other.low.1 < self.low.1 {
            self.low = other.low;
        }
        if other.high.1 > self.high.1 {
            self.high = other.high;
        }
    }

    /// Of samples that are there; `first` is the number of the first.
    fn of(values: &[f64], first: usize) -> Self {
        let (mut low, mut high) = ((0, values[0]), (0, values[0]));
        for (k, value) in values.iter().enumerate().skip(1) {
            if *value < low.1 {
                low = (k, *value);
            }
            if *value > high.1 {
                high = (k, *value);
            }
        }
        Self {
            low: (first + low.0, low.1),
            high: (first + high.0, high.1),
        }
    }
}

impl Envelope {
    /// Goes on by these samples.
    pub(super) fn push(&mut self, mut values: &[f64]) {
        while !values.is_empty() {
            let within = self.samples % self.length;
            if within == 0 && self.stretches.len() == STRETCHES {
                self.join_neighbours();
                continue;
            }
            let (part, rest) = values.split_at(values.len().min(self.length - within));
            let stretch = Stretch::of(part, self.samples);
            match self.stretches.last_mut() {
                Some(last) if within > 0 => last.join(stretch),
                _ => self.stretches.push(stretch),
            }
            self.samples += part.len();
            values = rest;
        }
    }

    fn join_neighbours(&mut self) {
        let pairs = self.stretches.chunks(2).map(|pair| {
            let mut joined = pair[0];
            pair[1..].iter().for_each(|other| joined.join(*other));
            joined
        });
        self.stretches = pairs.collect();
        self.length *= 2;
    }

    /// The envelope as a line from extreme to extreme, in seconds.
    pub(super) fn line(&self, start_time: f64, sample_time: f64) -> Vec<(f64, f64)> {
        let mut line = Vec::with_capacity(2 * self.stretches.len());
        for stretch in &self.stretches {
            let (a, b) = match stretch.low.0 <= stretch.high.0 {
                true => (stretch.low, stretch.high),
                false => (stretch.high, stretch.low),
            };
            line.push(a);
            if a.0 != b.0 {
                line.push(b);
            }
        }
        line.into_iter()
            .map(|(k, value)| (start_time + k as f64 * sample_time, value))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(k: usize) -> f64 {
        (k as f64 * 0.37).sin() + 1e-3 * (k % 977) as f64
    }

    #[test]
    fn a_short_signal_is_kept_as_it_is() {
        let mut envelope = Envelope::default();
        envelope.push(&[3.0, 1.0, 2.0]);
        assert_eq!(
            envelope.line(10.0, 0.5),
            [(10.0, 3.0), (10.5, 1.0), (11.0, 2.0)]
        );
    }

    #[test]
    fn blocks_do_not_matter_and_extremes_stay() {
        let values: Vec<f64> = (0..123_457).map(wave).collect();
        let mut whole = Envelope::default();
        whole.push(&values);
        let mut parts = Envelope::default();
        values.chunks(611).for_each(|part| parts.push(part));
        let line = whole.line(0.0, 1.0);
        assert_eq!(line, parts.line(0.0, 1.0));
        assert!(line.len() <= 2 * STRETCHES && line.len() > STRETCHES / 2);
        assert!(line.windows(2).all(|w| w[0].0 < w[1].0));
        let largest = |v: &mut dyn Iterator<Item = f64>| v.fold(f64::MIN, f64::max);
        assert_eq!(
            largest(&mut line.iter().map(|p| p.1)),
            largest(&mut values.iter().copied())
        );
        // Every point is a sample.
        assert!(line.iter().all(|p| values[p.0 as usize] == p.1));
    }
}
