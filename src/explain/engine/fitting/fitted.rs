//! Candidates that were fitted, and which of them is the answer.

use crate::explain::engine::fitting::candidate::Candidate;
use crate::explain::engine::hypothesis::prefer_asked;
use crate::explain::engine::screening::screen::Lead;
use crate::explain::engine::terms::argument::Argument;
use crate::explain::engine::terms::names::{SPECIFIC, name_rank, named, rank, special_case};
use crate::explain::engine::terms::term::{Needs, Starts};
use crate::explain::engine::terms::values::WAVES;
use crate::physics::ModelSpec;
use crate::physics::estimate::{EstimateOptions, Fit, Form, PlantRecording, Study};

/// Gains that differ by less, or by this part of the best, are equal.
pub(crate) const TIE: (f64, f64) = (6.0, 0.08);
/// The same where the best is a curve: it is free to follow any effect (math/physics.md, "Fits and decision"). The first also
/// where it is an unlisted formula.
const TIE_WITH_CURVE: (f64, f64) = (12.0, 0.04);

/// Gains that differ by less than this from one of a curve are equal to it.
pub(crate) fn tie_with_curve(gain: f64) -> f64 {
    TIE_WITH_CURVE.0.max(TIE_WITH_CURVE.1 * gain)
}
/// Deviances that differ by less are equal: two, as Akaike's criterion has it for a number that says nothing.
const ALIKE: f64 = 2.0;
/// Terms without a number of their own that hold of themselves: what is in proportion to a variable, and the weight of a pendulum.
const PLAIN: [&str; 2] = ["linear", "gravity"];
/// A gain must not rest on so few values: they may be errors of the recording.
const FEW: usize = 1;

/// A candidate that was fitted.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    pub(crate) lead: Lead,
    /// What the term is a function of.
    pub(crate) depends: Vec<String>,
    /// The same as an expression.
    pub(crate) argument: String,
    /// Values that the argument had, or times of the recordings where there is none, and the range of its integral.
    pub(crate) range: (f64, f64),
    pub(crate) travel: f64,
    /// A usual value of the argument.
    pub(crate) usual: f64,
    /// Whether the argument goes back through its range: a function of one that does not is also one of time.
    pub(crate) comes_back: bool,
    /// Fitted values of the shapes.
    pub(crate) shapes: Vec<f64>,
    pub(crate) candidate: Candidate,
    pub(crate) fit: Fit,
    /// Gain in the criterion over the plant without it, less the penalty of the search.
    pub(crate) gain: f64,
    /// Whether it takes more than half of the mean square off blocks left out, whatever the gain.
    pub(crate) explains: bool,
    /// ... and off what any other function leaves there.
    pub(crate) proved: bool,
    /// Whether it gains more than chance does, and surely where each residual has a noise model of its own.
    pub(crate) likelier: bool,
    /// Place in the user's hypotheses; none for a term of the library.
    pub(crate) hypothesis: Option<usize>,
}

impl Fitted {
    /// The other numbers of its fit, as those of the plant without it, which has so many parameters.
    pub(in crate::explain::engine) fn without_term(&self, parameters: usize) -> Fit {
        self.candidate.without(&self.fit, parameters)
    }

    /// The same with what its term is a function of: time where there is no argument.
    pub(in crate::explain::engine) fn depending_on(
        self,
        argument: Option<&Argument>,
        spec: &ModelSpec,
        recordings: &[PlantRecording],
    ) -> Self {
        let Some(argument) = argument else {
            let range = PlantRecording::span(recordings);
            return Self { range, ..self };
        };
        Self {
            depends: spec.names(&argument.variables),
            argument: argument.expression.clone(),
            range: (argument.quantile(0.0), argument.quantile(1.0)),
            travel: (recordings.first()).map_or(0.0, |r| argument.travel(r.sample_time)),
            usual: argument.usual(),
            comes_back: argument.reverses(),
            ..self
        }
    }

    /// Whether the times of its term are within a recording of this length: what follows more slowly is a ramp there, or a constant. What
    /// is slow by nature takes longer than a sample.
    pub(in crate::explain::engine) fn is_resolved(&self, study: &Study) -> bool {
        let (length, sample) = (study.duration(), study.sample_time());
        let shapes = self.lead.term.shapes.iter().zip(&self.shapes);
        let mut times = shapes.filter(|(s, _)| s.is_duration());
        times.all(|(shape, time)| {
            let slow = matches!(shape.starts, Starts::Length(_));
            *time <= length && !(slow && *time <= sample)
        })
    }

