//! The axes of a picture: ranges, ticks at round numbers, and a power of ten kept out of the tick labels.

use serde::Serialize;

use super::number::{fixed, number, power_of_ten};

/// Width and height of a picture in its own coordinates.
pub(in crate::report) const SIZE: f64 = 100_000.0;

/// A range of numbers along one edge of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::report) struct Axis {
    /// Left or lower end; the decimal logarithm of it on a logarithmic axis.
    from: f64,
    /// Right or upper end, likewise.
    to: f64,
    logarithmic: bool,
}

/// A label on an axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::report) struct Tick {
    /// Per cent of the way from left to right, or from top to bottom.
    pub(in crate::report) at: String,
    /// What it says.
    pub(in crate::report) label: String,
}

/// What the template needs of an axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(in crate::report) struct AxisView {
    from: String,
    to: String,
    logarithmic: bool,
    /// Labels are to be multiplied by ten to this.
    exponent: i32,
    ticks: Vec<Tick>,
    label: String,
    unit: String,
}

impl Axis {
    /// From the smallest to the largest finite value; `None` without any.
    pub(in crate::report) fn over(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let (from, to) = values
            .into_iter()
            .filter(|v| v.is_finite() && v.abs() < 1e100)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            });
        (from <= to).then(|| Self::between(from, to))
    }

    fn between(from: f64, to: f64) -> Self {
        let size = from.abs().max(to.abs());
        let widen = match size {
            0.0 => 1.0,
            size if to - from < 1e-9 * size => 0.05 * size,
            _ => 0.0,
        };
        Self {
            from: from - widen,
            to: to + widen,
            logarithmic: false,
        }
    }

    /// The same with room at both ends.
    pub(in crate::report) fn padded(self) -> Self {
        let room = 0.06 * (self.to - self.from);
        Self {
            from: self.from - room,
            to: self.to + room,
            ..self
        }
    }

    /// The same, logarithmic where the values are positive and span more than a decade and a bit.
    pub(in crate::report) fn logarithmic_if_wide(self) -> Self {
        if self.from > 0.0 && self.to > 20.0 * self.from {
            Self {
                from: self.from.log10(),
                to: self.to.log10(),
                logarithmic: true,
            }
        } else {
            self
        }
    }

    /// The same, logarithmic where the values are positive.
    pub(in crate::report) fn logarithmic(self) -> Self {
        if self.from > 0.0 && !self.logarithmic {
            Self {
                from: self.from.log10(),
                to: self.to.log10(),
                logarithmic: true,
            }
        } else {
            self
        }
    }

    /// The value at the lower end.
    pub(in crate::report) fn lowest(&self) -> f64 {
        if self.logarithmic {
            10f64.powf(self.from)
        } else {
            self.from
        }
    }

    /// Where a value lies, 0 at the lower and 1 at the upper end; not finite where it has no place.
    pub(in crate::report) fn share(&self, value: f64) -> f64 {
        let value = if self.logarithmic {
            value.log10()
        } else {
            value
        };
        (value - self.from) / (self.to - self.from)
    }

    /// An interval as shares, cut to the axis; `None` when it lies outside.
    pub(in crate::report) fn cut(&self, from: f64, to: f64) -> Option<(f64, f64)> {
        let below = self.logarithmic && from <= 0.0;
        let a = if below {
            0.0
        } else {
            self.share(from).clamp(0.0, 1.0)
        };
        let b = self.share(to).clamp(0.0, 1.0);
        (a < b).then_some((a, b))
    }

    /// Multiples of three that keep labels short; 0 for ordinary numbers.
    fn exponent(&self) -> i32 {
        let largest = self.from.abs().max(self.to.abs());
        if self.logarithmic || (0.01..1e5).contains(&largest) {
            0
        } else {
            // Ten to a multiple of three, so that the largest label is between 1 and 1000.
            3 * (largest.log10() / 3.0).floor() as i32
        }
    }

    /// Values of about `count` ticks, and the digits that their labels need after the point.
    fn ticks(&self, count: f64) -> Vec<(f64, String)> {
        if self.logarithmic {
            return self.decades();
        }
        let scale = 10f64.powi(self.exponent());
        let (from, to) = (self.from / scale, self.to / scale);
        let step = round_step((to - from) / count);
        let decimals = (-(step * 1.000_001).log10().floor()).max(0.0) as usize;
        let first = (from / step).ceil();
        let last = (to / step).floor();
        let steps = (last - first).clamp(0.0, 20.0) as u32;
        (0..=steps)
            .map(|k| (first + f64::from(k)) * step)
            .filter(|v| (from..=to).contains(v))
            .map(|v| (v * scale, fixed(v, decimals)))
            .collect()
    }

    fn decades(&self) -> Vec<(f64, String)> {
        let between: &[f64] = match self.to - self.from {
            wide if wide > 3.5 => &[1.0],
            _ => &[1.0, 2.0, 5.0],
        };
        let first = self.from.floor().clamp(-99.0, 99.0) as i32;
        let last = self.to.ceil().clamp(-99.0, 99.0) as i32;
        (first..=last)
            .flat_map(|decade| between.iter().map(move |m| (*m, decade)))
            .map(|(m, decade)| (m * 10f64.powi(decade), m, decade))
            .filter(|(v, ..)| (self.from..=self.to).contains(&v.log10()))
            .map(|(v, m, decade)| {
                let bare = m == 1.0 && !(-3..5).contains(&decade);
                (
                    v,
                    if bare {
                        power_of_ten(decade)
                    } else {
                        number(v, 1)
                    },
                )
            })
            .collect()
    }

    /// The axis as the horizontal one of a picture.
    pub(in crate::report) fn horizontal(&self, label: &str, unit: &str) -> AxisView {
        self.view(label, unit, 7.0, |share| share)
    }

    /// The axis as the vertical one of a picture.
    pub(in crate::report) fn vertical(&self, label: &str, unit: &str, count: f64) -> AxisView {
        self.view(label, unit, count, |share| 1.0 - share)
    }

    fn view(&self, label: &str, unit: &str, count: f64, place: fn(f64) -> f64) -> AxisView {
        let exponent = self.exponent();
        let unit = match exponent {
            0 => unit.to_owned(),
            _ => format!("{} {unit}", power_of_ten(exponent))
                .trim_end()
                .to_owned(),
        };
        let ticks = self.ticks(count).into_iter().map(|(value, label)| Tick {
            at: format!("{:.3}", 100.0 * place(self.share(value))),
            label,
        });
        AxisView {
            from: self.from.to_string(),
            to: self.to.to_string(),
            logarithmic: self.logarithmic,
            exponent,
            ticks: ticks.collect(),
            label: label.to_owned(),
            unit,
        }
    }
}

