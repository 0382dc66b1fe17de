//! When the averaged equation is the way, and what it decides.

use super::output_error_decision::{Finding, Rival};
use crate::explain::effects::Definition;
use crate::explain::explanation::Verdict;
use crate::explain::linear::data::{Data, Segment, delayed};
use crate::explain::linear::fit::{Fit, Problem};
use crate::explain::linear::identification::autoregression::initial_states;
use crate::explain::linear::known::Known;
use crate::explain::linear::model::linear_plant::Plant;
use crate::explain::linear::model::structure::without_effects::bare;
use crate::explain::linear::search::cross_validation;
use crate::explain::linear::search::forward_selection::{look_alikes, required};
use crate::explain::linear::search::null_models::Boring;
use crate::explain::linear::search::penalties::NEEDED;
use crate::explain::linear::weak_form::equation_of_motion::Equation;
use crate::explain::linear::weak_form::equation_proof::{
    Proof, as_fit, error_across_halves, halves, inside, tethered,
};
use crate::explain::linear::weak_form::force_adequacy::{adequacy, holds};
use crate::explain::linear::weak_form::laws::Form;
use crate::explain::linear::weak_form::rank::{Candidate, best_of, last_law, rank};
use crate::explain::linear::weak_form::windows::{Reading, Windows};
use crate::log::Log;
use crate::noise::Mask;

/// Fewer samples than this hold too few windows.
const LEAST_SAMPLES: usize = 2000;
/// The averaged equation must explain this share of the force, else the plant is another one.
const EXPLAINED: f64 = 0.9;
/// A mass must be this many standard deviations from none.
const A_MASS: f64 = 8.0;
/// A free run of the simulation that misses more than this share of the output's deviation is hopeless: fits around it
/// have nothing to hold on to.
const HOPELESS: f64 = 0.3;
/// A law that must do better than a simpler one inside it, by this share of its gain (as in the fits by free run).
const LAW_IMPERFECTION: f64 = 0.02;
/// The free run may be worse than that of the simulation by this factor, for rounding.
const NO_WORSE: f64 = 1.02;
/// A second law is looked for only where the first leaves more than a textbook law does of a real drive
/// (`force_adequacy::IMPERFECTION`), and it must lower the squared free-run error of the half that was not fitted to this
/// share: the averaged equation sees forces of a hundredth of the largest, and a law that does not show in free run is
/// no explanation.
const PAYS: f64 = 0.9;
/// A free run forgets its start when its slowest motion decays within this share of the recording: what is left of it at the
/// end is `exp(-10)`. (A spring that is no spring but an error of the equation brings a drive back in many times the recording.)
const FORGOTTEN: f64 = 0.1;
/// Forces that change with the side only: of these a recording hardly tells two apart.
const SIDES: [&str; 3] = ["coulomb_friction", "stribeck_friction", "input_dead_zone"];

/// The data whole (not cut to a stretch), with the constant as second input.
fn whole(recordings: &[Log]) -> Data {
    Data {
        segments: recordings
            .iter()
            .map(|log| Segment {
                inputs: vec![log.input_data[0].clone(), vec![1.0; log.samples()]],
                outputs: log.output_data.clone(),
                start_time: log.start_time,
            })
            .collect(),
        sample_time: recordings[0].sample_time,
        inputs: 2,
        outputs: 1,
        constant: true,
    }
}

/// The simulation as it was given, on the whole data.
fn given(known: &Known, data: &Data, problem: &Problem) -> Option<Fit> {
    let plant = &known.structure.coordinates.given;
    let mut wide = plant.clone();
    if plant.inputs == 1 {
        wide = Plant {
            inputs: 2,
            b: plant.b.iter().flat_map(|b| [*b, 0.0]).collect(),
            d: plant.d.iter().flat_map(|d| [*d, 0.0]).collect(),
            ..wide
        };
    }
    let mut held_back = data.clone();
    for segment in &mut held_back.segments {
        segment.inputs[0] = delayed(
            &segment.inputs[0],
            known.delays.first().copied().unwrap_or(0),
        );
    }
    let (initial, _) = initial_states(&wide, &held_back)?;
    let structure = bare(&wide, &initial);
    let simulated = structure.simulate(&structure.given(), &held_back)?;
    let mut fit = Fit::at(problem, structure.clone(), structure.given())?;
    fit.residual = data.residual(&simulated);
    fit.simulated = simulated;
    fit.noise = problem.noise(&fit.residual);
    fit.deviance = fit.noise.deviance(&fit.residual, &problem.mask);
    Some(fit)
}

