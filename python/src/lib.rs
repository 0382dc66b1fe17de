//! The native part of the wheel: the core of innovant for numpy arrays, nothing else.
//!
//! What a user sees is Python (`python/innovant/*.py`): defaults, data frames, plots, documentation. This part takes
//! arrays, releases the GIL while it computes, and hands back arrays and JSON documents.
//!
//! | file | one idea |
//! |---|---|
//! | `arrays` | numpy arrays to recordings and matrices to numpy arrays |
//! | `errors` | every error of the core is an `InnovantError` with the words of the command line |
//! | `options` | options of `identify`, from JSON |
//! | `examples` | recordings of known plants |
//! | `records` | recordings that stay in their arrays |
//! | `model` | the model: matrices, simulate, predict, validate, documents |
//! | `responses` | poles, zeros, frequency and step response with their uncertainty |
//! | `explanation` | `explain` and its answer |
//! | `plant` | plants in equations |
//! | `simulator` | Python functions that simulate |
//! | `moments` | recordings reduced to moments |
//! | `table` | columns of data frames by role |

mod arrays;
mod errors;
mod examples;
mod explanation;
mod model;
mod moments;
mod options;
mod plant;
mod records;
mod responses;
mod simulator;
mod table;

use pyo3::prelude::*;

#[pymodule]
fn _innovant(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add(
        "InnovantError",
        module.py().get_type::<errors::InnovantError>(),
    )?;
    module.add_class::<model::Model>()?;
    module.add_class::<explanation::Explanation>()?;
    module.add_class::<moments::Moments>()?;
    module.add_class::<plant::Plant>()?;
    module.add_function(wrap_pyfunction!(model::identify, module)?)?;
    module.add_function(wrap_pyfunction!(explanation::explain, module)?)?;
    module.add_function(wrap_pyfunction!(explanation::explain_plant, module)?)?;
    module.add_function(wrap_pyfunction!(responses::poles, module)?)?;
    module.add_function(wrap_pyfunction!(responses::zeros, module)?)?;
    module.add_function(wrap_pyfunction!(responses::default_frequencies, module)?)?;
    module.add_function(wrap_pyfunction!(responses::frequency_response, module)?)?;
    module.add_function(wrap_pyfunction!(responses::settling_samples, module)?)?;
    module.add_function(wrap_pyfunction!(responses::step_response, module)?)?;
    module.add_function(wrap_pyfunction!(responses::static_gain, module)?)?;
    module.add_function(wrap_pyfunction!(simulator::estimate_simulator, module)?)?;
    module.add_function(wrap_pyfunction!(examples::example, module)?)?;
    module.add_function(wrap_pyfunction!(table::find_columns, module)?)?;
    module.add_function(wrap_pyfunction!(table::time_base, module)?)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
