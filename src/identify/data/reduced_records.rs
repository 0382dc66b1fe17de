//! Recordings of which only moments are left: what a cluster sends around instead of samples.
//!
//! Each machine reduces what it has; chunks of one recording are joined with [`ReducedRecords::append`], recordings
//! with [`ReducedRecords::add`], and the result goes into [`identify_records`](crate::identify::identify_records) like any
//! other `Records`. The moments carry the first and the last `lags` samples of every chunk, so chunks need no
//! overlap of their own (but for known delays), and the model is that of all samples on one machine.

use serde::{Deserialize, Serialize};

use super::delay::Aligner;
use super::lags::lags_needed;
use crate::identify::{IdentifyError, Options};
use crate::log::{Channel, Log, check_same_channels, check_same_sampling};
use crate::moments::{LagAccumulator, LagMoments};

/// Format name and version of the document.
const FORMAT: &str = "innovant-moments/1";

/// Samples at the beginning of a recording that are kept by default. The initial state and the residual tests look
/// at them; the system matrices and their covariance never do.
pub const SAMPLES_KEPT: usize = 20_000;

/// Recordings of one plant, reduced to moments.
///
/// ```
/// use innovant::identify::{Options, ReducedRecords, SAMPLES_KEPT, identify, identify_records};
///
/// let options = Options::default();
/// let log = innovant::internal::systems::van_wingerden_one().record(4000, 1);
/// let (first, second) = log.split_at(1500)?;
/// let mut reduced = ReducedRecords::new(&first, 0, &options, SAMPLES_KEPT)?
///     .append(&ReducedRecords::new(&second, 0, &options, 0)?)?;
/// let model = identify_records(&mut reduced, &options)?;
/// let whole = identify(&[log], &options)?;
/// assert!((model.system.a - whole.system.a).amax() < 1e-10);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReducedRecords {
    format: String,
    pub(crate) inputs: Vec<Channel>,
    pub(crate) outputs: Vec<Channel>,
    pub(crate) sample_time: f64,
    delays: Vec<usize>,
    lags: usize,
    by_block: bool,
    pub(crate) experiments: Vec<Experiment>,
}

/// One recording, or a part of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Experiment {
    pub(crate) name: String,
    pub(crate) start_time: f64,
    /// Samples, before known delays are taken out.
    pub(crate) samples: usize,
    /// Moments of consecutive parts; one of the whole unless blocks are wanted.
    blocks: Vec<LagMoments>,
    /// First samples as recorded, a column a channel.
    pub(crate) beginning: Vec<Vec<f64>>,
}

impl ReducedRecords {
    /// Reduces a recording, or a chunk of one.
    ///
    /// - `overlap`: samples at the beginning of `log` that belong to the chunk before; 0 for the first chunk, and
    ///   the longest known delay for the others, whose outputs answer to inputs of the chunk before.
    /// - `options`: windows, method and delays decide how many lags are needed; with a robust covariance every chunk
    ///   stays a block of the jackknife.
    /// - `keep`: samples kept from the beginning ([`SAMPLES_KEPT`]); 0 for chunks that do not come first.
    ///
    /// # Errors
    /// [`IdentifyError`] for windows that are impossible, delays that do not fit, or a chunk not longer than its
    /// overlap.
    pub fn new(
        log: &Log,
        overlap: usize,
        options: &Options,
        keep: usize,
    ) -> Result<Self, IdentifyError> {
        let (r, l) = (log.inputs.len(), log.outputs.len());
        let delays = options.delays_of(r)?;
        let longest = delays.iter().copied().max().unwrap_or(0);
        if overlap != 0 && overlap != longest {
            return Err(IdentifyError::Option(format!(
                "{}: the chunk overlaps the one before by {overlap} samples, and must by the longest known delay, \
                 {longest}",
                log.name
            )));
        }
        let needed = longest.max(1);
        if log.samples() < needed + overlap {
            return Err(IdentifyError::Option(format!(
                "{}: a chunk of {} samples is too short, it needs at least {needed} beyond the overlap of {overlap}; \
                 make larger chunks",
                log.name,
                log.samples()
            )));
        }
        let lags = lags_needed(options, r, l)?;
        let mut accumulator = LagAccumulator::new(r + l, lags);
        let columns = || log.input_data.iter().chain(&log.output_data);
        let slices: Vec<&[f64]> = columns().map(Vec::as_slice).collect();
        Aligner::new(&delays, l).push(&slices, &mut |part| accumulator.push(part));
        let samples = log.samples() - overlap;
        Ok(Self {
            format: FORMAT.to_owned(),
            inputs: log.inputs.clone(),
            outputs: log.outputs.clone(),
            sample_time: log.sample_time,
            delays,
            lags,
            by_block: options.may_need_blocks(),
            experiments: vec![Experiment {
                name: log.name.clone(),
                start_time: log.start_time + overlap as f64 * log.sample_time,
                samples,
                blocks: vec![accumulator.moments()],
                beginning: columns()
                    .map(|c| c[overlap..overlap + keep.min(samples)].to_vec())
                    .collect(),
            }],
        })
    }

