//! Answers of an external simulator that are known already.

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use super::ExternalError;
use crate::physics::simulation::Excitation;

/// A column for each output, or why there is none.
pub(super) type Answer = Result<Arc<Vec<Vec<f64>>>, Box<ExternalError>>;

/// Memory for answers. The oldest go first: a search does not come back to where it began.
const MOST_BYTES: usize = 512 << 20;

/// A recording and the bits of the parameters.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct Key {
    recording: usize,
    parameters: Vec<u64>,
}

/// Inputs and time base, to be recognised again.
#[derive(Debug)]
struct Recording {
    inputs: Vec<Vec<f64>>,
    length: usize,
    sample_time: f64,
    start_time: f64,
}

impl Recording {
    fn is(&self, excitation: &Excitation) -> bool {
        // Bit by bit: a value that is not a number equals itself here.
        let same = |a: f64, b: f64| a.to_bits() == b.to_bits();
        self.length == excitation.length
            && same(self.sample_time, excitation.sample_time)
            && same(self.start_time, excitation.start_time)
            && self.inputs.len() == excitation.inputs.len()
            && self
                .inputs
                .iter()
                .zip(excitation.inputs)
                .all(|(a, b)| a.len() == b.len() && a.iter().zip(*b).all(|(a, b)| same(*a, *b)))
    }
}

/// Answers by recording and parameters.
#[derive(Debug, Default)]
pub(super) struct Cache {
    recordings: Vec<Recording>,
    answers: HashMap<Key, Answer>,
    order: VecDeque<Key>,
    bytes: usize,
}

impl Cache {
    /// The key of a run.
    pub(crate) fn key(&mut self, excitation: &Excitation, parameters: &[f64]) -> Key {
        let known = self.recordings.iter().position(|r| r.is(excitation));
        let recording = known.unwrap_or_else(|| {
            self.recordings.push(Recording {
                inputs: excitation.inputs.iter().map(|c| c.to_vec()).collect(),
                length: excitation.length,
                sample_time: excitation.sample_time,
                start_time: excitation.start_time,
            });
            self.recordings.len() - 1
        });
        Key {
            recording,
            // -0 and 0 are one value.
            parameters: parameters.iter().map(|p| (p + 0.0).to_bits()).collect(),
        }
    }

    pub(crate) fn get(&self, key: &Key) -> Option<Answer> {
        self.answers.get(key).cloned()
    }

    /// Keeps an answer; those of a batch are never removed for one another.
    pub(crate) fn insert(&mut self, key: Key, answer: Answer) {
        self.bytes += size(&answer);
        self.order.push_back(key.clone());
        self.answers.insert(key, answer);
        while self.bytes > MOST_BYTES && self.order.len() > 1 {
            let Some(oldest) = self.order.pop_front() else {
                break;
            };
            if let Some(answer) = self.answers.remove(&oldest) {
                self.bytes -= size(&answer);
            }
        }
    }
}

fn size(answer: &Answer) -> usize {
    answer.as_ref().map_or(0, |columns| {
        columns.iter().map(|c| 8 * c.len()).sum::<usize>()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::simulation::Hold;

    fn excitation<'a>(inputs: &'a [&'a [f64]]) -> Excitation<'a> {
        Excitation {
            inputs,
            length: 2,
            sample_time: 0.1,
            start_time: 0.0,
            hold: Hold::Zero,
        }
    }

    #[test]
    fn an_answer_is_found_by_recording_and_parameters() {
        let mut cache = Cache::default();
        let (first, second) = ([[1.0, 2.0].as_slice()], [[1.0, 3.0].as_slice()]);
        let key = cache.key(&excitation(&first), &[0.0, 1.0]);
        cache.insert(key, Ok(Arc::new(vec![vec![5.0, 6.0]])));
        let again = cache.key(&excitation(&first), &[-0.0, 1.0]);
        assert_eq!(cache.get(&again).unwrap().unwrap()[0], [5.0, 6.0]);
        for other in [
            cache.key(&excitation(&first), &[0.0, 1.0 + f64::EPSILON]),
            cache.key(&excitation(&second), &[0.0, 1.0]),
        ] {
            assert!(cache.get(&other).is_none());
        }
    }
}
