//! What is done with an estimated plant in equations: show, validate, simulate, its text, its page; and the uncertainty of its
//! linearisation.

use std::fs;

use innovant::internal::report::text_alone;
use innovant::physics::estimate::{EstimateOptions, Form, PlantRecording, estimate};
use innovant::physics::{Excitation, Hold, OperatingPoint, Plant, parse};
use innovant::report::{LinearisationDocument, PlantDocument, Uncertain, judge_plant};
use nalgebra::{DMatrix, dmatrix};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::folder::Folder;

const PENDULUM: &str = r#"model Pendulum "held up by a torque"
  parameter Real m(unit="kg", min=0.1, max=1) = 0.5;
  parameter Real d(unit="N.m.s/rad", min=0) = 0.05;
  final parameter Real l(unit="m") = 0.4;
  input Real u(unit="N.m");
  output Real y(unit="rad");
  Real phi(unit="rad", start=0);
  Real w(unit="rad/s", start=0);
equation
  der(phi) = w;
  m*l^2*der(w) = u - d*w - m*Modelica.Constants.g_n*l*sin(phi);
  y = phi;
end Pendulum;
"#;

const LAG: &str = "model Lag parameter Real T(min=0.1, max=10) = 1; parameter Real k = 2; input Real u; output Real y; \
                   Real x(start=0); equation T*der(x) = k*u - x; y = x; end Lag;";

fn plant(text: &str) -> Plant {
    Plant::new(parse(text).unwrap())
}

/// A recording of a plant with one input and output under random steps and white noise.
fn record(
    plant: &Plant,
    parameters: &[f64],
    start: &[f64],
    (samples, sample_time, noise): (usize, f64, f64),
    seed: u64,
) -> PlantRecording {
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut dice) };
    let mut u = Vec::with_capacity(samples);
    while u.len() < samples {
        let level = 0.7 * normal();
        u.extend([level; 10]);
    }
    u.truncate(samples);
    let mut point = plant.nominal();
    point.parameters = parameters.to_vec();
    point.start = start.iter().map(|x| Some(*x)).collect();
    let columns = [u.as_slice()];
    let excitation = Excitation {
        inputs: &columns,
        length: samples,
        sample_time,
        start_time: 0.0,
        hold: Hold::Zero,
    };
    let run = plant.simulate(&point, &excitation, None).unwrap();
    let y = run.outputs[0]
        .iter()
        .map(|y| y + noise * normal())
        .collect();
    PlantRecording {
        inputs: vec![u],
        outputs: vec![y],
        sample_time,
        start_time: 0.0,
    }
}

fn csv(record: &PlantRecording) -> String {
    let rows = record.inputs[0].iter().zip(&record.outputs[0]).enumerate();
    let rows = rows.map(|(k, (u, y))| format!("{},{u},{y}\n", k as f64 * record.sample_time));
    format!("t,u,y\n{}", rows.collect::<String>())
}

fn estimated(plant: &Plant, record: &PlantRecording) -> PlantDocument {
    let options = EstimateOptions {
        free: vec![true; plant.spec.parameters().len()],
        hold: Hold::Zero,
        form: Some(Form::FreeRun),
        least_squares: false,
    };
    let found = estimate(plant, std::slice::from_ref(record), &options).unwrap();
    PlantDocument::new(plant, &found, Hold::Zero)
}

