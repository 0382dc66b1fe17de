//! Outputs that were exchanged, and factors between the numbers of a recording and those of its simulation: a sign, a unit.

/// With outputs exchanged, the error of each must be less than this share of what it is.
const MUCH_BETTER: f64 = 0.25;
/// And no more than this share of the output.
const MOSTLY: f64 = 0.5;
/// A sign, or a factor that no other physics makes, is looked for where it explains this share of the recording ...
const FOLLOWS: f64 = 0.8;
/// ... and one that a lost gain could be, where it explains nearly all.
const NEARLY_ALL: f64 = 0.97;
/// Factors from this on (or below its inverse) are no gain that physics loses.
const ONLY_UNITS: f64 = 20.0;
/// A factor is in the list within three of its standard errors, no closer than this (gains of sensors have some tenths
/// of a percent) ...
const CLOSE: f64 = 0.005;
/// ... and not further off.
const FAR: f64 = 0.02;
/// Signals of below average size have the same gain to this share.
const UNIFORM: f64 = 0.03;
/// Blocks over which the error of a factor is estimated.
const BLOCKS: usize = 20;
/// An offset below this share of the recording's standard deviation is none of units.
const NO_OFFSET: f64 = 0.3;

/// A conversion: `recording = factor simulation + offset`.
struct Conversion {
    factor: f64,
    offset: f64,
    words: &'static str,
}

const fn of(factor: f64, words: &'static str) -> Conversion {
    Conversion {
        factor,
        offset: 0.0,
        words,
    }
}

/// Conversions between units in use; none that another gain of 1.5 could be.
const CONVERSIONS: &[Conversion] = &[
    of(57.295_779_513_082_32, "deg per rad"),
    of(9.549_296_585_513_72, "rpm per rad/s"),
    of(std::f64::consts::TAU, "rad per turn, or rad/s per Hz"),
    of(360.0, "deg per turn"),
    of(6.0, "deg/s per rpm"),
    of(3.6, "km/h per m/s, or m3/h per l/s"),
    of(1000.0, "a thousand: mm per m, ms per s, mV per V"),
    of(1e6, "a million: um per m, Pa per MPa"),
    of(100.0, "a hundred: percent per unit, cm per m, kPa per bar"),
    of(10.0, "ten: bar per MPa, mm per cm"),
    of(60.0, "sixty: rpm per Hz, minutes"),
    of(3600.0, "3600: seconds per hour"),
    of(1e5, "Pa per bar"),
    of(1e4, "cm2 per m2"),
    of(14.503_773_773, "psi per bar"),
    of(6.894_757_293, "kPa per psi"),
    of(101.325, "kPa per atm"),
    of(133.322, "Pa per mmHg"),
    of(16.666_666_667, "l/min per m3/h"),
    of(25.4, "mm per inch"),
    of(9.806_65, "N per kgf, or m/s2 per g"),
    Conversion {
        factor: 1.8,
        offset: 32.0,
        words: "degF from degC",
    },
    Conversion {
        factor: 1.0,
        offset: 273.15,
        words: "K from degC",
    },
];

/// What turns the simulation into what was recorded: `recording = factor simulation + offset`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Relation {
    pub(crate) factor: f64,
    pub(crate) offset: f64,
    pub(crate) reversed: bool,
    /// Of the units: `deg per rad`.
    pub(crate) unit: Option<String>,
}

/// Recording and simulation of one output, recording by recording.
pub(crate) type Pairs<'a> = Vec<(&'a [f64], &'a [f64])>;

/// Mean square error over the variance of what was recorded.
fn error(pairs: &Pairs) -> f64 {
    let variance: f64 = spread(pairs.iter().flat_map(|p| p.0.iter().copied()));
    let square: f64 = pairs
        .iter()
        .flat_map(|(y, s)| y.iter().zip(*s))
        .map(|(y, s)| (y - s) * (y - s))
        .sum();
    square / variance.max(1e-300)
}