/// Mean square error of the acceleration that an equation with given coefficients foretells on other windows.
fn foretold(
    equation: &Equation,
    coefficients: &[f64],
    windows: &Windows,
    data: &Data,
) -> Option<f64> {
    let e = equation.errors(windows, data, coefficients);
    let mass = coefficients[0].powi(2).max(1e-300);
    (!e.is_empty()).then(|| e.iter().map(|v| v * v).sum::<f64>() / e.len() as f64 / mass)
}

/// Everything that one reading of the output gives.
struct Ranking {
    windows: Windows,
    forms: Vec<Form>,
    candidates: Vec<Candidate>,
    /// Share of the force that is not explained.
    unexplained: f64,
}

fn ranking(
    data: &Data,
    mask: &Mask,
    reading: Reading,
    allowed: &dyn Fn(&Definition) -> bool,
) -> Option<Ranking> {
    let windows = inside(&Windows::choose(data, reading)?, mask);
    let forms = Form::all(reading, allowed);
    let plain = Equation {
        reading,
        spring: false,
        laws: Vec::new(),
    };
    let candidates = rank(&windows, data, &plain, &forms, None);
    let best = candidates.first()?;
    let n = windows.force.len() as f64;
    let mean = windows.force.iter().sum::<f64>() / n;
    let total: f64 = windows.force.iter().map(|f| (f - mean).powi(2)).sum();
    Some(Ranking {
        unexplained: best.regression.squares / total.max(1e-300),
        windows,
        forms,
        candidates,
    })
}

/// Root mean square free-run error over the samples of `mask`.
fn error_over(fit: &Fit, mask: &Mask) -> f64 {
    let (mut sum, mut n) = (0.0, 0usize);
    for (r, m) in fit.residual.iter().zip(mask) {
        for (r, _) in r.iter().zip(m).filter(|(_, keep)| **keep) {
            sum += r * r;
            n += 1;
        }
    }
    (sum / n.max(1) as f64).sqrt()
}

/// Decides by the averaged equation; `None` where that is not the way, or leads to nothing better than what is known.
pub(crate) fn attempt(
    recordings: &[Log],
    known: &Known,
    allowed: &dyn Fn(&Definition) -> bool,
) -> Option<(Known, Finding, Mask)> {
    let one_each = recordings[0].inputs.len() == 1 && recordings[0].outputs.len() == 1;
    let enough = recordings.iter().map(Log::samples).sum::<usize>() >= LEAST_SAMPLES;
    if !one_each || !enough || known.relative || !known.structure.effects.is_empty() {
        return None;
    }
    let data = whole(recordings);
    let mut problem = Problem::new(&data);
    let heldout;
    (problem.mask, heldout) = cross_validation::set_aside(&data, &problem.mask);
    let given = given(known, &data, &problem)?;
    let missed = error_over(&given, &problem.mask) / problem.scale[0];
    let rankings: Vec<Ranking> = [Reading::Position, Reading::Velocity]
        .into_iter()
        .filter_map(|reading| ranking(&data, &problem.mask, reading, allowed))
        .collect();
    let chosen = rankings
        .into_iter()
        .min_by(|a, b| a.unexplained.total_cmp(&b.unexplained))?;
    let plain = best_of(&chosen.candidates, 0)?.clone();
    let integrates = chosen.windows.reading == Reading::Position
        && chosen
            .candidates
            .first()
            .is_some_and(|c| !c.equation.spring);
    if chosen.unexplained > 1.0 - EXPLAINED || !(missed > HOPELESS || integrates) {
        return None;
    }
    let decided = decide(&chosen, &data, &problem)?;
    let finding = finding(&chosen, &plain, decided, given, &problem, heldout)?;
    // A way that leads to a worse free run than the simulation had is the wrong one.
    let better = error_over(&finding.model, &problem.mask)
        <= error_over(&finding.boring.given, &problem.mask) * NO_WORSE;
    let mask = problem.mask.clone();
    let known = Known {
        structure: finding.boring.given.structure.clone(),
        delays: vec![0],
        relative: false,
        identified: known.identified,
        uncertainty: None,
        data: data.clone(),
    };
    better.then_some((known, finding, mask))
}