    /// The recording that goes on with `next`, without a gap: both are parts of one recording.
    ///
    /// # Errors
    /// [`IdentifyError`] when they differ in channels, sampling, windows or delays, or when either holds several
    /// recordings.
    pub fn append(&self, next: &Self) -> Result<Self, IdentifyError> {
        self.check_same_kind(next)?;
        let ([before], [after]) = (self.experiments.as_slice(), next.experiments.as_slice()) else {
            return Err(IdentifyError::Option(
                "only chunks of one recording can be appended to each other; several recordings are added".to_owned(),
            ));
        };
        let mut joined = before.clone();
        joined.samples += after.samples;
        // What is kept is the beginning without a gap, or less.
        if before.beginning[0].len() == before.samples {
            for (column, more) in joined.beginning.iter_mut().zip(&after.beginning) {
                column.extend_from_slice(more);
            }
        }
        joined.blocks.extend(after.blocks.iter().cloned());
        if !self.by_block {
            joined.blocks = vec![whole(&joined.blocks)];
        }
        Ok(Self {
            experiments: vec![joined],
            ..self.clone()
        })
    }

    /// These recordings and those of `other`: several experiments of one plant.
    ///
    /// # Errors
    /// [`IdentifyError`] when they differ in channels, sampling, windows or delays.
    pub fn add(&self, other: &Self) -> Result<Self, IdentifyError> {
        self.check_same_kind(other)?;
        let mut sum = self.clone();
        sum.experiments.extend(other.experiments.iter().cloned());
        Ok(sum)
    }

    fn check_same_kind(&self, other: &Self) -> Result<(), IdentifyError> {
        let (one, two) = (self.name(), other.name());
        check_same_channels(&one, &self.inputs, &two, &other.inputs, "inputs")?;
        check_same_channels(&one, &self.outputs, &two, &other.outputs, "outputs")?;
        check_same_sampling(&one, self.sample_time, &two, other.sample_time)?;
        for (what, a, b) in [
            ("lags", self.lags.to_string(), other.lags.to_string()),
            (
                "known delays",
                format!("{:?}", self.delays),
                format!("{:?}", other.delays),
            ),
            (
                "kinds of covariance",
                kind(self.by_block),
                kind(other.by_block),
            ),
        ] {
            if a != b {
                return Err(IdentifyError::Option(format!(
                    "moments of {one} and {two} have different {what}: {a} and {b}; make them with the same options"
                )));
            }
        }
        Ok(())
    }

    fn name(&self) -> String {
        self.experiments
            .first()
            .map_or_else(String::new, |e| e.name.clone())
    }

    /// Samples of all recordings.
    pub fn samples(&self) -> usize {
        self.experiments.iter().map(|e| e.samples).sum()
    }

    /// Largest lag of the moments.
    pub fn lags(&self) -> usize {
        self.lags
    }

    /// Known delay of each input.
    pub(crate) fn delays(&self) -> &[usize] {
        &self.delays
    }

