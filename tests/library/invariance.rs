//! What must not change the model: the unit of time, the order of channels, how the samples arrive, the number of
//! threads. Units and offsets of the channels and the order of experiments are in `properties`.

use std::io::Write as _;

use innovant::covariance::{frequency_response_covariance, pole_uncertainties};
use innovant::identify::{
    CovarianceKind, FileRecords, Method, Order, Recording, Records, ReducedRecords, SAMPLES_KEPT,
    identify_records,
};
use innovant::internal::systems::{servo, two_by_two, van_wingerden_one};
use innovant::log::{Channel, Log, LogError, Roles, Source};
use innovant::report::ModelDocument;
use innovant::{Model, Options, identify};
use proptest::prelude::*;
use proptest::sample::Index;

/// Two models are the same up to the order of sums: a double has 1e-16, the condition of the moments' factor (at least
/// 1e-6 reciprocal, mostly 1e-2) takes some of it, and the polish ends within 1e-10 standard deviations.
const ROUNDING: f64 = 1e-8;
/// ... but along a state that the recording hardly shows (an order 3 where Schwarz's criterion says 2) rounding goes ten
/// thousand times as far, in standard deviations.
const HARDLY_SHOWN: f64 = 1e-6;

/// By how many standard deviations a response may differ, and by what share its covariance: the prediction error method
/// passes over all samples for each step, and ends within 1e-3 standard deviations of its minimum.
fn ends_within(method: Method) -> (f64, f64) {
    match method {
        Method::Pem => (2e-3, 2e-3),
        _ => (0.0, ROUNDING),
    }
}

fn document(model: &Model) -> String {
    ModelDocument::new(model).unwrap().to_json().unwrap()
}

/// A search over the samples has no one end along a state that the recording does not show, so its order is chosen.
fn options_of(method: Method) -> Options {
    let automatic = matches!(method, Method::PbsidOpt | Method::Pem);
    Options {
        method,
        order: if automatic {
            Order::Auto
        } else {
            Order::Fixed(3)
        },
        past: (!automatic).then_some(12),
        ..Options::default()
    }
}

const METHODS: [Method; 4] = [
    Method::PbsidOpt,
    Method::Whitening,
    Method::Subid,
    Method::Pem,
];

/// The same samples at another rate are the same matrices; poles, zeros and the covariance of what has a time in it follow.
#[test]
fn the_unit_of_time_scales_the_poles() {
    for method in METHODS {
        let log = two_by_two().record(1200, 3);
        let seconds = identify(std::slice::from_ref(&log), &options_of(method)).unwrap();
        for unit in [1e-3, 1e3, 1e-9] {
            let other = Log {
                sample_time: log.sample_time * unit,
                ..log.clone()
            };
            let model = identify(&[other], &options_of(method)).unwrap();
            assert_eq!(model.system.a, seconds.system.a, "{method:?}");
            assert_eq!(model.system.k, seconds.system.k, "{method:?}");
            assert_eq!(model.covariance, seconds.covariance, "{method:?}");
            let poles =
                |m: &Model| pole_uncertainties(&m.system, m.covariance.as_ref().unwrap()).unwrap();
            for (a, b) in poles(&model).iter().zip(poles(&seconds)) {
                let frequency = a.pole.natural_frequency * unit / b.pole.natural_frequency;
                let deviation =
                    a.natural_frequency_std.unwrap() * unit / b.natural_frequency_std.unwrap();
                assert!((frequency - 1.0).abs() < 1e-12, "{frequency}");
                assert!((deviation - 1.0).abs() < 1e-12, "{deviation}");
                assert_eq!(a.pole.damping, b.pole.damping);
            }
        }
    }
}

