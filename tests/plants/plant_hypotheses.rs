//! `explain --hypothesis` on recordings of an integrator of its own.

use crate::cart::{CART, explained_with, record};
use crate::folder::Folder;
use serde_json::Value;

const DRAG: &str = "drag: m*der(v) += -c*v*abs(v), c > 0 [N.s2/m2]";
const DRY: &str = "dry: m*der(v) += -f*tanh(v/w), f > 0, w > 0";
const PUSH: &str = "push: m*der(v) += c*v*abs(v), c > 0";

fn dragged() -> Folder {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    record(&folder, "log.csv", 1.1, |_, v, _| -2.5 * v * v.abs(), 1);
    folder
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

fn rivals(hypothesis: &Value) -> Vec<&str> {
    let rivals = hypothesis["rivals"].as_array().unwrap();
    rivals
        .iter()
        .map(|r| r["effect"].as_str().unwrap())
        .collect()
}

#[test]
fn a_right_hypothesis_wins_and_wrong_ones_are_reported() {
    let folder = dragged();
    folder.text(
        "mine.txt",
        &format!("# what I think\n{DRAG} # air\n\n{DRY}\n"),
    );
    let more = ["--hypothesis", "@mine.txt", "--hypothesis", PUSH];
    let said = explained_with(&folder, "log.csv", &more);
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    let effect = &said["effects"][0];
    assert_eq!(
        (&effect["effect"], &effect["hypothesis"]),
        (&"drag".into(), &true.into())
    );
    assert_eq!(effect["equation"], "m*der(v) = u - k*x - d*v - c*v*abs(v)");
    assert_eq!(
        (&effect["enters"], &effect["depends"][0]),
        (&"v".into(), &"v".into())
    );
    let c = &effect["parameters"]["c"];
    assert!(
        (number(&c["value"]) - 2.5).abs() < 4.0 * number(&c["std"]),
        "{c}"
    );
    let (at, law) = (&effect["law"]["at"][40], &effect["law"]["value"][40]);
    let (at, law) = (number(at), number(law));
    assert!((law + number(&c["value"]) * at * at.abs()).abs() < 1e-6 * law.abs());
    let asked = said["hypotheses"].as_array().unwrap();
    let verdicts: Vec<&str> = asked
        .iter()
        .map(|h| h["verdict"].as_str().unwrap())
        .collect();
    assert_eq!(verdicts, ["best", "not_supported", "refused"], "{asked:#?}");
    let drag = &asked[0];
    assert_eq!(
        (&drag["name"], &drag["text"]),
        (&"drag".into(), &DRAG.into())
    );
    assert!(number(&drag["gain"]) > 24.0);
    assert_eq!(drag["parameters"]["c"]["unit"], "N.s2/m2");
    assert_eq!(rivals(drag).first(), Some(&"quadratic_drag"), "{drag:#}");
    assert!(
        number(&drag["fit"]["with_hypothesis"]["fit_percent"])
            > number(&drag["fit"]["parameters_only"]["fit_percent"])
    );
    assert!(rivals(&asked[1]).contains(&"drag"), "{:#}", asked[1]);
    assert!(number(&asked[1]["gain_beside"]) < 16.0);
    assert!(
        asked[2]["sentence"]
            .as_str()
            .unwrap()
            .contains("c ends at a bound")
    );
    let page = std::fs::read_to_string(folder.join("e.html")).unwrap();
    assert!(page.contains("What was asked") && page.contains("Not supported"));
    // It is simulated as an effect of the library is.
    folder
        .run(&["simulate", "e.json", "log.csv", "--output", "p.csv"])
        .ok();
}

#[test]
fn a_wrong_hypothesis_does_not_hide_what_is_missing() {
    let folder = dragged();
    let arguments = [
        "explain",
        "log.csv",
        "--simulation",
        "cart.mo",
        "--hypothesis",
        DRY,
        "--output",
        "e.json",
    ];
    let printed = folder.run(&arguments).ok();
    assert!(printed.contains("NAMED: quadratic drag"), "{printed}");
    assert!(
        printed.contains("Hypothesis dry: NOT SUPPORTED."),
        "{printed}"
    );
    let said = crate::folder::json(&folder.join("e.json"));
    assert!(
        rivals(&said["hypotheses"][0]).contains(&"quadratic_drag"),
        "{said:#}"
    );
    assert!(said["effects"][0].get("hypothesis").is_none());
}

#[test]
fn what_enters_an_input_is_found_from_a_few_starts() {
    let folder = Folder::new();
    folder.text("cart.mo", CART);
    // The force is bent at its upper end: the library has no such term.
    let bent = |u: f64| 15.0 * (u / 15.0).tanh() - u;
    crate::cart::record_with_input(&folder, "log.csv", 1.0, move |u, _, _, _| bent(u), 3);
    let said = explained_with(
        &folder,
        "log.csv",
        &["--hypothesis", "bent: u = s*tanh(u/s), s > 0 [N]"],
    );
    let effect = &said["effects"][0];
    assert_eq!(effect["effect"], "bent", "{said:#}");
    assert_eq!(effect["enters"], "u");
    assert_eq!(effect["port"], "input");
    let s = &effect["parameters"]["s"];
    assert!(
        (number(&s["value"]) - 15.0).abs() < 4.0 * number(&s["std"]) + 0.05,
        "{s}"
    );
}

#[test]
fn bad_hypotheses_are_told_where_and_how() {
    let folder = dragged();
    folder.text("mine.txt", "# one\ndrag: m*der(v) += -c*foo(v)\n");
    folder.text("none.txt", "# one\n");
    for (hypothesis, parts) in [
        (
            "@mine.txt",
            &[
                "mine.txt, line 2, column 22: `foo` is no function",
                "tanh",
                "^^^",
            ][..],
        ),
        ("none.txt", &["none.txt: the file has no hypothesis"]),
        ("@gone.txt", &["gone.txt: cannot be read"]),
        (
            "drag: a*der(v) += c",
            &[
                "--hypothesis, column 7: `a*der(v)` is no left-hand side",
                "did you mean `m*der(v)`?",
                "`u`",
            ],
        ),
        ("-c*v", &["begins with a name"]),
    ] {
        let given = format!("--hypothesis={hypothesis}");
        let run = folder.run(&["explain", "log.csv", "--simulation", "cart.mo", &given]);
        assert_eq!(run.code, 2, "{hypothesis}");
        for part in parts {
            assert!(run.stderr.contains(part), "{}", run.stderr);
        }
    }
    let twice = [
        "explain",
        "log.csv",
        "--simulation",
        "cart.mo",
        "--hypothesis",
        DRAG,
        "--hypothesis",
        DRAG,
    ];
    let said = folder.run(&twice).error();
    assert!(said.contains("two hypotheses are called `drag`"), "{said}");
    folder.text(
        "sim.csv",
        &std::fs::read_to_string(folder.join("log.csv")).unwrap(),
    );
    let columns = [
        "explain",
        "log.csv",
        "--simulation",
        "sim.csv",
        "--hypothesis",
        DRAG,
    ];
    let said = folder.run(&columns).error();
    assert!(
        said.contains("--hypothesis needs a plant in equations"),
        "{said}"
    );
}
