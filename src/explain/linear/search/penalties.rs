//! What a named effect needs beyond the null model, and what some effects owe beyond BIC.

use super::single_effects::Ranked;
use crate::explain::effects::Unit;
use crate::explain::explanation::EFFECTS_TIE;
use crate::explain::linear::fit::Fit;
use crate::explain::linear::model::functionals::{Functionals, dot};

/// Places, laws and starting values that are tried on one recording, about: a name among so many needs
/// `2 ln(300)` more than nothing at all (the maximum of that many chi-squares with one degree of freedom).
pub(crate) const NEEDED: f64 = 11.4;

/// A missing resonance imitates any linear misfit; it must lead by this share of its gain.
const MODE_HANDICAP: f64 = 0.01;

/// Hysteresis nests dry friction with bristles; it must lead by this share of its gain.
const DRY_HANDICAP: f64 = 0.01;

/// A curve without a form must lead the laws that have one by this much, and by this share of its gain (math/physics.md,
/// fits and decision, 7).
const CURVE_LEAD: f64 = 12.0;
const CURVE_HANDICAP: f64 = 0.04;

/// What an answer owes that physics allows but that is rare, such as a hysteresis that gives energy back: odds of 1
/// to 400.
const UNUSUAL: f64 = 12.0;

/// What each number of a trend or of an integral owes beyond Schwarz's criterion: slow noise makes such columns fit by chance
/// (Phillips 1986). With a pole at one the squared statistic of a trend has its 1 % point at 15.7 (Dickey and Fuller 1979), not
/// at 6.6.
const TREND: f64 = 15.7 - 6.6;

/// A textbook law is rarely closer to the real one than some percents of what it explains.
const LAW_IMPERFECTION: f64 = 0.02;

/// What some effects owe beyond the count of their parameters.
pub(crate) fn penalty(ranked: &Ranked, base: f64, count: usize) -> f64 {
    let structure = &ranked.fit.structure;
    (structure.first_new()..structure.effects.len())
        .map(|index| owed(ranked, index, base, count))
        .sum()
}

/// What effect `index` owes.
fn owed(ranked: &Ranked, index: usize, base: f64, count: usize) -> f64 {
    let definition = ranked.fit.structure.effects[index].definition;
    // A change point is chosen among all samples: it counts about twice (Zhang and Siegmund 2007). So does a frequency,
    // chosen among all bins (Djuric 1996, 3 ln N for a sinusoid).
    let searched =
        definition.changes() || definition.parameters.iter().any(|p| p.unit == Unit::Hertz);
    let mut owed = if searched { (count as f64).ln() } else { 0.0 };
    if definition.id == "hysteresis" && pulls(&ranked.fit, index) {
        owed += UNUSUAL;
    }
    let gain = (base - ranked.criterion).max(0.0);
    owed += match definition.id {
        "extra_mode" => MODE_HANDICAP * gain,
        // Nested in a simpler law: it must do better than make up for the imperfection of that law.
        "stribeck_friction" => LAW_IMPERFECTION * gain,
        // Hardly to be told from a delay, which every sampled loop has.
        "actuator_lag" => EFFECTS_TIE,
        "hysteresis" => DRY_HANDICAP * gain,
        // A curve without a form follows any law; the law is the simpler answer.
        "law" | "input_curve" => CURVE_LEAD.max(CURVE_HANDICAP * gain),
        "valve_stiction" => LAW_IMPERFECTION * gain,
        "sensor_drift" | "state_of_charge" => {
            let structure = &ranked.fit.structure;
            let effect = &structure.effects[index];
            let held = definition.parameters.iter().filter(|p| p.held).count();
            let numbers = effect.len(structure.states(), structure.outputs()) - held;
            TREND * numbers as f64
        }
        _ => 0.0,
    };
    owed
}

/// Whether force `index` acts against its usual sense.
pub(crate) fn pulls(fit: &Fit, index: usize) -> bool {
    let plant = fit.structure.plant(&fit.theta);
    let rows = Functionals::new(&plant);
    let signal = rows.of(&plant, fit.structure.effects[index].signal);
    let direction = fit.structure.direction(&fit.theta, &plant, &rows, index);
    dot(&signal.forward, &direction) < 0.0
}
