//! How long a record must be before the tests can speak against a model.

use super::SAMPLES_PER_LAG;
use super::result::TooShort;
use crate::covariance::MOST_LAGS;

/// `None` when a record of so many samples can tell a right model of `(states, inputs, outputs)` from a wrong one.
///
/// The tests look at `M l q` correlations over `M` lags, and the `fitted` parameters have explained as many of them
/// as there are parameters: more must be left, or there is nothing that could be found wrong. And a fault in the
/// dynamics of `n` states does not show within fewer than `n + 1` lags.
pub(crate) fn too_short(
    (states, inputs, outputs): (usize, usize, usize),
    fitted: usize,
    samples: usize,
) -> Option<TooShort> {
    let q = inputs + outputs;
    let each = (outputs * q).max(1);
    let lags = (fitted / each + 1).max(states + 1).min(MOST_LAGS);
    let needed = SAMPLES_PER_LAG * q * lags;
    (samples < needed).then_some(TooShort {
        samples,
        parameters: match fitted {
            0 => 0,
            some => some + states + q,
        },
        needed,
    })
}

impl TooShort {
    /// In plain words.
    pub(crate) fn sentence(&self) -> String {
        let Self {
            samples,
            parameters,
            needed,
        } = self;
        let of = match parameters {
            0 => String::new(),
            some => format!(" for {some} parameters"),
        };
        format!("too short to judge: {samples} samples{of}; about {needed} samples are needed")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_fitted_away_must_leave_something() {
        // Order 2 with one input and one output has 6 parameters: 4 lags leave 2 of 8 correlations.
        let short = too_short((2, 1, 1), 6, 10).unwrap();
        assert_eq!((short.parameters, short.needed), (10, 80));
        assert_eq!(
            short.sentence(),
            "too short to judge: 10 samples for 10 parameters; about 80 samples are needed"
        );
        assert_eq!(too_short((2, 1, 1), 6, 80), None);
        // A fresh record has nothing fitted away, but must show the states.
        assert_eq!(too_short((2, 1, 1), 0, 59).unwrap().needed, 60);
        assert_eq!(too_short((2, 1, 1), 0, 60), None);
    }
}
