//! Forms of terms with one shape more, where their physics has one.

use super::library::{
    ABOVE, BACKLASH, BELOW, DEAD_ZONE, HYSTERESIS, LIMIT, LOWER_LIMIT, STEP, STICTION, STOP,
    UPPER_LIMIT, hysteresis,
};
use super::term::Needs::{self, AboutZero, Anything, BothSigns, Time};
use super::term::Port::{self, Equation, Input, Parameter, Sensor};
use super::term::{Memory, MemoryStart, Shape, Starts, Term, curve, in_place, sampled, shape};

/// The forms of a term with one shape more: a contact has damping in proportion to its depth (K. H. Hunt and F. R. E. Crossley,
/// *J. Appl. Mech.* 42, 1975), a flow over a crest a power of its height (3/2 over a weir), and an actuator with play, stiction or
/// hysteresis a lag; a product counts from a reference, the two sides of limits and dead zones differ, a limit has a soft knee, a ramp
/// begins later than the recording, and a change takes time. They keep the name.
pub(in crate::explain::engine) fn richer(term: &Term) -> impl Iterator<Item = &'static Term> {
    let shapes = term.shapes;
    let is_next = move |richer: &&Term| {
        let others = richer.shapes.split_last().map(|(_, others)| others);
        others == Some(shapes)
    };
    all_richer(term).iter().filter(is_next)
}

/// Those of a form and of its richer ones.
fn all_richer(term: &Term) -> &'static [Term] {
    match (term.id, term.shapes) {
        ("linear", _) => ABOUT_REFERENCES,
        ("above", _) => ABOVE_MORE,
        ("below", _) => BELOW_MORE,
        ("both_sides", _) => BOTH_SIDES_MORE,
        ("load_ramp", _) => LOAD_RAMPS,
        ("load_step", _) => LOAD_COURSES,
        ("parameter_ramp", _) => PARAMETER_RAMPS,
        ("parameter_step", _) => PARAMETER_COURSES,
        ("sensor_drift", _) => DRIFTS,
        ("input_dead_zone", _) => DEAD_ZONE_OF_TWO,
        ("input_saturation", [LIMIT]) => LIMITS_OF_TWO,
        ("input_saturation", [UPPER_LIMIT]) => UPPER_LIMIT_MORE,
        ("input_saturation", [LOWER_LIMIT]) => LOWER_LIMIT_MORE,
        ("input_backlash", _) => BACKLASH_LAGGING,
        ("valve_stiction", [_]) => SLIP_LAGGING,
        ("valve_stiction", _) => STICTION_LAGGING,
        ("input_hysteresis", _) => HYSTERESIS_LAGGING,
        _ => &[],
    }
}

/// Speed at which damping doubles the force of a contact.
const DAMPING: Shape = shape("V", Starts::RateSize(&[1.0, 4.0]), true);

/// Power of a height over a crest.
const POWER: Shape = shape("p", Starts::Powers(&[1.5]), true);
/// The other side of two that differ.
const OTHER: Shape = shape(
    "other",
    Starts::SizeQuantiles(&[0.1, 0.3, 0.5, 0.7, 0.9]),
    true,
);
/// When a ramp begins.
const BEGIN: Shape = shape("t0", Starts::Instants(&[0.1, 0.3, 0.5, 0.7]), false);
/// How long a change takes.
const DURATION: Shape = shape("T", Starts::Length(&[0.02, 0.1, 0.3]), true);