    /// The factor of a term whose size its shapes do not fix.
    pub(in crate::explain::engine) fn strength(&self) -> f64 {
        self.values().get(self.shapes.len()).copied().unwrap_or(0.0)
    }

    /// The values that the term added to the plant.
    pub(in crate::explain::engine) fn values(&self) -> &[f64] {
        let end = self.candidate.plant.spec.parameters().len();
        let first = end - self.candidate.values.len();
        self.fit.point.get(first..end).unwrap_or_default()
    }

    /// The second equation that the term enters, and its strength there.
    pub(in crate::explain::engine) fn arrives(&self) -> Option<(usize, f64)> {
        let (at, _) = self.lead.arrives?;
        let last = self
            .candidate
            .plant
            .spec
            .parameters()
            .len()
            .checked_sub(1)?;
        Some((at, self.fit.point.get(last).copied()?))
    }

    /// The gain without the [`FEW`] values that it owes most to.
    pub(in crate::explain::engine) fn gain_without_few(
        &self,
        study: &Study,
        before: &Fit,
        options: &EstimateOptions,
    ) -> f64 {
        let options = with_more(options, self.candidate.values.len());
        let lost = || {
            let own = study.of(&self.candidate.plant, &options).ok()?;
            let noise = &self.fit.noise;
            let losses = |of: &Study, fit: &Fit| -> Option<Vec<f64>> {
                let whitened = noise.whiten_kept(&of.residual(fit)?, of.mask());
                Some(whitened.into_iter().map(|e| noise.loss(e)).collect())
            };
            let (old, new) = (losses(study, before)?, losses(&own, &self.fit)?);
            let mut decrease: Vec<f64> = old.iter().zip(&new).map(|(a, b)| a - b).collect();
            let whole: f64 = decrease.iter().sum();
            decrease.sort_by(|a, b| b.total_cmp(a));
            let few: f64 = decrease.iter().take(FEW).sum();
            Some(few / whole.max(few))
        };
        let deviance = study.information() * (before.deviance - self.fit.deviance);
        self.gain - lost().unwrap_or(0.0) * deviance
    }
}

/// A start in its own form and in that of the fit before: where an observer had to follow what was missing, a free run may do now,
/// and where a free run strays, an observer.
pub(in crate::explain::engine) fn forms(from: Fit, before: &Fit, gains: usize) -> Vec<Fit> {
    let mut starts = vec![from.clone()];
    if from.form != before.form {
        let mut point = from.point.clone();
        match before.form {
            Form::Innovation => point.extend(&before.point[before.point.len() - gains..]),
            Form::FreeRun => point.truncate(point.len() - gains),
        }
        starts.push(Fit {
            form: before.form,
            point,
            ..from
        });
    }
    starts
}

/// Penalty for the values of a shape that were searched.
pub(in crate::explain::engine) fn searched(lead: &Lead, recordings: &[PlantRecording]) -> f64 {
    let values = recordings.iter().flat_map(|r| &r.outputs[0]);
    let samples = values.filter(|y| y.is_finite()).count() as f64;
    lead.term
        .shapes
        .iter()
        .map(|shape| match shape.starts {
            Starts::Length(_) | Starts::Instants(_) => 2.0 * (samples / 20.0).ln(),
            // As many as are tried of a position.
            Starts::Waves => 2.0 * f64::from(WAVES).ln(),
            // As many frequencies as the spectrum of the recording has.
            Starts::Peaks => 2.0 * (samples / 2.0).ln(),
            // As many as are tried: see `Screen`.
            Starts::Releases(_) => 2.0 * 100f64.ln(),
            Starts::Quantiles(_) | Starts::SizeQuantiles(_) => 2.5,
            Starts::Spread(_)
            | Starts::PerSpread(_)
            | Starts::Samples(_)
            | Starts::Travel(_)
            | Starts::Moved(_)
            | Starts::Rate(_)
            | Starts::RateSize(_) => 2.0,
            Starts::Values(_) | Starts::Powers(_) | Starts::Share(_) => 0.0,
        })
        .sum()
}

