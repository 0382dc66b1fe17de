//! Heat and flow that depend on the output along a curve that physics gives.

use super::{Action, Definition, Mimic, Motion, Needs, Observed, Parameter, Sense, Unit, level};

pub(super) static ENTRIES: &[Definition] = &[
    Definition {
        id: "radiation",
        variant: "degC",
        name: "radiation of heat",
        equation: "F = -k (T^4 - Tc^4 - 4 Tc^3 (T - Tc))/1e8, T = x + 273.15",
        parameters: LINEARISED,
        mimics: RADIATION_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(radiation_celsius, Needs::Position, Sense::Resists),
        starts: middle,
    },
    Definition {
        id: "radiation",
        variant: "degF",
        name: "radiation of heat",
        equation: "F = -k (T^4 - Tc^4 - 4 Tc^3 (T - Tc))/1e8, T = x + 459.67",
        parameters: LINEARISED,
        mimics: RADIATION_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(radiation_fahrenheit, Needs::Position, Sense::Resists),
        starts: middle,
    },
    Definition {
        id: "radiation",
        variant: "K",
        name: "radiation of heat",
        equation: "F = -k (x^4 - Tc^4 - 4 Tc^3 (x - Tc))/1e8",
        parameters: LINEARISED,
        mimics: RADIATION_MIMICS,
        linear: &[],
        persists: true,
        action: Action::Force(radiation_kelvin, Needs::Position, Sense::Resists),
        starts: middle,
    },
    Definition {
        id: "orifice_flow",
        variant: "",
        name: "flow through an opening, which grows with the root of the pressure across it,",
        equation: "F = k u sqrt(supply - x)",
        parameters: &[Parameter::real("supply", Unit::Position)],
        mimics: &[Mimic {
            effect: "position_dependent_gain",
            experiment: "input steps of one size at several levels of the output, up to that of the supply",
        }],
        linear: &[],
        persists: true,
        action: Action::Force(orifice, Needs::Position, Sense::Drives),
        starts: supplies,
    },
];

/// Temperature about which the simulation is linear.
const LINEARISED: &[Parameter] = &[Parameter::real("linearised_at", Unit::Position)];

const RADIATION_MIMICS: &[Mimic] = &[Mimic {
    effect: "cubic_stiffness",
    experiment: "steps of the power from low to the highest temperatures: radiation grows with the fourth power of the absolute temperature",
}];

/// Zeros of the Celsius scale in kelvin, and of Fahrenheit's in degrees Rankine.
const ZERO_CELSIUS: f64 = 273.15;
const ZERO_FAHRENHEIT: f64 = 459.67;

fn radiation_celsius(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| radiation(x + ZERO_CELSIUS, p[0] + ZERO_CELSIUS))
}

fn radiation_fahrenheit(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| radiation(x + ZERO_FAHRENHEIT, p[0] + ZERO_FAHRENHEIT))
}

fn radiation_kelvin(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| radiation(x, p[0]))
}

/// What a simulation that is linear at `centre` leaves out of `-(t/100)^4`.
fn radiation(t: f64, centre: f64) -> f64 {
    let (t, centre) = (0.01 * t.max(0.0), 0.01 * centre);
    -(t.powi(4) - centre.powi(4) - 4.0 * centre.powi(3) * (t - centre))
}

fn orifice(p: &[f64], motion: &Motion, _: &mut [f64; 3]) -> f64 {
    motion.at_middle(|x| motion.input * (p[0] - x).max(0.0).sqrt())
}

fn middle(seen: &Observed) -> Vec<Vec<f64>> {
    vec![vec![level(&seen.channel, 0.5, |v| v)]]
}

/// Somewhat and far above all that was seen.
fn supplies(seen: &Observed) -> Vec<Vec<f64>> {
    let (low, high) = (
        level(&seen.channel, 0.002, |v| v),
        level(&seen.channel, 0.998, |v| v),
    );
    [0.2, 0.6, 1.5, 4.0]
        .map(|share| vec![high + share * (high - low)])
        .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radiation_is_what_the_tangent_leaves() {
        assert_eq!(radiation(400.0, 400.0), 0.0);
        // (5^4 - 4^4 - 4 4^3 1) at 500 K beside a tangent at 400 K.
        assert!((radiation(500.0, 400.0) + 113.0).abs() < 1e-9);
        let h = 1e-3;
        assert!((radiation(400.0 + h, 400.0) - radiation(400.0 - h, 400.0)).abs() < 1e-9);
    }
}
