//! Decimal text to the nearest `f64`.
//!
//! Parsing numbers is most of the time of reading a log, and a log is mostly short decimals. Two exact shortcuts cover
//! nearly every number written by people and programs; all others go to `fast-float2`.
//!
//! 1. A mantissa below 2^53 and a power of ten up to 10^22 are both exact doubles, so one division or multiplication
//!    rounds once and is correct (W. D. Clinger, *How to read floating point numbers accurately*, 1990).
//! 2. Up to 19 digits divided by 10^k, k <= 27: a 64 x 64 bit product with a truncated reciprocal of 5^k. Its error is
//!    below one unit of the upper word, so the rounding is certain unless the bits below the last one sit next to a
//!    half (the idea of D. Lemire, *Number parsing at a gigabyte per second*, 2021, with only the table needed here).

/// Powers of ten that are exact doubles.
const EXACT_POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// Entry k: (r, s) with r = floor(2^(127 - s) / 5^k), normalised to 2^63 <= r < 2^64.
const RECIPROCALS: [(u64, i32); 28] = {
    let mut table = [(1 << 63, 64); 28];
    let mut power: u128 = 1;
    let mut k = 1;
    while k < table.len() {
        power *= 5;
        let quotient = (1_u128 << 127) / power;
        let shift = 64 - quotient.leading_zeros();
        table[k] = ((quotient >> shift) as u64, shift as i32);
        k += 1;
    }
    table
};

/// 10^n for up to eight digits; sixteen entries so that a masked index needs no check.
const SMALL_POWERS: [u64; 16] = [
    1,
    10,
    100,
    1_000,
    10_000,
    100_000,
    1_000_000,
    10_000_000,
    100_000_000,
    0,
    0,
    0,
    0,
    0,
    0,
    0,
];

/// Reads the number at the start of `bytes`: the value and how many bytes it took.
///
/// Accepts `[+-] digits [. digits] [e [+-] digits]` with a digit before or after the point. `None` when there is no
/// such number or when it is too large for a double; what follows the number is for the caller to judge.
#[inline]
pub(crate) fn read(bytes: &[u8]) -> Option<(f64, usize)> {
    let mut at = 0;
    let negative = match bytes.first()? {
        b'-' => {
            at = 1;
            true
        }
        b'+' => {
            at = 1;
            false
        }
        _ => false,
    };
    let start = at;
    let mut mantissa: u64 = 0;
    while let Some(digit) = digit_at(bytes, at) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
        at += 1;
    }
    let mut digits = at - start;
    // Nineteen digits cannot wrap around, so zero is zero only up to there.
    let mut significant = if mantissa == 0 && digits <= 19 {
        0
    } else {
        digits
    };
    let mut exponent: i64 = 0;
    if bytes.get(at) == Some(&b'.') {
        at += 1;
        let point = at;
        if significant == 0 {
            // Zeros before the first digit that counts do not use up the nineteen digits.
            while bytes.get(at) == Some(&b'0') {
                at += 1;
            }
        }
        let first = at;
        (mantissa, at) = more_digits(bytes, at, mantissa);
        significant += at - first;
        digits += at - point;
        exponent = -i64::try_from(at - point).ok()?;
    }
    if digits == 0 {
        return None;
    }
    if let Some(b'e' | b'E') = bytes.get(at) {
        let (power, end) = read_exponent(bytes, at + 1)?;
        exponent += power;
        at = end;
    }
    let exact = if significant <= 19 {
        scale(mantissa, exponent)
    } else {
        None
    };
    let value = match exact {
        Some(value) => value,
        None => {
            let text = bytes.get(start..at)?;
            fast_float2::parse::<f64, _>(text)
                .ok()
                .filter(|value| value.is_finite())?
        }
    };
    Some((if negative { -value } else { value }, at))
}

/// The finite number that all of `cell` is, if it is one.
pub(crate) fn finite(cell: &[u8]) -> Option<f64> {
    read(cell)
        .filter(|(_, used)| *used == cell.len())
        .map(|(value, _)| value)
}

/// The value of the digit at `at`, if there is one.
#[inline]
fn digit_at(bytes: &[u8], at: usize) -> Option<u64> {
    let digit = bytes.get(at)?.wrapping_sub(b'0');
    (digit <= 9).then_some(u64::from(digit))
}

/// Appends the digits from `at` on to `mantissa` (which wraps beyond nineteen digits); returns where they end.
/// Takes eight bytes a step, whatever their number of digits is, because a branch a digit is what parsing costs.
#[inline]
fn more_digits(bytes: &[u8], mut at: usize, mut mantissa: u64) -> (u64, usize) {
    while let Some(eight) = bytes
        .get(at..at + 8)
        .and_then(|eight| <[u8; 8]>::try_from(eight).ok())
    {
        // Each byte less b'0': a digit is now 0..=9; the lowest high bit set below marks the first byte that is not.
        let values = u64::from_le_bytes(eight) ^ 0x3030_3030_3030_3030;
        let others = (values.wrapping_add(0x7676_7676_7676_7676) | values) & 0x8080_8080_8080_8080;
        if others == 0 {
            mantissa = mantissa
                .wrapping_mul(100_000_000)
                .wrapping_add(eight_digits(values));
            at += 8;
            continue;
        }
        let count = others.trailing_zeros() / 8;
        if count > 0 {
            let aligned = values << (64 - 8 * count);
            let power = SMALL_POWERS[count as usize & 15];
            mantissa = mantissa
                .wrapping_mul(power)
                .wrapping_add(eight_digits(aligned));
        }
        return (mantissa, at + count as usize);
    }
    while let Some(digit) = digit_at(bytes, at) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(digit);
        at += 1;
    }
    (mantissa, at)
}