/// Where a product is zero: from the fit of the plain product the search finds it.
const REFERENCE: Shape = shape("o", Starts::Values(&[0.0]), false);
/// Of a product: what a temperature does to a power counts from a temperature of its own.
const ABOUT_REFERENCES: &[Term] = &[
    curve(
        "linear",
        Equation,
        Anything,
        "{z} - {o}*{second}",
        &[REFERENCE],
    ),
    curve(
        "linear",
        Equation,
        Anything,
        "{z} - {o}*{first}",
        &[REFERENCE],
    ),
];
const ABOVE_MORE: &[Term] = &[
    curve(
        "above",
        Equation,
        Anything,
        "max({z} - {from}, 0)*max({V} + {dz}, 0)/{V}",
        &[shape("from", Starts::Quantiles(ABOVE), false), DAMPING],
    ),
    curve(
        "above",
        Equation,
        Anything,
        "max({z} - {from}, 0)^{p}",
        &[shape("from", Starts::Quantiles(ABOVE), false), POWER],
    ),
    curve(
        "above",
        Equation,
        Anything,
        "max({z} - {from}, 0) + min({z} - {lower}, 0)",
        &[
            shape("from", Starts::Quantiles(ABOVE), false),
            shape("lower", Starts::Quantiles(BELOW), false),
        ],
    ),
];
const BELOW_MORE: &[Term] = &[
    curve(
        "below",
        Equation,
        Anything,
        "min({z} - {from}, 0)*max({V} - {dz}, 0)/{V}",
        &[shape("from", Starts::Quantiles(BELOW), false), DAMPING],
    ),
    curve(
        "below",
        Equation,
        Anything,
        "min({z} - {from}, 0) + max({z} - {upper}, 0)",
        &[
            shape("from", Starts::Quantiles(BELOW), false),
            shape("upper", Starts::Quantiles(ABOVE), false),
        ],
    ),
];
const BOTH_SIDES_MORE: &[Term] = &[
    curve(
        "both_sides",
        Equation,
        BothSigns,
        "(max({z} - {from}, 0)*max({V} + {dz}, 0) + min({z} + {from}, 0)*max({V} - {dz}, 0))/{V}",
        &[shape("from", Starts::SizeQuantiles(ABOVE), true), DAMPING],
    ),
    curve(
        "both_sides",
        Equation,
        BothSigns,
        "max({z} - {from}, 0) + min({z} + {other}, 0)",
        &[shape("from", Starts::SizeQuantiles(ABOVE), true), OTHER],
    ),
];
/// A change that ends, as an exponential function, along a sigmoid and along a straight line.
const COURSES: [&str; 3] = [
    "1.0 - exp(-max(time - {t0}, 0)/{T})",
    "0.5 + 0.5*tanh((time - {t0})/{T})",
    "min(max(time - {t0}, 0)/{T}, 1.0)",
];
const fn courses(id: &'static str, port: Port) -> [Term; 3] {
    let [exponential, sigmoid, line] = COURSES;
    [
        curve(id, port, Time, exponential, &[STEP, DURATION]),
        curve(id, port, Time, sigmoid, &[STEP, DURATION]),
        curve(id, port, Time, line, &[STEP, DURATION]),
    ]
}
/// A ramp that begins later, one that flattens, and ramps that do both.
const fn ramps(id: &'static str, port: Port) -> [Term; 4] {
    const FLATTENS: &str = "{T}*(1.0 - exp(-max(time - {t0}, 0)/{T}))";
    const ENDS: &str = "min(max(time - {t0}, 0), {T})";
    [
        curve(id, port, Time, "max(time - {t0}, 0)", &[BEGIN]),
        curve(id, port, Time, "1.0 - exp(-time/{T})", &[DURATION]),
        curve(id, port, Time, FLATTENS, &[BEGIN, DURATION]),
        curve(id, port, Time, ENDS, &[BEGIN, DURATION]),
    ]
}
const LOAD_COURSES: &[Term] = &courses("load_step", Equation);
const PARAMETER_COURSES: &[Term] = &courses("parameter_step", Parameter);
const LOAD_RAMPS: &[Term] = &ramps("load_ramp", Equation);
const PARAMETER_RAMPS: &[Term] = &ramps("parameter_ramp", Parameter);
const DRIFTS: &[Term] = &ramps("sensor_drift", Sensor);

const fn limits(
    id: &'static str,
    form: &'static str,
    shapes: &'static [Shape],
    needs: Needs,
) -> Term {
    Term {
        id,
        port: Input,
        needs,
        form,
        memories: &[],
        shapes,
        free_strength: false,
        symbol: "",
        units: &[],
    }
}

