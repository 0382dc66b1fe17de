//! Value and slopes of one instruction of a tape.

use super::{CurveSlots, Frame, Instruction, Operation};
use crate::physics::expression::{Binary, Function};
use crate::physics::simulation::dual::{Dual, combined, scaled};

/// Position on the ramp from 0 (`z` below `-width`) to 1 (above `width`), and its slope: a cubic, whose slope is continuous,
/// so that few steps integrate it.
#[inline(always)]
fn ramp(z: f64, width: f64) -> (f64, f64) {
    if z >= width {
        (1.0, 0.0)
    } else if z <= -width {
        (0.0, 0.0)
    } else {
        let s = z / width;
        (
            0.5 + s * (0.75 - 0.25 * s * s),
            0.75 * (1.0 - s * s) / width,
        )
    }
}

/// An instruction and the values that it reads.
struct Operands<'a, const M: usize> {
    x: &'a Instruction,
    frame: &'a Frame<M>,
}

impl<const M: usize> Operands<'_, M> {
    #[inline(always)]
    fn value(&self, slot: u32) -> f64 {
        self.frame.slot[slot as usize].value
    }

    #[inline(always)]
    fn slope(&self, slot: u32) -> &[f64; M] {
        &self.frame.slot[slot as usize].slope
    }

    /// A function of the first operand with this value and derivative.
    #[inline(always)]
    fn one(&self, value: f64, s: f64) -> Dual<M> {
        let slope = if self.x.active[0] {
            scaled(s, self.slope(self.x.a))
        } else {
            [0.0; M]
        };
        Dual { value, slope }
    }

    /// A function of two operands, with its derivatives by each; what has no slopes is left out.
    #[inline(always)]
    fn two(&self, value: f64, s: f64, t: f64) -> Dual<M> {
        let (a, b) = (self.x.a, self.x.b);
        let slope = match (self.x.active[0], self.x.active[1]) {
            (true, true) => combined(s, self.slope(a), t, self.slope(b)),
            (true, false) => scaled(s, self.slope(a)),
            (false, true) => scaled(t, self.slope(b)),
            (false, false) => [0.0; M],
        };
        Dual { value, slope }
    }

    /// A curve of straight pieces where its argument is `z`; level beyond the ends.
    #[inline(always)]
    fn curve(&self, curve: &CurveSlots, z: f64) -> Dual<M> {
        let knots = &curve.knots;
        let last = knots.len() - 1;
        let after = knots.partition_point(|k| *k <= z).clamp(1, last);
        let width = knots[after] - knots[after - 1];
        let part = ((z - knots[after - 1]) / width).clamp(0.0, 1.0);
        let (low, high) = (curve.values[after - 1], curve.values[after]);
        let (a, b) = (self.value(low), self.value(high));
        let mut slope = if self.x.active[1] {
            combined(1.0 - part, self.slope(low), part, self.slope(high))
        } else {
            [0.0; M]
        };
        let inside = z > knots[0] && z < knots[last];
        if self.x.active[0] && inside {
            slope = combined(1.0, &slope, (b - a) / width, self.slope(self.x.a));
        }
        Dual {
            value: (1.0 - part) * a + part * b,
            slope,
        }
    }
}

