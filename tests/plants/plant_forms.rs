//! Effects of which a first look shows little: of a difference or of one of its variables, in the straight part of what a parameter
//! does, faster than a turn, or faster than the samples. The recorded plant is the simulator with one line changed.

use std::fmt::Write;

use serde_json::Value;

use crate::folder::Folder;
use crate::plant_initial_states::noise;

/// Inputs of a recording: `{name},{name}` and a row of values for each sample.
type Inputs<'a> = (&'a str, &'a dyn Fn(usize) -> Vec<f64>);

/// The answer where `line` of the simulator is `other` in the recorded plant, its parameters are `values`, and each output has noise of
/// this standard deviation.
fn explained(
    plant: &str,
    (line, other): (&str, &str),
    values: &str,
    (samples, step): (usize, f64),
    (names, inputs): Inputs,
    noises: &[f64],
) -> Value {
    let folder = Folder::new();
    folder.text("plant.mo", plant);
    assert!(plant.contains(line), "{line}");
    folder.text("recorded.mo", &plant.replace(line, other));
    let rows: Vec<Vec<f64>> = (0..samples).map(inputs).collect();
    let mut text = format!("t,{names}\n");
    for (k, row) in rows.iter().enumerate() {
        let row: Vec<String> = row.iter().map(f64::to_string).collect();
        writeln!(text, "{},{}", step * k as f64, row.join(",")).unwrap();
    }
    folder.text("input.csv", &text);
    let simulate = [
        "simulate",
        "recorded.mo",
        "input.csv",
        "--parameters",
        values,
    ];
    let outputs = folder.run(&[&simulate[..], &["--output", "true.csv"]].concat());
    outputs.ok();
    let simulated = std::fs::read_to_string(folder.join("true.csv")).unwrap();
    let mut normal = noise(7);
    let mut simulated = simulated.lines();
    let header = simulated.next().unwrap();
    let (_, outputs) = header.split_once(',').unwrap();
    let mut log = format!("t,{names},{outputs}\n");
    for (line, row) in simulated.zip(text.lines().skip(1)) {
        let values = line.split(',').skip(1).zip(noises);
        let noisy: Vec<String> = values
            .map(|(y, std)| (y.parse::<f64>().unwrap() + std * normal()).to_string())
            .collect();
        writeln!(log, "{row},{}", noisy.join(",")).unwrap();
    }
    folder.text("log.csv", &log);
    folder.explained("log.csv", "plant.mo", &[])
}

/// The first effect: id, what it is a function of, and a number of it.
fn first<'a>(said: &'a Value, number: &str) -> (&'a str, Vec<&'a str>, f64, f64) {
    let effect = &said["effects"][0];
    let depends = effect["depends"].as_array().unwrap().iter();
    let of = |key: &str| effect["parameters"][number][key].as_f64();
    (
        effect["effect"].as_str().unwrap(),
        depends.map(|d| d.as_str().unwrap()).collect(),
        of("value").unwrap_or(f64::NAN),
        of("std").unwrap_or(f64::NAN),
    )
}

/// Values that change now and then, by a generator of their own.
fn levels(every: usize, seed: u64) -> impl Fn(usize) -> f64 {
    let mut normal = noise(seed);
    let all: Vec<f64> = (0..4000).map(|_| normal()).collect();
    move |k| all[k / every]
}

/// The resistance at 0 K would be far outside of its bounds; and the room's temperature changes little, so that the difference of both
/// looks like one of them.
#[test]
fn a_resistance_in_kelvin_stays_within_its_bounds() {
    let stack = r#"model Stack
  parameter Real Ct(unit="J/K", min=8000, max=16000) = 11000;
  parameter Real G(unit="W/K", min=6, max=20) = 12;
  parameter Real R0(unit="Ohm", min=0.06, max=0.15) = 0.1;
  final parameter Real U0(unit="V") = 15.2;
  input Real i(unit="A"); input Real Ta(unit="K");
  output Real yU(unit="V"); output Real yT(unit="K");
  Real T(unit="K", start=300);
equation
  Ct*der(T) = 0.105*i^2 + 17*i - G*(T - Ta);
  yU = U0 + R0*i;
  yT = T;
end Stack;
"#;
    let loud = levels(60, 3);
    let inputs = |k: usize| {
        let room = 293.0 + 4.0 * (k as f64 / 300.0).sin();
        vec![22.0 + 8.0 * loud(k).clamp(-2.0, 2.0), room]
    };
    let other = "yU = U0 + R0*(1 - 0.006*(T - 320))*i;";
    let said = explained(
        stack,
        ("yU = U0 + R0*i;", other),
        "Ct=12500,G=11,R0=0.105",
        (1500, 20.0),
        ("i,Ta", &inputs),
        &[0.01, 0.1],
    );
    let (id, depends, c, std) = first(&said, "parameter_curve_c");
    assert_eq!(
        id, "temperature_dependent_resistance",
        "{}",
        said["summary"]
    );
    assert_eq!(depends, ["T", "R0"]);
    assert!((c + 0.006 * 0.105).abs() < 4.0 * std, "{c} +- {std}");
}

