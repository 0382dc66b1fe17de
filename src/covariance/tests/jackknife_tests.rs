//! Tests of `jackknife`.

use super::*;

#[test]
fn of_a_mean_it_is_the_variance_over_n() {
    // For the sample mean the jackknife is exactly s^2 / n.
    let data = [1.0, 4.0, 2.5, 7.0, -1.0, 0.5];
    let n = data.len() as f64;
    let sum: f64 = data.iter().sum();
    let replicates: Vec<Vec<f64>> = data.iter().map(|x| vec![(sum - x) / (n - 1.0)]).collect();
    let layout = ParameterLayout {
        states: 1,
        inputs: 0,
        outputs: 0,
        feedthrough: false,
    };
    let covariance = jackknife_covariance(layout, &replicates).unwrap();
    let variance = data.iter().map(|x| (x - sum / n).powi(2)).sum::<f64>() / (n - 1.0);
    approx::assert_relative_eq!(
        covariance.matrix[(0, 0)],
        variance / n,
        max_relative = 1e-12
    );
    assert_eq!(covariance.degrees_of_freedom, Some(5.0));
    assert!(jackknife_covariance(layout, &replicates[..2]).is_none());
}
