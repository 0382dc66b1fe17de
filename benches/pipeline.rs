//! Reading, moments by both routes, fit, covariance. Rules: `benches/README.md`.

use divan::{Bencher, black_box};
use innovant::identify::Detrend;
use innovant::identify::{Order, Polish};
use innovant::internal::identify::fit;
use innovant::internal::moments::{LagAccumulator, PanelQr, Trend};
use innovant::internal::systems::van_wingerden_one;
use innovant::log::{Log, LogReader, RoleNeed, Roles, Source};
use innovant::{Options, identify};

fn main() {
    divan::main();
}

#[divan::bench(args = [100_000, 1_000_000], sample_count = 5)]
fn read_csv(bencher: Bencher, samples: usize) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("log.csv");
    van_wingerden_one()
        .record(samples, 1)
        .write_csv(&path)
        .expect("a recording on disk");
    let source = Source::Path(path);
    bencher.bench(|| {
        let mut reader =
            LogReader::open(&source, &Roles::default(), RoleNeed::Identify).expect("the recording");
        let mut block = innovant::log::Block::new();
        while reader.next_block(&mut block).expect("a block") {
            black_box(&block);
        }
        reader.finish().expect("a summary")
    });
}

#[divan::bench(args = [(1_000_000, 20), (1_000_000, 100)], sample_count = 5)]
fn moments_by_lag((samples, past): (usize, usize)) -> f64 {
    moments(samples, past)
}

/// The recording is made once for all benchmarks of a size.
fn recording(samples: usize) -> &'static Log {
    use std::collections::HashMap;
    use std::sync::{Mutex, OnceLock};
    static LOGS: OnceLock<Mutex<HashMap<usize, &'static Log>>> = OnceLock::new();
    let mut logs = LOGS
        .get_or_init(Mutex::default)
        .lock()
        .expect("no benchmark panics");
    logs.entry(samples)
        .or_insert_with(|| Box::leak(Box::new(van_wingerden_one().record(samples, 1))))
}

fn moments(samples: usize, past: usize) -> f64 {
    let mut accumulator = LagAccumulator::new(4, past);
    accumulator.push(&recording(samples).channel_data());
    let moments = accumulator.moments();
    moments.gram(past, &moments.trend(Detrend::Mean)).gram[(0, 0)]
}

#[divan::bench(args = [(1_000_000, 20), (100_000, 100)], sample_count = 3)]
fn moments_by_panels((samples, past): (usize, usize)) -> usize {
    let mut panels = PanelQr::new(past, &[1.0; 4]);
    panels.start_experiment(&Trend::zero(4));
    panels.push(&recording(samples).channel_data());
    panels.finish().1
}

fn options(past: usize, polish: Polish) -> Options {
    Options {
        order: Order::Fixed(4),
        past: Some(past),
        polish,
        ..Options::default()
    }
}

/// The paper's setting (N = 2000, p = f = 100) and a shorter window: estimate and covariance from samples
/// in memory, without and with the polish.
#[divan::bench(args = [20, 100], sample_count = 20)]
fn fit_subspace(past: usize) {
    fit_with(past, Polish::Never);
}

#[divan::bench(args = [20, 100], sample_count = 20)]
fn fit_polished(past: usize) {
    fit_with(past, Polish::Always);
}

fn fit_with(past: usize, polish: Polish) {
    let logs = std::slice::from_ref(recording(2000));
    let mut records = innovant::identify::MemoryRecords::new(logs).expect("one recording");
    black_box(fit(&mut records, &options(past, polish)).expect("a model"));
}

#[divan::bench(args = [2000, 100_000, 1_000_000], sample_count = 5)]
fn identify_everything_automatic(samples: usize) {
    let logs = std::slice::from_ref(recording(samples));
    black_box(identify(logs, &Options::default()).expect("a model"));
}