const DEAD_ZONE_OF_TWO: &[Term] = &[limits(
    "input_dead_zone",
    "max({z} - {other}, 0) + min({z} + {d}, 0) - {z}",
    &[DEAD_ZONE, OTHER],
    AboutZero,
)];
/// How soft a knee is: at the limit so many times `log(2)` are missing.
const KNEE: Shape = shape("W", Starts::Spread(&[0.05, 0.2]), true);
/// ... of both signs, with a power (C. Rapp, *Proc. 2nd European Conf. on Satellite Communications*, 1991).
const RAPP: &str = "{z}/(1 + abs({z}/{L})^{p})^(1/{p}) - {z}";
const SHARPNESS: Shape = shape("p", Starts::Powers(&[2.0]), true);
const LIMITS_OF_TWO: &[Term] = &[
    limits(
        "input_saturation",
        "min(max({z}, -{L}), {other}) - {z}",
        &[LIMIT, OTHER],
        BothSigns,
    ),
    limits(
        "input_saturation",
        "min(max({z}, -{L}), {L}) - {z} + {W}*(log(1 + exp(-abs({z} + {L})/{W})) - log(1 + exp(-abs({z} - {L})/{W})))",
        &[LIMIT, KNEE],
        BothSigns,
    ),
    limits("input_saturation", RAPP, &[LIMIT, SHARPNESS], BothSigns),
];
const UPPER_LIMIT_MORE: &[Term] = &[
    limits(
        "input_saturation",
        "min(max({z}, {lower}), {L}) - {z}",
        &[
            UPPER_LIMIT,
            shape("lower", Starts::Quantiles(&[0.03, 0.1, 0.2]), false),
        ],
        Anything,
    ),
    limits(
        "input_saturation",
        "min({z}, {L}) - {z} - {W}*log(1 + exp(-abs({z} - {L})/{W}))",
        &[UPPER_LIMIT, KNEE],
        Anything,
    ),
    limits(
        "input_saturation",
        RAPP,
        &[UPPER_LIMIT, SHARPNESS],
        Anything,
    ),
];
const LOWER_LIMIT_MORE: &[Term] = &[limits(
    "input_saturation",
    "max({z}, {L}) - {z} + {W}*log(1 + exp(-abs({z} - {L})/{W}))",
    &[LOWER_LIMIT, KNEE],
    Anything,
)];

const LAG_TIME: Shape = shape("T", Starts::Samples(&[0.3, 1.0]), true);
/// Follows the second memory.
const LAG: Memory = Memory {
    rate: "({p} - {m})/{T}",
    start: MemoryStart::Argument,
    sampled: false,
};

const BACKLASH_LAGGING: &[Term] = &[in_place(
    "input_backlash",
    &[LAG, sampled("min(max({p}, {z} - {g}), {z} + {g})")],
    &[BACKLASH, LAG_TIME],
)];
const SLIP_LAGGING: &[Term] = &[in_place(
    "valve_stiction",
    &[LAG, sampled("if abs({z} - {p}) > {S} then {z} else {p}")],
    &[STICTION, LAG_TIME],
)];
const STICTION_LAGGING: &[Term] = &[in_place(
    "valve_stiction",
    &[
        LAG,
        sampled("if abs({z} - {p}) > {S} then {z} - {o}*sign({z} - {p}) else {p}"),
    ],
    &[STICTION, STOP, LAG_TIME],
)];
const HYSTERESIS_LAGGING: &[Term] = &[hysteresis(
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
)];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explain::engine::terms::library::TERMS;

    /// The shapes that a fit of the simple form has are those that the richer one begins with.
    #[test]
    fn a_richer_form_has_one_shape_more() {
        let pairs = TERMS.iter().flat_map(|t| richer(t).map(move |r| (t, r)));
        let mut count = 0;
        for (simple, richer) in pairs {
            let (last, others) = richer.shapes.split_last().unwrap();
            assert_eq!(others, simple.shapes, "{}", simple.id);
            let name = format!("{{{}}}", last.symbol);
            let remembers = richer.memories.iter().any(|m| m.rate.contains(&name));
            assert!(richer.form.contains(&name) || remembers, "{}", simple.id);
            assert!(!richer.is_of_product() || simple.id == "linear");
            let of = |t: &Term| (t.id, t.port, t.needs, t.free_strength, t.symbol);
            assert_eq!(of(richer), of(simple));
            count += 1;
        }
        assert_eq!(count, 33);
        let ramp = TERMS.iter().find(|t| t.id == "parameter_ramp").unwrap();
        let late = richer(ramp).find(|t| t.shapes == [BEGIN]).unwrap();
        assert_eq!(richer(late).count(), 2);
    }
}
