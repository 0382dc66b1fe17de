//! Options of `identify`, from the JSON object that the Python side writes.

use innovant::Options;
use innovant::identify::Order;
use pyo3::PyResult;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::errors::raise;

/// Reads options; a key that is missing or `null` leaves the default.
///
/// # Errors
/// Names the option that is not what it can be.
pub fn options(json: &str) -> PyResult<Options> {
    let given: Map<String, Value> = serde_json::from_str(json).map_err(raise)?;
    let plain = Options::default();
    Ok(Options {
        method: field(&given, "method", plain.method)?,
        stochastic: field(&given, "stochastic", None)?,
        order: order(&given)?,
        past: field(&given, "past", None)?,
        future: field(&given, "future", None)?,
        weight: field(&given, "weight", None)?,
        polish: field(&given, "polish", plain.polish)?,
        covariance: field(&given, "covariance", plain.covariance)?,
        detrend: field(&given, "detrend", plain.detrend)?,
        feedthrough: field(&given, "feedthrough", false)?,
        input_delay: field(&given, "delay", Vec::new())?,
        stable: field(&given, "stable", false)?,
        seed: field(&given, "seed", 0)?,
        memory_limit: None,
    })
}

fn field<T: DeserializeOwned>(given: &Map<String, Value>, key: &str, default: T) -> PyResult<T> {
    match given.get(key) {
        None | Some(Value::Null) => Ok(default),
        Some(value) => {
            T::deserialize(value).map_err(|error| raise(format!("{key} = {value}: {error}")))
        }
    }
}

/// `null`, a number, or a list of numbers to compare.
fn order(given: &Map<String, Value>) -> PyResult<Order> {
    Ok(match given.get("order") {
        None | Some(Value::Null) => Order::Auto,
        Some(Value::Array(_)) => Order::Compare(field(given, "order", Vec::new())?),
        Some(_) => Order::Fixed(field(given, "order", 1)?),
    })
}
