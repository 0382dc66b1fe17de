//! The recording as moments: read once, factored for any past window.

use super::delay::Aligner;
use super::records::Records;
use super::reduced_records::ReducedRecords;
use crate::identify::IdentifyError;
use crate::identify::options::{JACKKNIFE_BLOCKS, Options};
use crate::log::{Channel, LARGEST_SIZE};
use crate::moments::{
    BlockAccumulator, Gram, LagAccumulator, LagMoments, PanelQr, RFactor, Trend, block_grams,
};

/// Two channels whose correlation differs from one by less are the same signal to rounding.
const SAME_SIGNAL: f64 = 1e-12;
/// A channel that varies by less, relative to its size, is constant to rounding.
const CONSTANT: f64 = 1e-13;

/// Moments of all experiments, with their trends.
#[derive(Debug)]
pub(crate) struct Data {
    experiments: Vec<LagMoments>,
    blocks: Vec<Vec<LagMoments>>,
    trends: Vec<Trend>,
    delays: Vec<usize>,
    inputs: usize,
    /// Divisor of each channel.
    pub(crate) scale: Vec<f64>,
    /// Level of each channel, averaged over the experiments.
    pub(crate) levels: Vec<f64>,
    /// Samples of all experiments.
    pub(crate) samples: usize,
}

impl Data {
    /// Reads every experiment once.
    ///
    /// # Errors
    /// What is wrong with a file, a constant channel, or the same signal twice.
    pub(crate) fn read(
        records: &mut dyn Records,
        options: &Options,
        lags: usize,
    ) -> Result<Self, IdentifyError> {
        if let Some(reduced) = records.reduced() {
            return Self::of_reduced(reduced, options, lags);
        }
        let (inputs, outputs) = (records.inputs().len(), records.outputs().len());
        let q = inputs + outputs;
        let delays = options.delays_of(inputs)?;
        let robust = options.may_need_blocks();
        let mut experiments = Vec::new();
        let mut blocks = Vec::new();
        let per_experiment = JACKKNIFE_BLOCKS.div_ceil(records.experiments());
        for experiment in 0..records.experiments() {
            let mut aligner = Aligner::new(&delays, outputs);
            if robust {
                let mut accumulator = BlockAccumulator::new(q, lags, per_experiment);
                records.read(experiment, None, &mut |columns| {
                    aligner.push(columns, &mut |columns| accumulator.push(columns));
                })?;
                let parts = accumulator.finish();
                let whole = parts
                    .iter()
                    .skip(1)
                    .fold(parts.first().cloned(), |whole, part| {
                        whole.map(|w| w.append(part))
                    });
                let empty = || LagAccumulator::new(q, lags).moments();
                experiments.push(whole.unwrap_or_else(empty));
                blocks.push(parts);
            } else {
                let mut accumulator = LagAccumulator::new(q, lags);
                records.read(experiment, None, &mut |columns| {
                    aligner.push(columns, &mut |columns| accumulator.push(columns));
                })?;
                experiments.push(accumulator.moments());
            }
        }
        let channels = (records.inputs(), records.outputs());
        Self::assemble(experiments, blocks, delays, channels, options)
    }

    /// Moments that were made elsewhere.
    fn of_reduced(
        reduced: &ReducedRecords,
        options: &Options,
        lags: usize,
    ) -> Result<Self, IdentifyError> {
        if reduced.lags() < lags {
            return Err(IdentifyError::Option(format!(
                "the moments hold {} lags, and these windows and this method need {lags}: make the moments with the \
                 options that the model is identified with",
                reduced.lags()
            )));
        }
        let delays = options.delays_of(reduced.inputs().len())?;
        if delays != reduced.delays() {
            return Err(IdentifyError::Option(format!(
                "the moments were made with the known delays {:?}, and {delays:?} are asked for: make the moments with \
                 the options that the model is identified with",
                reduced.delays()
            )));
        }
        let wanted = JACKKNIFE_BLOCKS.div_ceil(reduced.experiments());
        let blocks = if options.may_need_blocks() {
            reduced.blocks(wanted)
        } else {
            Vec::new()
        };
        let channels = (reduced.inputs(), reduced.outputs());
        Self::assemble(reduced.wholes(), blocks, delays, channels, options)
    }

    fn assemble(
        experiments: Vec<LagMoments>,
        blocks: Vec<Vec<LagMoments>>,
        delays: Vec<usize>,
        (input_channels, output_channels): (&[Channel], &[Channel]),
        options: &Options,
    ) -> Result<Self, IdentifyError> {
        let (inputs, outputs) = (input_channels.len(), output_channels.len());
        let q = inputs + outputs;
        let trends: Vec<Trend> = experiments
            .iter()
            .map(|moments| moments.trend(options.detrend))
            .collect();
        let samples: usize = experiments.iter().map(LagMoments::samples).sum();
        let mut data = Self {
            scale: vec![1.0; q],
            levels: levels(&experiments, &trends, samples),
            experiments,
            blocks,
            trends,
            delays,
            inputs,
            samples,
        };
        let smallest = 2 * q + outputs + 2;
        if let Some(delay) = data.delays.iter().max()
            && samples < smallest
            && *delay > 0
        {
            return Err(IdentifyError::Option(format!(
                "--delay {delay} leaves only {samples} samples of the recording, and a model of {q} channels needs at \
                 least {smallest}; the delay is counted in samples"
            )));
        }
        if samples < smallest {
            return Err(IdentifyError::TooFewSamples {
                samples,
                channels: q,
                needed: smallest,
            });
        }
        data.check_channels(input_channels, output_channels)?;
        // Unit rms of what is left after detrending.
        let spread = data.gram(0);
        data.scale = (0..q)
            .map(|c| (spread.gram[(c, c)] / spread.columns as f64).sqrt())
            .collect();
        Ok(data)
    }