/// Sum of squares about the mean.
fn spread(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / n;
    values.map(|v| (v - mean).powi(2)).sum()
}

/// The pair of outputs that were exchanged: `pairs(recorded, simulated)` are the columns of two outputs.
pub(crate) fn exchanged<'a>(
    outputs: usize,
    pairs: impl Fn(usize, usize) -> Pairs<'a>,
) -> Option<(usize, usize)> {
    let mut best = None;
    for i in 0..outputs {
        for j in i + 1..outputs {
            let straight = [error(&pairs(i, i)), error(&pairs(j, j))];
            let crossed = [error(&pairs(i, j)), error(&pairs(j, i))];
            let better = (0..2).all(|k| crossed[k] < MUCH_BETTER * straight[k]);
            let size = crossed[0].max(crossed[1]);
            if better && size < MOSTLY && best.is_none_or(|(least, _)| size < least) {
                best = Some((size, (i, j)));
            }
        }
    }
    best.map(|(_, pair)| pair)
}

/// A sign or a unit between recording and simulation; `None` where they agree, or differ by no listed factor.
pub(crate) fn relation(pairs: &Pairs) -> Option<Relation> {
    let count: usize = pairs.iter().map(|p| p.0.len()).sum();
    let n = count as f64;
    let all = || pairs.iter().flat_map(|(y, s)| y.iter().zip(*s));
    let (sum_y, sum_s) = all().fold((0.0, 0.0), |(a, b), (y, s)| (a + y, b + s));
    let (mean_y, mean_s) = (sum_y / n, sum_s / n);
    let (ss, sy, yy) = all().fold((0.0, 0.0, 0.0), |(ss, sy, yy), (y, s)| {
        let (y, s) = (y - mean_y, s - mean_s);
        (ss + s * s, sy + s * y, yy + y * y)
    });
    if ss <= 0.0 || yy <= 0.0 || sy * sy < FOLLOWS * ss * yy {
        return None;
    }
    let gain = sy / ss;
    let offset = mean_y - gain * mean_s;
    // Blocks of samples err independently, whatever the colour of the noise.
    let block = count.div_ceil(BLOCKS).max(1);
    let errors: Vec<f64> = all()
        .map(|(y, s)| (s - mean_s) * (y - mean_y - gain * (s - mean_s)))
        .collect();
    let scatter: f64 = errors
        .chunks(block)
        .map(|c| c.iter().sum::<f64>().powi(2))
        .sum();
    let std = scatter.sqrt() / ss / gain.abs();
    let close = (3.0 * std).clamp(CLOSE, FAR);
    let deviation = (yy / n).sqrt();
    let reversed = gain < 0.0;
    let explained = sy * sy / (ss * yy);
    let candidates = CONVERSIONS.iter().flat_map(|c| {
        let forth = (c.factor, c.offset, c.words.to_owned());
        let back = (
            1.0 / c.factor,
            -c.offset / c.factor,
            if c.offset == 0.0 {
                format!("1/{} ({}, the other way round)", c.factor, c.words)
            } else {
                format!("{}, the other way round", c.words)
            },
        );
        [forth, back]
    });
    let fits = |(factor, shift, _): &(f64, f64, String)| {
        let off = (gain.abs() / factor - 1.0).abs();
        // Without the shift the same factor converts differences.
        let expected = mean_y - factor * gain.signum() * mean_s;
        let shifted = (expected - shift).abs() < NO_OFFSET.min(1.0) * deviation.min(shift.abs());
        let plain = expected.abs() < NO_OFFSET * deviation;
        let agrees = if *shift == 0.0 { plain } else { shifted };
        let could_be_physics =
            (1.0 / ONLY_UNITS..ONLY_UNITS).contains(factor) && explained < NEARLY_ALL;
        off < close && !could_be_physics && (agrees || (plain && *factor > 1.1))
    };
    // Dead zones and limits lose more of small or of large signals: a unit does not.
    let size = (ss / n).sqrt();
    let (small_ss, small_sy) = all()
        .map(|(y, s)| (y - mean_y, s - mean_s))
        .filter(|(_, s)| s.abs() < size)
        .fold((0.0, 0.0), |(ss, sy), (y, s)| (ss + s * s, sy + s * y));
    let uniform = (small_sy / small_ss / gain - 1.0).abs() < UNIFORM + 10.0 * std;
    let unit = candidates.filter(|_| uniform).filter(fits).min_by(|a, b| {
        let off = |f: f64| (gain.abs() / f).ln().abs();
        off(a.0).total_cmp(&off(b.0))
    });
    if unit.is_none() && !reversed {
        return None;
    }
    let sign = gain.signum();
    let (factor, shift, words) = unit.map_or((1.0, 0.0, None), |(f, b, w)| (f, b, Some(w)));
    let shift = if shift != 0.0 && (mean_y - sign * factor * mean_s - shift).abs() < deviation {
        shift
    } else if reversed && offset.abs() > NO_OFFSET * deviation {
        // Reversed about an operating point.
        mean_y - sign * factor * mean_s
    } else {
        0.0
    };
    Some(Relation {
        factor: sign * factor,
        offset: shift,
        reversed,
        unit: words,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signal(k: usize) -> f64 {
        let t = k as f64;
        (0.031 * t).sin() + 0.6 * (0.0713 * t + 1.0).sin()
    }

    fn related(of: impl Fn(usize) -> f64) -> Option<Relation> {
        let y: Vec<f64> = (0..1500).map(&of).collect();
        let s: Vec<f64> = (0..1500).map(signal).collect();
        relation(&vec![(&y, &s)])
    }

    #[test]
    fn signs_and_units_are_found() {
        let noise = |k: usize| 0.05 * (1.7 * k as f64).sin();
        for (factor, words) in [
            (57.295_78, "deg per rad"),
            (9.5493, "rpm"),
            (3.6, "km/h"),
            (1000.0, "thousand"),
            (0.01, "hundred"),
            (6.894_76, "psi"),
        ] {
            let found = related(|k| factor * (signal(k) + noise(k))).unwrap();
            assert!((found.factor / factor - 1.0).abs() < 1e-4 && !found.reversed);
            assert!(found.unit.unwrap().contains(words), "{factor}");
        }
        let found = related(|k| noise(k) - signal(k)).unwrap();
        assert!(found.reversed && found.unit.is_none() && found.factor == -1.0);
        let found = related(|k| 1.8 * signal(k) + 32.0 + noise(k)).unwrap();
        assert!((found.factor, found.offset) == (1.8, 32.0), "{found:?}");
    }

    #[test]
    fn other_gains_and_other_physics_are_no_units() {
        for gain in [0.9, 1.0, 1.07, 1.3, 2.0, 5.0] {
            assert_eq!(related(|k| gain * signal(k)), None, "{gain}");
        }
        // A dead zone that leaves the gain of mph per m/s.
        assert_eq!(
            related(|k| signal(k).signum() * (signal(k).abs() - 0.6).max(0.0)),
            None
        );
    }

    #[test]
    fn exchanged_outputs_are_found() {
        let a: Vec<f64> = (0..1500).map(signal).collect();
        let b: Vec<f64> = (0..1500).map(|k| 0.7 * signal(3 * k + 50)).collect();
        let (ya, yb): (Vec<f64>, Vec<f64>) = (
            b.iter().map(|v| 1.05 * v).collect(),
            a.iter().map(|v| 0.98 * v).collect(),
        );
        let (y, s) = ([&ya, &yb], [&a, &b]);
        assert_eq!(exchanged(2, |i, j| vec![(y[i], s[j])]), Some((0, 1)));
        assert_eq!(exchanged(2, |i, j| vec![(s[i], s[j])]), None);
    }
}
