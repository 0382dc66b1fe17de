//! How often answers like this one are right.
//!
//! A logistic regression of each kind of answer on few figures. It was fitted to 660 recordings: 560 of the independent
//! simulator of `tests/concealed`, with 4000 or 2000 samples, half of them hard (effects of 1 to 4 % of the signal, noise of
//! 1 to 6 %), half with nothing missing, 24 with an effect that is in no library; and 100 logs of `benches/nulls.py`, in
//! which nothing is missing. Of the 280 with an effect, 198 were hard or had coloured or heavy-tailed noise. Right were 188 of
//! 226 names, 15 of 15 names of sensors that freeze or round, 8 of 11 ties, 219 of 228 "consistent", 155 of 169 "parameters"
//! and 5 of 11 "unexplained". The recordings, and the fit again:
//!
//! ```text
//! conceal A --seed  101 --cases 100 --nulls 50 --unlisted 4
//! conceal B --seed 1101 --cases 100 --nulls 50 --unlisted 4 --hard
//! conceal C --seed  102 --cases 100 --nulls 50 --unlisted 4 --samples 2000
//! conceal D --seed 1102 --cases 100 --nulls 50 --unlisted 4 --samples 2000 --hard
//! conceal E --seed 7301 --cases  80 --nulls 40 --unlisted 4
//! conceal F --seed 7302 --cases  80 --nulls 40 --unlisted 4 --samples 2000 --hard
//! python3 benches/reliability.py innovant A B C D E F --nulls 501:60,601:40 --fit
//! ```
//!
//! where `conceal` stands for `cargo run --release --example conceal --`.
//!
//! On 280 recordings of other seeds, which set no constant (240 drawn alike, 120 of them hard, 120 with nothing missing, 14 with
//! an effect that is in no library; 40 of `benches/nulls.py`; the command stands in `benches/README.md`):
//!
//! | stated | recordings | mean | right |
//! |---|---|---|---|
//! | below 50 % | 18 | 36 % | 7, 39 % |
//! | 50 to 70 % | 26 | 65 % | 14, 54 % |
//! | 70 to 85 % | 22 | 80 % | 15, 68 % |
//! | 85 to 95 % | 65 | 91 % | 57, 88 % |
//! | above 95 % | 149 | 98 % | 145, 97 % |
//!
//! A probability is that of such a mixture: where nine recordings of ten miss something, fewer of the answers "consistent"
//! are right.

use crate::explain::engine::terms::names::special_case;
use crate::explain::explanation::{FitTable, Verdict};
use crate::explain::linear::decision::output_error_decision::Finding;
use crate::explain::linear::screening::output_adequacy::LEVEL;
use crate::explain::linear::search::penalties::NEEDED;

/// Evidence below which leads are one.
const LEAST_LEAD: f64 = 0.1;

/// Evidence beyond which the best of all effects is as good as none.
const FAR: f64 = 20.0;

/// What is left, in standard deviations of the output: less than the least hides nothing of what was drawn, and more than
/// the most was not drawn.
const LEAST_NOISE: f64 = 0.01;
const MOST_NOISE: f64 = 0.1;

/// More is not stated: recordings hold effects that nobody drew.
const MOST: f64 = 0.99;

/// Probability below which a name is not given: two of three such names are wrong.
pub(crate) const UNLIKELY: f64 = 1.0 / 3.0;

/// Whether a name is more than twice as likely wrong as right. The regression holds no drives by their averaged equation.
pub(crate) fn is_unlikely(finding: &Finding) -> bool {
    let stated = || 1.0 / (1.0 + (-named(finding)).exp());
    let known = finding.weak.is_none();
    finding.verdict == Verdict::Named && known && stated() < UNLIKELY
}

/// Probability that the answer is right; `fit` is the table that is shown beside it.
pub(crate) fn probability(finding: &Finding, fit: &FitTable) -> f64 {
    let logit = match finding.verdict {
        Verdict::Named => named(finding),
        // So few were drawn that their share is all there is to say; one right and one wrong answer are added to it.
        Verdict::Family => log_odds(8, 11),
        Verdict::Unexplained => log_odds(5, 11),
        Verdict::Consistent => quiet(finding, fit),
        Verdict::Parameters => quiet(finding, fit) - 1.02,
    };
    (1.0 / (1.0 + (-logit).exp())).min(MOST)
}

/// Names: by how much the next kind of effect (or none) is worse, and whether what is left can be noise. Structure below
/// the level of the test is all the same: it was tolerated because it is small.
fn named(finding: &Finding) -> f64 {
    let effects = finding.model.structure.new_effects();
    if effects.is_empty() {
        return log_odds(15, 15);
    }
    let next = finding
        .rivals
        .iter()
        .find(|r| {
            // A more general form explains as much as its special case.
            let alike =
                |id: &str| id == r.definition.id || special_case(r.definition.id) == Some(id);
            !effects.iter().any(|e| alike(e.definition.id))
        })
        .map_or(0.0, |r| r.gain.max(0.0));
    let lead = (finding.gain - next).max(LEAST_LEAD);
    let noise = finding.adequacy.map_or(1.0, |a| a.p_value).max(LEVEL);
    -1.76 + 0.89 * lead.ln() + 0.388 * noise.ln()
}

/// No name: how far the best of all effects is from what a name needs (beyond it where held-out blocks refused it), and how
/// large the noise is that may hide one.
fn quiet(finding: &Finding, fit: &FitTable) -> f64 {
    let best = finding.rivals.first().map_or(-10.0, |r| r.gain);
    let short = (NEEDED - best).min(FAR);
    let left = 1.0 - fit.train.augmented.fit_percent / 100.0;
    // An output that never changes has no fit.
    let noise = if left.is_finite() {
        left.clamp(LEAST_NOISE, MOST_NOISE)
    } else {
        MOST_NOISE
    };
    -3.85 + 0.105 * short - 1.64 * noise.ln()
}

/// Log odds of `right` of `n` answers, with one right and one wrong answer added.
fn log_odds(right: u32, n: u32) -> f64 {
    (f64::from(right + 1) / f64::from(n - right + 1)).ln()
}