/// `columns[i]` of the result is `columns[order[i]]`.
fn reordered<T: Clone>(columns: &[T], order: &[usize]) -> Vec<T> {
    order.iter().map(|i| columns[*i].clone()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Permuted channels give the permuted model with the permuted covariance.
    #[test]
    fn the_order_of_channels_does_not_matter(
        turn_inputs in any::<bool>(), seed in 0_u64..1000, which in any::<Index>(),
    ) {
        let method = METHODS[which.index(METHODS.len())];
        let log = two_by_two().record(1200, seed);
        let inputs = if turn_inputs { [1, 0] } else { [0, 1] };
        let outputs = if turn_inputs { [0, 1] } else { [1, 0] };
        let turned = Log {
            inputs: reordered(&log.inputs, &inputs),
            input_data: reordered(&log.input_data, &inputs),
            outputs: reordered(&log.outputs, &outputs),
            output_data: reordered(&log.output_data, &outputs),
            ..log.clone()
        };
        let a = identify(&[log], &options_of(method)).unwrap();
        let b = identify(&[turned], &options_of(method)).unwrap();
        prop_assert_eq!(a.system.states(), b.system.states());
        for w in [0.05, 0.3, 1.0] {
            let response = |m: &Model| m.system.frequency_response(w);
            let covariance = |m: &Model| {
                frequency_response_covariance(&m.system, m.covariance.as_ref().unwrap(), w).unwrap()
            };
            let (ga, gb, va, vb) = (response(&a), response(&b), covariance(&a), covariance(&b));
            for (i, from) in outputs.into_iter().enumerate() {
                for (j, of) in inputs.into_iter().enumerate() {
                    let (x, y) = (va[(from, of)], vb[(i, j)]);
                    let size = x[0][0] + x[1][1];
                    let (deviations, share) = ends_within(method);
                    let (apart, of) = ((gb[(i, j)] - ga[(from, of)]).norm(), ga[(from, of)].norm());
                    let most = ROUNDING * of + deviations * size.sqrt();
                    prop_assert!(apart < most, "{:?}: {:e} of {:e}", method, apart, of);
                    for (x, y) in x.as_flattened().iter().zip(y.as_flattened()) {
                        prop_assert!((x - y).abs() < share * size, "{:?}: {:e}", method, (x - y).abs() / size);
                    }
                }
            }
        }
    }
}

/// A recording that arrives so many samples at a time.
struct Pieces<'a> {
    log: &'a Log,
    piece: usize,
}

impl Records for Pieces<'_> {
    fn experiments(&self) -> usize {
        1
    }

    fn inputs(&self) -> &[Channel] {
        &self.log.inputs
    }

    fn outputs(&self) -> &[Channel] {
        &self.log.outputs
    }

    fn sample_time(&self) -> f64 {
        self.log.sample_time
    }

    fn recordings(&self) -> Vec<Recording> {
        vec![Recording {
            name: self.log.name.clone(),
            sha256: self.log.sha256.clone(),
            samples: self.log.samples(),
            start_time: self.log.start_time,
            origin: None,
            reading: None,
        }]
    }

    fn kept_samples(&self, _: usize) -> usize {
        self.log.samples()
    }

    fn read(
        &mut self,
        _: usize,
        limit: Option<usize>,
        sink: &mut dyn FnMut(&[&[f64]]),
    ) -> Result<(), LogError> {
        let samples = limit.unwrap_or(usize::MAX).min(self.log.samples());
        for from in (0..samples).step_by(self.piece) {
            let to = (from + self.piece).min(samples);
            let columns = self.log.channel_data();
            let parts: Vec<&[f64]> = columns.iter().map(|c| &c[from..to]).collect();
            sink(&parts);
        }
        Ok(())
    }
}