/// The equilibrium of the pendulum under a torque moves with its mass, and with it the poles and the gain. Drawn parameters give
/// the same spread as the derivatives.
#[test]
fn uncertainty_of_the_linearisation_equals_draws() {
    let plant = plant(PENDULUM);
    let point = plant.nominal();
    let covariance = dmatrix![1e-4, 3e-6; 3e-6, 2.5e-7];
    let at = |parameters: &[f64], uncertain: &[usize], covariance: Option<&DMatrix<f64>>| {
        let mut point = point.clone();
        point.parameters = parameters.to_vec();
        let operating = OperatingPoint::Equilibrium(vec![0.0, 0.0]);
        let operating = plant
            .at_operating_point(&point, &[1.2], &operating, uncertain)
            .unwrap();
        let of = Uncertain {
            plant: &plant,
            operating: &operating,
            covariance,
        };
        let document =
            LinearisationDocument::new(&of, "the equilibrium".to_owned(), &[3.0]).unwrap();
        let (pole, response) = (&document.poles[0], &document.frequency_response[0]);
        let values = [
            document.states[0].value,
            pole.natural_frequency_hz.unwrap(),
            pole.damping.unwrap(),
            pole.time_constant_s.unwrap(),
            document.static_gain[0].value.unwrap(),
            response.real.unwrap(),
            response.imag.unwrap(),
        ];
        (values, document)
    };
    let (_, document) = at(&point.parameters, &[0, 1], Some(&covariance));
    let (pole, response) = (&document.poles[0], &document.frequency_response[0]);
    let spread = response.covariance.unwrap();
    let stds = [
        document.states[0].std.unwrap(),
        pole.natural_frequency_std.unwrap(),
        pole.damping_std.unwrap(),
        pole.time_constant_std.unwrap(),
        document.static_gain[0].standard_deviation.unwrap(),
        spread[0][0].sqrt(),
        spread[1][1].sqrt(),
    ];
    // By the mass alone: phi = asin(u/(m g l)), dphi/dm = -tan(phi)/m.
    let phi = (1.2f64 / (0.5 * 9.80665 * 0.4)).asin();
    assert!((document.states[0].value - phi).abs() < 1e-10);
    assert!(
        (stds[0] - phi.tan() / 0.5 * 1e-2).abs() < 1e-8,
        "{}",
        stds[0]
    );
    let factor = covariance.clone().cholesky().unwrap().l();
    let mut dice = ChaCha8Rng::seed_from_u64(4);
    let draws: Vec<[f64; 7]> = (0..4000)
        .map(|_| {
            let z = nalgebra::DVector::from_fn(2, |_, _| StandardNormal.sample(&mut dice));
            let moved = &factor * z;
            let parameters: Vec<f64> = point
                .parameters
                .iter()
                .zip(moved.iter())
                .map(|(p, d)| p + d)
                .collect();
            at(&parameters, &[], None).0
        })
        .collect();
    for (k, std) in stds.iter().enumerate() {
        let mean = draws.iter().map(|d| d[k]).sum::<f64>() / draws.len() as f64;
        let drawn =
            (draws.iter().map(|d| (d[k] - mean).powi(2)).sum::<f64>() / draws.len() as f64).sqrt();
        // The standard error of a drawn deviation is 1.1 %; curvature adds some.
        assert!((drawn / std - 1.0).abs() < 0.06, "{k}: {drawn} {std}");
    }
}

