use super::*;
use crate::log::{Channel, Log};
use crate::physics::{Excitation, Plant, parse};

fn log(input: Channel, output: Channel, u: Vec<f64>, y: Vec<f64>) -> Log {
    Log {
        name: "drive".to_owned(),
        sample_time: 0.01,
        start_time: 0.0,
        inputs: vec![input],
        outputs: vec![output],
        input_data: vec![u],
        output_data: vec![y],
        sha256: None,
    }
}

/// Levels that are held for half a second: the same numbers on every machine.
fn levels(samples: usize) -> Vec<f64> {
    (0..samples)
        .map(|k| ((k / 50) as f64 * 0.7548776662).fract() * 4.0 - 1.5)
        .collect()
}

#[test]
fn structures_are_equations_whatever_the_channels_are_called() {
    let (u, y) = (levels(500), levels(500));
    for (input, output) in [
        ("u1", "y1"),
        ("motor force (N)", "der"),
        ("c1", "position [mm]"),
    ] {
        let recording = log(
            Channel::new(input),
            Channel::new(output),
            u.clone(),
            y.clone(),
        );
        let marks = Marks::of(&[recording]).unwrap();
        for structure in &STRUCTURES {
            let text = marks.fill(structure.equations, 0.3);
            assert!(!text.contains('{'), "{text}");
            let spec = parse(&text).unwrap_or_else(|e| panic!("{}", e.render("text", &text)));
            assert_eq!(spec.outputs().len(), 1);
            if let Some(lacks) = &structure.lacks {
                assert!(plant_effect(lacks.effect).is_some());
                for name in lacks.parameters {
                    assert!(spec.find(name).is_some(), "{name}");
                }
                assert_eq!(spec.states().len(), lacks.states.len());
                for suffix in lacks.states {
                    let declared = format!("Real {}(start", marks.state(suffix));
                    assert!(text.contains(&declared), "{declared}: {text}");
                }
            }
        }
    }
}

/// Nothing is known of the drive but its recording.
#[test]
fn a_drive_is_found_from_any_time_constant() {
    let truth = "model Truth input Real u1; output Real y1; Real x(start=0.4); Real v(start=0);
equation der(x) = v; 2.5*der(v) = u1 - 4*v; y1 = x; end Truth;";
    let plant = Plant::new(parse(truth).unwrap());
    let u = levels(3000);
    let excitation = Excitation {
        inputs: &[&u],
        length: u.len(),
        sample_time: 0.01,
        start_time: 0.0,
        hold: Hold::Zero,
    };
    let y = plant.simulate(&plant.nominal(), &excitation, None).unwrap();
    let y = y.outputs.into_iter().next().unwrap();
    let recording = log(Channel::new("u1"), Channel::new("y1"), u, y);
    let marks = Marks::of(std::slice::from_ref(&recording)).unwrap();
    let recordings = [PlantRecording::from(&recording)];
    let found = |s: &Structure| started(s.equations, &marks, &recordings, Hold::Zero).unwrap();
    let [drive, speed] = [found(&STRUCTURES[0]), found(&STRUCTURES[1])];
    let point = drive.plant.nominal();
    assert!((point.parameters[0] / 2.5 - 1.0).abs() < 1e-3, "{point:?}");
    assert!((point.parameters[1] / 4.0 - 1.0).abs() < 1e-3, "{point:?}");
    assert!(drive.error < 1e-3 * marks.output_std());
    assert!(drive.criterion < speed.criterion);
}

#[test]
fn a_level_is_not_negative() {
    let recording = |y: &[f64]| PlantRecording {
        inputs: vec![],
        outputs: vec![y.to_vec()],
        sample_time: 1.0,
        start_time: 0.0,
    };
    assert!(is_level(&[recording(&[0.0, 3.0, -0.1, f64::NAN])]));
    assert!(!is_level(&[recording(&[0.0, 3.0, -1.0])]));
    assert!(!is_level(&[recording(&[-1.0, -3.0])]));
}
