//! What would not fit into memory is refused at once, with the memory that it would take; and the estimates are right.

#[path = "support/folder.rs"]
mod folder;

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use folder::Folder;
use innovant::internal::limits::parse_size;
use innovant::internal::systems;
use innovant::log::{Channel, Log};
use rayon::prelude::*;

/// A refusal is a matter of reading the header; this allows for a machine that is busy.
const AT_ONCE: Duration = Duration::from_secs(5);

/// Runs what must be refused at once.
fn refused(folder: &Folder, arguments: &[&str]) -> String {
    let started = Instant::now();
    let message = folder.run(arguments).error();
    let took = started.elapsed();
    assert!(took < AT_ONCE, "{arguments:?} took {took:?}: {message}");
    message
}

#[test]
fn absurd_requests_are_refused_at_once() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::van_wingerden_one(), 500, 1);
    for (arguments, expected) in [
        (
            &["--past", "1000000"][..],
            "log.csv: a model of 2 outputs from 2 inputs with a past window of 1000000 samples would need about 640 TB \
             of memory, and the limit is ",
        ),
        (
            &["--past", "18446744073709551615"],
            "would need about 18 EB of memory",
        ),
        (
            &[
                "--past",
                "10",
                "--future",
                "18446744073709551615",
                "--method",
                "whitening",
            ],
            "give a smaller --past or a smaller --future or fewer channels (--inputs, --outputs), or raise the limit \
             with --memory-limit or INNOVANT_MEMORY",
        ),
        (
            &["--past", "2000", "--order", "900"],
            "a model of order 900 of 2 outputs from 2 inputs",
        ),
        (&["--order", "1..100000"], "the largest order is 1000"),
        (
            &["--delay", "4000000000", "--memory-limit", "8G"],
            "give a smaller --delay or fewer channels",
        ),
        (
            &["--memory-limit", "10M"],
            " MB of memory, and the limit is 10 MB (as asked for); give fewer channels",
        ),
        (
            &["--memory-limit", "much"],
            "expected a size such as 500M, 8G or 1.5GiB",
        ),
    ] {
        let asked = [&["identify", "log.csv"], arguments].concat();
        let started = Instant::now();
        let run = folder.run(&asked);
        assert_eq!(run.code, 2, "{run:?}");
        assert!(started.elapsed() < AT_ONCE, "{arguments:?}");
        assert!(
            run.stderr.contains(expected),
            "{arguments:?}: {}",
            run.stderr
        );
    }
}

#[test]
fn recordings_that_do_not_fit_are_refused_as_they_are_read() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::van_wingerden_one(), 100_000, 1);
    folder
        .run(&["identify", "log.csv", "-q", "--output", "model.json"])
        .ok();
    let whole = 3 * 100_000 * 4 * 8;
    for command in [
        &["validate", "model.json", "log.csv"][..],
        &["explain", "log.csv", "--simulation", "model.json"],
    ] {
        let limit = format!("{}", whole / 2);
        let message = refused(&folder, &[command, &["--memory-limit", &limit]].concat());
        // From the first block on the length is estimated.
        let samples = message
            .strip_prefix("log.csv: ")
            .unwrap()
            .split(' ')
            .next()
            .unwrap();
        let samples: f64 = samples.parse().unwrap();
        assert!((samples / 1e5 - 1.0).abs() < 0.5, "{message}");
        assert!(
            message.contains("take a part of the recording, or fewer columns"),
            "{message}"
        );
    }
    let message = refused(&folder, &["show", "model.json", "--memory-limit", "10k"]);
    assert!(
        message.starts_with("model.json: reading a document of ")
            && message.contains("give a model of a lower order"),
        "{message}"
    );
    let message = refused(
        &folder,
        &[
            "explain",
            "log.csv",
            "--simulation",
            "model.json",
            "--memory-limit",
            "100M",
        ],
    );
    assert!(
        message.starts_with("log.csv: explaining 100000 samples of 2 outputs would need about ")
            && message.contains("take the part of the recording in which the simulation is wrong"),
        "{message}"
    );
}

#[test]
fn a_batch_shares_the_memory() {
    let folder = Folder::new();
    folder.recording("a.csv", &systems::van_wingerden_one(), 500, 1);
    folder.recording("b.csv", &systems::van_wingerden_one(), 500, 2);
    let batch = [
        "batch",
        "a.csv",
        "b.csv",
        "--output-dir",
        "models",
        "--memory-limit",
        "40M",
    ];
    folder.run(&[&batch[..], &["--threads", "2"]].concat()).ok();
    let run = folder.run(&[&batch[..], &["--threads", "4", "--again"]].concat());
    assert_eq!(run.code, 1, "{run:?}");
    assert!(
        run.stderr.contains("the limit is 10 MB (for this one)"),
        "{}",
        run.stderr
    );
    // What was there before is as good as it was.
    assert!(folder.join("models/a.json").exists() && folder.join("models/b.json").exists());
}

