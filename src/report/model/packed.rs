//! The covariance of the parameters in a model document.

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::covariance::{ParameterCovariance, ParameterLayout};

/// Degrees of freedom that a covariance may have: blocks of a jackknife less one.
const FREEDOM: std::ops::RangeInclusive<f64> = 1.0..=1e6;

/// What is said about every such covariance.
const NOTE: &str = "bound to the state basis of A, B, C, D, K in this document; of what does not depend on the \
                    basis, `invariants` and `innovant show` give the uncertainty";

/// Covariance of the entries of the matrices, stacked.
///
/// It is bound to the state basis of this document: another basis has another covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CovarianceDocument {
    /// What is stacked: `vec A`, `vec B`, `vec K`, `vec C` and, when it was estimated, `vec D`.
    pub parameters: Vec<String>,
    /// How a matrix is stacked: `column-major`.
    pub order: String,
    /// What the numbers are to be multiplied with: 1.
    pub scale: f64,
    /// The lower triangle row by row: (1,1), (2,1), (2,2), (3,1), ...
    pub packed_lower_triangle: Vec<f64>,
    /// Degrees of freedom of the covariance itself (Student and F quantiles); null for normal and chi-square
    /// quantiles.
    #[serde(default)]
    pub degrees_of_freedom: Option<f64>,
    /// What to keep in mind.
    #[serde(default)]
    pub note: String,
}

fn stacked(feedthrough: bool) -> Vec<String> {
    let matrices = ["A", "B", "K", "C", "D"];
    matrices[..if feedthrough { 5 } else { 4 }]
        .iter()
        .map(|matrix| format!("vec {matrix}"))
        .collect()
}

impl From<&ParameterCovariance> for CovarianceDocument {
    fn from(covariance: &ParameterCovariance) -> Self {
        let length = covariance.layout.len();
        let triangle = (0..length)
            .flat_map(|i| (0..=i).map(move |j| (i, j)))
            .map(|place| covariance.matrix[place])
            .collect();
        Self {
            parameters: stacked(covariance.layout.feedthrough),
            order: "column-major".to_owned(),
            scale: 1.0,
            packed_lower_triangle: triangle,
            degrees_of_freedom: covariance.degrees_of_freedom,
            note: NOTE.to_owned(),
        }
    }
}

impl CovarianceDocument {
    /// The covariance of a model with so many states, inputs and outputs, or what is wrong with it.
    pub(crate) fn covariance(
        &self,
        states: usize,
        inputs: usize,
        outputs: usize,
    ) -> Result<ParameterCovariance, String> {
        let feedthrough = self.parameters == stacked(true);
        if !feedthrough && self.parameters != stacked(false) {
            return Err(format!(
                "`parameters` must be {:?}, with \"vec D\" at the end when D was estimated",
                stacked(false)
            ));
        }
        if self.order != "column-major" {
            return Err(format!(
                "`order` must be \"column-major\", not {:?}",
                self.order
            ));
        }
        let layout = ParameterLayout {
            states,
            inputs,
            outputs,
            feedthrough,
        };
        let length = layout.len();
        let (expected, found) = (length * (length + 1) / 2, self.packed_lower_triangle.len());
        if expected != found {
            return Err(format!(
                "`packed_lower_triangle` has {found} numbers; {length} parameters need {expected}"
            ));
        }
        let matrix = DMatrix::from_fn(length, length, |i, j| {
            let (row, column) = (i.max(j), i.min(j));
            self.scale * self.packed_lower_triangle[row * (row + 1) / 2 + column]
        });
        if let Some(row) = (0..length).find(|i| matrix[(*i, *i)] < 0.0) {
            return Err(format!(
                "entry {0}, {0} is {1}, and a variance is not negative",
                row + 1,
                matrix[(row, row)]
            ));
        }
        if let Some(freedom) = self.degrees_of_freedom.filter(|f| !FREEDOM.contains(f)) {
            return Err(format!(
                "`degrees_of_freedom` is {freedom}; it is null, or from 1 to 1e6"
            ));
        }
        ParameterCovariance::new(layout, matrix, self.degrees_of_freedom)
            .map_err(|error| error.to_string())
    }
}
