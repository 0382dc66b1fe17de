//! What a simulation leaves out.

use std::path::PathBuf;

use innovant::explain::{
    AugmentedModel, Hypothesis, Options, PlantOptions, Simulation, explain as explain_logs,
    explain_plant as explain_equations,
};
use innovant::identify::Recording;
use innovant::internal::log::write_file_atomically;
use innovant::internal::report::explanation_text;
use innovant::report::{explanation_page, parse_explanation, to_json};
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;

use crate::arrays::{
    Samples, columns, recording, recording_name, recordings, samples, slices, sparse_recordings,
};
use crate::errors::raise;
use crate::model::Model;
use crate::plant::Plant;

/// The answer, ready to be simulated.
#[pyclass(module = "innovant._innovant", frozen)]
pub struct Explanation {
    explanation: innovant::explain::Explanation,
}

#[pymethods]
impl Explanation {
    /// The document that the command line writes.
    fn to_json(&self) -> PyResult<String> {
        to_json(&self.explanation).map_err(raise)
    }

    #[staticmethod]
    fn from_json(name: &str, text: &str) -> PyResult<Self> {
        let explanation = parse_explanation(name, text).map_err(raise)?;
        Ok(Self { explanation })
    }

    /// What the command line prints.
    fn text(&self) -> String {
        explanation_text(&self.explanation)
    }

    /// Whether simulating takes the answer of the original simulator.
    fn needs_simulation(&self) -> bool {
        let model = self.explanation.model.as_ref();
        model.is_some_and(|m| m.reference.is_some())
    }

    /// Headers of the inputs, of the outputs.
    fn names(&self) -> PyResult<(Vec<String>, Vec<String>)> {
        let model = self.model()?;
        let of = |list: &[innovant::log::Channel]| list.iter().map(ToString::to_string).collect();
        Ok((of(&model.inputs), of(&model.outputs)))
    }

    /// Writes the page; the file appears whole or not at all.
    fn report(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| {
            let page = explanation_page(&self.explanation).map_err(raise)?;
            write_file_atomically(&path, page.as_bytes()).map_err(raise)
        })
    }

    /// Free run on inputs of samples x channels, from rest or a state, corrected by the simulator's answer.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: Samples<'py>,
        x0: Option<Vec<f64>>,
        simulation: Option<Samples<'py>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (inputs, given) = (columns(&u), simulation.as_ref().map(columns));
        let model = self.model()?;
        let outputs = py.detach(|| {
            let given = given.as_deref().map(slices);
            model.simulate(&slices(&inputs), x0.as_deref(), given.as_deref())
        });
        Ok(samples(py, &outputs.map_err(raise)?))
    }

    /// The state at the first sample that fits a recording best.
    fn initial_state<'py>(
        &self,
        py: Python<'py>,
        u: Samples<'py>,
        y: Samples<'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (inputs, outputs) = (columns(&u), columns(&y));
        let model = self.model()?;
        let state = py.detach(|| model.estimate_initial_state(&slices(&inputs), &slices(&outputs)));
        Ok(state.map_err(raise)?.to_pyarray(py))
    }
}

impl Explanation {
    /// The linear model with effects that explanations of linear simulations hold.
    fn model(&self) -> PyResult<&AugmentedModel> {
        self.explanation.model.as_ref().ok_or_else(|| {
            raise("this explains a plant in equations: simulate the text in `plant.modelica` with innovant.Plant")
        })
    }
}

/// Compares recordings with a simulation: a model, or simulated outputs.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "called by one Python function")]
pub fn explain(
    py: Python<'_>,
    u: Vec<Samples<'_>>,
    y: Vec<Samples<'_>>,
    dt: f64,
    names: (Vec<String>, Vec<String>),
    model: Option<PyRef<'_, Model>>,
    outputs: Vec<Samples<'_>>,
    without: Vec<String>,
    seed: u64,
) -> PyResult<Explanation> {
    let logs = recordings(&u, &y, dt, &names.0, &names.1)?;
    let simulation = match model {
        Some(model) => Simulation::Model(Box::new(model.model.clone()), "simulation".to_owned()),
        None => {
            let count = outputs.len();
            let simulated = outputs.iter().enumerate().map(|(index, y)| {
                let name = recording_name(index, count).replace("recording", "simulation");
                recording(&name, dt, (&[], &names.1), (Vec::new(), columns(y)))
            });
            Simulation::Outputs(simulated.collect::<PyResult<_>>()?)
        }
    };
    let options = Options { without, seed };
    let explanation = py.detach(|| explain_logs(&logs, &simulation, &options));
    let explanation = explanation.map_err(raise)?;
    Ok(Explanation { explanation })
}

/// Compares recordings with a plant in equations.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "called by one Python function")]
pub fn explain_plant(
    py: Python<'_>,
    plant: &Plant,
    u: Vec<Samples<'_>>,
    y: Vec<Samples<'_>>,
    dt: f64,
    names: (Vec<String>, Vec<String>),
    hold: Option<&str>,
    only: Vec<String>,
    without: Vec<String>,
    hypotheses: Vec<String>,
) -> PyResult<Explanation> {
    let logs = sparse_recordings(&u, &y, dt, &names.0, &names.1)?;
    let known = logs.iter().map(|log| Recording::of_log(log, None));
    let known: Vec<Recording> = known.collect();
    let at_values = plant.core.with_values(&plant.point.parameters);
    let parsed = hypotheses.iter().map(|text| {
        Hypothesis::parse(text, &at_values.spec).map_err(|e| raise(e.render("hypotheses")))
    });
    let options = PlantOptions {
        hold: plant.hold(hold)?,
        only,
        without,
        hypotheses: parsed.collect::<PyResult<_>>()?,
    };
    let explanation = py.detach(|| explain_equations(&at_values, &logs, known, &options));
    let explanation = explanation.map_err(raise)?;
    Ok(Explanation { explanation })
}