/// A recording of `inputs` and `outputs` with a model of order `outputs`.
fn recording(inputs: usize, outputs: usize, samples: usize) -> Log {
    let mut state = 1_u64;
    let mut noise = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut u = vec![Vec::with_capacity(samples); inputs];
    let mut y = vec![Vec::with_capacity(samples); outputs];
    let mut x = vec![0.0; outputs];
    for _ in 0..samples {
        let now: Vec<f64> = (0..inputs).map(|_| noise()).collect();
        for (column, value) in u.iter_mut().zip(&now) {
            column.push(*value);
        }
        for (o, x) in x.iter_mut().enumerate() {
            let e = 0.1 * noise();
            y[o].push(*x + e);
            *x = 0.8 * *x + now[o % inputs] + 0.2 * e;
        }
    }
    let named = |letter: &str, count: usize| -> Vec<Channel> {
        (1..=count)
            .map(|i| Channel::new(format!("{letter}{i}")))
            .collect()
    };
    Log::from_columns("log", 1.0, named("u", inputs), named("y", outputs), u, y).unwrap()
}

/// Peak memory of a run in bytes: what the system counts for the children of a shell.
#[cfg(target_os = "linux")]
fn peak(folder: &Folder, arguments: &[&str]) -> f64 {
    use std::process::{Command, Stdio};
    let mut child = Command::new(env!("CARGO_BIN_EXE_innovant"))
        .current_dir(folder.path())
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    // The high-water mark is in the status as long as the process is there; the last look comes close to the end.
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0.0_f64;
    while child.try_wait().unwrap().is_none() {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let mark = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kibibytes = mark.and_then(|m| m.trim().strip_suffix("kB")?.trim().parse::<f64>().ok());
        peak = peak.max(kibibytes.unwrap_or(0.0) * 1024.0);
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(child.wait().unwrap().code().is_some_and(|code| code <= 1));
    peak
}

/// The estimate for a request: what it says when it is refused.
fn estimate(folder: &Folder, arguments: &[&str]) -> f64 {
    let message = folder
        .run(&[arguments, &["--memory-limit", "1k"]].concat())
        .error();
    let text = message.split("would need about ").nth(1).unwrap();
    let text = text.split(" of memory").next().unwrap();
    parse_size(text).unwrap() as f64
}

/// The estimates are within a factor of two of what requests take.
#[cfg(target_os = "linux")]
#[test]
fn estimates_of_identification_are_near_the_peaks() {
    let folder = Folder::new();
    for (inputs, outputs) in [(1, 1), (2, 2), (4, 4), (1, 8)] {
        let name = format!("{inputs}_{outputs}.csv");
        folder.log(&name, &recording(inputs, outputs, 10_000));
    }
    let requests: [&[&str]; 7] = [
        &["identify", "1_1.csv", "--past", "20", "--order", "1"],
        &["identify", "2_2.csv", "--past", "250", "--order", "2"],
        &["identify", "4_4.csv", "--past", "100", "--order", "4"],
        &[
            "identify", "4_4.csv", "--past", "30", "--order", "16", "--polish", "always",
        ],
        &["identify", "1_8.csv", "--past", "40", "--order", "8"],
        &[
            "identify",
            "2_2.csv",
            "--past",
            "60",
            "--order",
            "2",
            "--method",
            "whitening",
        ],
        &[
            "identify",
            "2_2.csv",
            "--past",
            "60",
            "--order",
            "2",
            "--covariance",
            "robust",
        ],
    ];
    requests.into_par_iter().for_each(|arguments| {
        let (estimate, peak) = (estimate(&folder, arguments), peak(&folder, arguments));
        println!(
            "{:>7.1} MB of {:>7.1} MB: {}",
            peak / 1e6,
            estimate / 1e6,
            arguments[1..].join(" ")
        );
        assert!(
            (0.5..2.0).contains(&(estimate / peak)),
            "{arguments:?}: {estimate:e} bytes estimated, {peak:e} taken"
        );
    });
}

#[cfg(target_os = "linux")]
#[test]
fn estimates_of_explanations_are_near_the_peaks() {
    let folder = Folder::new();
    for (case, simulated, outputs) in [
        ("case_006", "simulation.csv", 1),
        ("case_004", "simulation.json", 2),
    ] {
        let place = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("data/concealed")
            .join(case);
        let file = |name: &str| place.join(name).display().to_string();
        let (recording, simulation) = (file("recording.csv"), file(simulated));
        let arguments = [
            "explain",
            &recording,
            "--simulation",
            &simulation,
            "--threads",
            "2",
        ];
        // Reading is refused first where nothing is allowed at all.
        let message = folder
            .run(&[&arguments[..], &["--memory-limit", "1M"]].concat())
            .error();
        let text = message.split("would need about ").nth(1).unwrap();
        let estimate = parse_size(text.split(" of memory").next().unwrap()).unwrap() as f64;
        let peak = peak(&folder, &arguments);
        println!(
            "{:>7.1} MB of {:>7.1} MB: explain {case}, {outputs} outputs",
            peak / 1e6,
            estimate / 1e6
        );
        assert!(
            (0.5..2.0).contains(&(estimate / peak)),
            "{case}: {estimate:e} bytes estimated, {peak:e} taken"
        );
    }
}
