//! A plant as equations: a flat Modelica text, simulated with sensitivities and estimated with honest uncertainty.
//!
//! ```text
//! text ── syntax, sort ──> ModelSpec ── tape ──> Plant ── simulate, linearise ──> answers and their slopes ── estimate ──> parameters
//! ```

mod choose;
mod dense;
mod dual;
mod error;
pub mod estimate;
mod execute;
mod expression;
mod field;
mod linearise;
mod modelica;
mod simulate;
mod sort;
mod spec;
mod step;
mod syntax;
mod tape;
mod units;
mod walk;

pub use error::{SpecError, SpecErrorKind};
pub use expression::{Binary, ExpressionId, Expressions, Function, Node, Span, VariableId};
pub use linearise::LinearPlant;
pub use simulate::{
    Direction, Excitation, Hold, Observer, Plan, Plant, Point, SimulationError, Trajectory,
};
pub use spec::{Equation, ModelSpec, Unknown, Variable, VariableKind};
pub use syntax::parse;
pub use units::{Unit, check_units};
