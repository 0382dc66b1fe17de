//! A number with its derivatives in `M` directions.

/// Value and slopes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dual<const M: usize> {
    pub value: f64,
    pub slope: [f64; M],
}

impl<const M: usize> Dual<M> {
    /// A number that depends on nothing.
    #[inline(always)]
    pub fn constant(value: f64) -> Self {
        Self {
            value,
            slope: [0.0; M],
        }
    }

    /// `self + factor * other`
    #[inline(always)]
    pub fn plus(self, factor: f64, other: &Self) -> Self {
        Self {
            value: self.value + factor * other.value,
            slope: std::array::from_fn(|i| self.slope[i] + factor * other.slope[i]),
        }
    }

    /// `self + factor * length * other`, for a length with slopes.
    #[inline(always)]
    pub fn plus_product(self, factor: f64, length: &Self, other: &Self) -> Self {
        let (s, t) = (factor * length.value, factor * other.value);
        Self {
            value: self.value + s * other.value,
            slope: std::array::from_fn(|i| {
                self.slope[i] + s * other.slope[i] + t * length.slope[i]
            }),
        }
    }
}

/// `s * a`
#[inline(always)]
pub(super) fn scaled<const M: usize>(s: f64, a: &[f64; M]) -> [f64; M] {
    std::array::from_fn(|i| s * a[i])
}

/// `s * a + t * b`
#[inline(always)]
pub(super) fn combined<const M: usize>(s: f64, a: &[f64; M], t: f64, b: &[f64; M]) -> [f64; M] {
    std::array::from_fn(|i| s * a[i] + t * b[i])
}
