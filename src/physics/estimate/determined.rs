//! What a recording does not determine: single parameters, and products or ratios of several.

use nalgebra::DMatrix;

use super::problem::Problem;

/// A combination of parameters about which the recordings say nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Undetermined {
    /// Names of the parameters.
    pub parameters: Vec<String>,
    /// What is known of them, in words.
    pub message: String,
}

/// A direction in which the parameters may move by more than their own magnitude is not determined.
const WIDE: f64 = 1.0;
/// Share of a direction below which a parameter does not belong to it.
const MEMBER: f64 = 0.15;
/// A value below this part of the magnitude is as good as 0: no ratio is formed with it.
const ZERO: f64 = 1e-4;
/// Relative changes that agree within this are said to be a product or a ratio.
const EQUAL: f64 = 0.1;

/// Directions of the parameters that the recordings leave open.
pub(super) fn undetermined(
    problem: &Problem,
    point: &[f64],
    covariance: &DMatrix<f64>,
) -> Vec<Undetermined> {
    let names = problem.names();
    let p = names.len();
    let magnitudes = problem.magnitudes(point);
    let mut found: Vec<Undetermined> = Vec::new();
    let known: Vec<usize> = (0..p).filter(|&i| covariance[(i, i)].is_finite()).collect();
    for i in (0..p).filter(|i| !known.contains(i)) {
        found.push(Undetermined {
            parameters: vec![names[i].clone()],
            message: format!(
                "`{}` has no influence on the recorded outputs: fix it",
                names[i]
            ),
        });
    }
    // In units of their magnitudes, so that a standard deviation of 1 is as wide as what was known before.
    let scaled = DMatrix::from_fn(known.len(), known.len(), |a, b| {
        covariance[(known[a], known[b])] / (magnitudes[known[a]] * magnitudes[known[b]]).max(1e-300)
    });
    if known.is_empty() {
        return found;
    }
    let eigen = scaled.symmetric_eigen();
    for (k, value) in eigen.eigenvalues.iter().enumerate() {
        if value.sqrt() < WIDE {
            continue;
        }
        let direction = eigen.eigenvectors.column(k);
        // Relative changes along the direction; of a value near 0, its change in units of its magnitude.
        let change = |a: usize| {
            let (value, magnitude) = (point[known[a]], magnitudes[known[a]]);
            if value.abs() > ZERO * magnitude {
                direction[a] * magnitude / value
            } else {
                direction[a]
            }
        };
        let most = (0..known.len())
            .map(|a| change(a).abs())
            .fold(0.0, f64::max);
        let members: Vec<usize> = (0..known.len())
            .filter(|&a| change(a).abs() > MEMBER * most)
            .collect();
        let relative: Vec<f64> = members.iter().map(|&a| change(a)).collect();
        let who: Vec<String> = members.iter().map(|&a| names[known[a]].clone()).collect();
        let size = relative.iter().map(|r| r.abs()).fold(0.0, f64::max);
        let alike = relative
            .iter()
            .all(|r| (r.abs() / size - 1.0).abs() < EQUAL);
        let message = match (&who[..], alike) {
            ([one], _) => {
                format!("the recordings do not determine `{one}`: fix it, or record what shows it")
            }
            ([a, b], true) if relative[0] * relative[1] > 0.0 => {
                format!("the recordings determine {a} and {b} only as {a}/{b}: fix one of them")
            }
            ([a, b], true) => {
                format!("the recordings determine {a} and {b} only as {a}*{b}: fix one of them")
            }
            (_, true) if relative.iter().all(|r| *r * relative[0] > 0.0) => {
                format!(
                    "the recordings determine only the ratios of {}: fix one of them",
                    list(&who)
                )
            }
            _ => format!(
                "the recordings do not determine {} apart: fix one of them",
                list(&who)
            ),
        };
        // Several directions may concern the same parameters.
        if found.iter().all(|f| f.parameters != who) {
            found.push(Undetermined {
                parameters: who,
                message,
            });
        }
    }
    found
}

fn list(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [start @ .., last] => format!("{} and {last}", start.join(", ")),
    }
}