/// The equation that stands, and how much its laws gained.
struct Decided {
    equation: Equation,
    gain: f64,
    resembles: Option<(&'static Definition, f64)>,
}

fn decide(chosen: &Ranking, data: &Data, problem: &Problem) -> Option<Decided> {
    let plain = best_of(&chosen.candidates, 0)?;
    let windows = &chosen.windows;
    let (train, test, _) = cross_validation::inner(data, &problem.mask);
    let (train, test) = (inside(windows, &train), inside(windows, &test));
    let foretells = |candidate: &Candidate, base: &Candidate| {
        let held = |c: &Candidate| {
            let fit = c.equation.fit(&train, data, false)?;
            foretold(&c.equation, fit.coefficients.as_slice(), &test, data)
        };
        matches!((held(candidate), held(base)), (Some(a), Some(b)) if a < b)
    };
    let owes = |c: &Candidate| {
        // Nested in Coulomb friction: it must do better than make up for the imperfection of that law.
        match last_law(c) {
            Some(law) if law.id == "stribeck_friction" => {
                LAW_IMPERFECTION * (plain.criterion - c.criterion).max(0.0)
            }
            _ => 0.0,
        }
    };
    let first = chosen
        .candidates
        .iter()
        .filter(|c| c.equation.laws.len() == 1)
        .min_by(|a, b| (a.criterion + owes(a)).total_cmp(&(b.criterion + owes(b))));
    let Some(first) = first
        .filter(|c| plain.criterion - c.criterion > NEEDED && a_mass(c) && foretells(c, plain))
    else {
        return a_mass(plain).then(|| Decided {
            equation: plain.equation.clone(),
            gain: 0.0,
            resembles: None,
        });
    };
    let gain = plain.criterion - first.criterion;
    // A second law: much more, no look-alike, and better in held-out free run.
    let others: Vec<Form> = chosen
        .forms
        .iter()
        .filter(|f| {
            last_law(first).is_some_and(|l| {
                let (a, b) = (l.id, f.definition.id);
                a != b && !look_alikes(a, b) && !(SIDES.contains(&a) && SIDES.contains(&b))
            })
        })
        .copied()
        .collect();
    let seconds = rank(windows, data, &first.equation, &others, None);
    let left = first.equation.fit(windows, data, false).and_then(|fit| {
        adequacy(
            windows,
            data,
            &first.equation,
            &fit,
            plain.regression.squares,
        )
    });
    let suffices = left.as_ref().is_none_or(holds);
    let pays = |pair: &Equation, single: &Equation| {
        let error = |equation: &Equation| error_across_halves(equation, windows, data, problem);
        matches!((error(pair), error(single)), (Some(a), Some(b)) if a * a <= PAYS * b * b)
    };
    let mut resembles = None;
    if let (Some(single), Some(pair)) = (best_of(&seconds, 1), best_of(&seconds, 2)) {
        let more = single.criterion - pair.criterion;
        if more > NEEDED {
            resembles = last_law(pair).map(|law| (law, more));
        }
        if !suffices
            && more > required(gain)
            && foretells(pair, first)
            && pays(&pair.equation, &first.equation)
        {
            return Some(Decided {
                equation: pair.equation.clone(),
                gain: gain + more,
                resembles: None,
            });
        }
    }
    Some(Decided {
        equation: first.equation.clone(),
        gain,
        resembles,
    })
}

/// Whether there is a moving mass at all.
fn a_mass(candidate: &Candidate) -> bool {
    let std = candidate.regression.covariance()[(0, 0)].max(0.0).sqrt();
    candidate.regression.coefficients[0].abs() > A_MASS * std
}

fn finding(
    chosen: &Ranking,
    plain: &Candidate,
    decided: Decided,
    given: Fit,
    problem: &Problem,
    heldout: Mask,
) -> Option<Finding> {
    let data = problem.data;
    let windows = &chosen.windows;
    let Decided {
        equation,
        gain,
        resembles,
    } = decided;
    let (fit, regression) = tethered(&equation, windows, data, &problem.mask)?;
    let (linear, _) = tethered(&plain.equation, windows, data, &problem.mask)?;
    let model = as_fit(problem, &equation, &fit)?;
    let linear = as_fit(problem, &plain.equation, &linear)?;
    let found = !equation.laws.is_empty();
    let n = windows.force.len() as f64;
    let mean = windows.force.iter().sum::<f64>() / n;
    // Mass and viscous friction are as imperfect as any law.
    let before = if found {
        plain.regression.squares
    } else {
        windows.force.iter().map(|f| (f - mean).powi(2)).sum()
    };
    let adequacy = adequacy(windows, data, &equation, &regression, before);
    let adequate = adequacy.as_ref().is_none_or(holds);
    let heldout_gain = (|| {
        let other = inside(&Windows::choose(data, chosen.windows.reading)?, &heldout);
        let error = |e: &Equation| {
            let fit = e.fit(windows, data, false)?;
            foretold(e, fit.coefficients.as_slice(), &other, data)
        };
        let independent =
            regression.effective() * other.places.len() as f64 / windows.places.len() as f64;
        Some(independent * (error(&plain.equation)? / error(&equation)?).ln())
    })();
    let rivals = rivals(&chosen.candidates, plain.criterion);
    let runner_up = equation
        .laws
        .first()
        .and_then(|(law, _)| rivals.iter().find(|r| r.definition.id != law.definition.id));
    let verdict = if !adequate {
        Verdict::Unexplained
    } else if let Some(rival) = runner_up.filter(|_| found && equation.laws.len() == 1) {
        if gain - rival.gain < crate::explain::explanation::EFFECTS_TIE {
            Verdict::Family
        } else {
            Verdict::Named
        }
    } else if found {
        Verdict::Named
    } else {
        // The simulation may be right as it is: then its free run is as good as any.
        let free = data.residual(&given.simulated);
        let independent = crate::explain::linear::effective_samples::effective(&free[0]);
        let ratio = error_over(&given, &problem.mask) / error_over(&linear, &problem.mask);
        if 2.0 * independent * ratio.ln() > NEEDED {
            Verdict::Parameters
        } else {
            Verdict::Consistent
        }
    };
    let halves_disagree = found.then(|| halves(&equation, windows, data)).flatten();
    let lasts = data
        .segments
        .iter()
        .map(|s| s.samples() as f64 * data.sample_time);
    let is_brought_back =
        equation.forgets_after(&fit.coefficients) < FORGOTTEN * lasts.fold(f64::INFINITY, f64::min);
    Some(Finding {
        verdict,
        boring: Boring {
            given: given.clone(),
            strict: linear.clone(),
            near: linear.clone(),
            full: linear,
        },
        augmented: found.then(|| model.clone()),
        gain,
        rivals,
        troubles: Vec::new(),
        freezes: Vec::new(),
        coarse: None,
        adequacy,
        count: problem.count(),
        heldout,
        detectable: Vec::new(),
        weak: Some(Box::new(Proof {
            equation,
            tethered: fit,
            heldout_gain,
            halves_disagree,
            adequacy,
            adequate,
            resembles,
            half: windows.half,
            is_brought_back,
        })),
        model: if verdict == Verdict::Consistent {
            given
        } else {
            model
        },
    })
}

/// One line an effect: the best of its forms.
fn rivals(candidates: &[Candidate], base: f64) -> Vec<Rival> {
    let mut list: Vec<Rival> = Vec::new();
    for candidate in candidates {
        if let Some(definition) = last_law(candidate)
            && list.iter().all(|r| r.definition.id != definition.id)
        {
            list.push(Rival {
                definition,
                gain: base - candidate.criterion,
            });
        }
    }
    list
}