#[test]
fn the_text_with_the_estimated_values_simulates_alike() {
    let plant = plant(PENDULUM);
    let folder = Folder::new();
    folder.text("plant.mo", PENDULUM);
    let log = record(&plant, &[0.45, 0.06], &[0.3, 0.0], (600, 0.03, 0.01), 1);
    folder.text("log.csv", &csv(&log));
    folder
        .run(&[
            "identify",
            "log.csv",
            "--structure",
            "plant.mo",
            "-o",
            "plant.json",
            "--report",
            "page.html",
        ])
        .ok();
    let text = folder
        .run(&["show", "plant.json", "--format", "modelica"])
        .ok();
    assert!(
        text.contains("= 0.4") && !text.contains("= 0.5;") && text.contains("= 0.4;"),
        "{text}"
    );
    folder.text("calibrated.mo", &text);
    let start = ["log.csv", "--initial-state", "phi=0.3"];
    let a = folder
        .run(&[&["simulate", "plant.json"], &start[..]].concat())
        .ok();
    let b = folder
        .run(&[&["simulate", "calibrated.mo"], &start[..]].concat())
        .ok();
    assert_eq!(a, b);
    // Written again it is the same; a text without estimates is itself.
    assert_eq!(
        folder
            .run(&["show", "calibrated.mo", "--format", "modelica"])
            .ok(),
        text
    );
    assert_eq!(
        folder
            .run(&["show", "plant.mo", "--format", "modelica"])
            .ok(),
        PENDULUM
    );

    let page = fs::read_to_string(folder.join("page.html")).unwrap();
    for id in [
        "answer",
        "parameters",
        "recordings",
        "residuals",
        "equations",
        "provenance",
    ] {
        assert!(page.contains(&format!("<section id=\"{id}\"")), "{id}");
    }
    assert!(page.contains("Correlations of the estimates"));

    let shown = folder.run(&["show", "plant.json", "--input", "u=0.5"]).ok();
    assert!(
        shown.contains("Parameters") && shown.contains("Poles (continuous time)"),
        "{shown}"
    );
    let json = folder
        .run(&[
            "show",
            "plant.json",
            "--state",
            "phi=0.2",
            "--at",
            "1,5",
            "--format",
            "json",
        ])
        .json();
    assert_eq!(json["format"], "innovant-linearisation/1");
    assert_eq!(json["frequency_response"].as_array().unwrap().len(), 2);
    assert!(json["frequency_response"][1]["magnitude_95"][0].is_number());
    assert!(json["poles"][0]["damping_std"].as_f64().unwrap() > 0.0);
    assert_eq!(json["states"][0]["value"], 0.2);
    let csv = folder
        .run(&["show", "plant.json", "--at", "1,5", "--format", "csv"])
        .ok();
    assert_eq!(csv.lines().count(), 3);
    let along = folder
        .run(&[
            "show",
            "plant.json",
            "--along",
            "log.csv",
            "--format",
            "json",
        ])
        .json();
    let of = &along["identified"];
    assert_eq!(
        of["plant_response"].as_array().unwrap().len(),
        of["frequency_response"].as_array().unwrap().len()
    );
    assert!(
        along["operating_point"]
            .as_str()
            .unwrap()
            .contains("mean inputs")
    );
}

#[test]
fn validate_accepts_the_right_plant_and_rejects_another() {
    let plant = plant(PENDULUM);
    let folder = Folder::new();
    folder.text("plant.mo", PENDULUM);
    let shape = (600, 0.03, 0.01);
    let truth = [0.45, 0.06];
    folder.text(
        "log.csv",
        &csv(&record(&plant, &truth, &[0.3, 0.0], shape, 1)),
    );
    folder.text(
        "fresh.csv",
        &csv(&record(&plant, &truth, &[-0.4, 1.0], shape, 2)),
    );
    folder.text(
        "other.csv",
        &csv(&record(&plant, &[0.45, 0.09], &[-0.4, 1.0], shape, 3)),
    );
    folder
        .run(&[
            "identify",
            "log.csv",
            "--structure",
            "plant.mo",
            "-o",
            "plant.json",
        ])
        .ok();
    let own = folder.run(&["validate", "plant.json", "log.csv"]).ok();
    assert!(
        own.starts_with("Plant accepted on the recording it was estimated from"),
        "{own}"
    );
    let fresh = folder
        .run(&["validate", "plant.json", "fresh.csv", "--format", "json"])
        .json();
    assert_eq!(fresh["format"], "innovant-plant-validation/1");
    assert_eq!(
        (&fresh["relation"], &fresh["rejected"]),
        (&"fresh".into(), &false.into())
    );
    assert!(fresh["free_run"]["fit_percent"].as_f64().unwrap() > 90.0);
    let start = &fresh["initial_states"][0][0];
    let (value, std) = (
        start["value"].as_f64().unwrap(),
        start["std"].as_f64().unwrap(),
    );
    assert!(
        (value + 0.4).abs() < 5.0 * std && std < 0.02,
        "{value} {std}"
    );
    for (model, log) in [("plant.json", "other.csv"), ("plant.mo", "log.csv")] {
        let run = folder.run(&["validate", model, log]);
        assert_eq!(run.code, 1, "{model} {log}");
        assert!(
            run.stdout
                .starts_with("Plant rejected on a recording it has not seen"),
            "{}",
            run.stdout
        );
        let words: Vec<&str> = run.stdout.split_whitespace().collect();
        let said = words.join(" ");
        assert!(said.contains("leave something out"), "{said}");
    }
}