/// Value and slope of one instruction.
#[inline(always)]
pub(super) fn execute<const M: usize>(
    x: &Instruction,
    frame: &Frame<M>,
    curves: &[CurveSlots],
) -> Dual<M> {
    let of = Operands { x, frame };
    let (a, b) = (of.value(x.a), of.value(x.b));
    match x.operation {
        Operation::Binary(operator) => match operator {
            Binary::Add => of.two(a + b, 1.0, 1.0),
            Binary::Subtract => of.two(a - b, 1.0, -1.0),
            Binary::Multiply => of.two(a * b, b, a),
            Binary::Divide => {
                let q = a / b;
                of.two(q, 1.0 / b, -q / b)
            }
            Binary::Power => {
                let p = a.powf(b);
                let da = if b == 0.0 { 0.0 } else { b * a.powf(b - 1.0) };
                let db = if x.active[1] && a > 0.0 {
                    p * a.ln()
                } else {
                    0.0
                };
                of.two(
                    p,
                    if a == 0.0 && b > 0.0 && b < 1.0 {
                        0.0
                    } else {
                        da
                    },
                    db,
                )
            }
            Binary::Min | Binary::Max => {
                let first = if operator == Binary::Min {
                    a <= b
                } else {
                    a >= b
                };
                if first {
                    of.two(a, 1.0, 0.0)
                } else {
                    of.two(b, 0.0, 1.0)
                }
            }
            Binary::Atan2 => {
                let r = a * a + b * b;
                let g = if r > 0.0 { 1.0 / r } else { 0.0 };
                of.two(a.atan2(b), b * g, -a * g)
            }
            Binary::And => of.two(a * b, b, a),
            Binary::Or => of.two(a + b - a * b, 1.0 - b, 1.0 - a),
            Binary::Equal => Dual::constant(f64::from(a == b)),
            Binary::NotEqual => Dual::constant(f64::from(a != b)),
            Binary::Less | Binary::LessOrEqual | Binary::Greater | Binary::GreaterOrEqual => {
                Dual::constant(f64::NAN) // compiled to `Switch`
            }
        },
        Operation::Negate => of.one(-a, -1.0),
        Operation::Not => of.one(1.0 - a, -1.0),
        Operation::PowerInteger(n) => match n {
            2 => of.one(a * a, 2.0 * a),
            _ => of.one(
                a.powi(n),
                if n == 0 {
                    0.0
                } else {
                    f64::from(n) * a.powi(n - 1)
                },
            ),
        },
        Operation::Sign(switch) => {
            let width = frame.width[switch as usize];
            if a == 0.0 && width == 0.0 {
                return Dual::constant(0.0);
            }
            let (r, s) = ramp(a, width);
            of.one(2.0 * r - 1.0, 2.0 * s)
        }
        Operation::Switch { index, less, equal } => {
            let width = frame.width[index as usize];
            if a == b && width == 0.0 {
                return Dual::constant(f64::from(equal));
            }
            let (r, s) = ramp(if less { b - a } else { a - b }, width);
            let s = if less { -s } else { s };
            of.two(r, s, -s)
        }
        Operation::If => {
            let (b, c) = (of.value(x.b), of.value(x.c));
            let side = |slot: u32, active: bool, v: f64| Dual {
                value: v,
                slope: if active { *of.slope(slot) } else { [0.0; M] },
            };
            // On the ramp a side that is not defined there (`if h > 0 then sqrt(h) else 0`) does not count.
            if a >= 1.0 || (a >= 0.5 && !c.is_finite()) {
                side(x.b, x.active[1], b)
            } else if a <= 0.0 || !b.is_finite() {
                side(x.c, x.active[2], c)
            } else {
                let mut d = [0.0; M];
                for (on, slot, weight) in [
                    (x.active[0], x.a, b - c),
                    (x.active[1], x.b, a),
                    (x.active[2], x.c, 1.0 - a),
                ] {
                    if on {
                        let s = of.slope(slot);
                        for i in 0..M {
                            d[i] += weight * s[i];
                        }
                    }
                }
                Dual {
                    value: a * b + (1.0 - a) * c,
                    slope: d,
                }
            }
        }
        Operation::Curve(index) => of.curve(&curves[index as usize], a),
        Operation::Call(f) => match f {
            Function::Sin => of.one(a.sin(), a.cos()),
            Function::Cos => of.one(a.cos(), -a.sin()),
            Function::Tan => {
                let t = a.tan();
                of.one(t, 1.0 + t * t)
            }
            Function::Asin => of.one(a.asin(), 1.0 / (1.0 - a * a).sqrt()),
            Function::Acos => of.one(a.acos(), -1.0 / (1.0 - a * a).sqrt()),
            Function::Atan => of.one(a.atan(), 1.0 / (1.0 + a * a)),
            Function::Sinh => of.one(a.sinh(), a.cosh()),
            Function::Cosh => of.one(a.cosh(), a.sinh()),
            Function::Tanh => {
                let t = a.tanh();
                of.one(t, 1.0 - t * t)
            }
            Function::Exp => {
                let e = a.exp();
                of.one(e, e)
            }
            Function::Log => of.one(a.ln(), 1.0 / a),
            Function::Log10 => of.one(a.log10(), std::f64::consts::LOG10_E / a),
            Function::Sqrt => {
                let r = a.sqrt();
                // At an empty tank the slope is infinite; the flow is zero on both sides of `sqrt(max(h, 0))`.
                of.one(r, if r > 0.0 { 0.5 / r } else { 0.0 })
            }
            Function::Abs => of.one(
                a.abs(),
                if a > 0.0 {
                    1.0
                } else if a < 0.0 {
                    -1.0
                } else {
                    0.0
                },
            ),
            Function::Sign => Dual::constant(f64::NAN), // compiled to `Sign`
        },
    }
}
