//! Numbers that carry their derivatives.

use std::ops::{Add, Mul, Sub};

use super::{NUMBERS, Quantity};

/// Derivatives a value carries: by each number, then by both initial levels of its record.
pub(super) const SLOTS: usize = NUMBERS + 2;

/// A number with its derivatives.
#[derive(Debug, Clone, Copy)]
pub(super) struct Jet {
    pub(super) value: f64,
    pub(super) slopes: [f64; SLOTS],
}

impl Jet {
    pub(crate) fn variable(value: f64, slot: usize) -> Self {
        Self {
            value,
            slopes: std::array::from_fn(|i| f64::from(u8::from(i == slot))),
        }
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            slopes: std::array::from_fn(|i| self.slopes[i] + other.slopes[i]),
        }
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self {
            value: self.value - other.value,
            slopes: std::array::from_fn(|i| self.slopes[i] - other.slopes[i]),
        }
    }
}

impl Mul for Jet {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let mine = self.through(self.value * other.value, other.value);
        mine + other.through(0.0, self.value)
    }
}

impl Quantity for Jet {
    fn value(self) -> f64 {
        self.value
    }

    fn times(self, factor: f64) -> Self {
        self.through(self.value * factor, factor)
    }

    fn through(self, value: f64, derivative: f64) -> Self {
        Self {
            value,
            slopes: self.slopes.map(|s| s * derivative),
        }
    }
}