/// The number whose eight digits are the bytes of `values`, the first in the lowest byte.
#[inline]
fn eight_digits(values: u64) -> u64 {
    let pairs = values.wrapping_mul(10).wrapping_add(values >> 8);
    let low = (pairs & 0x0000_00FF_0000_00FF).wrapping_mul(0x000F_4240_0000_0064);
    let high = ((pairs >> 16) & 0x0000_00FF_0000_00FF).wrapping_mul(0x0000_2710_0000_0001);
    low.wrapping_add(high) >> 32
}

/// The exponent after `e`, and where it ends.
fn read_exponent(bytes: &[u8], mut at: usize) -> Option<(i64, usize)> {
    let negative = bytes.get(at) == Some(&b'-');
    if negative || bytes.get(at) == Some(&b'+') {
        at += 1;
    }
    let start = at;
    let mut power: i64 = 0;
    while let Some(digit) = digit_at(bytes, at) {
        power = power
            .saturating_mul(10)
            .saturating_add(digit as i64)
            .min(1_000_000);
        at += 1;
    }
    (at > start).then_some((if negative { -power } else { power }, at))
}

/// `mantissa` x 10^`exponent`, rounded to nearest even, or `None` where the shortcuts do not reach.
#[inline]
fn scale(mantissa: u64, exponent: i64) -> Option<f64> {
    let size = usize::try_from(exponent.unsigned_abs()).ok()?;
    if mantissa <= 1 << 53
        && let Some(power) = EXACT_POWERS.get(size)
    {
        let mantissa = mantissa as f64;
        return Some(if exponent < 0 {
            mantissa / power
        } else {
            mantissa * power
        });
    }
    if mantissa == 0 {
        return Some(0.0);
    }
    if exponent == 0 {
        return Some(mantissa as f64);
    }
    if exponent > 0 {
        return None;
    }
    let (reciprocal, shift) = *RECIPROCALS.get(size)?;
    let zeros = mantissa.leading_zeros();
    let product = u128::from(mantissa << zeros) * u128::from(reciprocal);
    let upper = (product >> 64) as u64;
    // 53 bits are kept; `below` are those under them. The true product lies in [product, product + 2^64).
    let drop = 11 - upper.leading_zeros();
    let half = 1_u64 << (drop - 1);
    let below = upper & ((1 << drop) - 1);
    if below == half || below == half - 1 {
        return None;
    }
    let kept = (upper >> drop) + u64::from(below > half);
    let power = 64 - zeros as i32 - 127 + shift - size as i32 + drop as i32;
    // kept < 2^54 is exact, and the power of two is normal: -27 - 127 < power < 64.
    let two_to = f64::from_bits(((1023 + power) as u64) << 52);
    Some(kept as f64 * two_to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn agrees(text: &str) {
        let (value, used) = read(text.as_bytes()).unwrap_or_else(|| panic!("{text} is a number"));
        assert_eq!(used, text.len(), "{text}");
        assert_eq!(
            value.to_bits(),
            text.parse::<f64>().unwrap().to_bits(),
            "{text}"
        );
    }

    #[test]
    fn reads_what_the_standard_library_reads() {
        for text in [
            "0",
            "-0",
            "-0.0",
            "1",
            "+1",
            "-1.234567",
            ".5",
            "5.",
            "1e3",
            "1E-3",
            "1.5e+3",
            "9007199254740993",
            "9007199254740993.0",
            "0.30000000000000004",
            "123456789012345678",
            "1234567890123456789012345",
            "1e22",
            "1e23",
            "8.5e-300",
            "5e-324",
            "2.2250738585072011e-308",
            "1.7976931348623157e308",
            "0.000000000000000001234",
            "00000000000000000000000001.5",
            "0.1e-10",
            "179769313486231570000000000000",
            "18446744073709551615",
            "18446744073709551616",
            "9.5367431640625e-07",
            "0.5000000000000000000000000000000000000000000000001",
        ] {
            agrees(text);
        }
    }

    #[test]
    fn refuses_what_is_no_number() {
        for text in [
            "", "-", "+", ".", "e5", "1e", "1e+", "-.", "nan", "inf", "x", "1e400",
        ] {
            assert_eq!(read(text.as_bytes()), None, "{text}");
        }
        assert_eq!(read(b"12,5"), Some((12.0, 2)));
        assert_eq!(read(b"+-5"), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn any_double_is_read_back(bits in any::<u64>()) {
            let value = f64::from_bits(bits);
            prop_assume!(value.is_finite());
            agrees(&format!("{value:e}"));
            agrees(&format!("{value:?}"));
        }

        #[test]
        fn ordinary_doubles_are_read_back(value in -1e4..1e4_f64) {
            agrees(&format!("{value}"));
            agrees(&format!("{value:.18e}"));
            agrees(&format!("{value:.6}"));
        }

        #[test]
        fn any_digits_round_as_the_standard_library_does(mantissa in any::<u64>(), exponent in -40..40_i32, cut in 0..64) {
            agrees(&format!("{}e{exponent}", mantissa >> cut));
        }

        #[test]
        fn ties_round_as_the_standard_library_does(mantissa in (1_u64 << 53)..(1 << 54), k in 1..12_u32) {
            // An odd multiple of half a unit, divided by a power of two: exactly between two doubles.
            let odd = mantissa | 1;
            agrees(&format!("{}", odd));
            let halves = u128::from(odd) * 5_u128.pow(k);
            agrees(&format!("{halves}e-{k}"));
        }
    }
}