/// The flow turns in few of the samples.
#[test]
fn a_loss_of_a_flow_that_rarely_turns_is_found() {
    let surge = r#"model Surge
  parameter Real A(unit="m2", min=60, max=100) = 80;
  parameter Real k(unit="s/m2", min=0) = 0.012;
  input Real out(unit="m3/s"); output Real y(unit="m");
  Real Q(unit="m3/s", start=22); Real h(unit="m", start=-1);
equation
  34.25*der(Q) = -h - k*Q;
  A*der(h) = Q - out;
  y = h;
end Surge;
"#;
    let loud = levels(250, 4);
    let inputs = |k: usize| vec![20.0 + 8.0 * loud(k).clamp(-2.0, 2.0)];
    let said = explained(
        surge,
        ("- k*Q;", "- k*Q - 0.004*Q*abs(Q);"),
        "A=78,k=0.01",
        (3000, 2.0),
        ("out", &inputs),
        &[0.03],
    );
    let (_, depends, c, std) = first(&said, "signed_square_c");
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    assert_eq!(depends, ["Q"]);
    assert!(
        (c + 0.004).abs() < 4.0 * std,
        "{c} +- {std}: {}",
        said["summary"]
    );
}

/// Six teeth a turn, and many turns: no part of the range of the angle is near to their period.
#[test]
fn cogging_over_many_turns_is_found() {
    let motor = r#"model Motor
  parameter Real J(unit="kg.m2", min=0.0007, max=0.0015) = 0.001;
  parameter Real b(unit="N.m.s/rad", min=0) = 0.002;
  input Real u(unit="N.m"); output Real y(unit="rad/s"); output Real angle(unit="rad");
  Real w(unit="rad/s"); Real th(unit="rad");
equation
  J*der(w) = u - b*w;
  der(th) = w;
  y = w; angle = th;
end Motor;
"#;
    let loud = levels(60, 5);
    let inputs = |k: usize| vec![0.03 + 0.06 * loud(k).clamp(-2.0, 2.0)];
    let said = explained(
        motor,
        ("u - b*w;", "u - b*w - 0.02*sin(6*th + 0.7);"),
        "J=0.0011,b=0.0025",
        (2000, 0.004),
        ("u", &inputs),
        &[0.1, 0.02],
    );
    let (id, depends, c, std) = first(&said, "sine_k");
    assert_eq!(id, "cogging", "{}", said["summary"]);
    assert_eq!(depends, ["th"]);
    assert!((c - 6.0).abs() < 4.0 * std.max(1e-4), "{c} +- {std}");
}

/// The current settles in a tenth of a sample, and every voltage is a new one: the equations are linear, and with the effect they are
/// stiff.
#[test]
fn a_gain_that_depends_on_the_position_is_found_in_a_stiff_plant() {
    let speaker = r#"model Speaker
  parameter Real k(unit="N/m", min=1000, max=1900) = 1300;
  parameter Real d(unit="N.s/m", min=0.3, max=1.5) = 0.7;
  parameter Real Bl(unit="T.m", min=4.5, max=6.5) = 5.4;
  final parameter Real m(unit="kg") = 0.012;
  final parameter Real R(unit="Ohm") = 6;
  final parameter Real L(unit="H") = 0.0003;
  input Real u(unit="V"); output Real yx(unit="m"); output Real yi(unit="A");
  Real x(unit="m"); Real v(unit="m/s"); Real i(unit="A");
equation
  der(x) = v;
  m*der(v) = Bl*i - k*x - d*v;
  L*der(i) = u - R*i - Bl*v;
  yx = x; yi = i;
end Speaker;
"#;
    let lines = "equation
  der(x) = v;
  m*der(v) = Bl*i - k*x - d*v;
  L*der(i) = u - R*i - Bl*v;";
    let other = lines.replace("Bl*", "Bl*(1 - c*x^2)*").replace(
        "equation",
        "  final parameter Real c(unit=\"1/m2\") = 1.1e4;\nequation",
    );
    let loud = levels(1, 6);
    let inputs = |k: usize| vec![12.0 * loud(k)];
    let said = explained(
        speaker,
        (lines, &other),
        "k=1450,d=0.85,Bl=5.6",
        (900, 0.0005),
        ("u", &inputs),
        &[3e-5, 0.01],
    );
    assert_eq!(said["verdict"], "named", "{}", said["summary"]);
    let (_, depends, c, std) = first(&said, "parameter_square_c");
    assert_eq!(depends, ["x", "Bl"]);
    assert!((c + 1.1e4 * 5.6).abs() < 4.0 * std, "{c} +- {std}");
}
