//! Bytes as a supply of choices: what a fuzzer mutates, decoded by hand so that fuzz targets and proptest share it.

/// Numbers that break things, beside ordinary ones.
const NUMBERS: [f64; 20] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    1e-9,
    1e9,
    1e18,
    -1e18,
    1e154,
    1e308,
    -1e308,
    f64::MAX,
    f64::MIN_POSITIVE,
    5e-324,
    -1e-310,
    1e-300,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
];

/// Counts that break things.
const COUNTS: [usize; 8] = [
    0,
    1,
    255,
    65_536,
    1_000_000_000,
    1_000_000_000_000_000_000,
    usize::MAX / 2,
    usize::MAX,
];

/// Reads choices off a slice; when that is used up, every choice is the first.
#[derive(Debug, Clone)]
pub struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn rest(&self) -> &'a [u8] {
        self.0
    }

    pub fn byte(&mut self) -> u8 {
        match self.0 {
            [first, rest @ ..] => {
                self.0 = rest;
                *first
            }
            [] => 0,
        }
    }

    pub fn flag(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    /// One of `0..count`, which is not empty.
    pub fn below(&mut self, count: usize) -> usize {
        let wide = count > 256;
        let high = if wide { usize::from(self.byte()) } else { 0 };
        (256 * high + usize::from(self.byte())) % count
    }

    pub fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }

    /// Half of the time nothing.
    pub fn maybe<T>(&mut self, choose: impl FnOnce(&mut Self) -> T) -> Option<T> {
        self.flag().then(|| choose(self))
    }

    pub fn word(&mut self) -> u64 {
        (0..8).fold(0, |word, _| word << 8 | u64::from(self.byte()))
    }

    /// Any number there is, with those that break things often.
    pub fn number(&mut self) -> f64 {
        match self.byte() {
            choice @ 0..=99 => NUMBERS[usize::from(choice) % NUMBERS.len()],
            100..=199 => f64::from(self.byte() as i8) / 16.0,
            200..=239 => f64::from(self.byte() as i8) * 10_f64.powi(i32::from(self.byte() as i8)),
            _ => f64::from_bits(self.word()),
        }
    }

    /// A number that is one.
    pub fn finite(&mut self) -> f64 {
        let number = self.number();
        if number.is_finite() { number } else { 1.0 }
    }

    /// A count: mostly a small one.
    pub fn count(&mut self) -> usize {
        match self.byte() {
            small @ 0..=223 => usize::from(small) % 32,
            _ => self.one_of(&COUNTS),
        }
    }
}