    fn check_channels(&self, inputs: &[Channel], outputs: &[Channel]) -> Result<(), IdentifyError> {
        let q = inputs.len() + outputs.len();
        let channel = |c: usize| {
            if c < inputs.len() {
                ("input", inputs[c].name.clone())
            } else {
                ("output", outputs[c - inputs.len()].name.clone())
            }
        };
        for c in 0..q {
            let largest = |of: &dyn Fn(&LagMoments) -> f64| {
                // NaN is what infinite sums leave: as large as can be.
                self.experiments
                    .iter()
                    .map(of)
                    .map(|v| if v.is_nan() { f64::INFINITY } else { v.abs() })
                    .fold(0.0, f64::max)
            };
            let level = largest(&|moments| moments.mean()[c]);
            let deviation = largest(&|moments| moments.standard_deviation()[c]);
            let size = || {
                let (role, name) = channel(c);
                IdentifyError::Size {
                    role,
                    name,
                    level,
                    deviation,
                }
            };
            if level.max(deviation) >= LARGEST_SIZE {
                return Err(size());
            }
            // A channel has to move in at least one experiment.
            let moves = self.experiments.iter().any(|moments| {
                let deviation = moments.standard_deviation()[c];
                let level = moments.mean()[c].abs();
                deviation > CONSTANT * level && deviation > 0.0
            });
            if !moves {
                let (role, name) = channel(c);
                return Err(IdentifyError::ConstantChannel {
                    role,
                    name,
                    place: if self.experiments.len() > 1 {
                        " in every recording".to_owned()
                    } else {
                        String::new()
                    },
                });
            }
            if deviation < 1.0 / LARGEST_SIZE {
                return Err(size());
            }
        }
        for j in 0..q {
            for i in 0..j {
                let same = self.experiments.iter().all(|moments| {
                    let correlation = moments.correlation(i, j).abs();
                    (1.0 - correlation).abs() < SAME_SIGNAL
                });
                if same {
                    return Err(IdentifyError::SameChannel {
                        first: channel(i).1,
                        second: channel(j).1,
                        correlation: self.experiments[0].correlation(i, j),
                    });
                }
            }
        }
        Ok(())
    }

    /// Number of channels.
    pub(crate) fn channels(&self) -> usize {
        self.scale.len()
    }

    /// Largest past window that the moments hold.
    pub(crate) fn lags(&self) -> usize {
        self.experiments
            .iter()
            .map(LagMoments::lags)
            .min()
            .unwrap_or(0)
    }

    /// Known delay of each input.
    pub(crate) fn delays(&self) -> &[usize] {
        &self.delays
    }

    /// Trend of an experiment.
    pub(crate) fn trend(&self, experiment: usize) -> &Trend {
        &self.trends[experiment]
    }

    fn gram(&self, past: usize) -> Gram {
        let mut sum = Gram::empty((past + 1) * self.channels());
        for (moments, trend) in self.experiments.iter().zip(&self.trends) {
            sum.add(&moments.gram(past, trend));
        }
        sum
    }

    /// Triangular factor for a past window: from the moments, or, when those are too ill-conditioned, by
    /// orthogonal panels of the data, which are read again.
    ///
    /// # Errors
    /// When reading again fails, or is needed and only moments are left.
    pub(crate) fn factor(
        &self,
        records: &mut dyn Records,
        past: usize,
    ) -> Result<RFactor, IdentifyError> {
        if let Ok(factor) = RFactor::from_gram(&self.gram(past), self.inputs, &self.scale) {
            return Ok(factor);
        }
        if records.reduced().is_some() {
            return Err(IdentifyError::MomentsOnly {
                reason: "the moments are too ill-conditioned to be factored",
            });
        }
        let outputs = self.channels() - self.inputs;
        let mut panels = PanelQr::new(past, &self.scale);
        for (experiment, trend) in self.trends.iter().enumerate() {
            panels.start_experiment(trend);
            let mut aligner = Aligner::new(&self.delays, outputs);
            records.read(experiment, None, &mut |columns| {
                aligner.push(columns, &mut |columns| panels.push(columns));
            })?;
        }
        let (r, columns) = panels.finish();
        Ok(RFactor::from_panels(r, columns, self.inputs, &self.scale))
    }

    /// Factors of all data but one block, for each block of the jackknife. Blocks whose removal leaves an
    /// ill-conditioned rest are left out.
    pub(crate) fn factors_without_blocks(&self, past: usize) -> Vec<RFactor> {
        let whole = self.gram(past);
        self.blocks
            .iter()
            .zip(&self.trends)
            .flat_map(|(blocks, trend)| block_grams(blocks, past, trend))
            .filter(|block| block.columns > 0)
            .filter_map(|block| {
                RFactor::from_gram(&whole.without(&block), self.inputs, &self.scale).ok()
            })
            .collect()
    }
}

fn levels(experiments: &[LagMoments], trends: &[Trend], samples: usize) -> Vec<f64> {
    let channels = trends.first().map_or(0, |t| t.level.len());
    let mut sum = vec![0.0; channels];
    for (moments, trend) in experiments.iter().zip(trends) {
        let weight = moments.samples() as f64 / samples.max(1) as f64;
        for (sum, level) in sum.iter_mut().zip(trend.middle(moments.samples())) {
            *sum += weight * level;
        }
    }
    sum
}
