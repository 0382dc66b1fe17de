//! `innovant identify`, from the outside.

use std::fs;
use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use innovant::internal::systems;

use crate::folder::{Folder, json};

#[test]
fn a_log_becomes_a_table_and_a_model() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::van_wingerden_one(), 2000, 1);
    let table = folder
        .run(&["identify", "log.csv", "--output", "model.json"])
        .ok();
    let first = table.lines().next().unwrap();
    assert!(
        first.starts_with("Order 4 model of 2 outputs from 2 inputs, 2000 samples, 1 s: "),
        "{first}"
    );
    for part in [
        "Fit",
        "Poles (+- one standard deviation)",
        "Static gain",
        "Order",
        "How",
    ] {
        assert!(table.contains(part), "{part} is missing in\n{table}");
    }
    assert!(
        table.lines().all(|line| line.chars().count() <= 100),
        "{table}"
    );

    let model = json(&folder.join("model.json"));
    assert_eq!(model["format"], "innovant-model/1");
    assert_eq!(model["order"], 4);
    assert_eq!(model["inputs"][1]["name"], "u2");
    assert_eq!(model["A"].as_array().unwrap().len(), 4);
    let packed = &model["covariance"]["packed_lower_triangle"];
    // vec A 16, B 8, K 8, C 8.
    assert_eq!(packed.as_array().unwrap().len(), 40 * 41 / 2);
    assert_eq!(model["covariance"]["scale"], 1.0);
    assert!(model["diagnostics"]["residual_tests"]["rejected"].is_boolean());
    assert_eq!(model["invariants"]["poles"].as_array().unwrap().len(), 4);
    assert!(model["invariants"].get("frequency_response").is_none());
    let recording = &model["provenance"]["recordings"][0];
    assert_eq!(
        (&recording["name"], &recording["samples"]),
        (&"log.csv".into(), &2000.into())
    );
    assert_eq!(recording["sha256"].as_str().unwrap().len(), 64);
}

#[test]
fn the_same_log_gives_the_same_bytes() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::two_by_two(), 1500, 3);
    let run = |threads: &str| {
        folder
            .run(&["identify", "log.csv", "--output", "-", "--threads", threads])
            .ok()
    };
    assert_eq!(run("1"), run("2"));
}

#[test]
fn output_to_stdout_has_no_table() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::servo(), 3000, 1);
    let run = folder.run(&["identify", "log.csv", "--output", "-"]);
    assert!(run.stderr.starts_with("Order 3 model"), "{}", run.stderr);
    assert_eq!(run.json()["format"], "innovant-model/1");
    let quiet = folder.run(&["-q", "identify", "log.csv", "--output", "-"]);
    assert_eq!(quiet.stderr, "");
    let silent = folder.run(&["identify", "log.csv", "-q", "--output", "m.json"]);
    assert_eq!((silent.stdout.as_str(), silent.stderr.as_str()), ("", ""));
    let verbose = folder.run(&["identify", "log.csv", "-v"]);
    assert!(verbose.stderr.contains("read log.csv: 3000 samples"));
}

#[test]
fn a_report_is_a_page_and_changes_nothing_else() {
    let folder = Folder::new();
    let path = folder.recording("log.csv", &systems::servo(), 2000, 5);
    let text = fs::read_to_string(path).unwrap();
    let evil = text.replacen("u1", "u<script>alert(1)</script>", 1);
    folder.text("evil.csv", &evil);
    let plain = folder
        .run(&["identify", "log.csv", "-o", "plain.json"])
        .ok();
    let table = folder
        .run(&[
            "identify",
            "log.csv",
            "-o",
            "model.json",
            "--report",
            "page.html",
        ])
        .ok();
    assert_eq!(
        json(&folder.join("plain.json")),
        json(&folder.join("model.json"))
    );
    assert_eq!(
        table.replace("model.json\nwritten to page.html", "plain.json"),
        plain
    );
    let page = fs::read_to_string(folder.join("page.html")).unwrap();
    assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>"));
    assert!(page.contains("The residuals are white") && page.contains("Residuals and their past"));

    let page = folder.run(&["identify", "evil.csv", "--report", "-"]).ok();
    assert!(page.contains("u&lt;script&gt;alert(1)") && !page.contains("<script>alert"));
    // What is read cannot be read twice.
    let run = folder.run_with_input(&["identify", "-", "--report", "stdin.html"], text.into());
    assert_eq!(run.code, 0);
    let page = fs::read_to_string(folder.join("stdin.html")).unwrap();
    assert!(page.contains("What excites the plant"));

    let error = folder
        .run(&["identify", "log.csv", "-o", "one", "--report", "one"])
        .error();
    assert!(error.contains("name the same file"), "{error}");
    let error = folder
        .run(&["identify", "log.csv", "--report", "nowhere/page.html"])
        .error();
    assert!(error.contains("nowhere/page.html"), "{error}");
    assert!(!folder.files().iter().any(|name| name == "one"));
}

