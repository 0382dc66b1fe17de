//! What a page shows of a recording, gathered in passing while it is read: envelopes and the spectra of the inputs.
//! Memory does not grow with the length of the recording, and nothing is read twice.
//!
//! | file       | one idea                                            |
//! |------------|-----------------------------------------------------|
//! | `envelope` | the smallest and the largest value of each stretch  |

mod envelope;

pub use crate::moments::Excitation;
use crate::moments::Welch;
use envelope::Envelope;

use crate::identify::{Recording, Records};
use crate::log::{Channel, LogError};

/// Recordings that are watched while they are read.
pub struct Watched<'a> {
    records: &'a mut dyn Records,
    seen: Vec<Option<Seen>>,
}

/// What was gathered of one recording.
struct Seen {
    /// Inputs, then outputs.
    envelopes: Vec<Envelope>,
    /// Inputs.
    spectra: Vec<Welch>,
}

/// What there is to show of recordings.
#[derive(Debug, Clone, PartialEq)]
pub struct Overview {
    /// One an experiment.
    pub experiments: Vec<Experiment>,
}

/// What there is to show of one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Name of the recording.
    pub name: String,
    /// Samples.
    pub samples: usize,
    /// Date and time at second zero, when the recording has dates.
    pub origin: Option<String>,
    /// A line for each input, `(seconds, value)`: all samples, or smallest and largest of each stretch of them.
    pub inputs: Vec<Vec<(f64, f64)>>,
    /// The same for each output.
    pub outputs: Vec<Vec<(f64, f64)>>,
    /// The spectrum of each input; nothing for one that does not move or a recording too short for one.
    pub excitation: Vec<Option<Excitation>>,
}

impl std::fmt::Debug for Watched<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Watched").finish_non_exhaustive()
    }
}

impl<'a> Watched<'a> {
    /// Watches recordings that were not read yet.
    pub fn new(records: &'a mut dyn Records) -> Self {
        let seen = (0..records.experiments()).map(|_| None).collect();
        Self { records, seen }
    }

    /// What was seen of the recordings that were read whole.
    pub fn overview(&self) -> Overview {
        let sample_time = self.records.sample_time();
        let inputs = self.records.inputs().len();
        let recordings = self.records.recordings();
        let experiments = self.seen.iter().zip(recordings);
        let experiments = experiments.filter_map(|(seen, recording)| {
            let seen = seen.as_ref()?;
            let mut lines = seen
                .envelopes
                .iter()
                .map(|e| e.line(recording.start_time, sample_time));
            Some(Experiment {
                inputs: lines.by_ref().take(inputs).collect(),
                outputs: lines.collect(),
                excitation: seen
                    .spectra
                    .iter()
                    .map(|s| s.excitation(sample_time))
                    .collect(),
                name: recording.name,
                samples: recording.samples,
                origin: recording.origin,
            })
        });
        Overview {
            experiments: experiments.collect(),
        }
    }
}

impl Records for Watched<'_> {
    fn experiments(&self) -> usize {
        self.records.experiments()
    }

    fn inputs(&self) -> &[Channel] {
        self.records.inputs()
    }

    fn outputs(&self) -> &[Channel] {
        self.records.outputs()
    }

    fn sample_time(&self) -> f64 {
        self.records.sample_time()
    }

    fn recordings(&self) -> Vec<Recording> {
        self.records.recordings()
    }

    fn kept_samples(&self, experiment: usize) -> usize {
        self.records.kept_samples(experiment)
    }

    fn read(
        &mut self,
        experiment: usize,
        limit: Option<usize>,
        sink: &mut dyn FnMut(&[&[f64]]),
    ) -> Result<(), LogError> {
        if limit.is_some() || self.seen[experiment].is_some() {
            return self.records.read(experiment, limit, sink);
        }
        let inputs = self.records.inputs().len();
        let channels = inputs + self.records.outputs().len();
        let mut seen = Seen {
            envelopes: vec![Envelope::default(); channels],
            spectra: (0..inputs).map(|_| Welch::default()).collect(),
        };
        self.records.read(experiment, None, &mut |block| {
            for (envelope, column) in seen.envelopes.iter_mut().zip(block) {
                envelope.push(column);
            }
            for (spectrum, column) in seen.spectra.iter_mut().zip(block) {
                spectrum.push(column);
            }
            sink(block);
        })?;
        seen.spectra.iter_mut().for_each(Welch::end);
        self.seen[experiment] = Some(seen);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::MemoryRecords;
    use crate::systems::van_wingerden_one;

    #[test]
    fn watching_changes_nothing_that_is_read() {
        let logs = [
            van_wingerden_one().record(3000, 1),
            van_wingerden_one().record(500, 2),
        ];
        let mut records = MemoryRecords::new(&logs).unwrap();
        let mut watched = Watched::new(&mut records);
        assert!(watched.overview().experiments.is_empty());
        for (index, log) in logs.iter().enumerate() {
            let mut read = Vec::new();
            let mut keep = |block: &[&[f64]]| read.extend_from_slice(block[0]);
            watched.read(index, None, &mut keep).unwrap();
            assert_eq!(read, log.input_data[0]);
        }
        let overview = watched.overview();
        for (experiment, log) in overview.experiments.iter().zip(&logs) {
            assert_eq!((experiment.inputs.len(), experiment.outputs.len()), (2, 2));
            let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::MIN, f64::max);
            assert_eq!(
                largest(&mut experiment.outputs[1].iter().map(|p| p.1)),
                largest(&mut log.output_data[1].iter().copied())
            );
            assert!(experiment.excitation.iter().all(Option::is_some));
        }
        // Short enough to be drawn as it is.
        assert_eq!(overview.experiments[1].inputs[0].len(), 500);
        assert_eq!(
            overview.experiments[1].inputs[0][3].1,
            logs[1].input_data[0][3]
        );
    }
}
