//! A number with its derivatives in `M` directions.

/// Value and slopes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dual<const M: usize> {
    pub(super) value: f64,
    pub(super) slope: [f64; M],
}

impl<const M: usize> Dual<M> {
    /// A number that depends on nothing.
    #[inline(always)]
    pub(crate) fn constant(value: f64) -> Self {
        Self {
            value,
            slope: [0.0; M],
        }
    }

    /// `self + factor * other`
    #[inline(always)]
    pub(crate) fn plus(self, factor: f64, other: &Self) -> Self {
        let mut sum = self;
        sum.value += factor * other.value;
        for (s, o) in sum.slope.iter_mut().zip(&other.slope) {
            *s += factor * o;
        }
        sum
    }

    /// `self + factor * length * other`, for a length with slopes.
    #[inline(always)]
    pub(crate) fn plus_product(self, factor: f64, length: &Self, other: &Self) -> Self {
        let (s, t) = (factor * length.value, factor * other.value);
        let mut sum = self;
        sum.value += s * other.value;
        for (to, (o, l)) in sum
            .slope
            .iter_mut()
            .zip(other.slope.iter().zip(&length.slope))
        {
            *to = *to + s * o + t * l;
        }
        sum
    }
}

/// `s * a`
#[inline(always)]
pub(super) fn scaled<const M: usize>(s: f64, a: &[f64; M]) -> [f64; M] {
    let mut product = *a;
    product.iter_mut().for_each(|p| *p *= s);
    product
}

/// `s * a + t * b`
#[inline(always)]
pub(super) fn combined<const M: usize>(s: f64, a: &[f64; M], t: f64, b: &[f64; M]) -> [f64; M] {
    let mut sum = *a;
    for (to, b) in sum.iter_mut().zip(b) {
        *to = s * *to + t * b;
    }
    sum
}