    /// The moments of each recording.
    pub(super) fn wholes(&self) -> Vec<LagMoments> {
        self.experiments.iter().map(|e| whole(&e.blocks)).collect()
    }

    /// The moments of each recording in about `wanted` consecutive blocks of similar length.
    pub(crate) fn blocks(&self, wanted: usize) -> Vec<Vec<LagMoments>> {
        self.experiments
            .iter()
            .map(|experiment| {
                let least = experiment.samples.div_ceil(wanted.max(1));
                let mut blocks: Vec<LagMoments> = Vec::new();
                for part in &experiment.blocks {
                    match blocks.last_mut() {
                        Some(open) if open.samples() < least => *open = open.append(part),
                        _ => blocks.push(part.clone()),
                    }
                }
                blocks
            })
            .collect()
    }

    /// The document that [`ReducedRecords::from_json`] reads, exact to the last bit.
    ///
    /// # Errors
    /// [`serde_json::Error`], for moments that are not finite.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string(self)
    }

    /// Reads what [`ReducedRecords::to_json`] wrote.
    ///
    /// # Errors
    /// [`IdentifyError::Option`] says what is wrong with the document.
    pub fn from_json(text: &str) -> Result<Self, IdentifyError> {
        let damaged = |what: &str| IdentifyError::Option(format!("these are no moments: {what}"));
        let read: Self = serde_json::from_str(text).map_err(|error| damaged(&error.to_string()))?;
        if read.format != FORMAT {
            return Err(damaged(&format!(
                "the format is `{}`, and `{FORMAT}` is needed",
                read.format
            )));
        }
        let q = read.inputs.len() + read.outputs.len();
        let fits = |e: &Experiment| {
            let kept = e.beginning.first().map_or(0, Vec::len);
            !e.blocks.is_empty()
                && e.beginning.len() == q
                && e.beginning.iter().all(|c| c.len() == kept)
                && e.blocks
                    .iter()
                    .all(|b| b.is_consistent() && b.channels() == q && b.lags() == read.lags)
        };
        if read.delays.len() != read.inputs.len()
            || read.outputs.is_empty()
            || read.experiments.is_empty()
            || !read.experiments.iter().all(fits)
        {
            return Err(damaged("their sizes do not fit together"));
        }
        Ok(read)
    }
}

fn kind(by_block: bool) -> String {
    if by_block { "robust" } else { "model" }.to_owned()
}

