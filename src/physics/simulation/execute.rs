//! Value and slopes of one instruction of a tape.

use super::dual::{Dual, combined, scaled};
use super::tape::{Frame, Instruction, Operation};
use crate::physics::expression::{Binary, Function};

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

/// Value and slope of one instruction.
#[inline(always)]
pub(super) fn execute<const M: usize>(x: &Instruction, frame: &Frame<M>) -> Dual<M> {
    let value = |slot: u32| frame.slot[slot as usize].value;
    let slope = |slot: u32| &frame.slot[slot as usize].slope;
    let (a, b) = (value(x.a), value(x.b));
    // d = s da + t db, with what has no derivative left out.
    let both = |s: f64, t: f64| match (x.active[0], x.active[1]) {
        (true, true) => combined(s, slope(x.a), t, slope(x.b)),
        (true, false) => scaled(s, slope(x.a)),
        (false, true) => scaled(t, slope(x.b)),
        (false, false) => [0.0; M],
    };
    let one = |v: f64, s: f64| Dual {
        value: v,
        slope: if x.active[0] {
            scaled(s, slope(x.a))
        } else {
            [0.0; M]
        },
    };
    let two = |v: f64, s: f64, t: f64| Dual {
        value: v,
        slope: both(s, t),
    };
    match x.operation {
        Operation::Binary(operator) => match operator {
            Binary::Add => two(a + b, 1.0, 1.0),
            Binary::Subtract => two(a - b, 1.0, -1.0),
            Binary::Multiply => two(a * b, b, a),
            Binary::Divide => {
                let q = a / b;
                two(q, 1.0 / b, -q / b)
            }
            Binary::Power => {
                let p = a.powf(b);
                let da = if b == 0.0 { 0.0 } else { b * a.powf(b - 1.0) };
                let db = if x.active[1] && a > 0.0 {
                    p * a.ln()
                } else {
                    0.0
                };
                two(
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
                    two(a, 1.0, 0.0)
                } else {
                    two(b, 0.0, 1.0)
                }
            }
            Binary::Atan2 => {
                let r = a * a + b * b;
                let g = if r > 0.0 { 1.0 / r } else { 0.0 };
                two(a.atan2(b), b * g, -a * g)
            }
            Binary::And => two(a * b, b, a),
            Binary::Or => two(a + b - a * b, 1.0 - b, 1.0 - a),
            Binary::Equal => Dual::constant(f64::from(a == b)),
            Binary::NotEqual => Dual::constant(f64::from(a != b)),
            Binary::Less | Binary::LessOrEqual | Binary::Greater | Binary::GreaterOrEqual => {
                Dual::constant(f64::NAN) // compiled to `Switch`
            }
        },
        Operation::Negate => one(-a, -1.0),
        Operation::Not => one(1.0 - a, -1.0),
        Operation::PowerInteger(n) => match n {
            2 => one(a * a, 2.0 * a),
            _ => one(
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
            one(2.0 * r - 1.0, 2.0 * s)
        }
        Operation::Switch { index, less, equal } => {
            let width = frame.width[index as usize];
            if a == b && width == 0.0 {
                return Dual::constant(f64::from(equal));
            }
            let (r, s) = ramp(if less { b - a } else { a - b }, width);
            let s = if less { -s } else { s };
            two(r, s, -s)
        }
        Operation::If => {
            let (b, c) = (value(x.b), value(x.c));
            let side = |slot: u32, active: bool, v: f64| Dual {
                value: v,
                slope: if active { *slope(slot) } else { [0.0; M] },
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
                        let s = slope(slot);
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
        Operation::Call(f) => match f {
            Function::Sin => one(a.sin(), a.cos()),
            Function::Cos => one(a.cos(), -a.sin()),
            Function::Tan => {
                let t = a.tan();
                one(t, 1.0 + t * t)
            }
            Function::Asin => one(a.asin(), 1.0 / (1.0 - a * a).sqrt()),
            Function::Acos => one(a.acos(), -1.0 / (1.0 - a * a).sqrt()),
            Function::Atan => one(a.atan(), 1.0 / (1.0 + a * a)),
            Function::Sinh => one(a.sinh(), a.cosh()),
            Function::Cosh => one(a.cosh(), a.sinh()),
            Function::Tanh => {
                let t = a.tanh();
                one(t, 1.0 - t * t)
            }
            Function::Exp => {
                let e = a.exp();
                one(e, e)
            }
            Function::Log => one(a.ln(), 1.0 / a),
            Function::Log10 => one(a.log10(), std::f64::consts::LOG10_E / a),
            Function::Sqrt => {
                let r = a.sqrt();
                // At an empty tank the slope is infinite; the flow is zero on both sides of `sqrt(max(h, 0))`.
                one(r, if r > 0.0 { 0.5 / r } else { 0.0 })
            }
            Function::Abs => one(
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
