//! What must hold of everything that was accepted, and of every refusal.

use innovant::Model;
use innovant::covariance::invariants;
use innovant::internal::report::{Style, show_text};
use innovant::log::Log;
use innovant::report::{ModelDocument, parse_model};

use super::logs::white;

/// A refusal says something, once: nothing empty, nothing left unfilled, no message within a message twice.
pub fn refusal(error: &dyn std::error::Error) {
    let message = error.to_string();
    assert!(!message.trim().is_empty(), "an error without words");
    assert!(message.len() < 20_000, "{} bytes of message", message.len());
    for line in message.lines().filter(|line| line.len() > 20) {
        assert!(message.matches(line).count() == 1, "said twice: {message}");
    }
}

/// Columns of one length that hold numbers.
pub fn log(log: &Log) {
    assert!(log.sample_time.is_finite() && log.sample_time > 0.0);
    assert!(log.start_time.is_finite());
    assert_eq!(log.inputs.len(), log.input_data.len());
    assert_eq!(log.outputs.len(), log.output_data.len());
    for column in log.channel_data() {
        assert_eq!(column.len(), log.samples());
        assert!(column.iter().all(|v| v.is_finite()));
    }
}

/// A model can be shown, written and read back to the same, and simulated; or each says why not.
pub fn model(model: &Model) {
    let names = |channels: &[innovant::identify::IdentifiedChannel]| -> Vec<String> {
        channels.iter().map(|c| c.channel.name.clone()).collect()
    };
    let (n, r, l) = (
        model.system.states(),
        model.system.inputs(),
        model.system.outputs(),
    );
    assert_eq!((model.inputs.len(), model.outputs.len()), (r, l));
    assert_eq!(model.initial_state.len(), n);
    for matrix in [
        &model.system.a,
        &model.system.b,
        &model.system.c,
        &model.system.d,
        &model.system.k,
    ] {
        assert!(matrix.iter().all(|v| v.is_finite()));
    }
    match model.system.default_frequencies(5) {
        Ok(frequencies) => {
            let covariance = model.covariance.as_ref();
            match invariants(
                &model.system,
                covariance,
                &names(&model.outputs),
                &names(&model.inputs),
                &frequencies,
                0,
            ) {
                Ok(described) => {
                    let shown = show_text(model, &described, None, false, Style::ASCII);
                    assert!(!shown.trim().is_empty());
                }
                Err(error) => refusal(&error),
            }
        }
        Err(error) => refusal(&error),
    }
    match ModelDocument::new(model) {
        Ok(document) => {
            let text = document.to_json().expect("a document is JSON");
            let again = parse_model("again", &text)
                .unwrap_or_else(|error| panic!("a model is not read back: {error}\n{text}"));
            assert_eq!(again.model.system, model.system);
            assert_eq!(again.model.inputs, model.inputs);
            assert_eq!(again.model.outputs, model.outputs);
            assert_eq!(again.model.covariance, model.covariance);
            assert_eq!(again.model.initial_state, model.initial_state);
            assert_eq!(again.model.summary, model.summary);
            let twice = ModelDocument::new(&again.model).and_then(|d| d.to_json());
            assert_eq!(twice.expect("written again"), text);
        }
        Err(error) => refusal(&error),
    }
    let inputs: Vec<Vec<f64>> = (0..r).map(|i| white(i as u64, 20)).collect();
    let columns: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
    let outputs = model
        .simulate(&columns, Some(&model.initial_state))
        .expect("inputs that fit");
    assert_eq!(outputs.len(), l);
    if let Err(error) = model.check_finite(&outputs, 0.0) {
        refusal(&error);
    }
    let slices: Vec<&[f64]> = outputs.iter().map(Vec::as_slice).collect();
    if r > 0 {
        match model.initial_state_of(&columns, &slices) {
            Ok(state) => assert_eq!(state.len(), n),
            Err(error) => refusal(&error),
        }
    }
}