/// Blocks in their order as one; there is at least one.
fn whole(blocks: &[LagMoments]) -> LagMoments {
    let mut whole = blocks[0].clone();
    for block in &blocks[1..] {
        whole = whole.append(block);
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::{CovarianceKind, Order, identify, identify_records};
    use crate::systems::van_wingerden_one;

    /// Parts of a recording, each with the overlap that the delay asks for.
    fn reduced(log: &Log, cuts: &[usize], options: &Options) -> ReducedRecords {
        let overlap = options.input_delay.iter().copied().max().unwrap_or(0);
        let mut from = 0;
        let mut joined: Option<ReducedRecords> = None;
        for to in cuts.iter().copied().chain([log.samples()]) {
            let overlap = if from == 0 { 0 } else { overlap };
            let cut = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
                columns
                    .iter()
                    .map(|c| c[from - overlap..to].to_vec())
                    .collect()
            };
            let part = Log {
                input_data: cut(&log.input_data),
                output_data: cut(&log.output_data),
                ..log.clone()
            };
            let keep = if from == 0 { SAMPLES_KEPT } else { 0 };
            let part = ReducedRecords::new(&part, overlap, options, keep).unwrap();
            // As a cluster would send it.
            let part = ReducedRecords::from_json(&part.to_json().unwrap()).unwrap();
            joined = Some(match joined {
                Some(before) => before.append(&part).unwrap(),
                None => part,
            });
            from = to;
        }
        joined.unwrap()
    }

    fn same(options: &Options) {
        let logs = [
            van_wingerden_one().record(6000, 1),
            van_wingerden_one().record(4000, 2),
        ];
        let whole = identify(&logs, options).unwrap();
        let first = reduced(&logs[0], &[1500, 1700, 4000], options);
        let mut sum = first.add(&reduced(&logs[1], &[2000], options)).unwrap();
        let model = identify_records(&mut sum, options).unwrap();
        for (ours, theirs) in [
            (&model.system.a, &whole.system.a),
            (&model.system.b, &whole.system.b),
            (&model.system.c, &whole.system.c),
            (&model.system.k, &whole.system.k),
            (
                &model.covariance.as_ref().unwrap().matrix,
                &whole.covariance.as_ref().unwrap().matrix,
            ),
        ] {
            if options.covariance == CovarianceKind::Model || ours.nrows() == 4 {
                assert!((ours - theirs).amax() < 1e-10, "{ours} {theirs}");
            }
        }
        assert!((&model.initial_state - &whole.initial_state).amax() < 1e-8);
        assert_eq!(
            model.summary.unwrap().samples,
            whole.summary.unwrap().samples
        );
    }

    #[test]
    fn chunks_and_logs_give_the_model_of_one_machine() {
        same(&Options::default());
    }

    #[test]
    fn delays_and_methods_too() {
        same(&Options {
            input_delay: vec![3, 1],
            order: Order::Fixed(4),
            ..Options::default()
        });
        same(&Options {
            method: crate::identify::Method::Whitening,
            order: Order::Fixed(4),
            past: Some(12),
            ..Options::default()
        });
    }

    #[test]
    fn a_robust_covariance_is_made_of_chunks() {
        let options = Options {
            covariance: CovarianceKind::Robust,
            order: Order::Fixed(4),
            ..Options::default()
        };
        let log = van_wingerden_one().record(6000, 1);
        let cuts: Vec<usize> = (1..30).map(|i| 200 * i).collect();
        let mut parts = reduced(&log, &cuts, &options);
        let model = identify_records(&mut parts, &options).unwrap();
        let whole = identify(&[log], &options).unwrap();
        assert!((model.system.a - whole.system.a).amax() < 1e-10);
        let blocks = |s: &Option<crate::identify::Summary>| {
            s.as_ref().unwrap().diagnostics.jackknife_blocks.unwrap()
        };
        assert!((15..=30).contains(&blocks(&model.summary)));
        // Other blocks, the same uncertainty as far as so many blocks tell it.
        let trace =
            |c: &Option<crate::covariance::ParameterCovariance>| c.as_ref().unwrap().matrix.trace();
        let ratio = trace(&model.covariance) / trace(&whole.covariance);
        assert!((0.5..2.0).contains(&ratio), "{ratio}");
    }

    #[test]
    fn what_does_not_belong_together_is_refused() {
        let log = van_wingerden_one().record(500, 1);
        let make = |options: &Options| ReducedRecords::new(&log, 0, options, 10).unwrap();
        let plain = make(&Options::default());
        let short = make(&Options {
            past: Some(7),
            ..Options::default()
        });
        let error = plain.append(&short).unwrap_err().to_string();
        assert!(error.contains("different lags: 250 and 7"), "{error}");
        let two = plain.add(&plain).unwrap();
        assert!(two.append(&plain).is_err());
        let mut short = short;
        let error = identify_records(&mut short, &Options::default()).unwrap_err();
        assert!(error.to_string().contains("7 lags"), "{error}");
        let text = plain
            .to_json()
            .unwrap()
            .replace("\"lags\":250", "\"lags\":9");
        assert!(ReducedRecords::from_json(&text).is_err());
    }

    #[test]
    fn moments_that_are_too_ill_conditioned_say_so() {
        let mut log = van_wingerden_one().record(500, 1);
        // Inputs that nothing but rounding tells apart.
        log.input_data[1] = log.input_data[0]
            .iter()
            .enumerate()
            .map(|(k, u)| u + 1e-5 * (k as f64 * 0.7).sin())
            .collect();
        let mut reduced = ReducedRecords::new(&log, 0, &Options::default(), 0).unwrap();
        let error = identify_records(&mut reduced, &Options::default()).unwrap_err();
        assert!(
            matches!(error, IdentifyError::MomentsOnly { .. }),
            "{error}"
        );
    }
}
