//! Bad input ends in exit code 2 and one message that says where and what to do, and leaves nothing behind.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use innovant::internal::systems;

use crate::folder::Folder;

/// A recording as rows of text, so that it can be spoilt.
fn rows() -> Vec<String> {
    let log = systems::servo().record(400, 1);
    let mut rows = vec!["t,u1,y1".to_owned()];
    rows.extend((0..400).map(|k| {
        let (u, y) = (log.input_data[0][k], log.output_data[0][k]);
        format!("{},{u},{y}", k as f64 / 1000.0)
    }));
    rows
}

/// The message about a log, whatever command reads it.
fn about(contents: &[u8], flags: &[&str]) -> String {
    let folder = Folder::new();
    folder.bytes("log.csv", contents);
    let mut arguments = vec!["identify", "log.csv", "--output", "model.json"];
    arguments.extend(flags);
    let message = folder.run(&arguments).error();
    assert_eq!(folder.files(), ["log.csv"], "{message}");
    message
}

fn with_row(line: usize, row: &str) -> Vec<u8> {
    let mut rows = rows();
    rows[line - 1] = row.to_owned();
    rows.join("\n").into_bytes()
}

#[track_caller]
fn says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
}

#[test]
fn cells_and_rows() {
    let text = about(&with_row(57, "0.055,abc,1"), &[]);
    says(
        &text,
        &[
            "log.csv, line 57, column `u1`",
            "`abc` is not a number",
            "correct the cell",
        ],
    );
    let infinite = about(&with_row(57, "0.055,1,inf"), &[]);
    says(&infinite, &["log.csv, line 57, column `y1`", "interpolate"]);
    let strict = ["--missing", "error"];
    let nan = about(&with_row(57, "0.055,1,NaN"), &strict);
    says(&nan, &["line 57, column `y1`", "interpolate"]);
    let empty = about(&with_row(57, "0.055,,1"), &strict);
    says(&empty, &["line 57, column `u1`", "the cell is empty"]);
    let ragged = about(&with_row(57, "0.055,1"), &[]);
    says(&ragged, &["line 57", "2 fields where the header has 3"]);
}

#[test]
fn files_without_data() {
    says(
        &about(b"", &[]),
        &["log.csv: the file is empty", "one row a sample"],
    );
    says(
        &about(b"t,u1,y1\n", &[]),
        &["no data after the header on line 1"],
    );
    let junk: Vec<u8> = (0..4000_u32).map(|k| (k * 197 % 256) as u8).collect();
    says(&about(&junk, &[]), &["log.csv, line 1", "not UTF-8 text"]);
    let missing = Folder::new().run(&["identify", "nowhere.csv"]).error();
    says(&missing, &["nowhere.csv: cannot open", "check the path"]);
}

#[test]
fn truncated_gzip() {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(rows().join("\n").as_bytes()).unwrap();
    let whole = encoder.finish().unwrap();
    let message = about(&whole[..whole.len() / 2], &[]);
    says(
        &message,
        &["log.csv, after line", "broken gzip data", "copy it"],
    );
}

#[test]
fn channels_that_say_nothing() {
    let rebuilt = |change: &dyn Fn(&str, &str, &str) -> String| {
        let rows: Vec<String> = rows()
            .iter()
            .enumerate()
            .map(|(k, row)| {
                let cells: Vec<&str> = row.split(',').collect();
                if k == 0 {
                    row.clone()
                } else {
                    change(cells[0], cells[1], cells[2])
                }
            })
            .collect();
        rows.join("\n").into_bytes()
    };
    let constant = about(&rebuilt(&|t, _, y| format!("{t},2.5,{y}")), &[]);
    says(&constant, &["input 'u1' is constant", "leave it out"]);
    let same = about(&rebuilt(&|t, u, _| format!("{t},{u},{u}")), &[]);
    says(
        &same,
        &["'u1' and 'y1' are the same signal", "leave one out"],
    );
}

