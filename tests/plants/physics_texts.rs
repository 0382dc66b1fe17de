//! Every model text that came with the project is read, and none has a conflict of units.

use innovant::physics::{check_units, parse};
use std::path::{Path, PathBuf};

/// Folders of cases, where they are present.
fn texts() -> Vec<PathBuf> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let mut answer = vec![];
    for folder in ["physics/dev", "field"] {
        let Ok(entries) = std::fs::read_dir(shared.join(folder)) else {
            continue;
        };
        answer.extend(
            entries
                .flatten()
                .map(|e| e.path().join("simulator.mo"))
                .filter(|p| p.is_file()),
        );
    }
    answer.sort();
    answer
}

#[test]
fn every_simulator_is_read() {
    for path in texts() {
        let name = path.display().to_string();
        let text = std::fs::read_to_string(&path).expect("the file can be read");
        let spec = match parse(&text) {
            Ok(spec) => spec,
            Err(error) => panic!("{}", error.render(&name, &text)),
        };
        if let Err(error) = check_units(&spec) {
            panic!("{}", error.render(&name, &text));
        }
        assert!(!spec.outputs().is_empty(), "{name}");
        assert!(!spec.states().is_empty(), "{name}");
        let determined = spec.variables.len() - spec.constants.len() - spec.inputs().len();
        assert_eq!(spec.equations.len(), determined, "{name}");
    }
}

#[test]
fn the_example_of_the_language_is_read() {
    let text = r#"model Servo "position drive"
  parameter Real J(unit="kg.m2", min=0.008, max=0.012) = 0.01 "inertia";
  parameter Real d(unit="N.m.s/rad", min=0) = 0.02;
  input Real u(unit="V");
  output Real y(unit="rad");
  Real phi(unit="rad", start=0);
  Real w(unit="rad/s", start=0);
  Real tau(unit="N.m") = 0.5*u;
equation
  der(phi) = w;
  J*der(w) = tau - d*w;
  y = phi;
end Servo;
"#;
    let spec = parse(text).expect("the example is right");
    assert_eq!(check_units(&spec), Ok(()));
    let names = |ids: Vec<innovant::physics::VariableId>| -> Vec<String> {
        ids.iter().map(|&v| spec.variable(v).name.clone()).collect()
    };
    assert_eq!(names(spec.states()), ["phi", "w"]);
    assert_eq!(names(spec.parameters()), ["J", "d"]);
    assert_eq!(names(spec.outputs()), ["y"]);
}

#[test]
fn a_conflict_of_units_is_shown_with_its_line() {
    let text = "model A\n  input Real tau(unit=\"N.m\");\n  Real w(unit=\"rad/s\");\nequation\n  2*der(w) = tau - w;\nend A;\n";
    let error = parse(text)
        .and_then(|spec| check_units(&spec))
        .expect_err("the units differ");
    assert_eq!(
        error.render("plant.mo", text),
        "plant.mo:5:14: unit conflict: `tau - w`: N.m minus rad/s\n 5 |   2*der(w) = tau - w;\n   |              ^^^^^^^"
    );
}
