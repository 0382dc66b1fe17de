//! A drive with dry friction, an oscillator with a cubic spring, and a hair dryer that a linear model describes, through
//! the library. Their splits are those of the benchmarks; the fits see the training part only.

use innovant::Model;
use innovant::explain::{Explanation, Options, Simulation, Verdict, explain};
use innovant::identify;
use innovant::internal::linalg::spectral_radius;
use innovant::log::{Log, Roles, Source};

use crate::recordings;

/// The recording, or `None` with a printed reason.
fn recording(name: &str, roles: &Roles) -> Option<Log> {
    let path = recordings()?.join(name);
    Some(Log::read(&Source::from(path), roles).unwrap())
}

/// Samples `from..to` of a recording.
fn part(log: &Log, from: usize, to: usize) -> Log {
    let cut = |columns: &[Vec<f64>]| columns.iter().map(|c| c[from..to].to_vec()).collect();
    Log {
        input_data: cut(&log.input_data),
        output_data: cut(&log.output_data),
        start_time: log.start_time + from as f64 * log.sample_time,
        ..log.clone()
    }
}

fn identified(log: &Log) -> Model {
    let logs = std::slice::from_ref(log);
    identify::identify(logs, &identify::Options::default()).unwrap()
}

fn explained(log: &Log, model: Model) -> Explanation {
    let simulation = Simulation::Model(Box::new(model), "identified".to_owned());
    let logs = std::slice::from_ref(log);
    let said = explain(logs, &simulation, &Options::default()).unwrap();
    println!("{}", said.summary.join("\n"));
    said
}

/// Root mean square error after `skip` samples, and the fit in percent.
fn error(recorded: &[f64], simulated: &[f64], skip: usize) -> (f64, f64) {
    let n = (recorded.len() - skip) as f64;
    let mean = recorded[skip..].iter().sum::<f64>() / n;
    let square = |it: &mut dyn Iterator<Item = f64>| it.map(|v| v * v).sum::<f64>() / n;
    let both = recorded[skip..].iter().zip(&simulated[skip..]);
    let missed = square(&mut both.map(|(a, b)| a - b)).sqrt();
    let size = square(&mut recorded[skip..].iter().map(|a| a - mean)).sqrt();
    (missed, 100.0 * (1.0 - missed / size))
}

fn names(said: &Explanation) -> Vec<&str> {
    said.effects.iter().map(|e| e.effect.as_str()).collect()
}

fn drive_roles() -> Roles {
    Roles {
        inputs: Some(vec!["u1_force_N".to_owned()]),
        outputs: Some(vec!["y1".to_owned()]),
        ..Roles::default()
    }
}

/// Electro-mechanical positioning system (Janot, Gautier and Brunot 2019), published: mass 95.1 kg, viscous friction
/// 203.5 N s/m, Coulomb friction 20.4 N, offset -3.16 N.
fn is_the_drive(said: &Explanation, fresh: &Log) {
    assert_eq!(said.verdict, Verdict::Named);
    assert_eq!(names(said), ["coulomb_friction"]);
    let friction = said.effects[0].parameters["friction_force"].clone();
    assert!((friction.value / 20.4 - 1.0).abs() < 0.05, "{friction:?}");
    assert!(friction.std.is_some_and(|s| s < 1.0), "{friction:?}");
    // Other laws were asked, and are far behind.
    let rival = &said.alternatives[0];
    assert!(rival.support < 0.9, "{rival:?}");
    let mechanics = said.model.as_ref().unwrap().mechanics.as_ref().unwrap();
    assert!((mechanics.mass.value / 95.0 - 1.0).abs() < 0.03);
    assert!((mechanics.viscous_friction.value / 203.0 - 1.0).abs() < 0.05);
    assert!(said.effects[0].sentence.contains(&mechanics.sentence));
    let input: Vec<&[f64]> = fresh.input_data.iter().map(Vec::as_slice).collect();
    let output: Vec<&[f64]> = fresh.output_data.iter().map(Vec::as_slice).collect();
    let start = said
        .model
        .as_ref()
        .unwrap()
        .estimate_initial_state(&input, &output)
        .unwrap();
    for initial in [None, Some(start.as_slice())] {
        let ran = said
            .model
            .as_ref()
            .unwrap()
            .simulate(&input, initial, None)
            .unwrap();
        let (missed, fit) = error(output[0], &ran[0], 0);
        println!(
            "free run on the other recording: {:.2} mm, {fit:.1} %",
            1e3 * missed
        );
        assert!(fit > 92.0, "{fit:.2} %");
    }
}

#[test]
fn a_drive_has_dry_friction_and_a_mass() {
    let roles = drive_roles();
    let (Some(train), Some(fresh)) = (
        recording("emps_est.csv", &roles),
        recording("emps_val.csv", &roles),
    ) else {
        return;
    };
    let model = identified(&train);
    assert!(spectral_radius(&model.system.a).unwrap() < 1.0);
    is_the_drive(&explained(&train, model), &fresh);
}

#[test]
fn an_oscillator_has_a_cubic_spring_and_nothing_else() {
    let Some(whole) = recording("silverbox.csv.gz", &Roles::default()) else {
        return;
    };
    let (from, to) = (40_650, 127_400);
    let middle = from + (to - from) * 3 / 4;
    let train = part(&whole, from, middle);
    let model = identified(&train);
    let order = model.system.states();
    assert!((2..=8).contains(&order), "{order}");
    assert!(spectral_radius(&model.system.a).unwrap() < 1.0);
    let said = explained(&train, model);
    assert_eq!(said.verdict, Verdict::Named);
    assert_eq!(names(&said), ["cubic_stiffness"]);
    for (name, test, most) in [
        ("multisine", part(&whole, middle, to), 0.3e-3),
        // Beyond what was fitted to.
        ("arrow", part(&whole, 100, 40_575), 0.36e-3),
    ] {
        let input: Vec<&[f64]> = test.input_data.iter().map(Vec::as_slice).collect();
        // The benchmark gives the first 50 samples for the state.
        let first: Vec<&[f64]> = vec![&test.output_data[0][..50]];
        let begun: Vec<&[f64]> = vec![&input[0][..50]];
        let start = said
            .model
            .as_ref()
            .unwrap()
            .estimate_initial_state(&begun, &first)
            .unwrap();
        let ran = said
            .model
            .as_ref()
            .unwrap()
            .simulate(&input, Some(&start), None)
            .unwrap();
        let (missed, _) = error(&test.output_data[0], &ran[0], 50);
        println!("{name}: {:.3} mV", 1e3 * missed);
        assert!(missed <= most, "{name}: {missed}");
    }
}

#[test]
fn a_dryer_lacks_nothing() {
    let Some(log) = recording("daisy_dryer.csv", &Roles::default()) else {
        return;
    };
    let said = explained(&log, identified(&log));
    assert!(
        matches!(said.verdict, Verdict::Consistent | Verdict::Parameters),
        "{:?}",
        said.verdict
    );
    assert!(said.effects.is_empty());
}