#[test]
fn standard_input_gzip_and_files_agree() {
    let folder = Folder::new();
    let path = folder.recording("log.csv", &systems::servo(), 2000, 5);
    let bytes = fs::read(path).unwrap();
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&bytes).unwrap();
    let packed = encoder.finish().unwrap();
    folder.bytes("log.csv.gz", &packed);
    let matrix = |json: serde_json::Value| json["A"].clone();
    let plain = matrix(folder.run(&["identify", "log.csv", "-o", "-"]).json());
    let gzip = matrix(folder.run(&["identify", "log.csv.gz", "-o", "-"]).json());
    let stdin = |bytes| {
        matrix(
            folder
                .run_with_input(&["identify", "-", "-o", "-"], bytes)
                .json(),
        )
    };
    assert_eq!(plain, gzip);
    assert_eq!(plain, stdin(bytes));
    assert_eq!(plain, stdin(packed));
}

#[test]
fn several_files_are_experiments_of_one_plant() {
    let folder = Folder::new();
    let system = systems::two_by_two();
    folder.recording("a.csv", &system, 1000, 1);
    folder.recording("b.csv", &system, 800, 2);
    let model = folder
        .run(&["identify", "a.csv", "b.csv", "-o", "-"])
        .json();
    assert_eq!(model["samples"], 1800);
    let recordings = model["provenance"]["recordings"].as_array().unwrap();
    assert_eq!(recordings.len(), 2);
    assert_eq!(recordings[1]["name"], "b.csv");

    let twice = folder.run(&["identify", "a.csv", "./a.csv"]).error();
    assert!(twice.contains("given twice"), "{twice}");
    fs::copy(folder.join("a.csv"), folder.join("copy.csv")).unwrap();
    let copy = folder.run(&["identify", "a.csv", "copy.csv"]).error();
    assert!(copy.contains("hold the same bytes"), "{copy}");
    let stdin = folder.run(&["identify", "-", "-"]).error();
    assert!(stdin.contains("read only once"), "{stdin}");
}

#[test]
fn roles_by_flag_and_units_from_headers() {
    let folder = Folder::new();
    let mut log = systems::servo().record(2000, 9);
    log.inputs[0].name = "voltage".into();
    log.inputs[0].unit = Some("V".into());
    log.outputs[0].name = "speed".into();
    log.outputs[0].unit = Some("rad/s".into());
    folder.log("log.csv", &log);
    let table = folder
        .run(&[
            "identify",
            "log.csv",
            "--inputs",
            "voltage",
            "--outputs",
            "speed",
            "-o",
            "m.json",
        ])
        .ok();
    assert!(table.contains("rad/s per V"), "{table}");
    let model = json(&folder.join("m.json"));
    assert_eq!(model["inputs"][0]["unit"], "V");
    assert_eq!(model["outputs"][0]["name"], "speed");

    let half_a_second = |flags: &[&str]| {
        let roles = ["--inputs", "voltage", "--outputs", "speed", "--dt", "0.5"];
        let mut all = vec!["identify", "log.csv", "-o", "-"];
        all.extend(roles);
        all.extend(flags);
        folder.run(&all)
    };
    // The time column says otherwise, unless it is said to be none.
    let message = half_a_second(&[]).error();
    for part in ["its step is 0.001 s", "--dt says 0.5 s", "`--time none`"] {
        assert!(message.contains(part), "{message}");
    }
    let without_time = half_a_second(&["--time", "none"]).json();
    assert_eq!(without_time["sample_time"], 0.5);
}

