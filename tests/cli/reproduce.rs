//! `innovant reproduce`.

use std::fs;

use crate::folder::Folder;

#[test]
fn files_do_not_depend_on_the_number_of_threads() {
    let folder = Folder::new();
    for (threads, place) in [("1", "one"), ("3", "three")] {
        let run = folder.run(&[
            "reproduce",
            "chiuso-picci-1",
            "knudsen-vo",
            "--runs",
            "12",
            "--seed",
            "5",
            "--threads",
            threads,
            "--output-dir",
            place,
        ]);
        assert_eq!(run.code, 0, "{run:?}");
        for word in ["paper says", "we get", "agree?", "error in print"] {
            assert!(run.stdout.contains(word), "{word}");
        }
        assert!(run.stderr.is_empty(), "{}", run.stderr);
    }
    for name in ["chiuso-picci-1", "knudsen-vo"] {
        for extension in ["html", "csv", "json"] {
            let read = |place: &str| {
                fs::read_to_string(folder.join(place).join(format!("{name}.{extension}"))).unwrap()
            };
            let (one, three) = (read("one"), read("three"));
            assert!(one.len() > 1000 && one == three, "{name}.{extension}");
        }
    }
}

#[test]
fn documents_follow_their_schema() {
    let folder = Folder::new();
    let run = folder.run(&[
        "-q",
        "reproduce",
        "knudsen-armax",
        "--runs",
        "8",
        "--output-dir",
        ".",
    ]);
    assert_eq!((run.code, run.stdout.as_str()), (0, ""), "{run:?}");
    let text = fs::read_to_string(folder.join("knudsen-armax.json")).unwrap();
    let document: serde_json::Value = serde_json::from_str(&text).unwrap();
    let schema = folder.run(&["schema", "reproduction"]).stdout;
    let schema: serde_json::Value = serde_json::from_str(&schema).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let errors: Vec<String> = validator
        .iter_errors(&document)
        .map(|e| e.to_string())
        .collect();
    assert!(errors.is_empty(), "{errors:?}");
    assert_eq!(document["format"], "innovant-reproduction/1");
    assert_eq!(document["runs"], 8);
}

#[test]
fn mistakes_are_told_before_any_work() {
    let folder = Folder::new();
    let unknown = folder.run(&["reproduce", "knudsen"]);
    assert_eq!(unknown.code, 2);
    assert!(
        unknown.stderr.contains("knudsen-armax"),
        "{}",
        unknown.stderr
    );
    let few = folder.run(&["reproduce", "chiuso-picci-1", "--runs", "2"]);
    assert_eq!(few.code, 2);
    assert!(few.stderr.contains("at least 8"), "{}", few.stderr);
    assert!(folder.files().iter().all(|name| name == "reproduction"));
    assert!(
        fs::read_dir(folder.join("reproduction"))
            .unwrap()
            .next()
            .is_none()
    );
    folder.text("taken", "a file");
    let place = folder.run(&["reproduce", "chiuso-picci-1", "--output-dir", "taken"]);
    assert_eq!(place.code, 2);
    assert!(place.stderr.contains("--output-dir"), "{}", place.stderr);
    let list = folder.run(&["reproduce"]);
    assert_eq!(list.code, 0);
    for name in [
        "van-wingerden-1",
        "van-wingerden-2",
        "chiuso-picci-2",
        "knudsen-bj",
    ] {
        assert!(list.stdout.contains(name), "{name}");
    }
}