#[test]
fn time_and_length() {
    let irregular = about(&with_row(57, "0.05549,1,1"), &[]);
    says(
        &irregular,
        &["line 57, column `t`", "irregular sampling", "resample"],
    );
    let backwards = about(&with_row(57, "0.01,1,1"), &["--missing", "error"]);
    says(&backwards, &["line 57, column `t`", "must increase"]);
    let short = about(rows()[..6].join("\n").as_bytes(), &[]);
    says(&short, &["too short: 5 samples", "longer recording"]);
    let short = about(rows()[..60].join("\n").as_bytes(), &["--past", "50"]);
    says(
        &short,
        &[
            "too short: 59 samples",
            "a past window of 50",
            "smaller --past",
        ],
    );
}

#[test]
fn columns_and_roles() {
    let good = rows().join("\n").into_bytes();
    let unknown = about(&good, &["--inputs", "u2", "--outputs", "y1"]);
    says(
        &unknown,
        &["log.csv: no column `u2`", "the columns are", "`u1`"],
    );
    let no_roles = about(
        String::from_utf8(good.clone())
            .unwrap()
            .replace("u1,y1", "force,speed")
            .as_bytes(),
        &[],
    );
    says(
        &no_roles,
        &[
            "cannot tell inputs from outputs",
            "--inputs force --outputs speed",
        ],
    );
    let twice = about(&good, &["--inputs", "u1", "--outputs", "u1"]);
    says(&twice, &["given twice"]);
    let no_time = about(
        String::from_utf8(good)
            .unwrap()
            .replace("t,u1", "x,u1")
            .as_bytes(),
        &[],
    );
    says(&no_time, &["no time column", "--dt"]);
}

#[test]
fn options_that_are_not_possible() {
    let good = rows().join("\n").into_bytes();
    let order = about(&good, &["--order", "12", "--past", "5"]);
    says(
        &order,
        &[
            "order 12 is not possible",
            "largest order here is 5",
            "--past",
        ],
    );
    let horizon = about(&good, &["--past", "5", "--future", "8"]);
    says(
        &horizon,
        &["--past 5 --future 8 is not possible", "cannot be longer"],
    );
    let delay = about(&good, &["--delay", "1,2"]);
    says(&delay, &["--delay has 2 values", "one for each"]);
    let late = about(&good, &["--delay", "1000"]);
    says(&late, &["log.csv", "--delay 1000 leaves only 0 samples"]);
}

#[test]
fn flags_that_clap_refuses() {
    let folder = Folder::new();
    folder.text("log.csv", &rows().join("\n"));
    let cases: [(&[&str], &str); 12] = [
        (&["--order", "four"], "a range such as `2..8`"),
        (&["--order", "0"], "at least one state"),
        (&["--order", "8..2"], "write 2..8"),
        (&["--order", "-1"], "a range such as"),
        (&["--past", "0"], "at least one sample"),
        (&["--past", "x"], "`auto` or a number of samples"),
        (&["--dt", "-1"], "positive number of seconds"),
        (&["--delay", "-1"], "invalid value '-1'"),
        (&["--threads", "0"], "0 is not in"),
        (&["--weight", "huge"], "identity, cva"),
        (&["--method", "magic"], "pbsid-opt"),
        (&["--ordre", "2"], "--order"),
    ];
    for (flags, part) in cases {
        let mut arguments = vec!["identify", "log.csv"];
        arguments.extend(flags);
        let run = folder.run(&arguments);
        assert_eq!(run.code, 2);
        assert_eq!(run.stdout, "");
        assert_eq!(run.stderr.matches("error: ").count(), 1, "{}", run.stderr);
        says(&run.stderr, &[part]);
    }
    for arguments in [
        &["identify"][..],
        &["nonsense"],
        &["show"],
        &["schema", "x"],
    ] {
        assert_eq!(folder.run(arguments).code, 2);
    }
}

/// The message about a model.
fn about_model(text: &str) -> String {
    let folder = Folder::new();
    folder.text("model.json", text);
    folder.text("log.csv", &rows().join("\n"));
    let show = folder.run(&["show", "model.json"]).error();
    let simulate = folder
        .run(&["simulate", "model.json", "log.csv", "--output", "out.csv"])
        .error();
    let validate = folder.run(&["validate", "model.json", "log.csv"]).error();
    assert_eq!(show, simulate);
    assert_eq!(show, validate);
    assert_eq!(folder.files(), ["log.csv", "model.json"]);
    show
}

