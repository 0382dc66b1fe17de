//! Which method when: every method of `identify` in six situations, by Monte Carlo.
//!
//! `cargo run --release --example which_method [RUNS [PART OF A NAME]]` prints the tables of
//! `docs/which-method.md`. The order is the true one; windows and everything else are what
//! `innovant identify --method M --order N` chooses. Times are relative to the first method.

use std::time::Instant;

use innovant::covariance::{Path, frequency_response_covariance, interval_quantile};
use innovant::identify::{Method, Options, Order, Polish, identify};
use innovant::internal::systems;
use innovant::log::Log;
use innovant::model::StateSpace;
use rayon::prelude::*;

/// Runs of each situation, unless the command line says otherwise.
const RUNS: u64 = 200;
/// Frequencies at which responses are compared, as shares of the Nyquist frequency.
const FREQUENCIES: [f64; 8] = [0.01, 0.03, 0.06, 0.12, 0.25, 0.4, 0.6, 0.9];

struct Situation {
    name: &'static str,
    truth: StateSpace,
    feedthrough: bool,
    /// Past window; `None` chooses.
    past: Option<usize>,
    record: Box<dyn Fn(u64) -> Log + Sync>,
}

fn situations() -> Vec<Situation> {
    let closed =
        |samples: usize| move |seed: u64| systems::van_wingerden_one().record(samples, seed);
    let siso = systems::chiuso_picci_one;
    let slow = systems::chiuso_picci_two;
    let armax = systems::knudsen_armax;
    let near_circle = systems::knudsen_vo;
    let held = |seed: u64| {
        let mut level = [0.0; 2];
        systems::two_by_two().record_with(2000, seed, |k, channel, white| {
            if k % 5 == 0 {
                level[channel] = white;
            }
            level[channel]
        })
    };
    vec![
        Situation {
            name: "closed loop, SISO (Chiuso-Picci 1, N = 1000)",
            truth: siso().plant,
            feedthrough: false,
            past: None,
            record: Box::new(move |seed| siso().record(1000, seed).expect("a stable loop")),
        },
        Situation {
            name: "closed loop, MIMO (van Wingerden 1, N = 2000)",
            truth: systems::van_wingerden_one().system,
            feedthrough: false,
            past: None,
            record: Box::new(closed(2000)),
        },
        Situation {
            name: "short recording (van Wingerden 1, N = 300)",
            truth: systems::van_wingerden_one().system,
            feedthrough: false,
            past: None,
            record: Box::new(closed(300)),
        },
        Situation {
            name: "slow A - KC, closed loop (Chiuso-Picci 2, N = 20000)",
            truth: slow().plant,
            feedthrough: false,
            past: None,
            record: Box::new(move |seed| slow().record(20_000, seed).expect("a stable loop")),
        },
        Situation {
            name: "the same with a past window of 25, which is too short",
            truth: slow().plant,
            feedthrough: false,
            past: Some(25),
            record: Box::new(move |seed| slow().record(20_000, seed).expect("a stable loop")),
        },
        Situation {
            name: "A - KC at 0.9996, binary input, open loop (Knudsen VO, N = 500)",
            truth: near_circle().system.system,
            feedthrough: true,
            past: None,
            record: Box::new(move |seed| near_circle().record(500, seed)),
        },
        Situation {
            name: "coloured input, SISO, open loop (Knudsen ARMAX, N = 500)",
            truth: armax().system.system,
            feedthrough: true,
            past: None,
            record: Box::new(move |seed| armax().record(500, seed)),
        },
        Situation {
            name: "coloured inputs, MIMO, open loop (two by two, held inputs, N = 2000)",
            truth: systems::two_by_two().system,
            feedthrough: false,
            past: None,
            record: Box::new(held),
        },
    ]
}

/// Squared errors relative to the response, and how many 95 % bands of `|G|` hold, of one run.
struct Run {
    /// For each frequency and entry: squared error of `G`, then of `H`.
    squares: [Vec<f64>; 2],
    inside: usize,
    seconds: f64,
}