/// A fresh recording ten times as long as the one estimated from: the errors of the parameters stand out in its residuals, and
/// the tests allow for them. Without that nearly all of these are rejected.
#[test]
fn errors_of_the_parameters_are_no_reason_to_reject() {
    let plant = plant(LAG);
    let truth = [1.3, 1.7];
    let (mut rejected, mut certain) = (0, 0);
    let runs = 40;
    for seed in 0..runs {
        let own = record(&plant, &truth, &[0.0], (200, 0.2, 0.2), 10 + seed);
        let fresh = record(&plant, &truth, &[1.0], (4000, 0.2, 0.2), 1000 + seed);
        let document = estimated(&plant, &own);
        let (_, point) = document.plant().unwrap();
        let records = [fresh];
        let held = document.held(&plant, &point, false);
        rejected += usize::from(
            judge_plant(&plant, &records, &held, 0.05)
                .unwrap()
                .0
                .rejected,
        );
        let text = text_alone(&point, Hold::Zero);
        certain += usize::from(
            judge_plant(&plant, &records, &text, 0.05)
                .unwrap()
                .0
                .rejected,
        );
    }
    println!("rejected {rejected}, with parameters taken as certain {certain} of {runs}");
    // Two are expected; more than 7 in one of a thousand studies.
    assert!(rejected <= 7, "{rejected}");
    assert!(certain >= runs as usize / 2, "{certain}");
}

#[test]
fn what_does_not_fit_is_said() {
    let folder = Folder::new();
    folder.text("plant.mo", PENDULUM);
    folder.text(
        "tank.mo",
        "model T parameter Real a = 1; input Real u; output Real y; Real h(start=1); equation der(h) = u - a/h; \
         y = h; end T;",
    );
    folder.text("bare.json", r#"{"A": 0.5, "B": 1, "C": 1, "dt": 0.1}"#);
    for (arguments, words) in [
        (
            &["show", "plant.mo", "--input", "v=1"][..],
            "no input `v`; it has u",
        ),
        (
            &["show", "plant.mo", "--state", "x=1"],
            "no state `x`; it has phi, w",
        ),
        (
            &["show", "plant.mo", "--input", "u=9", "--format", "json"],
            "no equilibrium was found near phi = 0.0",
        ),
        (
            &["show", "tank.mo", "--state", "h=0"],
            "not a finite number",
        ),
        (
            &["show", "bare.json", "--input", "u=1"],
            "belong to a plant in equations",
        ),
        (
            &["validate", "plant.mo", "log.csv", "--detrend", "mean"],
            "--detrend belongs to linear models",
        ),
    ] {
        let error = folder.run(arguments).error();
        assert!(error.contains(words), "{arguments:?}: {error}");
    }
    folder.text(
        "gain.mo",
        "model G parameter Real k = 3; input Real u; output Real y; equation y = k*u; end G;",
    );
    let json = folder.run(&["show", "gain.mo", "--format", "json"]).json();
    assert_eq!(
        (&json["static_gain"][0]["value"], &json["poles"]),
        (&3.0.into(), &serde_json::json!([]))
    );
    // Not asked for: the rest is shown.
    folder.text(
        "none.mo",
        "model N parameter Real a = 1; input Real u; output Real y; Real h(start=1); equation der(h) = u + a + h^2; \
         y = h; end N;",
    );
    let shown = folder.run(&["show", "none.mo"]);
    assert!(
        shown.code == 0 && shown.stdout.contains("Outputs"),
        "{}",
        shown.stderr
    );
    assert!(shown.stderr.contains("not linearised"), "{}", shown.stderr);
}