#[test]
fn broken_models() {
    let cut = about_model("{\"A\": [[0.5]],\n \"B\": [[1");
    says(
        &cut,
        &[
            "model.json, line 2",
            "key `B[0][0]`",
            "ends in the middle",
            "not whole",
        ],
    );
    let comma = about_model("{\"A\": [[0.5]],\n \"B\": [[1]]\n \"C\": 1}");
    says(&comma, &["model.json, line 3", "this is not JSON"]);
    let missing = about_model("{\"A\": [[0.5]], \"B\": [[1]], \"dt\": 0.001}");
    says(
        &missing,
        &[
            "there is no key `C`",
            "a model needs at least A, B, C and dt",
        ],
    );
    let time = about_model("{\"A\": 0.5, \"B\": 1, \"C\": 1}");
    says(&time, &["there is no key `sample_time`", "dt"]);
    let shape = about_model("{\n\"A\": [[0.5]],\n\"B\": [[1], [2]], \"C\": 1, \"dt\": 0.001}");
    says(
        &shape,
        &["model.json, line 3, column 1, key `B`: B is 2 x 1, but must be 1 x 1"],
    );
    let ragged = about_model("{\"A\": [[0.5, 1],\n [2]], \"B\": 1, \"C\": 1, \"dt\": 1}");
    says(
        &ragged,
        &["line 2", "key `A", "row 2 of the matrix has 1 entries"],
    );
    let text = about_model("{\"A\": [[\"x\"]], \"B\": 1, \"C\": 1, \"dt\": 1}");
    says(&text, &["key `A[0][0]`", "expected a finite number"]);
    let nan = about_model("{\"A\": [[NaN]], \"B\": 1, \"C\": 1, \"dt\": 1}");
    says(&nan, &["key `A[0][0]`", "`NaN` is not a finite number"]);
    let huge = about_model("{\"A\": [[1e999]], \"B\": 1, \"C\": 1, \"dt\": 1}");
    says(&huge, &["key `A[0][0]`", "number out of range"]);
    let zero = about_model("{\"A\": 0.5, \"B\": 1, \"C\": 1, \"dt\": 0}");
    says(&zero, &["sample time must be a positive number"]);
    let version = about_model("{\"format\": \"innovant-model/9\"}");
    says(
        &version,
        &["the format is `innovant-model/9`", "update this one"],
    );
    // `simulate` runs explanations too, so only the others refuse one.
    let folder = Folder::new();
    folder.text("model.json", "{\"format\": \"innovant-explanation/1\"}");
    let kind = folder.run(&["show", "model.json"]).error();
    says(&kind, &["an explanation and not a model"]);
    says(&about_model(""), &["the file is empty"]);
    says(
        &about_model("t,u,y\n1,2,3\n"),
        &["starts with `t,u,y`", "the model comes first"],
    );
    let names =
        about_model("{\"A\": 0.5, \"B\": 1, \"C\": 1, \"dt\": 1, \"inputs\": [\"u1\", \"u2\"]}");
    says(
        &names,
        &["key `inputs`", "there are 2 of them, but B has 1 column"],
    );
}

#[test]
fn binary_models() {
    let folder = Folder::new();
    let junk: Vec<u8> = (0..4000_u32).map(|k| (k * 197 % 256) as u8).collect();
    folder.bytes("model.json", &junk);
    says(
        &folder.run(&["show", "model.json"]).error(),
        &["model.json: this is not a JSON document"],
    );
    says(
        &folder.run(&["show", "nowhere.json"]).error(),
        &["nowhere.json: cannot open"],
    );
}

#[cfg(unix)]
#[test]
fn unwritable_places() {
    let folder = Folder::new();
    folder.text("log.csv", &rows().join("\n"));
    folder.text("file", "kept");
    let below = folder
        .run(&["identify", "log.csv", "--output", "file/model.json"])
        .error();
    says(
        &below,
        &["file/model.json: cannot write", "choose another place"],
    );
    let full = folder.run(&["identify", "log.csv", "--output", "/dev/full"]);
    assert_eq!(full.code, 2, "{}", full.stderr);
    assert_eq!(folder.files(), ["file", "log.csv"]);
}
