//! Forms of terms with one shape more, where their physics has one.

use super::library::{ABOVE, BACKLASH, BELOW, HYSTERESIS, STICTION, STOP, hysteresis};
use super::term::Needs::{Anything, BothSigns};
use super::term::Port::Equation;
use super::term::{Memory, MemoryStart, Shape, Starts, Term, curve, in_place, sampled, shape};

/// The form of a term with one shape more: a contact has damping in proportion to its depth (K. H. Hunt and F. R. E. Crossley,
/// *J. Appl. Mech.* 42, 1975), and an actuator with play, stiction or hysteresis a lag. It keeps the name.
pub(in crate::explain::engine) fn richer(term: &Term) -> Option<&'static Term> {
    match term.id {
        "above" => Some(&ABOVE_DAMPED),
        "below" => Some(&BELOW_DAMPED),
        "both_sides" => Some(&BOTH_SIDES_DAMPED),
        "input_backlash" => Some(&BACKLASH_LAGGING),
        "valve_stiction" if term.shapes.len() == 1 => Some(&SLIP_LAGGING),
        "valve_stiction" => Some(&STICTION_LAGGING),
        "input_hysteresis" => Some(&HYSTERESIS_LAGGING),
        _ => None,
    }
}

/// Speed at which damping doubles the force of a contact.
const DAMPING: Shape = shape("V", Starts::RateSize(&[1.0, 4.0]), true);

const ABOVE_DAMPED: Term = curve(
    "above",
    Equation,
    Anything,
    "max({z} - {from}, 0)*max({V} + {dz}, 0)/{V}",
    &[shape("from", Starts::Quantiles(ABOVE), false), DAMPING],
);
const BELOW_DAMPED: Term = curve(
    "below",
    Equation,
    Anything,
    "min({z} - {from}, 0)*max({V} - {dz}, 0)/{V}",
    &[shape("from", Starts::Quantiles(BELOW), false), DAMPING],
);
const BOTH_SIDES_DAMPED: Term = curve(
    "both_sides",
    Equation,
    BothSigns,
    "(max({z} - {from}, 0)*max({V} + {dz}, 0) + min({z} + {from}, 0)*max({V} - {dz}, 0))/{V}",
    &[shape("from", Starts::SizeQuantiles(ABOVE), true), DAMPING],
);

const LAG_TIME: Shape = shape("T", Starts::Samples(&[0.3, 1.0]), true);
/// Follows the second memory.
const LAG: Memory = Memory {
    rate: "({p} - {m})/{T}",
    start: MemoryStart::Argument,
    sampled: false,
};

const BACKLASH_LAGGING: Term = in_place(
    "input_backlash",
    &[LAG, sampled("min(max({p}, {z} - {g}), {z} + {g})")],
    &[BACKLASH, LAG_TIME],
);
const SLIP_LAGGING: Term = in_place(
    "valve_stiction",
    &[LAG, sampled("if abs({z} - {p}) > {S} then {z} else {p}")],
    &[STICTION, LAG_TIME],
);
const STICTION_LAGGING: Term = in_place(
    "valve_stiction",
    &[
        LAG,
        sampled("if abs({z} - {p}) > {S} then {z} - {o}*sign({z} - {p}) else {p}"),
    ],
    &[STICTION, STOP, LAG_TIME],
);
const HYSTERESIS_LAGGING: Term = hysteresis(
    &[
        Memory {
            start: MemoryStart::Zero,
            ..LAG
        },
        Memory {
            rate: "sign({z} - {q}) + ({p} - sign({z} - {q}))*exp(-abs({z} - {q})/{w})",
            start: MemoryStart::Zero,
            sampled: true,
        },
        sampled("{z}"),
    ],
    &[HYSTERESIS, LAG_TIME],
);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::engine::terms::library::TERMS;

    /// The shapes that a fit of the simple form has are those that the richer one begins with.
    #[test]
    fn a_richer_form_has_one_shape_more() {
        let pairs = TERMS.iter().filter_map(|t| Some((t, richer(t)?)));
        let mut count = 0;
        for (simple, richer) in pairs {
            let (last, others) = richer.shapes.split_last().unwrap();
            assert_eq!(others, simple.shapes, "{}", simple.id);
            assert!(
                richer.form.contains(&format!("{{{}}}", last.symbol))
                    || richer
                        .memories
                        .iter()
                        .any(|m| m.rate.contains(&format!("{{{}}}", last.symbol)))
            );
            let of = |t: &Term| (t.id, t.port, t.needs, t.free_strength, t.symbol);
            assert_eq!(of(richer), of(simple));
            count += 1;
        }
        assert_eq!(count, 7);
    }
}
