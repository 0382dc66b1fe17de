//! Short recordings without inputs, as of a culture, a drug or a capacitor.

use std::fmt::Write;

use crate::folder::{Folder, json};
use crate::plant_initial_states::noise;

/// Growth without a limit.
const CULTURE: &str = r#"model Culture
  parameter Real r(unit="1/h", min=0.05, max=2) = 0.3;
  output Real y(unit="g/l");
  Real N(unit="g/l", start=10);
equation
  der(N) = r*N/3600;
  y = N;
end Culture;
"#;

/// A drug that is in the blood at once.
const BOLUS: &str = r#"model Bolus
  parameter Real ke(unit="1/h", min=0.01, max=0.5) = 0.08;
  output Real y(unit="mg/l");
  Real c(unit="mg/l", start=10);
equation
  der(c) = -ke*c/3600;
  y = c;
end Bolus;
"#;

/// A capacitor that holds its charge.
const CAPACITOR: &str = r#"model Capacitor
  parameter Real C(unit="F", min=0.5, max=2) = 1;
  input Real i(unit="A");
  output Real y(unit="V");
  Real v(unit="V", start=0);
equation
  C*der(v) = i;
  y = v;
end Capacitor;
"#;

/// Time in seconds and one value after the other.
fn log(header: &str, step: f64, samples: usize, of: impl FnMut(f64) -> String) -> String {
    let rows = (0..samples).map(|k| k as f64 * step).map(of);
    rows.fold(header.to_owned(), |all, row| all + &row)
}

fn explained(folder: &Folder, more: &[&str]) -> serde_json::Value {
    let explain = [
        "explain",
        "log.csv",
        "--simulation",
        "plant.mo",
        "--output",
        "e.json",
    ];
    folder.run(&[&explain[..], more].concat()).ok();
    json(&folder.join("e.json"))
}

/// From the growth rate that makes up for the limit a fit of the limit does not find back.
#[test]
fn the_limit_of_a_growth_is_found_by_the_library_and_by_a_hypothesis() {
    let folder = Folder::new();
    folder.text("plant.mo", CULTURE);
    let mut normal = noise(1);
    let text = log("t,y\n", 3600.0, 19, |t| {
        let grown = 663.0 / (1.0 + 65.0 * (-0.547 * t / 3600.0).exp());
        format!("{t},{:.1}\n", grown + 4.0 * normal())
    });
    folder.text("log.csv", &text);
    let hypothesis = ["--hypothesis", "limit: der(N) += -c*N^2/3600, c > 0"];
    for more in [&[][..], &hypothesis] {
        let said = explained(&folder, more);
        assert_eq!(said["verdict"], "named", "{}", said["summary"]);
        let fit = &said["fit"]["train"]["augmented"]["fit_percent"];
        assert!(fit.as_f64().unwrap() > 97.0, "{}", said["summary"]);
        let equation = said["effects"][0]["equation"].as_str().unwrap();
        assert!(equation.contains("N^2"), "{equation}");
        if let Some(asked) = said["hypotheses"].get(0) {
            let c = asked["parameters"]["c"]["value"].as_f64().unwrap();
            assert!((c - 0.547 / 663.0).abs() < 1e-4, "{asked}");
        }
    }
}

/// What the equations miss by half of its variance is not explained by them, whatever a noise model says.
#[test]
fn equations_that_do_not_follow_are_not_consistent() {
    let folder = Folder::new();
    folder.text("plant.mo", BOLUS);
    let mut normal = noise(2);
    let text = log("t,y\n", 1800.0, 49, |t| {
        let h = t / 3600.0;
        let c = 12.0 * ((-0.09 * h).exp() - (-0.9 * h).exp());
        format!("{t},{:.2}\n", c + 0.1 * normal())
    });
    folder.text("log.csv", &text);
    let said = explained(&folder, &[]);
    let verdict = said["verdict"].as_str().unwrap();
    assert!(
        matches!(verdict, "named" | "unexplained"),
        "{verdict}: {}",
        said["summary"]
    );
}

#[test]
fn a_capacitor_that_discharges_itself_leaks() {
    let folder = Folder::new();
    folder.text("plant.mo", CAPACITOR);
    let mut normal = noise(3);
    let (mut v, mut text) = (0.0_f64, String::from("t,i,y\n"));
    for k in 0..300 {
        let i = if k < 40 { 0.1 } else { 0.0 };
        writeln!(text, "{},{i},{:.4}", 10 * k, v + 0.002 * normal()).unwrap();
        for _ in 0..100 {
            v += 0.1 * (i - v / 120.0);
        }
    }
    folder.text("log.csv", &text);
    let said = explained(&folder, &[]);
    let effect = &said["effects"][0];
    assert_eq!(effect["effect"], "leak", "{}", said["summary"]);
    // In proportion to the voltage, or to what it is above a threshold near 0.
    let parameters = effect["parameters"].as_object().unwrap();
    let strength = parameters.iter().find(|(name, _)| name.ends_with("_c"));
    let conductance = strength.unwrap().1["value"].as_f64().unwrap();
    assert!(
        (conductance + 1.0 / 120.0).abs() < 2e-4,
        "{}",
        said["summary"]
    );
}
