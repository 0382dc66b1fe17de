//! A plant as equations: a flat Modelica text, simulated with sensitivities and estimated with honest uncertainty.
//!
//! ```text
//! text ── syntax, sort ──> ModelSpec ── simulation ──> Plant ── simulate, linearise ──> outputs and sensitivities ── estimate ──> parameters
//! another program ── external ──> outputs, and sensitivities by differences ────────────────────────────────┘
//! ```

mod error;
pub mod estimate;
mod expression;
pub mod external;
mod modelica;
mod operating_point;
mod simulated;
mod simulation;
mod sort;
mod spec;
mod syntax;
mod units;

pub use error::{SpecError, SpecErrorKind, render_all};
pub(crate) use expression::{Binary, ExpressionId, Function, Node};
pub use expression::{Span, VariableId};
pub use operating_point::{Linearisation, OperatingPlant, OperatingPoint, OperatingPointError};
pub use simulated::{Run, RunError, Simulated, Slopes};
pub use simulation::{
    Direction, Excitation, Hold, LinearPlant, Observer, Plan, Plant, Point, SimulationError,
    Trajectory,
};
pub use spec::{Equation, ModelSpec, Unknown, Variable, VariableKind};
pub(crate) use syntax::{Token, function_names, is_reserved, nearest, tokens};
pub use syntax::{diagnose, parse};
#[cfg(feature = "cli")]
pub(crate) use units::other_clock;
pub(crate) use units::{Comparison, compare, rounded, unit_conflicts, units_in_words};
pub use units::{Unit, UnknownUnit, check_units, unknown_units};