/// 1, 2 or 5 times a power of ten, not below `step`.
fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    let mantissa = step / power;
    let round = match mantissa {
        m if m <= 1.0 => 1.0,
        m if m <= 2.0 => 2.0,
        m if m <= 5.0 => 5.0,
        _ => 10.0,
    };
    round * power
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: Axis) -> Vec<String> {
        axis.ticks(5.0)
            .into_iter()
            .map(|(_, label)| label)
            .collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(
            labels(Axis::between(0.0, 10.0)),
            ["0", "2", "4", "6", "8", "10"]
        );
        assert_eq!(labels(Axis::between(-0.3, 0.3)), ["−0.2", "0.0", "0.2"]);
    }

    #[test]
    fn powers_of_ten_move_into_the_unit() {
        let view = Axis::between(0.0, 4e-6).horizontal("x", "m");
        assert_eq!(view.unit, "10⁻⁶ m");
        assert_eq!(view.ticks.last().map(|t| t.label.as_str()), Some("4"));
    }

    #[test]
    fn decades_on_a_logarithmic_axis() {
        let axis = Axis::between(0.1, 10.0).logarithmic_if_wide();
        assert_eq!(labels(axis), ["0.1", "0.2", "0.5", "1", "2", "5", "10"]);
        assert!((axis.share(1.0) - 0.5).abs() < 1e-12);
        assert_eq!(axis.cut(0.0, 1.0), Some((0.0, 0.5)));
        assert!(!axis.share(-1.0).is_finite());
    }

    #[test]
    fn degenerate_ranges_have_width() {
        assert_eq!(Axis::over([f64::NAN]), None);
        let axis = Axis::over([3.0, 3.0]).unwrap();
        assert!(axis.to > axis.from);
        assert!((axis.share(3.0) - 0.5).abs() < 1e-6);
        assert!(!labels(Axis::over([0.0]).unwrap()).is_empty());
        assert_eq!(axis.cut(5.0, 6.0), None);
    }
}