#[test]
fn orders_are_compared() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::servo(), 4000, 2);
    let table = folder
        .run(&["identify", "log.csv", "--order", "2..4,6", "-o", "m.json"])
        .ok();
    let compared = table.split("Orders asked for").nth(1).unwrap();
    let rows: Vec<&str> = compared
        .lines()
        .skip(2)
        .take_while(|line| !line.is_empty())
        .map(|line| line.split_whitespace().next().unwrap())
        .collect();
    assert_eq!(rows, ["2", "3", "4", "6"], "{table}");
    assert!(compared.contains("3 *"), "{table}");
    assert_eq!(json(&folder.join("m.json"))["order"], 3);
}

#[test]
fn feedthrough_delay_robust_and_stable() {
    let folder = Folder::new();
    let mut system = systems::servo();
    system.system.d[(0, 0)] = 0.3;
    folder.recording("direct.csv", &system, 3000, 4);
    let model = folder
        .run(&["identify", "direct.csv", "--feedthrough", "-o", "-"])
        .json();
    let d = model["D"][0][0].as_f64().unwrap();
    assert!((d - 0.3).abs() < 0.05, "{d}");
    assert_eq!(model["covariance"]["parameters"][4], "vec D");

    let log = systems::servo().record(3000, 4);
    let mut late = log.clone();
    late.input_data[0].rotate_left(5);
    late.input_data[0].truncate(2990);
    late.output_data[0].truncate(2990);
    // The input was moved forward by five samples, so the plant now answers five samples late.
    folder.log("late.csv", &late);
    let model = folder
        .run(&["identify", "late.csv", "--delay", "5", "-o", "-"])
        .json();
    assert_eq!(model["inputs"][0]["delay"], 5);
    assert_eq!(model["samples"], 2985);
    assert_eq!(model["order"], 3);

    folder.log("log.csv", &log);
    let robust = folder.run(&[
        "identify",
        "log.csv",
        "--covariance",
        "robust",
        "-o",
        "m.json",
    ]);
    assert!(robust.ok().contains("jackknife"));
    let robust = json(&folder.join("m.json"));
    assert!(robust["covariance"]["degrees_of_freedom"].as_f64().unwrap() > 2.0);

    let stable = folder
        .run(&["identify", "log.csv", "--stable", "-o", "-"])
        .json();
    assert!(stable["diagnostics"]["spectral_radius"].as_f64().unwrap() < 1.0);
}

#[test]
fn feedthrough_in_closed_loop_is_warned_of() {
    let folder = Folder::new();
    folder.recording("log.csv", &systems::van_wingerden_one(), 1500, 1);
    let table = folder.run(&["identify", "log.csv", "--feedthrough"]).ok();
    assert!(
        table.contains("warning: the recording was taken in closed loop"),
        "{table}"
    );
}

#[test]
fn an_output_of_the_future_is_refused_before_the_work() {
    let folder = Folder::new();
    let path = folder.recording("log.csv", &systems::servo(), 500, 1);
    let before = fs::read(&path).unwrap();
    let own = folder
        .run(&["identify", "log.csv", "--output", "./log.csv"])
        .error();
    assert!(own.contains("would destroy it"), "{own}");
    assert_eq!(fs::read(&path).unwrap(), before);
    let missing = folder
        .run(&["identify", "log.csv", "--output", "no/such/place.json"])
        .error();
    assert!(
        missing.starts_with("no/such/place.json: cannot write"),
        "{missing}"
    );
    let directory = folder
        .run(&["identify", "log.csv", "--output", "."])
        .error();
    assert!(directory.starts_with(".: cannot write"), "{directory}");
    assert_eq!(folder.files(), ["log.csv"]);
}