/// A form with more numbers than the special case that it contains follows errors of both: it must gain clearly more.
fn prefer_special_case(spec: &ModelSpec, fitted: &mut [Fitted]) {
    let Some(first) = fitted.first() else { return };
    let tie = tie_with_curve(first.gain);
    let least = first.gain - tie;
    if let Some(wanted) = special_case(named(spec, first))
        && let Some(at) = fitted.iter().position(|f| {
            named(spec, f) == wanted && f.lead.place == first.lead.place && f.gain >= least
        })
    {
        fitted[..=at].rotate_right(1);
    }
}

/// What a fit costs that moves parameters from their values in the text: each is an observation with the variance of a uniform
/// distribution between the bounds. It decides where the recording does not, as between a sensor and what another gain does to
/// the other sensors.
fn moved(spec: &ModelSpec, fit: &Fit) -> f64 {
    let parameters = spec.parameters().into_iter().map(|v| spec.variable(v));
    let costs = parameters.zip(&fit.point).map(|(v, value)| {
        let variance = (v.max - v.min).powi(2) / 12.0;
        v.number
            .map_or(0.0, |text| (value - text).powi(2) / variance)
    });
    costs.filter(|c| c.is_finite()).sum()
}

/// Puts fits in the order in which they are given as answers, from one by their gains. A name that does not gain what is needed stands in
/// the place of nothing that does.
pub(in crate::explain::engine) fn order(spec: &ModelSpec, fitted: &mut [Fitted], needed: f64) {
    // Among those that explain the recording as well as the best, the one with a name of its own comes first. Of several such
    // the best, unless their gains are equal.
    let free = spec.inputs().is_empty();
    if let Some(first) = fitted.first() {
        let best = first.gain;
        // An unlisted formula is as free as a curve, of which there are many.
        let least = match named(spec, first) {
            "law" => TIE_WITH_CURVE.0,
            _ => TIE.0,
        };
        let part = match first.lead.curve {
            Some(_) => TIE_WITH_CURVE.1,
            None => TIE.1,
        };
        let tie = least.max(part * best);
        // Where nothing drives the plant, a lag of its sensor and a store beside it are the same but for a number: they fit alike.
        let deviance = first.fit.deviance;
        let alike = |f: &Fitted| free && f.fit.deviance <= deviance + ALIKE;
        let proven = |f: &Fitted| best <= needed || f.gain > needed;
        let tied = |f: &Fitted| best - f.gain <= tie && proven(f) || alike(f);
        fitted.sort_by_key(|f| !tied(f));
        let ties = fitted.iter().take_while(|f| tied(f)).count();
        fitted[..ties].sort_by_key(|f| name_rank(spec, f));
        let (first, of_name) = (fitted[0].gain, name_rank(spec, &fitted[0]));
        let equal =
            |f: &&Fitted| (first - f.gain <= TIE.0 || alike(f)) && name_rank(spec, f) == of_name;
        let equals = fitted[..ties].iter().take_while(equal).count();
        // Formulas of one curve differ in what they are, not in where they leave the parameters.
        let supported = |f: &Fitted| match rank(spec, f) < SPECIFIC {
            true => f.gain - moved(spec, &f.fit),
            false => f.gain,
        };
        fitted[..equals].sort_by(|a, b| {
            // Of equals the one that supposes nothing of the time before the recording, and the one without a memory: more states
            // follow more.
            let supposes = |f: &Fitted| f.lead.term.needs == Needs::SwitchedOn;
            let key = |f: &Fitted| (supposes(f), rank(spec, f), f.candidate.new_states);
            (key(a).cmp(&key(b))).then(supported(b).total_cmp(&supported(a)))
        });
        // Of functions that fit alike the line comes before its powers: friction of a slow motion is viscous. The sine of an angle comes
        // before its cube.
        let first = &fitted[0];
        let least = supported(first) - ALIKE;
        let is_plain = |f: &Fitted| PLAIN.contains(&f.lead.term.id) && f.shapes.is_empty();
        let plain = |f: &Fitted| {
            is_plain(f) && f.lead.place == first.lead.place && rank(spec, f) == rank(spec, first)
        };
        let at = fitted[..equals]
            .iter()
            .position(|f| plain(f) && supported(f) >= least);
        if let Some(at) = at {
            fitted[..=at].rotate_right(1);
        }
        prefer_special_case(spec, fitted);
        prefer_asked(fitted);
    }
}

pub(crate) fn with_more(options: &EstimateOptions, count: usize) -> EstimateOptions {
    let mut options = options.clone();
    options.free.extend(std::iter::repeat_n(true, count));
    options
}