/// However the samples arrive, in memory or from a file, the document is the same to the last digit.
#[test]
fn pieces_do_not_matter() {
    let log = van_wingerden_one().record(2500, 4);
    for options in [
        Options::default(),
        Options {
            covariance: CovarianceKind::Robust,
            input_delay: vec![2, 0],
            order: Order::Fixed(4),
            past: Some(10),
            ..Options::default()
        },
    ] {
        let whole = document(&identify(std::slice::from_ref(&log), &options).unwrap());
        for piece in [1, 7, 1024, 2499] {
            let mut pieces = Pieces { log: &log, piece };
            let model = identify_records(&mut pieces, &options).unwrap();
            assert_eq!(document(&model), whole, "pieces of {piece}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    /// Moments of chunks, cut anywhere and joined, give the model of all samples: sums in another order round otherwise, and
    /// where the polish ends does not depend on that.
    #[test]
    fn chunks_that_were_reduced_apart_do_not_matter(
        seed in 1_u64..1000, cuts in prop::collection::btree_set(1_usize..3999, 1..4), wide in any::<bool>(),
    ) {
        let log = if wide { van_wingerden_one() } else { two_by_two() }.record(4000, seed);
        let options = Options::default();
        let mut rest = log.clone();
        let mut taken = 0;
        let mut joined: Option<ReducedRecords> = None;
        for cut in cuts.into_iter().map(Some).chain([None]) {
            let (part, left) = match cut {
                Some(at) => rest.split_at(at - taken).map(|(part, left)| (part, Some(left))).unwrap(),
                None => (rest.clone(), None),
            };
            let keep = if taken == 0 { SAMPLES_KEPT } else { 0 };
            taken += part.samples();
            let part = ReducedRecords::new(&part, 0, &options, keep).unwrap();
            joined = Some(match joined {
                Some(before) => before.append(&part).unwrap(),
                None => part,
            });
            rest = left.unwrap_or(rest);
        }
        let model = identify_records(&mut joined.unwrap(), &options).unwrap();
        let whole = identify(&[log], &options).unwrap();
        prop_assert_eq!(model.system.states(), whole.system.states());
        for w in [0.05, 0.3, 1.0, 3.0] {
            let (ours, theirs) = (model.system.frequency_response(w), whole.system.frequency_response(w));
            let covariance = whole.covariance.as_ref().unwrap();
            let spread = frequency_response_covariance(&whole.system, covariance, w).unwrap();
            for ((a, b), v) in ours.iter().zip(theirs.iter()).zip(spread.iter()) {
                let (apart, std) = ((a - b).norm(), (v[0][0] + v[1][1]).sqrt());
                prop_assert!(apart < HARDLY_SHOWN * std, "{:e} of {:e}", apart, std);
            }
        }
    }
}

/// A file gives the model of its samples.
#[test]
fn files_are_what_they_hold() {
    let log = servo().record(1500, 4);
    let mut file = tempfile::NamedTempFile::with_suffix(".csv").unwrap();
    let copy = file.path().with_extension("copy.csv");
    log.write_csv(&copy).unwrap();
    file.write_all(&std::fs::read(&copy).unwrap()).unwrap();
    std::fs::remove_file(copy).unwrap();
    let source = Source::from(file.path().to_path_buf());
    let read = Log::read(&source, &Roles::default()).unwrap();
    assert_eq!(
        (&read.input_data, &read.output_data),
        (&log.input_data, &log.output_data)
    );
    let mut streamed = FileRecords::open(vec![source], Roles::default()).unwrap();
    let options = Options::default();
    let of_stream = identify_records(&mut streamed, &options).unwrap();
    assert_eq!(
        document(&of_stream),
        document(&identify(&[read], &options).unwrap())
    );
}

/// The number of threads does not change a digit.
#[test]
fn threads_do_not_matter() {
    let log = two_by_two().record(1500, 9);
    let robust = Options {
        covariance: CovarianceKind::Robust,
        ..Options::default()
    };
    for options in METHODS.map(options_of).into_iter().chain([robust]) {
        let [one, two] = [1, 2].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| document(&identify(std::slice::from_ref(&log), &options).unwrap()))
        });
        assert_eq!(one, two, "{:?}", options.method);
    }
}