fn run(situation: &Situation, options: &Options, seed: u64) -> Option<Run> {
    let log = (situation.record)(seed);
    let from = Instant::now();
    let model = identify(&[log], options).ok()?;
    let seconds = from.elapsed().as_secs_f64();
    let covariance = model.covariance?;
    let freedom = covariance.degrees_of_freedom;
    let mut inside = 0;
    let mut squares = [Vec::new(), Vec::new()];
    for share in FREQUENCIES {
        let w = share * situation.truth.nyquist();
        for (path, squares) in [Path::Input, Path::Innovation]
            .into_iter()
            .zip(&mut squares)
        {
            let truth = path.response(&situation.truth, w);
            let found = path.response(&model.system, w);
            for (t, f) in truth.iter().zip(found.iter()) {
                squares.push((f - t).norm_sqr() / t.norm_sqr());
            }
        }
        let truth = situation.truth.frequency_response(w);
        let found = model.system.frequency_response(w);
        let spread = frequency_response_covariance(&model.system, &covariance, w).ok()?;
        for (index, t) in truth.iter().enumerate() {
            // On log|G|, as the tool's own bands: the ellipse of a response near a pole is curved.
            let g = found[index];
            let (c, s) = (g.re / g.norm(), g.im / g.norm());
            let [[re, cross], [_, im]] = spread[index];
            let std = (c * c * re + 2.0 * c * s * cross + s * s * im).sqrt() / g.norm();
            let distance = (t.norm() / g.norm()).ln().abs();
            inside += usize::from(distance <= interval_quantile(0.95, freedom) * std);
        }
    }
    Some(Run {
        squares,
        inside,
        seconds,
    })
}

/// Root mean square errors of `G` and `H` relative to the response, as geometric means over frequencies and entries;
/// medians of squares take the place of means, so that a few wild runs do not decide.
fn typical_error(runs: &[Run], which: usize) -> f64 {
    let entries = runs[0].squares[which].len();
    let logs: f64 = (0..entries)
        .map(|k| {
            let mut squares: Vec<f64> = runs.iter().map(|r| r.squares[which][k]).collect();
            squares.sort_by(f64::total_cmp);
            0.5 * squares[squares.len() / 2].ln()
        })
        .sum();
    (logs / entries as f64).exp()
}

fn main() {
    let runs: u64 = std::env::args()
        .nth(1)
        .and_then(|text| text.parse().ok())
        .unwrap_or(RUNS);
    let mut choices: Vec<(String, Method, Polish)> = Method::all()
        .iter()
        .map(|&m| (m.name().to_owned(), m, Polish::Never))
        .collect();
    choices.push((
        "pbsid-opt, polished".to_owned(),
        Method::PbsidOpt,
        Polish::Always,
    ));
    choices.push((
        "innovant's default".to_owned(),
        Method::PbsidOpt,
        Polish::Auto,
    ));
    let part = std::env::args().nth(2).unwrap_or_default();
    for situation in situations() {
        if !situation.name.contains(&part) {
            continue;
        }
        let mut reference = None;
        println!("\n### {}\n", situation.name);
        println!(
            "| method | median error of G | of H | 95 % band holds the magnitude | failed | time |"
        );
        println!("|---|---|---|---|---|---|");
        for (name, method, polish) in &choices {
            let options = Options {
                method: *method,
                polish: *polish,
                order: Order::Fixed(situation.truth.states()),
                feedthrough: situation.feedthrough,
                past: situation.past,
                ..Options::default()
            };
            let found: Vec<Option<Run>> = (0..runs)
                .into_par_iter()
                .map(|seed| run(&situation, &options, 7000 + seed))
                .collect();
            let found: Vec<Run> = found.into_iter().flatten().collect();
            let failed = runs as usize - found.len();
            if found.is_empty() {
                println!("| {name} | - | - | - | {failed} | - |");
                continue;
            }
            let inside: usize = found.iter().map(|r| r.inside).sum();
            let held = 100.0 * inside as f64 / (found.len() * found[0].squares[0].len()) as f64;
            let seconds: f64 = found.iter().map(|r| r.seconds).sum::<f64>() / found.len() as f64;
            println!(
                "| {name} | {:.2} % | {:.2} % | {held:.1} % | {failed} | {:.1} |",
                100.0 * typical_error(&found, 0),
                100.0 * typical_error(&found, 1),
                seconds / *reference.get_or_insert(seconds)
            );
        }
    }
}
