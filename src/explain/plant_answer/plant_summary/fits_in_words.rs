//! Fits of free runs in sentences.

use crate::explain::explanation::{FitSteps, OutputFit};
use crate::explain::plant_answer::Origin;

/// Fits of the blocks left out, without and with the effects.
pub(super) fn held_out(outputs: &[OutputFit]) -> Option<String> {
    let percent = |o: &OutputFit| {
        let fit = o.heldout.as_ref()?;
        let (without, with) = (fit.parameters_only, fit.augmented);
        Some([without.fit_percent, with.fit_percent])
    };
    let all: Option<Vec<[f64; 2]>> = outputs.iter().map(percent).collect();
    let said = listed(
        outputs,
        &all.filter(|all| !all.is_empty())?,
        &["without it", "with it"],
    );
    Some(format!(
        "Fitted without a third of the recording, and run freely over it: {said}."
    ))
}

/// Free runs of all outputs.
pub(super) fn free_runs(outputs: &[OutputFit], with_effects: bool, origin: Origin) -> String {
    let words = [
        "with the values of the text",
        "with estimated parameters and initial states",
        "with what was found",
    ];
    let first = usize::from(origin == Origin::Structure);
    let last = if with_effects { 3 } else { 2 };
    let fits = |o: &OutputFit| {
        let t: &FitSteps = &o.train;
        let all = [t.simulation, t.parameters_only, t.augmented];
        all.map(|f| f.fit_percent)[first..last].to_vec()
    };
    let all: Vec<Vec<f64>> = outputs.iter().map(fits).collect();
    let said = listed(outputs, &all, &words[first..last]);
    match outputs {
        [one] => format!("Free run of {}: {said}.", one.output),
        _ => format!("Free run of each output, worst first: {said}."),
    }
}

/// A fit in percent; of a run that leaves the recording altogether only that it does.
fn percent(fit: f64) -> String {
    match fit < -1000.0 {
        true => "< -1000 %".to_owned(),
        false => format!("{fit:.1} %"),
    }
}

/// Fits of outputs; what each is, is said of the first.
fn listed<F: AsRef<[f64]>>(outputs: &[OutputFit], fits: &[F], words: &[&str]) -> String {
    let each = outputs.iter().zip(fits).enumerate();
    let each = each.map(|(i, (output, fits))| {
        let said = fits.as_ref().iter().zip(words).map(|(fit, word)| match i {
            0 => format!("{} {word}", percent(*fit)),
            _ => percent(*fit),
        });
        let said = said.collect::<Vec<_>>().join(", ");
        match outputs.len() {
            1 => said,
            _ => format!("{} {said}", output.output),
        }
    });
    each.collect::<Vec<_>>().join("; ")
}
