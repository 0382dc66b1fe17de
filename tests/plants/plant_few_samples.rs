//! Short recordings without inputs, as of a culture, a drug or a capacitor.

use std::fmt::Write;

use crate::folder::Folder;
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
pub const BOLUS: &str = r#"model Bolus
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
        let said = folder.explained("log.csv", "plant.mo", more);
        assert_eq!(said["verdict"], "named", "{}", said["summary"]);
        let fit = &said["fit"]["train"]["augmented"]["fit_percent"];
        assert!(fit.as_f64().unwrap() > 97.0, "{}", said["summary"]);
        let equation = said["effects"][0]["equation"].as_str().unwrap();
        assert!(equation.contains("N^2"), "{equation}");
        if let Some(asked) = said["hypotheses"].get(0) {
            assert_eq!(asked["verdict"], "best", "{asked}");
            let c = asked["parameters"]["c"]["value"].as_f64().unwrap();
            assert!((c - 0.547 / 663.0).abs() < 1e-4, "{asked}");
        }
    }
}

/// Slow noise about a level has nothing to do with an exponential decay. Where the best of these explains less than half of the
/// variance (a fit below 29.3 %), the noise model explains the recording, not the equations.
#[test]
fn equations_that_do_not_follow_are_not_consistent() {
    let folder = Folder::new();
    folder.text("plant.mo", BOLUS);
    let mut poor = 0;
    for seed in 0..4 {
        let (mut normal, mut x) = (noise(seed), 0.0);
        let text = log("t,y\n", 60.0, 300, |t| {
            x = 0.98 * x + normal();
            format!("{t},{:.3}\n", 10.0 + x)
        });
        folder.text("log.csv", &text);
        let said = folder.explained("log.csv", "plant.mo", &[]);
        let fit = &said["fit"]["train"]["parameters_only"]["fit_percent"];
        if fit.as_f64().unwrap() < 29.3 {
            poor += 1;
            let verdict = said["verdict"].as_str().unwrap();
            let quiet = matches!(verdict, "consistent" | "parameters");
            assert!(!quiet, "{seed}: {verdict}: {}", said["summary"]);
        }
    }
    assert!(poor >= 2, "{poor} of 4");
}

/// A dose that is swallowed rises before it falls; an injected one only falls, and a constant follows a few samples as well.
#[test]
fn equations_that_a_constant_beats_explain_nothing() {
    let folder = Folder::new();
    folder.text("plant.mo", BOLUS);
    let mut normal = noise(5);
    let mut text = String::from("time [h],y\n");
    for t in [0.0_f64, 0.25, 0.5, 1.0, 2.0, 4.0, 5.0, 7.0, 9.0, 12.0, 24.0] {
        let level = 11.0 * ((-0.08 * t).exp() - (-0.8 * t).exp());
        writeln!(text, "{t},{:.2}", (level + 0.3 * normal()).max(0.0)).unwrap();
    }
    folder.text("log.csv", &text);
    let said = folder.explained("log.csv", "plant.mo", &["--only", "coulomb_friction"]);
    let fit = &said["fit"]["train"]["parameters_only"]["fit_percent"];
    assert!(fit.as_f64().unwrap() < 5.0, "{}", said["fit"]);
    assert_eq!(said["verdict"], "unexplained", "{}", said["summary"]);
    let words = said["summary"].to_string();
    assert!(
        words.contains("A constant follows the recording better"),
        "{words}"
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
    let said = folder.explained("log.csv", "plant.mo", &[]);
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
